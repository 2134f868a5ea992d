//! Two and three dimensions behind one trait: discs and spheres share the code of the engine.
//!
//! In two dimensions spins, moments and shear histories are scalars. In three dimensions they are vectors, and a
//! shear history rotates with the contact. The unit normal `n` of a contact points from the first body to the
//! second. The tangent in two dimensions is `t = (-n_y, n_x)`, so that `w x n = w t`.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use nalgebra::{SVector, Vector3};

/// Vector with a small fixed number of components.
pub trait Components:
    Copy
    + Debug
    + Default
    + PartialEq
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + AddAssign
    + Mul<f64, Output = Self>
    + Neg<Output = Self>
    + Sub<Output = Self>
    + SubAssign
{
    /// Number of components.
    const COUNT: usize;
    /// Returns component `k`, below [`Self::COUNT`].
    fn get(&self, k: usize) -> f64;
    /// Sets component `k`, below [`Self::COUNT`].
    fn set(&mut self, k: usize, value: f64);
    /// Returns the scalar product.
    fn scalar(&self, other: &Self) -> f64;
    /// Returns the vector whose components are `f` of the components of `self` and `other`.
    #[must_use]
    fn combine(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self;
    /// Returns the Euclidean length.
    fn length(&self) -> f64 {
        self.scalar(self).sqrt()
    }
}

impl Components for f64 {
    const COUNT: usize = 1;
    #[inline(always)]
    fn get(&self, _: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn set(&mut self, _: usize, value: f64) {
        *self = value;
    }
    #[inline(always)]
    fn scalar(&self, other: &Self) -> f64 {
        self * other
    }
    #[inline(always)]
    fn combine(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        f(*self, *other)
    }
    #[inline(always)]
    fn length(&self) -> f64 {
        self.abs()
    }
}

macro_rules! components {
    ($count:literal, $($k:literal),*) => {
        impl Components for SVector<f64, $count> {
            const COUNT: usize = $count;
            #[inline(always)]
            fn get(&self, k: usize) -> f64 {
                self[k]
            }
            #[inline(always)]
            fn set(&mut self, k: usize, value: f64) {
                self[k] = value;
            }
            #[inline(always)]
            fn scalar(&self, other: &Self) -> f64 {
                0.0 $(+ self[$k] * other[$k])*
            }
            #[inline(always)]
            fn combine(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
                Self::new($(f(self[$k], other[$k])),*)
            }
        }
    };
}
components!(2, 0, 1);
components!(3, 0, 1, 2);

/// Number of dimensions as a type: [`PlaneSpace`] or [`Volume`].
pub trait Space: Copy + Debug + Default + PartialEq + Send + Sync + 'static {
    /// Number of dimensions: 2 or 3.
    const DIMENSION: usize;
    /// Type of positions, velocities and forces.
    type Vector: Components;
    /// Type of angular velocities and moments.
    type Spin: Components;
    /// Type of shear displacements, shear forces and sliding velocities.
    type Tangent: Components;

    /// Returns the area of a disc or the volume of a sphere.
    fn measure(radius: f64) -> f64;
    /// Returns the moment of inertia about the centre: m r² / 2 of a disc, 2 m r² / 5 of a sphere.
    fn inertia(mass: f64, radius: f64) -> f64;
    /// Returns the mass of a grain; in the plane per unit depth.
    fn mass(density: f64, radius: f64) -> f64 {
        density * Self::measure(radius)
    }
    /// Returns the sliding velocity at a contact: the tangential part of `velocity - rolling x normal`, where
    /// `velocity` is that of the second centre relative to the first and `rolling` the sum of both spins times
    /// their lever arms.
    fn slip(normal: &Self::Vector, velocity: &Self::Vector, rolling: &Self::Spin) -> Self::Tangent;
    /// Returns a tangential history transported with the contact frame: rotated into the plane normal to the new
    /// normal, with its length preserved.
    fn turn(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Tangent;
    /// Returns a tangential vector as a vector in space.
    fn embed(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Vector;
    /// Returns the moment `normal x tangent`.
    fn tangent_moment(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Spin;
    /// Returns the part of a spin normal to the contact normal: rolling without twisting.
    fn rolling(spin: &Self::Spin, normal: &Self::Vector) -> Self::Spin;
    /// Returns a rolling moment transported with the contact frame, like [`Self::turn`].
    fn turn_moment(moment: &Self::Spin, normal: &Self::Vector) -> Self::Spin;
    /// Returns the vector in three dimensions: the plane is z = 0.
    fn to_volume(vector: &Self::Vector) -> Vector3<f64>;
    /// Converts a vector from three dimensions; the plane drops z.
    fn from_volume(vector: &Vector3<f64>) -> Self::Vector;
}

/// Two-dimensional space: discs of unit depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlaneSpace;

/// Three-dimensional space: spheres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Volume;

impl Space for PlaneSpace {
    const DIMENSION: usize = 2;
    type Vector = SVector<f64, 2>;
    type Spin = f64;
    type Tangent = f64;

    fn measure(radius: f64) -> f64 {
        std::f64::consts::PI * radius * radius
    }
    fn inertia(mass: f64, radius: f64) -> f64 {
        0.5 * mass * radius * radius
    }
    #[inline(always)]
    fn slip(normal: &Self::Vector, velocity: &Self::Vector, rolling: &f64) -> f64 {
        velocity[1] * normal[0] - velocity[0] * normal[1] - rolling
    }
    #[inline(always)]
    fn turn(tangent: &f64, _: &Self::Vector) -> f64 {
        *tangent
    }
    #[inline(always)]
    fn embed(tangent: &f64, normal: &Self::Vector) -> Self::Vector {
        SVector::<f64, 2>::new(-tangent * normal[1], tangent * normal[0])
    }
    #[inline(always)]
    fn tangent_moment(tangent: &f64, _: &Self::Vector) -> f64 {
        *tangent
    }
    #[inline(always)]
    fn rolling(spin: &f64, _: &Self::Vector) -> f64 {
        *spin
    }
    #[inline(always)]
    fn turn_moment(moment: &f64, _: &Self::Vector) -> f64 {
        *moment
    }
    #[inline(always)]
    fn to_volume(vector: &Self::Vector) -> Vector3<f64> {
        Vector3::new(vector[0], vector[1], 0.0)
    }
    #[inline(always)]
    fn from_volume(vector: &Vector3<f64>) -> Self::Vector {
        SVector::<f64, 2>::new(vector[0], vector[1])
    }
}

impl Space for Volume {
    const DIMENSION: usize = 3;
    type Vector = Vector3<f64>;
    type Spin = Vector3<f64>;
    type Tangent = Vector3<f64>;

    fn measure(radius: f64) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius
    }
    fn inertia(mass: f64, radius: f64) -> f64 {
        0.4 * mass * radius * radius
    }
    #[inline(always)]
    fn slip(normal: &Self::Vector, velocity: &Self::Vector, rolling: &Self::Spin) -> Self::Tangent {
        velocity - normal * normal.scalar(velocity) - rolling.cross(normal)
    }
    #[inline(always)]
    fn turn(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Tangent {
        let flat = tangent - normal * normal.scalar(tangent);
        let squared = flat.scalar(&flat);
        if squared > 0.0 {
            flat * (tangent.scalar(tangent) / squared).sqrt()
        } else {
            flat
        }
    }
    #[inline(always)]
    fn embed(tangent: &Self::Tangent, _: &Self::Vector) -> Self::Vector {
        *tangent
    }
    #[inline(always)]
    fn tangent_moment(tangent: &Self::Tangent, normal: &Self::Vector) -> Self::Spin {
        normal.cross(tangent)
    }
    #[inline(always)]
    fn rolling(spin: &Self::Spin, normal: &Self::Vector) -> Self::Spin {
        spin - normal * normal.scalar(spin)
    }
    #[inline(always)]
    fn turn_moment(moment: &Self::Spin, normal: &Self::Vector) -> Self::Spin {
        Self::turn(moment, normal)
    }
    #[inline(always)]
    fn to_volume(vector: &Self::Vector) -> Vector3<f64> {
        *vector
    }
    #[inline(always)]
    fn from_volume(vector: &Vector3<f64>) -> Self::Vector {
        *vector
    }
}

/// Returns a vector of the space from three components.
pub fn vector<S: Space>(v: [f64; 3]) -> S::Vector {
    let mut vector = S::Vector::default();
    for (a, &x) in v.iter().enumerate().take(S::DIMENSION) {
        vector.set(a, x);
    }
    vector
}

/// Returns the rotation rate from a vector along the axes: the vector in 3-D, its component along z in 2-D.
#[must_use]
pub fn spin<S: Space>(w: [f64; 3]) -> S::Spin {
    let mut spin = S::Spin::default();
    if S::DIMENSION == 2 {
        spin.set(0, w[2]);
    } else {
        for (a, &x) in w.iter().enumerate() {
            spin.set(a, x);
        }
    }
    spin
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_plane_is_the_volume_seen_from_above() {
        let (x, y) = (0.6, 0.8);
        let (v, w) = (SVector::<f64, 2>::new(0.3, -1.1), 2.5);
        let n = SVector::<f64, 2>::new(x, y);
        let n3 = Vector3::new(x, y, 0.0);
        let slip = PlaneSpace::slip(&n, &v, &w);
        let flat = PlaneSpace::embed(&slip, &n);
        let full = Volume::slip(
            &n3,
            &Vector3::new(v[0], v[1], 0.0),
            &Vector3::new(0.0, 0.0, w),
        );
        assert_relative_eq!(flat[0], full[0], epsilon = 1e-14);
        assert_relative_eq!(flat[1], full[1], epsilon = 1e-14);
        let moment = Volume::tangent_moment(&full, &n3);
        assert_relative_eq!(
            PlaneSpace::tangent_moment(&slip, &n),
            moment[2],
            epsilon = 1e-14
        );
    }

    #[test]
    fn a_turned_history_is_tangent_and_keeps_its_length() {
        let old = Vector3::new(0.0, 3.0, 4.0);
        let normal = Vector3::new(0.8, 0.6, 0.0);
        let new = Volume::turn(&old, &normal);
        assert_relative_eq!(new.scalar(&normal), 0.0, epsilon = 1e-14);
        assert_relative_eq!(new.length(), 5.0, epsilon = 1e-14);
        assert_eq!(
            Volume::turn(&Vector3::default(), &normal),
            Vector3::default()
        );
    }
}
