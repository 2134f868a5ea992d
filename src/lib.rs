#![doc = include_str!("ARCHITECTURE.md")]
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
    reason = "readers of these pages read the code too"
)]

pub mod analysis;
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are the texts of the schema, where units stand in brackets: [m]"
)]
pub mod case;
pub mod checkpoint;
pub mod cli;
pub mod critical_gradient;
pub mod environment;
pub mod figures;
pub mod output;
pub mod plan;
pub mod preparation;
pub mod provenance;
pub mod scene;
pub mod simulation;
pub mod sweep;
pub mod uncertainty;

pub use base::{allocator, error, family, geometry, number, random, thread_pool, units};
pub use {::coupling, ::darcy, ::dem, ::lbm, ::structure};
