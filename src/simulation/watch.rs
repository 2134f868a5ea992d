//! Requests to a run: signals, a file named STOP, the walltime, the interval of checkpoints.
//!
//! | request | response |
//! |---|---|
//! | SIGTERM, SIGINT, SIGHUP, SIGUSR2, a file `STOP` in the folder, `--max-walltime` | checkpoint, exit code 75 |
//! | SIGUSR1, SIGCONT | checkpoint, the run continues |
//!
//! Open MPI's `mpirun` forwards SIGUSR1 and SIGUSR2 and ends with the exit code of the ranks. After a SIGTERM `mpirun`
//! itself sends SIGCONT, waits `odls_base_sigkill_timeout` seconds (1), sends SIGTERM, waits as long again, sends
//! SIGKILL, and ends with 1 for any exit code of the ranks. The run therefore writes a checkpoint at SIGCONT, the first
//! of these signals. Both waits also occur at every end other than success, an abort or 75 included, so that a longer
//! timeout delays these ends.
//!
//! All ranks agree on the response in one reduction, so that they stop at the same step. They check for requests every
//! [`MAX_STEPS`] steps, or more often if these steps would take more than a second.
//!
//! Before the first step, geometry and checkpoints are read and mapped without such checks. If a request to stop is
//! not answered there within [`PATIENCE`] of processor time, the process ends at once: no state is lost, and the
//! exit code is that of the signal. SIGHUP remains ignored if the process was started to ignore it (`nohup`).
//!
//! A solution of the seepage may take minutes. It calls [`Watch::stop_requests`] in every iteration, and ends early if
//! a stop is requested: the checkpoint is then that of the step before it.
//!
//! Operations of the first rank alone, such as growing a sample, are watched as well: the other ranks call
//! [`answer_checks`](Watch::answer_checks), so that a request to any rank takes effect.

use base::error::Error;
use decomposition::Communicator;
use preparation::supervision::{Request, Requests};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of steps between two checks for requests.
const MAX_STEPS: u64 = 10;
/// Time between two checks \[ms\] above which the number of steps between them is halved, and below which it is
/// doubled.
const CHECK_INTERVALS: [u64; 2] = [1000, 250];
/// Time between two searches for a STOP file.
const BETWEEN_SEARCHES: Duration = Duration::from_millis(500);
/// Code by which the first rank reports that the work that it does alone is finished.
const WORK_DONE: u64 = 3;

/// Processor time after which an unanswered stop before the first step ends the process.
const PATIENCE: Duration = Duration::from_millis(1500);
/// Exit code of a process ended by a signal, minus the number of the signal.
const SIGNALLED: i32 = 128;

/// Signals received by this process.
#[derive(Debug, Default)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    save: Arc<AtomicBool>,
    /// Number of the signal that requested a stop.
    number: Arc<AtomicUsize>,
    /// Number of checks for requests so far.
    checks: AtomicU64,
    /// `true` once the first step has begun, or while a stop is being answered.
    answers: AtomicBool,
}

impl Signals {
    /// Ends the process if a stop is not answered before the first step.
    fn attend_start(&self) {
        let pause = Duration::from_millis(100);
        let mut unanswered = Unanswered::default();
        while !self.answers.load(Ordering::Relaxed) {
            std::thread::sleep(pause);
            let checks = self.checks.load(Ordering::Relaxed);
            let stop = self.stop.load(Ordering::Relaxed);
            let late = unanswered.too_long(stop, checks, processor_time());
            if late && !self.answers.load(Ordering::Relaxed) {
                let number = self.number.load(Ordering::Relaxed);
                log::warn!("signal {number} before the first step: nothing is saved");
                let number = i32::try_from(number).unwrap_or(0);
                signal_hook::low_level::exit(SIGNALLED + number);
            }
        }
    }
}

/// Request to stop that is not answered yet.
#[derive(Debug, Default)]
struct Unanswered {
    /// Processor time at the last check for requests, and the number of checks at that time.
    since: Option<(Duration, u64)>,
}

impl Unanswered {
    /// Returns `true` if no check for requests has been made for [`PATIENCE`] after a request to stop.
    fn too_long(&mut self, stop: bool, checks: u64, now: Duration) -> bool {
        let known = self.since.filter(|(_, before)| stop && *before == checks);
        self.since = stop.then(|| known.unwrap_or((now, checks)));
        self.since
            .is_some_and(|(since, _)| now.saturating_sub(since) >= PATIENCE)
    }
}

/// Returns the processor time of this process: a process that waits for a core is slow, but still answers.
pub(super) fn processor_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default()
}

/// Returns `true` if the process was started to ignore a signal.
fn started_ignoring(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    let bit = u32::try_from(signal - 1)
        .ok()
        .and_then(|n| 1_u64.checked_shl(n));
    mask.zip(bit).is_some_and(|(mask, bit)| mask & bit != 0)
}

/// Catches signals from now on; requests that arrive before the first step take effect at that step.
///
/// # Errors
///
/// If signals cannot be caught.
pub fn catch_signals() -> Result<&'static Signals, Error> {
    use signal_hook::consts::{SIGCONT, SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
    static SIGNALS: OnceLock<Signals> = OnceLock::new();
    if let Some(signals) = SIGNALS.get() {
        return Ok(signals);
    }
    let signals = Signals::default();
    for (signal, flag) in [
        (SIGTERM, &signals.stop),
        (SIGINT, &signals.stop),
        (SIGHUP, &signals.stop),
        (SIGUSR2, &signals.stop),
        (SIGUSR1, &signals.save),
        (SIGCONT, &signals.save),
    ] {
        if signal == SIGHUP && started_ignoring(signal) {
            continue;
        }
        let caught = |e| Error::Internal(format!("signal {signal} cannot be caught: {e}"));
        if Arc::ptr_eq(flag, &signals.stop) {
            let (known, number) = (Arc::clone(&signals.number), usize::try_from(signal));
            signal_hook::flag::register_usize(signal, known, number.unwrap_or(0))
                .map_err(caught)?;
        }
        signal_hook::flag::register(signal, Arc::clone(flag)).map_err(caught)?;
    }
    let signals = SIGNALS.get_or_init(|| signals);
    // Without this thread a stop takes effect at the first step.
    let _ = std::thread::Builder::new()
        .name("signals".into())
        .spawn(|| signals.attend_start());
    Ok(signals)
}

/// Source of requests to a run: signals, STOP files, walltime and checkpoint interval.
pub struct Watch {
    signals: &'static Signals,
    files: Vec<PathBuf>,
    start: Instant,
    limit: Option<Duration>,
    every: Option<Duration>,
    saved: Instant,
    /// Longest time that a checkpoint took \[ms\].
    cost: Arc<AtomicU64>,
    /// Time of the last search for a STOP file; none before the first search.
    last_search: Option<Instant>,
    asked: Instant,
    steps: u64,
}

impl Watch {
    /// Watches for requests, including a file STOP in any of the folders; `every` is the wall time between
    /// checkpoints, `limit` the wall time of the whole run, which began at `start`.
    ///
    /// # Errors
    /// If signals cannot be caught.
    pub fn new(
        folders: &[&Path],
        start: Instant,
        limit: Option<Duration>,
        every: Option<Duration>,
    ) -> Result<Self, Error> {
        let signals = catch_signals()?;
        let now = Instant::now();
        Ok(Self {
            signals,
            files: folders.iter().map(|folder| folder.join("STOP")).collect(),
            start,
            limit,
            every,
            saved: now,
            cost: Arc::default(),
            last_search: None,
            asked: now,
            steps: 1,
        })
    }

    /// Answers the checks of the first rank until it has [`finished`](Self::finish) the work that it does alone.
    /// Called on all other ranks.
    pub fn answer_checks(&mut self, communicator: &Communicator) {
        loop {
            let mine = self.mine(communicator) as u64;
            if communicator.all_reduce_max_u64(mine << 32) >> 32 == WORK_DONE {
                break;
            }
        }
        self.restart_interval();
    }

    /// Ends [`answer_checks`](Self::answer_checks) on the other ranks. Called on the first rank.
    pub fn finish(&mut self, communicator: &Communicator) {
        let _ = communicator.all_reduce_max_u64(WORK_DONE << 32);
        self.restart_interval();
    }

    /// Restarts the interval between checks, so that it is equal on all ranks.
    fn restart_interval(&mut self) {
        self.steps = 1;
        self.asked = Instant::now();
    }

    /// Notes that the first step has begun, or that a stop is being answered.
    pub fn steps_begin(&self) {
        self.signals.answers.store(true, Ordering::Relaxed);
    }

    /// Returns the request that this rank has received.
    fn mine(&mut self, communicator: &Communicator) -> Request {
        self.signals.checks.fetch_add(1, Ordering::Relaxed);
        let mut mine = Request::None;
        if self.signals.save.load(Ordering::Relaxed) {
            mine = Request::Checkpoint;
        }
        if communicator.rank() == 0 {
            if self
                .every
                .is_some_and(|every| self.saved.elapsed() >= every)
            {
                mine = Request::Checkpoint;
            }
            if self
                .limit
                .is_some_and(|limit| self.start.elapsed() + reserve(&self.cost) >= limit)
            {
                mine = Request::Stop;
            }
            if self
                .last_search
                .is_none_or(|last_search| last_search.elapsed() >= BETWEEN_SEARCHES)
            {
                self.last_search = Some(Instant::now());
                if self.files.iter().any(|file| file.exists()) {
                    mine = Request::Stop;
                }
            }
        }
        if self.signals.stop.load(Ordering::Relaxed) {
            mine = Request::Stop;
        }
        mine
    }

    /// Returns a check for requests to stop on this rank, for work that may take longer than a step should: signals,
    /// and on the first rank STOP files and the walltime.
    pub fn stop_requests(
        &self,
        communicator: &Communicator,
    ) -> Box<dyn Fn() -> bool + Send + Sync> {
        let (signals, start, cost) = (self.signals, self.start, Arc::clone(&self.cost));
        let (files, limit) = if communicator.rank() == 0 {
            (self.files.clone(), self.limit)
        } else {
            (Vec::new(), None)
        };
        let searched = Mutex::new(Instant::now());
        Box::new(move || {
            if signals.stop.load(Ordering::Relaxed)
                || limit.is_some_and(|limit| start.elapsed() + reserve(&cost) >= limit)
            {
                return true;
            }
            let mut searched = searched.lock().unwrap_or_else(PoisonError::into_inner);
            if searched.elapsed() < BETWEEN_SEARCHES {
                return false;
            }
            *searched = Instant::now();
            files.iter().any(|file| file.exists())
        })
    }

    /// Records that a checkpoint was written and took `cost`.
    pub fn record_checkpoint(&mut self, cost: Duration) {
        self.signals.save.store(false, Ordering::Relaxed);
        self.saved = Instant::now();
        let cost = u64::try_from(cost.as_millis()).unwrap_or(u64::MAX);
        self.cost.fetch_max(cost, Ordering::Relaxed);
    }

    /// Removes the STOP files, so that the next run does not stop at once.
    pub fn forget_file(&self) {
        // If a file cannot be removed, the next run stops again with a message.
        for file in &self.files {
            let _ = std::fs::remove_file(file);
        }
    }

    /// Returns the wall time since the start of the run.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }
}

/// Returns the time that is reserved before the walltime, for checkpoints that took at most `cost` \[ms\]: three of
/// them, because the disk may be busier then.
fn reserve(cost: &AtomicU64) -> Duration {
    Duration::from_millis(cost.load(Ordering::Relaxed).saturating_mul(3)) + Duration::from_secs(1)
}

impl Requests for Watch {
    fn steps(&self) -> u64 {
        self.steps
    }

    fn ask(&mut self, communicator: &Communicator) -> Request {
        let took = u64::try_from(self.asked.elapsed().as_millis())
            .unwrap_or(u64::MAX)
            .min(u64::from(u32::MAX));
        // One reduction carries request and time: the largest time counts only if no rank has a request, and is not
        // needed otherwise.
        let all = communicator.all_reduce_max_u64((self.mine(communicator) as u64) << 32 | took);
        self.asked = Instant::now();
        let (request, took) = (all >> 32, all & u64::from(u32::MAX));
        if took > CHECK_INTERVALS[0] {
            self.steps = (self.steps / 2).max(1);
        } else if took < CHECK_INTERVALS[1] {
            self.steps = (2 * self.steps).min(MAX_STEPS);
        }
        match request {
            0 => Request::None,
            1 => Request::Checkpoint,
            _ => {
                self.steps_begin();
                Request::Stop
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_that_meets_no_check_is_noticed_and_one_that_is_checked_is_not() {
        let at = Duration::from_millis;
        let mut deaf = Unanswered::default();
        let late = [(false, 0), (true, 3000), (true, 4400), (true, 4500)];
        let late = late.map(|(stop, ms)| deaf.too_long(stop, 7, at(ms)));
        assert_eq!(late, [false, false, false, true]);
        let mut hears = Unanswered::default();
        for check in 0..10 {
            assert!(!hears.too_long(true, check, at(1000 * check)));
        }
        assert!(hears.too_long(true, 9, at(10_500)));
        let mut quiet = Unanswered::default();
        assert!(!quiet.too_long(false, 0, at(0)) && !quiet.too_long(false, 0, at(60_000)));
        assert!(processor_time() > Duration::ZERO);
    }

    #[test]
    fn signals_that_are_not_ignored_are_known() {
        assert!(!started_ignoring(signal_hook::consts::SIGTERM));
        assert!(!started_ignoring(0));
    }
}
