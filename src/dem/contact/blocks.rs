//! Springs and friction of blocks, with mass-proportional damping.
//!
//! The narrow phase of [`crate::polyhedron`] handles pairs of blocks, a block and a sphere, and a block at a wall;
//! [`crate::polyhedron::force`] computes their force. This file contains the parameters, and the same law for two
//! spheres and a sphere at a wall:
//!
//! ```text
//! F_n = k_n overlap - c_n d(gap)/dt, at least 0
//! F_s = cut(F_s' - k_s slip dt - c_s slip)      cut to length mu F_n
//! area = pi R overlap,   R = r1 r2/(r1 + r2), the radius at a wall
//! ```
//!
//! The area is used if the stiffness is per area. To leading order the overlap volume is `area * overlap`, as for a
//! patch of a block.

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::super::blocks::{in_space, out_of_space};
use super::super::polyhedron::{self, BlockContactModel, BlockHistory, Polyhedron, Stiffness};
use super::super::space::{Components, Space};
use super::input::{coefficient, default_ratio, pair_table, states_friction};
use super::{
    ContactForce, ContactKinematics, ContactLaw, ContactModel, ContactParameters, PairProperties,
    PairTable, Preparation, SceneFacts, Springs, StaticContact, TimeLimits, cut_to, linear,
};
use crate::dashpot::{over_step, part_of_step};
use base::error::{Remedy, Report};

/// F_n = k_n δ, |F_s| <= F_n tan Φ between blocks, which have no tension; with moments against twisting and rocking
/// of faces in contact. Sliding and twisting share the friction of a face by an ellipsoid (Howe and Cutkosky 1996),
/// which is exact for sliding alone and for the twist of a square or a disc. A square face that slides and twists at
/// once loses its spin up to 40 % too fast, and its speed 4 % too slowly to 22 % too fast; the twist of a face of 4 to
/// 1 is braked by 6 % too much.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Blocks")]
pub struct BlockInput {
    /// Normal stiffness k_n.
    pub normal_stiffness: NormalStiffness,
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
    /// Dashpot in parallel with the shear spring, as a fraction of the critical damping of the pair.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: f64,
    /// Mass-proportional damping α of all free bodies [1/s]: the velocity of a body without contacts decays as exp(-α
    /// t).
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass_damping: f64,
    /// Model that reduces a contact to a point, a normal and a depth.
    #[serde(default)]
    pub model: BlockContactModel,
    /// Parameters of pairs of materials that differ from those above.
    #[serde(default)]
    pub pairs: Vec<BlockMaterialPair>,
}

/// Stiffness of a contact of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "BlockStiffness")]
pub enum NormalStiffness {
    /// Stiffness of a contact [N/m].
    PerContact(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Stiffness per contact area [Pa/m], as for rock joints.
    PerArea(#[schemars(extend("exclusiveMinimum" = 0))] f64),
}

impl NormalStiffness {
    /// Returns the normal and shear stiffness, with the value replaced by `number` if it is given.
    fn with(self, number: Option<f64>, ratio: f64) -> Stiffness {
        match self {
            Self::PerContact(own) => {
                let normal = number.unwrap_or(own);
                let shear = normal * ratio;
                Stiffness::PerContact { normal, shear }
            }
            Self::PerArea(own) => {
                let normal = number.unwrap_or(own);
                let shear = normal * ratio;
                Stiffness::PerArea { normal, shear }
            }
        }
    }
}

/// Parameters of one pair of materials of blocks; fields that are left out keep the values of the law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "BlockPair")]
pub struct BlockMaterialPair {
    /// Names of the two materials, in either order.
    pub materials: [String; 2],
    /// Normal stiffness, in the unit of the law's normal stiffness.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub normal_stiffness: Option<f64>,
    /// Shear to normal stiffness k_s/k_n \[1\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: Option<f64>,
    /// Friction angle \[degrees\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Normal dashpot as a fraction of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: Option<f64>,
    /// Shear dashpot as a fraction of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: Option<f64>,
}

impl BlockInput {
    /// Returns a law for blocks that never touch: without friction and dashpots.
    #[must_use]
    pub fn without_use() -> Self {
        Self {
            normal_stiffness: NormalStiffness::PerArea(1.0),
            shear_to_normal_stiffness: 0.0,
            friction_angle_degrees: None,
            normal_damping_ratio: 0.0,
            shear_damping_ratio: 0.0,
            mass_damping: 0.0,
            model: BlockContactModel::default(),
            pairs: Vec::new(),
        }
    }

    /// Returns the springs of a pair, or those of the law without a pair.
    fn springs(&self, pair: Option<&BlockMaterialPair>) -> polyhedron::BlockPairLaw {
        let own = |get: fn(&BlockMaterialPair) -> Option<f64>, otherwise: f64| {
            pair.and_then(get).unwrap_or(otherwise)
        };
        let ratio = own(
            |p| p.shear_to_normal_stiffness,
            self.shear_to_normal_stiffness,
        );
        polyhedron::BlockPairLaw {
            stiffness: self
                .normal_stiffness
                .with(pair.and_then(|p| p.normal_stiffness), ratio),
            friction: coefficient(own(
                |p| p.friction_angle_degrees,
                self.friction_angle_degrees.unwrap_or(0.0),
            )),
            normal_damping_ratio: own(|p| p.normal_damping_ratio, self.normal_damping_ratio),
            shear_damping_ratio: own(|p| p.shear_damping_ratio, self.shear_damping_ratio),
        }
    }

    /// Reports features of a scene that the law does not support.
    fn check(scene: &SceneFacts<'_>, report: &mut dyn Report) {
        let source = match scene.grains {
            Preparation::Growth => Some("grains.initial.growth"),
            Preparation::Deposition { .. } => Some("grains.initial.deposition"),
            Preparation::Listed => None,
        };
        if let Some(path) = source {
            report.error(
                path,
                "the contact law for blocks cannot prepare grains".into(),
                "prepare them in another run with another law, and read the saved sample".into(),
            );
        }
        if scene.bond_at_start {
            report.error(
                "grains.bond_at_start",
                "the contact law for blocks does not support bonds".into(),
                "remove it".into(),
            );
        }
    }
}

impl<F: From<BlockLaw>> ContactParameters<F> for BlockInput {
    fn states_friction(&self) -> bool {
        states_friction(self.friction_angle_degrees, &self.pairs, |p| {
            p.friction_angle_degrees
        })
    }

    fn of_polyhedra(&self) -> bool {
        true
    }

    fn resolve(&self, scene: &SceneFacts<'_>, report: &mut dyn Report) -> Option<F> {
        let path = "contact.blocks";
        if scene.dimension == 2 {
            report.error(
                path,
                "this law works in 3-D only".into(),
                if scene.polyhedra {
                    "use a 3-D domain".into()
                } else {
                    Remedy::from("use linear, or a 3-D domain").set("contact", linear::example())
                },
            );
            return None;
        }
        Self::check(scene, report);
        let parameters = pair_table(
            (path, scene),
            PairTable::uniform(scene.material_count(), self.springs(None)),
            (&self.pairs, |pair| &pair.materials),
            report,
            |_, pair, _, _| self.springs(Some(pair)),
        );
        Some(
            BlockLaw {
                parameters,
                model: self.model,
                mass_damping: self.mass_damping,
            }
            .into(),
        )
    }
}

/// Returns the law as an example in findings.
#[must_use]
pub fn example() -> Value {
    json!({"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 30}})
}

/// Law of blocks: see the module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BlockLaw {
    /// Parameters per pair of materials.
    pub parameters: PairTable<polyhedron::BlockPairLaw>,
    /// Method by which a contact of blocks is reduced to a point.
    pub model: BlockContactModel,
    /// Mass-proportional damping [1/s] of all bodies, blocks and spheres; 0 for none.
    pub mass_damping: f64,
}

/// Returns springs and dashpots of a contact over `area` \[m²\] against an effective mass \[kg\], for stability.
pub fn springs(pair: &polyhedron::BlockPairLaw, area: f64, mass: f64) -> Springs {
    Springs::damped(
        pair.stiffness(area),
        pair.friction > 0.0,
        ([pair.normal_damping_ratio, pair.shear_damping_ratio], 1.0),
        mass,
    )
}

impl ContactModel for BlockLaw {
    fn describe(&self) -> String {
        match self.model {
            BlockContactModel::Pressure => "blocks with friction, pressure proportional to depth",
            BlockContactModel::Patch => "blocks with friction, one force per contact patch",
            BlockContactModel::Point { .. } => "blocks with friction, forces at contact points",
        }
        .into()
    }

    fn materials(&self) -> u32 {
        self.parameters.materials()
    }

    fn friction(&self, [a, b]: [u32; 2]) -> f64 {
        self.parameters.get(a, b).friction
    }

    /// Returns the normal stiffness; if it is per area, that over the largest section of a sphere of that diameter,
    /// which bounds every contact area inside it.
    fn normal_stiffness(&self, [a, b]: [u32; 2], diameter: f64) -> f64 {
        let radius = 0.5 * diameter;
        let section = std::f64::consts::PI * radius * radius;
        self.parameters.get(a, b).stiffness(section)[0]
    }

    /// Changes only the friction: no grains are prepared with the law of blocks.
    fn prepare(&mut self, _: Option<f64>, friction: Option<f64>) {
        for pair in self.parameters.rows_mut() {
            pair.friction = friction.unwrap_or(pair.friction);
        }
    }

    fn springs(&self, contact: &StaticContact) -> Springs {
        let [a, b] = contact.materials;
        let section = std::f64::consts::PI * contact.radius * contact.radius;
        springs(self.parameters.get(a, b), section, contact.mass)
    }

    fn time_limits(&self, material: u32, [radius, _]: [f64; 2], mass: f64) -> TimeLimits {
        // The largest section of a sphere passes through its centre.
        let area = std::f64::consts::PI * radius * radius;
        let stiffest = |pair: &polyhedron::BlockPairLaw| {
            let [normal, shear] = pair.stiffness(area);
            normal.max(shear)
        };
        let pairs = self.parameters.rows_of(material);
        TimeLimits::of_spring(mass, pairs.map(stiffest).fold(0.0, f64::max))
    }

    /// All faces rest on other blocks: with the total stiffness K in the stiffest direction, and neighbours that
    /// move against the block, no angular frequency exceeds sqrt(2 K/m).
    fn time_limits_of_block(
        &self,
        material: u32,
        shape: &Polyhedron,
        mass: f64,
    ) -> Option<TimeLimits> {
        let stiffness = |pair: &polyhedron::BlockPairLaw| {
            let mut total = Matrix3::zeros();
            for (face, plane) in shape.half_spaces().iter().enumerate() {
                let (per_unit, area) = match pair.stiffness {
                    Stiffness::PerContact { normal, shear } => ([normal, shear], 1.0),
                    Stiffness::PerArea { normal, shear } => {
                        ([normal, shear], shape.face_area(face))
                    }
                };
                let [normal, shear] = per_unit;
                let n = plane.normal;
                total +=
                    (Matrix3::identity() * shear + n * n.transpose() * (normal - shear)) * area;
            }
            total.symmetric_eigenvalues().max()
        };
        let pairs = self.parameters.rows_of(material);
        let stiffest = pairs.map(stiffness).fold(0.0, f64::max);
        Some(TimeLimits {
            spring: (2.0 * mass / stiffest).sqrt(),
            rayleigh: None,
        })
    }

    fn blocks(&self) -> Option<&BlockLaw> {
        Some(self)
    }
}

/// Values per pair: effective mass \[kg\], and `r1 r2/(r1 + r2)` \[m\] of the enclosing spheres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockScale {
    pub(crate) mass: f64,
    radius: f64,
}

/// Values per pair: see [`BlockScale`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockConstants {
    pub(crate) law: polyhedron::BlockPairLaw,
    pub(crate) scale: BlockScale,
}

impl<S: Space> ContactLaw<S> for BlockLaw {
    type Row = polyhedron::BlockPairLaw;
    type Scale = BlockScale;
    type Constants = BlockConstants;
    type History = BlockHistory;

    fn table(&self) -> PairTable<Self::Row> {
        self.parameters.clone()
    }

    fn scale(_: &Self::Row, pair: &PairProperties) -> BlockScale {
        BlockScale {
            mass: pair.mass,
            radius: pair.rolling_radius,
        }
    }

    #[inline(always)]
    fn constants(row: &Self::Row, scale: &BlockScale, _: f64) -> BlockConstants {
        BlockConstants {
            law: *row,
            scale: *scale,
        }
    }

    #[inline(always)]
    fn force(
        constants: &BlockConstants,
        history: &mut BlockHistory,
        kinematics: &ContactKinematics<S>,
    ) -> ContactForce<S> {
        let BlockConstants { law, scale } = constants;
        let [normal, shear] =
            law.stiffness(std::f64::consts::PI * scale.radius * kinematics.overlap);
        let dashpot =
            |fraction: f64, stiffness: f64| 2.0 * fraction * (scale.mass * stiffness).sqrt();
        let brake = dashpot(law.normal_damping_ratio, normal);
        let (rate, step) = (kinematics.separation_rate, kinematics.time_step);
        let brake =
            over_step(brake, step, 1.0, scale.mass) * part_of_step(kinematics.overlap, rate, step);
        let push = normal * kinematics.overlap - brake * rate;
        let push = push.max(0.0);
        let limit = law.friction * push;
        let carried = S::turn(&out_of_space(&history.spring()), &kinematics.normal);
        let spring = carried - kinematics.slip * (shear * kinematics.time_step);
        let total = spring - kinematics.slip * dashpot(law.shear_damping_ratio, shear);
        let length = total.length();
        let (tangent, spring) = if length > limit {
            let cut = cut_to(total, length, limit);
            (cut, cut)
        } else {
            (total, spring)
        };
        history.hold(&S::to_volume(&kinematics.normal), &in_space(&spring));
        ContactForce {
            normal: push,
            tangent,
            moment: S::Spin::default(),
            failure: None,
        }
    }

    fn normal_spring(constants: &BlockConstants, _: &BlockHistory, overlap: f64) -> f64 {
        let area = std::f64::consts::PI * constants.scale.radius * overlap;
        constants.law.stiffness(area)[0] * overlap
    }

    fn shear_spring(history: &BlockHistory) -> S::Tangent {
        out_of_space(&history.spring())
    }

    /// Returns the stiffness over the largest section of the sphere, which bounds every contact area inside it.
    fn stiffness(constants: &BlockConstants) -> [f64; 2] {
        let radius = constants.scale.radius;
        constants
            .law
            .stiffness(std::f64::consts::PI * radius * radius)
    }

    const NUMBERS: usize = BlockHistory::NUMBERS;
    const SPATIAL: bool = true;

    fn save(history: &BlockHistory, numbers: &mut Vec<f64>) {
        numbers.extend(history.save());
    }

    fn load(numbers: &[f64]) -> BlockHistory {
        let mut all = [0.0; BlockHistory::NUMBERS];
        for (number, saved) in all.iter_mut().zip(numbers) {
            *number = *saved;
        }
        BlockHistory::load(&all)
    }
}
