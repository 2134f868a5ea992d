//! Where the time goes: phases of the step, reduced over ranks for the table at the end.

use decomposition::Communicator;
use serde::Serialize;
use std::time::{Duration, Instant};

/// A part of the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Collide, stream, exchange, faces and loads.
    Fluid,
    /// Solid steps.
    Grains,
    /// Mapping of bodies to cells.
    Mapping,
    /// Grains that leave or come.
    Removal,
    /// Analyses.
    Analysis,
    /// Fields, series, probes.
    Output,
    /// Checkpoints.
    Checkpoint,
    /// Guards and agreement between ranks.
    Guards,
}

const PHASES: [Phase; 8] = [
    Phase::Fluid,
    Phase::Grains,
    Phase::Mapping,
    Phase::Removal,
    Phase::Analysis,
    Phase::Output,
    Phase::Checkpoint,
    Phase::Guards,
];

/// Stopwatch over phases: time runs into the phase last entered.
#[derive(Debug)]
pub struct Phases {
    spent: [Duration; PHASES.len()],
    last: Instant,
}

/// Seconds of one phase over the ranks.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spent {
    /// Which.
    pub phase: Phase,
    /// Least of any rank [s].
    pub min: f64,
    /// Mean [s].
    pub mean: f64,
    /// Most of any rank [s].
    pub max: f64,
}

impl Phases {
    /// Starts the watch.
    #[must_use]
    pub fn start() -> Self {
        Self {
            spent: [Duration::ZERO; PHASES.len()],
            last: Instant::now(),
        }
    }

    /// The time since the last call belongs to `phase`.
    pub fn done(&mut self, phase: Phase) {
        let now = Instant::now();
        if let Some(k) = PHASES.iter().position(|&p| p == phase) {
            self.spent[k] += now - self.last;
        }
        self.last = now;
    }

    /// Least, mean and most of the ranks. Collective.
    #[must_use]
    pub fn reduce(&self, communicator: &Communicator) -> Vec<Spent> {
        let ranks = f64::from(u32::try_from(communicator.size()).unwrap_or(1));
        PHASES
            .iter()
            .zip(self.spent)
            .map(|(&phase, spent)| {
                let seconds = spent.as_secs_f64();
                let nanoseconds = u64::try_from(spent.as_nanos()).unwrap_or(u64::MAX);
                let total = Duration::from_nanos(communicator.all_reduce_sum_u64(nanoseconds));
                Spent {
                    phase,
                    min: communicator.all_reduce_min_f64(seconds),
                    mean: total.as_secs_f64() / ranks,
                    max: communicator.all_reduce_max_f64(seconds),
                }
            })
            .collect()
    }
}
