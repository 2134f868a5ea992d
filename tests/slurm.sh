#!/usr/bin/env bash
# The job scripts by a real sbatch.
#
#   bash tests/slurm.sh [FOLDER] [study] [preparation]
#
# `study`: two members of the piping study with a time limit that forces at least one requeue. `preparation`: the packing of
# the ground fissures with a time limit that ends it while the grains fall. Both without a name.
#
# Needs a running Slurm in which this user may submit (one node is enough), and takes some minutes, so it is not part of
# tests/run.sh. Ends with 0 if every job finished, at least one of each kind was requeued, and every state hash and sample
# is that of a straight run.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
out=${1:-$root/results/slurm}
shift || true
parts=("$@")
[ $# -gt 0 ] || parts=(study preparation)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
use_environment
command -v sbatch >/dev/null || {
  echo "slurm: no sbatch" >&2
  exit 2
}
export SOLVER=${SOLVER:-$root/target/release/solver}
[ -x "$SOLVER" ] || (cd "$root" && cargo build --release --locked --bin solver)
status=0
hash() { sed -n 's/.*"state_hash": "\([0-9a-f]*\)".*/\1/p' "$1/summary.json"; }

# await JOB: until it has left the queue, with what it said.
await() {
  for _ in $(seq 360); do
    [ -n "$(squeue -h -j "$1" 2>/dev/null)" ] || break
    sleep 5
  done
  if [ -n "$(squeue -h -j "$1" 2>/dev/null)" ]; then
    echo "slurm: job $1 still there after half an hour" >&2
    scancel "$1"
    exit 1
  fi
  cat "$out/$1"_*.out
}

study() {
  local pressures="0.30 0.05" job requeues folder name a b steps
  # Long enough that two minutes do not do; SLURM_END for faster machines.
  local end=${SLURM_END:-12}
  local study=("$root/jobs/piping_erosion/study.sh" --pressures "$pressures" --end "$end")

  echo "slurm: sample and straight runs"
  rm -rf "$out/straight" "$out/requeued"
  bash "${study[@]}" --output "$out/straight" prepare >/dev/null
  mkdir -p "$out/requeued"
  cp -r "$out/straight"/sample.csv "$out/requeued/"
  job=$(cd "$root/jobs/piping_erosion" && sbatch --parsable --array=0-1 --time=2 --signal=B:USR2@60 --output="$out/%A_%a.out" --export=ALL \
    study.sbatch --pressures "$pressures" --end "$end" --output "$out/requeued")
  echo "slurm: job $job"
  await "$job"
  bash "${study[@]}" --output "$out/straight" --at-once 2 all >/dev/null

  requeues=$(cat "$out/$job"_*.out | grep -c '^study.sbatch: requeued' || true)
  echo "slurm: $requeues requeues"
  [ "$requeues" -gt 0 ] || status=1
  for folder in "$out"/straight/C*/; do
    name=$(basename "$folder")
    a=$(hash "$folder")
    b=$(hash "$out/requeued/$name")
    steps=$(sed -n 's/^ *"steps": \([0-9]*\).*/\1/p' "$folder/summary.json")
    if [ -n "$a" ] && [ "$a" = "$b" ]; then
      echo "ok      $name: $steps steps, state $a, straight and requeued"
    else
      echo "FAILED  $name: straight '$a', requeued '$b'"
      status=1
    fi
  done
}

preparation() {
  local job requeues a b
  # Small, and long enough that a minute does not do; SLURM_END of the water for slower machines.
  local options=(--scale small --ranks 1 --end "${SLURM_FISSURE_END:-2e-4}")
  rm -rf "$out/prepared" "$out/unprepared"
  job=$(cd "$root/jobs/ground_fissure" && sbatch --parsable --array=0 --ntasks=1 --time=1 --signal=B:USR2@50 \
    --output="$out/%A_%a.out" --export=ALL fissure.sbatch "${options[@]}" --output "$out/unprepared")
  echo "slurm: job $job"
  await "$job"
  bash "$root/jobs/ground_fissure/run.sh" "${options[@]}" --output "$out/prepared" sand >/dev/null
  requeues=$(grep -c 'the packing is in the making' "$out/$job"_*.out || true)
  echo "slurm: $requeues requeues in the preparation"
  [ "$requeues" -gt 0 ] || status=1
  if cmp "$out/prepared/sample.csv" "$out/unprepared/sample.csv"; then
    echo "ok      the packing: $(($(wc -l <"$out/prepared/sample.csv") - 1)) grains, the same straight and requeued"
  else
    status=1
  fi
  a=$(hash "$out/prepared/sand")
  b=$(hash "$out/unprepared/sand")
  if [ -n "$a" ] && [ "$a" = "$b" ]; then
    echo "ok      sand: state $a, straight and requeued"
  else
    echo "FAILED  sand: straight '$a', requeued '$b'"
    status=1
  fi
}

mkdir -p "$out"
for part in "${parts[@]}"; do
  case $part in
    study | preparation) "$part" ;;
    *)
      echo "slurm: no test '$part': study, preparation" >&2
      exit 2
      ;;
  esac
done
exit "$status"
