//! The state of a run; steps and runs.
//!
//! One step is one fluid step and the solid steps within it. [`Simulation::step`] is the algorithm.
//!
//! | file | content |
//! |---|---|
//! | `run` | launch of runs; `run/start` the state before the first step, `run/runner` the loop, `run/summary` |
//! | `setup`, `coupled` | state from the plan: fluid, initial flow, walls, bodies, grains; fluid with its coupling |
//! | `preparation` | progress and checkpoints of an unfinished sample of grains |
//! | `resume`, `recorders` | continuation from a checkpoint; states of the recorders in it |
//! | `balance`, `calibration`, `affinity` | slabs of equal cost; speed of the fluid on this machine; cores of threads |
//! | `schedule` | the events that are due after a step |
//! | `removal`, `gates` | regions that remove and generate grains; walls that are inserted or removed |
//! | `departures` | bodies and grains that leave through openings for good |
//! | `servos`, `drives` | stresses of servo walls, velocities of walls and bodies that follow tables in time |
//! | `erosion`, `collapse` | records of erosion and of ground collapse |
//! | `crossings` | regions that record the grains that enter and leave them |
//! | `guards`, `escape` | checks of the state; remedies for a grain that left the box |
//! | `means`, `settled` | means over time of probes; how far probes are from settled |
//! | `element_test` | answers of a test of a sample between walls |
//! | `blocks`, `energy`, `versions` | parts of `summary.json` |
//! | `folder`, `table`, `agreement` | the folder of a run, its tables, errors shared by all ranks |
//! | `watch`, `progress`, `phases` | requests to a run; progress on the standard output; times of phases |

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

mod affinity;
pub mod agreement;
mod balance;
pub mod blocks;
pub mod calibration;
pub mod collapse;
pub mod coupled;
pub mod crossings;
mod departures;
mod drives;
mod element_test;
pub mod energy;
pub mod erosion;
mod escape;
pub mod folder;
mod gates;
pub mod guards;
mod means;
pub mod phases;
mod piping;
mod preparation;
pub mod progress;
mod recorders;
pub mod removal;
mod resume;
pub mod run;
mod schedule;
mod servos;
mod settled;
pub mod setup;
mod table;
pub mod versions;
pub mod watch;

use base::error::Error;
use collapse::CollapseRecorder;
use coupling::joint_water::JointWater;
use coupling::lattice::LatticeFlow;
use coupling::seepage::Seepage;
use coupling::water::Water;
use coupling::{Flow, FluidView};
use crossings::Crossings;
use decomposition::Domain;
use dem::Dem;
use dem::escape::Escape;
use dem::particles::Particles;
use dem::space::Space;
use departures::Departures;
use drives::Drives;
use erosion::ErosionRecorder;
use gates::Gates;
use guards::Guards;
use output::Outputs;
use output::averages::Averages;
use output::checkpoint::{RunState, SavedNumber};
pub use output::view;
use phases::{Phase, Phases};
use plan::Plan;
use removal::{DepartedGrain, Removal};
pub use resume::TABLES;
use schedule::Schedule;
use servos::Servos;
use view::StateView;

/// Simulated state at the present step.
struct Present<Sp: Space, S: SavedNumber> {
    plan: Plan,
    domain: Domain,
    flow: Option<Water<Sp, S>>,
    dem: Option<Dem<Sp>>,
    particles: Particles<Sp>,
    /// Sums over time, if requested.
    averages: Option<Averages>,
    /// Number of fluid steps done.
    step: u64,
}

impl<Sp: Space, S: SavedNumber> Present<Sp, S> {
    fn lattice(&self) -> Option<&dyn LatticeFlow<Sp, S>> {
        self.flow.as_ref().and_then(Water::lattice)
    }

    fn seepage(&self) -> Option<&Seepage<Sp>> {
        self.flow.as_ref().and_then(Water::seepage)
    }

    fn joints(&self) -> Option<&JointWater> {
        self.flow.as_ref().and_then(Water::joints)
    }

    /// Returns the physical time [s].
    fn time(&self) -> f64 {
        base::number::real(self.step) * self.plan.clock.time_step
    }

    fn view(&self) -> StateView<'_, Sp> {
        StateView {
            plan: &self.plan,
            domain: &self.domain,
            fluid: self.lattice().map(|flow| flow as &dyn FluidView),
            seepage: self.seepage(),
            joints: self.joints(),
            averages: self.averages.as_ref(),
            particles: &self.particles,
            dem: self.dem.as_ref(),
            step: self.step,
            time: self.time(),
        }
    }

    fn state(&self) -> RunState<'_, Sp, S> {
        RunState {
            fluid: self.lattice().map(LatticeFlow::fluid),
            averages: self.averages.as_ref(),
            seepage: match self.joints() {
                Some(joints) => joints.state(),
                None => self.seepage().map(Seepage::state).unwrap_or_default(),
            },
            particles: &self.particles,
            dem: self.dem.as_ref(),
            earlier: None,
        }
    }
}

/// A run in progress: the simulated state and its recorders.
pub struct Simulation<Sp: Space, S: SavedNumber> {
    now: Present<Sp, S>,
    removal: Removal,
    departures: Departures,
    gates: Gates,
    servos: Servos,
    drives: Drives<Sp>,
    recorder: ErosionRecorder,
    collapse: CollapseRecorder,
    crossings: Crossings,
    outputs: Outputs,
    guards: Guards,
    phases: Phases,
}

/// Text of a failure of the water in a step in which a solid left.
const LEFT_WITH_WATER: &str = "a body or grain left the box with this water";

impl<Sp: Space, S: SavedNumber> Simulation<Sp, S> {
    /// Returns the present state.
    #[must_use]
    pub fn view(&self) -> StateView<'_, Sp> {
        self.now.view()
    }

    /// Returns the cause of a failure of the solids: the failure of the water if it failed too, because such water
    /// accelerates grains. Collective for numerical errors, which all ranks have; other errors may be those of one
    /// rank alone.
    fn cause_of(&mut self, error: Error, steps: u64) -> Error {
        let now = &self.now;
        if !matches!(error, Error::Numerical(_)) {
            return guards::of_solids(error, &now.plan);
        }
        let solids = if Escape::in_text(&error.to_string()).is_some() {
            LEFT_WITH_WATER
        } else {
            "the motion of bodies or grains failed with it"
        };
        let state = (now.lattice(), &now.particles);
        match self
            .guards
            .failed_water((now.step + steps, solids), state, &now.plan, &now.domain)
        {
            Some(water) => water,
            None => guards::of_solids(error, &now.plan),
        }
    }

    /// Advances by one step, or by several steps of the fluid alone if no event lies between them. Collective.
    ///
    /// # Errors
    /// If values are not finite or exceed a guard, or an output cannot be written; the same on all ranks.
    pub fn step(&mut self) -> Result<(), Error> {
        let due = Schedule::next_step(self);
        self.crossings.begin(&self.now.particles, &self.now.plan);
        self.advance_water(due)?;
        self.advance_solids(due)?;
        self.now.step += due.steps;
        let removed = self.change_solids(due)?;
        let now = &mut self.now;
        if let Some(flow) = &mut now.flow {
            flow.update_bodies(&mut now.particles, &now.domain)?;
        }
        self.done_with_joints(Phase::Mapping);
        self.record(&removed)?;
        if due.output {
            self.outputs.write_due(&self.now.view())?;
        }
        self.phases.done(Phase::Output);
        self.check()
    }

    /// Ends a phase. The time of the water in joints in it counts apart.
    fn done_with_joints(&mut self, phase: Phase) {
        let joints = self.now.flow.as_mut().and_then(Water::joints_mut);
        let time = joints.map(JointWater::take_time);
        self.phases.done(phase);
        self.phases
            .transfer(phase, Phase::Joints, time.unwrap_or_default());
    }

    /// Advances the water, and balances its mass and momentum if due. It precedes the solids, because their
    /// positions in this step define the forces. Collective.
    fn advance_water(&mut self, due: Schedule) -> Result<(), Error> {
        let now = &mut self.now;
        if let Some(flow) = &mut now.flow
            && due.balance
        {
            flow.fetch()?;
        }
        if let Some(flow) = &mut now.flow {
            flow.balance_surface(due.balance);
        }
        self.guards.before(now.step, now.lattice(), &now.domain);
        if let Some(flow) = &mut now.flow {
            if due.steps > 1 {
                flow.advance_many(due.steps)?;
            } else {
                flow.advance(&mut now.particles, &now.domain)?;
            }
            if due.populations {
                flow.fetch()?;
            }
        }
        self.done_with_joints(Phase::Fluid);
        let now = &self.now;
        self.guards.after(now.lattice(), &now.domain);
        self.phases.done(Phase::Guards);
        Ok(())
    }

    fn advance_solids(&mut self, due: Schedule) -> Result<(), Error> {
        let now = &mut self.now;
        let time = now.time();
        let next = base::number::real(now.step + due.steps) * now.plan.clock.time_step;
        if let Some(dem) = &mut now.dem {
            self.servos.set_stresses(time, dem);
            self.drives
                .set_velocities([time, next], dem, &mut now.particles);
        }
        let carrier = now.flow.as_mut().and_then(Water::carrier);
        if let (Some(dem), Some(carrier)) = (&mut now.dem, carrier) {
            let (particles, domain) = (&mut now.particles, &now.domain);
            let loaded = dem.loads_ahead(particles, domain);
            if let Err(error) = loaded {
                return Err(self.cause_of(error, due.steps));
            }
            let path = carrier.carry(particles, domain)?;
            dem.carried(particles, domain, path)?;
        } else if let Some(dem) = &mut now.dem {
            let each = u64::from(now.plan.clock.solid_steps_per_step);
            let moved = dem.advance_many(&mut now.particles, &now.domain, each);
            if let Err(error) = moved {
                return Err(self.cause_of(error, due.steps));
            }
        }
        self.done_with_joints(Phase::Grains);
        Ok(())
    }

    /// Moves the gates, removes and generates grains, and returns the removed grains. Collective.
    fn change_solids(&mut self, due: Schedule) -> Result<Vec<DepartedGrain>, Error> {
        let now = &mut self.now;
        let time = now.time();
        let mut changed = false;
        if let Some(dem) = &mut now.dem {
            let when = (now.step, &now.plan);
            changed = self
                .gates
                .apply_changes(when, dem, &mut now.particles, &now.domain)?;
        }
        let (particles, plan, domain) = (&mut now.particles, &now.plan, &now.domain);
        let removed = (self.removal).remove_grains(particles, plan, domain, now.step, time)?;
        let when = (now.step, time);
        let left = self.departures.remove(particles, plan, domain, when)?;
        if left > 0 {
            // Water that fails throws solids out long before the next check.
            let state = (now.lattice(), &now.particles);
            let failed = (self.guards).failed_water(
                (now.step, LEFT_WITH_WATER),
                state,
                &now.plan,
                &now.domain,
            );
            if let Some(error) = failed {
                return Err(error);
            }
        }
        let (particles, plan, domain) = (&mut now.particles, &now.plan, &now.domain);
        let walls = now.dem.as_ref().map_or(&[][..], Dem::walls);
        let solids = (&mut *particles, walls);
        let appeared = self.removal.generate_grains(solids, plan, domain, time)?;
        changed |= !removed.is_empty() || left > 0 || appeared > 0;
        if let Some(dem) = &mut now.dem {
            // All ranks have the same value without a message.
            if changed {
                dem.prepare(particles, domain)?;
            }
            if changed || due.ghosts {
                particles.refresh_ghosts(domain)?;
            }
        }
        self.phases.done(Phase::Removal);
        Ok(removed)
    }

    /// Adds the state to the averages and the rows that are due to the records. Collective.
    fn record(&mut self, removed: &[DepartedGrain]) -> Result<(), Error> {
        let now = &mut self.now;
        let flow = now.flow.as_ref().and_then(Water::lattice);
        if let (Some(averages), Some(flow)) = (&mut now.averages, flow) {
            averages.sample(now.step, flow);
        }
        let breaks = now.dem.as_mut().map(Dem::take_breaks).unwrap_or_default();
        let mass_error = self.guards.mass_error().unwrap_or(f64::NAN);
        let view = now.view();
        (self.recorder).record_due(&view, removed, breaks, mass_error)?;
        if self.guards.checks_at(view.step) {
            // The checks may end the run: write the records first.
            self.recorder.flush(view.domain)?;
        }
        self.guards.include_speed(self.recorder.take_speed());
        self.collapse.record_due(&view, removed)?;
        let when = (view.step, view.time);
        (self.crossings).record(view.particles, view.plan, view.domain, when)?;
        self.phases.done(Phase::Analysis);
        Ok(())
    }

    /// Checks the state where a check is due. Collective.
    fn check(&mut self) -> Result<(), Error> {
        let now = &self.now;
        if now.step == now.plan.clock.steps || self.guards.checks_at(now.step) {
            self.run_guards()?;
        }
        if self.guards.take_unfetched() {
            self.check_state()?;
        }
        self.phases.done(Phase::Guards);
        Ok(())
    }

    /// Copies the state of the water from the GPU, if it is computed there. Collective.
    ///
    /// # Errors
    /// If the GPU fails.
    fn fetch(&mut self) -> Result<(), Error> {
        self.now.flow.as_mut().map_or(Ok(()), Water::fetch)
    }

    /// Runs the guards if they have not run this step. Collective.
    ///
    /// # Errors
    /// If a check fails.
    fn check_state(&mut self) -> Result<(), Error> {
        self.fetch()?;
        self.run_guards()?;
        self.phases.done(Phase::Guards);
        Ok(())
    }

    /// Runs the guards of the present step once. Collective.
    ///
    /// # Errors
    /// If a check fails.
    fn run_guards(&mut self) -> Result<(), Error> {
        let now = &self.now;
        let solids = (&now.particles, now.dem.as_ref().map(Dem::deepest));
        self.guards
            .check(now.step, now.lattice(), solids, &now.plan, &now.domain)
    }

    /// Writes the remaining rows of a failed run, as far as this needs no other rank.
    ///
    /// # Errors
    /// If a table cannot be written.
    fn record_failure(&mut self) -> Result<(), Error> {
        if self.now.domain.communicator().size() > 1 {
            return Ok(());
        }
        let breaks = self
            .now
            .dem
            .as_mut()
            .map(Dem::take_breaks)
            .unwrap_or_default();
        let view = self.now.view();
        self.recorder.note_breaks(&view, breaks);
        self.recorder.flush(view.domain)
    }

    /// Writes the last rows and outputs for the state at the end of the run, unless they were written at this step.
    /// Collective.
    ///
    /// # Errors
    /// If a file cannot be written; the same on all ranks.
    fn record_end(&mut self) -> Result<(), Error> {
        let now = &mut self.now;
        if now.dem.is_some() {
            now.particles.refresh_ghosts(&now.domain)?;
        }
        let view = self.now.view();
        self.outputs.write_all_now(&view)?;
        let mass_error = self.guards.mass_error().unwrap_or(f64::NAN);
        self.recorder.record_end(&view, mass_error)?;
        self.collapse.record_end(&view)
    }

    /// Drops the rows that were written at the present step only because a run ended there. Call it when a resumed
    /// run continues. Collective.
    ///
    /// # Errors
    /// If a file cannot be written; the same on all ranks.
    fn drop_end(&mut self) -> Result<(), Error> {
        let (step, domain) = (self.now.step, &self.now.domain);
        self.outputs.drop_end(step, domain)?;
        self.recorder.drop_end(step, domain)?;
        self.collapse.drop_end(step, domain)
    }
}
