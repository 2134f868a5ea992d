//! Ground that collapses over a hidden hole: what is measured, where, and when a stage has begun (C-20 … C-26).

use super::geometry::{Axis, Extent};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Eroded grains, voids over the seepage points, settlement of the surface and its extension in time, the stages of the
/// collapse, and the clusters in which grains come loose: 3-D, with gravity along one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroundCollapse {
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// The seepage points; without them every region that removes grains is one.
    #[serde(default)]
    pub points: Vec<SeepagePoint>,
    /// Horizontal axis along which the ground is long; without it the one along which the domain is longer.
    #[serde(default)]
    pub long_axis: Option<Axis>,
    /// Edge of the cells in which voids, displacements and the surface are measured [m]; without it two mean diameters at
    /// time 0: smaller cells would take pores for voids.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cell_size: Option<f64>,
    /// A cell of the ground is void when less than this part of the solid that it held at time 0 is left.
    #[serde(default = "half")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub void_below: f64,
    /// A grain has come loose when it is this many mean diameters from where it was at time 0.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub loose_diameters: f64,
    /// Which percentile of the settlement of all columns is written.
    #[serde(default = "ninety")]
    #[schemars(range(min = 0.0, max = 100.0))]
    pub settlement_percentile: f64,
    /// When a stage of the collapse has begun.
    #[serde(default)]
    pub stages: StageThresholds,
}

/// A place through which grains leave the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeepagePoint {
    /// Name of a region that removes grains: those it takes have left through this point. Or any name, with a box: those
    /// taken within the box have.
    pub name: String,
    /// The opening, above which voids are looked for [m]; without it the box of the region of this name.
    #[serde(default, rename = "box")]
    pub region: Option<Extent>,
}

/// When a stage of the collapse has begun; lengths are in mean diameters at time 0, since a grain is the least that can
/// move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StageThresholds {
    /// A stage begins with the first of this many samples in a row that show it: one sample may be chance.
    #[schemars(range(min = 1, max = 1000))]
    pub samples: u32,
    /// t1, hidden hole: this many grains have left through one point; more than the few that lay in the opening.
    #[schemars(range(min = 1))]
    pub hole_grains: u32,
    /// t1 also begins with a void of this volume over one point [m3]; without it that of one cell.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub hole_volume: Option<f64>,
    /// A cell moves when its grains have gone down by this many mean diameters on average: more than they settle under
    /// water and load, less than one place in the packing.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub moving_diameters: f64,
    /// t2, arch: the ground over one point moves up to this part of its cover.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub arch_reach: f64,
    /// t3, sinkhole: a column of the surface has settled by this many mean diameters, its elevation and the grains that were
    /// its surface at time 0. A column belongs to the depression from this settlement on.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sinkhole_diameters: f64,
    /// t4, extension: the longest depression is this many times as long as the sinkhole was long or wide at t3.
    #[schemars(extend("exclusiveMinimum" = 1))]
    pub extension_ratio: f64,
    /// t4 also needs that the soil beside the points has moved towards them by this many mean diameters on average.
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
            sinkhole_diameters: 1.0,
            extension_ratio: 1.5,
            inward_diameters: 0.1,
        }
    }
}

fn half() -> f64 {
    0.5
}

fn one() -> f64 {
    1.0
}

fn ninety() -> f64 {
    90.0
}
