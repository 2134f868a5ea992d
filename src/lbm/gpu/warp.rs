//! Collective operations of the threads of a warp, in PTX.
//!
//! They are separate because they are compiled for GPUs only. All threads of a warp must call such a function together;
//! in a kernel that uses them, no thread may return before.

use super::balls::WARP;
use core::sync::atomic::{AtomicU32, Ordering};

/// Bit mask of all threads of a warp.
const ALL: u32 = u32::MAX;

/// Returns the index of this thread in its warp.
#[inline(always)]
pub(crate) fn lane() -> u32 {
    let lane;
    // SAFETY: the instruction reads a register of the thread.
    unsafe {
        core::arch::asm!("mov.u32 {0}, %laneid;", out(reg32) lane, options(pure, nomem, nostack, preserves_flags));
    }
    lane
}

/// Returns the bit mask of the threads for which `holds` is `true`.
#[inline(always)]
pub(crate) fn ballot(holds: bool) -> u32 {
    let threads;
    // SAFETY: all threads of the warp call this function together.
    unsafe {
        core::arch::asm!(
            "{{ .reg .pred holds; setp.ne.u32 holds, {1}, 0; vote.sync.ballot.b32 {0}, holds, {2}; }}",
            out(reg32) threads, in(reg32) u32::from(holds), const ALL,
            options(nostack, preserves_flags)
        );
    }
    threads
}

/// Returns the value of `number` in thread `lane` of the warp.
#[inline(always)]
pub(crate) fn from_lane(number: u32, lane: u32) -> u32 {
    let theirs;
    // SAFETY: all threads of the warp call this function together.
    unsafe {
        core::arch::asm!(
            "shfl.sync.idx.b32 {0}, {1}, {2}, 31, {3};",
            out(reg32) theirs, in(reg32) number, in(reg32) lane, const ALL,
            options(nostack, preserves_flags)
        );
    }
    theirs
}

/// Returns to each thread the sum of `number` over the threads of the warp.
#[inline(always)]
pub(crate) fn sum(number: i64) -> i64 {
    let mut sum = number;
    let mut distance = WARP / 2;
    while distance > 0 {
        let other: i64;
        // SAFETY: all threads of the warp call this function together.
        unsafe {
            core::arch::asm!(
                "{{ .reg .b32 low, high; mov.b64 {{low, high}}, {1};",
                "shfl.sync.bfly.b32 low, low, {2}, 31, {3};",
                "shfl.sync.bfly.b32 high, high, {2}, 31, {3};",
                "mov.b64 {0}, {{low, high}}; }}",
                out(reg64) other, in(reg64) sum, in(reg32) distance, const ALL,
                options(nostack, preserves_flags)
            );
        }
        sum = sum.wrapping_add(other);
        distance >>= 1;
    }
    sum
}

/// Returns the number of threads in the mask `threads` that precede this thread.
#[inline(always)]
pub(crate) fn preceding(threads: u32) -> u32 {
    (threads & ((1 << lane()) - 1)).count_ones()
}

/// Reserves `asked` consecutive elements for the warp by adding to `count`, and returns the index of the first one.
#[inline(always)]
pub(crate) fn reserve(count: &AtomicU32, asked: u32) -> u32 {
    let mut first = 0;
    if asked > 0 && lane() == 0 {
        first = count.fetch_add(asked, Ordering::Relaxed);
    }
    from_lane(first, 0)
}
