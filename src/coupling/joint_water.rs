//! Water in the joints between blocks as a fluid of a run: driven by pressures at its mouths, with its pressure as
//! the load on the blocks.
//!
//! Every rank has the whole network and makes the same step; each sets the loads of the blocks that it owns. The
//! blocks do not move.

use super::Flow as Coupled;
use base::error::Error;
use decomposition::{Domain, ExactSum};
use dem::particles::{Load, Particles};
use dem::space::{Components, Space};
use joints::flow::{Drive, JointFlow, StepReport};
use joints::history::PressureHistory;
use joints::loads::{RockLoad, loads};
use nalgebra::Vector3;

/// Water outside a mouth.
#[derive(Clone, Debug)]
pub struct MouthFront {
    /// Pressure at the datum over time.
    pub pressure: PressureHistory,
    /// Datum point \[m\]; elsewhere the pressure is hydrostatic relative to it.
    pub datum: Vector3<f64>,
}

/// Mouths of a network, and the open pieces of edges that belong to them.
#[derive(Clone, Debug)]
pub struct Mouths {
    /// The mouths.
    pub list: Vec<MouthFront>,
    /// Mouth of each open piece; none for a closed piece.
    pub of_piece: Vec<Option<usize>>,
    /// Weight of the water per volume and direction [N/m³].
    pub weight: Vector3<f64>,
    /// Middles of the open pieces \[m\].
    pub middles: Vec<Vector3<f64>>,
}

impl Drive for Mouths {
    fn pressure(&self, open: usize, time: f64) -> Option<f64> {
        let mouth = &self.list[self.of_piece[open]?];
        let below = self.weight.dot(&(self.middles[open] - mouth.datum));
        Some(mouth.pressure.value(time) + below)
    }
}

/// Sums over a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Initial volume of water in the network, at the density at atmospheric pressure \[m³\].
    pub initial: f64,
    /// Volume of water that entered through the mouths since the beginning, minus that which left \[m³\].
    pub entered: f64,
    /// Smallest and largest gauge pressure of a node so far \[Pa\].
    pub pressure: [f64; 2],
}

/// Number of values of the balance in a saved state.
const BALANCE: usize = 4;

/// Water of a network with its loads on blocks.
#[derive(Clone, Debug)]
pub struct JointWater {
    flow: JointFlow,
    mouths: Mouths,
    centroids: Vec<Vector3<f64>>,
    /// Id of the first block.
    first: u64,
    interval: f64,
    /// Number of steps done.
    steps: u64,
    balance: Balance,
    report: StepReport,
    loads: Vec<RockLoad>,
}

impl JointWater {
    /// Returns the steady flow under the pressures at time 0. `centroids` are those of all blocks of the network
    /// \[m\], whose ids begin at `first`; `interval` is the time step \[s\].
    ///
    /// # Errors
    /// If there is no steady flow.
    pub fn new(
        mut flow: JointFlow,
        mouths: Mouths,
        centroids: Vec<Vector3<f64>>,
        first: u64,
        interval: f64,
    ) -> Result<Self, Error> {
        let settled = flow.settle(&mouths, 0.0);
        settled.map_err(|error| Error::Numerical(error.to_string()))?;
        let mut water = Self {
            loads: Vec::new(),
            balance: Balance {
                initial: flow.stored(),
                entered: 0.0,
                pressure: [f64::INFINITY, f64::NEG_INFINITY],
            },
            report: StepReport::default(),
            steps: 0,
            flow,
            mouths,
            centroids,
            first,
            interval,
        };
        water.measure();
        Ok(water)
    }

    /// Computes loads and extremes from the present pressures.
    fn measure(&mut self) {
        let pressures = self.flow.pressures();
        self.loads = loads(self.flow.network(), pressures, &self.centroids);
        for pressure in pressures {
            let [low, high] = &mut self.balance.pressure;
            *low = low.min(*pressure);
            *high = high.max(*pressure);
        }
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

    /// Returns the change of the water volume that no discharge through a mouth explains, divided by the volume in
    /// the network.
    #[must_use]
    pub fn mass_error(&self) -> f64 {
        let stored = self.flow.stored();
        (stored - self.balance.initial - self.balance.entered) / stored.max(f64::MIN_POSITIVE)
    }

    /// Returns the discharge of a mouth into the network \[m³/s\] and the mean pressure in front of it \[Pa\].
    #[must_use]
    pub fn mouth(&self, mouth: usize) -> [f64; 2] {
        let outflows = self.flow.outflows();
        let (mut inflow, mut pressure, mut width) =
            (ExactSum::new(), ExactSum::new(), ExactSum::new());
        let time = base::number::real(self.steps) * self.interval;
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

    /// Returns the state for a checkpoint.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        let Balance {
            initial,
            entered,
            pressure: [low, high],
        } = self.balance;
        let mut state = vec![initial, entered, low, high];
        state.extend(self.flow.state());
        state
    }

    /// Restores the state of a checkpoint after this number of steps.
    ///
    /// # Errors
    /// If the state is that of another network.
    pub fn restore(&mut self, numbers: &[f64], steps: u64) -> Result<(), Error> {
        let another = || Error::Io("the checkpoint holds the water of other joints".into());
        let (sums, state) = numbers.split_at_checked(BALANCE).ok_or_else(another)?;
        if !self.flow.restore(state) {
            return Err(another());
        }
        self.balance = Balance {
            initial: sums[0],
            entered: sums[1],
            pressure: [sums[2], sums[3]],
        };
        self.steps = steps;
        self.measure();
        Ok(())
    }
}

/// Returns the length of the state in a checkpoint for a network of these counts.
#[must_use]
pub fn numbers(nodes: usize, links: usize, inertia: bool) -> usize {
    let modes = if inertia { joints::slot::MODES } else { 0 };
    BALANCE + nodes + links * (1 + modes)
}

impl<S: Space> Coupled<S> for JointWater {
    fn advance(&mut self, particles: &mut Particles<S>, _domain: &Domain) -> Result<(), Error> {
        let time = base::number::real(self.steps) * self.interval;
        let made = self.flow.advance(&self.mouths, time, self.interval);
        self.report = made.map_err(|error| {
            Error::Numerical(format!(
                "{error}, at time {time:.6e} s; use a shorter time step"
            ))
        })?;
        self.steps += 1;
        self.balance.entered += self.report.entered;
        self.measure();
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
        Ok(())
    }

    fn update_bodies(&mut self, _: &mut Particles<S>, _: &Domain) -> Result<(), Error> {
        // The blocks do not move.
        Ok(())
    }
}
