//! How fluid and solids act on each other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The action of fluid and solids on each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coupling {
    /// Moving bounce-back with momentum exchange (A-10 … A-16).
    BounceBack(BounceBack),
}

/// Moving bounce-back: a link from fluid to solid returns its population with the velocity of the surface, and
/// the momentum it gives up is the force on the solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BounceBack {
    /// Where on a link the surface lies.
    pub scheme: Scheme,
    /// Whether the force is the mean of the last two half-steps; it removes an oscillation of period 2 dt.
    pub force_average: bool,
    /// Radius the fluid sees over the radius of contact, for grains only: below 1 a dense 2-D packing is
    /// permeable.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub hydraulic_radius_factor: f64,
    /// A fluid node with at least this many solid neighbours returns its populations as if the surface were at rest
    /// (A-15, narrow gaps); 0 never does.
    #[schemars(range(min = 0, max = 26))]
    pub drop_wall_velocity_at_solid_neighbours: u32,
}

impl Default for BounceBack {
    fn default() -> Self {
        Self {
            scheme: Scheme::HalfWay,
            force_average: true,
            hydraulic_radius_factor: 1.0,
            drop_wall_velocity_at_solid_neighbours: 5,
        }
    }
}

/// Where on a link the surface lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Scheme {
    /// In its middle: robust, first order for curved surfaces.
    #[default]
    HalfWay,
    /// Where the surface crosses it: second order.
    Interpolated,
}
