//! Multiple relaxation times on D3Q27 (K. Suga, Y. Kuwata, K. Takashima, R. Chikasue, Comput. Math. Appl. 69 (2015) 518), with Guo forcing.
//!
//! f ← f - M⁻¹ [ S (M f - m^eq) - (I - S/2) M F ] with the orthogonal moments of Suga and
//! S = diag(0, 0, 0, 0, s4, s5, s5, s7×3, s10×3, s13×3, s16, s17, s18×2, s20×3, s23×3, s26), s5 = s7 = 1/τ.
//!
//! **The factorised form.** Every moment of Suga is a product of one polynomial in each component of c, from 1, c and P = 3c² - 2,
//! or a sum or difference of such products:
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
//! so that M and M⁻¹ are three sweeps of 9 small transforms each, 216 additions in place of 1458 products; the result is that of
//! the matrix to round-off. Equilibria are of second order in u; their moments need no more than δρ and
//! m_a u_b. The mean of the second moments, e, has its own rate, so the bulk viscosity is (2/9)(1/s4 - ½).

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are texts of the schema, where units stand in brackets: [m]"
)]

use super::border::{self, Border, Bounds, Situation};
use super::linear_stability::{self, Wave};
use super::products::{POPULATION, n};
use super::second_order::SecondOrder;
use super::{Collision, Dispatch, Kernels, Model, Site};
use crate::error::{Finding, Remedy, Severity, number};
use crate::lbm::family::Description;
use crate::lbm::lanes::Lanes;
use crate::lbm::lattice::{D3Q27, Lattice, VelocitySet, unroll};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Multiple relaxation times on D3Q27 (Suga et al. 2015): the shear stress relaxes at 1/tau, every other group of moments at its
/// own rate. For turbulent flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Parameters {
    /// Rate s4 of the trace of the stress [1]; the bulk viscosity is (2/9)(1/s4 - 1/2). Default: 1.54.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub bulk: Option<f64>,
    /// Rate of all moments above the second order that are not given [1]. Default: the rates of Suga et al. A rate of 1 relaxes them fully
    /// in one step, as other codes do by default, and saves a third of the work.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub higher: Option<f64>,
    /// Rate s10 of the energy flux q [1]. Default: 1.5.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub q: Option<f64>,
    /// Rate s13 of Psi [1]. Default: 1.83.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub psi: Option<f64>,
    /// Rate s16 of epsilon [1]. Default: 1.4.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub epsilon: Option<f64>,
    /// Rate s17 of e cubed [1]. Default: 1.61.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub e_cubed: Option<f64>,
    /// Rate s18 of XX and WW [1]. Default: 1.98.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub xx: Option<f64>,
    /// Rate s20 of XY, YZ and ZX [1]. Default: 1.98.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub xy: Option<f64>,
    /// Rate s23 of the third-order tau [1]. Default: 1.74.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub tau: Option<f64>,
    /// Rate s26 of XYZ [1]. Default: 1.74.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub xyz: Option<f64>,
}

/// From this relaxation time on the operator with the rates of Suga lets waves of three cells along the diagonals grow in fluid at
/// rest: by 0.06 % in a step at 0.56, 1 % at 0.6, 5 % at 0.8 (largest eigenvalue over all wave vectors, 16 in half a period).
const SUGA_GROWS: f64 = 0.556;
/// From this relaxation time on runs failed of it: boxes without walls at 0.8, ducts at 0.75, under a lid at 0.7 and not at 0.65.
const SUGA_FAILS: f64 = 0.7;
/// Below this relaxation time the operator with all moments above the second at their equilibrium lets waves grow at rest: by 0.9 % in a
/// step at 0.51. Runs held all the same (`benches/stability/cavity-3d-20`).
const SECOND_ORDER_GROWS: f64 = 0.52;

const CUBE: &[Bounds] = &[
    Bounds::up_to(0.1, 30.0, 90.0),
    Bounds::up_to(f64::INFINITY, 10.0, 20.0),
];
const CUBE_EDDIES: &[Bounds] = &[
    Bounds::up_to(0.03, 300.0, f64::INFINITY),
    Bounds::up_to(0.1, 100.0, 300.0),
    Bounds::up_to(f64::INFINITY, 20.0, 60.0),
];
const CUBE_SECOND_ORDER: &[Bounds] = &Bounds::always(20.0, 30.0);

impl Parameters {
    /// Rates of the moments above the second, where they are given: q, psi, epsilon, `e_cubed`, xx, xy, tau, xyz.
    fn higher_rates(&self) -> [Option<f64>; 8] {
        [
            self.q,
            self.psi,
            self.epsilon,
            self.e_cubed,
            self.xx,
            self.xy,
            self.tau,
            self.xyz,
        ]
        .map(|rate| rate.or(self.higher))
    }

    /// The rates beside that of the shear stress; those of Suga where they are not given.
    #[must_use]
    pub fn rates(&self) -> Rates {
        let suga = Rates::SUGA;
        let [q, psi, epsilon, e_cubed, xx, xy, tau, xyz] = self.higher_rates();
        Rates {
            bulk: self.bulk.unwrap_or(suga.bulk),
            q: q.unwrap_or(suga.q),
            psi: psi.unwrap_or(suga.psi),
            epsilon: epsilon.unwrap_or(suga.epsilon),
            e_cubed: e_cubed.unwrap_or(suga.e_cubed),
            xx: xx.unwrap_or(suga.xx),
            xy: xy.unwrap_or(suga.xy),
            tau: tau.unwrap_or(suga.tau),
            xyz: xyz.unwrap_or(suga.xyz),
        }
    }

    /// Whether the moments above the second go to their equilibrium at once.
    fn second_order(&self) -> bool {
        self.rates().second_order()
    }
}

impl Model for Parameters {
    fn describe(&self, _: f64) -> Description {
        if self.second_order() {
            Description::new(
                "multiple relaxation times of the second moments",
                "requested; higher moments are set to their equilibrium",
            )
        } else {
            Description::new(
                "multiple relaxation times after Suga",
                "requested; non-hydrodynamic moments relax at their own rates",
            )
        }
    }

    fn only_on(&self) -> Option<VelocitySet> {
        Some(VelocitySet::D3Q27)
    }

    fn check(&self, path: &str, relaxation_time: f64) -> Option<Finding> {
        let finding = |severity, reason, remedy: Remedy, operator| Finding {
            path: format!("{path}.mrt"),
            reason,
            remedy: remedy.set(path, operator),
            severity,
        };
        let at = format!("the relaxation time is tau = {}", number(relaxation_time));
        if self.second_order() {
            return (relaxation_time < SECOND_ORDER_GROWS).then(|| {
                finding(
                    Severity::Warning,
                    format!("{at}: below {SECOND_ORDER_GROWS} short waves grow slowly in water at rest with the higher moments at 1"),
                    "check the flow for waves of a few cells, or use cumulant".into(),
                    json!({"cumulant": {}}),
                )
            });
        }
        if self.higher_rates() != [None; 8] || relaxation_time < SUGA_GROWS {
            return None;
        }
        let reason = format!(
            "{at}: with the rates of Suga, made for tau near 1/2, waves of three cells are linearly unstable from {SUGA_GROWS} on"
        );
        let remedy = format!("use trt or cumulant, or `higher`: 1, or a tau below {SUGA_GROWS}");
        let (severity, reason) = if relaxation_time >= SUGA_FAILS {
            (
                Severity::Unstable,
                format!("{reason}, and runs failed from {SUGA_FAILS} on"),
            )
        } else {
            (Severity::Warning, reason)
        };
        Some(finding(severity, reason, remedy.into(), json!({"trt": {}})))
    }

    /// With eddies only flows under a lid are judged; with moments above the second at equilibrium the border then lies beyond the map.
    fn border(&self, situation: &Situation) -> Option<Border> {
        let second_order = self.second_order();
        if situation.eddies && (second_order || !situation.lid_meets_wall) {
            return None;
        }
        Some(border::cube(match (second_order, situation.eddies) {
            (true, _) => CUBE_SECOND_ORDER,
            (false, true) => CUBE_EDDIES,
            (false, false) => CUBE,
        }))
    }

    fn fails_at_faces(&self) -> f64 {
        if self.second_order() { 20.0 } else { 2.0 }
    }

    fn growing_wave(&self, relaxation_time: f64) -> Option<Wave> {
        let rates = self.rates();
        let reported = self.second_order() || rates == Rates::SUGA && relaxation_time >= SUGA_GROWS;
        (!reported && relaxation_time > 0.5).then(|| {
            linear_stability::fastest::<D3Q27, _, 27>(&Mrt::<false> {
                omega: 1.0 / relaxation_time,
                rates,
                force: [0.0; 3],
            })
        })
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        let rates = self.rates();
        if rates.second_order() {
            to.on_d3q27(OfSecondOrder(rates))
        } else {
            to.on_d3q27(rates)
        }
    }
}

impl Kernels for Rates {
    type Uniform<const FORCED: bool> = Mrt<FORCED>;
    type Local = Mrt<true>;
    type Covered = Mrt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> Mrt<FORCED> {
        Mrt {
            omega,
            rates: *self,
            force,
        }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> Mrt<true> {
        self.uniform(omega, force)
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Mrt<true> {
        self.uniform(omega, force)
    }
}

/// Rates of which those above the second moments are 1: the cheaper kernel, but where solids may cover cells.
#[derive(Clone, Copy)]
struct OfSecondOrder(Rates);

impl Kernels for OfSecondOrder {
    type Uniform<const FORCED: bool> = SecondOrder<FORCED>;
    type Local = SecondOrder<true>;
    type Covered = Mrt<true>;

    fn uniform<const FORCED: bool>(&self, omega: f64, force: [f64; 3]) -> SecondOrder<FORCED> {
        let bulk = self.0.bulk;
        SecondOrder { omega, bulk, force }
    }

    fn local(&self, omega: f64, force: [f64; 3]) -> SecondOrder<true> {
        self.uniform(omega, force)
    }

    fn covered(&self, omega: f64, force: [f64; 3]) -> Mrt<true> {
        self.0.covered(omega, force)
    }
}

/// The rates beside that of the shear stress, by the names of Suga et al.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// s4, of the trace of the stress e.
    pub bulk: f64,
    /// s10, of q = Σ c_a (P_b + P_c).
    pub q: f64,
    /// s13, of Ψ = c_a P_b P_c.
    pub psi: f64,
    /// s16, of ε.
    pub epsilon: f64,
    /// s17, of e³.
    pub e_cubed: f64,
    /// s18, of XX and WW.
    pub xx: f64,
    /// s20, of XY, YZ and ZX.
    pub xy: f64,
    /// s23, of τ_x, τ_y and τ_z.
    pub tau: f64,
    /// s26, of XYZ.
    pub xyz: f64,
}

impl Rates {
    /// The rates of Suga et al. (2015), tuned for turbulent flow.
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

    /// One rate for the even moments and one for the odd: then the operator is TRT.
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

    /// Whether all moments above the second go to equilibrium at once.
    #[must_use]
    pub fn second_order(&self) -> bool {
        *self
            == Self {
                bulk: self.bulk,
                ..Self::two(1.0, 1.0)
            }
    }
}

/// MRT, with a uniform body force where `FORCED`.
#[derive(Clone, Copy, Debug)]
pub struct Mrt<const FORCED: bool> {
    /// Rate of the shear stress 1/τ (s5 = s7).
    pub omega: f64,
    /// The other rates.
    pub rates: Rates,
    /// Force density in lattice units.
    pub force: [f64; 3],
}

/// Numbers (rest, +, -) to moments (1, c, P = 3c² - 2).
#[inline(always)]
fn analyse<N: Lanes>(rest: N, plus: N, minus: N) -> [N; 3] {
    let sum = plus + minus;
    [
        rest + sum,
        plus - minus,
        rest.neg_mul_add(N::splat(2.0), sum),
    ]
}

/// Scaled moments (1/3, c/2, P/6) back to numbers (rest, +, -).
#[inline(always)]
fn compose<N: Lanes>([one, c, p]: [N; 3]) -> [N; 3] {
    let sum = one + p;
    [p.neg_mul_add(N::splat(2.0), one), sum + c, sum - c]
}

/// 1 over the norm of the product of polynomials a, b, c (0: 1, 1: c, 2: P).
const fn scale(a: usize, b: usize, c: usize) -> f64 {
    const NORM: [f64; 3] = [3.0, 2.0, 6.0];
    1.0 / (NORM[a] * NORM[b] * NORM[c])
}

impl<const FORCED: bool> Collision for Mrt<FORCED> {
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
        // Along x and y within each plane of c_z, then along z: t[a][b][c] is the moment of the product of polynomials a, b, c.
        let mut t = [[[n::<N>(0.0); 3]; 3]; 3];
        unroll!(axes z < 3 => {
            let mut rows = [[n::<N>(0.0); 3]; 3];
            unroll!(axes y < 3 => {
                rows[y] = analyse(
                    g.incoming(POPULATION[0][y][z]),
                    g.incoming(POPULATION[1][y][z]),
                    g.incoming(POPULATION[2][y][z]),
                );
            });
            unroll!(axes a < 3 => {
                let column = analyse(rows[0][a], rows[1][a], rows[2][a]);
                t[a][0][z] = column[0];
                t[a][1][z] = column[1];
                t[a][2][z] = column[2];
            });
        });
        unroll!(axes x < 3 => {
            unroll!(axes y < 3 => {
                t[x][y] = analyse(t[x][y][0], t[x][y][1], t[x][y][2]);
            });
        });

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

        // m_a u_b, and with a force s = (F_a u_b + F_b u_a)/2, that of the source: a moment t with equilibrium q and source 2s goes to
        // t - rate (t - (q - s)) + 2s.
        let mut square = [m[0] * u[0], m[1] * u[1], m[2] * u[2]];
        let mut cross = [m[0] * u[1], m[1] * u[2], m[2] * u[0]];
        let mut square_source = [n::<N>(0.0); 3];
        let mut cross_source = [n::<N>(0.0); 3];
        let mut linear = m;
        if FORCED {
            unroll!(axes a < 3 => {
                let b = (a + 1) % 3;
                square_source[a] = force[a] * u[a];
                cross_source[a] = force[a].mul_add(u[b], force[b] * u[a]) * n::<N>(0.5);
                square[a] = square[a] - square_source[a];
                cross[a] = cross[a] - cross_source[a];
                // Of the odd moments the source is ±F.
                linear[a] = m[a] - n::<N>(0.5 * self.force[a]);
            });
        }
        let k = &self.rates;

        // What a moment is short of its equilibrium: the change is the rate times this.
        // Second moments P_a: equilibrium -δρ + 3 m_a u_a.
        let mut short = [n::<N>(0.0); 3];
        let diagonal = [t[2][0][0], t[0][2][0], t[0][0][2]];
        unroll!(axes a < 3 => {
            short[a] = square[a].mul_add(n::<N>(3.0), n::<N>(0.0) - (drho + diagonal[a]));
        });
        let mean = (short[0] + short[1] + short[2]) * (n::<N>(k.bulk) - omega) * n::<N>(1.0 / 3.0);
        unroll!(axes a < 3 => {
            let mut value = short[a].mul_add(omega, diagonal[a]) + mean;
            if FORCED {
                value = square_source[a].mul_add(n::<N>(6.0), value);
            }
            let (x, y, z) = ([2, 0, 0][a], [0, 2, 0][a], [0, 0, 2][a]);
            t[x][y][z] = value * n::<N>(scale(2, 0, 0));
        });
        // c_a c_b: m_a u_b.
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 0, 1][a], [1, 1, 0][a], [0, 1, 1][a]);
            let mut value = (cross[a] - t[x][y][z]).mul_add(omega, t[x][y][z]);
            if FORCED {
                value = cross_source[a].mul_add(n::<N>(2.0), value);
            }
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
            if FORCED {
                p = force[a].neg_mul_add(n::<N>(scale(1, 2, 0)), p);
                q = force[a].neg_mul_add(n::<N>(scale(1, 2, 0)), q);
                psi = force[a].mul_add(n::<N>(scale(1, 2, 2)), psi);
            }
            t[first[0]][first[1]][first[2]] = p;
            t[second[0]][second[1]][second[2]] = q;
            t[third[0]][third[1]][third[2]] = psi;
        });
        // P_a P_b: δρ - 3 (m_a u_a + m_b u_b), relaxed as sum and differences; P_x P_y P_z: -δρ + 3 m·u.
        let total = square[0] + square[1] + square[2];
        let quartic = [t[0][2][2], t[2][0][2], t[2][2][0]];
        unroll!(axes a < 3 => {
            // a is the axis that is not in the product.
            short[a] = (total - square[a]).neg_mul_add(n::<N>(3.0), drho - quartic[a]);
        });
        let mean =
            (short[0] + short[1] + short[2]) * n::<N>((k.epsilon - k.xx) / 3.0 * scale(2, 2, 0));
        let mut sources = n::<N>(0.0);
        if FORCED {
            sources = (square_source[0] + square_source[1] + square_source[2]) * n::<N>(6.0);
        }
        unroll!(axes a < 3 => {
            let mut value = short[a].mul_add(
                n::<N>(k.xx * scale(2, 2, 0)),
                quartic[a].mul_add(n::<N>(scale(2, 2, 0)), mean),
            );
            if FORCED {
                let source = square_source[a].neg_mul_add(n::<N>(6.0), sources);
                value = source.neg_mul_add(n::<N>(scale(2, 2, 0)), value);
            }
            let (x, y, z) = ([0, 2, 2][a], [2, 0, 2][a], [2, 2, 0][a]);
            t[x][y][z] = value;
        });
        let target = total.mul_add(n::<N>(3.0), n::<N>(0.0) - drho);
        t[2][2][2] = t[2][2][2].mul_add(
            n::<N>((1.0 - k.e_cubed) * scale(2, 2, 2)),
            target * n::<N>(k.e_cubed * scale(2, 2, 2)),
        );
        if FORCED {
            t[2][2][2] = sources.mul_add(n::<N>(scale(2, 2, 2)), t[2][2][2]);
        }
        // c_a c_b P_c: -m_a u_b; c_x c_y c_z: 0.
        unroll!(axes a < 3 => {
            let (x, y, z) = ([1, 2, 1][a], [1, 1, 2][a], [2, 1, 1][a]);
            let mut value = t[x][y][z].mul_add(
                n::<N>((1.0 - k.xy) * scale(1, 1, 2)),
                cross[a] * n::<N>(-k.xy * scale(1, 1, 2)),
            );
            if FORCED {
                value = cross_source[a].neg_mul_add(n::<N>(2.0 * scale(1, 1, 2)), value);
            }
            t[x][y][z] = value;
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

        unroll!(axes x < 3 => {
            unroll!(axes y < 3 => {
                t[x][y] = compose(t[x][y]);
            });
        });
        unroll!(axes z < 3 => {
            let mut columns = [[n::<N>(0.0); 3]; 3];
            unroll!(axes a < 3 => {
                columns[a] = compose([t[a][0][z], t[a][1][z], t[a][2][z]]);
            });
            unroll!(axes y < 3 => {
                let [rest, plus, minus] = compose([columns[0][y], columns[1][y], columns[2][y]]);
                g.leave(POPULATION[0][y][z], rest);
                g.leave(POPULATION[1][y][z], plus);
                g.leave(POPULATION[2][y][z], minus);
            });
        });
        u
    }
}

#[cfg(test)]
mod tests {
    use super::super::bgk::Bgk;
    use super::super::trt::{AntisymmetricRate, Trt, antisymmetric_rate};
    use super::*;
    use crate::lbm::initial::equilibrium;

    const FORCE: [f64; 3] = [0.011, -0.007, 0.003];

    /// Deviations of some lively cell.
    fn cell(seed: u64) -> [f64; 27] {
        std::array::from_fn(|i| {
            let x = (seed * 27 + i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11;
            (x as f64 / (1_u64 << 53) as f64 - 0.5) * 0.2 * D3Q27::W[i].sqrt()
        })
    }

    /// The integer matrix with a rate for each row.
    fn rows(omega: f64, k: &Rates) -> Vec<([f64; 27], f64)> {
        let text = include_str!("../../../tests/reference/suga_d3q27.csv");
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let order: Vec<[i8; 3]> = lines
            .next()
            .unwrap()
            .split(',')
            .skip(2)
            .map(|c| {
                let c: Vec<i8> = c
                    .trim_matches(['(', ')'])
                    .split(' ')
                    .map(|x| x.parse().unwrap())
                    .collect();
                [c[0], c[1], c[2]]
            })
            .collect();
        lines
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                let rate = match cells[0] {
                    "rho" | "jx" | "jy" | "jz" => 0.0,
                    "e" => k.bulk,
                    "3pxx" | "pww" | "pxy" | "pyz" | "pzx" => omega,
                    "qx" | "qy" | "qz" => k.q,
                    "Psi_x" | "Psi_y" | "Psi_z" => k.psi,
                    "eps" => k.epsilon,
                    "e3" => k.e_cubed,
                    "XX" | "WW" => k.xx,
                    "XY" | "YZ" | "ZX" => k.xy,
                    "tau_x" | "tau_y" | "tau_z" => k.tau,
                    "XYZ" => k.xyz,
                    other => panic!("{other}"),
                };
                let mut row = [0.0; 27];
                for (c, x) in order.iter().zip(&cells[2..]) {
                    let i = D3Q27::C.iter().position(|d| d == c).unwrap();
                    row[i] = x.parse().unwrap();
                }
                (row, rate)
            })
            .collect()
    }

    /// The published form: the whole matrix.
    fn reference(g: &[f64; 27], omega: f64, k: &Rates, force: [f64; 3]) -> [f64; 27] {
        let drho: f64 = g.iter().sum();
        let u: [f64; 3] = std::array::from_fn(|a| {
            let j: f64 = (0..27).map(|i| f64::from(D3Q27::C[i][a]) * g[i]).sum();
            (j + 0.5 * force[a]) / (1.0 + drho)
        });
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let mut out = *g;
        for (row, rate) in rows(omega, k) {
            let (mut short, mut source, mut norm) = (0.0, 0.0, 0.0);
            for i in 0..27 {
                let c = D3Q27::C[i].map(f64::from);
                let guo = 3.0 * (dot(c, force) - dot(u, force)) + 9.0 * dot(c, u) * dot(c, force);
                short += row[i] * (equilibrium(D3Q27::W[i], D3Q27::C[i], drho, u) - g[i]);
                source += row[i] * D3Q27::W[i] * guo;
                norm += row[i] * row[i];
            }
            for i in 0..27 {
                out[i] += row[i] / norm * (rate * short + (1.0 - 0.5 * rate) * source);
            }
        }
        out
    }

    fn close(a: &[f64; 27], b: &[f64; 27]) {
        for i in 0..27 {
            assert!((a[i] - b[i]).abs() < 2e-16 * 27.0, "{i}: {} {}", a[i], b[i]);
        }
    }

    fn collided<C: Collision>(operator: C, g: &[f64; 27]) -> [f64; 27] {
        let mut g = *g;
        operator.collide::<D3Q27, f64, _, 27>(&mut g, &operator.uniform());
        g
    }

    #[test]
    fn the_factorised_form_is_the_matrix_of_suga() {
        for seed in 0..20 {
            let g = cell(seed);
            for omega in [0.3, 1.1, 1.99] {
                let (rates, none) = (Rates::SUGA, [0.0; 3]);
                let plain = Mrt::<false> {
                    omega,
                    rates,
                    force: none,
                };
                close(&collided(plain, &g), &reference(&g, omega, &rates, none));
                let forced = Mrt::<true> {
                    omega,
                    rates,
                    force: FORCE,
                };
                close(&collided(forced, &g), &reference(&g, omega, &rates, FORCE));
            }
        }
    }

    /// Equal rates are BGK; one rate for even and one for odd moments are TRT.
    #[test]
    fn equal_rates_are_bgk_and_paired_rates_are_trt() {
        for seed in 0..20 {
            let g = cell(seed);
            for omega in [0.3, 1.1, 1.99] {
                let force = FORCE;
                let rates = Rates::two(omega, omega);
                close(
                    &collided(
                        Mrt::<true> {
                            omega,
                            rates,
                            force,
                        },
                        &g,
                    ),
                    &collided(Bgk::<true> { omega, force }, &g),
                );
                close(
                    &collided(
                        Mrt::<false> {
                            omega,
                            rates,
                            force,
                        },
                        &g,
                    ),
                    &collided(Bgk::<false> { omega, force }, &g),
                );
                let magic = 3.0 / 16.0;
                let rates = Rates::two(omega, antisymmetric_rate(omega, magic));
                close(
                    &collided(
                        Mrt::<true> {
                            omega,
                            rates,
                            force,
                        },
                        &g,
                    ),
                    &collided(
                        Trt::<true> {
                            omega,
                            antisymmetric: AntisymmetricRate::Magic(magic),
                            force,
                        },
                        &g,
                    ),
                );
                close(
                    &collided(
                        Mrt::<false> {
                            omega,
                            rates,
                            force,
                        },
                        &g,
                    ),
                    &collided(
                        Trt::<false> {
                            omega,
                            antisymmetric: AntisymmetricRate::Magic(magic),
                            force,
                        },
                        &g,
                    ),
                );
            }
        }
    }

    /// Rates of a cell's own are the uniform ones where the viscosity is the same.
    #[test]
    fn local_rates_are_those_of_the_viscosity() {
        let operator = Trt::<false> {
            omega: 1.3,
            antisymmetric: AntisymmetricRate::Magic(0.25),
            force: [0.0; 3],
        };
        let g = cell(7);
        let mut local = g;
        operator.collide::<D3Q27, f64, _, 27>(&mut local, &operator.local(1.3));
        close(&local, &collided(operator, &g));
        let (omega, force) = (1.3, FORCE);
        let equal = Trt::<true> {
            omega,
            antisymmetric: AntisymmetricRate::AsSymmetric,
            force,
        };
        let mut local = g;
        equal.collide::<D3Q27, f64, _, 27>(&mut local, &equal.local(omega));
        close(&local, &collided(Bgk::<true> { omega, force }, &g));
    }
}
