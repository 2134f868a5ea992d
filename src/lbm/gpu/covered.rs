//! The pass over a cell of a lattice that solids may cover ([`crate::saturation`]).
//!
//! A thread with a covered cell has far more to do than one without, so that each kind of cell has a pass of its own:
//! open cells, cells deep inside bodies, and the others. The covered cells are listed first, so that threads side by
//! side have the same work. Together the three are the pass of the processor.

use super::cell::{self, Place, Slab};
use crate::collision::kernel::Collision;
use crate::lanes::{Memory, Stored};
use crate::lattice::{Lattice, unroll};
use crate::saturation::pass::{Place as InSlab, View};
use crate::saturation::sums::Sums;

/// Position of a cell in arrays with one number for each cell: that of its population at rest.
#[inline(always)]
pub(crate) fn position(slab: &Slab, Place { plane, row, place }: Place) -> usize {
    (slab.first[0] + plane * slab.plane + row * slab.row + place) as usize
}

/// Collides and streams one cell, if no solid covers it.
///
/// # Safety
/// As for [`cell::collide`], and the view must be that of the slab.
#[inline(always)]
pub(crate) unsafe fn collide_open<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    place: Place,
    (operator, rates): (&C, &C::Rates<f64>),
    view: &View,
) {
    // SAFETY: promised by the caller.
    unsafe {
        if !view.covers::<f64>(position(slab, place)) {
            cell::collide::<L, C, S, true, Q>(numbers, slab, place, operator, rates);
        }
    }
}

/// Returns `true` if solids cover a cell, and `true` if it is deep inside.
///
/// # Safety
/// The view must be that of the slab, and the cell one of its own.
#[inline(always)]
pub(crate) unsafe fn kind(slab: &Slab, place: Place, view: &View) -> [bool; 2] {
    let at = position(slab, place);
    // SAFETY: promised by the caller.
    unsafe { [view.covers::<f64>(at), view.fills::<f64>(at)] }
}

/// Returns a cell as a view needs it.
#[inline(always)]
fn in_view(slab: &Slab, place: Place, sums: *mut Sums) -> InSlab {
    InSlab {
        cell: position(slab, place),
        at: [
            place.plane as usize,
            place.row as usize,
            place.place as usize,
        ],
        sums,
    }
}

/// Reads the populations of a cell.
///
/// # Safety
/// As for [`cell::collide`].
#[inline(always)]
unsafe fn read<S: Stored, const Q: usize>(numbers: *mut S, slab: &Slab, start: u32) -> [f64; Q] {
    let mut before = [0.0; Q];
    unroll!(populations i < Q => {
        // SAFETY: a number of this cell, which no other cell has in this pass.
        before[i] = unsafe { <S as Memory<f64>>::load(numbers.add((slab.first[i] + start) as usize)) };
    });
    before
}

/// Leaves the populations of a cell.
///
/// # Safety
/// As for [`cell::collide`].
#[inline(always)]
unsafe fn write<L: Lattice<Q>, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    start: u32,
    g: &[f64; Q],
) {
    unroll!(populations i < Q => {
        let to = slab.first[L::OPPOSITE[i]] + start;
        // SAFETY: a number of this cell, which no other cell has in this pass.
        unsafe { <S as Memory<f64>>::store(numbers.add(to as usize), g[i]) };
    });
}

/// Streams one cell deep inside solids, and adds the force on them.
///
/// # Safety
/// As for [`collide_open`], where [`View::fills`] holds; the sums must be those of this thread.
#[inline(always)]
pub(crate) unsafe fn fill<L: Lattice<Q>, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    place: Place,
    (view, sums): (&View, *mut Sums),
) {
    let start = place.plane * slab.plane + place.row * slab.row + place.place;
    let mut g = [0.0; Q];
    // SAFETY: promised by the caller.
    unsafe {
        let before = read::<S, Q>(numbers, slab, start);
        view.fill::<L, f64, Q>(in_view(slab, place, sums), &before, &mut g);
        write::<L, S, Q>(numbers, slab, cell::opaque(start), &g);
    }
}

/// Collides and streams one cell that solids cover in part, or in whole at their surface, and adds the force on them.
/// `omega` is the rate of the fluid.
///
/// # Safety
/// As for [`fill`], where [`View::covers`] holds.
#[inline(always)]
pub(crate) unsafe fn mix<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    place: Place,
    (operator, rates): (&C, &C::Rates<f64>),
    (view, sums, omega): (&View, *mut Sums, f64),
) {
    let start = place.plane * slab.plane + place.row * slab.row + place.place;
    let mut g = [0.0; Q];
    // SAFETY: promised by the caller.
    unsafe {
        let mut fluid = read::<S, Q>(numbers, slab, start);
        let moments = View::moments::<L, f64, Q>(&fluid);
        let u = operator.collide::<L, f64, _, Q>(&mut fluid, rates);
        // Read again: a thread has no registers for both, and they are in the cache.
        let start = cell::opaque(start);
        let before = read::<S, Q>(numbers, slab, start);
        let here = in_view(slab, place, sums);
        view.mix_with_moments::<L, f64, Q>(here, (&before, moments), &fluid, &mut g, (u, omega));
        write::<L, S, Q>(numbers, slab, cell::opaque(start), &g);
    }
}
