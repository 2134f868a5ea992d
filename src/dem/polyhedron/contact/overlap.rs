//! Overlap of two solids: volume, centroid, and the part of each surface inside the other.
//!
//! Every face of either block is clipped by the planes of the other. The tetrahedra between the clipped triangles and a
//! common point add up to the volume; the triangles of the first block's surface add up to the vector area.

use nalgebra::{Matrix3, Vector3};

use super::super::HalfSpace;
use super::super::cut::across;
use super::super::shape::Polyhedron;
use super::pressure::Wrench;
use super::{BlockContactModel, Geometry, Narrow, Other};

/// Relative enlargement of the second block where surfaces are cut (2^-36), which separates coplanar faces of both
/// blocks: otherwise rounding could count both of them as inside, or neither.
const ENLARGEMENT: f64 = 1.0 / 68_719_476_736.0;

/// Ratio of vector area to area below which the direction of the vector area is unreliable.
const MIN_AREA_RATIO: f64 = 0.05;

/// Ratio of vector area to the larger of both areas below which one block lies within the other: its closed surface has
/// no vector area, only rounding errors.
const ENCLOSED_RATIO: f64 = 1e-3;

/// Overlap of two solids: volume [m³], position relative to the first centre [m], and the vector area [m²] of the
/// first block's surface in it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Overlap {
    pub(super) volume: f64,
    pub(super) centroid: Vector3<f64>,
    pub(super) area: Vector3<f64>,
    /// Areas [m²] of the first surface inside the second block, and of the second surface inside the first.
    pub(super) surfaces: [f64; 2],
    /// Force on the second block divided by the stiffness per area [m³], and its moment [m⁴] about the first
    /// centre: see [`super::pressure`].
    pub(super) pressure: Wrench,
}

impl Narrow {
    /// Computes the overlap of two solids; its volume is summed about `near`.
    pub(super) fn overlap(
        &mut self,
        first: &Polyhedron,
        other: &Other,
        near: &Vector3<f64>,
        model: &BlockContactModel,
    ) -> Overlap {
        self.grown.clear();
        self.vertices.clear();
        match other {
            Other::Block {
                shape,
                turn,
                separation,
            } => {
                for plane in shape.half_spaces() {
                    let normal = turn * plane.normal;
                    let offset = plane.offset * (1.0 + ENLARGEMENT) + normal.dot(separation);
                    self.grown.push(HalfSpace { normal, offset });
                }
                for vertex in shape.vertices() {
                    self.vertices
                        .push(separation + turn * (vertex * (1.0 + ENLARGEMENT)));
                }
            }
            Other::Plane(plane) => self.grown.push(*plane),
        }
        let mut sum = Overlap::default();
        let presses = *model == BlockContactModel::Pressure && matches!(other, Other::Block { .. });
        self.triangles.clear();
        // Faces of the first block inside the second.
        cutters(&self.grown, first.vertices(), &mut self.cutting);
        for face in 0..first.half_spaces().len() {
            self.polygon.clear();
            let corners = first.face(face).iter();
            self.polygon
                .extend(corners.map(|&v| first.vertices()[v as usize]));
            for k in 0..self.cutting.len() {
                let plane = self.cutting[k].1;
                if !self.cut(|narrow| narrow.grown[plane]) {
                    break;
                }
            }
            for k in 1..self.polygon.len().saturating_sub(1) {
                let triangle = fan(&self.polygon, k, near);
                let part = add(&mut sum, &triangle);
                sum.area += part;
                sum.surfaces[0] += part.norm();
                let [a, b, c] = triangle;
                self.triangles.push([a + near, b + near, c + near]);
            }
            if presses {
                let normal = first.half_spaces()[face].normal;
                let planes = self.grown.len();
                self.add_pressure(
                    planes,
                    |narrow, k| narrow.grown[k],
                    &normal,
                    &mut sum.pressure,
                );
            }
        }
        // Faces of the second block inside the first.
        match other {
            Other::Block { shape, .. } => {
                cutters(first.half_spaces(), &self.vertices, &mut self.cutting);
                for face in 0..shape.half_spaces().len() {
                    self.polygon.clear();
                    let corners = shape.face(face).iter();
                    self.polygon
                        .extend(corners.map(|&v| self.vertices[v as usize]));
                    self.add_inner_part(first, near, &mut sum);
                    if presses {
                        let normal = -self.grown[face].normal;
                        let planes = first.half_spaces();
                        self.add_pressure(
                            planes.len(),
                            |_, k| planes[k],
                            &normal,
                            &mut sum.pressure,
                        );
                    }
                }
            }
            Other::Plane(plane) => {
                let middle = plane.normal * plane.offset;
                square(&mut self.polygon, &middle, &plane.normal, first.radius());
                self.vertices.extend_from_slice(&self.polygon);
                cutters(first.half_spaces(), &self.vertices, &mut self.cutting);
                self.add_inner_part(first, near, &mut sum);
            }
        }
        sum.centroid = near + sum.centroid / sum.volume;
        sum
    }

    /// Adds the part of the polygon inside the first block.
    pub(super) fn add_inner_part(
        &mut self,
        first: &Polyhedron,
        near: &Vector3<f64>,
        sum: &mut Overlap,
    ) {
        for k in 0..self.cutting.len() {
            let plane = self.cutting[k].1;
            if !self.cut(|_| first.half_spaces()[plane]) {
                break;
            }
        }
        for k in 1..self.polygon.len().saturating_sub(1) {
            let triangle = fan(&self.polygon, k, near);
            sum.surfaces[1] += add(sum, &triangle).norm();
        }
    }

    /// Cuts the polygon down to the part inside a half-space; returns `true` if any part is left.
    #[inline]
    pub(super) fn cut(&mut self, plane: impl Fn(&Self) -> HalfSpace) -> bool {
        let plane = plane(self);
        self.heights.clear();
        let heights = self.polygon.iter().map(|corner| plane.height(corner));
        self.heights.extend(heights);
        if self.heights.iter().all(|&height| height <= 0.0) {
            return !self.polygon.is_empty();
        }
        self.spare.clear();
        let count = self.polygon.len();
        for k in 0..count {
            let next = if k + 1 == count { 0 } else { k + 1 };
            let (a, b) = (self.heights[k], self.heights[next]);
            if a <= 0.0 {
                self.spare.push(self.polygon[k]);
            }
            if (a > 0.0) != (b > 0.0) {
                // The bits do not depend on the direction of the edge.
                let (from, to, low, high) = if a > 0.0 {
                    (self.polygon[next], self.polygon[k], b, a)
                } else {
                    (self.polygon[k], self.polygon[next], a, b)
                };
                self.spare.push(from + (to - from) * (low / (low - high)));
            }
        }
        std::mem::swap(&mut self.polygon, &mut self.spare);
        !self.polygon.is_empty()
    }

    /// Returns the contact of an overlap; none if the surface of the overlap has no direction.
    pub(super) fn patch(&self, other: &Other, overlap: &Overlap) -> Option<Geometry> {
        let area = overlap.area.norm();
        let normal = match other {
            // The normal of the plane itself, without rounding.
            Other::Plane(plane) => -plane.normal,
            Other::Block { .. } => overlap.area / area,
        };
        // If both surfaces nearly cancel, one block penetrates the other, and the vector area is meaningless.
        let [one, two] = overlap.surfaces;
        let sound = overlap.volume > 0.0
            && area > MIN_AREA_RATIO * one.min(two)
            && area > ENCLOSED_RATIO * one.max(two)
            && overlap.centroid.iter().all(|c| c.is_finite());
        sound.then(|| Geometry {
            arm: overlap.centroid,
            normal,
            depth: overlap.volume / area,
            area,
            second: self.second_moments(&overlap.centroid, &normal),
            couple: Vector3::zeros(),
            rocks: true,
        })
    }

    /// Returns the contact of two blocks by pressure; none if the overlap consists of rounding errors.
    pub(super) fn pressed(&self, overlap: &Overlap) -> Option<Geometry> {
        let push = overlap.pressure.push_at(&overlap.centroid)?;
        // If one block penetrates the other, the vectors of a surface nearly cancel: the force remains, with an
        // area that does not vanish.
        let [one, two] = overlap.surfaces;
        let least = (MIN_AREA_RATIO * one.min(two)).max(ENCLOSED_RATIO * one.max(two));
        let area = overlap.area.norm().max(least);
        let sound = area > 0.0 && push.point.iter().all(|c| c.is_finite());
        sound.then(|| Geometry {
            arm: push.point,
            normal: push.direction,
            depth: push.size / area,
            area,
            second: self.second_moments(&push.point, &push.direction),
            couple: push.couple,
            rocks: true,
        })
    }

    /// Returns the second moments [m⁴] about an axis of the first surface inside the second block, projected along
    /// the axis.
    pub(super) fn second_moments(
        &self,
        point: &Vector3<f64>,
        normal: &Vector3<f64>,
    ) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        let flatten = |corner: &Vector3<f64>| {
            let arm = corner - point;
            arm - normal * normal.dot(&arm)
        };
        for triangle in &self.triangles {
            let [a, b, c] = triangle;
            let flat = [flatten(a), flatten(b), flatten(c)];
            let twice = (flat[1] - flat[0]).cross(&(flat[2] - flat[0])).dot(normal);
            sum += spread(&flat) * (twice / 24.0);
        }
        sum
    }

    /// Computes area and second moments of the section of all half-spaces normal to `normal` at `point`.
    pub(super) fn section(
        &mut self,
        point: &Vector3<f64>,
        normal: &Vector3<f64>,
        radius: f64,
    ) -> (f64, Matrix3<f64>) {
        square(&mut self.polygon, point, normal, 2.0 * radius);
        for k in 0..self.planes.len() {
            if !self.cut(|narrow| narrow.planes[k]) {
                return (0.0, Matrix3::zeros());
            }
        }
        let (mut area, mut second) = (0.0, Matrix3::zeros());
        for k in 1..self.polygon.len().saturating_sub(1) {
            let triangle = fan(&self.polygon, k, point);
            let twice = (triangle[1] - triangle[0])
                .cross(&(triangle[2] - triangle[0]))
                .dot(normal);
            area += 0.5 * twice;
            second += spread(&triangle) * (twice / 24.0);
        }
        (area, second)
    }
}

/// Finds the planes that cut a set of vertices, those with most vertices outside first, with the number of vertices
/// outside.
pub(super) fn cutters(
    planes: &[HalfSpace],
    vertices: &[Vector3<f64>],
    found: &mut Vec<(usize, usize)>,
) {
    found.clear();
    for (k, plane) in planes.iter().enumerate() {
        let outside = vertices.iter().filter(|v| plane.height(v) > 0.0).count();
        if outside > 0 {
            found.push((outside, k));
        }
    }
    found.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
}

/// Returns the triangle of the first corner of a polygon and corners k and k + 1, relative to a point.
#[inline]
fn fan(polygon: &[Vector3<f64>], k: usize, point: &Vector3<f64>) -> [Vector3<f64>; 3] {
    [
        polygon[0] - point,
        polygon[k] - point,
        polygon[k + 1] - point,
    ]
}

/// Adds the tetrahedron of a triangle and the origin; returns the vector area of the triangle.
#[inline]
pub(super) fn add(sum: &mut Overlap, triangle: &[Vector3<f64>; 3]) -> Vector3<f64> {
    let [a, b, c] = triangle;
    let volume = a.dot(&b.cross(c)) / 6.0;
    sum.volume += volume;
    sum.centroid += (a + b + c) * (0.25 * volume);
    (b - a).cross(&(c - a)) * 0.5
}

/// Returns twelve times the mean of `r r^T` over a triangle with corners r.
#[inline]
pub(super) fn spread(triangle: &[Vector3<f64>; 3]) -> Matrix3<f64> {
    let [a, b, c] = triangle;
    let sum = a + b + c;
    a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose()
}

/// Sets the polygon to a square normal to `normal`, counter-clockwise about it.
pub(super) fn square(
    polygon: &mut Vec<Vector3<f64>>,
    middle: &Vector3<f64>,
    normal: &Vector3<f64>,
    half: f64,
) {
    let (s, t) = across(normal);
    polygon.clear();
    for (p, q) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        polygon.push(middle + s * (p * half) + t * (q * half));
    }
}
