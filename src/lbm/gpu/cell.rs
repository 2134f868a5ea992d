//! Pass over one cell, the work of one thread of a GPU.
//!
//! It is separate from the pass over rows of the processor ([`crate::kernel`]), because the registers differ. A thread
//! of a GPU has registers for all populations of a cell and reads them before the first use, so that many loads are in
//! flight at once; on a processor each population is read when it is needed. Both collide with the same operators, in
//! the same order of operations, and write each population to the address from which its opposite was read, so that the
//! bits are the same.

use crate::collision::kernel::{Collision, Site};
use crate::lanes::{Memory, Stored};
use crate::lattice::{Lattice, unroll};

/// Positions of the populations of a slab in one pass, in numbers from the start of the memory. The layout of this
/// struct is the same on the host and on the GPU.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Slab {
    /// Position from which the first cell of row 0 of plane 0 reads each population.
    pub first: [u32; 27],
    /// Distance between planes.
    pub plane: u32,
    /// Distance between rows.
    pub row: u32,
    /// Number of cells of a row.
    pub cells: u32,
}

/// Coordinates of a cell in a slab.
#[derive(Clone, Copy, Debug)]
pub struct CellIndex {
    /// Index of the plane along the slab axis.
    pub plane: u32,
    /// Index of the row in the plane.
    pub row: u32,
    /// Index of the cell in the row.
    pub column: u32,
}

/// Returns an index unchanged, but hides its value from the compiler. The compiler would otherwise keep the addresses
/// of the loads for the stores, which takes a third of the registers of a thread.
#[inline(always)]
pub(super) fn opaque(index: u32) -> u32 {
    #[cfg(target_arch = "nvptx64")]
    {
        let mut index = index;
        // SAFETY: the instruction copies a register to itself.
        unsafe {
            core::arch::asm!("mov.u32 {0}, {0};", inout(reg32) index, options(nomem, nostack, preserves_flags));
        }
        index
    }
    #[cfg(not(target_arch = "nvptx64"))]
    index
}

/// Collides and streams one cell. With `RECOMPUTE` the addresses are computed again for the stores, so that a thread
/// needs fewer registers and more threads run at once. Each kernel uses the faster variant, as measured
/// (`benches/README.md`).
///
/// # Safety
/// `numbers` must be the populations of the slab that `slab` describes, the cell must be one of this slab, and no other
/// thread may work on the same cell in this pass.
#[inline(always)]
pub unsafe fn collide<
    L: Lattice<Q>,
    C: Collision,
    S: Stored,
    const RECOMPUTE: bool,
    const Q: usize,
>(
    numbers: *mut S,
    slab: &Slab,
    CellIndex { plane, row, column }: CellIndex,
    operator: &C,
    rates: &C::Rates<f64>,
) {
    let start = plane * slab.plane + row * slab.row + column;
    let mut g = [0.0; Q];
    unroll!(populations i < Q => {
        // SAFETY: only this cell accesses the number in this pass.
        g[i] = unsafe { <S as Memory<f64>>::load(numbers.add((slab.first[i] + start) as usize)) };
    });
    operator.collide::<L, f64, _, Q>(&mut g, rates);
    let start = if RECOMPUTE { opaque(start) } else { start };
    unroll!(populations i < Q => {
        let to = slab.first[L::OPPOSITE[i]] + start;
        // SAFETY: as for the loads.
        unsafe { <S as Memory<f64>>::store(numbers.add(to as usize), g.incoming(i)) };
    });
}
