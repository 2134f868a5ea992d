//! The fused pass: collide the cells of a row where they lie, each population read and its successor written once it is known.
//!
//! The even and the odd pass are the same code: population i is read at `positions[i]` and the outgoing i is written
//! where its opposite was read ([`super::populations`]). Rows are rounded up to whole vectors; the surplus cells lie
//! in ghosts and padding, whose contents the boundaries renew after every pass.

use super::collision::{Collision, Site};
use super::lanes::{Level, Memory, Stored};
use super::lattice::{Lattice, unroll};
use super::populations::Populations;
use super::saturation::{self, Place, Solids};
use super::turbulence::{Eddies, View};
use std::marker::PhantomData;
use std::ops::Range;

/// Cache lines ahead of the cells at work that are asked for. The work on a vector of cells of 19 or 27 populations is longer than what the
/// processor looks ahead, so without asking it would wait for every line; nine populations it sees coming.
const LINES_AHEAD: usize = 4;
/// Bytes of a cache line.
const LINE: usize = 64;
/// Bytes from the cells at work to those that are asked for.
const AHEAD: usize = LINES_AHEAD * LINE;

/// Whether each vector of a population is whole cache lines, so that the next ones are asked for as it is read: the address is
/// at hand then. Else they are asked for once a line.
const fn ahead_of_each<S, N: super::lanes::Lanes, const Q: usize>() -> bool {
    Q > 9 && (N::WIDTH * size_of::<S>()).is_multiple_of(LINE)
}

/// What happens to a cell: an operator with an eddy viscosity.
#[derive(Clone, Copy, Debug)]
pub struct Update<C, T> {
    /// The operator.
    pub collision: C,
    /// Eddy viscosity.
    pub eddies: T,
    /// Viscosity of the fluid itself, lattice units.
    pub viscosity: f64,
    /// Which worker this is, from 0.
    pub worker: usize,
}

/// One pass over some planes of a slab, chosen once at start for lattice, operator, eddies, solids, storage and processor.
pub type Pass<S, C, T> = unsafe fn(&Shared<S>, &Update<C, T>, Range<usize>);

/// What the threads of one pass share.
pub struct Shared<S> {
    base: *mut S,
    /// Position read for each population by the row at plane 0, row 0.
    first: [usize; 27],
    plane: usize,
    row: usize,
    rows: usize,
    cells: usize,
    velocity: View,
    cover: saturation::View,
}

// SAFETY: in one pass each number is read and written by exactly one cell (see `populations`), and each plane of
// cells is given to one thread, so no two threads touch the same number; sums over bodies are one for each worker.
unsafe impl<S> Sync for Shared<S> {}

impl<S: Stored> Shared<S> {
    /// Describes the coming pass over `populations`.
    pub(crate) fn new<const Q: usize>(
        populations: &mut Populations<S>,
        velocity: View,
        cover: saturation::View,
    ) -> Self {
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
            velocity,
            cover,
        }
    }
}

/// The pass for this lattice, operator, storage and level.
#[must_use]
pub fn choose<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, S: Stored, const Q: usize>(
    level: Level,
) -> Pass<S, C, T> {
    match level {
        Level::Scalar => scalar::<L, C, T, P, S, Q>,
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => S::avx2::<L, C, T, P, Q>(),
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => S::avx512::<L, C, T, P, Q>(),
    }
}

/// A number at rest for which the pass exists at every level: vector code cannot be written over an unknown type of number,
/// so each says how it is loaded.
pub trait OnEveryLevel: Sized {
    /// Pass with AVX2 lanes.
    #[cfg(target_arch = "x86_64")]
    fn avx2<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, const Q: usize>() -> Pass<Self, C, T>;
    /// Pass with AVX-512 lanes.
    #[cfg(target_arch = "x86_64")]
    fn avx512<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, const Q: usize>()
    -> Pass<Self, C, T>;
}

macro_rules! on_every_level {
    ($stored:ty, $avx2:ident, $avx512:ident) => {
        impl OnEveryLevel for $stored {
            #[cfg(target_arch = "x86_64")]
            fn avx2<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, const Q: usize>()
            -> Pass<$stored, C, T> {
                $avx2::<L, C, T, P, Q>
            }
            #[cfg(target_arch = "x86_64")]
            fn avx512<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, const Q: usize>()
            -> Pass<$stored, C, T> {
                $avx512::<L, C, T, P, Q>
            }
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        unsafe fn $avx2<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, const Q: usize>(
            shared: &Shared<$stored>,
            update: &Update<C, T>,
            planes: Range<usize>,
        ) {
            // SAFETY: forwarded from the caller.
            unsafe { pass::<L, C, T, P, $stored, super::lanes::Avx2, Q>(shared, update, planes) }
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx2,fma")]
        unsafe fn $avx512<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, const Q: usize>(
            shared: &Shared<$stored>,
            update: &Update<C, T>,
            planes: Range<usize>,
        ) {
            // SAFETY: forwarded from the caller.
            unsafe { pass::<L, C, T, P, $stored, super::lanes::Avx512, Q>(shared, update, planes) }
        }
    };
}
on_every_level!(f64, avx2_f64, avx512_f64);
on_every_level!(f32, avx2_f32, avx512_f32);

unsafe fn scalar<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, S: Stored, const Q: usize>(
    shared: &Shared<S>,
    update: &Update<C, T>,
    planes: Range<usize>,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, T, P, S, f64, Q>(shared, update, planes) }
}

/// Some cells of a row on the lattice.
struct Row<'a, L, S, const Q: usize> {
    at: &'a [*mut S; Q],
    k: usize,
    lattice: PhantomData<L>,
}

impl<'a, L, S, const Q: usize> Row<'a, L, S, Q> {
    /// # Safety
    /// From each of `at` on, `k` and a vector more must be numbers that nobody else reads or writes.
    #[inline(always)]
    unsafe fn new(at: &'a [*mut S; Q], k: usize) -> Self {
        Self {
            at,
            k,
            lattice: PhantomData,
        }
    }
}

impl<L: Lattice<Q>, S: Memory<N>, N: super::lanes::Lanes, const Q: usize> Site<N, Q>
    for Row<'_, L, S, Q>
{
    #[inline(always)]
    fn incoming(&self, i: usize) -> N {
        if const { ahead_of_each::<S, N, Q>() } {
            prefetch(self.at[i].wrapping_add(self.k + AHEAD / size_of::<S>()));
        }
        // SAFETY: promised to `new`.
        unsafe { S::load(self.at[i].add(self.k)) }
    }
    #[inline(always)]
    fn leave(&mut self, i: usize, outgoing: N) {
        // SAFETY: promised to `new`.
        unsafe { S::store(self.at[L::OPPOSITE[i]].add(self.k), outgoing) }
    }
}

/// Asks for a cache line; any address will do.
#[inline(always)]
pub(in crate::lbm) fn prefetch<S>(line: *const S) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = line;
}

/// # Safety
/// No other thread may work on the same planes, and the processor must offer the instructions of `N`.
#[inline(always)]
unsafe fn pass<L, C, T, P, S, N, const Q: usize>(
    shared: &Shared<S>,
    update: &Update<C, T>,
    planes: Range<usize>,
) where
    L: Lattice<Q>,
    C: Collision,
    T: Eddies,
    P: Solids,
    S: Memory<N>,
    f32: Memory<N>,
    f64: Memory<N>,
    N: super::lanes::Lanes,
{
    // A copy on the stack that nothing else can change keeps the operator's rates in registers.
    let Update {
        collision,
        eddies,
        viscosity,
        worker,
    } = *update;
    let velocity = shared.velocity;
    let cover = shared.cover;
    let mut omega = N::splat(1.0 / 3.0_f64.mul_add(viscosity, 0.5));
    let mut rates = collision.uniform::<N>();
    for plane in planes {
        for row in 0..shared.rows {
            let start = plane * shared.plane + row * shared.row;
            let mut at = [std::ptr::null_mut::<S>(); Q];
            unroll!(populations i < Q => {
                // SAFETY: `first` are positions inside the array for the first row, and the row lies in the slab.
                at[i] = unsafe { shared.base.add(shared.first[i] + start) };
            });
            // Population 0 is at its cell, so that its position is that of the cell in other arrays too.
            let cell = shared.first[0] + start;
            let mut k = 0;
            while k < shared.cells {
                if T::ACTIVE && eddies.present() {
                    // SAFETY: an interior cell.
                    let gradient = unsafe { velocity.gradient::<N>(cell + k) };
                    omega = eddies.rate(viscosity, &gradient);
                    rates = collision.local(omega);
                }
                if Q > 9 && k.is_multiple_of(LINE / size_of::<S>()) {
                    if !const { ahead_of_each::<S, N, Q>() } {
                        unroll!(populations i < Q => {
                            prefetch(at[i].wrapping_add(k + AHEAD / size_of::<S>()));
                        });
                    }
                    if T::ACTIVE && eddies.present() {
                        velocity.prefetch(cell + k, AHEAD / size_of::<S>());
                    }
                }
                // SAFETY: a row has room for whole vectors (populations: pitch), ghosts included; no other thread works on it.
                let mut site = unsafe { Row::<L, S, Q>::new(&at, k) };
                // SAFETY: an interior cell.
                let u = if P::ACTIVE && unsafe { cover.covers::<N>(cell + k) } {
                    let mut before = [N::splat(0.0); Q];
                    unroll!(populations i < Q => {
                        before[i] = site.incoming(i);
                    });
                    let mut g = before;
                    let u = collision.collide::<L, N, _, Q>(&mut g, &rates);
                    let place = Place {
                        cell: cell + k,
                        at: [plane, row, k],
                        worker,
                    };
                    // SAFETY: an interior cell; no other thread is this worker.
                    let u = unsafe { cover.mix::<L, N, Q>(place, &before, &mut g, u, omega) };
                    unroll!(populations i < Q => {
                        site.leave(i, g[i]);
                    });
                    u
                } else {
                    collision.collide::<L, N, _, Q>(&mut site, &rates)
                };
                if T::ACTIVE && eddies.present() {
                    // SAFETY: this cell is ours, and ghosts are renewed after the pass.
                    unsafe { velocity.leave(cell + k, u) };
                }
                k += N::WIDTH;
            }
        }
    }
}
