//! `solver threshold` with the binary: a block on a tilted plane, interrupted and resumed, and searches that fail.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Gravity along the plane at which the block slides by Coulomb's law [m/s2].
fn coulomb() -> f64 {
    9.81 * 35_f64.to_radians().tan()
}

/// Returns the example search in its own folder.
fn study(change: impl Fn(&mut Value)) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let mut tree: Value = serde_json::from_str(solver::case::examples::SEARCH.text).unwrap();
    change(&mut tree);
    let file = folder.path().join("slope.json");
    std::fs::write(&file, tree.to_string()).unwrap();
    (folder, file)
}

fn threshold(file: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
    command.arg("threshold").arg(file).args(more);
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
fn ended(mut command: Command, code: i32) -> Output {
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{errors}");
    output
}

/// Returns the result and the cells of the members without the time and the folder.
fn results(folder: &Path) -> (Value, Vec<Vec<String>>) {
    let text = std::fs::read_to_string(folder.join("threshold.json")).unwrap();
    let table = std::fs::read_to_string(folder.join("threshold.csv")).unwrap();
    let rows = table
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            // Column 6 is the cost.
            let kept = cells.iter().enumerate().filter(|(n, _)| *n != 6);
            kept.map(|(_, cell)| (*cell).to_owned()).collect()
        });
    (serde_json::from_str(&text).unwrap(), rows.collect())
}

fn number(found: &Value, key: &str) -> f64 {
    found[key].as_f64().unwrap_or_else(|| panic!("{found:#}"))
}

#[test]
fn the_slope_is_that_of_coulomb_side_by_side_on_ranks_and_after_a_kill() {
    let (folder, file) = study(|tree| tree["run"] = json!({"at_once": 1}));
    let done = ended(threshold(&file, &["--json"]), 0);
    let printed: Value = serde_json::from_slice(&done.stdout).unwrap();
    let (found, rows) = results(&file.with_extension(""));
    assert_eq!(printed, found);
    assert_eq!(found["result"], "threshold");
    let (holds, slides) = (number(&found, "false_at"), number(&found, "true_at"));
    println!("slides between {holds} and {slides}, Coulomb {}", coulomb());
    assert!(holds < coulomb() && coulomb() < slides, "{found:#}");
    assert!(slides - holds <= 0.005 * slides, "{found:#}");
    assert_eq!(found["members"], json!(rows.len() - 1));

    // Two members at once, then members of two ranks: the same values, verdicts and states.
    for run in [json!({"at_once": 2}), json!({"ranks": 2})] {
        let (_other, other) = study(|tree| tree["run"] = run.clone());
        ended(threshold(&other, &[]), 0);
        assert_eq!(
            results(&other.with_extension("")),
            (found.clone(), rows.clone()),
            "{run}"
        );
    }

    // The search is killed when it starts its fourth member: the second start runs only what is missing.
    let count = folder.path().join("count");
    let launcher = folder.path().join("launch.sh");
    let script = format!(
        "echo >>{0}\n[ $(wc -l <{0}) -ne 4 ] || {{ kill -9 $PPID; exit 1; }}\nexec \"$@\"\n",
        count.display()
    );
    std::fs::write(&launcher, script).unwrap();
    let again = folder.path().join("again");
    let more = ["--output", again.to_str().unwrap()];
    let mut killed = threshold(&file, &more);
    killed.env("LAUNCH", format!("sh {}", launcher.display()));
    assert_eq!(killed.output().unwrap().status.code(), None);
    assert!(!again.join("threshold.json").exists());
    let before = std::fs::read_to_string(again.join("threshold.csv")).unwrap();
    assert!(
        before.contains(",true,") && before.contains(",false,"),
        "{before}"
    );
    let mut second = threshold(&file, &more);
    second.env("LAUNCH", format!("sh {}", launcher.display()));
    ended(second, 0);
    assert_eq!(results(&again), (found, rows.clone()));
    // The member that was cut is started twice.
    let started = std::fs::read_to_string(&count).unwrap().lines().count();
    assert_eq!(started, rows.len() - 1 + 1);
}

/// Checks a criterion that is true below the threshold, with the friction angle as the searched field and other fields
/// that depend on it.
#[test]
fn a_criterion_may_change_in_either_direction_and_fields_may_depend_on_the_searched_one() {
    let angle = "contact.blocks.friction_angle_degrees";
    let search = json!({"field": angle, "from": 20, "to": 36, "tolerance": {"absolute": 0.5}});
    let (_folder, file) = study(|tree| {
        tree["case"]["gravity"] = json!([9.81 * 0.5, 0, -9.81]);
        tree["search"] = search.clone();
    });
    ended(threshold(&file, &[]), 0);
    let (found, _) = results(&file.with_extension(""));
    let exact = 0.5_f64.atan().to_degrees();
    let (slides, holds) = (number(&found, "true_at"), number(&found, "false_at"));
    println!("slides at {slides} and holds at {holds} degrees, Coulomb {exact}");
    assert!(slides < exact && exact < holds, "{found:#}");
    // Gravity that stays below the friction of each member.
    let (_folder, file) = study(|tree| {
        tree["search"] = search.clone();
        tree["set"] =
            json!({"gravity[0]": format!("=9.81*sin({angle}*pi/200)/cos({angle}*pi/200)")});
    });
    let done = ended(threshold(&file, &[]), 0);
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(text.contains("is false at both ends"), "{text}");
}

#[test]
fn a_criterion_that_does_not_change_is_a_result_and_failed_members_have_no_verdict() {
    for (criterion, word) in [
        ("speed > -1", "true_at_both_ends"),
        ("speed > 1e3", "false_at_both_ends"),
    ] {
        let (_folder, file) = study(|tree| tree["criterion"] = json!(criterion));
        let done = ended(threshold(&file, &["--json"]), 0);
        let printed: Value = serde_json::from_slice(&done.stdout).unwrap();
        assert_eq!(
            (&printed["result"], &printed["true_at"]),
            (&json!(word), &Value::Null)
        );
    }
    // The third member ends by a signal: it counts neither way, and the exit code is that of a failed member.
    let (folder, file) = study(|_| {});
    let count = folder.path().join("count");
    let launcher = folder.path().join("launch.sh");
    let script = format!(
        "echo >>{0}\n[ $(wc -l <{0}) -ne 3 ] || kill -9 $$\nexec \"$@\"\n",
        count.display()
    );
    std::fs::write(&launcher, script).unwrap();
    let mut command = threshold(&file, &[]);
    command.env("LAUNCH", format!("sh {}", launcher.display()));
    let done = ended(command, 5);
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(
        errors.contains("1 of") && errors.contains("ended by signal 9"),
        "{errors}"
    );
    let (found, rows) = results(&file.with_extension(""));
    assert_eq!(found["without_verdict"], json!(1), "{found:#}");
    let (holds, slides) = (number(&found, "false_at"), number(&found, "true_at"));
    assert!(holds < coulomb() && coulomb() < slides, "{found:#}");
    assert_eq!(rows[3][3..6], ["failed", "", ""]);
    // An output that no member has: no verdict at the ends, a numerical failure.
    let (_folder, file) = study(|tree| tree["outputs"]["speed"]["where"] = json!("time > 1e6"));
    let done = ended(threshold(&file, &[]), 4);
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(
        errors.contains("2 of 2 members have no verdict"),
        "{errors}"
    );
}

#[test]
fn a_wrong_search_is_refused_with_path_and_remedy_before_any_run() {
    type Change = fn(&mut Value);
    let wrong: [(Change, &str, &str); 11] = [
        (|t| t["search"]["form"] = json!(1), "search.form", "from"),
        (
            |t| t["search"]["from"] = json!(9),
            "search.from = 9",
            "smaller number",
        ),
        (
            |t| t["search"]["from"] = json!(-1),
            "search.tolerance",
            "absolute",
        ),
        (|t| t["search"]["parts"] = json!(1), "search.parts = 1", "2"),
        (
            |t| t["search"]["field"] = json!("gravty[0]"),
            "gravty",
            "gravity",
        ),
        (
            |t| t["criterion"] = json!("sped > 0.001"),
            "criterion",
            "outputs",
        ),
        (
            |t| t["criterion"] = json!("speed >"),
            "criterion",
            "write numbers",
        ),
        (
            |t| t["criterion"] = json!("speed"),
            "criterion",
            "speed > 1e-3",
        ),
        (
            |t| t["search"]["field"] = json!("gravity[7]"),
            "gravity[7]",
            "use 0 to 2, or 3 to add an entry",
        ),
        (
            |t| t["outputs"]["speed"]["file"] = json!("probe_blok.csv"),
            "outputs.speed.file",
            "probe_block.csv",
        ),
        (
            |t| t["set"] = json!({"gravity[0]": 1}),
            "set.gravity[0]",
            "leave it out",
        ),
    ];
    for (change, path, remedy) in wrong {
        let (_folder, file) = study(change);
        let done = ended(threshold(&file, &[]), 3);
        let errors = String::from_utf8_lossy(&done.stderr);
        assert!(
            errors.contains(path) && errors.contains(remedy),
            "{path}: {errors}"
        );
        assert_eq!(errors.matches("error: ").count(), 1, "{errors}");
        assert!(!file.with_extension("").exists());
    }
    let (_folder, file) = study(|_| {});
    let listed = ended(threshold(&file, &["--list"]), 0);
    let text = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert!(
        text.contains("gravity-0=5 ") && text.contains("3 members between"),
        "{text}"
    );
    assert!(!file.with_extension("").exists());
}
