//! Fluid of a run with its coupling: one of the combinations, chosen at the start and dispatched once per step.

use super::Flow;
use super::bounce_back::BounceBack;
use super::joint_water::JointWater;
use super::jointed::Jointed;
use super::lattice::LatticeFlow;
use super::partially_saturated::PartiallySaturated;
use super::seepage::Seepage;
use base::error::Error;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::Space;
use lbm::lanes::Stored;

/// Fluid with its coupling.
pub enum Water<Sp: Space, S: Stored> {
    /// Lattice Boltzmann with moving bounce-back.
    BounceBack(Box<BounceBack<Sp, S>>),
    /// Lattice Boltzmann with partially saturated cells.
    Saturated(Box<PartiallySaturated<Sp, S>>),
    /// Darcy seepage with drag.
    Seepage(Box<Seepage<Sp>>),
    /// Water in the joints between blocks.
    Joints(Box<JointWater>),
    /// Lattice Boltzmann with moving bounce-back, and water in the joints between blocks.
    Jointed(Box<Jointed<Sp, S>>),
}

impl<Sp: Space, S: Stored> Water<Sp, S> {
    /// Returns the lattice, if it is one.
    #[must_use]
    #[inline(never)]
    pub fn lattice(&self) -> Option<&dyn LatticeFlow<Sp, S>> {
        match self {
            Self::BounceBack(flow) => Some(flow.as_ref()),
            Self::Saturated(flow) => Some(flow.as_ref()),
            Self::Jointed(flow) => Some(flow.lattice()),
            Self::Seepage(_) | Self::Joints(_) => None,
        }
    }

    /// Returns the lattice for changes of its state.
    #[inline(never)]
    pub fn lattice_mut(&mut self) -> Option<&mut dyn LatticeFlow<Sp, S>> {
        match self {
            Self::BounceBack(flow) => Some(flow.as_mut()),
            Self::Saturated(flow) => Some(flow.as_mut()),
            Self::Jointed(flow) => Some(flow.lattice_mut()),
            Self::Seepage(_) | Self::Joints(_) => None,
        }
    }

    /// Returns the water with joints under its lattice; a coupling that has none is returned as it is.
    #[must_use]
    pub fn with_joints(self, joints: JointWater) -> Self {
        match self {
            Self::BounceBack(lattice) => Self::Jointed(Box::new(Jointed::new(*lattice, joints))),
            other => other,
        }
    }

    /// Returns the number of steps of the fluid without grains that may be made at once
    /// ([`lbm::fluid::Fluid::at_once`]). It is equal on every rank.
    #[must_use]
    pub fn at_once(&self) -> u64 {
        match self {
            Self::BounceBack(flow) => flow.at_once(),
            Self::Saturated(_) | Self::Seepage(_) | Self::Joints(_) | Self::Jointed(_) => 1,
        }
    }

    /// Makes steps of the fluid without grains, at most [`Self::at_once`]. Collective.
    ///
    /// # Errors
    /// If a GPU fails.
    #[inline(never)]
    pub fn advance_many(&mut self, steps: u64) -> Result<(), Error> {
        match self.lattice_mut() {
            Some(flow) => Ok(flow.fluid_mut().advance_many(steps)?),
            None => Ok(()),
        }
    }

    /// Starts or leaves out the balance of the momentum of the next step, where the water has a free surface.
    pub fn balance_surface(&mut self, wanted: bool) {
        if let Some(flow) = self.lattice_mut() {
            flow.fluid_mut().balance_surface(wanted);
        }
    }

    /// Copies the state of the fluid from a GPU, if it is there ([`LatticeFlow::fetch`]).
    ///
    /// # Errors
    /// If the GPU fails.
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
            Self::BounceBack(_) | Self::Saturated(_) | Self::Joints(_) | Self::Jointed(_) => None,
            Self::Seepage(flow) => Some(flow),
        }
    }

    /// Returns the seepage for changes of its state.
    #[inline(never)]
    pub fn seepage_mut(&mut self) -> Option<&mut Seepage<Sp>> {
        match self {
            Self::BounceBack(_) | Self::Saturated(_) | Self::Joints(_) | Self::Jointed(_) => None,
            Self::Seepage(flow) => Some(flow),
        }
    }

    /// Returns the water in joints, if it is the fluid.
    #[must_use]
    pub fn joints(&self) -> Option<&JointWater> {
        match self {
            Self::Joints(flow) => Some(flow),
            Self::Jointed(flow) => Some(flow.joints()),
            _ => None,
        }
    }

    /// Returns the water of joints that moves its blocks, if it is that.
    pub fn carrier(&mut self) -> Option<&mut JointWater> {
        self.joints_mut().filter(|joints| joints.moves_blocks())
    }

    /// Returns the water in joints for changes of its state.
    pub fn joints_mut(&mut self) -> Option<&mut JointWater> {
        match self {
            Self::Joints(flow) => Some(flow),
            Self::Jointed(flow) => Some(flow.joints_mut()),
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
            Self::Jointed(flow) => flow.advance(particles, domain),
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
            Self::Jointed(flow) => flow.update_bodies(particles, domain),
        }
    }
}
