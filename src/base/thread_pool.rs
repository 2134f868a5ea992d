//! A pool of threads that start work within a few microseconds.
//!
//! A solid step of some thousand grains takes tens of microseconds, and a fluid step has several regions of that size.
//! The workers of `rayon` fall asleep between two of them and take longer to wake than to work. Loops over such pieces
//! therefore use this pool, for even pieces and for those that threads take when they are free; contacts of blocks and
//! work of milliseconds use `rayon`, with the same number of threads. An idle thread polls for work for [`SPINS`]
//! iterations, yields for [`YIELDS`] more, then sleeps, so that ranks that share a core lose little.
//!
//! Each thread begins with the pieces of its own number and then takes those that no thread has begun. A caller
//! therefore waits for helpers that have begun a piece, and not for those that the system has not given a core: on a
//! machine with other work it does all pieces itself.
//!
//! The assignment of pieces to threads does not affect results: pieces are disjoint. A caller that finds the pool busy
//! with another caller's work processes its pieces itself.

use std::cell::UnsafeCell;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};
use std::thread::Thread;

/// Turns of looking for work, tens of microseconds.
const SPINS: u32 = 4000;
/// Turns of giving way to other threads after that.
const YIELDS: u32 = 200;

/// Yields of a caller that waits for a helper, before it sleeps.
const CALLER_YIELDS: u32 = 50;
/// Groups of pieces, one bit each.
const GROUPS: usize = 64;

/// Work of the pool: a function of the number of the piece.
type Work<'a> = dyn Fn(usize) + Sync + 'a;

/// A function, its pieces, and the number of threads that may do them.
#[derive(Clone, Copy)]
struct Job {
    work: *const Work<'static>,
    pieces: usize,
    threads: usize,
}

impl Job {
    /// Returns the number of groups of pieces: group g has the pieces g, g + groups, g + 2 groups ...
    fn groups(&self) -> usize {
        self.pieces.min(GROUPS)
    }
}

/// A job that helpers may join.
const OPEN: u64 = 1 << 63;
/// One job more; below it stands the number of helpers that have joined.
const NEXT: u64 = 1 << 32;

/// Returns the number of helpers that have joined the job of a state.
const fn joined(state: u64) -> u64 {
    state % NEXT
}

/// Returns the number of the job of a state.
const fn number(state: u64) -> u64 {
    (state & !OPEN) / NEXT
}

/// Shared by the caller and its helpers.
struct Board {
    /// [`OPEN`] from when a job is posted until all its pieces are begun, the number of the job, and the helpers that
    /// have joined it.
    state: AtomicU64,
    /// Written while the state is not open and no helper has joined.
    work: UnsafeCell<Option<Job>>,
    /// Groups of pieces that a thread has begun.
    begun: AtomicU64,
    failed: AtomicBool,
    /// The caller sleeps until the last helper has left.
    caller_sleeps: AtomicBool,
    caller: Mutex<Option<Thread>>,
}

// SAFETY: `work` is written by the caller alone and only while no helper has joined and none can join; what it points
// to is `Sync` and lives until the caller has closed the job and seen the last helper leave.
unsafe impl Sync for Board {}
// SAFETY: as above.
unsafe impl Send for Board {}

/// A thread besides the caller.
struct Helper {
    thread: Thread,
    sleeps: Arc<AtomicBool>,
}

struct Pool {
    board: Arc<Board>,
    helpers: Vec<Helper>,
}

static POOL: Mutex<Option<Pool>> = Mutex::new(None);

/// The most threads that work is shared out to.
pub const MOST: usize = 64;

/// Returns the best number of pieces for an even loop: the threads of this rank.
#[must_use]
pub fn threads() -> usize {
    rayon::current_num_threads().min(MOST)
}

/// Calls `work` with each number below `pieces`, by as many threads; returns when all are done.
///
/// # Panics
/// Where `work` does.
pub fn each(pieces: usize, work: impl Fn(usize) + Sync) {
    if pieces > 1 {
        let pool = match POOL.try_lock() {
            Ok(pool) => Some(pool),
            // A panic comes through only after all have finished.
            Err(TryLockError::Poisoned(pool)) => Some(pool.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        };
        if let Some(mut pool) = pool {
            return pool.get_or_insert_with(Pool::new).run(pieces, &work);
        }
    }
    (0..pieces).for_each(work);
}

/// Data that are divided among pieces: slices that were cut, one or several.
pub trait Shared: Sync {
    /// Data of one piece.
    type Share;

    /// Returns the share of a piece.
    ///
    /// # Safety
    /// Each piece calls this once.
    unsafe fn share(&self, piece: usize) -> Self::Share;
}

/// A slice that was cut into consecutive parts.
pub struct Cut<'a, T> {
    start: *mut T,
    bounds: [usize; MOST + 1],
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: parts do not overlap, and each is handed out once.
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
/// Where there are more than [`MOST`] pieces, bounds fall, or the last is beyond the slice.
pub fn cut<T>(slice: &mut [T], pieces: usize, bound: impl Fn(usize) -> usize) -> Cut<'_, T> {
    let mut bounds = [0; MOST + 1];
    for (piece, at) in bounds[..=pieces].iter_mut().enumerate() {
        *at = bound(piece);
    }
    assert!(bounds[..=pieces].is_sorted() && bounds[pieces] <= slice.len());
    // Of what is beyond the last piece there is nothing to get.
    let end = bounds[pieces];
    bounds[pieces..].fill(end);
    Cut {
        start: slice.as_mut_ptr(),
        bounds,
        slice: PhantomData,
    }
}

/// Cuts a slice into parts of about one length.
pub fn evenly<T>(slice: &mut [T], pieces: usize) -> Cut<'_, T> {
    let count = slice.len();
    cut(slice, pieces, |piece| count * piece / pieces)
}

impl<'a, T: Send> Shared for Cut<'a, T> {
    type Share = &'a mut [T];

    unsafe fn share(&self, piece: usize) -> &'a mut [T] {
        let (from, to) = (self.bounds[piece], self.bounds[piece + 1]);
        // SAFETY: within the slice; parts do not overlap, and the caller asks for each once.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(from), to - from) }
    }
}

macro_rules! several {
    ($($name:ident),*) => {
        impl<$($name: Shared),*> Shared for ($($name,)*) {
            type Share = ($($name::Share,)*);

            unsafe fn share(&self, piece: usize) -> Self::Share {
                #[expect(non_snake_case, reason = "named as their types")]
                let ($($name,)*) = self;
                // SAFETY: promised by the caller.
                unsafe { ($($name.share(piece),)*) }
            }
        }
    };
}
several!(A, B);
several!(A, B, C);
several!(A, B, C, D);

/// Does [`each`], with the data of each piece.
pub fn each_of<W: Shared>(pieces: usize, shared: W, work: impl Fn(usize, W::Share) + Sync) {
    // SAFETY: each piece is done once, and no other code accesses the shared data.
    each(pieces, |piece| work(piece, unsafe { shared.share(piece) }));
    drop(shared);
}

/// Calls `work` with each item and its place, the items shared out evenly over the threads in pieces of at least
/// `least`.
pub fn each_item<T: Send>(items: &mut [T], least: usize, work: impl Fn(usize, &mut T) + Sync) {
    let count = items.len();
    let pieces = threads().min(count / least.max(1)).max(1);
    each_of(pieces, evenly(items, pieces), |piece, share| {
        for (n, item) in (count * piece / pieces..).zip(share) {
            work(n, item);
        }
    });
}

/// Runs of consecutive items for [`each_run_of`]: for each thread about as many as there can be, or one in all where
/// there are fewer than `2 least` items.
#[must_use]
pub fn runs(items: usize, least: usize) -> usize {
    match threads().min(items / least.max(1)) {
        0 | 1 => 1,
        threads => MOST / threads * threads,
    }
}

/// Number of its runs that a thread has begun, on a cache line of its own.
#[derive(Default)]
#[repr(align(128))]
struct Begun(AtomicUsize);

/// Does [`each_of`] for pieces of uneven work: a thread does those of its own even part, equal in each call, and then
/// helps others with theirs. Most data that it reads are those that it wrote before.
pub fn each_run_of<W: Shared>(runs: usize, shared: W, work: impl Fn(usize, W::Share) + Sync) {
    let threads = threads().min(runs);
    if threads <= 1 {
        return each_of(runs, shared, work);
    }
    let begun: [Begun; MOST] = std::array::from_fn(|_| Begun::default());
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
                work(run, unsafe { shared.share(run) });
            }
        }
    });
    drop(shared);
}

/// Does [`each_item`] for items of uneven work: see [`each_run_of`].
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

/// Does [`each_item_in_runs`] for items of very uneven work, in runs of `some` of them. `rooms` has one buffer for each
/// thread.
pub fn each_item_when_free<T: Send, R: Send + Default>(
    items: &mut [T],
    some: usize,
    rooms: &mut Vec<R>,
    work: impl Fn(&mut R, &mut T) + Sync,
) {
    let some = some.max(1);
    let threads = threads().min(items.len().div_ceil(some)).max(1);
    if rooms.len() < threads {
        rooms.resize_with(threads, R::default);
    }
    let begun: [Begun; MOST] = std::array::from_fn(|_| Begun::default());
    let all = Cut {
        start: items.as_mut_ptr(),
        bounds: [0; MOST + 1],
        slice: PhantomData,
    };
    let count = items.len();
    each_item(&mut rooms[..threads], 1, |thread, room| {
        for turn in 0..threads {
            let whose = (thread + turn) % threads;
            let share = count * whose / threads..count * (whose + 1) / threads;
            loop {
                let first = share.start + begun[whose].0.fetch_add(some, Ordering::Relaxed);
                if first >= share.end {
                    break;
                }
                for n in first..(first + some).min(share.end) {
                    // SAFETY: within the slice, and no other thread has taken this number.
                    work(room, unsafe { &mut *all.item(n) });
                }
            }
        }
    });
}

/// Buffer for new items of a list: the part of one piece of the work.
pub struct Room<'a, T> {
    slice: &'a mut [MaybeUninit<T>],
    count: usize,
}

impl<T> Room<'_, T> {
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

/// Adds to a list what pieces of the work give, in the order of the pieces: piece p gives at most
/// `bound(p + 1) - bound(p)` items.
pub fn extend<T: Copy + Send>(
    list: &mut Vec<T>,
    pieces: usize,
    bound: impl Fn(usize) -> usize,
    work: impl Fn(usize, &mut Room<'_, T>) + Sync,
) {
    list.reserve_exact(bound(pieces));
    let mut counts = [0; MOST];
    let spare = list.spare_capacity_mut();
    let shared = (
        cut(spare, pieces, &bound),
        evenly(&mut counts[..pieces], pieces),
    );
    each_of(pieces, shared, |piece, (slice, count)| {
        let mut room = Room { slice, count: 0 };
        work(piece, &mut room);
        count[0] = room.count;
    });
    // Closes the gaps behind pieces that gave less.
    let mut end = 0;
    for (piece, &count) in counts[..pieces].iter().enumerate() {
        let from = bound(piece);
        if from != end {
            spare.copy_within(from..from + count, end);
        }
        end += count;
    }
    let length = list.len() + end;
    // SAFETY: each piece has written as many items as it counted, and they follow each other now.
    unsafe { list.set_len(length) };
}

impl Pool {
    fn new() -> Self {
        Self {
            board: Arc::new(Board {
                state: AtomicU64::new(0),
                work: UnsafeCell::new(None),
                begun: AtomicU64::new(0),
                failed: AtomicBool::new(false),
                caller_sleeps: AtomicBool::new(false),
                caller: Mutex::new(None),
            }),
            helpers: Vec::new(),
        }
    }

    fn run(&mut self, pieces: usize, work: &Work<'_>) {
        while self.helpers.len() + 1 < pieces.min(threads()) {
            let Some(helper) = Helper::start(&self.board, self.helpers.len() + 1) else {
                break;
            };
            self.helpers.push(helper);
        }
        let board = &*self.board;
        // SAFETY: the lifetime is restored by waiting below, whatever happens.
        let work = unsafe { std::mem::transmute::<*const Work<'_>, *const Work<'static>>(work) };
        let job = Job {
            work,
            pieces,
            threads: self.helpers.len() + 1,
        };
        // SAFETY: the last job is closed and no helper works on it.
        unsafe { *board.work.get() = Some(job) };
        board.begun.store(0, Ordering::Relaxed);
        board.failed.store(false, Ordering::Relaxed);
        let last = number(board.state.load(Ordering::Relaxed));
        board
            .state
            .store(OPEN | ((last + 1) % (OPEN / NEXT) * NEXT), Ordering::SeqCst);
        for helper in &self.helpers {
            if helper.sleeps.load(Ordering::SeqCst) {
                helper.thread.unpark();
            }
        }
        let mine = catch_unwind(AssertUnwindSafe(|| board.work_on(&job, 0)));
        board.state.fetch_and(!OPEN, Ordering::SeqCst);
        board.wait_for_helpers();
        if let Err(panic) = mine {
            resume_unwind(panic);
        }
        assert!(
            !board.failed.load(Ordering::Relaxed),
            "a helper's share of the work panicked"
        );
    }
}

impl Board {
    /// Does the pieces of a thread, then those that no other thread has begun.
    fn work_on(&self, job: &Job, thread: usize) {
        let groups = job.groups();
        let all = u64::MAX >> (GROUPS - groups);
        // SAFETY: the caller keeps the function alive until this thread has left the job.
        let work = unsafe { &*job.work };
        let take = |group: usize| {
            let bit = 1 << group;
            if self.begun.fetch_or(bit, Ordering::Relaxed) & bit == 0 {
                (group..job.pieces).step_by(groups).for_each(work);
            }
        };
        (thread..groups).step_by(job.threads).for_each(take);
        loop {
            let free = all & !self.begun.load(Ordering::Relaxed);
            if free == 0 {
                break;
            }
            take(free.trailing_zeros() as usize);
        }
    }

    /// Joins the job of a state; returns `true` unless it is closed or another one by now.
    fn join(&self, job: u64) -> bool {
        let join = |state: u64| (state & OPEN != 0 && number(state) == job).then_some(state + 1);
        self.state
            .fetch_update(Ordering::SeqCst, Ordering::SeqCst, join)
            .is_ok()
    }

    /// Leaves the job; the last helper wakes a caller that sleeps.
    fn leave(&self) {
        let before = self.state.fetch_sub(1, Ordering::SeqCst);
        if joined(before) == 1 && self.caller_sleeps.load(Ordering::SeqCst) {
            let caller = self.caller.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(caller) = &*caller {
                caller.unpark();
            }
        }
    }

    /// Waits until the last helper has left a closed job. A helper without a core gets that of a caller that sleeps.
    fn wait_for_helpers(&self) {
        let busy = || joined(self.state.load(Ordering::SeqCst)) > 0;
        let mut turns = 0;
        while busy() {
            if wait(&mut turns, CALLER_YIELDS) {
                continue;
            }
            let mut caller = self.caller.lock().unwrap_or_else(PoisonError::into_inner);
            *caller = Some(std::thread::current());
            drop(caller);
            self.caller_sleeps.store(true, Ordering::SeqCst);
            if busy() {
                std::thread::park();
            }
            self.caller_sleeps.store(false, Ordering::SeqCst);
        }
    }
}

/// Waits for one turn; returns `true` until it is time to sleep.
fn wait(turns: &mut u32, yields: u32) -> bool {
    *turns = turns.saturating_add(1);
    if *turns < SPINS {
        std::hint::spin_loop();
    } else {
        std::thread::yield_now();
    }
    *turns < SPINS + yields
}

impl Helper {
    /// Starts a helper; none if the system gives no more threads.
    fn start(board: &Arc<Board>, thread: usize) -> Option<Self> {
        let sleeps = Arc::new(AtomicBool::new(false));
        let (board, flag) = (Arc::clone(board), Arc::clone(&sleeps));
        let seen = number(board.state.load(Ordering::Relaxed));
        std::thread::Builder::new()
            .name(format!("pool {thread}"))
            .spawn(move || help(&board, &flag, thread, seen))
            .ok()
            .map(|handle| Self {
                thread: handle.thread().clone(),
                sleeps,
            })
    }
}

/// Waits for jobs for as long as the program lives.
fn help(board: &Board, sleeps: &AtomicBool, thread: usize, mut seen: u64) {
    loop {
        let mut turns = 0;
        while number(board.state.load(Ordering::SeqCst)) == seen {
            if !wait(&mut turns, YIELDS) {
                // A caller that posts a job after this flag stands wakes the sleeper; a job posted before is seen by
                // the second check.
                sleeps.store(true, Ordering::SeqCst);
                if number(board.state.load(Ordering::SeqCst)) == seen {
                    std::thread::park();
                }
                sleeps.store(false, Ordering::SeqCst);
            }
        }
        seen = number(board.state.load(Ordering::SeqCst));
        if !board.join(seen) {
            continue;
        }
        // SAFETY: the caller wrote it before it opened the job, and writes it again only after this helper has left.
        if let Some(job) = unsafe { *board.work.get() } {
            let mine = || board.work_on(&job, thread);
            if catch_unwind(AssertUnwindSafe(mine)).is_err() {
                board.failed.store(true, Ordering::Relaxed);
            }
        }
        board.leave();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicU32;
    use std::time::Duration;

    #[test]
    fn each_piece_is_done_once_and_all_before_the_call_returns() {
        for pieces in [0, 1, 2, 3, 5] {
            // Busy, giving way and asleep.
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

    /// Checks that no thread waits for a helper without a core: the caller does its pieces.
    #[test]
    fn a_caller_does_the_pieces_of_helpers_that_do_not_come() {
        let board = Board {
            state: AtomicU64::new(OPEN | NEXT),
            work: UnsafeCell::new(None),
            begun: AtomicU64::new(0),
            failed: AtomicBool::new(false),
            caller_sleeps: AtomicBool::new(false),
            caller: Mutex::new(None),
        };
        for pieces in [1, 2, 63, 64, 65, 300] {
            let done: Vec<_> = (0..pieces).map(|_| AtomicU32::new(0)).collect();
            let work = |piece: usize| {
                done[piece].fetch_add(1, Ordering::Relaxed);
            };
            let work: &Work<'_> = &work;
            // SAFETY: used within this turn only.
            let work =
                unsafe { std::mem::transmute::<*const Work<'_>, *const Work<'static>>(work) };
            let job = Job {
                work,
                pieces,
                threads: 4,
            };
            board.begun.store(0, Ordering::Relaxed);
            board.work_on(&job, 0);
            board.work_on(&job, 3);
            assert!(
                done.iter().all(|n| n.load(Ordering::Relaxed) == 1),
                "{pieces}"
            );
        }
        // A closed job and another one cannot be joined.
        assert!(board.join(1) && !board.join(2));
        assert_eq!(joined(board.state.load(Ordering::SeqCst)), 1);
        board.leave();
        board.state.fetch_and(!OPEN, Ordering::SeqCst);
        assert!(!board.join(1));
        board.wait_for_helpers();
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
            let mut rooms: Vec<Vec<usize>> = Vec::new();
            for (count, some) in [(0, 1), (1, 4), (7, 2), (1000, 8)] {
                let mut items: Vec<usize> = (0..count).collect();
                rooms.iter_mut().for_each(Vec::clear);
                each_item_when_free(&mut items, some, &mut rooms, |room, item| {
                    room.push(*item);
                    *item += 1;
                });
                assert!(items.iter().enumerate().all(|(n, item)| n + 1 == *item));
                let mut done: Vec<usize> = rooms.concat();
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
                |piece, room| {
                    // A piece takes the part of its buffer that it needs.
                    for n in bounds[piece]..bounds[piece + 1] {
                        if n % 3 > 0 {
                            room.push(n);
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
                    |_, room| (0..2).for_each(|n| room.push(n)),
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
