//! Blocks among the grains: the shape of each entry and how it stands.
//!
//! A scene without blocks has none of this ([`Particles`] holds an `Option`). The table of shapes is the same on every rank;
//! the number of a shape crosses when a ghost is made, the attitude with the motion in every solid step. `Body::radius` of a block is
//! that of the sphere round its centroid, so that searches and ghosts need to know of spheres alone; `Motion::spin` follows
//! the attitude.

use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::particles::{Body, Kind, Motion, Particles, View};
use super::polyhedron::{Attitude, Polyhedron};
use super::ranks::{Reader, Writer};
use super::space::{Components, Space};
use crate::error::Error;

/// The number of the shape of what is no block.
pub(super) const SPHERE: u32 = u32::MAX;

/// Shapes and attitudes, one entry for each of [`Particles`].
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    pub(super) shapes: Arc<[Polyhedron]>,
    pub(super) shape: Vec<u32>,
    pub(super) attitude: Vec<Attitude>,
}

impl Blocks {
    /// No blocks among `entries` entries.
    pub(super) fn new(shapes: Arc<[Polyhedron]>, entries: usize) -> Self {
        Self {
            shapes,
            shape: vec![SPHERE; entries],
            attitude: vec![Attitude::default(); entries],
        }
    }

    /// The shape of entry `k`; none for a sphere.
    #[inline]
    pub(super) fn of(&self, k: usize) -> Option<&Polyhedron> {
        self.shapes.get(self.shape[k] as usize)
    }

    pub(super) fn push(&mut self, shape: u32, attitude: Attitude) {
        self.shape.push(shape);
        self.attitude.push(attitude);
    }

    pub(super) fn truncate(&mut self, entries: usize) {
        self.shape.truncate(entries);
        self.attitude.truncate(entries);
    }

    pub(super) fn pack(&self, k: usize, to: &mut Writer) {
        to.integer(u64::from(self.shape[k]));
        pack_attitude(&self.attitude[k], to);
    }

    /// Sets the last entry to what [`Self::pack`] wrote.
    pub(super) fn unpack_last(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        let shape = u32::try_from(from.integer()?)
            .map_err(|_| Error::Internal("a shape beyond 32 bits".into()))?;
        let attitude = unpack_attitude(from)?;
        if let (Some(last), Some(stands)) = (self.shape.last_mut(), self.attitude.last_mut()) {
            *last = shape;
            *stands = attitude;
        }
        Ok(())
    }
}

/// Numbers in an attitude.
pub(super) const ATTITUDE: usize = 7;

/// An attitude as numbers: quaternion x, y, z, w, then the angular momentum.
pub(super) fn numbers(attitude: &Attitude) -> [f64; ATTITUDE] {
    let (q, l) = (attitude.orientation.coords, attitude.angular_momentum);
    [q.x, q.y, q.z, q.w, l.x, l.y, l.z]
}

/// Back from [`numbers`], without normalising: the same bits.
pub(super) fn from_numbers(n: [f64; ATTITUDE]) -> Attitude {
    Attitude {
        orientation: UnitQuaternion::new_unchecked(Quaternion::new(n[3], n[0], n[1], n[2])),
        angular_momentum: Vector3::new(n[4], n[5], n[6]),
    }
}

#[inline]
pub(super) fn pack_attitude(attitude: &Attitude, to: &mut Writer) {
    for number in numbers(attitude) {
        to.float(number);
    }
}

#[inline]
pub(super) fn unpack_attitude(from: &mut Reader<'_>) -> Result<Attitude, Error> {
    let mut all = [0.0; ATTITUDE];
    for number in &mut all {
        *number = from.float()?;
    }
    Ok(from_numbers(all))
}

/// A spin or moment in space.
#[inline(always)]
pub(super) fn in_space<C: Components>(spin: &C) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k < C::COUNT { spin.get(k) } else { 0.0 })
}

/// Back from space; what has fewer components takes the first.
#[inline(always)]
pub(super) fn out_of_space<C: Components>(vector: &Vector3<f64>) -> C {
    let mut spin = C::default();
    for k in 0..C::COUNT {
        spin.set(k, vector[k]);
    }
    spin
}

impl Body {
    /// A free block of uniform density (kg/m³). `inertia` is the mean of the three principal moments, for those who want one
    /// number; the engine uses all three.
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
    /// The scene's table of shapes, the same on every rank; entries keep the numbers of theirs. Call it before
    /// [`Self::add_block`], and after [`Self::from_table`] where the rows hold blocks.
    ///
    /// # Errors
    /// In the plane.
    pub fn set_shapes(&mut self, shapes: Arc<[Polyhedron]>) -> Result<(), Error> {
        if S::DIMENSION != 3 {
            return Err(Error::Numerical(
                "blocks in two dimensions: they are solids of three".into(),
            ));
        }
        match &mut self.blocks {
            Some(blocks) => blocks.shapes = shapes,
            none => *none = Some(Blocks::new(shapes, self.body.len())),
        }
        self.stale = true;
        Ok(())
    }

    /// Adds a block of shape number `shape` to this rank, wherever it is, as [`Self::insert`] a grain. `motion.position` is its
    /// centroid, `motion.spin` its angular velocity in space, and `orientation` turns the shape's frame into space. `body.radius` is
    /// set to the shape's; see [`Body::of_block`] for the rest.
    ///
    /// # Errors
    /// Where the table of shapes has no such number.
    pub fn add_block(
        &mut self,
        mut body: Body,
        motion: Motion<S>,
        shape: u32,
        orientation: UnitQuaternion<f64>,
    ) -> Result<(), Error> {
        let table = self.blocks.as_ref().map(|blocks| &blocks.shapes);
        let Some(solid) = table.and_then(|table| table.get(shape as usize)) else {
            let count = table.map_or(0, |table| table.len());
            return Err(Error::Internal(format!(
                "block {} has shape {shape} of a table of {count}",
                body.id
            )));
        };
        body.radius = solid.radius();
        let inertia = moments(&body, solid);
        let attitude = Attitude::new(orientation, &in_space(&motion.spin), &inertia);
        self.insert(body, motion);
        if let Some(blocks) = &mut self.blocks {
            blocks.truncate(self.owned - 1);
            blocks.push(shape, attitude);
        }
        Ok(())
    }

    /// The shape of entry `k` and how it stands; none for a sphere or disc.
    #[must_use]
    #[inline]
    pub fn polyhedron(&self, k: usize) -> Option<(&Polyhedron, &Attitude)> {
        shape_of(self.blocks.as_ref(), k)
    }

    /// Whether any entry may be a polyhedron.
    #[must_use]
    pub fn has_blocks(&self) -> bool {
        self.blocks.is_some()
    }

    /// Volume of entry `k` (m³; in the plane m² per m of depth).
    #[must_use]
    pub fn volume(&self, k: usize) -> f64 {
        self.polyhedron(k).map_or_else(
            || S::measure(self.body[k].radius),
            |(shape, _)| shape.volume(),
        )
    }

    /// An error that names the first owned entry whose shape is not in the table.
    pub(super) fn check_shapes(&self) -> Result<(), Error> {
        let Some(blocks) = &self.blocks else {
            return Ok(());
        };
        let count = blocks.shapes.len();
        match (0..self.owned)
            .find(|&k| blocks.shape[k] != SPHERE && blocks.shape[k] as usize >= count)
        {
            None => Ok(()),
            Some(k) => Err(Error::Internal(format!(
                "block {} has shape {} of a table of {count}",
                self.body[k].id, blocks.shape[k]
            ))),
        }
    }

    /// Makes the angular momentum of entry `k` that of its spin.
    pub(super) fn follow_spin(&mut self, k: usize) {
        let Some(blocks) = &mut self.blocks else {
            return;
        };
        if let Some(shape) = blocks.shapes.get(blocks.shape[k] as usize) {
            let inertia = moments(&self.body[k], shape);
            let stands = &mut blocks.attitude[k];
            *stands = Attitude::new(
                stands.orientation,
                &in_space(&self.motion[k].spin),
                &inertia,
            );
        }
    }
}

impl<'a, S: Space> View<'a, S> {
    /// As [`Particles::polyhedron`].
    #[must_use]
    #[inline]
    pub fn polyhedron(&self, k: usize) -> Option<(&'a Polyhedron, &'a Attitude)> {
        shape_of(self.blocks, k)
    }
}

#[inline]
fn shape_of(blocks: Option<&Blocks>, k: usize) -> Option<(&Polyhedron, &Attitude)> {
    let blocks = blocks?;
    blocks.of(k).map(|shape| (shape, &blocks.attitude[k]))
}

/// Principal moments (kg m²) of a block of this mass.
#[inline]
pub(super) fn moments(body: &Body, shape: &Polyhedron) -> Vector3<f64> {
    shape.inertia(body.mass / shape.volume())
}
