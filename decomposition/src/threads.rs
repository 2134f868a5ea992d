//! Ranks as threads of one process: tests of several ranks run without MPI.
//!
//! Every pair of ranks has a channel. Messages carry a tag. Messages with the same tag arrive in the order of sending.

use crate::comm::Communicator;
use std::cell::RefCell;
use std::ffi::c_int;
use std::sync::mpsc::{Receiver, Sender, channel};

/// The tag of collective calls; patterns use tags from 0.
const COLLECTIVE: c_int = -1;

struct Letter {
    tag: c_int,
    bytes: Vec<u8>,
}

/// The ends of a rank's channels, by the other rank.
pub(crate) struct Post {
    rank: usize,
    to: Vec<Sender<Letter>>,
    from: Vec<Receiver<Letter>>,
    /// Letters that arrived before they were asked for, by sender.
    early: RefCell<Vec<Vec<Letter>>>,
}

impl Post {
    /// One for each of `size` ranks.
    fn offices(size: usize) -> Vec<Self> {
        let mut to: Vec<Vec<Sender<Letter>>> = (0..size).map(|_| Vec::new()).collect();
        let mut from: Vec<Vec<Receiver<Letter>>> = (0..size).map(|_| Vec::new()).collect();
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

    /// Sends without waiting. A rank that has ended gets nothing.
    pub(crate) fn send(&self, to: usize, tag: c_int, bytes: &[u8]) {
        let letter = Letter {
            tag,
            bytes: bytes.to_vec(),
        };
        let _ = self.to[to].send(letter);
    }

    /// The next message of a rank with this tag.
    ///
    /// # Panics
    /// If the other rank ended without sending it: a test then fails instead of waiting for ever.
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

    /// The bytes of every rank, by rank. Collective.
    pub(crate) fn all_gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.all_to_all(&vec![bytes.to_vec(); self.size()])
    }
}

/// Runs `work` on `size` ranks, each a thread with its communicator, and returns their results by rank.
///
/// ```
/// let sums = decomposition::on_threads(3, |ranks| ranks.all_reduce_sum_u64(1 + ranks.rank() as u64));
/// assert_eq!(sums, [6, 6, 6]);
/// ```
///
/// # Panics
/// If one of the ranks panics.
pub fn on_threads<T: Send>(size: usize, work: impl Fn(Communicator) -> T + Sync) -> Vec<T> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = Post::offices(size)
            .into_iter()
            .map(|post| scope.spawn(|| work(Communicator::of_thread(post))))
            .collect();
        threads
            .into_iter()
            .map(|thread| match thread.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            })
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Domain, FixedExchange, HaloBytes, HaloExchange, Slabs, exchange};

    #[test]
    fn collective_calls_agree() {
        let results = on_threads(4, |ranks| {
            let mine = ranks.rank() as u64;
            assert!((ranks.all_reduce_max_f64(-2.0 - ranks.rank() as f64) + 2.0).abs() < 1e-15);
            assert_eq!(ranks.all_reduce_min_i64(-3 - mine.cast_signed()), -6);
            assert_eq!(
                ranks.all_reduce_sum_u128(u128::MAX),
                u128::MAX.wrapping_mul(4)
            );
            assert_eq!(ranks.exclusive_scan_u64(10), (10 * mine, 40));
            assert_eq!(ranks.all_gather_u64(mine), [0, 1, 2, 3]);
            let bytes = vec![7; ranks.rank()];
            let all = ranks.all_gather_bytes(&bytes);
            assert_eq!(all[3], [7, 7, 7]);
            assert_eq!(ranks.gather_bytes(2, &bytes), (mine == 2).then_some(all));
            let mut root = bytes;
            ranks.broadcast_bytes(1, &mut root);
            assert_eq!(root, [7]);
            ranks.barrier();
            assert_eq!(
                exchange(
                    &ranks,
                    vec![((ranks.rank() + 1) % 4, vec![ranks.rank() as u8])]
                )
                .len(),
                1
            );
            let outcome = if mine == 2 { Err("late") } else { Ok(()) };
            ranks.agree(outcome).unwrap_err().to_string()
        });
        assert_eq!(results, ["rank 2: late"; 4]);
    }

    #[test]
    fn patterns_and_halos_cross_threads() {
        let bounds = vec![0, 2, 2, 5];
        on_threads(3, |ranks| {
            let slabs = Slabs::from_bounds(Axis::X, bounds.clone(), true).unwrap();
            let domain = Domain::new(ranks, slabs).unwrap();
            let rank = domain.rank();
            let mut halo = HaloExchange::new(&domain, 0, HaloBytes::symmetric(8)).unwrap();
            let others: Vec<_> = (0..3)
                .filter(|&other| other != rank)
                .map(|r| (r, 8))
                .collect();
            let mut fixed = FixedExchange::new(domain.communicator(), 3, &others, &others).unwrap();
            for round in 0..3_u64 {
                let (lower, upper) = halo.send_buffers_mut::<u64>();
                for side in [lower, upper].into_iter().flatten() {
                    side.fill(100 * round + rank as u64);
                }
                for (buffer, (other, _)) in fixed.send_buffers_mut::<u64>().zip(&others) {
                    buffer.fill((10 * rank + other) as u64);
                }
                fixed.start();
                halo.start();
                // A collective call between start and finish meets none of the messages.
                assert_eq!(domain.communicator().all_reduce_sum_u64(1), 3);
                halo.finish();
                fixed.finish();
                for (k, (other, _)) in others.iter().enumerate() {
                    assert_eq!(fixed.received::<u64>(k), [(10 * other + rank) as u64]);
                }
                let partner = 100 * round + if rank == 0 { 2 } else { 0 };
                let expected = (rank != 1).then_some([partner]);
                let (lower, upper) = halo.received::<u64>();
                assert_eq!(lower, expected.as_ref().map(<[u64; 1]>::as_slice));
                assert_eq!(upper, expected.as_ref().map(<[u64; 1]>::as_slice));
            }
        });
    }
}
