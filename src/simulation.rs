//! Owns the state; step and run.

pub mod removal;
pub mod view;
