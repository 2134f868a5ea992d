//! Fluid of a scene: time step, forces, and a complete set of conditions on the six faces.

pub use super::body_force::BodyForce;
use super::body_force::body_force;
use super::boundaries::{ScenePatch, faces};
pub(crate) use super::findings::LATTICE_PATH as PATH;
use super::findings::{Findings, at_most, number};
use super::gravity;
use super::grid::Grid;
use super::initial::{Initial, initial};
use base::error::Remedy;
use base::units::LatticeUnits;
use case::Case;
use case::coupling::{PartiallySaturated, SolidOperator, Weighting};
use case::fluid::{
    self, Device, LatticeBoltzmann, LatticeChoice, Pilot, Precision, TurbulenceChoice,
};
use lbm::fluid::Models;
pub use lbm::lattice::VelocitySet as Lattice;
use serde::Serialize;
use serde_json::json;

/// Minimum relaxation time at which, without an eddy viscosity, flow is slow enough for the viscosity-matched
/// operator, whose cells resist by viscosity alone.
const SLOW_RELAXATION_TIME: f64 = 0.52;

/// A resolved lattice Boltzmann fluid, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flow {
    /// Density at rest [kg/m3].
    pub density: f64,
    /// Kinematic viscosity [m2/s].
    pub kinematic_viscosity: f64,
    /// Velocity set, collision operator and eddy viscosity.
    #[serde(flatten)]
    pub models: Models,
    /// Storage precision of the populations.
    pub storage: Precision,
    /// Precision of the collisions.
    pub arithmetic: Precision,
    /// Device that computes the fluid.
    pub device: Device,
    /// Time step \[s\].
    pub time_step: f64,
    /// Relaxation time tau.
    pub relaxation_time: f64,
    /// Field of the case that fixed the time step; `accuracy` if it was chosen.
    pub fixed_by: &'static str,
    /// Force per volume in addition to gravity.
    pub body_force: BodyForce,
    /// `true` for the axes along which gravity acts on the fluid.
    pub gravity_acts: [bool; 3],
    /// `true` if the pressure contains the hydrostatic one: gravity acts across walls, without a free surface.
    pub hydrostatic: bool,
    /// Initial state of the fluid.
    pub initial: Initial,
    /// Conditions of the faces, by `Face::index`. A face that is not periodic has at least one patch: the first
    /// covers the whole face, and later patches override earlier ones. A periodic face, or one along z in 2-D, has
    /// none.
    pub faces: [Vec<ScenePatch>; 6],
    /// Speed and pressure in a pilot run on coarse cells.
    pub pilot: Option<Pilot>,
    /// `true` below a free surface.
    pub free_surface: bool,
}

impl Flow {
    /// Returns the operator of cells covered by solids: as given, or chosen by the relaxation time.
    #[must_use]
    pub fn solid_operator(&self, written: &PartiallySaturated) -> SolidOperator {
        let slow = self.models.collision.model().antisymmetric_rate().is_some()
            && self.models.turbulence.is_none()
            && !self.free_surface
            && self.relaxation_time >= SLOW_RELAXATION_TIME;
        written.solid_operator.unwrap_or(if slow {
            SolidOperator::ViscosityMatched
        } else {
            SolidOperator::NonEquilibriumBounceBack
        })
    }

    /// Returns the weighting of covered cells: as given, or by fraction where the hydrostatic pressure is part of the
    /// lattice pressure.
    #[must_use]
    pub fn weighting(&self, written: &PartiallySaturated) -> Weighting {
        written.weighting.unwrap_or(if self.hydrostatic {
            Weighting::Fraction
        } else {
            Weighting::default()
        })
    }

    /// Returns the scales of the lattice.
    #[must_use]
    pub fn units(&self, grid: &Grid) -> LatticeUnits {
        LatticeUnits {
            spacing: grid.spacing,
            time_step: self.time_step,
            density: self.density,
            dimension: grid.dimension,
        }
    }

    /// Returns all patches of all faces.
    pub fn patches(&self) -> impl Iterator<Item = &ScenePatch> {
        self.faces.iter().flatten()
    }

    pub(crate) fn resolve(case: &Case, grid: &Grid, findings: &mut Findings) -> Option<Self> {
        let Some(fluid::Fluid::LatticeBoltzmann(lbm)) = &case.fluid else {
            return None;
        };
        let models = models(lbm, grid, findings);
        let body_force = body_force(lbm, grid, findings);
        let mut initial = initial(lbm, grid, &case.directory, findings);
        let faces = faces(lbm, grid, &case.directory, findings);
        let acts = gravity::gravity_axes(case, lbm, grid, (&faces, &body_force), findings);
        if let (fluid::Initial::Rest {}, Initial::Uniform { weight, .. }, Some(gravity)) =
            (&lbm.initial, &mut initial, &case.gravity)
            && lbm.surface.is_none()
        {
            let pull = (lbm.density, gravity.to_array());
            *weight = super::initial::weight(pull, acts, grid, &faces);
        }
        let FixedStep {
            time_step,
            by: fixed_by,
        } = time_step(lbm, grid, findings)?;
        let units = LatticeUnits {
            spacing: grid.spacing,
            time_step,
            density: lbm.density,
            dimension: grid.dimension,
        };
        // A stated relaxation time is used as written, without rounding.
        let relaxation_time = lbm
            .relaxation_time
            .unwrap_or_else(|| units.relaxation_time(lbm.kinematic_viscosity));
        // A relaxation time that is chosen later is checked later.
        if fixed_by != "accuracy" {
            check_operator(lbm, relaxation_time, findings);
        }
        Some(Self {
            density: lbm.density,
            kinematic_viscosity: lbm.kinematic_viscosity,
            models,
            storage: lbm.storage.unwrap_or(lbm.arithmetic),
            arithmetic: lbm.arithmetic,
            device: lbm.device,
            time_step,
            relaxation_time,
            fixed_by,
            body_force,
            gravity_acts: acts,
            hydrostatic: lbm.surface.is_none() && (0..3).any(|a| acts[a] && !grid.periodic[a]),
            initial,
            faces,
            free_surface: lbm.surface.is_some(),
            pilot: lbm.pilot.as_deref().cloned(),
        })
    }
}

/// Returns the models that the case states or leaves to defaults, and reports those that the dimension excludes.
fn models(lbm: &LatticeBoltzmann, grid: &Grid, findings: &mut Findings) -> Models {
    let operator = lbm.collision.unwrap_or_default();
    let only = operator.model().only_on();
    let (lattice, dimension) = match lbm.lattice {
        LatticeChoice::Auto if grid.dimension == 2 => (Lattice::D2Q9, 2),
        LatticeChoice::Auto => (only.unwrap_or(Lattice::D3Q19), 3),
        LatticeChoice::D2q9 => (Lattice::D2Q9, 2),
        LatticeChoice::D3q19 => (Lattice::D3Q19, 3),
        LatticeChoice::D3q27 => (Lattice::D3Q27, 3),
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
    if only.is_some_and(|only| lattice != only) {
        findings.error(
            &format!("{PATH}.collision.{}", operator.name()),
            "this operator works with the velocity set D3Q27 only",
            if grid.dimension == 2 {
                Remedy::from("use trt in 2-D").set(format!("{PATH}.collision"), json!({"trt": {}}))
            } else {
                Remedy::from("use the lattice d3q27 or auto, or the collision trt")
                    .set(format!("{PATH}.lattice"), "auto")
            },
        );
    }
    let turbulence = lbm.turbulence.and_then(TurbulenceChoice::model);
    if let Some(finding) =
        turbulence.and_then(|model| model.check(&format!("{PATH}.turbulence"), grid.dimension))
    {
        findings.add(finding);
    }
    Models {
        lattice,
        collision: operator,
        turbulence,
    }
}

/// Reports the finding of the operator about its parameters at a relaxation time.
pub(super) fn check_operator(lbm: &LatticeBoltzmann, tau: f64, findings: &mut Findings) {
    let operator = lbm.collision.unwrap_or_default();
    if let Some(finding) = operator.model().check(&format!("{PATH}.collision"), tau) {
        findings.add(finding);
    }
}

/// Time step and the field of the case that determines it.
struct FixedStep {
    time_step: f64,
    by: &'static str,
}

/// Returns the time step from the fields by which the case states it; if it states none, a placeholder until the speeds
/// are known.
fn time_step(lbm: &LatticeBoltzmann, grid: &Grid, findings: &mut Findings) -> Option<FixedStep> {
    let fields = [
        ("relaxation_time", lbm.relaxation_time),
        ("time_step", lbm.time_step),
        ("reference_velocity", lbm.reference_velocity),
    ];
    let given: Vec<&'static str> = fields
        .iter()
        .filter(|(_, value)| value.is_some())
        .map(|(name, _)| *name)
        .collect();
    if !check_velocities(lbm, given.is_empty(), findings) {
        return None;
    }
    let (h, nu) = (grid.spacing, lbm.kinematic_viscosity);
    let by = match given[..] {
        [] => {
            return Some(FixedStep {
                time_step: LatticeUnits::time_step_for(1.0, h, nu),
                by: "accuracy",
            });
        }
        [name] => name,
        [..] => {
            too_many(lbm, &given, findings);
            return None;
        }
    };
    let time_step = match (
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
    let fixed = FixedStep { time_step, by };
    check_time_step(lbm, h, &fixed, findings).then_some(fixed)
}

/// Refuses one of the two velocities without the other. Returns `true` if they determine a time step.
fn check_velocities(lbm: &LatticeBoltzmann, alone: bool, findings: &mut Findings) -> bool {
    let of_lattice = lbm.lattice_velocity.is_some();
    if of_lattice == lbm.reference_velocity.is_some() {
        return true;
    }
    let missing = if of_lattice {
        "reference_velocity"
    } else {
        "lattice_velocity"
    };
    let path = format!("{PATH}.lattice_velocity");
    findings.error(
        &format!("{PATH}.{missing}"),
        "`reference_velocity` and `lattice_velocity` determine the time step together, so that both are needed",
        if of_lattice {
            Remedy::take_out(
                format!("add `{missing}`, or omit `lattice_velocity`"),
                &path,
            )
        } else {
            Remedy::from(format!("add `{missing}` (for example 0.05), or omit both"))
                .set(path, 0.05)
        },
    );
    of_lattice && !alone
}

/// Refuses a time step determined by more than one field.
fn too_many(lbm: &LatticeBoltzmann, given: &[&'static str], findings: &mut Findings) {
    let remedy =
        Remedy::from("keep one of them, or remove all: the program then chooses the time step");
    let others = given[1..].iter().copied();
    let more = lbm.lattice_velocity.is_some().then_some("lattice_velocity");
    findings.error(
        &format!("{PATH}.{}", given[1]),
        format!(
            "only one of relaxation_time, time_step and reference_velocity can determine the time step, but {} \
             are given",
            given.join(" and ")
        ),
        others.chain(more).fold(remedy, |remedy, name| {
            remedy.set(format!("{PATH}.{name}"), serde_json::Value::Null)
        }),
    );
}

/// Further fields on which the time step depends.
const STEP: [&str; 2] = ["domain", "fluid.lattice_boltzmann.kinematic_viscosity"];

/// Returns `true` if the time step gives a relaxation time in the stable range; otherwise reports a finding.
fn check_time_step(
    lbm: &LatticeBoltzmann,
    h: f64,
    fixed: &FixedStep,
    findings: &mut Findings,
) -> bool {
    let (dt, nu) = (fixed.time_step, lbm.kinematic_viscosity);
    let path = format!("{PATH}.{}", fixed.by);
    if lbm.relaxation_time.is_some_and(|tau| tau <= 0.5) {
        findings.error(
            &path,
            "the viscosity on the lattice is (tau - 1/2)/3 and must be positive: tau must be above 0.5",
            Remedy::from("use 0.51 to 2, for example 0.8").set(&*path, 0.8),
        );
        return false;
    }
    let tau = 0.5 + 3.0 * nu * dt / (h * h);
    if !(dt.is_finite() && dt > 0.0 && tau.is_finite()) {
        findings.error(
            &path,
            "the time step that follows from this value is not finite",
            "check the units of viscosity and spacing",
        );
        findings.depends(&STEP);
        return false;
    }
    if tau <= 0.5 + 1e-12 || tau > 1e3 {
        let remedy = format!(
            "use a time step of {} … {} s at this spacing and viscosity",
            number(0.01 * h * h / (3.0 * nu)),
            number(0.5 * h * h / nu)
        );
        findings.error(
            &path,
            format!(
                "the relaxation time becomes tau = {tau:.6e}; it must be above 0.5 and below 1000"
            ),
            of_time(lbm, remedy, at_most(0.1 * h * h / nu)),
        );
        findings.depends(&STEP);
        return false;
    }
    if tau > 2.0 {
        let remedy = format!("use a time step below {} s", number(0.5 * h * h / nu));
        findings.warn(
            &path,
            format!(
                "the relaxation time is tau = {}: large values reduce the accuracy",
                number(tau)
            ),
            of_time(lbm, remedy, at_most(0.49 * h * h / nu)),
        );
        findings.depends(&STEP);
    }
    true
}

/// Proposes a time step in place of the field that determines it.
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
