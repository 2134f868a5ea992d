//! The resolved problem, the same on every rank.
