//! Values given by a table in time.

use crate::error::Report;

/// Table of times and values: linear between its rows, constant before and after them. Two values at the same time
/// form a jump.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeTable(Vec<[f64; 2]>);

impl TimeTable {
    /// Returns the history given by a table in ascending order of time, or by one value without a table.
    #[must_use]
    pub fn new(table: Option<&[[f64; 2]]>, value: f64) -> Self {
        match table {
            Some(table) if !table.is_empty() => Self(table.to_vec()),
            _ => Self::constant(value),
        }
    }

    /// Returns the history of a constant value.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self(vec![[0.0, value]])
    }

    /// Returns the value at a time; at the time of a jump, the value before the jump.
    #[must_use]
    pub fn value(&self, time: f64) -> f64 {
        self.value_before(self.0.partition_point(|[t, _]| *t < time), time)
    }

    /// Returns the value just after a time: at the time of a jump, the value after the jump.
    #[must_use]
    pub fn value_after(&self, time: f64) -> f64 {
        self.value_before(self.0.partition_point(|[t, _]| *t <= time), time)
    }

    /// Returns the value at a time on the line that ends in the row `after`; constant outside the rows.
    fn value_before(&self, after: usize, time: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        let [t1, v1] = self.0[after.min(last)];
        if after == 0 || after > last {
            return v1;
        }
        let [t0, v0] = self.0[after - 1];
        v0 + (v1 - v0) * (time - t0) / (t1 - t0)
    }

    /// Returns the mean of the values between two times, exact for rows and jumps between them.
    #[must_use]
    pub fn mean(&self, from: f64, to: f64) -> f64 {
        let (mut time, mut sum) = (from, 0.0);
        while let Some(next) = self.next(time).filter(|next| *next < to) {
            sum += 0.5 * (self.value_after(time) + self.value(next)) * (next - time);
            time = next;
        }
        let last = 0.5 * (self.value_after(time) + self.value(to));
        if time > from {
            (sum + last * (to - time)) / (to - from)
        } else {
            last
        }
    }

    /// Returns the largest magnitude of the values.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let [low, high] = self.range();
        low.abs().max(high.abs())
    }

    /// Returns the first time in the table after `time`.
    #[must_use]
    pub fn next(&self, time: f64) -> Option<f64> {
        let after = self.0.partition_point(|[t, _]| *t <= time);
        self.0.get(after).map(|[t, _]| *t)
    }

    /// Returns the last time of the table; 0 for a single value.
    #[must_use]
    pub fn end(&self) -> f64 {
        match self.0.as_slice() {
            [_] | [] => 0.0,
            [.., [t, _]] => *t,
        }
    }

    /// Returns the smallest and the largest value.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        let values = self.0.iter().map(|[_, value]| *value);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    }

    /// Returns the history in other units of time and value.
    #[must_use]
    pub fn scaled(&self, time: impl Fn(f64) -> f64, value: impl Fn(f64) -> f64) -> Self {
        let rows = self.0.iter().map(|[t, v]| [time(*t), value(*v)]);
        Self(rows.collect())
    }
}

/// Reports a table whose rows are missing, not finite or not sorted by time; returns `true` if the table is valid.
pub fn check(table: &[[f64; 2]], path: &str, report: &mut dyn Report) -> bool {
    let falls = |pair: &[[f64; 2]]| pair[1][0] < pair[0][0];
    let (reason, remedy) = if table.is_empty() || table.iter().flatten().any(|x| !x.is_finite()) {
        (
            "the table needs rows of finite times and values",
            "write [[0, 10], [3600, 4]]",
        )
    } else if table.windows(2).any(falls) {
        (
            "the times of the table do not increase",
            "sort the rows by time",
        )
    } else {
        return true;
    };
    report.error(path, reason.into(), remedy.into());
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_its_rows_and_has_the_value_before_a_jump() {
        let table = [[1.0, 10.0], [3.0, 20.0], [3.0, 5.0], [4.0, 6.0]];
        let history = TimeTable::new(Some(&table), 0.0);
        for (time, value) in [
            (0.0, 10.0),
            (1.0, 10.0),
            (2.0, 15.0),
            (3.0, 20.0),
            (3.5, 5.5),
            (4.0, 6.0),
            (9.0, 6.0),
        ] {
            assert!((history.value(time) - value).abs() < 1e-12, "{time}");
        }
        assert_eq!(history.value_after(3.0), 5.0);
        assert_eq!(history.value_after(0.0), 10.0);
        assert_eq!(history.value_after(9.0), 6.0);
        // The integral over the whole table is 10 + 30 + 5.5 + 12.
        for (from, to, mean) in [
            (0.0, 6.0, 57.5 / 6.0),
            (2.0, 2.5, 16.25),
            (3.0, 4.0, 5.5),
            (2.0, 3.0, 17.5),
            (8.0, 9.0, 6.0),
        ] {
            assert!((history.mean(from, to) - mean).abs() < 1e-12, "{from}");
        }
        assert_eq!(TimeTable::new(None, 0.1).mean(0.3, 0.7), 0.1);
        assert_eq!(history.largest(), 20.0);
        assert_eq!(history.next(1.0), Some(3.0));
        assert_eq!(history.next(4.0), None);
        assert_eq!((history.end(), history.range()), (4.0, [5.0, 20.0]));
        assert_eq!(TimeTable::new(None, 7.0).value(3.0), 7.0);
        assert_eq!(TimeTable::new(None, 7.0).end(), 0.0);
    }
}
