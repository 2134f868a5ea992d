//! Owns the state; step and run.

pub mod view;
