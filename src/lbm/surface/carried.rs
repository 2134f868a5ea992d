//! Interface cells carried by the liquid cell inside, because their centres lie outside the water.
//!
//! Such a cell contains less water than half a cell, but would move it like a full cell. It therefore takes part in
//! the flow together with the cell inside, like the small cells of a cut-cell grid that are merged with their
//! neighbours: before the pass it receives the velocity and the pressure extrapolated from the cell inside, and
//! after the pass its links to other wet cells receive the traction between that cell and the surface.

use super::carrier::Carrier;
use super::cells::Cells;
use super::conversion::inside;
use super::exchange::least;
use super::ghosts::Ghosts;
use super::jump::Jump;
use super::kind::{LIQUID, SOLID, is_surface};
use super::lists::Plane;
use super::stencil::{Numbers, Stencil};
use crate::initial::equilibrium;
use crate::lanes::Stored;
use crate::lattice::{Lattice, unroll};
use crate::populations::Populations;
use base::number::to_u32;
use base::thread_pool;

/// Sets the populations of the carried cells before a pass, and marks the cells.
pub(super) fn set<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &mut Cells,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
    jump: impl Jump,
) {
    let least = least(planes);
    let numbers = Numbers::new(populations);
    let (numbers, stencil) = (&numbers, &Stencil::<L, Q>::new(populations));
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for (n, (&cell, facet)) in plane.surface.iter().zip(&plane.facets).enumerate() {
            if !facet.carried {
                continue;
            }
            let density = plane.pressed(jump, n, facet.density());
            unroll!(populations i < Q => {
                let g = equilibrium(L::W[i], L::C[i], density, facet.given);
                // SAFETY: the incoming numbers of a cell belong to it.
                unsafe { numbers.write(stencil.incoming(cell as usize, i), g) };
            });
        }
    });
    for plane in planes {
        for (&cell, facet) in plane.surface.iter().zip(&plane.facets) {
            if facet.carried {
                cells.carried[cell as usize] = true;
            }
        }
    }
}

/// Returns the data for the links of a carried cell of the slab; `None` for other cells.
pub(super) fn carrier<S: Stored>(
    cells: &Cells,
    planes: &[Plane],
    populations: &Populations<S>,
    cell: usize,
) -> Option<Carrier> {
    if !cells.carried[cell] {
        return None;
    }
    let slow = populations.order()[0];
    let plane = &planes[populations.coordinates(cell)[slow].unsigned_abs()];
    let n = plane.surface.binary_search(&to_u32(cell)).ok()?;
    let capillary = plane.capillary.get(n).copied();
    Some(plane.facets[n].carrier(capillary.unwrap_or(0.0)))
}

/// Sets the populations that return to wet cells from the carried cells of the slab and outside it.
///
/// `beyond` contains the carried ghost cells of the step.
pub(super) fn link<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &mut Cells,
    (planes, ghosts): (&mut [Plane], &Ghosts),
    populations: &mut Populations<S>,
    beyond: &mut Vec<(usize, Carrier)>,
    jump: impl Jump,
) {
    beyond.clear();
    let surface = ghosts.live().map(|cell| cell as usize);
    for cell in surface.filter(|&cell| is_surface(cells.kind[cell])) {
        let of_cell = |cell| carrier(cells, planes, populations, cell);
        if let Some(carrier) = ghosts.around().carrier(populations, cell, of_cell) {
            beyond.push((cell, carrier));
        }
    }
    for (cell, _) in beyond.iter() {
        cells.carried[*cell] = true;
    }
    let takes = |kind: u8, cell: usize| kind == LIQUID || is_surface(kind) && !cells.carried[cell];
    let parity = populations.parity();
    let least = least(planes);
    let numbers = Numbers::new(populations);
    let (numbers, stencil) = (&numbers, &Stencil::<L, Q>::new(populations));
    let velocities = populations.velocities();
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for (n, (&cell, facet)) in plane.surface.iter().zip(&plane.facets).enumerate() {
            if !facet.carried {
                continue;
            }
            let cell = cell as usize;
            let carrier = facet.carrier(0.0);
            let kinds = stencil.kinds(cells, cell);
            for i in 1..Q {
                if !takes(kinds[i], stencil.neighbour(cell, i)) {
                    continue;
                }
                let even = plane.pressed(jump, n, carrier.even(Stencil::<L, Q>::C[i]));
                let even = 2.0 * L::W[i] * even;
                // SAFETY: both numbers of the link between this cell and one that is not carried.
                unsafe {
                    let sent = numbers.read(stencil.back(cell, i));
                    numbers.write(stencil.out(cell, i), even - sent);
                }
            }
        }
    });
    for (ghost, carrier) in beyond.iter() {
        for i in inside(populations, *ghost) {
            let cell = cells.neighbour(*ghost, i);
            let back = velocities.opposite[i];
            if cells.kind_along(cell, back) == SOLID || !takes(cells.kind[cell], cell) {
                continue;
            }
            let link = populations.link(cell, back);
            let even = with_tension(jump, carrier, carrier.even(velocities.c[i].map(f64::from)));
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

/// Returns a density with that of the tension of a ghost cell.
fn with_tension<J: Jump>(_: J, carrier: &Carrier, density: f64) -> f64 {
    if J::ACTS {
        density + carrier.capillary
    } else {
        density
    }
}

/// Clears the marks of the carried cells.
pub(super) fn clear(cells: &mut Cells, planes: &[Plane]) {
    for plane in planes {
        for (&cell, facet) in plane.surface.iter().zip(&plane.facets) {
            if facet.carried {
                cells.carried[cell as usize] = false;
            }
        }
    }
}
