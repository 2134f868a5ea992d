//! The linear contact-bond law of the fissure paper's clay (C-03, C-04); its sand is [`super::linear`] (C-02).
//!
//! ```text
//! bonded:    F_n = k_n (overlap - rest) - c_n d(gap)/dt      also in tension, down to -T
//!            F_s = F_s' - k_s slip dt - c_s slip             up to S, without sliding
//! unbonded:  the linear law with Coulomb friction, pushing only
//! ```
//!
//! A bond is a point of glue: it bears no moment and does not slip, whatever the friction would allow. It fails in tension
//! where its normal spring pulls with more than the tensile strength T, else in shear where its shear spring bears more than
//! the shear strength S, and is then gone for good: from the same step on the contact is an unbonded one, which
//! keeps of the shear force what friction bears, and nothing across a gap. Strengths are forces and act on the springs alone, not on the
//! dashpots, which are fractions of critical damping as in [`super::linear`].
//!
//! Bonds are made once, between all pairs whose surfaces are no further apart than the bonding gap. `rest` says what the normal
//! spring of a bond across a gap measures from: 0, so that it pulls at once with k_n times the gap (a gap beyond T/k_n fails
//! in the first step), or, with `unstressed`, the gap it was made at, so that it starts without a force. Once
//! broken, overlaps count from contact again. With the paper's numbers (C-05) a bond opens by T/k_n = 1e-5 m and shears by
//! S/k_s = 5e-5 m.
//! Source: D. O. Potyondy, P. A. Cundall, Int. J. Rock Mech. Min. Sci. 41 (2004) 1329, doi:10.1016/j.ijrmms.2004.09.011.

use serde::{Deserialize, Serialize};

use super::super::space::{Components, Space};
use super::{
    ContactLaw, Failure, PairTable, PairProperties, ContactForce, ContactKinematics, linear, load_tangent, save_tangent,
};

/// Parameters of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The springs, dashpots and friction.
    pub linear: linear::Parameters,
    /// Tensile strength T of a bond (N; in the plane N per m of depth).
    pub tensile_strength: f64,
    /// Shear strength S of a bond (N; in the plane N per m of depth).
    pub shear_strength: f64,
    /// Surfaces at most so far apart (m) are bonded.
    #[serde(default)]
    pub bonding_gap: f64,
    /// Whether a bond made across a gap starts without a force.
    #[serde(default)]
    pub unstressed: bool,
}

/// The law: see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactBond {
    /// Per pair of materials.
    pub parameters: PairTable<Parameters>,
}

/// Per pair of materials: the linear law's, strengths (N), bonding gap (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    linear: linear::Row,
    tensile: f64,
    shear: f64,
    gap: f64,
    unstressed: bool,
}

/// Per pair: the linear law's, strengths (N), bonding gap (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    linear: linear::Constants,
    tensile: f64,
    shear: f64,
    gap: f64,
    unstressed: bool,
}

/// The force of the shear spring (N) on the second partner, and of a bond the overlap (m) without a normal force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History<S: Space> {
    shear: S::Tangent,
    rest: f64,
    bonded: bool,
}

impl<S: Space> ContactLaw<S> for ContactBond {
    type Row = Row;
    type Scale = f64;
    type Constants = Constants;
    type History = History<S>;
    const NUMBERS: usize = S::Tangent::COUNT + 2;

    fn table(&self) -> PairTable<Row> {
        self.parameters.map(|p| Row {
            linear: p.linear.row(),
            tensile: p.tensile_strength,
            shear: p.shear_strength,
            gap: p.bonding_gap,
            unstressed: p.unstressed,
        })
    }

    fn scale(row: &Row, pair: &PairProperties) -> f64 {
        row.linear.scale(pair)
    }

    #[inline(always)]
    fn constants(row: &Row, root: &f64, diameter: f64) -> Constants {
        Constants {
            linear: row.linear.constants(*root, diameter),
            tensile: row.tensile,
            shear: row.shear,
            gap: row.gap,
            unstressed: row.unstressed,
        }
    }

    #[inline(always)]
    fn force(c: &Constants, history: &mut History<S>, kinematics: &ContactKinematics<S>) -> ContactForce<S> {
        if !history.bonded {
            return c.linear.slide(&mut history.shear, kinematics);
        }
        let normal = c.linear.normal * (kinematics.overlap - history.rest);
        let shear =
            S::turn(&history.shear, &kinematics.normal) - kinematics.slip * (c.linear.shear * kinematics.time_step);
        let failure = if normal < -c.tensile {
            Failure::Tension
        } else if shear.length() > c.shear {
            Failure::Shear
        } else {
            history.shear = shear;
            return ContactForce {
                normal: normal - c.linear.normal_dashpot * kinematics.separation_rate,
                tangent: shear - kinematics.slip * c.linear.shear_dashpot,
                moment: S::Spin::default(),
                failure: None,
            };
        };
        let mut broken = History {
            shear: history.shear,
            ..History::default()
        };
        let force = if kinematics.overlap > 0.0 {
            c.linear.slide(&mut broken.shear, kinematics)
        } else {
            broken = History::default();
            ContactForce {
                normal: 0.0,
                tangent: S::Tangent::default(),
                moment: S::Spin::default(),
                failure: None,
            }
        };
        *history = broken;
        ContactForce {
            failure: Some(failure),
            ..force
        }
    }

    #[inline(always)]
    fn bonded(history: &History<S>) -> bool {
        history.bonded
    }

    fn bonding_gap(c: &Constants) -> f64 {
        c.gap
    }

    fn bond(c: &Constants, history: &mut History<S>, overlap: f64) -> bool {
        history.bonded = c.tensile > 0.0 || c.shear > 0.0;
        history.rest = if c.unstressed { overlap.min(0.0) } else { 0.0 };
        history.bonded
    }

    fn unbond(history: &mut History<S>) {
        history.bonded = false;
        history.rest = 0.0;
    }

    fn normal_spring(c: &Constants, history: &History<S>, overlap: f64) -> f64 {
        c.linear.normal * (overlap - history.rest)
    }

    fn widest_opening(&self, diameters: [f64; 2]) -> f64 {
        let opening = |p: &Parameters, d: f64| {
            let scale = if p.linear.stiffness_per_diameter {
                d
            } else {
                1.0
            };
            p.bonding_gap + p.tensile_strength / (p.linear.normal_stiffness * scale)
        };
        self.parameters
            .rows()
            .filter(|p| p.tensile_strength > 0.0 || p.shear_strength > 0.0)
            .flat_map(|p| diameters.map(|d| opening(p, d)))
            .fold(0.0, f64::max)
    }

    fn stiffness(c: &Constants) -> [f64; 2] {
        [c.linear.normal, c.linear.shear]
    }

    fn save(history: &History<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
        numbers.push(history.rest);
        numbers.push(if history.bonded { 1.0 } else { 0.0 });
    }

    fn load(numbers: &[f64]) -> History<S> {
        let number = |k| numbers.get(k).copied().unwrap_or(0.0);
        History {
            shear: load_tangent(numbers),
            rest: number(S::Tangent::COUNT),
            bonded: number(S::Tangent::COUNT + 1) > 0.5,
        }
    }
}
