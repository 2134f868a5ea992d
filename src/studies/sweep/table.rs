//! Outputs, errors and costs of the members, and the Pareto set: the members for which no other member has both a
//! smaller error and a smaller cost.

use super::members::Member;
use super::record::{Outcome, Record};
use super::study::{Cost, FoundReference, Output, Reference, Study};
use analysis::expression::evaluate;
use analysis::measure::{MeasureError, Profile};
use base::error::Severity;
use io::csv::push_line;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

/// Results of the members, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepTable {
    /// A row for each member.
    pub rows: Vec<MemberRow>,
}

/// Result of a member.
#[derive(Clone, Debug, PartialEq)]
pub struct MemberRow {
    /// Outcome of the member.
    pub outcome: Outcome,
    /// Outputs, in the order of the study; none for profiles and values that could not be read.
    pub outputs: Vec<Option<f64>>,
    /// Value and error by the names of the references. A reference member has no error relative to itself.
    pub errors: BTreeMap<String, (Option<f64>, Option<f64>)>,
    /// Error that the picture shows.
    pub error: Option<f64>,
    /// Core-seconds of the steps; none if they are not known.
    pub core_seconds: Option<f64>,
    /// Core-seconds of the whole run; none if they are unknown.
    pub run_core_seconds: Option<f64>,
    /// Processor time \[s\]: less than the core-seconds if the run shared its cores with other processes.
    pub processor_seconds: Option<f64>,
    /// Peak memory of all ranks together \[bytes\].
    pub memory: Option<f64>,
    /// Number of steps.
    pub steps: Option<u64>,
    /// Core-seconds or processor time, as selected by the study \[s\].
    pub cost: Option<f64>,
    /// `true` if the member is in the Pareto set of error against this cost.
    pub pareto_time: bool,
    /// `true` if the member is in the Pareto set of error against memory.
    pub pareto_memory: bool,
    /// Hash of the final state.
    pub state_hash: String,
    /// Commit of the program.
    pub commit: String,
    /// Remarks on the member.
    pub note: String,
}

/// Output of a member as read.
#[derive(Clone, Debug)]
enum ReadOutput {
    Number(f64),
    Profile(Profile),
}

impl SweepTable {
    /// Reads the results of the members below `output`; tables of references are in the folder `study_folder`.
    #[must_use]
    pub fn collect(study: &Study, members: &[Member], study_folder: &Path, output: &Path) -> Self {
        let mut rows = Vec::new();
        let mut found = Vec::new();
        for member in members {
            let mut row = MemberRow::new(study, member, &output.join(&member.name));
            let outputs = if row.outcome == Outcome::Finished {
                row.read(study, member, study_folder, &output.join(&member.name))
            } else {
                vec![None; study.outputs.0.len()]
            };
            rows.push(row);
            found.push(outputs);
        }
        for at in 0..members.len() {
            for (name, reference) in &study.reference {
                let there = Comparison {
                    study,
                    members,
                    study_folder,
                    found: &found,
                    at,
                };
                match there.error(name, reference) {
                    Ok(pair) => {
                        rows[at].errors.insert(name.clone(), pair);
                    }
                    Err(why) => rows[at].add_note(&format!("{name}: {why}")),
                }
            }
            let row = &mut rows[at];
            row.error = match &study.error {
                Some(name) => row.errors.get(name).and_then(|(_, error)| *error),
                None => row.errors.values().filter_map(|(_, e)| *e).reduce(f64::max),
            };
        }
        let marked = |cost: fn(&MemberRow) -> Option<f64>| {
            let points: Vec<_> = rows.iter().map(|row| cost(row).zip(row.error)).collect();
            pareto(&points)
        };
        let (time, memory) = (marked(|r| r.cost), marked(|r| r.memory));
        for (row, (time, memory)) in rows.iter_mut().zip(time.into_iter().zip(memory)) {
            (row.pareto_time, row.pareto_memory) = (time, memory);
        }
        Self { rows }
    }

    /// Returns a row for each member as CSV, with the units in the header.
    #[must_use]
    pub fn to_csv(&self, study: &Study, members: &[Member]) -> String {
        let mut text = format!("# {}, {}\n", study.title.replace('\n', " "), machine());
        let mut header: Vec<String> = vec!["member".into()];
        header.extend(study.vary.0.iter().map(|(name, _)| name.clone()));
        header.extend(["plan", "outcome"].map(String::from));
        header.extend(
            study
                .outputs
                .0
                .iter()
                .filter(|(_, o)| o.over.is_none())
                .map(|(n, _)| n.clone()),
        );
        for name in study.reference.keys() {
            header.extend([format!("reference of {name}"), format!("error of {name}")]);
        }
        header.extend(
            [
                "error",
                "core-seconds of the steps",
                "core-seconds of the run",
                "processor time [s]",
                "peak memory [bytes]",
                "steps",
                "pareto error-time",
                "pareto error-memory",
                "state_hash",
                "commit",
                "note",
            ]
            .map(String::from),
        );
        push_line(&mut text, &header);
        for (member, row) in members.iter().zip(&self.rows) {
            push_line(&mut text, row.cells(study, member));
        }
        text
    }

    /// Returns the names of the outputs with a reference of 0, whose errors are absolute.
    fn absolute(&self) -> BTreeSet<&str> {
        let errors = self.rows.iter().flat_map(|row| &row.errors);
        let zero =
            errors.filter(|(_, (reference, error))| *reference == Some(0.0) && error.is_some());
        zero.map(|(name, _)| name.as_str()).collect()
    }

    /// Returns the number of members with each outcome, and the Pareto set of error and time.
    #[must_use]
    pub fn summary(&self, members: &[Member]) -> String {
        let mut counts: BTreeMap<Outcome, usize> = BTreeMap::new();
        for row in &self.rows {
            *counts.entry(row.outcome).or_default() += 1;
        }
        let counts: Vec<String> = counts
            .iter()
            .map(|(o, n)| format!("{n} {}", o.name()))
            .collect();
        let mut text = format!("{} members: {}\n", members.len(), counts.join(", "));
        let mut best: Vec<(&Member, &MemberRow)> = members
            .iter()
            .zip(&self.rows)
            .filter(|(_, r)| r.pareto_time)
            .collect();
        best.sort_by(|a, b| a.1.cost.unwrap_or(0.0).total_cmp(&b.1.cost.unwrap_or(0.0)));
        let _ = writeln!(
            text,
            "{:>10} {:>10} {:>9}  Pareto set of error and time",
            "error", "core-s", "MB"
        );
        for (member, row) in best {
            let (error, time) = (row.error.unwrap_or(f64::NAN), row.cost.unwrap_or(f64::NAN));
            let memory = 1e-6 * row.memory.unwrap_or(f64::NAN);
            let _ = writeln!(
                text,
                "{error:10.3e} {time:10.3e} {memory:9.1}  {}",
                member.name
            );
        }
        for name in self.absolute() {
            let _ = writeln!(
                text,
                "the errors of {name} are absolute, in its unit, where its reference is 0; they count beside relative \
                 ones in the error of a member"
            );
        }
        for (member, row) in members.iter().zip(&self.rows) {
            if !row.note.is_empty() && row.outcome == Outcome::Finished {
                let _ = writeln!(text, "{}: {}", member.name, row.note);
            }
        }
        text.truncate(text.trim_end().len());
        text
    }
}

impl MemberRow {
    fn new(study: &Study, member: &Member, folder: &Path) -> Self {
        let mut row = Self {
            outcome: Outcome::Missing,
            outputs: Vec::new(),
            errors: BTreeMap::new(),
            error: None,
            core_seconds: None,
            run_core_seconds: None,
            processor_seconds: None,
            cost: None,
            memory: None,
            steps: None,
            pareto_time: false,
            pareto_memory: false,
            state_hash: String::new(),
            commit: String::new(),
            note: String::new(),
        };
        let Some(prepared) = &member.prepared else {
            row.outcome = Outcome::Refused;
            let mut errors = member
                .problems
                .iter()
                .filter(|p| p.severity != Severity::Warning);
            row.note = errors.next().map(ToString::to_string).unwrap_or_default();
            return row;
        };
        let record = Record::read(folder).filter(|record| record.case_hash == prepared.hash);
        let Some(record) = record else {
            return row;
        };
        row.outcome = record.outcome;
        row.note.clone_from(&record.message);
        let cores = f64::from(study.run.ranks) * f64::from(study.run.threads);
        if record.timed {
            let finished = record.outcome == Outcome::Finished;
            row.core_seconds = finished.then_some(record.loop_seconds * cores);
            row.run_core_seconds = Some(record.wall_seconds * cores);
            row.processor_seconds = Some(record.processor_seconds);
            row.cost = match study.cost {
                Cost::CoreSeconds => row.core_seconds,
                Cost::ProcessorTime => row.processor_seconds.filter(|_| finished),
            };
        }
        let text = io::plain::text(&folder.join("summary.json"), io::plain::LONGEST_CASE)
            .unwrap_or_default();
        let summary: Value = serde_json::from_str(&text).unwrap_or_default();
        let words = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        row.memory = summary["peak_rss_bytes_all_ranks"].as_f64();
        row.steps = summary["steps"].as_u64();
        row.state_hash = words(&summary["state_hash"]);
        row.commit = words(&summary["versions"]["commit"]);
        row
    }

    /// Adds a remark.
    pub(crate) fn add_note(&mut self, note: &str) {
        if !self.note.is_empty() {
            self.note.push_str("; ");
        }
        self.note.push_str(note);
    }

    /// Reads the outputs of a finished member.
    fn read(
        &mut self,
        study: &Study,
        member: &Member,
        study_folder: &Path,
        folder: &Path,
    ) -> Vec<Option<ReadOutput>> {
        let mut named: BTreeMap<&str, f64> = BTreeMap::new();
        let mut all = Vec::new();
        for (name, output) in &study.outputs.0 {
            let known = |word: &str| named.get(word).copied().or_else(|| member.number(word));
            let found = read_output(output, study_folder, folder, &known);
            let found = found
                .map_err(|why| self.add_note(&format!("{name}: {why}")))
                .ok();
            let found = found.filter(|found| match found {
                ReadOutput::Number(number) if !number.is_finite() => {
                    self.add_note(&format!(
                        "{name}: the value is {number}, which is no finite number"
                    ));
                    false
                }
                _ => true,
            });
            if let Some(ReadOutput::Number(number)) = &found {
                named.insert(name, *number);
            }
            self.outputs.push(named.get(name.as_str()).copied());
            all.push(found);
        }
        if let Some(formula) = &study.sound {
            let known = |word: &str| named.get(word).copied().or_else(|| member.number(word));
            match evaluate(formula, &known) {
                Ok(value) if value > 0.0 => {}
                Ok(_) => self.outcome = Outcome::Unsound,
                Err(why) => {
                    self.outcome = Outcome::Unsound;
                    self.add_note(&format!("sound: {why}"));
                }
            }
        }
        all
    }

    fn cells(&self, study: &Study, member: &Member) -> Vec<String> {
        let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:e}"));
        let seconds = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.4}"));
        let mut cells = vec![member.name.clone()];
        cells.extend(
            member
                .labels
                .iter()
                .map(|label| label.clone().unwrap_or_default()),
        );
        cells.extend([
            member.verdict.name().to_owned(),
            self.outcome.name().to_owned(),
        ]);
        for (n, (_, output)) in study.outputs.0.iter().enumerate() {
            if output.over.is_none() {
                cells.push(number(self.outputs.get(n).copied().flatten()));
            }
        }
        for name in study.reference.keys() {
            let (reference, error) = self.errors.get(name).copied().unwrap_or_default();
            cells.extend([number(reference), number(error)]);
        }
        cells.extend([
            number(self.error),
            seconds(self.core_seconds),
            seconds(self.run_core_seconds),
            seconds(self.processor_seconds),
            self.memory
                .map_or(String::new(), |bytes| format!("{bytes:.0}")),
            self.steps.map_or(String::new(), |steps| steps.to_string()),
            yes_or_no(self.pareto_time),
            yes_or_no(self.pareto_memory),
            self.state_hash.clone(),
            self.commit.clone(),
            self.note.clone(),
        ]);
        cells
    }
}

fn yes_or_no(yes: bool) -> String {
    if yes { "yes" } else { "no" }.to_owned()
}

fn read_output(
    output: &Output,
    study_folder: &Path,
    folder: &Path,
    known: &dyn Fn(&str) -> Option<f64>,
) -> Result<ReadOutput, MeasureError> {
    if let Some(formula) = &output.is {
        return Ok(ReadOutput::Number(evaluate(formula, known)?));
    }
    if let Some(over) = &output.over {
        return output
            .measure
            .profile(folder, over, known)
            .map(ReadOutput::Profile);
    }
    output
        .measure
        .number(folder, study_folder, known)
        .map(ReadOutput::Number)
}

/// Reason why an output of a member is not compared with a reference.
#[derive(Debug, thiserror::Error)]
enum ComparisonError {
    /// Reference that cannot be read.
    #[error(transparent)]
    Reference(#[from] MeasureError),
    /// Name of a member without this output.
    #[error("the reference {0} does not have this output")]
    NoOutput(String),
}

/// Comparison of a member with the references.
struct Comparison<'a> {
    study: &'a Study,
    members: &'a [Member],
    study_folder: &'a Path,
    found: &'a [Vec<Option<ReadOutput>>],
    at: usize,
}

impl Comparison<'_> {
    /// Returns the reference, if it is a number, and the error of an output; none if the member has no such output
    /// or is the reference.
    fn error(
        &self,
        name: &str,
        reference: &Reference,
    ) -> Result<(Option<f64>, Option<f64>), ComparisonError> {
        let Some((n, output)) = self.study.outputs.find(name) else {
            return Ok((None, None));
        };
        let member = &self.members[self.at];
        let wanted = match reference {
            Reference::Number(number) => ReadOutput::Number(*number),
            Reference::Formula(formula) => {
                let value = evaluate(formula, &|word| member.number(word));
                ReadOutput::Number(value.map_err(MeasureError::from)?)
            }
            Reference::Found(FoundReference::Table(path)) => {
                ReadOutput::Profile(Profile::read(&self.study_folder.join(path))?)
            }
            Reference::Found(FoundReference::Member(other)) => {
                let other = self.members.iter().position(|m| m.name == *other);
                match self.of_member(other, n)? {
                    Some(found) => found,
                    None => return Ok((None, None)),
                }
            }
            Reference::Found(FoundReference::Finest(field)) => {
                match self.of_member(self.finest(field), n)? {
                    Some(found) => found,
                    None => return Ok((None, None)),
                }
            }
        };
        let mine = self.found[self.at].get(n).cloned().flatten();
        Ok(match (mine, wanted) {
            (Some(ReadOutput::Number(mine)), ReadOutput::Number(wanted)) => {
                // A reference of exactly 0 requires the absolute error.
                let size = if wanted == 0.0 { 1.0 } else { wanted.abs() };
                (Some(wanted), Some((mine - wanted).abs() / size))
            }
            (Some(ReadOutput::Profile(mine)), ReadOutput::Profile(wanted)) => {
                (None, Some(mine.error(&wanted, output.norm)?))
            }
            (_, ReadOutput::Number(wanted)) => (Some(wanted), None),
            _ => (None, None),
        })
    }

    /// Returns an output of another member; none for the member itself.
    fn of_member(
        &self,
        other: Option<usize>,
        output: usize,
    ) -> Result<Option<ReadOutput>, ComparisonError> {
        let other = other.filter(|other| *other != self.at);
        let Some(other) = other else { return Ok(None) };
        let found = self.found[other].get(output).cloned().flatten();
        found
            .map(Some)
            .ok_or_else(|| ComparisonError::NoOutput(self.members[other].name.clone()))
    }

    /// Returns the member with the smallest value of a field among those with the same values of all other
    /// variations.
    fn finest(&self, field: &str) -> Option<usize> {
        let (varied, _) = self.study.vary.find(field)?;
        let mine = &self.members[self.at].labels;
        let alike = self.members.iter().enumerate().filter(|(_, other)| {
            let pairs = other.labels.iter().zip(mine).enumerate();
            pairs
                .filter(|(n, _)| *n != varied)
                .all(|(_, (a, b))| a == b)
        });
        let values = alike.filter_map(|(n, other)| other.value(varied).map(|value| (n, value)));
        values.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(n, _)| n)
    }
}

/// Relative difference below which errors count as equal: such differences come from incomplete convergence of the
/// runs to a steady state.
const SAME_ERROR: f64 = 1e-3;

/// Returns, for each point (cost, error), `true` if no other point is better in one of the two and at least as good
/// in the other.
#[must_use]
pub fn pareto(points: &[Option<(f64, f64)>]) -> Vec<bool> {
    let beats = |a: (f64, f64), b: (f64, f64)| {
        a.0 <= b.0 && a.1 <= b.1 * (1.0 + SAME_ERROR) && (a.0 < b.0 || a.1 < b.1)
    };
    points
        .iter()
        .map(|point| {
            let counts = point.filter(|(cost, error)| cost.is_finite() && error.is_finite());
            counts.is_some_and(|point| !points.iter().flatten().any(|other| beats(*other, point)))
        })
        .collect()
}

/// Returns the name of the processor; `unknown` if the system does not report it.
#[must_use]
pub fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("model name"));
    let name = line.and_then(|line| line.split_once(':'));
    name.map_or("unknown", |(_, name)| name.trim()).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pareto_set_is_what_nothing_beats() {
        let points = [
            Some((1.0, 0.5)),
            Some((2.0, 0.1)),
            Some((2.0, 0.2)),
            Some((3.0, 0.099_95)),
            Some((0.5, f64::NAN)),
            None,
            Some((4.0, 0.01)),
            Some((4.0, 0.01)),
        ];
        let expected = [true, true, false, false, false, false, true, true];
        assert_eq!(pareto(&points), expected);
    }

    #[test]
    fn cells_with_commas_and_quotes_are_quoted() {
        let mut text = String::new();
        push_line(&mut text, ["a,b", "say \"x\"", "c"]);
        assert_eq!(text, "\"a,b\",\"say \"\"x\"\"\",c\n");
    }
}
