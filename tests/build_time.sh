#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# CPU minutes and wall time of a full build of a preset, and its slowest objects:
# tests/build_time.sh [PRESET [JOBS [CMake's options]]]
set -euo pipefail
cd "$(dirname "$0")/.."
preset="${1:-release}"
jobs="${2:-$(nproc)}"
folder="build/time_$preset"
rm -rf "$folder"
cmake --preset "$preset" -B "$folder" -DCCACHE_PROGRAM= "${@:3}" >/dev/null
TIMEFORMAT='%R %U %S'
figures="$( { time cmake --build "$folder" -j "$jobs" >"$folder/build.log" 2>&1; } 2>&1)" || {
  tail -n 40 "$folder/build.log"
  exit 1
}
awk '{printf "wall %.1f min, CPU %.1f min\n", $1 / 60, ($2 + $3) / 60}' <<<"$figures"
awk -F'\t' 'NF >= 4 {printf "%7.1f s  %s\n", ($2 - $1) / 1000, $4}' "$folder/.ninja_log" | sort -rn | awk 'NR <= 15'
