//! Runs of ground that drains: dams, rain, the same bits on any number of ranks and after a restart, and refusals.

use crate::ranks::{Study, beside_others, run};
use solver::case::{Document, examples};
use solver::plan::Plan;
use std::path::Path;

/// Returns the columns of a probe as rows of numbers, without the step.
fn rows(study: &Study, run: &str, probe: &str) -> Vec<Vec<f64>> {
    let path = study.path(&format!("{run}/probe_{probe}.csv"));
    let text = std::fs::read_to_string(path).unwrap();
    let numbers = |line: &str| -> Option<Vec<f64>> {
        let cells = line.split(',').map(|cell| cell.trim().parse::<f64>());
        cells.collect::<Result<Vec<_>, _>>().ok()
    };
    let rows: Vec<Vec<f64>> = text.lines().filter_map(numbers).collect();
    assert!(!rows.is_empty(), "{text}");
    rows
}

/// Checks a rectangular dam: discharge k (h1^2 - h2^2)/(2 L), exact after I. A. Charny, and the exit of the phreatic
/// surface after P. Ya. Polubarinova-Kochina, 3.93959 m. Both are of first order in the cells: two grids give their
/// limits.
#[test]
fn a_dam_has_the_exact_discharge_and_the_exit_of_its_phreatic_surface() {
    let _beside = beside_others();
    let study = Study::from_example("earth-dam", &[]);
    // The transition zone of a tenth of a cell adds its height times the drop of the phreatic line per length.
    let solved = |run: &str, spacing: f64| {
        let near = 1e-3 * spacing / 0.0625;
        study.run(run, 1, 1, &[&format!("domain.spacing={spacing}")]);
        let seepage = &study.summary(run)["seepage"];
        for name in ["inflow", "outflow"] {
            let discharge = seepage[name].as_f64().unwrap();
            assert!((discharge / 4.8e-5 - 1.0).abs() < near, "{seepage}");
        }
        let through = rows(&study, run, "middle")[0][2];
        assert!((through / 4.8e-5 - 1.0).abs() < near, "{through}");
        let exit = rows(&study, run, "water_table").last().unwrap()[3];
        (through, exit)
    };
    let (coarse, fine) = (solved("coarse", 0.25), solved("fine", 0.125));
    let limit = (2.0 * fine.0 - coarse.0) / 4.8e-5;
    assert!((limit - 1.0).abs() < 4e-4, "{coarse:?} {fine:?}");
    let (coarse, fine) = (coarse.1, fine.1);
    assert!(
        (2.0 * fine - coarse) / 3.93959 - 1.0 < 0.02,
        "{coarse} {fine}"
    );
    assert!(
        (2.0 * fine - coarse) / 3.93959 - 1.0 > -0.02,
        "{coarse} {fine}"
    );
    assert!(coarse > fine && fine > 3.93959, "{coarse} {fine}");
}

/// Checks a dam of sand far above its water table (R. F. Carsel and R. S. Parrish, Water Resour. Res. 24 (1988) 755),
/// on cells of two and four capillary lengths: the flow in the capillary zone adds less than a hundredth.
#[test]
fn a_dam_of_coarse_sand_has_its_discharge() {
    let _beside = beside_others();
    let sand = r#"{"van_genuchten": {"alpha": 14.5, "n": 2.68, "saturated_content": 0.43}}"#;
    let study = Study::from_example("earth-dam", &[("fluid.darcy.unsaturated.retention", sand)]);
    for (run, spacing) in [("coarse", 0.25), ("fine", 0.125)] {
        let set = format!("domain.spacing={spacing}");
        study.run(run, 1, 1, &[&set]).expect(0);
        let discharge = study.summary(run)["seepage"]["outflow"].as_f64().unwrap();
        let capillary = discharge / 4.8e-5 - 1.0;
        assert!((0.0..0.01).contains(&capillary), "{run}: {discharge}");
    }
    study.run("ranks", 2, 1, &["domain.spacing=0.25"]).expect(0);
    study.same("coarse", "ranks");
}

/// Checks the phreatic line of a dam between 10 m and 0 m over 10 m, from the integrals of P. Ya. Polubarinova-Kochina.
#[test]
fn the_phreatic_line_of_a_dam_is_the_exact_one() {
    let _beside = beside_others();
    let study = Study::from_example("earth-dam", &[]);
    let air = "fluid.darcy.boundaries[1].condition={\"seepage_face\": {}}";
    study.run("air", 1, 1, &[air, "domain.spacing=0.125"]);
    let table = rows(&study, "air", "water_table");
    for (x, exact) in [
        (1.0, 9.7348),
        (2.5, 9.1809),
        (5.0, 7.9679),
        (7.5, 6.3432),
        (9.0, 5.0266),
    ] {
        // Interpolation between the adjacent columns of cells.
        let after = table.iter().position(|row| row[2] > x).unwrap();
        let (a, b) = (&table[after - 1], &table[after]);
        let found = a[3] + (b[3] - a[3]) * (x - a[2]) / (b[2] - a[2]);
        assert!((found / exact - 1.0).abs() < 0.01, "{x}: {found} {exact}");
    }
}

/// Checks a column of exponential soil under rain R above a water table: e^(alpha psi) = R/K + (1 - R/K) e^(-alpha z).
#[test]
fn rain_on_an_exponential_soil_gives_the_exact_suction() {
    let _beside = beside_others();
    let study = Study::from_example(
        "earth-dam",
        &[
            ("domain.size", "[1, 2]"),
            ("domain.spacing", "0.2"),
            (
                "fluid.darcy.unsaturated.retention",
                r#"{"gardner": {"alpha": 5, "saturated_content": 0.4, "residual_content": 0.1}}"#,
            ),
            (
                "fluid.darcy.boundaries",
                r#"[{"name": "table", "face": "y_min", "condition": {"head": {"value": 0}}},
                    {"name": "rain", "face": "y_max", "condition": {"rain": {"rate": 1e-6}}}]"#,
            ),
            (
                "probes",
                r#"[{"name": "low", "every": 1, "at": {"point": {"position": [0.5, 0.5]}}},
                    {"name": "high", "every": 1, "at": {"point": {"position": [0.5, 1.5]}}}]"#,
            ),
        ],
    );
    study.run("rain", 1, 1, &[]);
    let seepage = &study.summary("rain")["seepage"];
    assert!(
        (seepage["outflow"].as_f64().unwrap() / 1e-6 - 1.0).abs() < 1e-7,
        "{seepage}"
    );
    for (probe, z) in [("low", 0.5), ("high", 1.5)] {
        let row = &rows(&study, "rain", probe)[0];
        let (flux, head) = (row[3], row[6]);
        let exact = (0.1 + 0.9 * (-5.0_f64 * z).exp()).ln() / 5.0;
        assert!((flux / -1e-6 - 1.0).abs() < 1e-7, "{row:?}");
        // The points are centres of cells.
        assert!((head - z - exact).abs() < 1e-6, "{row:?} {exact}");
    }
}

#[test]
fn the_same_bits_on_any_ranks_and_after_a_restart() {
    let _beside = beside_others();
    let study = Study::from_example(
        "earth-dam",
        &[
            ("domain.spacing", "0.5"),
            (
                "fluid.darcy.unsaturated.retention",
                r#"{"van_genuchten": {"alpha": 0.64, "n": 4.65, "saturated_content": 0.4}}"#,
            ),
            ("time.end", "3"),
            ("checkpoint", r#"{"every": 1}"#),
        ],
    );
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[]);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=1"]);
    study.restart("parts", 3, &["time.end=3"]).expect(0);
    study.same("straight", "parts");
    let table = rows(&study, "parts", "water_table");
    assert_eq!(table, rows(&study, "straight", "water_table"));
}

/// Returns the paths and reasons of the findings of the example `earth-dam` with a change.
fn findings(set: &str) -> Vec<(String, String)> {
    findings_of("earth-dam", &[set.to_owned()])
}

/// Returns the paths and reasons of the findings of an example with changes.
fn findings_of(example: &str, sets: &[String]) -> Vec<(String, String)> {
    let text = examples::find(example).unwrap().text;
    let found = Document::read(text, sets, Path::new(".")).and_then(Plan::prepare);
    let found = match found {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    };
    found.into_iter().map(|p| (p.path, p.reason)).collect()
}

#[test]
fn what_does_not_go_with_ground_that_drains_is_refused_by_name() {
    let own = "fluid.darcy.unsaturated";
    let retention = "fluid.darcy.unsaturated.retention";
    let condition = "fluid.darcy.boundaries[1].condition";
    let disc = r#"{"name": "disc", "shape": {"disc": {"radius": 1}}, "position": [5, 5],
        "motion": {"free": {}}, "material": "earth"}"#;
    for (set, path, reason) in [
        (
            format!("bodies=[{disc}]"),
            own,
            "supports spheres and discs as grains, but no bodies",
        ),
        ("gravity=[0, 0]".to_owned(), "gravity", "needs gravity"),
        (
            "fluid.darcy.equations=paper".to_owned(),
            "fluid.darcy.equations",
            "needs the corrected equations",
        ),
        (
            "fluid.darcy.unsaturated=null".to_owned(),
            condition,
            "a seepage face needs unsaturated ground",
        ),
        (
            format!(
                r#"{retention}={{"van_genuchten": {{"alpha": 1, "n": 0.9, "saturated_content": 0.4}}}}"#
            ),
            "fluid.darcy.unsaturated.retention.van_genuchten.n",
            "the value must be at least 1.05 and at most 20",
        ),
        (
            format!(
                r#"{retention}={{"gardner": {{"alpha": 1, "saturated_content": 0.3, "residual_content": 0.4}}}}"#
            ),
            "fluid.darcy.unsaturated.retention.gardner.residual_content",
            "it must lie between 0 and the saturated content",
        ),
        (
            format!(r#"{condition}={{"head": {{"value": 2}}}}"#),
            condition,
            "water would pass there under suction",
        ),
        (
            format!(
                r#"{retention}={{"van_genuchten": {{"alpha": 900, "n": 3, "saturated_content": 0.4}}}}"#
            ),
            own,
            "the solution may not converge",
        ),
        (
            format!(r#"{condition}={{"rain": {{"rate": 1e-7}}}}"#),
            condition,
            "the face does not face upwards",
        ),
        (
            r#"fluid.darcy.zones[0].permeability={"factor": 0.5}"#.to_owned(),
            "fluid.darcy.zones[0].permeability.factor",
            "a factor multiplies a permeability that follows from grains",
        ),
        (
            r#"fluid.darcy.zones[0].permeability={"resistance": "gidaspow"}"#.to_owned(),
            "fluid.darcy.zones[0].permeability.resistance",
            "unsaturated ground has the permeability that its zones state",
        ),
        (
            "gravity=[0.1, -9.81]".to_owned(),
            "probes[0].at.water_table",
            "gravity does not point along an axis",
        ),
    ] {
        let found = findings(&set);
        let said = |(p, r): &(String, String)| p == path && r.contains(reason);
        assert!(found.iter().any(said), "{set}: {found:#?}");
    }
}

/// Checks the column of Celia, Bouloutas and Zarba (1990): water that entered in 6 h, 17.40 mm in a converged solution.
/// The mass closes, the bits do not depend on ranks, threads and restarts, and the results are those of the balance.
#[test]
fn infiltration_closes_its_mass_with_the_same_bits_after_a_restart() {
    let _beside = beside_others();
    let study = Study::from_example(
        "infiltration",
        &[("time.end", "21600"), ("checkpoint", r#"{"every": 3600}"#)],
    );
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    let seepage = &one["seepage"];
    let number = |name: &str| seepage[name].as_f64().unwrap();
    assert!(number("mass_error").abs() < 1e-10, "{seepage}");
    let entered = (number("water_in") - number("water_out")) / 0.05;
    assert!((entered / 0.01740 - 1.0).abs() < 0.01, "{entered}");
    let last = rows(&study, "straight", "water").pop().unwrap();
    let bits = |numbers: [f64; 2]| numbers.map(f64::to_bits);
    let summary = [number("water_in"), number("water_out")];
    assert_eq!(bits([last[3], last[4]]), bits(summary));
    // The bits of the first two hours.
    let (end, fields) = ("time.end=7200", "output.fluid.every=7200");
    study.run("short", 1, 1, &[end, fields]);
    let one = study.summary("short");
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[end, fields]);
        study.same("short", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=3600", fields]);
    study.restart("parts", 3, &[end]).expect(0);
    study.same("short", "parts");
    let water = rows(&study, "parts", "water");
    assert_eq!(water, rows(&study, "short", "water"));
}

/// Checks the sudden drawdown of saturated ground under oblique gravity on a clock far finer than its drainage: the
/// plan finds the case valid, and it runs. As long as the suction of the cells that drain is small against the fall of
/// the head, the water follows the saturated flow to the face in air, which does not depend on the soil: soils with
/// other exponents n give the same discharge. The mass closes, and the bits do not depend on ranks, threads and
/// restarts.
#[test]
fn a_sudden_drawdown_on_a_fine_clock_converges_under_oblique_gravity() {
    let _beside = beside_others();
    let retention = |n: f64| {
        format!(r#"{{"van_genuchten": {{"alpha": 14.5, "n": {n}, "saturated_content": 0.43}}}}"#)
    };
    let study = Study::from_example(
        "drawdown",
        &[
            ("domain", r#"{"size": [1, 1], "spacing": 0.1}"#),
            ("gravity", "[4.905, -8.4957]"),
            ("fluid.darcy.grid", "null"),
            ("fluid.darcy.unsaturated.retention", &retention(2.0)),
            (
                "fluid.darcy.boundaries",
                r#"[{"name": "river", "face": "x_max", "condition": {"seepage_face": {"level": 1}},
                     "history": [[0, 1], [0, 0]]}]"#,
            ),
            ("time", r#"{"end": 0.004, "solid_time_step": 0.001}"#),
            (
                "probes",
                r#"[{"name": "water", "every": 0.001, "at": {"water_balance": {}}}]"#,
            ),
            ("output.fluid.every", "0.004"),
            ("checkpoint", r#"{"every": 0.002}"#),
        ],
    );
    study.run("straight", 1, 1, &[]).expect(0);
    let one = study.summary("straight");
    let water = rows(&study, "straight", "water");
    let last = water.last().unwrap();
    let (stored, left) = (water[0][2] - last[2], last[4] - water[0][4]);
    assert!((stored - left).abs() < 1e-15, "{water:?}");
    study.run("two", 2, 2, &[]).expect(0);
    study.same("straight", "two");
    assert_eq!(study.summary("two")["seepage"], one["seepage"]);
    study.run(
        "parts",
        2,
        1,
        &["time.end=0.002", "output.fluid.every=0.002"],
    );
    study.restart("parts", 1, &["time.end=0.004"]).expect(0);
    assert_eq!(rows(&study, "parts", "water"), water);
    for n in [2.68, 4.0] {
        let set = format!("fluid.darcy.unsaturated.retention={}", retention(n));
        let run = format!("n{n}");
        study.run(&run, 1, 1, &[&set]).expect(0);
        let other = rows(&study, &run, "water").last().unwrap()[4];
        println!("{n}: {other} {}", last[4]);
        assert!(
            (other / last[4] - 1.0).abs() < 0.02,
            "{n}: {other} {}",
            last[4]
        );
    }
}

#[test]
fn flow_in_time_needs_a_soil_that_stores_water() {
    for (set, path) in [
        (
            "fluid.darcy.unsaturated.transient={}",
            "fluid.darcy.unsaturated.retention.saturated_only",
        ),
        (
            r#"probes[0].at={"water_balance": {}}"#,
            "probes[0].at.water_balance",
        ),
    ] {
        let found = findings(set);
        assert!(found.iter().any(|(p, _)| p == path), "{set}: {found:#?}");
    }
}

/// Checks a start so dry that the content of Gardner's law is lost to rounding: runs of -7 m and less suction converged
/// with alpha = 5 1/m, those of -8 m and more did not.
#[test]
fn ground_drier_than_its_law_can_state_is_named() {
    let retention = "fluid.darcy.unsaturated.retention";
    let initial = "fluid.darcy.unsaturated.transient.initial";
    let dry = |law: &str, head: f64| {
        let sets = [
            format!("{retention}={law}"),
            format!(r#"{initial}={{"pressure_head": {head}}}"#),
        ];
        let found = findings_of("infiltration", &sets);
        let path = format!("{initial}.pressure_head");
        found.iter().any(|(at, _)| *at == path)
    };
    let gardner = r#"{"gardner": {"alpha": 5, "saturated_content": 0.4}}"#;
    assert!(!dry(gardner, -6.0));
    assert!(dry(gardner, -8.0));
    let van_genuchten = r#"{"van_genuchten": {"alpha": 5, "n": 2, "saturated_content": 0.4, "residual_content": 0.1}}"#;
    assert!(!dry(van_genuchten, -1000.0));
    let narrow = r#"{"van_genuchten": {"alpha": 14.5, "n": 16, "saturated_content": 0.4}}"#;
    assert!(!dry(narrow, -0.6));
    assert!(dry(narrow, -2.0));
    let high = |alpha: f64| {
        let law = format!(r#"{{"gardner": {{"alpha": {alpha}, "saturated_content": 0.4}}}}"#);
        let sets = [
            format!("{retention}={law}"),
            format!(r#"{initial}={{"head": 1}}"#),
        ];
        let found = findings_of("infiltration", &sets);
        let path = format!("{retention}.gardner.alpha");
        found.iter().any(|(at, _)| *at == path)
    };
    // Ground of 1 m.
    assert!(!high(35.0));
    assert!(high(60.0));
}

/// Compares a dam with k_h = 9 k_v with its isotropic equivalent: lengths along x divided by 3, and the geometric mean
/// of the conductivities.
#[test]
fn a_layered_dam_is_its_stretched_twin() {
    let _beside = beside_others();
    let discharge = |name: &str, set: &[(&str, &str)]| {
        let study = Study::from_example("earth-dam", set);
        study.run(name, 1, 1, &["probes=[]"]);
        study.summary(name)["seepage"]["outflow"].as_f64().unwrap()
    };
    let grid =
        |length: f64| format!(r#"{{"from": [0, 0], "to": [{length}, 10], "cells": [40, 40]}}"#);
    let zone = |more: &str| {
        format!(r#"[{{"name": "earth", "permeability": {{"hydraulic_conductivity": {more}}}]"#)
    };
    let layered = discharge(
        "layered",
        &[
            ("domain.size", "[15, 10]"),
            ("domain.spacing", "0.25"),
            ("fluid.darcy.grid", &grid(15.0)),
            ("fluid.darcy.zones", &zone(r#"9e-5}, "anisotropy": 9"#)),
        ],
    );
    let twin = discharge(
        "twin",
        &[
            ("domain.size", "[5, 10]"),
            ("domain.spacing", "0.25"),
            ("fluid.darcy.grid", &grid(5.0)),
            ("fluid.darcy.zones", &zone("3e-5}")),
        ],
    );
    assert!((layered / twin - 1.0).abs() < 1e-6, "{layered} {twin}");
    // Exact solution: k_h (h1^2 - h2^2)/(2 L).
    assert!((layered / 2.88e-4 - 1.0).abs() < 6e-3, "{layered}");
}

/// Checks the uplift of a flat base of length B on deep ground under a head H: force gamma H B/2 and moment 3 gamma H
/// B^2/16 about the heel, from phi/H = arccos(2 x/B - 1)/pi.
#[test]
fn uplift_of_a_flat_base_on_deep_ground() {
    let _beside = beside_others();
    let study = Study::from_example(
        "sheet-pile",
        &[
            ("domain.size", "[32, 16]"),
            ("domain.spacing", "0.125"),
            ("structures", "[]"),
            (
                "fluid.darcy.boundaries",
                r#"[{"name": "upstream", "face": "y_max", "patch": {"from": [0, 0], "to": [15, 16]},
                     "condition": {"head": {"value": 17}}},
                    {"name": "downstream", "face": "y_max", "patch": {"from": [17, 0], "to": [32, 16]},
                     "condition": {"head": {"value": 16}}}]"#,
            ),
            (
                "probes",
                r#"[{"name": "base", "every": 1, "at": {"uplift": {"axis": "y", "position": 16,
                     "part": {"from": [15, 0], "to": [17, 16]}, "about": [15, 16]}}}]"#,
            ),
        ],
    );
    let weight = 9810.0;
    let moment = |run: &str, spacing: f64| {
        study.run(run, 1, 1, &[&format!("domain.spacing={spacing}")]);
        let base = &rows(&study, run, "base")[0];
        assert!((base[7] / 2.0 - 1.0).abs() < 1e-9, "{base:?}");
        assert!((base[2] / weight - 1.0).abs() < 1e-4, "{base:?}");
        base[5] / weight
    };
    // The edges of the base are singular: the error is of first order.
    let (coarse, fine) = (moment("coarse", 0.25), moment("fine", 0.125));
    assert!(
        ((2.0 * fine - coarse) / 0.75 - 1.0).abs() < 5e-3,
        "{coarse} {fine}"
    );
}

/// Checks the exit gradient at a sheet pile to half the depth of a stratum: 0.0599 (M. E. Harr, Groundwater and
/// Seepage, 1962).
#[test]
fn the_exit_gradient_of_a_sheet_pile_is_in_the_summary() {
    let _beside = beside_others();
    let study = Study::from_example("sheet-pile", &[]);
    study.run("pile", 1, 1, &[]);
    let exits = &study.summary("pile")["seepage"]["exit_gradients"];
    let exit = &exits["downstream"];
    assert!(
        (exit["gradient"].as_f64().unwrap() / 0.0599 - 1.0).abs() < 0.02,
        "{exits}"
    );
    assert!(
        (exit["position"][0].as_f64().unwrap() - 3.00625).abs() < 1e-9,
        "{exits}"
    );
    assert!(exits["upstream"].is_null(), "{exits}");
}

/// Checks conditions from tables, and layered soils: the same bits on any ranks and after a restart.
#[test]
fn a_falling_level_gives_the_same_bits_after_a_restart() {
    let _beside = beside_others();
    let soil = r#"{"van_genuchten": {"alpha": 0.64, "n": 2.5, "saturated_content": 0.4}}"#;
    let study = Study::from_example(
        "earth-dam",
        &[
            ("domain.spacing", "0.5"),
            (
                "fluid.darcy.unsaturated",
                &format!(r#"{{"retention": {soil}, "transient": {{"specific_storage": 1e-5}}}}"#),
            ),
            (
                "fluid.darcy.zones",
                r#"[{"name": "earth", "permeability": {"hydraulic_conductivity": 1e-5}},
                    {"name": "core", "region": {"box": {"from": [4, 0], "to": [6, 10]}}, "anisotropy": 4,
                     "permeability": {"hydraulic_conductivity": 1e-6},
                     "retention": {"van_genuchten": {"alpha": 0.3, "n": 1.8, "saturated_content": 0.45}}}]"#,
            ),
            (
                "fluid.darcy.boundaries[0]",
                r#"{"name": "upstream", "face": "x_min", "condition": {"seepage_face": {"level": 10}},
                    "history": [[0, 10], [43200, 10], [129600, 4]]}"#,
            ),
            ("time", r#"{"end": 172800, "solid_time_step": 4320}"#),
            ("probes[0].every", "43200"),
            ("probes[1].every", "43200"),
            ("output.fluid.every", "86400"),
            ("checkpoint", r#"{"every": 43200}"#),
        ],
    );
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    assert!(
        one["seepage"]["mass_error"].as_f64().unwrap().abs() < 1e-10,
        "{one:#}"
    );
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[]);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=86400"]);
    study.restart("parts", 3, &["time.end=172800"]).expect(0);
    study.same("straight", "parts");
    let tables = |run: &str| rows(&study, run, "water_table");
    assert_eq!(tables("parts"), tables("straight"));
    // The water table follows the level down.
    let first = |row: &&Vec<f64>| row[2] < 0.5;
    let upstream: Vec<f64> = tables("straight")
        .iter()
        .filter(first)
        .map(|row| row[3])
        .collect();
    assert!(
        upstream.windows(2).all(|pair| pair[1] <= pair[0] + 1e-9),
        "{upstream:?}"
    );
    assert!(upstream[0] > 9.0 && upstream[3] < 6.0, "{upstream:?}");
}

/// Checks evaporation with a limiting suction, a drain in contact with air and a well, under zones that polygons bound:
/// equal bits on any ranks and threads and after a restart.
#[test]
fn evaporation_drains_and_wells_give_the_same_bits_after_a_restart() {
    let _beside = beside_others();
    let soil = r#"{"van_genuchten": {"alpha": 2, "n": 2.5, "saturated_content": 0.4, "residual_content": 0.05}}"#;
    let study = Study::from_example(
        "earth-dam",
        &[
            ("domain.size", "[4, 3]"),
            ("domain.spacing", "0.25"),
            (
                "fluid.darcy.unsaturated",
                &format!(
                    r#"{{"retention": {soil}, "transient": {{"initial": {{"head": 2}}, "specific_storage": 1e-5}}}}"#
                ),
            ),
            (
                "fluid.darcy.zones",
                r#"[{"name": "earth", "permeability": {"hydraulic_conductivity": 1e-5}},
                    {"name": "lens", "polygon": {"points": [[0.6, 1.1], [3.1, 1.4], [2.7, 1.9], [1.2, 1.8]]},
                     "permeability": {"hydraulic_conductivity": 1e-6}}]"#,
            ),
            (
                "fluid.darcy.boundaries",
                r#"[{"name": "river", "face": "x_min", "condition": {"seepage_face": {"level": 2}}},
                    {"name": "sun", "face": "y_max", "condition": {"evaporation": {"rate": 1e-7, "suction": 50}}}]"#,
            ),
            (
                "fluid.darcy.drains",
                r#"[{"name": "well", "box": {"from": [3, 0.25], "to": [3.25, 0.5]},
                     "condition": {"discharge": {"value": -1e-6}}},
                    {"name": "drain", "box": {"from": [2, 0.5], "to": [2.25, 0.75]},
                     "condition": {"seepage_face": {}}}]"#,
            ),
            ("time", r#"{"end": 172800, "solid_time_step": 4320}"#),
            (
                "probes",
                r#"[{"name": "table", "every": 43200, "at": {"water_table": {}}}]"#,
            ),
            ("output.fluid.every", "86400"),
            ("checkpoint", r#"{"every": 43200}"#),
        ],
    );
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    let seepage = &one["seepage"];
    assert!(
        seepage["mass_error"].as_f64().unwrap().abs() < 1e-10,
        "{seepage}"
    );
    let inflows = &seepage["patch_inflows"];
    // The sun takes its rate from 4 m of ground, the well its discharge, and the drain what flows to it.
    assert!(
        (inflows[1].as_f64().unwrap() / -4e-7 - 1.0).abs() < 1e-6,
        "{inflows}"
    );
    assert!(
        (inflows[2].as_f64().unwrap() / -1e-6 - 1.0).abs() < 1e-6,
        "{inflows}"
    );
    assert!(inflows[3].as_f64().unwrap() < -1e-6, "{inflows}");
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[]);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=86400"]);
    study.restart("parts", 3, &["time.end=172800"]).expect(0);
    study.same("straight", "parts");
    let tables = |run: &str| rows(&study, run, "table");
    assert_eq!(tables("parts"), tables("straight"));
}

/// Returns a rectangular aquifer of 10 m by 5 m between levels of 4 m with a well of this discharge \[m2/s\].
fn aquifer(discharge: f64) -> serde_json::Value {
    serde_json::json!({
        "domain": {"size": [10, 5], "spacing": 0.25},
        "gravity": [0, -9.81],
        "materials": {"sand": {"density": 2650}},
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 1e-3,
            "zones": [{"name": "sand", "permeability": {"hydraulic_conductivity": 1e-5}}],
            "unsaturated": {"retention": {"saturated_only": {}}},
            "boundaries": [
                {"name": "a", "face": "x_min", "condition": {"seepage_face": {"level": 4}}},
                {"name": "b", "face": "x_max", "condition": {"seepage_face": {"level": 4}}}
            ],
            "drains": [{"name": "well", "box": {"from": [4.9, 1], "to": [5.1, 1.5]},
                "condition": {"discharge": {"value": discharge}}}]
        }},
        "time": {"end": 1, "solid_time_step": 1},
        "output": {"fluid": {"every": 1, "fields": ["pressure", "head"]}}
    })
}

/// Checks that a well beyond the yield of the aquifer, 2 k h^2/L by Dupuit, is a failure with its name.
#[test]
fn a_well_beyond_the_yield_of_the_ground_is_a_failure() {
    let _beside = beside_others();
    let study = Study::new(&aquifer(-5e-5).to_string());
    let arguments = study.arguments("dry", 1, &[]);
    let message = run(1, &arguments).expect(4).stderr;
    assert!(
        message.contains("takes more water than the ground can yield"),
        "{message}"
    );
    let study = Study::new(&aquifer(-1e-5).to_string());
    study.run("wet", 1, 1, &[]).expect(0);
    // The fields begin with the first solution.
    assert!(!study.path("wet/fluid_000000000.vtkhdf").exists());
    assert!(study.path("wet/fluid_000000001.vtkhdf").exists());
}

/// Checks rain into a closed column, whose pressure follows from the water that is stored at the start, and that the
/// run ends at the stated time.
#[test]
fn a_closed_column_stores_its_rain_until_the_stated_end() {
    let _beside = beside_others();
    let study = Study::from_example(
        "earth-dam",
        &[
            ("domain.size", "[0.5, 2]"),
            ("domain.spacing", "0.1"),
            (
                "fluid.darcy.unsaturated",
                r#"{"retention": {"van_genuchten": {"alpha": 2, "n": 1.8, "saturated_content": 0.4}},
                    "transient": {"initial": {"pressure_head": -1}}}"#,
            ),
            (
                "fluid.darcy.boundaries",
                r#"[{"name": "rain", "face": "y_max", "condition": {"rain": {"rate": 1e-7}}}]"#,
            ),
            ("time", r#"{"end": 93600, "solid_time_step": 3600}"#),
            (
                "probes",
                r#"[{"name": "water", "every": 7200, "at": {"water_balance": {}}}]"#,
            ),
            ("output", "{}"),
        ],
    );
    study.run("rain", 1, 1, &[]).expect(0);
    let table = rows(&study, "rain", "water");
    let last = table.last().unwrap();
    assert!((last[1] - 93_600.0).abs() < 1e-6, "{last:?}");
    assert!((table[0][1] - 7200.0).abs() < 1e-6, "{:?}", table[0]);
    let rain = 1e-7 * 0.5 * 93_600.0;
    assert!((last[3] / rain - 1.0).abs() < 1e-9, "{last:?}");
}

/// Checks that a table of rain cannot fall below 0, as the rate of a condition cannot.
#[test]
fn a_table_of_rain_has_no_negative_rate() {
    let text = examples::find("infiltration").unwrap().text;
    let boundary = r#"fluid.darcy.boundaries[0]={"name": "top", "face": "y_max", "condition": {"rain": {"rate": 1e-6}},
        "history": [[0, 1e-6], [3600, RATE]]}"#;
    for (rate, refused) in [("0", false), ("-1e-6", true)] {
        let set = [boundary.replace("RATE", rate)];
        let found = Document::read(text, &set, Path::new(".")).and_then(Plan::prepare);
        let problems = found.err().unwrap_or_default();
        let path = "fluid.darcy.boundaries[0].history";
        let named = problems
            .iter()
            .any(|p| p.path == path && p.reason.contains("-1"));
        assert!(
            named == refused && problems.len() == usize::from(refused),
            "{problems:#?}"
        );
    }
}
