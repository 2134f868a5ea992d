//! The grains: where they come from, what is cut away, when they are bonded.

use super::geometry::{Extent, Rotation, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The grains at the start: discs in 2-D, spheres in 3-D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grains {
    /// Material of the grains; its density is needed.
    pub material: String,
    /// Where the grains come from.
    pub initial: GrainSource,
    /// CSV file to which the prepared sample is written before anything is cut, so that every run of a study can
    /// reuse it: a file name in the output folder, none of those that the run writes itself.
    #[serde(default)]
    pub save: Option<PathBuf>,
    /// Boxes emptied after the preparation: chambers, holes. A grain goes if its centre lies in the box.
    #[serde(default)]
    pub cut: Vec<Cut>,
    /// Whether the contacts that exist after preparation and cutting become bonds. No contact made later
    /// is ever bonded.
    #[serde(default)]
    pub bond_at_start: bool,
}

/// Where grains come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GrainSource {
    /// A loose random cloud whose radii grow until the sample is compacted.
    Growth(Growth),
    /// A loose random cloud that falls onto the walls and settles (C-08).
    Rain(Rain),
    /// A sample saved before.
    File {
        /// CSV with the columns of `save`; relative to the case.
        path: PathBuf,
    },
    /// One by one.
    List(Vec<Grain>),
}

/// Preparation by growing radii, without cohesion and without fluid. The faces of the box are frictional
/// walls while the grains grow, also where the domain is open. The same sample for a seed on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Growth {
    /// How many grains.
    pub amount: Amount,
    /// Radii at the end of the growth [m].
    pub radii: Radii,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
    /// The box that is filled [m]; the whole domain without it.
    #[serde(default, rename = "box")]
    pub region: Option<Extent>,
    /// Friction angle while growing [degrees]; a small one makes a dense sample. Without it that of the contact law.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// When the sample counts as at rest after the growth.
    #[serde(default)]
    pub stop: Stop,
}

/// Preparation by rain (C-06, C-08), without cohesion and without fluid: a cloud without contacts in a box, which falls, settles on
/// `walls` and `box_walls`, and is trimmed. The same sample for a seed on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rain {
    /// How many grains fall.
    #[schemars(range(min = 1))]
    pub number: u32,
    /// Their sizes.
    pub grading: Grading,
    /// The box of the cloud [m]: at most 0.3 of it is filled (2-D: 0.45).
    #[serde(rename = "box")]
    pub region: Extent,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Grains whose centre is higher than this coordinate of the axis of gravity are taken away once settled [m].
    #[serde(default)]
    pub trim_above: Option<f64>,
    /// Normal stiffness while falling [N/m], softer than that of the contact law, for larger steps; the sample then rests at ten
    /// times it and so on until that of the law.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub falling_stiffness: Option<f64>,
    /// Friction angle meanwhile [degrees]; without it that of the contact law.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Local damping while falling; at least 0.7 once landed.
    #[serde(default = "default_rain_damping")]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// When the sample counts as settled.
    #[serde(default)]
    pub stop: Settled,
}

fn default_rain_damping() -> f64 {
    0.2
}

/// When rain has settled: both hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settled {
    /// Mean kinetic energy over m g d of the mean grain, without unit.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub kinetic_energy: f64,
    /// Mean resultant force on a grain over the mean contact force, without unit.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub unbalanced_force: f64,
    /// Solid steps per rest at most; the sample is used as it then is, and the report says so.
    #[schemars(range(min = 1))]
    pub at_most_steps: u32,
}

impl Default for Settled {
    fn default() -> Self {
        Self {
            kinetic_energy: 1e-4,
            unbalanced_force: 0.01,
            at_most_steps: 400_000,
        }
    }
}

/// Classes of sizes, and what their parts are parts of; the parts add up to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Grading {
    /// Parts of the number of grains.
    ByCount(Vec<SizeClass>),
    /// Parts of their mass.
    ByMass(Vec<SizeClass>),
}

/// A range of radii, equally likely.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SizeClass {
    /// Smallest radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min: f64,
    /// Largest radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max: f64,
    /// Its part of the grains.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub part: f64,
}

/// How many grains grow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Amount {
    /// This many.
    Number(#[schemars(range(min = 1))] u32),
    /// As many as give this solid fraction of the box at full size (2-D: area fraction; about 0.80 … 0.86 is a
    /// compact sample of discs, 0.58 … 0.64 of spheres).
    SolidFraction(#[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))] f64),
}

/// A distribution of radii [m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Radii {
    /// All values between two bounds equally likely.
    Uniform {
        /// Smallest radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        min: f64,
        /// Largest radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        max: f64,
    },
    /// One of these, equally likely [m].
    List(Vec<f64>),
}

impl Radii {
    /// Smallest and largest radius [m].
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        match self {
            Self::Uniform { min, max } => (*min, *max),
            Self::List(list) => list
                .iter()
                .fold((f64::INFINITY, 0.0), |(lo, hi), r| (lo.min(*r), hi.max(*r))),
        }
    }

    /// Mean of the square (2) or cube (3) of the radius.
    #[must_use]
    pub fn mean_power(&self, power: i32) -> f64 {
        match self {
            Self::Uniform { min, max } if max - min > 1e-9 * max => {
                let n = f64::from(power + 1);
                (max.powi(power + 1) - min.powi(power + 1)) / (n * (max - min))
            }
            Self::Uniform { min, .. } => min.powi(power),
            Self::List(list) => {
                let count = list.iter().fold(0.0, |n, _| n + 1.0);
                list.iter().map(|r| r.powi(power)).sum::<f64>() / count
            }
        }
    }
}

/// When the preparation is over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Stop {
    /// Mean resultant force on a grain over the mean contact force, without unit.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub unbalanced_force: f64,
    /// Mean overlap of the contacts over the mean diameter, to which the jammed sample is released. For bonded grains
    /// well below the opening at which a bond breaks (strength over stiffness), or cutting the sample breaks bonds.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mean_overlap: f64,
    /// Solid steps of the whole preparation at most; a sample that is not ready by then is an error.
    pub at_most_steps: u32,
}

impl Default for Stop {
    fn default() -> Self {
        Self {
            unbalanced_force: 0.01,
            mean_overlap: 1e-6,
            at_most_steps: 5_000_000,
        }
    }
}

/// A grain of a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grain {
    /// Centre [m].
    pub position: Vector,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Velocity [m/s]; at rest without it.
    #[serde(default)]
    pub velocity: Option<Vector>,
    /// Rotation rate [rad/s]; none without it.
    #[serde(default)]
    pub angular_velocity: Option<Rotation>,
    /// Material, if it is not that of the other grains.
    #[serde(default)]
    pub material: Option<String>,
}

/// A box emptied after the preparation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Name in tables: `hole`, `inlet chamber`.
    pub name: String,
    /// The box [m].
    #[serde(rename = "box")]
    pub region: Extent,
}
