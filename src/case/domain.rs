//! The box, its cells, and how it is cut into slabs.

use super::geometry::{Axis, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The box in which everything happens; its lower corner is the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Edge lengths [m]; two numbers make the problem 2-D (per metre of depth), three make it 3-D.
    pub size: Vector,
    /// Edge h of a cell [m]; every edge of the domain is a whole number of cells. Cell centres lie at (i + 1/2) h,
    /// so that a wall half-way between nodes lies exactly on a face of the domain. Without it the program chooses: as many
    /// cells across the smallest thing in the water as `accuracy` needs.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing: Option<f64>,
    /// Axes along which the domain repeats itself.
    #[serde(default)]
    pub periodic: Vec<Axis>,
    /// Axis along which the domain is cut into slabs, one per rank; `auto` takes the longest.
    #[serde(default)]
    pub split: Split,
    /// First plane of every slab after the first, as plane indices along the split axis; without it the slabs are
    /// equally thick. The list holds one number less than there are ranks.
    #[serde(default)]
    pub slab_bounds: Option<Vec<u32>>,
}

/// The axis along which slabs are cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Split {
    /// The axis with the most cells.
    #[default]
    Auto,
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z (3-D only).
    Z,
}

/// A material of grains, bodies or walls.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Density of the solid [kg/m3]; needed by whatever moves freely, not by walls.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: Option<f64>,
    /// Young's modulus [Pa]; needed by the Hertz-Mindlin law, of walls too. 1e18 makes a wall rigid.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e18))]
    pub young_modulus: Option<f64>,
    /// Poisson's ratio, without unit; needed by the Hertz-Mindlin law.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub poisson_ratio: Option<f64>,
}
