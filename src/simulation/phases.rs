//! Times of the phases of the step, and the part of them spent waiting for other ranks; reduced over ranks for the
//! table at the end.

use decomposition::{Communicator, Traffic as Sent, Waited, traffic, waited};
use serde::Serialize;
use std::time::{Duration, Instant};

/// Phase of a step, for the table of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Collision, streaming, exchange, boundary faces and loads.
    Fluid,
    /// Solid steps.
    Grains,
    /// Mapping of bodies to cells.
    Mapping,
    /// Removal and generation of grains.
    Removal,
    /// Analyses.
    Analysis,
    /// Fields, series, probes.
    Output,
    /// Checkpoints.
    Checkpoint,
    /// Guards and agreement between ranks.
    Guards,
    /// Water in joints: mouths, network, motion of its blocks.
    Joints,
}

const PHASES: [Phase; 9] = [
    Phase::Fluid,
    Phase::Grains,
    Phase::Mapping,
    Phase::Removal,
    Phase::Analysis,
    Phase::Output,
    Phase::Checkpoint,
    Phase::Guards,
    Phase::Joints,
];

impl Phase {
    /// Returns `true` if the time of this phase counts as computing time apart from the waiting. Files are written
    /// by all ranks together, and waiting inside these calls is not measured.
    fn computes(self) -> bool {
        !matches!(self, Self::Output | Self::Checkpoint)
    }
}

/// Stopwatch for phases: [`Self::done`] adds the time since the previous call to a phase.
#[derive(Debug)]
pub struct Phases {
    spent: [Duration; PHASES.len()],
    waited: [Waited; PHASES.len()],
    last: Instant,
    last_waited: Waited,
    sent_before: Sent,
}

/// Minimum, mean and maximum of a time over the ranks.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    /// Minimum over the ranks \[s\].
    pub min: f64,
    /// Mean over the ranks \[s\].
    pub mean: f64,
    /// Maximum over the ranks \[s\].
    pub max: f64,
}

/// Time of one phase.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PhaseTime {
    /// Phase to which the time belongs.
    pub phase: Phase,
    /// Time of the phase over the ranks.
    #[serde(flatten)]
    pub seconds: Spread,
}

/// Time of waiting for other ranks, which is included in the phases.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Waiting {
    /// Total waiting time.
    pub total: Spread,
    /// Waiting for messages from one rank to another: halos, ghosts, migration.
    pub messages: Spread,
    /// Waiting in collective calls: reductions, broadcasts.
    pub collectives: Spread,
}

/// Messages between ranks during the phases.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Traffic {
    /// Number of messages from one rank to another, all ranks together.
    pub messages: u64,
    /// Bytes of these messages.
    pub bytes: u64,
    /// Number of collective calls: reductions, broadcasts.
    pub collectives: u64,
}

/// Times of a run over the ranks.
#[derive(Clone, Debug)]
pub struct PhaseTimes {
    /// Times of the phases; their sum is the time of the steps.
    pub phases: Vec<PhaseTime>,
    /// Waiting time included in the phases.
    pub waiting: Waiting,
    /// Messages between ranks.
    pub traffic: Traffic,
    /// Computing time of the busiest rank divided by the mean of the ranks: 1 for an even load.
    pub imbalance: f64,
}

impl Phases {
    /// Starts the stopwatch.
    #[must_use]
    pub fn start() -> Self {
        Self {
            spent: [Duration::ZERO; PHASES.len()],
            waited: [Waited::default(); PHASES.len()],
            last: Instant::now(),
            last_waited: waited(),
            sent_before: traffic(),
        }
    }

    /// Adds the time since the last call to `phase`.
    pub fn done(&mut self, phase: Phase) {
        let (now, now_waited) = (Instant::now(), waited());
        if let Some(k) = PHASES.iter().position(|&p| p == phase) {
            self.spent[k] += now - self.last;
            self.waited[k] += now_waited.since(&self.last_waited);
        }
        self.last = now;
        self.last_waited = now_waited;
    }

    /// Moves a part of the time of a phase to another one.
    pub fn transfer(&mut self, from: Phase, to: Phase, time: Duration) {
        let [from, to] = [from, to].map(|phase| PHASES.iter().position(|&p| p == phase));
        if let (Some(from), Some(to)) = (from, to) {
            let time = time.min(self.spent[from]);
            self.spent[from] -= time;
            self.spent[to] += time;
        }
    }

    /// Returns the waiting time in all phases.
    fn waited(&self) -> Waited {
        let mut all = Waited::default();
        for &one in &self.waited {
            all += one;
        }
        all
    }

    /// Returns the time of the computing phases without the waiting in them.
    fn computed(&self) -> Duration {
        PHASES
            .iter()
            .zip(self.spent.iter().zip(&self.waited))
            .filter(|(phase, _)| phase.computes())
            .map(|(_, (spent, waited))| spent.saturating_sub(waited.total()))
            .sum()
    }

    /// Returns the computing time of all ranks together \[s\] for the fluid, and for the solids (their steps and
    /// maps). Collective.
    #[must_use]
    pub fn fluid_and_solids(&self, communicator: &Communicator) -> [f64; 2] {
        [
            &[Phase::Fluid, Phase::Guards][..],
            &[Phase::Grains, Phase::Mapping],
        ]
        .map(|which| {
            let mine: Duration = PHASES
                .iter()
                .zip(self.spent.iter().zip(&self.waited))
                .filter(|(phase, _)| which.contains(phase))
                .map(|(_, (spent, waited))| spent.saturating_sub(waited.total()))
                .sum();
            let nanoseconds = u64::try_from(mine.as_nanos()).unwrap_or(u64::MAX / 4096);
            Duration::from_nanos(communicator.all_reduce_sum_u64(nanoseconds)).as_secs_f64()
        })
    }

    /// Returns the times reduced over the ranks. Collective.
    #[must_use]
    pub fn reduce(&self, communicator: &Communicator) -> PhaseTimes {
        let (waited, computed) = (self.waited(), self.computed());
        // Count the traffic before the reductions below, which are not part of the steps.
        let sent = traffic().since(&self.sent_before);
        let phases = PHASES
            .iter()
            .zip(self.spent)
            .map(|(&phase, spent)| PhaseTime {
                phase,
                seconds: spread_of_ranks(spent, communicator),
            })
            // A run without water in joints has no time for it.
            .filter(|time: &PhaseTime| time.phase != Phase::Joints || time.seconds.max > 0.0)
            .collect();
        let computing = spread_of_ranks(computed, communicator);
        PhaseTimes {
            phases,
            waiting: Waiting {
                total: spread_of_ranks(waited.total(), communicator),
                messages: spread_of_ranks(waited.messages, communicator),
                collectives: spread_of_ranks(waited.collectives, communicator),
            },
            traffic: Traffic {
                messages: communicator.all_reduce_sum_u64(sent.messages),
                bytes: communicator.all_reduce_sum_u64(sent.bytes),
                collectives: communicator.all_reduce_max_u64(sent.collectives),
            },
            imbalance: if computing.mean > 0.0 {
                computing.max / computing.mean
            } else {
                1.0
            },
        }
    }
}

impl PhaseTimes {
    /// Returns the time of the steps \[s\]: that of all phases, averaged over the ranks.
    #[must_use]
    pub fn looped(&self) -> f64 {
        self.phases.iter().map(|p| p.seconds.mean).sum()
    }

    /// Returns a table of the times.
    #[must_use]
    pub fn table(&self) -> String {
        let looped = self.looped().max(1e-9);
        let row = |name: &str, seconds: &Spread| {
            let Spread { min, mean, max } = seconds;
            let share = 100.0 * mean / looped;
            format!("{name:<12} {min:>9.3} {mean:>9.3} {max:>9.3} {share:>6.1}%")
        };
        let mut lines = vec![format!(
            "{:<12} {:>9} {:>9} {:>9} {:>7}",
            "phase", "min s", "mean s", "max s", "share"
        )];
        for spent in &self.phases {
            let name = serde_json::to_value(spent.phase).ok();
            let name = name.as_ref().and_then(|v| v.as_str()).unwrap_or_default();
            lines.push(row(name, &spent.seconds));
        }
        let Waiting {
            total,
            messages,
            collectives,
        } = &self.waiting;
        lines.push(format!(
            "of these, waiting for other ranks (load imbalance {:.2}: computing time of the busiest rank over the \
             mean):",
            self.imbalance
        ));
        lines.push(row("waiting", total));
        lines.push(row("- messages", messages));
        lines.push(row("- reductions", collectives));
        lines.join("\n")
    }
}

/// Returns the minimum, mean and maximum over the ranks. Collective.
fn spread_of_ranks(mine: Duration, communicator: &Communicator) -> Spread {
    let ranks = f64::from(u32::try_from(communicator.size()).unwrap_or(1));
    let seconds = mine.as_secs_f64();
    let nanoseconds = u64::try_from(mine.as_nanos()).unwrap_or(u64::MAX);
    let total = Duration::from_nanos(communicator.all_reduce_sum_u64(nanoseconds));
    Spread {
        min: communicator.all_reduce_min_f64(seconds),
        mean: total.as_secs_f64() / ranks,
        max: communicator.all_reduce_max_f64(seconds),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_joints_is_taken_from_its_phase_and_absent_without_joints() {
        let second = Duration::from_secs(1);
        let mut phases = Phases::start();
        phases.spent[0] = 3 * second;
        let alone = phases.reduce(&Communicator::serial());
        assert!(alone.phases.iter().all(|time| time.phase != Phase::Joints));
        phases.transfer(Phase::Fluid, Phase::Joints, second);
        let account = phases.reduce(&Communicator::serial());
        assert!((account.looped() - 3.0).abs() < 1e-12);
        let joints = account.phases.last().unwrap();
        assert!(joints.phase == Phase::Joints && (joints.seconds.mean - 1.0).abs() < 1e-12);
    }

    #[test]
    fn waiting_and_files_are_no_computing() {
        let second = Duration::from_secs(1);
        let mut phases = Phases::start();
        phases.spent = std::array::from_fn(|_| second);
        phases.waited[0].messages = second / 4;
        phases.waited[5].collectives = second / 2;
        assert_eq!(phases.computed(), second * 7 - second / 4);
        let account = phases.reduce(&Communicator::serial());
        assert!((account.looped() - 9.0).abs() < 1e-12);
        assert!((account.waiting.total.max - 0.75).abs() < 1e-12);
        assert!((account.imbalance - 1.0).abs() < 1e-12);
        let table = account.table();
        for row in [
            "fluid ",
            "guards ",
            "waiting ",
            "- messages ",
            "- reductions ",
        ] {
            assert!(table.lines().any(|line| line.starts_with(row)), "{table}");
        }
        assert!(table.contains("load imbalance 1.00"), "{table}");
        let json = serde_json::to_value(account.phases[0]).unwrap();
        assert_eq!(json["phase"], "fluid");
        assert!((json["mean"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    }
}
