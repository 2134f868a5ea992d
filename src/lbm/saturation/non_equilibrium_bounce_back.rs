//! Bounce-back of the non-equilibrium part (Noble and Torczynski 1998):
//!
//! ```text
//! Ω^s_i = [f_ī - f_ī^eq(u)] - [f_i - f_i^eq(u_s)]
//! force on the solid = -B (ρ u_s + r),   r = ρu - 2m   with m = Σ c f and ρu = m + F/2
//! ```
//!
//! The deviation from equilibrium that is reversed, and its momentum ρu - m, are multiplied by 1 - 1/64 (`LEAK`).

use super::mixed::{self, Mixed, Pair};
use super::{
    Act, Cell, CoveredFluid, DensityRatios, LEAK, LightBody, MEASURED, SolidCollision,
    SolidOperatorModel,
};
use crate::lanes::Lanes;
use crate::lattice::Lattice;

/// Operator that reverses the non-equilibrium part of the populations.
#[derive(Clone, Copy, Debug)]
pub struct NonEquilibriumBounceBack;

#[cfg(not(target_arch = "nvptx64"))]
impl SolidOperatorModel for NonEquilibriumBounceBack {
    fn documentation(&self) -> &'static str {
        "Bounce-back of the non-equilibrium part (Noble and Torczynski 1998)."
    }

    fn describe(&self) -> &'static str {
        "bounce-back of the non-equilibrium part"
    }

    fn measured_rows(&self) -> [&'static str; 2] {
        [
            "blocks: non-equilibrium bounce-back",
            "blocks in gaps: non-equilibrium bounce-back",
        ]
    }

    fn lightest(&self, body: &LightBody) -> DensityRatios {
        let (fails, holds) = if body.flat {
            (
                body.by_radius(0.38, 0.7, 0.38),
                body.by_radius(0.405, 1.47, 0.405),
            )
        } else {
            let (slow, fast) = (
                body.by_radius(0.48, 0.9, 0.48),
                body.by_radius(0.42, 1.7, 0.42),
            );
            (body.by_radius(0.45, 0.75, 0.45), body.by_time(slow, fast))
        };
        let mut ratios = DensityRatios::for_body(body, fails, holds, 0.05);
        if body.relaxation_time < MEASURED.start {
            ratios.fails = (0.38 + 1.0 / body.radius).min(0.23 + 1.45 / body.radius);
        }
        ratios
    }

    fn lightest_in_a_bed(&self, body: &LightBody) -> f64 {
        let (slope, rest) = if body.flat { (1.2, 3.3) } else { (1.5, 2.1) };
        (slope * body.time_in_a_bed(0.6, 1.3) + rest) / body.radius
    }
}

impl Mixed for NonEquilibriumBounceBack {
    #[inline(always)]
    fn at_rest<N: Lanes>(incoming: N, at_fluid: N, at_solid: N, _: N) -> N {
        N::splat(1.0 - LEAK) * (incoming - at_fluid) + (at_solid - incoming)
    }

    /// Reverses the deviation from equilibrium, with the loss `LEAK`.
    #[inline(always)]
    fn pair<N: Lanes>(pair: &Pair<N>, _: N) -> [N; 2] {
        let (half, stays) = (N::splat(0.5), N::splat(1.0 - LEAK));
        let ([x, y], [even_u, odd_u], [even_s, odd_s]) =
            (pair.incoming, pair.at_fluid, pair.at_solid);
        let (even, odd) = ((x + y) * half - even_u, (x - y) * half - odd_u);
        let (p, q) = (stays * (even - odd), stays * (even + odd));
        [(p - x) + (even_s + odd_s), (q - y) + (even_s - odd_s)]
    }

    #[inline(always)]
    fn rest<N: Lanes>(m: N, ru: N, _: N) -> N {
        N::splat(1.0 - LEAK) * (ru - m) - m
    }

    #[inline(always)]
    fn scale<N: Lanes>(rho: N) -> N {
        rho
    }
}

impl SolidCollision for NonEquilibriumBounceBack {
    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(
        self,
        covered: &CoveredFluid,
        cell: &Cell<N>,
        before: &[N; Q],
        fluid: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N> {
        mixed::collide::<Self, L, N, Q>(covered, cell, before, fluid, g)
    }

    fn force_left_out(self, fluid: &CoveredFluid, fraction: f64) -> f64 {
        mixed::weight::<Self, f64>(fluid, fraction)
    }
}
