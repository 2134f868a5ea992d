//! Blocks among the grains: the shape of each entry and the state of its rotation.
//!
//! Scenes without blocks do not allocate these arrays. The table of shapes is the same on every rank.
//! `Body::radius` of a block is the radius of the enclosing sphere about its centroid, because searches and ghosts
//! treat all bodies as spheres. `Motion::spin` is computed from the rotational state.

use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::message::{Reader, Writer};
use super::particles::{Body, Kind, Motion, Particles, ParticlesView, SPHERE};
use super::polyhedron::{Polyhedron, RotationState};
use super::space::{Components, Space};
use super::table::{Columns, Entry, NamedColumns, joined};
use base::error::Error;

/// Motion of a block in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockMotion {
    /// Centroid \[m\].
    pub position: Vector3<f64>,
    /// Velocity of the centroid [m/s].
    pub velocity: Vector3<f64>,
    /// Orientation and angular momentum.
    pub rotation: RotationState,
}

/// Number of values in a rotational state.
const NUMBERS: usize = 7;

/// Columns of a rotational state: quaternion, then angular momentum.
const COLUMNS: [&str; NUMBERS] = [
    "orientation_x",
    "orientation_y",
    "orientation_z",
    "orientation_w",
    "angular_momentum_x",
    "angular_momentum_y",
    "angular_momentum_z",
];

/// Returns the values of a rotational state in the order of [`COLUMNS`].
fn numbers(rotation: &RotationState) -> [f64; NUMBERS] {
    let (q, l) = (rotation.orientation.coords, rotation.angular_momentum);
    [q.x, q.y, q.z, q.w, l.x, l.y, l.z]
}

/// Returns the rotational state from [`numbers`]. The quaternion is not normalised, so that its bits are preserved.
fn from_numbers(n: [f64; NUMBERS]) -> RotationState {
    RotationState {
        orientation: UnitQuaternion::new_unchecked(Quaternion::new(n[3], n[0], n[1], n[2])),
        angular_momentum: Vector3::new(n[4], n[5], n[6]),
    }
}

impl<S: Space> Entry<S> for RotationState {
    const BYTES: usize = 8 * NUMBERS;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        Entry::<S>::pack(&numbers(self), to);
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(from_numbers(Entry::<S>::unpack(from)?))
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        for (k, column) in COLUMNS.iter().enumerate() {
            let values = values.clone().map(|rotation| numbers(&rotation)[k]);
            to.real(joined(name, column), values);
        }
    }
    fn first_column(name: &str) -> String {
        joined(name, COLUMNS[0])
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        let mut columns = [&[][..]; NUMBERS];
        for (values, column) in columns.iter_mut().zip(COLUMNS) {
            *values = from.get_real(&joined(name, column))?;
        }
        let row = |row: usize| from_numbers(columns.map(|values| values[row]));
        Ok((0..from.rows()).map(row).collect())
    }
}

/// Returns a spin or moment as a vector in space.
#[inline(always)]
pub(super) fn in_space<C: Components>(spin: &C) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k < C::COUNT { spin.get(k) } else { 0.0 })
}

/// Converts a vector in space into a vector with fewer or equally many components; missing components are dropped.
#[inline(always)]
pub(super) fn out_of_space<C: Components>(vector: &Vector3<f64>) -> C {
    let mut spin = C::default();
    for k in 0..C::COUNT {
        spin.set(k, vector[k]);
    }
    spin
}

impl Body {
    /// Returns a free block of uniform density [kg/m³]. `inertia` is the mean of the three principal moments, for
    /// callers that need a single value; the engine uses all three.
    #[must_use]
    pub fn of_block(id: u64, shape: &Polyhedron, density: f64, material: u32) -> Self {
        Self {
            id,
            radius: shape.radius(),
            mass: density * shape.volume(),
            inertia: shape.inertia(density).mean(),
            material,
            kind: Kind::Free,
        }
    }
}

impl<S: Space> Particles<S> {
    /// Sets the table of shapes of the scene, which must be the same on every rank; entries store their index in
    /// it. Call it before [`Self::add_block`], and after [`Self::from_table`] if the rows contain blocks.
    ///
    /// # Errors
    /// If the space is two-dimensional.
    pub fn set_shapes(&mut self, shapes: Arc<[Polyhedron]>) -> Result<(), Error> {
        if S::DIMENSION != 3 {
            return Err(Error::Numerical("blocks require three dimensions".into()));
        }
        self.shapes = shapes;
        if !self.has_blocks() {
            let entries = self.body.len();
            self.shape.allocate(std::iter::repeat_n(SPHERE, entries));
            let rotations = std::iter::repeat_n(RotationState::default(), entries);
            self.rotation.allocate(rotations);
        }
        self.listed = false;
        Ok(())
    }

    /// Adds a block with shape number `shape` on this rank, like [`Self::insert`] for a grain. `motion.position` is
    /// its centroid, `motion.spin` its angular velocity in space, and `orientation` rotates the frame of the shape
    /// into space. `body.radius` is set to that of the shape; see [`Body::of_block`] for the other fields.
    ///
    /// # Errors
    /// If the table of shapes has no such number.
    pub fn add_block(
        &mut self,
        mut body: Body,
        motion: Motion<S>,
        shape: u32,
        orientation: UnitQuaternion<f64>,
    ) -> Result<(), Error> {
        let Some(solid) = self.shapes.get(shape as usize) else {
            let count = self.shapes.len();
            return Err(Error::Internal(format!(
                "block {} has the shape number {shape}, but the table has {count} shapes",
                body.id
            )));
        };
        body.radius = solid.radius();
        let inertia = body.moments(solid);
        let rotation = RotationState::new(orientation, &in_space(&motion.spin), &inertia);
        self.insert(body, motion);
        let last = self.owned - 1;
        self.shape[last] = shape;
        self.rotation[last] = rotation;
        Ok(())
    }

    /// Returns shape and rotational state of entry `k`; none for a sphere or disc.
    #[must_use]
    #[inline]
    pub fn polyhedron(&self, k: usize) -> Option<(&Polyhedron, &RotationState)> {
        shape_of(&self.shapes, &self.shape, &self.rotation, k)
    }

    /// Returns the motion of entry `k` and the load of its contacts, force \[N\] and torque \[N m\]; none for a
    /// sphere or disc.
    #[must_use]
    pub fn block_motion(&self, k: usize) -> Option<(BlockMotion, [Vector3<f64>; 2])> {
        let (_, rotation) = self.polyhedron(k)?;
        let (motion, contact) = (&self.motion[k], &self.contact[k]);
        let motion = BlockMotion {
            position: S::to_volume(&motion.position),
            velocity: S::to_volume(&motion.velocity),
            rotation: *rotation,
        };
        Some((
            motion,
            [S::to_volume(&contact.force), in_space(&contact.torque)],
        ))
    }

    /// Returns the load of the fluid on entry `k`, force \[N\] and torque \[N m\]; none for a sphere or disc.
    #[must_use]
    pub fn block_fluid_load(&self, k: usize) -> Option<[Vector3<f64>; 2]> {
        self.polyhedron(k)?;
        let load = self.fluid_load(k);
        Some([S::to_volume(&load.force), in_space(&load.torque)])
    }

    /// Sets the motion of entry `k`, a block. Returns the longest path of a point of it \[m\]; 0 for a sphere.
    pub fn set_block_motion(&mut self, k: usize, to: &BlockMotion) -> f64 {
        let Some((shape, before)) = self.polyhedron(k) else {
            return 0.0;
        };
        let turned = (to.rotation.orientation.coords - before.orientation.coords).norm();
        let body = &self.body[k];
        let spin = to.rotation.spin(&body.moments(shape));
        let way = to.position - S::to_volume(&self.motion[k].position);
        let path = way.norm() + 2.0 * body.radius * turned;
        self.motion[k] = Motion {
            position: S::from_volume(&to.position),
            velocity: S::from_volume(&to.velocity),
            spin: out_of_space(&spin),
        };
        self.rotation[k] = to.rotation;
        path
    }

    /// Returns position, velocities and rotation of the owned entries.
    pub(super) fn owned_motion(&self) -> (Vec<Motion<S>>, Vec<RotationState>) {
        let rotation = self.rotation.get(..self.owned).unwrap_or_default();
        (self.motion[..self.owned].to_vec(), rotation.to_vec())
    }

    /// Sets position, velocities and rotation of the owned entries.
    pub(super) fn set_owned_motion(&mut self, to: &(Vec<Motion<S>>, Vec<RotationState>)) {
        self.motion[..to.0.len()].copy_from_slice(&to.0);
        if !to.1.is_empty() {
            self.rotation[..to.1.len()].copy_from_slice(&to.1);
        }
    }

    /// Returns `true` if any entry may be a polyhedron.
    #[must_use]
    pub fn has_blocks(&self) -> bool {
        self.shape.is_allocated()
    }

    /// Returns the volume of entry `k` [m³; m² per m of depth in two dimensions].
    #[must_use]
    pub fn volume(&self, k: usize) -> f64 {
        self.view().volume(k)
    }

    /// Returns an error that names the first owned entry whose shape is not in the table.
    pub(super) fn check_shapes(&self) -> Result<(), Error> {
        let count = self.shapes.len();
        let unknown = |shape: u32| shape != SPHERE && shape as usize >= count;
        let mut entries = self.body[..self.owned].iter().zip(self.shape.iter());
        match entries.find(|(_, shape)| unknown(**shape)) {
            None => Ok(()),
            Some((body, shape)) => Err(Error::Internal(format!(
                "block {} has the shape number {shape}, but the table has {count} shapes",
                body.id
            ))),
        }
    }

    /// Sets the angular momentum of entry `k` from its spin.
    pub(super) fn update_angular_momentum(&mut self, k: usize) {
        let Some((shape, rotation)) = self.polyhedron(k) else {
            return;
        };
        let inertia = self.body[k].moments(shape);
        let spin = in_space(&self.motion[k].spin);
        self.rotation[k] = RotationState::new(rotation.orientation, &spin, &inertia);
    }
}

impl<'a, S: Space> ParticlesView<'a, S> {
    /// Returns the polyhedron of an entry: see [`Particles::polyhedron`].
    #[must_use]
    #[inline]
    pub fn polyhedron(&self, k: usize) -> Option<(&'a Polyhedron, &'a RotationState)> {
        shape_of(self.shapes, self.shape, self.rotation, k)
    }

    /// Returns the volume of an entry: see [`Particles::volume`].
    #[must_use]
    #[inline]
    pub fn volume(&self, k: usize) -> f64 {
        self.polyhedron(k).map_or_else(
            || S::measure(self.body[k].radius),
            |(shape, _)| shape.volume(),
        )
    }
}

#[inline]
fn shape_of<'a>(
    shapes: &'a [Polyhedron],
    shape: &[u32],
    rotation: &'a [RotationState],
    k: usize,
) -> Option<(&'a Polyhedron, &'a RotationState)> {
    let solid = shapes.get(*shape.get(k)? as usize)?;
    Some((solid, &rotation[k]))
}
