//! Time loop of a run, its response to requests, and its checkpoints.

use super::super::Simulation;
use super::super::balance::{self, Costs};
use super::super::escape;
use super::super::folder::RunFolder;
use super::super::phases::Phase;
use super::super::progress::{Progress, ProgressState};
use super::super::recorders::Recorders;
use super::super::resume::{self, Resumed};
use super::super::watch::Watch;
use super::{Ended, Start};
use base::error::Error;
use coupling::water::Water;
use decomposition::{Communicator, Slabs};
use dem::Dem;
use dem::space::Space;
use io::marks::Marker;
use lbm::quanta::from_quanta;
use output::checkpoint::SavedNumber;
use output::group::RankGroup;
use plan::Plan;
use preparation::supervision::{Request, Requests};
use serde_json::{Value, json};
use std::time::Instant;

/// Name of the mass of the water at the start of the run in a checkpoint, as bits.
pub(super) const INITIAL_MASS: &str = "initial_mass";

pub(super) struct Runner<Sp: Space, S: SavedNumber> {
    pub(super) simulation: Simulation<Sp, S>,
    pub(super) folder: RunFolder,
    pub(super) final_checkpoint: bool,
    /// Step of the newest checkpoint; none if the run has no checkpoint yet.
    pub(super) newest_checkpoint: Option<u64>,
    pub(super) watch: Watch,
    pub(super) progress: Progress,
    pub(super) threads: usize,
    /// Step and reason of the first checkpoint that could not be written for lack of space.
    pub(super) unsaved: Option<(u64, String)>,
    /// `true` if the slabs may change: the case does not list them.
    pub(super) may_cut: bool,
    /// Slabs that cost less than the present ones, found at the newest checkpoint.
    pub(super) cheaper_slabs: Option<Slabs>,
    pub(super) first_step: u64,
    pub(super) notes: Value,
    /// Mass of the water at the start of the run, also after a restart.
    pub(super) initial_mass: f64,
    /// Marker of the table lengths at checkpoints; on the first rank.
    pub(super) marker: Marker,
}

impl<Sp: Space, S: SavedNumber> Runner<Sp, S> {
    pub(super) fn run_to_end(
        plan: Plan,
        communicator: Communicator,
        start: Start,
    ) -> Result<(), Ended> {
        let (json, quiet) = (start.json, start.quiet);
        let options = (start.parent.clone(), start.limit, start.begun);
        let begun = Self::begin(plan, communicator, start);
        let mut runner = begun.map_err(|error| Ended::BetweenSteps(error, 0))?;
        let outcome = loop {
            let outcome = runner.run();
            if let (Ok(Pause::NewSlabs(slabs)), (parent, limit, begun)) = (&outcome, &options) {
                let step = runner.simulation.now.step;
                let start = |folder, resumed| Start {
                    folder,
                    parent: parent.clone(),
                    resumed: Some(resumed),
                    slabs: Some(slabs.clone()),
                    limit: *limit,
                    begun: *begun,
                    threads: 0,
                    json,
                    quiet,
                    final_checkpoint: false,
                };
                runner = runner
                    .with_slabs(start)
                    .map_err(|error| Ended::BetweenSteps(error, step))?;
                continue;
            }
            break outcome.map(|_| ());
        };
        let outcome = outcome.map_err(|error| {
            let now = &runner.simulation.now;
            escape::with_remedy(error, &now.plan, now.step, now.time())
        });
        let text = match &outcome {
            Ok(()) => "done",
            Err(Error::Stopped(_)) => "stopped",
            Err(_) => "failed",
        };
        // If this rank alone failed, a reduction would never complete.
        if matches!(outcome, Ok(()) | Err(Error::Stopped(_))) {
            runner.summarise(text, json).map_err(Ended::Later)?;
        } else if runner.simulation.now.domain.rank() == 0 {
            // Failure to write the tables must not hide the error itself.
            let _ = runner.simulation.record_failure();
            let message = outcome.as_ref().err().map(ToString::to_string);
            let summary =
                json!({ "outcome": text, "error": message, "steps": runner.simulation.now.step });
            let _ = io::atomic::write_json(&runner.folder.path().join("summary.json"), &summary);
        }
        outcome.map_err(Ended::Later)
    }

    /// Restarts the run with other slabs from its newest checkpoint, which was just written. Collective.
    fn with_slabs(self, start: impl FnOnce(RunFolder, Resumed) -> Start) -> Result<Self, Error> {
        let Self {
            simulation,
            folder,
            threads,
            final_checkpoint,
            first_step,
            initial_mass,
            marker,
            ..
        } = self;
        let Simulation { now, phases, .. } = simulation;
        let communicator = now.domain.communicator().clone();
        let plan = now.plan.clone();
        // Drop the old state before the new one is allocated.
        drop((now.flow, now.dem, now.particles, now.averages));
        let found = resume::find(&folder, &communicator)?;
        let start = Start {
            threads,
            final_checkpoint,
            ..start(folder, Resumed::unchanged(found))
        };
        let mut next = Self::begin(plan, communicator, start)?;
        next.first_step = first_step;
        next.initial_mass = initial_mass;
        next.marker = marker;
        next.simulation.phases = phases;
        next.simulation.phases.done(Phase::Checkpoint);
        Ok(next)
    }

    /// Returns slabs that cost clearly less than the present ones, from the positions of the solids and the times
    /// of the phases. Collective.
    fn better_slabs(&self) -> Option<Slabs> {
        let now = &self.simulation.now;
        let communicator = now.domain.communicator();
        if !self.may_cut || communicator.size() == 1 {
            return None;
        }
        let water = balance::water_at_present(now);
        let costs = Costs::for_scene(&now.plan, &now.particles, water.as_deref(), communicator)
            .measured(self.simulation.phases.fluid_and_solids(communicator));
        let other = balance::cut(&now.plan.scene, &costs, communicator.size());
        let worth = balance::is_worth(now.domain.slabs(), &other, &costs);
        worth.then(|| {
            self.progress
                .note(&balance::line(&other, now.domain.slabs(), &costs));
            other
        })
    }

    /// Returns the mass of the lattice, as deviation in lattice units, to compute its drift. Collective.
    pub(super) fn mass(&self) -> f64 {
        let Some(flow) = self.simulation.now.lattice() else {
            return 0.0;
        };
        let communicator = self.simulation.now.domain.communicator();
        let populations = flow.fluid().populations();
        if let Some(surface) = flow.fluid().surface() {
            let mass = surface.mass(populations).cast_unsigned();
            return from_quanta(communicator.all_reduce_sum_u128(mass).cast_signed());
        }
        let mut sum = decomposition::ExactSum::new();
        let length = populations.cells()[populations.order()[2]];
        let mut row = <[Vec<f64>; 4]>::default();
        for (_, cell) in populations.rows() {
            populations.row_moments(cell, length, &mut row);
            for mass in &row[0] {
                sum.add(*mass);
            }
        }
        sum.all_reduce(communicator);
        sum.value()
    }

    fn run(&mut self) -> Result<Pause, Error> {
        self.watch.steps_begin();
        let communicator = self.simulation.now.domain.communicator().clone();
        if let Some(seepage) = self
            .simulation
            .now
            .flow
            .as_mut()
            .and_then(Water::seepage_mut)
        {
            seepage.interrupt_when(self.watch.stop_requests(&communicator));
        }
        let steps = self.simulation.now.plan.clock.steps;
        let save_every = self
            .simulation
            .now
            .plan
            .scene
            .checkpoint
            .every
            .map(|t| self.simulation.now.plan.clock.every(t));
        let mut ask_at = self.simulation.now.step + self.watch.steps();
        if self.first_step > 0
            && self.first_step == self.simulation.now.step
            && self.has_steps_left()
        {
            self.simulation.drop_end()?;
        }
        while self.has_steps_left() {
            let stepped = self.simulation.step();
            if matches!(stepped, Err(Error::Stopped(_))) {
                return Err(self.stop()?);
            }
            stepped?;
            for line in self.simulation.collapse.take_events() {
                self.progress.note(&line);
            }
            for line in self.simulation.gates.take_events() {
                self.progress.note(&line);
            }
            for line in self.simulation.guards.take_events() {
                self.progress.note(&line);
            }
            let step = self.simulation.now.step;
            if save_every.is_some_and(|every| every.falls_on(step)) && step < steps {
                self.save(Occasion::Requested)?;
            }
            if let Some(slabs) = self.cheaper_slabs.take()
                && self.has_steps_left()
            {
                return Ok(Pause::NewSlabs(slabs));
            }
            if self.eroded() {
                break;
            }
            if step >= ask_at {
                self.report();
                let request = self.watch.ask(self.simulation.now.domain.communicator());
                ask_at = step + self.watch.steps();
                self.folder.touch_lock();
                self.simulation.phases.done(Phase::Guards);
                match request {
                    Request::None => {}
                    Request::Checkpoint => self.save(Occasion::Requested)?,
                    // Nothing is left to stop, but the file `STOP` would stop the next run.
                    Request::Stop if step >= steps => {
                        if self.simulation.now.domain.rank() == 0 {
                            self.watch.forget_file();
                        }
                    }
                    Request::Stop => return Err(self.stop()?),
                }
            }
        }
        self.simulation.check_state()?;
        // The state is saved first: if anything fails afterwards, a restart completes the run from here.
        if self.first_step == self.simulation.now.step {
            self.progress.note(&format!(
                "the run had already ended; extend it with `solver restart {} --set time.end=..`",
                self.folder.path().display()
            ));
        }
        if self.final_checkpoint && self.newest_checkpoint != Some(self.simulation.now.step) {
            self.save(Occasion::End)?;
        }
        self.folder.forget_preparation();
        // No checkpoint may be written after this: the rows at the end are not part of the state of a run that
        // continues.
        self.simulation.record_end()?;
        for line in self.simulation.collapse.take_events() {
            self.progress.note(&line);
        }
        self.simulation
            .collapse
            .draw(self.folder.path(), &self.simulation.now.domain)?;
        self.simulation.phases.done(Phase::Output);
        Ok(Pause::Done)
    }

    /// Saves the state after a request to stop, and returns the end of the run. Collective.
    ///
    /// # Errors
    /// If the state cannot be saved, or is not finite.
    fn stop(&mut self) -> Result<Error, Error> {
        let (step, steps) = (
            self.simulation.now.step,
            self.simulation.now.plan.clock.steps,
        );
        self.save(Occasion::Stop)?;
        self.simulation.check_state()?;
        if self.simulation.now.domain.rank() == 0 {
            self.watch.forget_file();
        }
        Ok(Error::Stopped(format!(
            "step {step} of {steps}; continue with `solver restart {}`",
            self.folder.path().display()
        )))
    }

    /// Returns `true` if there is a step left to do; equal on every rank.
    fn has_steps_left(&self) -> bool {
        self.simulation.now.step < self.simulation.now.plan.clock.steps && !self.eroded()
    }

    /// Returns `true` if the eroded fraction at which the case ends the run is reached; equal on every rank.
    fn eroded(&self) -> bool {
        let law = self.simulation.now.plan.scene.erosion_law.as_ref();
        law.and_then(|law| law.end_at_eroded_fraction)
            .is_some_and(|end| self.simulation.recorder.eroded_fraction() >= end)
    }

    fn report(&mut self) {
        if !self.progress.due() {
            return;
        }
        let mut more = String::new();
        if self.simulation.now.lattice().is_some() {
            let Simulation { now, guards, .. } = &mut self.simulation;
            more = guards.line(&now.plan);
        }
        let simulation = &self.simulation;
        if let Some(joints) = simulation.now.joints() {
            let pressures = joints.balance().pressures();
            let pressures = pressures.map_or_else(String::new, |[low, high]| {
                format!("joints {low:.3e} to {high:.3e} Pa so far, ")
            });
            more = format!(
                "{pressures}{} Newton steps, mass error {:.1e}",
                joints.report().newton,
                joints.mass_error()
            );
        }
        if let Some(seepage) = simulation.now.seepage() {
            let (report, balance) = (seepage.report(), seepage.balance());
            more = format!(
                "inflow {:.3e} outflow {:.3e} m3/s, pores Re {:.2e}, {} iterations to {:.0e}, closure {:.1e}, {} \
                 implicit",
                report.inflow,
                report.outflow,
                balance.reynolds,
                report.iterations,
                report.residual,
                balance.closure,
                balance.implicit
            );
        }
        if simulation.now.plan.scene.erosion_law.is_some() {
            more += &format!(
                "  eroded {:.2} %",
                100.0 * simulation.recorder.eroded_fraction()
            );
        }
        let cells = if simulation.now.lattice().is_some() {
            simulation.now.plan.scene.grid.cell_count() as u64
        } else {
            0
        };
        let moment = ProgressState {
            step: simulation.now.step,
            steps: simulation.now.plan.clock.steps,
            time: simulation.now.time(),
            cells,
            // This counts the grains of this rank only, which is accurate enough for a progress line and needs no
            // message.
            grains: simulation.now.particles.owned() as u64,
            solid_steps: u64::from(simulation.now.plan.clock.solid_steps_per_step),
            more,
        };
        self.progress.print_step(&moment);
    }

    fn save(&mut self, occasion: Occasion) -> Result<(), Error> {
        let begun = Instant::now();
        let simulation = &mut self.simulation;
        simulation.fetch()?;
        simulation.outputs.sync(&simulation.now.domain)?;
        let deepest = simulation.now.dem.as_ref().map(Dem::deepest);
        let communicator = simulation.now.domain.communicator();
        simulation.guards.note_overlap(deepest, communicator);
        let recorders = Recorders {
            recorder: simulation.recorder.state(&simulation.now.domain)?,
            collapse: simulation.collapse.state(&simulation.now.domain)?,
            crossings: simulation.crossings.state(&simulation.now.domain)?,
            removal: simulation.removal.state(),
            departures: simulation.departures.clone(),
            guards: Some(simulation.guards.state()),
        };
        let mut attributes = resume::attributes(&simulation.now.plan);
        recorders.write(&mut attributes)?;
        attributes["typical_radius"] = self.notes["typical_radius"].clone();
        attributes["notes"] = self.notes.clone();
        // Stored as bits, so that nothing is rounded.
        attributes[INITIAL_MASS] = json!(self.initial_mass.to_bits());
        let names = resume::tables(&simulation.now.plan);
        let tables = RankGroup(simulation.now.domain.communicator()).on_root(|| {
            let names = names.iter().map(String::as_str);
            self.marker.mark(self.folder.path(), names)
        })?;
        attributes["tables"] = json!(tables);
        let keep = simulation.now.plan.scene.checkpoint.keep as usize;
        let (step, time) = (simulation.now.step, simulation.now.time());
        let communicator = simulation.now.domain.communicator();
        let written = simulation.now.state().write(
            &self.folder.checkpoints(),
            step,
            time,
            attributes,
            keep,
            communicator,
        );
        match written {
            Ok(()) => {
                self.newest_checkpoint = Some(step);
                self.folder.forget_preparation();
                if occasion == Occasion::Requested {
                    self.cheaper_slabs = self.better_slabs();
                }
            }
            Err(io::Error::Space { needed, free, path }) => {
                let lack = format!("it needs {needed} bytes, but {path} has only {free} free");
                self.unsaved.get_or_insert_with(|| (step, lack.clone()));
                match occasion {
                    Occasion::Requested => self.progress.note(&format!(
                        "no checkpoint at step {step}: {lack}; the run continues"
                    )),
                    Occasion::End => self.progress.note(&format!(
                        "no final checkpoint: {lack}; the run cannot be extended from its end"
                    )),
                    Occasion::Stop => {
                        let newest = self.newest_checkpoint.map_or_else(
                            || "there is no earlier checkpoint".to_owned(),
                            |newest_checkpoint| {
                                format!("the newest checkpoint is that of step {newest_checkpoint}")
                            },
                        );
                        return Err(Error::Io(format!(
                            "stop requested at step {step}, but there is no space for a checkpoint: {lack}; {newest}; \
                             free {} bytes before `solver restart {}`",
                            needed.saturating_sub(free),
                            self.folder.path().display()
                        )));
                    }
                }
            }
            Err(error) => return Err(Error::Io(error.to_string())),
        }
        self.watch.record_checkpoint(begun.elapsed());
        self.simulation.phases.done(Phase::Checkpoint);
        Ok(())
    }
}

/// Reason why the time loop ended.
enum Pause {
    /// The run is complete.
    Done,
    /// The run continues with these slabs.
    NewSlabs(Slabs),
}

/// Reason for writing a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Occasion {
    /// The checkpoint is due, or a signal requested it.
    Requested,
    /// The run stops.
    Stop,
    /// The run is complete.
    End,
}
