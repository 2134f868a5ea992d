//! The contact law as a table over pairs of materials.

use super::findings::Findings;
use super::material;
use crate::case::Case;
use crate::case::contact::{
    BlockModel, BlockPair, BlockStiffness, Blocks, Contact, HertzMindlin, Pair, Rolling, Scaled,
};
use crate::case::grains::GrainSource;
use crate::case::solids::Motion;
use crate::dem::contact::hertz_mindlin::{self, Elastic};
use crate::dem::polyhedron::Polyhedron;
use crate::error::Remedy;
use crate::scene::{has_polyhedra, linear_law};
use nalgebra::Matrix3;
use serde::Serialize;
use serde_json::json;
use std::f64::consts::PI;

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
    /// Elastic spheres.
    HertzMindlin {
        /// Whether the dashpot may pull.
        attraction: bool,
        /// Fastest approach that is expected [m/s].
        impact_speed: f64,
    },
    /// Blocks, and spheres among them.
    Blocks {
        /// Whether stiffness is per area of contact [Pa/m], not per contact [N/m].
        per_area: bool,
        /// Mass-proportional damping [1/s].
        mass_damping: f64,
        /// How a contact is condensed.
        model: BlockModel,
    },
}

/// Numbers of one pair of materials, in SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairParameters {
    /// Normal stiffness k_n [N/m], between blocks also [Pa/m]; zero in the law of elastic spheres.
    pub normal_stiffness: Scaled,
    /// Effective moduli E* and G* [Pa] of elastic spheres; zero in other laws.
    pub moduli: [f64; 2],
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

/// What bounds the solid time step of a grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeLimits {
    /// 2 sqrt(m/k) [s] with its stiffest contact; of elastic spheres at the deepest overlap that is expected, shortened
    /// by the dashpot.
    pub spring: f64,
    /// Rayleigh's time [s] of an elastic sphere.
    pub rayleigh: Option<f64>,
}

impl TimeLimits {
    /// The shorter one [s].
    #[must_use]
    pub fn shorter(&self) -> f64 {
        self.rayleigh
            .map_or(self.spring, |time| time.min(self.spring))
    }
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
    /// Moduli of every material in the law of elastic spheres; empty in other laws.
    pub elastic: Vec<Elastic>,
    /// n x n numbers, symmetric; see [`ContactTable::pair`].
    pub parameters: Vec<PairParameters>,
}

impl ContactTable {
    /// Numbers of two materials, by their indices in [`super::Scene::materials`].
    #[must_use]
    pub fn pair(&self, a: usize, b: usize) -> &PairParameters {
        &self.parameters[a * self.materials + b]
    }

    /// What bounds the time step of a grain of this material, radius [m] and mass [kg] against anything.
    #[must_use]
    pub fn time_limits(&self, material: usize, radius: f64, mass: f64) -> TimeLimits {
        let pairs = (0..self.materials).map(|other| self.pair(material, other));
        if let Law::Blocks { per_area, .. } = self.law {
            // No section of a sphere is larger than that through its centre.
            let area = if per_area { PI * radius * radius } else { 1.0 };
            let stiffest = pairs.map(|pair| area * stiffer(pair)).fold(0.0, f64::max);
            return TimeLimits {
                spring: 2.0 * (mass / stiffest).sqrt(),
                rayleigh: None,
            };
        }
        let Law::HertzMindlin { impact_speed, .. } = self.law else {
            let stiffest = pairs
                .map(|pair| {
                    pair.normal_stiffness.at(2.0 * radius) * pair.shear_to_normal_stiffness.max(1.0)
                })
                .fold(0.0, f64::max);
            return TimeLimits {
                spring: 2.0 * (mass / stiffest).sqrt(),
                rayleigh: None,
            };
        };
        let root = radius.sqrt();
        let spring = pairs
            .map(|pair| {
                // At a wall radius and mass are the grain's own: no grain makes a stiffer contact.
                let [young, shear] = pair.moduli;
                let overlap =
                    hertz_mindlin::deepest(mass, 4.0 / 3.0 * young * root, impact_speed).sqrt();
                let stiffness = (2.0 * young).max(8.0 * shear) * root * overlap;
                let zeta = pair.normal_damping_ratio;
                // An explicit oscillator with a dashpot needs a shorter step by sqrt(1 + zeta²) - zeta.
                2.0 * (mass / stiffness).sqrt() * ((1.0 + zeta * zeta).sqrt() - zeta)
            })
            .fold(f64::INFINITY, f64::min);
        let density = mass / (4.0 / 3.0 * PI * radius.powi(3));
        let rayleigh = self.elastic.get(material);
        TimeLimits {
            spring,
            rayleigh: rayleigh.map(|elastic| elastic.rayleigh_time(radius, density)),
        }
    }

    /// What bounds the time step of a block of this mass [kg]. All its faces rest on others whole: with the stiffness K of all of them
    /// together in the stiffest direction, and neighbours that swing against it, no frequency is above sqrt(2 K/m).
    #[must_use]
    pub fn time_limits_of_block(
        &self,
        material: usize,
        shape: &Polyhedron,
        mass: f64,
    ) -> TimeLimits {
        let per_area = matches!(self.law, Law::Blocks { per_area: true, .. });
        let pairs = (0..self.materials).map(|other| self.pair(material, other));
        let stiffness = |pair: &PairParameters| {
            let normal = pair.normal_stiffness.number();
            let shear = normal * pair.shear_to_normal_stiffness;
            let mut total = Matrix3::zeros();
            for (face, plane) in shape.half_spaces().iter().enumerate() {
                let area = if per_area { shape.face_area(face) } else { 1.0 };
                let n = plane.normal;
                total +=
                    (Matrix3::identity() * shear + n * n.transpose() * (normal - shear)) * area;
            }
            total.symmetric_eigenvalues().max()
        };
        let stiffest = pairs.map(stiffness).fold(0.0, f64::max);
        TimeLimits {
            spring: (2.0 * mass / stiffest).sqrt(),
            rayleigh: None,
        }
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
                    moduli: [0.0; 2],
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
                    moduli: [0.0; 2],
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
                    moduli: [0.0; 2],
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
            Contact::HertzMindlin(law) => return Self::elastic(case, law, names, findings),
            Contact::Blocks(law) => return Self::blocks(case, law, names, findings),
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
            once(&mut seen, a, b, &format!("{path}.materials"), findings);
            if let Some(value) = pair.normal_stiffness {
                stiffness(value, &format!("{path}.normal_stiffness"), findings);
            }
            if pair.cohesion.is_some() && law != Law::CohesiveFrictional {
                findings.error(
                    &format!("{path}.cohesion"),
                    "this law has no cohesion",
                    Remedy::take_out(
                        "use cohesive_frictional, or take it out",
                        &format!("{path}.cohesion"),
                    ),
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
                        Remedy::take_out(
                            "use contact_bond, or take it out",
                            &format!("{path}.{name}"),
                        ),
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
            elastic: Vec::new(),
            parameters,
        })
    }

    /// The law of elastic spheres.
    fn elastic(
        case: &Case,
        law: &HertzMindlin,
        names: &[String],
        findings: &mut Findings,
    ) -> Option<Self> {
        let path = "contact.hertz_mindlin";
        if case.domain.size.0.len() == 2 {
            findings.error(
                path,
                "this is a law of spheres: the contact of two discs in the plane has no force of its overlap alone",
                Remedy::from("use linear, or a domain of three dimensions").set("contact", linear_law()),
            );
            return None;
        }
        let mut elastic = Vec::new();
        for (name, material) in &case.materials {
            let mut need = |value: Option<f64>, field: &str, example: &str| {
                if value.is_none() {
                    findings.error(
                        &format!("materials.{name}.{field}"),
                        "hertz_mindlin takes the stiffness of contacts from every material",
                        format!("write for example {example}, glass"),
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
        let falls = matches!(
            case.grains.as_ref().map(|grains| &grains.initial),
            Some(GrainSource::Deposition(rain)) if rain.falling_stiffness.is_some()
        );
        if falls {
            findings.error(
                "grains.initial.deposition.falling_stiffness",
                "hertz_mindlin has no spring to soften",
                "take it out, or let the grains fall with a softer young_modulus and read them from the file that they save",
            );
        }
        if case
            .grains
            .as_ref()
            .is_some_and(|grains| grains.bond_at_start)
        {
            findings.error(
                "grains.bond_at_start",
                "hertz_mindlin has no bonds",
                "take it out, or use contact_bond",
            );
        }
        if elastic.len() < names.len() {
            return None;
        }
        let n = names.len();
        let numbers = |a: usize, b: usize, friction: f64, restitution: f64| {
            let zeta = hertz_mindlin::damping(restitution, law.attraction);
            PairParameters {
                normal_stiffness: Scaled::ZERO,
                moduli: elastic[a].effective(elastic[b]),
                shear_to_normal_stiffness: 0.0,
                friction_coefficient: friction.to_radians().tan(),
                cohesion: Scaled::ZERO,
                strengths: [0.0; 2],
                normal_damping_ratio: zeta,
                shear_damping_ratio: zeta,
            }
        };
        let (friction, restitution) = (law.friction_angle_degrees, law.restitution);
        let mut parameters: Vec<PairParameters> = (0..n * n)
            .map(|k| numbers(k / n, k % n, friction, restitution))
            .collect();
        let mut seen: Vec<(usize, usize)> = Vec::new();
        for (index, pair) in law.pairs.iter().enumerate() {
            let path = format!("{path}.pairs[{index}].materials");
            let found = [0, 1]
                .map(|i| material(names, &pair.materials[i], &format!("{path}[{i}]"), findings));
            let [Some(a), Some(b)] = found else { continue };
            once(&mut seen, a, b, &path, findings);
            let own = numbers(
                a,
                b,
                pair.friction_angle_degrees.unwrap_or(friction),
                pair.restitution.unwrap_or(restitution),
            );
            parameters[a * n + b] = own;
            parameters[b * n + a] = own;
        }
        Some(Self {
            law: Law::HertzMindlin {
                attraction: law.attraction,
                impact_speed: law.impact_speed.unwrap_or_else(|| fastest_approach(case)),
            },
            rolling: None,
            local_damping: law.local_damping,
            materials: n,
            elastic,
            parameters,
        })
    }
}

impl ContactTable {
    /// The law of blocks.
    fn blocks(
        case: &Case,
        law: &Blocks,
        names: &[String],
        findings: &mut Findings,
    ) -> Option<Self> {
        let path = "contact.blocks";
        if case.domain.size.0.len() == 2 {
            findings.error(
                path,
                "this is a law for three dimensions",
                if has_polyhedra(case) {
                    "use a domain of three dimensions".into()
                } else {
                    Remedy::from("use linear, or a domain of three dimensions")
                        .set("contact", linear_law())
                },
            );
            return None;
        }
        agrees_with_blocks(case, findings);
        let (value, per_area) = match law.normal_stiffness {
            BlockStiffness::PerContact(value) => (value, false),
            BlockStiffness::PerArea(value) => (value, true),
        };
        let base = PairParameters {
            normal_stiffness: Scaled::Absolute(value),
            moduli: [0.0; 2],
            shear_to_normal_stiffness: law.shear_to_normal_stiffness,
            friction_coefficient: law.friction_angle_degrees.to_radians().tan(),
            cohesion: Scaled::ZERO,
            strengths: [0.0; 2],
            normal_damping_ratio: law.normal_damping_ratio,
            shear_damping_ratio: law.shear_damping_ratio,
        };
        let n = names.len();
        let mut parameters = vec![base; n * n];
        let mut seen: Vec<(usize, usize)> = Vec::new();
        for (index, pair) in law.pairs.iter().enumerate() {
            let path = format!("{path}.pairs[{index}].materials");
            let found = [0, 1]
                .map(|i| material(names, &pair.materials[i], &format!("{path}[{i}]"), findings));
            let [Some(a), Some(b)] = found else { continue };
            once(&mut seen, a, b, &path, findings);
            let own = between(base, pair);
            parameters[a * n + b] = own;
            parameters[b * n + a] = own;
        }
        Some(Self {
            law: Law::Blocks {
                per_area,
                mass_damping: law.mass_damping,
                model: law.model,
            },
            rolling: None,
            local_damping: 0.0,
            materials: n,
            elastic: Vec::new(),
            parameters,
        })
    }
}

/// What the law of blocks cannot do.
fn agrees_with_blocks(case: &Case, findings: &mut Findings) {
    if let Some(grains) = &case.grains {
        let source = match grains.initial {
            GrainSource::Growth(_) => Some("grains.initial.growth"),
            GrainSource::Deposition(_) => Some("grains.initial.deposition"),
            GrainSource::File { .. } | GrainSource::List(_) => None,
        };
        if let Some(path) = source {
            findings.error(
                path,
                "grains are not prepared with the law of blocks",
                "prepare them with another law, and read the file that they save",
            );
        }
        if grains.bond_at_start {
            findings.error(
                "grains.bond_at_start",
                "the law of blocks has no bonds",
                "take it out",
            );
        }
    }
}

/// The numbers of a pair of blocks.
fn between(base: PairParameters, pair: &BlockPair) -> PairParameters {
    let friction = pair.friction_angle_degrees;
    PairParameters {
        normal_stiffness: (pair.normal_stiffness).map_or(base.normal_stiffness, Scaled::Absolute),
        shear_to_normal_stiffness: pair
            .shear_to_normal_stiffness
            .unwrap_or(base.shear_to_normal_stiffness),
        friction_coefficient: friction
            .map_or(base.friction_coefficient, |angle| angle.to_radians().tan()),
        normal_damping_ratio: pair
            .normal_damping_ratio
            .unwrap_or(base.normal_damping_ratio),
        shear_damping_ratio: pair.shear_damping_ratio.unwrap_or(base.shear_damping_ratio),
        ..base
    }
}

/// The larger of a pair's two stiffnesses.
fn stiffer(pair: &PairParameters) -> f64 {
    pair.normal_stiffness.number() * pair.shear_to_normal_stiffness.max(1.0)
}

/// Each pair is given once.
fn once(seen: &mut Vec<(usize, usize)>, a: usize, b: usize, path: &str, findings: &mut Findings) {
    let pair = (a.min(b), a.max(b));
    if seen.contains(&pair) {
        findings.error(path, "this pair is given twice", "keep one of the two");
    }
    seen.push(pair);
}

/// From above, how fast two things of a case approach each other [m/s]: the two largest speeds at the start, and a fall through
/// the domain.
pub(crate) fn fastest_approach(case: &Case) -> f64 {
    let size = |vector: [f64; 3]| vector.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut speeds = vec![0.0, 0.0];
    for body in &case.bodies {
        if let Motion::Free { velocity, .. } | Motion::Driven { velocity, .. } = &body.motion {
            speeds.extend(velocity.as_ref().map(|v| size(v.to_array())));
        }
    }
    if let Some(GrainSource::List(list)) = case.grains.as_ref().map(|grains| &grains.initial) {
        let velocities = list.iter().filter_map(|grain| grain.velocity.as_ref());
        speeds.extend(velocities.map(|v| size(v.to_array())));
    }
    let velocities = case.walls.iter().filter_map(|wall| wall.velocity.as_ref());
    speeds.extend(velocities.map(|v| size(v.to_array())));
    speeds.sort_by(|a, b| b.total_cmp(a));
    let gravity = case.gravity.as_ref().map_or([0.0; 3], |g| g.to_array());
    let extent = case.domain.size.to_array();
    let fall: f64 = (0..3).map(|a| 2.0 * gravity[a].abs() * extent[a]).sum();
    let fastest = speeds[0] + speeds[1] + fall.sqrt();
    // Nothing moves, nothing falls: a creeping millimetre per second.
    if fastest > 0.0 { fastest } else { 1e-3 }
}

fn overridden(base: PairParameters, pair: &Pair) -> PairParameters {
    PairParameters {
        normal_stiffness: pair.normal_stiffness.unwrap_or(base.normal_stiffness),
        moduli: base.moduli,
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
            Remedy::from("write for example {\"per_diameter\": 1e8}")
                .set(path, json!({"per_diameter": 1e8})),
        );
    }
}
