//! Contact law of Hertz in the normal direction and of Mindlin without slip in the tangential direction, with
//! Coulomb friction, for spheres of elastic material.
//!
//! ```text
//! F_n = 4/3 E* sqrt(R*) overlap^(3/2) - c_n d(gap)/dt                 pushing; pulling only with `attraction`
//! F_s = cut(F_s' min(1, a/a') - k_s slip dt - c_s slip)               cut to length mu max(F_n, 0)
//! k_n = 2 E* a,   k_s = 8 G* a,   a = sqrt(R* overlap)                tangent stiffnesses, radius of the contact
//! c_n = 2 sqrt(5/6) zeta sqrt(m* k_n),   c_s = 2 sqrt(5/6) zeta sqrt(m* k_s)
//!
//! 1/E* = (1 - nu1²)/E1 + (1 - nu2²)/E2,    1/G* = 2 (2 - nu1)(1 + nu1)/E1 + 2 (2 - nu2)(1 + nu2)/E2
//! ```
//!
//! The variant is the incremental one with the tangent stiffness of Mindlin's contact without slip (H-MDns of Di Renzo
//! and Di Maio): the partial slip of Mindlin and Deresiewicz at the edge of the contact is neglected. `F_s'` is the
//! spring's force of the last step, rotated with the contact. If the contact has shrunk from radius a' to a, the force
//! is reduced in proportion. Without this reduction a spring that is loaded at large overlaps and unloaded at small
//! ones would return more work than it received (Thornton et al.).
//!
//! The dashpots make the restitution a property of the material. In terms of z = overlap^(5/4), a head-on collision
//! is that of a linear spring with a dashpot of the fraction zeta of critical damping (Antypov and Elliott), at any
//! speed. With attraction `e = exp(-pi zeta/sqrt(1 - zeta²))`. Without tensile dashpot forces the restitution is
//! that of the linear contact without them (Schwager and Pöschel). [`damping`] computes zeta for both cases.
//!
//! Sources: H. Hertz 1882; R. D. Mindlin, J. Appl. Mech. 16 (1949) 259; Y. Tsuji, T. Tanaka, T. Ishida, Powder
//! Technology 71 (1992) 239, doi:10.1016/0032-5910(92)88030-L; A. Di Renzo, F. P. Di Maio, Chem. Eng. Sci. 59 (2004)
//! 525, doi:10.1016/j.ces.2003.09.037 and 60 (2005) 1303, doi:10.1016/j.ces.2004.10.004; T. Schwager, T. Pöschel,
//! Granular Matter 9 (2007) 465, doi:10.1007/s10035-007-0065-z; D. Antypov, J. A. Elliott, EPL 94 (2011) 50004,
//! doi:10.1209/0295-5075/94/50004; C. Thornton, S. J. Cummins, P. W. Cleary, Powder Technology 233 (2013) 30,
//! doi:10.1016/j.powtec.2012.08.012.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::engine::bodies::Bodies;
use super::super::space::{Components, Space};
use super::bridges::{self, Bridged};
use super::input::{coefficient, pair_table, parameters_of_grains};
use super::{
    ContactForce, ContactKinematics, ContactLaw, ContactModel, ContactParameters, Depth,
    PairProperties, PairTable, Preparation, SceneFacts, Springs, StaticContact, TimeLimits, cut_to,
    linear, load_tangent, save_tangent,
};
use crate::dashpot::{hertz_root, over_step};
use base::error::{Remedy, Report};

/// F_n = 4/3 E* sqrt(R*) δ^(3/2) with dashpots that give the same restitution at every speed of impact;
/// incremental shear of stiffness 8 G* sqrt(R* δ); |F_s| <= F_n tan Φ. The moduli come from `young_modulus` and
/// `poisson_ratio` of the materials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "HertzMindlin")]
pub struct HertzMindlinInput {
    /// Friction angle Φ \[degrees\]. Default: 0, no friction; a warning says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Coefficient of restitution \[1\]: speed after a head-on collision over the speed before; 1 is elastic.
    #[serde(default = "elastic")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub restitution: f64,
    /// `true` if the dashpot may pull while the grains separate. The restitution is the same with and without it.
    #[serde(default)]
    pub attraction: bool,
    /// Largest expected speed of approach [m/s]; the resulting overlap determines the stiffness for the time step.
    /// Default: the sum of the two largest initial speeds and the speed of a fall through the domain.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub impact_speed: Option<f64>,
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
    pub pairs: Vec<ElasticPair>,
}

fn elastic() -> f64 {
    1.0
}

/// Parameters of one pair of elastic materials; fields that are left out keep the values of the law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ElasticPair")]
pub struct ElasticPair {
    /// Names of the two materials, in either order.
    pub materials: [String; 2],
    /// Friction angle \[degrees\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Coefficient of restitution \[1\]: speed after a head-on collision over the speed before.
    #[serde(default)]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub restitution: Option<f64>,
}

const PATH: &str = "contact.hertz_mindlin";

impl HertzMindlinInput {
    /// Returns the moduli of every material; if some are missing, fewer with a finding for each.
    fn moduli(scene: &SceneFacts<'_>, report: &mut dyn Report) -> Vec<Elastic> {
        let mut elastic = Vec::new();
        for material in scene.materials {
            let mut need = |value: Option<f64>, field: &str, example: &str| {
                if value.is_none() {
                    report.error(
                        &format!("materials.{}.{field}", material.name),
                        "hertz_mindlin requires the elastic moduli of every material".into(),
                        format!("write for example {example}, glass").into(),
                    );
                }
                value
            };
            let modulus = need(material.young_modulus, "young_modulus", "4.8e10");
            let ratio = need(material.poisson_ratio, "poisson_ratio", "0.2");
            elastic.extend(
                modulus
                    .zip(ratio)
                    .map(|(young_modulus, poisson_ratio)| Elastic {
                        young_modulus,
                        poisson_ratio,
                    }),
            );
        }
        elastic
    }

    /// Reports features of a scene that the law does not support.
    fn check(scene: &SceneFacts<'_>, report: &mut dyn Report) {
        if scene.grains == (Preparation::Deposition { softened: true }) {
            report.error(
                "grains.initial.deposition.falling_stiffness",
                "hertz_mindlin has no spring stiffness that could be reduced".into(),
                "remove it, or deposit the grains with a smaller young_modulus in another run and read the saved \
                 sample".into(),
            );
        }
        if scene.bond_at_start {
            report.error(
                "grains.bond_at_start",
                "hertz_mindlin does not support bonds".into(),
                "remove it, or use contact_bond".into(),
            );
        }
    }
}

impl<F: From<HertzMindlin> + From<Bridged<HertzMindlin>>> ContactParameters<F>
    for HertzMindlinInput
{
    parameters_of_grains!();

    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F> {
        if scene.dimension == 2 {
            report.error(
                PATH,
                "this law is for spheres: in 2-D the force between two discs does not depend on their overlap \
                 alone".into(),
                Remedy::from("use linear, or a 3-D domain").set("contact", linear::example()),
            );
            return None;
        }
        let materials = Self::moduli(scene, report);
        Self::check(scene, report);
        if materials.is_empty() || materials.len() < scene.materials.len() {
            return None;
        }
        let impact_speed = self.impact_speed.unwrap_or(scene.fastest_approach);
        let numbers = |a: u32, b: u32, friction: f64, restitution: f64| HertzMindlinParameters {
            moduli: materials[a as usize].effective(materials[b as usize]),
            friction: coefficient(friction),
            damping: damping(restitution, self.attraction),
            attraction: self.attraction,
            impact_speed,
        };
        let friction = self.friction_angle_degrees.unwrap_or(0.0);
        let restitution = self.restitution;
        let n = scene.material_count();
        let mut base = PairTable::uniform(n, numbers(0, 0, friction, restitution));
        for a in 0..n {
            for b in a..n {
                base.set(a, b, numbers(a, b, friction, restitution));
            }
        }
        let parameters = pair_table(
            (PATH, scene),
            base,
            (&self.pairs, |pair| &pair.materials),
            report,
            |[a, b], pair, _, _| {
                numbers(
                    a,
                    b,
                    pair.friction_angle_degrees.unwrap_or(friction),
                    pair.restitution.unwrap_or(restitution),
                )
            },
        );
        let law = HertzMindlin {
            parameters,
            materials,
        };
        match &self.bridges {
            Some(bridges) => {
                let path = "contact.hertz_mindlin.bridges";
                bridges.on(law, path, scene, report).map(F::from)
            }
            None => Some(law.into()),
        }
    }
}

/// Isotropic elastic material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Elastic {
    /// Young's modulus E \[Pa\].
    pub young_modulus: f64,
    /// Poisson's ratio nu.
    pub poisson_ratio: f64,
}

impl Elastic {
    /// Returns the effective moduli E* and G* \[Pa\] of a contact of two materials.
    #[must_use]
    pub fn effective(self, other: Self) -> [f64; 2] {
        let part = |m: Self| {
            let (e, nu) = (m.young_modulus, m.poisson_ratio);
            [(1.0 - nu * nu) / e, 2.0 * (2.0 - nu) * (1.0 + nu) / e]
        };
        let (a, b) = (part(self), part(other));
        [1.0 / (a[0] + b[0]), 1.0 / (a[1] + b[1])]
    }

    /// Returns the time \[s\] in which a Rayleigh surface wave travels around half a sphere of this radius \[m\] and
    /// density [kg/m³]: `pi R sqrt(rho/G)/(0.1631 nu + 0.8766)`.
    #[must_use]
    pub fn rayleigh_time(self, radius: f64, density: f64) -> f64 {
        let shear_modulus = 0.5 * self.young_modulus / (1.0 + self.poisson_ratio);
        PI * radius * (density / shear_modulus).sqrt() / (0.1631 * self.poisson_ratio + 0.8766)
    }
}

/// Returns the restitution of a head-on collision with a dashpot of the fraction `zeta` of critical damping.
#[must_use]
pub fn restitution(zeta: f64, attraction: bool) -> f64 {
    if zeta <= 0.0 {
        return 1.0;
    }
    if attraction {
        return if zeta < 1.0 {
            (-PI * zeta / (1.0 - zeta * zeta).sqrt()).exp()
        } else {
            0.0
        };
    }
    // The force of the oscillator vanishes at the phase 2 acos(zeta); above critical damping the angle becomes a
    // logarithm.
    let phase_over_root = if (zeta - 1.0).abs() < 1e-9 {
        2.0
    } else if zeta < 1.0 {
        2.0 * zeta.acos() / (1.0 - zeta * zeta).sqrt()
    } else {
        let w = (zeta * zeta - 1.0).sqrt();
        2.0 * (zeta + w).ln() / w
    };
    (-zeta * phase_over_root).exp()
}

/// Returns the fraction of critical damping for a restitution `e` between 0 (exclusive) and 1.
#[must_use]
pub fn damping(e: f64, attraction: bool) -> f64 {
    if e >= 1.0 {
        return 0.0;
    }
    if attraction {
        let log = e.ln();
        return -log / (PI * PI + log * log).sqrt();
    }
    let (mut low, mut high) = (0.0, 1.0);
    while restitution(high, false) > e && high < 1e6 {
        high *= 2.0;
    }
    // Restitution decreases with damping.
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if restitution(middle, false) > e {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Parameters of one pair of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HertzMindlinParameters {
    /// Effective moduli E* and G* \[Pa\]: [`Elastic::effective`].
    pub moduli: [f64; 2],
    /// Coefficient of friction, the tangent of the friction angle.
    pub friction: f64,
    /// Dashpots as a fraction zeta of critical damping: [`damping`].
    pub damping: f64,
    /// `true` if the normal dashpot may pull.
    pub attraction: bool,
    /// Largest expected approach speed [m/s]: the overlap of such an impact determines the stiffness for the time
    /// step.
    pub impact_speed: f64,
}

/// Hertz-Mindlin law: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HertzMindlin {
    /// Parameters per pair of materials.
    pub parameters: PairTable<HertzMindlinParameters>,
    /// Moduli of every material, for the Rayleigh time; empty if that is not a limit.
    pub materials: Vec<Elastic>,
}

impl ContactModel for HertzMindlin {
    fn describe(&self) -> String {
        "Hertz-Mindlin with friction".into()
    }

    fn materials(&self) -> u32 {
        self.parameters.materials()
    }

    fn friction(&self, [a, b]: [u32; 2]) -> f64 {
        self.parameters.get(a, b).friction
    }

    fn normal_stiffness(&self, [a, b]: [u32; 2], diameter: f64) -> f64 {
        // Stiffness E* d sqrt(overlap/d).
        1e-2 * self.parameters.get(a, b).moduli[0] * diameter
    }

    fn growth_stiffness(&self, material: u32, _: f64) -> f64 {
        1e-2 * self.parameters.get(material, material).moduli[0]
    }

    /// Changes only the friction: the stiffness of elastic spheres follows from their moduli.
    fn prepare(&mut self, _: Option<f64>, friction: Option<f64>) {
        for pair in self.parameters.rows_mut() {
            pair.friction = friction.unwrap_or(pair.friction);
        }
    }

    /// Returns the tangent stiffnesses and the corresponding dashpots.
    fn springs(&self, contact: &StaticContact) -> Springs {
        let [a, b] = contact.materials;
        let pair = self.parameters.get(a, b);
        let [young, shear] = pair.moduli;
        let root = contact.radius.sqrt();
        let expected = || deepest(contact.mass, 4.0 / 3.0 * young * root, pair.impact_speed);
        let overlap = match (contact.overlap, contact.depth) {
            (Some(overlap), Depth::Start) => overlap,
            (Some(overlap), Depth::Expected) => overlap.max(expected()),
            (None, _) => expected(),
        };
        let side = root * overlap.max(0.0).sqrt();
        Springs::damped(
            [2.0 * young * side, 8.0 * shear * side],
            contact.bonded || pair.friction > 0.0,
            ([pair.damping; 2], (5.0_f64 / 6.0).sqrt()),
            contact.mass,
        )
    }

    fn time_limits(&self, material: u32, [radius, _]: [f64; 2], mass: f64) -> TimeLimits {
        let root = radius.sqrt();
        let spring = |pair: &HertzMindlinParameters| {
            // At a wall the radius and mass of the grain itself count: no contact with a grain is stiffer.
            let [young, shear] = pair.moduli;
            let overlap = deepest(mass, 4.0 / 3.0 * young * root, pair.impact_speed).sqrt();
            let stiffness = (2.0 * young).max(8.0 * shear) * root * overlap;
            let zeta = pair.damping;
            // With a dashpot the stable step of the explicit oscillator is shorter by the factor sqrt(1 + zeta²) -
            // zeta.
            2.0 * (mass / stiffness).sqrt() * ((1.0 + zeta * zeta).sqrt() - zeta)
        };
        let pairs = self.parameters.rows_of(material);
        let density = mass / (4.0 / 3.0 * PI * radius.powi(3));
        let elastic = self.materials.get(material as usize);
        TimeLimits {
            spring: pairs.map(spring).fold(f64::INFINITY, f64::min),
            rayleigh: elastic.map(|elastic| elastic.rayleigh_time(radius, density)),
        }
    }

    fn impact_speed(&self) -> Option<(f64, &'static str)> {
        let speed = self.parameters.get(0, 0).impact_speed;
        Some((speed, "contact.hertz_mindlin.impact_speed"))
    }
}

/// Values per pair of materials: factors of the roots of radius and mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzMindlinRow {
    /// 4/3 E* \[Pa\].
    normal: f64,
    /// 8 G* \[Pa\].
    shear: f64,
    /// sqrt(5) zeta sqrt(4/3 E*), and 2 sqrt(5/6) zeta sqrt(8 G*).
    dashpots: [f64; 2],
    friction: f64,
    pulls: bool,
    impact_speed: f64,
}

/// Values per pair of grains: sqrt(R*) [m^1/2], and sqrt(m* sqrt(R*)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzMindlinScale {
    radius: f64,
    mass: f64,
}

/// Values per pair: normal force over overlap^(3/2) [N m^-3/2], shear stiffness over overlap^(1/2) [N m^-3/2],
/// dashpots over overlap^(1/4) [N s m^-5/4], friction, and `true` if the normal dashpot may pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzMindlinConstants {
    normal: f64,
    shear: f64,
    dashpots: [f64; 2],
    friction: f64,
    pulls: bool,
    scale: HertzMindlinScale,
    impact_speed: f64,
}

/// Force of the shear spring \[N\] on the second partner, and the square root of the overlap [m^1/2] at which it was
/// loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HertzMindlinHistory<S: Space> {
    shear: S::Tangent,
    root: f64,
}

impl<S: Space> ContactLaw<S> for HertzMindlin {
    type Row = HertzMindlinRow;
    type Scale = HertzMindlinScale;
    type Constants = HertzMindlinConstants;
    type History = HertzMindlinHistory<S>;
    const NUMBERS: usize = S::Tangent::COUNT + 1;
    const SPATIAL: bool = true;

    fn table(&self) -> PairTable<HertzMindlinRow> {
        self.parameters.map(|p| {
            let [normal, shear] = [4.0 / 3.0 * p.moduli[0], 8.0 * p.moduli[1]];
            HertzMindlinRow {
                normal,
                shear,
                dashpots: [
                    5.0_f64.sqrt() * p.damping * normal.sqrt(),
                    2.0 * (5.0_f64 / 6.0).sqrt() * p.damping * shear.sqrt(),
                ],
                friction: p.friction,
                pulls: p.attraction && p.damping > 0.0,
                impact_speed: p.impact_speed,
            }
        })
    }

    fn scale(_: &HertzMindlinRow, pair: &PairProperties) -> HertzMindlinScale {
        let radius = pair.rolling_radius.sqrt();
        HertzMindlinScale {
            radius,
            mass: (pair.mass * radius).sqrt(),
        }
    }

    #[inline(always)]
    fn constants(
        row: &HertzMindlinRow,
        scale: &HertzMindlinScale,
        _: f64,
    ) -> HertzMindlinConstants {
        HertzMindlinConstants {
            normal: row.normal * scale.radius,
            shear: row.shear * scale.radius,
            dashpots: row.dashpots.map(|c| c * scale.mass),
            friction: row.friction,
            pulls: row.pulls,
            scale: *scale,
            impact_speed: row.impact_speed,
        }
    }

    #[inline(always)]
    fn force(
        c: &HertzMindlinConstants,
        history: &mut HertzMindlinHistory<S>,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let overlap = kinematics.overlap.max(0.0);
        let root = overlap.sqrt();
        let fourth = root.sqrt();
        let (rate, step) = (kinematics.separation_rate, kinematics.time_step);
        let dashpot = over_step(
            c.dashpots[0] * hertz_root(overlap, rate, step, c.pulls),
            step,
            c.scale.radius,
            c.scale.mass * c.scale.mass,
        );
        let least = if c.pulls { f64::NEG_INFINITY } else { 0.0 };
        let normal = (c.normal * overlap * root - dashpot * rate).max(least);
        let mut held = S::turn(&history.shear, &kinematics.normal);
        if root < history.root {
            held = held * (root / history.root);
        }
        let spring = held - kinematics.slip * (c.shear * root * kinematics.time_step);
        let total = spring - kinematics.slip * (c.dashpots[1] * fourth);
        let (length, limit) = (total.length(), c.friction * normal.max(0.0));
        let tangent = cut_to(total, length, limit);
        *history = HertzMindlinHistory {
            shear: if length > limit { tangent } else { spring },
            root,
        };
        ContactForce {
            normal,
            tangent,
            moment: S::Spin::default(),
            failure: None,
        }
    }

    fn normal_spring(c: &HertzMindlinConstants, _: &HertzMindlinHistory<S>, overlap: f64) -> f64 {
        let overlap = overlap.max(0.0);
        c.normal * overlap * overlap.sqrt()
    }

    fn tangent_stiffness(c: &HertzMindlinConstants, overlap: f64) -> f64 {
        1.5 * c.normal * overlap.max(0.0).sqrt()
    }

    fn shear_spring(history: &HertzMindlinHistory<S>) -> S::Tangent {
        history.shear
    }

    fn stiffness(c: &HertzMindlinConstants) -> [f64; 2] {
        let mass = c.scale.mass * c.scale.mass / c.scale.radius;
        let overlap = deepest(mass, c.normal, c.impact_speed);
        let root = overlap.sqrt();
        [1.5 * c.normal * root, c.shear * root]
    }

    fn save(history: &HertzMindlinHistory<S>, numbers: &mut Vec<f64>) {
        save_tangent(&history.shear, numbers);
        numbers.push(history.root);
    }

    fn load(numbers: &[f64]) -> HertzMindlinHistory<S> {
        HertzMindlinHistory {
            shear: load_tangent(numbers),
            root: numbers.get(S::Tangent::COUNT).copied().unwrap_or(0.0),
        }
    }
}

impl<S: Space> Bodies<S> for HertzMindlin {
    type Scratch = ();
}

/// Returns the largest overlap \[m\] of an elastic head-on impact at `speed` [m/s], for mass m* \[kg\] and force over
/// overlap^(3/2) [N m^-3/2].
#[must_use]
pub fn deepest(mass: f64, normal: f64, speed: f64) -> f64 {
    (1.25 * mass * speed * speed / normal).powf(0.4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Checks that `e = exp(-2 zeta acos(zeta)/w)` is continuous at critical damping, decreases with zeta, and is
    /// inverted correctly.
    #[test]
    fn damping_inverts_restitution() {
        for attraction in [false, true] {
            for e in [0.05, 0.1, 0.135_335_283, 0.2, 0.5, 0.9, 0.98, 1.0] {
                let zeta = damping(e, attraction);
                assert_relative_eq!(restitution(zeta, attraction), e, max_relative = 1e-9);
            }
        }
        // e with attraction, zeta, e without attraction.
        for (e, zeta, pushing) in [
            (0.9, 0.033_518_45, 0.902_026_07),
            (0.5, 0.215_453_76, 0.550_283_17),
            (0.1, 0.591_155_03, 0.252_729_38),
        ] {
            assert_relative_eq!(damping(e, true), zeta, max_relative = 1e-6);
            assert_relative_eq!(restitution(zeta, false), pushing, max_relative = 1e-6);
        }
        assert_relative_eq!(
            restitution(1.0 - 1e-7, false),
            restitution(1.0 + 1e-7, false),
            max_relative = 1e-6
        );
    }

    /// Checks that k_s/k_n of two equal materials is 2 (1 - nu)/(2 - nu) as given by Mindlin.
    #[test]
    fn the_ratio_of_stiffnesses_is_mindlins() {
        for nu in [0.0, 0.2, 0.3, 0.5] {
            let material = Elastic {
                young_modulus: 7e10,
                poisson_ratio: nu,
            };
            let [e, g] = material.effective(material);
            assert_relative_eq!(
                8.0 * g / (2.0 * e),
                2.0 * (1.0 - nu) / (2.0 - nu),
                max_relative = 1e-14
            );
        }
    }
}
