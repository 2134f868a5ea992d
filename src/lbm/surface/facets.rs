//! Facets of the cells of a batch.

use super::batch::Batch;
use super::carried;
use super::cells::Cells;
use super::cut;
use super::facet::{Drive, Facet, Known, bounded};
use super::film::{Walls, heavy};
use super::ghosts::Around;
use super::jump::Jump;
use super::kind::{HELD, LIQUID, SOLID};
use super::moments::Moments;
use super::positions::{Kinds, MOST, Positions, Values};
use super::stencil::{Numbers, Stencil, momentum, sums};
use crate::lanes::{Stored, Work};
use crate::lattice::{Lattice, unroll};
use crate::populations::Populations;
use base::number::to_u32;
use base::vector::dot;

/// Minimum component against the normal, relative to its length, of a link from an interface cell to the liquid
/// cell inside.
const INWARD: f64 = 0.7;

/// Computes the normals like [`normal`] for the cells of a batch; 0 without a gradient.
#[inline(always)]
fn normals<L: Lattice<Q>, const Q: usize>(
    cells: &Cells,
    stencil: &Stencil<L, Q>,
    (positions, kinds): (&Positions, &Kinds<Q>),
    to: &mut [Values; 3],
) {
    let count = positions.padded();
    let mut level = [0.0; MOST];
    let mut sum = [[0.0; MOST]; 3];
    for i in 1..Q {
        positions.values(&cells.fill, stencil.neighbour(0, i), &mut level);
        let kinds = &kinds[i];
        for level in &mut level[..count] {
            *level = bounded(*level, 0.0, 1.0);
        }
        let is_wall = |kind: u8| (kind == SOLID) | (kind == HELD);
        // All, so that the loop is one vector.
        if kinds.iter().fold(false, |any, &kind| any | is_wall(kind)) {
            for (k, &cell) in positions.cells().iter().enumerate() {
                if is_wall(kinds[k]) {
                    level[k] = cells.mirrored_level(cell as usize, L::C[i]);
                }
            }
        }
        let w = L::W[i];
        for (sum, c) in sum.iter_mut().zip(Stencil::<L, Q>::C[i]) {
            if c != 0.0 {
                for k in 0..count {
                    sum[k] -= c * (w * level[k]);
                }
            }
        }
    }
    for k in 0..count {
        let normal = [sum[0][k], sum[1][k], sum[2][k]];
        let squares = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
        let length = squares.sqrt();
        for a in 0..3 {
            to[a][k] = if length > 0.0 {
                normal[a] / length
            } else {
                0.0
            };
        }
    }
}

/// Finds the direction to the liquid neighbour closest to the inward normal of each cell of a batch; 0 if none is
/// close enough.
#[inline(always)]
fn inwards<L: Lattice<Q>, const Q: usize>(
    count: usize,
    kinds: &Kinds<Q>,
    normal: &[Values; 3],
    to: &mut [u8; MOST],
) {
    for k in 0..count.min(MOST) {
        let normal = [normal[0][k], normal[1][k], normal[2][k]];
        let mut down = [0.0; Q];
        unroll!(pairs n < (Q - 1) / 2 => {
            let (i, back) = L::PAIRS[n];
            let up = dot(Stencil::<L, Q>::C[i], normal) / Stencil::<L, Q>::LENGTHS[i];
            down[i] = -up;
            down[back] = up;
        });
        let mut best = (INWARD, 0);
        unroll!(populations i < Q => {
            if i > 0 {
                let closer = (kinds[i][k] == LIQUID) & (down[i] > best.0);
                best.0 = if closer { down[i] } else { best.0 };
                best.1 = if closer { i.to_le_bytes()[0] } else { best.1 };
            }
        });
        to[k] = best.1;
    }
}

/// Returns `true` if a cell lies next to a wall that ends between it and its neighbour along direction `i`: at the
/// rim of an opening, or at the edge of a structure that does not carry the water against the force.
fn is_at_edge<L: Lattice<Q>, const Q: usize>(
    cells: &Cells,
    cell: usize,
    kind: impl Fn(usize) -> u8,
    i: usize,
    force: [f64; 3],
) -> bool {
    let faces = |c: [i8; 3]| c.iter().filter(|c| **c != 0).count();
    let opens = |j: usize| cells.leads_out(cell, j);
    let c = L::C[i];
    // Along the axes across the direction, and along the diagonals to them.
    faces(c) == 1
        && (1..Q).any(|j| {
            let across = L::C[j];
            let apart = (0..3).all(|a| across[a] == 0 || c[a] == 0);
            let diagonal: [i8; 3] = std::array::from_fn(|a| across[a] + c[a]);
            let carries = dot(across.map(f64::from), force) > 0.0;
            let ends = |k: usize| opens(k) || (kind(k) != SOLID && !carries);
            faces(across) == 1
                && apart
                && kind(j) == SOLID
                && !opens(j)
                && (1..Q).any(|k| L::C[k] == diagonal && ends(k))
        })
}

/// Cells next to interface cells along one direction each, of which some are ghost cells.
pub(super) struct Inner {
    /// Positions of the cells; of a ghost cell that of the interface cell.
    pub(super) positions: Positions,
    /// `true` if there are ghost cells.
    pub(super) beyond: bool,
}

impl Inner {
    /// Returns the liquid cells inside of the cells of a batch.
    #[inline(always)]
    pub(super) fn new<L: Lattice<Q>, const Q: usize>(
        (positions, inward): (&Positions, &[u8; MOST]),
        stencil: &Stencil<L, Q>,
        around: &Around,
    ) -> Self {
        let mut beyond = false;
        let cells = positions.cells().iter().zip(inward).map(|(&cell, &i)| {
            let next = stencil.neighbour(cell as usize, usize::from(i));
            let ghost = around.holds(next);
            beyond |= ghost;
            if ghost { cell } else { to_u32(next) }
        });
        let positions = Positions::new(cells);
        Self { positions, beyond }
    }
}

/// Computation of the facets of batches from the state before a pass.
pub(super) struct Find<'a, L, S: Stored, J, const Q: usize> {
    pub(super) batches: &'a mut [Batch],
    pub(super) cells: &'a Cells,
    pub(super) around: &'a Around,
    pub(super) populations: &'a Populations<S>,
    /// Numbers of the populations, of which only those of carried cells are written.
    pub(super) numbers: &'a Numbers<S>,
    pub(super) stencil: &'a Stencil<L, Q>,
    pub(super) drive: &'a Drive,
    pub(super) jump: J,
}

/// Buffers of a thread.
struct Buffers<const Q: usize> {
    numbers: [Values; Q],
    kinds: Kinds<Q>,
    density: Values,
    momentum: [Values; 3],
    normal: [Values; 3],
    distance: Values,
    fill: Values,
    inward: [u8; MOST],
    has_inside: Values,
    at_edge: Values,
    film: Values,
    c: [Values; 3],
    found: [Values; 10],
}

impl<L: Lattice<Q>, S: Stored, J: Jump, const Q: usize> Work for Find<'_, L, S, J, Q> {
    #[inline(always)]
    fn run(self) {
        let mut buffers = Buffers {
            numbers: [[0.0; MOST]; Q],
            kinds: [[SOLID; MOST]; Q],
            density: [0.0; MOST],
            momentum: [[0.0; MOST]; 3],
            normal: [[0.0; MOST]; 3],
            distance: [0.0; MOST],
            fill: [0.0; MOST],
            inward: [0; MOST],
            has_inside: [0.0; MOST],
            at_edge: [0.0; MOST],
            film: [0.0; MOST],
            c: [[0.0; MOST]; 3],
            found: [[0.0; MOST]; 10],
        };
        for n in 0..self.batches.len() {
            let positions = self.batches[n].positions;
            if let Some(next) = self.batches.get(n + 1) {
                for i in 0..Q {
                    let distance = self.stencil.incoming(0, i);
                    next.positions.prefetch(self.numbers, distance);
                }
                next.prefetch_inside(self.numbers, self.stencil);
            }
            self.look_at(&positions, &mut buffers);
            self.look_inside(&positions, &mut buffers);
            let batch = &mut self.batches[n];
            for k in 0..positions.padded() {
                let of = |vector: &[Values; 3]| [vector[0][k], vector[1][k], vector[2][k]];
                let known = Known {
                    density: buffers.density[k],
                    momentum: of(&buffers.momentum),
                    normal: of(&buffers.normal),
                    distance: buffers.distance[k],
                    has_inside: buffers.has_inside[k],
                    film: buffers.film[k],
                    c: of(&buffers.c),
                    found: moments_at(&buffers.found, k),
                    capillary: batch.capillary[k],
                    at_edge: buffers.at_edge[k],
                };
                let facet = Facet::new(self.drive, &known, self.jump);
                batch.facets.set(k, &facet);
            }
            batch.facets.inward = buffers.inward;
            for k in 0..MOST {
                batch.facets.carried[k] = batch.facets.is_carried[k] > 0.0;
            }
            // Cells with a body take part in the flow with their own populations.
            if self.cells.has_bodies() {
                let carried = batch.facets.carried.iter_mut().zip(positions.cells());
                for (carried, &cell) in carried.filter(|(carried, _)| **carried) {
                    *carried = !self.cells.meets_body(cell as usize);
                }
            }
            carried::set(batch, self.numbers, self.stencil, self.jump);
        }
    }
}

/// Returns the moments of a cell of a batch.
#[inline(always)]
fn moments_at(all: &[Values; 10], k: usize) -> Moments {
    let mut moments = [0.0; 10];
    for (to, values) in moments.iter_mut().zip(all) {
        *to = values[k];
    }
    moments
}

impl<L: Lattice<Q>, S: Stored, J: Jump, const Q: usize> Find<'_, L, S, J, Q> {
    /// Computes momentum, normal, direction inwards and distance of the surface of each cell.
    #[inline(always)]
    fn look_at(&self, positions: &Positions, to: &mut Buffers<Q>) {
        let count = positions.padded();
        // SAFETY: interface cells of the slab, whose numbers no other thread writes.
        unsafe { positions.incoming(self.numbers, self.stencil, &mut to.numbers) };
        for k in 0..count {
            let (density, [x, y, z]) = momentum::<L, Q>(|i| to.numbers[i][k]);
            to.density[k] = density;
            (to.momentum[0][k], to.momentum[1][k], to.momentum[2][k]) = (x, y, z);
        }
        positions.kinds(self.cells, self.stencil, &mut to.kinds);
        let around = (positions, &to.kinds);
        normals(self.cells, self.stencil, around, &mut to.normal);
        inwards::<L, Q>(count, &to.kinds, &to.normal, &mut to.inward);
        let walls = Walls {
            cells: self.cells,
            around: self.around,
            populations: self.populations,
        };
        let force = heavy(self.drive.half_force);
        // Cells without a liquid cell inside and without a film, whose surface passes through the centre.
        let mut loose = 0_u32;
        for (k, &cell) in positions.cells().iter().enumerate() {
            let i = usize::from(to.inward[k]);
            to.has_inside[k] = if i == 0 { 0.0 } else { 1.0 };
            let c = Stencil::<L, Q>::C[i];
            (to.c[0][k], to.c[1][k], to.c[2][k]) = (c[0], c[1], c[2]);
            to.film[k] = 0.0;
            to.at_edge[k] = 0.0;
            if i == 0 {
                let film = walls.film::<L, Q>(cell as usize, self.drive.half_force);
                let Some(film) = film else {
                    loose |= 1 << k;
                    continue;
                };
                to.film[k] = film.at_rest;
                for (to, normal) in to.normal.iter_mut().zip(film.normal) {
                    to[k] = normal;
                }
            }
            if i > 0 && (1..Q).any(|j| to.kinds[j][k] == SOLID) {
                let kind = |j: usize| to.kinds[j][k];
                let edge = is_at_edge::<L, Q>(self.cells, cell as usize, kind, i, force);
                to.at_edge[k] = f64::from(u8::from(edge));
            }
        }
        positions.values(&self.cells.fill, 0, &mut to.fill);
        cut::distances(count, &to.fill, &to.normal, &mut to.distance);
        while loose != 0 {
            to.distance[loose.trailing_zeros() as usize % MOST] = 0.0;
            loose &= loose - 1;
        }
    }

    /// Computes the moments of the liquid cell inside of each cell.
    #[inline(always)]
    fn look_inside(&self, positions: &Positions, to: &mut Buffers<Q>) {
        let inner = Inner::new((positions, &to.inward), self.stencil, self.around);
        // SAFETY: liquid cells of the slab, whose numbers no thread writes.
        unsafe {
            inner
                .positions
                .incoming(self.numbers, self.stencil, &mut to.numbers)
        };
        for k in 0..positions.padded() {
            let found = sums::<L, Q>(|i| to.numbers[i][k]);
            for (to, found) in to.found.iter_mut().zip(found) {
                to[k] = found;
            }
        }
        if !inner.beyond {
            return;
        }
        // SAFETY: as above.
        let of_cell = |cell: usize| unsafe { self.stencil.moments(self.numbers, cell) };
        for (k, &cell) in positions.cells().iter().enumerate() {
            let link = (cell as usize, usize::from(to.inward[k]));
            if self.around.holds(self.stencil.neighbour(link.0, link.1)) {
                let found = self.around.moments_along(self.populations, link, of_cell);
                for (to, found) in to.found.iter_mut().zip(found) {
                    to[k] = found;
                }
            }
        }
    }
}
