//! The free surface of the water.

use super::geometry::Axis;
use super::structures::Shape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A free surface: cells are water, air, or partly water. Air has no flow, and its pressure is the datum of
/// all pressures; enclosed air is not compressed but lost, and the loss is reported. Walls, faces of free slip and
/// structures bound the water; it enters and leaves through faces with `velocity`, `discharge`, `level` and
/// `outfall`. Bodies float, sink and move in it by partially saturated cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeSurface {
    /// Water at the start. Where parts overlap, the larger fill level counts.
    pub water: Vec<Water>,
}

/// A part of the water at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Water {
    /// Water below this height [m] along the axis of gravity, measured from the lower corner of the domain.
    Level(f64),
    /// A solid full of water, such as a reservoir behind a gate or a drop.
    Shape(Shape),
    /// Water below a wave.
    Wave(Wave),
}

/// A wave: the undisturbed surface is at `level`, the wave at level + amplitude · cos(2 pi waves s/L), with s along
/// `axis` and L the size of the domain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wave {
    /// Mean height [m] along the axis of gravity.
    pub level: f64,
    /// Amplitude [m].
    pub amplitude: f64,
    /// Axis along which the height changes.
    pub axis: Axis,
    /// Number of waves in the domain; 0.5 for half a wave between two walls.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub waves: f64,
}

fn one() -> f64 {
    1.0
}
