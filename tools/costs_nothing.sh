#!/usr/bin/env bash
# Shows that what was added since a revision costs a plain scene nothing, by counting instructions under callgrind.
#
#   tools/costs_nothing.sh REVISION   Tracing the plain scene's frame takes as many instructions as at that revision
#                                     (±0.1%), and it has the same bytes. For a commit that adds an effect: its
#                                     parent. Not for one that means to change the plain scene.
#
# The suite CostsNothing of the tests shows, without a revision, that no instruction of an effect's files is run
# where a scene doesn't name it; this adds the paths' own files, which may branch for an effect. Doesn't show: time
# that no instruction tells of (caches); machines with instructions that valgrind doesn't know, for which both
# programs are built without them (x86-64-v3). Needs valgrind; builds in build/callgrind, some minutes the first time.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 1 ] || { echo "usage: tools/costs_nothing.sh REVISION" >&2; exit 2; }
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

build() {  # SOURCES FOLDER
  cmake -S "$1" -B "$2" -G Ninja -DCMAKE_BUILD_TYPE=Release -DLUMEN_NATIVE=OFF -DLUMEN_TESTS=OFF \
    -DCMAKE_CXX_FLAGS="-g1 -march=x86-64-v3" >"$2.log" 2>&1 && cmake --build "$2" --target lumen >>"$2.log" 2>&1 ||
    { tail -n 30 "$2.log" >&2; exit 1; }
}

count() {  # PROGRAM OUT SCENE ARGUMENT...: callgrind's file OUT.callgrind, frames in OUT
  local program=$1 out=$2
  shift 2
  # Only what traces paths: reading scenes and writing files may change with what there is to read and write.
  valgrind --tool=callgrind --callgrind-out-file="$out.callgrind" --toggle-collect='lumen::RenderFrame(*' \
    "$program" render "$@" -o "$out" --frames 0:1 --seed 1 --threads 1 --quiet >"$out.log" 2>&1 ||
    { tail -n 5 "$out.log" >&2; exit 1; }
}

total() { awk '/^(summary|totals):/ {print $2; exit}' "$1"; }

# The sources stay where they are, so that the next comparison compiles what changed.
if [ -d "$folder/sources" ]; then
  git -C "$folder/sources" checkout --quiet --detach "$(git rev-parse "$1")"
else
  git worktree add --quiet --detach "$folder/sources" "$1"
fi
build . "$folder/here"
build "$folder/sources" "$folder/there"
count "$folder/here/tools/lumen" "$scratch/here" "$scratch/plain.toml"
count "$folder/there/tools/lumen" "$scratch/there" "$scratch/plain.toml"
here=$(total "$scratch/here.callgrind") there=$(total "$scratch/there.callgrind")
echo "instructions to trace the plain frame: $here here, $there at $1"
failed=0
awk -v a="$here" -v b="$there" 'BEGIN {exit !(a > 0 && b > 0 && a <= 1.001 * b && a >= 0.999 * b)}' ||
  { echo "costs_nothing: they differ by more than 0.1%" >&2; failed=1; }
cmp "$scratch/here/0000_color.png" "$scratch/there/0000_color.png" || failed=1
exit $failed
