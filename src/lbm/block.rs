//! Blocks of cells of a slab that are processed together.

use std::ops::Range;

/// Block of rows in several planes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowBlock {
    /// Planes normal to the slab axis.
    pub planes: Range<usize>,
    /// Rows in each of these planes.
    pub rows: Range<usize>,
}

/// Items at equal distances in memory along a row of a plane, or one item in each of consecutive rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Number of items.
    pub(crate) count: u32,
    /// Distance between consecutive items in memory.
    pub(crate) stride: u32,
    /// Row of the first item.
    row: u32,
    /// `true` if there is one item in each row; `false` if all items are in one row.
    down: bool,
}

impl Line {
    /// Returns a line with a single item in a row.
    pub(crate) fn single(row: u32) -> Self {
        Self {
            count: 1,
            stride: 0,
            row,
            down: false,
        }
    }

    /// Returns the line extended by an item in this row at the distance `apart` from the first, if it continues the
    /// line.
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

    /// Returns the row of item number `k`.
    pub(crate) fn row(&self, k: u32) -> u32 {
        self.row + k * u32::from(self.down)
    }

    /// Returns the range of items in a range of rows.
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
