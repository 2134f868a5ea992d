//! Structures: stationary solids that act on water and grains.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use structure::Shape;

/// A stationary solid, such as a sheet pile, a cut-off wall, a weir, a step or a pier. Structures may overlap one
/// another, leave the domain and cross its periodic faces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Structure {
    /// Name that probes use.
    pub name: String,
    /// Shape and position.
    pub shape: Shape,
    /// Material in contacts. Default: the material of the grains, otherwise of the blocks, otherwise of the first
    /// free body.
    #[serde(default)]
    pub material: Option<String>,
    /// Materials that the structure stops.
    #[serde(default)]
    pub stops: Stops,
}

/// Materials that a structure stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Stops {
    /// Water, grains and blocks.
    #[default]
    All,
    /// Water only: grains and blocks pass through it.
    Water,
    /// Grains and blocks only, such as a screen: water passes through it.
    Grains,
}

impl Stops {
    /// Returns `true` if the structure stops water.
    #[must_use]
    pub fn water(self) -> bool {
        self != Self::Grains
    }

    /// Returns `true` if the structure stops grains and blocks.
    #[must_use]
    pub fn grains(self) -> bool {
        self != Self::Water
    }
}
