//! Where a boundary is imposed.

use super::nature::{Inflow, Strength};
use crate::geometry::Face;

/// The face of a boundary and the grid of the domain.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// JSON path of its parameters.
    pub path: &'a str,
    /// The face.
    pub face: Face,
    /// Number of dimensions, 2 or 3.
    pub dimension: usize,
    /// Edge of a cell \[m\].
    pub spacing: f64,
    /// Cells of the whole domain.
    pub cells: [usize; 3],
    /// Axes along which the domain repeats.
    pub periodic: [bool; 3],
}

/// The cells at which a boundary is imposed.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// Where they are.
    pub site: Site<'a>,
    /// First cell along each axis; 0 along the normal.
    pub from: [usize; 3],
    /// One past the last cell along each axis; 1 along the normal.
    pub to: [usize; 3],
    /// All openings of the domain, this one included; none where they are not known yet.
    pub openings: &'a [Opening],
}

impl Place<'_> {
    /// Its cells.
    #[must_use]
    pub fn count(&self) -> usize {
        let cells = (0..3).map(|a| self.to[a].saturating_sub(self.from[a]));
        cells.product()
    }
}

/// An opening of the domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opening {
    /// What it imposes.
    pub strength: Strength,
    /// Its cells.
    pub cells: usize,
    /// What flows in.
    pub inflow: Inflow,
    /// Time over which the inflow grows \[s\].
    pub ramp_time: f64,
}
