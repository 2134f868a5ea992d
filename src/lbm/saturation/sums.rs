//! Forces on bodies, summed by a worker over its cells.

use crate::links::{Load, add_force, add_moment};
use crate::quanta::quanta;

/// Sums of one worker.
#[derive(Debug, Default)]
pub(crate) struct Sums {
    pub(super) loads: Vec<Load>,
    pub(super) touched: Vec<u32>,
    pub(super) known: Vec<bool>,
}

impl Sums {
    pub(super) fn fit(&mut self, slots: usize) {
        self.loads.resize(slots, [0; 6]);
        self.known.resize(slots, false);
        self.touched
            .reserve(slots.saturating_sub(self.touched.len()));
    }

    #[inline(always)]
    pub(super) fn add<const D: usize>(&mut self, slot: u32, raw: [i32; 3], force: [f64; 3]) {
        let k = slot as usize;
        if let (Some(known), Some(load)) = (self.known.get_mut(k), self.loads.get_mut(k)) {
            if !*known {
                *known = true;
                self.touched.push(slot);
            }
            let force = [quanta(force[0]), quanta(force[1]), quanta(force[2])];
            let middle = [2 * raw[0] + 1, 2 * raw[1] + 1, 2 * raw[2] + 1];
            add_force::<D>(load, force, middle);
        }
    }

    /// Adds a load computed elsewhere.
    pub(super) fn add_load(&mut self, slot: u32, load: &Load) {
        let k = slot as usize;
        if let (Some(known), Some(sum)) = (self.known.get_mut(k), self.loads.get_mut(k)) {
            if !*known {
                *known = true;
                self.touched.push(slot);
            }
            for (sum, part) in sum.iter_mut().zip(load) {
                *sum += part;
            }
        }
    }

    /// Adds the forces, in quanta, on cells of a row covered by one body, with the same result as [`Self::add`] for
    /// each cell. `raw` is the first cell, `fast` the axis of the row, `force` the sum over the cells, `weighted`
    /// the sum of the forces times their index from 0.
    #[inline(always)]
    pub(super) fn add_row<const D: usize>(
        &mut self,
        slot: u32,
        raw: [i32; 3],
        fast: usize,
        force: [i64; 3],
        weighted: [i64; 3],
    ) {
        let k = slot as usize;
        if let (Some(known), Some(load)) = (self.known.get_mut(k), self.loads.get_mut(k)) {
            if !*known {
                *known = true;
                self.touched.push(slot);
            }
            let middle = [2 * raw[0] + 1, 2 * raw[1] + 1, 2 * raw[2] + 1];
            add_force::<D>(load, force, middle);
            // Sum of the positions of the other cells, in half cells from the first.
            let mut along = [0; 3];
            along[fast] = 2;
            add_moment::<D>(load, weighted, along);
        }
    }
}
