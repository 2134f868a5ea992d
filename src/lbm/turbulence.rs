//! Eddy viscosity: the viscosity ν_t of eddies smaller than a cell, computed from the velocity gradient and added to
//! that of the fluid. One file per model.
//!
//! Each cell collides with its own rate ω = 1/τ, τ = 3 (ν + ν_t) + ½. The gradient is that of the velocity with
//! which the cells collided **one step before**, by second-order central differences. The pass writes the velocity
//! of each cell in addition to the populations and reads the field of the previous step ([`field`]), so that the
//! field costs 36 bytes per cell and step and no separate pass. The delay of one step is far below the time scale
//! of resolved eddies.

pub mod field;

use super::lanes::Lanes;
use base::error::Finding;
use base::family::{Description, describe_choices, family};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

family! {
    /// Eddy viscosity.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(rename = "Turbulence", transform = describe_choices)]
    pub enum EddyViscosity {
        wale: Wale(Wale),
        smagorinsky: Smagorinsky(Smagorinsky),
    }
}

impl EddyViscosity {
    /// Returns the description of the model for `plan`.
    #[must_use]
    pub fn describe(&self) -> Description {
        each!(self, model => model.describe())
    }

    /// Returns a finding if the model is invalid in a domain of `dimension` axes. `path` is the JSON path of the
    /// model in the case.
    #[must_use]
    pub fn check(&self, path: &str, dimension: usize) -> Option<Finding> {
        each!(self, model => model.check(path, dimension))
    }

    /// Returns the eddy viscosity ν_t of a cell in lattice units.
    #[must_use]
    pub fn viscosity(&self, gradient: &[[f64; 3]; 3]) -> f64 {
        each!(self, model => model.viscosity(gradient))
    }

    #[inline(always)]
    fn fraction<N: Lanes>(&self, gradient: &[[N; 3]; 3]) -> (N, N) {
        each!(self, model => model.fraction(gradient))
    }
}

/// Model of an eddy viscosity with its parameters in a case.
pub trait TurbulenceModel {
    /// Returns the description of the model for `plan`.
    fn describe(&self) -> Description;

    /// Returns a finding if the model is invalid in a domain of `dimension` axes. `path` is the JSON path of the
    /// model in the case.
    fn check(&self, path: &str, dimension: usize) -> Option<Finding> {
        let _ = (path, dimension);
        None
    }

    /// Returns the numerator and the denominator, which is never zero, of ν_t in lattice units for cells with the
    /// velocity gradient g_ab = ∂u_a/∂x_b.
    fn fraction<N: Lanes>(&self, gradient: &[[N; 3]; 3]) -> (N, N);

    /// Returns the eddy viscosity ν_t in lattice units.
    fn viscosity<N: Lanes>(&self, gradient: &[[N; 3]; 3]) -> N {
        let (numerator, denominator) = self.fraction(gradient);
        numerator / denominator
    }
}

/// Reason for the choice of a model in `plan`.
const REASON: &str = "requested; computed from the velocity gradient of the previous step";

/// Eddy viscosity of a pass.
pub trait Eddies: Copy + Send + Sync + 'static {
    /// `true` if cells have different relaxation rates.
    const ACTIVE: bool;
    /// Returns `true` if there is a model, for types that do not determine it.
    fn present(&self) -> bool {
        Self::ACTIVE
    }
    /// Returns the fraction of the model: see [`TurbulenceModel::fraction`].
    fn fraction<N: Lanes>(&self, gradient: &[[N; 3]; 3]) -> (N, N);

    /// Returns the relaxation rate ω = 1 / (3 (ν + ν_t) + ½), with one division, on which the pass waits.
    #[inline(always)]
    fn rate<N: Lanes>(&self, viscosity: f64, gradient: &[[N; 3]; 3]) -> N {
        let (numerator, denominator) = self.fraction(gradient);
        let own = denominator * N::splat(3.0 * viscosity + 0.5);
        denominator / numerator.mul_add(N::splat(3.0), own)
    }
}

/// Flow without an eddy-viscosity model.
#[derive(Clone, Copy, Debug)]
pub struct Resolved;

impl Eddies for Resolved {
    const ACTIVE: bool = false;

    #[inline(always)]
    fn fraction<N: Lanes>(&self, _: &[[N; 3]; 3]) -> (N, N) {
        (N::splat(0.0), N::splat(1.0))
    }
}

/// One of the models, or none. The pass selects the model for each vector of cells by a branch that is always
/// predicted, so that it need not be compiled for each model.
impl Eddies for Option<EddyViscosity> {
    const ACTIVE: bool = true;

    #[inline(always)]
    fn present(&self) -> bool {
        self.is_some()
    }

    #[inline(always)]
    fn fraction<N: Lanes>(&self, gradient: &[[N; 3]; 3]) -> (N, N) {
        match self {
            None => Resolved.fraction(gradient),
            Some(model) => model.fraction(gradient),
        }
    }
}

/// Returns S:S of the rate of strain S = (g + gᵀ)/2.
#[inline(always)]
fn strain_squared<N: Lanes>(g: &[[N; 3]; 3]) -> N {
    let half = N::splat(0.5);
    let xy = (g[0][1] + g[1][0]) * half;
    let yz = (g[1][2] + g[2][1]) * half;
    let zx = (g[2][0] + g[0][2]) * half;
    let shear = xy.mul_add(xy, yz.mul_add(yz, zx * zx));
    let stretch = g[0][0].mul_add(g[0][0], g[1][1].mul_add(g[1][1], g[2][2] * g[2][2]));
    shear.mul_add(N::splat(2.0), stretch)
}

#[cfg(test)]
mod tests;
