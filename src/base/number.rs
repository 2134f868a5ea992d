//! Conversions between integers and floating-point numbers.
//!
//! Most lossy casts are collected in this file, so that each has a documented range in which it is exact and a
//! documented result outside that range. The file is also compiled for GPUs.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "each function says in which range it is exact and what it gives beyond"
)]

/// Rounding, fused multiply-add and square root: methods of `f64` in the standard library, which GPUs do not have, and
/// unstable functions of the core library there.
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

/// Integer type that [`real`] converts to a floating-point number.
pub trait Integer: Copy {
    /// Returns the integer as a floating-point number, see [`real`].
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

/// Returns an integer as a floating-point number: exact up to an absolute value of 2^53, rounded to nearest above.
#[inline]
pub fn real(n: impl Integer) -> f64 {
    n.real()
}

/// Returns the integer part of a number, limited to 0 … 9e15 (which an `f64` represents exactly); 0 for NaN.
#[inline]
pub fn whole(x: f64) -> usize {
    x.clamp(0.0, 9e15) as usize
}

/// Returns the largest integer that is not above a number, limited to ±2e9, so that the next integers fit into the type
/// too; 0 for NaN.
#[cfg(target_arch = "nvptx64")]
#[inline]
pub fn floor_i32(x: f64) -> i32 {
    floor(x.clamp(-2e9, 2e9)) as i32
}

/// Returns the largest integer that is not above a number, limited to ±2e9, so that the next integers fit into the type
/// too; 0 for NaN.
///
/// The function has no call and is vectorised. `f64::floor` is a call on processors without SSE 4.1, and a cast to an
/// integer checks its range. Instead, 1.5 * 2^52 is added: floating-point numbers of this magnitude are integers, and
/// their lowest bits are those of the integer.
#[cfg(not(target_arch = "nvptx64"))]
#[inline]
pub fn floor_i32(x: f64) -> i32 {
    const LARGE: f64 = 6_755_399_441_055_744.0;
    let x = if x.is_nan() { 0.0 } else { x.clamp(-2e9, 2e9) };
    let nearest = (x + LARGE) - LARGE;
    let below = if nearest > x { nearest - 1.0 } else { nearest };
    (below + LARGE).to_bits() as i32
}

/// Returns the largest integer that is not above a number, limited to the range of the type; 0 for NaN.
#[inline]
pub fn floor_i64(x: f64) -> i64 {
    floor(x) as i64
}

/// Returns the nearest number in single precision.
#[inline]
pub fn single(x: f64) -> f32 {
    x as f32
}

/// Returns a count or an index as a `u32`; the maximum of the type if it is larger.
#[inline]
pub fn to_u32(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// Returns a count as an `i32`; the maximum of the type if it is larger.
#[inline]
pub fn to_i32(n: usize) -> i32 {
    i32::try_from(n).unwrap_or(i32::MAX)
}

/// Returns a number or an id as an `i64`; the maximum of the type if it is larger.
#[inline]
pub fn to_i64(n: u64) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

/// Returns a number as a `usize`; the maximum of the type if it is larger.
#[inline]
pub fn to_usize(n: u64) -> usize {
    usize::try_from(n).unwrap_or(usize::MAX)
}

/// Returns the greatest common divisor of two numbers; if one is 0, the other one.
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
