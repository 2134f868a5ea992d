//! Contacts of a block with the facets of a surface.
//!
//! A facet acts on the points of the block that it hides from the block's centroid: the part of the block behind
//! the plane of the facet, inside the cone of sight through the facet.

use nalgebra::{Matrix3, Vector3};

use super::super::HalfSpace;
use super::overlap::{Overlap, add, cutters, spread};
use super::{Geometry, Narrow, Placed};

/// Depth, divided by the height of the centroid, below which an overlap is rounding: volumes behind facets are
/// differences of cones.
const ROUNDING: f64 = 1e-11;

/// Parts of a block hidden by the facets of one plane, as sums over the facets in the frame of the block: see
/// [`Narrow::add_hidden_part`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Hidden {
    /// Volume [m³] and its first moment [m⁴].
    part: Overlap,
    /// Area [m²] of the facets inside the block, and its first [m³] and second [m⁴] moments about the centroid.
    area: f64,
    first: Vector3<f64>,
    second: Matrix3<f64>,
}

impl Narrow {
    /// Adds to `sum` the part of a block that a convex facet hides from its centroid: the points whose line of
    /// sight to the centroid the facet cuts. `corners` \[m\] are relative to the centroid, in the axes of space and
    /// counter-clockwise about `normal`, which points to the side of the centroid.
    pub fn add_hidden_part(
        &mut self,
        block: &Placed,
        corners: impl Iterator<Item = Vector3<f64>>,
        normal: &Vector3<f64>,
        sum: &mut Hidden,
    ) {
        let normal = block.rotation.tr_mul(normal);
        self.vertices.clear();
        let corners = corners.map(|corner| block.rotation.tr_mul(&corner));
        self.vertices.extend(corners);
        let Some(corner) = self.vertices.first() else {
            return;
        };
        let offset = normal.dot(corner);
        if offset >= 0.0 {
            return;
        }
        // Clip the facet to the inside of the block.
        let half_spaces = block.shape.half_spaces();
        cutters(half_spaces, &self.vertices, &mut self.cutting);
        self.polygon.clear();
        self.polygon.extend_from_slice(&self.vertices);
        for k in 0..self.cutting.len() {
            let plane = self.cutting[k].1;
            if !self.cut(|_| half_spaces[plane]) {
                return;
            }
        }
        for k in 1..self.polygon.len().saturating_sub(1) {
            let polygon = &self.polygon;
            let triangle = [polygon[0], polygon[k], polygon[k + 1]];
            let area = add(&mut sum.part, &triangle).dot(&normal);
            sum.area += area;
            let flat = triangle.map(|corner| corner - normal * offset);
            sum.first += (flat[0] + flat[1] + flat[2]) * (area / 3.0);
            sum.second += spread(&flat) * (area / 12.0);
        }
        // Clip the faces of the block behind the facet to the cone of sight; the sides of the cone pass through the
        // centroid and enclose no volume.
        self.grown.clear();
        self.grown.push(HalfSpace { normal, offset });
        for (k, a) in self.vertices.iter().enumerate() {
            let b = self.vertices[(k + 1) % self.vertices.len()];
            let side = a.cross(&b).try_normalize(0.0).unwrap_or_default();
            self.grown.push(HalfSpace {
                normal: side,
                offset: 0.0,
            });
        }
        cutters(&self.grown, block.shape.vertices(), &mut self.cutting);
        for face in 0..half_spaces.len() {
            self.polygon.clear();
            let corners = block.shape.face(face).iter();
            self.polygon
                .extend(corners.map(|&v| block.shape.vertices()[v as usize]));
            for k in 0..self.cutting.len() {
                let plane = self.cutting[k].1;
                if !self.cut(|narrow| narrow.grown[plane]) {
                    break;
                }
            }
            for k in 1..self.polygon.len().saturating_sub(1) {
                let polygon = &self.polygon;
                add(&mut sum.part, &[polygon[0], polygon[k], polygon[k + 1]]);
            }
        }
    }
}

impl Hidden {
    /// Returns the contact of a block with the facets, whose plane is `height` \[m\] from its centroid; none if
    /// they hide only rounding errors.
    #[must_use]
    pub fn contact(&self, block: &Placed, normal: &Vector3<f64>, height: f64) -> Option<Geometry> {
        let volume = self.part.volume;
        // A negated comparison, so that NaN gives none.
        if !(self.area > 0.0 && volume > ROUNDING * height * self.area) {
            return None;
        }
        let arm = self.part.centroid / volume;
        let along = block.rotation.tr_mul(normal);
        let flat = arm - along * along.dot(&arm);
        let mixed = flat * self.first.transpose();
        let second = self.second - mixed - mixed.transpose() + flat * flat.transpose() * self.area;
        Some(Geometry {
            arm: block.rotation * arm,
            normal: -normal,
            depth: volume / self.area,
            area: self.area,
            second: block.rotation * second * block.rotation.transpose(),
            couple: Vector3::zeros(),
            rocks: true,
        })
    }
}
