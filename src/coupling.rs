//! A fluid together with its action on grains.
//!
//! A [`Flow`] is a pair of fluid and coupling, so that nonsense pairs cannot be written. In a step the water moves first
//! and loads the grains ([`Flow::advance`]); the grains move under that load in several solid steps; then the flow
//! follows them ([`Flow::follow`]).

pub mod body_map;
pub mod bounce_back;

use crate::dem::particles::Particles;
use crate::dem::ranks::Ranks;
use crate::dem::space::Space;
use crate::error::Error;

/// A fluid with its coupling. Collective: every rank calls each method at the same point.
pub trait Flow<S: Space> {
    /// Moves the water by one step and sets the load of the water on every owned grain (SI).
    ///
    /// # Errors
    /// Where a message failed.
    fn advance(&mut self, particles: &mut Particles<S>, ranks: &dyn Ranks) -> Result<(), Error>;

    /// Takes note of where the grains are now; `particles` hold their ghosts up to date.
    ///
    /// # Errors
    /// Where a message failed.
    fn follow(&mut self, particles: &mut Particles<S>, ranks: &dyn Ranks) -> Result<(), Error>;
}
