//! Coupling of fluid and solids.

pub use lbm::saturation::{SolidOperator, Weighting};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Method that couples fluid and solids.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coupling {
    /// Moving bounce-back with momentum exchange.
    BounceBack(BounceBack),
    /// Partially saturated cells.
    PartiallySaturated(PartiallySaturated),
}

impl Coupling {
    /// Returns the ratio of the hydraulic radius of grains to their contact radius.
    #[must_use]
    pub fn hydraulic_radius_factor(&self) -> f64 {
        match self {
            Self::BounceBack(written) => written.hydraulic_radius_factor,
            Self::PartiallySaturated(_) => 1.0,
        }
    }
}

/// Moving bounce-back (Ladd 1994): a link from fluid to solid returns its population with the velocity of the surface,
/// and the momentum exchanged on the link is the force on the solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BounceBack {
    /// Position of the surface on a link.
    pub scheme: Scheme,
    /// `true` if forces are averaged over the last two time steps, which removes an oscillation of period 2 dt.
    pub force_average: bool,
    /// Hydraulic radius of a grain over its contact radius [1]. A value below 1 makes a dense 2-D packing
    /// permeable.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub hydraulic_radius_factor: f64,
    /// Surfaces around a fluid node with at least this many solid neighbours, two more if walls or structures are among
    /// them, reflect with the mean velocity of the bodies around it, or that of the wall or structure: such a node,
    /// in a narrow gap, gains no mass from bodies that approach each other. 0 turns this off. Default: 6 of the 8
    /// neighbours in 2-D; off in 3-D, where a flat surface alone accounts for 5 of 18 or 9 of 26, and where
    /// `drop_wall_velocity_at_solid_neighbours` is given.
    #[schemars(range(min = 0, max = 26))]
    pub mean_wall_velocity_at_solid_neighbours: Option<u32>,
    /// The rule of Sibille, Lomine and Marot (2012) instead: such surfaces count as stationary. Bodies that move
    /// together then pump the fluid between them, so that results depend on the frame of reference. 0 turns both
    /// rules off. Default: not used.
    #[schemars(range(min = 0, max = 26))]
    pub drop_wall_velocity_at_solid_neighbours: Option<u32>,
}

/// Velocity with which surfaces reflect in narrow gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GapVelocity {
    /// Mean velocity of the bodies around the node.
    Mean,
    /// Zero.
    Zero,
}

impl BounceBack {
    /// Returns the minimum number of solid neighbours of a node in a narrow gap, and the velocity of the surfaces
    /// there; none if surfaces always reflect with their own velocity.
    #[must_use]
    pub fn narrow_gaps(&self, dimension: usize) -> Option<(u32, GapVelocity)> {
        let usual = if dimension == 2 { 6 } else { 0 };
        let mean = self.mean_wall_velocity_at_solid_neighbours;
        let (limit, velocity) = match self.drop_wall_velocity_at_solid_neighbours {
            Some(limit) if mean.unwrap_or(0) == 0 => (limit, GapVelocity::Zero),
            _ => (mean.unwrap_or(usual), GapVelocity::Mean),
        };
        (limit > 0).then_some((limit, velocity))
    }
}

impl Default for BounceBack {
    fn default() -> Self {
        Self {
            scheme: Scheme::HalfWay,
            force_average: true,
            hydraulic_radius_factor: 1.0,
            mean_wall_velocity_at_solid_neighbours: None,
            drop_wall_velocity_at_solid_neighbours: None,
        }
    }
}

/// Position of the surface on a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Scheme {
    /// Half-way: robust, first order at curved surfaces.
    #[default]
    HalfWay,
    /// At the exact intersection: second order at smooth surfaces, order 1.5 at edges of polyhedra.
    Interpolated,
}

/// Partially saturated cells (Noble and Torczynski 1998): the collision in a cell is weighted between fluid and solid
/// by its solid fraction. Works for bodies of any shape; forces change smoothly as bodies move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PartiallySaturated {
    /// Solid collision operator. Default: `viscosity_matched` in slow flow (BGK or TRT, relaxation time of at least
    /// 0.52, no turbulence model, no free surface), else `non_equilibrium_bounce_back`, which stays stable at high
    /// Reynolds numbers.
    pub solid_operator: Option<SolidOperator>,
    /// Weighting of the solid fraction. Default: `viscous`; `fraction` where gravity acts on the fluid between walls
    /// without a free surface, because the hydrostatic pressure then carries bodies: cells covered in part by less than
    /// their fraction would reduce the buoyancy.
    pub weighting: Option<Weighting>,
    /// Method that computes the solid fraction of a cell.
    pub solid_fraction: SolidFraction,
    /// `true` if the inertia of the fluid inside a body is subtracted from the motion of the body. If not, the
    /// displaced fluid adds to the mass of the body.
    pub exclude_inner_fluid: bool,
}

impl Default for PartiallySaturated {
    fn default() -> Self {
        Self {
            solid_operator: None,
            weighting: None,
            solid_fraction: SolidFraction::default(),
            exclude_inner_fluid: true,
        }
    }
}

/// Method that computes the solid fraction of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum SolidFraction {
    /// Closed forms, exact to rounding.
    #[default]
    Exact,
    /// Sampling with this many points along each edge of a cell.
    Samples(#[schemars(range(min = 1, max = 32))] u32),
    /// From the distance between cell centre and surface: cheapest, with errors of about 0.02 in cells at the surface
    /// of a sphere.
    Linear,
}
