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
//! from step to step as long as each iteration removes most of the imbalance (`newton`). A stage ends when its error is
//! a small part of its change; the water that is missing in the balance of a node is added to that of the next step, so
//! that the sum is closed to rounding.
//!
//! **The state** consists of the pressure of each node, the modes of each link, the missing water of each node and the
//! matrix of the factors, equal on every rank.

use crate::friction::Turbulence;
use crate::ldl::Factors;
use crate::motion::{FREEDOMS, Lever, LoadedCell, Mover, movers_of, touches};
use crate::network::{End, Network};
use crate::polygon::LinearField;
use crate::slot::{MODES, Modes};
use crate::water::Mixture;
use base::number::{real, whole};
use decomposition::ExactSum;
use nalgebra::{Vector2, Vector3, Vector6};

mod balance;
mod links;
mod memory;
mod newton;
mod renewal;
mod step;
mod system;
mod walls;

/// Pairs of rotational degrees of freedom of a block.
const ROTATION_PAIRS: [[usize; 2]; 3] = [[3, 4], [3, 5], [4, 5]];
/// Number of values of a gap.
const GAP: usize = 3;
/// Diagonal of the two stages.
const DIAGONAL: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Channel {
    /// Laminar resistance \[Pa s/m³\].
    resistance: f64,
    /// Total gain `w a/(rho L)` of all modes [m³/(Pa s²)].
    gain: f64,
    /// Rate `4 nu/a²` of the modes [1/s].
    rate: f64,
}

/// Link, for its coefficients at any gap.
#[derive(Clone, Copy, Debug)]
struct LinkShape {
    joint: usize,
    /// Start and end in the plane of the joint \[m\].
    path: [Vector2<f64>; 2],
    /// Laminar resistance times the cube of the aperture \[Pa s\].
    resistance: f64,
    /// Gain of the modes over the aperture \[m²/(Pa s²)\].
    gain: f64,
}

/// Linear response of a link in a stage.
#[derive(Clone, Copy, Debug, Default)]
struct LinkResponse {
    /// Laminar discharge at equal pressures at both ends \[m³/s\].
    free: f64,
    /// Derivative of the laminar discharge with respect to the driving pressure \[m³/(Pa s)\].
    slope: f64,
}

/// Cell of a joint, for its volume.
#[derive(Clone, Copy, Debug)]
struct CellSize {
    area: f64,
    centroid: Vector2<f64>,
    /// Largest distance of a corner from the centroid \[m\].
    radius: f64,
    joint: usize,
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
}

/// Links of a network in the present stage.
#[derive(Clone, Debug)]
struct Links {
    /// Nodes at the ends of each link; for links to open pieces, which come last, the node and the piece.
    ends: Vec<[u32; 2]>,
    /// Number of links between nodes.
    inner: usize,
    /// Weight of the water between the ends of each link, positive along the link \[Pa\].
    lifts: Vec<f64>,
    shapes: Vec<LinkShape>,
    /// Rate of the modes times the square of the aperture [m²/s].
    relaxation: f64,
    channels: Vec<Channel>,
    /// Coefficients of turbulent friction of each link; none for laminar flow.
    turbulences: Vec<Turbulence>,
    /// Discharges of the modes of each link; none without inertia.
    mode: Vec<[f64; MODES]>,
    /// Responses of the links in the next stage with the present channels, and its duration \[s\]; none if they are not
    /// known.
    responses: Vec<LinkResponse>,
    responses_of: Option<f64>,
    /// Discharges at the end of the last stage \[m³/s\].
    discharge: Vec<f64>,
}

/// Gaps of the joints, and the moving blocks that change them.
#[derive(Clone, Debug)]
struct Walls {
    /// Present gaps \[m\]: the sum of the next two.
    gaps: Vec<LinearField>,
    /// Gaps without the displacements of the blocks, and the change of these gaps by the displacements \[m\].
    base_gaps: Vec<LinearField>,
    openings: Vec<LinearField>,
    /// Gaps for which the channels of the links were computed \[m\], and `true` for each joint whose channels are to be
    /// computed again.
    followed: Vec<LinearField>,
    renews: Vec<bool>,
    /// Mover of each block.
    of_rock: Vec<Option<usize>>,
    /// Joints of moving blocks and their cells; levers of the blocks at these joints.
    moving: [Vec<usize>; 2],
    levers: Vec<[Option<Lever>; 2]>,
    /// Largest distance of a corner of these joints from their origin \[m\].
    reaches: Vec<f64>,
}

/// Volumes of the cells and their water.
#[derive(Clone, Debug)]
struct Storage {
    sizes: Vec<CellSize>,
    /// Volumes that store by compression \[m³\].
    volumes: Vec<f64>,
    /// Volumes that follow the walls without the displacements of the blocks, and the change of these volumes by the
    /// displacements \[m³\].
    fills: Vec<f64>,
    opened: Vec<f64>,
    /// Water of the nodes in excess of their volumes and pressures \[m³\]: what the last step left, and what blocks
    /// that were placed displaced.
    surplus: Vec<f64>,
}

/// Linear system of Newton's method.
#[derive(Clone, Debug)]
struct System {
    factors: Factors,
    /// Matrix of the factors: its diagonal and pairs.
    factored: [Vec<f64>; 2],
    /// `true` if the factors may be used for the next iteration.
    keeps: bool,
    /// Number of iterations beyond the first of each stage since the last factorisation.
    extra: usize,
    /// Number of factorisations in this step.
    factorisations: usize,
    /// Node with fixed pressure in each closed part of the network, found by the first solution.
    held: Vec<usize>,
}

/// Pressures and discharges of a network.
#[derive(Clone, Debug)]
pub struct JointFlow {
    settings: FlowSettings,
    network: Network,
    modes: Modes,
    links: Links,
    walls: Walls,
    storage: Storage,
    pressure: Vec<f64>,
    /// Water that left through each open piece in the last step \[m³\].
    passed: Vec<f64>,
    system: System,
    work: Work,
    /// Moving blocks, each with the adjacent cells.
    movers: Vec<Mover>,
    touches: Vec<LoadedCell>,
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
    imbalance: Vec<f64>,
    trial: Vec<f64>,
    net: Vec<f64>,
    /// First iterate of a stage.
    first: Vec<f64>,
    /// Displacements and velocities of the moving blocks at the base of a stage.
    starts: Vec<[Vector6<f64>; 2]>,
}

impl Work {
    /// Returns the buffers of a network with a number of moving blocks.
    fn new(network: &Network, movers: usize) -> Self {
        let (nodes, pieces) = (network.nodes(), network.open.len());
        let unknowns = nodes + FREEDOMS * movers;
        Self {
            answers: vec![LinkResponse::default(); network.links.len()],
            fronts: vec![None; pieces],
            outside: vec![0.0; pieces],
            base: vec![0.0; nodes],
            before: vec![0.0; nodes],
            opened: vec![0.0; nodes],
            imbalance: vec![0.0; unknowns],
            trial: vec![0.0; unknowns],
            net: vec![0.0; unknowns],
            first: vec![0.0; unknowns],
            starts: vec![[Vector6::zeros(); 2]; movers],
        }
    }
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
        let of_rock = movers_of(&movers);
        let touches = touches(&network, &movers, &of_rock);
        let mut flow = Self {
            settings,
            modes: Modes::new(),
            links: Links::new(&network, &settings),
            walls: Walls::new(&network, &movers, of_rock),
            storage: Storage::new(&network),
            pressure: vec![0.0; network.nodes()],
            passed: vec![0.0; network.open.len()],
            system: System::new(&network, &movers, &touches),
            work: Work::new(&network, movers.len()),
            movers,
            touches,
            network,
        };
        log::debug!(
            "joints: {} entries in the factors",
            flow.system.factors.entries()
        );
        (0..flow.network.links.len()).for_each(|link| flow.set_channel(link));
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
        &self.links.discharge
    }

    /// Returns the present gaps of the joints \[m\].
    #[must_use]
    pub fn gaps(&self) -> &[LinearField] {
        &self.walls.gaps
    }

    /// Returns the parts of the water of a node, whose sum over all nodes is [`Self::stored`] \[m³\].
    pub(crate) fn stored_at(&self, node: usize) -> [f64; 4] {
        let (more, _) = self.settings.water.compression(self.pressure[node]);
        [
            self.storage.fills[node],
            self.storage.opened[node],
            self.storage.volumes[node] * more,
            self.storage.surplus[node],
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
        let (channel, discharge) = (self.channel(link), self.links.discharge[link]);
        let law = self.turbulence(link);
        let (excess, _) = law.excess(discharge.abs(), channel.resistance);
        channel.resistance * discharge + excess.copysign(discharge)
    }

    /// Returns the volume of water between the walls at the density of atmospheric pressure \[m³\].
    #[must_use]
    pub fn water(&self) -> f64 {
        let mut sum = ExactSum::new();
        for (volume, pressure) in self.storage.volumes.iter().zip(&self.pressure) {
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
        sum.add_all(&self.storage.fills);
        sum.add_all(&self.storage.opened);
        for (volume, pressure) in self.storage.volumes.iter().zip(&self.pressure) {
            sum.add(volume * self.settings.water.compression(*pressure).0);
        }
        sum.add_all(&self.storage.surplus);
        sum.value()
    }

    /// Returns the state: pressures of the nodes \[Pa\], then discharges of the links, then those of the modes
    /// \[m³/s\], then the water of the nodes in excess of their volumes \[m³\]; then the gaps of the channels in joints
    /// of moving blocks; then 1 plus the number of iterations that the factors have cost, and their matrix, if the next
    /// step uses them, or zeros.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        let [diagonal, pairs] = &self.system.factored;
        let keeps = if self.system.keeps {
            1.0 + real(self.system.extra)
        } else {
            0.0
        };
        let mut state = [
            &self.pressure[..],
            &self.links.discharge,
            self.links.mode.as_flattened(),
            &self.storage.surplus,
        ]
        .concat();
        for &joint in &self.walls.moving[0] {
            let gap = &self.walls.followed[joint];
            state.extend([gap.constant, gap.slope.x, gap.slope.y]);
        }
        state.push(keeps);
        if self.system.keeps {
            state.extend(diagonal.iter().chain(pairs));
        } else {
            state.resize(state.len() + diagonal.len() + pairs.len(), 0.0);
        }
        state
    }

    /// Restores a state. Returns `true` if its length is that of this network.
    #[must_use]
    pub fn restore(&mut self, state: &[f64]) -> bool {
        let (nodes, links) = (self.pressure.len(), self.links.discharge.len());
        let mode = self.links.mode.as_flattened_mut();
        let modes = nodes + links..nodes + links + mode.len();
        let [unknowns, pairs] = [0, 1].map(|part| self.system.factored[part].len());
        let surplus = modes.end..modes.end + nodes;
        let kept = surplus.end + GAP * self.walls.moving[0].len();
        if state.len() != kept + 1 + unknowns + pairs {
            return false;
        }
        self.pressure.copy_from_slice(&state[..nodes]);
        self.links
            .discharge
            .copy_from_slice(&state[nodes..nodes + links]);
        mode.copy_from_slice(&state[modes.clone()]);
        self.links.responses_of = None;
        self.storage
            .surplus
            .copy_from_slice(&state[surplus.clone()]);
        self.restore_channels(&state[surplus.end..kept]);
        let (diagonal, pairs) = state[kept + 1..].split_at(unknowns);
        self.system.keeps = state[kept] > 0.5;
        self.system.extra = whole((state[kept] - 1.0).max(0.0));
        self.system.factored = [diagonal.to_vec(), pairs.to_vec()];
        !self.system.keeps || self.system.factors.factorise(diagonal, pairs).is_ok()
    }

    /// Sets the pressures of all nodes \[Pa\].
    #[cfg(test)]
    pub(super) fn set_pressures(&mut self, pressure: impl Fn(&Vector3<f64>) -> f64) {
        for (number, position) in self.pressure.iter_mut().zip(&self.network.positions) {
            *number = pressure(position);
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

    /// Returns the discharge out of each open piece at the end of the last step \[m³/s\].
    #[must_use]
    pub fn outflows(&self) -> Vec<f64> {
        let mut outflows = vec![0.0; self.network.open.len()];
        let outer = self.links.inner..;
        for ([_, piece], discharge) in self.links.ends[outer.clone()]
            .iter()
            .zip(&self.links.discharge[outer])
        {
            outflows[*piece as usize] = *discharge;
        }
        outflows
    }

    /// Returns the volume of water that left through each open piece of an edge in the last step, at the density of
    /// atmospheric pressure \[m³\].
    #[must_use]
    pub fn passed(&self) -> &[f64] {
        &self.passed
    }
}
