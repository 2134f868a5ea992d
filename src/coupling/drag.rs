//! Darcy seepage with drag on grains.
//!
//! A coupling computes the porosity and the mean diameter of the cells from the grains, then the permeability, the pressure,
//! and the load of every grain. The load stays constant over the solid steps of the interval:
//!
//! ```text
//! F = sum over cells of w [ -V grad p + b (q - eps v) ]      w: the part of the grain in the cell, b: of the drag law
//! ```
//!
//! `q` is the Darcy flux and `eps v` the superficial velocity of the grain. With the total pressure, `-V grad p` contains buoyancy. In the
//! equations of the fissure paper both velocities are interstitial: `b (u - v)` with `u = -K/(mu eps) grad p`, and there is no buoyancy.
//!
//! A drag law is one file below this module and one line of the list in [`law`].
//!
//! **Semi-implicit drag.** Where a grain responds faster than the interval, the drag is that at the velocity `v*` at the end of the
//! interval under all known forces (contacts of the last step, gravity, pressure, drag). An implicit Euler step gives
//!
//! ```text
//! v* = [v + dt/m (F_contact + m g + F_pressure + b q)]/(1 + dt b eps/m)
//! ```
//!
//! A grain that its contacts hold at rest converges to `v* = v = 0` and bears the full drag.
//!
//! **Ergun's resistance**: the permeability decreases with the gradient. Solution and permeability are iterated until they converge.
//! Each iteration raises the ratio of a cell's permeability to its converged value to a power of magnitude at most one half.
//!
//! **Closure of momentum**: the forces on grains at rest should add up to `-integral of grad p - weight of the water`, both over the
//! volume inside the walls of the cells that hold grains; in other cells Darcy's resistance acts on no grain. The difference, relative
//! to the larger of the two terms, is reported at every coupling. It is of the order of rounding with [`kozeny_carman`] and grains at rest, and the
//! mismatch between drag law and permeability otherwise.

pub mod dallavalle;
pub mod di_felice;
pub mod gidaspow;
pub mod kozeny_carman;
pub mod law;

pub use law::{Bed, Cell, Drag, DragLaw, Grain};

use super::Flow;
use crate::darcy::permeability::BedOfCells;
use crate::darcy::{Equations, Grid, Liquid, Openness, Permeability, Pores, Pressure, Report};
use crate::dem::particles::{Kind, Load, Particles};
use crate::dem::space::{Components, Space};
use crate::error::Error;
use decomposition::{Communicator, Domain, ExactSum};
use law::Law;
use std::marker::PhantomData;

/// Relative change of the permeability in a round at which a permeability that depends on the gradient is settled.
const SETTLED: f64 = 1e-11;
/// Rounds after which a run ends: the error halves in each or better.
const MOST_ROUNDS: u32 = 200;

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
    /// Whether the change of porosity is a source of water.
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
    /// Grains whose drag was taken at the end of the interval.
    pub implicit: u64,
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
    /// Size of the gradient of the reduced pressure in each cell that its permeability is for \[Pa/m\].
    gradient: Vec<f64>,
    /// There is a porosity from the coupling before.
    has_before: bool,
    report: Report,
    balance: Balance,
    room: Room,
    space: PhantomData<Sp>,
}

/// Lists for one grain, kept so that a coupling allocates nothing.
#[derive(Default)]
struct Room {
    /// Cells that hold a part of the grain, with the part.
    parts: Vec<(usize, f64)>,
    /// The open ones among them.
    cells: Vec<(Cell, f64)>,
}

impl<Sp: Space> Seepage<Sp> {
    /// Couples a pressure with grains.
    #[must_use]
    pub fn new(
        openness: Openness,
        pores: Pores,
        pressure: Pressure,
        settings: Settings,
        communicator: &Communicator,
    ) -> Self {
        let n = openness.grid.count();
        log::info!("coupling of grains and seepage by drag, {n} seepage cells: {settings:?}");
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
            gradient: vec![0.0; n],
            has_before: false,
            report: Report::default(),
            balance: Balance::default(),
            room: Room::default(),
            space: PhantomData,
        }
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

    /// The pores.
    #[must_use]
    pub fn pores(&self) -> &Pores {
        &self.pores
    }

    /// Mean porosity of the cells that grains fill: those below the cap of the permeability.
    #[must_use]
    pub fn mean_porosity(&self) -> f64 {
        let full = self.pores.porosity().iter();
        let full = full.filter(|e| **e > 0.0 && **e < self.settings.permeability.porosity_cap);
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

    /// What a run needs to go on: the reduced pressure of every cell, then its porosity at the last coupling, then the gradient
    /// that its permeability was for; the same on every rank. Nothing before the first coupling.
    #[must_use]
    pub fn state(&self) -> Vec<f64> {
        if !self.has_before {
            return Vec::new();
        }
        let cells = 0..self.grid().count();
        let pressures = cells.map(|c| self.pressure.reduced(c));
        let rest = self.before.iter().chain(&self.gradient);
        pressures.chain(rest.copied()).collect()
    }

    /// Takes over what [`Self::state`] gave.
    ///
    /// # Errors
    /// If it is for another grid.
    pub fn restore(&mut self, state: &[f64]) -> Result<(), Error> {
        let n = self.grid().count();
        if state.is_empty() {
            return Ok(());
        }
        if state.len() != 3 * n {
            return Err(Error::Io(format!(
                "the checkpoint holds {} numbers of the seepage, not {}",
                state.len(),
                3 * n
            )));
        }
        self.pressure.restore(&state[..n]).map_err(failed)?;
        self.before.copy_from_slice(&state[n..2 * n]);
        self.gradient.copy_from_slice(&state[2 * n..]);
        self.has_before = true;
        Ok(())
    }

    fn cell(&self, cell: usize) -> Option<Cell> {
        if self.openness.blocked(cell) {
            return None;
        }
        let porosity = self.limited[cell];
        let liquid = self.settings.liquid;
        Some(Cell {
            gradient: self.pressure.gradient(cell),
            flux: self.pressure.flux()[cell],
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
    fn seep(&mut self, particles: &Particles<Sp>) -> Result<(), Error> {
        self.pores.clear();
        for k in 0..particles.owned() {
            self.pores
                .add(place::<Sp>(particles, k), particles.body[k].radius);
        }
        self.pores
            .finish(&self.openness, &self.communicator)
            .map_err(failed)?;
        let permeability = self.settings.permeability;
        let (law, liquid) = (permeability.law.model(), self.settings.liquid);
        let (porosity, diameter) = (self.pores.porosity(), self.pores.diameter());
        for cell in 0..porosity.len() {
            self.limited[cell] = permeability.limited(porosity[cell]);
            self.source[cell] = (self.before[cell] - porosity[cell]) * self.openness.inside[cell]
                / self.settings.interval;
        }
        let source = (self.settings.transient && self.has_before).then_some(&self.source[..]);
        let mut iterations = 0;
        for round in 1.. {
            let bed = BedOfCells {
                porosity: &self.limited,
                diameter,
                gradient: &self.gradient,
            };
            law.fill(bed, liquid, &mut self.permeability);
            self.report = self
                .pressure
                .solve(&self.permeability, &self.limited, source)
                .map_err(failed)?;
            iterations += self.report.iterations;
            for cell in 0..porosity.len() {
                let reduced = self.pressure.reduced_gradient(cell);
                self.gradient[cell] = reduced.iter().map(|g| g * g).sum::<f64>().sqrt();
            }
            if !law.depends_on_the_gradient() {
                break;
            }
            let bed = BedOfCells {
                porosity: &self.limited,
                diameter,
                gradient: &self.gradient,
            };
            let change = law.change(bed, liquid, &self.permeability);
            if change <= SETTLED {
                break;
            }
            if round >= MOST_ROUNDS || change.is_nan() {
                return Err(Error::Numerical(format!(
                    "the permeability still changes by {change:e} after {round} solutions of the pressure"
                )));
            }
        }
        self.report.iterations = iterations;
        self.before.copy_from_slice(self.pores.porosity());
        self.has_before = true;
        Ok(())
    }

    /// Load of one grain, and whether its drag is that at the end of the interval.
    fn load(
        &self,
        law: &dyn Law,
        particles: &Particles<Sp>,
        k: usize,
        room: &mut Room,
    ) -> ([f64; 3], bool) {
        let body = &particles.body[k];
        let grain = Grain::new(Sp::DIMENSION, body.radius);
        let velocity: [f64; 3] = components(&particles.motion[k].velocity);
        self.pores
            .parts(place::<Sp>(particles, k), body.radius, &mut room.parts);
        room.cells.clear();
        let open = |&(cell, part): &(usize, f64)| Some((self.cell(cell)?, part));
        room.cells.extend(room.parts.iter().filter_map(open));
        let mut pressure = [0.0; 3];
        for (here, part) in &room.cells {
            for a in 0..3 {
                pressure[a] -= part * grain.volume * here.gradient[a];
            }
        }
        let Drag { pull, rate } = law.drag(&grain, velocity, &room.cells);
        let share = self.settings.interval * rate / body.mass;
        let implicit = self.settings.semi_implicit && body.kind == Kind::Free && share > 1.0;
        let force = std::array::from_fn(|a| {
            let v = if implicit {
                let known = component(&particles.contact[k].force, a) + pressure[a] + pull[a];
                let kick = self.settings.interval * (known / body.mass + self.settings.gravity[a]);
                (velocity[a] + kick) / (1.0 + share)
            } else {
                velocity[a]
            };
            pressure[a] + pull[a] - rate * v
        });
        (force, implicit)
    }

    fn close(&mut self, mut on_grains: [ExactSum; 3], implicit: u64) {
        let mut balance = Balance {
            implicit: self.communicator.all_reduce_sum_u64(implicit),
            ..Balance::default()
        };
        let mut largest = 0.0_f64;
        let mut missing = 0.0;
        for a in 0..3 {
            on_grains[a].all_reduce(&self.communicator);
            let (mut pressure, mut weight) = (ExactSum::new(), ExactSum::new());
            for cell in 0..self.grid().count() {
                if self.pores.solid_volume(cell) <= 0.0 {
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

fn place<Sp: Space>(particles: &Particles<Sp>, k: usize) -> [f64; 3] {
    components(&particles.location(k))
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
        self.seep(particles)?;
        let mut sums: [ExactSum; 3] = std::array::from_fn(|_| ExactSum::new());
        let mut implicit = 0;
        let (law, mut room) = (self.settings.drag, std::mem::take(&mut self.room));
        for k in 0..particles.owned() {
            let (force, at_the_end) = self.load(law.model(), particles, k, &mut room);
            let mut load = Load::<Sp>::default();
            for (a, force) in force.iter().enumerate().take(Sp::DIMENSION) {
                load.force.set(a, *force);
                sums[a].add(*force);
            }
            implicit += u64::from(at_the_end);
            particles.fluid[k] = load;
        }
        self.room = room;
        self.close(sums, implicit);
        if self.balance.closure.is_finite() {
            Ok(())
        } else {
            Err(Error::Numerical(
                "the force of the water on the grains is not finite".into(),
            ))
        }
    }

    fn update_bodies(&mut self, _: &mut Particles<Sp>, _: &Domain) -> Result<(), Error> {
        Ok(())
    }
}

#[cfg(test)]
#[path = "drag/tests.rs"]
mod tests;
