//! How far each limit of the method is, before a single step.
//!
//! Velocities that are not imposed are estimated from above: a pressure drop by the smaller of the viscous flow
//! U = dP b²/(8 rho nu L) through the open height b and of the frictionless one sqrt(2 dP/rho); a body force by
//! U = f b²/(8 rho nu), or f/(rho omega) if it oscillates. The Mach number is U/C with C = h/dt, and at a given
//! tau C = 3 nu/(h (tau - 1/2)): the spacing decides how fast a flow may be.

use super::Clock;
use crate::case::boundary::Fluctuations;
use crate::scene::Scene;
use crate::scene::contact::{ContactTable, Law, TimeLimits};
use crate::scene::findings::{Findings, number};
use crate::scene::flow::{BodyForce, Condition, Flow, Initial, PATH, VelocityProfile};
use crate::scene::grid::count;
use crate::scene::solids::{GrainSource, Mobility};
use serde::Serialize;

/// A limit and where the case stands.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// Which limit.
    pub limit: String,
    /// Where the case stands.
    pub value: f64,
    /// The limit.
    pub allowed: f64,
    /// How much of the limit is used; above 1 it is crossed.
    pub used: f64,
    /// JSON path of what decides it.
    pub path: String,
}

/// The paper's "typically lower than".
const USUAL_MACH: f64 = 0.1;
/// Fewest cells in a diameter.
const FEWEST_CELLS: f64 = 4.0;
/// Largest relative change of density.
const MOST_COMPRESSION: f64 = 0.3;

/// The critical time step and the grain that decides it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Critical {
    /// The shortest limit of any grain [s].
    pub(crate) time_step: f64,
    /// Shortest 2 sqrt(m/k) and shortest time of Rayleigh [s].
    pub(crate) limits: TimeLimits,
}

/// 2 sqrt(m/k) of the lightest grain or free body with its stiffest contact, of elastic spheres Rayleigh's time as well; of a block
/// with all its faces in touch.
pub(crate) fn critical_solid_time_step(scene: &Scene) -> Option<Critical> {
    let contact = scene.contact.as_ref()?;
    let mut moving: Vec<(usize, f64)> = Vec::new();
    if let Some(grains) = &scene.grains {
        match &grains.source {
            GrainSource::List(list) | GrainSource::File { grains: list, .. } => {
                moving.extend(list.iter().map(|g| (g.material, g.radius)))
            }
            _ => moving.extend(
                grains
                    .radii
                    .map(|(smallest, _)| (grains.material, smallest)),
            ),
        }
    }
    for region in &scene.regions {
        if let crate::scene::observe::Action::Generate {
            radii, material, ..
        } = &region.action
        {
            moving.push((*material, radii.bounds().0));
        }
    }
    let spheres = scene.bodies.iter().filter(|b| b.solid.is_none());
    let free = spheres.filter(|b| b.mobility == Mobility::Free);
    moving.extend(free.map(|b| (b.material, b.radius)));
    let of_spheres = moving
        .into_iter()
        .filter(|(material, _)| *material < contact.materials)
        .map(|(material, radius)| {
            contact.time_limits(material, radius, scene.mass(material, radius))
        });
    let of_blocks = scene
        .polyhedra()
        .filter(|(_, _, free)| *free)
        .map(|(solid, material, _)| {
            let mass = scene.density(material) * solid.shape.volume();
            contact.time_limits_of_block(material, &solid.shape, mass)
        });
    let mut shortest: Option<TimeLimits> = None;
    for limits in of_spheres.chain(of_blocks) {
        if !(limits.shorter().is_finite() && limits.shorter() > 0.0) {
            continue;
        }
        shortest = Some(shortest.map_or(limits, |known| TimeLimits {
            spring: known.spring.min(limits.spring),
            rayleigh: known.rayleigh.zip(limits.rayleigh).map(|(a, b)| a.min(b)),
        }));
    }
    shortest.map(|limits| Critical {
        time_step: limits.shorter(),
        limits,
    })
}

/// A velocity the fluid will reach.
struct Speed {
    what: String,
    path: String,
    value: f64,
}

/// All limits; those crossed become findings.
pub(crate) fn margins(scene: &Scene, clock: &Clock, findings: &mut Findings) -> Vec<Margin> {
    let mut margins = Vec::new();
    if let Some(flow) = &scene.flow {
        let tau = flow.relaxation_time;
        margins.push(margin(
            "relaxation time above 1/2",
            0.5,
            tau,
            &format!("{PATH}.{}", flow.fixed_by),
        ));
        mach(scene, flow, &mut margins, findings);
        compression(scene, flow, &mut margins, findings);
        resolution(scene, &mut margins, findings);
    }
    if let Some(seepage) = &scene.seepage
        && let Some((_, largest)) = scene.grains.as_ref().and_then(|g| g.radii)
    {
        margins.push(margin(
            "largest grain / cell of the seepage",
            2.0 * largest,
            seepage.smallest_edge(scene.grid.dimension),
            "fluid.darcy.grid",
        ));
    }
    if let Some(critical) = clock.critical_solid_time_step {
        margins.push(margin(
            "solid time step / critical",
            clock.solid_time_step / critical,
            scene.time.solid_time_step_safety,
            "time.solid_time_step_safety",
        ));
    }
    if let Some(ContactTable {
        law: Law::HertzMindlin { impact_speed, .. },
        ..
    }) = &scene.contact
        && let Some(Critical { limits, .. }) = critical_solid_time_step(scene)
    {
        let mut share = |limit: &str, time: f64, path: &str| {
            let safety = scene.time.solid_time_step_safety;
            margins.push(margin(limit, clock.solid_time_step / time, safety, path));
        };
        share(
            &format!(
                "solid time step / 2 sqrt(m/k) of an impact at {} m/s",
                number(*impact_speed)
            ),
            limits.spring,
            "contact.hertz_mindlin.impact_speed",
        );
        if let Some(rayleigh) = limits.rayleigh {
            share("solid time step / Rayleigh's", rayleigh, "materials");
        }
    }
    margins
}

fn margin(limit: &str, value: f64, allowed: f64, path: &str) -> Margin {
    Margin {
        limit: limit.into(),
        value,
        allowed,
        used: value / allowed,
        path: path.into(),
    }
}

fn mach(scene: &Scene, flow: &Flow, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let (h, dt, nu) = (scene.grid.spacing, flow.time_step, flow.kinematic_viscosity);
    let c = h / dt;
    let most = scene.guards.max_mach;
    for speed in speeds(scene, flow) {
        let mach = speed.value / c;
        if mach > most || mach.is_nan() {
            findings.error(
                &speed.path,
                format!(
                    "{} gives {} m/s, Mach U/C = {}; it must be below {most}, and better below {USUAL_MACH}",
                    speed.what,
                    number(speed.value),
                    number(mach)
                ),
                remedy(flow, h, nu, speed.value),
            );
        } else if mach > USUAL_MACH {
            findings.warn(
                &speed.path,
                format!(
                    "{} gives {} m/s, Mach U/C = {}, above {USUAL_MACH}",
                    speed.what,
                    number(speed.value),
                    number(mach)
                ),
                remedy(flow, h, nu, speed.value),
            );
        }
        margins.push(margin(
            &format!("Mach U/C: {}", speed.what),
            mach,
            most,
            &speed.path,
        ));
    }
}

/// What brings the Mach number down to the usual one.
fn remedy(flow: &Flow, h: f64, nu: f64, velocity: f64) -> String {
    let dt = USUAL_MACH * h / velocity;
    let tau = 0.5 + 3.0 * nu * dt / (h * h);
    let finer = 3.0 * nu * USUAL_MACH / ((flow.relaxation_time - 0.5) * velocity);
    let first = match flow.fixed_by {
        "relaxation_time" => format!("use a relaxation time of at most {tau:.4}"),
        "time_step" => format!("use a time step of at most {} s", number(dt)),
        _ => format!("raise the reference velocity to {} m/s", number(velocity)),
    };
    format!(
        "{first}, or a spacing of at most {} m at the same relaxation time, or drive it less",
        number(finer)
    )
}

fn speeds(scene: &Scene, flow: &Flow) -> Vec<Speed> {
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut speeds = Vec::new();
    let mut add = |what: &str, path: String, value: f64| {
        if value != 0.0 {
            speeds.push(Speed {
                what: what.into(),
                path,
                value,
            });
        }
    };
    for patch in flow.patches() {
        let Some(n) = patch.index else { continue };
        let path = format!("{PATH}.boundaries[{n}].condition");
        match &patch.condition {
            Condition::MovingWall(v) => add(
                "the moving wall",
                format!("{path}.moving_wall.velocity"),
                norm(*v),
            ),
            Condition::Velocity {
                profile: VelocityProfile::Uniform(v),
                turbulence,
                ..
            } => add(
                "the imposed velocity",
                format!("{path}.velocity.profile.uniform"),
                norm(*v) * gusts(*turbulence),
            ),
            Condition::Velocity {
                profile: VelocityProfile::Parabolic(peak),
                turbulence,
                ..
            } => add(
                "the imposed velocity",
                format!("{path}.velocity.profile.parabolic.peak"),
                peak.abs() * gusts(*turbulence),
            ),
            _ => {}
        }
    }
    match &flow.initial {
        Initial::Uniform { velocity, .. } => add(
            "the initial velocity",
            format!("{PATH}.initial.uniform.velocity"),
            norm(*velocity),
        ),
        Initial::TaylorGreen {
            velocity,
            wave_numbers,
        } => {
            let ratio = wave_numbers[0] / wave_numbers[1];
            add(
                "the initial vortices",
                format!("{PATH}.initial.taylor_green.velocity"),
                velocity.abs() * ratio.max(1.0),
            );
        }
        Initial::Channel {
            peak, fluctuations, ..
        } => add(
            "the initial channel flow",
            format!("{PATH}.initial.channel.peak"),
            peak.abs() * gusts(*fluctuations),
        ),
        Initial::File(_) => {}
    }
    for (n, body) in scene.bodies.iter().enumerate() {
        let surface = norm(body.velocity) + norm(body.angular_velocity) * body.radius;
        add("the moving body", format!("bodies[{n}].motion"), surface);
    }
    if let Some((path, value)) = pressure_driven(scene, flow) {
        add("the pressure difference (estimate)", path, value);
    }
    if let Some(value) = force_driven(scene, flow) {
        add(
            "the body force (estimate)",
            format!("{PATH}.body_force"),
            value,
        );
    }
    speeds
}

/// Largest over mean speed: fluctuations rarely go beyond three times their root mean square.
fn gusts(fluctuations: Option<Fluctuations>) -> f64 {
    1.0 + 3.0 * fluctuations.map_or(0.0, |f| f.intensity)
}

/// Largest minus smallest imposed pressure [Pa], the boundary with the larger magnitude, and the axis between.
fn pressure_difference(flow: &Flow) -> Option<(f64, usize, usize)> {
    let mut bounds: Option<(f64, f64)> = None;
    let mut largest: Option<(f64, usize, usize)> = None;
    for patch in flow.patches() {
        if let (Condition::Pressure { value, from, .. }, Some(n)) = (&patch.condition, patch.index)
        {
            let (lo, hi) = (value.min(*from), value.max(*from));
            let known = bounds.unwrap_or((lo, hi));
            bounds = Some((known.0.min(lo), known.1.max(hi)));
            let size = lo.abs().max(hi.abs());
            if largest.is_none_or(|(s, ..)| size > s) {
                largest = Some((size, n, patch.face.axis()));
            }
        } else if let (Condition::Outflow | Condition::ConvectiveOutflow(_), Some((lo, hi))) =
            (&patch.condition, bounds)
        {
            bounds = Some((lo.min(0.0), hi.max(0.0)));
        }
    }
    let ((lo, hi), (_, n, axis)) = (bounds?, largest?);
    Some((hi - lo, n, axis))
}

fn pressure_driven(scene: &Scene, flow: &Flow) -> Option<(String, f64)> {
    let (difference, n, axis) = pressure_difference(flow)?;
    let path = format!("{PATH}.boundaries[{n}].condition.pressure.value");
    let free = (2.0 * difference / flow.density).sqrt();
    let (length, height) = passage(scene, axis);
    let viscous =
        difference * height * height / (8.0 * flow.density * flow.kinematic_viscosity * length);
    Some((path, free.min(viscous)))
}

/// Length and open height of the way through the domain along an axis: the holes cut into the grains (boxes that do
/// not reach from wall to wall), or the whole domain.
fn passage(scene: &Scene, axis: usize) -> (f64, f64) {
    let grid = &scene.grid;
    let across: Vec<usize> = (0..grid.dimension)
        .filter(|a| *a != axis && !grid.periodic[*a])
        .collect();
    let height_of = |from: [f64; 3], to: [f64; 3]| {
        across
            .iter()
            .map(|a| to[*a] - from[*a])
            .fold(f64::INFINITY, f64::min)
    };
    let full = height_of([0.0; 3], grid.size);
    let cuts = scene.grains.iter().flat_map(|g| &g.cut);
    cuts.map(|(_, block)| {
        (
            block.to[axis] - block.from[axis],
            height_of(block.from, block.to),
        )
    })
    .filter(|(_, height)| *height < 0.95 * full)
    .max_by(|a, b| a.1.total_cmp(&b.1))
    .unwrap_or((grid.size[axis], full))
}

fn force_driven(scene: &Scene, flow: &Flow) -> Option<f64> {
    let force = flow.body_force.largest();
    let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let axis = (0..3).max_by(|a, b| force[*a].abs().total_cmp(&force[*b].abs()))?;
    if size == 0.0 || !scene.grid.periodic[axis] {
        // Against walls a force makes pressure, not flow.
        return None;
    }
    let (_, height) = passage(scene, axis);
    let viscous = size * height * height / (8.0 * flow.density * flow.kinematic_viscosity);
    let start = match &flow.initial {
        Initial::Uniform { velocity, .. } => velocity.iter().map(|x| x * x).sum::<f64>().sqrt(),
        Initial::Channel { peak, .. } => peak.abs(),
        _ => 0.0,
    };
    let estimate = match flow.body_force {
        // No flow is faster than the force has had time for.
        BodyForce::Constant(_) => {
            let steady = if flow.turbulence.is_some() {
                viscous.min(turbulent(size, height, flow))
            } else {
                viscous
            };
            steady.min(size * scene.time.end / flow.density + start)
        }
        BodyForce::Oscillating { period, .. } => {
            viscous.min(size * period / (std::f64::consts::TAU * flow.density))
        }
    };
    // With no wall in sight only what is in the way can hold the flow back, and that is not known yet.
    estimate.is_finite().then_some(estimate)
}

/// Velocity in the middle of a turbulent channel that a force drives: u/u* = ln(Re*)/0.41 + 5.2, the logarithmic law (Pope 2000,
/// section 7.1), with the friction velocity u* = (F H/(2 rho))^½ and Re* = u* H/(2 nu).
fn turbulent(force: f64, height: f64, flow: &Flow) -> f64 {
    let friction_velocity = (0.5 * force * height / flow.density).sqrt();
    let reynolds = 0.5 * friction_velocity * height / flow.kinematic_viscosity;
    friction_velocity * (reynolds.max(1.0).ln() / 0.41 + 5.2)
}

/// The lattice takes pressure for density: dp/(rho c_s²) must stay small.
fn compression(scene: &Scene, flow: &Flow, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let units = flow.units(&scene.grid);
    let mut sources: Vec<(String, &str, f64)> = Vec::new();
    for patch in flow.patches() {
        if let (Condition::Pressure { value, from, .. }, Some(n)) = (&patch.condition, patch.index)
        {
            let path = format!("{PATH}.boundaries[{n}].condition.pressure.value");
            sources.push((path, "the imposed pressure", value.abs().max(from.abs())));
        }
    }
    if let Initial::Uniform { pressure, .. } = &flow.initial {
        sources.push((
            format!("{PATH}.initial.uniform.pressure"),
            "the initial pressure",
            pressure.abs(),
        ));
    }
    if flow.gravity_acts {
        let head: f64 = (0..scene.grid.dimension)
            .filter(|a| !scene.grid.periodic[*a])
            .map(|a| flow.density * scene.gravity[a].abs() * scene.grid.size[a])
            .sum();
        sources.push((
            format!("{PATH}.gravity_acts_on_fluid"),
            "the hydrostatic pressure",
            head,
        ));
    }
    for (path, what, pressure) in sources.into_iter().filter(|s| s.2 > 0.0) {
        let change = units.pressure_to_density_deviation(pressure);
        let reason = format!(
            "{what} changes the density of the lattice fluid by {} %",
            number(100.0 * change)
        );
        let remedy = "use a smaller time step (the change goes with its square)";
        if change > MOST_COMPRESSION || change.is_nan() {
            findings.error(
                &path,
                format!("{reason}; at most {} %", 100.0 * MOST_COMPRESSION),
                remedy,
            );
        } else if change > 0.1 * MOST_COMPRESSION {
            findings.warn(
                &path,
                format!("{reason}; better below {} %", 10.0 * MOST_COMPRESSION),
                remedy,
            );
        }
        margins.push(margin(
            &format!("density change: {what}"),
            change,
            MOST_COMPRESSION,
            &path,
        ));
    }
}

/// A disc needs a few cells for the water to feel its shape.
fn resolution(scene: &Scene, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let Some(coupling) = &scene.coupling else {
        return;
    };
    let h = scene.grid.spacing;
    let factor = coupling.hydraulic_radius_factor();
    let mut diameters: Vec<(String, f64)> = Vec::new();
    if let Some(grains) = &scene.grains
        && let Some((smallest, _)) = grains.radii
    {
        let path = match &grains.source {
            GrainSource::Growth { .. } => "grains.initial.growth.radii",
            GrainSource::Rain { .. } => "grains.initial.rain.grading",
            _ => "grains.initial",
        };
        diameters.push((path.into(), 2.0 * smallest * factor));
    }
    for (n, body) in scene.bodies.iter().enumerate() {
        diameters.push((format!("bodies[{n}].shape"), 2.0 * body.radius));
    }
    for (path, diameter) in diameters {
        let cells = diameter / h;
        if cells < FEWEST_CELLS * (1.0 - 1e-9) {
            findings.error(
                &path,
                format!(
                    "the smallest diameter the fluid sees is {} cells; at least {FEWEST_CELLS}",
                    number(cells)
                ),
                format!(
                    "use a spacing of at most {} m, or larger solids",
                    number(diameter / FEWEST_CELLS)
                ),
            );
        }
        margins.push(margin(
            "fewest cells in a diameter",
            FEWEST_CELLS,
            cells,
            &path,
        ));
    }
}

/// The largest Reynolds number a passage of height b admits at Mach 0.1: U b/nu with U = 0.1 C.
#[must_use]
pub fn largest_reynolds(scene: &Scene) -> Option<f64> {
    let flow = scene.flow.as_ref()?;
    let axis = pressure_difference(flow).map_or(0, |(.., axis)| axis);
    let (_, height) = passage(scene, axis);
    let cells = height.min(scene.grid.size[0] * count(scene.grid.dimension)) / scene.grid.spacing;
    Some(USUAL_MACH * 3.0 / (flow.relaxation_time - 0.5) * cells)
}
