//! The extreme values of each row of a slab, found by all threads, to locate values that are not finite or exceed a limit.

use super::fluid::Fluid;
use super::lanes::Stored;
use super::populations::Extremes;
use crate::thread_pool;

/// The extreme values of the rows of a slab, in the order of [`super::populations::Populations::rows`]; a reusable buffer.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    threads: Vec<Share>,
}

/// The rows of one thread.
#[derive(Clone, Debug, Default)]
struct Share {
    /// Moments of a row.
    work: [Vec<f64>; 4],
    found: Vec<Extremes>,
}

impl Rows {
    /// Looks at every row.
    pub fn look<S: Stored>(&mut self, fluid: &Fluid<S>) {
        let populations = fluid.populations();
        let [slow, middle, fast] = populations.order();
        let cells = populations.cells();
        let rows = cells[slow] * cells[middle];
        let pieces = thread_pool::threads().min(cells[slow]).max(1);
        self.threads.resize_with(pieces, Share::default);
        let half = fluid.half_force();
        thread_pool::each_item(&mut self.threads, 1, |piece, share| {
            share.found.clear();
            for row in rows * piece / pieces..rows * (piece + 1) / pieces {
                let mut at = [0; 3];
                (at[slow], at[middle]) = (row / cells[middle], row % cells[middle]);
                let first = populations.interior_cell(at);
                let found = populations.row_extremes(first, cells[fast], half, &mut share.work);
                share.found.push(found);
            }
        });
    }

    /// The result.
    pub fn iter(&self) -> impl Iterator<Item = &Extremes> {
        self.threads.iter().flat_map(|share| &share.found)
    }
}
