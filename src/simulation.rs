//! Owns the state; step and run.
