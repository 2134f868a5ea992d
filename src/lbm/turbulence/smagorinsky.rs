//! Smagorinsky (J. Smagorinsky, Mon. Weather Rev. 91 (1963) 99): ν_t = (C_s Δ)² √(2 S:S), S the rate of strain and
//! Δ one cell.
//!
//! It does not vanish in laminar shear or at walls, unlike WALE ([`super::wale`]).

use super::{REASON, TurbulenceModel, strain_squared};
use crate::lanes::Lanes;
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Eddy viscosity of Smagorinsky (1963).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Smagorinsky {
    /// Model constant C_s \[1\]: from 0.1 in channels to 0.18 in free turbulence.
    #[serde(default = "constant")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub constant: f64,
}

fn constant() -> f64 {
    0.17
}

impl TurbulenceModel for Smagorinsky {
    fn describe(&self) -> Description {
        Description::new(format!("Smagorinsky, constant {}", self.constant), REASON)
    }

    #[inline(always)]
    fn fraction<N: Lanes>(&self, g: &[[N; 3]; 3]) -> (N, N) {
        let root = (strain_squared(g) * N::splat(2.0)).sqrt();
        (
            root * N::splat(self.constant * self.constant),
            N::splat(1.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_pure_shear_it_is_the_rate_of_shear() {
        let mut g = [[0.0; 3]; 3];
        g[0][1] = 0.02;
        let nu = Smagorinsky { constant: 0.17 }.viscosity(&g);
        approx::assert_relative_eq!(nu, 0.17 * 0.17 * 0.02, max_relative = 1e-14);
    }
}
