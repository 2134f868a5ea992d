//! The short forms of the cases under `jobs/verification`: published and analytic numbers beside runs of the binary.
//!
//! `jobs/verification/run.sh` runs the long forms through the same comparison.

#[path = "../../examples/verify/suite.rs"]
pub(crate) mod suite;

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/verification")
}

/// Runs the short form of every case in a folder; all must pass. Cases and quantities that were compared.
pub(crate) fn short_forms(root: &Path) -> (usize, usize) {
    let work = tempfile::tempdir().unwrap();
    let solver = Path::new(env!("CARGO_BIN_EXE_solver"));
    let mut report = Vec::new();
    let (mut cases, mut quantities, mut bad) = (0, 0, 0);
    for folder in suite::cases(root).unwrap() {
        cases += 1;
        match suite::check(&folder, "short", solver, work.path()) {
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
    (cases, quantities)
}

#[test]
fn short_forms_agree_with_their_references() {
    let (_, quantities) = short_forms(&root());
    assert!(quantities > 40, "only {quantities} quantities");
}
