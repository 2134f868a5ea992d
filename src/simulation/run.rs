//! A run from the first step to the last line: start, loop, requests, checkpoints, summary.

use super::agreement;
use super::blocks;
use super::collapse::CollapseRecorder;
use super::coupled;
use super::energy;
use super::erosion::ErosionRecorder;
use super::escape;
use super::folder::{Entry, RunFolder};
use super::guards::Guards;
use super::phases::{Phase, Phases};
use super::preparation::{self, Settling};
use super::progress::{Moment, Progress, clock};
use super::removal::Removal;
use super::resume::{self, Resumed, Stage};
use super::setup;
use super::versions::versions;
use super::watch::Watch;
use super::{Present, Simulation};
use crate::case::fluid::Precision;
use crate::case::time::WarmUp;
use crate::checkpoint::{self, Saved, State};
use crate::coupling::Flow;
use crate::coupling::lattice::LatticeFlow;
use crate::coupling::water::Water;
use crate::dem::Dem;
use crate::dem::particles::Particles;
use crate::dem::space::{Plane, Space, Volume};
use crate::error::{Error, Problem, Severity};
use crate::lbm::fluid::Fluid;
use crate::lbm::lanes::Level;
use crate::output::Outputs;
use crate::output::averages::Averages;
use crate::output::together::Together;
use crate::plan::{Plan, steps_number};
use crate::scene::flow::Initial;
use crate::scene::grid::Grid;
use crate::scene::waiting::Request;
use decomposition::{Communicator, Domain, Slabs, World};
use io::checkpoint::Reader;
use io::marks::Marker;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What a run or restart is asked for beside its case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunOptions {
    /// Folder for everything the run writes; a restart goes on in its own.
    pub output: Option<PathBuf>,
    /// The file of the case, which nothing may replace.
    pub case: Option<PathBuf>,
    /// Whether a run that the folder holds is replaced.
    pub overwrite: bool,
    /// Whether the end of the run is kept as a checkpoint.
    pub final_checkpoint: bool,
    /// When the program was started: the walltime counts from here.
    pub begun: Instant,
    /// Threads of each rank; none for the cores of the machine over its ranks.
    pub threads: Option<usize>,
    /// Wall-clock time after which the run is over.
    pub max_walltime: Option<Duration>,
    /// Tables as JSON.
    pub json: bool,
    /// A restart goes on although the case is unstable.
    pub allow_unstable: bool,
}

/// Runs a plan from its start.
///
/// # Errors
/// Why the run ended before its end; [`Error::Stopped`] when it was asked to.
pub fn run(plan: Plan, options: RunOptions) -> Result<(), Error> {
    on_world(options.threads, |communicator, threads| {
        let path = options.output.as_deref().unwrap_or(Path::new("results"));
        let entry = Entry::Fresh {
            overwrite: options.overwrite,
            case: options.case.clone(),
        };
        let start = Start {
            folder: RunFolder::enter(path, &entry, communicator)?,
            parent: None,
            resumed: None,
            limit: options.max_walltime,
            begun: options.begun,
            threads,
            json: options.json,
            quiet: false,
            final_checkpoint: options.final_checkpoint,
        };
        start_on(communicator, plan, start)
    })
}

/// Goes on from the newest checkpoint in a folder, with changed fields.
///
/// # Errors
/// As [`run`], when there is no checkpoint, and when a change is none that the saved state can follow.
pub fn restart(folder: &Path, set: &[String], options: RunOptions) -> Result<(), Error> {
    let path = folder.join("case.json");
    let text = io::plain::text(&path, io::plain::LONGEST_CASE).map_err(|e| {
        Error::Io(format!(
            "{e}; a folder that can go on holds the case of its run"
        ))
    })?;
    on_world(options.threads, |communicator, threads| {
        let entered = RunFolder::enter(folder, &Entry::Resume, communicator)?;
        let found = resume::find(&entered, communicator)?;
        let (plan, resumed) = resume::plan(&text, set, folder, found, options.allow_unstable)?;
        let start = Start {
            folder: entered,
            parent: None,
            resumed: Some(resumed),
            limit: options.max_walltime,
            begun: options.begun,
            threads,
            json: options.json,
            quiet: false,
            final_checkpoint: options.final_checkpoint,
        };
        start_on(communicator, plan, start)
    })
}

/// Until when work of several runs may go on.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    /// Folder in which a file STOP ends it.
    pub(super) folder: PathBuf,
    /// When it began, and the wall time that it may take.
    pub(super) begun: Instant,
    pub(super) limit: Option<Duration>,
}

/// Runs a plan on ranks that are there already, without a word; goes on where an earlier attempt at it was stopped. Collective.
///
/// # Errors
/// As [`run`].
pub(super) fn trial(
    communicator: &Communicator,
    threads: usize,
    plan: Plan,
    folder: &Path,
    bounds: &Bounds,
) -> Result<(), Error> {
    let resumes = agreement::on_first(communicator, || Ok(resume::is_open(folder, &plan)))?;
    let resumes = communicator.all_reduce_max_u64(u64::from(resumes)) > 0;
    let entry = if resumes {
        Entry::Resume
    } else {
        Entry::Fresh {
            overwrite: true,
            case: None,
        }
    };
    let entered = RunFolder::enter(folder, &entry, communicator)?;
    let resumed = resumes
        .then(|| resume::find(&entered, communicator).map(Resumed::unchanged))
        .transpose()?;
    let start = Start {
        folder: entered,
        parent: Some(bounds.folder.clone()),
        resumed,
        limit: bounds.limit,
        begun: bounds.begun,
        threads,
        json: false,
        quiet: true,
        final_checkpoint: false,
    };
    start_on(communicator, plan, start)
}

/// Whether a folder holds this very run, done. Collective.
///
/// # Errors
/// None of its own.
pub(super) fn is_done(
    communicator: &Communicator,
    plan: &Plan,
    folder: &Path,
) -> Result<bool, Error> {
    let done = agreement::on_first(communicator, || {
        let text = io::plain::text(&folder.join("summary.json"), io::plain::LONGEST_CASE)
            .unwrap_or_default();
        let summary: Value = serde_json::from_str(&text).unwrap_or_default();
        Ok(summary["outcome"] == "done" && summary["case_hash"] == plan.case_hash.as_str())
    })?;
    Ok(communicator.all_reduce_max_u64(u64::from(done)) > 0)
}

/// Starts MPI and the threads of this rank, does the work, and leaves no rank hanging should it fail on some only.
///
/// # Errors
/// Those of the work.
pub(super) fn on_world<T>(
    threads: Option<usize>,
    work: impl FnOnce(&Communicator, usize) -> Result<T, Error>,
) -> Result<T, Error> {
    let world = World::start().map_err(|e| Error::Internal(e.to_string()))?;
    let communicator = world.communicator();
    let result =
        start_threads(threads, &communicator).and_then(|threads| work(&communicator, threads));
    if let Err(error) = &result
        && !matches!(error, Error::Stopped(_))
        && !communicator.all_arrive(PATIENCE)
    {
        // The others know nothing of it and wait for this rank: nobody is left hanging.
        log::error!("rank {}: {error}", communicator.rank());
        communicator.abort(error.exit_code());
    }
    result
}

/// The threads of this rank: as asked, or its share of the machine.
fn start_threads(asked: Option<usize>, communicator: &Communicator) -> Result<usize, Error> {
    let threads = asked.unwrap_or_else(|| {
        let local = std::env::var("OMPI_COMM_WORLD_LOCAL_SIZE")
            .ok()
            .and_then(|n| n.parse::<usize>().ok())
            .unwrap_or_else(|| communicator.size());
        (std::thread::available_parallelism().map_or(1, usize::from) / local.max(1)).max(1)
    });
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .use_current_thread()
        .build_global()
        .map_err(|e| Error::Internal(format!("{threads} threads: {e}")))?;
    Ok(threads)
}

/// Runs, and writes down how it ended where the run itself could not. Collective.
fn start_on(communicator: &Communicator, plan: Plan, start: Start) -> Result<(), Error> {
    let summary = start.folder.path().join("summary.json");
    let folder = start.folder.path().display().to_string();
    match choose(communicator, plan, start) {
        Err(Ended::BeforeItsFirstStep(error)) => {
            let error = match error {
                Error::Stopped(text) => {
                    Error::Stopped(format!("{text}; go on with `solver restart {folder}`"))
                }
                error => error,
            };
            if communicator.rank() == 0 {
                let outcome = if matches!(error, Error::Stopped(_)) {
                    "stopped"
                } else {
                    "failed"
                };
                let text = json!({ "outcome": outcome, "error": error.to_string(), "steps": 0 });
                // The error itself matters more than that it could not be written down.
                let _ = io::atomic::write_json(&summary, &text);
            }
            Err(error)
        }
        Err(Ended::Later(error)) => Err(error),
        Ok(()) => Ok(()),
    }
}

/// When a run ended with an error.
enum Ended {
    /// In its preparation: nothing has been written about it.
    BeforeItsFirstStep(Error),
    /// Later: the run has told.
    Later(Error),
}

/// Chooses dimension and storage once, and runs. Collective.
fn choose(communicator: &Communicator, plan: Plan, start: Start) -> Result<(), Ended> {
    let begun = |error: Error| Ended::BeforeItsFirstStep(error);
    let grid = &plan.scene.grid;
    let slabs = slabs(grid, communicator.size()).map_err(begun)?;
    let domain = Domain::new(communicator.clone(), slabs)
        .map_err(|e| begun(Error::Internal(e.to_string())))?;
    let storage = plan
        .scene
        .flow
        .as_ref()
        .map_or(Precision::F64, |flow| flow.storage);
    match (grid.dimension, storage) {
        (2, Precision::F64) => Runner::<Plane, f64>::go(plan, domain, start),
        (2, Precision::F32) => Runner::<Plane, f32>::go(plan, domain, start),
        (_, Precision::F64) => Runner::<Volume, f64>::go(plan, domain, start),
        (_, Precision::F32) => Runner::<Volume, f32>::go(plan, domain, start),
    }
}

/// How long a rank with an error waits for the others to have one too, before it ends the job by itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// The slabs of the case, or equal ones.
fn slabs(grid: &Grid, ranks: usize) -> Result<Slabs, Error> {
    let axis = setup::axis(grid.split_axis);
    let (planes, periodic) = (grid.cells[grid.split_axis], grid.periodic[grid.split_axis]);
    let Some(inner) = &grid.slab_bounds else {
        return Ok(Slabs::even(axis, planes, ranks, periodic));
    };
    if inner.len() + 1 != ranks {
        return Err(Error::Case(vec![Problem {
            path: "domain.slab_bounds".into(),
            value: format!("{inner:?}"),
            reason: format!(
                "this list makes {} slabs, but there are {ranks} ranks",
                inner.len() + 1
            ),
            remedy: format!(
                "start {} ranks, give {} numbers, or leave the list out",
                inner.len() + 1,
                ranks - 1
            )
            .into(),
            severity: Severity::Error,
        }]));
    }
    let mut bounds = Vec::with_capacity(ranks + 1);
    bounds.push(0);
    bounds.extend(inner);
    bounds.push(planes);
    Slabs::from_bounds(axis, bounds, periodic)
        .map_err(|e| Error::Internal(format!("domain.slab_bounds: {e}")))
}

/// A run before its first step on this process alone, without a word, for whoever steps it himself: tests and
/// measurements. Outputs go to `folder`.
///
/// # Errors
/// As [`run`].
pub fn ready<Sp: Space, S: Saved>(plan: Plan, folder: &Path) -> Result<Simulation<Sp, S>, Error> {
    let grid = &plan.scene.grid;
    let (axis, periodic) = (setup::axis(grid.split_axis), grid.periodic[grid.split_axis]);
    let domain = Domain::serial(axis, grid.cells[grid.split_axis], periodic);
    let entry = Entry::Fresh {
        overwrite: true,
        case: None,
    };
    let start = Start {
        folder: RunFolder::enter(folder, &entry, domain.communicator())?,
        parent: None,
        resumed: None,
        limit: None,
        begun: Instant::now(),
        threads: rayon::current_num_threads(),
        json: false,
        quiet: true,
        final_checkpoint: false,
    };
    Runner::begin(plan, domain, start).map(|runner| runner.simulation)
}

struct Start {
    folder: RunFolder,
    /// A folder in which a file STOP ends this run too.
    parent: Option<PathBuf>,
    resumed: Option<Resumed>,
    limit: Option<Duration>,
    begun: Instant,
    threads: usize,
    json: bool,
    quiet: bool,
    final_checkpoint: bool,
}

struct Runner<Sp: Space, S: Saved> {
    simulation: Simulation<Sp, S>,
    folder: RunFolder,
    final_checkpoint: bool,
    /// The step of the newest checkpoint, if this run knows of one.
    saved: Option<u64>,
    watch: Watch,
    progress: Progress,
    threads: usize,
    first_step: u64,
    notes: Value,
    initial_mass: f64,
    /// Marks the tables for checkpoints; on the first rank.
    marker: Marker,
}

impl<Sp: Space, S: Saved> Runner<Sp, S> {
    fn go(plan: Plan, domain: Domain, start: Start) -> Result<(), Ended> {
        let json = start.json;
        let mut runner = Self::begin(plan, domain, start).map_err(Ended::BeforeItsFirstStep)?;
        let outcome = runner.run().map_err(|error| {
            let now = &runner.simulation.now;
            escape::explained(error, &now.plan, now.step, now.time())
        });
        let text = match &outcome {
            Ok(()) => "done",
            Err(Error::Stopped(_)) => "stopped",
            Err(_) => "failed",
        };
        // A failed rank may be alone: no reductions then.
        if matches!(outcome, Ok(()) | Err(Error::Stopped(_))) {
            runner.summarise(text, json).map_err(Ended::Later)?;
        } else if runner.simulation.now.domain.rank() == 0 {
            let message = outcome.as_ref().err().map(ToString::to_string);
            let summary =
                json!({ "outcome": text, "error": message, "steps": runner.simulation.now.step });
            // The error itself matters more than that it could not be written down.
            let _ = io::atomic::write_json(&runner.folder.path().join("summary.json"), &summary);
        }
        outcome.map_err(Ended::Later)
    }

    fn begin(mut plan: Plan, domain: Domain, start: Start) -> Result<Self, Error> {
        let communicator = domain.communicator().clone();
        let first = communicator.rank() == 0;
        let folder = start.folder;
        let mut watch = {
            let every = plan.scene.checkpoint.every_wall_seconds;
            let every = (every > 0.0).then(|| Duration::from_secs_f64(every));
            let mut folders = vec![folder.path()];
            folders.extend(start.parent.as_deref());
            Watch::new(&folders, start.begun, start.limit, every)?
        };
        let speaks = first && !start.quiet;
        let mut progress = Progress::new(speaks, 0);
        progress.note(&format!(
            "{} rank(s) x {} thread(s), slabs along {:?}, {} lanes",
            communicator.size(),
            start.threads,
            domain.axis(),
            Level::best().name()
        ));
        let resumed = start.resumed;
        if let Some(resumed) = &resumed {
            resume::fits(&plan, resumed)?;
        }
        if resumed.as_ref().is_none_or(|resumed| resumed.changed) {
            agreement::on_first(&communicator, || {
                io::atomic::write(&folder.path().join("case.json"), plan.case_text.as_bytes())
                    .map_err(|e| Error::Io(e.to_string()))
            })?;
        }
        let stage = resumed.as_ref().map(Resumed::stage).transpose()?;
        // Where a sample in the making was kept, nothing else is there yet.
        let found = resumed
            .as_ref()
            .map(|resumed| &resumed.found)
            .filter(|_| !matches!(stage, Some(Stage::Sample)));
        let runs = matches!(stage, Some(Stage::Run));
        let flowed = matches!(stage, Some(Stage::Run | Stage::WarmUp(_)));
        let units = plan.units;
        let mut flow = match (&plan.scene.flow, units) {
            (Some(scene), Some(units)) => {
                let made = setup::fluid(&plan, scene, &units)
                    .and_then(|setup| Fluid::<S>::new(setup, &domain).map_err(Error::Internal));
                let mut fluid = made?;
                if !flowed {
                    match setup::initial(&plan, scene, &units) {
                        Some(field) => fluid.initialise(field.as_ref()),
                        None => {
                            if let Initial::File(path) = &scene.initial {
                                from_file(&mut fluid, path, &plan)?;
                            }
                        }
                    }
                }
                Some(coupled::flow::<Sp, S>(&plan, fluid, units))
            }
            _ => setup::seepage::<Sp>(&plan, &communicator)?
                .map(|seepage| Water::Seepage(Box::new(seepage))),
        };
        let solid = plan.scene.has_solids() || generates(&plan);
        let mut particles = Particles::<Sp>::new();
        let mut notes = json!({});
        let mut removal = Removal::new(&plan);
        let (mut step, mut recorder_state, mut guards_state) = (0, Value::Null, Value::Null);
        let mut collapse_state = Value::Null;
        let mut dem = None;
        let mut earlier: Option<Vec<f64>> = None;
        let mut kept = resume::attributes(&plan);
        if let (Some(found), Some(resumed)) = (found, &resumed) {
            let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
            if flowed && let Some(flow) = flow.as_mut().and_then(Water::lattice_mut) {
                agreement::agree(
                    &communicator,
                    checkpoint::read_fluid(flow.fluid_mut(), &reader),
                )?;
                if let Some(Stage::WarmUp(_)) = stage {
                    let read = checkpoint::read_earlier(flow.fluid(), &reader);
                    earlier = Some(agreement::agree(&communicator, read)?);
                }
                flow.restart();
            }
            if runs && let Some(flow) = flow.as_mut().and_then(Water::seepage_mut) {
                let read = checkpoint::read_seepage(&reader);
                flow.restore(&agreement::agree(&communicator, read)?)?;
            }
            let attributes = reader.attributes().clone();
            step = found.manifest.step;
            notes = attributes["notes"].clone();
            guards_state = attributes["guards"].clone();
            if runs {
                removal.restore(&attributes["removal"], resumed.regions.as_deref())?;
                recorder_state = attributes["recorder"].clone();
                collapse_state = attributes["collapse"].clone();
            }
            if solid {
                // The first rank alone reads the grains, so that it alone may find them wrong.
                let read = checkpoint::read_tables(&reader, domain.rank());
                let read = read.and_then(|(grains, contacts)| {
                    resume::bounds(&plan).hold(&grains, &contacts)?;
                    Ok((Particles::from_table(&grains)?, contacts))
                });
                let (read, mut contacts) = agreement::agree(&communicator, read)?;
                particles = read;
                if let Some(walls) = &resumed.walls {
                    contacts.take_walls(walls)?;
                }
                setup::blocks::shapes(&plan, &mut particles)?;
                let radius = attributes["typical_radius"].as_f64().unwrap_or(1.0);
                let mut engine = setup::dem::<Sp>(&plan, radius)?;
                if !plan.scene.follows_grains() {
                    particles.forget_start();
                } else if flowed && !particles.has_start() {
                    return Err(Error::Io(format!(
                        "{} does not say where the grains started, since its run asked for no displacements; take `output.grains.displacement` and `analysis.ground_collapse` out, or start anew",
                        found.path.display()
                    )));
                }
                engine.restore(&contacts)?;
                if let Some(walls) = &resumed.walls {
                    resume::drive_walls(&plan, &mut engine);
                    resume::clear_of_new_walls(&plan, walls, &particles, &domain)?;
                }
                if flowed {
                    engine.open_walls(&setup::temporary_walls(&plan));
                }
                engine.prepare(&mut particles, &domain)?;
                notes["typical_radius"] = json!(radius);
                dem = Some(engine);
            }
            plan.scene.forget_sample();
            progress.note(&match &stage {
                Some(Stage::Run) | None => {
                    format!("going on from step {step}: {}", found.path.display())
                }
                Some(_) => format!("going on in the preparation: {}", found.path.display()),
            });
        } else if solid {
            let sample = resumed.as_ref().map(|resumed| &resumed.found);
            if let Some(found) = sample {
                progress.note(&format!(
                    "going on with the sample: {}",
                    found.path.display()
                ));
            }
            let tell = |line: &str| progress.note(line);
            let prepared = preparation::grains::<Sp>(
                &plan, &folder, &domain, &mut watch, &tell, &kept, sample,
            )?;
            progress.note(&prepared.line);
            setup::blocks::shapes(&plan, &mut particles)?;
            setup::bodies(&plan, &domain, &mut particles)?;
            setup::blocks::blocks(&plan, &domain, &mut particles)?;
            setup::grains(
                &plan,
                &domain,
                &mut particles,
                &prepared.grains,
                plan.scene.first_grain(),
            );
            let radius = typical_radius(&plan, &prepared.grains, &domain);
            drop(prepared.grains);
            plan.scene.forget_sample();
            let mut engine = setup::dem::<Sp>(&plan, radius)?;
            engine.prepare(&mut particles, &domain)?;
            notes = json!({ "preparation": prepared.report, "typical_radius": radius });
            dem = Some(engine);
        }
        kept["typical_radius"] = notes["typical_radius"].clone();
        if !flowed && let Some(engine) = &mut dem {
            kept["notes"] = notes.clone();
            let settling = match &stage {
                Some(Stage::Settling(state)) => Some(Settling::restore(state)?),
                _ => Settling::begin(&plan, engine, &mut particles, &domain)?,
            };
            if let Some(settling) = settling {
                let keep = |settling: &Settling,
                            particles: &Particles<Sp>,
                            dem: &Dem<Sp>,
                            watch: &mut Watch,
                            request: Request| {
                    kept["preparation"] = json!({ "settling": settling.state() });
                    let state = State::<Sp, S> {
                        fluid: None,
                        averages: None,
                        seepage: Vec::new(),
                        particles,
                        dem: Some(dem),
                        earlier: None,
                    };
                    keep_preparation(
                        &state,
                        &folder,
                        &kept,
                        watch,
                        request,
                        &progress,
                        &communicator,
                    )
                };
                let (line, report) =
                    settling.run(engine, &mut particles, &domain, &mut watch, keep)?;
                progress.note(&line);
                notes["settling"] = report;
            }
            let gates = setup::temporary_walls(&plan);
            if !gates.is_empty() {
                engine.open_walls(&gates);
                particles.forget_loads();
                engine.prepare(&mut particles, &domain)?;
            }
            if plan.scene.follows_grains() {
                particles.mark_start();
            }
        }
        if dem.is_some() {
            particles.refresh_ghosts(&domain)?;
        }
        if let Some(flow) = &mut flow {
            flow.follow(&mut particles, &domain)?;
        }
        let mut flow_age = 0.0;
        let mut guards = Guards::new(&plan);
        guards.restore(&guards_state);
        if !runs && let Some(flow) = flow.as_mut().and_then(Water::lattice_mut) {
            let begun = match stage {
                Some(Stage::WarmUp(steps)) => steps,
                _ => 0,
            };
            kept["notes"] = notes.clone();
            let keep = |steps: u64,
                        earlier: &[f64],
                        flow: &dyn LatticeFlow<Sp, S>,
                        particles: &Particles<Sp>,
                        (watch, guards): (&mut Watch, &Guards),
                        request: Request| {
                kept["preparation"] = json!({ "warm_up": steps });
                kept["guards"] = guards.state();
                let state = State::<Sp, S> {
                    fluid: Some(flow.fluid()),
                    averages: None,
                    seepage: Vec::new(),
                    particles,
                    dem: dem.as_ref(),
                    earlier: Some(earlier),
                };
                keep_preparation(
                    &state,
                    &folder,
                    &kept,
                    watch,
                    request,
                    &progress,
                    &communicator,
                )
            };
            let (steps, line) = warm_up(
                &plan,
                flow,
                &mut particles,
                &domain,
                (&mut watch, &mut guards),
                (begun, earlier),
                keep,
            )?;
            flow_age = steps_number(steps) * plan.clock.time_step;
            progress.note(&line);
        }
        let resumed = runs;
        let resumed_at = resumed.then_some(step);
        if let (Some(found), true) = (found, runs) {
            resume::cut_tables_back(found, folder.path(), &communicator)?;
        }
        let outputs = Outputs::create(
            &plan,
            folder.path(),
            provenance(&plan, &domain, start.threads),
            &domain,
            resumed_at,
        )?;
        let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, resumed_at)?;
        if resumed {
            recorder.restore(&recorder_state)?;
        } else {
            recorder.set_flow_age(flow_age);
        }
        let mut collapse = CollapseRecorder::create(&plan, folder.path(), &domain, resumed_at)?;
        if resumed {
            collapse.restore(&collapse_state)?;
        }
        let lattice = flow.as_ref().and_then(Water::lattice);
        let mut averages = lattice.and_then(|flow| Averages::new(&plan, flow));
        if let (Some(averages), Some(flow), Some(found), true) =
            (&mut averages, lattice, found, runs)
        {
            let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
            let read = checkpoint::read_averages(averages, flow.fluid(), &reader);
            agreement::agree(&communicator, read)?;
        }
        progress = Progress::new(speaks, step);
        let mut runner = Self {
            simulation: Simulation {
                now: Present {
                    plan,
                    domain,
                    flow,
                    dem,
                    particles,
                    averages,
                    step,
                },
                removal,
                recorder,
                collapse,
                outputs,
                guards,
                phases: Phases::start(),
            },
            folder,
            final_checkpoint: start.final_checkpoint,
            saved: runs.then_some(step),
            watch,
            progress,
            threads: start.threads,
            first_step: step,
            notes,
            initial_mass: 0.0,
            marker: Marker::default(),
        };
        runner.initial_mass = runner.mass();
        if !resumed {
            let Simulation {
                now,
                recorder,
                collapse,
                outputs,
                ..
            } = &mut runner.simulation;
            recorder.record_due(&now.view(), &[], Vec::new(), 0.0)?;
            collapse.record_due(&now.view(), &[])?;
            outputs.write_due(&now.view())?;
        }
        let now = &runner.simulation.now;
        log::debug!(
            "rank {}: ready at step {} of {} after {:.3} s, {} grains and bodies here, {} bytes of memory at most so far",
            now.domain.rank(),
            now.step,
            now.plan.clock.steps,
            runner.watch.elapsed().as_secs_f64(),
            now.particles.owned(),
            peak_rss()
        );
        runner.simulation.phases = Phases::start();
        Ok(runner)
    }

    /// Mass of the lattice (lattice units of deviation), for drift. Collective.
    fn mass(&self) -> f64 {
        let Some(flow) = self.simulation.now.lattice() else {
            return 0.0;
        };
        let mut sum = decomposition::ExactSum::new();
        let populations = flow.fluid().populations();
        let length = populations.cells()[populations.order()[2]];
        let mut row = <[Vec<f64>; 4]>::default();
        for (_, cell) in populations.rows() {
            populations.row_moments(cell, length, &mut row);
            for mass in &row[0] {
                sum.add(*mass);
            }
        }
        sum.all_reduce(self.simulation.now.domain.communicator());
        sum.value()
    }

    fn run(&mut self) -> Result<(), Error> {
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
        if self.first_step > 0 && self.goes_on() {
            self.simulation.drop_end()?;
        }
        while self.goes_on() {
            self.simulation.step()?;
            for line in self.simulation.collapse.take_news() {
                self.progress.note(&line);
            }
            for line in self.simulation.guards.take_news() {
                self.progress.note(&line);
            }
            let step = self.simulation.now.step;
            if save_every.is_some_and(|every| every.falls_on(step)) && step < steps {
                self.save(Occasion::Asked)?;
            }
            if self.eroded() {
                break;
            }
            if step >= ask_at {
                self.tell();
                let request = self.watch.ask(self.simulation.now.domain.communicator());
                ask_at = step + self.watch.steps();
                self.folder.beat();
                self.simulation.phases.done(Phase::Guards);
                match request {
                    Request::None => {}
                    Request::Checkpoint => self.save(Occasion::Asked)?,
                    // Nothing is left to stop, but the file that asks for it would stop the next run.
                    Request::Stop if step >= steps => {
                        if self.simulation.now.domain.rank() == 0 {
                            self.watch.forget_file();
                        }
                    }
                    Request::Stop => {
                        self.save(Occasion::Stop)?;
                        self.simulation.look()?;
                        if self.simulation.now.domain.rank() == 0 {
                            self.watch.forget_file();
                        }
                        let text = format!(
                            "step {step} of {steps}; go on with `solver restart {}`",
                            self.folder.path().display()
                        );
                        return Err(Error::Stopped(text));
                    }
                }
            }
        }
        self.simulation.look()?;
        // The state comes first: whatever fails afterwards, a restart ends the run from here.
        if self.first_step == self.simulation.now.step {
            self.progress.note(&format!(
                "the run was at its end already; extend it with `solver restart {} --set time.end=..`",
                self.folder.path().display()
            ));
        }
        if self.final_checkpoint && self.saved != Some(self.simulation.now.step) {
            self.save(Occasion::End)?;
        }
        self.folder.forget_preparation();
        // No checkpoint may be written after this: rows at the end are no part of what a run that goes on remembers.
        self.simulation.record_end()?;
        for line in self.simulation.collapse.take_news() {
            self.progress.note(&line);
        }
        self.simulation
            .collapse
            .draw(self.folder.path(), &self.simulation.now.domain)?;
        self.simulation.phases.done(Phase::Output);
        Ok(())
    }

    /// Whether there is a step left to do; the same on every rank.
    fn goes_on(&self) -> bool {
        self.simulation.now.step < self.simulation.now.plan.clock.steps && !self.eroded()
    }

    /// Whether so much has left that the case calls the run done; the same on every rank.
    fn eroded(&self) -> bool {
        let law = self.simulation.now.plan.scene.erosion_law.as_ref();
        law.and_then(|law| law.end_at_eroded_fraction)
            .is_some_and(|end| self.simulation.recorder.eroded_fraction() >= end)
    }

    fn tell(&mut self) {
        if !self.progress.due() {
            return;
        }
        let mut more = String::new();
        if self.simulation.now.lattice().is_some() {
            let Simulation { now, guards, .. } = &mut self.simulation;
            more = guards.line(&now.plan);
        }
        let simulation = &self.simulation;
        if let Some(seepage) = simulation.now.seepage() {
            let (report, balance) = (seepage.report(), seepage.balance());
            more = format!(
                "inflow {:.3e} outflow {:.3e} m3/s, {} iterations to {:.0e}, closure {:.0e}, {} implicit",
                report.inflow,
                report.outflow,
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
        let moment = Moment {
            step: simulation.now.step,
            steps: simulation.now.plan.clock.steps,
            time: simulation.now.time(),
            cells,
            // Of this rank only: good enough for a line, and no message.
            grains: simulation.now.particles.owned() as u64,
            solid_steps: u64::from(simulation.now.plan.clock.solid_steps_per_step),
            more,
        };
        self.progress.say(&moment);
    }

    fn save(&mut self, occasion: Occasion) -> Result<(), Error> {
        let begun = Instant::now();
        let simulation = &mut self.simulation;
        simulation.outputs.sync(&simulation.now.domain)?;
        let recorder = simulation.recorder.state(&simulation.now.domain)?;
        let collapse = simulation.collapse.state(&simulation.now.domain)?;
        let mut attributes = resume::attributes(&simulation.now.plan);
        attributes["removal"] = simulation.removal.state()?;
        attributes["recorder"] = recorder;
        attributes["collapse"] = collapse;
        attributes["guards"] = simulation.guards.state();
        attributes["typical_radius"] = self.notes["typical_radius"].clone();
        attributes["notes"] = self.notes.clone();
        let names = resume::tables(&simulation.now.plan);
        let tables = Together(simulation.now.domain.communicator()).on_root(|| {
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
                self.saved = Some(step);
                self.folder.forget_preparation();
            }
            Err(io::Error::Space { needed, free, path }) => {
                let lack = format!("it needs {needed} bytes, {path} has {free}");
                match occasion {
                    Occasion::Asked => self.progress.note(&format!(
                        "no checkpoint at step {step}: {lack}; the run goes on"
                    )),
                    Occasion::End => self.progress.note(&format!(
                        "no checkpoint of the end: {lack}; the run cannot be extended from here"
                    )),
                    Occasion::Stop => {
                        let newest = self.saved.map_or_else(
                            || "there is none to go on from".to_owned(),
                            |saved| format!("the newest is that of step {saved}"),
                        );
                        return Err(Error::Io(format!(
                            "asked to stop at step {step}, but there is no room for a checkpoint: {lack}; {newest}; free {} bytes before `solver restart {}`",
                            needed.saturating_sub(free),
                            self.folder.path().display()
                        )));
                    }
                }
            }
            Err(error) => return Err(Error::Io(error.to_string())),
        }
        self.watch.wrote(begun.elapsed());
        simulation_phase(&mut self.simulation.phases);
        Ok(())
    }

    fn summarise(&mut self, outcome: &str, as_json: bool) -> Result<(), Error> {
        let simulation = &self.simulation;
        let communicator = simulation.now.domain.communicator();
        let account = simulation.phases.reduce(communicator);
        let wall = self.watch.elapsed().as_secs_f64();
        let looped = account.looped();
        let steps = steps_number(simulation.now.step - self.first_step);
        let cells = if simulation.now.lattice().is_some() {
            simulation.now.plan.scene.grid.cell_count()
        } else {
            0
        };
        let mlups = crate::scene::grid::count(cells) * steps / looped.max(1e-9) / 1e6;
        let grains = communicator.all_reduce_sum_u64(simulation.now.particles.owned() as u64);
        let solid_steps = f64::from(simulation.now.plan.clock.solid_steps_per_step);
        let rate = if simulation.now.dem.is_some() {
            steps_number(grains) * steps * solid_steps / looped.max(1e-9)
        } else {
            0.0
        };
        let rss = communicator.all_reduce_max_u64(peak_rss());
        let rss_total = communicator.all_reduce_sum_u64(peak_rss());
        let hash = simulation.now.state().hash(communicator);
        let drift = self.mass() - self.initial_mass;
        let warnings = simulation.guards.warnings(&simulation.now.plan);
        let mut summary = json!({
            "outcome": outcome,
            "steps": simulation.now.step,
            "steps_of_this_run": simulation.now.step - self.first_step,
            "time": simulation.now.time(),
            "wall_seconds": wall,
            "loop_seconds": looped,
            "phases": account.phases,
            "waiting_seconds": account.waiting,
            "imbalance": account.imbalance,
            "mlups": mlups,
            "particle_steps_per_second": rate,
            "grains": grains,
            "peak_rss_bytes": rss,
            "peak_rss_bytes_all_ranks": rss_total,
            "mass_error": simulation.guards.mass_error(),
            "mass_change": drift / crate::scene::grid::count(cells.max(1)),
            "momentum_error": simulation.guards.momentum_error(),
            "mach": simulation.guards.mach(),
            "compression": simulation.guards.compression(),
            "inflow": null,
            "outflow": null,
            "flow_imbalance": simulation.guards.imbalance(),
            "warnings": warnings,
            "ranks": communicator.size(),
            "threads": self.threads,
            "case_hash": simulation.now.plan.case_hash,
            "state_hash": hash,
            "notes": self.notes,
            "versions": versions(communicator),
        });
        if let Some([inflow, outflow]) = simulation.guards.through(&simulation.now.plan) {
            summary["inflow"] = inflow.into();
            summary["outflow"] = outflow.into();
        }
        if let Some(seepage) = simulation.now.seepage() {
            let (report, balance) = (seepage.report(), seepage.balance());
            let most = report.inflow.max(report.outflow);
            summary["inflow"] = report.inflow.into();
            summary["outflow"] = report.outflow.into();
            summary["flow_imbalance"] =
                json!((most > 0.0).then(|| (report.inflow - report.outflow) / most));
            summary["seepage"] = json!({
                "iterations": report.iterations,
                "residual": report.residual,
                "inflow": report.inflow,
                "outflow": report.outflow,
                "force_on_grains": balance.on_grains,
                "force_of_pressure": balance.pressure,
                "weight_of_water": balance.weight,
                "closure": balance.closure,
                "patch_inflows": seepage.pressure().patch_inflows(),
                "mean_porosity": seepage.mean_porosity(),
            });
        }
        let particles = &simulation.now.particles;
        if simulation.now.dem.is_some() {
            summary["kinetic_energy"] = energy::of_motion(particles, communicator).into();
        }
        if let Some(report) = blocks::summary(&simulation.now.plan, particles, communicator) {
            summary["blocks"] = report;
        }
        if let Some(erosion) = simulation.recorder.summary(&simulation.now.plan)? {
            summary["erosion"] = erosion;
        }
        if let Some(collapse) = simulation.collapse.summary()? {
            summary["collapse"] = collapse;
        }
        if log::log_enabled!(log::Level::Debug)
            && let Some(dem) = &simulation.now.dem
        {
            let lists = dem.statistics(&simulation.now.particles);
            log::debug!(
                "rank {}: lists of neighbours made {} times, {} pairs tested; {} contacts now, {} of them bonded",
                communicator.rank(),
                lists.rebuilds,
                lists.tested,
                lists.contacts,
                lists.bonds
            );
        }
        let first = communicator.rank() == 0;
        let written = if first {
            io::atomic::write_json(&self.folder.path().join("summary.json"), &summary)
                .map_err(|e| e.to_string())
        } else {
            Ok(())
        };
        communicator
            .agree(written)
            .map_err(|e| Error::Io(e.message))?;
        if as_json {
            self.progress
                .note(&serde_json::to_string_pretty(&summary).unwrap_or_default());
        } else {
            self.progress.note(&account.table());
            self.progress.note(&format!(
                "{outcome}: {} steps in {} ({:.1} MLUPS, {:.2} M particle-steps/s), peak {:.0} MB a rank",
                simulation.now.step - self.first_step,
                clock(wall),
                mlups,
                rate / 1e6,
                steps_number(rss) / 1e6
            ));
            let measured = |number: Option<f64>| {
                number.map_or_else(|| "-".to_owned(), |number| format!("{number:.1e}"))
            };
            let guards = &simulation.guards;
            self.progress.note(&format!(
                "mass error {} a step, momentum error {} of the largest force; state {hash}",
                measured(guards.mass_error()),
                measured(guards.momentum_error())
            ));
            let named = |name: &str| measured(summary[name].as_f64());
            self.progress.note(&format!(
                "largest Mach {}, largest compression {}, inflow {}, outflow {} {}",
                named("mach"),
                named("compression"),
                named("inflow"),
                named("outflow"),
                if simulation.now.plan.scene.grid.dimension == 2 {
                    "m2/s"
                } else {
                    "m3/s"
                }
            ));
            for warning in &warnings {
                self.progress.note(&format!("warning: {warning}"));
            }
            self.progress.note(&format!(
                "files in {}: open *.xmf in ParaView; summary.json for scripts",
                self.folder.path().display()
            ));
        }
        Ok(())
    }
}

fn simulation_phase(phases: &mut Phases) {
    phases.done(Phase::Checkpoint);
}

/// Why a checkpoint is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Occasion {
    /// It is due, or a signal asked for it.
    Asked,
    /// The run stops.
    Stop,
    /// The run is done.
    End,
}

/// Saves a preparation as a checkpoint at step 0, and ends it where that was asked for. Collective.
fn keep_preparation<Sp: Space, S: Saved>(
    state: &State<'_, Sp, S>,
    folder: &RunFolder,
    attributes: &Value,
    watch: &mut Watch,
    request: Request,
    progress: &Progress,
    communicator: &Communicator,
) -> Result<(), Error> {
    let begun = Instant::now();
    let written = state.write(
        &folder.checkpoints(),
        0,
        0.0,
        attributes.clone(),
        2,
        communicator,
    );
    match written {
        Ok(()) => folder.forget_preparation(),
        Err(io::Error::Space { needed, free, path }) if request == Request::Checkpoint => {
            progress.note(&format!(
                "the preparation is not saved: that needs {needed} bytes, {path} has {free}; it goes on"
            ));
        }
        Err(error) => return Err(Error::Io(error.to_string())),
    }
    watch.wrote(begun.elapsed());
    if request == Request::Stop {
        if communicator.rank() == 0 {
            watch.forget_file();
        }
        return Err(Error::Stopped("in the preparation".into()));
    }
    Ok(())
}

fn generates(plan: &Plan) -> bool {
    plan.scene
        .regions
        .iter()
        .any(|r| matches!(r.action, crate::scene::observe::Action::Generate { .. }))
}

/// Mean radius of the grains, or of the bodies and blocks: sets the skin of the lists, never a result. Collective.
fn typical_radius(plan: &Plan, grains: &[crate::scene::solids::Grain], domain: &Domain) -> f64 {
    let radii: Vec<f64> = if grains.is_empty() {
        let blocks = plan.scene.blocks.iter().flat_map(|blocks| &blocks.list);
        let of_blocks = blocks.map(|block| block.solid.shape.radius());
        let of_bodies = plan.scene.bodies.iter().map(|body| body.radius);
        of_bodies.chain(of_blocks).collect()
    } else {
        grains.iter().map(|g| g.radius).collect()
    };
    let mean = radii.iter().sum::<f64>() / crate::scene::grid::count(radii.len().max(1));
    let agreed = domain
        .communicator()
        .all_reduce_max_f64(if domain.rank() == 0 { mean } else { 0.0 });
    if agreed > 0.0 {
        agreed
    } else {
        plan.scene.grid.spacing
    }
}

/// Steps between two looks at whether the fluid is steady.
const LOOK_EVERY: u64 = 100;

/// The fluid flows round grains that stand still until it is steady: steps taken, and a line to print. It goes on from `reached`,
/// the steps taken and the velocities at the last look (three numbers a cell, [z][y][x]), and hands the same to `keep` where the
/// outside asks for it. Collective.
fn warm_up<Sp: Space, S: Saved>(
    plan: &Plan,
    flow: &mut dyn LatticeFlow<Sp, S>,
    particles: &mut Particles<Sp>,
    domain: &Domain,
    (watch, guards): (&mut Watch, &mut Guards),
    reached: (u64, Option<Vec<f64>>),
    mut keep: impl FnMut(
        u64,
        &[f64],
        &dyn LatticeFlow<Sp, S>,
        &Particles<Sp>,
        (&mut Watch, &Guards),
        Request,
    ) -> Result<(), Error>,
) -> Result<(u64, String), Error> {
    let Some(WarmUp::FluidOnly {
        relative_change, ..
    }) = plan.scene.time.warm_up
    else {
        return Ok((0, String::new()));
    };
    let communicator = domain.communicator();
    let cells = checkpoint::cells_in_order(flow.fluid());
    let (mut step, before) = reached;
    let mut before = before.unwrap_or_else(|| vec![0.0; 3 * cells.len()]);
    let mut change = f64::INFINITY;
    let mut ask_at = step + watch.steps();
    while step < plan.clock.warm_up_steps {
        flow.advance(particles, domain)?;
        step += 1;
        guards.check_warm_up(step, flow, particles, plan, domain)?;
        if step % LOOK_EVERY == 0 {
            let (mut moved, mut size) = (0.0_f64, 0.0_f64);
            for (&cell, old) in cells.iter().zip(before.chunks_exact_mut(3)) {
                let (_, u) = flow.fluid().state(cell);
                for a in 0..3 {
                    moved = moved.max((u[a] - old[a]).abs());
                    size = size.max(u[a].abs());
                }
                old.copy_from_slice(&u);
            }
            change = communicator.all_reduce_max_f64(moved)
                / communicator.all_reduce_max_f64(size).max(1e-300);
            if change < relative_change {
                break;
            }
        }
        if step >= ask_at {
            let request = watch.ask(communicator);
            ask_at = step + watch.steps();
            if request != Request::None {
                keep(step, &before, flow, particles, (watch, guards), request)?;
            }
        }
    }
    Ok((
        step,
        format!(
            "fluid warmed up for {step} steps: velocity changes by {change:.1e} of itself in {LOOK_EVERY} steps"
        ),
    ))
}

/// Velocity and pressure from a field output of the same size.
fn from_file<S: Saved>(fluid: &mut Fluid<S>, path: &Path, plan: &Plan) -> Result<(), Error> {
    let wrong = |what: String| Error::Io(format!("initial state {}: {what}", path.display()));
    let read = |name: &str| io::fields::read_column(path, name).map_err(|e| wrong(e.to_string()));
    let (velocity, pressure) = (read("velocity")?, read("pressure")?);
    let cells = plan.scene.grid.cells;
    let count = cells[0] * cells[1] * cells[2];
    if velocity.values.len() != 3 * count || pressure.values.len() != count {
        return Err(wrong(format!("it does not hold {cells:?} cells")));
    }
    let Some(units) = plan.units else {
        return Ok(());
    };
    let field = move |p: [f64; 3]| {
        let at: [usize; 3] = std::array::from_fn(|a| {
            crate::scene::grid::whole(p[a].floor().max(0.0)).min(cells[a] - 1)
        });
        let n = (at[2] * cells[1] + at[1]) * cells[0] + at[0];
        let u = std::array::from_fn(|a| units.velocity_to_lattice(velocity.values[3 * n + a]));
        (units.pressure_to_density_deviation(pressure.values[n]), u)
    };
    fluid.initialise(&field);
    Ok(())
}

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

/// Peak resident memory of this process [bytes].
fn peak_rss() -> u64 {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|l| l.starts_with("VmHWM:"))?;
            line.split_whitespace().nth(1)?.parse::<u64>().ok()
        })
        .map_or(0, |kib| kib * 1024)
}
