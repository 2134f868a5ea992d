//! Contact laws of grains with grains, bodies and walls.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The law of every contact; pairs of materials may have their own numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Contact {
    /// Linear springs with friction, no tension.
    Linear(Linear),
    /// Linear springs with friction and brittle cohesion (A-17 … A-21).
    CohesiveFrictional(CohesiveFrictional),
    /// The linear law with bonds of given tensile and shear strength (C-03, C-04).
    ContactBond(ContactBond),
    /// Elastic spheres: Hertz's normal force, Mindlin's without slip across it, friction (3-D only).
    HertzMindlin(HertzMindlin),
    /// Blocks, and spheres among them: springs over the area of contact or at a point, friction (B-04, 3-D only).
    Blocks(Blocks),
}

/// A quantity of a contact, fixed or proportional to the mean diameter d of the two grains (that of the grain at a
/// wall), as in k_n/d = 150e6 N/m2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scaled {
    /// Times the mean diameter [unit per m].
    PerDiameter(#[schemars(range(min = 0.0))] f64),
    /// The same for every pair. In 2-D per metre of depth.
    Absolute(#[schemars(range(min = 0.0))] f64),
}

impl Scaled {
    /// Zero for every pair.
    pub const ZERO: Self = Self::Absolute(0.0);

    /// The value for a pair of mean diameter `diameter` [m].
    #[must_use]
    pub fn at(self, diameter: f64) -> f64 {
        match self {
            Self::PerDiameter(value) => value * diameter,
            Self::Absolute(value) => value,
        }
    }

    /// The number as written.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::PerDiameter(value) | Self::Absolute(value) => value,
        }
    }
}

impl Default for Scaled {
    fn default() -> Self {
        Self::ZERO
    }
}

/// F_n = k_n δ, |F_s| <= F_n tan Φ; springs act in compression only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// Normal stiffness k_n [N/m].
    pub normal_stiffness: Scaled,
    /// k_s/k_n, without unit.
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: f64,
    /// Dashpot in parallel with the normal spring, as a fraction of the critical damping of the pair.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: f64,
    /// The same along the shear spring.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: f64,
    /// Whether the dashpot may pull while the grains part. Without it the normal force is never tensile and a
    /// collision rebounds a little faster than the damping ratio says.
    #[serde(default)]
    pub attraction: bool,
    /// Resistance to rolling; none without it.
    #[serde(default)]
    pub rolling: Option<Rolling>,
    /// Every force on a grain less this fraction of itself against the motion (0 off), without unit.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Other numbers for certain pairs of materials.
    #[serde(default)]
    pub pairs: Vec<Pair>,
}

/// Resistance to rolling as an elastic-plastic spring-dashpot: type C of Ai, Chen, Rotter and Ooi (2011).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rolling {
    /// Coefficient of rolling friction: the moment is at most this times the rolling radius times the normal force.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub friction: f64,
    /// Dashpot in parallel with the rolling spring, as a fraction of critical damping.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub damping_ratio: f64,
}

/// Bonded: F_n = k_n δ down to minus the tensile strength, |F_s| up to the shear strength, no sliding and no moment.
/// A bond that fails is gone for good; without one the law is the linear one (C-03, C-04).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactBond {
    /// Normal stiffness k_n [N/m]; per diameter [N/m2].
    pub normal_stiffness: Scaled,
    /// k_s/k_n, without unit.
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ of contacts without a bond [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: f64,
    /// Force that pulls a bond apart [N]; in 2-D per metre of depth.
    #[schemars(range(min = 0.0))]
    pub tensile_strength: f64,
    /// Force that shears a bond off [N]; in 2-D per metre of depth.
    #[schemars(range(min = 0.0))]
    pub shear_strength: f64,
    /// `bond_at_start` bonds all whose surfaces are at most so far apart [m]; 0: only those that touch.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub bonding_gap: f64,
    /// Whether a bond made across a gap starts without a force. Else it pulls at once with k_n times the gap, and
    /// fails at once where that is above its strength.
    #[serde(default)]
    pub unstressed: bool,
    /// Dashpot in parallel with the normal spring, as a fraction of the critical damping of the pair.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: f64,
    /// The same along the shear spring.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: f64,
    /// Resistance to rolling; none without it.
    #[serde(default)]
    pub rolling: Option<Rolling>,
    /// Every force on a grain less this fraction of itself against the motion (0 off), without unit.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Other numbers for certain pairs of materials.
    #[serde(default)]
    pub pairs: Vec<Pair>,
}

/// F_n = k_n δ down to -C; |F_s| <= F_n tan Φ + C; a contact that opens or slips loses C for good.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CohesiveFrictional {
    /// Normal stiffness k_n [N/m]; per diameter [N/m2].
    pub normal_stiffness: Scaled,
    /// k_s/k_n, without unit.
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: f64,
    /// Cohesion C = C_s = -C_n of a bonded contact [N]; per diameter [N/m].
    #[serde(default)]
    pub cohesion: Scaled,
    /// Dashpot in parallel with the normal spring, as a fraction of the critical damping of the pair.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: f64,
    /// The same along the shear spring.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: f64,
    /// Every force on a grain less this fraction of itself against the motion (0 off), without unit.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Other numbers for certain pairs of materials.
    #[serde(default)]
    pub pairs: Vec<Pair>,
}

/// F_n = 4/3 E* sqrt(R*) δ^(3/2) with dashpots that restitute a given part of the speed, whatever the speed; incremental shear
/// of stiffness 8 G* sqrt(R* δ); |F_s| <= F_n tan Φ. The moduli come from `young_modulus` and `poisson_ratio` of the materials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HertzMindlin {
    /// Friction angle Φ [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: f64,
    /// Speed after over speed before a head-on collision, without unit; 1 is elastic.
    #[serde(default = "elastic")]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub restitution: f64,
    /// Whether the dashpot may pull while the grains part. The restitution is the same with and without it.
    #[serde(default)]
    pub attraction: bool,
    /// Fastest approach that is expected [m/s]: the time step is chosen for the stiffness at the overlap that it makes. Without it
    /// the sum of the two largest speeds at the start and that of a fall through the domain.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub impact_speed: Option<f64>,
    /// Every force on a grain less this fraction of itself against the motion (0 off), without unit.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Other numbers for certain pairs of materials.
    #[serde(default)]
    pub pairs: Vec<ElasticPair>,
}

/// Numbers of one pair of elastic materials; what is left out is as for all other pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElasticPair {
    /// The two materials, in either order.
    pub materials: [String; 2],
    /// Friction angle [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Speed after over speed before a head-on collision.
    #[serde(default)]
    #[schemars(range(min = 0.05, max = 1.0))]
    pub restitution: Option<f64>,
}

/// F_n = k_n δ, |F_s| <= F_n tan Φ between blocks, which have no tension; with moments against twisting and rocking where faces meet (B-04).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Normal stiffness k_n.
    pub normal_stiffness: BlockStiffness,
    /// k_s/k_n, without unit.
    #[serde(default = "default_ratio")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: f64,
    /// Friction angle Φ [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: f64,
    /// Dashpot in parallel with the normal spring, as a fraction of the critical damping of the pair.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub normal_damping_ratio: f64,
    /// The same along the shear spring.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub shear_damping_ratio: f64,
    /// Mass-proportional damping α of all that moves freely [1/s]: a body alone slows down as exp(-α t) (B-01).
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass_damping: f64,
    /// How a contact is condensed to a point, a normal and a depth (B-06 … B-10).
    #[serde(default)]
    pub model: BlockModel,
    /// Other numbers for certain pairs of materials.
    #[serde(default)]
    pub pairs: Vec<BlockPair>,
}

/// Stiffness of a contact of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlockStiffness {
    /// The same for every contact [N/m].
    PerContact(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Times the area of contact [Pa/m], as joints of rock are measured.
    PerArea(#[schemars(extend("exclusiveMinimum" = 0))] f64),
}

/// How a contact of blocks is condensed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BlockModel {
    /// Volume and vector area of the overlap: faces that rest on faces.
    #[default]
    Patch,
    /// Analytic centre of the overlap and normal of the potential particles (Boon et al. 2012).
    Point {
        /// Rounding of the corners [m]: more than an overlap, much less than a block.
        #[schemars(extend("exclusiveMinimum" = 0))]
        rounding: f64,
    },
}

/// Numbers of one pair of materials of blocks; what is left out is as for all other pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlockPair {
    /// The two materials, in either order.
    pub materials: [String; 2],
    /// Normal stiffness, in the unit of that of the law.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub normal_stiffness: Option<f64>,
    /// k_s/k_n, without unit.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: Option<f64>,
    /// Friction angle [degrees].
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

fn elastic() -> f64 {
    1.0
}

fn default_ratio() -> f64 {
    0.4
}

/// Numbers of one pair of materials; what is left out is as for all other pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pair {
    /// The two materials, in either order.
    pub materials: [String; 2],
    /// Normal stiffness [N/m]; per diameter [N/m2].
    #[serde(default)]
    pub normal_stiffness: Option<Scaled>,
    /// k_s/k_n, without unit.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub shear_to_normal_stiffness: Option<f64>,
    /// Friction angle [degrees].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Cohesion [N]; per diameter [N/m]; only in the cohesive law.
    #[serde(default)]
    pub cohesion: Option<Scaled>,
    /// Tensile strength of a bond [N]; only in the contact-bond law.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub tensile_strength: Option<f64>,
    /// Shear strength of a bond [N]; only in the contact-bond law.
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
