//! Rows of a layer of cells covered by a convex polyhedron: the beginning and end of all rows of the layer, in one
//! loop per plane.
//!
//! The loops have neither branches nor calls, so that the compiler vectorises them. Each number has the same bits
//! as for a single row.

use super::{LEVEL, RowCells, RowIntervals};
use base::ball::EMPTY;
use lbm::links::CellPlane;

/// Rows of the layers of a polyhedron; the buffers are reused. [`Self::fill`] starts a body, [`Self::layer`]
/// computes a layer, and [`Self::row`] returns the cells of a row.
#[derive(Debug, Default)]
pub(crate) struct BlockRows {
    /// Axes from slowest to fastest.
    order: [usize; 3],
    /// Lower corners of the rows along the middle axis.
    lower: Vec<f64>,
    /// Ends of the intervals of each row: outer, inner, deep.
    low: [Vec<f64>; 3],
    high: [Vec<f64>; 3],
}

impl BlockRows {
    /// Prepares a body over the `count` rows from `first` on along the middle axis of `order`.
    #[inline(always)]
    pub(crate) fn fill(&mut self, first: i32, count: i32, order: [usize; 3]) {
        self.order = order;
        self.lower.clear();
        self.lower.extend((first..first + count).map(f64::from));
        for n in 0..3 {
            self.low[n].resize(self.lower.len(), 0.0);
            self.high[n].resize(self.lower.len(), 0.0);
        }
    }

    /// Computes the layer with this lower end.
    #[inline(always)]
    pub(crate) fn layer(&mut self, planes: &[CellPlane], bottom: f64) {
        for n in 0..3 {
            self.low[n].fill(RowIntervals::ALL[0]);
            self.high[n].fill(RowIntervals::ALL[1]);
        }
        for plane in planes {
            self.narrow::<0>(plane, bottom);
            self.narrow::<1>(plane, bottom);
            self.narrow::<2>(plane, bottom);
        }
    }

    /// Narrows the outer (0), inner (1) or deep (2) interval of each row to the part below a plane.
    #[inline(always)]
    fn narrow<const N: usize>(&mut self, plane: &CellPlane, bottom: f64) {
        let [across, along, slope] = self.order.map(|axis| plane.normal[axis]);
        let beside = across.abs() + along.abs();
        let farthest = |normal: f64, lower: f64| {
            let (p, q) = (normal * lower, normal * (lower + 1.0));
            if N == 0 { p.min(q) } else { p.max(q) }
        };
        let layer = farthest(across, bottom);
        let room = |lower: f64| {
            let room = plane.offset - (layer + farthest(along, lower));
            if N == 2 { room - beside } else { room }
        };
        let count = self.lower.len();
        let lower = &self.lower[..count];
        let (low, high) = (&mut self.low[N][..count], &mut self.high[N][..count]);
        if slope > LEVEL {
            for k in 0..count {
                high[k] = high[k].min(room(lower[k]) / slope);
            }
        } else if slope < -LEVEL {
            for k in 0..count {
                low[k] = low[k].max(room(lower[k]) / slope);
            }
        } else {
            for k in 0..count {
                if room(lower[k]) < 0.0 {
                    [low[k], high[k]] = EMPTY;
                }
            }
        }
    }

    /// Returns the cells of a row of the layer; `frame` is the offset from the raw frame of the body to the cells.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize, frame: i32) -> RowCells {
        let ends = |n: usize| [self.low[n][row], self.high[n][row]];
        let row = RowIntervals {
            outer: ends(0),
            inner: ends(1),
            deep: ends(2),
        };
        RowCells::from_row(&row, frame)
    }
}
