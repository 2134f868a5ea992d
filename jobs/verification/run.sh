#!/usr/bin/env bash
# The verification cases in their long forms (minutes each); `cargo test --test suite verification` runs the short ones.
# Writes results.csv beside this script, one row per quantity; ends with status 1 if one misses its reference.
#
#   bash jobs/verification/run.sh [NAME...]        # all cases, or those named
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
"$target/debug/examples/verify" long "$target/release/solver" "$work" "$here/results.csv" "$@"
