#!/usr/bin/env bash
# What the program needs to run on Debian bookworm: the second stage of Dockerfile and solver.def. Needs root.
set -euo pipefail
export DEBIAN_FRONTEND=noninteractive
apt-get update -q
# mpirun starts remote ranks by ssh.
apt-get install -y -q --no-install-recommends openmpi-bin libhdf5-openmpi-103-1 openssh-client
rm -rf /var/lib/apt/lists/*
