//! Gauges: surface elevation and depth of the water in a column of cells.
//!
//! The elevation is that of the surface in the highest cell that is at least half full, from the heights of water
//! in this cell and its two neighbours: exact for a level surface at any height within a cell, also above a solid. The
//! depth is the sum of the fill levels of the column: drops are included, air and solids are not.

use super::quantity::Quantity;
use super::{Heading, Rows, fluid, no_fluid};
use crate::view::StateView;
use base::error::Error;
use base::number::real;
use coupling::FluidView;
use decomposition::Communicator;
use dem::space::Space;
use lbm::boundary::from_quanta;
use lbm::quanta::quanta;
use plan::scene::Scene;

/// Mark of a solid cell among the fill levels, above the quanta of a full cell.
const SOLID: u128 = 1 << 100;

/// A column of cells along the axis of gravity.
#[derive(Debug)]
pub(super) struct Gauge {
    axis: usize,
    rises: bool,
    /// Cell at the bottom of the column, with index 0 along the axis.
    bottom_cell: [usize; 3],
    height: f64,
    /// Fill levels of the column from bottom to top, in quanta; the buffer is reused.
    levels: Vec<u128>,
}

impl Gauge {
    /// Returns the column that contains a cell of the domain.
    pub(super) fn new(scene: &Scene, cell: [usize; 3]) -> Result<Self, Error> {
        let surface = scene.surface.as_ref().ok_or_else(no_fluid)?;
        let mut bottom_cell = cell;
        bottom_cell[surface.axis] = 0;
        Ok(Self {
            axis: surface.axis,
            rises: surface.rises,
            bottom_cell,
            height: scene.grid.spacing,
            levels: vec![0; scene.grid.cells[surface.axis]],
        })
    }

    /// Returns elevation and depth \[m\]; the elevation is NaN without water. Collective.
    fn column(&mut self, fluid: &dyn FluidView, communicator: &Communicator) -> [f64; 2] {
        let (start, cells) = (fluid.start(), fluid.cells());
        let count = self.levels.len();
        for (n, level) in self.levels.iter_mut().enumerate() {
            let mut cell = self.bottom_cell;
            cell[self.axis] = if self.rises { n } else { count - 1 - n };
            let local: [usize; 3] = std::array::from_fn(|a| cell[a].wrapping_sub(start[a]));
            let mine = (0..3).all(|a| local[a] < cells[a]);
            *level = if mine && fluid.solid_at(local) {
                SOLID
            } else if mine {
                i128::from(quanta(fluid.fill(local))).cast_unsigned()
            } else {
                0
            };
        }
        communicator.all_reduce_sum_u128s(&mut self.levels);
        let levels: Vec<Option<f64>> = (self.levels.iter())
            .map(|level| (*level != SOLID).then(|| from_quanta(level.cast_signed())))
            .collect();
        let [elevation, depth] = measure(&levels).map(|cells| cells * self.height);
        let elevation = if self.rises {
            elevation
        } else {
            real(count) * self.height - elevation
        };
        [elevation, depth]
    }
}

impl Quantity for Gauge {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        vec![("elevation", "m"), ("depth", "m")]
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        let values = self.column(fluid(view)?, view.domain.communicator());
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Returns elevation and depth, in cells, of a column of fill levels from bottom to top; none for solid cells.
fn measure(levels: &[Option<f64>]) -> [f64; 2] {
    let depth = levels.iter().flatten().sum();
    let half = |level: &Option<f64>| level.is_some_and(|level| level >= 0.5);
    let Some(top) = levels.iter().rposition(half) else {
        return [f64::NAN, depth];
    };
    // The water stands on a solid cell below it and does not reach through one above it.
    let below = top.checked_sub(1).map(|n| levels[n].unwrap_or(1.0));
    let above = levels.get(top + 1).copied().flatten().unwrap_or(0.0);
    let height = below.unwrap_or(0.0) + levels[top].unwrap_or(0.0) + above;
    [real(top.saturating_sub(1)) + height, depth]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that a level surface is found at any height, also under the lid and in the lowest cell.
    #[test]
    fn a_level_surface_is_exact() {
        for n in 5..=60 {
            let height = f64::from(n) / 10.0;
            let levels: Vec<Option<f64>> = (0..6)
                .map(|cell| Some((height - f64::from(cell)).clamp(0.0, 1.0)))
                .collect();
            let [elevation, depth] = measure(&levels);
            approx::assert_relative_eq!(elevation, height, epsilon = 1e-12);
            approx::assert_relative_eq!(depth, height, epsilon = 1e-12);
        }
        assert!(measure(&[Some(0.3), Some(0.0)])[0].is_nan());
    }

    /// Checks a film on a solid, and water below one.
    #[test]
    fn water_stands_on_a_solid_and_below_one() {
        for n in 5..=15 {
            let film = f64::from(n) / 10.0;
            let part = |cell: f64| Some((film - cell).clamp(0.0, 1.0));
            let [elevation, depth] = measure(&[None, None, part(0.0), part(1.0), Some(0.0)]);
            approx::assert_relative_eq!(elevation, 2.0 + film, epsilon = 1e-12);
            approx::assert_relative_eq!(depth, film, epsilon = 1e-12);
        }
        let [elevation, depth] = measure(&[Some(1.0), Some(1.0), None, None]);
        approx::assert_relative_eq!(elevation, 2.0);
        approx::assert_relative_eq!(depth, 2.0);
    }

    /// Checks that a drop above the surface is the highest water, and that air below it is not counted.
    #[test]
    fn a_drop_counts_with_its_own_height() {
        let levels = [1.0, 0.5, 0.0, 0.0, 0.25, 0.75, 0.0].map(Some);
        let [elevation, depth] = measure(&levels);
        approx::assert_relative_eq!(elevation, 5.0);
        approx::assert_relative_eq!(depth, 2.5);
    }
}
