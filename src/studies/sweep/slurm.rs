//! A job array for Slurm: one task for each member, requeued from its checkpoint until it has finished.

use super::study::Study;
use std::path::Path;

/// Returns the script, with paths relative to the current folder.
#[must_use]
pub fn script(study: &Study, members: usize, file: &Path, output: &Path) -> String {
    let absolute = |path: &Path| {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        quoted(&path.display().to_string())
    };
    let program = std::env::current_exe().map_or("solver".into(), |path| absolute(&path));
    let sweep = format!(
        "\"$solver\" sweep {} --output {}",
        absolute(file),
        absolute(output)
    );
    let run = &study.run;
    let launch = if run.ranks > 1 {
        "export LAUNCH=\"${LAUNCH:-srun}\"\n"
    } else {
        ""
    };
    format!(
        r#"#!/usr/bin/env bash
# sbatch --array=1-{members}%8 THIS-FILE; afterwards: solver sweep {name} --output DIR --collect
#SBATCH --job-name=sweep
#SBATCH --array=1-{members}
#SBATCH --ntasks={ranks}
#SBATCH --cpus-per-task={threads}
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR2@300
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=sweep-%A_%a.out
set -euo pipefail
solver=${{SOLVER:-{program}}}
{launch}
# 300 s before the time limit this script gets SIGUSR2 and passes it on: the member writes a checkpoint, and
# the status is 75.
{sweep} --member "$SLURM_ARRAY_TASK_ID" &
member=$!
trap 'kill -USR2 "$member" 2>/dev/null || true' USR2 TERM
status=0
wait "$member" || status=$?
while kill -0 "$member" 2>/dev/null; do
  # The first wait was cut short by the signal.
  status=0
  wait "$member" || status=$?
done
if [ "$status" -gt 128 ]; then
  # It ended while the signal was being handled: its own status is still to be had.
  status=0
  wait "$member" || status=$?
fi
if [ "$status" -eq 75 ]; then
  scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}"
  exit 0
fi
exit "$status""#,
        name = file.display(),
        ranks = run.ranks,
        threads = run.threads,
    )
}

/// Returns a text quoted as one word of a shell.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}
