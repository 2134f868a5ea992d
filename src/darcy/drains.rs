//! Drains, wells and cavities in the ground, and the air above it: cells removed from it, and planes between cells.
//!
//! The condition of a drain applies to the faces between its cells and the ground, or to both sides of the faces of
//! a plane. These faces are boundary faces like those at the ends of the grid, so that every boundary condition may
//! apply there, seepage faces included. The discharge of a well is a source in its cells instead, which stay in the
//! ground and store water like all others. A well that is narrower than a cell is a plane, and its sources are the
//! cells on both sides of it, between which water flows as everywhere.

use super::enclosure::{DrainFace, Openness, with_one_more};
use super::grid::SeepageGrid;
use std::sync::Arc;

/// Cells of a drain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrainCells {
    /// First cell along each axis.
    pub from: [usize; 3],
    /// Upper bound of the cells, one past the last; equal to the first along the normal of a plane, which is the lower
    /// face of these cells.
    pub to: [usize; 3],
    /// `true` for a well whose discharge is a source of its cells, which stay in the ground.
    pub stays: bool,
    /// `true` for each cell of the grid that belongs to it, for the air above the surface of the ground; none if all
    /// cells between `from` and `to` do.
    pub only: Option<Arc<[bool]>>,
}

impl DrainCells {
    /// Returns the normal of a plane; none for cells.
    #[must_use]
    pub fn normal(&self) -> Option<usize> {
        (0..3).find(|&a| self.from[a] == self.to[a])
    }

    /// Returns the number of cells; 0 for a plane.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.only {
            Some(only) => only.iter().filter(|belongs| **belongs).count(),
            None => (0..3).map(|a| self.to[a] - self.from[a]).product(),
        }
    }

    /// Returns `true` if a cell of the grid belongs to the cells; `false` for a plane.
    #[must_use]
    pub fn contains(&self, grid: &SeepageGrid, cell: [usize; 3]) -> bool {
        self.normal().is_none() && self.holds(grid, cell, None)
    }

    /// Returns `true` if the cells, or the plane normal to `normal`, contain a cell.
    fn holds(&self, grid: &SeepageGrid, cell: [usize; 3], normal: Option<usize>) -> bool {
        let between = (0..3).all(|a| {
            if normal == Some(a) {
                cell[a] == self.from[a]
            } else {
                (self.from[a]..self.to[a]).contains(&cell[a])
            }
        });
        let only = self.only.as_ref();
        between && only.is_none_or(|only| only[grid.index(cell)])
    }
}

impl Openness {
    /// Removes the cells of drains from the ground and closes their planes; a later drain takes precedence. The
    /// faces become [`Self::drain_faces`], in ascending order of the positions of their cells.
    #[must_use]
    pub fn with_drains(mut self, drains: &[DrainCells]) -> Self {
        if drains.is_empty() {
            return self;
        }
        let grid = self.grid.clone();
        let of_cells = |cell: [usize; 3]| {
            let holds = |drain: &DrainCells| drain.contains(&grid, cell);
            let last = drains.iter().rposition(holds);
            last.filter(|&n| !drains[n].stays)
        };
        let owner: Vec<Option<usize>> = (0..grid.count()).map(|k| of_cells(grid.cell(k))).collect();
        for axis in 0..grid.dimension {
            let faces = with_one_more(&grid, axis);
            for index in 0..faces.count() {
                let (upper, open) = (faces.cell(index), self.faces[axis][index]);
                let inner = upper[axis] > 0 && upper[axis] < grid.cells[axis];
                if !inner || open <= 0.0 {
                    continue;
                }
                let mut lower = upper;
                lower[axis] -= 1;
                let cells = [grid.index(lower), grid.index(upper)];
                let sheet = drains
                    .iter()
                    .rposition(|d| d.normal() == Some(axis) && d.holds(&grid, upper, Some(axis)));
                let mut add = |side: usize, drain: usize| {
                    self.drain_faces.push(DrainFace {
                        cell: cells[side],
                        axis,
                        upper: side == 0,
                        open,
                        source: false,
                        drain,
                    });
                };
                match (cells.map(|cell| owner[cell]), sheet) {
                    ([None, None], Some(drain)) if drains[drain].stays => {
                        let [low, high] = [lower, upper].map(|cell| grid.volume(cell));
                        // The nearer of two centres has the larger part.
                        for (cell, ratio) in cells.into_iter().zip([high / low, low / high]) {
                            self.drain_faces.push(DrainFace {
                                cell,
                                axis: 0,
                                upper: false,
                                open: self.inside[cell] * ratio,
                                source: true,
                                drain,
                            });
                        }
                    }
                    ([None, None], Some(drain)) => {
                        add(0, drain);
                        add(1, drain);
                        self.faces[axis][index] = 0.0;
                    }
                    ([None, Some(drain)], _) => add(0, drain),
                    ([Some(drain), None], _) => add(1, drain),
                    _ => {}
                }
            }
        }
        for (cell, inside) in self.inside.iter().enumerate() {
            let holds = |drain: &DrainCells| drain.contains(&grid, grid.cell(cell));
            let well = drains.iter().rposition(holds).filter(|&n| drains[n].stays);
            if let Some(drain) = well.filter(|_| *inside > 0.0) {
                self.drain_faces.push(DrainFace {
                    cell,
                    axis: 0,
                    upper: false,
                    open: *inside,
                    source: true,
                    drain,
                });
            }
        }
        for (inside, owner) in self.inside.iter_mut().zip(&owner) {
            if owner.is_some() {
                *inside = 0.0;
            }
        }
        self.close_faces();
        self.drain_faces
            .sort_by_key(|face| (face.cell, face.axis, face.upper));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enclosure::Enclosure;
    use crate::grid::SeepageGrid;

    fn faces(drain: DrainCells) -> (Openness, Vec<(usize, usize, bool)>) {
        let grid = SeepageGrid {
            cells: [5, 4, 1],
            origin: [0.0; 3],
            spacing: [1.0; 3],
            dimension: 2,
            ..SeepageGrid::default()
        };
        let open = Openness::measure(&grid, &Enclosure::Everything).with_drains(&[drain]);
        let faces = open.drain_faces.iter();
        let faces = faces.map(|f| (f.cell, f.axis, f.upper)).collect();
        (open, faces)
    }

    #[test]
    fn a_cell_has_its_four_faces_and_a_plane_two_sides() {
        let (open, found) = faces(DrainCells {
            from: [2, 1, 0],
            to: [3, 2, 1],
            stays: false,
            only: None,
        });
        assert!(open.blocked(7));
        assert_eq!(
            found,
            [(2, 1, true), (6, 0, true), (8, 0, false), (12, 1, false)]
        );
        let (open, found) = faces(DrainCells {
            from: [1, 2, 0],
            to: [3, 2, 1],
            stays: false,
            only: None,
        });
        assert!(open.inside.iter().all(|inside| *inside == 1.0));
        assert_eq!(
            found,
            [(6, 1, true), (7, 1, true), (11, 1, false), (12, 1, false)]
        );
        assert_eq!(open.faces[1][open.face(1, [1, 2, 0])], 0.0);
        // The well in a plane has the cells on both sides, and the faces between them stay open.
        let (open, _) = faces(DrainCells {
            from: [1, 2, 0],
            to: [3, 2, 1],
            stays: true,
            only: None,
        });
        let sources = open.drain_faces.iter().map(|f| (f.cell, f.source));
        let sources: Vec<_> = sources.collect();
        assert_eq!(sources, [(6, true), (7, true), (11, true), (12, true)]);
        assert_eq!(open.faces[1][open.face(1, [1, 2, 0])], 1.0);
        // At the corner of the grid only the faces towards the ground exist.
        let (_, found) = faces(DrainCells {
            from: [0, 0, 0],
            to: [1, 1, 1],
            stays: false,
            only: None,
        });
        assert_eq!(found, [(1, 0, false), (5, 1, false)]);
    }
}
