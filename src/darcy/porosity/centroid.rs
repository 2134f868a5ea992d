//! Porosity by centres: the whole grain counts in the cell that contains its centre.

use super::PorosityFormula;
use crate::grid::SeepageGrid;

/// Porosity method by centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Centroid;

impl PorosityFormula for Centroid {
    fn summary() -> &'static str {
        "A grain counts in the cell that holds its centre."
    }

    fn description(&self) -> String {
        "centroid".into()
    }

    fn parts(&self, grid: &SeepageGrid, centre: [f64; 3], _: f64, parts: &mut Vec<(usize, f64)>) {
        if let Some(cell) = grid.holding(centre) {
            parts.push((grid.index(cell), 1.0));
        }
    }
}
