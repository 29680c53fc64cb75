#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing to build and run Kinescope (Debian 12, Ubuntu 24.04). `setup.sh tests` adds what only
# the tests need, `setup.sh package` what makes Debian packages. Does nothing where everything is there.
set -euo pipefail

packages=(
  g++ cmake ninja-build pkg-config git ca-certificates
  libopencv-dev libapriltag-dev libopenblas-pthread-dev libceres-dev libeigen3-dev liburdfdom-dev
  libtinyxml2-dev libyaml-cpp-dev libcli11-dev libfmt-dev nlohmann-json3-dev libssl-dev zlib1g-dev libsvm-dev libdlib-dev
  libavformat-dev libavcodec-dev libavutil-dev libswscale-dev
  libzstd-dev libsnappy-dev liblz4-dev libbz2-dev libsqlite3-dev libcpp-httplib-dev
  esbuild libjs-three
  pybind11-dev python3-dev python3-numpy
)
if [[ "${1:-}" == tests ]]; then
  packages+=(libgtest-dev librapidcheck-dev liborocos-kdl-dev liburdfdom-tools libbenchmark-dev
             python3-jsonschema python3-matplotlib groff-base zsh dpkg-dev file libscalapack-openmpi-dev openmpi-bin)
  # Not in every release; the tests that want them say so and skip.
  optional=(libmujoco-dev clang-format-19 chromium)
else
  optional=()
  if [[ "${1:-}" == package ]]; then packages+=(dpkg-dev file); fi
fi

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
wanted=()
for package in "${optional[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || wanted+=("$package")
done
if ((${#missing[@]} + ${#wanted[@]} == 0)); then exit 0; fi

sudo=()
if ((EUID != 0)); then sudo=(sudo); fi
"${sudo[@]}" apt-get update
for package in "${wanted[@]}"; do
  if apt-cache show "$package" >/dev/null 2>&1; then missing+=("$package"); fi
done
if ((${#missing[@]} > 0)); then
  echo "Installing: ${missing[*]}"
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"
fi
