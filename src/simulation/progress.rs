//! What a person sees while a run goes on: a bar on a terminal, plain lines in a batch log.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// What there is to say about the present moment.
#[derive(Clone, Debug, Default)]
pub struct Moment {
    /// Steps done and in all.
    pub step: u64,
    /// Steps of the whole run.
    pub steps: u64,
    /// Physical time [s].
    pub time: f64,
    /// Cells of the lattice.
    pub cells: u64,
    /// Grains in the run.
    pub grains: u64,
    /// Solid steps per step.
    pub solid_steps: u64,
    /// More, such as `Mach 0.03, eroded 12 %`.
    pub more: String,
}

/// Speaks every now and then on the first rank.
pub struct Progress {
    speaks: bool,
    terminal: bool,
    every: Duration,
    start: Instant,
    first_step: u64,
    last: Instant,
    last_step: u64,
}

/// Batch logs get a line this often.
const LINE_EVERY: Duration = Duration::from_secs(30);
/// A terminal is refreshed this often.
const BAR_EVERY: Duration = Duration::from_millis(500);

impl Progress {
    /// Begins at a step.
    #[must_use]
    pub fn new(speaks: bool, step: u64) -> Self {
        let terminal = std::io::stdout().is_terminal();
        let now = Instant::now();
        Self {
            speaks,
            terminal,
            every: if terminal { BAR_EVERY } else { LINE_EVERY },
            start: now,
            first_step: step,
            last: now,
            last_step: step,
        }
    }

    /// Whether it is time to speak (asked every few steps).
    #[must_use]
    pub fn due(&self) -> bool {
        self.speaks && self.last.elapsed() >= self.every
    }

    /// Says where the run is.
    pub fn say(&mut self, moment: &Moment) {
        let since = self.last.elapsed().as_secs_f64().max(1e-9);
        let number = crate::plan::steps_number;
        let rate = number(moment.step.saturating_sub(self.last_step)) / since;
        let whole = number(moment.step.saturating_sub(self.first_step))
            / self.start.elapsed().as_secs_f64().max(1e-9);
        let left = number(moment.steps.saturating_sub(moment.step)) / whole.max(1e-12);
        let part = number(moment.step) / number(moment.steps.max(1));
        let mut text = format!(
            "step {} of {} ({:.1} %)  t = {:.4} s",
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
            let full = crate::scene::grid::whole(part * 24.0).min(WIDTH);
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

    /// A sentence that stays.
    pub fn note(&self, text: &str) {
        if self.speaks && !text.is_empty() {
            let before = if self.terminal { "\r\x1b[2K" } else { "" };
            write(&format!("{before}{text}\n"));
        }
    }
}

/// Seconds as h:mm:ss.
#[must_use]
pub fn clock(seconds: f64) -> String {
    if !seconds.is_finite() || seconds > 3.6e7 {
        return "unknown".into();
    }
    let s = crate::scene::grid::whole(seconds.max(0.0).round());
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

fn write(text: &str) {
    // A closed terminal is no reason to lose a run.
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes());
    let _ = out.flush();
}
