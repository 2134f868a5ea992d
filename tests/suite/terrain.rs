//! Surface of the ground: dams with sloping faces, rain on a slope, drawdown, and surfaces that are none.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::Document;
use solver::plan::Plan;
use std::path::Path;

/// Returns the dam of J. E. Bowles (Physical and Geotechnical Properties of Soils, 1984): 20 m high on an impervious
/// base of 100 m, its crest 10 m wide, faces of 1:2.5 and 1:2, k = 6.67e-6 m/s.
fn dam() -> Value {
    let part = |name: &str, ends: Value, condition: Value| {
        let mut layer = ends;
        layer["axis"] = json!("x");
        json!({"name": name, "region": {"layer": layer}, "condition": condition})
    };
    json!({
        "domain": {"size": [100, 20], "spacing": 0.5},
        "gravity": [0, -9.81],
        "materials": {"earth": {"density": 2650}},
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 1e-3,
            "zones": [{"name": "earth", "permeability": {"hydraulic_conductivity": 6.67e-6}}],
            "unsaturated": {"retention": {"saturated_only": {}}},
            "terrain": {
                "surface": {"points": [[0, 0], [50, 20], [60, 20], [100, 0]]},
                "conditions": [
                    part("reservoir", json!({"to": 55}), json!({"seepage_face": {"level": 18.5}})),
                    part("downstream", json!({"from": 55}), json!({"seepage_face": {}}))
                ]
            }
        }},
        "time": {"end": 1, "solid_time_step": 0.01},
        "probes": [
            {"name": "water_table", "every": 1, "at": {"water_table": {}}},
            {"name": "middle", "every": 1, "at": {"section": {"axis": "x", "position": 55}}}
        ]
    })
}

/// Returns the rows of a probe as numbers.
fn rows(study: &Study, run: &str, probe: &str) -> Vec<Vec<f64>> {
    let path = study.path(&format!("{run}/probe_{probe}.csv"));
    let text = std::fs::read_to_string(path).unwrap();
    let numbers = |line: &str| -> Option<Vec<f64>> {
        line.split(',').map(|cell| cell.parse().ok()).collect()
    };
    text.lines().filter_map(numbers).collect()
}

fn outflow(study: &Study, run: &str) -> f64 {
    study.summary(run)["seepage"]["outflow"].as_f64().unwrap()
}

/// Checks the discharge of a dam with sloping faces: between those of flow nets, 1.10e-3 and 1.28e-3 m3/min, without a
/// capillary zone, and up to the 1.378e-3 of finite-element programs with one.
#[test]
fn a_dam_with_sloping_faces_has_the_discharge_of_other_methods() {
    let _beside = beside_others();
    let study = Study::new(&dam().to_string());
    let discharge = |run: &str, set: &[&str]| {
        study.run(run, 1, 1, set).expect(0);
        60.0 * outflow(&study, run)
    };
    let coarse = discharge("coarse", &["domain.spacing=1"]);
    let fine = discharge("fine", &[]);
    assert!((1.10e-3..1.28e-3).contains(&fine), "{fine}");
    assert!((coarse / fine - 1.0).abs() < 0.02, "{coarse} {fine}");
    let soil = |alpha: f64| {
        format!(
            "fluid.darcy.unsaturated.retention={{\"van_genuchten\": {{\"alpha\": {alpha}, \"n\": 4, \
             \"saturated_content\": 0.4}}}}"
        )
    };
    let thin = discharge("thin", &[&soil(3.0)]);
    let thick = discharge("thick", &[&soil(0.3)]);
    assert!(
        fine < thin && thin < thick && thick < 1.05 * 1.378e-3,
        "{fine} {thin} {thick}"
    );
}

/// Checks the flow between the faces of a trapezoid with an impermeable crest, all saturated, against its conformal
/// map: crest 1, base 3, height 1 and faces of 45 degrees have q = 0.643548 k h.
#[test]
fn a_trapezoid_conducts_as_its_conformal_map() {
    let _beside = beside_others();
    let mut case = dam();
    let face = |name: &str, ends: Value, head: f64| {
        let mut layer = ends;
        layer["axis"] = json!("x");
        json!({"name": name, "region": {"layer": layer}, "condition": {"head": {"value": head}}})
    };
    case["domain"] = json!({"size": [3, 1], "spacing": 0.0125});
    let darcy = case["fluid"]["darcy"].as_object_mut().unwrap();
    darcy.remove("unsaturated");
    darcy["zones"][0]["permeability"] = json!({"hydraulic_conductivity": 1e-5});
    darcy["terrain"] = json!({
        "surface": {"points": [[0, 0], [1, 1], [2, 1], [3, 0]]},
        "conditions": [face("left", json!({"to": 1}), 3.0), face("right", json!({"from": 2}), 2.0)]
    });
    case["probes"] = json!([]);
    let study = Study::new(&case.to_string());
    study.run("fine", 1, 1, &[]).expect(0);
    let found = outflow(&study, "fine") / 1e-5;
    assert!((found / 0.643_548 - 1.0).abs() < 0.003, "{found}");
}

/// Checks a level surface in the grid against a domain that ends there, and a raster in 3-D against the line in 2-D.
#[test]
fn a_surface_is_the_end_of_the_ground() {
    let _beside = beside_others();
    let heads = json!([
        {"name": "in", "face": "x_min", "condition": {"head": {"value": 8}}},
        {"name": "out", "face": "x_max", "condition": {"seepage_face": {"level": 3}}}
    ]);
    let mut whole = dam();
    whole["domain"] = json!({"size": [20, 8], "spacing": 1});
    whole["fluid"]["darcy"]
        .as_object_mut()
        .unwrap()
        .remove("terrain");
    whole["fluid"]["darcy"]["boundaries"] = heads.clone();
    whole["probes"] = json!([]);
    let mut cut = whole.clone();
    cut["domain"]["size"] = json!([20, 12]);
    cut["fluid"]["darcy"]["terrain"] = json!({"surface": {"points": [[0, 8], [20, 8]]}});
    let study = Study::new(&whole.to_string());
    study.run("whole", 1, 1, &[]).expect(0);
    let other = Study::new(&cut.to_string());
    other.run("cut", 1, 1, &[]).expect(0);
    let (a, b) = (outflow(&study, "whole"), outflow(&other, "cut"));
    assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");

    let mut flat = dam();
    flat["domain"]["spacing"] = json!(2);
    flat["probes"] = json!([]);
    let mut deep = flat.clone();
    deep["domain"]["size"] = json!([100, 10, 20]);
    deep["gravity"] = json!([0, 0, -9.81]);
    let mut points = Vec::new();
    for [x, z] in [[0, 0], [50, 20], [60, 20], [100, 0]] {
        points.extend([10, 0].map(|y| json!([x, y, z])));
    }
    deep["fluid"]["darcy"]["terrain"]["surface"]["points"] = points.into();
    let flat = Study::new(&flat.to_string());
    flat.run("flat", 1, 1, &[]).expect(0);
    let deep = Study::new(&deep.to_string());
    deep.run("deep", 2, 1, &[]).expect(0);
    let (a, b) = (outflow(&flat, "flat"), outflow(&deep, "deep"));
    assert!((10.0 * a / b - 1.0).abs() < 1e-6, "{a} {b}");
}

/// Checks rain on a slope that the ground takes up: it falls on the horizontal projection of the slope.
#[test]
fn rain_falls_on_the_plan_of_a_slope() {
    let _beside = beside_others();
    let mut case = dam();
    let darcy = &mut case["fluid"]["darcy"];
    darcy["unsaturated"]["retention"] =
        json!({"van_genuchten": {"alpha": 0.5, "n": 2, "saturated_content": 0.4}});
    darcy["terrain"] = json!({
        "surface": {"points": [[0, 15], [20, 15], [80, 5], [100, 5]]},
        "conditions": [{"name": "rain", "condition": {"rain": {"rate": 1e-8}}}]
    });
    darcy["boundaries"] =
        json!([{"name": "table", "face": "y_min", "condition": {"head": {"value": 1}}}]);
    case["domain"]["spacing"] = json!(1);
    let study = Study::new(&case.to_string());
    study.run("rain", 1, 1, &[]).expect(0);
    let found = outflow(&study, "rain");
    assert!((found / 1e-6 - 1.0).abs() < 1e-6, "{found}");
}

/// Checks a drawdown: the water balance closes, on any ranks and threads and after a restart with the same bits.
#[test]
fn a_drawdown_keeps_its_water_and_its_bits() {
    let _beside = beside_others();
    let mut case = dam();
    let darcy = &mut case["fluid"]["darcy"];
    darcy["unsaturated"] = json!({
        "retention": {"van_genuchten": {
            "alpha": 14.5, "n": 2.68, "saturated_content": 0.43, "residual_content": 0.045
        }},
        "transient": {"specific_storage": 1e-5}
    });
    darcy["terrain"]["conditions"][0]["history"] = json!([[0, 18.5], [86400, 6]]);
    case["domain"]["spacing"] = json!(2.5);
    case["time"] = json!({"end": 172_800, "solid_time_step": 3600});
    case["probes"] = json!([{"name": "balance", "every": 43200, "at": {"water_balance": {}}}]);
    case["checkpoint"] = json!({"every": 86400});
    let study = Study::new(&case.to_string());
    study.run("straight", 1, 1, &[]).expect(0);
    let rows = rows(&study, "straight", "balance");
    let (first, last) = (rows.first().unwrap(), rows.last().unwrap());
    // Water in the ground, and what entered and left since the start.
    let (stored, entered, left) = (last[2] - first[2], last[3] - first[3], last[4] - first[4]);
    assert!(left > 1.0, "{last:?}");
    assert!(
        (stored - (entered - left)).abs() < 1e-10 * left,
        "{first:?} {last:?}"
    );
    for (name, ranks, threads) in [("two", 2, 2), ("three", 3, 1)] {
        study.run(name, ranks, threads, &[]).expect(0);
        study.same("straight", name);
    }
    study.run("parts", 2, 1, &["time.end=86400"]).expect(0);
    study.restart("parts", 3, &["time.end=172800"]).expect(0);
    study.same("straight", "parts");
    let loam = json!({"van_genuchten": {"alpha": 3.6, "n": 1.56, "saturated_content": 0.43}});
    let loam = format!("fluid.darcy.unsaturated.retention={loam}");
    study.run("loam", 1, 1, &[&loam]).expect(0);
}

/// Returns the findings of the dam with a change of its terrain.
fn findings(change: impl Fn(&mut Value)) -> String {
    let mut case = dam();
    change(&mut case);
    let read = Document::read(&case.to_string(), &[], Path::new("."));
    let found = match read.and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(found) => found,
    };
    let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
    texts.join("\n")
}

#[test]
fn a_surface_that_is_none_is_refused_by_its_fault() {
    let points = |points: Value| {
        move |case: &mut Value| {
            case["fluid"]["darcy"]["terrain"]["surface"]["points"] = points.clone();
        }
    };
    for (found, expected) in [
        (
            findings(points(json!([[0, 0], [50, 20], [40, 20]]))),
            "point 2 of the surface, at x = 40 m, lies to the left of the one before it, at 50 m",
        ),
        (
            findings(points(json!([[0, 5]]))),
            "the surface has 1 points",
        ),
        (
            findings(points(json!([[0, -5], [100, -5]]))),
            "the surface lies below the grid everywhere",
        ),
        (
            findings(points(json!([[0, 50], [100, 50]]))),
            "the surface lies above the grid everywhere",
        ),
        (
            findings(points(json!([[0, 0, 1], [100, 0, 1]]))),
            "this has 3 components, but the problem is 2-D",
        ),
        (
            findings(|case| {
                case["fluid"]["darcy"]["terrain"]["surface"] = json!({"path": "nowhere.csv"});
            }),
            "nowhere.csv",
        ),
        (
            findings(|case| {
                case["fluid"]["darcy"]["terrain"]["conditions"][0]["region"] =
                    json!({"box": {"from": [40, 0], "to": [60, 10]}});
            }),
            "no part of the surface of the ground lies in the region",
        ),
        (
            findings(|case| {
                case["fluid"]["darcy"]["terrain"]["conditions"][0]["condition"] =
                    json!({"discharge": {"value": 1e-5}});
            }),
            "a discharge belongs to a well or to a face of the grid",
        ),
        (
            findings(|case| {
                case["fluid"]["darcy"]["terrain"]["conditions"][1]["name"] = json!("reservoir");
            }),
            "reservoir",
        ),
        (
            findings(|case| {
                case["fluid"]["darcy"]["unsaturated"]["transient"] =
                    json!({"initial": {"steady": {}}});
            }),
            "this choice is a word without parameters; write \"steady\"",
        ),
    ] {
        assert!(found.contains(expected), "{expected} in:\n{found}");
    }
    assert_eq!(findings(|_| {}), "");
}

/// Checks rain of four times the permeability on a slope of loam: it ponds and runs off, its mass closes, and its bits
/// depend neither on ranks and threads nor on a restart.
#[test]
fn rain_that_runs_off_a_slope_has_the_same_bits() {
    let _beside = beside_others();
    let case = json!({
        "domain": {"size": [4, 4], "spacing": 0.2},
        "gravity": [0, -9.81],
        "materials": {"soil": {"density": 2650}},
        "fluid": {"darcy": {
            "density": 1000,
            "viscosity": 1e-3,
            "terrain": {
                "surface": {"points": [[0, 3.9], [4, 1.9]]},
                "conditions": [{"name": "rain", "condition": {"rain": {"rate": 1.2e-5}}}]
            },
            "zones": [{"name": "loam", "permeability": {"hydraulic_conductivity": 3e-6}}],
            "unsaturated": {
                "retention": {"van_genuchten": {"alpha": 3.6, "n": 1.56, "saturated_content": 0.43}},
                "transient": {"initial": {"pressure_head": -2}}
            },
            "boundaries": [{"name": "base", "face": "y_min", "condition": {"seepage_face": {}}}]
        }},
        "time": {"end": 25000, "solid_time_step": 5000},
        "probes": [{"name": "water", "every": 5000, "at": {"water_balance": {}}}]
    });
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]).expect(0);
    study.run("ranks", 2, 1, &[]).expect(0);
    study.run("threads", 1, 2, &[]).expect(0);
    study.same("one", "ranks");
    study.same("one", "threads");
    study.run("part", 2, 1, &["time.end=15000"]).expect(0);
    study.restart("part", 1, &["time.end=25000"]).expect(0);
    study.same("one", "part");
    let water = rows(&study, "one", "water");
    let (first, last) = (water.first().unwrap(), water.last().unwrap());
    let (stored, entered, left) = (last[2] - first[2], last[3] - first[3], last[4] - first[4]);
    assert!(
        (stored - (entered - left)).abs() < 1e-10 * entered,
        "{first:?} {last:?}"
    );
    // Three quarters of the rain run off once the ground is wet; on these cells the suction of the front adds
    // little.
    let taken = last[5] / (4.0 * 3e-6);
    assert!((0.999..1.2).contains(&taken), "{taken}");
}
