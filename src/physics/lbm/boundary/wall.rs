//! Half-way bounce-back at a wall at rest, a moving wall, or a face with prescribed velocity (Ladd 1994).
//!
//! f_ī(x, t+1) = f*_i(x, t) - 6 w_i c_i·u_w with the reference density one in the last term, which so cancels exactly
//! over a closed wall. The wall lies half-way between x and x + c_i. Second order; exact for Couette flow
//! (`jobs/verification/couette`).
//!
//! Along a face the links of one direction stand at equal distances in memory: they are kept as runs, so that a wall costs a copy from
//! array to array and next to no memory. Runs go by the plane of their cells, so that the links of a plane can be given while its numbers
//! are still in the cache.

use crate::lbm::block::Block;
use crate::lbm::gpu::copies::Copies;
use crate::lbm::lanes::{Stored, prefetch};
use crate::lbm::populations::{Link, Parity, Populations};
use crate::number::to_u32;
use std::collections::HashMap;
use std::ops::Range;

/// Links ahead whose numbers are asked for where they do not stand together.
const LINES_AHEAD: usize = 16;

/// One link that ends at a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallLink {
    pub(crate) link: Link,
    pub(crate) patch: usize,
    pub(crate) direction: usize,
    /// Plane of the cell across the split axis, and row of the plane.
    pub(crate) plane: usize,
    pub(crate) row: u32,
    /// 6 w_i c_i·u_w at full speed.
    pub(crate) term: f64,
}

/// Links of one plane, patch, direction and term at equal distances.
#[derive(Clone, Copy, Debug)]
struct Run {
    first: WallLink,
    count: u32,
    stride: u32,
    /// Whether each link is in the row after that of the link before it; else all are in one row.
    down: bool,
}

impl Run {
    /// Its links.
    fn links(&self) -> impl Iterator<Item = WallLink> {
        let (first, stride, down) = (self.first, self.stride, u32::from(self.down));
        (0..self.count).map(move |k| {
            let Link { near, far } = first.link;
            let beyond = k * stride;
            WallLink {
                link: Link {
                    near: near + beyond,
                    far: far + beyond,
                },
                row: first.row + k * down,
                ..first
            }
        })
    }

    /// The run with one more link, where the link continues it.
    fn with(self, next: &WallLink) -> Option<Self> {
        let Self {
            first,
            count,
            stride,
            down,
        } = self;
        let apart = next.link.near.checked_sub(first.link.near)?;
        let (stride, down) = if count == 1 {
            (apart, next.row > first.row)
        } else {
            (stride, down)
        };
        let far = next.link.far.checked_sub(first.link.far)?;
        (stride > 0
            && apart == far
            && next.row == first.row + u32::from(down) * count
            && Some(apart) == stride.checked_mul(count)
            && first.term.to_bits() == next.term.to_bits()
            && (first.plane, first.patch, first.direction)
                == (next.plane, next.patch, next.direction))
            .then_some(Self {
                first,
                count: count + 1,
                stride,
                down,
            })
    }

    /// Which of its links are in some rows.
    fn within(&self, rows: &Range<usize>) -> Range<usize> {
        let (first, count) = (self.first.row as usize, self.count as usize);
        if self.down {
            let end = rows.end.saturating_sub(first).min(count);
            rows.start.saturating_sub(first).min(end)..end
        } else if rows.contains(&first) {
            0..count
        } else {
            0..0
        }
    }
}

/// The links that end at walls.
#[derive(Debug, Default)]
pub(crate) struct Walls {
    runs: Vec<Run>,
    /// Where the runs of each plane begin, and the end.
    begins: Vec<usize>,
}

impl Walls {
    /// The links of a slab of `planes`.
    pub(super) fn new(mut links: Vec<WallLink>, planes: usize) -> Self {
        links.sort_unstable_by_key(|w| (w.plane, w.patch, w.direction, w.link.near));
        let mut runs: Vec<Run> = Vec::new();
        for link in &links {
            let longer = runs.last().and_then(|run| run.with(link));
            match (runs.last_mut(), longer) {
                (Some(run), Some(longer)) => *run = longer,
                _ => runs.push(Run {
                    first: *link,
                    count: 1,
                    stride: 0,
                    down: false,
                }),
            }
        }
        runs.shrink_to_fit();
        let begins = (0..=planes)
            .map(|plane| runs.partition_point(|run| run.first.plane < plane))
            .collect();
        Self { runs, begins }
    }

    /// Every link.
    pub(crate) fn links(&self) -> impl Iterator<Item = WallLink> {
        self.runs.iter().flat_map(Run::links)
    }

    /// Every link of walls that move or let water in.
    pub(crate) fn moving(&self) -> impl Iterator<Item = WallLink> {
        let moving = self.runs.iter().filter(|run| run.first.term != 0.0);
        moving.flat_map(Run::links)
    }

    /// The links as copies of numbers after a pass of this parity; the factor of each is that of its patch. `plane` is the distance from
    /// plane to plane: runs that stand alike in planes side by side become one rectangle.
    pub(crate) fn copies(&self, parity: Parity, plane: u32) -> Vec<Copies> {
        let mut all: Vec<Copies> = Vec::new();
        // Where the rectangle is that each run of the plane before continues, by the first number of its last run.
        let mut open: HashMap<(u32, u32), usize> = HashMap::new();
        for run in &self.runs {
            let link = run.first.link;
            let copies = Copies {
                from: to_u32(link.out(parity)),
                to: to_u32(link.incoming(parity)),
                counts: [run.count, 1],
                strides: [run.stride, plane],
                factor: to_u32(run.first.patch),
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
                    counts: [run.count, counts[1]],
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

    /// Gives what comes back from the walls to the cells of some planes; `speed` is the factor of a patch.
    pub(super) fn apply<S: Stored>(
        &self,
        planes: Range<usize>,
        speed: impl Fn(usize) -> f64,
        populations: &mut Populations<S>,
    ) {
        let parity = populations.parity();
        let cells = Block {
            planes,
            rows: 0..usize::MAX,
        };
        // SAFETY: the populations are borrowed alone.
        unsafe { self.give(&cells, speed, parity, populations.base()) };
    }

    /// As [`Self::apply`] for some rows, to numbers that others may work on elsewhere.
    ///
    /// # Safety
    /// `numbers` must be those for whose slab the links were found, and nobody else may touch the two numbers of any link of these
    /// cells.
    pub(super) unsafe fn give<S: Stored>(
        &self,
        Block { planes, rows }: &Block,
        speed: impl Fn(usize) -> f64,
        parity: Parity,
        numbers: *mut S,
    ) {
        // Runs of one patch stand together: ask for the ramp only when the patch changes.
        let mut patch = usize::MAX;
        let mut factor = 0.0;
        for run in &self.runs[self.begins[planes.start]..self.begins[planes.end]] {
            let links = run.within(rows);
            if links.is_empty() {
                continue;
            }
            if run.first.patch != patch {
                patch = run.first.patch;
                factor = speed(patch);
            }
            // SAFETY: forwarded from the caller.
            unsafe { run.give(links, parity, run.first.term * factor, numbers) };
        }
    }
}

impl Run {
    /// # Safety
    /// As [`Walls::give`]; `links` must be some of the run.
    unsafe fn give<S: Stored>(
        &self,
        links: Range<usize>,
        parity: Parity,
        term: f64,
        numbers: *mut S,
    ) {
        let link = self.first.link;
        let stride = self.stride as usize;
        let skipped = links.start * stride;
        let (from, to) = (link.out(parity) + skipped, link.incoming(parity) + skipped);
        let count = links.len();
        // SAFETY: links are positions in the numbers.
        let (from, to) = unsafe { (numbers.add(from), numbers.add(to)) };
        if stride > 1 {
            // Each number lies in a line of its own.
            let ask = |k: usize| {
                prefetch(from.wrapping_add(k * stride));
                prefetch(to.wrapping_add(k * stride));
            };
            (0..count.min(LINES_AHEAD)).for_each(ask);
            for k in 0..count {
                if k + LINES_AHEAD < count {
                    ask(k + LINES_AHEAD);
                }
                // SAFETY: a link of the run.
                unsafe {
                    let value = (*from.add(k * stride)).to_f64() - term;
                    *to.add(k * stride) = S::from_f64(value);
                }
            }
        } else if term == 0.0 {
            // SAFETY: the links of the run; where the two ends overlap, each number is one link's alone.
            unsafe { from.copy_to(to, count) };
        } else {
            for k in 0..count {
                // SAFETY: a link of the run.
                unsafe { *to.add(k) = S::from_f64((*from.add(k)).to_f64() - term) };
            }
        }
    }
}

/// 6 w_i c_i·u
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

    /// Runs hold the links that they were made of, each once, and bounce them as one by one.
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
                    let cells = Block {
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
