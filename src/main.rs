//! Entry point: the environment, the log and the exit code.

use solver::{cli, provenance};

/// HDF5 locks the files that it opens, and some releases fail where a file system of a cluster has no locks. Files of this program
/// get their name when they are complete, and nobody reads one that is being written.
const LOCKS: &str = "HDF5_USE_FILE_LOCKING";

fn main() {
    if std::env::var_os(LOCKS).is_none() {
        // SAFETY: no other thread runs yet.
        unsafe { std::env::set_var(LOCKS, "FALSE") };
    }
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    provenance::declare(env!("SOLVER_COMMIT"), env!("SOLVER_PROFILE"));
    std::process::exit(cli::main(std::env::args_os()));
}
