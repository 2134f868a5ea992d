//! Memory, disk space and time of a run, before the run.
//!
//! Memory and disk space follow from what the program allocates and writes ([`memory`], [`disk`]). The time is the sum
//! over the phases of a step ([`time`]): processor time, with rates of one core of a reference machine; `solver plan`
//! measures on the
//! machine at hand how fast it computes the fluid and grains in contact and writes a file ([`Machine`]). `jobs/plans`
//! compares all three with runs.

pub mod disk;
mod fronts;
mod joints;
pub mod memory;
pub mod time;

use super::Clock;
use crate::scene::Scene;
use crate::scene::auto::Subject;
use crate::scene::bodies::Mobility;
use crate::scene::findings::{Findings, number};
use crate::scene::grains::{GrainSource, Grains};
use crate::scene::machine;
use crate::scene::observe::{ObservedRegion, RegionAction};
use crate::scene::pairs::TOUCHES;
use base::error::Remedy;
use base::number::{common_divisor, real, whole};
use case::grains::Radii;
use serde::Serialize;
use time::Seconds;

/// Speed of one core of a machine relative to one core of the reference machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Machine {
    /// Relative speed of the pass over the lattice with the operator, the eddy viscosity and the storage of the
    /// plan.
    pub fluid: f64,
    /// Relative speed of grains in contact, and of all other work except the pass over the lattice: links,
    /// openings, maps, seepage, guards, hashes.
    pub grains: f64,
    /// Time to write a small file to the disk \[s\].
    pub file_seconds: f64,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            fluid: 1.0,
            grains: 1.0,
            file_seconds: 0.005,
        }
    }
}

/// Costs of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Bytes per cell: populations with their ghosts, and the data of eddy viscosity, coupling and averages.
    pub bytes_per_cell: f64,
    /// Number of grains, blocks and bodies at the start of the run.
    pub grains: f64,
    /// Maximum memory of all ranks together \[bytes\].
    pub memory_bytes: f64,
    /// Size of one fluid output \[bytes\].
    pub fluid_output_bytes: f64,
    /// Number of fluid outputs.
    pub fluid_outputs: f64,
    /// Size of one checkpoint \[bytes\].
    pub checkpoint_bytes: f64,
    /// Size of all outputs and of the checkpoints kept \[bytes\].
    pub disk_bytes: f64,
    /// Million lattice updates per second of one core, without solids; 0 without a lattice.
    pub mlups: f64,
    /// Speed of the present machine; 1 if it was not measured.
    pub machine: Machine,
    /// Processor time of each phase on one core \[s\].
    pub seconds: Seconds,
    /// Processor time of the run on one core \[s\].
    pub seconds_on_one_core: f64,
    /// Time in addition in which the run waits for the start of MPI and for files on their way to the disk \[s\].
    pub waiting_seconds: f64,
    /// Time on the requested cores; none if none were requested.
    pub on_cores: Option<OnCores>,
}

/// Time of a run on several cores.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OnCores {
    /// Number of MPI ranks.
    pub ranks: usize,
    /// Threads per rank.
    pub threads: usize,
    /// Speed of a core in its part of the lattice while all cores work, relative to one core in the whole lattice.
    pub crowded: f64,
    /// Number of planes of the thickest slab divided by the mean.
    pub unevenness: f64,
    /// Time of the run, waiting included \[s\].
    pub seconds: f64,
}

/// Quantities on which the costs depend.
#[derive(Clone, Copy, Debug, Default)]
pub struct CostQuantities {
    /// Number of lattice cells.
    cells: f64,
    /// Number of cells of the seepage.
    seepage_cells: f64,
    /// Number of links in a network of joints, of those in joints of blocks that can move, and of entries of its
    /// factors.
    joint_links: [f64; 2],
    joint_entries: f64,
    /// Memory of the water in joints on every rank, and size of its data in a checkpoint \[bytes\].
    joint_bytes: f64,
    joint_numbers: f64,
    /// Number of grains after cutting.
    grains: f64,
    /// Number of contacts of grains at the start, each of two grains, if their positions are known.
    contacts: f64,
    /// Number of contacts of grains with plane walls at the start if their positions are known, and of those with
    /// servo walls.
    wall_contacts: [f64; 2],
    /// Number of grains that regions generate in the run.
    generated: f64,
    /// Mean over the run of the number of these grains that are present.
    present: f64,
    /// Mean over the run of the number of these grains that fall freely, without contacts.
    falling: f64,
    /// Number of grains before cutting.
    prepared: f64,
    /// Number of blocks, including those among the bodies.
    blocks: f64,
    /// Number of named bodies that are discs or spheres.
    bodies: f64,
    /// Number of cells that contain water at the start, and mean number of those that its free surface passes.
    wet: f64,
    interface: f64,
    /// Number of cells on which terms act in addition to the pass over the lattice.
    acted_on: f64,
    /// Number of cells covered by solids.
    covered: f64,
    /// Number of cells at the surfaces of solids.
    surface: f64,
    /// Number of cells at the surfaces of named bodies and blocks that move.
    moving_surface: f64,
    /// Number of cells at the surfaces of grains.
    bed_surface: f64,
}

impl CostQuantities {
    fn new(scene: &Scene) -> Self {
        let dimension = scene.grid.dimension;
        let spacing = scene.grid.spacing;
        let cell = spacing.powi(if dimension == 3 { 3 } else { 2 });
        let face = spacing.powi(if dimension == 3 { 2 } else { 1 });
        let ball = |radius: f64| {
            if dimension == 3 {
                let area = std::f64::consts::PI * radius * radius;
                [4.0 / 3.0 * area * radius, 4.0 * area]
            } else {
                let half = std::f64::consts::PI * radius;
                [half * radius, 2.0 * half]
            }
        };
        let mut all = Self {
            cells: scene.flow.as_ref().map_or(0.0, |_| {
                scene.grid.cells.iter().map(|c| real(*c)).product::<f64>()
            }),
            seepage_cells: scene
                .seepage
                .as_ref()
                .map_or(0.0, |seepage| real(seepage.cell_count())),
            ..Self::default()
        };
        all.wet = all.cells;
        let terms = scene.terms.iter();
        all.acted_on = terms.map(|term| term.model().cells(&scene.grid)).sum();
        if let Some(surface) = &scene.surface {
            let cells = scene.grid.cells;
            let solids = || scene.structures.iter().filter(|s| s.stops.water());
            let is_solid = |at: [f64; 3]| solids().any(|s| s.solid.distance(at) < 0.0);
            all.interface = surface.interface_cells(cells, scene.time.end, is_solid);
            all.wet = if surface.openings.is_empty() {
                let planes = surface.cells_of_planes(cells, 0);
                planes.iter().map(|plane| plane[0]).sum::<f64>()
            } else {
                surface.cells_filled(cells, is_solid)
            };
        }
        if let Some(joints) = &scene.joints {
            all.joint_links = [joints.counts.links, joints.moving_links].map(real);
            all.joint_entries = real(joints.entries);
            // The old and the new network of blocks that have moved are there together.
            let networks = if joints.movers > 0 { 2.0 } else { 1.0 };
            all.joint_bytes = networks * real(joints.bytes);
            all.joint_numbers = real(joints.numbers);
        }
        let mut add = |[volume, area]: [f64; 2], number: f64, moves: bool| {
            all.covered += number * volume / cell;
            all.surface += number * area / face;
            if moves {
                all.moving_surface += number * area / face;
            }
        };
        for body in &scene.bodies {
            let size = match &body.solid {
                None => ball(body.radius),
                Some(solid) => [solid.shape.volume(), solid.shape.area()],
            };
            add(size, 1.0, body.mobility != Mobility::Fixed);
        }
        for block in scene.blocks.iter().flat_map(|blocks| &blocks.list) {
            let shape = &block.solid.shape;
            add([shape.volume(), shape.area()], 1.0, !block.fixed);
        }
        if let Some(grains) = &scene.grains {
            let remaining = grains.remaining();
            if let Some((least, most)) = grains.radii {
                let one = ball(0.5 * (least + most));
                add(one, remaining, false);
                all.bed_surface = remaining * one[1] / face;
            }
            all.grains = remaining;
            all.contacts = real(grains.contacts);
            all.wall_contacts = wall_contacts(scene, grains);
            all.prepared = real(grains.expected);
        }
        for (region, radii) in scene.regions.iter().filter_map(generating) {
            let (least, most) = radii.bounds();
            let one = ball(0.5 * (least + most));
            let [generated, present] = generated_grains(scene, region, one[0]);
            add(one, present, false);
            all.bed_surface += present * one[1] / face;
            all.generated += generated;
            all.present += present;
            all.falling += (generated * fall_time(scene, region) / scene.time.end).min(present);
        }
        all.covered = all.covered.min(all.cells);
        all.blocks = real(scene.polyhedra().count());
        all.bodies = real(scene.bodies.iter().filter(|b| b.solid.is_none()).count());
        all
    }

    /// Returns the largest number of grains, blocks and bodies in the contact search.
    fn moving(&self) -> f64 {
        self.grains + self.generated + self.blocks + self.bodies
    }
}

/// Fraction of the domain that loose grains can fill.
const DENSEST: f64 = 0.64;

/// Returns a region that generates grains, with their radii.
fn generating(region: &ObservedRegion) -> Option<(&ObservedRegion, &Radii)> {
    match &region.action {
        RegionAction::Generate { radii, .. } => Some((region, radii)),
        _ => None,
    }
}

/// Returns the number of grains of a mean volume \[m³; in 2-D m²\] that a region generates in the run, and the mean
/// over the run of their number, if none is removed: the number grows at the rate of the region up to its maximum, or
/// until the domain is full.
fn generated_grains(scene: &Scene, region: &ObservedRegion, volume: f64) -> [f64; 2] {
    let RegionAction::Generate { rate, at_most, .. } = region.action else {
        return [0.0; 2];
    };
    let end = scene.time.end;
    let space: f64 = scene.grid.size[..scene.grid.dimension].iter().product();
    let most = at_most
        .map_or(f64::INFINITY, f64::from)
        .min(DENSEST * space / volume);
    let all = (rate * end).min(most);
    let growing = if rate > 0.0 { all / rate } else { 0.0 };
    [all, all * (1.0 - 0.5 * growing / end)]
}

/// Returns the time \[s\] in which a grain falls freely from the middle of a region to the end of the domain; 0 in a
/// fluid, which slows it, and without gravity.
fn fall_time(scene: &Scene, region: &ObservedRegion) -> f64 {
    let wet = scene.flow.is_some() || scene.seepage.is_some() || scene.joints.is_some();
    let times = (0..scene.grid.dimension).map(|axis| {
        let pull = scene.gravity[axis];
        let middle = 0.5 * (region.block.from[axis] + region.block.to[axis]);
        let height = if pull > 0.0 {
            scene.grid.size[axis] - middle
        } else {
            middle
        };
        (2.0 * height.max(0.0) / pull.abs()).sqrt()
    });
    Some(times.fold(f64::INFINITY, f64::min))
        .filter(|time| !wet && time.is_finite())
        .unwrap_or(0.0)
}

/// Returns the number of contacts of listed grains with plane walls at the start, and of those with servo walls.
fn wall_contacts(scene: &Scene, grains: &Grains) -> [f64; 2] {
    let (GrainSource::List(list) | GrainSource::File { grains: list, .. }) = &grains.source else {
        return [0.0; 2];
    };
    let mut counts = [0.0; 2];
    for wall in scene.walls.iter().filter(|wall| wall.exists(0.0)) {
        if wall.surface.is_some() {
            continue;
        }
        let touches = list.iter().filter(|grain| {
            let height = (0..3).map(|a| (grain.position[a] - wall.point[a]) * wall.normal[a]);
            height.sum::<f64>() <= grain.radius * (1.0 + TOUCHES)
        });
        let touches = real(touches.count());
        counts[0] += touches;
        counts[1] += if wall.servo.is_some() { touches } else { 0.0 };
    }
    counts
}

/// Returns the number of outputs at an interval \[s\]: at 0, at multiples of the interval, and at the end.
fn outputs(every: f64, end: f64) -> f64 {
    (end / every - 1e-9).ceil().max(0.0) + 1.0
}

impl Estimate {
    pub(crate) fn for_scene(scene: &Scene, clock: &Clock, findings: &mut Findings) -> Self {
        let amounts = CostQuantities::new(scene);
        let mut estimate = Self {
            grains: amounts.moving() - amounts.generated,
            mlups: scene.flow.as_ref().map_or(0.0, time::mlups),
            ..Self::default()
        };
        estimate.checkpoint_bytes = disk::checkpoint(scene, &amounts);
        estimate.count_time(scene, clock);
        disk::count(&mut estimate, scene, &amounts);
        memory::count(&mut estimate, scene, &amounts);
        estimate.against_machine(scene, findings);
        estimate
    }

    fn count_time(&mut self, scene: &Scene, clock: &Clock) {
        self.seconds = Seconds::for_scene(
            scene,
            clock,
            &CostQuantities::new(scene),
            self.machine,
            self.checkpoint_bytes,
        );
        self.seconds_on_one_core = self.seconds.sum();
        self.waiting_seconds = time::waiting(scene, self.machine);
    }

    /// Converts the estimate to a machine of this speed.
    pub fn on(&mut self, machine: Machine, scene: &Scene, clock: &Clock) {
        let known = |speed: f64| speed > 0.0 && speed.is_finite();
        if known(machine.fluid) && known(machine.grains) {
            self.mlups *= machine.fluid / self.machine.fluid;
            self.machine = machine;
            self.count_time(scene, clock);
        }
    }

    /// Estimates the time on this number of ranks and threads. Start, end and output use one core; all other work
    /// is divided among the cores, the pass over the lattice at the speed of cores that work at the same time.
    /// Messages are not included.
    pub fn on_cores(&mut self, scene: &Scene, ranks: usize, threads: usize, crowded: f64) {
        let planes = scene.grid.cells[scene.grid.split_axis.min(2)];
        let cores = real(ranks * threads);
        let unevenness = real(planes.div_ceil(ranks) * ranks) / real(planes.max(1));
        let alone = self.seconds.start_and_end + self.seconds.output;
        let shared = self.seconds.sum() - alone - self.seconds.fluid;
        let alone = alone + self.waiting_seconds;
        let seconds = alone + (shared + self.seconds.fluid / crowded) * unevenness / cores;
        self.on_cores = Some(OnCores {
            ranks,
            threads,
            crowded,
            unevenness,
            seconds,
        });
    }

    /// Returns the smallest spacing \[m\] with whole cells along every edge for which the memory is at most
    /// `available` \[bytes\]; none without a lattice, or if the grains alone need more.
    fn spacing_within(&self, scene: &Scene, available: f64) -> Option<f64> {
        scene.flow.as_ref()?;
        let grid = &scene.grid;
        let cells = &grid.cells[..grid.dimension];
        let mut lattice = self.bytes_per_cell * cells.iter().map(|c| real(*c)).product::<f64>();
        // The memory in which an output is gathered grows with the number of cells, too.
        if self.fluid_output_bytes > disk::tables(&CostQuantities::new(scene)) {
            lattice += self.fluid_output_bytes;
        }
        let room = available - (self.memory_bytes - lattice);
        let coarser = (lattice / room).powf(1.0 / real(grid.dimension));
        // Edges remain whole numbers of cells if the cells along all edges are divided in the same ratio.
        let common = cells.iter().fold(0, |a, b| common_divisor(a, *b));
        let fewer = whole((real(common) / coarser).floor());
        (room > 0.0 && fewer > 0).then(|| grid.spacing * real(common) / real(fewer))
    }

    fn against_machine(&self, scene: &Scene, findings: &mut Findings) {
        let Some(available) = machine::memory(scene.guards.memory_gib) else {
            return;
        };
        if self.memory_bytes > available || self.memory_bytes.is_nan() {
            let grid = &scene.grid;
            let cells = grid.cells[..grid.dimension].iter().map(ToString::to_string);
            let mut reason = format!(
                "the run needs about {} of memory for {} cells of {} m, but {} are available",
                size(self.memory_bytes),
                cells.collect::<Vec<_>>().join(" x "),
                number(grid.spacing),
                size(available)
            );
            if let Some(why) = scene.chosen.reason_of(Subject::Spacing) {
                reason.push_str("; the spacing was chosen for ");
                reason.push_str(why);
            }
            let machines = "or set guards.memory_gib to the memory of all machines";
            let remedy = match self.spacing_within(scene, 0.75 * available) {
                Some(spacing) => {
                    let text = format!(
                        "write a spacing of {} m, which fits, choose a smaller domain, {machines}",
                        number(spacing)
                    );
                    (scene.chosen).state_spacing(Remedy::from(text), spacing)
                }
                None => format!("choose a smaller domain or fewer grains, {machines}").into(),
            };
            findings.error("domain.spacing", reason, remedy);
        } else if self.memory_bytes > 0.8 * available {
            findings.warn(
                "domain.spacing",
                format!(
                    "the run needs about {} of {} of memory",
                    size(self.memory_bytes),
                    size(available)
                ),
                "reduce the size of the case, so that memory is left for the operating system",
            );
        }
    }
}

/// Returns a number of bytes as text.
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

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::number::real;
    use case::{Document, examples};
    use std::path::Path;

    fn planned(name: &str, set: &[&str]) -> Result<Plan, Vec<base::error::Problem>> {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let text = examples::find(name).unwrap().text;
        Document::read(text, &set, Path::new(".")).and_then(Plan::prepare)
    }

    #[test]
    fn ranks_and_threads_share_all_but_start_end_and_output() {
        let mut plan = planned("taylor-green", &["domain.spacing=1.5625e-5"]).unwrap();
        let one = plan.estimate.seconds_on_one_core;
        plan.on_cores(1, 1, 1.0);
        let on = |plan: &Plan| plan.estimate.on_cores.unwrap();
        let waiting = plan.estimate.waiting_seconds;
        assert!((on(&plan).seconds / (one + waiting) - 1.0).abs() < 1e-12);
        let seconds = plan.estimate.seconds;
        let alone = seconds.start_and_end + seconds.output;
        plan.on_cores(3, 2, 0.5);
        let rest = one - alone + seconds.fluid;
        let planes = plan.scene.grid.cells[plan.scene.grid.split_axis];
        let unevenness = 3.0 * real(planes.div_ceil(3)) / real(planes);
        assert!((on(&plan).unevenness - unevenness).abs() < 1e-12);
        let expected = alone + waiting + rest / 6.0 * unevenness;
        assert!((on(&plan).seconds / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn too_much_memory_comes_with_a_spacing_that_fits() {
        // 1.6e9 cells with nine populations each.
        let fine = "domain.spacing=2.5e-7";
        let limit = "guards.memory_gib=8";
        let problems = planned("taylor-green", &[fine, limit]).unwrap_err();
        let problem = problems
            .iter()
            .find(|p| p.path == "domain.spacing")
            .unwrap_or_else(|| panic!("{problems:#?}"));
        assert!(problem.reason.contains("40000 x 40000 cells"), "{problem}");
        let proposal = problem.remedy.proposal();
        assert_eq!(proposal[0].path, "domain.spacing");
        let spacing = format!("domain.spacing={}", proposal[0].value);
        let plan = planned("taylor-green", &[&spacing, limit]).unwrap();
        let memory = plan.estimate.memory_bytes / (8.0 * 1024.0_f64.powi(3));
        assert!((0.6..=0.8).contains(&memory), "{memory}");
    }

    /// Checks that a grid of 1e10 cells is refused before anything is allocated for each of them.
    #[test]
    fn too_many_cells_of_seepage_are_refused_at_once() {
        let problems = planned(
            "sheet-pile",
            &["fluid.darcy.grid={\"cells\": [100000, 100000]}"],
        );
        let problems = problems.unwrap_err();
        let paths: Vec<&str> = problems.iter().map(|p| p.path.as_str()).collect();
        assert_eq!(paths, ["fluid.darcy.grid"], "{problems:#?}");
        assert!(
            problems[0].reason.contains("1.000e10 cells"),
            "{}",
            problems[0]
        );
    }

    /// Checks the contacts of a regular packing against a count of its pairs, and its time against that measured on a
    /// core half as fast as the reference, 1.05 s.
    #[test]
    fn a_regular_packing_costs_by_its_contacts() {
        let plan = planned("oedometer", &[]).unwrap();
        assert_eq!(plan.scene.grains.as_ref().unwrap().contacts, 342);
        let seconds = plan.estimate.seconds.grains / 0.497;
        assert!((seconds / 1.05 - 1.0).abs() < 0.25, "{seconds}");
    }

    /// Checks the contacts with walls against those of the layers of the array: three of 4 x 4 spheres and two of 3 x 3
    /// between them, of which the upper and the lower layer of 16 touch the plates above and below, and rows of
    /// four the plates at the sides. Three of the six plates are servo walls. The run took 2.3 s on a core half as fast
    /// as the reference.
    #[test]
    fn contacts_with_walls_and_servos_are_counted() {
        let plan = planned("triaxial", &[]).unwrap();
        let amounts = super::CostQuantities::new(&plan.scene);
        assert!(amounts.wall_contacts == [80.0, 40.0], "{amounts:?}");
        let seconds = plan.estimate.seconds.grains / 0.497;
        assert!((seconds / 2.3 - 1.0).abs() < 0.25, "{seconds}");
    }

    fn plan_of(case: &serde_json::Value) -> Plan {
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"))
    }

    /// Checks the time that porous zones add in 1500 steps of 160 x 100 cells against runs on a core of 0.261 of the
    /// speed of the reference: 4.28 s more than without a zone where all cells are porous, and 2.08 s for half of them.
    #[test]
    fn cells_of_porous_zones_cost_their_own_time() {
        let with = |part: Option<f64>| {
            let zone = |part| {
                serde_json::json!([{
                    "name": "bed", "shape": {"box": {"from": [0, 0], "to": [0.08 * part, 0.05]}},
                    "resistance": {"darcy_forchheimer": {"permeability": 1e-5}}
                }])
            };
            plan_of(&serde_json::json!({
                "domain": {"size": [0.08, 0.05], "spacing": 5e-4},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.7,
                    "porous_zones": part.map_or_else(|| serde_json::json!([]), zone),
                    "boundaries": [{"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}}]
                }},
                "time": {"end": 2.5}
            }))
        };
        let seconds = |plan: &Plan| plan.estimate.seconds.fluid;
        let open = with(None);
        assert_eq!(open.clock.steps, 1500);
        for (part, measured) in [(1.0, 4.28), (0.5, 2.08)] {
            let more = (seconds(&with(Some(part))) - seconds(&open)) / 0.261;
            assert!((more / measured - 1.0).abs() < 0.25, "{part}: {more}");
        }
    }

    /// Checks the number of grains that a region generates, and the time against a run on a core of 0.261 of the speed
    /// of the reference: 1.43 s for 500 spheres within a quarter of a second.
    #[test]
    fn generated_grains_cost_from_their_birth_on() {
        let with = |rate: f64, end: f64| {
            plan_of(&serde_json::json!({
                "domain": {"size": [0.02, 0.02, 0.03], "spacing": 5e-4},
                "gravity": [0, 0, -9.81],
                "materials": {"sand": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.25}},
                "grains": {"material": "sand", "initial": {"list": [
                    {"position": [0.01, 0.01, 0.001], "radius": 9e-4}
                ]}},
                "regions": [{"name": "source", "box": {"from": [0.002, 0.002, 0.02], "to": [0.018, 0.018, 0.028]},
                    "action": {"generate": {"radii": {"uniform": {"min": 8e-4, "max": 1e-3}}, "rate": rate,
                        "at_most": 500}}}],
                "contact": {"hertz_mindlin": {
                    "friction_angle_degrees": 20, "restitution": 0.4, "impact_speed": 1.0
                }},
                "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"],
                "time": {"end": end}
            }))
        };
        let amounts = |plan: &Plan| super::CostQuantities::new(&plan.scene);
        let slow = with(2000.0, 0.25);
        assert!((amounts(&slow).present - 250.0).abs() < 1e-9);
        // All are there after a fifth of the run: 0.8 + 0.2/2 of them in the mean.
        assert!((amounts(&with(10_000.0, 0.25)).present - 450.0).abs() < 1e-9);
        assert!((amounts(&with(2000.0, 0.1)).generated - 200.0).abs() < 1e-9);
        let seconds = slow.estimate.seconds.grains / 0.261;
        assert!((seconds / 1.43 - 1.0).abs() < 0.25, "{seconds}");
    }

    #[test]
    fn cut_grains_cost_memory_but_no_steps() {
        let whole = planned("piping", &["grains.cut=[]"]).unwrap();
        let cut = planned("piping", &[]).unwrap();
        let part = cut.estimate.grains / whole.estimate.grains;
        // The part contains the hole and the margins next to the bulk.
        assert!((0.3..0.7).contains(&part), "{part}");
        assert!(cut.estimate.seconds.grains < whole.estimate.seconds.grains);
        approx::assert_relative_eq!(
            cut.estimate.seconds.preparation,
            whole.estimate.seconds.preparation
        );
    }

    /// Compares the time of the search for growing waves with 0.19 s, by which `solver validate` takes longer with the
    /// operator of Suga than with two rates, on a core half as fast as the reference.
    #[test]
    fn the_search_for_growing_waves_is_counted() {
        let start = |collision: &str| {
            let set = format!("fluid.lattice_boltzmann.collision={{\"{collision}\": {{}}}}");
            let plan = planned("incline", &[&set]).unwrap();
            plan.estimate.seconds.start_and_end / 0.495
        };
        let search = start("suga") - start("trt");
        assert!((search / 0.19 - 1.0).abs() < 0.25, "{search}");
    }

    /// Compares the planned processor time with that of runs on a core half as fast as the reference, whose measured
    /// speeds are listed: short runs, in which the start matters, free surfaces that spread, bodies in them, walls and
    /// servo walls, an operator whose waves are searched, loose grains and transient unsaturated ground. The machine
    /// computed other work at the same time.
    #[test]
    fn processor_time_is_that_of_runs() {
        let runs = [
            ("couette", [0.552, 0.496], 0.265),
            ("poiseuille", [0.551, 0.495], 0.232),
            ("direct-shear", [1.0, 0.496], 0.231),
            ("cavity", [0.836, 0.496], 1.14),
            ("dam-break", [0.671, 0.495], 0.387),
            ("standing-wave", [0.59, 0.496], 0.623),
            ("floating-log", [0.726, 0.494], 2.07),
            ("broad-crested-weir", [0.748, 0.496], 43.5),
            ("chute", [1.158, 0.495], 89.9),
            ("rock-into-reservoir", [0.704, 0.494], 47.3),
            ("triaxial", [1.0, 0.495], 2.35),
            ("biaxial", [1.0, 0.496], 0.63),
            ("incline", [0.632, 0.495], 1.91),
            ("infiltration", [1.0, 0.494], 2.43),
            ("drawdown", [1.0, 0.494], 8.01),
        ];
        for (name, [fluid, grains], used) in runs {
            let mut plan = planned(name, &[]).unwrap();
            let machine = super::Machine {
                fluid,
                grains,
                ..super::Machine::default()
            };
            plan.estimate.on(machine, &plan.scene, &plan.clock);
            let ratio = plan.estimate.seconds_on_one_core / used;
            assert!((0.8..1.25).contains(&ratio), "{name}: {ratio}");
            assert!(plan.estimate.waiting_seconds > 0.3, "{name}");
        }
    }
}
