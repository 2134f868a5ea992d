//! Solid fraction of the neighbourhood of a cell, used by the drag in dilute water.
//!
//! A single grain that fills a large part of a small cell is not a bed. In dilute water the solid fraction is
//! therefore averaged over a box of [`WIDTH`] mean diameters about the centre of the cell, if that is larger than
//! the cell:
//!
//! ```text
//! s' = sum w_j s_j / sum w_j inside_j         w_j: the part of cell j in the box
//! ```
//!
//! In a bed it remains that of the cell. Between `s' = 0.1` and 0.2 it changes from one to the other.

use super::enclosure::Openness;
use super::open_water::rise;
use base::number::{real, whole};

/// Width of the neighbourhood in mean diameters: a single sphere fills 0.24 % of it.
const WIDTH: f64 = 6.0;
/// Maximum number of cells on each side of the middle one.
const FARTHEST: f64 = 3.0;
/// Solid fraction up to which the mean of the neighbourhood is used; above [`DENSE`] the value of the cell itself is
/// used.
const DILUTE: f64 = 0.1;
const DENSE: f64 = 0.2;

/// Returns the solid fraction for the drag on grains of a mean `diameter` \[m\] in a cell; `porosity` is that of
/// all cells.
#[must_use]
pub fn solid_fraction(openness: &Openness, porosity: &[f64], cell: usize, diameter: f64) -> f64 {
    let grid = &openness.grid;
    let own = 1.0 - porosity[cell];
    // Number of cells beyond the middle one on each side, with a fraction for the last.
    let beyond: [f64; 3] = std::array::from_fn(|a| {
        if a < grid.dimension {
            (0.5 * (WIDTH * diameter / grid.spacing[a] - 1.0)).clamp(0.0, FARTHEST)
        } else {
            0.0
        }
    });
    if beyond.iter().all(|b| *b <= 0.0) {
        return own;
    }
    let middle = grid.cell(cell);
    let reach = beyond.map(|b| whole(b.ceil()));
    let range = |a: usize| {
        middle[a].saturating_sub(reach[a])..(middle[a] + reach[a] + 1).min(grid.cells[a])
    };
    let part = |a: usize, at: usize| {
        let distance = real(at.abs_diff(middle[a]));
        (beyond[a] - distance + 1.0).clamp(0.0, 1.0)
    };
    let (mut solid, mut inside) = (0.0, 0.0);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let at = grid.index([x, y, z]);
                let weight = part(0, x) * part(1, y) * part(2, z) * openness.inside[at];
                solid += weight * (1.0 - porosity[at]);
                inside += weight;
            }
        }
    }
    let around = solid / inside;
    around + rise((around - DILUTE) / (DENSE - DILUTE)) * (own - around)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Enclosure, SeepageGrid};
    use std::f64::consts::FRAC_PI_6 as PART;

    #[test]
    fn a_lone_grain_is_no_bed_and_a_bed_is_one() {
        let grid = SeepageGrid {
            cells: [9, 9, 9],
            origin: [0.0; 3],
            spacing: [0.005; 3],
            dimension: 3,
            ..SeepageGrid::default()
        };
        let openness = Openness::measure(&grid, &Enclosure::Everything);
        let middle = grid.index([4, 4, 4]);
        let mut porosity = vec![1.0; grid.count()];
        porosity[middle] = 1.0 - PART;
        // A sphere that touches all faces of its cell fills a fraction of 6 cubed.
        let lone = solid_fraction(&openness, &porosity, middle, 0.005);
        assert!((lone - PART / 216.0).abs() < 1e-12, "{lone}");
        // For small grains in a large cell the solid fraction is that of the cell.
        assert!((solid_fraction(&openness, &porosity, middle, 0.0008) - PART).abs() < 1e-15);
        let bed = vec![0.4; grid.count()];
        assert!((solid_fraction(&openness, &bed, 0, 0.005) - 0.6).abs() < 1e-15);
        // A uniform cloud has its own solid fraction, also at the wall.
        let cloud = vec![0.97; grid.count()];
        for cell in [0, middle] {
            assert!((solid_fraction(&openness, &cloud, cell, 0.005) - 0.03).abs() < 1e-12);
        }
    }
}
