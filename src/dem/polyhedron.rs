//! Blocks: contact, force and rotation of convex polyhedra.
//!
//! Pure functions and plain structs in SI units, without ranks, lists or cases. An engine calls them for each block
//! and pair.
//!
//! ```text
//! each step and block  rotation: kick by force and moment, drift of centre and orientation
//! each pair            contact:  cached axis -> linear program -> pressure | patch | point     (Narrow, History)
//!                      force:    springs, history, Coulomb limit, dashpots          (Law, History)
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `shape`, `shape_error` | [`Polyhedron`]: half-spaces, vertices, faces, edges; volume, inertia, body frame |
//! | `hull`, `cut` | half-spaces of a set of points; vertices and faces of a set of half-spaces |
//! | `piece` | a solid that is cut by planes one after another |
//! | `linear_program` | intersection test of two sets of half-spaces: dual simplex method in four variables |
//! | `analytic_centre` | the contact point of Boon et al. (2012) |
//! | `separating_axes` | the exhaustive test, for pairs that the linear program leaves open |
//! | `contact` | the narrow phase: two blocks, block and plane; `contact/`: overlap, sphere, facet, history |
//! | `force` | contact law |
//! | `rotation` | orientation and angular momentum |
//!
//! **Order.** The result of a pair is a function of (first, second) and of the pair's [`BlockHistory`]. Pass the
//! lower id first, and a separation from raw positions: every rank that has the pair then computes the same bits.
//! `BlockHistory` is plain data; it is part of the history of a contact in messages and checkpoints.

mod analytic_centre;
pub mod contact;
pub(crate) mod cut;
pub mod force;
mod hull;
mod linear_program;
mod piece;
pub mod rotation;
mod separating_axes;
pub mod shape;
mod shape_error;

pub use contact::{BlockContactModel, BlockHistory, Geometry, Hidden, Narrow, Placed, penetration};
pub use force::{BlockPairLaw, ContactResponse, Stiffness};
pub use piece::Piece;
pub use rotation::{Damping, RotationState};
pub use shape::{PlacedPolyhedron, Polyhedron};
pub use shape_error::ShapeError;

use nalgebra::Vector3;

/// Half-space `normal . x <= offset` with a unit normal that points out of it; lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Unit normal, outwards.
    pub normal: Vector3<f64>,
    /// Distance of the plane from the origin along the normal \[m\].
    pub offset: f64,
}

impl HalfSpace {
    /// Returns the signed distance \[m\] of a point from the plane; negative inside.
    #[inline(always)]
    #[must_use]
    pub fn height(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

#[cfg(test)]
mod tests;
