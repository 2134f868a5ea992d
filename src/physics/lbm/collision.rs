//! Collision operators, one file each.
//!
//! A file holds the parameters of an operator as they stand in a case, its description, its limits and its kernel. The kernel is written once
//! for scalars and vectors. The list of operators generates the enum of the case and the choice of the pass.
//!
//! Populations are stored as deviations g_i = f_i - w_i (exact where the fluid is at rest). With δρ = Σ g and momentum
//! m = Σ c g + F/2 (Z. Guo, C. Zheng, B. Shi, Phys. Rev. E 65 (2002) 046308; F = 0 without a body force) and u = m/ρ, the equilibrium
//! of second order (Y. H. Qian, D. d'Humières, P. Lallemand, Europhys. Lett. 17 (1992) 479) reads
//!
//! g_i^eq = w_i [ δρ + 3 c·m + 9/2 (c·m)(c·u) - 3/2 m·u ].

pub mod border;
pub mod linear_stability;
mod products;
pub mod second_order;

use super::lanes::Lanes;
use super::lattice::{Lattice, VelocitySet, unroll};
use crate::error::Finding;
use crate::family::{self, Description};
use border::{Border, Situation};
use linear_stability::Wave;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use trt::AntisymmetricRate;

/// Makes a list of operators: the modules that hold them, and the enum that a case chooses from. The name of an operator in a case is that
/// of its module.
macro_rules! operators {
    ($(#[$attribute:meta])* $list:ident: $($module:ident $operator:ident,)*) => {
        $(pub mod $module;)*

        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        $(#[$attribute])*
        #[serde(rename_all = "snake_case")]
        #[schemars(transform = family::describe_choices)]
        pub enum $list {
            $(
                #[allow(missing_docs, reason = "the documentation of an operator stands in its module")]
                $operator($module::Parameters),
            )*
        }

        impl $list {
            /// The description of the operator.
            #[must_use]
            pub fn model(&self) -> &dyn Model {
                match self {
                    $(Self::$operator(parameters) => parameters,)*
                }
            }

            /// Name in a case.
            #[must_use]
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$operator(_) => stringify!($module),)*
                }
            }

            /// Hands over the kernels of the operator.
            pub fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
                match self {
                    $(Self::$operator(parameters) => parameters.dispatch(to),)*
                }
            }
        }
    };
}

operators! {
    /// Collision operator.
    #[schemars(rename = "Collision")]
    Operator:
    bgk Bgk,
    trt Trt,
    mrt Mrt,
    suga Suga,
    cumulant Cumulant,
}

impl Default for Operator {
    fn default() -> Self {
        Self::Trt(trt::Parameters::default())
    }
}

/// A collision operator of a case: its parameters and its interface to the program.
pub trait Model {
    /// The operator for `plan`, at the relaxation time of the fluid.
    fn describe(&self, relaxation_time: f64) -> Description;

    /// The only velocity set that the operator works on; none where it works on all.
    fn only_on(&self) -> Option<VelocitySet> {
        None
    }

    /// The rate of the antisymmetric parts of the populations, where one rate holds for all symmetric parts and one for all antisymmetric
    /// parts.
    fn antisymmetric_rate(&self) -> Option<AntisymmetricRate> {
        None
    }

    /// What is wrong with these parameters at the relaxation time of the fluid. `path` is the place of the family in the case.
    fn check(&self, path: &str, relaxation_time: f64) -> Option<Finding> {
        let _ = (path, relaxation_time);
        None
    }

    /// Up to where runs like it were seen to hold; none where no map judges this operator.
    fn border(&self, situation: &Situation) -> Option<Border>;

    /// The cell Reynolds number U h/ν at which runs with interpolated links to the faces of polyhedra failed.
    fn fails_at_faces(&self) -> f64;

    /// The wave that grows fastest in fluid at rest, where [`Model::check`] does not report it at every number of steps.
    fn growing_wave(&self, relaxation_time: f64) -> Option<Wave> {
        let _ = relaxation_time;
        None
    }

    /// Hands over the kernels of these parameters.
    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output
    where
        Self: Sized;
}

/// The kernels of an operator with its parameters, one for each kind of pass. The rate of the shear stress is ω = 1/τ of the fluid.
pub trait Kernels: Copy + Send + Sync + 'static {
    /// For one viscosity and open cells, with a body force where `FORCED`.
    type Uniform<const FORCED: bool>: Collision + 'static;
    /// For cells with viscosities of their own. The force may be zero: one kernel fewer to compile, and what a kernel without a force
    /// saves is little beside the velocity gradients.
    type Local: Collision + 'static;
    /// For cells that solids may cover; viscosity and force as for [`Kernels::Local`].
    type Covered: Collision + 'static;

    /// See [`Kernels::Uniform`].
    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Self::Uniform<FORCED>;
    /// See [`Kernels::Local`].
    fn local(&self, omega: f64, force: [f64; 3]) -> Self::Local;
    /// See [`Kernels::Covered`].
    fn covered(&self, omega: f64, force: [f64; 3]) -> Self::Covered;
}

/// Receives the kernels of an operator, to choose a pass by them once at the start.
pub trait Dispatch {
    /// What is made of the kernels.
    type Output;
    /// Kernels that work on every velocity set.
    fn on_any_set<K: Kernels>(self, kernels: K) -> Self::Output;
    /// Kernels that work on D3Q27 only.
    fn on_d3q27<K: Kernels>(self, kernels: K) -> Self::Output;
}

/// The populations of one cell, or of several side by side, each to be read and replaced.
///
/// The pass hands out the lattice itself: an operator that works pair by pair reads a pair again before it replaces it, which costs less
/// than 27 registers that do not exist. Population i goes where its opposite was read, so a pair is read before either is replaced.
pub trait Site<N, const Q: usize> {
    /// Deviation that came in along direction i.
    fn incoming(&self, i: usize) -> N;
    /// Deviation that leaves along direction i.
    fn leave(&mut self, i: usize, outgoing: N);
}

impl<N: Copy, const Q: usize> Site<N, Q> for [N; Q] {
    #[inline(always)]
    fn incoming(&self, i: usize) -> N {
        self[i]
    }
    #[inline(always)]
    fn leave(&mut self, i: usize, outgoing: N) {
        self[i] = outgoing;
    }
}

/// What happens to the populations of one cell (or of several side by side) in a step.
pub trait Collision: Copy + Send + Sync {
    /// Relaxation rates of a cell, made from that of the shear stress, ω = 1/τ.
    type Rates<N: Lanes>: Copy;
    /// The rates where all cells have the same viscosity.
    fn uniform<N: Lanes>(&self) -> Self::Rates<N>;
    /// The rates of a cell whose viscosity is its own.
    fn local<N: Lanes>(&self, omega: N) -> Self::Rates<N>;
    /// Replaces incoming deviations by outgoing ones and returns the velocity. Every call sees the same `self` during one step.
    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        rates: &Self::Rates<N>,
    ) -> [N; 3];
}

/// The moments that every operator needs.
pub(crate) struct Moments<N> {
    /// Density deviation δρ.
    pub(crate) drho: N,
    /// Momentum m = Σ c g + F/2.
    pub(crate) m: [N; 3],
    /// Velocity u = m / ρ.
    pub(crate) u: [N; 3],
    /// m·u
    pub(crate) mu: N,
}

impl<N: Lanes> Moments<N> {
    /// Sums over the pairs of a cell; `half_force` is F/2.
    #[inline(always)]
    pub(crate) fn of<L: Lattice<Q>, G: Site<N, Q>, const Q: usize>(
        g: &G,
        half_force: [f64; 3],
    ) -> Self {
        let zero = N::splat(0.0);
        // Two sums, so that an addition need not wait for the one before.
        let mut drho = [g.incoming(0), zero];
        let mut m = [
            N::splat(half_force[0]),
            N::splat(half_force[1]),
            N::splat(half_force[2]),
        ];
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let (one, other) = (g.incoming(i), g.incoming(j));
            drho[k % 2] = drho[k % 2] + (one + other);
            let odd = one - other;
            let c = L::C[i];
            unroll!(axes a < L::DIMENSION => {
                match c[a] {
                    1 => m[a] = m[a] + odd,
                    -1 => m[a] = m[a] - odd,
                    _ => {}
                }
            });
        });
        let drho = drho[0] + drho[1];
        let inverse = N::splat(1.0) / (N::splat(1.0) + drho);
        let mut u = [zero; 3];
        let mut mu = zero;
        unroll!(axes a < L::DIMENSION => {
            u[a] = m[a] * inverse;
            mu = m[a].mul_add(u[a], mu);
        });
        Self { drho, m, u, mu }
    }
}

/// c·v for a constant direction: adds and subtracts components, never multiplies.
#[inline(always)]
pub(crate) fn along<N: Lanes>(c: [i8; 3], v: &[N; 3]) -> N {
    let mut sum: Option<N> = None;
    unroll!(axes a < 3 => {
        sum = match (c[a], sum) {
            (0, s) => s,
            (1, None) => Some(v[a]),
            (1, Some(s)) => Some(s + v[a]),
            (_, None) => Some(N::splat(0.0) - v[a]),
            (_, Some(s)) => Some(s - v[a]),
        };
    });
    sum.unwrap_or_else(|| N::splat(0.0))
}

#[cfg(test)]
mod tests;
