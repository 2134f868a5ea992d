//! Number types of the cell loop: a single `f64`, or several in a vector register; and the storage types of the
//! populations.
//!
//! The types are separate from the collision operators, so that an operator is written once, over [`Lanes`], with the
//! equations of its paper, and is compiled for each vector width and for GPUs, where each thread has a single `f64`.
//! Every operation acts on each lane independently and is correctly rounded, and fused multiply-add is explicit, so
//! that all widths give the same bits. The width is selected once at the start from the instruction sets of the
//! processor ([`Level`]). Lanes of `f32` are defined in `lbm::single`.

#[cfg(not(target_arch = "nvptx64"))]
use bytemuck::Pod;
// `Pod` permits reading numbers as bytes, which only the host does; on a GPU any `Copy` type is enough.
use base::number;
#[cfg(target_arch = "nvptx64")]
use core::marker::Copy as Pod;
use core::ops::{Add, Div, Mul, Sub};

/// Maximum number of lanes of `f64`.
pub const WIDEST: usize = if cfg!(target_arch = "nvptx64") { 1 } else { 8 };

/// Number or vector of numbers of one precision; an operation acts on all lanes.
///
/// The implementations are vectors of `f64` (here) and of `f32` (`lbm::single`).
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Number of lanes.
    const WIDTH: usize;
    /// Returns a value with the same number in every lane, rounded to the precision of the lanes.
    fn splat(x: f64) -> Self;
    /// Returns the index of each lane: 0, 1, 2, …
    fn count() -> Self;
    /// Returns `self * a + b`, rounded once.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Returns `b - self * a`, rounded once.
    fn neg_mul_add(self, a: Self, b: Self) -> Self;
    /// Returns the correctly rounded square root.
    fn sqrt(self) -> Self;
    /// Selects for each lane `a` if `self` is zero, otherwise `b`.
    fn where_zero(self, a: Self, b: Self) -> Self;
    /// Returns the bit mask of the lanes whose number in memory is above a bound; lane n has the number n after `from`.
    /// With sixteen lanes a bit represents two lanes, n and n + 8.
    ///
    /// # Safety
    /// `from` must be valid for reading `WIDTH` elements.
    unsafe fn above(from: *const f32, bound: f32) -> u8;
    /// Returns the bit mask of the lanes whose number in memory equals `number`; bits and numbers are those of
    /// [`Self::above`].
    ///
    /// # Safety
    /// The conditions are those of [`Self::above`].
    unsafe fn equal(from: *const u32, number: u32) -> u8;
}

/// Number type of the populations in memory: `f64`, or `f32`, which halves the memory traffic and loses accuracy.
///
/// Passes compute in `f64` for both storage types. The exception is the pass of `lbm::kernel::single`, which computes
/// in `f32` on populations stored in `f32`.
pub trait Stored: Copy + Send + Sync + Default + Pod + EveryWidth {
    /// Name as written in a case.
    const NAME: &'static str;
    /// Converts an `f64` to the storage type, rounded to nearest.
    fn from_f64(x: f64) -> Self;
    /// Converts a stored number to `f64`, which is exact.
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

/// Transfer of `N::WIDTH` consecutive numbers between memory and lanes.
pub trait Memory<N: Lanes>: Sized {
    /// Loads `N::WIDTH` numbers.
    ///
    /// # Safety
    /// `from` must be valid for reading `N::WIDTH` elements.
    unsafe fn load(from: *const Self) -> N;
    /// Stores `N::WIDTH` numbers.
    ///
    /// # Safety
    /// `to` must be valid for writing `N::WIDTH` elements.
    unsafe fn store(to: *mut Self, value: N);
}

/// Number type that lanes of `f64` of every width load and store.
#[cfg(target_arch = "x86_64")]
pub trait EveryWidth: Memory<f64> + Memory<Avx2> + Memory<Avx512> {}
#[cfg(target_arch = "x86_64")]
impl<S: Memory<f64> + Memory<Avx2> + Memory<Avx512>> EveryWidth for S {}
/// Number type that lanes of `f64` of every width load and store.
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

/// Prefetches the cache line that contains an address, which need not be valid.
#[inline(always)]
pub(crate) fn prefetch<S>(line: *const S) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a prefetch is a hint and never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}
