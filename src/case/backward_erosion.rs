//! Backward erosion piping as written.

use super::geometry::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Backward erosion piping: the head at which a pipe of water below an impervious structure grows from the exit to the
/// driving boundary, with the limit equilibrium of the grains at its bottom (Sellmeijer). The answer is written to
/// `summary.json` and, for every length, to `backward_erosion.csv`. Needs saturated ground without grains, gravity
/// along an axis, and heads as the only imposed pressures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BackwardErosion {
    /// Name of the boundary with the driving head. Its head in the case is compared with the critical head.
    pub drive: String,
    /// Name of the boundary at which the pipe begins, with the head at the exit of the pipe.
    pub exit: String,
    /// Line along which the pipe grows.
    pub pipe: PipeLine,
    /// Diameter d70 of the sand [m]: 70 % of its mass is finer.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.1))]
    pub d70: f64,
    /// Diameter in the equilibrium of the grains.
    #[serde(default)]
    pub diameter: EquilibriumDiameter,
    /// Density of the grains [kg/m3]. Default: quartz, 2650.
    #[serde(default = "quartz")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 10000))]
    pub grain_density: f64,
    /// Coefficient of White, eta [1]: part of the weight of the grains that the shear stress of the water moves.
    #[serde(default = "white")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub white_coefficient: f64,
    /// Bedding angle of the grains, theta [deg].
    #[serde(default = "bedding_angle")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 80))]
    pub bedding_angle: f64,
    /// Width of the pipe in 3-D. A section in 2-D has a pipe of unit width, as along a ditch.
    #[serde(default)]
    pub width: Option<WidthOfPipe>,
    /// Dike on a homogeneous layer, for which the rule of Sellmeijer et al. (2011) is evaluated next to the answer: the
    /// published formula with its regression of d70, whatever `diameter` is.
    #[serde(default)]
    pub rule: Option<DikeOnSand>,
}

/// Line of a pipe at the lower face of an impervious roof. It is horizontal and runs along an axis; its cells are those
/// below it whose centres lie between its ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PipeLine {
    /// Beginning at the exit [m].
    pub from: Vector,
    /// End of the search, towards the driving boundary [m].
    pub to: Vector,
}

/// Diameter of the grains in their equilibrium at the bottom of a pipe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EquilibriumDiameter {
    /// The diameter d70.
    #[default]
    D70,
    /// 2.08e-4 m (d70/2.08e-4 m)^0.4: the dependence on d70 that small tests show (Sellmeijer et al. 2011).
    Sellmeijer2011,
}

/// Width of a pipe in 3-D.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WidthOfPipe {
    /// Width [m]; at most that of a cell.
    Fixed(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Width over height [1].
    Ratio(#[schemars(extend("exclusiveMinimum" = 0, "maximum" = 100000))] f64),
}

/// Dike on a homogeneous layer of sand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DikeOnSand {
    /// Length of the seepage below the dike, L [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: f64,
    /// Thickness of the layer, D [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub thickness: f64,
}

fn quartz() -> f64 {
    2650.0
}

fn white() -> f64 {
    0.25
}

fn bedding_angle() -> f64 {
    37.0
}
