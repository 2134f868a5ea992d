//! The fit of the erosion law `rate = k_d (tau_h - tau_c)` above the threshold tau_c, zero below (equation 9).
//!
//! **Least squares.** The sum `sum w_i (rate_i - k (tau_i - c)_+)^2` is smooth between neighbouring stresses, so that
//! its minimum is found exactly. For every set of points above the threshold, the candidate is the weighted line
//! through them. If the threshold of this line lies outside the gap that belongs to the set, the candidate is the best
//! law with the threshold at the end of the gap. The best candidate is the fit. There is no start value, no iteration
//! and no local minimum. `tau_c >= 0`.
//!
//! **Weights** are the inverse of the variance that the *law* predicts, because weights from observed rates bias the
//! law to low values: `b q max(rate, q) + (s rate)^2`. `q` is the quantum of the window (one grain), `b` its burstiness
//! (batch variance over Poisson variance, at least 1), and `s` the relative scatter between runs. `s` is the smallest
//! value with which the weighted misfit of the points above the threshold does not exceed their number less two (Paule
//! and Mandel, J. Res. Natl. Bur. Stand. 87, 377, 1982). Weights and law are iterated until they converge.
//!
//! **Intervals** of 95 % are the hull of two intervals: one from the covariance of the line (Student's t), one from a
//! bootstrap that draws whole runs, because the windows of one run share a packing. The bootstrap is seeded: the same
//! data give the same numbers. Two points leave no degree of freedom; their interval takes Student's t of one, and R^2
//! is not defined.
//!
//! **Lower bound.** If the run with the highest stress does not erode, tau_c is at least that stress, and k_d is
//! undefined. If it erodes but fewer than two stresses do, tau_c lies between the highest stress without erosion and
//! the lowest one with erosion. A run that loses fewer grains than erosion needs decides nothing, and a stress that is
//! not positive, such as that of a flow that has nearly stopped, is no bound. Where no point is left for a bound, the
//! law is undetermined.

use super::rate::RateWindow;
use crate::statistics::{median, student};
use base::number::real;
use base::random::SplitMix;

/// A confidence interval, 95 % unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Returns `true` if a value lies in the interval.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// Returns the smallest interval that contains both.
    #[must_use]
    fn hull(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
}

/// One measured pair of stress and rate.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RatePoint {
    /// Number of the run of this point; the bootstrap draws whole runs.
    pub run: usize,
    /// Hydraulic shear stress, Pa.
    pub shear: f64,
    /// Erosion rate, kg/(m^2 s).
    pub rate: f64,
    /// Standard error of the rate, kg/(m^2 s).
    pub error: f64,
    /// Erosion rate of one grain in the window, kg/(m^2 s).
    pub quantum: f64,
    /// `true` if the window counts as eroding.
    pub eroding: bool,
    /// `true` if grains left the run, but too few to count as erosion: the run shows neither erosion nor its absence.
    pub undecided: bool,
}

impl RatePoint {
    /// Returns the point of a window of a run. The run may be undecided.
    #[must_use]
    pub fn new(run: usize, window: &RateWindow, undecided: bool) -> Self {
        Self {
            run,
            shear: window.shear,
            rate: window.rate,
            error: window.rate_error,
            quantum: window.quantum,
            eroding: window.eroding,
            undecided,
        }
    }

    /// Returns `true` if the point shows a positive stress without erosion.
    fn resists(&self) -> bool {
        !self.eroding && !self.undecided && self.shear > 0.0
    }

    /// Returns the batch variance over Poisson variance, at least 1.
    fn burstiness(&self) -> f64 {
        (self.error * self.error / (self.quantum * self.rate.max(self.quantum))).max(1.0)
    }

    /// Returns the variance of the measured rate if the law predicts `rate`.
    fn variance(&self, rate: f64, scatter: f64) -> f64 {
        let counting = if self.quantum > 0.0 {
            self.burstiness() * self.quantum * rate.max(self.quantum)
        } else {
            self.error * self.error
        };
        counting + (scatter * rate).powi(2)
    }
}

/// Settings of the confidence intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FitOptions {
    /// Number of bootstrap samples.
    pub replicates: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            replicates: 2000,
            seed: 2012,
        }
    }
}

/// Erosion law, or bound of the law, that follows from the points.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FittedErosionLaw {
    /// Critical stress and erosion coefficient are known.
    Fitted(LinearLaw),
    /// No erosion at the highest stress that decides: `tau_c >= at_least`.
    LowerBound {
        /// Highest stress without erosion, Pa; positive.
        at_least: f64,
    },
    /// Erosion starts between two stresses, and only one stress erodes.
    Bracketed {
        /// Highest stress without erosion below the lowest one with erosion, Pa; 0 if there is none.
        above: f64,
        /// Lowest stress with erosion, Pa.
        below: f64,
    },
    /// Neither a law nor a bound follows: grains left, but too few for a rate, or no stress is positive.
    Undetermined,
}

/// Law fitted to the points.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct LinearLaw {
    /// Critical shear stress tau_c, Pa.
    pub critical_shear: f64,
    /// Confidence interval of tau_c, Pa.
    pub critical_shear_interval: Interval,
    /// Erosion coefficient k_d, s/m.
    pub coefficient: f64,
    /// Confidence interval of k_d, s/m.
    pub coefficient_interval: Interval,
    /// Fraction of the variance of the rates of eroding points that the law explains (R^2); NaN for two points,
    /// which a line always joins.
    pub r_squared: f64,
    /// Relative scatter between runs in addition to the counting error of the grains.
    pub scatter: f64,
    /// Number of points.
    pub points: usize,
    /// Number of points with erosion.
    pub eroding_points: usize,
    /// Number of runs.
    pub runs: usize,
    /// k_d from Theil and Sen's median of slopes over the eroding points, s/m.
    pub coefficient_median: f64,
    /// tau_c of this median line, Pa.
    pub critical_shear_median: f64,
    /// Bootstrap samples `(k_d, tau_c)`.
    #[serde(skip)]
    pub replicates: Vec<(f64, f64)>,
    #[serde(skip)]
    line: Line,
}

impl LinearLaw {
    /// Returns the rate at a stress, kg/(m^2 s).
    #[must_use]
    pub fn rate(&self, shear: f64) -> f64 {
        self.coefficient * (shear - self.critical_shear).max(0.0)
    }

    /// Returns the interval of the mean rate at a stress, kg/(m^2 s).
    #[must_use]
    pub fn rate_interval(&self, shear: f64) -> Interval {
        let rate = self.rate(shear);
        let half = if shear > self.critical_shear {
            self.line.half_width(shear)
        } else {
            0.0
        };
        let analytic = Interval {
            low: (rate - half).max(0.0),
            high: rate + half,
        };
        let mut rates: Vec<f64> = self
            .replicates
            .iter()
            .map(|&(k, c)| k * (shear - c).max(0.0))
            .collect();
        percentiles(&mut rates).map_or(analytic, |drawn| drawn.hull(analytic))
    }
}

/// Weighted regression line with its variances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Line {
    /// Weighted mean stress.
    centre: f64,
    /// Variance of the line's value at the mean stress.
    variance: f64,
    /// Variance of the slope.
    slope_variance: f64,
    /// Quantile of Student's t.
    quantile: f64,
}

impl Line {
    /// Returns the half width of the interval of the line's value at a stress.
    fn half_width(&self, shear: f64) -> f64 {
        let distance = shear - self.centre;
        self.quantile * (self.variance + self.slope_variance * distance * distance).sqrt()
    }
}

/// Fits the law, or returns the bound that follows from the points. `None` without a point that has a finite stress and
/// rate.
#[must_use]
pub fn fit_law(points: &[RatePoint], options: FitOptions) -> Option<FittedErosionLaw> {
    let mut points: Vec<RatePoint> = points
        .iter()
        .filter(|point| point.shear.is_finite() && point.rate.is_finite())
        .copied()
        .collect();
    sort(&mut points);
    let highest = *points.last()?;
    // The whole run at the highest stress decides, not a single window of it.
    let highest_erodes = points
        .iter()
        .any(|point| point.run == highest.run && point.eroding);
    let erodes = |point: &&RatePoint| point.eroding && point.shear > 0.0;
    let resisted = points.iter().rev().find(|point| point.resists());
    if !highest_erodes {
        // A run that decides nothing does not hide a run below it that does.
        let eroded = points.iter().rev().find(erodes);
        if let Some(&RatePoint { shear, .. }) = resisted
            && eroded.is_none_or(|eroded| eroded.shear <= shear)
        {
            return Some(FittedErosionLaw::LowerBound { at_least: shear });
        }
    }
    let eroding: Vec<RatePoint> = points
        .iter()
        .filter(|point| point.eroding)
        .copied()
        .collect();
    let Some(first) = eroding.iter().find(erodes) else {
        return Some(FittedErosionLaw::Undetermined);
    };
    let bracket = FittedErosionLaw::Bracketed {
        above: points
            .iter()
            .filter(|point| point.resists() && point.shear < first.shear)
            .map(|point| point.shear)
            .fold(0.0, f64::max),
        below: first.shear,
    };
    let (Some(scatter), Some(last)) = (scatter(&points), eroding.last()) else {
        return Some(bracket);
    };
    if eroding.len() < 2 || last.shear <= first.shear {
        return Some(bracket);
    }
    let Some(best) = minimise(&points, scatter) else {
        return Some(bracket);
    };
    Some(FittedErosionLaw::Fitted(describe(
        &points, &eroding, scatter, best, options,
    )))
}

/// Adds confidence intervals and goodness of fit to a fit.
fn describe(
    points: &[RatePoint],
    eroding: &[RatePoint],
    scatter: f64,
    best: Threshold,
    options: FitOptions,
) -> LinearLaw {
    let Threshold { k, c } = best;
    let line = line_covariance(points, best, scatter);
    let spread = line.slope_variance.sqrt() * line.quantile;
    let shift = line.half_width(c) / k;
    let mut coefficient_interval = Interval {
        low: (k - spread).max(0.0),
        high: k + spread,
    };
    let mut critical_shear_interval = Interval {
        low: (c - shift).max(0.0),
        high: c + shift,
    };
    let replicates = bootstrap(points, scatter, options);
    let drawn = |pick: fn(&(f64, f64)) -> f64| {
        percentiles(&mut replicates.iter().map(pick).collect::<Vec<_>>())
    };
    if let Some(drawn) = drawn(|sample| sample.0) {
        coefficient_interval = coefficient_interval.hull(drawn);
    }
    if let Some(drawn) = drawn(|sample| sample.1) {
        critical_shear_interval = critical_shear_interval.hull(drawn);
    }
    let n = real(eroding.len());
    let mean = eroding.iter().map(|point| point.rate).sum::<f64>() / n;
    let total: f64 = eroding
        .iter()
        .map(|point| (point.rate - mean).powi(2))
        .sum();
    let left: f64 = eroding
        .iter()
        .map(|point| (point.rate - best.rate(point.shear)).powi(2))
        .sum();
    let (coefficient_median, critical_shear_median) = theil_sen(eroding);
    LinearLaw {
        critical_shear: c,
        critical_shear_interval,
        coefficient: k,
        coefficient_interval,
        r_squared: if total > 0.0 && eroding.len() > 2 {
            1.0 - left / total
        } else {
            f64::NAN
        },
        scatter,
        points: points.len(),
        eroding_points: eroding.len(),
        runs: runs_of(points).len(),
        coefficient_median,
        critical_shear_median,
        replicates,
        line,
    }
}

/// Slope and threshold of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Threshold {
    k: f64,
    c: f64,
}

impl Threshold {
    fn rate(&self, shear: f64) -> f64 {
        self.k * (shear - self.c).max(0.0)
    }
}

fn sort(points: &mut [RatePoint]) {
    points.sort_by(|a, b| a.shear.total_cmp(&b.shear).then(a.rate.total_cmp(&b.rate)));
}

/// Returns the runs in order of first appearance.
fn runs_of(points: &[RatePoint]) -> Vec<usize> {
    let mut runs: Vec<usize> = points.iter().map(|point| point.run).collect();
    runs.sort_unstable();
    runs.dedup();
    runs
}

/// Minimises the squared misfit, with weights from the law itself, iterated until law and weights converge. The
/// points are sorted by stress.
fn minimise(points: &[RatePoint], scatter: f64) -> Option<Threshold> {
    let start =
        |point: &RatePoint| 1.0 / point.variance(point.rate, scatter).max(f64::MIN_POSITIVE);
    let mut weights: Vec<f64> = points.iter().map(start).collect();
    let mut best = scan(points, &weights)?;
    for _ in 0..50 {
        for (weight, point) in weights.iter_mut().zip(points) {
            let variance = point.variance(best.rate(point.shear), scatter);
            *weight = 1.0 / variance.max(f64::MIN_POSITIVE);
        }
        let next = scan(points, &weights)?;
        let rest = (next.k - best.k).abs() <= 1e-9 * best.k
            && (next.c - best.c).abs() <= 1e-9 * next.c.max(best.c);
        best = next;
        if rest {
            break;
        }
    }
    Some(best)
}

/// Returns the exact least-squares threshold law for given weights. The points are sorted by stress. `None` if no
/// set of at least two points has a positive slope.
fn scan(points: &[RatePoint], weights: &[f64]) -> Option<Threshold> {
    let reference = points.last()?.shear;
    // Sums over the points from the current one to the last: 1, x, y, xx, xy, yy, with x relative to the highest
    // stress.
    let (mut w, mut wx, mut wy, mut wxx, mut wxy, mut wyy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut below: f64 = points
        .iter()
        .zip(weights)
        .map(|(point, weight)| weight * point.rate * point.rate)
        .sum();
    let mut best: Option<(f64, Threshold)> = None;
    for at in (0..points.len()).rev() {
        let (point, weight) = (&points[at], weights[at]);
        let x = point.shear - reference;
        w += weight;
        wx += weight * x;
        wy += weight * point.rate;
        wxx += weight * x * x;
        wxy += weight * x * point.rate;
        wyy += weight * point.rate * point.rate;
        below = (below - weight * point.rate * point.rate).max(0.0);
        if at + 1 == points.len() {
            continue;
        }
        let (low, high) = (
            if at == 0 { 0.0 } else { points[at - 1].shear } - reference,
            x,
        );
        if high < low {
            continue;
        }
        let mut offer = |c: f64| {
            // Best slope for a threshold at c, and its misfit.
            let xx = wxx - 2.0 * c * wx + c * c * w;
            let xy = wxy - c * wy;
            if xx > 0.0 && xy > 0.0 {
                let k = xy / xx;
                let misfit = below + (wyy - k * xy).max(0.0);
                if best.is_none_or(|(least, _)| misfit < least) {
                    best = Some((
                        misfit,
                        Threshold {
                            k,
                            c: c + reference,
                        },
                    ));
                }
            }
        };
        let (xx, xy) = (wxx - wx * wx / w, wxy - wx * wy / w);
        if xx > 0.0 && xy > 0.0 {
            let c = wx / w - wy / w * xx / xy;
            if (low..=high).contains(&c) {
                offer(c);
                continue;
            }
        }
        offer(low);
        if at + 2 < points.len() {
            offer(high);
        }
    }
    best.map(|(_, law)| Threshold {
        c: law.c.max(0.0),
        ..law
    })
}

/// Returns the smallest relative scatter at which the points above the threshold fit the law; `None` if there is no
/// fit.
fn scatter(points: &[RatePoint]) -> Option<f64> {
    // Misfit per degree of freedom, minus one.
    let excess = |scatter: f64| {
        let law = minimise(points, scatter)?;
        let above: Vec<f64> = points
            .iter()
            .filter(|point| point.shear > law.c)
            .map(|point| {
                let rate = law.rate(point.shear);
                (point.rate - rate).powi(2) / point.variance(rate, scatter).max(f64::MIN_POSITIVE)
            })
            .collect();
        let free = real(above.len()) - 2.0;
        Some(if free > 0.0 {
            above.iter().sum::<f64>() / free - 1.0
        } else {
            -1.0
        })
    };
    if excess(0.0)? <= 0.0 {
        return Some(0.0);
    }
    let (mut low, mut high) = (0.0, 2.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if excess(middle)? > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

/// Returns the covariance of the line through the points above the threshold.
fn line_covariance(points: &[RatePoint], law: Threshold, scatter: f64) -> Line {
    let above: Vec<(f64, f64)> = points
        .iter()
        .filter(|point| point.shear > law.c)
        .map(|point| {
            let variance = point.variance(law.rate(point.shear), scatter);
            (point.shear, 1.0 / variance.max(f64::MIN_POSITIVE))
        })
        .collect();
    let w: f64 = above.iter().map(|&(_, w)| w).sum();
    let centre = above.iter().map(|&(x, w)| w * x).sum::<f64>() / w;
    let xx: f64 = above.iter().map(|&(x, w)| w * (x - centre).powi(2)).sum();
    Line {
        centre,
        variance: 1.0 / w,
        slope_variance: 1.0 / xx,
        quantile: student(above.len().saturating_sub(2)),
    }
}

/// Draws whole runs with replacement and fits each sample; samples without a fit are left out.
fn bootstrap(points: &[RatePoint], scatter: f64, options: FitOptions) -> Vec<(f64, f64)> {
    let runs = runs_of(points);
    if runs.len() < 3 {
        return Vec::new();
    }
    let members: Vec<Vec<RatePoint>> = runs
        .iter()
        .map(|&run| {
            points
                .iter()
                .filter(|point| point.run == run)
                .copied()
                .collect()
        })
        .collect();
    let mut random = SplitMix::new(options.seed);
    let mut sample: Vec<RatePoint> = Vec::new();
    (0..options.replicates)
        .filter_map(|_| {
            sample.clear();
            for _ in 0..members.len() {
                sample.extend_from_slice(&members[random.below(members.len())]);
            }
            sort(&mut sample);
            let eroding = |point: &&RatePoint| point.eroding;
            let first = sample.iter().find(eroding)?.shear;
            let last = sample.iter().rev().find(eroding)?.shear;
            if last <= first {
                return None;
            }
            minimise(&sample, scatter).map(|law| (law.k, law.c))
        })
        .collect()
}

/// Returns the central interval with 95 % of the values; `None` for fewer than forty values.
fn percentiles(values: &mut [f64]) -> Option<Interval> {
    if values.len() < 40 {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let skip = values.len() / 40;
    Some(Interval {
        low: values[skip],
        high: values[values.len() - 1 - skip],
    })
}

/// Fits by Theil and Sen: median slope over all pairs, and the threshold of the median intercept.
fn theil_sen(points: &[RatePoint]) -> (f64, f64) {
    let mut slopes: Vec<f64> = points
        .iter()
        .enumerate()
        .flat_map(|(i, a)| points[i + 1..].iter().map(move |b| (a, b)))
        .filter(|(a, b)| b.shear > a.shear)
        .map(|(a, b)| (b.rate - a.rate) / (b.shear - a.shear))
        .collect();
    let slope = median(&mut slopes);
    let mut intercepts: Vec<f64> = points
        .iter()
        .map(|point| point.rate - slope * point.shear)
        .collect();
    (slope, -median(&mut intercepts) / slope)
}

/// Trends of the fits over a series of cohesions.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct CohesionTrend {
    /// Slope of ln k_d against ln C; `None` for fewer than three fits.
    pub coefficient_exponent: Option<f64>,
    /// Confidence interval of the exponent.
    pub coefficient_exponent_interval: Option<Interval>,
    /// `true` if the interval excludes zero.
    pub coefficient_has_trend: bool,
    /// `(max - min) / mean` of k_d over the fits.
    pub coefficient_variation: f64,
    /// `true` if tau_c never decreases from one cohesion to the next by more than both intervals, and increases
    /// over the series.
    pub critical_shear_increases: bool,
    /// Number of pairs of neighbours at which tau_c decreases by more than both intervals.
    pub reversals: usize,
}

/// Returns the trend of tau_c and k_d with cohesion, from `(C/d in N/m, law)` in any order. `None` for fewer than two
/// fits.
///
/// A lower bound cannot contradict an increase and does not enter the trend.
#[must_use]
pub fn cohesion_trend(laws: &[(f64, FittedErosionLaw)]) -> Option<CohesionTrend> {
    let mut fits: Vec<(f64, &LinearLaw)> = laws
        .iter()
        .filter_map(|(cohesion, law)| match law {
            FittedErosionLaw::Fitted(fit) if *cohesion > 0.0 && fit.coefficient > 0.0 => {
                Some((*cohesion, fit))
            }
            _ => None,
        })
        .collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (first, last) = (fits.first()?.1, fits.last()?.1);
    if fits.len() < 2 {
        return None;
    }
    let reversals = fits
        .windows(2)
        .filter(|pair| {
            pair[1].1.critical_shear_interval.high < pair[0].1.critical_shear_interval.low
        })
        .count();
    let coefficients: Vec<f64> = fits.iter().map(|(_, fit)| fit.coefficient).collect();
    let n = real(fits.len());
    let mean = coefficients.iter().sum::<f64>() / n;
    let most = coefficients.iter().copied().fold(f64::MIN, f64::max);
    let least = coefficients.iter().copied().fold(f64::MAX, f64::min);
    let trend = log_slope(&fits);
    Some(CohesionTrend {
        coefficient_exponent: trend.map(|(slope, _)| slope),
        coefficient_exponent_interval: trend.map(|(_, interval)| interval),
        coefficient_has_trend: trend.is_some_and(|(_, interval)| !interval.contains(0.0)),
        coefficient_variation: (most - least) / mean,
        critical_shear_increases: reversals == 0 && last.critical_shear > first.critical_shear,
        reversals,
    })
}

/// Returns the slope of ln k_d against ln C with its interval; `None` for fewer than three fits or a single cohesion.
fn log_slope(fits: &[(f64, &LinearLaw)]) -> Option<(f64, Interval)> {
    if fits.len() < 3 {
        return None;
    }
    let n = real(fits.len());
    let points: Vec<(f64, f64)> = fits
        .iter()
        .map(|(c, fit)| (c.ln(), fit.coefficient.ln()))
        .collect();
    let (mx, my) = (
        points.iter().map(|p| p.0).sum::<f64>() / n,
        points.iter().map(|p| p.1).sum::<f64>() / n,
    );
    let xx: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    if xx <= 0.0 {
        return None;
    }
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / xx;
    let left: f64 = points
        .iter()
        .map(|p| (p.1 - my - slope * (p.0 - mx)).powi(2))
        .sum();
    let half = student(fits.len() - 2) * (left / (n - 2.0) / xx).sqrt();
    Some((
        slope,
        Interval {
            low: slope - half,
            high: slope + half,
        },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use base::random::Draws;

    const TRUE_THRESHOLD: Threshold = Threshold { k: 9.1, c: 9e-4 };

    fn exact(run: usize, shear: f64) -> RatePoint {
        let rate = TRUE_THRESHOLD.rate(shear);
        RatePoint {
            run,
            shear,
            rate,
            error: 1e-4,
            quantum: 1e-6,
            eroding: rate > 0.0,
            undecided: false,
        }
    }

    fn fitted(law: Option<FittedErosionLaw>) -> LinearLaw {
        match law {
            Some(FittedErosionLaw::Fitted(fit)) => fit,
            other => panic!("no fit: {other:?}"),
        }
    }

    #[test]
    fn an_exact_law_comes_back() {
        let points: Vec<RatePoint> = [4e-4, 8e-4, 1.2e-3, 3e-3, 8e-3, 2e-2]
            .iter()
            .enumerate()
            .map(|(i, &t)| exact(i, t))
            .collect();
        let fit = fitted(fit_law(&points, FitOptions::default()));
        assert_relative_eq!(fit.coefficient, TRUE_THRESHOLD.k, max_relative = 1e-9);
        assert_relative_eq!(fit.critical_shear, TRUE_THRESHOLD.c, max_relative = 1e-9);
        assert_relative_eq!(
            fit.coefficient_median,
            TRUE_THRESHOLD.k,
            max_relative = 1e-9
        );
        assert_relative_eq!(
            fit.critical_shear_median,
            TRUE_THRESHOLD.c,
            max_relative = 1e-9
        );
        assert_relative_eq!(fit.r_squared, 1.0, max_relative = 1e-12);
        assert!(fit.scatter.abs() < 1e-12);
        assert_eq!((fit.points, fit.eroding_points, fit.runs), (6, 4, 6));
        assert!(fit.coefficient_interval.contains(TRUE_THRESHOLD.k));
        assert!(fit.rate_interval(1e-2).contains(TRUE_THRESHOLD.rate(1e-2)));
        assert!(fit.rate_interval(1e-5).low.abs() < 1e-300);
    }

    #[test]
    fn two_points_fit_a_line_and_tell_nothing_of_its_quality() {
        let points = [exact(0, 3e-3), exact(0, 8e-3)];
        let fit = fitted(fit_law(&points, FitOptions::default()));
        assert_relative_eq!(fit.coefficient, TRUE_THRESHOLD.k, max_relative = 1e-9);
        assert!(fit.r_squared.is_nan());
        // The error of the slope from those of the rates, times Student's t of one degree of freedom.
        let error = |p: &RatePoint| p.variance(p.rate, 0.0);
        let slope_error = (error(&points[0]) + error(&points[1])).sqrt() / 5e-3;
        assert_relative_eq!(
            fit.coefficient_interval.high - fit.coefficient,
            12.706 * slope_error,
            max_relative = 1e-6
        );
    }

    #[test]
    fn the_scan_finds_the_least_squares_of_a_fine_search() {
        let mut draws = Draws::new(3);
        for _ in 0..40 {
            let mut points: Vec<RatePoint> = (0..12)
                .map(|run| {
                    let mut point = exact(run, 1e-2 * draws.uniform());
                    point.rate = (point.rate + 0.02 * draws.normal()).max(0.0);
                    point
                })
                .collect();
            sort(&mut points);
            let weights: Vec<f64> = points.iter().map(|_| 0.5 + draws.uniform()).collect();
            let misfit = |law: Threshold| -> f64 {
                points
                    .iter()
                    .zip(&weights)
                    .map(|(p, w)| w * (p.rate - law.rate(p.shear)).powi(2))
                    .sum()
            };
            let found = scan(&points, &weights).unwrap();
            let least = misfit(found);
            let top = points[points.len() - 2].shear;
            for step in 0..2000 {
                let c = top * f64::from(step) / 2000.0;
                let (mut xy, mut xx) = (0.0, 0.0);
                for (p, w) in points.iter().zip(&weights).filter(|(p, _)| p.shear > c) {
                    xy += w * p.rate * (p.shear - c);
                    xx += w * (p.shear - c).powi(2);
                }
                let searched = misfit(Threshold { k: xy / xx, c });
                assert!(
                    least <= searched * (1.0 + 1e-9),
                    "{found:?} {least} {c} {searched}"
                );
            }
        }
    }

    /// Returns a study of ten runs with four windows each: grains leave one by one at random times, and the rates
    /// of the runs scatter by `scatter`.
    fn study(draws: &mut Draws, scatter: f64) -> Vec<RatePoint> {
        let mut points = Vec::new();
        for run in 0..10_u32 {
            let load = 5e-4 * 1.45_f64.powi(i32::try_from(run).unwrap());
            let factor = (scatter * draws.normal()).exp();
            for window in 0..4 {
                let shear = load * (1.0 + 0.08 * f64::from(window));
                let rate = TRUE_THRESHOLD.rate(shear) * factor;
                let quantum = 2e-4;
                // Number of grains in the window: a Poisson process, by its waiting times.
                let (mut clock, mut grains) = (0.0, 0_u32);
                loop {
                    clock += draws.exponential(1.0);
                    if clock > rate / quantum {
                        break;
                    }
                    grains += 1;
                }
                let rate = quantum * f64::from(grains);
                points.push(RatePoint {
                    run: usize::try_from(run).unwrap(),
                    shear,
                    rate,
                    error: (rate.max(quantum) * quantum).sqrt(),
                    quantum,
                    eroding: grains >= 3,
                    undecided: (1..3).contains(&grains),
                });
            }
        }
        points
    }

    /// Returns the fractions of 200 studies whose intervals contain k_d and tau_c, and the mean k_d divided by the
    /// true one.
    fn coverage(scatter: f64) -> (f64, f64, f64) {
        let mut draws = Draws::new(42);
        let options = FitOptions {
            replicates: 300,
            seed: 1,
        };
        let (mut slope, mut threshold, mut mean) = (0, 0, 0.0);
        for _ in 0..200 {
            let fit = fitted(fit_law(&study(&mut draws, scatter), options));
            slope += i32::from(fit.coefficient_interval.contains(TRUE_THRESHOLD.k));
            threshold += i32::from(fit.critical_shear_interval.contains(TRUE_THRESHOLD.c));
            mean += fit.coefficient / TRUE_THRESHOLD.k / 200.0;
        }
        (f64::from(slope) / 200.0, f64::from(threshold) / 200.0, mean)
    }

    #[test]
    fn intervals_hold_the_truth_with_counting_noise() {
        let (slope, threshold, mean) = coverage(0.0);
        assert!(slope >= 0.90 && threshold >= 0.90, "{slope} {threshold}");
        assert_relative_eq!(mean, 1.0, max_relative = 0.01);
    }

    #[test]
    fn intervals_hold_the_truth_when_runs_scatter() {
        let (slope, threshold, mean) = coverage(0.1);
        assert!(slope >= 0.90 && threshold >= 0.90, "{slope} {threshold}");
        assert_relative_eq!(mean, 1.0, max_relative = 0.03);
    }

    #[test]
    fn the_same_points_give_the_same_bits_in_any_order() {
        let mut draws = Draws::new(5);
        let points = study(&mut draws, 0.1);
        let options = FitOptions {
            replicates: 100,
            seed: 9,
        };
        let mut turned = points.clone();
        turned.reverse();
        assert_eq!(fit_law(&points, options), fit_law(&turned, options));
    }

    #[test]
    fn no_erosion_at_the_highest_load_is_a_lower_bound() {
        let mut points: Vec<RatePoint> =
            (1..=5_u32).map(|i| exact(0, 1e-4 * f64::from(i))).collect();
        let law = fit_law(&points, FitOptions::default());
        assert_eq!(law, Some(FittedErosionLaw::LowerBound { at_least: 5e-4 }));
        // Grains that leave at a lower stress do not make a law.
        points.push(RatePoint {
            run: 1,
            eroding: true,
            rate: 0.01,
            ..exact(1, 2.5e-4)
        });
        let law = fit_law(&points, FitOptions::default());
        assert_eq!(law, Some(FittedErosionLaw::LowerBound { at_least: 5e-4 }));
        assert_eq!(fit_law(&[], FitOptions::default()), None);
    }

    /// Checks that one lost grain is neither erosion nor its absence, and that a bound is a positive stress.
    #[test]
    fn a_run_that_loses_one_grain_gives_no_bound() {
        let law = |points: &[RatePoint]| fit_law(points, FitOptions::default());
        let one_grain = |shear: f64| RatePoint {
            undecided: true,
            ..exact(1, shear)
        };
        for shear in [-1.77e-4, 3e-4] {
            let found = law(&[one_grain(shear)]);
            assert_eq!(found, Some(FittedErosionLaw::Undetermined));
        }
        let found = law(&[exact(0, -1.77e-4)]);
        assert_eq!(found, Some(FittedErosionLaw::Undetermined));
        // A run below it without a lost grain still gives its bound.
        let found = law(&[exact(0, 2e-4), one_grain(3e-4)]);
        assert_eq!(found, Some(FittedErosionLaw::LowerBound { at_least: 2e-4 }));
        let eroding = RatePoint {
            eroding: true,
            rate: 0.01,
            ..exact(2, 5e-4)
        };
        let found = law(&[exact(0, 2e-4), one_grain(3e-4), eroding]);
        let (above, below) = (2e-4, 5e-4);
        assert_eq!(found, Some(FittedErosionLaw::Bracketed { above, below }));
    }

    #[test]
    fn erosion_at_one_stress_brackets_the_threshold() {
        let points = [exact(0, 3e-4), exact(1, 6e-4), exact(2, 2e-3)];
        assert_eq!(
            fit_law(&points, FitOptions::default()),
            Some(FittedErosionLaw::Bracketed {
                above: 6e-4,
                below: 2e-3
            })
        );
    }

    #[test]
    fn a_stress_that_is_not_a_number_is_left_out() {
        let mut points: Vec<RatePoint> = [4e-4, 8e-4, 3e-3, 8e-3]
            .iter()
            .enumerate()
            .map(|(i, &t)| exact(i, t))
            .collect();
        points.push(RatePoint {
            shear: f64::NAN,
            ..exact(9, 1.0)
        });
        assert_eq!(fitted(fit_law(&points, FitOptions::default())).points, 4);
    }

    fn law(threshold: f64, k: f64) -> FittedErosionLaw {
        let points: Vec<RatePoint> = (0..6_u32)
            .map(|i| {
                let shear = 1e-3 * f64::from(i + 1);
                let rate = Threshold { k, c: threshold }.rate(shear);
                RatePoint {
                    rate,
                    eroding: rate > 0.0,
                    ..exact(0, shear)
                }
            })
            .collect();
        FittedErosionLaw::Fitted(fitted(fit_law(&points, FitOptions::default())))
    }

    #[test]
    fn a_series_with_steady_slope_has_no_trend_and_a_rising_threshold() {
        let series = [
            (2.53, law(3e-3, 9.3)),
            (0.152, law(5e-4, 9.0)),
            (0.506, law(9e-4, 9.2)),
            (1.27, law(2e-3, 8.9)),
            (12.7, FittedErosionLaw::LowerBound { at_least: 1.0 }),
        ];
        let trend = cohesion_trend(&series).unwrap();
        assert!(!trend.coefficient_has_trend, "{trend:?}");
        assert!(trend.critical_shear_increases);
        assert!(trend.coefficient_variation < 0.05);
    }

    #[test]
    fn a_slope_that_grows_with_cohesion_is_a_trend_and_a_falling_threshold_a_reversal() {
        let series: Vec<(f64, FittedErosionLaw)> = [0.1_f64, 0.3, 1.0, 3.0]
            .iter()
            .map(|&c| (c, law(3e-3 - 8e-4 * c, 9.0 * c.powf(0.5))))
            .collect();
        let trend = cohesion_trend(&series).unwrap();
        assert!(trend.coefficient_has_trend);
        assert_relative_eq!(
            trend.coefficient_exponent.unwrap(),
            0.5,
            max_relative = 1e-6
        );
        assert!(trend.reversals > 0 && !trend.critical_shear_increases);
        assert_eq!(cohesion_trend(&series[..1]), None);
    }
}
