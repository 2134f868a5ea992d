//! Numbers a user came for: the erosion law and the figures of a study.
//!
//! [`erosion_law`] turns what a run recorded into shear stress, erosion rate and the law that joins them;
//! [`study`] does so over many runs and draws the figures with [`plot`]. Nothing here knows MPI, lattices or
//! contact laws: the functions take plain numbers in SI units.

pub mod erosion_law;
pub mod plot;
pub mod study;
