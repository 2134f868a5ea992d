//! Driven bodies that leave the water through a face of the domain that is closed to it.
//!
//! A driven body moves whatever the forces on it are. The water between it and a closed face must flow out of a gap
//! that closes: its pressure grows without bound as the gap goes to zero, as in a squeeze film (Stefan 1874, Reynolds
//! 1886). A disc of 8 cells that was driven through a lid at a lattice velocity of 0.026 ended its run with twice the
//! density of the water. A body that reaches through the face from the start leaves no such gap, and a free body is
//! stopped by the water.

use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::findings::{Findings, number};
use base::geometry::Face;
use base::history::TimeTable;

/// Number of parts of an interval between two rows of a table in which the path is followed.
const PARTS: u32 = 16;

/// Returns the smallest and largest coordinate of a body along an axis \[m\].
fn extent(body: &NamedBody, axis: usize) -> [f64; 2] {
    let ball = [
        body.position[axis] - body.radius,
        body.position[axis] + body.radius,
    ];
    let Some(solid) = &body.solid else {
        return ball;
    };
    let corners = solid.vertices().into_iter().map(|corner| corner[axis]);
    corners.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// Returns the smallest and largest displacement of a driven body until a time, as multiples of its velocity \[s\].
fn path(body: &NamedBody, end: f64) -> [f64; 2] {
    let factors = TimeTable::new(body.history.as_deref(), 1.0);
    let (mut range, mut at, mut time) = ([0.0_f64; 2], 0.0, 0.0);
    while time < end {
        let next = factors.next(time).unwrap_or(end).min(end);
        let part = (next - time) / f64::from(PARTS);
        for n in 0..PARTS {
            let from = time + part * f64::from(n);
            at += factors.mean(from, from + part) * part;
            range = [range[0].min(at), range[1].max(at)];
        }
        time = if next > time { next } else { end };
    }
    range
}

/// Reports driven bodies that start inside the water and cross a face that is closed to it.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
        return;
    };
    let driven = scene.bodies.iter().enumerate();
    for (n, body) in driven.filter(|(_, body)| body.mobility == Mobility::Driven) {
        let way = path(body, scene.time.end);
        for face in Face::ALL {
            let axis = face.axis();
            if axis >= scene.grid.dimension || scene.grid.periodic[axis] {
                continue;
            }
            let patches = &flow.faces[face.index()];
            if patches
                .iter()
                .any(|patch| patch.condition.model().passes_water())
            {
                continue;
            }
            let length = scene.grid.size[axis];
            let [low, high] = extent(body, axis);
            let moved = way.map(|way| way * body.velocity[axis]);
            let (gap, towards) = if face.is_max() {
                (length - high, moved[0].max(moved[1]))
            } else {
                (low, -moved[0].min(moved[1]))
            };
            if gap > 0.0 && towards > gap {
                findings.unstable(
                    &format!("bodies[{n}].motion.driven.velocity"),
                    format!(
                        "the body `{}` moves by {} m towards the face {}, which is {} m away and closed to the water: \
                         the water in front of it is pressed together without bound",
                        body.name,
                        number(towards),
                        face.name(),
                        number(gap)
                    ),
                    "end its motion before the face, let it reach through the face from the start, or add an opening \
                     there",
                );
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use serde_json::{Value, json};

    /// Returns the number of findings for a disc that is driven upwards in a box of water.
    fn findings(motion: &Value, height: f64, faces: &Value) -> usize {
        let case = json!({
            "domain": {"size": [0.006, 0.0125], "spacing": 0.000125, "periodic": ["x"]},
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 4e-5, "relaxation_time": 0.75,
                                            "boundaries": faces}},
            "coupling": {"partially_saturated": {}},
            "bodies": [{"name": "piston", "shape": {"disc": {"radius": 0.0005}}, "position": [0.003, height],
                        "motion": motion, "material": "glass"}],
            "time": {"end": 0.06},
            "output": {}
        });
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let all = plan.warnings.iter();
        all.filter(|w| w.path == "bodies[0].motion.driven.velocity")
            .count()
    }

    #[test]
    fn a_body_that_is_driven_through_a_closed_face_is_named() {
        let up = json!({"driven": {"velocity": [0, 0.1]}});
        let closed = json!([]);
        let slips = json!([{"name": "lid", "face": "y_max", "condition": {"free_slip": {}}}]);
        let opens =
            json!([{"name": "lid", "face": "y_max", "condition": {"pressure": {"value": 0}}}]);
        assert_eq!(findings(&up, 0.0075, &closed), 1);
        assert_eq!(findings(&up, 0.0075, &slips), 1);
        assert_eq!(findings(&up, 0.0075, &opens), 0);
        // It ends before the lid, or reaches through it from the start.
        assert_eq!(findings(&up, 0.0055, &closed), 0);
        assert_eq!(findings(&up, 0.0121, &closed), 0);
        // Up and down again.
        let back = json!({"driven": {"velocity": [0, 0.1], "history": [[0, 2], [0.03, 2], [0.03, -2], [0.06, -2]]}});
        assert_eq!(findings(&back, 0.0075, &closed), 1);
    }
}
