//! Processor time of a run on one core, and the time in which it waits.
//!
//! Processor time does not depend on what else the machine computes. The run waits while MPI starts its own processes
//! and while files are on their way to the disk: this time comes in addition to that of its core.
//!
//! The rates were measured on one core of the reference machine, an AMD EPYC with AVX-512, with the cases of
//! `jobs/plans`. The pass over the lattice scales with the measured speed of the fluid, everything else with that of
//! grains in contact ([`Machine`]).

use super::{CostQuantities, Machine, outputs};
use crate::Clock;
use crate::scene::Scene;
use crate::scene::flow::Flow;
use crate::scene::grains::GrainSource;
use crate::scene::joints::JointScene;
use crate::scene::seepage::Seepage;
use base::number::{real, to_u32};
use base::vector::norm;
use case::coupling::Coupling;
use case::fluid::Precision;
use lbm::lattice::VelocitySet;
use serde::Serialize;

/// Processor time of each phase on one core \[s\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// Start of the program, input, first neighbour lists, hash of the final state.
    pub start_and_end: f64,
    /// Growth or deposition of the grains.
    pub preparation: f64,
    /// Pass over the lattice, links, covered cells, openings.
    pub fluid: f64,
    /// Seepage with the porosity.
    pub seepage: f64,
    /// Water in joints.
    pub joints: f64,
    /// Contacts and motion.
    pub grains: f64,
    /// Mapping of bodies to cells.
    pub mapping: f64,
    /// Fields, tables and checkpoints.
    pub output: f64,
    /// Guards.
    pub guards: f64,
}

impl Seconds {
    /// Returns the sum of the times of all phases \[s\].
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.start_and_end
            + self.preparation
            + self.fluid
            + self.seepage
            + self.joints
            + self.grains
            + self.mapping
            + self.output
            + self.guards
    }
}

/// Speed of the pass with arithmetic in f32 relative to that with f64 arithmetic and f32 storage.
const SINGLE_SPEED_UP: f64 = 1.5;

/// Returns the updates per second of one core in cells without solids, in millions.
pub(super) fn mlups(flow: &Flow) -> f64 {
    let nanoseconds = match (flow.models.lattice, flow.storage) {
        (VelocitySet::D2Q9, Precision::F64) => 5.3,
        (VelocitySet::D2Q9, Precision::F32) => 6.1,
        (VelocitySet::D3Q19, Precision::F64) => 20.0,
        (VelocitySet::D3Q19, Precision::F32) => 17.0,
        (VelocitySet::D3Q27, Precision::F64) => 27.0,
        (VelocitySet::D3Q27, Precision::F32) => 24.0,
    };
    let nanoseconds = match flow.arithmetic {
        Precision::F64 => nanoseconds,
        Precision::F32 => nanoseconds / SINGLE_SPEED_UP,
    };
    let eddies = match flow.models.lattice {
        _ if flow.models.turbulence.is_none() => 0.0,
        VelocitySet::D2Q9 => 4.0,
        VelocitySet::D3Q19 | VelocitySet::D3Q27 => 12.0,
    };
    1e3 / (nanoseconds + eddies)
}

/// Processor time of start and end of the program \[s\].
const START: f64 = 0.03;
/// Time in which the program waits for the start of MPI \[s\].
const START_OF_MPI: f64 = 0.2;
/// Time to hash a population of the final state \[s\].
const HASH: f64 = 2.6e-8;
/// Time of a fluid step without its cells \[s\].
const STEP: f64 = 3e-7;
/// Time of a cell at an opening \[s\].
const OPENING: f64 = 7e-8;
/// Time of a link between fluid and solid \[s\].
const LINK: f64 = 4.3e-9;
/// Time of a term in a cell on which it acts before the pass, per population \[s\]: it gathers and scatters each
/// population at its own address, without vectors, as the pass does for whole rows.
const TERM: f64 = 4.8e-9;
/// Number of links of a cell at the surface of a solid, in 2-D and 3-D.
const LINKS: [f64; 2] = [2.5, 5.0];
/// Time of a covered cell in D2Q9, D3Q19 and D3Q27 \[s\].
const COVERED: [f64; 3] = [4e-8, 9e-8, 4e-8];
/// Additional time of a cell at the surface of a block next to other blocks in D3Q27 \[s\], for populations towards
/// cells of those blocks. In D3Q19 it is part of the covered cells.
const JOINT: f64 = 2.2e-7;
/// Additional time of a covered cell in D3Q19 with an eddy viscosity \[s\].
const COVERED_EDDIES: f64 = 6e-8;
/// Time to map a cell at the surface of a moving disc or sphere, and of a moving block \[s\].
const MAPPED: [f64; 2] = [5.5e-8, 1.2e-7];
/// Additional time of a surface cell with an eddy viscosity, in each step in which bodies move \[s\].
const EDDY_CELL_TIME: f64 = 4e-8;
/// Time of a grain in a bonded bed, where most grains are stationary \[s\].
const STATIONARY_GRAIN_TIME: f64 = 6e-10;
/// Time to search all waves for one that grows with the operator of a flow \[s\], which the plan does before the run.
const GROWING_WAVE: f64 = 0.094;
/// Time of a guard check per population \[s\].
const GUARD: f64 = 1.05e-9;
/// Steps between two guard checks.
const GUARD_EVERY: f64 = 100.0;
/// Time of a solid step without its grains \[s\].
const SOLID_STEP: f64 = 1.3e-7;
/// Time of a disc and of a sphere in contact, in a solid step of a bed at rest \[s\].
const GRAIN: [f64; 2] = [4.5e-8, 3.9e-8];
/// Number of contacts per sphere, each of two spheres, in the beds of [`GRAIN`], and time of each more \[s\]. Discs
/// of the densest packing cost no more than those of [`GRAIN`].
const CONTACTS: f64 = 1.75;
const CONTACT: f64 = 1.9e-8;
/// Additional time of a contact with a servo wall, whose forces and stiffnesses are exact sums \[s\].
const SERVO_CONTACT: f64 = 5e-8;
/// Time of a step of the run with moving grains, without its solid steps \[s\].
const GRAIN_STEP: f64 = 1.5e-6;
/// Time that bonds add to a grain \[s\].
const BONDS: f64 = 3.1e-8;
/// Time of a block among few blocks, and in a pile, in a solid step \[s\].
const BLOCK: [f64; 2] = [9.5e-7, 4.3e-6];
/// Time of a cell that a free surface passes, in 2-D and 3-D \[s\], without that of its collision.
const INTERFACE: [f64; 2] = [2.1e-7, 3.3e-7];
/// Time that a free surface adds to each cell with water, in 2-D and 3-D \[s\]: its kind.
const KIND: [f64; 2] = [1.5e-9, 5e-9];
/// Times of a cell covered by a body or block in water with a free surface, and of one between it and open water \[s\]:
/// water, weight and load of these cells are computed in every step, also those of fixed bodies.
const BODY_IN_SURFACE: [f64; 2] = [1e-7, 3e-7];
/// Time of a seepage solution without its cells, of each of its cells, and of the porosity of a grain \[s\].
const SEEPAGE: [f64; 3] = [2.1e-3, 1.6e-7, 4.8e-7];
/// Time of a cell in a solution for a withdrawal from a cell of a pipe of backward erosion \[s\].
const WITHDRAWAL: f64 = 2e-6;
/// Time of the equilibria of a pipe, per fourth power of its cells \[s\].
const EQUILIBRIA: f64 = 1e-8;
/// Time of a link of a network of joints in a step, with inertia and without, and what a link in a joint of moving
/// blocks adds \[s\].
const JOINT_LINK: [f64; 2] = [7.6e-8, 3.5e-8];
const MOVING_LINK: f64 = 2.5e-7;
/// Time of an entry of the factors of a network of joints in a step, if all blocks are fixed, and if blocks move \[s\].
const JOINT_ENTRY: [f64; 2] = [4.5e-9, 9e-9];
/// Time of a cell of unsaturated ground in the first solution, in a later one of a steady flow, and in an adaptive step
/// of a transient flow, which takes 8 to 10 Newton steps \[s\].
const UNSATURATED: [f64; 3] = [1.2e-4, 5e-6, 4e-6];
/// Ratio of all adaptive steps to those that need not be repeated, the median of ten runs.
const REPEATED: f64 = 1.08;
/// Time of an output without the bytes of its fields \[s\].
const OUTPUT: f64 = 2.5e-3;
/// Number of files and folders that an output synchronises to disk.
const FILES: f64 = 6.0;
/// Time per byte of a checkpoint \[s\]: gathered, written, read back, hashed.
const CHECKPOINT_BYTE: f64 = 4.5e-9;
/// Time per byte of other files \[s\].
const BYTE: f64 = 1e-8;
/// Solid steps of a deposition divided by the steps of a fall from the top of its box.
const SETTLING: f64 = 3.3;
/// Cost of a step of grains that move past each other, relative to a bed at rest: contacts slide, all listed pairs are
/// tested and not only the contacts, and the lists are made again every 10 to 30 steps. Depositions of bonded spheres,
/// and loose ones in a stream, took 1.7 to 1.8 times the time of a bed at rest; of two depositions of loose spheres one
/// did, and the other took the time of a bed at rest, which the plan states.
const IN_MOTION: f64 = 1.7;
/// Time to generate a grain per grain present \[s\]: each of the positions drawn is compared with all grains, and the
/// neighbour lists are built again. A region that is full draws positions again in every step, which the plan does not
/// count.
const BIRTH: f64 = 4.9e-7;
/// Solid steps of a growth until it is at rest.
const GROWTH_STEPS: f64 = 1.8e4;

/// Costs in a step that belong to a position in the domain \[s\], by which slabs of equal cost are cut.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Cost of a lattice cell.
    pub cell: f64,
    /// Additional cost of a cell with water if it has a free surface.
    pub wet: f64,
    /// Additional cost of a cell that a free surface passes.
    pub interface: f64,
    /// Additional cost of a cell that a solid covers.
    pub covered: f64,
    /// Additional cost of a cell at the surface of a solid: its links, or the joints of blocks.
    pub linked: f64,
    /// Cost of mapping a cell at the surface of a grain in a bed, and of another solid.
    pub mapped: [f64; 2],
    /// Cost of the solid steps of a grain or round body, and of a block.
    pub solid: [f64; 2],
    /// Cost of the porosity of a grain in seepage.
    pub porosity: f64,
}

impl Parts {
    /// Returns the costs in a scene.
    #[must_use]
    pub fn for_scene(scene: &Scene, clock: &Clock) -> Self {
        let blocks = scene.polyhedra().count();
        let bonds = has_bonds(scene);
        let mut all = Self::default();
        let three = usize::from(scene.grid.dimension == 3);
        if let Some(flow) = &scene.flow {
            all.cell = 1e-6 / mlups(flow);
            all.interface = INTERFACE[three];
            if scene.surface.is_some() {
                all.wet = KIND[three];
            }
            let kind = match flow.models.lattice {
                VelocitySet::D2Q9 => 0,
                VelocitySet::D3Q19 => 1,
                VelocitySet::D3Q27 => 2,
            };
            match &scene.coupling {
                Some(Coupling::BounceBack(_)) => all.linked = LINKS[three] * LINK,
                Some(Coupling::PartiallySaturated(_)) => {
                    let eddies = flow.models.turbulence.is_some()
                        && flow.models.lattice == VelocitySet::D3Q19;
                    all.covered = COVERED[kind] + if eddies { COVERED_EDDIES } else { 0.0 };
                    if flow.models.lattice == VelocitySet::D3Q27 {
                        all.linked = JOINT * super::joints::joint_share(scene);
                    }
                }
                None => {}
            }
            if scene.surface.is_some() && scene.coupling.is_some() {
                let [covered, open] = BODY_IN_SURFACE;
                all.covered += covered;
                all.linked += open * super::joints::open_share(scene);
            }
            let bed = if bonds {
                STATIONARY_GRAIN_TIME
            } else {
                MAPPED[0]
            };
            all.mapped = [bed, MAPPED[usize::from(blocks > 0)]];
        }
        let grain = match (three, bonds) {
            (1, true) => GRAIN[1] + BONDS,
            (1, false) if scene.flow.is_some() && is_loose(scene) => IN_MOTION * GRAIN[1],
            _ => GRAIN[three],
        };
        let solid_steps = f64::from(clock.solid_steps_per_step);
        if scene.seepage.is_some() {
            all.porosity = SEEPAGE[2];
        }
        all.solid = [
            solid_steps * grain,
            solid_steps * BLOCK[usize::from(blocks > 20)],
        ];
        all
    }
}

impl Seconds {
    pub(super) fn for_scene(
        scene: &Scene,
        clock: &Clock,
        amounts: &CostQuantities,
        machine: Machine,
        checkpoint: f64,
    ) -> Self {
        let run = TimedRun {
            scene,
            clock,
            amounts,
            machine,
            parts: Parts::for_scene(scene, clock),
            steps: real(clock.steps) + real(clock.warm_up_steps),
            space: usize::from(scene.grid.dimension == 3),
        };
        let mut all = Self {
            start_and_end: START / machine.grains,
            output: run.output(checkpoint),
            ..Self::default()
        };
        if let Some(flow) = &scene.flow {
            run.add_flow(flow, &mut all);
        }
        if let Some(seepage) = &scene.seepage {
            all.seepage = run.seepage(seepage);
        }
        if let Some(joints) = &scene.joints {
            all.joints = run.joints(joints);
        }
        if amounts.moving() > 0.0 {
            all.grains = run.grains();
        }
        if let Some(grains) = &scene.grains {
            all.preparation = run.preparation(&grains.source);
        }
        all
    }
}

/// Run whose phases are timed.
struct TimedRun<'a> {
    scene: &'a Scene,
    clock: &'a Clock,
    amounts: &'a CostQuantities,
    machine: Machine,
    parts: Parts,
    /// Steps with those of the warm-up.
    steps: f64,
    /// Entry of the tables: 0 in 2-D, 1 in 3-D.
    space: usize,
}

impl TimedRun<'_> {
    /// Adds the phases of a fluid on a lattice: its steps, the mapping of bodies, guards, hash and search for waves.
    fn add_flow(&self, flow: &Flow, all: &mut Seconds) {
        let Self {
            scene,
            clock,
            amounts,
            machine,
            parts,
            steps,
            ..
        } = self;
        let openings: f64 = flow
            .patches()
            .filter(|patch| patch.condition.model().passes_water())
            .map(|patch| {
                let cells = (0..scene.grid.dimension).filter(|a| *a != patch.face.axis());
                cells
                    .map(|a| real(patch.to[a].saturating_sub(patch.from[a])))
                    .product::<f64>()
            })
            .sum();
        let solids = amounts.surface * parts.linked + amounts.covered * parts.covered;
        let interface = amounts.interface * parts.interface + amounts.wet * parts.wet;
        let acted_on = amounts.acted_on * TERM * real(flow.models.lattice.count());
        let beside = STEP + openings * OPENING + solids + interface + acted_on;
        all.fluid = steps * (amounts.wet * parts.cell / machine.fluid + beside / machine.grains);
        let [bed, moving] = parts.mapped;
        let mut mapped = amounts.moving_surface * moving + amounts.bed_surface * bed;
        let saturated = matches!(scene.coupling, Some(Coupling::PartiallySaturated(_)));
        if saturated && flow.models.turbulence.is_some() && mapped > 0.0 {
            mapped += amounts.surface * EDDY_CELL_TIME;
        }
        all.mapping = real(clock.steps) * mapped / machine.grains;
        let populations = amounts.cells * real(flow.models.lattice.count());
        let checked = amounts.wet * real(flow.models.lattice.count());
        let looks = steps / GUARD_EVERY + 2.0;
        all.guards = looks * checked * GUARD / machine.grains;
        all.start_and_end += populations * HASH / machine.grains;
        let model = flow.models.collision.model();
        if model.growing_wave(flow.relaxation_time).is_some() {
            all.start_and_end += GROWING_WAVE / machine.grains;
        }
    }

    fn seepage(&self, seepage: &Seepage) -> f64 {
        let (amounts, machine, steps) = (self.amounts, self.machine, self.steps);
        let [once, cell, _] = SEEPAGE;
        let porosity = amounts.grains * self.parts.porosity;
        let mut time = steps * (once + amounts.seepage_cells * cell + porosity) / machine.grains;
        if let Some(piping) = &seepage.piping {
            let cells = real(piping.settings.path.count);
            let each = once + amounts.seepage_cells * WITHDRAWAL;
            time += (cells * each + EQUILIBRIA * cells.powi(4)) / machine.grains;
        }
        if let Some(soil) = &seepage.written.unsaturated {
            let [first, later, adaptive] = UNSATURATED;
            let known = seepage.has_stored_start();
            let begin = if known { 0.0 } else { first };
            let advance = match &soil.transient {
                Some(flow) => {
                    let steps = super::fronts::adaptive_steps(self.scene, seepage, flow, steps);
                    REPEATED * steps * adaptive
                }
                None => steps * later,
            };
            time += amounts.seepage_cells * (begin + advance) / machine.grains;
        }
        time
    }

    fn joints(&self, joints: &JointScene) -> f64 {
        let link = JOINT_LINK[usize::from(!joints.written.inertia)];
        let [links, moving] = self.amounts.joint_links;
        let entry = JOINT_ENTRY[usize::from(joints.movers > 0)];
        let step = links * link + moving * MOVING_LINK + self.amounts.joint_entries * entry;
        let made = self.steps / f64::from(joints.lattice_steps);
        made * step / self.machine.grains
    }

    /// Returns the time of contacts, motion and generation of solids.
    fn grains(&self) -> f64 {
        let (clock, amounts) = (self.clock, self.amounts);
        let solid_steps = real(clock.steps) * f64::from(clock.solid_steps_per_step);
        let [round, block] = self.parts.solid;
        let solids = (amounts.grains + amounts.bodies) * round + amounts.blocks * block;
        let dense = if self.space == 1 {
            (amounts.contacts - CONTACTS * amounts.grains).max(0.0)
        } else {
            0.0
        };
        let [walls, servos] = amounts.wall_contacts;
        let contacts = (dense + walls) * CONTACT + servos * SERVO_CONTACT;
        // Generated grains fall without contacts at first and rest on others later.
        let falling = if self.space == 1 {
            amounts.falling
        } else {
            0.0
        };
        let generated = amounts.present * GRAIN[self.space] - falling * CONTACTS * CONTACT;
        let searched = amounts.grains + amounts.bodies + amounts.blocks + amounts.present;
        (solid_steps * (SOLID_STEP + contacts + generated)
            + real(clock.steps) * (GRAIN_STEP + solids)
            + amounts.generated * searched * BIRTH)
            / self.machine.grains
    }

    fn preparation(&self, source: &GrainSource) -> f64 {
        let steps = prepared_in(self.scene, self.clock, source);
        let listed = if has_bonds(self.scene) {
            IN_MOTION
        } else {
            1.0
        };
        self.amounts.prepared * GRAIN[self.space] * listed * steps / self.machine.grains
    }

    /// Returns the time of files with checkpoints of so many bytes.
    fn output(&self, checkpoint: f64) -> f64 {
        let (scene, amounts) = (self.scene, self.amounts);
        let fields = scene.output.fluid.as_ref().map_or(0.0, |o| {
            let components = o.fields.iter().map(|f| f.components(scene.grid.dimension));
            outputs(o.every, scene.time.end)
                * (amounts.cells + amounts.seepage_cells)
                * real(components.sum::<usize>())
                * 4.0
        });
        let bytes = checkpoint * CHECKPOINT_BYTE + fields * BYTE;
        (times_written(scene) * OUTPUT + bytes) / self.machine.grains
    }
}

/// Returns `true` if the contact law bonds grains.
fn has_bonds(scene: &Scene) -> bool {
    let table = scene.contact.as_ref();
    table.is_some_and(|table| table.model().bonds())
}

/// Returns the time in which a run waits for the start of MPI and for its files \[s\].
pub(super) fn waiting(scene: &Scene, machine: Machine) -> f64 {
    START_OF_MPI / machine.grains + times_written(scene) * FILES * machine.file_seconds
}

/// Returns the number of outputs of all kinds, and one for the final state.
fn times_written(scene: &Scene) -> f64 {
    let output = &scene.output;
    let intervals = [
        output.fluid.as_ref().map(|o| o.every),
        output.grains.as_ref().map(|o| o.every),
        output.contacts.as_ref().map(|o| o.every),
        output.blocks.as_ref().map(|o| o.every),
    ];
    let written = intervals.into_iter().flatten();
    1.0 + written
        .map(|every| outputs(every, scene.time.end))
        .sum::<f64>()
}

/// Returns `true` if a preparation places the grains, so that the run does not begin with an arrangement that the case
/// states.
fn is_loose(scene: &Scene) -> bool {
    let source = scene.grains.as_ref().map(|grains| &grains.source);
    source.is_some_and(|source| {
        matches!(
            source,
            GrainSource::Growth { .. } | GrainSource::Deposition { .. }
        )
    })
}

/// Returns the number of solid steps of a preparation.
fn prepared_in(scene: &Scene, clock: &Clock, source: &GrainSource) -> f64 {
    match source {
        GrainSource::Growth { .. } => GROWTH_STEPS,
        GrainSource::Deposition { clouds, deposition } => {
            let gravity = norm(scene.gravity);
            let height = (0..scene.grid.dimension)
                .map(|a| {
                    let top = clouds
                        .iter()
                        .map(|cloud| cloud.block.to[a])
                        .fold(0.0, f64::max);
                    top * scene.gravity[a].abs() / gravity.max(f64::MIN_POSITIVE)
                })
                .sum::<f64>();
            let fall = (2.0 * height / gravity).sqrt();
            let full = scene
                .contact
                .as_ref()
                .zip(scene.grains.as_ref())
                .map(|(table, grains)| {
                    let diameter = grains.radii.map_or(0.0, |(least, most)| least + most);
                    table
                        .model()
                        .normal_stiffness([to_u32(grains.material); 2], diameter)
                });
            // Soft springs allow long steps at first, stiff springs require short steps at the end.
            let softer = full
                .zip(deposition.falling_stiffness)
                .map_or(1.0, |(full, soft)| (full / soft).max(1.0).cbrt());
            let steps = SETTLING * fall / (softer * clock.solid_time_step);
            // The stiffness increases by a factor of ten from stage to stage.
            let stages = 1.0 + (3.0 * softer.log10()).ceil();
            let most = stages * f64::from(deposition.stop.at_most_steps);
            if steps.is_finite() {
                steps.min(most)
            } else {
                0.0
            }
        }
        GrainSource::File { .. } | GrainSource::List(_) => 0.0,
    }
}
