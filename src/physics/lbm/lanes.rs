//! Numbers in the cell loop: one `f64`, or several in a vector register.
//!
//! A collision is written once over [`Lanes`] and reads as in its paper. Every operation acts on each lane independently and is
//! correctly rounded, and fused multiply-add is explicit, so that all widths give the same bits. The width is chosen
//! once at the start from the capabilities of the processor ([`Level`]).

use std::ops::{Add, Div, Mul, Sub};

/// Most lanes that a level has.
pub(crate) const WIDEST: usize = 8;

/// Several `f64` that go through the same arithmetic.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many numbers one value holds.
    const WIDTH: usize;
    /// The same number in every lane.
    fn splat(x: f64) -> Self;
    /// 0, 1, 2, … from the first lane on.
    fn count() -> Self;
    /// `self * a + b`, rounded once.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `b - self * a`, rounded once.
    fn neg_mul_add(self, a: Self, b: Self) -> Self;
    /// Square root, rounded once.
    fn sqrt(self) -> Self;
    /// `a` where `self` is zero, else `b`.
    fn where_zero(self, a: Self, b: Self) -> Self;
    /// Which of as many numbers as lanes are above a bound: a bit each.
    ///
    /// # Safety
    /// `from` must be valid for reading that many elements.
    unsafe fn above(from: *const f32, bound: f32) -> u8;
    /// Which of as many numbers as lanes are a certain one: a bit each.
    ///
    /// # Safety
    /// As for [`Self::above`].
    unsafe fn equal(from: *const u32, number: u32) -> u8;
}

/// The number type of the populations in memory: `f64`, or `f32` where accuracy is traded for bandwidth. Arithmetic is always `f64`.
pub trait Stored: Copy + Send + Sync + Default + bytemuck::Pod + EveryWidth {
    /// Name as written in a case.
    const NAME: &'static str;
    /// From working precision, rounded to nearest.
    fn from_f64(x: f64) -> Self;
    /// To working precision, exact.
    fn to_f64(self) -> f64;
}

impl Stored for f64 {
    const NAME: &'static str = "f64";
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

impl Stored for f32 {
    const NAME: &'static str = "f32";
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to f32 is what the case asked for"
    )]
    fn from_f64(x: f64) -> Self {
        x as Self
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

/// Moves `N::WIDTH` neighbouring numbers between memory and lanes.
pub trait Memory<N: Lanes>: Sized {
    /// Loads `N::WIDTH` numbers.
    ///
    /// # Safety
    /// `from` must be valid for reading that many elements.
    unsafe fn load(from: *const Self) -> N;
    /// Stores `N::WIDTH` numbers.
    ///
    /// # Safety
    /// `to` must be valid for writing that many elements.
    unsafe fn store(to: *mut Self, value: N);
}

/// A number type that lanes of every width load and store.
#[cfg(target_arch = "x86_64")]
pub trait EveryWidth: Memory<f64> + Memory<Avx2> + Memory<Avx512> {}
#[cfg(target_arch = "x86_64")]
impl<S: Memory<f64> + Memory<Avx2> + Memory<Avx512>> EveryWidth for S {}
/// A number type that lanes of every width load and store.
#[cfg(not(target_arch = "x86_64"))]
pub trait EveryWidth: Memory<f64> {}
#[cfg(not(target_arch = "x86_64"))]
impl<S: Memory<f64>> EveryWidth for S {}

impl Lanes for f64 {
    const WIDTH: usize = 1;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn count() -> Self {
        0.0
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        f64::mul_add(self, a, b)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        f64::mul_add(-self, a, b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
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

impl<S: Stored> Memory<f64> for S {
    #[inline(always)]
    unsafe fn load(from: *const Self) -> f64 {
        // SAFETY: the caller promises one readable element.
        unsafe { from.read() }.to_f64()
    }
    #[inline(always)]
    unsafe fn store(to: *mut Self, value: f64) {
        // SAFETY: the caller promises one writable element.
        unsafe { to.write(S::from_f64(value)) }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Add, Div, Lanes, Memory, Mul, Sub};
    use std::arch::x86_64::*;

    /// Four lanes in an AVX2 register.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256d);
    /// Eight lanes in an AVX-512 register.
    #[derive(Clone, Copy)]
    pub struct Avx512(__m512d);

    /// The numbers of the lanes.
    static COUNT: [f64; super::WIDEST] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

    /// The signs of four numbers.
    #[inline(always)]
    fn bits(x: __m128) -> u8 {
        // SAFETY: part of every x86-64.
        let signs = unsafe { _mm_movemask_ps(x) };
        signs.to_le_bytes()[0]
    }

    macro_rules! operators {
        ($lanes:ident, $width:literal, $add:ident, $sub:ident, $mul:ident, $div:ident, $fma:ident, $fnma:ident, $set:ident, $sqrt:ident, $load:ident, |$test:ident, $zero:ident, $other:ident| $choose:expr, |$from:ident, $bound:ident| $above:expr, |$numbers:ident, $number:ident| $equal:expr) => {
            impl Add for $lanes {
                type Output = Self;
                #[inline(always)]
                fn add(self, b: Self) -> Self {
                    // SAFETY: a value of this type exists only inside a kernel entered after the processor was asked
                    // for the instruction set (`Level::best`); the same holds for each operation below.
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
}
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

/// Asks for a cache line; any address will do.
#[inline(always)]
pub(crate) fn prefetch<S>(line: *const S) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}

/// Instruction set that the cell loop uses. All levels give the same bits; they differ in speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// One number at a time, any processor.
    Scalar,
    /// Four lanes, AVX2 with FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Eight lanes, AVX-512 with F, DQ, BW and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// Whether the processor has AVX-512 with whole numbers of 64 bits and shorter vectors, as all that have it for servers and desktops.
#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
}

impl Level {
    /// The widest level this processor offers; `SOLVER_LANES=scalar|avx2` lowers it (for tests and comparisons).
    #[must_use]
    pub fn best() -> Self {
        let wish = std::env::var("SOLVER_LANES").unwrap_or_default();
        if wish == "scalar" {
            return Self::Scalar;
        }
        #[cfg(target_arch = "x86_64")]
        {
            if wish != "avx2" && has_avx512() {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Self::Avx2;
            }
        }
        Self::Scalar
    }

    /// Name for the provenance of a run.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "avx2+fma",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "avx512",
        }
    }
}

/// Loops without branches or calls that the compiler makes vectors of, in a version for each instruction set ([`Level::run`]).
pub(crate) trait Work {
    /// The loops. Mark it, and what it calls, `#[inline(always)]`: only then are they compiled for the instruction set.
    fn run(self);
}

impl Level {
    /// Runs the version of some work for this level.
    pub(crate) fn run(self, work: impl Work) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if has_avx512() => {
                // SAFETY: the processor has it, and AVX2 with it.
                unsafe { run_avx512(work) };
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 | Self::Avx2 if is_x86_feature_detected!("avx2") => {
                // SAFETY: the processor has it.
                unsafe { run_avx2(work) };
            }
            _ => work.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2")]
fn run_avx512(work: impl Work) {
    work.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: impl Work) {
    work.run();
}
