//! Lanes of f32 in the vector registers of x86-64 processors.
//!
//! They are separate from the scalar f32, because they exist on this architecture only.

use crate::lanes::{Lanes, Memory};
use crate::vectors::vector_lanes;
use base::number::single;
#[allow(
    clippy::wildcard_imports,
    reason = "intrinsics have names of their own"
)]
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

vector_lanes!(
    Avx2Single,
    f32,
    8,
    [Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps],
    [_mm256_fmadd_ps, _mm256_fnmadd_ps, _mm256_sqrt_ps],
    [_mm256_loadu_ps, _mm256_storeu_ps],
    |x| _mm256_set1_ps(single(x)),
    |t, a, b| _mm256_blendv_ps(b, a, _mm256_cmp_ps::<_CMP_EQ_OQ>(t, _mm256_setzero_ps())),
    |p, x| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(_mm256_loadu_ps(p), _mm256_set1_ps(x)))
        .to_le_bytes()[0],
    |p, n| _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(
        _mm256_loadu_si256(p.cast()),
        _mm256_set1_epi32(n.cast_signed())
    )))
    .to_le_bytes()[0]
);
vector_lanes!(
    Avx512Single,
    f32,
    16,
    [Add add _mm512_add_ps, Sub sub _mm512_sub_ps, Mul mul _mm512_mul_ps, Div div _mm512_div_ps],
    [_mm512_fmadd_ps, _mm512_fnmadd_ps, _mm512_sqrt_ps],
    [_mm512_loadu_ps, _mm512_storeu_ps],
    |x| _mm512_set1_ps(single(x)),
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
