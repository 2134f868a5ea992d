//! The fused pass: load every population of a row of cells, collide in registers, store every population.
//!
//! The even and the odd pass are the same code: population i is read at `positions[i]` and the outgoing i is written
//! where its opposite was read ([`super::populations`]). Rows are rounded up to whole vectors; the surplus cells lie
//! in ghosts and padding, whose contents the boundaries renew after every pass.

use super::collision::Collision;
use super::lanes::{Level, Memory, Stored};
use super::lattice::{Lattice, unroll};
use super::populations::Populations;
use std::ops::Range;

/// One pass over some planes of a slab, chosen once at start for lattice, operator, storage and processor.
pub type Pass<S, C> = unsafe fn(&Shared<S>, &C, Range<usize>);

/// What the threads of one pass share.
pub struct Shared<S> {
    base: *mut S,
    /// Position read for each population by the row at plane 0, row 0.
    first: [usize; 27],
    plane: usize,
    row: usize,
    rows: usize,
    cells: usize,
}

// SAFETY: in one pass each number is read and written by exactly one cell (see `populations`), and each plane of
// cells is given to one thread, so no two threads touch the same number.
unsafe impl<S> Sync for Shared<S> {}

impl<S: Stored> Shared<S> {
    /// Describes the coming pass over `populations`.
    pub(crate) fn new<const Q: usize>(populations: &mut Populations<S>) -> Self {
        let [slow, middle, fast] = populations.order();
        let cells = populations.cells();
        let unit = |axis: usize| {
            let mut at = [0; 3];
            at[axis] = 1;
            populations.cell(at) - populations.cell([0; 3])
        };
        let positions: [usize; Q] = populations.row_positions(populations.cell([0; 3]));
        let mut first = [0; 27];
        first[..Q].copy_from_slice(&positions);
        Self {
            plane: unit(slow),
            row: unit(middle),
            rows: cells[middle],
            cells: cells[fast],
            first,
            base: populations.base(),
        }
    }
}

/// The pass for this lattice, operator, storage and level.
#[must_use]
pub fn choose<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(level: Level) -> Pass<S, C> {
    match level {
        Level::Scalar => scalar::<L, C, S, Q>,
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => S::avx2::<L, C, Q>(),
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => S::avx512::<L, C, Q>(),
    }
}

/// A number at rest for which the pass exists at every level: vector code cannot be written over an unknown type of number,
/// so each says how it is loaded.
pub trait OnEveryLevel: Sized {
    /// Pass with AVX2 lanes.
    #[cfg(target_arch = "x86_64")]
    fn avx2<L: Lattice<Q>, C: Collision, const Q: usize>() -> Pass<Self, C>;
    /// Pass with AVX-512 lanes.
    #[cfg(target_arch = "x86_64")]
    fn avx512<L: Lattice<Q>, C: Collision, const Q: usize>() -> Pass<Self, C>;
}

macro_rules! on_every_level {
    ($stored:ty, $avx2:ident, $avx512:ident) => {
        impl OnEveryLevel for $stored {
            #[cfg(target_arch = "x86_64")]
            fn avx2<L: Lattice<Q>, C: Collision, const Q: usize>() -> Pass<$stored, C> {
                $avx2::<L, C, Q>
            }
            #[cfg(target_arch = "x86_64")]
            fn avx512<L: Lattice<Q>, C: Collision, const Q: usize>() -> Pass<$stored, C> {
                $avx512::<L, C, Q>
            }
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        unsafe fn $avx2<L: Lattice<Q>, C: Collision, const Q: usize>(
            shared: &Shared<$stored>,
            collision: &C,
            planes: Range<usize>,
        ) {
            // SAFETY: forwarded from the caller.
            unsafe { pass::<L, C, $stored, super::lanes::Avx2, Q>(shared, collision, planes) }
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx2,fma")]
        unsafe fn $avx512<L: Lattice<Q>, C: Collision, const Q: usize>(
            shared: &Shared<$stored>,
            collision: &C,
            planes: Range<usize>,
        ) {
            // SAFETY: forwarded from the caller.
            unsafe { pass::<L, C, $stored, super::lanes::Avx512, Q>(shared, collision, planes) }
        }
    };
}
on_every_level!(f64, avx2_f64, avx512_f64);
on_every_level!(f32, avx2_f32, avx512_f32);

unsafe fn scalar<L: Lattice<Q>, C: Collision, S: Stored, const Q: usize>(
    shared: &Shared<S>,
    collision: &C,
    planes: Range<usize>,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, S, f64, Q>(shared, collision, planes) }
}

/// # Safety
/// No other thread may work on the same planes, and the processor must offer the instructions of `N`.
#[inline(always)]
unsafe fn pass<L, C, S, N, const Q: usize>(shared: &Shared<S>, collision: &C, planes: Range<usize>)
where
    L: Lattice<Q>,
    C: Collision,
    S: Memory<N>,
    N: super::lanes::Lanes,
{
    // A copy on the stack that nothing else can change keeps the operator's rates in registers.
    let collision = *collision;
    let rates = collision.uniform::<N>();
    for plane in planes {
        for row in 0..shared.rows {
            let start = plane * shared.plane + row * shared.row;
            let mut at = [std::ptr::null_mut::<S>(); Q];
            unroll!(populations i < Q => {
                // SAFETY: `first` are positions inside the array for the first row, and the row lies in the slab.
                at[i] = unsafe { shared.base.add(shared.first[i] + start) };
            });
            let mut k = 0;
            while k < shared.cells {
                let mut g = [N::splat(0.0); Q];
                unroll!(populations i < Q => {
                    // SAFETY: a row has room for whole vectors (populations: pitch), ghosts included.
                    g[i] = unsafe { S::load(at[i].add(k)) };
                });
                collision.collide::<L, N, Q>(&mut g, &rates);
                unroll!(populations i < Q => {
                    // SAFETY: as for the load; the opposite of i was read here.
                    unsafe { S::store(at[L::OPPOSITE[i]].add(k), g[i]) };
                });
                k += N::WIDTH;
            }
        }
    }
}
