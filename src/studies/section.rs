//! Search for the value at which a condition changes, by sections of an interval.
//!
//! Both ends are tried first. Each round divides the interval between the first two neighbouring values with different
//! verdicts into equal parts and tries the values between them; two parts are a bisection. The next round follows from
//! the values tried and their verdicts alone, so that a search continues after an interruption without a state of its
//! own. A value without a verdict stays out of the interval's ends: the widest part that such values leave is divided.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Number of values without a verdict inside an interval at which the search ends.
pub const MAX_FAILED: usize = 3;

/// Width of the interval at which a search ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Tolerance {
    /// Width in the unit of the field.
    Absolute(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Width over the larger magnitude of its two ends.
    Relative(#[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))] f64),
}

impl Tolerance {
    /// Returns the largest width of a final interval.
    fn width(self, [low, high]: [f64; 2]) -> f64 {
        match self {
            Self::Absolute(width) => width,
            Self::Relative(share) => share * low.abs().max(high.abs()),
        }
    }
}

/// Interval to be searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    /// Width at which the search ends.
    pub tolerance: Tolerance,
    /// Number of parts into which a round divides the interval, at least 2.
    pub parts: u32,
}

/// Two values between which the condition changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bracket {
    /// The values, the lower one first.
    pub ends: [f64; 2],
    /// `true` if the condition holds at the upper end.
    pub rises: bool,
}

/// Next action of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum Round {
    /// Try these values.
    Try(Vec<f64>),
    /// The interval is narrow enough.
    Found(Bracket),
    /// Both ends have this verdict.
    SameVerdict(bool),
    /// Too many values have no verdict. The interval is given if both ends have a verdict.
    Undecided(Option<Bracket>),
}

/// Value with its verdict; none if the value could not be judged.
pub type TriedValue = (f64, Option<bool>);

impl Section {
    /// Returns the next action after these values have been tried, in any order.
    #[must_use]
    pub fn next(&self, tried: &[TriedValue]) -> Round {
        let verdict = |end: f64| {
            tried
                .iter()
                .find(|(value, _)| value.total_cmp(&end).is_eq())
        };
        let missing = [self.from, self.to].into_iter();
        let missing: Vec<f64> = missing.filter(|end| verdict(*end).is_none()).collect();
        if !missing.is_empty() {
            return Round::Try(missing);
        }
        let ends = [self.from, self.to].map(|end| verdict(end).and_then(|(_, verdict)| *verdict));
        let [Some(low), Some(high)] = ends else {
            return Round::Undecided(None);
        };
        if low == high {
            return Round::SameVerdict(low);
        }
        let all = sorted(tried);
        let mut decided = all
            .iter()
            .filter_map(|(value, verdict)| Some((*value, (*verdict)?)));
        let mut before = (self.from, low);
        let after = decided.find(|now| {
            let changes = now.1 != low;
            before = if changes { before } else { *now };
            changes
        });
        let ends = [before.0, after.map_or(self.to, |after| after.0)];
        let bracket = Bracket { ends, rises: !low };
        let width = self.tolerance.width(ends);
        if ends[1] - ends[0] <= width {
            return Round::Found(bracket);
        }
        let inside = all
            .iter()
            .map(|(value, _)| *value)
            .filter(|value| ends[0] < *value && *value < ends[1]);
        let mut marks = vec![ends[0]];
        marks.extend(inside);
        marks.push(ends[1]);
        let mut gap = [marks[0], marks[1]];
        for pair in marks.windows(2) {
            if pair[1] - pair[0] > gap[1] - gap[0] {
                gap = [pair[0], pair[1]];
            }
        }
        let failed = marks.len() - 2;
        if failed >= MAX_FAILED || (failed > 0 && gap[1] - gap[0] <= width) {
            return Round::Undecided(Some(bracket));
        }
        let values = self.inside(gap);
        if values.is_empty() {
            return Round::Found(bracket);
        }
        Round::Try(values)
    }

    /// Returns the values that divide an interval, with at most as many decimals as the parts need.
    fn inside(&self, [low, high]: [f64; 2]) -> Vec<f64> {
        let part = (high - low) / f64::from(self.parts);
        let mut values: Vec<f64> = (1..self.parts)
            .map(|n| rounded_to_unit(low + part * f64::from(n), part))
            .filter(|value| low < *value && *value < high)
            .collect();
        values.dedup();
        values
    }
}

/// Returns a number rounded to a decimal place below a hundredth of `unit`.
fn rounded_to_unit(number: f64, unit: f64) -> f64 {
    let mut decimals = 0_usize;
    let mut scale = unit;
    while scale < 100.0 && decimals < 320 {
        scale *= 10.0;
        decimals += 1;
    }
    format!("{number:.decimals$}").parse().unwrap_or(number)
}

/// Returns the values in ascending order.
fn sorted(tried: &[TriedValue]) -> Vec<TriedValue> {
    let mut all = tried.to_vec();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// Returns the number of changes of the verdict along the values; more than one contradicts a single threshold.
#[must_use]
pub fn changes(tried: &[TriedValue]) -> usize {
    let verdicts: Vec<bool> = sorted(tried).iter().filter_map(|(_, v)| *v).collect();
    verdicts
        .windows(2)
        .filter(|pair| pair[0] != pair[1])
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(
        section: &Section,
        condition: impl Fn(f64) -> Option<bool>,
    ) -> (Round, Vec<TriedValue>) {
        let mut tried = Vec::new();
        loop {
            match section.next(&tried) {
                Round::Try(values) => tried.extend(values.iter().map(|v| (*v, condition(*v)))),
                end => return (end, tried),
            }
            assert!(tried.len() < 1000, "no end: {tried:?}");
        }
    }

    const UNIT: Section = Section {
        from: 0.0,
        to: 1.0,
        tolerance: Tolerance::Absolute(1e-3),
        parts: 2,
    };

    #[test]
    fn the_interval_holds_the_threshold_and_is_as_narrow_as_wanted() {
        for (parts, rounds) in [(2, 10), (4, 5), (11, 3)] {
            for rises in [true, false] {
                let section = Section { parts, ..UNIT };
                let (end, tried) = search(&section, |x| Some((x > 0.637) == rises));
                let Round::Found(found) = end else {
                    panic!("{end:?}");
                };
                assert_eq!(found.rises, rises);
                let [low, high] = found.ends;
                assert!(
                    low <= 0.637 && 0.637 < high && high - low <= 1e-3,
                    "{found:?}"
                );
                let most = 2 + rounds * (parts as usize - 1);
                assert!(tried.len() <= most, "{} of {most}", tried.len());
                assert_eq!(changes(&tried), 1);
            }
        }
    }

    #[test]
    fn a_relative_width_is_one_of_the_larger_end() {
        let section = Section {
            from: -2e5,
            to: -1e3,
            tolerance: Tolerance::Relative(0.01),
            parts: 3,
        };
        let (end, _) = search(&section, |x| Some(x > -5432.1));
        let Round::Found(Bracket { ends, .. }) = end else {
            panic!("{end:?}");
        };
        assert!(ends[0] <= -5432.1 && -5432.1 < ends[1]);
        assert!(ends[1] - ends[0] <= 0.01 * ends[0].abs());
    }

    #[test]
    fn both_ends_alike_are_a_result() {
        for always in [true, false] {
            let (end, tried) = search(&UNIT, |_| Some(always));
            assert_eq!((end, tried.len()), (Round::SameVerdict(always), 2));
        }
    }

    #[test]
    fn a_value_without_a_verdict_is_passed_by() {
        let fails = |x: f64| (x != 0.5).then_some(x > 0.637);
        let (end, tried) = search(&UNIT, fails);
        assert!(
            matches!(end, Round::Found(found) if found.ends[0] <= 0.637 && 0.637 < found.ends[1])
        );
        assert_eq!(tried.iter().filter(|(_, v)| v.is_none()).count(), 1);
        // Where nothing near the threshold has a verdict, the interval stays.
        let (end, _) = search(&UNIT, |x| ((x - 0.637).abs() > 0.2).then_some(x > 0.637));
        let Round::Undecided(Some(found)) = end else {
            panic!("{end:?}");
        };
        assert!(
            found.ends[0] <= 0.437 && 0.837 <= found.ends[1],
            "{found:?}"
        );
        let (end, _) = search(&UNIT, |x| (x < 1.0).then_some(false));
        assert_eq!(end, Round::Undecided(None));
    }

    #[test]
    fn the_values_are_short() {
        let (_, tried) = search(&Section { parts: 7, ..UNIT }, |x| Some(x > 1.0 / 3.0));
        for (value, _) in tried {
            assert!(value.to_string().len() <= 8, "{value}");
        }
    }
}
