//! Kinds of boundaries, for the water and for adjacent boundaries.

/// Surface of a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceKind {
    /// A wall at rest.
    Wall,
    /// A wall that moves in its own plane.
    MovingWall,
    /// A surface without friction that nothing passes; what reaches it comes back as from a mirror.
    Symmetry,
    /// An opening: water passes through it, or is driven through it.
    Opening,
}

/// Use of a boundary at water with a free surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WithSurface {
    /// It does not work there.
    Never,
    /// It works with a free surface and without one.
    Also,
    /// It works there alone.
    Only,
}

/// Inflow into the domain through a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inflow {
    /// Nothing.
    None,
    /// Mean velocity over its cells [m/s]; negative out of the domain.
    Mean(f64),
    /// Inflow that the flow determines, or that is not known before the run.
    Any,
}

/// The order in which boundaries take the links of edges and corners: the largest has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strength {
    /// Planes of symmetry.
    Symmetry,
    /// The fluid leaves with the state that it has.
    Outflow,
    /// The pressure is imposed.
    Pressure,
    /// The velocity is imposed.
    Velocity,
    /// Walls at rest, which therefore always close their corners.
    Wall,
}

/// Kind of a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundaryKind {
    /// Surface of the boundary.
    pub surface: SurfaceKind,
    /// Strength: decides which of two boundaries has the links of an edge.
    pub strength: Strength,
}

impl BoundaryKind {
    /// A wall at rest.
    pub const WALL: Self = Self {
        surface: SurfaceKind::Wall,
        strength: Strength::Wall,
    };

    /// An opening through which the fluid leaves with the state that it has.
    pub const OUTFLOW: Self = Self {
        surface: SurfaceKind::Opening,
        strength: Strength::Outflow,
    };
}
