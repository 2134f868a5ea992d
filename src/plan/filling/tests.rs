//! Tests of the findings on basins that fill. The basin is 0.4 m long and 0.3 m high, and 0.08 m² of it are free
//! above the water of the start.

use crate::Plan;
use base::error::{Problem, Severity};
use case::Document;
use serde_json::{Value, json};
use std::path::Path;

/// Returns a basin with an inlet on the left, other boundaries and an end of the run \[s\].
fn basin(inlet: &Value, others: &[Value], end: f64) -> Value {
    let mut boundaries = vec![inlet.clone()];
    boundaries.extend_from_slice(others);
    json!({
        "title": "basin", "gravity": [0, -9.81],
        "domain": {"size": [0.4, 0.3], "spacing": 0.02},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 5e-4,
            "surface": {"water": [{"level": 0.1}]}, "boundaries": boundaries}},
        "time": {"end": end}
    })
}

/// Returns a discharge on the left.
fn discharge(value: f64) -> Value {
    json!({"name": "in", "face": "x_min", "condition": {"discharge": {"value": value}}})
}

/// Returns a velocity through 0.1 m of the left face.
fn velocity(value: f64, more: &Value) -> Value {
    let mut condition = json!({"profile": {"uniform": [value, 0]}});
    for (name, field) in more.as_object().unwrap() {
        condition[name] = field.clone();
    }
    json!({"name": "in", "face": "x_min", "patch": {"from": [0, 0.06], "to": [0, 0.16]},
        "condition": {"velocity": condition}})
}

/// Returns an outlet on the right between two heights.
fn outlet(condition: &Value, from: f64, to: f64) -> Value {
    json!({"name": "out", "face": "x_max", "condition": condition,
        "patch": {"from": [0.4, from], "to": [0.4, to]}})
}

/// Returns the finding of a case about a full box.
fn found(case: &Value) -> Option<Problem> {
    let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
    let all = match Plan::prepare(document) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    };
    all.into_iter()
        .find(|problem| problem.reason.contains("full after"))
}

/// Returns severity of the finding, and the time after which the box is full \[s\].
fn full(case: &Value) -> Option<(Severity, f64)> {
    let problem = found(case)?;
    let (_, after) = problem.reason.split_once("full after ").unwrap();
    let (time, _) = after.split_once(" s").unwrap();
    Some((problem.severity, time.parse().unwrap()))
}

/// Checks that the time is that of the free volume over the inflow, and that the case is refused once the rest of the
/// inflow exceeds a fifth of the basin.
#[test]
fn a_basin_without_an_outlet_is_full_after_a_known_time() {
    let closed = |end: f64| full(&basin(&discharge(0.05), &[], end));
    assert_eq!(closed(1.59), None);
    assert_eq!(closed(1.7), Some((Severity::Unstable, 1.6)));
    assert_eq!(closed(2.05), Some((Severity::Unstable, 1.6)));
    assert_eq!(closed(2.15), Some((Severity::Error, 1.6)));
    let reason = |end: f64| found(&basin(&discharge(0.05), &[], end)).unwrap().reason;
    assert!(reason(1.7).ends_with("presses on the lid"));
    assert!(reason(2.05).ends_with("may end the run"));
    assert!(reason(2.15).ends_with("= 0.2 ends the run"));
    let problem = found(&basin(&discharge(0.05), &[], 1.7)).unwrap();
    assert!(
        problem
            .path
            .ends_with("boundaries[0].condition.discharge.value"),
        "{problem}"
    );
    let proposed = problem.remedy.proposal()[0].value.as_f64().unwrap();
    approx::assert_relative_eq!(proposed, 0.95 * 1.6, max_relative = 1e-3);
    assert_eq!(found(&basin(&discharge(0.05), &[], 0.95 * 1.6)), None);
}

/// Checks inflows by tables and with ramps: 0.05 m² enter within the first second, and 0.1 m²/s from then on; 0.025
/// m² within a ramp, and 0.05 m²/s from then on; and a pulse that is shorter than a part of the run.
#[test]
fn tables_and_ramps_are_summed() {
    let table = |rows: &Value| {
        let condition = json!({"discharge": {"value": 0, "history": rows}});
        json!({"name": "in", "face": "x_min", "condition": condition})
    };
    let (severity, time) = full(&basin(&table(&json!([[0, 0], [1, 0.1]])), &[], 1.4)).unwrap();
    assert_eq!((severity, time), (Severity::Unstable, 1.3));
    let pulse = json!([[0, 0], [5, 0], [5, 81], [5.001, 81], [5.001, 0]]);
    assert_eq!(
        full(&basin(&table(&pulse), &[], 10.0)).map(|found| found.0),
        Some(Severity::Unstable)
    );
    let less = json!([[0, 0], [5, 0], [5, 79], [5.001, 79], [5.001, 0]]);
    assert_eq!(found(&basin(&table(&less), &[], 10.0)), None);
    let path = found(&basin(&table(&pulse), &[], 10.0)).unwrap().path;
    assert!(path.ends_with("discharge.history"), "{path}");
    let jet = |more: &Value, end: f64| full(&basin(&velocity(0.5, more), &[], end));
    assert_eq!(jet(&json!({}), 1.7), Some((Severity::Unstable, 1.6)));
    assert_eq!(jet(&json!({"ramp_time": 1}), 2.05), None);
    assert_eq!(
        jet(&json!({"ramp_time": 1}), 2.2),
        Some((Severity::Unstable, 2.1))
    );
    // Water that flows back by the table leaves again.
    let tide = json!({"history": [[0, 1], [1, 1], [1, -1], [2, -1], [2, 1], [3, 1]]});
    assert_eq!(jet(&tide, 3.5), None);
    assert_eq!(jet(&tide, 3.7), Some((Severity::Unstable, 3.6)));
}

/// Checks that a stated outflow is subtracted: 0.03 m²/s of 0.05 m²/s leave.
#[test]
fn a_pump_takes_its_part() {
    let pump = json!({"name": "pump", "face": "y_min", "condition": {"velocity": {"profile": {"uniform": [0, -0.3]}}},
        "patch": {"from": [0.2, 0], "to": [0.3, 0]}});
    assert_eq!(
        found(&basin(&discharge(0.05), std::slice::from_ref(&pump), 3.9)),
        None
    );
    let (_, time) = full(&basin(&discharge(0.05), &[pump], 4.2)).unwrap();
    approx::assert_relative_eq!(time, 4.0, max_relative = 1e-3);
}

/// Checks that structures take space: a wall to the lid halves the basin, and one that ends below it only takes its
/// own volume.
#[test]
fn structures_take_room_and_part_it() {
    let walled = |top: f64, end: f64| {
        let mut case = basin(&discharge(0.05), &[], end);
        case["structures"] =
            json!([{"name": "wall", "shape": {"box": {"from": [0.2, -1], "to": [0.24, top]}}}]);
        full(&case)
    };
    assert_eq!(walled(1.0, 0.85), Some((Severity::Unstable, 0.8)));
    assert_eq!(walled(0.2, 1.35), None);
    // 0.02 m x 0.1 m less than the whole basin, as the wall stands to 0.1 m in the water of the start.
    assert_eq!(walled(0.2, 1.6), Some((Severity::Unstable, 1.52)));
    let fixed = json!([{"name": "pier", "shape": {"disc": {"radius": 0.05}}, "position": [0.2, 0.2],
        "motion": {"fixed": {}}, "material": "rock"}]);
    let mut case = basin(&discharge(0.05), &[], 1.59);
    case["materials"] = json!({"rock": {"density": 2600}});
    case["coupling"] = json!({"partially_saturated": {}});
    case["bodies"] = fixed;
    let (_, time) = full(&case).unwrap();
    let exact = (0.08 - std::f64::consts::PI * 0.0025) / 0.05;
    approx::assert_relative_eq!(time, exact, max_relative = 0.02);
    // A body that may leave the water takes no space.
    case["bodies"][0]["motion"] = json!({"free": {}});
    case["contact"] =
        json!({"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}});
    assert_eq!(full(&case), None);
}

/// Checks a slot of 0.04 m at the floor, which passes at most 0.095 m²/s, with the water at the lid.
#[test]
fn an_outlet_that_is_too_small_is_named() {
    let slot = outlet(&json!({"outfall": {}}), 0.0, 0.04);
    let through =
        |inflow: f64, end: f64| found(&basin(&discharge(inflow), std::slice::from_ref(&slot), end));
    assert_eq!(through(0.05, 100.0), None);
    let likely = through(0.093, 100.0).unwrap();
    assert_eq!(likely.severity, Severity::Warning);
    assert!(likely.reason.contains("probably full"), "{likely}");
    let bound = through(0.12, 10.0).unwrap();
    assert!(
        bound.reason.contains("`out` lets out 0.1046 m2/s at most"),
        "{bound}"
    );
    assert!(!bound.reason.contains("probably"), "{bound}");
    assert_eq!(bound.severity, Severity::Warning);
    assert_eq!(through(0.12, 0.8), None);
}

/// Checks outfalls that take the whole section: critical flow passes 0.2 m²/s at 0.24 m of energy, and 0.45 m²/s need
/// 0.41 m, more than the lid and the velocity head. In runs the water had a mean depth of 0.18 m and reached the lid.
#[test]
fn an_outfall_is_judged_by_critical_flow() {
    let outfall = json!({"name": "out", "face": "x_max", "condition": {"outfall": {}}});
    let over = |inflow: f64| {
        found(&basin(
            &discharge(inflow),
            std::slice::from_ref(&outfall),
            20.0,
        ))
    };
    assert_eq!(over(0.2), None);
    assert_eq!(over(0.3), None);
    let problem = over(0.45).unwrap();
    assert_eq!(problem.severity, Severity::Warning);
    assert!(problem.reason.contains("probably full"), "{problem}");
    // A jet that is faster than the water below the lid has the energy to leave.
    let jet = velocity(3.0, &json!({}));
    assert_eq!(
        found(&basin(
            &jet,
            &[outlet(&json!({"outfall": {}}), 0.0, 0.16)],
            20.0
        )),
        None
    );
}

/// Checks a slot to a level: 0.04 m pass 0.079 m²/s from a level of 0.3 m to one of 0.1 m without loss.
#[test]
fn a_level_beyond_a_slot_bounds_its_discharge() {
    let to = |level: f64| outlet(&json!({"level": {"value": level}}), 0.0, 0.04);
    let through = |inflow: f64, level: f64| found(&basin(&discharge(inflow), &[to(level)], 20.0));
    assert_eq!(through(0.055, 0.1), None);
    assert!(through(0.075, 0.1).is_some_and(|one| one.reason.contains("probably full")));
    assert!(through(0.1, 0.1).is_some_and(|one| !one.reason.contains("probably full")));
    // The lower the level outside, the more leaves.
    assert_eq!(through(0.07, 0.04), None);
    // An opening as high as the water holds its level.
    let whole = json!({"name": "out", "face": "x_max", "condition": {"level": {"value": 0.1}}});
    assert_eq!(found(&basin(&discharge(0.2), &[whole], 20.0)), None);
}

/// Checks what has no bound: an outfall in the lid, through which a full box overflows, and a force along a period.
#[test]
fn outlets_without_a_bound_have_no_finding() {
    let hatch = json!({"name": "out", "face": "y_max", "condition": {"outfall": {}},
        "patch": {"from": [0.2, 0.3], "to": [0.24, 0.3]}});
    assert_eq!(found(&basin(&discharge(0.2), &[hatch], 20.0)), None);
    let rain = json!({"name": "in", "face": "y_max", "condition": {"velocity": {"profile": {"uniform": [0, -1]}}},
        "patch": {"from": [0.1, 0.3], "to": [0.2, 0.3]}});
    let drain = json!({"name": "out", "face": "y_min", "condition": {"outfall": {}},
        "patch": {"from": [0.1, 0], "to": [0.12, 0]}});
    let mut case = basin(&rain, &[drain], 20.0);
    assert!(found(&case).is_some());
    case["domain"]["periodic"] = json!(["x"]);
    assert!(found(&case).is_some());
    case["gravity"] = json!([1, -9.81]);
    assert_eq!(found(&case), None);
    // Without an outlet the volume counts, whatever drives the water.
    case["fluid"]["lattice_boltzmann"]["boundaries"] = json!([rain]);
    assert_eq!(full(&case), Some((Severity::Error, 0.8)));
}

/// Checks that a run that is continued with another inflow is not judged, as its water is not that of the case.
#[test]
fn a_continued_run_with_another_inflow_is_not_judged() {
    let case = |speed: f64| basin(&velocity(speed, &json!({})), &[], 1.7);
    let document = |case: &Value| Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
    let named = |plan: &Plan| {
        plan.warnings
            .iter()
            .any(|one| one.reason.contains("full after"))
    };
    let first = Plan::prepare(document(&case(0.5))).unwrap();
    let same = Plan::prepare_like(document(&case(0.5)), &first).unwrap();
    let other = Plan::prepare_like(document(&case(0.6)), &first).unwrap();
    assert!(named(&first) && named(&same) && !named(&other));
}

/// Checks a basin in three dimensions, and gravity that is inclined.
#[test]
fn the_volume_counts_in_three_dimensions_and_on_a_slope() {
    let mut case = basin(&discharge(0.05 * 0.1), &[], 1.7);
    case["domain"]["size"] = json!([0.4, 0.3, 0.1]);
    case["gravity"] = json!([0, -9.81, 0]);
    let problem = found(&case).unwrap();
    assert!(problem.reason.contains("0.008 m3 are free"), "{problem}");
    assert_eq!(full(&case), Some((Severity::Unstable, 1.6)));
    let mut slope = basin(&discharge(0.05), &[], 1.7);
    slope["gravity"] = json!([3, -9.3]);
    assert_eq!(full(&slope), Some((Severity::Unstable, 1.6)));
}

/// Checks levels in the last row of cells: those up to 0.2 cells below the lid fill up in a run.
#[test]
fn a_level_just_below_the_lid_is_named() {
    let found = |level: f64| {
        let text = format!(
            r#"{{"gravity": [0, -9.81], "domain": {{"size": [0.4, 0.3], "spacing": 0.02}},
                "fluid": {{"lattice_boltzmann": {{"density": 1000, "kinematic_viscosity": 1e-3, "time_step": 5e-4,
                    "surface": {{"water": [{{"level": {level}}}]}}}}}}, "time": {{"end": 0.1}}}}"#
        );
        let document = Document::read(&text, &[], Path::new(".")).unwrap();
        let warnings = Plan::prepare(document).unwrap().warnings;
        let named = |w: &&Problem| w.reason.contains("below the lid");
        warnings
            .iter()
            .find(named)
            .map(|w| w.remedy.proposal()[0].value.clone())
    };
    assert_eq!(found(0.299).and_then(|level| level.as_f64()), Some(0.28));
    assert!(found(0.297).is_some());
    for level in [0.3, 0.295, 0.28, 0.15] {
        assert_eq!(found(level), None, "{level}");
    }
}
