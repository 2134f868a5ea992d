//! The fluid: properties, numerical method, forcing and initial state.

use super::boundary::Boundary;
use super::darcy::Darcy;
pub use super::free_surface::FreeSurface;
use super::geometry::Vector;
use super::joints::{JointNetwork, LatticeJoints};
pub use lbm::collision::Operator as Collision;
pub use lbm::gpu::Device;
use lbm::synthetic::Fluctuations;
pub use lbm::term::porous::Resistance;
pub use lbm::turbulence::EddyViscosity as Turbulence;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use structure::Shape;

/// Fluid model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fluid {
    /// Flow resolved between the grains by the lattice Boltzmann method.
    LatticeBoltzmann(LatticeBoltzmann),
    /// Seepage averaged over many grains: Darcy's law on a coarse grid, with drag on the grains.
    Darcy(Darcy),
    /// Water in the joints between blocks: a network of thin layers under pressures at its mouths.
    Joints(JointNetwork),
}

/// A weakly compressible fluid on a lattice. At most one of `relaxation_time`, `time_step` and `reference_velocity`
/// sets the time step. Without them the program chooses it to meet the `accuracy` of the case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatticeBoltzmann {
    /// Density of the fluid at the reference pressure [kg/m3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Kinematic viscosity [m2/s]. Water at 20 °C: 1e-6.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub kinematic_viscosity: f64,
    /// Velocity set of the lattice.
    #[serde(default)]
    pub lattice: LatticeChoice,
    /// Collision operator. Default: TRT; in 3-D cumulants if the program chooses the time step and the flow is too fast
    /// for TRT.
    #[serde(default)]
    pub collision: Option<Collision>,
    /// Turbulence model for eddies smaller than a cell. Default: none; if the program chooses the cell size or the time
    /// step, WALE where the Reynolds number requires it.
    #[serde(default)]
    pub turbulence: Option<TurbulenceChoice>,
    /// Relaxation time tau [1], above 0.5. The lattice viscosity is (tau - 1/2)/3 and the time step is (tau - 1/2)
    /// h²/(3 nu).
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub relaxation_time: Option<f64>,
    /// Time step of the fluid [s]. The relaxation time follows from it.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_step: Option<f64>,
    /// Largest expected velocity U [m/s]. The time step is `lattice_velocity` h/U.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_velocity: Option<f64>,
    /// Reference velocity in lattice units, U dt/h [1]. Required with `reference_velocity`. The Mach number is √3
    /// times this value, because the lattice speed of sound is h/(√3 dt).
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.3))]
    pub lattice_velocity: Option<f64>,
    /// Storage precision of the populations. Default: that of `arithmetic`; f32 if the program chooses the time step
    /// of a 3-D run with `draft` accuracy.
    #[serde(default)]
    pub storage: Option<Precision>,
    /// Precision of the collisions. With f32, populations are stored in f32, a vector holds twice as many numbers, and
    /// rounding changes velocities by an amount that the plan states; boundaries, forces on bodies and sums remain in
    /// f64. Works with bgk, trt and mrt on the processor, without eddy viscosity, partially saturated cells, porous
    /// zones and free surface.
    #[serde(default)]
    pub arithmetic: Precision,
    /// Device that computes the fluid. A GPU computes a lattice between walls and periodic axes on one rank: d3q27 with
    /// bgk, trt or mrt (with trt and mrt also bodies in partially saturated cells), d3q19 with trt, and, in f64 and
    /// without a force, d3q19 and d2q9 with bgk. Both devices give the same state.
    #[serde(default)]
    pub device: Device,
    /// Body force that drives the fluid [N/m3], in addition to gravity.
    #[serde(default)]
    pub body_force: Option<BodyForce>,
    /// Choice of the axes along which gravity acts on the fluid. Along the others, pressure is the excess over the
    /// hydrostatic pressure, and solids have their buoyancy.
    #[serde(default)]
    pub gravity_acts_on_fluid: GravityOnFluid,
    /// Initial velocity and pressure.
    #[serde(default)]
    pub initial: Initial,
    /// Free surface of the water against air. Default: the water fills the domain.
    #[serde(default)]
    pub surface: Option<FreeSurface>,
    /// Boundary conditions on faces or parts of faces. All other faces that are not periodic are no-slip walls.
    #[serde(default)]
    pub boundaries: Vec<Boundary>,
    /// Zones that resist the flow: screens, racks, filters, rockfill.
    #[serde(default)]
    pub porous_zones: Vec<PorousZone>,
    /// Water in joints between blocks, by a network or by the lattice. Default: no water in joints.
    #[serde(default)]
    pub joints: Option<Box<LatticeJoints>>,
    /// Largest speed and pressure of a run on coarse cells, for the automatic choices; `solver plan --pilot` writes
    /// this field. Default: the estimates of the plan.
    #[serde(default)]
    pub pilot: Option<Box<Pilot>>,
}

/// A zone that resists the flow. Grains and blocks pass through it. Resistances of overlapping zones add up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PorousZone {
    /// Name of the zone.
    pub name: String,
    /// Shape and position of the zone.
    pub shape: Shape,
    /// Law of the resistance.
    pub resistance: Resistance,
}

/// Speed and pressure of the water in a run on coarse cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pilot {
    /// Largest speed [m/s].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed: f64,
    /// Largest pressure above or below the reference [Pa].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub pressure: f64,
    /// Hash of the case of the pilot run, without this field.
    pub of: String,
}

/// Axes along which gravity acts on the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum GravityOnFluid {
    /// Along all axes, or along none.
    All(bool),
    /// Choice of the axes by a word.
    Where(Where),
}

impl Default for GravityOnFluid {
    fn default() -> Self {
        Self::Where(Where::Auto)
    }
}

/// Choice of the axes along which gravity acts on the fluid, as a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Where {
    /// Along the periodic axes if the case has a water surface (a face of free slip that gravity points away from);
    /// otherwise along no axis.
    Auto,
    /// Along the periodic axes, where gravity drives a stream down its slope.
    AlongPeriodicAxes,
}

/// Velocity set of the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum LatticeChoice {
    /// D2Q9 in 2-D, D3Q19 in 3-D.
    #[default]
    Auto,
    /// Nine velocities in 2-D.
    D2q9,
    /// Nineteen velocities in 3-D.
    D3q19,
    /// Twenty-seven velocities in 3-D: isotropic to fourth order.
    D3q27,
}

/// A turbulence model, or `none`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum TurbulenceChoice {
    /// No turbulence model.
    Without(NoTurbulence),
    /// A turbulence model.
    Model(Turbulence),
}

impl TurbulenceChoice {
    /// Returns the model, if it is one.
    #[must_use]
    pub fn model(self) -> Option<Turbulence> {
        match self {
            Self::Without(_) => None,
            Self::Model(model) => Some(model),
        }
    }
}

/// The word `none`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum NoTurbulence {
    /// All scales are resolved.
    None,
}

/// Floating-point format in memory or in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Precision {
    /// Eight bytes.
    #[default]
    F64,
    /// Four bytes.
    F32,
}

/// Body force on the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BodyForce {
    /// Constant force [N/m3].
    Constant(Vector),
    /// Oscillating force amplitude · cos(2 pi t / period + phase), as in plane Womersley flow.
    Oscillating {
        /// Amplitude [N/m3].
        amplitude: Vector,
        /// Period [s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        period: f64,
        /// Initial phase [degrees].
        #[serde(default)]
        phase_degrees: f64,
    },
}

/// Initial state of the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Initial {
    /// At rest, at the reference density. Where gravity acts on the fluid, the pressure is hydrostatic; it equals that
    /// of the openings with a pressure, or has a mean of zero without such openings.
    Rest {},
    /// Uniform velocity and pressure: the list of the components of the velocity [m/s], or an object with `velocity`
    /// and `pressure`.
    Uniform(UniformFlow),
    /// Taylor-Green vortices with their pressure and stress: u = -U cos(ax) sin(by) cos(cz),
    /// v = (a/b) U sin(ax) cos(by) cos(cz), with a = 2 pi n/size.
    TaylorGreen {
        /// Largest velocity U along x [m/s].
        velocity: f64,
        /// Number of waves along x and y.
        #[serde(default = "one_wave")]
        waves: [u32; 2],
        /// Number of waves along z; any value above zero makes the vortices stretch each other (Taylor and Green
        /// 1937).
        #[serde(default)]
        waves_along_z: u32,
    },
    /// Two shear layers that roll up (Minion and Brown 1997): u = U tanh((y - L_y/4)/d) in the lower half, U tanh((3
    /// L_y/4 - y)/d) in the upper half, v = p U sin(2 pi (x/L_x + 1/4)). Underresolved runs show spurious vortices or
    /// fail.
    ShearLayers {
        /// Velocity U outside the layers [m/s].
        velocity: f64,
        /// Thickness d of a layer [m]. Minion and Brown use L_y/80 and L_y/100.
        #[schemars(extend("exclusiveMinimum" = 0))]
        thickness: f64,
        /// Perturbation p of the transverse velocity, relative to U [1].
        #[serde(default = "one_twentieth")]
        perturbation: f64,
    },
    /// Developed flow between two walls: a parabolic profile, zero velocity beyond them.
    Channel {
        /// Axis of the flow.
        flow: super::geometry::Axis,
        /// Axis normal to the walls of the channel.
        across: super::geometry::Axis,
        /// Coordinate at which the flow begins along `across` [m], such as the surface of a bed. Default: 0.
        #[serde(default)]
        from: Option<f64>,
        /// Coordinate at which the flow ends along `across` [m]. Default: the size of the domain.
        #[serde(default)]
        to: Option<f64>,
        /// Velocity at the centre of the channel [m/s].
        peak: f64,
        /// Fluctuations that trigger turbulence. Default: none.
        #[serde(default)]
        fluctuations: Option<Fluctuations>,
    },
    /// Velocity and pressure of a field output (VTKHDF) of the same size and spacing.
    File {
        /// Path of the file, relative to the case.
        path: PathBuf,
    },
}

/// Uniform velocity and pressure. A list of components gives the velocity alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "WrittenFlow")]
#[schemars(inline)]
pub struct UniformFlow {
    /// Velocity [m/s].
    pub velocity: Vector,
    /// Pressure above the reference [Pa].
    pub pressure: f64,
}

/// The list of the components of the velocity, or velocity and pressure.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
enum WrittenFlow {
    /// Velocity [m/s], at the reference pressure.
    Velocity(Vector),
    /// Velocity and pressure.
    Fields(NamedFlow),
}

/// Velocity and pressure.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct NamedFlow {
    /// Velocity [m/s].
    velocity: Vector,
    /// Pressure above the reference [Pa].
    #[serde(default)]
    pressure: f64,
}

impl From<WrittenFlow> for UniformFlow {
    fn from(written: WrittenFlow) -> Self {
        match written {
            WrittenFlow::Velocity(velocity) => Self {
                velocity,
                pressure: 0.0,
            },
            WrittenFlow::Fields(NamedFlow { velocity, pressure }) => Self { velocity, pressure },
        }
    }
}

fn one_twentieth() -> f64 {
    0.05
}

fn one_wave() -> [u32; 2] {
    [1, 1]
}

impl Default for Initial {
    fn default() -> Self {
        Self::Rest {}
    }
}
