//! Multiple relaxation times with the published matrix of K. Suga, Y. Kuwata, K. Takashima, R. Chikasue, Comput. Math.
//! Appl. 69 (2015) 518, with Guo forcing.
//!
//! f ← f - M⁻¹ [ S (M f - m^eq) - (I - S/2) M F ] with the orthogonal moments of Suga and
//! S = diag(0, 0, 0, 0, s4, s5, s5, s7×3, s10×3, s13×3, s16, s17, s18×2, s20×3, s23×3, s26), s5 = s7 = 1/τ.
//!
//! **Stability.** The rows of M are orthogonal in the inner product without weights. They are not orthogonal under
//! the weights of the lattice, so that the proof of [`super::mrt`] does not hold: relaxing a higher moment changes
//! a lower one. With the published rates waves grow in fluid at rest from τ = 0.556 on
//! ([`super::linear_stability`]). [`super::mrt`] is preferable unless published results are to be reproduced.
//!
//! **The factorised form.** Every moment of Suga is a product of one polynomial in each component of c, from 1, c and P
//! = 3c² - 2, or a sum or difference of such products:
//!
//! | moments | products | rate |
//! |---|---|---|
//! | ρ; j | 1; c_x | conserved |
//! | e; 3p_xx, p_ww | sum of P_x, P_y, P_z; their differences | s4; s5 |
//! | p_xy | c_x c_y | s7 |
//! | q_x; τ_x | c_x P_y + c_x P_z; c_x P_y - c_x P_z | s10; s23 |
//! | Ψ_x | c_x P_y P_z | s13 |
//! | ε; XX, WW | sum of P_x P_y, P_y P_z, P_z P_x; their differences | s16; s18 |
//! | e³ | P_x P_y P_z | s17 |
//! | XY | c_x c_y P_z | s20 |
//! | XYZ | c_x c_y c_z | s26 |
//!
//! so that M and M⁻¹ are three sweeps of 9 small transforms each, with 216 additions instead of 1458 products; the
//! result is that of the matrix up to rounding. Equilibria are of second order in u; their moments only contain δρ
//! and m_a u_b. The trace of the second moments, e, has its own rate, so that the bulk viscosity is (2/9)(1/s4 -
//! ½).

use super::border::{self, Border, MovingBody, ReynoldsBounds, Situation};
use super::linear_stability::{self, Wave};
use super::mrt::{self, Rates};
use super::products::{self, Basis, n};
use super::{Collision, CollisionModel, Dispatch, Kernels, Site};
use crate::lanes::Lanes;
use crate::lattice::{D3Q27, Lattice, VelocitySet, unroll};
use base::error::{Finding, Remedy, Severity, number};
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Multiple relaxation times on D3Q27 with the published matrix of Suga et al. (2015), to reproduce published results.
/// Its moments are not orthogonal under the weights of the lattice: with the published rates waves grow in fluid at
/// rest from tau = 0.556 on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct SugaParameters(pub mrt::MrtParameters);

/// Relaxation time above which waves of three cells along the diagonals grow in fluid at rest with the rates of Suga:
/// by 0.06 % per step at 0.56, 1 % at 0.6, 5 % at 0.8 (largest eigenvalue over all wave vectors, 16 in half a period).
const GROWING_RELAXATION_TIME: f64 = 0.556;
/// Relaxation time above which runs failed for this reason: boxes without walls at 0.8, ducts at 0.75, under a lid at
/// 0.7 and not at 0.65.
const FAILING_RELAXATION_TIME: f64 = 0.7;
/// Relaxation time below which waves grow at rest with all moments above second order at equilibrium: by 0.9 % per
/// step at 0.51. Runs were stable nevertheless (`benches/stability/cavity-3d-20`).
const SECOND_ORDER_GROWS: f64 = 0.52;

const CUBE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.1, 30.0, 90.0),
    ReynoldsBounds::up_to(f64::INFINITY, 10.0, 20.0),
];
const DUCT: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.06, 30.0, 60.0),
    ReynoldsBounds::up_to(f64::INFINITY, 10.0, 13.6),
];
const CUBE_EDDIES: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.03, 300.0, f64::INFINITY),
    ReynoldsBounds::up_to(0.1, 100.0, 300.0),
    ReynoldsBounds::up_to(f64::INFINITY, 20.0, 60.0),
];
const CUBE_SECOND_ORDER: &[ReynoldsBounds] = &ReynoldsBounds::always(20.0, 30.0);

const SPHERE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.06, 80.0, f64::INFINITY),
    ReynoldsBounds::up_to(0.11, 40.0, 80.0),
    ReynoldsBounds::up_to(0.15, 14.0, 20.0),
    ReynoldsBounds::up_to(f64::INFINITY, 7.0, 10.0),
];

impl CollisionModel for SugaParameters {
    fn describe(&self, _: f64) -> Description {
        Description::new(
            "multiple relaxation times after Suga",
            "requested; the published matrix, each group of moments at its own rate",
        )
    }

    fn only_on(&self) -> Option<VelocitySet> {
        Some(VelocitySet::D3Q27)
    }

    fn check(&self, path: &str, relaxation_time: f64) -> Option<Finding> {
        let finding = |severity, reason, remedy: Remedy, operator| Finding {
            path: format!("{path}.suga"),
            reason,
            remedy: remedy.set(path, operator),
            severity,
        };
        let rates = self.0.rates();
        let at = format!("the relaxation time is tau = {}", number(relaxation_time));
        if rates.second_order() {
            return (relaxation_time < SECOND_ORDER_GROWS).then(|| {
                finding(
                    Severity::Warning,
                    format!("{at}: below {SECOND_ORDER_GROWS} short waves grow slowly in water at rest if the \
                             rates of the higher moments are 1"),
                    "use mrt, with which no waves grow".into(),
                    json!({"mrt": {"higher": 1}}),
                )
            });
        }
        if rates != Rates::SUGA || relaxation_time < GROWING_RELAXATION_TIME {
            return None;
        }
        let reason = format!(
            "{at}: with the published matrix, which is not orthogonal under the weights of the lattice, waves of \
             three cells are linearly unstable for tau of {GROWING_RELAXATION_TIME} and above"
        );
        let remedy = format!(
            "use mrt, with which no waves grow in water at rest, or a tau below {GROWING_RELAXATION_TIME}"
        );
        let (severity, reason) = if relaxation_time >= FAILING_RELAXATION_TIME {
            (
                Severity::Unstable,
                format!("{reason}, and runs failed for tau of {FAILING_RELAXATION_TIME} and above"),
            )
        } else {
            (Severity::Warning, reason)
        };
        Some(finding(severity, reason, remedy.into(), json!({"mrt": {}})))
    }

    /// Returns the stability limit. With an eddy viscosity only flows under a lid are covered; with moments above
    /// second order at equilibrium the limit then lies beyond the map.
    fn border(&self, situation: &Situation) -> Option<Border> {
        let second_order = self.0.rates().second_order();
        if situation.eddies && (second_order || !situation.lid_meets_wall) {
            return None;
        }
        if situation.duct() && !second_order {
            return Some(border::duct(DUCT));
        }
        Some(border::cube(match (second_order, situation.eddies) {
            (true, _) => CUBE_SECOND_ORDER,
            (false, true) => CUBE_EDDIES,
            (false, false) => CUBE,
        }))
    }

    fn border_of_moving(&self, body: &MovingBody) -> Option<Border> {
        (!body.eddies).then_some(body.border(SPHERE))
    }

    fn fails_at_faces(&self) -> f64 {
        if self.0.rates().second_order() {
            20.0
        } else {
            2.0
        }
    }

    fn growing_wave(&self, relaxation_time: f64) -> Option<Wave> {
        let rates = self.0.rates();
        let reported = rates.second_order()
            || rates == Rates::SUGA && relaxation_time >= GROWING_RELAXATION_TIME;
        (!reported && relaxation_time > 0.5).then(|| {
            linear_stability::fastest::<D3Q27, _, 27>(&Suga {
                omega: 1.0 / relaxation_time,
                rates,
                force: [0.0; 3],
            })
        })
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        to.on_d3q27(Matrix(self.0.rates()))
    }
}

/// Kernels: the kernel with a force serves all passes, because speed is not essential for published results.
#[derive(Clone, Copy)]
struct Matrix(Rates);

impl Kernels for Matrix {
    type Uniform<const FORCED: bool> = Suga;
    type Local = Suga;
    type Covered = Suga;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Suga {
        self.local(omega, force)
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Suga {
        let rates = self.0;
        Suga {
            omega,
            rates,
            force,
        }
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Suga {
        self.local(omega, force)
    }
}

/// Collision operator with a uniform body force.
#[derive(Clone, Copy, Debug)]
pub struct Suga {
    /// Rate of the shear stress 1/τ (s5 = s7).
    pub omega: f64,
    /// Rates other than that of the shear stress.
    pub rates: Rates,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// The polynomials 1, c, P = 3c² - 2; scaled moments (1/3, c/2, P/6) give the numbers.
struct Polynomials;

impl Basis for Polynomials {
    #[inline(always)]
    fn analyse<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3] {
        let sum = plus + minus;
        [
            rest + sum,
            plus - minus,
            rest.neg_mul_add(N::splat(2.0), sum),
        ]
    }

    #[inline(always)]
    fn compose<N: Lanes>([one, c, p]: [N; 3]) -> [N; 3] {
        let sum = one + p;
        [p.neg_mul_add(N::splat(2.0), one), sum + c, sum - c]
    }
}

/// Returns 1 over the norm of the product of polynomials a, b, c (0: 1, 1: c, 2: P).
const fn scale(a: usize, b: usize, c: usize) -> f64 {
    const NORM: [f64; 3] = [3.0, 2.0, 6.0];
    1.0 / (NORM[a] * NORM[b] * NORM[c])
}

impl Collision for Suga {
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
        let mut t = products::moments::<Polynomials, N, G, Q>(g);
        let drho = t[0][0][0];
        let mut force = [N::splat(0.0); 3];
        let mut m = [t[1][0][0], t[0][1][0], t[0][0][1]];
        unroll!(axes a < 3 => {
            force[a] = n::<N>(self.force[a]);
            m[a] = m[a] + n::<N>(0.5 * self.force[a]);
        });
        let inverse = N::splat(1.0) / (N::splat(1.0) + drho);
        let u = [m[0] * inverse, m[1] * inverse, m[2] * inverse];

        // m_a u_b, and with a force s = (F_a u_b + F_b u_a)/2, that of the source: a moment t with equilibrium q and
        // source 2s goes to t - rate (t - (q - s)) + 2s.
        let mut square = [m[0] * u[0], m[1] * u[1], m[2] * u[2]];
        let mut cross = [m[0] * u[1], m[1] * u[2], m[2] * u[0]];
        let mut square_source = [n::<N>(0.0); 3];
        let mut cross_source = [n::<N>(0.0); 3];
        let mut linear = m;
        unroll!(axes a < 3 => {
            let b = (a + 1) % 3;
            square_source[a] = force[a] * u[a];
            cross_source[a] = force[a].mul_add(u[b], force[b] * u[a]) * n::<N>(0.5);
            square[a] = square[a] - square_source[a];
            cross[a] = cross[a] - cross_source[a];
            // The source of the odd moments is ±F.
            linear[a] = m[a] - n::<N>(0.5 * self.force[a]);
        });
        let k = &self.rates;

        // Difference of a moment from its equilibrium: the change is the rate times this. Second moments P_a:
        // equilibrium -δρ + 3 m_a u_a.
        let mut short = [n::<N>(0.0); 3];
        let diagonal = [t[2][0][0], t[0][2][0], t[0][0][2]];
        unroll!(axes a < 3 => {
            short[a] = square[a].mul_add(n::<N>(3.0), n::<N>(0.0) - (drho + diagonal[a]));
        });
        let mean = (short[0] + short[1] + short[2]) * (n::<N>(k.bulk) - omega) * n::<N>(1.0 / 3.0);
        unroll!(axes a < 3 => {
            let mut value = short[a].mul_add(omega, diagonal[a]) + mean;
                value = square_source[a].mul_add(n::<N>(6.0), value);
            let (x, y, z) = ([2, 0, 0][a], [0, 2, 0][a], [0, 0, 2][a]);
            t[x][y][z] = value * n::<N>(scale(2, 0, 0));
        });
        // c_a c_b: m_a u_b.
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 0, 1][a], [1, 1, 0][a], [0, 1, 1][a]);
            let mut value = (cross[a] - t[x][y][z]).mul_add(omega, t[x][y][z]);
                value = cross_source[a].mul_add(n::<N>(2.0), value);
            t[x][y][z] = value * n::<N>(scale(1, 1, 0));
        });
        // c_a P_b, c_a P_c: -m_a each, relaxed as sum and difference; and c_a P_b P_c: m_a.
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
            let sum = linear[a].neg_mul_add(n::<N>(2.0), n::<N>(0.0) - (p + q));
            let difference = (p - q) * n::<N>(0.5 * k.tau * scale(1, 2, 0));
            let change = sum * n::<N>(0.5 * k.q * scale(1, 2, 0));
            let mut p = p.mul_add(n::<N>(scale(1, 2, 0)), change - difference);
            let mut q = q.mul_add(n::<N>(scale(1, 2, 0)), change + difference);
            let mut psi = psi.mul_add(
                n::<N>((1.0 - k.psi) * scale(1, 2, 2)),
                linear[a] * n::<N>(k.psi * scale(1, 2, 2)),
            );
                p = force[a].neg_mul_add(n::<N>(scale(1, 2, 0)), p);
                q = force[a].neg_mul_add(n::<N>(scale(1, 2, 0)), q);
                psi = force[a].mul_add(n::<N>(scale(1, 2, 2)), psi);
            t[first[0]][first[1]][first[2]] = p;
            t[second[0]][second[1]][second[2]] = q;
            t[third[0]][third[1]][third[2]] = psi;
        });
        // P_a P_b: δρ - 3 (m_a u_a + m_b u_b), relaxed as sum and differences; P_x P_y P_z: -δρ + 3 m·u.
        let total = square[0] + square[1] + square[2];
        let quartic = [t[0][2][2], t[2][0][2], t[2][2][0]];
        unroll!(axes a < 3 => {
            // The axis a is the one that is not in the product.
            short[a] = (total - square[a]).neg_mul_add(n::<N>(3.0), drho - quartic[a]);
        });
        let mean =
            (short[0] + short[1] + short[2]) * n::<N>((k.epsilon - k.xx) / 3.0 * scale(2, 2, 0));
        let sources = (square_source[0] + square_source[1] + square_source[2]) * n::<N>(6.0);
        unroll!(axes a < 3 => {
            let mut value = short[a].mul_add(
                n::<N>(k.xx * scale(2, 2, 0)),
                quartic[a].mul_add(n::<N>(scale(2, 2, 0)), mean),
            );
                let source = square_source[a].neg_mul_add(n::<N>(6.0), sources);
                value = source.neg_mul_add(n::<N>(scale(2, 2, 0)), value);
            let (x, y, z) = ([0, 2, 2][a], [2, 0, 2][a], [2, 2, 0][a]);
            t[x][y][z] = value;
        });
        let target = total.mul_add(n::<N>(3.0), n::<N>(0.0) - drho);
        t[2][2][2] = t[2][2][2].mul_add(
            n::<N>((1.0 - k.e_cubed) * scale(2, 2, 2)),
            target * n::<N>(k.e_cubed * scale(2, 2, 2)),
        );
        t[2][2][2] = sources.mul_add(n::<N>(scale(2, 2, 2)), t[2][2][2]);
        // c_a c_b P_c: -m_a u_b; c_x c_y c_z: 0.
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 2, 1][a], [1, 1, 2][a], [2, 1, 1][a]);
            let mut value = t[x][y][z].mul_add(
                n::<N>((1.0 - k.xy) * scale(1, 1, 2)),
                cross[a] * n::<N>(-k.xy * scale(1, 1, 2)),
            );
                value = cross_source[a].neg_mul_add(n::<N>(2.0 * scale(1, 1, 2)), value);
            t[x][y][z] = value;
        });
        t[1][1][1] = t[1][1][1] * n::<N>((1.0 - k.xyz) * scale(1, 1, 1));
        t[0][0][0] = drho * n::<N>(scale(0, 0, 0));
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 0, 0][a], [0, 1, 0][a], [0, 0, 1][a]);
                t[x][y][z] = t[x][y][z] + force[a];
            t[x][y][z] = t[x][y][z] * n::<N>(scale(1, 0, 0));
        });

        products::leave::<Polynomials, N, G, Q>(g, t);
        u
    }
}

#[cfg(test)]
mod tests {
    use super::super::mrt::tests::{FORCE, Orthogonal, cell, close, collided, reference};
    use super::super::trt::{AntisymmetricRate, Trt, antisymmetric_rate};
    use super::*;

    #[test]
    fn the_factorised_form_is_the_published_matrix() {
        let rates = Rates::SUGA;
        for seed in 0..20 {
            let g = cell(seed);
            for omega in [0.3, 1.1, 1.99] {
                for force in [[0.0; 3], FORCE] {
                    let exact = reference(Orthogonal::Plain, &g, omega, &rates, force);
                    let operator = Suga {
                        omega,
                        rates,
                        force,
                    };
                    close(&collided(operator, &g), &exact);
                }
            }
        }
    }

    /// Checks that with one rate for even and one for odd moments the result is independent of the basis.
    #[test]
    fn paired_rates_are_trt() {
        let (g, omega, magic, force) = (cell(3), 1.1, 3.0 / 16.0, FORCE);
        let rates = Rates::two(omega, antisymmetric_rate(omega, magic));
        let trt = Trt::<true> {
            omega,
            antisymmetric: AntisymmetricRate::Magic(magic),
            force,
        };
        let operator = Suga {
            omega,
            rates,
            force,
        };
        close(&collided(operator, &g), &collided(trt, &g));
    }
}
