//! State of a run that continues from a checkpoint.

use super::super::Present;
use super::super::agreement;
use super::super::departures::Departures;
use super::super::gates::Gates;
use super::super::guards::Guards;
use super::super::recorders::{Recorders, saved_guards};
use super::super::removal::Removal;
use super::super::resume::{self, Resumed, Stage};
use super::super::setup;
use super::outside::Outside;
use base::error::Error;
use coupling::water::Water;
use dem::space::Space;
use dem::state::Contacts;
use io::checkpoint::{Found, Reader};
use output::checkpoint::{self, SavedNumber};
use plan::Plan;
use serde_json::{Value, json};

/// Source of the grains.
pub(super) enum Source {
    /// Case without solids.
    None,
    /// Checkpoint with these contacts.
    Checkpoint(Contacts),
    /// Sample of grains.
    Sample {
        /// Entry in `summary.json`.
        report: Value,
        /// Mean radius of the grains \[m\].
        radius: f64,
    },
}

/// Checkpoint from which a run continues, if any, and the stage in which it was saved.
pub(super) struct Origin {
    resumed: Option<Resumed>,
    pub(super) stage: Option<Stage>,
}

impl Origin {
    /// Checks that the checkpoint fits the plan, and writes the case into the folder if it is new or changed.
    /// Collective.
    ///
    /// # Errors
    /// If the checkpoint does not fit or the case cannot be written, the same on all ranks, [`Error::Io`].
    pub(super) fn read(plan: &Plan, outside: &mut Outside) -> Result<Self, Error> {
        let resumed = outside.start.resumed.take();
        if let Some(resumed) = &resumed {
            resume::fits(plan, resumed)?;
        }
        if resumed.as_ref().is_none_or(|resumed| resumed.changed) {
            let file = outside.start.folder.path().join("case.json");
            agreement::on_first(&outside.communicator, || {
                io::atomic::write(&file, plan.case_text.as_bytes())
                    .map_err(|e| Error::Io(e.to_string()))
            })?;
        }
        let stage = resumed.as_ref().map(Resumed::stage).transpose()?;
        Ok(Self { resumed, stage })
    }

    /// Returns the checkpoint if it contains the state of the run, not only an unfinished sample.
    pub(super) fn found(&self) -> Option<&Found> {
        let resumed = self.resumed.as_ref().map(|resumed| &resumed.found);
        resumed.filter(|_| !matches!(self.stage, Some(Stage::Sample)))
    }

    /// Returns the checkpoint if it contains an unfinished sample.
    pub(super) fn unfinished_sample(&self) -> Option<&Found> {
        let resumed = self.resumed.as_ref().map(|resumed| &resumed.found);
        resumed.filter(|_| matches!(self.stage, Some(Stage::Sample)))
    }

    /// Returns the index of each wall in the earlier run; none if the walls are the same.
    pub(super) fn walls(&self) -> Option<&[Option<usize>]> {
        self.resumed.as_ref()?.walls.as_deref()
    }

    /// Returns the index of each region in the earlier run; none if the regions are the same.
    pub(super) fn regions(&self) -> Option<&[Option<usize>]> {
        self.resumed.as_ref()?.regions.as_deref()
    }

    /// Returns the regions whose rate of generated grains a restart has changed.
    pub(super) fn feeds(&self) -> &[usize] {
        self.resumed.as_ref().map_or(&[], |resumed| &resumed.feeds)
    }

    /// Returns `true` if grains generated before the checkpoint may have had other radii.
    pub(super) fn other_feeds(&self) -> bool {
        self.resumed
            .as_ref()
            .is_some_and(|resumed| resumed.other_feeds)
    }

    /// Returns `true` if the time averages continue from those of the checkpoint.
    pub(super) fn averages_continue(&self) -> bool {
        self.resumed
            .as_ref()
            .is_none_or(|resumed| resumed.averages_continue)
    }

    /// Returns `true` if the preparation was complete at the checkpoint.
    pub(super) fn runs(&self) -> bool {
        matches!(self.stage, Some(Stage::Run))
    }

    /// Returns `true` if the fluid had already been advanced at the checkpoint.
    pub(super) fn fluid_has_advanced(&self) -> bool {
        matches!(self.stage, Some(Stage::Run | Stage::WarmUp(_)))
    }

    /// Returns the number of warm-up steps done before the checkpoint.
    pub(super) fn warm_up_steps(&self) -> u64 {
        match self.stage {
            Some(Stage::WarmUp(steps)) => steps,
            _ => 0,
        }
    }
}

/// Parts of a saved run in addition to the simulated state.
pub(super) struct Parts {
    pub(super) notes: Value,
    pub(super) removal: Removal,
    pub(super) departures: Departures,
    pub(super) gates: Gates,
    pub(super) guards: Guards,
    /// States of the recorders, if the preparation was complete.
    pub(super) recorders: Option<Recorders>,
    /// Velocities at the last steadiness check of an unfinished warm-up.
    pub(super) earlier: Option<Vec<f64>>,
}

impl Parts {
    fn new(plan: &Plan) -> Self {
        Self {
            notes: json!({}),
            removal: Removal::new(plan),
            departures: Departures::default(),
            gates: Gates::new(plan),
            guards: Guards::new(plan),
            recorders: None,
            earlier: None,
        }
    }
}

/// Opens the file of a checkpoint.
///
/// # Errors
/// If it cannot be read, [`Error::Io`].
pub(super) fn reader(found: &Found) -> Result<Reader, Error> {
    Reader::open(found).map_err(|e| Error::Io(e.to_string()))
}

/// Completes the state with data from the checkpoint, or with the contacts of a new sample. Collective.
///
/// # Errors
/// If the checkpoint cannot be read or a grain overlaps a new wall.
pub(super) fn state<Sp: Space, S: SavedNumber>(
    now: &mut Present<Sp, S>,
    origin: &Origin,
    source: Source,
    outside: &Outside,
) -> Result<Parts, Error> {
    let mut parts = Parts::new(&now.plan);
    if let Some(found) = origin.found() {
        let reader = reader(found)?;
        // The water in joints computes its time from the step.
        now.step = found.manifest.step;
        flow(now, origin, &reader, &mut parts)?;
        let attributes = reader.attributes();
        parts.notes = attributes["notes"].clone();
        let meters = saved_guards(attributes)?;
        parts.guards.restore(meters.unwrap_or_default());
        if origin.runs() {
            let saved = Recorders::read(attributes)?;
            let (time, changes) = (found.manifest.time, (origin.regions(), origin.feeds()));
            parts.removal.restore(&saved.removal, changes, time)?;
            parts.departures = saved.departures.clone();
            parts.recorders = Some(saved);
        }
        if let Source::Checkpoint(contacts) = source {
            solids(now, origin, found, &contacts, &mut parts)?;
        }
        let place = found.path.display();
        outside.progress.note(&if origin.runs() {
            format!("continuing from step {}: {place}", now.step)
        } else {
            format!("continuing the preparation: {place}")
        });
    } else if let Source::Sample { report, radius } = source {
        let mut engine = setup::dem::<Sp>(&now.plan, radius)?;
        engine.prepare(&mut now.particles, &now.domain)?;
        parts.notes = json!({ "preparation": report, "typical_radius": radius });
        now.dem = Some(engine);
    }
    Ok(parts)
}

/// Reads the fluid. Collective.
fn flow<Sp: Space, S: SavedNumber>(
    now: &mut Present<Sp, S>,
    origin: &Origin,
    reader: &Reader,
    parts: &mut Parts,
) -> Result<(), Error> {
    let communicator = now.domain.communicator();
    if origin.fluid_has_advanced()
        && let Some(flow) = now.flow.as_mut().and_then(Water::lattice_mut)
    {
        let read = checkpoint::read_fluid(flow.fluid_mut(), reader);
        agreement::agree(communicator, read)?;
        if let Some(Stage::WarmUp(_)) = origin.stage {
            let read = checkpoint::read_earlier(flow.fluid(), reader);
            parts.earlier = Some(agreement::agree(communicator, read)?);
        }
        flow.restart();
    }
    if origin.runs()
        && let Some(flow) = now.flow.as_mut().and_then(Water::seepage_mut)
    {
        let read = checkpoint::read_seepage(reader);
        flow.restore(&agreement::agree(communicator, read)?)?;
    }
    let step = now.step;
    if origin.runs()
        && let Some(flow) = now.flow.as_mut().and_then(Water::joints_mut)
    {
        let read = checkpoint::read_seepage(reader);
        flow.restore(&agreement::agree(communicator, read)?, step)?;
    }
    Ok(())
}

/// Creates the engine of the solids with the saved contacts. Collective.
fn solids<Sp: Space, S: SavedNumber>(
    now: &mut Present<Sp, S>,
    origin: &Origin,
    found: &Found,
    contacts: &Contacts,
    parts: &mut Parts,
) -> Result<(), Error> {
    let radius = found.manifest.attributes["typical_radius"].as_f64();
    let radius = radius.unwrap_or(1.0);
    let (plan, particles) = (&now.plan, &mut now.particles);
    let mut engine = setup::dem::<Sp>(plan, radius)?;
    // The relaxation of bonded grains measures displacements of its own.
    let relaxes = matches!(origin.stage, Some(Stage::Rest(_)));
    if !plan.scene.marks_start() {
        if !relaxes {
            particles.forget_start();
        }
    } else if origin.fluid_has_advanced() && plan.scene.follows_grains() && !particles.has_start() {
        return Err(Error::Io(format!(
            "{} does not contain the initial positions of the grains, because its run had no displacements; \
             remove `output.grains.displacement` and `analysis.ground_collapse`, or start a new run",
            found.path.display()
        )));
    }
    engine.restore(contacts)?;
    if let Some(walls) = origin.walls() {
        resume::drive_walls(plan, &mut engine);
        resume::check_new_walls(plan, walls, &parts.gates, now.step, particles, &now.domain)?;
    }
    if origin.fluid_has_advanced() {
        engine.open_walls(&setup::temporary_walls(plan));
        parts.gates.restore(now.step, &mut engine);
    }
    engine.prepare(particles, &now.domain)?;
    parts.notes["typical_radius"] = json!(radius);
    now.dem = Some(engine);
    Ok(())
}
