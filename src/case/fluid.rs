//! The fluid: its properties, its numerics, what drives it and how it starts.

use super::boundary::{Boundary, Fluctuations};
use super::darcy::Darcy;
use super::geometry::Vector;
pub use crate::lbm::collision::Operator as Collision;
pub use crate::lbm::turbulence::EddyViscosity as Turbulence;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// How the fluid is solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fluid {
    /// Resolved between the grains by the lattice Boltzmann method.
    LatticeBoltzmann(LatticeBoltzmann),
    /// Averaged over many grains, by Darcy's law on a coarse grid, with drag on the grains.
    Darcy(Darcy),
}

/// A slightly compressible fluid on a lattice. At most one of `relaxation_time`, `time_step` and
/// `reference_velocity` fixes the time step; with none of them the program chooses it for the `accuracy` of the case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatticeBoltzmann {
    /// Density at rest [kg/m3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Kinematic viscosity [m2/s]; water at 20 °C has 1e-6.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub kinematic_viscosity: f64,
    /// Velocity set.
    #[serde(default)]
    pub lattice: LatticeChoice,
    /// Collision operator. Without it TRT; where the program chooses, in 3-D cumulants when the flow is too fast for TRT.
    #[serde(default)]
    pub collision: Option<Collision>,
    /// Model of the eddies that are smaller than a cell. Without it all scales are taken as resolved; where the program chooses, only
    /// as far as the Reynolds number says so.
    #[serde(default)]
    pub turbulence: Option<TurbulenceChoice>,
    /// Relaxation time tau, without unit: the viscosity on the lattice is (tau - 1/2)/3 and the time step
    /// (tau - 1/2) h²/(3 nu). Above 0.5.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub relaxation_time: Option<f64>,
    /// Time step of the fluid [s]; tau follows from it.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_step: Option<f64>,
    /// Largest velocity expected [m/s]; the time step is `mach` h / `reference_velocity`.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reference_velocity: Option<f64>,
    /// The reference velocity over the lattice speed C = h/dt, without unit (the speed of sound is C/√3); needed
    /// beside `reference_velocity`, at most 0.3.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.3))]
    pub mach: Option<f64>,
    /// Storage precision of the populations; the arithmetic is in f64 always. Without it f64; where the program chooses, f32 for a
    /// draft in 3-D.
    #[serde(default)]
    pub storage: Option<Precision>,
    /// Force per volume that drives the fluid [N/m3], beside gravity.
    #[serde(default)]
    pub body_force: Option<BodyForce>,
    /// Whether gravity acts on the fluid itself. Without it pressure is the excess over the hydrostatic one, and the
    /// weight of a solid is less by that of the fluid it displaces.
    #[serde(default)]
    pub gravity_acts_on_fluid: bool,
    /// Velocity and pressure at the start.
    #[serde(default)]
    pub initial: Initial,
    /// Conditions on faces or parts of faces; faces not named and not periodic are no-slip walls.
    #[serde(default)]
    pub boundaries: Vec<Boundary>,
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

/// A model of eddies, or the word that there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum TurbulenceChoice {
    /// None, whatever the program would choose.
    Without(NoTurbulence),
    /// This model.
    Model(Turbulence),
}

impl TurbulenceChoice {
    /// The model, if it is one.
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
    /// All scales are taken as resolved.
    None,
}

/// Number type in memory or in a file.
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

/// Force per volume on the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BodyForce {
    /// The same at all times [N/m3].
    Constant(Vector),
    /// amplitude · cos(2 pi t / period + phase): the plane Womersley flow.
    Oscillating {
        /// Largest force [N/m3].
        amplitude: Vector,
        /// Time of one oscillation [s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        period: f64,
        /// Phase at the start [degrees].
        #[serde(default)]
        phase_degrees: f64,
    },
}

/// The fluid at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Initial {
    /// At rest, at the reference density.
    Rest {},
    /// The same velocity and pressure everywhere.
    Uniform {
        /// Velocity [m/s].
        velocity: Vector,
        /// Pressure above the reference [Pa].
        #[serde(default)]
        pressure: f64,
    },
    /// The Taylor-Green vortices with their pressure and stress: u = -U cos(ax) sin(by) cos(cz),
    /// v = (a/b) U sin(ax) cos(by) cos(cz), with a = 2 pi n/size. Along z they are the same (c = 0) if no waves are asked for.
    TaylorGreen {
        /// Largest velocity U along x [m/s].
        velocity: f64,
        /// Waves along x and y.
        #[serde(default = "one_wave")]
        waves: [u32; 2],
        /// Waves along z, which make the vortices stretch each other (Taylor and Green 1937).
        #[serde(default)]
        waves_along_z: u32,
    },
    /// Two shear layers that roll up (Minion and Brown 1997): u = U tanh((y - L_y/4)/d) in the lower half, U tanh((3 L_y/4 - y)/d) in the
    /// upper, v = p U sin(2 pi (x/L_x + 1/4)). What is too coarse for it shows false vortices between the true ones, or fails.
    ShearLayers {
        /// Velocity U on either side [m/s].
        velocity: f64,
        /// Thickness d of a layer [m]; Minion and Brown take L_y/80 and L_y/100.
        #[schemars(extend("exclusiveMinimum" = 0))]
        thickness: f64,
        /// Perturbation p of the velocity across, over U.
        #[serde(default = "one_twentieth")]
        perturbation: f64,
    },
    /// A parabola across the domain: the developed flow between two walls.
    Channel {
        /// Axis of the flow.
        flow: super::geometry::Axis,
        /// Axis from wall to wall.
        across: super::geometry::Axis,
        /// Velocity half-way between the walls [m/s].
        peak: f64,
        /// Fluctuations about the parabola, from which turbulence grows.
        #[serde(default)]
        fluctuations: Option<Fluctuations>,
    },
    /// Velocity and pressure of a field output (VTKHDF) of the same size and spacing.
    File {
        /// The file, relative to the case.
        path: PathBuf,
    },
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
