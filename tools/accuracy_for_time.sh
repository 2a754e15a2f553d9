#!/usr/bin/env bash
# What the reconstructor reaches in so many seconds of training: renders each scene once, trains on it with each seed for
# each time, and prints the median over seeds of the surveyed and the extended mean error with their range, in mm.
# Usage: tools/accuracy_for_time.sh DIR [SCENE]...; without scenes: the three that README's table shows.
# SECONDS_OF_TRAINING (default "5 15 60 300"), SEEDS (default "0 1 2") and PRESETS (default "fast") are lists; what
# lies in DIR is not made again.
set -euo pipefail
source_folder=$(cd "$(dirname "$0")/.." && pwd)
lumen=${LUMEN_BUILD:-$source_folder/build}/tools/lumen
usage="usage: $0 DIR [SCENE]..."
folder=${1:?"$usage"}
[ "${folder#-}" = "$folder" ] || { echo "$usage" >&2; exit 2; }
shift
[ $# -gt 0 ] || set -- "$source_folder"/scenes/{colon,colon_ct,colon_lit}.toml
seeds=(${SEEDS:-0 1 2})

# mean_error FILE SURFACE: out of what `lumen evaluate --json` writes.
mean_error() { tr -d ' \n' < "$1" | sed -n "s/.*\"$2\":{\"mae_mm\":\([0-9.e-]*\).*/\1/p"; }

# median_and_range NUMBER...
median_and_range() {
  printf '%s\n' "$@" | sort -g | awk '{v[NR] = $1} END {printf "%.2f (%.2f to %.2f)", v[int((NR + 1) / 2)], v[1], v[NR]}'
}

for scene in "$@"; do
  name=$(basename "$scene" .toml)
  sequence=$folder/$name/sequence
  [ -f "$sequence/sequence.toml" ] || "$lumen" render "$scene" -o "$sequence" --quiet
  for preset in ${PRESETS:-fast}; do
    for seconds in ${SECONDS_OF_TRAINING:-5 15 60 300}; do
      surveyed=() extended=()
      for seed in "${seeds[@]}"; do
        run=$folder/$name/${preset}_${seconds}s_$seed
        if [ ! -f "$run/evaluation.json" ]; then
          "$lumen" train "$sequence" -o "$run" --preset "$preset" --seconds "$seconds" --seed "$seed" --quiet > /dev/null
          "$lumen" evaluate "$run/mesh.ply" "$sequence" --quiet --json "$run/evaluation.json" > /dev/null
        fi
        surveyed+=("$(mean_error "$run/evaluation.json" surveyed)")
        extended+=("$(mean_error "$run/evaluation.json" extended)")
      done
      echo "$name, $preset, $seconds s: surveyed $(median_and_range "${surveyed[@]}"), extended $(median_and_range "${extended[@]}")"
    done
  done
done
