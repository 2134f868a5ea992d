//! Two relaxation times (Ginzburg, Verhaeghe and d'Humières 2008), with Guo forcing.
//!
//! The even part of each opposite pair relaxes at ω⁺ = 1/τ, which sets the viscosity ν = (τ - ½)/3, the odd part at
//! ω⁻. The product Λ = (1/ω⁺ - ½)(1/ω⁻ - ½) fixes where the half-way wall sits, independently of the viscosity:
//! Λ = 3/16 puts it exactly half-way for Poiseuille flow (validation 1.1), Λ = 1/4 is the most stable choice.

use super::{Collision, Pairs, along};
use crate::lbm::lanes::Lanes;
use crate::lbm::lattice::{Lattice, unroll};

/// TRT without a body force.
#[derive(Clone, Copy, Debug)]
pub struct Trt {
    /// Rate of the even part, 1/τ.
    pub omega_even: f64,
    /// Rate of the odd part.
    pub omega_odd: f64,
}

/// TRT with a uniform body force.
#[derive(Clone, Copy, Debug)]
pub struct ForcedTrt {
    /// The rates.
    pub rates: Trt,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

impl Trt {
    /// Rates from the relaxation time τ and the magic parameter Λ.
    #[must_use]
    pub fn new(relaxation_time: f64, magic: f64) -> Self {
        Self {
            omega_even: 1.0 / relaxation_time,
            omega_odd: 1.0 / (magic / (relaxation_time - 0.5) + 0.5),
        }
    }
}

impl Collision for Trt {
    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(&self, g: &mut [N; Q]) {
        relax::<L, N, Q, false>(g, *self, [0.0; 3]);
    }
}

impl Collision for ForcedTrt {
    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(&self, g: &mut [N; Q]) {
        relax::<L, N, Q, true>(g, self.rates, self.force);
    }
}

#[inline(always)]
fn relax<L: Lattice<Q>, N: Lanes, const Q: usize, const FORCED: bool>(
    g: &mut [N; Q],
    rates: Trt,
    force: [f64; 3],
) {
    let p = Pairs::of::<L, Q>(g, force.map(|f| 0.5 * f));
    let (even_rate, odd_rate) = (rates.omega_even, rates.omega_odd);
    let mut base = p.mu.mul_add(N::splat(-1.5), p.drho) * N::splat(even_rate);
    let mut lanes_force = [N::splat(0.0); 3];
    let (even_source, odd_source) = (1.0 - 0.5 * even_rate, 1.0 - 0.5 * odd_rate);
    if FORCED {
        let mut uf = N::splat(0.0);
        unroll!(axes a < L::DIMENSION => {
            lanes_force[a] = N::splat(force[a]);
            uf = p.u[a].mul_add(lanes_force[a], uf);
        });
        base = uf.mul_add(N::splat(-3.0 * even_source), base);
    }
    g[0] = g[0].mul_add(N::splat(1.0 - even_rate), base * N::splat(L::W[0]));
    let half_even = N::splat(0.5 * even_rate);
    let half_odd = N::splat(0.5 * odd_rate);
    unroll!(pairs k < (Q - 1) / 2 => {
        let (i, j) = L::PAIRS[k];
        let c = L::C[i];
        let w = L::W[i];
        let cm = along(c, &p.m);
        let cu = along(c, &p.u);
        let mut even = (cm * cu).mul_add(N::splat(4.5 * even_rate), base);
        let mut odd = cm * N::splat(3.0 * odd_rate * w);
        if FORCED {
            let cf = along(c, &lanes_force);
            even = (cu * cf).mul_add(N::splat(9.0 * even_source), even);
            odd = cf.mul_add(N::splat(3.0 * odd_source * w), odd);
        }
        let even = p.even[k].neg_mul_add(half_even, even * N::splat(w));
        let odd = p.odd[k].neg_mul_add(half_odd, odd);
        g[i] = g[i] + (even + odd);
        g[j] = g[j] + (even - odd);
    });
}
