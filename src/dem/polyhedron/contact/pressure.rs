//! Pressure of two blocks on each other, which derives from a potential.
//!
//! With d_i(x) the depth of a point x in block i, the distance to the plane of the nearest face, a stiffness k per area
//! and the overlap O, the energy of a contact is
//!
//! ```text
//! W = k/2 ∫_O (d_1 + d_2) dV
//! ```
//!
//! Each depth moves with its block. If the second block moves, the overlap grows where its surface S_2 moves
//! outwards inside the first block, which is the only change of the integral of d_1; the same holds for the first
//! block relative to the second. The force on the second block is therefore
//!
//! ```text
//! F = -∂W/∂x_2 = k/2 ( ∫_(S_1 in 2) d_2 n_1 dA - ∫_(S_2 in 1) d_1 n_2 dA )
//! ```
//!
//! and its moment is that of the same pressures: each surface is subject to half the pressure k d of the local
//! depth. Energy, momentum and angular momentum are conserved for all shapes and positions, corners and crossing
//! edges included, up to the error of the time integration. Faces on faces carry k depth per area, and their bed of
//! springs resists tilting. The force is continuous in the pose, because the depth is zero where surfaces enter.
//! Sources: contact from an energy of the overlap, Y. T. Feng, Comput. Methods Appl. Mech. Engrg. 373 (2021)
//! 113454; change of an integral with its region, O. Reynolds' transport theorem.
//!
//! The depth is linear where one face is nearest. A polygon of a surface is cut at the planes where two faces of
//! the other block are equally near, and the integrals over its parts are exact.

use nalgebra::Vector3;

use super::super::HalfSpace;
use super::Narrow;

/// Force divided by the stiffness per area [m³] and its moment [m⁴] about the origin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wrench {
    pub(super) force: Vector3<f64>,
    pub(super) moment: Vector3<f64>,
}

/// Force at a point, with a moment.
pub(super) struct PointForce {
    pub(super) point: Vector3<f64>,
    /// Unit vector of the force.
    pub(super) direction: Vector3<f64>,
    /// Magnitude of the force [m³].
    pub(super) size: f64,
    /// Moment about the point divided by the force \[m\].
    pub(super) couple: Vector3<f64>,
}

impl Wrench {
    /// Returns the equivalent force at a point; none if the force is zero.
    pub(super) fn push_at(&self, point: &Vector3<f64>) -> Option<PointForce> {
        let size = self.force.norm();
        let direction = self.force.try_normalize(0.0)?;
        let couple = (self.moment - point.cross(&self.force)) / size;
        let sound = size.is_finite() && couple.iter().all(|part| part.is_finite());
        sound.then_some(PointForce {
            point: *point,
            direction,
            size,
            couple,
        })
    }
}

impl Narrow {
    /// Adds half the pressure on the polygon along `normal` from the depth behind `count` planes of the other
    /// block.
    pub(super) fn add_pressure(
        &mut self,
        count: usize,
        plane: impl Fn(&Self, usize) -> HalfSpace,
        normal: &Vector3<f64>,
        sum: &mut Wrench,
    ) {
        if self.polygon.len() < 3 {
            return;
        }
        // Keep the faces that may be nearest at some point of the polygon; a face deeper than another at all points
        // is dropped.
        self.nearest.clear();
        let mut least = f64::INFINITY;
        for k in 0..count {
            let face = plane(self, k);
            let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
            for corner in &self.polygon {
                let depth = -face.height(corner);
                low = low.min(depth);
                high = high.max(depth);
            }
            least = least.min(high);
            self.nearest.push((low, face));
        }
        self.nearest.retain(|(low, _)| *low <= least);
        self.whole.clear();
        self.whole.extend_from_slice(&self.polygon);
        for k in 0..self.nearest.len() {
            let face = self.nearest[k].1;
            self.polygon.clear();
            self.polygon.extend_from_slice(&self.whole);
            for other in 0..self.nearest.len() {
                if other == k {
                    continue;
                }
                let rival = self.nearest[other].1;
                let nearer = HalfSpace {
                    normal: rival.normal - face.normal,
                    offset: rival.offset - face.offset,
                };
                if !self.cut(|_| nearer) {
                    break;
                }
            }
            for corner in 1..self.polygon.len().saturating_sub(1) {
                let polygon = &self.polygon;
                let (a, b, c) = (polygon[0], polygon[corner], polygon[corner + 1]);
                let depths = [-face.height(&a), -face.height(&b), -face.height(&c)];
                let half = 0.25 * (b - a).cross(&(c - a)).dot(normal).abs();
                let total = depths[0] + depths[1] + depths[2];
                sum.force += normal * (half * total / 3.0);
                let first =
                    (a * (total + depths[0]) + b * (total + depths[1]) + c * (total + depths[2]))
                        * (half / 12.0);
                sum.moment += first.cross(normal);
            }
        }
    }
}
