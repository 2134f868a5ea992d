//! How fluid and solids act on each other.

pub use crate::lbm::saturation::{SolidOperator, Weighting};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The action of fluid and solids on each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coupling {
    /// Moving bounce-back with momentum exchange.
    BounceBack(BounceBack),
    /// Partially saturated cells.
    PartiallySaturated(PartiallySaturated),
}

impl Coupling {
    /// Radius of grains that the fluid sees over that of contact.
    #[must_use]
    pub fn hydraulic_radius_factor(&self) -> f64 {
        match self {
            Self::BounceBack(written) => written.hydraulic_radius_factor,
            Self::PartiallySaturated(_) => 1.0,
        }
    }
}

/// Moving bounce-back: a link from fluid to solid returns its population with the velocity of the surface, and
/// the momentum that it gives up is the force on the solid (A. J. C. Ladd, J. Fluid Mech. 271 (1994) 285).
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
    /// (narrow gaps); 0 never does. Without it 5 of the eight in 2-D and never in 3-D, where a flat surface alone has
    /// 5 of 18, or 9 of 26.
    #[schemars(range(min = 0, max = 26))]
    pub drop_wall_velocity_at_solid_neighbours: Option<u32>,
}

impl BounceBack {
    /// Solid neighbours from which a node drops the velocity of the surface; none where no node does.
    #[must_use]
    pub fn isolated(&self, dimension: usize) -> Option<u32> {
        let usual = if dimension == 2 { 5 } else { 0 };
        let limit = self.drop_wall_velocity_at_solid_neighbours;
        Some(limit.unwrap_or(usual)).filter(|&limit| limit > 0)
    }
}

impl Default for BounceBack {
    fn default() -> Self {
        Self {
            scheme: Scheme::HalfWay,
            force_average: true,
            hydraulic_radius_factor: 1.0,
            drop_wall_velocity_at_solid_neighbours: None,
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
    /// Where the surface crosses it: second order on smooth surfaces; about 1.5 at the edges of polyhedra.
    Interpolated,
}

/// Partially saturated cells: a cell that solids fill in part collides as water and as solid, by the part that is filled. For
/// bodies of any shape; forces change smoothly as bodies move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PartiallySaturated {
    /// What a solid does to the populations of a cell. Without it: matched to the viscosity in slow flow (BGK or TRT, a relaxation
    /// time of at least 0.52, no turbulence model), else bounce-back of the non-equilibrium part, which holds at high Reynolds numbers.
    pub solid_operator: Option<SolidOperator>,
    /// How much a filled part counts.
    pub weighting: Weighting,
    /// How the filled part of a cell is found.
    pub solid_fraction: SolidFraction,
    /// Whether the water that moves with a body inside it is left out of the body's inertia. Without it a body is heavier by the
    /// water that it displaces.
    pub exclude_inner_fluid: bool,
}

impl Default for PartiallySaturated {
    fn default() -> Self {
        Self {
            solid_operator: None,
            weighting: Weighting::default(),
            solid_fraction: SolidFraction::default(),
            exclude_inner_fluid: true,
        }
    }
}

/// How the filled part of a cell is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum SolidFraction {
    /// Closed forms, to rounding.
    #[default]
    Exact,
    /// This many points along each edge of a cell.
    Samples(#[schemars(range(min = 1, max = 32))] u32),
    /// From the distance of its centre from the surface: the cheapest, about 0.02 off in the cells at the surface of a sphere.
    Linear,
}
