//! Sums that do not depend on the order: values as integers of 2^-56 lattice units.

#[cfg(not(target_arch = "nvptx64"))]
mod sums;
#[cfg(not(target_arch = "nvptx64"))]
pub use sums::sum_of_quanta;

/// Quanta in one lattice unit: link values are summed as integers of 2^-56, so that neither the order of links nor the
/// number of ranks can change a sum. Single values stay below 128; larger ones saturate (the flow guard has fired long
/// before).
pub const QUANTA: f64 = (1_u64 << 56) as f64;

/// A link value in quanta, rounded toward zero, of a size that its negative has too. What is no number counts as the
/// largest.
#[inline(always)]
#[must_use]
pub fn quanta(g: f64) -> i64 {
    /// The largest number below 2^63.
    const MOST: f64 = (i64::MAX - 1023) as f64;
    let scaled = g * QUANTA;
    let below = if scaled < MOST { scaled } else { MOST };
    let bounded = if below > -MOST { below } else { -MOST };
    // SAFETY: a number between -2^63 and 2^63.
    unsafe { bounded.to_int_unchecked::<i64>() }
}

/// A sum of quanta in lattice units.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "rounded once, to nearest")]
pub fn from_quanta(sum: i128) -> f64 {
    /// Apart, or the compiler would call what converts 128 bits for every sum.
    #[cold]
    #[inline(never)]
    fn wide(sum: i128) -> f64 {
        sum as f64
    }
    // Most sums fit 64 bits, which one instruction converts.
    i64::try_from(sum).map_or_else(|_| wide(sum), |sum| sum as f64) / QUANTA
}
