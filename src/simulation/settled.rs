//! Steadiness of the forces, fluxes and pressures of the probes at the end of a run.
//!
//! The means over the last tenth of the run and over the tenth before it are compared, and the oscillation in the last
//! tenth is measured. If a probe has fewer than [`MIN_SAMPLES`] samples in each tenth, fifths and then thirds of the
//! run are compared; if even these have too few samples, the result is unknown. The samples are read from the files of
//! the probes, which contain them exactly, for any number of ranks and across restarts.

use base::number::real;
use base::units::LatticeUnits;
use io::table::{self, Rows};
use plan::Plan;
use plan::scene::flow::BodyForce;
use plan::scene::observe::ProbeAt;
use serde::Serialize;
use std::path::Path;

/// Relative drift or amplitude above which a value is reported at the end of a run.
const SETTLED: f64 = 0.01;
/// Parts of the run that are compared, and their names.
const WINDOWS: [(f64, &str); 3] = [(0.1, "tenth"), (0.2, "fifth"), (1.0 / 3.0, "third")];
/// Minimum number of samples in a window.
const MIN_SAMPLES: usize = 2;
/// Minimum magnitude by which a change is divided, as a fraction of the largest value of its kind: a value much smaller
/// than the others need not settle.
const MIN_MAGNITUDE: f64 = 1e-3;
/// Magnitude in lattice units below which a value is rounding.
const ROUNDING: f64 = 1e-9;
/// Maximum number of values reported at the end of a run.
const NAMED: usize = 5;

/// Quantity of a probe over the last part of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Settled {
    /// Name of the probe.
    pub(super) probe: String,
    /// Name of the quantity.
    pub(super) quantity: &'static str,
    /// Unit of the quantity.
    pub(super) unit: String,
    /// Fraction of the run over which the means are taken: a tenth, or more for a probe with few samples.
    pub(super) window: f64,
    /// Mean over the last part of the run, for each component of a vector.
    pub(super) value: Vec<f64>,
    /// Difference of the means over the last part and the part before it, divided by the value.
    pub(super) drift: f64,
    /// Half the range in the last part, divided by the value.
    pub(super) swing: f64,
    /// Period of an oscillation \[s\], if the last two parts of the run contain one.
    pub(super) period: Option<f64>,
}

/// Steadiness of the probes at the end of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct End {
    pub(super) values: Vec<Settled>,
    /// Probes with too few samples for a judgement.
    pub(super) unknown: Vec<String>,
}

/// Quantity of a probe.
#[derive(Clone, Copy)]
struct Quantity {
    name: &'static str,
    columns: &'static [&'static str],
    /// Size of one lattice unit.
    unit: f64,
}

/// Quantity of a probe with its statistics.
struct Observed {
    probe: String,
    quantity: Quantity,
    statistics: EndStatistics,
}

/// Returns the quantities of a probe that should become steady.
fn quantities(at: &ProbeAt, units: &LatticeUnits) -> Vec<Quantity> {
    let (force, pressure) = (units.force_to_si(1.0), units.pressure_scale());
    let depth = if units.dimension == 2 {
        1.0
    } else {
        units.spacing
    };
    let discharge = units.velocity_scale() * units.spacing * depth;
    let one = |name, columns, unit| Quantity {
        name,
        columns,
        unit,
    };
    match at {
        ProbeAt::Point(_) => vec![one("pressure", &["pressure"], pressure)],
        ProbeAt::Line { .. } | ProbeAt::Gauge(_) => Vec::new(),
        ProbeAt::Plane { .. } => vec![
            one("discharge", &["discharge"], discharge),
            one("mean_pressure", &["mean_pressure"], pressure),
        ],
        // Seepage is in equilibrium at every step.
        ProbeAt::Section { .. }
        | ProbeAt::WaterTable(_)
        | ProbeAt::WaterBalance
        | ProbeAt::Uplift { .. }
        | ProbeAt::Crossing { .. }
        | ProbeAt::Heave(_) => Vec::new(),
        // The quantities are scaled by lattice units, which joints do not have.
        ProbeAt::Joint(_) | ProbeAt::Mouth(_) | ProbeAt::Block(_) => Vec::new(),
        // Grains fluctuate; means over the window of their probes are in the summary.
        ProbeAt::Bed(_) | ProbeAt::Grains { .. } | ProbeAt::WallLoad { .. } => Vec::new(),
        ProbeAt::Body(_) | ProbeAt::Structure { .. } => vec![one(
            "fluid_force",
            &["fluid_force_x", "fluid_force_y", "fluid_force_z"],
            force,
        )],
        ProbeAt::Wall(_) => vec![
            one("force", &["force_x", "force_y", "force_z"], force),
            one("mass_flux", &["mass_flux"], units.density * discharge),
        ],
    }
}

/// Returns the steadiness of all probes of a run that has reached `time`, from its folder; empty without a lattice.
pub(super) fn read(plan: &Plan, folder: &Path, time: f64) -> End {
    let Some(units) = &plan.units else {
        return End::default();
    };
    let (mut all, mut unknown) = (Vec::new(), Vec::new());
    for probe in &plan.scene.probes {
        let quantities = quantities(&probe.at, units);
        if quantities.is_empty() {
            continue;
        }
        let path = folder.join(format!("probe_{}.csv", probe.name));
        match table::read(&path) {
            Ok(rows) => {
                let known = all.len();
                let seen = quantities.iter().filter_map(|quantity| {
                    let seen = last_windows(&rows, quantity, time)?;
                    Some(Observed {
                        probe: probe.name.clone(),
                        quantity: *quantity,
                        statistics: seen,
                    })
                });
                all.extend(seen);
                if all.len() == known {
                    unknown.push(probe.name.clone());
                }
            }
            Err(error) => log::warn!("it is not known whether its values are steady: {error}"),
        }
    }
    End {
        values: normalise(all),
        unknown,
    }
}

/// Mean and drift of a quantity at the end of a run.
struct EndStatistics {
    unit: String,
    window: f64,
    /// Mean of each component over the last window.
    value: Vec<f64>,
    /// Difference from the mean over the window before the last one.
    drift: f64,
    swing: f64,
    period: Option<f64>,
}

fn size(vector: impl Iterator<Item = f64>) -> f64 {
    vector.map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns the shortest last two windows of a quantity before `end` that have enough samples; none if no windows have
/// enough.
fn last_windows(rows: &Rows, quantity: &Quantity, end: f64) -> Option<EndStatistics> {
    let mut windows = WINDOWS.iter();
    windows.find_map(|(window, _)| window_statistics(rows, quantity, end, *window))
}

fn window_statistics(
    rows: &Rows,
    quantity: &Quantity,
    end: f64,
    window: f64,
) -> Option<EndStatistics> {
    let times = rows.column("time")?;
    let mut seen = EndStatistics {
        unit: String::new(),
        window,
        value: Vec::new(),
        drift: 0.0,
        swing: 0.0,
        period: None,
    };
    let mut drifts = Vec::new();
    for name in quantity.columns {
        let column = rows.column(name)?;
        let between = |from: f64, to: f64| -> Vec<(f64, f64)> {
            let within = times.iter().zip(&column);
            within
                .filter(|(t, x)| **t > from * end && **t <= to * end && x.is_finite())
                .map(|(t, x)| (*t, *x))
                .collect()
        };
        let before = between(1.0 - 2.0 * window, 1.0 - window);
        let last = between(1.0 - window, 1.0 + 1e-9);
        if before.len() < MIN_SAMPLES || last.len() < MIN_SAMPLES {
            return None;
        }
        let mean = |list: &[(f64, f64)]| list.iter().map(|s| s.1).sum::<f64>() / real(list.len());
        let (low, high) = last
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, x)| {
                (low.min(*x), high.max(*x))
            });
        let swing = 0.5 * (high - low);
        if swing > seen.swing {
            seen.swing = swing;
            let both: Vec<(f64, f64)> = before.iter().chain(&last).copied().collect();
            seen.period = period(&both, mean(&both));
        }
        seen.value.push(mean(&last));
        drifts.push(mean(&last) - mean(&before));
    }
    seen.drift = size(drifts.into_iter());
    let at = rows.columns.iter().position(|c| c == quantity.columns[0]);
    seen.unit = at
        .and_then(|n| rows.units.get(n).cloned())
        .unwrap_or_default();
    Some(seen)
}

/// Returns the time between every second crossing of the mean, if there are at least three crossings.
fn period(samples: &[(f64, f64)], mean: f64) -> Option<f64> {
    let pairs = samples.windows(2);
    let mut passed = pairs.filter(|pair| (pair[0].1 < mean) != (pair[1].1 < mean));
    let first = passed.next()?[0].0;
    let (mut count, mut last) = (0_u32, first);
    for pair in passed {
        count += 1;
        last = pair[0].0;
    }
    (count >= 2).then(|| 2.0 * (last - first) / f64::from(count))
}

/// Divides drifts and amplitudes by the magnitudes of the values.
fn normalise(all: Vec<Observed>) -> Vec<Settled> {
    let kind = |columns: &[&str]| {
        (
            columns[0].contains("force"),
            columns[0].contains("pressure"),
        )
    };
    let sizes: Vec<_> = (all.iter())
        .map(|one| {
            let value = one.statistics.value.iter().copied();
            (kind(one.quantity.columns), size(value))
        })
        .collect();
    let judged = all.into_iter().enumerate();
    let judged = judged.map(|(n, one)| {
        let seen = one.statistics;
        let alike = sizes.iter().filter(|(kind, _)| *kind == sizes[n].0);
        let largest = alike.map(|(_, size)| *size).fold(0.0, f64::max);
        let scale = (sizes[n].1)
            .max(MIN_MAGNITUDE * largest)
            .max(ROUNDING * one.quantity.unit);
        Settled {
            probe: one.probe,
            quantity: one.quantity.name,
            unit: seen.unit,
            window: seen.window,
            value: seen.value,
            drift: seen.drift / scale,
            swing: seen.swing / scale,
            period: seen.period,
        }
    });
    judged.collect()
}

/// Returns sentences about quantities that are not steady or not known to be steady; none if the drive itself
/// oscillates.
pub(super) fn lines(plan: &Plan, end: &End) -> Vec<String> {
    let force = plan.scene.flow.as_ref().map(|flow| &flow.body_force);
    if matches!(force, Some(BodyForce::Oscillating { .. })) {
        return Vec::new();
    }
    let mut moving: Vec<&Settled> = end
        .values
        .iter()
        .filter(|one| one.drift > SETTLED || one.swing > SETTLED)
        .collect();
    moving.sort_by(|a, b| b.drift.max(b.swing).total_cmp(&a.drift.max(a.swing)));
    let mut lines: Vec<String> = moving.iter().take(NAMED).map(|one| line(one)).collect();
    if moving.len() > NAMED {
        lines.push(format!(
            "{} more values have not settled to {} %: `settled` in summary.json",
            moving.len() - NAMED,
            100.0 * SETTLED
        ));
    }
    if !end.unknown.is_empty() {
        let names: Vec<String> = (end.unknown.iter().take(NAMED))
            .map(|name| format!("`{name}`"))
            .collect();
        lines.push(format!(
            "it is not known whether these values are steady: {}{}, with fewer than {MIN_SAMPLES} samples in each of \
             the last two thirds of the run; use a shorter `every`",
            names.join(", "),
            if end.unknown.len() > NAMED { " and others" } else { "" }
        ));
    }
    lines
}

fn line(one: &Settled) -> String {
    let Settled {
        probe,
        quantity,
        unit,
        window,
        value,
        drift,
        swing,
        period,
    } = one;
    let part = WINDOWS
        .iter()
        .find(|(part, _)| part >= window)
        .map_or("part", |(_, name)| name);
    let what = format!(
        "{} of probe `{probe}` ({:.3e} {unit} over the last {part} of the run)",
        quantity.replace('_', " "),
        if let [value] = value[..] {
            value
        } else {
            size(value.iter().copied())
        }
    );
    let round = period.map_or_else(String::new, |period| {
        format!(" with a period of {period:.2e} s")
    });
    if *drift > SETTLED {
        format!(
            "not settled: {what} differs by {:.1} % from the {part} before, and swings by {:.1} %{round}",
            100.0 * drift,
            100.0 * swing
        )
    } else {
        format!("oscillates: {what} swings by {:.1} %{round}", 100.0 * swing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const FORCE: Quantity = Quantity {
        name: "fluid_force",
        columns: &["x", "y"],
        unit: 1.0,
    };

    fn observed(quantity: Quantity, statistics: EndStatistics) -> Observed {
        Observed {
            probe: "p".into(),
            quantity,
            statistics,
        }
    }

    fn rows(of: impl Fn(f64) -> [f64; 2]) -> Rows {
        let names = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect();
        let values = (0_u32..=1000).map(|n| {
            let t = f64::from(n) * 0.01;
            let [x, y] = of(t);
            vec![t, x, y]
        });
        Rows {
            columns: names(&["step", "time", "x", "y"]),
            units: names(&["-", "s", "N", "N"]),
            steps: (0..=1000).collect(),
            values: values.collect(),
        }
    }

    fn settled(of: impl Fn(f64) -> [f64; 2]) -> Settled {
        let seen = last_windows(&rows(of), &FORCE, 10.0).unwrap();
        normalise(vec![observed(FORCE, seen)]).remove(0)
    }

    /// Checks an exponential decay exp(-t/T), for which the means of two windows W differ by the factor exp(-W/T).
    #[test]
    fn the_drift_of_a_decay_is_what_is_left_of_it() {
        let one = settled(|t| [3.0 + 40.0 * (-t / 2.0).exp(), 4.0]);
        let mean = |a: f64, b: f64| 40.0 * 2.0 * ((-a / 2.0).exp() - (-b / 2.0).exp());
        let (before, last) = (mean(8.0, 9.0), mean(9.0, 10.0));
        let size = f64::hypot(3.0 + last, 4.0);
        approx::assert_relative_eq!(one.drift, (before - last) / size, max_relative = 0.01);
        assert_eq!((one.unit.as_str(), one.period), ("N", None));
        let still = settled(|_| [3.0, 4.0]);
        assert!(still.drift < 1e-14 && still.swing < 1e-14);
    }

    #[test]
    fn the_swing_and_the_period_of_an_oscillation() {
        let one = settled(|t| [5.0, 0.5 * (TAU * t / 0.25).sin()]);
        approx::assert_relative_eq!(one.swing, 0.1, max_relative = 0.01);
        approx::assert_relative_eq!(one.period.unwrap(), 0.25, max_relative = 0.02);
        assert!(one.drift < 1e-3, "{one:?}");
        assert!(line(&one).contains("swings by 10.0 %"), "{}", line(&one));
    }

    /// Checks that an oscillation is found with ten samples and with six, and that two samples give no result.
    #[test]
    fn few_samples_are_judged_over_longer_parts() {
        for (every, window) in [(10, 0.1), (100, 0.2), (160, 1.0 / 3.0)] {
            let mut few = rows(|t| [5.0 + t.cos(), 0.0]);
            few.values = few.values.into_iter().step_by(every).collect();
            few.steps = few.steps.into_iter().step_by(every).collect();
            let seen = last_windows(&few, &FORCE, 10.0).unwrap();
            approx::assert_relative_eq!(seen.window, window);
            let one = normalise(vec![observed(FORCE, seen)]).remove(0);
            assert!(one.swing.max(one.drift) > SETTLED, "{every}: {one:?}");
        }
        let mut two = rows(|_| [5.0, 0.0]);
        two.values = two.values.into_iter().step_by(999).collect();
        assert!(last_windows(&two, &FORCE, 10.0).is_none());
    }

    /// Leaves out probes with few samples, and values that are small compared with a larger one.
    #[test]
    fn what_has_nothing_to_settle() {
        assert!(last_windows(&rows(|_| [1.0, 0.0]), &FORCE, 1e-3).is_none());
        let small = last_windows(&rows(|t| [1e-9 * t, 0.0]), &FORCE, 10.0).unwrap();
        let large = last_windows(&rows(|_| [1.0, 0.0]), &FORCE, 10.0).unwrap();
        let all = vec![observed(FORCE, small), observed(FORCE, large)];
        assert!(normalise(all).iter().all(|one| one.drift < 1e-4));
    }
}
