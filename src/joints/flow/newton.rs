//! Newton's method for a stage, with factors that are kept.
//!
//! With the factors of an earlier matrix each iteration reduces the error by about the same small factor, the relative
//! change of the matrix (chord method: C. T. Kelley, Iterative Methods for Linear and Nonlinear Equations, 1995,
//! section 5.4.1). It costs a solution instead of a factorisation. The factors are kept, also for the next step, as
//! long as each change is at most [`KEPT`] of the last one; a stage that begins with factors that are too old begins
//! again with new ones. The matrix of the factors belongs to the state: a restart computes the same factors from it.

use super::{FlowError, JointFlow};
use crate::ldl::Singular;

/// Maximum number of Newton iterations.
const MAX_ITERATIONS: usize = 60;
/// Change of the pressures, relative to the largest, at which Newton's method ends.
const CHANGE: f64 = 1e-12;
/// Change of the pressures, relative to the largest, below which a step that does not reduce the imbalance ends the
/// line search.
const ROUNDING: f64 = 1e-8;
/// Error of the pressures, relative to the largest, at which iterations with kept factors have converged: with vapour a
/// small pressure holds much water.
const KEPT_ERROR: f64 = 1e-15;
/// Change of the pressures, relative to the largest, below which only rounding remains in iterations with kept factors
/// that do not reduce the imbalance.
const KEPT_ROUNDING: f64 = 1e-11;
/// Largest change of the pressures over the last one with which Newton's method keeps its factors.
const KEPT: f64 = 0.03;
/// Displacement of a block in a stage, over the widest aperture, below which Newton's method may end.
const STILL: f64 = 1e-14;
/// Maximum number of halvings of a Newton step.
const HALVINGS: usize = 12;

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

    /// Computes the factors of the matrix of the last iterate.
    fn factorise(&mut self) -> Result<(), FlowError> {
        self.factorisations += 1;
        let [diagonal, pairs] = &mut self.factored;
        diagonal.copy_from_slice(&self.work.diagonal);
        pairs.copy_from_slice(&self.work.pairs);
        let factors = self.factors.factorise(diagonal, pairs);
        factors.map_err(|Singular(node)| FlowError::Singular(node))
    }

    fn newton(
        &mut self,
        pressure: &mut [f64],
        interval: f64,
        stores: bool,
    ) -> Result<usize, FlowError> {
        let nodes = self.volumes.len();
        let largest = |from: f64, of: &[f64]| of.iter().fold(from, |most, p| most.max(p.abs()));
        let mut change = f64::INFINITY;
        // With factors of an earlier stage the first change has no other to be compared with.
        let mut untried = self.keeps;
        self.work.first.copy_from_slice(pressure);
        let mut sum = self.imbalance(pressure, interval, stores);
        for step in 1..=MAX_ITERATIONS {
            let fresh = !self.keeps;
            if fresh && untried {
                pressure.copy_from_slice(&self.work.first);
                sum = self.imbalance(pressure, interval, stores);
                change = f64::INFINITY;
            }
            if fresh {
                untried = false;
                self.factorise()?;
            }
            let mut direction = std::mem::take(&mut self.work.net);
            direction.copy_from_slice(&self.work.imbalance);
            self.factors.solve(&mut direction);
            let size = largest(1.0, &pressure[..nodes]);
            let full = largest(0.0, &direction[..nodes]);
            let slow = largest(0.0, &direction[nodes..])
                <= ROUNDING * largest(f64::MIN_POSITIVE, &pressure[nodes..])
                    + self.small_change(interval);
            let mut trial = std::mem::take(&mut self.work.trial);
            let (mut part, mut new) = (1.0, 0.0);
            // Laminar flow needs no line search: its imbalance is concave.
            let halvings = self.settings.roughness.map_or(0, |_| HALVINGS);
            for halving in 0..=halvings {
                // If no reduced step decreases the imbalance, the full step is used.
                if halving == halvings {
                    part = 1.0;
                }
                for ((new, old), by) in trial.iter_mut().zip(&*pressure).zip(&direction) {
                    *new = old - part * by;
                }
                new = self.imbalance(&trial, interval, stores);
                // Below this change only rounding remains.
                if new < sum || full <= ROUNDING * size {
                    break;
                }
                part *= 0.5;
            }
            pressure.copy_from_slice(&trial);
            (self.work.trial, self.work.net) = (trial, direction);
            if !(new.is_finite() && full.is_finite()) {
                if fresh {
                    return Err(FlowError::NotFinite);
                }
                (self.keeps, untried) = (false, true);
                continue;
            }
            let ratio = if change.is_finite() {
                full / change
            } else {
                KEPT
            };
            // A change that is compared with none is judged by the next one.
            untried &= !change.is_finite() || ratio > KEPT;
            self.keeps = part >= 1.0 && ratio <= KEPT;
            change = part * full;
            let floor = if fresh { ROUNDING } else { KEPT_ROUNDING };
            let stagnant = change <= floor * size && new >= 0.25 * sum;
            let converged = if fresh {
                change <= CHANGE * size
            } else {
                self.keeps && ratio * change <= KEPT_ERROR * size
            };
            if (converged || stagnant) && slow {
                // Factors that have reached rounding serve the next stage as well.
                self.keeps = true;
                return Ok(step);
            }
            sum = new;
        }
        Err(FlowError::NotConverged {
            steps: MAX_ITERATIONS,
            change,
        })
    }

    /// Returns the change of a velocity that moves a block by rounding errors of the widest aperture in a time \[s\].
    fn small_change(&self, interval: f64) -> f64 {
        let gaps = self.gaps.iter().map(|gap| gap.constant);
        STILL * gaps.fold(self.network.settings.residual_aperture, f64::max) / interval
    }
}
