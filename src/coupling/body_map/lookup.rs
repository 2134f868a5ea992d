//! Search for the cells of each body by geometry alone, repeated when a body has moved.

use super::rows::{Row, Rows};
use super::slab::Slab;
use super::{BodyMap, Mapped, PER_THREAD, RemapRequest, Turned};
use crate::solid_fraction::height_over;
use base::number::floor_i32;
use base::thread_pool;
use lbm::links::{CellPlane, Rigid};

/// Results for a run of consecutive bodies.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    again: Vec<RemapRequest>,
    /// Cells lost by bodies that shared no cell, each row with its body; then cells gained.
    pub(super) lost: Vec<(usize, Row)>,
    pub(super) gained: Vec<(usize, Row)>,
}

impl BodyMap {
    /// Checks the bodies that moved, divided among threads: most still have the same cells, the others must be mapped
    /// again.
    pub(super) fn recheck_moved_bodies(&mut self) {
        let count = self.bodies.len();
        let runs = thread_pool::runs(count, PER_THREAD);
        self.found
            .resize_with(runs.max(self.found.len()), Found::default);
        let (slab, motion, blocks) = (&self.slab, &self.motion, &self.blocks);
        let shared = (
            thread_pool::evenly(&mut self.found[..runs], runs),
            thread_pool::evenly(&mut self.bodies, runs),
        );
        thread_pool::each_run_of(runs, shared, |run, (found, bodies)| {
            let found = &mut found[0];
            found.clear();
            for (k, body) in (count * run / runs..).zip(bodies) {
                let block = blocks.get(k).filter(|block| !block.planes.is_empty());
                if has_moved(body, &motion[k], block, slab.dimension)
                    && !holds_the_same(body, &motion[k], slab.dimension)
                {
                    found.check(k, body, &motion[k], block, slab);
                }
            }
        });
        for found in &mut self.found[runs..] {
            found.clear();
        }
        for found in &self.found[..runs] {
            self.again.extend_from_slice(&found.again);
        }
    }
}

impl Found {
    fn clear(&mut self) {
        self.again.clear();
        self.lost.clear();
        self.gained.clear();
    }

    /// Checks body `k`.
    fn check(
        &mut self,
        k: usize,
        body: &mut Mapped,
        rigid: &Rigid,
        block: Option<&Turned>,
        slab: &Slab,
    ) {
        let mapped = body.slack >= 0.0;
        body.centre = rigid.position;
        body.radius = rigid.radius;
        body.orientation = block.map_or([0.0; 4], |block| block.quaternion);
        let frame = slab.frame(body.shift);
        if !mapped {
            let rows = slab.most_rows(rigid.radius + REACH);
            body.rows.reserve(rows);
            body.other.reserve(rows);
        }
        body.slack = find_cells(
            slab,
            rigid,
            block,
            frame,
            &mut body.other,
            &mut body.nearest,
        );
        if mapped && !body.shares && body.other == body.rows {
            return;
        }
        std::mem::swap(&mut body.rows, &mut body.other);
        body.again = true;
        self.again.push(RemapRequest {
            body: k,
            moved: true,
            shared: body.shares,
        });
        if !body.shares {
            let parts = |from: &Rows, to: &Rows, list: &mut Vec<_>| {
                let parts = from.rows().flat_map(|row| to.missing_parts(row));
                list.extend(parts.filter(|part| part.length() > 0).map(|part| (k, part)));
            };
            parts(&body.other, &body.rows, &mut self.lost);
            parts(&body.rows, &body.other, &mut self.gained);
        }
    }
}

/// Returns `true` if a body has moved by its slack since it was mapped, or was not mapped yet.
fn has_moved(body: &Mapped, now: &Rigid, block: Option<&Turned>, dimension: usize) -> bool {
    let moved: f64 = (0..dimension)
        .map(|a| (now.position[a] - body.centre[a]).powi(2))
        .sum();
    // A point of a polyhedron moves at most as far as its centroid plus its farthest corner by rotation.
    let moved = block.map_or(moved, |block| {
        let turned: f64 = (0..4)
            .map(|a| (block.quaternion[a] - body.orientation[a]).powi(2))
            .sum();
        (moved.sqrt() + 2.1 * now.radius * turned.sqrt()).powi(2)
    });
    #[expect(
        clippy::float_cmp,
        reason = "any change of the radius requires a new map"
    )]
    let resized = now.radius != body.radius;
    body.slack < 0.0 || moved >= body.slack * body.slack || resized
}

/// Distance from a body, in cells, within which cells are searched as well.
const REACH: f64 = 1.5;

/// Number of cells nearest to the surface that are watched for each body.
const MAX_WATCHED: usize = 8;

/// Cells whose centres are nearest to the surface of a disc or sphere, which are the first to change as it moves.
/// If none of them has changed, the other cells need no check.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Nearest {
    /// Watched cells in the raw frame, each with the value of [`beyond`] when it was found, in ascending order of
    /// magnitude.
    cells: [([i32; 3], f64); MAX_WATCHED],
    count: usize,
    /// Lower bound of the magnitude of [`beyond`] of all other cells.
    other_cells_bound: f64,
    /// Displacement of the body below which no other cell changes.
    reach: f64,
}

impl Nearest {
    fn clear(&mut self) {
        self.count = 0;
        self.other_cells_bound = f64::INFINITY;
        self.reach = 0.0;
    }

    /// Updates the bound for cells that are not watched by the value `beyond` of such a cell.
    #[inline(always)]
    fn pass(&mut self, beyond: f64) {
        self.other_cells_bound = self.other_cells_bound.min(beyond.abs());
    }

    /// Adds a cell to the list of watched cells, unless the list is full of nearer cells.
    #[inline(always)]
    fn watch(&mut self, cell: [i32; 3], beyond: f64) {
        if beyond.abs() >= self.other_cells_bound {
            return;
        }
        let mut place = self.count;
        if place < MAX_WATCHED {
            self.count += 1;
        } else {
            place -= 1;
            let last = self.cells[place].1.abs();
            if beyond.abs() >= last {
                return self.pass(beyond);
            }
            self.other_cells_bound = self.other_cells_bound.min(last);
        }
        while place > 0 && beyond.abs() < self.cells[place - 1].1.abs() {
            self.cells[place] = self.cells[place - 1];
            place -= 1;
        }
        self.cells[place] = (cell, beyond);
    }
}

/// Returns `d² - R²` of a cell centre at distance d from the centre of a disc or sphere of radius R: negative inside.
#[inline(always)]
fn beyond(cell: [i32; 3], rigid: &Rigid, dimension: usize) -> f64 {
    let square = |a: usize| {
        let d = f64::from(cell[a]) + 0.5 - rigid.position[a];
        d * d
    };
    let mut beside = square(1);
    if dimension == 3 {
        beside += square(2);
    }
    square(0) + beside - rigid.radius * rigid.radius
}

/// Returns a lower bound of the distance from the surface for cell centres with `|d² - R²|` of this magnitude: the
/// magnitude divided by `d + R`, which is at most 2 R plus the reach of the search. It is slightly reduced to
/// exclude rounding; beyond the searched box it is at least half a cell.
fn slack(size: f64, radius: f64) -> f64 {
    if size.is_finite() {
        (size / (2.0 * radius + 2.5) * (1.0 - 1e-6) - 1e-9).clamp(0.0, 0.4)
    } else {
        // The body does not reach this slab: the bound could be its whole distance, but it is checked again soon.
        0.4
    }
}

/// Returns `true` if a disc or sphere that has moved by its slack has the same cells as at the last check, and
/// updates its slack.
fn holds_the_same(body: &mut Mapped, now: &Rigid, dimension: usize) -> bool {
    let moved: f64 = (0..dimension)
        .map(|a| (now.position[a] - body.centre[a]).powi(2))
        .sum();
    let reach = body.nearest.reach - moved.sqrt() * (1.0 + 1e-9);
    #[expect(
        clippy::float_cmp,
        reason = "any change of the radius requires a new map"
    )]
    let resized = now.radius != body.radius;
    if body.slack < 0.0 || resized || reach.is_nan() || reach <= 0.0 {
        return false;
    }
    let mut size = f64::INFINITY;
    for (cell, before) in &body.nearest.cells[..body.nearest.count] {
        let beyond = beyond(*cell, now, dimension);
        if (beyond < 0.0) != (*before < 0.0) {
            return false;
        }
        size = size.min(beyond.abs());
    }
    body.centre = now.position;
    body.nearest.reach = reach;
    body.slack = slack(size, now.radius).min(reach);
    true
}

/// Finds the cells of a body, and its slack.
fn find_cells(
    slab: &Slab,
    rigid: &Rigid,
    block: Option<&Turned>,
    frame: [i32; 3],
    found: &mut Rows,
    nearest: &mut Nearest,
) -> f64 {
    nearest.clear();
    match (slab.dimension, block) {
        (_, Some(block)) => search_block_rows(slab, rigid, &block.planes, frame, found),
        (2, None) => search_rows::<2>(slab, rigid, frame, found, nearest),
        (_, None) => search_rows::<3>(slab, rigid, frame, found, nearest),
    }
}

fn search_rows<const D: usize>(
    slab: &Slab,
    rigid: &Rigid,
    frame: [i32; 3],
    found: &mut Rows,
    nearest: &mut Nearest,
) -> f64 {
    let [low, high] = slab.window(rigid.position, frame, rigid.radius + REACH);
    if low[0] > high[0] {
        found.clear();
        return 0.4;
    }
    let radius2 = rigid.radius * rigid.radius;
    let square = |cell: i32, a: usize| {
        let d = f64::from(cell) + 0.5 - rigid.position[a];
        d * d
    };
    let centre = rigid.position[0];
    found.take(
        [low[1] + frame[1], low[2] + frame[2]],
        [high[1] + frame[1], high[2] + frame[2]],
        |y, z| {
            let (y, z) = (y - frame[1], z - frame[2]);
            let mut beside = square(y, 1);
            if D == 3 {
                beside += square(z, 2);
            }
            // The function decreases up to the cell that contains the centre and increases from there, in spite of
            // rounding.
            let beyond = |x: i32| beyond([x, y, z], rigid, D);
            let mut near = |x: i32| {
                let x = x.clamp(low[0], high[0]);
                nearest.watch([x, y, z], beyond(x));
            };
            let middle = floor_i32(centre);
            if beyond(middle) >= 0.0 {
                near(middle);
                nearest.pass(beyond(middle - 1).min(beyond(middle + 1)));
                return [0; 2];
            }
            let half = (radius2 - beside).max(0.0).sqrt();
            let mut first = (floor_i32(centre - half - 0.5) + 1).min(middle);
            while beyond(first - 1) < 0.0 {
                first -= 1;
            }
            while beyond(first) >= 0.0 {
                first += 1;
            }
            let mut last = floor_i32(centre + half - 0.5).max(middle);
            while beyond(last + 1) < 0.0 {
                last += 1;
            }
            while beyond(last) >= 0.0 {
                last -= 1;
            }
            near(first - 1);
            near(first);
            if last > first {
                near(last);
            }
            near(last + 1);
            // The next cells are enough: cells further away are further from the surface.
            nearest.pass(beyond(first - 2).min(beyond(last + 2)));
            if first + 1 < last {
                nearest.pass(beyond(first + 1).max(beyond(last - 1)));
            }
            let from = first.max(low[0]);
            let to = (last + 1).min(high[0] + 1);
            if from < to {
                [from + frame[0], to + frame[0]]
            } else {
                [0; 2]
            }
        },
    );
    nearest.reach = slack(nearest.other_cells_bound, rigid.radius);
    let first = nearest.cells[..nearest.count].first();
    let size = first.map_or(f64::INFINITY, |(_, beyond)| beyond.abs());
    slack(size.min(nearest.other_cells_bound), rigid.radius)
}

/// Finds the rows of a polyhedron, like [`search_rows`]: the distance from its surface is at least that from the
/// nearest plane.
fn search_block_rows(
    slab: &Slab,
    rigid: &Rigid,
    planes: &[CellPlane],
    frame: [i32; 3],
    found: &mut Rows,
) -> f64 {
    let [low, high] = slab.window(rigid.position, frame, rigid.radius + REACH);
    let mut slack = 0.4_f64;
    found.take(
        [low[1] + frame[1], low[2] + frame[2]],
        [high[1] + frame[1], high[2] + frame[2]],
        |y, z| {
            let mut span = [0; 2];
            for x in low[0]..=high[0] {
                let cell = [x, y - frame[1], z - frame[2]];
                let height = height_over(planes, cell.map(|v| f64::from(v) + 0.5));
                slack = slack.min(height.abs());
                if height < 0.0 {
                    let x = x + frame[0];
                    if span[0] == span[1] {
                        span[0] = x;
                    }
                    span[1] = x + 1;
                }
            }
            span
        },
    );
    (slack * (1.0 - 1e-6) - 1e-9).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::{GHOSTS, MapGrid};
    use super::*;
    use base::random::Stream;
    use lbm::lattice::{D2Q9, D3Q19, Velocities};
    use lbm::populations::Populations;

    /// Checks that no cell centre is nearer to the surface than the slack, and that only watched cells are nearer than
    /// the reach.
    fn is_true<const D: usize>(velocities: Velocities, cells: [usize; 3], turns: usize) {
        let populations = Populations::<f64>::new(velocities, cells, 1).unwrap();
        let grid = MapGrid {
            cells,
            start: [0; 3],
            periodic: [false; 3],
            mirrored: [[false; 2]; 3],
            origin: [0.0; 3],
            spacing: 1.0,
        };
        let slab = Slab::new(&populations, grid);
        let mut draw = Stream::new(3, 0, 0);
        let (mut rows, mut nearest) = (Rows::default(), Nearest::default());
        let (mut further, mut all) = (0, 0);
        for _ in 0..turns {
            let mut rigid = Rigid {
                radius: 0.2 + 3.0 * draw.uniform(),
                ..Rigid::default()
            };
            for a in 0..D {
                // Positions that rounding and symmetry make special are included.
                let at = (cells[a] as f64 + 4.0) * draw.uniform() - 2.0;
                rigid.position[a] = if draw.uniform() < 0.2 { at.round() } else { at };
            }
            let slack = find_cells(&slab, &rigid, None, [0; 3], &mut rows, &mut nearest);
            let size = |a: usize| -GHOSTS..slab.cells[a] + GHOSTS;
            for z in if D == 3 { size(2) } else { 0..1 } {
                for (y, x) in size(1).flat_map(|y| size(0).map(move |x| (y, x))) {
                    let centre = [x, y, z].map(|v| f64::from(v) + 0.5);
                    let square = |a: usize| (centre[a] - rigid.position[a]).powi(2);
                    let distance = (0..D).map(square).sum::<f64>().sqrt();
                    let height = (distance - rigid.radius).abs();
                    let watched = &nearest.cells[..nearest.count];
                    let watched = watched.iter().any(|(cell, _)| *cell == [x, y, z]);
                    assert!(height >= slack, "{rigid:?} {x} {y} {z}: {height} {slack}");
                    assert!(
                        watched || height >= nearest.reach,
                        "{rigid:?} {x} {y} {z}: {height} {nearest:?}"
                    );
                }
            }
            all += usize::from(nearest.reach > 0.0);
            further += usize::from(nearest.reach > 2.0 * slack);
        }
        assert!(
            10 * all > 7 * turns && 10 * further > 6 * turns,
            "{further} of {all}"
        );
    }

    #[test]
    fn no_cell_changes_within_the_slack_and_none_but_those_watched_within_the_reach() {
        is_true::<2>(Velocities::for_lattice::<D2Q9, 9>(), [14, 12, 1], 4000);
        is_true::<3>(Velocities::for_lattice::<D3Q19, 19>(), [10, 11, 9], 1000);
    }
}
