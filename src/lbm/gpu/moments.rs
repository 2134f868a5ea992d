//! Moments of cells on a GPU, for the checks of a run: with the operations of a row on the processor
//! ([`crate::populations::Populations::row_moments`], [`crate::extremes`]), so that the bits are the same.

use super::cell::{Place, Slab};
use crate::lanes::{Memory, Stored};
use crate::lattice::{Lattice, unroll};
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// The extreme values of a row. The same bytes on the host and on the GPU.
#[derive(Debug, Default)]
#[repr(C)]
pub struct RowExtremes {
    /// Bits of the largest squared speed.
    pub squared_speed: AtomicU64,
    /// Bits of the largest size of the density deviation.
    pub compression: AtomicU64,
    /// Not zero where a number is not finite.
    pub broken: AtomicU32,
    /// Keeps the size a multiple of eight bytes.
    pub unused: u32,
}

/// F/2 of the body force. The same bytes on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct HalfForce(pub [f64; 3]);

/// Density deviation and momentum Σ c g of a cell.
///
/// # Safety
/// `numbers` must be those of a slab as described, and the cell one of its own.
#[inline(always)]
pub unsafe fn moments<L: Lattice<Q>, S: Stored, const Q: usize>(
    numbers: *const S,
    slab: &Slab,
    Place { plane, row, place }: Place,
) -> (f64, [f64; 3]) {
    let start = plane * slab.plane + row * slab.row + place;
    let (mut drho, mut m) = (0.0, [0.0; 3]);
    unroll!(populations i < Q => {
        // SAFETY: a number of this cell.
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
    /// Takes note of a cell of the row, of which nothing counts but whether it is finite where it is no water. Any
    /// order gives the same: sizes compare like their bits.
    #[inline(always)]
    pub fn note(&self, drho: f64, momentum: [f64; 3], HalfForce(half): HalfForce, water: bool) {
        let m = [
            momentum[0] + half[0],
            momentum[1] + half[1],
            momentum[2] + half[2],
        ];
        let squared = (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) / ((1.0 + drho) * (1.0 + drho));
        let size = f64::from_bits(drho.to_bits() & (u64::MAX >> 1));
        // A product with 0 is 0 for all numbers that are finite, and no number for the others.
        if 0.0 * squared != 0.0 {
            self.broken.store(1, Ordering::Relaxed);
            return;
        }
        if !water {
            return;
        }
        for (value, most) in [(squared, &self.squared_speed), (size, &self.compression)] {
            // Most cells are below what was seen.
            if value.to_bits() > most.load(Ordering::Relaxed) {
                most.fetch_max(value.to_bits(), Ordering::Relaxed);
            }
        }
    }
}
