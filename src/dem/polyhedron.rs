//! Blocks: convex polyhedra that touch, turn and slide (B-01 … B-10, E-06).
//!
//! Pure functions and plain structs in SI, without ranks, lists or cases: an engine calls them per block and per pair.
//!
//! ```text
//! per step and block   rotation: kick by force and moment, drift of centre and attitude
//! per pair             contact:  cached axis -> linear program -> point | patch     (Narrow, Memory)
//!                      force:    springs, history, Coulomb limit, dashpots          (Law, Memory)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `shape` | [`Polyhedron`]: half-spaces, vertices, faces, edges; volume, inertia, body frame |
//! | `hull`, `cut` | half-spaces of a set of points; vertices and faces of a set of half-spaces |
//! | `piece` | a solid cut in two by one plane after the other |
//! | `linear_program` | do two sets of half-spaces meet: dual simplex in four variables |
//! | `analytic_centre` | Boon's contact point |
//! | `separating_axes` | the exhaustive test, for what the linear program leaves open |
//! | `contact` | the narrow phase of two blocks, a block and a plane, a block and a sphere |
//! | `force` | contact law |
//! | `rotation` | attitude and angular momentum |
//!
//! **Order.** The result of a pair is a function of (first, second) and of the pair's [`Memory`]. Give the lower id first, and a
//! separation from raw positions: then every rank that sees the pair computes the same bits. `Memory` is plain data and goes
//! wherever the history of a contact goes: between ranks, into checkpoints.

mod analytic_centre;
pub mod contact;
mod cut;
mod error;
pub mod force;
mod hull;
mod linear_program;
mod piece;
pub mod rotation;
mod separating_axes;
pub mod shape;

pub use contact::{Geometry, Hidden, Memory, Model, Narrow, Placed};
pub(crate) use cut::across;
pub use error::ShapeError;
pub use force::{Action, Law, Stiffness};
pub use piece::Piece;
pub use rotation::{Attitude, Damping};
pub use shape::{Polyhedron, Solid};

use nalgebra::Vector3;

/// A half-space `normal . x <= offset` with a unit normal that points out of it; lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Unit normal, outwards.
    pub normal: Vector3<f64>,
    /// Distance (m) of the plane from the origin along the normal.
    pub offset: f64,
}

impl HalfSpace {
    /// How far (m) a point is outside; negative inside.
    #[inline(always)]
    #[must_use]
    pub fn height(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

#[cfg(test)]
mod tests;
