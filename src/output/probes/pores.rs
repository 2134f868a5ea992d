//! State of a seepage at points: velocity, pressure and hydraulic head in the cell that holds each.

use super::points::{along, line_headings};
use super::quantity::Quantity;
use super::{Heading, Rows, VELOCITY, sampled_if_solved};
use crate::view::StateView;
use base::error::Error;
use base::vector::distance;
use coupling::seepage::Seepage;
use dem::space::Space;
use plan::scene::Scene;

/// Point in a seepage \[m\].
#[derive(Debug)]
pub(super) struct PorePoint(pub(super) [f64; 3]);

impl Quantity for PorePoint {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        [VELOCITY.as_slice(), &[("pressure", "Pa"), ("head", "m")]].concat()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let values = values_at(seepage, self.0);
            rows.iter_mut().for_each(|row| row.extend(values));
        })
    }
}

/// Points at equal distances along a line in a seepage \[m\].
#[derive(Debug)]
pub(super) struct PoreLine(Vec<[f64; 3]>);

impl PoreLine {
    /// Returns a number of points between two ends \[m\], which are included.
    pub(super) fn new(from: [f64; 3], to: [f64; 3], points: usize) -> Self {
        Self(along(from, to, points))
    }
}

impl Quantity for PoreLine {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        let mut headings = line_headings();
        headings.extend([("pressure", "Pa"), ("head", "m")]);
        headings
    }

    fn rows(&self) -> usize {
        self.0.len()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            let first = self.0.first().copied().unwrap_or_default();
            for (row, point) in rows.iter_mut().zip(&self.0) {
                row.push(distance(first, *point));
                row.extend(point);
                row.extend(values_at(seepage, *point));
            }
        })
    }
}

/// Returns the velocity of the cell that contains a point, and pressure and head at the point from the gradient in
/// this cell; NaN outside the grid and in cells without water. Adjacent cells are not used: a sheet pile may lie
/// between.
fn values_at<S: Space>(seepage: &Seepage<S>, point: [f64; 3]) -> [f64; 5] {
    let grid = seepage.grid();
    let pressure = seepage.pressure();
    let cell = grid.holding(point).map(|cell| grid.index(cell));
    match cell.filter(|&cell| seepage.pores().porosity()[cell] > 0.0) {
        Some(cell) => {
            let [u, v, w] = seepage.water_velocity(cell);
            let (centre, gradient) = (grid.centre(grid.cell(cell)), pressure.inner_gradient(cell));
            let weight = pressure.weight();
            let (mut reduced, mut hydrostatic) = (pressure.reduced(cell), 0.0);
            for a in 0..grid.dimension {
                reduced += gradient[a] * (point[a] - centre[a]);
                hydrostatic += weight[a] * point[a];
            }
            [u, v, w, reduced + hydrostatic, pressure.head(reduced)]
        }
        None => [f64::NAN; 5],
    }
}
