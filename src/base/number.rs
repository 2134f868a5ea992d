//! Conversions between integers and floating-point numbers.
//!
//! Every cast whose result the compiler cannot prove is in this file, with the range in which it is exact and its
//! result outside that range.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "each function says in which range it is exact and what it gives beyond"
)]

/// Functions of one number that the standard library has and the core library, which GPUs have, does not yet.
#[cfg(target_arch = "nvptx64")]
pub use core::{
    f64::math::{ceil, floor, mul_add},
    intrinsics::sqrtf64 as sqrt,
};
#[cfg(not(target_arch = "nvptx64"))]
pub use here::{ceil, floor, mul_add, sqrt};
#[cfg(not(target_arch = "nvptx64"))]
mod here {
    /// Returns the smallest whole number that is not below `x`.
    #[inline(always)]
    pub fn ceil(x: f64) -> f64 {
        x.ceil()
    }
    /// Returns the largest whole number that is not above `x`.
    #[inline(always)]
    pub fn floor(x: f64) -> f64 {
        x.floor()
    }
    /// Returns `x a + b`, rounded once.
    #[inline(always)]
    pub fn mul_add(x: f64, a: f64, b: f64) -> f64 {
        x.mul_add(a, b)
    }
    /// Returns the square root.
    #[inline(always)]
    pub fn sqrt(x: f64) -> f64 {
        x.sqrt()
    }
}

/// Integers that become floating-point numbers.
pub trait Integer: Copy {
    /// See [`real`].
    fn real(self) -> f64;
}

macro_rules! integers {
    ($($integer:ty)+) => {$(
        impl Integer for $integer {
            #[inline]
            fn real(self) -> f64 {
                self as f64
            }
        }
    )+};
}

integers!(usize u64 i64 i128);

/// An integer as a floating-point number: exact up to 2^53 in size, the nearest number beyond.
#[inline]
pub fn real(n: impl Integer) -> f64 {
    n.real()
}

/// The integer part of a number that is not negative: 0 for negative numbers and NaN, 9e15 (exact as a number) at most.
#[inline]
pub fn whole(x: f64) -> usize {
    x.clamp(0.0, 9e15) as usize
}

/// The largest integer not above a number: 0 for NaN, ±2e9 beyond, so that the neighbouring integers fit the type too.
#[cfg(target_arch = "nvptx64")]
#[inline]
pub fn floor_i32(x: f64) -> i32 {
    floor(x.clamp(-2e9, 2e9)) as i32
}

/// The largest integer not above a number: 0 for NaN, ±2e9 beyond, so that the neighbouring integers fit the type too.
///
/// Without a call, and in vectors: processors without SSE 4.1 have no instruction that rounds, and a cast checks its
/// range. Near 1.5 * 2^52 numbers are integers, and their lowest bits are those of the integer.
#[cfg(not(target_arch = "nvptx64"))]
#[inline]
pub fn floor_i32(x: f64) -> i32 {
    const LARGE: f64 = 6_755_399_441_055_744.0;
    let x = if x.is_nan() { 0.0 } else { x.clamp(-2e9, 2e9) };
    let nearest = (x + LARGE) - LARGE;
    let below = if nearest > x { nearest - 1.0 } else { nearest };
    (below + LARGE).to_bits() as i32
}

/// The largest integer not above a number: 0 for NaN, the ends of the type beyond its range.
#[inline]
pub fn floor_i64(x: f64) -> i64 {
    floor(x) as i64
}

/// A number in single precision: the nearest one.
#[inline]
pub fn single(x: f64) -> f32 {
    x as f32
}

/// A count or an index in 32 bits; the largest one beyond.
#[inline]
pub fn to_u32(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// A count as a signed number of 32 bits; the largest one beyond.
#[inline]
pub fn to_i32(n: usize) -> i32 {
    i32::try_from(n).unwrap_or(i32::MAX)
}

/// A number or an id as a signed one; the largest one beyond.
#[inline]
pub fn to_i64(n: u64) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

/// A number as a length in memory; the largest one beyond.
#[inline]
pub fn to_usize(n: u64) -> usize {
    usize::try_from(n).unwrap_or(usize::MAX)
}

/// The largest whole number that divides both; the other one where one is 0.
#[must_use]
pub fn common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_what_they_are_in_range_and_at_the_ends_beyond() {
        assert_eq!(real(3_usize), 3.0);
        assert_eq!(real(-3_i64), -3.0);
        assert_eq!(real((1_u64 << 53) - 1), 9_007_199_254_740_991.0);
        assert_eq!([whole(2.9), whole(-1.0), whole(f64::NAN)], [2, 0, 0]);
        assert_eq!(whole(f64::INFINITY), 9_000_000_000_000_000);
        assert_eq!([floor_i32(-0.5), floor_i32(1e300)], [-1, 2_000_000_000]);
        assert_eq!(
            [floor_i32(f64::NAN), floor_i32(-1e300)],
            [0, -2_000_000_000]
        );
        for n in [-1_999_999_999, -7, -2, -1, 0, 1, 2, 3, 1_999_999_999] {
            let x = f64::from(n);
            for (x, floor) in [
                (x, n),
                (x.next_up(), n),
                (x.next_down(), n - 1),
                (x + 0.5, n),
            ] {
                assert_eq!(floor_i32(x), floor, "{x:e}");
            }
        }
        assert_eq!([floor_i32(-0.0), floor_i32(0.5_f64.next_up())], [0, 0]);
        assert_eq!([floor_i64(2.5), floor_i64(-1e300)], [2, i64::MIN]);
        assert_eq!([to_u32(7), to_u32(usize::MAX)], [7, u32::MAX]);
        assert_eq!([to_i32(7), to_i32(usize::MAX)], [7, i32::MAX]);
        assert_eq!([to_i64(7), to_i64(u64::MAX)], [7, i64::MAX]);
        assert_eq!(to_usize(7), 7);
        assert_eq!(single(0.5), 0.5_f32);
    }
}
