//! Forces on bodies, summed by a worker of the processor over its cells.
//!
//! The module is separate from the pass over covered cells, which uses `gpu::sums` instead on GPUs.

use crate::links::{Load, add_force, add_moment};
use crate::quanta::quanta;

/// Sums of one worker, by slot of the body.
#[derive(Debug, Default)]
pub(crate) struct Sums {
    /// Force, and twice the moment, in quanta.
    pub(super) loads: Vec<Load>,
    /// Slots with a force since the sums were last collected.
    pub(super) touched: Vec<u32>,
    /// Flag of each slot, which is `true` if `touched` contains the slot.
    pub(super) known: Vec<bool>,
}

impl Sums {
    /// Resizes the sums to a number of slots.
    pub(super) fn fit(&mut self, slots: usize) {
        self.loads.resize(slots, [0; 6]);
        self.known.resize(slots, false);
        self.touched
            .reserve(slots.saturating_sub(self.touched.len()));
    }

    /// Adds a force in lattice units that acts at the centre of cell `raw` of the raw frame of the body.
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

    /// Adds a load in quanta.
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

    /// Adds the forces, in quanta, on consecutive cells of a row that one body covers, with the same result as calls of
    /// [`Self::add`] for each cell. `raw` is the first cell, `fast` the axis of the row, `force` the sum over the
    /// cells, and `weighted` the sum of the forces times the index of their cell from 0.
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
            // The arm of a cell from the first one is its index times one cell, that is, two half cells.
            let mut along = [0; 3];
            along[fast] = 2;
            add_moment::<D>(load, weighted, along);
        }
    }
}
