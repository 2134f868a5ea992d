//! Requests to stop within a solution, which may take minutes on a large grid.

use super::Pressure;
use crate::SeepageError;
use decomposition::Communicator;

/// Check for a request to stop on this rank; none if solutions are not interrupted.
#[derive(Default)]
pub(super) struct Interruption(Option<Box<dyn Fn() -> bool + Send + Sync>>);

impl Interruption {
    /// Checks for a request on any rank. Collective if the solutions may be interrupted.
    ///
    /// # Errors
    /// If a stop is requested ([`SeepageError::Stopped`]); on all ranks alike.
    pub(super) fn check(&self, communicator: &Communicator) -> Result<(), SeepageError> {
        let Some(requested) = &self.0 else {
            return Ok(());
        };
        if communicator.all_reduce_max_u64(u64::from(requested())) > 0 {
            return Err(SeepageError::Stopped);
        }
        Ok(())
    }
}

impl Pressure {
    /// Ends solutions early where `requested` returns `true` on some rank; every rank must set a check. It is
    /// called once in an iteration. After [`SeepageError::Stopped`] the state is that of an unfinished solution:
    /// restore an earlier one ([`Self::restore`], [`Self::restore_water`]).
    pub fn interrupt_when(&mut self, requested: Box<dyn Fn() -> bool + Send + Sync>) {
        self.interruption = Interruption(Some(requested));
    }
}
