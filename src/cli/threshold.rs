//! `solver threshold`: arguments and output of the search for a threshold.

use super::{first_rank, pretty, print, report_problems, walltime};
use base::error::Error;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;
use studies::threshold::{self, Threshold};

/// Arguments of the search for a threshold.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Study file: base case, searched field with its interval, outputs and criterion.
    study: PathBuf,
    /// Output folder [default: next to the study, with its name].
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Stop before this wall-clock time has passed. The same command continues later.
    #[arg(long, value_name = "H:M:S", value_parser = walltime)]
    max_walltime: Option<Duration>,
    /// Only list the members at both ends and their costs.
    #[arg(long, conflicts_with = "json")]
    list: bool,
    /// Print the result as JSON, and nothing else.
    #[arg(long)]
    json: bool,
}

/// Runs a search, whose members are separate processes. If several ranks were started, only the first one runs them.
///
/// # Errors
/// If the search fails, its error.
pub(super) fn command(arguments: Arguments) -> Result<(), Error> {
    if !first_rank() {
        return Ok(());
    }
    let Arguments {
        study,
        output,
        max_walltime,
        list,
        json,
    } = arguments;
    let options = Threshold {
        study,
        output,
        max_walltime,
    };
    // A reader that has closed the output is no reason to stop.
    let report = |line: &str| {
        if !json {
            drop(print(line));
        }
    };
    if list {
        return report_problems(threshold::list(&options, &report));
    }
    let found = threshold::command(&options, &report);
    let printed = found.and_then(|found| if json { print(&pretty(&found)) } else { Ok(()) });
    report_problems(printed)
}
