//! Darcy seepage with drag on grains.
//!
//! A coupling computes the porosity and the mean diameter of the cells from the grains, then the permeability, the pressure,
//! and the load of every grain. The load stays constant over the solid steps of the interval T:
//!
//! ```text
//! F = sum over cells of w [ -V grad p + b (q + eps v_s - eps v) ]      w: the part of the grain in the cell, b: of the drag law
//! ```
//!
//! `q` is the Darcy flux past the grains of the cell, whose mean velocity is `v_s`, and `eps v` the superficial velocity of the grain; with
//! the pressure of the whole water `-V grad p` contains buoyancy. Without `transient_porosity` `v_s = 0`: the bed counts as at rest.
//! As printed in the fissure paper, both velocities are interstitial: `b (u - v)` with `u = -K/(mu eps) grad p`, the bed is at rest, and
//! there is no buoyancy.
//!
//! **Semi-implicit drag.** Where a grain responds faster than the interval, `s = T b eps/m > 1`, the drag is in part that at the velocity
//! at the end of the interval:
//!
//! ```text
//! F = F_0 - b eps v*,    v* = v + theta [v - v_last + T/m (F - F_last)],    theta = max(1 - 1/s, theta of the bed below)
//! ```
//!
//! with the force `F_0` on a grain at rest. The gain of velocity over the last interval, `v - v_last`, stands for the mean of all forces in
//! it. Without contacts and with `theta = 1` this is an implicit Euler step. A grain that its contacts hold at rest bears `F_0`. A grain that
//! meets the water for the first time counts as at rest if contacts hold it, and as falling freely otherwise.
//!
//! **Moving beds.** The grains of a cell together displace water, whose pressure acts back on all of them. Over the interval T a gradient
//! `G = grad phi` changes their mean velocity by `-T L G`, with `L = <V/m>/(1 - eps)`. Where `T L` exceeds `K/mu`, an explicit coupling
//! would overshoot. The mean velocity is then that at the end of the interval in part:
//!
//! ```text
//! v_s = <v> + theta [<v - v_last> - T L (G - G_last)],     theta = max(0, 1 - K/(mu T L))
//! ```
//!
//! A bed at rest has `v_s = 0`.
//!
//! **Dilute cells.** The inertia of the water, which seepage neglects, keeps it from moving with a few grains. `v_s` is therefore multiplied
//! by a factor that falls from 1 at a porosity of 0.95 to 0 at 0.98. A single grain sinks through water at rest.
//!
//! **Inertial losses.** The permeability of such a resistance decreases with the gradient. Solution and permeability are iterated until
//! they converge. Each iteration raises the ratio of a cell's permeability to its converged value to a power of magnitude at most one half.
//!
//! **Zones** ([`crate::darcy::zones`]) replace the permeability of cells, and the porosity of the law of resistance. The porosity of the
//! grains remains that of the balances. Most zones hold only where there are grains: a cell with a porosity of 0.95 or more has the
//! permeability of open water. A cell that a boundary of zones cuts has a permeability along each axis. The reaction of the resistance
//! then acts along each axis by that axis.
//!
//! **Closure of momentum**: the forces on grains at rest should add up to `-integral of grad p - weight of the water`, both over the
//! volume inside the walls of the cells that hold grains; in other cells the resistance acts on no grain. The difference, relative
//! to the larger of the two terms, is reported at every coupling. Cells that a zone fills without grains are left out. It is of the order of rounding with the reaction of the resistance
//! ([`crate::darcy::drag::reaction`]) and explicit drag, and the mismatch between drag law and resistance otherwise.

mod motion;
mod parts;

use super::Flow;
use crate::darcy::drag::{Bed, Cell, Drag, Grain, Law};
use crate::darcy::permeability::BedOfCells;
use crate::darcy::porosity::measure;
use crate::darcy::pressure::{self, NUMBERS};
use crate::darcy::zones::Conduct;
use crate::darcy::{
    DragLaw, Equations, Grid, Liquid, Openness, Permeability, Pores, Pressure, Report, Zones,
};
use crate::dem::particles::{Kind, Load, Particles, View};
use crate::dem::space::{Components, Space};
use crate::error::Error;
use crate::thread_pool;
use decomposition::{Communicator, Domain, ExactSum};
use motion::{Motion, Start, add, moving, start};
use parts::Parts;
use std::marker::PhantomData;
use std::sync::Arc;

/// Relative change of the permeability in a round at which a permeability that depends on the gradient is settled, at least. A larger
/// tolerance of the pressure takes its place.
const SETTLED: f64 = 1e-11;
/// Rounds after which a run ends: the error halves in each or better.
const MOST_ROUNDS: u32 = 200;

/// Closure of momentum from which a run warns.
const OPEN: f64 = 0.1;
/// Reynolds number up to which Darcy's law holds.
const DARCY: f64 = 1.0;
/// Porosity below which a cell counts as filled with grains.
const FILLED: f64 = 0.95;
/// Choices of the coupling.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The water.
    pub liquid: Liquid,
    /// Porosity and diameter to permeability.
    pub permeability: Permeability,
    /// The drag law.
    pub drag: DragLaw,
    /// Form of the equations.
    pub equations: Equations,
    /// Whether moving grains displace water: the bed moves, or the change of porosity is a source in the equations as printed.
    pub transient: bool,
    /// Drag at the end of the interval where a grain is faster than it.
    pub semi_implicit: bool,
    /// Gravity on the grains \[m/s2\].
    pub gravity: [f64; 3],
    /// Time between two couplings \[s\].
    pub interval: f64,
}

/// Balance of a coupling.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Sum of the forces on grains \[N\].
    pub on_grains: [f64; 3],
    /// -integral of grad p over the cells that hold grains, inside the walls \[N\].
    pub pressure: [f64; 3],
    /// Weight of the water in those cells \[N\].
    pub weight: [f64; 3],
    /// Size of what is missing over the largest of the three.
    pub closure: f64,
    /// The largest Reynolds number `rho q d/mu` of the flux past the grains of a cell.
    pub reynolds: f64,
    /// Grains whose drag was taken at the end of the interval.
    pub implicit: u64,
}

/// The extremes of all couplings of a run, a restart aside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extremes {
    /// The largest closure of momentum.
    pub closure: f64,
    /// The largest Reynolds number of the pores.
    pub reynolds: f64,
    /// The largest speed of a grain of this rank \[m/s\].
    pub speed: f64,
    /// The same at the first coupling \[m/s\].
    pub first_speed: f64,
    /// The largest difference of the reduced pressure \[Pa\].
    pub pressure: f64,
}

/// Seepage with grains in it.
pub struct Seepage<Sp: Space> {
    settings: Settings,
    openness: Openness,
    pores: Pores,
    pressure: Pressure,
    communicator: Communicator,
    permeability: Vec<f64>,
    limited: Vec<f64>,
    source: Vec<f64>,
    before: Vec<f64>,
    /// Gradient of the reduced pressure in each cell that its permeability is for \[Pa/m\].
    gradient: Vec<[f64; 3]>,
    /// Its size.
    steepness: Vec<f64>,
    /// Grains of each cell as a bed that moves; none where it counts as at rest.
    motion: Option<Box<Motion>>,
    /// There is a porosity from the coupling before.
    has_before: bool,
    /// Permeabilities by region.
    zones: Option<(Arc<Zones>, Conduct)>,
    report: Report,
    balance: Balance,
    extremes: Option<Extremes>,
    parts: Parts,
    /// The water in each cell, where the cell is open.
    cells: Vec<Option<Cell>>,
    /// What each thread finds: kept so that a coupling allocates nothing.
    found: Vec<Found>,
    space: PhantomData<Sp>,
}

/// What a thread finds of its grains.
#[derive(Default)]
struct Found {
    /// Open cells that hold a part of the present grain, each with the part.
    cells: Vec<(Cell, f64)>,
    /// Force on each grain, and whether its drag is that at the end of the interval.
    loads: Vec<([f64; 3], bool)>,
}

/// What the load of a grain depends on besides the grain.
struct Water<'a> {
    settings: &'a Settings,
    cells: &'a [Option<Cell>],
    /// How much of a change of velocity until the next coupling counts in each cell ([`Motion::part`]); none where the bed counts as at rest.
    moves: Option<&'a [f64]>,
}

impl<Sp: Space> Seepage<Sp> {
    /// Couples a pressure with grains.
    #[must_use]
    #[inline(never)]
    pub fn new(
        openness: Openness,
        pores: Pores,
        pressure: Pressure,
        settings: Settings,
        communicator: &Communicator,
    ) -> Self {
        let n = openness.grid.count();
        let moves = settings.transient && settings.equations == Equations::Corrected;
        log::info!("coupling of grains and seepage by drag, {n} cells of pores: {settings:?}");
        Self {
            settings,
            openness,
            pores,
            pressure,
            communicator: communicator.clone(),
            permeability: vec![0.0; n],
            limited: vec![0.0; n],
            source: vec![0.0; n],
            before: vec![0.0; n],
            gradient: vec![[0.0; 3]; n],
            steepness: vec![0.0; n],
            motion: moves.then(|| Box::new(Motion::new(n))),
            has_before: false,
            zones: None,
            report: Report::default(),
            balance: Balance::default(),
            extremes: None,
            parts: Parts::default(),
            cells: Vec::new(),
            found: Vec::new(),
            space: PhantomData,
        }
    }

    /// The same with permeabilities and porosities by region.
    #[must_use]
    pub fn with_zones(mut self, zones: Arc<Zones>) -> Self {
        let room = Conduct::new(&zones, self.grid().count());
        self.zones = Some((zones, room));
        self
    }

    /// The grid of the water.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.openness.grid
    }

    /// The pressure.
    #[must_use]
    pub fn pressure(&self) -> &Pressure {
        &self.pressure
    }

    /// The pressure, to change what is imposed.
    pub fn pressure_mut(&mut self) -> &mut Pressure {
        &mut self.pressure
    }

    /// Whether a coupling has found the pressure.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.has_before
    }

    /// The pores.
    #[must_use]
    pub fn pores(&self) -> &Pores {
        &self.pores
    }

    /// Mean porosity of the cells that grains fill: those below the cap of the permeability, and at most 0.95.
    #[must_use]
    pub fn mean_porosity(&self) -> f64 {
        let most = self.settings.permeability.porosity_cap.min(FILLED);
        let full = self.pores.porosity().iter();
        let full = full.filter(|e| **e > 0.0 && **e < most);
        let (sum, cells) = full.fold((0.0, 0.0), |(sum, cells), e| (sum + e, cells + 1.0));
        if cells > 0.0 { sum / cells } else { 1.0 }
    }

    /// What the last solution cost.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The balance of momentum at the last coupling.
    #[must_use]
    pub fn balance(&self) -> &Balance {
        &self.balance
    }

    /// The extremes of the couplings so far, with the speeds of all ranks. Collective.
    #[must_use]
    pub fn extremes(&self) -> Extremes {
        let mine = self.extremes.unwrap_or_default();
        let most = |speed: f64| self.communicator.all_reduce_max_f64(speed);
        Extremes {
            speed: most(mine.speed),
            first_speed: most(mine.first_speed),
            ..mine
        }
    }

    /// Takes note of a coupling at which the fastest grain of this rank had this speed \[m/s\].
    fn keep_extremes(&mut self, speed: f64) {
        let before = self.extremes.unwrap_or(Extremes {
            first_speed: speed,
            ..Extremes::default()
        });
        self.extremes = Some(Extremes {
            closure: before.closure.max(self.balance.closure),
            reynolds: before.reynolds.max(self.balance.reynolds),
            speed: before.speed.max(speed),
            first_speed: before.first_speed,
            pressure: before.pressure.max(self.pressure.largest_difference()),
        });
    }

    /// What a run needs to go on: the reduced pressure of every cell, then its porosity at the last coupling, then the three components
    /// of the gradient that its permeability was for; the same on every rank. Nothing before the first coupling.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        if !self.has_before {
            return Vec::new();
        }
        let cells = 0..self.grid().count();
        let pressures = cells.map(|c| self.pressure.reduced(c));
        let rest = self.before.iter().chain(self.gradient.as_flattened());
        pressures.chain(rest.copied()).collect()
    }

    /// Takes over what [`Self::state`] gave.
    ///
    /// # Errors
    /// If it is for another grid.
    #[inline(never)]
    pub fn restore(&mut self, state: &[f64]) -> Result<(), Error> {
        let n = self.grid().count();
        if state.is_empty() {
            return Ok(());
        }
        if state.len() != NUMBERS * n {
            return Err(Error::Io(format!(
                "the checkpoint holds {} numbers of the seepage, not {}",
                state.len(),
                NUMBERS * n
            )));
        }
        self.pressure.restore(&state[..n]).map_err(failed)?;
        self.before.copy_from_slice(&state[n..2 * n]);
        let gradient = self.gradient.as_flattened_mut();
        gradient.copy_from_slice(&state[2 * n..]);
        self.steepen();
        self.has_before = true;
        Ok(())
    }

    /// Sizes of the gradients.
    fn steepen(&mut self) {
        for (steepness, gradient) in self.steepness.iter_mut().zip(&self.gradient) {
            *steepness = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        }
    }

    /// Velocity of the grains of a cell \[m/s\]; 0 where the bed counts as at rest.
    fn bed_velocity(&self, cell: usize) -> [f64; 3] {
        self.motion.as_ref().map_or([0.0; 3], |motion| {
            motion.under(cell, self.pressure.reduced_gradient(cell))
        })
    }

    /// Superficial velocity of the water in a cell \[m/s\]; interstitial in the equations as printed.
    #[must_use]
    pub fn water_velocity(&self, cell: usize) -> [f64; 3] {
        let (past, bed) = (self.pressure.flux(cell), self.bed_velocity(cell));
        let porosity = self.limited[cell];
        std::array::from_fn(|a| past[a] + porosity * bed[a])
    }

    fn cell(&self, cell: usize) -> Option<Cell> {
        if self.openness.blocked(cell) {
            return None;
        }
        let porosity = self.limited[cell];
        let liquid = self.settings.liquid;
        let mut flux = self.water_velocity(cell);
        if self.zones.is_some() && self.settings.drag.model().balances() {
            // The reaction to what the gradient drives does not know how easily an axis conducts.
            let (past, ratios) = (self.pressure.flux(cell), self.pressure.direction(cell));
            for a in 0..3 {
                flux[a] += past[a] * (1.0 / ratios[a] - 1.0);
            }
        }
        Some(Cell {
            gradient: self.pressure.gradient(cell),
            flux,
            bed: Bed {
                density: liquid.density,
                viscosity: liquid.viscosity,
                porosity,
                solid: 1.0 - self.pores.porosity()[cell],
                permeability: self.permeability[cell],
            },
            measure: match self.settings.equations {
                Equations::Corrected => porosity,
                Equations::Paper => 1.0,
            },
        })
    }

    /// Porosity, permeability and pressure for the grains where they are.
    fn seep(&mut self, particles: &View<'_, Sp>) -> Result<(), Error> {
        self.parts.find(&self.pores, particles);
        self.fill(particles)?;
        let permeability = self.settings.permeability;
        let porosity = self.pores.porosity();
        for cell in 0..porosity.len() {
            self.limited[cell] = permeability.limited(porosity[cell]);
            self.source[cell] = (self.before[cell] - porosity[cell]) * self.openness.inside[cell]
                / self.settings.interval;
        }
        if let Some((zones, room)) = &mut self.zones {
            room.replace_porosity(zones, &mut self.limited, |cell| porosity[cell] < FILLED);
        }
        let mut iterations = 0;
        if self.motion.is_some() && !self.has_before {
            // Grains that contacts hold are at rest under this gradient.
            iterations += self.converge(false)?;
            self.fill(particles)?;
        } else if let Some(motion) = &mut self.motion {
            // A restarted run has the gradient of its last coupling from here as well.
            motion.last.copy_from_slice(&self.gradient);
        }
        self.report.iterations = iterations + self.converge(true)?;
        self.before.copy_from_slice(self.pores.porosity());
        self.has_before = true;
        Ok(())
    }

    /// Porosity, diameters and motion of the grains of each cell.
    fn fill(&mut self, particles: &View<'_, Sp>) -> Result<(), Error> {
        self.pores.clear();
        let held = self.held(particles);
        if let Some(motion) = &mut self.motion {
            let mut largest = [0.0_f64; 2];
            for k in 0..particles.owned {
                let mut moving = moving(&self.settings, particles, k);
                add(&mut moving.gain, held.get(k));
                let size = moving.size();
                largest = std::array::from_fn(|n| largest[n].max(size[n]));
            }
            let means = &mut motion.means;
            means.clear(largest, &self.communicator).map_err(failed)?;
        }
        let cell = self.openness.grid.volume();
        for (k, parts) in self.parts.each() {
            let radius = particles.body[k].radius;
            let centre = components(&particles.location(k));
            self.pores.add(centre, radius, parts);
            if let Some(motion) = &mut self.motion {
                let volume = measure(Sp::DIMENSION, radius) / cell;
                let mut moving = moving(&self.settings, particles, k);
                add(&mut moving.gain, held.get(k));
                motion.means.add(parts, volume, &moving);
            }
        }
        self.pores
            .finish(&self.openness, &self.communicator)
            .map_err(failed)?;
        if let Some(motion) = &mut self.motion {
            motion.means.finish(&self.communicator);
        }
        Ok(())
    }

    /// Pressure and permeability, in turn until both stay; how many iterations that took. `moves`: whether the bed may move.
    fn converge(&mut self, moves: bool) -> Result<u32, Error> {
        let permeability = self.settings.permeability;
        let (law, liquid) = (permeability.law.model(), self.settings.liquid);
        let (porosity, diameter) = (self.pores.porosity(), self.pores.diameter());
        let source = self.settings.transient && self.motion.is_none() && self.has_before;
        let source = source.then_some(&self.source[..]);
        let settled = SETTLED.max(self.pressure.tolerance());
        let of_zones = |(zones, _): &(Arc<Zones>, Conduct)| zones.depend_on_the_gradient();
        let depends = law.depends_on_the_gradient() || self.zones.as_ref().is_some_and(of_zones);
        let mut iterations = 0;
        for round in 1.. {
            let bed = BedOfCells {
                porosity: &self.limited,
                diameter,
                gradient: &self.steepness,
            };
            law.fill(bed, liquid, &mut self.permeability);
            if let Some((zones, room)) = &mut self.zones {
                room.replace(zones, law, bed, liquid, &mut self.permeability);
                if let Some(ratios) = room.ratios() {
                    self.pressure.set_directions(ratios);
                }
            }
            let motion = self.motion.as_deref_mut().filter(|_| moves);
            let moving = motion.map(|motion| {
                let interval = self.settings.interval;
                motion.respond(&self.permeability, porosity, liquid.viscosity, interval);
                pressure::Bed {
                    velocity: &motion.velocity,
                    response: &motion.response,
                }
            });
            self.report = self
                .pressure
                .solve(&self.permeability, &self.limited, source, moving)
                .map_err(failed)?;
            iterations += self.report.iterations;
            for cell in 0..porosity.len() {
                self.gradient[cell] = self.pressure.reduced_gradient(cell);
            }
            for (steepness, gradient) in self.steepness.iter_mut().zip(&self.gradient) {
                *steepness = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
            }
            if !depends {
                break;
            }
            let bed = BedOfCells {
                porosity: &self.limited,
                diameter,
                gradient: &self.steepness,
            };
            let change = match &mut self.zones {
                Some((zones, room)) => room.change(zones, law, bed, liquid, &self.permeability),
                None => law.change(bed, liquid, &self.permeability),
            };
            if change <= settled {
                break;
            }
            if round >= MOST_ROUNDS || change.is_nan() {
                return Err(Error::Numerical(format!(
                    "the permeability still changes by {change:e} after {round} solutions of the pressure"
                )));
            }
        }
        Ok(iterations)
    }

    /// What a reader of the results should know of the couplings.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        let (balance, settings) = (&self.extremes.unwrap_or_default(), &self.settings);
        if balance.closure > OPEN {
            all.push(format!(
                "the forces of the water on the grains differ from the loss of pressure by {:.0} % of it (closure of momentum {:.2}); \
                 above {OPEN} the drag law and the resistance do not belong together",
                100.0 * balance.closure,
                balance.closure
            ));
        }
        if balance.reynolds > DARCY && !settings.permeability.law.model().depends_on_the_gradient()
        {
            all.push(format!(
                "the water seeps at a Reynolds number of up to {:.1}: from about {DARCY} on there are inertial losses, which the law of \
                 resistance leaves out",
                balance.reynolds
            ));
        }
        all
    }

    /// Whether a body that the case does not resolve bears the pressure of a cell.
    fn is_body(&self, cell: usize) -> bool {
        let zones = self.zones.as_ref();
        zones.is_some_and(|(_, room)| room.is_body(cell))
    }

    fn close(&mut self, mut on_grains: [ExactSum; 3], implicit: u64) {
        let mut balance = Balance {
            implicit: self.communicator.all_reduce_sum_u64(implicit),
            ..Balance::default()
        };
        let mut largest = 0.0_f64;
        let mut missing = 0.0;
        let liquid = self.settings.liquid;
        for cell in 0..self.grid().count() {
            if self.pores.solid_volume(cell) > 0.0 && !self.is_body(cell) {
                let speed = self
                    .pressure
                    .flux(cell)
                    .iter()
                    .map(|q| q * q)
                    .sum::<f64>()
                    .sqrt();
                let number =
                    liquid.density * speed * self.pores.diameter()[cell] / liquid.viscosity;
                balance.reynolds = balance.reynolds.max(number);
            }
        }
        for a in 0..3 {
            on_grains[a].all_reduce(&self.communicator);
            let (mut pressure, mut weight) = (ExactSum::new(), ExactSum::new());
            for cell in 0..self.grid().count() {
                if self.pores.solid_volume(cell) <= 0.0 || self.is_body(cell) {
                    continue;
                }
                let volume = self.openness.volume(cell);
                pressure.add(-volume * self.pressure.gradient(cell)[a]);
                weight.add(volume * self.pores.porosity()[cell] * self.pressure.weight()[a]);
            }
            balance.on_grains[a] = on_grains[a].value();
            balance.pressure[a] = pressure.value();
            balance.weight[a] = weight.value();
            missing += (balance.on_grains[a] - balance.pressure[a] - balance.weight[a]).powi(2);
            for term in [balance.on_grains[a], balance.pressure[a], balance.weight[a]] {
                largest = largest.max(term.abs());
            }
        }
        balance.closure = if largest > 0.0 {
            missing.sqrt() / largest
        } else {
            0.0
        };
        self.balance = balance;
    }
}

impl Water<'_> {
    /// Load of one grain, and whether its drag is that at the end of the interval.
    fn load<Sp: Space>(
        &self,
        law: &dyn Law,
        particles: &View<'_, Sp>,
        (k, parts): (usize, &[(usize, f64)]),
        room: &mut Vec<(Cell, f64)>,
    ) -> ([f64; 3], bool) {
        let body = &particles.body[k];
        let grain = Grain::new(Sp::DIMENSION, body.radius);
        let velocity: [f64; 3] = components(&particles.motion[k].velocity);
        room.clear();
        let open = |&(cell, part): &(usize, f64)| Some((self.cells[cell]?, part));
        room.extend(parts.iter().filter_map(open));
        let mut pressure = [0.0; 3];
        for (here, part) in &*room {
            for a in 0..3 {
                pressure[a] -= part * grain.volume * here.gradient[a];
            }
        }
        let Drag { pull, rate } = law.drag(&grain, velocity, room);
        let share = self.settings.interval * rate / body.mass;
        // Grains go with the bed: what counts of a change of velocity counts for both.
        let bed = self.moves.map_or(0.0, |moves| {
            let parts = parts.iter();
            parts.map(|&(cell, part)| part * moves[cell]).sum()
        });
        let theta = f64::max(bed, 1.0 - 1.0 / share);
        let implicit = self.settings.semi_implicit && body.kind == Kind::Free && theta > 0.0;
        let at_rest: [f64; 3] = std::array::from_fn(|a| pressure[a] + pull[a]);
        if !implicit {
            return (
                std::array::from_fn(|a| at_rest[a] - rate * velocity[a]),
                false,
            );
        }
        let late = theta * share;
        let (last, before) = match start(particles, k) {
            Start::Held => (at_rest, velocity),
            Start::Free => (self.settings.gravity.map(|g| -body.mass * g), velocity),
            Start::Known => (
                components(&particles.fluid[k].force),
                components(&particles.last_velocity[k]),
            ),
        };
        let force = std::array::from_fn(|a| {
            let known = velocity[a] + theta * (velocity[a] - before[a]);
            (at_rest[a] - rate * known + late * last[a]) / (1.0 + late)
        });
        (force, implicit)
    }
}

fn component<V: Components>(vector: &V, axis: usize) -> f64 {
    if axis < V::COUNT {
        vector.get(axis)
    } else {
        0.0
    }
}

fn components<V: Components>(vector: &V) -> [f64; 3] {
    std::array::from_fn(|a| component(vector, a))
}

fn failed(error: crate::darcy::Error) -> Error {
    match error {
        crate::darcy::Error::Messages(text) => Error::Internal(text),
        other => Error::Numerical(other.to_string()),
    }
}

impl<Sp: Space> Flow<Sp> for Seepage<Sp> {
    fn advance(&mut self, particles: &mut Particles<Sp>, _: &Domain) -> Result<(), Error> {
        particles.allocate_fluid_loads();
        if self.motion.is_some() || self.settings.semi_implicit {
            particles.keep_last_velocity();
        }
        let grains = particles.view();
        self.seep(&grains)?;
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        cells.extend((0..self.grid().count()).map(|cell| self.cell(cell)));
        let water = Water {
            settings: &self.settings,
            cells: &cells,
            moves: self.motion.as_ref().map(|motion| &motion.part[..]),
        };
        let shares = &self.parts.shares;
        self.found.resize_with(shares.len(), Found::default);
        thread_pool::each_item(&mut self.found, 1, |thread, found| {
            let (law, share) = (water.settings.drag.model(), &shares[thread]);
            found.loads.clear();
            for k in share.grains() {
                let load = water.load(law, &grains, (k, share.of(k)), &mut found.cells);
                found.loads.push(load);
            }
        });
        self.cells = cells;
        let mut sums: [ExactSum; 3] = std::array::from_fn(|_| ExactSum::new());
        let (mut implicit, mut fastest) = (0, 0.0_f64);
        let loads = self.found.iter().flat_map(|found| &found.loads);
        for ((k, parts), (force, at_the_end)) in self.parts.each().zip(loads) {
            let bodies = parts.iter().filter(|(cell, _)| self.is_body(*cell));
            let counts = 1.0 - bodies.map(|(_, part)| part).sum::<f64>();
            let mut load = Load::<Sp>::default();
            for (a, force) in force.iter().enumerate().take(Sp::DIMENSION) {
                load.force.set(a, *force);
                sums[a].add(counts * force);
            }
            implicit += u64::from(*at_the_end);
            let velocity: [f64; 3] = components(&particles.motion[k].velocity);
            fastest = fastest.max(velocity.iter().map(|v| v * v).sum());
            particles.fluid[k] = load;
            if particles.last_velocity.is_allocated() {
                particles.last_velocity[k] = particles.motion[k].velocity;
            }
        }
        self.close(sums, implicit);
        self.keep_extremes(fastest.sqrt());
        if !self.balance.closure.is_finite() {
            return Err(Error::Numerical(
                "the force of the water on the grains is not finite".into(),
            ));
        }
        Ok(())
    }

    fn update_bodies(&mut self, _: &mut Particles<Sp>, _: &Domain) -> Result<(), Error> {
        Ok(())
    }
}

#[cfg(test)]
mod tests;
