//! Two steps in one sweep in the water far from a free surface ([`crate::surface::depths`]).
//!
//! The surface moves between the two steps, and reads and writes populations next to it only. Far from it the second
//! step of a cell depends on the first step of its neighbours alone, as between walls ([`super::two_steps`]), and
//! follows it in the same sweep:
//!
//! | work | cells |
//! |---|---|
//! | surface before the first step | |
//! | even pass; walls; odd pass two planes behind | all; all; those far from the surface |
//! | surface after the first step and before the second one | |
//! | odd pass; walls | the others; all |
//! | surface after the second step | |
//!
//! Every number is computed from the same numbers by the same operations as in two single steps, so that the bits are
//! the same. With an eddy viscosity, which needs the velocities of all cells after each step, every step is single.

use super::two_steps::{MIN_PLANES, Moment, ROWS, Sweep, inside};
use super::{Fluid, between, planes_of};
use crate::halo::Across;
use crate::kernel::Shared;
use crate::lanes::Stored;
use crate::populations::Parity;
use crate::saturation::pass::View as CoverView;
use crate::surface::depths::{Depths, SlabRows};
use crate::surface::lists::{Plane, is_written};
use crate::turbulence::field::View;
use base::thread_pool;

/// Place of a step in a call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// A single step.
    #[default]
    Single,
    /// The first of two steps in one sweep.
    First,
    /// The second of two steps in one sweep.
    Second,
}

/// Two steps in one sweep below a free surface.
#[derive(Debug, Default)]
pub(super) struct BelowSurface {
    depths: Depths,
    stage: Stage,
}

impl BelowSurface {
    /// Returns `true` in the first of two steps.
    pub(super) fn is_first(&self) -> bool {
        self.stage == Stage::First
    }

    /// Returns the parts of rows that the first of two steps has left to the pass of the second, in the second step.
    pub(super) fn left(&self) -> Option<&[Plane]> {
        (self.stage == Stage::Second).then(|| self.depths.near())
    }
}

impl<S: Stored> Fluid<S> {
    /// Makes two steps with a free surface, which moves in both. Collective.
    pub(super) fn advance_two_below_surface(&mut self) {
        let mut below = self.below.take().unwrap_or_default();
        let far = self.find_far(&mut below.depths);
        let stages = [Stage::First, Stage::Second];
        for stage in stages.map(|stage| if far { stage } else { Stage::Single }) {
            if let Some(surface) = &self.surface
                && stage == Stage::Second
            {
                below.depths.find_near(surface.planes(), self.slab_rows());
            }
            below.stage = stage;
            self.below = Some(below);
            self.advance();
            self.move_surface();
            below = self.below.take().unwrap_or_default();
        }
        below.stage = Stage::Single;
        self.below = Some(below);
    }

    /// Finds the parts of rows far from the surface. Returns `true` if there are some.
    pub(super) fn find_far(&self, depths: &mut Depths) -> bool {
        let planes = self.populations.cells()[self.populations.order()[0]];
        let interior = between(planes);
        let threads = self.workers(&interior).max(1);
        let Some(surface) = &self.surface else {
            return false;
        };
        if interior.len() / threads < MIN_PLANES {
            return false;
        }
        let swept = |t: usize| inside(&planes_of(&interior, threads, t), 2);
        let may = |plane: usize| (0..threads).any(|t| swept(t).contains(&plane));
        depths.find(surface.planes(), self.slab_rows(), may)
    }

    /// Returns the rows of the slab.
    fn slab_rows(&self) -> SlabRows {
        let populations = &self.populations;
        let [slow, middle, fast] = populations.order();
        let (cells, first) = (populations.cells(), populations.cell([0; 3]));
        let distance = |axis: usize| {
            let mut at = [0; 3];
            at[axis] = 1;
            populations.cell(at) - first
        };
        let periodic = self.extent.periodic_within;
        SlabRows {
            rows: cells[middle],
            cells: cells[fast],
            first,
            plane: distance(slow),
            row: distance(middle),
            periodic: [periodic[middle], periodic[fast]],
        }
    }

    /// Makes the first of two passes in the planes between the ends of the slab, with its walls in the inner planes of
    /// each thread, and the second one far from the surface; `even` describes the first.
    pub(super) fn run_ahead(&mut self, even: &Shared<S>, force: [f64; 3]) {
        let order = self.populations.order();
        let [round_middle, round_rows] = [1, 2].map(|n| self.extent.periodic_within[order[n]]);
        let odd = (self.describe)(
            &mut self.populations,
            View::NONE,
            CoverView::NONE,
            round_rows,
        );
        let (Some(below), Some(surface)) = (&self.below, &self.surface) else {
            return;
        };
        let odd = odd.only_wet(below.depths.far());
        let wet = surface.planes();
        let written = |plane: usize| is_written(wet, plane.cast_signed());
        let written: &(dyn Fn(usize) -> bool + Sync) = &written;
        #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
        let [second, third] = [self.step + 1, self.step + 2].map(|step| step as f64);
        let first = Moment {
            force,
            time: second,
            parity: Parity::Reversed,
        };
        let second = Moment {
            force: self.force.force_at(second),
            time: third,
            parity: Parity::Home,
        };
        let sweep = Sweep {
            step: self.pass.as_ref(),
            boundaries: &self.boundaries,
            shared: [even, &odd],
            moments: [&first, &second],
            ghosts: None,
            // Rows across a periodic axis need the row at the other end.
            rows: if round_middle { even.rows() } else { ROWS },
            across: round_middle.then(|| (Across::new(&self.populations), written)),
            completes: false,
        };
        let interior = between(self.populations.cells()[order[0]]);
        let threads = self.workers(&interior);
        thread_pool::each(threads, |t| {
            // SAFETY: the parts of the planes are disjoint, and each worker has one.
            unsafe { sweep.planes(&planes_of(&interior, threads, t), t) };
        });
    }
}
