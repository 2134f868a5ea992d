//! The motion of a body, as the fluid sees it.

/// Motion of a body in lattice units, and its size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Rigid {
    /// Centre in cells.
    pub position: [f64; 3],
    /// Velocity of the centre.
    pub velocity: [f64; 3],
    /// Angular velocity.
    pub spin: [f64; 3],
    /// Radius in cells.
    pub radius: f64,
}

/// Velocity of the surface at an arm `r` from the centre.
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
