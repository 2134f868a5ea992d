//! Input shared by all contact laws: quantities that scale with the diameter, overrides for pairs of materials, and
//! the facts of a scene with which a law is resolved.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::PairTable;
use base::error::{Remedy, Report};

/// Parameters of a law as written in a case. `F` is the family of resolved laws to which the result belongs.
pub trait ContactParameters<F> {
    /// Returns the law with its parameters for every pair of materials; none if no law can be constructed. Errors
    /// are reported.
    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F>;

    /// Returns the local damping: a force of this fraction of the force on a grain opposes its motion; 0 is off.
    fn local_damping(&self) -> f64 {
        0.0
    }

    /// Returns `true` if the law supports polyhedra.
    fn of_polyhedra(&self) -> bool {
        false
    }

    /// Returns `true` if the case states the friction, zero included, instead of leaving it out.
    fn states_friction(&self) -> bool {
        true
    }
}

/// Returns `true` if a friction angle is stated for all materials, or for each of the listed pairs.
pub(super) fn states_friction<P>(
    angle: Option<f64>,
    pairs: &[P],
    angle_of: impl Fn(&P) -> Option<f64>,
) -> bool {
    let all_pairs = || pairs.iter().all(|pair| angle_of(pair).is_some());
    angle.is_some() || (!pairs.is_empty() && all_pairs())
}

/// Facts of a scene with which contact laws are resolved.
#[derive(Clone, Debug)]
pub struct SceneFacts<'a> {
    /// Number of dimensions, 2 or 3.
    pub dimension: usize,
    /// Materials to which pairs in laws refer by name.
    pub materials: &'a [MaterialFacts],
    /// `true` if there are polyhedra.
    pub polyhedra: bool,
    /// Method by which the grains are created.
    pub grains: Preparation,
    /// `true` if contacts are bonded at the start.
    pub bond_at_start: bool,
    /// Upper bound of the speed at which two bodies approach each other [m/s].
    pub fastest_approach: f64,
    /// `true` if bodies are in partially saturated cells of a fluid.
    pub saturated_cells: bool,
}

/// Properties of a material that a law may need.
#[derive(Clone, Debug, Default)]
pub struct MaterialFacts {
    /// Name in the case.
    pub name: String,
    /// Young's modulus \[Pa\].
    pub young_modulus: Option<f64>,
    /// Poisson's ratio.
    pub poisson_ratio: Option<f64>,
}

/// Method by which the grains of a scene are created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preparation {
    /// Listed grains, or none.
    Listed,
    /// Grains whose radii grow.
    Growth,
    /// Grains that are deposited.
    Deposition {
        /// `true` if the normal stiffness is lower during the deposition.
        softened: bool,
    },
}

impl SceneFacts<'_> {
    /// Returns the damping ratio of a shear dashpot, for the stated one and that of the normal dashpot.
    pub(super) fn shear_damping(&self, stated: Option<f64>, normal: f64) -> f64 {
        stated.unwrap_or(if self.saturated_cells { normal } else { 0.0 })
    }

    /// Returns the number of materials, at least one.
    #[must_use]
    pub fn material_count(&self) -> u32 {
        u32::try_from(self.materials.len().max(1)).unwrap_or(u32::MAX)
    }

    /// Returns the index of a material; reports an unknown name.
    fn material(&self, name: &str, path: &str, report: &mut dyn Report) -> Option<u32> {
        let index = self.materials.iter().position(|known| known.name == name);
        if index.is_none() {
            let known: Vec<&str> = self.materials.iter().map(|m| m.name.as_str()).collect();
            report.unknown_material(path, name, &known);
        }
        index.and_then(|index| u32::try_from(index).ok())
    }
}

/// Returns the table with `base` for every pair of materials, except the rows replaced by `overrides`; `own`
/// computes the row of an override at its path. Duplicate pairs and unknown materials are reported.
pub(super) fn pair_table<P: Clone, O>(
    (path, scene): (&str, &SceneFacts<'_>),
    base: PairTable<P>,
    (overrides, materials): (&[O], impl Fn(&O) -> &[String; 2]),
    report: &mut dyn Report,
    mut own: impl FnMut([u32; 2], &O, &str, &mut dyn Report) -> P,
) -> PairTable<P> {
    let mut table = base;
    let mut seen: Vec<(u32, u32)> = Vec::new();
    for (index, one) in overrides.iter().enumerate() {
        let path = format!("{path}.pairs[{index}]");
        let names = materials(one);
        let found =
            [0, 1].map(|i| scene.material(&names[i], &format!("{path}.materials[{i}]"), report));
        let [Some(a), Some(b)] = found else { continue };
        let pair = (a.min(b), a.max(b));
        if seen.contains(&pair) {
            report.error(
                &format!("{path}.materials"),
                "this pair of materials is listed twice".into(),
                "keep one of the two".into(),
            );
        }
        seen.push(pair);
        let parameters = own([a, b], one, &path, report);
        table.set(a, b, parameters);
    }
    table
}

/// A quantity of a contact, constant or proportional to the mean diameter d of the two grains (at a wall: the diameter
/// of the grain), as in k_n/d = 150e6 N/m2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scaled {
    /// Value per mean diameter of the pair [unit per m].
    PerDiameter(#[schemars(range(min = 0.0))] f64),
    /// Value of every pair; in 2-D per metre of depth.
    Absolute(#[schemars(range(min = 0.0))] f64),
}

impl Scaled {
    /// Zero for every pair.
    pub const ZERO: Self = Self::Absolute(0.0);

    /// Returns the value for a pair of mean diameter `diameter` \[m\].
    #[must_use]
    pub fn for_diameter(self, diameter: f64) -> f64 {
        match self {
            Self::PerDiameter(value) => value * diameter,
            Self::Absolute(value) => value,
        }
    }

    /// Returns the number as written in the case.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::PerDiameter(value) | Self::Absolute(value) => value,
        }
    }

    /// Returns the value times a factor.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        match self {
            Self::PerDiameter(value) => Self::PerDiameter(value * factor),
            Self::Absolute(value) => Self::Absolute(value * factor),
        }
    }

    /// Returns the constant part and the part per diameter, one of which is zero.
    #[must_use]
    pub fn parts(self) -> [f64; 2] {
        match self {
            Self::PerDiameter(value) => [0.0, value],
            Self::Absolute(value) => [value, 0.0],
        }
    }

    /// Refuses a stiffness of zero.
    pub(super) fn check_stiffness(self, path: &str, report: &mut dyn Report) {
        if self.number() <= 0.0 {
            report.error(
                path,
                "the stiffness must be above 0".into(),
                Remedy::from("write for example {\"per_diameter\": 1e8}")
                    .set(path, json!({"per_diameter": 1e8})),
            );
        }
    }
}

impl Default for Scaled {
    fn default() -> Self {
        Self::ZERO
    }
}

/// Parameters of one pair of materials; fields that are left out keep the values of the law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// Names of the two materials, in either order.
    pub materials: [String; 2],
    /// Normal stiffness [N/m]; per diameter [N/m2].
    #[serde(default)]
    pub normal_stiffness: Option<Scaled>,
    /// Shear to normal stiffness k_s/k_n \[1\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: Option<f64>,
    /// Friction angle \[degrees\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Cohesion \[N\]; per diameter [N/m]; only in the cohesive law.
    #[serde(default)]
    pub cohesion: Option<Scaled>,
    /// Tensile strength of a bond \[N\]; only in the contact-bond law.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub tensile_strength: Option<f64>,
    /// Shear strength of a bond \[N\]; only in the contact-bond law.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub shear_strength: Option<f64>,
    /// Normal dashpot as a fraction of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: Option<f64>,
    /// Shear dashpot as a fraction of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: Option<f64>,
}

impl Pair {
    /// Reports a stiffness of zero.
    pub(super) fn check_stiffness(&self, path: &str, report: &mut dyn Report) {
        if let Some(value) = self.normal_stiffness {
            value.check_stiffness(&format!("{path}.normal_stiffness"), report);
        }
    }

    /// Reports a cohesion for a law without cohesion.
    pub(super) fn refuse_cohesion(&self, path: &str, report: &mut dyn Report) {
        if self.cohesion.is_some() {
            let path = format!("{path}.cohesion");
            report.error(
                &path,
                "this law has no cohesion".into(),
                Remedy::take_out("use cohesive_frictional, or remove it", &path),
            );
        }
    }

    /// Reports bond strengths for a law without bonds.
    pub(super) fn refuse_strengths(&self, path: &str, report: &mut dyn Report) {
        for (name, value) in [
            ("tensile_strength", self.tensile_strength),
            ("shear_strength", self.shear_strength),
        ] {
            if value.is_some() {
                let path = format!("{path}.{name}");
                report.error(
                    &path,
                    "this law does not support bonds of a given strength".into(),
                    Remedy::take_out("use contact_bond, or remove it", &path),
                );
            }
        }
    }
}

/// Writes the functions of [`ContactParameters`] that read fields with the same names in every law of grains.
macro_rules! parameters_of_grains {
    () => {
        fn states_friction(&self) -> bool {
            $crate::contact::input::states_friction(
                self.friction_angle_degrees,
                &self.pairs,
                |pair| pair.friction_angle_degrees,
            )
        }

        fn local_damping(&self) -> f64 {
            self.local_damping
        }
    };
}
pub(super) use parameters_of_grains;

/// Returns the coefficient of friction of a friction angle \[degrees\].
pub(super) fn coefficient(friction_angle_degrees: f64) -> f64 {
    friction_angle_degrees.to_radians().tan()
}

/// Returns the default of k_s/k_n.
pub(super) fn default_ratio() -> f64 {
    0.4
}
