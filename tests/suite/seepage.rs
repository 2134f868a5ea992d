//! Seepage runs of the program under a real `mpirun`: the same bits on any number of ranks, along any split, and after
//! a restart on another number; the same for clay that falls out of a fissure; a pocket without outlet ends the run
//! with its name.

use crate::ranks::{Study, beside_others, run};

#[test]
fn the_same_bits_on_any_ranks_and_splits() {
    let _beside = beside_others();
    let study = Study::from_example("seepage", &[("time.end", "0.002")]);
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    let seepage = &one["seepage"];
    let (inflow, outflow) = (&seepage["inflow"], &seepage["outflow"]);
    let ratio = inflow.as_f64().unwrap() / outflow.as_f64().unwrap();
    assert!((ratio - 1.0).abs() < 1e-6, "{seepage}");
    for (name, ranks, set) in [
        ("two along x", 2, &["domain.split=x"][..]),
        ("three along y", 3, &["domain.split=y"]),
        ("four along z", 4, &["domain.split=z"]),
    ] {
        study.run(name, ranks, 1, set);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
}

#[test]
fn a_restart_on_other_ranks_gives_the_same_bits() {
    let _beside = beside_others();
    let study = Study::from_example("seepage", &[]);
    study.run("straight", 1, 1, &[]);
    study.run("parts", 2, 1, &["time.end=0.004"]);
    study.restart("parts", 3, &["time.end=0.006"]).expect(0);
    study.same("straight", "parts");
}

/// Checks row 4 of the fissure study: bonds, polygons, a gate that opens, grains removed below, and water through the
/// whole domain.
#[test]
fn clay_falling_out_of_a_fissure_on_any_ranks_threads_and_splits() {
    let _beside = beside_others();
    let study = Study::from_example(
        "deposition",
        &[
            (
                "fluid",
                r#"{"darcy": {"density": 1000, "viscosity": 0.1,
                    "grid": {"from": [0, 0, 0.004], "to": [0.024, 0.02, 0.024], "cells": [6, 4, 4]},
                    "enclosure": {"planes": [{"point": [0.008, 0, 0.004], "normal": [0.056, 0, 0.0084]},
                        {"point": [0.016, 0, 0.004], "normal": [-0.056, 0, 0.0084]}]},
                    "boundaries": [{"name": "rain", "face": "z_max", "condition": {"pressure": {"value": 5000}}},
                        {"name": "point", "face": "z_min", "condition": {"pressure": {"value": 0}}}]}}"#,
            ),
            // Soft springs allow long time steps.
            ("contact.contact_bond.normal_stiffness.absolute", "1000"),
            ("grains.initial.deposition.falling_stiffness", "100"),
            (
                "regions",
                r#"[{"name": "below", "box": {"from": [0, 0, 0], "to": [0.024, 0.02, 0.003]},
                    "action": {"remove": {"when": "centre"}}}]"#,
            ),
            ("time.end", "0.012"),
            ("output.grains.every", "0.006"),
            ("checkpoint", r#"{"every": 0.004}"#),
        ],
    );
    study.run("straight", 1, 1, &[]);
    // All kinds of events occur in the run.
    assert!(study.rows("straight", "removed.csv") > 15);
    assert!(study.summary("straight")["grains"].as_u64() > Some(20));
    // No grain is faster than a pressure of 5 kPa and a fall through the domain can make it.
    let seepage = &study.summary("straight")["seepage"];
    let number = |name: &str| seepage[name].as_f64().unwrap();
    let bernoulli = (2.0_f64 * 5000.0 / 1000.0).sqrt();
    assert!(
        (1.0..1.2).contains(&(number("bernoulli_speed") / bernoulli)),
        "{seepage}"
    );
    assert!(
        number("fastest_grain") > 0.1 && number("fastest_grain") <= number("bernoulli_speed"),
        "{seepage}"
    );
    assert!(number("largest_closure") >= number("closure"), "{seepage}");
    study.same_on(&[
        ("two with threads", 2, 2, ""),
        ("three along x", 3, 1, "domain.split=x"),
        ("four along z", 4, 1, "domain.split=z"),
    ]);
    study.run("parts", 1, 1, &["time.end=0.005"]);
    study.restart("parts", 2, &["time.end=0.009"]).expect(0);
    study.restart("parts", 3, &["time.end=0.012"]).expect(0);
    study.same("straight", "parts");
}

#[test]
fn a_pocket_is_named() {
    let _beside = beside_others();
    // Two planes meet above the opening: the cell below their edge has water in front of each plane, but not of
    // both.
    let study = Study::from_example(
        "seepage",
        &[
            ("fluid.darcy.grid.cells", "[5, 5, 10]"),
            (
                "fluid.darcy.enclosure",
                r#"{"planes": [{"point": [0.01, 0, 0.01], "normal": [1, 0, 0.1]},
                    {"point": [0.01, 0, 0.01], "normal": [-1, 0, 0.1]}]}"#,
            ),
            (
                "fluid.darcy.boundaries[0].condition",
                r#"{"rain": {"rate": 1e-5}}"#,
            ),
        ],
    );
    let done = run(2, &study.arguments("cut", 1, &[])).expect(4);
    assert!(
        done.stderr.contains("a group of 70 cells"),
        "{}",
        done.stderr
    );
}

/// Checks that the search on a settled bed between smooth walls finds Terzaghi's gradient (G_s - 1)(1 - n) within 5 %.
#[test]
fn the_search_finds_the_gradient_that_lifts_a_bed() {
    let _beside = beside_others();
    let case = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("jobs/verification/critical-gradient/case.json");
    let folder = tempfile::tempdir().unwrap();
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let mut arguments =
        words("critical-gradient --json --allow-unstable --threads 1 --tolerance 0.02");
    // Heads at 0.9 and 1.1 times the critical gradient of a bed of porosity 0.4993 in 0.052 m.
    arguments.extend(words("--from 0.09066 --to 0.09926 --output"));
    arguments.push(folder.path().to_str().unwrap().to_owned());
    arguments.push(case.to_str().unwrap().to_owned());
    let done = run(0, &arguments).expect(0);
    let found: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    let terzaghi = found["terzaghi"].as_f64().unwrap();
    assert!((terzaghi / 0.826 - 1.0).abs() < 0.01, "{found:#}");
    for end in 0..2 {
        let gradient = found["gradient"][end].as_f64().unwrap();
        assert!((gradient / terzaghi - 1.0).abs() < 0.05, "{found:#}");
    }
    // A search that begins above the critical gradient reports it.
    let afloat = "critical-gradient --allow-unstable --threads 1 --from 0.11 --to 0.12 --output";
    let mut arguments = words(afloat);
    arguments.push(folder.path().join("afloat").to_str().unwrap().to_owned());
    arguments.push(case.to_str().unwrap().to_owned());
    let done = run(0, &arguments).expect(2);
    assert!(
        done.stderr.contains("inlet already erodes at 0.11 m"),
        "{}",
        done.stderr
    );
}

/// Checks a pile with less permeable layers: cells intersected by boundaries, a raster from a file, a law that depends
/// on the gradient.
#[test]
fn zones_give_the_same_bits_on_any_ranks_and_after_a_restart() {
    let _beside = beside_others();
    let study = Study::from_example(
        "seepage",
        &[
            (
                "fluid.darcy.zones",
                r#"[{"name": "fines", "region": {"layer": {"from": 0.004, "to": 0.009}},
                    "permeability": {"factor": 0.2}, "porosity": 0.35},
                    {"name": "lens", "region": {"box": {"from": [0.002, 0.003, 0.001], "to": [0.011, 0.012, 0.0113]}},
                     "permeability": {"resistance": "ergun"}},
                    {"name": "map", "raster": {"path": "map.csv"}, "region": {"layer": {"axis": "x", "from": 0.012}},
                    "without_grains": true}]"#,
            ),
            ("time.end", "0.003"),
            ("checkpoint.every", "0.001"),
        ],
    );
    let mut map = String::from("x,y,z,hydraulic_conductivity\n");
    for n in 0..12 {
        let [i, j, k] = [n % 2, n / 2 % 2, n / 4].map(f64::from);
        let value = 1e-4 * (1.0 + i + 2.0 * j + 5.0 * k);
        map += &format!("{},{},{},{value:e}\n", 0.01 * i, 0.013 * j, 0.01 * k);
    }
    std::fs::write(study.path("map.csv"), map).unwrap();
    study.run("straight", 1, 1, &[]);
    let one = study.summary("straight");
    // The zones reduce the flow.
    study.run("open", 1, 1, &["fluid.darcy.zones=[]"]);
    let flow = |name: &str| study.summary(name)["seepage"]["inflow"].as_f64().unwrap();
    assert!(flow("straight") < 0.9 * flow("open"));
    for (name, ranks, threads, set) in [
        ("two along x", 2, 2, &["domain.split=x"][..]),
        ("four along z", 4, 1, &["domain.split=z"]),
    ] {
        study.run(name, ranks, threads, set);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=0.001"]);
    study.restart("parts", 3, &["time.end=0.003"]).expect(0);
    study.same("straight", "parts");
}

/// Checks the rules of the paper for the grid of the seepage: at least five cells along an axis, an even number
/// across an opening, cells of at most four median diameters.
#[test]
fn a_coarse_or_uneven_grid_is_warned_of() {
    let warnings = |set: &[&str]| -> Vec<(String, String)> {
        let text = solver::case::examples::find("fissure-sand").unwrap().text;
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let document = solver::case::Document::read(text, &set, std::path::Path::new("")).unwrap();
        let plan = solver::plan::Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        (plan.warnings.into_iter())
            .map(|warning| (warning.path, warning.reason))
            .collect()
    };
    let has = |all: &[(String, String)], path: &str, words: &str| {
        assert!(
            all.iter()
                .any(|(p, r)| p.contains(path) && r.contains(words)),
            "{path}, {words}: {all:#?}"
        );
    };
    assert!(warnings(&[]).is_empty());
    let coarse = warnings(&["fluid.darcy.grid.cells=[3, 6, 3]"]);
    has(&coarse, "grid.cells", "fewer than 5 cells");
    has(&coarse, "grid.cells", "times the median diameter d50");
    let uneven = warnings(&[
        r#"fluid.darcy.boundaries[1].patch={"from": [0.016, 0.02, 0.01], "to": [0.024, 0.05, 0.01]}"#,
    ]);
    has(
        &uneven,
        "boundaries[1].patch",
        "an odd number of cells (3) wide along y",
    );
}

/// Checks that open water above the ground on both sides of a dam, with a resistance 10⁹ times smaller than that of the
/// sand, transmits the heads, and that the seepage is that of the mapping of Harr (1962). At the singular ends of dam
/// and wall the error is of first order: two grids give the limit.
#[test]
fn water_ponded_over_the_ground_passes_on_its_head() {
    let _beside = beside_others();
    let sand = r#"[{"name": "sand", "region": {"layer": {"from": 0, "to": 1}},
        "permeability": {"hydraulic_conductivity": 1e-4}, "without_grains": true}]"#;
    let solids = r#"[{"name": "wall", "shape": {"box": {"from": [2.9999, 0.5], "to": [3.0001, 1.3]}}},
        {"name": "dam", "shape": {"box": {"from": [2.5, 1.0], "to": [3.5, 1.3]}}}]"#;
    let study = Study::from_example(
        "cut-off",
        &[
            ("domain.size", "[6, 1.2]"),
            ("fluid.darcy.zones", sand),
            ("structures", solids),
        ],
    );
    let outflow = |run: &str, spacing: f64| {
        study.run(run, 1, 1, &[&format!("domain.spacing={spacing}")]);
        let summary = study.summary(run);
        let flow = |name: &str| summary["seepage"][name].as_f64().unwrap();
        assert!(
            (flow("inflow") / flow("outflow") - 1.0).abs() < 1e-4,
            "{summary:#}"
        );
        flow("outflow")
    };
    let (coarse, fine) = (outflow("coarse", 0.1), outflow("fine", 0.05));
    let error = |found: f64| (found / 4.064e-5 - 1.0).abs();
    // On these cells the error is 2.8 %, in the limit 0.1 %.
    assert!(error(fine) < 0.04, "{coarse} {fine}");
    assert!(error(2.0 * fine - coarse) < 5e-3, "{coarse} {fine}");
}

/// Checks a case in which zones form the ground under a dam, without grains.
#[test]
fn zones_alone_are_a_bed() {
    let _beside = beside_others();
    let study = Study::from_example(
        "cut-off",
        &[
            ("domain.spacing", "0.05"),
            ("output", r#"{"fluid": {"every": 5e-6}}"#),
            ("checkpoint", r#"{"every": 5e-6}"#),
        ],
    );
    let done = study.run("straight", 1, 1, &[]);
    assert!(!done.stderr.contains("NaN"), "{}", done.stderr);
    let one = study.summary("straight");
    // With k_v and k_h of the layers and K of the wall, the solution of Harr (1962) is 2.161e-5 m2/s. The tolerance is
    // that of coarse cells, as thick as a layer.
    let inflow = one["seepage"]["inflow"].as_f64().unwrap();
    assert!((inflow / 2.161e-5 - 1.0).abs() < 0.1, "{inflow}");
    for (name, ranks, set) in [("two", 2, &["domain.split=x"][..]), ("three", 3, &[])] {
        study.run(name, ranks, 1, set);
        study.same("straight", name);
        assert_eq!(study.summary(name)["seepage"], one["seepage"], "{name}");
    }
    study.run("parts", 2, 1, &["time.end=5e-6"]);
    study.restart("parts", 1, &["time.end=1e-5"]).expect(0);
    study.same("straight", "parts");
    assert_eq!(study.summary("parts")["seepage"], one["seepage"]);
}

#[test]
fn zones_that_need_grains_are_refused_without_them() {
    use solver::case::{Document, examples};
    use solver::plan::Plan;
    let text = examples::find("cut-off").unwrap().text;
    let problems = |set: &str| {
        let document = Document::read(text, &[set.to_owned()], std::path::Path::new("."));
        match document.and_then(Plan::prepare) {
            Ok(_) => Vec::new(),
            Err(problems) => problems,
        }
    };
    assert!(problems("domain.spacing=0.05").is_empty());
    // Open water above part of the ground.
    let part = r#"[{"name": "sand", "region": {"layer": {"to": 0.51}}, "permeability": {"value": 1e-11},
        "without_grains": true}]"#;
    let by_grains =
        r#"[{"name": "sand", "permeability": {"factor": 0.5}, "without_grains": true}]"#;
    let unsaid = r#"[{"name": "sand", "permeability": {"value": 1e-11}}]"#;
    for zones in [part, unsaid] {
        assert_eq!(problems(&format!("fluid.darcy.zones={zones}")), []);
    }
    let found = problems(&format!("fluid.darcy.zones={by_grains}"));
    // One finding, which names the zone.
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].path, "fluid.darcy.zones[0].permeability.factor");
    assert!(found[0].reason.contains("has no grains"), "{found:#?}");
    let found = problems("fluid.darcy.zones=[]");
    assert!(found.iter().any(|p| p.path == "grains"), "{found:#?}");
}

/// Checks closed ends near a dam on a leaky layer: the loss of discharge stated by the plan is that of runs with near
/// and far ends.
#[test]
fn the_loss_by_near_ends_is_the_one_that_the_plan_states() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("dam.json");
    let case = |beyond: f64| {
        let length = 20.0 + 2.0 * beyond;
        serde_json::json!({
            "domain": {"size": [length, 6], "spacing": 1},
            "gravity": [0, -9.81],
            "fluid": {"darcy": {
                "density": 1000, "viscosity": 1e-3,
                "zones": [
                    {"name": "gravel", "permeability": {"hydraulic_conductivity": 1e-3}},
                    {"name": "cover", "region": {"layer": {"from": 4}},
                        "permeability": {"hydraulic_conductivity": 4e-6}}
                ],
                "boundaries": [
                    {"name": "up", "face": "y_max", "patch": {"from": [0, 0], "to": [beyond, 0]},
                        "condition": {"head": {"value": 10}}},
                    {"name": "down", "face": "y_max", "patch": {"from": [beyond + 20.0, 0], "to": [length, 0]},
                        "condition": {"head": {"value": 6}}}
                ]
            }},
            "time": {"end": 1}
        })
    };
    let inflow = |beyond: f64| {
        std::fs::write(&file, case(beyond).to_string()).unwrap();
        let out = folder.path().join("run");
        let done = std::process::Command::new(crate::ranks::SOLVER)
            .args([
                "run",
                file.to_str().unwrap(),
                "--overwrite",
                "--output",
                out.to_str().unwrap(),
            ])
            .output()
            .unwrap();
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
        let text = std::fs::read_to_string(out.join("summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
        (
            summary["inflow"].as_f64().unwrap(),
            String::from_utf8_lossy(&done.stderr).into_owned(),
        )
    };
    let (far, quiet) = inflow(400.0);
    assert!(!quiet.contains("leakage length"), "{quiet}");
    for (beyond, stated) in [(20.0, "53 %"), (40.0, "25 %")] {
        let (near, told) = inflow(beyond);
        assert!(
            told.contains("leakage length of the ground is 44.72 m"),
            "{told}"
        );
        assert!(told.contains(&format!("about {stated}")), "{told}");
        let loss = 1.0 - near / far;
        let length = 2000_f64.sqrt();
        let formula =
            1.0 - (20.0 + 2.0 * length) / (20.0 + 2.0 * length / (beyond / length).tanh());
        assert!((loss / formula - 1.0).abs() < 0.03, "{loss} {formula}");
    }
}
