//! The cells of each body by geometry alone, found again where a body has moved.

use super::rows::{Row, Rows};
use super::slab::Slab;
use super::{Again, BodyMap, Mapped, PER_THREAD, Turned};
use crate::coupling::solid_fraction::Form;
use crate::lbm::links::{Plane, Rigid};
use crate::number::floor_i32;
use crate::thread_pool;

/// What looks at a run of bodies have found.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    again: Vec<Again>,
    /// Cells that bodies which shared none have lost and gained, with the body.
    pub(super) lost: Vec<(usize, Row)>,
    pub(super) gained: Vec<(usize, Row)>,
}

impl BodyMap {
    /// Looks at the bodies that moved, by threads: most still hold the same cells, the others are to be mapped `again`.
    pub(super) fn look_again(&mut self) {
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
                if has_moved(body, &motion[k], block, slab.dimension) {
                    found.look(k, body, &motion[k], block, slab);
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

    /// Looks at body `k`.
    fn look(
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
        body.slack = look(slab, rigid, block, slab.frame(body.shift), &mut body.other);
        if mapped && !body.shares && body.other == body.rows {
            return;
        }
        std::mem::swap(&mut body.rows, &mut body.other);
        body.again = true;
        self.again.push(Again {
            body: k,
            moved: true,
            shared: body.shares,
        });
        if !body.shares {
            let parts = |from: &Rows, to: &Rows, list: &mut Vec<_>| {
                let parts = from.rows().flat_map(|row| to.lack(row));
                list.extend(parts.filter(|part| part.length() > 0).map(|part| (k, part)));
            };
            parts(&body.other, &body.rows, &mut self.lost);
            parts(&body.rows, &body.other, &mut self.gained);
        }
    }
}

/// Whether a body has moved by its slack since it was mapped, or was not mapped yet.
fn has_moved(body: &Mapped, now: &Rigid, block: Option<&Turned>, dimension: usize) -> bool {
    let moved: f64 = (0..dimension)
        .map(|a| (now.position[a] - body.centre[a]).powi(2))
        .sum();
    // A point of a polyhedron moves no further than its centroid and its farthest corner by turning.
    let moved = block.map_or(moved, |block| {
        let turned: f64 = (0..4)
            .map(|a| (block.quaternion[a] - body.orientation[a]).powi(2))
            .sum();
        (moved.sqrt() + 2.1 * now.radius * turned.sqrt()).powi(2)
    });
    #[expect(
        clippy::float_cmp,
        reason = "any change of radius at all asks for a new map"
    )]
    let resized = now.radius != body.radius;
    body.slack < 0.0 || moved >= body.slack * body.slack || resized
}

/// Finds the cells of a body, and its slack.
fn look(
    slab: &Slab,
    rigid: &Rigid,
    block: Option<&Turned>,
    frame: [i32; 3],
    found: &mut Rows,
) -> f64 {
    match (slab.dimension, block) {
        (_, Some(block)) => look_in_block(slab, rigid, &block.planes, frame, found),
        (2, None) => look_in::<2>(slab, rigid, frame, found),
        (_, None) => look_in::<3>(slab, rigid, frame, found),
    }
}

fn look_in<const D: usize>(slab: &Slab, rigid: &Rigid, frame: [i32; 3], found: &mut Rows) -> f64 {
    let [low, high] = slab.window(rigid.position, frame, rigid.radius + 1.5);
    if low[0] > high[0] {
        found.clear();
        return 0.4;
    }
    let radius2 = rigid.radius * rigid.radius;
    let square = |cell: i32, a: usize| {
        let d = f64::from(cell) + 0.5 - rigid.position[a];
        d * d
    };
    // The smallest |distance - radius|, by way of squares: |d² - R²| / (d + R) with d + R at most 2 R + reach.
    let mut slack2 = f64::INFINITY;
    let centre = rigid.position[0];
    found.take(
        [low[1] + frame[1], low[2] + frame[2]],
        [high[1] + frame[1], high[2] + frame[2]],
        |y, z| {
            let mut beside = square(y - frame[1], 1);
            if D == 3 {
                beside += square(z - frame[2], 2);
            }
            // Falls towards the cell that holds the centre and rises from there, rounding included.
            let beyond = |x: i32| square(x, 0) + beside - radius2;
            let mut near = |x: i32| slack2 = slack2.min(beyond(x.clamp(low[0], high[0])).abs());
            let middle = floor_i32(centre);
            if beyond(middle) >= 0.0 {
                near(middle);
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
            for x in [first - 1, first, last, last + 1] {
                near(x);
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
    // A little below the true slack, so that rounding cannot matter; beyond the searched box it is at least half a cell.
    if slack2.is_finite() {
        (slack2 / (2.0 * rigid.radius + 2.5) * (1.0 - 1e-6) - 1e-9).clamp(0.0, 0.4)
    } else {
        // The body does not reach this slab: it may come closer by its whole distance, but look again soon.
        0.4
    }
}

/// As [`look_in`], of a polyhedron: the distance from its surface is at least that from the nearest plane.
fn look_in_block(
    slab: &Slab,
    rigid: &Rigid,
    planes: &[Plane],
    frame: [i32; 3],
    found: &mut Rows,
) -> f64 {
    let [low, high] = slab.window(rigid.position, frame, rigid.radius + 1.5);
    let form = Form::Block {
        planes,
        centre: rigid.position,
        radius: rigid.radius,
    };
    let mut slack = 0.4_f64;
    found.take(
        [low[1] + frame[1], low[2] + frame[2]],
        [high[1] + frame[1], high[2] + frame[2]],
        |y, z| {
            let mut span = [0; 2];
            for x in low[0]..=high[0] {
                let cell = [x, y - frame[1], z - frame[2]];
                let height = form.height(cell.map(|v| f64::from(v) + 0.5));
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
