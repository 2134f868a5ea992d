//! Regions that remove grains and regions that generate grains.
//!
//! After a fluid step every grain whose surface touches a removing region (or whose centre lies in it) is removed; the
//! first region that contains it counts. Named bodies stay. A generating region adds `rate x time` grains. The draws of
//! grain `n` of region `r` are a function of (seed, r, n, attempt) alone ([`base::random`]). The first drawn position
//! that is free of every grain, body and wall is used. If no position of a batch is free, the next step continues with
//! the next batch. New ids are larger than every id used before.
//!
//! The test whether a grain is inside uses its position wrapped into the periodic box, not the image in the
//! neighbour lists, so that the result does not depend on ranks or list rebuilds. A step without such events costs
//! a scan of the owned grains and one reduction of a number.

use analysis::erosion_law::RemovedGrain;
use base::error::Error;
use base::number::{real, whole};
use base::random::Stream;
use case::grains::Radii;
use case::observe::When;
use case::sieve;
use decomposition::Domain;
use dem::Wall;
use dem::particles::{Body, Motion, Particles};
use dem::polyhedron::{Narrow, Placed};
use dem::space::{Components, Space};
use nalgebra::Vector3;
use plan::Plan;
use plan::scene::Scene;
use plan::scene::aligned_box::AlignedBox;
use plan::scene::grid::Grid;
use plan::scene::observe::RegionAction;
use serde::{Deserialize, Serialize};

/// A removed grain and the region that removed it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepartedGrain {
    /// Index of the region in [`plan::scene::Scene::regions`].
    pub region: usize,
    /// Position of its centre, wrapped into the box \[m\].
    pub at: [f64; 3],
    /// Row of `removed.csv`.
    pub grain: RemovedGrain,
}

/// Grains that a region has removed so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RemovedCount {
    /// Number of grains.
    pub grains: u64,
    /// Mass of the grains [kg; in 2-D kg/m].
    pub mass: f64,
}

/// Progress of a region that generates grains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct GeneratorProgress {
    grains: u64,
    /// Batches of positions drawn without success for the next grain.
    batches: u32,
    /// Time from which the rate counts \[s\], and the number of grains generated until then: a restart may change the
    /// rate or add the region.
    #[serde(default)]
    from: f64,
    #[serde(default)]
    before: u64,
}

/// Grains of a generating region: number due, and number for which a free position was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Feed {
    /// Name of the region.
    pub region: String,
    /// Number of grains due by the rate and the maximum of the region.
    pub due: u64,
    /// Number of grains generated.
    pub generated: u64,
}

/// Counts of all regions in a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RemovalState {
    /// Next free id; none before ids are needed.
    next_id: Option<u64>,
    /// Removed grains, per region of the scene.
    taken: Vec<RemovedCount>,
    made: Vec<GeneratorProgress>,
}

/// Region that removes grains.
#[derive(Clone, Copy, Debug)]
struct RemovingRegion {
    /// Index in the scene.
    number: usize,
    block: AlignedBox,
    when: When,
}

/// Regions that remove and generate grains, with their counts: see the module. Every method with a domain is
/// collective.
#[derive(Clone, Debug)]
pub struct Removal {
    /// Ids below this are named bodies and blocks.
    first_grain: u64,
    removes: Vec<RemovingRegion>,
    generates: bool,
    /// Time of the last step in which the region generated grains \[s\].
    last: Option<f64>,
    state: RemovalState,
}

/// Purpose of the random numbers of radii; positions use the purposes above it.
const PURPOSE: u32 = 0x5eed;
/// Positions drawn before the ranks compare their results.
const BATCH: usize = 32;

impl Removal {
    /// Returns the regions of the scene with all counts at zero.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let regions = &plan.scene.regions;
        Self {
            first_grain: plan.scene.first_grain(),
            removes: regions
                .iter()
                .enumerate()
                .filter_map(|(n, region)| match region.action {
                    RegionAction::Remove { when } => Some(RemovingRegion {
                        number: n,
                        block: region.block,
                        when,
                    }),
                    _ => None,
                })
                .collect(),
            generates: regions
                .iter()
                .any(|region| matches!(region.action, RegionAction::Generate { .. })),
            last: None,
            state: RemovalState {
                next_id: None,
                taken: vec![RemovedCount::default(); regions.len()],
                made: vec![GeneratorProgress::default(); regions.len()],
            },
        }
    }

    /// Returns the numbers of grains due and generated of each generating region, up to the last step.
    #[must_use]
    pub fn feed_counts(&self, plan: &Plan) -> Vec<Feed> {
        let regions = plan.scene.regions.iter().zip(&self.state.made);
        let feeds = regions.filter_map(|(region, made)| {
            let RegionAction::Generate { rate, at_most, .. } = region.action else {
                return None;
            };
            let due = (self.last).map_or(0, |time| grains_due(rate, (time, made), at_most));
            Some(Feed {
                region: region.name.clone(),
                due: due.max(made.grains),
                generated: made.grains,
            })
        });
        feeds.collect()
    }

    /// Removes the grains that are in a removing region and returns those of all ranks, in ascending order of ids,
    /// on every rank. `step` and `time` \[s\] are written into the rows. If any grain was removed, the ghosts were
    /// dropped: prepare them again.
    ///
    /// # Errors
    /// If a message between ranks is corrupt.
    pub fn remove_grains<S: Space>(
        &mut self,
        particles: &mut Particles<S>,
        plan: &Plan,
        domain: &Domain,
        step: u64,
        time: f64,
    ) -> Result<Vec<DepartedGrain>, Error> {
        // A removed id may be the highest ever used: determine the next free id first.
        self.set_first_free_id(particles, domain);
        if self.removes.is_empty() {
            return Ok(Vec::new());
        }
        let grid = &plan.scene.grid;
        let holder = |particles: &Particles<S>, k: usize| -> Option<usize> {
            if particles.body[k].id < self.first_grain {
                return None;
            }
            let at = boxed(&particles.motion[k].position, grid);
            let radius = particles.body[k].radius;
            self.removes
                .iter()
                .find(|one| holds(&one.block, one.when, at, radius, grid))
                .map(|one| one.number)
        };
        let mut regions = Vec::new();
        let gone = particles.remove(|particles, k| match holder(particles, k) {
            Some(region) => {
                regions.push(region);
                true
            }
            None => false,
        });
        let communicator = domain.communicator();
        if communicator.all_reduce_max_u64(gone.len() as u64) == 0 {
            return Ok(Vec::new());
        }
        let mut bytes = Vec::new();
        for ((body, motion), region) in gone.iter().zip(&regions) {
            let at = boxed(&motion.position, grid);
            let fields = [
                *region as u64,
                body.id,
                body.mass.to_bits(),
                body.radius.to_bits(),
                at[0].to_bits(),
                at[1].to_bits(),
                at[2].to_bits(),
            ];
            bytes.extend(fields.iter().flat_map(|field| field.to_le_bytes()));
        }
        let mut all = Vec::new();
        for bytes in communicator.all_gather_bytes(&bytes) {
            for [region, id, mass, radius, x, y, z] in rows::<7>(&bytes)? {
                all.push(DepartedGrain {
                    region: whole_index(region)?,
                    at: [x, y, z].map(f64::from_bits),
                    grain: RemovedGrain {
                        step,
                        time,
                        id,
                        mass: f64::from_bits(mass),
                        radius: f64::from_bits(radius),
                        x: f64::from_bits(x),
                        y: f64::from_bits(y),
                        z: f64::from_bits(z),
                    },
                });
            }
        }
        all.sort_unstable_by_key(|departed| departed.grain.id);
        for departed in &all {
            // Masses are summed in the order of the rows, independently of ranks and restarts.
            let taken =
                self.state.taken.get_mut(departed.region).ok_or_else(|| {
                    Error::Internal("a grain was removed outside all regions".into())
                })?;
            taken.grains += 1;
            taken.mass += departed.grain.mass;
        }
        Ok(all)
    }

    /// Adds the grains that the generating regions owe at `time` \[s\] and returns their number, on every rank. `walls`
    /// are at their present positions. If any were added, the ghosts were dropped: prepare them again, which also
    /// sends each new grain to its owner.
    ///
    /// # Errors
    /// If the material of the region has no density.
    pub fn generate_grains<S: Space>(
        &mut self,
        (particles, walls): (&mut Particles<S>, &[Wall<S>]),
        plan: &Plan,
        domain: &Domain,
        time: f64,
    ) -> Result<u64, Error> {
        if !self.generates {
            return Ok(0);
        }
        self.set_first_free_id(particles, domain);
        self.last = Some(time);
        let mut born = 0;
        for (n, region) in plan.scene.regions.iter().enumerate() {
            let RegionAction::Generate {
                rate,
                ref radii,
                velocity,
                seed,
                material,
                at_most,
            } = region.action
            else {
                continue;
            };
            let density = plan
                .scene
                .materials
                .get(material)
                .and_then(|material| material.density)
                .ok_or_else(|| {
                    Error::Numerical(format!(
                        "regions[{n}]: the material of generated grains needs a density"
                    ))
                })?;
            let owed = grains_due(rate, (time, &self.state.made[n]), at_most);
            while self.state.made[n].grains < owed {
                let made = self.state.made[n];
                let ordinal = ((n as u64) << 48) | made.grains;
                let radius = draw_radius(
                    radii,
                    region.block.dimension,
                    &mut Stream::new(seed, ordinal, PURPOSE),
                );
                let places = draw_places(
                    &region.block,
                    radius,
                    &mut Stream::new(seed, ordinal, PURPOSE + 1 + made.batches),
                );
                let solids = (&*particles, walls);
                let Some(at) = first_free(&places, radius, solids, &plan.scene, domain) else {
                    self.state.made[n].batches = (made.batches + 1) % (1 << 30);
                    break;
                };
                let id = self.state.next_id.unwrap_or(self.first_grain);
                if domain.rank() == 0 {
                    let mut motion = Motion::<S>::default();
                    for axis in 0..S::DIMENSION {
                        motion.position.set(axis, at[axis]);
                        motion.velocity.set(axis, velocity[axis]);
                    }
                    let material = u32::try_from(material).map_err(|_| {
                        Error::Internal("the case has more than 2^32 materials".into())
                    })?;
                    particles.insert(Body::uniform::<S>(id, radius, density, material), motion);
                }
                self.state.next_id = Some(id + 1);
                self.state.made[n] = GeneratorProgress {
                    grains: made.grains + 1,
                    batches: 0,
                    ..made
                };
                born += 1;
            }
        }
        Ok(born)
    }

    /// Returns the counts for a checkpoint; the same on every rank.
    #[must_use]
    pub fn state(&self) -> RemovalState {
        self.state.clone()
    }

    /// Restores the counts of [`Self::state`] at a time \[s\]. `origins` has for each region of the scene the index of
    /// the same region in the saved run, or none for a new region; it is not needed if the regions are unchanged. The
    /// rates of new regions and of those in `restarted` count from this time.
    ///
    /// # Errors
    ///
    /// If the number of saved regions differs, [`Error::Io`].
    pub fn restore(
        &mut self,
        state: &RemovalState,
        (origins, restarted): (Option<&[Option<usize>]>, &[usize]),
        time: f64,
    ) -> Result<(), Error> {
        let regions = self.state.taken.len();
        let same: Vec<Option<usize>> = (0..state.taken.len()).map(Some).collect();
        let origins = origins.unwrap_or(&same);
        let known = state.taken.len().min(state.made.len());
        if origins.len() != regions
            || state.made.len() != state.taken.len()
            || origins.iter().flatten().any(|&old| old >= known)
            || state.next_id.is_some_and(|id| id > 1 << 32)
        {
            return Err(Error::Io(format!(
                "the checkpoint contains counts of {known} regions, but the case has {regions}"
            )));
        }
        for (region, origin) in origins.iter().enumerate() {
            if let Some(old) = *origin {
                self.state.taken[region] = state.taken[old];
                self.state.made[region] = state.made[old];
            }
            let made = &mut self.state.made[region];
            if origin.is_none() || restarted.contains(&region) {
                (made.from, made.before) = (time, made.grains);
            }
        }
        self.state.next_id = state.next_id;
        Ok(())
    }

    /// Sets the next free id above all present ids, once, while all grains are still present.
    fn set_first_free_id<S: Space>(&mut self, particles: &Particles<S>, domain: &Domain) {
        if self.generates && self.state.next_id.is_none() {
            let mine = particles.body[..particles.owned()]
                .iter()
                .map(|body| body.id + 1)
                .fold(self.first_grain, u64::max);
            self.state.next_id = Some(domain.communicator().all_reduce_max_u64(mine));
        }
    }
}

/// Returns rows of `N` numbers from bytes.
pub(super) fn rows<const N: usize>(bytes: &[u8]) -> Result<Vec<[u64; N]>, Error> {
    let (words, rest) = bytes.as_chunks::<8>();
    let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
    let (rows, more) = words.as_chunks::<N>();
    if rest.is_empty() && more.is_empty() {
        Ok(rows.to_vec())
    } else {
        Err(Error::Internal(
            "a message between ranks has the wrong length".into(),
        ))
    }
}

fn whole_index(number: u64) -> Result<usize, Error> {
    usize::try_from(number).map_err(|_| Error::Internal(format!("{number} is not an index")))
}

/// Returns a position in the box: its periodic coordinates are wrapped into [0, length).
pub(super) fn boxed<V: Components>(position: &V, grid: &Grid) -> [f64; 3] {
    std::array::from_fn(|axis| {
        if axis >= grid.dimension {
            return 0.0;
        }
        let x = position.get(axis);
        if grid.periodic[axis] {
            x - (x / grid.size[axis]).floor() * grid.size[axis]
        } else {
            x
        }
    })
}

/// Returns `true` if a grain is in a region. A grain that left the domain between two checks counts at the face
/// through which it left.
fn holds(block: &AlignedBox, when: When, at: [f64; 3], radius: f64, grid: &Grid) -> bool {
    let at = std::array::from_fn(|axis| {
        if axis < grid.dimension && !grid.periodic[axis] {
            at[axis].clamp(0.0, grid.size[axis].next_down())
        } else {
            at[axis]
        }
    });
    match when {
        When::Centre => block.contains(at),
        When::Touches => {
            // Use the nearest image along a periodic axis; a grain is smaller than half the box.
            let nearest = std::array::from_fn(|axis| {
                let middle = 0.5 * (block.from[axis] + block.to[axis]);
                at[axis] + image(at[axis] - middle, axis, grid)
            });
            block.touches(nearest, radius)
        }
    }
}

/// Returns the shift that turns a difference along an axis into that of the nearest image.
fn image(difference: f64, axis: usize, grid: &Grid) -> f64 {
    if axis < grid.dimension && grid.periodic[axis] {
        -(difference / grid.size[axis]).round() * grid.size[axis]
    } else {
        0.0
    }
}

/// Returns the number of grains that a region has to generate up to a time \[s\].
fn grains_due(rate: f64, (time, made): (f64, &GeneratorProgress), at_most: Option<u32>) -> u64 {
    // A product that is below a whole number only by rounding counts as that number.
    let owed = whole((rate * (time - made.from) * (1.0 + 1e-12)).floor()) as u64;
    let owed = made.before.saturating_add(owed);
    at_most.map_or(owed, |most| owed.min(u64::from(most)))
}

fn draw_radius(radii: &Radii, dimension: usize, draw: &mut Stream) -> f64 {
    let share = draw.uniform();
    match radii {
        Radii::Uniform { min, max } => min + share * (max - min),
        Radii::List(list) => {
            let n = whole(share * real(list.len()));
            list.get(n).or(list.last()).copied().unwrap_or(0.0)
        }
        Radii::Sieve(curve) => 0.5 * sieve::diameter(curve, share, dimension),
    }
}

/// Draws a batch of positions at which a grain lies entirely in the box, or on its middle line where the box is
/// thinner.
fn draw_places(block: &AlignedBox, radius: f64, draw: &mut Stream) -> [[f64; 3]; BATCH] {
    std::array::from_fn(|_| {
        std::array::from_fn(|axis| {
            if axis >= block.dimension {
                return 0.0;
            }
            let (from, to) = (block.from[axis] + radius, block.to[axis] - radius);
            let share = draw.uniform();
            if from < to {
                from + share * (to - from)
            } else {
                0.5 * (from + to)
            }
        })
    })
}

/// Returns the first of the positions that no grain, body, wall or structure covers, on any rank.
fn first_free<S: Space>(
    places: &[[f64; 3]; BATCH],
    radius: f64,
    (particles, walls): (&Particles<S>, &[Wall<S>]),
    scene: &Scene,
    domain: &Domain,
) -> Option<[f64; 3]> {
    let grid = &scene.grid;
    let mut narrow = Narrow::default();
    let mut covered = [0_i64; BATCH];
    for (covered, place) in covered.iter_mut().zip(places) {
        let mut centre = S::Vector::default();
        for axis in 0..S::DIMENSION {
            centre.set(axis, place[axis]);
        }
        let at_wall = walls.iter().any(|wall| wall.stops(&centre, radius));
        let mut by_grain = || {
            (0..particles.owned()).any(|k| {
                let at = boxed(&particles.motion[k].position, grid);
                let apart = std::array::from_fn(|axis| {
                    let apart = place[axis] - at[axis];
                    apart + image(apart, axis, grid)
                });
                let squared: f64 = apart[..S::DIMENSION].iter().map(|x| x * x).sum();
                squared < (radius + particles.body[k].radius).powi(2)
                    && touches(particles, k, (apart, radius), &mut narrow)
            })
        };
        let structures = scene.structures.iter();
        let mut stopping = structures.filter(|structure| structure.stops.grains());
        let in_structure = stopping.any(|structure| structure.solid.distance(*place) < radius);
        *covered = i64::from(at_wall || in_structure || by_grain());
    }
    domain.communicator().all_reduce_sum_i64s(&mut covered);
    covered
        .iter()
        .position(|&covered| covered == 0)
        .map(|free| places[free])
}

/// Returns `true` if a grain or body whose enclosing sphere reaches a ball at `apart` from its centre, of a radius
/// \[m\], touches it: a polyhedron does so with its faces only.
fn touches<S: Space>(
    particles: &Particles<S>,
    k: usize,
    (apart, radius): ([f64; 3], f64),
    narrow: &mut Narrow,
) -> bool {
    particles.polyhedron(k).is_none_or(|(shape, state)| {
        let rotation = state.matrix();
        let block = Placed { shape, rotation };
        narrow
            .sphere(&block, &Vector3::from(apart), radius)
            .is_some()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::Document;
    use decomposition::SplitAxis;
    use dem::space::PlaneSpace;
    use nalgebra::Vector2;
    use std::path::Path;

    fn plan(regions: &str) -> Plan {
        let text = format!(
            r#"{{"title": "removal", "domain": {{"size": [0.01, 0.004], "spacing": 1e-4}},
            "materials": {{"soil": {{"density": 2000}}}},
            "grains": {{"material": "soil", "initial": {{"list": [{{"position": [0.001, 0.001], "radius": 1e-4}}]}}}},
            "bodies": [{{"name": "stone", "shape": {{"disc": {{"radius": 2e-4}}}}, "position": [0.0095, 0.002],
                "motion": {{"fixed": {{}}}}, "material": "soil"}}],
            "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e3}}}}}},
            "regions": [{regions}], "time": {{"end": 0.01}}}}"#
        );
        let document = Document::read(&text, &[], Path::new(".")).unwrap();
        Plan::prepare(document).unwrap()
    }

    const OUT: &str = r#"{"name": "left", "box": {"from": [0, 0], "to": [0.0005, 0.004]},
        "action": {"remove": {"when": "centre"}}},
        {"name": "out", "box": {"from": [0.009, 0], "to": [0.01, 0.004]}, "action": {"remove": {}}}"#;

    fn grain(id: u64, x: f64, y: f64) -> (Body, Motion<PlaneSpace>) {
        let motion = Motion {
            position: Vector2::new(x, y),
            ..Motion::default()
        };
        (Body::uniform::<PlaneSpace>(id, 1e-4, 2000.0, 0), motion)
    }

    fn serial() -> Domain {
        Domain::serial(SplitAxis::X, 100, false)
    }

    #[test]
    fn grains_in_a_region_go_by_rising_id_and_bodies_stay() {
        let plan = plan(OUT);
        let mut particles = Particles::<PlaneSpace>::new();
        for (body, motion) in [
            grain(0, 0.0095, 0.002),
            // This grain touches the outlet.
            grain(9, 0.00895, 0.003),
            // This grain just fails to touch the outlet.
            grain(3, 0.00889, 0.001),
            // The surface of this grain is in the left box, its centre is not.
            grain(5, 0.00055, 0.001),
            grain(4, 0.0004, 0.003),
            grain(2, 0.0099, 0.0005),
            // This grain flew past the right box, and upwards, since the last check.
            grain(8, 0.0131, 0.0042),
        ] {
            particles.insert(body, motion);
        }
        let mut removal = Removal::new(&plan);
        let gone = removal
            .remove_grains(&mut particles, &plan, &serial(), 7, 0.5)
            .unwrap();
        let ids: Vec<_> = gone.iter().map(|d| (d.grain.id, d.region)).collect();
        assert_eq!(ids, [(2, 1), (4, 0), (8, 1), (9, 1)]);
        assert_eq!((gone[0].grain.step, gone[0].grain.time), (7, 0.5));
        let mass = Body::uniform::<PlaneSpace>(0, 1e-4, 2000.0, 0).mass;
        assert_eq!(removal.state.taken[1].grains, 3);
        approx::assert_relative_eq!(
            removal.state.taken[1].mass,
            3.0 * mass,
            max_relative = 1e-15
        );
        assert_eq!(particles.owned(), 3);
        let again = removal.remove_grains(&mut particles, &plan, &serial(), 8, 0.6);
        assert!(again.unwrap().is_empty());

        let saved = removal.state();
        let mut other = Removal::new(&plan);
        let text = serde_json::to_string(&saved).unwrap();
        other
            .restore(&serde_json::from_str(&text).unwrap(), (None, &[]), 0.6)
            .unwrap();
        assert_eq!(other.state.taken, removal.state.taken);
        assert!(
            other
                .restore(&RemovalState::default(), (None, &[]), 0.6)
                .is_err()
        );
    }

    const SPRING: &str = r#"{"name": "spring", "box": {"from": [0.002, 0.001], "to": [0.004, 0.002]},
        "action": {"generate": {"rate": 1000, "radii": {"uniform": {"min": 1e-4, "max": 1.5e-4}},
        "velocity": [0.1, 0], "seed": 4, "at_most": 12}}}"#;

    fn apart(particles: &Particles<PlaneSpace>) -> bool {
        let n = particles.owned();
        (0..n).all(|i| {
            (i + 1..n).all(|j| {
                let gap = (particles.motion[i].position - particles.motion[j].position).norm();
                gap >= particles.body[i].radius + particles.body[j].radius
            })
        })
    }

    fn present(particles: &Particles<PlaneSpace>) -> Vec<(u64, u64, u64, u64)> {
        (0..particles.owned())
            .map(|k| {
                let (body, at) = (particles.body[k], particles.motion[k].position);
                (
                    body.id,
                    body.radius.to_bits(),
                    at.x.to_bits(),
                    at.y.to_bits(),
                )
            })
            .collect()
    }

    #[test]
    fn grains_appear_at_their_rate_apart_and_the_same_after_a_restart() {
        let plan = plan(SPRING);
        let domain = serial();
        let start = || {
            let mut particles = Particles::<PlaneSpace>::new();
            let (body, motion) = grain(41, 0.003, 0.0015);
            particles.insert(body, motion);
            particles
        };
        let mut straight = start();
        let mut removal = Removal::new(&plan);
        let mut born = Vec::new();
        for step in 0..20_u32 {
            let time = f64::from(step) * 1e-3;
            born.push(
                removal
                    .generate_grains((&mut straight, &[]), &plan, &domain, time)
                    .unwrap(),
            );
        }
        assert_eq!(born[..4], [0, 1, 1, 1]);
        assert_eq!(born.iter().sum::<u64>(), 12, "at most twelve: {born:?}");
        assert_eq!(removal.state.made[0].grains, 12);
        let feed = |due, generated| Feed {
            region: "spring".into(),
            due,
            generated,
        };
        assert_eq!(removal.feed_counts(&plan), [feed(12, 12)]);
        assert!(apart(&straight));
        let ids: Vec<_> = straight.body.iter().map(|body| body.id).collect();
        assert_eq!(ids, (41..=53).collect::<Vec<_>>());
        for k in 1..straight.owned() {
            let (at, r) = (straight.motion[k].position, straight.body[k].radius);
            assert!(at.x >= 0.002 + r && at.x <= 0.004 - r && (1e-4..=1.5e-4).contains(&r));
            assert!((straight.motion[k].velocity.x - 0.1).abs() < 1e-15);
        }

        let mut resumed = start();
        let mut first = Removal::new(&plan);
        for step in 0..6_u32 {
            let time = f64::from(step) * 1e-3;
            first
                .generate_grains((&mut resumed, &[]), &plan, &domain, time)
                .unwrap();
        }
        let mut second = Removal::new(&plan);
        second.restore(&first.state(), (None, &[]), 5e-3).unwrap();
        for step in 6..20_u32 {
            let time = f64::from(step) * 1e-3;
            second
                .generate_grains((&mut resumed, &[]), &plan, &domain, time)
                .unwrap();
        }
        assert_eq!(present(&resumed), present(&straight));
    }

    /// Checks that no grain is generated in rock, and that a feed wholly in rock is refused.
    #[test]
    fn grains_are_generated_outside_structures() {
        let case = |top: f64| {
            let text = format!(
                r#"{{"domain": {{"size": [0.01, 0.004], "spacing": 1e-4}},
                "materials": {{"soil": {{"density": 2000}}}},
                "grains": {{"material": "soil", "initial": {{"list": [
                    {{"position": [0.009, 0.0035], "radius": 1e-4}}]}}}},
                "structures": [{{"name": "rock", "material": "soil",
                    "shape": {{"box": {{"from": [0, 0], "to": [0.01, {top}]}}}}}}],
                "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e3}}}}}},
                "regions": [{{"name": "spring", "box": {{"from": [0.002, 0.001], "to": [0.004, 0.002]}},
                    "action": {{"generate": {{"rate": 1000, "radii": {{"uniform": {{"min": 1e-4, "max": 1e-4}}}},
                    "seed": 4, "material": "soil"}}}}}}], "time": {{"end": 0.01}}}}"#
            );
            let document = Document::read(&text, &[], Path::new(".")).unwrap();
            Plan::prepare(document)
        };
        let plan = case(0.0015).unwrap();
        let mut particles = Particles::<PlaneSpace>::new();
        let mut removal = Removal::new(&plan);
        removal
            .generate_grains((&mut particles, &[]), &plan, &serial(), 0.02)
            .unwrap();
        assert!(particles.owned() > 5);
        for motion in &particles.motion[..particles.owned()] {
            assert!(motion.position.y >= 0.0016, "{}", motion.position.y);
        }
        let problems = case(0.003).unwrap_err();
        let refused = |p: &base::error::Problem| {
            p.path == "regions[0].box" && p.reason.contains("structure `rock`")
        };
        assert!(problems.iter().any(refused), "{problems:?}");
    }

    /// Checks that a restart with another rate, or with a new region, counts from the restart: no burst, and no
    /// refusal of a lower rate.
    #[test]
    fn a_rate_that_a_restart_changes_counts_from_the_restart() {
        let domain = serial();
        let rate = |rate: u32| {
            plan(
                &SPRING
                    .replace("1000", &rate.to_string())
                    .replace("12}", "90}"),
            )
        };
        let mut particles = Particles::<PlaneSpace>::new();
        let mut first = Removal::new(&rate(1000));
        let born = first.generate_grains((&mut particles, &[]), &rate(1000), &domain, 4e-3);
        assert_eq!(born.unwrap(), 4);
        for (new, restarted, later) in [(3000, &[0][..], 7), (500, &[0], 5), (1000, &[], 6)] {
            let plan = rate(new);
            let mut second = Removal::new(&plan);
            let saved = serde_json::to_string(&first.state()).unwrap();
            let saved: RemovalState = serde_json::from_str(&saved).unwrap();
            second.restore(&saved, (None, restarted), 4e-3).unwrap();
            let mut due = |time: f64| {
                second.last = Some(time);
                second.feed_counts(&plan)[0].due
            };
            assert_eq!(due(4e-3), 4, "{new}");
            assert_eq!(
                due(6e-3 - 1e-3 * f64::from(u8::from(new == 3000))),
                later,
                "{new}"
            );
        }
        let plan = plan(&format!("{SPRING}, {}", SPRING.replace("spring", "second")));
        let mut third = Removal::new(&plan);
        let origins = [Some(0), None];
        third
            .restore(&first.state(), (Some(&origins), &[]), 4e-3)
            .unwrap();
        third.last = Some(6e-3);
        let due: Vec<u64> = third
            .feed_counts(&plan)
            .iter()
            .map(|feed| feed.due)
            .collect();
        assert_eq!(due, [6, 2]);
    }

    /// Checks that grains keep away from a wall at its present position, and that only the faces of a block count.
    #[test]
    fn walls_count_where_they_are_now() {
        let plan = plan(SPRING);
        let domain = serial();
        let mut wall = Wall::<PlaneSpace>::new(Vector2::zeros(), Vector2::x(), 0);
        let mut particles = Particles::new();
        let mut removal = Removal::new(&plan);
        wall.point.x = 3e-3;
        let walls = [wall];
        let born = removal.generate_grains((&mut particles, &walls), &plan, &domain, 6e-3);
        assert!(born.unwrap() > 3);
        for k in 0..particles.owned() {
            let gap = particles.motion[k].position.x - 3e-3;
            assert!(gap >= particles.body[k].radius, "{gap}");
        }
    }

    #[test]
    fn a_full_region_waits_and_ids_are_never_used_twice() {
        let plan = plan(&format!("{OUT}, {SPRING}"));
        let domain = serial();
        let mut particles = Particles::<PlaneSpace>::new();
        let mut stopper = grain(7, 0.003, 0.0015);
        stopper.0.radius = 2e-3;
        particles.insert(stopper.0, stopper.1);
        let last = grain(60, 0.0099, 0.001);
        particles.insert(last.0, last.1);
        let mut removal = Removal::new(&plan);
        let gone = removal
            .remove_grains(&mut particles, &plan, &domain, 0, 0.0)
            .unwrap();
        assert_eq!(gone.len(), 1);
        let born = removal.generate_grains((&mut particles, &[]), &plan, &domain, 2e-3);
        assert_eq!(born.unwrap(), 0);
        let feeds = removal.feed_counts(&plan);
        assert_eq!((feeds.len(), feeds[0].due, feeds[0].generated), (1, 2, 0));
        particles.remove(|particles, k| particles.body[k].id == 7);
        let born = removal.generate_grains((&mut particles, &[]), &plan, &domain, 2e-3);
        assert_eq!(born.unwrap(), 2);
        let ids: Vec<_> = particles.body.iter().map(|body| body.id).collect();
        assert_eq!(ids, [61, 62]);
    }
}
