//! The grains: their source, preparation, cutting and bonding.

use super::geometry::{Extent, Region, Rotation, Vector};
pub use super::sieve::{self, Sieve};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use structure::Shape;

/// The initial grains: discs in 2-D, spheres in 3-D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grains {
    /// Material of the grains. It needs a density.
    pub material: String,
    /// Source of the grains.
    pub initial: GrainSource,
    /// CSV file to which the prepared sample is written before cutting, so that other runs can reuse it. A file name in
    /// the output folder, different from the output files of the program.
    #[serde(default)]
    pub save: Option<PathBuf>,
    /// Regions whose grains have their own material and initial velocity after the preparation, such as the layers of
    /// the ground. A later zone takes precedence. Density follows from the material; friction, cohesion and strength of
    /// bonds from `pairs` of the contact law.
    #[serde(default)]
    pub zones: Vec<GrainZone>,
    /// Boxes emptied after the preparation, such as chambers and holes. A grain is removed if it touches the box.
    #[serde(default)]
    pub cut: Vec<Cut>,
    /// `true` if contacts that exist after preparation and cutting are bonded. Contacts that form later are never
    /// bonded. Before time 0, what contacts connect to a wall or to a fixed or driven body then comes to rest under
    /// gravity, without the fluid, so that its bonds carry their load; a bond breaks there only if its load at rest
    /// exceeds its strength. The run reports steps, broken bonds and grains that were held. Agglomerates, bodies and
    /// grains that nothing supports keep their positions and velocities. Without gravity nothing is held: samples come
    /// to equilibrium with their own contacts, and then have their velocities.
    #[serde(default)]
    pub bond_at_start: bool,
}

/// A region whose grains have a material of their own. It needs a `region` or a `shape`; with both, a grain must be
/// in both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrainZone {
    /// Name in the tables of `plan`.
    pub name: String,
    /// Layer or box. A grain belongs to the zone if its centre lies in the region.
    #[serde(default)]
    pub region: Option<Region>,
    /// A solid, such as a polygon in 2-D or a mesh in 3-D. A grain belongs to the zone if its centre lies in the solid.
    #[serde(default)]
    pub shape: Option<Shape>,
    /// Material of the grains. It needs a density.
    pub material: String,
    /// Initial velocity of the grains [m/s]. Default: that of the sample; zero for prepared grains.
    #[serde(default)]
    pub velocity: Option<Vector>,
}

/// Source of grains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GrainSource {
    /// A loose random cloud whose radii grow until the sample is compacted.
    Growth(Growth),
    /// A loose random cloud that falls onto the walls and settles (dry pluviation).
    Deposition(Deposition),
    /// A saved sample.
    File(SampleFile),
    /// A list of grains.
    List(Vec<Grain>),
}

/// A sample in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleFile {
    /// Table, relative to the case, whose first line names the columns: `x`, `y`, `z` and `radius` or `diameter`
    /// [m]; optionally `material`, `velocity_x`, `velocity_y`, `velocity_z` [m/s], `angular_velocity_x`,
    /// `angular_velocity_y`, `angular_velocity_z` [rad/s] and `id`, which gives the order of the grains. In 2-D
    /// without `z`, `velocity_z` and the rotations about x and y. Cells are separated by commas, semicolons, tabs
    /// or spaces, and numbers have decimal points. Other units are written in brackets: `x [mm]`. Dumps of LAMMPS and
    /// LIGGGHTS as text (the last snapshot), text files of YADE and lists of `ball create` commands of PFC are read
    /// as well, without types, groups and forces.
    pub path: PathBuf,
    /// Length of the unit of the file [m]: 0.001 for a file in mm without units in brackets. Centres, radii and
    /// velocities are multiplied by it.
    #[serde(default = "crate::one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Position of the origin of the file in the domain [m], for samples that are centred at the origin. Default: the
    /// origin of the domain.
    #[serde(default)]
    pub origin: Option<Vector>,
}

/// Preparation by radius growth, without cohesion and fluid. During the growth all faces of the box are frictional
/// walls, also where the domain is open; grains that then lie in structures are removed. Equal seeds give equal
/// samples on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Growth {
    /// Amount of grains.
    pub amount: Amount,
    /// Radii at the end of the growth [m].
    pub radii: Radii,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
    /// The box that is filled [m]. Default: the whole domain.
    #[serde(default, rename = "box")]
    pub region: Option<Extent>,
    /// Friction angle during the growth [degrees]. A small angle gives a dense sample. Default: the friction angle of
    /// the contact law.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Criteria at which the preparation ends.
    #[serde(default)]
    pub stop: Stop,
}

/// Preparation by gravity deposition, without cohesion and fluid: a loose cloud falls, settles on `walls` and
/// `box_walls`, and is trimmed. No grain starts in a structure or in a closed cavity of a structure that is not
/// connected to the surface. Equal seeds give equal samples on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deposition {
    /// Number of grains.
    #[schemars(range(min = 1))]
    pub number: u32,
    /// Size distribution.
    pub grading: Grading,
    /// Box of the initial cloud [m]. Its solid fraction is at most 0.3 (2-D: 0.45).
    #[serde(rename = "box")]
    pub region: Extent,
    /// Further clouds of the same deposition with their own gradings and materials, such as the upper layers of the
    /// ground. All clouds fall at the same time, each from its box; the grains of the lowest box settle at the bottom.
    #[serde(default)]
    pub layers: Vec<DepositedLayer>,
    /// Seed of the random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Coordinate along the axis of gravity above which settled grains are removed [m].
    #[serde(default)]
    pub trim_above: Option<f64>,
    /// Normal stiffness during the fall [N/m]. A value below that of the contact law allows larger time steps. The
    /// settled sample is then relaxed at ten times this stiffness, and so on, up to the stiffness of the law.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub falling_stiffness: Option<f64>,
    /// Friction angle during the deposition [degrees]. Default: the friction angle of the contact law.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 89.0))]
    pub friction_angle_degrees: Option<f64>,
    /// Local damping during the fall [1]; at least 0.7 after landing.
    #[serde(default = "default_deposition_damping")]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: f64,
    /// Criteria at which the sample counts as settled.
    #[serde(default)]
    pub stop: Settled,
}

/// A further cloud of a deposition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DepositedLayer {
    /// Name in tables.
    pub name: String,
    /// Material of the grains. It needs a density. Default: the material of all grains.
    #[serde(default)]
    pub material: Option<String>,
    /// Number of grains.
    #[schemars(range(min = 1))]
    pub number: u32,
    /// Size distribution.
    pub grading: Grading,
    /// Box of the initial cloud [m]. Its solid fraction is at most 0.3 (2-D: 0.45).
    #[serde(rename = "box")]
    pub region: Extent,
}

fn default_deposition_damping() -> f64 {
    0.2
}

/// Criteria at which a deposited sample counts as settled. Both must hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settled {
    /// Mean kinetic energy over m g d of the mean grain [1].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub kinetic_energy: f64,
    /// Unbalanced force: mean resultant force on a grain over the mean contact force [1].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub unbalanced_force: f64,
    /// Largest number of solid steps per stage. A sample that is not settled by then is used as it is, with a note in
    /// the report.
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

/// Size distribution: size classes whose fractions add up to 1, with the quantity to which the fractions refer; or a
/// sieve curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Grading {
    /// Fractions of the number of grains.
    ByCount(Vec<SizeClass>),
    /// Fractions of the mass.
    ByMass(Vec<SizeClass>),
    /// Sieve curve: the fraction of the mass [1] that passes sieves of ascending diameter [m]. The passing mass
    /// rises with the logarithm of the diameter between two sieves. In 2-D it is that of discs.
    Sieve(Vec<Sieve>),
}

impl Grading {
    /// Returns the smallest and largest radius [m].
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        match self {
            Self::ByCount(classes) | Self::ByMass(classes) => classes
                .iter()
                .fold((f64::INFINITY, 0.0), |(lo, hi), class| {
                    (class.min.min(lo), class.max.max(hi))
                }),
            Self::Sieve(curve) => {
                let (low, high) = sieve::bounds(curve);
                (0.5 * low, 0.5 * high)
            }
        }
    }
}

/// A size class: radii distributed uniformly between two bounds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SizeClass {
    /// Smallest radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min: f64,
    /// Largest radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max: f64,
    /// Fraction of the grains in this class [1].
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub fraction: f64,
}

/// Amount of grains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Amount {
    /// Number of grains.
    Number(#[schemars(range(min = 1))] u32),
    /// Solid fraction of the box at full size (2-D: area fraction) [1]. Compact samples have 0.80 to 0.86 for discs and
    /// 0.58 to 0.64 for spheres.
    SolidFraction(#[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))] f64),
}

/// A distribution of radii [m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Radii {
    /// Uniform distribution between two bounds.
    Uniform {
        /// Smallest radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        min: f64,
        /// Largest radius [m].
        #[schemars(extend("exclusiveMinimum" = 0))]
        max: f64,
    },
    /// Values drawn with equal probability [m].
    List(Vec<f64>),
    /// Sieve curve: the fraction of the mass [1] that passes sieves of ascending diameter [m]. The passing mass
    /// rises with the logarithm of the diameter between two sieves. In 2-D it is that of discs.
    Sieve(Vec<Sieve>),
}

impl Radii {
    /// Returns the smallest and largest radius [m].
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        match self {
            Self::Uniform { min, max } => (*min, *max),
            Self::List(list) => list
                .iter()
                .fold((f64::INFINITY, 0.0), |(lo, hi), r| (lo.min(*r), hi.max(*r))),
            Self::Sieve(curve) => {
                let (low, high) = sieve::bounds(curve);
                (0.5 * low, 0.5 * high)
            }
        }
    }

    /// Returns the mean over the number of grains of a power of the radius, for discs (2) or spheres (3).
    #[must_use]
    pub fn mean_power(&self, power: i32, dimension: usize) -> f64 {
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
            Self::Sieve(curve) => 0.5_f64.powi(power) * sieve::mean_power(curve, power, dimension),
        }
    }
}

/// Criteria at which the preparation ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Stop {
    /// Unbalanced force: mean resultant force on a grain over the mean contact force [1].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub unbalanced_force: f64,
    /// Mean overlap of contacts over the mean diameter to which the jammed sample is released [1]. For bonded grains it
    /// must lie well below the opening at which a bond breaks (strength over stiffness); otherwise cutting the sample
    /// breaks bonds.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mean_overlap: f64,
    /// Largest number of solid steps of the preparation. If the sample is not ready by then, the run ends with an
    /// error.
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
    /// Initial velocity [m/s]. Default: zero.
    #[serde(default)]
    pub velocity: Option<Vector>,
    /// Initial angular velocity [rad/s]. Default: zero.
    #[serde(default)]
    pub angular_velocity: Option<Rotation>,
    /// Material. Default: the material of all grains.
    #[serde(default)]
    pub material: Option<String>,
}

/// A box emptied after the preparation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Name in tables, such as `hole` or `inlet chamber`.
    pub name: String,
    /// The box [m].
    #[serde(rename = "box")]
    pub region: Extent,
}
