#!/usr/bin/env bash
# Installs the Debian 12 packages that lumen is built from. Does nothing when all are there.
set -euo pipefail

# openimageio-tools: Debian's CMake file of OpenImageIO refuses to load without its programs. python3: reads in
# the tests what is exported for other programs. valgrind: counts in a test what an effect that is off costs.
packages=(
  g++ cmake ninja-build
  libembree-dev libopenimageio-dev openimageio-tools libeigen3-dev libcgal-dev libopenmesh-dev libtbb-dev
  libfmt-dev libtomlplusplus-dev libcli11-dev nlohmann-json3-dev libgtest-dev libbenchmark-dev fonts-dejavu-core
  python3 valgrind
)

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if command -v sudo >/dev/null; then
    as_root=(sudo)
  else
    echo "setup: these packages are missing and only root can install them: ${missing[*]}" >&2
    echo "setup: as root, run: apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
  fi
fi
echo "setup: installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
