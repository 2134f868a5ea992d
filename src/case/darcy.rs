//! Seepage through the grains on a coarse grid.

use super::backward_erosion::BackwardErosion;
use super::geometry::{DrawnLayer, Extent, Face, Region, Vector};
use darcy::{
    Condition, DragLaw, Equations, Liquid, MeanDiameter, PorosityMethod, Resistance, Retention,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Darcy seepage with drag on the grains. The pressure is solved on a coarse grid whose cells hold several grains. No
/// `coupling` is needed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Darcy {
    /// Density of the water [kg/m3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Dynamic viscosity [Pa s]. Water at 20 °C: 1e-3.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity: f64,
    /// The coarse grid. Default: the cells of the domain.
    #[serde(default)]
    pub grid: Option<DarcyGrid>,
    /// Part of the grid that the water fills.
    #[serde(default)]
    pub enclosure: Enclosure,
    /// Boundary conditions on faces of the coarse grid or parts of them. All other faces are impermeable. A later
    /// condition takes precedence over an earlier one.
    #[serde(default)]
    pub boundaries: Vec<SeepageBoundary>,
    /// Drains, wells and cavities inside the ground. A later one takes precedence.
    #[serde(default)]
    pub drains: Vec<Drain>,
    /// Surface of the ground: slopes, the faces of a dam, a ditch. Default: the ground fills the grid.
    #[serde(default)]
    pub terrain: Option<Terrain>,
    /// Layers, boxes and rasters with their own permeability or porosity. A later zone replaces the values of an
    /// earlier one that it also defines.
    #[serde(default)]
    pub zones: Vec<Zone>,
    /// Unsaturated ground: flow in saturated and unsaturated ground, with a phreatic surface and seepage faces. Needs
    /// gravity and zones that fill the ground. Grains in it are loaded by suction, weight and buoyancy of the
    /// water; they change its flow in zones that follow them (`follows_grains`). Default: all ground is saturated.
    #[serde(default)]
    pub unsaturated: Option<Unsaturated>,
    /// Backward erosion piping below an impervious structure. Default: none is computed.
    #[serde(default)]
    pub backward_erosion: Option<BackwardErosion>,
    /// Form of the equations.
    #[serde(default)]
    pub equations: Equations,
    /// Method that computes the porosity of the cells.
    #[serde(default)]
    pub porosity: PorosityMethod,
    /// Mean diameter in the permeability.
    #[serde(default)]
    pub mean_diameter: MeanDiameter,
    /// Law of flow resistance. Default: `gidaspow`; `kozeny_carman` with the equations of the paper.
    #[serde(default)]
    pub resistance: Option<Resistance>,
    /// Largest porosity in the permeability [1]: open water has at least the resistance of a bed at this porosity.
    /// Default: 0.9999, so that the friction and the inertia of a channel determine its resistance; 0.7 with the
    /// equations of the paper.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub porosity_cap: Option<f64>,
    /// Smallest porosity in the permeability [1]: overlapping grains may overfill a cell.
    #[serde(default = "default_least")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub least_porosity: f64,
    /// Height of the roughness of the walls of open water [m], for its friction in turbulent flow. Default:
    /// the mean diameter of the grains of the
    /// ground around it; 0 where there are none.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub roughness: Option<f64>,
    /// `true` if moving grains displace the water. Otherwise the bed is treated as stationary in the mass balance
    /// of the water and in the mean drag, and a bed that moves as a whole is stopped. Default: true; false with the
    /// equations of the paper.
    #[serde(default)]
    pub transient_porosity: Option<bool>,
    /// Drag law. Any other law than `reaction` is independent of the resistance: the forces on the grains then differ
    /// from the pressure loss, and the closure of momentum in the log gives the difference. Default: `reaction`;
    /// `di_felice` with the equations of the paper.
    #[serde(default)]
    pub drag: Option<DragLaw>,
    /// `true` if the drag is treated semi-implicitly, which stabilises grains whose response time is below the
    /// coupling interval.
    #[serde(default = "crate::yes")]
    pub semi_implicit_drag: bool,
    /// Solid steps between two couplings. Default: the largest number for which contacts, drag and bed are stable,
    /// limited by `accuracy`, or to 100 without `accuracy`. A longer interval is unstable.
    #[serde(default)]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub coupling_interval: Option<u32>,
    /// Relative tolerance of the pressure solver: largest imbalance of a cell, relative to the imbalance at uniform
    /// pressure [1].
    #[serde(default = "default_tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Largest number of iterations of the pressure solver. If more are needed, the run ends with an error.
    #[serde(default = "default_iterations")]
    #[schemars(range(min = 1, max = 100_000))]
    pub max_iterations: u32,
}

impl Darcy {
    /// Returns the law of flow resistance.
    #[must_use]
    pub fn resistance(&self) -> Resistance {
        self.resistance.unwrap_or(match self.equations {
            Equations::Corrected => Resistance::Gidaspow,
            Equations::Paper => Resistance::KozenyCarman,
        })
    }

    /// Returns the properties of the water.
    #[must_use]
    pub fn liquid(&self) -> Liquid {
        Liquid {
            density: self.density,
            viscosity: self.viscosity,
        }
    }

    /// Returns the drag law.
    #[must_use]
    pub fn drag(&self) -> DragLaw {
        self.drag.unwrap_or(match self.equations {
            Equations::Corrected => DragLaw::Reaction,
            Equations::Paper => DragLaw::DiFelice,
        })
    }

    /// Returns the largest porosity in the permeability [1]. Cells without grains have the permeability at this
    /// porosity: almost no resistance.
    #[must_use]
    pub fn porosity_cap(&self) -> f64 {
        self.porosity_cap.unwrap_or(match self.equations {
            Equations::Corrected => 0.9999,
            Equations::Paper => 0.7,
        })
    }

    /// Returns `true` if moving grains displace the water.
    #[must_use]
    pub fn transient_porosity(&self) -> bool {
        let usual = self.equations == Equations::Corrected;
        self.transient_porosity.unwrap_or(usual)
    }
}

fn default_least() -> f64 {
    0.1
}

fn default_tolerance() -> f64 {
    1e-8
}

fn default_iterations() -> u32 {
    500
}

/// Unsaturated ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unsaturated {
    /// Water content and relative permeability as functions of the suction. The zones define the permeability at
    /// saturation.
    pub retention: Retention,
    /// Transient flow. Default: steady flow.
    #[serde(default)]
    pub transient: Option<TransientFlow>,
}

/// Transient flow in unsaturated ground, by the mixed form of Richards' equation. Water is stored where water
/// content and pressure rise. The steps are chosen by their error; the results are written at the steps of the
/// clock.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransientFlow {
    /// State at time 0.
    #[serde(default)]
    pub initial: InitialState,
    /// Specific storage of saturated ground [1/m]: volume of water that a volume of ground takes up by a rise of the
    /// head of 1 m. Clay: 1e-4 to 1e-3; dense sand: 1e-5 to 1e-4; sound rock: below 1e-6.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub specific_storage: f64,
    /// Largest error of the water content of a cell in a step [1].
    #[serde(default = "default_content_error")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.1))]
    pub content_error: f64,
}

fn default_content_error() -> f64 {
    2e-3
}

/// State of unsaturated ground at time 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum InitialState {
    /// Steady flow under the conditions at time 0.
    #[default]
    Steady,
    /// Stationary water with this water level above the origin [m], under suction above it.
    Head(f64),
    /// One pressure head everywhere [m]; negative under suction.
    PressureHead(f64),
}

/// The coarse grid: a box divided into cells, by `cells` or by `spacing`. It may be smaller than the domain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DarcyGrid {
    /// Lower corner [m]. Default: that of the domain.
    #[serde(default)]
    pub from: Option<Vector>,
    /// Upper corner [m]. Default: that of the domain.
    #[serde(default)]
    pub to: Option<Vector>,
    /// Number of equal cells along each axis.
    #[serde(default)]
    #[schemars(extend("minItems" = 2, "maxItems" = 3))]
    pub cells: Option<Vec<u32>>,
    /// Widths of the cells along each axis, in place of `cells`: fine at a toe or a wall, coarse far from it. Needs a
    /// case without grains.
    #[serde(default)]
    #[schemars(extend("minItems" = 2, "maxItems" = 3))]
    pub spacing: Option<Vec<CellWidths>>,
}

/// Widths of the cells of the coarse grid along an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CellWidths {
    /// Width of equal cells [m]; the grid is a whole number of them long.
    Width(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Positions along the axis and widths of the cells there [m], in ascending order of the positions. Between two
    /// points the width changes linearly with the position, so that the cells are a geometric series; beyond the
    /// ends it is constant. Every point is a face between cells, and widths are reduced until whole cells fit.
    Points(Vec<[f64; 2]>),
    /// Width of every cell [m], from the lower end of the grid.
    Widths(Vec<f64>),
}

/// Part of the grid that the water fills.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Enclosure {
    /// The whole grid.
    #[default]
    Grid,
    /// The side of all planes to which their normals point.
    Planes(Vec<EnclosurePlane>),
}

/// A plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Plane")]
pub struct EnclosurePlane {
    /// A point of the plane [m].
    pub point: Vector,
    /// Normal vector towards the water, of any length [1].
    pub normal: Vector,
}

/// A region of the ground with its own permeability or porosity. A cell that is cut by a boundary between zones has
/// the harmonic mean of their permeabilities across the boundary and the arithmetic mean along it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// Name in the tables of `plan`.
    pub name: String,
    /// The region. Default: the whole grid.
    #[serde(default)]
    pub region: Option<Region>,
    /// Polygon that bounds the region in 2-D, in place of `region`.
    #[serde(default)]
    pub polygon: Option<ZonePolygon>,
    /// Permeability. Default: that of the grains by the `resistance` of the case.
    #[serde(default)]
    pub permeability: Option<ZonePermeability>,
    /// Porosity in the law of resistance and in the drag law, in place of that of the grains [1]. The mass balance of
    /// the water and buoyancy keep the porosity of the grains.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub porosity: Option<f64>,
    /// Permeability along the bedding over that across it [1]: 1 to 3 in sand, 4 to 10 in layered deposits.
    /// The stated permeability is the one along the bedding. The bedding is horizontal unless it has
    /// a `dip`. Needs gravity along an axis. Default: 1.
    #[serde(default)]
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub anisotropy: Option<f64>,
    /// Angle of the bedding against the horizontal in 2-D [deg], positive where the beds rise along x. The
    /// permeability is then a full tensor. Needs `anisotropy`, gravity along y, a permeability as a number, and
    /// saturated ground without grains. Default: 0.
    #[serde(default)]
    #[schemars(range(min = -90.0, max = 90.0))]
    pub dip: Option<f64>,
    /// `true` if the ground of the zone consists of the grains of the case, in unsaturated ground: permeability and
    /// volume of the pores then follow the porosity eps of the grains in each cell. The stated permeability K_0 and
    /// the retention hold at the porosity eps_0, which is `porosity` or else the saturated content. The permeability
    /// is K_0 [eps^3/(1 - eps)^2]/[eps_0^3/(1 - eps_0)^2] (Kozeny and Carman), the content theta_r + (theta_s
    /// eps/eps_0 - theta_r) S_e. The water does not move with the grains. Cells belong to the zone that contains
    /// their centre. Default: false, grains do not change the flow.
    #[serde(default)]
    pub follows_grains: bool,
    /// Retention of the zone in unsaturated ground. Default: that of `unsaturated`.
    #[serde(default)]
    pub retention: Option<Retention>,
    /// Values that vary within the region.
    #[serde(default)]
    pub raster: Option<RasterFile>,
    /// `true` if the zone also applies in cells without grains, as a stationary porous body that the case does not
    /// resolve. Otherwise cells with a porosity of the grains of 0.95 or more are open water. In a case without
    /// grains all zones apply.
    #[serde(default)]
    pub without_grains: bool,
}

/// Corners of a polygon, in order along its boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ZonePolygon {
    /// The corners [m].
    Points(Vec<[f64; 2]>),
    /// Table of the corners, relative to the case, with the columns `x` and `y` [m].
    Path(PathBuf),
    /// Closed polyline of a drawing.
    Dxf(DrawnLayer),
}

/// The permeability of a zone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ZonePermeability {
    /// Intrinsic permeability [m2]. Sand: 1e-12 to 1e-10; silt: 1e-15 to 1e-13.
    Value(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Hydraulic conductivity under the gravity of the case [m/s]. Sand: 1e-5 to 1e-3; silt: 1e-8 to 1e-6.
    HydraulicConductivity(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Factor of the permeability that follows from the grains [1], such as 0.1 for fine particles that the case does
    /// not contain.
    Factor(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Another law of flow resistance.
    Resistance(Resistance),
}

/// Values at the nodes of a rectangular raster.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RasterFile {
    /// Table, relative to the case, with one row per node. Columns: `x`, `y` and, in 3-D, `z` [m]; one of
    /// `permeability` [m2], `hydraulic_conductivity` [m/s] and `factor` [1], or `porosity` [1], or both. The nodes
    /// are all combinations of the coordinates in the file, in any order. The values of a node apply to the points
    /// that are closest to it along each axis.
    pub path: PathBuf,
}

/// A condition on a face of the coarse grid or on a part of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeepageBoundary {
    /// Name in tables and outputs.
    pub name: String,
    /// Face of the coarse grid.
    pub face: Face,
    /// Box that selects a part of the face [m]; its extent normal to the face has no effect. Default: the whole face.
    #[serde(default)]
    pub patch: Option<Extent>,
    /// Condition of the seepage on the face.
    pub condition: Condition,
    /// Table of times [s] and values that replace the value of the condition (pressure, head, level, flux, discharge
    /// or rate): linear between the rows, constant before and after; two values at one time give a jump. Default:
    /// constant. Needs `unsaturated.transient`.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
}

/// Surface of the ground. Cells whose centres lie above it contain no ground, so that it is a staircase of cells.
/// Grains in saturated ground form their own surface, so that their case has no terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Terrain {
    /// The surface.
    pub surface: TerrainSurface,
    /// Conditions on parts of the surface. Other parts are impermeable. A later condition takes precedence.
    #[serde(default)]
    pub conditions: Vec<TerrainCondition>,
}

/// Points of the surface of the ground. Beyond its ends the surface keeps the height of the nearest point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TerrainSurface {
    /// The points [m]. In 2-D [x, y] in the order of x, joined by straight lines; two points of the same x are a
    /// vertical face. In 3-D [x, y, z] at all combinations of some x and some y, in any order; the height is
    /// bilinear between them.
    Points(Vec<Vector>),
    /// Table of the points, relative to the case, with the columns `x`, `y` and, in 3-D, `z` [m].
    Path(PathBuf),
    /// Open polyline of a drawing (2-D).
    Dxf(DrawnLayer),
}

/// Condition on a part of the surface of the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TerrainCondition {
    /// Name in tables and outputs.
    pub name: String,
    /// The part: the surface below cells of air or open water whose centres lie in the region. Default: all of it.
    #[serde(default)]
    pub region: Option<Region>,
    /// Condition of the seepage. A reservoir in front of a slope is a `seepage_face` with a `level`: water leaves
    /// above the level, and below it the water of the reservoir enters or leaves. Rain falls on horizontal faces.
    pub condition: Condition,
    /// Table of times [s] and values that replace the value of the condition, as for a boundary.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
}

/// A drain, a well or a cavity inside the ground. The cells whose centres lie in its box are removed from the
/// ground, and its condition applies to their faces. A box thinner than a cell along an axis that contains no
/// centre is a sheet: the condition applies to both sides of the plane between cells nearest to it. The cells of a
/// `discharge` stay in the ground; it is divided among them by volume, and must be one that the ground can deliver.
/// A drain on a face of the grid is a boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Drain {
    /// Name in tables and outputs.
    pub name: String,
    /// The box [m].
    #[serde(rename = "box")]
    pub region: Extent,
    /// The condition: pressure, head, seepage face, flux or discharge. A well that pumps 1 L/s has
    /// {"discharge": {"value": -1e-3}}.
    pub condition: Condition,
    /// Table of times [s] and values that replace the value of the condition, as for a boundary.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
}

#[cfg(test)]
mod tests;
