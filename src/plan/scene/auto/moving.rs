//! Density changes caused by bodies that move through the lattice fluid.
//!
//! ```text
//! drive     ρ c U, at most 4 ρ U R/T          a driven body whose velocity changes by U, at once or during T
//! flow      ρ U² |C_p|/2 + k ρ ν U/R          suction at the body in potential flow, C_p = -3 (disc), -5/4 (sphere)
//!                                             (Batchelor 1967, sections 6.6 and 6.8); k = 3/2 for a sphere in
//!                                             creeping flow
//! squeeze   k ρ ν U R/δ² + ρ U² R/(4 δ)       fluid between a free body and the wall that it falls on, δ = 2 cells;
//!                                             k = 6 (disc), 3 (sphere), and its inertia
//! impact    2 ρ c U                           a free body that rebounds: from a Stokes number (ρ_s/ρ) 2 R U/(9 ν)
//!                                             of 10 on (P. Gondret, M. Lance, L. Petit, Phys. Fluids 14 (2002) 643)
//! ```
//!
//! The third is Reynolds' equation for a parabolic film of thickness δ + r²/(2 R) (Batchelor, section 4.8): with
//! the discharge U x of a disc and U r/2 of a sphere its pressure in the middle is 6 and 3 μ U R/δ². It is limited
//! by the weight and the momentum of the body: a force F is the pressure F/(2 π R δ) under a sphere and 2 F/(π (2 R
//! δ)^½) under a disc. Fluid leaves the film at up to U (R/(2 δ))^½.

use super::density::{Cause, changes};
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::flow::Flow;
use crate::scene::speed::settling;
use base::geometry::Face;
use base::vector::norm;
use std::f64::consts::PI;

/// Minimum ratio of the estimates to the results of runs: the sound of a start spreads, and guards check only at
/// intervals.
const START_ESTIMATE_RATIOS: [f64; 2] = [3.0, 6.0];
const ESTIMATE_RATIO: f64 = 2.5;
const FILM_ESTIMATE_RATIO: f64 = 2.0;

/// Pressure coefficients of potential flow at a disc and a sphere.
const SUCTION: [f64; 2] = [3.0, 1.25];
/// Coefficients of ρ ν U/R in front of a disc between walls and a sphere in creeping flow.
const FRICTION: [f64; 2] = [3.0, 1.5];
/// Coefficients of ρ ν U R/δ² in the film under a disc and a sphere.
const FILM: [f64; 2] = [6.0, 3.0];

/// Minimum Stokes number at which a sphere rebounds from a wall in a liquid.
const REBOUNDS: f64 = 10.0;
/// Thickness \[cells\] of the thinnest film whose pressure the cells represent: with it the estimate is 2 to 4
/// times the change observed in runs (`jobs/automatic/openings`).
const FILM_CELLS: f64 = 2.0;

/// Returns the causes of density changes by the moving bodies of a scene.
pub(super) fn causes(scene: &Scene, flow: &Flow) -> Vec<Cause> {
    let mut causes = Vec::new();
    for (n, body) in scene.bodies.iter().enumerate() {
        let radius = 0.5 * settling::diameter(body);
        match body.mobility {
            Mobility::Fixed => {}
            Mobility::Driven => {
                let path = format!("bodies[{n}].motion");
                let speed = norm(body.largest_motion()[0]);
                causes.extend(change_of_motion(scene, flow, &path, (body, radius)));
                causes.extend(around(scene, flow, path, radius, speed));
            }
            Mobility::Free => {
                let path = format!("bodies[{n}].motion.free");
                let speed = settling::body_settling_speed(scene, flow, 2.0 * radius, body.material)
                    .max(norm(body.velocity));
                causes.extend(impact(scene, flow, &path, (body, radius), speed));
                causes.extend(squeeze(scene, flow, &path, (body, radius), speed));
                causes.extend(around(scene, flow, path, radius, speed));
            }
        }
    }
    // Bodies act at different positions, so that only the largest cause of each kind counts.
    let mut worst: Vec<Cause> = Vec::new();
    for cause in causes {
        let weight = |cause: &Cause| (cause.sound * cause.velocity, cause.pressure);
        match worst.iter_mut().find(|known| known.what == cause.what) {
            Some(known) if weight(known) < weight(&cause) => *known = cause,
            Some(_) => {}
            None => worst.push(cause),
        }
    }
    worst
}

fn change_of_motion(
    scene: &Scene,
    flow: &Flow,
    path: &str,
    (body, radius): (&NamedBody, f64),
) -> Option<Cause> {
    let table = body.history.as_deref();
    let changes = changes(table, [norm(body.velocity), 0.0], 0.0, scene.time.end);
    let what = if table.is_some() {
        "the pressure wave of a body whose velocity changes"
    } else {
        "the pressure wave of a body that starts to move"
    };
    let of = (3.0_f64.sqrt(), flow.density, 2.0 * radius);
    let over = START_ESTIMATE_RATIOS[scene.grid.dimension - 2];
    Cause::drive((what, path.into()), &changes, of, over)
}

fn impact(
    scene: &Scene,
    flow: &Flow,
    path: &str,
    (body, radius): (&NamedBody, f64),
    speed: f64,
) -> Option<Cause> {
    let heavier = scene.density(body.material) / flow.density;
    let stokes = heavier * 2.0 * radius * speed / (9.0 * flow.kinematic_viscosity);
    (stokes > REBOUNDS && reaches_a_wall(scene, flow, body, speed)).then(|| Cause {
        what: "the pressure wave of a body that rebounds from a wall",
        path: path.into(),
        pressure: 0.0,
        velocity: speed,
        sound: 2.0 * 3.0_f64.sqrt(),
        most: f64::INFINITY,
        over: START_ESTIMATE_RATIOS[scene.grid.dimension - 2],
    })
}

fn around(scene: &Scene, flow: &Flow, path: String, radius: f64, speed: f64) -> Option<Cause> {
    let kind = scene.grid.dimension - 2;
    let inertia = 0.5 * SUCTION[kind] * speed * speed;
    let friction = FRICTION[kind] * flow.kinematic_viscosity * speed / radius;
    (speed > 0.0).then_some(Cause {
        what: "the flow around a body that moves",
        path,
        pressure: flow.density * (inertia + friction),
        velocity: speed,
        sound: 0.0,
        most: f64::INFINITY,
        over: ESTIMATE_RATIO,
    })
}

fn squeeze(
    scene: &Scene,
    flow: &Flow,
    path: &str,
    (body, radius): (&NamedBody, f64),
    speed: f64,
) -> Option<Cause> {
    if !reaches_a_wall(scene, flow, body, speed) {
        return None;
    }
    Some(Cause {
        what: "the film between a body and a wall",
        path: path.into(),
        pressure: film(scene, flow, (radius, body.material), speed),
        velocity: speed,
        sound: 0.0,
        most: f64::INFINITY,
        over: FILM_ESTIMATE_RATIO,
    })
}

/// Returns the pressure in the film between a ball of a radius \[m\] and a material and the wall or the ball that it
/// approaches at this speed [m/s] \[Pa\].
pub(super) fn film(
    scene: &Scene,
    flow: &Flow,
    (radius, material): (f64, usize),
    speed: f64,
) -> f64 {
    let width = FILM_CELLS * scene.grid.spacing;
    let kind = scene.grid.dimension - 2;
    let film =
        FILM[kind] * flow.density * flow.kinematic_viscosity * speed * radius / (width * width);
    let mass = scene.mass(material, radius);
    let lighter = 1.0 - flow.density / scene.density(material);
    let force = mass * (lighter.abs() * norm(scene.gravity) + 0.5 * speed * speed / width);
    let borne = if kind == 0 {
        2.0 * force / (PI * (2.0 * radius * width).sqrt())
    } else {
        force / (2.0 * PI * radius * width)
    };
    film.min(borne) + 0.25 * flow.density * speed * speed * radius / width
}

/// Returns `true` if the body reaches a wall below it, or above it if it rises, before the run ends.
fn reaches_a_wall(scene: &Scene, flow: &Flow, body: &NamedBody, speed: f64) -> bool {
    let ball = (body.position, body.radius, body.material);
    !reached_faces(scene, flow, ball, speed).is_empty()
}

/// Face to which weight and buoyancy move a body before the run ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReachedFace {
    /// The face.
    pub(crate) face: Face,
    /// Distance of the surface of the body from it at the start \[m\].
    pub(crate) drop: f64,
    /// Path towards it in the run, without the face \[m\].
    pub(crate) path: f64,
}

/// Returns the faces below a body of a position, a radius \[m\] and a material, or above it if it rises, that it
/// reaches at this speed [m/s] before the run ends.
pub(crate) fn reached_faces(
    scene: &Scene,
    flow: &Flow,
    (position, radius, material): ([f64; 3], f64, usize),
    speed: f64,
) -> Vec<ReachedFace> {
    let gravity = scene.gravity;
    let heavy = scene.density(material) > flow.density;
    let reached = (0..scene.grid.dimension).filter_map(|axis| {
        if gravity[axis] == 0.0 || scene.grid.periodic[axis] {
            return None;
        }
        let upward = (gravity[axis] > 0.0) == heavy;
        let way = if upward {
            scene.grid.size[axis] - position[axis]
        } else {
            position[axis]
        };
        let path = gravity[axis].abs() / norm(gravity) * speed * scene.time.end;
        let drop = way - radius;
        (drop > 0.0 && drop <= path).then(|| ReachedFace {
            face: Face::ALL[2 * axis + usize::from(upward)],
            drop,
            path,
        })
    });
    reached.collect()
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use approx::assert_relative_eq;
    use case::Document;
    use serde_json::json;
    use std::path::Path;

    /// Returns the causes for a disc of 5 mm in a box of water, by name, with their pressures and their sound.
    fn causes(motion: &serde_json::Value, end: f64) -> Vec<(&'static str, f64, f64)> {
        let case = json!({
            "domain": {"size": [0.04, 0.04], "spacing": 1e-3, "periodic": ["x"]},
            "gravity": [0, -0.01],
            "materials": {"steel": {"density": 3000}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.6}},
            "bodies": [{
                "name": "rod", "shape": {"disc": {"radius": 5e-3}}, "position": [0.02, 0.02], "motion": motion,
                    "material": "steel"
            }],
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e3}, "friction_angle_degrees": 0}},
            "box_walls": ["y_min", "y_max"],
            "time": {"end": end}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let scene = Plan::prepare(document).unwrap().scene;
        let all = scene.density_causes.iter();
        all.map(|cause| (cause.what, cause.pressure, cause.sound * cause.velocity))
            .collect()
    }

    /// Checks that a cylinder that moves at speed U in an ideal fluid has the pressure -3/2 rho U² at its sides, and
    /// that a driven one also causes the sound of its start.
    #[test]
    fn a_driven_disc_sounds_once_and_sucks() {
        let found = causes(&json!({"driven": {"velocity": [0.002, 0]}}), 1.0);
        assert_eq!(found.len(), 2, "{found:?}");
        assert_relative_eq!(found[0].2, 3.0_f64.sqrt() * 0.002);
        let suction = 1.5 * 1000.0 * 4e-6;
        let friction = 3.0 * 1e-3 * 0.002 / 5e-3;
        assert_relative_eq!(found[1].1, suction + friction, max_relative = 1e-12);
    }

    #[test]
    fn a_film_counts_where_a_body_comes_down_on_a_wall() {
        let free = json!({"free": {}});
        let long = causes(&free, 20.0);
        let names: Vec<&str> = long.iter().map(|cause| cause.0).collect();
        assert!(names.iter().any(|name| name.contains("film")), "{names:?}");
        let rebounds = |name: &&str| name.contains("rebounds");
        assert!(names.iter().any(rebounds), "{names:?}");
        let short = causes(&free, 0.2);
        let arrives = |cause: &(&str, f64, f64)| cause.0.contains("wall");
        assert!(!short.iter().any(arrives), "{short:?}");
    }
}
