//! Gaps of water at the start: between bodies, grains of a list, walls of the domain and periodic images, with
//! exact distances of discs and spheres. The distance of two polyhedra is the largest over their face normals,
//! which is exact if a face is nearest, and otherwise a lower bound.
//!
//! In the plane, water that flows along an axis takes its widest path, and the narrowest gap of that path
//! determines the flow. By the duality of paths and cuts it is found without paths: solids and walls are joined in
//! ascending order of their gaps, and the gap that completes a chain from wall to wall, or around a periodic axis,
//! is the narrowest gap of the widest path. In narrower gaps the water hardly moves.

use crate::scene::pairs::{self, Ball};
use crate::scene::sample;
use case::Case;
use case::boundary::Boundary;
use case::fluid::LatticeBoltzmann;
use case::grains::GrainSource;
use case::solids::{Body, Motion, Shape};
use dem::polyhedron::Polyhedron;
use nalgebra::{Rotation3, Unit, Vector3};
use std::f64::consts::PI;
use std::ops::ControlFlow;

/// Maximum number of solids for which gaps are computed.
const MAX_SOLIDS: usize = 200_000;
/// Width of a gap, relative to the adjacent solids, above which it is open water.
const WIDE: f64 = 1.0;

/// Gap between two solids, or between a solid and a wall.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Gap {
    /// Name of the gap: `gap between `rod` and its image`.
    pub(crate) what: String,
    /// Width \[m\]; zero or negative if the solids touch.
    pub(crate) width: f64,
    /// Smallest width of the adjacent solids \[m\].
    pub(crate) adjacent_width: f64,
    /// `true` if an adjacent solid is not round.
    pub(crate) faces: bool,
    /// Inverse of the sum of the curvatures of both sides \[m\]: the radius next to a flat wall, half the radius
    /// between equal discs.
    pub(crate) radius: f64,
}

/// Gaps that are relevant to the flow.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Gaps {
    /// Narrowest gap of the widest path along each axis of flow; 2-D only.
    pub(crate) passages: Vec<(usize, Gap)>,
    /// Narrowest gap next to each moving body.
    pub(crate) moving: Vec<Gap>,
    /// Narrowest gap of all; 3-D only.
    pub(crate) narrowest: Option<Gap>,
    /// Solid fraction of the bounding box of all round solids, with the period along periodic axes; 3-D only.
    pub(crate) solid: f64,
}

enum Form {
    Ball(f64),
    /// Polyhedron: corners relative to the centre, and face normals.
    Hull(Vec<Vector3<f64>>, Vec<Vector3<f64>>),
}

struct Solid {
    name: String,
    at: Vector3<f64>,
    form: Form,
    moves: bool,
    width: f64,
}

impl Solid {
    fn reach(&self) -> f64 {
        match &self.form {
            Form::Ball(radius) => *radius,
            Form::Hull(corners, _) => corners
                .iter()
                .map(nalgebra::Matrix::norm)
                .fold(0.0, f64::max),
        }
    }

    /// Returns the curvature of a round solid, or zero for a hull [1/m].
    fn curvature(&self) -> f64 {
        match &self.form {
            Form::Ball(radius) => 1.0 / radius,
            Form::Hull(..) => 0.0,
        }
    }

    /// Returns the largest extent from the centre in a direction \[m\].
    fn extent(&self, along: &Vector3<f64>) -> f64 {
        match &self.form {
            Form::Ball(radius) => radius * along.norm(),
            Form::Hull(corners, _) => {
                let each = corners.iter().map(|corner| corner.dot(along));
                each.fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }

    /// Returns the gap to another solid shifted by whole periods.
    fn gap(&self, other: &Self, shift: &Vector3<f64>) -> f64 {
        let apart = other.at + shift - self.at;
        if let (Form::Ball(a), Form::Ball(b)) = (&self.form, &other.form) {
            return apart.norm() - a - b;
        }
        let mut widest = f64::NEG_INFINITY;
        let mut offer = |axis: Vector3<f64>| {
            let gap = axis.dot(&apart) - self.extent(&axis) - other.extent(&-axis);
            widest = widest.max(gap);
        };
        if let Form::Hull(_, normals) = &self.form {
            normals.iter().for_each(|normal| offer(*normal));
        }
        if let Form::Hull(_, normals) = &other.form {
            normals.iter().for_each(|normal| offer(-normal));
        }
        if let Some(axis) = apart.try_normalize(0.0) {
            offer(axis);
        }
        widest
    }
}

/// Wall of the domain: axis, and `true` for the upper one.
type Side = (usize, bool);

struct Places<'a> {
    size: &'a [f64],
    period: [Option<f64>; 3],
    walls: Vec<Side>,
}

impl Places<'_> {
    fn new<'a>(case: &'a Case, lbm: &LatticeBoltzmann) -> Places<'a> {
        let size = &case.domain.size.0;
        let mut period = [None; 3];
        for axis in &case.domain.periodic {
            period[axis.index()] = size.get(axis.index()).copied();
        }
        let passes = |axis: usize, upper: bool| {
            lbm.boundaries.iter().any(|boundary: &Boundary| {
                boundary.face.axis() == axis
                    && boundary.face.is_max() == upper
                    && boundary.condition.model().passes_water()
            })
        };
        let sides = (0..size.len()).flat_map(|axis| [(axis, false), (axis, true)]);
        let walls = sides
            .filter(|&(axis, upper)| period[axis].is_none() && !passes(axis, upper))
            .collect();
        Places {
            size,
            period,
            walls,
        }
    }

    fn distance(&self, solid: &Solid, (axis, upper): Side) -> f64 {
        let mut along = Vector3::zeros();
        along[axis] = if upper { 1.0 } else { -1.0 };
        let to = if upper { self.size[axis] } else { 0.0 };
        along[axis] * (to - solid.at[axis]) - solid.extent(&along)
    }

    fn name((axis, upper): Side) -> String {
        let axis = ["x", "y", "z"][axis];
        let side = if upper { "upper" } else { "lower" };
        format!("the {side} wall along {axis}")
    }

    /// Returns the shifts by whole periods to check, one of each pair of opposite shifts.
    fn shifts(&self) -> Vec<[i32; 3]> {
        let steps = |axis: usize| {
            if self.period[axis].is_some() {
                -1..=1
            } else {
                0..=0
            }
        };
        let mut list = Vec::new();
        for x in steps(0) {
            for y in steps(1) {
                list.extend(steps(2).map(|z| [x, y, z]));
            }
        }
        list
    }

    fn shift(&self, by: [i32; 3]) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| f64::from(by[axis]) * self.period[axis].unwrap_or(0.0))
    }

    /// Returns `true` if water may flow through the domain along an axis.
    fn may_flow_along(&self, axis: usize) -> bool {
        !self.walls.contains(&(axis, false)) && !self.walls.contains(&(axis, true))
    }
}

/// Returns the gaps of a case; none if the solids are not known before they are generated, or are too many.
pub(crate) fn case_gaps(case: &Case, lbm: &LatticeBoltzmann, factor: f64) -> Gaps {
    let places = Places::new(case, lbm);
    let Some(solids) = solids(case, factor) else {
        return Gaps::default();
    };
    if solids.is_empty() || solids.len() > MAX_SOLIDS {
        return Gaps::default();
    }
    let near = near(&places, &solids);
    let mut gaps = Gaps {
        moving: moving(&places, &solids, &near),
        ..Gaps::default()
    };
    if places.size.len() == 2 {
        let axes = (0..2).filter(|axis| places.may_flow_along(*axis));
        let way = |axis| {
            Some((
                axis,
                narrowest_gap_of_widest_path(&places, &solids, &near, axis)?,
            ))
        };
        gaps.passages = axes.filter_map(way).collect();
    } else {
        gaps.narrowest = near.first().map(|link| link.gap(&solids));
        gaps.solid = solid_fraction(&places, &solids);
    }
    gaps
}

/// Returns the volume of the spheres divided by that of their bounding box.
fn solid_fraction(places: &Places<'_>, solids: &[Solid]) -> f64 {
    let balls = solids.iter().filter_map(|solid| match &solid.form {
        Form::Ball(radius) => Some((solid.at, *radius)),
        Form::Hull(..) => None,
    });
    let volume: f64 = balls.clone().map(|(_, r)| 4.0 / 3.0 * PI * r.powi(3)).sum();
    let end = |axis: usize, sign: f64| {
        let ends = balls.clone().map(|(at, radius)| sign * at[axis] + radius);
        ends.fold(f64::NEG_INFINITY, f64::max)
    };
    let edge = |axis: usize| match places.period[axis] {
        Some(period) => period,
        None => end(axis, 1.0) + end(axis, -1.0),
    };
    (volume / (0..3).map(edge).product::<f64>()).min(1.0)
}

/// Pair of solids, or a solid and a wall, with its gap.
struct Link {
    width: f64,
    one: usize,
    other: Other,
}

#[derive(Clone, Copy)]
enum Other {
    Solid(usize, [i32; 3]),
    Wall(Side),
}

impl Link {
    fn gap(&self, solids: &[Solid]) -> Gap {
        let one = &solids[self.one];
        let (name, other) = match self.other {
            Other::Wall(side) => (Places::name(side), None),
            Other::Solid(k, _) if k == self.one => ("its periodic image".into(), Some(one)),
            Other::Solid(k, _) => (format!("`{}`", solids[k].name), Some(&solids[k])),
        };
        let sides = || std::iter::once(one).chain(other);
        Gap {
            what: format!("gap between `{}` and {name}", one.name),
            width: self.width,
            adjacent_width: sides().map(|side| side.width).fold(f64::INFINITY, f64::min),
            faces: sides().any(|side| matches!(side.form, Form::Hull(..))),
            radius: 1.0 / sides().map(Solid::curvature).sum::<f64>(),
        }
    }

    fn touches(&self, solid: usize) -> bool {
        self.one == solid || matches!(self.other, Other::Solid(k, _) if k == solid)
    }
}

/// Returns all gaps up to the width of the widest solid, in ascending order.
fn near(places: &Places<'_>, solids: &[Solid]) -> Vec<Link> {
    let widest = solids
        .iter()
        .map(|solid| 2.0 * solid.reach())
        .fold(0.0, f64::max)
        * WIDE;
    let mut links = Vec::new();
    for (one, solid) in solids.iter().enumerate() {
        for side in &places.walls {
            let width = places.distance(solid, *side);
            if width <= widest {
                let other = Other::Wall(*side);
                links.push(Link { width, one, other });
            }
        }
    }
    let shifts = places.shifts();
    let mut pair = |one: usize, other: usize| {
        for by in &shifts {
            // Only one of two opposite images is used, and a solid has no gap to itself.
            if one == other && *by <= [0, 0, 0] {
                continue;
            }
            let width = solids[one].gap(&solids[other], &places.shift(*by));
            if width <= widest {
                let other = Other::Solid(other, *by);
                links.push(Link { width, one, other });
            }
        }
    };
    for one in 0..solids.len() {
        pair(one, one);
    }
    let balls: Vec<Ball> = solids
        .iter()
        .map(|solid| Ball {
            at: solid.at.into(),
            reach: solid.reach() + 0.5 * widest,
        })
        .collect();
    // The callback never ends the search.
    let _ = pairs::near(&balls, places.period, |one, other| {
        pair(one, other);
        ControlFlow::Continue(())
    });
    links.sort_by(|a, b| a.width.total_cmp(&b.width));
    links
}

/// Returns the narrowest gap next to each moving body.
fn moving(places: &Places<'_>, solids: &[Solid], near: &[Link]) -> Vec<Gap> {
    let all = solids.iter().enumerate().filter(|(_, solid)| solid.moves);
    let gap = |(k, solid): (usize, &Solid)| {
        let link = near.iter().find(|link| link.touches(k))?;
        // A body that reaches from wall to wall cannot move.
        let blocked = places.walls.len() > 1 && link.width <= 0.0;
        (!blocked && link.width < WIDE * solid.width).then(|| link.gap(solids))
    };
    all.filter_map(gap).collect()
}

/// Disjoint sets of joined solids, with the periods between each solid and the root of its set.
pub(super) struct JoinedSolids {
    parent: Vec<usize>,
    shift: Vec<[i32; 3]>,
}

impl JoinedSolids {
    pub(super) fn new(count: usize) -> Self {
        Self {
            parent: (0..count).collect(),
            shift: vec![[0; 3]; count],
        }
    }

    pub(super) fn root(&mut self, mut k: usize) -> (usize, [i32; 3]) {
        let mut by = [0; 3];
        while self.parent[k] != k {
            let up = self.parent[k];
            let (grand, more) = (self.parent[up], self.shift[up]);
            for (shift, more) in self.shift[k].iter_mut().zip(more) {
                *shift += more;
            }
            self.parent[k] = grand;
            for (by, shift) in by.iter_mut().zip(self.shift[k]) {
                *by += shift;
            }
            k = grand;
        }
        (k, by)
    }

    /// Joins two solids; returns the periods around the ring if the joint closes a ring.
    pub(super) fn join(&mut self, one: usize, other: usize, by: [i32; 3]) -> Option<[i32; 3]> {
        let (a, of_one) = self.root(one);
        let (b, of_other) = self.root(other);
        let between = std::array::from_fn(|axis| of_one[axis] + by[axis] - of_other[axis]);
        if a == b {
            return Some(between);
        }
        self.parent[b] = a;
        self.shift[b] = between;
        None
    }
}

/// Returns the narrowest gap of the widest path along an axis of the plane; none if it is wider than the adjacent
/// solids.
fn narrowest_gap_of_widest_path(
    places: &Places<'_>,
    solids: &[Solid],
    near: &[Link],
    axis: usize,
) -> Option<Gap> {
    let across = 1 - axis;
    let (lower, upper) = (solids.len(), solids.len() + 1);
    let mut sets = JoinedSolids::new(solids.len() + 2);
    for link in near {
        let ring = match link.other {
            Other::Wall((of, is_upper)) if of == across => {
                sets.join(link.one, if is_upper { upper } else { lower }, [0; 3])
            }
            Other::Wall(_) => None,
            Other::Solid(other, by) => sets.join(link.one, other, by),
        };
        let round = ring.is_some_and(|by| by[across] != 0);
        let closed = round
            || (places.walls.contains(&(across, false))
                && places.walls.contains(&(across, true))
                && sets.root(lower).0 == sets.root(upper).0);
        if closed {
            let gap = link.gap(solids);
            return (gap.width < WIDE * gap.adjacent_width).then_some(gap);
        }
    }
    None
}

/// Returns the bodies, and the grains of a list or a file; none if the run generates its grains.
fn solids(case: &Case, factor: f64) -> Option<Vec<Solid>> {
    let dimension = case.domain.size.0.len();
    let at = |position: &[f64]| {
        Vector3::from_fn(|axis, _| {
            let there = axis < dimension;
            there
                .then(|| position.get(axis))
                .flatten()
                .copied()
                .unwrap_or(0.0)
        })
    };
    let mut list: Vec<Solid> = Vec::new();
    for body in &case.bodies {
        list.extend(body_solid(body, at(&body.position.0), factor));
    }
    let mut grain = |n: usize, at: Vector3<f64>, radius: f64| {
        list.push(Solid {
            name: format!("grain {n}"),
            at,
            form: Form::Ball(radius * factor),
            moves: false,
            width: 2.0 * radius * factor,
        });
    };
    match case.grains.as_ref().map(|grains| &grains.initial) {
        None => {}
        Some(GrainSource::List(grains)) => {
            for (n, each) in grains.iter().enumerate() {
                grain(n, at(&each.position.0), each.radius);
            }
        }
        Some(GrainSource::File(file)) => {
            // A file that cannot be read is reported with the grains.
            let grains = sample::load(case, file).ok()?;
            for (n, each) in grains.iter().enumerate() {
                grain(n, Vector3::from(each.position), each.radius);
            }
        }
        Some(_) => return None,
    }
    list.retain(|solid| solid.at.iter().all(|x| x.is_finite()) && solid.width > 0.0);
    Some(list)
}

/// Returns a body; none for shapes that are known only after they are generated.
fn body_solid(body: &Body, at: Vector3<f64>, factor: f64) -> Option<Solid> {
    let form = match &body.shape {
        Shape::Disc { radius } | Shape::Sphere { radius } => Form::Ball(radius * factor),
        Shape::Cuboid { edges } => {
            let half = Vector3::from(*edges) * 0.5;
            let corners = (0..8).map(|bits: usize| {
                Vector3::from_fn(|axis, _| {
                    if bits >> axis & 1 == 1 {
                        half[axis]
                    } else {
                        -half[axis]
                    }
                })
            });
            let normals = [Vector3::x(), Vector3::y(), Vector3::z()];
            let normals = normals.into_iter().flat_map(|normal| [normal, -normal]);
            Form::Hull(corners.collect(), normals.collect())
        }
        Shape::Vertices(points) => {
            let points: Vec<Vector3<f64>> = points.iter().copied().map(Into::into).collect();
            let solid = Polyhedron::from_vertices(&points).ok()?;
            let shape = &solid.shape;
            let normals = shape.half_spaces().iter().map(|plane| plane.normal);
            Form::Hull(shape.vertices().to_vec(), normals.collect())
        }
        Shape::HalfSpaces(_) | Shape::Mesh(_) => return None,
    };
    let turn = body.orientation.as_ref().and_then(|orientation| {
        let axis = Unit::try_new(Vector3::from(orientation.axis), 0.0)?;
        Some(Rotation3::from_axis_angle(
            &axis,
            orientation.angle_degrees.to_radians(),
        ))
    });
    let form = match (form, turn) {
        (Form::Hull(corners, normals), Some(turn)) => Form::Hull(
            corners.into_iter().map(|corner| turn * corner).collect(),
            normals.into_iter().map(|normal| turn * normal).collect(),
        ),
        (form, _) => form,
    };
    let mut solid = Solid {
        name: body.name.clone(),
        at,
        width: 0.0,
        form,
        moves: !matches!(body.motion, Motion::Fixed {}),
    };
    solid.width = match &solid.form {
        Form::Ball(radius) => 2.0 * radius,
        Form::Hull(_, normals) => {
            let widths = normals.iter().map(|n| solid.extent(n) + solid.extent(&-n));
            widths.fold(f64::INFINITY, f64::min)
        }
    };
    Some(solid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use serde_json::{Value, json};

    fn case(size: [f64; 2], periodic: &[&str], discs: &[([f64; 2], f64, Value)]) -> Case {
        let bodies: Vec<Value> = (discs.iter().enumerate())
            .map(|(n, (at, radius, motion))| {
                json!({"name": format!("d{n}"), "shape": {"disc": {"radius": radius}}, "position": at,
                    "motion": motion, "material": "steel"})
            })
            .collect();
        let text = json!({
            "domain": {"size": size, "periodic": periodic, "spacing": 0.1},
            "materials": {"steel": {"density": 7800}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-6}},
            "bodies": bodies,
            "time": {"end": 1}
        });
        let document = case::Document::read(&text.to_string(), &[], std::path::Path::new("."));
        document.unwrap().case
    }

    fn found(case: &Case, factor: f64) -> Gaps {
        let Some(case::fluid::Fluid::LatticeBoltzmann(lbm)) = &case.fluid else {
            unreachable!()
        };
        case_gaps(case, lbm, factor)
    }

    fn fixed(at: [f64; 2], radius: f64) -> ([f64; 2], f64, Value) {
        (at, radius, json!({"fixed": {}}))
    }

    #[test]
    fn in_a_periodic_array_it_is_the_gap_to_the_image() {
        let gaps = found(
            &case([1.0, 1.0], &["x", "y"], &[fixed([0.51, 0.47], 0.45)]),
            1.0,
        );
        assert_eq!(gaps.passages.len(), 2);
        for (axis, (way, gap)) in gaps.passages.iter().enumerate() {
            assert_eq!(*way, axis);
            assert_relative_eq!(gap.width, 0.1, epsilon = 1e-12);
            assert_eq!(gap.what, "gap between `d0` and its periodic image");
        }
        // The hydraulic radius is smaller than that of the disc.
        let gaps = found(
            &case([1.0, 1.0], &["x", "y"], &[fixed([0.51, 0.47], 0.45)]),
            0.8,
        );
        assert_relative_eq!(gaps.passages[0].1.width, 0.28, epsilon = 1e-12);
    }

    #[test]
    fn the_wide_side_of_an_obstacle_is_the_way() {
        // The slit at the lower wall is 0.05, the upper one 0.55: wider than the disc, so that there is no narrow
        // gap.
        let adjacent_width = case([4.0, 1.0], &["x"], &[fixed([2.0, 0.25], 0.2)]);
        assert_eq!(found(&adjacent_width, 1.0).passages, Vec::new());
        // In a nearly filled channel the upper gap of 0.2 decides, not the lower gap of 0.1.
        let filling = case([4.0, 1.0], &["x"], &[fixed([2.0, 0.45], 0.35)]);
        let gaps = found(&filling, 1.0);
        assert_relative_eq!(gaps.passages[0].1.width, 0.2, epsilon = 1e-12);
        assert_eq!(
            gaps.passages[0].1.what,
            "gap between `d0` and the upper wall along y"
        );
    }

    #[test]
    fn a_row_of_wires_is_as_wide_as_its_widest_gap() {
        let wires = [0.1, 0.32, 0.6, 0.85].map(|y| fixed([1.0, y], 0.09));
        let gaps = found(&case([2.0, 1.0], &["x"], &wires), 1.0);
        // Gaps 0.01, 0.04, 0.10, 0.07, 0.06.
        assert_relative_eq!(gaps.passages[0].1.width, 0.1, epsilon = 1e-12);
        assert_eq!(gaps.passages[0].1.what, "gap between `d1` and `d2`");
        // With a staggered second row, the path through both has the width of the narrower one.
        let second = [0.15, 0.40, 0.62, 0.87].map(|y| fixed([1.5, y], 0.09));
        let both: Vec<_> = wires.into_iter().chain(second).collect();
        let gaps = found(&case([2.0, 1.0], &["x"], &both), 1.0);
        assert_relative_eq!(gaps.passages[0].1.width, 0.07, epsilon = 1e-12);
    }

    #[test]
    fn a_gap_is_as_curved_as_both_of_its_sides() {
        let radius = |periodic: &[&str], discs: &[_]| {
            let gaps = found(&case([4.0, 1.0], periodic, discs), 1.0);
            gaps.passages[0].1.radius
        };
        let wall = radius(&["x"], &[fixed([2.0, 0.45], 0.35)]);
        assert_relative_eq!(wall, 0.35, epsilon = 1e-12);
        let image = radius(&["x", "y"], &[fixed([2.0, 0.45], 0.45)]);
        assert_relative_eq!(image, 0.225, epsilon = 1e-12);
        let unequal = [fixed([2.0, 0.2], 0.25), fixed([2.0, 0.75], 0.2)];
        let [a, b]: [f64; 2] = [0.25, 0.2];
        assert_relative_eq!(radius(&["x"], &unequal), a * b / (a + b), epsilon = 1e-12);
    }

    #[test]
    fn touching_from_wall_to_wall_leaves_no_way() {
        let wires = [0.15, 0.5, 0.85].map(|y| fixed([1.0, y], 0.175));
        let gaps = found(&case([2.0, 1.0], &["x"], &wires), 1.0);
        assert!(gaps.passages[0].1.width <= 1e-12, "{gaps:?}");
    }

    #[test]
    fn chains_close_round_a_periodic_axis_only_across_the_flow() {
        // A column along x, periodic in x, does not block the flow along x: 0.7 above it is water.
        let column = [0.125, 0.375, 0.625, 0.875].map(|x| fixed([x, 0.15], 0.12));
        let gaps = found(&case([1.0, 1.0], &["x"], &column), 1.0);
        assert!(gaps.passages.iter().all(|(axis, _)| *axis != 0), "{gaps:?}");
    }

    #[test]
    fn beside_a_body_that_moves_every_narrow_gap_counts() {
        let turning = ([2.0, 0.22], 0.2, json!({"driven": {"angular_velocity": 1}}));
        let gaps = found(&case([4.0, 4.0], &["x"], &[turning]), 1.0);
        assert_eq!(gaps.moving.len(), 1);
        assert_relative_eq!(gaps.moving[0].width, 0.02, epsilon = 1e-12);
        assert_eq!(gaps.passages, Vec::new());
    }
}
