//! Excavation next to a sheet pile as an engineer draws it: any cell size gives the discharge, and faults of the
//! drawing are reported.

use crate::ranks::{beside_others, run};
use serde_json::{Value, json};
use solver::case::Document;
use solver::plan::Plan;
use std::path::Path;

/// Returns sand 6 m deep and 30 m wide with a pile in the middle down to `y` = 3.5 m, water 3 m above the ground on
/// the left, and cells of this size.
fn excavation(spacing: f64) -> Value {
    let side = |name: &str, from: f64, to: f64, head: f64| {
        json!({"name": name, "face": "y_max",
        "patch": {"from": [from, 0], "to": [to, 6]}, "condition": {"head": {"value": head}}})
    };
    json!({
        "domain": {"size": [30, 6], "spacing": spacing},
        "gravity": [0, -9.81],
        "materials": {"sand": {"density": 2650}},
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 1e-3,
            "boundaries": [side("upstream", 0.0, 15.0, 9.0), side("downstream", 15.0, 30.0, 6.0)],
            "zones": [{"name": "sand", "permeability": {"hydraulic_conductivity": 1e-4}, "without_grains": true}]
        }},
        "structures": [{"name": "pile", "material": "sand", "shape": {"box": {"from": [14.9999, 3.5], "to": [15.0001,
            6]}}}],
        "probes": [
            {"name": "toe", "every": 1, "at": {"point": {"position": [15.001, 3.49]}}},
            {"name": "exit", "every": 1, "at": {"section": {"axis": "x", "position": 15, "part": {"from": [0, 0],
                "to": [30, 6]}}}}
        ],
        "time": {"end": 1, "solid_time_step": 1}
    })
}

fn warnings(case: &Value) -> Vec<String> {
    let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
    let plan = Plan::prepare(document).unwrap();
    plan.warnings.iter().map(ToString::to_string).collect()
}

/// Returns the discharge \[m2/s\], and head and pressure at the toe.
fn solved(case: &Value) -> [f64; 3] {
    let _beside = beside_others();
    let folder = tempfile::tempdir().unwrap();
    let (file, output) = (folder.path().join("case.json"), folder.path().join("run"));
    std::fs::write(&file, case.to_string()).unwrap();
    let arguments = [&file, &output].map(|path| path.to_str().unwrap().to_owned());
    let [file, output] = arguments;
    run(
        1,
        &[
            file,
            "--output".into(),
            output.clone(),
            "--threads".into(),
            "1".into(),
        ],
    )
    .expect(0);
    let output = Path::new(&output);
    let summary = std::fs::read_to_string(output.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let toe = std::fs::read_to_string(output.join("probe_toe.csv")).unwrap();
    let column = |name: &str| {
        let at = toe
            .lines()
            .next()
            .unwrap()
            .split(',')
            .position(|c| c.starts_with(name));
        let last = toe.lines().last().unwrap();
        last.split(',').nth(at.unwrap()).unwrap().parse().unwrap()
    };
    [
        summary["seepage"]["inflow"].as_f64().unwrap(),
        column("head"),
        column("pressure"),
    ]
}

/// Checks the discharge k h K'(m)/(2 K(m)) with m = sin(pi s/2T) for a pile down to s in a layer of depth T (M. E.
/// Harr, Groundwater and Seepage, 1962, section 5-5): 1.692e-4 m2/s, of which a ground 30 m wide conducts 0.07 % less.
/// At the toe the head is the mean of both sides, by symmetry.
#[test]
fn the_discharge_holds_wherever_the_pile_meets_the_cells() {
    // The pile is on the faces of cells, in the middle of cells, and close to the face of a cell.
    for (spacing, shift) in [
        (0.25, 0.0),
        (0.4, 0.0),
        (0.08, 0.0),
        (0.25, 0.1),
        (0.25, -0.12),
    ] {
        let mut case = excavation(spacing);
        let ends = [14.9999 + shift, 15.0001 + shift];
        case["structures"][0]["shape"]["box"] = json!({"from": [ends[0], 3.5], "to": [ends[1], 6]});
        case["fluid"]["darcy"]["boundaries"][0]["patch"]["to"][0] = json!(15.0 + shift);
        case["fluid"]["darcy"]["boundaries"][1]["patch"]["from"][0] = json!(15.0 + shift);
        assert_eq!(warnings(&case), Vec::<String>::new(), "{spacing} {shift}");
        let [discharge, ..] = solved(&case);
        // Of the order of the cells, as the tip is singular: 9 % a metre on the faces of cells, and 13 % for each metre
        // that a tip between faces is misplaced, half a cell at most.
        let error = discharge / 1.692e-4 - 1.0;
        assert!(error.abs() < 0.17 * spacing, "{spacing} {shift}: {error}");
    }
    let [_, head, pressure] = solved(&excavation(0.08));
    // The value is that on one side of the tip, at which the head varies with the root of the distance.
    assert!((head - 7.5).abs() < 0.12, "{head}");
    assert!(
        (pressure - 9810.0 * (head - 3.49)).abs() < 1.0,
        "{pressure}"
    );
}

#[test]
fn a_way_around_the_pile_is_named() {
    let named = |case: &Value, words: &str| {
        let all = warnings(case);
        assert!(all.iter().any(|w| w.contains(words)), "{words}: {all:?}");
    };
    let mut short = excavation(0.25);
    short["structures"][0]["shape"]["box"]["to"] = json!([15.0001, 5.7]);
    named(
        &short,
        "impose different heads on adjacent cells at (15, 6) m",
    );
    let mut depth_as_height = excavation(0.25);
    depth_as_height["structures"][0]["shape"]["box"] =
        json!({"from": [14.99, 0], "to": [15.01, 2.5]});
    named(&depth_as_height, "impose different heads on adjacent cells");
    let mut gap = excavation(0.25);
    let layer = |from: f64, to: f64| {
        json!({"name": format!("{from}"), "permeability": {"hydraulic_conductivity": 1e-4}, "without_grains": true,
            "region": {"box": {"from": [0, from], "to": [30, to]}}})
    };
    gap["fluid"]["darcy"]["zones"] = json!([layer(0.0, 2.9), layer(3.0, 6.0)]);
    named(&gap, "no zone fills 120 of 2880 cells");
    let mut as_value = excavation(0.25);
    as_value["fluid"]["darcy"]["zones"][0]["permeability"] = json!({"value": 1e-4});
    named(&as_value, "a hydraulic conductivity of 981");
    let mut grams = excavation(0.25);
    grams["fluid"]["darcy"]["density"] = json!(1);
    named(&grams, "no liquid has a density of 1 kg/m3");
    let mut down = excavation(0.25);
    down["gravity"] = json!([0, 9.81]);
    named(&down, "gravity points along +y");
    let mut above_ground = excavation(0.25);
    above_ground["fluid"]["darcy"]["boundaries"][0]["condition"]["head"]["value"] = json!(3);
    named(&above_ground, "under suction");
    let mut level = excavation(0.25);
    level["fluid"]["darcy"]["boundaries"][0]["condition"]["head"]["value"] = json!(6);
    named(&level, "nothing drives the water");
}

#[test]
fn a_field_of_heads_is_one_of_seepage_and_a_probe_in_a_pile_is_refused() {
    let problems = |case: &Value| {
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        format!("{:?}", Plan::prepare(document).err())
    };
    let mut case = excavation(0.25);
    case["output"] = json!({"fluid": {"every": 1, "fields": ["velocity", "head"]}});
    assert_eq!(warnings(&case), Vec::<String>::new());
    let mut eddies = case.clone();
    eddies["output"]["fluid"]["fields"] = json!(["vorticity"]);
    assert!(problems(&eddies).contains("seepage does not have this field"));
    let mut inside = case;
    inside["probes"][0]["at"]["point"]["position"] = json!([15.0, 5.0]);
    assert!(problems(&inside).contains("the point lies in the structure `pile`"));
}
