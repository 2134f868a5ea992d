//! Paths of driven bodies that end runs: through a face of the domain that is closed to the water, far out of the
//! domain, and into another driven body.
//!
//! A driven body moves whatever the forces on it are. The water between it and a closed face must flow out of a gap
//! that closes: its pressure grows without bound as the gap goes to zero, as in a squeeze film (Stefan 1874, Reynolds
//! 1886). A disc of 8 cells that was driven through a lid at a lattice velocity of 0.026 ended its run with twice the
//! density of the water. A body that reaches through the face from the start leaves no such gap, and a free body is
//! stopped by the water.

use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use base::geometry::Face;
use base::history::TimeTable;
use nalgebra::Vector3;

/// Number of parts of an interval between two rows of a table in which the path is followed.
const PARTS: u32 = 16;

/// Returns the smallest and largest coordinate of a body along an axis \[m\].
pub(super) fn extent(body: &NamedBody, axis: usize) -> [f64; 2] {
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
pub(super) fn path(body: &NamedBody, end: f64) -> [f64; 2] {
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

/// Returns the displacement of a driven body until a time, as a multiple of its velocity \[s\].
pub(super) fn displacement(body: &NamedBody, time: f64) -> f64 {
    TimeTable::new(body.history.as_deref(), 1.0).mean(0.0, time) * time
}

/// Returns `true` if a body that crosses a face normal to an axis meets only openings there: one patch contains the
/// coordinates along the other axes \[m\] that the body takes on its way.
pub(super) fn lets_through(
    scene: &Scene,
    patches: &[ScenePatch],
    axis: usize,
    spans: impl Fn(usize) -> [f64; 2],
) -> bool {
    let open = patches
        .iter()
        .filter(|patch| patch.condition.model().passes_water());
    let mut open = open.filter(|patch| {
        (0..scene.grid.dimension)
            .filter(|along| *along != axis)
            .all(|along| {
                let [low, high] = spans(along);
                let [from, to] = patch.ends[along].map(|cells| cells * scene.grid.spacing);
                let whole = from <= 0.0 && to >= scene.grid.size[along];
                whole || (from <= low && to >= high)
            })
    });
    open.next().is_some()
}

/// Reports a driven body that starts inside the water and crosses a face that is closed to it.
fn crosses_a_closed_face(
    scene: &Scene,
    flow: &Flow,
    (n, body): (usize, &NamedBody),
    findings: &mut Findings,
) {
    let way = path(body, scene.time.end);
    for face in Face::ALL {
        let axis = face.axis();
        if axis >= scene.grid.dimension || scene.grid.periodic[axis] {
            continue;
        }
        let [low, high] = extent(body, axis);
        let moved = way.map(|way| way * body.velocity[axis]);
        let (gap, towards) = if face.is_max() {
            (scene.grid.size[axis] - high, moved[0].max(moved[1]))
        } else {
            (low, -moved[0].min(moved[1]))
        };
        let patches = &flow.faces[face.index()];
        let spans = |along: usize| {
            let [low, high] = extent(body, along);
            let [back, ahead] = way.map(|way| way * body.velocity[along]);
            [low + back.min(ahead), high + back.max(ahead)]
        };
        if gap <= 0.0 || towards <= gap || lets_through(scene, patches, axis, spans) {
            continue;
        }
        findings.unstable(
            &format!("bodies[{n}].motion.driven.velocity"),
            format!(
                "the body `{}` moves by {} m towards the face {}, which is {} m away and closed to the water where it \
                 crosses: the water in front of it is pressed together without bound",
                body.name,
                number(towards),
                face.name(),
                number(gap)
            ),
            "end its motion before the face, let it reach through the face from the start, or add an opening there",
        );
        return;
    }
}

/// Reports a driven body whose centre moves so far out of the domain that the run ends: by more than its length, beyond
/// a face without an exit.
fn leaves_for_good(scene: &Scene, (n, body): (usize, &NamedBody), findings: &mut Findings) {
    let way = path(body, scene.time.end);
    let exits = scene.exits();
    for axis in (0..scene.grid.dimension).filter(|axis| !scene.grid.periodic[*axis]) {
        let length = scene.grid.size[axis];
        let at = way.map(|way| body.position[axis] + way * body.velocity[axis]);
        let stays =
            |x: &f64| (-length..=2.0 * length).contains(x) || exits[axis][usize::from(*x > 0.0)];
        if at.iter().all(stays) {
            continue;
        }
        findings.unstable(
            &format!("bodies[{n}].motion.driven.velocity"),
            format!(
                "the body `{}` moves out of the domain along {}, to {} m: more than one length of the domain outside, \
                 where the run ends",
                body.name,
                ["x", "y", "z"][axis],
                number(if at[0].abs() > at[1].abs() { at[0] } else { at[1] })
            ),
            "end its motion with a `history`, or let the run end before",
        );
        return;
    }
}

/// Reports two driven discs or spheres that run into each other: neither gives way.
fn run_into_each_other(
    scene: &Scene,
    [(m, one), (n, two)]: [(usize, &NamedBody); 2],
    findings: &mut Findings,
) {
    if one.solid.is_some() || two.solid.is_some() || scene.grid.periodic.contains(&true) {
        return;
    }
    let apart = Vector3::from(two.position) - Vector3::from(one.position);
    let [first, second] = [one, two].map(|body| TimeTable::new(body.history.as_deref(), 1.0));
    let reach = one.radius + two.radius;
    let (mut ways, parts) = ([0.0; 2], 64 * PARTS);
    let part = scene.time.end / f64::from(parts);
    if apart.norm() < reach {
        return;
    }
    for k in 0..parts {
        let from = part * f64::from(k);
        ways[0] += first.mean(from, from + part) * part;
        ways[1] += second.mean(from, from + part) * part;
        let now =
            apart + Vector3::from(two.velocity) * ways[1] - Vector3::from(one.velocity) * ways[0];
        if now.norm() < reach {
            findings.unstable(
                &format!("bodies[{n}].motion.driven.velocity"),
                format!(
                    "the driven bodies `{}` (bodies[{m}]) and `{}` run into each other at {} s: neither gives way, \
                     and the water between them is pressed together without bound",
                    one.name,
                    two.name,
                    number(from + part)
                ),
                "let one of them stop or turn before, or start them farther apart",
            );
            return;
        }
    }
}

/// Reports driven bodies whose paths end runs.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let driven = scene.bodies.iter().enumerate();
    let driven: Vec<(usize, &NamedBody)> = driven
        .filter(|(_, body)| body.mobility == Mobility::Driven)
        .collect();
    for (k, body) in driven.iter().enumerate() {
        leaves_for_good(scene, *body, findings);
        let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
            continue;
        };
        crosses_a_closed_face(scene, flow, *body, findings);
        for other in &driven[..k] {
            run_into_each_other(scene, [*other, *body], findings);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use serde_json::{Value, json};

    /// Returns a disc that is driven upwards in a box of water.
    fn case(motion: &Value, height: f64, faces: &Value) -> Value {
        json!({
            "domain": {"size": [0.006, 0.0125], "spacing": 0.000125, "periodic": ["x"]},
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 4e-5, "relaxation_time": 0.75,
                                            "boundaries": faces}},
            "coupling": {"partially_saturated": {}},
            "bodies": [{"name": "piston", "shape": {"disc": {"radius": 0.0005}}, "position": [0.003, height],
                        "motion": motion, "material": "glass"}],
            "time": {"end": 0.06},
            "output": {}
        })
    }

    /// Returns the number of findings at a path.
    fn found_at(case: &Value, path: &str) -> usize {
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let all = plan.warnings.iter();
        all.filter(|w| w.path == path).count()
    }

    fn findings(motion: &Value, height: f64, faces: &Value) -> usize {
        let case = case(motion, height, faces);
        found_at(&case, "bodies[0].motion.driven.velocity")
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
        // An opening that its path misses does not let it out.
        let misses = json!([{"name": "lid", "face": "y_max", "condition": {"pressure": {"value": 0}},
                             "patch": {"from": [0.001, 0.0125], "to": [0.003, 0.0125]}}]);
        assert_eq!(findings(&up, 0.0075, &misses), 1);
        // It ends more than one height above the domain: the run continues if it has left through an opening.
        let far = json!({"driven": {"velocity": [0, 0.4]}});
        assert_eq!(findings(&far, 0.0075, &opens), 0);
        let mut dry = case(&far, 0.0075, &opens);
        for key in ["fluid", "coupling"] {
            dry.as_object_mut().unwrap().remove(key);
        }
        assert_eq!(found_at(&dry, "bodies[0].motion.driven.velocity"), 1);
        // A second piston comes down onto it.
        let mut down = case(&json!({"driven": {"velocity": [0, 0.02]}}), 0.0055, &opens);
        let mut second = down["bodies"][0].clone();
        second["name"] = json!("second");
        second["position"] = json!([0.003, 0.0075]);
        second["motion"]["driven"]["velocity"] = json!([0, -0.02]);
        down["bodies"].as_array_mut().unwrap().push(second.clone());
        down["domain"]["periodic"] = json!([]);
        assert_eq!(found_at(&down, "bodies[1].motion.driven.velocity"), 1);
        down["bodies"][1]["motion"]["driven"]["velocity"] = json!([0, 0.02]);
        assert_eq!(found_at(&down, "bodies[1].motion.driven.velocity"), 0);
    }
}
