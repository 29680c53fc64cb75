#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
#
# slurm.sh PREFIX SAMPLE: the installed kinescope.slurm on a cluster of one machine with two nodes, whose services it starts
# on loopback in a temporary folder and stops. One robot from two recordings, byte for byte as from one command, and a
# fleet with a robot that fails. Exit codes: 0 passed, 1 failed, 77 no Slurm here.
set -uo pipefail
kinescope=$1/bin/kinescope script=$1/share/kinescope/cluster/kinescope.slurm sample=$2

for program in slurmctld slurmd sbatch squeue ffmpeg; do
  PATH=$PATH:/usr/sbin command -v "$program" >/dev/null && continue
  echo "SKIPPED: $program is not installed (apt-get install --no-install-recommends slurmctld slurmd slurm-client ffmpeg)"
  exit 77
done
if [[ $(id -u) != 0 ]]; then
  echo "SKIPPED: slurmd starts jobs as their user, and must be root for that"
  exit 77
fi
PATH=$PATH:/usr/sbin

folder=$(mktemp -d "${TMPDIR:-/tmp}/kinescope_slurm.XXXXXX")
services=()
stop() {
  scancel --user=root --quiet 2>/dev/null
  if ((${#services[@]})); then
    kill "${services[@]}" 2>/dev/null
    wait "${services[@]}" 2>/dev/null
  fi
  rm -rf "$folder"
}
trap stop EXIT
fail() {
  echo "FAILED: $1"
  tail -n 15 "$folder"/*.log
  exit 1
}

# Ports that nobody listens on.
free_ports() {
  python3 -c '
import socket
taken = [socket.socket() for _ in range(3)]
for one in taken: one.bind(("127.0.0.1", 0))
print(*(one.getsockname()[1] for one in taken))'
}
read -r control first second < <(free_ports)
host=$(hostname -s)
export SLURM_CONF=$folder/slurm.conf
cat >"$SLURM_CONF" <<CONF
ClusterName=kinescope
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$control
# Nobody but this machine can speak to what asks for no password.
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmUser=root
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool-%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd-%n.pid
SlurmdParameters=config_overrides
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$first CPUs=2
NodeName=node2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$second CPUs=2
PartitionName=all Nodes=node1,node2 Default=YES State=UP
CONF
mkdir "$folder/state" "$folder"/spool-node{1,2}
slurmctld -D -i >"$folder/slurmctld.log" 2>&1 &
services+=($!)
for node in node1 node2; do
  slurmd -D -N "$node" >"$folder/slurmd-$node.log" 2>&1 &
  services+=($!)
done
for ((i = 0; i < 100; ++i)); do
  [[ $(sinfo --noheader --states=idle --format=%D 2>/dev/null) == 2 ]] && break
  sleep 0.2
done
[[ $(sinfo --noheader --states=idle --format=%D 2>/dev/null) == 2 ]] || fail "no two nodes are up"

# Two recordings: the sample's first seconds, and those in its middle.
cd "$folder" || exit 1
for part in "monday 0 4" "tuesday 4 8"; do
  read -r name from to <<<"$part"
  mkdir "$name"
  cp "$sample"/{camera.yaml,tags.yaml,joints.csv} "$name"
  ffmpeg -v error -ss "$from" -i "$sample/video.mp4" -to "$to" -copyts -qp 12 "$name/video.mp4" || fail "no video"
done
printf 'monday\ntuesday\n' >recordings.txt
printf 'robot,recording\nfirst,monday\nabsent,nowhere\n' >robots.csv
export KINESCOPE=$kinescope OPENBLAS_NUM_THREADS=1

finish() {
  for ((i = 0; i < 600; ++i)); do
    [[ -z $(squeue --noheader 2>/dev/null) ]] && return
    sleep 0.5
  done
  fail "the jobs do not end"
}
bash "$script" run 2 recordings.txt run --no-trace --folds 3 || fail "no job was taken"
sleep 1
squeue --noheader --format="%i %T %N" | sed 's/^/  /'
finish
[[ -f run/robot.urdf ]] || fail "no robot"
"$kinescope" run @recordings.txt --output whole --quiet --no-trace --folds 3 >/dev/null || fail "no run in one piece"
for name in robot.urdf structure.json calibration.json residuals.csv tracks.csv result.json; do
  cmp "run/$name" "whole/$name" || fail "$name differs from the run in one piece"
done
bash "$script" fleet 2 robots.csv fleet --no-trace --folds 0 || fail "no job was taken"
finish
cut -d , -f 1,2 fleet/fleet.csv
[[ $(cut -d , -f 1,2 fleet/fleet.csv | tr '\n' ' ') == "robot,exit_code absent,3 first,0 " ]] || fail "another table"
echo "passed: one robot out of two shards, and a fleet of two"
