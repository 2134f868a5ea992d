//! The steps at which an output is due.

use plan::interval::Interval;

/// Steps at an interval, starting at step 0; or no steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule {
    every: Option<Interval>,
    next: u64,
}

impl Schedule {
    /// Returns a schedule from step 0: due at step 0, then at every step of the interval; never due without an
    /// interval.
    pub(crate) fn new(every: Option<Interval>) -> Self {
        Self {
            every,
            next: every.map_or(u64::MAX, |_| 0),
        }
    }

    /// Returns a schedule after a restart at `step`; `written` is `true` if the output of that very step exists
    /// already.
    pub(crate) fn resumed(every: Option<Interval>, step: u64, written: bool) -> Self {
        let mut schedule = Self::new(every);
        if written {
            schedule.pass(step);
        } else {
            schedule.next = schedule.next_from(step);
        }
        schedule
    }

    /// Returns `true` if the output is due at `step`. A missed step is not repeated.
    pub(crate) fn is_due(&self, step: u64) -> bool {
        step >= self.next && self.falls_on(step)
    }

    /// Advances the schedule past `step`: outputs due up to this step were written or missed.
    pub(crate) fn pass(&mut self, step: u64) {
        if step >= self.next {
            self.next = self.next_from(step + 1);
        }
    }

    /// Returns the next step at which the output is due.
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    /// Returns `true` if the schedule has an output at `step`. An output at another step was written only because a run
    /// ended there.
    pub(crate) fn falls_on(&self, step: u64) -> bool {
        self.every.is_some_and(|every| every.falls_on(step))
    }

    fn next_from(&self, step: u64) -> u64 {
        self.every.map_or(u64::MAX, |every| every.next_from(step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(every: u64) -> Option<Interval> {
        Some(Interval::new(base::number::real(every), 1.0))
    }

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
        assert_eq!(due(Schedule::new(steps(3)), 0..=10), [0, 3, 6, 9]);
        assert_eq!(due(Schedule::new(steps(0)), 0..=2), [0, 1, 2]);
        assert_eq!(due(Schedule::new(None), 0..=2), [0; 0]);
    }

    #[test]
    fn a_restart_neither_repeats_nor_forgets() {
        assert_eq!(due(Schedule::resumed(steps(3), 6, true), 6..=12), [9, 12]);
        assert_eq!(
            due(Schedule::resumed(steps(3), 6, false), 6..=12),
            [6, 9, 12]
        );
        assert_eq!(due(Schedule::resumed(steps(3), 7, false), 7..=12), [9, 12]);
        assert_eq!(due(Schedule::resumed(steps(3), 6, false), 7..=12), [9, 12]);
        let thirds = Some(Interval::new(1.0, 0.3));
        assert_eq!(due(Schedule::new(thirds), 0..=14), [0, 3, 7, 10, 13]);
        assert_eq!(due(Schedule::resumed(thirds, 7, true), 7..=14), [10, 13]);
        assert_eq!(due(Schedule::resumed(thirds, 5, false), 5..=8), [7]);
    }
}
