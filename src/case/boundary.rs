//! Conditions of the fluid on the faces of the domain.

use super::geometry::{Extent, Face, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A condition on a face or on a part of it. Parts outweigh the condition of their whole face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// Name in tables and outputs.
    pub name: String,
    /// The face.
    pub face: Face,
    /// The part of the face that lies in this box (its extent normal to the face does not matter) [m]; without it
    /// the whole face.
    #[serde(default)]
    pub patch: Option<Extent>,
    /// What holds there.
    pub condition: Condition,
}

/// What the fluid does at a face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Condition {
    /// A wall at rest: half-way bounce-back.
    NoSlip {},
    /// A wall that slides in its own plane.
    MovingWall {
        /// Velocity of the wall, tangential to the face [m/s].
        velocity: Vector,
    },
    /// A plane of symmetry: no flow through it, no friction. A body that it cuts takes partially saturated cells: links along the
    /// plane do not see the body's mirror image.
    FreeSlip {},
    /// Velocity imposed.
    Velocity {
        /// The profile over the face or patch.
        profile: VelocityProfile,
        /// Grows linearly from zero over this time [s]; counted from the first fluid step, warm-up included.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0))]
        ramp_time: Option<f64>,
        /// Turbulence that enters with the flow; the profile is then the mean.
        #[serde(default)]
        turbulence: Option<Fluctuations>,
    },
    /// Pressure imposed, tangential velocity zero.
    Pressure {
        /// Pressure above the reference [Pa].
        value: f64,
        /// Changes linearly to `value`; without it the pressure is there at once (the water hammer).
        #[serde(default)]
        ramp: Option<Ramp>,
    },
    /// The flow leaves freely: no gradient along the normal.
    Outflow {},
    /// What leaves is carried out with the flow: df/dt + U df/dn = 0. Vortices leave with little reflection.
    ConvectiveOutflow {
        /// U [m/s]; without it the velocity of the fluid at the face, cell by cell.
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
        /// Velocity in the middle [m/s]; positive flows into the domain.
        peak: f64,
    },
    /// From a table.
    File {
        /// CSV with a header: the tangential coordinate(s) [m], then the velocity components [m/s]; linear between
        /// rows. Relative to the case.
        path: PathBuf,
    },
}

/// Synthetic turbulence: isotropic fluctuations made of random Fourier modes (Kraichnan 1970), without divergence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluctuations {
    /// Root mean square of each component over the mean speed at the same place, without unit.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub intensity: f64,
    /// Longitudinal integral length: the integral of the correlation exp(-pi r²/(4 L²)) [m].
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
    /// Time of the change [s], from the first fluid step, warm-up included.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub duration: f64,
    /// Pressure at the start [Pa].
    #[serde(default)]
    pub from: f64,
}
