//! The plan of a scene: its models with reasons, the time steps, the margin to every limit, and the costs.
//!
//! [`Plan::prepare`] turns the text of a case into a plan. The plan owns the scene.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

mod added_mass;
mod arithmetic;
pub mod bibliography;
mod bodies;
pub mod citations;
pub mod contacts;
mod coupling_interval;
pub(crate) mod critical_step;
pub mod device;
mod drawings;
mod driven_path;
mod driven_plug;
mod driven_pocket;
mod driven_squeeze;
pub mod ends;
pub mod envelope;
pub mod estimate;
pub mod explicit_drag;
mod filling;
mod free_surface;
mod impacts;
pub mod interval;
mod joint_steps;
mod leaving;
mod levels;
mod linear_stability;
pub mod margin;
pub mod models;
mod outlets;
pub mod pore_flow;
mod remedies;
pub mod report;
mod resting;
mod sampling;
pub mod scene;
mod seepage;
mod servo;
mod sinking;
mod slots;
mod stability;
mod terms;
mod wall_insertion;
mod wall_travel;

use crate::scene::Scene;
use crate::scene::auto::step::divided;
use crate::scene::findings::{Findings, at_most, number, refused};
use crate::scene::flow::Flow;
use base::error::{Problem, Remedy, Severity};
use base::number::whole;
use base::units::LatticeUnits;
use case::annotation::Source;
use case::time::{Limits, SolidSteps, USUAL_SAFETY, WarmUp};
use case::{Case, Document};
use estimate::Estimate;
use interval::Interval;
use margin::{Margin, slower_clock};
use models::Choice;
use serde::Serialize;
use std::collections::BTreeMap;

/// All decisions made before the start of a run; equal on every rank.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// The resolved problem.
    pub scene: Scene,
    /// The chosen models, each with its reason.
    pub models: Vec<Choice>,
    /// Scales of the lattice, if there is one.
    pub units: Option<LatticeUnits>,
    /// Time steps.
    pub clock: Clock,
    /// The margin to each limit.
    pub margins: Vec<Margin>,
    /// Memory, disk and time.
    pub estimate: Estimate,
    /// Warnings.
    pub warnings: Vec<Problem>,
    /// Sources of values, by JSON path.
    pub sources: BTreeMap<String, Source>,
    /// The case as compact JSON, with sorted keys, without annotations and with `--set` applied.
    #[serde(skip)]
    pub case_text: String,
    /// blake3 of [`Plan::case_text`], in hexadecimal.
    pub case_hash: String,
}

/// Time steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Clock {
    /// Time step of the program \[s\]: that of the fluid, or of the grains if there is no fluid.
    pub time_step: f64,
    /// Number of steps after the warm-up.
    pub steps: u64,
    /// Number of solid steps per step.
    pub solid_steps_per_step: u32,
    /// Solid time step \[s\].
    pub solid_time_step: f64,
    /// Critical time step of the grains, 2 sqrt(m/k) \[s\]; none without moving bodies in contact.
    pub critical_solid_time_step: Option<f64>,
    /// Maximum number of warm-up steps.
    pub warm_up_steps: u64,
}

impl Clock {
    /// Returns the steps nearest to multiples of `interval` seconds.
    #[must_use]
    pub fn every(&self, interval: f64) -> Interval {
        Interval::new(interval, self.time_step)
    }

    /// Returns the smallest number of steps that take `interval` seconds or longer; at least 1.
    #[must_use]
    pub fn interval_to_steps(&self, interval: f64) -> u64 {
        steps(interval / self.time_step).max(1)
    }
}

/// Ratio of the end of the last step to the stated end above which a run warns.
const LATE: f64 = 1.1;
/// Maximum number of steps; more would never complete.
const MAX_STEPS: f64 = 1e13;

impl Plan {
    /// Resolves, checks and plans a case.
    ///
    /// # Errors
    /// If the case has errors; all findings are returned, warnings included.
    pub fn prepare(document: Document) -> Result<Self, Vec<Problem>> {
        Self::planned_from(document, None)
    }

    /// Plans a case that continues from the state of another: choices that both cases leave out are those of the
    /// other plan.
    ///
    /// # Errors
    /// If [`Self::prepare`] fails.
    pub fn prepare_like(document: Document, like: &Self) -> Result<Self, Vec<Problem>> {
        Self::planned_from(document, Some(like))
    }

    /// Warns if the pilot of the case was run for another case.
    fn warn_of_another_pilot(&mut self) {
        let pilot = self
            .scene
            .flow
            .as_ref()
            .and_then(|flow| flow.pilot.as_ref());
        let Some(pilot) = pilot else { return };
        if hash_without_pilot(&self.case_text).as_ref() != Some(&pilot.of) {
            self.warnings.push(Problem {
                path: "fluid.lattice_boltzmann.pilot.of".into(),
                value: pilot.of.clone(),
                reason: "the case has changed since its pilot ran, so that its speed and pressure may be \
                         different now".into(),
                remedy: "run `solver plan --pilot` again, or remove the field `pilot`".into(),
                severity: Severity::Warning,
            });
        }
    }

    fn planned_from(document: Document, like: Option<&Self>) -> Result<Self, Vec<Problem>> {
        let directory = document.case.directory.clone();
        let (plan, mut all, sources, canonical) = Self::judged_from(document, like);
        if !refused(&all) {
            remedies::judge((&canonical, &directory), like, &mut all);
        }
        match plan {
            Some(mut plan) if !refused(&all) => {
                plan.warnings = all;
                plan.sources = sources;
                plan.case_hash = blake3::hash(canonical.as_bytes()).to_hex().to_string();
                plan.case_text = canonical;
                plan.warn_of_another_pilot();
                let Clock {
                    time_step,
                    steps,
                    solid_steps_per_step,
                    ..
                } = plan.clock;
                log::info!(
                    "plan: {steps} steps of {time_step:.6e} s with {solid_steps_per_step} solid steps each, about \
                     {:.0} MB and {:.0} core-seconds; {} limits, {} warnings",
                    plan.estimate.memory_bytes / 1e6,
                    plan.estimate.seconds_on_one_core,
                    plan.margins.len(),
                    plan.warnings.len()
                );
                for choice in &plan.models {
                    log::debug!(
                        "plan: {}: {}, for {}",
                        choice.what,
                        choice.model,
                        choice.reason
                    );
                }
                Ok(plan)
            }
            _ => {
                if !refused(&all) {
                    all.push(Problem::error(
                        "the case",
                        "unresolved",
                        "the case could not be resolved",
                        "correct the warnings first",
                    ));
                }
                Err(all)
            }
        }
    }

    /// Resolves, checks and plans a case, and returns all findings, the sources of its values and its text.
    fn judged_from(
        document: Document,
        like: Option<&Self>,
    ) -> (Option<Self>, Vec<Problem>, BTreeMap<String, Source>, String) {
        let Document {
            mut case,
            problems: mut all,
            sources,
            mut canonical,
        } = document;
        all.extend(drawings::replace(&mut case, &mut canonical));
        let is_error = |p: &Problem| p.severity == Severity::Error;
        let refused_fields = all.iter().filter(|p| is_error(p));
        let wrong: Vec<String> = refused_fields.map(|p| p.path.clone()).collect();
        let (plan, found) = Self::try_plan(&case, like, &wrong);
        // A field with an error does not get a second finding.
        let new: Vec<Problem> = found
            .into_iter()
            .filter(|p| !wrong.contains(&p.path))
            .collect();
        // An error of a field says more than a warning that the same field is null.
        let said = |known: &Problem| new.iter().any(|p| p.path == known.path && is_error(p));
        all.retain(|known| is_error(known) || !said(known));
        all.extend(new);
        (plan, all, sources, canonical)
    }

    /// Applies the speed of the present machine to the time estimate.
    pub fn on_machine(&mut self, machine: estimate::Machine) {
        self.estimate.on(machine, &self.scene, &self.clock);
    }

    /// Applies a number of ranks and threads to the time estimate; `crowded` is the speed of each core when all of them
    /// compute, relative to a single core.
    pub fn on_cores(&mut self, ranks: usize, threads: usize, crowded: f64) {
        self.estimate.on_cores(&self.scene, ranks, threads, crowded);
    }

    fn try_plan(
        case: &Case,
        like: Option<&Self>,
        wrong: &[String],
    ) -> (Option<Self>, Vec<Problem>) {
        let (scene, mut findings) =
            Scene::resolve_findings(case, like.map(|plan| &plan.scene), wrong);
        // Limits computed from wrong fields would be wrong as well.
        let sound = scene.filter(|_| !findings.stop_plan());
        let plan = sound.and_then(|scene| {
            let units = scene.flow.as_ref().map(|flow| flow.units(&scene.grid));
            let before = findings.problems.len();
            let clock = clock(&scene, like.map(|plan| &plan.clock), &mut findings)?;
            device::check(&scene, &mut findings);
            arithmetic::check(&scene, &mut findings);
            let margins = envelope::margins(&scene, &clock, &mut findings);
            if let Some(flow) = &scene.flow {
                let before = like.and_then(|plan| plan.scene.flow.as_ref());
                filling::check(&scene, flow, before, &mut findings);
            }
            if scene.guards.limits == Limits::Warn {
                let refused = |p: &&mut Problem| p.severity == Severity::Error;
                for problem in findings.problems[before..].iter_mut().filter(refused) {
                    problem.severity = Severity::Unstable;
                }
            }
            let estimate = Estimate::for_scene(&scene, &clock, &mut findings);
            Some(Self {
                models: models::choices(&scene, &clock),
                scene,
                units,
                clock,
                margins,
                estimate,
                warnings: Vec::new(),
                sources: BTreeMap::new(),
                case_text: String::new(),
                case_hash: String::new(),
            })
        });
        findings.drop_consequences();
        (plan, findings.problems)
    }
}

/// Returns the hash of the text of a case without its pilot; none if the text is not JSON.
#[must_use]
pub fn hash_without_pilot(text: &str) -> Option<String> {
    let mut tree: serde_json::Value = serde_json::from_str(text).ok()?;
    if let Some(water) = tree.pointer_mut("/fluid/lattice_boltzmann")
        && let Some(fields) = water.as_object_mut()
    {
        fields.remove("pilot");
    }
    Some(
        blake3::hash(tree.to_string().as_bytes())
            .to_hex()
            .to_string(),
    )
}

fn clock(scene: &Scene, like: Option<&Clock>, findings: &mut Findings) -> Option<Clock> {
    let time = &scene.time;
    let critical = critical_step::critical_solid_time_step(scene);
    let allowed = critical.map(|c| c.time_step * time.solid_time_step_safety);
    // A safety factor above the usual one is a choice of the case, which the plan judges but does not change.
    let chosen = time.solid_time_step_safety <= USUAL_SAFETY;
    let automatic = allowed.map(|step| {
        if chosen {
            contacts::longest_accepted_step(scene, step)
        } else {
            step
        }
    });
    let (time_step, solid_steps) = if let Some(like) = like {
        (like.time_step, like.solid_steps_per_step)
    } else if let Some(flow) = &scene.flow {
        let moved = scene.joints.as_ref();
        let steps = if moved.is_some_and(|joints| joints.movers > 0) {
            one_solid_step(scene, flow, automatic, findings);
            1
        } else {
            solid_steps_in_flow(scene, flow, allowed, automatic, findings)?
        };
        (flow.time_step, steps)
    } else if let Some(joints) = &scene.joints {
        let step = joints.written.time_step;
        if let Some(allowed) = allowed
            && step > allowed * (1.0 + 1e-12)
        {
            findings.error(
                "fluid.joints.time_step",
                format!(
                    "moving blocks use the same time step, and it is above {} times the critical time step of \
                     their contacts",
                    time.solid_time_step_safety
                ),
                Remedy::from(format!("use at most {:?} s", at_most(allowed)))
                    .set("fluid.joints.time_step", at_most(allowed)),
            );
        }
        (step, 1)
    } else {
        dry_step(scene, allowed, automatic, findings)
    };
    let total = time.end / time_step;
    if !(time_step > 0.0 && total.is_finite()) || total > MAX_STEPS {
        findings.error(
            "time.end",
            format!(
                "this takes {} steps of {} s; at most {MAX_STEPS:e} are allowed",
                number(total),
                number(time_step)
            ),
            "use a shorter time or longer steps",
        );
        return None;
    }
    check_end(scene, (time_step, total), solid_steps, findings);
    let warm_up_steps = match time.warm_up {
        Some(WarmUp::FluidOnly { at_most, .. }) if at_most / time_step <= MAX_STEPS => {
            steps(at_most / time_step)
        }
        Some(_) => {
            findings.error(
                "time.warm_up.fluid_only.at_most",
                "the warm-up would take too many steps to end",
                "use a shorter time",
            );
            return None;
        }
        None => 0,
    };
    Some(Clock {
        time_step,
        steps: steps(total).max(1),
        solid_steps_per_step: solid_steps,
        solid_time_step: time_step / f64::from(solid_steps),
        critical_solid_time_step: critical.map(|c| c.time_step),
        warm_up_steps,
    })
}

/// Warns if the last of a few long steps ends clearly after the end of the run. `total` is the number of steps, not
/// rounded.
fn check_end(
    scene: &Scene,
    (time_step, total): (f64, f64),
    solid_steps: u32,
    findings: &mut Findings,
) {
    let time = &scene.time;
    let steps = total.ceil().max(1.0);
    let steady = scene
        .seepage
        .as_ref()
        .is_some_and(|one| !one.is_transient());
    if steps <= LATE * total || steady && !scene.has_solids() {
        return;
    }
    let fitting = time.end / steps / f64::from(solid_steps);
    let remedy = match time.solid_time_step {
        Some(_) => Remedy::from(format!("use a solid time step of {} s", number(fitting)))
            .set("time.solid_time_step", at_most(fitting)),
        None => Remedy::from("use an end that is a whole number of steps".to_owned()),
    };
    findings.warn(
        "time.end",
        format!(
            "the run has {steps} step(s) of {} s and ends at {} s",
            number(time_step),
            number(steps * time_step)
        ),
        remedy,
    );
}

/// Refuses a step of the lattice that is too long for blocks which move with the water of joints, and several solid
/// steps in it: such blocks make exactly one.
fn one_solid_step(scene: &Scene, flow: &Flow, longest: Option<f64>, findings: &mut Findings) {
    let rule = "blocks that move with the water of joints make exactly one solid step in each lattice step";
    if let Some(longest) = longest.filter(|longest| flow.time_step > *longest) {
        let step = at_most(longest);
        let text = format!(
            "use a lattice time step of at most {} s, or softer contacts",
            number(step)
        );
        findings.error(
            "fluid.lattice_boltzmann.joints",
            format!(
                "{rule}, but that of {} s is above the longest stable step of their contacts, {} s",
                number(flow.time_step),
                number(longest)
            ),
            slower_clock(flow, scene.grid.spacing, step / flow.time_step, text),
        );
    }
    let path = "time.solid_steps_per_fluid_step";
    if let SolidSteps::Number(stated) = scene.time.solid_steps_per_fluid_step
        && stated != 1
    {
        findings.error(
            path,
            format!("{rule}, and {stated} are stated"),
            Remedy::from("use 1").set(path, 1),
        );
    }
}

/// Returns the solid steps in a step of the fluid; none if there would be too many.
fn solid_steps_in_flow(
    scene: &Scene,
    flow: &Flow,
    allowed: Option<f64>,
    automatic: Option<f64>,
    findings: &mut Findings,
) -> Option<u32> {
    let time = &scene.time;
    let needed = allowed.map_or(1.0, |a| (flow.time_step / a).ceil().max(1.0));
    let path = "time.solid_steps_per_fluid_step";
    if needed > 100_000.0 {
        let cause = critical_step::decisive(scene).map_or(String::new(), |grain| {
            format!(
                ": the lightest grain, of radius {} m and {} kg/m3 (`{}`), has a mass of {} kg",
                number(grain.radius),
                number(scene.density(grain.material)),
                scene.materials[grain.material].name,
                number(grain.mass)
            )
        });
        findings.error(
            path,
            format!(
                "stability requires {} solid steps per fluid step; at most 100000 are allowed{cause}",
                number(needed)
            ),
            "check the units of radius, density and stiffness; use softer contacts or a smaller fluid time step",
        );
        return None;
    }
    let needed = u32::try_from(whole(needed)).unwrap_or(u32::MAX);
    Some(match time.solid_steps_per_fluid_step {
        SolidSteps::Auto(_) => {
            let needed: f64 = automatic.map_or(1.0, |a| (flow.time_step / a).ceil().max(1.0));
            u32::try_from(whole(needed.min(1e5))).unwrap_or(u32::MAX)
        }
        SolidSteps::Number(n) => {
            if n < needed {
                findings.error(
                    path,
                    format!(
                        "the solid time step of {} s is above {} times the critical time step",
                        number(flow.time_step / f64::from(n.max(1))),
                        time.solid_time_step_safety
                    ),
                    Remedy::from(format!("use at least {needed}, or \"auto\"")).set(path, needed),
                );
            }
            n.max(1)
        }
    })
}

/// Returns the time step of a scene without a lattice, and the number of solid steps in it: in seepage, those between
/// two solutions.
fn dry_step(
    scene: &Scene,
    allowed: Option<f64>,
    automatic: Option<f64>,
    findings: &mut Findings,
) -> (f64, u32) {
    let time = &scene.time;
    let dt = time
        .solid_time_step
        .or(automatic)
        .unwrap_or(time.end / 1000.0);
    if let Some(allowed) = allowed
        && dt > allowed * (1.0 + 1e-12)
    {
        findings.error(
            "time.solid_time_step",
            format!(
                "the time step is above {} times the critical time step of the contacts",
                time.solid_time_step_safety
            ),
            Remedy::from(format!("use at most {:?} s", at_most(allowed)))
                .set("time.solid_time_step", at_most(allowed)),
        );
    }
    let steps = scene.seepage.as_ref().map_or(1, |seepage| {
        let longest = coupling_interval::limits(scene).map(|limits| limits.longest());
        seepage.coupling_interval(dt, longest)
    });
    let longest = dt * f64::from(steps);
    if time.solid_time_step.is_some() {
        let steps = fitting_interval(scene, dt, steps);
        (dt * f64::from(steps), steps)
    } else {
        // A shorter coupling interval needs fewer solid steps, unless the case states their number.
        let step = divided(scene, longest);
        let needed = whole((step / dt * (1.0 - 1e-9)).ceil().max(1.0));
        let needed = u32::try_from(needed).unwrap_or(steps).min(steps);
        let seepage = scene.seepage.as_ref();
        let stated = seepage.is_some_and(|s| s.written.coupling_interval.is_some());
        (step, if stated { steps } else { needed })
    }
}

/// Returns the number of solid steps between two solutions of transient seepage if the case states none: the largest,
/// at most `most`, whose multiples meet the end and the times of probes, outputs and checkpoints, as far as solid steps
/// meet them.
fn fitting_interval(scene: &Scene, dt: f64, most: u32) -> u32 {
    let free = |seepage: &scene::seepage::Seepage| {
        seepage.is_transient() && seepage.written.coupling_interval.is_none()
    };
    if !scene.seepage.as_ref().is_some_and(free) {
        return most;
    }
    let probes = scene.probes.iter().map(|probe| probe.every);
    let fields = scene.output.fluid.iter().map(|output| output.every);
    let grains = scene.output.grains.iter().map(|output| output.every);
    let times = probes
        .chain(fields)
        .chain(grains)
        .chain(scene.checkpoint.every);
    let in_steps = times.chain([scene.time.end]).map(|time| time / dt);
    let met: Vec<u64> = in_steps
        .filter(|n| *n >= 0.5 && (n - n.round()).abs() <= 1e-6 * n)
        .map(steps)
        .collect();
    let fits = |n: &u32| met.iter().all(|steps| steps.is_multiple_of(u64::from(*n)));
    (1..=most).rev().find(fits).unwrap_or(most)
}

/// Returns a number of steps: the nearest whole number if the value is one to round-off, otherwise the next larger.
fn steps(x: f64) -> u64 {
    let nearest = x.round();
    let exact = (x - nearest).abs() <= 1e-9 * x.abs().max(1.0);
    u64::try_from(whole(if exact { nearest } else { x.ceil() })).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Returns the findings on the end of the drawdown, with a solid time step \[s\] and an end \[s\]. An interval of
    /// the seepage is stated as ten solid steps.
    fn findings(step: f64, end: f64) -> Vec<Problem> {
        let text = case::examples::find("drawdown").unwrap().text;
        let set = [
            format!("time.solid_time_step={step}"),
            format!("time.end={end}"),
            "fluid.darcy.coupling_interval=10".to_owned(),
        ];
        let document = Document::read(text, &set, Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings.into_iter();
        warnings.filter(|one| one.path == "time.end").collect()
    }

    #[test]
    fn a_step_longer_than_the_run_is_warned_of_with_one_that_fits() {
        assert_eq!(findings(3600.0, 864_000.0), []);
        assert_eq!(findings(3600.0, 850_000.0), []);
        let found = findings(144_000.0, 432_000.0);
        assert_eq!(found.len(), 1);
        assert!(found[0].reason.contains("ends at 1.440e6 s"), "{found:?}");
        assert_eq!(findings(43_200.0, 432_000.0), []);
        let text = serde_json::to_string(&found).unwrap();
        assert!(text.contains("use a solid time step of 43200 s"), "{text}");
    }
}
