//! Disk space of a run.

use super::{CostQuantities, Estimate, outputs};
use crate::scene::Scene;
use crate::scene::observe::ProbeAt;
use base::number::real;
use case::fluid::Precision;
use case::observe::FieldName;

/// Size of the HDF5 file of a field, without the field, and its entry in the index \[bytes\].
const FIELD_FILE: f64 = 1.0e4;
/// Size of the HDF5 file of grains, blocks or contacts, without their columns, and its entry in the index
/// \[bytes\].
const TABLE_FILE: f64 = 2.25e4;
/// Size of the columns of a grain \[bytes\]: id, position, velocity, rotation, force, torque, radius, material.
const GRAIN: f64 = 173.0;
/// Size of the contacts of a grain \[bytes\]: 1.4 contacts of 190 bytes each.
const CONTACTS: f64 = 270.0;
/// Size of vertices, faces and columns of a block \[bytes\].
const BLOCK: f64 = 1450.0;
/// Size of the averages of a cell \[bytes\].
const AVERAGES: f64 = 112.0;
/// Size of case, log and summary \[bytes\].
const TEXTS: f64 = 1.0e4;
/// Size of a table row \[bytes\].
const LINE: f64 = 130.0;
/// Size of a row for one point of a line probe \[bytes\].
const POINT: f64 = 80.0;
/// Size of a row of a sample file \[bytes\].
const SAMPLE: f64 = 73.0;
/// Size of a row for one column of the ground surface \[bytes\].
const SURFACE: f64 = 140.0;
/// Size of the metadata of a checkpoint \[bytes\].
const CHECKPOINT: f64 = 1.2e4;
/// Size of the metadata of the columns of grains and their contacts in a checkpoint \[bytes\].
const CHECKPOINT_OF_GRAINS: f64 = 2.5e4;
/// Size of a grain with its contacts in a checkpoint \[bytes\].
const SAVED_GRAIN: f64 = 420.0;
/// Size of a block with its contacts in a checkpoint \[bytes\].
const SAVED_BLOCK: f64 = 950.0;
/// Size of a cell of the seepage in a checkpoint \[bytes\].
const SAVED_SEEPAGE: f64 = 40.0;
/// Size of the velocity of a cell in f32 in a checkpoint, with an eddy viscosity \[bytes\].
const SAVED_EDDY: f64 = 12.0;

/// Size of the sums for averages of a cell in a checkpoint \[bytes\].
const SAVED_AVERAGES: f64 = 88.0;
/// Size of kind, mass and excess mass of a cell below a free surface in a checkpoint \[bytes\].
const SAVED_FREE_SURFACE: f64 = 24.0;

fn bytes(precision: Precision) -> f64 {
    match precision {
        Precision::F64 => 8.0,
        Precision::F32 => 4.0,
    }
}

/// Returns the size of one checkpoint \[bytes\].
pub(super) fn checkpoint(scene: &Scene, amounts: &CostQuantities) -> f64 {
    let mut size = CHECKPOINT + tables(amounts);
    if amounts.moving() > 0.0 {
        size += CHECKPOINT_OF_GRAINS;
    }
    if let Some(flow) = &scene.flow {
        let eddies = flow.models.turbulence.map_or(0.0, |_| SAVED_EDDY);
        let numbers = real(flow.models.lattice.count()) * bytes(flow.storage);
        let averages = (scene.output.averages.as_ref()).map_or(0.0, |_| SAVED_AVERAGES);
        let surface = (scene.surface.as_ref()).map_or(0.0, |_| SAVED_FREE_SURFACE);
        size += amounts.cells * (numbers + eddies + averages + surface);
    }
    size
}

/// Returns the size of grains, blocks, the seepage and the water in joints in a checkpoint \[bytes\].
pub(super) fn tables(amounts: &CostQuantities) -> f64 {
    (amounts.grains + amounts.generated + amounts.bodies) * SAVED_GRAIN
        + amounts.blocks * SAVED_BLOCK
        + amounts.seepage_cells * SAVED_SEEPAGE
        + amounts.joint_numbers * 8.0
}

/// Adds the sizes of all files to the estimate, whose time and checkpoint size are already known.
pub(super) fn count(estimate: &mut Estimate, scene: &Scene, amounts: &CostQuantities) {
    let end = scene.time.end;
    let mut disk = TEXTS;
    if let Some(output) = &scene.output.fluid {
        let size = |field: &FieldName| match field {
            // Includes the mask of cells to draw.
            FieldName::Solid => bytes(output.precision) + 1.0,
            _ => real(field.components(scene.grid.dimension)) * bytes(output.precision),
        };
        let cell: f64 = output.fields.iter().map(size).sum();
        let cells = amounts.cells + amounts.seepage_cells;
        estimate.fluid_output_bytes = FIELD_FILE + cells * cell;
        estimate.fluid_outputs = outputs(output.every, end);
        disk += estimate.fluid_output_bytes * estimate.fluid_outputs;
    }
    if let Some(averages) = &scene.output.averages {
        let files = averages
            .every
            .map_or(1.0, |every| outputs(every, end - averages.from) - 1.0);
        disk += files * (FIELD_FILE + AVERAGES * amounts.cells);
    }
    if let Some(grains) = &scene.output.grains {
        let file = TABLE_FILE + amounts.moving() * GRAIN;
        disk += outputs(grains.every, end) * file;
    }
    if let Some(contacts) = &scene.output.contacts {
        let file = TABLE_FILE + amounts.grains * CONTACTS;
        disk += outputs(contacts.every, end) * file;
    }
    if let Some(blocks) = &scene.output.blocks {
        let file = TABLE_FILE + amounts.blocks * BLOCK;
        disk += outputs(blocks.every, end) * file;
    }
    if scene.grains.as_ref().is_some_and(|g| g.save.is_some()) {
        disk += amounts.prepared * SAMPLE;
    }
    if let Some(collapse) = &scene.ground_collapse {
        let [long, across, _] = collapse.axes;
        let columns = real(scene.grid.cells[long]) * real(scene.grid.cells[across]);
        disk += outputs(collapse.every, end) * columns * SURFACE;
    }
    disk += scene
        .probes
        .iter()
        .map(|probe| {
            let sample = match &probe.at {
                ProbeAt::Line { points, .. } => real(*points) * POINT,
                ProbeAt::WaterTable(columns) => real(*columns) * LINE,
                ProbeAt::Heave(heave) => real(heave.widths()) * LINE,
                _ => LINE,
            };
            outputs(probe.every, end) * sample
        })
        .sum::<f64>();
    let by_time = scene.checkpoint.every.map_or(0.0, |every| end / every);
    let wall = scene.checkpoint.every_wall_seconds;
    let by_wall = if wall > 0.0 {
        (estimate.seconds_on_one_core / wall).floor()
    } else {
        0.0
    };
    let written = by_time.max(1.0) + by_wall;
    disk += estimate.checkpoint_bytes * written.floor().min(f64::from(scene.checkpoint.keep));
    estimate.disk_bytes = disk;
}
