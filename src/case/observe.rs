//! Regions, probes, outputs and analyses.

use super::collapse::GroundCollapse;
use super::element_test::ElementTest;
use super::fluid::Precision;
use super::geometry::{Axis, Extent, Face, Vector};
use super::grains::Radii;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A box in which grains are removed, generated or recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Name in tables and files.
    pub name: String,
    /// The box [m].
    #[serde(rename = "box")]
    pub region: Extent,
    /// Action of the region.
    pub action: Action,
}

/// Action of a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// Removes grains and logs time, id and mass.
    Remove {
        /// Criterion for removal.
        #[serde(default)]
        when: When,
    },
    /// Generates grains at random free positions.
    Generate {
        /// Generation rate [1/s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        rate: f64,
        /// Radii of the grains.
        radii: Radii,
        /// Initial velocity [m/s]. Default: zero.
        #[serde(default)]
        velocity: Option<Vector>,
        /// Seed of the random numbers.
        #[serde(default)]
        seed: u64,
        /// Material. Default: the material of all grains.
        #[serde(default)]
        material: Option<String>,
        /// Largest number of generated grains. Default: no limit.
        #[serde(default)]
        at_most: Option<u32>,
    },
    /// Logs entries and exits of grains in `crossings.csv`: step, time, id, mass, radius, position and velocity of each
    /// grain whose centre enters (`in`) or leaves (`out`) the box. Grains inside at the start have not entered.
    Record {},
}

/// Criterion for removal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum When {
    /// The surface of the grain touches the region.
    #[default]
    Touches,
    /// The centre of the grain lies in the region.
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
    /// Location of the samples.
    pub at: ProbeAt,
}

/// Location of the samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ProbeAt {
    /// Velocity and pressure at a point. In seepage also the hydraulic head; the velocity is that of the cell that
    /// contains the point, and pressure and head follow from the gradient in this cell.
    Point {
        /// The point [m].
        position: Vector,
    },
    /// Velocity and pressure along a line; in seepage also the hydraulic head, as for a point.
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
        /// Axis normal to the plane.
        axis: Axis,
        /// Coordinate of the plane [m].
        position: f64,
    },
    /// Force [N] and torque [N m] of the fluid on a body (2-D: per metre of depth). They are means over the last two
    /// steps; `fluid_force_time` is their time [s]. Below a moving free surface single rows scatter as those of `wall`
    /// do: use means over many rows.
    Body {
        /// Name of the body.
        name: String,
    },
    /// Force [N] and torque [N m] of the fluid on a structure (2-D: per metre of depth). On a lattice the force follows
    /// from the pressure of the lattice, which is the excess over the hydrostatic pressure if gravity does not act on
    /// the fluid. The force is the mean over the last step, and `time` the middle of this step. In seepage the pore
    /// pressure acts on the whole surface of the structure in the ground: uplift, and the thrust on piles and walls.
    /// Water above the ground is not included. Below a moving free surface single rows scatter as those of `wall` do:
    /// use means over many rows.
    Structure {
        /// Name of the structure.
        name: String,
        /// Reference point of the torque [m]. Default: the lower corner of the domain.
        #[serde(default)]
        about: Option<Vector>,
    },
    /// Discharge of seepage in 2-D between two points, such as the tip of a cut-off and the impervious base, along
    /// the edges of cells between the corners nearest to the points. Where a structure closes the face of a cell at
    /// one of the points in part, as at a tip within a cell, the path includes the open part of this face. Discharge
    /// from left to right of the path from the first to the last point is positive. Without storage and wells all
    /// paths between the points have the same discharge.
    Crossing {
        /// First point [m].
        from: Vector,
        /// Last point [m].
        to: Vector,
    },
    /// Heave of the ground in front of a structure: prisms of K. Terzaghi between the ground surface and the level of
    /// the tip of the structure. One row for each width, from a cell to all of the box: width [m], mean head at the
    /// base above that at the surface [m], mean upward gradient [1], and factor of safety, the submerged weight of the
    /// prism over the force of the water. Terzaghi's own width is half the depth of the prism. Needs gravity along an
    /// axis.
    Heave {
        /// Box of the widest prism [m]: its lower face at the tip of the structure, its upper one at the surface.
        prism: Extent,
        /// Face of the box at the structure, from which widths are measured.
        at: Face,
        /// Unit weight of the submerged ground [N/m3]: 8000 to 11000 for sand.
        #[schemars(extend("exclusiveMinimum" = 0))]
        submerged_weight: f64,
    },
    /// Discharge of seepage through a plane between cells of the coarse grid, or a part of it, and the mean hydraulic
    /// heads [m] of the cells before and behind it. The mean heads over the base of a prism of ground give its uplift
    /// and with it the factor of safety against heave.
    Section {
        /// Axis normal to the plane; the discharge along it is positive.
        axis: Axis,
        /// Coordinate of the plane [m]; the nearest plane between cells is used.
        position: f64,
        /// Box that selects a part of the plane [m]: the cells whose centres lie in it; its extent along the axis has
        /// no effect. The column `open_area` shows the part that was used. Default: the whole plane.
        #[serde(default)]
        part: Option<Extent>,
    },
    /// Water table of unsaturated ground: one row for each column of cells along gravity with the point of zero
    /// pressure [m] above its lowest saturated cell. Needs `fluid.darcy.unsaturated` and gravity along an axis.
    WaterTable {},
    /// Water balance of transient seepage: water in the ground, water that entered and left since time 0 [m3; in
    /// 2-D m2], and the present inflow and outflow. Needs `fluid.darcy.unsaturated.transient`.
    WaterBalance {},
    /// Force of seepage water on the base of a structure [N; in 2-D N/m]: pressure over a plane between cells,
    /// extrapolated from the cells below it and integrated, and its torque about a point.
    Uplift {
        /// Axis normal to the base; the water is on its lower side and pushes along the axis.
        axis: Axis,
        /// Coordinate of the base [m]; the nearest plane between cells is used.
        position: f64,
        /// Box that selects a part of the plane [m]: the cells whose centres lie in it. Default: the whole plane.
        #[serde(default)]
        part: Option<Extent>,
        /// Reference point of the torque [m]. Default: the lower corner of the domain.
        #[serde(default)]
        about: Option<Vector>,
    },
    /// Elevation of the free surface [m] along the axis of gravity, from the lower corner of the domain, and depth of
    /// water [m] in the column of cells that contains a point.
    Gauge {
        /// The point [m]; its coordinate along the axis of gravity has no effect.
        position: Vector,
    },
    /// Pressure [Pa], aperture [m] and position [m] of the cell of a joint that is nearest to a point. Needs
    /// `fluid.joints`.
    Joint {
        /// The point [m].
        position: Vector,
    },
    /// Discharge of a mouth into the joints [m3/s] and mean pressure outside it [Pa]. Needs `fluid.joints`.
    Mouth {
        /// Name of the mouth.
        name: String,
    },
    /// Force [N] and torque about the centroid [N m] of the water on a block, smallest and largest pressure in its
    /// joints [Pa], the area of its faces on which water acts [m2], position [m] and velocity [m/s] of its centroid.
    /// Needs `fluid.joints`.
    Block {
        /// A point in the block [m].
        position: Vector,
    },
    /// Force of the fluid on a face of the domain [N], its mean traction [Pa] and the mass flux of the fluid through
    /// it [kg/s]. They are means over the last step, and `time` is the middle of this step. Structures, and bodies
    /// with `coupling.bounce_back`, neither press on a face that they cover nor count in the mass flux; with
    /// `coupling.partially_saturated` a face has the pressure of the water below bodies too, and what they contain
    /// counts in the mass flux. Below a moving free surface single rows scatter, because cells that fill or empty send
    /// sound: in `solver example dam-break` with a column 30 cells high, in the first 0.25 s, by 1.1 of the mean force
    /// on the floor, with half the cell width and time step by 0.7 (standard deviation about means over 10 ms). Use
    /// means over many rows: over 2 s the mean force exceeds the weight of the water by 1.7 %, with half the cell
    /// width by 1.1 %.
    Wall {
        /// Face of the domain.
        face: Face,
    },
    /// Load of the grains on a wall: a wall of the case, a structure that grains meet, or a face in `box_walls`.
    /// Displacement of the wall since time 0 [m] and its velocity [m/s]; force [N] and torque about a point [N m] of
    /// the grains on it (2-D: per metre of depth); its area [m2; in 2-D m], mean normal stress (compression positive)
    /// and mean shear stress [Pa], and the number of contacts. The force is that of the springs of all contacts,
    /// without dashpots. The area of a plane is that within the domain and between the other plane walls; of facets
    /// that of all facets.
    WallLoad {
        /// Name of the wall, or of the structure, or the face such as `y_max`.
        name: String,
        /// Point of the torque [m]. Default: the lower corner of the domain.
        #[serde(default)]
        about: Option<Vector>,
    },
    /// A bed of grains under a stream on a lattice: surface, scour, shear stress, Shields number and bedload.
    /// `summary.json` and the table at the end have the means over time.
    Bed(Bed),
    /// Grains in a box: number, solid fraction, coordination number, mean stress (compression positive) and d50, also
    /// of the grains that regions removed. `summary.json` and the table at the end have the means over time.
    Grains(Fabric),
}

/// Grains in a box. A grain counts if its centre lies in the box.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Fabric {
    /// The box [m]. The stress is a mean over all of it, pores included. Default: the whole domain.
    pub part: Option<Extent>,
    /// Start of the means over time [s]. Default: half of `time.end`.
    #[schemars(extend("minimum" = 0))]
    pub mean_from: Option<f64>,
}

/// A bed of grains below a stream on a lattice. Gravity on the grains points to the lower face of its axis; the bed
/// lies there. The shear stress by the balance of forces, and the Shields number from it, are valid if the stream
/// is statistically steady: choose `mean_from` accordingly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bed {
    /// Axis of the stream.
    #[serde(default = "along_x")]
    pub flow_axis: Axis,
    /// Part of the domain that is measured [m]. The surface of the bed is searched within its height; the stream
    /// above the bed is measured up to the top of the domain. Default: the whole domain.
    #[serde(default)]
    pub part: Option<Extent>,
    /// Solid fraction at the surface of the bed, averaged over two diameters along the bed and one across it [1].
    /// Solids are grains, bodies and structures; lines of cells that are solid up to the top of the part, as in a
    /// pier, do not count. Default: 0.4 in 2-D and 0.3 in 3-D, half of that inside a bed.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub threshold: Option<f64>,
    /// Diameter of the Shields number and of the dimensionless flux [m]. Default: the median d50 by volume of the
    /// grains present.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub diameter: Option<f64>,
    /// Height from which scour is measured [m]. Default: the mean height of the bed surface in the first sample.
    #[serde(default)]
    pub level: Option<f64>,
    /// Start of the means over time [s]. Default: half of `time.end`.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub mean_from: Option<f64>,
}

/// Output fields and their intervals. Only the fields named here are written.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Output {
    /// Fields of the fluid.
    pub fluid: Option<FluidOutput>,
    /// Positions, velocities and forces of the grains; for blocks with the radius of the bounding sphere.
    pub grains: Option<GrainOutput>,
    /// Contacts with their forces and bonds, as lines: `normal_force` with the attraction of a bridge [N], `overlap`
    /// (negative across a gap) [m], and `bonded`, 1 for a bond. With `bridges` in the contact law also
    /// `bridge_force` [N], 0 without a bridge. A bridge across a gap is a line as well; it is no contact in
    /// the counts of probes and of `summary.json`.
    pub contacts: Option<Every>,
    /// Surfaces of the blocks with origin and velocity.
    pub blocks: Option<Every>,
    /// Time averages of velocity, pressure and Reynolds stresses of a lattice Boltzmann fluid.
    pub averages: Option<AveragesOutput>,
}

/// Time averages: sums of velocity, its products and pressure in every cell, continued across restarts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AveragesOutput {
    /// Time of the first sample [s].
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub from: f64,
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, counted from the first
    /// sample.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sample_every: f64,
    /// Time between outputs of the averages [s], written at the steps nearest to its multiples and at the end of the
    /// run. Default: only at the end of the run.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    /// Axis along which a profile of plane averages is also written as a table.
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
    /// Names of the fields.
    #[serde(default = "default_fields")]
    pub fields: Vec<FieldName>,
    /// Floating-point format in the file.
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
    /// Eddy viscosity [m2/s]; 0 without a turbulence model.
    EddyViscosity,
    /// 1 in cells covered by a solid, 0 in the fluid.
    Solid,
    /// Fill level of a cell [1], between 0 and 1: its contour 0.5 is the free surface. 1 everywhere without a free
    /// surface.
    Fill,
    /// Hydraulic head of seepage: p/(rho g) + elevation above the origin [m]; NaN in cells without water.
    Head,
    /// Stream function of plane steady seepage [m2/s]: the discharge between two points is its difference, its contours
    /// are streamlines, and `picture --flow-net` draws them.
    StreamFunction,
    /// Degree of saturation of unsaturated ground: volume of water over volume of pores [1]; 0 in cells without
    /// water. Needs `fluid.darcy.unsaturated`.
    Saturation,
}

impl FieldName {
    /// Returns the number of values per cell.
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
    /// `true` if the displacement of each grain since time 0 [m] is also written.
    #[serde(default)]
    pub displacement: bool,
}

/// Output interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Every {
    /// Time between outputs [s]. They are written at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
}

/// Analyses computed during the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Analysis {
    /// Erosion law of a hole erosion test: eroded mass, hydraulic shear stress and erosion rate.
    pub erosion_law: Option<ErosionLaw>,
    /// Ground collapse over seepage points: voids, settlement, stages, loose clusters.
    pub ground_collapse: Option<GroundCollapse>,
    /// Element test of a sample between walls: strength, stiffness and stress ratios, compared with known values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub element_test: Option<ElementTest>,
}

/// Erosion law: eroded mass M_e(t), hydraulic shear stress on the hole by three methods, and erosion rate per area of
/// the hole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErosionLaw {
    /// The initial hole [m].
    pub hole: Extent,
    /// Axis of the flow through the hole.
    #[serde(default = "along_x")]
    pub flow_axis: Axis,
    /// Time between samples [s]. Samples are taken at the steps nearest to its multiples, and at the end of the run.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: f64,
    /// Region whose removed grains count as eroded. Default: all regions that remove grains.
    #[serde(default)]
    pub outlet: Option<String>,
    /// Fraction of the mass of the grains whose removal ends the run, even before `time.end` [1], because the flow in
    /// the remaining channel only becomes faster. Default: the run continues to `time.end`.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub end_at_eroded_fraction: Option<f64>,
}

fn along_x() -> Axis {
    Axis::X
}
