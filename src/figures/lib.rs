//! Figures: SVG plots, pictures of the results of a run, and figures of analyses and studies.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod erosion_law;
pub mod ground_collapse;
pub mod jet_erosion;
pub mod picture;
pub mod plot;
mod svg;
