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
            let [x, y, z] = self.force;
            [0.5 * x, 0.5 * y, 0.5 * z]
        } else {
            [0.0; 3]
        };
        let p = Moments::from_pairs::<L, G, Q>(g, half_force);
        let keep = N::splat(1.0) - omega;
        // 3 ω, and ω/ρ: the rate is applied to the equilibrium before the weights.
        let rate = omega * N::splat(3.0);
        let symmetric = p.volume * omega;
        // Part of the symmetric equilibrium common to all directions, ω (δρ - 3/2 m²/ρ); with a force,
        // -3 (1 - ω/2) m·F/ρ of the source is added.
        let mut base = p.square.neg_mul_add(symmetric, p.drho * omega);
        let mut force = [N::splat(0.0); 3];
        if FORCED {
            let source = omega.neg_mul_add(N::splat(0.5), N::splat(1.0)) * N::splat(3.0);
            let mut power = N::splat(0.0);
            unroll!(axes a < L::DIMENSION => {
                // 3 (1 - ω/2) F
                force[a] = source * N::splat(self.force[a]);
                power = p.m[a].mul_add(force[a], power);
            });
            base = power.neg_mul_add(p.volume, base);
        }
        let rest = g.incoming(0).mul_add(keep, base * N::splat(L::W[0]));
        g.leave(0, rest);
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let w = L::W[i];
            let cm = along(c, &p.m);
            let mut even = (cm * cm).mul_add(symmetric * N::splat(4.5 * w), base * N::splat(w));
            let mut odd = cm * rate;
            if FORCED {
                let cf = along(c, &force);
                even = (cm * cf).mul_add(p.volume * N::splat(3.0 * w), even);
                odd = odd + cf;
            }
            let (one, other) = (g.incoming(i) * keep, g.incoming(j) * keep);
            g.leave(i, odd.mul_add(N::splat(w), one) + even);
            g.leave(j, odd.neg_mul_add(N::splat(w), other) + even);
        });
        p.velocity()
    }
}
