//! Memory of the machine that plans.

/// Returns the available memory: that which `guards.memory_gib` states, otherwise that of this machine, if the system
/// reports it \[bytes\].
pub(crate) fn memory(stated_gib: Option<f64>) -> Option<f64> {
    stated_gib
        .map(|gib| gib * 1024.0 * 1024.0 * 1024.0)
        .or_else(of_this_machine)
}

fn of_this_machine() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024.0)
}
