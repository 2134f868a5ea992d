//! What is removed, generated, recorded, probed, written and analysed.

use super::collapse::GroundCollapse;
use super::fluid::Precision;
use super::geometry::{Axis, Extent, Face, Vector};
use super::grains::Radii;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A box in which something happens to grains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Name in tables and files.
    pub name: String,
    /// The box [m].
    #[serde(rename = "box")]
    pub region: Extent,
    /// What happens there.
    pub action: Action,
}

/// What happens in a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// Grains are taken out; time, id and mass are logged.
    Remove {
        /// When a grain goes.
        #[serde(default)]
        when: When,
    },
    /// Grains appear at random places that are free.
    Generate {
        /// Grains per second [1/s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        rate: f64,
        /// Their radii [m].
        radii: Radii,
        /// Their velocity [m/s]; at rest without it.
        #[serde(default)]
        velocity: Option<Vector>,
        /// Seed of the random numbers.
        #[serde(default)]
        seed: u64,
        /// Their material, if it is not that of the other grains.
        #[serde(default)]
        material: Option<String>,
        /// At most this many; without it no end.
        #[serde(default)]
        at_most: Option<u32>,
    },
    /// Entries and exits of grains are logged.
    Record {},
}

/// When a grain is in a region of removal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum When {
    /// When its surface touches the region.
    #[default]
    Touches,
    /// When its centre is in the region.
    Centre,
}

/// A quantity sampled in time and written as CSV.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Name of the file.
    pub name: String,
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// Where.
    pub at: ProbeAt,
}

/// Where a probe samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ProbeAt {
    /// Velocity and pressure at a point.
    Point {
        /// The point [m].
        position: Vector,
    },
    /// Velocity and pressure along a line.
    Line {
        /// First point [m].
        from: Vector,
        /// Last point [m].
        to: Vector,
        /// Number of points, both ends included.
        #[schemars(range(min = 2, max = 1_000_000))]
        points: u32,
    },
    /// Discharge, mean pressure and largest velocity in a plane normal to an axis.
    Plane {
        /// The axis.
        axis: Axis,
        /// Coordinate of the plane [m].
        position: f64,
    },
    /// Force [N] and torque [N m] of the fluid on a body (2-D: per metre of depth).
    Body {
        /// Its name.
        name: String,
    },
    /// Force of the fluid on a face of the domain [N], and its mean traction [Pa].
    Wall {
        /// The face.
        face: Face,
    },
}

/// What is written, and how often; nothing that is not named here.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Output {
    /// Fields of the fluid.
    pub fluid: Option<FluidOutput>,
    /// Positions, velocities, forces of the grains; of blocks with the radius of the sphere round them.
    pub grains: Option<GrainOutput>,
    /// Contacts with their forces and bonds.
    pub contacts: Option<Every>,
    /// Surfaces of the blocks, with where each came from and how it moves.
    pub blocks: Option<Every>,
    /// Averages over time of velocity, pressure and Reynolds stresses of a fluid on a lattice.
    pub averages: Option<AveragesOutput>,
}

/// Averages over time: sums of velocity, its products and pressure in every cell, which go on through a restart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AveragesOutput {
    /// Time of the first sample [s].
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub from: f64,
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, counted from the first sample.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sample_every: f64,
    /// Time between outputs of what has been summed so far [s], written at the steps nearest to its multiples and at the end of the
    /// run; without it at the end of the run only.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    /// Means over the planes across this axis, too, as a table: the profile between walls.
    #[serde(default)]
    pub profile: Option<Axis>,
}

/// Fields of the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FluidOutput {
    /// Time between outputs [s]. They are written at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// Which fields.
    #[serde(default = "default_fields")]
    pub fields: Vec<FieldName>,
    /// Number type in the file.
    #[serde(default = "single")]
    pub precision: Precision,
}

fn default_fields() -> Vec<FieldName> {
    vec![FieldName::Velocity, FieldName::Pressure]
}

fn single() -> Precision {
    Precision::F32
}

/// A field of the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum FieldName {
    /// Velocity [m/s].
    Velocity,
    /// Pressure above the reference [Pa].
    Pressure,
    /// Density [kg/m3].
    Density,
    /// Vorticity [1/s].
    Vorticity,
    /// Viscosity of the eddies smaller than a cell [m2/s]; 0 without turbulence.
    EddyViscosity,
    /// 1 in cells covered by a solid, 0 in the fluid.
    Solid,
}

impl FieldName {
    /// Numbers per cell.
    #[must_use]
    pub fn components(self, dimension: usize) -> usize {
        match self {
            Self::Velocity => 3,
            Self::Vorticity if dimension == 3 => 3,
            _ => 1,
        }
    }
}

/// Positions, velocities, forces of the grains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrainOutput {
    /// Time between outputs [s]. They are written at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// How far each grain is from where it was at time 0, too [m]; every grain then carries along where it started.
    #[serde(default)]
    pub displacement: bool,
}

/// An interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Every {
    /// Time between outputs [s]. They are written at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
}

/// Numbers a user came for, computed during the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Analysis {
    /// Eroded mass, shear stress on the hole and erosion rate (A-28 … A-31).
    pub erosion_law: Option<ErosionLaw>,
    /// Ground that collapses over seepage points: voids, settlement, stages, loose clusters (C-20 … C-26).
    pub ground_collapse: Option<GroundCollapse>,
}

/// Eroded mass M_e(t), hydraulic shear stress on the hole three ways, and the erosion rate per pipe area.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErosionLaw {
    /// The hole before any erosion [m].
    pub hole: Extent,
    /// Axis of the flow through the hole.
    #[serde(default = "along_x")]
    pub flow_axis: Axis,
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// The region whose removals count as eroded; without it all regions that remove.
    #[serde(default)]
    pub outlet: Option<String>,
    /// The run is done when this part of the mass of the grains has left, even before `time.end`: what is left is a bare
    /// channel, whose flow only grows faster. Without it the run goes on.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub end_at_eroded_fraction: Option<f64>,
}

fn along_x() -> Axis {
    Axis::X
}
