//! Kinds of boundaries, for the water and for adjacent boundaries.

/// Surface of a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceKind {
    /// Stationary wall.
    Wall,
    /// Wall that moves in its own plane.
    MovingWall,
    /// Frictionless impermeable surface, which mirrors the populations.
    Symmetry,
    /// Opening: water passes through it, or is driven through it.
    Opening,
}

/// Applicability of a boundary to water with a free surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WithSurface {
    /// Only for water without a free surface.
    Never,
    /// For water with and without a free surface.
    Also,
    /// Only for water with a free surface.
    Only,
}

/// Inflow into the domain through a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inflow {
    /// No inflow.
    None,
    /// Mean velocity over the cells of the boundary [m/s]; negative if it is directed out of the domain.
    Mean(f64),
    /// Inflow that depends on the flow, or is not known before the run.
    Any,
}

/// Precedence of boundaries for the links of edges and corners: the boundary with the largest value takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strength {
    /// Symmetry plane.
    Symmetry,
    /// Outflow with the state of the fluid.
    Outflow,
    /// Imposed pressure.
    Pressure,
    /// Imposed velocity.
    Velocity,
    /// Stationary wall, which takes precedence over all others and closes its corners.
    Wall,
}

/// Kind of a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundaryKind {
    /// Surface of the boundary.
    pub surface: SurfaceKind,
    /// Precedence of the boundary for the links of an edge.
    pub strength: Strength,
}

impl BoundaryKind {
    /// Kind of a stationary wall.
    pub const WALL: Self = Self {
        surface: SurfaceKind::Wall,
        strength: Strength::Wall,
    };

    /// Kind of an opening through which the fluid leaves with its own state.
    pub const OUTFLOW: Self = Self {
        surface: SurfaceKind::Opening,
        strength: Strength::Outflow,
    };

    /// Returns the precedence for the links of an edge: the strength; of two imposed velocities a moving wall precedes
    /// an opening.
    #[must_use]
    pub fn precedence(self) -> (Strength, bool) {
        (self.strength, self.surface == SurfaceKind::MovingWall)
    }
}
