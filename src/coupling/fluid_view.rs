//! Read access to the fluid for outputs and analyses: state of the cells, bodies in them, loads on structures,
//! fluxes through patches.

use base::units::LatticeUnits;
use lbm::boundary::Flux;
use lbm::links::Load;
use std::ops::Range;

/// Number of planes normal to z that are read together: the values per cache line if rows run along z.
const BAND: usize = 8;

/// Divides the planes of a slab into bands.
pub fn bands(planes: usize) -> impl Iterator<Item = Range<usize>> {
    (0..planes)
        .step_by(BAND)
        .map(move |z| z..(z + BAND).min(planes))
}

/// Returns the cells of some planes of `nx` times `ny` cells, in the order of [`BandStates`].
pub fn cells_of(
    planes: Range<usize>,
    [nx, ny]: [usize; 2],
) -> impl Iterator<Item = [usize; 3]> + Clone {
    planes.flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}

/// States of the cells of some planes normal to z, in the order \[z\]\[y\]\[x\], in lattice units; the buffers are
/// reused.
#[derive(Clone, Debug, Default)]
pub struct BandStates {
    /// Density deviations.
    pub density: Vec<f64>,
    /// Velocities.
    pub velocity: Vec<[f64; 3]>,
    pub(crate) row: [Vec<f64>; 4],
}

impl BandStates {
    pub(crate) fn resize(&mut self, cells: usize) {
        self.density.resize(cells, 0.0);
        self.velocity.resize(cells, [0.0; 3]);
    }
}

/// Read access to a slab of fluid for outputs and analyses, in lattice units (convert with [`FluidView::units`])
/// and coordinates of the slab.
pub trait FluidView {
    /// Scales to SI.
    fn units(&self) -> &LatticeUnits;
    /// Returns the number of cells of the slab along x, y, z; 0 along the split axis for an empty slab.
    fn cells(&self) -> [usize; 3];
    /// Returns the first cell of the slab in the domain.
    fn start(&self) -> [usize; 3];
    /// Returns the density deviation and velocity of a cell.
    fn state(&self, cell: [usize; 3]) -> (f64, [f64; 3]);
    /// Computes the states of all cells of some planes normal to z ([`bands`]); lattices compute them row by row,
    /// at a fraction of the cost.
    fn band_states(&self, planes: Range<usize>, to: &mut BandStates) {
        let [nx, ny, _] = self.cells();
        to.resize(nx * ny * planes.len());
        for (n, cell) in cells_of(planes, [nx, ny]).enumerate() {
            (to.density[n], to.velocity[n]) = self.state(cell);
        }
    }
    /// Returns the deviatoric viscous stress of a cell.
    fn stress(&self, cell: [usize; 3]) -> [[f64; 3]; 3];
    /// Returns the body force of the last step.
    fn force(&self) -> [f64; 3] {
        [0.0; 3]
    }
    /// Returns the eddy viscosity; 0 without turbulence.
    fn eddy_viscosity(&self, _cell: [usize; 3]) -> f64 {
        0.0
    }
    /// Returns the fill level of a cell below a free surface; 1 without one.
    fn fill(&self, _cell: [usize; 3]) -> f64 {
        1.0
    }
    /// Returns the id of the body that contains the centre of a cell.
    fn body_at(&self, cell: [usize; 3]) -> Option<u64>;
    /// Returns `true` if the centre of a cell is inside a body or a structure.
    fn solid_at(&self, cell: [usize; 3]) -> bool {
        self.body_at(cell).is_some()
    }
    /// Returns the loads of the last step on each structure by the links of this rank: force in quanta, and twice
    /// the moment about the lower corner of the domain. The integers must be summed over the ranks.
    fn structure_loads(&self) -> &[Load] {
        &[]
    }
    /// Returns the names of the patches of the faces.
    fn patches(&self) -> Vec<String>;
    /// Returns the flow through each patch in the last step, on this rank; the integers must be summed over the
    /// ranks.
    fn fluxes(&self) -> Vec<Flux>;
}
