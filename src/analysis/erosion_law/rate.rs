//! Erosion rate per area of the hole, with its standard error.
//!
//! `rate = (dM_e/dt) / (2 L)`: the mass that leaves per time, over the two faces of a hole of length L.
//!
//! **Estimate.** M_e(t) is a staircase with one step per grain. The steps are independent events, so that the mass that
//! left in a window, divided by its length, is the least-variance estimate of a constant rate. A line through M_e(t) is
//! a worse estimate: its residuals are a random walk, and its textbook error is far too small. The variance is that of
//! a compound Poisson process, `sum m_i^2 / T^2 = rate * J / A` with the mean jump `J = sum m_i^2 / sum m_i` and
//! `A = 2 L T`. Grains that leave in clusters increase the variance. If the variance of the means of eight equal
//! batches of the window is larger, it is used instead. The median slope of Theil and Sen is reported as a check
//! against outliers.
//!
//! **Windows.** The span begins at the end of the pressure ramp, or with the first grain that leaves if that is later,
//! because the grain first has to reach the outlet. It ends when 60 % of the mass is eroded, or with the run. The span
//! is cut into at most four equal parts with at least twenty grains each. The hole widens, so that one run gives the
//! rate at several stresses. Stress, width and length of a window are means over its records.
//!
//! **Whole run** ([`run_point`]): one hole erosion test, with mean rate and mean stress between 2 % and 60 % of eroded
//! mass. This gives one point per run, as in figure 5 of the paper. Both means are over the same span, because the
//! initial stress with the rate of the widened hole would overestimate k_d. With fewer than twenty grains in this span,
//! the point is that of all records from the end of the ramp on, with its error: one grain in a short span would give
//! any rate.
//!
//! A window counts as eroding if at least three grains left in it: loose grains next to the cut hole are not erosion.

use super::record::{ErosionRecord, RemovedGrain};
use base::number::real;

/// Settings for the windows of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowOptions {
    /// Maximum number of windows per run.
    pub windows: usize,
    /// Minimum number of grains in a window.
    pub grains: u64,
    /// Minimum number of grains that count as erosion.
    pub eroding_grains: u64,
    /// Eroded fraction at which the span of a whole run begins: the first loose grains are not erosion.
    pub first_fraction: f64,
    /// Eroded fraction at which the last window ends: beyond it the hole is no longer a pipe.
    pub last_fraction: f64,
    /// Number of batches for the variance of a process with clusters.
    pub batches: usize,
}

impl Default for WindowOptions {
    fn default() -> Self {
        Self {
            windows: 4,
            grains: 20,
            eroding_grains: 3,
            first_fraction: 0.02,
            last_fraction: 0.6,
            batches: 8,
        }
    }
}

/// Window of a run: shear stress, erosion rate and error of the rate.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RateWindow {
    /// Start, s.
    pub start: f64,
    /// End, s.
    pub end: f64,
    /// Number of grains that left.
    pub grains: u64,
    /// `true` if the window counts as eroding.
    pub eroding: bool,
    /// Mean hydraulic shear stress from the velocity gradient, Pa.
    pub shear: f64,
    /// Standard deviation of the stress over the window, Pa.
    pub shear_spread: f64,
    /// Mean stress from the balance of forces, Pa.
    pub shear_balance: f64,
    /// Mean stress from the traction, Pa.
    pub shear_traction: f64,
    /// Mean hole width, m.
    pub width: f64,
    /// Mean hole length, m.
    pub length: f64,
    /// Erosion rate, kg/(m^2 s).
    pub rate: f64,
    /// Standard error, kg/(m^2 s).
    pub rate_error: f64,
    /// Erosion rate of one mean grain in the window, kg/(m^2 s): the resolution of the measurement.
    pub quantum: f64,
    /// Rate from Theil and Sen's median slope of M_e(t), kg/(m^2 s).
    pub rate_median: f64,
}

/// Returns the mean jump of the eroded mass, `sum m^2 / sum m`, kg/m: from the removed grains if they are known,
/// otherwise the mean mass of a grain.
#[must_use]
pub fn mean_jump(removed: &[RemovedGrain], records: &[ErosionRecord]) -> Option<f64> {
    let mass: f64 = removed.iter().map(|grain| grain.mass).sum();
    if mass > 0.0 {
        return Some(
            removed
                .iter()
                .map(|grain| grain.mass * grain.mass)
                .sum::<f64>()
                / mass,
        );
    }
    let last = records
        .iter()
        .rev()
        .find(|record| record.eroded_grains > 0)?;
    Some(last.eroded_mass / real(last.eroded_grains))
}
/// Cuts a run into windows and measures each.
///
/// `records` in order of time; `jump` is the mean jump of the eroded mass, kg/m ([`mean_jump`], or the mean mass of a
/// grain if none has left); `ramp_end` the time from which the load is steady, s. Records without a shear stress (no
/// hole) have no weight. The result is empty if fewer than two records remain.
#[must_use]
pub fn erosion_windows(
    records: &[ErosionRecord],
    jump: f64,
    ramp_end: f64,
    options: WindowOptions,
) -> Vec<RateWindow> {
    let usable: Vec<&ErosionRecord> = records
        .iter()
        .filter(|record| record.time >= ramp_end && record.shear_gradient.is_finite())
        .collect();
    // The last record before the first grain leaves has no step yet. The span starts one record later, at the
    // record with the first grain, so that the grain that defines the start is not counted in the span.
    let first = usable
        .iter()
        .position(|record| record.eroded_grains > 0)
        .unwrap_or(0);
    let first = if first + 1 < usable.len() { first } else { 0 };
    let last = usable
        .iter()
        .position(|record| record.eroded_fraction >= options.last_fraction)
        .unwrap_or(usable.len().saturating_sub(1));
    if last <= first {
        return Vec::new();
    }
    let span = &usable[first..=last];
    let (start, end) = (span[0].time, span[span.len() - 1].time);
    let grains = span[span.len() - 1].eroded_grains - span[0].eroded_grains;
    let possible = usize::try_from(grains / options.grains.max(1)).unwrap_or(usize::MAX);
    let parts = possible
        .clamp(1, options.windows.max(1))
        .min(span.len() - 1);
    let edge = |part: usize| {
        let time = start + (end - start) * real(part) / real(parts);
        span.iter()
            .position(|record| record.time >= time - 1e-9 * (end - start))
            .unwrap_or(span.len() - 1)
    };
    (0..parts)
        .filter_map(|part| {
            let (from, to) = (edge(part), edge(part + 1));
            (to > from).then(|| measure(&span[from..=to], jump, options))
        })
        .collect()
}

/// Returns the whole run as one hole erosion test; arguments as for [`erosion_windows`]. `None` for fewer than two
/// records.
#[must_use]
pub fn run_point(
    records: &[ErosionRecord],
    jump: f64,
    ramp_end: f64,
    options: WindowOptions,
) -> Option<RateWindow> {
    let usable: Vec<&ErosionRecord> = records
        .iter()
        .filter(|record| record.time >= ramp_end)
        .collect();
    if usable.len() < 2 {
        return None;
    }
    let reaches = |fraction: f64| {
        usable
            .iter()
            .position(|record| record.eroded_fraction >= fraction)
    };
    let end = reaches(options.last_fraction).unwrap_or(usable.len() - 1);
    let end = end.max(1);
    let begun = reaches(options.first_fraction).filter(|&from| {
        from < end && usable[end].eroded_grains - usable[from].eroded_grains >= options.grains
    });
    Some(measure(&usable[begun.unwrap_or(0)..=end], jump, options))
}

/// Measures one window of at least two records.
fn measure(records: &[&ErosionRecord], jump: f64, options: WindowOptions) -> RateWindow {
    let (first, last) = (records[0], records[records.len() - 1]);
    let duration = last.time - first.time;
    let grains = last.eroded_grains - first.eroded_grains;
    let mean = |value: fn(&ErosionRecord) -> f64| time_mean(records, value);
    let shear = mean(|record| record.shear_gradient);
    let spread = time_mean(records, |record| (record.shear_gradient - shear).powi(2)).sqrt();
    let length = mean(|record| record.hole_length);
    let area = 2.0 * length * duration;
    let rate = (last.eroded_mass - first.eroded_mass) / area;
    let quantum = jump / area;
    let poisson = (rate.max(quantum) * quantum).sqrt();
    RateWindow {
        start: first.time,
        end: last.time,
        grains,
        eroding: grains >= options.eroding_grains,
        shear,
        shear_spread: spread,
        shear_balance: mean(|record| record.shear_balance),
        shear_traction: mean(|record| record.shear_traction),
        width: mean(|record| record.hole_width),
        length,
        rate,
        rate_error: poisson.max(batch_error(records, options.batches) / (2.0 * length)),
        quantum,
        rate_median: median_slope(records) / (2.0 * length),
    }
}

/// Returns the time mean by the trapezoidal rule, over the intervals with a value at both ends.
fn time_mean(records: &[&ErosionRecord], value: impl Fn(&ErosionRecord) -> f64) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for pair in records.windows(2) {
        let duration = pair[1].time - pair[0].time;
        let both = value(pair[0]) + value(pair[1]);
        if both.is_finite() {
            sum += 0.5 * both * duration;
            weight += duration;
        }
    }
    if weight > 0.0 { sum / weight } else { f64::NAN }
}

/// Returns the standard error of the mean mass rate from the means of equal batches, kg/(m s); 0 where batches are too
/// short.
///
/// The error is scaled by Student's t divided by the normal quantile, so that 1.96 times the error is an interval
/// of 95 % for few batches too.
fn batch_error(records: &[&ErosionRecord], batches: usize) -> f64 {
    let steps = records.len() - 1;
    if batches < 2 || steps < 2 * batches {
        return 0.0;
    }
    let rates: Vec<f64> = (0..batches)
        .map(|batch| {
            let from = records[batch * steps / batches];
            let to = records[(batch + 1) * steps / batches];
            (to.eroded_mass - from.eroded_mass) / (to.time - from.time)
        })
        .collect();
    let n = real(batches);
    let mean = rates.iter().sum::<f64>() / n;
    let variance = rates.iter().map(|rate| (rate - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (variance / n).sqrt() * crate::statistics::student(batches - 1) / 1.960
}

/// Returns Theil and Sen's slope of M_e(t), kg/(m s), over at most sixty-four records spread over the window.
fn median_slope(records: &[&ErosionRecord]) -> f64 {
    let points = records.len().min(64);
    let pick = |k: usize| records[k * (records.len() - 1) / (points - 1)];
    let mut slopes: Vec<f64> = (0..points)
        .flat_map(|a| (a + 1..points).map(move |b| (a, b)))
        .map(|(a, b)| {
            let (a, b) = (pick(a), pick(b));
            (b.eroded_mass - a.eroded_mass) / (b.time - a.time)
        })
        .filter(|slope| slope.is_finite())
        .collect();
    crate::statistics::median(&mut slopes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use base::random::Draws;

    const LENGTH: f64 = 1.2e-2;
    const GRAIN: f64 = 8e-5;

    pub(super) fn blank(step: u64, time: f64) -> ErosionRecord {
        ErosionRecord {
            step,
            time,
            eroded_mass: 0.0,
            eroded_fraction: 0.0,
            eroded_grains: 0,
            lower_face: 0.0,
            upper_face: 1e-3,
            hole_width: 1e-3,
            hole_length: LENGTH,
            shear_gradient: 0.01,
            shear_balance: 0.01,
            shear_traction: 0.01,
            pressure_difference: 0.5,
            discharge: 0.0,
            bonds_broken: 0,
            bonds_broken_inside: 0,
            bonds_broken_at_wall: 0,
            lattice_velocity: 0.0,
            mass_error: 0.0,
            face_share: f64::NAN,
            bulk_displacement: f64::NAN,
        }
    }

    /// Returns a run whose grains leave at random, `per_second` on average, in clusters of `cluster` grains.
    fn run(draws: &mut Draws, per_second: f64, cluster: u64, seconds: f64) -> Vec<ErosionRecord> {
        let mut next = draws.exponential(per_second / real(cluster));
        let (mut mass, mut grains) = (0.0, 0);
        (0..=400_u32)
            .map(|k| {
                let time = seconds * f64::from(k) / 400.0;
                while next <= time {
                    for _ in 0..cluster {
                        mass += GRAIN * (1.0 + 0.3 * (2.0 * draws.uniform() - 1.0));
                        grains += 1;
                    }
                    next += draws.exponential(per_second / real(cluster));
                }
                ErosionRecord {
                    eroded_mass: mass,
                    eroded_fraction: mass / 1.0,
                    eroded_grains: grains,
                    ..blank(u64::from(k), time)
                }
            })
            .collect()
    }

    /// Returns the fraction of intervals `rate ± 1.96 se` that contain the true rate, and the mean rate divided by
    /// the true one.
    fn coverage(cluster: u64) -> (f64, f64) {
        let mut draws = Draws::new(11 + cluster);
        let truth = 10.0 * GRAIN / (2.0 * LENGTH);
        let (mut inside, mut total, mut sum) = (0, 0, 0.0);
        let options = WindowOptions {
            windows: 1,
            ..WindowOptions::default()
        };
        for _ in 0..300 {
            let records = run(&mut draws, 10.0, cluster, 40.0);
            let jump = mean_jump(&[], &records).unwrap();
            for window in erosion_windows(&records, jump, 0.0, options) {
                total += 1;
                sum += window.rate / truth;
                if (window.rate - truth).abs() <= 1.96 * window.rate_error {
                    inside += 1;
                }
            }
        }
        (f64::from(inside) / f64::from(total), sum / f64::from(total))
    }

    #[test]
    fn the_error_of_a_random_staircase_covers_the_truth() {
        let (share, mean) = coverage(1);
        assert!(share >= 0.93, "{share}");
        assert_relative_eq!(mean, 1.0, max_relative = 0.01);
    }

    #[test]
    fn grains_that_leave_in_clusters_widen_the_error() {
        let (share, mean) = coverage(6);
        assert!(share >= 0.90, "{share}");
        assert_relative_eq!(mean, 1.0, max_relative = 0.02);
    }

    #[test]
    fn a_steady_run_gives_the_exact_rate_by_both_estimates() {
        let records: Vec<ErosionRecord> = (0..=100_u32)
            .map(|k| ErosionRecord {
                eroded_mass: GRAIN * f64::from(k),
                eroded_fraction: f64::from(k) / 1000.0,
                eroded_grains: u64::from(k),
                ..blank(u64::from(k), 0.1 * f64::from(k))
            })
            .collect();
        let windows = erosion_windows(&records, GRAIN, 0.0, WindowOptions::default());
        assert_eq!(windows.len(), 4);
        let exact = 10.0 * GRAIN / (2.0 * LENGTH);
        for window in &windows {
            assert_relative_eq!(window.rate, exact, max_relative = 1e-9);
            assert_relative_eq!(window.rate_median, exact, max_relative = 1e-9);
            assert_relative_eq!(window.shear, 0.01, max_relative = 1e-12);
            assert!(window.eroding && window.shear_spread < 1e-12);
        }
        assert_relative_eq!(windows[0].start, 0.1);
        assert_relative_eq!(windows[3].end, 10.0);
    }

    /// Checks that a run that reaches 2 % of eroded mass with its last grains gets the rate of all its records.
    #[test]
    fn few_grains_at_the_end_do_not_make_the_rate_of_a_run() {
        let mut records = run(&mut Draws::new(5), 2.0, 1, 10.0);
        // The sample is so large that 2 % is reached only with the last grain but one.
        let last = records.last().map_or(0, |record| record.eroded_grains);
        for record in &mut records {
            record.eroded_fraction = 0.02 * real(record.eroded_grains) / real(last - 1);
        }
        let options = WindowOptions::default();
        let jump = mean_jump(&[], &records).unwrap();
        let whole = run_point(&records, jump, 0.0, options).unwrap();
        let span = whole.end - whole.start;
        assert!(span > 9.0 && whole.grains >= last - 1, "{whole:?}");
        let mass = records.last().unwrap().eroded_mass - records[0].eroded_mass;
        let rate = mass / (2.0 * whole.length * span);
        assert!((whole.rate / rate - 1.0).abs() < 1e-12, "{whole:?} {rate}");
    }

    #[test]
    fn a_run_without_erosion_is_one_window_of_no_rate() {
        let records: Vec<ErosionRecord> = (0..50_u32)
            .map(|k| blank(u64::from(k), f64::from(k)))
            .collect();
        let windows = erosion_windows(&records, GRAIN, 5.0, WindowOptions::default());
        assert_eq!(windows.len(), 1);
        assert!(!windows[0].eroding);
        assert!(windows[0].rate.abs() < 1e-300);
        assert!(windows[0].rate_error > 0.0);
        assert_relative_eq!(windows[0].start, 5.0);
    }

    #[test]
    fn the_span_ends_at_the_last_fraction_and_skips_a_hole_that_is_gone() {
        let mut records: Vec<ErosionRecord> = (0..=100_u32)
            .map(|k| ErosionRecord {
                eroded_mass: GRAIN * f64::from(k),
                eroded_fraction: f64::from(k) / 100.0,
                eroded_grains: u64::from(k),
                ..blank(u64::from(k), f64::from(k))
            })
            .collect();
        for record in &mut records[70..] {
            record.shear_gradient = f64::NAN;
        }
        let windows = erosion_windows(&records, GRAIN, 0.0, WindowOptions::default());
        assert_relative_eq!(windows.last().unwrap().end, 60.0);
        assert!(erosion_windows(&records[..1], GRAIN, 0.0, WindowOptions::default()).is_empty());
        assert!(erosion_windows(&[], GRAIN, 0.0, WindowOptions::default()).is_empty());
    }

    #[test]
    fn the_jump_weighs_large_grains_more() {
        let grain = |mass: f64| RemovedGrain {
            step: 0,
            time: 0.0,
            id: 0,
            mass,
            radius: 0.0,
            x: 0.0,
            y: 0.0,
            z: 0.0,
        };
        assert_relative_eq!(mean_jump(&[grain(1.0), grain(3.0)], &[]).unwrap(), 2.5);
        assert_eq!(mean_jump(&[], &[]), None);
    }
}
