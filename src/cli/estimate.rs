//! `solver estimate`, and its costs in `solver plan`.

use super::{
    CaseArgs, Stability, first_rank, folder_of, list, prepare, pretty, print, print_verdict,
    report_with_verdict, usage, walltime,
};
use base::error::Error;
use clap::{Args, value_parser};
use plan::Plan;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Duration;
use studies::sweep::study::Run;
use studies::uncertainty::{self, Members, Options};

/// Options of an estimate.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    case: CaseArgs,
    #[command(flatten)]
    stability: Stability,
    /// Use one grid that is finer than that of the case, and one that is coarser. Default: two coarser ones.
    #[arg(long)]
    finer: bool,
    /// Only vary the cells, no settings of models.
    #[arg(long)]
    cells_only: bool,
    /// `true` if the closed ends of a seepage move away in one more run.
    #[arg(
        long,
        help = "Add a run with the closed ends of the seepage farther away, to measure how much they change the \
                results"
    )]
    ends: bool,
    /// Folder of the runs [default: results/NAME-OF-THE-CASE-estimate].
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Runs at the same time.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u32).range(1..=1024))]
    jobs: u32,
    /// MPI ranks of each run.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = value_parser!(u32).range(1..=100_000))]
    ranks: u32,
    /// Threads per rank, at most 1024 [default: cores of the machine divided by runs and ranks].
    #[arg(long, value_parser = usage::threads)]
    threads: Option<u16>,
    /// Stop before this wall-clock time has passed. The same command continues later.
    #[arg(long, value_name = "H:M:S", value_parser = walltime)]
    max_walltime: Option<Duration>,
}

/// Runs an estimate, whose runs are separate processes like the members of a sweep.
pub(super) fn command(arguments: Arguments) -> Result<(), Error> {
    if !first_rank() {
        return Ok(());
    }
    let Arguments {
        case,
        stability,
        finer,
        cells_only,
        ends,
        output,
        jobs,
        ranks,
        threads,
        max_walltime,
    } = arguments;
    let plan = prepare(&case)?;
    if !case.json {
        list(&plan.warnings);
    }
    print_verdict(&plan.warnings, &case, stability)?;
    let usual = || {
        let mut folder = folder_of(&case.case).into_os_string();
        folder.push("-estimate");
        folder.into()
    };
    let options = Options {
        output: output.unwrap_or_else(usual),
        finer,
        settings: !cells_only,
        ends,
        run: Run {
            ranks,
            threads: threads_of_each(threads, jobs, ranks),
            at_once: jobs,
            time_limit: None,
        },
        max_walltime,
        allow_unstable: stability.allow_unstable,
    };
    let report = |line: &str| {
        if !case.json {
            // A reader that has closed the output is no reason to stop.
            drop(print(line));
        }
    };
    let outcome = uncertainty::command(&plan, &options, &report).and_then(|table| {
        if case.json {
            print(&pretty(&table.json()))?;
        }
        Ok(())
    });
    report_with_verdict(outcome, &case.case)
}

/// Returns the number of threads of each rank: as given, otherwise the rank's share of the cores of this machine.
fn threads_of_each(asked: Option<u16>, jobs: u32, ranks: u32) -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cores = u32::try_from(cores).unwrap_or(1);
    let share = || (cores / jobs.saturating_mul(ranks)).clamp(1, 1024);
    asked.map_or_else(share, u32::from)
}

/// Returns the cost of an estimate of a plan, or the reason why an estimate is not possible.
pub(super) fn costs(plan: &Plan, stability: Stability) -> String {
    match Members::for_case(plan, false, true, stability.allow_unstable) {
        Ok(members) => members.cost_lines(),
        Err(error) => format!(
            "\n`solver estimate` is not possible: {}",
            first_reason(&error)
        ),
    }
}

/// Returns the cost of an estimate as JSON.
pub(super) fn costs_as_data(plan: &Plan, stability: Stability) -> Value {
    match Members::for_case(plan, false, true, stability.allow_unstable) {
        Ok(members) => members.cost_json(),
        Err(error) => json!({"impossible": first_reason(&error)}),
    }
}

/// Returns the first reason.
fn first_reason(error: &Error) -> String {
    match error {
        Error::Case(problems) => problems
            .first()
            .map_or_else(String::new, ToString::to_string),
        other => other.to_string(),
    }
}
