//! Interface cells carried by the liquid cell inside, because their centres lie outside the water.
//!
//! Such a cell contains less water than half a cell, but would move it like a full cell. It therefore takes part in
//! the flow together with the cell inside, like the small cells of a cut-cell grid that are merged with their
//! neighbours: before the pass it receives the velocity and the pressure extrapolated from the cell inside, and
//! after the pass its links to other wet cells receive the traction between that cell and the surface.
//!
//! Elsewhere this holds in a smooth flow only, but next to the edge of a wall, as at the rims of a nozzle and below
//! the sheet that leaves a weir, it holds in any flow and at any fill level. There the wall would slow such a cell
//! like a full one, although the water has left it, and a jet would lose the momentum of one cell at each rim. Steps
//! that carry the water are no such edges: with them the run-up on slopes is lower by 3 to 9 %.

use super::batch::{Batch, each_part, find};
use super::carrier::Carrier;
use super::cells::Cells;
use super::conversion::inside;
use super::ghosts::Ghosts;
use super::jump::{Jump, pressed};
use super::kind::{LIQUID, SOLID, is_surface};
use super::positions::MOST;
use super::stencil::{Numbers, Stencil};
use crate::initial::equilibrium;
use crate::lanes::{Stored, Work};
use crate::lattice::Lattice;
use crate::populations::Populations;

/// Sets the populations of the carried cells of a batch before a pass.
///
/// The surface in other cells follows from cells that are not carried, so that this may be done before it is known.
#[inline(always)]
pub(super) fn set<L: Lattice<Q>, S: Stored, const Q: usize>(
    batch: &Batch,
    numbers: &Numbers<S>,
    stencil: &Stencil<L, Q>,
    jump: impl Jump,
) {
    let (count, facets) = (batch.positions.padded(), &batch.facets);
    if !facets.carried.contains(&true) {
        return;
    }
    let [mut density, mut g] = [[0.0; MOST]; 2];
    for k in 0..count {
        density[k] = pressed(jump, batch.capillary[k], facets.facet(k).density());
    }
    for i in 0..Q {
        for k in 0..count {
            g[k] = equilibrium(L::W[i], L::C[i], density[k], facets.facet(k).given);
        }
        for (k, cell) in batch.positions.marked(&facets.carried) {
            // SAFETY: the incoming numbers of a cell belong to it.
            unsafe { numbers.write(stencil.incoming(cell, i), g[k]) };
        }
    }
}

/// Marks the carried cells of batches, or clears the marks.
pub(super) fn mark(cells: &mut Cells, batches: &[Batch], carried: bool) {
    for batch in batches {
        for (&cell, _) in (batch.positions.cells().iter())
            .zip(batch.facets.carried)
            .filter(|(_, carried)| *carried)
        {
            cells.carried[cell as usize] = carried;
        }
    }
}

/// Returns the data for the links of a carried cell of the slab; `None` for other cells.
pub(super) fn carrier(cells: &Cells, batches: &[Batch], cell: usize) -> Option<Carrier> {
    if !cells.carried[cell] {
        return None;
    }
    let (batch, k) = find(batches, cell)?;
    Some(batch.facets.facet(k).carrier(batch.capillary[k]))
}

/// Sets the populations that return to wet cells from the carried cells of the slab and outside it.
///
/// `beyond` contains the carried ghost cells of the step.
pub(super) fn link<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &mut Cells,
    (batches, ghosts): (&mut [Batch], &Ghosts),
    populations: &mut Populations<S>,
    beyond: &mut Vec<(usize, Carrier)>,
    jump: impl Jump,
) {
    beyond.clear();
    let surface = ghosts.live().map(|cell| cell as usize);
    for cell in surface.filter(|&cell| is_surface(cells.kind[cell])) {
        let of_cell = |cell| carrier(cells, batches, cell);
        if let Some(carrier) = ghosts.around().carrier(populations, cell, of_cell) {
            beyond.push((cell, carrier));
        }
    }
    for (cell, _) in beyond.iter() {
        cells.carried[*cell] = true;
    }
    let known = &*cells;
    let takes = |cell: usize| takes(known.kind[cell], known.carried[cell]);
    let parity = populations.parity();
    let level = populations.level();
    let numbers = &Numbers::new(populations);
    let stencil = &Stencil::<L, Q>::new(populations);
    let velocities = populations.velocities();
    each_part(batches, |batches| {
        level.run(Link {
            batches,
            cells: known,
            numbers,
            stencil,
            jump,
        });
    });
    for (ghost, carrier) in beyond.iter() {
        for i in inside(populations, *ghost) {
            let cell = cells.neighbour(*ghost, i);
            let back = velocities.opposite[i];
            if cells.kind_along(cell, back) == SOLID || !takes(cell) {
                continue;
            }
            let link = populations.link(cell, back);
            let even = carrier.even(velocities.c[i].map(f64::from));
            let even = pressed(jump, carrier.capillary, even);
            let even = 2.0 * velocities.w[i] * even;
            // SAFETY: both numbers of the link between a cell of the slab and a ghost cell; no other thread is
            // active.
            unsafe {
                let sent = numbers.read(link.out(parity));
                numbers.write(link.incoming(parity), even - sent);
            }
        }
    }
    for (ghost, _) in beyond.iter() {
        cells.carried[*ghost] = false;
    }
}

/// Returns `true` if a cell takes the population that returns from a carried cell.
#[inline(always)]
fn takes(kind: u8, carried: bool) -> bool {
    (kind == LIQUID) | (is_surface(kind) & !carried)
}

/// Links of the carried cells of batches.
struct Link<'a, L, S, J, const Q: usize> {
    batches: &'a [Batch],
    cells: &'a Cells,
    numbers: &'a Numbers<S>,
    stencil: &'a Stencil<L, Q>,
    jump: J,
}

impl<L: Lattice<Q>, S: Stored, J: Jump, const Q: usize> Work for Link<'_, L, S, J, Q> {
    #[inline(always)]
    fn run(self) {
        let mut kinds = [[SOLID; MOST]; Q];
        let mut twice = [0.0; MOST];
        let [mut next, mut taken] = [[false; MOST]; 2];
        // Parts of the carriers that contain divisions.
        let mut slope = [0.0; MOST];
        let mut traction = [[0.0; MOST]; 3];
        let stencil = self.stencil;
        for (n, batch) in self.batches.iter().enumerate() {
            if let Some(next) = self.batches.get(n + 1)
                && next.facets.carried.contains(&true)
            {
                next.prefetch_links(self.numbers, stencil);
            }
            let (positions, facets) = (&batch.positions, &batch.facets);
            if !facets.carried.contains(&true) {
                continue;
            }
            positions.kinds(self.cells, stencil, &mut kinds);
            for k in 0..positions.padded() {
                let carrier = facets.facet(k).carrier(0.0);
                slope[k] = carrier.slope;
                for (to, part) in traction.iter_mut().zip(carrier.traction) {
                    to[k] = part;
                }
            }
            for i in 1..Q {
                positions.flags(&self.cells.carried, stencil.neighbour(0, i), &mut next);
                let kinds = &kinds[i];
                let mut any = false;
                // All, so that the loop is one vector.
                for k in 0..MOST {
                    taken[k] = facets.carried[k] & takes(kinds[k], next[k]);
                    any |= taken[k];
                }
                if !any {
                    continue;
                }
                let c = Stencil::<L, Q>::C[i];
                for k in 0..positions.padded() {
                    let facet = facets.facet(k);
                    let carrier = Carrier {
                        normal: facet.normal,
                        distance: facet.distance,
                        slope: slope[k],
                        traction: [traction[0][k], traction[1][k], traction[2][k]],
                        velocity: facet.velocity,
                        capillary: 0.0,
                    };
                    let even = pressed(self.jump, batch.capillary[k], carrier.even(c));
                    twice[k] = 2.0 * L::W[i] * even;
                }
                for (k, cell) in positions.marked(&taken) {
                    // SAFETY: both numbers of the link between this cell and one that is not carried.
                    unsafe {
                        let sent = self.numbers.read(stencil.back(cell, i));
                        self.numbers.write(stencil.out(cell, i), twice[k] - sent);
                    }
                }
            }
        }
    }
}

/// Clears the marks of the carried cells.
pub(super) fn clear(cells: &mut Cells, batches: &[Batch]) {
    mark(cells, batches, false);
}
