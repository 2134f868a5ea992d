//! The tutorials in `jobs/tutorial`: reduced runs agree with the numbers in the texts.

use super::verification::{short_forms, suite};
use crate::ranks::{ENVIRONMENT, beside_others, without_daemon};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/tutorial")
}

/// Checks that each number of `expected.json` is in the table of the tutorial, and that the runs agree with it.
#[test]
fn the_numbers_of_the_lessons_are_those_of_their_runs() {
    let _beside = beside_others();
    let lessons = suite::cases(&root()).unwrap();
    let mut stated = 0;
    for lesson in &lessons {
        let page = std::fs::read_to_string(lesson.join("README.md")).unwrap();
        let text = std::fs::read_to_string(lesson.join("expected.json")).unwrap();
        let expected: Value = serde_json::from_str(&text).unwrap();
        for check in expected["checks"].as_array().unwrap() {
            let [quantity, number] =
                ["quantity", "reference"].map(|key| check[key].as_str().unwrap());
            let row = format!("| {quantity} | {number} ");
            assert!(page.contains(&row), "{}: no row `{row}`", lesson.display());
            stated += 1;
        }
        let rows = page.lines().filter(|line| line.starts_with("| ")).count();
        let checks = expected["checks"].as_array().unwrap().len();
        assert_eq!(
            rows,
            checks + 1,
            "{}: a row without a check",
            lesson.display()
        );
    }
    let (cases, compared) = short_forms(&root(), 0, 1);
    assert_eq!((cases, compared), (7, stated));
}

/// Checks the tutorial on clusters: a run continued from its checkpoint ends in the same state as an uninterrupted one.
#[test]
fn the_lesson_on_clusters_ends_in_the_same_state() {
    let _beside = beside_others();
    let work = tempfile::tempdir().unwrap();
    let case = root().join("6-cluster/case.json");
    let run = |folder: &str, arguments: &[&str]| {
        let session = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
        command.envs(ENVIRONMENT);
        without_daemon(&mut command, session.path());
        let done = command
            .args(arguments)
            .args(["--threads", "1"])
            .current_dir(work.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{arguments:?}: {said}");
        let summary = std::fs::read_to_string(work.path().join(folder).join("summary.json"));
        let summary: Value = serde_json::from_str(&summary.unwrap()).unwrap();
        summary["state_hash"].as_str().unwrap().to_owned()
    };
    let case = case.to_str().unwrap();
    let short = ["--set", "probes=[]", "--set", "output={}", "--set"];
    let start = |folder, end| {
        let set = [&[case, "--output", folder], &short[..], &[end]].concat();
        run(folder, &set)
    };
    let half = start("half", "time.end=0.001");
    let whole = start("whole", "time.end=0.002");
    let gone_on = run("half", &["restart", "half", "--set", "time.end=0.002"]);
    assert_eq!(gone_on, whole);
    assert_ne!(half, whole);
}
