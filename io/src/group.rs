//! Ranks that write one file together, and their agreement.
//!
//! A rank that leaves a joint write alone would make the others wait forever. Every step of a write therefore ends
//! in [`agree`]: all continue, or all return the error of the first failing rank.

use serde::{Serialize, de::DeserializeOwned};

use crate::error::{Error, Result};

/// Ranks that write one file together. Every method except the first three is collective.
pub trait Group {
    /// Returns the number of this rank, from 0.
    fn rank(&self) -> usize;
    /// Returns the number of ranks.
    fn size(&self) -> usize;
    /// Returns the communicator for HDF5's MPI driver; `None` makes every file go through rank 0's serial driver.
    fn raw(&self) -> Option<mpi_sys::MPI_Comm>;
    /// Returns `true` if `ok` is true on all ranks.
    fn all_ok(&self, ok: bool) -> bool;
    /// Returns the sum of `n` over the ranks before this one, and over all.
    fn offset_and_total(&self, n: u64) -> (u64, u64);
    /// Returns the bytes of all ranks, in order of rank, on every rank.
    fn gather(&self, bytes: &[u8]) -> Vec<Vec<u8>>;
    /// Waits for all ranks.
    fn barrier(&self);
    /// Handles a failure of this rank's part of a joint HDF5 call, before it tries to agree with the others: these
    /// may be waiting for it inside that call, where they receive no agreement. An MPI program reports the error
    /// and calls `MPI_Abort` here; doing nothing is correct only without MPI.
    fn give_up(&self, _error: &Error) {}
}

/// Group of one process without MPI.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone;

impl Group for Alone {
    fn rank(&self) -> usize {
        0
    }
    fn size(&self) -> usize {
        1
    }
    fn raw(&self) -> Option<mpi_sys::MPI_Comm> {
        None
    }
    fn all_ok(&self, ok: bool) -> bool {
        ok
    }
    fn offset_and_total(&self, n: u64) -> (u64, u64) {
        (0, n)
    }
    fn gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        vec![bytes.to_vec()]
    }
    fn barrier(&self) {}
}

/// Returns the result of this rank if all ranks succeeded, otherwise the first failing rank's error, which is the
/// same on all.
///
/// # Errors
/// If any rank fails: the first failing rank's error.
pub fn agree<T>(group: &dyn Group, mine: Result<T>) -> Result<T> {
    if group.all_ok(mine.is_ok()) {
        return mine;
    }
    let message = match &mine {
        Ok(_) => Vec::new(),
        Err(error) => serde_json::to_vec(error).unwrap_or_default(),
    };
    let all = group.gather(&message);
    for (rank, bytes) in all.iter().enumerate() {
        if let Ok(error) = serde_json::from_slice::<Error>(bytes) {
            return Err(if group.size() > 1 {
                error.on_rank(rank)
            } else {
                error
            });
        }
    }
    // A sound group cannot reach this point; the error is still the same on all ranks.
    Err(Error::invalid("a rank", "failed without a message"))
}

/// Runs `work` on rank 0 and returns its result on every rank.
///
/// # Errors
/// If rank 0 fails: its error, on every rank.
pub fn on_root<T: Serialize + DeserializeOwned>(
    group: &dyn Group,
    work: impl FnOnce() -> Result<T>,
) -> Result<T> {
    let mut mine = None;
    let done = if group.rank() == 0 {
        work().and_then(|value| {
            let bytes = serde_json::to_vec(&value)
                .map_err(|e| Error::invalid("rank 0's result", e.to_string()))?;
            mine = Some(value);
            Ok(bytes)
        })
    } else {
        Ok(Vec::new())
    };
    let bytes = agree(group, done)?;
    if group.size() > 1 {
        let all = group.gather(&bytes);
        if mine.is_none() {
            let sent = all.first().map_or(&[][..], Vec::as_slice);
            mine = serde_json::from_slice(sent).ok();
        }
    }
    mine.ok_or_else(|| Error::invalid("rank 0's result", "did not arrive"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alone_keeps_its_own_error_and_value() {
        assert_eq!(agree(&Alone, Ok(3)), Ok(3));
        let error = Error::invalid("a", "b");
        assert_eq!(agree::<()>(&Alone, Err(error.clone())), Err(error));
        assert_eq!(on_root(&Alone, || Ok(7_u64)), Ok(7));
    }
}
