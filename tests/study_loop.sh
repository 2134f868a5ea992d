#!/usr/bin/env bash
# The loop of jobs/piping_erosion/study.sh with a stand-in for the solver: members are resumed until they are done, what
# is finished is left alone, a signal leaves a checkpoint and 75, and a refused case is not tried again.
#
#   bash tests/study_loop.sh
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Ends with 75 twice, then is done. At 0.35 Pa it dies once; at 0.40 Pa it is refused; at 0.50 Pa it waits for a signal.
cat >"$work/solver" <<'SOLVER'
#!/usr/bin/env bash
set -u
if [ "$1" = erosion-law ]; then
  echo "fit of $(($# - 5)) runs"
  exit 0
fi
how=start
folder=
pressure=
if [ "$1" = restart ]; then
  how=restart
  folder=$2
fi
while [ $# -gt 0 ]; do
  case $1 in
    --output) folder=$2 ;;
    --set) case $2 in *pressure.value=*) pressure=${2##*=} ;; esac ;;
  esac
  shift
done
mkdir -p "$folder"
case $folder in
  */preparation) echo sample >"$folder/sample.csv"; exit 0 ;;
esac
[ -z "$pressure" ] || echo "$pressure" >"$folder/pressure"
echo "$how" >>"$folder/calls"
echo record >"$folder/erosion.csv"
calls=$(wc -l <"$folder/calls")
case $(cat "$folder/pressure") in
  0.40) exit 3 ;;
  0.35) [ "$calls" -ne 2 ] || kill -9 $$ ;;
  0.50)
    if [ "$calls" -eq 1 ]; then
      trap 'mkdir -p "$folder/checkpoints/1"; exit 75' USR2
      touch "$folder/ready"
      while :; do read -rt 0.05 <> <(:) || true; done
    fi
    ;;
esac
if [ "$calls" -lt 3 ]; then
  mkdir -p "$folder/checkpoints/$calls"
  exit 75
fi
echo '{"outcome": "done"}' >"$folder/summary.json"
SOLVER
chmod +x "$work/solver"

export SOLVER=$work/solver LAUNCH=env
study() { bash "$root/jobs/piping_erosion/study.sh" --output "$work/study" --at-once 2 "$@"; }
expect() {
  if [ "$2" != "$3" ]; then
    echo "study_loop: $1: expected '$3', found '$2'" >&2
    exit 1
  fi
}

# A series that needs resuming, one member of which dies once.
study --pressures "0.10 0.20 0.35" all >"$work/log"
expect "last line" "$(tail -n 1 "$work/log")" "fit of 3 runs"
expect "calls" "$(tr '\n' ' ' <"$work/study/C0.506_P0.10/calls")" "start restart restart "
expect "calls after a kill" "$(tr '\n' ' ' <"$work/study/C0.506_P0.35/calls")" "start restart restart "
expect "states" "$(study --pressures "0.10 0.20 0.35 0.50" list | awk '{ print $5 }' | tr '\n' ' ')" \
  "finished finished finished new "

# What is finished is not run again.
study --pressures "0.10 0.20 0.35" all >"$work/log"
expect "calls of a finished member" "$(wc -l <"$work/study/C0.506_P0.10/calls")" 3

# A refused case fails at once and does not stop the others.
status=0
study --pressures "0.40 0.30" all >"$work/log" 2>&1 || status=$?
expect "status with a refused case" "$status" 1
expect "calls of the refused case" "$(wc -l <"$work/study/C0.506_P0.40/calls")" 1
expect "calls beside it" "$(wc -l <"$work/study/C0.506_P0.30/calls")" 3

# A signal: checkpoint, 75, and the next call goes on.
bash "$root/jobs/piping_erosion/study.sh" --output "$work/study" --pressures 0.50 member 0 >"$work/log" 2>&1 &
member=$!
for _ in $(seq 200); do
  [ ! -e "$work/study/C0.506_P0.50/ready" ] || break
  read -rt 0.05 <> <(:) || true
done
kill -USR2 "$member"
status=0
wait "$member" || status=$?
expect "status after a signal" "$status" 75
expect "state after a signal" "$(study --pressures 0.50 list | awk '{ print $5 }')" resumable
study --pressures 0.50 member 0 >"$work/log" 2>&1
expect "calls after a signal" "$(tr '\n' ' ' <"$work/study/C0.506_P0.50/calls")" "start restart restart "
echo "study_loop: all as expected"
