//! The sums of the forces on bodies, as the pass over covered cells adds to them on a GPU: the part of
//! [`crate::saturation`]'s sums of a worker.
//!
//! The force on the first body of a cell waits until the threads of a warp add up what they have for the same body: few
//! additions to memory are left, for which thousands of threads would stand in line.

use super::loads::BodyLoad;
use super::warp;
use crate::lattice::unroll;
use crate::quanta::quanta;
use crate::saturation::solid::{CoveringBody, NONE};

/// Sums of all threads, and the force of this one that waits.
pub(crate) struct Sums {
    /// One for each body.
    loads: *const BodyLoad,
    /// The bodies.
    solids: *const CoveringBody,
    /// Whose force waits, in which cell, in quanta.
    slot: u32,
    raw: [i32; 3],
    force: [i64; 3],
}

impl Sums {
    /// No force yet. There are [`BodyLoad::COPIES`] times as many loads as `bodies`, and warp number `warp` has some of
    /// them.
    #[inline(always)]
    pub(crate) fn new(
        loads: *const BodyLoad,
        solids: *const CoveringBody,
        bodies: u32,
        warp: u32,
    ) -> Self {
        let copy = warp % BodyLoad::COPIES * bodies;
        Self {
            loads: loads.wrapping_add(copy as usize),
            solids,
            slot: NONE,
            raw: [0; 3],
            force: [0; 3],
        }
    }

    /// Adds a force at the middle of a cell.
    #[inline(always)]
    pub(crate) fn add<const D: usize>(&mut self, slot: u32, raw: [i32; 3], force: [f64; 3]) {
        let force = [quanta(force[0]), quanta(force[1]), quanta(force[2])];
        self.add_row::<D>(slot, raw, 0, force, [0; 3]);
    }

    /// Adds a force in quanta at the middle of a cell; a row of a GPU is one cell, so that no force has a place beyond
    /// the first.
    #[inline(always)]
    pub(crate) fn add_row<const D: usize>(
        &mut self,
        slot: u32,
        raw: [i32; 3],
        _fast: usize,
        force: [i64; 3],
        _weighted: [i64; 3],
    ) {
        if self.slot == NONE {
            (self.slot, self.raw, self.force) = (slot, raw, force);
            return;
        }
        // SAFETY: the host has memory for each slot of a covered cell.
        let (load, solid) = unsafe {
            (
                &*self.loads.add(slot as usize),
                &*self.solids.add(slot as usize),
            )
        };
        load.add::<D>(solid, raw, force);
    }

    /// Adds what waits.
    ///
    /// # Safety
    /// All threads of the warp must be here.
    #[inline(always)]
    pub(crate) unsafe fn finish<const D: usize>(self) {
        let mut waiting = warp::ballot(self.slot != NONE);
        while waiting != 0 {
            let leader = waiting.trailing_zeros();
            let slot = warp::of_lane(self.slot, leader);
            let mine = self.slot == slot;
            // SAFETY: as above.
            let (load, solid) = unsafe {
                (
                    &*self.loads.add(slot as usize),
                    &*self.solids.add(slot as usize),
                )
            };
            let mut parts = [0; 12];
            if mine {
                parts = BodyLoad::parts::<D>(solid, self.raw, self.force);
            }
            unroll!(populations n < 12 => {
                parts[n] = warp::sum(parts[n]);
            });
            if warp::lane() == leader {
                load.add_parts(parts);
            }
            waiting &= !warp::ballot(mine);
        }
    }
}
