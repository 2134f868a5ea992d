//! Estimated maximum overlap of contacts from impacts.
//!
//! A body of mass m that hits a spring k with dashpot c at speed v compresses it by
//!
//! ```text
//! delta = v (m/k)^½ exp(-zeta/(1 - zeta²)^½ arctan((1 - zeta²)^½/zeta)),   zeta = c/(2 (m k)^½)
//! delta = (15 m v²/(8 K))^(2/5)       where the stiffness hardens as K delta^½
//! ```
//!
//! the first maximum of a damped oscillation and the energy of a Hertzian contact (K. L. Johnson, Contact
//! mechanics, 1985, sections 4.2 and 11.4). Contacts are small compared with the bodies: at delta = 0.1 R the
//! circle of contact with a plane has 0.44 R, far from the small contact that all laws assume (Johnson, section
//! 4.1), and the plan warns. At delta = R the centre of the body is in the surface: beyond it, a body leaves a thin
//! wall on the other side, and two bodies pass through each other, as observed in runs.
//!
//! The speed is the largest one known before the run: the difference between the initial velocities of two bodies,
//! driven bodies and walls included, with the reduced mass of the two; and the speed after a fall to the end of the
//! domain for a body that touches nothing at the start. In water no body falls faster than its settling speed: in that
//! of a lattice, and in that of a seepage whose grid fills the domain, by the drag law of the case at the largest
//! porosity.
//!
//! Blocks of a rock mass are supported by others at the start. Which of them come loose and how far they fall is not
//! known before the run: their impacts are not judged, and the plan states that after a fall to the end of the domain.

use super::explicit_drag::{GrainBed, grain_beds};
use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::findings::{Findings, at_least, number};
use crate::scene::grains::{GrainSource, Grains};
use crate::scene::observe::RegionAction;
use crate::scene::pairs::{self, Ball};
use crate::scene::sample::ListedGrain;
use crate::scene::speed::settling;
use base::error::Remedy;
use base::number::{real, to_u32, whole};
use base::vector::norm;
use darcy::drag::GrainSize;
use dem::contact::{ContactModel, Depth, StaticContact};
use nalgebra::Vector3;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

/// Overlap in radii above which a contact is no longer small.
const LARGE: f64 = 0.1;
/// Overlap in radii above which a body passes through.
const PENETRATION: f64 = 1.0;
/// Gap in radii below which a body is supported by its neighbour instead of falling onto it.
const SUPPORT_GAP: f64 = 0.05;

/// Body that moves under forces.
struct Moving {
    path: String,
    material: usize,
    mass: f64,
    /// Radius \[m\]; for a polyhedron that of the inscribed sphere.
    radius: f64,
    /// Radius of the enclosing sphere \[m\].
    reach: f64,
    velocity: [f64; 3],
    at: [f64; 3],
    /// `true` if the body may fall from its initial position.
    may_fall: bool,
    /// `true` if this is one body; `false` if it stands for several of a source.
    single: bool,
    /// `true` for a grain that appears during the run, in free space: nothing supports it, and it supports nothing.
    appears: bool,
}

impl Moving {
    /// Returns a stationary ball that does not fall.
    fn ball(scene: &Scene, path: String, material: usize, radius: f64) -> Self {
        Self {
            path,
            material,
            mass: scene.mass(material, radius),
            radius,
            reach: radius,
            velocity: [0.0; 3],
            at: [0.0; 3],
            may_fall: false,
            single: false,
            appears: false,
        }
    }

    /// Returns a grain that may fall.
    fn grain(scene: &Scene, path: String, grain: &ListedGrain) -> Self {
        Self {
            velocity: grain.velocity,
            at: grain.position,
            may_fall: true,
            single: true,
            ..Self::ball(scene, path, grain.material, grain.radius)
        }
    }
}

/// Body or wall that no impact moves.
#[derive(Clone, Copy)]
struct Immovable {
    velocity: [f64; 3],
    material: usize,
    /// Radius of a disc or sphere \[m\]; none of another shape.
    radius: Option<f64>,
}

impl Immovable {
    /// Returns a stationary body of a material that is not round.
    fn still(material: usize) -> Self {
        Self {
            velocity: [0.0; 3],
            material,
            radius: None,
        }
    }
}

/// Bodies, blocks, grains and walls of a scene, as partners of impacts.
#[derive(Default)]
struct ImpactPartners {
    /// All bodies that move under forces.
    moving: Vec<Moving>,
    /// Bodies and walls that are stationary or driven.
    fixed: Vec<Immovable>,
    /// Balls around bodies that are stationary or driven.
    standing: Vec<Ball>,
}

impl ImpactPartners {
    fn new(scene: &Scene) -> Self {
        let mut all = Self::default();
        all.add_bodies(scene);
        all.add_blocks(scene);
        if let Some(grains) = &scene.grains {
            all.add_grains(scene, grains);
        }
        all.add_generated(scene);
        all.fixed.extend(scene.walls.iter().map(|wall| Immovable {
            velocity: wall.largest_velocity(),
            ..Immovable::still(wall.material)
        }));
        all.drop_wrong(scene);
        all
    }

    /// Returns the blocks of a rock mass, as if nothing supported them.
    fn loose_blocks(scene: &Scene) -> Self {
        let mut all = Self::default();
        all.add_blocks(scene);
        all.drop_wrong(scene);
        for block in &mut all.moving {
            block.may_fall = true;
        }
        all
    }

    /// Removes bodies with a wrong field, which other findings name.
    fn drop_wrong(&mut self, scene: &Scene) {
        let materials = scene.materials.len();
        self.moving
            .retain(|one| one.mass > 0.0 && one.radius > 0.0 && one.material < materials);
    }

    fn add_bodies(&mut self, scene: &Scene) {
        for (n, body) in scene.bodies.iter().enumerate() {
            if body.mobility == Mobility::Free {
                let volume = body.solid.as_ref().map(|solid| solid.shape.volume());
                let path = format!("bodies[{n}].motion");
                let ball = Moving::ball(scene, path, body.material, body.radius);
                self.moving.push(Moving {
                    mass: volume.map_or(ball.mass, |volume| scene.density(body.material) * volume),
                    radius: body.thickness().map_or(body.radius, |wide| 0.5 * wide),
                    velocity: body.velocity,
                    at: body.position,
                    may_fall: true,
                    single: true,
                    ..ball
                });
            } else {
                self.fixed.push(Immovable {
                    velocity: body.largest_motion()[0],
                    radius: body.solid.is_none().then_some(body.radius),
                    ..Immovable::still(body.material)
                });
                self.standing.push(Ball {
                    at: body.position,
                    reach: (1.0 + SUPPORT_GAP) * body.radius,
                });
            }
        }
    }

    fn add_blocks(&mut self, scene: &Scene) {
        for block in scene.blocks.iter().flat_map(|blocks| &blocks.list) {
            let solid = &block.solid;
            if block.fixed {
                self.fixed.push(Immovable::still(block.material));
            } else {
                let faces = solid.shape.half_spaces().iter();
                self.moving.push(Moving {
                    path: "blocks.initial".into(),
                    material: block.material,
                    mass: scene.density(block.material) * solid.shape.volume(),
                    radius: faces.map(|face| face.offset).fold(f64::INFINITY, f64::min),
                    reach: solid.shape.radius(),
                    velocity: block.velocity,
                    at: solid.position.into(),
                    // A block of a rock mass is supported by others.
                    may_fall: false,
                    single: true,
                    appears: false,
                });
            }
        }
    }

    fn add_grains(&mut self, scene: &Scene, grains: &Grains) {
        match &grains.source {
            GrainSource::List(list) => {
                let listed = list.iter().enumerate().map(|(n, grain)| {
                    let path = format!("grains.initial.list[{n}]");
                    Moving::grain(scene, path, grain)
                });
                self.moving.extend(listed);
            }
            GrainSource::File { grains: list, .. } => {
                let path = || "grains.initial.file".into();
                let listed = list.iter().map(|g| Moving::grain(scene, path(), g));
                self.moving.extend(listed);
            }
            // Prepared grains are at rest.
            GrainSource::Growth { .. } | GrainSource::Deposition { .. } => {
                for material in grains.materials() {
                    for radius in grains.radii.iter().flat_map(|(low, high)| [*low, *high]) {
                        let path = "grains.initial".into();
                        let ball = Moving::ball(scene, path, material, radius);
                        self.moving.push(ball);
                    }
                }
                for (n, zone) in grains.zones.iter().enumerate() {
                    let (Some(velocity), Some((_, radius))) = (zone.velocity, grains.radii) else {
                        continue;
                    };
                    let path = format!("grains.zones[{n}].velocity");
                    self.moving.push(Moving {
                        velocity,
                        ..Moving::ball(scene, path, zone.material, radius)
                    });
                }
            }
        }
    }

    fn add_generated(&mut self, scene: &Scene) {
        for (n, region) in scene.regions.iter().enumerate() {
            if let RegionAction::Generate {
                radii,
                material,
                velocity,
                ..
            } = &region.action
            {
                let block = &region.block;
                let highest = std::array::from_fn(|a| {
                    if scene.gravity[a] < 0.0 {
                        block.to[a]
                    } else {
                        block.from[a]
                    }
                });
                let (low, high) = radii.bounds();
                for radius in [low, high] {
                    let path = format!("regions[{n}].action.generate");
                    self.moving.push(Moving {
                        velocity: *velocity,
                        at: highest,
                        may_fall: true,
                        appears: true,
                        ..Moving::ball(scene, path, *material, radius)
                    });
                }
            }
        }
    }
}

/// Marks bodies that touch another at the start as not falling.
fn mark_supported_bodies(scene: &Scene, moving: &mut [Moving], standing: &[Ball]) {
    let mut balls: Vec<Ball> = moving
        .iter()
        .map(|one| Ball {
            at: one.at,
            // A ball without a reach is near none.
            reach: if one.appears {
                0.0
            } else {
                (1.0 + SUPPORT_GAP) * one.reach
            },
        })
        .collect();
    balls.extend_from_slice(standing);
    let mut touches = vec![false; balls.len()];
    let _ = pairs::near(&balls, [None; 3], |one, other| {
        touches[one] = true;
        touches[other] = true;
        ControlFlow::Continue(())
    });
    for (one, touches) in moving.iter_mut().zip(touches) {
        if one.appears {
            continue;
        }
        // A wall that is removed during the run is not a permanent support.
        let mut lasting = scene.walls.iter().filter(|wall| !wall.is_timed());
        let next_to_wall = lasting.any(|wall| {
            let near = (1.0 + SUPPORT_GAP) * one.reach;
            wall.surface.as_ref().map_or_else(
                || {
                    let away: f64 = (0..3)
                        .map(|a| (one.at[a] - wall.point[a]) * wall.normal[a])
                        .sum();
                    away < near
                },
                |surface| surface.is_within(&Vector3::from(one.at), near),
            )
        });
        one.may_fall &= !touches && !next_to_wall;
    }
}

/// Returns the overlap \[m\] of an impact at `speed` of a body on the heaviest and smallest partner of a class.
fn overlap(law: &dyn ContactModel, one: &Moving, partner: &Class, speed: f64) -> f64 {
    let hardens = law.impact_speed().is_some();
    let known = 2e-4 * one.radius;
    let mass = one.mass / (1.0 + one.mass / partner.mass);
    let springs = law.springs(&StaticContact {
        materials: [to_u32(one.material), to_u32(partner.material)],
        diameter: one.radius + partner.radius.unwrap_or(one.radius),
        radius: (partner.radius)
            .map_or(one.radius, |other| one.radius / (1.0 + one.radius / other)),
        mass,
        overlap: hardens.then_some(known),
        depth: Depth::Start,
        bonded: false,
    });
    let (stiffness, dashpot) = (springs.stiffness[0], springs.dashpots[0]);
    if hardens {
        return (15.0 * mass * speed * speed / (8.0 * stiffness / known.sqrt())).powf(0.4);
    }
    let damping = 0.5 * dashpot / (mass * stiffness).sqrt();
    let rest = (1.0 - damping * damping).max(0.0).sqrt();
    let decay = if rest > 1e-6 {
        damping / rest * (rest / damping.max(1e-300)).atan()
    } else {
        1.0
    };
    speed * (mass / stiffness).sqrt() * (-decay).exp()
}

/// Deepest impact to be expected.
struct Impact<'a> {
    one: &'a Moving,
    speed: f64,
    /// Part of the speed gained in a fall [m/s].
    fall: f64,
    /// Overlap divided by the radius.
    part: f64,
}

/// Class of impact partners of one material whose velocities lie in a box and whose radii differ by a factor of two
/// at most.
struct Class {
    low: [f64; 3],
    high: [f64; 3],
    /// Largest mass \[kg\].
    mass: f64,
    material: usize,
    /// Smallest radius \[m\]; none of walls and of bodies that are not round.
    radius: Option<f64>,
    /// The only member, by its index among the moving bodies; none of a class of several or of immovable bodies.
    only: Option<usize>,
}

impl Class {
    /// Returns the largest squared difference between a velocity and the velocities of the class.
    fn squared_speed(&self, velocity: &[f64; 3]) -> f64 {
        (0..3)
            .map(|a| {
                let v = velocity[a];
                (v - self.low[a]).max(self.high[a] - v).powi(2)
            })
            .sum()
    }
}

/// Returns a number that is the same for radii \[m\] between two powers of two.
fn size_class(radius: f64) -> usize {
    /// No positive number has a smaller logarithm to the base of two.
    const LEAST: f64 = -1100.0;
    whole(radius.log2().floor() - LEAST)
}

/// Number of divisions of the range of velocities along each axis into classes.
const DIVISIONS: f64 = 8.0;

/// Returns the classes of all moving and stationary bodies; stationary or driven bodies have infinite mass.
///
/// A light, fast grain and a stationary boulder are in two classes, so that no pair combines the speed of one with
/// the mass of the other.
fn classes(moving: &[Moving], fixed: &[Immovable]) -> Vec<Class> {
    let alone = |velocity, mass, material, radius, only| Class {
        low: velocity,
        high: velocity,
        mass,
        material,
        radius,
        only,
    };
    let driven = fixed
        .iter()
        .map(|one| alone(one.velocity, f64::INFINITY, one.material, one.radius, None));
    let free = moving.iter().enumerate().map(|(n, one)| {
        let round = one.radius.to_bits() == one.reach.to_bits();
        let radius = round.then_some(one.radius);
        let only = one.single.then_some(n);
        alone(one.velocity, one.mass, one.material, radius, only)
    });
    let all: Vec<Class> = free.chain(driven).collect();
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for one in &all {
        for a in 0..3 {
            low[a] = low[a].min(one.low[a]);
            high[a] = high[a].max(one.low[a]);
        }
    }
    let mut classes: BTreeMap<([usize; 5], Option<usize>), Class> = BTreeMap::new();
    for one in all {
        let velocity = one.low;
        let part = |a: usize| {
            let range = high[a] - low[a];
            let share = if range > 0.0 {
                (velocity[a] - low[a]) / range
            } else {
                0.0
            };
            whole((share * DIVISIONS).floor().min(DIVISIONS - 1.0))
        };
        let finite = usize::from(one.mass.is_finite());
        let place = [part(0), part(1), part(2), finite, one.material];
        let size = one.radius.map(size_class);
        match classes.entry((place, size)) {
            Entry::Vacant(entry) => {
                entry.insert(one);
            }
            Entry::Occupied(entry) => {
                let class = entry.into_mut();
                for a in 0..3 {
                    class.low[a] = class.low[a].min(velocity[a]);
                    class.high[a] = class.high[a].max(velocity[a]);
                }
                class.mass = class.mass.max(one.mass);
                class.radius = class.radius.zip(one.radius).map(|(a, b)| a.min(b));
                class.only = None;
            }
        }
    }
    classes.into_values().collect()
}

/// Returns the largest speed of a body after a fall to the end of the domain [m/s]; in water at most its settling
/// speed, `settling` on a lattice.
fn fall_speed(scene: &Scene, one: &Moving, settling: Option<f64>) -> f64 {
    let energy: f64 = (0..scene.grid.dimension)
        .map(|a| {
            let g = scene.gravity[a];
            let below = if g < 0.0 {
                one.at[a]
            } else {
                scene.grid.size[a] - one.at[a]
            };
            2.0 * g.abs() * (below - one.reach).max(0.0)
        })
        .sum();
    energy
        .sqrt()
        .min(settling.unwrap_or(f64::INFINITY))
        .min(seepage_settling(scene, one).unwrap_or(f64::INFINITY))
}

/// Returns the settling speed [m/s] of a ball in still water of a seepage that fills the domain, by its drag law: the
/// largest of all media, without neighbours. `None` in ground with air and for other bodies.
fn seepage_settling(scene: &Scene, one: &Moving) -> Option<f64> {
    let seepage = scene.seepage.as_ref()?;
    let written = &seepage.written;
    let (dimension, size) = (scene.grid.dimension, scene.grid.size);
    let fills = (0..dimension).all(|a| {
        let (from, length) = (
            seepage.origin[a],
            real(seepage.cells[a]) * seepage.spacing[a],
        );
        let within = 1e-9 * size[a];
        from <= within && from + length >= size[a] - within
    });
    let ball = one.radius.to_bits() == one.reach.to_bits();
    if written.unsaturated.is_some() || !seepage.drains.is_empty() || !fills || !ball {
        return None;
    }
    let grain = GrainSize::new(dimension, one.radius);
    let gravity = norm(scene.gravity);
    let weight = (one.mass - written.density * grain.volume).max(0.0) * gravity;
    let law = written.drag();
    let beds = grain_beds(seepage, written.porosity_cap(), &grain);
    let speeds = beds.map(|GrainBed { bed, measure }| {
        // The drag grows with the speed: bisect its logarithm.
        let (mut low, mut high) = (1e-12_f64, 1e6_f64);
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            let flux = measure * middle;
            if law.model().coefficient(&bed, &grain, flux) * flux < weight {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    });
    speeds.reduce(f64::max)
}

/// Returns the largest settling speed in the water of a lattice [m/s]; none without.
fn settling_speed(scene: &Scene) -> Option<f64> {
    scene.flow.as_ref().map(|flow| {
        let fastest = settling::fastest(scene, flow);
        fastest.map_or(0.0, |(_, speed)| speed)
    })
}

fn deepest<'a>(
    scene: &Scene,
    law: &dyn ContactModel,
    moving: &'a [Moving],
    fixed: &[Immovable],
) -> Option<Impact<'a>> {
    let settling = settling_speed(scene);
    let classes = classes(moving, fixed);
    let mut deepest: Option<Impact<'_>> = None;
    for (n, one) in moving.iter().enumerate() {
        let fall = if one.may_fall {
            fall_speed(scene, one, settling)
        } else {
            0.0
        };
        for class in classes.iter().filter(|class| class.only != Some(n)) {
            let speed = (class.squared_speed(&one.velocity) + fall * fall).sqrt();
            if speed <= 0.0 {
                continue;
            }
            let part = overlap(law, one, class, speed) / one.radius;
            if part.is_finite() && deepest.as_ref().is_none_or(|known| part > known.part) {
                deepest = Some(Impact {
                    one,
                    speed,
                    fall,
                    part,
                });
            }
        }
    }
    deepest
}

/// Returns the speed \[m/s\] and the overlap in radii of the deepest impact of a block of a rock mass that comes loose
/// and falls to the end of the domain; none without such blocks.
pub(super) fn of_loose_blocks(scene: &Scene) -> Option<(f64, f64)> {
    let law = scene.contact.as_ref()?.model();
    let blocks = ImpactPartners::loose_blocks(scene);
    // They may fall on walls, and on blocks that stay.
    let walls = scene.walls.iter().map(|wall| wall.material);
    let met: BTreeSet<usize> = (blocks.moving.iter().map(|block| block.material))
        .chain(walls)
        .collect();
    let fixed: Vec<Immovable> = (blocks.fixed.into_iter())
        .chain(met.into_iter().map(Immovable::still))
        .collect();
    let impact = deepest(scene, law, &blocks.moving, &fixed)?;
    Some((impact.speed, impact.part))
}

/// Compares the overlaps of impacts with the radii.
pub(super) fn check(scene: &Scene, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let Some(contact) = &scene.contact else {
        return;
    };
    let ImpactPartners {
        mut moving,
        fixed,
        standing,
    } = ImpactPartners::new(scene);
    mark_supported_bodies(scene, &mut moving, &standing);
    let Some(impact) = deepest(scene, contact.model(), &moving, &fixed) else {
        return;
    };
    margins.push(margin(
        "overlap of an impact / radius",
        impact.part,
        LARGE,
        "contact",
    ));
    if impact.part <= LARGE {
        return;
    }
    let where_from = if impact.fall > 0.5 * impact.speed {
        ", after its fall to the end of the domain,"
    } else {
        ""
    };
    let harder = if contact.model().impact_speed().is_some() {
        (impact.part / LARGE).powf(2.5)
    } else {
        (impact.part / LARGE).powi(2)
    };
    let reason = format!(
        "{} of {} kg hits others at up to {} m/s{where_from} and overlaps them by {} of its radius of {} m; the \
         overlap should be at most {LARGE} of the radius",
        impact.one.path,
        number(impact.one.mass),
        number(impact.speed),
        number(impact.part),
        number(impact.one.radius),
    );
    let remedy = Remedy::from(format!(
        "multiply the normal stiffness by {}, or use slower bodies",
        number(at_least(harder))
    ));
    let guard = scene.guards.max_overlap;
    if impact.part >= PENETRATION {
        findings.unstable(
            "contact",
            format!("{reason}; at {PENETRATION} and above bodies pass through thin walls and through each other"),
            remedy,
        );
    } else if impact.part >= guard {
        findings.unstable(
            "contact",
            format!("{reason}; the run stops above `guards.max_overlap` = {guard}"),
            remedy,
        );
    } else {
        findings.warn("contact", reason, remedy);
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use std::path::Path;

    /// Returns the plan of a disc that hits another, or that falls to the floor.
    fn planned(change: &[&str]) -> Plan {
        let text = case::examples::find("collision").unwrap().text;
        let change: Vec<String> = change.iter().map(|set| (*set).to_owned()).collect();
        let document = Document::read(text, &change, Path::new(".")).unwrap();
        Plan::prepare(document).unwrap()
    }

    fn part(plan: &Plan) -> f64 {
        let margins = plan.margins.iter();
        let mut found = margins.filter(|margin| margin.limit.starts_with("overlap of an impact"));
        found.next().map_or(0.0, |margin| margin.value)
    }

    fn severity(plan: &Plan) -> Option<Severity> {
        let mut found = plan.warnings.iter().filter(|p| p.path == "contact");
        found.next().map(|problem| problem.severity)
    }

    /// Checks that a stiffness per diameter acts with the mean diameter of a grain and a boulder, in the overlap of
    /// their impact and in the critical step, and that only pairs of materials which meet count.
    #[test]
    fn the_stiffness_of_an_impact_is_that_of_its_pair() {
        let planned = |stiffness: serde_json::Value, pairs: serde_json::Value| {
            let case = serde_json::json!({
                "domain": {"size": [0.4, 0.4, 0.4], "spacing": 0.02},
                "materials": {"g": {"density": 2600}, "h": {"density": 2600}},
                "contact": {"linear": {"normal_stiffness": stiffness, "pairs": pairs}},
                "grains": {"material": "g", "initial": {"list": [
                    {"position": [0.149, 0.2, 0.2], "radius": 0.00025, "velocity": [0.05, 0, 0]}]}},
                "bodies": [{"name": "boulder", "material": "h", "shape": {"sphere": {"radius": 0.05}},
                    "position": [0.2, 0.2, 0.2], "motion": {"free": {}}}],
                "time": {"end": 0.04},
            });
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            Plan::prepare(document).unwrap()
        };
        let none = serde_json::json!([]);
        // The mean diameter of both is 0.05025 m.
        let by_diameter = planned(serde_json::json!({"per_diameter": 1e5}), none.clone());
        let absolute = planned(serde_json::json!({"absolute": 5025.0}), none);
        let pair = serde_json::json!([{"materials": ["g", "h"], "normal_stiffness": {"absolute": 5025.0}}]);
        let of_pair = planned(serde_json::json!({"absolute": 50.0}), pair);
        for plan in [&by_diameter, &of_pair] {
            approx::assert_relative_eq!(part(plan), part(&absolute), max_relative = 1e-9);
        }
        let critical = |plan: &Plan| {
            let found = crate::critical_step::critical_solid_time_step(&plan.scene);
            found.unwrap().time_step
        };
        approx::assert_relative_eq!(
            critical(&by_diameter),
            critical(&absolute),
            max_relative = 1e-9
        );
    }

    /// Checks that grains of a feed fall like a listed grain at the top of its box, in a case without other grains.
    #[test]
    fn a_generated_grain_falls_like_a_listed_one() {
        let case = |grains: serde_json::Value, regions: serde_json::Value| {
            let mut case = serde_json::json!({
                "domain": {"size": [0.2, 0.2, 1.0], "spacing": 0.02}, "gravity": [0, 0, -9.81],
                "materials": {"m": {"density": 2500}},
                "contact": {"linear": {"normal_stiffness": {"absolute": 1e3}, "friction_angle_degrees": 25}},
                "box_walls": ["z_min"], "box_wall_material": "m", "time": {"end": 1},
                "probes": [{"name": "g", "every": 0.1, "at": {"grains": {}}}],
                "output": {"grains": {"every": 0.5}}
            });
            if !grains.is_null() {
                case["grains"] = grains;
            }
            case["regions"] = regions;
            let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
            Plan::prepare(document).unwrap_or_else(|problems| panic!("{problems:#?}"))
        };
        let fed = case(
            serde_json::Value::Null,
            serde_json::json!([{"name": "feed", "box": {"from": [0, 0, 0.85], "to": [0.2, 0.2, 0.95]},
                "action": {"generate": {"rate": 10, "material": "m", "radii": {"list": [0.01]}}}}]),
        );
        let listed = case(
            serde_json::json!({"material": "m", "initial": {"list": [
                {"position": [0.1, 0.1, 0.95], "radius": 0.01}]}}),
            serde_json::json!([]),
        );
        assert!(part(&listed) > 0.5, "{}", part(&listed));
        assert!(
            (part(&fed) / part(&listed) - 1.0).abs() < 1e-9,
            "{} {}",
            part(&fed),
            part(&listed)
        );
        assert_eq!(severity(&fed), severity(&listed));
    }

    /// Checks that a sphere in the still water of a seepage hits the floor with the settling speed of the drag law: by
    /// the formula of Dallavalle 0.0729 m/s for 0.5 mm and 2650 kg/m³, as computed apart; and with that of a dry fall
    /// where the water does not fill the domain.
    #[test]
    fn a_sphere_in_seepage_falls_no_faster_than_its_drag_law_says() {
        let case = |cells: u32, top: f64| {
            serde_json::json!({
                "domain": {"size": [0.02, 0.02, 0.2], "spacing": 0.005},
                "gravity": [0, 0, -9.81],
                "materials": {"s": {"density": 2650}},
                "fluid": {"darcy": {"density": 1000, "viscosity": 0.001,
                    "grid": {"from": [0, 0, 0], "to": [0.02, 0.02, top], "cells": [4, 4, cells]},
                    "boundaries": [{"name": "top", "face": "z_max", "condition": {"head": {"value": 0.2}}}],
                    "drag": "dallavalle", "resistance": "gidaspow"}},
                "grains": {"material": "s", "initial": {"list": [
                    {"position": [0.0101, 0.0102, 0.19], "radius": 0.00025}]}},
                "contact": {"linear": {"normal_stiffness": {"absolute": 10}, "friction_angle_degrees": 30,
                    "normal_damping_ratio": 0.3}},
                "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"],
                "time": {"end": 0.6},
            })
            .to_string()
        };
        let planned =
            |text: &str| Plan::prepare(Document::read(text, &[], Path::new(".")).unwrap()).unwrap();
        let wet = planned(&case(40, 0.2));
        let mass = 2650.0 * std::f64::consts::PI / 6.0 * 0.0005_f64.powi(3);
        let exact = 0.0729 * (mass / 10.0_f64).sqrt() / 0.00025;
        // Damping of 0.3 takes a third of the overlap.
        assert!(
            (0.6..0.75).contains(&(part(&wet) / exact)),
            "{}",
            part(&wet)
        );
        assert_eq!(severity(&wet), None);
        let dry = planned(&case(20, 0.1));
        assert!(part(&dry) > 20.0 * part(&wet));
    }

    #[test]
    fn an_impact_presses_as_far_as_an_oscillation_swings() {
        // Two equal discs: half the mass of 0.785 kg at 2 m/s on 1e7 N/m, damped by 0.1.
        let plan = planned(&[]);
        let mass = 2500.0 * std::f64::consts::PI * 1e-4 / 2.0;
        let rest = 0.99_f64.sqrt();
        let exact = 2.0 * (mass / 1e7_f64).sqrt() * (-0.1 / rest * (rest / 0.1).atan()).exp();
        approx::assert_relative_eq!(part(&plan), exact / 0.01, max_relative = 1e-9);
        assert_eq!(severity(&plan), None);
        // All discs have the same speed, so that there is no impact.
        let together = planned(&["grains.initial.list[1].velocity=[1,0]"]);
        assert_eq!(part(&together), 0.0);
    }

    #[test]
    fn soft_contacts_are_warned_of_and_those_that_are_passed_are_unstable() {
        let with = |stiffness: &str| {
            let set = format!("contact.linear.normal_stiffness.absolute={stiffness}");
            planned(&[&set])
        };
        assert_eq!(severity(&with("1e7")), None);
        assert_eq!(severity(&with("1e6")), Some(Severity::Warning));
        assert_eq!(severity(&with("1e4")), Some(Severity::Unstable));
        // At 0.63 of the radius the guard ends the run, unless it allows more.
        assert_eq!(severity(&with("3e4")), Some(Severity::Unstable));
        let stiffness = "contact.linear.normal_stiffness.absolute=3e4";
        let allowed = planned(&[stiffness, "guards.max_overlap=0.9"]);
        assert_eq!(severity(&allowed), Some(Severity::Warning));
        // A driven wall is included, and so is the fall of a disc that touches nothing.
        let still = "grains.initial.list=[{\"position\": [0.08, 0.05], \"radius\": 0.01}]";
        let wall = "walls=[{\"name\": \"w\", \"shape\": {\"plane\": {\"point\": [0, 0], \"normal\": [1, 0]}}, \
            \"material\": \"glass\", \"velocity\": [200, 0]}]";
        assert_eq!(severity(&planned(&[still])), None);
        assert_eq!(severity(&planned(&[still, wall])), Some(Severity::Unstable));
        let floor = "box_walls=[\"y_min\"]";
        assert_eq!(part(&planned(&[still, "gravity=[0, -9.81]"])), 0.0);
        let fall = planned(&[still, floor, "gravity=[0, -9.81]"]);
        let mass = 2500.0 * std::f64::consts::PI * 1e-4;
        let speed = (2.0 * 9.81 * 0.04_f64).sqrt();
        assert!(part(&fall) > 0.0 && part(&fall) < speed * (mass / 1e7_f64).sqrt() / 0.01);
        let lies = "grains.initial.list=[{\"position\": [0.08, 0.01], \"radius\": 0.01}]";
        assert_eq!(part(&planned(&[lies, floor, "gravity=[0, -9.81]"])), 0.0);
    }

    /// Checks that a grain of 1.3 mg that hits a boulder of 10 kg compresses the contact by its own mass, not by
    /// that of the boulder.
    #[test]
    fn a_light_grain_hits_with_its_own_mass() {
        let flies = r#"grains.initial.list=[{"position": [0.02, 0.05], "radius": 0.0005, "velocity": [5, 0]},
            {"position": [0.06, 0.05], "radius": 0.03}]"#;
        let plan = planned(&[flies, "contact.linear.normal_damping_ratio=0"]);
        let area = std::f64::consts::PI * 2500.0;
        let (light, heavy) = (area * 0.0005_f64.powi(2), area * 0.03_f64.powi(2));
        let exact = 5.0 * (light * heavy / (light + heavy) / 1e7_f64).sqrt() / 0.0005;
        approx::assert_relative_eq!(part(&plan), exact, max_relative = 1e-9);
    }

    /// The highest corner of the rock mass of this example is 14 m above the lower end of the domain, which bounds the
    /// speed of a fall. Grains and single bodies have no rock mass.
    #[test]
    fn the_impact_of_a_loose_block_is_stated() {
        let stated = |example: &str| {
            let text = case::examples::find(example).unwrap().text;
            let document = Document::read(text, &[], Path::new(".")).unwrap();
            let mut choices = Plan::prepare(document).unwrap().models.into_iter();
            let found = choices.find(|choice| choice.what == "impact of a loose block");
            found.map(|choice| choice.model)
        };
        assert_eq!(stated("collision"), None);
        let model = stated("avalanche").unwrap();
        let speed = model.strip_prefix("at most ").unwrap();
        let speed: f64 = speed.split_whitespace().next().unwrap().parse().unwrap();
        let highest = (2.0 * 9.81 * 14.0_f64).sqrt();
        assert!(speed < highest && speed > 0.5 * highest, "{model}");
    }
}
