#!/usr/bin/env bash
# Installs what is missing, builds everything, runs all tests. Arguments go to ctest
# (./tests/run.sh -R svd3).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build=$(.ci/build.sh)
ctest --test-dir "$build" --output-on-failure --parallel "$(nproc)" "$@"
