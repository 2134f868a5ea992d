//! Which rank holds ghosts of which grains, and the messages between owners and ghosts.

use std::ops::Range;

use base::error::Error;
use decomposition::{Domain, FixedExchange};

/// Plan of the ghosts: own grains by the ranks that need them, and the messages that update them.
#[derive(Default)]
pub(super) struct GhostPlan {
    /// Per target rank the own entries it holds, in the order of its ghosts; never this rank.
    pub(super) sends: Vec<(usize, Vec<u32>)>,
    /// Per source rank its range of ghost entries.
    pub(super) receives: Vec<(usize, Range<usize>)>,
    /// Own images through periodic faces: `(own entry, ghost entry)`.
    pub(super) images: Vec<(u32, u32)>,
    /// The messages of a solid step, made when the first is sent, and their buffer.
    pub(super) step: Option<Messages>,
    pub(super) buffer: Vec<u8>,
    /// The messages of a reduction.
    pub(super) back: Option<Messages>,
}

/// Tag of the messages of grains, different from those of others.
const TAG: u8 = 40;

/// Messages of fixed lengths along a plan.
pub(super) struct Messages {
    pub(super) exchange: FixedExchange,
    /// Numbers in a row, of messages to owners.
    pub(super) row: usize,
}

impl Messages {
    /// From owners to ghosts, `bytes` for each entry.
    pub(super) fn to_ghosts(
        plan: &GhostPlan,
        bytes: usize,
        domain: &Domain,
    ) -> Result<Self, Error> {
        let [owners, ghosts] = plan.lengths(bytes);
        Self::new(&owners, &ghosts, 0, domain)
    }

    /// From ghosts to owners, rows of `row` numbers of 128 bits.
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
    /// Returns the rank and length of the messages of this rank's grains, and of its ghosts, for `bytes` of each entry.
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
