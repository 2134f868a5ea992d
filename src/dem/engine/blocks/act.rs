//! Contact of one pair of bodies, of a block with a plane and of a block with a face: narrow phase, then force.

use super::super::Action;
use super::pose::{Pose, boxes_meet};
use super::{BlockAtPlane, BlockPair};
use crate::blocks::{in_space, out_of_space};
use crate::contact::PairTable;
use crate::contact::blocks::{BlockConstants, BlockLaw};
use crate::deepest::{Partner, Record, inner_radius};
use crate::engine::pairs::{PairSpan, act, dry, separation};
use crate::particles::{Load, ParticlesView};
use crate::polyhedron::force::Approach;
use crate::polyhedron::{
    self, BlockContactModel, BlockHistory, Geometry, Hidden, Narrow, Polyhedron,
};
use crate::space::Space;
use crate::surface::Faces;
use crate::walls::Wall;
use nalgebra::Vector3;

/// Input data of the pairs in a step.
#[derive(Clone, Copy)]
pub(super) struct StepInput<'a, S: Space> {
    pub(super) view: ParticlesView<'a, S>,
    pub(super) poses: &'a [Pose],
    pub(super) rows: &'a PairTable<polyhedron::BlockPairLaw>,
    pub(super) model: &'a BlockContactModel,
    pub(super) offsets: &'a [S::Vector],
    pub(super) periodic: bool,
    pub(super) time_step: f64,
    /// Deepest contact before this step: overlap over the smaller radius.
    pub(super) deepest: f64,
}

/// Counts in a piece of work.
pub(super) struct StepCounts {
    /// Number of calls of the narrow phase.
    pub(super) calls: u64,
    pub(super) deepest: Record,
}

/// Geometry of a pair in this step: the vector from the first centre to the second \[m\], its square, and `true` if
/// both the enclosing spheres and the boxes overlap.
pub(super) struct Span<S: Space> {
    pub(super) between: S::Vector,
    pub(super) squared: f64,
    pub(super) near: bool,
}

impl<'a, S: Space> StepInput<'a, S> {
    pub(super) fn span(&self, pair: &BlockPair) -> Span<S> {
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

    pub(super) fn shape(&self, k: usize) -> Option<&'a Polyhedron> {
        self.view.polyhedron(k).map(|(shape, _)| shape)
    }

    /// Computes the contact of a block with a block or a sphere. Also returns `true` if the second body of the pair
    /// comes first in the contact: a block precedes a sphere.
    pub(super) fn meet(
        &self,
        pair: &BlockPair,
        between: &Vector3<f64>,
        history: &mut BlockHistory,
        narrow: &mut Narrow,
    ) -> (Option<Geometry>, bool) {
        let (i, j) = pair.ends();
        let placed = |k: usize, shape: &'a Polyhedron| self.poses[k].placed(shape);
        let radius = |k: usize| self.view.body[k].radius;
        match (self.shape(i), self.shape(j)) {
            (Some(one), Some(two)) => {
                let (one, two) = (placed(i, one), placed(j, two));
                (
                    narrow.blocks(&one, &two, between, self.model, history),
                    false,
                )
            }
            (Some(one), None) => (narrow.sphere(&placed(i, one), between, radius(j)), false),
            (None, Some(two)) => (narrow.sphere(&placed(j, two), &-between, radius(i)), true),
            (None, None) => (None, false),
        }
    }

    /// Returns the action of one pair, or none if there is no contact; counts calls of the narrow phase.
    pub(super) fn act(
        &self,
        pair: &mut BlockPair,
        narrow: &mut Narrow,
        tally: &mut StepCounts,
    ) -> Option<Action<S>> {
        let span = self.span(pair);
        if !span.near {
            pair.history = BlockHistory::default();
            return None;
        }
        let (i, j) = pair.ends();
        if self.shape(i).is_none() && self.shape(j).is_none() {
            let distance = span.squared.sqrt();
            let measured = PairSpan {
                between: &span.between,
                squared: span.squared,
                distance,
                inverse: 1.0 / distance,
            };
            let grains = dry(self.view.motion);
            let record = &mut tally.deepest;
            return act::<S, BlockLaw>(self.rows, pair, grains, measured, record, self.time_step);
        }
        tally.calls += 1;
        let between = S::to_volume(&span.between);
        let mut history = pair.history;
        let (touch, swapped) = self.meet(pair, &between, &mut history, narrow);
        if let Some(touch) = &touch {
            let smaller = self.inner(i).min(self.inner(j));
            let other = Partner::Entry(pair.second);
            tally.deepest.note(touch.depth, smaller, pair.first, other);
        }
        let action = touch.map(|touch| {
            let (first, second, separation) = if swapped {
                (j, i, -between)
            } else {
                (i, j, between)
            };
            let approach = self.approach([first, second], separation, pair.scale.mass);
            self.rows
                .parameters_at(pair.row)
                .act(&touch, &mut history, &approach)
        });
        pair.history = if touch.is_none() && self.rounded(pair) {
            BlockHistory::default()
        } else {
            history
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

    /// Returns `true` if one body of a pair is a sphere: the narrow phase then neither reads nor clears the
    /// history.
    pub(super) fn rounded(&self, pair: &BlockPair) -> bool {
        let (i, j) = pair.ends();
        self.shape(i).is_none() || self.shape(j).is_none()
    }

    pub(super) fn approach(
        &self,
        [i, j]: [usize; 2],
        separation: Vector3<f64>,
        mass: f64,
    ) -> Approach {
        let (one, two) = (&self.view.motion[i], &self.view.motion[j]);
        Approach {
            velocity: S::to_volume(&(two.velocity - one.velocity)),
            spins: [in_space(&one.spin), in_space(&two.spin)],
            separation,
            mass,
            time_step: self.time_step,
            part: 1.0,
            damped: 1.0,
        }
    }

    /// Calls [`Self::act`] on active pairs, by threads if there is more than one set of buffers; `active` are
    /// indices relative to `base` in `pairs`. Returns the number of calls of the narrow phase and the deepest
    /// contact.
    pub(super) fn act_on_pieces(
        &self,
        (active, base): (&[u32], usize),
        pairs: &mut [BlockPair],
        actions: &mut [Action<S>],
        narrows: &mut [Narrow],
    ) -> StepCounts {
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
            return StepCounts {
                calls: a.calls + b.calls,
                deepest: a.deepest.or(b.deepest),
            };
        }
        let mut tally = StepCounts {
            calls: 0,
            deepest: Record::beyond(self.deepest),
        };
        if let Some(narrow) = narrows.first_mut() {
            for (&k, action) in active.iter().zip(actions) {
                let pair = &mut pairs[k as usize - base];
                *action = self.act(pair, narrow, &mut tally).unwrap_or_default();
            }
        }
        tally
    }

    /// Returns the radius of a sphere, or for a block the distance from its centroid to the nearest face \[m\].
    fn inner(&self, k: usize) -> f64 {
        self.shape(k)
            .map_or_else(|| self.view.body[k].radius, inner_radius)
    }

    /// Returns the contact of a block with a plane, or none.
    pub(super) fn meet_plane(
        &self,
        pair: &BlockAtPlane,
        wall: &Wall<S>,
        history: &mut BlockHistory,
        narrow: &mut Narrow,
    ) -> Option<Geometry> {
        let k = pair.grain as usize;
        let height = wall.distance(&self.view.motion[k].position);
        if height >= pair.radius {
            *history = BlockHistory::default();
            return None;
        }
        let placed = self.poses[k].placed(self.shape(k)?);
        narrow.plane(
            &placed,
            &S::to_volume(&wall.normal),
            height,
            self.model,
            history,
        )
    }

    /// Returns the force and moment of a plane on a block; none if there is no contact.
    pub(super) fn act_at_plane(
        &self,
        pair: &mut BlockAtPlane,
        wall: &Wall<S>,
        narrow: &mut Narrow,
        record: &mut Record,
    ) -> Option<Load<S>> {
        let mut history = pair.history;
        let touch = self.meet_plane(pair, wall, &mut history, narrow);
        if let Some(touch) = &touch {
            self.note_at_wall(touch, pair.grain, pair.wall, record);
        }
        let action = touch.map(|touch| {
            self.act_at_wall(
                pair.grain as usize,
                wall,
                &pair.constants,
                (&touch, (1.0, 1.0)),
                &mut history,
            )
        });
        pair.history = history;
        action
    }

    /// Returns the force and moment on block `k` of a contact with a wall; see [`Approach`] for `part` and `damped`.
    pub(super) fn act_at_wall(
        &self,
        k: usize,
        wall: &Wall<S>,
        constants: &BlockConstants,
        (touch, (part, damped)): (&Geometry, (f64, f64)),
        history: &mut BlockHistory,
    ) -> Load<S> {
        let block = &self.view.motion[k];
        let approach = Approach {
            velocity: S::to_volume(&(wall.velocity - block.velocity)),
            spins: [in_space(&block.spin), Vector3::zeros()],
            separation: Vector3::zeros(),
            mass: constants.scale.mass,
            time_step: self.time_step,
            part,
            damped,
        };
        let action = constants.law.act(touch, history, &approach);
        Load {
            force: S::from_volume(&-action.force),
            torque: out_of_space(&action.on_first),
        }
    }

    /// Records the depth of block `k` in a wall.
    pub(super) fn note_at_wall(&self, touch: &Geometry, k: u32, wall: u32, record: &mut Record) {
        record.note(touch.depth, self.inner(k as usize), k, Partner::Wall(wall));
    }

    /// Visits the contacts of block `k` with the faces of a wall, given by the nearby facets; returns the number of
    /// calls of the narrow phase.
    pub(super) fn meet_faces(
        &self,
        k: usize,
        wall: &Wall<S>,
        faces: &Faces,
        order: &mut Vec<[u32; 2]>,
        narrow: &mut Narrow,
        mut visit: impl FnMut(&[[u32; 2]], Geometry),
    ) -> u64 {
        if let Some(surface) = &wall.surface {
            let centre = wall.local(&self.view.motion[k].position);
            surface.leave_seen(faces, &centre, order);
        }
        let mut calls = 0;
        for face in order.chunk_by(|a, b| a[0] == b[0]) {
            calls += 1;
            if let Some(touch) = self.meet_face(k, wall, face, narrow) {
                visit(face, touch);
            }
        }
        calls
    }

    /// Returns the fraction of the dashpot with which a face acts on block `k`.
    pub(super) fn damped(
        &self,
        k: usize,
        wall: &Wall<S>,
        faces: &Faces,
        face: &[[u32; 2]],
        constants: &BlockConstants,
    ) -> f64 {
        let (Some(surface), Some(shape)) = (&wall.surface, self.shape(k)) else {
            return 1.0;
        };
        if constants.law.normal_damping_ratio <= 0.0 {
            return 1.0;
        }
        let rotation = self.poses[k].placed(shape).rotation;
        let centre = wall.local(&self.view.motion[k].position);
        surface.damped(faces, face, &centre, |direction| {
            shape.support(&rotation.tr_mul(direction)).1
        })
    }

    /// Computes the contact of block `k` with a face, given by the nearby facets of the face.
    pub(super) fn meet_face(
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
                narrow.add_hidden_part(&placed, corners, &normal, &mut hidden);
            } else {
                narrow.add_hidden_part(&placed, corners.rev(), &normal, &mut hidden);
            }
        }
        hidden.contact(&placed, &normal, height.abs())
    }
}
