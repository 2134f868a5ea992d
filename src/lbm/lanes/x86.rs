//! Lanes of f64 in the vector registers of x86-64 processors.
//!
//! They are separate from the scalar f64, because they exist on this architecture only.

use super::{Add, Div, Lanes, Memory, Mul, Sub};
use std::arch::x86_64::*;

/// Four lanes in an AVX2 register.
#[derive(Clone, Copy)]
pub struct Avx2(__m256d);
/// Eight lanes in an AVX-512 register.
#[derive(Clone, Copy)]
pub struct Avx512(__m512d);

/// Indices of the lanes.
static COUNT: [f64; super::WIDEST] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Returns the bit mask of the signs of four numbers.
#[inline(always)]
fn bits(x: __m128) -> u8 {
    // SAFETY: every x86-64 processor has this instruction.
    let signs = unsafe { _mm_movemask_ps(x) };
    signs.to_le_bytes()[0]
}

macro_rules! operators {
    ($lanes:ident, $width:literal, $add:ident, $sub:ident, $mul:ident, $div:ident, $fma:ident, $fnma:ident,
        $set:ident, $sqrt:ident, $load:ident, |$test:ident, $zero:ident, $other:ident| $choose:expr, |$from:ident,
            $bound:ident| $above:expr, |$numbers:ident, $number:ident| $equal:expr) => {
        impl Add for $lanes {
            type Output = Self;
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                // SAFETY: a value of this type exists only inside a kernel that is entered after the instruction
                // set was detected (`Level::best`); the same is true for each operation below.
                Self(unsafe { $add(self.0, b.0) })
            }
        }
        impl Sub for $lanes {
            type Output = Self;
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $sub(self.0, b.0) })
            }
        }
        impl Mul for $lanes {
            type Output = Self;
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $mul(self.0, b.0) })
            }
        }
        impl Div for $lanes {
            type Output = Self;
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $div(self.0, b.0) })
            }
        }
        impl Lanes for $lanes {
            const WIDTH: usize = $width;
            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $set(x) })
            }
            #[inline(always)]
            fn count() -> Self {
                // SAFETY: as for `add`; as many numbers as lanes.
                Self(unsafe { $load(COUNT.as_ptr()) })
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $fma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, a: Self, b: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $fnma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn where_zero(self, a: Self, b: Self) -> Self {
                let ($test, $zero, $other) = (self.0, a.0, b.0);
                // SAFETY: as for `add`.
                Self(unsafe { $choose })
            }
            #[inline(always)]
            unsafe fn above($from: *const f32, $bound: f32) -> u8 {
                // SAFETY: the caller promises WIDTH readable elements; instruction set as for `add`.
                unsafe { $above }
            }
            #[inline(always)]
            unsafe fn equal($numbers: *const u32, $number: u32) -> u8 {
                // SAFETY: as for `above`.
                unsafe { $equal }
            }
        }
    };
}
operators!(
    Avx2,
    4,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_fmadd_pd,
    _mm256_fnmadd_pd,
    _mm256_set1_pd,
    _mm256_sqrt_pd,
    _mm256_loadu_pd,
    |t, a, b| _mm256_blendv_pd(b, a, _mm256_cmp_pd::<_CMP_EQ_OQ>(t, _mm256_setzero_pd())),
    |p, x| bits(_mm_cmpgt_ps(_mm_loadu_ps(p), _mm_set1_ps(x))),
    |p, n| bits(_mm_castsi128_ps(_mm_cmpeq_epi32(
        _mm_loadu_si128(p.cast()),
        _mm_set1_epi32(n.cast_signed())
    )))
);
operators!(
    Avx512,
    8,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_fmadd_pd,
    _mm512_fnmadd_pd,
    _mm512_set1_pd,
    _mm512_sqrt_pd,
    _mm512_loadu_pd,
    |t, a, b| _mm512_mask_blend_pd(
        _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(t, _mm512_setzero_pd()),
        b,
        a
    ),
    |p, x| _mm256_cmp_ps_mask::<_CMP_GT_OQ>(_mm256_loadu_ps(p), _mm256_set1_ps(x)),
    |p, n| _mm256_cmpeq_epi32_mask(
        _mm256_loadu_si256(p.cast()),
        _mm256_set1_epi32(n.cast_signed())
    )
);

macro_rules! memory {
    ($stored:ty, $lanes:ident, |$from:ident| $load:expr, |$to:ident, $value:ident| $store:expr) => {
        impl Memory<$lanes> for $stored {
            #[inline(always)]
            unsafe fn load($from: *const Self) -> $lanes {
                // SAFETY: the caller promises WIDTH readable elements; instruction set as for `add`.
                $lanes(unsafe { $load })
            }
            #[inline(always)]
            unsafe fn store($to: *mut Self, $value: $lanes) {
                // SAFETY: the caller promises WIDTH writable elements; instruction set as for `add`.
                unsafe { $store }
            }
        }
    };
}
memory!(f64, Avx2, |p| _mm256_loadu_pd(p), |p, v| _mm256_storeu_pd(
    p, v.0
));
memory!(
    f64,
    Avx512,
    |p| _mm512_loadu_pd(p),
    |p, v| _mm512_storeu_pd(p, v.0)
);
memory!(f32, Avx2, |p| _mm256_cvtps_pd(_mm_loadu_ps(p)), |p, v| {
    _mm_storeu_ps(p, _mm256_cvtpd_ps(v.0))
});
memory!(
    f32,
    Avx512,
    |p| _mm512_cvtps_pd(_mm256_loadu_ps(p)),
    |p, v| _mm256_storeu_ps(p, _mm512_cvtpd_ps(v.0))
);
