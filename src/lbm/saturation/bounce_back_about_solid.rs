//! Bounce-back about the velocity of the solid (Holdych 2003):
//!
//! ```text
//! Ω^s_i = [f_ī - f_ī^eq(u_s)] - [f_i - f_i^eq(u_s)]
//! force on the solid = -B (2 ρ u_s + r),   r = -2m   with m = Σ c f
//! ```

use super::mixed::{self, Mixed, Pair};
use super::{
    Act, Cell, CoveredFluid, DensityRatios, LightBody, MEASURED, SolidCollision, SolidOperatorModel,
};
use crate::lanes::Lanes;
use crate::lattice::Lattice;

/// Operator that reverses the populations relative to the velocity of the solid.
#[derive(Clone, Copy, Debug)]
pub struct BounceBackAboutSolid;

#[cfg(not(target_arch = "nvptx64"))]
impl SolidOperatorModel for BounceBackAboutSolid {
    fn documentation(&self) -> &'static str {
        "Bounce-back of the non-equilibrium part relative to the velocity of the solid (Holdych 2003)."
    }

    fn describe(&self) -> &'static str {
        "bounce-back about the solid's velocity"
    }

    fn measured_rows(&self) -> [&'static str; 2] {
        [
            "blocks: bounce-back about the solid",
            "blocks in gaps: bounce-back about the solid",
        ]
    }

    fn lightest(&self, body: &LightBody) -> DensityRatios {
        let (fails, holds) = if body.flat {
            (0.385, body.by_radius(0.2, 1.32, 0.475))
        } else {
            (0.345, body.by_radius(0.1, 2.05, 0.475))
        };
        let wider = if body.relaxation_time < MEASURED.start {
            0.25
        } else {
            0.05
        };
        DensityRatios::for_body(body, fails, holds, wider)
    }

    fn lightest_in_a_bed(&self, body: &LightBody) -> f64 {
        let (size, slow) = if body.flat { (11.2, 0.87) } else { (7.0, 1.15) };
        size * body.time_in_a_bed(0.87, slow) / body.radius.powf(1.6)
    }
}

impl Mixed for BounceBackAboutSolid {
    const LEAKS: bool = true;

    #[inline(always)]
    fn at_rest<N: Lanes>(_: N, _: N, _: N, _: N) -> N {
        N::splat(0.0)
    }

    #[inline(always)]
    fn pair<N: Lanes>(pair: &Pair<N>, _: N) -> [N; 2] {
        let ([x, y], [_, odd_s]) = (pair.incoming, pair.at_solid);
        let odd = (odd_s + odd_s) - (x - y);
        [odd, N::splat(0.0) - odd]
    }

    #[inline(always)]
    fn rest<N: Lanes>(m: N, _: N, _: N) -> N {
        N::splat(0.0) - (m + m)
    }

    #[inline(always)]
    fn scale<N: Lanes>(rho: N) -> N {
        rho + rho
    }
}

impl SolidCollision for BounceBackAboutSolid {
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
