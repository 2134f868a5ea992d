//! Grains and bodies at the start of a run: generated or read, and relaxed.

use super::super::Present;
use super::super::agreement;
use super::super::preparation;
use super::super::resume::{self, Stage};
use super::super::setup;
use super::outside::Outside;
use super::restore::{self, Origin, Source};
use ::preparation::rest::BondRelaxation;
use ::preparation::supervision::Request;
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
    let (communicator, progress) = (&outside.communicator, &outside.progress);
    let earlier = origin.unfinished_sample();
    if let Some(found) = earlier {
        progress.note(&format!(
            "continuing with the sample: {}",
            found.path.display()
        ));
    }
    let note = |line: &str| progress.note(line);
    let prepared = preparation::grains::<Sp>(
        plan,
        &outside.start.folder,
        communicator,
        &mut outside.watch,
        &note,
        &resume::attributes(plan),
        earlier,
    )?;
    progress.note(&prepared.line);
    let mut particles = Particles::<Sp>::new();
    setup::blocks::shapes(plan, &mut particles)?;
    setup::bodies(plan, communicator, &mut particles)?;
    setup::blocks::blocks(plan, communicator, &mut particles)?;
    let (grains, first) = (&prepared.grains, plan.scene.first_grain());
    setup::grains(plan, communicator, &mut particles, grains, first);
    let radius = typical_radius(plan, grains, communicator);
    Ok(Grains {
        particles,
        source: Source::Sample {
            report: prepared.report,
            radius,
        },
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
