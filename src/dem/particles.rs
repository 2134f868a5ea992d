//! The grains of one rank: arrays grouped by when they cross ranks.
//!
//! | group | crosses | arrays |
//! |---|---|---|
//! | body | when a ghost is made | [`Body`]: id, radius, mass, inertia, material, kind |
//! | motion | every solid step | [`Motion`]: position, velocity, spin |
//! | loads | on migration only | contact load, fluid load; extra and start where one asks |
//! | blocks | shape with the body, attitude with the motion | only in scenes with blocks: [`super::blocks`] |
//!
//! Entries are the owned grains in rising order of id, then the ghosts. A ghost stands for one image of a grain owned
//! by another rank, or of an own grain through a periodic face.
//!
//! **Positions are raw**: they are never wrapped into a periodic box. Each entry carries an integer `shift`, and an image
//! stands at `position + shift * box length`. Wrapping a grain only changes its shift, so that the bits of its path do not
//! depend on when it was wrapped, and a pair has the same separation, bit by bit, on every rank that sees it.

use super::blocks::{ATTITUDE, Blocks, SPHERE, moments, pack_attitude, unpack_attitude};
use super::polyhedron::Attitude;
use super::ranks::{Pattern, Ranks, Reader, Writer};
use super::space::{Components, Space};
use crate::error::Error;

/// Who moves a grain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Kind {
    /// Forces move it.
    #[default]
    Free,
    /// Nothing moves it.
    Fixed,
    /// A prescribed velocity and spin move it.
    Driven,
}

impl Kind {
    pub(super) const fn code(self) -> u64 {
        match self {
            Self::Free => 0,
            Self::Fixed => 1,
            Self::Driven => 2,
        }
    }

    pub(super) fn from_code(code: u64) -> Result<Self, Error> {
        match code {
            0 => Ok(Self::Free),
            1 => Ok(Self::Fixed),
            2 => Ok(Self::Driven),
            other => Err(Error::Internal(format!("{other} is no kind of grain"))),
        }
    }
}

/// What a grain is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Unique over all ranks and times.
    pub id: u64,
    /// Radius (m).
    pub radius: f64,
    /// Mass (kg; in the plane kg per m of depth).
    pub mass: f64,
    /// Moment of inertia about the centre (kg m²; in the plane per m of depth).
    pub inertia: f64,
    /// Row in the table of contact parameters.
    pub material: u32,
    /// Who moves it.
    pub kind: Kind,
}

impl Body {
    /// A free disc or sphere of uniform density (kg/m³).
    #[must_use]
    pub fn uniform<S: Space>(id: u64, radius: f64, density: f64, material: u32) -> Self {
        let mass = S::mass(density, radius);
        Self {
            id,
            radius,
            mass,
            inertia: S::inertia(mass, radius),
            material,
            kind: Kind::Free,
        }
    }
}

/// Where a grain is and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion<S: Space> {
    /// Centre (m), raw: see the module.
    pub position: S::Vector,
    /// Velocity of the centre (m/s).
    pub velocity: S::Vector,
    /// Angular velocity (rad/s).
    pub spin: S::Spin,
}

/// A force (N) and the moment about the centre (N m); in the plane both per m of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load<S: Space> {
    /// Force (N).
    pub force: S::Vector,
    /// Moment about the centre (N m).
    pub torque: S::Spin,
}

/// How many numbers [`Particles::extra`] holds per grain.
pub const EXTRA: usize = 12;

/// The divisions of a step, done once: 1/mass and 1/inertia, and 1 for a grain that gravity moves; all 0 unless free.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mobility {
    pub(super) inverse_mass: f64,
    pub(super) inverse_inertia: f64,
    pub(super) free: f64,
}

impl Mobility {
    fn of(body: &Body) -> Self {
        match body.kind {
            Kind::Free => Self {
                inverse_mass: 1.0 / body.mass,
                inverse_inertia: 1.0 / body.inertia,
                free: 1.0,
            },
            Kind::Fixed | Kind::Driven => Self::default(),
        }
    }
}

/// Which own grains are whose ghosts, and the messages that keep them up to date.
#[derive(Default)]
pub(super) struct GhostPlan {
    /// Per target rank the own entries it holds, in the order of its ghosts; never this rank.
    pub(super) sends: Vec<(usize, Vec<u32>)>,
    /// Per source rank its range of ghost entries.
    pub(super) receives: Vec<(usize, std::ops::Range<usize>)>,
    /// Own images through periodic faces: `(own entry, ghost entry)`.
    pub(super) images: Vec<(u32, u32)>,
    pattern: Option<Box<dyn Pattern>>,
    outgoing: Vec<Vec<u8>>,
    incoming: Vec<Vec<u8>>,
    back: Option<Back>,
}

/// The way back, from ghosts to owners: messages and buffers for rows of some length.
struct Back {
    /// Numbers in a row.
    row: usize,
    pattern: Box<dyn Pattern>,
    outgoing: Vec<Vec<u8>>,
    incoming: Vec<Vec<u8>>,
}

impl Back {
    fn new(
        row: usize,
        sends: &[(usize, Vec<u32>)],
        receives: &[(usize, std::ops::Range<usize>)],
        ranks: &dyn Ranks,
    ) -> Result<Self, Error> {
        let bytes = |rows: usize| rows * row * size_of::<i128>();
        let out: Vec<_> = receives
            .iter()
            .map(|(rank, range)| (*rank, bytes(range.len())))
            .collect();
        let back: Vec<_> = sends
            .iter()
            .map(|(rank, entries)| (*rank, bytes(entries.len())))
            .collect();
        Ok(Self {
            row,
            pattern: ranks.pattern(&out, &back)?,
            outgoing: out.iter().map(|&(_, n)| Vec::with_capacity(n)).collect(),
            incoming: back.iter().map(|&(_, n)| vec![0; n]).collect(),
        })
    }
}

impl std::fmt::Debug for GhostPlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GhostPlan")
            .field("sends", &self.sends)
            .field("receives", &self.receives)
            .field("images", &self.images)
            .finish_non_exhaustive()
    }
}

/// The grains of one rank: see the module.
#[derive(Debug)]
pub struct Particles<S: Space> {
    pub(super) owned: usize,
    /// What each entry is.
    pub body: Vec<Body>,
    /// Where each entry is and how it moves.
    pub motion: Vec<Motion<S>>,
    /// Which image each entry stands for, in box lengths along each axis.
    pub shift: Vec<[i32; 3]>,
    /// Load of the contacts at the end of the last step; entries of ghosts mean nothing.
    pub contact: Vec<Load<S>>,
    /// Load of the fluid on each owned grain, held over the solid steps, empty unless [`Self::immerse`] was called; entries of
    /// ghosts mean nothing.
    pub fluid: Vec<Load<S>>,
    /// Numbers of the coupling that travel with an owned grain, empty unless [`Self::keep_extra`] was called; entries of
    /// ghosts mean nothing.
    pub extra: Vec<[f64; EXTRA]>,
    pub(super) keeps_extra: bool,
    pub(super) immersed: bool,
    /// Where each entry was when [`Self::mark_start`] was called (m, raw); entries of ghosts mean nothing.
    pub(super) start: Option<Vec<S::Vector>>,
    /// Shape and attitude of each entry; none in a scene without blocks.
    pub(super) blocks: Option<Blocks>,
    pub(super) mobility: Vec<Mobility>,
    pub(super) plan: GhostPlan,
    /// Length of the box along periodic axes, else 0.
    pub(super) lengths: [f64; 3],
    /// Lower corner of the box.
    pub(super) origin: [f64; 3],
    /// The lists made for these grains no longer hold.
    pub(super) stale: bool,
    /// The contact loads belong to the present positions.
    pub(super) loaded: bool,
    pub(super) added: u64,
    pub(super) removed: u64,
}

impl<S: Space> Default for Particles<S> {
    fn default() -> Self {
        Self {
            owned: 0,
            body: Vec::new(),
            motion: Vec::new(),
            shift: Vec::new(),
            contact: Vec::new(),
            fluid: Vec::new(),
            extra: Vec::new(),
            keeps_extra: false,
            immersed: false,
            start: None,
            blocks: None,
            mobility: Vec::new(),
            plan: GhostPlan::default(),
            lengths: [0.0; 3],
            origin: [0.0; 3],
            stale: true,
            loaded: false,
            added: 0,
            removed: 0,
        }
    }
}

impl<S: Space> Particles<S> {
    /// No grains.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The contact loads are to be found anew before the next step: what the grains touch has changed.
    pub fn forget_loads(&mut self) {
        self.loaded = false;
    }

    /// How many grains this rank owns: entries `0..owned()`.
    #[must_use]
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// How many entries there are: owned grains and ghosts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.body.len()
    }

    /// No entries at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.body.is_empty()
    }

    /// Where the image of entry `k` stands (m): inside the box for an owned grain right after the lists were made.
    #[must_use]
    #[inline]
    pub fn location(&self, k: usize) -> S::Vector {
        place(&self.motion[k], self.shift[k], &self.lengths)
    }

    /// The shift that brings owned grain `k` into the box: a matter of its position alone, not of when lists were made.
    pub(super) fn shift_into_box(&self, k: usize) -> [i32; 3] {
        let at = &self.motion[k].position;
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION && self.lengths[axis] > 0.0 {
                super::ghosts::wraps(at.get(axis), self.origin[axis], self.lengths[axis])
            } else {
                0
            }
        })
    }

    /// From now on each grain bears a load of the fluid, 0 at first. All ranks or none.
    pub fn immerse(&mut self) {
        if !self.immersed {
            self.immersed = true;
            self.fluid.resize(self.body.len(), Load::default());
        }
    }

    /// Load of the fluid on owned grain `k`; none in a dry scene.
    #[must_use]
    #[inline]
    pub fn fluid_load(&self, k: usize) -> Load<S> {
        self.fluid.get(k).copied().unwrap_or_default()
    }

    /// From now on each grain carries along the numbers of a coupling ([`Self::extra`]), 0 at first. All ranks or none.
    pub fn keep_extra(&mut self) {
        if !self.keeps_extra {
            self.keeps_extra = true;
            self.extra.resize(self.body.len(), [0.0; EXTRA]);
        }
    }

    /// From now on each grain carries along where it is at this moment, or where it appeared later.
    pub fn mark_start(&mut self) {
        self.start = Some(self.motion.iter().map(|motion| motion.position).collect());
    }

    /// The grains no longer carry along where they started.
    pub fn forget_start(&mut self) {
        self.start = None;
    }

    /// Whether the grains carry along where they started.
    #[must_use]
    pub fn has_start(&self) -> bool {
        self.start.is_some()
    }

    /// How far owned grain `k` is from where it started (m): positions are raw, so a path through a periodic face counts in
    /// full. `None` where nobody asked with [`Self::mark_start`].
    #[must_use]
    pub fn displacement(&self, k: usize) -> Option<S::Vector> {
        let start = self.start.as_ref()?.get(k)?;
        Some(self.motion[k].position - *start)
    }

    /// The same entries as plain slices, to be read by many threads.
    #[must_use]
    pub fn view(&self) -> View<'_, S> {
        View {
            owned: self.owned,
            body: &self.body,
            motion: &self.motion,
            shift: &self.shift,
            lengths: self.lengths,
            blocks: self.blocks.as_ref(),
        }
    }

    /// Velocity (m/s) of the material point of entry `k` at `arm` from its centre.
    #[must_use]
    #[inline]
    pub fn velocity_at(&self, k: usize, arm: &S::Vector) -> S::Vector {
        self.motion[k].velocity + S::surface_velocity(&self.motion[k].spin, arm)
    }

    /// Adds a grain to this rank, wherever it is: the next step hands it to its owner. Ghosts are dropped.
    pub fn insert(&mut self, body: Body, motion: Motion<S>) {
        self.drop_ghosts();
        self.push(body, motion, [0; 3]);
        self.owned += 1;
        self.added += 1;
        self.stale = true;
    }

    /// Takes out every owned grain for which `leaves(entry)` holds and returns what they were, by rising id. Ghosts are
    /// dropped, to be made again by the next step.
    pub fn remove(
        &mut self,
        mut leaves: impl FnMut(&Self, usize) -> bool,
    ) -> Vec<(Body, Motion<S>)> {
        // Most often nobody leaves: then nothing is allocated.
        let Some(first) = (0..self.owned).find(|&k| leaves(self, k)) else {
            return Vec::new();
        };
        let gone: Vec<bool> = (0..self.owned)
            .map(|k| k == first || (k > first && leaves(self, k)))
            .collect();
        self.drop_ghosts();
        let mut taken = Vec::new();
        for (k, _) in gone.iter().enumerate().filter(|(_, gone)| **gone) {
            taken.push((self.body[k], self.motion[k]));
        }
        self.keep(|k| !gone[k]);
        self.removed += taken.len() as u64;
        self.stale = true;
        taken
    }

    /// Makes owned grain `k` free, fixed or driven. A fixed or driven grain keeps the velocity it has: see [`Self::drive`].
    ///
    /// Every rank that holds the grain learns of it when the lists are next made, so that happens at the next step.
    pub fn set_kind(&mut self, k: usize, kind: Kind) {
        self.body[k].kind = kind;
        self.mobility[k] = Mobility::of(&self.body[k]);
        if kind == Kind::Fixed {
            self.motion[k].velocity = S::Vector::default();
            self.motion[k].spin = S::Spin::default();
        }
        self.follow_spin(k);
        self.stale = true;
    }

    /// Prescribes velocity (m/s) and spin (rad/s) of owned grain `k`, which is then driven.
    pub fn drive(&mut self, k: usize, velocity: S::Vector, spin: S::Spin) {
        if self.body[k].kind != Kind::Driven {
            self.set_kind(k, Kind::Driven);
        }
        self.motion[k].velocity = velocity;
        self.motion[k].spin = spin;
        self.follow_spin(k);
    }

    /// Changes the radius (m) of owned grain `k`, not its mass.
    pub fn set_radius(&mut self, k: usize, radius: f64) {
        self.body[k].radius = radius;
        self.stale = true;
    }

    pub(super) fn push(&mut self, body: Body, motion: Motion<S>, shift: [i32; 3]) {
        self.mobility.push(Mobility::of(&body));
        self.body.push(body);
        if let Some(start) = &mut self.start {
            start.push(motion.position);
        }
        if let Some(blocks) = &mut self.blocks {
            blocks.push(SPHERE, Attitude::default());
        }
        self.motion.push(motion);
        self.shift.push(shift);
        self.contact.push(Load::default());
        if self.immersed {
            self.fluid.push(Load::default());
        }
        if self.keeps_extra {
            self.extra.push([0.0; EXTRA]);
        }
    }

    /// Appends an image of entry `k`.
    pub(super) fn push_image(&mut self, k: usize, shift: [i32; 3]) {
        let (body, motion) = (self.body[k], self.motion[k]);
        self.push(body, motion, shift);
        if let Some(blocks) = &mut self.blocks {
            let image = blocks.shape.len() - 1;
            blocks.shape[image] = blocks.shape[k];
            blocks.attitude[image] = blocks.attitude[k];
        }
    }

    /// Back to the owned grains alone.
    pub(super) fn drop_ghosts(&mut self) {
        let owned = self.owned;
        self.body.truncate(owned);
        self.motion.truncate(owned);
        self.shift.truncate(owned);
        self.contact.truncate(owned);
        self.fluid.truncate(owned);
        self.extra.truncate(owned);
        if let Some(start) = &mut self.start {
            start.truncate(owned);
        }
        if let Some(blocks) = &mut self.blocks {
            blocks.truncate(owned);
        }
        self.mobility.truncate(owned);
        self.plan = GhostPlan::default();
    }

    /// Keeps the owned grains for which `stays(k)` holds, in their order; call without ghosts.
    pub(super) fn keep(&mut self, stays: impl Fn(usize) -> bool) {
        let order: Vec<usize> = (0..self.owned).filter(|&k| stays(k)).collect();
        self.arrange(&order);
    }

    /// Owned grains in rising order of id; call without ghosts.
    pub(super) fn sort(&mut self) {
        if !self.body.is_sorted_by_key(|body| body.id) {
            let mut order: Vec<usize> = (0..self.owned).collect();
            order.sort_unstable_by_key(|&k| self.body[k].id);
            self.arrange(&order);
        }
    }

    fn arrange(&mut self, order: &[usize]) {
        fn pick<T: Copy>(values: &mut Vec<T>, order: &[usize]) {
            *values = order.iter().map(|&k| values[k]).collect();
        }
        pick(&mut self.body, order);
        pick(&mut self.motion, order);
        pick(&mut self.shift, order);
        pick(&mut self.contact, order);
        if self.immersed {
            pick(&mut self.fluid, order);
        }
        if self.keeps_extra {
            pick(&mut self.extra, order);
        }
        if let Some(start) = &mut self.start {
            pick(start, order);
        }
        if let Some(blocks) = &mut self.blocks {
            pick(&mut blocks.shape, order);
            pick(&mut blocks.attitude, order);
        }
        pick(&mut self.mobility, order);
        self.owned = order.len();
    }

    /// Writes owned grain `k` with all that travels with it.
    pub(super) fn pack(&self, k: usize, to: &mut Writer) {
        pack_body(&self.body[k], self.shift[k], to);
        pack_motion(&self.motion[k], to);
        for load in std::iter::once(&self.contact[k]).chain(self.fluid.get(k)) {
            pack_components(&load.force, to);
            pack_components(&load.torque, to);
        }
        if self.keeps_extra {
            for value in self.extra[k] {
                to.float(value);
            }
        }
        if let Some(start) = &self.start {
            pack_components(&start[k], to);
        }
        if let Some(blocks) = &self.blocks {
            blocks.pack(k, to);
        }
    }

    /// Appends one owned grain written by [`Self::pack`]; call without ghosts.
    pub(super) fn unpack(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        let (body, shift) = unpack_body(from)?;
        let motion = unpack_motion(from)?;
        let contact = Load {
            force: unpack_components(from)?,
            torque: unpack_components(from)?,
        };
        let k = self.owned;
        self.push(body, motion, shift);
        self.contact[k] = contact;
        if self.immersed {
            self.fluid[k] = Load {
                force: unpack_components(from)?,
                torque: unpack_components(from)?,
            };
        }
        if self.keeps_extra {
            for value in &mut self.extra[k] {
                *value = from.float()?;
            }
        }
        if let Some(start) = &mut self.start {
            start[k] = unpack_components(from)?;
        }
        if let Some(blocks) = &mut self.blocks {
            blocks.unpack_last(from)?;
        }
        self.owned += 1;
        Ok(())
    }

    /// Sends the present motion of own grains to their ghosts. Collective; the ghosts are those of the last step.
    ///
    /// # Errors
    /// Where a message failed.
    pub fn refresh_ghosts(&mut self, ranks: &dyn Ranks) -> Result<(), Error> {
        let Self {
            motion,
            plan,
            blocks,
            ..
        } = self;
        for &(from, to) in &plan.images {
            motion[to as usize] = motion[from as usize];
        }
        if let Some(blocks) = blocks {
            for &(from, to) in &plan.images {
                blocks.attitude[to as usize] = blocks.attitude[from as usize];
            }
        }
        if ranks.size() == 1 {
            return Ok(());
        }
        let size = motion_bytes::<S>() + blocks.as_ref().map_or(0, |_| 8 * ATTITUDE);
        let pattern = match &mut plan.pattern {
            Some(pattern) => pattern,
            none => {
                let sends: Vec<_> = plan
                    .sends
                    .iter()
                    .map(|(rank, k)| (*rank, k.len() * size))
                    .collect();
                let receives: Vec<_> = plan
                    .receives
                    .iter()
                    .map(|(rank, range)| (*rank, range.len() * size))
                    .collect();
                plan.outgoing = sends
                    .iter()
                    .map(|&(_, bytes)| Vec::with_capacity(bytes))
                    .collect();
                plan.incoming = receives.iter().map(|&(_, bytes)| vec![0; bytes]).collect();
                none.insert(ranks.pattern(&sends, &receives)?)
            }
        };
        for ((_, entries), buffer) in plan.sends.iter().zip(&mut plan.outgoing) {
            let mut writer = Writer(std::mem::take(buffer));
            writer.0.clear();
            for &k in entries {
                pack_motion(&motion[k as usize], &mut writer);
            }
            if let Some(blocks) = blocks {
                for &k in entries {
                    pack_attitude(&blocks.attitude[k as usize], &mut writer);
                }
            }
            *buffer = writer.0;
        }
        pattern.run(&plan.outgoing, &mut plan.incoming)?;
        for ((_, range), buffer) in plan.receives.iter().zip(&plan.incoming) {
            let mut reader = Reader(buffer);
            for k in range.clone() {
                motion[k] = unpack_motion(&mut reader)?;
            }
            if let Some(blocks) = blocks {
                for k in range.clone() {
                    blocks.attitude[k] = unpack_attitude(&mut reader)?;
                }
            }
        }
        Ok(())
    }

    /// Adds every ghost's entry of `values` to its grain's entry at the owner, whole numbers without rounding, so that the
    /// sum does not depend on the order. `values` has one row per entry; the rows of ghosts keep their values. Collective.
    ///
    /// # Errors
    /// Where `values` has another length than the entries, or a message failed.
    pub fn reduce_to_owners<const N: usize>(
        &mut self,
        values: &mut [[i128; N]],
        ranks: &dyn Ranks,
    ) -> Result<(), Error> {
        if values.len() != self.len() {
            return Err(Error::Internal(format!(
                "{} rows to reduce for {} entries",
                values.len(),
                self.len()
            )));
        }
        let plan = &mut self.plan;
        for &(own, ghost) in &plan.images {
            let row = values[ghost as usize];
            add_row(&mut values[own as usize], &row);
        }
        if ranks.size() == 1 {
            return Ok(());
        }
        if plan.back.as_ref().is_none_or(|back| back.row != N) {
            plan.back = Some(Back::new(N, &plan.sends, &plan.receives, ranks)?);
        }
        let Some(back) = &mut plan.back else {
            return Ok(());
        };
        for ((_, range), buffer) in plan.receives.iter().zip(&mut back.outgoing) {
            buffer.clear();
            for value in values[range.clone()].iter().flatten() {
                buffer.extend_from_slice(&value.to_le_bytes());
            }
        }
        back.pattern.run(&back.outgoing, &mut back.incoming)?;
        for ((_, entries), bytes) in plan.sends.iter().zip(&back.incoming) {
            let rows = bytes.as_chunks::<16>().0.chunks_exact(N.max(1));
            for (&k, row) in entries.iter().zip(rows) {
                for (sum, value) in values[k as usize].iter_mut().zip(row) {
                    *sum = sum.wrapping_add(i128::from_le_bytes(*value));
                }
            }
        }
        Ok(())
    }

    /// Kinetic energy (J; in the plane per m of depth) of owned grain `k`.
    #[must_use]
    pub fn kinetic_energy(&self, k: usize) -> f64 {
        let (body, motion) = (&self.body[k], &self.motion[k]);
        let twice = body.mass * motion.velocity.scalar(&motion.velocity);
        match self.polyhedron(k) {
            None => 0.5 * (twice + body.inertia * motion.spin.scalar(&motion.spin)),
            Some((shape, attitude)) => 0.5 * twice + attitude.energy(&moments(body, shape)),
        }
    }
}

/// What all threads may read of [`Particles`].
#[derive(Clone, Copy, Debug)]
pub struct View<'a, S: Space> {
    /// How many entries are owned.
    pub owned: usize,
    /// What each entry is.
    pub body: &'a [Body],
    /// Where each entry is and how it moves.
    pub motion: &'a [Motion<S>],
    /// Which image each entry stands for.
    pub shift: &'a [[i32; 3]],
    /// Length of the box along periodic axes, else 0 (m).
    pub lengths: [f64; 3],
    pub(super) blocks: Option<&'a Blocks>,
}

impl<S: Space> View<'_, S> {
    /// As [`Particles::location`].
    #[must_use]
    #[inline]
    pub fn location(&self, k: usize) -> S::Vector {
        place(&self.motion[k], self.shift[k], &self.lengths)
    }
}

#[inline]
fn place<S: Space>(motion: &Motion<S>, shift: [i32; 3], lengths: &[f64; 3]) -> S::Vector {
    let mut at = motion.position;
    for axis in 0..S::DIMENSION {
        // A sum with a product that is exactly 0 where the axis is not periodic.
        at.set(axis, at.get(axis) + f64::from(shift[axis]) * lengths[axis]);
    }
    at
}

fn add_row<const N: usize>(to: &mut [i128; N], from: &[i128; N]) {
    for (sum, value) in to.iter_mut().zip(from) {
        *sum = sum.wrapping_add(*value);
    }
}

#[inline]
pub(super) fn pack_components<C: Components>(value: &C, to: &mut Writer) {
    for k in 0..C::COUNT {
        to.float(value.get(k));
    }
}

#[inline]
pub(super) fn unpack_components<C: Components>(from: &mut Reader<'_>) -> Result<C, Error> {
    let mut value = C::default();
    for k in 0..C::COUNT {
        value.set(k, from.float()?);
    }
    Ok(value)
}

const fn motion_bytes<S: Space>() -> usize {
    8 * (2 * S::Vector::COUNT + S::Spin::COUNT)
}

#[inline]
fn pack_motion<S: Space>(motion: &Motion<S>, to: &mut Writer) {
    pack_components(&motion.position, to);
    pack_components(&motion.velocity, to);
    pack_components(&motion.spin, to);
}

#[inline]
fn unpack_motion<S: Space>(from: &mut Reader<'_>) -> Result<Motion<S>, Error> {
    Ok(Motion {
        position: unpack_components(from)?,
        velocity: unpack_components(from)?,
        spin: unpack_components(from)?,
    })
}

fn pack_body(body: &Body, shift: [i32; 3], to: &mut Writer) {
    to.integer(body.id);
    to.float(body.radius);
    to.float(body.mass);
    to.float(body.inertia);
    to.integer(u64::from(body.material));
    to.integer(body.kind.code());
    for n in shift {
        to.signed(n);
    }
}

fn unpack_body(from: &mut Reader<'_>) -> Result<(Body, [i32; 3]), Error> {
    let body = Body {
        id: from.integer()?,
        radius: from.float()?,
        mass: from.float()?,
        inertia: from.float()?,
        material: u32::try_from(from.integer()?)
            .map_err(|_| Error::Internal("a material beyond 32 bits".into()))?,
        kind: Kind::from_code(from.integer()?)?,
    };
    let mut shift = [0; 3];
    for n in &mut shift {
        *n = from.signed()?;
    }
    Ok((body, shift))
}

/// Writes entry `k` as a ghost with another shift.
pub(super) fn pack_ghost<S: Space>(
    particles: &Particles<S>,
    k: usize,
    shift: [i32; 3],
    to: &mut Writer,
) {
    pack_body(&particles.body[k], shift, to);
    pack_motion(&particles.motion[k], to);
    if let Some(blocks) = &particles.blocks {
        blocks.pack(k, to);
    }
}

/// Appends a ghost written by [`pack_ghost`].
pub(super) fn unpack_ghost<S: Space>(
    particles: &mut Particles<S>,
    from: &mut Reader<'_>,
) -> Result<(), Error> {
    let (body, shift) = unpack_body(from)?;
    let motion = unpack_motion(from)?;
    particles.push(body, motion, shift);
    match &mut particles.blocks {
        Some(blocks) => blocks.unpack_last(from),
        None => Ok(()),
    }
}
