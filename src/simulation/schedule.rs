//! Events that are due after a step.

use super::Simulation;
use super::guards::Guards;
use coupling::water::Water;
use dem::space::Space;
use output::checkpoint::SavedNumber;

/// Events that are due after the next step, equal on every rank.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    /// Number of fluid steps that are made at once ([`lbm::fluid::Fluid::at_once`]): more than one only without
    /// grains, and then at most up to the next event.
    pub(super) steps: u64,
    /// `true` if the guards balance the step.
    pub(super) balance: bool,
    /// `true` if a balance, a checkpoint, a recorder or an output reads the populations. The checks of the guards
    /// do not need them on the host.
    pub(super) populations: bool,
    /// `true` if the water, a recorder or an output reads the ghosts of the solids.
    pub(super) ghosts: bool,
    /// `true` if an output is due.
    pub(super) output: bool,
}

impl Schedule {
    /// Finds the events of the next step of a run.
    pub(super) fn next_step<Sp: Space, S: SavedNumber>(simulation: &Simulation<Sp, S>) -> Self {
        let now = &simulation.now;
        let recorders = simulation.recorder.measures() || simulation.collapse.measures();
        let measures = recorders || now.averages.is_some();
        let saves = now.plan.scene.checkpoint.every;
        let saves = saves.map(|every| now.plan.clock.every(every));
        let (end, output) = (now.plan.clock.steps, simulation.outputs.next_due());
        let most = now.flow.as_ref().map_or(1, Water::at_once);
        let steps = if most < 2 || now.dem.is_some() || measures {
            1
        } else {
            let save = saves.map_or(u64::MAX, |every| every.next_from(now.step + 1));
            let look = simulation.guards.next_check(now.step);
            let next = end.min(output).min(save).min(look);
            next.saturating_sub(now.step).clamp(1, most)
        };
        let next = now.step + steps;
        let balance = Guards::balances(now.step);
        let reads = || {
            let saves = saves.is_some_and(|every| every.falls_on(next));
            balance || saves || measures || next >= output.min(end)
        };
        Self {
            steps,
            balance,
            populations: now.flow.is_some() && reads(),
            ghosts: now.flow.is_some() || recorders || output <= next,
            output: output <= next,
        }
    }
}
