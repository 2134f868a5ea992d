//! Cells covered by a body, as runs along the rows of the lattice.

use super::super::solid_fraction::{
    BallInCells, Form, FractionMethod, PolyhedronSurface, RowAxes, Scratch,
};
use base::ball::NormalDistances;
use base::number::{floor_i32, single, to_i32, to_u32};
use lbm::lanes::{Level, WIDEST, Work};
use lbm::saturation::DEEP;
use lbm::saturation::cover::CoverPart;
use std::ops::Range;

/// Run of neighbouring cells of a row.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Position in the lattice of cell 0 of the row.
    row: u32,
    /// First cell.
    first: i32,
    /// End of its fractions in [`Runs::parts`]; they begin at the end of the previous run.
    end: u32,
}

/// Cells of one body in ascending order of positions, at most one run per row.
#[derive(Debug, Default)]
pub(super) struct Runs {
    runs: Vec<Run>,
    /// Solid fraction of each cell: [`DEEP`] for cells deep inside, 0 for cells not covered, and negative for ghost
    /// cells. Elements beyond the end of the last run are spare capacity.
    parts: Vec<f32>,
}

/// Run with its fractions.
type Piece<'a> = (Run, &'a [f32]);

impl Runs {
    pub(super) fn clear(&mut self) {
        self.runs.clear();
    }

    /// Returns the end of the fractions of the last run.
    fn end(&self) -> usize {
        self.runs.last().map_or(0, |run| run.end as usize)
    }

    /// Adds runs of later rows.
    pub(super) fn append(&mut self, later: &Self) {
        let beyond = to_u32(self.end());
        self.parts.truncate(self.end());
        self.parts.extend_from_slice(&later.parts[..later.end()]);
        let runs = later.runs.iter().map(|run| Run {
            end: run.end + beyond,
            ..*run
        });
        self.runs.extend(runs);
    }

    /// Returns the pieces of the runs in this range.
    fn pieces_in(&self, runs: Range<usize>) -> impl Iterator<Item = Piece<'_>> {
        let mut start = self.end_before(runs.start);
        self.runs[runs].iter().map(move |run| {
            let parts = &self.parts[start..run.end as usize];
            start = run.end as usize;
            (*run, parts)
        })
    }

    /// Returns the start of the fractions of a run.
    fn end_before(&self, run: usize) -> usize {
        let before = run.checked_sub(1);
        before.map_or(0, |before| self.runs[before].end as usize)
    }

    /// Returns the index range of the runs in rows whose positions are in a range.
    fn within(&self, positions: &Range<usize>) -> Range<usize> {
        let lies =
            |run: Option<&Run>| run.is_some_and(|run| positions.contains(&(run.row as usize)));
        if lies(self.runs.first()) && lies(self.runs.last()) {
            return 0..self.runs.len();
        }
        let before = |position: usize| {
            self.runs
                .partition_point(|run| (run.row as usize) < position)
        };
        before(positions.start)..before(positions.end)
    }

    /// Returns the position and solid fraction of the cells in the rows of one thread.
    pub(super) fn cells_of_thread(
        &self,
        thread: usize,
        threads: usize,
    ) -> impl Iterator<Item = (usize, f32)> {
        let [from, to] = [thread, thread + 1].map(|t| self.runs.len() * t / threads);
        self.pieces_in(from..to).flat_map(|(run, parts)| {
            let row = run.row as usize;
            let cells = (run.first..).zip(parts);
            cells.map(move |(k, part)| (row.wrapping_add_signed(k as isize), *part))
        })
    }

    /// Removes the cells that are marked at their position.
    pub(super) fn leave_out(&mut self, closed: &[bool]) {
        let mut start = 0;
        for run in &self.runs {
            let parts = &mut self.parts[start..run.end as usize];
            for (k, part) in (run.first..).zip(parts) {
                if closed[(run.row as usize).wrapping_add_signed(k as isize)] {
                    *part = 0.0;
                }
            }
            start = run.end as usize;
        }
    }

    /// Writes to a part of the cover only the cells of a body that differ from `before`. Each row belongs to one
    /// part.
    pub(super) fn write_changes(&self, cover: &mut CoverPart<'_>, slot: u32, before: &Self) {
        // Number of runs by which cells are prefetched: the pass over the populations has evicted them from the
        // cache.
        const AHEAD: usize = 16;
        let place = |run: &Run, k: i32| (run.row as usize).wrapping_add_signed(k as isize);
        let positions = cover.positions();
        let (here, olds) = (self.within(&positions), before.within(&positions));
        let ask = |cover: &CoverPart<'_>, k: usize| {
            if k < here.end {
                let run = &self.runs[k];
                cover.ask(place(run, run.first));
                let count = run.end as usize - self.end_before(k);
                cover.ask(place(run, run.first + to_i32(count)));
            }
        };
        for k in here.start..here.start + AHEAD {
            ask(cover, k);
        }
        let mut olds = before.pieces_in(olds).peekable();
        for (k, (run, parts)) in here.clone().zip(self.pieces_in(here.clone())) {
            ask(cover, k + AHEAD);
            while let Some((old, gone)) = olds.next_if(|(old, _)| old.row < run.row) {
                change(cover, slot, old.row, (old.first, gone), (old.first, &[]));
            }
            match olds.next_if(|(old, _)| old.row == run.row) {
                Some((old, was)) => {
                    change(cover, slot, run.row, (old.first, was), (run.first, parts));
                }
                None => change(cover, slot, run.row, (run.first, &[]), (run.first, parts)),
            }
        }
        for (old, gone) in olds {
            change(cover, slot, old.row, (old.first, gone), (old.first, &[]));
        }
    }
}

/// Writes the difference of two runs of a row, each given by its first cell and its fractions.
#[inline(always)]
fn change(
    cover: &mut CoverPart<'_>,
    slot: u32,
    row: u32,
    (was_first, was): (i32, &[f32]),
    (first, parts): (i32, &[f32]),
) {
    let row = row as usize;
    let mut write = |k: i32, part: f32| {
        cover.cover(row.wrapping_add_signed(k as isize), slot, part);
    };
    // The cells in both runs lie between `from` and `to`.
    let from = was_first.max(first);
    let to = (was_first + to_i32(was.len()))
        .min(first + to_i32(parts.len()))
        .max(from);
    let cut = |first: i32, parts: &[f32], k: i32| whole(k - first).min(parts.len());
    let (was_from, was_to) = (cut(was_first, was, from), cut(was_first, was, to));
    let (parts_from, parts_to) = (cut(first, parts, from), cut(first, parts, to));
    for (k, gone) in [
        (was_first, &was[..was_from]),
        (was_first.max(to), &was[was_to..]),
    ] {
        for (k, _) in (k..).zip(gone).filter(|(_, held)| **held != 0.0) {
            write(k, 0.0);
        }
    }
    for (k, new) in [
        (first, &parts[..parts_from]),
        (first.max(to), &parts[parts_to..]),
    ] {
        for (k, part) in (k..).zip(new).filter(|(_, part)| **part != 0.0) {
            write(k, *part);
        }
    }
    let both = (&was[was_from..was_to], &parts[parts_from..parts_to]);
    let first = row.wrapping_add_signed(from as isize);
    if both.1.is_empty() || cover.cover_alone(first, slot, both.1) {
        return;
    }
    for (place, (held, part)) in (first..).zip(both.0.iter().zip(both.1)) {
        if held.to_bits() != part.to_bits() {
            cover.cover(place, slot, *part);
        }
    }
}

/// Lattice as rows of cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows {
    pub(super) cells: [i32; 3],
    pub(super) strides: [usize; 3],
    pub(super) origin: usize,
    /// Axes from slowest to fastest.
    pub(super) order: [usize; 3],
    /// Axes along which the volumes of polyhedra are summed, from slowest to fastest.
    pub(super) sums: [usize; 3],
    pub(super) level: Level,
    pub(super) dimension: usize,
}

fn whole(n: i32) -> usize {
    usize::try_from(n).unwrap_or(0)
}

/// Operation that lists the cells of the slab and its ghost cells that a body fills. Rounding to whole cells is one
/// instruction with AVX2, and a function call without.
pub(super) struct Walk<'a, 'f> {
    pub(super) rows: &'a Rows,
    pub(super) form: &'a Form<'f>,
    /// Offset from the raw frame of the body to the cells of the slab.
    pub(super) frame: [i32; 3],
    /// Planes of the slab to search; ghost planes are those before the first and after the last.
    pub(super) planes: Range<i32>,
    pub(super) method: FractionMethod,
    pub(super) scratch: &'a mut Scratch,
    pub(super) found: &'a mut Runs,
}

/// Table of the exact fractions.
#[derive(Clone, Copy)]
enum Exact<'a> {
    Ball,
    Disc,
    Block(&'a PolyhedronSurface),
    /// No table: each cell is measured separately.
    None,
}

impl<'a> Exact<'a> {
    #[inline(always)]
    fn new(form: &Form<'a>, method: FractionMethod, fast: usize) -> Self {
        match (form, method) {
            (Form::Ball { .. }, FractionMethod::Exact) => Self::Ball,
            (Form::Disc { .. }, FractionMethod::Exact) if fast < 2 => Self::Disc,
            (Form::Block { surface, .. }, FractionMethod::Exact) => Self::Block(surface),
            _ => Self::None,
        }
    }
}

/// Box of cells that contains the part of a body in a slab.
struct Area<'a, 'f> {
    rows: &'a Rows,
    form: &'a Form<'f>,
    frame: [i32; 3],
    method: FractionMethod,
    exact: Exact<'f>,
    /// First cell along each axis, and one past the last.
    low: [i32; 3],
    high: [i32; 3],
    /// Axes of the layers, of the rows of a layer and of the cells of a row.
    axes: [usize; 3],
}

/// Coordinates of a row of cells.
#[derive(Clone, Copy)]
struct Place {
    /// Coordinate along the axis of the layers.
    layer: i32,
    /// Coordinate along the axis of the rows of a layer.
    row: i32,
}

/// Cells of a row by their relation to a body: those that the body may intersect, those that it fills, and those that
/// it fills together with all adjacent cells.
struct InRow {
    outer: Range<i32>,
    full: Range<i32>,
    deep: Range<i32>,
}

impl Work for Walk<'_, '_> {
    #[inline(always)]
    fn run(self) {
        self.found.clear();
        let Some(area) = self.area() else { return };
        let Walk { scratch, found, .. } = self;
        area.fill(scratch);
        let [slow, middle, fast] = area.axes;
        let mut end = 0;
        for layer in area.low[slow]..area.high[slow] {
            area.layer(layer, scratch);
            // Capacity for all cells of the layer.
            let room = area.count(middle) * area.count(fast) + WIDEST;
            if found.parts.len() < end + room {
                found.parts.resize(end + room, 0.0);
            }
            for row in area.low[middle]..area.high[middle] {
                let place = Place { layer, row };
                let Some(cells) = area.cells(place, scratch) else {
                    continue;
                };
                let length = whole(cells.outer.end - cells.outer.start);
                if matches!(area.exact, Exact::None) {
                    let parts = &mut found.parts[end..end + length];
                    area.measure(place, &cells, scratch, parts);
                } else {
                    // Copied in whole vectors; elements beyond the end of the row are overwritten.
                    let padded = length.next_multiple_of(WIDEST);
                    let parts = &mut found.parts[end..end + padded];
                    area.take(place, &cells, scratch, parts);
                }
                let first = cells.outer.start;
                area.mark_ghosts(place, first, &mut found.parts[end..end + length]);
                end += length;
                found.runs.push(Run {
                    row: to_u32(area.position(place)),
                    first,
                    end: to_u32(end),
                });
            }
        }
    }
}

impl<'a, 'f> Walk<'a, 'f> {
    /// Returns the box of the body; none if it has no cell in the slab.
    #[inline(always)]
    fn area(&self) -> Option<Area<'a, 'f>> {
        let (rows, frame) = (self.rows, self.frame);
        if rows.cells.contains(&0) {
            return None;
        }
        let (centre, radius) = self.form.bounds();
        let (mut low, mut high) = ([0; 3], [1; 3]);
        for a in 0..rows.dimension {
            low[a] = (floor_i32(centre[a] - radius) + frame[a]).max(-1);
            high[a] = (floor_i32(centre[a] + radius) + 1 + frame[a]).min(rows.cells[a] + 1);
        }
        low[rows.order[0]] = low[rows.order[0]].max(self.planes.start);
        high[rows.order[0]] = high[rows.order[0]].min(self.planes.end);
        if (0..3).any(|a| low[a] >= high[a]) {
            return None;
        }
        // In the plane all rows are in one layer, so that their ends are computed together.
        let axes = match rows.order {
            [slow, middle, fast] if middle >= rows.dimension => [middle, slow, fast],
            order => order,
        };
        Some(Area {
            rows,
            form: self.form,
            frame,
            method: self.method,
            exact: Exact::new(self.form, self.method, axes[2]),
            low,
            high,
            axes,
        })
    }
}

impl Area<'_, '_> {
    #[inline(always)]
    fn count(&self, axis: usize) -> usize {
        whole(self.high[axis] - self.low[axis])
    }

    #[inline(always)]
    fn beside(&self, axis: usize, raw: i32) -> NormalDistances {
        if axis < self.rows.dimension {
            NormalDistances::along_axis(self.form.bounds().0[axis], f64::from(raw))
        } else {
            NormalDistances::default()
        }
    }

    /// Prepares the tables: exact fractions are computed for all cells of the box at once.
    #[inline(always)]
    fn fill(&self, scratch: &mut Scratch) {
        let (centre, radius) = self.form.bounds();
        let (mut cells, mut lower) = ([0; 3], [0; 3]);
        for a in 0..3 {
            cells[a] = self.high[a] - self.low[a];
            lower[a] = self.low[a] - self.frame[a];
        }
        let [_, middle, fast] = self.axes;
        match self.exact {
            Exact::Ball => scratch.ball.fill(&BallInCells {
                centre,
                radius,
                lower,
                cells: cells.map(whole),
                order: self.rows.order,
            }),
            Exact::Disc => scratch.disc.fill((centre, radius), (lower, cells), fast),
            Exact::Block(surface) => {
                let axes = RowAxes {
                    lattice: self.axes,
                    sums: self.rows.sums,
                };
                (scratch.block).fill(surface, lower, cells.map(whole), axes);
            }
            Exact::None => {}
        }
        let first = lower[middle];
        match self.form {
            Form::Block { .. } => scratch.block_rows.fill(first, cells[middle], self.axes),
            Form::Disc { .. } | Form::Ball { .. } => {
                let beside = |row| self.beside(middle, first + to_i32(row));
                scratch.round.fill(self.count(middle), beside);
            }
        }
    }

    /// Prepares a layer.
    #[inline(always)]
    fn layer(&self, layer: i32, scratch: &mut Scratch) {
        let [slow, _, fast] = self.axes;
        let raw = layer - self.frame[slow];
        match self.form {
            Form::Block { surface, .. } => {
                scratch.block_rows.layer(surface.planes(), f64::from(raw));
            }
            Form::Disc { centre, radius } | Form::Ball { centre, radius } => {
                let beside = self.beside(slow, raw);
                (scratch.round).layer(beside, centre[fast], *radius, self.frame[fast]);
            }
        }
        let layer = whole(layer - self.low[slow]);
        match self.exact {
            Exact::Ball => scratch.ball.layer(layer),
            Exact::Block(surface) => scratch.block.layer(surface, layer),
            Exact::Disc | Exact::None => {}
        }
    }

    /// Returns the cells of a row; none if the body does not intersect it.
    #[inline(always)]
    fn cells(&self, place: Place, scratch: &Scratch) -> Option<InRow> {
        let [_, middle, fast] = self.axes;
        let across = whole(place.row - self.low[middle]);
        let row = match self.form {
            Form::Block { .. } => scratch.block_rows.row(across, self.frame[fast]),
            Form::Disc { .. } | Form::Ball { .. } => scratch.round.row(across),
        };
        let outer = row.outer[0].max(self.low[fast])..row.outer[1].min(self.high[fast]);
        if outer.start >= outer.end {
            return None;
        }
        let full = clamped(row.full, &outer);
        let deep = clamped(row.deep, &full);
        Some(InRow { outer, full, deep })
    }

    /// Copies the fractions of a row from the table, in one loop.
    #[inline(always)]
    fn take(&self, place: Place, cells: &InRow, scratch: &mut Scratch, parts: &mut [f32]) {
        let [slow, middle, fast] = self.axes;
        let InRow { outer, full, deep } = cells;
        let (start, count) = (whole(outer.start - self.low[fast]), parts.len());
        let across = whole(place.row - self.low[middle]);
        let fractions = match self.exact {
            Exact::Ball => scratch.ball.row(across, start, count),
            Exact::Block(_) => scratch.block.row(across, start, count),
            Exact::Disc | Exact::None => {
                // One of the two axes has a single cell.
                let row = whole(place.layer - self.low[slow]).max(across);
                scratch.disc.row(row, start, count)
            }
        };
        let (from, to) = (full.start - outer.start, full.end - outer.start);
        let (from_deep, to_deep) = (deep.start - outer.start, deep.end - outer.start);
        for (k, (part, fraction)) in (0..).zip(parts.iter_mut().zip(fractions)) {
            let surface = single(*fraction);
            let inside = if from_deep <= k && k < to_deep {
                DEEP
            } else {
                1.0
            };
            *part = if from <= k && k < to { inside } else { surface };
        }
    }

    /// Measures the cells at the surface one by one; the cells between them are full.
    #[inline(always)]
    fn measure(&self, place: Place, cells: &InRow, scratch: &mut Scratch, parts: &mut [f32]) {
        let [slow, middle, fast] = self.axes;
        let InRow { outer, full, deep } = cells;
        let within =
            |cells: &Range<i32>| whole(cells.start - outer.start)..whole(cells.end - outer.start);
        let mut raw = [0; 3];
        raw[slow] = place.layer - self.frame[slow];
        raw[middle] = place.row - self.frame[middle];
        for cells in [outer.start..full.start, full.end..outer.end] {
            let surface = &mut parts[within(&cells)];
            for (k, part) in cells.zip(surface) {
                raw[fast] = k - self.frame[fast];
                *part = single(self.form.fraction(self.method, corner(raw), scratch));
            }
        }
        parts[within(full)].fill(1.0);
        parts[within(deep)].fill(DEEP);
    }

    /// Marks the ghost cells of a row that begins at cell `first`: all of them, or those at its ends.
    #[inline(always)]
    fn mark_ghosts(&self, place: Place, first: i32, parts: &mut [f32]) {
        let ([slow, middle, fast], cells) = (self.axes, &self.rows.cells);
        let ghosts =
            !(0..cells[slow]).contains(&place.layer) || !(0..cells[middle]).contains(&place.row);
        let length = parts.len();
        let before = if ghosts {
            length
        } else {
            whole(-first).min(length)
        };
        let own = whole(cells[fast] - first).clamp(before, length);
        for part in &mut parts[..before] {
            turn(part);
        }
        for part in &mut parts[own..] {
            turn(part);
        }
    }

    /// Returns the position in the lattice of cell 0 of a row.
    #[inline(always)]
    fn position(&self, place: Place) -> usize {
        let strides = &self.rows.strides;
        let along = |axis: usize, k: i32| strides[axis].cast_signed() * k as isize;
        self.rows
            .origin
            .wrapping_add_signed(along(self.axes[0], place.layer))
            .wrapping_add_signed(along(self.axes[1], place.row))
    }
}

/// Marks a ghost cell.
#[inline(always)]
fn turn(part: &mut f32) {
    // This avoids -0, so that a cell that is not covered has one representation.
    *part = 0.0 - *part;
}

/// Returns the part of the cells within a range; an empty part also lies within the range.
#[inline(always)]
fn clamped([start, end]: [i32; 2], range: &Range<i32>) -> Range<i32> {
    let start = start.clamp(range.start, range.end);
    start..end.clamp(start, range.end)
}

/// Returns the lower corner of a cell.
#[inline(always)]
fn corner(cell: [i32; 3]) -> [f64; 3] {
    [f64::from(cell[0]), f64::from(cell[1]), f64::from(cell[2])]
}
