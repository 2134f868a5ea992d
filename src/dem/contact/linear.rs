//! Linear springs and dashpots with Coulomb friction (C-02).
//!
//! ```text
//! F_n = k_n overlap - c_n d(gap)/dt              pushing; pulling only with `attraction`
//! F_s = cut(F_s' - k_s slip dt - c_s slip)       cut to length mu max(F_n, 0)
//! ```
//!
//! `F_s'` is the spring's force of the last step, turned with the contact. The dashpots are given as fractions of critical
//! damping of the pair: `c = 2 zeta sqrt(m* k)` with the pair's effective mass `m*`. A head-on collision with attraction then
//! restitutes `e = exp(-pi zeta / sqrt(1 - zeta^2))` and lasts `pi sqrt(m*/k) / sqrt(1 - zeta^2)`; without attraction
//! it ends earlier and restitutes more. While sliding the spring holds the limit and the shear dashpot rests.
//! Source: P. A. Cundall, O. D. L. Strack, Géotechnique 29 (1979) 47, doi:10.1680/geot.1979.29.1.47.

use serde::{Deserialize, Serialize};

use super::super::space::{Components, Space};
use super::{ContactLaw, PairTable, PairProperties, ContactForce, ContactKinematics, cut_to, load_tangent, save_tangent};

/// Parameters of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Normal stiffness (N/m; in the plane N/m per m of depth), or per metre of diameter: see `stiffness_per_diameter`.
    pub normal_stiffness: f64,
    /// Whether the stiffness is the given number times the pair's mean diameter (a wall: the grain's diameter).
    #[serde(default)]
    pub stiffness_per_diameter: bool,
    /// Shear over normal stiffness.
    pub stiffness_ratio: f64,
    /// Coefficient of friction, the tangent of the friction angle.
    pub friction: f64,
    /// Normal dashpot as a fraction of critical damping.
    #[serde(default)]
    pub normal_damping: f64,
    /// Shear dashpot as a fraction of critical damping.
    #[serde(default)]
    pub shear_damping: f64,
    /// Whether the dashpot may pull.
    #[serde(default)]
    pub attraction: bool,
}

/// The law: see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Per pair of materials.
    pub parameters: PairTable<Parameters>,
}

/// Per pair: stiffnesses (N/m), dashpots (N s/m), friction, and the least normal force (N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    pub(super) normal: f64,
    pub(super) shear: f64,
    pub(super) normal_dashpot: f64,
    pub(super) shear_dashpot: f64,
    pub(super) friction: f64,
    least: f64,
}

/// Per pair of materials: one of the two stiffnesses (N/m, N/m²) is zero; dashpots over the root of mass times stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    normal: f64,
    per_diameter: f64,
    ratio: f64,
    normal_dashpot: f64,
    shear_dashpot: f64,
    friction: f64,
    least: f64,
}

impl Parameters {
    pub(super) fn row(&self) -> Row {
        let (normal, per_diameter) = if self.stiffness_per_diameter {
            (0.0, self.normal_stiffness)
        } else {
            (self.normal_stiffness, 0.0)
        };
        Row {
            normal,
            per_diameter,
            ratio: self.stiffness_ratio,
            normal_dashpot: 2.0 * self.normal_damping,
            shear_dashpot: 2.0 * self.shear_damping * self.stiffness_ratio.sqrt(),
            friction: self.friction,
            least: if self.attraction {
                f64::NEG_INFINITY
            } else {
                0.0
            },
        }
    }
}

impl Row {
    #[inline(always)]
    fn normal(&self, diameter: f64) -> f64 {
        self.normal + self.per_diameter * diameter
    }

    /// The root of mass times normal stiffness (N s/m).
    pub(super) fn scale(&self, pair: &PairProperties) -> f64 {
        (pair.mass * self.normal(pair.diameter)).sqrt()
    }

    #[inline(always)]
    pub(super) fn constants(&self, root: f64, diameter: f64) -> Constants {
        let normal = self.normal(diameter);
        Constants {
            normal,
            shear: normal * self.ratio,
            normal_dashpot: self.normal_dashpot * root,
            shear_dashpot: self.shear_dashpot * root,
            friction: self.friction,
            least: self.least,
        }
    }
}

impl Constants {
    /// The force of an unbonded contact; `shear` is the force of the shear spring (N).
    #[inline(always)]
    pub(super) fn slide<S: Space>(&self, shear: &mut S::Tangent, kinematics: &ContactKinematics<S>) -> ContactForce<S> {
        let normal = (self.normal * kinematics.overlap - self.normal_dashpot * kinematics.separation_rate)
            .max(self.least);
        let spring = S::turn(shear, &kinematics.normal) - kinematics.slip * (self.shear * kinematics.time_step);
        let dashpot = kinematics.slip * self.shear_dashpot;
        let total = spring - dashpot;
        let (length, limit) = (total.length(), self.friction * normal.max(0.0));
        let tangent = cut_to(total, length, limit);
        *shear = if length > limit { tangent } else { spring };
        ContactForce {
            normal,
            tangent,
            moment: S::Spin::default(),
            failure: None,
        }
    }
}

impl<S: Space> ContactLaw<S> for Linear {
    type Row = Row;
    type Scale = f64;
    type Constants = Constants;
    type History = History<S>;
    const NUMBERS: usize = S::Tangent::COUNT;

    fn table(&self) -> PairTable<Row> {
        self.parameters.map(Parameters::row)
    }

    fn scale(row: &Row, pair: &PairProperties) -> f64 {
        row.scale(pair)
    }

    #[inline(always)]
    fn constants(row: &Row, root: &f64, diameter: f64) -> Constants {
        row.constants(*root, diameter)
    }

    #[inline(always)]
    fn force(c: &Constants, history: &mut History<S>, kinematics: &ContactKinematics<S>) -> ContactForce<S> {
        c.slide(&mut history.shear, kinematics)
    }

    #[inline(always)]
    fn bonded(_: &History<S>) -> bool {
        false
    }

    fn bond(_: &Constants, _: &mut History<S>, _: f64) -> bool {
        false
    }

    fn unbond(_: &mut History<S>) {}

    fn widest_opening(&self, _: [f64; 2]) -> f64 {
        0.0
    }

    fn stiffness(c: &Constants) -> [f64; 2] {
        [c.normal, c.shear]
    }

    fn save(history: &History<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
    }

    fn load(numbers: &[f64]) -> History<S> {
        History {
            shear: load_tangent(numbers),
        }
    }
}

/// The force of the shear spring (N) on the second partner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History<S: Space> {
    shear: S::Tangent,
}
