//! The fluid of a run with its coupling: one of the combinations, chosen at the start and dispatched once per step.

use super::Flow;
use super::bounce_back::BounceBack;
use super::joint_water::JointWater;
use super::lattice::LatticeFlow;
use super::partially_saturated::PartiallySaturated;
use super::seepage::Seepage;
use base::error::Error;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::Space;
use lbm::lanes::Stored;

/// A fluid with its coupling.
pub enum Water<Sp: Space, S: Stored> {
    /// Lattice Boltzmann with moving bounce-back.
    BounceBack(Box<BounceBack<Sp, S>>),
    /// Lattice Boltzmann with partially saturated cells.
    Saturated(Box<PartiallySaturated<Sp, S>>),
    /// Darcy seepage with drag.
    Seepage(Box<Seepage<Sp>>),
    /// Water in the joints between blocks.
    Joints(Box<JointWater>),
}

impl<Sp: Space, S: Stored> Water<Sp, S> {
    /// Returns the lattice, if it is one.
    #[must_use]
    #[inline(never)]
    pub fn lattice(&self) -> Option<&dyn LatticeFlow<Sp, S>> {
        match self {
            Self::BounceBack(flow) => Some(flow.as_ref()),
            Self::Saturated(flow) => Some(flow.as_ref()),
            Self::Seepage(_) | Self::Joints(_) => None,
        }
    }

    /// Returns the lattice, to set its state.
    #[inline(never)]
    pub fn lattice_mut(&mut self) -> Option<&mut dyn LatticeFlow<Sp, S>> {
        match self {
            Self::BounceBack(flow) => Some(flow.as_mut()),
            Self::Saturated(flow) => Some(flow.as_mut()),
            Self::Seepage(_) | Self::Joints(_) => None,
        }
    }

    /// Returns the number of steps of water without grains that may be made at once
    /// ([`lbm::fluid::Fluid::at_once`]). It is equal on every rank.
    #[must_use]
    pub fn at_once(&self) -> u64 {
        match self {
            Self::BounceBack(flow) => flow.at_once(),
            Self::Saturated(_) | Self::Seepage(_) | Self::Joints(_) => 1,
        }
    }

    /// Steps of water without grains, at most [`Self::at_once`]. Collective.
    ///
    /// # Errors
    /// When a GPU fails.
    #[inline(never)]
    pub fn advance_many(&mut self, steps: u64) -> Result<(), Error> {
        match self.lattice_mut() {
            Some(flow) => flow
                .fluid_mut()
                .advance_many(steps)
                .map_err(Error::Internal),
            None => Ok(()),
        }
    }

    /// Starts or leaves out the balance of the momentum of the next step, where the water has a free surface.
    pub fn balance_surface(&mut self, wanted: bool) {
        if let Some(flow) = self.lattice_mut() {
            flow.fluid_mut().balance_surface(wanted);
        }
    }

    /// Brings the state of the water back from a GPU, if it is there ([`LatticeFlow::fetch`]).
    ///
    /// # Errors
    /// When the GPU fails.
    #[inline(never)]
    pub fn fetch(&mut self) -> Result<(), Error> {
        match self.lattice_mut() {
            Some(flow) => flow.fetch(),
            None => Ok(()),
        }
    }

    /// Returns the seepage, if it is one.
    #[must_use]
    #[inline(never)]
    pub fn seepage(&self) -> Option<&Seepage<Sp>> {
        match self {
            Self::BounceBack(_) | Self::Saturated(_) | Self::Joints(_) => None,
            Self::Seepage(flow) => Some(flow),
        }
    }

    /// Returns the seepage, to set its state.
    #[inline(never)]
    pub fn seepage_mut(&mut self) -> Option<&mut Seepage<Sp>> {
        match self {
            Self::BounceBack(_) | Self::Saturated(_) | Self::Joints(_) => None,
            Self::Seepage(flow) => Some(flow),
        }
    }

    /// Returns the water of the joints, if it is that.
    #[must_use]
    pub fn joints(&self) -> Option<&JointWater> {
        match self {
            Self::Joints(flow) => Some(flow),
            _ => None,
        }
    }

    /// Returns the water of the joints, to set its state.
    pub fn joints_mut(&mut self) -> Option<&mut JointWater> {
        match self {
            Self::Joints(flow) => Some(flow),
            _ => None,
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
            Self::Joints(flow) => flow.advance(particles, domain),
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
            Self::Joints(flow) => flow.update_bodies(particles, domain),
        }
    }
}
