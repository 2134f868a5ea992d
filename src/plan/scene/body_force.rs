//! The force per volume on the fluid.

use super::aligned_box::AlignedBox;
use super::findings::{Findings, LATTICE_PATH as PATH};
use super::grid::Grid;
use case::fluid::{self, LatticeBoltzmann};
use serde::Serialize;

/// Force per volume [N/m3].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum BodyForce {
    /// Constant force; may be zero.
    Constant([f64; 3]),
    /// Oscillating force: amplitude cos(2 pi t/period + phase).
    Oscillating {
        /// Largest force [N/m3].
        amplitude: [f64; 3],
        /// Period \[s\].
        period: f64,
        /// Phase at the start \[rad\].
        phase: f64,
    },
}

impl BodyForce {
    /// Returns the largest force at any time.
    #[must_use]
    pub fn largest(&self) -> [f64; 3] {
        match self {
            Self::Constant(force) => *force,
            Self::Oscillating { amplitude, .. } => *amplitude,
        }
    }
}

pub(super) fn body_force(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    findings: &mut Findings,
) -> BodyForce {
    let path = format!("{PATH}.body_force");
    match &lbm.body_force {
        None => BodyForce::Constant([0.0; 3]),
        Some(fluid::BodyForce::Constant(force)) => BodyForce::Constant(AlignedBox::vector(
            grid,
            force,
            &format!("{path}.constant"),
            findings,
        )),
        Some(fluid::BodyForce::Oscillating {
            amplitude,
            period,
            phase_degrees,
        }) => BodyForce::Oscillating {
            amplitude: AlignedBox::vector(
                grid,
                amplitude,
                &format!("{path}.oscillating.amplitude"),
                findings,
            ),
            period: *period,
            phase: phase_degrees.to_radians(),
        },
    }
}
