#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the fuzz targets with clang and runs each for SECONDS (default 600), two at a time. A finding leaves
# its input in build/fuzz/findings and ends with an error.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds="${1:-600}"
cmake --preset fuzz
cmake --build --preset fuzz
mkdir -p build/fuzz/findings
run() {
  local name="$1" corpus="build/fuzz/corpus/$1"
  mkdir -p "$corpus"
  if "build/fuzz/fuzz_$name" -max_total_time="$2" -timeout=10 -rss_limit_mb=2048 -max_len=16384 -print_final_stats=1 \
    -artifact_prefix="build/fuzz/findings/$name-" "$corpus" "tests/fuzz/seeds/$name" >"build/fuzz/$name.log" 2>&1; then
    echo "$name: no finding in $(sed -n 's/^stat::number_of_executed_units: *//p' "build/fuzz/$name.log") inputs"
  else
    echo "$name: a finding, see build/fuzz/$name.log and build/fuzz/findings" >&2
    return 1
  fi
}
export -f run
ls tests/fuzz/seeds | xargs -P 2 -I{} bash -c "run {} $seconds"
