//! Short forms of the cases under `jobs/verification`: runs of the binary compared with published and analytical
//! numbers.
//!
//! `jobs/verification/run.sh` runs the long forms with the same comparison.

#[path = "../../jobs/verification/suite.rs"]
pub(crate) mod suite;

use crate::ranks::Cores;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/verification")
}

/// Runs the short form of every `of`-th case in a folder, beginning with number `part`; all must pass. Neighbours
/// by name take about the same time, so that the parts have similar durations. Returns the numbers of compared
/// cases and quantities.
pub(crate) fn short_forms(root: &Path, part: usize, of: usize) -> (usize, usize) {
    let work = tempfile::tempdir().unwrap();
    let solver = Path::new(env!("CARGO_BIN_EXE_solver"));
    let folders = suite::cases(root).unwrap();
    let folders: Vec<_> = folders.iter().skip(part).step_by(of).collect();
    let mut report = Vec::new();
    let (mut quantities, mut bad) = (0, 0);
    for folder in &folders {
        let _core = Cores::acquire(1);
        match suite::check(folder, "short", &[], solver, work.path()) {
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

fn quarter(part: usize) {
    let (_, quantities) = short_forms(&root(), part, 4);
    assert!(quantities > 10, "only {quantities} quantities");
}

#[test]
fn short_forms_agree_with_their_references_first_quarter() {
    quarter(0);
}

#[test]
fn short_forms_agree_with_their_references_second_quarter() {
    quarter(1);
}

#[test]
fn short_forms_agree_with_their_references_third_quarter() {
    quarter(2);
}

#[test]
fn short_forms_agree_with_their_references_fourth_quarter() {
    quarter(3);
}
