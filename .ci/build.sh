#!/usr/bin/env bash
# Configures the release preset and builds the given targets (all when none is given).
# Standard output: only the build directory; everything else goes to standard error.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build=${UNIPHY_BUILD_DIR:-$PWD/build/release}
{
  .ci/setup.sh
  cmake --preset release -B "$build"
  cmake --build "$build" --parallel "$(nproc)" ${1:+--target "$@"}
} >&2
echo "$build"
