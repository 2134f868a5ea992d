//! The discretisation error of one value from its values on two or three grids.
//!
//! The value on grid i of spacing h_i, from fine to coarse, is taken as φ_i = φ_0 + α h_i^p. The apparent order p
//! solves
//!
//! ```text
//! |ε32/ε21| = r21^p (r32^p - s)/(r21^p - s),   ε32 = φ_3 - φ_2, ε21 = φ_2 - φ_1, s = sign(ε32/ε21)
//! ```
//!
//! which is equations (3) of Celik et al. with the sign of divergence kept: there is a positive solution only where the
//! differences shrink faster than a logarithm. The extrapolated value is φ_0 = φ_1 + (φ_1 - φ_2)/(r21^p - 1), and
//! the uncertainty of the value on a grid is F |φ - φ_0|, on the finest grid the grid convergence index F |φ_1 -
//! φ_2|/(r21^p - 1).
//!
//! | series | uncertainty |
//! |---|---|
//! | monotone, p within 10 % of the formal order | F = 1.25 with p, at most the formal order |
//! | monotone, p below it | F = 3 with p, at least 0.5 |
//! | monotone, p above it | the finer difference is small by chance: least squares as below |
//! | two grids | F = 3, first order; extrapolated with the formal order, as errors of staircases may cancel |
//! | oscillating and shrinking | least squares, and at least half the range |
//! | scattered: growing differences change their sign | least squares, and at least the range; outside seepage none |
//! | diverging: growing differences of one sign | F = 3, p = 0.5 if the method converges ([`Limit`]), else none |
//! | equal to rounding | three times the largest difference, and at least the rounding |
//!
//! The least-squares fit is the better one of order 1 and 2, in seepage at most the formal order; the uncertainty is 3
//! times its error, plus its standard deviation and its distance from the value.
//!
//! The fluxes of a seepage rise with the head on one side of a face and fall with that on the other. Its heads
//! therefore stay between those of the conditions on any cells, and heads, discharges, forces and volumes
//! converge. On coarse cells they need not converge in order: the tip of a wall, the end of a sheet or the upper end
//! of a seepage face lies anywhere in a cell, so that the sign of its error of first order changes from grid to grid.
//! Gradients and velocities have no limit at edges. For a lattice a growing difference may be an instability, and
//! nothing is given.
//!
//! Sources: P. J. Roache, J. Fluids Eng. 116 (1994) 405 (F); I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001 (p,
//! extrapolation); W. L. Oberkampf and C. J. Roy, Verification and Validation in Scientific Computing, Cambridge 2010,
//! section 8.7 (choice of F and bounds of p); L. Eça and M. Hoekstra, J. Comput. Phys. 262 (2014) 104 (least squares);
//! F. Stern et al., J. Fluids Eng. 123 (2001) 793 (half the range).

use base::number::real;
use serde::Serialize;

/// Factor of safety for three grids in the asymptotic range.
const SAFETY_FACTOR: f64 = 1.25;
/// Factor of safety for two grids and unclear orders.
const CAUTIOUS_FACTOR: f64 = 3.0;
/// Maximum relative deviation of the apparent order from the formal one in the asymptotic range.
const ASYMPTOTIC: f64 = 0.1;
/// Minimum order used.
const MIN_ORDER: f64 = 0.5;
/// Maximum order in the search for the apparent order.
const MAX_ORDER: f64 = 60.0;

/// Behaviour of a value from grid to grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Behaviour {
    /// The values are equal on all grids within rounding.
    Equal,
    /// The differences shrink and have one sign, with the formal order.
    Asymptotic,
    /// The differences shrink and have one sign, with a lower order.
    Monotone,
    /// The differences shrink and have one sign, faster than the formal order.
    Fast,
    /// The differences shrink and change their sign.
    Oscillating,
    /// The differences grow and change their sign, within bounds.
    Scattered,
    /// The differences grow with one sign, but the method converges.
    Slow,
    /// The differences do not shrink.
    Diverging,
    /// There are two grids only.
    TwoGrids,
    /// There is one grid only, or values are missing on the others.
    OneGrid,
}

impl Behaviour {
    /// Returns the name used in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Equal => "equal",
            Self::Asymptotic => "monotone, asymptotic",
            Self::Monotone => "monotone",
            Self::Fast => "monotone, faster than the method",
            Self::Oscillating => "oscillating",
            Self::Scattered => "scattered",
            Self::Slow => "monotone, without an order",
            Self::Diverging => "diverging",
            Self::TwoGrids => "two grids",
            Self::OneGrid => "one grid",
        }
    }

    /// Returns the method used and the reason for it.
    #[must_use]
    pub fn method(self) -> &'static str {
        match self {
            Self::Equal => {
                "the grids agree to rounding, and the uncertainty is three times the largest difference, at least \
                 the rounding"
            }
            Self::Asymptotic => {
                "grid convergence index, F = 1.25: three grids, order within 10 % of the formal one"
            }
            Self::Monotone => {
                "grid convergence index, F = 3: the order is below the formal one; an order of at least 0.5 is \
                 used"
            }
            Self::Fast => {
                "least squares (Eca and Hoekstra 2014), F = 3: the order is above the formal one, because the \
                 difference of the finer grids is small by chance"
            }
            Self::Oscillating => {
                "least squares (Eca and Hoekstra 2014), F = 3, at least half the range of the values: the \
                 differences change their sign"
            }
            Self::Scattered => {
                "least squares (Eca and Hoekstra 2014), F = 3, at least the range of the values: \
                 edges lie at different positions within the cells of each grid"
            }
            Self::Slow => {
                "grid convergence index, F = 3 and an order of 0.5: the differences do not decrease on these cells, \
                 but a value of this kind converges"
            }
            Self::Diverging => {
                "no uncertainty is given: the differences do not decrease with the cells"
            }
            Self::TwoGrids => "grid convergence index, F = 3: two grids and first order",
            Self::OneGrid => "no uncertainty is given: the value is known on one grid only",
        }
    }
}

/// Behaviour of the value as the cell size tends to zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Limit {
    /// Not known: growing differences may be an instability.
    #[default]
    Unknown,
    /// The method is stable, but the value may be infinite, like a gradient at an edge.
    Stable,
    /// The value converges.
    Exists,
}

/// A value on several grids.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Spacing and value, from fine to coarse.
    pub values: Vec<(f64, f64)>,
    /// Index of the value to which the uncertainty belongs.
    pub at: usize,
    /// Formal order of the method.
    pub formal: f64,
    /// Maximum difference that is attributed to rounding.
    pub rounding: f64,
    /// Knowledge of its limit.
    pub limit: Limit,
}

/// Estimate of one value from a series of grids.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Behaviour of the series.
    pub behaviour: Behaviour,
    /// Apparent order from three grids.
    pub observed_order: Option<f64>,
    /// Order used in the extrapolation.
    pub order: Option<f64>,
    /// Value extrapolated to zero spacing.
    pub extrapolated: Option<f64>,
    /// Factor of safety.
    pub factor: Option<f64>,
    /// Half the width of the interval about the value; none if no uncertainty is given.
    pub uncertainty: Option<f64>,
}

impl Series {
    /// Estimates the uncertainty of the series.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        let none = |behaviour| Estimate {
            behaviour,
            observed_order: None,
            order: None,
            extrapolated: None,
            factor: None,
            uncertainty: None,
        };
        let Some(&(_, own)) = self.values.get(self.at) else {
            return none(Behaviour::OneGrid);
        };
        let range = self.range();
        let [first, second, rest @ ..] = self.values.as_slice() else {
            return none(Behaviour::OneGrid);
        };
        if range <= self.rounding {
            return Estimate {
                extrapolated: Some(first.1),
                factor: Some(CAUTIOUS_FACTOR),
                uncertainty: Some((CAUTIOUS_FACTOR * range).max(self.rounding)),
                ..none(Behaviour::Equal)
            };
        }
        let ratio = second.0 / first.0;
        let by_order = |behaviour, observed, order: f64, factor: f64| {
            let extrapolated = richardson([first.1, second.1], ratio, order);
            Estimate {
                behaviour,
                observed_order: observed,
                order: Some(order),
                extrapolated: Some(extrapolated),
                factor: Some(factor),
                uncertainty: Some(factor * (own - extrapolated).abs()),
            }
        };
        let Some(third) = rest.first() else {
            let mut found = by_order(Behaviour::TwoGrids, None, self.formal, CAUTIOUS_FACTOR);
            // Errors of staircases may cancel in a single difference.
            let first_order = richardson([first.1, second.1], ratio, self.formal.min(1.0));
            found.uncertainty = Some(CAUTIOUS_FACTOR * (own - first_order).abs());
            return found;
        };
        let values = [first.1, second.1, third.1];
        let turn = (values[2] - values[1]) * (values[1] - values[0]);
        let Some(observed) = apparent_order(values, [ratio, third.0 / second.0]) else {
            return match self.limit {
                Limit::Exists if turn > 0.0 => {
                    by_order(Behaviour::Slow, None, MIN_ORDER, CAUTIOUS_FACTOR)
                }
                Limit::Exists | Limit::Stable if turn <= 0.0 => {
                    self.by_least_squares(Behaviour::Scattered, None, own, range)
                }
                _ => none(Behaviour::Diverging),
            };
        };
        if turn < 0.0 {
            let half = 0.5 * range;
            return self.by_least_squares(Behaviour::Oscillating, Some(observed), own, half);
        }
        if observed > (1.0 + ASYMPTOTIC) * self.formal {
            return self.by_least_squares(Behaviour::Fast, Some(observed), own, 0.0);
        }
        let order = observed.clamp(MIN_ORDER, self.formal);
        if observed >= (1.0 - ASYMPTOTIC) * self.formal {
            by_order(Behaviour::Asymptotic, Some(observed), order, SAFETY_FACTOR)
        } else {
            by_order(Behaviour::Monotone, Some(observed), order, CAUTIOUS_FACTOR)
        }
    }

    /// Fits by least squares with order 1 or 2, whichever is better; the uncertainty is at least `least`. In a seepage
    /// of first order the error of first order prevails on finer cells, even if that of second order does on these.
    fn by_least_squares(
        &self,
        behaviour: Behaviour,
        observed_order: Option<f64>,
        own: f64,
        least: f64,
    ) -> Estimate {
        let [one, two] = [1.0, 2.0].map(|order| Fit::new(&self.values, order));
        let first = self.limit != Limit::Unknown && self.formal < 2.0;
        let fit = if first || one.deviation < two.deviation {
            one
        } else {
            two
        };
        let there = fit.value + fit.slope * self.values[self.at].0.powf(fit.order);
        let error = (there - fit.value).abs();
        let sum = CAUTIOUS_FACTOR * error + fit.deviation + (own - there).abs();
        Estimate {
            behaviour,
            observed_order,
            order: Some(fit.order),
            extrapolated: Some(fit.value),
            factor: Some(CAUTIOUS_FACTOR),
            uncertainty: Some(sum.max(least)),
        }
    }

    fn range(&self) -> f64 {
        let values = self.values.iter().map(|(_, value)| *value);
        let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
        largest - values.fold(f64::INFINITY, f64::min)
    }
}

/// Returns the apparent order of values on three grids, from fine to coarse, with the ratios r21 and r32 of their
/// spacings; none if the differences do not shrink.
#[must_use]
pub fn apparent_order(values: [f64; 3], ratios: [f64; 2]) -> Option<f64> {
    let quotient = (values[2] - values[1]) / (values[1] - values[0]);
    let sign = quotient.signum();
    let grows = |p: f64| {
        let [a, b] = ratios.map(|r| r.powf(p));
        a * (b - sign) / (a - sign) - quotient.abs()
    };
    // The left side increases with p, from its limit at p = 0.
    let limit = if sign > 0.0 {
        ratios[1].ln() / ratios[0].ln()
    } else {
        1.0
    };
    if !(quotient.is_finite() && quotient.abs() > limit) {
        return None;
    }
    let (mut low, mut high) = (1e-9, MAX_ORDER);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if grows(middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(0.5 * (low + high))
}

/// Returns the value extrapolated to zero spacing from a fine and a coarse grid.
#[must_use]
pub fn richardson([fine, coarse]: [f64; 2], ratio: f64, order: f64) -> f64 {
    fine + (fine - coarse) / (ratio.powf(order) - 1.0)
}

/// φ_0 + α h^p of given order by least squares.
struct Fit {
    order: f64,
    value: f64,
    slope: f64,
    /// Standard deviation with the degrees of freedom of the fit.
    deviation: f64,
}

impl Fit {
    fn new(values: &[(f64, f64)], order: f64) -> Self {
        let number = real(values.len());
        let powers: Vec<(f64, f64)> = values
            .iter()
            .map(|(h, value)| (h.powf(order), *value))
            .collect();
        let mean = |of: fn(&(f64, f64)) -> f64| powers.iter().map(of).sum::<f64>() / number;
        let (x, y) = (mean(|v| v.0), mean(|v| v.1));
        let across: f64 = powers.iter().map(|v| (v.0 - x) * (v.1 - y)).sum();
        let along: f64 = powers.iter().map(|v| (v.0 - x).powi(2)).sum();
        let slope = across / along;
        let value = y - slope * x;
        let left: f64 = powers
            .iter()
            .map(|v| (v.1 - value - slope * v.0).powi(2))
            .sum();
        Self {
            order,
            value,
            slope,
            deviation: (left / (number - 2.0)).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Three columns of the sample calculations of Celik et al. 2008: cells of the grids in the plane; values; p,
    /// extrapolated value, index [%]. The third series oscillates.
    const CELIK: [([f64; 3], [f64; 3], [f64; 3]); 3] = [
        (
            [18_000.0, 8_000.0, 4_500.0],
            [6.063, 5.972, 5.863],
            [1.53, 6.1685, 2.2],
        ),
        (
            [18_000.0, 4_500.0, 980.0],
            [10.7880, 10.7250, 10.6050],
            [0.75, 10.8801, 1.1],
        ),
        (
            [18_000.0, 4_500.0, 980.0],
            [6.0042, 5.9624, 6.0909],
            [1.51, 6.0269, 0.5],
        ),
    ];

    #[test]
    fn the_worked_examples_come_out() {
        for (cells, values, [order, extrapolated, index]) in CELIK {
            let ratios = [cells[0] / cells[1], cells[1] / cells[2]].map(f64::sqrt);
            let p = apparent_order(values, ratios).unwrap();
            // All printed digits agree.
            assert!((p - order).abs() < 0.005, "{p} for {order}");
            let phi = richardson([values[0], values[1]], ratios[0], p);
            assert!(
                (phi - extrapolated).abs() < 1e-4,
                "{phi} for {extrapolated}"
            );
            let found = 100.0 * SAFETY_FACTOR * (phi - values[0]).abs() / values[0];
            assert!((found - index).abs() < 0.05, "{found} for {index}");
        }
    }

    fn series(values: &[(f64, f64)]) -> Series {
        Series {
            values: values.to_vec(),
            at: 0,
            formal: 2.0,
            rounding: 1e-12,
            limit: Limit::Unknown,
        }
    }

    /// Returns 3 + a h^p on three grids with two different ratios.
    fn power(a: f64, p: f64) -> Vec<(f64, f64)> {
        let grids: [f64; 3] = [0.1, 0.16, 0.3];
        grids.iter().map(|h| (*h, 3.0 + a * h.powf(p))).collect()
    }

    #[test]
    fn a_series_of_the_formal_order_is_extrapolated_with_the_small_factor() {
        let found = series(&power(0.7, 2.0)).estimate();
        assert_eq!(found.behaviour, Behaviour::Asymptotic);
        assert_relative_eq!(found.observed_order.unwrap(), 2.0, max_relative = 1e-9);
        assert_relative_eq!(found.extrapolated.unwrap(), 3.0, max_relative = 1e-12);
        assert_relative_eq!(
            found.uncertainty.unwrap(),
            1.25 * 0.007,
            max_relative = 1e-9
        );
    }

    #[test]
    fn the_uncertainty_of_a_grid_that_is_not_the_finest_is_its_own() {
        let mut series = series(&power(0.7, 2.0));
        series.at = 1;
        let found = series.estimate();
        assert_relative_eq!(
            found.uncertainty.unwrap(),
            1.25 * 0.7 * 0.16_f64.powi(2),
            max_relative = 1e-9
        );
    }

    #[test]
    fn other_orders_get_the_large_factor_and_bounds() {
        let first = series(&power(0.7, 1.0)).estimate();
        assert_eq!(first.behaviour, Behaviour::Monotone);
        assert_relative_eq!(first.uncertainty.unwrap(), 3.0 * 0.07, max_relative = 1e-9);
        // The series converges faster than the method can: least squares give a larger error.
        let fast = series(&power(0.7, 5.0)).estimate();
        assert_eq!(fast.behaviour, Behaviour::Fast);
        assert_relative_eq!(fast.observed_order.unwrap(), 5.0, max_relative = 1e-9);
        assert_eq!((fast.order, fast.factor), (Some(2.0), Some(3.0)));
        assert!(fast.uncertainty.unwrap() > 3.0 * 0.7 * 1e-5);
        let slow = series(&power(0.7, 0.2)).estimate();
        assert_eq!((slow.order, slow.factor), (Some(0.5), Some(3.0)));
    }

    #[test]
    fn an_oscillating_series_is_fitted_and_covers_half_its_range() {
        let found = series(&[(1.0, 6.0042), (2.0, 5.9624), (4.286, 6.0909)]).estimate();
        assert_eq!(found.behaviour, Behaviour::Oscillating);
        // Normal equations solved by hand: order 2 has the residual 0.0434, order 1 has 0.0543.
        assert_eq!(found.order, Some(2.0));
        assert_relative_eq!(found.extrapolated.unwrap(), 5.970_561, max_relative = 1e-5);
        assert!(found.uncertainty.unwrap() >= 0.5 * (6.0909 - 5.9624));
    }

    /// Checks the drag of a cylinder at Re 20 on cells of 5, 8.9 and 15.8 mm: the two finer values agree by chance, 0.2
    /// % from the published 1.1159e-2.
    #[test]
    fn a_fine_difference_that_is_small_by_chance_is_not_taken_for_the_error() {
        let values = [
            (5.0e-3, 1.118_280_63e-2),
            (8.913e-3, 1.118_224_1e-2),
            (1.5769e-2, 1.092_523_7e-2),
        ];
        let found = series(&values).estimate();
        assert_eq!(found.behaviour, Behaviour::Fast);
        let (error, uncertainty) = (1.118_280_63e-2 - 1.115_907e-2, found.uncertainty.unwrap());
        assert!(uncertainty > error, "{uncertainty}");
        assert!(uncertainty < 0.05 * values[0].1, "{uncertainty}");
    }

    #[test]
    fn nothing_is_promised_for_a_diverging_series() {
        for values in [[1.0, 2.0, 2.5], [1.0, 2.0, 1.5], [1.0, 2.0, 2.0]] {
            let values: Vec<_> = [1.0, 2.0, 4.0].into_iter().zip(values).collect();
            let found = series(&values).estimate();
            assert_eq!(found.behaviour, Behaviour::Diverging, "{values:?}");
            assert_eq!((found.uncertainty, found.extrapolated), (None, None));
        }
        // With growing grid ratios, a comparison of differences alone does not show a divergence: ln h has no
        // limit.
        let log: Vec<_> = [1.0_f64, 1.5, 4.0].iter().map(|h| (*h, h.ln())).collect();
        assert_eq!(series(&log).estimate().behaviour, Behaviour::Diverging);
    }

    /// Discharge under a sheet pile on three grids: its tip lies at other places in the cells, and the differences
    /// change their sign and grow. The exact value (Harr 1962) is 5.471036e-7.
    #[test]
    fn values_that_scatter_about_a_limit_have_an_interval() {
        let values = [(1.0, 5.39679e-7), (2.0, 5.32307e-7), (4.0, 5.34512e-7)];
        let mut series = series(&values);
        series.rounding = 0.0;
        assert_eq!(series.estimate().behaviour, Behaviour::Diverging);
        for limit in [Limit::Stable, Limit::Exists] {
            series.limit = limit;
            let found = series.estimate();
            assert_eq!(found.behaviour, Behaviour::Scattered);
            // The range is 7.372e-9, and the error 7.425e-9.
            let uncertainty = found.uncertainty.unwrap();
            assert!(uncertainty > 7.425e-9, "{uncertainty}");
            assert!(uncertainty < 0.05 * values[0].1, "{uncertainty}");
        }
    }

    /// A slit drain whose end is rounded to cells: the differences grow with one sign. The exact discharge is
    /// 8.681082e-5. A gradient that grows with h^-1/2 has no limit.
    #[test]
    fn a_series_without_an_order_has_an_interval_only_if_it_converges() {
        let mut slit = series(&[(1.0, 8.638744e-5), (2.0, 8.43132e-5), (4.0, 8.311846e-5)]);
        slit.rounding = 0.0;
        slit.limit = Limit::Stable;
        assert_eq!(slit.estimate().uncertainty, None);
        slit.limit = Limit::Exists;
        let found = slit.estimate();
        assert_eq!(found.behaviour, Behaviour::Slow);
        let half_order = 3.0 * (8.638744e-5 - 8.43132e-5) / (2.0_f64.sqrt() - 1.0);
        assert_relative_eq!(found.uncertainty.unwrap(), half_order, max_relative = 1e-9);
        // With a formal order of 1 the fit has order 1, even if the values are those of order 2.
        let mut fast = series(&power(0.7, 2.0));
        (fast.formal, fast.limit) = (1.0, Limit::Exists);
        assert_eq!(fast.estimate().order, Some(1.0));
        // Equal values on the finer grids show no order.
        let mut flat = series(&[(1.0, 1.0), (2.0, 1.0), (4.0, 1.5)]);
        flat.limit = Limit::Exists;
        let found = flat.estimate();
        assert_eq!(found.behaviour, Behaviour::Scattered);
        assert!(found.uncertainty.unwrap() >= 0.5);
    }

    #[test]
    fn two_grids_one_grid_and_rounding() {
        let all = power(0.7, 2.0);
        let two = series(&all[..2]).estimate();
        assert_eq!(
            (two.behaviour, two.factor),
            (Behaviour::TwoGrids, Some(3.0))
        );
        // 0.007 (1.6² - 1) is the difference of the grids, and 0.6 of the error of first order.
        let first_order = 0.007 * (1.6 * 1.6 - 1.0) / 0.6;
        assert_relative_eq!(
            two.uncertainty.unwrap(),
            3.0 * first_order,
            max_relative = 1e-9
        );
        let one = series(&all[..1]).estimate();
        assert_eq!((one.behaviour, one.uncertainty), (Behaviour::OneGrid, None));
        let equal = series(&[(1.0, 1.0), (2.0, 1.0 + 1e-13), (4.0, 1.0)]).estimate();
        assert_eq!(equal.behaviour, Behaviour::Equal);
        // Three times the difference is less than the rounding.
        assert_eq!(equal.uncertainty, Some(1e-12));
    }
}
