#!/usr/bin/env bash
# Mutants of every case, study and input file, of all kinds of side files, and of a checkpoint with its hashes made anew: the long
# form of three tests.
#
#   bash jobs/reliability/mutants.sh [MUTANTS] [FIRST SEED] [CHECKPOINT MUTANTS] [SIDE FILES]
#
# Without arguments 20000 mutants of texts, 2000 of a checkpoint and 2000 side files, all with the seeds from 0 on. The texts are read and
# planned in one process with 4 GiB of address space; one in twenty also goes through the binary with 1 GiB. A failure names its seed,
# and `bash jobs/reliability/mutants.sh 1 SEED 0 0` makes that mutant again. The counts are added to `mutants.csv`, or to the file
# SOLVER_MUTANTS_CSV. SOLVER_PROFILE=dev takes the build of the gate instead of the release.
set -euo pipefail
cd "$(dirname "$0")/../.."

mutants=${1:-20000}
first=${2:-0}
checkpoints=${3:-2000}
files=${4:-2000}
export SOLVER_MUTANTS_CSV=${SOLVER_MUTANTS_CSV:-$PWD/jobs/reliability/mutants.csv}
export SOLVER_MUTANTS_FROM=$first

suite() {
  cargo test --profile "${SOLVER_PROFILE:-release}" --test suite -- "$@" --nocapture --test-threads 1
}

cargo test --profile "${SOLVER_PROFILE:-release}" --test suite --no-run
[ -s "$SOLVER_MUTANTS_CSV" ] || echo "kind,first seed,mutants,accepted,exit codes of the binary,wrong" >"$SOLVER_MUTANTS_CSV"
[ "$checkpoints" -eq 0 ] || SOLVER_CHECKPOINT_MUTANTS=$checkpoints nice -n 10 bash -c "$(declare -f suite); suite no_signed_mutant"
ulimit -v 4194304
[ "$files" -eq 0 ] || SOLVER_SIDE_FILES=$files nice -n 10 bash -c "$(declare -f suite); suite side_files"
[ "$mutants" -eq 0 ] || SOLVER_MUTANTS=$mutants nice -n 10 bash -c "$(declare -f suite); suite mutants_are_planned"
