//! Newton's method for a stage, with factors that are kept.
//!
//! With the factors of an earlier matrix each iteration reduces the error by about the same small factor, the relative
//! change of the matrix (chord method: C. T. Kelley, Iterative Methods for Linear and Nonlinear Equations, 1995,
//! section 5.4.1). It costs a solution instead of a factorisation. The factors are kept, also for the next step, as
//! long as each iteration leaves at most [`KEPT`] of the imbalance; a stage that begins with factors that are too old
//! begins again with new ones. Factors that leave more than the error of a stage cost iterations: they are renewed when
//! these have cost as much as a factorisation. The matrix of the factors belongs to the state: a restart computes the
//! same factors from it.
//!
//! The part of the imbalance that an iteration leaves, times its change of the pressures, is the error that remains.
//! Imbalances are compared in units of pressure: each is divided by the diagonal of the matrix.

use super::{FlowError, JointFlow};
use crate::ldl::Singular;

/// Maximum number of Newton iterations.
const MAX_ITERATIONS: usize = 60;
/// Error of the pressures of steady flow, and their last change, relative to the largest.
const STEADY_ERROR: f64 = 1e-15;
const STEADY_CHANGE: f64 = 1e-12;
/// Error of the pressures at the end of a stage, relative to the largest, and to the largest change in the stage: the
/// water that is missing in a balance is part of the next one.
const ERROR: f64 = 1e-10;
const ERROR_OF_CHANGE: f64 = 1e-4;
/// Change of the pressures, relative to the largest, below which only rounding remains: with new factors, and in
/// iterations with kept factors that do not reduce the imbalance.
const ROUNDING: f64 = 1e-8;
const KEPT_ROUNDING: f64 = 1e-11;
/// Largest part of the imbalance that an iteration leaves with which Newton's method keeps its factors.
const KEPT: f64 = 0.03;
/// Number of iterations beyond the first of each stage that cost as much as a factorisation: then factors are renewed.
const COSTS: usize = 8;
/// Displacement of a block in a stage, over the widest aperture, below which Newton's method may end.
const STILL: f64 = 1e-14;
/// Maximum number of halvings of a Newton step.
const HALVINGS: usize = 12;

/// Returns the largest magnitude of several numbers, at least `from`.
fn largest(from: f64, of: &[f64]) -> f64 {
    of.iter().fold(from, |most, number| most.max(number.abs()))
}

/// Returns the largest magnitude of the differences of two lists.
fn largest_difference(one: &[f64], other: &[f64]) -> f64 {
    let differences = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

/// Step of an iteration.
struct Change {
    /// Largest change of a pressure \[Pa\], and of a velocity or rate.
    pressure: f64,
    velocity: f64,
    /// Part of the Newton step that was taken.
    part: f64,
    /// Sum of the squares of the nodal imbalances before and after.
    sums: [f64; 2],
    /// Part of the imbalance that remains, in units of pressure.
    left: f64,
}

impl JointFlow {
    /// Solves for the pressures of a stage; returns the number of Newton iterations.
    pub(super) fn solve(&mut self, interval: f64, stores: bool) -> Result<usize, FlowError> {
        let mut unknowns = std::mem::take(&mut self.pressure);
        let nodes = unknowns.len();
        for mover in &self.movers {
            unknowns.extend(mover.velocity.iter());
        }
        let outcome = self.newton(&mut unknowns, interval, stores);
        unknowns.truncate(nodes);
        self.pressure = unknowns;
        outcome
    }

    /// Computes the factors of the matrix at these pressures and velocities.
    fn factorise(
        &mut self,
        unknowns: &[f64],
        interval: f64,
        stores: bool,
    ) -> Result<(), FlowError> {
        self.system.factorisations += 1;
        self.system.extra = 0;
        self.set_matrix(unknowns, interval, stores);
        let [diagonal, pairs] = &self.system.factored;
        let factors = self.system.factors.factorise(diagonal, pairs);
        factors.map_err(|Singular(node)| FlowError::Singular(node))
    }

    fn newton(
        &mut self,
        unknowns: &mut [f64],
        interval: f64,
        stores: bool,
    ) -> Result<usize, FlowError> {
        self.system.keeps &= self.system.extra < COSTS;
        // Factors of an earlier stage have no iteration of this one yet.
        let mut untried = self.system.keeps;
        self.work.first.copy_from_slice(unknowns);
        let mut sum = self.imbalance(unknowns, interval, stores);
        let mut change = f64::INFINITY;
        for step in 1..=MAX_ITERATIONS {
            let fresh = !self.system.keeps;
            if fresh && untried {
                unknowns.copy_from_slice(&self.work.first);
                sum = self.imbalance(unknowns, interval, stores);
            }
            if fresh {
                untried = false;
                self.factorise(unknowns, interval, stores)?;
            }
            let made = self.iterate(unknowns, interval, stores, sum);
            if !(made.sums[1].is_finite() && made.pressure.is_finite()) {
                if fresh {
                    return Err(FlowError::NotFinite);
                }
                (self.system.keeps, untried) = (false, true);
                continue;
            }
            change = made.pressure;
            sum = made.sums[1];
            self.system.keeps = made.part >= 1.0 && made.left <= KEPT;
            untried &= !self.system.keeps;
            if self.has_converged(unknowns, &made, (interval, stores, fresh)) {
                // Factors that have reached rounding serve the next stage as well.
                self.system.keeps = true;
                self.system.extra += step - 1;
                return Ok(step);
            }
        }
        Err(FlowError::NotConverged {
            steps: MAX_ITERATIONS,
            change,
        })
    }

    /// Makes an iteration with the present factors. `sum` is that of the squares of the nodal imbalances before.
    fn iterate(&mut self, unknowns: &mut [f64], interval: f64, stores: bool, sum: f64) -> Change {
        let nodes = self.storage.volumes.len();
        let before = self.largest_imbalance();
        let mut direction = std::mem::take(&mut self.work.net);
        direction.copy_from_slice(&self.work.imbalance);
        self.system.factors.solve(&mut direction);
        let size = largest(1.0, &unknowns[..nodes]);
        let full = largest(0.0, &direction[..nodes]);
        let mut trial = std::mem::take(&mut self.work.trial);
        let (mut part, mut new) = (1.0, 0.0);
        // Laminar flow needs no line search: its imbalance is concave.
        let halvings = self.settings.roughness.map_or(0, |_| HALVINGS);
        for halving in 0..=halvings {
            // If no reduced step decreases the imbalance, the full step is used.
            if halving == halvings {
                part = 1.0;
            }
            for ((new, old), by) in trial.iter_mut().zip(&*unknowns).zip(&direction) {
                *new = old - part * by;
            }
            new = self.imbalance(&trial, interval, stores);
            // Below this change only rounding remains.
            if new < sum || full <= ROUNDING * size {
                break;
            }
            part *= 0.5;
        }
        unknowns.copy_from_slice(&trial);
        let velocity = part * largest(0.0, &direction[nodes..]);
        (self.work.trial, self.work.net) = (trial, direction);
        let after = self.largest_imbalance();
        Change {
            pressure: part * full,
            velocity,
            part,
            sums: [sum, new],
            left: if after <= 0.0 { 0.0 } else { after / before },
        }
    }

    /// Returns `true` if the unknowns have converged after an iteration; `fresh` if its factors were new.
    fn has_converged(
        &self,
        unknowns: &[f64],
        made: &Change,
        (interval, stores, fresh): (f64, bool, bool),
    ) -> bool {
        let nodes = self.storage.volumes.len();
        let first = &self.work.first;
        let (pressures, velocities) = unknowns.split_at(nodes);
        let size = largest(1.0, pressures);
        let whole = made.part >= 1.0 && made.left <= 1.0;
        let floor = if fresh { ROUNDING } else { KEPT_ROUNDING };
        let stagnant = made.pressure <= floor * size && made.sums[1] >= 0.25 * made.sums[0];
        if !stores {
            let small = made.left * made.pressure <= STEADY_ERROR * size;
            return stagnant || (whole && small) || made.pressure <= STEADY_CHANGE * size;
        }
        let [moved, kicked] = [(pressures, &first[..nodes]), (velocities, &first[nodes..])]
            .map(|(now, first)| ERROR_OF_CHANGE * largest_difference(now, first));
        let converged = whole && made.left * made.pressure <= moved.max(ERROR * size);
        let slow = kicked.max(ERROR * largest(0.0, velocities)) + self.small_change(interval);
        let left = if stagnant { 1.0 } else { made.left };
        (converged || stagnant) && left * made.velocity <= slow && self.largest_kick() <= slow
    }

    /// Returns the change of a velocity that moves a block by rounding errors of the widest aperture in a time \[s\].
    fn small_change(&self, interval: f64) -> f64 {
        let gaps = self.walls.gaps.iter().map(|gap| gap.constant);
        STILL * gaps.fold(self.network.settings.residual_aperture, f64::max) / interval
    }
}
