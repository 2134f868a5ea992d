//! Numbers a user came for: the erosion law, the collapse of ground, and the figures of a study.
//!
//! [`erosion_law`] turns what a run recorded into shear stress, erosion rate and the law that joins them;
//! [`ground_collapse`] turns grains into voids, settlement and the stages of a collapse;
//! [`study`] finds the erosion law over many runs and draws the figures with `figures::plot`; [`measure`] reads a number out of
//! the files of any run, by an [`expression`]. Nothing here knows MPI, lattices or
//! contact laws: the functions take plain numbers in SI units.

pub mod erosion_law;
pub mod expression;
pub mod ground_collapse;
pub mod measure;
pub mod study;
