//! Members drawn from the variations by a Latin hypercube instead of all their combinations.
//!
//! With n members, the range of each variation is cut into n strata of equal probability, and each stratum contains
//! exactly one member; the strata of different variations are paired at random. The mean over the members then has
//! a smaller variance than with independent draws, most of all for outputs that are nearly sums of functions of one
//! variable each.
//!
//! Source: M. D. McKay, R. J. Beckman, W. J. Conover, "A comparison of three methods for selecting values of input
//! variables in the analysis of output from a computer code", Technometrics 21 (1979) 239-245.
//!
//! A list of m values has m strata of equal probability: each value is drawn n/m times, rounded up or down. Drawn
//! numbers are rounded to four digits, so that tables, names and cases show them in full.

use super::problems::problem;
use base::error::Problem;
use base::number::{real, whole};
use base::random::Stream;
use case::check;
use schemars::JsonSchema;
use serde::Deserialize;

/// Choice of the members among the combinations of the variations.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Sample {
    /// A Latin hypercube (McKay, Beckman, Conover 1979): each range and each list is covered evenly by a given number
    /// of members.
    LatinHypercube(LatinHypercube),
}

/// A Latin hypercube (McKay, Beckman, Conover 1979): each range and each list is covered evenly by a given number of
/// members.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatinHypercube {
    /// Number of draws.
    #[serde(deserialize_with = "check::whole")]
    #[schemars(range(min = 1, max = 10_000))]
    pub members: u32,
    /// Seed of the random numbers.
    #[serde(default, deserialize_with = "check::whole")]
    pub seed: u64,
    /// Variations that are not drawn: every draw is combined with each of their values.
    #[serde(default)]
    pub crossed: Vec<String>,
}

/// Range of numbers of a variation.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Smallest value.
    pub from: f64,
    /// Largest value.
    pub to: f64,
    /// Spacing of equally probable values.
    #[serde(default)]
    pub scale: Scale,
}

/// Spacing of equally probable values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Scale {
    /// Equal differences.
    #[default]
    Linear,
    /// Equal ratios.
    Logarithmic,
}

impl Range {
    /// Returns the quantile of the range for the probability `share`, rounded to four digits.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => self.from + (self.to - self.from) * share,
            Scale::Logarithmic => self.from * (self.to / self.from).powf(share),
        };
        let rounded = format!("{value:.3e}").parse().unwrap_or(value);
        rounded.clamp(self.from, self.to)
    }

    /// Adds the problems of the range.
    pub(super) fn problems(&self, path: &str, found: &mut Vec<Problem>) {
        let value = format!("{} to {}", self.from, self.to);
        if self.from >= self.to {
            let reason = "a range begins with its smaller end".into();
            found.push(problem(
                path,
                &value,
                reason,
                "exchange `from` and `to`, or write a list",
            ));
        } else if self.scale == Scale::Logarithmic && self.from <= 0.0 {
            let reason = "equal ratios need a range above 0".into();
            found.push(problem(
                path,
                &value,
                reason,
                "use the scale `linear`, or a positive `from`",
            ));
        }
    }
}

impl LatinHypercube {
    /// Returns `true` if a variation is drawn; the others are combined with each draw.
    #[must_use]
    pub fn draws(&self, variation: &str) -> bool {
        !self.crossed.iter().any(|name| name == variation)
    }

    /// Returns the position of every member in the range of variation number `variation`: from 0 to 1, one in each
    /// stratum.
    #[must_use]
    pub fn places(&self, variation: usize) -> Vec<f64> {
        let mut random = Stream::new(self.seed, variation as u64, DRAWS);
        let count = self.members as usize;
        let mut strata: Vec<usize> = (0..count).collect();
        // Shuffle of Fisher and Yates.
        for last in (1..count).rev() {
            let other = whole(random.uniform() * real(last + 1)).min(last);
            strata.swap(last, other);
        }
        let share = |stratum| (real(stratum) + random.uniform()) / real(count);
        strata.into_iter().map(share).collect()
    }
}

/// Identifier of this stream of random numbers, distinct from those of the streams of a run.
const DRAWS: u32 = 0x4c48;

/// Returns the index of the value at a position from 0 to 1 among `count` equally probable values.
#[must_use]
pub fn choice(place: f64, count: usize) -> usize {
    whole((place * real(count)).floor()).min(count.saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::members::{Member, members};
    use crate::sweep::study::Study;
    use serde_json::{Value, json};
    use std::path::Path;

    fn hypercube(members: u32, seed: u64) -> LatinHypercube {
        LatinHypercube {
            members,
            seed,
            crossed: Vec::new(),
        }
    }

    #[test]
    fn every_stratum_of_every_variation_holds_one_member() {
        for count in [1, 7, 100] {
            for variation in 0..3 {
                let places = hypercube(count, 5).places(variation);
                let mut strata: Vec<usize> = places
                    .iter()
                    .map(|place| choice(*place, count as usize))
                    .collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..count as usize).collect::<Vec<_>>());
            }
        }
        assert_ne!(hypercube(9, 1).places(0), hypercube(9, 2).places(0));
        assert_ne!(hypercube(9, 1).places(0), hypercube(9, 1).places(1));
        assert_eq!(hypercube(9, 1).places(0), hypercube(9, 1).places(0));
    }

    /// Checks a sum of functions of one variable each: the variance of its mean is far below that of independent draws,
    /// which is 2/12/n here (McKay, Beckman and Conover, section 2).
    #[test]
    fn the_mean_of_a_sum_varies_less_than_with_independent_draws() {
        let (count, repeats) = (16_u32, 200_u32);
        let means: Vec<f64> = (0..repeats)
            .map(|seed| {
                let drawn = hypercube(count, seed.into());
                let pairs = drawn.places(0).into_iter().zip(drawn.places(1));
                pairs.map(|(x, y)| x + y).sum::<f64>() / f64::from(count)
            })
            .collect();
        let variance = means.iter().map(|m| (m - 1.0).powi(2)).sum::<f64>() / f64::from(repeats);
        let independent = 2.0 / 12.0 / f64::from(count);
        assert!(variance < 0.02 * independent, "{variance} {independent}");
        // Strata are paired at random: no correlation of the variations, on average.
        let products: f64 = (0..repeats)
            .map(|seed| {
                let drawn = hypercube(count, seed.into());
                let pairs = drawn.places(0).into_iter().zip(drawn.places(1));
                pairs.map(|(x, y)| (x - 0.5) * (y - 0.5)).sum::<f64>() / f64::from(count)
            })
            .sum();
        let mean = products / f64::from(repeats);
        // Five standard errors of the mean of 200 covariances of 16 pairs, each of variance 1/12.
        let error = 5.0 / 12.0 / (f64::from(count) * f64::from(repeats)).sqrt();
        assert!(mean.abs() < error, "{mean} {error}");
    }

    #[test]
    fn ranges_are_equal_differences_or_equal_ratios_to_four_digits() {
        let range = |from, to, scale| Range { from, to, scale };
        let linear = range(0.0, 20.0, Scale::Linear);
        assert_eq!(
            [0.0, 0.5, 0.123_456].map(|x| linear.quantile(x)),
            [0.0, 10.0, 2.469]
        );
        let ratios = range(1e-6, 1e-4, Scale::Logarithmic);
        assert_eq!(
            [0.0, 0.5, 1.0].map(|x| ratios.quantile(x)),
            [1e-6, 1e-5, 1e-4]
        );
        let narrow = range(1.000_01, 1.000_04, Scale::Linear);
        assert!((narrow.quantile(0.5) - 1.000_01).abs() < 1e-12);
    }

    fn drawn(change: impl Fn(&mut Value)) -> Result<Vec<Member>, Vec<Problem>> {
        let mut tree: Value = serde_json::from_str(case::examples::STUDY.text).unwrap();
        tree["vary"] = json!({
            "fluid.lattice_boltzmann.relaxation_time": {"from": 0.6, "to": 1.4},
            "operator": {
                "bgk": {"fluid.lattice_boltzmann.collision": {"bgk": {}}},
                "trt": {"fluid.lattice_boltzmann.collision": {"trt": {"magic": 0.1875}}}
            },
            "domain.spacing": [1e-4, 5e-5],
            "fluid.lattice_boltzmann.density": {"from": 500, "to": 2000, "scale": "logarithmic"}
        });
        tree["sample"] =
            json!({"latin_hypercube": {"members": 6, "seed": 3, "crossed": ["domain.spacing"]}});
        change(&mut tree);
        let study = Study::read(&tree.to_string())?;
        members(&study, Path::new(""))
    }

    #[test]
    fn a_study_draws_its_members_and_crosses_what_it_is_told() {
        let all = drawn(|_| {}).unwrap();
        assert_eq!(all.len(), 12);
        let names: Vec<&str> = all.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(
            names[..3],
            [
                "draw-1_spacing=1e-4",
                "draw-1_spacing=5e-5",
                "draw-2_spacing=1e-4"
            ]
        );
        let column = |n: usize| -> Vec<String> {
            let all = all.iter().map(|m| m.labels[n].clone().unwrap());
            all.collect()
        };
        // The tree has its keys in alphabetical order. Three draws of each operator, each at both spacings.
        let bgk = column(3).iter().filter(|name| *name == "bgk").count();
        assert_eq!(bgk, 6);
        for pair in all.chunks(2) {
            let tau = |m: &Member| m.number("fluid.lattice_boltzmann.relaxation_time");
            assert_eq!(tau(&pair[0]), tau(&pair[1]));
            assert_ne!(
                pair[0].number("domain.spacing"),
                pair[1].number("domain.spacing")
            );
        }
        // The table contains the values of the case.
        for member in &all {
            let said: f64 = member.labels[2].as_ref().unwrap().parse().unwrap();
            assert_eq!(
                member.number("fluid.lattice_boltzmann.relaxation_time"),
                Some(said)
            );
        }
        let mut strata: Vec<usize> = all
            .chunks(2)
            .map(|pair| choice((pair[0].value(2).unwrap() - 0.6) / 0.8, 6))
            .collect();
        strata.sort_unstable();
        assert_eq!(strata, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn all_problems_of_a_sample_are_reported_at_once() {
        let problems = drawn(|tree| {
            tree["sample"]["latin_hypercube"]["crossed"] =
                json!(["domain.spcing", "fluid.lattice_boltzmann.density"]);
            tree["vary"]["fluid.lattice_boltzmann.relaxation_time"] = json!({"from": 2, "to": 1});
            tree["vary"]["fluid.lattice_boltzmann.density"]["from"] = json!(0);
            tree["map"] = json!(["operator", "domain.spacing"]);
        })
        .unwrap_err();
        let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
        let text = text.join("\n");
        for part in [
            "did you mean `domain.spacing`?",
            "begins with its smaller end",
            "equal ratios need a range above 0",
            "no values of its own",
            "all combinations of two",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
        let problems = drawn(|tree| {
            tree.as_object_mut().unwrap().remove("sample");
        })
        .unwrap_err();
        assert_eq!(problems.len(), 2, "{problems:?}");
    }
}
