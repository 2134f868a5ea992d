//! A packing by growing radii.
//!
//! A random, very loose cloud fills the box; the radii grow together in small stages while contacts push the grains apart,
//! cohesion off; near the end the packing relaxes and the radii are adjusted until the mean overlap is what is asked. What
//! results is the same for the same seed on any machine rank: it runs alone, and the caller hands it round.
//!
//! The force that a bond can bear opens it by C/k_n, a few nanometres in the piping paper. A packing that is to stand still when
//! bonded and cut must therefore carry overlaps well below that: ask for a mean overlap of some 1e-6 diameters. The
//! sizes are then the asked ones times one common factor close to 1, which is reported; with [`Stop::SolidFraction`] the factor
//! is exactly 1 and the overlap what results.
//!
//! Sizes and places come from counter-based random numbers: [`crate::random`].

use std::fmt::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::waiting::{Reached, Waiting};
use crate::dem::contact::linear::{Linear, Parameters};
use crate::dem::{
    Alone, Body, Components, Dem, Law, Motion, PairTable, Particles, Region, Settings, Space, Wall,
};
use crate::error::Error;
use crate::random::Stream;

/// Which diameters (m) the grains have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Sizes {
    /// Drawn uniformly (by number) between the two.
    Uniform {
        /// Least diameter (m).
        smallest: f64,
        /// Greatest diameter (m).
        largest: f64,
    },
    /// These, one grain each; the asked solid fraction then only scales them.
    List(Vec<f64>),
}

/// When the growth is over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Stop {
    /// At the asked sizes, whatever the overlaps: their sum over the box is this solid fraction.
    SolidFraction(f64),
    /// Where grains with contacts have this many each, on average; then at the overlap of [`Preparation::overlap`].
    Coordination(f64),
    /// Where the relaxed packing bears this mean overlap over the mean diameter.
    Overlap(f64),
}

/// What to pack, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Preparation<S: Space> {
    /// Lower corner of the box (m).
    pub lower: S::Vector,
    /// Upper corner of the box (m).
    pub upper: S::Vector,
    /// Periodic axes; the others have walls.
    pub periodic: [bool; 3],
    /// Diameters.
    pub sizes: Sizes,
    /// Solid fraction that sets the number of grains; with [`Stop::SolidFraction`] that one does.
    pub solid_fraction: f64,
    /// When to stop.
    pub stop: Stop,
    /// Seed of sizes and places.
    pub seed: u64,
    /// Density of the grains (kg/m³).
    pub density: f64,
    /// Normal stiffness over the mean diameter of a pair (N/m²).
    pub stiffness_per_diameter: f64,
    /// Friction between grains while they are packed; none gives the densest packing.
    pub friction: f64,
    /// Mean overlap over the mean diameter to release the packing to, where `stop` does not say.
    pub overlap: f64,
    /// Largest resultant over largest contact force in the end.
    pub unbalanced: f64,
    /// Solid steps after which to give up.
    pub limit: u64,
}

/// What a packing is like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Number of grains.
    pub grains: u64,
    /// Final over asked diameters, one factor for all.
    pub size_factor: f64,
    /// Area or volume of the grains over that of the box.
    pub solid_fraction: f64,
    /// Contacts per grain, with walls too, of the grains that have as many as the space has dimensions.
    pub coordination: f64,
    /// Part of the grains with fewer.
    pub rattlers: f64,
    /// Mean overlap of contacts over the mean diameter.
    pub mean_overlap: f64,
    /// Largest overlap over the mean diameter.
    pub largest_overlap: f64,
    /// Largest resultant over largest contact force.
    pub unbalanced: f64,
    /// Kinetic energy (J; in the plane per m of depth).
    pub kinetic_energy: f64,
    /// Solid steps taken.
    pub steps: u64,
}

/// One grain of a packing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain<S: Space> {
    /// Centre (m).
    pub position: S::Vector,
    /// Radius (m).
    pub radius: f64,
}

/// Grains and what they are like together.
#[derive(Clone, Debug, PartialEq)]
pub struct Packing<S: Space> {
    /// The grains, neighbours mostly close together in the list.
    pub grains: Vec<Grain<S>>,
    /// What the packing was like when it was made.
    pub report: Report,
}

/// Which grains a box takes away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cut {
    /// Those whose centre lies in it.
    Centre,
    /// Those that touch it.
    Touch,
}

const SIZES: u32 = 1;
const PLACES: u32 = 2;
/// The cloud starts at this part of the final sizes.
const CLOUD: f64 = 0.3;
/// Growth per stage, and solid steps per stage.
const STAGE_GROWTH: f64 = 2e-3;
const STAGE_STEPS: u64 = 50;

impl<S: Space> Preparation<S> {
    /// Packs.
    ///
    /// # Errors
    /// Where the request makes no sense, or the packing does not come about within the steps allowed; [`Error::Stopped`] where the
    /// outside wants an end.
    pub fn pack(&self, waiting: &Waiting<'_, S>) -> Result<Packing<S>, Error> {
        let radii = self.radii()?;
        let mut growth = match waiting.take_up() {
            Some(reached) => Growth::go_on(self, radii, waiting, reached)?,
            None => Growth::new(self, radii, waiting)?,
        };
        growth.run()?;
        growth.packing()
    }

    fn box_measure(&self) -> f64 {
        (0..S::DIMENSION)
            .map(|axis| self.upper.get(axis) - self.lower.get(axis))
            .product()
    }

    /// The asked radii (m).
    fn radii(&self) -> Result<Vec<f64>, Error> {
        let fraction = match self.stop {
            Stop::SolidFraction(fraction) => fraction,
            Stop::Coordination(_) | Stop::Overlap(_) => self.solid_fraction,
        };
        if !(fraction > 0.0 && fraction < 1.0) {
            return Err(Error::Numerical(format!(
                "a packing of solid fraction {fraction}"
            )));
        }
        let wanted = fraction * self.box_measure();
        let mut radii = Vec::new();
        match &self.sizes {
            Sizes::List(diameters) => {
                radii.extend(diameters.iter().map(|d| 0.5 * d));
            }
            Sizes::Uniform { smallest, largest } => {
                let mut filled = 0.0;
                while filled < wanted {
                    let draw = Stream::new(self.seed, radii.len() as u64, SIZES).uniform();
                    let radius = 0.5 * (smallest + (largest - smallest) * draw);
                    if !(radius > 0.0 && radius.is_finite()) || radii.len() > 50_000_000 {
                        return Err(Error::Numerical(format!(
                            "grains of radius {radius} m to pack"
                        )));
                    }
                    // The last one only where it brings the sum closer.
                    if filled + 0.5 * S::measure(radius) > wanted && !radii.is_empty() {
                        break;
                    }
                    filled += S::measure(radius);
                    radii.push(radius);
                }
            }
        }
        if radii.is_empty() || radii.iter().any(|r| !(*r > 0.0 && r.is_finite())) {
            return Err(Error::Numerical("grains without a size to pack".into()));
        }
        Ok(radii)
    }
}

/// How far a packing is: all that the next batch of steps depends on beside the grains and their contacts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// Sizes over the asked ones.
    factor: f64,
    /// Growth of a packing that falls apart, the next time it does.
    growth: f64,
    stage: Stage,
    /// Steps of the present batch, and those left of it.
    batch: u64,
    left: u64,
}

/// What the present batch of steps is part of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Stage {
    /// Growth by small stages.
    Grow,
    /// Rounds of waiting for rest.
    Rest {
        /// What the rest is for.
        purpose: Purpose,
        /// Rounds begun before this one, and how many in a row found the packing fallen apart.
        rounds: u32,
        apart: u32,
        /// Steps of this round, and how many it may take.
        taken: u64,
        limit: u64,
    },
    /// It is packed.
    Done,
}

/// What a rest is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Purpose {
    /// The sizes are those asked for: this rest is the last.
    Last,
    /// To see what overlaps there are.
    Coarse,
    /// To see whether the overlaps are those asked for.
    Fine,
}

/// A packing on its way.
struct Growth<'a, S: Space> {
    how: &'a Preparation<S>,
    waiting: &'a Waiting<'a, S>,
    /// Asked radii (m), by id.
    radii: Vec<f64>,
    mean_diameter: f64,
    progress: Progress,
    dem: Dem<S>,
    particles: Particles<S>,
}

impl<'a, S: Space> Growth<'a, S> {
    fn new(
        how: &'a Preparation<S>,
        radii: Vec<f64>,
        waiting: &'a Waiting<'a, S>,
    ) -> Result<Self, Error> {
        let places = scatter(how, &radii)?;
        let mut particles = Particles::new();
        for (id, (radius, position)) in (0..).zip(radii.iter().zip(places)) {
            // Masses of the final sizes throughout.
            let body = Body {
                radius: radius * CLOUD,
                ..Body::uniform::<S>(id, *radius, how.density, 0)
            };
            particles.insert(
                body,
                Motion {
                    position,
                    ..Motion::default()
                },
            );
        }
        let progress = Progress {
            factor: CLOUD,
            growth: STAGE_GROWTH,
            stage: Stage::Grow,
            batch: 0,
            left: 0,
        };
        let mut growth = Self::with(how, radii, waiting, progress, particles)?;
        growth.grow();
        Ok(growth)
    }

    /// From what an earlier attempt reached.
    fn go_on(
        how: &'a Preparation<S>,
        radii: Vec<f64>,
        waiting: &'a Waiting<'a, S>,
        reached: Reached<S>,
    ) -> Result<Self, Error> {
        let wrong = |what: String| Error::Io(format!("the saved growth of the sample: {what}"));
        let progress: Progress =
            serde_json::from_value(reached.progress).map_err(|e| wrong(e.to_string()))?;
        if reached.particles.owned() != radii.len() {
            return Err(wrong(format!(
                "{} grains where the case has {}",
                reached.particles.owned(),
                radii.len()
            )));
        }
        let mut growth = Self::with(how, radii, waiting, progress, reached.particles)?;
        growth.dem.restore(&reached.contacts)?;
        growth.dem.prepare(&mut growth.particles, &Alone)?;
        if let Stage::Rest { .. } = progress.stage {
            growth.dem.set_local_damping(AT_REST);
        }
        Ok(growth)
    }

    fn with(
        how: &'a Preparation<S>,
        radii: Vec<f64>,
        waiting: &'a Waiting<'a, S>,
        progress: Progress,
        particles: Particles<S>,
    ) -> Result<Self, Error> {
        let mean_diameter = 2.0 * radii.iter().sum::<f64>() / real(radii.len());
        let parameters = Parameters {
            normal_stiffness: how.stiffness_per_diameter,
            stiffness_per_diameter: true,
            stiffness_ratio: 0.4,
            friction: how.friction,
            normal_damping: 0.2,
            shear_damping: 0.2,
            attraction: false,
        };
        let law = Law::Linear(Linear {
            parameters: PairTable::uniform(1, parameters),
        });
        let grown: Vec<Body> = radii
            .iter()
            .map(|radius| Body::uniform::<S>(0, *radius, how.density, 0))
            .collect();
        let time_step = 0.2 * law.critical_time_step::<S>(&grown, 1);
        let region = Region {
            lower: how.lower,
            upper: how.upper,
            periodic: how.periodic,
            spacing: how.upper.get(0) - how.lower.get(0),
        };
        let mut settings = Settings::new(region, time_step, 0.1 * mean_diameter);
        settings.local_damping = WHILE_GROWING;
        let closed = how.periodic.map(|periodic| !periodic);
        let dem = Dem::new(law, settings, Wall::of_box(how.lower, how.upper, closed, 0))?;
        Ok(Self {
            how,
            waiting,
            radii,
            mean_diameter,
            progress,
            dem,
            particles,
        })
    }

    fn set_factor(&mut self, factor: f64) {
        self.progress.factor = factor;
        for k in 0..self.particles.owned() {
            let asked = self.radii[usize_of(self.particles.body[k].id)];
            self.particles.set_radius(k, asked * factor);
        }
    }

    /// The packing as it is, the unbalanced force left out.
    fn look(&self) -> Report {
        let count = self.particles.owned();
        let mut touches = vec![0_usize; count];
        let (mut contacts, mut sum, mut largest) = (0.0, 0.0, 0.0_f64);
        self.dem.for_each_contact(&self.particles, |contact| {
            touches[contact.grain] += 1;
            if let Some(other) = contact.other {
                // An image stands for its grain.
                let id = self.particles.body[other].id;
                if let Ok(own) =
                    self.particles.body[..count].binary_search_by_key(&id, |body| body.id)
                {
                    touches[own] += 1;
                }
            }
            contacts += 1.0;
            sum += contact.overlap;
            largest = largest.max(contact.overlap);
        });
        let holding = || touches.iter().filter(|touches| **touches >= S::DIMENSION);
        let held = real(holding().count());
        let ends = real(holding().sum());
        Report {
            grains: count as u64,
            size_factor: self.progress.factor,
            solid_fraction: self
                .radii
                .iter()
                .map(|r| S::measure(r * self.progress.factor))
                .sum::<f64>()
                / self.how.box_measure(),
            coordination: if held > 0.0 { ends / held } else { 0.0 },
            rattlers: 1.0 - held / real(count),
            mean_overlap: if contacts > 0.0 {
                sum / contacts / self.mean_diameter
            } else {
                0.0
            },
            largest_overlap: largest / self.mean_diameter,
            unbalanced: 0.0,
            kinetic_energy: (0..count).map(|k| self.particles.kinetic_energy(k)).sum(),
            steps: self.dem.steps(),
        }
    }

    /// Batches of steps, and after each the decision what comes next, until the packing is done.
    fn run(&mut self) -> Result<(), Error> {
        while self.progress.stage != Stage::Done {
            while self.progress.left > 0 {
                let left = &mut self.progress.left;
                self.waiting
                    .advance(&mut self.dem, &mut self.particles, left)?;
                self.waiting.listen(&self.dem, &self.particles, || {
                    serde_json::to_value(self.progress).map_err(|e| Error::Internal(e.to_string()))
                })?;
            }
            self.decide()?;
        }
        Ok(())
    }

    fn decide(&mut self) -> Result<(), Error> {
        match self.progress.stage {
            Stage::Grow => self.after_growth(),
            Stage::Rest {
                purpose,
                rounds,
                apart,
                taken,
                limit,
            } => {
                let taken = taken + self.progress.batch;
                let still = self.dem.stillness(&self.particles, &Alone)?;
                if taken < limit && still.unbalanced() > self.tolerance(purpose) {
                    self.progress.stage = Stage::Rest {
                        purpose,
                        rounds,
                        apart,
                        taken,
                        limit,
                    };
                    self.batch(LOOK_EVERY.min(limit - taken));
                    return Ok(());
                }
                self.dem.set_local_damping(WHILE_GROWING);
                self.after_round(purpose, rounds, apart, still.unbalanced())
            }
            Stage::Done => Ok(()),
        }
    }

    fn batch(&mut self, steps: u64) {
        self.progress.batch = steps;
        self.progress.left = steps;
    }

    /// The sizes at which growth ends, over the asked ones.
    fn full_size(&self) -> f64 {
        match self.how.stop {
            Stop::SolidFraction(_) => 1.0,
            Stop::Coordination(_) | Stop::Overlap(_) => f64::INFINITY,
        }
    }

    /// The next stage of growth to the asked sizes, or until the packing jams.
    fn grow(&mut self) {
        let next = self.progress.factor * (1.0 + STAGE_GROWTH);
        self.set_factor(next.min(self.full_size()));
        self.progress.stage = Stage::Grow;
        self.batch(STAGE_STEPS);
    }

    fn after_growth(&mut self) -> Result<(), Error> {
        self.check_limit()?;
        let mut grown = self.progress.factor >= self.full_size();
        if !grown {
            let now = self.look();
            let crowded = now.mean_overlap > 0.5 * STAGE_GROWTH;
            let done = match self.how.stop {
                Stop::Coordination(wanted) => now.coordination >= wanted,
                Stop::Overlap(_) => now.coordination >= JAMMED,
                Stop::SolidFraction(_) => false,
            };
            grown = crowded && done;
        }
        match self.how.stop {
            _ if !grown => self.grow(),
            Stop::SolidFraction(_) => self.rest(Purpose::Last),
            Stop::Coordination(_) | Stop::Overlap(_) => self.rest(Purpose::Coarse),
        }
        Ok(())
    }

    /// How still the packing has to be.
    fn tolerance(&self, purpose: Purpose) -> f64 {
        match purpose {
            Purpose::Coarse => COARSE,
            Purpose::Last | Purpose::Fine => self.how.unbalanced,
        }
    }

    /// Begins to wait for rest.
    fn rest(&mut self, purpose: Purpose) {
        self.round(purpose, 0, 0);
    }

    fn round(&mut self, purpose: Purpose, rounds: u32, apart: u32) {
        let left = self.how.limit.saturating_sub(self.dem.steps());
        let limit = left.clamp(1, 1000);
        self.progress.stage = Stage::Rest {
            purpose,
            rounds,
            apart,
            taken: 0,
            limit,
        };
        self.dem.set_local_damping(AT_REST);
        self.batch(LOOK_EVERY.min(limit));
    }

    fn after_round(
        &mut self,
        purpose: Purpose,
        rounds: u32,
        apart: u32,
        unbalanced: f64,
    ) -> Result<(), Error> {
        self.check_limit()?;
        let apart = if self.look().coordination < JAMMED {
            apart + 1
        } else {
            0
        };
        if apart == 0 && unbalanced <= self.tolerance(purpose) {
            self.after_rest(purpose, true);
        } else if apart == 3 || rounds + 1 == ROUNDS {
            // It fell apart, or does not come to rest.
            self.after_rest(purpose, false);
        } else {
            self.round(purpose, rounds + 1, apart);
        }
        Ok(())
    }

    /// Where sizes are free brings the mean overlap to what is asked, in steps down.
    fn after_rest(&mut self, purpose: Purpose, jammed: bool) {
        let target = match self.how.stop {
            Stop::SolidFraction(_) => {
                self.progress.stage = Stage::Done;
                return;
            }
            Stop::Overlap(overlap) => overlap,
            Stop::Coordination(_) => self.how.overlap,
        };
        let now = self.look();
        if purpose == Purpose::Fine
            && jammed
            && (0.25 * target..=4.0 * target).contains(&now.mean_overlap)
        {
            self.progress.stage = Stage::Done;
            return;
        }
        if jammed && (0.5 * target..=2.0 * target).contains(&now.mean_overlap) {
            self.rest(Purpose::Fine);
            return;
        }
        // Overlaps follow sizes about one to one; on the way down by two thirds at once. A packing that fell apart was
        // held by motion only: it is pressed well beyond the target, where it comes to rest soon, and released again.
        let change = if jammed {
            self.progress.growth = 64.0 * target;
            (now.mean_overlap / 3.0).max(target) - now.mean_overlap
        } else {
            self.progress.growth = (2.0 * self.progress.growth).min(8.0 * STAGE_GROWTH);
            0.5 * self.progress.growth
        };
        self.set_factor(self.progress.factor * (1.0 + change));
        self.rest(Purpose::Coarse);
    }

    fn check_limit(&self) -> Result<(), Error> {
        self.waiting.say(|| {
            let now = self.look();
            format!(
                "{} grains growing: {} solid steps, sizes x {:.4}, solid fraction {:.4}, {:.2} contacts each, mean overlap {:.1e} d",
                self.particles.owned(),
                self.dem.steps(),
                self.progress.factor,
                now.solid_fraction,
                now.coordination,
                now.mean_overlap
            )
        });
        if self.dem.steps() < self.how.limit {
            return Ok(());
        }
        let now = self.look();
        Err(Error::Numerical(format!(
            "no packing within {} steps: solid fraction {:.4}, {:.2} contacts per grain, mean overlap {:.2e} diameters",
            self.how.limit, now.solid_fraction, now.coordination, now.mean_overlap
        )))
    }

    fn packing(self) -> Result<Packing<S>, Error> {
        let still = self.dem.stillness(&self.particles, &Alone)?;
        let report = Report {
            unbalanced: still.unbalanced(),
            ..self.look()
        };
        let mut grains: Vec<Grain<S>> = (0..self.particles.owned())
            .map(|k| Grain {
                position: self.particles.location(k),
                radius: self.particles.body[k].radius,
            })
            .collect();
        put_neighbours_together(&mut grains, self.how, 2.0 * self.mean_diameter);
        Ok(Packing { grains, report })
    }
}

/// Below this many contacts per grain nothing is held.
const JAMMED: f64 = 3.0;
/// How still a packing is between changes of size.
const COARSE: f64 = 1e-2;
/// Local damping while it grows and while it rests.
const WHILE_GROWING: f64 = 0.3;
const AT_REST: f64 = 0.7;
/// Steps between looks at a packing that rests, and rounds of up to a thousand steps before it counts as restless.
const LOOK_EVERY: u64 = 100;
const ROUNDS: u32 = 40;

/// A place for each grain at the cloud's sizes, without overlap, the largest placed first.
fn scatter<S: Space>(how: &Preparation<S>, radii: &[f64]) -> Result<Vec<S::Vector>, Error> {
    let largest = radii.iter().copied().fold(0.0, f64::max) * CLOUD;
    let cell = 2.0 * largest;
    let mut counts = [1_usize; 3];
    for (axis, count) in counts.iter_mut().enumerate().take(S::DIMENSION) {
        let length = how.upper.get(axis) - how.lower.get(axis);
        if length < 2.0 * largest {
            return Err(Error::Numerical(format!(
                "a box {length} m wide for grains of {largest} m"
            )));
        }
        *count = floor((length / cell).max(1.0));
    }
    let total = counts.iter().product();
    let mut cells: Vec<Vec<usize>> = vec![Vec::new(); total];
    let cell_of = |at: &S::Vector, step: [isize; 3]| -> Option<usize> {
        let mut index = 0;
        for axis in (0..S::DIMENSION).rev() {
            let length = how.upper.get(axis) - how.lower.get(axis);
            let part = (at.get(axis) - how.lower.get(axis)) / length;
            let place = floor(part * real(counts[axis])).min(counts[axis] - 1);
            let place = place
                .checked_add_signed(step[axis])
                .filter(|place| *place < counts[axis]);
            let place = match (place, how.periodic[axis]) {
                (Some(place), _) => place,
                (None, true) if step[axis] < 0 => counts[axis] - 1,
                (None, true) => 0,
                (None, false) => return None,
            };
            index = index * counts[axis] + place;
        }
        Some(index)
    };
    let mut order: Vec<usize> = (0..radii.len()).collect();
    order.sort_by(|a, b| radii[*b].total_cmp(&radii[*a]).then(a.cmp(b)));
    let mut places = vec![S::Vector::default(); radii.len()];
    for &id in &order {
        let radius = radii[id] * CLOUD;
        let mut draws = Stream::new(how.seed, id as u64, PLACES);
        let free = (0..2000).find_map(|_| {
            let mut at = S::Vector::default();
            for axis in 0..S::DIMENSION {
                let margin = if how.periodic[axis] { 0.0 } else { radius };
                let (low, high) = (how.lower.get(axis) + margin, how.upper.get(axis) - margin);
                at.set(axis, low + (high - low) * draws.uniform());
            }
            let mut clear = true;
            for_each_step::<S>(|step| {
                for &other in cell_of(&at, step).map_or(&[][..], |index| &cells[index]) {
                    let mut between = places[other] - at;
                    for axis in (0..S::DIMENSION).filter(|&axis| how.periodic[axis]) {
                        let length = how.upper.get(axis) - how.lower.get(axis);
                        let d = between.get(axis);
                        between.set(axis, d - length * (d / length).round());
                    }
                    clear &= between.length() >= radius + radii[other] * CLOUD;
                }
            });
            clear.then_some(at)
        });
        let Some(at) = free else {
            return Err(Error::Numerical(
                "the loose cloud does not fit the box".into(),
            ));
        };
        places[id] = at;
        if let Some(index) = cell_of(&at, [0; 3]) {
            cells[index].push(id);
        }
    }
    Ok(places)
}

/// Calls `visit` for the cell itself and all its neighbours.
fn for_each_step<S: Space>(mut visit: impl FnMut([isize; 3])) {
    let deep = if S::DIMENSION == 3 { -1..=1 } else { 0..=0 };
    for z in deep {
        for y in -1..=1 {
            for x in -1..=1 {
                visit([x, y, z]);
            }
        }
    }
}

/// Orders grains by strips along the longest axis, so that ids that are close stand close.
fn put_neighbours_together<S: Space>(grains: &mut [Grain<S>], how: &Preparation<S>, strip: f64) {
    let length = |axis: usize| how.upper.get(axis) - how.lower.get(axis);
    let longest = (0..S::DIMENSION).fold(0, |best, axis| {
        if length(axis) > length(best) {
            axis
        } else {
            best
        }
    });
    let mut axes: Vec<usize> = (0..S::DIMENSION).filter(|&axis| axis != longest).collect();
    let last = axes.pop().unwrap_or(longest);
    let place = |grain: &Grain<S>, axis: usize| {
        floor(((grain.position.get(axis) - how.lower.get(axis)) / strip).max(0.0))
    };
    grains.sort_by(|a, b| {
        let strips = |grain: &Grain<S>| {
            let across: Vec<usize> = axes.iter().map(|&axis| place(grain, axis)).collect();
            (place(grain, longest), across)
        };
        strips(a)
            .cmp(&strips(b))
            .then(a.position.get(last).total_cmp(&b.position.get(last)))
            .then(a.position.get(longest).total_cmp(&b.position.get(longest)))
    });
}

/// The order of `places` along a curve through space (Morton's), in cells of a 1024th of their extent: grains numbered so stand
/// close where their ids are close, which is what makes contacts cheap to add up by id.
#[must_use]
pub fn curve_order<S: Space>(places: &[S::Vector]) -> Vec<usize> {
    let mut low = [f64::INFINITY; 3];
    let mut extent = 0.0_f64;
    for axis in 0..S::DIMENSION {
        let coordinates = || places.iter().map(|place| place.get(axis));
        low[axis] = coordinates().fold(f64::INFINITY, f64::min);
        extent = extent.max(coordinates().fold(f64::NEG_INFINITY, f64::max) - low[axis]);
    }
    let scale = if extent > 0.0 { 1024.0 / extent } else { 0.0 };
    let code = |place: &S::Vector| {
        let mut code = 0_u64;
        for axis in 0..S::DIMENSION {
            let cell = floor(((place.get(axis) - low[axis]) * scale).clamp(0.0, 1023.0));
            for bit in 0..10 {
                code |= u64::from(cell >> bit & 1 == 1) << (bit * S::DIMENSION + axis);
            }
        }
        code
    };
    let codes: Vec<u64> = places.iter().map(code).collect();
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&k| codes[k]);
    order
}

impl<S: Space> Packing<S> {
    /// Takes away the grains in the box between two corners (m); returns how many.
    pub fn cut(&mut self, lower: &S::Vector, upper: &S::Vector, cut: Cut) -> usize {
        let before = self.grains.len();
        self.grains.retain(|grain| {
            let mut squared = 0.0;
            for axis in 0..S::DIMENSION {
                let x = grain.position.get(axis);
                let outside = x - x.clamp(lower.get(axis), upper.get(axis));
                squared += outside * outside;
            }
            match cut {
                Cut::Centre => squared > 0.0,
                Cut::Touch => squared >= grain.radius * grain.radius,
            }
        });
        before - self.grains.len()
    }

    /// The packing as text: `#` lines with `provenance` and the report, a line of names, one line per grain. Numbers come back
    /// bit by bit.
    #[must_use]
    pub fn to_csv(&self, provenance: &str) -> String {
        let mut text = String::new();
        for line in provenance.lines() {
            let _ = writeln!(text, "# {line}");
        }
        if let Ok(report) = serde_json::to_string(&self.report) {
            let _ = writeln!(text, "# report {report}");
        }
        text.push_str(if S::DIMENSION == 3 {
            "x,y,z,radius\n"
        } else {
            "x,y,radius\n"
        });
        for grain in &self.grains {
            for axis in 0..S::DIMENSION {
                let _ = write!(text, "{:e},", grain.position.get(axis));
            }
            let _ = writeln!(text, "{:e}", grain.radius);
        }
        text
    }

    /// A packing from the text of [`Self::to_csv`], or from any such columns; the report is empty where there is none.
    ///
    /// # Errors
    /// Where a line is not what it should be.
    pub fn from_csv(text: &str) -> Result<Self, Error> {
        let mut packing = Self {
            grains: Vec::new(),
            report: Report::default(),
        };
        let names = if S::DIMENSION == 3 {
            "x,y,z,radius"
        } else {
            "x,y,radius"
        };
        let mut named = false;
        for (number, line) in (1..).zip(text.lines()) {
            let wrong = |what: &str| Error::Io(format!("packing, line {number}: {what}"));
            if let Some(report) = line.strip_prefix("# report ") {
                packing.report = serde_json::from_str(report)
                    .map_err(|error| wrong(&format!("report: {error}")))?;
            } else if line.starts_with('#') || line.trim().is_empty() {
            } else if !named {
                if line.trim() != names {
                    return Err(wrong(&format!("the columns should be {names}")));
                }
                named = true;
            } else {
                let numbers = line
                    .split(',')
                    .map(|word| word.trim().parse::<f64>())
                    .collect::<Result<Vec<_>, _>>()
                    .map_err(|error| wrong(&error.to_string()))?;
                if numbers.len() != S::DIMENSION + 1 || numbers.iter().any(|x| !x.is_finite()) {
                    return Err(wrong("not one finite number per column"));
                }
                let mut position = S::Vector::default();
                for (axis, number) in numbers.iter().enumerate().take(S::DIMENSION) {
                    position.set(axis, *number);
                }
                let radius = numbers[S::DIMENSION];
                if radius <= 0.0 {
                    return Err(wrong("a radius that is not positive"));
                }
                packing.grains.push(Grain { position, radius });
            }
        }
        if named {
            Ok(packing)
        } else {
            Err(Error::Io("packing: no line of names".into()))
        }
    }

    /// Writes [`Self::to_csv`] to a file.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn save(&self, path: &Path, provenance: &str) -> Result<(), Error> {
        std::fs::write(path, self.to_csv(provenance))
            .map_err(|error| Error::Io(format!("{}: {error}", path.display())))
    }

    /// Reads a file written by [`Self::save`].
    ///
    /// # Errors
    /// Where the file cannot be read or is not a packing.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let text = io::plain::text(path, io::plain::LONGEST_INPUT)
            .map_err(|error| Error::Io(error.to_string()))?;
        Self::from_csv(&text)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast of a float saturates; callers pass small positive numbers"
)]
fn floor(value: f64) -> usize {
    value as usize
}

#[expect(clippy::cast_precision_loss, reason = "counts far below 2^53")]
fn real(count: usize) -> f64 {
    count as f64
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "ids count the grains, which are in memory"
)]
fn usize_of(id: u64) -> usize {
    id as usize
}

#[cfg(test)]
mod tests {
    use super::super::waiting::tests::interrupted;
    use super::*;
    use crate::dem::contact::cohesive_frictional::{self, CohesiveFrictional};
    use crate::dem::tests::support::relax;
    use crate::dem::{Plane, Relaxation, Volume};
    use nalgebra::{Vector2, Vector3};

    fn small() -> Preparation<Plane> {
        Preparation {
            lower: Vector2::new(0.0, 0.0),
            upper: Vector2::new(4e-3, 3e-3),
            periodic: [false; 3],
            sizes: Sizes::Uniform {
                smallest: 1.5e-4,
                largest: 2.5e-4,
            },
            solid_fraction: 0.83,
            stop: Stop::Overlap(1e-6),
            seed: 11,
            density: 2650.0,
            stiffness_per_diameter: 150e6,
            friction: 0.0,
            overlap: 1e-6,
            unbalanced: 1e-2,
            limit: 2_000_000,
        }
    }

    /// The packing is jammed, at rest, at the asked overlap; bonded and cut it stands still, and no bond breaks.
    #[test]
    fn a_packing_stands_still_when_bonded_and_cut() {
        let how = small();
        let mut packing = how.pack(&Waiting::silent()).unwrap();
        let report = packing.report;
        assert!((0.80..0.87).contains(&report.solid_fraction), "{report:?}");
        assert!((3.2..4.6).contains(&report.coordination), "{report:?}");
        assert!((2e-7..5e-6).contains(&report.mean_overlap), "{report:?}");
        assert!((0.95..1.05).contains(&report.size_factor), "{report:?}");
        assert!(report.unbalanced <= 1e-2, "{report:?}");
        for grain in &packing.grains {
            for axis in 0..2 {
                let x = grain.position[axis];
                assert!(x > 0.99 * grain.radius && x < how.upper[axis] - 0.99 * grain.radius);
            }
        }
        let before = packing.grains.len();
        let cut = packing.cut(
            &Vector2::new(0.0, 1.3e-3),
            &Vector2::new(4e-3, 1.7e-3),
            Cut::Touch,
        );
        assert!(cut > 20 && packing.grains.len() == before - cut);

        let parameters = cohesive_frictional::Parameters {
            normal_stiffness: 150e6,
            stiffness_per_diameter: true,
            stiffness_ratio: 0.4,
            friction_angle: 20.0,
            cohesion: 0.506,
            cohesion_per_diameter: true,
            normal_damping: 0.0,
            shear_damping: 0.0,
        };
        let law = Law::CohesiveFrictional(CohesiveFrictional {
            parameters: PairTable::uniform(1, parameters),
        });
        let mut particles = Particles::<Plane>::new();
        for (id, grain) in (0..).zip(&packing.grains) {
            let body = Body::uniform::<Plane>(id, grain.radius, 2650.0, 0);
            particles.insert(
                body,
                Motion {
                    position: grain.position,
                    ..Motion::default()
                },
            );
        }
        let limit = law.critical_time_step::<Plane>(&particles.body, 1);
        let settings = Settings::new(
            Region::closed(how.lower, how.upper, 1e-4),
            0.2 * limit,
            2e-5,
        );
        let walls = Wall::of_box(how.lower, how.upper, [true, true, false], 0);
        let mut dem = Dem::new(law, settings, walls).unwrap();
        let bonds = dem.bond_existing_contacts(&mut particles, &Alone).unwrap();
        assert!(bonds > 300, "{bonds}");
        let until = Relaxation {
            limit: 20_000,
            ..Relaxation::default()
        };
        let still = relax(&mut dem, &mut particles, &Alone, &until);
        assert!(still.unbalanced() < 1e-3, "{still:?}");
        assert!(dem.take_breaks().is_empty());
        assert_eq!(dem.statistics(&particles).bonds, bonds);
        for (k, grain) in packing.grains.iter().enumerate() {
            assert!((particles.motion[k].position - grain.position).norm() < 1e-8);
        }
    }

    #[test]
    fn a_packing_that_is_interrupted_comes_to_the_same_bits() {
        let how = Preparation {
            upper: Vector2::new(2e-3, 1.5e-3),
            periodic: [true, false, false],
            friction: 0.3,
            ..small()
        };
        let straight = how.pack(&Waiting::silent()).unwrap();
        let (packing, stops) = interrupted(|waiting| how.pack(waiting));
        assert!(stops > 10, "{stops}");
        assert_eq!(packing, straight);
        let given = Preparation {
            stop: Stop::SolidFraction(0.845),
            ..how
        };
        let (packing, _) = interrupted(|waiting| given.pack(waiting));
        assert_eq!(packing, given.pack(&Waiting::silent()).unwrap());
    }

    #[test]
    fn a_packing_of_given_solid_fraction_has_the_asked_sizes() {
        let how = Preparation {
            stop: Stop::SolidFraction(0.845),
            periodic: [true, false, false],
            ..small()
        };
        let packing = how.pack(&Waiting::silent()).unwrap();
        let report = packing.report;
        assert!((report.size_factor - 1.0).abs() < f64::EPSILON);
        assert!((report.solid_fraction - 0.845).abs() < 2e-3, "{report:?}");
        assert!(
            report.mean_overlap > 0.0 && report.largest_overlap < 0.05,
            "{report:?}"
        );
        let mut asked = how.radii().unwrap();
        let mut found: Vec<f64> = packing.grains.iter().map(|grain| grain.radius).collect();
        asked.sort_by(f64::total_cmp);
        found.sort_by(f64::total_cmp);
        assert_eq!(asked, found);
        assert_eq!(
            packing,
            how.pack(&Waiting::silent()).unwrap(),
            "the same seed gives the same bits"
        );
        assert!(
            packing
                != Preparation { seed: 12, ..how }
                    .pack(&Waiting::silent())
                    .unwrap()
        );
    }

    #[test]
    fn spheres_pack_to_a_coordination() {
        let how = Preparation::<Volume> {
            lower: Vector3::zeros(),
            upper: Vector3::new(0.01, 0.01, 0.01),
            periodic: [true; 3],
            sizes: Sizes::Uniform {
                smallest: 1.6e-3,
                largest: 2.0e-3,
            },
            solid_fraction: 0.6,
            stop: Stop::Coordination(4.0),
            seed: 3,
            density: 2650.0,
            stiffness_per_diameter: 1e8,
            friction: 0.0,
            overlap: 1e-4,
            unbalanced: 2e-2,
            limit: 1_000_000,
        };
        let report = how.pack(&Waiting::silent()).unwrap().report;
        assert!((0.57..0.68).contains(&report.solid_fraction), "{report:?}");
        assert!((4.0..7.5).contains(&report.coordination), "{report:?}");
    }

    #[test]
    fn text_comes_back_bit_by_bit() {
        let mut packing = Packing::<Plane> {
            grains: Vec::new(),
            report: Report {
                grains: 3,
                ..Report::default()
            },
        };
        for k in 0..3 {
            let mut draw = Stream::new(1, k, 0);
            let position = Vector2::new(draw.uniform(), draw.uniform() / 3.0);
            packing.grains.push(Grain {
                position,
                radius: draw.uniform() * 1e-5,
            });
        }
        let text = packing.to_csv("made by hand\nfor a test");
        assert!(text.starts_with("# made by hand\n# for a test\n# report {"));
        assert_eq!(Packing::from_csv(&text).unwrap(), packing);
        let wrong = text.replace("x,y,radius", "x,radius");
        assert!(Packing::<Plane>::from_csv(&wrong).is_err());
        assert!(Packing::<Volume>::from_csv(&text).is_err());
        assert!(Packing::<Plane>::from_csv(&format!("{text}1,2\n")).is_err());
        assert!(Packing::<Plane>::from_csv(&format!("{text}1,2,-1\n")).is_err());
    }
}
