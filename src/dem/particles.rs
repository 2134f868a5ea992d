//! The grains of one rank as a struct of arrays: [`Particles`] lists every array.
//!
//! Entries are the owned grains in ascending order of ids, then the ghosts. A ghost represents one image of a grain
//! owned by another rank, or of an owned grain through a periodic face.
//!
//! **Positions are raw**: they are never wrapped into a periodic box. Each entry has an integer `shift`, and its
//! image is at `position + shift * box length`. Wrapping a grain changes only its shift. The bits of a path
//! therefore do not depend on when a grain was wrapped, and a pair has the same separation, bit by bit, on every
//! rank that has it.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;

use super::columns::{Array, CheckpointColumns, Crosses, Optional, grain_arrays};
use super::ghost_plan::GhostPlan;
use super::message::{Reader, Writer};
use super::polyhedron::{Polyhedron, RotationState};
use super::space::{Components, Space, spin, vector};
use super::table::{Columns, Entry, NamedColumns, Values, entry, joined};
use base::error::Error;

/// Kind of motion of a grain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Kind {
    /// Motion under forces.
    #[default]
    Free,
    /// Body without motion.
    Fixed,
    /// Prescribed velocity and spin.
    Driven,
    /// Body that is free, but kept at its position for a time. Its contacts are those of a free body, and bonds between
    /// two of them stay.
    Held,
}

impl Kind {
    const fn code(self) -> u64 {
        match self {
            Self::Free => 0,
            Self::Fixed => 1,
            Self::Driven => 2,
            Self::Held => 3,
        }
    }

    fn from_code(code: u64) -> Result<Self, Error> {
        match code {
            0 => Ok(Self::Free),
            1 => Ok(Self::Fixed),
            2 => Ok(Self::Driven),
            3 => Ok(Self::Held),
            other => Err(Error::Io(format!(
                "{other} is not a kind of grain (0, 1, 2 or 3)"
            ))),
        }
    }
}

impl<S: Space> Entry<S> for Kind {
    const BYTES: usize = 8;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        to.integer(self.code());
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        Self::from_code(from.integer()?)
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        to.whole(name, values.map(Self::code));
    }
    fn first_column(name: &str) -> String {
        name.to_owned()
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        let column = from.get_whole(name)?.iter();
        column.map(|code| Self::from_code(*code)).collect()
    }
}

entry! {
    /// Shape, mass and material of a grain.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Body {
        /// Id, unique over all ranks and times.
        pub id: u64,
        /// Radius \[m\].
        pub radius: f64,
        /// Mass [kg; kg per m of depth in two dimensions].
        pub mass: f64,
        /// Moment of inertia about the centre [kg m²; per m of depth in two dimensions].
        pub inertia: f64,
        /// Index in the table of contact parameters.
        pub material: u32,
        /// Kind of motion.
        pub kind: Kind,
    }
}

impl Body {
    /// Returns a free disc or sphere of uniform density [kg/m³].
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

    /// Returns the principal moments of inertia of a block with this shape and the mass of the body [kg m²].
    #[inline]
    pub(super) fn moments(&self, shape: &Polyhedron) -> Vector3<f64> {
        shape.inertia(self.mass / shape.volume())
    }
}

entry! {
    /// Position and velocities of a grain.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Motion<S: Space> {
        /// Raw position of the centre \[m\]: see the module.
        pub position: S::Vector,
        /// Velocity of the centre [m/s].
        pub velocity: S::Vector,
        /// Angular velocity [rad/s].
        pub spin: S::Spin,
    }
}

impl<S: Space> Motion<S> {
    /// Returns the motion of a body from position \[m\], velocity [m/s] and angular velocity [rad/s].
    #[must_use]
    pub fn new(position: [f64; 3], velocity: [f64; 3], angular_velocity: [f64; 3]) -> Self {
        Self {
            position: vector::<S>(position),
            velocity: vector::<S>(velocity),
            spin: spin::<S>(angular_velocity),
        }
    }
}

entry! {
    /// Force \[N\] and moment about the centre \[N m\]; in the plane both per m of depth.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Load<S: Space> {
        /// Force \[N\].
        pub force: S::Vector,
        /// Moment about the centre \[N m\].
        pub torque: S::Spin,
    }
}

/// Shape number of spheres.
pub const SPHERE: u32 = u32::MAX;

/// Number of values per grain in [`Particles::extra`].
pub const EXTRA: usize = 12;

/// Quotients used in every step: 1/mass and 1/inertia, and 1 for a grain that gravity accelerates; all 0 unless
/// free, with a negative zero for a body that is held.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Mobility {
    pub(super) inverse_mass: f64,
    pub(super) inverse_inertia: f64,
    pub(super) free: f64,
}

impl Mobility {
    fn new(body: &Body) -> Self {
        match body.kind {
            Kind::Free => Self {
                inverse_mass: 1.0 / body.mass,
                inverse_inertia: 1.0 / body.inertia,
                free: 1.0,
            },
            Kind::Fixed | Kind::Driven => Self::default(),
            Kind::Held => Self {
                free: -0.0,
                ..Self::default()
            },
        }
    }

    /// Returns `true` for a body whose contacts with walls and bodies at rest count: a free one, or one that is held.
    #[inline(always)]
    pub(super) fn meets_all(&self) -> bool {
        self.free > 0.0 || self.free.is_sign_negative()
    }
}

grain_arrays! {
    /// Grains of one rank. A new line adds an array with one element per grain.
    ///
    /// A line: `name: container<type>, occasion on which it crosses ranks, hashed or not and name in a checkpoint,
    /// value of a new grain`.
    #[derive(Debug)]
    pub struct Particles {
        given {
            /// Body of each entry.
            pub body: Vec<Body>, Creation, Hashed("");
            /// Image of each entry \[periods along each axis\]. It depends on when lists were built; a checkpoint
            /// contains instead the shift that moves the grain into the box.
            pub shift: Vec<[i32; 3]>, Creation, Unhashed("shift"), saves shift_into_box;
            /// Position, velocity and spin of each entry.
            pub motion: Vec<Motion<S>>, EveryStep, Hashed("");
        }
        held {
            /// Load of the contacts at the end of the last step; undefined for ghosts.
            pub contact: Vec<Load<S>>, Migration, Hashed("contact"), |_| Load::default();
            /// Load of the fluid, constant over the solid steps of a fluid step; undefined for ghosts. Only in
            /// scenes with a fluid: [`Self::allocate_fluid_loads`].
            pub fluid: Optional<Load<S>>, Migration, Hashed("fluid"), |_| Load::default();
            /// Values that the coupling stores per grain; undefined for ghosts. Only in scenes with a lattice:
            /// [`Self::keep_extra`].
            pub extra: Optional<[f64; EXTRA]>, Migration, Hashed("extra"), |_| [0.0; EXTRA];
            /// Raw position at the time of [`Self::mark_start`], or at the insertion of the grain if that is later
            /// \[m\]; undefined for ghosts.
            pub(super) start: Optional<S::Vector>, Migration, Hashed("start"), |new| new.motion.position;
            /// Velocity at the last coupling [m/s]; undefined for ghosts. Only in scenes with seepage:
            /// [`Self::keep_last_velocity`].
            pub last_velocity: Optional<S::Vector>, Migration, Hashed("last_velocity"), |new| new.motion.velocity;
            /// Degree of saturation of the ground around each grain, and volume of water per volume of grains
            /// \[1\]. Only in scenes with unsaturated ground: [`Self::keep_moisture`].
            pub moisture: Optional<[f64; 2]>, EveryStep, Hashed("moisture"), |_| [0.0; 2];
            /// Index in the table of shapes, [`SPHERE`] for a sphere. Only in scenes with blocks:
            /// [`Self::set_shapes`].
            pub(super) shape: Optional<u32>, Creation, Hashed("shape"), |_| SPHERE;
            /// Orientation and angular momentum. Only in scenes with blocks.
            pub(super) rotation: Optional<RotationState>, EveryStep, Hashed(""), |_| RotationState::default();
        }
        derived {
            /// Inverse mass [1/kg] and inverse moment of inertia [1/[kg m²]].
            pub(super) mobility: Mobility, |new| Mobility::new(&new.body);
        }
        /// Number of owned entries: they are the first entries.
        pub(super) owned: usize,
        /// Table of shapes of the scene, the same on every rank.
        pub(super) shapes: Arc<[Polyhedron]>,
        /// Plan of the ghosts on other ranks.
        pub(super) plan: GhostPlan,
        /// Length of the box along periodic axes, otherwise 0 \[m\].
        pub(super) lengths: [f64; 3],
        /// Lower corner of the box \[m\].
        pub(super) origin: [f64; 3],
        /// `true` if the lists built for these grains are still valid.
        pub(super) listed: bool,
        /// `true` if the contact loads are those of the present positions.
        pub(super) loaded: bool,
        /// Number of grains added since lists were last built.
        pub(super) added: u64,
        /// Number of grains removed since lists were last built.
        pub(super) removed: u64,
    }
}

impl<S: Space> Particles<S> {
    /// Returns an empty list.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Discards the contact loads, so that the next step computes them. Call it if the surroundings of the grains
    /// have changed.
    pub fn forget_loads(&mut self) {
        self.loaded = false;
    }

    /// Returns the number of grains that this rank owns: entries `0..owned()`.
    #[must_use]
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// Returns the number of entries: owned grains and ghosts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.body.len()
    }

    /// Returns `true` if there are no entries.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.body.is_empty()
    }

    /// Returns the position of the image of entry `k` \[m\], which for an owned grain is inside the box right after
    /// the lists were built.
    #[must_use]
    #[inline]
    pub fn location(&self, k: usize) -> S::Vector {
        image_position(&self.motion[k], self.shift[k], &self.lengths)
    }

    /// Returns the shift that moves owned grain `k` into the box, from its position alone, independently of when
    /// lists were built.
    pub(super) fn shift_into_box(&self, k: usize) -> [i32; 3] {
        let at = &self.motion[k].position;
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION && self.lengths[axis] > 0.0 {
                super::region::wraps(at.get(axis), self.origin[axis], self.lengths[axis])
            } else {
                0
            }
        })
    }

    /// Allocates a load of the fluid for each grain, initially 0. Call it on all ranks or on none.
    pub fn allocate_fluid_loads(&mut self) {
        if !self.fluid.is_allocated() {
            let loads = self.body.iter().map(|_| Load::default());
            self.fluid.allocate(loads);
        }
    }

    /// Returns the load of the fluid on owned grain `k`; none in a dry scene.
    #[must_use]
    #[inline]
    pub fn fluid_load(&self, k: usize) -> Load<S> {
        self.fluid.get(k).copied().unwrap_or_default()
    }

    /// Allocates the values of a coupling for each grain ([`Self::extra`]), initially 0. Call it on all ranks or on
    /// none.
    pub fn keep_extra(&mut self) {
        if !self.extra.is_allocated() {
            let numbers = self.body.iter().map(|_| [0.0; EXTRA]);
            self.extra.allocate(numbers);
        }
    }

    /// Allocates the velocity at the last coupling for each grain ([`Self::last_velocity`]), initially the present
    /// one. Call it on all ranks or on none.
    pub fn keep_last_velocity(&mut self) {
        if !self.last_velocity.is_allocated() {
            let velocities = self.motion.iter().map(|motion| motion.velocity);
            self.last_velocity.allocate(velocities);
        }
    }

    /// Allocates the moisture of each grain ([`Self::moisture`]), initially 0. Call it on all ranks or on none.
    pub fn keep_moisture(&mut self) {
        if !self.moisture.is_allocated() {
            let dry = self.body.iter().map(|_| [0.0; 2]);
            self.moisture.allocate(dry);
            // The messages to ghosts are longer from now on.
            self.plan.step = None;
        }
    }

    /// Stores the present position of each grain as its start. A grain inserted later starts where it is inserted.
    pub fn mark_start(&mut self) {
        let positions = self.motion.iter().map(|motion| motion.position);
        self.start.allocate(positions);
    }

    /// Discards the start positions of the grains.
    pub fn forget_start(&mut self) {
        self.start.free();
    }

    /// Returns `true` if the grains have start positions.
    #[must_use]
    pub fn has_start(&self) -> bool {
        self.start.is_allocated()
    }

    /// Returns the displacement of owned grain `k` from its start \[m\]. Positions are raw, so that a path through
    /// a periodic face counts in full. `None` without [`Self::mark_start`].
    #[must_use]
    pub fn displacement(&self, k: usize) -> Option<S::Vector> {
        let start = self.start.get(k)?;
        Some(self.motion[k].position - *start)
    }

    /// Returns the entries as plain slices, which many threads can read.
    #[must_use]
    pub fn view(&self) -> ParticlesView<'_, S> {
        ParticlesView {
            owned: self.owned,
            body: &self.body,
            contact: &self.contact,
            fluid: &self.fluid,
            last_velocity: &self.last_velocity,
            mobility: &self.mobility,
            motion: &self.motion,
            shift: &self.shift,
            lengths: self.lengths,
            shapes: &self.shapes,
            shape: &self.shape,
            rotation: &self.rotation,
        }
    }

    /// Inserts a grain at any position on this rank. The next step sends it to its owner. Ghosts are dropped.
    #[inline(never)]
    pub fn insert(&mut self, body: Body, motion: Motion<S>) {
        self.drop_ghosts();
        self.push(&NewEntry {
            body,
            shift: [0; 3],
            motion,
        });
        self.owned += 1;
        self.added += 1;
        self.listed = false;
    }

    /// Removes every owned grain for which `leaves(entry)` returns `true` and returns the removed grains in
    /// ascending order of ids. Ghosts are dropped; the next step creates them again.
    pub fn remove(
        &mut self,
        mut leaves: impl FnMut(&Self, usize) -> bool,
    ) -> Vec<(Body, Motion<S>)> {
        // Usually no grain leaves, and nothing is allocated.
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
        self.listed = false;
        taken
    }

    /// Makes owned grain `k` free, fixed, driven or held. A driven grain keeps its velocity: see [`Self::drive`].
    ///
    /// The next step builds new lists and updates every rank that has the grain.
    pub fn set_kind(&mut self, k: usize, kind: Kind) {
        self.body[k].kind = kind;
        self.mobility[k] = Mobility::new(&self.body[k]);
        if matches!(kind, Kind::Fixed | Kind::Held) {
            self.motion[k].velocity = S::Vector::default();
            self.motion[k].spin = S::Spin::default();
        }
        self.update_angular_momentum(k);
        self.listed = false;
    }

    /// Prescribes velocity [m/s] and spin [rad/s] of owned grain `k`, which becomes driven.
    pub fn drive(&mut self, k: usize, velocity: S::Vector, spin: S::Spin) {
        if self.body[k].kind != Kind::Driven {
            self.set_kind(k, Kind::Driven);
        }
        self.motion[k].velocity = velocity;
        self.motion[k].spin = spin;
        self.update_angular_momentum(k);
    }

    /// Changes the radius \[m\] of owned grain `k`, but not its mass.
    pub fn set_radius(&mut self, k: usize, radius: f64) {
        self.body[k].radius = radius;
        self.listed = false;
    }

    /// Drops the ghosts.
    pub(super) fn drop_ghosts(&mut self) {
        self.truncate(self.owned);
        self.plan = GhostPlan::default();
    }

    /// Keeps the owned grains for which `stays(k)` returns `true`, in their order; call it when there are no
    /// ghosts.
    pub(super) fn keep(&mut self, stays: impl Fn(usize) -> bool) {
        let order: Vec<usize> = (0..self.owned).filter(|&k| stays(k)).collect();
        self.arrange(&order);
    }

    /// Sorts owned grains in ascending order of ids; call it when there are no ghosts.
    pub(super) fn sort(&mut self) {
        if !self.body.is_sorted_by_key(|body| body.id) {
            let mut order: Vec<usize> = (0..self.owned).collect();
            order.sort_unstable_by_key(|&k| self.body[k].id);
            self.arrange(&order);
        }
    }

    fn arrange(&mut self, order: &[usize]) {
        self.arrange_arrays(order);
        self.owned = order.len();
    }

    /// Returns the owned grains with all data on which the next step depends, in ascending order of ids.
    #[must_use]
    #[inline(never)]
    pub fn table(&self) -> NamedColumns {
        NamedColumns::collect(|columns| self.save_columns(false, columns))
    }

    /// Calls `take` with the columns of [`Self::table`] that the hash of the state includes, one after another, ids
    /// first.
    pub fn each_hashed_column(&self, mut take: impl FnMut(&str, &Values)) {
        self.save_columns(true, &mut Columns(&mut |name, values| take(&name, &values)));
    }

    /// Returns grains from rows of [`Self::table`]: each row must be on exactly one rank, whichever it is. The next
    /// lists set the lengths of the box. If there are blocks, call [`Self::set_shapes`] next.
    ///
    /// # Errors
    /// If a column is missing, short or of another type.
    #[inline(never)]
    pub fn from_table(table: &NamedColumns) -> Result<Self, Error> {
        let mut particles = Self::new();
        particles.load_columns(table)?;
        particles.owned = table.rows();
        particles.loaded = true;
        Ok(particles)
    }

    /// Returns the kinetic energy [J; per m of depth in two dimensions] of owned grain `k`.
    #[must_use]
    pub fn kinetic_energy(&self, k: usize) -> f64 {
        let (body, motion) = (&self.body[k], &self.motion[k]);
        let twice = body.mass * motion.velocity.scalar(&motion.velocity);
        match self.polyhedron(k) {
            None => 0.5 * (twice + body.inertia * motion.spin.scalar(&motion.spin)),
            Some((shape, rotation)) => 0.5 * twice + rotation.energy(&body.moments(shape)),
        }
    }
}

/// Data of [`Particles`] that all threads may read.
#[derive(Clone, Copy, Debug)]
pub struct ParticlesView<'a, S: Space> {
    /// Number of owned entries.
    pub owned: usize,
    /// Body of each entry.
    pub body: &'a [Body],
    /// Position and velocities of each entry.
    pub motion: &'a [Motion<S>],
    /// Loads of the contacts.
    pub contact: &'a [Load<S>],
    /// Loads of the fluid; empty without a fluid.
    pub fluid: &'a [Load<S>],
    /// Velocities at the last coupling: see [`Particles::keep_last_velocity`]; empty if not stored.
    pub last_velocity: &'a [S::Vector],
    /// Inverse mass and inertia of each entry.
    pub(super) mobility: &'a [Mobility],
    /// Image of each entry \[periods along each axis\].
    pub shift: &'a [[i32; 3]],
    /// Length of the box along periodic axes, otherwise 0 \[m\].
    pub lengths: [f64; 3],
    pub(super) shapes: &'a [Polyhedron],
    pub(super) shape: &'a [u32],
    pub(super) rotation: &'a [RotationState],
}

impl<S: Space> ParticlesView<'_, S> {
    /// Returns the position of the image of entry `k` \[m\]: see [`Particles::location`].
    #[must_use]
    #[inline]
    pub fn location(&self, k: usize) -> S::Vector {
        image_position(&self.motion[k], self.shift[k], &self.lengths)
    }
}

#[inline]
pub(super) fn image_position<S: Space>(
    motion: &Motion<S>,
    shift: [i32; 3],
    lengths: &[f64; 3],
) -> S::Vector {
    let mut at = motion.position;
    for axis in 0..S::DIMENSION {
        // A sum with a product that is exactly 0 along axes that are not periodic.
        at.set(axis, at.get(axis) + f64::from(shift[axis]) * lengths[axis]);
    }
    at
}
