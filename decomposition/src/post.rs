//! Channels between ranks that are threads of one process.
//!
//! Every pair of ranks has a channel. Messages carry a tag. Messages with the same tag arrive in the order of sending.

use std::cell::RefCell;
use std::ffi::c_int;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Tag of collective calls; exchanges use tags from 0.
const COLLECTIVE: c_int = -1;

struct PostedMessage {
    tag: c_int,
    bytes: Vec<u8>,
}

/// Ends of a rank's channels, by the other rank.
pub(crate) struct Post {
    rank: usize,
    to: Vec<Sender<PostedMessage>>,
    from: Vec<Receiver<PostedMessage>>,
    /// Messages that arrived before they were requested, by sender.
    early: RefCell<Vec<Vec<PostedMessage>>>,
}

impl Post {
    /// Returns the channel ends of each of `size` ranks.
    pub(crate) fn offices(size: usize) -> Vec<Self> {
        let mut to: Vec<Vec<Sender<PostedMessage>>> = (0..size).map(|_| Vec::new()).collect();
        let mut from: Vec<Vec<Receiver<PostedMessage>>> = (0..size).map(|_| Vec::new()).collect();
        for senders in &mut to {
            for receivers in &mut from {
                let (sender, receiver) = channel();
                senders.push(sender);
                receivers.push(receiver);
            }
        }
        let early = || RefCell::new((0..size).map(|_| Vec::new()).collect());
        to.into_iter()
            .zip(from)
            .enumerate()
            .map(|(rank, (to, from))| Self {
                rank,
                to,
                from,
                early: early(),
            })
            .collect()
    }

    pub(crate) fn rank(&self) -> usize {
        self.rank
    }

    pub(crate) fn size(&self) -> usize {
        self.to.len()
    }

    /// Sends without waiting. A message to a rank that has ended is dropped.
    pub(crate) fn send(&self, to: usize, tag: c_int, bytes: &[u8]) {
        let letter = PostedMessage {
            tag,
            bytes: bytes.to_vec(),
        };
        let _ = self.to[to].send(letter);
    }

    /// Returns the next message of a rank with this tag.
    ///
    /// # Panics
    /// If the other rank ended without sending it: a test then fails instead of waiting for ever.
    #[expect(
        clippy::panic,
        reason = "in tests a failure is better than to wait for ever"
    )]
    pub(crate) fn receive(&self, from: usize, tag: c_int) -> Vec<u8> {
        let early = &mut self.early.borrow_mut()[from];
        if let Some(place) = early.iter().position(|letter| letter.tag == tag) {
            return early.remove(place).bytes;
        }
        loop {
            let Ok(letter) = self.from[from].recv() else {
                panic!(
                    "rank {from} ended before it sent a message to rank {}",
                    self.rank
                )
            };
            if letter.tag == tag {
                return letter.bytes;
            }
            early.push(letter);
        }
    }

    /// Sends `outgoing[r]` to each rank r and returns what each rank sent. Collective.
    pub(crate) fn all_to_all(&self, outgoing: &[Vec<u8>]) -> Vec<Vec<u8>> {
        for (rank, bytes) in outgoing.iter().enumerate() {
            self.send(rank, COLLECTIVE, bytes);
        }
        (0..self.size())
            .map(|rank| self.receive(rank, COLLECTIVE))
            .collect()
    }

    /// Returns the bytes of every rank, by rank. Collective.
    pub(crate) fn all_gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.all_to_all(&vec![bytes.to_vec(); self.size()])
    }
}
