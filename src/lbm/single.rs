//! Number types of the cell loop in f32: a single number, or several in a vector register, twice as many as in f64.
//!
//! They are separate from [`super::lanes`], because that file is also compiled for GPUs, which have no pass in f32. The
//! collision operators are the same functions ([`Lanes`]). Every constant is rounded once to f32, and every operation
//! is correctly rounded, so that all widths give the same bits. Populations are stored as deviations from equilibrium
//! at rest, f_i - w_i, so that all digits of single precision represent the motion (M. Lehmann, M. J. Krause, G. Amati,
//! M. Sega, J. Harting, S. Gekle, Phys. Rev. E 106 (2022) 015308).

use super::lanes::{Lanes, Memory};
use base::number::single;

#[cfg(target_arch = "x86_64")]
mod x86;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2Single, Avx512Single};

impl Lanes for f32 {
    const WIDTH: usize = 1;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        single(x)
    }
    #[inline(always)]
    fn count() -> Self {
        0.0
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self::mul_add(self, a, b)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        Self::mul_add(-self, a, b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }
    #[inline(always)]
    fn where_zero(self, a: Self, b: Self) -> Self {
        if self == 0.0 { a } else { b }
    }
    #[inline(always)]
    unsafe fn above(from: *const f32, bound: f32) -> u8 {
        // SAFETY: promised by the caller.
        u8::from(unsafe { from.read() } > bound)
    }
    #[inline(always)]
    unsafe fn equal(from: *const u32, number: u32) -> u8 {
        // SAFETY: promised by the caller.
        u8::from(unsafe { from.read() } == number)
    }
}

impl Memory<f32> for f32 {
    #[inline(always)]
    unsafe fn load(from: *const Self) -> f32 {
        // SAFETY: the caller promises one readable element.
        unsafe { from.read() }
    }
    #[inline(always)]
    unsafe fn store(to: *mut Self, value: f32) {
        // SAFETY: the caller promises one writable element.
        unsafe { to.write(value) }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::super::lanes::Level;
    use super::*;

    /// Returns the bits of the results of every operation, in vectors of `N` lanes.
    #[inline(always)]
    fn computed<N: Lanes>(numbers: &[f32; 48]) -> Vec<u32>
    where
        f32: Memory<N>,
    {
        let mut results = Vec::new();
        let mut push = |value: N| {
            let mut lanes = [0.0_f32; 16];
            // SAFETY: no vector has more than 16 lanes.
            unsafe { <f32 as Memory<N>>::store(lanes.as_mut_ptr(), value) };
            results.extend(lanes[..N::WIDTH].iter().map(|x| x.to_bits()));
        };
        for n in 0..8 {
            for k in (0..16).step_by(N::WIDTH) {
                let at = |row: usize| {
                    // SAFETY: three rows of 16 numbers.
                    unsafe { <f32 as Memory<N>>::load(numbers.as_ptr().add(16 * row + k)) }
                };
                let (a, b, c) = (at(0), at(1), at(2));
                push(match n {
                    0 => a + b,
                    1 => a - b,
                    2 => a * b,
                    3 => a / b,
                    4 => a.mul_add(b, c),
                    5 => a.neg_mul_add(b, c),
                    6 => (a * a).sqrt() + N::splat(1.0 / 3.0),
                    _ => (a - a * N::splat(1.0)).where_zero(b, c),
                });
            }
        }
        results
    }

    #[target_feature(enable = "avx2,fma")]
    fn in_avx2(numbers: &[f32; 48]) -> Vec<u32> {
        computed::<Avx2Single>(numbers)
    }

    #[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma")]
    fn in_avx512(numbers: &[f32; 48]) -> Vec<u32> {
        computed::<Avx512Single>(numbers)
    }

    #[test]
    fn all_widths_round_alike() {
        let numbers: [f32; 48] = std::array::from_fn(|n| {
            let bits = (n as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
            single(bits as f64 / f64::from(1 << 24) - 0.5)
        });
        let one = computed::<f32>(&numbers);
        assert_eq!(one.len(), 128);
        if matches!(Level::best(), Level::Avx2 | Level::Avx512) {
            // SAFETY: the processor has this instruction set.
            assert_eq!(one, unsafe { in_avx2(&numbers) });
        }
        if Level::best() == Level::Avx512 {
            // SAFETY: the processor has this instruction set.
            assert_eq!(one, unsafe { in_avx512(&numbers) });
        }
    }

    #[test]
    fn bits_report_lanes_above_and_equal() {
        let numbers: [f32; 16] = std::array::from_fn(|n| if n == 11 { 1.0 } else { 0.0 });
        let integers: [u32; 16] = std::array::from_fn(|n| u32::from(n == 6));
        // SAFETY: sixteen numbers each.
        unsafe {
            assert_eq!(<f32 as Lanes>::above(&raw const numbers[11], 0.5), 1);
            assert_eq!(<f32 as Lanes>::equal(&raw const integers[5], 1), 0);
        }
        if matches!(Level::best(), Level::Avx2 | Level::Avx512) {
            // SAFETY: sixteen numbers each, and the processor has this instruction set.
            unsafe {
                assert_eq!(Avx2Single::above(numbers.as_ptr().add(8), 0.5), 1 << 3);
                assert_eq!(Avx2Single::equal(integers.as_ptr(), 1), 1 << 6);
            }
        }
        if Level::best() == Level::Avx512 {
            // SAFETY: as above.
            unsafe {
                assert_eq!(Avx512Single::above(numbers.as_ptr(), 0.5), 1 << 3);
                assert_eq!(Avx512Single::equal(integers.as_ptr(), 1), 1 << 6);
            }
        }
    }
}
