//! Porosity by overlaps: the common volume of sphere and cell ([`crate::darcy::overlap`]).

use super::{Method, measure};
use crate::darcy::grid::Grid;
use crate::darcy::overlap::{disc_rectangle, sphere_box};
use crate::number::real;

/// The method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exact;

impl Method for Exact {
    fn summary() -> &'static str {
        "Exact overlap of grains and cells."
    }

    fn description(&self) -> String {
        "exact overlap".into()
    }

    fn parts(&self, grid: &Grid, centre: [f64; 3], radius: f64, parts: &mut Vec<(usize, f64)>) {
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
