//! Entry point: what the commands need from the rest of the program, and the exit code.

use solver::cli::{self, Engine, RunOptions};
use solver::error::Error;
use solver::plan::Plan;
use std::path::{Path, PathBuf};

fn main() {
    let engine = Engine {
        run,
        restart,
        info,
        erosion_law,
    };
    std::process::exit(cli::main(std::env::args_os(), &engine));
}

fn run(_plan: Plan, _options: RunOptions) -> Result<(), Error> {
    Err(absent("run"))
}

fn restart(_directory: &Path, _set: &[String], _options: RunOptions) -> Result<(), Error> {
    Err(absent("restart"))
}

fn info(_file: &Path, _json: bool) -> Result<String, Error> {
    Err(absent("info"))
}

fn erosion_law(_runs: &[PathBuf], _output: &Path, _json: bool) -> Result<String, Error> {
    Err(absent("erosion-law"))
}

fn absent(command: &str) -> Error {
    Error::Internal(format!("`{command}` is not part of this build"))
}
