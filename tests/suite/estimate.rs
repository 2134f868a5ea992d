//! `solver estimate` with the binary: plane Poiseuille flow on three grids, and the runs repeated by a second call.

use crate::ranks::beside_others;
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// Returns water between plates of 0.4 mm under 100 N/m3, with the slip of BGK at a relaxation time of 1.1: the
/// velocity in the middle is that of the parabola plus h²(4 Λ/3 - 1/4) G/(2 mu), Λ = 0.36, an error of exactly
/// second order.
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
pub(crate) fn done(case: &Path, more: &[&str]) -> String {
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
    // The total error is that of the cells, and the interval is 1.25 times the error.
    assert!(
        (number("uncertainty") / error - 1.25).abs() < 0.01,
        "{error}: {flux}"
    );
    assert!(
        (number("extrapolated") / exact - 1.0).abs() < 1e-5,
        "{flux}"
    );
    assert_eq!(flux["settled"], true);
    // The force is equal on all grids by the balance of forces.
    assert_eq!(row("wall: force_x, last")["behaviour"], "equal");
    assert_eq!(row("wall: force_x, last")["settled"], Value::Null);
    let csv = std::fs::read_to_string(output.join("estimate.csv")).unwrap();
    assert!(csv.contains("plane: discharge, last"), "{csv}");

    let again = done(&file, &more);
    assert!(again.contains("3 of 3 members need no run"), "{again}");
    // Only a damaged grid is run again.
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

/// Returns water over a weir that closes half of a channel; the largest lattice velocity on the grid of the case is
/// 0.045.
fn weir(limit: f64) -> Value {
    json!({
        "domain": {"size": [8e-4, 4e-4], "spacing": 1.25e-5},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "collision": {"trt": {"magic": 0.1875}},
                "relaxation_time": 0.8,
            "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {
                    "profile": {"uniform": {"velocity": [0.01, 0]}}, "ramp_time": 0.01}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
        "structures": [{"name": "weir", "shape": {"box": {"from": [3e-4, -1e-4], "to": [4e-4, 2e-4]}}}],
        "guards": {"max_lattice_velocity": limit},
        "time": {"end": 0.02},
        "probes": [{"name": "weir", "every": 0.002, "at": {"structure": {"name": "weir"}}}]
    })
}

/// Checks a weir over whose crest the lattice velocity increases with the cell size, which the plan does not predict. A
/// guard ends the runs on coarser grids: other grids replace them, and the message describes the remaining estimate.
#[test]
fn grids_that_a_guard_ends_are_replaced_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, limit: f64| {
        let case = weir(limit);
        let file = folder.path().join(format!("{name}.json"));
        std::fs::write(&file, case.to_string()).unwrap();
        let output = folder.path().join(name);
        let said = done(
            &file,
            &["--cells-only", "--output", output.to_str().unwrap()],
        );
        let text = std::fs::read_to_string(output.join("1-case/summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&text).unwrap();
        let block = summary["estimate"].clone();
        let failed = |grid: &&Value| grid["failure"].is_string();
        let grids = block["grids"].as_array().unwrap().clone();
        let lost = grids.iter().filter(failed).count();
        let rows = block["answers"].as_array().unwrap();
        let force = rows
            .iter()
            .find(|r| r["answer"] == "weir: fluid_force_x, last");
        (
            said,
            block.clone(),
            force.unwrap().clone(),
            grids.len() - lost,
        )
    };
    // The coarsest of three grids fails: an intermediate one replaces it, and three remain.
    let (said, block, force, usable) = run("three", 0.099);
    assert!(
        said.contains("no results: numerical refusal") && said.contains("max_lattice_velocity"),
        "{said}"
    );
    assert_eq!(usable, 3, "{block}");
    assert_eq!(force["values"].as_array().unwrap().len(), 3);
    // All coarser grids fail: the finer one and the case remain, with the larger factor of safety.
    let (said, block, force, usable) = run("two", 0.0517);
    assert!(
        said.contains("the estimate uses two grids, because 2 of"),
        "{said}"
    );
    assert_eq!(usable, 2, "{block}");
    assert!(
        block["conclusion"]
            .as_str()
            .unwrap()
            .contains("factor of safety is 3")
    );
    assert_eq!(force["behaviour"], "two_grids", "{force}");
    assert_eq!(force["factor"], 3.0);
    assert!(
        block["grids"][0]["ratio"].as_f64().unwrap() < 1.0,
        "{block}"
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
    // A long run, compared with which the start of the program is short.
    let long = ["--json", "--set", "time.end=4000"];
    let tree: Value = serde_json::from_str(&plan(&long)).unwrap();
    let costs = &tree["uncertainty_estimate"];
    assert_eq!(costs["runs"].as_array().unwrap().len(), 3);
    let own = tree["estimate"]["seconds_on_one_core"].as_f64().unwrap();
    let all = costs["seconds_on_one_core"].as_f64().unwrap();
    assert!(all > own && all < 1.25 * own, "{all} for {own}");
}

/// Checks that a failure of the case itself gives the exit code of a numerical failure.
#[test]
fn the_failure_of_the_case_is_a_numerical_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("fast.json");
    // The plan does not predict the velocity over the crest.
    let case = weir(0.03);
    std::fs::write(&file, case.to_string()).unwrap();
    let output = folder.path().join("out");
    let more = ["--allow-unstable", "--output", output.to_str().unwrap()];
    let done = estimate(&file, &more).output().unwrap();
    let errors = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(4), "{errors}");
    assert!(
        errors.contains("numerical failure: the run of the case gives no results"),
        "{errors}"
    );
}

/// Checks that the plan of a case that costs too little for a pilot is printed without one.
#[test]
fn a_cheap_case_has_a_plan_without_a_pilot() {
    let _beside = beside_others();
    let folder = tempfile::tempdir().unwrap();
    let text = solver::case::examples::find("first-flow").unwrap().text;
    std::fs::write(folder.path().join("case.json"), text).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_solver"))
        .current_dir(folder.path())
        .args(["plan", "case.json", "--pilot"])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{told}");
    assert!(told.contains("no pilot: none on coarser cells"), "{told}");
    assert!(told.contains("time and scales"), "{told}");
}

/// Checks that a pilot runs on coarse cells and writes the case with its results, that the plan of this case is the
/// same on every machine, and that a change of the case is detected.
#[test]
fn a_pilot_gives_the_plan_speed_and_pressure() {
    let _beside = beside_others();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("way.json");
    let case = json!({
        "domain": {"size": [0.06, 0.02]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-5,
            "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {
                    "profile": {"parabolic": {"peak": 0.01}}, "ramp_time": 0.5}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
        "structures": [{"name": "sill", "shape": {"box": {"from": [0.02, -1], "to": [0.025, 0.013]}}}],
        "time": {"end": 40}, "accuracy": "normal"
    });
    std::fs::write(&file, case.to_string()).unwrap();
    let solver = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
        command.current_dir(folder.path());
        command
    };
    let done = solver()
        .args(["plan", "way.json", "--pilot"])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(
        done.status.success(),
        "{told} {}",
        String::from_utf8_lossy(&done.stderr)
    );
    let text = std::fs::read_to_string(folder.path().join("way.pilot.json")).unwrap();
    let mut piloted: Value = serde_json::from_str(&text).unwrap();
    let pilot = piloted["fluid"]["lattice_boltzmann"]["pilot"].clone();
    // Through a third of the height the water is three times as fast as in the channel.
    let speed = pilot["speed"].as_f64().unwrap();
    assert!((0.02..0.05).contains(&speed), "{pilot}");
    assert!(told.contains("velocity of the pilot"), "{told}");
    let plan = |case: &Value| {
        let document = solver::case::Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        solver::plan::Plan::prepare(document).unwrap()
    };
    let changed =
        |plan: &solver::plan::Plan| plan.warnings.iter().any(|w| w.path.ends_with("pilot.of"));
    assert!(!changed(&plan(&piloted)));
    piloted["fluid"]["lattice_boltzmann"]["kinematic_viscosity"] = json!(2e-5);
    assert!(changed(&plan(&piloted)));
}
