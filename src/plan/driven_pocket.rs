//! Pockets of water that driven discs close in the corners of a domain.
//!
//! A disc with gaps of less than a cell to two closed faces that meet encloses the water in their corner: no link leads
//! out of it. With gaps of g and k cells and a radius of R cells the pocket has
//!
//! ```text
//! V = (R + g)(R + k) - π R²/4
//! ```
//!
//! cells. Motion that changes V changes the density of its water, whatever the time step. In runs of discs of 5.5 cells
//! the density changed by a little more than half of this, because cells are covered whole. A sphere leaves
//! the water a way out around it.

use crate::driven_path;
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, number};
use base::geometry::Face;
use std::f64::consts::PI;

/// Gap to a face below which no cell of water lies between it and a disc \[cells\].
const CLOSED: f64 = 1.0;
/// Ratio of the estimate to the results of runs.
const ESTIMATE_RATIO: f64 = 1.8;
/// Number of parts of a path.
const PARTS: u32 = 256;

/// Reports the first driven disc that encloses water in a corner and changes its volume too much.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
        return;
    };
    if scene.grid.dimension != 2 {
        return;
    }
    let patches: Vec<&ScenePatch> = flow.patches().collect();
    let bodies = scene.bodies.iter().enumerate();
    let driven =
        |(_, body): &(usize, &NamedBody)| body.mobility == Mobility::Driven && body.solid.is_none();
    for (n, body) in bodies.filter(driven) {
        for faces in [
            [Face::XMin, Face::YMin],
            [Face::XMax, Face::YMin],
            [Face::XMin, Face::YMax],
            [Face::XMax, Face::YMax],
        ] {
            let change = change(scene, body, faces);
            let most = scene.guards.max_compression;
            if change <= most || !is_closed(scene, &patches, body, faces) {
                continue;
            }
            let path = format!("bodies[{n}].motion.driven.velocity");
            let reason = format!(
                "the body `{}` encloses water in the corner of {} and {}, with gaps of less than a cell, and changes \
                 its volume by up to {} %; the density changes by half of it or more, and the run stops at {} %",
                body.name,
                faces[0].name(),
                faces[1].name(),
                number(100.0 * change),
                number(100.0 * most)
            );
            let remedy = "leave a gap of a cell or more to one of these faces, or use finer cells";
            if change > ESTIMATE_RATIO * most {
                findings.unstable(&path, reason, remedy);
            } else {
                findings.warn(&path, reason, remedy);
            }
            return;
        }
    }
}

/// Returns the relative change of the volume that a disc encloses between two faces on its path; 0 if it encloses none.
fn change(scene: &Scene, body: &NamedBody, faces: [Face; 2]) -> f64 {
    let h = scene.grid.spacing;
    let radius = body.radius / h;
    let [back, ahead] = driven_path::path(body, scene.time.end);
    let volumes = (0..=PARTS).filter_map(|n| {
        let way = back + (ahead - back) * f64::from(n) / f64::from(PARTS);
        let gaps = faces.map(|face| {
            let axis = face.axis();
            let at = body.position[axis] + way * body.velocity[axis];
            let from_face = if face.is_max() {
                scene.grid.size[axis] - at
            } else {
                at
            };
            from_face / h - radius
        });
        let closed = gaps.iter().all(|gap| (-radius..CLOSED).contains(gap));
        closed.then(|| (radius + gaps[0]) * (radius + gaps[1]) - 0.25 * PI * radius * radius)
    });
    // Less than a cell is covered.
    let volumes = volumes.filter(|volume| *volume >= 1.0);
    let [least, most] = volumes.fold([f64::INFINITY, 0.0_f64], |[low, high], v| {
        [low.min(v), high.max(v)]
    });
    if least.is_finite() {
        most / least - 1.0
    } else {
        0.0
    }
}

/// Returns `true` if no water leaves through the faces between their corner and the disc.
fn is_closed(scene: &Scene, patches: &[&ScenePatch], body: &NamedBody, faces: [Face; 2]) -> bool {
    let reach = body.radius / scene.grid.spacing;
    faces.iter().enumerate().all(|(n, face)| {
        if scene.grid.periodic[face.axis()] {
            return false;
        }
        let other = faces[1 - n];
        let along = other.axis();
        let size = scene.grid.size[along] / scene.grid.spacing;
        let [from, to] = if other.is_max() {
            [size - reach, size]
        } else {
            [0.0, reach]
        };
        let mut open = patches
            .iter()
            .filter(|patch| patch.face == *face && patch.condition.model().passes_water());
        !open.any(|patch| patch.ends[along][0] < to && patch.ends[along][1] > from)
    })
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the severity of the finding on a disc of 5.5 cells that moves towards `x_min` at a stated gap \[cells\]
    /// above the floor, from a gap of 0.92 cells by a distance \[cells\].
    fn severity(above: f64, way: f64, boundaries: &Value) -> Option<Severity> {
        let h = 0.0005;
        let case = json!({
            "domain": {"size": [0.008, 0.008], "spacing": h},
            "materials": {"glass": {"density": 2000}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8,
                "boundaries": boundaries}},
            "bodies": [{"name": "disc", "shape": {"disc": {"radius": 5.5 * h}},
                        "position": [6.42 * h, (5.5 + above) * h], "material": "glass",
                        "motion": {"driven": {"velocity": [-way * h, 0]}}}],
            "coupling": {"bounce_back": {"scheme": "half_way"}},
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let mut found = plan.warnings.iter();
        found
            .find(|p| p.reason.contains("encloses water in the corner"))
            .map(|p| p.severity)
    }

    #[test]
    fn a_disc_that_presses_water_into_a_corner_is_named() {
        let closed = json!([]);
        // The pocket shrinks from 11.6 to 6.7 cells, or to 9.2.
        assert_eq!(severity(0.01, 0.9, &closed), Some(Severity::Unstable));
        assert_eq!(severity(0.01, 0.45, &closed), Some(Severity::Warning));
        assert_eq!(severity(0.01, 0.1, &closed), None);
        assert_eq!(severity(1.1, 0.9, &closed), None);
        let drain = json!([{"name": "drain", "face": "x_min", "condition": {"pressure": {"value": 0}},
            "patch": {"from": [0, 0], "to": [0.008, 0.001]}}]);
        assert_eq!(severity(0.01, 0.9, &drain), None);
    }
}
