#!/usr/bin/env bash
# Mutants of every case, study and input file, and of a checkpoint with its hashes made anew: the long form of two tests.
#
#   bash jobs/reliability/mutants.sh [MUTANTS] [FIRST SEED] [CHECKPOINT MUTANTS]
#
# Without arguments 20000 mutants of texts from seed 0, and 1000 of a checkpoint. The texts are read and planned in one
# process with 4 GiB of address space; one in twenty also goes through the binary with 1 GiB. A failure names its seed,
# and `bash jobs/reliability/mutants.sh 1 SEED 0` makes that mutant again.
set -euo pipefail
cd "$(dirname "$0")/../.."

mutants=${1:-20000}
first=${2:-0}
checkpoints=${3:-1000}

cargo test --release --test suite --no-run
ulimit -v 4194304
SOLVER_MUTANTS=$mutants SOLVER_MUTANTS_FROM=$first \
  cargo test --release --test suite -- mutants_are_planned --nocapture --test-threads 1
if [ "$checkpoints" -gt 0 ]; then
  SOLVER_CHECKPOINT_MUTANTS=$checkpoints cargo test --release --test suite -- no_signed_mutant --nocapture --test-threads 1
fi
