//! The contact law as a table over pairs of materials.

use super::findings::Findings;
use super::material;
use crate::case::Case;
use crate::case::contact::{Contact, Pair, Rolling, Scaled};
use serde::Serialize;

/// Which law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// Linear springs with friction, no tension.
    Linear {
        /// Whether the dashpot may pull.
        attraction: bool,
    },
    /// Linear springs with friction and brittle cohesion.
    CohesiveFrictional,
    /// The linear law with bonds.
    ContactBond {
        /// Surfaces at most so far apart [m] are bonded.
        bonding_gap: f64,
        /// Whether a bond across a gap starts without a force.
        unstressed: bool,
    },
}

/// Numbers of one pair of materials, in SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairParameters {
    /// Normal stiffness k_n [N/m].
    pub normal_stiffness: Scaled,
    /// k_s/k_n.
    pub shear_to_normal_stiffness: f64,
    /// tan of the friction angle.
    pub friction_coefficient: f64,
    /// Cohesion C [N] of a bonded contact; zero in the linear law.
    pub cohesion: Scaled,
    /// Tensile and shear strength of a contact bond [N]; zero in other laws.
    pub strengths: [f64; 2],
    /// Normal dashpot as a fraction of the critical damping.
    pub normal_damping_ratio: f64,
    /// Shear dashpot as a fraction of the critical damping.
    pub shear_damping_ratio: f64,
}

/// The law with its numbers for every pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactTable {
    /// Which law.
    pub law: Law,
    /// Resistance to rolling.
    pub rolling: Option<Rolling>,
    /// Fraction of every force that is taken off against the motion; 0 off.
    pub local_damping: f64,
    /// Number of materials n.
    pub materials: usize,
    /// n x n numbers, symmetric; see [`ContactTable::pair`].
    pub parameters: Vec<PairParameters>,
}

impl ContactTable {
    /// Numbers of two materials, by their indices in [`super::Scene::materials`].
    #[must_use]
    pub fn pair(&self, a: usize, b: usize) -> &PairParameters {
        &self.parameters[a * self.materials + b]
    }

    /// The largest k_n or k_s of a grain of this diameter [m] and material against anything [N/m].
    #[must_use]
    pub fn stiffest(&self, material: usize, diameter: f64) -> f64 {
        (0..self.materials)
            .map(|other| {
                let pair = self.pair(material, other);
                pair.normal_stiffness.at(diameter) * pair.shear_to_normal_stiffness.max(1.0)
            })
            .fold(0.0, f64::max)
    }

    pub(crate) fn resolve(case: &Case, names: &[String], findings: &mut Findings) -> Option<Self> {
        let (path, law, base, local_damping, rolling, pairs) = match case.contact.as_ref()? {
            Contact::Linear(law) => (
                "contact.linear",
                Law::Linear {
                    attraction: law.attraction,
                },
                PairParameters {
                    normal_stiffness: law.normal_stiffness,
                    shear_to_normal_stiffness: law.shear_to_normal_stiffness,
                    friction_coefficient: law.friction_angle_degrees.to_radians().tan(),
                    cohesion: Scaled::ZERO,
                    strengths: [0.0; 2],
                    normal_damping_ratio: law.normal_damping_ratio,
                    shear_damping_ratio: law.shear_damping_ratio,
                },
                law.local_damping,
                law.rolling,
                &law.pairs,
            ),
            Contact::CohesiveFrictional(law) => (
                "contact.cohesive_frictional",
                Law::CohesiveFrictional,
                PairParameters {
                    normal_stiffness: law.normal_stiffness,
                    shear_to_normal_stiffness: law.shear_to_normal_stiffness,
                    friction_coefficient: law.friction_angle_degrees.to_radians().tan(),
                    cohesion: law.cohesion,
                    strengths: [0.0; 2],
                    normal_damping_ratio: law.normal_damping_ratio,
                    shear_damping_ratio: law.shear_damping_ratio,
                },
                law.local_damping,
                None,
                &law.pairs,
            ),
            Contact::ContactBond(law) => (
                "contact.contact_bond",
                Law::ContactBond {
                    bonding_gap: law.bonding_gap,
                    unstressed: law.unstressed,
                },
                PairParameters {
                    normal_stiffness: law.normal_stiffness,
                    shear_to_normal_stiffness: law.shear_to_normal_stiffness,
                    friction_coefficient: law.friction_angle_degrees.to_radians().tan(),
                    cohesion: Scaled::ZERO,
                    strengths: [law.tensile_strength, law.shear_strength],
                    normal_damping_ratio: law.normal_damping_ratio,
                    shear_damping_ratio: law.shear_damping_ratio,
                },
                law.local_damping,
                law.rolling,
                &law.pairs,
            ),
        };
        stiffness(
            base.normal_stiffness,
            &format!("{path}.normal_stiffness"),
            findings,
        );
        let n = names.len();
        let mut parameters = vec![base; n * n];
        let mut seen: Vec<(usize, usize)> = Vec::new();
        for (index, pair) in pairs.iter().enumerate() {
            let path = format!("{path}.pairs[{index}]");
            let found = [0, 1].map(|i| {
                material(
                    names,
                    &pair.materials[i],
                    &format!("{path}.materials[{i}]"),
                    findings,
                )
            });
            let [Some(a), Some(b)] = found else { continue };
            if seen.contains(&(a.min(b), a.max(b))) {
                findings.error(
                    &format!("{path}.materials"),
                    "this pair is given twice",
                    "keep one of the two",
                );
            }
            seen.push((a.min(b), a.max(b)));
            if let Some(value) = pair.normal_stiffness {
                stiffness(value, &format!("{path}.normal_stiffness"), findings);
            }
            if pair.cohesion.is_some() && law != Law::CohesiveFrictional {
                findings.error(
                    &format!("{path}.cohesion"),
                    "this law has no cohesion",
                    "use cohesive_frictional, or take it out",
                );
            }
            for (name, value) in [
                ("tensile_strength", pair.tensile_strength),
                ("shear_strength", pair.shear_strength),
            ] {
                if value.is_some() && !matches!(law, Law::ContactBond { .. }) {
                    findings.error(
                        &format!("{path}.{name}"),
                        "this law has no bonds of given strength",
                        "use contact_bond, or take it out",
                    );
                }
            }
            let numbers = overridden(base, pair);
            parameters[a * n + b] = numbers;
            parameters[b * n + a] = numbers;
        }
        Some(Self {
            law,
            rolling,
            local_damping,
            materials: n,
            parameters,
        })
    }
}

fn overridden(base: PairParameters, pair: &Pair) -> PairParameters {
    PairParameters {
        normal_stiffness: pair.normal_stiffness.unwrap_or(base.normal_stiffness),
        shear_to_normal_stiffness: pair
            .shear_to_normal_stiffness
            .unwrap_or(base.shear_to_normal_stiffness),
        friction_coefficient: pair
            .friction_angle_degrees
            .map_or(base.friction_coefficient, |angle| angle.to_radians().tan()),
        cohesion: pair.cohesion.unwrap_or(base.cohesion),
        strengths: [
            pair.tensile_strength.unwrap_or(base.strengths[0]),
            pair.shear_strength.unwrap_or(base.strengths[1]),
        ],
        normal_damping_ratio: pair
            .normal_damping_ratio
            .unwrap_or(base.normal_damping_ratio),
        shear_damping_ratio: pair.shear_damping_ratio.unwrap_or(base.shear_damping_ratio),
    }
}

fn stiffness(value: Scaled, path: &str, findings: &mut Findings) {
    if value.number() <= 0.0 {
        findings.error(
            path,
            "the stiffness must be above 0",
            "write for example {\"per_diameter\": 1e8}",
        );
    }
}
