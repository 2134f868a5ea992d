//! The sums of the forces on bodies, as the pass over covered cells adds to them on a GPU: the part of [`crate::lbm::saturation`]'s sums of a
//! worker.

use super::loads::BodyLoad;
use crate::lbm::quanta::quanta;
use crate::lbm::saturation::solid::Solid;

/// Sums of all threads.
pub(crate) struct Sums {
    /// One for each body.
    pub(crate) loads: *const BodyLoad,
    /// The bodies.
    pub(crate) solids: *const Solid,
}

impl Sums {
    /// Adds a force at the middle of a cell.
    #[inline(always)]
    pub(crate) fn add<const D: usize>(&mut self, slot: u32, raw: [i32; 3], force: [f64; 3]) {
        let force = [quanta(force[0]), quanta(force[1]), quanta(force[2])];
        self.add_row::<D>(slot, raw, 0, force, [0; 3]);
    }

    /// The same in quanta; a row of a GPU is one cell, so that no force has a place beyond the first.
    #[inline(always)]
    pub(crate) fn add_row<const D: usize>(
        &mut self,
        slot: u32,
        raw: [i32; 3],
        _fast: usize,
        force: [i64; 3],
        _weighted: [i64; 3],
    ) {
        // SAFETY: the host has room for each slot of a covered cell.
        let (load, solid) = unsafe {
            (
                &*self.loads.add(slot as usize),
                &*self.solids.add(slot as usize),
            )
        };
        load.add::<D>(solid, raw, force);
    }
}
