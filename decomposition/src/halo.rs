//! Exchange of the faces of a slab with its lower and its upper neighbour.
//!
//! In a step, the caller fills the send buffers from the outermost planes, calls `start`, computes the planes that
//! need no neighbour, calls `finish`, reads the received data and computes the faces. The caller packs the bytes.
//! Only the populations that leave on a side are needed (3 of the 9 of D2Q9, 9 of the 27 of D3Q27).
//!
//! ```text
//!   lower neighbour        this slab         upper neighbour
//!   ... ------- to_upper > from_lower
//!       from_upper < to_lower  . . .  to_upper > from_lower ...
//!                               from_upper < to_lower -------
//! ```

use crate::comm::{Communicator, Disagreement};
use crate::exchange::exchange;
use crate::persistent::{Message, PatternError, Persistent};
use crate::slab::Domain;
use bytemuck::Pod;
use std::ffi::c_int;

/// Sizes in bytes of the four messages of a slab.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HaloBytes {
    /// Bytes sent to the lower neighbour: its `from_upper`.
    pub to_lower: usize,
    /// Bytes sent to the upper neighbour: its `from_lower`.
    pub to_upper: usize,
    /// Bytes received from the lower neighbour: its `to_upper`.
    pub from_lower: usize,
    /// Bytes received from the upper neighbour: its `to_lower`.
    pub from_upper: usize,
}

impl HaloBytes {
    /// Returns the same size for both directions and both sides.
    #[must_use]
    pub fn symmetric(bytes: usize) -> Self {
        Self::crossing(bytes, bytes)
    }

    /// Returns sizes for which `downwards` bytes cross every cut towards lower planes, `upwards` towards higher ones.
    #[must_use]
    pub fn crossing(downwards: usize, upwards: usize) -> Self {
        Self {
            to_lower: downwards,
            to_upper: upwards,
            from_lower: upwards,
            from_upper: downwards,
        }
    }
}

/// Persistent messages to and from the neighbours of a slab, with their buffers.
///
/// Without a neighbour on a side (a closed end, an empty slab) the data of that side are `None`. A slab that is its
/// own neighbour (periodic, single) receives its own message, and two slabs that are neighbours on both sides
/// exchange two separate messages.
pub struct HaloExchange {
    pattern: Persistent,
    has_lower: bool,
    has_upper: bool,
}

impl HaloExchange {
    /// Returns an exchange with the buffers and requests for the neighbours of this rank's slab. Collective.
    ///
    /// Simultaneous exchanges need different `tag`s. The communication buffers are initially zero.
    ///
    /// # Errors
    /// If the sizes of two neighbours do not fit together, [`Disagreement`] on all ranks.
    pub fn new(domain: &Domain, tag: u8, sizes: HaloBytes) -> Result<Self, Disagreement> {
        let communicator = domain.communicator();
        // Tags depend on the direction of the message; remainders 2 and 3 modulo 4 belong to other exchanges.
        let downwards = 4 * c_int::from(tag);
        let upwards = downwards + 1;
        let message = |partner: Option<usize>, tag, bytes| {
            partner.map(|partner| Message {
                partner,
                tag,
                bytes,
            })
        };
        let (lower, upper) = (domain.lower_neighbour(), domain.upper_neighbour());
        let sends = [
            message(lower, downwards, sizes.to_lower),
            message(upper, upwards, sizes.to_upper),
        ];
        let receives = [
            message(lower, upwards, sizes.from_lower),
            message(upper, downwards, sizes.from_upper),
        ];
        let sends: Vec<Message> = sends.into_iter().flatten().collect();
        let receives: Vec<Message> = receives.into_iter().flatten().collect();
        communicator.agree(check_sizes(communicator, &sends, &receives))?;
        let pattern = communicator.agree(Persistent::new(communicator, &sends, &receives))?;
        log::debug!(
            "rank {}: halo {tag} with lower neighbour {lower:?} and upper {upper:?}, bytes out {:?}, in {:?}",
            communicator.rank(),
            [sizes.to_lower, sizes.to_upper],
            [sizes.from_lower, sizes.from_upper]
        );
        Ok(Self {
            pattern,
            has_lower: lower.is_some(),
            has_upper: upper.is_some(),
        })
    }

    /// Returns the buffers to fill for the lower and the upper neighbour, as whole items of `T`. Waits for an
    /// unfinished exchange.
    pub fn send_buffers_mut<T: Pod>(&mut self) -> (Option<&mut [T]>, Option<&mut [T]>) {
        let (has_lower, has_upper) = (self.has_lower, self.has_upper);
        let mut buffers = self.pattern.sends_mut();
        let lower = if has_lower { buffers.next() } else { None };
        let upper = if has_upper { buffers.next() } else { None };
        (lower, upper)
    }

    /// Starts the messages and returns immediately. MPI uses the buffers until [`Self::finish`].
    pub fn start(&mut self) {
        self.pattern.start();
    }

    /// Waits until the last started messages have been sent and received.
    pub fn finish(&mut self) {
        self.pattern.finish();
    }

    /// Returns the latest data from the lower and from the upper neighbour, as whole items of `T`. Waits for an
    /// unfinished exchange.
    #[must_use]
    pub fn received<T: Pod>(&self) -> (Option<&[T]>, Option<&[T]>) {
        let lower = self.has_lower.then(|| self.pattern.received(0));
        let index = usize::from(self.has_lower);
        let upper = self.has_upper.then(|| self.pattern.received(index));
        (lower, upper)
    }
}

/// Compares the expected sizes with those that the neighbours announce. MPI would end the job at a message that is
/// too long and not report one that is too short.
fn check_sizes(
    communicator: &Communicator,
    sends: &[Message],
    receives: &[Message],
) -> Result<(), PatternError> {
    let announced = sends
        .iter()
        .map(|message| {
            let note = [message.tag.unsigned_abs().into(), message.bytes as u64];
            (
                message.partner,
                bytemuck::bytes_of::<[u64; 2]>(&note).to_vec(),
            )
        })
        .collect();
    let mut notes = Vec::new();
    for (from, bytes) in exchange(communicator, announced) {
        for note in bytes.chunks_exact(size_of::<[u64; 2]>()) {
            let [tag, bytes] = bytemuck::pod_read_unaligned::<[u64; 2]>(note);
            notes.push((from, tag, bytes));
        }
    }
    for message in receives {
        let tag = u64::from(message.tag.unsigned_abs());
        let sent = notes
            .iter()
            .find(|note| (note.0, note.1) == (message.partner, tag))
            .map_or(0, |note| note.2);
        if sent != message.bytes as u64 {
            return Err(PatternError::Mismatch {
                from: message.partner,
                to: communicator.rank(),
                sent,
                expected: message.bytes as u64,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slab::SplitAxis;

    #[test]
    fn a_slab_alone_and_periodic_is_its_own_neighbour() {
        let domain = Domain::serial(SplitAxis::Y, 4, true);
        let mut halo = HaloExchange::new(&domain, 0, HaloBytes::crossing(12, 8)).unwrap();
        for round in 0..3_u8 {
            let (lower, upper) = halo.send_buffers_mut::<f32>();
            lower
                .unwrap()
                .copy_from_slice(&[1.0, 2.0, f32::from(round)]);
            upper.unwrap().copy_from_slice(&[4.0, f32::from(round)]);
            halo.start();
            halo.finish();
            let (from_lower, from_upper) = halo.received::<f32>();
            assert_eq!(from_lower.unwrap(), [4.0, f32::from(round)]);
            assert_eq!(from_upper.unwrap(), [1.0, 2.0, f32::from(round)]);
        }
    }

    #[test]
    fn closed_ends_have_no_halo() {
        let domain = Domain::serial(SplitAxis::X, 4, false);
        let mut halo = HaloExchange::new(&domain, 0, HaloBytes::symmetric(16)).unwrap();
        assert!(matches!(halo.send_buffers_mut::<f64>(), (None, None)));
        halo.start();
        halo.finish();
        assert_eq!(halo.received::<f64>(), (None, None));
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        let domain = Domain::serial(SplitAxis::X, 4, true);
        let sizes = HaloBytes {
            to_lower: 8,
            to_upper: 8,
            from_lower: 8,
            from_upper: 16,
        };
        let error = HaloExchange::new(&domain, 0, sizes).err().unwrap();
        assert_eq!(
            error.to_string(),
            "rank 0: rank 0 sends 8 bytes to rank 0, which expects 16"
        );
    }
}
