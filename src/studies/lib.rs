//! Studies: many runs of one case and their joint evaluation.

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

pub mod critical_gradient;
pub mod section;
pub mod sweep;
pub mod threshold;
pub mod uncertainty;
