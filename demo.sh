#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds, and runs the main job on a sample recording (or on the one named).
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh
cmake --workflow --preset release
recording="${1:-sample_videos/scara4_none}"
build/release/kinescope run "$recording" --output "build/$(basename "$recording")_run"
