#!/usr/bin/env bash
# What a scene pays for physics that it does not use: memory, and work of the step. Writes results/unused.csv.
#
#   bash benches/unused.sh            builds solver and the bench `lbm`, then measures
#
# Work is counted in instructions (valgrind), which other users of the machine do not change; each number is the difference of two
# runs that differ in their steps or cells alone, so that start and end do not count. Environment: SOLVER, LBM_BENCH (binaries; without
# the second no row is beside the bare kernel).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
if [ -z "${SOLVER:-}" ]; then
  (cd "$root" && cargo build --release --locked --bin solver && cargo bench --no-run --locked --bench lbm)
  SOLVER=$target/release/solver
  LBM_BENCH=$(find "$target/release/deps" -maxdepth 1 -name 'lbm-*' -type f -perm -u+x -printf '%T@ %p\n' | sort -n | tail -1 | cut -d' ' -f2)
fi
export SOLVER LBM_BENCH=${LBM_BENCH:-}
export OMP_NUM_THREADS=1 RAYON_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
machine="$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1), $(nproc --all) cores"
python3 "$here/unused.py" "$work" "$("$SOLVER" -V)" "$machine" > "$work/unused.csv"
cp "$work/unused.csv" "$here/results/unused.csv"
cat "$here/results/unused.csv"
