//! Free bodies that driven bodies press against something that does not give way.
//!
//! A driven body, like a wall whose velocity is given, moves whatever the forces on it are. It pushes a free body in
//! front of it against a wall, a structure, a fixed body or another driven body, and from then on the gap between the
//! two is less than the body needs: with a gap g its two contacts overlap by d - g over the diameter d, in radii,
//! however stiff the springs are, until the run ends above `guards.max_overlap`.
//!
//! A body leaves the gap sideways unless friction holds it there: in a wedge of angle α between two surfaces with the
//! friction angle φ it is held if α <= 2 φ, the angle of nip of a roll crusher. Free bodies are followed from their
//! position at the start, at which they stay until something touches them; then they move along the normal of this
//! contact as far as they are pushed. Grains are not followed, because their neighbours move them too.

use super::wall_travel::Travel;
use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::findings::{Findings, number};
use crate::scene::structures::Structure;
use crate::scene::walls::SceneWall;
use base::history::TimeTable;
use base::number::{real, whole};
use nalgebra::Vector3;

/// Overlap in radii above which a contact is no longer small.
const LARGE: f64 = 0.1;
/// Path between two positions that are compared, in radii of the free body.
const PATH: f64 = 0.02;
/// Smallest number of positions that are compared, and the largest for which a body is followed.
const LEAST: f64 = 64.0;
const MOST: f64 = 65_536.0;
/// Angle of a wedge without friction \[rad\] that still counts as none.
const STRAIGHT: f64 = 1e-3;

/// Disc, sphere or wall with a given motion.
enum Given<'a> {
    Ball(&'a NamedBody, TimeTable),
    Plane(&'a SceneWall, Travel),
    Structure(&'a Structure),
}

impl<'a> Given<'a> {
    /// Returns the named bodies, plane walls and structures of a scene that no force moves.
    fn all(scene: &'a Scene) -> Vec<Self> {
        let bodies = scene.bodies.iter();
        let bodies = bodies.filter(|body| body.mobility != Mobility::Free && body.solid.is_none());
        let balls = bodies.map(|body| {
            let factors = match body.mobility {
                Mobility::Driven => TimeTable::new(body.history.as_deref(), 1.0),
                _ => TimeTable::constant(0.0),
            };
            Self::Ball(body, factors)
        });
        let walls = scene.walls.iter();
        let walls =
            walls.filter(|wall| wall.surface.is_none() && wall.servo.is_none() && !wall.temporary);
        let planes = walls.map(|wall| Self::Plane(wall, Travel::for_wall(wall)));
        let structures = scene.structures.iter().filter(|one| one.stops.grains());
        balls
            .chain(planes)
            .chain(structures.map(Self::Structure))
            .collect()
    }

    fn name(&self) -> String {
        match self {
            Self::Ball(body, _) => format!("the body `{}`", body.name),
            Self::Plane(wall, _) => format!("the wall `{}`", wall.name),
            Self::Structure(structure) => format!("the structure `{}`", structure.name),
        }
    }

    /// Returns the index of the material.
    fn material(&self) -> usize {
        match self {
            Self::Ball(body, _) => body.material,
            Self::Plane(wall, _) => wall.material,
            Self::Structure(structure) => structure.material.unwrap_or(0),
        }
    }

    /// Returns the displacement in an interval \[m\].
    fn moved(&self, from: f64, to: f64) -> Vector3<f64> {
        match self {
            Self::Ball(body, factors) => {
                Vector3::from(body.velocity) * (factors.mean(from, to) * (to - from))
            }
            Self::Plane(_, travel) => travel.moved(from, to),
            Self::Structure(_) => Vector3::zeros(),
        }
    }

    /// Returns the largest speed [m/s].
    fn fastest(&self) -> f64 {
        match self {
            Self::Ball(body, factors) => Vector3::from(body.velocity).norm() * factors.largest(),
            Self::Plane(_, travel) => travel.fastest(),
            Self::Structure(_) => 0.0,
        }
    }

    /// Returns the gap \[m\] to a ball and the unit vector from this solid to it, after a displacement of this solid;
    /// none while it does not exist.
    fn gap(
        &self,
        (at, radius): (&Vector3<f64>, f64),
        moved: &Vector3<f64>,
        time: f64,
    ) -> Option<(f64, Vector3<f64>)> {
        match self {
            Self::Ball(body, _) => {
                let apart = at - Vector3::from(body.position) - moved;
                let distance = apart.norm();
                (distance > 0.0).then(|| (distance - body.radius - radius, apart / distance))
            }
            Self::Plane(wall, _) => {
                let normal = Vector3::from(wall.normal);
                let height = normal.dot(&(at - Vector3::from(wall.point) - moved));
                wall.exists(time).then_some((height - radius, normal))
            }
            Self::Structure(structure) => {
                let distance = |at: Vector3<f64>| structure.solid.distance(at.into());
                let step = 1e-3 * radius;
                let slope = Vector3::from_fn(|axis, _| {
                    let mut away = Vector3::zeros();
                    away[axis] = step;
                    distance(at + away) - distance(at - away)
                });
                (slope.norm() > 0.0).then(|| (distance(*at) - radius, slope.normalize()))
            }
        }
    }
}

/// Squeeze of a free body.
struct Squeeze {
    /// Overlap of its contacts in radii.
    part: f64,
    /// Time at which it touches both sides \[s\].
    time: f64,
}

/// Follows a free body that `pusher` touches first, and returns how `stop` squeezes it; none if it does not.
fn squeeze(
    scene: &Scene,
    body: &NamedBody,
    [pusher, stop]: [&Given<'_>; 2],
    friction: f64,
) -> Option<Squeeze> {
    let (radius, end) = (body.radius, scene.time.end);
    let parts = (pusher.fastest() + stop.fastest()) * end / (PATH * radius);
    let parts = Some(parts).filter(|parts| *parts <= MOST)?;
    let parts = whole(parts.max(LEAST));
    let widest = 2.0 * friction.atan() + STRAIGHT;
    let mut at = Vector3::from(body.position);
    let (mut of_pusher, mut of_stop) = (Vector3::zeros(), Vector3::zeros());
    let (mut touched, mut found) = (false, None);
    for n in 0..parts {
        let [from, to] = [n, n + 1].map(|n| end * real(n) / real(parts));
        of_pusher += pusher.moved(from, to);
        of_stop += stop.moved(from, to);
        let (push, ahead) = pusher.gap((&at, radius), &of_pusher, to)?;
        if push < 0.0 && found.is_none() {
            at -= ahead * push;
            touched = true;
        }
        let (gap, back) = stop.gap((&at, radius), &of_stop, to)?;
        match &mut found {
            None if gap >= 0.0 => {}
            None if !touched || ahead.angle(&-back) > widest => return None,
            None => {
                found = Some(Squeeze {
                    part: 0.0,
                    time: to,
                })
            }
            Some(Squeeze { part, .. }) => *part = part.max(-0.5 * (push + gap) / radius),
        }
    }
    found.filter(|found| found.part > LARGE)
}

/// Returns the smaller coefficient of friction of a free body at two solids.
fn friction(scene: &Scene, body: &NamedBody, pair: [&Given<'_>; 2]) -> f64 {
    let own = body.material;
    let coefficient = |other: usize| {
        let materials = [own, other].map(base::number::to_u32);
        scene
            .contact
            .as_ref()
            .map_or(0.0, |law| law.model().friction(materials))
    };
    let [one, two] = pair.map(|given| coefficient(given.material()));
    one.min(two)
}

/// Reports the first free body that a driven body squeezes and that is not among those `named`, and names it.
fn check_pusher<'a>(
    scene: &'a Scene,
    (path, pusher): (&str, &Given<'_>),
    stops: &[Given<'_>],
    named: &mut Vec<&'a str>,
    findings: &mut Findings,
) {
    let free = |body: &&NamedBody| {
        body.mobility == Mobility::Free
            && body.solid.is_none()
            && !named.contains(&body.name.as_str())
    };
    let bodies: Vec<&NamedBody> = scene.bodies.iter().filter(free).collect();
    for body in bodies {
        for stop in stops.iter().filter(|stop| !std::ptr::eq(*stop, pusher)) {
            // Two planes are compared by their paths alone.
            if matches!((pusher, stop), (Given::Plane(..), Given::Plane(..))) {
                continue;
            }
            let friction = friction(scene, body, [pusher, stop]);
            let Some(Squeeze { part, time }) = squeeze(scene, body, [pusher, stop], friction)
            else {
                continue;
            };
            let reason = format!(
                "{} pushes the body `{}` against {}, where it arrives at {} s and friction holds it: its contacts \
                 overlap by up to {} of its radius, whatever their stiffness is",
                pusher.name(),
                body.name,
                stop.name(),
                number(time),
                number(part)
            );
            let remedy = "stop it before, by a table in time (`history`) or an earlier end of the run, or move the \
                          free body out of its way";
            // Gravity may move the free body before it is touched.
            let stays = scene.gravity.iter().all(|g| *g == 0.0);
            if part >= scene.guards.max_overlap && stays {
                findings.unstable(path, reason, remedy);
            } else {
                findings.warn(path, reason, remedy);
            }
            named.push(&body.name);
            return;
        }
    }
}

/// Reports free bodies that driven bodies, or walls with a given velocity, squeeze.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    if scene.contact.is_none() || scene.grid.periodic.contains(&true) {
        return;
    }
    let given = Given::all(scene);
    if given.iter().all(|one| one.fastest() == 0.0) {
        return;
    }
    let mut named = Vec::new();
    for pusher in given.iter().filter(|one| one.fastest() > 0.0) {
        let path = match pusher {
            Given::Ball(body, _) => {
                let n = scene.bodies.iter().position(|one| std::ptr::eq(one, *body));
                format!("bodies[{}].motion.driven.velocity", n.unwrap_or_default())
            }
            Given::Plane(wall, _) => {
                let n = scene.walls.iter().position(|one| std::ptr::eq(one, *wall));
                format!("walls[{}].velocity", n.unwrap_or_default())
            }
            Given::Structure(_) => continue,
        };
        // One slip gives one finding.
        if !findings.problems.iter().any(|problem| problem.path == path) {
            check_pusher(scene, (&path, pusher), &given, &mut named, findings);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::Document;
    use serde_json::{Value, json};

    fn disc(name: &str, at: [f64; 2], radius: f64, motion: Value) -> Value {
        json!({"name": name, "material": "steel", "shape": {"disc": {"radius": radius}}, "position": at,
               "motion": motion})
    }

    /// Returns the finding about the motion of the first body.
    fn found(bodies: &[Value], more: &[(&str, Value)]) -> Option<Problem> {
        let mut case = json!({
            "domain": {"size": [0.03, 0.02], "spacing": 5e-4},
            "materials": {"steel": {"density": 2000}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.2,
                                   "normal_stiffness": {"absolute": 5000}}},
            "bodies": bodies,
            "time": {"end": 2.0}
        });
        for (key, value) in more {
            case[key] = value.clone();
        }
        let document = Document::read(&case.to_string(), &[], std::path::Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        let mut all = plan.warnings.into_iter();
        all.find(|w| w.path == "bodies[0].motion.driven.velocity")
    }

    fn driven(speed: f64) -> Value {
        json!({"driven": {"velocity": [speed, 0]}})
    }

    fn stop() -> (&'static str, Value) {
        let shape = json!({"plane": {"normal": [1, 0], "point": [0.01, 0]}});
        (
            "walls",
            json!([{"name": "stop", "material": "steel", "shape": shape}]),
        )
    }

    /// Checks a disc between a driven disc and a wall: the driven one has 4 mm to the free one, which has 2 mm to the
    /// wall.
    #[test]
    fn a_disc_between_a_driven_one_and_a_wall_is_named() {
        let pair = |height: f64, end: f64| {
            let bodies = [
                disc("ram", [0.025, height], 0.003, driven(-0.004)),
                disc("free", [0.015, 0.01], 0.003, json!({"free": {}})),
            ];
            found(&bodies, &[stop(), ("time", json!({"end": end}))])
        };
        let known = pair(0.01, 3.0).unwrap();
        assert_eq!(known.severity, Severity::Unstable, "{known}");
        // (0.004 + 0.002) m at 0.004 m/s; then 6 mm more, as much as the diameter.
        assert!(known.reason.contains("arrives at 1.5"), "{known}");
        assert_eq!(pair(0.01, 1.5), None);
        assert_eq!(pair(0.01, 2.0).unwrap().severity, Severity::Warning);
        // Without friction at the pushing disc the angle θ between its path and the normal grows: with R = 6 mm the
        // free disc moves ahead by R (ln tan θ/2 + cos θ) between two angles. After 2 mm θ is 40 degrees, twice the
        // angle of friction, if it was 25.65 degrees at first: an offset of 2.60 mm.
        assert_eq!(pair(0.0127, 3.0), None);
        assert!(pair(0.0125, 3.0).is_some());
    }

    #[test]
    fn whatever_does_not_give_way_counts() {
        let ram = || disc("ram", [0.01, 0.01], 0.003, driven(0.004));
        let free = || disc("free", [0.016, 0.01], 0.001, json!({"free": {}}));
        for motion in [json!({"fixed": {}}), driven(-0.002)] {
            let other = disc("other", [0.022, 0.01], 0.003, motion);
            assert!(found(&[ram(), free(), other], &[]).is_some());
        }
        let other = disc("other", [0.022, 0.01], 0.003, json!({"free": {}}));
        assert_eq!(found(&[ram(), free(), other], &[]), None);
        let block = json!([{"name": "block", "material": "steel",
                            "shape": {"box": {"from": [0.019, 0], "to": [0.025, 0.02]}}}]);
        assert!(found(&[ram(), free()], &[("structures", block)]).is_some());
        assert_eq!(found(&[ram(), free()], &[]), None);
    }
}
