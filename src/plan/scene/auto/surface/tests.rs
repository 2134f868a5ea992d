//! Tests of the promises for water with a free surface: the rows, and the flows of known scenes.

use super::*;
use crate::Plan;
use case::{Document, examples};
use serde_json::{Value, json};
use std::path::Path;

#[test]
fn every_line_of_the_table_is_a_row() {
    assert_eq!(rows().len() + 1, TABLE.lines().count());
    for row in rows() {
        assert!(row.error > 0.0 && row.error.is_finite(), "{row:?}");
        assert!(row.cells > 0.0 && row.reynolds > 0.0, "{row:?}");
        assert!(row.shape > 0.0 && !row.problem.is_empty(), "{row:?}");
    }
    assert!(rows().len() > 200);
}

#[test]
fn bounds_lie_above_their_rows_and_fall_with_cells() {
    let (mut found, mut outside) = (0, 0);
    for ((flow, answer), rows) in groups() {
        let Some(Measured { bound, .. }) = known(flow, answer) else {
            continue;
        };
        for row in rows {
            found += 1;
            let error = bound.error(row.cells, row.reynolds).unwrap();
            outside += usize::from(error < row.error);
            let finer = bound.error(1.1 * row.cells, row.reynolds).unwrap();
            assert!(finer <= error * (1.0 + 1e-9));
        }
        assert_eq!(bound.error(0.9 * bound.cells[0], 0.0), None);
    }
    assert!(found > 200 && 20 * outside <= found, "{outside} of {found}");
}

/// Checks that bounds made without a problem hold for it.
#[test]
fn a_problem_that_is_left_out_keeps_the_bound_of_the_others() {
    let (mut judged, mut kept) = (0, 0);
    for ((flow, answer), rows) in groups() {
        let mut problems: Vec<&str> = rows.iter().map(|row| row.problem.as_str()).collect();
        problems.dedup();
        let (mut own, mut own_kept) = (0, 0);
        for problem in &problems {
            let others = rows.iter().copied().filter(|row| row.problem != *problem);
            let Some(others) = measured(&others.collect::<Vec<_>>()) else {
                continue;
            };
            for row in rows.iter().filter(|row| row.problem == *problem) {
                if let Some(error) = others.bound.error(row.cells, row.reynolds) {
                    own += 1;
                    own_kept += usize::from(row.error <= error);
                }
            }
        }
        println!(
            "{flow}, {answer}: {own_kept} of {own}, {} problems",
            problems.len()
        );
        judged += own;
        kept += own_kept;
    }
    assert!(
        judged > 100 && 20 * kept >= 19 * judged,
        "{kept} of {judged}"
    );
}

/// Returns the plan of a case.
fn plan(case: &Value) -> Plan {
    let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
    Plan::prepare(document).unwrap()
}

fn flow(case: &Value) -> Result<SurfaceFlow, String> {
    kinds::find(&plan(case).scene)
}

/// Returns a tank of 2 by 0.3 m with cells of 10 mm and free slip at its floor and its ends.
fn tank(water: &Value) -> Value {
    let slip = |face: &str| json!({"name": face, "face": face, "condition": {"free_slip": {}}});
    json!({
        "domain": {"size": [2, 0.3], "spacing": 0.01},
        "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-3, "time_step": 2e-4,
            "surface": {"water": water}, "boundaries": [slip("y_min"), slip("x_min"), slip("x_max")]}},
        "time": {"end": 0.2},
        "probes": [{"name": "g", "every": 0.01, "at": {"gauge": {"position": [1, 0]}}}]
    })
}

#[test]
fn waves_and_dams_are_found_with_their_numbers() {
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-6, "{a} for {b}");
    let wave = json!([{"wave": {"level": 0.2, "amplitude": 0.005, "axis": "x", "waves": 2}}]);
    let found = flow(&tank(&wave)).unwrap();
    assert_eq!(found.kind, "standing wave (TRT)");
    let k = std::f64::consts::TAU;
    near(found.lengths[0].size, 1.0 / k);
    near(found.cells(), 100.0 / k);
    near(found.shape, k * 0.005);
    near(found.speed, (9.81 / k * (0.2 * k).tanh()).sqrt());

    let wave =
        json!([{"solitary_wave": {"level": 0.2, "height": 0.04, "axis": "x", "crest": 0.8}}]);
    let found = flow(&tank(&wave)).unwrap();
    assert_eq!(found.kind, "solitary wave (TRT)");
    near(found.cells(), 20.0);
    near(found.shape, 0.2);

    let column = json!({"shape": {"box": {"from": [0, 0], "to": [0.3, 0.2]}}});
    let found = flow(&tank(&json!([column]))).unwrap();
    assert_eq!(found.kind, "dam over a dry bed (TRT)");
    near(found.shape, 0.2 / (0.2_f64 / 9.81).sqrt());
    near(found.cell_reynolds, (2.0 * 9.81 * 0.2_f64).sqrt() * 10.0);
    let found = flow(&tank(&json!([column, {"level": 0.05}]))).unwrap();
    assert_eq!(found.kind, "dam over a wet bed (TRT)");
    near(found.cells(), 15.0);
}

#[test]
fn flows_that_were_not_measured_are_named() {
    let said = |case: &Value, part: &str| {
        let reason = flow(case).unwrap_err();
        assert!(reason.contains(part), "{reason}");
    };
    let column = json!([{"shape": {"box": {"from": [0, 0], "to": [0.3, 0.2]}}}]);
    let mut long = tank(&column);
    long["time"]["end"] = json!(2);
    said(&long, "can reach the other end");
    let mut rough = tank(&column);
    rough["fluid"]["lattice_boltzmann"]["boundaries"] = json!([]);
    said(&rough, "friction");
    let mut structured = tank(&column);
    structured["structures"] =
        json!([{"name": "sill", "shape": {"box": {"from": [1, 0], "to": [1.2, 0.1]}}}]);
    said(&structured, "structures");
    let mut other = tank(&column);
    other["fluid"]["lattice_boltzmann"]["collision"] = json!({"bgk": {}});
    said(&other, "not with this operator");
    said(&tank(&json!([{"level": 0.2}])), "at rest");
    let drop = json!([{"shape": {"disc": {"centre": [1, 0.2], "radius": 0.05}}}]);
    said(&tank(&drop), "column");
}

/// Checks that the plan states its promise for a covered scene, and its ignorance for another one.
#[test]
fn the_plan_states_what_it_promises_and_that_it_does_not_know() {
    let column = json!([{"shape": {"box": {"from": [0, 0], "to": [0.3, 0.2]}}}]);
    let mut case = tank(&column);
    let lattice = &mut case["fluid"]["lattice_boltzmann"];
    lattice["kinematic_viscosity"] = json!(2e-3);
    case["time"]["end"] = json!(0.35);
    let made = plan(&case);
    let chosen = &made.scene.chosen;
    assert!(chosen.promised.is_some(), "{:?}", chosen.details);
    let names: Vec<&str> = chosen.answers.iter().map(|a| a.answer.as_str()).collect();
    assert_eq!(names, ["g: time of arrival", "g: depth at the end"]);
    let text = chosen.reason_of(Subject::Accuracy).unwrap();
    assert!(text.contains("at a confidence of 95 %"), "{text}");
    assert!(made.to_string().contains("answers within"), "{made}");

    case["probes"] = json!([{"name": "w", "every": 0.01, "at": {"wall": {"face": "x_max"}}}]);
    let made = plan(&case);
    let text = made.scene.chosen.reason_of(Subject::Accuracy).unwrap();
    assert!(
        text.starts_with("nothing is promised: no error was measured for this answer"),
        "{text}"
    );
    assert!(
        made.warnings
            .iter()
            .all(|warning| warning.path != "accuracy")
    );
    case["accuracy"] = json!("normal");
    let made = plan(&case);
    assert!(
        made.warnings
            .iter()
            .any(|warning| warning.path == "accuracy")
    );
}

/// Checks that every example with a free surface has a promise, or a reason for none.
#[test]
fn examples_with_a_surface_say_what_is_known() {
    let mut seen = 0;
    for example in examples::EXAMPLES {
        let document = Document::read(example.text, &[], Path::new(".")).unwrap();
        let made = Plan::prepare(document).unwrap();
        if made.scene.surface.is_some() {
            seen += 1;
            let chosen = &made.scene.chosen;
            assert!(
                chosen.reason_of(Subject::Accuracy).is_some(),
                "{}",
                example.name
            );
            assert!(!chosen.details.is_empty(), "{}", example.name);
        }
    }
    assert!(seen > 3);
}
