//! Solid collision operator with a drag in slow flow that does not depend on the viscosity.
//!
//! With the operators that mix two collisions, the drag of a sphere depends on the relaxation time, by 10 % and more at
//! ten cells per diameter. Steady slow flow on a lattice depends only on the product of the relaxation times (less ½)
//! of the symmetric and antisymmetric parts, if those of every cell scale like those of the fluid (I. Ginzburg, D.
//! d'Humières, Phys. Rev. E 68 (2003) 066614). The times of a cell are therefore
//!
//! ```text
//! t⁺ = t / (1 - ε),     t⁻ = t' (1 - ε),     S = -σ (ρu - ρu_s),   σ = 2 C t ε / (1 - ε),    C = ¾
//! ```
//!
//! with t = 1/ω - ½ of the symmetric and t' of the antisymmetric parts of the fluid, u at the middle of the step, and
//! the part (1 - ε) F of the body force. t⁺ is exact for shear along a flat wall: a cell with a fluid fraction of 1 - ε
//! has 1/(1 - ε) times the viscosity. A full cell reverses the antisymmetric part and keeps the symmetric part, which
//! is half-way bounce-back. The collision is that of the fluid with scaled rates of its two parts.

use super::{
    Act, Cell, CoveredFluid, DensityRatios, LEAK, LightBody, SolidCollision, SolidOperatorModel,
};
use crate::collision::along;
use crate::collision::trt::AntisymmetricRate;
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// Coefficient C of the drag of a partly filled cell, in addition to its higher viscosity. It is the only fitted number
/// of the operator, from the drag of a simple cubic array of spheres (Zick and Homsy) with diameters of 8 to 12 cells.
const DRAG: f64 = 0.75;

/// Operator that scales the relaxation times of a cell with its solid fraction.
#[derive(Clone, Copy, Debug)]
pub struct ViscosityMatched;

#[cfg(not(target_arch = "nvptx64"))]
impl SolidOperatorModel for ViscosityMatched {
    fn documentation(&self) -> &'static str {
        "Relaxation times of a cell scale with those of the fluid, so that the drag in slow flow does not depend \
         on the viscosity. For BGK and TRT. It uses no weighting."
    }

    fn describe(&self) -> &'static str {
        "matched to the viscosity"
    }

    fn measured_rows(&self) -> [&'static str; 2] {
        [
            "blocks: viscosity matched",
            "blocks in gaps: viscosity matched",
        ]
    }

    fn weighted(&self) -> bool {
        false
    }

    fn needs_two_rates(&self) -> bool {
        true
    }

    fn lightest(&self, body: &LightBody) -> DensityRatios {
        let (fails, holds) = if body.flat {
            (0.4, body.by_radius(0.22, 1.35, 0.5))
        } else {
            let (slow, fast) = (
                body.by_radius(0.27, 1.1, 0.46),
                body.by_radius(0.325, 1.45, 0.5),
            );
            (0.39, body.by_time(slow, fast))
        };
        DensityRatios::for_body(body, fails, holds, 0.05)
    }

    fn lightest_in_a_bed(&self, body: &LightBody) -> f64 {
        let (size, slow) = if body.flat { (12.7, 0.85) } else { (7.7, 1.05) };
        size * body.time_in_a_bed(0.85, slow) / body.radius.powf(1.6)
    }
}

impl SolidCollision for ViscosityMatched {
    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, const Q: usize>(
        self,
        covered: &CoveredFluid,
        cell: &Cell<N>,
        before: &[N; Q],
        fluid: &[N; Q],
        g: &mut [N; Q],
    ) -> Act<N> {
        let zero = N::splat(0.0);
        let one = N::splat(1.0);
        let half = N::splat(0.5);
        let time = one / cell.omega - half;
        let leak = N::splat(LEAK) * time / (one + time);
        // `water` is the fraction of the body force that acts on the fluid; `open`, which includes the loss of full
        // cells, is the fluid fraction in the rates and in the drag.
        let water = one - cell.fraction;
        let open = cell.fraction.mul_add(leak, water);
        let odd_time = match covered.antisymmetric {
            AntisymmetricRate::AsSymmetric => time,
            AntisymmetricRate::Magic(magic) => N::splat(magic) / time,
        };
        let of_even = open * (time + half) / open.mul_add(half, time);
        let of_odd = (odd_time + half) / odd_time.mul_add(open, half);
        let pull = N::splat(DRAG) * time * cell.fraction;
        let pull = (pull + pull) / (open + pull);
        let rho = cell.drho + one;
        let mut force = [zero; 3];
        let mut gain = [zero; 3];
        let mut rest = [zero; 3];
        unroll!(axes a < 3 => {
            force[a] = (cell.ru[a] - cell.m[a]) * N::splat(2.0);
            let inside = (cell.inside[a] + cell.inside[a]) * cell.fraction;
            let own = force[a] * water + inside;
            rest[a] = zero - pull * own.mul_add(half, cell.m[a]);
            gain[a] = own + (rest[a] + pull * cell.rs[a]);
            rest[a] = rest[a] + inside;
        });
        let mixed = of_even.mul_add(fluid[0] - before[0], before[0]);
        g[0] = cell.fraction.where_zero(fluid[0], mixed);
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let c = L::C[i];
            let three = N::splat(3.0 * L::W[i]);
            let (x, y) = (before[i], before[j]);
            let (p, q) = (fluid[i] - x, fluid[j] - y);
            let even = of_even * ((p + q) * half);
            // Change of the antisymmetric part by the collision, without the force.
            let odd = (p - q) * half - three * along(c, &force);
            let odd = of_odd.mul_add(odd, three * along(c, &gain));
            let (on_i, on_j) = (x + (even + odd), y + (even - odd));
            g[i] = cell.fraction.where_zero(fluid[i], on_i);
            g[j] = cell.fraction.where_zero(fluid[j], on_j);
        });
        Act {
            rest,
            scale: pull * rho,
            share: one,
        }
    }

    fn force_left_out(self, _: &CoveredFluid, fraction: f64) -> f64 {
        fraction
    }
}
