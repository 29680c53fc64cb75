#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds, and runs the tests.
set -euo pipefail
cd "$(dirname "$0")"
./setup.sh tests
cmake --workflow --preset test
