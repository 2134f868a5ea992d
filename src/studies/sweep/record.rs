//! Outcome and cost of a member: `member.json` in its folder.

use super::members::Member;
use base::error::Error;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Outcome of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The run reached its end.
    Finished,
    /// The run reached its end, but violates the condition `sound` of the study.
    Unsound,
    /// The plan, or the run itself, refused the case (exit code 3).
    Refused,
    /// The run ended with a numerical failure (exit code 4).
    NumericalRefusal,
    /// The run failed for another reason, such as a full disk or a signal.
    Failed,
    /// The run exceeded its time limit.
    TimeLimit,
    /// The run was stopped from outside and can be continued.
    Stopped,
    /// The run is in progress, or was killed.
    Running,
    /// The member has not been run.
    Missing,
}

impl Outcome {
    /// Returns the outcome of an exit code.
    #[must_use]
    pub fn of_code(code: Option<i32>) -> Self {
        match code {
            Some(0) => Self::Finished,
            Some(3) => Self::Refused,
            Some(4) => Self::NumericalRefusal,
            Some(75) => Self::Stopped,
            _ => Self::Failed,
        }
    }

    /// Returns the name used in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Unsound => "unsound",
            Self::Refused => "refused",
            Self::NumericalRefusal => "numerical refusal",
            Self::Failed => "failed",
            Self::TimeLimit => "time limit",
            Self::Stopped => "stopped",
            Self::Running => "running",
            Self::Missing => "missing",
        }
    }

    /// Returns `true` if another run would give the same outcome.
    fn is_final(self) -> bool {
        matches!(
            self,
            Self::Finished | Self::Refused | Self::NumericalRefusal | Self::TimeLimit
        )
    }
}

/// Outcome of a member and the total cost of its attempts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Outcome of the member.
    pub outcome: Outcome,
    /// Last error message, if the run did not finish.
    pub message: String,
    /// Hash of the member's case.
    pub case_hash: String,
    /// Version of the program.
    pub solver: String,
    /// Time limit of the run \[s\].
    pub time_limit: Option<f64>,
    /// Wall time of the steps \[s\].
    pub loop_seconds: f64,
    /// Total wall time \[s\].
    pub wall_seconds: f64,
    /// Processor time of all ranks on this machine \[s\].
    pub processor_seconds: f64,
    /// `true` if the times include all attempts; `false` if one was killed.
    pub timed: bool,
}

impl Record {
    /// Returns the record before the first attempt.
    #[must_use]
    pub fn new(case_hash: &str, solver: &str, time_limit: Option<f64>) -> Self {
        Self {
            outcome: Outcome::Running,
            message: String::new(),
            case_hash: case_hash.to_owned(),
            solver: solver.to_owned(),
            time_limit,
            loop_seconds: 0.0,
            wall_seconds: 0.0,
            processor_seconds: 0.0,
            timed: true,
        }
    }

    /// Returns the record in a folder; none if there is no readable record.
    #[must_use]
    pub fn read(folder: &Path) -> Option<Self> {
        let text = io::plain::text(&folder.join(FILE), io::plain::LONGEST_CASE).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Writes the record into a folder.
    ///
    /// # Errors
    /// If the file cannot be written, [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        io::atomic::write_json(&folder.join(FILE), self).map_err(|e| Error::Io(e.to_string()))
    }

    /// Returns `true` if the record belongs to this case and this version of the program.
    #[must_use]
    pub fn is_of(&self, member: &Member, solver: &str) -> bool {
        let prepared = member.prepared.as_ref();
        prepared.is_some_and(|p| p.hash == self.case_hash) && self.solver == solver
    }

    /// Returns `true` if the member need not be run again.
    #[must_use]
    pub fn holds(&self, member: &Member, solver: &str, time_limit: Option<f64>) -> bool {
        let longer = self.outcome == Outcome::TimeLimit
            && time_limit.unwrap_or(f64::INFINITY) > self.time_limit.unwrap_or(f64::INFINITY);
        self.is_of(member, solver) && self.outcome.is_final() && !longer
    }
}

/// Name of the file with the record, in the folder of the member.
pub const FILE: &str = "member.json";
