//! Cells of a slab that the pass leaves out: they contain no water, and no water is computed there.
//!
//! Their populations are zero. A cell that is not processed keeps its numbers, so that it reflects each population
//! into the link on which it came; links to other cells are reflected by the coupling. Rows are divided into parts
//! without such cells. A part is processed in whole vectors, which may contain up to seven of the cells behind it; the
//! numbers that these send are set to zero after the step ([`Fluid::clear_left_out`]), so that no result depends on the
//! direction of the rows or the width of the vectors.
//!
//! With an eddy viscosity and a body force a processed cell has a velocity, of which its neighbours take gradients.
//! All cells are processed then.

use super::Fluid;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::surface::lists::{Plane, TOGETHER};
use base::number::{to_i32, to_u32};
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// Cells that the pass leaves out.
#[derive(Debug)]
pub(super) struct LeftOut {
    /// Parts of the rows of each plane that the pass processes; empty if it processes all cells.
    pub(super) planes: Vec<Plane>,
    /// Positions of the cells whose populations may differ from zero after a step.
    touched: Vec<usize>,
}

/// Position of a row: its indices along the slowest and the middle axis.
type RowAt = [i32; 2];

impl LeftOut {
    /// Returns the parts of rows without these cells, given in local coordinates with at least one layer of ghosts.
    fn new<S: Stored>(populations: &Populations<S>, cells: &[[i32; 3]], skips: bool) -> Self {
        let [slow, middle, fast] = populations.order();
        let size = populations.cells().map(to_i32);
        let length = size[fast];
        let inside = |cell: &[i32; 3]| (0..3).all(|a| (0..size[a]).contains(&cell[a]));
        let position = |cell: &[i32; 3]| populations.cell(cell.map(|v| v as isize));
        if !skips {
            let all = cells.iter().filter(|cell| inside(cell));
            return Self {
                planes: Vec::new(),
                touched: all.map(position).collect(),
            };
        }
        let mut rows: BTreeMap<RowAt, BTreeSet<i32>> = BTreeMap::new();
        for cell in cells
            .iter()
            .filter(|cell| (0..length).contains(&cell[fast]))
        {
            let row = rows.entry([cell[slow], cell[middle]]).or_default();
            row.insert(cell[fast]);
        }
        let spans: BTreeMap<RowAt, Vec<[u32; 2]>> = rows
            .iter()
            .map(|(at, left)| (*at, parts(left, length)))
            .collect();
        let mut processed = HashSet::new();
        for (at, left) in &rows {
            for &[begin, end] in &spans[at] {
                let within = to_i32(begin as usize)..to_i32(end as usize);
                processed.extend(left.range(within).map(|k| {
                    let mut cell = [0; 3];
                    (cell[slow], cell[middle], cell[fast]) = (at[0], at[1], *k);
                    cell
                }));
            }
        }
        let is_touched = |cell: &&[i32; 3]| {
            let velocities = &populations.velocities().c;
            velocities.iter().any(|c| {
                let near = std::array::from_fn(|a| cell[a] + i32::from(c[a]));
                processed.contains(&near)
            })
        };
        let own = cells.iter().filter(|cell| inside(cell));
        let touched = own.filter(is_touched).map(position).collect();
        let whole = [[0, to_u32(populations.cells()[fast])]];
        let row = |plane: i32, row: i32| spans.get(&[plane, row]).map_or(&whole[..], Vec::as_slice);
        let plane = |plane: i32| Plane::of_spans((0..size[middle]).map(|at| row(plane, at)));
        Self {
            planes: (0..size[slow]).map(plane).collect(),
            touched,
        }
    }
}

/// Returns the parts of a row of this length that the pass processes, in whole vectors up to the end of the row. `left`
/// are the cells to leave out.
fn parts(left: &BTreeSet<i32>, length: i32) -> Vec<[u32; 2]> {
    let unsigned = |v: i32| u32::try_from(v).unwrap_or(0);
    let together = to_i32(TOGETHER);
    let mut parts: Vec<[u32; 2]> = Vec::new();
    let mut at = 0;
    while at < length {
        if left.contains(&at) {
            at += 1;
            continue;
        }
        let next = left.range(at..).next().copied().unwrap_or(length);
        let vectors = (next - at + together - 1) / together;
        let end = (at + vectors * together).min(length);
        match parts.last_mut() {
            Some(last) if last[1] == unsigned(at) => last[1] = unsigned(end),
            _ => parts.push([unsigned(at), unsigned(end)]),
        }
        at = end;
    }
    parts
}

impl<S: Stored> Fluid<S> {
    /// Leaves cells out of the next passes: those with these local coordinates and no others. Cells of the first layer
    /// of ghosts must be included. No population may pass between them and other cells, and their populations must be
    /// zero ([`Self::empty`]).
    pub fn leave_out(&mut self, cells: &[[i32; 3]]) {
        let moves = self.half_force().iter().any(|force| *force != 0.0);
        let skips = !(self.field.is_some() && moves) && self.surface.is_none();
        self.left_out = (!cells.is_empty() && !self.populations.cells().contains(&0))
            .then(|| Box::new(LeftOut::new(&self.populations, cells, skips)));
    }

    /// Sets the populations and velocities of a cell to zero, given by its position.
    pub fn empty(&mut self, cell: usize) {
        self.shared_with_gpu = false;
        clear(&mut self.populations, cell);
        if let Some(field) = &mut self.field {
            field.still(cell);
        }
    }

    /// Sets the populations to zero that cells which are left out sent or received in the last step. The links between
    /// them and other cells must have been reflected.
    pub fn clear_left_out(&mut self) {
        if let Some(left_out) = &self.left_out {
            for &cell in &left_out.touched {
                clear(&mut self.populations, cell);
            }
        }
    }
}

/// Sets the incoming populations of a cell to zero.
fn clear<S: Stored>(populations: &mut Populations<S>, cell: usize) {
    for i in 0..populations.velocities().q() {
        let position = populations.incoming(cell, i);
        populations.numbers_mut()[position] = S::from_f64(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_divided_into_whole_vectors_without_overlap() {
        let left = |ranges: &[[i32; 2]]| ranges.iter().flat_map(|[a, b]| *a..*b).collect();
        assert_eq!(parts(&left(&[[10, 30]]), 40), [[0, 16], [30, 40]]);
        // A gap shorter than a vector is processed.
        assert_eq!(parts(&left(&[[10, 13]]), 40), [[0, 40]]);
        assert_eq!(parts(&left(&[[0, 40]]), 40), [[0; 2]; 0]);
        assert_eq!(parts(&left(&[[0, 5]]), 40), [[5, 40]]);
        // A row that begins and ends with cells to leave out.
        assert_eq!(parts(&left(&[[0, 3], [20, 40]]), 40), [[3, 27]]);
    }
}
