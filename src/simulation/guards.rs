//! Guards: numbers that fail are named (cell or grain) before they spoil a run, and the balance of mass and momentum is
//! kept as a meter.
//!
//! * Every `check_every_steps` the rest population of every cell is looked at; a value that is not finite or far from
//!   equilibrium has the slab searched for the cell. Every tenth time, and at the end, the largest velocity is taken too: no run is
//!   done whose last state fails.
//! * In the same rhythm one step is balanced: the mass of the lattice before and after against what the faces let through
//!   (moving bounce-back lets nothing through), and the momentum of the fluid outside the bodies against faces, bodies and
//!   body force.

use crate::coupling::lattice::LatticeFlow;
use crate::dem::particles::Particles;
use crate::dem::space::{Components, Space};
use crate::error::Error;
use crate::lbm::boundary::{Flux, from_quanta, quanta};
use crate::lbm::lanes::Stored;
use crate::plan::Plan;
use decomposition::{Communicator, Domain};
use serde_json::{Value, json};

/// Steps between balances; each costs about one fluid step.
const BALANCE_EVERY: u64 = 1000;

/// The guards of a run.
#[derive(Clone, Debug, Default)]
pub struct Guards {
    every: u64,
    before: Option<[i128; 4]>,
    mass_error: f64,
    momentum_error: f64,
    mach: f64,
    fluxes: Vec<Flux>,
    /// Moments of one row of cells: room that is kept.
    row: [Vec<f64>; 4],
}

impl Guards {
    /// Guards with the rhythm of the plan.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        Self {
            every: u64::from(plan.scene.guards.check_every_steps).max(1),
            ..Self::default()
        }
    }

    /// What a checkpoint keeps of the meters: tables print them, and go on after a restart as if there had been none.
    #[must_use]
    pub fn state(&self) -> Value {
        json!([self.mass_error, self.momentum_error, self.mach])
    }

    /// Takes back what [`Self::state`] gave; numbers that are missing count as 0.
    pub fn restore(&mut self, state: &Value) {
        let number = |n: usize| state[n].as_f64().unwrap_or(0.0);
        (self.mass_error, self.momentum_error, self.mach) = (number(0), number(1), number(2));
    }

    /// Largest relative error of the mass balance of any step looked at.
    #[must_use]
    pub fn mass_error(&self) -> f64 {
        self.mass_error
    }

    /// Largest error of the momentum balance of any step looked at, over the largest force in it.
    #[must_use]
    pub fn momentum_error(&self) -> f64 {
        self.momentum_error
    }

    /// Largest velocity over the lattice velocity C when last looked at.
    #[must_use]
    pub fn mach(&self) -> f64 {
        self.mach
    }

    /// Before a fluid step: takes the totals if this step is to be balanced. Collective.
    pub fn before<Sp: Space, S: Stored>(
        &mut self,
        step: u64,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        domain: &Domain,
    ) {
        self.before = None;
        if let Some(flow) = flow
            && step.is_multiple_of(BALANCE_EVERY)
        {
            self.before = Some(totals(flow, domain.communicator(), &mut self.row));
        }
    }

    /// After the fluid step, before anything moved: closes the balance. Collective.
    pub fn after<Sp: Space, S: Stored>(
        &mut self,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        domain: &Domain,
    ) {
        let (Some(before), Some(flow)) = (self.before.take(), flow) else {
            return;
        };
        let communicator = domain.communicator();
        let after = totals(flow, communicator, &mut self.row);
        let mut crossed = [0_i128; 4];
        flow.fluid().fluxes_into(&mut self.fluxes);
        for flux in &self.fluxes {
            crossed[0] += flux.mass;
            for a in 0..3 {
                crossed[a + 1] += flux.force[a];
            }
        }
        let mut scale = 0.0_f64;
        for load in flow.last_loads() {
            for a in 0..3 {
                crossed[a + 1] += load[a];
                scale = scale.max(from_quanta(load[a]).abs());
            }
        }
        let crossed = crossed.map(|c| sum(communicator, c));
        let residual = |n: usize| from_quanta(after[n] - before[n] + crossed[n]);
        let cells: f64 = flow
            .fluid()
            .domain_cells()
            .iter()
            .map(|&n| crate::scene::grid::count(n))
            .product();
        self.mass_error = self.mass_error.max(residual(0).abs() / cells);
        let force = flow.fluid_force_total(communicator);
        let scale = communicator.all_reduce_max_f64(scale);
        for a in 0..3 {
            let residual = residual(a + 1) - force[a];
            let size = scale
                .max(from_quanta(crossed[a + 1]).abs())
                .max(force[a].abs())
                .max(1e-12);
            self.momentum_error = self.momentum_error.max(residual.abs() / size);
        }
    }

    /// After a step: looks for numbers that fail. Collective.
    ///
    /// # Errors
    /// Names the first cell (in global order) or the grain.
    pub fn check<Sp: Space, S: Stored>(
        &mut self,
        step: u64,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        particles: &Particles<Sp>,
        plan: &Plan,
        domain: &Domain,
    ) -> Result<(), Error> {
        let last = step == plan.clock.steps;
        if !last && !step.is_multiple_of(self.every) {
            return Ok(());
        }
        let communicator = domain.communicator();
        let mut worst: Option<(u64, String)> = None;
        if let Some(flow) = flow {
            let thorough = last || step.is_multiple_of(10 * self.every);
            if thorough || !flow.fluid().looks_sound() {
                let limit = plan.scene.guards.max_mach;
                let (speed, bad) = search(flow, limit, plan, &mut self.row);
                self.mach = speed;
                worst = bad;
            }
            if thorough {
                self.mach = communicator.all_reduce_max_f64(self.mach);
            }
        }
        for k in 0..particles.owned() {
            let motion = &particles.motion[k];
            let finite = (0..Sp::DIMENSION)
                .all(|a| motion.position.get(a).is_finite() && motion.velocity.get(a).is_finite());
            if !finite && worst.is_none() {
                let id = particles.body[k].id;
                worst = Some((
                    u64::MAX - 1,
                    format!("grain {id} has a position or velocity that is not finite"),
                ));
            }
        }
        // One reduction, on every rank: then the rank with the first of all bad cells speaks for all.
        let mine = worst.as_ref().map_or(u64::MAX, |(n, _)| *n);
        let first = communicator.all_reduce_min_u64(mine);
        if first == u64::MAX {
            return Ok(());
        }
        let mine = match worst {
            Some((n, text)) if n == first => Err(text),
            _ => Ok(()),
        };
        match communicator.agree(mine) {
            Ok(()) => Ok(()),
            Err(e) => Err(Error::Numerical(format!("step {step}: {}", e.message))),
        }
    }
}

fn sum(communicator: &Communicator, value: i128) -> i128 {
    communicator
        .all_reduce_sum_u128(value.cast_unsigned())
        .cast_signed()
}

/// Mass of the lattice, momentum of the fluid outside bodies, each cell in quanta as what crosses faces is: no order of cells, and so
/// no number of ranks, changes a sum.
fn totals<Sp: Space, S: Stored>(
    flow: &dyn LatticeFlow<Sp, S>,
    communicator: &Communicator,
    row: &mut [Vec<f64>; 4],
) -> [i128; 4] {
    let mut sums = [0_i128; 4];
    let populations = flow.fluid().populations();
    let fast = populations.order()[2];
    let length = populations.cells()[fast];
    let all_count = flow.all_count();
    for (mut at, first) in populations.rows() {
        populations.row_moments(first, length, row);
        for (a, row) in row.iter().enumerate() {
            for (k, value) in row.iter().enumerate() {
                at[fast] = k;
                if a == 0 || all_count || flow.counts(at) {
                    sums[a] += i128::from(quanta(*value));
                }
            }
        }
    }
    sums.map(|s| sum(communicator, s))
}

/// The largest speed of the water of the slab and the first cell whose numbers fail, by global index.
fn search<Sp: Space, S: Stored>(
    flow: &dyn LatticeFlow<Sp, S>,
    limit: f64,
    plan: &Plan,
    row: &mut [Vec<f64>; 4],
) -> (f64, Option<(u64, String)>) {
    let fluid = flow.fluid();
    let populations = fluid.populations();
    let fast = populations.order()[2];
    let length = populations.cells()[fast];
    let (all, start) = (fluid.domain_cells(), fluid.start());
    let all_count = flow.all_count();
    let mut fastest = 0.0_f64;
    let mut bad: Option<(u64, String)> = None;
    for (mut at, first) in populations.rows() {
        fluid.row_states(first, length, row);
        for k in 0..length {
            at[fast] = k;
            let cell = first + k;
            let [drho, u, v, w] = [0, 1, 2, 3].map(|n| row[n][k]);
            let speed = (u * u + v * v + w * w).sqrt();
            // What moves in a cell that is mostly rock is no water: it has to be a number, no more.
            let covered = fluid.cover().is_some_and(|c| c.fraction(cell) >= 0.5);
            let rock = covered || !all_count && !flow.counts(at);
            if drho.is_finite() && (speed <= limit || rock && speed.is_finite()) {
                if !rock {
                    fastest = fastest.max(speed);
                }
                continue;
            }
            let global: [usize; 3] = std::array::from_fn(|a| at[a] + start[a]);
            let index = ((global[2] * all[1] + global[1]) * all[0] + global[0]) as u64;
            if bad.as_ref().is_none_or(|(n, _)| index < *n) {
                let centre = plan.scene.grid.centre(global);
                let tau = fluid.relaxation_time();
                let text = if speed.is_finite() && drho.is_finite() {
                    format!(
                        "cell {global:?} at {centre:?} m moves at Mach {speed:.3} (|u|/C), above guards.max_mach = {limit}; relaxation time {tau}; use a smaller time step (smaller relaxation time) or a finer lattice"
                    )
                } else {
                    format!(
                        "cell {global:?} at {centre:?} m is not finite (relaxation time {tau}); use a larger relaxation time, a finer lattice or a slower flow"
                    )
                };
                bad = Some((index, text));
            }
        }
    }
    (fastest, bad)
}
