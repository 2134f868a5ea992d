//! Bodies in contact: populations that cross between two full cells of different bodies carry pressure, but no drag.
//!
//! If there is no water between two bodies that slide on each other, the populations that their full cells exchange act
//! like a viscous film with a thickness of one cell. Populations that both cells reverse oscillate and increase this
//! drag up to a hundredfold: with cells of 1 cm, a face of 0.01 m² at 0.2 m/s received 55 to 70 N instead of the 1 N
//! that water would exert. This film is unphysical: the contact law already describes the forces between bodies in
//! contact. A population that leaves a full cell towards a full cell of another body is therefore set to the
//! equilibrium at the mean of the velocities of the two bodies at the middle of the link,
//!
//! ```text
//! f_i* = f_i^eq(ρ, u_c) + 3 w_i c_i·F/2,     u_c = (u_a + u_b) / 2
//! ```
//!
//! from both sides, with the body force F on the fluid inside solids. The populations that arrive along i and leave
//! along ī then add up to 2 w_i ρ, the pressure of the joint (uplift), for any velocities of the bodies. The mass of
//! the cell is conserved by a change of the rest population, and the bodies receive the momentum that the water
//! loses. A stationary wall next to a full cell is treated as a body with u_c = 0. The rule does not apply to moving
//! walls.
//!
//! The rule needs the fractions and owners of the neighbours, so that a slab stores those of its ghost cells as well.
//! The fraction of a ghost cell is stored as its negative, so that the pass treats it as open.

use super::Cell;
use super::pass::{Place, View};
use super::solid::{DEEP, NONE, SHARED, STILL, total};
use crate::lanes::{Lanes, Memory, WIDEST};
use crate::lattice::Lattice;
use crate::rigid::surface_velocity;

/// Minimum stored fraction of a full cell. It is below 1, because the fractions of several bodies are each rounded to
/// f32.
const FULL: f32 = 1.0 - 1e-6;

impl View {
    /// Sets the outgoing populations `g` of the full ones of `N::WIDTH` cells towards full cells of other bodies.
    /// `sole` is the only body that covers any of these cells, if there is one.
    ///
    /// # Safety
    /// The conditions are those of [`Self::mix`].
    #[inline(always)]
    pub(super) unsafe fn touch<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        place: Place,
        sole: Option<u32>,
        cell: &Cell<N>,
        g: &mut [N; Q],
    ) where
        f64: Memory<N>,
    {
        let full = |lane: usize| {
            // SAFETY: promised by the caller.
            let fraction = unsafe { self.fraction.add(place.cell + lane).read() };
            (FULL..DEEP).contains(&fraction)
        };
        if !(0..N::WIDTH).any(full) {
            return;
        }
        // A thread of a GPU has one cell, so that the neighbours of the cell are checked here at once.
        // SAFETY: promised by the caller; `solids` has an entry for each slot.
        #[cfg(target_arch = "nvptx64")]
        if sole.is_some_and(|slot| unsafe {
            (*self.solids.add(slot as usize)).alone || self.lies_alone::<L, N, Q>(place.cell, slot)
        }) {
            return;
        }
        // SAFETY: `solids` has an entry for each slot.
        #[cfg(not(target_arch = "nvptx64"))]
        if sole.is_some_and(|slot| unsafe { (*self.solids.add(slot as usize)).alone }) {
            return;
        }
        #[cfg(not(target_arch = "nvptx64"))]
        // SAFETY: promised by the caller.
        let beside = unsafe { self.beside_others::<L, N, Q>(place.cell) };
        #[cfg(not(target_arch = "nvptx64"))]
        let full = |lane: usize| beside[lane] && full(lane);
        #[cfg(not(target_arch = "nvptx64"))]
        if !(0..N::WIDTH).any(full) {
            return;
        }
        let mut drho = [0.0; WIDEST];
        let mut leaving = [[0.0; WIDEST]; Q];
        // SAFETY: the arrays have at least as many elements as lanes.
        unsafe {
            <f64 as Memory<N>>::store(drho.as_mut_ptr(), cell.drho);
            for i in 0..Q {
                <f64 as Memory<N>>::store(leaving[i].as_mut_ptr(), g[i]);
            }
        }
        for lane in (0..N::WIDTH).filter(|&lane| full(lane)) {
            // SAFETY: promised by the caller; the cell is covered.
            unsafe { self.touch_one::<L, Q>(place, lane, drho[lane], &mut leaving) };
        }
        for i in 0..Q {
            // SAFETY: the array has at least as many elements as lanes.
            g[i] = unsafe { <f64 as Memory<N>>::load(leaving[i].as_ptr()) };
        }
    }

    /// Returns the distance in positions from a cell to its neighbour along `c`.
    #[inline(always)]
    fn offset(&self, c: [i8; 3]) -> isize {
        let [x, y, z] = c.map(isize::from);
        x * self.strides[0] + y * self.strides[1] + z * self.strides[2]
    }

    /// Returns `true` if no body except `slot` covers neighbours of `N::WIDTH` cells.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`].
    #[cfg(target_arch = "nvptx64")]
    #[inline(always)]
    unsafe fn lies_alone<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        cell: usize,
        slot: u32,
    ) -> bool {
        // An element for each lane lets the compiler compare a vector of owners at once.
        let mut others = [0; WIDEST];
        for i in 1..Q {
            let there = self
                .owner
                .wrapping_add(cell)
                .wrapping_offset(self.offset(L::C[i]));
            for (lane, other) in others.iter_mut().enumerate().take(N::WIDTH) {
                // SAFETY: the neighbours of interior cells are cells of the slab or ghosts, and the owners of a whole
                // vector of cells are readable.
                let owner = unsafe { there.add(lane).read() };
                *other |= if owner == NONE { 0 } else { owner ^ slot };
            }
        }
        // A comparison of arrays would be a function call on a GPU.
        others.iter().fold(0, |all, other| all | other) == 0
    }

    /// Returns for each of `N::WIDTH` cells `true` if a body that does not cover this cell may cover a neighbour. A
    /// cell of several bodies counts as soon as a neighbour is covered.
    ///
    /// # Safety
    /// The conditions are those of [`Self::covers`].
    #[cfg(not(target_arch = "nvptx64"))]
    #[inline(always)]
    unsafe fn beside_others<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        cell: usize,
    ) -> [bool; WIDEST] {
        let mut own = [NONE; WIDEST];
        for (lane, owner) in own.iter_mut().enumerate().take(N::WIDTH) {
            // SAFETY: promised by the caller.
            *owner = unsafe { self.owner.add(cell + lane).read() };
        }
        let mut others = [0; WIDEST];
        for i in 1..Q {
            let there = self
                .owner
                .wrapping_add(cell)
                .wrapping_offset(self.offset(L::C[i]));
            // An element for each lane lets the compiler compare a vector of owners at once.
            for lane in 0..N::WIDTH {
                // SAFETY: the neighbours of interior cells are cells of the slab or ghosts, and the owners of a whole
                // vector of cells are readable.
                let owner = unsafe { there.add(lane).read() };
                // For a cell of several bodies, every covered neighbour counts.
                let other = (owner ^ own[lane]) | (own[lane] & SHARED);
                others[lane] |= if owner == NONE { 0 } else { other };
            }
        }
        others.map(|other| other != 0)
    }

    /// Sets the outgoing populations of a full cell towards full cells of other bodies, and adds the forces on its
    /// bodies.
    ///
    /// # Safety
    /// The conditions are those of [`Self::mix`], and the cell must be covered.
    // On a GPU a call would store a copy of the view in memory for each thread.
    #[cfg_attr(target_arch = "nvptx64", inline(always))]
    unsafe fn touch_one<L: Lattice<Q>, const Q: usize>(
        &self,
        place: Place,
        lane: usize,
        drho: f64,
        leaving: &mut [[f64; WIDEST]; Q],
    ) {
        let here = place.cell + lane;
        let at = self.coordinates(place, lane);
        // SAFETY: promised by the caller.
        let owner = unsafe { self.owner.add(here).read() };
        let mut gained = [0.0; 3];
        let mut touches = false;
        for i in 1..Q {
            let there = here.wrapping_add_signed(self.offset(L::C[i]));
            // SAFETY: the neighbour of an interior cell is a cell of the slab or a ghost.
            let other = unsafe { self.owner.add(there).read() };
            // Most neighbours are water or cells of the same body.
            if other == NONE || (other == owner && owner & SHARED == 0) {
                continue;
            }
            // SAFETY: as above, and both cells are covered.
            let skip = unsafe {
                self.fraction.add(there).read().abs() < FULL || self.same_body(owner, other)
            };
            if skip {
                continue;
            }
            touches = true;
            let c = L::C[i];
            let still = other == STILL;
            #[cfg(not(target_arch = "nvptx64"))]
            // SAFETY: bodies cover both cells.
            let still = still || unsafe { self.are_stationary(owner, other) };
            let v = if still {
                [0.0; 3]
            } else {
                // SAFETY: bodies cover both cells.
                let (a, b) = unsafe {
                    (
                        self.velocity_on_link::<L, Q>(owner, at, c),
                        self.velocity_on_link::<L, Q>(other, at, c),
                    )
                };
                [
                    0.5 * (a[0] + b[0]),
                    0.5 * (a[1] + b[1]),
                    0.5 * (a[2] + b[2]),
                ]
            };
            let cf = c.map(f64::from);
            let cv = cf[0] * v[0] + cf[1] * v[1] + cf[2] * v[2];
            let vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
            let h = self.inside;
            let ch = cf[0] * h[0] + cf[1] * h[1] + cf[2] * h[2];
            let rho = 1.0 + drho;
            let value = L::W[i] * (drho + (rho * (3.0 * cv + 4.5 * cv * cv - 1.5 * vv) + 3.0 * ch));
            let more = value - leaving[i][lane];
            leaving[i][lane] = value;
            leaving[0][lane] -= more;
            for a in 0..3 {
                gained[a] += cf[a] * more;
            }
        }
        if touches {
            // SAFETY: promised by the caller.
            unsafe { self.act::<L, Q>(place, lane, gained.map(|m| -m)) };
        }
    }

    /// Returns `true` if one body and its periodic images cover both cells, given the owners of the cells.
    ///
    /// # Safety
    /// Both owners must be those of covered cells.
    #[inline(always)]
    unsafe fn same_body(&self, a: u32, b: u32) -> bool {
        // SAFETY: `solids` has an entry for each slot.
        let id = |slot: u32| unsafe { (*self.solids.add(slot as usize)).name.id };
        (a | b) & SHARED == 0 && (a == b || id(a) == id(b))
    }

    /// Returns `true` if the bodies of two covered cells are stationary, so that their velocities need not be computed;
    /// in a bed of fixed blocks this is the usual case. GPUs do not use this function, because it would make the
    /// threads of a warp diverge.
    ///
    /// # Safety
    /// Both owners must be those of cells that bodies cover.
    #[inline(always)]
    #[cfg(not(target_arch = "nvptx64"))]
    unsafe fn are_stationary(&self, a: u32, b: u32) -> bool {
        let is_stationary = |slot: u32| {
            // SAFETY: `solids` has an entry for each slot.
            let motion = unsafe { &(*self.solids.add(slot as usize)).motion };
            (motion.velocity, motion.spin) == ([0.0; 3], [0.0; 3])
        };
        [a, b].into_iter().all(|owner| {
            // SAFETY: promised by the caller.
            let (slot, shares) = unsafe { self.shares(owner) };
            match shares {
                [] => is_stationary(slot),
                shares => shares.iter().all(|share| is_stationary(share.slot)),
            }
        })
    }

    /// Returns the velocity of the bodies of a covered cell at the middle of the link along `c` from the cell `at`. The
    /// point is computed from integers, so that the result is the same from both ends of the link.
    ///
    /// # Safety
    /// `owner` must be that of a cell that bodies cover.
    unsafe fn velocity_on_link<L: Lattice<Q>, const Q: usize>(
        &self,
        owner: u32,
        at: [i32; 3],
        c: [i8; 3],
    ) -> [f64; 3] {
        debug_assert!(owner != NONE && owner != STILL);
        let of = |slot: u32| {
            // SAFETY: `solids` has an entry for each slot.
            let solid = unsafe { &*self.solids.add(slot as usize) };
            let raw = solid.raw(at);
            let mut arm = [0.0; 3];
            for a in 0..L::DIMENSION {
                let halves = 2 * raw[a] + 1 + i32::from(c[a]);
                arm[a] = 0.5 * f64::from(halves) - solid.motion.position[a];
            }
            if L::DIMENSION == 2 {
                surface_velocity::<2>(&solid.motion, arm)
            } else {
                surface_velocity::<3>(&solid.motion, arm)
            }
        };
        // SAFETY: promised by the caller.
        let (slot, shares) = unsafe { self.shares(owner) };
        if shares.is_empty() {
            return of(slot);
        }
        let all = total(shares);
        let mut mean = [0.0; 3];
        for share in shares {
            let v = of(share.slot);
            let part = f64::from(share.fraction) / all;
            for a in 0..3 {
                mean[a] += part * v[a];
            }
        }
        mean
    }
}

#[cfg(test)]
mod tests;
