//! Grains as seen by the water of each cell: their drag, their motion until the next coupling, and the sums of
//! both.
//!
//! See the module above for the equations. A grain that lies in several cells responds in each of them to the water
//! there: the force on it is the sum over its parts.

use super::parts::{GrainLoad, NUMBERS, Share, Term, UNITS};
use super::water::{Ground, Water};
use super::{SeepageSettings, components};
use base::number::real;
use base::vector::norm;
use darcy::drag::{DragFormula, GrainSize};
use darcy::resistance::larger;
use darcy::{Equations, power_above, resistance};
use decomposition::{Communicator, quantise};
use dem::particles::{Kind, ParticlesView};
use dem::space::Space;

/// Laws that act on the grains.
#[derive(Clone, Copy)]
pub(super) struct Laws<'a> {
    pub(super) drag: &'a dyn DragFormula,
    pub(super) resistance: &'a dyn resistance::ResistanceFormula,
    pub(super) settings: &'a SeepageSettings,
}

impl Laws<'_> {
    /// Returns the coefficient of force over superficial slip \[kg/s\] from the reaction of the resistance,
    /// averaged over the axes.
    pub(super) fn reaction(&self, ground: &Ground, grain: &GrainSize, speed: f64) -> f64 {
        let [bed, alone] = self.parts_of_reaction(ground, grain, speed);
        bed + alone
    }

    /// Returns the contributions of the bed law and of dilute water to [`Self::reaction`].
    fn parts_of_reaction(&self, ground: &Ground, grain: &GrainSize, speed: f64) -> [f64; 2] {
        let mut parts = [0.0; 2];
        if ground.dense > 0.0 {
            let (porosity, diameter) = ground.packing;
            let resistance = ground.stated_resistance.unwrap_or_else(|| {
                let liquid = self.settings.liquid;
                self.resistance
                    .resistance(porosity, diameter, liquid, speed)
            });
            parts[0] = ground.dense * grain.volume * ground.factor * resistance;
        }
        if ground.dense < 1.0 {
            let alone = self.resistance.dilute(&ground.bed, grain, speed);
            parts[1] = (1.0 - ground.dense) * ground.dilute * alone;
        }
        parts
    }

    /// Returns the coefficients of force over superficial slip \[kg/s\] for a grain and for its reaction on the
    /// water, along each axis. In a cell cut by a zone boundary the bed law depends on the axis; dilute water does
    /// not.
    fn coefficients(&self, ground: &Ground, grain: &GrainSize, speed: f64) -> [[f64; 3]; 2] {
        let reaction = || {
            let [bed, alone] = self.parts_of_reaction(ground, grain, speed);
            ground.ratios.map(|ratio| bed * ratio + alone)
        };
        let balances = self.drag.balances();
        if balances && self.settings.equations == Equations::Corrected {
            return [reaction(); 2];
        }
        let own = self.drag.coefficient(&ground.bed, grain, speed);
        let own = ground
            .ratios
            .map(|ratio| if balances { ratio * own } else { own });
        [
            own,
            if self.settings.moves() {
                reaction()
            } else {
                [0.0; 3]
            },
        ]
    }
}

/// Minimum weight of a velocity change over the interval, with which the load is that of the middle of the interval.
const MIN_WEIGHT: f64 = 0.5;

/// Known data of a grain before a coupling.
enum Start {
    /// First coupling; contacts hold the grain.
    Held,
    /// First coupling; the grain has no contact.
    Free,
    /// Later coupling: load and velocity at the last coupling are known.
    Known,
}

fn is_zero(vector: [f64; 3]) -> bool {
    vector.iter().all(|x| x.abs() <= 0.0)
}

fn start<Sp: Space>(particles: &ParticlesView<'_, Sp>, k: usize) -> Start {
    if !is_zero(components(&particles.fluid[k].force)) {
        Start::Known
    } else if is_zero(components(&particles.contact[k].force)) {
        Start::Free
    } else {
        Start::Held
    }
}

/// Computes the terms of the grains of one thread.
pub(super) fn fill<Sp: Space>(
    laws: Laws<'_>,
    ground: &[Option<Ground>],
    particles: &ParticlesView<'_, Sp>,
    share: &mut Share,
) {
    let settings = laws.settings;
    let weight = settings.water_weight();
    share.terms.clear();
    share.numbers.clear();
    share.largest = [0.0; UNITS];
    let moves = settings.moves();
    for k in share.grains() {
        let body = &particles.body[k];
        let grain = GrainSize::new(Sp::DIMENSION, body.radius);
        let velocity: [f64; 3] = components(&particles.motion[k].velocity);
        let start = start(particles, k);
        // At first, a grain held by contacts loads the water as if it were stationary.
        let free =
            settings.semi_implicit_drag && body.kind == Kind::Free && !matches!(start, Start::Held);
        let (before, last) = match start {
            Start::Known if free => (
                components(&particles.last_velocity[k]),
                components(&particles.fluid[k].force),
            ),
            _ => (velocity, settings.gravity.map(|g| -body.mass * g)),
        };
        for place in share.places(k) {
            let (cell, part_of_grain) = share.parts[place];
            let Some(ground) = &ground[cell] else {
                share.terms.push(Term::default());
                share.numbers.push([0.0; NUMBERS]);
                continue;
            };
            let slip: [f64; 3] =
                std::array::from_fn(|a| ground.flux[a] - ground.measure * velocity[a]);
            let speed = norm(slip);
            let [drag, reaction] = laws.coefficients(ground, &grain, speed);
            // Ratio of the interval to the time in which drag stops a bed.
            let strongest = drag.iter().copied().fold(0.0, f64::max);
            let ratio = settings.interval * strongest / (body.mass * ground.measure);
            let least = if matches!(start, Start::Known) {
                MIN_WEIGHT
            } else {
                0.0
            };
            let part = if free {
                f64::max(least, 1.0 - 1.0 / ratio)
            } else {
                0.0
            };
            let compliance = part * settings.interval / body.mass;
            let known: [f64; 3] = std::array::from_fn(|a| {
                let pushed = grain.volume * weight[a] + last[a];
                velocity[a] + part * (velocity[a] - before[a]) - compliance * pushed
            });
            let term = Term {
                drag,
                reaction,
                compliance,
                response: drag.map(|b| 1.0 / (1.0 + compliance * b * ground.measure)),
                known,
                late: part > MIN_WEIGHT,
            };
            share.terms.push(term);
            if moves {
                let numbers = numbers(&term, ground.measure, part_of_grain, grain.volume);
                for (largest, numbers) in share.largest.iter_mut().zip(numbers.as_chunks::<3>().0) {
                    *largest = numbers
                        .iter()
                        .fold(*largest, |most, n| larger(most, n.abs()));
                }
                share.numbers.push(numbers);
            }
        }
    }
}

/// Computes the loads of the grains of one thread, with a flag that is `true` if the drag is that at the end of the
/// interval. `weight` is the weight of the water per volume \[N/m³\].
pub(super) fn load<Sp: Space>(
    (water, weight): (&Water, [f64; 3]),
    particles: &ParticlesView<'_, Sp>,
    share: &mut Share,
) {
    share.loads.clear();
    for k in share.grains() {
        let volume = GrainSize::new(Sp::DIMENSION, particles.body[k].radius).volume;
        let (mut force, mut counted, mut implicit) = ([0.0; 3], [0.0; 3], false);
        for place in share.places(k) {
            let (cell, part) = share.parts[place];
            let Some(ground) = &water.ground[cell] else {
                continue;
            };
            let (term, gradient) = (&share.terms[place], water.gradient[cell]);
            let drag = term.drag(volume, ground.measure, water.flux[cell], gradient);
            for a in 0..3 {
                let own = part * (drag[a] - volume * (gradient[a] + weight[a]));
                force[a] += own;
                counted[a] += if ground.counts { own } else { 0.0 };
            }
            implicit |= term.late;
        }
        share.loads.push(GrainLoad {
            force,
            counted,
            implicit,
        });
    }
}

/// Sums over the parts of grains in a cell, along each axis; in the formulas `w` is the fraction of the grain in the
/// cell and `b` the reaction times the answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sum {
    /// `sum w b`: ratio of reaction to flux \[kg/s\].
    pub(super) drag: [f64; 3],
    /// `sum w b measure known`: reaction of the known velocities of the grains \[N\].
    pub(super) held: [f64; 3],
    /// `sum w V answer known` \[m4/s\]: volume flow of the known velocities of the grains.
    pub(super) moving: [f64; 3],
    /// `sum w V compliance drag answer` \[m³\]: volume of grains that moves with the flux.
    pub(super) with_flux: [f64; 3],
    /// `sum w V^2 compliance answer` [m⁶ s/kg]: volume of grains moved by the gradient.
    pub(super) with_gradient: [f64; 3],
    /// `sum w b measure compliance V` \[m³\]: ratio of reaction to gradient.
    pub(super) pushed: [f64; 3],
}

impl Sum {
    /// Returns the velocity of the water at which the reaction vanishes without a gradient, along each axis
    /// \[m/s\].
    pub(super) fn mean(&self) -> [f64; 3] {
        std::array::from_fn(|a| {
            if self.drag[a] > 0.0 {
                self.held[a] / self.drag[a]
            } else {
                0.0
            }
        })
    }
}

/// Sums of a cell without grains.
const EMPTY: Sum = Sum {
    drag: [0.0; 3],
    held: [0.0; 3],
    moving: [0.0; 3],
    with_flux: [0.0; 3],
    with_gradient: [0.0; 3],
    pushed: [0.0; 3],
};

/// Sums of all cells as integers, which do not depend on the order of grains or ranks. All are empty as long as there
/// is no grain.
#[derive(Debug, Default)]
pub(super) struct Sums {
    /// Signed integers.
    words: Vec<[u128; NUMBERS]>,
    cells: Vec<Sum>,
}

impl Sums {
    /// Returns the sums of a cell.
    pub(super) fn cell(&self, cell: usize) -> &Sum {
        self.cells.get(cell).unwrap_or(&EMPTY)
    }

    /// Removes the sums of all cells, where no rank has a grain.
    pub(super) fn clear(&mut self) {
        self.cells.clear();
    }

    /// Adds the terms of all grains of all ranks, for a number of cells. Collective.
    ///
    /// # Errors
    ///
    /// If a velocity or a coefficient is not finite; the same on every rank.
    pub(super) fn fill(
        &mut self,
        count: usize,
        shares: &[Share],
        communicator: &Communicator,
    ) -> Result<(), darcy::SeepageError> {
        let mut units = [1.0; UNITS];
        let mut per_unit = [1.0; UNITS];
        for n in 0..UNITS {
            let largest = shares
                .iter()
                .fold(0.0, |most, share| larger(most, share.largest[n]));
            let most = communicator.all_reduce_max_f64(if largest.is_finite() {
                largest
            } else {
                f64::INFINITY
            });
            // The unit and its inverse are powers of two.
            if most >= LARGEST {
                return Err(darcy::SeepageError::NotFinite(
                    "the drag or the velocity of a grain",
                ));
            }
            units[n] = power_above(most.max(SMALLEST));
            per_unit[n] = 1.0 / units[n];
        }
        let scales: [f64; NUMBERS] = std::array::from_fn(|n| per_unit[n / 3]);
        self.words.clear();
        self.words.resize(count, [0; NUMBERS]);
        for share in shares {
            for ((cell, _), numbers) in share.parts.iter().zip(&share.numbers) {
                let words = &mut self.words[*cell];
                for n in 0..NUMBERS {
                    let whole = i128::from(quantise(numbers[n] * scales[n]));
                    words[n] = words[n].wrapping_add(whole.cast_unsigned());
                }
            }
        }
        communicator.all_reduce_sum_u128s(self.words.as_flattened_mut());
        self.cells.resize(count, EMPTY);
        for (cell, words) in self.cells.iter_mut().zip(&self.words) {
            let kind = |kind: usize| -> [f64; 3] {
                std::array::from_fn(|a| {
                    real(words[3 * kind + a].cast_signed()) * (STEP * units[kind])
                })
            };
            *cell = Sum {
                drag: kind(0),
                held: kind(1),
                moving: kind(2),
                with_flux: kind(3),
                with_gradient: kind(4),
                pushed: kind(5),
            };
        }
        Ok(())
    }
}

/// Magnitude below which a unit and its inverse are finite.
const LARGEST: f64 = 1e300;
const SMALLEST: f64 = 1e-300;
/// Smallest step, 2^-62.
const STEP: f64 = 1.0 / 4_611_686_018_427_387_904.0;

/// Returns the contribution of a part of a grain to the sums of its cell, in the order of [`Sum`].
fn numbers(term: &Term, measure: f64, part: f64, volume: f64) -> [f64; NUMBERS] {
    let mut all = [0.0; NUMBERS];
    for a in 0..3 {
        let b = part * term.reaction[a] * term.response[a];
        let v = part * volume * term.response[a];
        let kinds = [
            b,
            b * measure * term.known[a],
            v * term.known[a],
            v * term.compliance * term.drag[a],
            v * term.compliance * volume,
            b * measure * term.compliance * volume,
        ];
        for (kind, number) in kinds.into_iter().enumerate() {
            all[3 * kind + a] = number;
        }
    }
    all
}
