//! Exchange of mass between interface cells and their neighbours, and reconstruction of the populations from the
//! gas.
//!
//! An interface cell gains Δm = Σ_i s_i (f_ī(x + c_i → x) - f*_i(x → x + c_i)), with s_i = 1 towards liquid, the
//! mean of both fill levels towards an interface cell and 0 towards gas and solids (Körner et al. 2005, equation
//! 4). Where the surface passes from one row of cells to the next, a nearly full cell without gas neighbours or a
//! nearly empty one without liquid neighbours is created; it changes its kind immediately. Between other unlike
//! interface cells only one of the two terms counts, so that stray cells empty and enclosed cells fill (N. Thürey,
//! Physically based animation of free surface flows with the lattice Boltzmann method, Erlangen 2007, table 4.1).

use super::cells::Cells;
use super::facet::{Facet, find};
use super::ghosts::Around;
use super::jump::Jump;
use super::kind::{EMPTIES, ENCLOSED, FILLS, GAS, HELD, LIQUID, SOLID, STRAY, SURFACE, is_surface};
use super::lists::Plane;
use super::moments::{Moments, moments};
use super::stencil::{Numbers, Stencil};
use crate::lanes::Stored;
use crate::lattice::Lattice;
use crate::populations::Populations;
use base::thread_pool;

/// Mass beyond that of a full or an empty cell, relative to the density, at which the cell changes its kind (Thürey
/// 2007, section 4.3).
const PASSED: f64 = 1e-2;

/// Maximum free fraction of an interface cell without gas neighbours, or maximum water fraction of one without
/// liquid neighbours, at which it becomes liquid or gas immediately.
///
/// Such cells are created where a smooth surface passes from one row of cells to the next. The one-sided exchange
/// would move this fraction in a single step and disturb the surface.
const NEARLY: f64 = 0.2;

/// Minimum number of interface cells per thread.
const CELLS_PER_THREAD: usize = 500;

/// Returns the minimum number of planes per thread.
pub(super) fn least(planes: &[Plane]) -> usize {
    let cells: usize = planes.iter().map(|plane| plane.surface.len()).sum();
    let threads = 1 + cells / CELLS_PER_THREAD;
    planes.len().div_ceil(threads).max(1)
}

/// Computes the surface in each interface cell from the state before the pass; `of_waves` is the density of the
/// smallest capillary waves.
pub(super) fn prepare<L: Lattice<Q>, S: Stored, const Q: usize>(
    (cells, around): (&Cells, &Around),
    planes: &mut [Plane],
    populations: &Populations<S>,
    drive: ([f64; 3], f64),
    (jump, of_waves): (impl Jump, f64),
) {
    let least = least(planes);
    let stencil = Stencil::<L, Q>::new(populations);
    let state = (populations, &Numbers::to_read(populations), &stencil);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let tension = (jump, [plane.pressed(jump, n, 0.0), of_waves]);
            plane.facets[n] = find((cells, around), state, drive, cell, tension);
        }
    });
}

/// Returns the moments of a liquid cell next to interface cells; 0 for other cells, which are not used.
pub(super) fn shore<S: Stored>(
    cells: &Cells,
    populations: &Populations<S>,
    cell: usize,
) -> Moments {
    if cells.kind[cell] == LIQUID && cells.count_neighbours(cell, is_surface) > 0 {
        moments(populations, cell)
    } else {
        [0.0; 10]
    }
}

/// Sets the populations to zero that gas cells in the vectors of the pass have sent.
pub(super) fn clear_gas_populations<L: Lattice<Q>, S: Stored, const Q: usize>(
    planes: &mut [Plane],
    populations: &mut Populations<S>,
) {
    let numbers = Numbers::new(populations);
    let (numbers, stencil) = (&numbers, &Stencil::<L, Q>::new(populations));
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for &[first, end] in &plane.dry {
            for i in 0..Q {
                for cell in first as usize..end as usize {
                    // SAFETY: the population that a cell sends is its own until the next pass.
                    unsafe { numbers.write(stencil.out(cell, i), 0.0) };
                }
            }
        }
    });
}

/// Applies bounce-back on links given by cell and direction.
pub(super) fn bounce<S: Stored>(links: &[(u32, u8)], populations: &mut Populations<S>) {
    let parity = populations.parity();
    for &(cell, direction) in links {
        let link = populations.link(cell as usize, usize::from(direction));
        let numbers = populations.numbers_mut();
        numbers[link.incoming(parity)] = numbers[link.out(parity)];
    }
}

/// Returns the mass that a cell gains along a link to another interface cell, with `mean` the mean of both fill
/// levels; `sent` and `came` are f.
#[inline(always)]
fn between(kinds: [u8; 2], mean: f64, sent: f64, came: f64) -> f64 {
    let [own, other] = kinds;
    let gain = if own == other {
        came - sent
    } else if own == STRAY || other == ENCLOSED {
        -sent
    } else {
        came
    };
    mean * gain
}

/// Returns the density of the normal part of the traction inside in the middle of the step: the mean of both ends,
/// because a density that lags behind feeds sound.
///
/// # Safety
/// No other thread writes the incoming numbers of liquid cells.
#[inline(always)]
unsafe fn inside<L: Lattice<Q>, S: Stored, const Q: usize>(
    facet: &Facet,
    cell: usize,
    around: &Around,
    (populations, numbers, stencil): (&Populations<S>, &Numbers<S>, &Stencil<L, Q>),
) -> f64 {
    if facet.inward == 0 {
        return facet.inside;
    }
    let of_cell = |cell: usize| {
        let mut moments = [0.0; 10];
        // SAFETY: promised by the caller.
        moments[0] = unsafe { stencil.density(numbers, cell) };
        moments
    };
    let link = (cell, usize::from(facet.inward));
    let [now, ..] = around.moments_along(populations, link, of_cell);
    facet.inside + 0.5 * (now - facet.density_inside)
}

/// Exchanges mass and reconstructs populations; writes the new fill level and kind of each interface cell to its
/// list.
pub(super) fn exchange<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &mut Cells,
    around: &Around,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
    jump: impl Jump,
) {
    let mut mass = std::mem::take(&mut cells.mass);
    let masses = Numbers::from_list(&mut mass);
    let masses = &masses;
    let numbers = Numbers::new(populations);
    let (numbers, populations) = (&numbers, &*populations);
    let stencil = &Stencil::<L, Q>::new(populations);
    let known = &*cells;
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            stencil.prefetch(numbers, &plane.surface, n);
            let cell = plane.surface[n] as usize;
            let facet = &plane.facets[n];
            // SAFETY: threads write numbers of links to gas only.
            let inside = unsafe { inside(facet, cell, around, (populations, numbers, stencil)) };
            let own = known.kind[cell];
            let level = known.content(cell);
            let mut gain = 0.0;
            let (mut alone, mut gas, mut liquid) = (true, false, known.is_fed(cell));
            let kinds = stencil.kinds(known, cell);
            for i in 1..Q {
                let kind = kinds[i];
                if kind == SOLID {
                    continue;
                }
                let (out, incoming) = (stencil.out(cell, i), stencil.back(cell, i));
                // SAFETY: both numbers of a link to gas are this cell's; those of other links are only read.
                let sent = unsafe { numbers.read(out) };
                let w = L::W[i];
                if kind == GAS {
                    gas = true;
                    let even = facet.even(Stencil::<L, Q>::C[i], inside);
                    let even = plane.pressed(jump, n, even);
                    let back = 2.0 * w * even - sent;
                    // SAFETY: as above.
                    unsafe {
                        numbers.write(incoming, back);
                        numbers.write(out, 0.0);
                    }
                    continue;
                }
                // SAFETY: as above.
                let came = unsafe { numbers.read(incoming) };
                if kind == LIQUID || kind == HELD {
                    liquid |= kind == LIQUID;
                    gain += came - sent;
                } else {
                    alone = false;
                    let other = known.content(stencil.neighbour(cell, i));
                    gain += between([own, kind], 0.5 * (level + other), sent + w, came + w);
                }
            }
            if known.takes[cell] {
                gain += known.shares_taken(cell);
            }
            // SAFETY: the mass and the incoming numbers of this cell.
            let (mass, density) = unsafe {
                let mass = masses.read(cell) + gain;
                masses.write(cell, mass);
                (mass, 1.0 + stencil.density(numbers, cell))
            };
            plane.fill[n] = known.fill_from(cell, mass, density);
            plane.kind[n] = turned((known, cell), (mass, density), [alone, gas, liquid]);
        }
    });
    cells.mass = mass;
}

/// Returns the kind of an interface cell after the exchange; `alone` without other interface cells next to it.
#[inline(always)]
fn turned(
    (cells, cell): (&Cells, usize),
    (mass, density): (f64, f64),
    [alone, gas, liquid]: [bool; 3],
) -> u8 {
    let own = cells.kind[cell];
    // Of a cell that bodies share, the water alone, for the part that is free.
    let solid = cells.solid(cell);
    let (water, free) = (mass - solid, (1.0 - solid) * density);
    let most = if solid > 0.0 {
        free + PASSED * density
    } else {
        (1.0 + PASSED) * density
    };
    match (own, alone) {
        (ENCLOSED, true) => FILLS,
        (STRAY, true) => EMPTIES,
        _ if water > most => FILLS,
        _ if water < -PASSED * density => EMPTIES,
        (SURFACE, _) if !gas && water > (1.0 - NEARLY) * free => FILLS,
        (SURFACE, _) if gas && !liquid && water < NEARLY * free => EMPTIES,
        _ => own,
    }
}

/// Computes the fill level and the kinds of the neighbours of each interface cell in the lists.
pub(super) fn classify<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &Cells,
    planes: &mut [Plane],
    populations: &Populations<S>,
) {
    let least = least(planes);
    let stencil = &Stencil::<L, Q>::new(populations);
    let numbers = &Numbers::to_read(populations);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let (mut gas, mut liquid) = (false, cells.is_fed(cell));
            for kind in stencil.kinds(cells, cell) {
                gas |= kind == GAS;
                liquid |= kind == LIQUID;
            }
            // SAFETY: an interface cell of the slab, whose numbers are only read.
            let density = 1.0 + unsafe { stencil.density(numbers, cell) };
            let fill = cells.fill_from(cell, cells.mass[cell], density);
            plane.fill[n] = fill;
            plane.kind[n] = match (gas, liquid) {
                (false, _) if fill <= 1.0 - NEARLY => ENCLOSED,
                (true, false) if fill >= NEARLY => STRAY,
                _ => SURFACE,
            };
            debug_assert!(is_surface(cells.kind[cell]));
        }
    });
}
