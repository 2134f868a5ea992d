//! Requests from outside: signals, a file named STOP, the walltime, the clock of checkpoints.
//!
//! | request | answer |
//! |---|---|
//! | SIGTERM, SIGINT, SIGUSR2, a file `STOP` in the output folder, `--max-walltime` reached | checkpoint, exit 75 |
//! | SIGUSR1, SIGCONT | checkpoint, go on |
//!
//! Open MPI's mpirun passes SIGUSR1 and SIGUSR2 on and ends with the ranks' exit code. SIGTERM to mpirun itself is
//! different: it sends SIGCONT, waits `odls_base_sigkill_timeout` seconds (1), sends SIGTERM, waits as long again, sends
//! SIGKILL, and ends with 1 whatever the ranks do. Hence the checkpoint at SIGCONT: it is the first word of what comes. The
//! two waits come with every end other than success, an abort or 75 included, so a longer timeout has its price.
//!
//! All ranks agree on the answer in one reduction, so that they stop at the same step.

use crate::error::Error;
use decomposition::Communicator;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What to do before the next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Request {
    /// Go on.
    None,
    /// Write a checkpoint and go on.
    Checkpoint,
    /// Write a checkpoint and stop.
    Stop,
}

/// Listens for requests.
pub struct Watch {
    stop: Arc<AtomicBool>,
    save: Arc<AtomicBool>,
    file: PathBuf,
    start: Instant,
    limit: Option<Duration>,
    every: Option<Duration>,
    saved: Instant,
    cost: Duration,
    looked: Instant,
}

impl Watch {
    /// Listens; `every` is the wall time between checkpoints, `limit` that of the whole run.
    ///
    /// # Errors
    /// When signals cannot be caught.
    pub fn new(
        folder: &Path,
        limit: Option<Duration>,
        every: Option<Duration>,
    ) -> Result<Self, Error> {
        use signal_hook::consts::{SIGCONT, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
        let (stop, save) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicBool::new(false)),
        );
        for (signal, flag) in [
            (SIGTERM, &stop),
            (SIGINT, &stop),
            (SIGUSR2, &stop),
            (SIGUSR1, &save),
            (SIGCONT, &save),
        ] {
            signal_hook::flag::register(signal, Arc::clone(flag))
                .map_err(|e| Error::Internal(format!("signal {signal} cannot be caught: {e}")))?;
        }
        let now = Instant::now();
        Ok(Self {
            stop,
            save,
            file: folder.join("STOP"),
            start: now,
            limit,
            every,
            saved: now,
            cost: Duration::ZERO,
            looked: now,
        })
    }

    /// The strongest request of any rank. Collective.
    pub fn ask(&mut self, communicator: &Communicator) -> Request {
        let mut mine = Request::None;
        if self.save.load(Ordering::Relaxed) {
            mine = Request::Checkpoint;
        }
        if communicator.rank() == 0 {
            if self
                .every
                .is_some_and(|every| self.saved.elapsed() >= every)
            {
                mine = Request::Checkpoint;
            }
            // Time for three checkpoints is kept back from the walltime: the disk may be busier then.
            let reserve = 3 * self.cost + Duration::from_secs(1);
            if self
                .limit
                .is_some_and(|limit| self.start.elapsed() + reserve >= limit)
            {
                mine = Request::Stop;
            }
            if self.looked.elapsed() >= Duration::from_millis(500) {
                self.looked = Instant::now();
                if self.file.exists() {
                    mine = Request::Stop;
                }
            }
        }
        if self.stop.load(Ordering::Relaxed) {
            mine = Request::Stop;
        }
        match communicator.all_reduce_max_u64(mine as u64) {
            0 => Request::None,
            1 => Request::Checkpoint,
            _ => Request::Stop,
        }
    }

    /// A checkpoint was written and took `cost`.
    pub fn wrote(&mut self, cost: Duration) {
        self.save.store(false, Ordering::Relaxed);
        self.saved = Instant::now();
        self.cost = self.cost.max(cost);
    }

    /// Removes the STOP file, so that the next run does not stop at once.
    pub fn forget_file(&self) {
        // Nobody else is hurt if it stays: the next run stops again and says why.
        let _ = std::fs::remove_file(&self.file);
    }

    /// Wall time since the start of the run.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }
}
