//! Grains and bodies at the start of a run: generated or read, and relaxed.

use super::super::Present;
use super::super::agreement;
use super::super::preparation::SampleSupervisor;
use super::super::resume::{self, Stage};
use super::super::setup;
use super::outside::Outside;
use super::restore::{self, Origin, Source};
use ::preparation::rest::BondRelaxation;
use ::preparation::supervision::{Request, SavedSample, Supervision};
use ::preparation::{Engine, Prepared};
use base::error::Error;
use base::number::real;
use decomposition::Communicator;
use dem::Dem;
use dem::particles::Particles;
use dem::space::Space;
use dem::state::Contacts;
use io::checkpoint::{Found, Reader};
use output::checkpoint::{self, RunState, SavedNumber};
use plan::Plan;
use plan::scene::observe::RegionAction;
use plan::scene::sample::ListedGrain;
use serde_json::{Value, json};
use std::cell::RefCell;

/// Grains, bodies and blocks before the domain is divided into slabs: all of them on the first rank.
pub(super) struct Grains<Sp: Space> {
    pub(super) particles: Particles<Sp>,
    pub(super) source: Source,
}

/// Returns the grains of the checkpoint, or otherwise those of the sample, which is generated if it does not exist.
/// Collective.
///
/// # Errors
/// If a checkpoint or a sample cannot be read, made or saved, and after a request to stop.
pub(super) fn prepare<Sp: Space>(
    plan: &Plan,
    origin: &Origin,
    outside: &mut Outside,
) -> Result<Grains<Sp>, Error> {
    if !plan.scene.has_solids() && !generates(plan) {
        return Ok(Grains {
            particles: Particles::new(),
            source: Source::None,
        });
    }
    match origin.found() {
        Some(found) => read(plan, found, origin, &outside.communicator),
        None => make(plan, origin, outside),
    }
}

/// Reads the grains and contacts of a checkpoint. Collective.
fn read<Sp: Space>(
    plan: &Plan,
    found: &Found,
    origin: &Origin,
    communicator: &Communicator,
) -> Result<Grains<Sp>, Error> {
    let reader = restore::reader(found)?;
    // Only the first rank reads the grains, so that it alone may find errors in them.
    let read = read_tables(plan, &reader, origin.other_feeds(), communicator);
    let (mut particles, mut contacts) = agreement::agree(communicator, read)?;
    if let Some(walls) = origin.walls() {
        contacts.take_walls(walls)?;
    }
    setup::blocks::shapes(plan, &mut particles)?;
    Ok(Grains {
        particles,
        source: Source::Checkpoint(contacts),
    })
}

fn read_tables<Sp: Space>(
    plan: &Plan,
    reader: &Reader,
    other_feeds: bool,
    communicator: &Communicator,
) -> Result<(Particles<Sp>, Contacts), Error> {
    let (grains, contacts) = checkpoint::read_tables(reader, communicator.rank())?;
    resume::bounds(plan, other_feeds).hold(&grains, &contacts)?;
    Ok((Particles::from_table(&grains)?, contacts))
}

/// Generates the grains of a sample, or continues with an unfinished sample, and adds bodies and blocks.
/// Collective.
fn make<Sp: Space>(
    plan: &Plan,
    origin: &Origin,
    outside: &mut Outside,
) -> Result<Grains<Sp>, Error> {
    let earlier = origin.unfinished_sample();
    if let Some(found) = earlier {
        outside.progress.note(&format!(
            "continuing with the sample: {}",
            found.path.display()
        ));
    }
    let prepared = sample::<Sp>(plan, outside, earlier)?;
    let (communicator, progress) = (&outside.communicator, &outside.progress);
    progress.note(&prepared.line);
    let mut particles = Particles::<Sp>::new();
    setup::blocks::shapes(plan, &mut particles)?;
    setup::bodies(plan, communicator, &mut particles)?;
    setup::blocks::blocks(plan, communicator, &mut particles)?;
    prepared.insert_into(plan, &mut particles);
    let radius = typical_radius(plan, &prepared.grains, communicator);
    Ok(Grains {
        particles,
        source: Source::Sample {
            report: prepared.report,
            radius,
        },
    })
}

/// Generates, reads or lists the grains and cuts the sample, on the first rank; continues from the checkpoint of an
/// earlier attempt, if any. Collective.
///
/// # Errors
/// If the sample cannot be made, read or saved, and [`Error::Stopped`] after a request; the same on all ranks.
fn sample<Sp: Space>(
    plan: &Plan,
    outside: &mut Outside,
    earlier: Option<&Found>,
) -> Result<Prepared, Error> {
    let (communicator, progress) = (&outside.communicator, &outside.progress);
    let mine = if communicator.rank() == 0 {
        let report = |line: &str| progress.note(line);
        let attributes = resume::attributes(plan);
        let folder = &outside.start.folder;
        let supervisor = SampleSupervisor {
            watch: RefCell::new(&mut outside.watch),
            report: &report,
            communicator,
            folder,
            attributes: &attributes,
        };
        let made = earlier.map(saved::<Sp>).transpose().and_then(|saved| {
            let engine = Engine {
                region: setup::region::<Sp>(plan),
                walls: setup::walls::<Sp>(plan),
            };
            let supervision = Supervision::new(&supervisor, saved);
            ::preparation::prepare(plan, folder.path(), &engine, &supervision)
        });
        supervisor.watch.into_inner().finish(communicator);
        made
    } else {
        outside.watch.answer_checks(communicator);
        Ok(Prepared::default())
    };
    let mut prepared = agreement::agree(communicator, mine)?;
    // Every rank writes the report into checkpoints, and all must write the same bytes.
    let mut report = prepared.report.to_string().into_bytes();
    communicator.broadcast_bytes(0, &mut report);
    prepared.report = serde_json::from_slice(&report)
        .map_err(|e| Error::Internal(format!("the report of the preparation: {e}")))?;
    Ok(prepared)
}

/// Returns the state of a sample from a checkpoint. First rank.
fn saved<Sp: Space>(found: &Found) -> Result<SavedSample<Sp>, Error> {
    let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
    let (grains, contacts) = checkpoint::read_tables(&reader, 0)?;
    Ok(SavedSample {
        particles: Particles::from_table(&grains)?,
        contacts,
        progress: reader.attributes()["preparation"]["sample"].clone(),
    })
}

/// Relaxes bonded grains, adds a report to the notes and opens the walls of the preparation, unless that was done
/// before the checkpoint. Collective.
///
/// # Errors
/// If the solids fail or a checkpoint cannot be written, and after a request to stop.
pub(super) fn settle<Sp: Space, S: SavedNumber>(
    now: &mut Present<Sp, S>,
    origin: &Origin,
    notes: &mut Value,
    outside: &mut Outside,
) -> Result<(), Error> {
    if origin.fluid_has_advanced() {
        return Ok(());
    }
    let Some(engine) = &mut now.dem else {
        return Ok(());
    };
    let rest = match &origin.stage {
        Some(Stage::Rest(state)) => Some(BondRelaxation::restore(state.clone())),
        _ => BondRelaxation::begin(&now.plan.scene, engine, &mut now.particles, &now.domain)?,
    };
    if let Some(rest) = rest {
        let mut attributes = attributes(&now.plan, notes);
        let keep = |rest: &BondRelaxation,
                    particles: &Particles<Sp>,
                    dem: &Dem<Sp>,
                    outside: &mut Outside,
                    request: Request| {
            attributes["preparation"] = json!({ "settling": rest.state() });
            let state = RunState::<Sp, S>::of_grains(particles, dem);
            outside.keep(&state, &attributes, request)
        };
        let (line, report) = rest.run(engine, &mut now.particles, &now.domain, outside, keep)?;
        outside.progress.note(&line);
        notes["settling"] = report;
    }
    let gates = setup::temporary_walls(&now.plan);
    if !gates.is_empty() {
        engine.open_walls(&gates);
        now.particles.forget_loads();
        engine.prepare(&mut now.particles, &now.domain)?;
    }
    // Overlaps during the preparation do not count for the run.
    engine.forget_deepest();
    if now.plan.scene.marks_start() {
        now.particles.mark_start();
    }
    Ok(())
}

/// Returns the attributes of the checkpoints of a preparation.
pub(super) fn attributes(plan: &Plan, notes: &Value) -> Value {
    let mut attributes = resume::attributes(plan);
    attributes["typical_radius"] = notes["typical_radius"].clone();
    attributes["notes"] = notes.clone();
    attributes
}

fn generates(plan: &Plan) -> bool {
    let mut regions = plan.scene.regions.iter();
    regions.any(|region| matches!(region.action, RegionAction::Generate { .. }))
}

/// Returns the mean radius of the grains, or of the bodies and blocks \[m\]. It sets the skin of the neighbour
/// lists and affects no result. Collective.
fn typical_radius(plan: &Plan, grains: &[ListedGrain], communicator: &Communicator) -> f64 {
    let radii: Vec<f64> = if grains.is_empty() {
        let blocks = plan.scene.blocks.iter().flat_map(|blocks| &blocks.list);
        let of_blocks = blocks.map(|block| block.solid.shape.radius());
        let of_bodies = plan.scene.bodies.iter().map(|body| body.radius);
        of_bodies.chain(of_blocks).collect()
    } else {
        grains.iter().map(|g| g.radius).collect()
    };
    let mean = radii.iter().sum::<f64>() / real(radii.len().max(1));
    let agreed = communicator.all_reduce_max_f64(if communicator.rank() == 0 { mean } else { 0.0 });
    if agreed > 0.0 {
        agreed
    } else {
        plan.scene.grid.spacing
    }
}
