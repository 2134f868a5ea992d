//! Time means of the probes for which the case states a window: beds and grains.
//!
//! The samples are read from the files of the probes, which contain them exactly, for any number of ranks and
//! across restarts.

use base::number::real;
use io::table::{self, Rows};
use plan::Plan;
use plan::scene::observe::ProbeAt;
use serde::Serialize;
use std::path::Path;

/// Means of the columns of a probe.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Means {
    /// Name of the probe.
    pub(super) probe: String,
    /// Time of the first sample \[s\].
    pub(super) from: f64,
    /// Time of the last sample \[s\].
    pub(super) to: f64,
    /// Number of samples in this interval.
    pub(super) samples: usize,
    /// Means of the columns.
    pub(super) values: Vec<Mean>,
    /// Reasons why the values may not be valid as means.
    pub(super) doubts: Vec<String>,
}

/// Mean of a column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Mean {
    /// Name of the column.
    pub(super) quantity: String,
    /// Unit of the column.
    pub(super) unit: String,
    /// Mean over the samples that have a value; none if no sample has one.
    pub(super) mean: Option<f64>,
    /// Value of the last sample.
    pub(super) last: Option<f64>,
}

/// Returns the means of all probes with a window, from the folder of a run.
pub(super) fn read(plan: &Plan, folder: &Path) -> Vec<Means> {
    let mut all = Vec::new();
    for probe in &plan.scene.probes {
        let from = match &probe.at {
            ProbeAt::Bed(bed) => bed.mean_from,
            ProbeAt::Grains { mean_from, .. } => *mean_from,
            _ => continue,
        };
        let path = folder.join(format!("probe_{}.csv", probe.name));
        match table::read(&path) {
            // A sample may be half a step away from its nominal time.
            Ok(rows) => {
                let mut means = means_from(&probe.name, &rows, from - 0.5 * plan.clock.time_step);
                if let (Some(means), ProbeAt::Bed(_)) = (&mut means, &probe.at) {
                    let obstacles =
                        !plan.scene.structures.is_empty() || !plan.scene.bodies.is_empty();
                    means.doubts = doubts(&means.values, obstacles);
                }
                all.extend(means);
            }
            Err(error) => log::warn!("its means could not be computed: {error}"),
        }
    }
    all
}

/// Returns the means of the rows from a time on; none if there are no such rows.
fn means_from(probe: &str, rows: &Rows, from: f64) -> Option<Means> {
    let times = rows.column("time")?;
    let first = times.iter().position(|&time| time >= from)?;
    let quantities = rows.columns.iter().zip(&rows.units);
    let values = quantities.filter(|(name, _)| !["step", "time"].contains(&name.as_str()));
    let values = values.filter_map(|(name, unit)| {
        let column = rows.column(name)?;
        let known: Vec<f64> = column[first..]
            .iter()
            .copied()
            .filter(|x| x.is_finite())
            .collect();
        Some(Mean {
            quantity: name.clone(),
            unit: unit.clone(),
            mean: (!known.is_empty()).then(|| known.iter().sum::<f64>() / real(known.len())),
            last: column.last().copied().filter(|x| x.is_finite()),
        })
    });
    Some(Means {
        probe: probe.to_owned(),
        from: times[first],
        to: *times.last()?,
        samples: times.len() - first,
        values: values.collect(),
        doubts: Vec::new(),
    })
}

/// Relative difference of the two shear stresses of a bed above which the stream over it is not considered steady.
const STEADY_DIFFERENCE: f64 = 0.2;

/// Returns the reasons why the computed shear stresses of a bed may differ from the stress on the bed.
fn doubts(values: &[Mean], obstacles: bool) -> Vec<String> {
    let mean = |name: &str| values.iter().find(|v| v.quantity == name)?.mean;
    let (balance, profile) = (mean("shear_stress_balance"), mean("shear_stress_profile"));
    let mut doubts = Vec::new();
    if obstacles {
        doubts.push(
            "the balance of forces and the Shields number include the forces on structures and bodies in the \
             stream".to_owned(),
        );
    }
    match (balance, profile) {
        (Some(balance), Some(profile)) => {
            let apart = (balance - profile).abs() / balance.abs().max(profile.abs());
            if apart > STEADY_DIFFERENCE {
                doubts.push(format!(
                    "the two shear stresses differ by {:.0} %: the stream is not steady, or other solids than \
                     the bed resist it",
                    100.0 * apart
                ));
            }
        }
        (Some(_), None) => doubts.push(
            "the velocity profile gives no shear stress, because solids or side walls extend through the whole \
             stream"
                .to_owned(),
        ),
        _ => {}
    }
    doubts
}

/// Returns a table of the means as lines.
pub(super) fn lines(all: &[Means]) -> Vec<String> {
    let mut lines = Vec::new();
    for one in all {
        lines.push(format!(
            "probe `{}`, {} samples from {:.4} s to {:.4} s:",
            one.probe, one.samples, one.from, one.to
        ));
        lines.push(format!("{:<24} {:>12} {:>12}", "", "mean", "last"));
        for value in &one.values {
            let number = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.4e}"));
            lines.push(format!(
                "{:<24} {:>12} {:>12} {}",
                value.quantity.replace('_', " "),
                number(value.mean),
                number(value.last),
                if value.unit == "-" { "" } else { &value.unit }
            ));
        }
        let doubts = one.doubts.iter();
        lines.extend(doubts.map(|doubt| format!("note on `{}`: {doubt}", one.probe)));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stresses_that_differ_are_doubted() {
        let value = |name: &str, mean| Mean {
            quantity: name.to_owned(),
            unit: "Pa".to_owned(),
            mean,
            last: mean,
        };
        let of = |balance, profile, obstacles| {
            let values = [
                value("shear_stress_balance", balance),
                value("shear_stress_profile", profile),
            ];
            doubts(&values, obstacles).join("; ")
        };
        assert_eq!(of(Some(0.43), Some(0.46), false), "");
        assert!(of(Some(15.8), Some(4.18), false).contains("differ by 74 %"));
        assert!(of(Some(15.8), None, false).contains("the velocity profile gives no shear stress"));
        assert!(of(Some(0.43), Some(0.46), true).contains("structures and bodies"));
    }

    #[test]
    fn the_mean_leaves_out_what_comes_before_and_what_is_not_known() {
        let names = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect();
        let rows = Rows {
            columns: names(&["step", "time", "height", "shear"]),
            units: names(&["-", "s", "m", "Pa"]),
            steps: vec![0, 1, 2, 3],
            values: vec![
                vec![0.0, 9.0, 5.0],
                vec![0.5, 1.0, f64::NAN],
                vec![1.0, 2.0, 4.0],
                vec![1.5, 3.0, f64::NAN],
            ],
        };
        let means = means_from("bed", &rows, 0.5).unwrap();
        assert_eq!((means.from, means.to, means.samples), (0.5, 1.5, 3));
        let value = |n: usize| (means.values[n].mean, means.values[n].last);
        assert_eq!(value(0), (Some(2.0), Some(3.0)));
        assert_eq!(value(1), (Some(4.0), None));
        assert!(means_from("bed", &rows, 2.0).is_none());
        let lines = lines(&[means]).join("\n");
        assert!(
            lines.contains("height") && lines.contains("2.0000e0"),
            "{lines}"
        );
    }
}
