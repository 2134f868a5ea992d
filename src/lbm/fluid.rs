//! One slab of fluid: the fused step with its halo and boundaries.

use super::boundary::{Boundaries, Flux, Frame, Patch};
use super::collision::Collision;
use super::collision::bgk::Bgk;
use super::collision::cumulant::Cumulant;
use super::collision::mrt::{self, Mrt};
use super::collision::second_order::SecondOrder;
use super::collision::trt::{Odd, Trt};
use super::halo::{Halo, wrap};
use super::initial::{self, Field};
use super::kernel::{Pass, Shared, Update, choose};
use super::lanes::{Level, Stored};
use super::lattice::{D2Q9, D3Q19, D3Q27, Lattice, Velocities};
use super::populations::{Extremes, Populations};
use super::saturation::{self, Cover, Covered, Method, Open, Solids};
use super::turbulence::smagorinsky::Smagorinsky;
use super::turbulence::wale::Wale;
use super::turbulence::{self, Eddies, Eddy, Model, Resolved, View};
use crate::thread_pool;
use decomposition::Domain;
use std::ops::Range;

/// Which velocity set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// Two dimensions, nine velocities.
    D2Q9,
    /// Three dimensions, nineteen velocities.
    D3Q19,
    /// Three dimensions, twenty-seven velocities.
    D3Q27,
}

impl Set {
    /// Its velocities.
    #[must_use]
    pub fn velocities(self) -> Velocities {
        match self {
            Self::D2Q9 => Velocities::of::<D2Q9, 9>(),
            Self::D3Q19 => Velocities::of::<D3Q19, 19>(),
            Self::D3Q27 => Velocities::of::<D3Q27, 27>(),
        }
    }
}

/// Which operator, with its rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operator {
    /// Single relaxation time.
    Bgk,
    /// Two relaxation times with the magic parameter Λ.
    Trt {
        /// Λ = (1/ω⁺ - ½)(1/ω⁻ - ½)
        magic: f64,
    },
    /// Multiple relaxation times, on D3Q27 only.
    Mrt(mrt::Rates),
    /// Cumulants, on D3Q27 only.
    Cumulant {
        /// Rate of the trace of the stress.
        bulk: f64,
    },
}

impl Operator {
    /// Relaxation of what is odd, where one time holds for all of it.
    fn odd(&self) -> saturation::Odd {
        match *self {
            Self::Trt { magic } => saturation::Odd::Magic(magic),
            Self::Bgk | Self::Mrt(_) | Self::Cumulant { .. } => saturation::Odd::AsEven,
        }
    }
}

/// Uniform body force per volume in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Force {
    /// No force: the cheaper kernel is used.
    None,
    /// The same force always.
    Constant([f64; 3]),
    /// mean + amplitude · cos(2π step / period + phase)
    Oscillating {
        /// The constant part.
        mean: [f64; 3],
        /// Force density at its peak.
        amplitude: [f64; 3],
        /// Steps per period.
        period: f64,
        /// Phase at step 0, in radians.
        phase: f64,
    },
}

impl Force {
    /// Force at a step.
    #[must_use]
    pub fn at(&self, step: f64) -> [f64; 3] {
        match *self {
            Self::None => [0.0; 3],
            Self::Constant(force) => force,
            Self::Oscillating {
                mean,
                amplitude,
                period,
                phase,
            } => {
                let factor = (std::f64::consts::TAU * step / period + phase).cos();
                std::array::from_fn(|a| mean[a] + amplitude[a] * factor)
            }
        }
    }
}

/// What a slab of fluid is made of, in lattice units.
pub struct Setup {
    /// Velocity set.
    pub set: Set,
    /// Operator.
    pub operator: Operator,
    /// Relaxation time τ of the fluid itself, above ½.
    pub relaxation_time: f64,
    /// Eddy viscosity.
    pub turbulence: Model,
    /// Body force.
    pub force: Force,
    /// Cells of the whole domain along x, y, z.
    pub cells: [usize; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Patches of the faces; faces without one are no-slip walls.
    pub patches: Vec<Patch>,
    /// How solids act on cells that they cover; none where no cell can be covered.
    pub saturation: Option<Method>,
}

/// Operator, force and eddies, chosen once: what a step does to some planes at a time.
trait Step<S: Stored>: Send + Sync {
    /// One pass over the planes by a worker; `force` is that of this step.
    ///
    /// # Safety
    /// No other thread may work on the same planes or be the same worker.
    unsafe fn pass(&self, shared: &Shared<S>, force: [f64; 3], planes: Range<usize>, worker: usize);
}

/// A pass function with the operator as a function of the force.
struct Chosen<S: Stored, C, T, F> {
    pass: Pass<S, C, T>,
    operator: F,
    eddies: T,
    viscosity: f64,
}

impl<S, C, T, F> Step<S> for Chosen<S, C, T, F>
where
    S: Stored,
    C: Collision,
    T: Eddies,
    F: Fn([f64; 3]) -> C + Send + Sync,
{
    unsafe fn pass(
        &self,
        shared: &Shared<S>,
        force: [f64; 3],
        planes: Range<usize>,
        worker: usize,
    ) {
        let update = Update {
            collision: (self.operator)(force),
            eddies: self.eddies,
            viscosity: self.viscosity,
            worker,
        };
        // SAFETY: the planes are the caller's promise; the level was chosen from what the processor offers.
        unsafe { (self.pass)(shared, &update, planes) };
    }
}

/// What a pass is chosen by, beside the types.
#[derive(Clone, Copy)]
struct Choice {
    operator: Operator,
    turbulence: Model,
    relaxation_time: f64,
    forced: bool,
    covered: bool,
    level: Level,
}

impl Choice {
    fn of(setup: &Setup, level: Level) -> Self {
        Self {
            operator: setup.operator,
            turbulence: setup.turbulence,
            relaxation_time: setup.relaxation_time,
            forced: setup.force != Force::None,
            covered: setup.saturation.is_some(),
            level,
        }
    }

    /// The pass on a velocity set.
    fn on<S: Stored>(self, set: Set) -> Box<dyn Step<S>> {
        match set {
            Set::D2Q9 => self.operator::<D2Q9, S, 9>(),
            Set::D3Q19 => self.operator::<D3Q19, S, 19>(),
            Set::D3Q27 => self.operator::<D3Q27, S, 27>(),
        }
    }

    /// A uniform viscosity has a pass for each operator with and without a force. Where cells have viscosities of their own or may be
    /// covered there is one for each family, with the force as a number that may be zero: fewer passes to compile, and what is saved
    /// without a force is little beside the gradients.
    fn operator<L: Lattice<Q>, S: Stored, const Q: usize>(self) -> Box<dyn Step<S>> {
        let eddy = match self.turbulence {
            Model::None => Eddy::None,
            Model::Wale(constant) => Eddy::Wale(Wale { constant }),
            Model::Smagorinsky(constant) => Eddy::Smagorinsky(Smagorinsky { constant }),
        };
        if self.covered {
            self.general::<L, Covered, S, Q>(eddy)
        } else if eddy.present() {
            self.eddies::<L, S, Q>(eddy)
        } else {
            self.plain::<L, S, Q>()
        }
    }

    /// One viscosity, no covered cells.
    fn plain<L: Lattice<Q>, S: Stored, const Q: usize>(self) -> Box<dyn Step<S>> {
        let omega = 1.0 / self.relaxation_time;
        match (self.operator, self.forced) {
            (Operator::Bgk, false) => self
                .boxed::<L, _, _, Open, S, Q>(move |force| Bgk::<false> { omega, force }, Resolved),
            (Operator::Bgk, true) => self
                .boxed::<L, _, _, Open, S, Q>(move |force| Bgk::<true> { omega, force }, Resolved),
            (Operator::Trt { magic }, false) => {
                let odd = Odd::Magic(magic);
                let trt = move |force| Trt::<false> { omega, odd, force };
                self.boxed::<L, _, _, Open, S, Q>(trt, Resolved)
            }
            (Operator::Trt { magic }, true) => {
                let odd = Odd::Magic(magic);
                let trt = move |force| Trt::<true> { omega, odd, force };
                self.boxed::<L, _, _, Open, S, Q>(trt, Resolved)
            }
            // The moments are those of D3Q27, whatever set was asked for.
            (Operator::Mrt(rates), false) if rates.second_order() => {
                let bulk = rates.bulk;
                let mrt = move |force| SecondOrder::<false> { omega, bulk, force };
                self.boxed::<D3Q27, _, _, Open, S, 27>(mrt, Resolved)
            }
            (Operator::Mrt(rates), true) if rates.second_order() => {
                let bulk = rates.bulk;
                let mrt = move |force| SecondOrder::<true> { omega, bulk, force };
                self.boxed::<D3Q27, _, _, Open, S, 27>(mrt, Resolved)
            }
            (Operator::Mrt(rates), false) => {
                let mrt = move |force| Mrt::<false> {
                    omega,
                    rates,
                    force,
                };
                self.boxed::<D3Q27, _, _, Open, S, 27>(mrt, Resolved)
            }
            (Operator::Mrt(rates), true) => {
                let mrt = move |force| Mrt::<true> {
                    omega,
                    rates,
                    force,
                };
                self.boxed::<D3Q27, _, _, Open, S, 27>(mrt, Resolved)
            }
            (Operator::Cumulant { bulk }, _) => {
                let cumulant = move |force| Cumulant::<true> { omega, bulk, force };
                self.boxed::<D3Q27, _, _, Open, S, 27>(cumulant, Resolved)
            }
        }
    }

    /// Viscosities of the cells' own, no covered cells.
    fn eddies<L: Lattice<Q>, S: Stored, const Q: usize>(self, eddy: Eddy) -> Box<dyn Step<S>> {
        match self.operator {
            Operator::Mrt(rates) if rates.second_order() => {
                let (omega, bulk) = (1.0 / self.relaxation_time, rates.bulk);
                let mrt = move |force| SecondOrder::<true> { omega, bulk, force };
                self.boxed::<D3Q27, _, _, Open, S, 27>(mrt, eddy)
            }
            _ => self.general::<L, Open, S, Q>(eddy),
        }
    }

    /// Viscosities of the cells' own, covered cells.
    fn general<L: Lattice<Q>, P: Solids, S: Stored, const Q: usize>(
        self,
        eddy: Eddy,
    ) -> Box<dyn Step<S>> {
        let omega = 1.0 / self.relaxation_time;
        match self.operator {
            Operator::Bgk => {
                let odd = Odd::AsEven;
                let bgk = move |force| Trt::<true> { omega, odd, force };
                self.boxed::<L, _, _, P, S, Q>(bgk, eddy)
            }
            Operator::Trt { magic } => {
                let odd = Odd::Magic(magic);
                let trt = move |force| Trt::<true> { omega, odd, force };
                self.boxed::<L, _, _, P, S, Q>(trt, eddy)
            }
            Operator::Mrt(rates) => {
                let mrt = move |force| Mrt::<true> {
                    omega,
                    rates,
                    force,
                };
                self.boxed::<D3Q27, _, _, P, S, 27>(mrt, eddy)
            }
            Operator::Cumulant { bulk } => {
                let cumulant = move |force| Cumulant::<true> { omega, bulk, force };
                self.boxed::<D3Q27, _, _, P, S, 27>(cumulant, eddy)
            }
        }
    }

    fn boxed<L, C, T, P, S, const Q: usize>(
        self,
        operator: impl Fn([f64; 3]) -> C + Send + Sync + 'static,
        eddies: T,
    ) -> Box<dyn Step<S>>
    where
        L: Lattice<Q>,
        C: Collision + 'static,
        T: Eddies,
        P: Solids,
        S: Stored,
    {
        Box::new(Chosen {
            pass: choose::<L, C, T, P, S, Q>(self.level),
            operator,
            eddies,
            viscosity: (self.relaxation_time - 0.5) / 3.0,
        })
    }
}

/// The planes of worker t.
fn share(planes: &Range<usize>, threads: usize, t: usize) -> Range<usize> {
    let begin = |t: usize| planes.start + planes.len() * t / threads;
    begin(t)..begin(t + 1)
}

/// The planes of a share that have both neighbours in it.
fn inner(share: &Range<usize>) -> Range<usize> {
    let first = share.start + 1;
    first..(share.end - 1).max(first)
}

/// One slab of fluid.
pub struct Fluid<S: Stored> {
    populations: Populations<S>,
    boundaries: Boundaries,
    halo: Halo,
    turbulence: Model,
    /// Velocities for the eddy viscosity; none without one.
    field: Option<turbulence::Field>,
    /// Where solids are, if cells can be covered.
    cover: Option<Cover>,
    describe: fn(&mut Populations<S>, View, saturation::View) -> Shared<S>,
    pass: Box<dyn Step<S>>,
    relaxation_time: f64,
    force: Force,
    cells: [usize; 3],
    start: [usize; 3],
    periodic: [bool; 3],
    periodic_within: [bool; 3],
    threads: usize,
    step: u64,
}

impl<S: Stored> Fluid<S> {
    /// Fluid at rest in the slab of this rank.
    ///
    /// # Errors
    /// When the memory cannot be had.
    pub fn new(setup: Setup, domain: &Domain) -> Result<Self, String> {
        let split = domain.axis().index();
        let planes = domain.range();
        let mut cells = setup.cells;
        cells[split] = planes.len();
        let mut start = [0; 3];
        start[split] = planes.start;
        let level = Level::best();
        let velocities = setup.set.velocities();
        let pass = Choice::of(&setup, level).on(setup.set);
        let describe = match setup.set {
            Set::D2Q9 => Shared::new::<9>,
            Set::D3Q19 => Shared::new::<19>,
            Set::D3Q27 => Shared::new::<27>,
        };
        let populations = Populations::new(velocities, cells, split)?;
        let frame = Frame {
            cells: setup.cells,
            start,
            periodic: setup.periodic,
        };
        let field = match setup.turbulence {
            Model::None => None,
            _ => Some(turbulence::Field::new(
                &populations,
                &frame,
                &setup.patches,
                domain,
            )?),
        };
        let threads = thread_pool::threads();
        let tau = setup.relaxation_time;
        let boundaries = Boundaries::new(
            &populations,
            &frame,
            setup.patches,
            setup.saturation.is_some(),
        );
        let cover = setup.saturation.map(|method| {
            let odd = setup.operator.odd();
            let mut cover = Cover::new(&populations, method, tau, odd, threads);
            cover.wall_off(boundaries.behind_walls_at_rest(&populations));
            cover
        });
        let halo = Halo::new(&populations, domain)?;
        let mut periodic_within = setup.periodic;
        periodic_within[split] = false;
        log::info!(
            "rank {}: lattice {:?} of {} cells, {} numbers of {} bytes each; this slab {cells:?}, {} bytes, {threads} threads",
            domain.rank(),
            setup.set,
            setup.cells.iter().product::<usize>(),
            populations.velocities().q(),
            size_of::<S>(),
            cells.iter().product::<usize>() * populations.velocities().q() * size_of::<S>()
        );
        log::debug!(
            "rank {}: operator {:?}, relaxation time {tau}, eddy viscosity {:?}, force {:?}, periodic {:?}, patches {:?}",
            domain.rank(),
            setup.operator,
            setup.turbulence,
            setup.force,
            setup.periodic,
            boundaries.names().collect::<Vec<_>>()
        );
        Ok(Self {
            populations,
            boundaries,
            halo,
            turbulence: setup.turbulence,
            field,
            cover,
            describe,
            pass,
            relaxation_time: setup.relaxation_time,
            force: setup.force,
            cells: setup.cells,
            start,
            periodic: setup.periodic,
            periodic_within,
            threads,
            step: 0,
        })
    }

    /// Sets every cell from a field; the step stays.
    pub fn initialise(&mut self, field: &dyn Field) {
        let half = self.half_force();
        initial::fill(
            &mut self.populations,
            self.start,
            self.relaxation_time,
            half,
            field,
        );
        self.renew_velocities();
    }

    /// Sets a cell to equilibrium.
    pub fn set_equilibrium(&mut self, cell: usize, drho: f64, u: [f64; 3]) {
        let half = self.half_force();
        for i in 0..self.populations.velocities().q() {
            let v = self.populations.velocities();
            let (w, c) = (v.w[i], v.c[i]);
            // The velocity holds half the force: the momentum that came in does not.
            let odd = (0..3).map(|a| f64::from(c[a]) * half[a]).sum::<f64>();
            let g = initial::equilibrium(w, c, drho, u) - 3.0 * w * odd;
            let position = self.populations.incoming(cell, i);
            self.populations.numbers_mut()[position] = S::from_f64(g);
        }
    }

    /// One step: collide and stream every cell, exchange, apply the faces. Afterwards every incoming population of the
    /// slab is in place, but for those at moving bodies, which are the coupling's to give.
    pub fn advance(&mut self) {
        let planes = self.populations.cells()[self.populations.order()[0]];
        if planes == 0 {
            self.step += 1;
            return;
        }
        let force = self.half_force().map(|f| 2.0 * f);
        let half = force.map(|f| 0.5 * f);
        self.boundaries.remember(&self.populations, half);
        // Faces first: their populations travel while the interior is updated.
        let velocity = self.field.as_mut().map_or(View::NONE, |field| field.view());
        let cover = self
            .cover
            .as_mut()
            .map_or(saturation::View::NONE, Cover::view);
        let shared = (self.describe)(&mut self.populations, velocity, cover);
        self.run(&shared, force, 0..1);
        if planes > 1 {
            self.run(&shared, force, planes - 1..planes);
        }
        if let Some(field) = &mut self.field {
            field.swap();
            field.exchange_start();
        }
        self.populations.flip();
        let reversed = self.populations.parity() == super::populations::Parity::Reversed;
        let (within, last) = (self.periodic_within, planes.cast_signed() - 1);
        if reversed {
            wrap(&mut self.populations, within, 0..1);
            wrap(&mut self.populations, within, last..last + 1);
        }
        self.halo.start(&self.populations);
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let time = (self.step + 1) as f64;
        let early = !self.periodic_within.contains(&true) && self.boundaries.walls_stand_alone();
        let interior = 1..planes.max(2) - 1;
        if planes > 2 && early {
            self.run_with_walls(&shared, force, interior.clone(), time);
        } else if planes > 2 {
            self.run(&shared, force, interior.clone());
        }
        self.halo.finish(&mut self.populations);
        if reversed {
            wrap(&mut self.populations, within, 1..last);
        } else {
            // Ghost planes too: beyond a free-slip face they hold populations on their way back.
            wrap(&mut self.populations, within, -1..last + 2);
        }
        self.step += 1;
        let threads = if early { self.workers(&interior) } else { 0 };
        let given = (0..threads).map(|t| inner(&share(&interior, threads, t)));
        self.boundaries
            .apply(&mut self.populations, time, half, given);
        if let Some(cover) = &self.cover {
            let fraction = |cell: usize| cover.fraction(cell);
            self.boundaries
                .close_covered(fraction, &mut self.populations);
        }
        self.complete_velocities();
    }

    fn complete_velocities(&mut self) {
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let time = self.step as f64;
        if let Some(field) = &mut self.field {
            let boundaries = &self.boundaries;
            field.complete(|patch| boundaries.velocity_factor(patch, time));
        }
    }

    /// Sets the velocities from which the next eddy viscosity comes to those of the cells as they are. All ranks together.
    pub fn renew_velocities(&mut self) {
        let planes = self.populations.cells()[self.populations.order()[0]];
        if self.field.is_none() || planes == 0 {
            return;
        }
        let cells: Vec<usize> = self.populations.interior().map(|(_, cell)| cell).collect();
        for cell in cells {
            let (_, u) = self.state(cell);
            if let Some(field) = &mut self.field {
                #[expect(clippy::cast_possible_truncation, reason = "the field is in f32")]
                field.set_velocity(cell, u.map(|x| x as f32));
            }
        }
        self.spread_velocities();
    }

    /// Ghosts of the velocities that were set cell by cell. All ranks together.
    pub fn spread_velocities(&mut self) {
        if let Some(field) = &mut self.field {
            field.exchange_start();
        }
        self.complete_velocities();
    }

    /// The velocities from which the next eddy viscosity comes; none without turbulence.
    #[must_use]
    pub fn velocities(&self) -> Option<&turbulence::Field> {
        self.field.as_ref()
    }

    /// The same, to be set on a restart and inside bodies; then [`Self::spread_velocities`].
    pub fn velocities_mut(&mut self) -> Option<&mut turbulence::Field> {
        self.field.as_mut()
    }

    /// Eddy viscosity of an interior cell in lattice units, as the next collision has it; 0 without turbulence.
    #[must_use]
    pub fn eddy_viscosity(&self, cell: usize) -> f64 {
        let Some(field) = &self.field else { return 0.0 };
        let gradient = field.gradient(cell);
        match self.turbulence {
            Model::None => 0.0,
            Model::Wale(constant) => Wale { constant }.viscosity(&gradient),
            Model::Smagorinsky(constant) => Smagorinsky { constant }.viscosity(&gradient),
        }
    }

    /// How many threads work on some planes.
    fn workers(&self, planes: &Range<usize>) -> usize {
        self.threads.min(planes.len())
    }

    /// Collides and streams some planes, each thread its share.
    fn run(&self, shared: &Shared<S>, force: [f64; 3], planes: Range<usize>) {
        let threads = self.workers(&planes);
        if threads <= 1 {
            // SAFETY: the only worker.
            unsafe { self.pass.pass(shared, force, planes, 0) };
            return;
        }
        thread_pool::each(threads, |t| {
            // SAFETY: the shares of planes are disjoint, and each worker has one.
            unsafe { self.pass.pass(shared, force, share(&planes, threads, t), t) };
        });
    }

    /// As [`Self::run`]; the walls beside the [`inner`] planes of each share are given as soon as the planes round them are done, while their
    /// numbers are in the cache: walking along the walls of a cube of 200³ cells afterwards costs an eighth of the pass.
    fn run_with_walls(&self, shared: &Shared<S>, force: [f64; 3], planes: Range<usize>, time: f64) {
        let threads = self.workers(&planes);
        let parity = self.populations.parity();
        let (pass, boundaries) = (&self.pass, &self.boundaries);
        thread_pool::each(threads, |t| {
            let share = share(&planes, threads, t);
            let walled = inner(&share);
            for plane in share {
                // SAFETY: the shares of planes are disjoint, and each worker has one.
                unsafe { pass.pass(shared, force, plane..plane + 1, t) };
                if walled.contains(&(plane - 1)) {
                    // SAFETY: this worker has the planes on both sides too, and is done with them.
                    unsafe {
                        boundaries.give_walls(plane - 1..plane, time, parity, shared.numbers());
                    }
                }
            }
        });
    }

    /// F/2 at the present step: half of what the next collision adds (trapezoidal rule in time, Guo et al. 2002).
    #[must_use]
    pub fn half_force(&self) -> [f64; 3] {
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let now = self.step as f64;
        self.force.at(now).map(|f| 0.5 * f)
    }

    /// Body force of the last step.
    #[must_use]
    pub fn last_force(&self) -> [f64; 3] {
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let last = self.step.saturating_sub(1) as f64;
        self.force.at(last)
    }

    /// Density deviation and velocity of an interior cell (position from [`Populations::cell`]).
    #[must_use]
    pub fn state(&self, cell: usize) -> (f64, [f64; 3]) {
        let (drho, momentum) = self.populations.moments(cell);
        let half = self.half_force();
        let u = std::array::from_fn(|a| (momentum[a] + half[a]) / (1.0 + drho));
        (drho, u)
    }

    /// The same of a row of `length` cells along the fastest axis from `cell` on, to the bit: density deviation, then the three
    /// velocities.
    pub fn row_states(&self, cell: usize, length: usize, states: &mut [Vec<f64>; 4]) {
        self.populations.row_moments(cell, length, states);
        let half = self.half_force();
        let [drho, velocity @ ..] = states;
        for (u, half) in velocity.iter_mut().zip(half) {
            for (u, drho) in u.iter_mut().zip(&*drho) {
                *u = (*u + half) / (1.0 + drho);
            }
        }
    }

    /// What stands out among a row of `length` cells from `cell` on; `work` is room that is used again.
    pub fn row_extremes(&self, cell: usize, length: usize, work: &mut [Vec<f64>; 4]) -> Extremes {
        let half = self.half_force();
        self.populations.row_extremes(cell, length, half, work)
    }

    /// The same of the interior cells of some planes across z: `density` and `velocity` in the order [z][y][x], `row` for work.
    pub fn band_states(
        &self,
        planes: Range<usize>,
        density: &mut [f64],
        velocity: &mut [[f64; 3]],
        row: &mut [Vec<f64>; 4],
    ) {
        let [nx, ny, _] = self.populations.cells();
        let extent = [0..nx, 0..ny, planes];
        let stride = [1, nx, nx * ny];
        let [a, b, along] = self.populations.order();
        for i in extent[a].clone() {
            for j in extent[b].clone() {
                let mut first = extent.each_ref().map(|cells| cells.start);
                (first[a], first[b]) = (i, j);
                let cell = self.populations.interior_cell(first);
                self.row_states(cell, extent[along].len(), row);
                let [rho, u, v, w] = &*row;
                let mut place: usize = (0..3)
                    .map(|axis| (first[axis] - extent[axis].start) * stride[axis])
                    .sum();
                for ((rho, u), (v, w)) in rho.iter().zip(u).zip(v.iter().zip(w)) {
                    density[place] = *rho;
                    velocity[place] = [*u, *v, *w];
                    place += stride[along];
                }
            }
        }
    }

    /// Deviatoric viscous stress σ_ab = -(1 - ω/2) Σ c_a c_b g^neq of an interior cell, lattice units; with turbulence
    /// that of eddies smaller than a cell too.
    #[must_use]
    pub fn stress(&self, cell: usize) -> [[f64; 3]; 3] {
        let (drho, u) = self.state(cell);
        let velocities = self.populations.velocities();
        let mut stress = [[0.0; 3]; 3];
        let time = self.relaxation_time + 3.0 * self.eddy_viscosity(cell);
        let factor = -(1.0 - 0.5 / time);
        for i in 0..velocities.q() {
            let c = velocities.c[i];
            let g = self.populations.numbers()[self.populations.incoming(cell, i)].to_f64();
            let departure = g - initial::equilibrium(velocities.w[i], c, drho, u);
            for a in 0..3 {
                for b in 0..3 {
                    stress[a][b] += factor * f64::from(c[a]) * f64::from(c[b]) * departure;
                }
            }
        }
        stress
    }

    /// What crossed each patch during the last step, on this rank.
    #[must_use]
    pub fn fluxes(&self) -> Vec<Flux> {
        self.boundaries.fluxes(&self.populations)
    }

    /// As [`Self::fluxes`], into a list that is used again.
    pub fn fluxes_into(&self, fluxes: &mut Vec<Flux>) {
        self.boundaries.fluxes_into(&self.populations, fluxes);
    }

    /// Mass and momentum that left through all faces during the last step, on this rank, in quanta; the momentum is that of those cells
    /// for which `counts` holds (local coordinates), without the pressure at rest.
    pub fn left(&self, counts: impl Fn([usize; 3]) -> bool) -> [i128; 4] {
        let counts = |position| counts(self.interior_coordinates(position));
        self.boundaries.left(&self.populations, counts)
    }

    /// The mass that left each patch during the last step, on this rank, in quanta: through the faces of those cells for which `counts`
    /// holds (local coordinates).
    pub fn mass_through(&self, counts: impl Fn([usize; 3]) -> bool, masses: &mut Vec<i128>) {
        let counts = |position| counts(self.interior_coordinates(position));
        self.boundaries
            .mass_through(&self.populations, counts, masses);
    }

    /// Local coordinates of an interior cell; of a ghost those of the cell inside that it repeats.
    fn interior_coordinates(&self, position: usize) -> [usize; 3] {
        let (at, cells) = (
            self.populations.coordinates(position),
            self.populations.cells(),
        );
        std::array::from_fn(|a| at[a].rem_euclid(cells[a].cast_signed()).cast_unsigned())
    }

    /// The patches by name, in the order of [`Fluid::fluxes`].
    #[must_use]
    pub fn boundaries(&self) -> &Boundaries {
        &self.boundaries
    }

    /// What covers the cells, if anything can.
    #[must_use]
    pub fn cover(&self) -> Option<&Cover> {
        self.cover.as_ref()
    }

    /// What covers the cells, for the coupling.
    pub fn cover_mut(&mut self) -> Option<&mut Cover> {
        self.cover.as_mut()
    }

    /// The lattice array.
    #[must_use]
    pub fn populations(&self) -> &Populations<S> {
        &self.populations
    }

    /// The lattice array, for the coupling and for restarts.
    pub fn populations_mut(&mut self) -> &mut Populations<S> {
        &mut self.populations
    }

    /// Steps done.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Continues from a saved step; the populations must have been set to their own cells.
    pub fn set_steps(&mut self, step: u64) {
        self.step = step;
        self.populations.set_home();
    }

    /// Cells of the whole domain.
    #[must_use]
    pub fn domain_cells(&self) -> [usize; 3] {
        self.cells
    }

    /// First cell of the slab.
    #[must_use]
    pub fn start(&self) -> [usize; 3] {
        self.start
    }

    /// Periodic axes.
    #[must_use]
    pub fn periodic(&self) -> [bool; 3] {
        self.periodic
    }

    /// Relaxation time τ.
    #[must_use]
    pub fn relaxation_time(&self) -> f64 {
        self.relaxation_time
    }
}

#[cfg(test)]
mod tests {
    use super::super::boundary::{Condition, Ramp};
    use super::*;

    const EVERYWHERE: [[f64; 2]; 3] = [[f64::NEG_INFINITY, f64::INFINITY]; 3];

    fn setup(set: Set, operator: Operator, tau: f64, cells: [usize; 3]) -> Setup {
        Setup {
            set,
            operator,
            relaxation_time: tau,
            turbulence: Model::None,
            force: Force::None,
            cells,
            periodic: [true, false, true],
            patches: Vec::new(),
            saturation: None,
        }
    }

    fn serial(axis: usize, setup: Setup) -> Fluid<f64> {
        let axes = [
            decomposition::Axis::X,
            decomposition::Axis::Y,
            decomposition::Axis::Z,
        ];
        let domain = Domain::serial(axes[axis], setup.cells[axis], setup.periodic[axis]);
        Fluid::new(setup, &domain).unwrap()
    }

    fn profile(fluid: &Fluid<f64>, cells: usize) -> Vec<f64> {
        (0..cells)
            .map(|y| {
                fluid
                    .state(fluid.populations().cell([1, y.cast_signed(), 0]))
                    .1[0]
            })
            .collect()
    }

    /// Validation 1.1: with Λ = 3/16 plane Poiseuille flow is exact at any resolution and relaxation time.
    #[test]
    fn poiseuille_by_body_force_is_exact_with_the_magic_parameter() {
        for (set, nz) in [(Set::D2Q9, 1), (Set::D3Q19, 3), (Set::D3Q27, 3)] {
            for tau in [0.6, 1.1, 2.0] {
                let n = 7;
                let mut s = setup(set, Operator::Trt { magic: 3.0 / 16.0 }, tau, [3, n, nz]);
                let g = 1e-6;
                s.force = Force::Constant([g, 0.0, 0.0]);
                let mut fluid = serial(0, s);
                for _ in 0..6000 {
                    fluid.advance();
                }
                let nu = (tau - 0.5) / 3.0;
                for (y, u) in profile(&fluid, n).into_iter().enumerate() {
                    let y = y as f64 + 0.5;
                    let exact = g / (2.0 * nu) * y * (n as f64 - y);
                    assert!(
                        (u - exact).abs() < 1e-11 * exact.max(1e-7) / 1e-7,
                        "{set:?} {tau} {u} {exact}"
                    );
                }
            }
        }
    }

    /// Validation 1.2: Couette flow is exact for any relaxation time.
    #[test]
    fn couette_is_exact() {
        let n = 8;
        let mut s = setup(Set::D2Q9, Operator::Bgk, 0.8, [3, n, 1]);
        s.patches.push(Patch {
            name: "lid".into(),
            axis: 1,
            upper: true,
            range: EVERYWHERE,
            condition: Condition::Velocity(Box::new(|_| [0.01, 0.0, 0.0]), Ramp::constant(1.0)),
        });
        let mut fluid = serial(1, s);
        for _ in 0..5000 {
            fluid.advance();
        }
        for (y, u) in profile(&fluid, n).into_iter().enumerate() {
            assert!((u - 0.01 * (y as f64 + 0.5) / n as f64).abs() < 1e-12);
        }
        // The wall feels mu U / H per cell (mass density one), pushed along the flow.
        let drag = super::super::boundary::from_quanta(fluid.fluxes()[1].force[0]) / 3.0;
        let exact = -0.1 * 0.01 / n as f64;
        let names: Vec<_> = fluid.boundaries().names().map(str::to_owned).collect();
        let lid = names.iter().position(|n| n == "lid").unwrap();
        let floor = names.iter().position(|n| n == "y_min").unwrap();
        let on = |k: usize| super::super::boundary::from_quanta(fluid.fluxes()[k].force[0]) / 3.0;
        assert!(
            (on(lid) - exact).abs() < 1e-14 && (on(floor) + exact).abs() < 1e-14,
            "{drag}"
        );
    }

    /// Whatever axis the rows run along, a band of planes has the states of its cells in the order [z][y][x].
    #[test]
    fn bands_of_planes_have_the_states_of_their_cells() {
        for (axis, cells, along) in [
            (0, [5, 3, 9], 2),
            (0, [5, 9, 3], 1),
            (1, [3, 5, 9], 2),
            (2, [3, 9, 5], 1),
        ] {
            let mut s = setup(Set::D3Q19, Operator::Bgk, 0.7, cells);
            s.force = Force::Constant([1e-5, 2e-5, -1e-5]);
            let mut fluid = serial(axis, s);
            for _ in 0..3 {
                fluid.advance();
            }
            assert_eq!(fluid.populations().order()[2], along, "{cells:?}");
            let [nx, ny, nz] = cells;
            let planes = 1..nz - 1;
            let number = nx * ny * planes.len();
            let (mut density, mut velocity) = (vec![0.0; number], vec![[0.0; 3]; number]);
            fluid.band_states(
                planes.clone(),
                &mut density,
                &mut velocity,
                &mut Default::default(),
            );
            let mut n = 0;
            for z in planes {
                for y in 0..ny {
                    for x in 0..nx {
                        let cell = fluid.populations().interior_cell([x, y, z]);
                        assert_eq!((density[n], velocity[n]), fluid.state(cell), "{cells:?}");
                        n += 1;
                    }
                }
            }
        }
    }

    /// B-15: a force against a wall makes the hydrostatic pressure up to the first cell, with every operator.
    #[test]
    fn hydrostatic_pressure_reaches_the_walls() {
        let n = 8;
        for operator in [
            Operator::Bgk,
            Operator::Trt { magic: 3.0 / 16.0 },
            Operator::Mrt(mrt::Rates::SUGA),
            Operator::Cumulant { bulk: 1.0 },
        ] {
            let mut s = setup(Set::D3Q27, operator, 0.8, [2, n, 2]);
            let g = 1e-5;
            s.force = Force::Constant([2e-6, -g, 0.0]);
            let mut fluid = serial(0, s);
            for _ in 0..3000 {
                fluid.advance();
            }
            // Rows have the state of their cells, the half of the force included.
            let fast = fluid.populations().order()[2];
            let length = fluid.populations().cells()[fast];
            let mut row = Default::default();
            for (_, first) in fluid.populations().rows() {
                fluid.row_states(first, length, &mut row);
                for k in 0..length {
                    let (drho, [u, v, w]) = fluid.state(first + k);
                    assert_eq!([0, 1, 2, 3].map(|n| row[n][k]), [drho, u, v, w]);
                }
            }
            for y in 0..n {
                let cell = fluid.populations().cell([0, y.cast_signed(), 0]);
                let (drho, u) = fluid.state(cell);
                let exact = 3.0 * g * (0.5 * n as f64 - (y as f64 + 0.5));
                assert!(
                    (drho - exact).abs() < 1e-3 * 3.0 * g && u[1].abs() < 1e-9,
                    "{operator:?} {y} {drho} {exact} {u:?}"
                );
            }
        }
    }

    /// B-18: beside walls the derivative of a parabola is exact, beside open faces that of a straight line.
    #[test]
    fn the_gradient_beside_faces() {
        let (cells, nu) = ([4, 8, 3], 0.1);
        let mut s = setup(
            Set::D3Q27,
            Operator::Mrt(mrt::Rates::SUGA),
            0.5 + 3.0 * nu,
            cells,
        );
        s.turbulence = Model::Smagorinsky(0.17);
        s.patches.push(Patch {
            name: "lid".into(),
            axis: 1,
            upper: true,
            range: EVERYWHERE,
            condition: Condition::Velocity(Box::new(|_| [0.02, 0.0, 0.0]), Ramp::constant(1.0)),
        });
        let mut fluid = serial(0, s);
        // 0 at the floor, 0.02 at the lid.
        let slope = |y: f64| 0.02 / 8.0 + 1e-4 * (8.0 - 2.0 * y);
        let profile = |y: f64| 0.02 * y / 8.0 + 1e-4 * y * (8.0 - y);
        fluid.initialise(&|p: [f64; 3]| (0.0, [profile(p[1]), 0.0, 0.0]));
        for y in 0..8 {
            let cell = fluid.populations().cell([1, y, 1]);
            let exact = 0.17 * 0.17 * slope(y as f64 + 0.5).abs();
            let found = fluid.eddy_viscosity(cell);
            assert!((found - exact).abs() < 1e-8, "{y} {found} {exact}");
        }
    }

    fn swirl(p: [f64; 3]) -> (f64, [f64; 3]) {
        let (x, y) = (p[0] * 0.7, p[1] * 0.9);
        (
            1e-3 * (x + y).sin(),
            [0.02 * y.sin(), 0.03 * (x - y).cos(), 0.01 * x.sin()],
        )
    }

    fn every_face(periodic: [bool; 3], set: Set, cells: [usize; 3]) -> Setup {
        let mut s = setup(set, Operator::Trt { magic: 0.25 }, 0.7, cells);
        s.periodic = periodic;
        s.force = Force::Constant([1e-5, -2e-5, 0.0]);
        let patch = |axis, upper, condition| Patch {
            name: format!("{axis}{upper}"),
            axis,
            upper,
            range: EVERYWHERE,
            condition,
        };
        s.patches = vec![
            patch(
                0,
                false,
                Condition::Pressure(Ramp {
                    start: 0.0,
                    end: 1e-3,
                    steps: 5.0,
                }),
            ),
            patch(0, true, Condition::Outflow),
            patch(1, true, Condition::FreeSlip),
            patch(
                2,
                true,
                Condition::Velocity(
                    Box::new(|p| [0.0, 0.01 * p[0] / 9.0, 0.0]),
                    Ramp::constant(1.0),
                ),
            ),
            patch(2, false, Condition::FreeSlip),
        ];
        s
    }

    fn bits(fluid: &Fluid<f64>, cells: [usize; 3]) -> Vec<u64> {
        let mut all = Vec::new();
        for x in 0..cells[0] {
            for y in 0..cells[1] {
                for z in 0..cells[2] {
                    let cell = fluid.populations().cell([x, y, z].map(usize::cast_signed));
                    for i in 0..fluid.populations().velocities().q() {
                        let g =
                            fluid.populations().numbers()[fluid.populations().incoming(cell, i)];
                        all.push(g.to_bits());
                    }
                }
            }
        }
        all
    }

    #[test]
    fn the_split_axis_does_not_change_a_bit() {
        for (set, cells, axes) in [
            (Set::D2Q9, [9, 7, 1], 2),
            (Set::D3Q19, [9, 7, 5], 3),
            (Set::D3Q27, [9, 7, 5], 3),
        ] {
            for periodic in [[false; 3], [false, true, true], [true, true, false]] {
                let mut results = Vec::new();
                for axis in 0..axes {
                    let mut s = every_face(periodic, set, cells);
                    if set == Set::D3Q27 {
                        s.operator = Operator::Mrt(mrt::Rates::SUGA);
                        s.turbulence = Model::Wale(0.5);
                    }
                    let mut fluid = serial(axis, s);
                    fluid.initialise(&swirl);
                    for _ in 0..11 {
                        fluid.advance();
                    }
                    results.push(bits(&fluid, cells));
                }
                for other in &results[1..] {
                    let first = results[0].iter().zip(other).position(|(a, b)| a != b);
                    assert_eq!(first, None, "{set:?} {periodic:?}");
                }
                assert!(results[0].iter().all(|&b| f64::from_bits(b).is_finite()));
            }
        }
    }

    /// Walls of inner planes are given during the pass, those beside the share of another thread after it: with a thread for each plane all
    /// of them.
    #[test]
    fn walls_may_be_given_early_or_late() {
        for (set, cells) in [(Set::D2Q9, [9, 11, 1]), (Set::D3Q27, [9, 11, 13])] {
            let run = |threads: usize| {
                let mut s = setup(set, Operator::Bgk, 0.6, cells);
                s.periodic = [false; 3];
                s.patches = vec![Patch {
                    name: "lid".into(),
                    axis: 0,
                    upper: true,
                    range: EVERYWHERE,
                    condition: Condition::Velocity(
                        Box::new(|p| [0.0, 0.01 * p[1], 0.0]),
                        Ramp {
                            start: 0.0,
                            end: 1.0,
                            steps: 20.0,
                        },
                    ),
                }];
                let mut fluid = serial(1, s);
                fluid.threads = threads;
                fluid.initialise(&swirl);
                for _ in 0..11 {
                    fluid.advance();
                }
                bits(&fluid, cells)
            };
            let late = run(9);
            assert!(late.iter().any(|&b| f64::from_bits(b).abs() > 1e-3));
            for threads in 1..5 {
                assert!(run(threads) == late, "{set:?}, {threads} threads");
            }
        }
    }

    #[test]
    fn every_width_of_lanes_gives_the_same_bits() {
        for set in [Set::D2Q9, Set::D3Q27] {
            for operator in [
                Operator::Bgk,
                Operator::Trt { magic: 0.25 },
                Operator::Mrt(mrt::Rates::SUGA),
                Operator::Cumulant { bulk: 1.0 },
            ] {
                let only_27 = matches!(operator, Operator::Mrt(_) | Operator::Cumulant { .. });
                if set == Set::D2Q9 && only_27 {
                    continue;
                }
                let cells = [9, 13, if set == Set::D2Q9 { 1 } else { 6 }];
                let mut results = Vec::new();
                for level in [Level::Scalar, Level::best()] {
                    let mut s = every_face([false, true, true], set, cells);
                    s.operator = operator;
                    if operator != Operator::Bgk {
                        s.turbulence = Model::Wale(0.5);
                    }
                    let pass = Choice::of(&s, level).on(set);
                    let mut fluid = serial(0, s);
                    fluid.pass = pass;
                    fluid.initialise(&swirl);
                    for _ in 0..9 {
                        fluid.advance();
                    }
                    results.push(bits(&fluid, cells));
                }
                assert!(results[0] == results[1], "{set:?} {operator:?}");
            }
        }
    }

    /// Mass changes by what the faces let through, momentum by that and the body force.
    #[test]
    fn fluxes_close_the_balance_of_mass_and_momentum() {
        for set in [Set::D2Q9, Set::D3Q27] {
            let cells = [9, 7, if set == Set::D2Q9 { 1 } else { 5 }];
            let mut fluid = serial(0, every_face([false; 3], set, cells));
            fluid.initialise(&swirl);
            let totals = |fluid: &Fluid<f64>| {
                let mut sum = [0.0; 4];
                for (_, cell) in fluid.populations().interior() {
                    let (drho, m) = fluid.populations().moments(cell);
                    sum[0] += drho;
                    for a in 0..3 {
                        sum[a + 1] += m[a];
                    }
                }
                sum
            };
            for _ in 0..8 {
                let before = totals(&fluid);
                fluid.advance();
                let after = totals(&fluid);
                let count = (cells[0] * cells[1] * cells[2]) as f64;
                let mut expected = before;
                for (a, f) in [1e-5, -2e-5, 0.0].into_iter().enumerate() {
                    expected[a + 1] += f * count;
                }
                for flux in fluid.fluxes() {
                    expected[0] -= super::super::boundary::from_quanta(flux.mass);
                    for a in 0..3 {
                        expected[a + 1] -= super::super::boundary::from_quanta(flux.force[a]);
                    }
                }
                for k in 0..4 {
                    assert!(
                        (after[k] - expected[k]).abs() < 1e-13,
                        "{k} {after:?} {expected:?}"
                    );
                }
            }
        }
    }
}
