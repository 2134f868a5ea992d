#!/usr/bin/env bash
# Builds the programs of waLBerla that the benches run beside the solver, from its public source.
#
#   bash benches/peers/walberla.sh [SOURCE]
#
# SOURCE is a folder with the source; default: a clone of the commit below. The programs go to target/peers/walberla. Needs a
# C++20 compiler, MPI, and CMake 3.26 or later, which is installed into the Python environment of the peers if it is missing.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=benches/peers/install.sh
. "$here/install.sh"
repository=https://github.com/lssfau/walberla
commit=17a9f647db63c0874428cb254b446005ad2d83f6
folder=$(peers_folder)/walberla
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)

source=${1:-$folder/source}
if [ ! -e "$source/CMakeLists.txt" ]; then
  git init -q "$source"
  git -C "$source" fetch -q --depth 1 "$repository" "$commit"
  git -C "$source" checkout -q FETCH_HEAD
fi
cmake=cmake
if ! cmake --version 2>/dev/null | awk 'NR == 1 { split($3, v, "."); exit !(v[1] > 3 || v[2] >= 26) }'; then
  make_peer_venv
  cmake=$(dirname "$(peer_python)")/cmake
  [ -x "$cmake" ] || "$(peer_python)" -m pip install -q "cmake<4"
fi
options=(-DCMAKE_BUILD_TYPE=Release -DWALBERLA_OPTIMIZE_FOR_LOCALHOST=ON)
for part in TESTS BENCHMARKS TOOLS TUTORIALS EXAMPLES DOC; do
  options+=("-DWALBERLA_BUILD_$part=OFF")
done
"$cmake" -S "$source" -B "$folder/build" "${options[@]}"
"$cmake" --build "$folder/build" --target GravityWave --parallel "$(nproc)"
cp "$folder/build/apps/showcases/FreeSurface/GravityWave" "$folder/"
