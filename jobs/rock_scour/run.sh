#!/usr/bin/env bash
# Rock: a block on an incline, the avalanche of a jointed rock mass, blocks under a stream on an incline, a stream over an open joint.
#
#   run.sh [OPTIONS] [dry_incline] [avalanche] [incline] [stagnation]     runs or resumes; the first two without a name
#
#   --output DIR          default results/rock_scour under the current folder
#   --end SECONDS         physical time; default that of the case
#   --ranks N             MPI ranks; default 2
#   --threads N           threads of a rank; default 1
#
# Environment: SOLVER (the binary; default target/release/solver of this checkout, built if missing), LAUNCH (what starts MPI;
# default `mpirun -n RANKS`). Ends with 75 when a run was told to stop and can be resumed by the same call.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
# shellcheck source=jobs/runs.sh
. "$root/jobs/runs.sh"

usage() {
  sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2
  exit 2
}

output='' end='' ranks=2 threads=1
words=()
while [ $# -gt 0 ]; do
  case $1 in
    --output | --end | --ranks | --threads)
      [ $# -ge 2 ] || usage
      printf -v "${1#--}" '%s' "$2"
      shift 2
      ;;
    dry_incline | avalanche | incline | stagnation)
      words+=("$1")
      shift
      ;;
    *) usage ;;
  esac
done
[ "${#words[@]}" -gt 0 ] || words=(dry_incline avalanche)

solver=${SOLVER:-${CARGO_TARGET_DIR:-$root/target}/release/solver}
use_environment
if [ -z "${SOLVER:-}" ] && [ ! -x "$solver" ]; then
  install_needs
  (cd "$root" && cargo build --release --locked --bin solver)
fi
output=${output:-results/rock_scour}
mkdir -p "$output"
output=$(cd "$output" && pwd)
# shellcheck disable=SC2206 # words on purpose
launch=(${LAUNCH:-mpirun --oversubscribe -n $ranks})

hear_signals

# The acceleration (m/s2) of a body that slides down a slope (degrees), from the first and last rows of its probe after a tenth of
# a second, beside g (sin slope - tan friction cos slope).
sliding_law() {
  awk -F, -v slope="$2" -v friction="$3" -v until="$4" '
    NR == 1 { for (n = 1; n <= NF; n++) column[$n] = n; next }
    $1 !~ /^[0-9]/ || $column["time"] < 0.1 || $column["time"] > until { next }
    {
      t = $column["time"]
      v = sqrt($column["velocity_x"] ^ 2 + $column["velocity_y"] ^ 2 + $column["velocity_z"] ^ 2)
      if (!seen) { seen = 1; t0 = t; v0 = v }
    }
    END {
      if (t <= t0) exit
      degree = atan2(0, -1) / 180
      law = 9.81 * (sin(slope * degree) - sin(friction * degree) / cos(friction * degree) * cos(slope * degree))
      printf "acceleration %.4f m/s2, sliding law %.4f m/s2\n", (v - v0) / (t - t0), law
    }' "$1"
}

# Means from a time (s) on of weight, force of the water and force of the contact (N) on a block, along x and z.
balance() {
  awk -F, -v weight_x="$2" -v weight_z="$3" -v from="$4" '
    NR == 1 { for (n = 1; n <= NF; n++) column[$n] = n; next }
    $1 !~ /^[0-9]/ || $column["time"] < from { next }
    { rows++; wx += $column["fluid_force_x"]; wz += $column["fluid_force_z"]; cx += $column["contact_force_x"]; cz += $column["contact_force_z"] }
    END {
      if (!rows) exit
      printf "along the slope %.3f %+.3f %+.3f N, across it %.3f %+.3f %+.3f N\n", \
        weight_x, wx / rows, cx / rows, weight_z, wz / rows, cz / rows
    }' "$1"
}

# The largest mean pressure on the face of the offset (from 0.2 s on), and where the mean velocity turns from up to down.
stagnation() {
  awk -F, '
    FNR == 1 { for (n = 1; n <= NF; n++) column[$n] = n; next }
    /^#/ || $column["time"] < 0.2 { next }
    { z = $column["z"]; sum[z] += $column["velocity_z"]; pressure[z] += $column["pressure"]; rows[z]++ }
    END {
      top = -1
      for (z in sum) if (pressure[z] / rows[z] > best || top < 0) { best = pressure[z] / rows[z]; top = z }
      for (z in sum) if (z + 0 < 0.064 && sum[z] < 0 && z + 0 > low + 0) low = z
      printf "largest mean pressure %.0f Pa at z = %.4f m; above z = %.4f m the water goes up (floor 0.0512, lip 0.064)\n", best, top, low
    }' "$1"
}

rock() {
  local folder=$output/$1 status=0 args=()
  if is_done "$folder"; then
    echo "rock: $1 is finished"
  else
    [ -z "$end" ] || args+=(--set "time.end=$end")
    run_or_go_on "$folder" "$here/$1.json" "${args[@]}" >>"$folder.log" 2>&1 || status=$?
    echo "rock: $1 ended with $status; see $folder.log"
  fi
  [ "$status" -eq 0 ] || return "$status"
  case $1 in
    dry_incline) echo "rock: block: $(sliding_law "$folder/probe_slides.csv" 30 20 1)" ;;
    # The witness reaches the floor after 4.8 s.
    avalanche) echo "rock: witness: $(sliding_law "$folder/probe_witness.csv" 45 30 4)" ;;
    incline) echo "rock: weight, water, contact: $(balance "$folder/probe_rough.csv" 7.6518 -13.2533 0.05)" ;;
    stagnation) echo "rock: face: $(stagnation "$folder/probe_face.csv")" ;;
  esac
}

for word in "${words[@]}"; do
  rock "$word"
done
