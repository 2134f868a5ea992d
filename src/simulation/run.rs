//! A run from the first step to the last line: start, loop, requests, checkpoints, summary.

use super::blocks;
use super::collapse::CollapseRecorder;
use super::coupled;
use super::energy;
use super::erosion::ErosionRecorder;
use super::guards::Guards;
use super::phases::{Phase, Phases, Spent};
use super::preparation;
use super::progress::{Moment, Progress, clock};
use super::removal::Removal;
use super::setup;
use super::watch::{Request, Watch};
use super::{Present, Simulation};
use crate::case::Document;
use crate::case::fluid::Precision;
use crate::case::time::WarmUp;
use crate::checkpoint::{self, Saved};
use crate::coupling::Flow;
use crate::coupling::lattice::LatticeFlow;
use crate::coupling::water::Water;
use crate::dem::particles::Particles;
use crate::dem::space::{Plane, Space, Volume};
use crate::error::{Error, Problem, Severity, Verdict};
use crate::lbm::fluid::Fluid;
use crate::lbm::lanes::Level;
use crate::output::Outputs;
use crate::output::averages::Averages;
use crate::output::together::Together;
use crate::plan::{Plan, steps_number};
use crate::scene::flow::Initial;
use crate::scene::grid::Grid;
use crate::scene::waiting::Waiting;
use decomposition::{Communicator, Domain, Slabs, World};
use io::checkpoint::{Found, Reader};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Steps between questions to the outside (signals, files, clocks).
const ASK_EVERY: u64 = 10;

/// What a run or restart is asked for beside its case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunOptions {
    /// Folder for everything the run writes; none for a restart in the same folder.
    pub output: Option<PathBuf>,
    /// Threads of each rank; none for the cores of the machine over its ranks.
    pub threads: Option<usize>,
    /// Wall-clock time after which the run is over.
    pub max_walltime: Option<Duration>,
    /// Tables as JSON.
    pub json: bool,
    /// A restart goes on with a case that is unstable as changed.
    pub allow_unstable: bool,
}

/// Runs a plan from its start.
///
/// # Errors
/// Why the run ended before its end; [`Error::Stopped`] when it was asked to.
pub fn run(plan: Plan, options: RunOptions) -> Result<(), Error> {
    with_world(plan, options, None)
}

/// Goes on from the newest checkpoint in a folder.
///
/// # Errors
/// As [`run`], and when there is no checkpoint of this case.
pub fn restart(folder: &Path, set: &[String], mut options: RunOptions) -> Result<(), Error> {
    let path = folder.join("case.json");
    let text = std::fs::read_to_string(&path)
        .map_err(|e| Error::Io(format!("{}: {e}", path.display())))?;
    let plan = Document::read(&text, set, folder)
        .and_then(Plan::prepare)
        .map_err(Error::Case)?;
    if !Verdict::of(&plan.warnings).runs(options.allow_unstable) {
        return Err(Error::Case(plan.warnings));
    }
    options.output = Some(folder.to_owned());
    with_world(plan, options, Some(!set.is_empty()))
}

/// Starts MPI and threads, then runs. `resume` says whether to go on from a checkpoint, and whether the case may differ from
/// the one it was written for.
fn with_world(plan: Plan, options: RunOptions, resume: Option<bool>) -> Result<(), Error> {
    on_world(options.threads, |communicator, threads| {
        let start = Start {
            folder: options.output.unwrap_or_else(|| PathBuf::from("results")),
            limit: options.max_walltime,
            threads,
            resume,
            json: options.json,
            quiet: false,
        };
        start_on(communicator, plan, start)
    })
}

/// Runs a plan on ranks that are there already, without a word. Collective.
///
/// # Errors
/// As [`run`].
pub(super) fn trial(
    communicator: &Communicator,
    threads: usize,
    plan: Plan,
    folder: PathBuf,
) -> Result<(), Error> {
    let start = Start {
        folder,
        limit: None,
        threads,
        resume: None,
        json: false,
        quiet: true,
    };
    start_on(communicator, plan, start)
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

/// Chooses dimension and storage once, and runs. Collective.
fn start_on(communicator: &Communicator, plan: Plan, start: Start) -> Result<(), Error> {
    let grid = &plan.scene.grid;
    let slabs = slabs(grid, communicator.size())?;
    let domain =
        Domain::new(communicator.clone(), slabs).map_err(|e| Error::Internal(e.to_string()))?;
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
            ),
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
    let start = Start {
        folder: folder.to_owned(),
        limit: None,
        threads: rayon::current_num_threads(),
        resume: None,
        json: false,
        quiet: true,
    };
    Runner::begin(plan, domain, start).map(|runner| runner.simulation)
}

struct Start {
    folder: PathBuf,
    limit: Option<Duration>,
    threads: usize,
    resume: Option<bool>,
    json: bool,
    quiet: bool,
}

struct Runner<Sp: Space, S: Saved> {
    simulation: Simulation<Sp, S>,
    folder: PathBuf,
    watch: Watch,
    progress: Progress,
    threads: usize,
    first_step: u64,
    notes: Value,
    initial_mass: f64,
}

impl<Sp: Space, S: Saved> Runner<Sp, S> {
    fn go(plan: Plan, domain: Domain, start: Start) -> Result<(), Error> {
        let json = start.json;
        let mut runner = Self::begin(plan, domain, start)?;
        let outcome = runner.run();
        let text = match &outcome {
            Ok(()) => "done",
            Err(Error::Stopped(_)) => "stopped",
            Err(_) => "failed",
        };
        // A failed rank may be alone: no reductions then.
        if matches!(outcome, Ok(()) | Err(Error::Stopped(_))) {
            runner.summarise(text, json)?;
        } else if runner.simulation.now.domain.rank() == 0 {
            let message = outcome.as_ref().err().map(ToString::to_string);
            let summary =
                json!({ "outcome": text, "error": message, "steps": runner.simulation.now.step });
            // The error itself matters more than that it could not be written down.
            let _ = io::atomic::write_json(&runner.folder.join("summary.json"), &summary);
        }
        outcome
    }

    fn begin(mut plan: Plan, domain: Domain, start: Start) -> Result<Self, Error> {
        let communicator = domain.communicator().clone();
        let first = communicator.rank() == 0;
        let folder = start.folder;
        let made = if first {
            std::fs::create_dir_all(checkpoint_folder(&folder))
        } else {
            Ok(())
        };
        communicator
            .agree(made.map_err(|e| format!("{}: {e}", folder.display())))
            .map_err(|e| Error::Io(e.message))?;
        let watch = {
            let every = plan.scene.checkpoint.every_wall_seconds;
            let every = (every > 0.0).then(|| Duration::from_secs_f64(every));
            Watch::new(&folder, start.limit, every)?
        };
        let found = match start.resume {
            None => None,
            Some(changed) => Some(find(&plan, &folder, &domain, changed)?),
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
        if first && found.is_none() {
            io::atomic::write(&folder.join("case.json"), plan.case_text.as_bytes())
                .map_err(|e| Error::Io(e.to_string()))?;
        }
        let units = plan.units;
        let mut flow = match (&plan.scene.flow, units) {
            (Some(scene), Some(units)) => {
                let made = setup::fluid(&plan, scene, &units)
                    .and_then(|setup| Fluid::<S>::new(setup, &domain).map_err(Error::Internal));
                let mut fluid = made?;
                if found.is_none() {
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
        let resumed = found.is_some();
        if let Some((found, path)) = &found {
            let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
            if let Some(flow) = flow.as_mut().and_then(Water::lattice_mut) {
                checkpoint::read_fluid(flow.fluid_mut(), &reader)?;
                flow.restart();
            }
            if let Some(flow) = flow.as_mut().and_then(Water::seepage_mut) {
                flow.restore(&checkpoint::read_seepage(&reader)?)?;
            }
            let attributes = reader.attributes().clone();
            step = found.manifest.step;
            notes = attributes["notes"].clone();
            removal.restore(&attributes["removal"])?;
            recorder_state = attributes["recorder"].clone();
            collapse_state = attributes["collapse"].clone();
            guards_state = attributes["guards"].clone();
            if solid {
                let (grains, contacts) = checkpoint::read_tables(&reader, domain.rank())?;
                particles = Particles::from_table(&grains)?;
                setup::blocks::shapes(&plan, &mut particles)?;
                let radius = attributes["typical_radius"].as_f64().unwrap_or(1.0);
                let mut engine = setup::dem::<Sp>(&plan, radius)?;
                if !plan.scene.follows_grains() {
                    particles.forget_start();
                } else if !particles.has_start() {
                    return Err(Error::Io(format!(
                        "{} does not say where the grains started, since its run asked for no displacements; take `output.grains.displacement` and `analysis.ground_collapse` out, or start anew",
                        path.display()
                    )));
                }
                engine.restore(&contacts)?;
                engine.open_walls(&setup::temporary_walls(&plan));
                engine.prepare(&mut particles, &domain)?;
                notes["typical_radius"] = json!(radius);
                dem = Some(engine);
            }
            plan.scene.forget_sample();
            progress.note(&format!("going on from step {step}: {}", path.display()));
        } else if solid {
            let prepared = {
                let tell = |line: &str| progress.note(line);
                preparation::grains::<Sp>(&plan, &folder, &domain, &Waiting::new(&tell))?
            };
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
            let (line, report) = preparation::settle(&plan, &mut engine, &mut particles, &domain)?;
            progress.note(&line);
            let gates = setup::temporary_walls(&plan);
            if !gates.is_empty() {
                engine.open_walls(&gates);
                particles.forget_loads();
                engine.prepare(&mut particles, &domain)?;
            }
            if plan.scene.follows_grains() {
                particles.mark_start();
            }
            notes = json!({ "preparation": prepared.report, "settling": report, "typical_radius": radius });
            dem = Some(engine);
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
        if !resumed && let Some(flow) = flow.as_mut().and_then(Water::lattice_mut) {
            let (steps, line) = warm_up(&plan, flow, &mut particles, &mut guards, &domain)?;
            flow_age = steps_number(steps) * plan.clock.time_step;
            progress.note(&line);
        }
        let resumed_at = resumed.then_some(step);
        let outputs = Outputs::create(
            &plan,
            &folder,
            provenance(&plan, &domain, start.threads),
            &domain,
            resumed_at,
        )?;
        let mut recorder = ErosionRecorder::create(&plan, &folder, &domain, resumed_at)?;
        if resumed {
            recorder.restore(&recorder_state)?;
        } else {
            recorder.set_flow_age(flow_age);
        }
        let mut collapse = CollapseRecorder::create(&plan, &folder, &domain, resumed_at)?;
        if resumed {
            collapse.restore(&collapse_state)?;
        }
        let lattice = flow.as_ref().and_then(Water::lattice);
        let mut averages = lattice.and_then(|flow| Averages::new(&plan, flow));
        if let (Some(averages), Some(flow), Some((found, _))) = (&mut averages, lattice, &found) {
            let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
            checkpoint::read_averages(averages, flow.fluid(), &reader)?;
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
            watch,
            progress,
            threads: start.threads,
            first_step: step,
            notes,
            initial_mass: 0.0,
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
            .map(|t| self.simulation.now.plan.clock.interval_to_steps(t));
        while self.simulation.now.step < steps {
            self.simulation.step()?;
            for line in self.simulation.collapse.take_news() {
                self.progress.note(&line);
            }
            for line in self.simulation.guards.take_news() {
                self.progress.note(&line);
            }
            let step = self.simulation.now.step;
            if save_every.is_some_and(|every| step.is_multiple_of(every)) && step < steps {
                self.save()?;
            }
            if self.eroded() {
                break;
            }
            if step.is_multiple_of(ASK_EVERY) {
                self.tell();
                let request = self.watch.ask(self.simulation.now.domain.communicator());
                self.simulation.phases.done(Phase::Guards);
                match request {
                    Request::None => {}
                    Request::Checkpoint => self.save()?,
                    Request::Stop => {
                        self.save()?;
                        self.simulation.look()?;
                        if self.simulation.now.domain.rank() == 0 {
                            self.watch.forget_file();
                        }
                        let text = format!(
                            "step {step} of {steps}; go on with `solver restart {}`",
                            self.folder.display()
                        );
                        return Err(Error::Stopped(text));
                    }
                }
            }
        }
        self.simulation.look()?;
        self.simulation
            .outputs
            .write_all_now(&self.simulation.now.view())?;
        self.simulation
            .recorder
            .flush(&self.simulation.now.domain)?;
        self.simulation
            .collapse
            .draw(&self.folder, &self.simulation.now.domain)?;
        self.simulation.phases.done(Phase::Output);
        Ok(())
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

    fn save(&mut self) -> Result<(), Error> {
        let begun = Instant::now();
        let simulation = &mut self.simulation;
        simulation.outputs.sync(&simulation.now.domain)?;
        let recorder = simulation.recorder.state(&simulation.now.domain)?;
        let collapse = simulation.collapse.state(&simulation.now.domain)?;
        let attributes = json!({
            "case_hash": simulation.now.plan.case_hash,
            "removal": simulation.removal.state()?,
            "recorder": recorder,
            "collapse": collapse,
            "guards": simulation.guards.state(),
            "notes": self.notes,
            "typical_radius": self.notes["typical_radius"],
            "version": env!("CARGO_PKG_VERSION"),
            "commit": env!("SOLVER_COMMIT"),
        });
        let keep = simulation.now.plan.scene.checkpoint.keep as usize;
        let (step, time) = (simulation.now.step, simulation.now.time());
        let communicator = simulation.now.domain.communicator();
        let written = simulation.now.state().write(
            &checkpoint_folder(&self.folder),
            step,
            time,
            attributes,
            keep,
            communicator,
        );
        match written {
            Ok(()) => {}
            Err(io::Error::Space { needed, free, path }) => {
                self.progress.note(&format!(
                    "no checkpoint at step {step}: it needs {needed} bytes, {path} has {free}; the run goes on"
                ));
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
        let phases = simulation.phases.reduce(communicator);
        let wall = self.watch.elapsed().as_secs_f64();
        let looped: f64 = phases.iter().map(|p| p.mean).sum();
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
            "phases": phases,
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
            "imbalance": simulation.guards.imbalance(),
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
            summary["imbalance"] =
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
        let first = communicator.rank() == 0;
        let written = if first {
            io::atomic::write_json(&self.folder.join("summary.json"), &summary)
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
            self.progress.note(&table(&phases, looped));
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
                self.folder.display()
            ));
        }
        Ok(())
    }
}

fn simulation_phase(phases: &mut Phases) {
    phases.done(Phase::Checkpoint);
}

fn checkpoint_folder(folder: &Path) -> PathBuf {
    folder.join("checkpoints")
}

fn find(
    plan: &Plan,
    folder: &Path,
    domain: &Domain,
    changed: bool,
) -> Result<(Found, PathBuf), Error> {
    let group = Together(domain.communicator());
    let found = io::checkpoint::newest(&checkpoint_folder(folder), &group)
        .map_err(|e| Error::Io(e.to_string()))?;
    for passed in &found.passed_over {
        log::warn!("checkpoint passed over: {passed}");
    }
    let theirs = found.manifest.attributes["case_hash"]
        .as_str()
        .unwrap_or_default();
    if theirs != plan.case_hash && !changed {
        return Err(Error::Io(format!(
            "{} belongs to another case (hash {theirs}, this case {}); use --set to change a field on purpose",
            found.path.display(),
            plan.case_hash
        )));
    }
    let path = found.path.clone();
    Ok((found, path))
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

/// The fluid flows round grains that stand still until it is steady: steps taken, and a line to print. Collective.
fn warm_up<Sp: Space, S: Saved>(
    plan: &Plan,
    flow: &mut dyn LatticeFlow<Sp, S>,
    particles: &mut Particles<Sp>,
    guards: &mut Guards,
    domain: &Domain,
) -> Result<(u64, String), Error> {
    let Some(WarmUp::FluidOnly {
        relative_change, ..
    }) = plan.scene.time.warm_up
    else {
        return Ok((0, String::new()));
    };
    const LOOK_EVERY: u64 = 100;
    let communicator = domain.communicator();
    let cells: Vec<usize> = flow
        .fluid()
        .populations()
        .interior()
        .map(|(_, cell)| cell)
        .collect();
    let mut before: Vec<[f64; 3]> = vec![[0.0; 3]; cells.len()];
    let mut change = f64::INFINITY;
    let mut step = 0;
    while step < plan.clock.warm_up_steps {
        flow.advance(particles, domain)?;
        step += 1;
        guards.check_warm_up(step, flow, particles, plan, domain)?;
        if step % LOOK_EVERY == 0 {
            let (mut moved, mut size) = (0.0_f64, 0.0_f64);
            for (&cell, old) in cells.iter().zip(&mut before) {
                let (_, u) = flow.fluid().state(cell);
                for a in 0..3 {
                    moved = moved.max((u[a] - old[a]).abs());
                    size = size.max(u[a].abs());
                }
                *old = u;
            }
            change = communicator.all_reduce_max_f64(moved)
                / communicator.all_reduce_max_f64(size).max(1e-300);
            if change < relative_change {
                break;
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

fn versions(communicator: &Communicator) -> Value {
    json!({
        "solver": env!("CARGO_PKG_VERSION"),
        "commit": env!("SOLVER_COMMIT"),
        "lanes": Level::best().name(),
        "mpi": communicator.mpi_version(),
    })
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

fn table(phases: &[Spent], looped: f64) -> String {
    let mut text = format!(
        "{:<12} {:>9} {:>9} {:>9} {:>7}\n",
        "phase", "min s", "mean s", "max s", "share"
    );
    for p in phases {
        let name = serde_json::to_value(p.phase)
            .ok()
            .and_then(|v| v.as_str().map(str::to_owned))
            .unwrap_or_default();
        text += &format!(
            "{name:<12} {:>9.3} {:>9.3} {:>9.3} {:>6.1}%\n",
            p.min,
            p.mean,
            p.max,
            100.0 * p.mean / looped.max(1e-9)
        );
    }
    text.pop();
    text
}
