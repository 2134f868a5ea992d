//! Parts of the kernel of an operator: the populations of a cell, the moments that every operator needs, and the
//! interface of the kernels to the pass. Nothing here needs more than numbers, so that the same source runs on
//! processors and on GPUs.

use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// The populations of one cell, or of several side by side, each to be read and replaced.
///
/// The pass hands out the lattice itself: an operator that works pair by pair reads a pair again before it replaces it,
/// which costs less than 27 registers that do not exist. Population i goes where its opposite was read, so a pair is
/// read before either is replaced.
pub trait Site<N, const Q: usize> {
    /// Deviation that came in along direction i.
    fn incoming(&self, i: usize) -> N;
    /// Deviation that leaves along direction i.
    fn leave(&mut self, i: usize, outgoing: N);
}

impl<N: Copy, const Q: usize> Site<N, Q> for [N; Q] {
    #[inline(always)]
    fn incoming(&self, i: usize) -> N {
        self[i]
    }
    #[inline(always)]
    fn leave(&mut self, i: usize, outgoing: N) {
        self[i] = outgoing;
    }
}

/// Change of the populations of one cell (or of several side by side) in a step.
pub trait Collision: Copy + Send + Sync {
    /// Name of its kernels on GPUs, without velocity set and storage; none where there are none.
    const ON_GPU: Option<&'static str> = None;
    /// Relaxation rates of a cell, made from that of the shear stress, ω = 1/τ.
    type Rates<N: Lanes>: Copy;
    /// The rates where all cells have the same viscosity.
    fn uniform<N: Lanes>(&self) -> Self::Rates<N>;
    /// The rates of a cell whose viscosity is its own.
    fn local<N: Lanes>(&self, omega: N) -> Self::Rates<N>;
    /// Replaces incoming deviations by outgoing ones and returns the velocity. Every call sees the same `self` during
    /// one step.
    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        rates: &Self::Rates<N>,
    ) -> [N; 3];
}

/// The moments that every operator needs.
pub(crate) struct Moments<N> {
    /// Density deviation δρ.
    pub(crate) drho: N,
    /// Momentum m = Σ c g + F/2.
    pub(crate) m: [N; 3],
    /// Velocity u = m / ρ.
    pub(crate) u: [N; 3],
    /// m·u
    pub(crate) mu: N,
}

impl<N: Lanes> Moments<N> {
    /// Sums over the pairs of a cell; `half_force` is F/2.
    #[inline(always)]
    pub(crate) fn from_pairs<L: Lattice<Q>, G: Site<N, Q>, const Q: usize>(
        g: &G,
        half_force: [f64; 3],
    ) -> Self {
        let zero = N::splat(0.0);
        // Two sums, so that an addition need not wait for the one before.
        let mut drho = [g.incoming(0), zero];
        let mut m = [
            N::splat(half_force[0]),
            N::splat(half_force[1]),
            N::splat(half_force[2]),
        ];
        unroll!(pairs k < (Q - 1) / 2 => {
            let (i, j) = L::PAIRS[k];
            let (one, other) = (g.incoming(i), g.incoming(j));
            drho[k % 2] = drho[k % 2] + (one + other);
            let odd = one - other;
            let c = L::C[i];
            unroll!(axes a < L::DIMENSION => {
                match c[a] {
                    1 => m[a] = m[a] + odd,
                    -1 => m[a] = m[a] - odd,
                    _ => {}
                }
            });
        });
        let drho = drho[0] + drho[1];
        let inverse = N::splat(1.0) / (N::splat(1.0) + drho);
        let mut u = [zero; 3];
        let mut mu = zero;
        unroll!(axes a < L::DIMENSION => {
            u[a] = m[a] * inverse;
            mu = m[a].mul_add(u[a], mu);
        });
        Self { drho, m, u, mu }
    }
}

/// c·v for a constant direction: adds and subtracts components, never multiplies.
#[inline(always)]
pub(crate) fn along<N: Lanes>(c: [i8; 3], v: &[N; 3]) -> N {
    let mut sum: Option<N> = None;
    unroll!(axes a < 3 => {
        sum = match (c[a], sum) {
            (0, s) => s,
            (1, None) => Some(v[a]),
            (1, Some(s)) => Some(s + v[a]),
            (_, None) => Some(N::splat(0.0) - v[a]),
            (_, Some(s)) => Some(s - v[a]),
        };
    });
    sum.unwrap_or_else(|| N::splat(0.0))
}
