//! Part of the domain where a boundary is imposed.

use super::kind::{Inflow, Strength};
use base::geometry::Face;
use base::number::real;

/// Face of a boundary and grid of the domain.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// JSON path of the boundary's parameters.
    pub path: &'a str,
    /// Face of the boundary.
    pub face: Face,
    /// Number of dimensions, 2 or 3.
    pub dimension: usize,
    /// Edge of a cell \[m\].
    pub spacing: f64,
    /// Number of cells of the whole domain.
    pub cells: [usize; 3],
    /// `true` for each periodic axis.
    pub periodic: [bool; 3],
    /// `true` for each face of the domain that is an impermeable wall, by axis, the lower one first.
    pub walls: [[bool; 2]; 3],
}

/// Cells of a boundary.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// Site of the boundary.
    pub site: Site<'a>,
    /// First cell along each axis; 0 along the normal.
    pub from: [usize; 3],
    /// One past the last cell along each axis; 1 along the normal.
    pub to: [usize; 3],
    /// Lower and upper ends along each axis in cells, which may lie within a cell; 0 and 1 along the normal.
    pub ends: [[f64; 2]; 3],
    /// All openings of the domain, including this one; empty if they are not known yet.
    pub openings: &'a [Opening],
    /// `true` if bodies move in the water and may reach the boundary.
    pub bodies_move: bool,
}

impl Place<'_> {
    /// Returns the ends of the patch, and `true` for those that are walls. An end within the face counts as a wall.
    #[must_use]
    pub fn sides(&self) -> Sides {
        let site = &self.site;
        let across = |a: usize| a < site.dimension && a != site.face.axis();
        Sides {
            ends: self.ends,
            walls: std::array::from_fn(|a| {
                let [low, high] = self.ends[a];
                let at_face = [low <= 0.0, high >= real(site.cells[a])];
                std::array::from_fn(|side| {
                    let face = site.walls[a][side] && !site.periodic[a];
                    across(a) && (!at_face[side] || face)
                })
            }),
        }
    }

    /// Returns the fraction of a cell's face within the ends of the patch.
    #[must_use]
    pub fn part(&self, cell: [usize; 3]) -> f64 {
        let along = |a: usize| {
            let ([low, high], first) = (self.ends[a], real(cell[a]));
            (high.min(first + 1.0) - low.max(first)).clamp(0.0, 1.0)
        };
        let axes = (0..3).filter(|a| *a != self.site.face.axis());
        axes.map(along).product()
    }

    /// Returns the area of the patch, in faces of cells.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.ends
            .iter()
            .map(|[low, high]| (high - low).max(0.0))
            .product()
    }
}

/// Ends of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// Lower and upper end along each axis in cells.
    ends: [[f64; 2]; 3],
    /// `true` for the ends that are walls.
    walls: [[bool; 2]; 3],
}

impl Sides {
    /// Returns the distance \[cells\] of a point on the face from the nearest wall; `None` if no end is a wall.
    #[must_use]
    pub fn from_wall(&self, position: [f64; 3]) -> Option<f64> {
        let distances = (0..3).flat_map(|a| {
            let [low, high] = self.ends[a];
            let apart = [position[a] - low, high - position[a]];
            (0..2)
                .filter(move |side| self.walls[a][*side])
                .map(move |side| apart[side].max(0.0))
        });
        distances.reduce(f64::min)
    }
}

/// Opening of the domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opening {
    /// Strength of the imposed condition.
    pub strength: Strength,
    /// Area, in faces of cells.
    pub area: f64,
    /// Inflow through the opening.
    pub inflow: Inflow,
    /// Time over which the inflow grows from zero \[s\].
    pub ramp_time: f64,
}
