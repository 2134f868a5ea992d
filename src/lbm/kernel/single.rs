//! Fused pass with arithmetic in f32, for open cells with a uniform viscosity.
//!
//! It is separate from the pass in f64 ([`super::pass`]), because covered cells and eddy viscosities are computed in
//! f64 only.

use super::{LINE, Pass, Row, Shared, Update, ahead_of_each};
use crate::block::RowBlock;
use crate::collision::Collision;
use crate::lanes::{Lanes, Level, Memory};
use crate::lattice::{Lattice, unroll};
#[cfg(target_arch = "x86_64")]
use crate::single::{Avx2Single, Avx512Single};
use crate::turbulence::Resolved;

/// Returns the pass in f32 for a lattice, an operator and an instruction set.
pub(crate) fn choose<L: Lattice<Q>, C: Collision, const Q: usize>(
    level: Level,
) -> Pass<f32, C, Resolved> {
    match level {
        Level::Scalar => scalar::<L, C, Q>,
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => avx2::<L, C, Q>,
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => avx512::<L, C, Q>,
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2<L: Lattice<Q>, C: Collision, const Q: usize>(
    shared: &Shared<f32>,
    update: &Update<C, Resolved>,
    block: &RowBlock,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, Avx2Single, Q>(shared, update, block) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma")]
unsafe fn avx512<L: Lattice<Q>, C: Collision, const Q: usize>(
    shared: &Shared<f32>,
    update: &Update<C, Resolved>,
    block: &RowBlock,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, Avx512Single, Q>(shared, update, block) }
}

unsafe fn scalar<L: Lattice<Q>, C: Collision, const Q: usize>(
    shared: &Shared<f32>,
    update: &Update<C, Resolved>,
    block: &RowBlock,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, f32, Q>(shared, update, block) }
}

/// Collides and streams the rows of a block in place.
///
/// # Safety
/// No other thread may work on the same rows, the slab must contain them, and the processor must support the
/// instructions of `N`.
#[inline(always)]
unsafe fn pass<L: Lattice<Q>, C: Collision, N: Lanes, const Q: usize>(
    shared: &Shared<f32>,
    update: &Update<C, Resolved>,
    block: &RowBlock,
) where
    f32: Memory<N>,
{
    // A copy on the stack, which no other code can change, keeps the operator's rates in registers.
    let collision = update.collision;
    let rates = collision.uniform::<N>();
    let along = shared.along::<L, Q>();
    for plane in block.planes.clone() {
        for row in block.rows.clone() {
            let start = plane * shared.plane + row * shared.row;
            // SAFETY: promised by the caller.
            let spans = unsafe { shared.spans(plane, row) };
            if spans.is_empty() {
                continue;
            }
            for &[begin, end] in spans {
                let (mut k, end) = (begin as usize, end as usize);
                let mut at = shared.addresses::<L, Q>(start + k);
                while k < end {
                    let mut along = along;
                    super::opaque(&mut along);
                    // SAFETY: a row has capacity for whole vectors (populations: pitch), ghosts included; no other
                    // thread works on it.
                    let mut site = unsafe { Row::<L, f32, Q>::new(&at, along) };
                    if !const { ahead_of_each::<f32, N>() }
                        && k.is_multiple_of(LINE / size_of::<f32>())
                    {
                        unroll!(populations i < Q => {
                            site.prefetch(i);
                        });
                    }
                    collision.collide::<L, N, _, Q>(&mut site, &rates);
                    k += N::WIDTH;
                    unroll!(nine n < 9 => {
                        at[n] = at[n].wrapping_add(N::WIDTH);
                    });
                }
            }
            // SAFETY: the row is done, and no other thread works on it.
            unsafe { shared.wrap_row(start) };
        }
    }
}
