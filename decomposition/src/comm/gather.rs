//! Collection of the bytes or the numbers of all ranks, on one rank or on each.

use super::{Communicator, Reducible, count, length_in_memory, wait_all};
use crate::waiting::Wait;
use mpi::ffi;
use std::ffi::c_int;
use std::ptr;

impl Communicator {
    /// Returns the bytes of every rank, by rank, on rank `root`; `None` on the others.
    #[must_use]
    pub fn gather_bytes(&self, root: usize, bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
        if let Some(post) = self.post() {
            let all = post.all_gather(bytes);
            return (self.rank() == root).then_some(all);
        }
        let lengths = self.all_gather_u64(bytes.len() as u64);
        if self.rank() != root {
            let mut requests = Vec::new();
            self.post_send(bytes, root, &mut requests);
            wait_all(&mut requests);
            return None;
        }
        let mut parts: Vec<Vec<u8>> = lengths
            .iter()
            .map(|&length| vec![0; length_in_memory(length)])
            .collect();
        let mut requests = Vec::new();
        for (rank, part) in parts.iter_mut().enumerate() {
            if rank == root {
                part.copy_from_slice(bytes);
            } else {
                self.post_receive(part, rank, &mut requests);
            }
        }
        wait_all(&mut requests);
        Some(parts)
    }

    /// Returns the bytes of every rank, by rank, on every rank.
    ///
    /// Two collective calls, which take a number of rounds that grows with the logarithm of the number of ranks. Only
    /// where all parts together exceed the limit of a message, each rank broadcasts its part in turn.
    #[must_use]
    pub fn all_gather_bytes(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        if let Some(post) = self.post() {
            return post.all_gather(bytes);
        }
        let lengths = self.all_gather_u64(bytes.len() as u64);
        let total = lengths
            .iter()
            .fold(0_u64, |sum, length| sum.saturating_add(*length));
        if total <= self.message_limit as u64 {
            return self.all_gather_at_once(bytes, &lengths);
        }
        let mut parts = Vec::with_capacity(lengths.len());
        for (rank, &length) in lengths.iter().enumerate() {
            let mut part = vec![0; length_in_memory(length)];
            if rank == self.rank() {
                part.copy_from_slice(bytes);
            }
            self.broadcast(rank, &mut part);
            parts.push(part);
        }
        parts
    }

    /// Returns the bytes of every rank, whose `lengths` are known and fit in one message together.
    fn all_gather_at_once(&self, bytes: &[u8], lengths: &[u64]) -> Vec<Vec<u8>> {
        let Some(raw) = self.raw() else {
            return vec![bytes.to_vec()];
        };
        let counts: Vec<c_int> = lengths
            .iter()
            .map(|&length| count(length_in_memory(length)))
            .collect();
        let mut end = 0;
        let starts: Vec<c_int> = (counts.iter())
            .map(|length| {
                let start = end;
                end += length;
                start
            })
            .collect();
        let total: usize = lengths.iter().map(|&length| length_in_memory(length)).sum();
        // The address of an empty slice may be that of MPI_IN_PLACE: neither buffer is empty.
        let mut all = vec![0_u8; total.max(1)];
        let mine = if bytes.is_empty() { &[0] } else { bytes };
        // SAFETY: each rank passes as many bytes as `lengths` has for it; `all` is long enough for all of them.
        self.waits(Wait::Collectives, || unsafe {
            ffi::MPI_Allgatherv(
                mine.as_ptr().cast(),
                count(bytes.len()),
                ffi::RSMPI_UINT8_T,
                all.as_mut_ptr().cast(),
                counts.as_ptr(),
                starts.as_ptr(),
                ffi::RSMPI_UINT8_T,
                raw,
            )
        });
        let mut rest = all.as_slice();
        let mut part = |&length: &u64| {
            let (first, others) = rest.split_at(length_in_memory(length));
            rest = others;
            first.to_vec()
        };
        lengths.iter().map(&mut part).collect()
    }

    /// Returns one number of every rank, by rank, on every rank.
    #[must_use]
    pub fn all_gather_u64(&self, value: u64) -> Vec<u64> {
        if let Some(post) = self.post() {
            let all = post.all_gather(&value.to_le_bytes());
            let numbers = all.iter().flat_map(|bytes| bytes.as_chunks().0);
            return numbers.map(|bytes| u64::from_le_bytes(*bytes)).collect();
        }
        let mut values = vec![value; self.size()];
        if let Some(raw) = self.raw() {
            // SAFETY: one value in, `size` values out, all of the datatype.
            self.waits(Wait::Collectives, || unsafe {
                ffi::MPI_Allgather(
                    ptr::from_ref(&value).cast(),
                    1,
                    u64::datatype(),
                    values.as_mut_ptr().cast(),
                    1,
                    u64::datatype(),
                    raw,
                )
            });
        }
        values
    }
}
