//! Stability of water that falls with a free surface.
//!
//! The surface folds within a cell where water meets water or a wall. Stability depends on the cell Reynolds number
//! U h/ν, with U = (2 g H)^½ the speed of a fall over the drop H of the water at the start. The maps
//! `benches/stability/dam-break-30` (2-D) and `dam-break-3d-20` are of a column that falls, runs against a wall and
//! returns. Water with a level surface has no drop; the drop of a wave is twice its amplitude. A body that falls
//! into the water or moves in it is judged by its own speed if that is larger; there is no map of bodies.
//!
//! A fall sends a bore to the openings. With two rates it fails at an opening with a level at less than in a closed
//! basin: `benches/stability/bores.csv` has columns of 0.05 to 0.2 m over a basin of 0.05 to 0.2 m, in 2-D.
//!
//! A stream from an inlet or in the initial state is judged by its own speed: the map `benches/stability/stream-10` has
//! one that runs against a wall, and the jump that runs back to the inlet. Operators with two rates fail there at a
//! cell Reynolds number of 20 and above, at the inlet. In 3-D there is no map of streams; that in 2-D is used.

use super::margin::{Margin, margin, slower_clock};
use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::findings::{Findings, at_most, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::free_surface::{FreeSurface, Opening, Tension};
use crate::scene::speed;
use base::error::Remedy;
use base::number::real;
use lbm::collision::Operator;
use lbm::turbulence::EddyViscosity;
use serde_json::json;

/// Factor by which a value written with few digits may exceed its bound.
const BOUND_SLACK: f64 = 1.0 + 1e-6;

/// Ratio of the smallest value that failed to the largest that held above which values in between are judged by the
/// nearer one.
const WIDE_GAP: f64 = 5.0;

/// Fraction of a limit of the time step that a remedy proposes.
const STEP_PROPOSED: f64 = 0.9;

/// Cell Laplace numbers σ h/(ρ ν²) up to which all drops of 5 cells of radius came to rest, and above which some did
/// not (2-D, σ dt²/(ρ h³) of 0.002 to 0.02, relaxation times of 0.505 to 0.8).
const LAPLACE_HOLDS: f64 = 72.0;
const LAPLACE_FAILS: f64 = 170.0;

/// Lattice velocity of a fall up to which few runs of `benches/stability/falls.csv` failed, and the cell Reynolds
/// number from which some did, with their number and that of all from there on: up to this velocity, and above it.
const SPLASH_SLOW: f64 = 0.05;
const SPLASHES: [(f64, [u32; 2]); 2] = [(3000.0, [2, 8]), (100.0, [12, 20])];

/// Surface tension of water in air at 20 °C [N/m].
const WATER_IN_AIR: f64 = 0.0728;

/// Limits of the cell Reynolds number: the largest value up to which all runs of a map were stable, and the
/// smallest at which one failed. Operators with which no run failed have no limits.
struct Limits {
    map: &'static str,
    holds: f64,
    fails: f64,
}

/// Returns the limits of an operator, with an eddy viscosity or without one, for a bore that reaches an opening with a
/// level; `None` if every run of the table finished.
fn limits_at_levels(operator: &Operator) -> Option<Limits> {
    let (holds, fails) = match operator {
        Operator::Trt(_) => (30.0, 50.0),
        _ => return None,
    };
    let map = "bores.csv";
    Some(Limits { map, holds, fails })
}

/// Returns the limits of an operator, with an eddy viscosity or without one, for a lattice velocity U dt/h of the
/// fall; `None` if every run of the map was stable or there was none.
fn limits(
    operator: &Operator,
    dimension: usize,
    eddies: bool,
    lattice_velocity: f64,
) -> Option<Limits> {
    let slow = lattice_velocity <= 0.05 * BOUND_SLACK;
    let (holds, fails) = match (operator, dimension, eddies) {
        (Operator::Bgk(_) | Operator::Trt(_), 2, false) if slow => (50.0, 100.0),
        (Operator::Bgk(_) | Operator::Trt(_), _, false) => (30.0, 50.0),
        (Operator::Trt(_), 2, true) => (100.0, 1000.0),
        (Operator::Trt(_), _, true) => (50.0, 200.0),
        _ => return None,
    };
    let map = ["dam-break-3d-20", "dam-break-30"][usize::from(dimension == 2)];
    Some(Limits { map, holds, fails })
}

/// Returns the limits of an operator in a stream with a free surface, as [`limits`] does for a fall.
fn limits_of_streams(operator: &Operator, eddies: bool, lattice_velocity: f64) -> Option<Limits> {
    let slow = lattice_velocity <= 0.02 * BOUND_SLACK;
    let (holds, fails) = match (operator, eddies) {
        (Operator::Bgk(_), false) if slow => (50.0, 100.0),
        (Operator::Bgk(_), false) | (Operator::Trt(_), true) => (30.0, 50.0),
        (Operator::Trt(_), false) => (10.0, 20.0),
        _ => return None,
    };
    let map = "stream-10";
    Some(Limits { map, holds, fails })
}

/// Adds the margin, and a finding if similar runs failed.
pub(super) fn check(
    scene: &Scene,
    flow: &Flow,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let Some(surface) = &scene.surface else {
        return;
    };
    let drop = drop(scene, surface);
    let fall = Cause {
        speed: (2.0 * surface.gravity * drop).sqrt(),
        path: format!("{PATH}.surface.water"),
        kind: Kind::Fall,
        margin: "cell Reynolds number U h/nu: the fall of the water".to_owned(),
        what: format!("water that falls {} m", number(drop)),
    };
    add_margin(scene, flow, &fall, margins, findings);
    if splashes(scene, surface, &fall, drop) {
        check_splash(scene, flow, &fall, findings);
    }
    if let Some(tension) = &surface.tension {
        check_tension((scene, flow), tension, margins, findings);
    }
    let bodies = (0..scene.bodies.len()).map(|n| body_entry_cause(scene, surface, n));
    let fastest = bodies.max_by(|a, b| a.speed.total_cmp(&b.speed));
    if let Some(body) = fastest.filter(|body| body.speed > fall.speed) {
        add_margin(scene, flow, &body, margins, findings);
    }
    let streams = speed::imposed_on_fluid(flow).into_iter();
    if let Some(stream) = streams.max_by(|a, b| a.value.total_cmp(&b.value)) {
        let stream = Cause {
            speed: stream.value,
            path: stream.path,
            kind: Kind::Stream,
            margin: format!("cell Reynolds number U h/nu: {}", stream.what),
            what: format!("{} with a free surface", stream.what),
        };
        add_margin(scene, flow, &stream, margins, findings);
    }
}

/// Returns the height through which water can fall \[m\].
fn drop(scene: &Scene, surface: &FreeSurface) -> f64 {
    let solids = || scene.structures.iter().filter(|s| s.stops.water());
    let separated = |from: [f64; 3], to: [f64; 3]| {
        let along = std::array::from_fn(|a| to[a] - from[a]);
        let mut chords = Vec::new();
        solids().any(|structure| {
            structure.solid.chords(from, along, &mut chords);
            !chords.is_empty()
        })
    };
    if surface.drop() > 0.0 && surface.stands(scene.grid.cells, separated) {
        surface.drop_at_openings()
    } else {
        surface.drop()
    }
}

/// Checks the time step of capillary waves.
fn check_tension(
    (scene, flow): (&Scene, &Flow),
    tension: &Tension,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let limit = tension.step_limit(flow.density, scene.grid.spacing);
    let path = format!("{PATH}.surface.surface_tension");
    let found = margin(
        "time step of the shortest capillary waves",
        flow.time_step,
        limit,
        &path,
    );
    if found.used > BOUND_SLACK {
        let text = format!(
            "use a time step of at most {} s",
            number(STEP_PROPOSED * limit)
        );
        findings.error(
            &format!("{PATH}.{}", flow.fixed_by),
            format!(
                "the surface tension of {} N/m needs a time step of at most {} s on cells of {} m: the pressure of \
                 a drop of a few cells would exceed the compression limit of the lattice",
                number(tension.value),
                number(limit),
                number(scene.grid.spacing)
            ),
            slower_clock(
                flow,
                scene.grid.spacing,
                STEP_PROPOSED * limit / flow.time_step,
                text,
            ),
        );
    }
    margins.push(found);
    let (h, nu) = (scene.grid.spacing, flow.kinematic_viscosity);
    let laplace = tension.value * h / (flow.density * nu * nu);
    if laplace > LAPLACE_HOLDS * BOUND_SLACK {
        findings.warn(
            &path,
            format!(
                "the cell Laplace number tension h/(density viscosity²) is {}: drops of 5 cells of radius came to rest \
                 up to {LAPLACE_HOLDS}, and from {LAPLACE_FAILS} spurious currents moved some of them",
                number(laplace)
            ),
            format!(
                "use a viscosity of at least {} m2/s, or leave the tension out where waves and drops are well above \
                 2 cm",
                number(nu * (laplace / LAPLACE_HOLDS).sqrt())
            ),
        );
    }
    margins.push(margin(
        "cell Laplace number: spurious currents",
        laplace,
        LAPLACE_HOLDS,
        &path,
    ));
}

/// Returns the ratio of weight to tension of the highest water, ρ g H²/σ; none without gravity.
pub(super) fn bond_number(surface: &FreeSurface, density: f64, tension: f64) -> Option<f64> {
    let bond = density * surface.gravity * surface.head().powi(2) / tension;
    (bond > 0.0).then_some(bond)
}

/// Returns the text for a case without surface tension, with the Bond number of water in air.
pub(super) fn without_tension(surface: &FreeSurface, density: f64) -> String {
    if surface.tension.is_some() {
        return String::new();
    }
    let bond = bond_number(surface, density, WATER_IN_AIR);
    let bond = bond.map(|bond| format!(" (Bond number of the highest water {})", number(bond)));
    format!("no surface tension{}, ", bond.unwrap_or_default())
}

/// Returns model and reason of the surface tension, with the numbers that show how much it acts.
pub(super) fn describe_tension(
    scene: &Scene,
    flow: &Flow,
    surface: &FreeSurface,
    tension: &Tension,
) -> (&'static str, String) {
    let h = scene.grid.spacing;
    let mut text = format!(
        "{} N/m; contact angle of {} degrees at no-slip walls on whole faces, 90 elsewhere",
        number(tension.value),
        number(tension.contact_angle)
    );
    let length = tension.capillary_length(flow.density, surface.gravity);
    if let Some(bond) = bond_number(surface, flow.density, tension.value) {
        let part = if bond > 1e3 {
            "; it acts on ripples, drops and edges alone"
        } else {
            ""
        };
        text.push_str(&format!(
            "; capillary length of {} m, {} cells; Bond number of the highest water {}{part}",
            number(length),
            number(length / h),
            number(bond)
        ));
    }
    let speed = flow_speed(scene, flow);
    if speed > 0.0 {
        let weber = flow.density * speed * speed * h / tension.value;
        let part = if weber > 1.0 {
            "; above 1 the tension does not hold structures of a cell together, and splashes depend on the cells"
        } else {
            ""
        };
        text.push_str(&format!(
            "; Weber number of a cell at {} m/s {}{part}",
            number(speed),
            number(weber)
        ));
    }
    text.push_str(
        "; the pressure in drops of 5, 10 and 20 cells of radius is accurate to 1.3, 0.3 and 0.04 %, and spurious \
         currents reach 0.08, 0.005 and 0.0003 of the speed tension/viscosity",
    );
    ("height functions", text)
}

/// Returns the largest speed of the fall of the water and of imposed streams [m/s].
fn flow_speed(scene: &Scene, flow: &Flow) -> f64 {
    let streams = speed::imposed_on_fluid(flow).into_iter();
    let fall = scene.surface.as_ref().map_or(0.0, |surface| {
        (2.0 * surface.gravity * drop(scene, surface)).sqrt()
    });
    streams.map(|stream| stream.value).fold(fall, f64::max)
}

/// Motion of the water, each with maps of its own.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Water or a body falls.
    Fall,
    /// Water enters or moves at the start.
    Stream,
}

/// Returns `true` if water in a closed basin with a dry floor runs against a wall before the end, at the speed of the
/// fall.
fn splashes(scene: &Scene, surface: &FreeSurface, fall: &Cause, drop: f64) -> bool {
    let (grid, up) = (&scene.grid, surface.axis);
    let along = usize::from(up == 0);
    if grid.dimension != 2 || !surface.openings.is_empty() || grid.periodic[along] {
        return false;
    }
    let floor = if surface.rises { 0 } else { grid.cells[up] - 1 };
    let is_dry = |n: &usize| {
        let mut cell = [0; 3];
        (cell[along], cell[up]) = (*n, floor);
        surface.fill(cell) <= 0.0
    };
    let dry = (0..grid.cells[along]).filter(is_dry).count();
    let way = real(dry) * grid.spacing;
    dry > 0 && drop >= surface.standing_head() && fall.speed * scene.time.end > way
}

/// Warns of falls with one rate and an eddy viscosity in 2-D at cell Reynolds numbers at which some runs failed.
///
/// The splash at a wall has drops and films of a cell. `benches/stability/falls.csv` has columns that run against a
/// wall, with friction and without it: up to a lattice velocity of 0.05 all runs up to 1000 finished, and at 0.1 some
/// failed from 100 on, its lowest number. With a constant of 0.3 and 0.05 all runs from 300 on finished.
fn check_splash(scene: &Scene, flow: &Flow, fall: &Cause, findings: &mut Findings) {
    let eddies = matches!(flow.models.turbulence, Some(EddyViscosity::Smagorinsky(_)));
    let single = matches!(flow.models.collision, Operator::Bgk(_));
    if !eddies || !single {
        return;
    }
    let h = scene.grid.spacing;
    let (cell, slow) = (
        fall.speed * h / flow.kinematic_viscosity,
        SPLASH_SLOW * h / fall.speed,
    );
    let is_slow = flow.time_step <= slow * BOUND_SLACK;
    let (from, [failed, all]) = if is_slow { SPLASHES[0] } else { SPLASHES[1] };
    if cell < from {
        return;
    }
    findings.warn(
        &fall.path,
        format!(
            "{} gives a cell Reynolds number U h/nu of {}, with U = {} m/s: in `benches/stability/falls.csv` {failed} \
             of {all} runs with this operator and eddy viscosity failed from {} on, where the splash has drops \
             of a cell",
            fall.what,
            number(cell),
            number(fall.speed),
            number(from)
        ),
        format!(
            "use a time step of at most {} s and a constant of 0.3 in `smagorinsky`, with which all runs from 300 on \
             finished",
            number(at_most(slow))
        ),
    );
}

/// Cause of a speed at the surface.
struct Cause {
    speed: f64,
    path: String,
    kind: Kind,
    margin: String,
    what: String,
}

/// Returns the speed with which a body enters the water at its highest level.
fn body_entry_cause(scene: &Scene, surface: &FreeSurface, n: usize) -> Cause {
    let body = &scene.bodies[n];
    let squares = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
    let falls = if body.mobility == Mobility::Free {
        let lowest = surface.height(body.position) - body.radius;
        2.0 * surface.gravity * (lowest - surface.head()).max(0.0)
    } else {
        0.0
    };
    Cause {
        speed: (squares(body.largest_motion()[0]) + falls).sqrt(),
        path: format!("bodies[{n}].motion"),
        kind: Kind::Fall,
        margin: "cell Reynolds number U h/nu: a body that meets the water".to_owned(),
        what: format!("the body `{}` at the surface", body.name),
    }
}

/// Adds the margin for a cause, and a finding if similar runs failed.
fn add_margin(
    scene: &Scene,
    flow: &Flow,
    cause: &Cause,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let (speed, path) = (cause.speed, &cause.path);
    if speed <= 0.0 {
        return;
    }
    let cell = speed * scene.grid.spacing / flow.kinematic_viscosity;
    let dimension = scene.grid.dimension;
    let eddies = flow.models.turbulence.is_some();
    let lattice_velocity = speed * flow.time_step / scene.grid.spacing;
    let levels = scene.surface.iter().flat_map(|surface| &surface.openings);
    let mut levels = levels.filter_map(Opening::levels);
    let operator = &flow.models.collision;
    let limits = match cause.kind {
        Kind::Fall => {
            let bore = levels.next().and_then(|_| limits_at_levels(operator));
            let closed = limits(operator, dimension, eddies, lattice_velocity);
            bore.into_iter()
                .chain(closed)
                .min_by(|a, b| a.fails.total_cmp(&b.fails))
        }
        Kind::Stream => limits_of_streams(operator, eddies, lattice_velocity),
    };
    let Some(limits) = limits else {
        return;
    };
    margins.push(margin(&cause.margin, cell, limits.holds, path));
    if cell <= limits.holds * BOUND_SLACK {
        return;
    }
    let found = format!(
        "{} gives a cell Reynolds number U h/nu of {}, with U = {} m/s",
        cause.what,
        number(cell),
        number(speed),
    );
    let remedy = remedy(scene, flow, cell / limits.holds);
    // Between distant values of a map the limit is as likely below their geometric mean as above it.
    let doubtful = limits.fails > WIDE_GAP * limits.holds;
    if doubtful && cell < limits.fails && cell * cell >= limits.holds * limits.fails {
        let why = format!(
            "{found}: in the stability map `{}` runs with this operator were stable up to {} and failed at {} \
             and above; no value in between was tested, and this one is nearer to those that failed",
            limits.map,
            number(limits.holds),
            number(limits.fails),
        );
        findings.unstable(path, why, remedy);
    } else if cell >= limits.fails {
        let why = format!(
            "{found}: in the stability map `{}` runs with this operator were stable up to {} and failed at {} \
             and above",
            limits.map,
            number(limits.holds),
            number(limits.fails),
        );
        findings.unstable(path, why, remedy);
    } else {
        let why = format!(
            "{found}: in the stability map `{}` runs with this operator were stable up to {} and failed at {} \
             and above; no value in between was tested",
            limits.map,
            number(limits.holds),
            number(limits.fails),
        );
        findings.warn(path, why, remedy);
    }
}

/// Returns settings that were stable at this cell Reynolds number, or the viscosity and the spacing that reduce it
/// by a factor.
///
/// In 2-D a single rate with the Smagorinsky eddy viscosity is stable at every value of the map; in 3-D multiple
/// rates are stable without an eddy viscosity.
fn remedy(scene: &Scene, flow: &Flow, factor: f64) -> Remedy {
    let finer = format!(
        "a viscosity of at least {} m2/s, or a spacing of at most {} m",
        number(flow.kinematic_viscosity * factor),
        number(scene.grid.spacing / factor),
    );
    let collision = format!("{PATH}.collision");
    if scene.grid.dimension == 2 {
        let turbulence = format!("{PATH}.turbulence");
        Remedy::from(format!(
            "use the eddy viscosity `smagorinsky` with the operator `bgk`, or {finer}"
        ))
        .set(turbulence, json!({"smagorinsky": {}}))
        .set(collision, json!({"bgk": {}}))
    } else {
        Remedy::from(format!("use the operator `mrt`, or {finer}"))
            .set(collision, json!({"mrt": {}}))
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::{Problem, Severity};
    use case::{Document, examples};
    use std::path::Path;

    const LATTICE: &str = "fluid.lattice_boltzmann";

    /// Returns the findings on the fall of the water in the dam-break example with changed settings.
    fn found(set: &[String]) -> Vec<Problem> {
        let text = examples::find("dam-break").unwrap().text;
        let document = Document::read(text, set, Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings;
        let of_fall = |problem: &Problem| problem.path.ends_with("surface.water");
        warnings.into_iter().filter(of_fall).collect()
    }

    /// Checks rows of `benches/stability/dam-break-30/map.csv`.
    #[test]
    fn a_fall_at_low_viscosity_is_unstable_before_the_run() {
        let viscosity = |value: f64| format!("{LATTICE}.kinematic_viscosity={value}");
        // The cell Reynolds number of the example is 43 at 1e-4 m2/s.
        assert!(found(&[viscosity(1.5e-4)]).is_empty());
        let problem = &found(&[viscosity(1e-6)])[0];
        assert_eq!(problem.severity, Severity::Unstable);
        assert!(problem.to_string().contains("smagorinsky"), "{problem}");
        let held = [
            viscosity(1e-6),
            format!("{LATTICE}.turbulence={{\"smagorinsky\": {{}}}}"),
            format!("{LATTICE}.collision={{\"bgk\": {{}}}}"),
        ];
        // The splash at the wall is named, but is not unstable.
        let severities = found(&held).into_iter().map(|found| found.severity);
        assert!(severities.eq([Severity::Warning]));
    }

    /// Checks the splash of the example with one rate and an eddy viscosity, whose water does not meet the wall at
    /// first, and that the numbers are those of the table.
    #[test]
    fn a_splash_at_a_wall_is_named_where_some_runs_failed() {
        let at = |end: f64, step: f64, viscosity: f64| {
            let problems = found(&[
                format!("{LATTICE}.kinematic_viscosity={viscosity}"),
                format!("{LATTICE}.turbulence={{\"smagorinsky\": {{}}}}"),
                format!("{LATTICE}.collision={{\"bgk\": {{}}}}"),
                format!("{LATTICE}.time_step={step}"),
                format!("time.end={end}"),
            ]);
            problems.iter().any(|p| p.reason.contains("falls.csv"))
        };
        // U = 1.5 m/s: a lattice velocity of 0.1 at 1.9e-4 s, and a cell Reynolds number of 4280 at 1e-6 m2/s.
        assert!(at(1.0, 1.9e-4, 1e-5) && at(1.0, 9e-5, 1e-6));
        assert!(!at(1.0, 9e-5, 1e-5) && !at(0.2, 9e-5, 1e-6));
        let table = include_str!("../../benches/stability/falls.csv");
        for (velocity, (from, counts)) in ["0.05", "0.1"].into_iter().zip(super::SPLASHES) {
            let rows = table.lines().filter(|row| row.starts_with("0.17,"));
            let rows = rows.map(|row| row.split(',').collect::<Vec<_>>());
            let mine: Vec<_> = rows.filter(|row| row[3] == velocity).collect();
            let failed = |row: &&Vec<&str>| row[5] == "failed";
            let number = |row: &Vec<&str>| row[4].parse::<f64>().unwrap();
            let all = mine.iter().filter(|row| number(row) >= from).count();
            assert_eq!(
                [mine.iter().filter(failed).count(), all],
                counts.map(|n| n as usize)
            );
            assert!(mine.iter().filter(failed).all(|row| number(row) >= from));
        }
    }

    /// Checks that the limits of a bore at a level are those of the table: the smallest cell Reynolds number of a
    /// failed run, the largest of a finished one below it, and no failed run with the remedy.
    #[test]
    fn limits_of_bores_at_levels_are_those_of_the_table() {
        let table = include_str!("../../benches/stability/bores.csv");
        let rows = || {
            let lines = table.lines().filter(|line| !line.starts_with('#')).skip(1);
            lines.map(|line| line.split(',').collect::<Vec<_>>())
        };
        let number = |row: &[&str]| row[5].parse::<f64>().unwrap();
        let trt = serde_json::from_value(serde_json::json!({"trt": {}})).unwrap();
        let limits = super::limits_at_levels(&trt).unwrap();
        for eddies in ["none", "smagorinsky"] {
            let mine = || rows().filter(|row| row[..2] == ["trt", eddies]);
            let failed = mine().filter(|row| row[6] == "failed");
            let least = failed.map(|row| number(&row)).fold(f64::INFINITY, f64::min);
            let below = mine().map(|row| number(&row)).filter(|cell| *cell < least);
            approx::assert_relative_eq!(least, limits.fails);
            approx::assert_relative_eq!(below.fold(0.0, f64::max), limits.holds);
        }
        let remedy: Vec<_> = rows()
            .filter(|row| row[..2] == ["bgk", "smagorinsky"])
            .collect();
        assert!(remedy.len() == 40 && remedy.iter().all(|row| row[6] == "finished"));
    }

    /// Checks the example with TRT and an eddy viscosity at a cell Reynolds number of 70: in a closed basin it is
    /// stable, with an opening with a level it is not, and with an outfall it is.
    #[test]
    fn a_fall_that_reaches_a_level_is_judged_by_bores() {
        let at = |condition: &str| {
            found(&[
                format!("{LATTICE}.kinematic_viscosity=6.1e-5"),
                format!("{LATTICE}.turbulence={{\"smagorinsky\": {{}}}}"),
                format!("{LATTICE}.collision={{\"trt\": {{}}}}"),
                format!(
                    r#"{LATTICE}.boundaries=[{{"name": "end", "face": "x_max", "condition": {condition}}}]"#
                ),
            ])
        };
        assert!(at(r#"{"no_slip": {}}"#).is_empty());
        assert!(at(r#"{"outfall": {}}"#).is_empty());
        let problem = &at(r#"{"level": {"value": 0}}"#)[0];
        assert_eq!(problem.severity, Severity::Unstable, "{problem}");
        assert!(problem.to_string().contains("bores.csv"), "{problem}");
    }

    /// Checks rows of `benches/stability/stream-10/map.csv`: a stream of 2 m/s on cells of 2.8575 mm.
    #[test]
    fn a_stream_is_judged_by_a_map_of_streams() {
        let unstable = |cell: f64, operator: &str, eddies: bool| {
            let text = examples::find("dam-break").unwrap().text;
            let mut set = vec![
                format!("{LATTICE}.kinematic_viscosity={}", 2.0 * 0.002_857_5 / cell),
                format!(r#"{LATTICE}.surface.water=[{{"level": 0.0857}}]"#),
                "time.end=0.1".to_owned(),
                format!(r#"{LATTICE}.collision={{"{operator}": {{}}}}"#),
                format!(
                    r#"{LATTICE}.boundaries[1]={{"name": "in", "face": "x_min",
                        "patch": {{"from": [0, 0], "to": [0, 0.0857]}},
                        "condition": {{"velocity": {{"profile": {{"uniform": [2, 0]}}}}}}}}"#
                ),
            ];
            if eddies {
                set.push(format!(r#"{LATTICE}.turbulence={{"smagorinsky": {{}}}}"#));
            }
            let document = Document::read(text, &set, Path::new(".")).unwrap();
            let warnings = Plan::prepare(document).unwrap().warnings;
            let unstable = |p: &&Problem| p.severity == Severity::Unstable;
            let paths = warnings.iter().filter(unstable).map(|p| p.path.clone());
            paths.collect::<Vec<_>>()
        };
        assert!(unstable(1e4, "bgk", true).is_empty());
        assert!(unstable(20.0, "trt", true).is_empty());
        assert!(unstable(9.0, "trt", false).is_empty());
        let found = unstable(60.0, "trt", true);
        assert!(found[0].contains("boundaries[1]"), "{found:?}");
        assert!(!unstable(21.0, "trt", false).is_empty());
    }

    #[test]
    fn water_at_a_level_does_not_fall() {
        let still = [
            format!("{LATTICE}.kinematic_viscosity=1e-6"),
            format!("{LATTICE}.surface.water=[{{\"level\": 0.1}}]"),
        ];
        assert!(found(&still).is_empty());
    }
}
