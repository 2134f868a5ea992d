//! Multiple relaxation times on D3Q27 with moments that are orthogonal under the weights of the lattice, with Guo
//! forcing.
//!
//! f ← f - M⁻¹ [ S (M f - m^eq) - (I - S/2) M F ], with the moments of K. Suga, Y. Kuwata, K. Takashima, R.
//! Chikasue, Comput. Math. Appl. 69 (2015) 518, made orthogonal by Gram-Schmidt in the inner product Σ w_i a_i b_i,
//! and their rates, S = diag(0, 0, 0, 0, s4, s5, s5, s7×3, s10×3, s13×3, s16, s17, s18×2, s20×3, s23×3, s26), s5
//! = s7 = 1/τ.
//!
//! **No wave grows at rest.** Linearised about rest, an equilibrium of second order is the projection onto 1 and c,
//! and the operator is symmetric in the inner product Σ a_i b_i/w_i, with the eigenvalues 1 and 1 - s. For rates
//! from 0 to 2 it increases no deviation in that norm, and streaming preserves the norm: no wave grows at any τ (M.
//! Junk, W.-A. Yong, SIAM J. Numer. Anal. 47 (2009) 1651). The published matrix ([`super::suga`]) is orthogonal
//! without the weights, and waves grow with it. In uniform motion along an axis, waves of 16 to 2 cells grow with
//! the rates of Suga from a lattice velocity of 0.07, 0.19, 0.27 and 0.34 on at τ = 0.501, 0.51, 0.55 and 0.6; with
//! the published matrix from 0.055, 0.17, 0.19 and 0 on.
//!
//! **The factorised form.** The moments are products of one polynomial in each component of c, from 1, c and K = 1 -
//! 3c², or sums or differences of such products. 1, c and K are orthogonal under the weights (2/3, 1/6, 1/6) of an
//! axis.
//!
//! | moments | products | rate |
//! |---|---|---|
//! | ρ; j | 1; c_x | conserved |
//! | e; 3p_xx, p_ww | sum of K_x, K_y, K_z; their differences | s4; s5 |
//! | p_xy | c_x c_y | s7 |
//! | q_x; τ_x | c_x K_y + c_x K_z; c_x K_y - c_x K_z | s10; s23 |
//! | Ψ_x | c_x K_y K_z | s13 |
//! | ε; XX, WW | sum of K_x K_y, K_y K_z, K_z K_x; their differences | s16; s18 |
//! | e³ | K_x K_y K_z | s17 |
//! | XY | c_x c_y K_z | s20 |
//! | XYZ | c_x c_y c_z | s26 |
//!
//! M and M⁻¹ are three sweeps of 9 small transforms each. Equilibrium and source of second order have no moments
//! above the second order, so that these moments decay to zero: the operator takes 281 additions, multiplications
//! and fused pairs without a force, compared with 329 for the published matrix. The trace of the second moments, e,
//! has its own rate, so that the bulk viscosity is (2/9)(1/s4 - ½).

pub mod kernel;

pub use kernel::{Mrt, Rates};

use super::border::{self, Border, MovingBody, ReynoldsBounds, Situation};
use super::second_order::SecondOrder;
use super::{CollisionModel, Dispatch, Kernels};
use crate::lattice::VelocitySet;
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Multiple relaxation times on D3Q27: the shear stress relaxes at 1/tau, every other group of moments at its own rate,
/// by default that of Suga et al. (2015). Moments are orthogonal under the weights of the lattice, so that no wave
/// grows in fluid at rest. For turbulent flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MrtParameters {
    /// Rate s4 of the trace of the stress \[1\]; the bulk viscosity is (2/9)(1/s4 - 1/2). Default: 1.54.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub bulk: Option<f64>,
    /// Rate of all moments above the second order whose own rate is not given \[1\]. Default: the rates of Suga et al.
    /// A rate of 1 relaxes these moments to equilibrium in one step, as other codes do by default, and saves two fifths
    /// of the arithmetic.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub higher: Option<f64>,
    /// Rate s10 of the energy flux q \[1\]. Default: 1.5.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub q: Option<f64>,
    /// Rate s13 of Psi \[1\]. Default: 1.83.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub psi: Option<f64>,
    /// Rate s16 of epsilon \[1\]. Default: 1.4.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub epsilon: Option<f64>,
    /// Rate s17 of e cubed \[1\]. Default: 1.61.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub e_cubed: Option<f64>,
    /// Rate s18 of XX and WW \[1\]. Default: 1.98.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub xx: Option<f64>,
    /// Rate s20 of XY, YZ and ZX \[1\]. Default: 1.98.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub xy: Option<f64>,
    /// Rate s23 of the third-order tau \[1\]. Default: 1.74.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub tau: Option<f64>,
    /// Rate s26 of XYZ \[1\]. Default: 1.74.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub xyz: Option<f64>,
}

const CUBE: &[ReynoldsBounds] = &ReynoldsBounds::always(30.0, 60.0);
const DUCT: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.06, 30.0, 60.0),
    ReynoldsBounds::up_to(f64::INFINITY, 23.0, 30.0),
];
const CUBE_EDDIES: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.03, 300.0, f64::INFINITY),
    ReynoldsBounds::up_to(0.1, 100.0, 300.0),
    ReynoldsBounds::up_to(f64::INFINITY, 20.0, 60.0),
];
const CUBE_SECOND_ORDER_EDDIES: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.1, 1000.0, f64::INFINITY),
    ReynoldsBounds::up_to(f64::INFINITY, 200.0, 600.0),
];

impl MrtParameters {
    /// Returns the given rates of the moments above second order: q, psi, epsilon, `e_cubed`, xx, xy, tau, xyz.
    fn higher_rates(&self) -> [Option<f64>; 8] {
        [
            self.q,
            self.psi,
            self.epsilon,
            self.e_cubed,
            self.xx,
            self.xy,
            self.tau,
            self.xyz,
        ]
        .map(|rate| rate.or(self.higher))
    }

    /// Returns the rates other than that of the shear stress; those of Suga if they are not given.
    #[must_use]
    pub fn rates(&self) -> Rates {
        let suga = Rates::SUGA;
        let [q, psi, epsilon, e_cubed, xx, xy, tau, xyz] = self.higher_rates();
        Rates {
            bulk: self.bulk.unwrap_or(suga.bulk),
            q: q.unwrap_or(suga.q),
            psi: psi.unwrap_or(suga.psi),
            epsilon: epsilon.unwrap_or(suga.epsilon),
            e_cubed: e_cubed.unwrap_or(suga.e_cubed),
            xx: xx.unwrap_or(suga.xx),
            xy: xy.unwrap_or(suga.xy),
            tau: tau.unwrap_or(suga.tau),
            xyz: xyz.unwrap_or(suga.xyz),
        }
    }

    /// Returns `true` if the moments above second order are set to their equilibrium in one step.
    fn second_order(&self) -> bool {
        self.rates().second_order()
    }
}

const SPHERE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.06, 80.0, f64::INFINITY),
    ReynoldsBounds::up_to(0.15, 40.0, 80.0),
    ReynoldsBounds::up_to(f64::INFINITY, 10.0, 12.0),
];

impl CollisionModel for MrtParameters {
    fn describe(&self, _: f64) -> Description {
        if self.second_order() {
            Description::new(
                "multiple relaxation times of the second moments",
                "requested; higher moments are set to their equilibrium",
            )
        } else {
            Description::new(
                "multiple relaxation times",
                "requested; moments orthogonal under the weights of the lattice, each group at its own rate",
            )
        }
    }

    fn only_on(&self) -> Option<VelocitySet> {
        Some(VelocitySet::D3Q27)
    }

    /// Returns the border; with an eddy viscosity only flows under a lid are covered.
    fn border(&self, situation: &Situation) -> Option<Border> {
        if situation.eddies && !situation.lid_meets_wall {
            return None;
        }
        if situation.duct() && !self.second_order() {
            return Some(border::duct(DUCT));
        }
        Some(border::cube(
            match (situation.eddies, self.second_order()) {
                (false, _) => CUBE,
                (true, false) => CUBE_EDDIES,
                (true, true) => CUBE_SECOND_ORDER_EDDIES,
            },
        ))
    }

    fn border_of_moving(&self, body: &MovingBody) -> Option<Border> {
        (!body.eddies).then_some(body.border(SPHERE))
    }

    fn fails_at_faces(&self) -> f64 {
        if self.second_order() { 20.0 } else { 2.0 }
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        let rates = self.rates();
        if rates.second_order() {
            to.on_d3q27(OfSecondOrder(rates))
        } else {
            to.on_d3q27(rates)
        }
    }

    fn dispatch_single<D: Dispatch>(&self, to: D) -> Option<D::Output> {
        Some(self.dispatch(to))
    }
}

impl Kernels for Rates {
    type Uniform<const FORCED: bool> = Mrt<FORCED>;
    type Local = Mrt<true>;
    type Covered = Mrt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Mrt<FORCED> {
        Mrt {
            omega,
            rates: *self,
            force,
        }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Mrt<true> {
        self.uniform(omega, force)
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Mrt<true> {
        self.uniform(omega, force)
    }
}

/// Kernels with rates of 1 above the second moments: the cheaper kernel, except if solids may cover cells.
#[derive(Clone, Copy)]
struct OfSecondOrder(Rates);

impl Kernels for OfSecondOrder {
    type Uniform<const FORCED: bool> = SecondOrder<FORCED>;
    type Local = SecondOrder<true>;
    type Covered = Mrt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> SecondOrder<FORCED> {
        let bulk = self.0.bulk;
        SecondOrder { omega, bulk, force }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> SecondOrder<true> {
        self.uniform(omega, force)
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Mrt<true> {
        self.0.covered(omega, force)
    }
}

#[cfg(test)]
pub(super) mod tests;
