//! Environment with which the program starts again: variables that libraries read before the first line of the program
//! runs.
//!
//! **Huge pages** for the small blocks of memory that the program allocates; the large ones have pages of their own
//! ([`crate::allocator`]). The maps of bodies are thousands of small blocks, 10 MB together for 343 spheres in water,
//! which every step reads once. In pages of 4 KiB the processor waits for the translation of addresses: the mapping
//! takes half as long again. The allocator of glibc (2.35 and later) advises huge pages only if the environment says so
//! before the program starts (`glibc.malloc.hugetlb=1`, the tunables of the GNU C library manual).
//!
//! **Waits that give the core away.** A rank of Open MPI polls for messages without pause. On a core that it shares
//! with another rank or program, it takes the time that its partner needs to answer. With `mpi_yield_when_idle` (Open
//! MPI manual, section on MCA parameters) an idle rank yields its core at each poll, which costs nothing on a core of
//! its own.

use std::ffi::OsString;

/// The variable that the allocator reads, and its word for advice.
const VARIABLE: &str = "GLIBC_TUNABLES";
const NAME: &str = "glibc.malloc.hugetlb";

/// File in which Linux states which processes get huge pages.
const SWITCH: &str = "/sys/kernel/mm/transparent_hugepage/enabled";

/// Variable of Open MPI by which a rank that waits yields its core.
const YIELD: &str = "OMPI_MCA_mpi_yield_when_idle";
/// Number of ranks of the job, as Open MPI sets it.
const RANKS: &str = "OMPI_COMM_WORLD_SIZE";

/// Starts the program again in the same process with the variables that it lacks: tunables where the operating system
/// gives huge pages on request, yields for ranks of a job. Returns where all are there
/// (`GLIBC_TUNABLES=glibc.malloc.hugetlb=0` and `OMPI_MCA_mpi_yield_when_idle=0` turn them off), and where the program
/// cannot be started again. Call it first of all. Debuggers and tools that count instructions follow the first start
/// alone: turn it off for them.
pub fn ask() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        use std::os::unix::process::CommandExt;
        let given = std::fs::read_to_string(SWITCH).unwrap_or_default();
        let tunables = tunables(&given, std::env::var_os(VARIABLE));
        let yields = yields(std::env::var_os(RANKS), std::env::var_os(YIELD));
        if tunables.is_none() && !yields {
            return;
        }
        let mut words = std::env::args_os();
        let (Ok(program), Some(name)) = (std::env::current_exe(), words.next()) else {
            return;
        };
        let mut again = std::process::Command::new(program);
        again.arg0(name).args(words);
        again.envs(tunables.map(|tunables| (VARIABLE, tunables)));
        again.envs(yields.then_some((YIELD, "1")));
        // It returns only if it failed: then the process continues unchanged.
        let _ = again.exec();
    }
}

/// Returns `true` if the ranks of a job do not know whether to yield.
fn yields(ranks: Option<OsString>, now: Option<OsString>) -> bool {
    ranks.is_some_and(|ranks| ranks != "1") && now.is_none()
}

/// Returns the tunables with the word, given the switch of the system; none if there is nothing to ask for.
fn tunables(switch: &str, now: Option<OsString>) -> Option<OsString> {
    let word = format!("{NAME}=1");
    if !switch.contains("[madvise]") {
        return None;
    }
    let Some(mut all) = now.filter(|now| !now.is_empty()) else {
        return Some(word.into());
    };
    if all.to_string_lossy().contains(NAME) {
        return None;
    }
    all.push(":");
    all.push(word);
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_of_a_job_yield_unless_it_is_stated() {
        let text = |text: &str| Some(OsString::from(text));
        assert!(yields(text("2"), None));
        assert!(!yields(text("2"), text("0")) && !yields(text("2"), text("1")));
        assert!(!yields(text("1"), None) && !yields(None, None));
    }

    #[test]
    fn asked_for_once_and_where_it_helps() {
        let on = "always [madvise] never";
        let word = || Some(OsString::from("glibc.malloc.hugetlb=1"));
        assert_eq!(tunables(on, None), word());
        assert_eq!(tunables(on, Some(OsString::new())), word());
        assert_eq!(tunables(on, word()), None);
        assert_eq!(tunables(on, Some("glibc.malloc.hugetlb=0".into())), None);
        assert_eq!(
            tunables(on, Some("glibc.malloc.check=1".into())),
            Some("glibc.malloc.check=1:glibc.malloc.hugetlb=1".into())
        );
        assert_eq!(tunables("[always] madvise never", None), None);
        assert_eq!(tunables("always madvise [never]", None), None);
        assert_eq!(tunables("", None), None);
    }
}
