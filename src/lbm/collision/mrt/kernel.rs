//! Kernel of the operator with multiple relaxation times ([`super`]).
//!
//! It is separate from the description of the operator, because it is also compiled for GPUs.

use crate::collision::kernel::{Collision, Site};
use crate::collision::products::{self, Basis, n};
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// Relaxation rates of all moments except the shear stress, with the names of Suga et al. (2015).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Rates {
    /// s4, rate of the trace e of the stress.
    pub bulk: f64,
    /// s10, rate of q = Σ c_a (K_b + K_c).
    pub q: f64,
    /// s13, rate of Ψ = c_a K_b K_c.
    pub psi: f64,
    /// s16, rate of ε.
    pub epsilon: f64,
    /// s17, rate of e³.
    pub e_cubed: f64,
    /// s18, rate of XX and WW.
    pub xx: f64,
    /// s20, rate of XY, YZ and ZX.
    pub xy: f64,
    /// s23, rate of τ_x, τ_y and τ_z.
    pub tau: f64,
    /// s26, rate of XYZ.
    pub xyz: f64,
}

impl Rates {
    /// Rates of Suga et al. (2015), tuned for turbulent flow.
    pub const SUGA: Self = Self {
        bulk: 1.54,
        q: 1.5,
        psi: 1.83,
        epsilon: 1.4,
        e_cubed: 1.61,
        xx: 1.98,
        xy: 1.98,
        tau: 1.74,
        xyz: 1.74,
    };

    /// Returns rates with one value for the even moments and one for the odd ones, which make the operator TRT.
    #[must_use]
    pub fn two(even: f64, odd: f64) -> Self {
        Self {
            bulk: even,
            q: odd,
            psi: odd,
            epsilon: even,
            e_cubed: even,
            xx: even,
            xy: even,
            tau: odd,
            xyz: odd,
        }
    }

    /// Returns `true` if all rates above those of the second moments are 1, so that the higher moments are set to
    /// equilibrium.
    #[must_use]
    pub fn second_order(&self) -> bool {
        *self
            == Self {
                bulk: self.bulk,
                ..Self::two(1.0, 1.0)
            }
    }
}

/// MRT operator, with a uniform body force if `FORCED`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Mrt<const FORCED: bool> {
    /// Relaxation rate of the shear stress, 1/τ (s5 = s7).
    pub omega: f64,
    /// Rates of the other moments.
    pub rates: Rates,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// Basis of the polynomials 1, c and K = 1 - 3c². The inverse transform takes their moments times 1/6, 1/2 and 1/3.
struct Polynomials;

impl Basis for Polynomials {
    #[inline(always)]
    fn analyse<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3] {
        let sum = plus + minus;
        [
            rest + sum,
            plus - minus,
            sum.neg_mul_add(N::splat(2.0), rest),
        ]
    }

    #[inline(always)]
    fn compose<N: Lanes>([one, c, k]: [N; 3]) -> [N; 3] {
        let both = k.neg_mul_add(N::splat(0.5), one);
        [one.mul_add(N::splat(4.0), k), both + c, both - c]
    }
}

/// Returns the factor of the moment of the product of polynomials a, b and c (0: 1, 1: c, 2: K) for the inverse
/// transform.
const fn scale(a: usize, b: usize, c: usize) -> f64 {
    const NORM: [f64; 3] = [6.0, 2.0, 3.0];
    1.0 / (NORM[a] * NORM[b] * NORM[c])
}

impl<const FORCED: bool> Collision for Mrt<FORCED> {
    const ON_GPU: Option<&'static str> = Some(if FORCED { "forced_mrt" } else { "mrt" });
    type Rates<N: Lanes> = N;

    #[inline(always)]
    fn uniform<N: Lanes>(&self) -> N {
        N::splat(self.omega)
    }

    #[inline(always)]
    fn local<N: Lanes>(&self, omega: N) -> N {
        omega
    }

    #[inline(always)]
    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        &omega: &N,
    ) -> [N; 3] {
        const { assert!(Q == 27, "these moments are those of D3Q27") };
        let mut t = products::moments::<Polynomials, N, G, Q>(g);
        let drho = t[0][0][0];
        let mut force = [N::splat(0.0); 3];
        let mut m = [t[1][0][0], t[0][1][0], t[0][0][1]];
        if FORCED {
            unroll!(axes a < 3 => {
                force[a] = n::<N>(self.force[a]);
                m[a] = m[a] + n::<N>(0.5 * self.force[a]);
            });
        }
        let inverse = N::splat(1.0) / (N::splat(1.0) + drho);
        let u = [m[0] * inverse, m[1] * inverse, m[2] * inverse];

        // Second moments of the equilibrium, q = m_a u_b. With a force, s = (F_a u_b + F_b u_a)/2 is half the source: a
        // moment t relaxes to t - rate (t - (q - s)) + 2s.
        let mut square = [m[0] * u[0], m[1] * u[1], m[2] * u[2]];
        let mut cross = [m[0] * u[1], m[1] * u[2], m[2] * u[0]];
        let mut square_source = [n::<N>(0.0); 3];
        let mut cross_source = [n::<N>(0.0); 3];
        if FORCED {
            unroll!(axes a < 3 => {
                let b = (a + 1) % 3;
                square_source[a] = force[a] * u[a];
                cross_source[a] = force[a].mul_add(u[b], force[b] * u[a]) * n::<N>(0.5);
                square[a] = square[a] - square_source[a];
                cross[a] = cross[a] - cross_source[a];
            });
        }
        let k = &self.rates;

        // The moments K_a have the equilibria -3 m_a u_a. The deviations relax at the rate of the shear stress, their
        // mean at the bulk rate.
        let mut above = [n::<N>(0.0); 3];
        let diagonal = [t[2][0][0], t[0][2][0], t[0][0][2]];
        unroll!(axes a < 3 => {
            above[a] = square[a].mul_add(n::<N>(3.0), diagonal[a]);
        });
        let mean =
            (above[0] + above[1] + above[2]) * ((n::<N>(k.bulk) - omega) * n::<N>(1.0 / 3.0));
        unroll!(axes a < 3 => {
            let mut value = above[a].neg_mul_add(omega, diagonal[a]) - mean;
            if FORCED {
                value = square_source[a].neg_mul_add(n::<N>(6.0), value);
            }
            let (x, y, z) = ([2, 0, 0][a], [0, 2, 0][a], [0, 0, 2][a]);
            t[x][y][z] = value * n::<N>(scale(2, 0, 0));
        });
        // The moments c_a c_b have the equilibria m_a u_b.
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 0, 1][a], [1, 1, 0][a], [0, 1, 1][a]);
            let mut value = (cross[a] - t[x][y][z]).mul_add(omega, t[x][y][z]);
            if FORCED {
                value = cross_source[a].mul_add(n::<N>(2.0), value);
            }
            t[x][y][z] = value * n::<N>(scale(1, 1, 0));
        });
        // All other moments have an equilibrium and a source of 0. Here, c_a K_b and c_a K_c, whose sum and difference
        // have a rate each, and c_a K_b K_c.
        let stays = n::<N>((1.0 - 0.5 * (k.q + k.tau)) * scale(1, 2, 0));
        let crosses = n::<N>(0.5 * (k.tau - k.q) * scale(1, 2, 0));
        unroll!(axes a < 3 => {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            let at = |pb: usize, pc: usize| {
                let mut place = [0; 3];
                place[a] = 1;
                place[b] = pb;
                place[c] = pc;
                place
            };
            let [first, second, third] = [at(2, 0), at(0, 2), at(2, 2)];
            let (p, q, psi) = (
                t[first[0]][first[1]][first[2]],
                t[second[0]][second[1]][second[2]],
                t[third[0]][third[1]][third[2]],
            );
            t[first[0]][first[1]][first[2]] = q.mul_add(crosses, p * stays);
            t[second[0]][second[1]][second[2]] = p.mul_add(crosses, q * stays);
            t[third[0]][third[1]][third[2]] = psi * n::<N>((1.0 - k.psi) * scale(1, 2, 2));
        });
        // K_a K_b, whose sum and differences have a rate each, and K_x K_y K_z.
        let quartic = [t[0][2][2], t[2][0][2], t[2][2][0]];
        let mean = (quartic[0] + quartic[1] + quartic[2])
            * n::<N>((k.xx - k.epsilon) / 3.0 * scale(2, 2, 0));
        unroll!(axes a < 3 => {
            let (x, y, z) = ([0, 2, 2][a], [2, 0, 2][a], [2, 2, 0][a]);
            t[x][y][z] = quartic[a].mul_add(n::<N>((1.0 - k.xx) * scale(2, 2, 0)), mean);
        });
        t[2][2][2] = t[2][2][2] * n::<N>((1.0 - k.e_cubed) * scale(2, 2, 2));
        // c_a c_b K_c and c_x c_y c_z.
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 2, 1][a], [1, 1, 2][a], [2, 1, 1][a]);
            t[x][y][z] = t[x][y][z] * n::<N>((1.0 - k.xy) * scale(1, 1, 2));
        });
        t[1][1][1] = t[1][1][1] * n::<N>((1.0 - k.xyz) * scale(1, 1, 1));
        t[0][0][0] = drho * n::<N>(scale(0, 0, 0));
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 0, 0][a], [0, 1, 0][a], [0, 0, 1][a]);
            if FORCED {
                t[x][y][z] = t[x][y][z] + force[a];
            }
            t[x][y][z] = t[x][y][z] * n::<N>(scale(1, 0, 0));
        });

        products::leave::<Polynomials, N, G, Q>(g, t);
        u
    }
}
