//! File of an eddy viscosity that exists in this test only.

use crate::lanes::Lanes;
use crate::turbulence::TurbulenceModel;
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Toy eddy viscosity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Toy {
    /// ν_t over ∂u/∂y, in cells squared.
    pub factor: f64,
}

impl TurbulenceModel for Toy {
    fn describe(&self) -> Description {
        Description::new(format!("toy, factor {}", self.factor), "for tests")
    }

    fn fraction<N: Lanes>(&self, gradient: &[[N; 3]; 3]) -> (N, N) {
        (gradient[0][1] * N::splat(self.factor), N::splat(1.0))
    }
}
