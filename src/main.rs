//! Entry point: what the commands need from the rest of the program, and the exit code.

use solver::cli::{self, Engine};
use solver::{analysis, figures, output, simulation, sweep};

fn main() {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    let engine = Engine {
        run: simulation::run::run,
        restart: simulation::run::restart,
        info: output::info::info,
        picture: figures::picture::picture,
        erosion_law: analysis::study::command,
        sweep: sweep::command,
        version: simulation::versions::report,
        critical_gradient: simulation::critical::command,
    };
    std::process::exit(cli::main(std::env::args_os(), &engine));
}
