//! Runs of the solver compared with published and analytical numbers: the contents of `expected.json` and the
//! comparison.
//!
//! A case is a folder with `case.json` and `expected.json`. It has a short form, a long form, or both; a form is
//! one run or several of the same case under other `--set` values, so that an order of convergence is a quantity
//! like any other. Quantities are read from the files that every run writes (probes, ledgers, `summary.json`),
//! combined by formulas, and compared with a reference within a tolerance with a stated reason.

use serde::Deserialize;
use solver::analysis::expression::evaluate;
use solver::analysis::measure::Measure;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Required quantities of a case.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    /// Description of the problem and its equations.
    #[serde(rename = "about")]
    _about: String,
    /// Reason for running in spite of the verdict `unstable`.
    #[serde(default)]
    allow_unstable: Option<String>,
    /// Quantities of all forms.
    #[serde(default)]
    values: Vec<Value>,
    /// Checks of all forms.
    #[serde(default)]
    checks: Vec<Check>,
    /// Form that takes seconds.
    short: Option<Form>,
    /// Form that takes minutes; if there is none, the short form is run.
    long: Option<Form>,
}

/// Runs of a case with their quantities and checks.
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

/// Named number.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Value {
    name: String,
    /// Formula of numbers named before.
    #[serde(default)]
    is: Option<String>,
    /// Run from which it is read; optional for a single run.
    #[serde(default)]
    run: Option<String>,
    #[serde(flatten)]
    measure: Measure,
}

/// Comparison of a number with a reference.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Check {
    quantity: String,
    /// Formula of the named numbers.
    value: String,
    /// Formula of the reference.
    reference: String,
    source: String,
    tolerance: Tolerance,
    /// Reason for the tolerance.
    reason: String,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Tolerance {
    /// |value - reference| <= tolerance |reference|
    Relative(f64),
    /// |value - reference| <= tolerance
    Absolute(f64),
    /// reference - tolerance <= value
    Below(f64),
}

/// Result of a check.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) case: String,
    pub(crate) quantity: String,
    pub(crate) reference: f64,
    pub(crate) result: f64,
    /// Relative or absolute error, like the tolerance.
    pub(crate) error: f64,
    pub(crate) tolerance: f64,
    pub(crate) pass: bool,
    /// Wall time of the runs of the form.
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

/// Returns the folders below `root` that contain an `expected.json`, in order.
///
/// # Errors
/// If the folder cannot be read.
pub(crate) fn cases(root: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = std::fs::read_dir(root).map_err(|e| format!("{}: {e}", root.display()))?;
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("expected.json").is_file())
        .collect();
    folders.sort();
    Ok(folders)
}

/// Runs a form of a case, `short` or `long`, and compares the results. A case without a long form runs its short
/// one instead; a case without a short form has no result for it.
///
/// `more` are arguments of `--set` for every run, in addition to those of the form.
///
/// # Errors
/// If a file cannot be read, a run fails, or a quantity cannot be computed.
pub(crate) fn check(
    folder: &Path,
    form: &str,
    more: &[String],
    solver: &Path,
    work: &Path,
) -> Result<Vec<Outcome>, String> {
    let case = folder
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let inner = || -> Result<Vec<Outcome>, String> {
        let text = read(&folder.join("expected.json"))?;
        let expected: Expected = serde_json::from_str(&text).map_err(|e| e.to_string())?;
        if expected.short.is_none() && expected.long.is_none() {
            return Err("neither a short nor a long form: the case would never run".into());
        }
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
            run(
                folder,
                &[set, more].concat(),
                expected.allow_unstable.is_some(),
                solver,
                &work.join(&case).join(name),
            )?;
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
                let result = evaluate(&check.value, &lookup).map_err(|e| e.to_string())?;
                let reference = evaluate(&check.reference, &lookup).map_err(|e| e.to_string())?;
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
                    // NaN is not within any tolerance.
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

/// Runs the binary once into an empty folder.
fn run(
    folder: &Path,
    set: &[String],
    allow_unstable: bool,
    solver: &Path,
    output: &Path,
) -> Result<(), String> {
    if output.exists() {
        std::fs::remove_dir_all(output).map_err(|e| format!("{}: {e}", output.display()))?;
    }
    let mut command = Command::new(solver);
    command.arg(folder.join("case.json"));
    command.args(["--threads", "1", "--output"]).arg(output);
    if allow_unstable {
        command.arg("--allow-unstable");
    }
    for assignment in set {
        command.arg("--set").arg(assignment);
    }
    // A single process needs neither the daemon of Open MPI nor cluster hardware, and starts faster without them.
    // Without a daemon all such processes share one session folder, and the first that ends would remove it while
    // another starts: each has its own.
    let session = tempfile::tempdir().map_err(|e| format!("session folder: {e}"))?;
    command.env("OMPI_MCA_ess_singleton_isolated", "1");
    command.env("OMPI_MCA_orte_tmpdir_base", session.path());
    command.env("OMPI_MCA_pml", "ob1");
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

struct Reader<'a> {
    folder: &'a Path,
    form: &'a Form,
    output: PathBuf,
}

impl Reader<'_> {
    fn number(&self, value: &Value, known: &BTreeMap<String, f64>) -> Result<f64, String> {
        let lookup = |name: &str| known.get(name).copied();
        if let Some(formula) = &value.is {
            return evaluate(formula, &lookup).map_err(|e| e.to_string());
        }
        let run = match &value.run {
            Some(run) => run,
            None if self.form.runs.len() == 1 => self.form.runs.keys().next().ok_or("no run")?,
            None => return Err("several runs, none named".into()),
        };
        let output = self.output.join(run);
        let number = value.measure.number(&output, self.folder, &lookup);
        number.map_err(|e| e.to_string())
    }
}
