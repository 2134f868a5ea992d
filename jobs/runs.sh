#!/usr/bin/env bash
# How the job scripts run the solver: signals are passed on, and a run that was stopped goes on. Sourced, not called.
#
#   run_or_go_on FOLDER [ARGUMENTS]   restarts the run in FOLDER if it can go on, else begins it with these arguments;
#                                     needs the arrays `launch` and the variables `solver` and `threads`
#   supervise COMMAND...              runs a command and hands signals on to it
#   hear_signals                      from here on SIGUSR2, SIGTERM and SIGINT are handed on
#
# A signal to the script makes the solver write a checkpoint and end with 75, in its preparation too.

# Signals so far: counts, so that `wait` knows of every one. A run told to stop is not resumed by this call.
stop=0
child=
pass_on() {
  stop=$((stop + 1))
  if [ -n "$child" ]; then
    kill -USR2 "$child" 2>/dev/null || true
  fi
}
hear_signals() { trap pass_on USR2 TERM INT; }

# Runs a command in the background so that signals are handled while it runs; returns its status.
supervise() {
  local status handled
  "$@" &
  child=$!
  # A signal that came between the caller's test and here is not lost.
  [ "$stop" -eq 0 ] || kill -USR2 "$child" 2>/dev/null || true
  while :; do
    handled=$stop
    status=0
    wait "$child" || status=$?
    # `wait` also returns when a signal was handled; then the child is waited for again.
    if [ "$handled" -ne "$stop" ] && kill -0 "$child" 2>/dev/null; then
      continue
    fi
    break
  done
  child=
  return "$status"
}

# Whether a run has left something to go on from: a checkpoint, or a sample in the making.
can_go_on() { compgen -G "$1/checkpoint*/*" >/dev/null || compgen -G "$1/preparation/*" >/dev/null; }

is_done() { grep -q '"outcome": *"\(done\|finished\|completed\)"' "$1/summary.json" 2>/dev/null; }

run_or_go_on() {
  local folder=$1
  shift
  if can_go_on "$folder"; then
    supervise "${launch[@]}" "$solver" restart "$folder" --threads "$threads"
  else
    # What a run that died before its first checkpoint left is replaced.
    supervise "${launch[@]}" "$solver" "$@" --output "$folder" --overwrite --threads "$threads"
  fi
}
