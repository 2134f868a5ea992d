//! The integration tests, in one binary.

mod case_broken;
mod case_commands;
mod case_examples;
mod case_mutants;
