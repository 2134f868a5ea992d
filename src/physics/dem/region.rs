//! The box of the grains and the planes by which ranks share it.

use super::space::{Components, Space};

/// The box the grains live in, and the planes of the split axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region<S: Space> {
    /// Lower corner \[m\].
    pub lower: S::Vector,
    /// Upper corner \[m\].
    pub upper: S::Vector,
    /// Which axes are periodic.
    pub periodic: [bool; 3],
    /// Thickness of one plane of the split axis \[m\], counted from the lower corner.
    pub spacing: f64,
}

impl<S: Space> Region<S> {
    /// A box without periodic axes, split in planes of `spacing` \[m\].
    #[must_use]
    pub fn closed(lower: S::Vector, upper: S::Vector, spacing: f64) -> Self {
        Self {
            lower,
            upper,
            periodic: [false; 3],
            spacing,
        }
    }

    pub(super) fn length(&self, axis: usize) -> f64 {
        self.upper.get(axis) - self.lower.get(axis)
    }

    /// Length along periodic axes, else 0.
    pub(super) fn periodic_lengths(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION && self.periodic[axis] {
                self.length(axis)
            } else {
                0.0
            }
        })
    }

    /// The lower corner, 0 along axes that are not there.
    pub(super) fn origin(&self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION {
                self.lower.get(axis)
            } else {
                0.0
            }
        })
    }

    pub(super) fn any_periodic(&self) -> bool {
        self.periodic[..S::DIMENSION].contains(&true)
    }
}

/// The plane that contains a coordinate, clamped to `0..planes`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at least 0; a cast of a float saturates"
)]
pub(super) fn plane_of(coordinate: f64, origin: f64, spacing: f64, planes: usize) -> usize {
    (((coordinate - origin) / spacing).floor().max(0.0) as usize).min(planes.saturating_sub(1))
}

/// How many box lengths to add to bring a raw `coordinate` into `[lower, lower + length)`: nothing else decides.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a grain beyond 2^31 box lengths is caught as lost"
)]
pub(super) fn wraps(coordinate: f64, lower: f64, length: f64) -> i32 {
    -(((coordinate - lower) / length).floor() as i32)
}

#[expect(
    clippy::cast_precision_loss,
    reason = "plane counts are far below 2^53"
)]
pub(super) fn edge(plane: usize, lower: f64, spacing: f64) -> f64 {
    lower + plane as f64 * spacing
}
