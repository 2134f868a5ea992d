#!/usr/bin/env bash
# Entry point of the container. `mpirun ...` and programs in the container run as they are; anything else is a command of the solver:
#
#   docker run solver --version
#   docker run -v "$PWD:/work" solver mpirun -n 4 solver case.json
#   mpirun -n 4 apptainer run solver.sif case.json
set -euo pipefail
if [ "$(id -u)" = 0 ]; then
  # Open MPI refuses root otherwise; in a container root is the only user.
  export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
fi
# Containers often forbid the single-copy system call; without this Open MPI prints a warning for each rank.
export OMPI_MCA_btl_vader_single_copy_mechanism=${OMPI_MCA_btl_vader_single_copy_mechanism:-none}
case ${1:-} in
  mpirun | mpiexec | solver | bash | sh) exec "$@" ;;
  *) exec solver "$@" ;;
esac
