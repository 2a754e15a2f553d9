#!/usr/bin/env bash
# Shows that an effect which a scene doesn't name costs it nothing, by counting instructions under callgrind.
#
#   tools/costs_nothing.sh            A plain scene runs no instruction from the files of any effect (those whose
#                                     header begins with "// Effect:"), inlined ones included; as a control,
#                                     scenes/effects/all.toml, or else scenes/effects/NAME.toml, runs some.
#   tools/costs_nothing.sh REVISION   Besides: tracing the plain scene's frames takes as many instructions as at
#                                     that revision (±0.1%), and they have the same bytes. For a commit that adds
#                                     an effect: its parent. Not for one that means to change the plain scene.
#
# Doesn't show: time that no instruction tells of (caches); machines with instructions that valgrind doesn't know,
# for which both programs are built without them (x86-64-v3); whether the paths' own file branches for an effect,
# except by the comparison with REVISION. Needs valgrind; builds in build/callgrind, some minutes the first time.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v valgrind >/dev/null || { echo "costs_nothing: valgrind is missing: apt-get install valgrind" >&2; exit 1; }

folder=${LUMEN_BUILD:-build}/callgrind
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cat >"$scratch/plain.toml" <<'SCENE'
geometry = {kind = "colon", length_mm = 50, tolerance_mm = 0.3}
trajectory = {kind = "withdrawal", start_mm = 26, end_mm = 20, frames = 2}
camera = {preset = "c3vd", width = 96, height = 80}
surface = {albedo = [0.7, 0.4, 0.3]}
response = {gamma = 2.2}
truth = {c3vd = false}
light = {model = "sls", calibrated = true, source = [
  {position = [0, 0, 0], direction = [0, 0, 1], spread = 2.77, intensity = [3000, 3000, 3000]}]}
SCENE
# Control of what is counted: every effect, small.
small=(--set camera.width=48 --set camera.height=40 --set path.samples=2 --set geometry.tolerance_mm=0.3)

build() {  # SOURCES FOLDER
  cmake -S "$1" -B "$2" -G Ninja -DCMAKE_BUILD_TYPE=Release -DLUMEN_NATIVE=OFF -DLUMEN_TESTS=OFF \
    -DCMAKE_CXX_FLAGS="-g1 -march=x86-64-v3" >"$2.log" 2>&1 && cmake --build "$2" --target lumen >>"$2.log" 2>&1 ||
    { tail -n 30 "$2.log" >&2; exit 1; }
}

count() {  # PROGRAM OUT SCENE ARGUMENT...: callgrind's file OUT.callgrind, frames in OUT
  local program=$1 out=$2
  shift 2
  valgrind --tool=callgrind --callgrind-out-file="$out.callgrind" "${toggle[@]}" \
    "$program" render "$@" -o "$out" --frames 0:1 --seed 1 --threads 1 --quiet >"$out.log" 2>&1 ||
    { tail -n 5 "$out.log" >&2; exit 1; }
}

# Instructions whose source lies in a file named NAME.h or NAME.cpp, wherever they were inlined; without what the
# program initialises at its start, whatever the scene.
of_effect() {  # CALLGRIND_FILE NAME
  callgrind_annotate --threshold=100 --show-percs=no --auto=no "$1" |
    awk -v name="/$2[.](h|cpp):" '$2 ~ name && !/:_GLOBAL__sub_I_/ {gsub(",", "", $1); sum += $1} END {print sum + 0}'
}

total() { awk '/^(summary|totals):/ {print $2; exit}' "$1"; }

build . "$folder/here"
program=$folder/here/tools/lumen
failed=0

toggle=()
count "$program" "$scratch/plain" "$scratch/plain.toml"
count "$program" "$scratch/all" scenes/effects/all.toml "${small[@]}"
printf '%-24s %16s %16s\n' effect "plain scene" "where named"
for header in $(grep -rlE '^// Effect:' sim --include='*.h' | sort); do
  name=$(basename "$header" .h)
  plain=$(of_effect "$scratch/plain.callgrind" "$name")
  all=$(of_effect "$scratch/all.callgrind" "$name")
  verdict=
  [ "$plain" -eq 0 ] || { verdict="  RUNS WHERE IT IS NOT NAMED"; failed=1; }
  if [ "$all" -eq 0 ] && [ -f "scenes/effects/$name.toml" ]; then
    count "$program" "$scratch/$name" "scenes/effects/$name.toml" "${small[@]}"
    all=$(of_effect "$scratch/$name.callgrind" "$name")
  fi
  [ "$all" -gt 0 ] || { verdict="$verdict  RUNS IN NO SCENE OF scenes/effects"; failed=1; }
  printf '%-24s %16s %16s%s\n' "$name" "$plain" "$all" "$verdict"
done

if [ $# -gt 0 ]; then
  # The sources stay where they are, so that the next comparison compiles what changed.
  if [ -d "$folder/sources" ]; then
    git -C "$folder/sources" checkout --quiet --detach "$(git rev-parse "$1")"
  else
    git worktree add --quiet --detach "$folder/sources" "$1"
  fi
  build "$folder/sources" "$folder/there"
  # Only what traces paths: reading scenes and writing files may change with what there is to read and write.
  toggle=(--toggle-collect='lumen::RenderFrame(*')
  count "$program" "$scratch/here" "$scratch/plain.toml"
  count "$folder/there/tools/lumen" "$scratch/there" "$scratch/plain.toml"
  here=$(total "$scratch/here.callgrind") there=$(total "$scratch/there.callgrind")
  echo "instructions to trace the plain frame: $here here, $there at $1"
  awk -v a="$here" -v b="$there" 'BEGIN {exit !(a > 0 && b > 0 && a <= 1.001 * b && a >= 0.999 * b)}' ||
    { echo "costs_nothing: they differ by more than 0.1%" >&2; failed=1; }
  cmp "$scratch/here/0000_color.png" "$scratch/there/0000_color.png" || failed=1
fi
exit $failed
