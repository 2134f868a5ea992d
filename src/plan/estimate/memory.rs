//! Memory of a run.

use super::{Amounts, Estimate, disk};
use crate::scene::Scene;
use base::number::real;
use case::coupling::Coupling;
use case::fluid::Precision;
use lbm::populations::Layout;

/// The program itself, MPI and HDF5 included, where small blocks come from huge pages.
const PROGRAM: f64 = 3.95e7;
/// Unused part of the huge pages of a lattice's arrays, which begin and end within one, and the buffers of its files
/// \[bytes\].
const PAGES: f64 = 3.5e6;
/// Kind of a cell, and what guards and boundaries keep of it.
const CELL: f64 = 4.0;
/// Two velocities in f32 for the eddy viscosity, and its places.
const EDDY: f64 = 26.0;
/// Kind, mass, fill level and share of a cell under a free surface.
const FREE_SURFACE: f64 = 25.0;
/// Eleven sums over time in f64.
const AVERAGES: f64 = 88.0;
/// Solid fraction and owner of a cell where cells are partially saturated.
const SATURATED: f64 = 8.0;
/// A covered cell with its place, mark and load.
const COVERED: f64 = 100.0;
/// Owner and mark of a cell where solids meet the fluid at links.
const LINKED: f64 = 8.0;
/// Layers of ghosts of that map.
const MAP_GHOSTS: f64 = 4.0;
/// The links of a cell at the surface of a solid.
const SURFACE: f64 = 300.0;
/// A cell of the seepage, on every rank: coefficients, vectors and levels.
const SEEPAGE: f64 = 450.0;
/// Memory of a cell of the seepage next to structures: its cuts \[bytes\].
const CUTS: f64 = 600.0;
/// A cell of ground that drains: states, fluxes of faces with their derivatives, vectors of the linear solver.
const DRAINS: f64 = 310.0;
/// A cell of a flow that changes with time: stored water, and its part of the levels.
const STORES: f64 = 100.0;
/// A grain with its neighbours, contacts and history.
const GRAIN: f64 = 1700.0;
/// A block: its shape, here and in the scene, and the longer memory of its contacts.
const BLOCK: f64 = 17_000.0;

/// A piece of a checkpoint as it is written or read back.
const PIECE: f64 = 4.2e6;

/// Adds the memory to the estimate.
pub(super) fn count(estimate: &mut Estimate, scene: &Scene, amounts: &Amounts) {
    let solids = amounts.prepared.max(amounts.grains) + amounts.bodies;
    let mut memory = PROGRAM + solids * GRAIN + amounts.blocks * BLOCK;
    if let Some(flow) = &scene.flow {
        let velocities = flow.lattice.velocities();
        let (cells, split) = (scene.grid.cells, scene.grid.split_axis);
        let (layout, number) = match flow.storage {
            Precision::F64 => (Layout::for_slab::<f64>(&velocities, cells, split), 8.0),
            Precision::F32 => (Layout::for_slab::<f32>(&velocities, cells, split), 4.0),
        };
        let mut each = real(flow.lattice.count()) * number + CELL;
        if flow.turbulence.is_some() {
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
        let stores = if seepage.is_transient() { STORES } else { 0.0 };
        let cuts = if scene.structures.is_empty() {
            0.0
        } else {
            CUTS
        };
        estimate.bytes_per_cell = SEEPAGE + drains + stores + cuts;
        memory += amounts.seepage_cells * estimate.bytes_per_cell;
    }
    memory += amounts.joint_bytes;
    // Files are gathered in memory, one at a time. Of a checkpoint the lattice is written, and all is read back, in
    // pieces.
    memory += disk::tables(amounts).max(estimate.fluid_output_bytes);
    memory += estimate.checkpoint_bytes.min(PIECE);
    estimate.memory_bytes = memory;
}
