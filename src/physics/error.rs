//! The errors of a run and their exit codes.
//!
//! A [`Problem`] is one sentence about one field of the case; an [`Error`] ends the program. Exit codes:
//! 0 done, 2 usage, 3 invalid case, 4 numerical failure, 5 input or output, 6 internal or MPI,
//! 75 stopped early with a valid checkpoint (requeue), 101 panic.

use std::borrow::Cow;
use std::fmt;

/// Severity of a [`Problem`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The case is refused.
    Error,
    /// The case can run, but similar runs failed.
    Unstable,
    /// The case runs, possibly at a loss of accuracy.
    Warning,
}

/// A finding about a case: path, value, reason, allowed range and remedy.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Problem {
    /// JSON path of the value, such as `fluid.lattice_boltzmann.relaxation_time`.
    pub path: String,
    /// The value found, as JSON text (`missing` where there is none).
    pub value: String,
    /// What is wrong and which range or choice is allowed.
    pub reason: String,
    /// The smallest change that would pass.
    #[serde(flatten)]
    pub remedy: Remedy,
    /// Severity.
    pub severity: Severity,
}

/// What a model finds about its parameters: a [`Problem`] before its value is looked up in the case.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// JSON path of the field.
    pub path: String,
    /// What is wrong and which range or choice is allowed.
    pub reason: String,
    /// The smallest change that would pass.
    pub remedy: Remedy,
    /// Refused, unstable, or a warning.
    pub severity: Severity,
}

/// Remedy of a [`Problem`]: a sentence, and values to set where it names any.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Remedy {
    #[serde(rename = "remedy")]
    text: String,
    #[serde(rename = "proposal", skip_serializing_if = "Vec::is_empty")]
    proposal: Vec<Assignment>,
}

/// A value to set at a path of the case, as `--set` takes it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Assignment {
    /// JSON path.
    pub path: String,
    /// The value; null takes the field out.
    pub value: serde_json::Value,
}

impl Remedy {
    /// Takes out the optional field at a path.
    #[must_use]
    pub fn take_out(text: impl Into<Self>, path: &str) -> Self {
        text.into().set(path, serde_json::Value::Null)
    }

    /// Proposes a value. The problem is gone once all values that are proposed for it are set.
    #[must_use]
    pub fn set(mut self, path: impl Into<String>, value: impl Into<serde_json::Value>) -> Self {
        self.proposal.push(Assignment {
            path: path.into(),
            value: value.into(),
        });
        self
    }

    /// The values that are proposed; empty where the sentence names none.
    #[must_use]
    pub fn proposal(&self) -> &[Assignment] {
        &self.proposal
    }
}

/// Collects findings about the parameters of a model while it is resolved: models do not depend on the case that contains them.
pub trait Report {
    /// The case is refused.
    fn error(&mut self, path: &str, reason: String, remedy: Remedy);

    /// The case is refused: it names a material that is none of `known`.
    fn unknown_material(&mut self, path: &str, name: &str, known: &[&str]);
}

impl From<String> for Remedy {
    fn from(text: String) -> Self {
        Self {
            text,
            proposal: Vec::new(),
        }
    }
}

impl From<&str> for Remedy {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl std::ops::Deref for Remedy {
    type Target = str;

    fn deref(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for Remedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        for (n, assignment) in self.proposal.iter().enumerate() {
            write!(f, "{}{assignment}", if n == 0 { " (" } else { " " })?;
        }
        f.write_str(if self.proposal.is_empty() { "" } else { ")" })
    }
}

impl fmt::Display for Assignment {
    /// As on a command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{}={}", self.path, self.value);
        let plain = |c: char| c.is_ascii_alphanumeric() || "._=+-".contains(c);
        if text.chars().all(plain) {
            write!(f, "--set {text}")
        } else {
            write!(f, "--set '{}'", text.replace('\'', r"'\''"))
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            path,
            value,
            reason,
            remedy,
            ..
        } = self;
        let line = format!("{path} = {value}: {reason}; {remedy}");
        f.write_str(&printable(&line))
    }
}

/// Whether a character controls a terminal: C0, DEL and C1, including line breaks and tabs.
#[must_use]
pub fn controls(c: char) -> bool {
    c.is_control()
}

/// A text of unknown origin as one line without control characters, which are written as JSON does: `\u001b`.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |_| false)
}

/// As [`printable`], but line breaks and tabs stay: for texts that the program composes of lines.
#[must_use]
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| matches!(c, '\n' | '\t'))
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.chars().any(|c| controls(c) && !stays(c)) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if controls(c) && !stays(c) {
            safe.push_str(&format!("\\u{:04x}", u32::from(c)));
        } else {
            safe.push(c);
        }
    }
    Cow::Owned(safe)
}

/// Verdict on a case from all findings. Every command that reads a case states exactly one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// There are no findings.
    Valid,
    /// The case runs, with warnings.
    ValidWithWarnings,
    /// Similar runs failed: the case runs only with `--allow-unstable`.
    Unstable,
    /// The case does not run.
    Refused,
}

impl Verdict {
    /// The verdict on a case with these findings.
    #[must_use]
    pub fn of(findings: &[Problem]) -> Self {
        let has = |severity| findings.iter().any(|p| p.severity == severity);
        if has(Severity::Error) {
            Self::Refused
        } else if has(Severity::Unstable) {
            Self::Unstable
        } else if findings.is_empty() {
            Self::Valid
        } else {
            Self::ValidWithWarnings
        }
    }

    /// The words of tables and of `--json`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::ValidWithWarnings => "valid with warnings",
            Self::Unstable => "unstable",
            Self::Refused => "refused",
        }
    }

    /// Whether a case with this verdict is run; `allow_unstable` decides about unstable cases.
    #[must_use]
    pub fn runs(self, allow_unstable: bool) -> bool {
        match self {
            Self::Valid | Self::ValidWithWarnings => true,
            Self::Unstable => allow_unstable,
            Self::Refused => false,
        }
    }

    /// The exit code of a command that ends with the verdict.
    #[must_use]
    pub fn exit_code(self, allow_unstable: bool) -> i32 {
        if self.runs(allow_unstable) {
            0
        } else {
            Error::Case(Vec::new()).exit_code()
        }
    }

    /// The verdict with the number of findings of each severity, such as `unstable, 1 finding, 2 warnings`.
    #[must_use]
    pub fn sentence(findings: &[Problem]) -> String {
        let count = |severity| findings.iter().filter(|p| p.severity == severity).count();
        let mut text = match Self::of(findings) {
            Self::ValidWithWarnings => Self::Valid.name(),
            verdict => verdict.name(),
        }
        .to_owned();
        for (severity, word) in [
            (Severity::Error, "problem"),
            (Severity::Unstable, "unstable finding"),
            (Severity::Warning, "warning"),
        ] {
            match count(severity) {
                0 => {}
                1 => text += &format!(", 1 {word}"),
                n => text += &format!(", {n} {word}s"),
            }
        }
        text
    }
}

/// Option that lets an unstable case run.
pub const ALLOW_UNSTABLE: &str = "--allow-unstable";

/// Why a run ended before its end.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The case cannot be run; every problem found is listed.
    #[error("the case is {}", Verdict::sentence(.0))]
    Case(Vec<Problem>),
    /// The numbers failed: not finite, out of the envelope, a particle lost.
    #[error("numerical failure: {0}")]
    Numerical(String),
    /// Wrong usage: a folder in use, a run that is already finished.
    #[error("{0}")]
    Usage(String),
    /// A file could not be read or written.
    #[error("input/output: {0}")]
    Io(String),
    /// An error inside the program, or of MPI.
    #[error("internal error: {0}")]
    Internal(String),
    /// Stopped on request with a checkpoint written.
    #[error("stopped early with a checkpoint: {0}")]
    Stopped(String),
}

impl Error {
    /// The exit code of the process that ends with this error.
    #[must_use]
    pub fn exit_code(&self) -> i32 {
        match self {
            Self::Usage(_) => 2,
            Self::Case(_) => 3,
            Self::Numerical(_) => 4,
            Self::Io(_) => 5,
            Self::Internal(_) => 6,
            Self::Stopped(_) => 75,
        }
    }
}

/// A number as in a sentence: four significant digits.
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = [1e3, 1e2, 1e1, 1e0, 1e-1, 1e-2]
        .iter()
        .filter(|bound| size < **bound)
        .count();
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// The largest number of four significant digits that is not above a value.
#[must_use]
pub fn at_most(value: f64) -> f64 {
    four_digits(value, f64::floor).unwrap_or(value)
}

/// The smallest number of four significant digits that is not below a value.
#[must_use]
pub fn at_least(value: f64) -> f64 {
    four_digits(value, f64::ceil).unwrap_or(value)
}

fn four_digits(value: f64, whole: fn(f64) -> f64) -> Option<f64> {
    let text = format!("{:e}", value);
    let (digits, exponent) = text.split_once('e')?;
    let digits = whole(digits.parse::<f64>().ok()? * 1e3);
    format!("{digits}e{}", exponent.parse::<i32>().ok()? - 3)
        .parse()
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_not_obeyed() {
        assert_eq!(
            printable("a\u{1b}[2Jb\nc\u{7f}\u{9b}"),
            r"a\u001b[2Jb\u000ac\u007f\u009b"
        );
        assert_eq!(printable_lines("a\n\tb\r"), "a\n\tb\\u000d");
        assert!(matches!(printable("Größe 3 µm"), Cow::Borrowed(_)));
        let problem = Problem {
            path: "title".into(),
            value: "\u{9b}31m".into(),
            reason: "reason".into(),
            remedy: "remedy".into(),
            severity: Severity::Error,
        };
        assert_eq!(problem.to_string(), r"title = \u009b31m: reason; remedy");
    }

    fn findings(severities: &[Severity]) -> Vec<Problem> {
        let one = |&severity: &Severity| Problem {
            path: "time.end".into(),
            value: "1".into(),
            reason: "a reason".into(),
            remedy: "a remedy".into(),
            severity,
        };
        severities.iter().map(one).collect()
    }

    #[test]
    fn a_case_has_one_verdict() {
        use Severity::{Error, Unstable, Warning};
        for (severities, verdict, sentence, codes) in [
            (&[][..], Verdict::Valid, "valid", [0, 0]),
            (
                &[Warning, Warning],
                Verdict::ValidWithWarnings,
                "valid, 2 warnings",
                [0, 0],
            ),
            (
                &[Warning, Unstable],
                Verdict::Unstable,
                "unstable, 1 unstable finding, 1 warning",
                [3, 0],
            ),
            (
                &[Unstable, Error],
                Verdict::Refused,
                "refused, 1 problem, 1 unstable finding",
                [3, 3],
            ),
        ] {
            let findings = findings(severities);
            assert_eq!(Verdict::of(&findings), verdict);
            assert_eq!(Verdict::sentence(&findings), sentence);
            assert_eq!([false, true].map(|allow| verdict.exit_code(allow)), codes);
        }
    }

    #[test]
    fn numbers_keep_four_digits() {
        let pairs = [
            (0.0, "0"),
            (0.00125, "0.00125"),
            (0.25, "0.25"),
            (1.0 / 3.0, "0.3333"),
            (-12.3456, "-12.35"),
            (2500.0, "2500"),
            (1e-5, "1.000e-5"),
            (3.0e7, "3.000e7"),
        ];
        for (value, text) in pairs {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn bounds_are_rounded_to_the_side_that_holds() {
        for value in [0.123_456, 9.999_96, 1e-7 / 3.0, 123_456.7, 2.5, 1e-300] {
            let (low, high) = (at_most(value), at_least(value));
            assert!(low <= value && value <= high, "{low} {value} {high}");
            assert!(high - low <= 1.1e-3 * value);
        }
        assert_eq!((at_most(0.123_456), at_least(0.123_456)), (0.1234, 0.1235));
        assert_eq!((at_most(2.5), at_least(2.5)), (2.5, 2.5));
    }
}
