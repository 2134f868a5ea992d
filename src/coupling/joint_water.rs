//! Water in the joints between blocks as a fluid of a run: driven by pressures at its mouths, with its pressure as the
//! load on the blocks. Every rank has the whole network and makes the same step; each rank sets the loads of the blocks
//! that it owns. Blocks that can move are moved together with the water ([`moving`]), in the same way on every rank.

mod moving;
#[cfg(test)]
mod tests;
mod under_lattice;
mod window;

pub use moving::{Departure, most_numbers};
pub use window::window_numbers;

use super::Flow as Coupled;
use base::error::Error;
use decomposition::{Domain, ExactSum};
use dem::particles::{Load, Particles};
use dem::polyhedron::PlacedPolyhedron;
use dem::space::{Components, Space};
use joints::flow::{Drive, FlowSettings, JointFlow, StepReport};
use joints::history::PressureHistory;
use joints::loads::{RockLoad, add_wide_loads, loads};
use joints::network::Network;
use joints::pairs::{Rock, RockFace};
use joints::takeover::TakenOver;
use moving::Moving;
use nalgebra::Vector3;
use std::time::{Duration, Instant};
use window::Window;

/// Water outside a mouth.
#[derive(Clone, Debug)]
pub struct MouthFront {
    /// Pressure at the datum over time.
    pub pressure: PressureHistory,
    /// Lower and upper corner of the box of the edges \[m\]: lower faces belong to the box, upper faces do not. The
    /// pressure applies at the centre of the box; elsewhere it is hydrostatic relative to the centre.
    pub region: [[f64; 3]; 2],
    /// `true` if the water also presses on blocks that can move, where no joint covers them.
    pub presses_on_blocks: bool,
}

impl MouthFront {
    /// Returns `true` if a point \[m\] lies in the box.
    fn contains(&self, point: &Vector3<f64>) -> bool {
        let [from, to] = self.region;
        (0..3).all(|axis| from[axis] <= point[axis] && point[axis] < to[axis])
    }

    /// Returns the distance of a point from the box, squared \[m²\].
    fn distance(&self, point: &Vector3<f64>) -> f64 {
        let [from, to] = self.region;
        let apart = |axis: usize| {
            (from[axis] - point[axis])
                .max(point[axis] - to[axis])
                .max(0.0)
        };
        (0..3).map(|axis| apart(axis).powi(2)).sum()
    }

    /// Returns the pressure at a point \[m\] and time \[s\]; `weight` is the weight of the water per volume [N/m³].
    fn pressure_at(&self, point: &Vector3<f64>, weight: &Vector3<f64>, time: f64) -> f64 {
        let [from, to] = self.region.map(Vector3::from);
        self.pressure.value(time) + weight.dot(&(point - 0.5 * (from + to)))
    }
}

/// Open piece of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MouthAt {
    /// Midpoint of the piece \[m\].
    pub middle: Vector3<f64>,
    /// Unit vector out of the joint.
    pub outward: Vector3<f64>,
    /// Normal of the joint.
    pub normal: Vector3<f64>,
    /// Aperture in the middle of the piece, and length of the piece \[m\].
    pub size: [f64; 2],
}

/// Open piece of an edge that stays closed: the faces of its joint, and its direction out of the joint.
type ClosedEdge = ([RockFace; 2], Vector3<f64>);

/// Mouths of a network, and the open pieces of edges that belong to them.
#[derive(Clone, Debug)]
pub struct Mouths {
    /// Mouths in the order of the case.
    pub list: Vec<MouthFront>,
    /// Mouth of each open piece; none for a closed piece.
    pub of_piece: Vec<Option<usize>>,
    /// Weight of the water per volume as a vector [N/m³].
    pub weight: Vector3<f64>,
    /// Midpoints of the open pieces \[m\].
    middles: Vec<Vector3<f64>>,
    /// Edges in front of which there is no water.
    closed: Vec<ClosedEdge>,
    /// Pressures in front of the open pieces from a lattice \[Pa\]; none if the mouths give the pressures.
    fronts: Option<Vec<Option<f64>>>,
    /// Increase of these pressures per discharge out of the piece [Pa s/m³].
    resistances: Vec<f64>,
}

impl Mouths {
    /// Returns the mouths of a network at the start of a run; `weight` is the weight of the water per volume [N/m³].
    #[must_use]
    pub fn new(list: Vec<MouthFront>, weight: Vector3<f64>, network: &Network) -> Self {
        let of = |middle: &Vector3<f64>| list.iter().position(|mouth| mouth.contains(middle));
        let of_piece: Vec<_> = network.open.iter().map(|piece| of(&piece.middle)).collect();
        let pieces = network.open.iter().zip(&of_piece);
        let closed = pieces.filter(|(_, mouth)| mouth.is_none());
        let closed = closed.map(|(piece, _)| (network.joints[piece.joint].faces, piece.outward));
        Self {
            closed: closed.collect(),
            middles: network.open.iter().map(|piece| piece.middle).collect(),
            of_piece,
            list,
            weight,
            fronts: None,
            resistances: Vec::new(),
        }
    }

    /// Assigns mouths to the open pieces of a network of blocks that have moved. Edges that the motion uncovers belong
    /// to the mouth whose box is nearest.
    fn reassign_mouths(&mut self, network: &Network) {
        self.middles = network.open.iter().map(|piece| piece.middle).collect();
        let mouth = |piece: &joints::edges::Piece| {
            let found = self
                .list
                .iter()
                .position(|mouth| mouth.contains(&piece.middle));
            let faces = network.joints[piece.joint].faces;
            let was_closed = |(known, outward): &ClosedEdge| {
                *known == faces && outward.dot(&piece.outward) > SAME_EDGE
            };
            if found.is_some() || self.closed.iter().any(was_closed) {
                return found;
            }
            let distances = self.list.iter().map(|mouth| mouth.distance(&piece.middle));
            let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            nearest.map(|(mouth, _)| mouth)
        };
        self.of_piece = network.open.iter().map(mouth).collect();
        if let Some(fronts) = &mut self.fronts {
            // Pressures of the lattice are taken again before they are used.
            fronts.clear();
            fronts.resize(network.open.len(), None);
            self.resistances.clear();
        }
    }
}

impl Drive for Mouths {
    fn pressure(&self, open: usize, time: f64) -> Option<f64> {
        if let Some(fronts) = &self.fronts {
            return fronts[open];
        }
        let mouth = &self.list[self.of_piece[open]?];
        Some(mouth.pressure_at(&self.middles[open], &self.weight, time))
    }

    fn resistance(&self, open: usize) -> f64 {
        self.resistances.get(open).copied().unwrap_or(0.0)
    }
}

/// Smallest cosine between the directions of an edge before and after a motion.
const SAME_EDGE: f64 = 0.9;

/// Block of a network.
#[derive(Clone, Debug)]
pub struct NetworkBlock {
    /// Shape and position.
    pub solid: PlacedPolyhedron,
    /// Density [kg/m³]; none if the block never moves.
    pub density: Option<f64>,
    /// Velocity [m/s].
    pub velocity: Vector3<f64>,
}

/// Sums over a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Initial volume of water in the network, at the density at atmospheric pressure \[m³\].
    pub initial: f64,
    /// Volume of water that entered through the mouths since the beginning, minus that which left \[m³\].
    pub entered: f64,
    /// Volume of water in overlaps of joints that have vanished since the beginning, minus that in new overlaps \[m³\].
    pub released: f64,
    /// Volume of water that passed to a lattice with joints that it took over, minus that of joints that returned
    /// \[m³\]; included in `released`.
    pub taken_over: f64,
    /// Volume of water in the cells that the lattice received with these joints, minus that in the cells that the
    /// network took, at the density of atmospheric pressure \[m³\].
    pub opened: f64,
    /// Volume of water inside the rock in cells that blocks took from joints, minus that in cells that joints took from
    /// blocks \[m³\].
    pub into_rock: f64,
    /// Smallest and largest gauge pressure of a node so far \[Pa\]; the first above the second if there were no nodes.
    pub pressure: [f64; 2],
}

/// Extremes before the first pressure: finite, so that a checkpoint can contain them.
const NO_PRESSURE: [f64; 2] = [f64::MAX, f64::MIN];

impl Balance {
    /// Returns the smallest and the largest gauge pressure of a node so far \[Pa\]; none if there never were nodes.
    #[must_use]
    pub fn pressures(&self) -> Option<[f64; 2]> {
        let [low, high] = self.pressure;
        (low <= high).then_some([low, high])
    }
}

/// Number of values of the balance in a saved state.
const BALANCE: usize = 8;

/// Water of a network with its loads on blocks.
#[derive(Clone, Debug)]
pub struct JointWater {
    flow: JointFlow,
    mouths: Mouths,
    /// Blocks in their present positions.
    solids: Vec<PlacedPolyhedron>,
    moving: Option<Box<Moving>>,
    /// Force and torque of a lattice on each block; empty without a lattice.
    of_lattice: Vec<[Vector3<f64>; 2]>,
    /// Water that still returns to the lattice: index of the mouth, and volume \[m³\].
    returned: Vec<(usize, f64)>,
    /// Steps of a lattice in a step of the joints.
    window: Window,
    /// Joints that the lattice takes over after this step.
    taken: Vec<TakenOver>,
    /// Number of networks built so far; it increases when the network is rebuilt.
    networks: u64,
    /// Acceleration of gravity on the blocks [m/s²].
    gravity: Vector3<f64>,
    /// Id of the first block.
    first: u64,
    /// Step of the joints \[s\].
    interval: f64,
    /// Number of steps done.
    steps: u64,
    balance: Balance,
    report: StepReport,
    loads: Vec<RockLoad>,
    /// Computing time since the last call of [`Self::take_time`].
    time_spent: Duration,
}

impl JointWater {
    /// Returns the steady flow under the pressures at time 0 between blocks that do not move. `blocks` are all blocks
    /// of the network, whose ids begin at `first`; `interval` is the time step \[s\].
    ///
    /// # Errors
    /// If there is no steady flow.
    pub fn new(
        network: Network,
        settings: FlowSettings,
        mouths: Vec<MouthFront>,
        blocks: &[NetworkBlock],
        (first, interval): (u64, f64),
    ) -> Result<Self, Error> {
        let weight = settings.gravity * settings.water.mixture_density();
        let mouths = Mouths::new(mouths, weight, &network);
        let gravity = settings.gravity;
        Self::with_mouths(
            (network, settings),
            mouths,
            blocks,
            gravity,
            (first, interval, 1),
        )
    }

    /// Returns the water in joints under a lattice, initially at pressure 0. The pressures of `settings` are those of
    /// the lattice, with the gravity that acts there; `gravity` is that on the blocks [m/s²]. `steps` are the id of the
    /// first block, the step of the lattice \[s\] and the number of these steps in a step of the joints.
    ///
    /// # Errors
    ///
    /// If there is no steady flow.
    pub fn under_lattice(
        network: Network,
        settings: FlowSettings,
        gravity: Vector3<f64>,
        blocks: &[NetworkBlock],
        steps: (u64, f64, u32),
    ) -> Result<Self, Error> {
        let mut mouths = Mouths::new(Vec::new(), Vector3::zeros(), &network);
        mouths.fronts = Some(vec![Some(0.0); network.open.len()]);
        Self::with_mouths((network, settings), mouths, blocks, gravity, steps)
    }

    fn with_mouths(
        (network, settings): (Network, FlowSettings),
        mouths: Mouths,
        blocks: &[NetworkBlock],
        gravity: Vector3<f64>,
        (first, lattice_step, lattice_steps): (u64, f64, u32),
    ) -> Result<Self, Error> {
        let moving = Moving::new(blocks, &mouths, &network);
        let movers = moving.as_ref().map_or_else(Vec::new, |m| m.movers(blocks));
        let mut flow = JointFlow::with_movers(network, settings, movers);
        let settled = flow.solve_steady(&mouths, 0.0);
        settled.map_err(|error| Error::Numerical(error.to_string()))?;
        let mut water = Self {
            loads: Vec::new(),
            time_spent: Duration::ZERO,
            balance: Balance {
                initial: flow.stored(),
                entered: 0.0,
                released: 0.0,
                taken_over: 0.0,
                opened: 0.0,
                into_rock: 0.0,
                pressure: NO_PRESSURE,
            },
            report: StepReport::default(),
            steps: 0,
            flow,
            mouths,
            solids: blocks.iter().map(|block| block.solid.clone()).collect(),
            moving,
            of_lattice: Vec::new(),
            returned: Vec::new(),
            window: Window::new(u64::from(lattice_steps)),
            taken: Vec::new(),
            networks: 1,
            gravity,
            first,
            interval: lattice_step * f64::from(lattice_steps),
        };
        water.measure();
        Ok(water)
    }

    /// Computes loads and extreme values from the present pressures.
    fn measure(&mut self) {
        let pressures = self.flow.pressures();
        let centroids: Vec<_> = self.solids.iter().map(|solid| solid.position).collect();
        self.loads = loads(self.flow.network(), pressures, &centroids);
        let mut wide = std::mem::take(&mut self.loads);
        self.add_wide_loads(&centroids, &mut wide);
        self.loads = wide;
        self.add_outside();
        for (load, [force, torque]) in self.loads.iter_mut().zip(&self.of_lattice) {
            load.force += force;
            load.moment += torque;
        }
        let pressures = self.flow.pressures();
        for pressure in pressures {
            let [low, high] = &mut self.balance.pressure;
            *low = low.min(*pressure);
            *high = high.max(*pressure);
        }
    }

    /// Adds the loads of wide joints under a lattice, with the present pressures of the lattice at their mouths.
    fn add_wide_loads(&self, centroids: &[Vector3<f64>], loads: &mut [RockLoad]) {
        if let Some(fronts) = &self.mouths.fronts {
            let front = |piece: usize| fronts[piece];
            add_wide_loads(&self.flow, None, front, centroids, loads);
        }
    }

    /// Adds the time since `begin` to the computing time.
    pub fn add_time(&mut self, begin: Instant) {
        self.time_spent += begin.elapsed();
    }

    /// Returns the computing time since the last call.
    pub fn take_time(&mut self) -> Duration {
        std::mem::take(&mut self.time_spent)
    }

    /// Returns the pressures and discharges.
    #[must_use]
    pub fn flow(&self) -> &JointFlow {
        &self.flow
    }

    /// Returns the loads on the blocks, in the order of their ids.
    #[must_use]
    pub fn loads(&self) -> &[RockLoad] {
        &self.loads
    }

    /// Returns the sums over the run.
    #[must_use]
    pub fn balance(&self) -> &Balance {
        &self.balance
    }

    /// Returns the report of the last step.
    #[must_use]
    pub fn report(&self) -> &StepReport {
        &self.report
    }

    /// Returns the error of the water balance: the volume in the network that no discharge through a mouth explains,
    /// divided by the largest of the present volume, the initial volume and the volume that passed.
    #[must_use]
    pub fn mass_error(&self) -> f64 {
        let stored = self.flow.stored();
        let Balance {
            initial,
            entered,
            released,
            ..
        } = self.balance;
        // A network whose blocks have left may hold no water.
        let handled = [initial, entered, released].map(f64::abs);
        let handled = handled.into_iter().fold(self.flow.water(), f64::max);
        (stored + released - initial - entered) / handled.max(f64::MIN_POSITIVE)
    }

    /// Returns the discharge of a mouth into the network \[m³/s\] and the mean pressure in front of it \[Pa\].
    #[must_use]
    pub fn mouth(&self, mouth: usize) -> [f64; 2] {
        let outflows = self.flow.outflows();
        let (mut inflow, mut pressure, mut width) =
            (ExactSum::new(), ExactSum::new(), ExactSum::new());
        let time = self.time();
        for (piece, open) in self.flow.network().open.iter().enumerate() {
            if self.mouths.of_piece[piece] != Some(mouth) {
                continue;
            }
            inflow.add(-outflows[piece]);
            width.add(open.width);
            let front = self.mouths.pressure(piece, time).unwrap_or(0.0);
            pressure.add_product(front, open.width);
        }
        [inflow.value(), pressure.value() / width.value()]
    }

    /// Returns the time of the state \[s\].
    fn time(&self) -> f64 {
        base::number::real(self.steps) * self.interval
    }

    /// Returns the state for a checkpoint.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        let Balance {
            initial,
            entered,
            released,
            taken_over,
            opened,
            into_rock,
            pressure: [low, high],
        } = self.balance;
        let water = [initial, entered, released, taken_over, opened, into_rock];
        let mut state = [&water[..], &[low, high]].concat();
        self.save_window(&mut state);
        if let Some(moving) = &self.moving {
            moving.save(&self.solids, self.flow.network(), &mut state);
        }
        state.extend(self.flow.state());
        state
    }

    /// Restores the state of a checkpoint after this number of steps, which are those of the lattice if there is one.
    ///
    /// # Errors
    /// If the state is that of another network.
    pub fn restore(&mut self, numbers: &[f64], steps: u64) -> Result<(), Error> {
        let another = || Error::Io("the checkpoint holds the water of other joints".into());
        let (sums, state) = numbers.split_at_checked(BALANCE).ok_or_else(another)?;
        let (loads, mut state) = self.restore_window(state).ok_or_else(another)?;
        if self.moving.is_some() {
            state = self.restore_positions(state).ok_or_else(another)?;
        }
        if !self.flow.restore(state) {
            return Err(another());
        }
        self.balance = Balance {
            initial: sums[0],
            entered: sums[1],
            released: sums[2],
            taken_over: sums[3],
            opened: sums[4],
            into_rock: sums[5],
            pressure: [sums[6], sums[7]],
        };
        self.steps = steps / self.lattice_steps();
        self.networks += 1;
        self.measure();
        self.restore_loads(loads);
        Ok(())
    }
}

/// Returns the length of the state in a checkpoint if the blocks are fixed and the state of the flow has this length.
#[must_use]
pub fn numbers(flow: usize) -> usize {
    BALANCE + flow
}

impl<S: Space> Coupled<S> for JointWater {
    fn advance(&mut self, particles: &mut Particles<S>, _domain: &Domain) -> Result<(), Error> {
        // Water moves together with its blocks, behind the loads of their contacts.
        if self.moving.is_none() {
            let begin = Instant::now();
            if self.is_due() {
                self.advance_water()?;
                self.measure();
            }
            self.set_loads(particles);
            self.add_time(begin);
        }
        Ok(())
    }

    fn update_bodies(&mut self, _: &mut Particles<S>, _: &Domain) -> Result<(), Error> {
        Ok(())
    }
}

impl JointWater {
    /// Makes a step of the water, and of the blocks that move with it.
    fn advance_water(&mut self) -> Result<(), Error> {
        let time = self.time();
        let made = self.flow.advance(&self.mouths, time, self.interval);
        self.report = made.map_err(|error| {
            Error::Numerical(format!(
                "{error}, at time {time:.6e} s; use a shorter time step"
            ))
        })?;
        self.steps += 1;
        self.balance.entered += self.report.entered;
        self.note_returned();
        Ok(())
    }

    /// Sets the loads of the water on the owned blocks.
    fn set_loads<S: Space>(&self, particles: &mut Particles<S>) {
        particles.allocate_fluid_loads();
        for k in 0..particles.owned() {
            let number = particles.body[k].id.checked_sub(self.first);
            let number = number.and_then(|number| usize::try_from(number).ok());
            let Some(load) = number.and_then(|number| self.loads.get(number)) else {
                continue;
            };
            let mut on_block = Load::<S>::default();
            for axis in 0..S::DIMENSION.min(3) {
                on_block.force.set(axis, load.force[axis]);
            }
            // Blocks are three-dimensional, with three components of the torque.
            if S::DIMENSION == 3 {
                for axis in 0..3 {
                    on_block.torque.set(axis, load.moment[axis]);
                }
            }
            particles.fluid[k] = on_block;
        }
    }
}

/// Returns the blocks in the form that the network reads.
fn rocks(solids: &[PlacedPolyhedron]) -> Vec<Rock<'_>> {
    fn rock(solid: &PlacedPolyhedron) -> Rock<'_> {
        Rock {
            shape: &solid.shape,
            position: solid.position,
            orientation: solid.orientation,
        }
    }
    solids.iter().map(rock).collect()
}
