//! Solids other than grains: walls and bodies.

use super::geometry::{Extent, Rotation, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A wall that grains touch; the fluid does not see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Name in tables.
    pub name: String,
    /// What it looks like, and where it is.
    pub shape: WallShape,
    /// Its material.
    pub material: String,
    /// Velocity [m/s]: along the wall it drags, across it the wall moves; at rest without it.
    #[serde(default)]
    pub velocity: Option<Vector>,
    /// When it stands: a wall of the preparation holds the grains while they settle and are bonded, and is gone as the run begins.
    #[serde(default)]
    pub during: WallStage,
}

/// When a wall stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallStage {
    /// In the preparation and in the run.
    #[default]
    Always,
    /// In the preparation only: a gate, a plug in an opening.
    Preparation,
}

/// The shape of a wall. All but the plane are touched from both sides, and are for 3-D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WallShape {
    /// A plane without end.
    Plane(Plane),
    /// A plane convex polygon: its corners in order [m].
    Polygon(Vec<Vector>),
    /// The faces of a box [m].
    Box(Extent),
    /// A surface of triangles.
    Mesh(Mesh),
}

/// A triangulated surface from a file. Triangles whose corners fall together are neighbours, without bumps between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// STL file, as text or binary; relative to the case.
    pub path: PathBuf,
    /// Metres in a unit of the file: 0.001 where it is in mm.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Where the origin of the file lies [m]; at that of the domain without it.
    #[serde(default)]
    pub origin: Option<Vector>,
}

fn one() -> f64 {
    1.0
}

/// A plane: grains are on the side to which the normal points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point of the plane [m].
    pub point: Vector,
    /// Normal towards the grains; of any length.
    pub normal: Vector,
}

/// A named solid in the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name by which probes ask for its force and torque.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// Centre [m]; of a polyhedron its centroid.
    pub position: Vector,
    /// How a polyhedron is turned; as it is without it.
    #[serde(default)]
    pub orientation: Option<Orientation>,
    /// How it moves.
    pub motion: Motion,
    /// Its material; the density is needed if it moves freely.
    pub material: String,
}

/// A turn about an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orientation {
    /// The axis; of any length.
    pub axis: [f64; 3],
    /// The angle, counter-clockwise where the axis points at the viewer [degrees].
    pub angle_degrees: f64,
}

/// Shape of a body: a disc, a sphere, or a convex polyhedron (3-D).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// A disc (2-D).
    Disc {
        /// Radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
    },
    /// A sphere (3-D).
    Sphere {
        /// Radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius: f64,
    },
    /// A box, its edges along the axes before it is turned.
    Cuboid {
        /// Lengths of the edges [m].
        edges: [f64; 3],
    },
    /// The convex hull of these points [m].
    Vertices(Vec<[f64; 3]>),
    /// What lies in all of these half-spaces, each `[a, b, c, d]` for a x + b y + c z <= d [m].
    HalfSpaces(Vec<[f64; 4]>),
    /// A closed convex surface of triangles.
    Mesh(Mesh),
}

impl Shape {
    /// Whether it is a disc or a sphere.
    #[must_use]
    pub fn round(&self) -> bool {
        matches!(self, Self::Disc { .. } | Self::Sphere { .. })
    }
}

/// How a body moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Motion {
    /// Not at all.
    Fixed {},
    /// With a given velocity, whatever acts on it.
    Driven {
        /// Velocity of the centre [m/s]; zero without it.
        #[serde(default)]
        velocity: Option<Vector>,
        /// Rotation rate [rad/s]; zero without it.
        #[serde(default)]
        angular_velocity: Option<Rotation>,
    },
    /// By the forces on it.
    Free {
        /// Velocity at the start [m/s]; zero without it.
        #[serde(default)]
        velocity: Option<Vector>,
        /// Rotation rate at the start [rad/s]; zero without it.
        #[serde(default)]
        angular_velocity: Option<Rotation>,
    },
}
