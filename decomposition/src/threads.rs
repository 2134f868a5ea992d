//! Ranks as threads of one process: tests of several ranks run without MPI.

use crate::comm::Communicator;
use crate::post::Post;

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
    use crate::{Domain, FixedExchange, HaloBytes, HaloExchange, Slabs, SplitAxis, exchange};

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
            let next = (ranks.rank() + 1) % 4;
            let came = exchange(&ranks, vec![(next, vec![3; 1 + ranks.rank()])]);
            let last = (ranks.rank() + 3) % 4;
            assert_eq!(came, [(last, vec![3; 1 + last])]);
            let outcome = if mine == 2 { Err("late") } else { Ok(()) };
            ranks.agree(outcome).unwrap_err().to_string()
        });
        assert_eq!(results, ["rank 2: late"; 4]);
    }

    #[test]
    fn patterns_and_halos_cross_threads() {
        let bounds = vec![0, 2, 2, 5];
        on_threads(3, |ranks| {
            let slabs = Slabs::from_bounds(SplitAxis::X, bounds.clone(), true).unwrap();
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
                // A collective call between start and finish does not interfere with the messages.
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
