#!/usr/bin/env bash
# The velocity of the stream at which a protruding block leaves its place in a jointed bed, by bisection, and how it goes: lifted, slid
# or turned (B-33). A block has gone when its centre has moved by a quarter of its edge. Writes threshold.csv in the output folder, one
# row per run: velocity, whether it went, when, how far up and along, how far turned, and the mode.
#
#   bash jobs/rock_scour/threshold.sh [--ranks N] [--threads N] [--from U] [--to U] [--runs N] [--output DIR] [-- --set ...]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
ranks=1 threads=2 from=2 to=20 runs=6 output=$root/results/rock_scour/threshold
while [ $# -gt 0 ]; do
  case $1 in
    --ranks) ranks=$2 ;;
    --threads) threads=$2 ;;
    --from) from=$2 ;;
    --to) to=$2 ;;
    --runs) runs=$2 ;;
    --output) output=$2 ;;
    --) shift; break ;;
    *) echo "unknown option $1" >&2; exit 2 ;;
  esac
  shift 2
done
use_environment
solver=${SOLVER:-$root/target/release/solver}
mkdir -p "$output"
"$solver" example scour >"$output/case.json"
table=$output/threshold.csv
echo "velocity,gone,time,rise,slide,turn,mode" >"$table"

# run U: 0 where the block went.
run() {
  local folder=$output/u_$1
  rm -rf "$folder"
  # The stream keeps its speed against a drag that grows as its square: 500 N/m3 at 3 m/s.
  local force
  force=$(awk -v u="$1" 'BEGIN { print 500 * u * u / 9 }')
  mpirun --oversubscribe -n "$ranks" "$solver" "$output/case.json" --output "$folder" --threads "$threads" \
    --set "fluid.lattice_boltzmann.reference_velocity=$1" \
    --set "fluid.lattice_boltzmann.initial.uniform.velocity=[$1, 0, 0]" \
    --set "fluid.lattice_boltzmann.body_force.constant=[$force, 0, 0]" "${more[@]}" >"$folder.log" 2>&1 ||
    { tail -2 "$folder.log" >&2; return 2; }
  awk -F, -v u="$1" '
    NR == 1 { for (k = 1; k <= NF; k++) at[$k] = k; next }
    /^#/ { next }
    !(started++) { x = $at["x"]; y = $at["y"]; z = $at["z"]; before = $at["time"]; next }
    {
      dt = $at["time"] - before; before = $at["time"]
      for (a = 1; a <= 3; a++) turn[a] += dt * $at["angular_velocity_" substr("xyz", a, 1)]
      rise = $at["z"] - z; slide = sqrt(($at["x"] - x)^2 + ($at["y"] - y)^2)
      angle = sqrt(turn[1]^2 + turn[2]^2 + turn[3]^2)
      if (rise * rise + slide * slide > 0.02 * 0.02) { gone = 1; exit }
    }
    END {
      # Each as a share of what it takes: an edge of 80 mm, and a quarter turn.
      up = rise / 0.08; along = slide / 0.08; about = angle / 1.5708
      mode = !gone ? "stays" : up >= along && up >= about ? "lifts" : along >= about ? "slides" : "turns"
      printf "%s,%d,%g,%.3g,%.3g,%.3g,%s\n", u, gone, before, rise, slide, angle, mode
      exit !gone
    }' "$folder/probe_protruding.csv" >>"$table"
}

more=("$@")
# Both ends must be what they should.
if run "$from"; then
  echo "the block goes at $from m/s already: start lower" >&2
  exit 1
fi
if ! run "$to"; then
  echo "the block stays at $to m/s: go higher" >&2
  exit 1
fi
for ((k = 0; k < runs; k++)); do
  middle=$(awk -v a="$from" -v b="$to" 'BEGIN { printf "%.3g", (a + b) / 2 }')
  if run "$middle"; then to=$middle; else from=$middle; fi
done
echo "threshold between $from and $to m/s"
cat "$table"
