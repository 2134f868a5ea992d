//! Interface cells in batches, which are computed together.
//!
//! The numbers of a batch are gathered into a list for each direction, so that loops over the cells of a batch have no
//! branches and consecutive numbers, and are compiled for each instruction set ([`crate::lanes::Work`]). Every cell
//! has its own sums, in the order of the directions, so that the bits do not depend on the batches.

use super::facet::Facets;
use super::lists::Plane;
use super::positions::{MOST, Positions, Values};
use super::stencil::{Numbers, Stencil};
use crate::lanes::Stored;
use crate::lattice::Lattice;
use base::number::to_u32;
use base::thread_pool;

/// Minimum number of batches per thread.
const BATCHES_PER_THREAD: usize = 16;

/// Cells of a batch that may contain a film, one bit each.
type Thin = u32;

const _: () = assert!(MOST <= Thin::BITS as usize);

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
    /// Cells with gas and without liquid next to them.
    pub(super) thin: Thin,
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

/// Divides the interface cells of all planes into batches.
pub(super) fn divide(batches: &mut Vec<Batch>, planes: &[Plane]) {
    let count: usize = planes.iter().map(|plane| plane.surface.len()).sum();
    batches.resize_with(count.div_ceil(MOST), Batch::default);
    let mut cells = planes
        .iter()
        .flat_map(|plane| plane.surface.iter().copied());
    for batch in batches {
        batch.positions = Positions::new(cells.by_ref().take(MOST));
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
        let positions = Positions::new(cells.clone());
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
