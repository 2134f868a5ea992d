//! Copies of populations within a slab: bounce-back at walls, and periodic axes.
//!
//! They are separate from the pass over the cells, because they follow it. Both cases are the same operation: an
//! outgoing population is copied to the position of an incoming one; at a wall 6 w c·u is subtracted
//! ([`crate::boundary::wall`]). Copies of one kind have equal distances in memory, so that they are stored as
//! rectangles.

use crate::lanes::Stored;

/// Rectangle of copies. The layout is the same on the host and on the GPU.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Copies {
    /// Position of the first number.
    pub from: u32,
    /// Position of the copy of the first number.
    pub to: u32,
    /// Number of copies along each of the two sides of the rectangle.
    pub counts: [u32; 2],
    /// Distance in positions between neighbours along each side; it is the same for the numbers and for their copies.
    pub strides: [u32; 2],
    /// Index of the factor of the term.
    pub factor: u32,
    /// Padding that aligns `term` to eight bytes, so that the struct has no undefined bytes.
    pub unused: u32,
    /// Value that is subtracted, times the factor.
    pub term: f64,
}

impl Copies {
    /// Returns the number of copies.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.counts[0] * self.counts[1]
    }

    /// Returns the copies as rectangles of at most `most` copies; each rectangle is the work of a block.
    #[cfg(not(target_arch = "nvptx64"))]
    pub fn pieces(self, most: u32) -> impl Iterator<Item = Self> {
        let [along, beyond] = self.counts;
        let width = most.clamp(1, along.max(1));
        let height = (most / width).max(1);
        let starts = |count: u32, side: u32| (0..count.div_ceil(side)).map(move |n| n * side);
        starts(beyond, height).flat_map(move |row| {
            starts(along, width).map(move |place| {
                let apart = place * self.strides[0] + row * self.strides[1];
                Self {
                    from: self.from + apart,
                    to: self.to + apart,
                    counts: [width.min(along - place), height.min(beyond - row)],
                    ..self
                }
            })
        })
    }

    /// Makes copy `n` of the rectangle, with the given factor of the term.
    ///
    /// # Safety
    /// `numbers` must be the populations of the slab for which the rectangle was made, `n` must be below
    /// [`Self::count`], and no other thread may access this number or its copy.
    #[inline(always)]
    pub unsafe fn copy<S: Stored>(&self, n: u32, factor: f64, numbers: *mut S) {
        // A divisor of at least 1 keeps the compiler from adding a panic for division by zero, which GPUs cannot link.
        let along = self.counts[0].max(1);
        let beyond = n % along * self.strides[0] + n / along * self.strides[1];
        // SAFETY: promised by the caller.
        unsafe {
            let value = numbers.add((self.from + beyond) as usize).read().to_f64();
            let entering = S::from_f64(value - self.term * factor);
            numbers.add((self.to + beyond) as usize).write(entering);
        }
    }
}
