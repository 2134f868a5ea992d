//! A pool of threads that start work within a few microseconds.
//!
//! A solid step of some thousand grains takes tens of microseconds, and a fluid step has several parallel regions
//! of that duration. The workers of `rayon` sleep between two regions and take longer to wake than to work. Loops
//! of this size therefore use this pool, both for pieces of equal work and for pieces that idle threads take
//! dynamically. Contacts of blocks and work of milliseconds use `rayon`, with the same number of threads. An idle
//! thread polls for work for tens of microseconds, then yields for some time, then sleeps, so that ranks that share
//! a core lose little time.
//!
//! Each thread begins with the pieces of its own number and then takes those that no thread has begun. A caller
//! therefore waits for helpers that have begun a piece, but not for those without a core: on a busy machine the
//! caller does all pieces itself.
//!
//! The assignment of pieces to threads does not affect results, because pieces are disjoint. A caller that finds
//! the pool in use by another caller does its pieces itself.

mod board;
mod sync;

use board::{Helper, JobBoard, Work};
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, TryLockError};
use sync::Arc;
#[cfg(not(loom))]
use sync::AtomicBool;

struct Pool {
    board: Arc<JobBoard>,
    helpers: Vec<Helper>,
}

static POOL: Mutex<Option<Pool>> = Mutex::new(None);

/// Maximum number of threads that share work.
pub const MAX_THREADS: usize = 64;

/// Returns the number of threads of this rank: the best number of pieces for a loop of equal work.
#[must_use]
pub fn threads() -> usize {
    rayon::current_num_threads().min(MAX_THREADS)
}

/// Calls `work` with each number below `pieces` on up to this many threads; returns when all calls have ended.
///
/// # Panics
/// If `work` does.
pub fn each(pieces: usize, work: impl Fn(usize) + Sync) {
    if pieces > 1 {
        let pool = match POOL.try_lock() {
            Ok(pool) => Some(pool),
            // A panic is propagated only after all threads have finished.
            Err(TryLockError::Poisoned(pool)) => Some(pool.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        };
        if let Some(mut pool) = pool {
            return pool.get_or_insert_with(Pool::new).run(pieces, &work);
        }
    }
    (0..pieces).for_each(work);
}

/// Data divided among pieces of work: one or several slices cut into parts.
pub trait Shared: Sync {
    /// Part of the data that belongs to one piece.
    type Share;

    /// Returns the part of a piece.
    ///
    /// # Safety
    /// Each piece calls this once.
    unsafe fn take_share(&self, piece: usize) -> Self::Share;
}

/// Slice cut into consecutive parts.
pub struct Cut<'a, T> {
    start: *mut T,
    bounds: [usize; MAX_THREADS + 1],
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: parts do not overlap, and each is given to one piece once.
unsafe impl<T: Send> Sync for Cut<'_, T> {}

impl<T> Cut<'_, T> {
    /// Returns the address of an item of the slice.
    fn item(&self, n: usize) -> *mut T {
        self.start.wrapping_add(n)
    }
}

/// Cuts a slice: part p goes from `bound(p)` to `bound(p + 1)`.
///
/// # Panics
/// If there are more than [`MAX_THREADS`] pieces, bounds fall, or the last is beyond the slice.
pub fn cut<T>(slice: &mut [T], pieces: usize, bound: impl Fn(usize) -> usize) -> Cut<'_, T> {
    let mut bounds = [0; MAX_THREADS + 1];
    for (piece, at) in bounds[..=pieces].iter_mut().enumerate() {
        *at = bound(piece);
    }
    assert!(bounds[..=pieces].is_sorted() && bounds[pieces] <= slice.len());
    // Nothing beyond the last piece can be accessed.
    let end = bounds[pieces];
    bounds[pieces..].fill(end);
    Cut {
        start: slice.as_mut_ptr(),
        bounds,
        slice: PhantomData,
    }
}

/// Cuts a slice into parts of about equal length.
pub fn evenly<T>(slice: &mut [T], pieces: usize) -> Cut<'_, T> {
    let count = slice.len();
    cut(slice, pieces, |piece| count * piece / pieces)
}

impl<'a, T: Send> Shared for Cut<'a, T> {
    type Share = &'a mut [T];

    unsafe fn take_share(&self, piece: usize) -> &'a mut [T] {
        let (from, to) = (self.bounds[piece], self.bounds[piece + 1]);
        // SAFETY: within the slice; parts do not overlap, and the caller asks for each once.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(from), to - from) }
    }
}

macro_rules! several {
    ($($name:ident),*) => {
        impl<$($name: Shared),*> Shared for ($($name,)*) {
            type Share = ($($name::Share,)*);

            unsafe fn take_share(&self, piece: usize) -> Self::Share {
                #[expect(non_snake_case, reason = "named as their types")]
                let ($($name,)*) = self;
                // SAFETY: promised by the caller.
                unsafe { ($($name.take_share(piece),)*) }
            }
        }
    };
}
several!(A, B);
several!(A, B, C);
several!(A, B, C, D);

/// Calls `work` like [`each`], with the data of each piece.
pub fn each_of<W: Shared>(pieces: usize, shared: W, work: impl Fn(usize, W::Share) + Sync) {
    each(pieces, |piece| {
        // SAFETY: each piece is done once, and no other code accesses the data.
        let share = unsafe { shared.take_share(piece) };
        work(piece, share);
    });
    drop(shared);
}

/// Calls `work` with each item and its index. The items are divided evenly among the threads in pieces of at least
/// `least` items.
pub fn each_item<T: Send>(items: &mut [T], least: usize, work: impl Fn(usize, &mut T) + Sync) {
    let count = items.len();
    let pieces = threads().min(count / least.max(1)).max(1);
    each_of(pieces, evenly(items, pieces), |piece, share| {
        for (n, item) in (count * piece / pieces..).zip(share) {
            work(n, item);
        }
    });
}

/// Returns the number of runs of consecutive items for [`each_run_of`]: about the maximum for each thread, or a
/// single run for fewer than `2 least` items.
#[must_use]
pub fn runs(items: usize, least: usize) -> usize {
    match threads().min(items / least.max(1)) {
        0 | 1 => 1,
        threads => MAX_THREADS / threads * threads,
    }
}

/// Number of runs of a thread that have been begun, on a separate cache line.
#[derive(Default)]
#[repr(align(128))]
struct RunCounter(AtomicUsize);

/// Calls `work` like [`each_of`] for runs of unequal work: a thread first does the runs of its own part, which is
/// the same in each call, and then runs of other threads. It therefore mostly reads data that it wrote before.
pub fn each_run_of<W: Shared>(runs: usize, shared: W, work: impl Fn(usize, W::Share) + Sync) {
    let threads = threads().min(runs);
    if threads <= 1 {
        return each_of(runs, shared, work);
    }
    let begun: [RunCounter; MAX_THREADS] = std::array::from_fn(|_| RunCounter::default());
    each(threads, |thread| {
        for turn in 0..threads {
            let whose = (thread + turn) % threads;
            let (first, end) = (runs * whose / threads, runs * (whose + 1) / threads);
            loop {
                let run = first + begun[whose].0.fetch_add(1, Ordering::Relaxed);
                if run >= end {
                    break;
                }
                // SAFETY: no other thread has begun this run, and no other code accesses the shared data.
                work(run, unsafe { shared.take_share(run) });
            }
        }
    });
    drop(shared);
}

/// Calls `work` like [`each_item`] for items of unequal work: see [`each_run_of`].
pub fn each_item_in_runs<T: Send>(
    items: &mut [T],
    least: usize,
    work: impl Fn(usize, &mut T) + Sync,
) {
    let count = items.len();
    let runs = runs(count, least);
    each_run_of(runs, evenly(items, runs), |run, share| {
        for (n, item) in (count * run / runs..).zip(share) {
            work(n, item);
        }
    });
}

/// Calls `work` like [`each_item_in_runs`] for items of very unequal work, in runs of `some` items. Each thread has one
/// of the `buffers`.
pub fn each_item_when_free<T: Send, R: Send + Default>(
    items: &mut [T],
    some: usize,
    buffers: &mut Vec<R>,
    work: impl Fn(&mut R, &mut T) + Sync,
) {
    let some = some.max(1);
    let threads = threads().min(items.len().div_ceil(some)).max(1);
    if buffers.len() < threads {
        buffers.resize_with(threads, R::default);
    }
    let begun: [RunCounter; MAX_THREADS] = std::array::from_fn(|_| RunCounter::default());
    let all = Cut {
        start: items.as_mut_ptr(),
        bounds: [0; MAX_THREADS + 1],
        slice: PhantomData,
    };
    let count = items.len();
    each_item(&mut buffers[..threads], 1, |thread, buffer| {
        for turn in 0..threads {
            let whose = (thread + turn) % threads;
            let share = count * whose / threads..count * (whose + 1) / threads;
            loop {
                let first = share.start + begun[whose].0.fetch_add(some, Ordering::Relaxed);
                if first >= share.end {
                    break;
                }
                for n in first..(first + some).min(share.end) {
                    // SAFETY: the index is within the slice, and no other thread has taken it.
                    work(buffer, unsafe { &mut *all.item(n) });
                }
            }
        }
    });
}

/// Buffer for new items of a list, filled by one piece of the work.
pub struct PieceBuffer<'a, T> {
    slice: &'a mut [MaybeUninit<T>],
    count: usize,
}

impl<T> PieceBuffer<'_, T> {
    /// Adds an item.
    ///
    /// # Panics
    /// If the buffer is full.
    #[inline]
    pub fn push(&mut self, item: T) {
        self.slice[self.count].write(item);
        self.count += 1;
    }
}

/// Appends the items from all pieces of the work to a list, in the order of the pieces: piece p adds at most
/// `bound(p + 1) - bound(p)` items.
pub fn extend<T: Copy + Send>(
    list: &mut Vec<T>,
    pieces: usize,
    bound: impl Fn(usize) -> usize,
    work: impl Fn(usize, &mut PieceBuffer<'_, T>) + Sync,
) {
    list.reserve_exact(bound(pieces));
    let mut counts = [0; MAX_THREADS];
    let spare = list.spare_capacity_mut();
    let shared = (
        cut(spare, pieces, &bound),
        evenly(&mut counts[..pieces], pieces),
    );
    each_of(pieces, shared, |piece, (slice, count)| {
        let mut buffer = PieceBuffer { slice, count: 0 };
        work(piece, &mut buffer);
        count[0] = buffer.count;
    });
    // Closes the gaps after pieces that added fewer items.
    let mut end = 0;
    for (piece, &count) in counts[..pieces].iter().enumerate() {
        let from = bound(piece);
        if from != end {
            spare.copy_within(from..from + count, end);
        }
        end += count;
    }
    let length = list.len() + end;
    // SAFETY: each piece has written as many items as it counted, and they are now contiguous.
    unsafe { list.set_len(length) };
}

impl Pool {
    fn new() -> Self {
        Self {
            board: Arc::new(JobBoard::new()),
            helpers: Vec::new(),
        }
    }

    fn run(&mut self, pieces: usize, work: &Work<'_>) {
        while self.helpers.len() + 1 < pieces.min(threads()) {
            let Some(helper) = start(&self.board, self.helpers.len() + 1) else {
                break;
            };
            self.helpers.push(helper);
        }
        self.board.run(pieces, work, &self.helpers);
    }
}

/// Starts a helper thread, which waits for jobs until the program ends; returns `None` if the system has no more
/// threads.
#[cfg(not(loom))]
fn start(board: &Arc<JobBoard>, thread: usize) -> Option<Helper> {
    let sleeps = Arc::new(AtomicBool::new(false));
    let (board, flag) = (Arc::clone(board), Arc::clone(&sleeps));
    let mut seen = board.last();
    let wait = move || {
        loop {
            seen = board.help(&flag, thread, seen);
        }
    };
    std::thread::Builder::new()
        .name(format!("pool {thread}"))
        .spawn(wait)
        .ok()
        .map(|handle| Helper {
            thread: handle.thread().clone(),
            sleeps,
        })
}

/// Starts no helper: threads of a loom model belong to the model.
#[cfg(loom)]
fn start(_: &Arc<JobBoard>, _: usize) -> Option<Helper> {
    None
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use std::panic::catch_unwind;
    use std::sync::atomic::AtomicU32;
    use std::time::Duration;

    #[test]
    fn each_piece_is_done_once_and_all_before_the_call_returns() {
        for pieces in [0, 1, 2, 3, 5] {
            // Polling, yielding and sleeping threads.
            for pause in [0, 1, 20] {
                for _ in 0..50 / (1 + pause) {
                    let done: Vec<_> = (0..pieces).map(|_| AtomicU32::new(0)).collect();
                    each(pieces, |piece| {
                        done[piece].fetch_add(1, Ordering::Relaxed);
                    });
                    assert!(done.iter().all(|n| n.load(Ordering::Relaxed) == 1));
                    std::thread::sleep(Duration::from_millis(pause));
                }
            }
        }
    }

    #[test]
    fn callers_at_once_and_within_each_other_lose_nothing() {
        let sum = AtomicU32::new(0);
        std::thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        each(2, |_| {
                            each(3, |n| {
                                sum.fetch_add(u32::try_from(n).unwrap(), Ordering::Relaxed);
                            });
                        });
                    }
                });
            }
        });
        assert_eq!(sum.into_inner(), 3 * 200 * 2 * 3);
    }

    #[test]
    fn items_know_their_places() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        pool.unwrap().install(|| {
            let mut items = vec![0; 1000];
            each_item(&mut items, 10, |n, item| *item += n);
            assert!(items.iter().enumerate().all(|(n, item)| n == *item));
            for count in [0, 1, 19, 20, 100, 1000] {
                each_item_in_runs(&mut items[..count], 10, |n, item| *item -= n);
                assert!(items[..count].iter().all(|item| *item == 0));
                each_item_in_runs(&mut items[..count], 10, |n, item| *item += n);
            }
            assert_eq!([runs(19, 10), runs(20, 10), runs(1000, 10)], [1, 64, 63]);
        });
    }

    #[test]
    fn free_threads_take_what_is_left() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        pool.unwrap().install(|| {
            let mut buffers: Vec<Vec<usize>> = Vec::new();
            for (count, some) in [(0, 1), (1, 4), (7, 2), (1000, 8)] {
                let mut items: Vec<usize> = (0..count).collect();
                buffers.iter_mut().for_each(Vec::clear);
                each_item_when_free(&mut items, some, &mut buffers, |buffer, item| {
                    buffer.push(*item);
                    *item += 1;
                });
                assert!(items.iter().enumerate().all(|(n, item)| n + 1 == *item));
                let mut done: Vec<usize> = buffers.concat();
                done.sort_unstable();
                assert!(done.into_iter().eq(0..count));
            }
        });
    }

    #[test]
    fn a_list_gets_what_all_pieces_give() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        pool.unwrap().install(|| {
            let bounds = [0, 5, 5, 12, 14];
            let mut list = vec![7];
            extend(
                &mut list,
                4,
                |p| bounds[p],
                |piece, buffer| {
                    // A piece uses as much of its buffer as it needs.
                    for n in bounds[piece]..bounds[piece + 1] {
                        if n % 3 > 0 {
                            buffer.push(n);
                        }
                    }
                },
            );
            assert_eq!(list, [7, 1, 2, 4, 5, 7, 8, 10, 11, 13]);
            let beyond = || {
                extend(
                    &mut Vec::new(),
                    1,
                    |p| p,
                    |_, buffer| (0..2).for_each(|n| buffer.push(n)),
                )
            };
            assert!(catch_unwind(beyond).is_err());
        });
    }

    #[test]
    fn several_slices_are_cut_where_asked() {
        let (mut one, mut two) = ([0; 7], [0; 4]);
        let shared = (cut(&mut one, 3, |p| [0, 5, 5, 6][p]), evenly(&mut two, 3));
        each_of(3, shared, |piece, (one, two)| {
            one.fill(piece + 1);
            two.fill(piece + 1);
        });
        assert_eq!((one, two), ([1, 1, 1, 1, 1, 3, 0], [1, 2, 3, 3]));
        for bounds in [[0, 5, 4], [0, 1, 8]] {
            let cuts = || _ = cut(&mut [0; 7], 2, |p| bounds[p]);
            assert!(catch_unwind(cuts).is_err());
        }
    }

    #[test]
    fn a_panic_comes_through_and_the_next_job_is_done() {
        for bad in [0, 1] {
            let caught = catch_unwind(|| each(2, |piece| assert_ne!(piece, bad)));
            assert!(caught.is_err());
            let done = AtomicU32::new(0);
            each(2, |_| {
                done.fetch_add(1, Ordering::Relaxed);
            });
            assert_eq!(done.into_inner(), 2);
        }
    }
}
