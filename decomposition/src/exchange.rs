//! Messages between any ranks: once, with sizes unknown to the receiver, or repeatedly, with fixed
//! sizes.
//!
//! [`exchange()`] is used for migration and the creation of ghosts. [`FixedExchange`] transfers the motion of the
//! ghosts in every solid step until ghosts are created again.

use crate::comm::Communicator;
use crate::persistent::{Message, PatternError, Persistent};
use bytemuck::Pod;
use std::ffi::c_int;

/// Sends each `(rank, bytes)` and returns the received `(rank, bytes)` in order of the source rank. Collective,
/// also for ranks that send nothing. A rank may send to itself.
///
/// Several messages to one rank are joined in the given order; an empty message is not delivered. One number for
/// each pair of ranks is exchanged first, so that receivers need not know the senders.
///
/// # Panics
/// If a rank is not below the communicator's size.
#[must_use]
pub fn exchange(
    communicator: &Communicator,
    sends: Vec<(usize, Vec<u8>)>,
) -> Vec<(usize, Vec<u8>)> {
    let mut outgoing: Vec<Vec<u8>> = vec![Vec::new(); communicator.size()];
    for (rank, bytes) in sends {
        if outgoing[rank].is_empty() {
            outgoing[rank] = bytes;
        } else {
            outgoing[rank].extend_from_slice(&bytes);
        }
    }
    communicator
        .all_to_all_bytes(outgoing)
        .into_iter()
        .enumerate()
        .filter(|(_, bytes)| !bytes.is_empty())
        .collect()
}

/// Persistent messages of fixed sizes to and from any ranks, with their buffers. Nothing is
/// allocated after construction.
pub struct FixedExchange {
    pattern: Persistent,
}

impl FixedExchange {
    /// Returns an exchange with the buffers and requests for messages of known sizes; not collective.
    ///
    /// `sends` and `receives` list `(rank, bytes)`; every send must have its receive of the same size on the other
    /// rank, in the same order if there are several between two ranks. Simultaneous exchanges need different
    /// `tag`s.
    ///
    /// # Errors
    /// If a rank does not exist or the messages to the own rank do not match, [`PatternError`].
    pub fn new(
        communicator: &Communicator,
        tag: u8,
        sends: &[(usize, usize)],
        receives: &[(usize, usize)],
    ) -> Result<Self, PatternError> {
        // Remainders 0 and 1 modulo 4 belong to halos, 3 to sparse exchanges.
        let tag = 4 * c_int::from(tag) + 2;
        let messages = |list: &[(usize, usize)]| -> Vec<Message> {
            list.iter()
                .map(|&(partner, bytes)| Message {
                    partner,
                    tag,
                    bytes,
                })
                .collect()
        };
        let pattern = Persistent::new(communicator, &messages(sends), &messages(receives))?;
        Ok(Self { pattern })
    }

    /// Returns an exchange like [`Self::new`], but the receives are learned from the senders. Collective. Also
    /// returns the receives, `(rank, bytes)` in order of the source rank.
    ///
    /// # Errors
    /// If a rank does not exist, [`PatternError`]. Only that rank fails, before anything is sent: the caller checks
    /// ranks beforehand, or all ranks agree on the outcome.
    pub fn discover(
        communicator: &Communicator,
        tag: u8,
        sends: &[(usize, usize)],
    ) -> Result<(Self, Vec<(usize, usize)>), PatternError> {
        let size = communicator.size();
        let stranger = sends.iter().find(|send| send.0 >= size);
        // The other ranks wait in the exchange, so that this rank takes part before failing.
        let announced = sends
            .iter()
            .filter(|send| send.0 < size)
            .map(|&(rank, bytes)| (rank, bytes.to_le_bytes().to_vec()))
            .collect();
        let mut receives = Vec::new();
        for (rank, notes) in exchange(communicator, announced) {
            for note in notes.as_chunks().0 {
                receives.push((rank, usize::from_le_bytes(*note)));
            }
        }
        if let Some(&(rank, _)) = stranger {
            return Err(PatternError::NoSuchRank { rank, size });
        }
        let exchange = Self::new(communicator, tag, sends, &receives)?;
        Ok((exchange, receives))
    }

    /// Returns the number of messages sent and received.
    #[must_use]
    pub fn lengths(&self) -> (usize, usize) {
        self.pattern.lengths()
    }

    /// Returns the buffers to fill, in the order of `sends`, as whole items of `T`. Waits for an unfinished
    /// exchange.
    pub fn send_buffers_mut<T: Pod>(&mut self) -> impl Iterator<Item = &mut [T]> {
        self.pattern.sends_mut()
    }

    /// Returns the buffer of send number `index`, as whole items of `T`. Waits for an unfinished exchange.
    ///
    /// # Panics
    /// If there is no such send.
    pub fn send_buffer_mut<T: Pod>(&mut self, index: usize) -> &mut [T] {
        self.pattern.send_mut(index)
    }

    /// Starts the messages and returns immediately. MPI uses the buffers until [`Self::finish`].
    pub fn start(&mut self) {
        self.pattern.start();
    }

    /// Waits until the last started messages have been sent and received.
    pub fn finish(&mut self) {
        self.pattern.finish();
    }

    /// Returns the latest data of receive number `index`, as whole items of `T`. Waits for an unfinished exchange.
    ///
    /// # Panics
    /// If there is no such receive.
    #[must_use]
    pub fn received<T: Pod>(&self, index: usize) -> &[T] {
        self.pattern.received(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_to_oneself_come_back() {
        let serial = Communicator::serial();
        let came = exchange(
            &serial,
            vec![(0, vec![1, 2]), (0, vec![]), (0, vec![3, 4, 5])],
        );
        assert_eq!(came, [(0, vec![1, 2, 3, 4, 5])]);
        assert!(exchange(&serial, vec![]).is_empty());
    }

    #[test]
    fn fixed_messages_to_oneself_come_back() {
        let serial = Communicator::serial();
        let (mut ghosts, receives) =
            FixedExchange::discover(&serial, 1, &[(0, 16), (0, 8)]).unwrap();
        assert_eq!(receives, [(0, 16), (0, 8)]);
        for round in 0..3_u32 {
            ghosts
                .send_buffer_mut::<f64>(0)
                .copy_from_slice(&[1.5, f64::from(round)]);
            ghosts.send_buffer_mut::<f64>(1).fill(-2.0);
            ghosts.start();
            ghosts.finish();
            assert_eq!(ghosts.received::<f64>(0), [1.5, f64::from(round)]);
            assert_eq!(ghosts.received::<f64>(1), [-2.0]);
        }
    }

    #[test]
    fn a_rank_that_does_not_exist_is_refused() {
        let refused = FixedExchange::discover(&Communicator::serial(), 0, &[(3, 8)]).err();
        assert_eq!(refused, Some(PatternError::NoSuchRank { rank: 3, size: 1 }));
    }
}
