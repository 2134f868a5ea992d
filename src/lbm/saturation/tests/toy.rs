//! Solid collision operator that exists in a test only: it returns the incoming populations.
//!
//! It has its own file, because the test shows that an operator needs no more.

use crate::lanes::Lanes;
use crate::lattice::Lattice;
use crate::saturation::{
    Act, Cell, CoveredFluid, DensityRatios, LightBody, SolidCollision, SolidOperatorModel,
};

/// Operator that returns the incoming populations.
#[derive(Clone, Copy, Debug)]
pub struct Toy;

impl SolidOperatorModel for Toy {
    fn documentation(&self) -> &'static str {
        "A toy."
    }

    fn describe(&self) -> &'static str {
        "toy"
    }

    fn measured_rows(&self) -> [&'static str; 2] {
        ["blocks: toy", "blocks in gaps: not measured"]
    }

    fn lightest(&self, _: &LightBody) -> DensityRatios {
        DensityRatios {
            fails: 0.5,
            holds: 1.0,
        }
    }

    fn lightest_in_a_bed(&self, _: &LightBody) -> f64 {
        0.0
    }
}

impl SolidCollision for Toy {
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(
        self,
        _: &CoveredFluid,
        cell: &Cell<N>,
        before: &[N; Q],
        _: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N> {
        *g = *before;
        let zero = N::splat(0.0);
        Act {
            rest: [zero; 3],
            scale: zero,
            share: cell.fraction,
        }
    }

    fn force_left_out(self, _: &CoveredFluid, fraction: f64) -> f64 {
        fraction
    }
}
