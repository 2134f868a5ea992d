//! A check of every cell of a slab: the fastest cell, the most compressed cell, and the first cell whose values are not
//! finite.
//!
//! The threads of the rank reduce each row to its extreme values, several cells at a time. Only rows that may contain
//! the result are then processed cell by cell, the most extreme first, because the extreme value of a row may be in a
//! cell inside a body, which does not count. Values and cells do not depend on ranks and threads: rows are the same on
//! any number of ranks, a cell has the same bits alone and in its row, and of equal values the first cell in the order
//! of the lattice counts.

use coupling::lattice::LatticeFlow;
use dem::space::Space;
use lbm::extremes::{Extremes, Rows, squared_speed};
use lbm::lanes::Stored;

/// A value and the index of its cell in the order of the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extreme {
    pub(super) value: f64,
    pub(super) cell: u64,
}

impl Extreme {
    const NO_CELL: Self = Self {
        value: 0.0,
        cell: u64::MAX,
    };

    /// Replaces the value if the other has a larger magnitude, or an equal one in an earlier cell.
    fn raise(&mut self, value: f64, cell: u64) {
        let (size, known) = (value.abs(), self.value.abs());
        if size > known || (size >= known && size > 0.0 && cell < self.cell) {
            *self = Self { value, cell };
        }
    }
}

/// Results of a check on this rank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CheckResult {
    /// Largest squared speed of the water, over C².
    pub(super) fastest: Extreme,
    /// Density deviation of the largest magnitude in the water, except in cells enclosed by bodies, which moving
    /// bodies squeeze.
    pub(super) squeezed: Extreme,
    /// First cell whose values are not finite.
    pub(super) broken: Option<u64>,
}

/// Cells of the whole domain in the order of the lattice: slowest axis, middle, fastest.
#[derive(Clone, Copy, Debug)]
pub(super) struct LatticeOrder {
    axes: [usize; 3],
    cells: [usize; 3],
}

impl LatticeOrder {
    pub(super) fn from_flow<Sp: Space, S: Stored>(flow: &dyn LatticeFlow<Sp, S>) -> Self {
        Self {
            axes: flow.fluid().populations().order(),
            cells: flow.fluid().domain_cells(),
        }
    }

    fn index(&self, at: [usize; 3]) -> u64 {
        let [slow, middle, fast] = self.axes;
        ((at[slow] * self.cells[middle] + at[middle]) * self.cells[fast] + at[fast]) as u64
    }

    /// Returns the domain coordinates of the cell with an index in this order.
    pub(super) fn cell(&self, place: u64) -> [usize; 3] {
        let [slow, middle, fast] = self.axes;
        let place = usize::try_from(place).unwrap_or(0);
        let mut at = [0; 3];
        at[fast] = place % self.cells[fast];
        at[middle] = place / self.cells[fast] % self.cells[middle];
        at[slow] = place / self.cells[fast] / self.cells[middle];
        at
    }
}

/// Buffers that checks reuse.
#[derive(Clone, Debug, Default)]
pub(super) struct StateCheck {
    /// Moments of a row.
    row: [Vec<f64>; 4],
    /// Fraction of each cell of a row that bodies cover.
    covered: Vec<f32>,
    /// Extreme values of each row.
    rows: Rows,
    /// Rows sorted by their extreme value.
    order: Vec<(f64, usize)>,
}

impl StateCheck {
    /// Checks every cell of the slab.
    pub(super) fn check_cells<Sp: Space, S: Stored>(
        &mut self,
        flow: &dyn LatticeFlow<Sp, S>,
    ) -> CheckResult {
        self.rows.check(flow.fluid());
        let mut seen = CheckResult {
            fastest: Extreme::NO_CELL,
            squeezed: Extreme::NO_CELL,
            broken: None,
        };
        let rows = || self.rows.iter();
        for (row, found) in rows().enumerate() {
            if !found.finite {
                check_row(flow, row, (&mut self.row, &mut self.covered), &mut seen);
            }
        }
        let order = &mut self.order;
        let mut descend = |size: fn(&Extremes) -> f64, known: fn(&CheckResult) -> Extreme| {
            order.clear();
            order.extend(rows().enumerate().map(|(row, found)| (size(found), row)));
            order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let mut best = usize::MAX;
            for &(size, row) in order.iter() {
                let so_far = known(&seen);
                let value = so_far.value.abs();
                if size <= 0.0 || size < value || (size <= value && row > best) {
                    break;
                }
                check_row(flow, row, (&mut self.row, &mut self.covered), &mut seen);
                if known(&seen) != so_far {
                    best = row;
                }
            }
        };
        descend(|row| row.squared_speed, |seen| seen.fastest);
        descend(|row| row.compression, |seen| seen.squeezed);
        seen
    }
}

/// Checks the cells of a row of the slab one by one.
fn check_row<Sp: Space, S: Stored>(
    flow: &dyn LatticeFlow<Sp, S>,
    row: usize,
    (moments, covered): (&mut [Vec<f64>; 4], &mut Vec<f32>),
    seen: &mut CheckResult,
) {
    let fluid = flow.fluid();
    let populations = fluid.populations();
    let [slow, middle, fast] = populations.order();
    let cells = populations.cells();
    let mut at = [0; 3];
    (at[slow], at[middle]) = (row / cells[middle], row % cells[middle]);
    let first = populations.interior_cell(at);
    fluid.row_moments([at[slow], at[middle]], moments);
    covered.resize(cells[fast], 0.0);
    fluid.row_fractions(first, covered);
    let (half, water) = (fluid.half_force(), flow.balanced());
    let all = water.holds_all();
    let (order, start) = (LatticeOrder::from_flow(flow), fluid.start());
    for k in 0..cells[fast] {
        at[fast] = k;
        let place = order.index(std::array::from_fn(|a| at[a] + start[a]));
        let [drho, x, y, z] = [0, 1, 2, 3].map(|n| moments[n][k]);
        let squared = squared_speed(drho, [x, y, z], half);
        if !squared.is_finite() {
            seen.broken = Some(seen.broken.map_or(place, |known| known.min(place)));
            continue;
        }
        // Cells more than half solid count only for finiteness, not for the extremes.
        if covered[k] < 0.5 && (all || water.holds(at)) {
            seen.fastest.raise(squared, place);
            if drho.abs() >= seen.squeezed.value.abs() && !flow.enclosed(at) {
                seen.squeezed.raise(drho, place);
            }
        }
    }
}
