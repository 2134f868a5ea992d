//! Distribution of ghosts over ranks, and the messages between owners and ghosts.

use std::ops::Range;

use base::error::Error;
use decomposition::{Domain, FixedExchange};

/// Plan of the ghosts: owned grains by the ranks that need them, and the messages that update them.
#[derive(Default)]
pub(super) struct GhostPlan {
    /// Other ranks with the indices of the owned entries that each has as ghosts, in the order of its ghosts.
    pub(super) sends: Vec<(usize, Vec<u32>)>,
    /// Other ranks with the range of ghost entries that each owns.
    pub(super) receives: Vec<(usize, Range<usize>)>,
    /// Images of owned grains through periodic faces: `(owned entry, ghost entry)`.
    pub(super) images: Vec<(u32, u32)>,
    /// Messages of a solid step with their buffer, created when the first is sent.
    pub(super) step: Option<Messages>,
    pub(super) buffer: Vec<u8>,
    /// Messages of a reduction.
    pub(super) back: Option<Messages>,
}

/// MPI tag of the messages of grains, different from the tags of other modules.
const TAG: u8 = 40;

/// Messages of fixed lengths for a plan.
pub(super) struct Messages {
    pub(super) exchange: FixedExchange,
    /// Numbers per row, in messages to owners.
    pub(super) row: usize,
}

impl Messages {
    /// Returns the messages from owners to ghosts, with `bytes` per entry.
    pub(super) fn to_ghosts(
        plan: &GhostPlan,
        bytes: usize,
        domain: &Domain,
    ) -> Result<Self, Error> {
        let [owners, ghosts] = plan.lengths(bytes);
        Self::new(&owners, &ghosts, 0, domain)
    }

    /// Returns the messages from ghosts to owners, with rows of `row` 128-bit numbers.
    pub(super) fn to_owners(plan: &GhostPlan, row: usize, domain: &Domain) -> Result<Self, Error> {
        let [owners, ghosts] = plan.lengths(row * size_of::<i128>());
        Self::new(&ghosts, &owners, row, domain)
    }

    fn new(
        sends: &[(usize, usize)],
        receives: &[(usize, usize)],
        row: usize,
        domain: &Domain,
    ) -> Result<Self, Error> {
        let exchange = FixedExchange::new(domain.communicator(), TAG, sends, receives)
            .map_err(|error| Error::Internal(error.to_string()))?;
        Ok(Self { exchange, row })
    }
}

impl GhostPlan {
    /// Returns target or source rank and length of the messages of this rank's grains, and of its ghosts, with
    /// `bytes` per entry.
    fn lengths(&self, bytes: usize) -> [Vec<(usize, usize)>; 2] {
        let owners = self.sends.iter();
        let ghosts = self.receives.iter();
        [
            owners.map(|(rank, k)| (*rank, k.len() * bytes)).collect(),
            ghosts.map(|(rank, k)| (*rank, k.len() * bytes)).collect(),
        ]
    }
}

impl std::fmt::Debug for GhostPlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GhostPlan")
            .field("sends", &self.sends)
            .field("receives", &self.receives)
            .field("images", &self.images)
            .finish_non_exhaustive()
    }
}
