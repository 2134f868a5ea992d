//! Sums of many values in quanta, with the vector instructions of the processor.
//!
//! They are separate from the conversion of a single value, which is also compiled for GPUs.

use super::quanta;
use crate::lanes::{Level, Work};

/// Returns the sum of link values in quanta; the result is the same for every level.
#[must_use]
pub fn sum_of_quanta(level: Level, values: &[f64]) -> i128 {
    let mut sum = 0;
    level.run(SumOfQuanta(values, &mut sum));
    sum
}

/// Loops of [`sum_of_quanta`]: the values, and the sum to which they are added.
struct SumOfQuanta<'a>(&'a [f64], &'a mut i128);

impl Work for SumOfQuanta<'_> {
    #[inline(always)]
    fn run(self) {
        let Self(values, sum) = self;
        // Upper and lower halves are summed separately: sums of up to 2^31 of them fit into an i64, which vector
        // instructions add.
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
