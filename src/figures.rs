//! Figures: SVG plots, pictures of the results of a run, and the figures of analyses and studies.

pub mod erosion_law;
pub mod ground_collapse;
pub mod picture;
pub mod plot;
