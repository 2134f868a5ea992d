//! Blocks in the engine: poses once per step and body, then the narrow phase and the force of each active pair whose boxes meet.
//!
//! The memory of a pair starts afresh whenever the spheres or the axis-parallel boxes round both are apart at the end of a step. That
//! is a matter of the motion alone, so that what the narrow phase starts from does not depend on when lists were made. Each piece of
//! parallel work has buffers of its own; actions are added up as for spheres, in order of the other body's id, planes last.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::super::blocks::{in_space, out_of_space};
use super::super::contact::blocks::{Blocks, Constants, Scale};
use super::super::polyhedron::force::Approach;
use super::super::polyhedron::{self, Geometry, Hidden, Memory, Model, Narrow, Placed, Polyhedron};
use super::super::{Contact, View, integrate};
use super::bodies::Bodies;
use super::*;

type BlockPair = Pair<Scale, Memory>;
type BlockAtFacets = SurfacePair<Constants>;
type BlockAtPlane = WallPair<Constants, Memory>;

/// How an entry stands: what turns its frame into space, and the box (m) round it about its centre.
#[derive(Clone, Copy, Debug)]
struct Pose {
    rotation: Matrix3<f64>,
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Pose {
    fn of<S: Space>(view: &View<'_, S>, k: usize) -> Self {
        let Some((shape, rotation)) = view.polyhedron(k) else {
            let half = Vector3::repeat(view.body[k].radius);
            return Self {
                rotation: Matrix3::identity(),
                low: -half,
                high: half,
            };
        };
        let rotation = rotation.matrix();
        let (mut low, mut high) = (Vector3::zeros(), Vector3::zeros());
        for vertex in shape.vertices() {
            let corner = rotation * vertex;
            low = corner.inf(&low);
            high = corner.sup(&high);
        }
        Self {
            rotation,
            low,
            high,
        }
    }

    fn placed<'a>(&self, shape: &'a Polyhedron) -> Placed<'a> {
        Placed {
            shape,
            rotation: self.rotation,
        }
    }
}

/// Poses of all entries, and buffers of the narrow phase, one for each piece of work.
#[derive(Debug, Default)]
pub(in crate::dem) struct Scratch {
    poses: Vec<Pose>,
    narrows: Vec<Narrow>,
    /// Of each wall, for each facet the first of its face: a face is one contact.
    faces: Vec<Vec<u32>>,
    /// Facets near a block, with their faces.
    order: Vec<[u32; 2]>,
}

/// Whether the boxes of two bodies, the second `between` (m) from the first, are at most `gap` (m) apart.
#[inline(always)]
fn boxes_meet([one, two]: [&Pose; 2], between: &Vector3<f64>, gap: f64) -> bool {
    (0..3).all(|axis| {
        between[axis] + two.low[axis] <= one.high[axis] + gap
            && one.low[axis] <= between[axis] + two.high[axis] + gap
    })
}

/// What the pairs of a step read.
#[derive(Clone, Copy)]
struct World<'a, S: Space> {
    view: View<'a, S>,
    poses: &'a [Pose],
    rows: &'a PairTable<polyhedron::Law>,
    model: &'a Model,
    offsets: &'a [S::Vector],
    periodic: bool,
    time_step: f64,
}

/// A pair now: from the first's centre to the second's (m), its square, and whether the spheres and boxes round both meet.
struct Span<S: Space> {
    between: S::Vector,
    squared: f64,
    near: bool,
}

impl<'a, S: Space> World<'a, S> {
    fn span(&self, pair: &BlockPair) -> Span<S> {
        let ends = pair.ends();
        let offset = &self.offsets[pair.offset as usize];
        let motion = &self.view.motion;
        let (between, squared) = separation(motion, ends, offset, self.periodic);
        let poses = [&self.poses[ends.0], &self.poses[ends.1]];
        let near =
            squared < pair.reach * pair.reach && boxes_meet(poses, &S::to_volume(&between), 0.0);
        Span {
            between,
            squared,
            near,
        }
    }

    fn shape(&self, k: usize) -> Option<&'a Polyhedron> {
        self.view.polyhedron(k).map(|(shape, _)| shape)
    }

    /// Where a block meets a block or a sphere, and whether the pair's second comes first in it: a block comes before a sphere.
    fn meet(
        &self,
        pair: &BlockPair,
        between: &Vector3<f64>,
        memory: &mut Memory,
        narrow: &mut Narrow,
    ) -> (Option<Geometry>, bool) {
        let (i, j) = pair.ends();
        let placed = |k: usize, shape: &'a Polyhedron| self.poses[k].placed(shape);
        let radius = |k: usize| self.view.body[k].radius;
        match (self.shape(i), self.shape(j)) {
            (Some(one), Some(two)) => {
                let (one, two) = (placed(i, one), placed(j, two));
                (
                    narrow.blocks(&one, &two, between, self.model, memory),
                    false,
                )
            }
            (Some(one), None) => (narrow.sphere(&placed(i, one), between, radius(j)), false),
            (None, Some(two)) => (narrow.sphere(&placed(j, two), &-between, radius(i)), true),
            (None, None) => (None, false),
        }
    }

    /// The action of one pair, or none where it does not touch; counts calls of the narrow phase.
    fn act(&self, pair: &mut BlockPair, narrow: &mut Narrow, calls: &mut u64) -> Option<Action<S>> {
        let span = self.span(pair);
        if !span.near {
            pair.memory = Memory::default();
            return None;
        }
        let (i, j) = pair.ends();
        if self.shape(i).is_none() && self.shape(j).is_none() {
            let distance = span.squared.sqrt();
            let measured = (&span.between, span.squared, distance, 1.0 / distance);
            let motion = &self.view.motion;
            return act::<S, Blocks>(self.rows, pair, motion, measured, self.time_step);
        }
        *calls += 1;
        let between = S::to_volume(&span.between);
        let mut memory = pair.memory;
        let (touch, swapped) = self.meet(pair, &between, &mut memory, narrow);
        let action = touch.map(|touch| {
            let (first, second, separation) = if swapped {
                (j, i, -between)
            } else {
                (i, j, between)
            };
            let approach = self.approach([first, second], separation, pair.scale.mass);
            self.rows.at(pair.row).act(&touch, &mut memory, &approach)
        });
        pair.memory = if touch.is_none() && self.rounded(pair) {
            Memory::default()
        } else {
            memory
        };
        action.map(|action| {
            let (force, on_first, on_second) = if swapped {
                (-action.force, action.on_second, action.on_first)
            } else {
                (action.force, action.on_first, action.on_second)
            };
            Action {
                force: S::from_volume(&force),
                on_first: out_of_space(&on_first),
                on_second: out_of_space(&on_second),
                failure: None,
            }
        })
    }

    /// Whether one of a pair is a sphere: then the narrow phase does not look at the memory, nor lets go of it.
    fn rounded(&self, pair: &BlockPair) -> bool {
        let (i, j) = pair.ends();
        self.shape(i).is_none() || self.shape(j).is_none()
    }

    fn approach(&self, [i, j]: [usize; 2], separation: Vector3<f64>, mass: f64) -> Approach {
        let (one, two) = (&self.view.motion[i], &self.view.motion[j]);
        Approach {
            velocity: S::to_volume(&(two.velocity - one.velocity)),
            spins: [in_space(&one.spin), in_space(&two.spin)],
            separation,
            mass,
            time_step: self.time_step,
        }
    }

    /// [`Self::act`] on active pairs, by threads where there is more than one set of buffers; `active` counts from `base` in
    /// `pairs`. Returns the calls of the narrow phase.
    fn act_on_pieces(
        &self,
        (active, base): (&[u32], usize),
        pairs: &mut [BlockPair],
        actions: &mut [Action<S>],
        narrows: &mut [Narrow],
    ) -> u64 {
        if narrows.len() > 1 && active.len() > 1 {
            let middle = active.len() / 2;
            let cut = active[middle] as usize;
            let (left, right) = active.split_at(middle);
            let (left_pairs, right_pairs) = pairs.split_at_mut(cut - base);
            let (left_actions, right_actions) = actions.split_at_mut(middle);
            let (left_narrows, right_narrows) = narrows.split_at_mut(narrows.len() / 2);
            let (a, b) = rayon::join(
                || self.act_on_pieces((left, base), left_pairs, left_actions, left_narrows),
                || self.act_on_pieces((right, cut), right_pairs, right_actions, right_narrows),
            );
            return a + b;
        }
        let mut calls = 0;
        if let Some(narrow) = narrows.first_mut() {
            for (&k, action) in active.iter().zip(actions) {
                let pair = &mut pairs[k as usize - base];
                *action = self.act(pair, narrow, &mut calls).unwrap_or_default();
            }
        }
        calls
    }

    /// A block at a plane, where it is one that touches.
    fn meet_plane(
        &self,
        pair: &BlockAtPlane,
        wall: &Wall<S>,
        memory: &mut Memory,
        narrow: &mut Narrow,
    ) -> Option<Geometry> {
        let k = pair.grain as usize;
        let height = wall.distance(&self.view.motion[k].position);
        if height >= pair.radius {
            *memory = Memory::default();
            return None;
        }
        let placed = self.poses[k].placed(self.shape(k)?);
        narrow.plane(
            &placed,
            &S::to_volume(&wall.normal),
            height,
            self.model,
            memory,
        )
    }

    /// The force and moment of a plane on a block; none where it does not touch.
    fn act_at_plane(
        &self,
        pair: &mut BlockAtPlane,
        wall: &Wall<S>,
        narrow: &mut Narrow,
    ) -> Option<Load<S>> {
        let mut memory = pair.memory;
        let touch = self.meet_plane(pair, wall, &mut memory, narrow);
        let action = touch.map(|touch| {
            self.act_at_wall(
                pair.grain as usize,
                wall,
                &pair.constants,
                &touch,
                &mut memory,
            )
        });
        pair.memory = memory;
        action
    }

    /// The force and moment on block `k` of a contact with a wall.
    fn act_at_wall(
        &self,
        k: usize,
        wall: &Wall<S>,
        constants: &Constants,
        touch: &Geometry,
        memory: &mut Memory,
    ) -> Load<S> {
        let block = &self.view.motion[k];
        let approach = Approach {
            velocity: S::to_volume(&(wall.velocity - block.velocity)),
            spins: [in_space(&block.spin), Vector3::zeros()],
            separation: Vector3::zeros(),
            mass: constants.scale.mass,
            time_step: self.time_step,
        };
        let action = constants.law.act(touch, memory, &approach);
        Load {
            force: S::from_volume(&-action.force),
            torque: out_of_space(&action.on_first),
        }
    }

    /// Where block `k` meets a face, given by those of its facets that are near.
    fn meet_face(
        &self,
        k: usize,
        wall: &Wall<S>,
        face: &[[u32; 2]],
        narrow: &mut Narrow,
    ) -> Option<Geometry> {
        let surface = wall.surface.as_ref()?;
        let placed = self.poses[k].placed(self.shape(k)?);
        let centre = wall.local(&self.view.motion[k].position);
        let first = face.first()?[0] as usize;
        let mut normal = surface.normal(first);
        let height = normal.dot(&(centre - surface.corners(first).next()?));
        if height < 0.0 {
            normal = -normal;
        }
        let down = placed.rotation.tr_mul(&-normal);
        if placed.shape.support(&down).1 <= height.abs() {
            return None;
        }
        let mut hidden = Hidden::default();
        for &[_, facet] in face {
            let facet = facet as usize;
            let corners = surface.corners(facet).map(|corner| corner - centre);
            if surface.normal(facet).dot(&normal) > 0.0 {
                narrow.hide(&placed, corners, &normal, &mut hidden);
            } else {
                narrow.hide(&placed, corners.rev(), &normal, &mut hidden);
            }
        }
        hidden.contact(&placed, &normal, height.abs())
    }
}

/// Facets near a block by face, each face's in rising order.
fn by_face(faces: &[u32], near: &[u32], order: &mut Vec<[u32; 2]>) {
    order.clear();
    order.extend(near.iter().map(|&facet| [faces[facet as usize], facet]));
    order.sort_unstable();
}

impl<S: Space> Engine<S, Blocks> {
    pub(in crate::dem) fn of_blocks(
        law: Blocks,
        settings: Settings<S>,
        walls: Vec<Wall<S>>,
    ) -> Self {
        let mut engine = Self::new(law, settings, walls);
        let surfaces = engine.walls.iter().map(|wall| &wall.surface);
        engine.scratch.faces = surfaces
            .map(|surface| surface.as_ref().map_or_else(Vec::new, |s| s.faces()))
            .collect();
        engine
    }

    /// Adds the actions of facets: one contact with each face, with the memory it had.
    fn faces_forces(&mut self, particles: &mut Particles<S>, dt: f64) {
        let mut facets = std::mem::take(&mut self.facets);
        let mut narrows = std::mem::take(&mut self.scratch.narrows);
        let mut order = std::mem::take(&mut self.scratch.order);
        let mut contact = std::mem::take(&mut particles.contact);
        let mut failures = std::mem::take(&mut self.wall_failures);
        let world = World {
            time_step: dt,
            ..self.world(particles)
        };
        let mut calls = 0;
        facets.next.clear();
        for place in 0..facets.active.len() {
            let at = facets.active[place] as usize;
            let pair = facets.pairs[at];
            let (k, wall) = (pair.grain as usize, &self.walls[pair.wall as usize]);
            if world.shape(k).is_none() {
                let motion = &particles.motion;
                facets.act_on_sphere::<S, Blocks>(
                    at,
                    &self.walls,
                    motion,
                    &mut contact,
                    &mut failures,
                    dt,
                );
                continue;
            }
            let start = ghosts::index(facets.next.len());
            by_face(
                &self.scratch.faces[pair.wall as usize],
                facets.near(&pair),
                &mut order,
            );
            for face in order.chunk_by(|a, b| a[0] == b[0]) {
                let Some(narrow) = narrows.first_mut() else {
                    break;
                };
                calls += 1;
                let Some(touch) = world.meet_face(k, wall, face, narrow) else {
                    continue;
                };
                let facet = face[0][0];
                let held = facets.held(&pair).iter().find(|held| held.facet == facet);
                let mut memory = held.map_or(Memory::default(), |held| held.memory);
                let load = world.act_at_wall(k, wall, &pair.constants, &touch, &mut memory);
                contact[k].force += load.force;
                contact[k].torque += load.torque;
                facets.next.push(Held { facet, memory });
            }
            facets.pairs[at].held = (start, ghosts::index(facets.next.len()));
        }
        std::mem::swap(&mut facets.held, &mut facets.next);
        self.tested += calls;
        self.facets = facets;
        self.scratch.narrows = narrows;
        self.scratch.order = order;
        self.wall_failures = failures;
        particles.contact = contact;
    }

    fn world<'a>(&'a self, particles: &'a Particles<S>) -> World<'a, S> {
        World {
            view: particles.view(),
            poses: &self.scratch.poses,
            rows: &self.rows,
            model: &self.law.model,
            offsets: &self.offsets,
            periodic: self.settings.region.any_periodic(),
            time_step: 0.0,
        }
    }

    /// Actions of all active pairs.
    fn pair_forces(&mut self, particles: &Particles<S>, dt: f64) {
        let count = if self.parallel {
            4 * rayon::current_num_threads()
        } else {
            1
        };
        let mut narrows = std::mem::take(&mut self.scratch.narrows);
        narrows.resize_with(count.max(narrows.len()), Narrow::default);
        let mut pairs = std::mem::take(&mut self.pairs);
        let mut actions = std::mem::take(&mut self.actions);
        actions.resize(self.active.len(), Action::default());
        let world = World {
            time_step: dt,
            ..self.world(particles)
        };
        let calls = world.act_on_pieces(
            (&self.active, 0),
            &mut pairs,
            &mut actions,
            &mut narrows[..count],
        );
        self.tested += calls;
        self.scratch.narrows = narrows;
        self.pairs = pairs;
        self.actions = actions;
    }

    /// Adds the actions up by body, one pair after the other.
    fn add_up(&self, contact: &mut [Load<S>]) {
        contact.fill(Load::default());
        for (&k, action) in self.active.iter().zip(&self.actions) {
            let (first, second) = self.pairs[k as usize].ends();
            contact[first].force -= action.force;
            contact[first].torque += action.on_first;
            contact[second].force += action.force;
            contact[second].torque += action.on_second;
        }
    }

    /// Adds the actions of planes.
    fn plane_forces(&mut self, particles: &mut Particles<S>, dt: f64) {
        let mut at_planes = std::mem::take(&mut self.wall_pairs);
        let mut narrows = std::mem::take(&mut self.scratch.narrows);
        let mut contact = std::mem::take(&mut particles.contact);
        let world = World {
            time_step: dt,
            ..self.world(particles)
        };
        let mut calls = 0;
        for pair in &mut at_planes {
            let wall = &self.walls[pair.wall as usize];
            let k = pair.grain as usize;
            if world.shape(k).is_none() {
                let motion = &particles.motion;
                act_at_plane::<S, Blocks>(pair, wall, motion, &mut contact[k], dt);
            } else if let Some(narrow) = narrows.first_mut() {
                calls += 1;
                if let Some(load) = world.act_at_plane(pair, wall, narrow) {
                    contact[k].force += load.force;
                    contact[k].torque += load.torque;
                }
            }
        }
        self.tested += calls;
        self.wall_pairs = at_planes;
        self.scratch.narrows = narrows;
        particles.contact = contact;
    }
}

impl<S: Space> Bodies<S> for Blocks {
    type Scratch = Scratch;

    const PER_THREAD: usize = 16;

    fn check(particles: &mut Particles<S>) -> Result<(), Error> {
        if !particles.has_blocks() {
            particles.set_shapes(std::sync::Arc::default())?;
        }
        particles.check_shapes()
    }

    fn drift(
        &self,
        particles: &mut Particles<S>,
        kick: &Kick<S>,
        again: bool,
        parallel: bool,
    ) -> Fastest {
        integrate::blocks::drift(particles, kick, self.mass_damping, (again, parallel))
    }

    fn finish(&self, particles: &mut Particles<S>, kick: &Kick<S>) {
        integrate::blocks::finish(particles, kick, self.mass_damping);
    }

    fn pose(scratch: &mut Scratch, particles: &Particles<S>, parallel: bool) {
        let (view, poses) = (particles.view(), &mut scratch.poses);
        poses.clear();
        if parallel {
            let all = (0..particles.len()).into_par_iter().with_min_len(64);
            all.map(|k| Pose::of(&view, k)).collect_into_vec(poses);
        } else {
            poses.extend((0..particles.len()).map(|k| Pose::of(&view, k)));
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
        // As for spheres: far above the rounding of a box, far below any gap that costs.
        let slack = 1e-12 * poses.iter().map(|pose| pose.high.max()).sum::<f64>();
        boxes_meet(poses, &S::to_volume(between), gap + slack)
    }

    /// The narrow phase costs far more than adding up, and unevenly: its work is shared as it comes.
    fn share_out(_: &mut Engine<S, Self>, _: &Particles<S>) {}

    fn forces(engine: &mut Engine<S, Self>, particles: &mut Particles<S>, dt: f64) {
        engine.pair_forces(particles, dt);
        engine.add_up(&mut particles.contact);
        engine.plane_forces(particles, dt);
        engine.faces_forces(particles, dt);
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
        let (touch, swapped) = world.meet(pair, &between, &mut pair.memory.clone(), narrow);
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
            normal_force: engine.rows.at(pair.row).stiffness(touch.area)[0] * touch.depth,
            bonded: false,
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
        let touch = world.meet_plane(pair, wall, &mut pair.memory.clone(), narrow)?;
        Some(Contact {
            grain: k,
            other: None,
            wall: Some(pair.wall),
            overlap: touch.depth,
            normal: wall.normal,
            position: particles.location(k) + S::from_volume(&touch.arm),
            normal_force: pair.constants.law.stiffness(touch.area)[0] * touch.depth,
            bonded: false,
        })
    }

    fn facet_contacts(
        engine: &Engine<S, Self>,
        particles: &Particles<S>,
        pair: &BlockAtFacets,
        narrow: &mut Narrow,
        visit: &mut impl FnMut(Contact<S>),
    ) {
        let world = engine.world(particles);
        let (k, wall) = (pair.grain as usize, &engine.walls[pair.wall as usize]);
        if world.shape(k).is_none() {
            engine.sphere_facet_contacts(particles, pair, visit);
            return;
        }
        let faces = &engine.scratch.faces[pair.wall as usize];
        let mut order = Vec::new();
        by_face(faces, engine.facets.near(pair), &mut order);
        for face in order.chunk_by(|a, b| a[0] == b[0]) {
            if let Some(touch) = world.meet_face(k, wall, face, narrow) {
                visit(Contact {
                    grain: k,
                    other: None,
                    wall: Some(pair.wall),
                    overlap: touch.depth,
                    normal: S::from_volume(&-touch.normal),
                    position: particles.location(k) + S::from_volume(&touch.arm),
                    normal_force: pair.constants.law.stiffness(touch.area)[0] * touch.depth,
                    bonded: false,
                });
            }
        }
    }

    fn bond_all(_: &mut Engine<S, Self>, _: &Particles<S>) -> u64 {
        0
    }
}
