//! Tests of the promises for seepage: the rows, the lengths of known scenes, the spacing that follows.

use super::*;
use case::Document;
use serde_json::{Value, json};
use std::path::Path;

#[test]
fn every_line_of_the_table_is_a_row() {
    let lines = [TABLE, TABLE_GRADED].map(|table| table.lines().count());
    assert_eq!(rows().len() + 2, lines[0] + lines[1]);
    for row in rows() {
        assert!(row.error > 0.0 && row.error.is_finite(), "{row:?}");
        assert!(row.cells > 0.0 && !row.problem.is_empty(), "{row:?}");
    }
    assert!(rows().len() > 500);
}

#[test]
fn bounds_lie_above_their_rows_and_fall_with_cells() {
    let (mut known, mut outside) = (0, 0);
    for ((ground, answer), rows) in groups() {
        let Some(bound) = bound(ground, answer) else {
            continue;
        };
        for row in rows {
            known += 1;
            let growth = growth(row.cells, row.widening);
            let of = |cells: f64| bound.error(cells, growth).unwrap();
            outside += usize::from(of(row.cells) < row.error);
            assert!(of(1.1 * row.cells) <= of(row.cells) * (1.0 + 1e-9));
            let cells = |target| bound.cells_for(target, growth);
            assert!(cells(0.1) <= cells(0.05) && cells(0.05) <= cells(0.02));
        }
        assert_eq!(bound.error(0.9 * bound.cells[0], 0.0), None);
    }
    assert!(known > 500 && 20 * outside <= known, "{outside} of {known}");
}

/// Checks that bounds made without a problem hold for it.
#[test]
fn a_problem_that_is_left_out_keeps_the_bound_of_the_others() {
    let (mut judged, mut kept) = (0, 0);
    for ((ground, answer), rows) in groups() {
        let mut problems: Vec<&str> = rows.iter().map(|row| row.problem.as_str()).collect();
        problems.dedup();
        let (mut own, mut own_kept) = (0, 0);
        for problem in &problems {
            let others = rows.iter().copied().filter(|row| row.problem != *problem);
            let Some(bound) = bound_of(&others.collect::<Vec<_>>()) else {
                continue;
            };
            for row in rows.iter().filter(|row| row.problem == *problem) {
                if let Some(error) = bound.error(row.cells, growth(row.cells, row.widening)) {
                    own += 1;
                    own_kept += usize::from(row.error <= error);
                }
            }
        }
        println!(
            "{ground}, {answer}: {own_kept} of {own}, {} problems",
            problems.len()
        );
        judged += own;
        kept += own_kept;
    }
    assert!(
        judged > 500 && 20 * kept >= 19 * judged,
        "{kept} of {judged}"
    );
}

/// Flat base of 8 m with a cut-off of 3 m below its middle on a stratum of 12 m, with a head of 4 m, in ground that
/// conducts `ratio` times better along x than along y.
fn dam(ratio: f64, spacing: Option<f64>) -> Value {
    let patch = |name: &str, from: f64, to: f64, head: f64| {
        json!({"name": name, "face": "y_max", "patch": {"from": [from, 0], "to": [to, 12]},
            "condition": {"head": {"value": head}}})
    };
    let mut case = json!({
        "domain": {"size": [104, 12]},
        "gravity": [0, -9.81],
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 1e-3,
            "zones": [{"name": "sand", "permeability": {"hydraulic_conductivity": 1e-4}, "anisotropy": ratio}],
            "boundaries": [patch("upstream", 0.0, 48.0, 16.0), patch("downstream", 56.0, 104.0, 12.0)]
        }},
        "structures": [{"name": "wall", "shape": {"box": {"from": [51.9999, 9], "to": [52.0001, 13]}}}],
        "probes": [
            {"name": "under", "every": 1, "at": {"section": {"axis": "x", "position": 52}}},
            {"name": "base", "every": 1, "at": {"uplift": {"axis": "y", "position": 12,
                "part": {"from": [48, 0], "to": [56, 12]}, "about": [48, 12]}}}
        ],
        "time": {"end": 1, "solid_time_step": 0.1}
    });
    if let Some(spacing) = spacing {
        case["domain"]["spacing"] = json!(spacing);
    }
    case
}

fn scene(case: &Value) -> Scene {
    let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
    Scene::resolve(&document.case)
        .unwrap_or_else(|p| panic!("{p:#?}"))
        .0
}

fn cells(scene: &Scene, what: &str) -> f64 {
    let ground = scene.chosen.ground.as_ref().unwrap();
    let found = ground
        .lengths
        .iter()
        .find(|length| length.what.contains(what));
    found.unwrap_or_else(|| panic!("{what}: {ground:#?}")).cells
}

fn error(scene: &Scene, answer: &str) -> Option<f64> {
    let mut answers = scene.chosen.answers.iter();
    answers
        .find(|found| found.answer == answer)
        .and_then(|found| found.error)
}

/// Checks the promised discharge of flat dams without a cut-off, of which no row of the table is made, against the
/// errors that runs have: half base b, depth T \[m\], cells across the shortest length and error against q = k h K'/(2
/// K), with the modulus tanh(π b/2T).
#[test]
fn the_discharge_below_a_short_flat_dam_is_within_its_promise() {
    for (half, depth, spacing, measured) in [
        (1.0, 2.0, 1.0 / 3.0, 0.0618),
        (1.0, 2.0, 0.4, 0.0737),
        (1.0, 2.0, 2.0 / 17.0, 0.0224),
        (0.5, 2.0, 1.0 / 6.0, 0.0471),
        (0.3, 1.0, 0.1, 0.0505),
    ] {
        let (heel, toe) = (4.0 * depth, 4.0 * depth + 2.0 * half);
        let long = toe + 4.0 * depth;
        let mut case = dam(1.0, Some(spacing));
        case["domain"]["size"] = json!([long, depth]);
        for (n, [from, to]) in [[0.0, heel], [toe, long]].into_iter().enumerate() {
            let patch = &mut case["fluid"]["darcy"]["boundaries"][n]["patch"];
            *patch = json!({"from": [from, 0], "to": [to, depth]});
        }
        case.as_object_mut().unwrap().remove("structures");
        case["probes"] = json!([
            {"name": "under", "every": 1, "at": {"section": {"axis": "x", "position": heel + half}}}
        ]);
        let scene = scene(&case);
        let promised = error(&scene, "under: discharge").unwrap();
        assert!(
            promised >= measured,
            "{half} {depth}: {promised} {measured}"
        );
    }
}

#[test]
fn lengths_of_a_dam_with_a_cut_off() {
    let scene = scene(&dam(1.0, Some(0.5)));
    let ground = scene.chosen.ground.as_ref().unwrap();
    assert_eq!(ground.kind, lengths::SATURATED);
    assert!((ground.drop - 4.0).abs() < 1e-12);
    for (what, wanted) in [
        ("structure `wall` along y", 6.0),
        ("ground before `wall`", 18.0),
        ("y_max from 48 to 52", 8.0),
        ("y_max from 52 to 56", 8.0),
        ("height", 24.0),
    ] {
        assert!((cells(&scene, what) - wanted).abs() < 1e-9, "{what}");
    }
    assert!((ground.cells() - 6.0).abs() < 1e-9);
    let force = scene
        .chosen
        .answers
        .iter()
        .find(|a| a.answer == "base: force")
        .unwrap();
    assert!((force.scale.unwrap() / (9810.0 * 4.0 * 8.0) - 1.0).abs() < 1e-9);
}

/// Checks ground with k_h = 4 k_v against its isotropic twin, in which lengths along x are halved: the base is the
/// shortest length, with cells as high as before.
#[test]
fn anisotropic_ground_has_the_lengths_of_its_twin() {
    let scene = scene(&dam(4.0, Some(0.5)));
    assert!((cells(&scene, "y_max from 48 to 52") - 4.0).abs() < 1e-9);
    assert!((cells(&scene, "structure `wall` along y") - 6.0).abs() < 1e-9);
}

#[test]
fn edges_within_cells_are_another_kind_of_ground() {
    let mut case = dam(1.0, Some(0.5));
    case["fluid"]["darcy"]["boundaries"][0]["patch"]["to"][0] = json!(48.2);
    let scene = scene(&case);
    let kind = &scene.chosen.ground.as_ref().unwrap().kind;
    assert_eq!(*kind, format!("{}{WITHIN_CELLS}", lengths::SATURATED));
}

/// Checks that the exit gradient is promised next to a wall only: at the edge of a base it grows without bound.
#[test]
fn an_exit_gradient_at_the_edge_of_a_base_is_not_promised() {
    let mut case = dam(1.0, Some(0.5));
    let exit = "seepage.exit_gradients.downstream.gradient";
    let free = scene(&case);
    assert!(
        free.chosen
            .answers
            .iter()
            .all(|answer| answer.answer != exit)
    );
    case["structures"][0]["shape"]["box"] = json!({"from": [55.9999, 9], "to": [56.0001, 13]});
    let walled = scene(&case);
    assert!(error(&walled, exit).is_some_and(|error| error > 0.0));
}

#[test]
fn finer_cells_are_promised_smaller_errors() {
    let errors = [1.0, 0.5, 0.25].map(|h| {
        let scene = scene(&dam(1.0, Some(h)));
        ["under: discharge", "base: force", "base: torque_z"]
            .map(|answer| error(&scene, answer).unwrap())
    });
    for pair in errors.windows(2) {
        for (coarse, fine) in pair[0].iter().zip(pair[1]) {
            assert!(fine < 0.8 * coarse, "{errors:?}");
        }
    }
    let reason = format!(
        "{:?}",
        scene(&dam(1.0, Some(0.5)))
            .chosen
            .reason_of(Subject::Accuracy)
    );
    assert!(
        reason.contains("discharge") && reason.contains("6 cells"),
        "{reason}"
    );
}

/// Checks that a smaller target takes finer cells, that the promise is within it, and that heel and toe lie on faces.
#[test]
fn the_spacing_follows_from_the_accuracy() {
    let mut last = f64::INFINITY;
    for (level, target) in [("draft", 0.1), ("normal", 0.05), ("reference", 0.02)] {
        let mut case = dam(1.0, None);
        case["accuracy"] = json!(level);
        let scene = scene(&case);
        let h = scene.grid.spacing;
        assert!(h < last, "{level}: {h}");
        last = h;
        assert!(
            scene.chosen.promised.unwrap() <= target,
            "{level}: {:?}",
            scene.chosen.answers
        );
        let ground = scene.chosen.ground.as_ref().unwrap();
        assert_eq!(ground.kind, lengths::SATURATED, "{h}");
        let reason = scene.chosen.reason_of(Subject::Spacing).unwrap();
        assert!(reason.contains("structure `wall` along y"), "{reason}");
    }
}

#[test]
fn ground_of_which_no_row_exists_has_no_promise() {
    let zone = "fluid.darcy.zones[0].polygon";
    let polygon = json!({"points": [[0, 0], [104, 0], [104, 12], [0, 12]]});
    let mut outlined = dam(1.0, Some(0.5));
    outlined["fluid"]["darcy"]["zones"][0]["polygon"] = polygon;
    let mut pumped = dam(1.0, Some(0.5));
    pumped["fluid"]["darcy"]["boundaries"][0]["condition"] = json!({"flux": {"value": 1e-6}});
    for (case, reason) in [
        (outlined, "polygon"),
        (pumped, "fluxes"),
        (dam(1.0, Some(4.0)), "no measured row covers"),
    ] {
        let scene = scene(&case);
        assert_eq!(scene.chosen.promised, None, "{zone}");
        let text = scene.chosen.reason_of(Subject::Accuracy).unwrap();
        assert!(
            text.contains(reason) && text.contains("solver estimate"),
            "{text}"
        );
    }
}

/// Checks the ground of a column of 1 m of Gardner's soil (1/alpha = 0.25 m) under 1e-5 m/s of rain for 5000 s: the
/// water passes 1e-5 * 5000/(0.4 - 0.1) m.
#[test]
fn lengths_of_a_column_that_is_wetted() {
    let case = json!({
        "domain": {"size": [0.1, 1], "spacing": 0.025},
        "gravity": [0, -9.81],
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 1e-3,
            "zones": [{"name": "loam", "permeability": {"hydraulic_conductivity": 1e-4}}],
            "unsaturated": {
                "retention": {"gardner": {"alpha": 4, "saturated_content": 0.4, "residual_content": 0.1}},
                "transient": {"initial": {"pressure_head": -2}}
            },
            "boundaries": [
                {"name": "sky", "face": "y_max", "condition": {"flux": {"value": 1e-5}}},
                {"name": "base", "face": "y_min", "condition": {"pressure": {"value": -19620}}}
            ]
        }},
        "probes": [{"name": "profile", "every": 5000,
            "at": {"line": {"from": [0.05, 0.01], "to": [0.05, 0.99], "points": 50}}}],
        "time": {"end": 5000, "solid_time_step": 50}
    });
    let scene = scene(&case);
    let ground = scene.chosen.ground.as_ref().unwrap();
    assert_eq!(ground.kind, INFILTRATION);
    assert!((cells(&scene, "capillary length") - 10.0).abs() < 1e-9);
    assert!((cells(&scene, "water passes") - 5e-2 / 0.3 / 0.025).abs() < 1e-9);
    assert!(
        ground
            .lengths
            .iter()
            .all(|length| !length.what.contains("length of the ground"))
    );
    assert!(error(&scene, "profile: front").is_some());
}

/// Checks a seam of 0.2 m at draft: cells that hold the wall alone would be thicker than the rows allow.
#[test]
fn a_thin_layer_bounds_the_cells() {
    let mut case = dam(1.0, None);
    case["accuracy"] = json!("draft");
    let seam = json!({"name": "seam", "region": {"layer": {"from": 4.0, "to": 4.2}},
        "permeability": {"hydraulic_conductivity": 1e-6}});
    case["fluid"]["darcy"]["zones"]
        .as_array_mut()
        .unwrap()
        .push(seam);
    let scene = scene(&case);
    assert!(cells(&scene, "zone from 4 to 4.2") >= MIN_LAYER);
    assert!(scene.chosen.promised.is_some_and(|error| error <= 0.1));
}
