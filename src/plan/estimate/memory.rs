//! Memory of a run.

use super::{CostQuantities, Estimate, disk};
use crate::scene::Scene;
use crate::scene::seepage::CELL_BYTES;
use base::number::real;
use case::coupling::Coupling;
use case::fluid::Precision;
use lbm::populations::Layout;

/// Memory of the program itself with MPI and HDF5, if small blocks come from huge pages \[bytes\].
const PROGRAM: f64 = 3.95e7;
/// Unused part of the huge pages of a lattice, whose arrays begin and end within a page, and the buffers of its
/// files \[bytes\].
const PAGES: f64 = 3.5e6;
/// Memory per cell for its kind and for guards and boundaries \[bytes\].
const CELL: f64 = 4.0;
/// Memory per cell for two velocities in f32, from which the eddy viscosity is computed, and their indices
/// \[bytes\].
const EDDY: f64 = 26.0;
/// Memory per cell for kind, mass, fill level and excess mass below a free surface \[bytes\].
const FREE_SURFACE: f64 = 25.0;
/// Memory per cell for eleven sums over time in f64 \[bytes\].
const AVERAGES: f64 = 88.0;
/// Memory per cell for solid fraction and owner with partially saturated cells \[bytes\].
const SATURATED: f64 = 8.0;
/// Memory per covered cell for index, mark and load \[bytes\].
const COVERED: f64 = 100.0;
/// Memory per cell for owner and mark, if solids use links \[bytes\].
const LINKED: f64 = 8.0;
/// Number of ghost layers of the map of owners.
const MAP_GHOSTS: f64 = 4.0;
/// Memory of the links of a cell at the surface of a solid \[bytes\].
const SURFACE: f64 = 300.0;
/// Additional memory per cell if grains move \[bytes\]: sums over the grains of a cell, and channels of open water.
/// Measured: 900.
const GRAINS_IN_SEEPAGE: f64 = 900.0;
/// Memory per cell of the seepage next to structures for its cuts \[bytes\]. Measured: 146.
const CUT_BYTES: f64 = 150.0;
/// Memory per cell of unsaturated ground \[bytes\]: states, face fluxes with their derivatives, vectors of the
/// linear solver.
const DRAINS: f64 = 380.0;
/// Memory per cell of a transient flow \[bytes\]: stored water, and its part of the multigrid levels.
const STORAGE_BYTES: f64 = 160.0;
/// Memory per grain with its neighbours, contacts and contact history \[bytes\].
const GRAIN: f64 = 1700.0;
/// Memory per block \[bytes\]: its shape, in the state and in the scene, and the longer history of its contacts.
const BLOCK: f64 = 17_000.0;

/// Size of a part of a checkpoint that is written or read at once \[bytes\].
const CHECKPOINT_PART: f64 = 4.2e6;

/// Adds the memory to the estimate.
pub(super) fn count(estimate: &mut Estimate, scene: &Scene, amounts: &CostQuantities) {
    let solids = amounts.prepared.max(amounts.grains) + amounts.generated + amounts.bodies;
    let mut memory = PROGRAM + solids * GRAIN + amounts.blocks * BLOCK;
    if let Some(flow) = &scene.flow {
        let velocities = flow.models.lattice.velocities();
        let (cells, split) = (scene.grid.cells, scene.grid.split_axis);
        let vertical = scene.surface.as_ref().map(|surface| surface.axis);
        let order = Layout::order(velocities.dimension, cells, split, vertical);
        let (layout, number) = match flow.storage {
            Precision::F64 => (Layout::for_slab::<f64>(&velocities, cells, order), 8.0),
            Precision::F32 => (Layout::for_slab::<f32>(&velocities, cells, order), 4.0),
        };
        let mut each = real(flow.models.lattice.count()) * number + CELL;
        if flow.models.turbulence.is_some() {
            each += EDDY;
        }
        if scene.surface.is_some() {
            each += FREE_SURFACE;
        }
        let mut lattice = 0.0;
        memory += PAGES;
        match scene.coupling.as_ref().filter(|_| amounts.moving() > 0.0) {
            Some(Coupling::PartiallySaturated(_)) => {
                each += SATURATED;
                lattice += amounts.covered * COVERED;
            }
            Some(Coupling::BounceBack(_)) => {
                let axes = cells[..scene.grid.dimension].iter();
                lattice += LINKED * axes.map(|n| real(*n) + MAP_GHOSTS).product::<f64>();
                lattice += amounts.surface * SURFACE;
            }
            None => {}
        }
        lattice += each * layout.positions();
        if scene.output.averages.is_some() {
            lattice += AVERAGES * amounts.cells;
        }
        estimate.bytes_per_cell = lattice / amounts.cells;
        memory += lattice;
    }
    if let Some(seepage) = &scene.seepage {
        let drains = if seepage.written.unsaturated.is_some() {
            DRAINS
        } else {
            0.0
        };
        let stores = if seepage.is_transient() {
            STORAGE_BYTES
        } else {
            0.0
        };
        let cuts = if scene.structures.is_empty() {
            0.0
        } else {
            CUT_BYTES
        };
        let grains = if amounts.moving() > 0.0 {
            GRAINS_IN_SEEPAGE
        } else {
            0.0
        };
        estimate.bytes_per_cell = CELL_BYTES + drains + stores + cuts + grains;
        memory += amounts.seepage_cells * estimate.bytes_per_cell;
    }
    memory += amounts.joint_bytes;
    // Files are gathered in memory, one at a time. The lattice is written to a checkpoint in parts, and everything
    // is read back in parts.
    memory += disk::tables(amounts).max(estimate.fluid_output_bytes);
    memory += estimate.checkpoint_bytes.min(CHECKPOINT_PART);
    estimate.memory_bytes = memory;
}
