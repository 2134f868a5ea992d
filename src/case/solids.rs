//! Solids other than grains: walls and bodies.

pub use super::geometry::Mesh;
use super::geometry::{Extent, Rotation, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A wall for grains and blocks. It does not act on the fluid; use `structures` for solids that do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Name in tables.
    pub name: String,
    /// Shape and position.
    pub shape: WallShape,
    /// Material of the wall.
    pub material: String,
    /// Velocity [m/s]. The tangential component drags grains along, the normal component moves the wall. Default: zero.
    #[serde(default)]
    pub velocity: Option<Vector>,
    /// Table of times of the run [s] and factors of the velocity [1]: linear between the rows, constant before and
    /// after; two factors at one time are a jump. Default: constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub history: Option<Vec<[f64; 2]>>,
    /// Control of a plane by the mean stress of its contacts. Default: none, the wall moves with its velocity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub servo: Option<Servo>,
    /// Period in which the wall exists. A wall of the preparation supports the grains while they settle and are bonded,
    /// and is removed when the run begins.
    #[serde(default)]
    pub during: WallStage,
    /// Time of the run from which the wall exists [s]. If it cuts into a body at this time, the run ends. Default: the
    /// wall exists from the start.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub from: Option<f64>,
    /// Time of the run until which the wall exists [s], such as the time at which a gate opens or a sheet is pulled.
    /// Default: until the end.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub until: Option<f64>,
}

/// Control of a plane wall during the run: it moves along its normal so that the mean normal stress of the grains on it
/// follows a value or a table. The area is the part of the plane inside the domain and between the other plane walls at
/// their current positions. `velocity` may have a component along the plane, which is kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Servo {
    /// Mean normal stress [Pa], 0 or more; compression is positive.
    #[schemars(range(min = 0.0))]
    pub stress: f64,
    /// Table of times [s] and stresses [Pa] that replace the stress: linear between the rows, constant before and
    /// after; two stresses at one time are a jump. Default: constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub history: Option<Vec<[f64; 2]>>,
    /// Largest velocity along the normal [m/s]. Grains that cannot carry the stress are deformed at this velocity.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub velocity_limit: f64,
    /// Fraction of the missing force that the servo adds in a solid step [1]: the velocity is that of the grains in
    /// contact plus gain (stress area - force)/(stiffness of the present contacts x solid step).
    #[serde(default = "default_gain")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub gain: f64,
}

fn default_gain() -> f64 {
    0.5
}

/// Period in which a wall exists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WallStage {
    /// During the preparation and the run.
    #[default]
    Always,
    /// Only during the preparation, such as a gate or a plug in an opening. It acts on grains that are deposited, or
    /// that come to rest after they are bonded.
    Preparation,
}

/// Shape of a wall. All shapes but the plane act on both sides and are 3-D only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WallShape {
    /// An infinite plane.
    Plane(Plane),
    /// A planar convex polygon: its corners in order [m].
    Polygon(Vec<Vector>),
    /// The faces of a box [m].
    Box(Extent),
    /// A triangulated surface.
    Mesh(Mesh),
}

/// A plane. Grains are on the side of the normal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point of the plane [m].
    pub point: Vector,
    /// Normal vector towards the grains, of any length [1].
    pub normal: Vector,
}

/// A named solid in the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name that probes use for force and torque.
    pub name: String,
    /// Shape of the body.
    pub shape: Shape,
    /// Centre [m]; the centroid for polyhedra.
    pub position: Vector,
    /// Rotation of a polyhedron. Default: none.
    #[serde(default)]
    pub orientation: Option<Orientation>,
    /// Motion of the body.
    pub motion: Motion,
    /// Material of the body. A free body needs a density.
    pub material: String,
}

/// A rotation about an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orientation {
    /// Rotation axis, of any length [1].
    pub axis: [f64; 3],
    /// Rotation angle [degrees], counter-clockwise when seen against the axis.
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
    /// A box with edges along the axes before the rotation.
    Cuboid {
        /// Lengths of the edges [m].
        edges: [f64; 3],
    },
    /// The convex hull of these points [m].
    Vertices(Vec<[f64; 3]>),
    /// The intersection of half-spaces, each `[a, b, c, d]` for a x + b y + c z <= d [m].
    HalfSpaces(Vec<[f64; 4]>),
    /// A closed convex triangulated surface.
    Mesh(Mesh),
}

impl Shape {
    /// Returns `true` if the shape is a disc or a sphere.
    #[must_use]
    pub fn round(&self) -> bool {
        matches!(self, Self::Disc { .. } | Self::Sphere { .. })
    }
}

/// Motion of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Motion {
    /// No motion.
    Fixed {},
    /// Prescribed velocity, independent of the forces: a piston, a gate, the front of a slide.
    Driven {
        /// Velocity of the centre [m/s]. Default: zero.
        #[serde(default)]
        velocity: Option<Vector>,
        /// Angular velocity [rad/s]. Default: zero.
        #[serde(default)]
        angular_velocity: Option<Rotation>,
        /// Table of times of the run [s] and factors of both velocities [1]: linear between the rows, constant before
        /// and after; two factors at one time are a jump. With a velocity of [1, 0] the factors are the velocity along
        /// x [m/s]. Default: constant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        history: Option<Vec<[f64; 2]>>,
    },
    /// Free motion under the acting forces.
    Free {
        /// Initial velocity [m/s]. Default: zero.
        #[serde(default)]
        velocity: Option<Vector>,
        /// Initial angular velocity [rad/s]. Default: zero.
        #[serde(default)]
        angular_velocity: Option<Rotation>,
    },
}
