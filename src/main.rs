//! Entry point: what the commands need from the rest of the program, and the exit code.

use solver::cli::{self, Engine};
use solver::{analysis, output, provenance, simulation, sweep};

fn main() {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    provenance::declare(env!("SOLVER_COMMIT"), env!("SOLVER_PROFILE"));
    let engine = Engine {
        run: simulation::run::run,
        restart: simulation::run::restart,
        info: output::info::info,
        picture: output::picture::picture,
        erosion_law: analysis::study::command,
        sweep: sweep::command,
        version: simulation::versions::report,
        critical_gradient: simulation::critical::command,
    };
    std::process::exit(cli::main(std::env::args_os(), &engine));
}
