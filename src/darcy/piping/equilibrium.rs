//! Equilibrium of a pipe of given length with the seepage around it.
//!
//! Cells of the pipe are numbered from the exit. With the slope `i_n` between the cells n - 1 and n (from the exit to
//! the centre of cell 0 for n = 0) the discharges through the pipe, the inflows from the soil and the heads are
//!
//! ```text
//! Q_n = Q(i_n),   q_n = Q_n - Q_(n+1),   p_n = sum over m <= n of i_m l_m      l_0 = l/2, l_m = l
//! p_n = b_n + u_n H - sum over m of G_nm q_m - e_n q_n
//! ```
//!
//! with background b, drive u, fall G and entry e of [`SoilResponse`]. Newton's method solves these equations for the
//! logarithms of the slopes and the head H, with one of them held. The smallest head is where its derivative with
//! respect to the slope of the tip vanishes; this derivative follows from the same matrix.

use super::{Conveyance, SoilResponse};
use nalgebra::{DMatrix, DVector};

/// Maximum number of Newton iterations.
const ITERATIONS: usize = 60;
/// Change of the logarithm of a slope, and relative change of the head, at which an iteration ends. It converges
/// quadratically, so that the error is of the order of rounding.
const CONVERGED: f64 = 1e-9;
/// Maximum change of the logarithm of a slope in an iteration.
const LONGEST: f64 = 1.0;
/// First step of the search for the slope of the tip, in its logarithm.
const FIRST_STEP: f64 = 0.1;
/// Width of the interval of the logarithm of the slope of the tip at which the search ends. The head is a minimum
/// there, so that its error is of the order of the square.
const NARROW: f64 = 1e-7;
/// Maximum number of steps of the search for a slope of the tip.
const STEPS: usize = 120;

/// Slopes along a pipe and the driving head.
#[derive(Clone, Debug, PartialEq)]
pub struct PipeState {
    /// Logarithms of the slopes of the head, from the exit to the tip.
    pub log_slopes: Vec<f64>,
    /// Difference of head between drive and exit \[m\].
    pub head: f64,
}

/// Unknown that keeps its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldUnknown {
    /// Slope of the head at the tip.
    TipSlope,
    /// Difference of head between drive and exit.
    Head,
}

/// Returns the heads in the cells of a pipe above that of the exit \[m\].
pub fn heads(slopes: &[f64], length: f64) -> impl Iterator<Item = f64> {
    let mut sum = 0.0;
    slopes.iter().enumerate().map(move |(n, slope)| {
        sum += slope * if n == 0 { 0.5 * length } else { length };
        sum
    })
}

/// Pipe in the first cells of its path.
#[derive(Clone, Copy, Debug)]
pub struct Equilibrium<'a, C> {
    soil: &'a SoilResponse,
    pipe: &'a C,
    count: usize,
}

impl<'a, C: Conveyance> Equilibrium<'a, C> {
    /// Returns the equations of a pipe with `count` cells.
    #[must_use]
    pub fn new(soil: &'a SoilResponse, pipe: &'a C, count: usize) -> Self {
        Self { soil, pipe, count }
    }

    /// Returns the smallest head at which the pipe is in equilibrium, starting from the state of a pipe that is one
    /// cell shorter; none if none was found.
    #[must_use]
    pub fn smallest_head(&self, shorter: Option<&PipeState>) -> Option<PipeState> {
        let guess = match shorter {
            Some(PipeState { log_slopes, head }) => {
                let mut longer = Vec::with_capacity(self.count);
                longer.extend(log_slopes.first().copied());
                longer.extend_from_slice(log_slopes);
                PipeState {
                    log_slopes: longer,
                    head: *head,
                }
            }
            None => PipeState {
                log_slopes: vec![0.0; self.count],
                head: 0.0,
            },
        };
        let mut low = self.solve(guess, HeldUnknown::TipSlope)?;
        let mut rate = self.rate(&low)?;
        // The head falls with the slope of the tip below the minimum, and rises above it.
        let mut step = if rate < 0.0 { FIRST_STEP } else { -FIRST_STEP };
        let mut tried = 0;
        let (mut high, mut other) = loop {
            let next = self.moved(&low, step)?;
            let its_rate = self.rate(&next)?;
            if its_rate.signum() * rate.signum() <= 0.0 {
                break (next, its_rate);
            }
            (low, rate) = (next, its_rate);
            step *= 1.5;
            tried += 1;
            if tried > STEPS {
                return None;
            }
        };
        for _ in 0..STEPS {
            let (a, b) = (tip(&low), tip(&high));
            if (b - a).abs() < NARROW {
                break;
            }
            // The secant, kept away from the ends so that the interval shrinks.
            let part = (rate / (rate - other)).clamp(0.02, 0.98);
            let part = if part.is_finite() { part } else { 0.5 };
            let middle = self.moved(&low, part * (b - a))?;
            let between = self.rate(&middle)?;
            if between.signum() * rate.signum() > 0.0 {
                (low, rate) = (middle, between);
            } else {
                (high, other) = (middle, between);
            }
        }
        Some(if low.head < high.head { low } else { high })
    }

    /// Returns the state with a larger logarithm of the slope of the tip.
    fn moved(&self, state: &PipeState, by: f64) -> Option<PipeState> {
        let mut guess = state.clone();
        if let Some(last) = guess.log_slopes.last_mut() {
            *last += by;
        }
        self.solve(guess, HeldUnknown::TipSlope)
    }

    /// Solves the equations by Newton's method from a guess; none if it does not converge.
    #[must_use]
    pub fn solve(&self, mut state: PipeState, held: HeldUnknown) -> Option<PipeState> {
        for _ in 0..ITERATIONS {
            let (residual, by_slopes) = self.equations(&state);
            let matrix = self.matrix(by_slopes, held);
            let change = matrix.lu().solve(&-residual)?;
            let last = self.count - 1;
            let mut largest = 0.0_f64;
            for n in 0..last {
                largest = largest.max(change[n].abs());
            }
            let (mut by_head, mut relative) = (0.0, 0.0);
            match held {
                HeldUnknown::TipSlope => {
                    by_head = change[last];
                    relative = by_head.abs() / (state.head + by_head).abs();
                }
                HeldUnknown::Head => largest = largest.max(change[last].abs()),
            }
            let scale = (LONGEST / largest).min(1.0);
            for n in 0..last {
                state.log_slopes[n] += scale * change[n];
            }
            match held {
                HeldUnknown::TipSlope => state.head += scale * by_head,
                HeldUnknown::Head => state.log_slopes[last] += scale * change[last],
            }
            if !(largest.is_finite() && state.head.is_finite()) {
                return None;
            }
            if largest < CONVERGED && relative < CONVERGED {
                return Some(state);
            }
        }
        None
    }

    /// Returns the derivative of the head with respect to the logarithm of the slope of the tip \[m\].
    fn rate(&self, state: &PipeState) -> Option<f64> {
        let (_, by_slopes) = self.equations(state);
        let last = self.count - 1;
        let by_tip: DVector<f64> = by_slopes.column(last).into_owned();
        let matrix = self.matrix(by_slopes, HeldUnknown::TipSlope);
        let change = matrix.lu().solve(&-by_tip)?;
        Some(change[last]).filter(|rate| rate.is_finite())
    }

    /// Returns the matrix of an iteration: the derivatives with respect to the slopes, and to the head in the last
    /// column if the slope of the tip is held.
    fn matrix(&self, mut by_slopes: DMatrix<f64>, held: HeldUnknown) -> DMatrix<f64> {
        if held == HeldUnknown::TipSlope {
            for (row, drive) in self.soil.drive[..self.count].iter().enumerate() {
                by_slopes[(row, self.count - 1)] = -drive;
            }
        }
        by_slopes
    }

    /// Returns the residuals of the equations and their derivatives with respect to the logarithms of the slopes.
    fn equations(&self, state: &PipeState) -> (DVector<f64>, DMatrix<f64>) {
        let (soil, count) = (self.soil, self.count);
        let slopes: Vec<f64> = state.log_slopes.iter().map(|y| y.exp()).collect();
        let through: Vec<[f64; 2]> = slopes.iter().map(|i| self.pipe.discharge(*i)).collect();
        let mut inflow: Vec<f64> = through.iter().map(|[discharge, _]| *discharge).collect();
        for n in 1..count {
            inflow[n - 1] -= through[n][0];
        }
        let mut residual = DVector::zeros(count);
        let mut by_slopes = DMatrix::zeros(count, count);
        for (row, head) in heads(&slopes, soil.length).enumerate() {
            let falls: f64 = (0..count).map(|m| soil.fall[(row, m)] * inflow[m]).sum();
            let (entry, by_width) = self.entry(row, slopes[row]);
            residual[row] = head - soil.background[row] - soil.drive[row] * state.head
                + falls
                + entry * inflow[row];
            for (column, slope) in slopes.iter().enumerate() {
                let along = match column {
                    _ if column > row => 0.0,
                    0 => 0.5 * soil.length * slope,
                    _ => soil.length * slope,
                };
                // A discharge enters the pipe in its cell and not in the next one towards the exit.
                let mut falls = soil.fall[(row, column)];
                if column == row {
                    falls += entry;
                }
                if column > 0 {
                    falls -= soil.fall[(row, column - 1)];
                    if column - 1 == row {
                        falls -= entry;
                    }
                }
                by_slopes[(row, column)] = along + falls * through[column][1];
            }
            by_slopes[(row, row)] += by_width * inflow[row];
        }
        (residual, by_slopes)
    }

    /// Returns the resistance between the centre of a cell and the pipe \[s/m2\], and its derivative with respect to
    /// the logarithm of the slope.
    fn entry(&self, cell: usize, slope: f64) -> (f64, f64) {
        let base = self.soil.entry[cell];
        match self.soil.slit {
            None => (base, 0.0),
            Some(without) => {
                let (width, power) = self.pipe.width(slope);
                (base * (without / width).ln(), -power * base)
            }
        }
    }
}

fn tip(state: &PipeState) -> f64 {
    state.log_slopes[state.log_slopes.len() - 1]
}
