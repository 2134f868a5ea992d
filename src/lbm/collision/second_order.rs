//! The kernel of multiple relaxation times if only the second moments have rates of their own: the operator of [`super::mrt`] with
//! all higher rates 1, the default of `lbmpy` and others.
//!
//! A rate of 1 sets a moment to its equilibrium, independently of its incoming value, so that only ten sums of the populations are needed.
//! With J = Σ c g + F, Q_ab = m_a u_b + (F_a u_b + F_b u_a)/2 (the remainder of Guo's source at a rate of 1) and the difference of the
//! second moments from that,
//!
//! D_a = (1 - s4) e + (1 - ω) [(P_a - P_a^eq) - e],   e = Σ_a (P_a - P_a^eq)/3,   E_ab = (1 - ω) (c_a c_b - m_a u_b),
//!
//! the outgoing populations are, in the basis of Suga with P_a = 3 c_a² - 2,
//!
//! g_i = w_i [δρ + 3 c·J + 9/2 Σ Q_ab c_a c_b - 3/2 tr Q] + Σ_a D_a P_a(c)/54 + Σ_{a<b} E_ab c_a c_b/12,
//!
//! which is even in c except for 3 w c·J: opposite populations are a sum and a difference. Compiled for AVX-512 this takes 221 operations
//! instead of 328.

use super::products::{POPULATION, n};
use super::{Collision, Site};
use crate::lbm::lanes::Lanes;
use crate::lbm::lattice::{Lattice, unroll};

/// MRT on D3Q27 with all rates above those of the second moments 1, with a uniform body force where `FORCED`.
#[derive(Clone, Copy, Debug)]
pub struct SecondOrder<const FORCED: bool> {
    /// Rate of the shear stress 1/τ.
    pub omega: f64,
    /// s4, of the trace of the stress.
    pub bulk: f64,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// Numbers (rest, +, -) to moments (1, c, c²).
#[inline(always)]
fn moments<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3] {
    let sum = plus + minus;
    [rest + sum, plus - minus, sum]
}

impl<const FORCED: bool> Collision for SecondOrder<FORCED> {
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
        const { assert!(Q == 27, "the moments of Suga are those of D3Q27") };
        // Of each plane of c_z: 1, c_x, c_y, c_x², c_y², c_x c_y.
        let mut planes = [[n::<N>(0.0); 3]; 6];
        unroll!(axes z < 3 => {
            let mut rows = [[n::<N>(0.0); 3]; 3];
            unroll!(axes y < 3 => {
                rows[y] = moments(
                    g.incoming(POPULATION[0][y][z]),
                    g.incoming(POPULATION[1][y][z]),
                    g.incoming(POPULATION[2][y][z]),
                );
            });
            let [one, c, square] = moments(rows[0][0], rows[1][0], rows[2][0]);
            planes[0][z] = one;
            planes[1][z] = rows[0][1] + (rows[1][1] + rows[2][1]);
            planes[2][z] = c;
            planes[3][z] = rows[0][2] + (rows[1][2] + rows[2][2]);
            planes[4][z] = square;
            planes[5][z] = rows[1][1] - rows[2][1];
        });
        let mut total = [n::<N>(0.0); 6];
        unroll!(six k < 6 => {
            total[k] = planes[k][0] + (planes[k][1] + planes[k][2]);
        });
        let [drho, jz, zz] = moments(planes[0][0], planes[0][1], planes[0][2]);
        let j = [total[1], total[2], jz];
        let diagonal = [total[3], total[4], zz];
        let off = [
            total[5],
            planes[2][1] - planes[2][2],
            planes[1][1] - planes[1][2],
        ];

        let mut m = j;
        let mut after = j;
        if FORCED {
            unroll!(axes a < 3 => {
                m[a] = j[a] + n::<N>(0.5 * self.force[a]);
                after[a] = j[a] + n::<N>(self.force[a]);
            });
        }
        let inverse = N::splat(1.0) / (N::splat(1.0) + drho);
        let u = [m[0] * inverse, m[1] * inverse, m[2] * inverse];
        // Equilibrium that the second moments relax to, and that which the others take: they differ by the source.
        let mut square = [m[0] * u[0], m[1] * u[1], m[2] * u[2]];
        let mut cross = [m[0] * u[1], m[1] * u[2], m[2] * u[0]];
        let (mut high_square, mut high_cross) = (square, cross);
        if FORCED {
            unroll!(axes a < 3 => {
                let b = (a + 1) % 3;
                let (fa, fb) = (n::<N>(self.force[a]), n::<N>(self.force[b]));
                let source = fa * u[a];
                square[a] = square[a] - source;
                high_square[a] = high_square[a] + source;
                let source = fa.mul_add(u[b], fb * u[a]) * n::<N>(0.5);
                cross[a] = cross[a] - source;
                high_cross[a] = high_cross[a] + source;
            });
        }

        // P_a of what came in less that of equilibrium, over 3: Σ c_a² g - (2/3 δρ - δρ/3 + Q_aa).
        let mut off_balance = [n::<N>(0.0); 3];
        let third = drho * n::<N>(1.0 / 3.0);
        unroll!(axes a < 3 => {
            off_balance[a] = diagonal[a] - (third + square[a]);
        });
        let keep = n::<N>(1.0) - omega;
        let sum = off_balance[0] + off_balance[1] + off_balance[2];
        // D_a/3: the trace at a rate of its own.
        let mean = sum * ((omega - n::<N>(self.bulk)) * n::<N>(1.0 / 3.0));
        let trace = high_square[0] + high_square[1] + high_square[2];
        let common = trace.neg_mul_add(n::<N>(1.5), drho);
        // Σ D_a/27.
        let all = sum * n::<N>((1.0 - self.bulk) / 9.0);

        let mut axis = [n::<N>(0.0); 3];
        let mut edge = [n::<N>(0.0); 3];
        let first = common.mul_add(n::<N>(2.0 / 27.0), n::<N>(0.0) - all);
        unroll!(axes a < 3 => {
            // D_a/18.
            let part = off_balance[a].mul_add(keep, mean) * n::<N>(1.0 / 6.0);
            axis[a] = high_square[a].mul_add(n::<N>(1.0 / 3.0), part) + first;
            edge[a] = high_square[a].mul_add(n::<N>(1.0 / 12.0), part);
        });
        let mut between = [n::<N>(0.0); 3];
        let mut corner = [n::<N>(0.0); 3];
        unroll!(axes a < 3 => {
            let part = (off[a] - cross[a]) * (keep * n::<N>(1.0 / 12.0));
            between[a] = high_cross[a].mul_add(n::<N>(1.0 / 6.0), part);
            corner[a] = high_cross[a].mul_add(n::<N>(1.0 / 24.0), part);
        });
        let at = |x: usize, y: usize, z: usize| POPULATION[x][y][z];
        g.leave(
            at(0, 0, 0),
            common.mul_add(n::<N>(8.0 / 27.0), n::<N>(0.0) - all),
        );
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 0, 0][a], [0, 1, 0][a], [0, 0, 1][a]);
            let odd = after[a] * n::<N>(2.0 / 9.0);
            g.leave(at(x, y, z), axis[a] + odd);
            g.leave(at(2 * x, 2 * y, 2 * z), axis[a] - odd);
        });
        let second = common.mul_add(n::<N>(1.0 / 54.0), n::<N>(0.0) - all);
        let j = [
            after[0] * n::<N>(1.0 / 18.0),
            after[1] * n::<N>(1.0 / 18.0),
            after[2] * n::<N>(1.0 / 18.0),
        ];
        unroll!(axes a < 3 => {
            let b = (a + 1) % 3;
            // 1 along a and `sign` along b.
            let (x, y, z) = ([1, 0, 1][a], [1, 1, 0][a], [0, 1, 1][a]);
            let even = second + (edge[a] + edge[b]);
            let (same, other) = (even + between[a], even - between[a]);
            let (sum, difference) = (j[a] + j[b], j[a] - j[b]);
            g.leave(at(x, y, z), same + sum);
            g.leave(at(2 * x, 2 * y, 2 * z), same - sum);
            let (x, y, z) = ([1, 0, 2][a], [2, 1, 0][a], [0, 2, 1][a]);
            g.leave(at(x, y, z), other + difference);
            let opposite = [0, 2, 1];
            g.leave(at(opposite[x], opposite[y], opposite[z]), other - difference);
        });
        // Σ D_a P_a/54 is Σ D_a/54 here.
        let third = trace.mul_add(
            n::<N>(1.0 / 48.0),
            common.mul_add(n::<N>(1.0 / 216.0), all * n::<N>(0.5)),
        );
        let j = [
            after[0] * n::<N>(1.0 / 72.0),
            after[1] * n::<N>(1.0 / 72.0),
            after[2] * n::<N>(1.0 / 72.0),
        ];
        let (same, other) = (third + corner[0], third - corner[0]);
        let (sum, difference) = (corner[1] + corner[2], corner[1] - corner[2]);
        let (jsum, jdifference) = (j[0] + j[1], j[0] - j[1]);
        let even = [
            same + sum,
            same - sum,
            other - difference,
            other + difference,
        ];
        let odd = [
            jsum + j[2],
            jsum - j[2],
            jdifference + j[2],
            jdifference - j[2],
        ];
        unroll!(four k < 4 => {
            let (x, y, z) = ([1, 1, 1, 1][k], [1, 1, 2, 2][k], [1, 2, 1, 2][k]);
            g.leave(at(x, y, z), even[k] + odd[k]);
            let opposite = [0, 2, 1];
            g.leave(at(opposite[x], opposite[y], opposite[z]), even[k] - odd[k]);
        });
        u
    }
}
#[cfg(test)]
mod tests {
    use super::super::mrt::{Mrt, Rates};
    use super::*;
    use crate::lbm::lattice::D3Q27;

    fn collided<C: Collision>(operator: &C, g: &[f64; 27]) -> ([f64; 27], [f64; 3]) {
        let mut g = *g;
        let u = operator.collide::<D3Q27, f64, _, 27>(&mut g, &operator.uniform());
        (g, u)
    }

    /// The operator of Suga, which is tested against the published matrix, with these rates.
    #[test]
    fn it_is_the_general_operator_with_the_higher_rates_at_one() {
        let force = [0.011, -0.007, 0.003];
        for seed in 0..20_u64 {
            let g = std::array::from_fn(|i| {
                let x = (seed * 27 + i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11;
                (x as f64 / (1_u64 << 53) as f64 - 0.5) * 0.2 * D3Q27::W[i].sqrt()
            });
            for (omega, bulk) in [(0.3, 1.54), (1.1, 1.0), (1.99, 0.7)] {
                let rates = Rates {
                    bulk,
                    ..Rates::two(1.0, 1.0)
                };
                assert!(rates.second_order() && !Rates::SUGA.second_order());
                let pairs = [
                    (
                        collided(&SecondOrder::<true> { omega, bulk, force }, &g),
                        collided(
                            &Mrt::<true> {
                                omega,
                                rates,
                                force,
                            },
                            &g,
                        ),
                    ),
                    (
                        collided(&SecondOrder::<false> { omega, bulk, force }, &g),
                        collided(
                            &Mrt::<false> {
                                omega,
                                rates,
                                force,
                            },
                            &g,
                        ),
                    ),
                ];
                for ((one, u), (other, v)) in pairs {
                    for i in 0..27 {
                        let d = (one[i] - other[i]).abs();
                        assert!(d < 2e-16 * 27.0, "{i}: {} {}", one[i], other[i]);
                    }
                    assert!((0..3).all(|a| (u[a] - v[a]).abs() < 1e-15));
                }
            }
        }
    }
}
