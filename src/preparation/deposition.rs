//! Deposition under gravity: a loose random cloud of grains falls onto the walls, settles and is trimmed to a level.
//!
//! Sizes follow a [`Grading`]. Random sequential addition, the largest grain first, places the cloud in a box above
//! the walls, outside structures and their closed hollows ([`super::free_space`]). Grains count as settled if their
//! mean kinetic energy is a small fraction of m g d and the mean resultant on a grain is a small fraction of the mean
//! contact force; or if no force is left that could change their motion, because a sphere that spins about the normal
//! of its only contact has no resistance. Contacts may be softer while the grains fall, which allows longer time
//! steps; the stiffness increases to that of the case in factors of ten, with a relaxation after each. Grains above
//! the level are removed last, and the remaining ones settle once more. The deposition runs on one rank and depends
//! on the seed only. Sizes and places come from counter-based random numbers: [`base::random`].

use serde::{Deserialize, Serialize};

use super::free_space::FreeSpace;
use super::numbering::curve_order;
use super::supervision::{SavedSample, Supervision};
use base::error::Error;
use base::number::{floor_i64, whole};
use base::random::Stream;
use dem::relax::unbalanced_text;
use dem::{
    Body, Components, Dem, DemSettings, GrainDomain, Kind, Law, Motion, Particles, Space, Wall,
    alone,
};
use plan::scene::grading::Grading;

/// Part of the limit of the unbalanced force below which no force changes the motion of a grain.
const UNDRIVEN: f64 = 1e-3;

/// Cloud of grains that falls from a box.
#[derive(Clone, Debug)]
pub struct Cloud<S: Space> {
    /// Lower corner of the box (m).
    pub lower: S::Vector,
    /// Upper corner of the box (m).
    pub upper: S::Vector,
    /// Grain-size distribution.
    pub grading: Grading,
    /// Number of grains.
    pub number: usize,
    /// Density (kg/m³).
    pub density: f64,
    /// Row of the grains in the table of contact parameters.
    pub material: u32,
}

/// Grains that fall, the bodies that they fall onto, and the criterion for their settling.
#[derive(Clone, Debug)]
pub struct Deposition<S: Space> {
    /// Clouds of grains. Clouds of one material have the same density.
    pub clouds: Vec<Cloud<S>>,
    /// Box that the grains may not leave.
    pub region: GrainDomain<S>,
    /// Walls onto which the grains fall.
    pub walls: Vec<Wall<S>>,
    /// Space outside the structures.
    pub free_space: FreeSpace,
    /// Seed of sizes and positions.
    pub seed: u64,
    /// Contact laws from the softest to that of the case.
    pub laws: Vec<Law>,
    /// Number of materials in the contact laws.
    pub materials: u32,
    /// Gravity (m/s²).
    pub gravity: S::Vector,
    /// Non-viscous damping during the fall; at least 0.7 after landing.
    pub local_damping: f64,
    /// Height of a centre above which a grain is removed, along the axis against gravity (m).
    pub trim_above: Option<f64>,
    /// Maximum mean kinetic energy of settled grains divided by m g d.
    pub kinetic_energy: f64,
    /// Maximum mean resultant on a settled grain divided by the mean contact force.
    pub unbalanced: f64,
    /// Maximum number of solid steps per relaxation.
    pub limit: u64,
    /// Solid time step divided by the critical one of the contact law.
    pub step_ratio: f64,
}

/// Grain of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedGrain<S: Space> {
    /// Centre (m).
    pub position: S::Vector,
    /// Radius (m).
    pub radius: f64,
    /// Row in the table of contact parameters.
    pub material: u32,
}

/// One check of the settling of the grains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SettlingCheck {
    /// Steps since the grains began to fall.
    pub steps: u64,
    /// Mean kinetic energy divided by m g d of the mean grain.
    pub kinetic_energy: f64,
    /// Mean resultant force on a grain divided by the mean normal force of a contact; without contacts the largest
    /// number, as JSON null.
    #[serde(serialize_with = "or_null", deserialize_with = "or_largest")]
    pub unbalanced: f64,
}

/// Result of the deposition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DepositionReport {
    /// Number of grains that fell.
    pub fallen: u64,
    /// Number of grains that remain after trimming.
    pub grains: u64,
    /// Height of the highest point of a grain, along the axis against gravity (m).
    pub top: f64,
    /// Mean number of contacts per grain, including those with walls.
    pub coordination: f64,
    /// Largest overlap divided by the smaller diameter.
    pub largest_overlap: f64,
    /// `true` if all relaxations ended by the criterion rather than by the limit of steps.
    pub settled: bool,
    /// Kinetic energy and force balance during the deposition.
    pub convergence: Vec<SettlingCheck>,
}

const PLACES: u32 = 12;
/// Local damping of grains that have landed.
const AT_REST: f64 = 0.7;
const LANDED: f64 = 0.1;
/// Steps between checks.
const CHECK_EVERY: u64 = 500;

impl<S: Space> Deposition<S> {
    /// Returns `true` if the grains of a state have settled.
    fn holds_at_rest(&self, now: &SettlingCheck) -> bool {
        let still = now.kinetic_energy <= self.kinetic_energy;
        let undriven = now.unbalanced <= UNDRIVEN * self.unbalanced;
        undriven || (still && now.unbalanced <= self.unbalanced)
    }

    /// Runs the deposition. Returns centres and radii \[m\], ordered along a space-filling curve.
    ///
    /// # Errors
    /// If the grading or cloud cannot be met, gravity is not along an axis, or a grain is lost; [`Error::Stopped`] if
    /// the caller requests a stop.
    pub fn run(
        &self,
        supervision: &Supervision<'_, S>,
    ) -> Result<(Vec<PlacedGrain<S>>, DepositionReport), Error> {
        let (axis, up) = self.height_axis()?;
        let mut falling = match supervision.take_saved() {
            Some(saved) => Falling::resume(self, supervision, saved)?,
            None => Falling::begin(self, supervision)?,
        };
        let last = self.laws.len().saturating_sub(1);
        loop {
            let mut grains = falling.settle()?;
            let progress = &mut falling.progress;
            if progress.stage < last {
                progress.stage += 1;
            } else if let Some(level) = self.trim_above
                && !progress.trimmed
            {
                progress.trimmed = true;
                let before = grains.len();
                grains.retain(|grain| grain.position.get(axis) * up <= level * up);
                if grains.is_empty() {
                    return Err(Error::Numerical(format!(
                        "all {before} grains settled above the trimming level of {level} m and would be removed \
                         (grains.initial.deposition.trim_above): raise the level"
                    )));
                }
                if grains.len() == before {
                    return Ok(self.finished_sample(&grains, falling.progress.report, axis, up));
                }
            } else {
                return Ok(self.finished_sample(&grains, falling.progress.report, axis, up));
            }
            falling.start(grains)?;
        }
    }

    /// Returns the grains in the order of the curve, and the report.
    fn finished_sample(
        &self,
        grains: &[PlacedGrain<S>],
        mut report: DepositionReport,
        axis: usize,
        up: f64,
    ) -> (Vec<PlacedGrain<S>>, DepositionReport) {
        let places: Vec<S::Vector> = grains.iter().map(|grain| grain.position).collect();
        let grains: Vec<_> = curve_order::<S>(&places)
            .iter()
            .map(|&k| grains[k])
            .collect();
        report.grains = grains.len() as u64;
        report.top = up
            * grains
                .iter()
                .map(|grain| grain.position.get(axis) * up + grain.radius)
                .fold(f64::NEG_INFINITY, f64::max);
        (grains, report)
    }

    fn law(&self, stage: usize) -> Result<&Law, Error> {
        self.laws
            .get(stage)
            .ok_or_else(|| Error::Internal(format!("deposition has no law {stage}")))
    }

    /// Returns stationary grains at these positions.
    fn particles(&self, grains: Vec<PlacedGrain<S>>) -> (Particles<S>, Vec<Body>) {
        let mut particles = Particles::new();
        let mut bodies = Vec::with_capacity(grains.len());
        for (id, grain) in (0..).zip(grains) {
            let PlacedGrain {
                position,
                radius,
                material,
            } = grain;
            let cloud = self.clouds.iter().find(|cloud| cloud.material == material);
            let density = cloud.map_or(1.0, |cloud| cloud.density);
            let body = Body::uniform::<S>(id, radius, density, material);
            bodies.push(body);
            particles.insert(
                body,
                Motion {
                    position,
                    ..Motion::default()
                },
            );
        }
        (particles, bodies)
    }

    /// Returns the axis of gravity, and the sign of the upward direction.
    fn height_axis(&self) -> Result<(usize, f64), Error> {
        let mut along = (0..S::DIMENSION).filter(|&axis| self.gravity.get(axis).abs() > 0.0);
        match (along.next(), along.next()) {
            (Some(axis), None) => Ok((axis, -self.gravity.get(axis).signum())),
            _ => Err(Error::Numerical(
                "deposition needs gravity along one axis of the domain".into(),
            )),
        }
    }

    /// Returns a position for each grain without overlap with grains or walls; the largest grain is placed first.
    /// `first`: the first grain of each cloud.
    fn cloud(&self, radii: &[f64], first: &[usize]) -> Result<Vec<S::Vector>, Error> {
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        // One grid for each factor of two in size, as in the neighbour search.
        let level = |radius: f64| whole((largest / radius).log2().max(0.0));
        let levels = level(smallest) + 1;
        let mut grids: Vec<std::collections::HashMap<[i64; 3], Vec<usize>>> =
            vec![std::collections::HashMap::new(); levels];
        let size = |level: usize| 2.0 * largest * 0.5_f64.powi(i32::try_from(level).unwrap_or(60));
        let cell = |at: &S::Vector, reach: f64, level: usize| -> [i64; 3] {
            std::array::from_fn(|axis| {
                if axis < S::DIMENSION {
                    floor_i64((at.get(axis) + reach) / size(level))
                } else {
                    0
                }
            })
        };
        let mut order: Vec<usize> = (0..radii.len()).collect();
        order.sort_by(|a, b| radii[*b].total_cmp(&radii[*a]).then(a.cmp(b)));
        let mut places = vec![S::Vector::default(); radii.len()];
        for &id in &order {
            let radius = radii[id];
            let cloud = &self.clouds[first.partition_point(|first| *first <= id) - 1];
            let mut draws = Stream::new(self.seed, id as u64, PLACES);
            let free = (0..5000).find_map(|_| {
                let mut at = S::Vector::default();
                for axis in 0..S::DIMENSION {
                    let low = cloud.lower.get(axis) + radius;
                    let high = cloud.upper.get(axis) - radius;
                    at.set(axis, low + (high - low).max(0.0) * draws.uniform());
                }
                let mut walls = self.walls.iter().filter(|wall| !wall.open);
                let clear_of_walls = walls.all(|wall| match &wall.surface {
                    None => wall.distance(&at) >= radius,
                    Some(surface) => !surface.is_within(&S::to_volume(&at), radius),
                });
                let point = S::to_volume(&at).into();
                let clear = clear_of_walls
                    && self.free_space.has_space_for(point, radius)
                    && (0..levels).all(|level| {
                        let reach = radius + 0.5 * size(level);
                        let (low, high) = (cell(&at, -reach, level), cell(&at, reach, level));
                        (low[2]..=high[2]).all(|z| {
                            (low[1]..=high[1]).all(|y| {
                                (low[0]..=high[0]).all(|x| {
                                    grids[level].get(&[x, y, z]).is_none_or(|members| {
                                        members.iter().all(|&other| {
                                            (places[other] - at).length() >= radius + radii[other]
                                        })
                                    })
                                })
                            })
                        })
                    });
                clear.then_some(at)
            });
            let Some(at) = free else {
                return Err(Error::Numerical(format!(
                    "the cloud has no free position for a grain of radius {radius} m: use a larger box or fewer \
                     grains"
                )));
            };
            places[id] = at;
            let level = level(radius);
            grids[level]
                .entry(cell(&at, 0.0, level))
                .or_default()
                .push(id);
        }
        Ok(places)
    }

    /// Returns the settings of a relaxation under a contact law, with the time step of the stiffest contacts.
    fn dem(&self, law: &Law, bodies: &[Body], landed: bool) -> Result<Dem<S>, Error> {
        let smallest = bodies
            .iter()
            .map(|b| b.radius)
            .fold(f64::INFINITY, f64::min);
        let time_step = self.step_ratio * law.critical_time_step::<S>(bodies, self.materials);
        let mut settings = DemSettings::new(self.region, time_step, 0.3 * smallest);
        settings.gravity = self.gravity;
        settings.local_damping = self.damping(landed);
        Dem::new(law.clone(), settings, self.walls.clone())
    }

    /// Returns the damping: low for falling grains, which must not float; at least 0.7 for landed grains, which
    /// settles them fastest.
    fn damping(&self, landed: bool) -> f64 {
        if landed {
            self.local_damping.max(AT_REST)
        } else {
            self.local_damping
        }
    }

    fn check(&self, dem: &Dem<S>, particles: &Particles<S>, began: u64) -> SettlingCheck {
        let (mut energy, mut scale, mut resultant, mut grains) = (0.0, 0.0, 0.0, 0.0);
        let g = self.gravity.length();
        for k in (0..particles.owned()).filter(|&k| particles.body[k].kind == Kind::Free) {
            let body = &particles.body[k];
            energy += particles.kinetic_energy(k);
            scale += body.mass * g * 2.0 * body.radius;
            resultant += (particles.contact[k].force + self.gravity * body.mass).length();
            grains += 1.0;
        }
        let (mut force, mut contacts) = (0.0, 0.0);
        dem.for_each_contact(particles, |contact| {
            force += contact.normal_force;
            contacts += 1.0;
        });
        // There is no balance of forces before grains have landed.
        let balance = |a: f64, b: f64| if b > 0.0 { a / b } else { f64::MAX };
        SettlingCheck {
            steps: began + dem.steps(),
            kinetic_energy: balance(energy, scale),
            unbalanced: balance(resultant * contacts, force * grains),
        }
    }
}

/// Serialises a ratio as a number, or as null if its denominator is zero.
fn or_null<T: serde::Serializer>(share: &f64, to: T) -> Result<T::Ok, T::Error> {
    Some(*share).filter(|share| *share < f64::MAX).serialize(to)
}

/// Reads the output of [`or_null`].
fn or_largest<'de, T: serde::Deserializer<'de>>(from: T) -> Result<f64, T::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::MAX))
}

/// Progress of the deposition: the state, in addition to grains and contacts, that the next steps depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Progress {
    /// Index of the contact law, from the softest.
    stage: usize,
    trimmed: bool,
    landed: bool,
    /// Number of steps before this relaxation.
    began: u64,
    /// Number of steps until the next check.
    left: u64,
    report: DepositionReport,
}

/// Deposition in progress.
struct Falling<'a, S: Space> {
    deposition: &'a Deposition<S>,
    supervision: &'a Supervision<'a, S>,
    progress: Progress,
    particles: Particles<S>,
    dem: Dem<S>,
}

impl<'a, S: Space> Falling<'a, S> {
    fn begin(
        deposition: &'a Deposition<S>,
        supervision: &'a Supervision<'a, S>,
    ) -> Result<Self, Error> {
        let (mut radii, mut first, mut materials) = (Vec::new(), Vec::new(), Vec::new());
        for cloud in &deposition.clouds {
            let from = (deposition.seed, radii.len());
            let more = cloud.grading.radii(cloud.number, S::DIMENSION, from);
            first.push(radii.len());
            radii.extend(more.map_err(|e| Error::Numerical(e.to_string()))?);
            materials.resize(radii.len(), cloud.material);
        }
        let progress = Progress {
            stage: 0,
            trimmed: false,
            landed: false,
            began: 0,
            left: 0,
            report: DepositionReport {
                fallen: radii.len() as u64,
                settled: true,
                ..DepositionReport::default()
            },
        };
        let places = deposition.cloud(&radii, &first)?;
        let grains: Vec<PlacedGrain<S>> = curve_order::<S>(&places)
            .into_iter()
            .map(|k| PlacedGrain {
                position: places[k],
                radius: radii[k],
                material: materials[k],
            })
            .collect();
        let (particles, bodies) = deposition.particles(grains);
        let mut falling = Self {
            dem: deposition.dem(deposition.law(0)?, &bodies, false)?,
            deposition,
            supervision,
            progress,
            particles,
        };
        falling.progress.left = CHECK_EVERY.min(deposition.limit);
        Ok(falling)
    }

    /// Continues from the saved state of an earlier attempt.
    fn resume(
        deposition: &'a Deposition<S>,
        supervision: &'a Supervision<'a, S>,
        saved: SavedSample<S>,
    ) -> Result<Self, Error> {
        let progress: Progress = serde_json::from_value(saved.progress)
            .map_err(|e| Error::Io(format!("the saved deposition cannot be used: {e}")))?;
        let mut particles = saved.particles;
        let bodies = particles.body[..particles.owned()].to_vec();
        let mut dem = deposition.dem(deposition.law(progress.stage)?, &bodies, progress.landed)?;
        dem.restore(&saved.contacts)?;
        dem.prepare(&mut particles, &alone())?;
        Ok(Self {
            deposition,
            supervision,
            progress,
            particles,
            dem,
        })
    }

    /// Starts a new relaxation of these grains under the contact law of the present stage.
    fn start(&mut self, grains: Vec<PlacedGrain<S>>) -> Result<(), Error> {
        let convergence = &self.progress.report.convergence;
        self.progress.began = convergence.last().map_or(0, |look| look.steps);
        self.progress.landed = !convergence.is_empty();
        self.progress.left = CHECK_EVERY.min(self.deposition.limit);
        let (particles, bodies) = self.deposition.particles(grains);
        let law = self.deposition.law(self.progress.stage)?;
        self.dem = self.deposition.dem(law, &bodies, self.progress.landed)?;
        self.particles = particles;
        Ok(())
    }

    /// Runs until the grains have settled or the limit of steps is reached.
    fn settle(&mut self) -> Result<Vec<PlacedGrain<S>>, Error> {
        let deposition = self.deposition;
        loop {
            while self.progress.left > 0 {
                let left = &mut self.progress.left;
                self.supervision
                    .advance(&mut self.dem, &mut self.particles, left)?;
                self.supervision.listen(&self.dem, &self.particles, || {
                    serde_json::to_value(&self.progress).map_err(|e| Error::Internal(e.to_string()))
                })?;
            }
            let (dem, particles) = (&mut self.dem, &self.particles);
            let now = deposition.check(dem, particles, self.progress.began);
            let settled = deposition.holds_at_rest(&now);
            let report = &mut self.progress.report;
            report.convergence.push(now);
            self.supervision.report(|| {
                format!(
                    "{} grains falling: {} solid steps of at most {} at this stiffness, kinetic energy {:.1e} m g d \
                     (until {:.0e}), unbalanced force {} (until {:.0e})",
                    particles.owned(),
                    dem.steps(),
                    deposition.limit,
                    now.kinetic_energy,
                    deposition.kinetic_energy,
                    unbalanced_text(now.unbalanced),
                    deposition.unbalanced
                )
            });
            if !self.progress.landed && now.kinetic_energy < LANDED && now.unbalanced < LANDED {
                self.progress.landed = true;
                dem.set_local_damping(deposition.damping(true));
            }
            if settled || dem.steps() >= deposition.limit {
                report.settled &= settled;
                let statistics = dem.statistics(particles);
                report.coordination = 2.0 * ratio(statistics.contacts, statistics.owned);
                report.largest_overlap = statistics.largest_overlap;
                return Ok((0..particles.owned())
                    .map(|k| {
                        let body = &particles.body[k];
                        PlacedGrain {
                            position: particles.location(k),
                            radius: body.radius,
                            material: body.material,
                        }
                    })
                    .collect());
            }
            self.progress.left = CHECK_EVERY.min(self.deposition.limit - self.dem.steps());
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts far below 2^53")]
fn ratio(a: u64, b: u64) -> f64 {
    if b == 0 { 0.0 } else { a as f64 / b as f64 }
}
#[cfg(test)]
mod tests {
    use super::super::supervision::tests::interrupted;
    use super::*;
    use dem::contact::Scaled;
    use dem::contact::linear::{self, Linear};
    use dem::{PairTable, Volume};
    use nalgebra::Vector3;
    use plan::scene::grading::Class;

    fn classes() -> Vec<Class> {
        let class = |min: f64, max: f64, part| Class { min, max, part };
        vec![class(0.5e-3, 0.7e-3, 0.8), class(1.0e-3, 1.2e-3, 0.2)]
    }

    fn linear(stiffness: f64) -> Law {
        Law::Linear(Linear {
            parameters: PairTable::uniform(
                1,
                linear::LinearParameters {
                    normal_stiffness: Scaled::Absolute(stiffness),
                    stiffness_ratio: 1.0,
                    friction: 0.5,
                    normal_damping_ratio: 0.3,
                    shear_damping_ratio: 0.3,
                    attraction: false,
                },
            ),
        })
    }

    fn cloud(number: usize, classes: Vec<Class>) -> Cloud<Volume> {
        Cloud {
            lower: Vector3::new(0.0, 0.0, 0.01),
            upper: Vector3::new(0.012, 0.012, 0.05),
            grading: Grading::ByCount(classes),
            number,
            density: 2600.0,
            material: 0,
        }
    }

    fn small() -> Deposition<Volume> {
        let corner = Vector3::new(0.012, 0.012, 0.05);
        let region = GrainDomain::closed(Vector3::zeros(), corner, 1e-3);
        Deposition {
            clouds: vec![cloud(800, classes())],
            region,
            walls: Wall::of_box(Vector3::zeros(), corner, [true; 3], 0),
            free_space: FreeSpace::default(),
            seed: 3,
            laws: vec![linear(1e3), linear(1e4)],
            materials: 1,
            gravity: Vector3::new(0.0, 0.0, -9.81),
            local_damping: 0.2,
            trim_above: Some(8e-3),
            kinetic_energy: 1e-3,
            unbalanced: 0.02,
            limit: 60_000,
            step_ratio: 0.2,
        }
    }

    /// Checks that a bed in which one sphere spins without resistance has settled, and one in motion has not.
    #[test]
    fn spins_that_nothing_resists_do_not_keep_a_bed_from_settling() {
        let looks = |kinetic_energy, unbalanced| {
            let now = SettlingCheck {
                kinetic_energy,
                unbalanced,
                ..SettlingCheck::default()
            };
            small().holds_at_rest(&now)
        };
        let limits = small();
        assert!(looks(1.1 * limits.kinetic_energy, 1e-9));
        assert!(!looks(1.1 * limits.kinetic_energy, 0.1 * limits.unbalanced));
        assert!(looks(0.9 * limits.kinetic_energy, 0.1 * limits.unbalanced));
        assert!(!looks(0.9 * limits.kinetic_energy, 1.1 * limits.unbalanced));
    }

    #[test]
    fn a_cloud_without_room_is_refused() {
        let crowded = Deposition {
            clouds: vec![cloud(30_000, classes())],
            ..small()
        };
        assert!(
            crowded
                .run(&Supervision::without_requests())
                .unwrap_err()
                .to_string()
                .contains("no free position")
        );
    }

    #[test]
    fn an_interrupted_deposition_ends_with_the_same_bits() {
        let deposition = Deposition {
            clouds: vec![cloud(
                120,
                vec![Class {
                    min: 0.8e-3,
                    max: 1.1e-3,
                    part: 1.0,
                }],
            )],
            trim_above: Some(5e-3),
            ..small()
        };
        let (grains, report) = deposition.run(&Supervision::without_requests()).unwrap();
        assert!(report.grains < report.fallen, "{report:?}");
        let ((again, other), stops) = interrupted(|supervision| deposition.run(supervision));
        assert!(stops > 10, "{stops}");
        assert!(again == grains);
        assert_eq!(other, report);
    }

    #[test]
    fn layers_come_to_rest_one_above_the_other() {
        let class = |min: f64, max: f64| {
            vec![Class {
                min,
                max,
                part: 1.0,
            }]
        };
        let lower = Cloud {
            upper: Vector3::new(0.012, 0.012, 0.028),
            ..cloud(150, class(0.8e-3, 1.0e-3))
        };
        let upper = Cloud {
            lower: Vector3::new(0.0, 0.0, 0.028),
            material: 1,
            density: 3000.0,
            ..cloud(200, class(0.6e-3, 0.7e-3))
        };
        let deposition = Deposition {
            clouds: vec![lower, upper],
            materials: 2,
            trim_above: None,
            ..small()
        };
        let (grains, report) = deposition.run(&Supervision::without_requests()).unwrap();
        assert_eq!((report.fallen, grains.len()), (350, 350));
        let heights = |material: u32| {
            let own = grains
                .iter()
                .filter(move |grain| grain.material == material);
            own.map(|grain| grain.position[2]).collect::<Vec<_>>()
        };
        let mean =
            |heights: &[f64]| heights.iter().sum::<f64>() / base::number::real(heights.len());
        let (below, above) = (heights(0), heights(1));
        assert_eq!((below.len(), above.len()), (150, 200));
        assert!(mean(&above) > mean(&below) + 2e-3);
        // Almost no grain of the lower layer lies above the middle of the upper one.
        let risen = below.iter().filter(|z| **z > mean(&above)).count();
        assert!(risen < 5, "{risen}");
        let sizes = grains
            .iter()
            .all(|grain| (grain.radius < 0.75e-3) == (grain.material == 1));
        assert!(sizes);
    }

    /// Checks that the sample settles, is trimmed, and carries its weight: the floor bears the sum of m g.
    #[test]
    fn a_deposition_settles_and_is_trimmed() {
        let deposition = small();
        let (grains, report) = deposition.run(&Supervision::without_requests()).unwrap();
        assert!(report.settled, "{:?}", report.convergence.last());
        assert!(
            report.grains > 300 && report.grains < report.fallen,
            "{report:?}"
        );
        assert!(
            grains
                .iter()
                .all(|grain| grain.position[2] <= 8.05e-3 && grain.position[2] > 0.0)
        );
        assert!((3.5..7.0).contains(&report.coordination), "{report:?}");
        assert!(report.largest_overlap < 0.02, "{report:?}");
        let last = report.convergence.last().unwrap();
        assert!(last.kinetic_energy <= 1e-3 && last.unbalanced <= 0.02);
        // The same seed gives the same bits.
        assert_eq!(
            deposition.cloud(&[1e-3; 50], &[0]).unwrap(),
            deposition.cloud(&[1e-3; 50], &[0]).unwrap()
        );
        let mut particles = Particles::<Volume>::new();
        let mut weight = 0.0;
        for (id, grain) in (0..).zip(&grains) {
            let body = Body::uniform::<Volume>(id, grain.radius, 2600.0, 0);
            weight += body.mass * 9.81;
            let motion = Motion {
                position: grain.position,
                ..Motion::default()
            };
            particles.insert(body, motion);
        }
        let mut dem = Dem::new(
            linear(1e4),
            DemSettings::new(deposition.region, 1e-7, 1e-4),
            deposition.walls.clone(),
        )
        .unwrap();
        dem.prepare(&mut particles, &alone()).unwrap();
        let mut floor = 0.0;
        dem.for_each_contact(&particles, |contact| {
            if contact.wall == Some(4) {
                floor += contact.normal_force;
            }
        });
        // Friction at the side walls bears part of the weight.
        assert!(
            floor > 0.4 * weight && floor < 1.05 * weight,
            "{floor} {weight}"
        );
    }

    /// Checks that the number of steps is at most the limit, even if the limit is smaller than the interval between two
    /// checks.
    #[test]
    fn steps_are_at_most_those_allowed() {
        for limit in [50, 500, 620] {
            let mut short = small();
            short.limit = limit;
            short.trim_above = None;
            short.laws = vec![linear(1e3)];
            let run = |supervision: &Supervision<'_, Volume>| short.run(supervision);
            let ((_, report), _) = interrupted(run);
            assert_eq!(
                report.convergence.last().map(|look| look.steps),
                Some(limit)
            );
            assert!(!report.settled);
        }
    }
}
