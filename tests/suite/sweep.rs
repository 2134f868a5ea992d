//! `solver sweep` with the binary: a small study of plane Poiseuille flow, interrupted and resumed, and a map of
//! limits.

use crate::ranks::hang;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Returns the example study with the spacing as its only variation, in its own folder.
fn study(change: impl Fn(&mut Value)) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let mut tree: Value = serde_json::from_str(solver::case::examples::STUDY.text).unwrap();
    tree["vary"] = json!({"domain.spacing": [1e-4, 5e-5, 2.5e-5]});
    change(&mut tree);
    let file = folder.path().join("flow.json");
    std::fs::write(&file, tree.to_string()).unwrap();
    (folder, file)
}

fn sweep(file: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
    command.arg("sweep").arg(file).args(more);
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
fn done(file: &Path, more: &[&str]) -> String {
    let output = sweep(file, more).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {errors}", output.status);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Returns the rows of a table by member and column.
fn table(path: &Path) -> BTreeMap<String, BTreeMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let row = header.iter().zip(&cells);
            let row = row.map(|(name, cell)| ((*name).to_owned(), (*cell).to_owned()));
            (cells[0].to_owned(), row.collect())
        })
        .collect()
}

fn column(table: &BTreeMap<String, BTreeMap<String, String>>, name: &str) -> Vec<String> {
    table.values().map(|row| row[name].clone()).collect()
}

#[test]
fn an_interrupted_sweep_goes_on_to_the_table_of_a_straight_one() {
    let (_folder, file) = study(|_| {});
    let output = file.with_extension("");
    done(&file, &[]);
    let straight = table(&output.join("members.csv"));
    // The nodal mean of the exact parabola, which the operator gives with half-way walls, has an error of (h/H)²/2.
    for (member, cells) in [
        ("spacing=1e-4", 10.0),
        ("spacing=5e-5", 20.0),
        ("spacing=2.5e-5", 40.0),
    ] {
        let row = &straight[member];
        let error: f64 = row["error"].parse().unwrap();
        approx::assert_relative_eq!(error, 0.5 / (cells * cells), max_relative = 1e-4);
        assert_eq!(row["outcome"], "finished");
        let cost: f64 = row["core-seconds of the steps"].parse().unwrap();
        let whole: f64 = row["core-seconds of the run"].parse().unwrap();
        assert!(cost > 0.0 && cost <= whole, "{cost} of {whole}");
    }
    // Finer cells are more accurate and more expensive, so that all three are in the Pareto set.
    assert_eq!(column(&straight, "pareto error-time"), ["yes"; 3]);
    let svg = std::fs::read_to_string(output.join("sweep.svg")).unwrap();
    assert!(svg.contains("1 spacing=1e-4") && svg.contains("3 spacing=2.5e-5"));
    assert!(done(&file, &[]).contains("3 of 3 members need no run"));

    // A second sweep, ended by a signal as soon as the second member runs.
    let other = output.with_extension("again");
    let more = ["--output", other.to_str().unwrap()];
    let mut running = sweep(&file, &more).spawn().unwrap();
    let begun = Instant::now();
    while !other.join("spacing=5e-5/member.json").exists() {
        assert!(begun.elapsed() < hang(3.0), "no second member");
        assert!(running.try_wait().unwrap().is_none(), "ended by itself");
        // An observer that only yields would occupy a core.
        std::thread::sleep(Duration::from_millis(1));
    }
    crate::ranks::signal(i32::try_from(running.id()).unwrap(), "TERM");
    assert_eq!(running.wait().unwrap().code(), Some(75));
    assert!(!other.join("members.csv").exists());
    let first = std::fs::read(other.join("spacing=1e-4/member.json")).unwrap();
    let said = done(&file, &more);
    assert!(said.contains("of 3 members need no run"), "{said}");
    assert_eq!(
        first,
        std::fs::read(other.join("spacing=1e-4/member.json")).unwrap()
    );
    let resumed = table(&other.join("members.csv"));
    assert_eq!(
        column(&resumed, "state_hash"),
        column(&straight, "state_hash")
    );
    assert_eq!(column(&resumed, "error"), column(&straight, "error"));
}

#[test]
fn members_of_a_job_array_are_collected() {
    let (_folder, file) = study(|tree| {
        tree["vary"]["domain.spacing"] = json!([1e-4, 5e-5]);
        tree["reference"] = json!({"mean_velocity": {"finest": "domain.spacing"}});
    });
    let list = done(&file, &["--list"]);
    assert!(
        list.contains("   2  spacing=5e-5") && list.contains("to be run"),
        "{list}"
    );
    assert!(done(&file, &["--slurm"]).contains("#SBATCH --array=1-2"));
    done(&file, &["--member", "2"]);
    done(&file, &["--collect"]);
    let half = table(&file.with_extension("").join("members.csv"));
    assert_eq!(column(&half, "outcome"), ["missing", "finished"]);
    done(&file, &["--member", "1"]);
    done(&file, &["--collect"]);
    let whole = table(&file.with_extension("").join("members.csv"));
    // Ratio of the errors 1/200 and 1/800.
    let error: f64 = whole["spacing=1e-4"]["error"].parse().unwrap();
    approx::assert_relative_eq!(
        error,
        (1.0 + 1.0 / 200.0) / (1.0 + 1.0 / 800.0) - 1.0,
        max_relative = 1e-3
    );
    assert_eq!(whole["spacing=5e-5"]["error"], "");
    assert_eq!(
        sweep(&file, &["--member", "3"]).status().unwrap().code(),
        Some(3)
    );
}

#[test]
fn a_map_shows_what_becomes_of_settings_that_the_plan_refuses() {
    let (_folder, file) = study(|tree| {
        tree["case"]["time"]["end"] = json!(1.5);
        tree["case"]["probes"][0]["every"] = json!(1.5);
        // In the middle u = F H²/(8 mu) is 0.2 of the lattice speed at 160 N/m3, which reduces accuracy without a
        // failure, and would be 0.8 at 640, which the guard detects at step 1000.
        tree["vary"] = json!({
            "domain.spacing": [1e-4],
            "fluid.lattice_boltzmann.body_force.constant[0]": [1, 160, 640],
        });
        tree["refused"] = json!("run");
        tree["map"] = json!([
            "domain.spacing",
            "fluid.lattice_boltzmann.body_force.constant[0]"
        ]);
        tree["run"] = json!({"ranks": 1, "threads": 1, "at_once": 1, "time_limit": 60});
    });
    let said = done(&file, &[]);
    assert!(said.contains("2 finished, 1 numerical refusal"), "{said}");
    let map = table(&file.with_extension("").join("map.csv"));
    assert_eq!(
        column(&map, "plan"),
        ["valid", "valid with warnings", "refused"]
    );
    let outcomes = ["finished", "finished", "numerical refusal"];
    assert_eq!(column(&map, "outcome"), outcomes);
    let svg = std::fs::read_to_string(file.with_extension("").join("map.svg")).unwrap();
    assert!(svg.contains("refused, did not finish: 1") && svg.contains("finished: 2"));
}

#[test]
fn nothing_runs_where_members_would_share_a_core_or_a_field_is_wrong() {
    let (_folder, file) = study(|tree| tree["run"] = json!({"ranks": 1000, "at_once": 100}));
    let output = sweep(&file, &[]).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{errors}");
    assert!(
        errors.contains("members that share a core have no meaningful cost"),
        "{errors}"
    );
    assert!(!file.with_extension("").exists());
}

/// Checks that a quotient by 0 is an empty cell with a note, that errors from a reference of 0 are said to be absolute,
/// and that no study writes into the folder of a run.
#[test]
fn values_without_a_meaning_are_named_and_the_folder_of_a_run_is_left_alone() {
    let (_folder, file) = study(|tree| {
        tree["vary"] = json!({"domain.spacing": [1e-4]});
        tree["outputs"]["quotient"] = json!({"is": "mean_velocity/0"});
        tree["outputs"]["product"] = json!({"is": "2*mean_velocity"});
        tree["reference"]["product"] = json!("0");
    });
    let said = done(&file, &[]);
    assert!(said.contains("quotient: the value is inf"), "{said}");
    assert!(
        said.contains("the errors of product are absolute"),
        "{said}"
    );
    let output = file.with_extension("");
    let rows = table(&output.join("members.csv"));
    assert_eq!(rows["spacing=1e-4"]["quotient"], "");
    let run = output.join("spacing=1e-4");
    let before = std::fs::read_dir(&run).unwrap().count();
    let refused = sweep(&file, &["--output", run.to_str().unwrap()])
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{errors}");
    assert!(errors.contains("holds a run (done"), "{errors}");
    assert_eq!(std::fs::read_dir(&run).unwrap().count(), before);
}

/// Checks that the exit code and the table report a member that is ended by a signal.
#[test]
fn a_member_that_is_killed_is_reported() {
    let (folder, file) = study(|_| {});
    let launcher = folder.path().join("launch.sh");
    std::fs::write(&launcher, "#!/bin/sh\nkill -9 $$\n").unwrap();
    let mut command = sweep(&file, &[]);
    command.env("LAUNCH", format!("sh {}", launcher.display()));
    let done = command.output().unwrap();
    let told = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(5), "{told}");
    assert!(told.contains("members failed"), "{told}");
    assert!(told.contains("ended by signal 9"), "{told}");
}
