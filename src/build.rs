//! Stores commit and build profile in the binary, for the provenance of every file that it writes. The library does not
//! depend on them, so that a commit rebuilds only the entry point.

use std::process::Command;

/// Returns the output of git, without line breaks.
fn git(arguments: &[&str]) -> Option<String> {
    let out = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(out.stdout).ok()?;
    out.status.success().then(|| text.trim().to_owned())
}

fn main() {
    let commit = git(&["describe", "--always", "--dirty", "--abbrev=12"]);
    println!(
        "cargo::rustc-env=SOLVER_COMMIT={}",
        commit.unwrap_or_else(|| "unknown".to_owned())
    );
    let of_build = |name: &str| std::env::var(name).unwrap_or_else(|_| "unknown".to_owned());
    println!(
        "cargo::rustc-env=SOLVER_PROFILE={}, opt-level {}, for {}",
        of_build("PROFILE"),
        of_build("OPT_LEVEL"),
        of_build("TARGET")
    );
    println!("cargo::rerun-if-changed=src/build.rs");
    // In a linked work tree they lie elsewhere; a file that is not there would run this script in every build.
    for file in ["HEAD", "index"] {
        if let Some(path) = git(&["rev-parse", "--git-path", file])
            && std::path::Path::new(&path).exists()
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
}
