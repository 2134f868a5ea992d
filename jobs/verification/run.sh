#!/usr/bin/env bash
# The verification cases in their long forms (minutes each); `cargo test --test suite verification` runs the short ones.
# Writes results.csv beside this script, one row per quantity; ends with status 1 if one misses its reference.
#
#   bash jobs/verification/run.sh [NAME...]        # all cases, or those named
#   bash jobs/verification/run.sh --single         # lattice Boltzmann cases with arithmetic in f32, to single-precision.csv
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
install_needs
use_environment
cd "$root"

target=${CARGO_TARGET_DIR:-$root/target}
cargo build --locked --release --bin solver
cargo build --locked --example verify
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
results=$here/results.csv
if [ "${1:-}" = --single ]; then
  results=$here/single-precision.csv
  set -- --set fluid.lattice_boltzmann.arithmetic=f32 taylor-green taylor-green-3d taylor-green-d3q27 poiseuille-force poiseuille-pressure \
    poiseuille-3d couette couette-3d duct cavity cavity-3d
fi
"$target/debug/examples/verify" long "$target/release/solver" "$work" "$results" "$@"
