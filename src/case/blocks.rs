//! Blocks: a jointed rock mass, a list in a file, or one by one (B-30, B-40). For 3-D.

use super::geometry::{Extent, Vector};
use super::solids::{Mesh, Orientation, Plane, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Convex polyhedral blocks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Material of the blocks; its density is needed.
    pub material: String,
    /// Where the blocks come from.
    pub initial: BlockSource,
    /// Boxes of bed rock [m]: a block never moves if its centroid lies in one.
    #[serde(default)]
    pub fixed: Vec<Extent>,
    /// JSON file to which the blocks are written as they start, in the form that `file` reads, so that every run of a study can
    /// reuse them: a file name in the output folder, none of those that the run writes itself.
    #[serde(default)]
    pub save: Option<PathBuf>,
}

/// Where blocks come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BlockSource {
    /// A rock mass cut by sets of joints.
    Joints(Joints),
    /// A list in a file: what `save` wrote, or the blocks of `SparkRocks`.
    File {
        /// JSON file; relative to the case.
        path: PathBuf,
    },
    /// One by one.
    List(Vec<Block>),
}

/// A convex rock mass cut into blocks by sets of joints, one after the other. The same blocks for a seed on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joints {
    /// The rock before it is cut.
    pub mass: Mass,
    /// Faces of slopes and excavations: what is on the side to which the normal points is not there.
    #[serde(default)]
    pub excavation: Vec<Plane>,
    /// The sets of joints, in the order in which they cut.
    pub sets: Vec<JointSet>,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Distance between the two walls of a joint [m]: 0 leaves blocks in touch, more lets water in.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub aperture: f64,
    /// A joint does not cut where a part would be thinner than this [m], measured by the largest sphere in it; without it a twentieth of the
    /// smallest mean spacing.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub smallest_thickness: Option<f64>,
    /// A joint does not cut where a part would be smaller than this [m3].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub smallest_volume: f64,
}

/// A convex solid of rock.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Mass {
    /// A box [m].
    Box(Extent),
    /// A closed convex surface from a file.
    Mesh(Mesh),
}

/// Parallel joints. Orientation as geologists measure it, with x to the east, y to the north and z up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointSet {
    /// Angle of the steepest line of a joint below the horizontal [degrees].
    #[schemars(range(min = 0.0, max = 90.0))]
    pub dip_degrees: f64,
    /// Bearing of that line, clockwise from north [degrees].
    #[schemars(range(min = 0.0, max = 360.0))]
    pub dip_direction_degrees: f64,
    /// Distance between neighbouring joints, across them.
    pub spacing: Spacing,
    /// A point of one joint [m]; the centroid of the rock mass without it.
    #[serde(default)]
    pub origin: Option<Vector>,
    /// Probability that a joint cuts a block in its way.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub persistence: f64,
}

/// Distribution of the spacing [m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Spacing {
    /// Always the same.
    Constant(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// All values between two bounds equally likely.
    Uniform {
        /// Smallest [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        min: f64,
        /// Largest [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        max: f64,
    },
    /// Negative exponential: joints placed at random.
    Exponential {
        /// Mean [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        mean: f64,
    },
    /// Normal; values not above zero are drawn again.
    Normal {
        /// Mean [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        mean: f64,
        /// Standard deviation [m], at most half of the mean.
        #[schemars(range(min = 0.0))]
        standard_deviation: f64,
    },
}

/// A block of a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Its shape: a polyhedron.
    pub shape: Shape,
    /// Its centroid [m]; without it the shape stands where its own coordinates say.
    #[serde(default)]
    pub position: Option<Vector>,
    /// How its shape is turned; as it is without it.
    #[serde(default)]
    pub orientation: Option<Orientation>,
    /// Velocity [m/s]; at rest without it.
    #[serde(default)]
    pub velocity: Option<Vector>,
    /// Rotation rate [rad/s]; none without it.
    #[serde(default)]
    pub angular_velocity: Option<[f64; 3]>,
    /// Material, if it is not that of the other blocks.
    #[serde(default)]
    pub material: Option<String>,
}

fn one() -> f64 {
    1.0
}
