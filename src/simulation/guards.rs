//! Guards: checks of the state that end a run and name the cell, grain or opening, and meters of the mass and momentum
//! balance.
//!
//! * *Check*: every `guards.check_every_steps` steps (default 100) and at the end, every cell and every grain is
//!   checked ([`state_check`]). A value that is not finite, a speed above `guards.max_lattice_velocity` and a
//!   compression above `guards.max_compression` end the run; [`failure`] names the cell. A compression above
//!   `guards.warn_compression` is reported at once, and in each log line while it persists. Cells enclosed by
//!   bodies do not count for compression, because moving bodies squeeze them. The warm-up is checked in the same
//!   way. A check takes 9, 30 and 40 ns per cell with 9, 19 and 27 populations in f64, where reading them once
//!   takes 7, 16 and 24 ns (one core of a busy machine). A step reads and writes the populations, so that a check
//!   every 100 steps costs 0.6 to 0.9 % of memory-bound steps, and less otherwise.
//! * *Mach number*: a lattice velocity above 0.1, a Mach number above 0.17, is reported once and at the end.
//! * *Overlap*: the engine of the solids keeps the deepest contact of all solid steps ([`dem::deepest`]). A
//!   check ends the run if it is deeper than `guards.max_overlap`: bodies that a soft contact cannot stop pass through
//!   it.
//! * *Openings*: at each check inflow and outflow are compared ([`openings`]).
//! * *Balance*: in one step of [`BALANCE_EVERY`] the change of the mass of the lattice is compared with the flux
//!   through the faces (moving bounce-back passes no mass), and the change of the momentum of the water outside the
//!   bodies with the forces of bodies, body force and the faces of the cells outside the bodies.
//!
//! Values that were never measured are none: tables print `-`, `summary.json` has `null`.

mod covered;
mod failure;
mod openings;
mod state_check;

use base::error::Error;
use case::coupling::{Coupling, Scheme};
use case::fluid::Precision;
use coupling::lattice::LatticeFlow;
use coupling::structure_map::StructureMap;
use decomposition::{Communicator, Domain};
use dem::deepest::{Deepest, OtherSide};
use dem::particles::Particles;
use dem::space::{Components, Space};
pub use failure::of_solids;
use failure::{Failure, Kind};
use lbm::boundary::from_quanta;
use lbm::lanes::Stored;
use lbm::populations::RowSums;
use lbm::surface::SlabSurface;
use openings::Openings;
use plan::Plan;
use plan::margin::USUAL_LATTICE_VELOCITY;
use serde::{Deserialize, Serialize};
use state_check::{CheckResult, Extreme, LatticeOrder, StateCheck};
use std::fmt;

/// Steps between two balances; each balance costs about as much as a fluid step.
const BALANCE_EVERY: u64 = 1000;
/// Minimum force per cell, in lattice units, by which an error of the momentum balance is divided: for populations in
/// f64, for populations in f32, and for collisions in f32. Such collisions change the momentum of a cell, up to 0.1, by
/// up to 2^-23 of it in a step: a thousandth of this force.
const SMALLEST_FORCE: [f64; 3] = [1e-11, 1e-7, 1e-5];
/// Maximum errors of the mass balance of a step that are attributed to rounding, with populations in f64 and in f32.
const MASS_ERROR: [f64; 2] = [1e-6, 1e-6];
const MOMENTUM_ERROR: [f64; 2] = [1e-6, 1e-3];

/// Values of the guards in a checkpoint. A number that is not finite is stored as null.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct GuardState {
    mass_error: Option<f64>,
    momentum_error: Option<f64>,
    #[serde(alias = "mach")]
    lattice_velocity: Option<f64>,
    /// Density deviation of the largest magnitude, and its cell.
    squeezed: Option<(Option<f64>, Option<u64>)>,
    openings: openings::State,
    warned: [bool; 2],
    fast: bool,
    overlap: Option<f64>,
}

/// Guards of a run.
#[derive(Clone, Debug, Default)]
pub struct Guards {
    every: u64,
    /// Minimum force per cell by which an error of the momentum balance is divided.
    smallest_force: f64,
    before: Option<[i128; 4]>,
    mass_error: Option<f64>,
    momentum_error: Option<f64>,
    /// Largest speed relative to C: latest value, and maximum over the run.
    speed: [Option<f64>; 2],
    /// Density deviation of the largest magnitude and the position of its cell: latest value, and maximum over the
    /// run.
    squeezed: [Option<Extreme>; 2],
    /// `true` if a step was taken since the start; before the first step no mass has crossed a face.
    stepped: bool,
    /// `true` if the last check found a failure whose description needs populations that are still on the GPU.
    unfetched: bool,
    /// `true` if buffers are preallocated.
    ready: bool,
    /// Step of the last check.
    last_check: Option<u64>,
    openings: Openings,
    /// Largest overlap of any contact so far, divided by the smaller radius; reduced over all ranks at checks.
    overlap: Option<f64>,
    /// Flags of warnings given, `true` after the warning: about the compression, and about the openings.
    warned: [bool; 2],
    /// `true` if a warning was given about a Mach number above the usual limit.
    fast: bool,
    messages: Vec<String>,
    state_check: StateCheck,
    /// Sums over rows in buffers that are reused between checks.
    rows: Vec<RowSums>,
}

impl Guards {
    /// Returns guards with the check intervals of the plan.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let precision = plan.scene.flow.as_ref().map_or(0, |flow| {
            usize::from(flow.storage == Precision::F32)
                + usize::from(flow.arithmetic == Precision::F32)
        });
        Self {
            every: u64::from(plan.scene.guards.check_every_steps).max(1),
            smallest_force: SMALLEST_FORCE[precision],
            openings: Openings::from_plan(plan),
            ..Self::default()
        }
    }

    /// Returns the values for a checkpoint, so that a restart does not change later tables.
    #[must_use]
    pub fn state(&self) -> GuardState {
        GuardState {
            mass_error: self.mass_error,
            momentum_error: self.momentum_error,
            lattice_velocity: self.speed[1],
            squeezed: self.squeezed[1].map(|at| (Some(at.value), Some(at.cell))),
            openings: self.openings.state(),
            warned: self.warned,
            fast: self.fast,
            overlap: self.overlap,
        }
    }

    /// Restores the values returned by [`Self::state`]; missing numbers count as never measured.
    pub fn restore(&mut self, state: GuardState) {
        self.mass_error = state.mass_error;
        self.momentum_error = state.momentum_error;
        self.speed[1] = state.lattice_velocity;
        self.squeezed[1] = state
            .squeezed
            .and_then(|(value, cell)| value.zip(cell))
            .map(|(value, cell)| Extreme { value, cell });
        self.openings.restore(state.openings);
        self.warned = state.warned;
        self.fast = state.fast;
        self.overlap = state.overlap;
    }

    /// Returns the largest relative error of the mass balance among the balanced steps.
    #[must_use]
    pub fn mass_error(&self) -> Option<f64> {
        self.mass_error
    }

    /// Returns the largest error of the momentum balance among the balanced steps, divided by the largest force in
    /// that step.
    #[must_use]
    pub fn momentum_error(&self) -> Option<f64> {
        self.momentum_error
    }

    /// Returns the largest fluid speed of all checks in lattice units, |u| dt/h.
    #[must_use]
    pub fn lattice_velocity(&self) -> Option<f64> {
        self.speed[1]
    }

    /// Returns the largest compression |rho/rho_0 - 1| of the water of any check.
    #[must_use]
    pub fn compression(&self) -> Option<f64> {
        self.squeezed[1].map(|at| at.value.abs())
    }

    /// Returns the largest overlap of a contact over the radius of the smaller body, of all solid steps up to the last
    /// check; none if nothing moves.
    #[must_use]
    pub fn overlap(&self) -> Option<f64> {
        self.overlap
    }

    /// Records the deepest contact of this rank and returns the deepest of all ranks. Collective.
    pub fn note_overlap(
        &mut self,
        deepest: Option<Deepest>,
        communicator: &Communicator,
    ) -> Option<Deepest> {
        let mine = deepest?;
        let part = communicator.all_reduce_max_f64(mine.part);
        self.overlap = larger_measured(self.overlap, Some(part));
        // Among equally deep contacts, the smallest id counts, then the smallest number of its partner: bodies
        // before walls.
        const WALLS: u64 = 1 << 62;
        let holds = mine.part >= part && mine.with != OtherSide::Unknown;
        let body = if holds { mine.body } else { u64::MAX };
        let first = communicator.all_reduce_min_u64(body);
        let other = match mine.with {
            _ if body != first => u64::MAX,
            OtherSide::Body(id) => id,
            OtherSide::Wall(wall) => WALLS + u64::from(wall),
            OtherSide::Unknown => u64::MAX,
        };
        let other = communicator.all_reduce_min_u64(other);
        let with = match other {
            u64::MAX => OtherSide::Unknown,
            wall if wall >= WALLS => {
                OtherSide::Wall(u32::try_from(wall - WALLS).unwrap_or(u32::MAX))
            }
            id => OtherSide::Body(id),
        };
        Some(Deepest {
            part,
            body: first,
            with,
        })
    }

    /// Includes the largest speed relative to C that a recorder measured, so that no recorded value exceeds the
    /// reported maximum.
    pub fn include_speed(&mut self, speed: Option<f64>) {
        self.speed[1] = larger_measured(self.speed[1], speed);
    }

    /// Returns the inflow and outflow [m3/s; m2/s per metre of depth in 2-D], means over the window of [`openings`];
    /// none without openings.
    #[must_use]
    pub fn inflow_and_outflow(&self, plan: &Plan) -> Option<[f64; 2]> {
        let mean = self.openings.mean()?.to_si(&plan.units?);
        Some([mean.inflow, mean.outflow])
    }

    /// Returns (inflow - outflow) / max(inflow, outflow); none if nothing flows.
    #[must_use]
    pub fn imbalance(&self) -> Option<f64> {
        let mean = self.openings.mean()?;
        self.openings.flows(&mean).then(|| mean.imbalance())
    }

    /// Returns the text about the fluid in a line of the log.
    pub fn line(&mut self, plan: &Plan) -> String {
        let mut text = match self.speed {
            [Some(now), Some(most)] => format!(
                "lattice velocity {now:.3} (largest {most:.3}, Mach number {:.3})",
                mach(most)
            ),
            _ => "lattice velocity -".into(),
        };
        text += "  density ";
        match self.squeezed[0] {
            Some(at) if at.value.abs() > plan.scene.guards.warn_compression => {
                text += &failure::density(at.value, plan);
            }
            Some(at) => text += &format!("{:+.1e}", at.value),
            None => text += "-",
        }
        if self.openings.exist() {
            let rates = self.openings.since_last().zip(plan.units);
            text += &match rates.map(|(rates, units)| (rates.to_si(&units), units.dimension)) {
                Some((rates, dimension)) => format!(
                    "  in {:.3e} out {:.3e} {}",
                    rates.inflow,
                    rates.outflow,
                    openings::unit(dimension)
                ),
                None => "  in - out -".into(),
            };
        }
        text
    }

    /// Returns the messages since the last call.
    pub fn take_events(&mut self) -> Vec<String> {
        std::mem::take(&mut self.messages)
    }

    /// Returns the warnings at the end of a run.
    #[must_use]
    pub fn warnings(&self, plan: &Plan) -> Vec<String> {
        let mut all = Vec::new();
        let guards = &plan.scene.guards;
        if let Some(at) = self.squeezed[1]
            && at.value.abs() > guards.warn_compression
        {
            all.push(format!(
                "the density reached {}, above guards.warn_compression = {}",
                failure::density(at.value, plan),
                guards.warn_compression
            ));
        }
        if let Some(speed) = self.speed[1]
            && speed > USUAL_LATTICE_VELOCITY
        {
            all.push(too_fast(speed));
        }
        all.extend(self.unbalanced(plan));
        let single = plan
            .scene
            .flow
            .as_ref()
            .is_some_and(|flow| flow.storage == Precision::F32);
        for (what, error, [double, float]) in [
            ("mass", self.mass_error, MASS_ERROR),
            ("momentum", self.momentum_error, MOMENTUM_ERROR),
        ] {
            let limit = if single { float } else { double };
            if let Some(error) = error
                && (error.is_nan() || error > limit)
            {
                let interpolated = match &plan.scene.coupling {
                    Some(Coupling::BounceBack(links)) => links.scheme == Scheme::Interpolated,
                    _ => !plan.scene.structures.is_empty(),
                };
                let why = if what == "mass" && interpolated {
                    ": interpolated links do not conserve mass to rounding, \"half_way\" links do"
                } else {
                    ""
                };
                all.push(format!(
                    "the {what} balance of a step has an error of {error:.1e}, above {limit:.0e}{why}"
                ));
            }
        }
        all
    }

    /// Returns the inflow and outflow in words, and `true` if one of them is zero; none without openings.
    fn flows(&self, plan: &Plan) -> Option<(String, bool)> {
        let [inflow, outflow] = self.inflow_and_outflow(plan)?;
        let unit = openings::unit(plan.scene.grid.dimension);
        let text = format!("inflow {inflow:.3e}, outflow {outflow:.3e} {unit}");
        let one_way = inflow.min(outflow) < openings::ZERO_FLOW_RATIO * inflow.max(outflow);
        Some((self.unbalanced(plan).unwrap_or(text), one_way))
    }

    /// Returns the warning that inflow and outflow differ.
    fn unbalanced(&self, plan: &Plan) -> Option<String> {
        if plan.scene.surface.is_some() {
            // The surface rises where more water enters than leaves.
            return None;
        }
        let mean = self.openings.disagree()?;
        let units = plan.units?;
        let (rates, unit) = (mean.to_si(&units), openings::unit(units.dimension));
        let both = format!(
            "inflow {:.3e}, outflow {:.3e} {unit}",
            rates.inflow, rates.outflow
        );
        let (less, more) = (mean.inflow.min(mean.outflow), mean.inflow.max(mean.outflow));
        Some(if less < openings::ZERO_FLOW_RATIO * more {
            let (verb, none) = if mean.inflow > mean.outflow {
                ("fills", "leaves")
            } else {
                ("drains", "enters")
            };
            format!(
                "the domain only {verb}: {both}; nothing {none}, so that the density changes until \
                 guards.max_compression ends the run; \
                 check that an open path of several cells leads from inlet to outlet"
            )
        } else {
            format!(
                "{both}: they still differ by {:.0} % after sound has crossed the domain many times, which \
                 changes the density",
                100.0 * mean.imbalance().abs()
            )
        })
    }

    /// Returns `true` if the step that begins at `step` is balanced.
    #[must_use]
    pub fn balances(step: u64) -> bool {
        step.is_multiple_of(BALANCE_EVERY)
    }

    /// Returns `true` if the state of this step is checked.
    #[must_use]
    pub fn checks_at(&self, step: u64) -> bool {
        step.is_multiple_of(self.every)
    }

    /// Returns the next step after `step` at which a check or a balance needs the state.
    #[must_use]
    pub fn next_check(&self, step: u64) -> u64 {
        // A balance compares the state before a step with that after it.
        let within = |every: u64| (step / every + 1) * every;
        let balanced = if Self::balances(step) {
            step + 1
        } else {
            within(BALANCE_EVERY)
        };
        within(self.every).min(balanced)
    }

    /// Computes the totals before a fluid step that is balanced. Collective.
    pub fn before<Sp: Space, S: Stored>(
        &mut self,
        step: u64,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        domain: &Domain,
    ) {
        self.before = None;
        self.stepped = true;
        if let Some(flow) = flow
            && !self.ready
        {
            // Allocates the buffers of the checks once: no step after the first allocates.
            self.ready = true;
            self.state_check.check_cells(flow);
            self.openings.prepare(self.every, flow);
        }
        // The lattice balances the momentum below a free surface, and interface cells keep their mass apart.
        if let Some(flow) = flow
            && flow.fluid().surface().is_none()
            && Self::balances(step)
        {
            self.before = Some(totals(flow, domain.communicator(), &mut self.rows));
        }
    }

    /// Completes the balance after the fluid step, before any body moves. Collective.
    pub fn after<Sp: Space, S: Stored>(
        &mut self,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        domain: &Domain,
    ) {
        let Some(flow) = flow else { return };
        let communicator = domain.communicator();
        self.balance_surface(flow, communicator);
        let Some(before) = self.before.take() else {
            return;
        };
        let after = totals(flow, communicator, &mut self.rows);
        // Fluid inside bodies is excluded, including at domain faces.
        let water = flow.balanced();
        let all = water.holds_all();
        let mut crossed = flow.fluid().left(|at| all || water.holds(at));
        let through = crossed;
        let mut scale = 0.0_f64;
        let fixed = flow.structures().map_or(&[][..], StructureMap::loads);
        for load in flow.last_loads().iter().chain(fixed) {
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
            .map(|&n| base::number::real(n))
            .product();
        self.mass_error = larger_measured(self.mass_error, Some(residual(0).abs() / cells));
        let (force, largest) = flow.fluid_force_total(communicator);
        let smallest = self.smallest_force;
        // The largest force of all axes: across the flow there may be only rounding errors.
        let mut size = communicator.all_reduce_max_f64(scale).max(smallest * cells);
        size = size.max(largest);
        for part in &through[1..] {
            size = size.max(from_quanta(sum(communicator, *part)).abs());
        }
        for (a, force) in force.into_iter().enumerate() {
            let error = (residual(a + 1) - force).abs() / size;
            self.momentum_error = larger_measured(self.momentum_error, Some(error));
        }
    }

    /// Closes the balance of the momentum of a step with a free surface. Collective.
    fn balance_surface<Sp: Space, S: Stored>(
        &mut self,
        flow: &dyn LatticeFlow<Sp, S>,
        communicator: &Communicator,
    ) {
        let fluid = flow.fluid();
        let Some(step) = fluid.surface().and_then(SlabSurface::balanced) else {
            return;
        };
        let all = |part: i128| sum(communicator, part);
        let fixed = flow.structures().map_or(&[][..], StructureMap::loads);
        let mut loads = [0_i128; 3];
        let mut scale = 0.0_f64;
        for load in flow.last_loads().iter().chain(fixed) {
            for a in 0..3 {
                loads[a] += load[a];
                scale = scale.max(from_quanta(load[a]).abs());
            }
        }
        let open = from_quanta(all(step.open));
        let force = fluid.last_force().map(|force| force * open);
        let smallest = self.smallest_force;
        let scale = communicator.all_reduce_max_f64(scale);
        let mut size = scale.max(smallest * open.max(1.0));
        for part in force
            .into_iter()
            .chain(step.left.map(|part| from_quanta(all(part))))
        {
            size = size.max(part.abs());
        }
        for a in 0..3 {
            let gone = from_quanta(all(
                step.change[a] + step.left[a] + loads[a] - step.weight[a]
            ));
            let error = (gone - force[a]).abs() / size;
            self.momentum_error = larger_measured(self.momentum_error, Some(error));
        }
    }

    /// Checks the state after `step`, unless it was checked: the final state of a run is always checked. Collective.
    ///
    /// # Errors
    ///
    /// If a check fails; the text names the cell or the grain.
    pub fn check<Sp: Space, S: Stored>(
        &mut self,
        step: u64,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        (particles, deepest): (&Particles<Sp>, Option<Deepest>),
        plan: &Plan,
        domain: &Domain,
    ) -> Result<(), Error> {
        if self.last_check == Some(step) {
            return Ok(());
        }
        self.last_check = Some(step);
        if let Some(flow) = flow
            && self.stepped
        {
            let communicator = domain.communicator();
            self.openings
                .record_step(step, self.every, flow, communicator);
        }
        self.inspect(When::Step(step), flow, particles, plan, domain)?;
        let deepest = self.note_overlap(deepest, domain.communicator());
        if let Some(deepest) = deepest
            && deepest.part > plan.scene.guards.max_overlap
        {
            let text = failure::of_overlap(&deepest, plan);
            return Err(Error::Numerical(format!("{}: {text}", When::Step(step))));
        }
        if !self.warned[1]
            && let Some(text) = self.unbalanced(plan)
        {
            self.warned[1] = true;
            self.messages.push(format!("step {step}: warning: {text}"));
        }
        Ok(())
    }

    /// Runs [`Self::check`] in the warm-up, whose steps are counted separately. Collective.
    ///
    /// # Errors
    /// If [`Self::check`] fails.
    pub fn check_warm_up<Sp: Space, S: Stored>(
        &mut self,
        step: u64,
        flow: &dyn LatticeFlow<Sp, S>,
        particles: &Particles<Sp>,
        plan: &Plan,
        domain: &Domain,
    ) -> Result<(), Error> {
        if !step.is_multiple_of(self.every) {
            return Ok(());
        }
        self.inspect(When::WarmUp(step), Some(flow), particles, plan, domain)
    }

    /// Returns the failure of the water if the water failed as well in a step in which solids failed or left, which
    /// `solids` states. Collective.
    pub fn failed_water<Sp: Space, S: Stored>(
        &mut self,
        (step, solids): (u64, &str),
        (flow, particles): (Option<&dyn LatticeFlow<Sp, S>>, &Particles<Sp>),
        plan: &Plan,
        domain: &Domain,
    ) -> Option<Error> {
        let flow = flow?;
        let found = self.inspect(When::Step(step), Some(flow), particles, plan, domain);
        match found {
            Err(Error::Numerical(text)) => Some(Error::Numerical(format!("{text}; {solids}"))),
            Err(other) => Some(other),
            Ok(()) => None,
        }
    }

    /// Returns `true` if the last check found a failure in populations on a GPU, and resets the flag: the check must be
    /// repeated after fetching the populations, to describe the failure.
    pub fn take_unfetched(&mut self) -> bool {
        std::mem::take(&mut self.unfetched)
    }

    /// Checks all cells and grains. Collective.
    fn inspect<Sp: Space, S: Stored>(
        &mut self,
        when: When,
        flow: Option<&dyn LatticeFlow<Sp, S>>,
        particles: &Particles<Sp>,
        plan: &Plan,
        domain: &Domain,
    ) -> Result<(), Error> {
        let communicator = domain.communicator();
        let seen = flow.map(|flow| self.state_check.check_cells(flow));
        let lost = lost_grain(particles).map(|id| GRAINS + id);
        let mine = seen.and_then(|seen| seen.broken).or(lost);
        let broken = communicator.all_reduce_min_u64(mine.unwrap_or(u64::MAX));
        let mut failure = (broken < GRAINS).then_some(Failure {
            kind: Kind::NotFinite,
            place: broken,
        });
        if let (Some(seen), Some(flow)) = (seen, flow) {
            failure = failure.or(self.measure(seen, plan, communicator));
            if failure.is_none() {
                self.warn_of_compression(when, flow, plan);
            }
        }
        if failure.is_none() {
            self.warn_of_speed(when);
        }
        let text = match (failure, flow) {
            (Some(_), Some(flow)) if flow.fluid().is_away() => {
                (self.unfetched, self.last_check) = (true, None);
                return Ok(());
            }
            (Some(failure), Some(flow)) => {
                let told = self.flows(plan);
                failure.describe(flow, particles, plan, told, communicator)
            }
            _ if broken != u64::MAX => failure::of_grain(broken - GRAINS, plan),
            _ => return Ok(()),
        };
        Err(Error::Numerical(format!("{when}: {text}")))
    }

    /// Records the largest speed and compression of all ranks; returns the one that exceeds its limit. Collective.
    fn measure(
        &mut self,
        seen: CheckResult,
        plan: &Plan,
        communicator: &Communicator,
    ) -> Option<Failure> {
        let fastest = extreme_of_ranks(seen.fastest, communicator);
        let squeezed = extreme_of_ranks(seen.squeezed, communicator);
        let speed = Some(fastest.value.sqrt());
        self.speed = [speed, larger_measured(self.speed[1], speed)];
        let known = self.squeezed[1].filter(|at| at.value.abs() >= squeezed.value.abs());
        self.squeezed = [Some(squeezed), Some(known.unwrap_or(squeezed))];
        let limits = &plan.scene.guards;
        let (fast, dense) = (
            fastest.value.sqrt() > limits.max_lattice_velocity,
            squeezed.value.abs() > limits.max_compression,
        );
        let (kind, place) = match (fast, dense) {
            (true, _) => (Kind::TooFast, fastest.cell),
            (_, true) => (Kind::TooDense, squeezed.cell),
            _ => return None,
        };
        Some(Failure { kind, place })
    }

    /// Warns once if the compression at the last check is too large.
    fn warn_of_compression<Sp: Space, S: Stored>(
        &mut self,
        when: When,
        flow: &dyn LatticeFlow<Sp, S>,
        plan: &Plan,
    ) {
        let limit = plan.scene.guards.warn_compression;
        if let [Some(squeezed), _] = self.squeezed
            && squeezed.value.abs() > limit
            && !self.warned[0]
        {
            self.warned[0] = true;
            let cell = LatticeOrder::from_flow(flow).cell(squeezed.cell);
            self.messages.push(format!(
                "{when}: warning: the density of cell {cell:?} at {} m is {}, above guards.warn_compression = \
                 {limit}: pressures have an error of this size, which is proportional to the square of the time \
                 step",
                failure::point(plan.scene.grid.centre(cell), plan),
                failure::density(squeezed.value, plan),
            ));
        }
    }

    /// Warns once if the speed at the last check is too large.
    fn warn_of_speed(&mut self, when: When) {
        if let [Some(speed), _] = self.speed
            && speed > USUAL_LATTICE_VELOCITY
            && !self.fast
        {
            self.fast = true;
            self.messages
                .push(format!("{when}: warning: {}", too_fast(speed)));
        }
    }
}

/// Number of the first grain in a check: grains are numbered after all cells.
const GRAINS: u64 = 1 << 62;

/// Returns the smallest id of the owned grains whose position or velocity is not finite.
fn lost_grain<Sp: Space>(particles: &Particles<Sp>) -> Option<u64> {
    let finite = |k: usize| {
        let motion = &particles.motion[k];
        (0..Sp::DIMENSION)
            .all(|a| motion.position.get(a).is_finite() && motion.velocity.get(a).is_finite())
    };
    let lost = (0..particles.owned()).filter(|&k| !finite(k));
    lost.map(|k| particles.body[k].id).min()
}

/// Returns the Mach number of a speed in lattice units: |u|/c_s with c_s = C/sqrt 3 and C = h/dt.
pub(super) fn mach(lattice_velocity: f64) -> f64 {
    3.0_f64.sqrt() * lattice_velocity
}

/// Returns the warning for a speed whose square is not small compared with the square of the speed of sound.
fn too_fast(speed: f64) -> String {
    format!(
        "the lattice velocity |u| dt/h reached {speed:.3} (Mach number {:.3}): above {USUAL_LATTICE_VELOCITY} \
         the compressibility error, which grows with the square of the velocity, exceeds a few per cent; half \
         the time step halves lattice velocity and Mach number",
        mach(speed)
    )
}

/// Step of a check, in the run or in the warm-up.
#[derive(Clone, Copy, Debug)]
enum When {
    Step(u64),
    WarmUp(u64),
}

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step(step) => write!(f, "step {step}"),
            Self::WarmUp(step) => write!(f, "step {step} of the warm-up"),
        }
    }
}

/// Returns the larger of two values, either of which may be unmeasured; NaN counts as the largest.
fn larger_measured(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if a.is_nan() || a > b { a } else { b }),
        (a, b) => a.or(b),
    }
}

/// Returns the value of the largest magnitude on all ranks, and the first cell that has it. Collective.
fn extreme_of_ranks(mine: Extreme, communicator: &Communicator) -> Extreme {
    let size = communicator.all_reduce_max_f64(mine.value.abs());
    // The sign is that of the value in the chosen cell.
    let place = if mine.value.abs() >= size && mine.cell != u64::MAX {
        2 * mine.cell + u64::from(mine.value < 0.0)
    } else {
        u64::MAX
    };
    let place = communicator.all_reduce_min_u64(place);
    Extreme {
        value: if place % 2 == 1 && place != u64::MAX {
            -size
        } else {
            size
        },
        cell: place / 2,
    }
}

fn sum(communicator: &Communicator, value: i128) -> i128 {
    communicator
        .all_reduce_sum_u128(value.cast_unsigned())
        .cast_signed()
}

/// Returns the mass of the lattice and the momentum of the fluid outside bodies. Each cell is rounded to quanta
/// like the mass that crosses faces, so that no sum depends on the order of cells or the number of ranks.
fn totals<Sp: Space, S: Stored>(
    flow: &dyn LatticeFlow<Sp, S>,
    communicator: &Communicator,
    room: &mut Vec<RowSums>,
) -> [i128; 4] {
    let water = flow.balanced();
    let populations = flow.fluid().populations();
    let sums = if water.holds_all() {
        populations.totals(room)
    } else {
        populations.totals_within(room, |at| water.holds(at))
    };
    sums.map(|s| sum(communicator, s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::{Document, examples};
    use std::path::Path;

    /// Checks that errors of a balance are reported only above the limits of rounding.
    #[test]
    fn an_error_of_a_balance_beyond_rounding_is_reported() {
        let text = examples::find("poiseuille").unwrap().text;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let said = |mass: f64, momentum: f64| {
            let mut guards = Guards::new(&plan);
            guards.mass_error = Some(mass);
            guards.momentum_error = Some(momentum);
            guards.warnings(&plan)
        };
        assert_eq!(said(1e-7, 1e-7), Vec::<String>::new());
        let momentum = said(0.0, 2e-6);
        assert_eq!(momentum.len(), 1);
        assert!(momentum[0].contains("the momentum balance of a step has an error of 2.0e-6"));
        assert!(said(2e-6, 0.0)[0].contains("the mass balance"));
        assert_eq!(said(f64::NAN, f64::NAN).len(), 2);
    }
}
