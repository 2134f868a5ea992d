//! Search for candidate pairs: those that may touch before the lists are built again.
//!
//! The search combines two grids. Small bodies are entered into every cell of one grid that their box overlaps, as
//! in CGRID (J. R. Williams, E. Perkins, B. Cook 2004). Pairs are sought within each cell; a pair is counted in the
//! first cell that both bodies share. The width of the cells follows the cubic mean of the radii, so that a body is
//! in a few cells.
//!
//! A few giants among many small bodies would make these cells too wide. The largest bodies are therefore entered
//! into one grid per size class, with classes a factor of 2 apart in radius, and every smaller body searches these
//! grids for neighbours. The cost per grain then depends little on the ratio of sizes. `benches/neighbors.rs`
//! measures it.
//!
//! Each thread processes rows of cells, then first bodies of pairs ([`super::buckets`]).
//!
//! Each pair occurs once, with the lower (id, shift) first, in the order of the first and then the second body.
//! Summed in this order, the forces on a grain are added in the order of the other grain's id.

use super::buckets::{Buckets, Items};
use super::particles::{Particles, ParticlesView};
use super::space::{Components, Space};
use base::number::real;
use base::thread_pool;
use std::ops::Range;

/// Grids of a search. They are needed only while lists are built and dropped afterwards, which keeps the memory per
/// grain low.
#[derive(Debug, Default)]
pub struct Search {
    /// Size classes of the large bodies; finer classes are empty.
    classes: Vec<Class>,
    class_of: Vec<u8>,
    /// First class of the small bodies.
    small: usize,
    grid: Overlaps,
    /// Position and radius of each entry.
    points: Vec<[f64; 4]>,
    /// Large bodies, and the cell of each body in the grid of its class.
    large: Vec<u32>,
    cell_of: Vec<u32>,
    /// Pairs found by each thread.
    found: Vec<Vec<[u32; 2]>>,
}

/// Pairs found by a search, in the order defined in the module.
#[derive(Debug)]
pub(super) struct Candidates {
    /// Entries in ascending order of (id, shift).
    order: Vec<u32>,
    /// Second bodies of the n-th entry in `order`, as indices in `order`.
    seconds: Buckets,
}

#[derive(Debug, Default)]
struct Class {
    largest: f64,
    members: usize,
    low: [f64; 3],
    high: [f64; 3],
    inverse: f64,
    counts: [usize; 3],
    start: Vec<u32>,
    entries: Vec<u32>,
    /// Position and radius of each entry, contiguous for reading a cell.
    points: Vec<[f64; 4]>,
}

const CLASSES: usize = 24;

/// Width of the cells of the small bodies divided by the cubic mean of their radii.
const WIDTH: f64 = 3.4;
/// Maximum width of a cell divided by the mean diameter of these bodies: wider cells would contain too many of
/// them.
const MAX_CELL_WIDTH: f64 = 8.0;

/// Grid with all small bodies whose box overlaps each cell.
#[derive(Debug, Default)]
struct Overlaps {
    low: [f64; 3],
    inverse: f64,
    counts: [usize; 3],
    cells: Buckets,
    /// Range of cells of each body; empty for large bodies.
    spans: Vec<Span>,
}

/// Range of cells of a body along each axis, first and last.
type Span = [[u32; 2]; 3];

/// Span without a cell.
const EMPTY_SPAN: Span = [[1, 0]; 3];

/// Minimum number of bodies per thread.
const PER_THREAD: usize = 1000;

/// Returns the number of threads used for a number of bodies.
pub(super) fn threads_for(bodies: usize) -> usize {
    thread_pool::threads().min(bodies / PER_THREAD).max(1)
}

/// Bodies in the cells of a grid.
struct InCells<'a> {
    spans: &'a [Span],
    counts: [usize; 3],
}

impl Items for InCells<'_> {
    #[inline]
    fn each(&self, cells: &Range<usize>, mut put: impl FnMut(usize, u32)) {
        let [along, across, _] = self.counts;
        // Each thread processes whole rows.
        let rows = cells.start / along..cells.end / along;
        let row = |y: u32, z: u32| z as usize * across + y as usize;
        for (k, span) in (0..).zip(self.spans) {
            let [_, [y, last_y], [z, last_z]] = *span;
            if row(y, z) >= rows.end || row(last_y, last_z) < rows.start {
                continue;
            }
            for z in z..=last_z {
                for y in y..=last_y {
                    let row = row(y, z);
                    if rows.contains(&row) {
                        for x in span[0][0]..=span[0][1] {
                            put(row * along + x as usize, k);
                        }
                    }
                }
            }
        }
    }
}

impl Overlaps {
    fn cell(&self, at: f64, axis: usize) -> u32 {
        super::ghosts::index(cells_clamped(
            (at - self.low[axis]) * self.inverse,
            self.counts[axis],
        ))
    }

    /// Calls `visit` with each cell of a span: its number and its coordinates.
    #[inline]
    fn each_cell(&self, span: &[[u32; 2]; 3], mut visit: impl FnMut(usize, [u32; 3])) {
        for z in span[2][0]..=span[2][1] {
            for y in span[1][0]..=span[1][1] {
                let row = (z as usize * self.counts[1] + y as usize) * self.counts[0];
                for x in span[0][0]..=span[0][1] {
                    visit(row + x as usize, [x, y, z]);
                }
            }
        }
    }

    /// Builds the grid of the members for which `is_small` is `true`; boxes extend half a gap beyond the surfaces.
    fn fill<S: Space>(
        &mut self,
        points: &[[f64; 4]],
        is_small: impl Fn(usize) -> bool + Sync,
        gap: f64,
    ) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (mut members, mut cubes) = (0_usize, 0.0);
        for (_, at) in points.iter().enumerate().filter(|(k, _)| is_small(*k)) {
            let r = at[3] + 0.5 * gap;
            members += 1;
            cubes += r * r * r;
            for axis in 0..3 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
        self.cells.clear();
        self.counts = [0; 3];
        if members == 0 {
            return;
        }
        let mut width = WIDTH * (cubes / real(members)).cbrt();
        // The number of cells is limited to a multiple of the members, however far they are spread.
        loop {
            self.counts = [1; 3];
            for axis in 0..S::DIMENSION {
                self.counts[axis] = cells((high[axis] - low[axis]) / width);
            }
            if self.counts.iter().fold(1.0, |n, &c| n * real(c)) <= 4.0 * real(members) + 64.0 {
                break;
            }
            width *= 1.25;
        }
        self.low = low;
        self.inverse = 1.0 / width;
        let mut spans = std::mem::take(&mut self.spans);
        spans.clear();
        spans.reserve_exact(points.len());
        spans.resize(points.len(), EMPTY_SPAN);
        let threads = threads_for(points.len());
        thread_pool::each_item(&mut spans, PER_THREAD, |k, span| {
            if is_small(k) {
                *span = [[0; 2]; 3];
                let at = &points[k];
                let r = at[3] + 0.5 * gap;
                for (axis, ends) in span.iter_mut().enumerate().take(S::DIMENSION) {
                    *ends = [self.cell(at[axis] - r, axis), self.cell(at[axis] + r, axis)];
                }
            }
        });
        let [along, across, deep] = self.counts;
        let rows = across * deep;
        let items = InCells {
            spans: &spans,
            counts: self.counts,
        };
        let bound = |t: usize| rows * t / threads * along;
        self.cells.fill(rows * along, threads, bound, &items);
        self.spans = spans;
    }

    /// Returns the first row of cells of a thread.
    fn row_of(&self, thread: usize, threads: usize) -> usize {
        let [along, across, deep] = self.counts;
        let bound = self.cells.bound(thread, threads).div_ceil(along.max(1));
        bound.min(across * deep)
    }

    /// Calls `visit` with every two bodies whose boxes overlap, and some others, each pair in one cell, for the cells
    /// in a range of rows.
    #[inline]
    fn pairs(&self, rows: Range<usize>, mut visit: impl FnMut(usize, usize)) {
        let [along, across, _] = self.counts;
        for row in rows {
            let at = |n: usize| super::ghosts::index(n);
            let (y, z) = (at(row % across), at(row / across));
            for x in 0..along {
                let members = self.cells.numbers_in(row * along + x);
                let here = [at(x), y, z];
                for (i, &a) in members.iter().enumerate() {
                    let first = &self.spans[a as usize];
                    for &b in &members[i + 1..] {
                        let second = &self.spans[b as usize];
                        let shared: [u32; 3] =
                            std::array::from_fn(|axis| first[axis][0].max(second[axis][0]));
                        if shared == here {
                            visit(a as usize, b as usize);
                        }
                    }
                }
            }
        }
    }

    /// Calls `visit` once with every member whose box overlaps the box between two corners, and with some others.
    fn near<S: Space>(&self, low: &S::Vector, high: &S::Vector, mut visit: impl FnMut(usize)) {
        if self.cells.len() == 0 {
            return;
        }
        let mut span = [[0; 2]; 3];
        for (axis, ends) in span.iter_mut().enumerate().take(S::DIMENSION) {
            *ends = [
                self.cell(low.get(axis), axis),
                self.cell(high.get(axis), axis),
            ];
        }
        self.each_cell(&span, |cell, here| {
            for &k in self.cells.numbers_in(cell) {
                let other = &self.spans[k as usize];
                if (0..3).all(|axis| span[axis][0].max(other[axis][0]) == here[axis]) {
                    visit(k as usize);
                }
            }
        });
    }
}

impl Search {
    /// Finds every pair with a gap of at most `gap` \[m\] of which at least one body is owned and at least one
    /// moves under forces.
    pub(super) fn find_candidates<S: Space>(
        &mut self,
        particles: &Particles<S>,
        gap: f64,
    ) -> Candidates {
        self.find_pairs(particles, gap);
        Candidates::in_order(std::mem::take(&mut self.found), particles)
    }

    /// Returns the number of pairs that the engine's search finds, without sorting them. Intended for measurements.
    pub fn find_pairs<S: Space>(&mut self, particles: &Particles<S>, gap: f64) -> usize {
        self.sort_into_classes(particles, gap);
        self.find(particles, gap);
        self.found.iter().map(Vec::len).sum()
    }

    /// Calls `visit` with every entry of the last [`Self::find_candidates`] whose surface may be within `gap` \[m\]
    /// of the box between two corners, and with some others.
    pub(super) fn near<S: Space>(
        &self,
        low: &S::Vector,
        high: &S::Vector,
        gap: f64,
        mut visit: impl FnMut(usize),
    ) {
        for class in self
            .classes
            .iter()
            .filter(|class| !class.entries.is_empty())
        {
            class.visit::<S>(low, high, class.largest + gap, |m, _| visit(m));
        }
        let (mut from, mut to) = (*low, *high);
        for axis in 0..S::DIMENSION {
            from.set(axis, low.get(axis) - 0.5 * gap);
            to.set(axis, high.get(axis) + 0.5 * gap);
        }
        self.grid.near::<S>(&from, &to, visit);
    }

    fn sort_into_classes<S: Space>(&mut self, particles: &Particles<S>, gap: f64) {
        let count = particles.len();
        let largest = particles
            .body
            .iter()
            .map(|body| body.radius)
            .fold(0.0, f64::max);
        self.class_of.clear();
        self.class_of.extend(
            particles
                .body
                .iter()
                .map(|body| class(largest, body.radius)),
        );
        self.classes.resize_with(CLASSES, Class::default);
        self.points.clear();
        self.points.extend((0..count).map(|k| {
            let at = particles.location(k);
            let mut point = [0.0, 0.0, 0.0, particles.body[k].radius];
            for (axis, place) in point.iter_mut().enumerate().take(S::DIMENSION) {
                *place = at.get(axis);
            }
            point
        }));
        for class in &mut self.classes {
            class.entries.clear();
            class.largest = 0.0;
            class.low = [f64::INFINITY; 3];
            class.high = [f64::NEG_INFINITY; 3];
            class.members = 0;
        }
        self.small = self.first_small(gap);
        let (class_of, small) = (&self.class_of, self.small);
        let is_small = |k: usize| usize::from(class_of[k]) >= small;
        self.grid.fill::<S>(&self.points, is_small, gap);
        self.large.clear();
        self.large
            .extend((0..super::ghosts::index(count)).filter(|&k| !is_small(k as usize)));
        for k in self.large.iter().map(|&k| k as usize) {
            let class = &mut self.classes[usize::from(self.class_of[k])];
            class.members += 1;
            class.largest = class.largest.max(particles.body[k].radius);
            for (axis, at) in self.points[k].into_iter().take(3).enumerate() {
                class.low[axis] = class.low[axis].min(at);
                class.high[axis] = class.high[axis].max(at);
            }
        }
        for class in self.classes.iter_mut().filter(|class| class.members > 0) {
            let mut size = 2.0 * class.largest + gap;
            // The number of cells is limited to a multiple of the members, however far they are spread.
            loop {
                class.counts = [1; 3];
                for axis in 0..S::DIMENSION {
                    class.counts[axis] = cells((class.high[axis] - class.low[axis]) / size);
                }
                if class.counts.iter().fold(1.0, |n, &c| n * real(c))
                    <= 4.0 * real(class.members) + 64.0
                {
                    break;
                }
                size *= 1.25;
            }
            class.inverse = 1.0 / size;
            let total = class.counts.iter().product::<usize>();
            class.start.clear();
            class.start.resize(total + 1, 0);
            class.entries.resize(class.members, 0);
            class.points.resize(class.members, [0.0; 4]);
        }
        self.cell_of.clear();
        for k in self.large.iter().map(|&k| k as usize) {
            let class = &mut self.classes[usize::from(self.class_of[k])];
            let cell = class.cell_of(&self.points[k]);
            class.start[cell + 1] += 1;
            self.cell_of.push(super::ghosts::index(cell));
        }
        for class in self.classes.iter_mut().filter(|class| class.members > 0) {
            for cell in 1..class.start.len() {
                class.start[cell] += class.start[cell - 1];
            }
        }
        for (k, &cell) in self.large.iter().map(|&k| k as usize).zip(&self.cell_of) {
            let class = &mut self.classes[usize::from(self.class_of[k])];
            // `start` is advanced while filling and reset below.
            let slot = &mut class.start[cell as usize];
            class.entries[*slot as usize] = super::ghosts::index(k);
            let point = self.points[k];
            class.points[*slot as usize] = point;
            *slot += 1;
        }
        for class in self.classes.iter_mut().filter(|class| class.members > 0) {
            for cell in (1..class.start.len()).rev() {
                class.start[cell] = class.start[cell - 1];
            }
            class.start[0] = 0;
        }
    }

    /// Returns the first class of the small bodies, without giants, whose cells would be too wide.
    fn first_small(&self, gap: f64) -> usize {
        let mut sums = [[0.0_f64; 3]; CLASSES];
        for (class, point) in self.class_of.iter().zip(&self.points) {
            let r = point[3] + 0.5 * gap;
            let sum = &mut sums[usize::from(*class)];
            for (sum, part) in sum.iter_mut().zip([1.0, r, r * r * r]) {
                *sum += part;
            }
        }
        let fits = |first: &usize| {
            let total = |k: usize| sums[*first..].iter().map(|sum| sum[k]).sum::<f64>();
            let count = f64::max(total(0), 1.0);
            WIDTH * (total(2) / count).cbrt() <= MAX_CELL_WIDTH * 2.0 * total(1) / count
        };
        (0..CLASSES).find(fits).unwrap_or(CLASSES)
    }

    fn find<S: Space>(&mut self, particles: &Particles<S>, gap: f64) {
        let particles = particles.view();
        let (owned, count) = (particles.owned, particles.body.len());
        let threads = threads_for(count);
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        found.resize_with(threads, Vec::new);
        let moves = |k: usize| particles.mobility[k].meets_all();
        let (grid, points) = (&self.grid, &self.points);
        thread_pool::each_item(&mut found, 1, |t, found| {
            // As many as in a bed of discs, so that a small scene seldom needs more capacity.
            found.reserve(4 * count / threads);
            let rows = grid.row_of(t, threads)..grid.row_of(t + 1, threads);
            grid.pairs(rows, |k, m| {
                let (one, other) = (&points[k], &points[m]);
                let mut squared = 0.0;
                for axis in 0..S::DIMENSION {
                    let d = other[axis] - one[axis];
                    squared += d * d;
                }
                let reach = one[3] + other[3] + gap;
                let counts = (k < owned || m < owned) && (moves(k) || moves(m));
                if squared <= reach * reach && counts {
                    found.push([super::ghosts::index(k), super::ghosts::index(m)]);
                }
            });
            if self.small > 0 {
                let bound = |t: usize| count * t / threads;
                self.find_large(&particles, gap, bound(t)..bound(t + 1), found);
            }
        });
        self.found = found;
    }

    /// Finds the pairs of some entries with large bodies.
    fn find_large<S: Space>(
        &self,
        particles: &ParticlesView<'_, S>,
        gap: f64,
        entries: Range<usize>,
        found: &mut Vec<[u32; 2]>,
    ) {
        let owned = particles.owned;
        let moves = |k: usize| particles.mobility[k].meets_all();
        for k in entries {
            let level = usize::from(self.class_of[k]);
            let at = particles.location(k);
            let radius = particles.body[k].radius;
            let coarser = self.small.min(level + 1);
            for (other, class) in self.classes[..coarser].iter().enumerate() {
                if class.entries.is_empty() {
                    continue;
                }
                let reach = radius + class.largest + gap;
                class.visit::<S>(&at, &at, reach, |m, point| {
                    let twice = other == level && m <= k;
                    if twice || (k >= owned && m >= owned) {
                        return;
                    }
                    let mut squared = 0.0;
                    for axis in 0..S::DIMENSION {
                        let d = point[axis] - at.get(axis);
                        squared += d * d;
                    }
                    let reach = radius + point[3] + gap;
                    if squared <= reach * reach && (moves(k) || moves(m)) {
                        found.push([super::ghosts::index(k), super::ghosts::index(m)]);
                    }
                });
            }
        }
    }
}

/// Pairs sorted by their first bodies.
struct ByFirst<'a>(&'a [Vec<[u32; 2]>]);

impl Items for ByFirst<'_> {
    #[inline]
    fn each(&self, firsts: &Range<usize>, mut put: impl FnMut(usize, u32)) {
        for &[first, second] in self.0.iter().flatten() {
            if firsts.contains(&(first as usize)) {
                put(first as usize, second);
            }
        }
    }
}

impl Candidates {
    fn in_order<S: Space>(mut found: Vec<Vec<[u32; 2]>>, particles: &Particles<S>) -> Self {
        let count = super::ghosts::index(particles.len());
        let threads = threads_for(particles.len());
        let mut order: Vec<u32> = (0..count).collect();
        // Owned grains are in ascending order of ids, and images in that of their grains: a stable sort makes use
        // of these runs.
        order.sort_by_key(|&k| (particles.body[k as usize].id, particles.shift[k as usize]));
        let mut place = vec![0; particles.len()];
        for (at, &k) in (0..count).zip(&order) {
            place[k as usize] = at;
        }
        thread_pool::each_item(&mut found, 1, |_, found| {
            for pair in found {
                let [a, b] = pair.map(|k| place[k as usize]);
                *pair = [a.min(b), a.max(b)];
            }
        });
        drop(place);
        let mut seconds = Buckets::default();
        let entries = particles.len();
        let bound = |t: usize| entries * t / threads;
        seconds.fill(entries, threads, bound, &ByFirst(&found));
        drop(found);
        seconds.sort_each(threads);
        Self { order, seconds }
    }

    /// Returns the number of pairs before those of a thread.
    pub(super) fn before(&self, thread: usize, threads: usize) -> usize {
        self.seconds.before(self.seconds.bound(thread, threads))
    }

    /// Calls `visit(first, second)` for every pair of a thread: all pairs of some first bodies.
    #[inline]
    pub(super) fn each(&self, thread: usize, threads: usize, mut visit: impl FnMut(usize, usize)) {
        let bound = |thread: usize| self.seconds.bound(thread, threads);
        for place in bound(thread)..bound(thread + 1) {
            for &second in self.seconds.numbers_in(place) {
                visit(
                    self.order[place] as usize,
                    self.order[second as usize] as usize,
                );
            }
        }
    }
}

impl Class {
    #[inline]
    fn cell(&self, at: f64, axis: usize) -> usize {
        cells_clamped((at - self.low[axis]) * self.inverse, self.counts[axis])
    }

    fn cell_of(&self, at: &[f64; 4]) -> usize {
        let [x, y, z] = std::array::from_fn(|axis| self.cell(at[axis], axis));
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// Calls `visit` with every member in a cell within `reach` of the box between two corners.
    #[inline]
    fn visit<S: Space>(
        &self,
        low: &S::Vector,
        high: &S::Vector,
        reach: f64,
        mut visit: impl FnMut(usize, &[f64; 4]),
    ) {
        let mut spans = [(0, 0); 3];
        for (axis, span) in spans.iter_mut().enumerate().take(S::DIMENSION) {
            *span = (
                self.cell(low.get(axis) - reach, axis),
                self.cell(high.get(axis) + reach, axis),
            );
        }
        for z in spans[2].0..=spans[2].1 {
            for y in spans[1].0..=spans[1].1 {
                let row = (z * self.counts[1] + y) * self.counts[0];
                let from = self.start[row + spans[0].0] as usize;
                let to = self.start[row + spans[0].1 + 1] as usize;
                for (&m, point) in self.entries[from..to].iter().zip(&self.points[from..to]) {
                    visit(m as usize, point);
                }
            }
        }
    }
}

/// Returns the size class of a radius; 0 is the coarsest.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and 23 after the clamp"
)]
fn class(largest: f64, radius: f64) -> u8 {
    (largest / radius).log2().floor().clamp(0.0, 23.0) as u8
}

/// Returns the number of cells that cover `length` cells.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast of a float saturates, and the caller bounds the number of cells"
)]
fn cells(length: f64) -> usize {
    length.floor().clamp(0.0, 1e9) as usize + 1
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast of a float saturates: at 0 below, and `min` bounds it above"
)]
fn cells_clamped(at: f64, count: usize) -> usize {
    (at as usize).min(count - 1)
}
#[cfg(test)]
mod tests {
    use super::super::particles::{Body, Motion};
    use super::super::space::{PlaneSpace, Volume};
    use super::*;
    use base::random::Stream;

    fn scatter<S: Space>(count: u64, ratio: f64, seed: u64) -> Particles<S> {
        let mut particles = Particles::new();
        for id in 0..count {
            let mut draw = Stream::new(seed, id, 0);
            let mut motion = Motion::<S>::default();
            for axis in 0..S::DIMENSION {
                motion.position.set(axis, draw.uniform());
            }
            let radius = 0.05 * ratio.powf(-draw.uniform());
            particles.insert(
                Body::uniform::<S>((id * 7919) % 100_003, radius, 1.0, 0),
                motion,
            );
        }
        particles
    }

    fn check<S: Space>(particles: &Particles<S>, gap: f64) {
        let mut found = Vec::new();
        let pairs = Search::default().find_candidates(particles, gap);
        for thread in 0..3 {
            pairs.each(thread, 3, |a, b| found.push((a, b)));
            assert_eq!(pairs.before(thread + 1, 3), found.len());
        }
        let ids: Vec<_> = found
            .iter()
            .map(|&(a, b)| (particles.body[a].id, particles.body[b].id))
            .collect();
        assert!(ids.iter().all(|(a, b)| a < b));
        assert!(ids.is_sorted(), "pairs are out of order");
        let mut brute = 0;
        for a in 0..particles.len() {
            for b in a + 1..particles.len() {
                let between = particles.location(b) - particles.location(a);
                let reach = particles.body[a].radius + particles.body[b].radius + gap;
                if between.scalar(&between) <= reach * reach {
                    brute += 1;
                    let ids = [particles.body[a].id, particles.body[b].id];
                    let pair = if ids[0] < ids[1] { (a, b) } else { (b, a) };
                    assert!(found.contains(&pair));
                }
            }
        }
        assert_eq!(brute, found.len());
        assert!(brute > 50, "the test needs pairs, not {brute}");
    }

    #[test]
    fn linked_cells_find_what_brute_force_finds() {
        for (seed, ratio) in [(1, 1.0), (2, 3.0), (3, 100.0)] {
            check(&scatter::<PlaneSpace>(300, ratio, seed), 0.01);
            check(
                &scatter::<Volume>(if ratio > 50.0 { 700 } else { 300 }, ratio, seed),
                0.02,
            );
        }
    }

    /// Checks that one thread and three threads find the same pairs in the same order.
    #[test]
    fn threads_find_the_same() {
        fn pairs<S: Space>(
            make: impl Fn() -> Particles<S> + Sync,
            threads: usize,
        ) -> Vec<(usize, usize)> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let particles = &make();
                assert_eq!(threads_for(particles.len()), threads);
                let candidates = Search::default().find_candidates(particles, 0.01);
                let mut found = Vec::new();
                for thread in 0..2 {
                    candidates.each(thread, 2, |a, b| found.push((a, b)));
                }
                found
            })
        }
        for (ratio, giants) in [(1.0, 0), (30.0, 0), (1.5, 2)] {
            fn with<S: Space>(ratio: f64, giants: u64) -> Particles<S> {
                let mut all = scatter::<S>(3500, ratio, 11);
                for giant in 0..giants {
                    let mut motion = Motion::<S>::default();
                    motion.position.set(0, 0.3 + 0.9 * giant as f64);
                    all.insert(Body::uniform::<S>(200_000 + giant, 0.45, 1.0, 0), motion);
                }
                all
            }
            let flat = || with::<PlaneSpace>(ratio, giants);
            let deep = || with::<Volume>(ratio, giants);
            for (one, three) in [
                (pairs(flat, 1), pairs(flat, 3)),
                (pairs(deep, 1), pairs(deep, 3)),
            ] {
                assert!(one == three && one.len() > 1000, "{ratio} {}", one.len());
            }
        }
    }

    /// Checks bodies of one size, of a wide range of sizes, and a giant among many small ones.
    #[test]
    fn what_is_near_a_box_is_found_once() {
        for (ratio, giant) in [(1.0, false), (100.0, false), (1.5, true)] {
            let mut particles = scatter::<Volume>(3000, ratio, 5);
            if giant {
                let motion = Motion::<Volume> {
                    position: nalgebra::Vector3::repeat(0.5),
                    ..Motion::default()
                };
                particles.insert(Body::uniform::<Volume>(200_000, 0.45, 1.0, 0), motion);
                check(&particles, 0.02);
            }
            let mut search = Search::default();
            search.find_candidates(&particles, 0.02);
            let (low, high) = (
                nalgebra::Vector3::new(0.3, 0.2, 0.4),
                nalgebra::Vector3::new(0.5, 0.9, 0.45),
            );
            let mut times = vec![0; particles.len()];
            search.near::<Volume>(&low, &high, 0.02, |k| times[k] += 1);
            let mut expected = 0;
            for (k, &times) in times.iter().enumerate() {
                let at = particles.location(k);
                let away = at - at.sup(&low).inf(&high);
                let near = away.norm() <= particles.body[k].radius + 0.02;
                assert!(times <= 1, "{k} {times} times");
                assert!(!near || times == 1, "{k} was not found");
                expected += usize::from(near);
            }
            assert!(expected > 40, "{expected}");
        }
    }

    /// Checks giants among small bodies, for which common cells would be too wide: they are in the grids of their
    /// classes.
    #[test]
    fn giants_are_found_by_class() {
        let mut particles = Particles::<Volume>::new();
        for id in 0..3000 {
            let mut draw = Stream::new(9, id, 0);
            let motion = Motion::<Volume> {
                position: nalgebra::Vector3::from_fn(|_, _| draw.uniform()),
                ..Motion::default()
            };
            let radius = if id % 1000 == 0 { 0.4 } else { 0.002 };
            particles.insert(Body::uniform::<Volume>(id, radius, 1.0, 0), motion);
        }
        check(&particles, 0.001);
        let mut search = Search::default();
        search.find_candidates(&particles, 0.001);
        assert_eq!((search.small > 0, search.large.len()), (true, 3));
        let corner = nalgebra::Vector3::repeat(0.5);
        let mut seen = vec![0; particles.len()];
        search.near::<Volume>(&corner, &corner, 0.001, |k| seen[k] += 1);
        assert!(seen.iter().all(|&times| times <= 1));
        for k in (0..particles.len()).filter(|&k| particles.body[k].radius > 0.1) {
            let away = (particles.location(k) - corner).norm();
            assert!(away > 0.401 || seen[k] == 1, "giant {k} at {away} m");
        }
    }
}
