//! The body force on the fluid.

/// Uniform body force per volume in lattice units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Force {
    /// Zero force, for which a cheaper kernel is used.
    None,
    /// Constant force.
    Constant([f64; 3]),
    /// Oscillating force mean + amplitude · cos(2π step / period + phase).
    Oscillating {
        /// Mean force density.
        mean: [f64; 3],
        /// Amplitude of the force density.
        amplitude: [f64; 3],
        /// Steps per period.
        period: f64,
        /// Phase at step 0, in radians.
        phase: f64,
    },
}

impl Force {
    /// Returns the force at a step.
    #[must_use]
    pub fn force_at(&self, step: f64) -> [f64; 3] {
        match *self {
            Self::None => [0.0; 3],
            Self::Constant(force) => force,
            Self::Oscillating {
                mean,
                amplitude,
                period,
                phase,
            } => {
                let factor = (std::f64::consts::TAU * step / period + phase).cos();
                std::array::from_fn(|a| mean[a] + amplitude[a] * factor)
            }
        }
    }
}
