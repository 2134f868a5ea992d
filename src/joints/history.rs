//! Pressure at a mouth as a function of time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Pressure above atmospheric pressure as a function of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum PressureHistory {
    /// Constant pressure [Pa].
    Constant(f64),
    /// Table of times [s] in rising order and pressures [Pa]: linear between, constant before and after.
    Table(Vec<[f64; 2]>),
    /// Harmonic pressure mean + amplitude · sin(2 pi · frequency · t).
    Harmonic {
        /// Mean [Pa].
        #[serde(default)]
        mean: f64,
        /// Amplitude [Pa].
        amplitude: f64,
        /// Frequency [Hz].
        #[schemars(extend("exclusiveMinimum" = 0))]
        frequency: f64,
    },
}

impl PressureHistory {
    /// Returns the pressure at a time \[s\]; 0 for an empty table.
    #[must_use]
    pub fn value(&self, time: f64) -> f64 {
        match self {
            Self::Constant(pressure) => *pressure,
            Self::Harmonic {
                mean,
                amplitude,
                frequency,
            } => mean + amplitude * (2.0 * PI * frequency * time).sin(),
            Self::Table(rows) => {
                let after = rows.partition_point(|row| row[0] <= time);
                match (after.checked_sub(1).map(|k| rows[k]), rows.get(after)) {
                    (Some([from, a]), Some([to, b])) => a + (b - a) * (time - from) / (to - from),
                    (Some(row), None) => row[1],
                    (None, row) => row.map_or(0.0, |row| row[1]),
                }
            }
        }
    }

    /// Returns the largest and the smallest pressure between the time 0 and `end` \[Pa\].
    #[must_use]
    pub fn bounds(&self, end: f64) -> [f64; 2] {
        match self {
            Self::Constant(pressure) => [*pressure; 2],
            Self::Harmonic {
                mean, amplitude, ..
            } => [mean - amplitude.abs(), mean + amplitude.abs()],
            Self::Table(rows) => {
                let inner = rows.iter().filter(|row| row[0] > 0.0 && row[0] < end);
                let inner = inner.map(|row| row[1]);
                let ends = [self.value(0.0), self.value(end)];
                inner
                    .chain(ends)
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| {
                        [low.min(p), high.max(p)]
                    })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_linear_between_its_rows_and_constant_outside() {
        let table = PressureHistory::Table(vec![[1.0, 10.0], [2.0, 30.0], [2.0, 50.0], [4.0, 0.0]]);
        for (time, pressure) in [
            (0.0, 10.0),
            (1.5, 20.0),
            (2.0, 50.0),
            (3.0, 25.0),
            (9.0, 0.0),
        ] {
            assert_eq!(table.value(time), pressure);
        }
        assert_eq!(table.bounds(3.0), [10.0, 50.0]);
        let harmonic = PressureHistory::Harmonic {
            mean: 1.0,
            amplitude: -2.0,
            frequency: 0.25,
        };
        assert_eq!(harmonic.value(1.0), -1.0);
        assert_eq!(harmonic.bounds(9.0), [-1.0, 3.0]);
        assert_eq!(PressureHistory::Table(Vec::new()).value(1.0), 0.0);
    }
}
