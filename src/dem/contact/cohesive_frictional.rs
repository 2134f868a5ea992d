//! Linear springs with friction and brittle cohesion: the cohesive-frictional law.
//!
//! ```text
//! F_n = k_n overlap,                        while bonded also in tension, down to -C
//! F_s = F_s' - k_s slip dt,                 |F_s| <= F_n tan(phi) + C while bonded, else F_n tan(phi)
//! ```
//!
//! A bond fails in tension above the force C, and the contact ends. A bond sheared beyond its limit permanently
//! loses tensile and shear cohesion. The shear force drops at once to the friction limit, or to zero if the contact
//! was in tension. Bonds are made once, at the existing contacts with their present forces; broken bonds do not
//! heal. With k_n and C proportional to the pair's mean diameter d, the bond opens by C/k_n for any d. Optional
//! dashpots, fractions of critical damping as in [`super::linear`], add to the springs' forces and do not
//! contribute to failure; without a bond they never pull.
//!
//! Source: L. Sibille, F. Lominé, D. Marot, ICSE-6 (2012) 885; checked against trajectories of YADE 2023.02a
//! (`Law2_ScGeom6D_CohFrictPhys_CohesionMoment`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::engine::bodies::Bodies;
use super::super::space::{Components, Space};
use super::input::{coefficient, default_ratio, pair_table, parameters_of_grains};
use super::linear::{LinearConstants, LinearParameters, LinearRow, model_of_linear_springs};
use super::{
    ContactForce, ContactKinematics, ContactLaw, ContactModel, ContactParameters, Failure, Pair,
    PairProperties, PairTable, Scaled, SceneFacts, cut_to, load_tangent, save_tangent,
};
use base::error::Report;

/// F_n = k_n δ down to -C; |F_s| <= F_n tan Φ + C; a contact that opens or slips loses C for good.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "CohesiveFrictional")]
pub struct CohesiveFrictionalInput {
    /// Normal stiffness k_n [N/m]; per diameter [N/m2].
    pub normal_stiffness: Scaled,
    /// Shear to normal stiffness k_s/k_n \[1\].
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ \[degrees\]. Default: 0, no friction; a warning says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Cohesion C = C_s = -C_n of a bonded contact \[N\]; per diameter [N/m].
    #[serde(default)]
    pub cohesion: Scaled,
    /// Dashpot in parallel with the normal spring, as a fraction of the critical damping of the pair.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: f64,
    /// Dashpot in parallel with the shear spring, as a fraction of the critical damping of the pair. Default: 0; for
    /// bodies in partially saturated cells the normal damping ratio, because the load of the water follows their motion
    /// with a delay, which excites springs without dashpots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: Option<f64>,
    /// Local (non-viscous) damping \[1\]: a force of this fraction of the force on a grain acts against its motion; 0
    /// turns it off.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Parameters of pairs of materials that differ from those above.
    #[serde(default)]
    pub pairs: Vec<Pair>,
}

impl<F: From<CohesiveFrictional>> ContactParameters<F> for CohesiveFrictionalInput {
    parameters_of_grains!();

    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F> {
        let path = "contact.cohesive_frictional";
        let base = CohesiveFrictionalParameters {
            linear: LinearParameters {
                normal_stiffness: self.normal_stiffness,
                stiffness_ratio: self.shear_to_normal_stiffness,
                friction: coefficient(self.friction_angle_degrees.unwrap_or(0.0)),
                normal_damping_ratio: self.normal_damping_ratio,
                shear_damping_ratio: scene
                    .shear_damping(self.shear_damping_ratio, self.normal_damping_ratio),
                attraction: false,
            },
            cohesion: self.cohesion,
        };
        base.linear.check(path, report);
        let parameters = pair_table(
            (path, scene),
            PairTable::uniform(scene.material_count(), base),
            (&self.pairs, |pair| &pair.materials),
            report,
            |_, pair, path, report| {
                pair.check_stiffness(path, report);
                pair.refuse_strengths(path, report);
                CohesiveFrictionalParameters {
                    linear: base.linear.overridden(pair),
                    cohesion: pair.cohesion.unwrap_or(base.cohesion),
                }
            },
        );
        Some(CohesiveFrictional { parameters }.into())
    }
}

/// Parameters of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CohesiveFrictionalParameters {
    /// Springs, dashpots and friction.
    #[serde(flatten)]
    pub linear: LinearParameters,
    /// Cohesion C \[N\]; in the plane [N per m of depth].
    pub cohesion: Scaled,
}

/// Cohesive-frictional law: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CohesiveFrictional {
    /// Parameters per pair of materials.
    pub parameters: PairTable<CohesiveFrictionalParameters>,
}

impl ContactModel for CohesiveFrictional {
    fn describe(&self) -> String {
        "linear, cohesive-frictional".into()
    }

    model_of_linear_springs!("cohesive_frictional", linear);

    fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>) {
        for pair in self.parameters.rows_mut() {
            pair.linear.prepare(normal_stiffness, friction);
            if normal_stiffness.is_some() {
                pair.cohesion = Scaled::ZERO;
            }
        }
    }

    fn bonds(&self) -> bool {
        true
    }

    fn cohesion(&self, [a, b]: [u32; 2]) -> Scaled {
        self.parameters.get(a, b).cohesion
    }
}

/// Values per pair of materials: those of the linear law, and the cohesion as a constant and per diameter, one of
/// which is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CohesiveFrictionalRow {
    linear: LinearRow,
    cohesion: [f64; 2],
}

/// Values per pair: those of the linear law, and the cohesion of a new bond \[N\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CohesiveFrictionalConstants {
    linear: LinearConstants,
    cohesion: f64,
}

/// Force of the shear spring \[N\] on the second partner, and cohesion \[N\], 0 without a bond.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CohesiveFrictionalHistory<S: Space> {
    shear: S::Tangent,
    cohesion: f64,
}

impl<S: Space> ContactLaw<S> for CohesiveFrictional {
    type Row = CohesiveFrictionalRow;
    type Scale = f64;
    type Constants = CohesiveFrictionalConstants;
    type History = CohesiveFrictionalHistory<S>;
    const NUMBERS: usize = S::Tangent::COUNT + 1;

    fn table(&self) -> PairTable<CohesiveFrictionalRow> {
        self.parameters.map(|p| {
            let linear = LinearParameters {
                // Computed through the angle in degrees, which affects the last bit: checkpoints of older runs
                // continue with the same bits.
                friction: coefficient(p.linear.friction.atan().to_degrees()),
                ..p.linear
            };
            CohesiveFrictionalRow {
                linear: linear.row(),
                cohesion: p.cohesion.parts(),
            }
        })
    }

    fn scale(row: &CohesiveFrictionalRow, pair: &PairProperties) -> f64 {
        row.linear.scale(pair)
    }

    #[inline(always)]
    fn constants(
        row: &CohesiveFrictionalRow,
        root: &f64,
        diameter: f64,
    ) -> CohesiveFrictionalConstants {
        let [constant, per_diameter] = row.cohesion;
        CohesiveFrictionalConstants {
            linear: row.linear.constants(*root, diameter),
            cohesion: constant + per_diameter * diameter,
        }
    }

    #[inline(always)]
    fn force(
        c: &CohesiveFrictionalConstants,
        history: &mut CohesiveFrictionalHistory<S>,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let c = &c.linear;
        let normal = c.normal * kinematics.overlap;
        let shear = c.carried(&history.shear, kinematics);
        let length = shear.length();
        let limit = normal * c.friction + history.cohesion;
        if length <= limit && normal >= -history.cohesion {
            history.shear = shear;
            let bonded = history.cohesion > 0.0;
            let (least, dashpot) = if bonded {
                (f64::NEG_INFINITY, c.bond_dashpot(kinematics.time_step))
            } else {
                (0.0, c.normal_dashpot(kinematics))
            };
            return ContactForce {
                normal: (normal - dashpot * kinematics.separation_rate).max(least),
                tangent: shear - kinematics.slip * c.shear_dashpot,
                moment: S::Spin::default(),
                failure: None,
            };
        }
        // Sliding, or failure of a bond: in tension if the tensile force exceeds the cohesion, otherwise in shear.
        let failure = match history.cohesion > 0.0 {
            false => None,
            true if normal < -history.cohesion => Some(Failure::Tension),
            true => Some(Failure::Shear),
        };
        let normal = normal.max(0.0);
        let tangent = cut_to(shear, length, normal * c.friction);
        *history = CohesiveFrictionalHistory {
            shear: tangent,
            cohesion: 0.0,
        };
        let dashpot = if kinematics.overlap > 0.0 {
            c.normal_dashpot(kinematics)
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
    fn bonded(history: &CohesiveFrictionalHistory<S>) -> bool {
        history.cohesion > 0.0
    }

    fn bond(
        c: &CohesiveFrictionalConstants,
        history: &mut CohesiveFrictionalHistory<S>,
        _: f64,
    ) -> bool {
        history.cohesion = c.cohesion;
        c.cohesion > 0.0
    }

    fn strengthen(&mut self, factor: f64) {
        for pair in self.parameters.rows_mut() {
            pair.cohesion = pair.cohesion.times(factor);
        }
    }

    fn strengthen_bond(history: &mut CohesiveFrictionalHistory<S>, factor: f64) {
        history.cohesion *= factor;
    }

    fn widest_opening(&self, diameters: [f64; 2]) -> f64 {
        // C/k_n is a monotonic function of the diameter, or independent of it.
        let opening = |p: &CohesiveFrictionalParameters, d: f64| {
            p.cohesion.for_diameter(d) / p.linear.normal_stiffness.for_diameter(d)
        };
        self.parameters
            .rows()
            .flat_map(|p| diameters.map(|d| opening(p, d)))
            .fold(0.0, f64::max)
    }

    fn shear_spring(history: &CohesiveFrictionalHistory<S>) -> S::Tangent {
        history.shear
    }

    fn stiffness(c: &CohesiveFrictionalConstants) -> [f64; 2] {
        [c.linear.normal, c.linear.shear]
    }

    fn save(history: &CohesiveFrictionalHistory<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
        numbers.push(history.cohesion);
    }

    fn load(numbers: &[f64]) -> CohesiveFrictionalHistory<S> {
        CohesiveFrictionalHistory {
            shear: load_tangent(numbers),
            cohesion: numbers.get(S::Tangent::COUNT).copied().unwrap_or(0.0),
        }
    }
}

impl<S: Space> Bodies<S> for CohesiveFrictional {
    type Scratch = ();
}
