//! Environment variables that libraries read at the start of the program.
//!
//! A rank of Open MPI polls for messages without pause. On a core shared with another rank or program, the polling
//! rank uses the time that its partner needs to answer. With `mpi_yield_when_idle` (Open MPI manual, section on MCA
//! parameters) an idle rank yields its core at each poll, which costs nothing on a core of its own.

use std::ffi::OsString;

/// Variable of Open MPI that makes a waiting rank yield its core.
const YIELD: &str = "OMPI_MCA_mpi_yield_when_idle";
/// Variable with the number of ranks of the job, set by Open MPI.
const RANKS: &str = "OMPI_COMM_WORLD_SIZE";

/// Requests that waiting ranks of Open MPI yield their cores, if the job has several ranks and
/// `OMPI_MCA_mpi_yield_when_idle` is not set.
///
/// # Safety
/// No other thread may exist: call it first of all.
pub unsafe fn yield_when_idle() {
    if should_yield(std::env::var_os(RANKS), std::env::var_os(YIELD)) {
        // SAFETY: no other thread reads or writes the environment, as the caller promises.
        unsafe { std::env::set_var(YIELD, "1") };
    }
}

/// Returns `true` if the job has several ranks and the variable is not set.
fn should_yield(ranks: Option<OsString>, now: Option<OsString>) -> bool {
    ranks.is_some_and(|ranks| ranks != "1") && now.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_of_a_job_yield_unless_it_is_stated() {
        let text = |text: &str| Some(OsString::from(text));
        assert!(should_yield(text("2"), None));
        assert!(!should_yield(text("2"), text("0")) && !should_yield(text("2"), text("1")));
        assert!(!should_yield(text("1"), None) && !should_yield(None, None));
    }
}
