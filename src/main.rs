//! Entry point: the log and the exit code.

use solver::allocator::Allocator;
use solver::{cli, environment, provenance};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn main() {
    // SAFETY: the program has no other thread yet.
    unsafe { environment::yield_when_idle() };
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    provenance::declare(env!("SOLVER_COMMIT"), env!("SOLVER_PROFILE"));
    std::process::exit(cli::main(std::env::args_os()));
}
