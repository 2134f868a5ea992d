//! Steps of an event that repeats every T seconds.
//!
//! Event k belongs to the time `k T` and happens at the nearest step, `round(k T / dt)`. Each step is computed from its
//! own time, so that the events never drift away from the multiples of T. No two events share a step: an interval
//! shorter than a step counts as one step.

/// An interval of time, measured in steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// T / dt, at least 1; rounded to a whole number if it is one to round-off.
    steps: f64,
}

impl Interval {
    /// Returns the interval of `interval` seconds in steps of `time_step` seconds.
    #[must_use]
    pub fn new(interval: f64, time_step: f64) -> Self {
        let steps = interval / time_step;
        let nearest = steps.round();
        let whole = (steps - nearest).abs() <= 1e-9 * steps.abs().max(1.0);
        let steps = if whole { nearest } else { steps };
        Self {
            // `max` also replaces a NaN.
            steps: steps.max(1.0),
        }
    }

    /// Returns the step of event `event`; event 0 is at step 0.
    #[must_use]
    pub fn step(&self, event: u64) -> u64 {
        let step = (base::number::real(event) * self.steps).round();
        u64::try_from(super::whole(step)).unwrap_or(u64::MAX)
    }

    /// Returns `true` if an event happens at `step`.
    #[must_use]
    pub fn falls_on(&self, step: u64) -> bool {
        self.next_from(step) == step
    }

    /// Returns the first step with an event that is not before `step`.
    #[must_use]
    pub fn next_from(&self, step: u64) -> u64 {
        let before = (base::number::real(step) / self.steps).floor() - 1.0;
        let mut event = u64::try_from(super::whole(before.max(0.0))).unwrap_or(u64::MAX);
        // The quotient is off by less than one event; steps increase with the event.
        while self.step(event) < step {
            event += 1;
        }
        self.step(event)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn events(interval: Interval, until: u64) -> Vec<u64> {
        (0..=until)
            .filter(|step| interval.falls_on(*step))
            .collect()
    }

    #[test]
    fn whole_intervals_are_multiples() {
        assert_eq!(events(Interval::new(3.0, 1.0), 10), [0, 3, 6, 9]);
        assert_eq!(events(Interval::new(0.0, 1.0), 3), [0, 1, 2, 3]);
        // 0.3 / 0.1 is not 3 in floating point.
        assert_eq!(events(Interval::new(0.3, 0.1), 10), [0, 3, 6, 9]);
        assert!(Interval::new(0.3, 0.1).falls_on(3_000_000_000));
    }

    #[test]
    fn other_intervals_do_not_drift() {
        assert_eq!(
            events(Interval::new(1.0, 0.3), 20),
            [0, 3, 7, 10, 13, 17, 20]
        );
        assert_eq!(events(Interval::new(0.25, 0.1), 10), [0, 3, 5, 8, 10]);
    }

    #[test]
    fn shorter_than_a_step_is_every_step() {
        assert_eq!(events(Interval::new(0.04, 0.1), 4), [0, 1, 2, 3, 4]);
        assert_eq!(events(Interval::new(f64::NAN, 0.1), 2), [0, 1, 2]);
    }

    proptest! {
        #[test]
        fn every_event_is_at_the_nearest_step(
            interval in 1e-6_f64..10.0, time_step in 1e-7_f64..1e-2, event in 0_u64..1_000_000
        ) {
            let found = Interval::new(interval, time_step);
            let step = found.step(event);
            let number = base::number::real;
            if interval >= time_step {
                let off = number(step) - number(event) * interval / time_step;
                prop_assert!(off.abs() <= 0.5 + 2e-9 * number(step), "{off}");
            }
            prop_assert!(found.falls_on(step));
            prop_assert_eq!(found.next_from(step), step);
            prop_assert_eq!(found.next_from(step + 1), found.step(event + 1));
            prop_assert!(found.step(event + 1) > step);
        }
    }
}
