//! State of the cells around a slab: in neighbouring slabs, across periodic axes and beyond symmetry planes.
//!
//! Beyond a wall lie solid cells. Beyond a symmetry plane lies the mirror image of the slab, so that the cell that
//! a population reaches by reflection has the kind and the fill level of the ghost cell at the end of its link.

use super::carrier::{Carrier, NUMBERS};
use super::cells::Cells;
use super::kind::{HELD, LIQUID, SOLID};
use super::lists::Plane;
use super::moments::{Moments, mirrored};
use super::strips::{Strips, Tags};
use crate::lanes::Stored;
use crate::populations::Populations;
use base::number::{to_u32, to_usize};
use decomposition::{Domain, HaloBytes, HaloExchange};
use std::ops::Range;

/// Message tag of the kinds.
const TAG: u8 = 3;
/// Message tags of the values.
const VALUE_TAGS: Tags = [41, 42];
/// Number of values of a cell in a message: its moments, and two more.
const VALUES: usize = 12;
/// Number of steps for which the ghost cells next to a plane are updated after the surface has left it: the excess
/// mass of the last cells is distributed, received and cleared.
const LINGER: u8 = 3;

/// Conditions at the ends of the slab.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ends {
    /// `true` for an axis that is periodic within the slab.
    pub periodic: [bool; 3],
    /// `true` for each end of an axis that is a symmetry plane.
    pub mirrored: [[bool; 2]; 3],
}

/// Marks moments as unknown in builds with checks: those that are not sent must not be used.
fn forget(moments: &mut [Vec<Moments>; 2]) {
    if cfg!(debug_assertions) {
        moments
            .iter_mut()
            .for_each(|plane| plane.fill([f64::NAN; 10]));
    }
}

/// Ghost cells of a row and their source cells.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Positions of the first ghost cell and of its source.
    ghost: u32,
    inside: u32,
    length: u32,
}

impl Run {
    /// Returns the runs of pairs of ghost cell and source cell.
    fn join(pairs: impl Iterator<Item = [u32; 2]>, runs: &mut Vec<Self>) {
        let first = runs.len();
        for [ghost, inside] in pairs {
            match runs[first..].last_mut() {
                Some(run) if [run.ghost, run.inside].map(|n| n + run.length) == [ghost, inside] => {
                    run.length += 1;
                }
                _ => runs.push(Self {
                    ghost,
                    inside,
                    length: 1,
                }),
            }
        }
    }

    /// Copies a value of the source cells.
    #[inline(always)]
    fn copy<T: Copy>(&self, values: &mut [T]) {
        let [ghost, inside, length] = [self.ghost, self.inside, self.length].map(|n| n as usize);
        if length == 1 {
            values[ghost] = values[inside];
        } else {
            values.copy_within(inside..inside + length, ghost);
        }
    }
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

/// Copies from one plane.
struct Group {
    /// Plane, from the ghost plane below.
    plane: usize,
    copies: Range<usize>,
    /// `true` for copies to the ends of the rows, one for each row with the ghost rows.
    of_rows: bool,
}

/// Number of steps for which ghost cells are still updated.
#[derive(Default)]
struct Live {
    /// Steps for some ghost cells of each plane, and for all of them; from the ghost plane below.
    planes: Vec<u8>,
    whole: Vec<u8>,
    /// Steps for the ends of each row of the planes of the slab.
    rows: Vec<u8>,
    /// Number of rows of a plane, without and with ghost rows.
    count: [usize; 2],
}

/// Exchange of the state.
pub(super) struct Ghosts {
    kinds: HaloExchange,
    values: Strips,
    around: Around,
    /// Positions of the cells of a plane relative to its first cell.
    plane: Vec<usize>,
    /// First cells of the ghost plane below, of the first and the last plane, and of the ghost plane above.
    planes: [usize; 4],
    /// Runs of ghost cells and source cells, in the order in which they are copied.
    copies: Vec<Run>,
    /// Copies from one plane; those before the first group are made always.
    groups: Vec<Group>,
    /// Positions of all ghost cells that may hold water, ascending, and those of each plane.
    all: Vec<u32>,
    all_of: Vec<Range<usize>>,
    live: Live,
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
        let kinds = HaloExchange::new(domain, TAG, HaloBytes::symmetric(plane.len()));
        let rows = [cells[order[1]], cells[order[2]]];
        let values = Strips::new::<f64>(domain, VALUE_TAGS, rows, VALUES)?;
        let moments = [(); 2].map(|()| vec![[0.0; 10]; plane.len()]);
        let carriers = [(); 2].map(|()| vec![[0.0; NUMBERS]; plane.len()]);
        let mut ghosts = Self {
            kinds: kinds.map_err(|e| e.to_string())?,
            values,
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
            groups: Vec::new(),
            all: Vec::new(),
            all_of: Vec::new(),
            live: Live::new(cells[order[0]], rows[0], order[1] < dimension),
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
                    let first = self.copies.len();
                    let pairs = extent(b, before(b)).map(|j| {
                        [ghost, inside].map(|along| {
                            let mut at = [0; 3];
                            (at[axis], at[a], at[b]) = (along, i, j);
                            to_u32(populations.cell(at))
                        })
                    });
                    Run::join(pairs, &mut self.copies);
                    if n > 0 {
                        self.groups.push(Group {
                            plane: (i + 1).unsigned_abs(),
                            copies: first..self.copies.len(),
                            of_rows: n == 2,
                        });
                    }
                }
            }
        }
        let ghosts = self
            .copies
            .iter()
            .map(|run| run.ghost..run.ghost + run.length);
        self.all = ghosts.flatten().collect();
        for plane in [self.planes[0], self.planes[3]] {
            self.all
                .extend(self.plane.iter().map(|cell| to_u32(plane + cell)));
        }
        self.all.sort_unstable();
        self.all.dedup();
        let slow = order[0];
        let plane_of =
            |cell: u32| (populations.coordinates(cell as usize)[slow] + 1).unsigned_abs();
        let mut end = 0;
        for plane in 0..cells[slow] + 2 {
            let first = end;
            end += (self.all[first..].iter())
                .take_while(|cell| plane_of(**cell) == plane)
                .count();
            self.all_of.push(first..end);
        }
        for &cell in &self.all {
            self.around.ghost[cell as usize] = true;
        }
    }

    /// Copies a value of the cells of the slab to the ghost cells across periodic axes and symmetry planes.
    pub(super) fn copy(&self, values: &mut [f64]) {
        for run in &self.copies {
            run.copy(values);
        }
    }

    /// Returns `true` if a position belongs to a ghost cell that may contain water.
    pub(super) fn holds(&self, cell: usize) -> bool {
        self.around.holds(cell)
    }

    /// Returns the positions of the ghost cells that may hold water, in planes with the surface.
    pub(super) fn live(&self) -> impl Iterator<Item = u32> + '_ {
        let planes = self.all_of.iter().zip(&self.live.planes);
        let live = planes.filter(|(_, steps)| **steps > 0);
        live.flat_map(|(range, _)| self.all[range.clone()].iter().copied())
    }

    /// Returns the positions of [`Self::live`] that may be copies of cells that have changed: with `own`, of cells of
    /// the slab too, else of the planes of the neighbours only.
    pub(super) fn changed(&self, own: bool) -> impl Iterator<Item = u32> + '_ {
        let last = self.all_of.len().saturating_sub(1);
        let planes = self.all_of.iter().zip(&self.live.planes).enumerate();
        let live =
            planes.filter(move |(n, (_, steps))| **steps > 0 && (own || [0, last].contains(n)));
        live.flat_map(|(_, (range, _))| self.all[range.clone()].iter().copied())
    }

    /// Fills the kinds of the ghost cells. With `everywhere`, cells of all planes with water may have changed.
    /// Collective.
    pub(super) fn spread_kinds(&mut self, kinds: &mut [u8], planes: &[Plane], everywhere: bool) {
        let row = self.around.cells[self.around.order[2]];
        let rows = || self.plane.iter().step_by(row.max(1));
        let (lower, upper) = self.kinds.send_buffers_mut::<u8>();
        for (buffer, plane) in [(lower, self.planes[1]), (upper, self.planes[2])] {
            let buffer = buffer
                .into_iter()
                .flat_map(|buffer| buffer.chunks_exact_mut(row.max(1)));
            for (to, first) in buffer.zip(rows()) {
                to.copy_from_slice(&kinds[plane + first..][..row]);
            }
        }
        self.kinds.start();
        self.kinds.finish();
        let (lower, upper) = self.kinds.received::<u8>();
        for (buffer, plane) in [(lower, self.planes[0]), (upper, self.planes[3])] {
            let buffer = buffer
                .into_iter()
                .flat_map(|buffer| buffer.chunks_exact(row.max(1)));
            for (from, first) in buffer.zip(rows()) {
                kinds[plane + first..][..row].copy_from_slice(from);
            }
        }
        let first = self
            .groups
            .first()
            .map_or(self.copies.len(), |group| group.copies.start);
        for run in &self.copies[..first] {
            run.copy(kinds);
        }
        let (plane, ends) = (&self.plane, &self.planes);
        self.values.find(|end, ghost, m| {
            let first = ends[if end == 0 { 0 } else { 2 } + usize::from(ghost == (end == 1))];
            let first = first + plane[m * row];
            &kinds[first..first + row]
        });
        self.find_live(kinds, planes, everywhere);
        for group in &self.groups {
            let copies = &self.copies[group.copies.clone()];
            self.live.each(group, copies, |run| run.copy(kinds));
        }
    }

    /// Notes where cells may have changed, and the planes of the neighbours next to the surface: such a plane may be
    /// full of water and still have no values, because none are received away from the surface.
    fn find_live(&mut self, kinds: &[u8], planes: &[Plane], everywhere: bool) {
        let last = self.live.planes.len() - 1;
        self.live.note(planes, everywhere);
        let row = self.around.cells[self.around.order[2]].max(1);
        for (end, n, first) in [(0, 0, self.planes[0]), (1, last, self.planes[3])] {
            // Without a branch, so that many cells are compared at once.
            let is_active = |cell: &usize| {
                let row = &kinds[first + cell..][..row];
                row.iter().fold(false, |any, &kind| any | (kind > LIQUID))
            };
            if self.values.is_near(end) || self.plane.iter().step_by(row).any(is_active) {
                (self.live.planes[n], self.live.whole[n]) = (LINGER, LINGER);
            }
        }
    }

    /// Fills the fill levels and the excess masses of the ghost cells, and receives the moments in the planes of the
    /// neighbours. With `everywhere`, levels away from the surface are used too. Collective.
    pub(super) fn spread_values(
        &mut self,
        (kinds, everywhere): (&[u8], bool),
        [fill, share]: [&mut [f64]; 2],
        of_cell: impl Fn(usize) -> Moments,
    ) {
        // Away from the surface the fill level follows from the kind.
        let last = self.live.planes.len() - 1;
        for (n, first) in [(0, self.planes[0]), (last, self.planes[3])] {
            if !everywhere && self.live.planes[n] == 0 {
                continue;
            }
            for cell in self.plane.iter().map(|cell| first + cell) {
                let full = matches!(kinds[cell], LIQUID | HELD);
                (fill[cell], share[cell]) = (f64::from(u8::from(full)), 0.0);
            }
        }
        let (plane, [below, first, last, above]) = (&self.plane, self.planes);
        self.values.send(false, |end, n, to| {
            let cell = [first, last][end] + plane[n];
            to[..10].copy_from_slice(&of_cell(cell));
            to[10..].copy_from_slice(&[fill[cell], share[cell]]);
        });
        let moments = &mut self.around.moments;
        forget(moments);
        self.values.receive(false, |end, n, from| {
            let cell = [below, above][end] + plane[n];
            moments[end][n].copy_from_slice(&from[..10]);
            (fill[cell], share[cell]) = (from[10], from[11]);
        });
        let first = self
            .groups
            .first()
            .map_or(self.copies.len(), |group| group.copies.start);
        for run in &self.copies[..first] {
            run.copy(fill);
            run.copy(share);
        }
        for group in &self.groups {
            let copies = &self.copies[group.copies.clone()];
            self.live.each(group, copies, |run| {
                run.copy(fill);
                run.copy(share);
            });
        }
        self.live.pass();
    }

    /// Receives the moments in the planes of the neighbours: those next to the surface, or `all`. Collective.
    pub(super) fn exchange_moments(&mut self, all: bool, of_cell: impl Fn(usize) -> Moments) {
        let (plane, [_, first, last, _]) = (&self.plane, self.planes);
        self.values.send(all, |end, n, to| {
            to[..10].copy_from_slice(&of_cell([first, last][end] + plane[n]));
        });
        let moments = &mut self.around.moments;
        forget(moments);
        self.values.receive(all, |end, n, from| {
            moments[end][n].copy_from_slice(&from[..10])
        });
    }

    /// Receives the data for the links of carried cells in the planes of the neighbours. Collective.
    pub(super) fn exchange_carriers(&mut self, of_cell: impl Fn(usize) -> Option<Carrier>) {
        let (plane, [_, first, last, _]) = (&self.plane, self.planes);
        self.values.send(false, |end, n, to| {
            let carrier = of_cell([first, last][end] + plane[n]);
            to.copy_from_slice(&carrier.map_or([0.0; NUMBERS], |carrier| carrier.numbers()));
        });
        let carriers = &mut self.around.carriers;
        self.values
            .receive(false, |end, n, from| carriers[end][n].copy_from_slice(from));
    }

    /// Returns the moments of the cells around the slab.
    pub(super) fn around(&self) -> &Around {
        &self.around
    }
}

impl Live {
    /// Returns the state at the start, at which all ghost cells are updated.
    fn new(planes: usize, rows: usize, ghost_rows: bool) -> Self {
        let ghosts = if ghost_rows { 2 } else { 0 };
        Self {
            planes: vec![LINGER; planes + 2],
            whole: vec![LINGER; planes + 2],
            rows: vec![LINGER; planes * rows],
            count: [rows, rows + ghosts],
        }
    }

    /// Notes the planes and the rows of the slab in which cells may have changed.
    fn note(&mut self, planes: &[Plane], everywhere: bool) {
        for (n, plane) in planes.iter().enumerate() {
            let whole = plane.is_outdated() || everywhere && plane.is_live();
            if whole {
                self.whole[n + 1] = LINGER;
            }
            if whole || !plane.surface.is_empty() {
                self.planes[n + 1] = LINGER;
            }
            for &row in &plane.rows {
                self.rows[n * self.count[0] + row as usize] = LINGER;
            }
        }
    }

    /// Calls `copy` with the copies of a group that are still made.
    #[inline(always)]
    fn each(&self, group: &Group, copies: &[Run], mut copy: impl FnMut(&Run)) {
        if self.planes[group.plane] == 0 {
            return;
        }
        let [rows, with_ghosts] = self.count;
        if !group.of_rows || self.whole[group.plane] > 0 || copies.len() != with_ghosts {
            copies.iter().for_each(copy);
            return;
        }
        let ghosts = (with_ghosts - rows) / 2;
        let inner = ghosts..ghosts + rows;
        let (lower, upper) = (&copies[..inner.start], &copies[inner.end..]);
        lower.iter().chain(upper).for_each(&mut copy);
        let steps = &self.rows[(group.plane - 1) * rows..][..rows];
        for (run, steps) in copies[inner].iter().zip(steps) {
            if *steps > 0 {
                copy(run);
            }
        }
    }

    /// Counts a step.
    fn pass(&mut self) {
        for steps in [&mut self.planes, &mut self.whole, &mut self.rows] {
            for steps in steps {
                *steps = steps.saturating_sub(1);
            }
        }
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

    /// Returns `true` if a position belongs to a ghost cell that may contain water.
    #[inline(always)]
    pub(super) fn holds(&self, cell: usize) -> bool {
        self.ghost[cell]
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
