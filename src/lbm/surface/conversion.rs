//! Conversions of interface cells to liquid and gas, and of their neighbours to interface cells.
//!
//! A cell that fills must not have gas neighbours: its gas neighbours become interface cells without mass, with the
//! equilibrium of the mean density and velocity of their neighbouring interface cells. A cell that empties must not
//! have liquid neighbours: its liquid neighbours become interface cells with their present mass. If both are
//! adjacent, the cell that would empty remains an interface cell.

use super::batch::Batch;
use super::cells::Cells;
use super::ghosts::{Around, Ghosts};
use super::kind::{EMPTIES, ENTERED, FILLS, GAS, LIQUID, SOLID, SURFACE, is_surface};
use super::lists::Plane;
use super::moments::{Moments, moments};
use crate::initial::equilibrium;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::quanta::quanta;
use base::number::to_u32;

/// Dry cell next to water outside an opening, with the velocity of that water, if it is known.
pub(super) type FedCell = (u32, Option<[f64; 3]>);

/// Cells that change their kind in a step; reusable buffers.
#[derive(Debug, Default)]
pub(super) struct Work {
    fills: Vec<u32>,
    empties: Vec<u32>,
    entered: Vec<u32>,
    born: Vec<Moments>,
    /// Cells that have become interface cells, whose fill level the exchange does not know.
    renewed: Vec<u32>,
    /// Cells with excess mass, which is stored in [`Cells::share`] until it is received.
    excess: Vec<u32>,
    /// Cells whose excess mass is stored.
    shared: Vec<u32>,
    /// Cells with a share among their neighbours.
    takers: Vec<u32>,
}

/// Returns the directions from a cell or ghost cell to its neighbours in the slab.
pub(super) fn inside<'a, S: Stored>(
    populations: &'a Populations<S>,
    cell: usize,
) -> impl Iterator<Item = usize> + 'a {
    let at = populations.coordinates(cell);
    let cells = populations.cells();
    let velocities = populations.velocities();
    super::directions(velocities).filter(move |&i| {
        let c = velocities.c[i];
        let next: [isize; 3] = std::array::from_fn(|a| at[a] + isize::from(c[a]));
        (0..3).all(|a| (0..cells[a].cast_signed()).contains(&next[a]))
    })
}

impl Work {
    /// Records a stored excess mass at a restart.
    pub(super) fn note_share(&mut self, cell: usize) {
        self.shared.push(to_u32(cell));
    }

    /// Returns the cells newly reached by the surface, with their velocities.
    pub(super) fn entered(&self) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        let born = self.born.iter();
        let cells = self.entered.iter().zip(born);
        cells.map(|(&cell, &[_, x, y, z, ..])| (cell as usize, [x, y, z]))
    }

    /// Clears the stored excess masses after they have been received.
    pub(super) fn forget_shares(&mut self, cells: &mut Cells) {
        for cell in self.shared.drain(..) {
            cells.share[cell as usize] = 0.0;
        }
        for cell in self.takers.drain(..) {
            cells.takes[cell as usize] = false;
        }
    }

    /// Marks the cells with a share among their neighbours.
    pub(super) fn mark_takers<S: Stored>(
        &mut self,
        cells: &mut Cells,
        ghosts: &Ghosts,
        populations: &Populations<S>,
    ) {
        let takers = &mut self.takers;
        let mut mark = |cell: usize, cells: &mut Cells| {
            if !cells.takes[cell] {
                cells.takes[cell] = true;
                takers.push(to_u32(cell));
            }
        };
        for &cell in &self.shared {
            for i in 1..cells.directions() {
                mark(cells.neighbour(cell as usize, i), cells);
            }
        }
        for ghost in ghosts.changed(!self.shared.is_empty()) {
            let ghost = ghost as usize;
            if cells.share[ghost] != 0.0 {
                for i in inside(populations, ghost) {
                    mark(cells.neighbour(ghost, i), cells);
                }
            }
        }
    }

    /// Returns the cells that have become interface cells in the last conversion.
    pub(super) fn renewed(&self) -> &[u32] {
        &self.renewed
    }

    /// Sets the kinds and the fill levels found by the exchange, and records the cells that change. With `bodies`,
    /// which move before the cells are listed again, fill levels remain those before the step.
    pub(super) fn collect(&mut self, cells: &mut Cells, batches: &[Batch], bodies: bool) {
        self.fills.clear();
        self.empties.clear();
        self.entered.clear();
        self.born.clear();
        self.renewed.clear();
        for batch in batches {
            let states = batch.kind.iter().zip(&batch.fill);
            for (&cell, (&kind, &fill)) in batch.positions.cells().iter().zip(states) {
                cells.kind[cell as usize] = kind;
                if !bodies {
                    cells.fill[cell as usize] = fill;
                }
                match kind {
                    FILLS => self.fills.push(cell),
                    EMPTIES => self.empties.push(cell),
                    _ => {}
                }
            }
        }
    }

    /// Prevents cells from emptying next to cells that fill.
    pub(super) fn resolve(&mut self, cells: &mut Cells) {
        self.empties.retain(|&cell| {
            let cell = cell as usize;
            let kept = cells.count_neighbours(cell, |kind| kind == FILLS) > 0;
            if kept {
                cells.kind[cell] = SURFACE;
            }
            !kept
        });
    }

    /// Changes the kinds of cells, and records the excess mass.
    ///
    /// `fed` contains dry cells next to water outside an opening, each with the velocity of that water, if it is
    /// known.
    pub(super) fn convert<S: Stored>(
        &mut self,
        cells: &mut Cells,
        planes: &mut [Plane],
        populations: &mut Populations<S>,
        (ghosts, fed): (&Ghosts, &[FedCell]),
    ) {
        let [slow, ..] = populations.order();
        let mut touch = |populations: &Populations<S>, cell: u32| {
            let at = populations.coordinates(cell as usize);
            planes[at[slow].unsigned_abs()].changed = true;
        };
        let beyond = ghosts.changed(!(self.fills.is_empty() && self.empties.is_empty()));
        let beyond = beyond.filter(|&cell| matches!(cells.kind[cell as usize], FILLS | EMPTIES));
        let sources: Vec<u32> = if self.fills.is_empty() && self.empties.is_empty() {
            beyond.collect()
        } else {
            let own = self.fills.iter().chain(&self.empties);
            own.copied().chain(beyond).collect()
        };
        for source in sources {
            let source = source as usize;
            let fills = cells.kind[source] == FILLS;
            for i in inside(populations, source) {
                let cell = cells.neighbour(source, i);
                if cells.kind_along(source, i) == SOLID {
                    continue;
                }
                match (fills, cells.kind[cell]) {
                    (true, GAS) => {
                        cells.kind[cell] = ENTERED;
                        self.entered.push(to_u32(cell));
                    }
                    (false, LIQUID) => {
                        cells.kind[cell] = SURFACE;
                        cells.mass[cell] = 1.0 + populations.moments(cell).0;
                        self.renewed.push(to_u32(cell));
                        touch(populations, to_u32(cell));
                    }
                    _ => {}
                }
            }
        }
        for (cell, _) in fed {
            if cells.kind[*cell as usize] == GAS {
                cells.kind[*cell as usize] = ENTERED;
                self.entered.push(*cell);
            }
        }
        for &cell in &self.entered {
            let streams = fed.iter().find(|(other, _)| *other == cell);
            let born = match streams.and_then(|(_, velocity)| *velocity) {
                Some([x, y, z]) => [0.0, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                None => mean_of_neighbours(cells, populations, ghosts.around(), cell as usize),
            };
            self.born.push(born);
        }
        for &cell in self.fills.iter().chain(&self.empties).chain(&self.entered) {
            touch(populations, cell);
        }
        for (&cell, born) in self.entered.iter().zip(&self.born) {
            let cell = cell as usize;
            enter(populations, cell, born);
            cells.kind[cell] = SURFACE;
            cells.mass[cell] = cells.solid(cell);
            self.renewed.push(to_u32(cell));
        }
        for n in 0..self.fills.len() {
            let cell = self.fills[n] as usize;
            let excess = cells.mass[cell] - (1.0 + populations.moments(cell).0);
            self.change(cells, cell, (LIQUID, 1.0), excess);
        }
        for n in 0..self.empties.len() {
            let cell = self.empties[n] as usize;
            let excess = cells.mass[cell] - cells.solid(cell);
            self.change(cells, cell, (GAS, 0.0), excess);
            leave(cells, populations, cell);
        }
    }
}

impl Work {
    /// Sets the new kind and fill level of a cell, and records its excess mass.
    pub(super) fn change(
        &mut self,
        cells: &mut Cells,
        cell: usize,
        (kind, fill): (u8, f64),
        excess: f64,
    ) {
        cells.kind[cell] = kind;
        cells.fill[cell] = fill;
        cells.mass[cell] = 0.0;
        cells.share[cell] = excess;
        self.excess.push(to_u32(cell));
    }

    /// Divides excess mass by the number of neighbouring interface cells; returns the mass without such neighbours,
    /// in quanta.
    pub(super) fn distribute(&mut self, cells: &mut Cells) -> i128 {
        let mut lost = 0;
        for cell in self.excess.drain(..) {
            let at = cell as usize;
            let count = cells.count_neighbours(at, is_surface);
            if count == 0 {
                lost += i128::from(quanta(cells.share[at]));
                cells.share[at] = 0.0;
                continue;
            }
            cells.share[at] /= base::number::real(count);
            self.shared.push(cell);
        }
        lost
    }
}

/// Returns the mean density and velocity of the interface cells next to a gas cell.
fn mean_of_neighbours<S: Stored>(
    cells: &Cells,
    populations: &Populations<S>,
    around: &Around,
    cell: usize,
) -> Moments {
    let mut sum = [0.0; 10];
    let mut count = 0_usize;
    for i in 1..cells.directions() {
        let kind = cells.kind_along(cell, i);
        if !is_surface(kind) || matches!(kind, EMPTIES | ENTERED) {
            continue;
        }
        let of_cell = |cell: usize| moments(populations, cell);
        let found = around.moments_along(populations, (cell, i), of_cell);
        for (sum, found) in sum.iter_mut().zip(found) {
            *sum += found;
        }
        count += 1;
    }
    sum.map(|sum| sum / base::number::real(count.max(1)))
}

/// Sets the populations of a new interface cell.
pub(super) fn enter<S: Stored>(populations: &mut Populations<S>, cell: usize, born: &Moments) {
    let [drho, x, y, z, ..] = *born;
    for i in 0..populations.velocities().q() {
        let v = populations.velocities();
        let g = equilibrium(v.w[i], v.c[i], drho, [x, y, z]);
        let position = populations.incoming(cell, i);
        populations.numbers_mut()[position] = S::from_f64(g);
    }
}

/// Clears the populations of a new gas cell: its incoming ones, and those sent to cells without water.
pub(super) fn leave<S: Stored>(cells: &Cells, populations: &mut Populations<S>, cell: usize) {
    let parity = populations.parity();
    for i in 0..cells.directions() {
        let incoming = populations.incoming(cell, i);
        populations.numbers_mut()[incoming] = S::from_f64(0.0);
        // Behind a sheet the number is the one that returns to the cell there.
        if i > 0 && !super::is_wet(cells.kind[cells.neighbour(cell, i)]) {
            let out = populations.link(cell, i).out(parity);
            populations.numbers_mut()[out] = S::from_f64(0.0);
        }
    }
}
