//! Owns the state; step and run.
//!
//! One step is one fluid step and the solid steps within it; the order of [`Simulation::step`] is the algorithm.

pub mod erosion;
pub mod guards;
pub mod phases;
pub mod preparation;
pub mod progress;
pub mod removal;
pub mod run;
pub mod setup;
pub mod view;
pub mod watch;

use crate::checkpoint::{Saved, State};
use crate::coupling::bounce_back::BounceBack;
use crate::coupling::{Flow, FluidView};
use crate::dem::{BondBreak, Dem};
use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::error::Error;
use crate::output::Outputs;
use crate::plan::Plan;
use decomposition::Domain;
use erosion::ErosionRecorder;
use guards::Guards;
use phases::{Phase, Phases};
use removal::{Departed, Removal};
use view::View;

/// A run in progress: state, and what records it.
pub struct Simulation<Sp: Space, S: Saved> {
    plan: Plan,
    domain: Domain,
    flow: Option<BounceBack<Sp, S>>,
    dem: Option<Dem<Sp>>,
    particles: Particles<Sp>,
    removal: Removal,
    recorder: ErosionRecorder,
    outputs: Outputs,
    guards: Guards,
    phases: Phases,
    step: u64,
}

impl<Sp: Space, S: Saved> Simulation<Sp, S> {
    /// One step. Collective.
    ///
    /// # Errors
    /// When the numbers fail or an output cannot be written; the same on all ranks.
    pub fn step(&mut self) -> Result<(), Error> {
        self.guards
            .before(self.step, self.flow.as_ref(), &self.domain);
        if let Some(flow) = &mut self.flow {
            flow.advance(&mut self.particles, &self.domain)?;
        }
        self.phases.done(Phase::Fluid);
        self.guards.after(self.flow.as_ref(), &self.domain);
        self.phases.done(Phase::Guards);
        if let Some(dem) = &mut self.dem {
            let steps = u64::from(self.plan.clock.solid_steps_per_step);
            dem.advance_many(&mut self.particles, &self.domain, steps)?;
        }
        self.phases.done(Phase::Grains);
        self.step += 1;
        let time = self.time();
        let removed = self.removal.leaving(
            &mut self.particles,
            &self.plan,
            &self.domain,
            self.step,
            time,
        )?;
        self.removal
            .appearing(&mut self.particles, &self.plan, &self.domain, time)?;
        if let Some(dem) = &mut self.dem {
            dem.prepare(&mut self.particles, &self.domain)?;
            self.particles.refresh_ghosts(&self.domain)?;
        }
        self.phases.done(Phase::Removal);
        if let Some(flow) = &mut self.flow {
            flow.follow(&mut self.particles, &self.domain)?;
        }
        self.phases.done(Phase::Mapping);
        let breaks = self.dem.as_mut().map(Dem::take_breaks).unwrap_or_default();
        self.record(&removed, breaks)?;
        self.phases.done(Phase::Analysis);
        self.write_due()?;
        self.phases.done(Phase::Output);
        self.guards.check(
            self.step,
            self.flow.as_ref(),
            &self.particles,
            &self.plan,
            &self.domain,
        )?;
        self.phases.done(Phase::Guards);
        Ok(())
    }

    /// Physical time [s].
    #[must_use]
    pub fn time(&self) -> f64 {
        crate::plan::steps_number(self.step) * self.plan.clock.time_step
    }

    fn view(&self) -> View<'_, Sp> {
        View {
            plan: &self.plan,
            domain: &self.domain,
            fluid: self.flow.as_ref().map(|flow| flow as &dyn FluidView),
            particles: &self.particles,
            dem: self.dem.as_ref(),
            step: self.step,
            time: self.time(),
        }
    }

    fn record(&mut self, removed: &[Departed], breaks: Vec<BondBreak<Sp>>) -> Result<(), Error> {
        let view = View {
            plan: &self.plan,
            domain: &self.domain,
            fluid: self.flow.as_ref().map(|flow| flow as &dyn FluidView),
            particles: &self.particles,
            dem: self.dem.as_ref(),
            step: self.step,
            time: crate::plan::steps_number(self.step) * self.plan.clock.time_step,
        };
        let mass_error = self.guards.mass_error();
        self.recorder.record_due(&view, removed, breaks, mass_error)
    }

    fn write_due(&mut self) -> Result<(), Error> {
        if self.outputs.next_due() > self.step {
            return Ok(());
        }
        let view = View {
            plan: &self.plan,
            domain: &self.domain,
            fluid: self.flow.as_ref().map(|flow| flow as &dyn FluidView),
            particles: &self.particles,
            dem: self.dem.as_ref(),
            step: self.step,
            time: crate::plan::steps_number(self.step) * self.plan.clock.time_step,
        };
        self.outputs.write_due(&view)
    }

    fn state(&self) -> State<'_, Sp, S> {
        State {
            fluid: self.flow.as_ref().map(BounceBack::fluid),
            particles: &self.particles,
            contacts: self.dem.as_ref().map(Dem::contacts),
        }
    }
}
