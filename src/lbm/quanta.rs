//! Conversion of values to integers of 2^-56 lattice units (quanta), whose sums do not depend on the order.
//!
//! It is separate from the sums over links, cells and rows, which all use it, and is also compiled for GPUs.

#[cfg(not(target_arch = "nvptx64"))]
mod sums;
#[cfg(not(target_arch = "nvptx64"))]
pub use sums::sum_of_quanta;

/// Number of quanta in one lattice unit. Link values are summed as integers of 2^-56, so that neither the order of
/// links nor the number of ranks changes a sum. Values of 128 and above saturate; the guards stop a run long before.
pub const QUANTA: f64 = (1_u64 << 56) as f64;

/// Returns a link value in quanta, rounded toward zero. Values are clamped to a symmetric range, so that the negative
/// of a result is representable; NaN gives the upper end of the range.
#[inline(always)]
#[must_use]
pub fn quanta(g: f64) -> i64 {
    /// Largest `f64` below 2^63.
    const MAX: f64 = (i64::MAX - 1023) as f64;
    let scaled = g * QUANTA;
    let below = if scaled < MAX { scaled } else { MAX };
    let bounded = if below > -MAX { below } else { -MAX };
    // SAFETY: the number is between -2^63 and 2^63.
    unsafe { bounded.to_int_unchecked::<i64>() }
}

/// Returns a sum of quanta in lattice units.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "rounded once, to nearest")]
pub fn from_quanta(sum: i128) -> f64 {
    /// Converts any sum. It is a cold function, because the compiler would otherwise call the conversion of 128-bit
    /// integers for every sum.
    #[cold]
    #[inline(never)]
    fn wide(sum: i128) -> f64 {
        sum as f64
    }
    // Most sums fit in 64 bits, which one instruction converts.
    i64::try_from(sum).map_or_else(|_| wide(sum), |sum| sum as f64) / QUANTA
}
