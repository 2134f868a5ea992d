//! Grading by a sieve curve: the fraction of the mass that passes each sieve.
//!
//! Between two sieves of openings a < b the passing mass rises linearly with the logarithm of the diameter, as in
//! the usual diagram. With the fraction m of the mass between them, the mass and the number of grains per diameter
//! are
//!
//! ```text
//! dm/dd = m/[d ln(b/a)]        dn/dd = m/[d^(D+1) ln(b/a)]        D = 3 for spheres, 2 for discs of the plane
//! n = m (a^-D - b^-D)/[D ln(b/a)]
//! d(u) = [a^-D - u (a^-D - b^-D)]^(-1/D)                          diameter below which the part u of the number lies
//! ```
//!
//! because the mass of a grain is proportional to d^D. Percentile diameters and the coefficients of uniformity and
//! curvature are those of ISO 14688-2: C_u = d60/d10, C_c = d30^2/(d10 d60).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point of a sieve curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sieve {
    /// Opening of the sieve: diameter of the largest grains that pass it [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub diameter: f64,
    /// Fraction of the mass that passes [1], not per cent: 0 at the finest sieve, 1 at the coarsest.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub passing: f64,
}

/// Grains between two sieves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Smallest diameter \[m\].
    pub from: f64,
    /// Largest diameter \[m\].
    pub to: f64,
    /// Fraction of the mass.
    pub mass: f64,
}

impl Span {
    /// Returns the ratio of the number of grains to their mass, in units of a grain of diameter 1, in 2 or 3
    /// dimensions.
    #[must_use]
    pub fn number(&self, dimension: usize) -> f64 {
        self.mass * self.moment(0, dimension)
    }

    /// Returns the integral of d^power over the number of grains, for a mass of 1 \[m^(power - D)\].
    #[must_use]
    pub fn moment(&self, power: i32, dimension: usize) -> f64 {
        let log = (self.to / self.from).ln();
        let rest = power - exponent(dimension);
        if rest == 0 {
            return 1.0;
        }
        // For nearly equal sieves the difference of two powers would lose digits.
        self.from.powi(rest) * (f64::from(rest) * log).exp_m1() / (f64::from(rest) * log)
    }

    /// Returns the diameter below which this fraction of the number of grains lies \[m\].
    #[must_use]
    pub fn diameter(&self, part: f64, dimension: usize) -> f64 {
        let power = exponent(dimension);
        let ratio = (self.from / self.to).powi(power);
        let root = (1.0 - part * (1.0 - ratio)).powf(-1.0 / f64::from(power));
        (self.from * root).clamp(self.from, self.to)
    }
}

fn exponent(dimension: usize) -> i32 {
    if dimension == 2 { 2 } else { 3 }
}

/// Returns the intervals of a curve that contain grains.
pub fn spans(curve: &[Sieve]) -> impl Iterator<Item = Span> {
    let pairs = curve.windows(2).map(|pair| Span {
        from: pair[0].diameter,
        to: pair[1].diameter,
        mass: pair[1].passing - pair[0].passing,
    });
    pairs.filter(|span| span.mass > 0.0)
}

/// Checks a sieve curve.
///
/// # Errors
/// If the curve is invalid; the text names the sieve.
pub fn check(curve: &[Sieve]) -> Result<(), String> {
    if curve.len() < 2 {
        return Err("a sieve curve needs at least two sieves".into());
    }
    for (n, sieve) in curve.iter().enumerate() {
        if !(sieve.diameter > 0.0 && sieve.diameter.is_finite()) {
            return Err(format!(
                "sieve {n} has a diameter of {} m; it must be above 0",
                sieve.diameter
            ));
        }
        if !(0.0..=1.0).contains(&sieve.passing) {
            return Err(format!(
                "sieve {n} passes {} of the mass; write a fraction from 0 to 1, not per cent",
                sieve.passing
            ));
        }
    }
    for (n, pair) in curve.windows(2).enumerate() {
        if pair[1].diameter <= pair[0].diameter * (1.0 + 1e-9) {
            return Err(format!(
                "sieve {} has a diameter of {} m and follows one of {} m; diameters must increase from sieve to \
                 sieve",
                n + 1,
                pair[1].diameter,
                pair[0].diameter
            ));
        }
        if pair[1].passing < pair[0].passing {
            return Err(format!(
                "{} of the mass passes sieve {}, less than the {} that passes the finer one",
                pair[1].passing,
                n + 1,
                pair[0].passing
            ));
        }
    }
    let (finest, coarsest) = (curve[0], curve[curve.len() - 1]);
    if finest.passing > 0.0 {
        return Err(format!(
            "{} of the mass passes the finest sieve of {} m, so that the size of these grains is not known: \
             begin with a diameter that no grain passes",
            finest.passing, finest.diameter
        ));
    }
    if (coarsest.passing - 1.0).abs() > 1e-9 {
        return Err(format!(
            "only {} of the mass passes the coarsest sieve of {} m: end with a diameter that all grains pass",
            coarsest.passing, coarsest.diameter
        ));
    }
    Ok(())
}

/// Returns the smallest and largest diameter of the grains \[m\].
#[must_use]
pub fn bounds(curve: &[Sieve]) -> (f64, f64) {
    spans(curve).fold((f64::INFINITY, 0.0), |(low, high), span| {
        (span.from.min(low), span.to.max(high))
    })
}

/// Returns the mean over the number of grains of a power of the diameter \[m^power\].
#[must_use]
pub fn mean_power(curve: &[Sieve], power: i32, dimension: usize) -> f64 {
    let (mut sum, mut number) = (0.0, 0.0);
    for span in spans(curve) {
        sum += span.mass * span.moment(power, dimension);
        number += span.number(dimension);
    }
    sum / number
}

/// Returns the diameter below which this fraction of the number of grains lies \[m\].
#[must_use]
pub fn diameter(curve: &[Sieve], part: f64, dimension: usize) -> f64 {
    let all: f64 = spans(curve).map(|span| span.number(dimension)).sum();
    let mut left = part * all;
    let mut last = 0.0;
    for span in spans(curve) {
        let number = span.number(dimension);
        if left < number {
            return span.diameter(left / number, dimension);
        }
        left -= number;
        last = span.to;
    }
    last
}

/// Diameters that 10, 30, 50 and 60 % of the mass of grains pass, and coefficients derived from them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// d10 \[m\].
    pub d10: f64,
    /// d30 \[m\].
    pub d30: f64,
    /// d50 \[m\].
    pub d50: f64,
    /// d60 \[m\].
    pub d60: f64,
    /// Coefficient of uniformity, d60/d10.
    pub uniformity: f64,
    /// Coefficient of curvature, d30^2/(d10 d60).
    pub curvature: f64,
}

impl Percentiles {
    /// Returns the percentiles of grains with these radii \[m\] and equal density; none without grains. A
    /// percentile is the diameter of the grain at which the cumulative mass in ascending order of size reaches it.
    #[must_use]
    pub fn from_radii(radii: impl Iterator<Item = f64>, dimension: usize) -> Option<Self> {
        let mut diameters: Vec<f64> = radii.map(|r| 2.0 * r).collect();
        diameters.sort_by(f64::total_cmp);
        let power = exponent(dimension);
        let total: f64 = diameters.iter().map(|d| d.powi(power)).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut found = [0.0; 4];
        let (mut passed, mut next) = (0.0, 0);
        for diameter in &diameters {
            passed += diameter.powi(power);
            while next < 4 && passed >= [0.1, 0.3, 0.5, 0.6][next] * total {
                found[next] = *diameter;
                next += 1;
            }
        }
        let [d10, d30, d50, d60] = found;
        Some(Self {
            d10,
            d30,
            d50,
            d60,
            uniformity: d60 / d10,
            curvature: d30 * d30 / (d10 * d60),
        })
    }
}

impl std::fmt::Display for Percentiles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "d10 {:.3e} m, d50 {:.3e} m, d60 {:.3e} m, C_u {:.2}, C_c {:.2}",
            self.d10, self.d50, self.d60, self.uniformity, self.curvature
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve() -> Vec<Sieve> {
        let sieve = |diameter, passing| Sieve { diameter, passing };
        vec![
            sieve(0.25e-3, 0.0),
            sieve(0.5e-3, 0.1),
            sieve(1e-3, 0.45),
            sieve(1.5e-3, 0.45),
            sieve(4e-3, 1.0),
        ]
    }

    #[test]
    fn numbers_and_means_agree_with_quadrature() {
        for dimension in [2, 3] {
            for power in 0..4 {
                let (mut sum, mut number) = (0.0, 0.0);
                for span in spans(&curve()) {
                    let n = 200_000;
                    let log = (span.to / span.from).ln();
                    for k in 0..n {
                        // Equal steps of the logarithm contain equal masses.
                        let d = span.from * (log * (f64::from(k) + 0.5) / f64::from(n)).exp();
                        let grains = span.mass / f64::from(n) / d.powi(exponent(dimension));
                        sum += grains * d.powi(power);
                        number += grains;
                    }
                }
                let mean = mean_power(&curve(), power, dimension);
                assert!(
                    (mean / (sum / number) - 1.0).abs() < 1e-9,
                    "{dimension} {power}"
                );
            }
        }
    }

    #[test]
    fn a_large_sample_has_the_curve_by_mass_and_not_by_number() {
        for dimension in [2, 3] {
            let n = 2_000_000;
            let mut diameters: Vec<f64> = (0..n)
                .map(|k| diameter(&curve(), (f64::from(k) + 0.5) / f64::from(n), dimension))
                .collect();
            diameters.sort_by(f64::total_cmp);
            let total: f64 = diameters.iter().map(|d| d.powi(exponent(dimension))).sum();
            let below = |limit: f64| {
                let passing = diameters.iter().take_while(|d| **d <= limit);
                passing.fold((0.0, 0.0), |(mass, number), d| {
                    (
                        mass + d.powi(exponent(dimension)) / total,
                        number + 1.0 / f64::from(n),
                    )
                })
            };
            for sieve in &curve() {
                let (mass, number) = below(sieve.diameter * (1.0 + 1e-12));
                assert!((mass - sieve.passing).abs() < 1e-4, "{mass} {sieve:?}");
                if sieve.passing > 0.0 && sieve.passing < 1.0 {
                    assert!(number > sieve.passing + 0.3, "{number} {sieve:?}");
                }
            }
            // Half way between two sieves on the logarithmic axis half of their mass passes.
            let (mass, _) = below((0.5e-3_f64 * 1e-3).sqrt());
            assert!((mass - 0.275).abs() < 1e-4);
            let found =
                Percentiles::from_radii(diameters.iter().map(|d| 0.5 * d), dimension).unwrap();
            assert!((found.d10 / 0.5e-3 - 1.0).abs() < 1e-3);
            let d60 = 1.5e-3 * (4.0_f64 / 1.5).powf(0.15 / 0.55);
            assert!((found.d60 / d60 - 1.0).abs() < 1e-3);
            assert!((found.uniformity - found.d60 / found.d10).abs() < 1e-15);
        }
    }

    #[test]
    fn curves_that_cannot_be_are_refused() {
        assert!(check(&curve()).is_ok());
        let refused = |change: &dyn Fn(&mut Vec<Sieve>)| {
            let mut wrong = curve();
            change(&mut wrong);
            check(&wrong).unwrap_err()
        };
        assert!(refused(&|c| c.truncate(1)).contains("two sieves"));
        assert!(refused(&|c| c[4].passing = 100.0).contains("not per cent"));
        assert!(refused(&|c| c[4].passing = 0.9).contains("coarsest"));
        assert!(refused(&|c| c[0].passing = 0.05).contains("finest"));
        assert!(refused(&|c| c.swap(1, 2)).contains("increase"));
        assert!(refused(&|c| c[3].passing = 0.4).contains("less than"));
        assert!(refused(&|c| c[0].diameter = 0.0).contains("sieve 0"));
    }

    #[test]
    fn a_narrow_span_keeps_its_digits() {
        let span = Span {
            from: 1e-3,
            to: 1e-3 * (1.0 + 1e-8),
            mass: 1.0,
        };
        assert!((span.number(3) / 1e9 - 1.0).abs() < 1e-7);
    }
}
