//! What the grains ask of the ranks: who owns which planes of the split axis, and to carry bytes.

use std::ops::Range;

use decomposition::{Domain, FixedExchange, exchange};

use crate::error::Error;

/// The ranks of a run, cut into slabs of whole planes along one axis. Methods that return a `Result` are collective: every
/// rank calls them at the same point.
pub trait Ranks {
    /// This rank.
    fn rank(&self) -> usize;
    /// How many ranks.
    fn size(&self) -> usize;
    /// The split axis: 0, 1 or 2.
    fn axis(&self) -> usize;
    /// How many planes there are along the axis.
    fn planes(&self) -> i64;
    /// The planes of `rank`, empty where it has none.
    fn planes_of(&self, rank: usize) -> Range<i64>;
    /// The largest of all ranks' values.
    ///
    /// # Errors
    /// Where the message failed.
    fn maximum(&self, value: f64) -> Result<f64, Error>;
    /// Sends each message to its rank (never this one) and returns what the others sent here, by rising source.
    ///
    /// # Errors
    /// Where the message failed.
    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Result<Vec<(usize, Vec<u8>)>, Error>;
    /// A pattern of messages of known lengths, to be used again and again: `(rank, bytes)` of every message that leaves and
    /// of every message that arrives.
    ///
    /// # Errors
    /// Where the pattern cannot be set up.
    fn pattern(
        &self,
        sends: &[(usize, usize)],
        receives: &[(usize, usize)],
    ) -> Result<Box<dyn Pattern>, Error>;
}

/// Messages of known lengths between the same ranks.
pub trait Pattern {
    /// Sends `sends` and fills `receives`, in the order and with the lengths given when the pattern was made.
    ///
    /// # Errors
    /// Where a message failed.
    fn run(&mut self, sends: &[Vec<u8>], receives: &mut [Vec<u8>]) -> Result<(), Error>;
}

/// One rank that owns everything; needs no MPI.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone;

impl Ranks for Alone {
    fn rank(&self) -> usize {
        0
    }
    fn size(&self) -> usize {
        1
    }
    fn axis(&self) -> usize {
        0
    }
    fn planes(&self) -> i64 {
        1
    }
    fn planes_of(&self, _: usize) -> Range<i64> {
        0..1
    }
    fn maximum(&self, value: f64) -> Result<f64, Error> {
        Ok(value)
    }
    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Result<Vec<(usize, Vec<u8>)>, Error> {
        if messages.is_empty() {
            Ok(Vec::new())
        } else {
            Err(Error::Internal(
                "a message to a rank that is not there".into(),
            ))
        }
    }
    fn pattern(
        &self,
        _: &[(usize, usize)],
        _: &[(usize, usize)],
    ) -> Result<Box<dyn Pattern>, Error> {
        Ok(Box::new(Self))
    }
}

impl Pattern for Alone {
    fn run(&mut self, _: &[Vec<u8>], _: &mut [Vec<u8>]) -> Result<(), Error> {
        Ok(())
    }
}

/// Every rank's bytes, by rank.
pub(super) fn gather_all(ranks: &dyn Ranks, mine: &[u8]) -> Result<Vec<Vec<u8>>, Error> {
    let messages = (0..ranks.size())
        .filter(|&rank| rank != ranks.rank())
        .map(|rank| (rank, mine.to_vec()))
        .collect();
    let mut all = vec![Vec::new(); ranks.size()];
    if let Some(own) = all.get_mut(ranks.rank()) {
        *own = mine.to_vec();
    }
    for (rank, bytes) in ranks.exchange(messages)? {
        if let Some(slot) = all.get_mut(rank) {
            *slot = bytes;
        }
    }
    Ok(all)
}

/// Ends every rank with the same error where any rank has one. Collective.
pub(super) fn agree(ranks: &dyn Ranks, mine: Result<(), Error>) -> Result<(), Error> {
    if ranks.size() == 1 {
        return mine;
    }
    let text = mine
        .as_ref()
        .err()
        .map(ToString::to_string)
        .unwrap_or_default();
    let all = gather_all(ranks, text.as_bytes())?;
    mine?;
    match all.iter().position(|text| !text.is_empty()) {
        None => Ok(()),
        Some(rank) => Err(Error::Numerical(format!(
            "rank {rank}: {}",
            String::from_utf8_lossy(&all[rank])
        ))),
    }
}

impl Ranks for Domain {
    fn rank(&self) -> usize {
        Self::rank(self)
    }
    fn size(&self) -> usize {
        self.communicator().size()
    }
    fn axis(&self) -> usize {
        Self::axis(self).index()
    }
    fn planes(&self) -> i64 {
        whole(self.slabs().planes())
    }
    fn planes_of(&self, rank: usize) -> Range<i64> {
        let range = self.slabs().range(rank);
        whole(range.start)..whole(range.end)
    }
    fn maximum(&self, value: f64) -> Result<f64, Error> {
        Ok(self.communicator().all_reduce_max_f64(value))
    }
    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Result<Vec<(usize, Vec<u8>)>, Error> {
        Ok(exchange(self.communicator(), messages))
    }
    fn pattern(
        &self,
        sends: &[(usize, usize)],
        receives: &[(usize, usize)],
    ) -> Result<Box<dyn Pattern>, Error> {
        FixedExchange::new(self.communicator(), MOTION_TAG, sends, receives)
            .map(|fixed| Box::new(fixed) as Box<dyn Pattern>)
            .map_err(|error| Error::Internal(error.to_string()))
    }
}

/// Tells the grains' messages from those of others.
const MOTION_TAG: u8 = 40;

/// A plane's number with a sign.
#[expect(clippy::cast_possible_wrap, reason = "no axis has 2^63 planes")]
fn whole(plane: usize) -> i64 {
    plane as i64
}

impl Pattern for FixedExchange {
    fn run(&mut self, sends: &[Vec<u8>], receives: &mut [Vec<u8>]) -> Result<(), Error> {
        for (buffer, bytes) in self.send_buffers_mut::<u8>().zip(sends) {
            buffer.copy_from_slice(bytes);
        }
        self.start();
        self.finish();
        for (k, bytes) in receives.iter_mut().enumerate() {
            bytes.copy_from_slice(self.received(k));
        }
        Ok(())
    }
}
