//! Protocol between a caller that posts jobs and the helpers that join them.
//!
//! One atomic word contains the state of a job: open or closed, its number, and the number of helpers that have
//! joined. A helper joins by adding one to the word of an open job, so that it cannot join a job that is closed or
//! replaced. The caller closes the job when all pieces are begun and waits until the last helper has left; only
//! then may it post the next one.
//!
//! A thread without work for some time sleeps. It first sets a flag, then checks for work once more. A thread
//! with new work first writes the work, then reads the flag. A fence between the two steps on both sides ensures
//! that at least one of them sees the other's write. The model at the end of this file runs through all orders of
//! these events:
//!
//! `RUSTFLAGS="--cfg loom" cargo test --locked -p base --lib --release board`

use super::sync::{
    Arc, AtomicBool, AtomicU64, Mutex, Ordering, Thread, TurnCell, current, fence, park, spin_loop,
    yield_now,
};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::PoisonError;

/// Number of polls for work before a thread yields, which take tens of microseconds.
const SPINS: u32 = if cfg!(loom) { 0 } else { 4000 };
/// Number of yields to other threads after polling.
const YIELDS: u32 = if cfg!(loom) { 1 } else { 200 };
/// Number of yields of a caller that waits for a helper before it sleeps.
const CALLER_YIELDS: u32 = if cfg!(loom) { 1 } else { 50 };
/// Maximum number of groups of pieces, one bit each.
const GROUPS: usize = 64;

/// Work of the pool: a function of the number of a piece.
pub(super) type Work<'a> = dyn Fn(usize) + Sync + 'a;

/// Function to be called for every piece, with the number of pieces and the number of threads that may call it.
#[derive(Clone, Copy)]
struct Job {
    work: *const Work<'static>,
    pieces: usize,
    threads: usize,
}

impl Job {
    /// Returns the number of groups of pieces: group g contains the pieces g, g + groups, g + 2 groups ...
    fn groups(&self) -> usize {
        self.pieces.min(GROUPS)
    }
}

/// Bit of a state: helpers may join the job.
const OPEN: u64 = 1 << 63;
/// Increment of the state between two jobs; the bits below it contain the number of helpers that have joined.
const NEXT: u64 = 1 << 32;

/// Returns the number of helpers that have joined the job, from a state.
const fn joined(state: u64) -> u64 {
    state % NEXT
}

/// Returns the number of the job, from a state.
const fn number(state: u64) -> u64 {
    (state & !OPEN) / NEXT
}

/// State that the caller and its helpers share.
pub(super) struct JobBoard {
    /// State of the job: [`OPEN`] from posting until all pieces are begun, the number of the job, and the number of
    /// helpers that have joined it.
    state: AtomicU64,
    /// Current job. It is written only while the state is not open and no helper has joined.
    job: TurnCell<Option<Job>>,
    /// Bits of the groups of pieces that a thread has begun.
    begun_groups: AtomicU64,
    failed: AtomicBool,
    /// `true` while the caller sleeps until the last helper has left.
    caller_sleeps: AtomicBool,
    caller: Mutex<Option<Thread>>,
}

// SAFETY: `job` is written by the caller alone and only while no helper has joined and none can join; the function
// to which it points is `Sync` and exists until the caller has closed the job and seen the last helper leave.
unsafe impl Sync for JobBoard {}
// SAFETY: as above.
unsafe impl Send for JobBoard {}

/// Thread that helps the caller.
pub(super) struct Helper {
    pub(super) thread: Thread,
    pub(super) sleeps: Arc<AtomicBool>,
}

impl Helper {
    /// Wakes the helper if it sleeps. The caller must have written the new state before a fence.
    fn wake(&self) {
        if self.sleeps.load(Ordering::Relaxed) {
            self.thread.unpark();
        }
    }
}

impl JobBoard {
    pub(super) fn new() -> Self {
        Self {
            state: AtomicU64::new(0),
            job: TurnCell::new(None),
            begun_groups: AtomicU64::new(0),
            failed: AtomicBool::new(false),
            caller_sleeps: AtomicBool::new(false),
            caller: Mutex::new(None),
        }
    }

    /// Returns the number of the last job that was posted.
    pub(super) fn last(&self) -> u64 {
        number(self.state.load(Ordering::Acquire))
    }

    /// Calls `work` with each number below `pieces` on the caller and the available helpers; returns when all
    /// pieces are done and every helper has left.
    ///
    /// # Panics
    /// If `work` does.
    pub(super) fn run(&self, pieces: usize, work: &Work<'_>, helpers: &[Helper]) {
        // SAFETY: the wait below restores the lifetime in all cases.
        let work = unsafe { std::mem::transmute::<*const Work<'_>, *const Work<'static>>(work) };
        let job = Job {
            work,
            pieces,
            threads: helpers.len() + 1,
        };
        // SAFETY: the last job is closed and no helper works on it.
        unsafe { self.job.set(Some(job)) };
        self.begun_groups.store(0, Ordering::Relaxed);
        self.failed.store(false, Ordering::Relaxed);
        let next = (self.last() + 1) % (OPEN / NEXT);
        self.state.store(OPEN | (next * NEXT), Ordering::Release);
        fence(Ordering::SeqCst);
        helpers.iter().for_each(Helper::wake);
        let mine = catch_unwind(AssertUnwindSafe(|| self.work_on(&job, 0)));
        self.state.fetch_and(!OPEN, Ordering::AcqRel);
        self.wait_for_helpers();
        if let Err(panic) = mine {
            resume_unwind(panic);
        }
        assert!(
            !self.failed.load(Ordering::Relaxed),
            "another thread panicked in its part of the work"
        );
    }

    /// Processes the pieces of a thread, then pieces that no other thread has begun.
    fn work_on(&self, job: &Job, thread: usize) {
        let groups = job.groups();
        let all = u64::MAX >> (GROUPS - groups);
        // SAFETY: the caller keeps the function alive until this thread has left the job.
        let work = unsafe { &*job.work };
        let take = |group: usize| {
            let bit = 1 << group;
            if self.begun_groups.fetch_or(bit, Ordering::Relaxed) & bit == 0 {
                (group..job.pieces).step_by(groups).for_each(work);
            }
        };
        (thread..groups).step_by(job.threads).for_each(take);
        loop {
            let free = all & !self.begun_groups.load(Ordering::Relaxed);
            if free == 0 {
                break;
            }
            take(free.trailing_zeros() as usize);
        }
    }

    /// Joins the job of a state; returns `true` unless the job has been closed or replaced meanwhile.
    fn join(&self, job: u64) -> bool {
        let join = |state: u64| (state & OPEN != 0 && number(state) == job).then_some(state + 1);
        self.state
            .fetch_update(Ordering::AcqRel, Ordering::Acquire, join)
            .is_ok()
    }

    /// Leaves the job; the last helper wakes a sleeping caller.
    fn leave(&self) {
        let before = self.state.fetch_sub(1, Ordering::AcqRel);
        fence(Ordering::SeqCst);
        if joined(before) == 1 && self.caller_sleeps.load(Ordering::Relaxed) {
            let caller = self.caller.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(caller) = &*caller {
                caller.unpark();
            }
        }
    }

    /// Waits until the last helper has left a closed job. A sleeping caller releases its core for a helper without
    /// one.
    fn wait_for_helpers(&self) {
        let busy = || joined(self.state.load(Ordering::Acquire)) > 0;
        let mut turns = 0;
        while busy() {
            if wait(&mut turns, CALLER_YIELDS) {
                continue;
            }
            let mut caller = self.caller.lock().unwrap_or_else(PoisonError::into_inner);
            *caller = Some(current());
            drop(caller);
            self.caller_sleeps.store(true, Ordering::Relaxed);
            fence(Ordering::SeqCst);
            if busy() {
                park();
            }
            self.caller_sleeps.store(false, Ordering::Relaxed);
        }
    }

    /// Waits for a job after number `seen`, joins it unless it is already closed, and processes the pieces of this
    /// thread. Returns the number of the job.
    pub(super) fn help(&self, sleeps: &AtomicBool, thread: usize, seen: u64) -> u64 {
        let mut turns = 0;
        while self.last() == seen {
            if !wait(&mut turns, YIELDS) {
                // A caller that posts a job after this flag is set wakes the sleeper; a job posted before is found
                // by the second check.
                sleeps.store(true, Ordering::Relaxed);
                fence(Ordering::SeqCst);
                if self.last() == seen {
                    park();
                }
                sleeps.store(false, Ordering::Relaxed);
            }
        }
        let seen = self.last();
        if self.join(seen) {
            // SAFETY: the caller wrote it before it opened the job, and writes again only after this helper has left.
            if let Some(job) = unsafe { self.job.get() } {
                let mine = || self.work_on(&job, thread);
                if catch_unwind(AssertUnwindSafe(mine)).is_err() {
                    self.failed.store(true, Ordering::Relaxed);
                }
            }
            self.leave();
        }
        seen
    }
}

/// Waits for one turn; returns `true` until the thread should sleep.
fn wait(turns: &mut u32, yields: u32) -> bool {
    *turns = turns.saturating_add(1);
    if *turns < SPINS {
        spin_loop();
    } else {
        yield_now();
    }
    *turns < SPINS + yields
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicU32;

    /// Checks that no thread waits for a helper without a core: the caller processes the pieces of that helper.
    #[test]
    fn a_caller_does_the_pieces_of_helpers_that_do_not_come() {
        let board = JobBoard::new();
        board.state.store(OPEN | NEXT, Ordering::Relaxed);
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
            board.begun_groups.store(0, Ordering::Relaxed);
            board.work_on(&job, 0);
            board.work_on(&job, 3);
            assert!(
                done.iter().all(|n| n.load(Ordering::Relaxed) == 1),
                "{pieces}"
            );
        }
        // A closed or replaced job cannot be joined.
        assert!(board.join(1) && !board.join(2));
        assert_eq!(joined(board.state.load(Ordering::Relaxed)), 1);
        board.leave();
        board.state.fetch_and(!OPEN, Ordering::Relaxed);
        assert!(!board.join(1));
        board.wait_for_helpers();
    }
}

/// Models that loom runs in all orders of events.
#[cfg(all(test, loom))]
mod models {
    use super::*;
    use loom::thread;

    /// Posts `jobs` jobs of `pieces` pieces to `helpers` helpers and checks that each piece has been processed once
    /// when its call returns. The pieces write cells that loom watches for races.
    fn jobs(jobs: u64, pieces: usize, helpers: usize, preemptions: usize) {
        let mut model = loom::model::Builder::new();
        model.preemption_bound = Some(preemptions);
        model.check(move || {
            let board = Arc::new(JobBoard::new());
            let helpers: Vec<_> = (1..=helpers)
                .map(|number| {
                    let sleeps = Arc::new(AtomicBool::new(false));
                    let (shared, flag) = (Arc::clone(&board), Arc::clone(&sleeps));
                    let handle = thread::spawn(move || {
                        let mut seen = 0;
                        while seen < jobs {
                            seen = shared.help(&flag, number, seen);
                        }
                    });
                    let thread = handle.thread().clone();
                    Helper { thread, sleeps }
                })
                .collect();
            for job in 1..=jobs {
                let done: Vec<_> = (0..pieces).map(|_| TurnCell::new(0)).collect();
                // SAFETY: each piece is done by one thread, which loom checks.
                let work = |piece: usize| unsafe { done[piece].set(done[piece].get() + job) };
                let shared = Shared(&work);
                board.run(pieces, &|piece| shared.call(piece), &helpers);
                // SAFETY: all helpers have left.
                assert!(done.iter().all(|cell| unsafe { cell.get() } == job));
            }
            // The model ends when all its threads have ended. A caller that joined them could be woken by a late
            // call of `unpark`, which the `join` of loom does not expect.
        });
    }

    /// Function of pieces that write their own cells.
    struct Shared<'a, F>(&'a F);
    // SAFETY: no two threads call it with the same piece, which loom checks.
    unsafe impl<F> Sync for Shared<'_, F> {}

    impl<F: Fn(usize)> Shared<'_, F> {
        fn call(&self, piece: usize) {
            (self.0)(piece);
        }
    }

    #[test]
    fn one_helper_and_two_jobs() {
        jobs(2, 2, 1, 4);
    }

    #[test]
    fn two_helpers_and_one_job() {
        jobs(1, 3, 2, 2);
    }
}
