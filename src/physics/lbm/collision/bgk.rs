//! Single relaxation time (P. L. Bhatnagar, E. P. Gross, M. Krook, Phys. Rev. 94 (1954) 511), with Guo forcing.
//!
//! f_i ← f_i - ω (f_i - f_i^eq) + (1 - ω/2) w_i [3 (c - u) + 9 (c·u) c]·F, ω = 1/τ, ν = (τ - ½)/3 in lattice units.
//! The position of a half-way wall depends on τ: it is exactly half-way only at τ = ½ + √3/4.

use super::border::{Border, Bounds, Situation};
use super::trt::{self, AntisymmetricRate, Trt};
use super::{Collision, Dispatch, Kernels, Model, Moments, Site, along};
use crate::error::number;
use crate::family::Description;
use crate::lbm::lanes::Lanes;
use crate::lbm::lattice::{Lattice, unroll};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One relaxation time for all moments (Bhatnagar, Gross and Krook 1954). The position of walls depends on tau.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Parameters {}

const FREE: &[Bounds] = &[
    Bounds::up_to(0.21, 180.0, 200.0),
    Bounds::up_to(f64::INFINITY, 1.7, 8.4),
];
const LID: &[Bounds] = &Bounds::always(10.0, 18.0);
const CUBE: &[Bounds] = &Bounds::always(10.0, 20.0);
const DUCT_19: [Bounds; 1] = Bounds::always(9.0, 10.0);
const DUCT_27: [Bounds; 1] = Bounds::always(15.0, 17.6);
const CUBE_EDDIES: &[Bounds] = &[
    Bounds::up_to(0.03, 30.0, 90.0),
    Bounds::up_to(f64::INFINITY, 10.0, 20.0),
];

impl Model for Parameters {
    fn describe(&self, relaxation_time: f64) -> Description {
        let tau = number(relaxation_time);
        Description::new(
            "BGK",
            format!("requested; walls lie half-way only near tau 0.933 (here {tau})"),
        )
    }

    fn antisymmetric_rate(&self) -> Option<AntisymmetricRate> {
        Some(AntisymmetricRate::AsSymmetric)
    }

    fn border(&self, situation: &Situation) -> Option<Border> {
        trt::border_of_two_rates(
            situation,
            FREE,
            LID,
            if situation.eddies { CUBE_EDDIES } else { CUBE },
            [&DUCT_19, &DUCT_27],
        )
    }

    fn fails_at_faces(&self) -> f64 {
        2.0
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        to.on_any_set(*self)
    }
}

/// Cells with viscosities of their own share the passes of TRT, with equal rates.
impl Kernels for Parameters {
    type Uniform<const FORCED: bool> = Bgk<FORCED>;
    type Local = Trt<true>;
    type Covered = Trt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Bgk<FORCED> {
        Bgk { omega, force }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Trt<true> {
        Trt {
            omega,
            antisymmetric: AntisymmetricRate::AsSymmetric,
            force,
        }
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Trt<true> {
        self.local(omega, force)
    }
}

/// BGK, with a uniform body force where `FORCED`.
#[derive(Clone, Copy, Debug)]
pub struct Bgk<const FORCED: bool> {
    /// Relaxation rate 1/τ, below 2.
    pub omega: f64,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

impl<const FORCED: bool> Collision for Bgk<FORCED> {
    type Rates<N: Lanes> = N;

    #[inline(always)]
    fn uniform<N: Lanes>(&self) -> N {
        N::splat(self.omega)
    }

    #[inline(always)]
    fn local<N: Lanes>(&self, omega: N) -> N {
        omega
    }

    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        &omega: &N,
    ) -> [N; 3] {
        let half_force = if FORCED {
            self.force.map(|f| 0.5 * f)
        } else {
            [0.0; 3]
        };
        let p = Moments::of::<L, G, Q>(g, half_force);
        let keep = N::splat(1.0) - omega;
        // 3 ω m: the rate goes into the moments, so that one that differs from cell to cell costs nothing more.
        let rate = omega * N::splat(3.0);
        let mut momentum = [N::splat(0.0); 3];
        unroll!(axes a < L::DIMENSION => {
            momentum[a] = p.m[a] * rate;
        });
        // The even part common to all directions, δρ - 3/2 m·u, and with a force the source's -3 u·F beside it.
        let mut base = p.mu.mul_add(N::splat(-1.5), p.drho) * omega;
        let mut force = [N::splat(0.0); 3];
        if FORCED {
            let source = omega.neg_mul_add(N::splat(0.5), N::splat(1.0)) * N::splat(3.0);
            let mut uf = N::splat(0.0);
            unroll!(axes a < L::DIMENSION => {
                // 3 (1 - ω/2) F
                force[a] = source * N::splat(self.force[a]);
                uf = p.u[a].mul_add(force[a], uf);
            });
            base = base - uf;
        }
        let rest = g.incoming(0).mul_add(keep, base * N::splat(L::W[0]));
        g.leave(0, rest);
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let w = N::splat(L::W[i]);
            let cu = along(c, &p.u);
            let mut odd = along(c, &momentum);
            let mut even = (odd * cu).mul_add(N::splat(1.5), base);
            if FORCED {
                let cf = along(c, &force);
                even = (cu * cf).mul_add(N::splat(3.0), even);
                odd = odd + cf;
            }
            let (one, other) = (g.incoming(i), g.incoming(j));
            g.leave(i, one.mul_add(keep, (even + odd) * w));
            g.leave(j, other.mul_add(keep, (even - odd) * w));
        });
        p.u
    }
}
