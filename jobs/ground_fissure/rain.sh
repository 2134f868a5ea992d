#!/usr/bin/env bash
# Rain on a fissure with bonded stones (the example rain-fissure): the times at which the stones fall, against the front of rain.
#
#   rain.sh [OPTIONS] [RATE ...]   rates of rain [m/s]; default 1e-3 2e-3 4e-3
#
#   --output DIR   default results/ground_fissure/rain under the current folder
#   --ranks N      MPI ranks; default 2
#
# A front of constant shape descends with (R - K_i)/(theta_R - theta_i), with the content theta_R at which the ground passes the
# rain. The script prints the mean time between two ledges 40 mm apart, this time from the retention of the case, and the
# difference. Environment: SOLVER (the binary; default target/release/solver of this checkout).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
use_environment

usage() {
  sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2
  exit 2
}

output=results/ground_fissure/rain ranks=2
rates=()
while [ $# -gt 0 ]; do
  case $1 in
    --output | --ranks)
      [ $# -ge 2 ] || usage
      printf -v "${1#--}" '%s' "$2"
      shift 2
      ;;
    -*) usage ;;
    *)
      rates+=("$1")
      shift
      ;;
  esac
done
[ "${#rates[@]}" -gt 0 ] || rates=(1e-3 2e-3 4e-3)
solver=${SOLVER:-${CARGO_TARGET_DIR:-$root/target}/release/solver}
mkdir -p "$output"
"$solver" example rain-fissure >"$output/case.json"
for rate in "${rates[@]}"; do
  # The lowest ledge is 0.14 m deep, and the front descends with about 4 times the rate.
  end=$(awk -v r="$rate" 'BEGIN { printf "%.3g", 0.048 / r }')
  mpirun -n "$ranks" "$solver" "$output/case.json" --output "$output/$rate" --overwrite --threads 1 \
    --set "fluid.darcy.boundaries[0].condition.rain.rate=$rate" --set "time.end=$end" >"$output/$rate.log"
done
python3 - "$output" "${rates[@]}" <<'PYTHON'
"""Prints the times between the breaks of bonds and those of the front."""

import csv
import json
import pathlib
import sys

folder = pathlib.Path(sys.argv[1])
darcy = json.loads((folder / "case.json").read_text())["fluid"]["darcy"]
soil = darcy["unsaturated"]["retention"]["van_genuchten"]
conductivity = darcy["zones"][0]["permeability"]["hydraulic_conductivity"]
start = darcy["unsaturated"]["transient"]["initial"]["pressure_head"]
m = 1 - 1 / soil["n"]


def saturation(head):
    return (1 + (soil["alpha"] * -head) ** soil["n"]) ** -m


def passes(s):
    return conductivity * s**0.5 * (1 - (1 - s ** (1 / m)) ** m) ** 2


def wetted(rate):
    low, high = 1e-9, 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passes(middle) < rate else (low, middle)
    return low


drains = soil["saturated_content"] - soil["residual_content"]
print("rain [m/s]  between ledges [s]  front [s]  difference")
for rate in sys.argv[2:]:
    dry = saturation(start)
    exact = 0.04 * drains * (wetted(float(rate)) - dry) / (float(rate) - passes(dry))
    with open(folder / rate / "bonds.csv", encoding="utf-8") as file:
        lines = list(csv.reader(line for line in file if not line.startswith("#")))
    column = next(n for n, name in enumerate(lines[0]) if name.strip().startswith("time"))
    times = sorted(float(line[column]) for line in lines[1:])
    if len(times) < 2:
        print(f"{rate:>10}  {len(times)} stones fell")
        continue
    mean = (times[-1] - times[0]) / (len(times) - 1)
    print(f"{rate:>10}  {mean:>18.3f}  {exact:>9.3f}  {mean / exact - 1:>+10.2%}")
PYTHON
