//! Files that are equal from any number of ranks, in both modes, and no hang when a write fails: real `mpirun` under
//! `timeout`.

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

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;

use io::{Alone, fields};

/// Returns the example in the folder of this test's own binary: cargo builds examples along with integration tests.
fn program() -> PathBuf {
    let mut path = std::env::current_exe().unwrap();
    path.pop();
    path.pop();
    path.join("examples").join("check")
}

/// Lock that allows one job at a time, so that ranks do not compete with those of another test.
static ONE_JOB: Mutex<()> = Mutex::new(());

fn check(ranks: &str, command: &str, folder: &Path, rest: &[&str]) -> Output {
    let _alone = ONE_JOB.lock().unwrap_or_else(|poison| poison.into_inner());
    Command::new("timeout")
        .args(["-k", "5", "60", "mpirun", "--oversubscribe", "-n"])
        .arg(ranks)
        .arg(program())
        .arg(command)
        .arg(folder)
        .args(rest)
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
        // A rank that waits lets another run, and mpirun waits twice this long [s] at an end other than success: a rank
        // that ends has said why.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("OMPI_MCA_odls_base_sigkill_timeout", "0")
        .output()
        .unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let mut all: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    all.sort();
    all
}

/// Returns everything in an HDF5 file: the description, and the numbers of every dataset as bits.
fn content(path: &Path) -> (fields::FileInfo, Vec<Vec<u64>>) {
    let mut info = fields::inspect(path).unwrap();
    info.datasets.sort_by(|a, b| a.path.cmp(&b.path));
    let numbers = info
        .datasets
        .iter()
        .map(|d| {
            fields::read_f64(path, &d.path, &vec![0; d.shape.len()], &d.shape)
                .unwrap()
                .iter()
                .map(|x| x.to_bits())
                .collect()
        })
        .collect();
    (info, numbers)
}

/// Checks that datasets are equal on 1, 2, 3 and 4 ranks, in both modes, and for cuts along every axis; some ranks have
/// no data.
#[test]
fn any_ranks_and_modes_write_the_same() {
    let reference = tempfile::tempdir().unwrap();
    let first = check("1", "write", reference.path(), &["collective", "x"]);
    assert!(
        first.status.success(),
        "{}",
        String::from_utf8_lossy(&first.stderr)
    );
    let listing = names(reference.path());
    // 4 steps x 4 kinds, 4 indices, 1 checkpoint of 2 files.
    assert_eq!(listing.len(), 22, "{listing:?}");
    for (ranks, mode, axis) in [
        ("2", "collective", "z"),
        ("3", "collective", "y"),
        ("4", "collective", "x"),
        ("4", "collective", "z"),
        ("3", "gather", "z"),
        ("4", "gather", "y"),
    ] {
        let case = format!("{ranks} ranks, {mode}, {axis}");
        let folder = tempfile::tempdir().unwrap();
        let done = check(ranks, "write", folder.path(), &[mode, axis]);
        assert!(
            done.status.success(),
            "{case}: {}",
            String::from_utf8_lossy(&done.stderr)
        );
        assert_eq!(names(folder.path()), listing, "{case}");
        for name in &listing {
            let (a, b) = (reference.path().join(name), folder.path().join(name));
            if name.ends_with(".json") {
                io::checkpoint::verify(&b, &Alone).unwrap();
            } else if name.ends_with(".xmf") {
                assert_eq!(
                    std::fs::read(a).unwrap(),
                    std::fs::read(b).unwrap(),
                    "{case}"
                );
            } else {
                assert!(content(&a) == content(&b), "{case}: {name}");
            }
        }
        // One rank through the serial driver and rank 0 for all: the very same file.
        if mode == "gather" {
            let name = "fluid_000000100.vtkhdf";
            assert_eq!(
                std::fs::read(reference.path().join(name)).unwrap(),
                std::fs::read(folder.path().join(name)).unwrap()
            );
        }
    }
}

/// Checks that if the disk fails, early or in the middle, on one rank or on all, the job ends with code 5 and a message
/// that names the file, the checkpoint before it remains, and no incomplete file has a name without `.part`.
#[test]
fn a_failed_write_ends_and_spoils_nothing() {
    for (ranks, mode, who, agreements) in [
        // Before HDF5 has the file: refused, and nothing is left.
        ("1", "collective", "all", "0"),
        ("3", "collective", "0", "0"),
        ("3", "gather", "0", "0"),
        // While HDF5 writes.
        ("1", "collective", "all", "4"),
        ("2", "gather", "0", "4"),
        ("2", "collective", "all", "4"),
        ("3", "collective", "0", "7"),
        ("3", "collective", "0", "10"),
        ("2", "collective", "all", "10"),
    ] {
        let case = format!("{ranks} ranks, {mode}, {who} after {agreements}");
        let folder = tempfile::tempdir().unwrap();
        let done = check(ranks, "fail", folder.path(), &[mode, who, agreements]);
        let words = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(5), "{case}: {words}");
        assert!(
            words.contains("checkpoint_000000002.h5.part"),
            "{case}: {words}"
        );
        let found = io::newest(folder.path(), &Alone).unwrap();
        assert_eq!(found.manifest.step, 1, "{case}");
        assert!(
            found.passed_over.is_empty(),
            "{case}: {:?}",
            found.passed_over
        );
        let left: Vec<String> = names(folder.path())
            .into_iter()
            .filter(|n| n.contains("000000002"))
            .collect();
        assert!(
            left.iter().all(|n| n.ends_with(".part")),
            "{case}: {left:?}"
        );
        assert_eq!(left.is_empty(), agreements == "0", "{case}: {left:?}");
    }
}
