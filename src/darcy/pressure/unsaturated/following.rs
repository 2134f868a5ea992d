//! Newton steps that follow the content of each cell, for time steps in which no fraction of a step of Newton's
//! method decreases the norm of the imbalances.
//!
//! Saturated ground without storage releases no water at first order in the pressure where the capacity is zero at
//! saturation, as in van Genuchten's soil with n above 1. A linear step then leads a cell that begins to drain far
//! into suction, although in a short time step it has to release little water: its suction is `(q dt)^(1/n)` for an
//! outflow `q`. The shorter the time step, the smaller is the fraction of the linear step that decreases the norm,
//! and one fraction does not suit all cells.
//!
//! The linear step therefore states the water of a cell, and the pressure follows from the water, an idea of K.
//! Krabbenhoft (Adv. Water Resour. 30 (2007) 483). With the derivative `d` of the outflow of a cell with respect
//! to its own head, its volume `V`, the time `t` of a stage and the linear change `D`, the change `x` solves
//!
//! ```text
//! V/t [M(psi + x) - M(psi)] + d x = (V/t M'(psi) + d) D
//! ```
//!
//! Both sides agree at first order, so that the convergence remains quadratic. The left side increases with `x`, and
//! a bracketed Newton method finds it. The norm of the imbalances may rise: it is dominated by cells whose content is
//! about to follow, and a time step that does not converge is shortened.

use super::Unsaturated;
use super::newton::DRIER;
use crate::pressure::Pressure;
use crate::retention::RetentionLaw;

/// Maximum number of evaluations of the content of a cell in a step.
const EVALUATIONS: u32 = 100;
/// Ratio of the imbalance of a cell to the water of its linear step that is left to the next step.
const LOOSE: f64 = 0.1;
/// Ratio of a change to the suction below which the content is linear: rounding hides the deviation.
const NEAR: f64 = 1e-6;
/// Least suction that differs from saturation, in capillary lengths.
const LEAST: f64 = 1e-16;
/// Capacity over conductance of a cell that is added in the linear system: saturated ground without storage and
/// without an imposed pressure has no linear solution.
const SOFT: f64 = 1e-9;

/// Balance of a cell whose neighbours change as in a linear step.
struct CellBalance<'a> {
    soil: &'a dyn RetentionLaw,
    /// Volume over the time of a stage \[m³/s\].
    volume: f64,
    /// Specific storage \[1/m\].
    specific: f64,
    /// Pressure head before the step \[m\], and the water per volume.
    head: f64,
    water: f64,
    /// Derivative of the outflow with respect to the head \[m²/s\].
    outflow: f64,
    /// Rate of the water of the linear step \[m³/s\].
    wanted: f64,
}

impl CellBalance<'_> {
    /// Returns the excess of the water at a head over that of the linear step \[m³/s\].
    fn excess(&self, head: f64) -> f64 {
        let water = self.soil.state(head).content + self.specific * head.max(0.0);
        self.volume * (water - self.water) + self.outflow * (head - self.head) - self.wanted
    }

    /// Returns the change of the head \[m\] with the water of the linear step, whose change is `linear`. The suction
    /// grows at most by the factor [`DRIER`] and to that of rounded content, and a cell under suction gets at most a
    /// head of a capillary length.
    fn change(&self, linear: f64) -> f64 {
        let next = self.head + linear;
        let saturated = self.head >= 0.0 && next >= 0.0;
        if saturated || linear.abs() <= NEAR * -self.head || !linear.is_finite() {
            return linear;
        }
        let length = self.soil.capillary_length();
        let rounded = (-self.soil.driest_head()).max(-self.head);
        let driest = (DRIER * length.max(-self.head)).min(rounded);
        let wettest = if self.head < 0.0 {
            length
        } else {
            f64::INFINITY
        };
        let enough = LOOSE * self.wanted.abs();
        if (-driest..=wettest).contains(&next) && self.excess(next).abs() <= enough {
            return linear;
        }
        let edge = self.excess(0.0);
        if edge <= 0.0 {
            // The water of saturated ground is linear in the head.
            let slope = self.volume * self.specific + self.outflow;
            return (-edge / slope).min(wettest) - self.head;
        }
        let suction = (-self.head).max(0.0);
        let range = if linear > 0.0 {
            [0.0, suction]
        } else {
            [suction, driest]
        };
        -self.suction(range, enough) - self.head
    }

    /// Returns the suction in a range \[m\] at which the excess is at most `enough`, or the upper end if the excess
    /// is positive there. The excess decreases with the suction.
    fn suction(&self, [mut low, mut high]: [f64; 2], enough: f64) -> f64 {
        let least = LEAST * self.soil.capillary_length();
        let (mut known, mut last) = (high, f64::INFINITY);
        for _ in 0..EVALUATIONS {
            let excess = self.excess(-known);
            if excess.abs() <= enough || high <= least {
                break;
            }
            if excess <= 0.0 {
                high = known;
            } else if known < high {
                low = known;
            } else {
                break;
            }
            let slope = self.volume * self.soil.state(-known).capacity + self.outflow;
            let newton = known + excess / slope;
            let falls = excess.abs() < 0.5 * last;
            last = excess.abs();
            known = if falls && newton > low && newton < high {
                newton
            } else if high > 4.0 * low.max(least) {
                (high * low.max(least)).sqrt()
            } else {
                0.5 * (low + high)
            };
        }
        known
    }
}

impl Pressure {
    /// Adds the capacities of [`SOFT`] to the linear system of a step that follows the content.
    pub(super) fn soften(&self, own: &mut Unsaturated) {
        let layout = self.slab.layout;
        let Some(transient) = &mut own.transient else {
            return;
        };
        for row in layout.rows(&layout.whole()) {
            for at in row {
                if transient.storing(at).0 > 0.0 {
                    let mut outflow = 0.0;
                    for (axis, faces) in own.faces.iter().enumerate() {
                        outflow += faces[at].upper + faces[at + layout.stride[axis]].lower;
                    }
                    let soft = SOFT * outflow.max(0.0);
                    transient.capacity[at] += soft;
                    own.diagonal[at] += soft;
                }
            }
        }
    }

    /// Sets the pressure after a Newton step whose water the content of each cell follows, at the states before the
    /// step.
    pub(super) fn follow_content(&mut self, own: &Unsaturated) {
        let Some(transient) = &own.transient else {
            return;
        };
        let layout = self.slab.layout;
        let part = self.largest_part(own);
        for row in layout.rows(&layout.whole()) {
            for at in row {
                let (volume, specific) = transient.storing(at);
                let change = part * own.krylov.change[at];
                if volume <= 0.0 {
                    self.phi[at] = own.start[at] + change;
                    continue;
                }
                let capacity = transient.capacity[at];
                let mut outflow = own.diagonal[at] - capacity;
                for (axis, faces) in own.faces.iter().enumerate() {
                    outflow += faces[at].upper + faces[at + layout.stride[axis]].lower;
                }
                let outflow = outflow.max(0.0);
                let state = own.states[at];
                let cell = CellBalance {
                    soil: own.law(at),
                    volume,
                    specific,
                    head: state.head,
                    water: state.content + specific * state.head.max(0.0),
                    outflow: outflow * own.weight,
                    wanted: (capacity + outflow) * change,
                };
                self.phi[at] = own.start[at] + own.weight * cell.change(change / own.weight);
            }
        }
    }

    /// Returns the head that bounds the changes of a step \[m\]: that of the ground, the difference of
    /// the heads that drive the flow and the suction of dry soil.
    pub(super) fn reach(&self, own: &Unsaturated) -> f64 {
        let rows = self.slab.layout.rows(&self.slab.layout.whole());
        let highest = rows.flatten().fold(0.0, |highest: f64, at| {
            highest.max(own.states[at].head.abs())
        });
        let lengths = own.soils.iter().map(|soil| soil.model().capillary_length());
        let longest = lengths.fold(0.0, f64::max);
        highest + self.largest_difference() / own.weight + DRIER * longest
    }

    /// Returns the largest part of a linear step in which no saturated cell changes by more than the reach. Ground
    /// that is singular without [`SOFT`] has a far larger linear step.
    fn largest_part(&self, own: &Unsaturated) -> f64 {
        let rows = self.slab.layout.rows(&self.slab.layout.whole());
        let saturated = rows.flatten().filter(|at| own.states[*at].head >= 0.0);
        let change = saturated.fold(0.0, |most: f64, at| most.max(own.krylov.change[at].abs()));
        let most = own.weight * self.reach(own);
        if change > most { most / change } else { 1.0 }
    }
}
