#!/usr/bin/env bash
# The main job: for an observed object of each material, find the latent code that explains its
# motion, simulate that code in another scene, and report: out/identify/identify/report.html opens in
# a browser. Arguments go to uniphy_identify
# (./experiments/identify.sh --out out/mine --set key.path=value; --no-report writes none).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

build=$(.ci/build.sh uniphy_identify)
exec "$build/bin/uniphy_identify" configs/identify/identify.yaml --report "$@"
