//! Speeds that the water of a scene will reach, estimated before the first step.
//!
//! Velocities that are not imposed are estimated from above: a pressure drop by the smaller of the viscous flow U =
//! dP b²/(8 rho nu L) through the open height b and of the frictionless one sqrt(2 dP/rho), and that through an inlet
//! smaller than the outlet by a jet ([`inlet`]); a body force by U = f b²/(8 rho nu) above the bed that grains form, or
//! f/(rho omega) if it oscillates. If the program chooses the time step, the settling speed of bodies is estimated as
//! well ([`settling`]).

mod inlet;
pub(crate) mod settling;

use super::Scene;
use super::boundaries::ScenePatch;
use super::flow::{BodyForce, Flow, PATH};
use super::free_surface::Opening;
use super::initial::Initial;
use super::terms;
use base::vector::norm;
use lbm::boundary::SurfaceKind;
use lbm::synthetic::Fluctuations;
use std::f64::consts::PI;
use std::fmt;

/// Safety factor on the speed of a pilot run, which has coarse cells.
pub(crate) const PILOT_MARGIN: f64 = 1.25;

/// Cause of a speed of the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpeedCause {
    /// Velocity of a pilot run, with a margin.
    Pilot,
    /// Body force and gravity on the water, against the obstacles.
    Force,
    /// Body force, also against a bed of grains.
    BodyForce,
    /// Difference of the imposed pressures.
    Pressure,
    /// Difference of the imposed pressures, at openings that are smaller than those where the water leaves.
    Inlet,
    /// Fall of water with a free surface.
    Fall,
    /// Prescribed motion of a body.
    Body,
    /// Settling or rising bodies.
    Settling,
    /// Boundary or initial state with this name.
    Imposed(&'static str),
}

impl fmt::Display for SpeedCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pilot => "the velocity of the pilot with a margin",
            Self::Force => "the force on the water (estimate)",
            Self::BodyForce => "the body force (estimate)",
            Self::Pressure => "the pressure difference (estimate)",
            Self::Inlet => "the pressure difference at a small inlet (estimate)",
            Self::Fall => "the fall of the water",
            Self::Body => "the moving body",
            Self::Settling => "settling (estimate)",
            Self::Imposed(name) => name,
        })
    }
}

/// Estimated or imposed speed of the fluid.
pub(crate) struct Speed {
    /// Cause of the speed.
    pub(crate) what: SpeedCause,
    /// JSON path of the field that determines the speed.
    pub(crate) path: String,
    /// Value of the speed [m/s].
    pub(crate) value: f64,
}

/// Returns all speeds relevant to the choice of a time step: imposed and stated, from forces, gravity and
/// pressures, and of settling bodies.
pub(crate) fn all(scene: &Scene, flow: &Flow) -> Vec<Speed> {
    let mut speeds = imposed(scene, flow);
    if let Some(pilot) = &flow.pilot {
        speeds.push(Speed {
            what: SpeedCause::Pilot,
            path: format!("{PATH}.pilot.speed"),
            value: PILOT_MARGIN * pilot.speed,
        });
        speeds.extend(settling_speed(scene, flow));
        return speeds;
    }
    speeds.extend(driven_by_pressure(scene, flow));
    speeds.extend(inlet::speed(scene, flow));
    if let Some(value) = driven_by_forces(scene, flow) {
        speeds.push(Speed {
            what: SpeedCause::Force,
            path: format!("{PATH}.body_force"),
            value,
        });
    }
    speeds.extend(settling_speed(scene, flow));
    speeds
}

/// Returns the speeds by which a scene with a stated time step is judged: imposed speeds, and those from pressures,
/// body forces and settling.
pub(crate) fn speeds(scene: &Scene, flow: &Flow) -> Vec<Speed> {
    if !scene.chosen.limits.is_empty() {
        return all(scene, flow);
    }
    if flow.pilot.is_some() {
        return all(scene, flow);
    }
    let mut speeds = imposed(scene, flow);
    speeds.extend(driven_by_pressure(scene, flow));
    speeds.extend(inlet::speed(scene, flow));
    // Both are upper estimates: one includes the bed, the other the obstacles.
    let estimates = [force_driven(scene, flow), driven_by_forces(scene, flow)];
    let estimate = estimates.into_iter().flatten().reduce(f64::min);
    if let Some(value) = estimate.filter(|value| *value != 0.0) {
        speeds.push(Speed {
            what: SpeedCause::BodyForce,
            path: format!("{PATH}.body_force"),
            value,
        });
    }
    // The estimate is an upper bound: it counts only if it exceeds the limit of a run.
    let most = scene.guards.max_lattice_velocity * scene.grid.spacing / flow.time_step;
    speeds.extend(settling_speed(scene, flow).filter(|speed| speed.value > most));
    speeds
}

/// Returns the speed of settling or rising bodies.
fn settling_speed(scene: &Scene, flow: &Flow) -> Option<Speed> {
    let (path, value) = settling::fastest(scene, flow)?;
    let what = SpeedCause::Settling;
    Some(Speed { what, path, value })
}

/// Returns the speeds imposed by boundaries, by the initial state and by bodies.
pub(crate) fn imposed(scene: &Scene, flow: &Flow) -> Vec<Speed> {
    let mut speeds = imposed_on_fluid(flow);
    speeds.extend(of_bodies(scene, false));
    speeds.extend(fall_speed(scene));
    speeds
}

/// Returns the speed of water that falls from its highest to the lowest point of the domain, and that of water that
/// flows down a slope between openings: limited by its fall along the whole domain, and by the speed of a film as
/// thick as the highest water level.
fn fall_speed(scene: &Scene) -> Option<Speed> {
    let surface = scene.surface.as_ref()?;
    let head = surface.head();
    let fall = 2.0 * surface.gravity * head;
    let viscosity = scene
        .flow
        .as_ref()
        .map_or(0.0, |flow| flow.kinematic_viscosity);
    let slope = |a: usize| {
        let open = a != surface.axis && !scene.grid.periodic[a] && !surface.openings.is_empty();
        let pull = if open { scene.gravity[a].abs() } else { 0.0 };
        let film = pull * head * head / (2.0 * viscosity);
        (fall + 2.0 * pull * scene.grid.size[a]).sqrt().min(film)
    };
    let value = (0..scene.grid.dimension)
        .map(slope)
        .fold(fall.sqrt(), f64::max);
    let of_opening = |opening: &&Opening| opening.head.is_some_and(|own| own >= head);
    let path = surface.openings.iter().find(of_opening).map_or_else(
        || format!("{PATH}.surface.water"),
        |opening| opening.path.clone(),
    );
    (value > 0.0).then_some(Speed {
        what: SpeedCause::Fall,
        path,
        value,
    })
}

/// Returns the speeds imposed by boundaries and by the initial state.
pub(crate) fn imposed_on_fluid(flow: &Flow) -> Vec<Speed> {
    let mut speeds = Vec::new();
    let mut add = |what: &'static str, path: String, value: f64| {
        if value != 0.0 {
            speeds.push(Speed {
                what: SpeedCause::Imposed(what),
                path,
                value,
            });
        }
    };
    for patch in flow.patches() {
        if let Some(speed) = patch.condition.model().speed()
            && let Some(path) = patch.path(speed.field)
        {
            add(speed.what, path, speed.value);
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
        Initial::ShearLayers {
            velocity,
            perturbation,
            ..
        } => add(
            "the initial shear layers",
            format!("{PATH}.initial.shear_layers.velocity"),
            velocity.abs() * (1.0 + perturbation.abs()),
        ),
        Initial::Channel {
            peak, fluctuations, ..
        } => add(
            "the initial channel flow",
            format!("{PATH}.initial.channel.peak"),
            peak.abs() * Fluctuations::gusts(fluctuations.as_ref()),
        ),
        Initial::File(_) => {}
    }
    speeds
}

/// Returns the largest surface speeds of bodies with a prescribed motion: from translation and rotation, or from
/// rotation alone.
pub(crate) fn of_bodies(scene: &Scene, rotation_alone: bool) -> impl Iterator<Item = Speed> {
    let bodies = scene.bodies.iter().enumerate();
    let speeds = bodies.map(move |(n, body)| Speed {
        what: SpeedCause::Body,
        path: format!("bodies[{n}].motion"),
        value: {
            let [velocity, spin] = body.largest_motion().map(norm);
            spin * body.radius + if rotation_alone { 0.0 } else { velocity }
        },
    });
    speeds.filter(|speed| speed.value != 0.0)
}

/// Returns the largest speed at which bodies move through the fluid: as prescribed, or by settling or rising.
pub(crate) fn through_the_fluid(scene: &Scene, flow: &Flow) -> Option<Speed> {
    let driven = scene.bodies.iter().enumerate().map(|(n, body)| Speed {
        what: SpeedCause::Body,
        path: format!("bodies[{n}].motion"),
        value: norm(body.largest_motion()[0]),
    });
    let speeds = driven.chain(settling_speed(scene, flow));
    speeds
        .filter(|speed| speed.value > 0.0)
        .max_by(|a, b| a.value.total_cmp(&b.value))
}

/// Returns the speed driven by a pressure difference.
fn driven_by_pressure(scene: &Scene, flow: &Flow) -> Option<Speed> {
    let (path, value) = pressure_driven(scene, flow).filter(|(_, value)| *value != 0.0)?;
    let what = SpeedCause::Pressure;
    Some(Speed { what, path, value })
}

/// Difference of the pressures imposed by boundaries.
pub(crate) struct PressureDifference {
    /// Largest minus smallest pressure \[Pa\].
    pub(crate) value: f64,
    /// JSON path of the pressure with the larger amplitude.
    path: String,
    /// Axis normal to its face.
    pub(crate) axis: usize,
}

/// Returns the difference of the pressures imposed by boundaries; outflows count with the reference pressure.
pub(crate) fn pressure_difference(flow: &Flow) -> Option<PressureDifference> {
    let mut bounds: Option<[f64; 2]> = None;
    let mut largest: Option<PressureDifference> = None;
    for patch in flow.patches() {
        let model = patch.condition.model();
        let imposed = model.pressure();
        if let Some(pressure) = imposed
            && let Some(path) = patch.path(pressure.field)
        {
            let [lo, hi] = pressure.range();
            let known = bounds.unwrap_or([lo, hi]);
            bounds = Some([known[0].min(lo), known[1].max(hi)]);
            let size = lo.abs().max(hi.abs());
            if largest.as_ref().is_none_or(|known| size > known.value) {
                largest = Some(PressureDifference {
                    value: size,
                    path,
                    axis: patch.face.axis(),
                });
            }
        } else if model.pressure_floats()
            && let Some([lo, hi]) = bounds
        {
            bounds = Some([lo.min(0.0), hi.max(0.0)]);
        }
    }
    let [lo, hi] = bounds?;
    Some(PressureDifference {
        value: hi - lo,
        ..largest?
    })
}

fn pressure_driven(scene: &Scene, flow: &Flow) -> Option<(String, f64)> {
    let PressureDifference { value, path, axis } = pressure_difference(flow)?;
    let free = (2.0 * value / flow.density).sqrt();
    let (length, height) = passage(scene, axis);
    let viscous =
        value * height * height / (8.0 * flow.density * flow.kinematic_viscosity * length);
    let resisted = terms::fastest(&scene.terms, &scene.grid, axis, value / flow.density);
    Some((path, free.min(viscous).min(resisted)))
}

/// Returns the length and open height of the passage through the domain along an axis: through the holes cut into
/// the grains (boxes that do not reach from wall to wall), or the whole domain.
pub(crate) fn passage(scene: &Scene, axis: usize) -> (f64, f64) {
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

/// Returns the minimum thickness \[m\] of the bed that grains form under a stream along `axis`: that of equal
/// spheres (2-D: discs) of the smallest size in the densest packing. Zero if grains do not settle there, or if the
/// stream passes through a hole cut into them.
fn bed(scene: &Scene, flow: &Flow, axis: usize) -> f64 {
    let grid = &scene.grid;
    let down = (0..grid.dimension)
        .max_by(|a, b| scene.gravity[*a].abs().total_cmp(&scene.gravity[*b].abs()));
    let (Some(grains), Some(down)) = (&scene.grains, down) else {
        return 0.0;
    };
    let settles =
        down != axis && !grid.periodic[down] && scene.gravity[down] != 0.0 && grains.cut.is_empty();
    let heavy = grains.materials().all(|m| scene.density(m) > flow.density);
    let Some((smallest, _)) = grains.radii.filter(|_| settles && heavy) else {
        return 0.0;
    };
    let (volume, densest) = if grid.dimension == 2 {
        (PI * smallest.powi(2), PI / 12.0_f64.sqrt())
    } else {
        (4.0 / 3.0 * PI * smallest.powi(3), PI / 18.0_f64.sqrt())
    };
    let floor = (0..grid.dimension).filter(|a| *a != down);
    let floor: f64 = floor.map(|a| grid.size[a]).product();
    grains.remaining() * volume / (densest * floor)
}

/// Returns the largest driving force per volume [N/m³]: the body force, plus the weight of the water along periodic
/// axes on which gravity acts; along other axes weight only causes pressure.
fn driving_force(scene: &Scene, flow: &Flow) -> [f64; 3] {
    let body = flow.body_force.largest();
    std::array::from_fn(|a| {
        let drives = flow.gravity_acts[a] && scene.grid.periodic[a];
        body[a]
            + if drives {
                flow.density * scene.gravity[a]
            } else {
                0.0
            }
    })
}

fn force_driven(scene: &Scene, flow: &Flow) -> Option<f64> {
    let force = driving_force(scene, flow);
    let size = norm(force);
    let axis = (0..3).max_by(|a, b| force[*a].abs().total_cmp(&force[*b].abs()))?;
    if size == 0.0 || !scene.grid.periodic[axis] {
        // A force against walls causes pressure, not flow.
        return None;
    }
    let (_, height) = passage(scene, axis);
    let height = height - bed(scene, flow, axis).min(0.75 * height);
    let viscous = size * height * height / (8.0 * flow.density * flow.kinematic_viscosity);
    let start = match &flow.initial {
        Initial::Uniform { velocity, .. } => norm(*velocity),
        Initial::Channel { peak, .. } => peak.abs(),
        _ => 0.0,
    };
    let estimate = match flow.body_force {
        // The flow is not faster than the force could accelerate it in the time available.
        BodyForce::Constant(_) => {
            let steady = if flow.models.turbulence.is_some() {
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
    let resisted = terms::fastest(
        &scene.terms,
        &scene.grid,
        axis,
        size * scene.grid.size[axis] / flow.density,
    );
    let estimate = estimate.min(resisted);
    // Without walls only obstacles limit the flow, and their effect is not known yet.
    estimate.is_finite().then_some(estimate)
}

/// Returns the speed of the water driven by body force and gravity along a periodic axis: in a film under a
/// frictionless surface four times that between walls; in 3-D turbulent from Re = 4000 on; between bodies limited
/// by their drag.
fn driven_by_forces(scene: &Scene, flow: &Flow) -> Option<f64> {
    let forces = driving_force(scene, flow);
    let along = (0..scene.grid.dimension).filter(|a| scene.grid.periodic[*a]);
    let along = along.map(|a| (a, forces[a]));
    let (axis, force) = along.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let force = force.abs();
    if force == 0.0 {
        return None;
    }
    let nu = flow.kinematic_viscosity;
    let (_, width) = passage(scene, axis);
    let slides =
        |patch: &ScenePatch| patch.condition.model().kind().surface == SurfaceKind::Symmetry;
    let height = if flow.patches().any(slides) {
        2.0 * width
    } else {
        width
    };
    let viscous = force * height * height / (8.0 * flow.density * nu);
    let steady = if !viscous.is_finite() {
        settling::held_by_bodies(scene, flow, force).unwrap_or(f64::INFINITY)
    } else if scene.grid.dimension == 3 && viscous * height > 4000.0 * nu {
        turbulent(force, height, flow)
    } else {
        viscous
    };
    // The flow is not faster than the force could accelerate it in the time available.
    let time = match flow.body_force {
        BodyForce::Constant(_) => scene.time.end,
        BodyForce::Oscillating { period, .. } => period / std::f64::consts::TAU,
    };
    let resisted = terms::fastest(
        &scene.terms,
        &scene.grid,
        axis,
        force * scene.grid.size[axis] / flow.density,
    );
    Some(steady.min(force * time / flow.density).min(resisted))
}

/// Returns the centreline velocity of a turbulent channel driven by a force: u/u* = ln(Re*)/0.41 + 5.2, the
/// logarithmic law (Pope 2000, section 7.1), with the friction velocity u* = (F H/(2 rho))^½ and Re* = u* H/(2 nu).
fn turbulent(force: f64, height: f64, flow: &Flow) -> f64 {
    let friction_velocity = (0.5 * force * height / flow.density).sqrt();
    let reynolds = 0.5 * friction_velocity * height / flow.kinematic_viscosity;
    friction_velocity * (reynolds.max(1.0).ln() / 0.41 + 5.2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use serde_json::json;
    use std::path::Path;

    /// Checks that a bed reduces the height of the stream, which is therefore slower than in the empty channel.
    #[test]
    fn the_stream_is_as_high_as_the_bed_leaves_it() {
        let speed = |number: usize, density: f64| {
            let case = json!({
                "domain": {"size": [0.1, 0.1, 0.1], "spacing": 2e-3, "periodic": ["x", "z"]},
                "gravity": [0, -9.81, 0],
                "materials": {"glass": {"density": density}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-2, "relaxation_time": 0.8,
                        "body_force": {"constant": [8, 0, 0]}
                }},
                "grains": {"material": "glass", "initial": {"deposition": {
                    "number": number, "grading": {"by_count": [{"min": 5e-3, "max": 5e-3, "fraction": 1}]}, "seed": 1,
                    "box": {"from": [0, 0, 0], "to": [0.1, 0.1, 0.1]}
                }}},
                "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
                "box_walls": ["y_min", "y_max"],
                "coupling": {"partially_saturated": {}},
                "time": {"end": 10}
            });
            let document = case::Document::read(&case.to_string(), &[], Path::new("")).unwrap();
            let scene = Plan::prepare(document).unwrap().scene;
            force_driven(&scene, scene.flow.as_ref().unwrap()).unwrap()
        };
        let empty = 8.0 * 0.1 * 0.1 / (8.0 * 10.0);
        // Spheres fill 0.74 of a layer of 2 cm: 283 with a volume of 5.24e-7 m³.
        let bed = speed(283, 2500.0);
        assert!((bed / (0.64 * empty) - 1.0).abs() < 0.01, "{bed} {empty}");
        // Floating grains form no bed.
        assert_eq!(speed(283, 900.0), empty);
    }
}
