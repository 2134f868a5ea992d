//! The fluid: properties, numerical method, forcing and initial state.

use super::boundary::{Boundary, Fluctuations};
use super::darcy::Darcy;
use super::geometry::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Fluid model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fluid {
    /// Flow resolved between the grains by the lattice Boltzmann method.
    LatticeBoltzmann(LatticeBoltzmann),
    /// Seepage averaged over many grains: Darcy's law on a coarse grid, with drag on the grains.
    Darcy(Darcy),
}

/// A weakly compressible fluid on a lattice. At most one of `relaxation_time`, `time_step` and `reference_velocity` sets the time step.
/// Without them the program chooses it to meet the `accuracy` of the case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatticeBoltzmann {
    /// Reference density [kg/m3].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub density: f64,
    /// Kinematic viscosity [m2/s]. Water at 20 °C: 1e-6.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub kinematic_viscosity: f64,
    /// Velocity set of the lattice.
    #[serde(default)]
    pub lattice: LatticeChoice,
    /// Collision operator. Default: TRT; in 3-D cumulants if the program chooses the time step and the flow is too fast for TRT.
    #[serde(default)]
    pub collision: Option<Collision>,
    /// Turbulence model for eddies smaller than a cell. Default: none; if the program chooses the cell size or the time step, WALE where the
    /// Reynolds number demands it.
    #[serde(default)]
    pub turbulence: Option<TurbulenceChoice>,
    /// Relaxation time tau [1], above 0.5. The lattice viscosity is (tau - 1/2)/3 and the time step is (tau - 1/2) h²/(3 nu).
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
    /// Reference velocity in lattice units, U dt/h [1]. Required with `reference_velocity`. The Mach number is √3 times this value, because
    /// the lattice speed of sound is h/(√3 dt).
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.3))]
    pub lattice_velocity: Option<f64>,
    /// Storage precision of the populations; arithmetic is always f64. Default: f64; f32 if the program chooses the time step of a 3-D run
    /// with `draft` accuracy.
    #[serde(default)]
    pub storage: Option<Precision>,
    /// Body force that drives the fluid [N/m3], in addition to gravity.
    #[serde(default)]
    pub body_force: Option<BodyForce>,
    /// Whether gravity acts on the fluid. If not, pressure is the excess over the hydrostatic pressure, and solids have their buoyant
    /// weight.
    #[serde(default)]
    pub gravity_acts_on_fluid: bool,
    /// Initial velocity and pressure.
    #[serde(default)]
    pub initial: Initial,
    /// Boundary conditions on faces or parts of faces. All other faces that are not periodic are no-slip walls.
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

/// Collision operator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Collision {
    /// One relaxation time for all moments (Qian et al. 1992). The effective position of walls depends on tau.
    Bgk {},
    /// Two relaxation times; the position of a wall does not depend on viscosity.
    Trt {
        /// (tau+ - 1/2)(tau- - 1/2), without unit; 3/16 puts straight walls exactly half-way between nodes.
        #[serde(default = "three_sixteenths")]
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 10))]
        magic: f64,
    },
    /// Multiple relaxation times on D3Q27 (Suga et al. 2015, B-12): the shear stress relaxes at 1/tau, each other group of
    /// moments at a rate of its own. For turbulent flow.
    Mrt {
        /// s4, of the trace of the stress: the bulk viscosity is (2/9)(1/s4 - 1/2); 1.54 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        bulk: Option<f64>,
        /// Rate of all moments above the second that are not given; those of Suga without it. With 1 they go to their equilibrium at once,
        /// as other codes have it by default: a third less work in a cell.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        higher: Option<f64>,
        /// s10, of the energy flux q; 1.5 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        q: Option<f64>,
        /// s13, of Psi; 1.83 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        psi: Option<f64>,
        /// s16, of epsilon; 1.4 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        epsilon: Option<f64>,
        /// s17, of e cubed; 1.61 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        e_cubed: Option<f64>,
        /// s18, of XX and WW; 1.98 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        xx: Option<f64>,
        /// s20, of XY, YZ and ZX; 1.98 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        xy: Option<f64>,
        /// s23, of the third-order tau; 1.74 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        tau: Option<f64>,
        /// s26, of XYZ; 1.74 without it.
        #[serde(default)]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        xyz: Option<f64>,
    },
    /// Cumulants on D3Q27 (Geier et al. 2015): all moments beyond the stress go to those of a Gaussian. The most robust choice near
    /// tau = 0.5; the position of walls depends weakly on tau.
    Cumulant {
        /// Rate of the trace of the stress, which sets the bulk viscosity (2/9)(1/bulk - 1/2); 1 damps sound best.
        #[serde(default = "one")]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
        bulk: f64,
    },
}

impl Collision {
    /// Rates of the moments above the second, where they are given: q, psi, epsilon, `e_cubed`, xx, xy, tau, xyz.
    #[must_use]
    pub fn higher_rates(&self) -> [Option<f64>; 8] {
        match *self {
            Self::Mrt {
                higher,
                q,
                psi,
                epsilon,
                e_cubed,
                xx,
                xy,
                tau,
                xyz,
                ..
            } => [q, psi, epsilon, e_cubed, xx, xy, tau, xyz].map(|rate| rate.or(higher)),
            _ => [None; 8],
        }
    }

    /// Whether the moments above the second go to their equilibrium at once.
    #[must_use]
    pub fn second_order(&self) -> bool {
        self.higher_rates() == [Some(1.0); 8]
    }

    /// Whether one relaxation time holds for all that is even and one for all that is odd.
    #[must_use]
    pub fn two_times(&self) -> bool {
        matches!(self, Self::Bgk {} | Self::Trt { .. })
    }
}

fn one() -> f64 {
    1.0
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
    /// All scales are resolved.
    None,
}

/// Eddy viscosity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Turbulence {
    /// Wall-adapting local eddy viscosity (Nicoud and Ducros 1999), which vanishes in laminar shear and at walls. 3-D only.
    Wale {
        /// Model constant C_w [1]: from 0.325 in channels to 0.5 (Nicoud and Ducros 1999).
        #[serde(default = "one_half")]
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        constant: f64,
    },
    /// Smagorinsky (1963).
    Smagorinsky {
        /// Model constant C_s [1]: from 0.1 in channels to 0.18 in free turbulence.
        #[serde(default = "smagorinsky")]
        #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
        constant: f64,
    },
}

fn one_half() -> f64 {
    0.5
}

fn smagorinsky() -> f64 {
    0.17
}

fn three_sixteenths() -> f64 {
    0.1875
}

impl Default for Collision {
    fn default() -> Self {
        Self::Trt {
            magic: three_sixteenths(),
        }
    }
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
    /// At rest, at the reference density.
    Rest {},
    /// Uniform velocity and pressure.
    Uniform {
        /// Velocity [m/s].
        velocity: Vector,
        /// Pressure above the reference [Pa].
        #[serde(default)]
        pressure: f64,
    },
    /// Taylor-Green vortices with their pressure and stress: u = -U cos(ax) sin(by) cos(cz),
    /// v = (a/b) U sin(ax) cos(by) cos(cz), with a = 2 pi n/size.
    TaylorGreen {
        /// Largest velocity U along x [m/s].
        velocity: f64,
        /// Number of waves along x and y.
        #[serde(default = "one_wave")]
        waves: [u32; 2],
        /// Number of waves along z; any above zero lets the vortices stretch each other (Taylor and Green 1937).
        #[serde(default)]
        waves_along_z: u32,
    },
    /// Two shear layers that roll up (Minion and Brown 1997): u = U tanh((y - L_y/4)/d) in the lower half, U tanh((3 L_y/4 - y)/d) in the
    /// upper half, v = p U sin(2 pi (x/L_x + 1/4)). Underresolved runs show spurious vortices or fail.
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
    /// Developed flow between two walls: a parabolic profile.
    Channel {
        /// Axis of the flow.
        flow: super::geometry::Axis,
        /// Axis from wall to wall.
        across: super::geometry::Axis,
        /// Velocity at the centre of the channel [m/s].
        peak: f64,
        /// Fluctuations that trigger turbulence.
        #[serde(default)]
        fluctuations: Option<Fluctuations>,
    },
    /// Velocity and pressure of a field output (VTKHDF) of the same size and spacing.
    File {
        /// Path of the file, relative to the case.
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
