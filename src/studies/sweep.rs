//! `solver sweep study.json`: runs the members of a study, one after another or in parallel, and writes a table of
//! error against cost with the Pareto set.
//!
//! | step | module |
//! |---|---|
//! | the study as written, its schema | [`study`] |
//! | members drawn instead of combined | [`latin_hypercube`] |
//! | problems of a study | `problems` |
//! | every member's case, checked before any member runs | [`members`] |
//! | a member as a process of this program; stopped members are resumed | [`runner`] |
//! | outcome and cost of a member, in its folder | [`record`] |
//! | outputs, errors, Pareto sets, `members.csv` | [`table`] |
//! | means and intervals over seeds, `ensemble.csv` | [`ensemble`] |
//! | `sweep.svg` and `map.svg` | [`picture`] |
//! | a job array for Slurm | [`slurm`] |
//!
//! The output folder holds a folder for each member, named by its varied values. A member is not run again if its
//! folder holds the record of the same case and the same version of the program.

pub mod ensemble;
pub mod latin_hypercube;
pub mod members;
pub(crate) mod outputs;
pub mod picture;
pub(crate) mod problems;
pub mod record;
pub mod runner;
pub mod slurm;
pub mod study;
pub mod table;

use base::error::{Error, Problem, Severity, controls};
use members::Member;
use record::Record;
use runner::{Runner, solver_version};
use std::path::{Path, PathBuf};
use std::time::Duration;
use study::{Refused, Run, Study};

/// Options of a sweep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sweep {
    /// Study file.
    pub study: PathBuf,
    /// Output folder; none for a folder next to the study, with the study's name.
    pub output: Option<PathBuf>,
    /// Task of the sweep.
    pub task: Task,
    /// Wall-clock time after which members are stopped.
    pub max_walltime: Option<Duration>,
}

/// Task of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Run the missing members, then write the table.
    Run,
    /// List the members with their costs and states.
    List,
    /// Run one member, given by its number in the list.
    Member(usize),
    /// Write the table from the finished members.
    Collect,
    /// Print the script of a job array.
    Slurm,
}

/// Function that receives the lines to print.
pub type LineReport<'a> = &'a dyn Fn(&str);

/// Carries out a sweep; `report` receives the lines to print.
///
/// # Errors
/// If the study is invalid, with all problems before any member runs; if a signal ended it, [`Error::Stopped`].
pub fn command(sweep: &Sweep, report: LineReport<'_>) -> Result<(), Error> {
    let file = &sweep.study;
    let text = io::plain::text(file, io::plain::LONGEST_CASE)
        .map_err(|e| Error::Io(format!("the study: {e}")))?;
    let study_folder = file.parent().unwrap_or(Path::new(""));
    let study = Study::read(&text).map_err(Error::Case)?;
    let members = members::members(&study, study_folder).map_err(Error::Case)?;
    let output = (sweep.output.clone()).unwrap_or_else(|| file.with_extension(""));
    log::debug!(
        "study {}: {} members, {} outputs, into {}",
        file.display(),
        members.len(),
        study.outputs.0.len(),
        output.display()
    );
    match sweep.task {
        Task::List => list(&study, &members, &output, report),
        Task::Slurm => {
            for path in [file, &output] {
                let text = path.display().to_string();
                if text.chars().any(controls) {
                    return Err(one_problem(
                        "the study",
                        format!("{text:?}"),
                        "its path contains a line break or another control character, which would break the \
                         script".into(),
                        "rename it, or choose another --output".into(),
                    ));
                }
            }
            report(&slurm::script(&study, members.len(), file, &output));
            Ok(())
        }
        Task::Collect => collect(&study, &members, study_folder, &output, report),
        Task::Member(number) => {
            let chosen = number.checked_sub(1).and_then(|n| members.get(n));
            let member = chosen.ok_or_else(|| {
                one_problem(
                    "--member",
                    number.to_string(),
                    format!("the study has {} members", members.len()),
                    format!("use 1 to {}", members.len()),
                )
            })?;
            run(&study, std::slice::from_ref(member), &output, sweep, report)?;
            check_ends(std::slice::from_ref(member), &output)
        }
        Task::Run => {
            enough_cores(&study.run)?;
            run(&study, &members, &output, sweep, report)?;
            collect(&study, &members, study_folder, &output, report)?;
            check_ends(&members, &output)
        }
    }
}

/// Returns an error for members that ended neither normally nor on request, for example by a signal, a full disk or
/// an internal error.
///
/// # Errors
/// If there are such members, [`Error::Io`] with their names and reasons.
pub(crate) fn check_ends(members: &[Member], output: &Path) -> Result<(), Error> {
    let failed: Vec<String> = members
        .iter()
        .filter_map(|member| {
            let record = Record::read(&output.join(&member.name))?;
            let failed = record.outcome == record::Outcome::Failed;
            failed.then(|| format!("{} ({})", member.name, record.message))
        })
        .collect();
    if failed.is_empty() {
        return Ok(());
    }
    let shown = failed[..failed.len().min(5)].join(", ");
    Err(Error::Io(format!(
        "{} of {} members failed: {shown}",
        failed.len(),
        members.len()
    )))
}

fn one_problem(path: &str, value: String, reason: String, remedy: String) -> Error {
    Error::Case(vec![Problem {
        path: path.into(),
        value,
        reason,
        remedy: remedy.into(),
        severity: Severity::Error,
    }])
}

/// Refuses members that would share a core, because their cost would not be meaningful.
///
/// # Errors
/// If the members need more cores than the machine has, [`Error::Case`] with the three numbers.
pub fn enough_cores(run: &Run) -> Result<(), Error> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let used = run.at_once as usize * run.ranks as usize * run.threads as usize;
    if used <= cores {
        return Ok(());
    }
    Err(one_problem(
        "run",
        format!(
            "{} at once x {} ranks x {} threads",
            run.at_once, run.ranks, run.threads
        ),
        format!(
            "this needs {used} cores, but the machine has {cores}: members that share a core have no meaningful \
             cost"
        ),
        "reduce one of the three numbers".into(),
    ))
}

fn run(
    study: &Study,
    members: &[Member],
    output: &Path,
    sweep: &Sweep,
    report: LineReport<'_>,
) -> Result<(), Error> {
    let allowed = study.refused == Refused::Run;
    let runner = Runner::new(&study.run, allowed, output, sweep.max_walltime, report)?;
    runner.run(members)
}

fn list(
    study: &Study,
    members: &[Member],
    output: &Path,
    report: LineReport<'_>,
) -> Result<(), Error> {
    let limit = study.run.time_limit;
    let version = solver_version()?;
    let width = members.iter().map(|m| m.name.len()).max().unwrap_or(0);
    let mut seconds = 0.0;
    for (n, member) in members.iter().enumerate() {
        let record = Record::read(&output.join(&member.name));
        let state = match record.filter(|record| record.holds(member, &version, limit)) {
            Some(record) => record.outcome.name(),
            None if member.prepared.is_some() => "to be run",
            None => "not to be run",
        };
        let line = match &member.prepared {
            Some(prepared) => {
                seconds += prepared.seconds;
                format!(
                    "{:10.1} core-s {:8.0} MB",
                    prepared.seconds,
                    prepared.memory / 1e6
                )
            }
            None => format!("{:29}", "not run"),
        };
        report(&format!(
            "{:4}  {:width$}  {line}  {:19}  {state}",
            n + 1,
            member.name,
            member.verdict.name()
        ));
    }
    report(&format!(
        "{} members, planned cost about {seconds:.0} core-seconds",
        members.len()
    ));
    Ok(())
}

fn collect(
    study: &Study,
    members: &[Member],
    study_folder: &Path,
    output: &Path,
    report: LineReport<'_>,
) -> Result<(), Error> {
    let table = table::SweepTable::collect(study, members, study_folder, output);
    let mut files = vec![
        ("members.csv", table.to_csv(study, members)),
        (
            "sweep.svg",
            picture::cost_figure(study, members, &table).to_svg(),
        ),
    ];
    if let Some(name) = &study.ensemble {
        let ensemble = ensemble::Ensemble::from_table(name, study, members, &table);
        report(&ensemble.summary());
        files.push(("ensemble.csv", ensemble.to_csv(study)));
    }
    if let Some(axes) = &study.map {
        let map = picture::Map::from_table(axes, study, members, &table);
        report(&map.agreement_table());
        files.push(("map.csv", map.to_csv()));
        files.push(("map.svg", map.figure().to_svg()));
    }
    std::fs::create_dir_all(output).map_err(|e| Error::Io(format!("{}: {e}", output.display())))?;
    for (name, text) in &files {
        io::atomic::write(&output.join(name), text.as_bytes())
            .map_err(|e| Error::Io(e.to_string()))?;
    }
    report(&table.summary(members));
    let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    report(&format!("{} in {}", names.join(", "), output.display()));
    Ok(())
}
