#!/usr/bin/env bash
# The main job: renders a colon as an endoscope sees it, reconstructs it, and says by how many mm it is off.
# Usage: tools/try.sh [SCENE.toml [OUTPUT_FOLDER]]
set -euo pipefail
cd "$(dirname "$0")/.."

scene=${1:-scenes/colon.toml}
out=${2:-out/$(basename "$scene" .toml)}
tools/build.sh lumen
"${LUMEN_BUILD:-build}/tools/lumen" loop "$scene" -o "$out"
echo "The result lies in $out: mesh.ply, evaluation.json, sheet.png"
