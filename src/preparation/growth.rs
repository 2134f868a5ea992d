//! A packing by growing radii.
//!
//! A random, very loose cloud fills the box. The radii grow together in small stages while contacts push the grains
//! apart, without cohesion. Near the end the packing relaxes, and the radii are adjusted until the mean overlap has the
//! requested value. The result depends on the seed only: it runs on one rank, and the caller distributes it.
//!
//! The force that a bond can bear opens it by C/k_n, a few nanometres in the piping study. A packing that is to stay at
//! rest when bonded and cut must have overlaps well below that: request a mean overlap of about 1e-6 diameters. The
//! sizes are then the requested ones times one common factor close to 1, which the report gives; with
//! [`Stop::SolidFraction`] the factor is exactly 1 and the overlap follows.
//!
//! Sizes and places come from counter-based random numbers: [`base::random`].

mod cloud;

use cloud::{put_neighbours_together, scatter};
use serde::{Deserialize, Serialize};

use super::supervision::{SavedSample, Supervision};
use base::error::Error;
use base::number::{real, to_usize};
use base::random::Stream;
use dem::contact::Scaled;
use dem::contact::linear::{Linear, LinearParameters};
use dem::{
    Body, Components, Dem, DemSettings, GrainDomain, Law, Motion, PairTable, Particles, Space,
    Wall, alone,
};

/// Diameters (m) of the grains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Sizes {
    /// Diameters drawn uniformly (by number) between two values.
    Uniform {
        /// Smallest diameter (m).
        smallest: f64,
        /// Largest diameter (m).
        largest: f64,
    },
    /// Listed radii, one grain each; the requested solid fraction only scales them.
    List(Vec<f64>),
}

/// Condition that ends the growth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Stop {
    /// Solid fraction at the requested sizes, for any overlaps: the total volume of the grains divided by that of the
    /// box.
    SolidFraction(f64),
    /// Mean number of contacts per grain in contact; the overlap is then adjusted to [`PackingSettings::overlap`].
    Coordination(f64),
    /// Mean overlap of the relaxed packing, divided by the mean diameter.
    Overlap(f64),
}

/// Grains to pack, and settings.
#[derive(Clone, Debug, PartialEq)]
pub struct PackingSettings<S: Space> {
    /// Lower corner of the box (m).
    pub lower: S::Vector,
    /// Upper corner of the box (m).
    pub upper: S::Vector,
    /// Periodic axes; the others have walls.
    pub periodic: [bool; 3],
    /// Diameters of the grains.
    pub sizes: Sizes,
    /// Solid fraction that determines the number of grains; [`Stop::SolidFraction`] replaces it.
    pub solid_fraction: f64,
    /// Condition that ends the growth.
    pub stop: Stop,
    /// Seed of sizes and positions.
    pub seed: u64,
    /// Density of the grains (kg/m³).
    pub density: f64,
    /// Normal stiffness divided by the mean diameter of a pair (N/m²).
    pub stiffness_per_diameter: f64,
    /// Friction between grains during packing; zero gives the densest packing.
    pub friction: f64,
    /// Mean overlap divided by the mean diameter of the finished packing, unless `stop` states it.
    pub overlap: f64,
    /// Maximum final ratio of the largest resultant to the largest contact force.
    pub unbalanced: f64,
    /// Maximum number of solid steps.
    pub limit: u64,
}

/// Properties of a packing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PackingReport {
    /// Number of grains.
    pub grains: u64,
    /// Final diameters divided by the requested ones, one factor for all grains.
    pub size_factor: f64,
    /// Area or volume of the grains divided by that of the box.
    pub solid_fraction: f64,
    /// Mean number of contacts, including those with walls, of grains with at least as many contacts as dimensions.
    pub coordination: f64,
    /// Fraction of the grains with fewer contacts.
    pub rattlers: f64,
    /// Mean overlap of contacts divided by the mean diameter.
    pub mean_overlap: f64,
    /// Largest overlap divided by the mean diameter.
    pub largest_overlap: f64,
    /// Largest resultant divided by the largest contact force.
    pub unbalanced: f64,
    /// Kinetic energy (J; per m of depth in the plane).
    pub kinetic_energy: f64,
    /// Number of solid steps.
    pub steps: u64,
}

/// One grain of a packing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedGrain<S: Space> {
    /// Centre (m).
    pub position: S::Vector,
    /// Radius (m).
    pub radius: f64,
}

/// Grains of a packing and their properties.
#[derive(Clone, Debug, PartialEq)]
pub struct Packing<S: Space> {
    /// Grains; neighbours are mostly close together in the list.
    pub grains: Vec<PackedGrain<S>>,
    /// Properties of the packing at its completion.
    pub report: PackingReport,
}

const SIZES: u32 = 1;
const PLACES: u32 = 2;
/// Initial size of the grains in the cloud, divided by the final one.
const CLOUD: f64 = 0.3;
/// Relative growth per stage, and number of solid steps per stage.
const STAGE_GROWTH: f64 = 2e-3;
const STAGE_STEPS: u64 = 50;

impl<S: Space> PackingSettings<S> {
    /// Packs the grains.
    ///
    /// # Errors
    /// If the request makes no sense, or no packing is reached within the allowed steps; [`Error::Stopped`] if the
    /// caller requests a stop.
    pub fn pack(&self, supervision: &Supervision<'_, S>) -> Result<Packing<S>, Error> {
        let radii = self.radii()?;
        let mut growth = match supervision.take_saved() {
            Some(saved) => Growing::resume(self, radii, supervision, saved)?,
            None => Growing::new(self, radii, supervision)?,
        };
        growth.run()?;
        growth.packing()
    }

    fn box_measure(&self) -> f64 {
        (0..S::DIMENSION)
            .map(|axis| self.upper.get(axis) - self.lower.get(axis))
            .product()
    }

    /// Returns the requested radii \[m\].
    fn radii(&self) -> Result<Vec<f64>, Error> {
        let fraction = match self.stop {
            Stop::SolidFraction(fraction) => fraction,
            Stop::Coordination(_) | Stop::Overlap(_) => self.solid_fraction,
        };
        if !(fraction > 0.0 && fraction < 1.0) {
            return Err(Error::Numerical(format!(
                "a packing cannot have a solid fraction of {fraction}; it must lie between 0 and 1"
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
                            "grains of radius {radius} m cannot fill the box: at most 5e7 grains with a radius \
                             above 0 can grow"
                        )));
                    }
                    // The last grain is included only if it brings the sum closer to the target.
                    if filled + 0.5 * S::measure(radius) > wanted && !radii.is_empty() {
                        break;
                    }
                    filled += S::measure(radius);
                    radii.push(radius);
                }
            }
        }
        if radii.is_empty() || radii.iter().any(|r| !(*r > 0.0 && r.is_finite())) {
            return Err(Error::Numerical(
                "there are no grains to pack, or the radius of one is not above 0".into(),
            ));
        }
        Ok(radii)
    }
}

/// Progress of a packing: the state, in addition to grains and contacts, that the next steps depend on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// Current sizes divided by the requested sizes.
    factor: f64,
    /// Relative growth at the next loss of contacts of a packing.
    growth: f64,
    /// Number of losses of contacts so far.
    #[serde(default)]
    losses: u32,
    stage: Stage,
    /// Number of steps of the present batch, and number of remaining ones.
    batch: u64,
    left: u64,
}

/// Stage of the present batch of steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Stage {
    /// Growth in small stages.
    Grow,
    /// Relaxation in rounds.
    Rest {
        /// Purpose of the relaxation.
        purpose: Purpose,
        /// Number of rounds before this one, and number of successive rounds in which the packing had no contacts.
        rounds: u32,
        apart: u32,
        /// Number of steps of this round, and its maximum number of steps.
        taken: u64,
        limit: u64,
    },
    /// The packing is complete.
    Done,
}

/// Purpose of a relaxation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Purpose {
    /// Final relaxation at the requested sizes.
    Last,
    /// Relaxation before a coarse correction of the overlaps.
    Coarse,
    /// Relaxation before a fine correction of the overlaps.
    Fine,
}

/// Packing in progress.
struct Growing<'a, S: Space> {
    settings: &'a PackingSettings<S>,
    supervision: &'a Supervision<'a, S>,
    /// Requested radii (m), by id.
    radii: Vec<f64>,
    mean_diameter: f64,
    progress: Progress,
    dem: Dem<S>,
    particles: Particles<S>,
}

impl<'a, S: Space> Growing<'a, S> {
    fn new(
        settings: &'a PackingSettings<S>,
        radii: Vec<f64>,
        supervision: &'a Supervision<'a, S>,
    ) -> Result<Self, Error> {
        let places = scatter(settings, &radii)?;
        let mut particles = Particles::new();
        for (id, (radius, position)) in (0..).zip(radii.iter().zip(places)) {
            // Masses are those of the final sizes during the whole growth.
            let body = Body {
                radius: radius * CLOUD,
                ..Body::uniform::<S>(id, *radius, settings.density, 0)
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
            losses: 0,
            stage: Stage::Grow,
            batch: 0,
            left: 0,
        };
        let mut growth = Self::with(settings, radii, supervision, progress, particles)?;
        growth.grow();
        Ok(growth)
    }

    /// Continues from the saved state of an earlier attempt.
    fn resume(
        settings: &'a PackingSettings<S>,
        radii: Vec<f64>,
        supervision: &'a Supervision<'a, S>,
        saved: SavedSample<S>,
    ) -> Result<Self, Error> {
        let wrong = |what: String| {
            Error::Io(format!(
                "the saved growth of the sample cannot be used: {what}"
            ))
        };
        let progress: Progress =
            serde_json::from_value(saved.progress).map_err(|e| wrong(e.to_string()))?;
        if saved.particles.owned() != radii.len() {
            return Err(wrong(format!(
                "it holds {} grains, and the case has {}",
                saved.particles.owned(),
                radii.len()
            )));
        }
        let mut growth = Self::with(settings, radii, supervision, progress, saved.particles)?;
        growth.dem.restore(&saved.contacts)?;
        growth.dem.prepare(&mut growth.particles, &alone())?;
        if let Stage::Rest { .. } = progress.stage {
            growth.dem.set_local_damping(AT_REST);
        }
        Ok(growth)
    }

    fn with(
        settings: &'a PackingSettings<S>,
        radii: Vec<f64>,
        supervision: &'a Supervision<'a, S>,
        progress: Progress,
        particles: Particles<S>,
    ) -> Result<Self, Error> {
        let mean_diameter = 2.0 * radii.iter().sum::<f64>() / real(radii.len());
        let parameters = LinearParameters {
            normal_stiffness: Scaled::PerDiameter(settings.stiffness_per_diameter),
            stiffness_ratio: 0.4,
            friction: settings.friction,
            normal_damping_ratio: 0.2,
            shear_damping_ratio: 0.2,
            attraction: false,
        };
        let law = Law::Linear(Linear {
            parameters: PairTable::uniform(1, parameters),
        });
        let grown: Vec<Body> = radii
            .iter()
            .map(|radius| Body::uniform::<S>(0, *radius, settings.density, 0))
            .collect();
        let time_step = 0.2 * law.critical_time_step::<S>(&grown, 1);
        let region = GrainDomain {
            lower: settings.lower,
            upper: settings.upper,
            periodic: settings.periodic,
            spacing: settings.upper.get(0) - settings.lower.get(0),
            exits: [[false; 2]; 3],
        };
        let mut of_engine = DemSettings::new(region, time_step, 0.1 * mean_diameter);
        of_engine.local_damping = WHILE_GROWING;
        let closed = settings.periodic.map(|periodic| !periodic);
        let dem = Dem::new(
            law,
            of_engine,
            Wall::of_box(settings.lower, settings.upper, closed, 0),
        )?;
        Ok(Self {
            settings,
            supervision,
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
            let asked = self.radii[to_usize(self.particles.body[k].id)];
            self.particles.set_radius(k, asked * factor);
        }
    }

    /// Returns the properties of the packing, without the unbalanced force.
    fn measure(&self) -> PackingReport {
        let count = self.particles.owned();
        let mut touches = vec![0_usize; count];
        let (mut contacts, mut sum, mut largest) = (0.0, 0.0, 0.0_f64);
        self.dem.for_each_contact(&self.particles, |contact| {
            touches[contact.grain] += 1;
            if let Some(other) = contact.other {
                // An image represents its grain.
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
        let ends = real(holding().sum::<usize>());
        PackingReport {
            grains: count as u64,
            size_factor: self.progress.factor,
            solid_fraction: self
                .radii
                .iter()
                .map(|r| S::measure(r * self.progress.factor))
                .sum::<f64>()
                / self.settings.box_measure(),
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

    /// Runs batches of steps, each followed by the choice of the next stage, until the packing is complete.
    fn run(&mut self) -> Result<(), Error> {
        while self.progress.stage != Stage::Done {
            while self.progress.left > 0 {
                let left = &mut self.progress.left;
                self.supervision
                    .advance(&mut self.dem, &mut self.particles, left)?;
                self.supervision.listen(&self.dem, &self.particles, || {
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
                let still = self.dem.equilibrium_state(&self.particles, &alone());
                if taken < limit && still.unbalanced() > self.tolerance(purpose) {
                    self.progress.stage = Stage::Rest {
                        purpose,
                        rounds,
                        apart,
                        taken,
                        limit,
                    };
                    self.batch(CHECK_EVERY.min(limit - taken));
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

    /// Returns the sizes at which growth ends, divided by the requested ones.
    fn full_size(&self) -> f64 {
        match self.settings.stop {
            Stop::SolidFraction(_) => 1.0,
            Stop::Coordination(_) | Stop::Overlap(_) => f64::INFINITY,
        }
    }

    /// Starts the next stage of growth, to the requested sizes or until the packing jams.
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
            let now = self.measure();
            let crowded = now.mean_overlap > 0.5 * STAGE_GROWTH;
            let done = match self.settings.stop {
                Stop::Coordination(wanted) => now.coordination >= wanted,
                Stop::Overlap(_) => now.coordination >= JAMMED,
                Stop::SolidFraction(_) => false,
            };
            grown = crowded && done;
        }
        match self.settings.stop {
            _ if !grown => self.grow(),
            Stop::SolidFraction(_) => self.rest(Purpose::Last),
            Stop::Coordination(_) | Stop::Overlap(_) => self.rest(Purpose::Coarse),
        }
        Ok(())
    }

    /// Returns the unbalanced force below which the packing counts as relaxed.
    fn tolerance(&self, purpose: Purpose) -> f64 {
        match purpose {
            Purpose::Coarse => COARSE,
            Purpose::Last | Purpose::Fine => self.settings.unbalanced,
        }
    }

    /// Starts a relaxation.
    fn rest(&mut self, purpose: Purpose) {
        self.round(purpose, 0, 0);
    }

    fn round(&mut self, purpose: Purpose, rounds: u32, apart: u32) {
        let left = self.settings.limit.saturating_sub(self.dem.steps());
        let limit = left.clamp(1, 1000);
        self.progress.stage = Stage::Rest {
            purpose,
            rounds,
            apart,
            taken: 0,
            limit,
        };
        self.dem.set_local_damping(AT_REST);
        self.batch(CHECK_EVERY.min(limit));
    }

    fn after_round(
        &mut self,
        purpose: Purpose,
        rounds: u32,
        apart: u32,
        unbalanced: f64,
    ) -> Result<(), Error> {
        self.check_limit()?;
        let (now, balanced) = (self.measure(), unbalanced <= self.tolerance(purpose));
        let mut jammed = now.coordination >= JAMMED;
        if self.progress.losses >= MOST_LOSSES {
            // Friction lets forces balance with fewer contacts than grow a packing, and small samples have walls.
            jammed |= balanced && now.coordination >= carrying::<S>();
        }
        let apart = if jammed { 0 } else { apart + 1 };
        if jammed && balanced {
            self.after_rest(purpose, true);
        } else if apart == 3 || rounds + 1 == ROUNDS {
            // The packing has lost its contacts, or does not relax.
            self.after_rest(purpose, false);
        } else {
            self.round(purpose, rounds + 1, apart);
        }
        Ok(())
    }

    /// Reduces the mean overlap stepwise to the requested value, if the sizes are free.
    fn after_rest(&mut self, purpose: Purpose, jammed: bool) {
        let target = match self.settings.stop {
            Stop::SolidFraction(_) => {
                self.progress.stage = Stage::Done;
                return;
            }
            Stop::Overlap(overlap) => overlap,
            Stop::Coordination(_) => self.settings.overlap,
        };
        let now = self.measure();
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
        // Overlaps change about in proportion to sizes; one correction reduces them by at most two thirds. A
        // packing that lost its contacts was supported by motion only: it is compressed well beyond the target,
        // where it relaxes quickly, and released again.
        let change = if jammed {
            self.progress.growth = 64.0 * target;
            (now.mean_overlap / 3.0).max(target) - now.mean_overlap
        } else {
            self.progress.losses = self.progress.losses.saturating_add(1);
            self.progress.growth = (2.0 * self.progress.growth).min(8.0 * STAGE_GROWTH);
            0.5 * self.progress.growth
        };
        self.set_factor(self.progress.factor * (1.0 + change));
        self.rest(Purpose::Coarse);
    }

    fn check_limit(&self) -> Result<(), Error> {
        self.supervision.report(|| {
            let now = self.measure();
            format!(
                "{} grains growing: {} solid steps, sizes x {:.4}, solid fraction {:.4}, {:.2} contacts each, mean \
                 overlap {:.1e} d",
                self.particles.owned(),
                self.dem.steps(),
                self.progress.factor,
                now.solid_fraction,
                now.coordination,
                now.mean_overlap
            )
        });
        if self.dem.steps() < self.settings.limit {
            return Ok(());
        }
        let now = self.measure();
        Err(Error::Numerical(format!(
            "no packing within {} steps: solid fraction {:.4}, {:.2} contacts per grain, mean overlap {:.2e} \
             diameters; \
             use a smaller `friction_angle_degrees` of the growth, such as 20, or another seed",
            self.settings.limit, now.solid_fraction, now.coordination, now.mean_overlap
        )))
    }

    fn packing(self) -> Result<Packing<S>, Error> {
        let still = self.dem.equilibrium_state(&self.particles, &alone());
        let report = PackingReport {
            unbalanced: still.unbalanced(),
            ..self.measure()
        };
        let mut grains: Vec<PackedGrain<S>> = (0..self.particles.owned())
            .map(|k| PackedGrain {
                position: self.particles.location(k),
                radius: self.particles.body[k].radius,
            })
            .collect();
        put_neighbours_together(&mut grains, self.settings, 2.0 * self.mean_diameter);
        Ok(Packing { grains, report })
    }
}

/// Number of contacts per grain below which a growing packing is not jammed.
const JAMMED: f64 = 3.0;

/// Number of losses of contacts after which fewer contacts are accepted if the forces balance.
const MOST_LOSSES: u32 = 80;

/// Returns the number of contacts per grain from which on a packing whose forces balance is jammed: three quarters of
/// the d + 1 contacts that frictional grains in d dimensions need at least in a large sample. Contacts with walls count
/// once, so that the mean of a small sample lies below.
fn carrying<S: Space>() -> f64 {
    if S::DIMENSION == 2 { 2.25 } else { 3.0 }
}

/// Unbalanced force below which a packing counts as relaxed between changes of size.
const COARSE: f64 = 1e-2;
/// Local damping during growth and during relaxation.
const WHILE_GROWING: f64 = 0.3;
const AT_REST: f64 = 0.7;
/// Number of steps between checks of a relaxing packing, and maximum number of rounds of up to a thousand steps.
const CHECK_EVERY: u64 = 100;
const ROUNDS: u32 = 40;
#[cfg(test)]
mod tests {
    use super::super::supervision::tests::interrupted;
    use super::*;
    use decomposition::Domain;
    use dem::contact::cohesive_frictional::{self, CohesiveFrictional};
    use dem::{EquilibriumState, PlaneSpace, Relaxation, Volume};
    use nalgebra::{Vector2, Vector3};

    /// Advances with damping until the grains are stationary, and restores the damping.
    fn relax<S: Space>(
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
        until: &Relaxation,
    ) -> EquilibriumState {
        let damping = dem.settings().local_damping;
        dem.set_local_damping(until.local_damping);
        let mut steps = 0;
        let still = loop {
            let batch = until.check_every.max(1).min(until.limit - steps);
            dem.advance_many(particles, domain, batch).unwrap();
            steps += batch;
            let now = dem.equilibrium_state(particles, domain);
            if steps >= until.limit || now.unbalanced() <= until.tolerance {
                break now;
            }
        };
        dem.set_local_damping(damping);
        still
    }

    fn small() -> PackingSettings<PlaneSpace> {
        PackingSettings {
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

    /// Checks that a packing is jammed and stationary at the requested overlap, and that it remains stationary when
    /// bonded and cut, without a broken bond.
    #[test]
    fn a_packing_stands_still_when_bonded_and_cut() {
        let settings = small();
        let mut packing = settings.pack(&Supervision::without_requests()).unwrap();
        let report = packing.report;
        assert!((0.80..0.87).contains(&report.solid_fraction), "{report:?}");
        assert!((3.2..4.6).contains(&report.coordination), "{report:?}");
        assert!((2e-7..5e-6).contains(&report.mean_overlap), "{report:?}");
        assert!((0.95..1.05).contains(&report.size_factor), "{report:?}");
        assert!(report.unbalanced <= 1e-2, "{report:?}");
        for grain in &packing.grains {
            for axis in 0..2 {
                let x = grain.position[axis];
                assert!(x > 0.99 * grain.radius && x < settings.upper[axis] - 0.99 * grain.radius);
            }
        }
        let before = packing.grains.len();
        let [low, high] = [Vector2::new(0.0, 1.3e-3), Vector2::new(4e-3, 1.7e-3)];
        packing.grains.retain(|grain| {
            let nearest = grain.position.zip_zip_map(&low, &high, f64::clamp);
            (grain.position - nearest).norm() >= grain.radius
        });
        let cut = before - packing.grains.len();
        assert!(cut > 20);

        let parameters = cohesive_frictional::CohesiveFrictionalParameters {
            linear: LinearParameters {
                normal_stiffness: Scaled::PerDiameter(150e6),
                stiffness_ratio: 0.4,
                friction: 20.0_f64.to_radians().tan(),
                normal_damping_ratio: 0.0,
                shear_damping_ratio: 0.0,
                attraction: false,
            },
            cohesion: Scaled::PerDiameter(0.506),
        };
        let law = Law::CohesiveFrictional(CohesiveFrictional {
            parameters: PairTable::uniform(1, parameters),
        });
        let mut particles = Particles::<PlaneSpace>::new();
        for (id, grain) in (0..).zip(&packing.grains) {
            let body = Body::uniform::<PlaneSpace>(id, grain.radius, 2650.0, 0);
            particles.insert(
                body,
                Motion {
                    position: grain.position,
                    ..Motion::default()
                },
            );
        }
        let limit = law.critical_time_step::<PlaneSpace>(&particles.body, 1);
        let of_engine = DemSettings::new(
            GrainDomain::closed(settings.lower, settings.upper, 1e-4),
            0.2 * limit,
            2e-5,
        );
        let walls = Wall::of_box(settings.lower, settings.upper, [true, true, false], 0);
        let mut dem = Dem::new(law, of_engine, walls).unwrap();
        let bonds = dem
            .bond_existing_contacts(&mut particles, &alone())
            .unwrap();
        assert!(bonds > 300, "{bonds}");
        let until = Relaxation {
            limit: 20_000,
            ..Relaxation::default()
        };
        let still = relax(&mut dem, &mut particles, &alone(), &until);
        assert!(still.unbalanced() < 1e-3, "{still:?}");
        assert!(dem.take_breaks().is_empty());
        assert_eq!(dem.statistics(&particles).bonds, bonds);
        for (k, grain) in packing.grains.iter().enumerate() {
            assert!((particles.motion[k].position - grain.position).norm() < 1e-8);
        }
    }

    #[test]
    fn a_packing_that_is_interrupted_comes_to_the_same_bits() {
        let settings = PackingSettings {
            upper: Vector2::new(2e-3, 1.5e-3),
            periodic: [true, false, false],
            friction: 0.3,
            ..small()
        };
        let straight = settings.pack(&Supervision::without_requests()).unwrap();
        let (packing, stops) = interrupted(|supervision| settings.pack(supervision));
        assert!(stops > 10, "{stops}");
        assert_eq!(packing, straight);
        let given = PackingSettings {
            stop: Stop::SolidFraction(0.845),
            ..settings
        };
        let (packing, _) = interrupted(|supervision| given.pack(supervision));
        assert_eq!(
            packing,
            given.pack(&Supervision::without_requests()).unwrap()
        );
    }

    #[test]
    fn a_packing_of_given_solid_fraction_has_the_asked_sizes() {
        let settings = PackingSettings {
            stop: Stop::SolidFraction(0.845),
            periodic: [true, false, false],
            ..small()
        };
        let packing = settings.pack(&Supervision::without_requests()).unwrap();
        let report = packing.report;
        assert!((report.size_factor - 1.0).abs() < f64::EPSILON);
        assert!((report.solid_fraction - 0.845).abs() < 2e-3, "{report:?}");
        assert!(
            report.mean_overlap > 0.0 && report.largest_overlap < 0.05,
            "{report:?}"
        );
        let mut asked = settings.radii().unwrap();
        let mut found: Vec<f64> = packing.grains.iter().map(|grain| grain.radius).collect();
        asked.sort_by(f64::total_cmp);
        found.sort_by(f64::total_cmp);
        assert_eq!(asked, found);
        assert_eq!(
            packing,
            settings.pack(&Supervision::without_requests()).unwrap(),
            "the same seed gives the same bits"
        );
        assert!(
            packing
                != PackingSettings {
                    seed: 12,
                    ..settings
                }
                .pack(&Supervision::without_requests())
                .unwrap()
        );
    }

    #[test]
    fn spheres_pack_to_a_coordination() {
        let settings = PackingSettings::<Volume> {
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
        let report = settings
            .pack(&Supervision::without_requests())
            .unwrap()
            .report;
        assert!((0.57..0.68).contains(&report.solid_fraction), "{report:?}");
        assert!((4.0..7.5).contains(&report.coordination), "{report:?}");
    }
}
