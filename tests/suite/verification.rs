//! The short forms of the cases under `jobs/verification`: published and analytic numbers beside runs of the binary.
//!
//! `jobs/verification/run.sh` runs the long forms through the same comparison.

#[path = "../../examples/verify/expression.rs"]
mod expression;
#[path = "../../examples/verify/suite.rs"]
pub(crate) mod suite;

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/verification")
}

#[test]
fn short_forms_agree_with_their_references() {
    let work = tempfile::tempdir().unwrap();
    let solver = Path::new(env!("CARGO_BIN_EXE_solver"));
    let mut report = Vec::new();
    let (mut quantities, mut bad) = (0, 0);
    for folder in suite::cases(&root()).unwrap() {
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
    assert!(quantities > 40, "only {quantities} quantities");
    assert_eq!(bad, 0, "\n{}", report.join("\n"));
}

#[test]
fn formulas_are_read_as_written() {
    let value = |text: &str| {
        expression::evaluate(text, &|name| (name == "x_1").then_some(3.0)).map_err(|_| ())
    };
    for (text, expected) in [
        ("1 + 2*3 - 4/2", 5.0),
        ("-2^2", -4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("(1e-3 + 2.5E+1)*0 + x_1", 3.0),
        ("sqrt(x_1*12) - abs(-6)", 0.0),
        ("atan2(1, 1)*4 - pi", 0.0),
        ("(x_1 > 2) + (x_1 < 2)", 1.0),
    ] {
        approx::assert_abs_diff_eq!(value(text).unwrap(), expected, epsilon = 1e-12);
    }
    for bad in [
        "",
        "1 +",
        "(1",
        "y",
        "1 2",
        "sin(1, 2)",
        "min(1)",
        "1e",
        "3..2",
    ] {
        assert!(value(bad).is_err(), "{bad}");
    }
}
