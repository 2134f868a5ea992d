//! Gradings: classes of grain sizes, by number or by mass.

use base::number::{real, whole};
use base::random::Stream;
use case::sieve::{Sieve, Span, spans};
use serde::{Deserialize, Serialize};

/// Range of radii \[m\] with uniform probability, and its fraction of the grains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Class {
    /// Smallest radius \[m\].
    pub min: f64,
    /// Largest radius \[m\].
    pub max: f64,
    /// Fraction of the number or of the mass.
    pub part: f64,
}

impl Class {
    /// Returns the class as a part of a sieve curve.
    fn span(&self) -> Span {
        Span {
            from: 2.0 * self.min,
            to: 2.0 * self.max,
            mass: self.part,
        }
    }

    /// Returns the mean of a power of the radius.
    fn mean_power(&self, power: i32) -> f64 {
        let (a, b) = (self.min, self.max);
        if b - a > 1e-9 * b {
            (b.powi(power + 1) - a.powi(power + 1)) / (f64::from(power + 1) * (b - a))
        } else {
            a.powi(power)
        }
    }
}

/// Classes of sizes, with fractions of the number or of the mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grading {
    /// Fractions of the number of grains.
    ByCount(Vec<Class>),
    /// Fractions of the mass.
    ByMass(Vec<Class>),
    /// Fractions of the mass between the sieves of a curve ([`case::sieve`]).
    Sieve(Vec<Class>),
}

/// Reason why the grains of a grading cannot be drawn. Classes are counted from 0, radii are in m.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the texts name the fields")]
pub enum GradingError {
    /// Grading without a class.
    #[error("a grading needs at least one class")]
    NoClass,
    /// Radii that are not a range above 0.
    #[error(
        "class {class} has radii from {min} to {max} m; both must be above 0, the first no larger than the second"
    )]
    Radii { class: usize, min: f64, max: f64 },
    /// Part that is not a fraction.
    #[error("class {class} has a part of {part}; it must be above 0 and at most 1")]
    Part { class: usize, part: f64 },
    /// Sum of the parts that is not 1.
    #[error("the parts add up to {0}, but must add up to 1")]
    Sum(f64),
    /// Class without a grain: `exact` of `number` grains belong to it.
    #[error(
        "class {class} (radii {min} to {max} m) would have {exact:.3} of {number} grains: its part needs at least \
         about {} grains in total", (real(*.number) / .exact).ceil()
    )]
    EmptyClass {
        class: usize,
        min: f64,
        max: f64,
        exact: f64,
        number: usize,
    },
}

impl Grading {
    /// Returns the grading of a sieve curve.
    #[must_use]
    pub fn of_sieves(curve: &[Sieve]) -> Self {
        let class = |span: Span| Class {
            min: 0.5 * span.from,
            max: 0.5 * span.to,
            part: span.mass,
        };
        Self::Sieve(spans(curve).map(class).collect())
    }

    /// Returns the classes of sizes.
    #[must_use]
    pub fn classes(&self) -> &[Class] {
        match self {
            Self::ByCount(classes) | Self::ByMass(classes) | Self::Sieve(classes) => classes,
        }
    }

    /// Returns the mean square (2-D) or cube (3-D) of the radius over the grains of a class.
    fn mean_measure(&self, class: &Class, dimension: usize) -> f64 {
        let power = if dimension == 2 { 2 } else { 3 };
        match self {
            Self::ByCount(_) | Self::ByMass(_) => class.mean_power(power),
            Self::Sieve(_) => 0.5_f64.powi(power) / class.span().moment(0, dimension),
        }
    }

    /// Returns the radii \[m\] of `number` grains in 2 or 3 dimensions, drawn class by class from a seed; `first`
    /// is the number of grains drawn from it before. For sizes between two sieves the curve is divided into parts
    /// of equal number with one draw in each, so that a few large grains do not change the curve.
    ///
    /// # Errors
    /// If [`Self::numbers`] fails.
    pub fn radii(
        &self,
        number: usize,
        dimension: usize,
        (seed, first): (u64, usize),
    ) -> Result<Vec<f64>, GradingError> {
        let mut radii = Vec::with_capacity(number);
        let numbers = self.numbers(number, dimension)?;
        for (class, count) in self.classes().iter().zip(numbers) {
            for k in 0..count {
                let draw = Stream::new(seed, (first + radii.len()) as u64, SIZES).uniform();
                radii.push(match self {
                    Self::ByCount(_) | Self::ByMass(_) => {
                        class.min + (class.max - class.min) * draw
                    }
                    Self::Sieve(_) => {
                        let part = (real(k) + draw) / real(count);
                        0.5 * class.span().diameter(part, dimension)
                    }
                });
            }
        }
        Ok(radii)
    }

    /// Returns the number of grains of each class among `number` in a space of 2 or 3 dimensions.
    ///
    /// # Errors
    /// If ranges or fractions are inconsistent, or a class has no grain; the text names the class.
    pub fn numbers(&self, number: usize, dimension: usize) -> Result<Vec<usize>, GradingError> {
        let classes = self.classes();
        if classes.is_empty() {
            return Err(GradingError::NoClass);
        }
        for (n, class) in classes.iter().enumerate() {
            if !(class.min > 0.0 && class.min <= class.max && class.max.is_finite()) {
                return Err(GradingError::Radii {
                    class: n,
                    min: class.min,
                    max: class.max,
                });
            }
            if !(class.part > 0.0 && class.part <= 1.0) {
                return Err(GradingError::Part {
                    class: n,
                    part: class.part,
                });
            }
        }
        let sum: f64 = classes.iter().map(|class| class.part).sum();
        if (sum - 1.0).abs() > 1e-6 {
            return Err(GradingError::Sum(sum));
        }
        let weight = |class: &Class| match self {
            Self::ByCount(_) => class.part,
            Self::ByMass(_) | Self::Sieve(_) => class.part / self.mean_measure(class, dimension),
        };
        let weights: Vec<f64> = classes.iter().map(weight).collect();
        let total: f64 = weights.iter().sum();
        let exact: Vec<f64> = weights.iter().map(|w| w / total * real(number)).collect();
        let mut numbers: Vec<usize> = exact.iter().map(|x| whole(*x)).collect();
        // The largest remainders get the grains left over by rounding.
        let mut order: Vec<usize> = (0..classes.len()).collect();
        order.sort_by(|&a, &b| {
            exact[b]
                .fract()
                .total_cmp(&exact[a].fract())
                .then(a.cmp(&b))
        });
        let left = number.saturating_sub(numbers.iter().sum());
        for &k in order.iter().cycle().take(left) {
            numbers[k] += 1;
        }
        if let Some(n) = numbers.iter().position(|n| *n == 0) {
            return Err(GradingError::EmptyClass {
                class: n,
                min: classes[n].min,
                max: classes[n].max,
                exact: exact[n],
                number,
            });
        }
        Ok(numbers)
    }

    /// Returns the mean total area (2-D) or volume (3-D) of `number` grains.
    ///
    /// # Errors
    /// If [`Self::numbers`] fails.
    pub fn measure(&self, number: usize, dimension: usize) -> Result<f64, GradingError> {
        let factor = std::f64::consts::PI * if dimension == 2 { 1.0 } else { 4.0 / 3.0 };
        let numbers = self.numbers(number, dimension)?;
        let sums = self.classes().iter().zip(numbers);
        Ok(sums
            .map(|(class, n)| factor * real(n) * self.mean_measure(class, dimension))
            .sum())
    }

    /// Returns the smallest and largest radius \[m\].
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        self.classes()
            .iter()
            .fold((f64::INFINITY, 0.0), |(low, high), class| {
                (low.min(class.min), high.max(class.max))
            })
    }
}

/// Number that identifies the random numbers for sizes.
const SIZES: u32 = 11;

/// Returns the largest solid fraction of a cloud placed without overlap: random sequential addition ends at 0.547
/// for equal discs and at 0.384 for equal spheres.
#[must_use]
pub fn densest_cloud(dimension: usize) -> f64 {
    if dimension == 2 { 0.45 } else { 0.3 }
}
#[cfg(test)]
mod tests {
    use super::*;

    fn classes() -> Vec<Class> {
        let class = |min: f64, max: f64, part| Class { min, max, part };
        vec![class(0.5e-3, 0.7e-3, 0.8), class(1.0e-3, 1.2e-3, 0.2)]
    }

    #[test]
    fn parts_are_met_by_count_and_by_mass() {
        assert_eq!(
            Grading::ByCount(classes()).numbers(47_702, 3).unwrap(),
            vec![38_162, 9_540]
        );
        let numbers = Grading::ByMass(classes()).numbers(10_000, 3).unwrap();
        assert_eq!(numbers.iter().sum::<usize>(), 10_000);
        let mass = |k: usize| real(numbers[k]) * classes()[k].mean_power(3);
        assert!((mass(1) / (mass(0) + mass(1)) - 0.2).abs() < 2e-4);
    }

    #[test]
    fn gradings_that_cannot_be_are_refused() {
        let refused = |classes: Vec<Class>, number| {
            let refused = Grading::ByMass(classes).numbers(number, 3);
            refused.unwrap_err().to_string()
        };
        assert!(refused(classes(), 8).contains("class 1"));
        assert!(refused(Vec::new(), 20).contains("needs at least one class"));
        let mut wrong = classes();
        wrong[0].part = 0.7;
        assert!(refused(wrong.clone(), 100).contains("add up to"));
        wrong[0].max = 1e-4;
        assert!(refused(wrong, 100).contains("class 0"));
    }

    /// Returns the curve of a medium sand with some silt and gravel.
    fn curve() -> Vec<Sieve> {
        let sieve = |diameter, passing| Sieve { diameter, passing };
        vec![
            sieve(0.063e-3, 0.0),
            sieve(0.2e-3, 0.12),
            sieve(0.63e-3, 0.7),
            sieve(2e-3, 0.95),
            sieve(4e-3, 1.0),
        ]
    }

    #[test]
    fn a_large_sample_follows_the_sieve_curve_by_mass() {
        for (dimension, number) in [(2, 300_000), (3, 3_000_000)] {
            let grading = Grading::of_sieves(&curve());
            let radii = grading.radii(number, dimension, (7, 0)).unwrap();
            assert_eq!(radii.len(), number);
            let mass = |r: &f64| r.powi(if dimension == 2 { 2 } else { 3 });
            let total: f64 = radii.iter().map(mass).sum();
            // At the sieves and between them, where the curve is linear in the logarithm of the size.
            for pair in curve().windows(2) {
                for share in [0.0, 0.3, 0.7, 1.0] {
                    let limit = pair[0].diameter.powf(1.0 - share) * pair[1].diameter.powf(share);
                    let below = radii.iter().filter(|r| 2.0 * **r <= limit * (1.0 + 1e-9));
                    let passing = below.map(mass).sum::<f64>() / total;
                    let exact = pair[0].passing + share * (pair[1].passing - pair[0].passing);
                    assert!(
                        (passing - exact).abs() < 0.01,
                        "{dimension} {limit} {passing} {exact}"
                    );
                }
            }
            // By number, almost all grains pass the sieve that 12 % of the mass passes.
            let small = radii.iter().filter(|r| 2.0 * **r <= 0.2e-3).count();
            assert!(real(small) > 0.55 * real(number), "{small}");
            let measure = grading.measure(number, dimension).unwrap();
            let factor = std::f64::consts::PI * if dimension == 2 { 1.0 } else { 4.0 / 3.0 };
            assert!((factor * total / measure - 1.0).abs() < 0.01);
            let found = case::sieve::Percentiles::from_radii(radii.iter().copied(), dimension);
            let d60 = 0.2e-3 * (3.15_f64).powf(0.48 / 0.58);
            assert!((found.unwrap().d60 / d60 - 1.0).abs() < 0.02);
        }
    }

    #[test]
    fn a_sieve_without_a_grain_is_refused_with_the_number_that_it_needs() {
        let grading = Grading::of_sieves(&curve());
        let reason = grading.numbers(10_000, 3).unwrap_err().to_string();
        assert!(reason.contains("class 3"), "{reason}");
        let needed: usize = reason.rsplit(' ').nth(3).unwrap().parse().unwrap();
        assert!(needed > 10_000);
        assert!(grading.numbers(needed, 3).is_ok());
    }
}
