//! Owns the state; step and run.

pub mod erosion;
pub mod removal;
pub mod view;
