//! The linear contact-bond law: [`super::linear`] with bonds of given tensile and shear strength.
//!
//! ```text
//! bonded:    F_n = k_n (overlap - rest) - c_n d(gap)/dt      also in tension, down to -T
//!            F_s = F_s' - k_s slip dt - c_s slip             up to S, without sliding
//! unbonded:  the linear law with Coulomb friction, pushing only
//! ```
//!
//! A bond acts at a point: it transmits no moment and does not slip, independently of friction. It fails in tension if
//! its normal spring pulls with more than the tensile strength T, otherwise in shear if its shear spring exceeds the
//! shear strength S. A failed bond does not heal. From the same step on the contact is unbonded: its shear force is
//! reduced to the friction limit, and to zero across a gap. Strengths are forces and apply to the springs alone, not to
//! the dashpots, which are fractions of critical damping as in [`super::linear`].
//!
//! Bonds are created once, between all pairs whose gap is at most the bonding gap. `zero_force_overlap` is the
//! overlap at which the normal spring of a bond has no force. If it is 0, a bond across a gap starts with a tensile
//! force of k_n times the gap, and fails in the first step if the gap exceeds T/k_n. With `unstressed` it is the
//! overlap at which the bond was created, so that the bond starts without a force. After failure, overlaps are
//! measured from contact again. Before failure a bond opens by T/k_n and shears by S/k_s.
//!
//! Source: D. O. Potyondy, P. A. Cundall, Int. J. Rock Mech. Min. Sci. 41 (2004) 1329,
//! doi:10.1016/j.ijrmms.2004.09.011.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::engine::bodies::Bodies;
use super::super::space::{Components, Space};
use super::input::{coefficient, default_ratio, pair_table, parameters_of_grains};
use super::linear::model_of_linear_springs;
use super::rolling::{self, Rolling};
use super::softened::{self, BondStrength, Softened};
use super::{
    BondOpening, ContactForce, ContactKinematics, ContactLaw, ContactModel, ContactParameters,
    Failure, Pair, PairProperties, PairTable, Scaled, SceneFacts, linear, load_tangent,
    save_tangent,
};
use base::error::Report;

/// Bonded: F_n = k_n δ down to minus the tensile strength, |F_s| up to the shear strength, no sliding and no moment.
/// A bond that fails is gone for good; without one the law is the linear one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ContactBond")]
pub struct ContactBondInput {
    /// Normal stiffness k_n [N/m]; per diameter [N/m2].
    pub normal_stiffness: Scaled,
    /// Shear to normal stiffness k_s/k_n \[1\].
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ of contacts without a bond \[degrees\]. Default: 0, no friction; a warning says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Tensile strength of a bond \[N\]; in 2-D per metre of depth.
    #[schemars(range(min = 0.0))]
    pub tensile_strength: f64,
    /// Shear strength of a bond \[N\]; in 2-D per metre of depth.
    #[schemars(range(min = 0.0))]
    pub shear_strength: f64,
    /// Largest gap between two surfaces that `bond_at_start` bonds \[m\]; with 0 only bodies in contact are bonded.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub bonding_gap: f64,
    /// `true` if a bond across a gap starts without a force. Otherwise it starts with a tensile force of k_n times the
    /// gap, and fails in the first step if this exceeds its strength.
    #[serde(default)]
    pub unstressed: bool,
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
    /// Rolling resistance. Default: none.
    #[serde(default)]
    pub rolling: Option<rolling::RollingParameters>,
    /// Loss of strength of the bonds on wetting. Default: none.
    #[serde(default)]
    pub softening: Option<softened::SofteningParameters>,
    /// Local (non-viscous) damping \[1\]: a force of this fraction of the force on a grain acts against its motion; 0
    /// turns it off.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Parameters of pairs of materials that differ from those above.
    #[serde(default)]
    pub pairs: Vec<Pair>,
}

impl<F> ContactParameters<F> for ContactBondInput
where
    F: From<ContactBond>
        + From<Rolling<ContactBond>>
        + From<Softened<ContactBond>>
        + From<Rolling<Softened<ContactBond>>>,
{
    parameters_of_grains!();

    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F> {
        let path = "contact.contact_bond";
        let base = ContactBondParameters {
            linear: linear::LinearParameters {
                normal_stiffness: self.normal_stiffness,
                stiffness_ratio: self.shear_to_normal_stiffness,
                friction: coefficient(self.friction_angle_degrees.unwrap_or(0.0)),
                normal_damping_ratio: self.normal_damping_ratio,
                shear_damping_ratio: scene
                    .shear_damping(self.shear_damping_ratio, self.normal_damping_ratio),
                attraction: false,
            },
            tensile_strength: self.tensile_strength,
            shear_strength: self.shear_strength,
            bonding_gap: self.bonding_gap,
            unstressed: self.unstressed,
        };
        base.linear.check(path, report);
        let parameters = pair_table(
            (path, scene),
            PairTable::uniform(scene.material_count(), base),
            (&self.pairs, |pair| &pair.materials),
            report,
            |_, pair, path, report| {
                pair.check_stiffness(path, report);
                pair.refuse_cohesion(path, report);
                ContactBondParameters {
                    linear: base.linear.overridden(pair),
                    tensile_strength: pair.tensile_strength.unwrap_or(base.tensile_strength),
                    shear_strength: pair.shear_strength.unwrap_or(base.shear_strength),
                    ..base
                }
            },
        );
        let law = ContactBond { parameters };
        let soft = |softening| Softened {
            law: law.clone(),
            softening,
        };
        Some(match (self.rolling, self.softening.map(soft)) {
            (Some(rolling), Some(law)) => Rolling::everywhere(law, rolling).into(),
            (Some(rolling), None) => Rolling::everywhere(law, rolling).into(),
            (None, Some(law)) => law.into(),
            (None, None) => law.into(),
        })
    }
}

/// Parameters of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContactBondParameters {
    /// Springs, dashpots and friction.
    pub linear: linear::LinearParameters,
    /// Tensile strength T of a bond \[N\]; in the plane [N per m of depth].
    pub tensile_strength: f64,
    /// Shear strength S of a bond \[N\]; in the plane [N per m of depth].
    pub shear_strength: f64,
    /// Largest gap \[m\] between surfaces that are bonded.
    pub bonding_gap: f64,
    /// `true` if a bond created across a gap starts without a force.
    pub unstressed: bool,
}

/// Contact-bond law: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactBond {
    /// Parameters per pair of materials.
    pub parameters: PairTable<ContactBondParameters>,
}

impl ContactModel for ContactBond {
    fn describe(&self) -> String {
        "linear with contact bonds".into()
    }

    model_of_linear_springs!("contact_bond", linear);

    fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>) {
        for pair in self.parameters.rows_mut() {
            pair.linear.prepare(normal_stiffness, friction);
            if normal_stiffness.is_some() {
                (pair.tensile_strength, pair.shear_strength) = (0.0, 0.0);
            }
        }
    }

    fn bonds(&self) -> bool {
        true
    }

    fn bonding_gap(&self) -> f64 {
        self.parameters.get(0, 0).bonding_gap
    }

    fn bond_opening(&self, [a, b]: [u32; 2], diameter: f64) -> Option<BondOpening> {
        let pair = self.parameters.get(a, b);
        Some(BondOpening {
            gap: pair.bonding_gap,
            strength: pair.tensile_strength,
            stiffness: pair.linear.normal_stiffness.for_diameter(diameter),
            path: "contact.contact_bond.tensile_strength",
        })
    }
}

/// Values per pair of materials: those of the linear law, strengths \[N\], bonding gap \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactBondRow {
    linear: linear::LinearRow,
    tensile: f64,
    shear: f64,
    gap: f64,
    unstressed: bool,
}

/// Values per pair: those of the linear law, strengths \[N\], bonding gap \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactBondConstants {
    linear: linear::LinearConstants,
    tensile: f64,
    shear: f64,
    gap: f64,
    unstressed: bool,
}

impl<S: Space> BondStrength<S> for ContactBond {
    #[inline(always)]
    fn weakened(c: &ContactBondConstants, factor: f64) -> ContactBondConstants {
        ContactBondConstants {
            tensile: factor * c.tensile,
            shear: factor * c.shear,
            ..*c
        }
    }
}

/// Force of the shear spring \[N\] on the second partner, and for a bond the overlap \[m\] at which it has no normal
/// force.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactBondHistory<S: Space> {
    shear: S::Tangent,
    zero_force_overlap: f64,
    bonded: bool,
}

impl<S: Space> ContactLaw<S> for ContactBond {
    type Row = ContactBondRow;
    type Scale = f64;
    type Constants = ContactBondConstants;
    type History = ContactBondHistory<S>;
    const NUMBERS: usize = S::Tangent::COUNT + 2;

    fn table(&self) -> PairTable<ContactBondRow> {
        self.parameters.map(|p| ContactBondRow {
            linear: p.linear.row(),
            tensile: p.tensile_strength,
            shear: p.shear_strength,
            gap: p.bonding_gap,
            unstressed: p.unstressed,
        })
    }

    fn scale(row: &ContactBondRow, pair: &PairProperties) -> f64 {
        row.linear.scale(pair)
    }

    #[inline(always)]
    fn constants(row: &ContactBondRow, root: &f64, diameter: f64) -> ContactBondConstants {
        ContactBondConstants {
            linear: row.linear.constants(*root, diameter),
            tensile: row.tensile,
            shear: row.shear,
            gap: row.gap,
            unstressed: row.unstressed,
        }
    }

    #[inline(always)]
    fn force(
        c: &ContactBondConstants,
        history: &mut ContactBondHistory<S>,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        if !history.bonded {
            return c.linear.slide(&mut history.shear, kinematics);
        }
        let normal = c.linear.normal * (kinematics.overlap - history.zero_force_overlap);
        let shear = c.linear.carried(&history.shear, kinematics);
        let failure = if normal < -c.tensile {
            Failure::Tension
        } else if shear.length() > c.shear {
            Failure::Shear
        } else {
            history.shear = shear;
            return ContactForce {
                normal: normal
                    - c.linear.bond_dashpot(kinematics.time_step) * kinematics.separation_rate,
                tangent: shear - kinematics.slip * c.linear.shear_dashpot,
                moment: S::Spin::default(),
                failure: None,
            };
        };
        let mut broken = ContactBondHistory {
            shear: history.shear,
            ..ContactBondHistory::default()
        };
        let force = if kinematics.overlap > 0.0 {
            c.linear.slide(&mut broken.shear, kinematics)
        } else {
            broken = ContactBondHistory::default();
            ContactForce::none()
        };
        *history = broken;
        ContactForce {
            failure: Some(failure),
            ..force
        }
    }

    #[inline(always)]
    fn bonded(history: &ContactBondHistory<S>) -> bool {
        history.bonded
    }

    fn bonding_gap(c: &ContactBondConstants) -> f64 {
        c.gap
    }

    fn bond(c: &ContactBondConstants, history: &mut ContactBondHistory<S>, overlap: f64) -> bool {
        history.bonded = c.tensile > 0.0 || c.shear > 0.0;
        history.zero_force_overlap = if c.unstressed { overlap.min(0.0) } else { 0.0 };
        history.bonded
    }

    fn strengthen(&mut self, factor: f64) {
        for pair in self.parameters.rows_mut() {
            pair.tensile_strength *= factor;
            pair.shear_strength *= factor;
        }
    }

    fn normal_spring(
        c: &ContactBondConstants,
        history: &ContactBondHistory<S>,
        overlap: f64,
    ) -> f64 {
        c.linear.normal * (overlap - history.zero_force_overlap)
    }

    fn widest_opening(&self, diameters: [f64; 2]) -> f64 {
        let opening = |p: &ContactBondParameters, d: f64| {
            p.bonding_gap + p.tensile_strength / p.linear.normal_stiffness.for_diameter(d)
        };
        self.parameters
            .rows()
            .filter(|p| p.tensile_strength > 0.0 || p.shear_strength > 0.0)
            .flat_map(|p| diameters.map(|d| opening(p, d)))
            .fold(0.0, f64::max)
    }

    fn shear_spring(history: &ContactBondHistory<S>) -> S::Tangent {
        history.shear
    }

    fn stiffness(c: &ContactBondConstants) -> [f64; 2] {
        [c.linear.normal, c.linear.shear]
    }

    fn save(history: &ContactBondHistory<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
        numbers.push(history.zero_force_overlap);
        numbers.push(if history.bonded { 1.0 } else { 0.0 });
    }

    fn load(numbers: &[f64]) -> ContactBondHistory<S> {
        let number = |k| numbers.get(k).copied().unwrap_or(0.0);
        ContactBondHistory {
            shear: load_tangent(numbers),
            zero_force_overlap: number(S::Tangent::COUNT),
            bonded: number(S::Tangent::COUNT + 1) > 0.5,
        }
    }
}

impl<S: Space> Bodies<S> for ContactBond {
    type Scratch = ();
}
