//! Interface of collision operators to the pass, access to the populations of a cell, and the common moments.
//!
//! The interface is separate from the descriptions of the operators, because it uses the core library only and is also
//! compiled for GPUs.

use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// Access to the populations of one cell, or of several consecutive cells.
///
/// On a processor a site is the memory of the lattice. An operator reads a pair of opposite populations for the moments
/// and again before it replaces them, which is faster than keeping 27 populations in fewer registers. Outgoing
/// population i is written to the address from which its opposite was read; both populations of a pair must therefore
/// be read before either is written.
pub trait Site<N, const Q: usize> {
    /// Returns the incoming deviation f_i - w_i along direction i.
    fn incoming(&self, i: usize) -> N;
    /// Writes the outgoing deviation along direction i.
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

/// Collision operator: the change of the populations of one cell, or of several consecutive cells, in a step.
pub trait Collision: Copy + Send + Sync {
    /// Name of the GPU kernels of the operator, without velocity set and storage type; `None` if there are no kernels.
    const ON_GPU: Option<&'static str> = None;
    /// Relaxation rates of a cell, computed from that of the shear stress, ω = 1/τ.
    type Rates<N: Lanes>: Copy;
    /// Returns the rates for the uniform viscosity of the fluid.
    fn uniform<N: Lanes>(&self) -> Self::Rates<N>;
    /// Returns the rates of a cell with the rate `omega` of the shear stress, for a viscosity per cell.
    fn local<N: Lanes>(&self, omega: N) -> Self::Rates<N>;
    /// Replaces incoming deviations by outgoing ones and returns the velocity, which includes half the body force. All
    /// calls of a step have the same `self`.
    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        rates: &Self::Rates<N>,
    ) -> [N; 3];
}

/// Moments of a cell for operators with one or two rates.
///
/// The equilibrium w [δρ + 3 c·m + (9/2 (c·m)² - 3/2 m²)/ρ] needs the division by ρ in its last terms only. Written in
/// m instead of u, all products are computed while the processor divides, so that a vector of cells waits less.
pub(crate) struct Moments<N> {
    /// Density deviation δρ.
    pub(crate) drho: N,
    /// Momentum density m = Σ c g + F/2.
    pub(crate) m: [N; 3],
    /// Product 3/2 m·m.
    pub(crate) square: N,
    /// Specific volume 1/ρ.
    pub(crate) volume: N,
}

impl<N: Lanes> Moments<N> {
    /// Computes the moments from the pairs of opposite populations; `half_force` is F/2.
    #[inline(always)]
    pub(crate) fn from_pairs<L: Lattice<Q>, G: Site<N, Q>, const Q: usize>(
        g: &G,
        half_force: [f64; 3],
    ) -> Self {
        let zero = N::splat(0.0);
        // Two partial sums shorten the chain of dependent additions.
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
        let volume = N::splat(1.0) / (N::splat(1.0) + drho);
        let mut square = zero;
        unroll!(axes a < L::DIMENSION => {
            square = m[a].mul_add(m[a], square);
        });
        Self {
            drho,
            m,
            square: square * N::splat(1.5),
            volume,
        }
    }

    /// Returns the velocity m/ρ.
    #[inline(always)]
    pub(crate) fn velocity(&self) -> [N; 3] {
        // Without a call of `map`, which a build with few optimisations leaves outside the vector code.
        let [x, y, z] = self.m;
        [x * self.volume, y * self.volume, z * self.volume]
    }
}

/// Returns c·v for a constant direction by additions and subtractions of components, without multiplications.
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
