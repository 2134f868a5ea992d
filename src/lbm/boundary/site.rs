//! Where a boundary is imposed.

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
}
