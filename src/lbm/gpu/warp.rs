//! Work that the threads of a warp share: 32 threads of a GPU that run together. For GPUs alone.
//!
//! All threads of a warp must call these functions together, so that a kernel that uses them has no thread that
//! returned before.

use super::balls::WARP;
use core::sync::atomic::{AtomicU32, Ordering};

/// All threads of a warp.
const ALL: u32 = u32::MAX;

/// The number of this thread in its warp.
#[inline(always)]
pub(crate) fn lane() -> u32 {
    let lane;
    // SAFETY: reads a register of the thread.
    unsafe {
        core::arch::asm!("mov.u32 {0}, %laneid;", out(reg32) lane, options(pure, nomem, nostack, preserves_flags));
    }
    lane
}

/// Returns the bit mask of the threads for which `holds` is `true`.
#[inline(always)]
pub(crate) fn ballot(holds: bool) -> u32 {
    let threads;
    // SAFETY: all threads of the warp are here.
    unsafe {
        core::arch::asm!(
            "{{ .reg .pred holds; setp.ne.u32 holds, {1}, 0; vote.sync.ballot.b32 {0}, holds, {2}; }}",
            out(reg32) threads, in(reg32) u32::from(holds), const ALL,
            options(nostack, preserves_flags)
        );
    }
    threads
}

/// The number that another thread has.
#[inline(always)]
pub(crate) fn of_lane(number: u32, lane: u32) -> u32 {
    let theirs;
    // SAFETY: all threads of the warp are here.
    unsafe {
        core::arch::asm!(
            "shfl.sync.idx.b32 {0}, {1}, {2}, 31, {3};",
            out(reg32) theirs, in(reg32) number, in(reg32) lane, const ALL,
            options(nostack, preserves_flags)
        );
    }
    theirs
}

/// The sum of a number of each thread, in all of them.
#[inline(always)]
pub(crate) fn sum(number: i64) -> i64 {
    let mut sum = number;
    let mut beside = WARP / 2;
    while beside > 0 {
        let other: i64;
        // SAFETY: all threads of the warp are here.
        unsafe {
            core::arch::asm!(
                "{{ .reg .b32 low, high; mov.b64 {{low, high}}, {1};",
                "shfl.sync.bfly.b32 low, low, {2}, 31, {3};",
                "shfl.sync.bfly.b32 high, high, {2}, 31, {3};",
                "mov.b64 {0}, {{low, high}}; }}",
                out(reg64) other, in(reg64) sum, in(reg32) beside, const ALL,
                options(nostack, preserves_flags)
            );
        }
        sum = sum.wrapping_add(other);
        beside >>= 1;
    }
    sum
}

/// Returns the number of threads before this one that are set in `threads`.
#[inline(always)]
pub(crate) fn before(threads: u32) -> u32 {
    (threads & ((1 << lane()) - 1)).count_ones()
}

/// The first of as many places as are asked for by the threads of a warp together.
#[inline(always)]
pub(crate) fn places(count: &AtomicU32, asked: u32) -> u32 {
    let mut first = 0;
    if asked > 0 && lane() == 0 {
        first = count.fetch_add(asked, Ordering::Relaxed);
    }
    of_lane(first, 0)
}
