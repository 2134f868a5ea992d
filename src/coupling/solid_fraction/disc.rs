//! Exact solid fractions of a disc in the cells at its edge, with the same bits as
//! [`disc_rectangle`](darcy::overlap::disc_rectangle) at a fraction of its cost.
//!
//! The area of a disc in a cell is the sum over its four corners, with alternating signs, of a function of the
//! corner: a product of its coordinates inside the disc, otherwise two segments, each of one coordinate. A segment
//! costs a root and an arctangent. N cells in a row have only N + 1 corner coordinates, whereas cell by cell eight
//! segments would be computed.

use darcy::overlap::{quadrant_of, segment};
use lbm::lanes::WIDEST;
use std::ops::Range;

/// Coordinates of the corners along one axis, in radii from the centre. Those after the last corner lie at the edge
/// of the disc.
#[derive(Debug, Default)]
struct Coordinates {
    size: Vec<f64>,
    sign: Vec<f64>,
    /// Value of [`segment`] at each size.
    segment: Vec<f64>,
}

impl Coordinates {
    #[inline(always)]
    fn fill(&mut self, corners: Range<i32>, centre: f64, radius: f64) {
        let padded = corners.len().next_multiple_of(WIDEST);
        self.size.clear();
        self.sign.clear();
        self.segment.clear();
        for x in corners {
            let at = ((f64::from(x) - centre) / radius).clamp(-1.0, 1.0);
            self.size.push(at.abs());
            self.sign.push(at.signum());
            self.segment.push(segment(at.abs()));
        }
        self.size.resize(padded, 1.0);
        self.sign.resize(padded, 1.0);
        self.segment.resize(padded, 0.0);
    }
}

/// Line of corners along the fast axis: the signed part of the disc between its centre and each corner, in units of
/// the squared radius.
#[derive(Debug, Default)]
struct Corners {
    /// Index of the line across the fast axis; none before the first.
    line: Option<usize>,
    parts: Vec<f64>,
}

/// Corner values of some cells; the buffers are reused. [`Self::fill`] starts a disc, and [`Self::row`] returns the
/// fractions of a row.
#[derive(Debug, Default)]
pub(crate) struct DiscTable {
    /// Fast axis: 0 or 1.
    fast: usize,
    radius: f64,
    along: Coordinates,
    across: Coordinates,
    corners: [Corners; 2],
    /// Filled fractions of the cells of a row.
    fractions: Vec<f64>,
}

impl DiscTable {
    /// Prepares a disc over the cells from `lower` on, in rows along axis `fast`, which is 0 or 1.
    #[inline(always)]
    pub(crate) fn fill(
        &mut self,
        (centre, radius): ([f64; 3], f64),
        (lower, cells): ([i32; 3], [i32; 3]),
        fast: usize,
    ) {
        let corners = |axis: usize| lower[axis]..lower[axis] + cells[axis] + 1;
        let across = 1 - fast;
        (self.fast, self.radius) = (fast, radius);
        self.along.fill(corners(fast), centre[fast], radius);
        self.across.fill(corners(across), centre[across], radius);
        for corners in &mut self.corners {
            corners.line = None;
            // The last cell reads one element beyond its corners.
            corners.parts.resize(self.along.size.len() + 1, 0.0);
        }
        self.fractions.resize(self.along.size.len() + WIDEST, 0.0);
    }

    /// Computes the filled fractions of `count` cells from number `first` on in a row, counted across the fast
    /// axis. Consecutive rows share their corners. Undefined are the values of cells inside the disc, of cells that
    /// it does not reach, and of up to [`WIDEST`] elements beyond the row.
    #[inline(always)]
    pub(crate) fn row(&mut self, row: usize, first: usize, count: usize) -> &[f64] {
        if self.fast == 0 {
            self.compute::<0>(row);
        } else {
            self.compute::<1>(row);
        }
        &self.fractions[first..][..count]
    }

    #[inline(always)]
    fn compute<const FAST: usize>(&mut self, row: usize) {
        for line in [row, row + 1] {
            if self.corners[line % 2].line != Some(line) {
                self.line::<FAST>(line);
            }
        }
        let length = self.along.size.len();
        let lower = &self.corners[row % 2].parts[..=length];
        let upper = &self.corners[(row + 1) % 2].parts[..=length];
        // Corners of low x and high y, and of high x and low y.
        let [low_high, high_low] = if FAST == 0 {
            [&upper[..length], &lower[1..]]
        } else {
            [&lower[1..], &upper[..length]]
        };
        let (both_low, both_high) = (&lower[..length], &upper[1..]);
        let fractions = &mut self.fractions[..length];
        let radius = self.radius;
        for k in 0..length {
            let sum = both_high[k] - low_high[k] - high_low[k] + both_low[k];
            fractions[k] = (sum * radius * radius).clamp(0.0, 1.0);
        }
    }

    #[inline(always)]
    fn line<const FAST: usize>(&mut self, line: usize) {
        let other = |of: &[f64]| of[line];
        let across = &self.across;
        let (size, sign) = (other(&across.size), other(&across.sign));
        let its = other(&across.segment);
        let Corners { line: at, parts } = &mut self.corners[line % 2];
        *at = Some(line);
        let length = self.along.size.len();
        let (sizes, signs) = (&self.along.size[..length], &self.along.sign[..length]);
        let segments = &self.along.segment[..length];
        let parts = &mut parts[..length];
        for k in 0..length {
            // The bits depend on the order of the arguments.
            parts[k] = if FAST == 0 {
                signs[k] * sign * quadrant_of([sizes[k], size], [segments[k], its])
            } else {
                sign * signs[k] * quadrant_of([size, sizes[k]], [its, segments[k]])
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darcy::overlap::disc_rectangle;

    #[test]
    fn the_bits_of_one_cell_after_the_other() {
        let mut table = DiscTable::default();
        let mut surface = 0;
        for (centre, radius, lower, cells) in [
            ([4.3, 5.1, 0.0], 2.9, [0, 1, 0], [9, 10, 1]),
            ([-3.2, 0.4, 0.0], 0.3, [-5, -1, 0], [4, 5, 1]),
            ([8.0, 8.0, 0.0], 4.0, [3, 4, 0], [12, 11, 1]),
            ([0.25, -6.75, 0.0], 7.3, [-8, -15, 0], [18, 19, 1]),
            ([9.1, 9.7, 0.0], 8.9, [0, 0, 0], [6, 7, 1]),
        ] {
            for fast in [0, 1] {
                let across = 1 - fast;
                table.fill((centre, radius), (lower, cells), fast);
                for j in 0..cells[across] {
                    let count = cells[fast].cast_unsigned() as usize;
                    let row = table.row(j.cast_unsigned() as usize, 0, count).to_vec();
                    for (k, found) in (0..).zip(row) {
                        let mut low = [0.0; 3];
                        low[fast] = f64::from(lower[fast] + k);
                        low[across] = f64::from(lower[across] + j);
                        let exact = disc_rectangle(centre, radius, low, low.map(|x| x + 1.0));
                        let exact = exact.clamp(0.0, 1.0);
                        assert_eq!(found.to_bits(), exact.to_bits(), "{low:?} {radius}");
                        surface += u32::from(exact > 0.0 && exact < 1.0);
                    }
                }
            }
        }
        assert!(surface > 200, "{surface}");
    }
}
