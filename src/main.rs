//! Entry point: the log and the exit code.

use solver::cli;

fn main() {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("warn")).init();
    std::process::exit(cli::main(std::env::args_os()));
}
