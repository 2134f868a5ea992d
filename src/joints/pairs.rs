//! Joints: pairs of faces of two blocks that are nearly parallel, face each other and are closer than a stated
//! limit.
//!
//! The plane of a joint lies in the middle between the two faces. Both faces are projected onto it along its normal;
//! their overlap is a convex polygon ([`Polygon`]), over which the gap between the planes of the faces is a linear
//! function of the position ([`LinearField`]). The conducting aperture of a joint is at least the residual
//! aperture.
//!
//! A pair of faces forms a joint if no third block is between them. The limit must therefore be smaller than the
//! thinnest block ([`PairLimits::distance`]).
//!
//! A joint that is known stays one while its faces open, at any distance, until they no longer overlap or have turned
//! by 45 degrees ([`joints_after`]).
//!
//! **Order.** Blocks come in the order of their ids, and the pairs in the order of blocks and faces, so that the
//! number of a joint depends on the blocks only.

use crate::polygon::{LinearField, Polygon};
use dem::polyhedron::Polyhedron;
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// Largest angle between the two faces of a known joint \[rad\].
const WIDEST: f64 = std::f64::consts::FRAC_PI_4;
/// Minimum extent of an overlap in each direction, divided by the size of the faces.
const THIN: f64 = 1e-6;

/// Block of the network.
#[derive(Clone, Debug)]
pub struct Rock<'a> {
    /// Shape in the block's own frame.
    pub shape: &'a Polyhedron,
    /// Position of the centroid of the block \[m\].
    pub position: Vector3<f64>,
    /// Rotation from the block's own frame.
    pub orientation: UnitQuaternion<f64>,
}

/// Limits within which two faces form a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairLimits {
    /// Maximum distance of the faces at the centroid of their overlap \[m\]; smaller than the thinnest block.
    pub distance: f64,
    /// Maximum angle between the faces \[rad\].
    pub angle: f64,
}

/// Face of a block, given by the indices of the block and of the face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RockFace {
    /// Number of the block.
    pub rock: usize,
    /// Number of the face.
    pub face: usize,
}

/// Joint between two faces.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Both faces, that of the earlier block first.
    pub faces: [RockFace; 2],
    /// Origin of the plane of the joint \[m\]: the centroid of the overlap.
    pub origin: Vector3<f64>,
    /// Axes in the plane; the first one runs along the longest edge of the overlap.
    pub axes: [Vector3<f64>; 2],
    /// Unit normal of the plane, from the first face to the second.
    pub normal: Vector3<f64>,
    /// Overlap in the plane; the tag of an edge is its index.
    pub overlap: Polygon<usize>,
    /// Distance of the faces \[m\], negative for overlapping blocks.
    pub gap: LinearField,
    /// Heights of both faces above the plane, along the normal \[m\].
    pub heights: [LinearField; 2],
    /// Outward normals of both faces divided by their component along the normal of the joint: the force of a
    /// pressure on an area of the plane is minus this vector times both, with the sign of the face.
    pub tilts: [Vector3<f64>; 2],
}

impl Joint {
    /// Returns the position in space of a point of the plane \[m\].
    #[must_use]
    pub fn point(&self, at: &Vector2<f64>) -> Vector3<f64> {
        self.origin + self.axes[0] * at.x + self.axes[1] * at.y
    }

    /// Returns the position in space of the point of a face, 0 or 1, above a point of the plane \[m\].
    #[must_use]
    pub fn face_point(&self, face: usize, at: &Vector2<f64>) -> Vector3<f64> {
        self.point(at) + self.normal * self.heights[face].value(at)
    }

    /// Returns the direction in space of a direction in the plane.
    #[must_use]
    pub fn direction(&self, along: &Vector2<f64>) -> Vector3<f64> {
        self.axes[0] * along.x + self.axes[1] * along.y
    }
}

/// Returns the gap of a joint after a motion of its blocks, in its unchanged plane, and sets its heights and tilts.
pub fn follow(joint: &mut Joint, rocks: &[Rock]) -> LinearField {
    let faces = joint.faces.map(|name| {
        let rock = &rocks[name.rock];
        let plane = rock.shape.half_spaces()[name.face];
        let normal = rock.orientation * plane.normal;
        let along = normal.dot(&joint.normal);
        let height = LinearField {
            constant: (plane.offset + normal.dot(&(rock.position - joint.origin))) / along,
            slope: -Vector2::new(normal.dot(&joint.axes[0]), normal.dot(&joint.axes[1])) / along,
        };
        (height, normal / along.abs())
    });
    joint.tilts = faces.map(|face| face.1);
    joint.heights = faces.map(|face| face.0);
    between(&joint.heights)
}

/// Returns the gap between two faces from their heights \[m\].
fn between(heights: &[LinearField; 2]) -> LinearField {
    LinearField {
        constant: heights[1].constant - heights[0].constant,
        slope: heights[1].slope - heights[0].slope,
    }
}

/// Face in its current position.
struct Standing {
    normal: Vector3<f64>,
    corners: Vec<Vector3<f64>>,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Standing {
    fn new(rock: &Rock, face: usize) -> Self {
        let normal = rock.orientation * rock.shape.half_spaces()[face].normal;
        let corner = |&vertex: &u32| {
            rock.position + rock.orientation * rock.shape.vertices()[vertex as usize]
        };
        let corners: Vec<Vector3<f64>> = rock.shape.face(face).iter().map(corner).collect();
        let bound = |with: fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>| {
            corners.iter().fold(corners[0], |bound, c| with(&bound, c))
        };
        let (low, high) = (bound(Vector3::inf), bound(Vector3::sup));
        Self {
            normal,
            corners,
            low,
            high,
        }
    }

    fn centre(&self) -> Vector3<f64> {
        let sum: Vector3<f64> = self.corners.iter().sum();
        sum / base::number::real(self.corners.len())
    }

    /// Returns `true` if the bounding boxes are closer than a distance \[m\] along every axis.
    fn is_near(&self, other: &Self, distance: f64) -> bool {
        (0..3).all(|k| {
            self.low[k] <= other.high[k] + distance && other.low[k] <= self.high[k] + distance
        })
    }
}

/// Faces of all blocks in their present positions, in the order of blocks and faces.
struct Faces {
    list: Vec<(RockFace, Standing)>,
    /// Index of the first face of each block.
    firsts: Vec<usize>,
}

impl Faces {
    fn new(rocks: &[Rock]) -> Self {
        let (mut list, mut firsts) = (Vec::new(), Vec::with_capacity(rocks.len()));
        for (rock, block) in rocks.iter().enumerate() {
            firsts.push(list.len());
            for face in 0..block.shape.half_spaces().len() {
                list.push((RockFace { rock, face }, Standing::new(block, face)));
            }
        }
        Self { list, firsts }
    }

    /// Returns the joint of two faces, if they overlap, are closer than a distance \[m\], and enclose an angle of at
    /// most [`WIDEST`].
    fn joint(&self, [a, b]: [usize; 2], distance: f64) -> Option<Joint> {
        let ((first, one), (second, other)) = (&self.list[a], &self.list[b]);
        let faces = one.normal.dot(&other.normal) <= -WIDEST.cos();
        faces.then(|| joint([*first, *second], [one, other], distance))?
    }

    /// Returns the numbers of two faces.
    fn numbers(&self, pair: [RockFace; 2]) -> [usize; 2] {
        pair.map(|name| self.firsts[name.rock] + name.face)
    }
}

/// Returns the joints of all blocks, in the order of their faces.
#[must_use]
pub fn joints(rocks: &[Rock], limits: &PairLimits) -> Vec<Joint> {
    joints_after(rocks, limits, &[])
}

/// Returns the joints of these pairs of faces that still overlap, in the order of the pairs.
#[must_use]
pub fn joints_of(rocks: &[Rock], pairs: &[[RockFace; 2]]) -> Vec<Joint> {
    let faces = Faces::new(rocks);
    let joint = |pair: &[RockFace; 2]| faces.joint(faces.numbers(*pair), f64::INFINITY);
    pairs.iter().filter_map(joint).collect()
}

/// Returns the joints of all blocks within the limits, and the known ones that still overlap, in the order of their
/// faces. `known` is in that order.
#[must_use]
pub fn joints_after(rocks: &[Rock], limits: &PairLimits, known: &[[RockFace; 2]]) -> Vec<Joint> {
    let all = Faces::new(rocks);
    let mut pairs = near_pairs(&all.list, limits);
    let known: Vec<[usize; 2]> = known.iter().map(|pair| all.numbers(*pair)).collect();
    pairs.extend(&known);
    pairs.sort_unstable();
    pairs.dedup();
    let joint = |pair: [usize; 2]| {
        let is_known = known.binary_search(&pair).is_ok();
        let distance = if is_known {
            f64::INFINITY
        } else {
            limits.distance
        };
        all.joint(pair, distance)
    };
    pairs.into_iter().filter_map(joint).collect()
}

/// Returns the pairs of faces of different blocks that face each other and whose boxes are near.
fn near_pairs(faces: &[(RockFace, Standing)], limits: &PairLimits) -> Vec<[usize; 2]> {
    // Sweep along the first axis: a face is compared with those that begin before it ends.
    let mut order: Vec<usize> = (0..faces.len()).collect();
    order.sort_by(|&a, &b| {
        faces[a]
            .1
            .low
            .x
            .total_cmp(&faces[b].1.low.x)
            .then(a.cmp(&b))
    });
    let least = limits.angle.cos();
    let mut pairs = Vec::new();
    for (at, &a) in order.iter().enumerate() {
        let reach = faces[a].1.high.x + limits.distance;
        for &b in order[at + 1..]
            .iter()
            .take_while(|&&b| faces[b].1.low.x <= reach)
        {
            let ((name, one), (other_name, other)) = (&faces[a], &faces[b]);
            if name.rock != other_name.rock
                && one.normal.dot(&other.normal) <= -least
                && one.is_near(other, limits.distance)
            {
                pairs.push([a.min(b), a.max(b)]);
            }
        }
    }
    pairs
}

/// Returns the joint of two faces, if they overlap and are closer than a distance \[m\].
fn joint(names: [RockFace; 2], [one, other]: [&Standing; 2], distance: f64) -> Option<Joint> {
    let normal = (one.normal - other.normal).normalize();
    let mut axes = plane_axes(&normal, &one.corners);
    let mut origin = 0.5 * (one.centre() + other.centre());
    let size = (one.high - one.low)
        .amax()
        .max((other.high - other.low).amax());
    let flat = |corner: &Vector3<f64>, origin: &Vector3<f64>, axes: &[Vector3<f64>; 2]| {
        Vector2::new(
            axes[0].dot(&(corner - origin)),
            axes[1].dot(&(corner - origin)),
        )
    };
    let project = |origin: &Vector3<f64>, axes: &[Vector3<f64>; 2]| {
        let corners = one.corners.iter().map(|corner| flat(corner, origin, axes));
        let mut overlap = Polygon::new(corners.zip(0..).collect());
        let ends = other.corners.iter();
        let ends: Vec<Vector2<f64>> = ends.map(|corner| flat(corner, origin, axes)).collect();
        // Seen along the same normal the second face is clockwise.
        for k in 0..ends.len() {
            let (to, from) = (ends[k], ends[(k + 1) % ends.len()]);
            let outward = Vector2::new((to - from).y, -(to - from).x).normalize();
            overlap.clip(outward, outward.dot(&from), 0);
        }
        overlap
    };
    let rough = project(&origin, &axes);
    let [low, high] = rough.bounds();
    if rough.is_empty() || (high - low).min() < THIN * size {
        return None;
    }
    let (_, centroid) = rough.area_and_centroid();
    origin += axes[0] * centroid.x + axes[1] * centroid.y;
    origin += normal * middle(&origin, &normal, [one, other]);
    axes = along_longest(&rough, &axes, &normal);
    let overlap = project(&origin, &axes);
    if overlap.is_empty() {
        return None;
    }
    let corners = overlap.corners().iter().map(|(corner, _)| *corner);
    let overlap = Polygon::new(corners.zip(0..).collect());
    let heights = [one, other].map(|face| height(face, &origin, &normal, &axes));
    let gap = between(&heights);
    let (_, centroid) = overlap.area_and_centroid();
    let at_centroid = gap.value(&centroid);
    (at_centroid.abs() <= distance).then(|| Joint {
        faces: names,
        origin,
        axes,
        normal,
        overlap,
        gap,
        heights,
        tilts: [one, other].map(|face| face.normal / face.normal.dot(&normal).abs()),
    })
}

/// Returns two axes normal to a vector, the first one along the first edge of a polygon.
fn plane_axes(normal: &Vector3<f64>, corners: &[Vector3<f64>]) -> [Vector3<f64>; 2] {
    let edge = corners[1] - corners[0];
    let first = (edge - normal * normal.dot(&edge)).normalize();
    [first, normal.cross(&first)]
}

/// Returns axes with the first one along the longest edge of the overlap; of equal edges the first is used.
fn along_longest(
    overlap: &Polygon<usize>,
    axes: &[Vector3<f64>; 2],
    normal: &Vector3<f64>,
) -> [Vector3<f64>; 2] {
    let mut longest = (0.0, Vector2::zeros());
    for (from, to, _) in overlap.edges() {
        let length = (to - from).norm();
        if length > longest.0 * (1.0 + 1e-9) {
            longest = (length, (to - from) / length);
        }
    }
    let along = axes[0] * longest.1.x + axes[1] * longest.1.y;
    let first = (along - normal * normal.dot(&along)).normalize();
    [first, normal.cross(&first)]
}

/// Returns the height of the plane of a face above the plane of a joint, along its normal.
fn height(
    face: &Standing,
    origin: &Vector3<f64>,
    normal: &Vector3<f64>,
    axes: &[Vector3<f64>; 2],
) -> LinearField {
    let along = face.normal.dot(normal);
    LinearField {
        constant: face.normal.dot(&(face.corners[0] - origin)) / along,
        slope: -Vector2::new(face.normal.dot(&axes[0]), face.normal.dot(&axes[1])) / along,
    }
}

/// Returns the mean height of both faces above a point, along the normal \[m\].
fn middle(origin: &Vector3<f64>, normal: &Vector3<f64>, faces: [&Standing; 2]) -> f64 {
    let heights =
        faces.map(|face| face.normal.dot(&(face.corners[0] - origin)) / face.normal.dot(normal));
    0.5 * (heights[0] + heights[1])
}
