//! Preparation of the grains: growth, deposition, reading or listing; then numbering, saving, cutting, bonding
//! and relaxation.
//!
//! | step | file |
//! |---|---|
//! | a packing by growing radii | [`growth`] |
//! | a deposition under gravity | [`deposition`] |
//! | the free space outside structures for falling grains | [`free_space`] |
//! | numbers along a space-filling curve | [`numbering`] |
//! | bonds at the contacts, then relaxation with damping | [`rest`] |
//! | reports, interruption and resumption | [`supervision`] |
//!
//! Packing and deposition run on one rank, so that the sample depends on the seed only.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod deposition;
pub mod free_space;
pub mod growth;
pub mod numbering;
pub mod rest;
pub mod supervision;

use base::error::{Error, number};
use base::number::{real, to_u32};
use case::grains as case;
use case::sieve::Percentiles;
use dem::particles::{Body, Motion, Particles};
use dem::relax::unbalanced_text;
use dem::space::{Components, Space, vector};
use dem::{GrainDomain, Wall};
use deposition::Deposition;
use free_space::FreeSpace;
use growth::{PackingSettings, Sizes, Stop};
use plan::scene::aligned_box::AlignedBox;
use plan::scene::blocks::PlacedBlocks;
use plan::scene::grading::Grading;
use plan::scene::grains::{Cloud, GrainSource, assign};
use plan::scene::rock::list;
use plan::scene::sample;
use plan::scene::sample::ListedGrain;
use plan::scene::structures;
use plan::{Plan, contacts};
use serde_json::{Value, json};
use std::path::Path;
use supervision::Supervision;

/// Prepared grains with their report.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// Grains after cutting; on the first rank only.
    pub grains: Vec<ListedGrain>,
    /// Entry of `summary.json`.
    pub report: Value,
    /// One line for the terminal.
    pub line: String,
}

/// Parts of the engine that a deposition shares with the run.
pub struct Engine<S: Space> {
    /// Box of the grains.
    pub region: GrainDomain<S>,
    /// Walls, including those that are removed when the run begins.
    pub walls: Vec<Wall<S>>,
}

/// Makes, reads or lists the grains of a scene, saves the sample if the case requests it, and cuts it. Runs on one
/// rank.
///
/// # Errors
/// If the sample cannot be made or saved, and [`Error::Stopped`] when the supervisor stops the work.
pub fn prepare<S: Space>(
    plan: &Plan,
    folder: &Path,
    engine: &Engine<S>,
    supervision: &Supervision<'_, S>,
) -> Result<Prepared, Error> {
    let mut prepared = Prepared::default();
    if let Some(blocks) = &plan.scene.blocks {
        prepared.line = save_blocks(plan, blocks, folder)?;
    }
    let Some(scene) = &plan.scene.grains else {
        return Ok(prepared);
    };
    let materials = plan.scene.materials.iter();
    let names: Vec<String> = materials.map(|m| m.name.clone()).collect();
    let mut all = match &scene.source {
        GrainSource::List(list) => list.clone(),
        GrainSource::File { grains, path } => {
            prepared.line = format!("{} grains from {}", grains.len(), path.display());
            grains.clone()
        }
        GrainSource::Deposition { clouds, deposition } => {
            let deposition = deposition_of(plan, engine, clouds, deposition);
            prepared.deposit(&deposition, supervision)?
        }
        GrainSource::Growth {
            block,
            number,
            growth,
        } => {
            let packing = packing_of::<S>(plan, block, *number, growth);
            prepared.grow(&packing, scene.material, supervision)?
        }
    };
    if let GrainSource::Deposition { .. } | GrainSource::Growth { .. } = &scene.source {
        numbering::along_curve(&mut all);
        let counts = assign(&scene.zones, &mut all);
        for (zone, count) in scene.zones.iter().zip(counts) {
            let (name, material) = (&zone.name, &names[zone.material]);
            prepared.add(format!("zone {name}: {count} grains of {material}"));
        }
    }
    if let GrainSource::Growth { .. } = &scene.source {
        let before = all.len();
        all.retain(|grain| !structures::inside(&plan.scene.structures, grain));
        if all.len() < before {
            let taken = before - all.len();
            prepared.add(format!(
                "{taken} of them lay in structures and were removed"
            ));
        }
    }
    let dimension = plan.scene.grid.dimension;
    if let Some(path) = &scene.save {
        let text = sample::write(&all, dimension, &names);
        io::atomic::write(&folder.join(path), text.as_bytes())
            .map_err(|e| Error::Io(e.to_string()))?;
    }
    prepared.cut(&scene.cut, &mut all);
    if let Value::Object(report) = &mut prepared.report {
        let radii = all.iter().map(|grain| grain.radius);
        if let Some(made) = Percentiles::from_radii(radii, dimension) {
            report.insert("grading".into(), json!(made));
            prepared.add(made.to_string());
        }
    }
    prepared.grains = all;
    Ok(prepared)
}

impl Prepared {
    /// Inserts the grains into the arrays of the engine: each gets its id, in the order of the list, and mass and
    /// moment of inertia from the density of its material.
    pub fn insert_into<S: Space>(&self, plan: &Plan, particles: &mut Particles<S>) {
        for (id, grain) in (plan.scene.first_grain()..).zip(&self.grains) {
            let density = plan.scene.materials[grain.material].density.unwrap_or(1.0);
            let body = Body::uniform::<S>(id, grain.radius, density, to_u32(grain.material));
            let motion = Motion::new(grain.position, grain.velocity, grain.angular_velocity);
            particles.insert(body, motion);
        }
    }

    /// Adds a text to the line.
    fn add(&mut self, part: String) {
        self.line = match self.line.as_str() {
            "" => part,
            line => format!("{line}; {part}"),
        };
    }

    /// Deposits grains and adds the result to the line.
    fn deposit<S: Space>(
        &mut self,
        deposition: &Deposition<S>,
        supervision: &Supervision<'_, S>,
    ) -> Result<Vec<ListedGrain>, Error> {
        let (grains, report) = deposition.run(supervision)?;
        let last = report.convergence.last().copied().unwrap_or_default();
        self.line = format!(
            "deposition: {} of {} grains remain after {} solid steps ({}): {:.2} contacts each, \
             largest overlap {:.1e} d, kinetic energy {:.1e} m g d, unbalanced force {}",
            report.grains,
            report.fallen,
            last.steps,
            if report.settled {
                "settled"
            } else {
                "NOT settled within the allowed steps"
            },
            report.coordination,
            report.largest_overlap,
            last.kinetic_energy,
            unbalanced_text(last.unbalanced)
        );
        let closed = deposition.free_space.closed;
        if closed > 0.0 {
            let unit = if S::DIMENSION == 2 { "m2" } else { "m3" };
            self.add(format!(
                "{closed:.3e} {unit} of the clouds lie in closed cavities of structures and receive no grains"
            ));
        }
        self.report = json!({ "deposition": report });
        if let Some(level) = deposition.trim_above
            && let Some(top) = self.report["deposition"]["top"].as_f64()
            && top < level
        {
            self.add(format!(
                "the surface is {:.3e} m below the trimming level: use more grains",
                level - top
            ));
        }
        let fallen = grains.iter();
        Ok(fallen
            .map(|grain| at_rest(&grain.position, grain.radius, grain.material as usize))
            .collect())
    }

    /// Grows a packing of one material and adds its properties to the line.
    fn grow<S: Space>(
        &mut self,
        packing: &PackingSettings<S>,
        material: usize,
        supervision: &Supervision<'_, S>,
    ) -> Result<Vec<ListedGrain>, Error> {
        let packing = packing.pack(supervision)?;
        let r = &packing.report;
        self.line = format!(
            "{} grains grown in {} solid steps: solid fraction {:.4}, {:.2} contacts each, \
             mean overlap {:.2e} d, unbalanced force {}, sizes x {:.4}",
            r.grains,
            r.steps,
            r.solid_fraction,
            r.coordination,
            r.mean_overlap,
            unbalanced_text(r.unbalanced),
            r.size_factor
        );
        self.report = json!({ "growth": r });
        let grown = packing.grains.iter();
        Ok(grown
            .map(|grain| at_rest(&grain.position, grain.radius, material))
            .collect())
    }

    /// Removes the grains that touch the boxes.
    fn cut(&mut self, boxes: &[(String, AlignedBox)], grains: &mut Vec<ListedGrain>) {
        if boxes.is_empty() {
            return;
        }
        let before = grains.len();
        let touches = |g: &ListedGrain| boxes.iter().any(|(_, b)| b.touches(g.position, g.radius));
        grains.retain(|grain| !touches(grain));
        let left = grains.len();
        self.add(format!("{left} of {before} grains remain after cutting"));
    }
}

/// Returns a stationary grain.
fn at_rest<C: Components>(position: &C, radius: f64, material: usize) -> ListedGrain {
    ListedGrain {
        position: components(position),
        radius,
        velocity: [0.0; 3],
        angular_velocity: [0.0; 3],
        material,
    }
}

/// Saves the blocks if the case requests this; returns a line about them.
fn save_blocks(plan: &Plan, blocks: &PlacedBlocks, folder: &Path) -> Result<String, Error> {
    if let Some(path) = &blocks.save {
        let text = list::write(blocks.list.iter().map(|block| list::SavedBlock {
            solid: &block.solid,
            material: &plan.scene.materials[block.material].name,
            fixed: block.fixed,
        }));
        io::atomic::write(&folder.join(path), text.as_bytes())
            .map_err(|e| Error::Io(e.to_string()))?;
    }
    Ok(format!(
        "{} blocks with a total volume of {} m3, {} of them fixed",
        blocks.number,
        number(blocks.volume),
        blocks.fixed
    ))
}

/// Returns three components; components that the vector does not have are zero.
fn components<C: Components>(vector: &C) -> [f64; 3] {
    std::array::from_fn(|a| if a < C::COUNT { vector.get(a) } else { 0.0 })
}

/// Returns the deposition settings of a plan.
fn deposition_of<S: Space>(
    plan: &Plan,
    engine: &Engine<S>,
    clouds: &[Cloud],
    written: &case::Deposition,
) -> Deposition<S> {
    let scene = &plan.scene;
    let mut laws = Vec::new();
    let with = |stiffness: Option<f64>| {
        let mut law = scene.contact_law();
        let angle = written.friction_angle_degrees;
        let friction = angle.map(|angle| angle.to_radians().tan());
        law.model_mut().prepare(stiffness, friction);
        law
    };
    if let (Some(soft), Some(table)) = (written.falling_stiffness, &scene.contact) {
        let stiffness = |cloud: &Cloud| {
            let (low, high) = cloud.grading.bounds();
            let pair = [to_u32(cloud.material); 2];
            table.model().normal_stiffness(pair, low + high)
        };
        let full = clouds.iter().map(stiffness).fold(0.0, f64::max);
        let mut stiffness = soft;
        while stiffness < full * (1.0 - 1e-9) {
            laws.push(with(Some(stiffness)));
            stiffness *= 10.0;
        }
    }
    laws.push(with(None));
    let corners: Vec<_> = (clouds.iter())
        .map(|cloud| [cloud.block.from, cloud.block.to])
        .collect();
    let up = (0..scene.grid.dimension).find(|&a| scene.gravity[a].abs() > 0.0);
    let up = up.unwrap_or(scene.grid.dimension - 1);
    let bounds = free_space::Boundaries {
        dimension: scene.grid.dimension,
        region: [
            components(&engine.region.lower),
            components(&engine.region.upper),
        ],
        periodic: engine.region.periodic,
        clouds: &corners,
        up: (up, scene.gravity[up] <= 0.0),
    };
    let smallest = clouds.iter().map(|cloud| cloud.grading.bounds().0);
    let smallest = smallest.fold(f64::INFINITY, f64::min);
    Deposition {
        free_space: FreeSpace::new(&scene.structures, &bounds, smallest),
        clouds: (clouds.iter())
            .map(|cloud| deposition::Cloud {
                lower: vector::<S>(cloud.block.from),
                upper: vector::<S>(cloud.block.to),
                grading: cloud.grading.clone(),
                number: cloud.number,
                density: scene.materials[cloud.material].density.unwrap_or(1000.0),
                material: index(cloud.material),
            })
            .collect(),
        region: engine.region,
        // The walls move only when the run begins.
        walls: (engine.walls.iter().cloned())
            .map(|wall| Wall {
                velocity: S::Vector::default(),
                ..wall
            })
            .collect(),
        seed: written.seed,
        laws,
        materials: index(scene.materials.len().max(1)),
        gravity: vector::<S>(scene.gravity),
        local_damping: written.local_damping,
        trim_above: written.trim_above,
        kinetic_energy: written.stop.kinetic_energy,
        unbalanced: written.stop.unbalanced_force,
        limit: u64::from(written.stop.at_most_steps),
        step_ratio: STEP_RATIO.min(MORE_CONTACTS * contacts::packing_limit(scene)),
    }
}

/// Solid time step of falling grains divided by the critical one, if no strong dashpots reduce it.
const STEP_RATIO: f64 = 0.2;
/// Maximum number of contacts of a grain in the densest packing divided by that in a deposited one: 12 to 6.
const MORE_CONTACTS: f64 = 2.0;

/// Returns the packing settings of a plan.
fn packing_of<S: Space>(
    plan: &Plan,
    block: &AlignedBox,
    number: usize,
    growth: &case::Growth,
) -> PackingSettings<S> {
    let scene = &plan.scene;
    let material = scene.grains.as_ref().map_or(0, |g| g.material);
    let mean = if S::DIMENSION == 2 {
        std::f64::consts::PI * growth.radii.mean_power(2, 2)
    } else {
        4.0 / 3.0 * std::f64::consts::PI * growth.radii.mean_power(3, 3)
    };
    let mean_diameter = 2.0 * growth.radii.mean_power(1, S::DIMENSION);
    let law = scene.contact.as_ref().map(|contact| contact.model());
    let stiffness = law.map_or(1e6, |law| {
        law.growth_stiffness(to_u32(material), mean_diameter)
    });
    let friction = growth.friction_angle_degrees.map_or_else(
        || law.map_or(0.0, |law| law.friction([to_u32(material); 2])),
        |angle| angle.to_radians().tan(),
    );
    PackingSettings {
        lower: vector::<S>(block.from),
        upper: vector::<S>(block.to),
        periodic: std::array::from_fn(|a| {
            // A box that extends from face to face of a periodic axis is periodic itself.
            scene.grid.periodic[a]
                && block.from[a] <= 0.0
                && block.to[a] >= scene.grid.size[a] * (1.0 - 1e-12)
        }),
        sizes: match &growth.radii {
            case::Radii::Uniform { min, max } => Sizes::Uniform {
                smallest: 2.0 * min,
                largest: 2.0 * max,
            },
            case::Radii::List(radii) => Sizes::List(
                (0..number)
                    .map(|n| 2.0 * radii[n % radii.len().max(1)])
                    .collect(),
            ),
            case::Radii::Sieve(curve) => {
                // The scene has checked that the radii can be drawn.
                let radii = Grading::of_sieves(curve).radii(number, S::DIMENSION, (growth.seed, 0));
                Sizes::List(radii.unwrap_or_default().iter().map(|r| 2.0 * r).collect())
            }
        },
        solid_fraction: match growth.amount {
            case::Amount::SolidFraction(fraction) => fraction,
            case::Amount::Number(_) => (real(number) * mean / block.measure()).min(0.95),
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

/// Returns an index of a material, or a number of materials, in the integer type of the engine.
fn index(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}
