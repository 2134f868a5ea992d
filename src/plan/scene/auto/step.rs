//! Time step of the lattice, and the choices that depend on it: operator, velocity set, eddy viscosity, storage
//! precision.
//!
//! The step is the longest that satisfies these limits:
//!
//! - the compressibility error, proportional to (U/c_s)² = 3 (U/C)², is at most a quarter of the target: U/C is at
//!   most (target/12)^½, and 0.1;
//! - the relaxation time is at most 1.5, up to which the rows measured with two relaxation times do not change;
//! - the density change under imposed pressures, and that by the pressure loss along the flow, are at most half the
//!   target, and 3 %;
//! - the sum of all density changes that the flow needs ([`super::density`]) is at most three quarters of
//!   `guards.max_compression`;
//! - the density change by the sound of drives that change gradually (ramps, tables) is at most 3 %, unless the
//!   relaxation time would fall below the range of two relaxation times: a warning then states the change;
//! - at least 200 steps in a period, 100 in the run, one in every output interval;
//! - sound passes four times between openings, and pressures upstream of narrow passages have risen
//!   ([`super::sound`]), before the end or before averages begin, unless the relaxation time would fall below the
//!   range of two relaxation times.
//!
//! It is then shortened so that the intervals of probes and outputs are whole numbers of steps, or lengthened where a
//! shorter one would not be stable ([`match_intervals`]).
//!
//! Two relaxation times are stable from tau = 0.51 on, with openings from 0.55, in 2-D and around moving bodies up
//! to a cell Reynolds number of 7. Below this range the choice in 3-D is cumulants on D3Q27; in 2-D the cells
//! become finer, up to a factor, and beyond that the case is refused: neither TRT nor BGK with the Smagorinsky
//! model completed such runs. If the cells are larger than four Kolmogorov lengths eta = L Re^(-3/4), the WALE
//! model represents the unresolved eddies (Pope 2000, section 6.1, for eta; DNS needs about 2 eta).

use super::density::DensityBound;
use super::gaps::Gap;
use super::{Limit, Subject, density, sound};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::check_operator;
use crate::scene::flow::{BodyForce, Flow, Lattice, PATH};
use crate::scene::initial::Initial;
use crate::scene::packed::{in_a_bed, lie_packed};
use crate::scene::speed::{self, Speed};
use crate::scene::terms;
use base::error::Remedy;
use base::number::{real, whole};
use base::units::LatticeUnits;
use case::coupling::{Coupling, SolidOperator};
use case::fluid::{Collision, LatticeBoltzmann, LatticeChoice, Precision, Turbulence};
use lbm::collision::cumulant;
use lbm::turbulence::wale::Wale;
use serde_json::json;

/// Maximum relaxation time.
const MAX_TAU: f64 = 1.5;
/// Minimum relaxation time of operators with two relaxation times, without and with openings: behind the uniform
/// inlet of a flume runs failed at 0.5302 and were stable at 0.5491.
const MIN_TAU: f64 = 0.51;
const MIN_TAU_AT_OPENINGS: f64 = 0.55;
/// Minimum relaxation time in 2-D of a step that was shortened to divide the intervals of samples, [`SHORTEST`] of the
/// way from 0.5 to [`MIN_TAU`]. The cell Reynolds number keeps its bound: in the maps `cavity-32`, `cylinder-10` and
/// `shear-layers-64` two relaxation times finished at 0.503 and a cell Reynolds number of 10.
const MIN_TAU_SHORTENED: f64 = 0.5 + SHORTEST * (MIN_TAU - 0.5);
/// Maximum cell Reynolds number for two relaxation times, between openings in 2-D and around moving bodies with
/// links: runs failed from 11 and from 12 on.
const MAX_CELL_REYNOLDS: f64 = 7.0;
/// Usual upper bound of the lattice velocity, stated as "typically lower than" by Sibille, Lominé and Marot (2012).
const USUAL_MACH: f64 = 0.1;
/// Fraction of `guards.max_compression` that the sum of all density changes may reach.
const GUARD_SHARE: f64 = 0.75;
/// Maximum relative density change.
const MAX_COMPRESSION: f64 = 0.03;
/// Minimum number of steps in a period of an oscillation, and in the run.
const STEPS_IN_A_PERIOD: f64 = 200.0;
const STEPS_IN_A_RUN: f64 = 100.0;
/// Reynolds number above which a flow may be turbulent, and maximum width of a cell in Kolmogorov lengths.
const TURBULENT: f64 = 1000.0;
const KOLMOGOROV_LENGTHS: f64 = 4.0;
/// Constant of WALE (Nicoud and Ducros 1999).
const WALE: f64 = 0.5;
/// Minimum target for which f32 is accurate enough.
const DRAFT: f64 = 0.1;

/// Returns the smallest relaxation time at which operators with two relaxation times are stable at a lattice
/// velocity.
fn least_tau(scene: &Scene, flow: &Flow, lattice_velocity: f64) -> f64 {
    least_tau_from(MIN_TAU, scene, flow, lattice_velocity)
}

/// Returns the result of [`least_tau`] with another least value in 2-D.
fn least_tau_from(least: f64, scene: &Scene, flow: &Flow, lattice_velocity: f64) -> f64 {
    let least = if scene.grid.dimension == 2 {
        least
    } else {
        MIN_TAU
    };
    let opens = flow
        .patches()
        .any(|patch| patch.condition.model().passes_water());
    let bounded = 0.5 + 3.0 * lattice_velocity / MAX_CELL_REYNOLDS;
    let links = matches!(scene.coupling, Some(Coupling::BounceBack(_)));
    match (opens, scene.grid.dimension) {
        (true, 3) => MIN_TAU_AT_OPENINGS,
        (true, _) => bounded.clamp(least, MIN_TAU_AT_OPENINGS),
        (false, _) if links && speed::through_the_fluid(scene, flow).is_some() => {
            bounded.max(least)
        }
        (false, _) => least,
    }
}

fn mach(target: f64) -> f64 {
    (target / 12.0).sqrt().min(USUAL_MACH)
}

/// Returns the largest expected speed of water and solids; none if nothing drives them.
pub(crate) fn fastest(scene: &Scene, flow: &Flow) -> Option<Speed> {
    let speeds = speed::all(scene, flow).into_iter();
    speeds.max_by(|a, b| a.value.total_cmp(&b.value))
}

/// Returns the spacing \[m\] below which two relaxation times are stable at this speed; none if any spacing is. The
/// time step is the longest allowed by the compressibility error or the sound of a start.
pub(crate) fn stable_spacing(scene: &Scene, flow: &Flow, speed: f64, target: f64) -> Option<f64> {
    let sound: f64 = scene
        .density_causes
        .iter()
        .map(|cause| cause.sound * cause.velocity)
        .sum();
    let most = GUARD_SHARE * scene.guards.max_compression * speed / sound;
    let mach = if sound > 0.0 {
        mach(target).min(0.9 * most)
    } else {
        mach(target)
    };
    let h = 3.0 * mach * flow.kinematic_viscosity / ((least_tau(scene, flow, mach) - 0.5) * speed);
    h.is_finite().then_some(h)
}

/// Chooses the values that the case leaves out.
pub(crate) fn choose(
    scene: &mut Scene,
    lbm: &LatticeBoltzmann,
    target: f64,
    narrow_gaps: &[(usize, Gap)],
    findings: &mut Findings,
) {
    let Some(mut flow) = scene.flow.take() else {
        return;
    };
    let speed = fastest(scene, &flow);
    let mut least = MIN_TAU;
    if flow.fixed_by == "accuracy" {
        least = time_step(scene, &mut flow, speed.as_ref(), target, narrow_gaps);
        warn_of_sound(scene, &flow, findings);
        check_operator(lbm, flow.relaxation_time, findings);
    }
    eddies(scene, &mut flow, lbm, speed.as_ref().map(|s| s.value));
    operator(scene, &mut flow, lbm, least, findings);
    storage(scene, &mut flow, lbm, target);
    scene.flow = Some(flow);
}

/// Returns the density causes of drives that change gradually.
fn gradual(scene: &Scene) -> Vec<density::Cause> {
    let causes = scene.density_causes.iter();
    causes.filter(|cause| cause.is_gradual()).cloned().collect()
}

/// Warns of gradual changes of a drive whose sound the chosen time step does not keep small.
fn warn_of_sound(scene: &Scene, flow: &Flow, findings: &mut Findings) {
    let (h, dt) = (scene.grid.spacing, flow.time_step);
    let causes = gradual(scene);
    let change = density::total(&causes, dt, h, flow.density);
    let of = DensityBound {
        bound: MAX_COMPRESSION,
        spacing: h,
        density: flow.density,
    };
    let Some((cause, step)) = density::longest_step(&causes, &of) else {
        return;
    };
    if change <= MAX_COMPRESSION * (1.0 + 1e-3) {
        return;
    }
    let reason = format!(
        "{} changes the density of the lattice fluid by up to {} %, which should be at most {} %: while the drive \
         changes, forces and pressures are those of sound; a shorter automatic step would leave the range of stable \
         relaxation times",
        cause.what,
        number(100.0 * change),
        number(100.0 * MAX_COMPRESSION)
    );
    let remedy = format!(
        "let the drive change over a longer time, ignore results while it changes, or use a smaller spacing, with \
         which a time step of {} s is stable",
        number(step)
    );
    findings.warn(&cause.path, reason, remedy);
}

/// Fraction of the target for the density change along the flow.
const LOSS_SHARE: f64 = 0.25;

/// Fraction of the target for sound in an oscillating flow.
const SOUND_SHARE: f64 = 0.125;
/// Fraction of the requested error by which an inflow that changes with time may be late.
const TRANSIT_SHARE: f64 = 0.25;

/// Minimum fraction of the longest time step to which it may be shortened to match sampling intervals.
const SHORTEST: f64 = 0.75;

/// Relative difference of intervals that is attributed to rounding.
const ROUNDING: f64 = 1e-9;

/// Returns the longest interval of which both intervals are multiples, to rounding; it approaches 0 if there is none.
fn common_interval(a: f64, b: f64) -> f64 {
    let (mut long, mut short) = (a.max(b), a.min(b));
    let least = ROUNDING * long;
    while short > least {
        let rest = long - (long / short).round() * short;
        (long, short) = (short, rest.abs());
    }
    long
}

/// Returns the interval \[s\] that time steps of about `longest` \[s\] should divide: of all samples and outputs, or
/// otherwise of the probes, or otherwise the shortest; none if all are shorter than [`SHORTEST`] of a step.
fn interval_to_divide(scene: &Scene, longest: f64) -> Option<f64> {
    let finite = |every: &f64| every.is_finite() && *every > 0.0;
    let all: Vec<f64> = intervals(scene).filter(finite).collect();
    let probes = scene.probes.iter().map(|probe| probe.every).filter(finite);
    let shortest = all.iter().copied().reduce(f64::min);
    let candidates = [
        all.iter().copied().reduce(common_interval),
        probes.reduce(common_interval),
        shortest,
    ];
    let fits = |every: &f64| *every >= SHORTEST * longest * (1.0 - ROUNDING);
    candidates.into_iter().flatten().find(fits)
}

/// Returns the longest time step of at most `longest` \[s\] that divides the intervals of samples and outputs: all
/// of them, or otherwise those of probes, or otherwise the shortest.
fn dividing(scene: &Scene, longest: f64) -> f64 {
    match interval_to_divide(scene, longest) {
        Some(every) => every / (every / longest * (1.0 - ROUNDING)).ceil().max(1.0),
        None => longest,
    }
}

/// Returns an automatic time step of at most `longest` \[s\] that divides the sampling intervals. If it would be
/// shorter than [`SHORTEST`] times `longest`, it stays `longest`, with samples at the nearest steps.
pub(crate) fn divided(scene: &Scene, longest: f64) -> f64 {
    let shorter = dividing(scene, longest);
    if shorter >= SHORTEST * longest {
        shorter
    } else {
        longest
    }
}

/// Returns the shortest time step of more than `longest` \[s\] that divides the intervals of samples and outputs;
/// infinite if there is none.
fn dividing_above(scene: &Scene, longest: f64) -> f64 {
    let every = interval_to_divide(scene, longest).unwrap_or(f64::INFINITY);
    every / (every / longest * (1.0 - ROUNDING)).floor()
}

/// Changes the time step so that it divides the sampling intervals; returns the least relaxation time in 2-D by which
/// it is judged.
///
/// The step becomes shorter, but not shorter than [`SHORTEST`] times its value. Where two relaxation times would no
/// longer be stable it becomes longer instead, up to `most` \[s\]; where that is too long, it becomes shorter if
/// the program may use another operator. Otherwise it stays unchanged, with samples at the nearest steps.
fn match_intervals(scene: &Scene, flow: &mut Flow, speed: f64, most: f64) -> f64 {
    let (h, nu, longest) = (scene.grid.spacing, flow.kinematic_viscosity, flow.time_step);
    let shorter = dividing(scene, longest);
    let holds = |least: f64, time_step: f64| {
        let tau = 0.5 + 3.0 * nu * time_step / (h * h);
        tau >= least_tau_from(least, scene, flow, speed * time_step / h) * (1.0 - ROUNDING)
    };
    // Other operators are stable at shorter steps, as cumulants are in 3-D; one rate is not judged by this range.
    let judged = matches!(flow.models.collision, Collision::Trt(_)) && holds(MIN_TAU, longest);
    if shorter < SHORTEST * longest || shorter >= longest {
        return MIN_TAU;
    }
    if !judged || holds(MIN_TAU, shorter) {
        flow.time_step = shorter;
        return MIN_TAU;
    }
    if holds(MIN_TAU_SHORTENED, shorter) {
        flow.time_step = shorter;
        return MIN_TAU_SHORTENED;
    }
    let longer = dividing_above(scene, longest);
    if longer <= most && SHORTEST * longer <= longest {
        flow.time_step = longer;
    } else if scene.grid.dimension == 3 {
        flow.time_step = shorter;
    }
    MIN_TAU
}

/// Returns `true` if the intervals of all probes are whole numbers of steps.
fn samples_evenly(scene: &Scene, time_step: f64) -> bool {
    let mut steps = scene.probes.iter().map(|probe| probe.every / time_step);
    steps.all(|steps| !steps.is_finite() || (steps - steps.round()).abs() <= 1e-6 * steps.max(1.0))
}

/// Sets the longest time step within all limits that divides the intervals of samples, and notes which limit binds;
/// returns the least relaxation time in 2-D by which the step is judged.
fn time_step(
    scene: &mut Scene,
    flow: &mut Flow,
    speed: Option<&Speed>,
    target: f64,
    narrow_gaps: &[(usize, Gap)],
) -> f64 {
    let (limits, firm) = limits(scene, flow, speed, target, narrow_gaps);
    let mut least = MIN_TAU;
    let shortest = limits
        .iter()
        .min_by(|a, b| a.time_step.total_cmp(&b.time_step));
    if let Some(limit) = shortest {
        flow.time_step = limit.time_step;
        least = match_intervals(scene, flow, speed.map_or(0.0, |speed| speed.value), firm);
        flow.relaxation_time = flow
            .units(&scene.grid)
            .relaxation_time(flow.kinematic_viscosity);
        let mut text = format!("the longest time step that allows {}", limit.what);
        if flow.time_step < limit.time_step * (1.0 - ROUNDING) {
            text += ", shortened so that the intervals of samples are multiples of it";
        } else if flow.time_step > limit.time_step * (1.0 + ROUNDING) {
            text += ", lengthened so that the intervals of samples are multiples of it";
        } else if !samples_evenly(scene, flow.time_step) {
            text += "; the intervals of probes are not multiples of it, so that samples lie at the nearest steps";
        }
        let sudden = scene.density_causes.iter();
        let sudden = sudden
            .filter(|cause| cause.sound > 0.0 && cause.pressure == 0.0 && !cause.is_gradual());
        let of =
            |cause: &density::Cause| cause.change(flow.time_step, scene.grid.spacing, flow.density);
        let largest = sudden.max_by(|a, b| of(a).total_cmp(&of(b)));
        if let Some(cause) = largest.filter(|cause| of(cause) > MAX_COMPRESSION) {
            text += &format!(
                "; {} changes the density by up to {} % until it has decayed",
                cause.what,
                number(100.0 * of(cause))
            );
        }
        scene.chosen.note(Subject::TimeStep, text);
    }
    scene.chosen.limits = limits;
    least
}

/// Returns the limits of the time step, and the longest step \[s\] by all of them that were not raised to the stable
/// range.
fn limits(
    scene: &Scene,
    flow: &Flow,
    speed: Option<&Speed>,
    target: f64,
    narrow_gaps: &[(usize, Gap)],
) -> (Vec<Limit>, f64) {
    let (h, nu) = (scene.grid.spacing, flow.kinematic_viscosity);
    let mut limits = Vec::new();
    let mut add = |what: String, time_step: f64| {
        if time_step.is_finite() && time_step > 0.0 {
            limits.push(Limit { what, time_step });
        }
    };
    add(
        format!("a relaxation time of {MAX_TAU}"),
        LatticeUnits::time_step_for(MAX_TAU, h, nu),
    );
    if let Some(speed) = speed {
        let mach = mach(target);
        let what = format!(
            "a lattice velocity of {} at the {} m/s of {}",
            number(mach),
            number(speed.value),
            speed.what
        );
        add(what, mach * h / speed.value);
    }
    for limit in density_limits(scene, flow, target) {
        add(limit.what, limit.time_step);
    }
    if let Some(tau) = longest_in_a_bed(scene, flow) {
        add(
            format!("a relaxation time of {tau}, at which the bed of grains is stable"),
            LatticeUnits::time_step_for(tau, h, nu),
        );
    }
    let fastest = speed.map_or(0.0, |speed| speed.value);
    if let Some(limit) = terms::step_limit(&scene.terms, fastest) {
        // The eddy viscosity is chosen later, if the water is fast.
        let eddies = speed.is_some() && scene.grid.dimension == 3;
        add(
            limit.requirement,
            if eddies {
                limit.with_eddies
            } else {
                limit.stable
            },
        );
    }
    if let Some(tension) = scene.surface.as_ref().and_then(|surface| surface.tension) {
        add(
            "the shortest capillary waves".into(),
            tension.step_limit(flow.density, h),
        );
    }
    if let BodyForce::Oscillating { period, .. } = flow.body_force {
        add(
            format!("{STEPS_IN_A_PERIOD} steps in a period"),
            period / STEPS_IN_A_PERIOD,
        );
    }
    add(
        format!("{STEPS_IN_A_RUN} steps in the run"),
        scene.time.end / STEPS_IN_A_RUN,
    );
    let shortest = intervals(scene).fold(f64::INFINITY, f64::min);
    add("an output in every interval".into(), shortest);
    let fastest = mach(target).min(
        speed.map_or(0.0, |speed| speed.value) * LatticeUnits::time_step_for(MIN_TAU, h, nu) / h,
    );
    let stable = LatticeUnits::time_step_for(least_tau(scene, flow, fastest), h, nu);
    let mut firm = limits
        .iter()
        .map(|limit| limit.time_step)
        .fold(f64::INFINITY, f64::min);
    for limit in sound_limits(scene, flow, target, narrow_gaps) {
        if limit.time_step >= stable {
            firm = firm.min(limit.time_step);
        }
        let time_step = limit.time_step.max(stable);
        if time_step.is_finite() && time_step > 0.0 {
            limits.push(Limit { time_step, ..limit });
        }
    }
    (limits, firm)
}

/// Returns the longest steps by sound and by pressures that build up; they give way to the shortest stable step.
fn sound_limits(
    scene: &Scene,
    flow: &Flow,
    target: f64,
    narrow_gaps: &[(usize, Gap)],
) -> Vec<Limit> {
    let (h, nu) = (scene.grid.spacing, flow.kinematic_viscosity);
    let mut limits = Vec::new();
    let mut add = |what: String, time_step: f64| limits.push(Limit { what, time_step });
    if let Some((what, time_step)) = sound::passages(scene, flow) {
        add(what, time_step);
    }
    if let Some(transit) = sound::transit(scene, flow) {
        let (what, time_step) = transit.longest_step(h, TRANSIT_SHARE * target);
        add(what, time_step);
    }
    if let Some(waves) = sound::waves(scene, flow) {
        let (what, time_step) = waves.longest_step(h, SOUND_SHARE * target);
        add(what, time_step);
    }
    let causes = gradual(scene);
    let of = DensityBound {
        bound: MAX_COMPRESSION,
        spacing: h,
        density: flow.density,
    };
    if let Some((cause, time_step)) = density::longest_step(&causes, &of) {
        let what = format!(
            "a density change of {} % by {}",
            number(100.0 * MAX_COMPRESSION),
            cause.what
        );
        add(what, time_step);
    }
    for (axis, gap) in narrow_gaps.iter().filter(|(_, gap)| gap.width > 0.0) {
        let (what, time_step) = sound::building_up(scene, nu, *axis, gap);
        add(what, time_step);
    }
    limits
}

/// Returns the longest steps by changes of density: under the largest pressure, at the guard, and along the flow.
fn density_limits(scene: &Scene, flow: &Flow, target: f64) -> Vec<Limit> {
    let h = scene.grid.spacing;
    let mut limits = Vec::new();
    let mut add = |what: String, time_step: f64| limits.push(Limit { what, time_step });
    let compression = MAX_COMPRESSION.min(LOSS_SHARE * target);
    let pressure = largest_pressure(scene, flow);
    add(
        format!(
            "a density change of {} % under {} Pa",
            number(100.0 * compression),
            number(pressure)
        ),
        h * (compression * flow.density / (3.0 * pressure)).sqrt(),
    );
    let guard = GUARD_SHARE * scene.guards.max_compression;
    for (bound, steady) in [(guard, false), (compression, true)] {
        let of = DensityBound {
            bound,
            spacing: h,
            density: flow.density,
        };
        let causes: Vec<density::Cause> = scene
            .density_causes
            .iter()
            .filter(|cause| !steady || cause.is_loss())
            .cloned()
            .collect();
        if let Some((cause, time_step)) = density::longest_step(&causes, &of) {
            let what = format!(
                "a density change of {} %{}, mainly by {}",
                number(100.0 * bound),
                if steady { " along the flow" } else { "" },
                cause.what
            );
            add(what, time_step);
        }
    }
    limits
}

/// Returns the largest relaxation time at which packed grains are heavy enough for stability in the water between
/// them, with a margin of a tenth; none if they are at [`MAX_TAU`], or at no relaxation time, which the plan then
/// reports.
fn longest_in_a_bed(scene: &Scene, flow: &Flow) -> Option<f64> {
    let coupling = scene.coupling.as_ref()?;
    let grains = scene.grains.as_ref()?;
    let (smallest, _) = grains.radii?;
    let operator = match coupling {
        Coupling::PartiallySaturated(written) => written
            .solid_operator
            .unwrap_or(SolidOperator::ViscosityMatched),
        Coupling::BounceBack(_) => return None,
    };
    if !lie_packed(scene) {
        return None;
    }
    let radius = smallest * coupling.hydraulic_radius_factor() / scene.grid.spacing;
    let flat = scene.grid.dimension == 2;
    let lightest = grains
        .materials()
        .map(|material| scene.density(material) / flow.density)
        .fold(f64::INFINITY, f64::min);
    let holds = |tau: f64| 1.1 * in_a_bed(coupling, Some(operator), tau, flat, radius) <= lightest;
    // Search in steps of 0.05 down to where the bound is at its minimum.
    let mut times = (12..=whole(20.0 * MAX_TAU)).rev().map(|n| real(n) / 20.0);
    times.find(|tau| holds(*tau)).filter(|tau| *tau < MAX_TAU)
}

/// Returns the largest pressure \[Pa\]: imposed, initial, or of the water column.
fn largest_pressure(scene: &Scene, flow: &Flow) -> f64 {
    let imposed = flow.patches().filter_map(|patch| {
        let pressure = patch.condition.model().pressure()?;
        Some(pressure.amplitude())
    });
    let start = match flow.initial {
        Initial::Uniform { pressure, .. } => pressure.abs(),
        _ => 0.0,
    };
    let column: f64 = (0..scene.grid.dimension)
        .filter(|a| flow.gravity_acts[*a] && !scene.grid.periodic[*a])
        .map(|a| flow.density * scene.gravity[a].abs() * scene.grid.size[a])
        .sum();
    imposed.chain([start, column]).fold(0.0, f64::max)
}

/// Returns the intervals of samples and outputs \[s\].
pub(super) fn intervals(scene: &Scene) -> impl Iterator<Item = f64> {
    let output = &scene.output;
    let fields = output.fluid.iter().map(|output| output.every);
    let grains = output.grains.iter().map(|output| output.every);
    let averages = output.averages.iter().map(|output| output.sample_every);
    let probes = scene.probes.iter().map(|probe| probe.every);
    fields.chain(grains).chain(averages).chain(probes)
}

/// Returns the size of the smallest obstacle in the water \[m\], which determines the size of the eddies.
fn smallest(scene: &Scene) -> f64 {
    let bodies = scene.bodies.iter().map(|body| 2.0 * body.radius);
    let grains = scene.grains.iter().filter_map(|g| g.radii);
    let walls = (0..scene.grid.dimension).filter(|a| !scene.grid.periodic[*a]);
    let walls = walls.map(|a| scene.grid.size[a]);
    let all = bodies.chain(grains.map(|r| 2.0 * r.0)).chain(walls);
    let smallest = all.fold(f64::INFINITY, f64::min);
    let whole = scene.grid.size[..scene.grid.dimension].iter().copied();
    if smallest.is_finite() {
        smallest
    } else {
        whole.fold(f64::INFINITY, f64::min)
    }
}

/// Chooses an eddy viscosity if eddies are smaller than the cells, unless the case states one.
fn eddies(scene: &mut Scene, flow: &mut Flow, lbm: &LatticeBoltzmann, speed: Option<f64>) {
    if lbm.turbulence.is_some() {
        return;
    }
    let size = smallest(scene);
    let reynolds = speed.unwrap_or(0.0) * size / flow.kinematic_viscosity;
    let kolmogorov = size * reynolds.powf(-0.75);
    let (model, text) = if scene.grid.dimension == 3
        && reynolds > TURBULENT
        && scene.grid.spacing > KOLMOGOROV_LENGTHS * kolmogorov
    {
        let text = format!(
            "the Reynolds number is {} for a length of {} m, so that there are eddies of {} m, and cells are {} \
             m wide",
            number(reynolds),
            number(size),
            number(kolmogorov),
            number(scene.grid.spacing)
        );
        (Some(Turbulence::Wale(Wale { constant: WALE })), text)
    } else {
        let text = format!(
            "the Reynolds number is {}: all eddies are resolved",
            number(reynolds)
        );
        (None, text)
    };
    flow.models.turbulence = model;
    scene.chosen.note(Subject::Turbulence, text);
}

/// Chooses the cheapest operator that is stable at the relaxation time, and the velocity set that it needs; `least` is
/// the least relaxation time in 2-D.
fn operator(
    scene: &mut Scene,
    flow: &mut Flow,
    lbm: &LatticeBoltzmann,
    least: f64,
    findings: &mut Findings,
) {
    let speed = fastest(scene, flow).map_or(0.0, |speed| speed.value);
    let tau = flow.relaxation_time;
    let least = least_tau_from(
        least,
        scene,
        flow,
        speed * flow.time_step / scene.grid.spacing,
    );
    if lbm.collision.is_none() {
        let fast = tau < least || flow.models.turbulence.is_some();
        // A stated D3Q19, or an operator that scales two relaxation times, leaves no choice.
        let matched = matches!(
            &scene.coupling,
            Some(Coupling::PartiallySaturated(cells))
                if cells.solid_operator.is_some_and(|operator| operator.model().needs_two_rates())
        );
        let free = !matched && !matches!(lbm.lattice, LatticeChoice::D3q19);
        if scene.grid.dimension == 3 && fast && free {
            flow.models.collision = Collision::Cumulant(cumulant::CumulantParameters::default());
            flow.models.lattice = Lattice::D3Q27;
            let text = format!("robust near tau = 0.5; here {tau:.5}");
            scene.chosen.note(Subject::Collision, text);
        } else {
            let text = format!(
                "the least expensive operator whose wall position does not depend on the viscosity; tau = {}",
                number(tau)
            );
            scene.chosen.note(Subject::Collision, text);
        }
    }
    // The bound was measured with this operator; others have maps of their own.
    if tau < least * (1.0 - 1e-9) && matches!(flow.models.collision, Collision::Trt(_)) {
        let reason = format!(
            "at this viscosity and speed the relaxation time is tau = {tau:.5}; the operator trt is stable for \
             tau of {least:.5} and above"
        );
        let path = format!("{PATH}.kinematic_viscosity");
        let single_rate = |remedy: String| {
            if scene.grid.dimension == 2 && scene.surface.is_some() {
                Remedy::from(format!(
                    "use the eddy viscosity `smagorinsky` with the operator `bgk`, or {remedy}"
                ))
                .set(format!("{PATH}.turbulence"), json!({"smagorinsky": {}}))
                .set(format!("{PATH}.collision"), json!({"bgk": {}}))
            } else {
                Remedy::from(format!("use {remedy}"))
            }
        };
        // A stated value is used, with a warning.
        if scene.grid.dimension == 2 && lbm.turbulence.is_none() && flow.fixed_by == "accuracy" {
            let finest = scene.grid.spacing * (tau - 0.5) / (least - 0.5);
            let remedy = format!(
                "a spacing of at most {} m, a slower flow, or a 3-D domain, where the operator cumulant is \
                 stable",
                number(finest)
            );
            findings.error(&path, reason, single_rate(remedy));
        } else {
            let remedy = "a smaller spacing, or in 3-D remove collision and lattice";
            findings.warn(&path, reason, single_rate(remedy.into()));
        }
    }
}

/// Chooses the storage precision: f32 halves the memory and the memory traffic of a draft in 3-D.
fn storage(scene: &mut Scene, flow: &mut Flow, lbm: &LatticeBoltzmann, target: f64) {
    let free = lbm.storage.is_none() && flow.storage == Precision::F64;
    if free && scene.grid.dimension == 3 && target >= DRAFT {
        flow.storage = Precision::F32;
        let text = "accuracy draft in 3-D: half the memory; arithmetic in f64";
        scene.chosen.note(Subject::Populations, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use base::error::Problem;
    use case::Document;
    use case::accuracy::Accuracy;
    use serde_json::Value;
    use std::path::Path;

    #[test]
    fn intervals_have_the_common_divisor_of_their_decimals() {
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        close(common_interval(1e-3, 2.5e-3), 5e-4);
        close(common_interval(0.1, 0.3), 0.1);
        close(common_interval(0.7, 0.7), 0.7);
        assert!(common_interval(1.0, std::f64::consts::SQRT_2) < 1e-6);
    }

    fn plan(every: &Value) -> Plan {
        let case = json!({
            "domain": {"size": [0.02, 0.01], "periodic": ["x"]},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-5, "body_force": {"constant": [1, 0]}
            }},
            "time": {"end": 2},
            "probes": [{"name": "p", "every": every[0], "at": {"point": {"position": [0.01, 0.005]}}}],
            "output": {"fluid": {"every": every[1]}}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        Plan::prepare(document).unwrap()
    }

    /// Checks dry grains and grains in seepage, whose time step follows from the contacts.
    #[test]
    fn automatic_solid_steps_divide_the_intervals_of_samples() {
        let plan = |every: f64, fluid: Value, step: Option<f64>| {
            let mut case = json!({
                "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.01},
                "gravity": [0, 0, -9.81],
                "materials": {"glass": {"density": 2500}},
                "box_walls": ["z_min"],
                "grains": {"material": "glass", "initial": {"list": [
                    {"position": [0.05, 0.05, 0.02], "radius": 0.003}
                ]}},
                "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "normal_damping_ratio": 0.2}},
                "time": {"end": 0.1},
                "probes": [{"name": "g", "every": every, "at": {"grains": {}}}]
            });
            case["fluid"] = fluid;
            case["time"]["solid_time_step"] = json!(step);
            let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
            Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"))
        };
        let darcy = json!({"darcy": {
            "density": 1000, "viscosity": 0.1, "grid": {"from": [0, 0, 0], "to": [0.1, 0.1, 0.1], "cells": [5, 5, 5]},
            "boundaries": [{"name": "top", "face": "z_max", "condition": {"head": {"value": 0.1}}}]
        }});
        for fluid in [Value::Null, darcy] {
            let longest = plan(0.1, fluid.clone(), None).clock.time_step;
            for every in [0.01, 0.0037, 50.0 * longest + 0.3 * longest] {
                let step = plan(every, fluid.clone(), None).clock.time_step;
                assert!(
                    step <= longest * 1.01 && step > 0.7 * longest,
                    "{step} {longest}"
                );
                let samples = every / step;
                assert!(
                    (samples - samples.round()).abs() < 1e-6,
                    "{every}: {samples}"
                );
            }
        }
        let stated = plan(0.01, Value::Null, Some(1.3e-5)).clock.time_step;
        assert!((stated / 1.3e-5 - 1.0).abs() < 1e-12);
    }

    /// Returns the plan of a channel of 0.2 m whose inflow of 0.05 m/s has more fields, or in which a disc is driven.
    fn driven(inflow: &Value, motion: &Value, viscosity: f64) -> Plan {
        let mut condition = json!({"profile": {"uniform": [0.05, 0]}});
        if let Some(fields) = inflow.as_object() {
            for (name, value) in fields {
                condition[name] = value.clone();
            }
        }
        let open = json!([
            {"name": "in", "face": "x_min", "condition": {"velocity": condition}},
            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
        ]);
        let mut case = json!({
            "domain": {"size": [0.2, 0.1], "spacing": 0.005},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": viscosity}},
            "time": {"end": 3}
        });
        if motion.is_null() {
            case["fluid"]["lattice_boltzmann"]["boundaries"] = open;
        } else {
            case["materials"] = json!({"steel": {"density": 7800}});
            case["bodies"] = json!([{"name": "rod", "shape": {"disc": {"radius": 0.02}}, "position": [0.1, 0.05],
                "material": "steel", "motion": {"driven": motion}}]);
        }
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        Plan::prepare(document).unwrap_or_else(|problems| panic!("{problems:#?}"))
    }

    /// Checks that every drive that changes gradually limits the automatic time step by its sound, or that a warning
    /// states the density change: ramps and tables of inflows and bodies.
    #[test]
    fn sound_of_a_changing_drive_limits_the_step_or_is_stated() {
        let none = Value::Null;
        let quick = json!([[0, 0], [0.1, 1], [2, 1]]);
        let body = json!({"velocity": [0.05, 0], "history": quick});
        let (mut limited, mut stated) = (0, 0);
        for (inflow, motion) in [
            (json!({"history": quick}), none.clone()),
            (json!({"ramp_time": 0.1}), none.clone()),
            (none.clone(), body),
        ] {
            for viscosity in [1e-3, 5e-5] {
                let plan = driven(&inflow, &motion, viscosity);
                let scene = &plan.scene;
                let flow = scene.flow.as_ref().unwrap();
                let causes = gradual(scene);
                assert_eq!(
                    causes.len(),
                    1,
                    "{inflow} {motion}: {:?}",
                    scene.density_causes
                );
                let change = density::total(&causes, flow.time_step, 0.005, 1000.0);
                let said = plan
                    .warnings
                    .iter()
                    .any(|w| w.reason.contains("are those of sound"));
                assert_eq!(
                    said,
                    change > MAX_COMPRESSION * 1.001,
                    "{inflow} {motion} {change}"
                );
                stated += usize::from(said);
                limited += usize::from(!said);
                // The change from rest to 0.05 m/s within 0.1 s: at most that of a sudden one.
                let sudden = causes[0].sound * 0.05 * flow.time_step / 0.005;
                assert!(change <= sudden * (1.0 + 1e-12), "{change} {sudden}");
            }
        }
        assert!(limited > 0 && stated > 0, "{limited} {stated}");
        // A table that turns round changes by the difference of its rows.
        let turned = json!({"history": [[0, 1], [1, 1], [1.1, -1], [3, -1]]});
        let plan = driven(&turned, &none, 1e-3);
        let cause = plan
            .scene
            .density_causes
            .iter()
            .find(|cause| cause.sound > 0.0)
            .unwrap();
        assert!((cause.velocity - 0.1).abs() < 1e-15, "{cause:?}");
        // A sudden start is stated with the reason of the time step.
        let plan = driven(&none, &none, 1e-3);
        let reason = plan.scene.chosen.reason_of(Subject::TimeStep).unwrap();
        assert!(reason.contains("changes the density by up to"), "{reason}");
    }

    /// Checks that samples are uniform where the longest step has a relaxation time just above the least one: in a
    /// cavity whose lid gives a relaxation time of 0.5104 on stated cells.
    #[test]
    fn samples_are_uniform_at_the_least_relaxation_time() {
        let plan = |every: f64| {
            let (speed, spacing) = (0.1, 0.002);
            let viscosity = 0.0104 * speed * spacing / (3.0 * mach(Accuracy::default().target()));
            let case = json!({
                "domain": {"size": [0.064, 0.064], "spacing": spacing},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": viscosity,
                    "boundaries": [{"name": "lid", "face": "y_max",
                        "condition": {"moving_wall": {"velocity": [speed, 0]}}}]
                }},
                "time": {"end": 2},
                "probes": [{"name": "p", "every": every, "at": {"point": {"position": [0.03, 0.03]}}}]
            });
            let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
            Plan::prepare(document).unwrap_or_else(|problems| panic!("{problems:#?}"))
        };
        let whole = plan(2.0);
        let longest = whole.clock.time_step;
        let tau = whole.scene.flow.as_ref().unwrap().relaxation_time;
        assert!((0.51..0.511).contains(&tau), "{tau}");
        for steps in [3.3, 5.77, 7.9, 12.4, 40.6] {
            let plan = plan(steps * longest);
            let found = steps * longest / plan.clock.time_step;
            assert!((found - found.round()).abs() < 1e-6, "{steps}: {found}");
            assert!((0.75..1.34).contains(&(plan.clock.time_step / longest)));
            let refused = |p: &&Problem| p.path.ends_with("kinematic_viscosity");
            assert_eq!(plan.warnings.iter().filter(refused).count(), 0, "{steps}");
        }
    }

    /// Checks that the range of two relaxation times does not keep another stated operator from uniform samples.
    #[test]
    fn samples_of_a_stated_operator_are_uniform() {
        let plan = |every: f64| {
            let case = json!({
                "domain": {"size": [0.6, 0.3], "spacing": 0.01}, "gravity": [0, -9.81],
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-6,
                    "collision": {"bgk": {}}, "turbulence": {"smagorinsky": {}},
                    "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [0.2, 0.2]}}}]}
                }},
                "time": {"end": 1},
                "probes": [{"name": "p", "every": every, "at": {"gauge": {"position": [0.3, 0]}}}]
            });
            let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
            let plan = Plan::prepare(document).unwrap_or_else(|problems| panic!("{problems:#?}"));
            plan.clock.time_step
        };
        let longest = plan(1.0);
        let found = 5.77 * longest / plan(5.77 * longest);
        assert!((found - 6.0).abs() < 1e-6, "{found}");
    }

    #[test]
    fn samples_lie_at_whole_numbers_of_automatic_steps() {
        let longest = plan(&json!([2, 2])).clock.time_step;
        for every in [json!([0.01, 0.1]), json!([0.0123, 0.5]), json!([0.1, 0.25])] {
            let step = plan(&every).clock.time_step;
            assert!(
                step <= longest * 1.001 && step > 0.4 * longest,
                "{step} {longest}"
            );
            let steps = every[0].as_f64().unwrap() / step;
            assert!(
                (steps - steps.round()).abs() < 1e-6 * steps,
                "{every}: {steps}"
            );
        }
        let step = plan(&json!([0.1, 0.25])).clock.time_step;
        let steps = 0.25 / step;
        assert!((steps - steps.round()).abs() < 1e-6 * steps, "{steps}");
    }
}
