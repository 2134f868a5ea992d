//! The verdict on a case from its findings.

use super::{Error, Problem, Severity};

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
