//! Reports, interruption and resumption of the preparation of a sample, which can take minutes.

use base::error::Error;
use decomposition::Communicator;
use dem::particles::Particles;
use dem::space::Space;
use dem::state::Contacts;
use dem::{Dem, alone};
use serde_json::Value;
use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

/// Interval between reports.
const REPORT_EVERY: Duration = Duration::from_secs(30);
/// Interval between requests for instructions from the supervisor.
const ASK_EVERY: Duration = Duration::from_millis(500);

/// Request to a running operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Request {
    /// No request: the operation continues.
    None,
    /// Write a checkpoint and continue.
    Checkpoint,
    /// Write a checkpoint and stop.
    Stop,
}

/// Source of requests to work that all ranks do together.
pub trait Requests {
    /// Returns the number of steps until the next check for requests; the same on all ranks.
    fn steps(&self) -> u64;

    /// Returns the strongest request of any rank. Collective.
    fn ask(&mut self, communicator: &Communicator) -> Request;
}

/// State of an unfinished sample.
#[derive(Debug)]
pub struct SavedSample<S: Space> {
    /// Grains in their present state.
    pub particles: Particles<S>,
    /// Contacts of the grains, and the number of solid steps done.
    pub contacts: Contacts,
    /// Counters of the method of preparation.
    pub progress: Value,
}

/// Receives reports and states of an unfinished sample and may interrupt the work.
pub trait Supervisor<S: Space> {
    /// Reports a line of text.
    fn report(&self, line: &str);

    /// Returns the interval between two requests.
    fn interval(&self) -> Duration {
        ASK_EVERY
    }

    /// Returns the present request.
    fn ask(&self) -> Request;

    /// Saves the present state, as requested.
    ///
    /// # Errors
    /// If the state cannot be written and the request is to stop.
    fn save(
        &self,
        particles: &Particles<S>,
        dem: &Dem<S>,
        progress: &Value,
        request: Request,
    ) -> Result<(), Error>;
}

/// Supervisor that does nothing: no reports, no saved states, no interruptions.
#[derive(Clone, Copy, Debug)]
pub struct Unsupervised;

impl<S: Space> Supervisor<S> for Unsupervised {
    fn report(&self, _: &str) {}

    fn ask(&self) -> Request {
        Request::None
    }

    fn save(&self, _: &Particles<S>, _: &Dem<S>, _: &Value, _: Request) -> Result<(), Error> {
        Ok(())
    }
}

/// Execution of the steps of a sample in batches, with reports and requests between them.
pub struct Supervision<'a, S: Space> {
    supervisor: &'a dyn Supervisor<S>,
    saved: RefCell<Option<SavedSample<S>>>,
    reported: Cell<Instant>,
    /// Time of the last check for requests; none before the first check, which follows the first batch, so that an
    /// early stop is noticed immediately.
    last_request_check: Cell<Option<Instant>>,
    /// Number of steps of a batch, whose duration is shorter than the interval between two checks.
    batch: Cell<u64>,
}

impl<'a, S: Space> Supervision<'a, S> {
    /// Returns a supervised execution, from the start or from a saved state.
    #[must_use]
    pub fn new(supervisor: &'a dyn Supervisor<S>, saved: Option<SavedSample<S>>) -> Self {
        Self {
            supervisor,
            saved: RefCell::new(saved),
            reported: Cell::new(Instant::now()),
            last_request_check: Cell::new(None),
            batch: Cell::new(1),
        }
    }

    /// Returns a supervisor that does nothing.
    #[must_use]
    pub fn without_requests() -> Self {
        Self::new(&Unsupervised, None)
    }

    /// Returns the saved state of an earlier attempt; `None` at later calls.
    pub fn take_saved(&self) -> Option<SavedSample<S>> {
        self.saved.borrow_mut().take()
    }

    /// Reports a line, unless the last report is recent.
    pub fn report(&self, text: impl FnOnce() -> String) {
        if self.reported.get().elapsed() >= REPORT_EVERY {
            self.supervisor.report(&text());
            self.reported.set(Instant::now());
        }
    }

    /// Runs a batch of the `left` remaining steps, and subtracts its length from `left`.
    ///
    /// # Errors
    /// If [`Dem::advance_many`] fails.
    pub fn advance(
        &self,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        left: &mut u64,
    ) -> Result<(), Error> {
        let steps = self.batch.get().min(*left);
        let begun = Instant::now();
        dem.advance_many(particles, &alone(), steps)?;
        *left -= steps;
        let took = begun.elapsed();
        if took > ASK_EVERY {
            self.batch.set((steps / 2).max(1));
        } else if took < ASK_EVERY / 4 && steps == self.batch.get() {
            self.batch.set(2 * steps);
        }
        Ok(())
    }

    /// Asks the supervisor for a request if the last one is not recent, and saves the state on request.
    ///
    /// # Errors
    /// If the supervisor stops the work ([`Error::Stopped`]), or if [`Supervisor::save`] fails.
    pub fn listen(
        &self,
        dem: &Dem<S>,
        particles: &Particles<S>,
        progress: impl FnOnce() -> Result<Value, Error>,
    ) -> Result<(), Error> {
        let interval = self.supervisor.interval();
        if self
            .last_request_check
            .get()
            .is_some_and(|last_request_check| last_request_check.elapsed() < interval)
        {
            return Ok(());
        }
        let request = self.supervisor.ask();
        if request != Request::None {
            self.supervisor
                .save(particles, dem, &progress()?, request)?;
        }
        self.last_request_check.set(Some(Instant::now()));
        if request == Request::Stop {
            return Err(Error::Stopped(format!(
                "preparation of the sample: {} solid steps",
                dem.steps()
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Supervisor that stops the work after a number of requests.
    struct StopAfterRequests<S: Space> {
        questions: Cell<u32>,
        file: RefCell<Option<SavedSample<S>>>,
    }

    impl<S: Space> Supervisor<S> for StopAfterRequests<S> {
        fn report(&self, _: &str) {}

        fn interval(&self) -> Duration {
            Duration::ZERO
        }

        fn ask(&self) -> Request {
            self.questions.set(self.questions.get() - 1);
            match self.questions.get() {
                0 => Request::Stop,
                n if n % 5 == 0 => Request::Checkpoint,
                _ => Request::None,
            }
        }

        fn save(
            &self,
            particles: &Particles<S>,
            dem: &Dem<S>,
            progress: &Value,
            _: Request,
        ) -> Result<(), Error> {
            *self.file.borrow_mut() = Some(SavedSample {
                particles: Particles::from_table(&particles.table())?,
                contacts: dem.contacts(),
                // As a file holds it.
                progress: serde_json::from_str(&progress.to_string()).unwrap(),
            });
            Ok(())
        }
    }

    /// Returns the result of work that is stopped repeatedly, and the number of stops.
    pub(crate) fn interrupted<S: Space, T>(
        work: impl Fn(&Supervision<'_, S>) -> Result<T, Error>,
    ) -> (T, u32) {
        let mut saved = None;
        for stops in 0.. {
            let supervisor = StopAfterRequests {
                questions: Cell::new(9 + stops % 5),
                file: RefCell::new(None),
            };
            match work(&Supervision::new(&supervisor, saved.take())) {
                Ok(result) => return (result, stops),
                Err(Error::Stopped(_)) => saved = supervisor.file.into_inner(),
                Err(error) => panic!("{error}"),
            }
        }
        unreachable!()
    }
}
