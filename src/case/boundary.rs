//! Conditions of the fluid on the faces of the domain.

use super::geometry::{Extent, Face, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A condition on a face or on a part of it. A condition on a part takes precedence over the condition of the whole face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// Name in tables and outputs.
    pub name: String,
    /// The face.
    pub face: Face,
    /// Box that selects a part of the face [m]; its extent normal to the face has no effect. Default: the whole face.
    #[serde(default)]
    pub patch: Option<Extent>,
    /// The condition.
    pub condition: Condition,
}

/// What the fluid does at a face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Condition {
    /// A wall at rest: half-way bounce-back.
    NoSlip {},
    /// A wall that moves in its own plane.
    MovingWall {
        /// Velocity of the wall, tangential to the face [m/s].
        velocity: Vector,
    },
    /// A symmetry plane: no flow through it and no friction. Bodies that intersect the plane need partially saturated cells, because
    /// bounce-back links along the plane do not see the mirror image of the body.
    FreeSlip {},
    /// Imposed velocity.
    Velocity {
        /// The profile over the face or patch.
        profile: VelocityProfile,
        /// Time over which the velocity grows linearly from zero [s], counted from the first fluid step, warm-up included.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0))]
        ramp_time: Option<f64>,
        /// Turbulent fluctuations of the inflow. The profile is then the mean velocity.
        #[serde(default)]
        turbulence: Option<Fluctuations>,
    },
    /// Imposed pressure, with zero tangential velocity (Zou and He 1997).
    Pressure {
        /// Pressure above the reference [Pa].
        value: f64,
        /// Linear change to `value`. Without it the pressure acts at once and causes a pressure wave.
        #[serde(default)]
        ramp: Option<Ramp>,
    },
    /// Free outflow: zero gradient along the normal.
    Outflow {},
    /// Convective outflow: df/dt + U df/dn = 0. Vortices leave with little reflection.
    ConvectiveOutflow {
        /// Convection velocity U [m/s]. Default: the local velocity of the fluid at the face.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0))]
        velocity: Option<f64>,
    },
}

/// A velocity over a face or patch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum VelocityProfile {
    /// The same everywhere [m/s].
    Uniform(Vector),
    /// A parabola over the face or patch, along the inward normal; in 3-D the product of two parabolas.
    Parabolic {
        /// Velocity at the centre [m/s]. A positive value flows into the domain.
        peak: f64,
    },
    /// From a table.
    File {
        /// CSV file with a header, relative to the case: tangential coordinates [m], then velocity components [m/s]. Values are
        /// interpolated linearly between rows.
        path: PathBuf,
    },
}

/// Synthetic turbulence: isotropic fluctuations made of random Fourier modes (Kraichnan 1970), without divergence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluctuations {
    /// Turbulence intensity: root mean square of each component over the local mean speed [1].
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub intensity: f64,
    /// Longitudinal integral length scale L [m]; the correlation is exp(-pi r²/(4 L²)).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length_scale: f64,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
}

/// A linear change in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Duration of the change [s], counted from the first fluid step, warm-up included.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub duration: f64,
    /// Initial pressure [Pa].
    #[serde(default)]
    pub from: f64,
}
