//! Collision operators, one file each.
//!
//! A file contains the parameters of an operator in a case, its description and its limits. Its kernel follows in
//! the same file, or in a file `kernel` next to it if it also runs on GPUs ([`super::gpu`]). The kernel is written
//! once for scalars, vectors and GPUs. The list of operators generates the enum of the case and the choice of the
//! pass.
//!
//! Populations are stored as deviations g_i = f_i - w_i (exact where the fluid is at rest). With δρ = Σ g and
//! momentum m = Σ c g + F/2 (Z. Guo, C. Zheng, B. Shi, Phys. Rev. E 65 (2002) 046308; F = 0 without a body force) and
//! u = m/ρ, the equilibrium of second order (Y. H. Qian, D. d'Humières, P. Lallemand, Europhys. Lett. 17 (1992) 479)
//! reads
//!
//! g_i^eq = w_i [ δρ + 3 c·m + 9/2 (c·m)(c·u) - 3/2 m·u ].

pub mod border;
pub mod kernel;
pub mod linear_stability;
mod products;
pub mod second_order;

pub(crate) use kernel::along;
pub use kernel::{Collision, Site};

use super::lattice::VelocitySet;
use base::error::Finding;
use base::family::{Description, describe_choices, family};
use border::{Border, MovingBody, Situation};
use linear_stability::Wave;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use trt::AntisymmetricRate;

family! {
    /// Collision operator.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(rename = "Collision", transform = describe_choices)]
    pub enum Operator: dyn CollisionModel {
        bgk: Bgk(BgkParameters),
        trt: Trt(TrtParameters),
        mrt: Mrt(MrtParameters),
        suga: Suga(SugaParameters),
        cumulant: Cumulant(CumulantParameters),
    }
}

impl Operator {
    /// Passes the kernels of the operator to a receiver.
    pub fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        each!(self, operator => operator.dispatch(to))
    }

    /// Passes the kernels of the operator to a receiver if they also compute in f32.
    pub fn dispatch_single<D: Dispatch>(&self, to: D) -> Option<D::Output> {
        each!(self, operator => operator.dispatch_single(to))
    }
}

impl Default for Operator {
    fn default() -> Self {
        Self::Trt(trt::TrtParameters::default())
    }
}

/// Collision operator of a case: its parameters and its interface to the program.
pub trait CollisionModel {
    /// Returns the description of the operator for `plan`, at the relaxation time of the fluid.
    fn describe(&self, relaxation_time: f64) -> Description;

    /// Returns the only velocity set on which the operator works; `None` if it works on all.
    fn only_on(&self) -> Option<VelocitySet> {
        None
    }

    /// Returns the rate of the antisymmetric parts of the populations, if all symmetric parts have one rate and all
    /// antisymmetric parts another.
    fn antisymmetric_rate(&self) -> Option<AntisymmetricRate> {
        None
    }

    /// Returns a finding for parameters that are invalid at the relaxation time of the fluid. `path` is the JSON
    /// path of the operator in the case.
    fn check(&self, path: &str, relaxation_time: f64) -> Option<Finding> {
        let _ = (path, relaxation_time);
        None
    }

    /// Returns the limit up to which similar runs were stable; `None` if no stability map covers this operator.
    fn border(&self, situation: &Situation) -> Option<Border>;

    /// Returns the limit for a body that moves through the fluid; `None` if no stability map covers this operator.
    fn border_of_moving(&self, body: &MovingBody) -> Option<Border>;

    /// Returns the cell Reynolds number U h/ν at which runs with interpolated links to the faces of polyhedra failed.
    fn fails_at_faces(&self) -> f64;

    /// Returns the fastest growing wave in fluid at rest, unless [`CollisionModel::check`] reports it.
    fn growing_wave(&self, relaxation_time: f64) -> Option<Wave> {
        let _ = relaxation_time;
        None
    }

    /// Passes the kernels of these parameters to a receiver.
    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output
    where
        Self: Sized;

    /// Passes the kernels to a receiver if the errors of their arithmetic in f32 were measured; none otherwise.
    fn dispatch_single<D: Dispatch>(&self, to: D) -> Option<D::Output>
    where
        Self: Sized,
    {
        let _ = to;
        None
    }
}

/// Kernels of an operator with its parameters, one for each kind of pass. The rate of the shear stress is ω = 1/τ
/// of the fluid.
pub trait Kernels: Copy + Send + Sync + 'static {
    /// Kernel for uniform viscosity and open cells, with a body force if `FORCED`.
    type Uniform<const FORCED: bool>: Collision + 'static;
    /// Kernel for cells with different viscosities. The force may be zero: without a separate kernel for zero force
    /// there is one kernel fewer to compile, and it would save little compared with the cost of the velocity gradients.
    type Local: Collision + 'static;
    /// Kernel for cells that solids may cover; viscosity and force as for [`Kernels::Local`].
    type Covered: Collision + 'static;

    /// Returns the kernel [`Kernels::Uniform`].
    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Self::Uniform<FORCED>;
    /// Returns the kernel [`Kernels::Local`].
    fn local(&self, omega: f64, force: [f64; 3]) -> Self::Local;
    /// Returns the kernel [`Kernels::Covered`].
    fn covered(&self, omega: f64, force: [f64; 3]) -> Self::Covered;
}

/// Receiver of the kernels of an operator, which selects a pass once at the start.
pub trait Dispatch {
    /// Result of the dispatch.
    type Output;
    /// Processes kernels that work on every velocity set.
    fn on_any_set<K: Kernels>(self, kernels: K) -> Self::Output;
    /// Processes kernels that work on D3Q27 only.
    fn on_d3q27<K: Kernels>(self, kernels: K) -> Self::Output;
}

#[cfg(test)]
mod tests;
