//! Density change by the weight of suspended solids.
//!
//! A solid that falls at a constant speed transfers its submerged weight to the water. Over the height of the domain
//! its pressure then grows by
//!
//! ```text
//! Δp = |Σ (ρ_s - ρ) V| g/A
//! ```
//!
//! with the section A of the domain, as in a fluidised bed. In a closed domain half of it is above the mean. The solids
//! start to fall at once, and the sound of the start doubles the change; an opening
//! that holds the pressure at one end of the height doubles it again. The film between grains is added
//! ([`super::moving`]). In 14 runs of suspensions in closed boxes the estimate was 0.87 to 2.8 times the largest change
//! of the run, in two with changes of 5 and 7 % only 0.2 and 0.3 times, in another series once 5.4 times
//! (`jobs/automatic/openings/suspended.csv`).
//!
//! Solids that rest on others or on a wall from the start do not fall: each pair in contact counts for one of them.

use super::density::Cause;
use super::moving;
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::flow::Flow;
use crate::scene::grains::GrainSource;
use crate::scene::speed::settling;
use base::number::real;
use lbm::boundary::SurfaceKind;

/// Largest ratio of the estimate to the results of runs.
const ESTIMATE_RATIO: f64 = 5.4;
/// Gap between a body and the wall on which it rests, in radii.
const RESTING_GAP: f64 = 0.01;

/// Ball that falls.
struct Falling {
    radius: f64,
    material: usize,
    /// Part of it that falls: less than 1 for grains of which some rest on others.
    share: f64,
    /// `true` for a grain; the film below a body is a cause of its own.
    is_grain: bool,
}

/// Returns the density change by the weight of suspended solids; none if none fall, along periodic axes and below a
/// free surface.
pub(super) fn cause(scene: &Scene, flow: &Flow) -> Option<Cause> {
    if scene.surface.is_some() {
        return None;
    }
    let falling = falling(scene, flow);
    let excess = |ball: &Falling| {
        let mass = scene.mass(ball.material, ball.radius);
        let lighter = 1.0 - flow.density / scene.density(ball.material);
        ball.share * mass * lighter
    };
    let mass: f64 = falling.iter().map(excess).sum();
    let weight: f64 = (0..scene.grid.dimension)
        .filter(|axis| !scene.grid.periodic[*axis])
        .map(|axis| {
            mass.abs() * scene.gravity[axis].abs() / section(scene, axis) * held(flow, axis)
        })
        .sum();
    let film = |ball: &Falling| {
        let speed = settling::body_settling_speed(scene, flow, 2.0 * ball.radius, ball.material);
        let film = || moving::film(scene, flow, (ball.radius, ball.material), speed);
        (if ball.is_grain { film() } else { 0.0 }, speed)
    };
    let films = falling.iter().filter(|ball| ball.share > 0.0).map(film);
    let (film, speed) = films.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (weight > 0.0).then(|| Cause {
        what: "the weight of the solids that the water carries",
        path: "gravity".into(),
        pressure: weight + film,
        velocity: speed,
        sound: 0.0,
        most: f64::INFINITY,
        over: ESTIMATE_RATIO,
    })
}

/// Returns the grains and free bodies that fall.
fn falling(scene: &Scene, flow: &Flow) -> Vec<Falling> {
    let mut all = Vec::new();
    if let Some(grains) = &scene.grains
        && let GrainSource::List(list) | GrainSource::File { grains: list, .. } = &grains.source
    {
        let (number, resting) = (real(list.len()), real(grains.contacts));
        let share = ((number - resting) / number).max(0.0);
        all.extend(list.iter().map(|grain| Falling {
            radius: grain.radius,
            material: grain.material,
            share,
            is_grain: true,
        }));
    }
    let free = |body: &&NamedBody| body.mobility == Mobility::Free;
    let bodies = scene.bodies.iter().filter(free);
    all.extend(
        bodies
            .filter(|body| !rests(scene, flow, body))
            .map(|body| Falling {
                radius: 0.5 * settling::diameter(body),
                material: body.material,
                share: 1.0,
                is_grain: false,
            }),
    );
    all
}

/// Returns `true` if a body rests on a face of the domain below it, or above it if it is lighter than the water.
fn rests(scene: &Scene, flow: &Flow, body: &NamedBody) -> bool {
    let heavy = scene.density(body.material) > flow.density;
    (0..scene.grid.dimension).any(|axis| {
        let upward = (scene.gravity[axis] > 0.0) == heavy;
        let way = if upward {
            scene.grid.size[axis] - body.position[axis]
        } else {
            body.position[axis]
        };
        scene.gravity[axis] != 0.0 && way <= (1.0 + RESTING_GAP) * body.radius
    })
}

/// Returns the section of the domain across an axis: \[m²\], in 2-D \[m\].
fn section(scene: &Scene, axis: usize) -> f64 {
    let others = (0..scene.grid.dimension).filter(|a| *a != axis);
    others.map(|a| scene.grid.size[a]).product()
}

/// Returns 2 if an opening at an end of an axis holds the pressure, otherwise 1.
fn held(flow: &Flow, axis: usize) -> f64 {
    let ends = flow.patches().filter(|patch| patch.face.axis() == axis);
    let mut kinds = ends.map(|patch| patch.condition.model().kind().surface);
    if kinds.any(|kind| kind == SurfaceKind::Opening) {
        2.0
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use approx::assert_relative_eq;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the pressure of the weight of grains of 1 mm and twice the density of oil in a box of 20 x 40 mm; none
    /// without such a cause.
    fn pressure(places: &[[f64; 2]], periodic: &[&str], boundaries: &Value) -> Option<f64> {
        let grain = |at: &[f64; 2]| json!({"position": at, "radius": 0.001});
        let grains: Vec<Value> = places.iter().map(grain).collect();
        let case = json!({
            "domain": {"size": [0.02, 0.04], "spacing": 2e-4, "periodic": periodic},
            "gravity": [0, -0.01],
            "materials": {"glass": {"density": 2000}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
                "boundaries": boundaries}},
            "grains": {"material": "glass", "initial": {"list": grains}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e3}, "friction_angle_degrees": 0}},
            "coupling": {"partially_saturated": {}},
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let scene = Plan::prepare(document).unwrap().scene;
        let mut causes = scene.density_causes.iter();
        let found = causes.find(|cause| cause.what.starts_with("the weight of the solids"))?;
        Some(found.pressure)
    }

    /// Checks the weight of discs over the width of the box, with the film below one of them: 6 rho nu U R/d² for a gap
    /// d of two cells, and half of the weight of discs that touch.
    #[test]
    fn the_water_carries_the_weight_of_discs_that_fall() {
        let closed = json!([]);
        let apart = [[0.005, 0.02], [0.01, 0.02], [0.015, 0.02], [0.01, 0.03]];
        let weight = 1000.0 * std::f64::consts::PI * 1e-6 * 0.01 / 0.02;
        let one = pressure(&apart[..1], &[], &closed).unwrap();
        let film = one - weight;
        assert!(film > 0.0, "{film} {weight}");
        let four = pressure(&apart, &[], &closed).unwrap();
        assert_relative_eq!(four, 4.0 * weight + film, max_relative = 1e-12);
        // An opening above holds the pressure there.
        let open =
            json!([{"name": "top", "face": "y_max", "condition": {"pressure": {"value": 0}}}]);
        let held = pressure(&apart, &[], &open).unwrap();
        assert_relative_eq!(held, 8.0 * weight + film, max_relative = 1e-12);
        let touching = [[0.005, 0.02], [0.007, 0.02]];
        let half = pressure(&touching, &[], &closed).unwrap();
        assert_relative_eq!(half, weight + film, max_relative = 1e-12);
        // Nothing holds the water along a periodic axis.
        assert_eq!(pressure(&apart, &["y"], &closed), None);
    }
}
