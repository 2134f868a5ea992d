//! Single relaxation time (Bhatnagar, Gross and Krook 1954; A-03), with Guo forcing.
//!
//! f_i ← f_i - ω (f_i - f_i^eq) + (1 - ω/2) w_i [3 (c - u) + 9 (c·u) c]·F, ω = 1/τ, ν = (τ - ½)/3 in lattice units.
//! The half-way wall then sits at a place that depends on τ: exactly half-way only at τ = ½ + √3/4 (validation 1.1).

use super::{Collision, Pairs, along};
use crate::lbm::lanes::Lanes;
use crate::lbm::lattice::{Lattice, unroll};

/// BGK without a body force.
#[derive(Clone, Copy, Debug)]
pub struct Bgk {
    /// Relaxation rate 1/τ, below 2.
    pub omega: f64,
}

/// BGK with a uniform body force.
#[derive(Clone, Copy, Debug)]
pub struct ForcedBgk {
    /// Relaxation rate 1/τ, below 2.
    pub omega: f64,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

impl Collision for Bgk {
    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(&self, g: &mut [N; Q]) {
        relax::<L, N, Q, false>(g, self.omega, [0.0; 3]);
    }
}

impl Collision for ForcedBgk {
    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(&self, g: &mut [N; Q]) {
        relax::<L, N, Q, true>(g, self.omega, self.force);
    }
}

#[inline(always)]
fn relax<L: Lattice<Q>, N: Lanes, const Q: usize, const FORCED: bool>(
    g: &mut [N; Q],
    omega: f64,
    force: [f64; 3],
) {
    let p = Pairs::of::<L, Q>(g, force.map(|f| 0.5 * f));
    let keep = N::splat(1.0 - omega);
    // The even part common to all directions, δρ - 3/2 m·u, and with a force the source's -3 u·F beside it.
    let mut base = p.mu.mul_add(N::splat(-1.5), p.drho) * N::splat(omega);
    let mut lanes_force = [N::splat(0.0); 3];
    let source = 1.0 - 0.5 * omega;
    if FORCED {
        let mut uf = N::splat(0.0);
        unroll!(axes a < L::DIMENSION => {
            lanes_force[a] = N::splat(force[a]);
            uf = p.u[a].mul_add(lanes_force[a], uf);
        });
        base = uf.mul_add(N::splat(-3.0 * source), base);
    }
    g[0] = g[0].mul_add(keep, base * N::splat(L::W[0]));
    unroll!(pairs k < (Q - 1) / 2 => {
        let (i, j) = L::PAIRS[k];
        let c = L::C[i];
        let w = L::W[i];
        let cm = along(c, &p.m);
        let cu = along(c, &p.u);
        let mut even = (cm * cu).mul_add(N::splat(4.5 * omega), base);
        let mut odd = cm * N::splat(3.0 * omega * w);
        if FORCED {
            let cf = along(c, &lanes_force);
            even = (cu * cf).mul_add(N::splat(9.0 * source), even);
            odd = cf.mul_add(N::splat(3.0 * source * w), odd);
        }
        let even = even * N::splat(w);
        g[i] = g[i].mul_add(keep, even + odd);
        g[j] = g[j].mul_add(keep, even - odd);
    });
}
