//! `solver threshold study.json`: the value of a field at which a criterion changes, by sections of an interval.
//!
//! | step | module |
//! |---|---|
//! | the search as written, its schema | [`study`] |
//! | the values of the next round | [`crate::section`] |
//! | members, their processes and records | [`crate::sweep`] |
//!
//! The members of a round run side by side. A member that did not reach its end, or whose outputs cannot be read, has
//! no verdict and narrows no interval. `threshold.csv` has a row for each member, `threshold.json` the result. A
//! repeated command reads the finished members, resumes a stopped one and continues.

pub mod study;

use crate::section::{self, Bracket, Round, TriedValue};
use crate::sweep::members::{Member, members};
use crate::sweep::outputs::unknown;
use crate::sweep::record::Outcome;
use crate::sweep::runner::Runner;
use crate::sweep::study::Refused;
use crate::sweep::table::{MemberRow, SweepTable, machine};
use crate::sweep::{LineReport, enough_cores};
use analysis::expression::evaluate;
use base::error::{Error, Problem};
use io::csv::push_line;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
use study::ThresholdStudy;

/// Options of a search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Threshold {
    /// Study file.
    pub study: PathBuf,
    /// Output folder; none for a folder next to the study, with the study's name.
    pub output: Option<PathBuf>,
    /// Wall-clock time after which members are stopped.
    pub max_walltime: Option<Duration>,
}

/// Kind of result of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ThresholdResult {
    /// The criterion changes in the interval.
    Threshold,
    /// The criterion is true at both ends.
    TrueAtBothEnds,
    /// The criterion is false at both ends.
    FalseAtBothEnds,
    /// Members without a verdict prevent a result.
    Undecided,
}

/// Result of a search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SearchOutcome {
    /// Path of the searched field.
    pub field: String,
    /// Criterion, as a formula.
    pub criterion: String,
    /// Kind of the result.
    pub result: ThresholdResult,
    /// Value next to the threshold at which the criterion is false.
    pub false_at: Option<f64>,
    /// Value next to the threshold at which the criterion is true.
    pub true_at: Option<f64>,
    /// Number of members of the search.
    pub members: usize,
    /// Number of members without a verdict.
    pub without_verdict: usize,
    /// Number of changes of the criterion along the values tried; the result is the first of them.
    pub changes: usize,
}

/// Member with its verdict.
struct Trial {
    value: f64,
    member: Member,
    row: MemberRow,
    verdict: Option<bool>,
}

/// Carries out a search; `report` receives the lines to print.
///
/// # Errors
/// If the study is invalid, with all problems before any member runs; if a signal ended the search,
/// [`Error::Stopped`]; if members failed, [`Error::Io`]; if no result follows from the members, [`Error::Numerical`].
pub fn command(options: &Threshold, report: LineReport<'_>) -> Result<SearchOutcome, Error> {
    let ReadStudy {
        study,
        folder: study_folder,
        output,
    } = read(options)?;
    ends(&study, study_folder).map_err(Error::Case)?;
    enough_cores(&study.run)?;
    let allowed = study.refused == Refused::Run;
    let runner = Runner::new(&study.run, allowed, &output, options.max_walltime, report)?;
    let mut search = Search {
        study: &study,
        study_folder,
        output: &output,
        trials: Vec::new(),
    };
    let section = study.section();
    let end = loop {
        match section.next(&search.tried_values()) {
            Round::Try(values) => search.run_round(&values, &runner, report)?,
            end => break end,
        }
    };
    let found = search.found(&end);
    io::atomic::write_json(&output.join("threshold.json"), &found)
        .map_err(|e| Error::Io(e.to_string()))?;
    for line in found.lines(&output) {
        report(&line);
    }
    search.check()?;
    if found.result == ThresholdResult::Undecided {
        return Err(Error::Numerical(format!(
            "{} of {} members have no verdict, so that the threshold of {} is not found; threshold.csv has the reasons",
            found.without_verdict, found.members, found.field
        )));
    }
    Ok(found)
}

/// Study as read from its file.
struct ReadStudy<'a> {
    study: ThresholdStudy,
    /// Folder of the study.
    folder: &'a Path,
    /// Folder of the results.
    output: PathBuf,
}

/// Reads a study.
fn read(options: &Threshold) -> Result<ReadStudy<'_>, Error> {
    let file = &options.study;
    let text = io::plain::text(file, io::plain::LONGEST_CASE)
        .map_err(|e| Error::Io(format!("the study: {e}")))?;
    let study = ThresholdStudy::read(&text).map_err(Error::Case)?;
    Ok(ReadStudy {
        study,
        folder: file.parent().unwrap_or(Path::new("")),
        output: (options.output.clone()).unwrap_or_else(|| file.with_extension("")),
    })
}

/// Returns the members at both ends of the interval, without running them; relative paths in the study start at
/// `study_folder`.
///
/// # Errors If a case of these members or a name in the criterion is invalid, with all problems.
pub fn ends(study: &ThresholdStudy, study_folder: &Path) -> Result<Vec<Member>, Vec<Problem>> {
    let mut ends = members(&study.with_values(&[study.search.from]), study_folder)?;
    // After the first, so that a fault of both is reported once.
    ends.extend(members(
        &study.with_values(&[study.search.to]),
        study_folder,
    )?);
    let outputs: Vec<&str> = (study.outputs.0.iter())
        .map(|(name, _)| name.as_str())
        .collect();
    let known =
        |word: &str| outputs.contains(&word) || ends.iter().all(|m| m.number(word).is_some());
    match unknown("criterion", &study.criterion, &[], &known) {
        Some(problem) => Err(vec![problem]),
        None => Ok(ends),
    }
}

/// Lists the members at both ends with their planned costs; nothing is run.
///
/// # Errors
/// If the study is invalid, with all problems.
pub fn list(options: &Threshold, report: LineReport<'_>) -> Result<(), Error> {
    let ReadStudy { study, folder, .. } = read(options)?;
    for member in ends(&study, folder).map_err(Error::Case)? {
        let cost = member.prepared.as_ref().map_or_else(
            || "not run".to_owned(),
            |prepared| {
                let megabytes = prepared.memory / 1e6;
                format!("{:.1} core-s {megabytes:.0} MB", prepared.seconds)
            },
        );
        report(&format!(
            "{}  {cost}  {}",
            member.name,
            member.verdict.name()
        ));
    }
    let parts = study.section().parts;
    report(&format!(
        "each further round has {} members between them",
        parts - 1
    ));
    Ok(())
}

/// Members that have been run.
struct Search<'a> {
    study: &'a ThresholdStudy,
    study_folder: &'a Path,
    output: &'a Path,
    trials: Vec<Trial>,
}

impl Search<'_> {
    fn tried_values(&self) -> Vec<TriedValue> {
        let tried = self.trials.iter().map(|trial| (trial.value, trial.verdict));
        tried.collect()
    }

    /// Runs the members of a round and adds them to the table.
    fn run_round(
        &mut self,
        values: &[f64],
        runner: &Runner<'_>,
        report: LineReport<'_>,
    ) -> Result<(), Error> {
        let study = self.study.with_values(values);
        let members = members(&study, self.study_folder).map_err(Error::Case)?;
        let outcome = runner.run(&members);
        let table = SweepTable::collect(&study, &members, self.study_folder, self.output);
        for ((value, member), mut row) in values.iter().zip(members).zip(table.rows) {
            let verdict = verdict(self.study, &member, &mut row);
            if outcome.is_ok() {
                let text = verdict.map_or("no verdict".to_owned(), |verdict| verdict.to_string());
                report(&format!(
                    "{}: {}: {text}",
                    member.name, self.study.criterion
                ));
            }
            self.trials.push(Trial {
                value: *value,
                member,
                row,
                verdict,
            });
        }
        io::atomic::write(&self.output.join("threshold.csv"), self.to_csv().as_bytes())
            .map_err(|e| Error::Io(e.to_string()))?;
        outcome
    }

    /// Returns a row for each member in the order of the rounds.
    fn to_csv(&self) -> String {
        let mut text = format!("# {}, {}\n", self.study.title.replace('\n', " "), machine());
        let field = self.study.search.field.as_str();
        let mut header = vec!["member", field, "plan", "outcome"];
        header.extend(self.study.outputs.0.iter().map(|(name, _)| name.as_str()));
        header.extend([
            "criterion",
            "core-seconds of the run",
            "state_hash",
            "commit",
            "note",
        ]);
        push_line(&mut text, &header);
        for Trial {
            value,
            member,
            row,
            verdict,
        } in &self.trials
        {
            let mut cells = vec![
                member.name.clone(),
                value.to_string(),
                member.verdict.name().to_owned(),
                row.outcome.name().to_owned(),
            ];
            let none = vec![None; self.study.outputs.0.len()];
            let outputs = if row.outputs.is_empty() {
                &none
            } else {
                &row.outputs
            };
            cells.extend(
                outputs
                    .iter()
                    .map(|x| x.map_or(String::new(), |x| format!("{x:e}"))),
            );
            cells.extend([
                verdict.map_or(String::new(), |verdict| verdict.to_string()),
                row.run_core_seconds
                    .map_or(String::new(), |x| format!("{x:.4}")),
                row.state_hash.clone(),
                row.commit.clone(),
                row.note.clone(),
            ]);
            push_line(&mut text, cells);
        }
        text
    }

    fn found(&self, end: &Round) -> SearchOutcome {
        let (result, bracket) = match end {
            Round::Found(bracket) => (ThresholdResult::Threshold, Some(*bracket)),
            Round::SameVerdict(true) => (ThresholdResult::TrueAtBothEnds, None),
            Round::SameVerdict(false) => (ThresholdResult::FalseAtBothEnds, None),
            Round::Undecided(bracket) => (ThresholdResult::Undecided, *bracket),
            Round::Try(_) => (ThresholdResult::Undecided, None),
        };
        let end = |upper: bool| {
            bracket.map(|Bracket { ends, rises }| if rises == upper { ends[1] } else { ends[0] })
        };
        let without = self.trials.iter().filter(|trial| trial.verdict.is_none());
        SearchOutcome {
            field: self.study.search.field.clone(),
            criterion: self.study.criterion.clone(),
            result,
            false_at: end(false),
            true_at: end(true),
            members: self.trials.len(),
            without_verdict: without.count(),
            changes: section::changes(&self.tried_values()),
        }
    }

    /// Returns an error for members that ended neither normally nor on request.
    fn check(&self) -> Result<(), Error> {
        let failed = self
            .trials
            .iter()
            .filter(|trial| trial.row.outcome == Outcome::Failed);
        let failed: Vec<String> = failed
            .map(|trial| format!("{} ({})", trial.member.name, trial.row.note))
            .collect();
        if failed.is_empty() {
            return Ok(());
        }
        Err(Error::Io(format!(
            "{} of {} members failed: {}",
            failed.len(),
            self.trials.len(),
            failed[..failed.len().min(5)].join(", ")
        )))
    }
}

/// Returns the verdict of a member on the criterion; none if the member did not end or an output of the criterion is
/// missing or not finite.
fn verdict(study: &ThresholdStudy, member: &Member, row: &mut MemberRow) -> Option<bool> {
    if row.outcome != Outcome::Finished {
        return None;
    }
    let outputs = study.outputs.0.iter().zip(&row.outputs);
    let found = outputs.filter_map(|((name, _), value)| Some((name.as_str(), (*value)?)));
    // An output that the criterion does not use may be missing.
    let named: Vec<_> = found.filter(|(_, value)| value.is_finite()).collect();
    let known = |word: &str| {
        let output = named.iter().find(|(name, _)| *name == word);
        let is_output = study.outputs.find(word).is_some();
        let number = || member.number(word).filter(|_| !is_output);
        output.map(|(_, value)| *value).or_else(number)
    };
    match evaluate(&study.criterion, &known) {
        Ok(value) if value.is_finite() => Some(value > 0.0),
        Ok(value) => {
            row.add_note(&format!("criterion is {value}"));
            None
        }
        Err(why) => {
            row.add_note(&format!("criterion: {why}"));
            None
        }
    }
}

impl SearchOutcome {
    /// Returns the lines that report the result.
    fn lines(&self, output: &Path) -> Vec<String> {
        let (field, criterion) = (&self.field, &self.criterion);
        let mut lines = vec![match (self.result, self.false_at, self.true_at) {
            (ThresholdResult::TrueAtBothEnds, ..) => format!(
                "{field}: `{criterion}` is true at both ends of the interval; move the end where it should be false"
            ),
            (ThresholdResult::FalseAtBothEnds, ..) => format!(
                "{field}: `{criterion}` is false at both ends of the interval; move the end where it should be true"
            ),
            (_, Some(no), Some(yes)) => {
                let undecided = if self.result == ThresholdResult::Undecided {
                    ", wider than the tolerance because members between them have no verdict"
                } else {
                    ""
                };
                format!("{field}: `{criterion}` is false at {no} and true at {yes}{undecided}")
            }
            _ => format!("{field}: an end of the interval has no verdict on `{criterion}`"),
        }];
        if self.changes > 1 {
            lines.push(format!(
                "the criterion changes {} times along the values tried; this is the first change above `search.from`",
                self.changes
            ));
        }
        lines.push(format!(
            "{} members, {} without a verdict; threshold.csv, threshold.json in {}",
            self.members,
            self.without_verdict,
            output.display()
        ));
        lines
    }
}
