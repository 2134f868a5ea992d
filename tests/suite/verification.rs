//! The short forms of the cases under `jobs/verification`: published and analytic numbers beside runs of the binary.
//!
//! `jobs/verification/run.sh` runs the long forms through the same comparison.

#[path = "../../jobs/verification/suite.rs"]
pub(crate) mod suite;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/verification")
}

/// Runs the short form of every case in a folder; all must pass. Cases and quantities that were compared.
pub(crate) fn short_forms(root: &Path) -> (usize, usize) {
    let work = tempfile::tempdir().unwrap();
    let solver = Path::new(env!("CARGO_BIN_EXE_solver"));
    let folders = suite::cases(root).unwrap();
    let next = AtomicUsize::new(0);
    let checked = Mutex::new(BTreeMap::new());
    // One rank each, so as many at once as two cores bear.
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let n = next.fetch_add(1, Ordering::Relaxed)
                    && let Some(folder) = folders.get(n)
                {
                    let outcomes = suite::check(folder, "short", solver, work.path());
                    checked.lock().unwrap().insert(n, outcomes);
                }
            });
        }
    });
    let mut report = Vec::new();
    let (mut quantities, mut bad) = (0, 0);
    for outcomes in checked.into_inner().unwrap().into_values() {
        match outcomes {
            Ok(outcomes) => {
                for outcome in outcomes {
                    quantities += 1;
                    bad += usize::from(!outcome.pass);
                    report.push(outcome.to_string());
                }
            }
            Err(error) => {
                bad += 1;
                report.push(format!("FAIL {error}"));
            }
        }
    }
    println!("{}", report.join("\n"));
    assert_eq!(bad, 0, "\n{}", report.join("\n"));
    (folders.len(), quantities)
}

#[test]
fn short_forms_agree_with_their_references() {
    let (_, quantities) = short_forms(&root());
    assert!(quantities > 40, "only {quantities} quantities");
}
