//! The answers of a run: numbers from its probes and its summary.
//!
//! | source | answers |
//! |---|---|
//! | probe at a point, in a plane, on a body or a face | each column: last value, mean over the second half |
//! | probe along a line | velocity and pressure at each point: last values, means over the second half of the run |
//! | `summary.json` | flow through the openings, seepage, kinetic energy, blocks, erosion, collapse, element test |
//!
//! An answer has settled if its means over the last two tenths of the run differ by less than 0.1 %.

use base::number::real;
use io::csv::Reader;
use plan::Plan;
use plan::scene::observe::ProbeAt;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Minimum number of samples in the second half of a run for their mean to be an answer.
const MIN_SAMPLES: usize = 4;
/// Entries of `summary.json` that describe the solution of the problem, and not the run.
const SUMMARY: &[&str] = &[
    "inflow",
    "outflow",
    "seepage",
    "backward_erosion",
    "kinetic_energy",
    "blocks",
    "erosion",
    "collapse",
    "element_test",
];
/// Entries of the summary without results: numbers that describe the solution method or that the case states, and
/// positions, whose size depends on the origin and which jump from cell to cell.
const NO_ANSWERS: &[&str] = &[
    "iterations",
    "residual",
    "closure",
    "largest_closure",
    "bernoulli_speed",
    "number",
    "fixed",
    "known",
    "difference",
    "position",
];
/// Columns of probes that do not depend on the solution.
const GIVEN: &[&str] = &[
    "step",
    "time",
    "distance",
    "fluid_force_time",
    "fluid_share",
];
/// Maximum number of values of a list in `summary.json` that are answers.
const LONGEST_LIST: usize = 20;

/// Numerical result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Unit; empty if the file states no unit.
    pub unit: String,
    /// Value of the result.
    pub value: f64,
    /// Scale with which differences are compared: the magnitude of the value, or of the vector of which it is a
    /// component.
    pub scale: f64,
    /// Change of the mean between the last two tenths of the run, divided by the larger of scale and mean; none if
    /// there are too few samples.
    pub drift: Option<f64>,
}

/// Answers of a run by name.
pub type Answers = BTreeMap<String, Answer>;

/// Reads the answers from the folder of a run.
///
/// # Errors
/// If a file or value cannot be read.
pub fn read(plan: &Plan, folder: &Path) -> Result<Answers, String> {
    let mut found = Answers::new();
    for probe in &plan.scene.probes {
        let file = format!("probe_{}.csv", probe.name);
        let text = io::plain::text(&folder.join(&file), io::plain::LONGEST_TABLE)
            .map_err(|e| e.to_string())?;
        let samples = Samples::read(&text).ok_or_else(|| format!("{file} is empty"))?;
        match probe.at {
            ProbeAt::Line { points, .. } => samples.line(&probe.name, points, &mut found),
            _ => samples.columns(&probe.name, &mut found),
        }
    }
    let text = io::plain::text(&folder.join("summary.json"), io::plain::LONGEST_CASE)
        .map_err(|e| e.to_string())?;
    let summary: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    for entry in SUMMARY {
        collect_numbers(entry, &summary[*entry], &mut found);
    }
    let flux = if plan.scene.grid.dimension == 2 {
        "m2/s"
    } else {
        "m3/s"
    };
    for name in ["inflow", "outflow", "seepage.inflow", "seepage.outflow"] {
        if let Some(answer) = found.get_mut(name) {
            flux.clone_into(&mut answer.unit);
        }
    }
    Ok(found)
}

/// Collects the numbers below an entry of the summary.
fn collect_numbers(path: &str, value: &Value, found: &mut Answers) {
    match value {
        Value::Number(number) => {
            if let Some(value) = number.as_f64().filter(|v| v.is_finite()) {
                found.insert(path.to_owned(), Answer::single(value));
            }
        }
        Value::Object(map) => {
            let children = map
                .iter()
                .filter(|(key, _)| !NO_ANSWERS.contains(&key.as_str()));
            for (key, child) in children {
                collect_numbers(&format!("{path}.{key}"), child, found);
            }
            share_scale(path, found);
        }
        Value::Array(list) if list.len() <= LONGEST_LIST => {
            for (n, child) in list.iter().enumerate() {
                collect_numbers(&format!("{path}[{n}]"), child, found);
            }
            // The openings of a seepage are not axes.
            if list.len() <= 3 && !path.ends_with("patch_inflows") {
                share_scale(path, found);
            }
        }
        _ => {}
    }
}

/// Sets the scale of the components of a vector below a path to the magnitude of the vector.
fn share_scale(path: &str, found: &mut Answers) {
    let ends = ["x", "y", "z"].map(|axis| format!("{path}.{axis}"));
    let places = (0..3).map(|n| format!("{path}[{n}]"));
    let names: Vec<String> = ends.into_iter().chain(places).collect();
    let squared: f64 = names
        .iter()
        .filter_map(|n| found.get(n))
        .map(|a| a.value.powi(2))
        .sum();
    for name in names {
        if let Some(answer) = found.get_mut(&name) {
            answer.scale = squared.sqrt();
        }
    }
}

impl Answer {
    fn single(value: f64) -> Self {
        Self {
            unit: String::new(),
            value,
            scale: value.abs(),
            drift: None,
        }
    }
}

/// Reduction of a time series, given by times and values, to a number; none if there are too few samples.
type OfSeries = fn(&[f64], &[f64]) -> Option<f64>;

/// Table of numbers as functions of time.
struct Samples {
    names: Vec<String>,
    units: Vec<String>,
    /// Values by column.
    columns: Vec<Vec<f64>>,
}

impl Samples {
    fn read(text: &str) -> Option<Self> {
        let mut reader = Reader::new(text)?;
        // A unit may follow a name: `time [s]`.
        let split = |name: &&str| -> (String, String) {
            let (name, unit) = name.split_once(' ').unwrap_or((name, ""));
            (name.to_owned(), unit.trim_matches(['[', ']']).to_owned())
        };
        let (names, mut units): (Vec<_>, Vec<_>) = reader.names().iter().map(split).unzip();
        let mut columns = vec![Vec::new(); names.len()];
        while let Some(row) = reader.row() {
            for (column, cell) in columns.iter_mut().zip(row.cells()) {
                column.push(cell.parse().unwrap_or(f64::NAN));
            }
        }
        for (unit, below) in units.iter_mut().zip(reader.units()) {
            if unit.is_empty() {
                below.clone_into(unit);
            }
        }
        Some(Self {
            names,
            units,
            columns,
        })
    }

    fn column(&self, name: &str) -> Option<&[f64]> {
        let at = self.names.iter().position(|known| known == name)?;
        Some(&self.columns[at])
    }

    /// Returns the indices of the columns that are answers.
    fn answers<'a>(&'a self, given: &'a [&str]) -> impl Iterator<Item = usize> + 'a {
        let known = |n: &usize| {
            let name = self.names[*n].as_str();
            !GIVEN.contains(&name) && !given.contains(&name)
        };
        (0..self.names.len()).filter(known)
    }

    /// Adds the last value and the mean of each column.
    fn columns(&self, probe: &str, found: &mut Answers) {
        let Some(times) = self.column("time") else {
            return;
        };
        for n in self.answers(&[]) {
            let values = &self.columns[n];
            let drift = |scale: f64| drift(times, values, scale);
            let mut add = |what: &str, of: &dyn Fn(&[f64]) -> Option<f64>| {
                let Some(value) = of(values).filter(|v| v.is_finite()) else {
                    return;
                };
                let siblings = self.siblings(n);
                let squares = siblings.filter_map(of).map(|v| v * v);
                let scale = squares.sum::<f64>().sqrt();
                let answer = Answer {
                    unit: self.units[n].clone(),
                    value,
                    scale,
                    drift: drift(scale),
                };
                found.insert(format!("{probe}: {}, {what}", self.names[n]), answer);
            };
            add("last", &|values| values.last().copied());
            add("mean", &|values| mean_of_second_half(times, values));
        }
    }

    /// Adds the last value and the mean of each point.
    fn line(&self, probe: &str, points: usize, found: &mut Answers) {
        let Some(times) = self.column("time") else {
            return;
        };
        if points == 0 || times.len() < points {
            return;
        }
        let series = |values: &[f64], point: usize| -> Vec<f64> {
            values.iter().skip(point).step_by(points).copied().collect()
        };
        let kinds: [(&str, OfSeries); 2] = [
            ("last", |_, values| values.last().copied()),
            ("mean", mean_of_second_half),
        ];
        for n in self.answers(&["x", "y", "z"]) {
            for (what, of) in kinds {
                let at = |values: &[f64], point: usize| {
                    of(&series(times, point), &series(values, point))
                };
                let length = |point: usize| {
                    let squares = self.siblings(n).filter_map(|column| at(column, point));
                    squares.map(|value| value * value).sum::<f64>()
                };
                let scale = (0..points).map(length).fold(0.0, f64::max).sqrt();
                for point in 0..points {
                    let Some(value) = at(&self.columns[n], point).filter(|v| v.is_finite()) else {
                        continue;
                    };
                    let answer = Answer {
                        unit: self.units[n].clone(),
                        value,
                        scale,
                        drift: drift(
                            &series(times, point),
                            &series(&self.columns[n], point),
                            scale,
                        ),
                    };
                    let name = &self.names[n];
                    found.insert(
                        format!("{probe}: {name}, {what}, point {}", point + 1),
                        answer,
                    );
                }
            }
        }
    }

    /// Returns the columns of the vector of which a column is a component; only the column itself if it is a scalar
    /// or a position.
    fn siblings(&self, n: usize) -> impl Iterator<Item = &[f64]> {
        let stem = |name: &str| {
            let (stem, axis) = name.rsplit_once('_')?;
            ["x", "y", "z"].contains(&axis).then(|| stem.to_owned())
        };
        let own = stem(&self.names[n]);
        let same = move |m: &usize| *m == n || (own.is_some() && stem(&self.names[*m]) == own);
        (0..self.names.len())
            .filter(same)
            .map(|m| self.columns[m].as_slice())
    }
}

/// Returns the mean of the samples after half of the time; none for too few samples.
fn mean_of_second_half(times: &[f64], values: &[f64]) -> Option<f64> {
    mean_between(times, values, 0.5, 1.0, MIN_SAMPLES)
}

/// Returns the mean of the samples between two fractions of the time, the earlier end excluded.
fn mean_between(times: &[f64], values: &[f64], from: f64, to: f64, least: usize) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    // A sample may deviate from its nominal time by half a step.
    let at = |part: f64| first + part * (last - first) + 1e-6 * (last - first);
    let inside = times
        .iter()
        .zip(values)
        .filter(|(t, _)| **t > at(from) && **t <= at(to));
    let (mut number, mut sum) = (0_usize, 0.0);
    for (_, value) in inside {
        number += 1;
        sum += value;
    }
    (number >= least.max(1)).then(|| sum / real(number))
}

/// Returns the change of the mean between the last two tenths of the time, divided by the larger of scale and mean.
fn drift(times: &[f64], values: &[f64], scale: f64) -> Option<f64> {
    let before = mean_between(times, values, 0.8, 0.9, 1)?;
    let last = mean_between(times, values, 0.9, 1.0, 1)?;
    let change = (last - before).abs();
    if change <= 0.0 {
        return Some(0.0);
    }
    Some(change / scale.max(last.abs())).filter(|d| d.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const BODY: &str = "step,time,fluid_force_x,fluid_force_y,fluid_force_z\n# 1,s,N,N,N\n";

    fn table(force: impl Fn(f64) -> f64) -> String {
        let mut text = BODY.to_owned();
        for n in 0..=20_u32 {
            let time = 0.05 * f64::from(n);
            text += &format!("{n},{time},{},3e-9,0\n", force(time));
        }
        text
    }

    fn parsed(text: &str) -> Answers {
        let mut found = Answers::new();
        Samples::read(text).unwrap().columns("force", &mut found);
        found
    }

    #[test]
    fn positions_and_times_of_samples_are_no_answers() {
        let mut found = Answers::new();
        let exits = json!({"exit_gradients": {"down": {"gradient": 0.4, "position": [6.1, 10.0]}}});
        collect_numbers("seepage", &exits, &mut found);
        let names: Vec<&String> = found.keys().collect();
        assert_eq!(names, ["seepage.exit_gradients.down.gradient"]);
        let text =
            "step,time,fluid_force_time,fluid_force_x\n# 1,s,s,N\n0,0,0,1\n1,1,0.9,1\n2,2,1.9,1\n";
        assert!(
            parsed(text)
                .keys()
                .all(|name| !name.contains("fluid_force_time"))
        );
    }

    #[test]
    fn last_mean_and_drift_of_a_probe() {
        let found = parsed(&table(|time| time));
        let last = &found["force: fluid_force_x, last"];
        assert_eq!((last.value, last.unit.as_str()), (1.0, "N"));
        // 0.95 and 1 after 0.85 and 0.9.
        approx::assert_relative_eq!(last.drift.unwrap(), 0.1, max_relative = 1e-9);
        let mean = &found["force: fluid_force_x, mean"];
        approx::assert_relative_eq!(mean.value, 0.775, max_relative = 1e-9);
        // A component is compared with the magnitude of its vector.
        assert_eq!(
            found["force: fluid_force_y, last"].scale,
            (1.0_f64 + 9e-18).sqrt()
        );
        let settled = parsed(&table(|_| 2.0));
        assert_eq!(settled["force: fluid_force_x, last"].drift, Some(0.0));
    }

    #[test]
    fn few_samples_have_no_mean_and_no_drift() {
        let found = parsed(&format!("{BODY}0,0,1,0,0\n9,1,2,0,0\n"));
        assert_eq!(found["force: fluid_force_x, last"].drift, None);
        assert!(!found.contains_key("force: fluid_force_x, mean"));
    }

    #[test]
    fn points_of_a_line_share_the_scale_of_the_largest() {
        let mut found = Answers::new();
        let text = "step,time,distance,x,velocity_x,velocity_y\n0,0,0,0,9,9\n0,0,1,1,9,9\n4,1,0,0,3,4\n4,1,1,1,0.1,0\n";
        Samples::read(text).unwrap().line("line", 2, &mut found);
        assert_eq!(found.len(), 4);
        let second = &found["line: velocity_x, last, point 2"];
        assert_eq!((second.value, second.scale), (0.1, 5.0));
    }

    #[test]
    fn numbers_of_the_summary_by_path() {
        let mut found = Answers::new();
        let summary = json!({"inflow": 2.0, "iterations": 4,
            "force_on_grains": [3.0, 0.0, 4.0], "patch_inflows": [5.0, -5.0], "mean": {"x": 6.0, "y": 8.0}});
        collect_numbers("seepage", &summary, &mut found);
        assert_eq!(found["seepage.inflow"].value, 2.0);
        assert_eq!(found["seepage.force_on_grains[1]"].scale, 5.0);
        assert_eq!(found["seepage.mean.x"].scale, 10.0);
        assert_eq!(found["seepage.patch_inflows[1]"].scale, 5.0);
        assert!(!found.contains_key("seepage.iterations"));
    }
}
