//! Bodies and grains that leave the water through an opening: they are removed when they are more than one length of
//! the domain outside, counted with their mass and momentum, and the run continues with the same bits on any number of
//! ranks and across restarts.

use crate::ranks::{Study, beside_others, run};
use serde_json::{Value, json};

/// Returns heavy discs that move through the open right side of a box of water, below the stationary `anchor`.
fn case() -> Value {
    json!({
        "domain": {"size": [0.02, 0.016], "spacing": 5e-4},
        "materials": {"lead": {"density": 11000}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.6,
            "boundaries": [{"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}}]
        }},
        "coupling": {"partially_saturated": {}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "friction_angle_degrees": 30}},
        "bodies": [
            {"name": "anchor", "material": "lead", "shape": {"disc": {"radius": 0.0015}},
             "position": [0.006, 0.013], "motion": {"fixed": {}}},
            {"name": "sinker", "material": "lead", "shape": {"disc": {"radius": 0.002}},
             "position": [0.0175, 0.004], "motion": {"free": {"velocity": [0.04, 0]}}}
        ],
        "grains": {"material": "lead", "initial": {"list": [
            {"position": [0.0182, 0.0102], "radius": 0.0012, "velocity": [0.04, 0]}
        ]}},
        "probes": [{"name": "sinker", "every": 0.05, "at": {"body": {"name": "sinker"}}}],
        "checkpoint": {"every": 0.2},
        "time": {"end": 1.0}
    })
}

/// Returns the summary of what left, after checks of its one body and its one grain.
fn left(study: &Study, name: &str) -> Value {
    let summary = study.summary(name);
    assert_eq!(summary["grains"], 1, "{name}: {summary:#}");
    let warnings = summary["warnings"].to_string();
    for part in [
        "`sinker` left through the opening of x_max",
        "1 grain left through",
    ] {
        assert!(warnings.contains(part), "{part}: {warnings}");
    }
    summary["left_through_openings"].clone()
}

#[test]
fn solids_that_left_are_counted_and_the_run_goes_on() {
    let _beside = beside_others();
    let study = Study::new(&case().to_string());
    study.run("straight", 1, 1, &[]);
    let found = left(&study, "straight");
    let (body, grains) = (&found["bodies"][0], &found["grains"][0]);
    assert_eq!(body["name"], "sinker", "{found:#}");
    assert_eq!([&body["face"], &grains["face"]], ["x_max", "x_max"]);
    assert_eq!(grains["grains"], 1);
    let number = |of: &Value, key: &str| of[key].as_f64().unwrap();
    let along = |of: &Value, key: &str| of[key][0].as_f64().unwrap();
    let mass = 11000.0 * std::f64::consts::PI * 0.002_f64.powi(2);
    assert!((number(body, "mass") / mass - 1.0).abs() < 1e-12, "{body}");
    // Nothing acts on a body outside: it keeps the velocity with which it left, and the path follows from the time.
    let speed = along(body, "velocity");
    assert!((0.03..0.05).contains(&speed), "{body}");
    assert!((along(body, "momentum") - mass * speed).abs() < 1e-12 * mass * speed);
    let beyond = along(body, "position") - 0.04;
    let step = 0.1 / 3.0 * 5e-4_f64.powi(2) / 1e-5;
    assert!(beyond > 0.0 && beyond <= 16.001 * step * speed, "{body}");
    let table = std::fs::read_to_string(study.path("straight").join("probe_sinker.csv")).unwrap();
    let mut outside = 0;
    let mut after = 0;
    for row in table.lines().skip(2) {
        let values: Vec<f64> = row
            .split(',')
            .map(|x| x.parse().unwrap_or(f64::NAN))
            .collect();
        let [time, x] = [values[1], values[2]];
        if x > 0.0225 {
            let expected = along(body, "position") - speed * (number(body, "time") - time);
            assert!((x - expected).abs() < 1e-9, "{row}");
            outside += 1;
        }
        after += usize::from(x.is_nan());
    }
    assert!(outside > 3 && after > 1, "{table}");
    let mass = 11000.0 * std::f64::consts::PI * 0.0012_f64.powi(2);
    let momentum = along(grains, "momentum");
    assert!((0.03..0.05).contains(&(momentum / mass)), "{grains}");
    // Ranks and restarts, before and after the removal.
    study.same_on(&[
        ("two with threads", 2, 2, ""),
        ("two along y", 2, 1, "domain.split=y"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.4"]);
    study.restart("parts", 1, &["time.end=0.9"]).expect(0);
    study.restart("parts", 2, &["time.end=1.0"]).expect(0);
    study.same("straight", "parts");
    for name in ["two with threads", "two along y", "parts"] {
        assert_eq!(left(&study, name), found, "{name}");
    }
    // The plan says so before.
    let case = study.path("case.json").to_str().unwrap().to_owned();
    let plan = run(0, &["plan".into(), case]).expect(0).stdout;
    assert!(plan.contains("removed beyond x_max"), "{plan}");
}

#[test]
fn a_wall_at_an_opening_keeps_solids() {
    let _beside = beside_others();
    let mut closed = case();
    closed["box_walls"] = json!(["x_max"]);
    let study = Study::new(&closed.to_string());
    study.run("closed", 1, 1, &[]);
    let summary = study.summary("closed");
    assert_eq!(summary["grains"], 3, "{summary:#}");
    assert_eq!(summary["left_through_openings"], Value::Null);
}
