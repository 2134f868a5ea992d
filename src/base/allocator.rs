//! Memory in huge pages: large blocks straight from the operating system and given back at once, small ones from
//! mimalloc (Leijen, Zorn and de Moura 2019, MSR-TR-2019-18), which asks for huge pages itself.
//!
//! Grains, contacts and maps of bodies are read in an order that jumps about in tens of megabytes, and a pass of the
//! lattice walks dozens of rows at the same time. In pages of 4 KiB the processor then waits for the translation of
//! addresses: 100,000 packed spheres take a third longer, the mapping of spheres in water a tenth to a half. An
//! allocator that keeps large blocks for later use would hold the grids of a search for neighbours, a fifth of the
//! memory of a grain.
//!
//! A program takes it by
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: base::allocator::Allocator = base::allocator::Allocator;
//! ```

use mimalloc::MiMalloc;
use std::alloc::{GlobalAlloc, Layout};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The pages of the operating system for blocks of at least [`LARGE`] bytes, mimalloc for the rest.
#[derive(Debug)]
pub struct Allocator;

/// The smallest block that gets pages of its own \[B\].
pub const LARGE: usize = 1 << 20;

/// A huge page of x86 and of most others \[B\].
const HUGE: usize = 2 << 20;

/// Cache lines by which the starts of blocks differ from one to the next, of [`COLOURS`]: the golden section spreads
/// any number of them evenly.
const STRIDE: usize = 1265;
/// Sets of a second-level cache: so many cache lines later the same set is meant.
const COLOURS: usize = 2048;
const LINE: usize = 64;

/// Number of blocks taken.
static TAKEN: AtomicUsize = AtomicUsize::new(0);

/// Returns a block that starts anywhere in a huge page. Arrays that start at the same place would meet in the same sets
/// of the caches wherever they are read side by side.
fn take(layout: &Layout) -> *mut u8 {
    let before = if layout.align() > LINE {
        0
    } else {
        TAKEN.fetch_add(1, Ordering::Relaxed).wrapping_mul(STRIDE) % COLOURS * LINE
    };
    let Some(bytes) = layout.size().checked_add(before) else {
        return std::ptr::null_mut();
    };
    let start = map(bytes);
    if start.is_null() {
        return start;
    }
    // SAFETY: the mapping is that much longer.
    unsafe { start.add(before) }
}

/// Returns the offset of the start of a block in its huge page \[bytes\].
fn before(start: *mut u8) -> usize {
    start.addr() % HUGE
}

/// Returns zeroed memory of a whole number of huge pages, at least `bytes`; null if there is none. Pages come when they
/// are first touched, near the thread that touches them.
pub fn map(bytes: usize) -> *mut u8 {
    let Some(room) = bytes.max(1).checked_next_multiple_of(HUGE) else {
        return std::ptr::null_mut();
    };
    let mut start = anonymous(room);
    // Kernels before 6.7 put it anywhere.
    if !start.is_null() && !start.addr().is_multiple_of(HUGE) {
        // SAFETY: the mapping made above, which no other code has seen.
        unsafe { release(start, room) };
        start = anonymous(room.saturating_add(HUGE));
        if !start.is_null() {
            let before = start.addr().next_multiple_of(HUGE) - start.addr();
            // SAFETY: both pieces lie in the mapping made above, which is `HUGE` longer than what is kept.
            unsafe {
                release(start, before);
                start = start.add(before);
                release(start.add(room), HUGE - before);
            }
        }
    }
    #[cfg(target_os = "linux")]
    if !start.is_null() {
        // SAFETY: advice on our own mapping; failing is harmless.
        unsafe {
            libc::madvise(start.cast(), room, libc::MADV_HUGEPAGE);
        }
    }
    start
}

/// Releases the memory that [`map`] returned for `bytes`.
///
/// # Safety
/// `start` must be of [`map`] with these `bytes`, and the memory may not be used any more.
pub unsafe fn unmap(start: *mut u8, bytes: usize) {
    // SAFETY: promised by the caller; `map` could round `bytes` up.
    unsafe { release(start, bytes.max(1).next_multiple_of(HUGE)) };
}

fn anonymous(bytes: usize) -> *mut u8 {
    // SAFETY: a new anonymous private mapping; the result is checked.
    let start = unsafe {
        libc::mmap(
            std::ptr::null_mut(),
            bytes,
            libc::PROT_READ | libc::PROT_WRITE,
            libc::MAP_PRIVATE | libc::MAP_ANONYMOUS,
            -1,
            0,
        )
    };
    if start == libc::MAP_FAILED {
        return std::ptr::null_mut();
    }
    start.cast()
}

/// # Safety
/// These bytes must be whole pages of a mapping made here, and they may not be used any more.
unsafe fn release(start: *mut u8, bytes: usize) {
    if bytes > 0 {
        // SAFETY: promised by the caller.
        unsafe {
            libc::munmap(start.cast(), bytes);
        }
    }
}

fn is_large(layout: &Layout) -> bool {
    layout.size() >= LARGE && layout.align() <= HUGE
}

// SAFETY: a block is large by its layout alone, so that it is released to its source. `map` gives memory that no other
// block has, aligned to `HUGE`, and `take` moves its start by less than that, and by nothing if that would break the
// alignment; everything else is the promise of `MiMalloc`.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if is_large(&layout) {
            take(&layout)
        } else {
            // SAFETY: promised by the caller.
            unsafe { MiMalloc.alloc(layout) }
        }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if is_large(&layout) {
            take(&layout)
        } else {
            // SAFETY: promised by the caller.
            unsafe { MiMalloc.alloc_zeroed(layout) }
        }
    }

    unsafe fn dealloc(&self, start: *mut u8, layout: Layout) {
        // SAFETY: promised by the caller; the layout says where the block came from.
        unsafe {
            if is_large(&layout) {
                let before = before(start);
                unmap(start.sub(before), before + layout.size());
            } else {
                MiMalloc.dealloc(start, layout);
            }
        }
    }

    unsafe fn realloc(&self, start: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller promises that the new size fits the alignment.
        let wanted = unsafe { Layout::from_size_align_unchecked(size, layout.align()) };
        if !is_large(&layout) && !is_large(&wanted) {
            // SAFETY: promised by the caller.
            return unsafe { MiMalloc.realloc(start, layout, size) };
        }
        let pages = |bytes: usize| (before(start) + bytes).div_ceil(HUGE);
        if is_large(&layout) && is_large(&wanted) && pages(size) == pages(layout.size()) {
            return start;
        }
        // SAFETY: both blocks are as long as the shorter of the two sizes, and do not overlap.
        unsafe {
            let new = self.alloc(wanted);
            if !new.is_null() {
                std::ptr::copy_nonoverlapping(start, new, layout.size().min(size));
                self.dealloc(start, layout);
            }
            new
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(size: usize, align: usize) -> Layout {
        Layout::from_size_align(size, align).unwrap()
    }

    #[test]
    fn blocks_are_aligned_zero_and_apart() {
        for (size, align) in [
            (1, 1),
            (LARGE - 1, 8),
            (LARGE, 8),
            (HUGE, 64),
            (HUGE + 1, 4096),
            (5 * HUGE - 3, HUGE),
            (LARGE, 4 * HUGE),
        ] {
            let layout = layout(size, align);
            // SAFETY: blocks are used within their size and given back once.
            unsafe {
                let blocks: [*mut u8; 3] = std::array::from_fn(|_| Allocator.alloc_zeroed(layout));
                for (k, &block) in (1..).zip(&blocks) {
                    assert_eq!(block.addr() % align, 0, "{size} {align}");
                    let bytes = std::slice::from_raw_parts_mut(block, size);
                    assert!(bytes.iter().all(|&byte| byte == 0), "{size} {align}");
                    bytes.fill(k);
                }
                for (k, &block) in (1..).zip(&blocks) {
                    let bytes = std::slice::from_raw_parts(block, size);
                    assert!(bytes.iter().all(|&byte| byte == k), "{size} {align}");
                    Allocator.dealloc(block, layout);
                }
            }
        }
    }

    #[test]
    fn a_block_keeps_its_bytes_when_it_grows_and_shrinks() {
        let sizes = [
            10,
            LARGE - 1,
            LARGE,
            HUGE,
            HUGE + 1,
            7 * HUGE,
            3 * HUGE + 5,
            3 * HUGE,
            LARGE,
            100,
            9 * HUGE,
            1,
        ];
        // SAFETY: as above.
        unsafe {
            let mut held = layout(sizes[0], 8);
            let mut block = Allocator.alloc(held);
            block.write_bytes(7, held.size());
            for size in sizes {
                block = Allocator.realloc(block, held, size);
                let kept = held.size().min(size);
                held = layout(size, 8);
                assert_eq!(block.addr() % held.align(), 0);
                let bytes = std::slice::from_raw_parts_mut(block, size);
                assert!(bytes[..kept].iter().all(|&byte| byte == 7), "{size}");
                bytes.fill(7);
            }
            Allocator.dealloc(block, held);
        }
    }

    #[test]
    fn more_than_there_is_gives_null() {
        let impossible = layout(isize::MAX as usize - HUGE, 8);
        // SAFETY: nothing is used.
        unsafe {
            assert!(Allocator.alloc(impossible).is_null());
        }
        assert!(map(usize::MAX).is_null());
    }
}
