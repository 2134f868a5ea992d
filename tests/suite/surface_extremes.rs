//! Water with a free surface at its extremes: a right result or a named refusal, and no water lost without a word.

use super::ranks::{Study, beside_others, run};
use serde_json::Value;
use std::f64::consts::PI;

const WATER: &str = "fluid.lattice_boltzmann.surface.water";
const BOUNDARIES: &str = "fluid.lattice_boltzmann.boundaries";

/// Returns a small box with these changes, with stationary air.
fn tank(more: &[(&str, &str)]) -> Study {
    let mut set = vec![
        ("domain", r#"{"size": [0.12, 0.06], "spacing": 0.0025}"#),
        ("probes", "[]"),
        ("output", "{}"),
        ("time.end", "0.1"),
    ];
    set.extend(more);
    Study::from_example("dam-break", &set)
}

/// Runs a study, checks that the mass of the water is conserved, and returns the summary.
fn water(study: &Study) -> Value {
    let _beside = beside_others();
    study.run("run", 1, 1, &[]);
    let summary = study.summary("run");
    let error = summary["water"]["mass_error"].as_f64().unwrap();
    assert!(error.abs() < 1e-12, "{summary}");
    summary
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_full_box_stays_at_rest() {
    let summary = water(&tank(&[(WATER, r#"[{"level": 0.06}]"#)]));
    let exact = 1000.0 * 0.12 * 0.06;
    let mass = number(&summary["water"]["mass"]);
    // The density of the depth adds half of g H / c², 3.5e-4 of the mass.
    assert!((mass / exact - 1.0).abs() < 5e-4, "{mass} of {exact}");
    assert!(number(&summary["lattice_velocity"]) < 1e-12, "{summary}");
    assert_eq!(summary["water"]["lost"], 0.0);
}

#[test]
fn one_cell_of_water_lies_on_the_floor_and_is_lost_in_the_air_with_a_word() {
    let mass = 1000.0 * 0.0025 * 0.0025;
    let lies = water(&tank(&[(
        WATER,
        r#"[{"shape": {"box": {"from": [0.05, 0], "to": [0.0525, 0.0025]}}}]"#,
    )]));
    let kept = number(&lies["water"]["mass"]);
    assert!((kept / mass - 1.0).abs() < 1e-3, "{lies}");
    assert_eq!(lies["warnings"].as_array().unwrap().len(), 0, "{lies}");
    let flies = water(&tank(&[(
        WATER,
        r#"[{"shape": {"box": {"from": [0.05, 0.03], "to": [0.0525, 0.0325]}}}]"#,
    )]));
    assert!((number(&flies["water"]["lost"]) / mass - 1.0).abs() < 1e-3);
    let words = flies["warnings"].to_string();
    assert!(words.contains("100.0 % of the water is lost"), "{words}");
}

#[test]
fn a_drop_merges_with_the_water_below_it() {
    let summary = water(&tank(&[(
        WATER,
        r#"[{"level": 0.02}, {"shape": {"disc": {"centre": [0.06, 0.04], "radius": 0.008}}}]"#,
    )]));
    let exact = 1000.0 * (0.12 * 0.02 + PI * 0.008 * 0.008);
    let mass = number(&summary["water"]["mass"]);
    assert!((mass / exact - 1.0).abs() < 2e-3, "{mass} of {exact}");
    assert!(number(&summary["water"]["lost"]).abs() < 1e-3 * exact);
}

#[test]
fn a_dry_box_stays_dry_or_fills_by_its_discharge() {
    let dry = water(&tank(&[(WATER, "[]")]));
    assert_eq!(dry["water"]["mass"], 0.0);
    let inlet =
        r#"[{"name": "in", "face": "x_min", "condition": {"discharge": {"value": 0.006}}}]"#;
    let fills = water(&tank(&[(WATER, "[]"), (BOUNDARIES, inlet)]));
    let mass = number(&fills["water"]["mass"]);
    // The faces are dry in the first step.
    assert!((mass / 0.6 - 1.0).abs() < 2e-3, "{fills}");
}

#[test]
fn a_gate_that_closes_at_once_stops_the_discharge() {
    let boundaries = r#"[
        {"name": "in", "face": "x_min",
         "condition": {"discharge": {"value": 0.01, "history": [[0, 0.01], [0.05, 0.01], [0.05005, 0]]}}},
        {"name": "out", "face": "x_max", "condition": {"level": {"value": 0.03}}}]"#;
    let summary = water(&tank(&[
        (WATER, r#"[{"level": 0.03}]"#),
        (BOUNDARIES, boundaries),
    ]));
    let entered = number(&summary["water"]["openings"][0]["entered"]);
    assert!((entered / 0.5 - 1.0).abs() < 2e-3, "{summary}");
}

/// Checks a block that meets the water at 20 m/s, at a time step that resolves the impact.
#[test]
fn a_block_at_20_metres_a_second_keeps_the_water() {
    let more = [
        (WATER, r#"[{"level": 0.03}]"#),
        ("materials", r#"{"rock": {"density": 2600}, "wall": {}}"#),
        (
            "contact",
            r#"{"linear": {"friction_angle_degrees": 20, "normal_stiffness": {"absolute": 5e8},
                "normal_damping_ratio": 0.2}}"#,
        ),
        ("box_walls", r#"["y_min"]"#),
        ("box_wall_material", "wall"),
        (
            "bodies",
            r#"[{"name": "block", "shape": {"disc": {"radius": 0.008}}, "position": [0.06, 0.045],
                 "motion": {"free": {"velocity": [0, -20]}}, "material": "rock"}]"#,
        ),
        ("time.end", "0.004"),
    ];
    let mut thick = more.to_vec();
    thick.extend([
        ("fluid.lattice_boltzmann.time_step", "6e-6"),
        ("fluid.lattice_boltzmann.kinematic_viscosity", "2e-3"),
    ]);
    let summary = water(&tank(&thick));
    assert!(number(&summary["water"]["lost"]).abs() < 1e-3 * number(&summary["water"]["mass"]));
    // At the time step of the example it is refused by name.
    let study = tank(&more);
    let refused = run(1, &study.arguments("refused", 1, &[])).expect(3);
    assert!(
        refused.stderr.contains("bodies[0].motion"),
        "{}",
        refused.stderr
    );
    assert!(
        refused.stderr.contains("time step of at most"),
        "{}",
        refused.stderr
    );
}

#[test]
fn tables_with_no_number_and_water_above_the_lid_are_refused_by_name() {
    for (more, path) in [
        ((WATER, r#"[{"level": 0.07}]"#), "surface.water[0].level"),
        (
            (
                BOUNDARIES,
                r#"[{"name": "in", "face": "x_min",
                     "condition": {"level": {"value": 0.03, "history": [[0, 0.03], [0.05, null]]}}}]"#,
            ),
            "level.history[1][1]",
        ),
        (
            (
                BOUNDARIES,
                r#"[{"name": "in", "face": "x_min",
                     "condition": {"discharge": {"value": 0.01, "history": [[0, 0.01], [0.05, 1e999]]}}}]"#,
            ),
            "boundaries",
        ),
        (
            (
                WATER,
                r#"[{"solitary_wave": {"level": 0.03, "height": 0.025, "axis": "x", "crest": 0.05}}]"#,
            ),
            "surface.water[0].solitary_wave.height",
        ),
        (
            (
                WATER,
                r#"[{"solitary_wave": {"level": 0.05, "height": 0.015, "axis": "x", "crest": 0.05}}]"#,
            ),
            "surface.water[0].solitary_wave",
        ),
        (
            (
                WATER,
                r#"[{"solitary_wave": {"level": 0.03, "height": 0.01, "axis": "y", "crest": 0.05}}]"#,
            ),
            "surface.water[0].solitary_wave.axis",
        ),
    ] {
        let study = tank(&[more]);
        let done = run(1, &study.arguments("refused", 1, &[])).expect(3);
        assert!(done.stderr.contains(path), "{path}: {}", done.stderr);
    }
}

/// Checks that splashes of many steps conserve the mass; the long form is the case `splashes` of `jobs/verification`.
#[test]
fn splashes_keep_the_mass() {
    let summary = water(&tank(&[
        (
            WATER,
            r#"[{"shape": {"box": {"from": [0, 0], "to": [0.03, 0.055]}}}, {"level": 0.006}]"#,
        ),
        ("time.end", "0.5"),
    ]));
    let [lost, mass] = ["lost", "mass_at_start"].map(|key| number(&summary["water"][key]));
    assert!(lost.abs() < 0.01 * mass, "{summary}");
}
