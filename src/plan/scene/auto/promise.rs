//! Error promised by the plan: a bound with a confidence of 95 %, from measured rows for the features of the scene.
//!
//! Every feature of the scene ([`features`](super::features)) has its bound ([`Bound`]). The promised error is the
//! largest bound, plus 3 (U dt/h)² for the compressibility of the lattice or, if larger, the density change by the
//! pressure loss along the flow, plus the effect of sound in an oscillating flow and of rounding in collisions in f32.
//! If a feature, an operator or a motion lies outside the measured range, or the sound of a sudden start has not
//! decayed, nothing is promised, and the plan states why.

use super::bound::Bound;
use super::density::{self, Cause};
use super::features::{self, Feature};
use super::{Subject, sound, step};
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use crate::scene::{Scene, rounding};
use case::Case;
use case::fluid::{LatticeBoltzmann, Precision};
use case::grains::GrainSource;

/// Maximum lattice velocity U dt/h for a promise.
const MAX_LATTICE_VELOCITY: f64 = 0.1;

/// Feature with its cells and its bound, or the reason why it has none.
struct Judged<'a> {
    feature: &'a Feature,
    cells: f64,
    error: Result<(f64, &'static Bound), String>,
}

/// Computes the promised error for the cells of a scene, chosen or stated.
pub(crate) fn compute_promise(
    scene: &mut Scene,
    case: &Case,
    lbm: &LatticeBoltzmann,
    target: f64,
    findings: &mut Findings,
) {
    let Some(flow) = &scene.flow else { return };
    let speed = step::fastest(scene, flow).map_or(0.0, |speed| speed.value);
    let features = features::case_features(case, lbm, Some(scene), Some(speed));
    let judged: Vec<Judged<'_>> = features
        .iter()
        .map(|f| of_feature(scene, lbm, f, speed))
        .collect();
    let lattice_velocity = speed * flow.time_step / scene.grid.spacing;
    let new = unmeasured(scene, case, flow, &judged, lattice_velocity, target);
    let known = judged
        .iter()
        .filter_map(|j| Some((j, j.error.as_ref().ok()?)));
    let worst = known.max_by(|a, b| a.1.0.total_cmp(&b.1.0));
    scene.chosen.details = judged.iter().map(Judged::line).collect();
    if !new.is_empty() {
        promise_nothing(scene, &new, findings);
        return;
    }
    let Some((judged, (error, bound))) = worst else {
        return;
    };
    let compressibility = 3.0 * lattice_velocity * lattice_velocity;
    let waves = sound::waves(scene, flow);
    let of_sound = waves.map_or(0.0, |waves| waves.error(scene.grid.spacing, flow.time_step));
    let transit = sound::transit(scene, flow);
    let of_transit = transit.map_or(0.0, |transit| {
        transit.error(scene.grid.spacing, flow.time_step)
    });
    let losses: Vec<Cause> = (scene.density_causes.iter().filter(|cause| cause.is_loss()))
        .cloned()
        .collect();
    let of_losses = density::total(&losses, flow.time_step, scene.grid.spacing, flow.density);
    // Both are density changes by the pressure, so that the larger one counts.
    let of_rounding = match flow.arithmetic {
        Precision::F64 => 0.0,
        Precision::F32 => rounding::of_single(scene, flow),
    };
    let promised = error + compressibility.max(of_losses) + of_sound + of_transit + of_rounding;
    scene.chosen.promised = Some(promised);
    let cells = number(judged.cells);
    let what = &judged.feature.what;
    qualify_bodies(scene);
    let percent = |part: f64| number(100.0 * part);
    let mut parts = format!(
        "{} %; compressibility {} %",
        percent(*error),
        percent(compressibility)
    );
    if of_losses > 0.0005 {
        parts += &format!("; density along the flow {} %", percent(of_losses));
    }
    if waves.is_some() {
        parts += &format!("; sound {} %", percent(of_sound));
    }
    if transit.is_some() {
        parts += &format!(
            "; sound behind the changing inflow {} %",
            percent(of_transit)
        );
    }
    if of_rounding > 0.0 {
        parts += &format!("; rounding in f32 {} %", percent(of_rounding));
    }
    let text = format!(
        "{cells} cells across the {what}: {parts}, according to {rows} measured runs",
        rows = bound.rows
    );
    scene.chosen.note(Subject::Accuracy, text);
    if promised > target * (1.0 + 1e-9) {
        findings.warn(
            "accuracy",
            format!(
                "an error of {} % is requested, but with {cells} cells across the {what} the plan promises {} %",
                number(100.0 * target),
                number(100.0 * promised),
            ),
            "use a smaller spacing or another coupling, or request a lower accuracy",
        );
    }
}

/// Returns the features and motions of a scene without measured errors.
fn unmeasured(
    scene: &Scene,
    case: &Case,
    flow: &Flow,
    judged: &[Judged<'_>],
    lattice_velocity: f64,
    target: f64,
) -> Vec<String> {
    let mut new = Vec::new();
    new.extend(uncovered_models(scene, flow, lattice_velocity));
    new.extend(free_grain_warning(case));
    new.extend(sound_warning(scene, flow, target));
    if sound::transit(scene, flow).is_some_and(|transit| transit.jumps) {
        new.push(
            "no error was measured for an inflow that jumps, which sends sound through the domain"
                .into(),
        );
    }
    let beside = |feature: &Feature| feature.obstacle == features::STRUCTURES;
    let wet = scene.structures.iter().any(|s| s.stops.water());
    if wet && !judged.iter().any(|judged| beside(judged.feature)) {
        new.push("no error was measured for structures without an adjacent gap".to_owned());
    }
    for judged in judged {
        new.extend(judged.error.as_ref().err().cloned());
    }
    new.dedup();
    new
}

/// Records that nothing is promised, with the reasons.
fn promise_nothing(scene: &mut Scene, reasons: &[String], findings: &mut Findings) {
    let Some(first) = reasons.first() else { return };
    scene.chosen.details.extend(reasons.iter().cloned());
    let more = match reasons.len() - 1 {
        0 => String::new(),
        more => format!(", and {more} more reasons, which `solver plan --details` lists"),
    };
    let text = format!("nothing is promised: {first}{more}");
    scene.chosen.note(Subject::Accuracy, text);
    findings.warn(
        "accuracy",
        format!("the plan promises no error: {first}{more}"),
        "measure the error with `solver estimate`, which runs the case on several grids",
    );
}

/// Records the quantities for which the promise holds if bodies move.
fn qualify_bodies(scene: &mut Scene) {
    let crosses = |body: &NamedBody| {
        body.mobility != Mobility::Fixed && body.velocity.iter().any(|u| u.abs() > 0.0)
    };
    if scene.bodies.iter().any(crosses) {
        let text = "for bodies that cross cells, the promised error holds for the mean force over several cells, \
                    not for the force of a single step";
        scene.chosen.details.push(text.to_owned());
    }
    if scene
        .bodies
        .iter()
        .any(|body| body.mobility == Mobility::Free)
    {
        let text = "for bodies that move freely, the promised error holds for force and velocity, not for the \
                    angular velocity";
        scene.chosen.details.push(text.to_owned());
    }
}

impl Judged<'_> {
    /// Returns a line with the feature, its cells and its bound.
    fn line(&self) -> String {
        let Feature { what, size, .. } = self.feature;
        let found = match &self.error {
            Ok((error, bound)) => format!(
                "{} %, the 95 % confidence bound of {} measured rows: {}",
                number(100.0 * error),
                bound.rows,
                bound.problems.join(", ")
            ),
            Err(reason) => reason.clone(),
        };
        format!(
            "{what}, {} m, {} cells: {found}",
            number(*size),
            number(self.cells)
        )
    }
}

fn of_feature<'a>(
    scene: &Scene,
    lbm: &LatticeBoltzmann,
    feature: &'a Feature,
    speed: f64,
) -> Judged<'a> {
    let cells = feature.size / scene.grid.spacing;
    // Boundary layers in time do not depend on the speed of the water.
    let speed = if feature.obstacle == features::LAYERS {
        0.0
    } else {
        speed
    };
    let reynolds = speed * feature.size / lbm.kinematic_viscosity;
    let what = &feature.what;
    let error = match Bound::for_obstacle(scene.grid.dimension, feature.obstacle) {
        None => Err(format!("no error was measured for the {what} ({})", feature.obstacle)),
        Some(bound) => bound.error(cells, reynolds).map(|error| (error, bound)).ok_or_else(|| {
            if reynolds > bound.largest_reynolds() {
                format!(
                    "the Reynolds number of the {what} is {}, above {}, the largest that was measured",
                    number(reynolds),
                    number(bound.largest_reynolds())
                )
            } else {
                format!(
                    "{} cells across the {what} are fewer than the {} of any measured row",
                    number(cells),
                    number(bound.cells[0])
                )
            }
        }),
    };
    Judged {
        feature,
        cells,
        error,
    }
}

/// Returns the models and parameters of the lattice without measured rows.
fn uncovered_models(scene: &Scene, flow: &Flow, lattice_velocity: f64) -> Vec<String> {
    let mut new = Vec::new();
    let terms = scene
        .terms
        .iter()
        .filter_map(|term| term.model().unmeasured());
    new.extend(terms.map(|subject| format!("no error was measured for {subject}")));
    if flow.models.turbulence.is_some() {
        new.push("a turbulence model is used, whose error was not measured".to_owned());
    }
    let tau = flow.relaxation_time;
    if flow.models.collision.model().antisymmetric_rate().is_none() {
        new.push(
            "the errors were measured with two relaxation times (TRT), not with this operator"
                .to_owned(),
        );
    } else if !(MIN_TAU..=MAX_TAU).contains(&tau) {
        new.push(format!(
            "the relaxation time {} is outside the measured {MIN_TAU} to {MAX_TAU}",
            number(tau)
        ));
    }
    if lattice_velocity > MAX_LATTICE_VELOCITY * (1.0 + 1e-9) {
        new.push(format!(
            "the lattice velocity {} is above the measured {MAX_LATTICE_VELOCITY}",
            number(lattice_velocity)
        ));
    }
    new
}

/// Minimum relaxation time of the measured rows.
const MIN_TAU: f64 = 0.51;
/// Maximum relaxation time of the measured rows.
const MAX_TAU: f64 = 1.5 + 1e-9;

/// Reports the sound of a sudden start, which oscillates in the forces until it decays.
fn sound_warning(scene: &Scene, flow: &Flow, target: f64) -> Option<String> {
    let (body, left) = sound::left_of_a_start(scene, flow)?;
    (left > SOUND_SHARE * target).then(|| {
        format!(
            "the pressure waves of a sudden start are too large at the end of the run: {} % of those of `{}` \
             remain, and at most {} % are acceptable; run longer, or use a shorter time step",
            number(100.0 * left),
            body.name,
            number(100.0 * SOUND_SHARE * target)
        )
    })
}

/// Largest fraction of the target that the sound of a sudden start may contribute.
const SOUND_SHARE: f64 = 0.25;

/// Reports free grains: grains that approach each other leave gaps that no cells resolve.
fn free_grain_warning(case: &Case) -> Option<String> {
    let grains = case.grains.as_ref()?;
    let many = match &grains.initial {
        GrainSource::List(list) => list.len() > 1,
        _ => true,
    };
    many.then(|| "free grains approach each other more closely than in any measured run".to_owned())
}
