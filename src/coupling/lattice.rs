//! What a run asks of a lattice with bodies in it, however they are coupled.

use super::{Flow, FluidView};
use crate::dem::space::Space;
use crate::lbm::fluid::Fluid;
use crate::lbm::lanes::Stored;
use crate::lbm::links::Load;
use decomposition::Communicator;

/// A fluid on a lattice with its coupling.
pub trait LatticeFlow<Sp: Space, S: Stored>: Flow<Sp> + FluidView {
    /// The fluid.
    fn fluid(&self) -> &Fluid<S>;

    /// The fluid, to set its state.
    fn fluid_mut(&mut self) -> &mut Fluid<S>;

    /// Continues from saved populations and grains: bodies are mapped without loads at the next [`Flow::follow`].
    fn restart(&mut self);

    /// What the bodies received from the lattice in the last step as this rank's entries hold it, owners' entries summed: for
    /// balances. Entries of ghosts are left out, their loads stand at the owners.
    fn last_loads(&self) -> &[Load];

    /// Whether the momentum of a cell belongs to the water in its balance with the bodies.
    fn counts(&self, cell: [usize; 3]) -> bool;

    /// Whether all cells of the slab count: then nobody need ask for each.
    fn all_count(&self) -> bool;

    /// The body force on all the water in the last step (lattice units). Collective.
    fn fluid_force_total(&self, communicator: &Communicator) -> [f64; 3];
}
