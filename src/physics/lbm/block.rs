//! Cells of a slab that are worked on together.

use std::ops::Range;

/// Rows of planes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Planes across the slab axis.
    pub planes: Range<usize>,
    /// Rows of each.
    pub rows: Range<usize>,
}
