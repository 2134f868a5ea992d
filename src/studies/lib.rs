//! Studies: many runs of one case and their joint evaluation.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod critical_gradient;
pub mod section;
pub mod sweep;
pub mod threshold;
pub mod uncertainty;
