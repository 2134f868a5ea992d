//! Start of a run: from a plan or a checkpoint to the state before its next step.

use super::super::agreement;
use super::super::balance::{self, Costs};
use super::super::collapse::CollapseRecorder;
use super::super::coupled;
use super::super::crossings::Crossings;
use super::super::drives::Drives;
use super::super::erosion::ErosionRecorder;
use super::super::phases::Phases;
use super::super::progress::Progress;
use super::super::recorders::Recorders;
use super::super::resume;
use super::super::servos::Servos;
use super::super::setup;
use super::super::versions::versions;
use super::super::{Present, Simulation};
use super::Start;
use super::grains::{self, Grains};
use super::outside::Outside;
use super::restore::{self, Origin, Parts};
use super::runner::{INITIAL_MASS, Runner};
use super::warm_up::{Reached, warm_up};
use ::preparation::rest::EarlyBreak;
use base::error::Error;
use base::number::real;
use base::units::LatticeUnits;
use case::fluid::Device;
use coupling::Flow;
use coupling::water::Water;
use decomposition::{Communicator, Domain, Slabs};
use dem::Dem;
use dem::particles::Particles;
use dem::space::Space;
use io::checkpoint::Found;
use io::marks::Marker;
use lbm::fluid::Fluid;
use lbm::initial::Field;
use output::Outputs;
use output::averages::Averages;
use output::checkpoint::{self, SavedNumber};
use plan::Plan;
use plan::scene::flow::Flow as SceneFlow;
use plan::scene::initial::Initial;
use serde_json::Value;

impl<Sp: Space, S: SavedNumber> Runner<Sp, S> {
    /// Prepares a run up to its first step, or continues from the checkpoint of `start`. Collective.
    ///
    /// # Errors
    /// If the state cannot be made, read or written, and [`Error::Stopped`] after a request.
    pub(super) fn begin(
        mut plan: Plan,
        communicator: Communicator,
        start: Start,
    ) -> Result<Self, Error> {
        let listed = super::listed_slabs(&plan.scene.grid, communicator.size())?;
        let may_cut = listed.is_none();
        let mut outside = Outside::open(&plan, communicator, start)?;
        let origin = Origin::read(&plan, &mut outside)?;
        // Read the field first, so that a wrong file is found before a long preparation of grains.
        let field = read_field(&plan, &origin)?;
        // The grains come before the slabs, all of them on the first rank: their positions determine where the
        // slabs are cut.
        let Grains { particles, source } = grains::prepare::<Sp>(&plan, &origin, &mut outside)?;
        plan.scene.forget_sample();
        let slabs = match outside.start.slabs.take().or(listed) {
            Some(slabs) => slabs,
            None => cut_slabs(&mut plan, &particles, &outside),
        };
        let domain = Domain::new(outside.communicator.clone(), slabs);
        let domain = domain.map_err(|e| Error::Internal(e.to_string()))?;
        let flow = build_flow(&plan, &domain, &origin, field)?;
        let mut now = Present {
            plan,
            domain,
            flow,
            dem: None,
            particles,
            averages: None,
            step: 0,
        };
        let mut parts = restore::state(&mut now, &origin, source, &outside)?;
        grains::settle(&mut now, &origin, &mut parts.notes, &mut outside)?;
        place_bodies(&mut now)?;
        let flow_age = age_flow(&mut now, &origin, &mut parts, &mut outside)?;
        let mut records = Records::open(&now, &origin, &outside)?;
        records.restore(parts.recorders.take(), origin.regions(), flow_age)?;
        now.averages = read_averages(&now, &origin)?;
        let mut runner = Self::new(now, parts, records, outside);
        runner.may_cut = may_cut;
        if origin.runs() {
            runner.newest_checkpoint = Some(runner.first_step);
            let saved = origin.found().and_then(saved_initial_mass);
            runner.initial_mass = saved.unwrap_or(runner.initial_mass);
        } else {
            runner.record_first()?;
        }
        runner.log_ready();
        runner.simulation.phases = Phases::start();
        Ok(runner)
    }

    /// Returns the run in the state `now`. Collective.
    fn new(mut now: Present<Sp, S>, parts: Parts, records: Records, outside: Outside) -> Self {
        let progress = Progress::new(outside.prints_messages(), now.step);
        let Outside { start, watch, .. } = outside;
        let first_step = now.step;
        let servos = Servos::start(&now.plan, now.dem.as_mut());
        let drives = Drives::new(&now.plan);
        let mut runner = Self {
            simulation: Simulation {
                now,
                removal: parts.removal,
                departures: parts.departures,
                gates: parts.gates,
                servos,
                drives,
                recorder: records.recorder,
                collapse: records.collapse,
                crossings: records.crossings,
                outputs: records.outputs,
                guards: parts.guards,
                phases: Phases::start(),
            },
            folder: start.folder,
            final_checkpoint: start.final_checkpoint,
            newest_checkpoint: None,
            unsaved: None,
            watch,
            progress,
            threads: start.threads,
            may_cut: false,
            cheaper_slabs: None,
            first_step,
            notes: parts.notes,
            initial_mass: 0.0,
            marker: Marker::default(),
        };
        runner.initial_mass = runner.mass();
        runner
    }

    /// Writes the rows and outputs for the state before the first step. Collective.
    fn record_first(&mut self) -> Result<(), Error> {
        let Simulation {
            now,
            recorder,
            collapse,
            outputs,
            ..
        } = &mut self.simulation;
        // The list of the bonds that broke before the run is in `bonds.csv` from now on.
        let settling = self
            .notes
            .get_mut("settling")
            .and_then(Value::as_object_mut);
        if let Some(early) = settling.and_then(|settling| settling.remove("breaks")) {
            let early: Vec<EarlyBreak> = serde_json::from_value(early)
                .map_err(|error| Error::Internal(error.to_string()))?;
            recorder.note_early_breaks(&now.view(), &early);
        }
        // Loads at the start may break bonds as well.
        let breaks = now.dem.as_mut().map(Dem::take_breaks).unwrap_or_default();
        recorder.record_due(&now.view(), &[], breaks, 0.0)?;
        collapse.record_due(&now.view(), &[])?;
        outputs.write_due(&now.view())
    }

    fn log_ready(&self) {
        let now = &self.simulation.now;
        log::debug!(
            "rank {}: ready at step {} of {} after {:.3} s, {} grains and bodies here, \
             {} bytes of memory at most so far",
            now.domain.rank(),
            now.step,
            now.plan.clock.steps,
            self.watch.elapsed().as_secs_f64(),
            now.particles.owned(),
            super::summary::peak_rss()
        );
    }
}

/// Reads the file of the initial flow, if the case names one and the run does not continue with a later flow.
fn read_field(plan: &Plan, origin: &Origin) -> Result<Option<Box<dyn Field>>, Error> {
    match (&plan.scene.flow, plan.units) {
        (Some(scene), Some(units)) if !origin.fluid_has_advanced() => match &scene.initial {
            Initial::File(path) => setup::initial::file(path, plan, units).map(Some),
            _ => Ok(None),
        },
        _ => Ok(None),
    }
}

/// Returns the mass of the water at the start of the run of a checkpoint, so that its balance includes the time before
/// the restart; `None` if the checkpoint does not contain it.
fn saved_initial_mass(found: &Found) -> Option<f64> {
    let bits = found.manifest.attributes[INITIAL_MASS].as_u64()?;
    Some(f64::from_bits(bits)).filter(|mass| mass.is_finite())
}

/// Returns slabs of equal cost; may measure the speed of the machine for this. Collective.
fn cut_slabs<Sp: Space>(plan: &mut Plan, particles: &Particles<Sp>, outside: &Outside) -> Slabs {
    let communicator = &outside.communicator;
    let water = balance::water_at_start(&plan.scene);
    let mut costs = Costs::for_scene(plan, particles, water.as_deref(), communicator).planned();
    if balance::depends_on_the_machine(plan, &costs, communicator) {
        plan.estimate.machine.fluid = balance::speed(plan, communicator);
        costs = Costs::for_scene(plan, particles, water.as_deref(), communicator).planned();
    }
    let slabs = balance::cut(&plan.scene, &costs, communicator.size());
    let equal = balance::equal(&plan.scene, costs.len(), communicator.size());
    if slabs != equal {
        let line = balance::line(&slabs, &equal, &costs);
        outside.progress.note(&line);
    }
    slabs
}

/// Creates the fluid with its coupling, in its initial state unless the run continues with a later one. Collective.
fn build_flow<Sp: Space, S: SavedNumber>(
    plan: &Plan,
    domain: &Domain,
    origin: &Origin,
    field: Option<Box<dyn Field>>,
) -> Result<Option<Water<Sp, S>>, Error> {
    let (Some(scene), Some(units)) = (&plan.scene.flow, plan.units) else {
        if let Some(joints) = setup::joints(plan)? {
            return Ok(Some(Water::Joints(Box::new(joints))));
        }
        let seepage = setup::seepage::<Sp>(plan, domain.communicator())?;
        return Ok(seepage.map(|seepage| Water::Seepage(Box::new(seepage))));
    };
    let mut fluid = build_fluid::<S>(plan, scene, &units, domain)?;
    if !origin.fluid_has_advanced()
        && let Some(field) = setup::initial::formula(plan, scene, units).or(field)
    {
        fluid.initialise(field.as_ref());
    }
    if plan.scene.surface.is_some() {
        fluid.open_surface(domain)?;
        if let Some(tension) = setup::tension(plan, scene, &units) {
            fluid.add_surface_tension(tension, domain)?;
        }
    }
    let mut flow = coupled::flow::<Sp, S>(plan, fluid, units);
    if let Some(joints) = setup::joints(plan)? {
        flow = flow.with_joints(joints);
    }
    if let (Some(surface), false) = (&plan.scene.surface, origin.fluid_has_advanced())
        && let Some(lattice) = flow.lattice_mut()
    {
        lattice.fluid_mut().fill(&|cell| surface.fill(cell));
    }
    Ok(Some(flow))
}

fn build_fluid<S: SavedNumber>(
    plan: &Plan,
    scene: &SceneFlow,
    units: &LatticeUnits,
    domain: &Domain,
) -> Result<Fluid<S>, Error> {
    let setup = setup::fluid(plan, scene, units)?;
    let gpu = setup.device == Device::Gpu;
    Fluid::<S>::new(setup, domain).map_err(|error| {
        if gpu {
            let path = "fluid.lattice_boltzmann.device = gpu";
            let remedy = "--set fluid.lattice_boltzmann.device=cpu, or auto";
            Error::Usage(format!("{path}: {error}; use {remedy}"))
        } else {
            // The memory cannot hold the slab.
            Error::Io(error.to_string())
        }
    })
}

/// Maps the solids onto the lattice. Collective.
fn place_bodies<Sp: Space, S: SavedNumber>(now: &mut Present<Sp, S>) -> Result<(), Error> {
    if now.dem.is_some() {
        now.particles.refresh_ghosts(&now.domain)?;
    }
    match &mut now.flow {
        Some(flow) => flow.update_bodies(&mut now.particles, &now.domain),
        None => Ok(()),
    }
}

/// Warms up the fluid, unless the preparation was complete, and returns the time for which it flowed \[s\].
/// Collective.
fn age_flow<Sp: Space, S: SavedNumber>(
    now: &mut Present<Sp, S>,
    origin: &Origin,
    parts: &mut Parts,
    outside: &mut Outside,
) -> Result<f64, Error> {
    if origin.runs() {
        return Ok(0.0);
    }
    let attributes = grains::attributes(&now.plan, &parts.notes);
    let reached = Reached {
        steps: origin.warm_up_steps(),
        velocities: parts.earlier.take(),
    };
    let steps = warm_up(now, &mut parts.guards, reached, attributes, outside)?;
    Ok(real(steps) * now.plan.clock.time_step)
}

/// Reads the time averages, if the case requests any. Collective.
fn read_averages<Sp: Space, S: SavedNumber>(
    now: &Present<Sp, S>,
    origin: &Origin,
) -> Result<Option<Averages>, Error> {
    let Some(flow) = now.lattice() else {
        return Ok(None);
    };
    let mut averages = Averages::new(&now.plan, flow);
    let goes_on = origin.runs() && origin.averages_continue();
    if let (Some(averages), Some(found), true) = (&mut averages, origin.found(), goes_on) {
        let reader = restore::reader(found)?;
        let read = checkpoint::read_averages(averages, flow.fluid(), &reader);
        agreement::agree(now.domain.communicator(), read)?;
    }
    Ok(averages)
}

/// Recorders and outputs of a run.
struct Records {
    recorder: ErosionRecorder,
    collapse: CollapseRecorder,
    crossings: Crossings,
    outputs: Outputs,
}

impl Records {
    /// Opens the files of the run, cut back to the checkpoint from which the run continues. Collective.
    fn open<Sp: Space, S: SavedNumber>(
        now: &Present<Sp, S>,
        origin: &Origin,
        outside: &Outside,
    ) -> Result<Self, Error> {
        let (plan, domain) = (&now.plan, &now.domain);
        let folder = outside.start.folder.path();
        let resumed_at = origin.runs().then_some(now.step);
        if let (Some(found), true) = (origin.found(), origin.runs()) {
            let ended = now.step >= plan.clock.steps;
            resume::cut_tables_back(found, folder, ended, domain.communicator())?;
        }
        let provenance = provenance(plan, domain, outside.start.threads);
        let outputs = Outputs::create(plan, folder, provenance, domain, resumed_at)?;
        Ok(Self {
            recorder: ErosionRecorder::create(plan, folder, domain, resumed_at)?,
            collapse: CollapseRecorder::create(plan, folder, domain, resumed_at)?,
            crossings: Crossings::create(plan, folder, domain, resumed_at)?,
            outputs,
        })
    }

    /// Restores the saved states of the recorders, or sets the age \[s\] of the flow at the start.
    fn restore(
        &mut self,
        saved: Option<Recorders>,
        origins: Option<&[Option<usize>]>,
        flow_age: f64,
    ) -> Result<(), Error> {
        let Some(saved) = saved else {
            self.recorder.set_flow_age(flow_age);
            return Ok(());
        };
        self.recorder.restore(saved.recorder);
        self.crossings.restore(&saved.crossings, origins);
        self.collapse.restore(saved.collapse)
    }
}

/// Returns names and values of the provenance that every output states.
fn provenance(plan: &Plan, domain: &Domain, threads: usize) -> Vec<(String, String)> {
    let mut all = vec![
        ("case".to_owned(), plan.case_text.clone()),
        ("case_hash".to_owned(), plan.case_hash.clone()),
        ("ranks".to_owned(), domain.communicator().size().to_string()),
        ("threads".to_owned(), threads.to_string()),
    ];
    if let Value::Object(versions) = versions(domain.communicator()) {
        all.extend(
            versions
                .into_iter()
                .map(|(k, v)| (k, v.as_str().unwrap_or_default().to_owned())),
        );
    }
    all
}
