//! Coarse rectilinear grid of the seepage: box cells in rows along x, planes along z; one layer of unit depth in 2-D.
//!
//! Along each axis the cells are equal or graded. The faces of equal cells follow from the origin and one width; those
//! of a graded axis are stored.

use base::number::{real, whole};
use std::sync::Arc;

/// Positions of the faces between cells along each axis \[m\], ascending, one more than the cells; none for an axis
/// with equal cells.
pub type GradedFaces = [Option<Arc<[f64]>>; 3];

/// Rectilinear grid of boxes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SeepageGrid {
    /// Number of cells along x, y, z; 1 along z in 2-D.
    pub cells: [usize; 3],
    /// Lower corner \[m\].
    pub origin: [f64; 3],
    /// Width of the cells along each axis, of the narrowest ones if the axis is graded \[m\]; 1 along z in 2-D.
    pub spacing: [f64; 3],
    /// Dimension: 2 or 3.
    pub dimension: usize,
    /// Faces of graded axes.
    pub graded: GradedFaces,
}

/// Cells of a grid along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridAxis<'a> {
    /// Number of cells.
    pub cells: usize,
    /// Lower end \[m\].
    pub origin: f64,
    /// Width of the cells, of the narrowest ones if the axis is graded \[m\].
    pub spacing: f64,
    /// Positions of the faces of a graded axis \[m\].
    pub faces: Option<&'a [f64]>,
}

impl GridAxis<'_> {
    /// Returns the position of the lower face of a cell, which may be one past the last \[m\].
    #[must_use]
    #[inline]
    pub fn face(&self, n: usize) -> f64 {
        match self.faces {
            None => self.origin + real(n) * self.spacing,
            Some(faces) => faces[n],
        }
    }

    /// Returns the width of a cell \[m\].
    #[must_use]
    #[inline]
    pub fn width(&self, cell: usize) -> f64 {
        match self.faces {
            None => self.spacing,
            Some(faces) => faces[cell + 1] - faces[cell],
        }
    }

    /// Returns the centre of a cell \[m\].
    #[must_use]
    #[inline]
    pub fn centre(&self, cell: usize) -> f64 {
        match self.faces {
            None => self.origin + (real(cell) + 0.5) * self.spacing,
            Some(faces) => 0.5 * (faces[cell] + faces[cell + 1]),
        }
    }

    /// Returns the length of the cells in a range \[m\].
    #[must_use]
    pub fn length(&self, from: usize, to: usize) -> f64 {
        match self.faces {
            None => real(to.saturating_sub(from)) * self.spacing,
            Some(faces) => faces[to.max(from)] - faces[from],
        }
    }

    /// Returns the upper end \[m\].
    #[must_use]
    pub fn end(&self) -> f64 {
        self.face(self.cells)
    }

    /// Returns the index of the cell that contains a position; cells are half open; `None` outside.
    #[must_use]
    pub fn cell_at(&self, position: f64) -> Option<usize> {
        match self.faces {
            None => {
                let place = ((position - self.origin) / self.spacing).floor();
                (place >= 0.0 && place < real(self.cells)).then(|| whole(place))
            }
            Some(faces) => {
                let above = faces.partition_point(|face| *face <= position);
                (above > 0 && above < faces.len()).then(|| above - 1)
            }
        }
    }

    /// Returns the index of the first cell whose centre is not below a position; the number of cells if there is none.
    #[must_use]
    pub fn first_centre(&self, position: f64) -> usize {
        match self.faces {
            None => {
                let place = (position - self.origin) / self.spacing - 0.5;
                whole(place.ceil().clamp(0.0, real(self.cells)))
            }
            Some(_) => {
                let mut cells = 0..self.cells;
                let slack = 1e-9 * self.spacing;
                cells
                    .find(|&cell| self.centre(cell) >= position - slack)
                    .unwrap_or(self.cells)
            }
        }
    }

    /// Returns the index of the face nearest to a position.
    #[must_use]
    pub fn nearest_face(&self, position: f64) -> usize {
        match self.faces {
            None => {
                let place = (position - self.origin) / self.spacing;
                whole(place.round().clamp(0.0, real(self.cells)))
            }
            Some(faces) => {
                let above = faces.partition_point(|face| *face <= position);
                let below = above.saturating_sub(1);
                let above = above.min(self.cells);
                if faces[above] - position <= position - faces[below] {
                    above
                } else {
                    below
                }
            }
        }
    }

    /// Returns the largest ratio of the widths of two neighbouring cells, and the face between them; 1 for equal
    /// cells.
    #[must_use]
    pub fn largest_ratio(&self) -> (f64, usize) {
        let ratio = |face: usize| {
            let (below, above) = (self.width(face - 1), self.width(face));
            (below / above).max(above / below)
        };
        let faces = if self.faces.is_some() { self.cells } else { 0 };
        (1..faces)
            .map(|face| (ratio(face), face))
            .fold(
                (1.0, 0),
                |most, found| if found.0 > most.0 { found } else { most },
            )
    }
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

    /// Returns the cells along an axis.
    #[must_use]
    #[inline]
    pub fn axis(&self, axis: usize) -> GridAxis<'_> {
        GridAxis {
            cells: self.cells[axis],
            origin: self.origin[axis],
            spacing: self.spacing[axis],
            faces: self.graded[axis].as_deref(),
        }
    }

    /// Returns `true` if the cells along any axis differ.
    #[must_use]
    pub fn is_graded(&self) -> bool {
        self.graded.iter().any(Option::is_some)
    }

    /// Returns the width of a cell along an axis \[m\].
    #[must_use]
    #[inline]
    pub fn width(&self, axis: usize, cell: [usize; 3]) -> f64 {
        self.axis(axis).width(cell[axis])
    }

    /// Returns the widths of a cell \[m\].
    #[must_use]
    pub fn widths(&self, cell: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.width(a, cell))
    }

    /// Returns the volume of a cell \[m3; per metre of depth in 2-D, m2\].
    #[must_use]
    pub fn volume(&self, cell: [usize; 3]) -> f64 {
        self.widths(cell).iter().product()
    }

    /// Returns the area of a face normal to an axis of a cell \[m²; per metre of depth in 2-D, m\].
    #[must_use]
    pub fn area(&self, axis: usize, cell: [usize; 3]) -> f64 {
        self.width((axis + 1) % 3, cell) * self.width((axis + 2) % 3, cell)
    }

    /// Returns the lower corner of a cell \[m\].
    #[must_use]
    pub fn corner(&self, cell: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.axis(a).face(cell[a]))
    }

    /// Returns the centre of a cell \[m\]; in 2-D at z = 0.
    #[must_use]
    pub fn centre(&self, cell: [usize; 3]) -> [f64; 3] {
        let mut centre = std::array::from_fn(|a| self.axis(a).centre(cell[a]));
        if self.dimension == 2 {
            centre[2] = 0.0;
        }
        centre
    }

    /// Returns the index along one axis of the cell that contains a position; cells are half open; `None` outside.
    #[must_use]
    pub fn along(&self, axis: usize, position: f64) -> Option<usize> {
        self.axis(axis).cell_at(position)
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

    /// Returns the grid with graded faces along the axes that have them \[m\]: cells, origin and spacing of these axes
    /// follow.
    #[must_use]
    pub fn with_faces(mut self, faces: GradedFaces) -> Self {
        for (axis, faces) in faces.iter().enumerate() {
            if let Some(faces) = faces {
                self.cells[axis] = faces.len() - 1;
                self.origin[axis] = faces[0];
                let widths = faces.windows(2).map(|pair| pair[1] - pair[0]);
                self.spacing[axis] = widths.fold(f64::INFINITY, f64::min);
            }
        }
        self.graded = faces;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graded() -> SeepageGrid {
        let uniform = SeepageGrid {
            cells: [3, 4, 5],
            origin: [-1.0, 0.0, 2.0],
            spacing: [0.5, 0.25, 1.0],
            dimension: 3,
            ..SeepageGrid::default()
        };
        let faces = Arc::from([0.0, 1.0, 3.0, 3.5]);
        uniform.with_faces([None, Some(faces), None])
    }

    #[test]
    fn every_point_has_one_cell() {
        let uniform = SeepageGrid {
            cells: [3, 4, 5],
            origin: [-1.0, 0.0, 2.0],
            spacing: [0.5, 0.25, 1.0],
            dimension: 3,
            ..SeepageGrid::default()
        };
        for grid in [uniform, graded()] {
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

    #[test]
    fn an_axis_knows_its_faces_and_centres() {
        let grid = graded();
        assert_eq!(grid.cells, [3, 3, 5]);
        assert_eq!(grid.spacing, [0.5, 0.5, 1.0]);
        let axis = grid.axis(1);
        assert_eq!((axis.width(1), axis.centre(1), axis.end()), (2.0, 2.0, 3.5));
        assert_eq!(axis.length(1, 3), 2.5);
        assert_eq!(
            [-1.0, 0.4, 1.9, 2.0, 2.1, 9.0].map(|x| axis.first_centre(x)),
            [0, 0, 1, 1, 2, 3]
        );
        assert_eq!(
            [-1.0, 0.4, 1.9, 2.1, 3.2, 3.3, 9.0].map(|x| axis.nearest_face(x)),
            [0, 0, 1, 2, 2, 3, 3]
        );
        assert_eq!(
            [-0.1, 3.0, 3.5].map(|x| axis.cell_at(x)),
            [None, Some(2), None]
        );
        assert_eq!(axis.largest_ratio(), (4.0, 2));
        assert_eq!(grid.axis(0).largest_ratio(), (1.0, 0));
        assert_eq!(grid.volume([0, 1, 0]), 1.0);
        assert_eq!(grid.area(0, [0, 1, 0]), 2.0);
    }
}
