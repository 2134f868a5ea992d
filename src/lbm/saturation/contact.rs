//! Bodies in contact: populations that cross between two full cells of different bodies carry pressure, but no drag.
//!
//! Where no water is between two bodies that slide on each other, the populations that their full cells exchange would
//! act like a viscous film one cell thick. Populations that both cells reverse oscillate and increase this drag up to a
//! hundredfold: a face of 0.01 m² at 0.2 m/s in cells of 1 cm received 55 to 70 N where water would exert 1 N. This
//! film does not exist, because the contact law describes the forces between bodies in contact. A population that
//! leaves a full cell towards a full cell of another body is therefore set to the equilibrium at the mean of the two
//! bodies' velocities at the middle of the link,
//!
//! ```text
//! f_i* = f_i^eq(ρ, u_c),     u_c = (u_a + u_b) / 2
//! ```
//!
//! from both sides. The populations that arrive along i and leave along ī then add up to 2 w_i ρ, the pressure of the
//! joint (uplift), for any velocities of the bodies. The rest population conserves the mass of the cell, and the bodies
//! receive the momentum that the water does not. A wall at rest next to a full cell counts as a body with u_c = 0. The
//! rule does not apply to moving walls.
//!
//! The rule needs the cover of the neighbours, so that a slab holds the cover of its ghost cells. A fraction in a ghost
//! cell is stored as its negative, and no pass acts on it.

use super::Cell;
use super::pass::{Place, View};
use super::solid::{DEEP, NONE, SHARED, STILL, total};
use crate::lanes::{Lanes, Memory, WIDEST};
use crate::lattice::Lattice;
use crate::rigid::surface_velocity;

/// Solids fill a cell whose parts, each rounded to f32, add up to this.
const FULL: f32 = 1.0 - 1e-6;

impl View {
    /// Sets what leaves the full ones of `N::WIDTH` cells towards full cells of other bodies. `sole` is
    /// the body that alone covers the covered ones, `g` are the outgoing populations.
    ///
    /// # Safety
    /// As for [`Self::mix`].
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
        // A thread of a GPU has one cell and asks for its neighbours once.
        // SAFETY: promised by the caller; slots were made by `Cover::make_room`.
        #[cfg(target_arch = "nvptx64")]
        if sole.is_some_and(|slot| unsafe {
            (*self.solids.add(slot as usize)).alone || self.lies_alone::<L, N, Q>(place.cell, slot)
        }) {
            return;
        }
        // SAFETY: as above.
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
        // SAFETY: arrays of at least the lanes' width.
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
            // SAFETY: an array of at least the lanes' width.
            g[i] = unsafe { <f64 as Memory<N>>::load(leaving[i].as_ptr()) };
        }
    }

    /// From a cell to the neighbour along `c`.
    #[inline(always)]
    fn offset(&self, c: [i8; 3]) -> isize {
        let [x, y, z] = c.map(isize::from);
        x * self.strides[0] + y * self.strides[1] + z * self.strides[2]
    }

    /// Returns `true` if no body but `slot` covers neighbours of `N::WIDTH` cells.
    ///
    /// # Safety
    /// As for [`Self::covers`].
    #[cfg(target_arch = "nvptx64")]
    #[inline(always)]
    unsafe fn lies_alone<L: Lattice<Q>, N: Lanes, const Q: usize>(
        &self,
        cell: usize,
        slot: u32,
    ) -> bool {
        // One for each lane, so that the compiler compares a vector of owners at once.
        let mut others = [0; WIDEST];
        for i in 1..Q {
            let there = self
                .owner
                .wrapping_add(cell)
                .wrapping_offset(self.offset(L::C[i]));
            for (lane, other) in others.iter_mut().enumerate().take(N::WIDTH) {
                // SAFETY: the neighbours of interior cells are cells of the slab or ghosts, and the owners have memory
                // for whole vectors.
                let owner = unsafe { there.add(lane).read() };
                *other |= if owner == NONE { 0 } else { owner ^ slot };
            }
        }
        // No comparison of arrays: on a GPU it is a call.
        others.iter().fold(0, |all, other| all | other) == 0
    }

    /// Returns for each of `N::WIDTH` cells `true` if a neighbour has another body than its own, or several.
    ///
    /// # Safety
    /// As for [`Self::covers`].
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
            // One for each lane, so that the compiler compares a vector of owners at once.
            for lane in 0..N::WIDTH {
                // SAFETY: the neighbours of interior cells are cells of the slab or ghosts, and the owners have memory
                // for whole vectors.
                let owner = unsafe { there.add(lane).read() };
                // Of a cell of several bodies all neighbours count but water.
                let other = (owner ^ own[lane]) | (own[lane] & SHARED);
                others[lane] |= if owner == NONE { 0 } else { other };
            }
        }
        others.map(|other| other != 0)
    }

    /// # Safety
    /// As for [`Self::mix`], of a covered cell.
    // On a GPU a call would have a copy of the view in memory, for each thread.
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
            // Most are the same body, or water.
            if other == NONE || (other == owner && owner & SHARED == 0) {
                continue;
            }
            // SAFETY: as above, and both are covered.
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
            // SAFETY: both are covered by bodies.
            let still = still || unsafe { self.rest(owner, other) };
            let v = if still {
                [0.0; 3]
            } else {
                // SAFETY: both are covered by bodies.
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
            let rho = 1.0 + drho;
            let value = L::W[i] * (drho + rho * (3.0 * cv + 4.5 * cv * cv - 1.5 * vv));
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

    /// Returns `true` if one body, or an image of it, fills both cells.
    ///
    /// # Safety
    /// Both must be owners of covered cells.
    #[inline(always)]
    unsafe fn same_body(&self, a: u32, b: u32) -> bool {
        // SAFETY: slots were made by `Cover::make_room`.
        let id = |slot: u32| unsafe { (*self.solids.add(slot as usize)).name.id };
        (a | b) & SHARED == 0 && (a == b || id(a) == id(b))
    }

    /// Returns `true` if the bodies of two covered cells rest: then their velocities need not be computed, as is the
    /// rule in a bed of fixed blocks. Threads of a GPU would wait for each other.
    ///
    /// # Safety
    /// Both must be owners of cells that bodies cover.
    #[inline(always)]
    #[cfg(not(target_arch = "nvptx64"))]
    unsafe fn rest(&self, a: u32, b: u32) -> bool {
        let rests = |slot: u32| {
            // SAFETY: slots were made by `Cover::make_room`.
            let motion = unsafe { &(*self.solids.add(slot as usize)).motion };
            (motion.velocity, motion.spin) == ([0.0; 3], [0.0; 3])
        };
        [a, b].into_iter().all(|owner| {
            // SAFETY: promised by the caller.
            let (slot, shares) = unsafe { self.shares(owner) };
            match shares {
                [] => rests(slot),
                shares => shares.iter().all(|share| rests(share.slot)),
            }
        })
    }

    /// Returns the velocity of the bodies of a covered cell at the middle of the link along `c` from the cell `at`: the
    /// same from both of its ends.
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
            // SAFETY: slots were made by `Cover::make_room`.
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
