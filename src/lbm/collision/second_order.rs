//! Kernel of multiple relaxation times with all rates above those of the second moments equal to 1: the default of
//! `lbmpy` and other codes, also called regularised (J. Latt, B. Chopard, Math. Comput. Simul. 72 (2006) 165).
//!
//! It is separate from [`super::mrt`] because it needs only ten sums of the populations: a rate of 1 sets a moment to
//! its equilibrium, independently of its incoming value. With m = Σ c g + F/2 and u = m/ρ, let
//!
//! J = Σ c g + F,   Q_ab = m_a u_b - (F_a u_b + F_b u_a)/2,
//!
//! the deviations of the second moments from equilibrium be
//!
//! N_ab = Σ c_a c_b g - (δρ/3 δ_ab + Q_ab),   e = Σ_a N_aa/3,
//!
//! and the outgoing second moments, relaxed, with the source of Guo and without the isotropic part δρ/3, be
//!
//! B_ab = (1 - ω) N_ab + (ω - s4) e δ_ab + Q_ab + F_a u_b + F_b u_a.
//!
//! The outgoing populations are then
//!
//! g_i = w_i [δρ - 3/2 Σ_a B_aa + 3 c·J + 9/2 Σ_a B_aa c_a² + 9 Σ_{a<b} B_ab c_a c_b].
//!
//! All terms except 3 w c·J are even in c, so that a pair of opposite populations is the sum and the difference of two
//! terms.

use super::kernel::{Collision, Site};
use super::products::{POPULATION, n};
use crate::lanes::Lanes;
use crate::lattice::{Lattice, unroll};

/// MRT operator on D3Q27 with rates of 1 above the second moments, with a uniform body force if `FORCED`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SecondOrder<const FORCED: bool> {
    /// Relaxation rate of the shear stress, 1/τ.
    pub omega: f64,
    /// s4, relaxation rate of the trace of the stress.
    pub bulk: f64,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// Returns the moments of 1, c and c² of the populations with component 0, +1 and -1.
#[inline(always)]
fn moments<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3] {
    let sum = plus + minus;
    [rest + sum, plus - minus, sum]
}

/// Writes the outgoing populations with the moments δρ, J (`after`), B_aa (`second`) and B_xy, B_yz, B_zx (`mixed`).
#[inline(always)]
fn leave<N: Lanes, G: Site<N, Q>, const Q: usize>(
    g: &mut G,
    drho: N,
    after: [N; 3],
    second: [N; 3],
    mixed: [N; 3],
) {
    let trace = second[0] + second[1] + second[2];
    let common = trace.neg_mul_add(n::<N>(1.5), drho);

    let at = |x: usize, y: usize, z: usize| POPULATION[x][y][z];
    g.leave(at(0, 0, 0), common * n::<N>(8.0 / 27.0));
    let first = common * n::<N>(2.0 / 27.0);
    unroll!(axes a < 3 => {
        let (x, y, z) = ([1, 0, 0][a], [0, 1, 0][a], [0, 0, 1][a]);
        let even = second[a].mul_add(n::<N>(1.0 / 3.0), first);
        g.leave(at(x, y, z), after[a].mul_add(n::<N>(2.0 / 9.0), even));
        g.leave(
            at(2 * x, 2 * y, 2 * z),
            after[a].neg_mul_add(n::<N>(2.0 / 9.0), even),
        );
    });
    let edge = common * n::<N>(1.0 / 54.0);
    unroll!(axes a < 3 => {
        let b = (a + 1) % 3;
        // The pair with equal components along a and b, then the pair with opposite components.
        let (x, y, z) = ([1, 0, 1][a], [1, 1, 0][a], [0, 1, 1][a]);
        let even = (second[a] + second[b]).mul_add(n::<N>(1.0 / 12.0), edge);
        let same = mixed[a].mul_add(n::<N>(1.0 / 6.0), even);
        let other = mixed[a].neg_mul_add(n::<N>(1.0 / 6.0), even);
        let (sum, difference) = (after[a] + after[b], after[a] - after[b]);
        g.leave(at(x, y, z), sum.mul_add(n::<N>(1.0 / 18.0), same));
        g.leave(
            at(2 * x, 2 * y, 2 * z),
            sum.neg_mul_add(n::<N>(1.0 / 18.0), same),
        );
        let (x, y, z) = ([1, 0, 2][a], [2, 1, 0][a], [0, 2, 1][a]);
        g.leave(at(x, y, z), difference.mul_add(n::<N>(1.0 / 18.0), other));
        let opposite = [0, 2, 1];
        g.leave(
            at(opposite[x], opposite[y], opposite[z]),
            difference.neg_mul_add(n::<N>(1.0 / 18.0), other),
        );
    });
    let corner = trace.mul_add(n::<N>(1.0 / 48.0), common * n::<N>(1.0 / 216.0));
    let same = mixed[0].mul_add(n::<N>(1.0 / 24.0), corner);
    let other = mixed[0].neg_mul_add(n::<N>(1.0 / 24.0), corner);
    let (sum, difference) = (mixed[1] + mixed[2], mixed[1] - mixed[2]);
    let (jsum, jdifference) = (after[0] + after[1], after[0] - after[1]);
    let even = [
        sum.mul_add(n::<N>(1.0 / 24.0), same),
        sum.neg_mul_add(n::<N>(1.0 / 24.0), same),
        difference.neg_mul_add(n::<N>(1.0 / 24.0), other),
        difference.mul_add(n::<N>(1.0 / 24.0), other),
    ];
    let odd = [
        jsum + after[2],
        jsum - after[2],
        jdifference + after[2],
        jdifference - after[2],
    ];
    unroll!(four k < 4 => {
        let (x, y, z) = ([1, 1, 1, 1][k], [1, 1, 2, 2][k], [1, 2, 1, 2][k]);
        g.leave(at(x, y, z), odd[k].mul_add(n::<N>(1.0 / 72.0), even[k]));
        let opposite = [0, 2, 1];
        g.leave(
            at(opposite[x], opposite[y], opposite[z]),
            odd[k].neg_mul_add(n::<N>(1.0 / 72.0), even[k]),
        );
    });
}

impl<const FORCED: bool> Collision for SecondOrder<FORCED> {
    const ON_GPU: Option<&'static str> = Some(if FORCED {
        "forced_second_order"
    } else {
        "second_order"
    });
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
        // Moments of 1, c_x, c_y, c_x², c_y² and c_x c_y in each plane of c_z.
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
        // Equilibrium Q of the second moments, and the source that is added to them.
        let mut square = [m[0] * u[0], m[1] * u[1], m[2] * u[2]];
        let mut cross = [m[0] * u[1], m[1] * u[2], m[2] * u[0]];
        let mut square_source = [n::<N>(0.0); 3];
        let mut cross_source = [n::<N>(0.0); 3];
        if FORCED {
            unroll!(axes a < 3 => {
                let b = (a + 1) % 3;
                let (fa, fb) = (n::<N>(self.force[a]), n::<N>(self.force[b]));
                square_source[a] = fa * u[a];
                square[a] = square[a] - square_source[a];
                cross_source[a] = fa.mul_add(u[b], fb * u[a]);
                cross[a] = cross_source[a].neg_mul_add(n::<N>(0.5), cross[a]);
            });
        }

        // N_aa (`off_balance`) and B_aa (`second`).
        let mut off_balance = [n::<N>(0.0); 3];
        let third = drho * n::<N>(1.0 / 3.0);
        unroll!(axes a < 3 => {
            off_balance[a] = diagonal[a] - (third + square[a]);
        });
        let keep = n::<N>(1.0) - omega;
        let mean = (off_balance[0] + off_balance[1] + off_balance[2])
            * ((omega - n::<N>(self.bulk)) * n::<N>(1.0 / 3.0));
        let mut second = square;
        unroll!(axes a < 3 => {
            second[a] = off_balance[a].mul_add(keep, mean + square[a]);
            if FORCED {
                second[a] = square_source[a].mul_add(n::<N>(2.0), second[a]);
            }
        });
        let mut mixed = cross;
        unroll!(axes a < 3 => {
            mixed[a] = (off[a] - cross[a]).mul_add(keep, cross[a]);
            if FORCED {
                mixed[a] = mixed[a] + cross_source[a];
            }
        });
        leave(g, drho, after, second, mixed);
        u
    }
}

#[cfg(test)]
mod tests {
    use super::super::mrt::{Mrt, Rates};
    use super::*;
    use crate::lattice::D3Q27;

    fn collided<C: Collision>(operator: &C, g: &[f64; 27]) -> ([f64; 27], [f64; 3]) {
        let mut g = *g;
        let u = operator.collide::<D3Q27, f64, _, 27>(&mut g, &operator.uniform());
        (g, u)
    }

    /// Compares the operator with the general one, which is tested against the matrix of moments.
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
