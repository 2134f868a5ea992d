//! Lanes of f64 in the vector registers of x86-64 processors.
//!
//! They are separate from the scalar f64, because they exist on this architecture only.

use super::{Add, Div, Lanes, Memory, Mul, Sub};
use crate::vectors::{memory, vector_lanes};
#[allow(
    clippy::wildcard_imports,
    reason = "intrinsics have names of their own"
)]
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

vector_lanes!(
    Avx2,
    f64,
    4,
    [Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd],
    [_mm256_fmadd_pd, _mm256_fnmadd_pd, _mm256_sqrt_pd],
    [_mm256_loadu_pd, _mm256_storeu_pd],
    |x| _mm256_set1_pd(x),
    |t, a, b| _mm256_blendv_pd(b, a, _mm256_cmp_pd::<_CMP_EQ_OQ>(t, _mm256_setzero_pd())),
    |p, x| bits(_mm_cmpgt_ps(_mm_loadu_ps(p), _mm_set1_ps(x))),
    |p, n| bits(_mm_castsi128_ps(_mm_cmpeq_epi32(
        _mm_loadu_si128(p.cast()),
        _mm_set1_epi32(n.cast_signed())
    )))
);
vector_lanes!(
    Avx512,
    f64,
    8,
    [Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd],
    [_mm512_fmadd_pd, _mm512_fnmadd_pd, _mm512_sqrt_pd],
    [_mm512_loadu_pd, _mm512_storeu_pd],
    |x| _mm512_set1_pd(x),
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

memory!(f32, Avx2, |p| _mm256_cvtps_pd(_mm_loadu_ps(p)), |p, v| {
    _mm_storeu_ps(p, _mm256_cvtpd_ps(v.0))
});
memory!(
    f32,
    Avx512,
    |p| _mm512_cvtps_pd(_mm256_loadu_ps(p)),
    |p, v| _mm256_storeu_ps(p, _mm512_cvtpd_ps(v.0))
);
