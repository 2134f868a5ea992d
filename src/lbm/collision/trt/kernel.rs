//! Kernel of the TRT operator ([`super`]).
//!
//! It is separate from the description of the operator, because it is also compiled for GPUs.

use crate::collision::kernel::{Collision, Moments, Site, along};
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// TRT operator, with a uniform body force if `FORCED`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Trt<const FORCED: bool> {
    /// Relaxation rate ω⁺ = 1/τ of the symmetric part.
    pub omega: f64,
    /// Rule for the relaxation rate ω⁻ of the antisymmetric part.
    pub antisymmetric: AntisymmetricRate,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// Rule that gives the rate of the antisymmetric part from that of the symmetric part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub enum AntisymmetricRate {
    /// Rate from the magic parameter Λ ([`antisymmetric_rate`]).
    Magic(f64),
    /// Rate of the symmetric part, which makes the operator BGK.
    AsSymmetric,
}

/// Halves of the two relaxation rates.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Halves<N> {
    symmetric: N,
    antisymmetric: N,
}

/// Returns ω⁻ = 1 / (Λ/(1/ω⁺ - ½) + ½), given ω⁺ and the magic parameter Λ.
#[must_use]
pub fn antisymmetric_rate(omega: f64, magic: f64) -> f64 {
    1.0 / (magic / (1.0 / omega - 0.5) + 0.5)
}

impl<const FORCED: bool> Collision for Trt<FORCED> {
    const ON_GPU: Option<&'static str> = Some(if FORCED { "forced_trt" } else { "trt" });
    type Rates<N: Lanes> = Halves<N>;

    #[inline(always)]
    fn uniform<N: Lanes>(&self) -> Halves<N> {
        Halves {
            symmetric: N::splat(0.5 * self.omega),
            antisymmetric: N::splat(match self.antisymmetric {
                AntisymmetricRate::Magic(magic) => 0.5 * antisymmetric_rate(self.omega, magic),
                AntisymmetricRate::AsSymmetric => 0.5 * self.omega,
            }),
        }
    }

    #[inline(always)]
    fn local<N: Lanes>(&self, omega: N) -> Halves<N> {
        // ω⁻/2 = a / (2Λω⁺ + a) with a = 1 - ω⁺/2 needs one division.
        let symmetric = omega * N::splat(0.5);
        let open = N::splat(1.0) - symmetric;
        let antisymmetric = match self.antisymmetric {
            AntisymmetricRate::Magic(magic) => open / omega.mul_add(N::splat(2.0 * magic), open),
            AntisymmetricRate::AsSymmetric => symmetric,
        };
        Halves {
            symmetric,
            antisymmetric,
        }
    }

    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        half: &Halves<N>,
    ) -> [N; 3] {
        let half_force = if FORCED {
            let [x, y, z] = self.force;
            [0.5 * x, 0.5 * y, 0.5 * z]
        } else {
            [0.0; 3]
        };
        let p = Moments::from_pairs::<L, G, Q>(g, half_force);
        // The source terms per weight are (1 - ω⁺/2) [9 (c·m)(c·F) - 3 m·F]/ρ of the symmetric part and
        // (1 - ω⁻/2) 3 c·F of the antisymmetric part.
        let mut force = [N::splat(0.0); 3];
        let mut power = N::splat(0.0);
        let (mut even_source, mut odd_source) = (power, power);
        if FORCED {
            even_source = (N::splat(3.0) - half.symmetric * N::splat(3.0)) * p.volume;
            odd_source = N::splat(3.0) - half.antisymmetric * N::splat(3.0);
            unroll!(axes a < L::DIMENSION => {
                force[a] = N::splat(self.force[a]);
                power = p.m[a].mul_add(force[a], power);
            });
        }
        let rest = g.incoming(0);
        let mut even = p.drho * N::splat(L::W[0]) - rest;
        even = (p.square * N::splat(L::W[0])).neg_mul_add(p.volume, even);
        even = even * (half.symmetric + half.symmetric);
        if FORCED {
            even = (power * N::splat(L::W[0])).neg_mul_add(even_source, even);
        }
        g.leave(0, rest + even);
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let w = L::W[i];
            let cm = along(c, &p.m);
            // Half of equilibrium minus value, of the sum and of the difference of the pair, times the rate. The rates
            // are applied last, so that rates per cell cost no more than uniform ones. Without flow the differences are
            // exactly zero.
            let (one, other) = (g.incoming(i), g.incoming(j));
            let mut even = p.drho * N::splat(2.0 * w) - (one + other);
            even = even - (p.square * N::splat(2.0 * w)) * p.volume;
            even = (cm * cm).mul_add(p.volume * N::splat(9.0 * w), even) * half.symmetric;
            let mut odd = (cm * N::splat(6.0 * w) - (one - other)) * half.antisymmetric;
            if FORCED {
                let cf = along(c, &force);
                let source = (cm * cf).mul_add(N::splat(3.0), N::splat(0.0) - power);
                even = source.mul_add(even_source * N::splat(w), even);
                odd = (cf * odd_source).mul_add(N::splat(w), odd);
            }
            g.leave(i, (one + odd) + even);
            g.leave(j, (other - odd) + even);
        });
        p.velocity()
    }
}
