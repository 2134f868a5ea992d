//! The interface between a run and a lattice with bodies, common to all couplings.

use super::structure_map::StructureMap;
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

    /// Continues from saved populations and grains: bodies are mapped without loads at the next [`Flow::update_bodies`].
    fn restart(&mut self);

    /// What the bodies received from the lattice in the last step as this rank's entries hold it, owners' entries summed: for
    /// balances. Entries of ghosts are left out, their loads stand at the owners.
    fn last_loads(&self) -> &[Load];

    /// Whether the momentum of a cell belongs to the water in its balance with the bodies.
    fn counts(&self, cell: [usize; 3]) -> bool;

    /// Whether all cells of the slab count, so that no test per cell is needed.
    fn all_count(&self) -> bool;

    /// The structures in the water, if there are any.
    fn structures(&self) -> Option<&StructureMap>;

    /// Whether bodies shut a cell of water in: they, and walls beside them, hold more than half of its neighbours.
    fn enclosed(&self, cell: [usize; 3]) -> bool;

    /// The body force on all the water in the last step (lattice units). Collective.
    fn fluid_force_total(&self, communicator: &Communicator) -> [f64; 3];
}

/// The parts of a view of a lattice that do not depend on the coupling: all except the owner of a cell. For an `impl FluidView` of a type with `fluid` and
/// `units`.
macro_rules! view_of_lattice {
    () => {
        fn units(&self) -> &LatticeUnits {
            &self.units
        }
        fn cells(&self) -> [usize; 3] {
            self.fluid.populations().cells()
        }
        fn start(&self) -> [usize; 3] {
            self.fluid.start()
        }
        fn state(&self, cell: [usize; 3]) -> (f64, [f64; 3]) {
            self.fluid
                .state(self.fluid.populations().interior_cell(cell))
        }
        fn band_states(&self, planes: std::ops::Range<usize>, to: &mut BandStates) {
            let [nx, ny, _] = self.fluid.populations().cells();
            to.resize(nx * ny * planes.len());
            let (density, velocity) = (&mut to.density, &mut to.velocity);
            self.fluid
                .band_states(planes, density, velocity, &mut to.row);
        }
        fn stress(&self, cell: [usize; 3]) -> [[f64; 3]; 3] {
            self.fluid
                .stress(self.fluid.populations().interior_cell(cell))
        }
        fn force(&self) -> [f64; 3] {
            self.fluid.last_force()
        }
        fn eddy_viscosity(&self, cell: [usize; 3]) -> f64 {
            let cell = self.fluid.populations().interior_cell(cell);
            self.fluid.eddy_viscosity(cell)
        }
        fn patches(&self) -> Vec<String> {
            let names = self.fluid.boundaries().names();
            names.map(str::to_owned).collect()
        }
        fn fluxes(&self) -> Vec<Flux> {
            self.fluid.fluxes()
        }
    };
}
pub(super) use view_of_lattice;
