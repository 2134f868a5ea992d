//! Runs of the solver beside published and analytic numbers: what `expected.json` holds and how a run is compared with it.
//!
//! A case is a folder with `case.json` and `expected.json`. It has a short form, a long form, or both; a form is one run
//! or several of the same case under other `--set` values, so that an order of convergence is a quantity like any other.
//! Quantities are read from the files that every run writes (probes, ledgers, `summary.json`), combined by formulas, and
//! held against a reference under a tolerance that states its reason.

use super::expression::evaluate;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// What a case must show.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    /// The problem and its equations, for a reader.
    #[serde(rename = "about")]
    _about: String,
    /// Quantities of every form.
    #[serde(default)]
    values: Vec<Value>,
    /// Checks of every form.
    #[serde(default)]
    checks: Vec<Check>,
    /// Seconds.
    short: Option<Form>,
    /// Minutes; the short form is run where there is none.
    long: Option<Form>,
}

/// Runs of a case, with quantities and checks of their own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Form {
    /// Arguments of `--set` by the name of the run.
    runs: BTreeMap<String, Vec<String>>,
    #[serde(default)]
    values: Vec<Value>,
    #[serde(default)]
    checks: Vec<Check>,
}

/// A named number.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Value {
    name: String,
    /// A formula of numbers named before.
    #[serde(default)]
    is: Option<String>,
    /// The run it is read from; may be left out where there is one.
    #[serde(default)]
    run: Option<String>,
    /// CSV in the output folder.
    #[serde(default)]
    file: Option<String>,
    /// Path in `summary.json`, for example `mass_change`.
    #[serde(default)]
    summary: Option<String>,
    /// Formula of the columns of the file and of numbers named before.
    #[serde(default)]
    of: Option<String>,
    /// Rows that count: those for which this formula is not zero.
    #[serde(default, rename = "where")]
    rows: Option<String>,
    /// What is made of the rows; the last one without it.
    #[serde(default)]
    take: Take,
}

/// What is made of the rows.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Take {
    #[default]
    Last,
    Max,
    Min,
    Mean,
    /// Number of rows.
    Count,
    /// (2/n) sum of value times cos(2 pi time/period), over whole periods.
    Cosine(String),
    /// The same with the sine.
    Sine(String),
    /// Time between upward crossings of the mean, on average.
    Period,
    /// Largest difference from a formula of the columns, over the largest size of that formula; rows of the last time.
    LargestError(String),
    /// Root of the mean square of the difference over that of the formula; rows of the last time.
    MeanError(String),
    /// Largest difference from a table, over the table's largest size; rows of the last time, interpolated by cubics.
    TableError {
        /// CSV in the folder of the case with two columns: coordinate and value.
        table: String,
        /// Formula of the coordinate in the columns of the run.
        at: String,
    },
}

/// A number held against a reference.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Check {
    quantity: String,
    /// Formula of the named numbers.
    value: String,
    /// Formula as well.
    reference: String,
    source: String,
    tolerance: Tolerance,
    /// Why the tolerance is what it is.
    reason: String,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Tolerance {
    /// |value - reference| <= this |reference|
    Relative(f64),
    /// |value - reference| <= this
    Absolute(f64),
    /// reference - this <= value
    Below(f64),
}

/// A check done.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) case: String,
    pub(crate) quantity: String,
    pub(crate) reference: f64,
    pub(crate) result: f64,
    /// Relative or absolute, as the tolerance is.
    pub(crate) error: f64,
    pub(crate) tolerance: f64,
    pub(crate) pass: bool,
    /// Wall clock of the form's runs.
    pub(crate) seconds: f64,
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:4} {:<28} {:<44} {:>14.7e} expected {:>14.7e}, error {:.2e} of {:.2e} ({:.1} s)",
            if self.pass { "ok" } else { "FAIL" },
            self.case,
            self.quantity,
            self.result,
            self.reference,
            self.error,
            self.tolerance,
            self.seconds,
        )
    }
}

/// Folders below `root` that hold an `expected.json`, in order.
///
/// # Errors
/// Where the folder cannot be read.
pub(crate) fn cases(root: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(root).map_err(|e| format!("{}: {e}", root.display()))?;
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("expected.json").is_file())
        .collect();
    folders.sort();
    Ok(folders)
}

/// Runs a form of a case, `short` or `long`, and compares; a case without a long form runs its short one for it, a case
/// without a short form has nothing to show there.
///
/// # Errors
/// A file that cannot be read, a run that fails, a quantity that cannot be had.
pub(crate) fn check(
    folder: &Path,
    form: &str,
    solver: &Path,
    work: &Path,
) -> Result<Vec<Outcome>, String> {
    let case = folder
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let inner = || -> Result<Vec<Outcome>, String> {
        let text = read(&folder.join("expected.json"))?;
        let expected: Expected = serde_json::from_str(&text).map_err(|e| e.to_string())?;
        let form = match form {
            "short" => &expected.short,
            "long" if expected.long.is_some() => &expected.long,
            "long" => &expected.short,
            other => return Err(format!("a form is short or long, not {other:?}")),
        };
        let Some(form) = form else {
            return Ok(Vec::new());
        };
        let clock = Instant::now();
        for (name, set) in &form.runs {
            run(folder, set, solver, &work.join(&case).join(name))?;
        }
        let seconds = clock.elapsed().as_secs_f64();
        let reader = Reader {
            folder,
            form,
            output: work.join(&case),
        };
        let mut known = BTreeMap::new();
        for value in expected.values.iter().chain(&form.values) {
            let number = reader
                .number(value, &known)
                .map_err(|e| format!("{}: {e}", value.name))?;
            known.insert(value.name.clone(), number);
        }
        let lookup = |name: &str| known.get(name).copied();
        let checks = expected.checks.iter().chain(&form.checks);
        checks
            .map(|check| {
                if check.source.is_empty() || check.reason.is_empty() {
                    return Err(format!("{}: no source or reason", check.quantity));
                }
                let result = evaluate(&check.value, &lookup)?;
                let reference = evaluate(&check.reference, &lookup)?;
                let (error, tolerance) = match check.tolerance {
                    Tolerance::Relative(t) => ((result / reference - 1.0).abs(), t),
                    Tolerance::Absolute(t) => ((result - reference).abs(), t),
                    Tolerance::Below(t) => (reference - result, t),
                };
                Ok(Outcome {
                    case: case.clone(),
                    quantity: check.quantity.clone(),
                    reference,
                    result,
                    error,
                    tolerance,
                    // Not a number is not within any tolerance.
                    pass: error <= tolerance,
                    seconds,
                })
            })
            .collect()
    };
    inner().map_err(|e| format!("{case}: {e}"))
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// One run of the binary into an empty folder.
fn run(folder: &Path, set: &[String], solver: &Path, output: &Path) -> Result<(), String> {
    if output.exists() {
        std::fs::remove_dir_all(output).map_err(|e| format!("{}: {e}", output.display()))?;
    }
    let mut command = Command::new(solver);
    command.arg(folder.join("case.json"));
    command.args(["--threads", "1", "--output"]).arg(output);
    for assignment in set {
        command.arg("--set").arg(assignment);
    }
    for rank in [
        "OMPI_COMM_WORLD_RANK",
        "PMIX_RANK",
        "PMI_RANK",
        "SLURM_PROCID",
    ] {
        command.env_remove(rank);
    }
    let done = command
        .output()
        .map_err(|e| format!("{}: {e}", solver.display()))?;
    if done.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&done.stderr);
    let tail: Vec<&str> = said.lines().rev().take(8).collect();
    let tail: Vec<&str> = tail.into_iter().rev().collect();
    Err(format!(
        "the run ended with {}: {}",
        done.status,
        tail.join(" | ")
    ))
}

/// Text in rows and columns.
struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &Path) -> Result<Self, String> {
        let text = read(path)?;
        let mut lines = text
            .lines()
            .filter(|line| !line.starts_with('#') && !line.is_empty())
            .map(|line| line.split(',').map(|cell| cell.trim().to_owned()).collect());
        let header: Vec<String> = lines
            .next()
            .ok_or_else(|| format!("{} is empty", path.display()))?;
        // A unit may stand behind a name: `time [s]`.
        let columns = header
            .iter()
            .map(|name| name.split(' ').next().unwrap_or_default().to_owned())
            .collect();
        Ok(Self {
            columns,
            rows: lines.collect(),
        })
    }

    fn cell(&self, row: usize, name: &str) -> Option<f64> {
        let column = self.columns.iter().position(|c| c == name)?;
        self.rows[row].get(column)?.parse().ok()
    }
}

struct Reader<'a> {
    folder: &'a Path,
    form: &'a Form,
    output: PathBuf,
}

impl Reader<'_> {
    fn number(&self, value: &Value, known: &BTreeMap<String, f64>) -> Result<f64, String> {
        if let Some(formula) = &value.is {
            return evaluate(formula, &|name| known.get(name).copied());
        }
        let run = match &value.run {
            Some(run) => run,
            None if self.form.runs.len() == 1 => self.form.runs.keys().next().ok_or("no run")?,
            None => return Err("several runs, none named".into()),
        };
        let output = self.output.join(run);
        if let Some(path) = &value.summary {
            let text = read(&output.join("summary.json"))?;
            let tree: serde_json::Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
            return path
                .split('.')
                .try_fold(&tree, |node, key| node.get(key))
                .and_then(serde_json::Value::as_f64)
                .ok_or_else(|| format!("summary.json has no number {path}"));
        }
        let file = value.file.as_ref().ok_or("neither a formula nor a file")?;
        let table = Table::read(&output.join(file))?;
        let at = |row: usize, formula: &str| {
            evaluate(formula, &|name| {
                table.cell(row, name).or_else(|| known.get(name).copied())
            })
        };
        let mut rows = Vec::new();
        for row in 0..table.rows.len() {
            let counts = match &value.rows {
                Some(condition) => at(row, condition)? > 0.0,
                None => true,
            };
            if counts {
                rows.push(row);
            }
        }
        if let Take::Count = value.take {
            return Ok(number(rows.len()));
        }
        let of = value.of.as_ref().ok_or("no formula `of` the columns")?;
        let numbers = |formula: &str, rows: &[usize]| -> Result<Vec<f64>, String> {
            rows.iter().map(|&row| at(row, formula)).collect()
        };
        let values = numbers(of, &rows)?;
        let last = *rows.last().ok_or("no row")?;
        let last_time = || -> Result<Vec<usize>, String> {
            let end = at(last, "time")?;
            let mut kept = rows.clone();
            kept.retain(|&row| table.cell(row, "time").is_some_and(|t| t >= end));
            Ok(kept)
        };
        match &value.take {
            Take::Last => values.last().copied().ok_or_else(|| "no row".into()),
            Take::Max => Ok(values.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
            Take::Min => Ok(values.iter().copied().fold(f64::INFINITY, f64::min)),
            Take::Mean => Ok(values.iter().sum::<f64>() / number(values.len())),
            Take::Count => Ok(number(rows.len())),
            Take::Cosine(period) | Take::Sine(period) => {
                let phases = numbers(&format!("2*pi*time/({period})"), &rows)?;
                let cosine = matches!(value.take, Take::Cosine(_));
                let wave = |phase: f64| if cosine { phase.cos() } else { phase.sin() };
                let sum: f64 = values.iter().zip(phases).map(|(v, p)| v * wave(p)).sum();
                Ok(2.0 * sum / number(values.len()))
            }
            Take::Period => period(&numbers("time", &rows)?, &values),
            Take::LargestError(reference) => {
                let rows = last_time()?;
                let (values, reference) = (numbers(of, &rows)?, numbers(reference, &rows)?);
                Ok(largest(&values, &reference))
            }
            Take::MeanError(reference) => {
                let rows = last_time()?;
                let (values, reference) = (numbers(of, &rows)?, numbers(reference, &rows)?);
                let square = |x: f64| x * x;
                let pairs = values.iter().zip(&reference);
                let error: f64 = pairs.map(|(v, r)| square(v - r)).sum();
                let size: f64 = reference.iter().copied().map(square).sum();
                Ok((error / size).sqrt())
            }
            Take::TableError { table: file, at } => {
                let rows = last_time()?;
                let (x, y) = (numbers(at, &rows)?, numbers(of, &rows)?);
                let wanted = Table::read(&self.folder.join(file))?;
                let mut reference = Vec::new();
                let mut values = Vec::new();
                for row in &wanted.rows {
                    let cell = |column: usize| -> Result<f64, String> {
                        let text = row.get(column).map_or("", String::as_str);
                        text.parse().map_err(|_| format!("{file}: {text:?}"))
                    };
                    values.push(cubic(&x, &y, cell(0)?)?);
                    reference.push(cell(1)?);
                }
                Ok(largest(&values, &reference))
            }
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "rows are far fewer than 2^53")]
fn number(count: usize) -> f64 {
    count as f64
}

/// Largest difference over the largest size of the reference.
fn largest(values: &[f64], reference: &[f64]) -> f64 {
    // Not max(): it would pass over what is not a number.
    let pairs = values.iter().zip(reference);
    let errors = pairs.map(|(v, r)| (v - r).abs());
    let worst = errors.fold(0.0, |a: f64, b| if b.is_nan() || b > a { b } else { a });
    worst / reference.iter().fold(0.0, |a: f64, b| a.max(b.abs()))
}

/// Cubic through the four points nearest to `at`; `x` grows.
fn cubic(x: &[f64], y: &[f64], at: f64) -> Result<f64, String> {
    if x.len() < 4 || x.windows(2).any(|w| w[1] <= w[0]) {
        return Err("a table needs four points or more in growing order".into());
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

/// Mean time between upward crossings of the mean.
fn period(time: &[f64], values: &[f64]) -> Result<f64, String> {
    let mean = values.iter().sum::<f64>() / number(values.len());
    let crossings: Vec<f64> = time
        .windows(2)
        .zip(values.windows(2))
        .filter(|(_, v)| v[0] < mean && v[1] >= mean)
        .map(|(t, v)| t[0] + (t[1] - t[0]) * (mean - v[0]) / (v[1] - v[0]))
        .collect();
    match crossings[..] {
        [first, .., last] => Ok((last - first) / number(crossings.len() - 1)),
        _ => Err("fewer than two upward crossings of the mean".into()),
    }
}
