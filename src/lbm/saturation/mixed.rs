//! Common part of the operators that mix the fluid collision and the solid collision with the weight B.
//!
//! It is separate from the operators, which define the solid collision Ω^s of a pair of populations only.

use super::{Act, Cell, CoveredFluid, LEAK};
use crate::collision::along;
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// Pair of opposite populations with its equilibria.
pub(super) struct Pair<N> {
    /// Incoming populations along i and along the opposite direction, with half of the body force inside solids.
    pub(super) incoming: [N; 2],
    /// Symmetric and antisymmetric parts of the equilibrium along i at the velocity of the fluid.
    pub(super) at_fluid: [N; 2],
    /// Symmetric and antisymmetric parts of the equilibrium along i at the velocity of the solid.
    pub(super) at_solid: [N; 2],
}

/// Solid collision operator that is mixed with the fluid collision with the weight B.
pub(super) trait Mixed: Copy {
    /// `true` if the loss of a full cell ([`LEAK`]) is part of the weight B, `false` if it is part of Ω^s.
    const LEAKS: bool = false;

    /// Returns Ω^s of the rest population, given the incoming population and the equilibria at the velocities of fluid
    /// and solid; `keep` is 1 - ω.
    fn at_rest<N: Lanes>(incoming: N, at_fluid: N, at_solid: N, keep: N) -> N;

    /// Returns Ω^s of a pair along i and along the opposite direction; `keep` is 1 - ω.
    fn pair<N: Lanes>(pair: &Pair<N>, keep: N) -> [N; 2];

    /// Returns a component of r in the force on the solid, -B (α ρ u_s + r). `m` is the momentum Σ c f of the incoming
    /// populations, `ru` that of the fluid with half the force, and `keep` is 1 - ω.
    fn rest<N: Lanes>(m: N, ru: N, keep: N) -> N;

    /// Returns α ρ in the force on the solid, -B (α ρ u_s + r).
    fn scale<N: Lanes>(rho: N) -> N;
}

/// Returns f + (1 - B) (g* - f) + B Ω^s, or g* in lanes without solid: `g` is g*, the population after the fluid
/// collision, `before` is f.
#[inline(always)]
fn mix<N: Lanes>(g: N, before: N, solid: N, b: N) -> N {
    let mixed = b.mul_add(solid - (g - before), g);
    b.where_zero(g, mixed)
}

/// Returns B of cells with solid fractions `fraction`.
#[inline(always)]
pub(super) fn weight<M: Mixed, N: Lanes>(fluid: &CoveredFluid, fraction: N) -> N {
    let b = fluid.weighting.weight(fluid.time, fraction);
    if M::LEAKS {
        b * N::splat(1.0 - LEAK)
    } else {
        b
    }
}

/// Mixes the fluid collision, whose result is `fluid`, with the solid collision; see
/// [`super::SolidCollision::collide`].
#[inline(always)]
pub(super) fn collide<M: Mixed, L: Lattice<Q>, N: Lanes, const Q: usize>(
    covered: &CoveredFluid,
    cell: &Cell<N>,
    before: &[N; Q],
    fluid: &[N; Q],
    g: &mut [N; Q],
) -> Act<N> {
    let zero = N::splat(0.0);
    let b = weight::<M, N>(covered, cell.fraction);
    let keep = N::splat(1.0) - cell.omega;
    // The equilibrium of the rest population has a symmetric part only.
    let even_u = cell.even::<L, Q>(0, cell.uu, zero);
    let even_s = cell.even::<L, Q>(0, cell.ss, zero);
    let solid = M::at_rest(before[0], even_u, even_s, keep);
    g[0] = mix(fluid[0], before[0], solid, b);
    unroll!(pairs k < (Q - 1) / 2 => {
        let (i, j) = L::PAIRS[k];
        let c = L::C[i];
        let three = N::splat(3.0 * L::W[i]);
        let (cu, cs) = (along(c, &cell.u), along(c, &cell.us));
        let (mu, ms) = (along(c, &cell.ru), along(c, &cell.rs));
        let even_u = cell.even::<L, Q>(i, cell.uu, mu * cu);
        let even_s = cell.even::<L, Q>(i, cell.ss, ms * cs);
        let (odd_u, odd_s) = (three * mu, three * ms);
        let (x, y) = (before[i], before[j]);
        let inside = three * along(c, &cell.inside);
        let pair = Pair {
            incoming: [x + inside, y - inside],
            at_fluid: [even_u, odd_u],
            at_solid: [even_s, odd_s],
        };
        let [on_i, on_j] = M::pair(&pair, keep);
        let inside = inside + inside;
        g[i] = mix(fluid[i], x, on_i + inside, b);
        g[j] = mix(fluid[j], y, on_j - inside, b);
    });
    let mut rest = [zero; 3];
    unroll!(axes a < 3 => {
        let half = cell.inside[a];
        rest[a] = M::rest(cell.m[a] + half, cell.ru[a], keep) + (half + half);
    });
    Act {
        rest,
        scale: M::scale(cell.drho + N::splat(1.0)),
        share: b,
    }
}
