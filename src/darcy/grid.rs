//! Coarse regular grid of the seepage: box cells in rows along x, planes along z; one layer of unit depth in 2-D.

use base::number::{real, whole};

/// Regular grid of boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeepageGrid {
    /// Number of cells along x, y, z; 1 along z in 2-D.
    pub cells: [usize; 3],
    /// Lower corner \[m\].
    pub origin: [f64; 3],
    /// Edges of a cell \[m\]; 1 along z in 2-D.
    pub spacing: [f64; 3],
    /// Dimension: 2 or 3.
    pub dimension: usize,
}

impl SeepageGrid {
    /// Returns the number of cells.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Returns the position of a cell in arrays of the whole grid: x fastest.
    #[must_use]
    #[inline]
    pub fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.cells[1] + cell[1]) * self.cells[0] + cell[0]
    }

    /// Returns the cell at a position in arrays.
    #[must_use]
    pub fn cell(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [index % nx, (index / nx) % ny, index / (nx * ny)]
    }

    /// Returns the volume of a cell \[m3; per metre of depth in 2-D, m2\].
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.spacing.iter().product()
    }

    /// Returns the area of a face normal to an axis \[m²; per metre of depth in 2-D, m\].
    #[must_use]
    pub fn area(&self, axis: usize) -> f64 {
        self.spacing[(axis + 1) % 3] * self.spacing[(axis + 2) % 3]
    }

    /// Returns the lower corner of a cell \[m\].
    #[must_use]
    pub fn corner(&self, cell: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.origin[a] + real(cell[a]) * self.spacing[a])
    }

    /// Returns the centre of a cell \[m\]; in 2-D at z = 0.
    #[must_use]
    pub fn centre(&self, cell: [usize; 3]) -> [f64; 3] {
        let mut centre =
            std::array::from_fn(|a| self.origin[a] + (real(cell[a]) + 0.5) * self.spacing[a]);
        if self.dimension == 2 {
            centre[2] = 0.0;
        }
        centre
    }

    /// Returns the index along one axis of the cell that contains a position; cells are half open; `None` outside.
    #[must_use]
    pub fn along(&self, axis: usize, position: f64) -> Option<usize> {
        let place = ((position - self.origin[axis]) / self.spacing[axis]).floor();
        (place >= 0.0 && place < real(self.cells[axis])).then(|| whole(place))
    }

    /// Returns the cell that contains a point; `None` outside the grid.
    #[must_use]
    pub fn holding(&self, point: [f64; 3]) -> Option<[usize; 3]> {
        let mut cell = [0; 3];
        for axis in 0..self.dimension {
            cell[axis] = self.along(axis, point[axis])?;
        }
        Some(cell)
    }
}
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_has_one_cell() {
        let grid = SeepageGrid {
            cells: [3, 4, 5],
            origin: [-1.0, 0.0, 2.0],
            spacing: [0.5, 0.25, 1.0],
            dimension: 3,
        };
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            assert_eq!(grid.index(cell), index);
            assert_eq!(grid.holding(grid.centre(cell)), Some(cell));
            assert_eq!(grid.holding(grid.corner(cell)), Some(cell));
        }
        assert_eq!(grid.holding([0.5, 0.1, 2.1]), None);
        assert_eq!(grid.holding([-1.1, 0.1, 2.1]), None);
    }
}
