#!/usr/bin/env bash
# lumen's path tracer beside Blender's Cycles: CPU seconds to 5.5% noise on scenes/bench/colon.toml at 8 vertices, first
# with a diffuse wall and the light at the camera, where the two pictures' mean must agree, then with a texture, a coat
# and three guides. The second is a like scene, not the same: Cycles' noise texture, GGX over diffuse mixed by Fresnel's
# reflectance, a bump map. Both on so many threads, one after the other, the box filter, no clamp, no denoiser, no
# adaptive sampling; building trees of boxes isn't counted. Needs Blender with Cycles and its Python's NumPy
# (apt-get install --no-install-recommends blender python3-numpy); measured with Debian 12's Blender 3.4.1.
#
#   tools/compare_cycles.sh [FOLDER]   pictures side by side: FOLDER/diffuse.png, FOLDER/whole.png (default: out/cycles)
#   SAMPLES=16 THREADS=2               Cycles' samples a pixel, from which noise falls as their inverse root
set -euo pipefail
cd "$(dirname "$0")/.."
command -v blender >/dev/null || {
  echo "compare_cycles: Blender is missing: apt-get install --no-install-recommends blender python3-numpy" >&2
  exit 1
}

build=${LUMEN_BUILD:-build}
samples=${SAMPLES:-16} threads=${THREADS:-2}
folder=${1:-out/cycles}
tools/build.sh lumen lumen_bench_render
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)

# The camera of the benchmark, but centred and with square pixels, as Cycles' fisheye is.
sed 's|^preset = "c3vd"$|model = "scaramuzza"\
cx = 337\
cy = 269.5\
a = [384.6218, 0, -0.001625541, 2.502697e-06, -9.572975e-09]\
stretch = [1, 0, 0]|' scenes/bench/colon.toml >"$folder/diffuse.toml"
cat >"$folder/whole.toml" <<'SCENE'
base = "diffuse.toml"
[light]
source = [
  {position = [3.24, 0.55, 0], direction = [0, 0, 1], spread = 2.767302, intensity = [1200, 1200, 1200]},
  {position = [-2.77, 2.66, 0], direction = [0, 0, 1], spread = 2.767302, intensity = [1200, 1200, 1200]},
  {position = [-1.27, -3.14, 0], direction = [0, 0, 1], spread = 2.767302, intensity = [1200, 1200, 1200]}]
[surface]
mottling = {contrast = 0.2, scale_mm = 7}
vessels = {spacing_mm = 7, width_mm = 0.35}
coat = {ior = 1.37, roughness = 0.2}
SCENE

for scene in diffuse whole; do
  "$build/tools/lumen" render "$folder/$scene.toml" -o "$folder/$scene" --frames 0:1 --quiet --threads "$threads" \
    --set path.bounces=7 --set path.samples=8 --set 'truth.exact=["radiance"]'
  oiiotool "$folder/$scene/exact/0000.exr" --ch radiance.R,radiance.G,radiance.B --chnames R,G,B \
    -o "$folder/$scene.lumen.exr"
  blender -b --factory-startup --python-exit-code 1 --python tools/compare_cycles.py -- \
    "$folder/$scene" "$folder/$scene.cycles" "$scene" "$samples" "$threads" >"$folder/$scene.log" 2>&1 ||
    { tail -n 5 "$folder/$scene.log" >&2; exit 1; }
  oiiotool "$folder/$scene.lumen.exr" "$folder/$scene.cycles.exr" --mosaic 2x1 --mulc 0.6 --powc 0.4545 -d uint8 \
    -o "$folder/$scene.png"
  echo
  echo "Cycles, $scene"
  cat "$folder/$scene.cycles.txt"
done
echo
echo "lumen, the same two scenes"
"$build/tools/lumen_bench_render" "$folder/diffuse.toml" --only noise
