//! The cohesive-frictional law of the piping paper (A-17 … A-21, E-04).
//!
//! ```text
//! F_n = k_n overlap,                        while bonded also in tension, down to -C
//! F_s = F_s' - k_s slip dt,                 |F_s| <= F_n tan(phi) + C while bonded, else F_n tan(phi)
//! ```
//!
//! A bond that is pulled with more than C fails in tension and the contact is lost; one that is sheared beyond its limit loses
//! both cohesions for good and drops at once to friction, or to nothing where it was in tension. Bonds are made once,
//! where contacts then exist, at the forces they then carry (A-20): nothing heals.
//! With k_n and C proportional to the pair's mean diameter d the bond opens by C/k_n whatever d.
//! Optional dashpots, fractions of critical damping as in [`super::linear`], add to the springs' forces and do not
//! take part in failure; without a bond they never pull.
//! Source: L. Sibille, F. Lominé, D. Marot, ICSE-6 (2012) 885; checked against trajectories of YADE 2023.02a
//! (`Law2_ScGeom6D_CohFrictPhys_CohesionMoment`).

use serde::{Deserialize, Serialize};

use super::super::space::{Components, Space};
use super::{
    ContactLaw, Failure, PairTable, PairProperties, ContactForce, ContactKinematics, cut_to, load_tangent, save_tangent,
};

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
    /// Friction angle (degrees).
    pub friction_angle: f64,
    /// Cohesion C (N; in the plane N per m of depth), or per metre of diameter: see `cohesion_per_diameter`.
    pub cohesion: f64,
    /// Whether the cohesion is the given number times the pair's mean diameter (a wall: the grain's diameter).
    #[serde(default)]
    pub cohesion_per_diameter: bool,
    /// Normal dashpot as a fraction of critical damping.
    #[serde(default)]
    pub normal_damping: f64,
    /// Shear dashpot as a fraction of critical damping.
    #[serde(default)]
    pub shear_damping: f64,
}

/// The law: see the module.
#[derive(Clone, Debug, PartialEq)]
pub struct CohesiveFrictional {
    /// Per pair of materials.
    pub parameters: PairTable<Parameters>,
}

/// Per pair of materials: stiffness and cohesion as a constant and per diameter, one of them zero; dashpots over the root of
/// mass times stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    normal: [f64; 2],
    ratio: f64,
    normal_dashpot: f64,
    shear_dashpot: f64,
    friction: f64,
    cohesion: [f64; 2],
}

#[inline(always)]
fn at([constant, per_diameter]: [f64; 2], diameter: f64) -> f64 {
    constant + per_diameter * diameter
}

/// Per pair: stiffnesses (N/m), dashpots (N s/m), friction, and the cohesion of a new bond (N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    normal: f64,
    shear: f64,
    normal_dashpot: f64,
    shear_dashpot: f64,
    friction: f64,
    cohesion: f64,
}

/// The force of the shear spring (N) on the second partner, and the cohesion (N), 0 without a bond.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History<S: Space> {
    shear: S::Tangent,
    cohesion: f64,
}

impl<S: Space> ContactLaw<S> for CohesiveFrictional {
    type Row = Row;
    type Scale = f64;
    type Constants = Constants;
    type History = History<S>;
    const NUMBERS: usize = S::Tangent::COUNT + 1;

    fn table(&self) -> PairTable<Row> {
        let split = |value: f64, per_diameter| {
            if per_diameter {
                [0.0, value]
            } else {
                [value, 0.0]
            }
        };
        self.parameters.map(|p| Row {
            normal: split(p.normal_stiffness, p.stiffness_per_diameter),
            ratio: p.stiffness_ratio,
            normal_dashpot: 2.0 * p.normal_damping,
            shear_dashpot: 2.0 * p.shear_damping * p.stiffness_ratio.sqrt(),
            friction: p.friction_angle.to_radians().tan(),
            cohesion: split(p.cohesion, p.cohesion_per_diameter),
        })
    }

    fn scale(row: &Row, pair: &PairProperties) -> f64 {
        (pair.mass * at(row.normal, pair.diameter)).sqrt()
    }

    #[inline(always)]
    fn constants(row: &Row, root: &f64, diameter: f64) -> Constants {
        let normal = at(row.normal, diameter);
        Constants {
            normal,
            shear: normal * row.ratio,
            normal_dashpot: row.normal_dashpot * root,
            shear_dashpot: row.shear_dashpot * root,
            friction: row.friction,
            cohesion: at(row.cohesion, diameter),
        }
    }

    #[inline(always)]
    fn force(c: &Constants, history: &mut History<S>, kinematics: &ContactKinematics<S>) -> ContactForce<S> {
        let normal = c.normal * kinematics.overlap;
        let shear =
            S::turn(&history.shear, &kinematics.normal) - kinematics.slip * (c.shear * kinematics.time_step);
        let length = shear.length();
        let limit = normal * c.friction + history.cohesion;
        if length <= limit && normal >= -history.cohesion {
            history.shear = shear;
            let least = if history.cohesion > 0.0 {
                f64::NEG_INFINITY
            } else {
                0.0
            };
            return ContactForce {
                normal: (normal - c.normal_dashpot * kinematics.separation_rate).max(least),
                tangent: shear - kinematics.slip * c.shear_dashpot,
                moment: S::Spin::default(),
                failure: None,
            };
        }
        // Sliding, or the end of a bond: tension where it pulls more than the cohesion, else shear.
        let failure = match history.cohesion > 0.0 {
            false => None,
            true if normal < -history.cohesion => Some(Failure::Tension),
            true => Some(Failure::Shear),
        };
        let normal = normal.max(0.0);
        let tangent = cut_to(shear, length, normal * c.friction);
        *history = History {
            shear: tangent,
            cohesion: 0.0,
        };
        let dashpot = if kinematics.overlap > 0.0 {
            c.normal_dashpot
        } else {
            0.0
        };
        ContactForce {
            normal: (normal - dashpot * kinematics.separation_rate).max(0.0),
            tangent,
            moment: S::Spin::default(),
            failure,
        }
    }

    #[inline(always)]
    fn bonded(history: &History<S>) -> bool {
        history.cohesion > 0.0
    }

    fn bond(c: &Constants, history: &mut History<S>, _: f64) -> bool {
        history.cohesion = c.cohesion;
        c.cohesion > 0.0
    }

    fn unbond(history: &mut History<S>) {
        history.cohesion = 0.0;
    }

    fn widest_opening(&self, diameters: [f64; 2]) -> f64 {
        let scale = |per_diameter, d| if per_diameter { d } else { 1.0 };
        // C/k_n is monotone in the diameter, or does not depend on it.
        let opening = |p: &Parameters, d: f64| {
            p.cohesion * scale(p.cohesion_per_diameter, d)
                / (p.normal_stiffness * scale(p.stiffness_per_diameter, d))
        };
        self.parameters
            .rows()
            .flat_map(|p| diameters.map(|d| opening(p, d)))
            .fold(0.0, f64::max)
    }

    fn stiffness(c: &Constants) -> [f64; 2] {
        [c.normal, c.shear]
    }

    fn save(history: &History<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
        numbers.push(history.cohesion);
    }

    fn load(numbers: &[f64]) -> History<S> {
        History {
            shear: load_tangent(numbers),
            cohesion: numbers.get(S::Tangent::COUNT).copied().unwrap_or(0.0),
        }
    }
}
