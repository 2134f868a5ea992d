//! Water table of unsaturated ground: elevation of zero pressure in each column of cells along gravity.
//!
//! This is separate from the other values of the seepage because a sample has one row per column.

use super::quantity::Quantity;
use super::{Heading, POSITION, Rows, no_fluid, sampled_if_solved};
use crate::view::StateView;
use base::error::Error;
use coupling::seepage::Seepage;
use dem::space::Space;
use plan::scene::Scene;

/// Columns of cells along gravity.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WaterTable {
    axis: usize,
    /// `true` if the coordinate along the axis increases upwards.
    rises: bool,
    cells: [usize; 3],
}

impl WaterTable {
    /// Returns the columns of a seepage for gravity along an axis.
    pub(super) fn new(scene: &Scene) -> Result<Self, Error> {
        let (seepage, gravity) = (scene.seepage.as_ref().ok_or_else(no_fluid)?, scene.gravity);
        let steeper = |a: usize, b: usize| {
            if gravity[b].abs() > gravity[a].abs() {
                b
            } else {
                a
            }
        };
        let axis = (1..3).fold(0, steeper);
        Ok(Self {
            axis,
            rises: gravity[axis] < 0.0,
            cells: seepage.cells,
        })
    }

    /// Returns the point of zero pressure above the lowest saturated cell of a column \[m\]. Its coordinate along
    /// gravity is NaN if the column has no water table, and that of the top if the column is saturated throughout.
    fn zero_pressure<S: Space>(&self, seepage: &Seepage<S>, column: usize) -> [f64; 3] {
        let grid = seepage.grid();
        let pressure = seepage.pressure();
        let weight = pressure.weight()[self.axis].abs();
        let count = self.cells[self.axis];
        let [a, b] = match self.axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        };
        let (mut cell, widths) = ([0; 3], grid.axis(self.axis));
        let is_graded = widths.faces.is_some();
        (cell[a], cell[b]) = (column % self.cells[a], column / self.cells[a]);
        // Upwards from the lowest open cell.
        let mut last: Option<(f64, f64, f64)> = None;
        let mut found = f64::NAN;
        let up = if self.rises { 1.0 } else { -1.0 };
        let mut point = grid.centre(cell);
        for n in 0..count {
            cell[self.axis] = if self.rises { n } else { count - 1 - n };
            let index = grid.index(cell);
            let open = seepage.pores().porosity()[index] > 0.0;
            let coordinate = grid.centre(cell)[self.axis];
            let half = 0.5 * widths.width(cell[self.axis]);
            let head = pressure.pressure(index) / weight;
            match last {
                // Water stands in the lower half of the lowest cell at most.
                None if open && head < 0.0 => {
                    if head > -half {
                        found = coordinate + up * head;
                    }
                    break;
                }
                None if open => last = Some((coordinate, head, half)),
                None => {}
                Some((below, wet, _)) if open && head < 0.0 => {
                    let rise = if is_graded {
                        (coordinate - below).abs()
                    } else {
                        widths.spacing
                    };
                    found = below + up * rise * wet / (wet - head);
                    break;
                }
                Some(_) if open => last = Some((coordinate, head, half)),
                Some(_) => break,
            }
        }
        if found.is_nan()
            && let Some((top, head, half)) = last
        {
            found = top + up * head.min(half);
        }
        point[self.axis] = found;
        point
    }
}

impl Quantity for WaterTable {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        POSITION.to_vec()
    }

    fn rows(&self) -> usize {
        self.cells.iter().product::<usize>() / self.cells[self.axis]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            for (column, row) in rows.iter_mut().enumerate() {
                row.extend(self.zero_pressure(seepage, column));
            }
        })
    }
}
