//! Links through the faces of the domain.

use crate::lanes::{Stored, prefetch};
use crate::populations::{Link, Parity, Populations};
use base::thread_pool;
use std::ops::Range;

/// Prefetch distance in links where their numbers are not contiguous.
const LINES_AHEAD: usize = 16;

/// Link that leaves the domain through a patch.
pub struct Crossing<'a, S: Stored> {
    /// Populations of the slab.
    pub populations: &'a Populations<S>,
    /// Position of the cell that the link leaves.
    pub cell: usize,
    /// Indices of the cell in the whole domain.
    pub at: [usize; 3],
    /// Number of cells of the whole domain.
    pub cells: [usize; 3],
    /// Direction of the link.
    pub direction: usize,
    /// `true` for each axis along which the link leaves the domain.
    pub outside: [bool; 3],
    /// Point at which the link crosses the face, in cells; the first cell spans 0..1.
    pub middle: [f64; 3],
    /// Fraction of the surroundings of this point on the face that imposes a velocity: less than 1 at the border of
    /// a patch.
    pub share: f64,
    /// Axis normal to the patch.
    pub normal: usize,
    /// `true` for each axis along which the velocity of the patch counts; `false` at an edge along the normals of
    /// other faces that impose a velocity, or none.
    pub counted: [bool; 3],
    /// Positions of the two populations at the ends of the link.
    pub link: Link,
}

impl<S: Stored> Crossing<'_, S> {
    /// Returns c_i of the direction.
    #[must_use]
    pub fn velocity(&self) -> [i8; 3] {
        self.populations.velocities().c[self.direction]
    }

    /// Returns the weight w_i of the direction.
    #[must_use]
    pub fn weight(&self) -> f64 {
        self.populations.velocities().w[self.direction]
    }

    /// Returns the link in the form that rules store.
    #[must_use]
    pub fn face_link(&self) -> FaceLink {
        FaceLink {
            link: self.link,
            direction: self.direction,
        }
    }
}

/// Link through a face whose ends are one population that leaves and one that enters.
#[derive(Clone, Copy, Debug)]
pub struct FaceLink {
    /// Positions of the two populations.
    pub link: Link,
    /// Direction of the population that leaves.
    pub direction: usize,
}

/// Population that enters as the mirror image of a population that left, in the same cell or an adjacent one along the
/// face.
#[derive(Clone, Copy, Debug)]
pub struct Mirror {
    /// Links of the populations that leave and enter.
    links: [Link; 2],
    /// Direction of the outgoing population.
    pub(crate) leaves: u8,
    /// Direction of the incoming population.
    pub(crate) enters: u8,
}

impl Mirror {
    /// Returns the population that enters along a link.
    #[must_use]
    pub fn new<S: Stored>(crossing: &Crossing<'_, S>) -> Self {
        let (populations, cell) = (crossing.populations, crossing.cell);
        let (i, outside) = (crossing.direction, crossing.outside);
        let velocities = populations.velocities();
        let enters = velocities.opposite[i];
        let c = velocities.c[enters];
        let mirrored: [i8; 3] = std::array::from_fn(|a| if outside[a] { -c[a] } else { c[a] });
        let along: [i8; 3] = std::array::from_fn(|a| if outside[a] { 0 } else { c[a] });
        let find = |v: [i8; 3]| velocities.c.iter().position(|&d| d == v).unwrap_or(0);
        let leaves = find(mirrored);
        let source = cell.wrapping_add_signed(-populations.offset(find(along)));
        let number = |direction: usize| u8::try_from(direction).unwrap_or(u8::MAX);
        Self {
            // D3Q19 has no corner directions, but the component of an edge direction along a face is an axis or
            // zero, which are always in the set.
            links: [populations.link(source, leaves), populations.link(cell, i)],
            leaves: number(leaves),
            enters: number(enters),
        }
    }

    /// Positions of the population that left and of the one that enters.
    pub(crate) fn ends(&self, parity: Parity) -> (usize, usize) {
        let [from, to] = self.links;
        (from.out(parity), to.incoming(parity))
    }

    /// Returns the position of the population that left along the link on which this one enters.
    pub(crate) fn sent_along_entrance(&self, parity: Parity) -> usize {
        self.links[1].out(parity)
    }

    /// Returns the cells of the leaving and the entering population: positions within an array, where `begins`
    /// contains the first position of each array.
    pub(crate) fn cells(&self, opposite: &[usize], begins: &[u32]) -> [u32; 2] {
        // The near end of a link is behind the position of its cell, in the array of the entering population.
        let [from, to] = self.links.map(|link| link.near);
        [
            from - begins[opposite[usize::from(self.leaves)]],
            to - begins[usize::from(self.enters)],
        ]
    }

    /// Returns the mirror displaced by `apart` positions.
    fn further(self, apart: u32) -> Self {
        let links = self.links.map(|Link { near, far }| Link {
            near: near + apart,
            far: far + apart,
        });
        Self { links, ..self }
    }
}

/// Mirrors of one direction at equal distances in memory along a face.
#[derive(Clone, Copy, Debug)]
pub struct MirrorRun {
    first: Mirror,
    count: u32,
    stride: u32,
}

impl MirrorRun {
    /// Returns a run with a single mirror.
    pub(super) fn single(first: Mirror) -> Self {
        Self {
            first,
            count: 1,
            stride: 0,
        }
    }

    /// Returns the run extended by one mirror, if it continues the run.
    pub(super) fn with(self, next: &Mirror) -> Option<Self> {
        let Self {
            first,
            count,
            stride,
        } = self;
        let apart = next.links[0].near.checked_sub(first.links[0].near)?;
        let stride = if count == 1 { apart } else { stride };
        let continued = first.further(apart);
        (stride > 0
            && Some(apart) == stride.checked_mul(count)
            && continued.links == next.links
            && (first.leaves, first.enters) == (next.leaves, next.enters))
            .then_some(Self {
                first,
                count: count + 1,
                stride,
            })
    }

    /// Returns the number of links.
    pub(super) fn count(&self) -> u32 {
        self.count
    }

    /// Returns the mirrors of the run.
    pub(crate) fn mirrors(self) -> impl Iterator<Item = Mirror> {
        (0..self.count).map(move |k| self.first.further(k * self.stride))
    }

    /// Returns the positions of a range of its mirrors.
    pub(super) fn row(&self, some: Range<usize>, parity: Parity) -> Row {
        Row::new(self.first.ends(parity), self.stride, some)
    }
}

/// Positions at equal distances: source and target of each population.
pub(super) struct Row {
    from: usize,
    to: usize,
    count: usize,
    stride: usize,
}

impl Row {
    /// Returns the range `some` of a row that starts at two positions.
    pub(super) fn new((from, to): (usize, usize), stride: u32, some: Range<usize>) -> Self {
        let stride = stride as usize;
        let skipped = some.start * stride;
        Self {
            from: from + skipped,
            to: to + skipped,
            count: some.len(),
            stride,
        }
    }

    /// Sets each entering number to the leaving one minus `term`.
    ///
    /// # Safety
    /// Both ends must be positions in `numbers`, and no other thread may access these numbers.
    pub(super) unsafe fn give<S: Stored>(self, term: f64, numbers: *mut S) {
        let Self {
            from,
            to,
            count,
            stride,
        } = self;
        // SAFETY: promised by the caller.
        let (from, to) = unsafe { (numbers.add(from), numbers.add(to)) };
        if stride > 1 {
            // Each number lies in a separate cache line.
            let ask = |k: usize| {
                prefetch(from.wrapping_add(k * stride));
                prefetch(to.wrapping_add(k * stride));
            };
            (0..count.min(LINES_AHEAD)).for_each(ask);
            for k in 0..count {
                if k + LINES_AHEAD < count {
                    ask(k + LINES_AHEAD);
                }
                // SAFETY: one of the row.
                unsafe {
                    let value = (*from.add(k * stride)).to_f64() - term;
                    *to.add(k * stride) = S::from_f64(value);
                }
            }
        } else if term == 0.0 {
            // SAFETY: positions of the row; where source and target overlap, each number belongs to one link only.
            unsafe { from.copy_to(to, count) };
        } else {
            for k in 0..count {
                // SAFETY: one of the row.
                unsafe { *to.add(k) = S::from_f64((*from.add(k)).to_f64() - term) };
            }
        }
    }
}

/// Minimum number of links per thread.
pub(super) const LINKS_PER_THREAD: usize = 2000;

/// Pointer to numbers that several threads write, each at different positions.
#[derive(Clone, Copy)]
struct Numbers<S>(*mut S);

// SAFETY: the user ensures that no two threads access the same number.
unsafe impl<S: Send> Sync for Numbers<S> {}

impl<S> Numbers<S> {
    fn start(&self) -> *mut S {
        self.0
    }
}

/// Calls `work` with disjoint ranges that cover `count` items and with the numbers of the slab, on several threads
/// if each has at least `least` items.
pub(super) fn each_part<S: Stored>(
    count: usize,
    least: usize,
    populations: &mut Populations<S>,
    work: impl Fn(Range<usize>, *mut S) + Sync,
) {
    let numbers = Numbers(populations.base());
    let threads = thread_pool::threads().min(count / least).max(1);
    thread_pool::each(threads, |t| {
        work(
            count * t / threads..count * (t + 1) / threads,
            numbers.start(),
        );
    });
}

/// Returns the sum over `count` items, on several threads if each has at least `least` items; `some` computes the
/// sum over a range.
pub(super) fn sums<const N: usize>(
    count: usize,
    least: usize,
    part: impl Fn(Range<usize>) -> [i128; N] + Sync,
) -> [i128; N] {
    let threads = thread_pool::threads().min(count / least).max(1);
    let mut parts = [[0; N]; thread_pool::MAX_THREADS];
    thread_pool::each_item(&mut parts[..threads], 1, |t, sums| {
        *sums = part(count * t / threads..count * (t + 1) / threads);
    });
    let add = |a: [i128; N], b: &[i128; N]| std::array::from_fn(|n| a[n] + b[n]);
    parts[..threads].iter().fold([0; N], add)
}

/// Runs of links with prefix sums, for a division among threads.
#[derive(Debug, Default)]
pub(super) struct Counted {
    /// Number of links before each run, and total.
    before: Vec<u32>,
}

impl Counted {
    /// Returns the prefix sums of runs with these numbers of links.
    pub(super) fn new(counts: impl Iterator<Item = u32>) -> Self {
        let mut before = vec![0];
        let mut all = 0;
        for count in counts {
            all += count;
            before.push(all);
        }
        Self { before }
    }

    /// Calls `give` for all links of the runs, on several threads if there are many links, with the index of a run, a
    /// range of its links, and the numbers of the slab. Each link is passed once.
    pub(super) fn each<S: Stored>(
        &self,
        runs: Range<usize>,
        populations: &mut Populations<S>,
        give: impl Fn(usize, Range<usize>, *mut S) + Sync,
    ) {
        let [start, end] = [runs.start, runs.end].map(|run| self.before[run] as usize);
        each_part(
            end - start,
            LINKS_PER_THREAD,
            populations,
            |part, numbers| {
                for (run, some) in self.runs(start + part.start..start + part.end) {
                    give(run, some, numbers);
                }
            },
        );
    }

    /// Returns the runs that contain a range of links counted over all runs: number of the run, and range of its
    /// links.
    fn runs(&self, links: Range<usize>) -> impl Iterator<Item = (usize, Range<usize>)> {
        let Range {
            start: from,
            end: to,
        } = links;
        let first = self
            .before
            .partition_point(|&before| before as usize <= from);
        (first.saturating_sub(1)..self.before.len() - 1)
            .map(move |run| {
                let [begin, end] = [run, run + 1].map(|run| self.before[run] as usize);
                (run, from.max(begin) - begin..to.min(end).max(begin) - begin)
            })
            .take_while(|(_, some)| !some.is_empty())
    }
}

/// Returns the start of the array of population `i`.
pub(super) fn first<S: Stored>(populations: &Populations<S>, i: usize) -> u32 {
    u32::try_from(populations.slot(0, i)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::{Counted, LINKS_PER_THREAD, Mirror, MirrorRun, each_part, sums};
    use crate::lattice::VelocitySet;
    use crate::populations::{Link, Parity, Populations};

    fn mirror(near: u32, far: u32, leaves: u8) -> Mirror {
        let link = |apart| Link {
            near: near + apart,
            far: far + apart,
        };
        Mirror {
            links: [link(0), link(10_000)],
            leaves,
            enters: leaves + 1,
        }
    }

    /// Checks that runs contain the mirrors from which they were made, each once, and set the same populations as the
    /// single mirrors.
    #[test]
    fn runs_are_their_mirrors() {
        let mirrors: Vec<Mirror> = (0..100)
            .map(|k| mirror(k, 3000 + k, 0))
            .chain((0..50).map(|k| mirror(200 + 7 * k, 5000 + 7 * k, 2)))
            .chain((0..9).map(|k| mirror(900 + k, 6000 + 2 * k, 2)))
            .collect();
        let mut runs: Vec<MirrorRun> = Vec::new();
        for one in &mirrors {
            match runs.last().and_then(|run| run.with(one)) {
                Some(longer) => *runs.last_mut().unwrap() = longer,
                None => runs.push(MirrorRun::single(*one)),
            }
        }
        assert_eq!(runs.len(), 2 + 9);
        let start: Vec<f64> = (0..20_000).map(f64::from).collect();
        for parity in [Parity::Home, Parity::Reversed] {
            let held: Vec<_> = runs.iter().flat_map(|run| run.mirrors()).collect();
            assert!(
                held.iter()
                    .map(|m| m.ends(parity))
                    .eq(mirrors.iter().map(|m| m.ends(parity)))
            );
            let (mut one_by_one, mut in_runs) = (start.clone(), start.clone());
            for one in &mirrors {
                let (from, to) = one.ends(parity);
                one_by_one[to] = one_by_one[from];
            }
            for run in &runs {
                let count = run.count() as usize;
                for some in [count / 3..count, 0..count / 3] {
                    // SAFETY: all numbers are in the list.
                    unsafe { run.row(some, parity).give(0.0, in_runs.as_mut_ptr()) };
                }
            }
            assert!(one_by_one == in_runs, "{parity:?}");
            assert!(in_runs != start);
        }
    }

    /// Divides the links among threads: each link and item belongs to exactly one thread.
    #[test]
    fn threads_share_all_links() {
        let counts = [3, 1, 20_000, 1, 1, 7, 9000];
        let counted = Counted::new(counts.into_iter());
        let items = 3 * LINKS_PER_THREAD;
        for threads in 1..5 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let set = VelocitySet::D2Q9.velocities();
                let mut room = Populations::<f64>::new(set, [40_000, 3, 1], 0).unwrap();
                for runs in [0..7, 0..1, 2..3, 3..7, 4..4] {
                    let at = |run: usize, k: usize| counts[..run].iter().sum::<u32>() as usize + k;
                    room.numbers_mut().fill(0.0);
                    counted.each(runs.clone(), &mut room, |run, some, numbers| {
                        for k in some {
                            // SAFETY: there are more numbers than links; each belongs to one thread.
                            unsafe { *numbers.add(at(run, k)) += 1.0 };
                        }
                    });
                    let all = at(runs.start, 0)..at(runs.end, 0);
                    let numbers = room.numbers().iter().enumerate();
                    let wrong =
                        numbers.filter(|(n, x)| **x != f64::from(u8::from(all.contains(n))));
                    assert_eq!(wrong.count(), 0, "{threads} threads, {runs:?}");
                }
                room.numbers_mut().fill(0.0);
                each_part(items, LINKS_PER_THREAD, &mut room, |part, numbers| {
                    for n in part {
                        // SAFETY: there are more numbers than items; each belongs to one thread.
                        unsafe { *numbers.add(n) += 1.0 };
                    }
                });
                assert_eq!(room.numbers().iter().sum::<f64>(), 6000.0);
                let add = |part: std::ops::Range<usize>| [part.map(|n| n as i128).sum(), 1];
                let [sum, parts] = sums(items, LINKS_PER_THREAD, add);
                assert_eq!((sum, parts), (5999 * 3000, threads.min(3) as i128));
            });
        }
    }
}
