//! Porosity by overlaps: the common volume of sphere and cell ([`crate::overlap`]).

use super::{PorosityFormula, measure};
use crate::grid::SeepageGrid;
use crate::overlap::{disc_rectangle, sphere_box};
use base::number::real;

/// Porosity method by overlaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exact;

impl PorosityFormula for Exact {
    fn summary() -> &'static str {
        "Exact overlap of grains and cells."
    }

    fn description(&self) -> String {
        "exact overlap".into()
    }

    fn parts(
        &self,
        grid: &SeepageGrid,
        centre: [f64; 3],
        radius: f64,
        parts: &mut Vec<(usize, f64)>,
    ) {
        let (mut from, mut to) = ([0; 3], [0; 3]);
        for axis in 0..grid.dimension {
            let last = grid.cells[axis] - 1;
            let upper = grid.origin[axis] + real(last + 1) * grid.spacing[axis];
            if !(centre[axis] + radius > grid.origin[axis] && centre[axis] - radius < upper) {
                return;
            }
            from[axis] = grid.along(axis, centre[axis] - radius).unwrap_or(0);
            to[axis] = grid.along(axis, centre[axis] + radius).unwrap_or(last);
        }
        // Most grains lie in one cell, or are cut normal to one axis only.
        let cuts = |axis: usize| {
            let (low, high) = (centre[axis] - radius, centre[axis] + radius);
            let end = grid.origin[axis] + real(to[axis] + 1) * grid.spacing[axis];
            from[axis] < to[axis]
                || low < grid.origin[axis] + real(from[axis]) * grid.spacing[axis]
                || high > end
        };
        let mut cut = (0..grid.dimension).filter(|axis| cuts(*axis));
        match (cut.next(), cut.next()) {
            (None, _) => {
                parts.push((grid.index(from), 1.0));
                return;
            }
            (Some(axis), None) if grid.dimension == 3 => {
                let mut cell = from;
                let below = |k: usize| {
                    let plane = grid.origin[axis] + real(k) * grid.spacing[axis];
                    cap(((plane - centre[axis]) / radius).clamp(-1.0, 1.0))
                };
                let mut before = below(from[axis]);
                for k in from[axis]..=to[axis] {
                    let next = below(k + 1);
                    cell[axis] = k;
                    if next > before {
                        parts.push((grid.index(cell), next - before));
                    }
                    before = next;
                }
                return;
            }
            _ => {}
        }
        let whole = measure(grid.dimension, radius);
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    let lower = grid.corner([x, y, z]);
                    let upper = std::array::from_fn(|a| lower[a] + grid.spacing[a]);
                    let common = if grid.dimension == 2 {
                        disc_rectangle(centre, radius, lower, upper)
                    } else {
                        sphere_box(centre, radius, lower, upper)
                    };
                    if common > 0.0 {
                        parts.push((grid.index([x, y, z]), common / whole));
                    }
                }
            }
        }
    }
}

/// Returns the fraction of a ball below a plane at this distance above its centre, in radii.
fn cap(distance: f64) -> f64 {
    let height = 1.0 + distance;
    0.25 * height * height * (3.0 - height)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that balls in one cell, across one face, and across an end of the grid have the fractions of the
    /// general formula.
    #[test]
    fn balls_that_few_planes_cut_have_their_parts() {
        let grid = SeepageGrid {
            cells: [4, 3, 5],
            origin: [-1.0, 0.0, 2.0],
            spacing: [0.5, 0.75, 1.0],
            dimension: 3,
            ..SeepageGrid::default()
        };
        let radius = 0.2;
        for centre in [
            [-0.75, 0.3, 2.5],
            [-0.45, 0.3, 2.5],
            [-0.75, 0.7, 3.5],
            [-0.75, 0.3, 3.05],
            [-1.1, 0.3, 2.5],
            [0.75, 2.2, 6.5],
            [-0.45, 0.7, 3.1],
        ] {
            let mut parts = Vec::new();
            Exact.parts(&grid, centre, radius, &mut parts);
            let mut sum = 0.0;
            for index in 0..grid.count() {
                let lower = grid.corner(grid.cell(index));
                let upper = std::array::from_fn(|a| lower[a] + grid.spacing[a]);
                let exact = sphere_box(centre, radius, lower, upper) / measure(3, radius);
                let found = parts.iter().find(|(cell, _)| *cell == index);
                let found = found.map_or(0.0, |(_, part)| *part);
                assert!(
                    (found - exact).abs() < 1e-13,
                    "{centre:?} {index}: {found} {exact}"
                );
                sum += found;
            }
            assert!(sum <= 1.0 + 1e-14);
        }
    }
}
