//! The covered cells of a slab in two lists, so that threads side by side have the same work: cells deep inside bodies,
//! and the others.

use super::balls::Counters;
#[cfg(target_arch = "nvptx64")]
use super::{balls::WARP, warp};
#[cfg(target_arch = "nvptx64")]
use core::sync::atomic::Ordering;

/// The covered cells of a slab by their number, `(plane * rows + row) * cells of a row + place`: those deep inside
/// bodies from the front on, the others from the back on. The same bytes on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct CoveredCells {
    /// Memory for all cells.
    pub(crate) numbers: *mut u32,
    /// Number of listed cells.
    pub(crate) counters: *const Counters,
    /// Planes of the slab, rows of a plane, and cells of the slab.
    pub(crate) planes: u32,
    pub(crate) rows: u32,
    pub(crate) cells: u32,
}

#[cfg(target_arch = "nvptx64")]
impl CoveredCells {
    /// Adds the cells of a row, whose first cell has number `first`, to the two lists. `kind` returns for a place
    /// `true` if bodies cover it, and `true` if it is deep inside.
    ///
    /// # Safety
    /// All threads of the warp must be here, with the same row.
    #[inline(always)]
    pub(crate) unsafe fn add_row(&self, first: u32, length: u32, kind: impl Fn(u32) -> [bool; 2]) {
        // The threads of the warp with a cell for each of the lists.
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
            warp::places(&counters.deep, counts[0]),
            warp::places(&counters.mixed, counts[1]),
        ];
        let mut start = 0;
        while start < length {
            let number = first + start + warp::lane();
            for (n, (listed, threads)) in threads(start).into_iter().enumerate() {
                if listed {
                    let place = at[n] + warp::before(threads);
                    let place = if n == 0 {
                        place
                    } else {
                        self.cells - 1 - place
                    };
                    // SAFETY: there is memory for each cell.
                    unsafe { self.numbers.add(place as usize).write(number) };
                }
                at[n] += threads.count_ones();
            }
            start += WARP;
        }
    }

    /// The number of a cell of a list, if it has so many.
    ///
    /// # Safety
    /// All cells must have been added.
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
