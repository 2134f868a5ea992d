#!/usr/bin/env bash
# What stiffness, coupling interval and porosity method change in the smaller pair, and what they cost.
#
#   studies.sh [OPTIONS] [STUDY ...]   runs what is missing; the studies are stiffness, chance, critical, interval, porosity; all
#                                      without a name
#   studies.sh [OPTIONS] table         tables and figures of what has been run, into results/ beside this file
#
#   --output DIR   default results/ground_fissure/studies under the current folder
#   --soil SOIL    sand or clay only
#   --end SECONDS  physical time of a run; default that of the case
#   --limit TIME   wall time after which a member is given up (timeout(1)); default 30m
#
# Environment: SOLVER (the binary), FIGURES (`studies.rs`, built by `cargo build --release --example fissure_studies`); default those in target/release of this checkout.
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

output=results/ground_fissure/studies soil='' end='' limit=30m
words=()
while [ $# -gt 0 ]; do
  case $1 in
    --output | --soil | --end | --limit)
      [ $# -ge 2 ] || usage
      printf -v "${1#--}" '%s' "$2"
      shift 2
      ;;
    -*) usage ;;
    *)
      words+=("$1")
      shift
      ;;
  esac
done
[ "${#words[@]}" -gt 0 ] || words=(stiffness chance critical interval porosity)
soils=(${soil:-sand clay})
target=${CARGO_TARGET_DIR:-$root/target}
solver=${SOLVER:-$target/release/solver}
mkdir -p "$output"
output=$(cd "$output" && pwd)

# The law of a soil, by the name of its field.
law() { [ "$1" = sand ] && echo linear || echo contact_bond; }

# call LOG COMMAND...: a member that fails is noted and left out of the tables. LOG.seconds holds its processor time, which other
# users of the machine change less than the time on the clock.
call() {
  local log=$1 status=0 TIMEFORMAT=%U
  shift
  {
    time timeout --signal=USR2 --kill-after=60 "$limit" mpirun -n 1 "$solver" "$@" --threads 1 >"$log" 2>"$log.errors"
  } 2>"$log.seconds" || status=$?
  [ "$status" -eq 0 ] || echo "studies: $log ended with $status"
}

done_already() { grep -q '"outcome": *"done"' "$1/summary.json" 2>/dev/null; }

# packing NAME STIFFNESS [SEED]: settled under its own stiffness.
packing() {
  local folder=$output/packing/$1
  [ ! -s "$folder/sample.csv" ] || return 0
  rm -rf "$folder"
  mkdir -p "$output/packing"
  call "$folder.log" "$output/sand.json" --output "$folder" --set fluid=null --set time.end=1e-6 --set output='{}' \
    --set analysis='{}' --set "contact.linear.normal_stiffness.absolute=$2" ${3:+--set "grains.initial.deposition.seed=$3"}
}

# member STUDY SOIL NAME PACKING SET...: one run of a soil.
member() {
  local study=$1 soil=$2 folder=$output/$1/$2_$3 sample=$output/packing/$4/sample.csv args=() set
  shift 4
  ! done_already "$folder" || return 0
  [ -s "$sample" ] || return 0
  rm -rf "$folder"
  mkdir -p "$output/$study"
  for set in "$@"; do args+=(--set "$set"); done
  [ -z "$end" ] || args+=(--set "time.end=$end")
  call "$folder.log" "$output/$soil.json" --output "$folder" --set "grains.initial={\"file\": {\"path\": \"$sample\"}}" \
    --set grains.save=null --set output='{}' --set analysis.ground_collapse.every=4e-5 "${args[@]}"
}

# Stiffness in N/m. The plan chooses the coupling interval of each.
stiffnesses='1e3 1e4 1e5 1e6'

stiffness() {
  local k soil
  for k in $stiffnesses; do
    packing "$k" "$k"
    for soil in "${soils[@]}"; do
      member stiffness "$soil" "$k" "$k" "contact.$(law $soil).normal_stiffness.absolute=$k"
    done
  done
}

# The same soil in another packing: what differs less than this cannot be told from chance.
chance() {
  local soil
  packing 1e6_other 1e6 7
  for soil in "${soils[@]}"; do
    member stiffness "$soil" 1e6_other 1e6_other
  done
}

# The pressure from which on the clay erodes. Sand has none: it flows out under its weight.
critical() {
  local k folder
  mkdir -p "$output/critical"
  for k in $stiffnesses; do
    folder=$output/critical/$k
    if grep -q '"erodes"' "$folder.json" 2>/dev/null || [ ! -s "$output/packing/$k/sample.csv" ]; then continue; fi
    rm -rf "$folder"
    call "$folder.json" critical-gradient --json ${end:+--set "time.end=$end"} "$output/clay.json" --from 5e5 --to 2e6 --tolerance 0.02 --output "$folder" \
      --set "grains.initial={\"file\": {\"path\": \"$output/packing/$k/sample.csv\"}}" --set grains.save=null \
      --set "contact.contact_bond.normal_stiffness.absolute=$k"
  done
}

# Both at 1e5 N/m: a step lasts 1.4e-6 s. The plan allows 8 steps, which are its choice, and refuses more.
interval() {
  local soil n
  packing 1e5 1e5
  for soil in "${soils[@]}"; do
    for n in 8 4 2 1; do
      member interval "$soil" "$n" 1e5 "contact.$(law "$soil").normal_stiffness.absolute=1e5" "fluid.darcy.coupling_interval=$n"
    done
  done
}

porosity() {
  local soil method
  packing 1e5 1e5
  for soil in "${soils[@]}"; do
    for method in centroid divided exact; do
      member porosity "$soil" "$method" 1e5 "contact.$(law "$soil").normal_stiffness.absolute=1e5" \
        "fluid.darcy.porosity=\"$method\""
    done
  done
}

table() { "${FIGURES:-$target/release/examples/fissure_studies}" "$output" "$here/results"; }

for soil in sand clay; do "$solver" example "fissure-$soil" >"$output/$soil.json"; done
for word in "${words[@]}"; do
  case $word in
    stiffness | chance | critical | interval | porosity | table) "$word" ;;
    *) usage ;;
  esac
done
