//! The fluid of a scene: time step, forces, and a complete set of conditions on the six faces.

use super::block::Block;
use super::findings::{Findings, at_least, at_most, number};
use super::grid::{Grid, count, whole};
use super::profile::Table;
use crate::case::Case;
use crate::case::boundary::{Condition as Written, Fluctuations, VelocityProfile as Profile};
use crate::case::coupling::{PartiallySaturated, SolidOperator};
use crate::case::fluid::{
    self, Collision, LatticeBoltzmann, LatticeChoice, Precision, Turbulence, TurbulenceChoice,
};
use crate::case::geometry::Face;
use crate::error::Remedy;
use crate::units::LatticeUnits;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Where the lattice Boltzmann part of a case stands.
pub(crate) const PATH: &str = "fluid.lattice_boltzmann";
/// From this relaxation time on, without eddies, flow is slow enough for the matched operator: its cells resist by viscosity alone.
const SLOW: f64 = 0.52;

/// A resolved lattice Boltzmann fluid, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flow {
    /// Density at rest [kg/m3].
    pub density: f64,
    /// Kinematic viscosity [m2/s].
    pub kinematic_viscosity: f64,
    /// Velocity set.
    pub lattice: Lattice,
    /// Collision operator.
    pub collision: Collision,
    /// Eddy viscosity.
    pub turbulence: Option<Turbulence>,
    /// Number type of the populations at rest.
    pub storage: Precision,
    /// Time step [s].
    pub time_step: f64,
    /// Relaxation time tau.
    pub relaxation_time: f64,
    /// Which field of the case fixed the time step; `accuracy` where it was chosen.
    pub fixed_by: &'static str,
    /// Force per volume beside gravity.
    pub body_force: BodyForce,
    /// Whether gravity acts on the fluid.
    pub gravity_acts: bool,
    /// Fluid at the start.
    pub initial: Initial,
    /// Conditions of the faces, by [`Face::index`]. Each face that is not periodic has at least one patch, the first
    /// covers all of it, and later patches outweigh earlier ones. A periodic face, or one along z in 2-D, has none.
    pub faces: [Vec<Patch>; 6],
}

/// Velocity set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Lattice {
    /// Nine velocities in 2-D.
    D2q9,
    /// Nineteen velocities in 3-D.
    D3q19,
    /// Twenty-seven velocities in 3-D.
    D3q27,
}

impl Lattice {
    /// Number of velocities.
    #[must_use]
    pub fn velocities(self) -> usize {
        match self {
            Self::D2q9 => 9,
            Self::D3q19 => 19,
            Self::D3q27 => 27,
        }
    }
}

/// Force per volume [N/m3].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum BodyForce {
    /// The same at all times; may be zero.
    Constant([f64; 3]),
    /// amplitude cos(2 pi t/period + phase).
    Oscillating {
        /// Largest force [N/m3].
        amplitude: [f64; 3],
        /// Period [s].
        period: f64,
        /// Phase at the start [rad].
        phase: f64,
    },
}

impl BodyForce {
    /// The force at a time [s].
    #[must_use]
    pub fn at(&self, time: f64) -> [f64; 3] {
        match self {
            Self::Constant(force) => *force,
            Self::Oscillating {
                amplitude,
                period,
                phase,
            } => {
                let factor = (std::f64::consts::TAU * time / period + phase).cos();
                amplitude.map(|a| a * factor)
            }
        }
    }

    /// The largest force at any time.
    #[must_use]
    pub fn largest(&self) -> [f64; 3] {
        match self {
            Self::Constant(force) => *force,
            Self::Oscillating { amplitude, .. } => *amplitude,
        }
    }
}

/// The fluid at the start, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Initial {
    /// One velocity [m/s] and pressure [Pa] everywhere; zero at rest.
    Uniform {
        /// Velocity [m/s].
        velocity: [f64; 3],
        /// Pressure above the reference [Pa].
        pressure: f64,
    },
    /// Taylor-Green vortices: u = -U cos(ax) sin(by) cos(cz), v = (a/b) U sin(ax) cos(by) cos(cz).
    TaylorGreen {
        /// U [m/s].
        velocity: f64,
        /// a, b and c [1/m]; c may be zero.
        wave_numbers: [f64; 3],
    },
    /// Shear layers at a quarter and three quarters of y, that repeat along x and y.
    ShearLayers {
        /// U on either side [m/s].
        velocity: f64,
        /// Thickness of a layer [m].
        thickness: f64,
        /// Velocity across over U.
        perturbation: f64,
    },
    /// A parabola between the walls of one axis.
    Channel {
        /// Axis of the flow: 0, 1 or 2.
        flow: usize,
        /// Axis from wall to wall: 0, 1 or 2.
        across: usize,
        /// Velocity in the middle [m/s].
        peak: f64,
        /// Fluctuations about it.
        fluctuations: Option<Fluctuations>,
    },
    /// From a file.
    File(PathBuf),
}

/// A condition on the cells next to a part of a face.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Patch {
    /// Name in the case; that of the face for a wall nobody named.
    pub name: String,
    /// The face.
    pub face: Face,
    /// First cell along each axis; 0 along the normal.
    pub from: [usize; 3],
    /// One past the last cell along each axis; 1 along the normal.
    pub to: [usize; 3],
    /// What holds there.
    pub condition: Condition,
    /// Position in the list of boundaries of the case; none for a wall nobody named.
    pub index: Option<usize>,
}

/// What the fluid does at a patch, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Condition {
    /// A wall at rest.
    NoSlip,
    /// A wall that slides with this velocity [m/s].
    MovingWall([f64; 3]),
    /// A plane of symmetry.
    FreeSlip,
    /// Velocity imposed.
    Velocity {
        /// The profile.
        profile: VelocityProfile,
        /// It grows linearly from zero over this time [s]; 0 for at once.
        ramp_time: f64,
        /// What fluctuates about the profile.
        turbulence: Option<Fluctuations>,
    },
    /// Pressure imposed: from `from` linearly to `value` [Pa] over `ramp_time` [s]; 0 for at once.
    Pressure {
        /// Final pressure above the reference [Pa].
        value: f64,
        /// Pressure at the start [Pa].
        from: f64,
        /// Time of the change [s].
        ramp_time: f64,
    },
    /// No gradient along the normal.
    Outflow,
    /// Carried out with this velocity [m/s]; without one with that of the fluid.
    ConvectiveOutflow(Option<f64>),
}

/// A velocity over a patch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum VelocityProfile {
    /// The same everywhere [m/s].
    Uniform([f64; 3]),
    /// A parabola along the inward normal with this peak [m/s], zero at the edges of the patch.
    Parabolic(f64),
    /// From a CSV file.
    File(Table),
}

impl Flow {
    /// What solids do to the cells that they cover: as written, or by the relaxation time.
    #[must_use]
    pub fn solid_operator(&self, written: &PartiallySaturated) -> SolidOperator {
        let slow =
            self.collision.two_times() && self.turbulence.is_none() && self.relaxation_time >= SLOW;
        written.solid_operator.unwrap_or(if slow {
            SolidOperator::ViscosityMatched
        } else {
            SolidOperator::NonEquilibriumBounceBack
        })
    }

    /// The scales of the lattice.
    #[must_use]
    pub fn units(&self, grid: &Grid) -> LatticeUnits {
        LatticeUnits {
            spacing: grid.spacing,
            time_step: self.time_step,
            density: self.density,
            dimension: grid.dimension,
        }
    }

    /// All patches of all faces.
    pub fn patches(&self) -> impl Iterator<Item = &Patch> {
        self.faces.iter().flatten()
    }

    pub(crate) fn resolve(case: &Case, grid: &Grid, findings: &mut Findings) -> Option<Self> {
        let Some(fluid::Fluid::LatticeBoltzmann(lbm)) = &case.fluid else {
            return None;
        };
        let lattice = lattice(lbm, grid, findings);
        let body_force = body_force(lbm, grid, findings);
        let initial = initial(lbm, grid, &case.directory, findings);
        let faces = faces(lbm, grid, &case.directory, findings);
        let gravity = case.gravity.as_ref().map_or([0.0; 3], |g| g.to_array());
        if lbm.gravity_acts_on_fluid && gravity.iter().all(|g| *g == 0.0) {
            findings.warn(
                &format!("{PATH}.gravity_acts_on_fluid"),
                "there is no gravity in this case",
                Remedy::from("add `gravity`, or leave this out")
                    .set(format!("{PATH}.gravity_acts_on_fluid"), false),
            );
        }
        let (time_step, fixed_by) = time_step(lbm, grid, findings)?;
        let units = LatticeUnits {
            spacing: grid.spacing,
            time_step,
            density: lbm.density,
            dimension: grid.dimension,
        };
        // Taken as written where it is written, so that tau is not the victim of rounding.
        let relaxation_time = lbm
            .relaxation_time
            .unwrap_or_else(|| units.relaxation_time(lbm.kinematic_viscosity));
        // A relaxation time that is only chosen later is judged then.
        if fixed_by != "accuracy" {
            growing_waves(lbm, relaxation_time, findings);
        }
        Some(Self {
            density: lbm.density,
            kinematic_viscosity: lbm.kinematic_viscosity,
            lattice,
            collision: lbm.collision.unwrap_or_default(),
            turbulence: lbm.turbulence.and_then(TurbulenceChoice::model),
            storage: lbm.storage.unwrap_or_default(),
            time_step,
            relaxation_time,
            fixed_by,
            body_force,
            gravity_acts: lbm.gravity_acts_on_fluid,
            initial,
            faces,
        })
    }
}

fn lattice(lbm: &LatticeBoltzmann, grid: &Grid, findings: &mut Findings) -> Lattice {
    let multiple = match lbm.collision {
        Some(Collision::Mrt { .. }) => Some("mrt"),
        Some(Collision::Cumulant { .. }) => Some("cumulant"),
        _ => None,
    };
    let (lattice, dimension) = match lbm.lattice {
        LatticeChoice::Auto if grid.dimension == 2 => (Lattice::D2q9, 2),
        LatticeChoice::Auto if multiple.is_some() => (Lattice::D3q27, 3),
        LatticeChoice::Auto => (Lattice::D3q19, 3),
        LatticeChoice::D2q9 => (Lattice::D2q9, 2),
        LatticeChoice::D3q19 => (Lattice::D3q19, 3),
        LatticeChoice::D3q27 => (Lattice::D3q27, 3),
    };
    if dimension != grid.dimension {
        findings.error(
            &format!("{PATH}.lattice"),
            format!(
                "this is a {dimension}-D lattice in a {}-D domain",
                grid.dimension
            ),
            Remedy::from("use auto").set(format!("{PATH}.lattice"), "auto"),
        );
    }
    if let Some(name) = multiple
        && lattice != Lattice::D3q27
    {
        findings.error(
            &format!("{PATH}.collision.{name}"),
            "the moments of this operator are those of D3Q27",
            if grid.dimension == 2 {
                Remedy::from("use trt in 2-D").set(format!("{PATH}.collision"), json!({"trt": {}}))
            } else {
                Remedy::from("use the lattice d3q27 or auto, or the collision trt")
                    .set(format!("{PATH}.lattice"), "auto")
            },
        );
    }
    if grid.dimension == 2
        && matches!(
            lbm.turbulence,
            Some(TurbulenceChoice::Model(Turbulence::Wale { .. }))
        )
    {
        findings.error(
            &format!("{PATH}.turbulence.wale"),
            "WALE is made for turbulence, which is 3-D; in 2-D it is not zero in laminar flow",
            Remedy::from("use smagorinsky, or a domain in 3-D")
                .set(format!("{PATH}.turbulence"), json!({"smagorinsky": {}})),
        );
    }
    lattice
}

/// From this relaxation time on the operator with the rates of Suga lets waves of three cells along the diagonals grow in water at
/// rest: by 0.06 % in a step at 0.56, 1 % at 0.6, 5 % at 0.8 (largest eigenvalue over all wave vectors, 16 in half a period).
pub const SUGA_GROWS: f64 = 0.556;
/// From here on runs were seen to fail of it: boxes without walls at 0.8, ducts at 0.75, under a lid at 0.7, not at 0.65.
const SUGA_FAILS: f64 = 0.7;
/// Below this one the operator with all moments above the second at their equilibrium lets waves grow at rest: by 0.9 % in a step at
/// 0.51. Runs held all the same (`benches/stability/cavity-3d-20`).
const SECOND_ORDER_GROWS: f64 = 0.52;

/// Whether waves grow by themselves with the rates of multiple relaxation times.
pub(super) fn growing_waves(lbm: &LatticeBoltzmann, tau: f64, findings: &mut Findings) {
    let Some(collision @ Collision::Mrt { .. }) = &lbm.collision else {
        return;
    };
    let path = format!("{PATH}.collision.mrt");
    let at = format!("the relaxation time is tau = {}", number(tau));
    if collision.second_order() {
        if tau < SECOND_ORDER_GROWS {
            findings.warn(
                &path,
                format!("{at}: below {SECOND_ORDER_GROWS} short waves grow slowly in water at rest with the higher moments at 1"),
                Remedy::from("look at the flow for waves of a few cells, or use cumulant")
                    .set(format!("{PATH}.collision"), json!({"cumulant": {}})),
            );
        }
    } else if collision.higher_rates() == [None; 8] && tau >= SUGA_GROWS {
        let reason = format!(
            "{at}: with the rates of Suga, made for tau near 1/2, waves of three cells grow by themselves from {SUGA_GROWS} on"
        );
        let remedy = Remedy::from(format!(
            "use trt or cumulant, or `higher`: 1, or a tau below {SUGA_GROWS}"
        ))
        .set(format!("{PATH}.collision"), json!({"trt": {}}));
        if tau >= SUGA_FAILS {
            findings.unstable(
                &path,
                format!("{reason}, and runs failed from {SUGA_FAILS} on"),
                remedy,
            );
        } else {
            findings.warn(&path, reason, remedy);
        }
    }
}

/// The time step from whichever of the three ways the case uses; with none of them one that holds the place of that which is
/// chosen once the speeds are known.
fn time_step(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    findings: &mut Findings,
) -> Option<(f64, &'static str)> {
    let ways = [
        ("relaxation_time", lbm.relaxation_time),
        ("time_step", lbm.time_step),
        ("reference_velocity", lbm.reference_velocity),
    ];
    let given: Vec<&'static str> = ways
        .iter()
        .filter(|(_, value)| value.is_some())
        .map(|(name, _)| *name)
        .collect();
    if lbm.lattice_velocity.is_some() != lbm.reference_velocity.is_some() {
        let missing = if lbm.lattice_velocity.is_some() {
            "reference_velocity"
        } else {
            "lattice_velocity"
        };
        findings.error(
            &format!("{PATH}.{missing}"),
            "`reference_velocity` and `lattice_velocity` fix the time step together",
            if lbm.lattice_velocity.is_some() {
                Remedy::take_out(
                    format!("add `{missing}`, or leave `lattice_velocity` out"),
                    &format!("{PATH}.lattice_velocity"),
                )
            } else {
                Remedy::from(format!(
                    "add `{missing}` (for example 0.05), or leave both out"
                ))
                .set(format!("{PATH}.lattice_velocity"), 0.05)
            },
        );
        if given.is_empty() || missing == "lattice_velocity" {
            return None;
        }
    }
    let (h, nu) = (grid.spacing, lbm.kinematic_viscosity);
    let name = match given[..] {
        [] => return Some((LatticeUnits::time_step_for(1.0, h, nu), "accuracy")),
        [name] => name,
        [_, second, ..] => {
            findings.error(
                &format!("{PATH}.{second}"),
                format!(
                    "one of relaxation_time, time_step and reference_velocity fixes the time step, but {} are given",
                    given.join(" and ")
                ),
                {
                    let remedy = Remedy::from(
                        "keep one of them, or none: the program then chooses the time step",
                    );
                    let others = given[1..].iter().copied();
                    let more = lbm.lattice_velocity.is_some().then_some("lattice_velocity");
                    others.chain(more).fold(remedy, |remedy, name| {
                        remedy.set(format!("{PATH}.{name}"), serde_json::Value::Null)
                    })
                },
            );
            return None;
        }
    };
    let path = format!("{PATH}.{name}");
    let dt = match (
        lbm.relaxation_time,
        lbm.time_step,
        lbm.reference_velocity,
        lbm.lattice_velocity,
    ) {
        (Some(tau), ..) => LatticeUnits::time_step_for(tau, h, nu),
        (_, Some(dt), ..) => dt,
        (.., Some(velocity), Some(lattice_velocity)) => lattice_velocity * h / velocity,
        _ => return None,
    };
    if let Some(tau) = lbm.relaxation_time
        && tau <= 0.5
    {
        findings.error(
            &path,
            "the viscosity on the lattice is (tau - 1/2)/3 and must be positive: tau must be above 0.5",
            Remedy::from("use 0.51 to 2, for example 0.8").set(&*path, 0.8),
        );
        return None;
    }
    let tau = 0.5 + 3.0 * nu * dt / (h * h);
    if !(dt.is_finite() && dt > 0.0 && tau.is_finite()) {
        findings.error(
            &path,
            "no finite time step follows from this",
            "check the units of viscosity and spacing",
        );
        return None;
    }
    if tau <= 0.5 + 1e-12 || tau > 1e3 {
        findings.error(
            &path,
            format!(
                "the relaxation time becomes tau = {tau:.6e}; it must be above 0.5 and below 1000"
            ),
            of_time(
                lbm,
                format!(
                    "use a time step of {} … {} s at this spacing and viscosity",
                    number(0.01 * h * h / (3.0 * nu)),
                    number(0.5 * h * h / nu)
                ),
                at_most(0.1 * h * h / nu),
            ),
        );
        return None;
    }
    if tau > 2.0 {
        findings.warn(
            &path,
            format!(
                "the relaxation time is tau = {}: large values cost accuracy",
                number(tau)
            ),
            of_time(
                lbm,
                format!("use a time step below {} s", number(0.5 * h * h / nu)),
                at_most(0.49 * h * h / nu),
            ),
        );
    }
    Some((dt, name))
}

/// Proposes a time step instead of whatever fixes it.
fn of_time(lbm: &LatticeBoltzmann, text: String, time_step: f64) -> Remedy {
    let null = serde_json::Value::Null;
    let mut remedy = Remedy::from(text);
    for (name, given) in [
        ("relaxation_time", lbm.relaxation_time),
        ("reference_velocity", lbm.reference_velocity),
        ("lattice_velocity", lbm.lattice_velocity),
    ] {
        if given.is_some() {
            remedy = remedy.set(format!("{PATH}.{name}"), null.clone());
        }
    }
    remedy.set(format!("{PATH}.time_step"), time_step)
}

fn body_force(lbm: &LatticeBoltzmann, grid: &Grid, findings: &mut Findings) -> BodyForce {
    let path = format!("{PATH}.body_force");
    match &lbm.body_force {
        None => BodyForce::Constant([0.0; 3]),
        Some(fluid::BodyForce::Constant(force)) => BodyForce::Constant(Block::vector(
            grid,
            force,
            &format!("{path}.constant"),
            findings,
        )),
        Some(fluid::BodyForce::Oscillating {
            amplitude,
            period,
            phase_degrees,
        }) => BodyForce::Oscillating {
            amplitude: Block::vector(
                grid,
                amplitude,
                &format!("{path}.oscillating.amplitude"),
                findings,
            ),
            period: *period,
            phase: phase_degrees.to_radians(),
        },
    }
}

fn initial(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    directory: &Path,
    findings: &mut Findings,
) -> Initial {
    let path = format!("{PATH}.initial");
    match &lbm.initial {
        fluid::Initial::Rest {} => Initial::Uniform {
            velocity: [0.0; 3],
            pressure: 0.0,
        },
        fluid::Initial::Uniform { velocity, pressure } => Initial::Uniform {
            velocity: Block::vector(
                grid,
                velocity,
                &format!("{path}.uniform.velocity"),
                findings,
            ),
            pressure: *pressure,
        },
        fluid::Initial::TaylorGreen {
            velocity,
            waves,
            waves_along_z,
        } => {
            if waves.contains(&0) {
                findings.error(
                    &format!("{path}.taylor_green.waves"),
                    "at least one wave is needed along each axis",
                    Remedy::from("write for example [1, 1]")
                        .set(format!("{path}.taylor_green.waves"), json!([1, 1])),
                );
            }
            if !(grid.periodic[0] && grid.periodic[1]) {
                findings.error(
                    &format!("{path}.taylor_green"),
                    "the vortices repeat along x and y, but the domain does not",
                    Remedy::from("write \"periodic\": [\"x\", \"y\"] in the domain")
                        .set("domain.periodic", json!(["x", "y"])),
                );
            }
            if *waves_along_z > 0 && !(grid.dimension == 3 && grid.periodic[2]) {
                findings.error(
                    &format!("{path}.taylor_green.waves_along_z"),
                    "the waves repeat along z, but the domain does not",
                    "make the domain 3-D and periodic along z, or leave this out",
                );
            }
            let wave = |axis: usize, waves: u32| {
                std::f64::consts::TAU * f64::from(waves) / grid.size[axis]
            };
            let along_z = if grid.dimension == 3 {
                wave(2, *waves_along_z)
            } else {
                0.0
            };
            Initial::TaylorGreen {
                velocity: *velocity,
                wave_numbers: [wave(0, waves[0]), wave(1, waves[1]), along_z],
            }
        }
        fluid::Initial::ShearLayers {
            velocity,
            thickness,
            perturbation,
        } => {
            if !(grid.periodic[0] && grid.periodic[1]) {
                findings.error(
                    &format!("{path}.shear_layers"),
                    "the layers repeat along x and y, but the domain does not",
                    Remedy::from("write \"periodic\": [\"x\", \"y\"] in the domain")
                        .set("domain.periodic", json!(["x", "y"])),
                );
            }
            Initial::ShearLayers {
                velocity: *velocity,
                thickness: *thickness,
                perturbation: *perturbation,
            }
        }
        fluid::Initial::Channel {
            flow,
            across,
            peak,
            fluctuations,
        } => {
            if let Some(fluctuations) = fluctuations {
                resolved(
                    fluctuations,
                    grid,
                    &format!("{path}.channel.fluctuations"),
                    findings,
                );
            }
            let (flow, across) = (flow.index(), across.index());
            if flow == across || flow.max(across) >= grid.dimension {
                findings.error(
                    &format!("{path}.channel"),
                    "the flow and the direction across it must be two different axes of the domain",
                    "write for example \"flow\": \"x\", \"across\": \"y\"",
                );
            }
            Initial::Channel {
                flow,
                across,
                peak: *peak,
                fluctuations: *fluctuations,
            }
        }
        fluid::Initial::File { path: file } => {
            let file = directory.join(file);
            if let Err(reason) = holds_fields(&file, grid) {
                findings.error(
                    &format!("{path}.file.path"),
                    reason,
                    "name a field output (fluid_*.vtkhdf) of a run with the same cells; the path is relative to the case",
                );
            }
            Initial::File(file)
        }
    }
}

/// Eddies smaller than a few cells cannot live on the lattice.
fn resolved(fluctuations: &Fluctuations, grid: &Grid, path: &str, findings: &mut Findings) {
    let least = 2.0 * grid.spacing;
    if fluctuations.length_scale < least {
        findings.error(
            &format!("{path}.length_scale"),
            format!(
                "eddies of this length fall between the cells, which are {} m wide",
                number(grid.spacing)
            ),
            Remedy::from(format!(
                "use at least {}, or a finer spacing",
                at_least(least)
            ))
            .set(format!("{path}.length_scale"), at_least(least)),
        );
    }
}

/// Turbulence enters with the mean flow; a table is asked once its patch is known.
fn carried_in(profile: &Profile, face: Face, path: &str, findings: &mut Findings) {
    let inflow = match profile {
        Profile::Uniform(velocity) => {
            let inward = face.inward();
            let parts = velocity.0.iter().zip(inward);
            parts.map(|(u, n)| u * n).sum()
        }
        Profile::Parabolic { peak } => *peak,
        Profile::File { .. } => return,
    };
    if inflow <= 0.0 {
        findings.error(path, OUTWARD, TURN_ROUND);
    }
}

/// Whether a file holds velocity and pressure of every cell; only its headers are read.
fn holds_fields(file: &Path, grid: &Grid) -> Result<(), String> {
    for (name, components) in [("velocity", 3), ("pressure", 1)] {
        let shape = io::fields::column_shape(file, name).map_err(|e| e.to_string())?;
        let numbers = shape.iter().try_fold(1_usize, |all, n| all.checked_mul(*n));
        if numbers != grid.cell_count().checked_mul(components) {
            return Err(format!(
                "{}: `{name}` has the shape {shape:?}, which is not that of {:?} cells",
                file.display(),
                grid.cells
            ));
        }
    }
    Ok(())
}

/// Mean velocity of a table into the domain over the cells of a patch [m/s]; none where it is not worth the time.
fn mean_inflow(table: &Table, patch: &Patch, grid: &Grid) -> Option<f64> {
    let (axis, inward) = (patch.face.axis(), patch.face.inward());
    let cells = (0..3).map(|a| patch.to[a].saturating_sub(patch.from[a]));
    let cells = cells.fold(1, usize::saturating_mul);
    let looks = if grid.dimension == 2 { 20 } else { table.len() };
    if cells.saturating_mul(looks) > MOST_LOOKS || cells == 0 {
        return None;
    }
    let mut sum = 0.0;
    for z in patch.from[2]..patch.to[2] {
        for y in patch.from[1]..patch.to[1] {
            for x in patch.from[0]..patch.to[0] {
                let centre = grid.centre([x, y, z]);
                let across: Vec<f64> = (0..grid.dimension)
                    .filter(|&a| a != axis)
                    .map(|a| centre[a])
                    .collect();
                let u = table.at(&across);
                sum += (0..3).map(|a| u[a] * inward[a]).sum::<f64>();
            }
        }
    }
    Some(sum / count(cells))
}

/// Rows of a profile that are looked at before the run, at most.
const MOST_LOOKS: usize = 20_000_000;

/// Turbulence enters with the mean flow, that of a table too.
fn tables_flow_in(faces: &[Vec<Patch>; 6], grid: &Grid, findings: &mut Findings) {
    for patch in faces.iter().flatten() {
        let (
            Some(n),
            Condition::Velocity {
                profile: VelocityProfile::File(table),
                turbulence: Some(_),
                ..
            },
        ) = (patch.index, &patch.condition)
        else {
            continue;
        };
        if !table.is_empty() && mean_inflow(table, patch, grid).is_some_and(|mean| mean <= 0.0) {
            findings.error(
                &format!("{PATH}.boundaries[{n}].condition.velocity.turbulence"),
                OUTWARD,
                TURN_ROUND,
            );
        }
    }
}

const OUTWARD: &str =
    "turbulence is carried in by the mean flow, but this profile does not flow into the domain";
const TURN_ROUND: &str = "turn the profile round, or take the turbulence out";

fn faces(
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    directory: &Path,
    findings: &mut Findings,
) -> [Vec<Patch>; 6] {
    let mut faces: [Vec<Patch>; 6] = Default::default();
    for face in Face::ALL {
        if face.axis() < grid.dimension && !grid.periodic[face.axis()] {
            let (from, to) = whole_face(grid, face);
            faces[face.index()].push(Patch {
                name: face.name().into(),
                face,
                from,
                to,
                condition: Condition::NoSlip,
                index: None,
            });
        }
    }
    let mut named = [false; 6];
    let mut names: Vec<&str> = Vec::new();
    for (n, boundary) in lbm.boundaries.iter().enumerate() {
        let path = format!("{PATH}.boundaries[{n}]");
        let face = boundary.face;
        super::unique(
            &mut names,
            &boundary.name,
            &format!("{path}.name"),
            findings,
        );
        let condition = condition(&boundary.condition, face, grid, directory, &path, findings);
        if face.axis() >= grid.dimension {
            findings.error(
                &format!("{path}.face"),
                "there is no such face in a 2-D problem",
                "take this condition out",
            );
            continue;
        }
        if grid.periodic[face.axis()] {
            let axis = ["x", "y", "z"][face.axis()];
            findings.error(
                &format!("{path}.face"),
                format!("the domain is periodic along {axis}: this face has no condition"),
                format!("take this condition out, or {axis} out of domain.periodic"),
            );
            continue;
        }
        let Some(extent) = &boundary.patch else {
            if std::mem::replace(&mut named[face.index()], true) {
                findings.error(
                    &format!("{path}.face"),
                    format!("the whole face {} has two conditions", face.name()),
                    "keep one, or give one of them a patch",
                );
            }
            let base = &mut faces[face.index()][0];
            base.name.clone_from(&boundary.name);
            base.condition = condition;
            base.index = Some(n);
            continue;
        };
        let patch_path = format!("{path}.patch");
        let block = tangential(grid, face, extent, &patch_path, findings);
        let (mut from, mut to) = whole_face(grid, face);
        for a in (0..grid.dimension).filter(|a| *a != face.axis()) {
            // A cell belongs to a patch if its centre does.
            from[a] = whole((block.from[a] / grid.spacing - 0.5).ceil()).min(grid.cells[a]);
            to[a] = whole((block.to[a] / grid.spacing - 0.5).ceil()).min(grid.cells[a]);
            if from[a] >= to[a] && block.from[a] < block.to[a] {
                findings.error(
                    &patch_path,
                    "the patch holds the centre of no cell",
                    "make it larger, or the spacing finer",
                );
            }
        }
        let overlaps = faces[face.index()][1..]
            .iter()
            .find(|other| (0..3).all(|a| other.from[a] < to[a] && from[a] < other.to[a]));
        if let Some(other) = overlaps {
            findings.error(
                &patch_path,
                format!("this patch overlaps the patch of `{}`", other.name),
                "make them share no cell",
            );
        }
        faces[face.index()].push(Patch {
            name: boundary.name.clone(),
            face,
            from,
            to,
            condition,
            index: Some(n),
        });
    }
    closed_volume(&faces, grid, findings);
    tables_flow_in(&faces, grid, findings);
    faces
}

/// The box of a patch; what it says along the normal does not matter.
fn tangential(
    grid: &Grid,
    face: Face,
    extent: &crate::case::geometry::Extent,
    path: &str,
    findings: &mut Findings,
) -> Block {
    let mut extent = extent.clone();
    let axis = face.axis();
    if let (Some(from), Some(to)) = (extent.from.0.get_mut(axis), extent.to.0.get_mut(axis)) {
        (*from, *to) = (0.0, grid.size[axis]);
    }
    Block::resolve(grid, &extent, path, findings)
}

fn whole_face(grid: &Grid, face: Face) -> ([usize; 3], [usize; 3]) {
    let mut to = grid.cells;
    to[face.axis()] = 1;
    ([0; 3], to)
}

fn condition(
    written: &Written,
    face: Face,
    grid: &Grid,
    directory: &Path,
    path: &str,
    findings: &mut Findings,
) -> Condition {
    match written {
        Written::NoSlip {} => Condition::NoSlip,
        Written::FreeSlip {} => Condition::FreeSlip,
        Written::Outflow {} => Condition::Outflow,
        Written::MovingWall { velocity } => {
            let path = format!("{path}.condition.moving_wall.velocity");
            let velocity = Block::vector(grid, velocity, &path, findings);
            if velocity[face.axis()] != 0.0 {
                findings.error(
                    &path,
                    "a wall slides in its own plane, but this velocity has a part normal to the face",
                    "make that component 0, or impose a velocity",
                );
            }
            Condition::MovingWall(velocity)
        }
        Written::ConvectiveOutflow { velocity } => Condition::ConvectiveOutflow(*velocity),
        Written::Velocity {
            profile,
            ramp_time,
            turbulence,
        } => {
            if let Some(turbulence) = turbulence {
                let path = format!("{path}.condition.velocity.turbulence");
                resolved(turbulence, grid, &path, findings);
                carried_in(profile, face, &path, findings);
            }
            let path = format!("{path}.condition.velocity.profile");
            let profile = match profile {
                Profile::Uniform(velocity) => VelocityProfile::Uniform(Block::vector(
                    grid,
                    velocity,
                    &format!("{path}.uniform"),
                    findings,
                )),
                Profile::Parabolic { peak } => VelocityProfile::Parabolic(*peak),
                Profile::File { path: file } => {
                    let file = directory.join(file);
                    let empty = Table::empty(file.clone(), grid.dimension);
                    VelocityProfile::File(Table::read(file, grid.dimension).unwrap_or_else(
                        |reason| {
                            let remedy = "correct the path (relative to the case) or the file";
                            findings.error(&format!("{path}.file.path"), reason, remedy);
                            empty
                        },
                    ))
                }
            };
            Condition::Velocity {
                profile,
                ramp_time: ramp_time.unwrap_or(0.0),
                turbulence: *turbulence,
            }
        }
        Written::Pressure { value, ramp } => Condition::Pressure {
            value: *value,
            from: ramp.as_ref().map_or(*value, |r| r.from),
            ramp_time: ramp.as_ref().map_or(0.0, |r| r.duration),
        },
    }
}

/// Water is nearly incompressible: what flows in must find a way out.
fn closed_volume(faces: &[Vec<Patch>; 6], grid: &Grid, findings: &mut Findings) {
    let mut inflow = 0.0;
    let mut through = 0.0;
    let mut first: Option<&Patch> = None;
    for patch in faces.iter().flatten() {
        match &patch.condition {
            Condition::Pressure { .. } | Condition::Outflow | Condition::ConvectiveOutflow(_) => {
                return;
            }
            Condition::Velocity { profile, .. } => {
                let cells: f64 = (0..3)
                    .map(|a| count(patch.to[a] - patch.from[a].min(patch.to[a])))
                    .product();
                let axes = grid.dimension - 1;
                let normal = match profile {
                    VelocityProfile::Uniform(velocity) => {
                        let inward = patch.face.inward();
                        (0..3).map(|a| velocity[a] * inward[a]).sum()
                    }
                    VelocityProfile::Parabolic(peak) => {
                        peak * if axes == 1 { 2.0 / 3.0 } else { 4.0 / 9.0 }
                    }
                    VelocityProfile::File(_) => return,
                };
                inflow += normal * cells;
                through += f64::abs(normal * cells);
                first = first.or(Some(patch));
            }
            _ => {}
        }
    }
    if let Some(patch) = first
        && inflow.abs() > 1e-9 * through
    {
        findings.error(
            &format!("{PATH}.boundaries"),
            format!(
                "`{}` imposes a velocity, but no face lets as much fluid out",
                patch.name
            ),
            "give another face a pressure or an outflow",
        );
    }
}
