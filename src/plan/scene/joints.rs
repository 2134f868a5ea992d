//! Water in the joints of a scene: the network is constructed from the initial blocks, and the mouths from their
//! boxes.

use super::aligned_box::AlignedBox;
use super::blocks::PlacedBlocks;
use super::contact::ContactTable;
use super::findings::{Findings, at_least, at_most, number};
use super::flow::Flow;
use super::grid::Grid;
use super::joint_methods::{JointMethods, WIDE, pair_limits, rocks};
use super::unique;
use base::error::Remedy;
use case::Case;
use case::coupling::Coupling;
use case::fluid::{Device, Fluid, Precision};
use case::joints::JointNetwork;
use joints::flow::{FlowSettings, JointFlow};
use joints::history::PressureHistory;
use joints::motion::Mover;
use joints::network::{Network, NetworkSettings, UnderLattice};
use joints::pairs::{Joint, PairLimits};
use joints::water::Mixture;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use serde_json::json;

/// Path of the water in joints without a lattice, and under one.
const JOINTS_PATH: &str = "fluid.joints";
const LATTICE_JOINTS_PATH: &str = "fluid.lattice_boltzmann.joints";
/// Path of the number of steps of a lattice in a step of the joints.
const STEPS_PATH: &str = "fluid.lattice_boltzmann.joints.lattice_steps";
/// Maximum number of cells: every rank stores and solves all of them.
const MAX_CELLS: f64 = 2e5;
/// Number of cells across a film from which on its force is at most an eighth too large.
const FEWEST_CELLS_OF_FILM: f64 = 4.0;

/// Water in joints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointScene {
    /// Fields as written in the case.
    pub written: JointNetwork,
    /// Mouths, in the order of the case.
    pub mouths: Vec<SceneMouth>,
    /// Numbers of joints, cells, junctions and links.
    pub counts: Counts,
    /// Total length of open edges, then of closed edges \[m\].
    pub edges: [f64; 2],
    /// Smallest and largest aperture at the middle of a joint \[m\].
    pub apertures: [f64; 2],
    /// Longest joint \[m\].
    pub longest: f64,
    /// Axes along which gravity acts on the water; none under a lattice whose pressure leaves the hydrostatic one out.
    pub gravity_acts: [bool; 3],
    /// `true` if the mouths are cells of a lattice.
    pub under_lattice: bool,
    /// Number of steps of the lattice in a step of the joints; 1 without a lattice.
    pub lattice_steps: u32,
    /// Number of joints that the lattice computes.
    pub joints_of_lattice: usize,
    /// Largest aperture of a joint of the network \[m\]; negative if the method has no network.
    pub limit: f64,
    /// Apertures above which a joint occupies cells of the lattice, and above which the lattice takes it over \[m\];
    /// none without a lattice.
    pub lattice_limits: Option<[f64; 2]>,
    /// Number of blocks that can move.
    pub movers: usize,
    /// Number of links in joints of blocks that can move.
    pub moving_links: usize,
    /// Number of entries of the factors.
    pub entries: usize,
    /// Memory of the network with its factors, on every rank \[bytes\].
    pub bytes: usize,
    /// Number of values that the water in the joints adds to a checkpoint.
    pub numbers: usize,
}

/// Size of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Number of joints.
    pub joints: usize,
    /// Number of cells.
    pub cells: usize,
    /// Number of junctions.
    pub junctions: usize,
    /// Number of links.
    pub links: usize,
    /// Number of open pieces of edges.
    pub mouths: usize,
}

/// Mouth of the joints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneMouth {
    /// Name of the mouth.
    pub name: String,
    /// Box that contains the midpoints of its edges.
    pub block: AlignedBox,
    /// Pressure at the centre of the box over time.
    pub pressure: PressureHistory,
    /// `true` if the water also presses on blocks that can move.
    pub presses_on_blocks: bool,
    /// Total length of its edges \[m\].
    pub width: f64,
}

impl JointScene {
    /// Returns the network of joints between the blocks.
    #[must_use]
    pub fn network(&self, blocks: &PlacedBlocks) -> Network {
        network(&self.written, (self.limit, self.lattice_limits), blocks)
    }

    /// Returns the number of nodes.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.counts.cells + self.counts.junctions
    }

    /// Returns the mouth of each open piece of an edge; none for a closed piece.
    #[must_use]
    pub fn mouth_of_pieces(&self, network: &Network) -> Vec<Option<usize>> {
        let pieces = network.open.iter();
        let mouth = |middle: &Vector3<f64>| {
            let at = (*middle).into();
            self.mouths
                .iter()
                .position(|mouth| mouth.block.contains(at))
        };
        pieces.map(|piece| mouth(&piece.middle)).collect()
    }

    /// Returns the settings of the flow solver.
    #[must_use]
    pub fn settings(&self, gravity: [f64; 3]) -> FlowSettings {
        let written = &self.written;
        FlowSettings {
            water: water(written),
            roughness: written.joints.roughness,
            inertia: written.inertia,
            gravity: std::array::from_fn(|axis| {
                if self.gravity_acts[axis] {
                    gravity[axis]
                } else {
                    0.0
                }
            })
            .into(),
        }
    }

    /// Resolves the water in the joints of a case.
    pub(crate) fn resolve(
        case: &Case,
        grid: &Grid,
        (blocks, contact): (Option<&PlacedBlocks>, Option<&ContactTable>),
        flow: Option<&Flow>,
        findings: &mut Findings,
    ) -> Option<Self> {
        let mut lattice_steps = 1;
        let (written, path) = match &case.fluid {
            Some(Fluid::Joints(written)) => (written.clone(), JOINTS_PATH),
            Some(Fluid::LatticeBoltzmann(water)) => {
                let joints = water.joints.as_ref()?;
                let step = flow.map_or(1.0, |flow| flow.time_step);
                let water = [water.density, water.kinematic_viscosity];
                lattice_steps = joints.lattice_steps.max(1);
                (joints.network(water, step), LATTICE_JOINTS_PATH)
            }
            _ => return None,
        };
        let (written, under_lattice) = (&written, path == LATTICE_JOINTS_PATH);
        let methods = JointMethods::resolve(case, grid, blocks);
        check_water(written, path, findings);
        let mouths = if under_lattice {
            refuse_lattice(case, findings);
            Vec::new()
        } else {
            refuse_others(case, findings);
            mouths(case, written, grid, findings)
        };
        if case.blocks.is_none() {
            findings.error(
                path,
                "the case has no blocks and therefore no joints",
                "add `blocks` with a list, a file or a jointed rock mass",
            );
            findings.depends(&["blocks"]);
        }
        let blocks = blocks?;
        let movers = blocks.number - blocks.fixed;
        if movers > 0 {
            refuse_for_motion(case, contact, findings);
            refuse_steps_with_movers(lattice_steps, movers, findings);
        }
        if !thin_enough(written, path, blocks, findings) {
            return None;
        }
        let mut scene = Self {
            written: written.clone(),
            mouths,
            counts: Counts::default(),
            edges: [0.0; 2],
            apertures: [f64::INFINITY, 0.0],
            longest: 0.0,
            gravity_acts: flow.map_or([true; 3], |flow| flow.gravity_acts),
            under_lattice,
            lattice_steps,
            joints_of_lattice: methods.as_ref().map_or(0, |methods| methods.lattice.joints),
            limit: methods
                .as_ref()
                .map_or(written.joints.largest_aperture, JointMethods::limit),
            lattice_limits: methods.as_ref().map(|methods| methods.lattice_limits(grid)),
            movers,
            moving_links: 0,
            entries: 0,
            bytes: 0,
            numbers: 0,
        };
        scene.measure(path, (blocks, grid), findings);
        Some(scene)
    }

    /// Checks the size of the cells of joints that occupy cells of the lattice.
    fn check_cells(&self, grid: &Grid, findings: &mut Findings) {
        let wide = WIDE * grid.spacing;
        if self.apertures[1] > wide && self.written.joints.cell < grid.spacing * (1.0 - 1e-9) {
            let path = format!("{LATTICE_JOINTS_PATH}.cell");
            findings.error(
                &path,
                "in a joint wider than half a cell of the lattice, waves grow between shorter cells and the lattice",
                Remedy::from(format!("use at least {} m", number(grid.spacing)))
                    .set(&*path, grid.spacing),
            );
        }
    }

    /// Warns of joints that their cells do not resolve: a film of n cells that a moving block squeezes, and any joint
    /// of one cell.
    ///
    /// Between parallel edges at a distance L the flux of the film grows linearly from the middle, and the two-point
    /// fluxes of n cells give 1 + 2/n² of its force, μ V L³/h³ per length (Stefan 1874, Reynolds 1886). The joint of
    /// moving blocks whose film is the strongest counts, with its shorter side.
    fn warn_of_few_cells(
        &self,
        path: &str,
        (blocks, grid): (&PlacedBlocks, &Grid),
        network: &Network,
        findings: &mut Findings,
    ) {
        let cell = self.written.joints.cell;
        let path = format!("{path}.cell");
        let moves = |joint: &&Joint| {
            let mut rocks = joint.faces.iter().map(|face| face.rock);
            rocks.any(|rock| !blocks.list[rock].fixed)
        };
        let films = network.joints.iter().filter(moves).map(|joint| {
            let [low, high] = joint.overlap.bounds();
            let (short, long) = ((high - low).amin(), (high - low).amax());
            (short.powi(3) * long, short)
        });
        let film = films.max_by(|a, b| a.0.total_cmp(&b.0));
        let (length, fewest) = match film {
            Some((_, short)) => (short, FEWEST_CELLS_OF_FILM),
            None => (self.longest, 2.0),
        };
        let cells = (length / cell - 1e-9).ceil().max(1.0);
        // Cells of wide joints may not be shorter than those of the lattice.
        let bound = if self.under_lattice && self.apertures[1] > WIDE * grid.spacing {
            grid.spacing
        } else {
            0.0
        };
        let fine = at_most(length / FEWEST_CELLS_OF_FILM);
        if cells >= fewest || fine < bound || findings.concerns(&path) {
            return;
        }
        let (length, cell) = (number(length), number(cell));
        let reason = if film.is_some() {
            format!(
                "the strongest film between moving blocks is {length} m wide and has {cells} cell(s) across, of at \
                 most {cell} m: such a film exerts about {} times its force where it closes",
                number(1.0 + 2.0 / (cells * cells))
            )
        } else {
            format!(
                "the longest joint has {length} m, and a cell may have {cell} m: every joint is a single cell with one \
                 pressure"
            )
        };
        let remedy = Remedy::from(format!("use at most {} m", number(fine)));
        findings.warn(&path, reason, remedy.set(&*path, fine));
    }

    /// Builds the network, counts its parts and checks its mouths.
    fn measure(
        &mut self,
        path: &str,
        (blocks, grid): (&PlacedBlocks, &Grid),
        findings: &mut Findings,
    ) {
        let network = self.network(blocks);
        let mouth_of = self.mouth_of_pieces(&network);
        self.counts = Counts {
            joints: network.joints.len(),
            cells: network.cells.len(),
            junctions: network.junctions.len(),
            links: network.links.len(),
            mouths: network.open.len(),
        };
        for joint in &network.joints {
            let [low, high] = &mut self.apertures;
            let aperture = joint
                .gap
                .constant
                .max(self.written.joints.residual_aperture);
            *low = low.min(aperture);
            *high = high.max(aperture);
            self.longest = self.longest.max(joint.overlap.size());
        }
        for (piece, mouth) in network.open.iter().zip(&mouth_of) {
            self.edges[usize::from(mouth.is_none())] += piece.width;
            if let Some(mouth) = mouth {
                self.mouths[*mouth].width += piece.width;
            }
        }
        if network.joints.is_empty() && self.joints_of_lattice == 0 {
            let path = format!("{path}.largest_aperture");
            findings.error(
                &path,
                "no two faces of different blocks are parallel and closer than this aperture",
                "use a larger aperture, or move the blocks closer to each other",
            );
            return;
        }
        if self.under_lattice {
            self.check_cells(grid, findings);
        }
        self.warn_of_few_cells(path, (blocks, grid), &network, findings);
        let moves = |joint: usize| {
            let rocks = network.joints[joint].faces.map(|face| face.rock);
            rocks.iter().any(|rock| !blocks.list[*rock].fixed)
        };
        let moving = network.links.iter().filter(|link| moves(link.joint));
        self.moving_links = moving.count();
        let movers = (blocks.list.iter().enumerate())
            .filter(|(_, block)| !block.fixed)
            .map(|(n, block)| Mover::new(n, 1.0, Matrix3::identity(), block.solid.position));
        let flow = JointFlow::with_movers(network, self.settings([0.0; 3]), movers.collect());
        self.entries = flow.factor_entries();
        self.bytes = flow.bytes();
        self.numbers = flow.state().len();
        for (n, mouth) in self.mouths.iter().enumerate() {
            if mouth.width <= 0.0 {
                findings.error(
                    &format!("{path}.mouths[{n}].box"),
                    "this box does not contain the midpoint of any edge of a joint",
                    "move the box or make it larger: an edge ends where one of its two blocks ends",
                );
            }
        }
    }
}

/// Returns the network of joints between the blocks.
fn network(
    written: &JointNetwork,
    (limit, lattice): (f64, Option<[f64; 2]>),
    blocks: &PlacedBlocks,
) -> Network {
    let settings = NetworkSettings {
        limits: PairLimits {
            distance: limit,
            ..pair_limits(&written.joints)
        },
        residual_aperture: written.joints.residual_aperture,
        cell: written.joints.cell,
        under: lattice.map(|[wide, takeover]| UnderLattice { wide, takeover }),
    };
    Network::new(&rocks(blocks), &settings)
}

fn water(written: &JointNetwork) -> Mixture {
    Mixture {
        density: written.density,
        viscosity: written.viscosity,
        bulk_modulus: written.joints.bulk_modulus,
        air: written.joints.air_content,
        exponent: written.joints.air_exponent,
        atmosphere: written.joints.atmospheric_pressure,
        vapour: written.joints.vapour_pressure,
    }
}

/// Refuses features that do not act on water in joints.
fn refuse_others(case: &Case, findings: &mut Findings) {
    let fields = [
        ("grains", case.grains.is_some()),
        ("bodies", !case.bodies.is_empty()),
        ("structures", !case.structures.is_empty()),
        ("coupling", case.coupling.is_some()),
        ("output.fluid", case.output.fluid.is_some()),
        ("output.averages", case.output.averages.is_some()),
        ("time.warm_up", case.time.warm_up.is_some()),
        ("time.solid_time_step", case.time.solid_time_step.is_some()),
    ];
    for (path, _) in fields.iter().filter(|(_, given)| *given) {
        let reason = match *path {
            "time.solid_time_step" => "the water in the joints has its own time step",
            "output.fluid" | "output.averages" => {
                "joints contain no grid cells that could be written"
            }
            "time.warm_up" => "the water in the joints starts with its steady flow",
            _ => "the water in joints acts on blocks only",
        };
        findings.error(path, reason, Remedy::take_out("remove it", path));
    }
    if case.domain.periodic.iter().any(|axis| axis.index() < 3) {
        findings.error(
            "domain.periodic",
            "joints do not continue across periodic faces",
            Remedy::take_out("remove it", "domain.periodic"),
        );
    }
}

/// Refuses features that do not work with a lattice over joints.
fn refuse_lattice(case: &Case, findings: &mut Findings) {
    let Some(Fluid::LatticeBoltzmann(water)) = &case.fluid else {
        return;
    };
    if !matches!(case.coupling, Some(Coupling::BounceBack(_))) {
        findings.error(
            "coupling",
            "water in joints under a lattice needs a coupling whose loads act on the faces between cells",
            Remedy::from("use bounce_back").set("coupling", json!({"bounce_back": {}})),
        );
    }
    let fields = [
        ("surface", water.surface.is_some(), "a free surface"),
        (
            "storage",
            water.storage == Some(Precision::F32),
            "populations in f32, which lose the water of small discharges by rounding",
        ),
        (
            "arithmetic",
            water.arithmetic == Precision::F32,
            "collisions in f32, which lose the water of small discharges by rounding",
        ),
        ("device", water.device == Device::Gpu, "a GPU"),
    ];
    for (field, _, what) in fields.iter().filter(|(_, given, _)| *given) {
        let path = format!("fluid.lattice_boltzmann.{field}");
        let reason = format!("joints under a lattice do not work with {what} yet");
        findings.error(&path, reason, Remedy::take_out("remove it", &path));
    }
    if case.time.warm_up.is_some() {
        let reason = "the water in the joints begins at the reference pressure with the run itself";
        findings.error(
            "time.warm_up",
            reason,
            Remedy::take_out("remove it", "time.warm_up"),
        );
    }
}

/// Refuses features that do not work with blocks that the water moves.
fn refuse_for_motion(case: &Case, contact: Option<&ContactTable>, findings: &mut Findings) {
    let law = contact.and_then(|contact| contact.model().blocks());
    let damped = law.is_some_and(|law| law.mass_damping > 0.0);
    let fields = [
        ("contact.blocks.mass_damping", damped),
        ("regions", !case.regions.is_empty()),
    ];
    for (path, _) in fields.iter().filter(|(_, given)| *given) {
        let reason = if *path == "regions" {
            "regions cannot remove blocks that are moved by the water of their joints"
        } else {
            "the water of the joints damps the blocks, so that no other damping may act"
        };
        findings.error(path, reason, Remedy::take_out("remove it", path));
    }
}

/// Refuses several steps of the lattice in a step of the joints if this number of blocks can move.
fn refuse_steps_with_movers(lattice_steps: u32, movers: usize, findings: &mut Findings) {
    if lattice_steps <= 1 || movers == 0 {
        return;
    }
    let blocks = if movers == 1 { "block" } else { "blocks" };
    findings.error(
        STEPS_PATH,
        format!(
            "{movers} {blocks} can move, and several lattice steps in a step of the joints make such blocks unstable: \
             only 1 is allowed"
        ),
        Remedy::from("use 1, or let `blocks.fixed` contain all blocks".to_owned()).set(STEPS_PATH, 1),
    );
}

/// Checks pressures and densities of the water.
fn check_water(written: &JointNetwork, path: &str, findings: &mut Findings) {
    if written.joints.vapour_pressure >= written.joints.atmospheric_pressure {
        findings.error(
            &format!("{path}.vapour_pressure"),
            "water boils at this pressure: it must be below the atmospheric pressure",
            format!(
                "use less than {}",
                number(written.joints.atmospheric_pressure)
            )
            .as_str(),
        );
    }
    if written.joints.residual_aperture > written.joints.largest_aperture {
        let path = format!("{path}.residual_aperture");
        findings.error(
            &path,
            "this aperture is larger than `largest_aperture`",
            Remedy::from(format!(
                "use at most {}",
                number(written.joints.largest_aperture)
            ))
            .set(&*path, written.joints.largest_aperture),
        );
    }
}

/// Resolves mouths and their pressures.
fn mouths(
    case: &Case,
    written: &JointNetwork,
    grid: &Grid,
    findings: &mut Findings,
) -> Vec<SceneMouth> {
    if written.mouths.is_empty() {
        findings.error(
            &format!("{JOINTS_PATH}.mouths"),
            "there is no mouth, so that no pressure drives the water",
            "add a mouth with a box that contains ends of joints",
        );
    }
    let mut known = Vec::new();
    let mut mouths = Vec::new();
    for (n, mouth) in written.mouths.iter().enumerate() {
        let path = format!("{JOINTS_PATH}.mouths[{n}]");
        unique(&mut known, &mouth.name, &format!("{path}.name"), findings);
        let block = AlignedBox::resolve(grid, &mouth.region, &format!("{path}.box"), findings);
        check_pressure(case, written, &mouth.pressure, &path, findings);
        mouths.push(SceneMouth {
            name: mouth.name.clone(),
            block,
            pressure: mouth.pressure.clone(),
            presses_on_blocks: mouth.presses_on_blocks,
            width: 0.0,
        });
    }
    mouths
}

/// Checks the pressure in front of a mouth.
fn check_pressure(
    case: &Case,
    written: &JointNetwork,
    pressure: &PressureHistory,
    path: &str,
    findings: &mut Findings,
) {
    if let PressureHistory::Table(rows) = pressure {
        let path = format!("{path}.pressure.table");
        let falls = rows.windows(2).any(|rows| rows[1][0] < rows[0][0]);
        if rows.is_empty() || falls {
            findings.error(
                &path,
                "the table needs at least one row, and its times must increase",
                "write rows of time and pressure, sorted by time",
            );
            return;
        }
    }
    if let PressureHistory::Harmonic { frequency, .. } = pressure {
        let steps = 1.0 / (frequency * written.time_step);
        if steps < 20.0 {
            let step = at_most(0.05 / frequency);
            findings.warn(
                &format!("{JOINTS_PATH}.time_step"),
                format!("a period of the pressure has only {} steps", number(steps)),
                Remedy::from(format!(
                    "use a time step of at most {} s, for twenty steps per period",
                    number(step)
                ))
                .set(format!("{JOINTS_PATH}.time_step"), step),
            );
        }
    }
    let least = written.joints.vapour_pressure - written.joints.atmospheric_pressure;
    let [low, _] = pressure.bounds(case.time.end);
    // Water that boils at atmospheric pressure is reported separately.
    if low < least && least < 0.0 {
        findings.error(
            &format!("{path}.pressure"),
            format!(
                "the pressure falls to {} Pa, below the vapour pressure of {} Pa",
                number(low),
                number(least)
            ),
            format!("use {} Pa or more", number(at_least(least))).as_str(),
        );
    }
}

/// Returns `true` if the largest aperture is smaller than the thickness of all blocks and the network is not too
/// large; otherwise reports a finding.
fn thin_enough(
    written: &JointNetwork,
    path: &str,
    blocks: &PlacedBlocks,
    findings: &mut Findings,
) -> bool {
    let mut fits = true;
    if let Some(thinnest) = blocks.thinnest()
        && written.joints.largest_aperture >= thinnest
    {
        let path = format!("{path}.largest_aperture");
        let half = at_most(0.5 * thinnest);
        findings.error(
            &path,
            format!(
                "the thinnest block is {} m thick: faces on both sides of it would form a joint",
                number(thinnest)
            ),
            Remedy::from(format!("use at most {} m", number(half))).set(&*path, half),
        );
        fits = false;
    }
    // The area of a joint is at most that of the faces on one of its sides.
    let areas = blocks.list.iter().map(|block| block.solid.shape.area());
    let cells = 0.5 * areas.sum::<f64>() / (written.joints.cell * written.joints.cell);
    if cells > MAX_CELLS {
        let path = format!("{path}.cell");
        let size = at_least(written.joints.cell * (cells / MAX_CELLS).sqrt());
        findings.error(
            &path,
            format!(
                "the joints would have up to {} cells; at most {} are allowed",
                number(cells),
                number(MAX_CELLS)
            ),
            Remedy::from(format!("use cells of {} m or larger", number(size))).set(&*path, size),
        );
        fits = false;
    }
    fits
}
