#![doc = include_str!("ARCHITECTURE.md")]
#![cfg_attr(
    test,
    allow(clippy::float_cmp, reason = "tests compare bits on purpose")
)]

pub mod analysis;
#[allow(
    rustdoc::broken_intra_doc_links,
    reason = "comments are the texts of the schema, where units stand in brackets: [m]"
)]
pub mod case;
pub mod checkpoint;
pub mod cli;
pub mod coupling;
pub mod crew;
pub mod darcy;
pub mod dem;
pub mod error;
pub mod lbm;
pub mod output;
pub mod plan;
pub mod random;
pub mod scene;
pub mod simulation;
pub mod sweep;
pub mod units;
