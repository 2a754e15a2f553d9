#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test. Arguments go to ctest, e.g. -R Camera.
set -euo pipefail
cd "$(dirname "$0")/.."

tools/build.sh
build=${LUMEN_BUILD:-build}
ctest --test-dir "$build" --output-on-failure --timeout 600 -j "$(nproc)" "$@"
log=$build/Testing/Temporary/LastTest.log
# ctest counts suites, of which each may hold tests that found no data.
echo "$(grep -c '^\[       OK \]' "$log") tests passed, $(grep -c '^\[  SKIPPED \].*(' "$log") skipped; their log lies at $log"
