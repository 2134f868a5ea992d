//! Puts commit and build profile into the binary, for the provenance of every file it writes.

use std::process::Command;

fn main() {
    let describe = Command::new("git")
        .args(["describe", "--always", "--dirty", "--abbrev=12"])
        .output()
        .ok()
        .filter(|out| out.status.success())
        .and_then(|out| String::from_utf8(out.stdout).ok())
        .map_or_else(|| "unknown".to_owned(), |text| text.trim().to_owned());
    println!("cargo::rustc-env=SOLVER_COMMIT={describe}");
    let of_build = |name: &str| std::env::var(name).unwrap_or_else(|_| "unknown".to_owned());
    println!(
        "cargo::rustc-env=SOLVER_PROFILE={}, opt-level {}, for {}",
        of_build("PROFILE"),
        of_build("OPT_LEVEL"),
        of_build("TARGET")
    );
    println!("cargo::rerun-if-changed=.git/HEAD");
    println!("cargo::rerun-if-changed=.git/index");
}
