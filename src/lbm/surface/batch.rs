//! Interface cells in batches, which are computed together.
//!
//! The numbers of a batch are gathered into a list for each direction, so that loops over the cells of a batch have no
//! branches and consecutive numbers, and are compiled for each instruction set ([`crate::lanes::Work`]). Every cell
//! has its own sums, in the order of the directions, so that the bits do not depend on the batches.

use super::cells::Cells;
use super::facets::Facets;
use super::kind::SOLID;
use super::lists::Plane;
use super::stencil::{Numbers, Stencil};
use crate::lanes::{Stored, prefetch};
use crate::lattice::Lattice;
use base::number::to_u32;
use base::thread_pool;

/// Maximum number of cells of a batch.
pub(super) const MOST: usize = 32;

/// Number of cells that are read at once if they are adjacent; batches are padded to multiples of it.
const GROUP: usize = 8;

/// Minimum number of batches per thread.
const BATCHES_PER_THREAD: usize = 16;

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
    adjacent: [bool; MOST / GROUP],
}

/// Batch of interface cells, in the order of their positions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Batch {
    pub(super) positions: Positions,
    /// Surface in each cell.
    pub(super) facets: Facets,
    /// Density that the surface tension adds in each cell; 0 without it.
    pub(super) capillary: Values,
    /// Fill level of each cell at the end of the step.
    pub(super) fill: Values,
    /// Kind of each cell at the end of the step.
    pub(super) kind: [u8; MOST],
}

impl Positions {
    /// Returns the positions of cells, at most [`MOST`].
    #[inline(always)]
    pub(super) fn of(cells: impl Iterator<Item = u32>) -> Self {
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
                *to = all.map(&as_value);
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

impl Batch {
    /// Prefetches the incoming populations of the liquid cells inside. They lie in memory behind a pass, on a line for
    /// each direction, and their loads would wait for each other.
    #[inline(always)]
    pub(super) fn prefetch_inside<L: Lattice<Q>, S: Stored, const Q: usize>(
        &self,
        numbers: &Numbers<S>,
        stencil: &Stencil<L, Q>,
    ) {
        // Most cells of a batch have it in the same direction.
        let inside = stencil.neighbour(0, usize::from(self.facets.inward[0]));
        for i in 0..Q {
            let distance = stencil.incoming(inside, i);
            self.positions.prefetch(numbers, distance);
        }
    }

    /// Prefetches the populations on the links of the cells.
    #[inline(always)]
    pub(super) fn prefetch_links<L: Lattice<Q>, S: Stored, const Q: usize>(
        &self,
        numbers: &Numbers<S>,
        stencil: &Stencil<L, Q>,
    ) {
        for i in 1..Q {
            self.positions.prefetch(numbers, stencil.out(0, i));
            self.positions.prefetch(numbers, stencil.back(0, i));
        }
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

/// Divides the interface cells of all planes into batches.
pub(super) fn divide(batches: &mut Vec<Batch>, planes: &[Plane]) {
    let count: usize = planes.iter().map(|plane| plane.surface.len()).sum();
    batches.resize_with(count.div_ceil(MOST), Batch::default);
    let mut cells = planes
        .iter()
        .flat_map(|plane| plane.surface.iter().copied());
    for batch in batches {
        batch.positions = Positions::of(cells.by_ref().take(MOST));
    }
}

/// Gives each batch the densities that the surface tension adds.
pub(super) fn press(batches: &mut [Batch], planes: &[Plane]) {
    let mut densities = planes
        .iter()
        .flat_map(|plane| plane.capillary.iter().copied());
    for batch in batches {
        let count = batch.positions.cells().len();
        for (to, density) in batch
            .capillary
            .iter_mut()
            .zip(densities.by_ref().take(count))
        {
            *to = density;
        }
    }
}

/// Returns the batch of an interface cell and its index there.
pub(super) fn find(batches: &[Batch], cell: usize) -> Option<(&Batch, usize)> {
    let cell = to_u32(cell);
    let next = batches.partition_point(|batch| batch.positions.cells()[0] <= cell);
    let batch = batches.get(next.checked_sub(1)?)?;
    let k = batch.positions.cells().binary_search(&cell).ok()?;
    Some((batch, k))
}

/// Calls `work` with parts of the batches, which are divided among threads.
pub(super) fn each_part(batches: &mut [Batch], work: impl Fn(&mut [Batch]) + Sync) {
    let runs = thread_pool::runs(batches.len(), BATCHES_PER_THREAD);
    let parts = thread_pool::evenly(batches, runs);
    thread_pool::each_run_of(runs, parts, |_, part| work(part));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(surface: impl Iterator<Item = u32>) -> Plane {
        let mut plane = Plane::default();
        plane.surface.extend(surface);
        plane
    }

    #[test]
    fn batches_hold_the_cells_of_all_planes_in_order() {
        let planes = [plane(3..40), plane(0..0), plane((50..90).step_by(3))];
        let mut batches = Vec::new();
        divide(&mut batches, &planes);
        let all: Vec<u32> = planes
            .iter()
            .flat_map(|plane| plane.surface.clone())
            .collect();
        let held = batches.iter().flat_map(|batch| batch.positions.cells());
        assert!(held.eq(&all));
        for cell in 0..100 {
            let found = find(&batches, cell as usize);
            let found = found.map(|(batch, k)| batch.positions.cells()[k]);
            assert_eq!(found, all.contains(&cell).then_some(cell));
        }
    }

    #[test]
    fn values_are_read_at_the_neighbours_of_adjacent_and_of_single_cells() {
        let list: Vec<f64> = (0..200_u32).map(f64::from).collect();
        let cells = (20..28).chain([31, 40, 42]).chain(60..73);
        let positions = Positions::of(cells.clone());
        assert_eq!(positions.adjacent, [true, false, true, false]);
        for distance in [0, 7, 9_usize.wrapping_neg()] {
            let mut values = [f64::NAN; MOST];
            positions.values(&list, distance, &mut values);
            for (value, cell) in values.iter().zip(cells.clone()) {
                assert_eq!(*value, list[(cell as usize).wrapping_add(distance)]);
            }
            assert_eq!(positions.cells().len(), 24);
            assert_eq!(positions.padded(), 24);
        }
    }
}
