//! Linear springs and dashpots with Coulomb friction.
//!
//! ```text
//! F_n = k_n overlap - c_n d(gap)/dt              pushing; pulling only with `attraction`
//! F_s = cut(F_s' - k_s slip dt - c_s slip)       cut to length mu max(F_n, 0)
//! ```
//!
//! `F_s'` is the spring's force of the last step, rotated with the contact. The dashpots are given as fractions of
//! critical damping of the pair: `c = 2 zeta sqrt(m* k)` with the pair's effective mass `m*`. A head-on collision with
//! attraction has the restitution `e = exp(-pi zeta / sqrt(1 - zeta^2))` and lasts `pi sqrt(m*/k) / sqrt(1 - zeta^2)`.
//! Without attraction it is shorter, and the restitution is larger. While the contact slides, the spring keeps the
//! limit force and the shear dashpot does not act.
//!
//! Source: P. A. Cundall, O. D. L. Strack, Géotechnique 29 (1979) 47, doi:10.1680/geot.1979.29.1.47.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::super::engine::bodies::Bodies;
use super::super::space::{Components, Space};
use super::bridges::{self, Bridged};
use super::input::{coefficient, default_ratio, pair_table, parameters_of_grains};
use super::rolling::{self, Rolling};
use super::{
    ContactForce, ContactKinematics, ContactLaw, ContactModel, ContactParameters, Pair,
    PairProperties, PairTable, Scaled, SceneFacts, Springs, StaticContact, cut_to, load_tangent,
    save_tangent,
};
use crate::dashpot::{Pulling, over_step, part_of_step};
use base::error::Report;

/// F_n = k_n δ, |F_s| <= F_n tan Φ; springs act in compression only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Linear")]
pub struct LinearInput {
    /// Normal stiffness k_n [N/m]. Default: overlaps of at most 1 % of a diameter at the largest speed and under the
    /// weight of what lies above; in seepage with `accuracy`, from the load on the bed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_stiffness: Option<Scaled>,
    /// Shear to normal stiffness k_s/k_n \[1\].
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ \[degrees\]. Default: 0, no friction; a warning says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
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
    /// `true` if the dashpot may pull while the grains separate. Otherwise the normal force is never tensile, and the
    /// rebound is slightly faster than the damping ratio implies. At the default step the restitution of every impact
    /// is within 1 % up to a damping ratio of
    /// 0.5; pushing only, within 2.5 %, and within 1 % on average.
    #[serde(default)]
    pub attraction: bool,
    /// Rolling resistance. Default: none.
    #[serde(default)]
    pub rolling: Option<rolling::RollingParameters>,
    /// Capillary bridges of water. Default: none.
    #[serde(default)]
    pub bridges: Option<bridges::BridgesInput>,
    /// Local (non-viscous) damping \[1\]: a force of this fraction of the force on a grain acts against its motion; 0
    /// turns it off.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Parameters of pairs of materials that differ from those above.
    #[serde(default)]
    pub pairs: Vec<Pair>,
}

impl<F> ContactParameters<F> for LinearInput
where
    F: From<Linear>
        + From<Rolling<Linear>>
        + From<Bridged<Linear>>
        + From<Bridged<Rolling<Linear>>>,
{
    parameters_of_grains!();

    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F> {
        let path = "contact.linear";
        let base = LinearParameters {
            // If it is left out, the scene chooses the stiffness and resolves the law again.
            normal_stiffness: self.normal_stiffness.unwrap_or(Scaled::Absolute(1.0)),
            stiffness_ratio: self.shear_to_normal_stiffness,
            friction: coefficient(self.friction_angle_degrees.unwrap_or(0.0)),
            normal_damping_ratio: self.normal_damping_ratio,
            shear_damping_ratio: scene
                .shear_damping(self.shear_damping_ratio, self.normal_damping_ratio),
            attraction: self.attraction,
        };
        base.check(path, report);
        let parameters = pair_table(
            (path, scene),
            PairTable::uniform(scene.material_count(), base),
            (&self.pairs, |pair| &pair.materials),
            report,
            |_, pair, path, report| {
                pair.check_stiffness(path, report);
                pair.refuse_cohesion(path, report);
                pair.refuse_strengths(path, report);
                base.overridden(pair)
            },
        );
        let law = Linear { parameters };
        let path = "contact.linear.bridges";
        match (self.rolling, &self.bridges) {
            (Some(rolling), None) => Some(Rolling::everywhere(law, rolling).into()),
            (None, None) => Some(law.into()),
            (Some(rolling), Some(bridges)) => {
                let law = Rolling::everywhere(law, rolling);
                bridges.on(law, path, scene, report).map(F::from)
            }
            (None, Some(bridges)) => bridges.on(law, path, scene, report).map(F::from),
        }
    }
}

/// Returns the law as an example in findings.
#[must_use]
pub fn example() -> Value {
    json!({"linear": {"normal_stiffness": {"per_diameter": 1e8}}})
}

/// Parameters of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LinearParameters {
    /// Normal stiffness [N/m]; in the plane [N/m per m of depth].
    pub normal_stiffness: Scaled,
    /// Ratio of shear to normal stiffness.
    pub stiffness_ratio: f64,
    /// Coefficient of friction, the tangent of the friction angle.
    pub friction: f64,
    /// Normal dashpot as a fraction of critical damping.
    pub normal_damping_ratio: f64,
    /// Shear dashpot as a fraction of critical damping.
    pub shear_damping_ratio: f64,
    /// `true` if the dashpot may pull.
    pub attraction: bool,
}

impl LinearParameters {
    pub(super) const WITHOUT_FORCES: Self = Self {
        normal_stiffness: Scaled::ZERO,
        stiffness_ratio: 0.0,
        friction: 0.0,
        normal_damping_ratio: 0.0,
        shear_damping_ratio: 0.0,
        attraction: false,
    };

    /// Refuses a stiffness of zero.
    pub(super) fn check(&self, path: &str, report: &mut dyn Report) {
        let path = format!("{path}.normal_stiffness");
        self.normal_stiffness.check_stiffness(&path, report);
    }

    /// Returns these parameters with the values that a pair overrides.
    pub(super) fn overridden(&self, pair: &Pair) -> Self {
        Self {
            normal_stiffness: pair.normal_stiffness.unwrap_or(self.normal_stiffness),
            stiffness_ratio: pair
                .shear_to_normal_stiffness
                .unwrap_or(self.stiffness_ratio),
            friction: pair
                .friction_angle_degrees
                .map_or(self.friction, coefficient),
            normal_damping_ratio: pair
                .normal_damping_ratio
                .unwrap_or(self.normal_damping_ratio),
            shear_damping_ratio: pair.shear_damping_ratio.unwrap_or(self.shear_damping_ratio),
            attraction: self.attraction,
        }
    }

    /// Returns springs and dashpots of a contact.
    pub(super) fn springs(&self, contact: &StaticContact) -> Springs {
        let normal = self.normal_stiffness.for_diameter(contact.diameter);
        Springs::damped(
            [normal, normal * self.stiffness_ratio],
            contact.bonded || self.friction > 0.0,
            ([self.normal_damping_ratio, self.shear_damping_ratio], 1.0),
            contact.mass,
        )
    }

    /// Returns the larger of both stiffnesses [N/m] of a body with any other, for its radius and the largest radius of
    /// the others \[m\].
    pub(super) fn stiffest(&self, [radius, largest]: [f64; 2]) -> f64 {
        let diameter = radius + largest.max(radius);
        self.normal_stiffness.for_diameter(diameter) * self.stiffness_ratio.max(1.0)
    }

    /// Sets other springs and friction for the preparation of grains.
    pub(super) fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>) {
        if let Some(stiffness) = normal_stiffness {
            self.normal_stiffness = Scaled::Absolute(stiffness);
        }
        self.friction = friction.unwrap_or(self.friction);
    }
}

/// Writes the functions of [`ContactModel`] that follow from springs, dashpots and friction of the linear law, for a
/// law of this name whose pairs are [`LinearParameters`] or have them in a field.
macro_rules! model_of_linear_springs {
    ($law:literal $(, $linear:ident)?) => {
        fn damping_paths(&self) -> Option<[&'static str; 2]> {
            Some([
                concat!("contact.", $law, ".normal_damping_ratio"),
                concat!("contact.", $law, ".shear_damping_ratio"),
            ])
        }

        fn materials(&self) -> u32 {
            self.parameters.materials()
        }

        fn friction(&self, [a, b]: [u32; 2]) -> f64 {
            self.parameters.get(a, b)$(.$linear)?.friction
        }

        fn normal_stiffness(&self, [a, b]: [u32; 2], diameter: f64) -> f64 {
            let pair = self.parameters.get(a, b)$(.$linear)?;
            pair.normal_stiffness.for_diameter(diameter)
        }

        fn springs(&self, contact: &$crate::contact::StaticContact) -> $crate::contact::Springs {
            let [a, b] = contact.materials;
            self.parameters.get(a, b)$(.$linear)?.springs(contact)
        }

        fn time_limits(
            &self,
            material: u32,
            radii: [f64; 2],
            mass: f64,
        ) -> $crate::contact::TimeLimits {
            let pairs = self.parameters.rows_of(material);
            let stiffest = pairs.map(|pair| pair$(.$linear)?.stiffest(radii));
            $crate::contact::TimeLimits::of_spring(mass, stiffest.fold(0.0, f64::max))
        }
    };
}
pub(super) use model_of_linear_springs;

/// Linear law: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Linear {
    /// Parameters per pair of materials.
    pub parameters: PairTable<LinearParameters>,
}

impl ContactModel for Linear {
    fn describe(&self) -> String {
        "linear with friction".into()
    }

    model_of_linear_springs!("linear");

    fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>) {
        for pair in self.parameters.rows_mut() {
            pair.prepare(normal_stiffness, friction);
        }
    }
}

/// Values per pair: stiffnesses [N/m], dashpots [N s/m], friction, and `true` if the normal dashpot may pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearConstants {
    pub(super) normal: f64,
    pub(super) shear: f64,
    pub(super) normal_dashpot: f64,
    pub(super) shear_dashpot: f64,
    pub(super) friction: f64,
    pulls: bool,
    /// Mass times normal stiffness [N² s²/m²].
    square: f64,
}

/// Values per pair of materials: two stiffnesses [N/m, N/m²], one of which is zero; dashpots divided by the root of
/// mass times stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearRow {
    normal: f64,
    per_diameter: f64,
    ratio: f64,
    normal_dashpot: f64,
    shear_dashpot: f64,
    friction: f64,
    pulls: bool,
}

impl LinearParameters {
    pub(super) fn row(&self) -> LinearRow {
        let [normal, per_diameter] = self.normal_stiffness.parts();
        LinearRow {
            normal,
            per_diameter,
            ratio: self.stiffness_ratio,
            normal_dashpot: 2.0 * self.normal_damping_ratio,
            shear_dashpot: 2.0 * self.shear_damping_ratio * self.stiffness_ratio.sqrt(),
            friction: self.friction,
            pulls: self.attraction && self.normal_damping_ratio > 0.0,
        }
    }
}

impl LinearRow {
    #[inline(always)]
    fn normal(&self, diameter: f64) -> f64 {
        self.normal + self.per_diameter * diameter
    }

    /// Returns the root of mass times normal stiffness [N s/m].
    pub(super) fn scale(&self, pair: &PairProperties) -> f64 {
        (pair.mass * self.normal(pair.diameter)).sqrt()
    }

    #[inline(always)]
    pub(super) fn constants(&self, root: f64, diameter: f64) -> LinearConstants {
        let normal = self.normal(diameter);
        LinearConstants {
            normal,
            shear: normal * self.ratio,
            normal_dashpot: self.normal_dashpot * root,
            shear_dashpot: self.shear_dashpot * root,
            friction: self.friction,
            pulls: self.pulls,
            square: root * root,
        }
    }
}

impl LinearConstants {
    /// Returns the effective normal dashpot of a bond over a time step [N s/m]; it acts across a gap as well.
    #[inline(always)]
    pub(super) fn bond_dashpot(&self, time_step: f64) -> f64 {
        over_step(self.normal_dashpot, time_step, self.normal, self.square)
    }

    /// Returns the effective normal dashpot over a time step [N s/m].
    #[inline(always)]
    pub(super) fn normal_dashpot<S: Space>(&self, kinematics: &ContactKinematics<S>) -> f64 {
        let (rate, step) = (kinematics.separation_rate, kinematics.time_step);
        over_step(self.normal_dashpot, step, self.normal, self.square)
            * part_of_step(kinematics.overlap, rate, step)
    }

    /// Returns the normal force \[N\] if the dashpot may pull.
    fn pulling<S: Space>(&self, kinematics: &ContactKinematics<S>) -> f64 {
        let contact = Pulling {
            spring: self.normal,
            dashpot: self.normal_dashpot,
            mass: self.square / self.normal,
        };
        let (overlap, rate) = (kinematics.overlap, kinematics.separation_rate);
        contact.force(overlap, rate, kinematics.time_step)
    }

    /// Returns the force of the shear spring of the last step \[N\], turned with the contact, after this step.
    #[inline(always)]
    pub(super) fn carried<S: Space>(
        &self,
        shear: &S::Tangent,
        kinematics: &ContactKinematics<S>,
    ) -> S::Tangent {
        S::turn(shear, &kinematics.normal) - kinematics.slip * (self.shear * kinematics.time_step)
    }

    /// Returns the force of an unbonded contact; `shear` is the force of the shear spring \[N\].
    #[inline(always)]
    pub(super) fn slide<S: Space>(
        &self,
        shear: &mut S::Tangent,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let normal = if self.pulls {
            self.pulling(kinematics)
        } else {
            (self.normal * kinematics.overlap
                - self.normal_dashpot(kinematics) * kinematics.separation_rate)
                .max(0.0)
        };
        let spring = self.carried(shear, kinematics);
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
    type Row = LinearRow;
    type Scale = f64;
    type Constants = LinearConstants;
    type History = LinearHistory<S>;
    const NUMBERS: usize = S::Tangent::COUNT;

    fn table(&self) -> PairTable<LinearRow> {
        self.parameters.map(LinearParameters::row)
    }

    fn scale(row: &LinearRow, pair: &PairProperties) -> f64 {
        row.scale(pair)
    }

    #[inline(always)]
    fn constants(row: &LinearRow, root: &f64, diameter: f64) -> LinearConstants {
        row.constants(*root, diameter)
    }

    #[inline(always)]
    fn force(
        c: &LinearConstants,
        history: &mut LinearHistory<S>,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        c.slide(&mut history.shear, kinematics)
    }

    fn shear_spring(history: &LinearHistory<S>) -> S::Tangent {
        history.shear
    }

    fn stiffness(c: &LinearConstants) -> [f64; 2] {
        [c.normal, c.shear]
    }

    fn save(history: &LinearHistory<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
    }

    fn load(numbers: &[f64]) -> LinearHistory<S> {
        LinearHistory {
            shear: load_tangent(numbers),
        }
    }
}

/// Force of the shear spring \[N\] on the second partner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearHistory<S: Space> {
    shear: S::Tangent,
}

impl<S: Space> Bodies<S> for Linear {
    type Scratch = ();
}
