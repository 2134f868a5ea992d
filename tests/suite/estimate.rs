//! `solver estimate` with the binary: plane Poiseuille flow on three grids, and what a second call runs again.

use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// Water between plates of 0.4 mm under 100 N/m3, with the slip of BGK at a relaxation time of 1.1: the velocity in the middle is that
/// of the parabola plus h²(4 Λ/3 - 1/4) G/(2 mu), Λ = 0.36, an error of exactly second order.
fn case() -> Value {
    json!({
        "domain": {"size": [1e-4, 4e-4], "spacing": 1.25e-5, "periodic": ["x"]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "collision": {"bgk": {}}, "relaxation_time": 1.1,
            "body_force": {"constant": [100, 0]}}},
        "time": {"end": 0.4},
        "probes": [
            {"name": "plane", "every": 0.01, "at": {"plane": {"axis": "x", "position": 5e-5}}},
            {"name": "wall", "every": 0.4, "at": {"wall": {"face": "y_min"}}}
        ]
    })
}

fn estimate(case: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
    command.arg("estimate").arg(case).args(["--threads", "1"]);
    command.args(more);
    for name in [
        "OMPI_COMM_WORLD_RANK",
        "PMIX_RANK",
        "PMI_RANK",
        "SLURM_PROCID",
        "SOLVER",
    ] {
        command.env_remove(name);
    }
    command
}

#[track_caller]
fn done(case: &Path, more: &[&str]) -> String {
    let output = estimate(case, more).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", output.status);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn the_exact_flow_lies_in_the_interval_and_no_run_is_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("flow.json");
    std::fs::write(&file, case().to_string()).unwrap();
    let output = folder.path().join("out");
    let more = ["--output", output.to_str().unwrap()];
    let said = done(&file, &more);
    assert!(said.contains("3 runs") && said.contains("1.25"), "{said}");

    let text = std::fs::read_to_string(output.join("1-case/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["outcome"], "done");
    let rows = summary["estimate"]["answers"].as_array().unwrap();
    let row = |name: &str| rows.iter().find(|r| r["answer"] == name).unwrap();
    let flux = row("plane: discharge, last");
    // G H³/(12 mu); the mean over cell centres adds a second-order error of its own.
    let exact = 100.0 * 4e-4_f64.powi(3) / (12.0 * 1e-3);
    let number = |key: &str| flux[key].as_f64().unwrap();
    assert_eq!(flux["behaviour"], "asymptotic", "{flux}");
    assert!((number("observed_order") - 2.0).abs() < 1e-3, "{flux}");
    let error = (number("value") - exact).abs();
    // The whole error is that of the cells: the interval is 1.25 times as wide.
    assert!(
        (number("uncertainty") / error - 1.25).abs() < 0.01,
        "{error}: {flux}"
    );
    assert!(
        (number("extrapolated") / exact - 1.0).abs() < 1e-5,
        "{flux}"
    );
    assert_eq!(flux["settled"], true);
    // Equal on all grids by the balance of forces.
    assert_eq!(row("wall: force_x, last")["behaviour"], "equal");
    assert_eq!(row("wall: force_x, last")["settled"], Value::Null);
    let csv = std::fs::read_to_string(output.join("estimate.csv")).unwrap();
    assert!(csv.contains("plane: discharge, last"), "{csv}");

    let again = done(&file, &more);
    assert!(again.contains("3 of 3 members need no run"), "{again}");
    // A damaged grid is run again, and only that.
    let second = std::fs::read_dir(&output).unwrap().flatten();
    let second = second.map(|e| e.path()).find(|p| {
        p.file_name()
            .is_some_and(|n| n.to_string_lossy().starts_with("2-grid"))
    });
    std::fs::remove_file(second.unwrap().join("member.json")).unwrap();
    let refused = estimate(&file, &more).output().unwrap();
    assert_eq!(
        refused.status.code(),
        Some(5),
        "a folder that is none of ours"
    );
}

#[test]
fn the_plan_says_what_an_estimate_costs() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("flow.json");
    std::fs::write(&file, case().to_string()).unwrap();
    let plan = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
        let output = command.arg("plan").arg(&file).args(more).output().unwrap();
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let text = plan(&[]);
    assert!(
        text.contains("costs of `solver estimate`") && text.contains("2-grid-"),
        "{text}"
    );
    // A long run, beside which the start of the program counts little.
    let long = ["--json", "--set", "time.end=4000"];
    let tree: Value = serde_json::from_str(&plan(&long)).unwrap();
    let costs = &tree["uncertainty_estimate"];
    assert_eq!(costs["runs"].as_array().unwrap().len(), 3);
    let own = tree["estimate"]["seconds_on_one_core"].as_f64().unwrap();
    let all = costs["seconds_on_one_core"].as_f64().unwrap();
    assert!(all > own && all < 1.25 * own, "{all} for {own}");
}
