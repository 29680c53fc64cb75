#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
#
# snakemake.sh PREFIX SAMPLE: the installed Snakefile, run: one robot from two recordings in two shards, and a fleet of two.
# Exit codes: 0 passed, 1 failed, 77 no Snakemake here.
set -uo pipefail
kinescope=$1/bin/kinescope snakefile=$1/share/kinescope/cluster/Snakefile sample=$2
snakemake=${SNAKEMAKE:-snakemake}

for program in ${snakemake%% *} ffmpeg; do
  command -v "$program" >/dev/null && continue
  echo "SKIPPED: $program is not installed (apt-get install --no-install-recommends snakemake ffmpeg)"
  exit 77
done

folder=$(mktemp -d "${TMPDIR:-/tmp}/kinescope_snakemake.XXXXXX")
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
fail() {
  echo "FAILED: $1"
  exit 1
}
for part in "monday 0 4" "tuesday 4 8"; do
  read -r name from to <<<"$part"
  mkdir "$name"
  cp "$sample"/{camera.yaml,tags.yaml,joints.csv} "$name"
  ffmpeg -v error -ss "$from" -i "$sample/video.mp4" -to "$to" -copyts -qp 12 "$name/video.mp4" || fail "no video"
done
printf 'monday\ntuesday\n' >recordings.txt
printf 'robot,recording\nfirst,monday\nabsent,nowhere\n' >robots.csv
export OPENBLAS_NUM_THREADS=1
make() {
  $snakemake --snakefile "$snakefile" --cores 2 --quiet --config "kinescope=$kinescope" shards=2 "$@" || fail "$*"
}
make run=recordings.txt output=run "options=--no-trace --folds 3"
"$kinescope" run @recordings.txt --output whole --quiet --no-trace --folds 3 >/dev/null || fail "no run in one piece"
for name in robot.urdf structure.json calibration.json residuals.csv tracks.csv result.json; do
  cmp "run/$name" "whole/$name" || fail "$name differs from the run in one piece"
done
make fleet=robots.csv output=fleet "options=--no-trace --folds 0"
[[ $(cut -d , -f 1,2 fleet/fleet.csv | tr '\n' ' ') == "robot,exit_code absent,3 first,0 " ]] || fail "another table"
echo "passed: one robot out of two shards, and a fleet of two"
