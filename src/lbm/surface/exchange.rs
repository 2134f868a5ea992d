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
use super::facet::find;
use super::ghosts::Around;
use super::kind::{EMPTIES, ENCLOSED, FILLS, GAS, HELD, LIQUID, SOLID, STRAY, SURFACE, is_surface};
use super::lists::Plane;
use super::moments::{Moments, moments};
use crate::lanes::Stored;
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

/// Pointer to the numbers of a slab, divided among threads by cell.
pub(super) struct Numbers<S>(*mut S);
// SAFETY: each number belongs to one link end of one interface cell, and each cell to one thread.
unsafe impl<S: Send> Sync for Numbers<S> {}

impl<S: Stored> Numbers<S> {
    /// Returns the numbers of the populations.
    pub(super) fn new(populations: &mut Populations<S>) -> Self {
        Self(populations.numbers_mut().as_mut_ptr())
    }

    /// Reads a number.
    ///
    /// # Safety
    /// No other thread writes it.
    #[inline(always)]
    pub(super) unsafe fn read(&self, position: usize) -> f64 {
        // SAFETY: the position lies in the slab, and the caller excludes other writers.
        unsafe { self.0.add(position).read().to_f64() }
    }

    /// Writes a number.
    ///
    /// # Safety
    /// No other thread reads or writes it.
    #[inline(always)]
    pub(super) unsafe fn write(&self, position: usize, value: f64) {
        // SAFETY: the position lies in the slab, and the caller excludes other threads.
        unsafe { self.0.add(position).write(S::from_f64(value)) }
    }
}

/// Returns the minimum number of planes per thread.
pub(super) fn least(planes: &[Plane]) -> usize {
    let cells: usize = planes.iter().map(|plane| plane.surface.len()).sum();
    let threads = 1 + cells / CELLS_PER_THREAD;
    planes.len().div_ceil(threads).max(1)
}

/// Computes the surface in each interface cell from the state before the pass.
pub(super) fn prepare<S: Stored>(
    (cells, around): (&Cells, &Around),
    planes: &mut [Plane],
    populations: &Populations<S>,
    drive: ([f64; 3], f64),
) {
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for (&cell, facet) in plane.surface.iter().zip(&mut plane.facets) {
            *facet = find((cells, around), populations, drive, cell as usize);
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

/// Returns the density of a cell while other threads work on other cells.
fn density<S: Stored>(numbers: &Numbers<S>, populations: &Populations<S>, cell: usize) -> f64 {
    let q = populations.velocities().q();
    // SAFETY: the incoming numbers of a cell lie in the slab, and no other thread writes them.
    let number = |i: usize| unsafe { numbers.read(populations.incoming(cell, i)) };
    (0..q).map(number).sum()
}

/// Sets the populations to zero that gas cells in the vectors of the pass have sent.
pub(super) fn silence<S: Stored>(
    cells: &Cells,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
) {
    let parity = populations.parity();
    let numbers = Numbers::new(populations);
    let (numbers, populations) = (&numbers, &*populations);
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for &cell in &plane.dry {
            let cell = cell as usize;
            for i in 0..cells.directions() {
                let out = if i == 0 {
                    populations.incoming(cell, 0)
                } else {
                    populations.link(cell, i).out(parity)
                };
                // SAFETY: the outgoing populations of a cell belong to it until the next pass.
                unsafe { numbers.0.add(out).write(S::from_f64(0.0)) };
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

/// Exchanges mass and reconstructs populations; writes the new fill level and kind of each interface cell to its
/// list.
pub(super) fn exchange<S: Stored>(
    cells: &mut Cells,
    around: &Around,
    planes: &mut [Plane],
    populations: &mut Populations<S>,
) {
    let mut mass = std::mem::take(&mut cells.mass);
    let masses = Numbers(mass.as_mut_ptr());
    let masses = &masses;
    let parity = populations.parity();
    let numbers = Numbers::new(populations);
    let (numbers, populations) = (&numbers, &*populations);
    let velocities = populations.velocities();
    let known = &*cells;
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let facet = &plane.facets[n];
            // The density inside at the middle of the step, computed from the incoming and outgoing populations of
            // the links: a density from an earlier time would excite sound.
            let mut inside = facet.inside;
            if facet.inward > 0 {
                let inward = (cell, usize::from(facet.inward));
                let of_cell = |cell: usize| {
                    let mut moments = [0.0; 10];
                    moments[0] = density(numbers, populations, cell);
                    moments
                };
                let [now, ..] = around.moments_along(populations, inward, of_cell);
                inside += 0.5 * (now - facet.density_inside);
            }
            let own = known.kind[cell];
            let level = known.content(cell);
            let mut gain = 0.0;
            let (mut alone, mut gas, mut liquid) = (true, false, known.is_fed(cell));
            for i in super::directions(velocities) {
                let kind = known.kind_along(cell, i);
                if kind == SOLID {
                    continue;
                }
                let link = populations.link(cell, i);
                let (out, incoming) = (link.out(parity), link.incoming(parity));
                // SAFETY: both numbers of a link to gas are this cell's; those of other links are only read.
                let sent = unsafe { numbers.0.add(out).read().to_f64() };
                let w = velocities.w[i];
                if kind == GAS {
                    gas = true;
                    let even = facet.even(velocities.c[i], inside);
                    let back = 2.0 * w * even - sent;
                    // SAFETY: as above.
                    unsafe {
                        numbers.0.add(incoming).write(S::from_f64(back));
                        numbers.0.add(out).write(S::from_f64(0.0));
                    }
                    continue;
                }
                // SAFETY: as above.
                let came = unsafe { numbers.0.add(incoming).read().to_f64() };
                if kind == LIQUID || kind == HELD {
                    liquid |= kind == LIQUID;
                    gain += came - sent;
                } else {
                    alone = false;
                    let other = known.content(known.neighbour(cell, i));
                    gain += between([own, kind], 0.5 * (level + other), sent + w, came + w);
                }
            }
            gain += known.shares_taken(cell);
            // SAFETY: the mass belongs to this cell.
            let mass = unsafe {
                let mass = masses.0.add(cell);
                mass.write(mass.read() + gain);
                mass.read()
            };
            let density = 1.0 + density(numbers, populations, cell);
            plane.fill[n] = known.fill_from(cell, mass, density);
            // In a cell partly filled by bodies, only the water counts, relative to the free part.
            let solid = known.solid(cell);
            let (water, free) = (mass - solid, (1.0 - solid) * density);
            let most = if solid > 0.0 {
                free + PASSED * density
            } else {
                (1.0 + PASSED) * density
            };
            plane.kind[n] = match (own, alone) {
                (ENCLOSED, true) => FILLS,
                (STRAY, true) => EMPTIES,
                _ if water > most => FILLS,
                _ if water < -PASSED * density => EMPTIES,
                (SURFACE, _) if !gas && water > (1.0 - NEARLY) * free => FILLS,
                (SURFACE, _) if gas && !liquid && water < NEARLY * free => EMPTIES,
                _ => own,
            };
        }
    });
    cells.mass = mass;
}

/// Computes the fill level and the kinds of the neighbours of each interface cell in the lists.
pub(super) fn classify<S: Stored>(
    cells: &Cells,
    planes: &mut [Plane],
    populations: &Populations<S>,
) {
    let least = least(planes);
    thread_pool::each_item_in_runs(planes, least, |_, plane| {
        for n in 0..plane.surface.len() {
            let cell = plane.surface[n] as usize;
            let (mut gas, mut liquid) = (false, cells.is_fed(cell));
            for i in 1..cells.directions() {
                match cells.kind_along(cell, i) {
                    GAS => gas = true,
                    LIQUID => liquid = true,
                    _ => {}
                }
            }
            let density = 1.0 + populations.moments(cell).0;
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
