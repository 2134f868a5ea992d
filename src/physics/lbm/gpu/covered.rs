//! The pass over a cell of a lattice that solids may cover ([`crate::lbm::saturation`]).
//!
//! A thread with a covered cell has far more to do than one without, so that each kind of cell has a pass of its own: together they are
//! the pass of the processor.

use super::cell::{self, Place, Slab};
use crate::lbm::collision::kernel::Collision;
use crate::lbm::lanes::{Memory, Stored};
use crate::lbm::lattice::{Lattice, unroll};
use crate::lbm::saturation::pass::{Place as InSlab, View};

/// Position of a cell in arrays with one number for each cell: that of its population at rest.
#[inline(always)]
fn position(slab: &Slab, Place { plane, row, place }: Place) -> usize {
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

/// Collides and streams one cell, if solids cover it, and adds the force on them. `omega` is the rate of the fluid.
///
/// # Safety
/// As for [`collide_open`], and the view must have sums.
#[inline(always)]
pub(crate) unsafe fn collide_covered<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    place: Place,
    (operator, rates): (&C, &C::Rates<f64>),
    (view, omega): (&View, f64),
) {
    let at = position(slab, place);
    // SAFETY: promised by the caller.
    if unsafe { !view.covers::<f64>(at) } {
        return;
    }
    let Place { plane, row, place } = place;
    let start = plane * slab.plane + row * slab.row + place;
    let mut before = [0.0; Q];
    unroll!(populations i < Q => {
        // SAFETY: a number of this cell, which no other cell has in this pass.
        before[i] = unsafe { <S as Memory<f64>>::load(numbers.add((slab.first[i] + start) as usize)) };
    });
    let here = InSlab {
        cell: at,
        at: [plane as usize, row as usize, place as usize],
        worker: 0,
    };
    let mut g = [0.0; Q];
    // SAFETY: promised by the caller.
    unsafe {
        if view.fills::<f64>(at) {
            view.fill::<L, f64, Q>(here, &before, &mut g);
        } else {
            let mut fluid = before;
            let u = operator.collide::<L, f64, _, Q>(&mut fluid, rates);
            view.mix::<L, f64, Q>(here, &before, &fluid, &mut g, (u, omega));
        }
    }
    let start = cell::opaque(start);
    unroll!(populations i < Q => {
        let to = slab.first[L::OPPOSITE[i]] + start;
        // SAFETY: as above.
        unsafe { <S as Memory<f64>>::store(numbers.add(to as usize), g[i]) };
    });
}
