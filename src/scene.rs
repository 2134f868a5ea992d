//! The resolved problem, the same on every rank.

pub mod packing;
