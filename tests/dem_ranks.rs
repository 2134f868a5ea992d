//! Grains under a real `mpirun`: the same bits on 1 to 4 ranks, split along x and along y.

#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::panic,
        clippy::print_stdout,
        clippy::print_stderr,
        reason = "a test fails by panicking and prints what it measures"
    )
)]

use std::path::PathBuf;
use std::process::Command;

/// Returns the path of the example. Cargo builds examples together with the tests, unless only one test is built.
fn example() -> PathBuf {
    let mut path = std::env::current_exe().expect("a running test has a path");
    path.pop();
    path.pop();
    let example = path.join("examples").join("dem_ranks");
    if !example.exists() {
        let mut build = Command::new(env!("CARGO"));
        build.args(["build", "--package", "solver", "--example", "dem_ranks"]);
        if path.ends_with("release") {
            build.arg("--release");
        }
        assert!(build.status().expect("cargo starts").success());
    }
    example
}

const SCENES: [&str; 5] = ["colliding", "periodic", "bonded", "giant", "blocks"];

/// Returns the hash of each scene. One job runs all scenes, because its start takes longer than a scene.
fn hashes(ranks: usize, axis: &str) -> Vec<String> {
    let output = Command::new("timeout")
        .args(["--kill-after=5", "100", "mpirun", "--oversubscribe", "-n"])
        .arg(ranks.to_string())
        .arg(example())
        .arg(axis)
        .args(SCENES)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_btl_vader_single_copy_mechanism", "none")
        // A Munge socket without a server delays every start by two seconds.
        .env("PMIX_MCA_psec", "native")
        // The search for cluster hardware would take most of a start; with binding, ranks of all jobs would share
        // the first cores.
        .env("OMPI_MCA_pml", "ob1")
        .env("OMPI_MCA_btl", "self,vader")
        .env("OMPI_MCA_hwloc_base_binding_policy", "none")
        // A waiting rank yields its core.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .expect("`timeout` (coreutils) starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{ranks} ranks: {stderr}");
    let told = String::from_utf8_lossy(&output.stdout);
    let lines: Vec<String> = told.lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), SCENES.len(), "{told}");
    lines
}

#[test]
fn grains_do_not_feel_the_ranks() {
    let one = hashes(1, "x");
    for (scene, line) in SCENES.iter().zip(&one) {
        assert!(line.contains(" contacts "), "{line}");
        assert_eq!(*scene == "bonded", !line.ends_with("breaks 0"), "{line}");
        assert!(!line.contains("contacts 0 "), "{line}");
    }
    for (ranks, axis) in [(2, "x"), (3, "y"), (4, "x")] {
        let many = hashes(ranks, axis);
        for (scene, (one, many)) in SCENES.iter().zip(one.iter().zip(&many)) {
            assert_eq!(one, many, "{scene}, {ranks} ranks along {axis}");
        }
    }
}
