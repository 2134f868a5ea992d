//! Cumulants on D3Q27 (M. Geier, M. Schönherr, A. Pasquali, M. Krafczyk, Comput. Math. Appl. 70 (2015) 507), with Guo
//! forcing: the robust choice at high Reynolds numbers.
//!
//! The populations become central moments κ_abc about the velocity u. The shear part of the second moments relaxes at
//! ω = 1/τ, their trace at the bulk rate. All cumulants of third and higher order are set to zero. The result has the
//! moments of a Gaussian with the covariance s = κ_2'/ρ of the relaxed second moments, which Isserlis' theorem gives
//! in closed form:
//!
//! κ_220 = ρ (s_xx s_yy + 2 s_xy²), κ_211 = ρ (s_xx s_yz + 2 s_xy s_xz),
//! κ_222 = ρ (s_xx s_yy s_zz + 2 s_xx s_yz² + 2 s_yy s_zx² + 2 s_zz s_xy² + 8 s_xy s_yz s_zx).
//!
//! The relaxation of the diagonal contains the correction of the cubic error in u (from the strain that the moments
//! represent), so that the viscosity does not depend on the velocity of the frame. There is no magic parameter: the
//! position of a wall depends weakly on τ. The transforms are three sweeps of nine one-dimensional transforms,
//! applied to deviations from the moments of the weights, so that fluid at rest is exact. A force changes the first
//! central moment from -F/2 to F/2. The Gaussian then is centred at u + F/(2ρ), so that κ_aab = κ_aa F_b/(2ρ) and
//! κ_aabbc = κ_aa κ_bb F_c/(2ρ²), as with the Guo forcing of the other operators. Without these terms the pressure
//! is wrong next to a wall against which a force presses the fluid.

use super::border::{self, Border, MovingBody, ReynoldsBounds, Situation};
use super::products::{POPULATION, n};
use super::{Collision, CollisionModel, Dispatch, Kernels, Site};
use crate::lanes::Lanes;
use crate::lattice::{Lattice, VelocitySet, unroll};
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cumulants on D3Q27 (Geier et al. 2015): cumulants beyond the stress relax fully to equilibrium. The most robust
/// choice near tau = 0.5. The position of walls depends weakly on tau.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct CumulantParameters {
    /// Rate of the trace of the stress \[1\]; the bulk viscosity is (2/9)(1/bulk - 1/2). A rate of 1 damps sound waves
    /// best.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub bulk: f64,
}

fn one() -> f64 {
    1.0
}

impl Default for CumulantParameters {
    fn default() -> Self {
        Self { bulk: one() }
    }
}

const CUBE: &[ReynoldsBounds] = &ReynoldsBounds::always(30.0, 60.0);
const DUCT: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.06, 30.0, 60.0),
    ReynoldsBounds::up_to(f64::INFINITY, 17.6, 23.0),
];

const SPHERE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.11, 80.0, f64::INFINITY),
    ReynoldsBounds::up_to(0.15, 40.0, 80.0),
    ReynoldsBounds::up_to(f64::INFINITY, 10.0, 12.0),
];

impl CollisionModel for CumulantParameters {
    fn describe(&self, _: f64) -> Description {
        Description::new("cumulants", "requested; robust at high Reynolds numbers")
    }

    fn only_on(&self) -> Option<VelocitySet> {
        Some(VelocitySet::D3Q27)
    }

    /// Returns the stability limit; with an eddy viscosity it lies beyond the map.
    fn border(&self, situation: &Situation) -> Option<Border> {
        if situation.duct() {
            return Some(border::duct(DUCT));
        }
        (!situation.eddies).then_some(border::cube(CUBE))
    }

    fn border_of_moving(&self, body: &MovingBody) -> Option<Border> {
        (!body.eddies).then_some(body.border(SPHERE))
    }

    fn fails_at_faces(&self) -> f64 {
        20.0
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        to.on_d3q27(*self)
    }
}

/// Kernels: the kernel with a force serves all passes, because the operator is limited by arithmetic and a force
/// costs little.
impl Kernels for CumulantParameters {
    type Uniform<const FORCED: bool> = Cumulant<true>;
    type Local = Cumulant<true>;
    type Covered = Cumulant<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Cumulant<true> {
        self.local(omega, force)
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Cumulant<true> {
        let bulk = self.bulk;
        Cumulant { omega, bulk, force }
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Cumulant<true> {
        self.local(omega, force)
    }
}

/// Cumulants, with a uniform body force where `FORCED`.
#[derive(Clone, Copy, Debug)]
pub struct Cumulant<const FORCED: bool> {
    /// Relaxation rate of the shear stress, 1/τ.
    pub omega: f64,
    /// Relaxation rate of the trace of the stress; 1 damps sound most.
    pub bulk: f64,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// One-dimensional weights in the order rest, +, -.
const WEIGHT: [f64; 3] = [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0];
/// Moments of order 0, 1, 2 of the weights.
const MOMENT: [f64; 3] = [1.0, 0.0, 1.0 / 3.0];

/// Converts populations (rest, +, -) to central moments of order 0, 1, 2 about `u`, both without the contribution
/// of the weights; `k` is the sum of these weights.
#[inline(always)]
fn analyse<N: Lanes>([rest, plus, minus]: [N; 3], u: N, k: f64) -> [N; 3] {
    let (sum, difference) = (plus + minus, plus - minus);
    let zeroth = rest + sum;
    let first = u.neg_mul_add(zeroth + N::splat(k), difference);
    [zeroth, first, u.neg_mul_add(difference + first, sum)]
}

/// Returns the inverse transform: (rest, +, -).
#[inline(always)]
fn compose<N: Lanes>([zeroth, first, second]: [N; 3], u: N, k: f64) -> [N; 3] {
    let difference = u.mul_add(zeroth + N::splat(k), first);
    let sum = u.mul_add(difference + first, second);
    let half = N::splat(0.5);
    [
        zeroth - sum,
        (sum + difference) * half,
        (sum - difference) * half,
    ]
}

/// Fourth moments of a Gaussian as functions of its second moments, without the contribution of the weights.
#[derive(Clone, Copy)]
struct Gaussian<N> {
    drho: N,
    inverse: N,
}

impl<N: Lanes> Gaussian<N> {
    /// Returns κ_aabb from κ_aa and κ_bb without the contributions of the weights, and the square of κ_ab.
    #[inline(always)]
    fn fourth(self, a: N, b: N, square: N) -> N {
        let rest = square.mul_add(n::<N>(2.0), self.drho * n::<N>(-1.0 / 9.0));
        a.mul_add(b, (a + b).mul_add(n::<N>(1.0 / 3.0), rest)) * self.inverse
    }

    /// Returns κ_aabc from κ_aa without the contribution of the weights, κ_bc, κ_ab and κ_ac.
    #[inline(always)]
    fn mixed(self, a: N, straight: N, one: N, other: N) -> N {
        (a + n::<N>(1.0 / 3.0)).mul_add(straight, one * other * n::<N>(2.0)) * self.inverse
    }
}

/// Returns the deviation of the density and the momentum of a cell, without half of a force.
#[inline(always)]
fn density_and_momentum<N: Lanes, G: Site<N, Q>, const Q: usize>(g: &G) -> (N, [N; 3]) {
    let mut sums = [[n::<N>(0.0); 3]; 3];
    let mut m = [n::<N>(0.0); 3];
    unroll!(axes x < 3 => {
        unroll!(axes y < 3 => {
            let (plus, minus) = (g.incoming(POPULATION[x][y][1]), g.incoming(POPULATION[x][y][2]));
            sums[x][y] = g.incoming(POPULATION[x][y][0]) + (plus + minus);
            m[2] = m[2] + (plus - minus);
        });
    });
    let mut by_x = [n::<N>(0.0); 3];
    unroll!(axes x < 3 => {
        by_x[x] = sums[x][0] + (sums[x][1] + sums[x][2]);
        m[1] = m[1] + (sums[x][1] - sums[x][2]);
    });
    let drho = by_x[0] + (by_x[1] + by_x[2]);
    m[0] = by_x[1] - by_x[2];
    (drho, m)
}

impl<const FORCED: bool> Collision for Cumulant<FORCED> {
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
        const { assert!(Q == 27, "the cumulants are those of D3Q27") };
        // Density and velocity are computed first, because the moments are about the velocity.
        let (drho, mut m) = density_and_momentum(g);
        if FORCED {
            unroll!(axes a < 3 => {
                m[a] = m[a] + n::<N>(0.5 * self.force[a]);
            });
        }
        let rho = N::splat(1.0) + drho;
        let inverse = N::splat(1.0) / rho;
        let u = [m[0] * inverse, m[1] * inverse, m[2] * inverse];

        // Sweeps along z, y, x; only moments up to second order are needed before the collision.
        let mut t = [[[n::<N>(0.0); 3]; 3]; 3];
        unroll!(axes x < 3 => {
            unroll!(axes y < 3 => {
                let row = [
                    g.incoming(POPULATION[x][y][0]),
                    g.incoming(POPULATION[x][y][1]),
                    g.incoming(POPULATION[x][y][2]),
                ];
                t[x][y] = analyse(row, u[2], WEIGHT[x] * WEIGHT[y]);
            });
            unroll!(axes c < 3 => {
                let column = analyse([t[x][0][c], t[x][1][c], t[x][2][c]], u[1], WEIGHT[x] * MOMENT[c]);
                t[x][0][c] = column[0];
                t[x][1][c] = column[1];
                t[x][2][c] = column[2];
            });
        });
        macro_rules! along_x {
            ($b:literal, $c:literal) => {
                analyse(
                    [t[0][$b][$c], t[1][$b][$c], t[2][$b][$c]],
                    u[0],
                    MOMENT[$b] * MOMENT[$c],
                )
            };
        }
        let [_, _, xx] = along_x!(0, 0);
        let [yy, ..] = along_x!(2, 0);
        let [zz, ..] = along_x!(0, 2);
        let [_, xy, _] = along_x!(1, 0);
        let [_, zx, _] = along_x!(0, 1);
        let [yz, ..] = along_x!(1, 1);

        // Rates of strain along the axes, computed from the moments.
        let trace = (xx + yy + zz) - drho;
        let shear = omega * inverse;
        let d_x = (xx + xx - yy - zz).neg_mul_add(
            shear * n::<N>(0.5),
            n::<N>(0.0) - trace * (inverse * n::<N>(0.5 * self.bulk)),
        );
        let d_y = (xx - yy).mul_add(shear * n::<N>(1.5), d_x);
        let d_z = (xx - zz).mul_add(shear * n::<N>(1.5), d_x);
        let (ux, uy, uz) = (u[0] * u[0] * d_x, u[1] * u[1] * d_y, u[2] * u[2] * d_z);
        let keep = n::<N>(1.0) - omega;
        let open = omega.neg_mul_add(n::<N>(0.5), n::<N>(1.0)) * rho * n::<N>(3.0);
        let sum = trace.mul_add(n::<N>(1.0 - self.bulk), drho)
            - (ux + uy + uz) * rho * n::<N>(3.0 * (1.0 - 0.5 * self.bulk));
        let x_y = (xx - yy).mul_add(keep, n::<N>(0.0) - open * (ux - uy));
        let x_z = (xx - zz).mul_add(keep, n::<N>(0.0) - open * (ux - uz));
        let third = n::<N>(1.0 / 3.0);
        let a = (sum + x_y + x_z) * third;
        let b = a - x_y;
        let c = a - x_z;
        let (r, q, p) = (xy * keep, zx * keep, yz * keep);

        // Gaussian with these second moments, without the contribution of the weights.
        let (pp, qq, rr) = (p * p, q * q, r * r);
        let of = Gaussian { drho, inverse };
        let pairs = a.mul_add(b, b.mul_add(c, c * a));
        let sixth = (a + b + c).mul_add(n::<N>(1.0 / 9.0), pairs.mul_add(third, a * b * c))
            + (a.mul_add(pp, b.mul_add(qq, c * rr)) + (pp + qq + rr) * third) * n::<N>(2.0)
            + p * q * r * n::<N>(8.0)
            - drho.mul_add(drho, drho + drho) * n::<N>(1.0 / 27.0);
        let zero = n::<N>(0.0);
        let mut first = [zero; 3];
        // Moments κ_abb, κ_acc and κ_abbcc of the axis a, from the force along it.
        let mut odd = [[zero; 3]; 3];
        if FORCED {
            let s_x = (a + third) * inverse;
            let s_y = (b + third) * inverse;
            let s_z = (c + third) * inverse;
            unroll!(axes a < 3 => {
                first[a] = n::<N>(0.5 * self.force[a]);
            });
            odd = [
                [first[0] * s_y, first[0] * s_z, first[0] * s_y * s_z],
                [first[1] * s_x, first[1] * s_z, first[1] * s_x * s_z],
                [first[2] * s_x, first[2] * s_y, first[2] * s_x * s_y],
            ];
        }
        t = [
            [
                [drho, first[2], c],
                [first[1], p, odd[1][1]],
                [b, odd[2][1], of.fourth(b, c, pp)],
            ],
            [
                [first[0], q, odd[0][1]],
                [r, zero, of.mixed(c, r, q, p)],
                [odd[0][0], of.mixed(b, q, r, p), odd[0][2]],
            ],
            [
                [a, odd[2][0], of.fourth(c, a, qq)],
                [odd[1][0], of.mixed(a, p, r, q), odd[1][2]],
                [of.fourth(a, b, rr), odd[2][2], sixth * inverse * inverse],
            ],
        ];

        unroll!(axes b < 3 => {
            unroll!(axes c < 3 => {
                let line = compose([t[0][b][c], t[1][b][c], t[2][b][c]], u[0], MOMENT[b] * MOMENT[c]);
                t[0][b][c] = line[0];
                t[1][b][c] = line[1];
                t[2][b][c] = line[2];
            });
        });
        unroll!(axes x < 3 => {
            unroll!(axes c < 3 => {
                let column = compose([t[x][0][c], t[x][1][c], t[x][2][c]], u[1], WEIGHT[x] * MOMENT[c]);
                t[x][0][c] = column[0];
                t[x][1][c] = column[1];
                t[x][2][c] = column[2];
            });
            unroll!(axes y < 3 => {
                let row = compose(t[x][y], u[2], WEIGHT[x] * WEIGHT[y]);
                g.leave(POPULATION[x][y][0], row[0]);
                g.leave(POPULATION[x][y][1], row[1]);
                g.leave(POPULATION[x][y][2], row[2]);
            });
        });
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::D3Q27;
    use nalgebra::{DMatrix, DVector};

    const FORCE: [f64; 3] = [0.011, -0.007, 0.003];

    /// Returns the deviations of a cell far from equilibrium.
    fn cell(seed: u64) -> [f64; 27] {
        std::array::from_fn(|i| {
            let x = (seed * 27 + i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11;
            (x as f64 / (1_u64 << 53) as f64 - 0.5) * 0.2 * D3Q27::W[i].sqrt()
        })
    }

    fn collided<C: Collision>(operator: C, g: &[f64; 27]) -> [f64; 27] {
        let mut g = *g;
        operator.collide::<D3Q27, f64, _, 27>(&mut g, &operator.uniform());
        g
    }

    /// Returns (c - u)^order of population i.
    fn power(i: usize, u: [f64; 3], order: [i32; 3]) -> f64 {
        (0..3)
            .map(|a| (f64::from(D3Q27::C[i][a]) - u[a]).powi(order[a]))
            .product()
    }

    /// Computes the collision from explicit moments and a system of 27 equations, with the cumulants in the form of
    /// Geier et al. (2015).
    fn reference(g: &[f64; 27], omega: f64, bulk: f64, force: [f64; 3]) -> [f64; 27] {
        let f: Vec<f64> = (0..27).map(|i| g[i] + D3Q27::W[i]).collect();
        let rho: f64 = f.iter().sum();
        let u: [f64; 3] = std::array::from_fn(|a| {
            let j: f64 = (0..27).map(|i| f64::from(D3Q27::C[i][a]) * f[i]).sum();
            (j + 0.5 * force[a]) / rho
        });
        let orders: Vec<[i32; 3]> = (0..27).map(|n| [n / 9, n / 3 % 3, n % 3]).collect();
        let before = |order: [i32; 3]| (0..27).map(|i| f[i] * power(i, u, order)).sum::<f64>();
        let (c200, c020, c002) = (before([2, 0, 0]), before([0, 2, 0]), before([0, 0, 2]));
        let dx = -omega / (2.0 * rho) * (2.0 * c200 - c020 - c002)
            - bulk / (2.0 * rho) * (c200 + c020 + c002 - rho);
        let dy = dx + 3.0 * omega / (2.0 * rho) * (c200 - c020);
        let dz = dx + 3.0 * omega / (2.0 * rho) * (c200 - c002);
        let (u2, v2, w2) = (u[0] * u[0], u[1] * u[1], u[2] * u[2]);
        let x_y =
            (1.0 - omega) * (c200 - c020) - 3.0 * rho * (1.0 - omega / 2.0) * (u2 * dx - v2 * dy);
        let x_z =
            (1.0 - omega) * (c200 - c002) - 3.0 * rho * (1.0 - omega / 2.0) * (u2 * dx - w2 * dz);
        let sum = rho * bulk + (1.0 - bulk) * (c200 + c020 + c002)
            - 3.0 * rho * (1.0 - bulk / 2.0) * (u2 * dx + v2 * dy + w2 * dz);
        let k200 = (sum + x_y + x_z) / 3.0;
        let (k020, k002) = (k200 - x_y, k200 - x_z);
        let k110 = (1.0 - omega) * before([1, 1, 0]);
        let k101 = (1.0 - omega) * before([1, 0, 1]);
        let k011 = (1.0 - omega) * before([0, 1, 1]);
        let k211 = (k200 * k011 + 2.0 * k110 * k101) / rho;
        let k121 = (k020 * k101 + 2.0 * k110 * k011) / rho;
        let k112 = (k002 * k110 + 2.0 * k011 * k101) / rho;
        let k220 = (k200 * k020 + 2.0 * k110 * k110) / rho;
        let k202 = (k200 * k002 + 2.0 * k101 * k101) / rho;
        let k022 = (k020 * k002 + 2.0 * k011 * k011) / rho;
        let k222 = (k200 * k022
            + k020 * k202
            + k002 * k220
            + 4.0 * (k011 * k211 + k101 * k121 + k110 * k112))
            / rho
            - (16.0 * k110 * k101 * k011
                + 4.0 * (k101 * k101 * k020 + k011 * k011 * k200 + k110 * k110 * k002)
                + 2.0 * k200 * k020 * k002)
                / (rho * rho);
        let after = |order: [i32; 3]| match order {
            [0, 0, 0] => rho,
            [1, 0, 0] => 0.5 * force[0],
            [0, 1, 0] => 0.5 * force[1],
            [0, 0, 1] => 0.5 * force[2],
            [2, 0, 0] => k200,
            [0, 2, 0] => k020,
            [0, 0, 2] => k002,
            [1, 1, 0] => k110,
            [1, 0, 1] => k101,
            [0, 1, 1] => k011,
            [2, 1, 1] => k211,
            [1, 2, 1] => k121,
            [1, 1, 2] => k112,
            [2, 2, 0] => k220,
            [2, 0, 2] => k202,
            [0, 2, 2] => k022,
            [2, 2, 2] => k222,
            // For one odd order, the Gaussian is centred at u + F/(2 rho), to first order in F.
            order if order.iter().filter(|&&n| n == 1).count() == 1 => (0..3)
                .map(|a| match order[a] {
                    1 => 0.5 * force[a],
                    2 => [k200, k020, k002][a] / rho,
                    _ => 1.0,
                })
                .product(),
            _ => 0.0,
        };
        let matrix = DMatrix::<f64>::from_fn(27, 27, |row, i| power(i, u, orders[row]));
        let right = DVector::<f64>::from_fn(27, |row, _| after(orders[row]));
        let out = matrix.lu().solve(&right).unwrap();
        std::array::from_fn(|i| out[i] - D3Q27::W[i])
    }

    #[test]
    fn the_sweeps_are_the_cumulants_written_out() {
        for seed in 0..20 {
            let g = cell(seed);
            for (omega, bulk) in [(0.3, 1.0), (1.1, 0.8), (1.99, 1.0)] {
                for force in [[0.0; 3], FORCE] {
                    let found = collided(Cumulant::<true> { omega, bulk, force }, &g);
                    let exact = reference(&g, omega, bulk, force);
                    for i in 0..27 {
                        assert!((found[i] - exact[i]).abs() < 1e-15 * 27.0, "{seed} {i}");
                    }
                    if force == [0.0; 3] {
                        let bare = collided(Cumulant::<false> { omega, bulk, force }, &g);
                        assert_eq!(bare.map(|x| x + 0.0), found.map(|x| x + 0.0));
                    }
                }
            }
        }
    }

    #[test]
    fn a_fluid_at_rest_stays_exactly_so() {
        let operator = Cumulant::<false> {
            omega: 1.9,
            bulk: 1.0,
            force: [0.0; 3],
        };
        assert!(
            collided(operator, &[0.0; 27])
                .iter()
                .all(|g| g.abs() == 0.0)
        );
    }
}
