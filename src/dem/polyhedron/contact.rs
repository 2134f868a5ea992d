//! Narrow phase: contact test of two blocks, with point, normal, depth and area of the contact.
//!
//! 1. The plane that separated the pair in the last step is tested first: two passes over the vertices.
//! 2. The linear program (`linear_program.rs`) starts from its last basis. A separating plane that it finds is
//!    confirmed by the vertices and stored. A test of all separating axes decides the cases that rounding leaves
//!    undecided. No contact is missed, and there are no false contacts.
//! 3. The contact is reduced to one point, normal and depth by one of three models.
//!
//! [`BlockContactModel::Point`] is the published form (Boon et al. 2012). The contact point is the analytic centre of
//! the overlap. The normal is the direction between the gradients of both "potential particles" at this point. With the
//! planes moved inwards by the rounding `r`,
//!
//! ```text
//! g = sum_i <a_i . x - d_i + r> a_i,     n = g_1/|g_1| - g_2/|g_2|, normalised     <z> = max(z, 0)
//! ```
//!
//! If all terms are zero, the gradient is the normal of the nearest plane. The depth is the distance between both
//! surfaces along `n` through the point. The area is that of the section of the overlap normal to `n`.
//!
//! [`BlockContactModel::Patch`] suits faces in contact with faces. With the volume `V` of the overlap and the
//! vector area `S` of the first block's surface inside the second,
//!
//! ```text
//! n = S/|S|,   area = |S|,   depth = V/|S|,   point = centroid of the overlap
//! ```
//!
//! The force `k area depth = k V` is the sum over a bed of springs of `k` [Pa/m] on the patch, and acts at the
//! resultant of that sum: a tilted face is subject to exactly the restoring moment of the bed. Against a plane this
//! is Winkler's foundation, which conserves energy; between two blocks energy is conserved approximately. All
//! quantities are continuous in the pose, also where a vertex contact becomes a contact of an edge or a face: V
//! grows from zero as the third power, the square, or linearly. There is no rounding to choose. Sources: volume as
//! the measure of contact, S. Hasegawa, M. Sato, Computer Graphics Forum 23 (2004) 529; vector area as normal, Y.
//! T. Feng, K. Han, D. R. J. Owen, Comput. Methods Appl. Mech. Engrg. 205-208 (2012) 169.
//!
//! [`BlockContactModel::Pressure`], the default, has an energy for all shapes: each surface is subject to half the
//! pressure k d of its depth d in the other block (`contact/pressure.rs`). For faces on faces it is the same bed of
//! springs, and against a plane it equals the patch. Relative energy errors in frictionless elastic collisions of
//! boxes:
//!
//! | collision | pressure | patch | point |
//! |---|---|---|---|
//! | face on face | 5e-10 | 3e-10 | 1e-3 |
//! | corner on face | 3e-12 | 2e-12 | 4e-2 |
//! | edge on edge | 2e-12 | 3e-5 | 3e-2 |
//!
//! With the point model a face-on-face collision gains half of the energy if the rounding is a hundred times the
//! overlap: the gradient next to an edge then tilts by tens of degrees, but the surface does not. With mass damping
//! of 10/s a stack of ten blocks stands for a million steps, at rest to 1e-12 m/s, with patch and point. A patch
//! costs less than a point: it needs no Newton iteration.
//!
//! **Facets.** A facet of a surface acts on the points of the block that it hides from the block's centroid: the
//! part behind its plane inside the cone of sight through it, with the facet's own normal. The cones of adjacent
//! facets fill space without gap or overlap: a plane of triangles acts as a plane, an edge within the plane exerts
//! no force, and a convex edge acts from both sides in proportion. Two limitations: beyond a convex edge a face
//! also hides a sliver from a centroid above the other face, of the order of the depth over the size of the block;
//! and a rim that meets a block edge-on exerts no force, because facets act along their normals.
//!
//! All computations use the frame of the first block, so that positions far from the origin lose no digits. Nothing
//! is allocated once the buffers of [`Narrow`] have grown.

mod facet;
mod history;
mod overlap;
mod pressure;
mod sphere;

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cut::count_f64;
use super::linear_program::{self, Verdict};
use super::separating_axes::{gap, widest_gap};
use super::shape::Polyhedron;
use super::{HalfSpace, analytic_centre};
pub use facet::Hidden;
pub use history::BlockHistory;

/// Block in its position for the narrow phase.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// Shape of the block.
    pub shape: &'a Polyhedron,
    /// Rotation from its body frame into space.
    pub rotation: Matrix3<f64>,
}

/// Method by which a contact of blocks is reduced to a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(rename = "BlockModel")]
pub enum BlockContactModel {
    /// Pressure in proportion to the depth of each surface inside the other block. With a stiffness per area it
    /// conserves energy.
    #[default]
    Pressure,
    /// Volume and vector area of the overlap, for faces that are in contact with faces.
    Patch,
    /// Analytic centre of the overlap and normal of the potential particles (Boon et al. 2012).
    Point {
        /// Radius to which corners are rounded \[m\]: larger than an overlap, much smaller than a block.
        #[schemars(extend("exclusiveMinimum" = 0))]
        rounding: f64,
    },
}

/// Geometry of a contact, in the axes of space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Vector from the first centre to the contact point \[m\].
    pub arm: Vector3<f64>,
    /// Unit normal from the first to the second body.
    pub normal: Vector3<f64>,
    /// Overlap \[m\] along the normal, positive.
    pub depth: f64,
    /// Area of contact \[m²\].
    pub area: f64,
    /// Second moments \[m⁴\] of the area about the contact point: the integral of `a a^T` over the arms `a` in the
    /// plane normal to the contact normal.
    pub second: Matrix3<f64>,
    /// Moment of the normal pressure on the second body about the contact point, divided by the normal force \[m\].
    pub couple: Vector3<f64>,
    /// `true` if the patch is fixed to a block, so that it rocks as the block rotates; `false` for a sphere, which
    /// rolls.
    pub rocks: bool,
}

impl Geometry {
    /// Returns the polar second moment of the area \[m⁴\], which resists twisting.
    #[must_use]
    pub fn polar(&self) -> f64 {
        self.second.trace().max(0.0)
    }
}

/// Counts of the methods used, for benches and tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MethodCounts {
    /// Number of linear programs solved.
    pub programs: u64,
    /// Number of pairs decided by the exhaustive test.
    pub exhaustive: u64,
    /// Number of centres that Newton's method did not reach; the best interior point was used.
    pub off_centre: u64,
}

/// Buffers of the narrow phase, one per thread.
#[derive(Clone, Debug, Default)]
pub struct Narrow {
    /// Half-spaces of the first block, then of the second, in the frame of the first.
    planes: Vec<HalfSpace>,
    own: usize,
    /// Vertices and half-spaces of the second block, slightly enlarged.
    vertices: Vec<Vector3<f64>>,
    grown: Vec<HalfSpace>,
    /// Planes that cut, in descending order of the number of vertices outside.
    cutting: Vec<(usize, usize)>,
    polygon: Vec<Vector3<f64>>,
    spare: Vec<Vector3<f64>>,
    /// Polygon before it is cut into parts, and faces with their smallest depth over it.
    whole: Vec<Vector3<f64>>,
    nearest: Vec<(f64, HalfSpace)>,
    heights: Vec<f64>,
    /// Triangles of the surface of the first block inside the second.
    triangles: Vec<[Vector3<f64>; 3]>,
    rows: Vec<[f64; 4]>,
    /// Counts of the methods used.
    pub method_counts: MethodCounts,
}

/// Partner of a block, in the frame of that block.
enum Other<'a> {
    Block {
        shape: &'a Polyhedron,
        turn: Matrix3<f64>,
        separation: Vector3<f64>,
    },
    Plane(HalfSpace),
}

impl Narrow {
    /// Finds the contact of two blocks, lower id first. `separation` \[m\] is the vector from the first centre to the
    /// second.
    pub fn blocks(
        &mut self,
        first: &Placed,
        second: &Placed,
        separation: &Vector3<f64>,
        model: &BlockContactModel,
        history: &mut BlockHistory,
    ) -> Option<Geometry> {
        let reach = first.shape.radius() + second.shape.radius();
        if separation.norm_squared() >= reach * reach {
            history.release();
            return None;
        }
        let turn = first.rotation.tr_mul(&second.rotation);
        let local = first.rotation.tr_mul(separation);
        let apart = |axis: &Vector3<f64>| gap(first.shape, second.shape, &turn, &local, axis);
        if history.axis != Vector3::zeros() {
            if apart(&history.axis) > 0.0 {
                history.release();
                return None;
            }
            history.axis = Vector3::zeros();
        }
        self.planes.clear();
        self.planes.extend_from_slice(first.shape.half_spaces());
        self.own = self.planes.len();
        for plane in second.shape.half_spaces() {
            let normal = turn * plane.normal;
            let offset = plane.offset + normal.dot(&local);
            self.planes.push(HalfSpace { normal, offset });
        }
        self.method_counts.programs += 1;
        let far = 4.0 * first.shape.radius();
        let verdict = linear_program::solve(&self.planes, self.own, far, &mut history.basis);
        let other = Other::Block {
            shape: second.shape,
            turn,
            separation: local,
        };
        let found = match verdict {
            Verdict::Overlap { point, depth } if depth > 0.0 => {
                self.condense(first.shape, &other, &point, depth, model, history)
            }
            Verdict::Apart { axis, .. } => {
                let axis = axis.try_normalize(0.0).unwrap_or_default();
                if apart(&axis) > 0.0 {
                    history.axis = axis;
                    None
                } else {
                    self.exhaust(first.shape, &other, model, history)
                }
            }
            Verdict::Overlap { .. } | Verdict::Open => {
                self.exhaust(first.shape, &other, model, history)
            }
        };
        finish(found, first, history)
    }

    /// Finds the contact of a block (first) with the half-space behind a plane (second): `normal` points out of the
    /// half-space, and the centre of the block is `height` \[m\] above the plane.
    pub fn plane(
        &mut self,
        block: &Placed,
        normal: &Vector3<f64>,
        height: f64,
        model: &BlockContactModel,
        history: &mut BlockHistory,
    ) -> Option<Geometry> {
        let plane = HalfSpace {
            normal: block.rotation.tr_mul(normal),
            offset: -height,
        };
        if height >= block.shape.radius() {
            history.release();
            return None;
        }
        let (lowest, below) = block.shape.support(&-plane.normal);
        if below <= height {
            history.release();
            return None;
        }
        let other = Other::Plane(plane);
        let found = match model {
            BlockContactModel::Pressure | BlockContactModel::Patch => {
                let near = block.shape.vertices()[lowest];
                let overlap = self.overlap(block.shape, &other, &near, &BlockContactModel::Patch);
                self.patch(&other, &overlap)
                    .or_else(|| Some(touch(&near, &-plane.normal, below - height)))
            }
            BlockContactModel::Point { .. } => {
                self.planes.clear();
                self.planes.extend_from_slice(block.shape.half_spaces());
                self.own = self.planes.len();
                self.planes.push(plane);
                self.method_counts.programs += 1;
                let far = 4.0 * block.shape.radius();
                let basis = &mut history.basis;
                match linear_program::solve(&self.planes, self.own, far, basis) {
                    Verdict::Overlap { point, depth } if depth > 0.0 => {
                        self.condense(block.shape, &other, &point, depth, model, history)
                    }
                    _ => self.exhaust(block.shape, &other, model, history),
                }
            }
        };
        finish(found, block, history)
    }

    /// Reduces an overlap with a known deepest point to a contact.
    fn condense(
        &mut self,
        first: &Polyhedron,
        other: &Other,
        deepest: &Vector3<f64>,
        depth: f64,
        model: &BlockContactModel,
        history: &mut BlockHistory,
    ) -> Option<Geometry> {
        match *model {
            BlockContactModel::Pressure | BlockContactModel::Patch => {
                let overlap = self.overlap(first, other, deepest, model);
                let found = if *model == BlockContactModel::Pressure {
                    self.pressed(&overlap)
                } else {
                    self.patch(other, &overlap)
                };
                match found {
                    Some(geometry) => Some(geometry),
                    None => self.exhaust(first, other, model, history),
                }
            }
            BlockContactModel::Point { rounding } => {
                let warm = self
                    .planes
                    .iter()
                    .all(|plane| plane.height(&history.point) < -0.1 * depth);
                let start = if warm { &history.point } else { deepest };
                let (point, reached) = analytic_centre::find(&self.planes, start, &mut self.rows);
                if !reached {
                    self.method_counts.off_centre += 1;
                }
                history.point = point;
                let (own, others) = self.planes.split_at(self.own);
                let one = gradient(own, &point, rounding);
                let two = gradient(others, &point, rounding);
                // The gradients nearly agree: the blocks overlap too deeply to define a normal.
                let normal = match (one - two).try_normalize(1e-3) {
                    Some(normal) => normal,
                    None => return self.exhaust(first, other, model, history),
                };
                let depth = exit(own, &point, &normal) + exit(others, &point, &-normal);
                let (area, second) = self.section(&point, &normal, first.radius());
                Some(Geometry {
                    arm: point,
                    normal,
                    depth,
                    area,
                    second,
                    couple: Vector3::zeros(),
                    rocks: true,
                })
            }
        }
    }

    /// Returns the result of the exhaustive test of a pair: none if an axis separates the blocks, otherwise the
    /// shortest separation.
    fn exhaust(
        &mut self,
        first: &Polyhedron,
        other: &Other,
        model: &BlockContactModel,
        history: &mut BlockHistory,
    ) -> Option<Geometry> {
        self.method_counts.exhaustive += 1;
        let (axis, depth, foremost) = match other {
            Other::Block {
                shape,
                turn,
                separation,
            } => {
                let (axis, wide) = widest_gap(first, shape, turn, separation);
                if wide >= 0.0 {
                    history.axis = axis;
                    return None;
                }
                let foot = shape.support(&-turn.tr_mul(&axis)).0;
                let foot = separation + turn * shape.vertices()[foot];
                let inside = first.half_spaces().iter().all(|p| p.height(&foot) <= -wide);
                let top = first.vertices()[first.support(&axis).0];
                (axis, -wide, if inside { foot } else { top })
            }
            Other::Plane(plane) => {
                let (lowest, below) = first.support(&-plane.normal);
                let depth = below + plane.offset;
                (-plane.normal, depth, first.vertices()[lowest])
            }
        };
        // The volume of the overlap is summed about a point inside it, otherwise rounding could exceed the volume.
        self.overlap(first, other, &foremost, model);
        let corners = self.triangles.iter().flatten();
        let near = corners.sum::<Vector3<f64>>() / count_f64(3 * self.triangles.len());
        let near = if self.triangles.is_empty() {
            foremost
        } else {
            near
        };
        let overlap = self.overlap(first, other, &near, model);
        if *model == BlockContactModel::Pressure
            && let Some(geometry) = self.pressed(&overlap)
        {
            return Some(geometry);
        }
        let about = overlap.centroid - near;
        let size = self
            .triangles
            .iter()
            .flatten()
            .map(|c| (c - near).norm_squared());
        let sound = overlap.volume > 0.0 && about.norm_squared() <= size.fold(0.0, f64::max);
        let (arm, volume) = if sound {
            (overlap.centroid, overlap.volume)
        } else {
            (near, 0.0)
        };
        // One block passes through the other: areas cancel, but the bed of springs still has the strength of the
        // volume.
        let mut geometry = touch(&arm, &axis, depth);
        geometry.area = overlap.area.dot(&axis).max(volume / depth);
        geometry.second = self.second_moments(&arm, &axis);
        Some(geometry)
    }

    /// Returns the result of the exhaustive test of two blocks alone.
    #[cfg(test)]
    pub(super) fn last_resort(
        &mut self,
        first: &Placed,
        second: &Placed,
        separation: &Vector3<f64>,
        history: &mut BlockHistory,
    ) -> Option<Geometry> {
        let other = Other::Block {
            shape: second.shape,
            turn: first.rotation.tr_mul(&second.rotation),
            separation: first.rotation.tr_mul(separation),
        };
        let model = BlockContactModel::Point { rounding: 0.0 };
        let found = self.exhaust(first.shape, &other, &model, history);
        finish(found, first, history)
    }
}

/// Returns the depth \[m\] of two blocks in each other: the length of the shortest translation that separates them, 0
/// if they do not overlap. The depth of a contact is a mean over its area; deep overlaps have none.
#[must_use]
pub fn penetration(first: &Placed, second: &Placed, separation: &Vector3<f64>) -> f64 {
    let turn = first.rotation.tr_mul(&second.rotation);
    let local = first.rotation.tr_mul(separation);
    let (_, wide) = widest_gap(first.shape, second.shape, &turn, &local);
    (-wide).max(0.0)
}

/// Returns the contact in the axes of space, and stores the history of the pair.
fn finish(found: Option<Geometry>, first: &Placed, history: &mut BlockHistory) -> Option<Geometry> {
    if found.is_none() {
        history.release();
    }
    found.map(|geometry| Geometry {
        arm: first.rotation * geometry.arm,
        normal: first.rotation * geometry.normal,
        second: first.rotation * geometry.second * first.rotation.transpose(),
        couple: first.rotation * geometry.couple,
        ..geometry
    })
}

/// Returns a contact at a point.
fn touch(arm: &Vector3<f64>, normal: &Vector3<f64>, depth: f64) -> Geometry {
    Geometry {
        arm: *arm,
        normal: *normal,
        depth,
        area: 0.0,
        second: Matrix3::zeros(),
        couple: Vector3::zeros(),
        rocks: true,
    }
}

/// Returns the unit gradient of a potential particle at a point, or the normal of the nearest plane.
fn gradient(planes: &[HalfSpace], point: &Vector3<f64>, rounding: f64) -> Vector3<f64> {
    let mut sum = Vector3::zeros();
    let mut nearest = (f64::NEG_INFINITY, Vector3::zeros());
    for plane in planes {
        let height = plane.height(point);
        if height > nearest.0 {
            nearest = (height, plane.normal);
        }
        sum += plane.normal * (height + rounding).max(0.0);
    }
    sum.try_normalize(0.0).unwrap_or(nearest.1)
}

/// Returns the distance \[m\] from an interior point to the surface along a unit direction.
fn exit(planes: &[HalfSpace], point: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    planes
        .iter()
        .filter_map(|plane| {
            let rate = plane.normal.dot(direction);
            (rate > 0.0).then(|| -plane.height(point) / rate)
        })
        .fold(f64::INFINITY, f64::min)
}
