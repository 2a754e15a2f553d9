#!/usr/bin/env bash
# Installs what is missing, then configures and builds. Usage: tools/build.sh [TARGET]...
# LUMEN_BUILD names another build folder; LUMEN_CMAKE_ARGS is passed to cmake, e.g. -DLUMEN_NATIVE=OFF.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/setup.sh
build=${LUMEN_BUILD:-build}
# shellcheck disable=SC2086 # the arguments are meant to be split
cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release ${LUMEN_CMAKE_ARGS:-} >"$build.configure.log" 2>&1 ||
  { cat "$build.configure.log" >&2; exit 1; }
rm -f "$build.configure.log"
cmake --build "$build" --target "${@:-all}"
