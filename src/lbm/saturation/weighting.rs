//! Weighting of the solid collision of a cell as a function of its solid fraction.
//!
//! It is separate from the solid collision operators, because a case combines it with each of them.

use crate::lanes::Lanes;
#[cfg(not(target_arch = "nvptx64"))]
use schemars::JsonSchema;
#[cfg(not(target_arch = "nvptx64"))]
use serde::{Deserialize, Serialize};

/// Weighting B of the solid fraction ε.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    not(target_arch = "nvptx64"),
    derive(Serialize, Deserialize, JsonSchema),
    serde(rename_all = "snake_case"),
    schemars(inline)
)]
#[repr(u32)]
pub enum Weighting {
    /// B = ε.
    Fraction,
    /// B = ε (τ - 1/2) / ((1 - ε) + (τ - 1/2)): the effective surface depends less on the viscosity (Noble and
    /// Torczynski 1998).
    #[default]
    Viscous,
}

impl Weighting {
    /// Returns the name of the weighting in the output of `plan`.
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            Self::Fraction => "weighted by the solid fraction",
            Self::Viscous => "weighted by fraction and viscosity",
        }
    }

    /// Returns B of cells with solid fractions `fraction`; `time` is τ - ½ of the fluid.
    #[inline(always)]
    pub(super) fn weight<N: Lanes>(self, time: f64, fraction: N) -> N {
        match self {
            Self::Fraction => fraction,
            Self::Viscous => {
                let time = N::splat(time);
                fraction * time / ((N::splat(1.0) - fraction) + time)
            }
        }
    }
}
