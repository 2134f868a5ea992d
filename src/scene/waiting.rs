//! What a person is told while a sample is made, which takes minutes.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// A line this often.
const EVERY: Duration = Duration::from_secs(30);

/// Tells every now and then how far a preparation is.
pub struct Waiting<'a> {
    tell: &'a dyn Fn(&str),
    last: Cell<Instant>,
}

impl<'a> Waiting<'a> {
    /// Begins; `tell` gets each line.
    #[must_use]
    pub fn new(tell: &'a dyn Fn(&str)) -> Self {
        Self {
            tell,
            last: Cell::new(Instant::now()),
        }
    }

    /// Says nothing.
    #[must_use]
    pub fn silent() -> Self {
        Self::new(&|_| {})
    }

    /// Says where the preparation is, if the last line is long enough ago.
    pub fn say(&self, text: impl FnOnce() -> String) {
        if self.last.get().elapsed() >= EVERY {
            (self.tell)(&text());
            self.last.set(Instant::now());
        }
    }
}
