//! Seepage runs of the program under a real `mpirun`: the same bits on any number of ranks, along any split, and after a
//! restart on another number; a pocket without outlet ends the run with its name.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Mutex;

/// One job at a time, so that ranks do not compete with those of another test.
static ONE_JOB: Mutex<()> = Mutex::new(());

fn solver(ranks: usize, arguments: &[&str]) -> Output {
    let _alone = ONE_JOB.lock().unwrap_or_else(|poison| poison.into_inner());
    Command::new("timeout")
        .args(["--kill-after=5", "120", "mpirun", "--oversubscribe", "-n"])
        .arg(ranks.to_string())
        .arg(env!("CARGO_BIN_EXE_solver"))
        .args(arguments)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_btl_vader_single_copy_mechanism", "none")
        .env_remove("RUST_BACKTRACE")
        .output()
        .expect("`timeout` (coreutils) starts")
}

fn summary(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn case(folder: &Path) -> String {
    let path = folder.join("case.json");
    let text = solver::case::examples::find("seepage").unwrap().text;
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn run(ranks: usize, more: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let case = case(folder.path());
    let out = folder.path().join("out");
    let mut arguments = vec!["run", &case, "--output", out.to_str().unwrap()];
    arguments.extend(["--set", "time.end=0.002"]);
    arguments.extend(more);
    let output = solver(ranks, &arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{ranks}: {message}");
    summary(&out)
}

#[test]
fn the_same_bits_on_any_ranks_and_splits() {
    let one = run(1, &[]);
    let seepage = &one["seepage"];
    let (inflow, outflow) = (&seepage["inflow"], &seepage["outflow"]);
    let ratio = inflow.as_f64().unwrap() / outflow.as_f64().unwrap();
    assert!((ratio - 1.0).abs() < 1e-6, "{seepage}");
    for (ranks, more) in [
        (2, &["--set", "domain.split=\"x\""][..]),
        (3, &["--set", "domain.split=\"y\""][..]),
        (4, &["--set", "domain.split=\"z\""][..]),
        (4, &[][..]),
    ] {
        let many = run(ranks, more);
        assert_eq!(many["state_hash"], one["state_hash"], "{ranks} {more:?}");
        assert_eq!(many["seepage"], one["seepage"], "{ranks} {more:?}");
    }
}

#[test]
fn a_restart_on_other_ranks_gives_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let case = case(folder.path());
    let (straight, stopped) = (folder.path().join("a"), folder.path().join("b"));
    for out in [&straight, &stopped] {
        let out = out.to_str().unwrap();
        let output = solver(1, &["run", &case, "--output", out]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{message}");
    }
    // From the checkpoint half-way to the end once more.
    let output = solver(2, &["restart", stopped.to_str().unwrap()]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{message}");
    let (one, two) = (summary(&straight), summary(&stopped));
    assert!(two["steps_of_this_run"].as_u64() < one["steps_of_this_run"].as_u64());
    assert_eq!(one["state_hash"], two["state_hash"]);
}

#[test]
fn a_pocket_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let case = case(folder.path());
    let out = folder.path().join("out");
    // A plane cuts the opening off from the water above it.
    let planes =
        r#"fluid.darcy.enclosure={"planes": [{"point": [0, 0, 0.02], "normal": [0, 0, 1]}]}"#;
    let head = r#"fluid.darcy.boundaries[0].condition={"rain": {"rate": 1e-5}}"#;
    let output = solver(
        2,
        &[
            "run",
            &case,
            "--output",
            out.to_str().unwrap(),
            "--set",
            planes,
            "--set",
            head,
        ],
    );
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{message}");
    assert!(message.contains("a pocket of 216 cells"), "{message}");
}
