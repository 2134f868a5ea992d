//! Cells of one slab and of the ghost layers around it.

use super::rows::Row;
use super::{GHOSTS, MapGrid};
use base::number::{floor_i32, to_i32};
use lbm::lanes::Stored;
use lbm::populations::Populations;

/// Index computations for the cells of a slab; all coordinates are local.
#[derive(Clone, Debug)]
pub(super) struct Slab {
    pub(super) grid: MapGrid,
    /// Cells of the slab.
    pub(super) cells: [i32; 3],
    pub(super) dimension: usize,
}

impl Slab {
    pub(super) fn new<S: Stored>(populations: &Populations<S>, grid: MapGrid) -> Self {
        let cells = populations.cells();
        Self {
            grid,
            cells: cells.map(to_i32),
            dimension: populations.velocities().dimension,
        }
    }

    fn ghosts(&self, axis: usize) -> i32 {
        if axis < self.dimension { GHOSTS } else { 0 }
    }

    /// Returns one value for each cell of the slab and of [`GHOSTS`] layers around it, x fastest: `inside` within
    /// the domain, `outside` elsewhere.
    pub(super) fn layout(&self, inside: u32, outside: u32) -> Vec<u32> {
        let range = |a: usize| -self.ghosts(a)..self.cells[a] + self.ghosts(a);
        let mut values = Vec::with_capacity((0..3).map(|a| range(a).len()).product());
        for z in range(2) {
            for y in range(1) {
                values.extend(range(0).map(|x| {
                    if self.in_domain([x, y, z]) {
                        inside
                    } else {
                        outside
                    }
                }));
            }
        }
        values
    }

    /// Returns the number of layers of cells along the last axis, including ghosts.
    pub(super) fn layers(&self) -> usize {
        let axis = self.dimension - 1;
        usize::try_from(self.cells[axis] + 2 * self.ghosts(axis)).unwrap_or(0)
    }

    /// Returns the number of cells of a layer, which are contiguous in a [`Self::layout`].
    pub(super) fn cells_of_a_layer(&self) -> usize {
        let all = (0..self.dimension - 1).map(|a| self.cells[a] + 2 * self.ghosts(a));
        usize::try_from(all.product::<i32>()).unwrap_or(0)
    }

    /// Returns the layer of a row.
    pub(super) fn layer(&self, row: Row) -> usize {
        let axis = self.dimension - 1;
        let at = if axis == 1 { row.y } else { row.z };
        usize::try_from(at + self.ghosts(axis)).unwrap_or(0)
    }

    /// Returns the index of a cell in a [`Self::layout`].
    pub(super) fn layout_index(&self, cell: [i32; 3]) -> usize {
        let size = |a: usize| self.cells[a] + 2 * self.ghosts(a);
        let k = |a: usize| cell[a] + self.ghosts(a);
        usize::try_from((k(2) * size(1) + k(1)) * size(0) + k(0)).unwrap_or(usize::MAX)
    }

    /// Returns the index offset between a cell and its neighbour along a direction.
    pub(super) fn step(&self, c: [i8; 3]) -> isize {
        let size = |a: usize| (self.cells[a] + 2 * self.ghosts(a)) as isize;
        (isize::from(c[2]) * size(1) + isize::from(c[1])) * size(0) + isize::from(c[0])
    }

    /// Returns `true` if a cell is in the domain or an image of such a cell along a periodic axis.
    pub(super) fn in_domain(&self, local: [i32; 3]) -> bool {
        (0..self.dimension).all(|a| {
            let global = i64::from(local[a]) + self.grid.start[a].cast_signed() as i64;
            self.grid.periodic[a] || (0..self.grid.cells[a].cast_signed() as i64).contains(&global)
        })
    }

    /// Returns `true` if flow and bodies continue as mirror images at any face.
    pub(super) fn mirrors(&self) -> bool {
        self.grid.mirrored.iter().flatten().any(|plane| *plane)
    }

    /// Returns `true` if a cell is in the slab or in its ghost layers.
    pub(super) fn held(&self, local: [i32; 3]) -> bool {
        (0..3).all(|a| {
            let ghosts = self.ghosts(a);
            (-ghosts..self.cells[a] + ghosts).contains(&local[a])
        })
    }

    pub(super) fn interior(&self, local: [i32; 3]) -> bool {
        (0..3).all(|a| (0..self.cells[a]).contains(&local[a]))
    }

    /// Returns `true` if a cell is at least two cells from the edge of the slab.
    pub(super) fn deep(&self, local: [i32; 3]) -> bool {
        (0..self.dimension).all(|a| (2..self.cells[a] - 2).contains(&local[a]))
    }

    /// Returns the offset between frames: see [`MapGrid::frame`].
    pub(super) fn frame(&self, shift: [i32; 3]) -> [i32; 3] {
        self.grid.frame(self.dimension, shift)
    }

    /// Returns the cells of this slab within `reach` of a body, both ends inclusive, in the raw frame.
    pub(super) fn window(&self, position: [f64; 3], frame: [i32; 3], reach: f64) -> [[i32; 3]; 2] {
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for a in 0..self.dimension {
            low[a] = floor_i32(position[a] - reach).max(-GHOSTS - frame[a]);
            high[a] = floor_i32(position[a] + reach).min(self.cells[a] + GHOSTS - 1 - frame[a]);
        }
        [low, high]
    }

    /// Returns the maximum number of rows of a window with this reach, for any position of the body.
    pub(super) fn most_rows(&self, reach: f64) -> usize {
        let across = floor_i32(2.0 * reach) + 2;
        (1..self.dimension)
            .map(|a| usize::try_from(across.min(self.cells[a] + 2 * GHOSTS)).unwrap_or(0))
            .product()
    }
}
