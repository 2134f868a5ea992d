//! Common part of the operators that mix the collision of the fluid and that of the solid by B.

use super::{Act, Cell, CoveredFluid, LEAK};
use crate::collision::along;
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// A pair of opposite populations, or one at rest with its opposite missing.
pub(super) struct Pair<N> {
    /// Incoming populations along i and along its opposite.
    pub(super) incoming: [N; 2],
    /// Symmetric and antisymmetric part of the equilibrium along i at the velocity of the fluid.
    pub(super) at_fluid: [N; 2],
    /// These parts at the velocity of the solid.
    pub(super) at_solid: [N; 2],
}

/// An operator of which B is mixed with the collision of the fluid.
pub(super) trait Mixed: Copy {
    /// `true` if the weight B itself makes a full cell lose a part of what it reverses.
    const LEAKS: bool = false;

    /// Ω^s of the population at rest, from what came in and the equilibria at the velocities of fluid and solid; `keep`
    /// is 1 - ω.
    fn at_rest<N: Lanes>(incoming: N, at_fluid: N, at_solid: N, keep: N) -> N;

    /// Ω^s of a pair.
    fn pair<N: Lanes>(pair: &Pair<N>, keep: N) -> [N; 2];

    /// r of a component, and α ρ: the force on the solid is -B (α ρ u_s + r). `m` is the momentum that came in, `ru`
    /// that of the fluid.
    fn rest<N: Lanes>(m: N, ru: N, keep: N) -> N;

    /// See [`Mixed::rest`].
    fn scale<N: Lanes>(rho: N) -> N;
}

/// g* where no solid is, else f + (1 - B) (g* - f) + B Ω^s.
#[inline(always)]
fn turned<N: Lanes>(g: N, before: N, solid: N, b: N) -> N {
    let mixed = b.mul_add(solid - (g - before), g);
    b.where_zero(g, mixed)
}

/// B of cells filled by `fraction`.
#[inline(always)]
pub(super) fn weight<M: Mixed, N: Lanes>(fluid: &CoveredFluid, fraction: N) -> N {
    let b = fluid.weighting.weight(fluid.time, fraction);
    if M::LEAKS {
        b * N::splat(1.0 - LEAK)
    } else {
        b
    }
}

/// Mixes the collision of the fluid, which left `fluid`, with that of the solid.
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
    // At rest no direction: the symmetric part alone.
    let even_u = cell.even::<L, Q>(0, cell.uu, zero);
    let even_s = cell.even::<L, Q>(0, cell.ss, zero);
    let solid = M::at_rest(before[0], even_u, even_s, keep);
    g[0] = turned(fluid[0], before[0], solid, b);
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
        let pair = Pair {
            incoming: [x, y],
            at_fluid: [even_u, odd_u],
            at_solid: [even_s, odd_s],
        };
        let [on_i, on_j] = M::pair(&pair, keep);
        g[i] = turned(fluid[i], x, on_i, b);
        g[j] = turned(fluid[j], y, on_j, b);
    });
    let mut rest = [zero; 3];
    unroll!(axes a < 3 => {
        rest[a] = M::rest(cell.m[a], cell.ru[a], keep);
    });
    Act {
        rest,
        scale: M::scale(cell.drho + N::splat(1.0)),
        share: b,
    }
}
