//! Work of a step of a slab on a GPU: the positions of the populations in each of the two passes, and the copies after
//! each pass.
//!
//! It is separate from the launches ([`super::Gpu`]), so that tests can run the same work on the host.
//!
//! | after the pass | copies, in this order |
//! |---|---|
//! | even | along the rows, along the middle axis, along the slab axis; walls; further terms at edges |
//! | odd | along the rows, along the slab axis, along the middle axis; walls; further terms at edges |
//!
//! The order is that of [`crate::fluid::Fluid::advance`], so that corners are correct.

use super::cell::Slab;
use super::copies::Copies;
use crate::boundary::Boundaries;
use crate::lanes::Stored;
use crate::populations::{Parity, Populations};
use base::number::to_u32;

/// Pass over all cells, and the copies after it.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Positions of the populations.
    pub slab: Slab,
    /// Copies after the pass, one list after the other; the order within a list is arbitrary.
    pub copies: Vec<Vec<Copies>>,
}

/// Passes and copies of the even and of the odd step.
#[derive(Clone, Debug)]
pub struct Program {
    /// Even pass and odd pass.
    pub passes: [Pass; 2],
    /// Number of planes, of rows of a plane, and of cells of a row.
    pub cells: [u32; 3],
}

impl Program {
    /// Returns the work for a slab that contains the whole domain.
    #[must_use]
    pub fn new<S: Stored>(
        populations: &Populations<S>,
        boundaries: &Boundaries<S>,
        periodic: [bool; 3],
    ) -> Self {
        let cells = populations
            .order()
            .map(|axis| to_u32(populations.cells()[axis]));
        let passes = [Parity::Home, Parity::Reversed]
            .map(|before| Pass::new(populations, boundaries, periodic, before));
        Self { passes, cells }
    }

    /// Returns the pass that follows populations of a parity.
    #[must_use]
    pub fn after(&self, parity: Parity) -> &Pass {
        &self.passes[usize::from(parity == Parity::Reversed)]
    }
}

impl Pass {
    /// Returns the pass over populations with the parity `before`.
    fn new<S: Stored>(
        populations: &Populations<S>,
        boundaries: &Boundaries<S>,
        periodic: [bool; 3],
        before: Parity,
    ) -> Self {
        let after = match before {
            Parity::Home => Parity::Reversed,
            Parity::Reversed => Parity::Home,
        };
        let [slow, middle, fast] = populations.order();
        let origin = populations.cell([0; 3]);
        let mut first = [0; 27];
        for (i, first) in first
            .iter_mut()
            .enumerate()
            .take(populations.velocities().q())
        {
            *first = to_u32(populations.incoming_after(before, origin, i));
        }
        let slab = Slab {
            first,
            plane: step(populations, slow),
            row: step(populations, middle),
            cells: to_u32(populations.cells()[fast]),
        };
        let round = Round {
            populations,
            periodic,
            after,
        };
        let [one, other] = match after {
            Parity::Reversed => [
                round.axis(middle, slow, false),
                round.axis(slow, middle, true),
            ],
            Parity::Home => [
                round.axis(slow, middle, true),
                round.axis(middle, slow, true),
            ],
        };
        let mut copies = vec![round.rows(&slab), one, other];
        copies.extend(boundaries.wall_copies(after, slab.plane));
        copies.retain(|list| !list.is_empty());
        Self { slab, copies }
    }
}

/// Returns the distance in positions between neighbours along an axis.
fn step<S: Stored>(populations: &Populations<S>, axis: usize) -> u32 {
    let mut at = [0; 3];
    at[axis] = 1;
    to_u32(populations.cell(at) - populations.cell([0; 3]))
}

/// Periodic axes of a slab after a pass.
struct Round<'a, S: Stored> {
    populations: &'a Populations<S>,
    periodic: [bool; 3],
    after: Parity,
}

impl<S: Stored> Round<'_, S> {
    /// Returns the component of direction `i` along an axis; 0 if the axis is not periodic.
    fn along(&self, axis: usize, i: usize) -> i8 {
        let velocities = self.populations.velocities();
        if self.periodic[axis] && axis < velocities.dimension {
            velocities.c[i][axis]
        } else {
            0
        }
    }

    /// Returns the periodic copies along the rows: a population that the first cell of a row writes for the cell before
    /// it is copied to the cell after the last one, and vice versa.
    fn rows(&self, slab: &Slab) -> Vec<Copies> {
        let [slow, middle, fast] = self.populations.order();
        let cells = self.populations.cells();
        let (first, length) = (&slab.first, to_u32(cells[fast]));
        let mut all = Vec::new();
        for i in 0..self.populations.velocities().q() {
            let (from, to) = match self.along(fast, i) {
                1 => (first[i], first[i] + length),
                -1 => (first[i] + length - 1, first[i] - 1),
                _ => continue,
            };
            all.push(Copies {
                from,
                to,
                counts: [to_u32(cells[middle]), to_u32(cells[slow])],
                strides: [slab.row, slab.plane],
                ..PLAIN
            });
        }
        all
    }

    /// Returns the periodic copies along `axis`, of whole rows with their ghosts. After an even pass, interior cells
    /// are copied to ghosts; after an odd one, ghosts are copied to interior cells. With `beyond`, the copies include
    /// the ghosts along the `other` axis, as is necessary for one of the two axes to make edges correct.
    fn axis(&self, axis: usize, other: usize, beyond: bool) -> Vec<Copies> {
        let populations = self.populations;
        let (velocities, cells) = (populations.velocities(), populations.cells());
        let fast = populations.order()[2];
        let ghosts = |axis: usize| isize::from(axis < velocities.dimension);
        let mut all = Vec::new();
        for i in 0..velocities.q() {
            let last = cells[axis].cast_signed() - 1;
            let (outside, inside) = match self.along(axis, i) {
                -1 => (-1, last),
                1 => (last + 1, 0),
                _ => continue,
            };
            let (from, to) = match self.after {
                Parity::Reversed => (inside, outside),
                Parity::Home => (outside, inside),
            };
            let margin = if beyond { ghosts(other) } else { 0 };
            let place = |at_axis: isize| {
                let mut at = [0; 3];
                at[axis] = at_axis;
                at[other] = -margin;
                at[fast] = -ghosts(fast);
                to_u32(populations.slot(populations.cell(at), i))
            };
            all.push(Copies {
                from: place(from),
                to: place(to),
                counts: [
                    to_u32(cells[fast]) + 2 * u32::from(ghosts(fast) > 0),
                    to_u32(cells[other]) + 2 * u32::from(margin > 0),
                ],
                strides: [1, step(populations, other)],
                ..PLAIN
            });
        }
        all
    }
}

/// Single copy without a term.
const PLAIN: Copies = Copies {
    from: 0,
    to: 0,
    counts: [1, 1],
    strides: [0, 0],
    factor: 0,
    unused: 0,
    term: 0.0,
};
