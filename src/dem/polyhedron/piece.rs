//! Convex solid in space that is cut by planes one after another, to divide a rock mass into blocks.
//!
//! Both parts get the same corners on the cut, bit by bit: neighbours fit exactly and no volume is lost. Each part
//! records which of its faces are cuts. After the last cut, [`Piece::solid`] turns it into a block.

use nalgebra::Vector3;

use super::HalfSpace;
use super::cut::{Cut, count_f64};
use super::linear_program::{NO_BASIS, Verdict, solve};
use super::shape::{PlacedPolyhedron, Polyhedron, moments};
use super::shape_error::ShapeError;

/// Maximum distance of a corner from a plane, in sizes of the solid, at which it lies on the plane.
const ON_PLANE: f64 = 1e-11;

/// Convex solid: see the module.
#[derive(Clone, Debug)]
pub struct Piece {
    cut: Cut,
    sides: Vec<Side>,
    tolerance: f64,
}

/// Plane of a face.
#[derive(Clone, Copy, Debug)]
struct Side {
    plane: HalfSpace,
    /// `true` if the face was created by a cut.
    split: bool,
}

impl Piece {
    /// Returns the solid before any cut.
    #[must_use]
    pub fn from_polyhedron(solid: &PlacedPolyhedron) -> Self {
        let planes = solid.half_spaces();
        let faces = (0..planes.len()).map(|face| (face, solid.shape.face(face).to_vec()));
        let side = |plane| Side {
            plane,
            split: false,
        };
        Self {
            cut: Cut {
                vertices: solid.vertices(),
                faces: faces.collect(),
            },
            sides: planes.into_iter().map(side).collect(),
            tolerance: ON_PLANE * solid.shape.radius(),
        }
    }

    /// Returns the parts on both sides of a plane, the one inside the half-space first; none if the plane does not
    /// cut the solid.
    #[must_use]
    pub fn split(&self, plane: &HalfSpace) -> Option<[Self; 2]> {
        let (low, high) = self.extent(&plane.normal);
        if plane.offset - low <= self.tolerance || high - plane.offset <= self.tolerance {
            return None;
        }
        let turned = HalfSpace {
            normal: -plane.normal,
            offset: -plane.offset,
        };
        Some([self.part(plane), self.part(&turned)])
    }

    /// Returns the part inside a half-space whose plane cuts the solid.
    fn part(&self, plane: &HalfSpace) -> Self {
        let mut cut = self.cut.clone();
        cut.by(plane, self.sides.len(), self.tolerance);
        let mut cut = cut.without_unused_corners();
        let new = Side {
            plane: *plane,
            split: true,
        };
        let side = |name: usize| self.sides.get(name).copied().unwrap_or(new);
        let sides = cut.faces.iter().map(|(name, _)| side(*name)).collect();
        for (place, (name, _)) in cut.faces.iter_mut().enumerate() {
            *name = place;
        }
        Self {
            cut,
            sides,
            tolerance: self.tolerance,
        }
    }

    /// Returns the minimum and the maximum of the extent of the solid along a direction (m, times the length of the
    /// direction).
    #[must_use]
    pub fn extent(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        self.cut.vertices.iter().fold(start, |(low, high), v| {
            let height = direction.dot(v);
            (low.min(height), high.max(height))
        })
    }

    /// Returns the volume \[m³\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        moments(&self.cut, &self.middle()).volume
    }

    /// Returns the diameter \[m\] of the inscribed sphere.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        let middle = self.middle();
        let planes: Vec<HalfSpace> = self
            .sides
            .iter()
            .map(|side| HalfSpace {
                normal: side.plane.normal,
                offset: side.plane.offset - side.plane.normal.dot(&middle),
            })
            .collect();
        let far = |v: &Vector3<f64>| (v - middle).norm();
        let reach = self.cut.vertices.iter().map(far).fold(0.0, f64::max);
        match solve(&planes, planes.len(), 4.0 * reach, &mut NO_BASIS.clone()) {
            Verdict::Overlap { depth, .. } => 2.0 * depth,
            Verdict::Apart { .. } | Verdict::Open => 0.0,
        }
    }

    /// Returns the block with its cut faces moved inwards by `back` \[m\].
    ///
    /// # Errors
    /// If nothing remains of the block.
    pub fn solid(&self, back: f64) -> Result<PlacedPolyhedron, ShapeError> {
        let planes: Vec<HalfSpace> = self
            .sides
            .iter()
            .map(|side| HalfSpace {
                normal: side.plane.normal,
                offset: side.plane.offset - if side.split { back } else { 0.0 },
            })
            .collect();
        Polyhedron::from_half_spaces(&planes)
    }

    /// Returns an interior point.
    fn middle(&self) -> Vector3<f64> {
        self.cut.vertices.iter().sum::<Vector3<f64>>() / count_f64(self.cut.vertices.len())
    }
}
