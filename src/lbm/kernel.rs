//! Fused pass of collision and streaming over rows of cells, in place.
//!
//! It is separate from the layout of the memory ([`super::populations`]), from which it takes the addresses of a row.
//! The even and the odd pass have the same code: incoming population i is read at the position of i for this pass, and
//! outgoing population i is written to the position from which its opposite was read. Rows are rounded up to whole
//! vectors. The surplus cells are ghosts and padding, whose contents the boundaries reset after every pass.

pub(crate) mod single;

use super::block::RowBlock;
use super::collision::{Collision, Site};
use super::lanes::{Level, Memory, Stored, prefetch};
use super::lattice::{Lattice, unroll};
use super::populations::{ACROSS, Populations};
use super::saturation::Solids;
use super::saturation::pass::{Covers, Place, View as CoverView};
use super::surface::lists::Plane as WetPlane;
use super::turbulence::Eddies;
use super::turbulence::field::View;
use base::number::to_u32;
use std::marker::PhantomData;
use std::ops::Range;

/// Size of a cache line in bytes.
const LINE: usize = 64;

/// Returns the prefetch distance in bytes. With 19 or 27 populations, the processor alone does not load the next
/// vectors during the long work on a vector of cells. With nine populations, the hardware prefetches, but not beyond
/// the end of a page of 4 KiB: a distance of 512 bytes makes a lattice of 2400² cells 15 % faster on slow memory, and
/// does not change the speed of a lattice in the cache.
const fn bytes_ahead<const Q: usize>() -> usize {
    if Q > 9 { 4 * LINE } else { 8 * LINE }
}

/// Returns `true` if each vector of a population consists of whole cache lines. In this case each load prefetches later
/// lines, since the address is available; otherwise they are prefetched once per line.
const fn ahead_of_each<S, N: super::lanes::Lanes>() -> bool {
    (N::WIDTH * size_of::<S>()).is_multiple_of(LINE)
}

/// Update of a cell: an operator with an eddy viscosity.
#[derive(Clone, Copy, Debug)]
pub struct Update<C, T> {
    /// Collision operator.
    pub collision: C,
    /// Model of the eddy viscosity.
    pub eddies: T,
    /// Viscosity of the fluid without eddy viscosity, in lattice units.
    pub viscosity: f64,
    /// Number of the worker, from 0.
    pub worker: usize,
}

/// Pass over a block of rows, selected once at the start for lattice, operator, eddy viscosity, solids, storage type
/// and instruction set.
pub type Pass<S, C, T> = unsafe fn(&Shared<S>, &Update<C, T>, &RowBlock);

/// Data that the threads of one pass share.
pub struct Shared<S> {
    /// Start of the memory of the populations.
    base: *mut S,
    /// Position from which the first cell of row 0 of plane 0 reads each population.
    first: [usize; 27],
    /// Distances in positions between planes and between rows.
    plane: usize,
    row: usize,
    /// Number of rows of a plane, and of cells of a row.
    rows: usize,
    cells: usize,
    /// Velocities that the eddy viscosity needs, and the cover of the cells by solids.
    velocity: View,
    cover: CoverView,
    /// Range of the cells of a whole row, which the pass collides without a free surface.
    whole: [u32; 2],
    /// Wet parts of the rows of each plane; null without a free surface.
    wet: *const WetPlane,
    /// Positions from which the first cell of the first row reads the populations that stream in the direction of the
    /// rows and against it, if this axis is periodic.
    around: [Vec<usize>; 2],
}

// SAFETY: in one pass each number is read and written by exactly one cell (see `populations`), and each row of
// cells belongs to one thread, so that no two threads access the same number; sums over bodies are separate for
// each worker.
unsafe impl<S> Sync for Shared<S> {}

impl<S> Shared<S> {
    /// Returns the numbers of all populations.
    pub(crate) fn numbers(&self) -> *mut S {
        self.base
    }

    /// Returns the velocities that the pass reads and writes.
    pub(crate) fn velocity(&self) -> &View {
        &self.velocity
    }

    /// Returns the number of rows of a plane.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the number of cells of a row.
    pub(crate) fn cells(&self) -> usize {
        self.cells
    }

    /// Limits the pass to the cells with water. The lists of the planes must not change during the pass.
    pub(crate) fn only_wet(mut self, planes: &[WetPlane]) -> Self {
        self.wet = planes.as_ptr();
        self
    }

    /// Returns the parts of a row that the pass collides.
    ///
    /// # Safety
    /// The slab must contain the row.
    #[inline(always)]
    unsafe fn spans(&self, plane: usize, row: usize) -> &[[u32; 2]] {
        if self.wet.is_null() {
            std::slice::from_ref(&self.whole)
        } else {
            // SAFETY: there are lists for each plane, which are valid during the pass.
            unsafe { (*self.wet.add(plane)).spans(row) }
        }
    }

    /// Returns the block of all rows of some planes.
    pub(crate) fn planes(&self, planes: Range<usize>) -> RowBlock {
        RowBlock {
            planes,
            rows: 0..self.rows,
        }
    }

    /// Returns the distances in positions from a population with c_x = 0 to those with c_x = 1 and -1 and the same c_y
    /// and c_z.
    #[inline(always)]
    fn along<L: Lattice<Q>, const Q: usize>(&self) -> [isize; 2] {
        let [ahead, behind] = Places::<L, Q>::ALONG.map(|i| self.first[i]);
        [
            ahead.wrapping_sub(self.first[0]).cast_signed(),
            behind.wrapping_sub(self.first[0]).cast_signed(),
        ]
    }

    /// Returns the addresses of the populations with c_x = 0 of the cell that is `distance` positions after the first
    /// one. The loop increments them from cell to cell; each population is at one of them, or at a distance of
    /// [`Self::along`] from it.
    #[inline(always)]
    fn addresses<L: Lattice<Q>, const Q: usize>(&self, distance: usize) -> [*mut S; 9] {
        let mut at = [std::ptr::null_mut::<S>(); 9];
        unroll!(nine n < 9 => {
            let first = self.first[Places::<L, Q>::FIRST[n]];
            at[n] = self.base.wrapping_add(first + distance);
        });
        at
    }

    /// Applies periodicity at the ends of the row that starts `start` positions after the first one.
    ///
    /// A population that the first cell writes for the cell before it is copied to the cell after the last one, and
    /// vice versa. After an even pass the copies fill the ghosts of the row; after an odd pass they bring populations
    /// from the ghosts to the cells. The addresses are the same in both cases.
    ///
    /// # Safety
    /// The cells of the row must have collided, and no other thread may access them.
    #[inline(always)]
    unsafe fn wrap_row(&self, start: usize) {
        let row = self.base.wrapping_add(start);
        let [forth, back] = &self.around;
        for &first in forth {
            let at = row.wrapping_add(first);
            // SAFETY: the numbers belong to the first cell and to the one after the last, and to no other cell.
            unsafe { at.add(self.cells).write(at.read()) };
        }
        for &first in back {
            let at = row.wrapping_add(first);
            // SAFETY: the numbers belong to the last cell and to the one before the first.
            unsafe { at.sub(1).write(at.add(self.cells - 1).read()) };
        }
    }
}

impl<S: Stored> Shared<S> {
    /// Describes the next pass over `populations`; `round` is `true` if the axis of the rows is periodic.
    pub(crate) fn new<const Q: usize>(
        populations: &mut Populations<S>,
        velocity: View,
        cover: CoverView,
        round: bool,
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
        let streams = |sign: i8| {
            let c = &populations.velocities().c;
            let along = (0..Q).filter(|&i| round && c[i][fast] == sign);
            along.map(|i| positions[i]).collect()
        };
        let around = [streams(1), streams(-1)];
        Self {
            plane: unit(slow),
            row: unit(middle),
            rows: cells[middle],
            cells: cells[fast],
            first,
            base: populations.base(),
            velocity,
            cover,
            whole: [0, to_u32(cells[fast])],
            wet: std::ptr::null(),
            around,
        }
    }
}

/// Returns the pass for a lattice, an operator, an eddy viscosity, solids, a storage type and an instruction set.
#[must_use]
pub fn choose<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, S: Stored, const Q: usize>(
    level: Level,
) -> Pass<S, C, T> {
    match level {
        Level::Scalar => scalar::<L, C, T, P, S, Q>,
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => avx2::<L, C, T, P, S, Q>,
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => avx512::<L, C, T, P, S, Q>,
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, S: Stored, const Q: usize>(
    shared: &Shared<S>,
    update: &Update<C, T>,
    block: &RowBlock,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, T, P, S, super::lanes::Avx2, Q>(shared, update, block) }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma")]
unsafe fn avx512<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, S: Stored, const Q: usize>(
    shared: &Shared<S>,
    update: &Update<C, T>,
    block: &RowBlock,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, T, P, S, super::lanes::Avx512, Q>(shared, update, block) }
}

unsafe fn scalar<L: Lattice<Q>, C: Collision, T: Eddies, P: Solids, S: Stored, const Q: usize>(
    shared: &Shared<S>,
    update: &Update<C, T>,
    block: &RowBlock,
) {
    // SAFETY: forwarded from the caller.
    unsafe { pass::<L, C, T, P, S, f64, Q>(shared, update, block) }
}

/// Populations of the current cells: an address for each (c_y, c_z) of [`ACROSS`], and the distances from there to the
/// populations with c_x = 1 and -1 (see [`super::populations`]).
struct Row<'a, L, S, const Q: usize> {
    at: &'a [*mut S; 9],
    along: [isize; 2],
    lattice: PhantomData<L>,
}

/// Tables from the velocities of a set to their arrays in memory.
struct Places<L, const Q: usize>(PhantomData<L>);

impl<L: Lattice<Q>, const Q: usize> Places<L, Q> {
    /// Index of (c_y, c_z) of each population in [`ACROSS`].
    const ACROSS: [usize; Q] = {
        let mut places = [0; Q];
        let mut i = 0;
        while i < Q {
            let c = L::C[i];
            let mut n = 0;
            while ACROSS[n][0] != c[1] || ACROSS[n][1] != c[2] {
                n += 1;
            }
            places[i] = n;
            i += 1;
        }
        places
    };
    /// Population with c_x = 0 for each of [`ACROSS`]; the rest population if the set has none.
    const FIRST: [usize; 9] = {
        let mut first = [0; 9];
        let mut i = 0;
        while i < Q {
            if L::C[i][0] == 0 {
                first[Self::ACROSS[i]] = i;
            }
            i += 1;
        }
        first
    };
    /// Populations along x and against x.
    const ALONG: [usize; 2] = {
        let mut along = [0; 2];
        let mut i = 0;
        while i < Q {
            if Self::ACROSS[i] == 0 && L::C[i][0] != 0 {
                along[if L::C[i][0] > 0 { 0 } else { 1 }] = i;
            }
            i += 1;
        }
        along
    };
}

impl<'a, L: Lattice<Q>, S, const Q: usize> Row<'a, L, S, Q> {
    /// Returns access to the populations at the addresses `at` and at the distances `along` from them.
    ///
    /// # Safety
    /// At each of these addresses there must be a vector of numbers that no other thread reads or writes.
    #[inline(always)]
    unsafe fn new(at: &'a [*mut S; 9], along: [isize; 2]) -> Self {
        Self {
            at,
            along,
            lattice: PhantomData,
        }
    }

    /// Returns the address at which population i is read.
    #[inline(always)]
    fn address(&self, i: usize) -> *mut S {
        let c = L::C[i];
        let base = self.at[Places::<L, Q>::ACROSS[i]];
        match c[0] {
            0 => base,
            1 => base.wrapping_offset(self.along[0]),
            _ => base.wrapping_offset(self.along[1]),
        }
    }

    /// Returns the population that [`Site::leave`] wrote along i.
    #[inline(always)]
    fn outgoing<N: super::lanes::Lanes>(&self, i: usize) -> N
    where
        S: Memory<N>,
    {
        // SAFETY: promised to `new`.
        unsafe { <S as Memory<N>>::load(self.address(L::OPPOSITE[i])) }
    }

    /// Prefetches the cache line of population i that is needed some vectors later.
    #[inline(always)]
    fn prefetch(&self, i: usize) {
        prefetch(
            self.address(i)
                .wrapping_add(bytes_ahead::<Q>() / size_of::<S>()),
        );
    }
}

impl<L: Lattice<Q>, S: Memory<N>, N: super::lanes::Lanes, const Q: usize> Site<N, Q>
    for Row<'_, L, S, Q>
{
    #[inline(always)]
    fn incoming(&self, i: usize) -> N {
        if const { ahead_of_each::<S, N>() } {
            self.prefetch(i);
        }
        // SAFETY: promised to `new`.
        unsafe { <S as Memory<N>>::load(self.address(i)) }
    }
    #[inline(always)]
    fn leave(&mut self, i: usize, outgoing: N) {
        // SAFETY: promised to `new`.
        unsafe { <S as Memory<N>>::store(self.address(L::OPPOSITE[i]), outgoing) }
    }
}

/// Hides from the compiler that the distances are constant in the loop. The compiler would otherwise compute 27
/// addresses from nine before the loop, and load most of them from the stack in every iteration. Miri has no assembly.
#[inline(always)]
fn opaque(along: &mut [isize; 2]) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        let [a, b] = along;
        // SAFETY: the assembly contains no instruction.
        unsafe {
            std::arch::asm!(
                "/* {} {} */",
                inout(reg) * a,
                inout(reg) * b,
                options(nomem, nostack, preserves_flags)
            );
        }
    }
    #[cfg(any(miri, not(target_arch = "x86_64")))]
    let _ = along;
}

/// Largest number of vectors of cells whose relaxation rates are computed before they collide ([`batch_of`]).
const BATCH: usize = 16;

/// Returns the number of vectors of cells whose relaxation rates are computed one after the other, before they collide.
/// The roots and divisions of a rate take as long as a collision, and those of several vectors overlap. With 27
/// populations the loads of the collision fill this time.
const fn batch_of<const Q: usize>() -> usize {
    if Q == 27 { 1 } else { BATCH }
}

/// Returns the rate ω of the shear stress of a vector of cells, with their eddy viscosity, and the rates of the
/// operator: those of the cells `at` in the row that begins at position `row`, in the part `part` of the row. They come
/// from `batch`, which the first vector of a batch fills.
///
/// # Safety
/// The cells must be interior cells, with capacity for whole vectors after them.
#[inline(always)]
unsafe fn rates_of<L, C, T, N, const Q: usize>(
    update: &Update<C, T>,
    velocity: &View,
    (row, at, part): (usize, usize, &Range<usize>),
    batch: &mut [(N, C::Rates<N>); BATCH],
) -> (N, C::Rates<N>)
where
    L: Lattice<Q>,
    C: Collision,
    T: Eddies,
    N: super::lanes::Lanes,
    f32: Memory<N>,
    f64: Memory<N>,
{
    let (length, place) = (const { batch_of::<Q>() }, (at - part.start) / N::WIDTH);
    if length == 1 {
        // SAFETY: the caller's promise.
        return unsafe { relaxation::<L, C, T, N, Q>(update, velocity, row + at) };
    }
    if place.is_multiple_of(length) {
        for (rates, at) in batch.iter_mut().zip((at..part.end).step_by(N::WIDTH)) {
            // SAFETY: the caller's promise.
            *rates = unsafe { relaxation::<L, C, T, N, Q>(update, velocity, row + at) };
        }
    }
    batch[place % length]
}

/// Returns the rate ω of the shear stress, with the eddy viscosity, and the rates of the operator for the vector of
/// cells at position `cell`.
///
/// # Safety
/// The conditions are those of [`rates_of`].
#[inline(always)]
unsafe fn relaxation<L, C, T, N, const Q: usize>(
    update: &Update<C, T>,
    velocity: &View,
    cell: usize,
) -> (N, C::Rates<N>)
where
    L: Lattice<Q>,
    C: Collision,
    T: Eddies,
    N: super::lanes::Lanes,
    f32: Memory<N>,
    f64: Memory<N>,
{
    // SAFETY: the caller's promise.
    let gradient = unsafe { velocity.gradient::<N>(cell, L::DIMENSION) };
    let omega = update.eddies.rate(update.viscosity, &gradient);
    (omega, update.collision.local(omega))
}

/// Collides and streams the rows of a block in place.
///
/// # Safety
/// No other thread may work on the same rows, the slab must contain them, and the processor must support the
/// instructions of `N`.
#[inline(always)]
unsafe fn pass<L, C, T, P, S, N, const Q: usize>(
    shared: &Shared<S>,
    update: &Update<C, T>,
    block: &RowBlock,
) where
    L: Lattice<Q>,
    C: Collision,
    T: Eddies,
    P: Solids,
    S: Memory<N>,
    f32: Memory<N>,
    f64: Memory<N>,
    N: Covers,
{
    // A copy on the stack, which no other code can change, keeps the operator's rates in registers.
    let update = *update;
    let collision = update.collision;
    let velocity = shared.velocity;
    let cover = shared.cover;
    let sums = cover.sums_of(update.worker);
    let mut omega = N::splat(1.0 / 3.0_f64.mul_add(update.viscosity, 0.5));
    let mut rates = collision.uniform::<N>();
    let turbulent = T::ACTIVE && update.eddies.present();
    let mut batch = [(omega, rates); BATCH];
    let along = shared.along::<L, Q>();
    // Buffers for covered cells: incoming populations, populations after the fluid collision, and outgoing
    // populations. They are created once, because clearing them takes time.
    let [mut before, mut fluid, mut g] = [[N::splat(0.0); Q]; 3];
    for plane in block.planes.clone() {
        for row in block.rows.clone() {
            let start = plane * shared.plane + row * shared.row;
            // Population 0 is stored at its cell, so that its position is that of the cell in other arrays too.
            let cell = shared.first[0] + start;
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
                    opaque(&mut along);
                    // SAFETY: a row has capacity for whole vectors (populations: pitch), ghosts included; no other
                    // thread works on it.
                    let mut site = unsafe { Row::<L, S, Q>::new(&at, along) };
                    if turbulent {
                        let at = (cell, k, &(begin as usize..end));
                        // SAFETY: interior cells.
                        (omega, rates) = unsafe {
                            rates_of::<L, C, T, N, Q>(&update, &velocity, at, &mut batch)
                        };
                    }
                    if k.is_multiple_of(LINE / size_of::<S>()) {
                        if !const { ahead_of_each::<S, N>() } {
                            unroll!(populations i < Q => {
                                site.prefetch(i);
                            });
                        }
                        if turbulent {
                            velocity.prefetch(cell + k, bytes_ahead::<Q>() / size_of::<S>());
                        }
                    }
                    let place = Place {
                        cell: cell + k,
                        at: [plane, row, k],
                        sums,
                    };
                    // SAFETY: an interior cell.
                    let covered = P::ACTIVE && unsafe { cover.covers::<N>(cell + k) };
                    // With an eddy viscosity, cells deep inside bodies collide too, because their velocity is needed.
                    let mut deep = false;
                    if covered {
                        unroll!(populations i < Q => {
                            before[i] = site.incoming(i);
                        });
                        if !turbulent {
                            // SAFETY: an interior cell.
                            deep = unsafe { cover.fills::<N>(cell + k) };
                        }
                    }
                    let mut u = [N::splat(0.0); 3];
                    if deep {
                        // SAFETY: an interior cell; no other thread uses the sums of this worker.
                        unsafe { N::fill::<L, Q>(&shared.cover, place, &before, &mut g) };
                        unroll!(populations i < Q => {
                            site.leave(i, g[i]);
                        });
                    } else if !covered || const { size_of::<S>() == size_of::<f64>() } {
                        u = collision.collide::<L, N, _, Q>(&mut site, &rates);
                        if covered {
                            unroll!(populations i < Q => {
                                fluid[i] = site.outgoing(i);
                            });
                            // SAFETY: as above.
                            u = unsafe {
                                N::mix::<L, Q>(
                                    &shared.cover,
                                    place,
                                    &before,
                                    &fluid,
                                    &mut g,
                                    (u, omega),
                                )
                            };
                            unroll!(populations i < Q => {
                                site.leave(i, g[i]);
                            });
                        }
                    } else {
                        // The result is rounded once, after both operations.
                        fluid = before;
                        u = collision.collide::<L, N, _, Q>(&mut fluid, &rates);
                        // SAFETY: as above.
                        u = unsafe {
                            N::mix::<L, Q>(
                                &shared.cover,
                                place,
                                &before,
                                &fluid,
                                &mut g,
                                (u, omega),
                            )
                        };
                        unroll!(populations i < Q => {
                            site.leave(i, g[i]);
                        });
                    }
                    if turbulent {
                        // SAFETY: this cell belongs to this thread, and ghosts are reset after the pass.
                        unsafe { velocity.leave(cell + k, u) };
                    }
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
