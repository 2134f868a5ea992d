//! The ranks of a run as the group that writes a file together, and the handling of the errors of such a write.

use base::error::Error;
use decomposition::{Communicator, RawCommunicator};
use io::group::{Group, on_root};
use serde::{Serialize, de::DeserializeOwned};

/// Exit code of a run that ends because of a file error.
const INPUT_OUTPUT: i32 = 5;

/// All ranks of a communicator as a group of [`io`], which writes outputs, tables and checkpoints.
#[derive(Clone, Copy, Debug)]
pub struct RankGroup<'a>(pub &'a Communicator);

impl Group for RankGroup<'_> {
    fn rank(&self) -> usize {
        self.0.rank()
    }
    fn size(&self) -> usize {
        self.0.size()
    }
    fn raw(&self) -> Option<RawCommunicator> {
        self.0.raw()
    }
    fn all_ok(&self, ok: bool) -> bool {
        self.0.all_true(ok)
    }
    fn offset_and_total(&self, n: u64) -> (u64, u64) {
        self.0.exclusive_scan_u64(n)
    }
    fn gather(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.0.all_gather_bytes(bytes)
    }
    fn barrier(&self) {
        self.0.barrier();
    }
    fn give_up(&self, error: &io::Error) {
        // A single rank keeps no other rank waiting, so that its error can be returned.
        if self.0.size() > 1 {
            log::error!("rank {}: {error}", self.0.rank());
            self.0.abort(INPUT_OUTPUT);
        }
    }
}

impl RankGroup<'_> {
    /// Runs `work` on rank 0 and returns its result on every rank. Collective.
    ///
    /// # Errors
    /// If the work on rank 0 fails; its error is returned on every rank.
    pub fn on_root<T: Serialize + DeserializeOwned>(
        &self,
        work: impl FnOnce() -> io::Result<T>,
    ) -> Result<T, Error> {
        self.checked(on_root(self, work))
    }

    /// Converts the result of a joint write to one of this program. A write that failed half-way leaves HDF5 in a
    /// state in which it cannot shut down; the job then ends here, on all ranks, with the exit code of a file
    /// error.
    ///
    /// # Errors
    /// If the operation failed, [`Error::Io`] with the text of the error.
    pub fn checked<T>(&self, result: io::Result<T>) -> Result<T, Error> {
        result.map_err(|error| {
            if error.must_abort() {
                log::error!("rank {}: {error}", self.0.rank());
                self.0.abort(INPUT_OUTPUT);
            }
            Error::Io(error.to_string())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rank_agrees_with_itself() {
        let communicator = Communicator::serial();
        let group = RankGroup(&communicator);
        assert_eq!((group.rank(), group.size()), (0, 1));
        assert_eq!(group.offset_and_total(7), (0, 7));
        assert_eq!(group.gather(&[1, 2]), [vec![1, 2]]);
        assert!(group.all_ok(true) && !group.all_ok(false));
        assert_eq!(group.on_root(|| Ok(5_u64)).unwrap(), 5);
        let missing = group.on_root(|| io::table::read("nowhere.csv".as_ref()).map(|_| 1_u64));
        assert!(matches!(missing, Err(Error::Io(text)) if text.contains("nowhere.csv")));
    }
}
