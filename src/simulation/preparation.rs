//! Grains at the start: grown, read or listed; then cut, bonded and brought to rest.
//!
//! Growth runs on the first rank alone, so that the sample depends on the seed only. Cutting follows, then bonds where
//! contacts are, then rest under damping without the fluid: what breaks here broke before any water moved, and is said.
//! Everything stands still meanwhile, driven bodies too; then each grain and body has the velocity of the case.

use super::agreement;
use super::folder::RunFolder;
use super::watch::Watch;
use crate::case::contact::Scaled;
use crate::case::grains::{Amount, Deposition as WrittenRain, Growth, Radii};
use crate::checkpoint::{self, State};
use crate::dem::particles::Particles;
use crate::dem::relax::unbalanced_text;
use crate::dem::space::{Components, Space};
use crate::dem::{Dem, Relaxation, Stillness, Wall};
use crate::error::Error;
use crate::plan::{Plan, contacts};
use crate::scene::block::Block;
use crate::scene::blocks::Blocks;
use crate::scene::grid::count;
use crate::scene::packing::{Preparation, Sizes, Stop};
use crate::scene::rock::list;
use crate::scene::solids::{Grain, GrainSource};
use crate::scene::waiting::{Outside, Reached, Request, Waiting};
use crate::scene::{numbering, rain, sample};
use decomposition::{Communicator, Domain};
use io::checkpoint::{Found, Reader};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

/// What the preparation came to, for the report and the summary.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// The grains after cutting; on the first rank only.
    pub grains: Vec<Grain>,
    /// How it went, for `summary.json`.
    pub report: Value,
    /// One line for the terminal.
    pub line: String,
}

/// The sample in the making, for whoever makes it on the first rank: it tells, listens, and saves.
struct Workshop<'a> {
    watch: RefCell<&'a mut Watch>,
    tell: &'a dyn Fn(&str),
    communicator: &'a Communicator,
    folder: &'a RunFolder,
    /// What a restart has to know beside the grains.
    attributes: &'a Value,
}

impl<S: Space> Outside<S> for Workshop<'_> {
    fn tell(&self, line: &str) {
        (self.tell)(line);
    }

    fn ask(&self) -> Request {
        self.watch.borrow_mut().ask(self.communicator)
    }

    fn keep(
        &self,
        particles: &Particles<S>,
        dem: &Dem<S>,
        progress: &Value,
        request: Request,
    ) -> Result<(), Error> {
        let begun = Instant::now();
        let folder = self.folder.preparation();
        std::fs::create_dir_all(&folder)
            .map_err(|e| Error::Io(format!("{}: {e}", folder.display())))?;
        let mut attributes = self.attributes.clone();
        attributes["preparation"] = json!({ "sample": progress });
        let state = State::<S, f64> {
            fluid: None,
            averages: None,
            seepage: Vec::new(),
            particles,
            dem: Some(dem),
            earlier: None,
        };
        let written = state.write(
            &folder,
            dem.steps(),
            0.0,
            attributes,
            2,
            &Communicator::serial(),
        );
        match written {
            Ok(()) => (self.tell)(&format!(
                "the sample so far is kept: {} grains, {} solid steps",
                particles.owned(),
                dem.steps()
            )),
            Err(io::Error::Space { needed, free, path }) if request == Request::Checkpoint => {
                (self.tell)(&format!(
                    "the sample so far is not kept: that needs {needed} bytes, {path} has {free}; it goes on"
                ));
            }
            Err(error) => return Err(Error::Io(error.to_string())),
        }
        let mut watch = self.watch.borrow_mut();
        watch.wrote(begun.elapsed());
        if request == Request::Stop {
            watch.forget_file();
        }
        Ok(())
    }
}

/// What an earlier attempt at the sample left. First rank.
fn reached<S: Space>(found: &Found) -> Result<Reached<S>, Error> {
    let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
    let (grains, contacts) = checkpoint::read_tables(&reader, 0)?;
    Ok(Reached {
        particles: Particles::from_table(&grains)?,
        contacts,
        progress: reader.attributes()["preparation"]["sample"].clone(),
    })
}

/// Makes, reads or lists the grains and cuts them, telling how far it is; goes on from what an earlier attempt left. `attributes` are
/// kept with a sample that is saved on the way. Collective.
///
/// # Errors
/// When the sample cannot be made, read or saved, and [`Error::Stopped`] when it was asked to; the same on all ranks.
pub fn grains<S: Space>(
    plan: &Plan,
    folder: &RunFolder,
    domain: &Domain,
    watch: &mut Watch,
    tell: &dyn Fn(&str),
    attributes: &Value,
    earlier: Option<&Found>,
) -> Result<Prepared, Error> {
    let communicator = domain.communicator();
    let mine = if domain.rank() == 0 {
        let workshop = Workshop {
            watch: RefCell::new(watch),
            tell,
            communicator,
            folder,
            attributes,
        };
        let made = earlier
            .map(reached::<S>)
            .transpose()
            .and_then(|reached| on_first(plan, folder, &Waiting::new(&workshop, reached)));
        workshop.watch.into_inner().finish(communicator);
        made
    } else {
        watch.attend(communicator);
        Ok(Prepared::default())
    };
    let mut prepared = agreement::agree(communicator, mine)?;
    // Every rank writes the report into checkpoints and must write the same.
    let mut report = prepared.report.to_string().into_bytes();
    communicator.broadcast_bytes(0, &mut report);
    prepared.report = serde_json::from_slice(&report)
        .map_err(|e| Error::Internal(format!("the report of the preparation: {e}")))?;
    Ok(prepared)
}

fn on_first<S: Space>(
    plan: &Plan,
    folder: &RunFolder,
    waiting: &Waiting<'_, S>,
) -> Result<Prepared, Error> {
    let folder = folder.path();
    let mut prepared = Prepared::default();
    if let Some(blocks) = &plan.scene.blocks {
        prepared.line = jointed(plan, blocks, folder)?;
    }
    let Some(scene) = &plan.scene.grains else {
        return Ok(prepared);
    };
    let dimension = plan.scene.grid.dimension;
    let names: Vec<String> = plan
        .scene
        .materials
        .iter()
        .map(|m| m.name.clone())
        .collect();
    let mut all = match &scene.source {
        GrainSource::List(list) => list.clone(),
        GrainSource::File { grains, path } => {
            prepared.line = format!("{} grains from {}", grains.len(), path.display());
            grains.clone()
        }
        GrainSource::Rain {
            block,
            grading,
            rain,
        } => {
            let (grains, report) = falling::<S>(plan, block, grading, rain).fall(waiting)?;
            let last = report.convergence.last().copied().unwrap_or_default();
            prepared.line = format!(
                "{} of {} grains left of the rain after {} solid steps ({}): {:.2} contacts each, largest overlap {:.1e} d, kinetic energy {:.1e} m g d, unbalanced force {}",
                report.grains,
                report.fallen,
                last.steps,
                if report.settled {
                    "settled"
                } else {
                    "NOT settled within the steps allowed"
                },
                report.coordination,
                report.largest_overlap,
                last.kinetic_energy,
                unbalanced_text(last.unbalanced)
            );
            prepared.report = json!({ "rain": report });
            grains
                .iter()
                .map(|(position, radius)| Grain {
                    position: components(position),
                    radius: *radius,
                    velocity: [0.0; 3],
                    angular_velocity: [0.0; 3],
                    material: scene.material,
                })
                .collect()
        }
        GrainSource::Growth {
            block,
            number,
            growth,
        } => {
            let packing = preparation::<S>(plan, block, *number, growth).pack(waiting)?;
            let r = &packing.report;
            prepared.line = format!(
                "{} grains grown in {} solid steps: solid fraction {:.4}, {:.2} contacts each, mean overlap {:.2e} d, unbalanced force {}, sizes x {:.4}",
                r.grains,
                r.steps,
                r.solid_fraction,
                r.coordination,
                r.mean_overlap,
                unbalanced_text(r.unbalanced),
                r.size_factor
            );
            prepared.report = json!({ "growth": r });
            packing
                .grains
                .iter()
                .map(|g| Grain {
                    position: components(&g.position),
                    radius: g.radius,
                    velocity: [0.0; 3],
                    angular_velocity: [0.0; 3],
                    material: scene.material,
                })
                .collect()
        }
    };
    if let GrainSource::Rain { rain, .. } = &scene.source
        && let Some(level) = rain.trim_above
        && let Some(top) = prepared.report["rain"]["top"].as_f64()
        && top < level
    {
        prepared.line = format!(
            "{}; the surface stays {:.3e} m below the level of trimming: let more grains fall",
            prepared.line,
            level - top
        );
    }
    if let GrainSource::Rain { .. } | GrainSource::Growth { .. } = &scene.source {
        numbering::along_curve(&mut all);
    }
    if let Some(path) = &scene.save {
        let text = sample::write(&all, dimension, &names);
        io::atomic::write(&folder.join(path), text.as_bytes())
            .map_err(|e| Error::Io(e.to_string()))?;
    }
    let before = all.len();
    all.retain(|g| {
        !scene
            .cut
            .iter()
            .any(|(_, block)| block.touches(g.position, g.radius))
    });
    if !scene.cut.is_empty() {
        let line = format!("{} of {before} grains left after cutting", all.len());
        prepared.line = if prepared.line.is_empty() {
            line
        } else {
            format!("{}; {line}", prepared.line)
        };
    }
    prepared.grains = all;
    Ok(prepared)
}

/// Saves the blocks where the case asks for it; a line about them.
fn jointed(plan: &Plan, blocks: &Blocks, folder: &Path) -> Result<String, Error> {
    if let Some(path) = &blocks.save {
        let text = list::write(blocks.list.iter().map(|block| {
            let name = plan.scene.materials[block.material].name.as_str();
            (&block.solid, name, block.fixed)
        }));
        io::atomic::write(&folder.join(path), text.as_bytes())
            .map_err(|e| Error::Io(e.to_string()))?;
    }
    Ok(format!(
        "{} blocks of {:.4} m3 in all, {} of them fixed",
        blocks.number, blocks.volume, blocks.fixed
    ))
}

/// Three components; those that are not there are zero.
fn components<C: Components>(vector: &C) -> [f64; 3] {
    std::array::from_fn(|a| if a < C::COUNT { vector.get(a) } else { 0.0 })
}

fn falling<S: Space>(
    plan: &Plan,
    block: &Block,
    grading: &rain::Grading,
    written: &WrittenRain,
) -> rain::Rain<S> {
    let scene = &plan.scene;
    let material = scene.grains.as_ref().map_or(0, |g| g.material);
    let mut laws = Vec::new();
    let with = |stiffness: Option<f64>| {
        let mut table = scene.contact.clone();
        for pair in table.iter_mut().flat_map(|table| &mut table.parameters) {
            if let Some(stiffness) = stiffness {
                pair.normal_stiffness = Scaled::Absolute(stiffness);
            }
            if let Some(angle) = written.friction_angle_degrees {
                pair.friction_coefficient = angle.to_radians().tan();
            }
        }
        super::setup::law_of(table.as_ref(), scene.materials.len())
    };
    if let (Some(soft), Some(table)) = (written.falling_stiffness, &scene.contact) {
        let mean = grading.bounds().0 + grading.bounds().1;
        let full = table.pair(material, material).normal_stiffness.at(mean);
        let mut stiffness = soft;
        while stiffness < full * (1.0 - 1e-9) {
            laws.push(with(Some(stiffness)));
            stiffness *= 10.0;
        }
    }
    laws.push(with(None));
    rain::Rain {
        lower: super::setup::vector::<S>(block.from),
        upper: super::setup::vector::<S>(block.to),
        region: super::setup::region::<S>(plan),
        // They move once the run begins.
        walls: super::setup::walls::<S>(plan)
            .into_iter()
            .map(|wall| Wall {
                velocity: S::Vector::default(),
                ..wall
            })
            .collect(),
        grading: grading.clone(),
        number: written.number as usize,
        seed: written.seed,
        density: scene.materials[material].density.unwrap_or(1000.0),
        material: super::setup::small(material),
        laws,
        materials: super::setup::small(scene.materials.len().max(1)),
        gravity: super::setup::vector::<S>(scene.gravity),
        local_damping: written.local_damping,
        trim_above: written.trim_above,
        kinetic_energy: written.stop.kinetic_energy,
        unbalanced: written.stop.unbalanced_force,
        limit: u64::from(written.stop.at_most_steps),
        step_ratio: STEP_OF_RAIN.min(PARTNERS * contacts::of_packing(scene)),
    }
}

/// Solid step of falling grains over the critical one, where no strong dashpots shorten it.
const STEP_OF_RAIN: f64 = 0.2;
/// Partners in the densest packing over those in one that has rained: 12 to 6.
const PARTNERS: f64 = 2.0;

fn preparation<S: Space>(
    plan: &Plan,
    block: &Block,
    number: usize,
    growth: &Growth,
) -> Preparation<S> {
    let scene = &plan.scene;
    let material = scene.grains.as_ref().map_or(0, |g| g.material);
    let mean = if S::DIMENSION == 2 {
        std::f64::consts::PI * growth.radii.mean_power(2)
    } else {
        4.0 / 3.0 * std::f64::consts::PI * growth.radii.mean_power(3)
    };
    let mean_diameter = 2.0 * growth.radii.mean_power(1);
    let pair = scene.contact.as_ref().map(|c| c.pair(material, material));
    let stiffness = pair.map_or(1e6, |p| {
        // Elastic spheres grow with springs as stiff as they are at an overlap of 1e-4 of the diameter: E* d sqrt(1e-4).
        let elastic = 1e-2 * p.moduli[0];
        p.normal_stiffness.at(mean_diameter) / mean_diameter + elastic
    });
    let friction = growth.friction_angle_degrees.map_or_else(
        || pair.map_or(0.0, |p| p.friction_coefficient),
        |angle| angle.to_radians().tan(),
    );
    Preparation {
        lower: super::setup::vector::<S>(block.from),
        upper: super::setup::vector::<S>(block.to),
        periodic: std::array::from_fn(|a| {
            // A box from face to face of a periodic axis is periodic itself.
            scene.grid.periodic[a]
                && block.from[a] <= 0.0
                && block.to[a] >= scene.grid.size[a] * (1.0 - 1e-12)
        }),
        sizes: match &growth.radii {
            Radii::Uniform { min, max } => Sizes::Uniform {
                smallest: 2.0 * min,
                largest: 2.0 * max,
            },
            Radii::List(radii) => Sizes::List(
                (0..number)
                    .map(|n| 2.0 * radii[n % radii.len().max(1)])
                    .collect(),
            ),
        },
        solid_fraction: match growth.amount {
            Amount::SolidFraction(fraction) => fraction,
            Amount::Number(_) => (count(number) * mean / block.measure()).min(0.95),
        },
        stop: Stop::Overlap(growth.stop.mean_overlap),
        seed: growth.seed,
        density: scene.materials[material].density.unwrap_or(1000.0),
        stiffness_per_diameter: stiffness,
        friction,
        overlap: growth.stop.mean_overlap,
        unbalanced: growth.stop.unbalanced_force,
        limit: u64::from(growth.stop.at_most_steps),
    }
}

/// Velocity and spin by id.
type Velocities = HashMap<u64, [f64; 6]>;

/// Velocity and spin of whatever moves, by id, the same on all ranks: grains may change their rank before they are needed.
/// Collective.
fn velocities<S: Space>(particles: &Particles<S>, domain: &Domain) -> Velocities {
    let mut mine = Vec::new();
    for k in 0..particles.owned() {
        let motion = &particles.motion[k];
        let velocity: [f64; 6] = std::array::from_fn(|n| match n {
            0..3 if n < S::DIMENSION => motion.velocity.get(n),
            3.. if n - 3 < S::Spin::COUNT => motion.spin.get(n - 3),
            _ => 0.0,
        });
        if velocity.iter().any(|v| v.to_bits() != 0) {
            mine.extend(particles.body[k].id.to_le_bytes());
            mine.extend(velocity.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    let mut all = HashMap::new();
    for message in domain.communicator().all_gather_bytes(&mine) {
        let (words, _) = message.as_chunks::<8>();
        let (entries, _) = words.as_chunks::<7>();
        for [id, velocity @ ..] in entries {
            all.insert(u64::from_le_bytes(*id), velocity.map(f64::from_le_bytes));
        }
    }
    all
}

fn set_velocity<S: Space>(particles: &mut Particles<S>, k: usize, velocity: &[f64; 6]) {
    let motion = &mut particles.motion[k];
    for a in 0..S::DIMENSION {
        motion.velocity.set(a, velocity[a]);
    }
    for a in 0..S::Spin::COUNT {
        motion.spin.set(a, velocity[3 + a]);
    }
}

/// Bonded grains on their way to rest without the fluid.
#[derive(Clone, Debug)]
pub struct Settling {
    bonds: u64,
    /// Bonds broken on the way.
    broken: u64,
    /// Solid steps taken.
    steps: u64,
    /// What each grain and body gets back once all is at rest.
    velocities: Velocities,
}

impl Settling {
    /// Bonds the contacts and stops all that moves; none where the case asks for no bonds. Collective.
    ///
    /// # Errors
    /// As [`Dem::advance`].
    pub fn begin<S: Space>(
        plan: &Plan,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<Option<Self>, Error> {
        if !plan.scene.grains.as_ref().is_some_and(|g| g.bond_at_start) {
            return Ok(None);
        }
        let velocities = velocities(particles, domain);
        for k in 0..particles.owned() {
            set_velocity(particles, k, &[0.0; 6]);
        }
        let bonds = dem.bond_existing_contacts(particles, domain)?;
        Ok(Some(Self {
            bonds: domain.communicator().all_reduce_sum_u64(bonds),
            broken: 0,
            steps: 0,
            velocities,
        }))
    }

    /// What a checkpoint keeps of it; numbers as bits.
    #[must_use]
    pub fn state(&self) -> Value {
        let mut velocities: Vec<(u64, [u64; 6])> = self
            .velocities
            .iter()
            .map(|(id, velocity)| (*id, velocity.map(f64::to_bits)))
            .collect();
        velocities.sort_unstable();
        json!({
            "bonds": self.bonds,
            "broken": self.broken,
            "steps": self.steps,
            "velocities": velocities,
        })
    }

    /// From [`Self::state`].
    ///
    /// # Errors
    /// [`Error::Io`] where it is none.
    pub fn restore(state: &Value) -> Result<Self, Error> {
        let wrong = || Error::Io("the saved preparation does not say how far it was".into());
        let number = |key: &str| state[key].as_u64().ok_or_else(wrong);
        let velocities: Vec<(u64, [u64; 6])> =
            serde_json::from_value(state["velocities"].clone()).map_err(|_| wrong())?;
        Ok(Self {
            bonds: number("bonds")?,
            broken: number("broken")?,
            steps: number("steps")?,
            velocities: velocities
                .into_iter()
                .map(|(id, velocity)| (id, velocity.map(f64::from_bits)))
                .collect(),
        })
    }

    /// Steps with damping until the grains stand still or `listen` wants an end; it is called after every few steps with the state as
    /// it is. Returns a line to print and what goes into the summary. Collective.
    ///
    /// # Errors
    /// As [`Dem::advance`], and those of `listen`.
    pub fn run<S: Space>(
        mut self,
        dem: &mut Dem<S>,
        particles: &mut Particles<S>,
        domain: &Domain,
        watch: &mut Watch,
        mut listen: impl FnMut(&Self, &Particles<S>, &Dem<S>, &mut Watch, Request) -> Result<(), Error>,
    ) -> Result<(String, Value), Error> {
        let until = Relaxation::default();
        let damping = dem.settings().local_damping;
        dem.set_local_damping(until.local_damping);
        let communicator = domain.communicator();
        let still: Stillness = loop {
            // Looks come after the same steps, however often a run was interrupted between.
            let to_look = until.look_every - self.steps % until.look_every;
            let batch = watch.steps().min(to_look).min(until.limit - self.steps);
            dem.advance_many(particles, domain, batch)?;
            self.steps += batch;
            self.broken += communicator.all_reduce_sum_u64(dem.take_breaks().len() as u64);
            let looks = self.steps.is_multiple_of(until.look_every) || self.steps >= until.limit;
            if looks {
                let now = dem.stillness(particles, domain)?;
                if self.steps >= until.limit || now.unbalanced() <= until.tolerance {
                    break now;
                }
            }
            let request = watch.ask(communicator);
            if request != Request::None {
                listen(&self, particles, dem, watch, request)?;
            }
        };
        dem.set_local_damping(damping);
        for k in 0..particles.owned() {
            let velocity = self.velocities.get(&particles.body[k].id);
            set_velocity(particles, k, velocity.unwrap_or(&[0.0; 6]));
        }
        let line = format!(
            "{} bonds; at rest after {} solid steps (unbalanced force {}); {} bonds broke on the way",
            self.bonds,
            self.steps,
            unbalanced_text(still.unbalanced()),
            self.broken
        );
        let report = json!({
            "bonds": self.bonds,
            "bonds_broken": self.broken,
            "solid_steps": self.steps,
            "unbalanced_force": still.unbalanced(),
            "largest_contact_force": still.contact,
        });
        Ok((line, report))
    }
}
