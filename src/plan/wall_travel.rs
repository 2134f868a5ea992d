//! Gaps that moving walls leave for the bodies in front of them.
//!
//! A wall whose velocity is given moves whatever the forces on it are. A body between it and a wall that does not give
//! way needs its thickness d. In a gap g < d its two contacts overlap by (d - g)/2 each, d - g over d in radii, however
//! stiff the springs are: the run ends above `guards.max_overlap`. A moving wall does not touch fixed bodies, and
//! passes through them.
//!
//! The path of a wall is the integral of its table in time. Planes are compared with all planes that face them, box
//! walls included; walls of facets with planes in front of them, and with the bounding boxes of other facets there.

use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::findings::{Findings, number};
use crate::scene::grains::GrainSource;
use crate::scene::observe::RegionAction;
use crate::scene::walls::SceneWall;
use base::history::TimeTable;
use dem::polyhedron::Piece;
use nalgebra::Vector3;

/// Overlap in radii above which a contact is no longer small.
const LARGE: f64 = 0.1;
/// Scalar product of unit normals of planes that face each other.
const FACING: f64 = -0.999;
/// Number of parts of an interval between two rows of tables in which positions are compared.
const PARTS: u32 = 16;

/// Body or grain at the start.
struct Standing {
    name: String,
    at: Vector3<f64>,
    /// Diameter of the inscribed sphere \[m\].
    thickness: f64,
    /// Vertices of a polyhedron relative to its centre; none of a ball.
    corners: Vec<Vector3<f64>>,
    moves: bool,
}

impl Standing {
    fn ball(name: String, at: [f64; 3], radius: f64, moves: bool) -> Self {
        Self {
            name,
            at: at.into(),
            thickness: 2.0 * radius,
            corners: Vec::new(),
            moves,
        }
    }

    /// Returns the smallest coordinate along a direction \[m\].
    fn lowest(&self, along: &Vector3<f64>) -> f64 {
        let corners = self.corners.iter().map(|corner| corner.dot(along));
        let low = corners.reduce(f64::min).unwrap_or(-0.5 * self.thickness);
        self.at.dot(along) + low
    }
}

/// Returns the bodies, blocks and grains at the start; of prepared grains one at the middle of each box.
fn standing(scene: &Scene) -> Vec<Standing> {
    let mut all = Vec::new();
    let polyhedron = |name: String, solid: &dem::polyhedron::PlacedPolyhedron, moves: bool| {
        let corners = solid.vertices().into_iter();
        Standing {
            name,
            at: solid.position,
            thickness: Piece::from_polyhedron(solid).thickness(),
            corners: corners.map(|corner| corner - solid.position).collect(),
            moves,
        }
    };
    // The gap in front of a driven body follows from its own path.
    let bodies = scene.bodies.iter();
    for body in bodies.filter(|body| body.mobility != Mobility::Driven) {
        let name = format!("body `{}`", body.name);
        let moves = body.mobility == Mobility::Free;
        all.push(match &body.solid {
            None => Standing::ball(name, body.position, body.radius, moves),
            Some(solid) => polyhedron(name, solid, moves),
        });
    }
    let blocks = scene.blocks.iter().flat_map(|blocks| &blocks.list);
    all.extend(
        blocks
            .enumerate()
            .map(|(n, block)| polyhedron(format!("block {n}"), &block.solid, !block.fixed)),
    );
    let Some(grains) = &scene.grains else {
        return all;
    };
    let smallest = grains.radii.map_or(0.0, |(least, _)| least);
    let mut prepared = |from: [f64; 3], to: [f64; 3]| {
        let middle = std::array::from_fn(|a| 0.5 * (from[a] + to[a]));
        all.push(Standing::ball(
            "the smallest grain".into(),
            middle,
            smallest,
            true,
        ));
    };
    match &grains.source {
        GrainSource::List(list) | GrainSource::File { grains: list, .. } => {
            all.extend(list.iter().enumerate().map(|(n, grain)| {
                Standing::ball(format!("grain {n}"), grain.position, grain.radius, true)
            }));
        }
        GrainSource::Growth { block, .. } => prepared(block.from, block.to),
        GrainSource::Deposition { clouds, .. } => {
            for cloud in clouds {
                prepared(cloud.block.from, cloud.block.to);
            }
        }
    }
    all.retain(|one| one.thickness > 0.0);
    all
}

/// Motion of a wall.
pub(super) struct Travel {
    velocity: Vector3<f64>,
    factors: TimeTable,
}

impl Travel {
    /// Returns the motion of a wall; without one for servo walls, whose motion follows from their stress.
    pub(super) fn for_wall(wall: &SceneWall) -> Self {
        let velocity = Vector3::from(wall.velocity);
        let drift = match &wall.surface {
            None => Vector3::from(wall.normal) * velocity.dot(&Vector3::from(wall.normal)),
            // A velocity along all facets only drags.
            Some(surface) => surface.moving(&velocity),
        };
        Self {
            velocity: if wall.servo.is_some() {
                Vector3::zeros()
            } else {
                drift
            },
            factors: TimeTable::new(wall.history.as_deref(), 1.0),
        }
    }

    fn moves(&self) -> bool {
        self.velocity.norm() > 0.0
    }

    /// Returns the largest speed [m/s].
    pub(super) fn fastest(&self) -> f64 {
        self.velocity.norm() * self.factors.largest()
    }

    /// Returns the displacement in an interval \[m\].
    pub(super) fn moved(&self, from: f64, to: f64) -> Vector3<f64> {
        self.velocity * (self.factors.mean(from, to) * (to - from))
    }

    /// Returns the displacements \[m\] at times \[s\] in ascending order, of which the first is 0.
    fn displacements(&self, times: &[f64]) -> Vec<Vector3<f64>> {
        let mut path = 0.0;
        let mut before = 0.0;
        let each = times.iter().map(|time| {
            path += self.factors.mean(before, *time) * (time - before);
            before = *time;
            self.velocity * path
        });
        each.collect()
    }
}

/// Moving wall with all that its gaps depend on.
struct Mover<'a> {
    scene: &'a Scene,
    wall: &'a SceneWall,
    /// Unit vector into the grains: the normal of a plane, or the direction in which facets move first.
    ahead: Vector3<f64>,
    /// Times at which positions are compared \[s\].
    times: &'a [f64],
    /// Displacements at these times.
    moved: Vec<Vector3<f64>>,
    /// Lowest and highest coordinates of facets; none of a plane.
    ends: Option<[[f64; 3]; 2]>,
}

impl Mover<'_> {
    /// Returns the coordinate \[m\] of the front of the wall along `ahead` at the start.
    fn front(&self) -> f64 {
        match &self.wall.surface {
            None => self.ahead.dot(&Vector3::from(self.wall.point)),
            Some(surface) => {
                let corners = (0..surface.len()).flat_map(|facet| surface.corners(facet));
                corners
                    .map(|corner| corner.dot(&self.ahead))
                    .fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }

    /// Returns `true` if a point lies in front of the wall, and not at its side.
    fn faces(&self, at: &Vector3<f64>) -> bool {
        let beside = self.ends.is_some_and(|[low, high]| {
            let main = self.ahead.iamax();
            (0..self.scene.grid.dimension)
                .filter(|a| *a != main)
                .any(|a| !(low[a]..=high[a]).contains(&at[a]))
        });
        !beside && at.dot(&self.ahead) > self.front()
    }

    /// Returns the gap \[m\] in front of the wall at each time, up to another wall whose displacements are given; none
    /// if the other wall does not face this one. Infinite while one of the two is not there.
    fn room(&self, other: &SceneWall, moved: &[Vector3<f64>]) -> Option<Vec<f64>> {
        let normal = Vector3::from(other.normal);
        let place = match &other.surface {
            None if normal.dot(&self.ahead) < FACING => self.ahead.dot(&Vector3::from(other.point)),
            None => return None,
            Some(_) => {
                let [low, high] = ends(other)?;
                let main = self.ahead.iamax();
                let place = if self.ahead[main] > 0.0 {
                    low[main]
                } else {
                    -high[main]
                };
                let beside = self.ends.is_some_and(|[from, to]| {
                    let axes = (0..self.scene.grid.dimension).filter(|a| *a != main);
                    axes.into_iter()
                        .any(|a| from[a] > high[a] || to[a] < low[a])
                });
                let along = self.ahead[main].abs() > -FACING;
                if beside || !along || place < self.front() {
                    return None;
                }
                place
            }
        };
        let start = place - self.front();
        let both = self.moved.iter().zip(moved).zip(self.times);
        let room = both.map(|((own, other_moved), time)| {
            if self.wall.exists(*time) && other.exists(*time) {
                start + (other_moved - own).dot(&self.ahead)
            } else {
                f64::INFINITY
            }
        });
        Some(room.collect())
    }
}

/// Returns the lowest and the highest coordinates of a wall of facets \[m\]; none of a plane.
fn ends(wall: &SceneWall) -> Option<[[f64; 3]; 2]> {
    let surface = wall.surface.as_ref()?;
    let corners = (0..surface.len()).flat_map(|facet| surface.corners(facet));
    let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    Some(corners.fold(none, |[low, high], corner| {
        [
            std::array::from_fn(|a| low[a].min(corner[a])),
            std::array::from_fn(|a| high[a].max(corner[a])),
        ]
    }))
}

/// Returns the times at which the positions of walls are compared \[s\]: all rows of their tables, and
/// [`PARTS`] between two of them.
fn times(scene: &Scene) -> Vec<f64> {
    let end = scene.time.end;
    let tables = scene.walls.iter().flat_map(|wall| {
        let rows = wall.history.iter().flatten().map(|row| row[0]);
        rows.chain(wall.from).chain(wall.until)
    });
    let mut rows: Vec<f64> = tables.filter(|t| *t > 0.0 && *t < end).collect();
    rows.extend([0.0, end]);
    rows.sort_by(f64::total_cmp);
    rows.dedup();
    let mut times = vec![0.0];
    for pair in rows.windows(2) {
        let part = |n: u32| pair[0] + (pair[1] - pair[0]) * f64::from(n) / f64::from(PARTS);
        times.extend((1..=PARTS).map(part));
    }
    times
}

/// Returns `true` if bodies in front of a wall may leave sideways: through an open face of the domain, or by removal.
fn may_leave(scene: &Scene, mover: &Mover<'_>) -> bool {
    let removes = |action: &RegionAction| matches!(action, RegionAction::Remove { .. });
    if mover.ends.is_some() || scene.regions.iter().any(|region| removes(&region.action)) {
        return true;
    }
    let main = mover.ahead.iamax();
    let closed = |axis: usize, sign: f64| {
        scene
            .walls
            .iter()
            .any(|wall| sign * wall.normal[axis] > 0.5 || wall.surface.is_some())
    };
    (0..scene.grid.dimension)
        .filter(|a| *a != main && !scene.grid.periodic[*a])
        .any(|a| !closed(a, 1.0) || !closed(a, -1.0))
}

/// Compares the gaps in front of moving walls with the bodies there.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let travels: Vec<Travel> = scene.walls.iter().map(Travel::for_wall).collect();
    if scene.contact.is_none() || !travels.iter().any(Travel::moves) {
        return;
    }
    let (bodies, times) = (standing(scene), times(scene));
    let moved: Vec<_> = travels
        .iter()
        .map(|one| one.displacements(&times))
        .collect();
    for (n, wall) in scene.walls.iter().enumerate() {
        if !travels[n].moves() || wall.temporary {
            continue;
        }
        let first = moved[n].iter().find(|by| by.norm() > 0.0);
        let ahead = match (&wall.surface, first) {
            (None, _) => Vector3::from(wall.normal),
            (Some(_), Some(by)) => by.normalize(),
            (Some(_), None) => continue,
        };
        let mover = Mover {
            scene,
            wall,
            ahead,
            times: &times,
            moved: moved[n].clone(),
            ends: ends(wall),
        };
        let path = format!("walls[{n}].velocity");
        if !fixed_bodies(&mover, &bodies, &path, findings) {
            opposite_walls(&mover, n, &moved, (&bodies, &path), findings);
        }
    }
}

/// Warns of a wall that passes through a fixed body; returns `true` if there is one.
fn fixed_bodies(
    mover: &Mover<'_>,
    bodies: &[Standing],
    path: &str,
    findings: &mut Findings,
) -> bool {
    let front = mover.front();
    let passed = bodies
        .iter()
        .filter(|body| !body.moves && mover.faces(&body.at))
        .find_map(|body| {
            let room = body.lowest(&mover.ahead) - front;
            let far = room + body.thickness * LARGE;
            let mut ways = mover.moved.iter().zip(mover.times);
            let (_, time) =
                ways.find(|(by, time)| by.dot(&mover.ahead) > far && mover.wall.exists(**time))?;
            Some((body, room, *time))
        });
    let Some((body, room, time)) = passed else {
        return false;
    };
    findings.warn(
        path,
        format!(
            "the wall `{}` reaches the fixed {} after {} m and moves into it until {} s: walls do not touch fixed \
             bodies, and grains between the two have no room",
            mover.wall.name,
            body.name,
            number(room.max(0.0)),
            number(time)
        ),
        stop(room.max(0.0)),
    );
    true
}

/// Returns the remedy that stops a wall after a way \[m\].
fn stop(way: f64) -> String {
    format!(
        "stop the wall after {} m, by a table in time (`history`), an earlier end of the run or a smaller velocity, or \
         move the bodies out of its way",
        number(way)
    )
}

/// Body that does not fit between two walls.
struct Squeeze<'a> {
    /// Overlap of its contacts in radii.
    part: f64,
    other: &'a SceneWall,
    body: &'a Standing,
    /// Gap at the start, and the smallest \[m\].
    room: [f64; 2],
    /// Time from which the gap is too small \[s\].
    time: f64,
}

/// Reports a wall that leaves a smaller gap in front of another one than the bodies between them need.
fn opposite_walls(
    mover: &Mover<'_>,
    own: usize,
    moved: &[Vec<Vector3<f64>>],
    (bodies, path): (&[Standing], &str),
    findings: &mut Findings,
) {
    let mut worst: Option<Squeeze<'_>> = None;
    for (n, other) in mover
        .scene
        .walls
        .iter()
        .enumerate()
        .filter(|(n, _)| *n != own)
    {
        let Some(room) = mover.room(other, &moved[n]) else {
            continue;
        };
        let between = bodies.iter().filter(|body| {
            let ahead = body.at.dot(&mover.ahead) - mover.front();
            body.moves && mover.faces(&body.at) && ahead < room[0]
        });
        let Some(thinnest) = between.min_by(|a, b| a.thickness.total_cmp(&b.thickness)) else {
            continue;
        };
        let least = room.iter().copied().fold(f64::INFINITY, f64::min);
        let part = 1.0 - least / thinnest.thickness;
        if part > LARGE && worst.as_ref().is_none_or(|known| part > known.part) {
            let needed = thinnest.thickness * (1.0 - LARGE);
            let at = room.iter().position(|room| *room < needed).unwrap_or(0);
            worst = Some(Squeeze {
                part,
                other,
                body: thinnest,
                room: [room[0], least],
                time: mover.times[at],
            });
        }
    }
    let Some(Squeeze {
        part,
        other,
        body,
        room: [start, least],
        time,
    }) = worst
    else {
        return;
    };
    let reason = format!(
        "the wall `{}` moves to {} of wall `{}`, but {} between them needs {} m: from {} s on there is not room \
         enough, and no stiffness keeps the contacts from overlapping",
        mover.wall.name,
        if least > 0.0 {
            format!("within {} m", number(least))
        } else {
            "the far side".into()
        },
        other.name,
        body.name,
        number(body.thickness),
        number(time)
    );
    let way = start - body.thickness;
    let remedy = stop(way.max(0.0));
    if part >= mover.scene.guards.max_overlap && !may_leave(mover.scene, mover) {
        findings.unstable(path, reason, remedy);
    } else {
        findings.warn(path, reason, remedy);
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the findings about a wall of a box of 0.1 m with a sphere of 0.02 m, or a fixed one, on its floor.
    fn found(wall: &Value, motion: &str, end: f64) -> Vec<Problem> {
        let mut wall = wall.clone();
        wall["name"] = "lid".into();
        wall["material"] = "rock".into();
        let case = json!({
            "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.01},
            "materials": {"rock": {"density": 2600}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e6}, "normal_damping_ratio": 0.3}},
            "bodies": [{"name": "ball", "material": "rock", "shape": {"sphere": {"radius": 0.01}},
                "position": [0.05, 0.05, 0.01], "motion": {motion: {}}}],
            "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"],
            "walls": [wall],
            "time": {"end": end}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        let about = |p: &Problem| p.path == "walls[0].velocity";
        plan.warnings.into_iter().filter(about).collect()
    }

    /// Checks a lid 50 mm above the floor that moves down at 0.1 m/s: a sphere of 20 mm fits for 0.3 s.
    #[test]
    fn a_lid_that_leaves_no_room_is_found() {
        let plane = json!({"plane": {"point": [0, 0, 0.05], "normal": [0, 0, -1]}});
        let lid = |more: Value| {
            let mut lid = json!({"shape": plane, "velocity": [0, 0, -0.1]});
            for (name, value) in more.as_object().unwrap() {
                lid[name] = value.clone();
            }
            lid
        };
        let none = json!({});
        assert!(found(&lid(none.clone()), "free", 0.29).is_empty());
        let stops = found(&lid(none.clone()), "free", 0.5);
        assert_eq!(stops.len(), 1, "{stops:#?}");
        assert_eq!(stops[0].severity, Severity::Unstable);
        let text = stops[0].to_string();
        assert!(
            text.contains("`lid`") && text.contains("`z_min`") && text.contains("`ball`"),
            "{text}"
        );
        assert!(text.contains("stop the wall after 0.03 m"), "{text}");
        // It overlaps by a quarter of the radius, which the guard allows.
        let slight = found(&lid(none.clone()), "free", 0.35);
        assert_eq!(slight[0].severity, Severity::Warning, "{slight:#?}");
        // A table that turns the lid round after 20 mm, and one that turns it after 45 mm.
        for (turn, faults) in [(0.2, 0), (0.45, 1)] {
            let table = json!({"history": [[0, 1], [turn, 1], [turn, -1], [1, -1]]});
            assert_eq!(found(&lid(table), "free", 0.9).len(), faults, "{turn}");
        }
        // A lid that is removed in time, and one that moves along itself.
        assert!(found(&lid(json!({"until": 0.25})), "free", 0.5).is_empty());
        assert!(found(&lid(json!({"velocity": [0.1, 0, 0]})), "free", 0.5).is_empty());
    }

    /// Checks a stamp of facets, past which bodies may move, and a wall that passes through a fixed body.
    #[test]
    fn a_stamp_is_warned_of_above_a_body_and_a_fixed_body_is_passed_through() {
        let stamp = |x: f64| {
            json!({"shape": {"box": {"from": [x, 0.03, 0.05], "to": [x + 0.04, 0.07, 0.06]}},
                "velocity": [0, 0, -0.1]})
        };
        let above = found(&stamp(0.03), "free", 0.48);
        assert_eq!(above.len(), 1, "{above:#?}");
        assert_eq!(above[0].severity, Severity::Warning);
        assert!(found(&stamp(0.051), "free", 0.48).is_empty());
        let lid = json!({"shape": {"plane": {"point": [0, 0, 0.05], "normal": [0, 0, -1]}}, "velocity": [0, 0, -0.1]});
        let through = found(&lid, "fixed", 0.48);
        assert_eq!(through.len(), 1, "{through:#?}");
        assert!(
            through[0].reason.contains("fixed body `ball` after 0.03 m"),
            "{through:#?}"
        );
        assert!(found(&lid, "fixed", 0.29).is_empty());
    }
}
