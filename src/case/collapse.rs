//! Ground collapse over seepage points: measured quantities, their places, and the thresholds of the stages.

use super::geometry::{Axis, Extent};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Ground collapse over seepage points: eroded grains, voids over the points, settlement and extent of the surface
/// depression, stages of the collapse, and clusters of loose grains. 3-D only, with gravity along one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroundCollapse {
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// Seepage points. Default: every region that removes grains.
    #[serde(default)]
    pub points: Vec<SeepagePoint>,
    /// Horizontal axis along which the ground extends. Default: the longer horizontal edge of the domain.
    #[serde(default)]
    pub long_axis: Option<Axis>,
    /// Edge of the cells in which voids, displacements and the surface are measured [m]. Default: two initial mean
    /// diameters. Smaller cells would count pores as voids.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cell_size: Option<f64>,
    /// A cell is void if its solid volume is below this fraction of the initial one [1].
    #[serde(default = "half")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub void_below: f64,
    /// A grain is loose if its displacement exceeds this many mean diameters [1].
    #[serde(default = "crate::one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub loose_diameters: f64,
    /// Percentile of the settlement of all columns that is written [%].
    #[serde(default = "ninety")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub settlement_percentile: f64,
    /// Thresholds at which the stages of the collapse begin.
    #[serde(default)]
    pub stages: StageThresholds,
}

/// A point through which grains leave the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeepagePoint {
    /// Name of a region that removes grains: the grains it removes count for this point. With `box`, any name: grains
    /// removed within the box count.
    pub name: String,
    /// The opening above which voids are measured [m]. Default: the box of the region with this name.
    #[serde(default, rename = "box")]
    pub region: Option<Extent>,
}

/// Thresholds at which the stages of the collapse begin. Lengths are in initial mean diameters, the scale of a single
/// grain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StageThresholds {
    /// Number of consecutive samples that must show a stage; the stage begins with the first of them. A single
    /// sample may be noise.
    #[schemars(range(min = 1, max = 1000))]
    pub samples: u32,
    /// Stage t1, hidden hole: number of grains that have left through one point. It must exceed the few that initially
    /// lie in the opening.
    #[schemars(range(min = 1))]
    pub hole_grains: u32,
    /// Stage t1 also begins with a void of this volume over one point [m3]. Default: the volume of one cell.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub hole_volume: Option<f64>,
    /// Mean downward displacement, in mean diameters, above which a cell counts as moving [1]. It lies above the
    /// settlement under water and load and below one grain spacing.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub moving_diameters: f64,
    /// Stage t2, arch: the moving ground over one point reaches this fraction of the cover, while the surface has not
    /// settled [1].
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub arch_reach: f64,
    /// Stage t2 also requires a void of this volume over that point [m3]. Default: the volume of one cell.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub arch_void: Option<f64>,
    /// Stage t3, sinkhole: settlement of a surface column over a point, or of two neighbouring ones elsewhere, in mean
    /// diameters, measured by elevation and by the initial surface grains [1]. Columns beyond it form the depression.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sinkhole_diameters: f64,
    /// Stage t4, extension: length of the longest depression over the larger extent of the sinkhole at t3 [1].
    #[schemars(extend("exclusiveMinimum" = 1))]
    pub extension_ratio: f64,
    /// Stage t4 also requires this mean displacement of the soil towards the points, in mean diameters [1].
    #[schemars(range(min = 0.0))]
    pub inward_diameters: f64,
}

impl Default for StageThresholds {
    fn default() -> Self {
        Self {
            samples: 3,
            hole_grains: 10,
            hole_volume: None,
            moving_diameters: 0.25,
            arch_reach: 0.5,
            arch_void: None,
            sinkhole_diameters: 1.0,
            extension_ratio: 1.5,
            inward_diameters: 0.1,
        }
    }
}

fn half() -> f64 {
    0.5
}

fn ninety() -> f64 {
    90.0
}
