//! Figures: SVG plots, pictures of the results of a run, and figures of analyses and studies.

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

pub mod erosion_law;
pub mod ground_collapse;
pub mod jet_erosion;
pub mod picture;
pub mod plot;
