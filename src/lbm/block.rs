//! Cells of a slab that are worked on together.

use std::ops::Range;

/// Rows of planes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowBlock {
    /// Planes across the slab axis.
    pub planes: Range<usize>,
    /// Rows of each.
    pub rows: Range<usize>,
}

/// Items at equal distances in memory along a row of a plane, or one in each of consecutive rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Number of items.
    pub(crate) count: u32,
    /// Distance from one to the next.
    pub(crate) stride: u32,
    /// The row of the first.
    row: u32,
    /// `true` if there is one in each row; otherwise all are in one.
    down: bool,
}

impl Line {
    /// Returns one in a row.
    pub(crate) fn single(row: u32) -> Self {
        Self {
            count: 1,
            stride: 0,
            row,
            down: false,
        }
    }

    /// Returns the line with one more, `apart` from the first and in this row, where that continues it.
    pub(crate) fn with(self, row: u32, apart: u32) -> Option<Self> {
        let (stride, down) = if self.count == 1 {
            (apart, row > self.row)
        } else {
            (self.stride, self.down)
        };
        (stride > 0
            && row == self.row + u32::from(down) * self.count
            && Some(apart) == stride.checked_mul(self.count))
        .then_some(Self {
            count: self.count + 1,
            stride,
            down,
            ..self
        })
    }

    /// Returns the row of number `k`.
    pub(crate) fn row(&self, k: u32) -> u32 {
        self.row + k * u32::from(self.down)
    }

    /// Returns the range of items in some rows.
    pub(crate) fn within(&self, rows: &Range<usize>) -> Range<usize> {
        let (first, count) = (self.row as usize, self.count as usize);
        if self.down {
            let end = rows.end.saturating_sub(first).min(count);
            rows.start.saturating_sub(first).min(end)..end
        } else if rows.contains(&first) {
            0..count
        } else {
            0..0
        }
    }
}
