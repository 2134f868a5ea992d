//! Lists of the covered cells of a slab: those deep inside bodies, and the others.
//!
//! The lists are separate so that all threads of a warp do the same work.

use super::balls::Counters;
#[cfg(target_arch = "nvptx64")]
use super::{balls::WARP, warp};
#[cfg(target_arch = "nvptx64")]
use core::sync::atomic::Ordering;

/// Lists of the covered cells of a slab by their number, `(plane * rows + row) * cells of a row + index in the row`.
/// Both are in one array: cells deep inside bodies from its start forwards, the others from its end backwards. The
/// layout of this struct is the same on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct CoveredCells {
    /// Array with an element for each cell of the slab.
    pub(crate) numbers: *mut u32,
    /// Numbers of listed cells.
    pub(crate) counters: *const Counters,
    /// Number of planes of the slab, of rows of a plane, and of cells of the slab.
    pub(crate) planes: u32,
    pub(crate) rows: u32,
    pub(crate) cells: u32,
}

#[cfg(target_arch = "nvptx64")]
impl CoveredCells {
    /// Adds the covered cells of a row to the two lists; `first` is the number of its first cell. For an index in the
    /// row, `kind` returns `true` if bodies cover the cell, and `true` if the cell is deep inside them.
    ///
    /// # Safety
    /// All threads of the warp must call this function together, with the same row.
    #[inline(always)]
    pub(crate) unsafe fn add_row(&self, first: u32, length: u32, kind: impl Fn(u32) -> [bool; 2]) {
        // For each list, `true` if the cell of this thread belongs to it, and the mask of the threads whose cells do.
        let threads = |start: u32| {
            let place = start + warp::lane();
            let [covered, deep] = if place < length {
                kind(place)
            } else {
                [false; 2]
            };
            [deep, covered && !deep].map(|listed| (listed, warp::ballot(listed)))
        };
        let mut counts = [0; 2];
        let mut start = 0;
        while start < length {
            let [(_, deep), (_, mixed)] = threads(start);
            counts = [
                counts[0] + deep.count_ones(),
                counts[1] + mixed.count_ones(),
            ];
            start += WARP;
        }
        // SAFETY: promised by the caller.
        let counters = unsafe { &*self.counters };
        let mut at = [
            warp::reserve(&counters.deep, counts[0]),
            warp::reserve(&counters.mixed, counts[1]),
        ];
        let mut start = 0;
        while start < length {
            let number = first + start + warp::lane();
            for (n, (listed, threads)) in threads(start).into_iter().enumerate() {
                if listed {
                    let place = at[n] + warp::preceding(threads);
                    let place = if n == 0 {
                        place
                    } else {
                        self.cells - 1 - place
                    };
                    // SAFETY: the array has an element for each cell.
                    unsafe { self.numbers.add(place as usize).write(number) };
                }
                at[n] += threads.count_ones();
            }
            start += WARP;
        }
    }

    /// Returns the number of cell `n` of a list, or `None` if the list is shorter.
    ///
    /// # Safety
    /// All rows must have been added.
    #[inline(always)]
    pub(crate) unsafe fn get(&self, n: u32, deep: bool) -> Option<u32> {
        // SAFETY: promised by the caller.
        unsafe {
            let counters = &*self.counters;
            let count = if deep {
                &counters.deep
            } else {
                &counters.mixed
            };
            let at = if deep {
                n
            } else {
                self.cells.wrapping_sub(1 + n)
            };
            (n < count.load(Ordering::Relaxed)).then(|| self.numbers.add(at as usize).read())
        }
    }
}
