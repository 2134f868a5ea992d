#![doc = include_str!("ARCHITECTURE.md")]
#![cfg_attr(
    test,
    allow(clippy::float_cmp, reason = "tests compare bits on purpose")
)]
#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "units stand in brackets, in the schema too"
)]

pub mod analysis;
pub mod case;
pub mod checkpoint;
pub mod cli;
pub mod coupling;
pub mod darcy;
pub mod dem;
pub mod error;
pub mod figures;
pub mod lbm;
pub mod output;
pub mod plan;
pub mod preparation;
pub mod provenance;
pub mod random;
pub mod scene;
pub mod simulation;
pub mod sweep;
pub mod thread_pool;
pub mod units;
