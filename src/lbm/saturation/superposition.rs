//! Superposition of the equilibrium at the velocity of the solid and the relaxed deviation from that of the fluid:
//!
//! ```text
//! Ω^s_i = f_i^eq(u_s) - f_i + (1 - ω) [f_i - f_i^eq(u)]
//! force on the solid = -B (ρ u_s + r),   r = (1 - ω)(m - ρu) - m   with m = Σ c f and ρu = m + F/2
//! ```

use super::mixed::{self, Mixed, Pair};
use super::{
    Act, Cell, CoveredFluid, DensityRatios, LightBody, MEASURED, SolidCollision, SolidOperatorModel,
};
use crate::lanes::Lanes;
use crate::lattice::Lattice;

/// Operator that adds the relaxed non-equilibrium part to the equilibrium at the velocity of the solid.
#[derive(Clone, Copy, Debug)]
pub struct Superposition;

#[cfg(not(target_arch = "nvptx64"))]
impl SolidOperatorModel for Superposition {
    fn documentation(&self) -> &'static str {
        "Equilibrium at the velocity of the solid; the non-equilibrium part relaxes at the rate of the fluid."
    }

    fn describe(&self) -> &'static str {
        "superposition"
    }

    fn measured_rows(&self) -> [&'static str; 2] {
        ["blocks: superposition", "blocks in gaps: not measured"]
    }

    fn lightest(&self, body: &LightBody) -> DensityRatios {
        let (fails, holds) = if body.flat {
            (
                body.by_radius(0.38, 0.55, 0.38),
                body.by_radius(0.46, 1.0, 0.46),
            )
        } else {
            (
                body.by_radius(0.38, 0.55, 0.38),
                body.by_radius(0.42, 1.7, 0.42),
            )
        };
        let wider = if body.relaxation_time > MEASURED.end {
            0.6
        } else {
            0.05
        };
        DensityRatios::for_body(body, fails, holds, wider)
    }

    fn lightest_in_a_bed(&self, body: &LightBody) -> f64 {
        let (slope, rest) = if body.flat { (0.6, 2.55) } else { (0.6, 2.4) };
        (slope * body.time_in_a_bed(0.6, 2.7) + rest) / body.radius
    }
}

impl Mixed for Superposition {
    #[inline(always)]
    fn at_rest<N: Lanes>(incoming: N, at_fluid: N, at_solid: N, keep: N) -> N {
        (at_solid - incoming) + keep * (incoming - at_fluid)
    }

    #[inline(always)]
    fn pair<N: Lanes>(pair: &Pair<N>, keep: N) -> [N; 2] {
        let ([x, y], [even_u, odd_u], [even_s, odd_s]) =
            (pair.incoming, pair.at_fluid, pair.at_solid);
        [
            ((even_s + odd_s) - x) + keep * (x - (even_u + odd_u)),
            ((even_s - odd_s) - y) + keep * (y - (even_u - odd_u)),
        ]
    }

    #[inline(always)]
    fn rest<N: Lanes>(m: N, ru: N, keep: N) -> N {
        keep * (m - ru) - m
    }

    #[inline(always)]
    fn scale<N: Lanes>(rho: N) -> N {
        rho
    }
}

impl SolidCollision for Superposition {
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
