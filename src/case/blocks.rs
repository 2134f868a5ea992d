//! Blocks: a jointed rock mass, a list in a file, or one by one. 3-D only.

use super::geometry::{Extent, Vector};
use super::solids::{Mesh, Orientation, Plane, Shape};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Convex polyhedral blocks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Material of the blocks. It needs a density.
    pub material: String,
    /// Source of the blocks.
    pub initial: BlockSource,
    /// Boxes of fixed bedrock [m]: a block whose centroid lies in one of them never moves.
    #[serde(default)]
    pub fixed: Vec<Extent>,
    /// JSON file to which the initial blocks are written, in the format that `initial.file` reads, so that other runs
    /// can reuse them. A file name in the output folder, different from the output files of the program.
    #[serde(default)]
    pub save: Option<PathBuf>,
}

/// Source of blocks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BlockSource {
    /// A rock mass cut by joint sets.
    Joints(Joints),
    /// A list in a file: written by `save`, the blocks of `SparkRocks`, the polyhedra of a legacy VTK file such as
    /// those of `UnBlocks-Gen`, or those of a file `BODIES.DAT` of LMGC90.
    File {
        /// JSON file, VTK file as text or `BODIES.DAT`, relative to the case.
        path: PathBuf,
        /// Position of the origin of the file in the domain [m]. Default: the origin of the domain.
        #[serde(default)]
        origin: Option<Vector>,
    },
    /// A list of blocks.
    List(Vec<Block>),
}

/// A convex rock mass that joint sets cut into blocks, one set after another. Equal seeds give equal blocks on any
/// number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joints {
    /// The rock mass before it is cut.
    pub rock_mass: Mass,
    /// Planes of slopes and excavations: the rock on the side of the normal is removed.
    #[serde(default)]
    pub excavation: Vec<Plane>,
    /// Joint sets, in the order in which they cut.
    pub sets: Vec<JointSet>,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Distance between the two walls of a joint [m]. With 0 the blocks touch; an open joint admits water.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub aperture: f64,
    /// Smallest thickness of a block [m], measured by its inscribed sphere: a joint does not cut off thinner parts.
    /// Default: a twentieth of the smallest mean spacing.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub smallest_thickness: Option<f64>,
    /// Smallest volume of a block [m3]: a joint does not cut off smaller parts.
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

/// A set of parallel joints. Orientation follows the geological convention, with x to the east, y to the north and z
/// up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointSet {
    /// Dip: angle between the line of steepest descent and the horizontal [degrees].
    #[schemars(range(min = 0.0, max = 90.0))]
    pub dip_degrees: f64,
    /// Dip direction: bearing of the line of steepest descent, clockwise from north [degrees].
    #[schemars(range(min = 0.0, max = 360.0))]
    pub dip_direction_degrees: f64,
    /// Normal distance between neighbouring joints [m].
    pub spacing: Spacing,
    /// A point on one of the joints [m]. Default: the centroid of the rock mass.
    #[serde(default)]
    pub origin: Option<Vector>,
    /// Persistence: probability that a joint cuts a block on its path [1].
    #[serde(default = "crate::one")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub persistence: f64,
}

/// Distribution of the spacing [m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Spacing {
    /// Constant spacing [m].
    Constant(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Uniform distribution between two bounds.
    Uniform {
        /// Smallest spacing [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        min: f64,
        /// Largest spacing [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        max: f64,
    },
    /// Negative exponential distribution: joints placed at random.
    Exponential {
        /// Mean spacing [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        mean: f64,
    },
    /// Normal distribution. Values that are not positive are drawn again.
    Normal {
        /// Mean spacing [m].
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
    /// Shape: a convex polyhedron.
    pub shape: Shape,
    /// Centroid [m]. Default: the position given by the coordinates of the shape.
    #[serde(default)]
    pub position: Option<Vector>,
    /// Rotation of the shape. Default: none.
    #[serde(default)]
    pub orientation: Option<Orientation>,
    /// Initial velocity [m/s]. Default: zero.
    #[serde(default)]
    pub velocity: Option<Vector>,
    /// Initial angular velocity [rad/s]. Default: zero.
    #[serde(default)]
    pub angular_velocity: Option<[f64; 3]>,
    /// Material. Default: the material of all blocks.
    #[serde(default)]
    pub material: Option<String>,
}
