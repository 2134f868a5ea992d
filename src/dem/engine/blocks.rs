//! Blocks in the engine: the poses of all bodies in each step, then narrow phase and force of each active pair
//! whose boxes overlap.
//!
//! The history of a pair is reset whenever the spheres or the axis-parallel boxes about both bodies are separate at
//! the end of a step. This depends on the motion alone, so that the start of the narrow phase does not depend on
//! when lists were built. Each piece of parallel work has its own buffers. Actions are summed as for spheres: in
//! the order of the other body's id, planes last.

mod act;
mod pose;

use super::bodies::Bodies;
use super::facets::{AtFacets, Held};
use super::pairs::{Pair, WallPair};
use super::pairs::{act_at_plane, dry};
use super::{Action, Engine};
use crate::contact::blocks::{BlockConstants, BlockLaw, BlockScale};
use crate::integrate::{self, Fastest, Kick, Phase};
use crate::particles::{Load, Particles};
use crate::polyhedron::{BlockHistory, Geometry, Narrow};
use crate::space::Space;
use crate::surface::Faces;
use crate::walls::Wall;
use crate::{Contact, DemSettings, ghosts};
use act::StepInput;
use base::error::Error;
use pose::{Pose, boxes_meet};
use rayon::prelude::*;

type BlockPair = Pair<BlockScale, BlockHistory>;
type BlockAtPlane = WallPair<BlockConstants, BlockHistory>;

/// Poses of all entries, and buffers of the narrow phase for each piece of work.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    poses: Vec<Pose>,
    narrows: Vec<Narrow>,
    /// Faces of each wall; each face is one contact.
    faces: Vec<Faces>,
    /// Facets near a block, sorted by face.
    order: Vec<[u32; 2]>,
    /// Contacts of one block with all faces.
    touches: Vec<AtFace>,
}

/// Contact of a block with a face.
#[derive(Clone, Copy, Debug)]
struct AtFace {
    /// Index of the pair of block and wall.
    pair: u32,
    /// Identifier of the face.
    face: u32,
    touch: Geometry,
    /// Fraction of the normal dashpot that acts.
    damped: f64,
}

/// Cosine of the angle between normals above which contacts belong to one patch.
const ONE_PLANE: f64 = 1.0 - 1e-6;

/// Returns the area of a contact as a fraction of that of its patch.
fn part_of(touches: &[AtFace], touch: &Geometry) -> f64 {
    let parallel = |other: &&AtFace| other.touch.normal.dot(&touch.normal) > ONE_PLANE;
    let patch: f64 = (touches.iter().filter(parallel))
        .map(|other| other.touch.area)
        .sum();
    if patch > 0.0 { touch.area / patch } else { 1.0 }
}

/// Sorts the facets near a block by face, and those of each face in ascending order.
fn by_face(faces: &Faces, near: &[u32], order: &mut Vec<[u32; 2]>) {
    order.clear();
    order.extend(near.iter().map(|&facet| [faces.first(facet), facet]));
    order.sort_unstable();
}

impl<S: Space> Engine<S, BlockLaw> {
    /// Adds the actions of facets: one contact with each face, with its history.
    fn faces_forces(&mut self, particles: &mut Particles<S>, dt: f64) {
        let mut facets = std::mem::take(&mut self.solids.facets[0]);
        let mut narrows = std::mem::take(&mut self.scratch.narrows);
        let mut order = std::mem::take(&mut self.scratch.order);
        let mut touches = std::mem::take(&mut self.scratch.touches);
        let mut contact = std::mem::take(&mut particles.contact);
        let mut failures = std::mem::take(&mut self.events.wall_failures);
        let world = StepInput {
            time_step: dt,
            ..self.world(particles)
        };
        let mut calls = 0;
        let mut record = self.events.record;
        facets.next.clear();
        let mut from = 0;
        while from < facets.active.len() {
            let to = facets.same_grain(from);
            let k = facets.pairs[facets.active[from] as usize].grain as usize;
            if world.shape(k).is_none() {
                let motion = &particles.motion;
                facets.find_doubled::<S, BlockLaw>((from, to), &self.walls, motion);
                for place in from..to {
                    let at = facets.active[place] as usize;
                    facets.act_on_sphere::<S, BlockLaw>(
                        at,
                        &self.walls,
                        dry(motion),
                        (&mut contact, 0),
                        (&mut failures, &mut record),
                        dt,
                    );
                }
                from = to;
                continue;
            }
            touches.clear();
            for place in from..to {
                let at = facets.active[place];
                let pair = &facets.pairs[at as usize];
                let Some(narrow) = narrows.first_mut() else {
                    break;
                };
                let wall = &self.walls[pair.wall as usize];
                let faces = &self.scratch.faces[pair.wall as usize];
                by_face(faces, facets.near(pair), &mut order);
                calls += world.meet_faces(k, wall, faces, &mut order, narrow, |face, touch| {
                    let damped = world.damped(k, wall, faces, face, &pair.constants);
                    touches.push(AtFace {
                        pair: at,
                        // The face has the same identifier on both sides of a periodic face.
                        face: faces.name(face[0][0]),
                        touch,
                        damped,
                    });
                });
            }
            for place in from..to {
                let at = facets.active[place];
                let pair = facets.pairs[at as usize];
                let wall = &self.walls[pair.wall as usize];
                let start = ghosts::index(facets.next.len());
                for one in touches.iter().filter(|one| one.pair == at) {
                    let AtFace { face, touch, .. } = one;
                    world.note_at_wall(touch, pair.grain, pair.wall, &mut record);
                    let held = facets.held(&pair).iter().find(|held| held.facet == *face);
                    let mut history = held.map_or(BlockHistory::default(), |held| held.history);
                    let share = (part_of(&touches, touch), one.damped);
                    let load =
                        world.act_at_wall(k, wall, &pair.constants, (touch, share), &mut history);
                    contact[k].force += load.force;
                    contact[k].torque += load.torque;
                    facets.next.push(Held {
                        facet: *face,
                        history,
                    });
                }
                facets.pairs[at as usize].held = (start, ghosts::index(facets.next.len()));
            }
            from = to;
        }
        std::mem::swap(&mut facets.held, &mut facets.next);
        self.validity.tested += calls;
        self.events.record = record;
        self.solids.facets[0] = facets;
        self.scratch.narrows = narrows;
        self.scratch.order = order;
        self.scratch.touches = touches;
        self.events.wall_failures = failures;
        particles.contact = contact;
    }

    fn world<'a>(&'a self, particles: &'a Particles<S>) -> StepInput<'a, S> {
        StepInput {
            view: particles.view(),
            poses: &self.scratch.poses,
            rows: &self.rows,
            model: &self.law.model,
            offsets: &self.lists.offsets,
            periodic: self.settings.region.any_periodic(),
            time_step: 0.0,
            deepest: self.events.record.part(),
        }
    }

    /// Computes the actions of all active pairs.
    fn pair_forces(&mut self, particles: &Particles<S>, dt: f64) {
        let count = if self.parallel {
            4 * rayon::current_num_threads()
        } else {
            1
        };
        let mut narrows = std::mem::take(&mut self.scratch.narrows);
        narrows.resize_with(count.max(narrows.len()), Narrow::default);
        let mut pairs = std::mem::take(&mut self.lists.pairs);
        let mut actions = std::mem::take(&mut self.events.actions);
        actions.resize(self.lists.active.len(), Action::default());
        let world = StepInput {
            time_step: dt,
            ..self.world(particles)
        };
        let tally = world.act_on_pieces(
            (&self.lists.active, 0),
            &mut pairs,
            &mut actions,
            &mut narrows[..count],
        );
        self.validity.tested += tally.calls;
        self.events.record = self.events.record.or(tally.deepest);
        self.scratch.narrows = narrows;
        self.lists.pairs = pairs;
        self.events.actions = actions;
    }

    /// Sums the actions by body, one pair after another.
    fn add_up(&self, contact: &mut [Load<S>]) {
        contact.fill(Load::default());
        for (&k, action) in self.lists.active.iter().zip(&self.events.actions) {
            let (first, second) = self.lists.pairs[k as usize].ends();
            contact[first].force -= action.force;
            contact[first].torque += action.on_first;
            contact[second].force += action.force;
            contact[second].torque += action.on_second;
        }
    }

    /// Adds the actions of planes.
    fn plane_forces(&mut self, particles: &mut Particles<S>, dt: f64) {
        let mut at_planes = std::mem::take(&mut self.solids.wall_pairs);
        let mut narrows = std::mem::take(&mut self.scratch.narrows);
        let mut contact = std::mem::take(&mut particles.contact);
        let world = StepInput {
            time_step: dt,
            ..self.world(particles)
        };
        let mut calls = 0;
        let mut record = self.events.record;
        for pair in &mut at_planes {
            let wall = &self.walls[pair.wall as usize];
            let k = pair.grain as usize;
            if world.shape(k).is_none() {
                let motion = &particles.motion;
                let load = (&mut contact[k], &mut record);
                act_at_plane::<S, BlockLaw>(pair, wall, dry(motion), load, dt);
            } else if let Some(narrow) = narrows.first_mut() {
                calls += 1;
                if let Some(load) = world.act_at_plane(pair, wall, narrow, &mut record) {
                    contact[k].force += load.force;
                    contact[k].torque += load.torque;
                }
            }
        }
        self.validity.tested += calls;
        self.events.record = record;
        self.solids.wall_pairs = at_planes;
        self.scratch.narrows = narrows;
        particles.contact = contact;
    }
}

impl<S: Space> Bodies<S> for BlockLaw {
    type Scratch = Scratch;

    const PER_THREAD: usize = 16;
    const IN_PARTS: bool = false;

    fn engine(law: Self, settings: DemSettings<S>, walls: Vec<Wall<S>>) -> Engine<S, Self> {
        let mut engine = Engine::new(law, settings, walls);
        let surfaces = engine.walls.iter().map(|wall| &wall.surface);
        engine.scratch.faces = surfaces
            .map(|surface| {
                surface
                    .as_ref()
                    .map_or_else(Default::default, |s| s.faces())
            })
            .collect();
        engine
    }

    fn check(particles: &mut Particles<S>) -> Result<(), Error> {
        if !particles.has_blocks() {
            particles.set_shapes(std::sync::Arc::default())?;
        }
        particles.check_shapes()
    }

    fn advance(
        &self,
        particles: &mut Particles<S>,
        kick: &Kick<S>,
        phase: Phase,
        parallel: bool,
    ) -> Fastest {
        integrate::blocks::advance(particles, kick, self.mass_damping, (phase, parallel))
    }

    fn pose(scratch: &mut Scratch, particles: &Particles<S>, parallel: bool) {
        let (view, poses) = (particles.view(), &mut scratch.poses);
        poses.clear();
        if parallel {
            let all = (0..particles.len()).into_par_iter().with_min_len(64);
            all.map(|k| Pose::from_view(&view, k))
                .collect_into_vec(poses);
        } else {
            poses.extend((0..particles.len()).map(|k| Pose::from_view(&view, k)));
        }
    }

    #[inline(always)]
    fn near(
        scratch: &Scratch,
        (first, second): (usize, usize),
        between: &S::Vector,
        gap: f64,
    ) -> bool {
        let poses = [&scratch.poses[first], &scratch.poses[second]];
        // As for spheres, far above the rounding of a box and far below any gap that costs time.
        let slack = 1e-12 * poses.iter().map(|pose| pose.high.max()).sum::<f64>();
        boxes_meet(poses, &S::to_volume(between), gap + slack)
    }

    /// Distributes the work of the next phase. The narrow phase takes much longer than the summation, and uneven times:
    /// threads take pieces of its work as they become free.
    fn distribute_work(_: &mut Engine<S, Self>, _: &Particles<S>) {}

    fn forces(
        engine: &mut Engine<S, Self>,
        particles: &mut Particles<S>,
        dt: f64,
        _: Option<(&Kick<S>, Phase)>,
    ) -> Option<Fastest> {
        engine.pair_forces(particles, dt);
        engine.add_up(&mut particles.contact);
        engine.plane_forces(particles, dt);
        engine.faces_forces(particles, dt);
        None
    }

    fn contact(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        pair: &BlockPair,
        narrow: &mut Narrow,
    ) -> Option<Contact<S>> {
        let world = engine.world(particles);
        let (first, second) = pair.ends();
        if world.shape(first).is_none() && world.shape(second).is_none() {
            return engine.sphere_contact(particles, pair);
        }
        let span = world.span(pair);
        if !span.near {
            return None;
        }
        let between = S::to_volume(&span.between);
        let (touch, swapped) = world.meet(pair, &between, &mut pair.history.clone(), narrow);
        let touch = touch?;
        let (arm, normal) = if swapped {
            (touch.arm + between, -touch.normal)
        } else {
            (touch.arm, touch.normal)
        };
        Some(Contact {
            grain: first,
            other: Some(second),
            wall: None,
            overlap: touch.depth,
            normal: S::from_volume(&normal),
            position: particles.location(first) + S::from_volume(&arm),
            normal_force: engine.rows.parameters_at(pair.row).stiffness(touch.area)[0]
                * touch.depth,
            shear_force: S::Vector::default(),
            bonded: false,
            bridge: 0.0,
        })
    }

    fn plane_contact(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        pair: &BlockAtPlane,
        narrow: &mut Narrow,
    ) -> Option<Contact<S>> {
        let world = engine.world(particles);
        let (k, wall) = (pair.grain as usize, &engine.walls[pair.wall as usize]);
        if world.shape(k).is_none() {
            return engine.sphere_plane_contact(particles, pair);
        }
        let touch = world.meet_plane(pair, wall, &mut pair.history.clone(), narrow)?;
        Some(Contact {
            grain: k,
            other: None,
            wall: Some(pair.wall),
            overlap: touch.depth,
            normal: wall.normal,
            position: particles.location(k) + S::from_volume(&touch.arm),
            normal_force: pair.constants.law.stiffness(touch.area)[0] * touch.depth,
            shear_force: S::Vector::default(),
            bonded: false,
            bridge: 0.0,
        })
    }

    fn facet_contacts(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        (facets, pair): AtFacets<'_, BlockConstants, BlockHistory>,
        narrow: &mut Narrow,
        visit: &mut impl FnMut(Contact<S>),
    ) {
        let world = engine.world(particles);
        let (k, wall) = (pair.grain as usize, &engine.walls[pair.wall as usize]);
        if world.shape(k).is_none() {
            engine.sphere_facet_contacts(particles, (facets, pair), visit);
            return;
        }
        let faces = &engine.scratch.faces[pair.wall as usize];
        let mut order = Vec::new();
        by_face(faces, facets.near(pair), &mut order);
        world.meet_faces(k, wall, faces, &mut order, narrow, |_, touch| {
            visit(Contact {
                grain: k,
                other: None,
                wall: Some(pair.wall),
                overlap: touch.depth,
                normal: S::from_volume(&-touch.normal),
                position: particles.location(k) + S::from_volume(&touch.arm),
                normal_force: pair.constants.law.stiffness(touch.area)[0] * touch.depth,
                shear_force: S::Vector::default(),
                bonded: false,
                bridge: 0.0,
            });
        });
    }

    fn bond_all(_: &mut Engine<S, Self>, _: &Particles<S>) -> u64 {
        0
    }
}
