#!/usr/bin/env bash
# The velocity of the stream at which a block at the edge of a step leaves its place, by bisection, and how it goes: lifted, slid
# or turned. A block goes when its centre has moved by 1 mm before the run ends: one that stays gives by some micrometres, one
# that goes may turn slowly, for water has to get under it. Writes threshold.csv in the output folder, one row per run: velocity (m/s),
# whether it went, when (s), how far up and along (m), how far turned (rad), the mode; then means until it had moved by 0.25 mm, or
# over the second half of the run where it stayed: drag and uplift beyond buoyancy (N), moment of the water about y (N m), uplift over
# the velocity head on the base, and the pressure in the joints upstream of it and below it, above that of the stream, over the
# velocity head.
#
#   bash jobs/rock_scour/threshold.sh [--ranks N] [--threads N] [--from U] [--to U] [--runs N] [--friction DEGREES] [--output DIR]
#                                     [-- --set ...]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
ranks=1 threads=2 from=1 to=4 runs=5 friction=35 output=$root/results/rock_scour/threshold
while [ $# -gt 0 ]; do
  case $1 in
    --ranks) ranks=$2 ;;
    --threads) threads=$2 ;;
    --from) from=$2 ;;
    --to) to=$2 ;;
    --runs) runs=$2 ;;
    --friction) friction=$2 ;;
    --output) output=$2 ;;
    --) shift; break ;;
    *) echo "unknown option $1" >&2; exit 2 ;;
  esac
  shift 2
done
use_environment
solver=${SOLVER:-$root/target/release/solver}
mkdir -p "$output"
table=$output/threshold.csv
echo "velocity,gone,time,rise,slide,turn,mode,drag,uplift,moment,uplift_coefficient,joint_upstream,joint_below" >"$table"

# run U: 0 where the block went.
run() {
  local folder=$output/u_$1
  rm -rf "$folder"
  # The stream keeps its speed against a drag that grows as its square: 500 N/m3 at 3 m/s.
  local force
  force=$(awk -v u="$1" 'BEGIN { print 500 * u * u / 9 }')
  mpirun --oversubscribe -n "$ranks" "$solver" "$here/threshold.json" --output "$folder" --threads "$threads" \
    --set "contact.blocks.friction_angle_degrees=$friction" \
    --set "fluid.lattice_boltzmann.reference_velocity=$1" \
    --set "fluid.lattice_boltzmann.initial.uniform=[$1, 0, 0]" \
    --set "fluid.lattice_boltzmann.body_force.constant=[$force, 0, 0]" "${more[@]}" >"$folder.log" 2>&1 ||
    { tail -2 "$folder.log" >&2; return 2; }
  awk -F, -v u="$1" '
    FNR == 1 { file++; for (k = 1; k <= NF; k++) at[file, $k] = k; next }
    /^#/ { next }
    file < 4 { pressure[file, FNR] = $at[file, "pressure"]; next }
    { n = FNR; time[n] = $at[4, "time"]; drag[n] = $at[4, "fluid_force_x"]; lift[n] = $at[4, "fluid_force_z"]; moment[n] = $at[4, "fluid_torque_y"] }
    !(started++) { first = n; x = $at[4, "x"]; y = $at[4, "y"]; z = $at[4, "z"]; next }
    {
      dt = time[n] - time[n - 1]
      for (a = 1; a <= 3; a++) turn[a] += dt * $at[4, "angular_velocity_" substr("xyz", a, 1)]
      rise = $at[4, "z"] - z; slide = sqrt(($at[4, "x"] - x)^2 + ($at[4, "y"] - y)^2)
      angle = sqrt(turn[1]^2 + turn[2]^2 + turn[3]^2)
      moved = sqrt(rise * rise + slide * slide)
      if (!leaves && moved > 0.00025) leaves = n
      if (moved > 0.001) { gone = 1; exit }
    }
    END {
      # Each as a share of what it takes: an edge of 80 mm, and a quarter turn.
      up = rise / 0.08; along = slide / 0.08; about = angle / 1.5708
      mode = !gone ? "stays" : up >= along && up >= about ? "lifts" : along >= about ? "slides" : "turns"
      head = 500 * u * u; base = 0.076 * 0.076; buoyancy = 1000 * 9.81 * base * 0.08
      low = gone ? first + 1 : int((first + n) / 2); high = gone ? leaves : n
      for (k = low; k <= high; k++) {
        rows++; fx += drag[k]; fz += lift[k] - buoyancy; my += moment[k]
        before += pressure[2, k] - pressure[1, k]; below += pressure[3, k] - pressure[1, k]
      }
      printf "%s,%d,%.3g,%.3g,%.3g,%.3g,%s,%.4g,%.4g,%.3g,%.3g,%.3g,%.3g\n", u, gone, time[n], rise, slide, angle, mode, \
        fx / rows, fz / rows, my / rows, fz / rows / head / base, before / rows / head, below / rows / head
      exit !gone
    }' "$folder/probe_stream.csv" "$folder/probe_upstream.csv" "$folder/probe_below.csv" "$folder/probe_protruding.csv" >>"$table"
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
