//! Free bodies and grains that leave the domain for good.
//!
//! The water no longer acts on a solid that has left through an opening, and nothing brings it back except gravity.
//! It is removed when it is more than one length of the domain outside, and more than its own radius. Faces with
//! a wall have no exit ([`plan::scene::Scene::exits`]). Driven bodies stay, because a table may bring them back, and
//! fixed ones do not move.
//!
//! A block that the water of joints throws out is counted in the same way, but flies on, because the network of the
//! joints needs all blocks. Only its weight acts there.
//!
//! The state after a fluid step decides, every [`EVERY`] steps of the run, so that the result does not depend on ranks,
//! list rebuilds or restarts. Named bodies and blocks are reported one by one, grains as sums for each face.

use super::removal::rows;
use base::error::Error;
use base::geometry::Face;
use decomposition::Domain;
use dem::particles::{Body, Kind, Motion, Particles};
use dem::space::{Components, Space};
use plan::Plan;
use plan::scene::Scene;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Number of steps between two searches. A search costs one reduction, and a solid moves by a small part of the domain
/// in this time.
const EVERY: u64 = 16;

/// Named body or block that left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct DepartedBody {
    /// Name of the body, or `block` and its number.
    name: String,
    /// Face through which it left.
    face: String,
    /// Step and time \[s\] at which it was removed.
    step: u64,
    time: f64,
    /// Mass [kg; in 2-D kg/m].
    mass: f64,
    /// Position of its centre \[m\] and its velocity [m/s] when it was removed.
    position: [f64; 3],
    velocity: [f64; 3],
    /// Momentum [kg m/s; in 2-D kg/s].
    momentum: [f64; 3],
}

/// Grains that left through one face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct DepartedGrains {
    face: String,
    grains: u64,
    /// Mass [kg; in 2-D kg/m].
    mass: f64,
    /// Momentum [kg m/s; in 2-D kg/s].
    momentum: [f64; 3],
}

/// Solids that left so far: see the module. A checkpoint contains it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Departures {
    bodies: Vec<DepartedBody>,
    grains: Vec<DepartedGrains>,
}

/// Solid that leaves in the present step.
struct Leaving {
    face: usize,
    id: u64,
    mass: f64,
    position: [f64; 3],
    velocity: [f64; 3],
}

impl Leaving {
    /// Number of words in a message.
    const WORDS: usize = 9;

    fn words(&self) -> [u64; Self::WORDS] {
        let [x, y, z] = self.position.map(f64::to_bits);
        let [u, v, w] = self.velocity.map(f64::to_bits);
        [
            self.face as u64,
            self.id,
            self.mass.to_bits(),
            x,
            y,
            z,
            u,
            v,
            w,
        ]
    }

    fn from_words([face, id, mass, x, y, z, u, v, w]: [u64; Self::WORDS]) -> Result<Self, Error> {
        let face = usize::try_from(face).ok().filter(|face| *face < 6);
        Ok(Self {
            face: face.ok_or_else(|| Error::Internal("a solid left through no face".into()))?,
            id,
            mass: f64::from_bits(mass),
            position: [x, y, z].map(f64::from_bits),
            velocity: [u, v, w].map(f64::from_bits),
        })
    }
}

/// Returns the index of the exit through which a solid has left for good; none while it may still matter.
fn exit_of(scene: &Scene, exits: &[[bool; 2]; 3], at: [f64; 3], radius: f64) -> Option<usize> {
    let grid = &scene.grid;
    let axes = || (0..grid.dimension).filter(|axis| !grid.periodic[*axis]);
    let outside = |axis: usize| (-at[axis]).max(at[axis] - grid.size[axis]);
    if !axes().any(|axis| outside(axis) > grid.size[axis].max(radius)) {
        return None;
    }
    let passed =
        axes().filter(|axis| outside(*axis) > 0.0 && exits[*axis][usize::from(at[*axis] > 0.0)]);
    let farthest = passed.max_by(|a, b| outside(*a).total_cmp(&outside(*b)))?;
    Some(2 * farthest + usize::from(at[farthest] > 0.0))
}

/// Returns the name of a body, or `block` and its number.
fn name_of(scene: &Scene, id: u64) -> String {
    let index = usize::try_from(id).unwrap_or(usize::MAX);
    match scene.bodies.get(index) {
        Some(body) => body.name.clone(),
        None => format!("block {}", index - scene.bodies.len()),
    }
}

impl Departures {
    /// Removes the free solids that have left for good, and returns their number on all ranks. If any did, the ghosts
    /// were dropped: prepare them again. Blocks with water in their joints are counted and stay. Collective.
    ///
    /// # Errors
    /// If a message between ranks is corrupt.
    pub(super) fn remove<S: Space>(
        &mut self,
        particles: &mut Particles<S>,
        plan: &Plan,
        domain: &Domain,
        (step, time): (u64, f64),
    ) -> Result<usize, Error> {
        let scene = &plan.scene;
        let exits = scene.exits();
        if !step.is_multiple_of(EVERY) || !exits.as_flattened().contains(&true) {
            return Ok(0);
        }
        let vector = |v: &S::Vector| {
            std::array::from_fn(|axis| {
                if axis < S::DIMENSION {
                    v.get(axis)
                } else {
                    0.0
                }
            })
        };
        let exit = |particles: &Particles<S>, k: usize| {
            let body = &particles.body[k];
            let free = body.kind == Kind::Free;
            let at = vector(&particles.motion[k].position);
            free.then(|| exit_of(scene, &exits, at, body.radius))
                .flatten()
        };
        let leaving = |face: usize, body: &Body, motion: &Motion<S>| Leaving {
            face,
            id: body.id,
            mass: body.mass,
            position: vector(&motion.position),
            velocity: vector(&motion.velocity),
        };
        let gone: Vec<Leaving> = if scene.removes_leaving() {
            let mut faces = Vec::new();
            let gone = particles.remove(|particles, k| {
                let face = exit(particles, k);
                faces.extend(face);
                face.is_some()
            });
            let gone = gone.iter().zip(faces);
            gone.map(|((body, motion), face)| leaving(face, body, motion))
                .collect()
        } else {
            let outside = (0..particles.owned()).filter_map(|k| {
                let (body, motion) = (&particles.body[k], &particles.motion[k]);
                let name = name_of(scene, body.id);
                let known = self.bodies.iter().any(|one| one.name == name);
                let face = exit(particles, k).filter(|_| !known)?;
                Some(leaving(face, body, motion))
            });
            outside.collect()
        };
        let communicator = domain.communicator();
        if communicator.all_reduce_max_u64(gone.len() as u64) == 0 {
            return Ok(0);
        }
        let words = gone.iter().flat_map(Leaving::words);
        let bytes: Vec<u8> = words.flat_map(u64::to_le_bytes).collect();
        let mut all = Vec::new();
        for bytes in communicator.all_gather_bytes(&bytes) {
            for words in rows::<{ Leaving::WORDS }>(&bytes)? {
                all.push(Leaving::from_words(words)?);
            }
        }
        // Sums are formed in the order of ids, independently of ranks.
        all.sort_unstable_by_key(|one| one.id);
        for one in &all {
            self.note(scene, one, (step, time));
        }
        Ok(if scene.removes_leaving() {
            all.len()
        } else {
            0
        })
    }

    fn note(&mut self, scene: &Scene, one: &Leaving, (step, time): (u64, f64)) {
        let face = Face::ALL[one.face].name();
        let momentum = one.velocity.map(|speed| one.mass * speed);
        if one.id < scene.first_grain() {
            self.bodies.push(DepartedBody {
                name: name_of(scene, one.id),
                face: face.into(),
                step,
                time,
                mass: one.mass,
                position: one.position,
                velocity: one.velocity,
                momentum,
            });
            return;
        }
        let known = self.grains.iter().position(|grains| grains.face == face);
        let known = known.unwrap_or_else(|| {
            self.grains.push(DepartedGrains {
                face: face.into(),
                grains: 0,
                mass: 0.0,
                momentum: [0.0; 3],
            });
            self.grains.len() - 1
        });
        let grains = &mut self.grains[known];
        grains.grains += 1;
        grains.mass += one.mass;
        for (sum, part) in grains.momentum.iter_mut().zip(momentum) {
            *sum += part;
        }
    }

    /// Returns the solids that left, for `summary.json`, with the name of the entry; none if there are none.
    pub(super) fn summary(&self, scene: &Scene) -> Option<(&'static str, Value)> {
        if self.bodies.is_empty() && self.grains.is_empty() {
            return None;
        }
        Some(if scene.removes_leaving() {
            let left = json!({ "bodies": self.bodies, "grains": self.grains });
            ("left_through_openings", left)
        } else {
            ("left_the_domain", json!(self.bodies))
        })
    }

    /// Returns a warning for each body, and for the grains of each face.
    pub(super) fn warnings(&self, scene: &Scene) -> Vec<String> {
        let bodies = self.bodies.iter().map(|body| {
            let what = if scene.removes_leaving() {
                format!("the body `{}` left through the opening of {} and was removed", body.name, body.face)
            } else {
                format!("the {} left through the face {} and was counted", body.name, body.face)
            };
            format!(
                "{what} at t = {:.4e} s, more than one length of the domain outside; \"box_walls\" with this face \
                 would keep it",
                body.time
            )
        });
        let grains = self.grains.iter().map(|grains| {
            let [number, was] = match grains.grains {
                1 => ["1 grain".to_owned(), "was".to_owned()],
                n => [format!("{n} grains"), "were".to_owned()],
            };
            format!(
                "{number} left through the opening of {} and {was} removed, more than one length of the domain \
                 outside; a region with the action `remove` records each of them",
                grains.face
            )
        });
        bodies.chain(grains).collect()
    }
}
