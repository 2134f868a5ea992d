#!/usr/bin/env bash
# Builds the program inside a container: the first stage of Dockerfile and solver.def. Needs Rust, and the sources around it.
#
#   bash jobs/container/build.sh [PREFIX]      PREFIX/bin/solver, by default /opt/solver
#
# The binary must also run on the nodes of a cluster that differ from the one it is built on: it is built for plain x86-64 (or
# whichever machine builds it) and chooses its vector width when it starts.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
prefix=${1:-/opt/solver}
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
install_needs
use_environment
# The sources may belong to another user, of whom git would not tell the commit.
if command -v git >/dev/null; then
  git config --global --add safe.directory "$root"
fi
cargo install --locked --path "$root" --root "$prefix" --no-track
"$prefix/bin/solver" --version
