//! Rank of this process before MPI starts, from the environment that a launcher sets.

/// Addresses of the PMIx server of a launcher, by the versions of its protocol; Open MPI 2 to 5 and Slurm set some.
const PMIX: [&str; 5] = [
    "PMIX_SERVER_URI",
    "PMIX_SERVER_URI2",
    "PMIX_SERVER_URI21",
    "PMIX_SERVER_URI3",
    "PMIX_SERVER_URI4",
];

/// Returns `true` for the first rank, and for a process that no launcher started as a rank.
pub(crate) fn first_rank() -> bool {
    first_of(&|name| std::env::var(name).ok())
}

/// Returns `true` if an environment is that of a first rank or of no rank.
///
/// Rank and number of ranks alone prove nothing: a batch job may export them, or a shell may keep them from an earlier
/// job. They count only with the address of the launcher, through which MPI learns its rank: without this address MPI
/// starts as one rank alone.
fn first_of(variable: &dyn Fn(&str) -> Option<String>) -> bool {
    let number = |name: &str| variable(name)?.trim().parse::<u64>().ok();
    let launched = |names: &[&str]| {
        let set = |name: &&str| variable(name).is_some_and(|value| !value.trim().is_empty());
        names.iter().any(set)
    };
    let ranks: [(&str, &[&str], &[&str]); 4] = [
        ("OMPI_COMM_WORLD_RANK", &["OMPI_COMM_WORLD_SIZE"], &PMIX),
        (
            "PMIX_RANK",
            &["OMPI_COMM_WORLD_SIZE", "PMIX_SIZE", "SLURM_STEP_NUM_TASKS"],
            &PMIX,
        ),
        ("PMI_RANK", &["PMI_SIZE"], &["PMI_FD", "PMI_PORT"]),
        (
            "SLURM_PROCID",
            &["SLURM_STEP_NUM_TASKS"],
            &["SLURM_SRUN_COMM_PORT"],
        ),
    ];
    ranks.iter().all(|(rank, sizes, launchers)| {
        let size = sizes.iter().find_map(|name| number(name));
        let other =
            number(rank).is_some_and(|rank| rank > 0 && size.is_some_and(|size| rank < size));
        !(other && launched(launchers))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the rank of each launcher counts with its address only, and never alone.
    #[test]
    fn a_rank_counts_with_the_address_of_its_launcher() {
        for (rank, size, address) in [
            (
                "OMPI_COMM_WORLD_RANK",
                "OMPI_COMM_WORLD_SIZE",
                "PMIX_SERVER_URI4",
            ),
            ("PMIX_RANK", "PMIX_SIZE", "PMIX_SERVER_URI2"),
            ("PMI_RANK", "PMI_SIZE", "PMI_FD"),
            (
                "SLURM_PROCID",
                "SLURM_STEP_NUM_TASKS",
                "SLURM_SRUN_COMM_PORT",
            ),
        ] {
            let first = |set: &[(&str, &str)]| {
                first_of(&|name| {
                    let found = set.iter().find(|(known, _)| *known == name);
                    found.map(|(_, value)| (*value).to_owned())
                })
            };
            assert!(first(&[(rank, "1"), (size, "2")]), "{rank}");
            assert!(first(&[(rank, "1"), (address, "7")]), "{rank}");
            assert!(first(&[(rank, "0"), (size, "2"), (address, "7")]), "{rank}");
            assert!(
                !first(&[(rank, "1"), (size, "2"), (address, "7")]),
                "{rank}"
            );
        }
    }
}
