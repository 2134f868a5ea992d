//! The median, and quantiles of Student's distribution.

use base::number::real;

/// Returns the median; `NaN` for an empty list.
pub(super) fn median(values: &mut [f64]) -> f64 {
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
pub(super) fn student(freedom: usize) -> f64 {
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
}
