//! State of the cells around a slab: in neighbouring slabs, across periodic axes and beyond symmetry planes.
//!
//! Beyond a wall lie solid cells. Beyond a symmetry plane lies the mirror image of the slab, so that the cell that
//! a population reaches by reflection has the kind and the fill level of the ghost cell at the end of its link.

use super::carrier::{Carrier, NUMBERS};
use super::cells::Cells;
use super::kind::SOLID;
use super::moments::{Moments, mirrored};
use crate::lanes::Stored;
use crate::populations::Populations;
use base::number::{to_u32, to_usize};
use decomposition::{Domain, HaloBytes, HaloExchange};

/// Message tags of the kinds, and of the values.
const TAGS: [u8; 2] = [3, 4];
/// Number of values of a cell in a message: its moments, and two more.
const VALUES: usize = 12;

/// Conditions at the ends of the slab.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ends {
    /// `true` for an axis that is periodic within the slab.
    pub periodic: [bool; 3],
    /// `true` for each end of an axis that is a symmetry plane.
    pub mirrored: [[bool; 2]; 3],
}

/// Source of the state of a ghost cell.
enum Source {
    /// Cell of the slab, by position.
    Inside(usize),
    /// Cell in the plane of the lower or upper neighbour, by index in the plane.
    Beyond(usize, usize),
}

/// Moments of the cells around the slab.
pub(super) struct Around {
    ends: Ends,
    cells: [usize; 3],
    order: [usize; 3],
    dimension: usize,
    /// `true` for ghost cells that may hold water, by position.
    ghost: Vec<bool>,
    /// Moments in the planes of both neighbours.
    moments: [Vec<Moments>; 2],
    /// Values of the carried cells in these planes.
    carriers: [Vec<[f64; NUMBERS]>; 2],
}

/// Exchange of the state.
pub(super) struct Ghosts {
    kinds: HaloExchange,
    values: HaloExchange,
    around: Around,
    /// Positions of the cells of a plane relative to its first cell.
    plane: Vec<usize>,
    /// First cells of the ghost plane below, of the first and the last plane, and of the ghost plane above.
    planes: [usize; 4],
    /// Pairs of ghost cell and source cell, in the order in which they are copied.
    copies: Vec<[u32; 2]>,
    /// Positions of all ghost cells that may hold water.
    all: Vec<u32>,
}

impl Ghosts {
    /// Sets up the exchange. Collective.
    pub(super) fn new<S: Stored>(
        populations: &Populations<S>,
        ends: Ends,
        domain: &Domain,
    ) -> Result<Self, String> {
        let order = populations.order();
        let cells = populations.cells();
        let dimension = populations.velocities().dimension;
        let zero = populations.cell([0; 3]);
        let first = populations.interior();
        let first = first.take_while(|(local, _)| local[order[0]] == 0);
        let plane: Vec<usize> = first.map(|(_, cell)| cell - zero).collect();
        let at_plane = |n: isize| {
            let mut at = [0; 3];
            at[order[0]] = n;
            populations.cell(at)
        };
        let last = cells[order[0]].cast_signed() - 1;
        let bytes = [plane.len(), VALUES * plane.len() * size_of::<f64>()];
        let [kinds, values] = [0, 1].map(|n| {
            HaloExchange::new(domain, TAGS[n], HaloBytes::symmetric(bytes[n]))
                .map_err(|e| e.to_string())
        });
        let moments = [(); 2].map(|()| vec![[0.0; 10]; plane.len()]);
        let carriers = [(); 2].map(|()| vec![[0.0; NUMBERS]; plane.len()]);
        let mut ghosts = Self {
            kinds: kinds?,
            values: values?,
            around: Around {
                ends,
                cells,
                order,
                dimension,
                ghost: vec![false; populations.cell_positions()],
                moments,
                carriers,
            },
            planes: [
                at_plane(-1),
                at_plane(0),
                at_plane(last),
                at_plane(last + 1),
            ],
            plane,
            copies: Vec::new(),
            all: Vec::new(),
        };
        if !cells.contains(&0) {
            ghosts.list(populations);
        }
        Ok(ghosts)
    }

    /// Lists the copies within the slab: along the slow axis, then rows, then their ends, so that corners are
    /// correct.
    fn list<S: Stored>(&mut self, populations: &Populations<S>) {
        let Around {
            ends,
            cells,
            order,
            dimension,
            ..
        } = &self.around;
        let extent = |axis: usize, ghosts: bool| {
            let ghost = isize::from(ghosts && axis < *dimension);
            -ghost..cells[axis].cast_signed() + ghost
        };
        for (n, &axis) in order.iter().enumerate() {
            if axis >= *dimension {
                continue;
            }
            let count = cells[axis].cast_signed();
            let [a, b] = match n {
                0 => [order[1], order[2]],
                1 => [order[0], order[2]],
                _ => [order[0], order[1]],
            };
            let before = |other: usize| order[..n].contains(&other);
            for (end, ghost) in [(0, -1), (1, count)] {
                let inside = if ends.mirrored[axis][end] {
                    ghost.clamp(0, count - 1)
                } else if ends.periodic[axis] {
                    ghost.rem_euclid(count)
                } else {
                    continue;
                };
                for i in extent(a, before(a)) {
                    for j in extent(b, before(b)) {
                        let at = |along: isize| {
                            let mut at = [0; 3];
                            (at[axis], at[a], at[b]) = (along, i, j);
                            to_u32(populations.cell(at))
                        };
                        self.copies.push([at(ghost), at(inside)]);
                    }
                }
            }
        }
        self.all = self.copies.iter().map(|[ghost, _]| *ghost).collect();
        for plane in [self.planes[0], self.planes[3]] {
            self.all
                .extend(self.plane.iter().map(|cell| to_u32(plane + cell)));
        }
        self.all.sort_unstable();
        self.all.dedup();
        for &cell in &self.all {
            self.around.ghost[cell as usize] = true;
        }
    }

    /// Copies a value of the cells of the slab to the ghost cells across periodic axes and symmetry planes.
    pub(super) fn copy(&self, values: &mut [f64]) {
        for &[ghost, inside] in &self.copies {
            values[ghost as usize] = values[inside as usize];
        }
    }

    /// Returns `true` if a position belongs to a ghost cell that may contain water.
    pub(super) fn holds(&self, cell: usize) -> bool {
        self.around.ghost[cell]
    }

    /// Returns the positions of all ghost cells that may hold water.
    pub(super) fn all(&self) -> &[u32] {
        &self.all
    }

    /// Fills the kinds of the ghost cells. Collective.
    pub(super) fn spread_kinds(&mut self, kinds: &mut [u8]) {
        let (lower, upper) = self.kinds.send_buffers_mut::<u8>();
        for (buffer, plane) in [(lower, self.planes[1]), (upper, self.planes[2])] {
            for (to, cell) in buffer.into_iter().flatten().zip(&self.plane) {
                *to = kinds[plane + cell];
            }
        }
        self.kinds.start();
        self.kinds.finish();
        let (lower, upper) = self.kinds.received::<u8>();
        for (buffer, plane) in [(lower, self.planes[0]), (upper, self.planes[3])] {
            for (kind, cell) in buffer.into_iter().flatten().zip(&self.plane) {
                kinds[plane + cell] = *kind;
            }
        }
        for &[ghost, inside] in &self.copies {
            kinds[ghost as usize] = kinds[inside as usize];
        }
    }

    /// Fills two values of the ghost cells, and receives the moments in the planes of the neighbours. Collective.
    pub(super) fn spread_values(
        &mut self,
        one: &mut [f64],
        other: &mut [f64],
        of_cell: impl Fn(usize) -> Moments,
    ) {
        self.exchange(|cell| {
            let mut values = [0.0; VALUES];
            values[..10].copy_from_slice(&of_cell(cell));
            values[10..].copy_from_slice(&[one[cell], other[cell]]);
            values
        });
        let (lower, upper) = self.values.received::<f64>();
        let planes = [self.planes[0], self.planes[3]];
        for (side, buffer) in [lower, upper].into_iter().enumerate() {
            let Some(buffer) = buffer else { continue };
            let places = self.plane.iter().zip(&mut self.around.moments[side]);
            for (values, (cell, moments)) in buffer.chunks_exact(VALUES).zip(places) {
                moments.copy_from_slice(&values[..10]);
                one[planes[side] + cell] = values[10];
                other[planes[side] + cell] = values[11];
            }
        }
        for &[ghost, inside] in &self.copies {
            one[ghost as usize] = one[inside as usize];
            other[ghost as usize] = other[inside as usize];
        }
    }

    /// Receives the moments of the surface in the planes of the neighbours. Collective.
    pub(super) fn exchange_moments(&mut self, of_cell: impl Fn(usize) -> Moments) {
        self.exchange(|cell| {
            let mut values = [0.0; VALUES];
            values[..10].copy_from_slice(&of_cell(cell));
            values
        });
        let (lower, upper) = self.values.received::<f64>();
        for (buffer, moments) in [lower, upper].into_iter().zip(&mut self.around.moments) {
            let Some(buffer) = buffer else { continue };
            for (from, to) in buffer.chunks_exact(VALUES).zip(moments) {
                to.copy_from_slice(&from[..10]);
            }
        }
    }

    /// Receives the data for the links of carried cells in the planes of the neighbours. Collective.
    pub(super) fn exchange_carriers(&mut self, of_cell: impl Fn(usize) -> Option<Carrier>) {
        self.exchange(|cell| of_cell(cell).map_or([0.0; NUMBERS], |carrier| carrier.numbers()));
        let (lower, upper) = self.values.received::<f64>();
        for (buffer, carriers) in [lower, upper].into_iter().zip(&mut self.around.carriers) {
            let Some(buffer) = buffer else { continue };
            for (from, to) in buffer.chunks_exact(VALUES).zip(carriers) {
                to.copy_from_slice(from);
            }
        }
    }

    /// Sends the values of the outer planes.
    fn exchange(&mut self, of_cell: impl Fn(usize) -> [f64; VALUES]) {
        let (lower, upper) = self.values.send_buffers_mut::<f64>();
        for (buffer, plane) in [(lower, self.planes[1]), (upper, self.planes[2])] {
            let Some(buffer) = buffer else { continue };
            for (to, cell) in buffer.chunks_exact_mut(VALUES).zip(&self.plane) {
                to.copy_from_slice(&of_cell(plane + cell));
            }
        }
        self.values.start();
        self.values.finish();
    }

    /// Returns the moments of the cells around the slab.
    pub(super) fn around(&self) -> &Around {
        &self.around
    }
}

impl Around {
    /// Returns the links of cells of the slab, by cell and direction, that a symmetry plane reflects into a solid
    /// cell: the population that returns from there does not come from water.
    pub(super) fn corners<S: Stored>(
        &self,
        populations: &Populations<S>,
        cells: &Cells,
    ) -> Vec<(u32, u8)> {
        let mut corners = Vec::new();
        if !self.ends.mirrored.as_flattened().contains(&true) {
            return corners;
        }
        let velocities = populations.velocities();
        for (at, cell) in populations.interior() {
            for i in super::directions(velocities) {
                let c = velocities.c[i];
                let reflected = (0..self.dimension).any(|a| {
                    let lower = c[a] < 0 && at[a] == 0;
                    let upper = c[a] > 0 && at[a] + 1 == self.cells[a];
                    lower && self.ends.mirrored[a][0] || upper && self.ends.mirrored[a][1]
                });
                if reflected && cells.kind_along(cell, i) == SOLID && cells.kind[cell] != SOLID {
                    corners.push((to_u32(cell), u8::try_from(i).unwrap_or(0)));
                }
            }
        }
        corners
    }

    /// Returns `true` if a position is that of a ghost cell beyond a plane of symmetry.
    pub(super) fn reflects<S: Stored>(&self, populations: &Populations<S>, cell: usize) -> bool {
        if !self.ghost[cell] {
            return false;
        }
        let at = populations.coordinates(cell);
        (0..self.dimension).any(|a| {
            let [lower, upper] = self.ends.mirrored[a];
            lower && at[a] < 0 || upper && at[a] >= self.cells[a].cast_signed()
        })
    }

    /// Returns the moments of a cell of the slab or of a ghost cell; `inside` returns the moments at a position in
    /// the slab.
    fn moments(
        &self,
        at: [isize; 3],
        inside: impl Fn([isize; 3]) -> usize,
        of_cell: impl Fn(usize) -> Moments,
    ) -> Moments {
        let (at, sign) = self.seen(at);
        let moments = match self.source(at, inside) {
            Source::Inside(cell) => of_cell(cell),
            Source::Beyond(side, place) => self.moments[side][place],
        };
        mirrored(moments, sign)
    }

    /// Returns the moments of the neighbour of a cell along a direction; `of_cell` gives those of a cell of the slab.
    #[inline(always)]
    pub(super) fn moments_along<S: Stored>(
        &self,
        populations: &Populations<S>,
        (cell, direction): (usize, usize),
        of_cell: impl Fn(usize) -> Moments,
    ) -> Moments {
        let neighbour = cell.wrapping_add_signed(populations.offset(direction));
        if !self.ghost[neighbour] {
            return of_cell(neighbour);
        }
        let at = populations.coordinates(neighbour);
        self.moments(at, |at| populations.cell(at), of_cell)
    }

    /// Returns the data for the links of a carried ghost cell; `of_cell` returns that of a cell of the slab.
    pub(super) fn carrier<S: Stored>(
        &self,
        populations: &Populations<S>,
        ghost: usize,
        of_cell: impl Fn(usize) -> Option<Carrier>,
    ) -> Option<Carrier> {
        let (at, sign) = self.seen(populations.coordinates(ghost));
        match self.source(at, |at| populations.cell(at)) {
            Source::Inside(cell) => Carrier::received(&of_cell(cell)?.numbers(), sign),
            Source::Beyond(side, place) => Carrier::received(&self.carriers[side][place], sign),
        }
    }

    /// Returns the source cell across periodic axes and symmetry planes, with the sign -1 along reversed axes.
    fn seen(&self, mut at: [isize; 3]) -> ([isize; 3], [f64; 3]) {
        let mut sign = [1.0; 3];
        for axis in 0..self.dimension {
            let count = self.cells[axis].cast_signed();
            if (0..count).contains(&at[axis]) {
                continue;
            }
            if self.ends.mirrored[axis][usize::from(at[axis] >= 0)] {
                at[axis] = at[axis].clamp(0, count - 1);
                sign[axis] = -1.0;
            } else if self.ends.periodic[axis] {
                at[axis] = at[axis].rem_euclid(count);
            }
        }
        (at, sign)
    }

    fn source(&self, at: [isize; 3], inside: impl Fn([isize; 3]) -> usize) -> Source {
        let [slow, middle, fast] = self.order;
        let count = self.cells[slow].cast_signed();
        if (0..count).contains(&at[slow]) {
            return Source::Inside(inside(at));
        }
        let place = to_usize(at[middle].unsigned_abs() as u64) * self.cells[fast]
            + to_usize(at[fast].unsigned_abs() as u64);
        Source::Beyond(usize::from(at[slow] >= count), place)
    }
}
