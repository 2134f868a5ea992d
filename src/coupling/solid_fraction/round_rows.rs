//! Rows of a layer of cells covered by a ball or disc: the beginning and end of all rows of the layer, in one loop.
//!
//! The loops have neither branches nor calls, so that the compiler vectorises them. Each number has the same bits
//! as for a single row.

use super::RowIntervals;
use base::ball::{NormalDistances, around, chord, within};

/// Ranges of the cells of a row, as coordinates along it: the first cell and one past the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RowCells {
    /// Cells that the body reaches.
    pub(crate) outer: [i32; 2],
    /// Cells that it fills.
    pub(crate) full: [i32; 2],
    /// Cells that it fills with all cells around them.
    pub(crate) deep: [i32; 2],
}

impl RowCells {
    /// Returns the cells of a row of any body; `frame` is the offset from its raw frame to the cells.
    #[inline(always)]
    pub(crate) fn from_row(row: &RowIntervals, frame: i32) -> Self {
        Self {
            outer: if row.misses() {
                [0; 2]
            } else {
                around(row.outer, frame)
            },
            full: within(row.inner, 0, frame),
            deep: within(row.deep, 1, frame),
        }
    }
}

/// Rows of the layers of a ball or disc; the buffers are reused.
#[derive(Debug, Default)]
pub(crate) struct RoundRows {
    /// Distance of each row from the centre along the axis between the slowest and the fastest: smallest, largest,
    /// and with the adjacent rows.
    distances: [Vec<f64>; 3],
    /// Ends of the cells of each row: outer, full, deep.
    low: [Vec<i32>; 3],
    high: [Vec<i32>; 3],
}

impl RoundRows {
    /// Stores the distances from the centre of the rows of a body, from coordinate `first` on.
    #[inline(always)]
    pub(crate) fn fill(&mut self, count: usize, distances: impl Fn(usize) -> NormalDistances) {
        for n in 0..3 {
            self.distances[n].clear();
            self.low[n].resize(count, 0);
            self.high[n].resize(count, 0);
        }
        for k in 0..count {
            let NormalDistances {
                nearest,
                farthest,
                beyond,
            } = distances(k);
            self.distances[0].push(nearest);
            self.distances[1].push(farthest);
            self.distances[2].push(beyond);
        }
    }

    /// Computes a layer.
    #[inline(always)]
    pub(crate) fn layer(&mut self, layer: NormalDistances, centre: f64, radius: f64, frame: i32) {
        self.ends::<0>(layer.nearest, centre, radius, frame);
        self.ends::<1>(layer.farthest, centre, radius, frame);
        self.ends::<2>(layer.beyond, centre, radius, frame);
    }

    #[inline(always)]
    fn ends<const N: usize>(&mut self, layer: f64, centre: f64, radius: f64, frame: i32) {
        let distances = &self.distances[N][..];
        let count = distances.len();
        let (low, high) = (&mut self.low[N][..count], &mut self.high[N][..count]);
        for k in 0..count {
            let [from, to] = chord(centre, radius, layer + distances[k]);
            [low[k], high[k]] = match N {
                0 => around([from, to], frame),
                1 => within([from, to], 0, frame),
                _ => within([from, to], 1, frame),
            };
        }
    }

    /// Returns the cells of a row of the layer.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> RowCells {
        let ends = |n: usize| [self.low[n][row], self.high[n][row]];
        RowCells {
            outer: ends(0),
            full: ends(1),
            deep: ends(2),
        }
    }
}
