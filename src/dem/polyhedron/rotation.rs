//! Rotation of a rigid body: orientation as a unit quaternion, angular momentum in the axes of space.
//!
//! ```text
//! dL/dt = M - alpha L,     w = R I^-1 R^T L,     dq/dt = q (0, w_body) / 2
//! ```
//!
//! The full inertia tensor `I` replaces the scalar of the published equation, which holds for spheres and cubes only.
//!
//! One step is kick - drift - kick, as for the centre. The kick changes L. The drift rotates the body freely with L
//! fixed in space, by five rotations about its principal axes (1 2 3 2 1, half steps for the first and last two).
//! Each rotation is exact: a torque-free body keeps L to the last bit and |q| to rounding. The scheme is
//! symplectic, reversible and of second order: the energy oscillates by O(dt²) and does not drift.
//!
//! Sources: R. I. McLachlan, Phys. Rev. Lett. 71 (1993) 3043; A. Dullweber, B. Leimkuhler, R. McLachlan, J. Chem. Phys.
//! 107 (1997) 5840; T. F. Miller et al., J. Chem. Phys. 116 (2002) 8649 (NO_SQUISH). Papers on scour by blocks name the
//! integrator of S. M. Johnson, J. R. Williams, B. K. Cook (2008); tests compare order, energy and angular momentum
//! with its properties.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Rotational state of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationState {
    /// Rotation from the body frame into space.
    pub orientation: UnitQuaternion<f64>,
    /// Angular momentum about the centroid [kg m²/s], in the axes of space.
    pub angular_momentum: Vector3<f64>,
}

impl Default for RotationState {
    fn default() -> Self {
        Self {
            orientation: UnitQuaternion::identity(),
            angular_momentum: Vector3::zeros(),
        }
    }
}

/// Mass-proportional damping of a velocity or an angular momentum over the half step of a kick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    decay: f64,
    gain: f64,
}

impl Damping {
    /// Returns damping at the rate alpha [1/s], zero for none, over `time` \[s\]; exact for a constant force.
    #[must_use]
    pub fn new(rate: f64, time: f64) -> Self {
        let decay = (-rate * time).exp();
        let gain = if rate * time > 0.0 {
            -(-rate * time).exp_m1() / rate
        } else {
            time
        };
        Self { decay, gain }
    }

    /// Returns the velocity or momentum after a kick by an acceleration or force.
    #[inline(always)]
    #[must_use]
    pub fn kick(&self, value: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
        value * self.decay + rate * self.gain
    }
}

impl RotationState {
    /// Returns the state of a body with these principal moments [kg m²] that rotates with `spin` [rad/s], in the
    /// axes of space.
    #[must_use]
    pub fn new(
        orientation: UnitQuaternion<f64>,
        spin: &Vector3<f64>,
        inertia: &Vector3<f64>,
    ) -> Self {
        let body = orientation.inverse() * spin;
        Self {
            orientation,
            angular_momentum: orientation * body.component_mul(inertia),
        }
    }

    /// Returns the angular velocity [rad/s] in the axes of space.
    #[inline]
    #[must_use]
    pub fn spin(&self, inertia: &Vector3<f64>) -> Vector3<f64> {
        let body = self.orientation.inverse() * self.angular_momentum;
        self.orientation * body.component_div(inertia)
    }

    /// Returns the energy of rotation \[J\].
    #[must_use]
    pub fn energy(&self, inertia: &Vector3<f64>) -> f64 {
        let body = self.orientation.inverse() * self.angular_momentum;
        0.5 * body.dot(&body.component_div(inertia))
    }

    /// Returns the rotation matrix from the body frame into space.
    #[inline]
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        self.orientation.to_rotation_matrix().into_inner()
    }

    /// Changes the angular momentum by a moment [N m] in the axes of space.
    #[inline]
    pub fn kick(&mut self, moment: &Vector3<f64>, damping: &Damping) {
        self.angular_momentum = damping.kick(&self.angular_momentum, moment);
    }

    /// Rotates freely for `time` \[s\].
    pub fn drift(&mut self, inertia: &Vector3<f64>, time: f64) {
        let mut momentum = self.orientation.inverse() * self.angular_momentum;
        let mut q = *self.orientation.quaternion();
        let half = 0.5 * time;
        for (axis, part) in [(0, half), (1, half), (2, time), (1, half), (0, half)] {
            let angle = part * momentum[axis] / inertia[axis];
            turn(&mut q, &mut momentum, axis, angle);
        }
        self.orientation = UnitQuaternion::new_normalize(q);
    }
}

/// Rotates the body about one of its axes: updates q, and the momentum in the rotated body frame.
#[inline(always)]
fn turn(q: &mut Quaternion<f64>, momentum: &mut Vector3<f64>, axis: usize, angle: f64) {
    let (sin, cos) = (0.5 * angle).sin_cos();
    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
    let v = q.coords;
    // Product of (v, w) and (sin e, cos), vector part first.
    q.coords[axis] = v[axis] * cos + v[3] * sin;
    q.coords[3] = v[3] * cos - v[axis] * sin;
    q.coords[j] = v[j] * cos + v[k] * sin;
    q.coords[k] = v[k] * cos - v[j] * sin;
    // Sine and cosine of the double angle from the same two numbers.
    let (s, c) = (2.0 * sin * cos, (cos - sin) * (cos + sin));
    let (mj, mk) = (momentum[j], momentum[k]);
    momentum[j] = c * mj + s * mk;
    momentum[k] = c * mk - s * mj;
}
