//! The free surface of the water.

use super::geometry::Axis;
use super::structures::Shape;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A free surface: cells are water, air, or partly water. The flow of air is not computed. Air has the reference
/// pressure; enclosed air is not compressed but disappears, and the lost volume is reported. Walls, faces of free slip
/// and structures bound the water; it enters and leaves through faces with `velocity`, `discharge`, `level` and
/// `outfall`. Bodies in the water need partially saturated cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeSurface {
    /// Parts of the water at the start. Where parts overlap, the larger fill level applies.
    pub water: Vec<Water>,
    /// Surface tension [N/m]; water at 20 °C: 0.0728. Default: none, for waves and drops well above 2 cm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub surface_tension: Option<f64>,
    /// Contact angle at no-slip walls on whole faces of the domain, measured in the water [degrees]. Clean glass: near
    /// 20; concrete: 30 to 60; wax: 110. Default: 90.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 15.0, max = 165.0))]
    pub contact_angle_degrees: Option<f64>,
}

/// A part of the water at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Water {
    /// Water below this height [m] along the axis of gravity, measured from the lower corner of the domain.
    Level(f64),
    /// Water inside a solid shape, such as a reservoir behind a gate or a drop.
    Shape(Shape),
    /// Water below a wave.
    Wave(Wave),
    /// Water below a solitary wave. The velocity of the wave is added to that of `initial`.
    SolitaryWave(SolitaryWave),
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
    #[serde(default = "crate::one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub waves: f64,
}

/// A solitary wave on water of uniform depth, by third-order theory (Grimshaw 1971, Fenton 1972): it travels at a speed
/// of about (g (depth + height))^½ and keeps its shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SolitaryWave {
    /// Height of the water at rest [m] along the axis of gravity.
    pub level: f64,
    /// Height of the crest above the water at rest [m], at most 0.78 of the depth.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub height: f64,
    /// Axis along which the wave travels.
    pub axis: Axis,
    /// Coordinate of the crest at the start [m].
    pub crest: f64,
    /// Depth of the water at rest below the wave [m]. Default: down to the lowest face of the domain.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub depth: Option<f64>,
    /// `true` for a wave that travels towards smaller coordinates.
    #[serde(default)]
    pub backward: bool,
}
