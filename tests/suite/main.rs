//! The integration tests, in one binary.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod case_broken;
mod case_commands;
mod case_examples;
mod case_mutants;
mod seepage;
