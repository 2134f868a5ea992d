//! Exchange of mass between interface cells and their neighbours, and reconstruction of the populations from the
//! gas.
//!
//! An interface cell gains Δm = Σ_i s_i (f_ī(x + c_i → x) - f*_i(x → x + c_i)), with s_i = 1 towards liquid, the
//! mean of both fill levels towards an interface cell and 0 towards gas and solids (Körner et al. 2005, equation
//! 4). Where the surface passes from one row of cells to the next, a nearly full cell without gas neighbours or a
//! nearly empty one without liquid neighbours is created; it changes its kind immediately. Between other unlike
//! interface cells only one of the two terms counts, so that stray cells empty and enclosed cells fill (N. Thürey,
//! Physically based animation of free surface flows with the lattice Boltzmann method, Erlangen 2007, table 4.1). A
//! film on a wall has no liquid cells either, but is not stray ([`super::film`]).

use super::batch::{Batch, each_part};
use super::cells::Cells;
use super::facet::{Drive, bounded};
use super::facets::{Find, Inner};
use super::film::Walls;
use super::ghosts::Around;
use super::jump::{Jump, pressed};
use super::kind::{EMPTIES, ENCLOSED, FILLS, GAS, HELD, LIQUID, SOLID, STRAY, SURFACE, is_surface};
use super::lists::Plane;
use super::moments::{Moments, moments};
use super::positions::{Kinds, MOST, Positions, Values};
use super::stencil::{Numbers, Stencil, density};
use crate::lanes::{Stored, Work};
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

/// Computes the surface in each interface cell from the state before the pass, and sets the populations of the carried
/// cells.
pub(super) fn prepare<L: Lattice<Q>, S: Stored, const Q: usize>(
    (cells, around): (&Cells, &Around),
    batches: &mut [Batch],
    populations: &mut Populations<S>,
    drive: &Drive,
    jump: impl Jump,
) {
    let numbers = &Numbers::new(populations);
    let populations = &*populations;
    let stencil = &Stencil::<L, Q>::new(populations);
    let level = populations.level();
    each_part(batches, |batches| {
        level.run(Find {
            batches,
            cells,
            around,
            populations,
            numbers,
            stencil,
            drive,
            jump,
        });
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
    let gives = if (own == STRAY) | (other == ENCLOSED) {
        -sent
    } else {
        came
    };
    mean * if own == other { came - sent } else { gives }
}

/// Exchanges mass and reconstructs populations; writes the new fill level and kind of each interface cell to its
/// batch.
pub(super) fn exchange<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &mut Cells,
    around: &Around,
    batches: &mut [Batch],
    populations: &mut Populations<S>,
    jump: impl Jump,
) {
    let mut mass = std::mem::take(&mut cells.mass);
    let masses = &Numbers::from_list(&mut mass);
    let numbers = &Numbers::new(populations);
    let populations = &*populations;
    let stencil = &Stencil::<L, Q>::new(populations);
    let level = populations.level();
    let known = &*cells;
    each_part(batches, |batches| {
        level.run(Exchange {
            batches,
            cells: known,
            around,
            populations,
            numbers,
            masses,
            stencil,
            jump,
        });
    });
    cells.mass = mass;
}

/// Exchange of batches.
struct Exchange<'a, L, S: Stored, J, const Q: usize> {
    batches: &'a mut [Batch],
    cells: &'a Cells,
    around: &'a Around,
    populations: &'a Populations<S>,
    numbers: &'a Numbers<S>,
    masses: &'a Numbers<f64>,
    stencil: &'a Stencil<L, Q>,
    jump: J,
}

/// Bits of the kinds of the neighbours of a cell: interface cells, gas and liquid.
const NEXT_TO: [u8; 3] = [1, 2, 4];

/// Returns the bits of the kind of a neighbour.
#[inline(always)]
fn bits(kind: u8) -> u8 {
    let [surface, gas, liquid] = NEXT_TO;
    let of = |bit: u8, holds: bool| if holds { bit } else { 0 };
    of(surface, (SURFACE..HELD).contains(&kind)) | of(gas, kind == GAS) | of(liquid, kind == LIQUID)
}

/// Buffers of a thread.
struct Buffers<const Q: usize> {
    kinds: Kinds<Q>,
    own: [u8; MOST],
    /// Fractions that are not gas, of the cells and of their neighbours.
    level: Values,
    other: Values,
    /// Density of the normal part of the traction inside.
    inside: Values,
    /// Populations that have left along each direction, and those that came back.
    sent: Values,
    came: [Values; Q],
    gain: Values,
    next_to: [u8; MOST],
    density: Values,
}

impl<L: Lattice<Q>, S: Stored, J: Jump, const Q: usize> Work for Exchange<'_, L, S, J, Q> {
    #[inline(always)]
    fn run(mut self) {
        let mut buffers = Buffers {
            kinds: [[SOLID; MOST]; Q],
            own: [SOLID; MOST],
            level: [0.0; MOST],
            other: [0.0; MOST],
            inside: [0.0; MOST],
            sent: [0.0; MOST],
            came: [[0.0; MOST]; Q],
            gain: [0.0; MOST],
            next_to: [0; MOST],
            density: [0.0; MOST],
        };
        for n in 0..self.batches.len() {
            if let Some(next) = self.batches.get(n + 1) {
                next.prefetch_inside(self.numbers, self.stencil);
                next.prefetch_links(self.numbers, self.stencil);
            }
            let batch = &self.batches[n];
            self.look_inside(batch, &mut buffers);
            let positions = &batch.positions;
            positions.kinds(self.cells, self.stencil, &mut buffers.kinds);
            self.levels(positions, 0, &mut buffers.level);
            for (own, &cell) in buffers.own.iter_mut().zip(positions.cells()) {
                *own = self.cells.kind[cell as usize];
            }
            buffers.gain = [0.0; MOST];
            buffers.next_to = [0; MOST];
            // SAFETY: the numbers of the links of an interface cell; other threads write those of links to gas only.
            unsafe {
                positions.numbers(
                    self.numbers,
                    self.stencil.incoming(0, 0),
                    &mut buffers.came[0],
                )
            };
            for i in 1..Q {
                self.link(batch, i, &mut buffers);
            }
            for k in 0..positions.padded() {
                let came = &buffers.came;
                buffers.density[k] = 1.0 + density::<Q>(|i| came[L::OPPOSITE[i]][k]);
            }
            self.settle(n, &buffers);
        }
    }
}

impl<L: Lattice<Q>, S: Stored, J: Jump, const Q: usize> Exchange<'_, L, S, J, Q> {
    /// Computes the density of the normal part of the traction inside in the middle of the step.
    #[inline(always)]
    fn look_inside(&self, batch: &Batch, to: &mut Buffers<Q>) {
        let facets = &batch.facets;
        let positions = &batch.positions;
        let inner = Inner::new((positions, &facets.inward), self.stencil, self.around);
        // SAFETY: no thread writes the incoming numbers of liquid cells.
        unsafe {
            inner
                .positions
                .incoming(self.numbers, self.stencil, &mut to.came)
        };
        for k in 0..positions.padded() {
            to.inside[k] = facets.facet(k).in_middle(density::<Q>(|i| to.came[i][k]));
        }
        if !inner.beyond {
            return;
        }
        let of_cell = |cell: usize| {
            let mut moments = [0.0; 10];
            // SAFETY: as above.
            moments[0] = unsafe { self.stencil.density(self.numbers, cell) };
            moments
        };
        for (k, &cell) in positions.cells().iter().enumerate() {
            let link = (cell as usize, usize::from(facets.inward[k]));
            if self.around.holds(self.stencil.neighbour(link.0, link.1)) {
                let [now, ..] = self.around.moments_along(self.populations, link, of_cell);
                to.inside[k] = facets.facet(k).in_middle(now);
            }
        }
    }

    /// Computes the fractions of the neighbours at a distance that are not gas.
    #[inline(always)]
    fn levels(&self, positions: &Positions, distance: usize, to: &mut Values) {
        positions.values(&self.cells.fill, distance, to);
        for level in &mut to[..positions.padded()] {
            *level = bounded(*level, 0.0, 1.0);
        }
        if self.cells.has_bodies() {
            for (level, &cell) in to.iter_mut().zip(positions.cells()) {
                *level = self.cells.content((cell as usize).wrapping_add(distance));
            }
        }
    }

    /// Exchanges mass and populations along a direction.
    #[inline(always)]
    fn link(&self, batch: &Batch, i: usize, buffers: &mut Buffers<Q>) {
        let Buffers {
            kinds,
            own,
            level,
            other,
            inside,
            sent,
            came,
            gain,
            next_to,
            ..
        } = buffers;
        let (positions, stencil) = (&batch.positions, self.stencil);
        let count = positions.padded();
        let (kinds, came) = (&kinds[i], &mut came[i]);
        let mut any = 0;
        // All, so that the loop is one vector; numbers are computed for kinds left by the last batch, but not used.
        for k in 0..MOST {
            let bits = bits(kinds[k]);
            next_to[k] |= bits;
            any |= bits;
        }
        let [surface, gas, _] = NEXT_TO;
        // SAFETY: the numbers of the links of an interface cell; other threads write those of links to gas only.
        unsafe {
            positions.numbers(self.numbers, stencil.out(0, i), sent);
            positions.numbers(self.numbers, stencil.back(0, i), came);
        }
        let w = L::W[i];
        if any & gas != 0 {
            self.reflect(batch, i, (kinds, &*inside, &*sent, &mut *came));
        }
        if any & surface == 0 {
            for k in 0..count {
                let full = (kinds[k] == LIQUID) | (kinds[k] == HELD);
                gain[k] += if full { came[k] - sent[k] } else { 0.0 };
            }
            return;
        }
        self.levels(positions, stencil.neighbour(0, i), other);
        for k in 0..count {
            let full = (kinds[k] == LIQUID) | (kinds[k] == HELD);
            let shared = (kinds[k] >= SURFACE) & (kinds[k] < HELD);
            let mean = 0.5 * (level[k] + other[k]);
            let part = between([own[k], kinds[k]], mean, sent[k] + w, came[k] + w);
            let part = if shared { part } else { 0.0 };
            gain[k] += if full { came[k] - sent[k] } else { part };
        }
    }

    /// Sets the populations that come back from gas along a direction.
    #[inline(always)]
    fn reflect(
        &self,
        batch: &Batch,
        i: usize,
        (kinds, inside, sent, came): (&[u8; MOST], &Values, &Values, &mut Values),
    ) {
        let c = Stencil::<L, Q>::C[i];
        let w = L::W[i];
        let count = batch.positions.padded();
        let mut back = [0.0; MOST];
        for k in 0..count {
            let even = batch.facets.facet(k).even(c, inside[k]);
            let even = pressed(self.jump, batch.capillary[k], even);
            back[k] = S::from_f64(2.0 * w * even - sent[k]).to_f64();
        }
        let [back_at, out_at] = [self.stencil.back(0, i), self.stencil.out(0, i)];
        for (k, &cell) in batch.positions.cells().iter().enumerate() {
            if kinds[k] == GAS {
                let cell = cell as usize;
                came[k] = back[k];
                // SAFETY: both numbers of a link to gas are this cell's.
                unsafe {
                    self.numbers.write(cell.wrapping_add(back_at), back[k]);
                    self.numbers.write(cell.wrapping_add(out_at), 0.0);
                }
            }
        }
    }

    /// Computes mass, fill level and kind of the cells of a batch.
    #[inline(always)]
    fn settle(&mut self, n: usize, buffers: &Buffers<Q>) {
        let Batch {
            positions,
            fill,
            kind,
            ..
        } = &mut self.batches[n];
        let [surface, gas, liquid] = NEXT_TO;
        for (k, &cell) in positions.cells().iter().enumerate() {
            let cell = cell as usize;
            let mut gain = buffers.gain[k];
            if self.cells.takes[cell] {
                gain += self.cells.shares_taken(cell);
            }
            // SAFETY: the mass of this cell.
            let mass = unsafe {
                let mass = self.masses.read(cell) + gain;
                self.masses.write(cell, mass);
                mass
            };
            let density = buffers.density[k];
            let next_to = buffers.next_to[k];
            let around = [
                next_to & surface == 0,
                next_to & gas != 0,
                next_to & liquid != 0 || self.cells.is_fed(cell),
            ];
            fill[k] = self.cells.fill_from(cell, mass, density);
            kind[k] = turned((self.cells, cell), (mass, density), around);
        }
    }
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

/// Computes the fill levels of cells that have become interface cells.
pub(super) fn fill_renewed<L: Lattice<Q>, S: Stored, const Q: usize>(
    cells: &mut Cells,
    renewed: &[u32],
    populations: &Populations<S>,
) {
    let stencil = &Stencil::<L, Q>::new(populations);
    let numbers = &Numbers::to_read(populations);
    for &cell in renewed {
        let cell = cell as usize;
        // SAFETY: a cell of the slab, whose numbers no thread writes.
        let density = 1.0 + unsafe { stencil.density(numbers, cell) };
        cells.fill[cell] = cells.fill_from(cell, cells.mass[cell], density);
    }
}

/// Finds the kind of each interface cell from those of its neighbours, and its fill level, for half of the body force;
/// `filled` is `true` if the fill levels are known.
pub(super) fn classify<L: Lattice<Q>, S: Stored, const Q: usize>(
    (cells, around): (&Cells, &Around),
    batches: &mut [Batch],
    populations: &Populations<S>,
    (half_force, filled): ([f64; 3], bool),
) {
    let stencil = &Stencil::<L, Q>::new(populations);
    let numbers = &Numbers::to_read(populations);
    let level = populations.level();
    each_part(batches, |batches| {
        level.run(Classify {
            batches,
            walls: Walls {
                cells,
                around,
                populations,
            },
            half_force,
            numbers,
            stencil,
            filled,
        });
    });
}

/// Classification of the cells of batches.
struct Classify<'a, L, S: Stored, const Q: usize> {
    batches: &'a mut [Batch],
    walls: Walls<'a, S>,
    half_force: [f64; 3],
    numbers: &'a Numbers<S>,
    stencil: &'a Stencil<L, Q>,
    filled: bool,
}

impl<L: Lattice<Q>, S: Stored, const Q: usize> Work for Classify<'_, L, S, Q> {
    #[inline(always)]
    fn run(self) {
        let mut kinds = [[SOLID; MOST]; Q];
        let mut incoming = [[0.0; MOST]; Q];
        let mut densities = [0.0; MOST];
        let [_, gas, liquid] = NEXT_TO;
        let (walls, cells, half_force) = (self.walls, self.walls.cells, self.half_force);
        for batch in self.batches {
            let positions = &batch.positions;
            positions.kinds(cells, self.stencil, &mut kinds);
            let mut next_to = [0; MOST];
            for kinds in &kinds {
                for (next_to, &kind) in next_to.iter_mut().zip(kinds) {
                    *next_to |= bits(kind);
                }
            }
            if self.filled {
                for (fill, &cell) in batch.fill.iter_mut().zip(positions.cells()) {
                    *fill = cells.fill[cell as usize];
                }
            } else {
                // SAFETY: interface cells of the slab, whose numbers are only read.
                unsafe { positions.incoming(self.numbers, self.stencil, &mut incoming) };
                for k in 0..positions.padded() {
                    densities[k] = 1.0 + density::<Q>(|i| incoming[i][k]);
                }
                for (k, &cell) in positions.cells().iter().enumerate() {
                    let mass = cells.mass[cell as usize];
                    batch.fill[k] = cells.fill_from(cell as usize, mass, densities[k]);
                }
            }
            batch.thin = 0;
            for (k, &cell) in positions.cells().iter().enumerate() {
                let cell = cell as usize;
                let liquid = next_to[k] & liquid != 0 || cells.is_fed(cell);
                let thin = !liquid && next_to[k] & gas != 0;
                batch.thin |= if thin { 1 << k } else { 0 };
                let fill = batch.fill[k];
                batch.kind[k] = match (next_to[k] & gas != 0, liquid) {
                    (false, _) if fill <= 1.0 - NEARLY => ENCLOSED,
                    (true, false) if fill >= NEARLY && !walls.carry::<L, Q>(cell, half_force) => {
                        STRAY
                    }
                    _ => SURFACE,
                };
                debug_assert!(is_surface(cells.kind[cell]));
            }
        }
    }
}
