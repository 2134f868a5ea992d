//! Fluids with their loads on grains.
//!
//! A [`Flow`] is one combination of fluid and coupling, so that only valid combinations exist. In each step the fluid
//! advances first and computes the loads on the grains ([`Flow::advance`]). The grains then move under these loads in
//! several solid steps. Finally the flow updates the positions of the bodies ([`Flow::update_bodies`]). Outputs and
//! analyses read the fluid through [`FluidView`].

#![cfg_attr(
    test,
    allow(
        clippy::float_cmp,
        clippy::unwrap_used,
        clippy::panic,
        clippy::print_stdout,
        clippy::print_stderr,
        reason = "tests compare bits on purpose, fail by panicking and print what they measure"
    )
)]
#![allow(
    rustdoc::private_intra_doc_links,
    reason = "the documentation is read together with the code"
)]

pub mod body_map;
pub mod bounce_back;
pub mod cover_map;
pub mod fluid_view;
pub mod instances;
pub mod joint_water;
pub mod jointed;
pub mod lattice;
pub mod loads;
pub mod partially_saturated;
pub mod seepage;
pub mod solid_fraction;
pub mod structure_map;
pub mod water;

pub use fluid_view::{BandStates, FluidView, bands, cells_of};

use base::error::Error;
use decomposition::Domain;
use dem::particles::Particles;
use dem::space::Space;

/// Fluid with its coupling. Every method is collective: all ranks call it at the same point.
pub trait Flow<S: Space> {
    /// Moves the water by one step and sets the load of the water on every owned grain (SI).
    ///
    /// # Errors
    /// If a message fails.
    fn advance(&mut self, particles: &mut Particles<S>, domain: &Domain) -> Result<(), Error>;

    /// Updates the grain positions; ghosts in `particles` must be current.
    ///
    /// # Errors
    /// If a message fails.
    fn update_bodies(&mut self, particles: &mut Particles<S>, domain: &Domain)
    -> Result<(), Error>;
}
