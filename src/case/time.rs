//! Duration, time steps, checkpoints and guards.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Duration and time steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Physical end time [s], counted from the end of the warm-up.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
    /// Solid steps per fluid step. `auto` is the smallest number that keeps the solid time step below
    /// `solid_time_step_safety` times the critical time step.
    #[serde(default)]
    pub solid_steps_per_fluid_step: SolidSteps,
    /// Solid time step [s] of a case without fluid. Default: `solid_time_step_safety` times the critical time step.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub solid_time_step: Option<f64>,
    /// Ratio of the largest solid time step to the critical time step [1]. The critical time step is 2 sqrt(m/k) of the
    /// lightest grain; for Hertz-Mindlin contacts it is the smaller of this value and the Rayleigh time. Above about
    /// 0.2 the plan checks every grain with all of its contacts.
    #[serde(default = "default_safety")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub solid_time_step_safety: f64,
    /// Ratio of the skin of the neighbour lists to the mean grain radius [1]. A larger skin gives longer lists that are
    /// rebuilt less often. Results do not depend on it.
    #[serde(default = "default_skin")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 4))]
    pub neighbour_skin: f64,
    /// Warm-up before time 0. Default: none.
    #[serde(default)]
    pub warm_up: Option<WarmUp>,
}

// Among values from 0.003 to 2, for stationary spheres and in a fast flow (benches/accuracy/neighbour-skin): for
// stationary spheres 0.2 to 1 cost the same.
fn default_skin() -> f64 {
    0.5
}

/// Default of the largest solid time step over the critical one.
pub const USUAL_SAFETY: f64 = 0.1;

fn default_safety() -> f64 {
    USUAL_SAFETY
}

/// Solid steps per fluid step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum SolidSteps {
    /// A fixed number.
    Number(#[schemars(range(min = 1, max = 100_000))] u32),
    /// Number that stability requires.
    Auto(Auto),
}

impl Default for SolidSteps {
    fn default() -> Self {
        Self::Auto(Auto::Auto)
    }
}

/// The word `auto`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Auto {
    /// Number chosen by the program.
    Auto,
}

/// Warm-up before time 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WarmUp {
    /// The fluid flows around fixed grains until it is steady.
    FluidOnly {
        /// Relative change of the velocity in 100 steps below which the flow counts as steady [1].
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        relative_change: f64,
        /// Longest duration of the warm-up [s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        at_most: f64,
    },
}

/// Checkpoints, from which a run can restart on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Checkpoint {
    /// Physical time between checkpoints [s], written at the steps nearest to its multiples and at the end of the run.
    /// Default: no checkpoints by physical time.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    /// Wall-clock time between checkpoints [s]. 0 turns them off.
    #[schemars(range(min = 0.0))]
    pub every_wall_seconds: f64,
    /// Number of checkpoints that are kept, the newest ones.
    #[schemars(range(min = 2, max = 1000))]
    pub keep: u32,
}

impl Default for Checkpoint {
    fn default() -> Self {
        Self {
            every: None,
            every_wall_seconds: 600.0,
            keep: 2,
        }
    }
}

/// Limits that end the run when they are exceeded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Guards {
    /// Fluid steps between two checks of every cell and grain for non-finite values and for the limits below.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub check_every_steps: u32,
    /// Largest velocity in lattice units, |u| dt/h [1]. The Mach number is √3 times this value.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.5))]
    pub max_lattice_velocity: f64,
    /// Compression |rho/rho_0 - 1| of the lattice fluid above which the run warns [1]. The errors in pressure and
    /// mass conservation, relative to incompressible flow, are of this size.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub warn_compression: f64,
    /// Compression |rho/rho_0 - 1| of the lattice fluid above which the run ends (exit code 4) and the plan is refused
    /// [1]. Cells enclosed by bodies are excluded, because moving bodies compress them. Corners of fast lid-driven
    /// flows may need more than the default.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub max_compression: f64,
    /// Overlap of a contact, relative to the radius of the smaller body, above which the run ends (exit code 4) [1].
    /// The radius of a polyhedron is the distance from its centroid to the nearest face. Every solid step counts. At 1
    /// the centre of a body has reached the surface of the other: it passes through a thin wall.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub max_overlap: f64,
    /// Memory of all nodes of the run together [GiB]. Default: the memory of this node.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory_gib: Option<f64>,
    /// Consequence of a limit of the method that the plan finds exceeded: lattice velocity, density change, cells per
    /// diameter, solid time step.
    pub limits: Limits,
}

/// Consequence of an exceeded limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Limits {
    /// The case is refused.
    #[default]
    Refuse,
    /// The case runs with a warning, for studies of the limits.
    Warn,
}

impl Default for Guards {
    fn default() -> Self {
        Self {
            check_every_steps: 100,
            max_lattice_velocity: 0.3,
            warn_compression: 0.05,
            max_compression: 0.2,
            max_overlap: 0.5,
            memory_gib: None,
            limits: Limits::Refuse,
        }
    }
}
