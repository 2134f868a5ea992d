//! From a plan or a checkpoint to a run before its next step.

use super::super::agreement;
use super::super::balance::{self, Costs};
use super::super::collapse::CollapseRecorder;
use super::super::coupled;
use super::super::erosion::ErosionRecorder;
use super::super::folder::RunFolder;
use super::super::gates::Gates;
use super::super::guards::Guards;
use super::super::phases::Phases;
use super::super::preparation;
use super::super::progress::Progress;
use super::super::recorders::{Recorders, saved_guards};
use super::super::removal::Removal;
use super::super::resume::{self, Resumed, Stage};
use super::super::setup;
use super::super::versions::versions;
use super::super::watch::Watch;
use super::super::{Present, Simulation};
use super::Start;
use super::runner::Runner;
use super::warm_up::warm_up;
use crate::case::fluid::Device;
use crate::checkpoint::{self, Saved, State};
use crate::coupling::Flow;
use crate::coupling::lattice::LatticeFlow;
use crate::coupling::water::Water;
use crate::dem::Dem;
use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::error::Error;
use crate::lbm::fluid::Fluid;
use crate::lbm::lanes::Level;
use crate::number::real;
use crate::output::Outputs;
use crate::output::averages::Averages;
use crate::plan::Plan;
use crate::preparation::rest::Rest;
use crate::preparation::supervision::Request;
use crate::scene::initial::Initial;
use decomposition::{Communicator, Domain};
use io::checkpoint::Reader;
use io::marks::Marker;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

impl<Sp: Space, S: Saved> Runner<Sp, S> {
    pub(super) fn begin(
        mut plan: Plan,
        communicator: Communicator,
        start: Start,
    ) -> Result<Self, Error> {
        let first = communicator.rank() == 0;
        let listed = super::listed_slabs(&plan.scene.grid, communicator.size())?;
        let may_cut = listed.is_none();
        let folder = start.folder;
        let mut watch = {
            let every = plan.scene.checkpoint.every_wall_seconds;
            let every = (every > 0.0).then(|| Duration::from_secs_f64(every));
            let mut folders = vec![folder.path()];
            folders.extend(start.parent.as_deref());
            Watch::new(&folders, start.begun, start.limit, every)?
        };
        let speaks = first && !start.quiet;
        // A run that changes its slabs has said the rest.
        let mut progress = Progress::new(speaks && start.slabs.is_none(), 0);
        progress.note(&format!(
            "{} rank(s) x {} thread(s), slabs along {:?}, {} lanes",
            communicator.size(),
            start.threads,
            setup::axis(plan.scene.grid.split_axis),
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
        let solid = plan.scene.has_solids() || generates(&plan);
        // A wrong file is found before grains are prepared for hours.
        let mut field = match (&plan.scene.flow, units) {
            (Some(scene), Some(units)) if !flowed => match &scene.initial {
                Initial::File(path) => Some(setup::initial::file(path, &plan, units)?),
                _ => None,
            },
            _ => None,
        };
        // The grains come first, all of them on the first rank: their places decide where the slabs are cut.
        let mut particles = Particles::<Sp>::new();
        let mut saved = None;
        let mut sample = None;
        if let (Some(found), Some(resumed), true) = (found, &resumed, solid) {
            let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
            // The first rank alone reads the grains, so that it alone may find them wrong.
            let read = checkpoint::read_tables(&reader, communicator.rank());
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
            saved = Some(contacts);
        } else if solid {
            let earlier = resumed.as_ref().map(|resumed| &resumed.found);
            if let Some(found) = earlier {
                progress.note(&format!(
                    "continuing with the sample: {}",
                    found.path.display()
                ));
            }
            let tell = |line: &str| progress.note(line);
            let attributes = resume::attributes(&plan);
            let prepared = preparation::grains::<Sp>(
                &plan,
                &folder,
                &communicator,
                &mut watch,
                &tell,
                &attributes,
                earlier,
            )?;
            progress.note(&prepared.line);
            setup::blocks::shapes(&plan, &mut particles)?;
            setup::bodies(&plan, &communicator, &mut particles)?;
            setup::blocks::blocks(&plan, &communicator, &mut particles)?;
            setup::grains(
                &plan,
                &communicator,
                &mut particles,
                &prepared.grains,
                plan.scene.first_grain(),
            );
            let radius = typical_radius(&plan, &prepared.grains, &communicator);
            sample = Some((prepared.report, radius));
        }
        plan.scene.forget_sample();
        let slabs = match start.slabs.or(listed) {
            Some(slabs) => slabs,
            None => {
                let mut costs = Costs::of(&plan, &particles, &communicator).planned();
                if balance::depends_on_the_machine(&plan, &costs, &communicator) {
                    plan.estimate.machine.fluid = balance::speed(&plan, &communicator);
                    costs = Costs::of(&plan, &particles, &communicator).planned();
                }
                let slabs = balance::cut(&plan.scene, &costs, communicator.size());
                let equal = balance::equal(&plan.scene, costs.len(), communicator.size());
                if slabs != equal {
                    progress.note(&balance::line(&slabs, &equal, &costs));
                }
                slabs
            }
        };
        let domain =
            Domain::new(communicator.clone(), slabs).map_err(|e| Error::Internal(e.to_string()))?;
        let mut flow = match (&plan.scene.flow, units) {
            (Some(scene), Some(units)) => {
                let made = setup::fluid(&plan, scene, &units).and_then(|setup| {
                    let gpu = setup.device == Device::Gpu;
                    Fluid::<S>::new(setup, &domain).map_err(|error| {
                        if gpu {
                            let path = "fluid.lattice_boltzmann.device = gpu";
                            let remedy = "--set fluid.lattice_boltzmann.device=cpu, or auto";
                            Error::Usage(format!("{path}: {error}; use {remedy}"))
                        } else {
                            Error::Internal(error)
                        }
                    })
                });
                let mut fluid = made?;
                if !flowed {
                    match setup::initial::formula(&plan, scene, &units) {
                        Some(field) => fluid.initialise(field.as_ref()),
                        None => {
                            if let Some(field) = field.take() {
                                fluid.initialise(field.as_ref());
                            }
                        }
                    }
                }
                Some(coupled::flow::<Sp, S>(&plan, fluid, units))
            }
            _ => setup::seepage::<Sp>(&plan, &communicator)?
                .map(|seepage| Water::Seepage(Box::new(seepage))),
        };
        let mut notes = json!({});
        let mut removal = Removal::new(&plan);
        let mut gates = Gates::new(&plan);
        let (mut step, mut recorders, mut meters) = (0, None, None);
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
            meters = saved_guards(&attributes);
            if runs {
                let saved = Recorders::read(&attributes)?;
                removal.restore(&saved.removal, resumed.regions.as_deref())?;
                recorders = Some(saved);
            }
            if let Some(contacts) = saved.take() {
                let radius = attributes["typical_radius"].as_f64().unwrap_or(1.0);
                let mut engine = setup::dem::<Sp>(&plan, radius)?;
                if !plan.scene.marks_start() {
                    particles.forget_start();
                } else if flowed && plan.scene.follows_grains() && !particles.has_start() {
                    return Err(Error::Io(format!(
                        "{} does not contain the initial positions of the grains, because its run had no displacements; remove `output.grains.displacement` and `analysis.ground_collapse`, or start a new run",
                        found.path.display()
                    )));
                }
                engine.restore(&contacts)?;
                if let Some(walls) = &resumed.walls {
                    resume::drive_walls(&plan, &mut engine);
                    let new = (&walls[..], &gates, step);
                    resume::clear_of_new_walls(&plan, new, &particles, &domain)?;
                }
                if flowed {
                    engine.open_walls(&setup::temporary_walls(&plan));
                    gates.restore(step, &mut engine);
                }
                engine.prepare(&mut particles, &domain)?;
                notes["typical_radius"] = json!(radius);
                dem = Some(engine);
            }
            progress.note(&match &stage {
                Some(Stage::Run) | None => {
                    format!("continuing from step {step}: {}", found.path.display())
                }
                Some(_) => format!("continuing the preparation: {}", found.path.display()),
            });
        } else if let Some((report, radius)) = sample {
            let mut engine = setup::dem::<Sp>(&plan, radius)?;
            engine.prepare(&mut particles, &domain)?;
            notes = json!({ "preparation": report, "typical_radius": radius });
            dem = Some(engine);
        }
        kept["typical_radius"] = notes["typical_radius"].clone();
        if !flowed && let Some(engine) = &mut dem {
            kept["notes"] = notes.clone();
            let rest = match &stage {
                Some(Stage::Rest(state)) => Some(Rest::restore(state.clone())),
                _ => Rest::begin(&plan.scene, engine, &mut particles, &domain)?,
            };
            if let Some(rest) = rest {
                let keep = |rest: &Rest,
                            particles: &Particles<Sp>,
                            dem: &Dem<Sp>,
                            watch: &mut Watch,
                            request: Request| {
                    kept["preparation"] = json!({ "settling": rest.state() });
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
                let (line, report) = rest.run(engine, &mut particles, &domain, &mut watch, keep)?;
                progress.note(&line);
                notes["settling"] = report;
            }
            let gates = setup::temporary_walls(&plan);
            if !gates.is_empty() {
                engine.open_walls(&gates);
                particles.forget_loads();
                engine.prepare(&mut particles, &domain)?;
            }
            // What the preparation pressed is not the run's.
            engine.forget_deepest();
            if plan.scene.marks_start() {
                particles.mark_start();
            }
        }
        if dem.is_some() {
            particles.refresh_ghosts(&domain)?;
        }
        if let Some(flow) = &mut flow {
            flow.update_bodies(&mut particles, &domain)?;
        }
        let mut flow_age = 0.0;
        let mut guards = Guards::new(&plan);
        guards.restore(meters.unwrap_or_default());
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
                kept["guards"] = json!(guards.state());
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
            flow_age = real(steps) * plan.clock.time_step;
            progress.note(&line);
        }
        let resumed = runs;
        let resumed_at = resumed.then_some(step);
        if let (Some(found), true) = (found, runs) {
            let ended = step >= plan.clock.steps;
            resume::cut_tables_back(found, folder.path(), ended, &communicator)?;
        }
        let outputs = Outputs::create(
            &plan,
            folder.path(),
            provenance(&plan, &domain, start.threads),
            &domain,
            resumed_at,
        )?;
        let mut recorder = ErosionRecorder::create(&plan, folder.path(), &domain, resumed_at)?;
        let mut collapse = CollapseRecorder::create(&plan, folder.path(), &domain, resumed_at)?;
        if let Some(saved) = recorders {
            recorder.restore(saved.recorder);
            collapse.restore(saved.collapse)?;
        } else {
            recorder.set_flow_age(flow_age);
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
                gates,
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
            may_cut,
            better: None,
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
            super::summary::peak_rss()
        );
        runner.simulation.phases = Phases::start();
        Ok(runner)
    }
}

/// Saves a preparation as a checkpoint at step 0, and ends it if requested. Collective.
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
                "the preparation is not saved: it needs {needed} bytes, {path} has {free}; it continues"
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
fn typical_radius(
    plan: &Plan,
    grains: &[crate::scene::sample::Grain],
    communicator: &Communicator,
) -> f64 {
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
