//! The median, means with their intervals, and quantiles of Student's distribution.

use base::number::real;

/// Returns the median; `NaN` for an empty list.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len() % 2 == 1 {
        values[half]
    } else {
        0.5 * (values[half - 1] + values[half])
    }
}

/// Returns the quantile of Student's t for a two-sided interval of 95 %. Zero degrees of freedom take the quantile
/// of one: two points do not show the scatter of a third.
#[must_use]
pub fn student(freedom: usize) -> f64 {
    const TABLE: [f64; 30] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
        2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056,
        2.052, 2.048, 2.045, 2.042,
    ];
    match freedom.max(1) {
        freedom @ 1..=30 => TABLE[freedom - 1],
        // Second-order expansion in 1 / freedom, accurate to 1e-3 here.
        freedom => 1.960 + 2.372 / real(freedom),
    }
}

/// Mean of a sample, with the scatter of its values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleMean {
    /// Number of values.
    pub count: usize,
    /// Mean of the values.
    pub mean: f64,
    /// Standard deviation of one value, with `count - 1` degrees of freedom; none for a single value.
    pub scatter: Option<f64>,
    /// Half the width of the 95 % interval of the mean by Student's t; none for a single value.
    pub half_width: Option<f64>,
}

impl SampleMean {
    /// Computes the mean of a sample; none for an empty one.
    #[must_use]
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let count = values.len();
        if count == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / real(count);
        let scatter = (count > 1).then(|| {
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            (squares / real(count - 1)).sqrt()
        });
        Some(Self {
            count,
            mean,
            scatter,
            half_width: scatter.map(|s| student(count - 1) * s / real(count).sqrt()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn quantiles_are_students() {
        assert_relative_eq!(student(8), 2.306);
        assert_relative_eq!(student(40), 2.021, epsilon = 2e-3);
        assert_relative_eq!(student(1_000_000), 1.960, epsilon = 1e-3);
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_gosset() {
        // Additional hours of sleep, drug 2 (W. S. Gosset, Biometrika 6 (1908) 1): mean 2.33, deviation 2.0022.
        let hours = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
        let sample = SampleMean::from_values(&hours).unwrap();
        assert_relative_eq!(sample.mean, 2.33, epsilon = 1e-12);
        assert_relative_eq!(sample.scatter.unwrap(), 2.0022, epsilon = 1e-4);
        assert_relative_eq!(sample.half_width.unwrap(), 1.4323, epsilon = 1e-4);
        assert_eq!(SampleMean::from_values(&[]), None);
        assert_eq!(SampleMean::from_values(&[3.0]).unwrap().scatter, None);
    }
}
