//! Seepage on cells of different widths: errors compared with those of equal cells, the same bits,
//! estimates, and what is refused.

use crate::estimate::done;
use crate::ranks::{Study, beside_others};
use solver::case::{Document, examples};
use solver::plan::Plan;
use std::f64::consts::PI;
use std::path::Path;

/// Cells of the sheet pile: as fine at its tip as the equal cells of the example, and wider by at most a tenth from
/// one to the next.
const PILE: &str = r#"fluid.darcy.grid={"spacing": [
    {"points": [[0, 0.24], [2.95, 0.0125], [3.05, 0.0125], [6, 0.24]]},
    {"points": [[0, 0.05], [0.45, 0.0125], [0.55, 0.0125], [1, 0.02]]}]}"#;

fn number(summary: &serde_json::Value, path: &str) -> f64 {
    summary
        .pointer(path)
        .and_then(serde_json::Value::as_f64)
        .unwrap()
}

/// Checks discharge k h/2 and exit gradient of a sheet pile to half the depth of its ground (Harr 1962): a fifth of
/// the cells has the error of equal cells.
#[test]
fn a_sheet_pile_has_the_error_of_equal_cells_on_a_fifth_of_them() {
    let _beside = beside_others();
    let study = Study::from_example(
        "sheet-pile",
        &[("output", "{}"), ("fluid.darcy.tolerance", "1e-10")],
    );
    let exit = PI / (4.0 * 1.854_074_677_301_371_7 * (0.25 * PI).sin());
    let errors = |run: &str| {
        let summary = study.summary(run);
        let discharge = number(&summary, "/seepage/outflow") / (1e-5 * 0.5) - 1.0;
        let gradient =
            number(&summary, "/seepage/exit_gradients/downstream/gradient") / (0.1 * exit);
        [discharge.abs(), (gradient - 1.0).abs()]
    };
    study.run("equal", 1, 1, &[]);
    study.run("graded", 1, 1, &[PILE]);
    let (equal, graded) = (errors("equal"), errors("graded"));
    let cells = |sets: &[&str]| {
        let plan = planned("sheet-pile", sets).unwrap();
        plan.scene.seepage.unwrap().cell_count()
    };
    let counts = [cells(&[]), cells(&[PILE])];
    println!("{counts:?} cells: {equal:?} {graded:?}");
    assert!(5 * counts[1] < counts[0], "{counts:?}");
    for (equal, graded) in equal.iter().zip(graded) {
        assert!(graded < 1.1 * equal, "{equal} {graded}");
    }
    // The water that passes below the pile is that which leaves.
    let summary = study.summary("graded");
    let (inflow, outflow) = (
        number(&summary, "/seepage/inflow"),
        number(&summary, "/seepage/outflow"),
    );
    assert!((inflow / outflow - 1.0).abs() < 1e-8, "{inflow} {outflow}");
}

/// Checks the discharge k (h1^2 - h2^2)/(2 L) of a rectangular dam with a phreatic surface and a seepage face.
#[test]
fn a_dam_on_graded_cells_has_the_exact_discharge() {
    let _beside = beside_others();
    let study = Study::from_example("earth-dam", &[("output", "{}"), ("probes", "[]")]);
    let grid = r#"fluid.darcy.grid={"spacing": [
        {"points": [[0, 0.25], [7, 0.25], [10, 0.05]]},
        {"points": [[0, 0.25], [2, 0.05], [4, 0.05], [10, 0.25]]}]}"#;
    study.run("graded", 1, 1, &[grid]);
    let discharge = number(&study.summary("graded"), "/seepage/outflow");
    println!("{discharge}");
    assert!((discharge / 4.8e-5 - 1.0).abs() < 1e-3, "{discharge}");
}

/// Checks infiltration on graded cells against the converged solution of Celia's column: mass, bits on ranks and
/// threads and after a restart.
#[test]
fn infiltration_into_graded_cells_closes_its_mass_with_the_same_bits() {
    let _beside = beside_others();
    let grid =
        r#"{"spacing": [{"width": 0.025}, {"points": [[0, 0.04], [0.6, 0.01], [1, 0.002]]}]}"#;
    let study = Study::from_example(
        "infiltration",
        &[
            ("time.end", "21600"),
            ("checkpoint", r#"{"every": 3600}"#),
            ("fluid.darcy.grid", grid),
        ],
    );
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    let mass = number(&one, "/seepage/mass_error");
    assert!(mass.abs() < 1e-10, "{mass}");
    let entered = (number(&one, "/seepage/water_in") - number(&one, "/seepage/water_out")) / 0.05;
    assert!((entered / 0.01740 - 1.0).abs() < 0.01, "{entered}");
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1), ("four", 4, 1)] {
        study.run(name, ranks, threads, &[]);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=10800"]);
    study.restart("parts", 3, &["time.end=21600"]).expect(0);
    study.same("straight", "parts");
}

fn planned(example: &str, sets: &[&str]) -> Result<Plan, Vec<solver::error::Problem>> {
    let text = examples::find(example).unwrap().text;
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    Document::read(text, &sets, Path::new(".")).and_then(Plan::prepare)
}

fn findings(example: &str, sets: &[&str]) -> Vec<(String, String)> {
    let found = match planned(example, sets) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    };
    found.into_iter().map(|p| (p.path, p.reason)).collect()
}

/// Checks that widths that are all equal are the equal cells of `cells`, that a domain without a spacing gets one, and
/// that the plan says why it promises nothing for other widths.
#[test]
fn equal_widths_are_equal_cells_and_others_have_their_own_promises() {
    let widths = r#"fluid.darcy.grid={"spacing": [{"width": 0.125}, {"points": [[0, 0.125]]}]}"#;
    let plan = planned("sheet-pile", &[widths]).unwrap();
    let seepage = plan.scene.seepage.as_ref().unwrap();
    assert!(!seepage.is_graded());
    let own = r#"fluid.darcy.grid={"from": [0, 0], "to": [6, 1], "cells": [48, 8]}"#;
    let equal = planned("sheet-pile", &[own]).unwrap();
    let other = equal.scene.seepage.as_ref().unwrap();
    assert_eq!(seepage.coarse_grid(2), other.coarse_grid(2));
    let plan = planned("sheet-pile", &[PILE, "domain.spacing=null"]).unwrap();
    assert!(
        plan.scene.grid.spacing <= 0.02,
        "{}",
        plan.scene.grid.spacing
    );
    let said = plan.to_string();
    assert!(said.contains("m along x"), "{said}");
    let ground = plan.scene.chosen.ground.as_ref().unwrap();
    assert_eq!(ground.kind, "saturated ground, graded cells");
    assert!(
        (ground.widening - 0.077).abs() < 0.005,
        "{}",
        ground.widening
    );
    // Cells of 19 mm touch the surface, the wider ones at the edges.
    assert!((ground.cells() - 25.9).abs() < 0.5, "{}", ground.cells());
    for (grid, reason) in [
        (
            r#"[{"widths": [2, 1, 0.2, 0.8, 2]}, {"width": 0.1}]"#,
            "differ in width by a factor of 5",
        ),
        (
            r#"[{"points": [[0, 0.2], [2.9, 0.1], [6, 0.2]]}, {"width": 0.1}]"#,
            "makes their end a face",
        ),
    ] {
        let plan = planned(
            "sheet-pile",
            &[&format!("fluid.darcy.grid={{\"spacing\": {grid}}}")],
        )
        .unwrap();
        assert_eq!(plan.scene.chosen.promised, None);
        let said = plan.to_string();
        assert!(said.contains(reason), "{said}");
    }
}

/// Checks the promised errors of a sheet pile on graded cells against the measured ones, on three nested grids.
#[test]
fn the_errors_of_a_sheet_pile_are_within_their_promises() {
    let _beside = beside_others();
    let study = Study::from_example(
        "sheet-pile",
        &[("output", "{}"), ("fluid.darcy.tolerance", "1e-10")],
    );
    let exit = 0.1 * PI / (4.0 * 1.854_074_677_301_371_7 * (0.25 * PI).sin());
    for (n, factor) in [1.0, 0.5, 4.0].into_iter().enumerate() {
        let grid = format!(
            r#"fluid.darcy.grid={{"spacing": [{{"points": [[0, {a}], [3, {b}], [6, {a}]]}},
                {{"points": [[0, {c}], [0.5, {b}], [1, {b}]]}}]}}"#,
            a = 0.24 * factor,
            b = 0.0125 * factor,
            c = 0.05 * factor
        );
        let run = format!("run{n}");
        study.run(&run, 1, 1, &[&grid]);
        let summary = study.summary(&run);
        let plan = planned("sheet-pile", &[&grid]).unwrap();
        for (name, found, exact) in [
            (
                "seepage.outflow",
                number(&summary, "/seepage/outflow"),
                5e-6,
            ),
            (
                "seepage.exit_gradients.downstream.gradient",
                number(&summary, "/seepage/exit_gradients/downstream/gradient"),
                exit,
            ),
        ] {
            let answers = &plan.scene.chosen.answers;
            let promised = answers.iter().find(|answer| answer.answer == name).unwrap();
            let (error, promised) = ((found / exact - 1.0).abs(), promised.error.unwrap());
            println!("{name} {factor}: {error} {promised}");
            assert!(
                error <= promised && promised < 0.3,
                "{name}: {error} {promised}"
            );
        }
    }
}

#[test]
fn wrong_grids_are_refused_by_name() {
    let grid = |text: &str| format!("fluid.darcy.grid={{{text}}}");
    let fine = r#"{"points": [[0, 0.1], [3, 0.05]]}"#;
    for (example, text, path, reason) in [
        (
            "sheet-pile",
            format!(r#""spacing": [{fine}]"#),
            "fluid.darcy.grid.spacing",
            "2 to 3 values are needed",
        ),
        (
            "sheet-pile",
            format!(r#""cells": [60, 10], "spacing": [{fine}, {{"width": 0.1}}]"#),
            "fluid.darcy.grid",
            "both a number of cells and widths",
        ),
        ("sheet-pile", String::new(), "fluid.darcy.grid", "neither"),
        (
            "sheet-pile",
            format!(r#""spacing": [{fine}, {{"width": 0.3}}]"#),
            "fluid.darcy.grid.spacing[1].width",
            "whole number",
        ),
        (
            "sheet-pile",
            format!(r#""spacing": [{fine}, {{"widths": [0.5, 0.4]}}]"#),
            "fluid.darcy.grid.spacing[1].widths",
            "add up to 0.9 m",
        ),
        (
            "sheet-pile",
            format!(r#""spacing": [{fine}, {{"points": [[0.5, 0.1], [0.2, 0.1]]}}]"#),
            "fluid.darcy.grid.spacing[1].points[1]",
            "not above",
        ),
        (
            "sheet-pile",
            r#""spacing": [{"widths": [2, 1, 0.2, 0.8, 2]}, {"width": 0.1}]"#.to_owned(),
            "fluid.darcy.grid.spacing[0]",
            "differ in width by a factor of 5",
        ),
        (
            "seepage",
            r#""spacing": [{"points": [[0, 0.01], [0.02, 0.005]]}, {"width": 0.01}, {"width": 0.01}]"#.to_owned(),
            "fluid.darcy.grid.spacing",
            "need equal cells",
        ),
    ] {
        let found = findings(example, &[&grid(&text)]);
        let named = found.iter().any(|(at, why)| at == path && why.contains(reason));
        assert!(named, "{text}: {found:?}");
    }
}

/// Checks that an estimate halves the cells twice, and that its intervals contain the exact discharge and exit
/// gradient.
#[test]
fn an_estimate_halves_graded_cells() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("pile.json");
    std::fs::write(&file, examples::find("sheet-pile").unwrap().text).unwrap();
    let output = folder.path().join("out");
    let sets = [
        PILE,
        "output={}",
        "probes=[]",
        "fluid.darcy.tolerance=1e-10",
    ];
    let mut more = vec!["--output", output.to_str().unwrap()];
    sets.iter().for_each(|set| more.extend(["--set", set]));
    let said = done(&file, &more);
    assert!(
        said.contains("grid-0.5") && said.contains("grid-0.25"),
        "{said}"
    );
    let text = std::fs::read_to_string(output.join("1-case/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rows = summary["estimate"]["answers"].as_array().unwrap();
    let exit = 0.1 * PI / (4.0 * 1.854_074_677_301_371_7 * (0.25 * PI).sin());
    for (name, exact) in [("outflow", 5e-6), ("downstream", exit)] {
        let of_name = |row: &&serde_json::Value| row["answer"].as_str().unwrap().contains(name);
        let row = rows.iter().find(of_name).unwrap();
        let (value, half) = (number(row, "/value"), number(row, "/uncertainty"));
        println!("{row}");
        assert!(
            (value - exact).abs() <= half && half < 0.05 * exact,
            "{row}"
        );
    }
}
