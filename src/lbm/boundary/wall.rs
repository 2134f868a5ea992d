//! Half-way bounce-back at a stationary wall, a moving wall, or a face with imposed velocity (Ladd 1994).
//!
//! f_ī(x, t+1) = f*_i(x, t) - 6 w_i c_i·u_w. The last term uses the reference density one, so that it cancels
//! exactly over a closed wall. The wall lies half-way between x and x + c_i. Second order; exact for Couette flow
//! (`jobs/verification/couette`).
//!
//! Along a face the links of one direction are at equal distances in memory. They are stored as runs, so that a
//! wall costs a copy between arrays and little memory. Runs are sorted by the plane of their cells, so that the
//! links of a plane can be applied while its numbers are still in the cache.

use super::links::{Counted, Row};
use crate::block::{Line, RowBlock};
use crate::gpu::copies::Copies;
use crate::lanes::Stored;
use crate::populations::{Link, Parity, Populations};
use base::number::to_u32;
use std::collections::HashMap;
use std::ops::Range;

/// Link that ends at a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallLink {
    pub(crate) link: Link,
    pub(crate) patch: usize,
    /// Patch whose factor the term has: another one at an edge, whose velocity crosses it ([`super::edge`]).
    pub(crate) giver: usize,
    pub(crate) direction: usize,
    /// Plane of the cell normal to the split axis, and row of the plane.
    pub(crate) plane: usize,
    pub(crate) row: u32,
    /// Term 6 w_i c_i·u_w at full speed.
    pub(crate) term: f64,
}

/// Links of one plane, patch, direction and term at equal distances.
#[derive(Clone, Copy, Debug)]
struct Run {
    first: WallLink,
    line: Line,
}

impl Run {
    /// Returns the links of the run.
    fn links(&self) -> impl Iterator<Item = WallLink> {
        let Self { first, line } = *self;
        (0..line.count).map(move |k| {
            let Link { near, far } = first.link;
            let beyond = k * line.stride;
            WallLink {
                link: Link {
                    near: near + beyond,
                    far: far + beyond,
                },
                row: line.row(k),
                ..first
            }
        })
    }

    /// Returns the run extended by one link, if it continues the run.
    fn with(self, next: &WallLink) -> Option<Self> {
        let Self { first, line } = self;
        let apart = next.link.near.checked_sub(first.link.near)?;
        let far = next.link.far.checked_sub(first.link.far)?;
        let line = line.with(next.row, apart)?;
        (apart == far
            && first.term.to_bits() == next.term.to_bits()
            && (first.plane, first.patch, first.giver, first.direction)
                == (next.plane, next.patch, next.giver, next.direction))
            .then_some(Self { first, line })
    }
}

/// Links that end at walls.
#[derive(Debug, Default)]
pub(crate) struct Walls {
    runs: Vec<Run>,
    /// Index of the first run of each plane, and the total.
    begins: Vec<usize>,
    counted: Counted,
    /// `true` if the terms are subtracted from populations that have been set, instead of the leaving ones.
    onto_entering: bool,
}

impl Walls {
    /// Returns the links of a slab with this number of planes.
    pub(super) fn new(mut links: Vec<WallLink>, planes: usize) -> Self {
        links.sort_unstable_by_key(|w| (w.plane, w.patch, w.giver, w.direction, w.link.near));
        let mut runs: Vec<Run> = Vec::new();
        for link in &links {
            let longer = runs.last().and_then(|run| run.with(link));
            match (runs.last_mut(), longer) {
                (Some(run), Some(longer)) => *run = longer,
                _ => runs.push(Run {
                    first: *link,
                    line: Line::single(link.row),
                }),
            }
        }
        runs.shrink_to_fit();
        let begins = (0..=planes)
            .map(|plane| runs.partition_point(|run| run.first.plane < plane))
            .collect();
        let counted = Counted::new(runs.iter().map(|run| run.line.count));
        Self {
            runs,
            begins,
            counted,
            onto_entering: false,
        }
    }

    /// Returns the links as further terms of populations that other links have set.
    pub(super) fn onto_entering(self) -> Self {
        Self {
            onto_entering: true,
            ..self
        }
    }

    /// Returns the positions from which and to which a link gives a population.
    fn ends(&self, link: Link, parity: Parity) -> (usize, usize) {
        let entering = link.incoming(parity);
        let from = if self.onto_entering {
            entering
        } else {
            link.out(parity)
        };
        (from, entering)
    }

    /// Returns every link.
    pub(crate) fn links(&self) -> impl Iterator<Item = WallLink> {
        self.runs.iter().flat_map(Run::links)
    }

    /// Returns the links of walls that move, or through which water enters.
    pub(crate) fn moving(&self) -> impl Iterator<Item = WallLink> {
        let moving = self.runs.iter().filter(|run| run.first.term != 0.0);
        moving.flat_map(Run::links)
    }

    /// Returns the links as copies between positions after a pass of this parity; the factor of each is that of its
    /// patch. `plane` is the distance between planes in memory. Congruent runs in consecutive planes form one
    /// rectangle.
    pub(crate) fn copies(&self, parity: Parity, plane: u32) -> Vec<Copies> {
        let mut all: Vec<Copies> = Vec::new();
        // Rectangle continued by each run of the previous plane, by the first number of its last run.
        let mut open: HashMap<(u32, u32), usize> = HashMap::new();
        for run in &self.runs {
            let link = run.first.link;
            let (from, to) = self.ends(link, parity);
            let copies = Copies {
                from: to_u32(from),
                to: to_u32(to),
                counts: [run.line.count, 1],
                strides: [run.line.stride, plane],
                factor: to_u32(run.first.giver),
                unused: 0,
                term: run.first.term,
            };
            let before =
                open.remove(&(link.near.wrapping_sub(plane), link.far.wrapping_sub(plane)));
            let continued = before.filter(|&at| {
                let Copies {
                    from, to, counts, ..
                } = all[at];
                let alike = Copies {
                    from,
                    to,
                    counts: [run.line.count, counts[1]],
                    ..copies
                };
                all[at] == alike
            });
            let at = continued.unwrap_or(all.len());
            if continued.is_some() {
                all[at].counts[1] += 1;
            } else {
                all.push(copies);
            }
            open.insert((link.near, link.far), at);
        }
        all
    }

    /// Applies bounce-back to the cells of a range of planes, on several threads if there are many links; `speed` is
    /// the factor of a patch.
    pub(super) fn apply<S: Stored>(
        &self,
        planes: Range<usize>,
        speed: impl Fn(usize) -> f64 + Sync,
        populations: &mut Populations<S>,
    ) {
        let parity = populations.parity();
        let runs = self.begins[planes.start]..self.begins[planes.end];
        self.counted.each(runs, populations, |run, some, numbers| {
            let run = &self.runs[run];
            let term = run.term(&speed);
            let row = run.row(self.ends(run.first.link, parity), some);
            // SAFETY: the populations are borrowed exclusively; both ends of a link lie in the slab, and no other
            // link accesses them.
            unsafe { row.give(term, numbers) };
        });
    }

    /// Applies bounce-back like [`Self::apply`] to a range of rows, while other threads may access numbers of other
    /// rows.
    ///
    /// # Safety
    /// `numbers` must be those for whose slab the links were found, and no other thread may access the two numbers of
    /// any link of these cells.
    pub(super) unsafe fn give<S: Stored>(
        &self,
        RowBlock { planes, rows }: &RowBlock,
        speed: impl Fn(usize) -> f64,
        parity: Parity,
        numbers: *mut S,
    ) {
        for run in &self.runs[self.begins[planes.start]..self.begins[planes.end]] {
            let some = run.line.within(rows);
            if !some.is_empty() {
                let term = run.term(&speed);
                let row = run.row(self.ends(run.first.link, parity), some);
                // SAFETY: promised by the caller.
                unsafe { row.give(term, numbers) };
            }
        }
    }
}

impl Run {
    /// Returns the term subtracted from the links of the run, where `speed` is the factor of a patch.
    fn term(&self, speed: impl Fn(usize) -> f64) -> f64 {
        let WallLink { giver, term, .. } = self.first;
        // Most walls are stationary.
        if term == 0.0 {
            0.0
        } else {
            term * speed(giver)
        }
    }

    /// Returns the positions of a range of its links, given those of the first.
    fn row(&self, first: (usize, usize), some: Range<usize>) -> Row {
        Row::new(first, self.line.stride, some)
    }
}

/// Returns the term 6 w_i c_i·u.
pub(crate) fn term(weight: f64, c: [i8; 3], u: [f64; 3]) -> f64 {
    6.0 * weight * (f64::from(c[0]) * u[0] + f64::from(c[1]) * u[1] + f64::from(c[2]) * u[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(near: u32, far: u32, patch: usize, term: f64) -> WallLink {
        WallLink {
            link: Link { near, far },
            patch,
            giver: patch,
            direction: 3,
            plane: (near / 200) as usize,
            row: if patch == 0 && term != 0.0 {
                near / 7
            } else {
                2
            },
            term,
        }
    }

    /// Checks that runs contain the links from which they were made, each once, and give the same result as single
    /// links.
    #[test]
    fn runs_are_their_links() {
        let mut links = Vec::new();
        for k in 0..40 {
            links.push(link(10 + k, 1000 + k, 0, 0.0));
            links.push(link(100 + 7 * k, 2000 + 7 * k, 0, 0.25));
            links.push(link(500 + k, 3000 + 2 * k, 1, 0.0));
            links.push(link(700 + k, 4000 + k, 1, f64::from(k / 9)));
        }
        let walls = Walls::new(links.iter().rev().copied().collect(), 4);
        assert!(walls.runs.len() < 50, "{}", walls.runs.len());
        let key = |w: &WallLink| (w.link.near, w.link.far, w.row, w.patch, w.term.to_bits());
        let mut held: Vec<_> = walls.links().map(|w| key(&w)).collect();
        let mut given: Vec<_> = links.iter().map(key).collect();
        held.sort_unstable();
        given.sort_unstable();
        assert_eq!(held, given);
        let start: Vec<f64> = (0..5000).map(f64::from).collect();
        for parity in [Parity::Home, Parity::Reversed] {
            let (mut one_by_one, mut in_runs) = (start.clone(), start.clone());
            for w in &links {
                let value = one_by_one[w.link.out(parity)] - 0.5 * w.term;
                one_by_one[w.link.incoming(parity)] = value;
            }
            for planes in [2..4, 0..1, 1..2] {
                for rows in [30..200, 0..3, 3..30] {
                    let cells = RowBlock {
                        planes: planes.clone(),
                        rows,
                    };
                    // SAFETY: all links lie in the list.
                    unsafe { walls.give(&cells, |_| 0.5, parity, in_runs.as_mut_ptr()) };
                }
            }
            assert!(one_by_one == in_runs, "{parity:?}");
            assert!(in_runs != start);
        }
    }
}
