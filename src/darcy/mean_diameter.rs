//! Mean diameter of the grains in a cell.
//!
//! ```text
//! number:  d = sum d / N          mass:  d = sum d^4 / sum d^3          Sauter:  d = sum d^3 / sum d^2
//! ```
//!
//! The three means differ considerably in a wide grading. The Sauter mean preserves the surface per volume, on which
//! the derivation of the permeability is based.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kind of mean of the diameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum MeanDiameter {
    /// Sauter mean: sum of cubes over sum of squares.
    #[default]
    Sauter,
    /// Arithmetic mean of the diameters.
    Number,
    /// Mean weighted with the mass.
    Mass,
}

impl MeanDiameter {
    /// Returns the exponent k of the mean sum w d^(k+1) / sum w d^k.
    #[must_use]
    pub fn power(self) -> i32 {
        match self {
            Self::Sauter => 2,
            Self::Number => 0,
            Self::Mass => 3,
        }
    }
}
