//! `verify short|long SOLVER WORK RESULTS [--set PATH=VALUE]… [NAME…]`: runs the cases under `jobs/verification` and
//! writes a table of results. Every `--set` holds in all runs of the cases.
//!
//! `RESULTS` receives one row per quantity; the status is 1 if a quantity deviates from its reference.
//! `jobs/verification/run.sh` calls this program; the tests run the short forms with the same [`suite`].

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the table is what the program is for"
)]

mod suite;

use solver::sweep::table::machine;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use suite::Outcome;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [form, solver, work, results, names @ ..] = &arguments[..] else {
        eprintln!("verify short|long SOLVER WORK RESULTS [--set PATH=VALUE]... [NAME...]");
        return ExitCode::from(2);
    };
    let paths = [solver, work, results].map(Path::new);
    let (mut set, mut cases) = (Vec::new(), Vec::new());
    let mut rest = names.iter();
    while let Some(argument) = rest.next() {
        match (argument.as_str(), rest.len()) {
            ("--set", 1..) => set.extend(rest.next().cloned()),
            _ => cases.push(argument.clone()),
        }
    }
    match verify(form, paths, &set, &cases) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn verify(
    form: &str,
    [solver, work, results]: [&Path; 3],
    set: &[String],
    names: &[String],
) -> Result<bool, String> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("jobs/verification");
    let mut text = String::from(
        "case,quantity,reference,result,error,tolerance,pass,seconds,commit,machine\n",
    );
    let (commit, machine) = (commit(), machine().replace(',', " "));
    let mut good = true;
    let mut done = 0;
    for folder in suite::cases(&root)? {
        let name = folder.file_name().map(|n| n.to_string_lossy().into_owned());
        if !names.is_empty() && !name.is_some_and(|name| names.contains(&name)) {
            continue;
        }
        match suite::check(&folder, form, set, solver, work) {
            Ok(outcomes) => {
                for outcome in outcomes {
                    println!("{outcome}");
                    good &= outcome.pass;
                    done += 1;
                    row(&mut text, &outcome, &commit, &machine);
                }
            }
            Err(error) => {
                eprintln!("FAIL {error}");
                good = false;
            }
        }
        // The table is written after every case, so that a stopped long run leaves its results.
        std::fs::write(results, &text).map_err(|e| format!("{}: {e}", results.display()))?;
    }
    println!(
        "{done} quantities, {}",
        if good {
            "all within tolerance"
        } else {
            "some outside"
        }
    );
    Ok(good && done > 0)
}

fn row(text: &mut String, o: &Outcome, commit: &str, machine: &str) {
    let quantity = o.quantity.replace(',', ";");
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{},{quantity},{:e},{:e},{:e},{:e},{},{:.1},{commit},{machine}",
        o.case, o.reference, o.result, o.error, o.tolerance, o.pass, o.seconds
    );
}

/// Returns the commit of the sources, with a mark if the sources differ from it.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .ok()?;
        let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        output.status.success().then_some(text)
    };
    let Some(commit) = git(&["rev-parse", "--short", "HEAD"]) else {
        return "unknown".into();
    };
    let changed = git(&["status", "--porcelain", "--", "src", "decomposition", "io"]);
    match changed {
        Some(changed) if changed.is_empty() => commit,
        _ => commit + "+",
    }
}
