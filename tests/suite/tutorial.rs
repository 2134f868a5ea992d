//! The tutorials in `jobs/tutorial`: reduced runs agree with the numbers in the texts.

use super::verification::{short_forms, suite};
use crate::ranks::{Cores, ENVIRONMENT, beside_others, without_daemon};
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

/// Returns the numbers of a line of a table.
fn numbers(line: &str) -> Vec<f64> {
    let cells = line.trim().split(',');
    cells.map(|cell| cell.parse().unwrap()).collect()
}

/// Compares the lines that the commands `tail` and `grep` of a text print with those of the tables; returns their
/// number.
fn compare_printed_lines(block: &[&str], read: &dyn Fn(&str) -> String) -> usize {
    let mut printed = 0;
    for pair in block.windows(2) {
        let words: Vec<&str> = pair[0].trim().split(' ').collect();
        let Some(file) = words
            .last()
            .and_then(|word| word.strip_prefix("run/probe_"))
        else {
            continue;
        };
        let table = read(&format!("probe_{file}"));
        let found = match words[0] {
            "tail" => table.lines().last(),
            "grep" => table
                .lines()
                .find(|line| line.contains(words[1].trim_matches('\''))),
            _ => continue,
        };
        let (found, stated) = (numbers(found.unwrap()), numbers(pair[1]));
        assert_eq!(found.len(), stated.len(), "{}", pair[0]);
        for (found, stated) in found.iter().zip(&stated) {
            assert!(
                (found - stated).abs() <= 1e-6 * stated.abs(),
                "{}: {found} {stated}",
                pair[0]
            );
        }
        printed += 1;
    }
    printed
}

/// Checks the lesson on the embankment as its text has it: the plan, the run, every line that a command prints and
/// every number of the prose, and the flow net.
#[test]
fn the_lesson_on_the_embankment_prints_what_its_text_says() {
    let _beside = beside_others();
    let work = tempfile::tempdir().unwrap();
    let lesson = root().join("8-embankment");
    for name in ["case.json", "dam.dxf"] {
        std::fs::copy(lesson.join(name), work.path().join(name)).unwrap();
    }
    let page = std::fs::read_to_string(lesson.join("README.md")).unwrap();
    // The indented lines of the text: commands, and what they print.
    let block: Vec<&str> = page
        .lines()
        .filter(|line| line.starts_with("       "))
        .collect();
    let solver = |begins: &str| {
        let line = block
            .iter()
            .map(|line| line.trim())
            .find(|line| line.starts_with(begins));
        let line = line.unwrap_or_else(|| panic!("no command `{begins}`"));
        let _core = Cores::acquire(1);
        let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
        command.envs(ENVIRONMENT).args(line.split(' ').skip(1));
        let done = command.current_dir(work.path()).output().unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{line}: {said}");
        String::from_utf8(done.stdout).unwrap()
    };
    let planned = solver("solver plan case.json");
    for said in [
        "a staircase of cells",
        "the boundary of a polygon",
        "covers 1488 cells",
    ] {
        assert!(planned.contains(said), "{said}: {planned}");
    }
    solver("solver case.json --output run");
    let read = |name: &str| std::fs::read_to_string(work.path().join("run").join(name)).unwrap();
    let printed = compare_printed_lines(&block, &read);
    assert_eq!(printed, 3);
    let line = |name: &str, column: usize, value: f64| -> Vec<f64> {
        let table = read(name);
        let data = table.lines().filter(|line| line.starts_with("1,"));
        let rows: Vec<Vec<f64>> = data.map(numbers).collect();
        let row = rows
            .into_iter()
            .find(|row| (row[column] - value).abs() < 0.06);
        row.unwrap_or_else(|| panic!("{name}: no {value}"))
    };
    let says = |text: &str, found: String| {
        assert!(page.contains(&text.replace('#', &found)), "{text}: {found}")
    };
    for (x, text) in [
        (45.1, "It is at # m in the core (x = 45.1 m)"),
        (51.1, "at # m behind it (x = 51.1 m)"),
        (69.1, "at # m in front of the toe (x = 69.1 m)"),
    ] {
        says(text, format!("{:.1}", line("probe_table.csv", 2, x)[3]));
    }
    let narrowest = line("probe_heave.csv", 2, 0.25);
    says(
        "the narrowest one has # and",
        format!("{:.2}", narrowest[4]),
    );
    says("and #. `run/summary.json`", format!("{:.1}", narrowest[5]));
    let summary: Value = serde_json::from_str(&read("summary.json")).unwrap();
    let steepest = &summary["seepage"]["exit_gradients"]["downstream"]["gradient"];
    says(
        "the downstream face, # in the corner",
        format!("{:.1}", steepest.as_f64().unwrap()),
    );
    solver("solver picture run");
    let drawn = std::fs::read_to_string(work.path().join("flow-net.svg")).unwrap();
    let shown = std::fs::read_to_string(lesson.join("flow-net.svg")).unwrap();
    assert_eq!(drawn.lines().count(), shown.lines().count());
}
