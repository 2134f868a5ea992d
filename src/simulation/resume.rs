//! Continuation of a run from its newest checkpoint, with a case that fits it.
//!
//! A checkpoint contains its case. The case in the folder, with the changes of `--set`, is compared with it field by
//! field. Changes that a restart allows ([`case::restart`]) are applied; any other change is refused and named.
//! Fields that both cases leave out keep the values chosen for the run, so that a later end or another output does not
//! change the time step.

use super::folder::RunFolder;
use super::gates::{Gates, check_clearance};
use super::setup;
use base::error::{Error, Problem, Severity, Verdict};
use base::number::{real, whole};
use base::provenance;
use case::fluid::Precision;
use case::set::covers;
use case::{Case, Document, restart};
use coupling::joint_water;
use decomposition::{Communicator, Domain};
use dem::particles::Particles;
use dem::space::Space;
use dem::{Dem, PlaneSpace, Volume};
use io::checkpoint::Found;
use io::marks::{Marks, check, cut_back};
use output::averages::Averages;
use output::checkpoint;
use output::group::RankGroup;
use plan::Plan;
use plan::scene::findings::refused;
use plan::scene::grains::{GrainSource, Grains};
use plan::scene::observe::RegionAction;
use plan::scene::walls::SceneWall;
use preparation::rest::SavedRest;
use serde_json::{Value, json};
use std::path::Path;

/// A checkpoint, and the differences between the present scene and that of its run.
#[derive(Clone, Debug)]
pub(super) struct Resumed {
    pub(super) found: Found,
    /// `true` if the case in the folder must be written again, because it has changed.
    pub(super) changed: bool,
    /// Index of each wall among the walls of the saved run; none if they are the same.
    pub(super) walls: Option<Vec<Option<usize>>>,
    /// Index of each region among the regions of the saved run; none if they are the same.
    pub(super) regions: Option<Vec<Option<usize>>>,
    /// Regions that generate grains at another rate, or up to another number, than in the saved run.
    pub(super) feeds: Vec<usize>,
    /// `true` if the case has changed, and it or that of the saved run generates grains.
    pub(super) other_feeds: bool,
    /// `true` if the time averages continue from those of the checkpoint.
    pub(super) averages_continue: bool,
}

/// Stage of a run when its checkpoint was written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Stage {
    /// Time loop, after the preparation.
    Run,
    /// Generation of a sample.
    Sample,
    /// Relaxation of bonded grains.
    Rest(SavedRest),
    /// Warm-up of the fluid, after this many steps.
    WarmUp(u64),
}

impl Resumed {
    /// Returns the continuation of a run with the unchanged case of the checkpoint.
    pub(super) fn unchanged(found: Found) -> Self {
        Self {
            found,
            changed: false,
            walls: None,
            regions: None,
            feeds: Vec::new(),
            other_feeds: false,
            averages_continue: true,
        }
    }

    pub(super) fn stage(&self) -> Result<Stage, Error> {
        let stage = &self.found.manifest.attributes["preparation"];
        if stage.is_null() {
            return Ok(Stage::Run);
        }
        if !stage["sample"].is_null() {
            return Ok(Stage::Sample);
        }
        if !stage["settling"].is_null() {
            return serde_json::from_value(stage["settling"].clone())
                .map(Stage::Rest)
                .map_err(|_| {
                    Error::Io("the saved preparation does not contain its progress".into())
                });
        }
        stage["warm_up"].as_u64().map(Stage::WarmUp).ok_or_else(|| {
            Error::Io(format!(
                "{} does not contain the progress of the preparation",
                self.found.path.display()
            ))
        })
    }
}

/// Returns the attributes of the run in every checkpoint.
pub(super) fn attributes(plan: &Plan) -> Value {
    json!({
        "case": plan.case_text,
        "case_hash": plan.case_hash,
        "scales": scales(plan),
        "version": provenance::VERSION,
        "commit": provenance::commit(),
    })
}

/// Returns the units of the saved numbers.
fn scales(plan: &Plan) -> Value {
    json!({
        "cells": plan.scene.grid.cells,
        "spacing": plan.scene.grid.spacing,
        "time_step": plan.clock.time_step,
        "solid_steps_per_step": plan.clock.solid_steps_per_step,
    })
}

/// Returns the newest checkpoint of the run in a folder, or otherwise of its preparation. Collective.
///
/// # Errors
/// If there is none, the same on all ranks, [`Error::Io`].
pub(super) fn find(folder: &RunFolder, communicator: &Communicator) -> Result<Found, Error> {
    let group = RankGroup(communicator);
    let found = match io::checkpoint::newest(&folder.checkpoints(), &group) {
        Err(io::Error::NoCheckpoint { path, reason }) => {
            let sample = folder.preparation();
            let kept = communicator.all_reduce_max_u64(u64::from(sample.is_dir())) > 0;
            if !kept {
                return Err(Error::Io(format!(
                    "no checkpoint in {path}{reason}; start again with `solver {0}/case.json --output ..` or, in the \
                     same folder, with a copy of that case and --overwrite",
                    folder.path().display()
                )));
            }
            io::checkpoint::newest(&sample, &group)
        }
        other => other,
    };
    let found = found.map_err(|e| Error::Io(e.to_string()))?;
    if communicator.rank() == 0 {
        for passed in &found.passed_over {
            log::warn!("checkpoint skipped: {passed}");
        }
        report_version(&found);
    }
    Ok(found)
}

/// Refuses a checkpoint that cannot belong to the plan, before memory is allocated for it; a matching hash only
/// excludes accidental damage.
///
/// # Errors
/// If the checkpoint does not fit, [`Error::Io`] with the reason; the error is the same on all ranks.
pub(super) fn fits(plan: &Plan, resumed: &Resumed) -> Result<(), Error> {
    let found = &resumed.found;
    let manifest = &found.manifest;
    let stage = resumed.stage()?;
    let wrong = |what: String| {
        Err(Error::Io(format!(
            "{} does not fit the case: {what}",
            found.path.display()
        )))
    };
    if let Err(what) = expected(plan, resumed.changed, &stage).fits(manifest) {
        return wrong(what);
    }
    let time = match stage {
        Stage::Run => real(manifest.step) * plan.clock.time_step,
        _ => 0.0,
    };
    if (manifest.time - time).abs() > 1e-9 * time.abs() {
        return wrong(format!(
            "its time is {} s at step {}, but the time of the case at this step is {time} s",
            manifest.time, manifest.step
        ));
    }
    Ok(())
}

/// Returns the arrays and sizes that a checkpoint of a plan may have.
fn expected(plan: &Plan, changed: bool, stage: &Stage) -> checkpoint::Expected {
    let scene = &plan.scene;
    let lattice = scene.flow.as_ref().map(|flow| {
        let bytes = match flow.storage {
            Precision::F32 => 4,
            Precision::F64 => 8,
        };
        checkpoint::ExpectedPopulations {
            cells: scene.grid.cells,
            velocities: flow.models.lattice.count(),
            bytes,
        }
    });
    let of_blocks = scene.blocks.iter().flat_map(|blocks| &blocks.list);
    let radii = (scene.bodies.iter().map(|body| body.radius))
        .chain(of_blocks.map(|block| block.solid.shape.radius()));
    let length = scene.grid.size.iter().copied().chain(radii);
    let expected = scene.grains.as_ref().map_or(0, |grains| grains.expected) as u64;
    let generates =
        (scene.regions.iter()).any(|region| matches!(region.action, RegionAction::Generate { .. }));
    let mut grains = scene
        .first_grain()
        .saturating_add(expected.saturating_mul(2));
    for region in &scene.regions {
        if let RegionAction::Generate { radii, .. } = &region.action {
            // A restart may have lowered the rate: the domain limits the number that is present.
            let dimension = scene.grid.dimension;
            let space: f64 = scene.grid.size[..dimension].iter().product();
            let smallest = radii.bounds().0;
            let measure = match dimension {
                2 => PlaneSpace::measure(smallest),
                _ => Volume::measure(smallest),
            };
            let most = whole(space / measure) as u64;
            grains = grains.saturating_add(most.saturating_add(1));
        }
    }
    checkpoint::Expected {
        prepared: matches!(stage, Stage::Run),
        lattice,
        seepage: scene
            .seepage
            .as_ref()
            .map(|seepage| darcy::pressure::numbers(seepage.cell_count(), seepage.is_transient()))
            .or(scene.joints.as_ref().map(|joints| {
                let inertia = joints.written.inertia;
                let (nodes, links) = (joints.nodes(), joints.counts.links);
                let blocks = scene.blocks.as_ref().map_or(0, |blocks| blocks.number);
                let (steps, mouths) = (joints.lattice_steps, joints.counts.mouths);
                match joints.movers {
                    0 => {
                        joint_water::numbers(joints.numbers)
                            + joint_water::window_numbers(steps, mouths, blocks)
                    }
                    movers => joint_water::most_numbers(movers, nodes, links, inertia),
                }
            })),
        seepage_varies: scene.joints.as_ref().is_some_and(|j| j.movers > 0),
        grains: (scene.has_solids() || generates).then_some(grains),
        steps: plan.clock.steps,
        // The restart may have requested a shorter warm-up.
        warm_up: if changed {
            u64::MAX
        } else {
            plan.clock.warm_up_steps
        },
        length: length.fold(0.0, f64::max),
    }
}

/// Returns `true` if a region of the plan generates grains.
fn feeds_grains(plan: &Plan) -> bool {
    let mut regions = plan.scene.regions.iter();
    regions.any(|region| matches!(region.action, RegionAction::Generate { .. }))
}

/// Returns the limits of the grains and contacts of a plan. With `other_feeds` generated grains may have had other
/// radii before.
pub(super) fn bounds(plan: &Plan, other_feeds: bool) -> checkpoint::StateLimits {
    let scene = &plan.scene;
    // Growth that ends when grains touch leaves all grains smaller than stated.
    let grown = |grains: &Grains| match grains.source {
        GrainSource::Growth { .. } => 0.5,
        _ => 1.0,
    };
    let of_grains = scene.grains.iter().filter_map(|grains| {
        let (least, most) = grains.radii?;
        Some((grown(grains) * least, most))
    });
    let generated = scene
        .regions
        .iter()
        .filter_map(|region| match &region.action {
            RegionAction::Generate { radii, .. } => Some(radii.bounds()),
            _ => None,
        });
    let of_blocks = scene.blocks.iter().flat_map(|blocks| &blocks.list);
    let of_blocks = of_blocks.map(|block| block.solid.shape.radius());
    let single = scene.bodies.iter().map(|body| body.radius).chain(of_blocks);
    let (smallest, largest) = of_grains
        .chain(generated)
        .chain(single.map(|radius| (radius, radius)))
        .fold((f64::INFINITY, 0.0_f64), |(low, high), (least, most)| {
            (low.min(least), high.max(most))
        });
    let edge = scene.grid.size.iter().copied().fold(0.0, f64::max);
    let (smallest, largest) = if other_feeds {
        (0.0, largest.max(edge))
    } else {
        (smallest.min(largest), largest)
    };
    // A solid without a density counts with a density of 1.
    let densities = scene.materials.iter();
    let densities = densities.map(|material| material.density.unwrap_or(1.0));
    let shapes = scene.polyhedra().map(|one| &one.solid.shape);
    let shapes = shapes.map(|shape| [shape.volume(), shape.inertia(1.0).mean()]);
    checkpoint::StateLimits {
        size: scene.grid.size,
        periodic: scene.grid.periodic,
        dimension: scene.grid.dimension,
        densities: densities.collect(),
        shapes: shapes.collect(),
        smallest,
        largest,
    }
}

/// Tables that a run may write, other than those of probes.
pub const TABLES: [&str; 9] = [
    "averages_profile.csv",
    "bonds.csv",
    "clusters.csv",
    "collapse.csv",
    "collapse_points.csv",
    "crossings.csv",
    "erosion.csv",
    "removed.csv",
    "surface.csv",
];

/// Returns the tables that the run of a plan may write, by name.
pub(super) fn tables(plan: &Plan) -> Vec<String> {
    let probes = plan.scene.probes.iter();
    let probes = probes.map(|probe| format!("probe_{}.csv", probe.name));
    probes.chain(TABLES.map(str::to_owned)).collect()
}

/// Cuts the tables of a run back to a checkpoint, after checking that none of them was changed before that point. A
/// run that has `ended` at the checkpoint keeps the rows that it wrote at its end: no row follows them, and some
/// cannot be measured again. Collective.
///
/// # Errors
/// If a table was changed since, [`Error::Io`] with its name; the error is the same on all ranks.
pub(super) fn cut_tables_back(
    found: &Found,
    folder: &Path,
    ended: bool,
    communicator: &Communicator,
) -> Result<(), Error> {
    let written = &found.manifest.attributes["tables"];
    if written.is_null() {
        // Checkpoints of earlier versions do not contain the lengths of the tables.
        return Ok(());
    }
    let marks: Marks = serde_json::from_value(written.clone())
        .map_err(|e| Error::Io(format!("{}: tables: {e}", found.path.display())))?;
    let gone = RankGroup(communicator).on_root(|| {
        if ended {
            check(folder, &marks)
        } else {
            cut_back(folder, &marks)
        }
    })?;
    if communicator.rank() == 0 {
        for name in gone {
            log::warn!(
                "{} is missing: a new table begins at step {}",
                folder.join(name).display(),
                found.manifest.step
            );
        }
    }
    Ok(())
}

/// Reports if another version or commit wrote the checkpoint.
fn report_version(found: &Found) {
    let of = |key: &str| found.manifest.attributes[key].as_str().unwrap_or("unknown");
    let (version, commit) = (of("version"), of("commit"));
    let mine = (provenance::VERSION, provenance::commit());
    if (version, commit) != mine {
        log::warn!(
            "{} was written by version {version} (commit {commit}), and this is {} (commit {}): results may differ \
             from those of one program",
            found.path.display(),
            mine.0,
            mine.1
        );
    }
}

/// Returns `true` if a folder contains an unfinished run of exactly this plan. First rank.
pub(super) fn is_open(folder: &Path, plan: &Plan) -> bool {
    let case = io::plain::text(&folder.join("case.json"), io::plain::LONGEST_CASE);
    let saved = |name: &str| {
        std::fs::read_dir(folder.join(name)).is_ok_and(|mut entries| entries.next().is_some())
    };
    case.is_ok_and(|text| text == plan.case_text)
        && (saved(super::folder::CHECKPOINTS) || saved(super::folder::PREPARATION))
}

/// Reads the case of a folder with the changes of `set`; reports problems of single fields first.
///
/// # Errors
/// If the case is wrong; the text names the file.
pub(super) fn read(text: &str, set: &[String], folder: &Path) -> Result<Document, Error> {
    let named = |problems| Error::Case(of_file(&folder.join("case.json"), set, problems));
    let document = Document::read(text, set, folder).map_err(named)?;
    if refused(&document.problems) {
        return Err(named(document.problems));
    }
    Ok(document)
}

/// Returns the plan of a restart: the case `text` of the folder with the changes of `set`, applied to the state of
/// a checkpoint.
///
/// # Errors
/// If a restart does not allow a change, if the case has errors, or if it is unstable and that is not allowed; all
/// findings are returned.
pub(super) fn plan(
    text: &str,
    set: &[String],
    folder: &Path,
    found: Found,
    allow_unstable: bool,
) -> Result<(Plan, Resumed), Error> {
    let document = read(text, set, folder)?;
    let attributes = &found.manifest.attributes;
    let mut resumed = Resumed::unchanged(found.clone());
    let Some(saved) = attributes["case"].as_str() else {
        return of_an_older_version(document, resumed);
    };
    let broken = |problems: Vec<Problem>| {
        let first = problems.first().map(ToString::to_string);
        Error::Io(format!(
            "{}: its case cannot be used: {}",
            found.path.display(),
            first.unwrap_or_default()
        ))
    };
    let base = Document::read(saved, &[], folder).map_err(broken)?;
    let tree = |case: &Case| {
        serde_json::to_value(case).map_err(|e| Error::Internal(format!("a case as text: {e}")))
    };
    let (changed, mut refused) = restart::compare(&tree(&base.case)?, &tree(&document.case)?);
    refused.extend(walls_that_differ(&base.case, &document.case));
    if !refused.is_empty() {
        return Err(Error::Case(refused));
    }
    let plan = if changed.is_empty() {
        Plan::prepare(document).map_err(Error::Case)?
    } else {
        let old = Plan::prepare(base).map_err(broken)?;
        let plan = Plan::prepare_like(document, &old).map_err(Error::Case)?;
        resumed.walls = Some(wall_origins(&old.scene.walls, &plan.scene.walls))
            .filter(|_| changed.iter().any(|path| path.contains("walls")));
        let origins = region_origins(&old, &plan)?;
        resumed.feeds = changed_feeds(&old, &plan, &origins);
        resumed.regions = Some(origins);
        resumed.other_feeds = [&old, &plan].into_iter().any(feeds_grains);
        let step = resumed.found.manifest.step;
        resumed.averages_continue = Averages::continues(&old, &plan, step).map_err(|path| {
            let written = |plan: &Plan| {
                let averages = plan.scene.output.averages.as_ref();
                averages.map_or_else(|| String::from("none"), |averages| {
                    let (from, every) = (averages.from, averages.sample_every);
                    format!("from {from} s, every {every} s")
                })
            };
            Error::Case(vec![refusal(
                path,
                format!("{} (was {})", written(&plan), written(&old)),
                if old.scene.output.averages.is_some() {
                    "the sums in the checkpoint contain samples at the times of the original run"
                } else {
                    "the checkpoint contains no samples of the time before it"
                },
                "undo the change, or choose `from` after the checkpoint, so that the averages start again",
            )])
        })?;
        plan
    };
    check_scales(&plan, attributes, &resumed)?;
    if !Verdict::from_findings(&plan.warnings).runs(allow_unstable) {
        return Err(Error::Case(plan.warnings));
    }
    resumed.changed = plan.case_text != text;
    Ok((plan, resumed))
}

/// Adds the name of the file to problems, unless `set` causes them: the file was not given on the command line.
fn of_file(file: &Path, set: &[String], problems: Vec<Problem>) -> Vec<Problem> {
    let given = |path: &str| {
        let assigned = set.iter().filter_map(|one| one.split_once('='));
        assigned
            .map(|(assigned, _)| assigned.trim())
            .any(|assigned| covers(assigned, path))
    };
    let named = |problem: Problem| {
        if given(&problem.path) {
            return problem;
        }
        Problem {
            path: format!("{}: {}", file.display(), problem.path),
            ..problem
        }
    };
    problems.into_iter().map(named).collect()
}

/// Checks the case for a checkpoint of an earlier version, which contains only the hash of its case.
fn of_an_older_version(document: Document, resumed: Resumed) -> Result<(Plan, Resumed), Error> {
    let plan = Plan::prepare(document).map_err(Error::Case)?;
    let theirs = resumed.found.manifest.attributes["case_hash"].as_str();
    if theirs != Some(plan.case_hash.as_str()) {
        return Err(Error::Io(format!(
            "{} belongs to another case (hash {}, this case {}) and was written by a version that did not store \
             the case; restart it without --set",
            resumed.found.path.display(),
            theirs.unwrap_or("missing"),
            plan.case_hash
        )));
    }
    Ok((plan, resumed))
}

fn refusal(path: &str, value: String, reason: impl Into<String>, remedy: &str) -> Problem {
    Problem {
        path: path.into(),
        value,
        reason: reason.into(),
        remedy: remedy.into(),
        severity: Severity::Error,
    }
}

/// Checks that the cells and the time step of the state are those of the plan, and that the state precedes the end.
fn check_scales(plan: &Plan, attributes: &Value, resumed: &Resumed) -> Result<(), Error> {
    let mut problems = Vec::new();
    let (theirs, ours) = (&attributes["scales"], scales(plan));
    for (name, ours) in ours.as_object().into_iter().flatten() {
        let theirs = &theirs[name];
        if theirs != ours {
            problems.push(refusal(
                name,
                format!("{ours} (was {theirs})"),
                "the saved state has the scale of the original run",
                "restart with the version and the case of the original run",
            ));
        }
    }
    let step = resumed.found.manifest.step;
    // The steps of a preparation are counted separately.
    if resumed.stage()? == Stage::Run && plan.clock.steps < step {
        problems.push(refusal(
            "time.end",
            plan.scene.time.end.to_string(),
            format!(
                "the checkpoint is already at {} s",
                resumed.found.manifest.time
            ),
            &format!(
                "use an end time of at least {}",
                resumed.found.manifest.time
            ),
        ));
    }
    if problems.is_empty() {
        Ok(())
    } else {
        Err(Error::Case(problems))
    }
}

/// Returns a problem for each remaining wall that differs in more than its velocity and servo.
fn walls_that_differ(old: &Case, new: &Case) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (n, wall) in new.walls.iter().enumerate() {
        let Some(before) = old.walls.iter().find(|before| before.name == wall.name) else {
            continue;
        };
        for (field, same) in [
            ("shape", before.shape == wall.shape),
            ("material", before.material == wall.material),
            ("during", before.during == wall.during),
            ("from", before.from == wall.from),
            ("until", before.until == wall.until),
        ] {
            if !same {
                problems.push(refusal(
                    &format!("walls[{n}].{field}"),
                    format!("changed for the wall `{}`", wall.name),
                    "a restart may not change this: the saved contacts belong to the original wall",
                    "remove this wall and add one with another name",
                ));
            }
        }
    }
    problems
}

/// Returns for each new wall the index of the old wall of the same name, or on the same face of the domain.
fn wall_origins(old: &[SceneWall], new: &[SceneWall]) -> Vec<Option<usize>> {
    new.iter()
        .map(|wall| {
            old.iter()
                .position(|before| before.name == wall.name && before.face == wall.face)
        })
        .collect()
}

/// Returns for each new region the index of the old region of the same name.
fn region_origins(old: &Plan, new: &Plan) -> Result<Vec<Option<usize>>, Error> {
    let generates = |plan: &Plan| {
        let regions = plan.scene.regions.iter();
        regions
            .clone()
            .position(|region| matches!(region.action, RegionAction::Generate { .. }))
    };
    if let (None, Some(n)) = (generates(old), generates(new)) {
        return Err(Error::Case(vec![refusal(
            &format!("regions[{n}].action.generate"),
            "new".into(),
            "the original run did not generate grains, so that the free ids are not known",
            "start a new run with this change",
        )]));
    }
    let regions = new.scene.regions.iter();
    Ok(regions
        .map(|region| {
            old.scene
                .regions
                .iter()
                .position(|before| before.name == region.name)
        })
        .collect())
}

/// Returns the regions that generate grains at another rate, or up to another number, than before.
fn changed_feeds(old: &Plan, new: &Plan, origins: &[Option<usize>]) -> Vec<usize> {
    let feed = |action: &RegionAction| match action {
        RegionAction::Generate { rate, at_most, .. } => Some((*rate, *at_most)),
        _ => None,
    };
    let regions = new.scene.regions.iter().zip(origins).enumerate();
    regions
        .filter(|(_, (region, origin))| {
            let before = origin.and_then(|n| feed(&old.scene.regions[n].action));
            feed(&region.action).is_some_and(|now| before != Some(now))
        })
        .map(|(n, _)| n)
        .collect()
}

/// Sets the velocities of walls to those of the case, which may be newer than those of the checkpoint. A servo wall
/// keeps its own velocity.
pub(super) fn drive_walls<S: Space>(plan: &Plan, dem: &mut Dem<S>) {
    let walls = setup::walls::<S>(plan);
    let walls = walls.iter().zip(&plan.scene.walls).zip(dem.walls());
    let velocities: Vec<S::Vector> = walls
        .map(|((wall, scene), now)| {
            // The tables set the velocity before the next step.
            let keeps = scene.servo.is_some() || scene.history.is_some();
            if keeps { now.velocity } else { wall.velocity }
        })
        .collect();
    dem.drive_walls(&velocities);
}

/// Checks that no grain overlaps a wall that a restart adds. Collective.
pub(super) fn check_new_walls<S: Space>(
    plan: &Plan,
    origins: &[Option<usize>],
    gates: &Gates,
    step: u64,
    particles: &Particles<S>,
    domain: &Domain,
) -> Result<(), Error> {
    let new = origins.iter().enumerate();
    let new = new.filter(|(n, origin)| origin.is_none() && !gates.wall_is_absent(step, *n));
    check_clearance(plan, new.map(|(n, _)| n), particles, domain).map_err(|reason| {
        Error::Case(vec![refusal(
            "walls",
            "new".into(),
            reason,
            "or remove the wall",
        )])
    })
}
