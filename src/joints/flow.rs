//! Pressures and discharges of a network: steady, and implicit in time.
//!
//! The water of a node is conserved: with the volume `V`, the density `r` relative to that at atmospheric pressure
//! ([`crate::water`]) and the discharges `Q` of its links,
//!
//! ```text
//! d(W + V (r(p) - 1))/dt = sum of Q into the node
//! V = integral of the aperture, at least the residual one, over the cell
//! W = integral of the gap
//! ```
//!
//! `V` and `W` are equal where the joint is open. Where walls press on each other the gap is negative and the aperture
//! stays the residual one; `W` still follows the walls, which squeeze the water of their roughness, so that force and
//! change of volume belong together everywhere.
//!
//! A junction has no volume. The discharge of a link follows from its driving pressure `P = p_from - p_to + rho
//! g.(x_to - x_from)`, minus the turbulent excess `X(Q)` ([`crate::friction`]), as `Q = (P - X)/R` with the laminar
//! resistance `R = 12 mu L/(w a³)`, or with the modes of [`crate::slot`] if inertia is included. Density in
//! friction, inertia and weight is that at atmospheric pressure.
//!
//! **In time** a step has two implicit stages with the diagonal `g = 1 - 1/√2` (Alexander, SIAM J. Numer. Anal. 14,
//! 1006 (1977)): second order, L-stable, the last stage is the end of the step. The amplitude of an oscillation of
//! the frequency `w` decreases by the fraction `0.0037 (w dt)⁴` per step, so that a sharp resonance keeps its
//! width. The method is stable for any time step. A stage is a nonlinear system for the pressures only: the modes
//! are eliminated link by link. Newton's method solves it with direct factors ([`crate::ldl`]); with turbulent
//! friction it halves a step that does not reduce the imbalance. The factors are kept from iteration to iteration and
//! from step to step as long as each change is a small part of the last one (`newton`).
//!
//! **The state** consists of the pressure of each node, the modes of each link and the matrix of the factors, equal on
//! every rank.

use crate::friction::{Turbulence, cube, inertial, rough};
use crate::ldl::Factors;
use crate::motion::{FREEDOMS, LoadedCell, Mover, movers_of, touches};
use crate::network::{End, Network};
use crate::order::dissection;
use crate::polygon::LinearField;
use crate::slot::{MODES, Modes};
use crate::water::Mixture;
use decomposition::ExactSum;
use nalgebra::{Vector3, Vector6};

mod memory;
mod newton;
mod renewal;
mod walls;

/// Pairs of rotational degrees of freedom of a block.
const ROTATION_PAIRS: [[usize; 2]; 3] = [[3, 4], [3, 5], [4, 5]];
/// Diagonal of the two stages.
const DIAGONAL: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
/// Largest system whose unknowns are eliminated in the order of their degree.
const SMALL_SYSTEM: usize = 4000;

/// Settings of a flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlowSettings {
    /// Properties of the water.
    pub water: Mixture,
    /// Roughness height of the walls for turbulent friction \[m\]; none for laminar flow.
    pub roughness: Option<f64>,
    /// `true` if the inertia of the water is included.
    pub inertia: bool,
    /// Acceleration of gravity [m/s²].
    pub gravity: Vector3<f64>,
}

/// Reason for a failed solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FlowError {
    /// The system has no unique solution at a node.
    #[error("no equation determines the pressure of node {0} of the joints")]
    Singular(usize),
    /// Newton's method did not converge.
    #[error(
        "the pressures in the joints did not converge: they still change by {change:e} Pa after {steps} steps"
    )]
    NotConverged {
        /// Number of iterations.
        steps: usize,
        /// Last change of the pressures \[Pa\].
        change: f64,
    },
    /// The pressures are not finite.
    #[error("the pressures in the joints are not finite")]
    NotFinite,
}

/// Coefficients of a link in the equations.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Channel {
    /// Weight of the water between the ends of the link, positive along the link \[Pa\].
    lift: f64,
    /// Laminar resistance \[Pa s/m³\].
    resistance: f64,
    /// Total gain `w a/(rho L)` of all modes [m³/(Pa s²)].
    gain: f64,
    /// Rate `4 nu/a²` of the modes [1/s].
    rate: f64,
    turbulence: Turbulence,
}

/// Linear response of a link in a stage.
#[derive(Clone, Copy, Debug, Default)]
struct LinkResponse {
    /// Discharge at zero driving pressure \[m³/s\].
    free: f64,
    /// Derivative of the laminar discharge with respect to the driving pressure \[m³/(Pa s)\].
    slope: f64,
}

/// Boundary conditions of the network during a step.
pub trait Drive {
    /// Returns the pressure outside an open piece of an edge at a time \[Pa\]; `None` for a closed piece. A piece
    /// is open or closed at all times.
    fn pressure(&self, open: usize, time: f64) -> Option<f64>;

    /// Returns the increase of the pressure outside an open piece per discharge out of it [Pa s/m³].
    fn resistance(&self, _open: usize) -> f64 {
        0.0
    }

    /// Returns the gap of a joint at a time \[m\]; `None` for the gap of the network.
    fn gap(&self, _joint: usize, _time: f64) -> Option<LinearField> {
        None
    }
}

/// Results of a step or of a steady solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Number of Newton iterations.
    pub newton: usize,
    /// Number of factorisations of the matrix.
    pub factorisations: usize,
    /// Volume of water that entered through open edges, at atmospheric density \[m³\].
    pub entered: f64,
    /// Change of the water volume in the network that is not due to discharges \[m³\].
    pub imbalance: f64,
}

/// Pressures and discharges of a network.
#[derive(Clone, Debug)]
pub struct JointFlow {
    settings: FlowSettings,
    network: Network,
    modes: Modes,
    channels: Vec<Channel>,
    gaps: Vec<LinearField>,
    /// Volumes that store by compression \[m³\].
    volumes: Vec<f64>,
    /// Volumes that follow the walls without the displacements of the blocks, and the change of these volumes by the
    /// displacements \[m³\].
    fills: Vec<f64>,
    opened: Vec<f64>,
    /// Water of the nodes in excess of their volumes and pressures, after blocks were placed \[m³\].
    surplus: Vec<f64>,
    pressure: Vec<f64>,
    /// Discharges of the modes, link after link; none without inertia.
    mode: Vec<f64>,
    /// Parts of the modes that a stage leaves, and its duration \[s\]; none if the channels have changed.
    decays: Vec<f64>,
    decays_of: Option<f64>,
    discharge: Vec<f64>,
    /// Water that left through each open piece in the last step \[m³\].
    passed: Vec<f64>,
    /// Node with fixed pressure in each closed part of the network, found by the first solution.
    held: Vec<usize>,
    factors: Factors,
    /// Matrix of the factors: its diagonal and pairs.
    factored: [Vec<f64>; 2],
    /// `true` if the factors may be used for the next iteration.
    keeps: bool,
    /// Number of factorisations in this step.
    factorisations: usize,
    work: Work,
    /// Moving blocks, each with the adjacent cells.
    movers: Vec<Mover>,
    touches: Vec<LoadedCell>,
    /// Mover of each block.
    of_rock: Vec<Option<usize>>,
    /// Joints of moving blocks, their links and their cells.
    moving: [Vec<usize>; 3],
    /// Gaps without the displacements of the blocks, and the change of these gaps by the displacements \[m\].
    base_gaps: Vec<LinearField>,
    openings: Vec<LinearField>,
}

/// Returns the analysis of the system of a network and its blocks with nonzero entries at `pairs`.
fn factors(network: &Network, movers: &[Mover], pairs: &[[usize; 2]]) -> Factors {
    let unknowns = network.nodes() + FREEDOMS * movers.len();
    if unknowns <= SMALL_SYSTEM {
        return Factors::new(unknowns, pairs);
    }
    let centroids = movers.iter().flat_map(|mover| [mover.centroid; FREEDOMS]);
    let positions: Vec<_> = network.positions.iter().copied().chain(centroids).collect();
    Factors::in_order(dissection(&positions, pairs), pairs)
}

/// Buffers of a stage.
#[derive(Clone, Debug, Default)]
struct Work {
    answers: Vec<LinkResponse>,
    fronts: Vec<Option<f64>>,
    /// Increase of the pressure outside each open piece per discharge [Pa s/m³].
    outside: Vec<f64>,
    base: Vec<f64>,
    /// Volumes that follow the walls, at the start of the step \[m³\].
    before: Vec<f64>,
    opened: Vec<f64>,
    mode_base: Vec<f64>,
    imbalance: Vec<f64>,
    diagonal: Vec<f64>,
    pairs: Vec<f64>,
    trial: Vec<f64>,
    net: Vec<f64>,
    /// First iterate of a stage.
    first: Vec<f64>,
    /// Displacements and velocities of the moving blocks at the base of a stage.
    starts: Vec<[Vector6<f64>; 2]>,
}

impl JointFlow {
    /// Returns the stationary water of a network at zero pressure.
    #[must_use]
    pub fn new(network: Network, settings: FlowSettings) -> Self {
        Self::with_movers(network, settings, Vec::new())
    }

    /// Returns the stationary water of a network with moving blocks ([`crate::motion`]), at zero pressure.
    #[must_use]
    pub fn with_movers(network: Network, settings: FlowSettings, movers: Vec<Mover>) -> Self {
        let (nodes, links) = (network.nodes(), network.links.len());
        let of_rock = movers_of(&movers);
        let touches = touches(&network, &movers, &of_rock);
        let unknowns = nodes + FREEDOMS * movers.len();
        let mut pairs: Vec<[usize; 2]> = network
            .links
            .iter()
            .filter_map(|link| match link.to {
                End::Node(to) => Some([link.from, to]),
                End::Open(_) => None,
            })
            .collect();
        for touch in &touches {
            let first = nodes + FREEDOMS * touch.mover;
            pairs.extend((first..first + FREEDOMS).map(|freedom| [touch.cell, freedom]));
        }
        for mover in 0..movers.len() {
            let first = nodes + FREEDOMS * mover;
            pairs.extend(ROTATION_PAIRS.map(|[a, b]| [first + a, first + b]));
        }
        let modes = if settings.inertia { links * MODES } else { 0 };
        let mut flow = Self {
            settings,
            modes: Modes::new(),
            channels: Vec::with_capacity(links),
            gaps: network.joints.iter().map(|joint| joint.gap).collect(),
            base_gaps: network.joints.iter().map(|joint| joint.gap).collect(),
            openings: vec![LinearField::default(); network.joints.len()],
            volumes: vec![0.0; nodes],
            fills: vec![0.0; nodes],
            opened: vec![0.0; nodes],
            surplus: vec![0.0; nodes],
            pressure: vec![0.0; nodes],
            mode: vec![0.0; modes],
            decays: vec![0.0; modes],
            decays_of: None,
            discharge: vec![0.0; links],
            passed: vec![0.0; network.open.len()],
            held: Vec::new(),
            factors: factors(&network, &movers, &pairs),
            factored: [vec![0.0; unknowns], vec![0.0; pairs.len()]],
            keeps: false,
            factorisations: 0,
            work: Work {
                answers: vec![LinkResponse::default(); links],
                fronts: vec![None; network.open.len()],
                outside: vec![0.0; network.open.len()],
                base: vec![0.0; nodes],
                before: vec![0.0; nodes],
                opened: vec![0.0; nodes],
                mode_base: vec![0.0; modes],
                imbalance: vec![0.0; unknowns],
                diagonal: vec![0.0; unknowns],
                pairs: vec![0.0; pairs.len()],
                trial: vec![0.0; unknowns],
                net: vec![0.0; unknowns],
                first: vec![0.0; unknowns],
                starts: vec![[Vector6::zeros(); 2]; movers.len()],
            },
            moving: walls::moving(&network, &of_rock),
            movers,
            touches,
            of_rock,
            network,
        };
        log::debug!("joints: {} entries in the factors", flow.factors.entries());
        flow.channels = (0..links).map(|link| flow.channel(link)).collect();
        flow.measure_volumes();
        flow
    }

    /// Returns the network.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Returns the settings.
    #[must_use]
    pub fn settings(&self) -> &FlowSettings {
        &self.settings
    }

    /// Returns the gauge pressures of the nodes \[Pa\].
    #[must_use]
    pub fn pressures(&self) -> &[f64] {
        &self.pressure
    }

    /// Returns the discharges of the links at the end of the last step, positive along the links \[m³/s\].
    #[must_use]
    pub fn discharges(&self) -> &[f64] {
        &self.discharge
    }

    /// Returns the present gaps of the joints \[m\].
    #[must_use]
    pub fn gaps(&self) -> &[LinearField] {
        &self.gaps
    }

    /// Returns the parts of the water of a node, whose sum over all nodes is [`Self::stored`] \[m³\].
    pub(crate) fn stored_at(&self, node: usize) -> [f64; 4] {
        let (more, _) = self.settings.water.compression(self.pressure[node]);
        [
            self.fills[node],
            self.opened[node],
            self.volumes[node] * more,
            self.surplus[node],
        ]
    }

    /// Returns the pressure outside an open piece in the last step \[Pa\]; `None` if the piece is closed.
    pub(crate) fn front(&self, piece: usize) -> Option<f64> {
        self.work.fronts[piece]
    }

    /// Returns the pressure at the end of a link minus that at its start \[Pa\]; `None` if its end is closed.
    pub(crate) fn rise(&self, link: usize) -> Option<f64> {
        let ends = &self.network.links[link];
        let end = match ends.to {
            End::Node(to) => self.pressure[to],
            End::Open(piece) => self.work.fronts[piece]?,
        };
        Some(end - self.pressure[ends.from])
    }

    /// Returns the pressure that the present discharge of a link loses by friction, positive along the link \[Pa\].
    #[must_use]
    pub fn friction(&self, link: usize) -> f64 {
        let (channel, discharge) = (&self.channels[link], self.discharge[link]);
        let (excess, _) = channel
            .turbulence
            .excess(discharge.abs(), channel.resistance);
        channel.resistance * discharge + excess.copysign(discharge)
    }

    /// Returns the volume of water between the walls at the density of atmospheric pressure \[m³\].
    #[must_use]
    pub fn water(&self) -> f64 {
        let mut sum = ExactSum::new();
        for (volume, pressure) in self.volumes.iter().zip(&self.pressure) {
            sum.add(*volume);
            sum.add(volume * self.settings.water.compression(*pressure).0);
        }
        sum.value()
    }

    /// Returns the sum whose change is the water that entered, at the density of atmospheric pressure \[m³\]: the water
    /// of the network, less the roughness of walls that press on each other.
    #[must_use]
    pub fn stored(&self) -> f64 {
        let mut sum = ExactSum::new();
        sum.add_all(&self.fills);
        sum.add_all(&self.opened);
        for (volume, pressure) in self.volumes.iter().zip(&self.pressure) {
            sum.add(volume * self.settings.water.compression(*pressure).0);
        }
        sum.add_all(&self.surplus);
        sum.value()
    }

    /// Returns the state: pressures of the nodes \[Pa\], then discharges of the links, then those of the modes
    /// \[m³/s\]; if blocks move, then the water of the nodes in excess of their volumes \[m³\]; then 1 and the matrix
    /// of the factors if the next step uses them, or zeros.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        let surplus = if self.movers.is_empty() {
            &[]
        } else {
            &self.surplus[..]
        };
        let [diagonal, pairs] = &self.factored;
        let keeps = [f64::from(u8::from(self.keeps))];
        let mut state = [
            &self.pressure[..],
            &self.discharge,
            &self.mode,
            surplus,
            &keeps,
        ]
        .concat();
        if self.keeps {
            state.extend(diagonal.iter().chain(pairs));
        } else {
            state.resize(state.len() + diagonal.len() + pairs.len(), 0.0);
        }
        state
    }

    /// Restores a state. Returns `true` if its length is that of this network.
    #[must_use]
    pub fn restore(&mut self, state: &[f64]) -> bool {
        let (nodes, links) = (self.pressure.len(), self.discharge.len());
        let modes = nodes + links..nodes + links + self.mode.len();
        let surplus = if self.movers.is_empty() { 0 } else { nodes };
        let [unknowns, pairs] = [0, 1].map(|part| self.factored[part].len());
        let kept = modes.end + surplus;
        if state.len() != kept + 1 + unknowns + pairs {
            return false;
        }
        self.pressure.copy_from_slice(&state[..nodes]);
        self.discharge.copy_from_slice(&state[nodes..nodes + links]);
        self.mode.copy_from_slice(&state[modes.clone()]);
        self.surplus[..surplus].copy_from_slice(&state[modes.end..kept]);
        let (diagonal, pairs) = state[kept + 1..].split_at(unknowns);
        self.keeps = state[kept] > 0.5;
        self.factored = [diagonal.to_vec(), pairs.to_vec()];
        !self.keeps || self.factors.factorise(diagonal, pairs).is_ok()
    }

    /// Sets the pressures of all nodes \[Pa\].
    pub fn set_pressures(&mut self, pressure: impl Fn(&Vector3<f64>) -> f64) {
        for (number, position) in self.pressure.iter_mut().zip(&self.network.positions) {
            *number = pressure(position);
        }
    }

    /// Returns the coefficients of a link at the present gaps.
    fn channel(&self, link: usize) -> Channel {
        let network = &self.network;
        let link = &network.links[link];
        let (water, gap) = (&self.settings.water, &self.gaps[link.joint]);
        let apertures = link
            .path
            .map(|at| gap.value(&at).max(network.settings.residual_aperture));
        let (cube, inertial) = (cube(apertures), inertial(apertures));
        let density = water.mixture_density();
        let per_width = 12.0 * water.viscosity * link.length / cube;
        let turbulence = match self.settings.roughness {
            Some(roughness) => Turbulence {
                reynolds: 2.0 * density / (water.viscosity * link.width),
                scale: density * link.length / (4.0 * link.width * link.width * cube),
                rough: rough(roughness, cube.cbrt()),
            },
            None => Turbulence::default(),
        };
        let end = match link.to {
            End::Node(node) => network.positions[node],
            End::Open(piece) => network.open[piece].middle,
        };
        let rise = self
            .settings
            .gravity
            .dot(&(end - network.positions[link.from]));
        Channel {
            lift: density * rise,
            resistance: per_width / link.width,
            gain: link.width * inertial / (density * link.length),
            rate: 4.0 * water.viscosity / density * inertial / cube,
            turbulence,
        }
    }

    /// Updates the gaps and the pressures outside the network to a time.
    fn follow(&mut self, drive: &dyn Drive, time: f64) {
        for (number, front) in self.work.fronts.iter_mut().enumerate() {
            *front = drive.pressure(number, time);
            self.work.outside[number] = drive.resistance(number);
        }
        let mut moved = false;
        for (joint, gap) in self.base_gaps.iter_mut().enumerate() {
            if let Some(new) = drive.gap(joint, time) {
                moved |= new != *gap;
                *gap = new;
            }
        }
        if moved {
            self.place_walls();
        }
    }

    /// Returns the moving blocks.
    #[must_use]
    pub fn movers(&self) -> &[Mover] {
        &self.movers
    }

    /// Returns the moving blocks, for setting their loads and velocities.
    pub fn movers_mut(&mut self) -> &mut [Mover] {
        &mut self.movers
    }

    /// Sets the velocities of an iterate, and the corresponding gaps at the end of a stage.
    fn move_blocks(&mut self, unknowns: &[f64], interval: f64) {
        if self.movers.is_empty() {
            return;
        }
        let nodes = self.volumes.len();
        let velocities = unknowns[nodes..].chunks_exact(FREEDOMS);
        let starts = self.work.starts.iter().zip(velocities);
        for (mover, ([start, _], velocity)) in self.movers.iter_mut().zip(starts) {
            mover.velocity = Vector6::from_column_slice(velocity);
            mover.displacement = start + mover.velocity * interval;
        }
        self.place_moving_walls();
        let links = std::mem::take(&mut self.moving[1]);
        for &link in &links {
            self.set_decays(link, interval);
            self.work.answers[link] = self.answer(link, interval);
        }
        self.moving[1] = links;
    }

    /// Adds the equations of the moving blocks to the imbalances and their derivatives. `pair` is the index of the
    /// first pair of the blocks.
    fn balance_blocks(&self, unknowns: &[f64], interval: f64, pair: usize, to: [&mut [f64]; 3]) {
        let nodes = self.volumes.len();
        let [imbalance, diagonal, pairs] = to;
        for (number, (mover, [_, start])) in self.movers.iter().zip(&self.work.starts).enumerate() {
            let change = mover.momentum(&(mover.velocity - start)) - mover.load * interval;
            for freedom in 0..FREEDOMS {
                let at = nodes + FREEDOMS * number + freedom;
                imbalance[at] = -change[freedom];
                diagonal[at] = if freedom < 3 {
                    -mover.mass
                } else {
                    -mover.inertia[(freedom - 3, freedom - 3)]
                };
            }
        }
        let mut pair = pair;
        for touch in &self.touches {
            let first = nodes + FREEDOMS * touch.mover;
            for freedom in 0..FREEDOMS {
                imbalance[first + freedom] += interval * touch.arm[freedom] * unknowns[touch.cell];
                pairs[pair] = interval * touch.arm[freedom];
                pair += 1;
            }
        }
        for mover in &self.movers {
            for [a, b] in ROTATION_PAIRS {
                pairs[pair] = -mover.inertia[(a - 3, b - 3)];
                pair += 1;
            }
        }
    }

    /// Returns the driving pressure of a link \[Pa\]; `None` if its end is closed.
    fn drive(&self, link: usize, pressure: &[f64]) -> Option<f64> {
        let ends = &self.network.links[link];
        let front = match ends.to {
            End::Node(to) => pressure[to],
            End::Open(piece) => self.work.fronts[piece]?,
        };
        Some(pressure[ends.from] - front + self.channels[link].lift)
    }

    /// Returns the discharge of a link and its derivative with respect to the driving pressure; `None` if its end
    /// is closed.
    fn discharge_of(&self, link: usize, pressure: &[f64]) -> Option<(f64, f64)> {
        let drive = self.drive(link, pressure)?;
        let (answer, channel) = (self.work.answers[link], &self.channels[link]);
        let laminar = answer.free + answer.slope * drive;
        let law = &channel.turbulence;
        let (discharge, part) = law.discharge(laminar, answer.slope, channel.resistance);
        Some((discharge, part * answer.slope))
    }

    /// Returns the sum of the squares of the nodal imbalances at pressures, and stores the imbalances with their
    /// derivatives. Without `stores` the flow is steady.
    fn imbalance(&mut self, pressure: &[f64], interval: f64, stores: bool) -> f64 {
        if stores {
            self.move_blocks(pressure, interval);
        }
        let mut work = std::mem::take(&mut self.work.imbalance);
        let mut diagonal = std::mem::take(&mut self.work.diagonal);
        let mut pairs = std::mem::take(&mut self.work.pairs);
        let nodes = self.volumes.len();
        for (node, number) in work[..nodes].iter_mut().enumerate() {
            (*number, diagonal[node]) = (-self.work.base[node], 0.0);
            if stores {
                let (more, slope) = self.settings.water.compression(pressure[node]);
                let volume = self.volumes[node];
                // With stationary walls this form adds no rounding of the volume itself.
                let moved = self.fills[node] - self.work.before[node];
                *number += volume * more + moved + (self.opened[node] - self.work.opened[node]);
                diagonal[node] = volume * slope;
            }
        }
        let mut pair = 0;
        for link in 0..self.channels.len() {
            let found = self.discharge_of(link, pressure);
            let (discharge, slope) = found.unwrap_or_default();
            let ends = &self.network.links[link];
            work[ends.from] += interval * discharge;
            diagonal[ends.from] += interval * slope;
            if let End::Node(to) = ends.to {
                work[to] -= interval * discharge;
                diagonal[to] += interval * slope;
                pairs[pair] = -interval * slope;
                pair += 1;
            }
        }
        if !stores {
            for &node in &self.held {
                work[node] = 0.0;
                // A cell without open links is isolated.
                diagonal[node] = if diagonal[node] > 0.0 {
                    2.0 * diagonal[node]
                } else {
                    1.0
                };
            }
        }
        if stores {
            let blocks = [&mut work[..], &mut diagonal, &mut pairs];
            self.balance_blocks(pressure, interval, pair, blocks);
        } else {
            // Blocks are fixed in a steady flow.
            pairs[pair..].fill(0.0);
            diagonal[nodes..].fill(-1.0);
            work[nodes..].fill(0.0);
        }
        let sum = work[..nodes].iter().map(|number| number * number).sum();
        self.work.imbalance = work;
        (self.work.diagonal, self.work.pairs) = (diagonal, pairs);
        sum
    }

    /// Finds the parts of the network without an open end: in each of them the pressure of one node is fixed.
    fn find_held(&mut self) {
        let parts = self.network.parts();
        let mut held = vec![true; self.pressure.len()];
        for link in &self.network.links {
            if let End::Open(piece) = link.to
                && self.work.fronts[piece].is_some()
            {
                held[parts[link.from]] = false;
            }
        }
        let roots = parts.iter().enumerate();
        self.held = roots
            .filter(|&(node, &root)| node == root && held[node])
            .map(|(node, _)| node)
            .collect();
    }

    /// Computes the steady flow under the pressures at a time. Parts of the network without an open end keep the
    /// pressure of their first cell and have no flow.
    ///
    /// # Errors
    /// If there is no solution.
    pub fn solve_steady(&mut self, drive: &dyn Drive, time: f64) -> Result<StepReport, FlowError> {
        self.keeps = false;
        self.follow(drive, time);
        self.find_held();
        self.work.base.fill(0.0);
        for (answer, channel) in self.work.answers.iter_mut().zip(&self.channels) {
            *answer = LinkResponse {
                free: 0.0,
                slope: 1.0 / channel.resistance,
            };
        }
        let newton = self.solve(1.0, false)?;
        // The matrices of steps in time are others.
        self.keeps = false;
        let pressure = std::mem::take(&mut self.pressure);
        for link in 0..self.channels.len() {
            let (discharge, _) = self.discharge_of(link, &pressure).unwrap_or_default();
            self.discharge[link] = discharge;
            if self.settings.inertia {
                let channel = &self.channels[link];
                // In the steady state the modes share the discharge in proportion to their conductances.
                let modes = &mut self.mode[link * MODES..(link + 1) * MODES];
                let groups = self.modes.weights.iter().zip(&self.modes.rates);
                for (mode, (weight, rate)) in modes.iter_mut().zip(groups) {
                    let conductance = channel.gain * weight / (channel.rate * rate);
                    *mode = discharge * channel.resistance * conductance;
                }
            }
        }
        self.pressure = pressure;
        Ok(StepReport {
            newton,
            ..StepReport::default()
        })
    }

    /// Returns the increase of the pressure at the end of a link per discharge [Pa s/m³].
    fn outside(&self, link: usize) -> f64 {
        match self.network.links[link].to {
            End::Open(piece) => self.work.outside[piece],
            End::Node(_) => 0.0,
        }
    }

    /// Computes the responses of the links for a stage of this duration \[s\] from the initial modes.
    fn prepare_answers(&mut self, interval: f64) {
        self.prepare_decays(interval);
        for link in 0..self.channels.len() {
            self.work.answers[link] = self.answer(link, interval);
        }
    }

    /// Returns the response of a link for a stage of this duration \[s\].
    fn answer(&self, link: usize, interval: f64) -> LinkResponse {
        let channel = &self.channels[link];
        let mut answer = LinkResponse {
            free: 0.0,
            slope: 1.0 / channel.resistance,
        };
        if self.settings.inertia {
            answer.slope = 0.0;
            let span = link * MODES..(link + 1) * MODES;
            let base = &self.work.mode_base[span.clone()];
            let groups = self.modes.weights.iter().zip(&self.decays[span]);
            for (base, (weight, left)) in base.iter().zip(groups) {
                answer.free += base * left;
                answer.slope += weight * left;
            }
            answer.slope *= interval * channel.gain;
        }
        let resistance = self.outside(link);
        if resistance > 0.0 {
            let part = 1.0 / (1.0 + answer.slope * resistance);
            answer.free *= part;
            answer.slope *= part;
        }
        answer
    }

    /// Computes the parts of the modes that a stage of this duration \[s\] leaves, unless they are known.
    fn prepare_decays(&mut self, interval: f64) {
        if !self.settings.inertia || self.decays_of == Some(interval) {
            return;
        }
        for link in 0..self.channels.len() {
            self.set_decays(link, interval);
        }
        self.decays_of = Some(interval);
    }

    /// Computes the parts of the modes of a link that a stage of this duration \[s\] leaves.
    fn set_decays(&mut self, link: usize, interval: f64) {
        if !self.settings.inertia {
            return;
        }
        let rate = interval * self.channels[link].rate;
        let decays = &mut self.decays[link * MODES..(link + 1) * MODES];
        for (decay, own) in decays.iter_mut().zip(&self.modes.rates) {
            *decay = 1.0 / (1.0 + rate * own);
        }
    }

    /// Computes discharges and modes from the pressures at the end of a stage.
    fn finish_stage(&mut self, interval: f64) {
        let pressure = std::mem::take(&mut self.pressure);
        for link in 0..self.channels.len() {
            let channel = self.channels[link];
            let (discharge, _) = self.discharge_of(link, &pressure).unwrap_or_default();
            self.discharge[link] = discharge;
            if !self.settings.inertia {
                continue;
            }
            let (excess, _) = channel
                .turbulence
                .excess(discharge.abs(), channel.resistance);
            let drive = self.drive(link, &pressure);
            let lost = excess.copysign(discharge) + self.outside(link) * discharge;
            let drive = drive.map_or(0.0, |drive| drive - lost);
            let span = link * MODES..(link + 1) * MODES;
            let base = &self.work.mode_base[span.clone()];
            let groups = self.modes.weights.iter().zip(&self.decays[span.clone()]);
            let gain = interval * channel.gain * drive;
            for ((mode, base), (weight, left)) in self.mode[span].iter_mut().zip(base).zip(groups) {
                *mode = (base + gain * weight) * left;
            }
        }
        self.pressure = pressure;
    }

    /// Sums the discharges into each node \[m³/s\].
    fn sum_discharges(&mut self) {
        self.work.net.fill(0.0);
        for (link, discharge) in self.network.links.iter().zip(&self.discharge) {
            self.work.net[link.from] -= discharge;
            if let End::Node(to) = link.to {
                self.work.net[to] += discharge;
            }
        }
    }

    /// Returns the discharge out of each open piece at the end of the last step \[m³/s\].
    #[must_use]
    pub fn outflows(&self) -> Vec<f64> {
        let mut outflows = vec![0.0; self.network.open.len()];
        for (link, discharge) in self.network.links.iter().zip(&self.discharge) {
            if let End::Open(piece) = link.to {
                outflows[piece] += discharge;
            }
        }
        outflows
    }

    /// Adds the water that leaves through open pieces during a time \[s\].
    fn add_passed(&mut self, time: f64) {
        for (link, discharge) in self.network.links.iter().zip(&self.discharge) {
            if let End::Open(piece) = link.to {
                self.passed[piece] += time * discharge;
            }
        }
    }

    /// Returns the volume of water that left through each open piece of an edge in the last step, at the density of
    /// atmospheric pressure \[m³\].
    #[must_use]
    pub fn passed(&self) -> &[f64] {
        &self.passed
    }

    /// Returns the discharge into the network through all open edges \[m³/s\].
    fn inflow(&self) -> f64 {
        let mut sum = ExactSum::new();
        for outflow in self.outflows() {
            sum.add(-outflow);
        }
        sum.value()
    }

    /// Makes a step from `time` to `time + interval` \[s\].
    ///
    /// # Errors
    /// If the pressures do not converge or are not finite; the state is then lost.
    pub fn advance(
        &mut self,
        drive: &dyn Drive,
        time: f64,
        interval: f64,
    ) -> Result<StepReport, FlowError> {
        self.factorisations = 0;
        let stage = DIAGONAL * interval;
        let before = self.stored();
        for (node, base) in self.work.base.iter_mut().enumerate() {
            let (more, _) = self.settings.water.compression(self.pressure[node]);
            *base = self.volumes[node] * more + self.surplus[node];
        }
        self.surplus.fill(0.0);
        self.work.before.copy_from_slice(&self.fills);
        self.work.opened.copy_from_slice(&self.opened);
        self.work.mode_base.copy_from_slice(&self.mode);
        for (start, mover) in self.work.starts.iter_mut().zip(&self.movers) {
            *start = [mover.displacement, mover.velocity];
        }
        self.follow(drive, time + stage);
        self.prepare_answers(stage);
        let mut newton = self.solve(stage, true)?;
        self.finish_stage(stage);
        let mut entered = (1.0 - DIAGONAL) * interval * self.inflow();
        self.passed.fill(0.0);
        self.add_passed((1.0 - DIAGONAL) * interval);
        self.sum_discharges();
        // The second stage starts with the extrapolated changes of the first.
        let carried = (1.0 - DIAGONAL) / DIAGONAL;
        for (base, net) in self.work.base.iter_mut().zip(&self.work.net) {
            *base += (1.0 - DIAGONAL) * interval * net;
        }
        for (base, mode) in self.work.mode_base.iter_mut().zip(&self.mode) {
            *base += carried * (mode - *base);
        }
        for (start, mover) in self.work.starts.iter_mut().zip(&self.movers) {
            let [place, velocity] = *start;
            start[0] += carried * (mover.displacement - place);
            start[1] += carried * (mover.velocity - velocity);
        }
        self.follow(drive, time + interval);
        self.prepare_answers(stage);
        newton += self.solve(stage, true)?;
        self.finish_stage(stage);
        entered += stage * self.inflow();
        self.add_passed(stage);
        let after = self.stored();
        Ok(StepReport {
            newton,
            factorisations: self.factorisations,
            entered,
            imbalance: after - before - entered,
        })
    }
}
