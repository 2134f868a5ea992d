//! Analyses of results: the erosion law, the collapse of ground, and quantities computed from the files of a run.
//!
//! | module | computes |
//! |---|---|
//! | [`erosion_law`] | shear stress, erosion rate and the erosion law from the records of a run |
//! | [`ground_collapse`] | voids, settlement and the stages of a collapse from the grains |
//! | [`element_test`] | stresses, strains and their ratios of a sample between walls |
//! | [`study`] | the erosion law across runs |
//! | [`measure`] | a number from the files of any run, by an [`expression`] |
//! | [`statistics`] | means with their intervals, medians and quantiles of Student's distribution |
//!
//! The functions take plain numbers in SI units and do not depend on MPI, lattices or contact laws.

#![cfg_attr(
    test,
    allow(
        clippy::float_cmp,
        clippy::unwrap_used,
        clippy::panic,
        clippy::print_stdout,
        clippy::print_stderr,
        reason = "tests compare bits on purpose, fail by panicking and print what they measure"
    )
)]
#![allow(
    rustdoc::private_intra_doc_links,
    reason = "the documentation is read together with the code"
)]

pub mod element_test;
pub mod erosion_law;
pub mod expression;
pub mod ground_collapse;
pub mod measure;
pub mod statistics;
pub mod study;
