//! Passes over one cell of a lattice that solids may cover ([`crate::saturation`]).
//!
//! They are separate from the pass of the processor, which treats all cells, because the threads of a warp should do
//! the same work and a covered cell takes much longer than an open one. There is a pass for open cells, one for cells
//! deep inside bodies, and one for the other covered cells; the covered cells are listed before. The three passes
//! together have the same result as the pass of the processor.

use super::cell::{self, CellIndex, Slab};
use crate::collision::kernel::Collision;
use crate::lanes::{Memory, Stored};
use crate::lattice::{Lattice, unroll};
use crate::saturation::pass::{Place, View};
use crate::saturation::sums::Sums;

/// Returns the position of a cell in arrays with one number per cell, which is the position of its rest population.
#[inline(always)]
pub(crate) fn position(slab: &Slab, CellIndex { plane, row, column }: CellIndex) -> usize {
    (slab.first[0] + plane * slab.plane + row * slab.row + column) as usize
}

/// Collides and streams one cell, if no solid covers it.
///
/// # Safety
/// The conditions are those of [`cell::collide`], and the view must be that of the slab.
#[inline(always)]
pub(crate) unsafe fn collide_open<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    cell: CellIndex,
    (operator, rates): (&C, &C::Rates<f64>),
    view: &View,
) {
    // SAFETY: promised by the caller.
    unsafe {
        if !view.covers::<f64>(position(slab, cell)) {
            cell::collide::<L, C, S, true, Q>(numbers, slab, cell, operator, rates);
        }
    }
}

/// Returns `true` if solids cover a cell, and `true` if the cell is deep inside them.
///
/// # Safety
/// The view must be that of the slab, and the cell must be one of the slab.
#[inline(always)]
pub(crate) unsafe fn kind(slab: &Slab, cell: CellIndex, view: &View) -> [bool; 2] {
    let at = position(slab, cell);
    // SAFETY: promised by the caller.
    unsafe { [view.covers::<f64>(at), view.fills::<f64>(at)] }
}

/// Returns the location of a cell in the form that a view takes.
#[inline(always)]
fn in_view(slab: &Slab, cell: CellIndex, sums: *mut Sums) -> Place {
    Place {
        cell: position(slab, cell),
        at: [cell.plane as usize, cell.row as usize, cell.column as usize],
        sums,
    }
}

/// Reads the populations of a cell; `start` is its distance from the first cell of the slab.
///
/// # Safety
/// The conditions are those of [`cell::collide`].
#[inline(always)]
unsafe fn read<S: Stored, const Q: usize>(numbers: *mut S, slab: &Slab, start: u32) -> [f64; Q] {
    let mut before = [0.0; Q];
    unroll!(populations i < Q => {
        // SAFETY: only this cell accesses the number in this pass.
        before[i] = unsafe { <S as Memory<f64>>::load(numbers.add((slab.first[i] + start) as usize)) };
    });
    before
}

/// Writes the outgoing populations of a cell, each to the address from which its opposite was read.
///
/// # Safety
/// The conditions are those of [`cell::collide`].
#[inline(always)]
unsafe fn write<L: Lattice<Q>, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    start: u32,
    g: &[f64; Q],
) {
    unroll!(populations i < Q => {
        let to = slab.first[L::OPPOSITE[i]] + start;
        // SAFETY: only this cell accesses the number in this pass.
        unsafe { <S as Memory<f64>>::store(numbers.add(to as usize), g[i]) };
    });
}

/// Sets and streams the populations of one cell deep inside bodies, and adds the force on the bodies.
///
/// # Safety
/// The conditions are those of [`collide_open`]; [`View::fills`] must be `true` for the cell, and the sums must be
/// those of this thread.
#[inline(always)]
pub(crate) unsafe fn fill<L: Lattice<Q>, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    cell: CellIndex,
    (view, sums): (&View, *mut Sums),
) {
    let start = cell.plane * slab.plane + cell.row * slab.row + cell.column;
    let mut g = [0.0; Q];
    // SAFETY: promised by the caller.
    unsafe {
        let before = read::<S, Q>(numbers, slab, start);
        view.fill::<L, f64, Q>(in_view(slab, cell, sums), &before, &mut g);
        write::<L, S, Q>(numbers, slab, cell::opaque(start), &g);
    }
}

/// Collides and streams one cell that bodies cover partly, or fully at their surface, and adds the force on the bodies.
/// `omega` is the relaxation rate of the fluid.
///
/// # Safety
/// The conditions are those of [`fill`], with [`View::covers`] in place of [`View::fills`].
#[inline(always)]
pub(crate) unsafe fn mix<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    cell: CellIndex,
    (operator, rates): (&C, &C::Rates<f64>),
    (view, sums, omega): (&View, *mut Sums, f64),
) {
    let start = cell.plane * slab.plane + cell.row * slab.row + cell.column;
    let mut g = [0.0; Q];
    // SAFETY: promised by the caller.
    unsafe {
        let mut fluid = read::<S, Q>(numbers, slab, start);
        let moments = View::moments::<L, f64, Q>(&fluid);
        let u = operator.collide::<L, f64, _, Q>(&mut fluid, rates);
        // The populations are read again from the cache, because a thread has too few registers for the incoming ones
        // and those after the collision.
        let start = cell::opaque(start);
        let before = read::<S, Q>(numbers, slab, start);
        let here = in_view(slab, cell, sums);
        view.mix_with_moments::<L, f64, Q>(here, (&before, moments), &fluid, &mut g, (u, omega));
        write::<L, S, Q>(numbers, slab, cell::opaque(start), &g);
    }
}
