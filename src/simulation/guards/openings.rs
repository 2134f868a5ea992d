//! Comparison of inflow and outflow through the openings of a lattice.
//!
//! At every check the mass that crossed each patch in the last step is summed over the cells outside bodies,
//! exactly and over all ranks. A patch with a net inflow counts as inflow with its net rate, the others as outflow.
//! Both are averaged over a *window* of checks: [`CROSSINGS`] times the time that sound takes across the domain,
//! and at least [`MIN_CHECKS`] checks. A lattice fluid is compressible, so that inflow and outflow differ while
//! pressure builds up. They are compared when all ramps of the boundaries have ended and two whole windows have
//! passed since:
//!
//! * *imbalance*: the magnitude of (inflow - outflow) / max(inflow, outflow) of the window is larger than
//!   [`IMBALANCE`];
//! * *only fills*: an outflow below [`ZERO_FLOW_RATIO`] of the inflow, or the reverse.
//!
//! Both are warnings only: if a domain continues to fill, its density ends the run (`guards.max_compression`).

use decomposition::Communicator;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

use base::number::real;
use base::units::LatticeUnits;
use coupling::lattice::LatticeFlow;
use dem::space::Space;
use lbm::boundary::from_quanta;
use lbm::lanes::Stored;
use plan::Plan;
use plan::scene::boundaries::ScenePatch;

/// Number of times that sound crosses the domain in a window.
const CROSSINGS: f64 = 6.0;
/// Minimum number of checks in a window.
const MIN_CHECKS: usize = 10;
/// Minimum imbalance for a warning.
pub(super) const IMBALANCE: f64 = 0.1;
/// Ratio of the smaller to the larger flow below which the smaller counts as zero.
pub(super) const ZERO_FLOW_RATIO: f64 = 1e-3;
/// Mass per step, relative to the mass of the domain, below which the flow counts as zero.
const ZERO_FLOW: f64 = 1e-9;

/// Inflow and outflow as mass per step, in lattice units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rates {
    pub(super) inflow: f64,
    pub(super) outflow: f64,
}

impl Rates {
    /// Returns (inflow - outflow) / max(inflow, outflow).
    pub(super) fn imbalance(&self) -> f64 {
        (self.inflow - self.outflow) / self.inflow.max(self.outflow)
    }

    /// Converts to m3/s, or m2/s per metre of depth in 2-D.
    pub(super) fn to_si(self, units: &LatticeUnits) -> Self {
        let cell = units.spacing.powi(if units.dimension == 2 { 2 } else { 3 });
        let scale = cell / units.time_step;
        Self {
            inflow: self.inflow * scale,
            outflow: self.outflow * scale,
        }
    }
}

/// Returns the unit of flows.
pub(super) fn unit(dimension: usize) -> &'static str {
    if dimension == 2 { "m2/s" } else { "m3/s" }
}

/// Checks of the window in a checkpoint. A number that is not finite is stored as null.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct State {
    settled: usize,
    /// Inflow and outflow at each check.
    #[serde(rename = "looks")]
    samples: Vec<[Option<f64>; 2]>,
}

/// Flow through the openings.
#[derive(Clone, Debug, Default)]
pub(super) struct Openings {
    /// `true` if the lattice has openings.
    exist: bool,
    /// Number of checks in a window; 0 before the first check.
    window: usize,
    /// Step at which all ramps have ended.
    ramps_end: u64,
    /// Mass per step below which the flow counts as zero.
    zero_flow: f64,
    /// Number of checks since the end of the ramps.
    settled: usize,
    /// Rates at the checks of the window, oldest first.
    samples: VecDeque<Rates>,
    /// Sums since the last call of [`Self::since_last`], and the number of steps in them.
    since: (Rates, u64),
    masses: Vec<i128>,
    sums: Vec<u128>,
}

impl Openings {
    pub(super) fn from_plan(plan: &Plan) -> Self {
        let open = |patch: &ScenePatch| patch.condition.model().passes_water();
        let flow = plan.scene.flow.as_ref();
        Self {
            exist: flow.is_some_and(|flow| flow.patches().any(open)),
            ..Self::default()
        }
    }

    pub(super) fn exist(&self) -> bool {
        self.exist
    }

    /// Records the mass that crosses the faces in the present step. Collective.
    pub(super) fn record_step<Sp: Space, S: Stored>(
        &mut self,
        step: u64,
        every: u64,
        flow: &dyn LatticeFlow<Sp, S>,
        communicator: &Communicator,
    ) {
        if !self.exist {
            return;
        }
        self.prepare(every, flow);
        let fluid = flow.fluid();
        let water = flow.balanced();
        let all = water.holds_all();
        fluid.mass_through(|at| all || water.holds(at), &mut self.masses);
        self.sums.clear();
        self.sums
            .extend(self.masses.iter().map(|mass| mass.cast_unsigned()));
        communicator.all_reduce_sum_u128s(&mut self.sums);
        let mut rates = Rates::default();
        for sum in &self.sums {
            let mass = from_quanta(sum.cast_signed());
            if mass < 0.0 {
                rates.inflow -= mass;
            } else {
                rates.outflow += mass;
            }
        }
        if self.samples.len() == self.window {
            self.samples.pop_front();
        }
        self.samples.push_back(rates);
        self.settled += usize::from(step > self.ramps_end);
        self.since.0.inflow += rates.inflow;
        self.since.0.outflow += rates.outflow;
        self.since.1 += 1;
    }

    /// Determines the length of the window once, and allocates a buffer for its checks.
    pub(super) fn prepare<Sp: Space, S: Stored>(
        &mut self,
        every: u64,
        flow: &dyn LatticeFlow<Sp, S>,
    ) {
        if !self.exist || self.window > 0 {
            return;
        }
        let fluid = flow.fluid();
        let cells = fluid.domain_cells();
        let longest = cells.into_iter().max().unwrap_or(1);
        // Sound travels 1/sqrt(3) of a cell in a step.
        let steps = CROSSINGS * real(longest) * 3.0_f64.sqrt();
        let samples = (steps / real(every)).ceil();
        self.window = base::number::whole(samples).max(MIN_CHECKS);
        self.ramps_end = base::number::whole(fluid.boundaries().ramps_end()) as u64;
        self.zero_flow = ZERO_FLOW * cells.map(real).iter().product::<f64>();
        self.samples.reserve(self.window);
        self.sums.reserve(fluid.boundaries().names().count());
        self.masses.reserve(fluid.boundaries().names().count());
    }

    /// Returns the means over the window; none before the first check, and without openings.
    pub(super) fn mean(&self) -> Option<Rates> {
        let number = real(self.samples.len());
        (!self.samples.is_empty()).then(|| Rates {
            inflow: self.samples.iter().map(|r| r.inflow).sum::<f64>() / number,
            outflow: self.samples.iter().map(|r| r.outflow).sum::<f64>() / number,
        })
    }

    /// Returns `true` if a mean differs from zero by more than rounding.
    pub(super) fn flows(&self, mean: &Rates) -> bool {
        mean.inflow.max(mean.outflow) > self.zero_flow
    }

    /// Returns the means since the last call.
    pub(super) fn since_last(&mut self) -> Option<Rates> {
        let (sums, number) = std::mem::take(&mut self.since);
        let number = real(number);
        (number > 0.0).then(|| Rates {
            inflow: sums.inflow / number,
            outflow: sums.outflow / number,
        })
    }

    /// Returns the means of the window if inflow and outflow should agree by now but do not.
    pub(super) fn disagree(&self) -> Option<Rates> {
        let mean = self.mean()?;
        let judged = self.settled >= 2 * self.window && self.flows(&mean);
        (judged && mean.imbalance().abs() > IMBALANCE).then_some(mean)
    }

    /// Returns the state for a checkpoint.
    pub(super) fn state(&self) -> State {
        State {
            settled: self.settled,
            samples: self
                .samples
                .iter()
                .map(|rates| [Some(rates.inflow), Some(rates.outflow)])
                .collect(),
        }
    }

    /// Restores the state returned by [`Self::state`].
    pub(super) fn restore(&mut self, state: State) {
        self.settled = state.settled;
        self.samples = state
            .samples
            .into_iter()
            .filter_map(|[inflow, outflow]| {
                Some(Rates {
                    inflow: inflow?,
                    outflow: outflow?,
                })
            })
            .collect();
    }
}
