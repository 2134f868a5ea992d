//! Bounce-back at stationary surfaces, with the force on each.
//!
//! A link from a cell of water either ends in a solid cell, or in another cell of water behind a sheet thinner than
//! a cell. Each end in water uses the central linear interpolation of the parent module with its own distance q
//! from the surface:
//!
//! f_ī(x, t+1) = f*_i(x) + κ [f_i(x, t+1) - f*_ī(x)],  κ = (1-2q)/(1+2q),
//!
//! or half-way, if q = 1/2 or if the cell behind x is not water. An end inside a solid bounces half-way, so that
//! its content does not change. The surface receives f*_i + f_ī(t+1) along c_i.

use super::{Along, Load, Numbers, Rigid, Table, add_along, prefetch};
use crate::lanes::Stored;
use crate::populations::{Link, Populations};
use crate::quanta::quanta;
use base::thread_pool;

/// Link intersected by a stationary surface. It begins in the outer cell and ends in the inner one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedLink {
    /// Positions of the two populations.
    pub link: Link,
    /// Midpoint of the link in half cells, in the frame of the domain.
    pub middle: [i32; 3],
    /// Direction from the outer to the inner cell.
    pub direction: u8,
    /// For each end, `true` if it is water of this slab.
    pub wet: [bool; 2],
    /// Coefficient κ of each end; 0 for half-way bounce-back.
    pub kappa: [f64; 2],
}

/// Number of groups of links per thread and batch.
const PER_THREAD: usize = 4;

/// Applies bounce-back on the links of each group and adds the loads.
///
/// # Panics
/// Never: positions come from [`Populations::link`] of the same lattice.
pub fn bounce_fixed<S: Stored, const D: usize>(
    populations: &mut Populations<S>,
    groups: &[Vec<FixedLink>],
    loads: &mut [Load],
) {
    let parity = populations.parity();
    let table = Table::new(populations);
    let opposite: [u8; 32] = {
        let v = populations.velocities();
        std::array::from_fn(|i| {
            let back = v.opposite.get(i).copied().unwrap_or(0);
            u8::try_from(back).unwrap_or(0)
        })
    };
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let numbers = &numbers;
    let rest = Rigid::default();
    thread_pool::each_item(loads, PER_THREAD, |k, load| {
        let (links, mut sum) = (&groups[k], *load);
        let all = Along {
            numbers: numbers.0,
            parity,
            table: &table,
            motion: &rest,
        };
        for (n, link) in links.iter().enumerate() {
            if let Some(later) = links.get(n + super::AHEAD) {
                prefetch(all.numbers, later.link.near as usize);
                prefetch(all.numbers, later.link.far as usize);
            }
            // SAFETY: positions made by `Populations::link` lie in the array; every link is in one group only, and
            // the numbers that interpolation reads lie between two cells of water without a surface, which no link
            // writes.
            unsafe { one::<S, D>(&all, &opposite, link, &mut sum) };
        }
        *load = sum;
    });
}

/// # Safety
/// The numbers must be the array that the link's positions refer to, and no other thread may touch its two numbers, nor
/// write those that interpolation reads.
#[inline(always)]
unsafe fn one<S: Stored, const D: usize>(
    all: &Along<S>,
    opposite: &[u8; 32],
    link: &FixedLink,
    load: &mut Load,
) {
    let (numbers, parity) = (all.numbers, all.parity);
    // SAFETY: promised by the caller.
    let (outer, inner) = unsafe {
        (
            numbers.add(link.link.out(parity)),
            numbers.add(link.link.incoming(parity)),
        )
    };
    // SAFETY: as above.
    let (forth, back) = unsafe { (outer.read().to_f64(), inner.read().to_f64()) };
    let directions = [link.direction, opposite[usize::from(link.direction % 32)]];
    let near = [link.link.near as usize, link.link.far as usize];
    let returns = |end: usize, leaves: f64| {
        if link.kappa[end].abs() <= 0.0 {
            return leaves;
        }
        let along = &all.table.0[usize::from(directions[end] % 32)];
        let home = near[end].wrapping_add_signed(along.swap);
        let behind = near[end].wrapping_add_signed(along.behind);
        let (entering, returning) = match parity {
            super::Parity::Home => (home, behind),
            super::Parity::Reversed => (behind, home),
        };
        // SAFETY: as above; the cell behind an interpolated end is water, at most one cell beyond the slab.
        let (entering, returning) = unsafe {
            (
                numbers.add(entering).read().to_f64(),
                numbers.add(returning).read().to_f64(),
            )
        };
        leaves + link.kappa[end] * (entering - returning)
    };
    let first = returns(0, forth);
    let second = returns(1, back);
    // SAFETY: as above.
    unsafe {
        inner.write(S::from_f64(first));
        outer.write(S::from_f64(second));
    }
    let c = all.table.0[usize::from(link.direction % 32)].ci;
    if link.wet[0] {
        add_along::<D>(load, quanta(forth + first), c, link.middle);
    }
    if link.wet[1] {
        add_along::<D>(load, quanta(-(back + second)), c, link.middle);
    }
}
