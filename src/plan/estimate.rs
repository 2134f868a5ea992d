//! Estimates of memory, disk space and time before the run.
//!
//! The rates are assumed values for one core of a recent server. The summary of a run contains measured values.

use super::Clock;
use crate::case::fluid::Precision;
use crate::lbm::lattice::VelocitySet;
use crate::number::real;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use serde::Serialize;

/// The costs of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Bytes of a cell: populations, and what coupling and moments keep beside them.
    pub bytes_per_cell: f64,
    /// Number of grains, blocks and bodies, before cutting.
    pub grains: f64,
    /// Memory of all ranks together \[bytes\].
    pub memory_bytes: f64,
    /// One fluid output \[bytes\].
    pub fluid_output_bytes: f64,
    /// Number of fluid outputs.
    pub fluid_outputs: f64,
    /// All outputs and the checkpoints kept \[bytes\].
    pub disk_bytes: f64,
    /// Million lattice updates per second and core assumed.
    pub mlups: f64,
    /// Million particle steps per second and core assumed.
    pub million_particle_steps: f64,
    /// Time of the run on one core \[s\].
    pub seconds_on_one_core: f64,
}

/// Beside the populations of a cell: solid mark, owner, time-averaged load on links.
const CELL_EXTRA_BYTES: f64 = 12.0;
/// Two velocities in f32 for the eddy viscosity.
const EDDY_BYTES: f64 = 24.0;
/// Eleven sums over time in f64.
const AVERAGE_BYTES: f64 = 88.0;
/// A grain with its neighbour list, contacts and history.
const GRAIN_BYTES: f64 = 1500.0;
/// What a block needs beside: its shape, here and in the scene, and the longer memory of its contacts.
const BLOCK_BYTES: f64 = 8000.0;
/// The program itself, MPI and HDF5 included.
const PROGRAM_BYTES: f64 = 6e7;
/// Columns of a grain in a file: id, position, velocity, rotation, force, torque, radius, material.
const GRAIN_OUTPUT_BYTES: f64 = 160.0;
/// Contacts of a grain and the columns of each.
const CONTACT_OUTPUT_BYTES: f64 = 2.5 * 96.0;
/// Vertices, faces and columns of a block in a file.
const BLOCK_OUTPUT_BYTES: f64 = 1500.0;
/// Million steps of blocks with a dozen neighbours each per second and core.
const MILLION_BLOCK_STEPS: f64 = 0.03;
/// Million particle steps per second and core.
const MILLION_PARTICLE_STEPS: f64 = 4.0;

/// Million updates per second and core in f64; populations stored in f32 gain about half.
fn mlups(lattice: VelocitySet, storage: Precision) -> f64 {
    let double = match lattice {
        VelocitySet::D2Q9 => 60.0,
        VelocitySet::D3Q19 => 25.0,
        VelocitySet::D3Q27 => 15.0,
    };
    match storage {
        Precision::F64 => double,
        Precision::F32 => 1.5 * double,
    }
}

/// Memory of a cell of the seepage, on every rank: coefficients, vectors and levels.
const SEEPAGE_CELL_BYTES: f64 = 420.0;
/// Time of a solution from the last one, for a cell.
const SEEPAGE_SECONDS_PER_CELL: f64 = 3e-7;

fn bytes(precision: Precision) -> f64 {
    match precision {
        Precision::F64 => 8.0,
        Precision::F32 => 4.0,
    }
}

impl Estimate {
    pub(crate) fn of(scene: &Scene, clock: &Clock, findings: &mut Findings) -> Self {
        let cells = scene.grid.cells.iter().map(|c| real(*c)).product::<f64>();
        let end = scene.time.end;
        let outputs = |every: f64| (end / every).floor() + 1.0;
        let blocks = real(scene.polyhedra().count());
        let named =
            real(scene.bodies.len()) + scene.blocks.as_ref().map_or(0.0, |b| real(b.number));
        let grains = scene.grains.as_ref().map_or(0.0, |g| real(g.expected)) + named;
        let mut estimate = Self {
            grains,
            million_particle_steps: MILLION_PARTICLE_STEPS,
            ..Self::default()
        };
        let steps = real(clock.steps);
        if let Some(flow) = &scene.flow {
            estimate.bytes_per_cell =
                real(flow.lattice.count()) * bytes(flow.storage) + CELL_EXTRA_BYTES;
            if flow.turbulence.is_some() {
                estimate.bytes_per_cell += EDDY_BYTES;
            }
            if scene.output.averages.is_some() {
                estimate.bytes_per_cell += AVERAGE_BYTES;
            }
            estimate.mlups = mlups(flow.lattice, flow.storage);
            let updates = cells * (steps + real(clock.warm_up_steps));
            estimate.seconds_on_one_core += updates / (1e6 * estimate.mlups);
            if let Some(output) = &scene.output.fluid {
                let numbers: f64 = output
                    .fields
                    .iter()
                    .map(|field| real(field.components(scene.grid.dimension)))
                    .sum();
                estimate.fluid_output_bytes = cells * numbers * bytes(output.precision);
                estimate.fluid_outputs = outputs(output.every);
            }
        }
        if let Some(seepage) = &scene.seepage {
            let coarse = real(seepage.cell_count());
            estimate.bytes_per_cell = SEEPAGE_CELL_BYTES * coarse / cells;
            estimate.seconds_on_one_core += steps * coarse * SEEPAGE_SECONDS_PER_CELL;
            if let Some(output) = &scene.output.fluid {
                estimate.fluid_output_bytes = coarse * 5.0 * bytes(output.precision);
                estimate.fluid_outputs = outputs(output.every);
            }
        }
        let solid_steps = steps * f64::from(clock.solid_steps_per_step);
        let million_steps =
            (grains - blocks) / MILLION_PARTICLE_STEPS + blocks / MILLION_BLOCK_STEPS;
        estimate.seconds_on_one_core += 1e-6 * solid_steps * million_steps;
        if blocks > 0.0 {
            estimate.million_particle_steps = grains / million_steps;
        }
        let solid_memory = grains * GRAIN_BYTES + blocks * BLOCK_BYTES;
        let lattice_bytes = cells * estimate.bytes_per_cell;
        estimate.memory_bytes = PROGRAM_BYTES + lattice_bytes + solid_memory;
        let others = (scene.output.grains.iter()).map(|o| (o.every, GRAIN_OUTPUT_BYTES));
        let contacts = scene
            .output
            .contacts
            .iter()
            .map(|o| (o.every, CONTACT_OUTPUT_BYTES));
        let solid_bytes: f64 = others
            .chain(contacts)
            .map(|(every, size)| outputs(every) * grains * size)
            .sum();
        let surfaces = scene.output.blocks.iter();
        let solid_bytes = solid_bytes
            + surfaces
                .map(|o| outputs(o.every) * blocks * BLOCK_OUTPUT_BYTES)
                .sum::<f64>();
        let checkpoint = lattice_bytes + solid_memory;
        estimate.disk_bytes = estimate.fluid_output_bytes * estimate.fluid_outputs
            + solid_bytes
            + checkpoint * (f64::from(scene.checkpoint.keep) + 1.0);
        estimate.against_machine(scene, findings);
        estimate
    }

    fn against_machine(&self, scene: &Scene, findings: &mut Findings) {
        let stated = scene
            .guards
            .memory_gib
            .map(|gib| gib * 1024.0 * 1024.0 * 1024.0);
        let Some(available) = stated.or_else(machine_memory) else {
            return;
        };
        if self.memory_bytes > available || self.memory_bytes.is_nan() {
            findings.error(
                "domain.spacing",
                format!(
                    "the run needs about {} of memory, but {} are available",
                    size(self.memory_bytes),
                    size(available)
                ),
                "use a coarser spacing or accuracy or a smaller domain, or state the memory of all machines in guards.memory_gib",
            );
        } else if self.memory_bytes > 0.8 * available {
            findings.warn(
                "domain.spacing",
                format!(
                    "the run needs about {} of {} of memory",
                    size(self.memory_bytes),
                    size(available)
                ),
                "leave room for the system",
            );
        }
    }
}

/// A number of bytes as text.
pub(crate) fn size(bytes: f64) -> String {
    let units = ["B", "kB", "MB", "GB", "TB", "PB"];
    let mut value = bytes;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < units.len() {
        value /= 1000.0;
        unit += 1;
    }
    if value < 1e4 {
        format!("{value:.3} {}", units[unit])
    } else {
        format!("{} {}", number(value), units[unit])
    }
}

/// Memory of this machine \[bytes\], if the system reports it.
fn machine_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024.0)
}
