//! Lanes of f32 in the vector registers of x86-64 processors.
//!
//! They are separate from the scalar f32, because they exist on this architecture only.

use crate::lanes::{Lanes, Memory};
use base::number::single;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Eight lanes in an AVX2 register.
#[derive(Clone, Copy)]
pub(crate) struct Avx2Single(__m256);
/// Sixteen lanes in an AVX-512 register. A bit of the masks of [`Lanes`] represents two lanes, n and n + 8.
#[derive(Clone, Copy)]
pub(crate) struct Avx512Single(__m512);

/// Indices of the lanes.
static COUNT: [f32; 16] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];

/// Returns the mask of sixteen lanes with a bit for the lanes n and n + 8 together.
#[inline(always)]
fn by_two(mask: u16) -> u8 {
    let [low, high] = mask.to_le_bytes();
    low | high
}

macro_rules! operators {
    ($lanes:ident, $width:literal, [$($operator:ident $function:ident $operation:ident),*], [$fma:ident, $fnma:ident,
        $sqrt:ident], [$set:ident, $load:ident, $store:ident], |$test:ident, $zero:ident, $other:ident| $choose:expr,
        |$from:ident, $bound:ident| $above:expr, |$numbers:ident, $number:ident| $equal:expr) => {
        $(
            impl $operator for $lanes {
                type Output = Self;
                #[inline(always)]
                fn $function(self, b: Self) -> Self {
                    // SAFETY: a value of this type exists only inside a kernel that is entered after the instruction
                    // set was detected (`Level::best`); the same is true for each operation below.
                    Self(unsafe { $operation(self.0, b.0) })
                }
            }
        )*
        impl Lanes for $lanes {
            const WIDTH: usize = $width;
            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $set(single(x)) })
            }
            #[inline(always)]
            fn count() -> Self {
                // SAFETY: as for the operators; at least as many numbers as lanes.
                Self(unsafe { $load(COUNT.as_ptr()) })
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $fma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, a: Self, b: Self) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $fnma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn where_zero(self, a: Self, b: Self) -> Self {
                let ($test, $zero, $other) = (self.0, a.0, b.0);
                // SAFETY: as for the operators.
                Self(unsafe { $choose })
            }
            #[inline(always)]
            unsafe fn above($from: *const f32, $bound: f32) -> u8 {
                // SAFETY: the caller promises WIDTH readable elements; instruction set as for the operators.
                unsafe { $above }
            }
            #[inline(always)]
            unsafe fn equal($numbers: *const u32, $number: u32) -> u8 {
                // SAFETY: as for `above`.
                unsafe { $equal }
            }
        }
        impl Memory<$lanes> for f32 {
            #[inline(always)]
            unsafe fn load(from: *const Self) -> $lanes {
                // SAFETY: the caller promises WIDTH readable elements; instruction set as for the operators.
                $lanes(unsafe { $load(from) })
            }
            #[inline(always)]
            unsafe fn store(to: *mut Self, value: $lanes) {
                // SAFETY: the caller promises WIDTH writable elements; instruction set as for the operators.
                unsafe { $store(to, value.0) };
            }
        }
    };
}
operators!(
    Avx2Single,
    8,
    [Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps],
    [_mm256_fmadd_ps, _mm256_fnmadd_ps, _mm256_sqrt_ps],
    [_mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps],
    |t, a, b| _mm256_blendv_ps(b, a, _mm256_cmp_ps::<_CMP_EQ_OQ>(t, _mm256_setzero_ps())),
    |p, x| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_loadu_ps(p), _mm256_set1_ps(x)))
        .to_le_bytes()[0],
    |p, n| _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(
        _mm256_loadu_si256(p.cast()),
        _mm256_set1_epi32(n.cast_signed())
    )))
    .to_le_bytes()[0]
);
operators!(
    Avx512Single,
    16,
    [Add add _mm512_add_ps, Sub sub _mm512_sub_ps, Mul mul _mm512_mul_ps, Div div _mm512_div_ps],
    [_mm512_fmadd_ps, _mm512_fnmadd_ps, _mm512_sqrt_ps],
    [_mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps],
    |t, a, b| _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(t, _mm512_setzero_ps()), b, a),
    |p, x| by_two(_mm512_cmp_ps_mask::<_CMP_GT_OQ>(
        _mm512_loadu_ps(p),
        _mm512_set1_ps(x)
    )),
    |p, n| by_two(_mm512_cmpeq_epi32_mask(
        _mm512_loadu_si512(p.cast()),
        _mm512_set1_epi32(n.cast_signed())
    ))
);
