//! Sums of the forces on bodies in the passes over covered cells on a GPU.
//!
//! The module is separate from the sums of a worker of the processor (`saturation::sums`), which it replaces on GPUs.
//! A thread keeps the first force of its cell until all threads of the warp add up the forces on the same body. This
//! leaves few atomic additions, which would otherwise make thousands of threads wait for the same address.

use super::loads::BodyLoad;
use super::warp;
use crate::lattice::unroll;
use crate::quanta::quanta;
use crate::saturation::solid::{CoveringBody, NONE};

/// Sums of all threads, and the force that this thread keeps.
pub(crate) struct Sums {
    /// Load of each body.
    loads: *const BodyLoad,
    /// Bodies by slot.
    solids: *const CoveringBody,
    /// Slot of the body on which the kept force acts, cell in the raw frame of the body, and force in quanta.
    slot: u32,
    raw: [i32; 3],
    force: [i64; 3],
}

impl Sums {
    /// Returns sums without a force. Each body has [`BodyLoad::COPIES`] partial loads, one of which receives the forces
    /// of warp `warp`.
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

    /// Adds a force in lattice units that acts at the centre of a cell.
    #[inline(always)]
    pub(crate) fn add<const D: usize>(&mut self, slot: u32, raw: [i32; 3], force: [f64; 3]) {
        let force = [quanta(force[0]), quanta(force[1]), quanta(force[2])];
        self.add_row::<D>(slot, raw, 0, force, [0; 3]);
    }

    /// Adds a force in quanta that acts at the centre of a cell. The vectors of a GPU have one cell, so that there are
    /// no forces weighted by the index of a cell.
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
        // SAFETY: the host allocates a load for each slot.
        let (load, solid) = unsafe {
            (
                &*self.loads.add(slot as usize),
                &*self.solids.add(slot as usize),
            )
        };
        load.add::<D>(solid, raw, force);
    }

    /// Adds the forces that the threads of the warp keep to the loads of their bodies.
    ///
    /// # Safety
    /// All threads of the warp must call this function together.
    #[inline(always)]
    pub(crate) unsafe fn finish<const D: usize>(self) {
        let mut waiting = warp::ballot(self.slot != NONE);
        while waiting != 0 {
            let leader = waiting.trailing_zeros();
            let slot = warp::from_lane(self.slot, leader);
            let mine = self.slot == slot;
            // SAFETY: as for `add_row`.
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
