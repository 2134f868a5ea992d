//! Copies of numbers from place to place within a slab: what enters at walls, and what goes round periodic axes.
//!
//! Both are the same work: a number that left the fluid somewhere enters it elsewhere, less 6 w c·u at a wall
//! ([`crate::boundary::wall`]). Copies of one kind stand at equal distances in memory, and are kept as rectangles of
//! them.

use crate::lanes::Stored;

/// A rectangle of copies. The same bytes on the host and on the GPU.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Copies {
    /// Positions of the first number and of its copy.
    pub from: u32,
    /// See `from`.
    pub to: u32,
    /// Numbers along the two sides of the rectangle.
    pub counts: [u32; 2],
    /// Distances of neighbours along them, the same at both ends of the copies.
    pub strides: [u32; 2],
    /// Which of the factors is that of the term.
    pub factor: u32,
    /// Keeps the term where its size puts it.
    pub unused: u32,
    /// Number that is subtracted, at a factor of one.
    pub term: f64,
}

impl Copies {
    /// Returns the number of copies.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.counts[0] * self.counts[1]
    }

    /// Returns these copies in rectangles of `most` at most: each is the work of a block.
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

    /// Copies number `n` of them.
    ///
    /// # Safety
    /// `numbers` must be those of the slab that the copies are of, `n` below their count, and no other thread may work
    /// on this number and its copy.
    #[inline(always)]
    pub unsafe fn copy<S: Stored>(&self, n: u32, factor: f64, numbers: *mut S) {
        // Never zero: without this the division could panic, for which a GPU has no function.
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
