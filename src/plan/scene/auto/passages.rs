//! Narrowest points of the widest flow paths, by clearance.
//!
//! The clearance of a point is its distance to the nearest solid: walls, bodies and their periodic images, blocks,
//! structures. The width of a path is twice the smallest clearance along it. Samples of a grid are joined in
//! descending order of clearance; the sample that first joins two openings, or closes a ring around a periodic
//! axis, is the narrowest place of the widest path. Near this place the search is repeated with finer samples.

use super::gaps::JoinedSolids;
use crate::scene::Scene;
use crate::scene::boundaries::ScenePatch;
use crate::scene::flow::Flow;
use base::number::{real, whole};
use dem::polyhedron::PlacedPolyhedron as Hull;
use nalgebra::Vector3;
use structure::Point;
use structure::mesh::TriangleMesh;

/// Number of samples in 2-D and 3-D.
const SAMPLES: [f64; 2] = [20_000.0, 24_000.0];
/// Ratio of samples to the intended number above which a thin box gets fewer samples along its long axes.
const CROWDED: f64 = 4.0;
/// Minimum number of samples along an axis.
const MIN_SAMPLES: f64 = 8.0;
/// Refinement of the samples about the narrowest place, in 2-D and 3-D; odd, so that the coarser samples are among
/// the finer ones.
const REFINEMENT: [usize; 2] = [15, 5];
/// Number of samples on each side of the narrowest place that are refined.
const REFINED_SAMPLES: usize = 2;
/// Width of a gap, relative to the adjacent bodies, above which it is open water.
const WIDE: f64 = 1.0;
/// Maximum number of solids.
const MAX_SOLIDS: usize = 20_000;

/// Number of nearest solids that are sought for a point.
const NEAREST: usize = 4;

/// Kinds of solids next to a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AdjacentKind {
    /// Spheres or discs only, no wall.
    Balls,
    /// A sphere or a disc, and a wall.
    BallAndWall,
    /// A block.
    Faces,
    /// A structure.
    Structure,
}

/// Narrowest place of a path.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NarrowPlace {
    /// Text that names the gap and the adjacent solids.
    pub(crate) what: String,
    /// Width \[m\].
    pub(crate) width: f64,
    /// Kind of the adjacent solids.
    pub(crate) adjacent: AdjacentKind,
}

enum Form {
    Ball(f64),
    Hull(TriangleMesh),
}

struct Body {
    name: String,
    at: Point,
    form: Form,
    /// Radius of the enclosing sphere about the centre \[m\].
    reach: f64,
    /// Smallest width \[m\].
    width: f64,
}

impl Body {
    fn new(name: String, at: Point, radius: f64, hull: Option<&Hull>) -> Option<Self> {
        let Some(hull) = hull else {
            return Some(Self {
                name,
                at,
                form: Form::Ball(radius),
                reach: radius,
                width: 2.0 * radius,
            });
        };
        let corners = hull.vertices();
        let shape = &hull.shape;
        let mut triangles = Vec::new();
        for face in 0..shape.half_spaces().len() {
            let corner = |k: u32| <[f64; 3]>::from(corners[k as usize] - hull.position);
            let around = shape.face(face);
            for pair in around.windows(2).skip(1) {
                triangles.push([corner(around[0]), corner(pair[0]), corner(pair[1])]);
            }
        }
        let planes = hull.half_spaces();
        let extent = |n: &Vector3<f64>| {
            let along = corners.iter().map(|corner| n.dot(corner));
            let high = along.clone().fold(f64::NEG_INFINITY, f64::max);
            high - along.fold(f64::INFINITY, f64::min)
        };
        let widths = planes.iter().map(|plane| extent(&plane.normal));
        Some(Self {
            name,
            at: hull.position.into(),
            form: Form::Hull(TriangleMesh::new(&triangles).ok()?),
            reach: shape.radius(),
            width: widths.fold(f64::INFINITY, f64::min),
        })
    }

    /// Returns a lower bound of the distance of a point given relative to the centre \[m\].
    fn distance_bound(&self, from: Point) -> f64 {
        let about = Vector3::from(from).norm() - self.reach;
        let Form::Hull(mesh) = &self.form else {
            return about;
        };
        let [low, high] = mesh.extent();
        let outside = |a: usize| (low[a] - from[a]).max(from[a] - high[a]);
        (0..3).map(outside).fold(about, f64::max)
    }

    /// Returns the distance of a point given relative to the centre \[m\]; negative inside.
    fn distance(&self, from: Point) -> f64 {
        match &self.form {
            Form::Ball(radius) => Vector3::from(from).norm() - radius,
            Form::Hull(mesh) => mesh.distance(from),
        }
    }
}

/// Solid near a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Neighbour {
    Body(usize),
    Structure(usize),
    Wall(usize, bool),
}

struct Ground<'a> {
    scene: &'a Scene,
    dimension: usize,
    size: Point,
    bodies: Vec<Body>,
    walls: Vec<WallFace>,
    openings: Vec<FaceOpening>,
}

/// Face of the domain that is a wall.
struct WallFace {
    axis: usize,
    upper: bool,
    /// Rectangles of the openings in it \[m\].
    openings: Vec<[Point; 2]>,
}

/// Opening in a face of the domain.
struct FaceOpening {
    axis: usize,
    upper: bool,
    /// Rectangle \[m\].
    ends: [Point; 2],
}

impl<'a> Ground<'a> {
    fn new(scene: &'a Scene, flow: &Flow) -> Self {
        let grid = &scene.grid;
        let passes = |patch: &&ScenePatch| patch.condition.model().passes_water();
        let rectangle = |patch: &ScenePatch| {
            let place = patch.imposed_at(grid, "");
            let ends = place.ends;
            let low = std::array::from_fn(|a| ends[a][0] * grid.spacing);
            let high = std::array::from_fn(|a| ends[a][1] * grid.spacing);
            [low, high]
        };
        let openings: Vec<_> = flow
            .patches()
            .filter(passes)
            .map(|patch| FaceOpening {
                axis: patch.face.axis(),
                upper: patch.face.is_max(),
                ends: rectangle(patch),
            })
            .collect();
        let mut walls = Vec::new();
        for axis in (0..grid.dimension).filter(|a| !grid.periodic[*a]) {
            for upper in [false, true] {
                let on_it = openings
                    .iter()
                    .filter(|one| (one.axis, one.upper) == (axis, upper));
                walls.push(WallFace {
                    axis,
                    upper,
                    openings: on_it.map(|one| one.ends).collect(),
                });
            }
        }
        let named = scene.bodies.iter().filter_map(|body| {
            Body::new(
                body.name.clone(),
                body.position,
                body.radius,
                body.solid.as_ref(),
            )
        });
        let blocks = scene.blocks.iter().flat_map(|blocks| &blocks.list);
        let blocks = blocks.enumerate().filter_map(|(n, block)| {
            Body::new(format!("block {n}"), [0.0; 3], 0.0, Some(&block.solid))
        });
        Self {
            scene,
            dimension: grid.dimension,
            size: grid.size,
            bodies: named.chain(blocks).collect(),
            walls,
            openings,
        }
    }

    fn wall(&self, wall: usize, at: Point) -> f64 {
        let WallFace {
            axis,
            upper,
            openings,
        } = &self.walls[wall];
        let away = if *upper {
            self.size[*axis] - at[*axis]
        } else {
            at[*axis]
        };
        // In front of an opening the wall begins at the rim of the opening.
        let rim = openings.iter().filter_map(|[low, high]| {
            let across = (0..self.dimension).filter(|a| a != axis);
            let inside = across.map(|a| {
                let whole = [low[a] <= 0.0, high[a] >= self.size[a]];
                let to = |end: f64, open: bool| if open { f64::INFINITY } else { end };
                to(at[a] - low[a], whole[0]).min(to(high[a] - at[a], whole[1]))
            });
            let inside = inside.fold(f64::INFINITY, f64::min);
            (inside >= 0.0).then_some(inside)
        });
        rim.reduce(f64::max)
            .map_or(away, |inside| away.hypot(inside))
    }

    fn structures(&self) -> impl Iterator<Item = (usize, &'a crate::scene::structures::Structure)> {
        let all = self.scene.structures.iter().enumerate();
        all.filter(|(_, structure)| structure.stops.water())
    }

    /// Returns the solids nearest to a point, nearest first, with their distances.
    fn nearest(&self, at: Point) -> [(f64, Option<Neighbour>); NEAREST] {
        let mut found = [(f64::INFINITY, None); NEAREST];
        type Found = [(f64, Option<Neighbour>); NEAREST];
        let offer = |found: &mut Found, distance: f64, neighbour: Neighbour| {
            let place = found.partition_point(|(known, _)| *known <= distance);
            if place < NEAREST {
                found[place..].rotate_right(1);
                found[place] = (distance, Some(neighbour));
            }
        };
        for (k, wall) in self.walls.iter().enumerate() {
            let neighbour = Neighbour::Wall(wall.axis, wall.upper);
            offer(&mut found, self.wall(k, at), neighbour);
        }
        for (k, structure) in self.structures() {
            offer(
                &mut found,
                structure.solid.distance(at),
                Neighbour::Structure(k),
            );
        }
        self.each_image(at, |k, body, from| {
            if body.distance_bound(from) < found[NEAREST - 1].0 {
                offer(&mut found, body.distance(from), Neighbour::Body(k));
            }
        });
        found
    }

    /// Calls `each` with the bodies, and the position of a point relative to the centre of each of their images.
    fn each_image(&self, at: Point, mut each: impl FnMut(usize, &Body, Point)) {
        let turns = |a: usize| {
            let periodic = a < self.dimension && self.scene.grid.periodic[a];
            if periodic { -1..=1 } else { 0..=0 }
        };
        for (k, body) in self.bodies.iter().enumerate() {
            for x in turns(0) {
                for y in turns(1) {
                    for z in turns(2) {
                        let by = [f64::from(x), f64::from(y), f64::from(z)];
                        let image = std::array::from_fn(|a| at[a] + by[a] * self.size[a]);
                        each(k, body, self.relative(body, image));
                    }
                }
            }
        }
    }

    /// Returns the distance of a point to the nearest solid \[m\].
    fn clearance(&self, at: Point) -> f64 {
        let walls = (0..self.walls.len()).map(|wall| self.wall(wall, at));
        let structures = self
            .structures()
            .map(|(_, structure)| structure.solid.distance(at));
        let mut least = walls.chain(structures).fold(f64::INFINITY, f64::min);
        self.each_image(at, |_, body, from| {
            if body.distance_bound(from) < least {
                least = least.min(body.distance(from));
            }
        });
        least
    }

    fn relative(&self, body: &Body, at: Point) -> Point {
        std::array::from_fn(|a| {
            if a < self.dimension {
                at[a] - body.at[a]
            } else {
                0.0
            }
        })
    }

    fn name(&self, neighbour: Neighbour) -> String {
        match neighbour {
            Neighbour::Body(k) => format!("`{}`", self.bodies[k].name),
            Neighbour::Structure(k) => format!("`{}`", self.scene.structures[k].name),
            Neighbour::Wall(axis, upper) => {
                let side = if upper { "upper" } else { "lower" };
                format!("the {side} wall along {}", ["x", "y", "z"][axis])
            }
        }
    }

    /// Returns the passage whose narrowest place is at `at`, within a distance `apart`; none if it is open water.
    fn passage_at(&self, at: Point, apart: f64) -> Option<NarrowPlace> {
        let near = self.nearest(at);
        let width = 2.0 * near[0].0;
        let far = near[1].0 + apart;
        let sides: Vec<Neighbour> = near
            .iter()
            .filter(|(distance, _)| *distance <= far)
            .filter_map(|(_, neighbour)| *neighbour)
            .collect();
        let bodies = sides.iter().filter_map(|side| match side {
            Neighbour::Body(k) => Some(&self.bodies[*k]),
            _ => None,
        });
        let faces = bodies
            .clone()
            .any(|body| matches!(body.form, Form::Hull(_)));
        let thinnest = bodies.clone().map(|body| body.width).reduce(f64::min);
        let structure = sides
            .iter()
            .any(|side| matches!(side, Neighbour::Structure(_)));
        let wall = sides.iter().any(|side| matches!(side, Neighbour::Wall(..)));
        let adjacent = match (structure, faces, bodies.count() > 0, wall) {
            (true, ..) => AdjacentKind::Structure,
            (_, true, ..) => AdjacentKind::Faces,
            (_, _, true, true) => AdjacentKind::BallAndWall,
            (_, _, true, false) => AdjacentKind::Balls,
            _ => return None,
        };
        let open = adjacent != AdjacentKind::Structure
            && thinnest.is_some_and(|least| width >= WIDE * least);
        let mut names: Vec<String> = Vec::new();
        for name in sides.iter().map(|side| self.name(*side)) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        (width > 0.0 && !open).then(|| NarrowPlace {
            what: format!("narrowest opening, next to {}", names.join(" and ")),
            width,
            adjacent,
        })
    }
}

/// Samples of a box.
struct Samples {
    low: Point,
    step: Point,
    count: [usize; 3],
    clearance: Vec<f64>,
}

impl Samples {
    fn point(&self, k: usize) -> Point {
        let cell = self.cell(k);
        std::array::from_fn(|a| self.low[a] + (real(cell[a]) + 0.5) * self.step[a])
    }

    fn cell(&self, k: usize) -> [usize; 3] {
        let [x, y, _] = self.count;
        [k % x, k / x % y, k / (x * y)]
    }

    fn index(&self, cell: [usize; 3]) -> usize {
        cell[0] + self.count[0] * (cell[1] + self.count[1] * cell[2])
    }

    /// Returns the samples in descending order of width; among equal ones by clearance, then by index.
    fn order(&self, widths: &[f64]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..widths.len()).collect();
        order.sort_by(|a, b| {
            let clearance = self.clearance[*b].total_cmp(&self.clearance[*a]);
            widths[*b]
                .total_cmp(&widths[*a])
                .then(clearance)
                .then(a.cmp(b))
        });
        order
    }

    /// Returns for each water sample the largest clearance among it and its neighbours, since no sample lies
    /// exactly in the middle of a gap.
    fn largest_near_clearance(&self, periodic: [bool; 3]) -> Vec<f64> {
        let one = |k: usize| {
            let mut widest = self.clearance[k];
            if widest > 0.0 {
                self.adjacent(k, periodic, |other, _| {
                    widest = widest.max(self.clearance[other])
                });
            }
            widest
        };
        (0..self.clearance.len()).map(one).collect()
    }

    /// Calls `each` with the neighbours of a sample, and the period that is crossed.
    fn adjacent(&self, k: usize, periodic: [bool; 3], mut each: impl FnMut(usize, [i32; 3])) {
        let cell = self.cell(k);
        for axis in 0..3 {
            for up in [false, true] {
                let mut other = cell;
                let mut by = [0; 3];
                let end = if up { self.count[axis] - 1 } else { 0 };
                if cell[axis] != end {
                    other[axis] = if up { cell[axis] + 1 } else { cell[axis] - 1 };
                } else if periodic[axis] {
                    other[axis] = self.count[axis] - 1 - end;
                    by[axis] = if up { 1 } else { -1 };
                } else {
                    continue;
                }
                each(self.index(other), by);
            }
        }
    }
}

/// Returns the narrowest places of the widest paths between openings and around periodic axes.
pub(crate) fn widest_passages(scene: &Scene, flow: &Flow) -> Vec<NarrowPlace> {
    let structures = scene.structures.iter().any(|s| s.stops.water());
    let bodies = scene.bodies.len() + scene.blocks.as_ref().map_or(0, |blocks| blocks.list.len());
    // Gaps between discs are known exactly.
    let bodies = if scene.grid.dimension == 2 { 0 } else { bodies };
    if !structures && bodies == 0 || bodies > MAX_SOLIDS {
        return Vec::new();
    }
    let ground = Ground::new(scene, flow);
    let samples = sampled(&ground);
    let apart = samples.step.into_iter().fold(0.0, f64::max);
    let mut places: Vec<NarrowPlace> = Vec::new();
    for place in narrowest(&ground, &samples) {
        let at = refined(&ground, &samples, &place);
        places.extend(
            ground
                .passage_at(at, apart)
                .filter(|place| !places.contains(place)),
        );
    }
    places
}

/// Returns the number of samples along each axis of a box: as uniform as possible, and in total at most [`CROWDED`]
/// times [`SAMPLES`], however long and thin the box is.
fn counts(dimension: usize, size: [f64; 3]) -> [usize; 3] {
    let wanted = SAMPLES[dimension - 2];
    let volume: f64 = size[..dimension].iter().product();
    let step = (volume / wanted).powf(1.0 / real(dimension));
    let mut counts = [1.0_f64; 3];
    for (count, size) in counts.iter_mut().zip(size).take(dimension) {
        *count = (size / step).round().max(MIN_SAMPLES);
    }
    if counts.iter().product::<f64>() > CROWDED * wanted {
        // Short axes first: the long axes divide the remaining samples.
        let mut axes: Vec<usize> = (0..dimension).collect();
        axes.sort_by(|a, b| size[*a].total_cmp(&size[*b]));
        let mut left = wanted;
        for (n, axis) in axes.iter().enumerate() {
            let long = &axes[n..];
            let product: f64 = long.iter().map(|a| size[*a] / size[*axis]).product();
            let even = (left / product).powf(1.0 / real(long.len()));
            counts[*axis] = even.round().max(MIN_SAMPLES);
            left /= counts[*axis];
        }
    }
    counts.map(whole)
}

fn sampled(ground: &Ground<'_>) -> Samples {
    let dimension = ground.dimension;
    let count = counts(dimension, ground.size);
    let step = std::array::from_fn(|a| {
        if a < dimension {
            ground.size[a] / real(count[a])
        } else {
            0.0
        }
    });
    let mut samples = Samples {
        low: [0.0; 3],
        step,
        count,
        clearance: Vec::new(),
    };
    let all = 0..count.iter().product();
    samples.clearance = all
        .map(|k| {
            let at = samples.point(k);
            let walls = (0..ground.walls.len()).map(|wall| ground.wall(wall, at));
            let structures = ground
                .structures()
                .map(|(_, structure)| structure.solid.distance(at));
            walls.chain(structures).fold(f64::INFINITY, f64::min)
        })
        .collect();
    let cap = 0.5
        * WIDE
        * ground
            .bodies
            .iter()
            .map(|body| body.width)
            .fold(0.0, f64::max);
    for body in &ground.bodies {
        lower_clearances(ground, &mut samples, body, cap);
    }
    samples
}

/// Lowers the clearance of the samples that are nearer than `cap` to a body or one of its images.
fn lower_clearances(ground: &Ground<'_>, samples: &mut Samples, body: &Body, cap: f64) {
    let range = |a: usize| -> Vec<(usize, f64)> {
        if a >= ground.dimension {
            return vec![(0, 0.0)];
        }
        let (step, count) = (samples.step[a], samples.count[a].cast_signed());
        // Of the periodic images the nearest count.
        let reach = (body.reach + cap).min(1.5 * ground.size[a]);
        let ends = [-1.0, 1.0].map(|sign| (body.at[a] + sign * reach) / step - 0.5);
        #[expect(clippy::cast_possible_truncation, reason = "a few thousand")]
        let [first, last] = [ends[0].ceil() as isize, ends[1].floor() as isize];
        let periodic = ground.scene.grid.periodic[a];
        let inside = |k: &isize| periodic || (0..count).contains(k);
        #[expect(clippy::cast_precision_loss, reason = "a few thousand")]
        let place = |k: isize| (k as f64 + 0.5) * step - body.at[a];
        let list = (first..=last).filter(inside);
        list.map(|k| (k.rem_euclid(count).cast_unsigned(), place(k)))
            .collect()
    };
    let [xs, ys, zs] = [range(0), range(1), range(2)];
    for (k, z) in &zs {
        for (j, y) in &ys {
            for (i, x) in &xs {
                let distance = body.distance([*x, *y, *z]);
                let index = samples.index([*i, *j, *k]);
                let clearance = &mut samples.clearance[index];
                *clearance = clearance.min(distance);
            }
        }
    }
}

/// Sample at the narrowest point of a gap, and its neighbours on both sides.
struct Narrow {
    place: usize,
    sides: [usize; 2],
}

/// Returns the narrowest places: where openings are joined, and where a ring closes around a periodic axis.
fn narrowest(ground: &Ground<'_>, samples: &Samples) -> Vec<Narrow> {
    let count = samples.clearance.len();
    let (openings, periodic) = (&ground.openings, ground.scene.grid.periodic);
    let wanted = openings.len().saturating_sub(1) + periodic.iter().filter(|p| **p).count();
    let mut sets = JoinedSolids::new(count + openings.len());
    let mut there = vec![false; count];
    let mut around = [false; 3];
    let mut has_opening: Vec<bool> = vec![false; count];
    has_opening.extend(vec![true; openings.len()]);
    let mut found = Vec::new();
    let mut adjacent: Vec<(usize, [i32; 3])> = Vec::new();
    let widths = samples.largest_near_clearance(periodic);
    for k in samples.order(&widths) {
        there[k] = true;
        adjacent.clear();
        samples.adjacent(k, periodic, |other, by| {
            if there[other] {
                adjacent.push((other, by));
            }
        });
        let (at, cell) = (samples.point(k), samples.cell(k));
        for (n, opening) in openings.iter().enumerate() {
            let FaceOpening {
                axis,
                upper,
                ends: [low, high],
            } = opening;
            let end = if *upper { samples.count[*axis] - 1 } else { 0 };
            let mut across = (0..ground.dimension).filter(|a| a != axis);
            if cell[*axis] == end && across.all(|a| low[a] <= at[a] && at[a] <= high[a]) {
                adjacent.push((count + n, [0; 3]));
            }
        }
        // The widest sample of each side represents it.
        let width = |other: usize| widths.get(other).copied().unwrap_or(f64::INFINITY);
        adjacent.sort_by(|a, b| width(b.0).total_cmp(&width(a.0)));
        let sample = |other: usize| if other < count { other } else { k };
        let first = adjacent.first().map_or(k, |(other, _)| sample(*other));
        for (other, by) in adjacent.iter().copied() {
            let (one, two) = (sets.root(k).0, sets.root(other).0);
            let open = has_opening[one] && has_opening[two];
            let ring = sets.join(k, other, by);
            let mut closes = ring.is_none() && open;
            if ring.is_none() {
                let root = sets.root(k).0;
                has_opening[root] = has_opening[one] || has_opening[two];
            }
            for (axis, by) in ring.unwrap_or_default().into_iter().enumerate() {
                closes |= by != 0 && !around[axis];
                around[axis] |= by != 0;
            }
            if closes {
                found.push(Narrow {
                    place: k,
                    sides: [first, sample(other)],
                });
            }
        }
        if found.len() >= wanted {
            break;
        }
    }
    found
}

/// Returns the narrowest place from finer samples about it.
fn refined(ground: &Ground<'_>, samples: &Samples, narrow: &Narrow) -> Point {
    let periodic = ground.scene.grid.periodic;
    let place = samples.point(narrow.place);
    // Sides beyond a period are shifted into this one.
    let sides = narrow.sides.map(|side| {
        let at = samples.point(side);
        std::array::from_fn(|a| {
            let turns = if a < ground.dimension && periodic[a] {
                ((at[a] - place[a]) / ground.size[a]).round()
            } else {
                0.0
            };
            at[a] - turns * ground.size[a]
        })
    });
    let finer = REFINEMENT[ground.dimension - 2];
    let step: Point = std::array::from_fn(|a| samples.step[a] / real(finer));
    let count = std::array::from_fn(|a| {
        if a < ground.dimension {
            (2 * REFINED_SAMPLES + 1) * finer
        } else {
            1
        }
    });
    let mut inner = Samples {
        low: std::array::from_fn(|a| place[a] - 0.5 * real(count[a]) * step[a]),
        step,
        count,
        clearance: Vec::new(),
    };
    let inside = |at: Point| {
        let within = |a: usize| periodic[a] || (0.0..=ground.size[a]).contains(&at[a]);
        (0..ground.dimension).all(within)
    };
    inner.clearance = (0..count.iter().product())
        .map(|k| {
            let at = inner.point(k);
            if inside(at) {
                ground.clearance(at)
            } else {
                f64::NEG_INFINITY
            }
        })
        .collect();
    // The widest sample within half a coarse spacing of a side represents it.
    let widest = |side: Point| {
        let near = |k: &usize| {
            let at = inner.point(*k);
            (0..ground.dimension).all(|a| (at[a] - side[a]).abs() <= 0.5 * samples.step[a])
        };
        let all = (0..inner.clearance.len()).filter(near);
        all.max_by(|a, b| {
            inner.clearance[*a]
                .total_cmp(&inner.clearance[*b])
                .then(b.cmp(a))
        })
    };
    let [Some(one), Some(other)] = sides.map(widest) else {
        return place;
    };
    match between(&inner, [one, other]) {
        Some(found) if inner.clearance[found] > samples.clearance[narrow.place] => {
            inner.point(found)
        }
        _ => place,
    }
}

/// Returns the narrowest place of the widest path between two samples.
fn between(samples: &Samples, ends: [usize; 2]) -> Option<usize> {
    let mut sets = JoinedSolids::new(samples.clearance.len());
    let mut there = vec![false; samples.clearance.len()];
    let mut adjacent = Vec::new();
    for k in samples.order(&samples.clearance) {
        there[k] = true;
        adjacent.clear();
        samples.adjacent(k, [false; 3], |other, _| {
            if there[other] {
                adjacent.push(other);
            }
        });
        for other in &adjacent {
            let _ = sets.join(k, *other, [0; 3]);
        }
        if ends.iter().all(|end| there[*end]) && sets.root(ends[0]).0 == sets.root(ends[1]).0 {
            return Some(k);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// Returns widths and kinds of the passages in water under a force along x.
    fn passages(size: &Value, periodic: &[&str], solids: [Value; 2]) -> Vec<(f64, AdjacentKind)> {
        let [bodies, structures] = solids;
        let force: Vec<f64> = (0..size.as_array().unwrap().len())
            .map(|a| if a == 0 { 0.1 } else { 0.0 })
            .collect();
        let case = json!({
            "domain": {"size": size, "spacing": 5e-5, "periodic": periodic},
            "materials": {"steel": {"density": 7800}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-6,
                "relaxation_time": 0.8, "body_force": {"constant": force}}},
            "bodies": bodies, "structures": structures, "time": {"end": 0.01}
        });
        let document =
            case::Document::read(&case.to_string(), &[], std::path::Path::new("")).unwrap();
        let plan = crate::Plan::prepare(document).unwrap();
        let found = widest_passages(&plan.scene, plan.scene.flow.as_ref().unwrap());
        found
            .into_iter()
            .map(|place| (place.width, place.adjacent))
            .collect()
    }

    fn body(shape: &Value, at: [f64; 3]) -> Value {
        json!([{"name": "b", "shape": shape, "position": at, "motion": {"fixed": {}}, "material": "steel"}])
    }

    fn near(found: f64, exact: f64) -> bool {
        (found / exact - 1.0).abs() < 0.08
    }

    #[test]
    fn long_and_flat_boxes_have_no_more_samples_than_others() {
        for size in [
            [1e9, 1.0, 1.0],
            [1.0, 1e7, 1e7],
            [1e-3, 1.0, 1e5],
            [1.0, 1.0, 1.0],
        ] {
            let samples: usize = counts(3, size).iter().product();
            assert!((8_000..=96_000).contains(&samples), "{size:?}: {samples}");
        }
        assert!(counts(2, [1e12, 1.0, 0.0]).iter().product::<usize>() <= 80_000);
        // Boxes without a short axis have the same counts as before.
        assert_eq!(counts(3, [2.0, 1.0, 1.0]), [46, 23, 23]);
    }

    #[test]
    fn the_way_past_baffles_is_the_gap_at_their_ends() {
        let wall = |name: &str, from: [f64; 2], to: [f64; 2]| {
            let shape = json!({"box": {"from": from, "to": to}});
            json!({"name": name, "shape": shape})
        };
        let baffles = json!([
            wall("a", [5e-4, -1.0], [6e-4, 6.7e-4]),
            wall("b", [1.5e-3, 3.3e-4], [1.6e-3, 1.0])
        ]);
        let found = passages(&json!([2e-3, 1e-3]), &["x"], [json!([]), baffles]);
        assert!(
            found.len() == 1 && found[0].1 == AdjacentKind::Structure && near(found[0].0, 3.3e-4),
            "{found:?}"
        );
        let disc = json!([{"name": "d", "shape": {"disc": {"centre": [1.03e-3, 5.2e-4], "radius": 3.9e-4}}}]);
        let found = passages(&json!([2e-3, 1e-3]), &["x"], [json!([]), disc]);
        assert!(found.len() == 1 && near(found[0].0, 1.3e-4), "{found:?}");
    }

    /// Checks a sphere that nearly fills a square duct: the water passes in the corners, where the largest sphere
    /// between walls and ball has the radius (2^½ H/2 - R)/(1 + 2^½).
    #[test]
    fn the_way_past_a_sphere_in_a_duct_is_in_the_corners() {
        for radius in [4e-4, 4.5e-4] {
            let ball = body(&json!({"sphere": {"radius": radius}}), [1e-3, 5e-4, 5e-4]);
            let found = passages(&json!([2e-3, 1e-3, 1e-3]), &["x"], [ball, json!([])]);
            let exact = 2.0 * (0.5_f64.sqrt() * 1e-3 - radius) / (1.0 + 2.0_f64.sqrt());
            assert!(
                found.len() == 1
                    && found[0].1 == AdjacentKind::BallAndWall
                    && near(found[0].0, exact),
                "{found:?} {exact}"
            );
        }
    }

    #[test]
    fn wide_water_has_no_narrow_way() {
        let ball = body(&json!({"sphere": {"radius": 1e-4}}), [1e-3, 5e-4, 5e-4]);
        assert_eq!(
            passages(&json!([2e-3, 1e-3, 1e-3]), &["x"], [ball, json!([])]),
            []
        );
    }

    /// Checks a slab that reaches from wall to wall and leaves a slot above it.
    #[test]
    fn the_way_over_a_block_is_the_slot() {
        let block = body(
            &json!({"cuboid": {"edges": [5e-4, 9.9e-4, 8e-4]}}),
            [1e-3, 5e-4, 4e-4],
        );
        let found = passages(&json!([2e-3, 1e-3, 1e-3]), &["x"], [block, json!([])]);
        assert!(
            found.len() == 1 && found[0].1 == AdjacentKind::Faces && near(found[0].0, 2e-4),
            "{found:?}"
        );
    }
}
