//! Collects the findings of a case, each with the value as it stands in the case.

use crate::case::set::lookup;
use crate::case::text::{MOST_PROBLEMS, brief};
use crate::case::{Case, check};
use crate::error::{Finding, Problem, Remedy, Report, Severity};
pub(crate) use crate::error::{at_least, at_most, number};
use serde_json::Value;
use std::cell::OnceCell;

/// The path of the lattice fluid in a case.
pub(crate) const LATTICE_PATH: &str = "fluid.lattice_boltzmann";

/// Sections of a case on which neither its plan nor other sections depend.
const OBSERVING: [&str; 5] = ["output", "probes", "checkpoint", "analysis", "title"];

/// `true` if a path is that of a section or of a field below it.
fn within(path: &str, section: &str) -> bool {
    let below = path.strip_prefix(section);
    below.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// The findings so far.
#[derive(Debug)]
pub(crate) struct Findings<'a> {
    case: &'a Case,
    /// The case as a tree, made for the first finding: a case without findings needs none, however many grains it lists.
    tree: OnceCell<Value>,
    /// In the order found.
    pub(crate) problems: Vec<Problem>,
    /// Weight of what is only counted, where its line stands in `problems`, and how many there are.
    unlisted: Vec<(Severity, usize, usize)>,
    /// Paths of fields that are known to be wrong: the schema refuses them.
    wrong: Vec<String>,
    /// Positions of findings that hold only if the fields of some sections are right, with these sections.
    dependent: Vec<(usize, &'static [&'static str])>,
    /// `true` if a field is wrong on which the choices of the program depend, so that none were made.
    pub(crate) stopped: bool,
}

impl<'a> Findings<'a> {
    pub(crate) fn new(case: &'a Case) -> Self {
        Self::with_wrong(case, &[])
    }

    /// Begins with the paths of fields that the schema refuses.
    pub(crate) fn with_wrong(case: &'a Case, wrong: &[String]) -> Self {
        Self {
            case,
            tree: OnceCell::new(),
            problems: Vec::new(),
            unlisted: Vec::new(),
            wrong: wrong.to_vec(),
            dependent: Vec::new(),
            stopped: false,
        }
    }

    /// Marks the last finding as one that holds only if the fields of some sections are right.
    pub(crate) fn depends(&mut self, sections: &'static [&'static str]) {
        if let Some(last) = self.problems.len().checked_sub(1) {
            self.dependent.push((last, sections));
        }
    }

    /// Paths of all fields that are wrong.
    fn errors(&self) -> impl Iterator<Item = &str> {
        let errors = self
            .problems
            .iter()
            .filter(|p| p.severity == Severity::Error);
        let wrong = self.wrong.iter().map(String::as_str);
        wrong.chain(errors.map(|p| p.path.as_str()))
    }

    /// `true` if a field of one of the sections is wrong.
    pub(crate) fn wrong_in(&self, sections: &[&str]) -> bool {
        self.errors()
            .any(|path| sections.iter().any(|section| within(path, section)))
    }

    /// `true` if a field is wrong on which the plan depends.
    pub(crate) fn stop_plan(&self) -> bool {
        self.errors()
            .any(|path| !OBSERVING.iter().any(|section| within(path, section)))
    }

    /// Drops findings that follow from others: those that depend on a section with an error, and those about a field that
    /// contains, or lies in, one that was found wrong before.
    pub(crate) fn drop_consequences(&mut self) {
        let dependent = std::mem::take(&mut self.dependent);
        let sections = |n: usize| {
            let found = dependent.iter().find(|(at, _)| *at == n);
            found.map(|(_, sections)| *sections)
        };
        let mut causes = self.wrong.clone();
        for (n, problem) in self.problems.iter().enumerate() {
            if problem.severity == Severity::Error && sections(n).is_none() {
                causes.push(problem.path.clone());
            }
        }
        let mut before = self.wrong.clone();
        let mut kept = Vec::new();
        for (n, problem) in std::mem::take(&mut self.problems).into_iter().enumerate() {
            let on = sections(n).unwrap_or_default();
            let follows = causes
                .iter()
                .any(|path| on.iter().any(|section| within(path, section)));
            let part = before.iter().any(|path| {
                *path != problem.path
                    && (within(path, &problem.path) || within(&problem.path, path))
            });
            let line = self.unlisted.iter_mut().find(|rest| rest.1 == n);
            if (follows || part) && line.is_none() {
                continue;
            }
            if let Some(line) = line {
                line.1 = kept.len();
            }
            if let Some(sections) = sections(n) {
                self.dependent.push((kept.len(), sections));
            }
            if problem.severity == Severity::Error {
                before.push(problem.path.clone());
            }
            kept.push(problem);
        }
        self.problems = kept;
    }

    /// The case is refused.
    pub(crate) fn error(
        &mut self,
        path: &str,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) {
        self.push(path, reason.into(), remedy.into(), Severity::Error);
    }

    /// The case runs, and the user should know.
    pub(crate) fn warn(
        &mut self,
        path: &str,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) {
        self.push(path, reason.into(), remedy.into(), Severity::Warning);
    }

    /// The case runs, but runs like it were seen to fail.
    pub(crate) fn unstable(
        &mut self,
        path: &str,
        reason: impl Into<String>,
        remedy: impl Into<Remedy>,
    ) {
        self.push(path, reason.into(), remedy.into(), Severity::Unstable);
    }

    /// Adds what a model found.
    pub(crate) fn add(&mut self, finding: Finding) {
        self.push(
            &finding.path,
            finding.reason,
            finding.remedy,
            finding.severity,
        );
    }

    fn push(&mut self, path: &str, reason: String, remedy: Remedy, severity: Severity) {
        // A list of a million grains may be wrong a million times. One error more or less changes nothing then.
        let alike = self.problems.iter().filter(|p| p.severity == severity);
        if alike.count() >= MOST_PROBLEMS {
            self.only_count(severity);
            return;
        }
        let tree = self
            .tree
            .get_or_init(|| serde_json::to_value(self.case).unwrap_or(Value::Null));
        let value = match lookup(tree, path) {
            None | Some(Value::Null) => "missing".to_string(),
            Some(value) => brief(value),
        };
        self.problems.push(Problem {
            path: path.into(),
            value,
            reason,
            remedy,
            severity,
        });
    }

    /// Adds to the line about the findings that are not listed.
    fn only_count(&mut self, severity: Severity) {
        let known = self.unlisted.iter_mut().find(|rest| rest.0 == severity);
        let (_, at, count) = match known {
            Some(rest) => rest,
            None => {
                self.problems.push(Problem {
                    path: "the case".into(),
                    value: String::new(),
                    reason: format!("only the first {MOST_PROBLEMS} of this severity are listed"),
                    remedy: "correct those first".into(),
                    severity,
                });
                self.unlisted.push((severity, self.problems.len() - 1, 0));
                let last = self.unlisted.len() - 1;
                &mut self.unlisted[last]
            }
        };
        *count += 1;
        self.problems[*at].value = format!("{count} more");
    }

    /// Whether the case is refused.
    pub(crate) fn refused(&self) -> bool {
        refused(&self.problems)
    }
}

impl Report for Findings<'_> {
    fn error(&mut self, path: &str, reason: String, remedy: Remedy) {
        self.push(path, reason, remedy, Severity::Error);
    }

    fn unknown_material(&mut self, path: &str, name: &str, known: &[&str]) {
        let remedy = match check::nearest(name, known) {
            Some(near) => Remedy::from(format!("did you mean `{near}`? Or add it to `materials`"))
                .set(path, near),
            None => "add it to `materials`".into(),
        };
        self.push(
            path,
            format!("there is no material `{name}`"),
            remedy,
            Severity::Error,
        );
    }
}

/// Whether any of the problems refuses the case.
#[must_use]
pub fn refused(problems: &[Problem]) -> bool {
    problems.iter().any(|p| p.severity == Severity::Error)
}

/// The multiple of a spacing nearest to a number of cells, without the digits of round-off.
pub(crate) fn length_of(cells: f64, spacing: f64) -> f64 {
    format!("{:.12e}", cells * spacing)
        .parse()
        .unwrap_or(cells * spacing)
}
