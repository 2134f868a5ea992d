//! The models: lattice Boltzmann, discrete elements, Darcy seepage, structures, and the coupling between them.
//!
//! The models do not use cases, files or runs. They take numbers, fields, grains and a communicator. The library
//! `solver` above them reads a case, makes its plan, runs the models and writes the results.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod allocator;
pub mod ball;
pub mod environment;
pub mod error;
pub mod family;
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are the texts of the schema, with units in brackets: [m]"
)]
pub mod geometry;
pub mod history;
pub mod number;
pub mod provenance;
pub mod random;
pub mod thread_pool;
pub mod units;
pub mod vector;
