//! How far each limit of the method is, before a single step.
//!
//! Velocities that are not imposed are estimated from above by [`crate::scene::speed`]. The lattice velocity is U/C with C = h/dt, and at a given
//! tau C = 3 nu/(h (tau - 1/2)): the spacing decides how fast a flow may be.

use super::Clock;
use crate::error::Remedy;
use crate::scene::Scene;
use crate::scene::contact::{ContactTable, Law, TimeLimits};
use crate::scene::findings::{Findings, at_most, number};
use crate::scene::flow::{Condition, Flow, Initial, PATH};
use crate::scene::grid::count;
use crate::scene::solids::{GrainSource, Mobility};
use crate::scene::speed::{passage, pressure_difference, speeds};
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

/// Usual upper bound of the lattice velocity: "typically lower than" it in Sibille, Lominé and Marot (2012).
const USUAL_LATTICE_VELOCITY: f64 = 0.1;
/// Relative change of density by an imposed pressure from which on the plan warns.
const USUAL_COMPRESSION: f64 = 0.03;

/// The critical time step and the grain that decides it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Critical {
    /// The shortest limit of any grain \[s\].
    pub(crate) time_step: f64,
    /// Shortest 2 sqrt(m/k) and shortest time of Rayleigh \[s\].
    pub(crate) limits: TimeLimits,
}

/// Material and radius (m) of spheres and discs that move by forces, the smallest of each source.
pub(super) fn moving(scene: &Scene) -> Vec<(usize, f64)> {
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
    moving
}

/// 2 sqrt(m/k) of the lightest grain or free body with its stiffest contact, of elastic spheres Rayleigh's time as well; of a block
/// with all its faces in touch.
pub(crate) fn critical_solid_time_step(scene: &Scene) -> Option<Critical> {
    let contact = scene.contact.as_ref()?;
    let of_spheres = moving(scene)
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
        for limit in &scene.chosen.limits {
            let what = format!("time step for {}", limit.what);
            margins.push(margin(&what, flow.time_step, limit.time_step, "accuracy"));
        }
        lattice_velocity(scene, flow, &mut margins, findings);
        super::stability::check(scene, flow, &mut margins, findings);
        super::waves::check(flow, clock, findings);
        compression(scene, flow, &mut margins, findings);
        super::bodies::check(scene, &mut margins, findings);
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
    super::contacts::check(scene, clock, &mut margins, findings);
    super::light_bodies::check(scene, &mut margins, findings);
    super::drag::check(scene, clock, &mut margins, findings);
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

pub(super) fn margin(limit: &str, value: f64, allowed: f64, path: &str) -> Margin {
    Margin {
        limit: limit.into(),
        value,
        allowed,
        used: value / allowed,
        path: path.into(),
    }
}

fn lattice_velocity(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let (h, dt, nu) = (scene.grid.spacing, flow.time_step, flow.kinematic_viscosity);
    let c = h / dt;
    let most = scene.guards.max_lattice_velocity;
    for speed in speeds(scene, flow) {
        let lattice_velocity = speed.value / c;
        if lattice_velocity > most || lattice_velocity.is_nan() {
            findings.error(
                &speed.path,
                format!(
                    "{} gives {} m/s, a lattice velocity U dt/h of {}; it must be below {most}, and preferably below {USUAL_LATTICE_VELOCITY}",
                    speed.what,
                    number(speed.value),
                    number(lattice_velocity)
                ),
                remedy(flow, h, nu, speed.value),
            );
        } else if lattice_velocity > USUAL_LATTICE_VELOCITY {
            findings.warn(
                &speed.path,
                format!(
                    "{} gives {} m/s, a lattice velocity U dt/h of {}, above {USUAL_LATTICE_VELOCITY}",
                    speed.what,
                    number(speed.value),
                    number(lattice_velocity)
                ),
                remedy(flow, h, nu, speed.value),
            );
        }
        margins.push(margin(
            &format!("lattice velocity U dt/h: {}", speed.what),
            lattice_velocity,
            most,
            &speed.path,
        ));
    }
}

/// Remedies that reduce the lattice velocity to the usual one.
fn remedy(flow: &Flow, h: f64, nu: f64, velocity: f64) -> Remedy {
    let dt = USUAL_LATTICE_VELOCITY * h / velocity;
    let tau = 0.5 + 3.0 * nu * dt / (h * h);
    let finer = 3.0 * nu * USUAL_LATTICE_VELOCITY / ((flow.relaxation_time - 0.5) * velocity);
    let first = match flow.fixed_by {
        "relaxation_time" => {
            format!(
                "use a relaxation time of at most {}",
                at_most(tau - 0.5) + 0.5
            )
        }
        "time_step" | "accuracy" => format!("use a time step of at most {:?} s", at_most(dt)),
        _ => format!("raise the reference velocity to {} m/s", number(velocity)),
    };
    let text = format!(
        "{first}, or a spacing of at most {} m at the same relaxation time, or drive it less",
        number(finer)
    );
    slower_clock(flow, h, dt / flow.time_step, text)
}

/// The least relaxation time that is proposed: below it stability is asked of the operator and the walls, not of the clock.
const LEAST_PROPOSED: f64 = 0.505;

/// Proposes `part` of the time step through whatever fixes it, where that leaves a relaxation time with which runs hold.
pub(super) fn slower_clock(flow: &Flow, h: f64, part: f64, text: String) -> Remedy {
    let dt = at_most(part * flow.time_step);
    let above = 3.0 * flow.kinematic_viscosity * part * flow.time_step / (h * h);
    let remedy = Remedy::from(text);
    if part >= 1.0 || 0.5 + above < LEAST_PROPOSED {
        return remedy;
    }
    match flow.fixed_by {
        "relaxation_time" => remedy.set(format!("{PATH}.relaxation_time"), 0.5 + at_most(above)),
        "time_step" | "accuracy" => remedy.set(format!("{PATH}.time_step"), dt),
        _ => remedy,
    }
}

/// The lattice takes pressure for density: dp/(rho c_s²) must stay small.
fn compression(scene: &Scene, flow: &Flow, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let units = flow.units(&scene.grid);
    let most = scene.guards.max_compression;
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
        // The change goes with the square of the time step.
        let part = 0.99 * (USUAL_COMPRESSION / change).sqrt();
        let remedy = slower_clock(
            flow,
            scene.grid.spacing,
            part,
            format!(
                "use {} of the time step (the change goes with its square), or less pressure",
                number(part)
            ),
        );
        if change > most || change.is_nan() {
            findings.error(
                &path,
                format!("{reason}; at most {} %", number(100.0 * most)),
                remedy,
            );
        } else if change > USUAL_COMPRESSION {
            findings.warn(
                &path,
                format!("{reason}; better below {} %", 100.0 * USUAL_COMPRESSION),
                remedy,
            );
        }
        margins.push(margin(
            &format!("density change: {what}"),
            change,
            most,
            &path,
        ));
    }
}

/// The largest Reynolds number a passage of height b admits at a lattice velocity of 0.1: U b/nu with U = 0.1 C.
#[must_use]
pub fn largest_reynolds(scene: &Scene) -> Option<f64> {
    let flow = scene.flow.as_ref()?;
    let axis = pressure_difference(flow).map_or(0, |(.., axis)| axis);
    let (_, height) = passage(scene, axis);
    let cells = height.min(scene.grid.size[0] * count(scene.grid.dimension)) / scene.grid.spacing;
    Some(USUAL_LATTICE_VELOCITY * 3.0 / (flow.relaxation_time - 0.5) * cells)
}
