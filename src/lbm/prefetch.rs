//! Hints to the processor which memory is needed soon.

/// Asks for a cache line; any address will do.
#[inline(always)]
pub(in crate::lbm) fn prefetch<S>(line: *const S) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}
