#!/usr/bin/env bash
# ParaView states of runs that show each kind of output, made and opened again by ParaView.
#
#   bash tests/read_states.sh FOLDER...      each a folder of a run
#
# Ends with status 77 where ParaView or a display is missing.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
command -v pvpython >/dev/null || exit 77
display=()
if [ -z "${DISPLAY:-}" ]; then
  command -v xvfb-run >/dev/null || exit 77
  display=(xvfb-run -a -s "-screen 0 1600x1000x24 -noreset")
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
one() {
  local run=$1 state
  state=$work/$(basename "$run").pvsm
  timeout 120 "${display[@]}" pvpython "$root/jobs/paraview/state.py" "$run" --output "$state" --picture "${state%.pvsm}.png"
  timeout 120 "${display[@]}" pvpython "$root/tests/read_state.py" "$run" "$state"
}

parts=()
for run in "$@"; do
  one "$run" &
  parts+=($!)
done
status=0
for part in "${parts[@]}"; do
  wait "$part" || status=1
done
exit "$status"
