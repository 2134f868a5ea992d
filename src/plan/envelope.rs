//! Distance of a case from the limits of the method, before the first step.
//!
//! Velocities that are not imposed are estimated from above by [`crate::scene::speed`]. The lattice velocity is U/C
//! with C = h/dt, and at a given tau C = 3 nu/(h (tau - 1/2)): the spacing determines the maximum velocity.

use super::Clock;
use super::critical_step::{Critical, critical_solid_time_step};
use super::margin::{Margin, USUAL_LATTICE_VELOCITY, margin, report_exceeded, slower_clock};
use crate::scene::Scene;
use crate::scene::auto::density;
use crate::scene::contact::ContactTable;
use crate::scene::findings::{Findings, at_most, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::initial::Initial;
use crate::scene::speed::{SpeedCause, passage, pressure_difference, speeds};
use base::error::Remedy;
use base::number::real;
/// Relative density change by an imposed pressure above which the plan warns.
const USUAL_COMPRESSION: f64 = 0.03;

/// Returns the margins to all limits; exceeded limits are also reported as findings.
pub(crate) fn margins(scene: &Scene, clock: &Clock, findings: &mut Findings) -> Vec<Margin> {
    let mut margins = Vec::new();
    if let Some(flow) = &scene.flow {
        let tau = flow.relaxation_time;
        margins.push(margin(
            "relaxation time above 1/2",
            0.5,
            tau,
            &format!("{PATH}.{}", flow.fixed_by),
        ));
        for limit in &scene.chosen.limits {
            let what = format!("time step for {}", limit.what);
            margins.push(margin(&what, flow.time_step, limit.time_step, "accuracy"));
        }
        lattice_velocity(scene, flow, &mut margins, findings);
        super::stability::check(scene, flow, &mut margins, findings);
        super::free_surface::check(scene, flow, &mut margins, findings);
        super::levels::check(scene, flow, &mut margins, findings);
        super::linear_stability::check(flow, clock, findings);
        compression(scene, flow, &mut margins, findings);
        needed_pressure(scene, flow, &mut margins, findings);
        super::bodies::check(scene, &mut margins, findings);
        super::slots::check(scene, flow, findings);
        super::terms::check(scene, flow, &mut margins, findings);
    }
    if let Some(seepage) = &scene.seepage
        && let Some((_, largest)) = scene.grains.as_ref().and_then(|g| g.radii)
    {
        margins.push(margin(
            "largest grain / cell of the seepage",
            2.0 * largest,
            seepage.smallest_edge(scene.grid.dimension),
            "fluid.darcy.grid",
        ));
    }
    if let Some(critical) = clock.critical_solid_time_step {
        margins.push(margin(
            "solid time step / critical",
            clock.solid_time_step / critical,
            scene.time.solid_time_step_safety,
            "time.solid_time_step_safety",
        ));
    }
    super::contacts::check(scene, clock, &mut margins, findings);
    super::impacts::check(scene, &mut margins, findings);
    super::servo::check(scene, findings);
    super::sampling::check(scene, clock, findings);
    super::wall_travel::check(scene, findings);
    super::wall_insertion::check(scene, findings);
    super::added_mass::check(scene, &mut margins, findings);
    super::resting::check(scene, findings);
    super::driven_path::check(scene, findings);
    super::driven_pocket::check(scene, findings);
    super::driven_plug::check(scene, findings);
    super::outlets::check(scene, findings);
    super::outlets::near_outflow(scene, findings);
    super::leaving::check(scene, findings);
    super::driven_squeeze::check(scene, findings);
    super::sinking::check(scene, findings);
    super::explicit_drag::check(scene, clock, &mut margins, findings);
    super::joint_steps::check(scene, &mut margins, findings);
    super::coupling_interval::check(scene, clock, &mut margins, findings);
    super::pore_flow::check(scene, findings);
    super::seepage::check(scene, findings);
    let impact = |law: &ContactTable| law.model().impact_speed();
    if let Some((impact_speed, path)) = scene.contact.as_ref().and_then(impact)
        && let Some(Critical { limits, .. }) = critical_solid_time_step(scene)
    {
        let mut share = |limit: &str, time: f64, path: &str| {
            let safety = scene.time.solid_time_step_safety;
            margins.push(margin(limit, clock.solid_time_step / time, safety, path));
        };
        share(
            &format!(
                "solid time step / 2 sqrt(m/k) of an impact at {} m/s",
                number(impact_speed)
            ),
            limits.spring,
            path,
        );
        if let Some(rayleigh) = limits.rayleigh {
            share("solid time step / Rayleigh's", rayleigh, "materials");
        }
    }
    report_exceeded(&margins, findings);
    margins
}

fn lattice_velocity(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let (h, dt, nu) = (scene.grid.spacing, flow.time_step, flow.kinematic_viscosity);
    let c = h / dt;
    let most = scene.guards.max_lattice_velocity;
    for speed in speeds(scene, flow) {
        let lattice_velocity = speed.value / c;
        if lattice_velocity > most || lattice_velocity.is_nan() {
            let reason = format!(
                "{} leads to {} m/s, a lattice velocity U dt/h of {}, which must be below {most} and should be \
                 below {USUAL_LATTICE_VELOCITY}",
                speed.what,
                number(speed.value),
                number(lattice_velocity)
            );
            let remedy = remedy(flow, h, nu, speed.value);
            match speed.what {
                // This is an upper estimate, because neighbours and walls slow settling bodies.
                SpeedCause::Settling => findings.unstable(&speed.path, reason, remedy),
                // Friction slows jets: of runs with an estimate of up to 1.3 times the limit some held.
                SpeedCause::Inlet if lattice_velocity <= 2.0 * most => {
                    findings.warn(&speed.path, reason, remedy);
                }
                SpeedCause::Inlet => findings.unstable(&speed.path, reason, remedy),
                _ => findings.error(&speed.path, reason, remedy),
            }
        } else if lattice_velocity > USUAL_LATTICE_VELOCITY {
            findings.warn(
                &speed.path,
                format!(
                    "{} leads to {} m/s, a lattice velocity U dt/h of {}, which should not exceed \
                     {USUAL_LATTICE_VELOCITY}",
                    speed.what,
                    number(speed.value),
                    number(lattice_velocity)
                ),
                remedy(flow, h, nu, speed.value),
            );
        }
        margins.push(margin(
            &format!("lattice velocity U dt/h: {}", speed.what),
            lattice_velocity,
            most,
            &speed.path,
        ));
    }
}

/// Returns the remedies that reduce the lattice velocity to the usual one.
fn remedy(flow: &Flow, h: f64, nu: f64, velocity: f64) -> Remedy {
    let dt = USUAL_LATTICE_VELOCITY * h / velocity;
    let tau = 0.5 + 3.0 * nu * dt / (h * h);
    let finer = 3.0 * nu * USUAL_LATTICE_VELOCITY / ((flow.relaxation_time - 0.5) * velocity);
    let first = match flow.fixed_by {
        "relaxation_time" => {
            format!(
                "use a relaxation time of at most {}",
                at_most(tau - 0.5) + 0.5
            )
        }
        "time_step" | "accuracy" => format!("use a time step of at most {:?} s", at_most(dt)),
        _ => format!("raise the reference velocity to {} m/s", number(velocity)),
    };
    let text = format!(
        "{first}, or a spacing of at most {} m at the same relaxation time, or reduce the velocity",
        number(finer)
    );
    slower_clock(flow, h, dt / flow.time_step, text)
}

/// Pressure that changes the density of the lattice fluid.
struct PressureSource {
    /// JSON path of the field that determines the pressure.
    path: String,
    what: &'static str,
    /// Largest pressure \[Pa\].
    pressure: f64,
}

/// Checks dp/(rho c_s²), which must be small because pressure on the lattice is density.
fn compression(scene: &Scene, flow: &Flow, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let units = flow.units(&scene.grid);
    let most = scene.guards.max_compression;
    let mut sources = Vec::new();
    for patch in flow.patches() {
        if let Some(pressure) = patch.condition.model().pressure()
            && let Some(path) = patch.path(pressure.field)
        {
            sources.push(PressureSource {
                path,
                what: "the imposed pressure",
                pressure: pressure.amplitude(),
            });
        }
    }
    if let Initial::Uniform { pressure, .. } = &flow.initial {
        sources.push(PressureSource {
            path: format!("{PATH}.initial.uniform.pressure"),
            what: "the initial pressure",
            pressure: pressure.abs(),
        });
    }
    if flow.gravity_acts.contains(&true) {
        let head: f64 = (0..scene.grid.dimension)
            .filter(|a| flow.gravity_acts[*a] && !scene.grid.periodic[*a])
            .map(|a| flow.density * scene.gravity[a].abs() * scene.grid.size[a])
            .sum();
        sources.push(PressureSource {
            path: format!("{PATH}.gravity_acts_on_fluid"),
            what: "the hydrostatic pressure",
            pressure: head,
        });
    }
    for source in sources.into_iter().filter(|one| one.pressure > 0.0) {
        let PressureSource {
            path,
            what,
            pressure,
        } = source;
        let change = units.pressure_to_density_deviation(pressure);
        let reason = format!(
            "{what} changes the density of the lattice fluid by {} %",
            number(100.0 * change)
        );
        // The density change is proportional to the square of the time step.
        let part = 0.99 * (USUAL_COMPRESSION / change).sqrt();
        let remedy = slower_clock(
            flow,
            scene.grid.spacing,
            part,
            format!(
                "multiply the time step by {} (the density change is proportional to its square), or reduce the \
                 pressure",
                number(part)
            ),
        );
        if change > most || change.is_nan() {
            findings.error(
                &path,
                format!("{reason}; at most {} % is allowed", number(100.0 * most)),
                remedy,
            );
        } else if change > USUAL_COMPRESSION * (1.0 + 1e-6) {
            // The automatic time step itself gives the usual density change.
            findings.warn(
                &path,
                format!(
                    "{reason}; it should be below {} %",
                    100.0 * USUAL_COMPRESSION
                ),
                remedy,
            );
        }
        margins.push(margin(
            &format!("density change: {what}"),
            change,
            most,
            &path,
        ));
    }
}

/// Compares the density change that the flow requires with the limit of the guard; the sum over all causes is an
/// upper estimate.
fn needed_pressure(scene: &Scene, flow: &Flow, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let (h, dt, most) = (
        scene.grid.spacing,
        flow.time_step,
        scene.guards.max_compression,
    );
    let change = |cause: &density::Cause| cause.change(dt, h, flow.density);
    let causes = &scene.density_causes;
    let Some(cause) = causes.iter().max_by(|a, b| change(a).total_cmp(&change(b))) else {
        return;
    };
    let total = density::total(causes, dt, h, flow.density);
    margins.push(margin(
        &format!("density change, mainly by {}", cause.what),
        total,
        most,
        &cause.path,
    ));
    if total <= most {
        return;
    }
    let smallest = density::smallest_change(causes, dt, h, flow.density);
    let bound = density::DensityBound {
        bound: 0.5 * most,
        spacing: h,
        density: flow.density,
    };
    let part = density::longest_step(causes, &bound).map_or(0.5, |(_, step)| 0.99 * step / dt);
    let ramp = if cause.sound > 0.0 && cause.path.starts_with(PATH) && cause.pressure == 0.0 {
        ", increase the velocity gradually (`ramp_time`)"
    } else {
        ""
    };
    let may_hold = smallest <= most;
    let least = if may_hold {
        format!("{} % or more, ", number(100.0 * smallest))
    } else {
        String::new()
    };
    let reason = format!(
        "the flow changes the density of the lattice fluid by {least}up to {} %, mainly because of {}; the run stops \
         at {} %",
        number(100.0 * total),
        cause.what,
        number(100.0 * most)
    );
    let text = format!(
        "multiply the time step by {}{ramp}, or reduce the drive of the flow",
        number(part)
    );
    let remedy = slower_clock(flow, h, part, text);
    if may_hold {
        findings.warn(&cause.path, reason, remedy);
    } else {
        findings.unstable(&cause.path, reason, remedy);
    }
}

/// Returns the largest Reynolds number U b/nu of a passage of height b at a lattice velocity of 0.1: U = 0.1 C.
#[must_use]
pub fn largest_reynolds(scene: &Scene) -> Option<f64> {
    let flow = scene.flow.as_ref()?;
    let axis = pressure_difference(flow).map_or(0, |pressures| pressures.axis);
    let (_, height) = passage(scene, axis);
    let cells = height.min(scene.grid.size[0] * real(scene.grid.dimension)) / scene.grid.spacing;
    Some(USUAL_LATTICE_VELOCITY * 3.0 / (flow.relaxation_time - 0.5) * cells)
}
