#!/usr/bin/env bash
# The job script of the piping study by a real sbatch: two members, a time limit that forces at least one requeue, and the
# requeued ones equal to straight runs.
#
#   bash tests/slurm.sh [FOLDER]
#
# Needs a running Slurm in which this user may submit (one node is enough), and takes some minutes, so it is not part of
# tests/run.sh. Ends with 0 if both members finished, one of them was requeued, and every state hash is that of a straight
# run.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
out=${1:-$root/results/slurm}
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
use_environment
command -v sbatch >/dev/null || {
  echo "slurm: no sbatch" >&2
  exit 2
}
export SOLVER=${SOLVER:-$root/target/release/solver}
[ -x "$SOLVER" ] || (cd "$root" && cargo build --release --locked --bin solver)
pressures="0.30 0.05"
# Long enough that two minutes do not do; SLURM_END for faster machines.
end=${SLURM_END:-12}
study=("$root/jobs/piping_erosion/study.sh" --pressures "$pressures" --end "$end")
rm -rf "$out"
mkdir -p "$out"

echo "slurm: sample and straight runs"
bash "${study[@]}" --output "$out/straight" prepare >/dev/null
mkdir -p "$out/requeued"
cp -r "$out/straight"/sample.csv "$out/requeued/"
cd "$root/jobs/piping_erosion"
job=$(sbatch --parsable --array=0-1 --time=2 --signal=B:USR2@60 --output="$out/%A_%a.out" --export=ALL \
  study.sbatch --pressures "$pressures" --end "$end" --output "$out/requeued")
echo "slurm: job $job"
for _ in $(seq 360); do
  [ -n "$(squeue -h -j "$job" 2>/dev/null)" ] || break
  sleep 5
done
if [ -n "$(squeue -h -j "$job" 2>/dev/null)" ]; then
  echo "slurm: job $job still there after half an hour" >&2
  scancel "$job"
  exit 1
fi
cat "$out/$job"_*.out
bash "${study[@]}" --output "$out/straight" --at-once 2 all >/dev/null

requeues=$(cat "$out/$job"_*.out | grep -c '^study.sbatch: requeued' || true)
echo "slurm: $requeues requeues"
status=0
[ "$requeues" -gt 0 ] || status=1
hash() { sed -n 's/.*"state_hash": "\([0-9a-f]*\)".*/\1/p' "$1/summary.json"; }
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
exit "$status"
