//! Progress of a run: a bar on a terminal, plain lines in a batch log.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// State of the run for a progress line.
#[derive(Clone, Debug, Default)]
pub struct ProgressState {
    /// Number of steps done.
    pub step: u64,
    /// Number of steps of the whole run.
    pub steps: u64,
    /// Physical time \[s\].
    pub time: f64,
    /// Number of cells of the lattice.
    pub cells: u64,
    /// Number of grains of this rank.
    pub grains: u64,
    /// Solid steps per fluid step.
    pub solid_steps: u64,
    /// Further text, such as `lattice velocity 0.03, eroded 12 %`.
    pub more: String,
}

/// Printer of progress lines at intervals of wall time, on the first rank.
pub struct Progress {
    prints_messages: bool,
    terminal: bool,
    every: Duration,
    start: Instant,
    first_step: u64,
    last: Instant,
    last_step: u64,
}

/// Interval of progress lines in a batch log.
const LINE_EVERY: Duration = Duration::from_secs(30);
/// Interval at which the line on a terminal is refreshed.
const BAR_EVERY: Duration = Duration::from_millis(500);

/// Returns the number of decimals with which times up to `end` have at least four significant digits.
fn decimals_of(end: f64) -> usize {
    const MIN_STEPS: i64 = 4;
    let first = base::number::floor_i64(end.log10().clamp(-20.0, 20.0));
    usize::try_from((MIN_STEPS - first).clamp(MIN_STEPS, 15)).unwrap_or(0)
}

impl Progress {
    /// Returns a printer for a run that starts at `step`; without `prints_messages` it prints nothing.
    #[must_use]
    pub fn new(prints_messages: bool, step: u64) -> Self {
        let terminal = on_terminal();
        let now = Instant::now();
        Self {
            prints_messages,
            terminal,
            every: if terminal { BAR_EVERY } else { LINE_EVERY },
            start: now,
            first_step: step,
            last: now,
            last_step: step,
        }
    }

    /// Returns `true` if a progress line is due. Called every few steps.
    #[must_use]
    pub fn due(&self) -> bool {
        self.prints_messages && self.last.elapsed() >= self.every
    }

    /// Prints the progress of the run.
    pub fn print_step(&mut self, moment: &ProgressState) {
        let since = self.last.elapsed().as_secs_f64().max(1e-9);
        let number = base::number::real;
        let rate = number(moment.step.saturating_sub(self.last_step)) / since;
        let whole = number(moment.step.saturating_sub(self.first_step))
            / self.start.elapsed().as_secs_f64().max(1e-9);
        let left = number(moment.steps.saturating_sub(moment.step)) / whole.max(1e-12);
        let part = number(moment.step) / number(moment.steps.max(1));
        let decimals = decimals_of(moment.time / part);
        let mut text = format!(
            "step {} of {} ({:.1} %)  t = {:.decimals$} s",
            moment.step,
            moment.steps,
            100.0 * part,
            moment.time
        );
        if moment.cells > 0 {
            text += &format!("  {:.1} MLUPS", rate * number(moment.cells) / 1e6);
        }
        if moment.grains > 0 {
            let updates = rate * number(moment.grains) * number(moment.solid_steps);
            text += &format!("  {:.2} M particle-steps/s", updates / 1e6);
        }
        if !moment.more.is_empty() {
            text += "  ";
            text += &moment.more;
        }
        text += &format!("  ETA {}", clock(left));
        if self.terminal {
            const WIDTH: usize = 24;
            let full = base::number::whole(part * 24.0).min(WIDTH);
            let bar: String = (0..WIDTH)
                .map(|k| if k < full { '█' } else { '░' })
                .collect();
            write(&format!("\r\x1b[2K{bar} {text}"));
        } else {
            write(&format!("{text}\n"));
        }
        self.last = Instant::now();
        self.last_step = moment.step;
    }

    /// Prints a message on a line of its own, which later progress does not overwrite.
    pub fn note(&self, text: &str) {
        if self.prints_messages && !text.is_empty() {
            let before = if self.terminal { "\r\x1b[2K" } else { "" };
            write(&format!("{before}{text}\n"));
        }
    }
}

/// Returns `true` if the standard output is a terminal that a person may read. Under `mpirun` each rank writes to a
/// pseudo-terminal of `mpirun`, so that the output of `mpirun` decides.
fn on_terminal() -> bool {
    if !std::io::stdout().is_terminal() {
        return false;
    }
    if std::env::var_os("OMPI_COMM_WORLD_SIZE").is_none() {
        return true;
    }
    launcher_on_terminal(Path::new("/proc"), std::process::id())
}

/// Names of the Open MPI programs that start ranks on their machine.
const LAUNCHERS: [&str; 4] = ["mpirun", "mpiexec", "orterun", "prterun"];

/// Returns `true` if the launcher above process `id` in a `/proc` writes to a terminal; `false` if the launcher
/// runs on another machine.
fn launcher_on_terminal(proc: &Path, mut id: u32) -> bool {
    // Shells and timers may lie between the rank and the launcher.
    for _ in 0..8 {
        let folder = proc.join(id.to_string());
        let Ok(stat) = std::fs::read_to_string(folder.join("stat")) else {
            return false;
        };
        // The line is `id (name) state parent ...`; the name may contain any character.
        let Some((head, tail)) = stat.rsplit_once(')') else {
            return false;
        };
        let name = head.split_once('(').map_or("", |(_, name)| name);
        if LAUNCHERS.contains(&name) {
            return std::fs::read_link(folder.join("fd/1")).is_ok_and(|target| {
                let target = target.to_string_lossy();
                target.starts_with("/dev/pts") || target.starts_with("/dev/tty")
            });
        }
        let parent = tail.split_whitespace().nth(1).and_then(|p| p.parse().ok());
        match parent {
            Some(parent) if parent > 0 => id = parent,
            _ => return false,
        }
    }
    false
}

/// Returns a time in seconds as h:mm:ss.
#[must_use]
pub fn clock(seconds: f64) -> String {
    if !seconds.is_finite() || seconds > 3.6e7 {
        return "unknown".into();
    }
    let s = base::number::whole(seconds.max(0.0).round());
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

fn write(text: &str) {
    // A closed terminal must not end a run.
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes());
    let _ = out.flush();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// Creates a process in a simulated `/proc`.
    fn process(proc: &Path, id: u32, name: &str, parent: u32, output: &str) {
        let folder = proc.join(id.to_string());
        std::fs::create_dir_all(folder.join("fd")).unwrap();
        let stat = format!("{id} ({name}) S {parent} {id} {id} 0 -1");
        std::fs::write(folder.join("stat"), stat).unwrap();
        symlink(output, folder.join("fd/1")).unwrap();
    }

    #[test]
    fn the_output_of_mpirun_decides() {
        for (output, terminal) in [
            ("/dev/pts/3", true),
            ("/dev/tty1", true),
            ("/tmp/log", false),
            ("pipe:[77]", false),
            ("/dev/null", false),
        ] {
            let proc = tempfile::tempdir().unwrap();
            // The ranks see the pseudo-terminal of mpirun.
            process(proc.path(), 40, "solver", 30, "/dev/pts/9");
            process(proc.path(), 30, "a (b) c", 20, "/dev/pts/9");
            process(proc.path(), 20, "mpirun", 10, output);
            process(proc.path(), 10, "bash", 1, "/dev/pts/3");
            assert_eq!(launcher_on_terminal(proc.path(), 40), terminal, "{output}");
        }
    }

    #[test]
    fn without_a_launcher_nobody_looks() {
        let proc = tempfile::tempdir().unwrap();
        process(proc.path(), 40, "solver", 30, "/dev/pts/9");
        process(proc.path(), 30, "orted", 1, "/dev/pts/9");
        process(proc.path(), 1, "init", 0, "/dev/pts/9");
        assert!(!launcher_on_terminal(proc.path(), 40));
        assert!(!launcher_on_terminal(proc.path(), 41));
    }

    #[test]
    fn short_runs_have_more_decimals() {
        for (end, decimals) in [(3600.0, 4), (1.0, 4), (0.2, 5), (2e-4, 8), (0.0, 15)] {
            assert_eq!(decimals_of(end), decimals, "{end}");
        }
        assert_eq!(decimals_of(f64::NAN), 4);
    }

    #[test]
    fn seconds_are_hours_minutes_seconds() {
        assert_eq!(clock(3723.4), "1:02:03");
        assert_eq!(clock(f64::NAN), "unknown");
    }
}
