//! Two steps in one sweep over the lattice, for water between walls, with or without an eddy viscosity.
//!
//! A pass reads and writes every population, and the memory bandwidth limits it if the arithmetic takes less time.
//! The second step of a cell depends only on the first step of its neighbours. It follows the first step at a
//! distance of two planes and two rows, while their populations are still in the cache. This halves the memory
//! traffic (temporal blocking as a wavefront; M. Wittmann, G. Hager, J. Treibig, G. Wellein, Parallel Process.
//! Lett. 20 (2010) 359). The planes are traversed once for every [`ROWS`] rows, so that only that number of rows of
//! four planes lies between the two steps: 6 MB for 200 cells per row in D3Q27, compared with 35 MB for whole
//! planes.
//!
//! Order of the work at plane p and rows up to y, each at its distance from the previous one:
//!
//! | plane, row | work | requires |
//! |---|---|---|
//! | p, y | even pass | nothing |
//! | p - 1, y - 1 | walls of the first step, velocities for its eddy viscosity beyond faces | the even pass of
//! adjacent cells |
//! | p - 2, y - 2 | odd pass | adjacent walls of the first step, which it would overwrite |
//! | p - 3, y - 3 | walls of the second step, velocities for its eddy viscosity beyond faces | the odd pass of
//! adjacent cells |
//!
//! Whole vectors of the even pass extend beyond the end of a row, to numbers that the walls set.
//!
//! Each thread sweeps its planes. The part next to the planes of other threads and ranks follows after these are
//! done. Every number is computed from the same numbers by the same operations as in two single steps, so that the
//! bits are the same.

use super::dispatch::Step;
use super::{Fluid, between, planes_of};
use crate::block::RowBlock;
use crate::boundary::Boundaries;
use crate::halo::Across;
use crate::kernel::Shared;
use crate::lanes::Stored;
use crate::populations::Parity;
use crate::term::Term;
use crate::turbulence::field::{Field, Ghosts};
use base::thread_pool;
use std::ops::Range;
use std::sync::Arc;

/// Number of rows traversed at a time through all planes. Fewer rows would fit into the second-level cache, but
/// hardware prefetching is better with longer pieces of memory: from 8 to 48 the speed is the same
/// (`benches/HISTORY.md`).
pub(super) const ROWS: usize = 32;

/// Minimum number of planes per thread for a sweep.
pub(super) const MIN_PLANES: usize = 8;

/// Data of one of the two steps.
#[derive(Clone, Copy)]
pub(super) struct Moment {
    pub(super) force: [f64; 3],
    pub(super) time: f64,
    /// State of the populations after the pass of this step.
    pub(super) parity: Parity,
}

/// Returns the planes of the part of a thread that have at least this distance from its ends.
pub(super) fn inside(share: &Range<usize>, distance: usize) -> Range<usize> {
    let first = share.start + distance;
    first..share.end.saturating_sub(distance).max(first)
}

impl<S: Stored> Fluid<S> {
    /// Returns `true` if two steps can be made in one sweep: only walls act on the populations between them, with or
    /// without an eddy viscosity, or only walls and a free surface. It is equal on every rank.
    #[must_use]
    pub fn may_advance_two(&self) -> bool {
        let [_, middle, _] = self.populations.order();
        let allowed = if self.surface.is_some() {
            // An eddy viscosity is computed from velocities that the surface sets between the steps.
            self.turbulence.is_none()
        } else {
            !self.extent.periodic_within[middle]
        };
        self.populations.parity() == Parity::Home
            && allowed
            && self.left_out.is_none()
            && self.terms().all(Term::allows_two_steps)
    }

    /// Makes two steps in one sweep. No code reads the populations between them. A free surface moves in both.
    #[inline(never)]
    pub fn advance_two(&mut self) {
        if self.surface.is_some() {
            return self.advance_two_below_surface();
        }
        let planes = self.populations.cells()[self.populations.order()[0]];
        let interior = between(planes);
        let threads = self.workers(&interior).max(1);
        if !self.may_advance_two() || interior.len() / threads < MIN_PLANES {
            self.advance();
            self.advance();
            return;
        }
        self.shared_with_gpu = false;
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let moment = |step: u64, parity: Parity| Moment {
            force: self.force.force_at(step as f64),
            time: (step + 1) as f64,
            parity,
        };
        let first = moment(self.step, Parity::Reversed);
        let second = moment(self.step + 1, Parity::Home);
        let shares: Vec<Range<usize>> = (0..threads)
            .map(|t| planes_of(&interior, threads, t))
            .collect();
        // Planes next to the ends of the parts, and the end planes of the slab, which belong to the first and the
        // last part.
        let rest = |t: usize, distance: usize| {
            let all = &shares[t];
            let begin = if t == 0 { 0 } else { all.start };
            let end = if t + 1 == threads { planes } else { all.end };
            let done = inside(all, distance);
            [begin..done.start, done.end..end]
        };

        // The end planes come first: their populations are sent during the sweep.
        let even = self.describe_pass();
        self.run_ends(&even, first.force);
        self.populations.flip();
        if let Some(field) = &mut self.field {
            field.swap();
            field.exchange_start();
        }
        let odd = self.describe_pass();
        self.halo.start(&self.populations);
        let sweep = Sweep {
            step: self.pass.as_ref(),
            boundaries: &self.boundaries,
            shared: [&even, &odd],
            moments: [&first, &second],
            ghosts: self.field.as_ref().map(Field::ghosts),
            rows: ROWS,
            across: None,
            completes: true,
        };
        thread_pool::each(threads, |t| {
            // SAFETY: the parts are disjoint, and each worker has one.
            unsafe { sweep.planes(&shares[t], t) };
        });
        self.halo.finish(&mut self.populations);
        if let Some(field) = &mut self.field {
            let planes = (0..threads).flat_map(|t| rest(t, 1));
            field.complete(planes, |patch| {
                sweep.boundaries.velocity_factor(patch, first.time)
            });
        }
        thread_pool::each(threads, |t| {
            for planes in rest(t, 1) {
                // SAFETY: the passes of the first step are done, and each worker has its own planes.
                unsafe { sweep.walls(0, &even.planes(planes)) };
            }
        });
        thread_pool::each(threads, |t| {
            for planes in rest(t, 2) {
                // SAFETY: as above.
                unsafe { sweep.pass(1, &odd.planes(planes), t) };
            }
        });
        self.populations.flip();
        if let Some(field) = &mut self.field {
            field.swap();
            field.exchange_start();
        }
        self.halo.start(&self.populations);
        self.halo.finish(&mut self.populations);
        if let Some(field) = &mut self.field {
            let planes = (0..threads).flat_map(|t| rest(t, 3));
            field.complete(planes, |patch| {
                sweep.boundaries.velocity_factor(patch, second.time)
            });
        }
        thread_pool::each(threads, |t| {
            for planes in rest(t, 3) {
                // SAFETY: the passes of the second step are done.
                unsafe { sweep.walls(1, &odd.planes(planes)) };
            }
        });
        self.step += 2;
    }
}

/// Data of both steps, each with its index.
pub(super) struct Sweep<'a, S: Stored> {
    pub(super) step: &'a dyn Step<S>,
    pub(super) boundaries: &'a Boundaries<S>,
    pub(super) shared: [&'a Shared<S>; 2],
    pub(super) moments: [&'a Moment; 2],
    /// Ghosts of the velocities for the next eddy viscosity, if there is one.
    pub(super) ghosts: Option<Arc<Ghosts>>,
    /// Number of rows traversed at a time through all planes.
    pub(super) rows: usize,
    /// Copies after the first pass across the rows of a plane, along a periodic axis, and the planes with copies; all
    /// rows are traversed at a time then.
    pub(super) across: Option<(Across, &'a (dyn Fn(usize) -> bool + Sync))>,
    /// `true` if the sweep completes the second step, so that its walls follow.
    pub(super) completes: bool,
}

impl<S: Stored> Sweep<'_, S> {
    /// Computes both steps of the planes of a part as far as they are independent of other parts.
    ///
    /// # Safety
    /// No other thread may access these planes or be this worker.
    pub(super) unsafe fn planes(&self, share: &Range<usize>, worker: usize) {
        let rows = self.shared[0].rows();
        for top in (0..rows).step_by(self.rows) {
            let bottom = (top + self.rows).min(rows);
            // Rows that are due at a distance behind.
            let behind = |distance: usize| {
                let end = if bottom == rows {
                    rows
                } else {
                    bottom.saturating_sub(distance)
                };
                top.saturating_sub(distance)..end
            };
            for plane in share.start..share.end + 3 {
                let due = |distance: usize| {
                    let plane = plane.checked_sub(distance)?;
                    let planes = plane..plane + 1;
                    let rows = behind(distance);
                    let there = inside(share, distance).contains(&plane);
                    there.then_some(RowBlock { planes, rows })
                };
                // SAFETY: promised by the caller; the order is that of the module.
                unsafe {
                    if let Some(cells) = due(0) {
                        self.pass(0, &cells, worker);
                        if let Some((across, written)) = &self.across
                            && written(plane)
                        {
                            across.copy(plane, self.shared[0].numbers());
                        }
                    }
                    if let Some(cells) = due(1) {
                        self.walls(0, &cells);
                        self.velocities(0, &cells);
                    }
                    if let Some(cells) = due(2) {
                        self.pass(1, &cells, worker);
                    }
                    if let Some(cells) = due(3)
                        && self.completes
                    {
                        self.walls(1, &cells);
                        self.velocities(1, &cells);
                    }
                }
            }
        }
    }

    /// Computes the pass of the first or second step (0, 1) over a block of cells.
    ///
    /// # Safety
    /// No other thread may access these cells or be this worker.
    unsafe fn pass(&self, which: usize, cells: &RowBlock, worker: usize) {
        let force = self.moments[which].force;
        // SAFETY: promised by the caller.
        unsafe {
            self.step.pass(self.shared[which], force, cells, worker);
        }
    }

    /// Fills the velocities beyond faces next to a block of cells after the first or second step (0, 1), which the next
    /// pass reads.
    ///
    /// # Safety
    /// The pass of the step must be done there and in adjacent cells, and no other thread may access these cells.
    unsafe fn velocities(&self, which: usize, cells: &RowBlock) {
        if let Some(ghosts) = &self.ghosts {
            let ramp = |patch| {
                self.boundaries
                    .velocity_factor(patch, self.moments[which].time)
            };
            // SAFETY: promised by the caller.
            unsafe { ghosts.follow(cells, self.shared[which].velocity(), ramp) };
        }
    }

    /// Sets the populations of a block of cells that return from walls in the first or second step (0, 1).
    ///
    /// # Safety
    /// The pass of the step must be done there and in adjacent cells, and no other thread may access these cells.
    unsafe fn walls(&self, which: usize, cells: &RowBlock) {
        let &Moment { time, parity, .. } = self.moments[which];
        let numbers = self.shared[which].numbers();
        // SAFETY: promised by the caller.
        unsafe {
            self.boundaries.give_walls(cells, time, parity, numbers);
        }
    }
}
