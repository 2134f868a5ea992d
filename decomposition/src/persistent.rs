//! Messages of fixed size that are sent repeatedly: owned buffers and persistent requests.
//!
//! [`crate::HaloExchange`] and [`crate::FixedExchange`] are built on this. Requests are made once (`MPI_Send_init`,
//! `MPI_Recv_init`; MPI 3.1, section 3.9) and started together, receives first. A message to the own rank is a
//! copy. MPI uses the buffers until the messages are complete. Every access to a buffer waits first, so that no
//! order of calls causes a data race with the network.

use crate::comm::{Communicator, Direction, count};
use crate::waiting::{Wait, sent, timed, until};
use bytemuck::Pod;
use mpi::ffi::{self, MPI_Request};
use std::alloc::{self, Layout};
use std::cell::Cell;
use std::ffi::c_int;
use std::ptr::NonNull;

/// Fault in a list of messages.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PatternError {
    /// A partner does not exist.
    #[error("there is no rank {rank} among {size} ranks")]
    NoSuchRank {
        /// Requested partner.
        rank: usize,
        /// Number of ranks.
        size: usize,
    },
    /// A rank expects different data from itself than it sends to itself.
    #[error("rank {rank} sends itself {sent:?} bytes but expects {expected:?}")]
    SelfMismatch {
        /// Number of this rank.
        rank: usize,
        /// Sizes of the messages sent, in bytes.
        sent: Vec<usize>,
        /// Sizes of the messages expected, in bytes.
        expected: Vec<usize>,
    },
    /// A rank expects different data than the other rank sends.
    #[error("rank {from} sends {sent} bytes to rank {to}, which expects {expected}")]
    Mismatch {
        /// Sending rank.
        from: usize,
        /// Receiving rank.
        to: usize,
        /// Number of bytes sent.
        sent: u64,
        /// Number of bytes expected.
        expected: u64,
    },
}

/// Bytes aligned to a cache line, which MPI may read and write independently of the compiler: they are accessed
/// through a raw pointer, and borrowed as slices only while no message is active.
struct Buffer {
    start: NonNull<u8>,
    bytes: usize,
}

impl Buffer {
    const ALIGNMENT: usize = 64;

    fn layout(bytes: usize) -> Option<Layout> {
        Layout::from_size_align(bytes, Self::ALIGNMENT).ok()
    }

    fn zeroed(bytes: usize) -> Self {
        let dangling = Self {
            start: NonNull::<Line>::dangling().cast(),
            bytes: 0,
        };
        let Some(layout) = Self::layout(bytes).filter(|layout| layout.size() > 0) else {
            return dangling;
        };
        // SAFETY: the layout's size is not zero.
        let pointer = unsafe { alloc::alloc_zeroed(layout) };
        let Some(start) = NonNull::new(pointer) else {
            alloc::handle_alloc_error(layout)
        };
        Self { start, bytes }
    }

    fn slice(&self) -> &[u8] {
        // SAFETY: `bytes` initialised bytes, which MPI does not use, because the owner has waited.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.bytes) }
    }

    fn slice_mut(&mut self) -> &mut [u8] {
        // SAFETY: as above, and `&mut self` makes it the only reference.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr(), self.bytes) }
    }
}

/// Empty cache line, which gives the pointer of an empty buffer the same alignment as that of the others.
#[repr(align(64))]
struct Line;

impl Drop for Buffer {
    fn drop(&mut self) {
        if self.bytes > 0
            && let Some(layout) = Self::layout(self.bytes)
        {
            // SAFETY: allocated with this layout, freed once.
            unsafe { alloc::dealloc(self.start.as_ptr(), layout) };
        }
    }
}

/// Message with its partner, tag and length.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Message {
    pub(crate) partner: usize,
    pub(crate) tag: c_int,
    pub(crate) bytes: usize,
}

/// Fixed set of messages with their buffers. Nothing is allocated after construction.
pub(crate) struct Persistent {
    sends: Vec<Buffer>,
    receives: Vec<Buffer>,
    /// Pairs (send, receive) of messages to the own rank.
    copies: Vec<(usize, usize)>,
    requests: Box<[Cell<MPI_Request>]>,
    under_way: Cell<bool>,
    /// Messages sent and received, used if ranks are threads.
    messages: [Vec<Message>; 2],
    /// Number of messages to other ranks, and of their bytes.
    sent: (u64, u64),
    /// Keeps MPI running until the requests are freed.
    communicator: Communicator,
}

impl Persistent {
    /// Returns a set of messages with buffers and requests; not collective. Messages between the same two ranks
    /// with the same tag are matched in the order of the lists.
    pub(crate) fn new(
        communicator: &Communicator,
        sends: &[Message],
        receives: &[Message],
    ) -> Result<Self, PatternError> {
        let (rank, size) = (communicator.rank(), communicator.size());
        if let Some(message) = sends.iter().chain(receives).find(|m| m.partner >= size) {
            return Err(PatternError::NoSuchRank {
                rank: message.partner,
                size,
            });
        }
        let copies = match_own(rank, sends, receives)?;
        let make = |list: &[Message]| -> Vec<Buffer> {
            list.iter().map(|m| Buffer::zeroed(m.bytes)).collect()
        };
        let (send_buffers, receive_buffers) = (make(sends), make(receives));
        let mut requests = Vec::new();
        let lists = [
            (Direction::Receive, receives, &receive_buffers),
            (Direction::Send, sends, &send_buffers),
        ];
        for (direction, messages, buffers) in lists {
            for (message, buffer) in messages.iter().zip(buffers) {
                if message.partner != rank {
                    // SAFETY: the buffers live as long as `self`, are lent out only while no
                    // message is under way, and `drop` frees the requests before the buffers and
                    // before the communicator's handle.
                    unsafe {
                        communicator.make_persistent(
                            direction,
                            buffer.start.as_ptr(),
                            buffer.bytes,
                            message.partner,
                            message.tag,
                            &mut requests,
                        );
                    }
                }
            }
        }
        let to_others = sends.iter().filter(|message| message.partner != rank);
        Ok(Self {
            sends: send_buffers,
            receives: receive_buffers,
            copies,
            requests: requests.into_iter().map(Cell::new).collect(),
            under_way: Cell::new(false),
            messages: [sends.to_vec(), receives.to_vec()],
            sent: (
                to_others.clone().count() as u64,
                to_others.map(|message| message.bytes as u64).sum(),
            ),
            communicator: communicator.clone(),
        })
    }

    /// Returns the requests in the form that MPI takes.
    fn raw_requests(&self) -> *mut MPI_Request {
        // `Cell<T>` has the layout of `T` and may be written through a shared reference.
        self.requests.as_ptr().cast::<MPI_Request>().cast_mut()
    }

    /// Starts all messages.
    pub(crate) fn start(&mut self) {
        self.finish();
        for &(send, receive) in &self.copies {
            let source = &self.sends[send];
            self.receives[receive]
                .slice_mut()
                .copy_from_slice(source.slice());
        }
        if let Some(post) = self.communicator.post() {
            for (message, buffer) in self.messages[0].iter().zip(&self.sends) {
                if message.partner != post.rank() {
                    post.send(message.partner, message.tag, buffer.slice());
                }
            }
            self.under_way.set(true);
        }
        if !self.requests.is_empty() {
            // SAFETY: inactive persistent requests, for `finish` has waited for them.
            unsafe { ffi::MPI_Startall(count(self.requests.len()), self.raw_requests()) };
            sent(self.sent.0, self.sent.1);
            self.under_way.set(true);
        }
    }

    /// Waits until all messages have been sent and received; returns immediately if none is active.
    pub(crate) fn finish(&self) {
        if !self.under_way.replace(false) {
            return;
        }
        if let Some(post) = self.communicator.post() {
            for (message, buffer) in self.messages[1].iter().zip(&self.receives) {
                if message.partner != post.rank() {
                    let bytes = post.receive(message.partner, message.tag);
                    let count = bytes.len().min(buffer.bytes);
                    // SAFETY: the buffer has this number of bytes, and it is not borrowed while messages are
                    // active.
                    unsafe { buffer.start.as_ptr().copy_from(bytes.as_ptr(), count) };
                }
            }
        } else {
            let arrived = || {
                let mut all = 0;
                // SAFETY: live requests; persistent ones become inactive and stay valid.
                unsafe {
                    ffi::MPI_Testall(
                        count(self.requests.len()),
                        self.raw_requests(),
                        &raw mut all,
                        ffi::RSMPI_STATUSES_IGNORE,
                    )
                };
                all != 0
            };
            timed(Wait::Messages, || until(arrived));
        }
    }

    /// Returns the number of messages sent and received.
    pub(crate) fn lengths(&self) -> (usize, usize) {
        (self.sends.len(), self.receives.len())
    }

    /// Returns the buffers to fill, in the order given at construction.
    pub(crate) fn sends_mut<T: Pod>(&mut self) -> impl Iterator<Item = &mut [T]> {
        self.finish();
        self.sends
            .iter_mut()
            .map(|buffer| typed_mut(buffer.slice_mut()))
    }

    /// Returns buffer number `index` to fill.
    pub(crate) fn send_mut<T: Pod>(&mut self, index: usize) -> &mut [T] {
        self.finish();
        typed_mut(self.sends[index].slice_mut())
    }

    /// Returns the received message number `index`.
    pub(crate) fn received<T: Pod>(&self, index: usize) -> &[T] {
        self.finish();
        typed(self.receives[index].slice())
    }
}

impl Drop for Persistent {
    fn drop(&mut self) {
        // The partners have started the same messages or will start them, so that this wait ends.
        self.finish();
        for request in &mut self.requests {
            // SAFETY: made once, inactive, freed once; the communicator's handle is still held.
            unsafe { ffi::MPI_Request_free(request.as_ptr()) };
        }
    }
}

/// Pairs the messages that a rank sends to itself.
fn match_own(
    rank: usize,
    sends: &[Message],
    receives: &[Message],
) -> Result<Vec<(usize, usize)>, PatternError> {
    // The sort by tag is stable: the k-th message with a tag matches the k-th receive with that tag.
    let own = |list: &[Message]| -> Vec<(c_int, usize, usize)> {
        let mut own: Vec<_> = list
            .iter()
            .enumerate()
            .filter(|(_, message)| message.partner == rank)
            .map(|(index, message)| (message.tag, index, message.bytes))
            .collect();
        own.sort_by_key(|&(tag, index, _)| (tag, index));
        own
    };
    let (sent, expected) = (own(sends), own(receives));
    let signature = |list: &[(c_int, usize, usize)]| -> Vec<(c_int, usize)> {
        list.iter().map(|&(tag, _, bytes)| (tag, bytes)).collect()
    };
    if signature(&sent) != signature(&expected) {
        let sizes = |list: &[(c_int, usize, usize)]| list.iter().map(|m| m.2).collect();
        return Err(PatternError::SelfMismatch {
            rank,
            sent: sizes(&sent),
            expected: sizes(&expected),
        });
    }
    Ok(sent
        .iter()
        .zip(&expected)
        .map(|(s, r)| (s.1, r.1))
        .collect())
}

/// Returns `bytes` as whole items of `T`; bytes of an incomplete last item are omitted.
fn typed<T: Pod>(bytes: &[u8]) -> &[T] {
    let items = bytes.len().checked_div(size_of::<T>()).unwrap_or(0);
    bytemuck::try_cast_slice(&bytes[..items * size_of::<T>()]).unwrap_or(&[])
}

/// Returns `bytes` as mutable whole items of `T`; bytes of an incomplete last item are omitted.
fn typed_mut<T: Pod>(bytes: &mut [u8]) -> &mut [T] {
    let items = bytes.len().checked_div(size_of::<T>()).unwrap_or(0);
    bytemuck::try_cast_slice_mut(&mut bytes[..items * size_of::<T>()]).unwrap_or(&mut [])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(partner: usize, tag: c_int, bytes: usize) -> Message {
        Message {
            partner,
            tag,
            bytes,
        }
    }

    #[test]
    fn own_messages_are_matched_by_tag_then_order() {
        let sends = [message(0, 5, 8), message(0, 4, 16), message(0, 5, 24)];
        let receives = [message(0, 4, 16), message(0, 5, 8), message(0, 5, 24)];
        let mut pattern = Persistent::new(&Communicator::serial(), &sends, &receives).unwrap();
        for (index, buffer) in pattern.sends_mut::<u64>().enumerate() {
            buffer.fill(10 + index as u64);
        }
        pattern.start();
        pattern.finish();
        assert_eq!(pattern.received::<u64>(0), [11, 11]);
        assert_eq!(pattern.received::<u64>(1), [10]);
        assert_eq!(pattern.received::<u64>(2), [12, 12, 12]);
    }

    #[test]
    fn impossible_patterns_are_refused() {
        let serial = Communicator::serial();
        let stranger = Persistent::new(&serial, &[message(1, 0, 8)], &[]).err();
        assert_eq!(
            stranger,
            Some(PatternError::NoSuchRank { rank: 1, size: 1 })
        );
        let unequal = Persistent::new(&serial, &[message(0, 0, 8)], &[message(0, 0, 9)]).err();
        assert!(matches!(unequal, Some(PatternError::SelfMismatch { .. })));
        let lonely = Persistent::new(&serial, &[message(0, 0, 8)], &[]).err();
        assert!(matches!(lonely, Some(PatternError::SelfMismatch { .. })));
    }

    #[test]
    fn buffers_suit_any_plain_type() {
        let list = [message(0, 0, 40), message(0, 0, 0)];
        let mut pattern = Persistent::new(&Communicator::serial(), &list, &list).unwrap();
        assert_eq!(pattern.send_mut::<u128>(0).len(), 2);
        assert_eq!(pattern.send_mut::<f64>(0).len(), 5);
        assert_eq!(pattern.send_mut::<f32>(0).len(), 10);
        assert_eq!(pattern.send_mut::<[f64; 0]>(0).len(), 0);
        assert_eq!(pattern.send_mut::<u128>(1).len(), 0);
        assert_eq!(pattern.received::<u128>(1).len(), 0);
        assert_eq!(pattern.lengths(), (2, 2));
    }
}
