//! Findings about a case, errors of a run, and their exit codes.
//!
//! A [`Problem`] is one sentence about one field of the case; an [`Error`] ends the program. Exit codes:
//! 0 done, 2 usage, 3 invalid case, 4 numerical failure, 5 input or output, 6 internal or MPI,
//! 75 stopped early with a valid checkpoint (requeue), 101 panic.
//!
//! A [`Verdict`] on a case follows from its findings. `text` has texts without control characters, and numbers in
//! sentences.

mod text;

pub use text::{at_least, at_most, controls, number, printable, printable_lines};

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
    /// JSON path of the value, for example `fluid.lattice_boltzmann.relaxation_time`.
    pub path: String,
    /// Value found, as JSON text (`missing` if there is none).
    pub value: String,
    /// Reason, and the allowed range or choice.
    pub reason: String,
    /// Smallest change that would pass.
    #[serde(flatten)]
    pub remedy: Remedy,
    /// Severity of the problem.
    pub severity: Severity,
}

impl Problem {
    /// Returns a problem that refuses the case.
    #[must_use]
    pub fn error(
        path: impl Into<String>,
        value: impl Into<String>,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) -> Self {
        Self {
            path: path.into(),
            value: value.into(),
            reason: reason.into(),
            remedy: remedy.into(),
            severity: Severity::Error,
        }
    }
}

/// Finding of a model about its parameters, before the value in the case is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// JSON path of the field.
    pub path: String,
    /// Reason, and the allowed range or choice.
    pub reason: String,
    /// Smallest change that would pass.
    pub remedy: Remedy,
    /// Severity of the finding.
    pub severity: Severity,
}

/// Remedy of a [`Problem`]: a sentence, and the values to set if the sentence names any.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Remedy {
    #[serde(rename = "remedy")]
    text: String,
    #[serde(rename = "proposal", skip_serializing_if = "Vec::is_empty")]
    proposal: Vec<Assignment>,
}

/// Value to set at a path of the case, as in `--set`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Assignment {
    /// Path of the field in the JSON text.
    pub path: String,
    /// Value; null removes the field.
    pub value: serde_json::Value,
}

impl Remedy {
    /// Returns the remedy that removes the optional field at a path.
    #[must_use]
    pub fn take_out(text: impl Into<Self>, path: &str) -> Self {
        text.into().set(path, serde_json::Value::Null)
    }

    /// Adds a proposed value. The problem is solved once all proposed values are set.
    #[must_use]
    pub fn set(mut self, path: impl Into<String>, value: impl Into<serde_json::Value>) -> Self {
        self.proposal.push(Assignment {
            path: path.into(),
            value: value.into(),
        });
        self
    }

    /// Returns the proposed values; empty if the sentence names none.
    #[must_use]
    pub fn proposal(&self) -> &[Assignment] {
        &self.proposal
    }
}

/// Receiver of findings about the parameters of a model: models do not depend on the case that contains them.
pub trait Report {
    /// Adds an error: the case is refused.
    fn error(&mut self, path: &str, reason: String, remedy: Remedy);

    /// Adds an error about a vector whose number of components differs from the dimension, so that nothing can be said
    /// of what follows from it.
    fn wrong_components(&mut self, path: &str, reason: String, remedy: Remedy) {
        self.error(path, reason, remedy);
    }

    /// Adds an error: the case names a material that is not in `known`.
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
    /// Writes the assignment as an option of a command line.
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

/// Reason for an early end of a run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The case cannot be run; the list contains every problem found.
    #[error("the case is {}", Verdict::sentence(.0))]
    Case(Vec<Problem>),
    /// Numerical failure: values not finite, values out of the envelope, or a lost particle.
    #[error("numerical failure: {0}")]
    Numerical(String),
    /// Wrong usage: a folder in use, or a run that is already finished.
    #[error("{0}")]
    Usage(String),
    /// A file could not be read or written.
    #[error("input/output: {0}")]
    Io(String),
    /// An error inside the program, or of MPI.
    #[error("internal error: {0}")]
    Internal(String),
    /// The run stopped on request after writing a checkpoint.
    #[error("stopped early with a checkpoint: {0}")]
    Stopped(String),
}

impl Error {
    /// Returns the exit code of a process that ends with this error.
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

    /// Returns the reason of a numerical failure without its kind, and other errors as they are. A finding about a case
    /// uses it: nothing has been computed yet.
    #[must_use]
    pub fn into_reason(self) -> String {
        match self {
            Self::Numerical(reason) => reason,
            other => other.to_string(),
        }
    }
}

/// Verdict on a case from all findings. Every command that reads a case states exactly one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// No findings.
    Valid,
    /// The case runs, with warnings.
    ValidWithWarnings,
    /// Similar runs failed: the case runs only with `--allow-unstable`.
    Unstable,
    /// The case is refused and does not run.
    Refused,
}

impl Verdict {
    /// Returns the verdict on a case with these findings.
    #[must_use]
    pub fn from_findings(findings: &[Problem]) -> Self {
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

    /// Returns the name of the verdict in tables and in `--json`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::ValidWithWarnings => "valid with warnings",
            Self::Unstable => "unstable",
            Self::Refused => "refused",
        }
    }

    /// Returns `true` if a case with this verdict can run; `allow_unstable` permits unstable cases.
    #[must_use]
    pub fn runs(self, allow_unstable: bool) -> bool {
        match self {
            Self::Valid | Self::ValidWithWarnings => true,
            Self::Unstable => allow_unstable,
            Self::Refused => false,
        }
    }

    /// Returns the exit code of a command that ends with the verdict.
    #[must_use]
    pub fn exit_code(self, allow_unstable: bool) -> i32 {
        if self.runs(allow_unstable) {
            0
        } else {
            Error::Case(Vec::new()).exit_code()
        }
    }

    /// Returns the verdict with the number of findings of each severity, such as `unstable, 1 finding, 2 warnings`.
    #[must_use]
    pub fn sentence(findings: &[Problem]) -> String {
        let count = |severity| findings.iter().filter(|p| p.severity == severity).count();
        let mut text = match Self::from_findings(findings) {
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

/// Option that allows an unstable case to run.
pub const ALLOW_UNSTABLE: &str = "--allow-unstable";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_problem_shows_control_characters() {
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
            assert_eq!(Verdict::from_findings(&findings), verdict);
            assert_eq!(Verdict::sentence(&findings), sentence);
            assert_eq!([false, true].map(|allow| verdict.exit_code(allow)), codes);
        }
    }
}
