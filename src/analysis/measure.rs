//! A number from the files of a run: from a table (probes, records) or from `summary.json`.
//!
//! A formula of the columns selects the rows of a table, a second formula gives the value of each row, and a [`Take`]
//! reduces the values to one number. A profile is the values at the last time over a coordinate. Two profiles are
//! compared by a [`Norm`].

use super::expression::{ExpressionError, evaluate};
use base::number::real;
use io::csv::Reader;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A number from the files of a run: from the `summary`, or from the rows of a `file`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Measure {
    /// Path of a number in `summary.json`, for example `seepage.inflow`.
    pub summary: Option<String>,
    /// A table in the output folder, for example `probe_NAME.csv`.
    pub file: Option<String>,
    /// Formula of the columns of the file and of earlier numbers.
    pub of: Option<String>,
    /// Selection of rows: those for which this formula is above 0. Default: all rows.
    #[serde(rename = "where")]
    pub rows: Option<String>,
    /// Reduction of the rows to a number. Default: the last row.
    pub take: Take,
}

/// Quantity computed from the rows.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Take {
    /// Value of the last row.
    #[default]
    Last,
    /// Largest value.
    Max,
    /// Smallest value.
    Min,
    /// Mean of the values.
    Mean,
    /// Number of rows.
    Count,
    /// (2/n) sum of value times cos(2 pi time/period) over whole periods, with the period as a formula \[s\].
    Cosine(String),
    /// The sum of [`Self::Cosine`] with sin(2 pi time/period).
    Sine(String),
    /// Time between upward crossings of the mean, on average \[s\].
    Period,
    /// Largest difference from a formula of the columns, divided by the largest absolute value of that formula, over
    /// the rows of the last time.
    LargestError(String),
    /// Root mean square of the difference divided by that of the formula, over the rows of the last time.
    MeanError(String),
    /// Largest difference from a table, over the table's largest size; rows of the last time, interpolated by cubics.
    TableError {
        /// CSV in the folder of the case or study with two columns: coordinate and value.
        table: String,
        /// Formula of the coordinate in the columns of the run.
        at: String,
    },
}

/// Norm of the difference of two profiles, relative to the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Norm {
    /// Largest difference divided by the largest absolute value of the reference.
    #[default]
    Largest,
    /// Root mean square of the difference divided by that of the reference.
    Mean,
}

impl Norm {
    fn distance(self, values: &[f64], reference: &[f64]) -> f64 {
        let pairs = values.iter().zip(reference);
        match self {
            Self::Largest => {
                // Not max(): it would skip NaN.
                let errors = pairs.map(|(v, r)| (v - r).abs());
                let worst = errors.fold(0.0, |a: f64, b| if b.is_nan() || b > a { b } else { a });
                worst / reference.iter().fold(0.0, |a: f64, b| a.max(b.abs()))
            }
            Self::Mean => {
                let square = |x: f64| x * x;
                let error: f64 = pairs.map(|(v, r)| square(v - r)).sum();
                (error / reference.iter().copied().map(square).sum::<f64>()).sqrt()
            }
        }
    }
}

/// Reason why a number cannot be computed from the files of a run.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// File that cannot be read.
    #[error("{0}")]
    File(io::Error),
    /// Table without a line.
    #[error("{} is empty", .0.display())]
    Empty(PathBuf),
    /// Cell of a reference table that is not a number.
    #[error("{}: {text:?} is not a number", .table.display())]
    NotANumber {
        /// Path of the table.
        table: PathBuf,
        /// Text of the cell.
        text: String,
    },
    /// Text of `summary.json` that is not JSON.
    #[error("{0}")]
    Json(serde_json::Error),
    /// Path without a number in `summary.json`.
    #[error("summary.json has no number {0}")]
    NoNumber(String),
    /// Formula that cannot be evaluated.
    #[error(transparent)]
    Formula(#[from] ExpressionError),
    /// Measure without the formula of the values.
    #[error("the formula `of` of the columns is missing")]
    NoFormula,
    /// Measure without a formula and a file.
    #[error("the value has neither a formula nor a file")]
    NoSource,
    /// Table without a selected row.
    #[error("no row")]
    NoRow,
    /// Profile that cannot be interpolated.
    #[error("a profile needs at least four points in increasing order")]
    ShortProfile,
    /// Values without a period.
    #[error("the values cross their mean upwards fewer than two times")]
    NoPeriod,
}

/// Values as a function of a coordinate, in ascending order of the coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Coordinate of each point.
    pub x: Vec<f64>,
    /// Values at these coordinates.
    pub y: Vec<f64>,
}

impl Profile {
    /// Returns two columns of a CSV file: coordinate and value.
    ///
    /// # Errors
    /// If a file or value cannot be read.
    pub fn read(path: &Path) -> Result<Self, MeasureError> {
        let table = Table::read(path)?;
        let column = |column: usize| -> Result<Vec<f64>, MeasureError> {
            let cell = |row: &Vec<String>| {
                let text = row.get(column).map_or("", String::as_str);
                text.parse().map_err(|_| MeasureError::NotANumber {
                    table: path.to_owned(),
                    text: text.to_owned(),
                })
            };
            table.rows.iter().map(cell).collect()
        };
        Ok(Self {
            x: column(0)?,
            y: column(1)?,
        })
    }

    /// Returns the error of this profile, interpolated by cubics, at the points of a reference.
    ///
    /// # Errors
    /// If there are fewer than four points, or the coordinates do not increase.
    pub fn error(&self, reference: &Self, norm: Norm) -> Result<f64, MeasureError> {
        let there: Result<Vec<f64>, MeasureError> = reference
            .x
            .iter()
            .map(|&at| cubic(&self.x, &self.y, at))
            .collect();
        Ok(norm.distance(&there?, &reference.y))
    }
}

impl Measure {
    /// Returns the number, computed from the output folder of a run. Reference tables are in `reference_folder`;
    /// `known` returns numbers by name.
    ///
    /// # Errors
    /// If a file or value is missing or cannot be read.
    pub fn number(
        &self,
        output: &Path,
        reference_folder: &Path,
        known: &dyn Fn(&str) -> Option<f64>,
    ) -> Result<f64, MeasureError> {
        if let Some(path) = &self.summary {
            return summary(output, path);
        }
        let rows = self.rows(output, known)?;
        if let Take::Count = self.take {
            return Ok(real(rows.kept.len()));
        }
        let of = self.of.as_ref().ok_or(MeasureError::NoFormula)?;
        let values = rows.numbers(of)?;
        let last = *values.last().ok_or(MeasureError::NoRow)?;
        match &self.take {
            Take::Last => Ok(last),
            Take::Max => Ok(values.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
            Take::Min => Ok(values.iter().copied().fold(f64::INFINITY, f64::min)),
            Take::Mean => Ok(values.iter().sum::<f64>() / real(values.len())),
            Take::Count => Ok(real(values.len())),
            Take::Cosine(period) => Ok(wave(&values, &rows.phases(period)?, f64::cos)),
            Take::Sine(period) => Ok(wave(&values, &rows.phases(period)?, f64::sin)),
            Take::Period => period(&rows.numbers("time")?, &values),
            Take::LargestError(reference) => {
                let rows = rows.of_last_time()?;
                Ok(Norm::Largest.distance(&rows.numbers(of)?, &rows.numbers(reference)?))
            }
            Take::MeanError(reference) => {
                let rows = rows.of_last_time()?;
                Ok(Norm::Mean.distance(&rows.numbers(of)?, &rows.numbers(reference)?))
            }
            Take::TableError { table, at } => {
                let found = self.profile(output, at, known)?;
                found.error(
                    &Profile::read(&reference_folder.join(table))?,
                    Norm::Largest,
                )
            }
        }
    }

    /// Returns the values at the last time as a function of a coordinate.
    ///
    /// # Errors
    /// If a file or value is missing or cannot be read.
    pub fn profile(
        &self,
        output: &Path,
        over: &str,
        known: &dyn Fn(&str) -> Option<f64>,
    ) -> Result<Profile, MeasureError> {
        let rows = self.rows(output, known)?.of_last_time()?;
        let of = self.of.as_ref().ok_or(MeasureError::NoFormula)?;
        Ok(Profile {
            x: rows.numbers(over)?,
            y: rows.numbers(of)?,
        })
    }

    fn rows<'a>(
        &self,
        output: &Path,
        known: &'a dyn Fn(&str) -> Option<f64>,
    ) -> Result<Rows<'a>, MeasureError> {
        let file = self.file.as_ref().ok_or(MeasureError::NoSource)?;
        let table = Table::read(&output.join(file))?;
        let mut rows = Rows {
            kept: (0..table.rows.len()).collect(),
            table,
            known,
        };
        if let Some(condition) = &self.rows {
            let counts = rows.numbers(condition)?;
            let counts = rows.kept.iter().zip(counts);
            rows.kept = counts.filter(|(_, c)| *c > 0.0).map(|(n, _)| *n).collect();
        }
        Ok(rows)
    }
}

/// Returns a number of `summary.json`.
fn summary(output: &Path, path: &str) -> Result<f64, MeasureError> {
    let text = read(&output.join("summary.json"))?;
    let tree: serde_json::Value = serde_json::from_str(&text).map_err(MeasureError::Json)?;
    path.split('.')
        .try_fold(&tree, |node, key| node.get(key))
        .and_then(serde_json::Value::as_f64)
        .ok_or_else(|| MeasureError::NoNumber(path.to_owned()))
}

fn read(path: &Path) -> Result<String, MeasureError> {
    io::plain::text(path, io::plain::LONGEST_TABLE).map_err(MeasureError::File)
}

/// Text in rows and columns.
struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &Path) -> Result<Self, MeasureError> {
        let text = read(path)?;
        let mut reader = Reader::new(&text).ok_or_else(|| MeasureError::Empty(path.to_owned()))?;
        // A unit may follow a name: `time [s]`.
        let names = reader.names().into_iter();
        let columns = names
            .map(|name| name.split(' ').next().unwrap_or_default().to_owned())
            .collect();
        let mut rows = Vec::new();
        while let Some(row) = reader.row() {
            rows.push(row.cells().map(str::to_owned).collect());
        }
        Ok(Self { columns, rows })
    }

    fn cell(&self, row: usize, name: &str) -> Option<f64> {
        let column = self.columns.iter().position(|c| c == name)?;
        self.rows.get(row)?.get(column)?.parse().ok()
    }
}

/// Selected rows of a table, with the numbers that formulas may use in addition to its columns.
struct Rows<'a> {
    table: Table,
    kept: Vec<usize>,
    known: &'a dyn Fn(&str) -> Option<f64>,
}

impl Rows<'_> {
    fn numbers(&self, formula: &str) -> Result<Vec<f64>, MeasureError> {
        let at = |&row: &usize| {
            let value = evaluate(formula, &|name| {
                self.table.cell(row, name).or_else(|| (self.known)(name))
            });
            value.map_err(MeasureError::from)
        };
        self.kept.iter().map(at).collect()
    }

    fn phases(&self, period: &str) -> Result<Vec<f64>, MeasureError> {
        self.numbers(&format!("2*pi*time/({period})"))
    }

    fn of_last_time(mut self) -> Result<Self, MeasureError> {
        let times = self.numbers("time")?;
        let end = *times.last().ok_or(MeasureError::NoRow)?;
        let kept = self.kept.iter().zip(times);
        self.kept = kept.filter(|(_, t)| *t >= end).map(|(n, _)| *n).collect();
        Ok(self)
    }
}

fn wave(values: &[f64], phases: &[f64], shape: fn(f64) -> f64) -> f64 {
    let sum: f64 = values.iter().zip(phases).map(|(v, p)| v * shape(*p)).sum();
    2.0 * sum / real(values.len())
}

/// Returns the cubic interpolation through the four points nearest to `at`; `x` is ascending.
fn cubic(x: &[f64], y: &[f64], at: f64) -> Result<f64, MeasureError> {
    if x.len() < 4 || x.windows(2).any(|w| w[1] <= w[0]) {
        return Err(MeasureError::ShortProfile);
    }
    let above = x.partition_point(|&v| v < at);
    let first = above.saturating_sub(2).min(x.len() - 4);
    let four = first..first + 4;
    Ok(four
        .clone()
        .map(|i| {
            let others = four.clone().filter(|&j| j != i);
            y[i] * others.map(|j| (at - x[j]) / (x[i] - x[j])).product::<f64>()
        })
        .sum())
}

/// Returns the mean time between upward crossings of the mean.
fn period(time: &[f64], values: &[f64]) -> Result<f64, MeasureError> {
    let mean = values.iter().sum::<f64>() / real(values.len());
    let crossings: Vec<f64> = time
        .windows(2)
        .zip(values.windows(2))
        .filter(|(_, v)| v[0] < mean && v[1] >= mean)
        .map(|(t, v)| t[0] + (t[1] - t[0]) * (mean - v[0]) / (v[1] - v[0]))
        .collect();
    match crossings[..] {
        [first, .., last] => Ok((last - first) / real(crossings.len() - 1)),
        _ => Err(MeasureError::NoPeriod),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(json: serde_json::Value) -> Measure {
        serde_json::from_value(json).unwrap()
    }

    #[test]
    fn rows_are_chosen_and_taken_as_asked() {
        let folder = tempfile::tempdir().unwrap();
        let table = "step,time [s],x,u\n# a note\n1,0.1,0,1\n1,0.1,1,3\n2,0.2,0,5\n2,0.2,1,7\n";
        std::fs::write(folder.path().join("t.csv"), table).unwrap();
        let value = |of: &str, rows: &str, take: serde_json::Value| {
            let measure = measure(
                serde_json::json!({"file": "t.csv", "of": of, "where": rows, "take": take}),
            );
            let known = |name: &str| (name == "two").then_some(2.0);
            measure
                .number(folder.path(), folder.path(), &known)
                .unwrap()
        };
        assert_eq!(value("two*u", "1", "last".into()), 14.0);
        assert_eq!(value("u", "x < 1", "mean".into()), 3.0);
        assert_eq!(value("u", "time < 0.15", "max".into()), 3.0);
        assert_eq!(value("u", "x > 0", "count".into()), 2.0);
        let error = serde_json::json!({"largest_error": "5 + x"});
        assert_eq!(value("u", "1", error), 1.0 / 6.0);
    }

    #[test]
    fn a_cubic_profile_is_interpolated_without_error() {
        let sampled = |n: usize| {
            let x: Vec<f64> = (0..=n).map(|k| real(k) / real(n)).collect();
            let y = x.iter().map(|x| x * x * x - x + 1.0).collect();
            Profile { x, y }
        };
        for norm in [Norm::Largest, Norm::Mean] {
            assert!(sampled(5).error(&sampled(7), norm).unwrap() < 1e-14);
        }
        let mut off = sampled(7);
        off.y[3] *= 2.0;
        assert!(sampled(5).error(&off, Norm::Largest).unwrap() > 0.1);
        assert!(sampled(2).error(&sampled(7), Norm::Largest).is_err());
    }
}
