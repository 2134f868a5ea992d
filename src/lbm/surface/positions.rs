//! Positions of the cells of a batch, and reads of numbers at equal distances from all of them.

use super::cells::Cells;
use super::kind::SOLID;
use super::stencil::{Numbers, Stencil};
use crate::lanes::{Stored, prefetch};
use crate::lattice::Lattice;

/// Maximum number of cells of a batch.
pub(super) const MOST: usize = 32;

/// Number of cells that are read at once if they are adjacent; batches are padded to multiples of it.
const GROUP: usize = 8;

/// Values of the cells of a batch.
pub(super) type Values = [f64; MOST];

/// Kinds of the neighbours of the cells of a batch along each direction.
pub(super) type Kinds<const Q: usize> = [[u8; MOST]; Q];

/// Positions of the cells of a batch; the last one is repeated.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Positions {
    cells: [u32; MOST],
    count: usize,
    /// `true` for each group of adjacent cells of a row.
    pub(super) adjacent: [bool; MOST / GROUP],
}

impl Positions {
    /// Returns the positions of cells, at most [`MOST`].
    #[inline(always)]
    pub(super) fn new(cells: impl Iterator<Item = u32>) -> Self {
        let mut all = Self::default();
        for (to, cell) in all.cells.iter_mut().zip(cells) {
            *to = cell;
            all.count += 1;
        }
        if all.count > 0 {
            let last = all.cells[all.count - 1];
            all.cells[all.count..].fill(last);
        }
        for (adjacent, group) in all.adjacent.iter_mut().zip(all.cells.as_chunks().0) {
            *adjacent = is_run(group);
        }
        all
    }

    /// Returns the positions without the repeated ones.
    #[inline(always)]
    pub(super) fn cells(&self) -> &[u32] {
        &self.cells[..self.count.min(MOST)]
    }

    /// Returns the number of positions with the repeated ones of the last group.
    #[inline(always)]
    pub(super) fn padded(&self) -> usize {
        self.count.next_multiple_of(GROUP).min(MOST)
    }

    /// Reads the number at a distance from each position.
    ///
    /// # Safety
    /// The numbers lie in the list, and no other thread writes them.
    #[inline(always)]
    unsafe fn read<T: Copy, U>(
        &self,
        from: *const T,
        distance: usize,
        to: &mut [U; MOST],
        as_value: impl Fn(T) -> U,
    ) {
        let groups = self.cells.as_chunks::<GROUP>().0.iter();
        let groups = groups.zip(to.as_chunks_mut::<GROUP>().0);
        let groups = groups.zip(self.adjacent).take(self.padded() / GROUP);
        for ((cells, to), adjacent) in groups {
            if adjacent {
                let first = from.wrapping_add((cells[0] as usize).wrapping_add(distance));
                // SAFETY: promised by the caller.
                let all = unsafe { first.cast::<[T; GROUP]>().read_unaligned() };
                // Not `map`, whose last four values the compiler stores in three parts: the next load of a vector
                // from there would wait for all of them.
                for (to, &value) in to.iter_mut().zip(&all) {
                    *to = as_value(value);
                }
            } else {
                for k in 0..GROUP {
                    let at = from.wrapping_add((cells[k] as usize).wrapping_add(distance));
                    // SAFETY: promised by the caller.
                    to[k] = as_value(unsafe { at.read() });
                }
            }
        }
    }

    /// Prefetches the populations at a distance from each position.
    #[inline(always)]
    pub(super) fn prefetch<S: Stored>(&self, numbers: &Numbers<S>, distance: usize) {
        let groups = self.cells.as_chunks::<GROUP>().0.iter();
        let groups = groups.zip(self.adjacent).take(self.padded() / GROUP);
        for (cells, adjacent) in groups {
            // Adjacent cells share lines.
            for cell in &cells[..if adjacent { 1 } else { GROUP }] {
                let at = (*cell as usize).wrapping_add(distance);
                prefetch(numbers.start().wrapping_add(at));
            }
        }
    }

    /// Reads the population at a distance from each position.
    ///
    /// # Safety
    /// The numbers lie in the slab, and no other thread writes them.
    #[inline(always)]
    pub(super) unsafe fn numbers<S: Stored>(
        &self,
        numbers: &Numbers<S>,
        distance: usize,
        to: &mut Values,
    ) {
        // SAFETY: promised by the caller.
        unsafe { self.read(numbers.start(), distance, to, S::to_f64) }
    }

    /// Reads the incoming populations of each position.
    ///
    /// # Safety
    /// The positions are those of cells of the slab, and no other thread writes their incoming populations.
    #[inline(always)]
    pub(super) unsafe fn incoming<L: Lattice<Q>, S: Stored, const Q: usize>(
        &self,
        numbers: &Numbers<S>,
        stencil: &Stencil<L, Q>,
        to: &mut [Values; Q],
    ) {
        for (i, to) in to.iter_mut().enumerate() {
            // SAFETY: promised by the caller.
            unsafe { self.numbers(numbers, stencil.incoming(0, i), to) };
        }
    }

    /// Reads a value of the neighbour of each position, which is a cell of the slab, from a list by position.
    #[inline(always)]
    pub(super) fn values(&self, list: &[f64], distance: usize, to: &mut Values) {
        self.check(list.len(), distance);
        // SAFETY: within the list, which no thread writes.
        unsafe { self.read(list.as_ptr(), distance, to, |value| value) };
    }

    /// Reads a flag of the neighbour of each position, which is a cell of the slab, from a list by position.
    #[inline(always)]
    pub(super) fn flags(&self, list: &[bool], distance: usize, to: &mut [bool; MOST]) {
        self.check(list.len(), distance);
        // SAFETY: within the list, which no thread writes.
        unsafe { self.read(list.as_ptr(), distance, to, |flag| flag) };
    }

    /// Returns index and position of the marked cells.
    #[inline(always)]
    pub(super) fn marked(&self, marks: &[bool; MOST]) -> impl Iterator<Item = (usize, usize)> + '_ {
        let mut bits = 0_u64;
        for (n, marks) in marks.as_chunks::<GROUP>().0.iter().enumerate() {
            // Byte k of the eight becomes bit k of the highest one.
            let bytes = u64::from_le_bytes(marks.map(u8::from));
            bits |= bytes.wrapping_mul(0x0102_0408_1020_4080) >> 56 << (GROUP * n);
        }
        bits &= (1 << self.count.min(MOST)) - 1;
        std::iter::from_fn(move || {
            let k = bits.trailing_zeros() as usize;
            bits &= bits.wrapping_sub(1);
            (k < MOST).then(|| (k, self.cells[k] as usize))
        })
    }

    /// Reads the kinds of the neighbours of each position, solid behind sheets and in direction 0.
    #[inline(always)]
    pub(super) fn kinds<L: Lattice<Q>, const Q: usize>(
        &self,
        cells: &Cells,
        stencil: &Stencil<L, Q>,
        to: &mut Kinds<Q>,
    ) {
        to[0] = [SOLID; MOST];
        for (i, to) in to.iter_mut().enumerate().skip(1) {
            let distance = stencil.neighbour(0, i);
            self.check(cells.kind.len(), distance);
            // SAFETY: within the list, which no thread writes.
            unsafe { self.read(cells.kind.as_ptr(), distance, to, |kind| kind) };
        }
        if !cells.has_closed() {
            return;
        }
        for (k, &cell) in self.cells().iter().enumerate() {
            let closed = cells.closed(cell as usize);
            if closed > 1 {
                for (i, kinds) in to.iter_mut().enumerate() {
                    if closed & (1 << i) != 0 {
                        kinds[k] = SOLID;
                    }
                }
            }
        }
    }

    /// Checks that the neighbours of all positions lie in a list.
    #[inline(always)]
    fn check(&self, length: usize, distance: usize) {
        let mut within = true;
        for cell in self.cells {
            within &= (cell as usize).wrapping_add(distance) < length;
        }
        assert!(within);
    }
}

/// Returns `true` if positions are consecutive.
#[inline(always)]
fn is_run(cells: &[u32; GROUP]) -> bool {
    let mut run = true;
    for k in 1..GROUP {
        run &= cells[k] == cells[k - 1].wrapping_add(1);
    }
    run
}
