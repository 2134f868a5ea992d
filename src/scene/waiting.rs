//! A sample that takes minutes to make: what a person is told meanwhile, and how the work is interrupted and taken up again.

use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::dem::state::Contacts;
use crate::dem::{Alone, Dem};
use crate::error::Error;
use serde_json::Value;
use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

/// A line this often.
const TELL_EVERY: Duration = Duration::from_secs(30);
/// A question to the outside this often.
const ASK_EVERY: Duration = Duration::from_millis(500);

/// What the outside asks of work that goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Request {
    /// Go on.
    None,
    /// Write a checkpoint and go on.
    Checkpoint,
    /// Write a checkpoint and stop.
    Stop,
}

/// What a sample had come to when it was saved.
#[derive(Debug)]
pub struct Reached<S: Space> {
    /// The grains.
    pub particles: Particles<S>,
    /// Their contacts, and the solid steps done.
    pub contacts: Contacts,
    /// The counters of whoever makes the sample.
    pub progress: Value,
}

/// Whom whoever makes a sample tells, asks and hands what he has.
pub trait Outside<S: Space> {
    /// Says a line.
    fn tell(&self, line: &str);

    /// How often it is asked.
    fn pause(&self) -> Duration {
        ASK_EVERY
    }

    /// What is asked for.
    fn ask(&self) -> Request;

    /// Keeps what there is so far, as requested.
    ///
    /// # Errors
    /// Where it cannot be written and the work is to stop.
    fn keep(
        &self,
        particles: &Particles<S>,
        dem: &Dem<S>,
        progress: &Value,
        request: Request,
    ) -> Result<(), Error>;
}

/// Nobody listens.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl<S: Space> Outside<S> for Nobody {
    fn tell(&self, _: &str) {}

    fn ask(&self) -> Request {
        Request::None
    }

    fn keep(&self, _: &Particles<S>, _: &Dem<S>, _: &Value, _: Request) -> Result<(), Error> {
        Ok(())
    }
}

/// Carries steps of a sample out in pieces, between which it speaks and listens.
pub struct Waiting<'a, S: Space> {
    outside: &'a dyn Outside<S>,
    reached: RefCell<Option<Reached<S>>>,
    told: Cell<Instant>,
    asked: Cell<Instant>,
    /// Steps in a piece: so many that it is shorter than the time between questions.
    piece: Cell<u64>,
}

impl<'a, S: Space> Waiting<'a, S> {
    /// Begins, or goes on from what an earlier attempt reached.
    #[must_use]
    pub fn new(outside: &'a dyn Outside<S>, reached: Option<Reached<S>>) -> Self {
        Self {
            outside,
            reached: RefCell::new(reached),
            told: Cell::new(Instant::now()),
            asked: Cell::new(Instant::now()),
            piece: Cell::new(1),
        }
    }

    /// Without an outside.
    #[must_use]
    pub fn silent() -> Self {
        Self::new(&Nobody, None)
    }

    /// What an earlier attempt reached, once.
    pub fn take_up(&self) -> Option<Reached<S>> {
        self.reached.borrow_mut().take()
    }

    /// Says where the preparation is, if the last line is long enough ago.
    pub fn say(&self, text: impl FnOnce() -> String) {
        if self.told.get().elapsed() >= TELL_EVERY {
            self.outside.tell(&text());
            self.told.set(Instant::now());
        }
    }

    /// Takes a piece of the steps that are `left`, and counts them off.
    ///
    /// # Errors
    /// As [`Dem::advance_many`].
    pub fn advance(
        &self,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        left: &mut u64,
    ) -> Result<(), Error> {
        let steps = self.piece.get().min(*left);
        let begun = Instant::now();
        dem.advance_many(particles, &Alone, steps)?;
        *left -= steps;
        let took = begun.elapsed();
        if took > ASK_EVERY {
            self.piece.set((steps / 2).max(1));
        } else if took < ASK_EVERY / 4 && steps == self.piece.get() {
            self.piece.set(2 * steps);
        }
        Ok(())
    }

    /// Asks the outside, now and then; where it wants so, what there is is kept.
    ///
    /// # Errors
    /// [`Error::Stopped`] where the outside wants an end, and that of keeping.
    pub fn listen(
        &self,
        dem: &Dem<S>,
        particles: &Particles<S>,
        progress: impl FnOnce() -> Result<Value, Error>,
    ) -> Result<(), Error> {
        if self.asked.get().elapsed() < self.outside.pause() {
            return Ok(());
        }
        let request = self.outside.ask();
        if request != Request::None {
            self.outside.keep(particles, dem, &progress()?, request)?;
        }
        self.asked.set(Instant::now());
        if request == Request::Stop {
            return Err(Error::Stopped(format!(
                "the sample is in the making, {} solid steps",
                dem.steps()
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Wants an end after so many questions.
    struct Impatient<S: Space> {
        questions: Cell<u32>,
        kept: RefCell<Option<Reached<S>>>,
    }

    impl<S: Space> Outside<S> for Impatient<S> {
        fn tell(&self, _: &str) {}

        fn pause(&self) -> Duration {
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

        fn keep(
            &self,
            particles: &Particles<S>,
            dem: &Dem<S>,
            progress: &Value,
            _: Request,
        ) -> Result<(), Error> {
            *self.kept.borrow_mut() = Some(Reached {
                particles: Particles::from_table(&particles.table())?,
                contacts: dem.contacts(),
                // As a file holds it.
                progress: serde_json::from_str(&progress.to_string()).unwrap(),
            });
            Ok(())
        }
    }

    /// What the work comes to when it is stopped again and again, and how often it was.
    pub(in crate::scene) fn interrupted<S: Space, T>(
        work: impl Fn(&Waiting<'_, S>) -> Result<T, Error>,
    ) -> (T, u32) {
        let mut reached = None;
        for stops in 0.. {
            let outside = Impatient {
                questions: Cell::new(9 + stops % 5),
                kept: RefCell::new(None),
            };
            match work(&Waiting::new(&outside, reached.take())) {
                Ok(result) => return (result, stops),
                Err(Error::Stopped(_)) => reached = outside.kept.into_inner(),
                Err(error) => panic!("{error}"),
            }
        }
        unreachable!()
    }
}
