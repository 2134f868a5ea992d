//! Water in the joints between blocks, without a lattice.

use super::geometry::Extent;
use joints::history::PressureHistory;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Water in the joints between blocks: a network of thin layers with pressures and discharges in their planes.
/// Pressures in front of mouths drive it. The pressures load the blocks. Blocks that are not fixed move under water
/// pressure and contact forces, and their motion is solved together with the water. No `coupling` is needed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointNetwork {
    /// Density of the water without air [kg/m3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Dynamic viscosity [Pa s]. Water at 20 °C: 1e-3.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub viscosity: f64,
    /// Time step [s]. Any time step is stable for the water alone; a wave needs some twenty steps per period. Blocks
    /// that move make the same step, which their contacts limit.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_step: f64,
    /// `true` if the inertia of the water is included, with the friction of a laminar layer at each frequency.
    #[serde(default = "crate::yes")]
    pub inertia: bool,
    /// Water outside the joints, at least one mouth. All other edges that meet no other joint are closed. An edge
    /// in two boxes belongs to the first.
    pub mouths: Vec<Mouth>,
    /// Joints, and the water in them.
    #[serde(flatten)]
    pub joints: JointSettings,
}

/// Water in the joints between blocks under a lattice: a network of thin layers, which takes density and viscosity from
/// the lattice. The lattice cells in front of open edges drive it and take its discharge. Its inertia counts, with the
/// friction of a laminar layer at each frequency, and it begins at rest at the reference pressure. This needs the
/// coupling `bounce_back`. Blocks that move make one step with each step of the lattice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatticeJoints {
    /// Method for the joints.
    #[serde(default)]
    pub method: JointMethod,
    /// Number of steps of the lattice for each step of the network. The means of pressures over these steps drive it,
    /// and its discharge returns evenly in as many steps. Only 1 is allowed if a block can move: all blocks must be
    /// fixed for more. A relaxation time of at least 0.53 keeps more
    /// stable.
    #[serde(default = "one_step")]
    #[schemars(extend("minimum" = 1, "maximum" = 16))]
    pub lattice_steps: u32,
    /// Joints, and the water in them.
    #[serde(flatten)]
    pub joints: JointSettings,
}

/// Method by which the water in joints under a lattice is computed. The lattice takes over a joint that opens to more
/// than four of its cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum JointMethod {
    /// Network in joints of up to four cells of the lattice and up to `largest_aperture`, lattice in wider ones.
    #[default]
    Auto,
    /// Network in all joints up to `largest_aperture`, also of more than four cells; the lattice takes over above it.
    Network,
    /// Lattice alone: joints thinner than a cell contain no water.
    Lattice,
}

/// Joints between blocks, and the water in them: a network of thin layers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointSettings {
    /// Largest distance of two faces that form a joint [m], at the middle of their overlap. It must be smaller than the
    /// thinnest block.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub largest_aperture: f64,
    /// Aperture with which closed joints conduct and store water [m], because their walls are rough.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub residual_aperture: f64,
    /// Largest size of a cell of a joint [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cell: f64,
    /// Largest angle between the two faces of a joint [degrees].
    #[serde(default = "ten")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 30))]
    pub largest_angle_degrees: f64,
    /// Bulk modulus of the water without air [Pa].
    #[serde(default = "bulk_modulus")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bulk_modulus: f64,
    /// Ratio of the volume of air to the volume of water and air together, at atmospheric pressure [1].
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 0.5))]
    pub air_content: f64,
    /// Exponent of the compression of the air [1]: 1 isothermal, 1.4 adiabatic.
    #[serde(default = "crate::one")]
    #[schemars(extend("minimum" = 1, "maximum" = 1.4))]
    pub air_exponent: f64,
    /// Atmospheric pressure [Pa]. All other pressures are relative to it; under a lattice it is the absolute pressure
    /// where that of the lattice is 0.
    #[serde(default = "atmosphere")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub atmospheric_pressure: f64,
    /// Absolute vapour pressure [Pa]: no pressure in a joint is lower by more than 100 Pa. It must be below the
    /// atmospheric pressure. Default: water at 20 °C.
    #[serde(default = "vapour")]
    #[schemars(extend("minimum" = 0))]
    pub vapour_pressure: f64,
    /// Roughness height of the walls [m] for turbulent friction; 0 for smooth walls. Default: the flow stays
    /// laminar.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub roughness: Option<f64>,
}

impl LatticeJoints {
    /// Returns the network with the water of a lattice: its density [kg/m3], kinematic viscosity [m2/s] and time step
    /// \[s\].
    #[must_use]
    pub fn network(&self, [density, viscosity]: [f64; 2], time_step: f64) -> JointNetwork {
        JointNetwork {
            density,
            viscosity: density * viscosity,
            time_step,
            inertia: true,
            mouths: Vec::new(),
            joints: self.joints.clone(),
        }
    }
}

/// Water outside open edges of joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mouth {
    /// Name of the mouth.
    pub name: String,
    /// Box [m]: edges of joints with their midpoint in it are open.
    #[serde(rename = "box")]
    pub region: Extent,
    /// Pressure above atmospheric pressure [Pa] at the centre of the box; with gravity hydrostatic from there. The run
    /// begins with the steady flow under the pressures at time 0.
    pub pressure: PressureHistory,
    /// `true` if this water also presses on blocks that can move, wherever no joint covers them. These are the blocks
    /// with a face whose centroid lies in the box.
    #[serde(default)]
    pub presses_on_blocks: bool,
}

fn one_step() -> u32 {
    1
}

fn ten() -> f64 {
    10.0
}

fn bulk_modulus() -> f64 {
    2.18e9
}

fn atmosphere() -> f64 {
    101_325.0
}

fn vapour() -> f64 {
    2339.0
}
