//! Gradings: classes of grain sizes, by count or by mass.

use crate::number::{real, whole};
use serde::{Deserialize, Serialize};

/// A range of radii (m), equally likely, and its part of the grains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Class {
    /// Smallest radius (m).
    pub min: f64,
    /// Largest radius (m).
    pub max: f64,
    /// Part of the number or of the mass.
    pub part: f64,
}

impl Class {
    /// Mean of the square or cube of the radius.
    fn mean_power(&self, power: i32) -> f64 {
        let (a, b) = (self.min, self.max);
        if b - a > 1e-9 * b {
            (b.powi(power + 1) - a.powi(power + 1)) / (f64::from(power + 1) * (b - a))
        } else {
            a.powi(power)
        }
    }
}

/// Classes of sizes, and what their parts are parts of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grading {
    /// Parts of the number of grains.
    ByCount(Vec<Class>),
    /// Parts of their mass.
    ByMass(Vec<Class>),
}

impl Grading {
    /// The classes.
    #[must_use]
    pub fn classes(&self) -> &[Class] {
        match self {
            Self::ByCount(classes) | Self::ByMass(classes) => classes,
        }
    }

    /// How many grains of each class there are among `number` in a space of 2 or 3 dimensions.
    ///
    /// # Errors
    /// A sentence where ranges or parts make no sense, or a class is left without a grain.
    pub fn numbers(&self, number: usize, dimension: usize) -> Result<Vec<usize>, String> {
        let classes = self.classes();
        if classes.is_empty() {
            return Err("a grading needs a class".into());
        }
        for (n, class) in classes.iter().enumerate() {
            if !(class.min > 0.0 && class.min <= class.max && class.max.is_finite()) {
                return Err(format!(
                    "class {n}: radii from {} to {} m",
                    class.min, class.max
                ));
            }
            if !(class.part > 0.0 && class.part <= 1.0) {
                return Err(format!("class {n}: a part of {}", class.part));
            }
        }
        let sum: f64 = classes.iter().map(|class| class.part).sum();
        if (sum - 1.0).abs() > 1e-6 {
            return Err(format!("the parts add up to {sum}, not to 1"));
        }
        let power = if dimension == 2 { 2 } else { 3 };
        let weights: Vec<f64> = match self {
            Self::ByCount(classes) => classes.iter().map(|class| class.part).collect(),
            Self::ByMass(classes) => classes
                .iter()
                .map(|class| class.part / class.mean_power(power))
                .collect(),
        };
        let total: f64 = weights.iter().sum();
        let exact: Vec<f64> = weights.iter().map(|w| w / total * real(number)).collect();
        let mut numbers: Vec<usize> = exact.iter().map(|x| whole(*x)).collect();
        // The largest remainders get what rounding left.
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
            return Err(format!(
                "class {n} (radii {} to {} m) would have {:.3} of {number} grains: its part cannot be met",
                classes[n].min, classes[n].max, exact[n]
            ));
        }
        Ok(numbers)
    }

    /// Area (2-D) or volume (3-D) of `number` grains on average.
    ///
    /// # Errors
    /// As [`Self::numbers`].
    pub fn measure(&self, number: usize, dimension: usize) -> Result<f64, String> {
        let factor = std::f64::consts::PI * if dimension == 2 { 1.0 } else { 4.0 / 3.0 };
        let power = if dimension == 2 { 2 } else { 3 };
        let numbers = self.numbers(number, dimension)?;
        let sums = self.classes().iter().zip(numbers);
        Ok(sums
            .map(|(class, n)| factor * real(n) * class.mean_power(power))
            .sum())
    }

    /// Smallest and largest radius \[m\].
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        self.classes()
            .iter()
            .fold((f64::INFINITY, 0.0), |(low, high), class| {
                (low.min(class.min), high.max(class.max))
            })
    }
}

/// The solid fraction up to which a cloud is placed without overlap: random sequential addition of equal discs ends at 0.547, of equal
/// spheres at 0.384.
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
        let refused =
            |classes: Vec<Class>, number| Grading::ByMass(classes).numbers(number, 3).unwrap_err();
        assert!(refused(classes(), 8).contains("class 1"));
        assert!(refused(Vec::new(), 20).contains("needs a class"));
        let mut wrong = classes();
        wrong[0].part = 0.7;
        assert!(refused(wrong.clone(), 100).contains("add up to"));
        wrong[0].max = 1e-4;
        assert!(refused(wrong, 100).contains("class 0"));
    }
}
