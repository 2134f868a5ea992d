//! The crate under a real `mpirun`, on 1 to 4 ranks, always under a timeout: the usual failure of
//! a parallel program is to hang.

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

use std::process::{Command, Output};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Lock that allows one job at a time, so that ranks do not compete with those of another test.
static ONE_JOB: Mutex<()> = Mutex::new(());

/// Runs the check program; `timeout` ends it with exit code 124 if it hangs.
fn mpirun(ranks: usize, arguments: &[&str]) -> (Output, Duration) {
    let _alone = ONE_JOB.lock().unwrap_or_else(|poison| poison.into_inner());
    let start = Instant::now();
    let output = Command::new("timeout")
        .args(["--kill-after=5", "60", "mpirun", "--oversubscribe", "-n"])
        .arg(ranks.to_string())
        .arg(env!("CARGO_BIN_EXE_decomposition_check"))
        .args(arguments)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_btl_vader_single_copy_mechanism", "none")
        // A Munge socket without a server costs two seconds at every start.
        .env("PMIX_MCA_psec", "native")
        // Looking for the hardware of clusters takes most of a start; bound ranks of all jobs would share the first
        // cores.
        .env("OMPI_MCA_pml", "ob1")
        .env("OMPI_MCA_btl", "self,vader")
        .env("OMPI_MCA_hwloc_base_binding_policy", "none")
        // A rank that waits lets another run, and mpirun waits twice this long [s] at an end other than success.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("OMPI_MCA_odls_base_sigkill_timeout", "1")
        .env_remove("RUST_BACKTRACE")
        .output()
        .expect("`timeout` (coreutils) starts");
    (output, start.elapsed())
}

fn all_checks_pass(ranks: usize) {
    let (output, _) = mpirun(ranks, &[]);
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    let report = format!("{stdout}\n{stderr}");
    assert_eq!(output.status.code(), Some(0), "{report}");
    assert!(stdout.contains(&format!("{ranks} ranks, MPI ")), "{report}");
    // Ten promises, each with whole messages and with messages in pieces.
    let passed = stdout
        .lines()
        .filter(|line| line.starts_with("ok "))
        .count();
    assert_eq!(passed, 20, "{report}");
}

#[test]
fn one_rank() {
    all_checks_pass(1);
}

#[test]
fn two_ranks() {
    all_checks_pass(2);
}

#[test]
fn three_ranks() {
    all_checks_pass(3);
}

#[test]
fn four_ranks() {
    all_checks_pass(4);
}

#[test]
fn a_panic_ends_the_job() {
    for ranks in [1, 3] {
        let (output, elapsed) = mpirun(ranks, &["panic"]);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(101), "{stderr}");
        let line = format!("rank {} of {ranks}: panicked at", ranks - 1);
        assert!(stderr.contains(&line), "{stderr}");
        assert!(stderr.contains("this rank was told to panic"), "{stderr}");
        // Two seconds are mpirun's own; the rest is its start on a busy machine.
        assert!(elapsed < Duration::from_secs(20), "{elapsed:?}");
    }
}
