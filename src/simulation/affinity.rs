//! The cores that the threads of a rank may use.
//!
//! `mpirun` binds each rank to one core unless options say otherwise. Threads bound to one core take
//! turns instead of sharing the work: two such threads are up to ten times slower than one. A rank with
//! more threads than cores therefore extends its binding to its share of the cores of the machine,
//! where the operating system permits this.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::env::var;

/// Result of the choice of cores of a rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Cores {
    /// The rank has as many cores as threads.
    Enough,
    /// The rank has enough cores now; the number is that before the change.
    Extended(usize),
    /// The rank has only this number of cores.
    TooFew(usize),
}

/// Binds this process to at least as many cores as it will have threads; must be called before threads are started.
pub(super) fn bind_cores(threads: usize) -> Cores {
    let Ok(before) = sched_getaffinity(None) else {
        return Cores::Enough;
    };
    let had = count(&before);
    if had >= threads {
        return Cores::Enough;
    }
    let wanted = cores_of(threads, online(), local("RANK").unwrap_or(0));
    // The system removes from the mask the cores that a job may not use.
    let widened = sched_setaffinity(None, &wanted).and_then(|()| sched_getaffinity(None));
    if widened.is_ok_and(|now| count(&now) >= threads) {
        return Cores::Extended(had);
    }
    let _ = sched_setaffinity(None, &before);
    Cores::TooFew(had)
}

/// Returns the number of cores of this machine that the job may use: the cores online, or fewer if a
/// control group limits the processor time.
pub(super) fn allowed() -> usize {
    let group = |name: &str| std::fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok();
    let time = group("cpu.max").and_then(|text| quota(&text));
    let set = group("cpuset.cpus.effective").and_then(|text| listed(&text));
    [time, set].into_iter().flatten().fold(online(), usize::min)
}

/// Returns the number of cores granted by the `cpu.max` of a control group, such as 2 for `200000
/// 100000`; none without a limit.
fn quota(text: &str) -> Option<usize> {
    let mut words = text
        .split_whitespace()
        .map(|word| word.parse::<usize>().ok());
    let (time, period) = (words.next()??, words.next()??);
    (period > 0).then(|| time.div_ceil(period).max(1))
}

/// Returns the number of cores in a list such as `0-3,8`.
fn listed(text: &str) -> Option<usize> {
    let of_part = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
        (last >= first).then(|| last - first + 1)
    };
    text.trim().split(',').map(of_part).sum()
}

/// Returns the cores of a rank: the ranks of a machine take consecutive sets of `threads` cores each;
/// all cores if there are too few for all ranks.
fn cores_of(threads: usize, online: usize, rank: usize) -> CpuSet {
    let all = 0..online;
    let own = rank * threads..(rank + 1) * threads;
    let mut cores = CpuSet::new();
    for core in if own.end <= online { own } else { all } {
        if core < CpuSet::MAX_CPU {
            cores.set(core);
        }
    }
    cores
}

fn count(cores: &CpuSet) -> usize {
    cores.count() as usize
}

/// Returns the number of cores of the machine that are online, including those that this process may
/// not use.
fn online() -> usize {
    let text = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
    // The list is `0-15` or `0,2-5`, for example: the last number counts.
    let last = text.trim().rsplit([',', '-']).next();
    last.and_then(|n| n.parse::<usize>().ok())
        .map_or(1, |n| n + 1)
}

/// Returns the index of this rank on its machine, from the environment variables of Open MPI or Slurm.
fn local(what: &str) -> Option<usize> {
    let names = [
        format!("OMPI_COMM_WORLD_LOCAL_{what}"),
        "SLURM_LOCALID".to_owned(),
    ];
    names
        .iter()
        .find_map(|name| var(name).ok()?.parse::<usize>().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_take_cores_that_follow_each_other() {
        let cores = |rank| {
            let set = cores_of(3, 8, rank);
            (0..8).filter(|core| set.is_set(*core)).collect::<Vec<_>>()
        };
        assert_eq!(cores(0), [0, 1, 2]);
        assert_eq!(cores(1), [3, 4, 5]);
        // There are too few cores for a third rank, which may use all.
        assert_eq!(cores(2), [0, 1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn control_groups_withhold_cores() {
        assert_eq!(quota("150000 100000\n"), Some(2));
        assert_eq!((quota("max 100000\n"), quota("")), (None, None));
        assert_eq!(listed("0-3,8\n"), Some(5));
        assert_eq!(
            (listed("2"), listed(""), listed("x-1")),
            (Some(1), None, None)
        );
        assert!((1..=online()).contains(&allowed()));
    }

    /// Runs on a thread of its own, since threads inherit the cores of their parent.
    #[test]
    fn a_process_on_one_core_gets_the_cores_of_its_threads_or_says_that_it_does_not() {
        let test = || {
            let before = sched_getaffinity(None).unwrap();
            assert_eq!(bind_cores(1), Cores::Enough);
            let first = (0..CpuSet::MAX_CPU)
                .find(|core| before.is_set(*core))
                .unwrap();
            let mut one = CpuSet::new();
            one.set(first);
            sched_setaffinity(None, &one).unwrap();
            let got = bind_cores(2);
            let now = count(&sched_getaffinity(None).unwrap());
            match got {
                Cores::Extended(1) => assert!(now >= 2, "{now}"),
                Cores::TooFew(1) => assert_eq!(now, 1),
                other => panic!("{other:?}"),
            }
        };
        std::thread::spawn(test).join().unwrap();
    }
}
