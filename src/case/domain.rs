//! The domain, its cells, and its decomposition into slabs.

use super::geometry::{Axis, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The simulated box. Its lower corner is the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Edge lengths [m]. Two numbers make the problem 2-D (per metre of depth), three make it 3-D.
    pub size: Vector,
    /// Cell size h [m]. Every edge of the domain must be a whole number of cells. Cell centres lie at (i + 1/2) h, so
    /// that half-way walls coincide with the faces of the domain. Default: enough cells across the smallest body,
    /// grain, gap or opening to meet `accuracy`; in seepage without grains across the shortest wall, layer, stretch
    /// between heads or capillary length. If no such spacing divides all edges, it divides the shortest edge,
    /// and the others are lengthened to whole cells with a warning that states by how much.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing: Option<f64>,
    /// Periodic axes.
    #[serde(default)]
    pub periodic: Vec<Axis>,
    /// Axis along which the domain is divided into slabs, one per rank.
    #[serde(default)]
    pub split: Split,
    /// Index of the first cell plane of every slab but the first, along the split axis. The list has one entry less
    /// than there are ranks. Default: slabs of equal cost, by the cells and solids in them; a run changes its slabs
    /// at a checkpoint if that saves a tenth of the time.
    #[serde(default)]
    pub slab_bounds: Option<Vec<u32>>,
}

/// Axis along which the domain is divided.
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
    /// Density of the solid [kg/m3]. Required for grains, blocks and bodies that move freely, but not for walls.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: Option<f64>,
    /// Young's modulus [Pa]. Required by the Hertz-Mindlin law, also for walls; 1e18 makes a wall rigid.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1e18))]
    pub young_modulus: Option<f64>,
    /// Poisson's ratio [1]. Required by the Hertz-Mindlin law.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub poisson_ratio: Option<f64>,
}
