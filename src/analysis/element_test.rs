//! Answers of an element test: stresses, strains and their ratios from the records of the loads on walls.
//!
//! ```text
//! strain = (s(t) - s0)/(H - s0),   s: shortening between the planes, s0 at the start, H: their distance at time 0
//! secant modulus = (sigma_a(t) - sigma_a(t1))/(strain(t) - strain(t1)),   t1: first sample
//! friction angle = asin((R - 1)/(R + 1)),   R = sigma_a/sigma_l
//! ```
//!
//! Each quantity has several measures: both planes of the axis measure the axial stress, each lateral wall or component
//! the lateral one. An answer is their mean and its interval their range. The walls of a sample in equilibrium measure
//! the same, so that the interval shows the deviation from equilibrium. A peak is the largest value of the mean; if it
//! is the last one, the sample may not have reached its peak.

use base::number::real;

/// Records of a test. Each series has an entry for each sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TestRecord {
    /// Times \[s\].
    pub time: Vec<f64>,
    /// Distance of the planes at time 0 \[m\].
    pub height: f64,
    /// Shortening between the planes at which the strain is 0 \[m\].
    pub start: f64,
    /// Shortening between the planes since time 0 \[m\].
    pub shortening: Vec<f64>,
    /// Measures of the axial stress \[Pa\].
    pub axial: Vec<Vec<f64>>,
    /// Measures of the ratio of lateral to axial stress.
    pub lateral_over_axial: Vec<Vec<f64>>,
    /// Measures of the ratio of shear to normal stress on the planes.
    pub shear_over_normal: Vec<Vec<f64>>,
}

/// Number with the range of its measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestResult {
    /// Mean of the measures.
    pub value: f64,
    /// Smallest and largest measure.
    pub interval: [f64; 2],
    /// Time \[s\].
    pub time: f64,
    /// `true` for a peak that is the last of several samples.
    pub peak_at_end: bool,
}

impl TestResult {
    /// Returns the mean and the range of several measurements at a time; none without a measurement, or if one is not
    /// finite.
    fn from_measures(measures: impl Iterator<Item = f64>, time: f64) -> Option<Self> {
        let all: Vec<f64> = measures.collect();
        let finite = !all.is_empty() && all.iter().all(|x| x.is_finite());
        finite.then(|| Self {
            value: all.iter().sum::<f64>() / real(all.len()),
            interval: [
                all.iter().copied().fold(f64::INFINITY, f64::min),
                all.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ],
            time,
            peak_at_end: false,
        })
    }

    /// Returns a rising function of the number.
    fn map(self, of: impl Fn(f64) -> f64) -> Self {
        Self {
            value: of(self.value),
            interval: self.interval.map(of),
            ..self
        }
    }
}

impl TestRecord {
    /// Returns the answer of several measurements at a sample.
    fn at_sample(
        &self,
        measures: &[Vec<f64>],
        sample: usize,
        of: impl Fn(f64) -> f64,
    ) -> Option<TestResult> {
        let values = measures.iter().map(|one| of(one[sample]));
        TestResult::from_measures(values, self.time[sample])
    }

    /// Returns the answer at the sample with the largest mean.
    fn peak(&self, measures: &[Vec<f64>], of: impl Fn(f64) -> f64) -> Option<TestResult> {
        let samples = 0..self.time.len();
        let answers = samples.filter_map(|sample| self.at_sample(measures, sample, &of));
        let answers: Vec<TestResult> = answers.collect();
        let largest = answers
            .iter()
            .max_by(|a, b| a.value.total_cmp(&b.value))
            .copied()?;
        let (first, last) = (answers.first()?, answers.last()?);
        let rises = first.value < largest.value;
        Some(TestResult {
            peak_at_end: rises && last.value >= largest.value,
            ..largest
        })
    }

    /// Returns the last sample.
    fn last(&self) -> Option<usize> {
        self.time.len().checked_sub(1)
    }

    /// Returns the strain of a sample.
    fn strain(&self, sample: usize) -> f64 {
        (self.shortening[sample] - self.start) / (self.height - self.start)
    }

    /// Returns the axial stress at the end \[Pa\].
    #[must_use]
    pub fn axial_stress(&self) -> Option<TestResult> {
        self.at_sample(&self.axial, self.last()?, |stress| stress)
    }

    /// Returns the axial strain at the end.
    #[must_use]
    pub fn axial_strain(&self) -> Option<TestResult> {
        let last = self.last()?;
        TestResult::from_measures(std::iter::once(self.strain(last)), self.time[last])
    }

    /// Returns the secant modulus at the end \[Pa\].
    #[must_use]
    pub fn secant_modulus(&self) -> Option<TestResult> {
        let last = self.last()?;
        let strain = self.strain(last) - self.strain(0);
        let gained = self.axial.iter().map(|one| (one[last] - one[0]) / strain);
        TestResult::from_measures(gained, self.time[last])
    }

    /// Returns the largest axial stress \[Pa\].
    #[must_use]
    pub fn strength(&self) -> Option<TestResult> {
        self.peak(&self.axial, |stress| stress)
    }

    /// Returns the largest ratio of axial to lateral stress.
    #[must_use]
    pub fn peak_stress_ratio(&self) -> Option<TestResult> {
        self.peak(&self.lateral_over_axial, |ratio| 1.0 / ratio)
    }

    /// Returns the angle of friction \[degrees\] of the largest stress ratio.
    #[must_use]
    pub fn peak_friction_angle(&self) -> Option<TestResult> {
        let angle = |ratio: f64| ((ratio - 1.0) / (ratio + 1.0)).asin().to_degrees();
        self.peak_stress_ratio().map(|ratio| ratio.map(angle))
    }

    /// Returns the ratio of lateral to axial stress at the end.
    #[must_use]
    pub fn lateral_stress_ratio(&self) -> Option<TestResult> {
        self.at_sample(&self.lateral_over_axial, self.last()?, |ratio| ratio)
    }

    /// Returns the largest ratio of shear to normal stress on the planes.
    #[must_use]
    pub fn peak_shear_ratio(&self) -> Option<TestResult> {
        self.peak(&self.shear_over_normal, |ratio| ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Checks a test with a peak in the middle and two planes that differ: means, ranges and times are those of the
    /// sample.
    #[test]
    fn answers_are_means_with_the_range_of_the_measures() {
        let record = TestRecord {
            time: vec![1.0, 2.0, 3.0],
            height: 0.5,
            start: 0.1,
            shortening: vec![0.1, 0.14, 0.2],
            axial: vec![vec![10.0, 32.0, 20.0], vec![10.0, 28.0, 24.0]],
            lateral_over_axial: vec![vec![1.0, 0.25, 0.5], vec![1.0, 0.5, 0.5]],
            shear_over_normal: vec![vec![f64::NAN, 0.1, 0.3]],
        };
        let strength = record.strength().unwrap();
        assert_eq!(
            (strength.value, strength.interval, strength.time),
            (30.0, [28.0, 32.0], 2.0)
        );
        let strain = record.axial_strain().unwrap();
        assert_relative_eq!(strain.value, 0.25, max_relative = 1e-14);
        let modulus = record.secant_modulus().unwrap();
        assert_relative_eq!(modulus.value, 48.0, max_relative = 1e-14);
        assert_relative_eq!(modulus.interval[0], 40.0, max_relative = 1e-14);
        let ratio = record.peak_stress_ratio().unwrap();
        assert_eq!((ratio.value, ratio.interval), (3.0, [2.0, 4.0]));
        // asin(1/2).
        let angle = record.peak_friction_angle().unwrap();
        assert_relative_eq!(angle.value, 30.0, max_relative = 1e-14);
        assert!(!strength.peak_at_end && !angle.peak_at_end);
        assert_eq!(record.lateral_stress_ratio().unwrap().value, 0.5);
        // A sample without a load has no ratio.
        let shear = record.peak_shear_ratio().unwrap();
        assert_eq!((shear.value, shear.time), (0.3, 3.0));
        // It still rises at the end; a value that does not change has reached its peak, and a value at the end is none.
        assert!(shear.peak_at_end && !strain.peak_at_end);
        let constant = TestRecord {
            axial: vec![vec![10.0; 3]],
            ..record
        };
        assert!(!constant.strength().unwrap().peak_at_end);
        assert!(TestRecord::default().strength().is_none());
    }
}
