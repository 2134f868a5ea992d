//! Walls and bodies whose velocity follows a table in time: paths, discharge of a piston, the same bits on any ranks
//! and across restarts, and restarts that change a table.

use super::ranks::{Study, beside_others};

/// A disc that a table drives down into water, holds there, and pulls out again, among the walls of a basin.
const PLUNGER: [(&str, &str); 7] = [
    ("domain", r#"{"size": [0.08, 0.06], "spacing": 0.002}"#),
    ("fluid.lattice_boltzmann.time_step", "1e-4"),
    (
        "fluid.lattice_boltzmann.surface.water",
        r#"[{"level": 0.0231}]"#,
    ),
    ("materials", r#"{"rock": {"density": 2600}}"#),
    (
        "bodies",
        r#"[{"name": "plunger", "shape": {"disc": {"radius": 0.0083}}, "position": [0.0311, 0.0351], "material": "rock",
             "motion": {"driven": {"velocity": [0.1, -1], "angular_velocity": 5,
                "history": [[0.01, 0], [0.03, 0.4], [0.05, 0.4], [0.05, 0], [0.0701, 0], [0.08, -0.6]]}}}]"#,
    ),
    (
        "probes",
        r#"[{"name": "plunger", "every": 0.001, "at": {"body": {"name": "plunger"}}}]"#,
    ),
    ("time.end", "0.1"),
];

/// Returns the last value of a column of a probe.
fn last(study: &Study, run: &str, table: &str, column: &str) -> f64 {
    let rows = io::table::read(&study.path(run).join(table)).unwrap();
    *rows.column(column).unwrap().last().unwrap()
}

#[test]
fn a_body_follows_its_table_on_any_ranks_and_over_restarts() {
    let _beside = beside_others();
    let mut set = PLUNGER.to_vec();
    set.push(("checkpoint.every", "0.02"));
    let study = Study::from_example("dam-break", &set);
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("threads", 1, 2, "domain.split=y"),
        ("two", 2, 2, "domain.split=x"),
        ("three", 3, 1, "domain.split=y"),
        ("four", 4, 1, "domain.split=x"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0417"]);
    study.restart("parts", 1, &["time.end=0.0703"]).expect(0);
    study.restart("parts", 3, &["time.end=0.1"]).expect(0);
    study.same("straight", "parts");
    // The integral of the table: 0.004 + 0.008 - 0.00297 - 0.012.
    let path = -0.00297;
    for (column, from, factor) in [("x", 0.0311, 0.1), ("y", 0.0351, -1.0)] {
        let found = last(&study, "straight", "probe_plunger.csv", column);
        assert!((found - from - factor * path).abs() < 1e-12, "{found}");
    }
    let water = &study.summary("straight")["water"];
    assert!(
        water["mass_error"].as_f64().unwrap().abs() < 1e-12,
        "{water}"
    );
}

#[test]
fn a_restart_may_change_a_table_but_not_remove_it() {
    let _beside = beside_others();
    let study = Study::from_example("dam-break", &PLUNGER);
    study.run("parts", 2, 1, &["time.end=0.04"]);
    let removed = study.restart(
        "parts",
        1,
        &["time.end=0.06", "bodies[0].motion.driven.history=null"],
    );
    let text = removed.expect(3).stderr;
    assert!(text.contains("bodies[0].motion.driven.history"), "{text}");
    assert!(text.contains("write a table with one row"), "{text}");
    let table = "bodies[0].motion.driven.history=[[0, 0], [0.04, 0], [0.06, 0.2]]";
    study
        .restart("parts", 3, &["time.end=0.06", table])
        .expect(0);
    // Before the change 0.004 + 0.4 * 0.01, then 0.5 * 0.2 * 0.02.
    let found = last(&study, "parts", "probe_plunger.csv", "y");
    let exact = 0.0351 - 0.004 - 0.004 - 0.002;
    assert!((found - exact).abs() < 1e-12, "{found} of {exact}");
}

/// Checks that a block that fills a duct moves its area times its velocity of water, at each velocity of its table.
///
/// The walls are free of friction: water at a wall without slip passes a piston within a layer of the width of a cell.
#[test]
fn a_piston_moves_its_area_times_its_velocity() {
    let _beside = beside_others();
    let study = Study::new(
        r#"{"domain": {"size": [0.08, 0.016, 0.012], "spacing": 0.002, "periodic": ["x", "z"]},
            "materials": {"rock": {"density": 2600}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-4, "time_step": 1e-3,
                "boundaries": [{"name": "floor", "face": "y_min", "condition": {"free_slip": {}}},
                    {"name": "roof", "face": "y_max", "condition": {"free_slip": {}}}]}},
            "coupling": {"partially_saturated": {}},
            "bodies": [{"name": "piston", "shape": {"cuboid": {"edges": [0.02, 0.016, 0.012]}},
                "position": [0.0211, 0.008, 0.006], "material": "rock",
                "motion": {"driven": {"velocity": [0.01, 0, 0], "history": [[0, 0], [1, 1], [2, 1], [3, 0.5]]}}}],
            "probes": [{"name": "ahead", "every": 0.01, "at": {"plane": {"axis": "x", "position": 0.061}}}],
            "time": {"end": 4}}"#,
    );
    study.run("straight", 1, 2, &[]);
    study.run("three", 3, 1, &[]);
    study.same("straight", "three");
    let rows = io::table::read(&study.path("straight").join("probe_ahead.csv")).unwrap();
    let times = rows.column("time").unwrap();
    let discharges = rows.column("discharge").unwrap();
    for (from, to, factor) in [(1.2, 2.0, 1.0), (3.2, 4.0, 0.5)] {
        let rows = times.iter().zip(discharges.iter());
        let during = rows.filter(|(time, _)| (from..to).contains(*time));
        let found: Vec<f64> = during.map(|(_, discharge)| *discharge).collect();
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        let exact = factor * 0.01 * 0.016 * 0.012;
        // The sound of the block that crosses cells has no mean.
        let error = mean / exact - 1.0;
        assert!(error.abs() < 1e-3, "{error} from {from} s");
    }
}

/// Checks that a wall that pushes a sphere moves by the integral of its table.
#[test]
fn a_wall_follows_its_table() {
    let _beside = beside_others();
    let case = r#"{"domain": {"size": [0.1, 0.02, 0.02]},
        "materials": {"rock": {"density": 2600}},
        "contact": {"linear": {"friction_angle_degrees": 0, "normal_stiffness": {"absolute": 1e4},
            "normal_damping_ratio": 0.5}},
        "walls": [{"name": "gate", "shape": {"plane": {"point": [0.01, 0, 0], "normal": [1, 0, 0]}}, "material": "rock",
            "velocity": [0.1, 0, 0], "history": [[0, 1], [0.1, 1], [0.1, 2], [0.2, 0]]}],
        "bodies": [{"name": "ball", "shape": {"sphere": {"radius": 0.004}}, "position": [0.02, 0.01, 0.01],
            "motion": {"free": {}}, "material": "rock"}],
        "probes": [{"name": "gate", "every": 0.01, "at": {"wall_load": {"name": "gate"}}}],
        "time": {"end": 0.25}}"#;
    let study = Study::new(case);
    study.run("straight", 1, 1, &[]);
    study.run("two", 2, 1, &[]);
    study.same("straight", "two");
    // The integral of the table: 0.1 (0.1 + 0.1).
    let found = last(&study, "straight", "probe_gate.csv", "displacement_x");
    assert!((found - 0.02).abs() < 1e-12, "{found}");
}
