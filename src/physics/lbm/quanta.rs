//! Sums that do not depend on the order: values as integers of 2^-56 lattice units.

use super::lanes::{Level, Work};

/// Quanta in one lattice unit: link values are summed as integers of 2^-56, so that neither the order of links nor the
/// number of ranks can change a sum. Single values stay below 128; larger ones saturate (the flow guard has fired long before).
pub const QUANTA: f64 = (1_u64 << 56) as f64;

/// A link value in quanta, rounded toward zero, of a size that its negative has too. What is no number counts as the largest.
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
    sum as f64 / QUANTA
}

/// The sum of some link values in quanta.
#[must_use]
pub fn sum_of_quanta(level: Level, values: &[f64]) -> i128 {
    let mut sum = 0;
    level.run(SumOfQuanta(values, &mut sum));
    sum
}

/// See [`sum_of_quanta`].
struct SumOfQuanta<'a>(&'a [f64], &'a mut i128);

impl Work for SumOfQuanta<'_> {
    #[inline(always)]
    fn run(self) {
        let Self(values, sum) = self;
        // Upper and lower halves apart: sums of up to 2^31 of them are an i64, as vectors add them.
        for values in values.chunks(1 << 30) {
            let (mut upper, mut lower) = (0_i64, 0_i64);
            for &value in values {
                let quanta = quanta(value);
                upper += quanta >> 32;
                lower += quanta & 0xffff_ffff;
            }
            *sum += (i128::from(upper) << 32) + i128::from(lower);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_is_that_of_its_values() {
        let all: Vec<f64> = (0..1003_u32)
            .map(|n| f64::from(n.wrapping_mul(2_654_435_761)) * 3e-8 - 64.0)
            .chain([
                1e300,
                -1e300,
                f64::NAN,
                f64::INFINITY,
                -127.9,
                1e-17,
                -1e-17,
            ])
            .collect();
        for count in [0, 1, 7, 8, 9, 1000, all.len()] {
            let one_by_one: i128 = all[..count].iter().map(|&g| i128::from(quanta(g))).sum();
            assert_eq!(sum_of_quanta(Level::best(), &all[..count]), one_by_one);
            assert_eq!(sum_of_quanta(Level::Scalar, &all[..count]), one_by_one);
        }
    }
}
