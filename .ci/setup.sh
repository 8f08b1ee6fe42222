#!/usr/bin/env bash
# Installs the Debian packages the build needs. Asks nothing; does nothing when all are there.
set -euo pipefail

packages=(
  build-essential cmake ninja-build ccache
  libtorch-dev libopenblas-dev libeigen3-dev libxsimd-dev
  libnanoflann-dev  # k-d trees of the clouds that an observation is compared with
  libhdf5-dev zlib1g-dev libyaml-cpp-dev nlohmann-json3-dev
  libcli11-dev libspdlog-dev libfmt-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  gnuplot-nox  # the charts and pictures of the reports
  libjs-three  # three.js, which plays the motions of report.html
  chromium  # in which a test opens report.html
  python3-torch python3-h5py  # torch.ops.uniphy in tests/python, experiments/algorithm2.py
  python3-yaml python3-jsonschema  # read what is written as YAML 1.1, hold configs/ to --schema
  python3-numpy python3-mpmath pyflakes3  # coefficients of the activations, lint of Python files
  paraview python3-paraview  # pvpython, whose readers a test tries on a trajectory's XDMF
)

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "setup: no apt here; expecting these to be installed: ${packages[*]}" >&2
  exit 0
fi

# A LibTorch of the user's own (CMAKE_PREFIX_PATH or Torch_DIR) makes Debian's superfluous.
for prefix in ${Torch_DIR:+"$Torch_DIR"} $(tr ':;' '  ' <<<"${CMAKE_PREFIX_PATH:-}"); do
  if [[ -e "$prefix/TorchConfig.cmake" || -e "$prefix/share/cmake/Torch/TorchConfig.cmake" ]]; then
    packages=("${packages[@]/libtorch-dev/}")
    packages=("${packages[@]/python3-torch/}")  # belongs to Debian's
  fi
done
# gnuplot with windows (gnuplot-qt, gnuplot-x11) will do as well.
if command -v gnuplot >/dev/null; then
  packages=("${packages[@]/gnuplot-nox/}")
fi

missing=()
for package in ${packages[@]}; do
  status=$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true)
  [[ "$status" == "install ok installed" ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  exit 0
fi

as_root=()
if ((EUID != 0)); then
  if ! command -v sudo >/dev/null; then
    echo "setup: needs root or sudo to install: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "setup: installing ${missing[*]}"
${as_root[@]+"${as_root[@]}"} env DEBIAN_FRONTEND=noninteractive apt-get update -q
${as_root[@]+"${as_root[@]}"} env DEBIAN_FRONTEND=noninteractive \
  apt-get install -q -y --no-install-recommends "${missing[@]}"
