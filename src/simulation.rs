//! Owns the state; step and run.

pub mod setup;
pub mod view;
