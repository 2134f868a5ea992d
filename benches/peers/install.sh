#!/usr/bin/env bash
# What the benches beside the peers need: checked, and installed where that is allowed.
#
#   bash benches/peers/install.sh           everything
#   bash benches/peers/install.sh P-1 P-9   only what these rows need
#
# From Debian: LAMMPS, LIGGGHTS, YADE. From PyPI into target/peers/venv: lbmpy, FiPy. Compiled: the bandwidth probe. Works as
# root and with sudo; where it may not install, it names what is missing and ends with status 1. Other scripts source it.
peers=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=jobs/install.sh
. "$peers/../../jobs/install.sh"

# Where the environment, the probe and the unpacked states go.
peers_folder() { echo "${CARGO_TARGET_DIR:-$peers/../../target}/peers"; }

# peer_packages ROW...: the Debian packages that are missing for these rows, one a line.
peer_packages() {
  local row
  command -v cc >/dev/null || echo build-essential
  command -v taskset >/dev/null || echo util-linux
  python3 -c 'import ensurepip, venv' 2>/dev/null || echo python3-venv
  for row in "$@"; do
    case $row in
      P-1 | P-[34569]) [ -e "$(python3 -c 'import sysconfig; print(sysconfig.get_paths()["include"])' 2>/dev/null)/Python.h" ] || echo python3-dev ;;
      P-2 | P-8) command -v yade >/dev/null || echo yade ;;
      P-7)
        command -v lmp >/dev/null || echo lammps
        command -v liggghts >/dev/null || echo liggghts
        ;;
      P-10) command -v lmp >/dev/null || echo lammps ;;
    esac
  done | sort -u
}

# The Python environment; PEERS_VENV names one that is there already.
peer_python() { echo "${PEERS_VENV:-$(peers_folder)/venv}/bin/python"; }

make_peer_venv() {
  local folder python
  python=$(peer_python)
  if "$python" -c 'import lbmpy, pystencils, fipy' 2>/dev/null; then
    return 0
  fi
  if [ -n "${PEERS_VENV:-}" ]; then
    echo "install: PEERS_VENV=$PEERS_VENV has no lbmpy or no fipy" >&2
    return 1
  fi
  folder=$(peers_folder)
  mkdir -p "$folder"
  echo "install: lbmpy and FiPy into $folder/venv"
  rm -rf "$folder/venv" &&
    python3 -m venv "$folder/venv" &&
    "$folder/venv/bin/pip" install -q --disable-pip-version-check -r "$peers/requirements.txt"
}

make_probe() {
  local folder
  folder=$(peers_folder)
  mkdir -p "$folder"
  if [ ! -x "$folder/bandwidth" ] || [ "$peers/bandwidth.c" -nt "$folder/bandwidth" ]; then
    cc -O3 -march=native -fopenmp "$peers/bandwidth.c" -o "$folder/bandwidth"
  fi
}

# install_peers ROW...: all that these rows need.
install_peers() {
  local missing row
  missing=$(peer_packages "$@" | tr '\n' ' ')
  if [ -n "${missing// /}" ]; then
    if ! command -v apt-get >/dev/null || { [ "$(id -u)" != 0 ] && ! { command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; }; }; then
      echo "install: missing for $*, and not allowed to install: $missing" >&2
      return 1
    fi
    echo "install: apt-get install $missing"
    as_root apt-get update -q
    # The names are separate words on purpose.
    # shellcheck disable=SC2086
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends $missing
    missing=$(peer_packages "$@" | tr '\n' ' ')
    if [ -n "${missing// /}" ]; then
      echo "install: still missing after apt-get: $missing" >&2
      return 1
    fi
  fi
  make_probe || return 1
  for row in "$@"; do
    case $row in
      P-1 | P-[34569])
        make_peer_venv || return 1
        break
        ;;
    esac
  done
}

if [ "${BASH_SOURCE[0]}" = "$0" ]; then
  set -euo pipefail
  [ $# -gt 0 ] || set -- P-1 P-2 P-7 P-9 P-10
  install_peers "$@"
  echo "install: the peers are there"
fi
