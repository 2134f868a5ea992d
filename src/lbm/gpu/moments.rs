//! Moments and extreme values of cells on a GPU, for the guards of a run.
//!
//! They are separate from the functions of the processor ([`crate::populations::Populations::row_moments`],
//! [`crate::extremes`]), which work on rows; the operations and their order are the same, so that the bits are the
//! same.

use super::cell::{CellIndex, Slab};
use crate::lanes::{Memory, Stored};
use crate::lattice::{Lattice, unroll};
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Extreme values of a row. The layout is the same on the host and on the GPU.
#[derive(Debug, Default)]
#[repr(C)]
pub struct RowExtremes {
    /// Bits of the maximum squared speed, an `f64`.
    pub squared_speed: AtomicU64,
    /// Bits of the maximum absolute density deviation, an `f64`.
    pub compression: AtomicU64,
    /// Flag that is 1 if a number of the row is not finite.
    pub broken: AtomicU32,
    /// Padding to a multiple of eight bytes.
    pub unused: u32,
}

/// Half F/2 of the body force. The layout is the same on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct HalfForce(pub [f64; 3]);

/// Returns the density deviation and the momentum Σ c g of a cell.
///
/// # Safety
/// `numbers` must be the populations of the slab that `slab` describes, and the cell must be one of this slab.
#[inline(always)]
pub unsafe fn moments<L: Lattice<Q>, S: Stored, const Q: usize>(
    numbers: *const S,
    slab: &Slab,
    CellIndex { plane, row, column }: CellIndex,
) -> (f64, [f64; 3]) {
    let start = plane * slab.plane + row * slab.row + column;
    let (mut drho, mut m) = (0.0, [0.0; 3]);
    unroll!(populations i < Q => {
        // SAFETY: the number is one of this cell.
        let g = unsafe { <S as Memory<f64>>::load(numbers.add((slab.first[i] + start) as usize)) };
        drho += g;
        let c = L::C[i];
        unroll!(axes a < 3 => {
            match c[a] {
                1 => m[a] += g,
                -1 => m[a] -= g,
                _ => {}
            }
        });
    });
    (drho, m)
}

impl RowExtremes {
    /// Includes a cell of the row in the extreme values. A cell that is not `water` is only checked for finite values.
    /// Positive numbers are ordered like their bits, so that an atomic maximum of the bits gives the same result in any
    /// order.
    #[inline(always)]
    pub fn include(&self, drho: f64, momentum: [f64; 3], HalfForce(half): HalfForce, water: bool) {
        let m = [
            momentum[0] + half[0],
            momentum[1] + half[1],
            momentum[2] + half[2],
        ];
        let squared = (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) / ((1.0 + drho) * (1.0 + drho));
        let size = f64::from_bits(drho.to_bits() & (u64::MAX >> 1));
        // The product with 0 is 0 for finite numbers and NaN for all others.
        if 0.0 * squared != 0.0 {
            self.broken.store(1, Ordering::Relaxed);
            return;
        }
        if !water {
            return;
        }
        for (value, most) in [(squared, &self.squared_speed), (size, &self.compression)] {
            // Most cells are below the current maximum, and a load is faster than an atomic maximum.
            if value.to_bits() > most.load(Ordering::Relaxed) {
                most.fetch_max(value.to_bits(), Ordering::Relaxed);
            }
        }
    }
}
