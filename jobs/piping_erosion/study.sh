#!/usr/bin/env bash
# The study of the piping paper: pressure series and cohesion series, run, resumed and fitted.
#
#   study.sh [OPTIONS] all        run what is not finished, several members at a time, then fit (the default)
#   study.sh [OPTIONS] list       the members with their state, one a line: index, C/d, pressure, folder, state
#   study.sh [OPTIONS] prepare    make the sample that all members share
#   study.sh [OPTIONS] member K   run member K of the list until it ends or is told to stop (75: to be resumed)
#   study.sh [OPTIONS] fit        erosion law and figures from the members that have a record
#
#   --scale small|paper     case_small.json (default) or case.json
#   --output DIR            default results/piping_erosion/SCALE under the current folder
#   --pressures "P ..."     Pa; default pressures.txt; with --scale paper 0.01 0.10 0.50
#   --cohesions "C ..."     N/m; default 0.506; `all` for cohesions.txt
#   --end SECONDS           physical time of each member; default that of the case
#   --hammer                pressure at once, as in the paper, instead of a ramp
#   --ranks N               MPI ranks of a member; default 1
#   --threads N             threads of a rank; default 1
#   --at-once N             members at a time; default the cores over ranks x threads
#
# Environment: SOLVER (the binary; default target/release/solver of this checkout, built if missing), LAUNCH (what starts
# MPI; default `mpirun -n RANKS`; under Slurm `srun` may be better).
#
# SIGUSR2 or SIGTERM to this script is passed on: members write a checkpoint and end with 75, and the next call goes on.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# `sbatch` runs a copy of study.sbatch from its spool folder, so that this script is always called where it lies.
root=$(cd "$here/../.." && pwd)
# shellcheck source=jobs/install.sh
. "$root/jobs/install.sh"
# shellcheck source=jobs/runs.sh
. "$root/jobs/runs.sh"

usage() {
  sed -n '2,/^set -euo/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2
  exit 2
}

scale=small
output=
pressures=
cohesions=0.506
end=
hammer=0
ranks=1
threads=1
at_once=
while [ $# -gt 0 ]; do
  case $1 in
    --hammer)
      hammer=1
      shift
      continue
      ;;
    --scale | --output | --pressures | --cohesions | --end | --ranks | --threads | --at-once)
      [ $# -ge 2 ] || usage
      ;;
  esac
  case $1 in
    --scale) scale=$2 ;;
    --output) output=$2 ;;
    --pressures) pressures=$2 ;;
    --cohesions) cohesions=$2 ;;
    --end) end=$2 ;;
    --ranks) ranks=$2 ;;
    --threads) threads=$2 ;;
    --at-once) at_once=$2 ;;
    -*) usage ;;
    *) break ;;
  esac
  shift 2
done
command=${1:-all}

# The values of a list file, without its comments.
values() { grep -v '^#' "$here/$1" | tr '\n' ' '; }

case $scale in
  small) case_file=$here/case_small.json ;;
  paper)
    case_file=$here/case.json
    pressures=${pressures:-0.01 0.10 0.50}
    ;;
  *) usage ;;
esac
pressures=${pressures:-$(values pressures.txt)}
if [ "$cohesions" = all ]; then
  cohesions=$(values cohesions.txt)
fi
output=${output:-results/piping_erosion/$scale}
case $output in
  /*) ;;
  *) output=$PWD/$output ;;
esac
at_once=${at_once:-$(($(nproc) / (ranks * threads)))}
[ "$at_once" -ge 1 ] || at_once=1
read -r -a launch <<<"${LAUNCH:-mpirun --oversubscribe --bind-to none -n $ranks}"
solver=${SOLVER:-${CARGO_TARGET_DIR:-$root/target}/release/solver}
use_environment

# One line per member: cohesion, pressure, folder.
members() {
  local cohesion pressure
  for cohesion in $cohesions; do
    for pressure in $pressures; do
      echo "$cohesion $pressure $output/C${cohesion}_P${pressure}"
    done
  done
}

# finished, resumable, started or new.
state() {
  if is_done "$1"; then
    echo finished
  elif can_go_on "$1"; then
    echo resumable
  elif [ -d "$1" ]; then
    echo started
  else
    echo new
  fi
}

build() {
  if [ -z "${SOLVER:-}" ] && [ ! -x "$solver" ]; then
    install_needs
    (cd "$root" && cargo build --release --locked --bin solver)
  fi
}

# The packing is grown once, without cohesion and without flow, and shared by every member.
prepare() {
  local status=0
  mkdir -p "$output"
  # Members of a Slurm array may come here at the same time: the first makes the sample, the others wait.
  exec 9>"$output/preparation.lock"
  supervise flock 9 || return 75
  if [ ! -s "$output/sample.csv" ]; then
    echo "study: preparing the sample"
    run_or_go_on "$output/preparation" "$case_file" --set time.end=1e-4 --set output='{}' --set 'probes=[]' \
      --set 'analysis={}' >>"$output/preparation.log" 2>&1 || status=$?
    if [ "$status" -eq 75 ]; then
      echo "study: the sample is in the making; the same call goes on"
    elif [ "$status" -ne 0 ]; then
      echo "study: preparing the sample failed; see $output/preparation.log" >&2
    else
      cp "$output/preparation/sample.csv" "$output/sample.csv.part"
      mv "$output/sample.csv.part" "$output/sample.csv"
    fi
  fi
  exec 9>&-
  return "$status"
}

# share TOTAL PARTS [MOST]: one part of a time, at most MOST.
share() { awk -v t="$1" -v n="$2" -v m="${3:-1e9}" 'BEGIN { s = t / n; printf "%.9g\n", s < m ? s : m }'; }

# member COHESION PRESSURE FOLDER: runs or resumes until finished, stopped, or failed three times without a step forward.
member() {
  local cohesion=$1 pressure=$2 folder=$3 status failures=0 how
  local log=$folder.log
  local args=(
    --set "contact.cohesive_frictional.cohesion.per_diameter=$cohesion"
    --set "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value=$pressure"
    --set "grains.initial={\"file\": {\"path\": \"$output/sample.csv\"}}"
    --set grains.save=null
  )
  if [ -n "$end" ]; then
    # A shorter run writes as often over its length as the whole one; the case refuses an output that is never due.
    args+=(--set "time.end=$end"
      --set "output.fluid.every=$(share "$end" 20)" --set "output.grains.every=$(share "$end" 80)"
      --set "output.contacts.every=$(share "$end" 10)")
    args+=(--set "probes[0].every=$(share "$end" 50 0.02)"
      --set "analysis.erosion_law.every=$(share "$end" 50 0.02)")
  fi
  [ "$hammer" -eq 0 ] || args+=(--set 'fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp=null')
  while :; do
    how=$(state "$folder")
    if [ "$how" = finished ]; then
      return 0
    fi
    if [ "$stop" -ne 0 ]; then
      return 75
    fi
    status=0
    run_or_go_on "$folder" "$case_file" "${args[@]}" >>"$log" 2>&1 || status=$?
    case $status in
      0) ;;
      75) failures=0 ;;
      2 | 3)
        echo "study: C/d $cohesion N/m, $pressure Pa: the case is refused; see $log" >&2
        return "$status"
        ;;
      *)
        [ "$stop" -eq 0 ] || return 75
        failures=$((failures + 1))
        if [ "$failures" -ge 3 ]; then
          echo "study: C/d $cohesion N/m, $pressure Pa: ended with $status three times; see $log" >&2
          return "$status"
        fi
        ;;
    esac
    if [ "$status" -eq 0 ] && [ "$(state "$folder")" != finished ]; then
      echo "study: C/d $cohesion N/m, $pressure Pa: ended with 0 but its summary does not say so; see $log" >&2
      return 1
    fi
  done
}

fit() {
  local folders=() folder
  while read -r _ _ folder; do
    [ ! -s "$folder/erosion.csv" ] || folders+=("$folder")
  done < <(members)
  if [ "${#folders[@]}" -eq 0 ]; then
    echo "study: no member has a record yet" >&2
    return 1
  fi
  # The paper: C/d = 0.506 N/m, tau_c = 9e-4 Pa, k_d = 9.1 s/m.
  "$solver" erosion-law "${folders[@]}" --published 0.506,9e-4,9.1 --output "$output/figures"
}

case $command in
  list)
    index=0
    while read -r cohesion pressure folder; do
      echo "$index $cohesion $pressure $folder $(state "$folder")"
      index=$((index + 1))
    done < <(members)
    ;;
  prepare)
    hear_signals
    build
    prepare
    ;;
  member)
    [ $# -ge 2 ] || usage
    hear_signals
    build
    line=$(members | sed -n "$(($2 + 1))p")
    if [ -z "$line" ]; then
      echo "study: no member $2; see: study.sh list" >&2
      exit 2
    fi
    prepare
    read -r cohesion pressure folder <<<"$line"
    status=0
    member "$cohesion" "$pressure" "$folder" || status=$?
    echo "study: C/d $cohesion N/m, $pressure Pa: $(state "$folder") ($status)"
    exit "$status"
    ;;
  all)
    hear_signals
    build
    prepare
    workers=()
    # Each worker is this script for one member; signals reach the workers through the trap.
    trap 'stop=1; for worker in "${workers[@]}"; do kill -USR2 "$worker" 2>/dev/null || true; done' USR2 TERM INT
    options=(--scale "$scale" --output "$output" --pressures "$pressures" --cohesions "$cohesions"
      --ranks "$ranks" --threads "$threads")
    [ -z "$end" ] || options+=(--end "$end")
    [ "$hammer" -eq 0 ] || options+=(--hammer)
    index=0
    failed=0
    while read -r _ _ folder; do
      if [ "$stop" -eq 0 ] && [ "$(state "$folder")" != finished ]; then
        while [ "$(jobs -pr | wc -l)" -ge "$at_once" ] && [ "$stop" -eq 0 ]; do
          wait -n || failed=1
        done
        if [ "$stop" -eq 0 ]; then
          bash "$here/study.sh" "${options[@]}" member "$index" &
          workers+=($!)
        fi
      fi
      index=$((index + 1))
    done < <(members)
    for worker in "${workers[@]}"; do
      # Twice: the first wait may be cut short by a signal.
      wait "$worker" || wait "$worker" || failed=1
    done
    if [ "$stop" -ne 0 ]; then
      echo "study: stopped; the same command goes on"
      exit 75
    fi
    fit || failed=1
    exit "$failed"
    ;;
  fit)
    fit
    ;;
  *) usage ;;
esac
