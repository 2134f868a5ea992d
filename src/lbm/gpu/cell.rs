//! The pass over one cell: what a thread of a GPU does.
//!
//! It reads all populations of the cell, collides, and leaves each where its opposite was read, as the pass over rows
//! does ([`crate::kernel`]) with the same operators and the same order of operations, so that the bits are the same. On
//! a processor the populations stay in memory until they are needed, because its registers do not hold them; a thread
//! of a GPU has the registers, and reads all before the first use, so that many reads are on their way at once.

use crate::collision::kernel::{Collision, Site};
use crate::lanes::{Memory, Stored};
use crate::lattice::{Lattice, unroll};

/// Layout of the numbers of the cells of a slab in one pass. The same bytes on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Slab {
    /// Position read for each population by the cell at plane 0, row 0, place 0.
    pub first: [u32; 27],
    /// Numbers from plane to plane.
    pub plane: u32,
    /// Numbers from row to row.
    pub row: u32,
    /// Cells of a row.
    pub cells: u32,
}

/// A cell: plane, row and place in the row.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Across the slab axis.
    pub plane: u32,
    /// In the plane.
    pub row: u32,
    /// In the row.
    pub place: u32,
}

/// Hides from the compiler that a place is the same as before. It would keep the addresses of what is read for what is
/// written, in a third of the registers of a thread.
#[inline(always)]
pub(super) fn opaque(place: u32) -> u32 {
    #[cfg(target_arch = "nvptx64")]
    {
        let mut place = place;
        // SAFETY: moves a number.
        unsafe {
            core::arch::asm!("mov.u32 {0}, {0};", inout(reg32) place, options(nomem, nostack, preserves_flags));
        }
        place
    }
    #[cfg(not(target_arch = "nvptx64"))]
    place
}

/// Collides and streams one cell. With `AGAIN` the addresses are computed again for what is written, so that a thread
/// has fewer registers and more threads run at once; which is faster was measured for each kernel
/// (`benches/README.md`).
///
/// # Safety
/// `numbers` must be those of a slab as described, the cell one of its own, and no other thread may have the same cell
/// in this pass.
#[inline(always)]
pub unsafe fn collide<L: Lattice<Q>, C: Collision, S: Stored, const AGAIN: bool, const Q: usize>(
    numbers: *mut S,
    slab: &Slab,
    Place { plane, row, place }: Place,
    operator: &C,
    rates: &C::Rates<f64>,
) {
    let start = plane * slab.plane + row * slab.row + place;
    let mut g = [0.0; Q];
    unroll!(populations i < Q => {
        // SAFETY: a number of this cell, which no other cell has in this pass.
        g[i] = unsafe { <S as Memory<f64>>::load(numbers.add((slab.first[i] + start) as usize)) };
    });
    operator.collide::<L, f64, _, Q>(&mut g, rates);
    let start = if AGAIN { opaque(start) } else { start };
    unroll!(populations i < Q => {
        let to = slab.first[L::OPPOSITE[i]] + start;
        // SAFETY: as above.
        unsafe { <S as Memory<f64>>::store(numbers.add(to as usize), g.incoming(i)) };
    });
}
