//! Cells of a level that are merged for the next one, along each axis.
//!
//! Equal cells are merged in pairs along the axes of strongest coupling. Of graded cells only those are merged that are
//! narrow compared with the narrowest cell of all axes: cells next to fine ones across the flow keep their width until
//! the fine ones have reached it, so that no level merges cells across weak couplings.

use crate::grid::SeepageGrid;
use std::ops::Range;

/// Largest ratio of the width of a graded cell to the narrowest one at which it is merged.
const NARROW: f64 = 2.5;

/// Widths of the cells of a level along each axis \[m\].
#[derive(Clone, Debug)]
pub(super) enum Widths {
    /// Equal cells.
    Equal([f64; 3]),
    /// Width of each cell.
    Graded([Vec<f64>; 3]),
}

/// Cells merged along each axis for the next level.
#[derive(Clone, Debug)]
pub(super) struct Merging {
    /// Number of cells merged along each axis if all cells are equal: 1 or 2.
    pub(super) joined: [usize; 3],
    /// Merged cells of a graded grid; none if all cells are equal.
    pub(super) graded: Option<Box<[AxisMerging; 3]>>,
}

/// Merged cells along an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct AxisMerging {
    /// First cell of each merged cell, then the number of cells.
    pub(super) starts: Vec<usize>,
    /// Merged cell of each cell.
    pub(super) of: Vec<usize>,
}

impl AxisMerging {
    fn new(starts: Vec<usize>) -> Self {
        let cells = starts.windows(2).enumerate();
        let of = cells.flat_map(|(merged, pair)| std::iter::repeat_n(merged, pair[1] - pair[0]));
        Self {
            of: of.collect(),
            starts,
        }
    }

    /// Merges pairs of neighbouring cells that are at most this wide.
    fn narrow(widths: &[f64], most: f64) -> Self {
        let mut starts = vec![0];
        let mut at = 0;
        while at < widths.len() {
            let pair = at + 1 < widths.len() && widths[at].max(widths[at + 1]) <= most;
            at += if pair { 2 } else { 1 };
            starts.push(at);
        }
        Self::new(starts)
    }

    /// Merges the narrowest cell with the narrower one of its neighbours.
    fn narrowest(widths: &[f64]) -> Self {
        let least = (0..widths.len()).min_by(|&i, &j| widths[i].total_cmp(&widths[j]));
        let at = least.unwrap_or(0);
        let width = |n: usize| widths.get(n).copied().unwrap_or(f64::INFINITY);
        let first = if at > 0 && width(at - 1) <= width(at + 1) {
            at - 1
        } else {
            at
        };
        Self::new((0..=widths.len()).filter(|&n| n != first + 1).collect())
    }

    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the widths of the merged cells.
    fn widths(&self, widths: &[f64]) -> Vec<f64> {
        let parts = self.starts.windows(2);
        parts
            .map(|pair| widths[pair[0]..pair[1]].iter().sum())
            .collect()
    }
}

impl Widths {
    pub(super) fn new(grid: &SeepageGrid) -> Self {
        if grid.is_graded() {
            let of_axis = |a: usize| (0..grid.cells[a]).map(|n| grid.axis(a).width(n)).collect();
            Self::Graded(std::array::from_fn(of_axis))
        } else {
            Self::Equal(grid.spacing)
        }
    }

    /// Returns the cells to merge on a level.
    pub(super) fn merge(&self, cells: [usize; 3]) -> Merging {
        match self {
            Self::Equal(spacing) => Merging::equal(joined(cells, *spacing)),
            Self::Graded(widths) => {
                let several = || (0..3).filter(|&a| cells[a] > 1);
                let least = |a: usize| widths[a].iter().copied().fold(f64::INFINITY, f64::min);
                let narrowest = several().map(least).fold(f64::INFINITY, f64::min);
                let mut axes: [AxisMerging; 3] = std::array::from_fn(|a| {
                    AxisMerging::narrow(
                        &widths[a],
                        if cells[a] > 1 {
                            NARROW * narrowest
                        } else {
                            0.0
                        },
                    )
                });
                if several().all(|a| axes[a].count() == cells[a])
                    && let Some(a) = several().find(|&a| least(a) <= narrowest)
                {
                    axes[a] = AxisMerging::narrowest(&widths[a]);
                }
                Merging {
                    joined: [1; 3],
                    graded: Some(Box::new(axes)),
                }
            }
        }
    }

    /// Returns the widths of merged cells.
    pub(super) fn coarser(&self, merging: &Merging) -> Self {
        match (self, &merging.graded) {
            (Self::Graded(widths), Some(axes)) => {
                Self::Graded(std::array::from_fn(|a| axes[a].widths(&widths[a])))
            }
            (Self::Equal(spacing), _) => Self::Equal(std::array::from_fn(|a| {
                spacing[a] * base::number::real(merging.joined[a])
            })),
            (Self::Graded(_), None) => self.clone(),
        }
    }
}

impl Merging {
    /// Returns a merging of equal cells.
    pub(super) fn equal(joined: [usize; 3]) -> Self {
        Self {
            joined,
            graded: None,
        }
    }

    /// Returns the numbers of merged cells.
    pub(super) fn cells(&self, cells: [usize; 3]) -> [usize; 3] {
        match &self.graded {
            None => std::array::from_fn(|a| cells[a].div_ceil(self.joined[a])),
            Some(axes) => std::array::from_fn(|a| axes[a].count()),
        }
    }

    /// Returns the merged cell that contains a cell.
    pub(super) fn coarse(&self, cell: [usize; 3]) -> [usize; 3] {
        match &self.graded {
            None => {
                let [x, y, z] = self.joined;
                [cell[0] / x, cell[1] / y, cell[2] / z]
            }
            Some(axes) => {
                let [x, y, z] = &**axes;
                [x.of[cell[0]], y.of[cell[1]], z.of[cell[2]]]
            }
        }
    }

    /// Returns the merged planes along an axis of a range whose ends lie between merged cells.
    pub(super) fn planes(&self, axis: usize, planes: &Range<usize>) -> Range<usize> {
        let merged = |plane: usize| match &self.graded {
            None => plane.div_ceil(self.joined[axis]),
            Some(axes) => axes[axis]
                .of
                .get(plane)
                .copied()
                .unwrap_or(axes[axis].count()),
        };
        merged(planes.start)..merged(planes.end)
    }

    /// Returns the place of the face within the merged cell of a cell: `Some(0)` for its lower face, `Some(1)` for its
    /// upper one, none if the cell is not merged.
    pub(super) fn inner(&self, axis: usize, index: usize) -> Option<usize> {
        match &self.graded {
            None if self.joined[axis] == 1 => None,
            None => Some(usize::from(index.is_multiple_of(2))),
            Some(axes) => {
                let axis = &axes[axis];
                let start = axis.starts[axis.of[index]];
                let single = axis.starts[axis.of[index] + 1] - start == 1;
                (!single).then(|| usize::from(index == start))
            }
        }
    }

    /// Returns `true` if the lower face of a cell lies between two merged cells.
    pub(super) fn is_between(&self, axis: usize, index: usize) -> bool {
        match &self.graded {
            None => index.is_multiple_of(self.joined[axis]),
            Some(axes) => axes[axis].starts[axes[axis].of[index]] == index,
        }
    }

    /// Returns the first cell of each merged cell along an axis of `cells` cells, then the number of cells.
    pub(super) fn starts(&self, axis: usize, cells: usize) -> Vec<usize> {
        match &self.graded {
            None => {
                let step = self.joined[axis];
                let pairs = cells.div_ceil(step);
                (0..=pairs).map(|n| (n * step).min(cells)).collect()
            }
            Some(axes) => axes[axis].starts.clone(),
        }
    }
}

/// Returns the axes to merge: those whose coupling is at least a third of the strongest and that still have several
/// cells.
fn joined(cells: [usize; 3], spacing: [f64; 3]) -> [usize; 3] {
    let strength: [f64; 3] = std::array::from_fn(|a| {
        if cells[a] > 1 {
            1.0 / (spacing[a] * spacing[a])
        } else {
            0.0
        }
    });
    let strongest = strength.iter().fold(0.0_f64, |m, &s| m.max(s));
    std::array::from_fn(|a| {
        if cells[a] > 1 && 3.0 * strength[a] >= strongest {
            2
        } else {
            1
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// Checks that merging ends, that every level is smaller, and that fine cells are merged first.
    #[test]
    fn narrow_cells_are_merged_first() {
        let faces: Arc<[f64]> = Arc::from([0.0, 100.0, 110.0, 111.0, 112.0, 113.0, 130.0, 230.0]);
        let grid = SeepageGrid {
            cells: [7, 20, 1],
            spacing: [1.0, 10.0, 1.0],
            dimension: 2,
            ..SeepageGrid::default()
        };
        let grid = grid.with_faces([Some(faces), None, None]);
        let mut widths = Widths::new(&grid);
        let mut cells = grid.cells;
        let merging = widths.merge(cells);
        let starts = merging.starts(0, cells[0]);
        assert_eq!(starts, [0, 1, 2, 4, 5, 6, 7]);
        assert_eq!(merging.starts(1, cells[1]).len(), 21);
        assert_eq!(merging.coarse([3, 7, 0]), [2, 7, 0]);
        assert_eq!(
            [2, 3, 4].map(|n| merging.inner(0, n)),
            [Some(1), Some(0), None]
        );
        assert_eq!(
            [2, 3, 4].map(|n| merging.is_between(0, n)),
            [true, false, true]
        );
        assert_eq!(merging.planes(0, &(2..7)), 2..6);
        let mut levels = 0;
        while cells.iter().product::<usize>() > 1 {
            let merging = widths.merge(cells);
            let next = merging.cells(cells);
            assert!(
                next.iter().product::<usize>() < cells.iter().product(),
                "{cells:?}"
            );
            widths = widths.coarser(&merging);
            cells = next;
            levels += 1;
        }
        assert!(levels < 20, "{levels}");
    }

    #[test]
    fn a_jump_of_widths_is_merged_too() {
        let widths = Widths::Graded([vec![100.0, 1.0, 50.0], vec![1.0], vec![1.0]]);
        let merging = widths.merge([3, 1, 1]);
        assert_eq!(merging.starts(0, 3), [0, 1, 3]);
    }
}
