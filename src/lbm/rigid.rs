//! Rigid-body motion in lattice units, from which the fluid takes the velocity of a body's surface.
//!
//! It is separate from the moving links ([`crate::links`]), because covered cells on GPUs use it without them.

/// Motion and radius of a body in lattice units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Rigid {
    /// Position of the centre \[cells\].
    pub position: [f64; 3],
    /// Velocity of the centre \[cells per step\].
    pub velocity: [f64; 3],
    /// Angular velocity \[radians per step\].
    pub spin: [f64; 3],
    /// Radius \[cells\].
    pub radius: f64,
}

/// Returns the velocity u + ω × r of the body at the point with offset `r` \[cells\] from its centre.
#[inline(always)]
pub(crate) fn surface_velocity<const D: usize>(motion: &Rigid, r: [f64; 3]) -> [f64; 3] {
    let (u, w) = (motion.velocity, motion.spin);
    if D == 2 {
        [u[0] - w[2] * r[1], u[1] + w[2] * r[0], 0.0]
    } else {
        [
            u[0] + (w[1] * r[2] - w[2] * r[1]),
            u[1] + (w[2] * r[0] - w[0] * r[2]),
            u[2] + (w[0] * r[1] - w[1] * r[0]),
        ]
    }
}
