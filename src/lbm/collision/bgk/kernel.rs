//! Kernel of the BGK operator ([`super`]).
//!
//! It is separate from the description of the operator, because it is also compiled for GPUs.

use crate::collision::kernel::{Collision, Moments, Site, along};
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// BGK operator, with a uniform body force if `FORCED`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Bgk<const FORCED: bool> {
    /// Relaxation rate 1/τ, below 2.
    pub omega: f64,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

impl<const FORCED: bool> Collision for Bgk<FORCED> {
    const ON_GPU: Option<&'static str> = Some(if FORCED { "forced_bgk" } else { "bgk" });
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
        let p = Moments::from_pairs::<L, G, Q>(g, half_force);
        let keep = N::splat(1.0) - omega;
        // 3 ω m: the rate is applied to the moments rather than to each population, so that a rate per cell costs no
        // more than a uniform one.
        let rate = omega * N::splat(3.0);
        let mut momentum = [N::splat(0.0); 3];
        unroll!(axes a < L::DIMENSION => {
            momentum[a] = p.m[a] * rate;
        });
        // Part of the symmetric equilibrium common to all directions, δρ - 3/2 m·u; with a force, -3 u·F of the source
        // is added.
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
