//! When something is due.

/// Every so many steps, from step 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Schedule {
    every: u64,
    next: u64,
}

impl Schedule {
    /// From nothing: due at step 0, then at every multiple of `every` (at least 1).
    pub(crate) fn new(every: u64) -> Self {
        Self {
            every: every.max(1),
            next: 0,
        }
    }

    /// After a restart at `step`; `written`: what was due at that very step is there already.
    pub(crate) fn resumed(every: u64, step: u64, written: bool) -> Self {
        let mut schedule = Self::new(every);
        if written {
            schedule.pass(step);
        } else {
            schedule.next = step.next_multiple_of(schedule.every);
        }
        schedule
    }

    /// Whether it is due at `step`. A step that was passed by is not made up for.
    pub(crate) fn is_due(&self, step: u64) -> bool {
        step >= self.next && step.is_multiple_of(self.every)
    }

    /// Time went past `step`: what was due there happened or was passed by.
    pub(crate) fn pass(&mut self, step: u64) {
        if step >= self.next {
            self.next = (step + 1).next_multiple_of(self.every);
        }
    }

    /// The next step at which it is due.
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    /// Whether a regular step, of which there is an output, lies at `step`.
    pub(crate) fn falls_on(every: u64, step: u64) -> bool {
        step.is_multiple_of(every.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due(mut schedule: Schedule, steps: std::ops::RangeInclusive<u64>) -> Vec<u64> {
        steps
            .filter(|&step| {
                let due = schedule.is_due(step);
                schedule.pass(step);
                due
            })
            .collect()
    }

    #[test]
    fn multiples_from_zero_on() {
        assert_eq!(due(Schedule::new(3), 0..=10), [0, 3, 6, 9]);
        assert_eq!(due(Schedule::new(0), 0..=2), [0, 1, 2]);
    }

    #[test]
    fn a_restart_neither_repeats_nor_forgets() {
        assert_eq!(due(Schedule::resumed(3, 6, true), 6..=12), [9, 12]);
        assert_eq!(due(Schedule::resumed(3, 6, false), 6..=12), [6, 9, 12]);
        assert_eq!(due(Schedule::resumed(3, 7, false), 7..=12), [9, 12]);
        assert_eq!(due(Schedule::resumed(3, 6, false), 7..=12), [9, 12]);
    }
}
