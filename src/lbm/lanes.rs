//! Numbers in the cell loop: one `f64`, or several in a vector register.
//!
//! On a GPU each thread has one `f64`.
//!
//! A collision is written once over [`Lanes`] and reads as in its paper. Every operation acts on each lane
//! independently and is correctly rounded, and fused multiply-add is explicit, so that all widths give the same bits.
//! The width is chosen once at the start from the capabilities of the processor ([`Level`]).

#[cfg(not(target_arch = "nvptx64"))]
use bytemuck::Pod;
// On a GPU no number is looked at as bytes.
use base::number;
#[cfg(target_arch = "nvptx64")]
use core::marker::Copy as Pod;
use core::ops::{Add, Div, Mul, Sub};

/// Most lanes that a level has.
pub const WIDEST: usize = if cfg!(target_arch = "nvptx64") { 1 } else { 8 };

/// Several `f64` that go through the same arithmetic.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Number of lanes.
    const WIDTH: usize;
    /// Returns a value with one number in every lane.
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

/// The number type of the populations in memory: `f64`, or `f32` where accuracy is traded for bandwidth. Arithmetic is
/// always `f64`.
pub trait Stored: Copy + Send + Sync + Default + Pod + EveryWidth {
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
        number::mul_add(self, a, b)
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        number::mul_add(-self, a, b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        number::sqrt(self)
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
mod x86;
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(not(target_arch = "nvptx64"))]
mod level;
#[cfg(not(target_arch = "nvptx64"))]
pub use level::Level;
#[cfg(not(target_arch = "nvptx64"))]
pub use level::Work;

/// Asks for a cache line; any address will do.
#[inline(always)]
pub(crate) fn prefetch<S>(line: *const S) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}
