#!/usr/bin/env bash
# From a clean clone to a picture: installs what is missing, builds, and runs the piping case on two ranks for about a
# minute.
#
#   bash jobs/quickstart.sh [FOLDER]      results go to FOLDER, by default results/quickstart (numbered if it is there)
#
# Ends with the exit code of the solver (0 done, 124 if it took longer than ten minutes).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"

out=${1:-$root/results/quickstart}
case $out in
  /*) ;;
  *) out=$PWD/$out ;;
esac
base=$out
for ((k = 2; ; k++)); do
  [ -e "$out" ] || break
  out=$base-$k
done

install_needs
use_environment
cd "$root"

echo "quickstart: building (some minutes the first time)"
cargo build --release --locked --bin solver
solver=${CARGO_TARGET_DIR:-$root/target}/release/solver

mkdir -p "$out"
case=$out/piping.json
# The hole-erosion test at a sixth of the paper's nodes: the faces of the hole erode grain by grain while the bulk stands.
"$solver" example piping >"$case"
echo "quickstart: running the hole-erosion test on 2 ranks; the same by hand:"
echo "  $solver example piping > piping.json"
echo "  mpirun --oversubscribe -n 2 $solver piping.json --output run"
status=0
# A machine of one core runs two ranks too, only slower.
timeout --kill-after=30 600 mpirun --oversubscribe -n 2 "$solver" "$case" --output "$out/run" || status=$?
if [ "$status" -ne 0 ]; then
  echo "quickstart: the solver ended with status $status; its output is above, its files are in $out/run" >&2
  exit "$status"
fi

"$solver" picture "$out/run" --output "$out/picture.svg"
# The erosion law of this one run: rate against shear stress as the hole widens, with wide intervals.
"$solver" erosion-law "$out/run" --published 0.506,9e-4,9.1 --output "$out/figures" | tee "$out/erosion-law.txt"

echo
echo "quickstart: done. In $out:"
find "$out" -maxdepth 3 \( -name '*.xmf' -o -name '*.csv' -o -name 'summary.json' -o -name '*.svg' \) -printf '  %P\n' | sort
echo
echo "In ParaView: File > Open, choose a .xmf file above, take 'Xdmf3 Reader T' where it asks for a reader, press Apply,"
echo "then colour the fluid by velocity, and show the grains as spheres by the filter Glyph (Sphere, scale by diameter)."
echo "ParaView 5.12 and newer also open the .vtkhdf files beside them."
echo "Pictures for any browser: $out/picture.svg (water and grains)"
if [ -f "$out/figures/figure4.svg" ]; then
  echo "                          $out/figures/figure4.svg (eroded mass against time)"
fi
exit 0
