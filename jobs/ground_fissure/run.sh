#!/usr/bin/env bash
# The ground fissures of the paper: one packing, from which sand and clay erode.
#
#   run.sh [OPTIONS] [sand] [clay]   prepares the packing where it is missing, then runs or resumes; both without a name
#   run.sh [OPTIONS] critical SOIL   searches the smallest pressure that erodes (solver critical-gradient)
#
#   --scale small|paper   about 5,700 grains (the examples fissure-sand and fissure-clay) or 47,861; default small
#   --output DIR          default results/ground_fissure/SCALE under the current folder
#   --pressure PA         at the top of the water; default that of the case
#   --from PA, --to PA    bounds of the search; default 2e5 and 3e6
#   --end SECONDS         physical time; default that of the case
#   --every SECONDS       between two looks at the surface and the voids; default that of the case
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

scale=small output='' pressure='' from=2e5 to=3e6 end='' every='' ranks=2 threads=1
words=()
while [ $# -gt 0 ]; do
  case $1 in
    --scale | --output | --pressure | --from | --to | --end | --every | --ranks | --threads)
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
[ "${#words[@]}" -gt 0 ] || words=(sand clay)

solver=${SOLVER:-${CARGO_TARGET_DIR:-$root/target}/release/solver}
use_environment
if [ -z "${SOLVER:-}" ] && [ ! -x "$solver" ]; then
  install_needs
  (cd "$root" && cargo build --release --locked --bin solver)
fi
output=${output:-results/ground_fissure/$scale}
mkdir -p "$output"
output=$(cd "$output" && pwd)
# shellcheck disable=SC2206 # words on purpose
launch=(${LAUNCH:-mpirun --oversubscribe -n $ranks})

# The case file of a soil.
case_of() {
  case $scale in
    paper) echo "$here/$1/case.json" ;;
    small)
      "$solver" example "fissure-$1" >"$output/$1.json"
      echo "$output/$1.json"
      ;;
    *) usage ;;
  esac
}

hear_signals

# The packing, without water; sand and clay differ in their bonds only, which are made later.
prepare() {
  [ ! -s "$output/sample.csv" ] || return 0
  echo "fissure: preparing the packing"
  local status=0
  run_or_go_on "$output/preparation" "$(case_of sand)" --set fluid=null --set time.end=1e-6 --set output='{}' \
    --set analysis='{}' >>"$output/preparation.log" 2>&1 || status=$?
  if [ "$status" -eq 75 ]; then
    echo "fissure: the packing is in the making; the same call goes on"
    exit 75
  elif [ "$status" -ne 0 ]; then
    echo "fissure: failed; see $output/preparation.log" >&2
    exit 1
  fi
  cp "$output/preparation/sample.csv" "$output/sample.csv.part"
  mv "$output/sample.csv.part" "$output/sample.csv"
}

sample=(--set "grains.initial={\"file\": {\"path\": \"$output/sample.csv\"}}" --set grains.save=null)

# The long section at several times, and at each stage that began.
pictures() {
  local stage time
  "$solver" picture "$1" --view x --width 480 --output "$1/section.svg"
  for stage in hidden_hole arch sinkhole extension; do
    time=$(sed -n "s/.*\"$stage\": *\([0-9][^,]*\).*/\1/p" "$1/summary.json")
    [ -z "$time" ] || "$solver" picture "$1" --view x --width 480 --time "$time" --output "$1/$stage.svg"
  done
}

soil() {
  local folder=$output/$1 status=0 args=()
  if is_done "$folder"; then
    echo "fissure: $1 is finished"
    return 0
  fi
  [ -z "$pressure" ] || args+=(--set "fluid.darcy.boundaries[0].condition.pressure.value=$pressure")
  [ -z "$end" ] || args+=(--set "time.end=$end")
  [ -z "$every" ] || args+=(--set "analysis.ground_collapse.every=$every")
  run_or_go_on "$folder" "$(case_of "$1")" "${sample[@]}" "${args[@]}" >>"$folder.log" 2>&1 || status=$?
  [ "$status" -ne 0 ] || pictures "$folder"
  echo "fissure: $1 ended with $status; see $folder.log"
  return "$status"
}

prepare
if [ "${words[0]}" = critical ]; then
  [ "${#words[@]}" -eq 2 ] || usage
  "${launch[@]}" "$solver" critical-gradient "$(case_of "${words[1]}")" --from "$from" --to "$to" --threads "$threads" \
    --output "$output/critical_${words[1]}" "${sample[@]}"
  exit
fi
for word in "${words[@]}"; do
  case $word in
    sand | clay) soil "$word" ;;
    *) usage ;;
  esac
done
