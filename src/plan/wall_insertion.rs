//! Bodies in the place of a wall that is inserted during the run.
//!
//! A wall appears where the case states it, and a run ends if it cuts a body then, as at the start: a contact that is
//! deep at once would throw the body. Fixed bodies are where the case states them, and driven ones where their table
//! takes them. Free bodies and grains are compared at their positions at the start, which they leave only if something
//! moves them.

use super::driven_path::displacement;
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::findings::{Findings, number};
use crate::scene::grains::GrainSource;
use crate::scene::speed::speeds;
use crate::scene::walls::SceneWall;
use nalgebra::Vector3;

/// Overlap of a contact with a new wall, as a fraction of the radius, above which a run ends.
const ALLOWED: f64 = 0.05;

/// Returns the distance of a wall from a point if it is less than the reach \[m\].
fn within(wall: &SceneWall, at: &Vector3<f64>, reach: f64) -> Option<f64> {
    let distance = match &wall.surface {
        None => Vector3::from(wall.normal).dot(&(at - Vector3::from(wall.point))),
        Some(surface) if surface.is_within(at, reach) => surface.clearance(at),
        Some(_) => return None,
    };
    (distance < reach).then_some(distance)
}

/// Returns `true` if nothing moves the free bodies of a scene: no forces, no motion and no flow.
fn is_at_rest(scene: &Scene) -> bool {
    let bodies = scene.bodies.iter();
    let mut moving = bodies.filter(|body| body.mobility != Mobility::Fixed && moves(body));
    let is_zero = |vector: [f64; 3]| vector.iter().all(|part| *part == 0.0);
    let still = |wall: &SceneWall| is_zero(wall.largest_velocity());
    let flows = scene.flow.iter().flat_map(|flow| speeds(scene, flow));
    is_zero(scene.gravity)
        && scene.seepage.is_none()
        && moving.next().is_none()
        && scene.walls.iter().all(still)
        && flows.into_iter().all(|speed| speed.value == 0.0)
}

/// Returns `true` if a body moves at the start, or by its table later.
fn moves(body: &NamedBody) -> bool {
    body.largest_motion() != [[0.0; 3]; 2]
}

/// Reports the first body that a wall cuts when it is inserted at a time \[s\]; returns `true` if there is one.
fn bodies(
    scene: &Scene,
    (wall, time): (&SceneWall, f64),
    path: &str,
    findings: &mut Findings,
) -> bool {
    for body in &scene.bodies {
        let mut at = Vector3::from(body.position);
        if body.mobility == Mobility::Driven {
            at += Vector3::from(body.velocity) * displacement(body, time);
        }
        let Some(distance) = within(wall, &at, (1.0 - ALLOWED) * body.radius) else {
            continue;
        };
        let reason = format!(
            "the wall `{}` is inserted at {} s where the body `{}` is: its surface is {} m from the centre of the \
             body, whose radius is {} m",
            wall.name,
            number(time),
            body.name,
            number(distance),
            number(body.radius)
        );
        let remedy = "insert it elsewhere or at another time, or move the body";
        if body.mobility != Mobility::Free || is_at_rest(scene) {
            findings.unstable(path, reason, remedy);
        } else {
            findings.warn(
                path,
                format!("{reason}, if nothing has moved it until then"),
                remedy,
            );
        }
        return true;
    }
    false
}

/// Warns of grains that a wall cuts when it is inserted, unless they have moved before.
fn grains(scene: &Scene, (wall, time): (&SceneWall, f64), path: &str, findings: &mut Findings) {
    let Some(grains) = &scene.grains else {
        return;
    };
    let (GrainSource::List(list) | GrainSource::File { grains: list, .. }) = &grains.source else {
        return;
    };
    let struck = list.iter().filter(|grain| {
        let reach = (1.0 - ALLOWED) * grain.radius;
        within(wall, &grain.position.into(), reach).is_some()
    });
    let struck = struck.count();
    if struck > 0 {
        findings.warn(
            path,
            format!(
                "the wall `{}` is inserted at {} s where {struck} grains are at the start: if they are still there, \
                 the run ends",
                wall.name,
                number(time)
            ),
            "insert it elsewhere, or where the grains have gone by then",
        );
    }
}

/// Reports walls that are inserted where a body is.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    for (n, wall) in scene.walls.iter().enumerate() {
        let Some(time) = wall
            .from
            .filter(|from| *from > 0.0 && *from <= scene.time.end)
        else {
            continue;
        };
        let path = format!("walls[{n}].from");
        if !bodies(scene, (wall, time), &path, findings) {
            grains(scene, (wall, time), &path, findings);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::Document;
    use serde_json::{Value, json};

    /// Returns the finding about a wall at x = 13.5 mm that is inserted at 0.3 s.
    fn found(motion: &Value, more: &[(&str, Value)]) -> Option<Problem> {
        let mut case = json!({
            "domain": {"size": [0.03, 0.02], "spacing": 5e-4},
            "materials": {"steel": {"density": 2000}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.2,
                                   "normal_stiffness": {"absolute": 5000}}},
            "bodies": [{"name": "disc", "material": "steel", "shape": {"disc": {"radius": 0.003}},
                        "position": [0.015, 0.01], "motion": motion}],
            "walls": [{"name": "gate", "material": "steel", "from": 0.3,
                       "shape": {"plane": {"normal": [1, 0], "point": [0.0135, 0]}}}],
            "time": {"end": 0.6}
        });
        for (key, value) in more {
            case[key] = value.clone();
        }
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        let mut all = plan.warnings.into_iter();
        all.find(|w| w.path == "walls[0].from" && w.reason.contains("is inserted at"))
    }

    #[test]
    fn a_wall_that_is_inserted_into_a_body_is_named() {
        let severity =
            |motion: Value, more: &[(&str, Value)]| found(&motion, more).map(|w| w.severity);
        let free = || json!({"free": {}});
        assert_eq!(severity(free(), &[]), Some(Severity::Unstable));
        assert_eq!(
            severity(json!({"fixed": {}}), &[]),
            Some(Severity::Unstable)
        );
        // Gravity may have moved it, or its own velocity.
        assert_eq!(
            severity(free(), &[("gravity", json!([0, -1]))]),
            Some(Severity::Warning)
        );
        let moves = json!({"free": {"velocity": [0.01, 0]}});
        assert_eq!(severity(moves, &[]), Some(Severity::Warning));
        // A driven body has gone by then, or has stopped before.
        let driven = |table: Value| json!({"driven": {"velocity": [0.01, 0], "history": table}});
        assert_eq!(severity(driven(json!([[0, 1]])), &[]), None);
        let stops = driven(json!([[0, 1], [0.05, 1], [0.05, 0]]));
        assert_eq!(severity(stops, &[]), Some(Severity::Unstable));
        // The run ends before.
        assert_eq!(severity(free(), &[("time", json!({"end": 0.2}))]), None);
    }

    #[test]
    fn grains_in_the_place_of_a_wall_are_counted() {
        let list = json!([{"position": [0.014, 0.003], "radius": 0.001}, {"position": [0.02, 0.003], "radius": 0.001}]);
        let grains = (
            "grains",
            json!({"material": "steel", "initial": {"list": list}}),
        );
        let gone = json!({"driven": {"velocity": [0.01, 0]}});
        let known = found(&gone, &[grains]).unwrap();
        assert!(known.reason.contains("where 1 grains"), "{known}");
    }
}
