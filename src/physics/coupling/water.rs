//! The fluid of a run with its coupling: one of the combinations, chosen at the start and dispatched once per step.

use super::Flow;
use super::bounce_back::BounceBack;
use super::lattice::LatticeFlow;
use super::partially_saturated::PartiallySaturated;
use super::seepage::Seepage;
use crate::dem::particles::Particles;
use crate::dem::space::Space;
use crate::error::Error;
use crate::lbm::lanes::Stored;
use decomposition::Domain;

/// A fluid with its coupling.
pub enum Water<Sp: Space, S: Stored> {
    /// Lattice Boltzmann with moving bounce-back.
    BounceBack(Box<BounceBack<Sp, S>>),
    /// Lattice Boltzmann with partially saturated cells.
    Saturated(Box<PartiallySaturated<Sp, S>>),
    /// Darcy seepage with drag.
    Seepage(Box<Seepage<Sp>>),
}

impl<Sp: Space, S: Stored> Water<Sp, S> {
    /// The lattice, if it is one.
    #[must_use]
    #[inline(never)]
    pub fn lattice(&self) -> Option<&dyn LatticeFlow<Sp, S>> {
        match self {
            Self::BounceBack(flow) => Some(flow.as_ref()),
            Self::Saturated(flow) => Some(flow.as_ref()),
            Self::Seepage(_) => None,
        }
    }

    /// The lattice, to set its state.
    #[inline(never)]
    pub fn lattice_mut(&mut self) -> Option<&mut dyn LatticeFlow<Sp, S>> {
        match self {
            Self::BounceBack(flow) => Some(flow.as_mut()),
            Self::Saturated(flow) => Some(flow.as_mut()),
            Self::Seepage(_) => None,
        }
    }

    /// Whether [`Self::advance_two`] may be called: nothing but walls acts on the water, and there are no grains in it. The same on every rank.
    #[must_use]
    pub fn may_advance_two(&self) -> bool {
        match self {
            Self::BounceBack(flow) => flow.may_advance_two(),
            Self::Saturated(_) | Self::Seepage(_) => false,
        }
    }

    /// Two steps of water without grains, at the cost in memory traffic of one. Collective.
    #[inline(never)]
    pub fn advance_two(&mut self) {
        if let Some(flow) = self.lattice_mut() {
            flow.fluid_mut().advance_two();
        }
    }

    /// The seepage, if it is one.
    #[must_use]
    #[inline(never)]
    pub fn seepage(&self) -> Option<&Seepage<Sp>> {
        match self {
            Self::BounceBack(_) | Self::Saturated(_) => None,
            Self::Seepage(flow) => Some(flow),
        }
    }

    /// The seepage, to set its state.
    #[inline(never)]
    pub fn seepage_mut(&mut self) -> Option<&mut Seepage<Sp>> {
        match self {
            Self::BounceBack(_) | Self::Saturated(_) => None,
            Self::Seepage(flow) => Some(flow),
        }
    }
}

impl<Sp: Space, S: Stored> Flow<Sp> for Water<Sp, S> {
    #[inline(never)]
    fn advance(&mut self, particles: &mut Particles<Sp>, domain: &Domain) -> Result<(), Error> {
        match self {
            Self::BounceBack(flow) => flow.advance(particles, domain),
            Self::Saturated(flow) => flow.advance(particles, domain),
            Self::Seepage(flow) => flow.advance(particles, domain),
        }
    }

    #[inline(never)]
    fn update_bodies(
        &mut self,
        particles: &mut Particles<Sp>,
        domain: &Domain,
    ) -> Result<(), Error> {
        match self {
            Self::BounceBack(flow) => flow.update_bodies(particles, domain),
            Self::Saturated(flow) => flow.update_bodies(particles, domain),
            Self::Seepage(flow) => flow.update_bodies(particles, domain),
        }
    }
}
