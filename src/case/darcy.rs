//! Water that seeps between the grains on a coarse grid (C-09 … C-17).

use super::geometry::{Extent, Face, Vector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Darcy seepage with drag on the grains: pressure on a coarse grid of cells that hold many grains. It needs no `coupling`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Darcy {
    /// Density of the water [kg/m3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Dynamic viscosity [Pa s]; water at 20 °C has 1e-3.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity: f64,
    /// The coarse grid; without it the cells of the domain.
    #[serde(default)]
    pub grid: Option<DarcyGrid>,
    /// What the water may fill.
    #[serde(default)]
    pub enclosure: Enclosure,
    /// Conditions on faces of the coarse grid or parts of them; nothing flows through the rest. A later one outweighs an
    /// earlier one.
    #[serde(default)]
    pub boundaries: Vec<SeepageBoundary>,
    /// Which equations.
    #[serde(default)]
    pub equations: Equations,
    /// How grains count for the porosity of the cells they touch.
    #[serde(default)]
    pub porosity: PorosityMethod,
    /// Which mean of the diameters enters the permeability.
    #[serde(default)]
    pub mean_diameter: MeanDiameter,
    /// Which law of resistance.
    #[serde(default)]
    pub resistance: Resistance,
    /// Porosity above which a cell conducts no better (C-11), without unit.
    #[serde(default = "default_cap")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub porosity_cap: f64,
    /// Porosity below which a cell conducts no worse, without unit: overlapping grains may overfill a cell.
    #[serde(default = "default_least")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub least_porosity: f64,
    /// Whether pores that open or close take in or give off water (C-13).
    #[serde(default)]
    pub transient_porosity: bool,
    /// The drag law.
    #[serde(default)]
    pub drag: Drag,
    /// Whether a grain that follows the water faster than the coupling interval feels the drag at its end.
    #[serde(default = "yes")]
    pub semi_implicit_drag: bool,
    /// Steps of the grains between two couplings (C-16). Without it as many as the `accuracy` allows, and 100 where none is asked for.
    #[serde(default)]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub coupling_interval: Option<u32>,
    /// Largest imbalance of a cell at which the pressure is accepted, relative to that at uniform pressure.
    #[serde(default = "default_tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Iterations after which the run ends with an error.
    #[serde(default = "default_iterations")]
    #[schemars(range(min = 1, max = 100_000))]
    pub max_iterations: u32,
}

fn default_cap() -> f64 {
    0.7
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

fn yes() -> bool {
    true
}

/// The coarse grid: a box cut into equal cells; it may be smaller than the domain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DarcyGrid {
    /// Lower corner [m].
    pub from: Vector,
    /// Upper corner [m].
    pub to: Vector,
    /// Cells along each axis.
    #[schemars(extend("minItems" = 2, "maxItems" = 3))]
    pub cells: Vec<u32>,
}

/// What the water may fill.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Enclosure {
    /// The whole grid.
    #[default]
    Grid,
    /// The side of all these planes that their normals point to.
    Planes(Vec<Plane>),
}

/// A plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point of it [m].
    pub point: Vector,
    /// Its normal, towards the water; of any length but 0.
    pub normal: Vector,
}

/// A condition on a face of the coarse grid or on a part of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeepageBoundary {
    /// Name in tables and outputs.
    pub name: String,
    /// The face.
    pub face: Face,
    /// The part of the face that lies in this box (its extent normal to the face does not matter) [m]; without it the
    /// whole face.
    #[serde(default)]
    pub patch: Option<Extent>,
    /// What holds there.
    pub condition: SeepageCondition,
}

/// What the water does at a face of the coarse grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SeepageCondition {
    /// Pressure imposed.
    Pressure {
        /// Pressure [Pa].
        value: f64,
    },
    /// Hydraulic head imposed: p/(rho g) + elevation above the origin.
    Head {
        /// Head [m].
        value: f64,
    },
    /// Flux through the face.
    Flux {
        /// Volume per area and time into the grid [m/s].
        value: f64,
    },
    /// Rain on the face.
    Rain {
        /// Volume per horizontal area and time [m/s].
        #[schemars(range(min = 0.0))]
        rate: f64,
    },
    /// Nothing flows.
    NoFlow {},
}

/// Which equations (E-13 … E-16).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Equations {
    /// Conductivity K/mu, gravity in the water, superficial velocity in the drag.
    #[default]
    Corrected,
    /// As printed: conductivity K/(mu eps), no gravity in the water, interstitial velocity in the drag; signs are Darcy's.
    Paper,
}

/// How grains count for the porosity of cells (C-10).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum PorosityMethod {
    /// Where the centre stands.
    Centroid,
    /// By 29 points (17 in 2-D) of equal weight.
    Divided,
    /// By exact overlap.
    #[default]
    Exact,
}

/// Which law of resistance of the bed (C-11).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Resistance {
    /// Kozeny and Carman: the loss of pressure grows with the flux.
    #[default]
    KozenyCarman,
    /// Ergun 1952: with the inertia of fast water, by repeated solutions; goes with the corrected equations.
    Ergun,
}

/// Which mean of the diameters (C-11).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum MeanDiameter {
    /// Sum of cubes over sum of squares.
    #[default]
    Sauter,
    /// Arithmetic mean.
    Number,
    /// Weighted with the mass.
    Mass,
}

/// The drag law (C-14).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Drag {
    /// Di Felice 1994.
    #[default]
    DiFelice,
    /// Ergun in dense, Wen and Yu in dilute beds.
    Gidaspow,
    /// A single grain, blind to its neighbours.
    Dallavalle,
    /// What closes the balance of momentum with the law of resistance, whichever it is.
    KozenyCarman,
}
