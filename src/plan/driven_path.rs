//! Paths of driven bodies that end runs: through a face of the domain that is closed to the water, far out of the
//! domain, into a structure, and into another body that does not give way.
//!
//! A driven body moves whatever the forces on it are. The water between it and a closed face must flow out of a gap
//! that closes: its pressure grows without bound as the gap goes to zero, as in a squeeze film (Stefan 1874, Reynolds
//! 1886). A disc of 8 cells that was driven through a lid at a lattice velocity of 0.026 ended its run with twice the
//! density of the water; where it reaches a small part of its radius beyond the face, the film is thinner than the
//! cells resolve, and runs hold. A body that reaches through the face from the start leaves no such gap, and a free
//! body is stopped by the water.

use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use base::geometry::Face;
use base::history::TimeTable;
use case::coupling::Coupling;
use nalgebra::Vector3;

/// Number of parts of an interval between two rows of a table in which the path is followed.
const PARTS: u32 = 16;
/// Number of parts of a path in which the section with a face is compared with openings.
const POSITIONS: u32 = 64;
/// Lattice velocity up to which all bodies in saturated cells passed a closed face.
const SLOW: f64 = 0.003;
/// Lattice velocity above which the film before an obstacle has no time to reach its pressure.
const FILM_SPEED: f64 = 0.015;

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

/// Returns how far a driven body reaches beyond a face \[m\] where the face is closed to the water; 0 if it does not. A
/// disc or sphere covers its section with the face, a polyhedron its whole extent.
fn depth_beyond(scene: &Scene, patches: &[ScenePatch], face: Face, body: &NamedBody) -> f64 {
    let [back, ahead] = path(body, scene.time.end);
    let axis = face.axis();
    let inside = |at: f64| {
        if face.is_max() {
            scene.grid.size[axis] - at
        } else {
            at
        }
    };
    if body.solid.is_some() {
        let ends = |along: usize| {
            let [low, high] = extent(body, along);
            let [back, ahead] = [back, ahead].map(|way| way * body.velocity[along]);
            [low + back.min(ahead), high + back.max(ahead)]
        };
        let deepest = ends(axis).map(|at| -inside(at));
        return if lets_through(scene, patches, axis, ends) {
            0.0
        } else {
            deepest[0].max(deepest[1]).max(0.0)
        };
    }
    let depth = (0..=POSITIONS).map(|n| {
        let way = back + (ahead - back) * f64::from(n) / f64::from(POSITIONS);
        let at = |axis: usize| body.position[axis] + way * body.velocity[axis];
        let inside = inside(at(axis));
        let half = (body.radius.powi(2) - inside.max(0.0).powi(2)).max(0.0);
        let half = half.sqrt();
        let section = |along: usize| [at(along) - half, at(along) + half];
        if inside >= body.radius || lets_through(scene, patches, axis, section) {
            0.0
        } else {
            body.radius - inside
        }
    });
    depth.fold(0.0, f64::max)
}

/// Meeting of a driven body with something that does not give way.
struct Meeting {
    /// Distance by which the body reaches beyond its surface \[m\].
    depth: f64,
    /// Radius of the body, or of the smaller one of two \[m\].
    radius: f64,
    /// Radius of curvature of the film between both \[m\].
    curvature: f64,
    /// Largest speed at which both approach [m/s].
    speed: f64,
    obstacle: Obstacle,
}

/// Kind of obstacle that a driven body meets.
#[derive(Clone, Copy)]
enum Obstacle {
    Face,
    Structure,
    FixedBody,
    DrivenBody,
}

impl Obstacle {
    /// Returns the depth in radii beyond which runs ended, with links and with saturated cells.
    fn far(self) -> [f64; 2] {
        match self {
            Self::Face => [0.4, 0.4],
            Self::Structure | Self::DrivenBody => [0.55, 1.5],
            Self::FixedBody => [0.9, 1.5],
        }
    }
}

impl Meeting {
    /// Returns `true` if runs of similar meetings ended.
    ///
    /// Discs of 4 and 8 cells were driven through a lid, into a structure, into a fixed disc and into a driven one,
    /// with lattice velocities U of 0.003, 0.01 and 0.03 and relaxation times of 0.55 to 1 (648 runs). Links held up to
    /// the depths of [`Obstacle::far`], except a few at 0.03. Saturated cells held up to these depths, and farther with
    /// U = 0.003, where the compression in the film, 3 k ν U R/δ² with a thickness δ of one cell and k = 6 and 3 for a
    /// disc and a sphere (`scene::auto::moving`), stayed below the guard; it is twice as large at a structure. A body
    /// with U above 0.015 leaves the film no time to reach more. Farther beyond, the water behind the body is torn off.
    fn fails(&self, scene: &Scene, flow: &Flow) -> bool {
        let [links, saturated] = self
            .obstacle
            .far()
            .map(|far| self.depth > far * self.radius);
        if !matches!(scene.coupling, Some(Coupling::PartiallySaturated(_))) {
            return links;
        }
        let (h, dt) = (scene.grid.spacing, flow.time_step);
        let speed = self.speed * dt / h;
        let viscosity = flow.kinematic_viscosity * dt / (h * h);
        let closer = match self.obstacle {
            Obstacle::Structure => 2.0,
            _ => 1.0,
        };
        let factor = 3.0 * closer * [6.0, 3.0][scene.grid.dimension - 2];
        let film = factor * viscosity * speed.min(FILM_SPEED) * self.curvature / h;
        saturated && speed > SLOW || film > scene.guards.max_compression
    }
}

/// Reports a meeting: unstable if similar runs ended.
fn report(
    (scene, flow): (&Scene, &Flow),
    n: usize,
    meeting: &Meeting,
    (reason, remedy): (String, &str),
    findings: &mut Findings,
) {
    let path = format!("bodies[{n}].motion.driven.velocity");
    if meeting.fails(scene, flow) {
        let reason = format!(
            "{reason}: the water between them is pressed together, and that behind the body is torn off"
        );
        findings.unstable(&path, reason, remedy);
    } else {
        findings.warn(&path, reason, remedy);
    }
}

/// Reports a driven disc or sphere that moves into a structure.
fn moves_into_a_structure(
    scene: &Scene,
    flow: &Flow,
    (n, body): (usize, &NamedBody),
    findings: &mut Findings,
) {
    if body.solid.is_some() {
        return;
    }
    let [back, ahead] = path(body, scene.time.end);
    for structure in scene.structures.iter().filter(|one| one.stops.water()) {
        let depth = |way: f64| {
            let at = std::array::from_fn(|a| body.position[a] + way * body.velocity[a]);
            body.radius - structure.solid.distance(at)
        };
        let ways =
            (0..=POSITIONS).map(|n| back + (ahead - back) * f64::from(n) / f64::from(POSITIONS));
        let deepest = ways.map(depth).fold(0.0, f64::max);
        if deepest <= 0.0 || depth(0.0) > 0.0 {
            continue;
        }
        let meeting = Meeting {
            depth: deepest,
            radius: body.radius,
            curvature: body.radius,
            speed: Vector3::from(body.largest_motion()[0]).norm(),
            obstacle: Obstacle::Structure,
        };
        let reason = format!(
            "the body `{}` moves {} m into the structure `{}`",
            body.name,
            number(deepest),
            structure.name
        );
        let remedy = "end its motion before, by a table in time (`history`) or an earlier end of the run, or move it";
        report((scene, flow), n, &meeting, (reason, remedy), findings);
        return;
    }
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
        let depth = depth_beyond(scene, &flow.faces[face.index()], face, body);
        if gap <= 0.0 || depth <= 0.0 {
            continue;
        }
        let radius = 0.5 * (high - low);
        let meeting = Meeting {
            depth,
            radius,
            curvature: radius,
            speed: body.largest_motion()[0][axis].abs(),
            obstacle: Obstacle::Face,
        };
        let reason = format!(
            "the body `{}` moves by {} m towards the face {}, which is {} m away, and reaches {} m beyond it where it \
             is closed to the water",
            body.name,
            number(towards),
            face.name(),
            number(gap),
            number(depth)
        );
        let remedy = "end its motion before the face, let it reach through the face from the start, or add an \
                      opening there";
        report((scene, flow), n, &meeting, (reason, remedy), findings);
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

/// Reports a driven disc or sphere that runs into another driven one, or into a fixed one: neither gives way.
fn run_into_each_other(
    (scene, flow): (&Scene, &Flow),
    [(m, one), (n, two)]: [(usize, &NamedBody); 2],
    findings: &mut Findings,
) {
    if one.solid.is_some() || two.solid.is_some() || scene.grid.periodic.contains(&true) {
        return;
    }
    let apart = Vector3::from(two.position) - Vector3::from(one.position);
    let driven = |body: &NamedBody| body.mobility == Mobility::Driven;
    let [first, second] = [one, two].map(|body| {
        if driven(body) {
            TimeTable::new(body.history.as_deref(), 1.0)
        } else {
            TimeTable::constant(0.0)
        }
    });
    let reach = one.radius + two.radius;
    let (mut ways, parts) = ([0.0; 2], 64 * PARTS);
    let part = scene.time.end / f64::from(parts);
    if apart.norm() < reach {
        return;
    }
    let (mut depth, mut touch) = (0.0_f64, None);
    for k in 0..parts {
        let from = part * f64::from(k);
        ways[0] += first.mean(from, from + part) * part;
        ways[1] += second.mean(from, from + part) * part;
        let now =
            apart + Vector3::from(two.velocity) * ways[1] - Vector3::from(one.velocity) * ways[0];
        if now.norm() < reach {
            touch = touch.or(Some(from + part));
            depth = depth.max(reach - now.norm());
        }
    }
    let Some(touch) = touch else {
        return;
    };
    let speed = |body: &NamedBody| {
        if driven(body) {
            Vector3::from(body.largest_motion()[0])
        } else {
            Vector3::zeros()
        }
    };
    let meeting = Meeting {
        depth,
        radius: one.radius.min(two.radius),
        curvature: one.radius * two.radius / reach,
        speed: (speed(two) - speed(one)).norm(),
        obstacle: if driven(one) && driven(two) {
            Obstacle::DrivenBody
        } else {
            Obstacle::FixedBody
        },
    };
    let kinds = [one, two].map(|body| if driven(body) { "driven" } else { "fixed" });
    let reason = format!(
        "the {} body `{}` (bodies[{m}]) and the {} body `{}` run into each other at {} s and overlap by {} m, because \
         neither gives way",
        kinds[0],
        one.name,
        kinds[1],
        two.name,
        number(touch),
        number(depth)
    );
    let remedy = "let one of them stop or turn before, or start them farther apart";
    report((scene, flow), n, &meeting, (reason, remedy), findings);
}

/// Reports driven bodies whose paths end runs. One slip gives one finding.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let of = |mobility: Mobility| {
        let bodies = scene.bodies.iter().enumerate();
        bodies.filter(move |(_, body)| body.mobility == mobility)
    };
    let driven: Vec<(usize, &NamedBody)> = of(Mobility::Driven).collect();
    for (k, body) in driven.iter().enumerate() {
        leaves_for_good(scene, *body, findings);
        let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
            continue;
        };
        crosses_a_closed_face(scene, flow, *body, findings);
        let path = format!("bodies[{}].motion.driven.velocity", body.0);
        if !findings.problems.iter().any(|problem| problem.path == path) {
            moves_into_a_structure(scene, flow, *body, findings);
        }
        for other in of(Mobility::Fixed).chain(driven[..k].iter().copied()) {
            if !findings.problems.iter().any(|problem| problem.path == path) {
                run_into_each_other((scene, flow), [other, *body], findings);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
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

    /// Returns the findings at a path.
    fn all_at(case: &Value, path: &str) -> Vec<Problem> {
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let all = plan.warnings.into_iter();
        all.filter(|w| w.path == path).collect()
    }

    /// Returns the number of findings at a path.
    fn found_at(case: &Value, path: &str) -> usize {
        all_at(case, path).len()
    }

    /// Returns the severity of the finding about the first body, if any.
    fn severity(case: &Value) -> Option<Severity> {
        let found = all_at(case, "bodies[0].motion.driven.velocity");
        assert!(found.len() < 2, "{found:#?}");
        found.first().map(|problem| problem.severity)
    }

    /// Returns a disc of 8 cells in radius that is driven upwards with a lattice velocity, to a depth in cells beyond a
    /// height of 40 cells, and ends there, in water with an opening on one side.
    fn pushed(coupling: &Value, (speed, tau): (f64, f64), depth: f64, x: f64) -> Value {
        let (h, nu) = (5e-4, 1e-5);
        let speed = speed * 3.0 * nu / (h * (tau - 0.5));
        json!({
            "domain": {"size": [48.0 * h, 40.0 * h], "spacing": h},
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": nu, "relaxation_time": tau,
                "boundaries": [{"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
                               {"name": "lid", "face": "y_max", "condition": {"pressure": {"value": 0}},
                                "patch": {"from": [0, 0], "to": [16.0 * h, h]}}]}},
            "coupling": coupling,
            "bodies": [{"name": "piston", "shape": {"disc": {"radius": 8.0 * h}}, "position": [x * h, 26.0 * h],
                        "motion": {"driven": {"velocity": [0, speed]}}, "material": "glass"}],
            "time": {"end": (6.0 + depth) * h / speed}
        })
    }

    /// Checks discs that were driven through a lid in runs.
    #[test]
    fn only_a_body_that_presses_the_water_too_far_is_unstable() {
        let (links, cells) = (
            json!({"bounce_back": {}}),
            json!({"partially_saturated": {}}),
        );
        let found = |coupling: &Value, motion: (f64, f64), depth: f64| {
            severity(&pushed(coupling, motion, depth, 30.0))
        };
        let (held, ended) = (Some(Severity::Warning), Some(Severity::Unstable));
        assert_eq!(found(&links, (0.01, 0.55), 2.0), held);
        assert_eq!(found(&links, (0.01, 0.55), 8.0), ended);
        assert_eq!(found(&cells, (0.01, 0.75), 2.0), held);
        assert_eq!(found(&cells, (0.01, 0.75), 12.0), ended);
        assert_eq!(found(&cells, (0.003, 0.75), 12.0), held);
        // The film of viscous water.
        assert_eq!(found(&cells, (0.01, 1.0), 0.5), ended);
        // The part that crosses the lid lies within an opening although the body does not.
        assert_eq!(severity(&pushed(&links, (0.01, 0.55), 0.5, 10.0)), None);
        assert_eq!(severity(&pushed(&links, (0.01, 0.55), 8.0, 10.0)), ended);
    }

    /// Checks discs that were driven into a structure and into a fixed disc in runs.
    #[test]
    fn a_body_that_is_driven_into_a_solid_is_named() {
        let (links, cells) = (
            json!({"bounce_back": {}}),
            json!({"partially_saturated": {}}),
        );
        let found = |coupling: &Value, motion: (f64, f64), depth: f64, solid: &str| {
            let mut case = pushed(coupling, motion, depth, 24.0);
            case["domain"]["size"][1] = json!(0.04);
            if solid == "structure" {
                case["structures"] = json!([{"name": "slab", "material": "glass",
                    "shape": {"box": {"from": [0.004, 0.02], "to": [0.02, 0.026]}}}]);
            } else {
                let fixed = json!({"name": "fixed", "material": "glass", "shape": {"disc": {"radius": 0.003}},
                    "position": [0.012, 0.023], "motion": {"fixed": {}}});
                case["bodies"].as_array_mut().unwrap().push(fixed);
            }
            severity(&case)
        };
        let (held, ended) = (Some(Severity::Warning), Some(Severity::Unstable));
        assert_eq!(found(&links, (0.01, 0.55), 2.4, "structure"), held);
        assert_eq!(found(&links, (0.01, 0.55), 4.8, "structure"), ended);
        assert_eq!(found(&cells, (0.01, 0.55), 9.6, "structure"), held);
        assert_eq!(found(&cells, (0.01, 0.8), 0.8, "structure"), ended);
        assert_eq!(found(&links, (0.01, 0.55), 3.6, "disc"), held);
        assert_eq!(found(&links, (0.01, 0.55), 7.2, "disc"), ended);
        assert_eq!(found(&cells, (0.01, 0.8), 7.2, "disc"), held);
        assert_eq!(found(&links, (0.01, 0.55), -1.0, "disc"), None);
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
