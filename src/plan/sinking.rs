//! Free bodies and grains that sink, or rise, onto a face of the domain that is closed to the water and has no wall.
//!
//! The face stops the water, and only a wall stops a body. Links resolve the film between the two down to about a cell;
//! a body that is pulled on leaves no cell between its surface and the face, and the water there is pressed together or
//! torn off. With an opening elsewhere, discs of 5 and 6 cells at 1.5 to 2.65 times the density of water ended their
//! runs so, with half-way and interpolated links alike; an enclosed box, whose mean pressure rises, and partially
//! saturated cells let them through the face, out of the water. The same discs with a wall there came to rest.
//!
//! Without a fluid a body falls freely through such a face, until it is more than one length of the domain outside.

use super::driven_path::{extent, lets_through};
use crate::scene::Scene;
use crate::scene::auto::moving::{ReachedFace, reached_faces};
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use crate::scene::grains::GrainSource;
use crate::scene::speed::settling;
use crate::scene::walls::SceneWall;
use base::error::Remedy;
use base::geometry::Face;
use case::coupling::Coupling;
use nalgebra::Vector3;
use serde_json::json;

/// Ratio of the estimated path to the distance of a face from which on a body reaches it for certain: the estimate
/// starts at the terminal velocity, and walls near the body slow it. Of 14 discs and spheres in random scenes with a
/// larger ratio 12 ended their runs; of five with 2 to 3.2 one did.
const CERTAIN: f64 = 3.5;
/// Number of positions on the way to a face at which structures are looked for.
const SAMPLES: u32 = 64;
/// Largest number of grains that are compared.
const MOST_GRAINS: usize = 1000;

/// Free body or grain of a case.
struct Solid<'a> {
    name: String,
    path: String,
    /// Index among the named bodies, and the body.
    body: Option<(usize, &'a NamedBody)>,
    position: [f64; 3],
    radius: f64,
    material: usize,
}

impl<'a> Solid<'a> {
    fn of_body(n: usize, body: &'a NamedBody) -> Self {
        Self {
            name: format!("the body `{}`", body.name),
            path: format!("bodies[{n}].motion.free"),
            body: Some((n, body)),
            position: body.position,
            radius: body.radius,
            material: body.material,
        }
    }

    /// Returns the smallest and largest coordinate along an axis \[m\].
    fn extent(&self, axis: usize) -> [f64; 2] {
        let ball = [
            self.position[axis] - self.radius,
            self.position[axis] + self.radius,
        ];
        self.body.map_or(ball, |(_, body)| extent(body, axis))
    }

    /// Returns the diameter \[m\]; for a polyhedron that of the sphere of equal volume.
    fn diameter(&self) -> f64 {
        self.body
            .map_or(2.0 * self.radius, |(_, body)| settling::diameter(body))
    }
}

/// Returns `true` if something before the face may stop a solid.
fn is_stopped(scene: &Scene, solid: &Solid<'_>, reached: ReachedFace) -> bool {
    let ReachedFace { face, drop, .. } = reached;
    let out = -Vector3::from(face.inward());
    let facing =
        |wall: &SceneWall| wall.surface.is_none() && Vector3::from(wall.normal).dot(&out) < -0.5;
    if (scene.walls.iter()).any(|wall| !wall.temporary && (wall.surface.is_some() || facing(wall)))
    {
        return true;
    }
    let start = Vector3::from(solid.position);
    let structures = scene.structures.iter().filter(|one| one.stops.grains());
    let hit = |way: f64| {
        let at = (start + out * way).into();
        structures
            .clone()
            .any(|one| one.solid.distance(at) < solid.radius)
    };
    let dry = scene.flow.is_none();
    let own = solid.body.map(|(n, _)| n);
    let others = scene.bodies.iter().enumerate();
    let mut others =
        others.filter(|(m, other)| Some(*m) != own && (dry || other.mobility != Mobility::Free));
    let below = |other: &NamedBody| {
        let apart = Vector3::from(other.position) - start;
        let aside = apart - out * apart.dot(&out);
        apart.dot(&out) > 0.0 && aside.norm() < solid.radius + other.radius
    };
    (0..=SAMPLES).any(|k| hit(drop * f64::from(k) / f64::from(SAMPLES)))
        || others.any(|(_, other)| below(other))
}

/// Returns the remedy that adds a wall at a face.
fn with_wall(scene: &Scene, face: Face) -> Remedy {
    let mut closed: Vec<Face> = scene.walls.iter().filter_map(|wall| wall.face).collect();
    closed.push(face);
    closed.sort_by_key(|face| face.index());
    let text = format!(
        "add \"{}\" to `box_walls`, which stops bodies there",
        face.name()
    );
    Remedy::from(text).set("box_walls", json!(closed))
}

/// Returns how far a body moves away from a face at most, by its initial velocity, before weight and buoyancy turn it
/// \[m\], and how long that takes \[s\].
fn rise_before(scene: &Scene, flow: &Flow, body: &NamedBody, face: Face) -> [f64; 2] {
    let away = Vector3::from(face.inward()).dot(&Vector3::from(body.velocity));
    let heavier = (1.0 - flow.density / scene.density(body.material)).abs();
    let pull = heavier * scene.gravity[face.axis()].abs();
    if away <= 0.0 || pull <= 0.0 {
        return [0.0; 2];
    }
    [0.5 * away * away / pull, away / pull]
}

/// Reports the first face without a wall onto which a solid sinks; returns `true` if there is one.
fn check_solid(scene: &Scene, flow: &Flow, solid: &Solid<'_>, findings: &mut Findings) -> bool {
    let speed = settling::body_settling_speed(scene, flow, solid.diameter(), solid.material);
    let open = flow
        .patches()
        .any(|patch| patch.condition.model().passes_water());
    let ball = (solid.position, solid.radius, solid.material);
    for reached in reached_faces(scene, flow, ball, speed) {
        let ReachedFace { face, drop, path } = reached;
        let patches = &flow.faces[face.index()];
        let spans = |along: usize| solid.extent(along);
        if lets_through(scene, patches, face.axis(), spans) || is_stopped(scene, solid, reached) {
            continue;
        }
        let heavier = scene.density(solid.material) > flow.density;
        let reason = format!(
            "{} is {} than the water and {} to the face {}, {} m away, before the run ends: the face is closed to the \
             water there, but no wall stops solids",
            solid.name,
            if heavier { "heavier" } else { "lighter" },
            if heavier { "sinks" } else { "rises" },
            face.name(),
            number(drop)
        );
        let links = matches!(scene.coupling, Some(Coupling::BounceBack(_)));
        // Other grains may hold a grain up.
        let certain = solid.body.is_some_and(|(_, body)| {
            let [rise, time] = rise_before(scene, flow, body, face);
            let left = path * (1.0 - time / scene.time.end);
            left > CERTAIN * (drop + rise)
        });
        if certain && links && open {
            findings.unstable(
                &solid.path,
                format!("{reason}, and the water between them is pressed together without bound"),
                with_wall(scene, face),
            );
        } else {
            findings.warn(&solid.path, reason, with_wall(scene, face));
        }
        return true;
    }
    false
}

/// Reports the first of the listed grains that sinks onto a face without a wall.
fn check_grains(scene: &Scene, flow: &Flow, findings: &mut Findings) {
    let Some(grains) = &scene.grains else {
        return;
    };
    let (GrainSource::List(list) | GrainSource::File { grains: list, .. }) = &grains.source else {
        return;
    };
    // One slip gives one finding.
    if findings
        .problems
        .iter()
        .any(|problem| problem.path == "box_walls")
    {
        return;
    }
    for (n, grain) in list.iter().enumerate().take(MOST_GRAINS) {
        let solid = Solid {
            name: format!("grain {n}"),
            path: "grains.initial".into(),
            body: None,
            position: grain.position,
            radius: grain.radius,
            material: grain.material,
        };
        if check_solid(scene, flow, &solid, findings) {
            return;
        }
    }
}

/// Reports the face without a wall through which a body falls so far, without a fluid, that the run ends.
fn check_fall(scene: &Scene, (n, body): (usize, &NamedBody), findings: &mut Findings) {
    for axis in (0..scene.grid.dimension).filter(|axis| !scene.grid.periodic[*axis]) {
        let pull = scene.gravity[axis];
        let upward = pull > 0.0;
        let face = Face::ALL[2 * axis + usize::from(upward)];
        let sign = if upward { 1.0 } else { -1.0 };
        let way = if upward {
            scene.grid.size[axis] - body.position[axis]
        } else {
            body.position[axis]
        };
        let (end, drop) = (scene.time.end, way - body.radius);
        let path = (0.5 * pull.abs() * end + sign * body.velocity[axis]) * end;
        let reached = ReachedFace { face, drop, path };
        let stays = pull == 0.0 || path <= way + scene.grid.size[axis];
        if stays || is_stopped(scene, &Solid::of_body(n, body), reached) {
            continue;
        }
        findings.unstable(
            &format!("bodies[{n}].motion.free"),
            format!(
                "gravity pulls the body `{}` through the face {}, where no wall stops it, to more than one length of \
                 the domain outside, where the run ends",
                body.name,
                face.name()
            ),
            with_wall(scene, face),
        );
        return;
    }
}

/// Reports free bodies that sink, rise or fall onto faces without walls.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let bodies = scene.bodies.iter().enumerate();
    let free = bodies.filter(|(_, body)| body.mobility == Mobility::Free);
    let dry = scene.flow.is_none() && scene.seepage.is_none() && scene.joints.is_none();
    // Grains and other free bodies may hold a body up.
    let alone = scene.grains.is_none() && scene.blocks.is_none();
    for body in free {
        match &scene.flow {
            Some(flow) if scene.surface.is_none() => {
                let (n, body) = body;
                check_solid(scene, flow, &Solid::of_body(n, body), findings);
            }
            None if dry && alone => check_fall(scene, body, findings),
            _ => {}
        }
    }
    if let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) {
        check_grains(scene, flow, findings);
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::Document;
    use serde_json::{Value, json};

    /// Returns a disc of 10 cells that sinks in water with an opening at its right side.
    fn case(more: &[(&str, Value)]) -> Value {
        let mut case = json!({
            "domain": {"size": [0.02, 0.012], "spacing": 5e-4},
            "gravity": [0, -0.2],
            "materials": {"glass": {"density": 1500}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.7,
                "boundaries": [{"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}}]
            }},
            "coupling": {"bounce_back": {"scheme": "half_way"}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.5}},
            "bodies": [{"name": "disc", "material": "glass", "shape": {"disc": {"radius": 0.0025}},
                        "position": [0.009, 0.004], "motion": {"free": {}}}],
            "time": {"end": 3.0}
        });
        for (path, value) in more {
            *case.pointer_mut(path).unwrap() = value.clone();
        }
        case
    }

    /// Returns the finding about the motion of the disc, if any.
    fn found(case: &Value) -> Option<Problem> {
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        let mut all = plan.warnings.into_iter();
        let about = ["bodies[0].motion.free", "grains.initial"];
        all.find(|w| about.contains(&w.path.as_str()) && w.reason.contains("no wall"))
    }

    #[test]
    fn a_disc_that_sinks_onto_a_face_without_a_wall_is_named() {
        let known = found(&case(&[])).unwrap();
        assert_eq!(known.severity, Severity::Unstable, "{known}");
        let proposal = &known.remedy.proposal()[0];
        assert_eq!(
            (proposal.path.as_str(), &proposal.value),
            ("box_walls", &json!(["y_min"]))
        );
        // It rises if it is lighter, and sinks along gravity.
        let light = case(&[("/materials/glass/density", json!(700))]);
        assert!(
            found(&light)
                .unwrap()
                .reason
                .contains("rises to the face y_max")
        );
        let aside = case(&[("/gravity", json!([-0.2, 0]))]);
        assert!(
            found(&aside)
                .unwrap()
                .reason
                .contains("sinks to the face x_min")
        );
        // A grain is judged like a body.
        let mut grain = case(&[
            ("/bodies/0/motion", json!({"fixed": {}})),
            ("/bodies/0/position", json!([0.016, 0.008])),
        ]);
        let list = json!([{"position": [0.009, 0.004], "radius": 0.0025}]);
        grain["grains"] = json!({"material": "glass", "initial": {"list": list}});
        grain["box_walls"] = json!(["x_min"]);
        let known = found(&grain).unwrap();
        assert_eq!(known.path, "grains.initial");
        assert_eq!(known.remedy.proposal()[0].value, json!(["x_min", "y_min"]));
        // Thrown upwards it sinks later.
        let thrown = case(&[("/bodies/0/motion", json!({"free": {"velocity": [0, 0.05]}}))]);
        assert_eq!(found(&thrown).unwrap().severity, Severity::Warning);
        let slow = case(&[("/bodies/0/motion", json!({"free": {"velocity": [0, 1e-4]}}))]);
        assert_eq!(found(&slow).unwrap().severity, Severity::Unstable);
        // Saturated cells let it through the face.
        let saturated = case(&[("/coupling", json!({"partially_saturated": {}}))]);
        assert_eq!(found(&saturated).unwrap().severity, Severity::Warning);
    }

    /// Checks a fall without a fluid: in 3 s under 0.2 m/s² it is 0.9 m.
    #[test]
    fn a_disc_that_falls_out_of_a_dry_box_is_named() {
        let mut dry = case(&[]);
        for key in ["fluid", "coupling"] {
            dry.as_object_mut().unwrap().remove(key);
        }
        let found = |case: &Value| found(case).map(|known| known.severity);
        assert_eq!(found(&dry), Some(Severity::Unstable));
        // Thrown upwards at 0.3 m/s it is back after 3 s.
        let mut thrown = dry.clone();
        thrown["bodies"][0]["motion"]["free"]["velocity"] = json!([0, 0.3]);
        assert_eq!(found(&thrown), None);
        dry["box_walls"] = json!(["y_min"]);
        assert_eq!(found(&dry), None);
    }

    #[test]
    fn a_disc_that_stops_before_or_leaves_is_not_named() {
        let mut stopped = vec![
            case(&[("/time/end", json!(0.05))]),
            case(&[("/gravity", json!([0.2, 0]))]),
            case(&[("/materials/glass/density", json!(1000))]),
        ];
        let with = |key: &str, value: Value| {
            let mut case = case(&[]);
            case[key] = value;
            case
        };
        stopped.push(with("box_walls", json!(["y_min"])));
        let floor = json!([{"name": "floor", "material": "glass", "shape": {"plane": {"normal": [0, 1],
                            "point": [0, 0.0005]}}}]);
        stopped.push(with("walls", floor));
        let sill = json!([{"name": "sill", "material": "glass",
                           "shape": {"box": {"from": [0.004, -0.001], "to": [0.014, 0.0008]}}}]);
        stopped.push(with("structures", sill));
        let below = json!({"name": "plate", "material": "glass", "shape": {"disc": {"radius": 0.0005}},
                           "position": [0.01, 0.0006], "motion": {"fixed": {}}});
        let mut held = case(&[("/domain/spacing", json!(2.5e-4))]);
        held["bodies"].as_array_mut().unwrap().push(below);
        stopped.push(held);
        for case in &stopped {
            assert_eq!(found(case), None, "{case}");
        }
    }
}
