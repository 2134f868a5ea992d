#!/usr/bin/env bash
# What building and running need: checked, and installed where that is allowed.
#
#   bash jobs/install.sh            compiler, Open MPI, parallel HDF5, libclang; Rust is checked only
#   bash jobs/install.sh --tests    the same, and what the tests need beside it (Python with venv)
#   bash jobs/install.sh --kernels  the same, and the compiler that makes the kernels for GPUs (src/lbm/gpu/build.sh): only where they change
#
# Works as root and with sudo on Debian and its kin. Where it may not install, it names what is missing and ends with
# status 1. Other scripts source it and call `install_needs` and `use_environment`.

# The packages that are missing, one a line; with --tests those of the tests too.
missing_packages() {
  command -v cc >/dev/null || echo build-essential
  command -v pkg-config >/dev/null || echo pkg-config
  command -v mpirun >/dev/null || echo openmpi-bin
  command -v mpicc >/dev/null || echo libopenmpi-dev
  [ -n "$(parallel_hdf5)" ] || echo libhdf5-openmpi-dev
  have_libclang || echo libclang-dev
  if [ "${1:-}" = --tests ]; then
    python3 -c 'import ensurepip, venv' 2>/dev/null || echo python3-venv
  elif [ "${1:-}" = --kernels ]; then
    [ -x /usr/bin/rustc ] || echo rustc-web
    [ -e /usr/lib/rustlib/src/rust/library/core/src/lib.rs ] || echo rust-web-src
  fi
}

# The root of an HDF5 built with MPI: HDF5_DIR where set, Debian's folder, `pkg-config` where pkg-config knows one;
# nothing where there is none.
parallel_hdf5() {
  local root
  if [ -n "${HDF5_DIR:-}" ]; then
    echo "$HDF5_DIR"
    return
  fi
  for root in /usr/lib/*/hdf5/openmpi; do
    if [ -e "$root/include/H5pubconf.h" ]; then
      echo "$root"
      return
    fi
  done
  if pkg-config --exists hdf5-openmpi 2>/dev/null || pkg-config --exists hdf5-mpi 2>/dev/null; then
    echo pkg-config
  fi
}

# libclang reads the headers of MPI when the bindings are made.
have_libclang() {
  [ -n "${LIBCLANG_PATH:-}" ] || holds_libclang /usr/lib/llvm-*/lib /usr/lib* /usr/lib/*-linux-gnu
}

# Whether one of these folders has a libclang. Its C++ sibling libclang-cpp, which other packages bring, is no help.
holds_libclang() {
  local folder
  for folder in "$@"; do
    if compgen -G "$folder/libclang.so*" >/dev/null || compgen -G "$folder/libclang-[0-9]*.so*" >/dev/null; then
      return
    fi
  done
  return 1
}

# Root needs no help; others need sudo.
as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  else
    sudo "$@"
  fi
}

# Installs what is missing; says what is missing and returns 1 where it may not. Argument: --tests, --kernels or nothing.
install_needs() {
  local missing
  missing=$(missing_packages "${1:-}" | tr '\n' ' ')
  if [ -n "${missing// /}" ]; then
    if ! command -v apt-get >/dev/null; then
      echo "install: missing: $missing" >&2
      echo "install: this system has no apt-get; install what these Debian packages hold (on a cluster: load the modules" >&2
      echo "install: of an MPI and of an HDF5 built with it, and set HDF5_DIR and LIBCLANG_PATH)" >&2
      return 1
    fi
    if [ "$(id -u)" != 0 ] && ! { command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; }; then
      echo "install: missing: $missing" >&2
      echo "install: not root and no sudo; ask for: apt-get install $missing" >&2
      return 1
    fi
    echo "install: apt-get install $missing"
    as_root apt-get update -q
    # The names are separate words on purpose.
    # shellcheck disable=SC2086
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $missing
    missing=$(missing_packages "${1:-}" | tr '\n' ' ')
    if [ -n "${missing// /}" ]; then
      echo "install: still missing after apt-get: $missing" >&2
      return 1
    fi
  fi
  check_rust
}

# Rust is the user's: it is checked, never installed.
check_rust() {
  local root need have
  root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
  if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
    export PATH="$HOME/.cargo/bin:$PATH"
  fi
  need=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$root/Cargo.toml" | head -n 1)
  if ! command -v cargo >/dev/null || ! command -v rustc >/dev/null; then
    echo "install: no Rust: install rustc and cargo $need or newer from https://rustup.rs" >&2
    return 1
  fi
  have=$(rustc --version | awk '{ print $2 }')
  if [ "$(printf '%s\n%s\n' "$need" "$have" | sort -V | head -n 1)" != "$need" ]; then
    echo "install: rustc $have is older than $need: run 'rustup update', or install from https://rustup.rs" >&2
    return 1
  fi
}

# Environment of builds and runs.
use_environment() {
  local hdf5
  hdf5=$(parallel_hdf5)
  # With the serial HDF5 installed too, the build could pick that one.
  if [ -n "$hdf5" ] && [ "$hdf5" != pkg-config ]; then
    export HDF5_DIR="$hdf5"
  fi
  if [ "$(id -u)" = 0 ]; then
    # Open MPI refuses root otherwise; in a container root is the only user.
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  fi
  # Containers often forbid the single-copy system call; without this Open MPI prints a warning for each rank.
  export OMPI_MCA_btl_vader_single_copy_mechanism=none
  # HDF5 locks the files that it opens, and some releases fail where a file system of a cluster has no locks. Files of the solver get
  # their name when they are complete, so that nobody reads one that is being written.
  export HDF5_USE_FILE_LOCKING=FALSE
  # mpirun waits twice as long at every end other than success, an abort or a checkpoint and 75 too; a timeout from
  # elsewhere would make each of them linger. Ask for a checkpoint by SIGUSR2: that has no time limit.
  unset OMPI_MCA_odls_base_sigkill_timeout
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then
  set -euo pipefail
  install_needs "$@"
  echo "install: all there"
fi
