#!/usr/bin/env bash
# Shows that training which is killed loses nothing: kills a run at random moments, a hundred unless told, resumes
# it every time, and compares what it ends with byte by byte with a run that nobody disturbed.
#
#   tools/kill_and_resume.sh SEQUENCE [KILLS [train's options]…]
#
# LUMEN names the program (default: build/tools/lumen). The run writes a checkpoint after every step, so that kills
# fall into its writing too. Exit code 0: the same bytes.
set -euo pipefail
sequence=$1
kills=${2:-100}
shift $(($# < 2 ? $# : 2))
lumen=${LUMEN:-$(dirname "$0")/../build/tools/lumen}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
options=(--quiet --set sampling.rays=64 --set extract.cell_mm=3 --set grid.log2_table_size=12
         --set schedule.checkpoint_seconds=0 "$@")
whole_run=(--iterations 4000)

"$lumen" train "$sequence" -o "$scratch/whole" "${options[@]}" "${whole_run[@]}" >/dev/null
# A run of one step says how long frames take to read here: a third of the kills is to come later than that.
began=$(date +%s%N)
"$lumen" train "$sequence" -o "$scratch/short" "${options[@]}" --iterations 1 >/dev/null
latest_ms=$((3 * ($(date +%s%N) - began) / 2000000))
RANDOM=1
before=0 fell_back=0 ended=0
for ((i = 0; i < kills; ++i)); do
  "$lumen" train "$sequence" -o "$scratch/killed" "${options[@]}" "${whole_run[@]}" --resume >/dev/null 2>&1 &
  ms=$((RANDOM % latest_ms))
  sleep "$((ms / 1000)).$(printf '%03d' $((ms % 1000)))"
  kill -9 $! 2>/dev/null || ended=$((ended + 1))
  wait $! 2>/dev/null || true
  if [[ -e $scratch/killed/checkpoint.before ]]; then
    before=$((before + 1))
    if [[ ! -e $scratch/killed/checkpoint ]]; then fell_back=$((fell_back + 1)); fi
  fi
done
"$lumen" train "$sequence" -o "$scratch/killed" "${options[@]}" "${whole_run[@]}" --resume >/dev/null
[[ $before -gt 0 ]] || { echo "every kill came before the second checkpoint: nothing is shown" >&2; exit 1; }
echo "$kills runs: $((kills - ended)) killed, $ended had ended; $before killed after the second checkpoint, $fell_back of them within its renames"
left=$(find "$scratch/killed" -name '.*.tmp*' | wc -l)
echo "$left temporary files are left"
for name in checkpoint mesh.ply config.toml; do cmp "$scratch/whole/$name" "$scratch/killed/$name"; done
[[ $left == 0 ]]
echo "the same bytes"
