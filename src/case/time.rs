//! How long, in which steps, and what a run guards and keeps.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Duration and steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Physical time of the run [s], from the end of the warm-up.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end: f64,
    /// Steps of the grains in one step of the fluid: `auto` is the smallest number that keeps the solid time
    /// step below `solid_time_step_safety` times the critical one.
    #[serde(default)]
    pub solid_steps_per_fluid_step: SolidSteps,
    /// Time step of the grains [s] where there is no fluid; without it the safety times the critical one.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub solid_time_step: Option<f64>,
    /// Largest solid time step allowed, as a fraction of the critical one 2 sqrt(m/k) of the lightest grain, of elastic spheres
    /// the shorter one of that and Rayleigh's time. A grain has several contacts: beyond about 0.2 the plan looks at them one by one.
    #[serde(default = "default_safety")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub solid_time_step_safety: f64,
    /// How far beyond contact lists of neighbours reach, over the mean radius of the grains: with more they are made less often and are
    /// longer. No result depends on it.
    #[serde(default = "default_skin")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 4))]
    pub neighbour_skin: f64,
    /// What happens before the clock starts.
    #[serde(default)]
    pub warm_up: Option<WarmUp>,
}

// Of 0.003 to 2, on spheres at rest and in a fast flow (benches/accuracy/neighbour-skin): at rest 0.2 to 1 cost the same.
fn default_skin() -> f64 {
    0.5
}

fn default_safety() -> f64 {
    0.1
}

/// Steps of the grains in one step of the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum SolidSteps {
    /// This many.
    Number(#[schemars(range(min = 1, max = 100_000))] u32),
    /// As many as stability needs.
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
    /// Chosen by the program.
    Auto,
}

/// What happens before the clock starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WarmUp {
    /// The fluid flows round the grains held in place until it is steady.
    FluidOnly {
        /// Steady when the velocity changes by less than this fraction of itself in 100 steps.
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        relative_change: f64,
        /// Ends after this time in any case [s].
        #[schemars(extend("exclusiveMinimum" = 0))]
        at_most: f64,
    },
}

/// Checkpoints: places from which a run can go on, on any number of ranks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Checkpoint {
    /// Physical time between checkpoints [s], written at the steps nearest to its multiples and at the end of the run; none of this
    /// kind without it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    /// Wall-clock time between checkpoints [s]; 0 for none of this kind.
    #[schemars(range(min = 0.0))]
    pub every_wall_seconds: f64,
    /// How many of the newest stay on disk.
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

/// Limits whose crossing ends the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Guards {
    /// Fluid steps between two looks at every cell and grain for values that are not finite and the limits below.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub check_every_steps: u32,
    /// Largest velocity over the lattice speed C = h/dt (A-06: the paper's Mach number), without unit.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.5))]
    pub max_mach: f64,
    /// Compression |rho/rho_0 - 1| of the lattice fluid above which the run warns, without unit. The error of the pressure and of the
    /// continuity of the flow is of this size.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub warn_compression: f64,
    /// Compression |rho/rho_0 - 1| of the lattice fluid above which the run ends (exit code 4) and a plan is refused, without unit. Cells
    /// that bodies shut in are left out: bodies that move squeeze them. Beside the corner of a fast lid it may be more than the default.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub max_compression: f64,
    /// Memory of all machines of the run together [GiB]; without it that of this machine.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub memory_gib: Option<f64>,
    /// What a limit of the method that the plan finds crossed (Mach number, density change, cells in a diameter, time step of the
    /// grains) means before the run.
    pub limits: Limits,
}

/// What a crossed limit means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Limits {
    /// Nothing is run.
    #[default]
    Refuse,
    /// A warning, for studies of where the limits are.
    Warn,
}

impl Default for Guards {
    fn default() -> Self {
        Self {
            check_every_steps: 100,
            max_mach: 0.3,
            warn_compression: 0.05,
            max_compression: 0.2,
            memory_gib: None,
            limits: Limits::Refuse,
        }
    }
}
