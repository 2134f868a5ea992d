//! Quantities known to all ranks: counts and radii of the grains of every rank, and agreement on an error.

use super::message::{Reader, Writer};
use super::particles::Particles;
use super::space::Space;
use base::error::Error;
use decomposition::{Domain, exchange};

/// Counts and radii of the grains of all ranks, exchanged when lists are built.
#[derive(Clone, Copy, Debug)]
pub(super) struct Census {
    pub(super) owned: u64,
    pub(super) added: u64,
    pub(super) removed: u64,
    pub(super) smallest: f64,
    pub(super) largest: f64,
}

/// Returns the census of every rank, in the order of ranks. Collective.
pub(super) fn census<S: Space>(
    particles: &Particles<S>,
    domain: &Domain,
) -> Result<Vec<Census>, Error> {
    let mut mine = Writer::default();
    mine.integer(particles.owned() as u64);
    mine.integer(particles.added);
    mine.integer(particles.removed);
    let radii = || {
        particles.body[..particles.owned()]
            .iter()
            .map(|body| body.radius)
    };
    mine.float(radii().fold(f64::INFINITY, f64::min));
    mine.float(radii().fold(0.0, f64::max));
    gather_all(domain, &mine.0)
        .iter()
        .map(|bytes| {
            let mut reader = Reader(bytes);
            Ok(Census {
                owned: reader.integer()?,
                added: reader.integer()?,
                removed: reader.integer()?,
                smallest: reader.float()?,
                largest: reader.float()?,
            })
        })
        .collect()
}

/// Returns the bytes of every rank, in the order of ranks. Collective.
fn gather_all(domain: &Domain, mine: &[u8]) -> Vec<Vec<u8>> {
    let (rank, size) = (domain.rank(), domain.communicator().size());
    let messages = (0..size)
        .filter(|&other| other != rank)
        .map(|other| (other, mine.to_vec()))
        .collect();
    let mut all = vec![Vec::new(); size];
    all[rank] = mine.to_vec();
    for (other, bytes) in exchange(domain.communicator(), messages) {
        all[other] = bytes;
    }
    all
}

/// Returns an error on every rank if any rank has one: its own, or that of the lowest failing rank. Collective.
pub(super) fn agree(domain: &Domain, mine: Result<(), Error>) -> Result<(), Error> {
    if domain.communicator().size() == 1 {
        return mine;
    }
    let outcome = domain.communicator().agree(mine.as_ref().copied());
    mine?;
    outcome.map_err(|error| Error::Numerical(error.to_string()))
}
