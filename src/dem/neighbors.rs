//! Candidate pairs: who may touch before the lists are next made.
//!
//! Linked cells on one grid per size class (classes differ by a factor of 2 in radius): every entry looks for partners in its
//! own class and in all coarser ones, so that the cost per grain does not depend on the ratio of sizes. Pairs come
//! out once, the lower (id, shift) first, in the order of first and then second: added up in this order the forces on any
//! grain are summed in the order of the other's id.

use super::particles::Particles;
use super::space::{Components, Space};

/// The search, with its buffers kept between calls.
#[derive(Debug, Default)]
pub struct Search {
    classes: Vec<Class>,
    class_of: Vec<u8>,
    places: Vec<[f64; 3]>,
    cell_of: Vec<u32>,
    found: Vec<[u32; 2]>,
    order: Vec<u32>,
    place: Vec<u32>,
    start: Vec<u32>,
    second: Vec<u32>,
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
    /// Place and radius of each entry, so that cells are read in one piece.
    points: Vec<[f64; 4]>,
}

const CLASSES: usize = 24;

impl Search {
    /// Calls `visit(first, second)` for every pair whose surfaces are at most `gap` (m) apart and of which at least one is owned
    /// and one can be moved by forces, in the order the module says.
    #[cfg(test)]
    pub(super) fn pairs<S: Space>(
        &mut self,
        particles: &Particles<S>,
        gap: f64,
        visit: impl FnMut(usize, usize),
    ) {
        self.look(particles, gap);
        self.each(visit);
    }

    /// Finds every pair whose surfaces are at most `gap` (m) apart and of which at least one is owned and one can be moved by
    /// forces; returns how many.
    pub(super) fn look<S: Space>(&mut self, particles: &Particles<S>, gap: f64) -> usize {
        let pairs = self.find_pairs(particles, gap);
        self.put_in_order(particles);
        pairs
    }

    /// As the engine's own search, before the pairs are put in order: how many there are. For measurements.
    pub fn find_pairs<S: Space>(&mut self, particles: &Particles<S>, gap: f64) -> usize {
        self.sort_into_classes(particles, gap);
        self.find(particles, gap);
        self.found.len()
    }

    /// Calls `visit(first, second)` for every pair of the last [`Self::look`], in the order the module says.
    pub(super) fn each(&self, mut visit: impl FnMut(usize, usize)) {
        for (p, window) in self.start.windows(2).enumerate() {
            for &second in &self.second[window[0] as usize..window[1] as usize] {
                visit(self.order[p] as usize, self.order[second as usize] as usize);
            }
        }
    }

    /// Calls `visit` with every entry of the last [`Self::look`] whose surface may be within `gap` (m) of the box between two
    /// corners, and with some others.
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
        self.places.clear();
        self.places
            .extend((0..count).map(|k| particles.location(k)).map(|at| {
                std::array::from_fn(|axis| {
                    if axis < S::DIMENSION {
                        at.get(axis)
                    } else {
                        0.0
                    }
                })
            }));
        for class in &mut self.classes {
            class.entries.clear();
            class.largest = 0.0;
            class.low = [f64::INFINITY; 3];
            class.high = [f64::NEG_INFINITY; 3];
            class.members = 0;
        }
        for k in 0..count {
            let class = &mut self.classes[usize::from(self.class_of[k])];
            class.members += 1;
            class.largest = class.largest.max(particles.body[k].radius);
            for (axis, at) in self.places[k].into_iter().enumerate() {
                class.low[axis] = class.low[axis].min(at);
                class.high[axis] = class.high[axis].max(at);
            }
        }
        for class in self.classes.iter_mut().filter(|class| class.members > 0) {
            let mut size = 2.0 * class.largest + gap;
            // Never many more cells than members, however far they are spread.
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
        for k in 0..count {
            let class = &mut self.classes[usize::from(self.class_of[k])];
            let cell = class.cell_of(&self.places[k]);
            class.start[cell + 1] += 1;
            self.cell_of.push(super::ghosts::index(cell));
        }
        for class in self.classes.iter_mut().filter(|class| class.members > 0) {
            for cell in 1..class.start.len() {
                class.start[cell] += class.start[cell - 1];
            }
        }
        for k in 0..count {
            let class = &mut self.classes[usize::from(self.class_of[k])];
            // `start` runs ahead while filling and is set back below.
            let slot = &mut class.start[self.cell_of[k] as usize];
            class.entries[*slot as usize] = super::ghosts::index(k);
            let [x, y, z] = self.places[k];
            class.points[*slot as usize] = [x, y, z, particles.body[k].radius];
            *slot += 1;
        }
        for class in self.classes.iter_mut().filter(|class| class.members > 0) {
            for cell in (1..class.start.len()).rev() {
                class.start[cell] = class.start[cell - 1];
            }
            class.start[0] = 0;
        }
    }

    fn find<S: Space>(&mut self, particles: &Particles<S>, gap: f64) {
        let owned = particles.owned();
        self.found.clear();
        let moves = |k: usize| particles.mobility[k].free > 0.0;
        for k in 0..particles.len() {
            let level = usize::from(self.class_of[k]);
            let at = particles.location(k);
            let radius = particles.body[k].radius;
            for (other, class) in self.classes[..=level].iter().enumerate() {
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
                        self.found
                            .push([super::ghosts::index(k), super::ghosts::index(m)]);
                    }
                });
            }
        }
    }

    fn put_in_order<S: Space>(&mut self, particles: &Particles<S>) {
        let count = super::ghosts::index(particles.len());
        self.order.clear();
        self.order.extend(0..count);
        self.order.sort_unstable_by_key(|&k| {
            (particles.body[k as usize].id, particles.shift[k as usize])
        });
        self.place.resize(particles.len(), 0);
        for (place, &k) in (0..count).zip(&self.order) {
            self.place[k as usize] = place;
        }
        self.start.clear();
        self.start.resize(particles.len() + 1, 0);
        for pair in &mut self.found {
            let [a, b] = pair.map(|k| self.place[k as usize]);
            *pair = [a.min(b), a.max(b)];
            self.start[pair[0] as usize + 1] += 1;
        }
        for p in 0..particles.len() {
            self.start[p + 1] += self.start[p];
        }
        self.second.resize(self.found.len(), 0);
        for pair in &self.found {
            // `start` runs ahead while filling and is set back below.
            let slot = &mut self.start[pair[0] as usize];
            self.second[*slot as usize] = pair[1];
            *slot += 1;
        }
        for p in (1..=particles.len()).rev() {
            self.start[p] = self.start[p - 1];
        }
        self.start[0] = 0;
        for p in 0..particles.len() {
            self.second[self.start[p] as usize..self.start[p + 1] as usize].sort_unstable();
        }
    }
}

impl Class {
    #[inline]
    fn cell(&self, at: f64, axis: usize) -> usize {
        cells_clamped((at - self.low[axis]) * self.inverse, self.counts[axis])
    }

    fn cell_of(&self, at: &[f64; 3]) -> usize {
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

/// The size class of a radius: 0 the coarsest.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and 23 after the clamp"
)]
fn class(largest: f64, radius: f64) -> u8 {
    (largest / radius).log2().floor().clamp(0.0, 23.0) as u8
}

/// How many cells cover `length` cells.
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

#[expect(
    clippy::cast_precision_loss,
    reason = "counts of cells and members, far below 2^53"
)]
fn real(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::super::particles::{Body, Motion};
    use super::super::space::{Plane, Volume};
    use super::*;
    use crate::random::Stream;

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
        Search::default().pairs(particles, gap, |a, b| found.push((a, b)));
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
            check(&scatter::<Plane>(300, ratio, seed), 0.01);
            check(
                &scatter::<Volume>(if ratio > 50.0 { 700 } else { 300 }, ratio, seed),
                0.02,
            );
        }
    }
}
