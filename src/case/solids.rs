//! Solids other than grains: walls and bodies.

use super::geometry::{Rotation, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A plane wall that grains touch; the fluid does not see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Name in tables.
    pub name: String,
    /// Where it is.
    pub plane: Plane,
    /// Its material.
    pub material: String,
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
    /// Centre [m].
    pub position: Vector,
    /// How it moves.
    pub motion: Motion,
    /// Its material; the density is needed if it moves freely.
    pub material: String,
}

/// Shape of a body.
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
}

impl Shape {
    /// Radius [m].
    #[must_use]
    pub fn radius(&self) -> f64 {
        match self {
            Self::Disc { radius } | Self::Sphere { radius } => *radius,
        }
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
