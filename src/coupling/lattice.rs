//! Interface between a run and a lattice with bodies, common to all couplings.

use super::body_map::BodyMap;
use super::structure_map::StructureMap;
use super::{Flow, FluidView};
use base::error::Error;
use base::thread_pool;
use decomposition::{Communicator, Domain};
use dem::particles::Particles;
use dem::space::Space;
use lbm::fluid::Fluid;
use lbm::lanes::Stored;
use lbm::links::Load;
use lbm::populations::Populations;
use lbm::quanta::{from_quanta, quanta};
use lbm::saturation::cells;

/// Cells whose momentum is included in the balance of the fluid with the bodies: those outside structures, outside
/// bodies that contain fluid of their own, and outside joints.
#[derive(Clone, Copy)]
pub struct Balanced<'a> {
    /// Bodies that contain fluid of their own.
    pub(super) bodies: Option<&'a BodyMap>,
    pub(super) structures: Option<&'a StructureMap>,
}

impl Balanced<'_> {
    /// Returns `true` if the balance includes a cell of the slab.
    #[must_use]
    pub fn holds(&self, cell: [usize; 3]) -> bool {
        self.bodies.is_none_or(|map| !map.is_closed(cell))
            && self.structures.is_none_or(|map| !map.holds(cell))
    }

    /// Returns `true` if the balance includes all cells of the slab.
    #[must_use]
    pub fn holds_all(&self) -> bool {
        self.structures.is_none() && self.bodies.is_none_or(BodyMap::is_empty)
    }

    /// Returns the number of included cells of the slab; counted by threads.
    pub(super) fn count<S: Stored>(&self, populations: &Populations<S>) -> usize {
        if self.holds_all() {
            return populations.cells().iter().product();
        }
        let [.., fast] = populations.order();
        let length = populations.cells()[fast];
        let mut counts = [0; thread_pool::MAX_THREADS];
        populations.by_rows(&mut counts, |mut at, count| {
            *count += (0..length)
                .filter(|&k| {
                    at[fast] = k;
                    self.holds(at)
                })
                .count();
        });
        counts.iter().sum()
    }
}

/// Makes the step of the fluid before its loads are collected. Returns `true` if the domain contains no solid. `keep`
/// reads the populations before structures reflect them.
pub(super) fn advance_fluid<Sp: Space, S: Stored>(
    fluid: &mut Fluid<S>,
    structures: Option<&mut StructureMap>,
    particles: &Particles<Sp>,
    domain: &Domain,
    keep: impl FnOnce(&Fluid<S>),
) -> Result<bool, Error> {
    fluid.advance_many(1)?;
    if let Some(structures) = structures {
        fluid.fetch()?;
        keep(fluid);
        structures.bounce(fluid.populations_mut());
        structures.load_feet(fluid);
    }
    fluid.move_surface();
    Ok(particles.is_empty() && domain.communicator().size() == 1)
}

/// Fluid on a lattice with its coupling.
pub trait LatticeFlow<Sp: Space, S: Stored>: Flow<Sp> + FluidView {
    /// Returns the fluid.
    fn fluid(&self) -> &Fluid<S>;

    /// Returns the fluid for changes of its state.
    fn fluid_mut(&mut self) -> &mut Fluid<S>;

    /// Copies the state of the fluid from the GPU, if the GPU holds it ([`Fluid::fetch`]).
    ///
    /// # Errors
    ///
    /// If the GPU fails.
    fn fetch(&mut self) -> Result<(), Error> {
        Ok(self.fluid_mut().fetch()?)
    }

    /// Continues from restored populations and grains: bodies are mapped without loads at the next
    /// [`Flow::update_bodies`].
    fn restart(&mut self);

    /// Returns the loads of the lattice on the bodies in the last step, for balances: the entries of owned bodies,
    /// summed over the ranks. Entries of ghosts are excluded, because the owners have their loads.
    fn last_loads(&self) -> &[Load];

    /// Returns the cells whose momentum is included in the balance of the fluid with the bodies.
    fn balanced(&self) -> Balanced<'_>;

    /// Returns the structures in the water, if there are any.
    fn structures(&self) -> Option<&StructureMap>;

    /// Returns `true` if bodies enclose a fluid cell: bodies, and walls next to them, occupy more than half of its
    /// neighbours.
    fn enclosed(&self, cell: [usize; 3]) -> bool;

    /// Returns the force of all terms of the step on the fluid of the balance in the last step, in lattice units,
    /// and the magnitude of its largest part. The force is the body force, multiplied by 1 - B in a covered cell,
    /// plus the forces of other terms. Collective.
    fn fluid_force_total(&self, communicator: &Communicator) -> ([f64; 3], f64) {
        let (fluid, water) = (self.fluid(), self.balanced());
        let populations = fluid.populations();
        let mut open = i128::from(quanta(1.0)) * water.count(populations) as i128;
        if let Some(cover) = fluid.cover() {
            let cells = populations.interior();
            for (_, position) in cells.filter(|(at, _)| water.holds(*at)) {
                open -= i128::from(cover.weight(position));
            }
        }
        let mut impulse = [0_i128; 3];
        for term in fluid.terms() {
            let given = term.impulse(populations, &|at| water.holds(at));
            for (sum, given) in impulse.iter_mut().zip(given) {
                *sum += given;
            }
        }
        let sum = |part: i128| {
            let all = communicator.all_reduce_sum_u128(part.cast_unsigned());
            all.cast_signed()
        };
        let open = cells(sum(open));
        let uniform = fluid.last_force().map(|force| force * open);
        let given = impulse.map(|part| from_quanta(sum(part)));
        let parts = uniform.iter().chain(&given);
        let largest = parts.fold(0.0_f64, |largest, part| largest.max(part.abs()));
        (std::array::from_fn(|a| uniform[a] + given[a]), largest)
    }
}

/// Implements the parts of a view of a lattice that do not depend on the coupling: all except the owner of a cell.
/// For an `impl FluidView` of a type with `fluid`, `structures` and `units`.
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
        fn fill(&self, cell: [usize; 3]) -> f64 {
            let surface = self.fluid.surface();
            surface.map_or(1.0, |surface| {
                let cell = self.fluid.populations().interior_cell(cell);
                surface.fill(cell).clamp(0.0, 1.0)
            })
        }
        fn patches(&self) -> Vec<String> {
            let names = self.fluid.boundaries().names();
            names.map(str::to_owned).collect()
        }
        fn structure_loads(&self) -> &[Load] {
            let structures = self.structures.as_deref();
            structures.map_or(&[], StructureMap::loads)
        }
    };
}
pub(super) use view_of_lattice;

/// Implements the functions of [`LatticeFlow`] that return fields of the same names in every coupling.
macro_rules! parts_of_lattice_flow {
    () => {
        fn fluid(&self) -> &Fluid<S> {
            &self.fluid
        }

        fn fluid_mut(&mut self) -> &mut Fluid<S> {
            &mut self.fluid
        }

        fn last_loads(&self) -> &[Load] {
            &self.loads[..self.owned.min(self.loads.len())]
        }

        fn structures(&self) -> Option<&StructureMap> {
            self.structures.as_deref()
        }
    };
}
pub(super) use parts_of_lattice_flow;
