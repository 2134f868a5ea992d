//! Time that this process has spent in MPI calls that wait for other ranks, and amount of data sent.
//!
//! A clock is read before and after each blocking call. This costs some tens of nanoseconds for a call of
//! microseconds, and nothing on a single rank. The sums are those of the process. MPI calls inside HDF5 are not
//! measured.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Number of polls before the clock is read, which take some tens of microseconds.
const POLLS: u32 = 200;
/// Duration of polling and yielding before a wait sleeps \[ns\]: minimum, maximum, and increase by a wait that did
/// not sleep.
const POLLING_LIMITS: [u64; 3] = [50_000, 1_000_000, 5_000];
/// Duration of a sleep.
const SLEEP_DURATION: Duration = Duration::from_micros(50);

/// Current duration of polling and yielding before a wait sleeps \[ns\]. A wait that sleeps halves it, because on a
/// busy machine the awaited rank may need the core.
static POLLING_DURATION: AtomicU64 = AtomicU64::new(POLLING_LIMITS[1]);

/// Polls until a condition is met: first without pause, then yielding the core, finally sleeping between polls.
pub(crate) fn until(mut done: impl FnMut() -> bool) {
    for _ in 0..POLLS {
        if done() {
            return;
        }
        std::hint::spin_loop();
    }
    let begun = Instant::now();
    let patience = POLLING_DURATION.load(Ordering::Relaxed);
    let mut slept = false;
    while !done() {
        if begun.elapsed() < Duration::from_nanos(patience) {
            std::thread::yield_now();
        } else {
            slept = true;
            std::thread::sleep(SLEEP_DURATION);
        }
    }
    let [least, most, more] = POLLING_LIMITS;
    let next = if slept {
        (patience / 2).max(least)
    } else {
        (patience + more).min(most)
    };
    POLLING_DURATION.store(next, Ordering::Relaxed);
}

static MESSAGES: AtomicU64 = AtomicU64::new(0);
static COLLECTIVES: AtomicU64 = AtomicU64::new(0);
static SENT: AtomicU64 = AtomicU64::new(0);
static SENT_BYTES: AtomicU64 = AtomicU64::new(0);
static CALLS: AtomicU64 = AtomicU64::new(0);

/// Kind of call that waits for other ranks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wait {
    /// Messages from one rank to another: halos, ghosts, migration.
    Messages,
    /// Collective calls: reductions, broadcasts, gatherings, barriers.
    Collectives,
}

/// Time spent waiting since the process started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Waited {
    /// Time of messages from one rank to another: halos, ghosts, migration.
    pub messages: Duration,
    /// Time of collective calls: reductions, broadcasts, gatherings, barriers.
    pub collectives: Duration,
}

impl Waited {
    /// Returns the sum of both.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.messages + self.collectives
    }

    /// Returns the difference from the `earlier` value.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            messages: self.messages.saturating_sub(earlier.messages),
            collectives: self.collectives.saturating_sub(earlier.collectives),
        }
    }
}

impl std::ops::AddAssign for Waited {
    fn add_assign(&mut self, more: Self) {
        self.messages += more.messages;
        self.collectives += more.collectives;
    }
}

/// Returns the time that this process has waited for other ranks so far.
#[must_use]
pub fn waited() -> Waited {
    let read = |sum: &AtomicU64| Duration::from_nanos(sum.load(Ordering::Relaxed));
    Waited {
        messages: read(&MESSAGES),
        collectives: read(&COLLECTIVES),
    }
}

/// Messages, bytes and collective calls of this process since it started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of messages from one rank to another.
    pub messages: u64,
    /// Number of bytes of the messages.
    pub bytes: u64,
    /// Number of collective calls.
    pub collectives: u64,
}

impl Traffic {
    /// Returns the difference from the `earlier` value.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            messages: self.messages - earlier.messages,
            bytes: self.bytes - earlier.bytes,
            collectives: self.collectives - earlier.collectives,
        }
    }
}

/// Returns the amount of data that this process has sent to other ranks so far.
#[must_use]
pub fn traffic() -> Traffic {
    Traffic {
        messages: SENT.load(Ordering::Relaxed),
        bytes: SENT_BYTES.load(Ordering::Relaxed),
        collectives: CALLS.load(Ordering::Relaxed),
    }
}

/// Counts messages to other ranks.
pub(crate) fn sent(messages: u64, bytes: u64) {
    SENT.fetch_add(messages, Ordering::Relaxed);
    SENT_BYTES.fetch_add(bytes, Ordering::Relaxed);
}

/// Counts a collective call.
pub(crate) fn called_together() {
    CALLS.fetch_add(1, Ordering::Relaxed);
}

/// Makes a blocking call and adds its time.
pub(crate) fn timed<T>(wait: Wait, call: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = call();
    let spent = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    let sum = match wait {
        Wait::Messages => &MESSAGES,
        Wait::Collectives => &COLLECTIVES,
    };
    sum.fetch_add(spent, Ordering::Relaxed);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_adds_its_time_to_its_kind_from_any_thread() {
        let before = waited();
        let pause = Duration::from_millis(2);
        std::thread::scope(|scope| {
            for wait in [Wait::Messages, Wait::Collectives, Wait::Collectives] {
                scope.spawn(move || timed(wait, || std::thread::sleep(pause)));
            }
        });
        let spent = waited().since(&before);
        assert!(spent.messages >= pause, "{spent:?}");
        assert!(spent.collectives >= 2 * pause, "{spent:?}");
        assert_eq!(spent.total(), spent.messages + spent.collectives);
        let mut sum = spent;
        sum += spent;
        assert_eq!(sum.since(&spent), spent);
    }

    #[test]
    fn a_wait_ends_when_it_is_done_and_becomes_less_patient_by_sleeping() {
        let mut polls = 0;
        until(|| {
            polls += 1;
            polls == 50
        });
        assert_eq!(polls, 50);
        let begun = Instant::now();
        let pause = Duration::from_millis(5);
        until(|| begun.elapsed() >= pause);
        assert!(begun.elapsed() >= pause);
        assert!(POLLING_DURATION.load(Ordering::Relaxed) < POLLING_LIMITS[1]);
        for _ in 0..400 {
            let begun = Instant::now();
            until(|| begun.elapsed() >= Duration::from_micros(30));
        }
        assert!(POLLING_DURATION.load(Ordering::Relaxed) >= POLLING_LIMITS[0]);
    }
}
