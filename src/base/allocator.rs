//! Memory in huge pages: large blocks are obtained directly from the operating system and released immediately,
//! small ones come from mimalloc (Leijen, Zorn and de Moura 2019, MSR-TR-2019-18), which requests huge pages
//! itself.
//!
//! Grains, contacts and maps of bodies are accessed in an irregular order over tens of megabytes, and a sweep
//! over the lattice reads dozens of rows at the same time. With pages of 4 KiB the processor then waits for address
//! translations: 100,000 packed spheres take a third longer, the mapping of spheres in water a tenth to a half. An
//! allocator that retains large blocks for later use would keep the grids of a neighbour search, a fifth of the
//! memory of a grain.
//!
//! A program selects the allocator by
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: base::allocator::Allocator = base::allocator::Allocator;
//! ```

#[cfg(not(miri))]
use mimalloc::MiMalloc;
// Miri calls no functions of other languages.
#[cfg(miri)]
use std::alloc::System as MiMalloc;
use std::alloc::{GlobalAlloc, Layout};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Allocator with pages of the operating system for blocks of at least [`LARGE`] bytes, and mimalloc for smaller
/// ones.
#[derive(Debug)]
pub struct Allocator;

/// Minimum size of a block with pages of its own \[B\].
pub const LARGE: usize = 1 << 20;

/// Size of a huge page on x86 and most other processors \[B\].
const HUGE: usize = 2 << 20;

/// Offset in cache lines between the starts of successive blocks, modulo [`COLOURS`]: the golden ratio distributes
/// any number of blocks evenly.
const STRIDE: usize = 1265;
/// Number of sets of a second-level cache: addresses this many cache lines apart map to the same set.
const COLOURS: usize = 2048;
const LINE: usize = 64;

/// Number of large blocks allocated so far.
static LARGE_BLOCKS: AtomicUsize = AtomicUsize::new(0);

/// Returns a block with a varying start in a huge page. Arrays with the same start would compete for the same cache
/// sets when they are read together.
fn allocate_large(layout: &Layout) -> *mut u8 {
    let before = if layout.align() > LINE {
        0
    } else {
        LARGE_BLOCKS
            .fetch_add(1, Ordering::Relaxed)
            .wrapping_mul(STRIDE)
            % COLOURS
            * LINE
    };
    let Some(bytes) = layout.size().checked_add(before) else {
        return std::ptr::null_mut();
    };
    let start = map(bytes);
    if start.is_null() {
        return start;
    }
    // SAFETY: the mapping is longer by this offset.
    unsafe { start.add(before) }
}

/// Returns the offset of the start of a block from the start of its huge page \[bytes\].
fn offset_in_huge_page(start: *mut u8) -> usize {
    start.addr() % HUGE
}

/// Returns zeroed memory of a whole number of huge pages, at least `bytes`; null if there is none. A page is
/// allocated when a thread first accesses it, in the memory closest to that thread.
pub fn map(bytes: usize) -> *mut u8 {
    let Some(room) = bytes.max(1).checked_next_multiple_of(HUGE) else {
        return std::ptr::null_mut();
    };
    let mut start = anonymous(room);
    // Kernels before 6.7 do not align the mapping. Miri cannot release a part of a mapping, and has no pages.
    if !cfg!(miri) && !start.is_null() && !start.addr().is_multiple_of(HUGE) {
        // SAFETY: this mapping was made above and no other code uses it.
        unsafe { release(start, room) };
        start = anonymous(room.saturating_add(HUGE));
        if !start.is_null() {
            let before = start.addr().next_multiple_of(HUGE) - start.addr();
            // SAFETY: both pieces lie in the mapping made above, which is longer than the retained part by `HUGE`.
            unsafe {
                release(start, before);
                start = start.add(before);
                release(start.add(room), HUGE - before);
            }
        }
    }
    #[cfg(all(target_os = "linux", not(miri)))]
    if !start.is_null() {
        // SAFETY: this is advice on our own mapping; a failure is harmless.
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

// SAFETY: the layout alone decides if a block is large, so that it is released to its source. `map` returns memory
// that no other block uses, aligned to `HUGE`, and `allocate_large` moves its start by less than that, and by
// nothing if that would break the alignment; everything else is the promise of `MiMalloc`.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if is_large(&layout) {
            allocate_large(&layout)
        } else {
            // SAFETY: promised by the caller.
            unsafe { MiMalloc.alloc(layout) }
        }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if is_large(&layout) {
            allocate_large(&layout)
        } else {
            // SAFETY: promised by the caller.
            unsafe { MiMalloc.alloc_zeroed(layout) }
        }
    }

    unsafe fn dealloc(&self, start: *mut u8, layout: Layout) {
        // SAFETY: promised by the caller; the layout determines the source of the block.
        unsafe {
            if is_large(&layout) {
                let before = offset_in_huge_page(start);
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
        let pages = |bytes: usize| (offset_in_huge_page(start) + bytes).div_ceil(HUGE);
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
        // SAFETY: nothing is used after this.
        unsafe {
            assert!(Allocator.alloc(impossible).is_null());
        }
        assert!(map(usize::MAX).is_null());
    }
}
