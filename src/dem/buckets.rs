//! Counting sort by several threads: numbers are sorted into buckets, in each bucket in the order in which they are
//! given.
//!
//! Each thread has a range of buckets, reads all items, and sorts those of its range: the order is that of a single
//! thread, and reading takes little time compared with sorting.

use base::thread_pool;
use std::ops::Range;

/// Items to sort into buckets.
pub(super) trait Items: Sync {
    /// Calls `put` with the bucket and the index of every item whose bucket is in a range, in the order of the items.
    fn each(&self, buckets: &Range<usize>, put: impl FnMut(usize, u32));
}

/// Numbers sorted by buckets.
#[derive(Debug, Default)]
pub(super) struct Buckets {
    /// Start of each bucket in the sorted list, and the end of the last one.
    start: Vec<u32>,
    numbers: Vec<u32>,
}

impl Buckets {
    /// Sorts the items into `count` buckets on `threads` threads; thread t sorts the buckets from `bound(t)` to
    /// `bound(t + 1)`.
    pub(super) fn fill(
        &mut self,
        count: usize,
        threads: usize,
        bound: impl Fn(usize) -> usize + Sync,
        items: &impl Items,
    ) {
        self.start.clear();
        self.start.resize(count + 1, 0);
        let mut ends = [0; thread_pool::MAX_THREADS + 1];
        let shared = (
            thread_pool::cut(&mut self.start[1..], threads, &bound),
            thread_pool::evenly(&mut ends[1..=threads], threads),
        );
        thread_pool::each_of(threads, shared, |t, (start, end)| {
            let own = bound(t)..bound(t + 1);
            items.each(&own, |bucket, _| start[bucket - own.start] += 1);
            let mut before = 0;
            for start in start {
                before += std::mem::replace(start, before);
            }
            end[0] = before;
        });
        for t in 1..=threads {
            ends[t] += ends[t - 1];
        }
        self.numbers.clear();
        self.numbers.resize(ends[threads] as usize, 0);
        let shared = (
            thread_pool::cut(&mut self.start[1..], threads, &bound),
            thread_pool::cut(&mut self.numbers, threads, |t| ends[t] as usize),
        );
        thread_pool::each_of(threads, shared, |t, (start, numbers)| {
            let own = bound(t)..bound(t + 1);
            // The start of each bucket is advanced until it is the end of the bucket.
            items.each(&own, |bucket, number| {
                let at = &mut start[bucket - own.start];
                numbers[*at as usize] = number;
                *at += 1;
            });
            for end in start {
                *end += ends[t];
            }
        });
    }

    /// Removes all buckets.
    pub(super) fn clear(&mut self) {
        self.start.clear();
        self.numbers.clear();
    }

    /// Sorts the numbers within each bucket.
    pub(super) fn sort_each(&mut self, threads: usize) {
        let count = self.start.len().saturating_sub(1);
        let bound = |t: usize| count * t / threads;
        let start = &self.start;
        let numbers = thread_pool::cut(&mut self.numbers, threads, |t| start[bound(t)] as usize);
        thread_pool::each_of(threads, numbers, |t, mut numbers| {
            for bucket in bound(t)..bound(t + 1) {
                let length = (start[bucket + 1] - start[bucket]) as usize;
                let (own, rest) = numbers.split_at_mut(length);
                own.sort_unstable();
                numbers = rest;
            }
        });
    }

    /// Returns the indices of the items in a bucket.
    pub(super) fn numbers_in(&self, bucket: usize) -> &[u32] {
        &self.numbers[self.start[bucket] as usize..self.start[bucket + 1] as usize]
    }

    /// Returns the number of sorted items.
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Returns the number of items in the buckets before a bucket.
    pub(super) fn before(&self, bucket: usize) -> usize {
        self.start[bucket] as usize
    }

    /// Returns the first bucket of a thread, so that all threads have about equally many numbers.
    pub(super) fn bound(&self, thread: usize, threads: usize) -> usize {
        if thread == threads {
            return self.start.len().saturating_sub(1);
        }
        let wanted = self.numbers.len() * thread / threads;
        self.start
            .partition_point(|&before| (before as usize) < wanted)
    }
}
