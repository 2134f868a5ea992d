//! The times at which hole, arch, sinkhole and extension begin. [`super`] defines the criteria.

use serde::{Deserialize, Serialize};

/// Names of the four stages.
pub const NAMES: [&str; 4] = ["hidden hole", "arch", "sinkhole", "extension"];

/// Evidence in one sample: the maximum over the points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Grains that left through one point so far.
    pub eroded_grains: u64,
    /// Volume of the void over one point \[m3\].
    pub void_volume: f64,
    /// Moving fraction of the cover over points with a void of at least [`Thresholds::arch_void`]; 0 if there is
    /// none.
    pub front: f64,
    /// Shape of this front: 1/3 is a triangle with its apex up, 1 a rectangle; NaN if no cell moves.
    pub shape: f64,
    /// Settlement of a column over a point, or of both of two neighbouring columns \[m\].
    pub settlement: f64,
    /// Longest depression along the long axis \[m\].
    pub longest: f64,
    /// Width of the depressions \[m\].
    pub width: f64,
    /// Displacement of the soil at the sides of the points towards the points \[m\].
    pub inward: f64,
}

/// Thresholds above which a sample shows a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Number of consecutive samples.
    pub samples: u32,
    /// t1: minimum number of grains that left.
    pub eroded_grains: u64,
    /// t1: or minimum volume of a void \[m3\].
    pub void_volume: f64,
    /// t2: minimum moving fraction of the cover.
    pub front: f64,
    /// t2: minimum volume of the void below it \[m3\].
    pub arch_void: f64,
    /// t3: minimum settlement \[m\].
    pub settlement: f64,
    /// t4: minimum length divided by that of the sinkhole at t3.
    pub extension: f64,
    /// t4: minimum inward displacement \[m\].
    pub inward: f64,
}

/// Consecutive samples that show a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Streak {
    samples: u32,
    /// Time of the first of these samples \[s\].
    time: f64,
    /// Longer side of the depression at the first of these samples \[m\].
    extent: f64,
    /// Shape of the front at the first of these samples.
    #[serde(default)]
    shape: Option<f64>,
}

/// Stages so far, which a restart needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stages {
    /// Start of each stage \[s\].
    pub times: [Option<f64>; 4],
    streaks: [Streak; 4],
    /// Longer side of the sinkhole at t3 \[m\].
    sinkhole: Option<f64>,
    /// Shapes of the front at the start of arch and sinkhole.
    #[serde(default)]
    pub shapes: [Option<f64>; 2],
}

impl Stages {
    /// Returns the number of stages that have begun.
    #[must_use]
    pub fn stages_begun(&self) -> usize {
        self.times.iter().flatten().count()
    }

    /// Records a sample; returns the stages (0 … 3) whose start it confirms.
    pub fn note(&mut self, time: f64, seen: &Evidence, from: &Thresholds) -> Vec<usize> {
        let wide = self
            .sinkhole
            .is_some_and(|sinkhole| seen.longest >= from.extension * sinkhole);
        let shown = [
            seen.eroded_grains >= from.eroded_grains || seen.void_volume >= from.void_volume,
            // The ground over a void moves while the surface is stationary.
            seen.front >= from.front && seen.settlement < from.settlement,
            seen.settlement >= from.settlement,
            wide && seen.inward >= from.inward,
        ];
        let mut news = Vec::new();
        for (stage, shown) in shown.into_iter().enumerate() {
            if self.times[stage].is_some() {
                continue;
            }
            let streak = &mut self.streaks[stage];
            if !shown {
                *streak = Streak::default();
                continue;
            }
            if streak.samples == 0 {
                *streak = Streak {
                    samples: 0,
                    time,
                    extent: seen.longest.max(seen.width),
                    shape: Some(seen.shape).filter(|shape| shape.is_finite()),
                };
            }
            streak.samples += 1;
            if streak.samples >= from.samples {
                self.times[stage] = Some(streak.time);
                if stage == 1 || stage == 2 {
                    self.shapes[stage - 1] = streak.shape;
                }
                if stage == 2 {
                    self.sinkhole = Some(streak.extent);
                }
                news.push(stage);
            }
        }
        news
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FROM: Thresholds = Thresholds {
        samples: 2,
        eroded_grains: 10,
        void_volume: 1e-6,
        front: 0.5,
        arch_void: 1e-6,
        settlement: 0.01,
        extension: 1.5,
        inward: 0.001,
    };

    #[test]
    fn a_stage_begins_with_the_first_of_samples_in_a_row() {
        let mut stages = Stages::default();
        let hole = |eroded_grains| Evidence {
            eroded_grains,
            ..Evidence::default()
        };
        assert!(stages.note(0.0, &hole(10), &FROM).is_empty());
        assert!(stages.note(1.0, &hole(9), &FROM).is_empty());
        assert!(stages.note(2.0, &hole(11), &FROM).is_empty());
        assert_eq!(stages.note(3.0, &hole(12), &FROM), [0]);
        assert_eq!(stages.times, [Some(2.0), None, None, None]);
        // Each stage begins only once.
        assert!(stages.note(4.0, &hole(12), &FROM).is_empty());
        assert_eq!(stages.stages_begun(), 1);
    }

    #[test]
    fn extension_is_measured_by_the_sinkhole() {
        let mut stages = Stages::default();
        let mut seen = Evidence {
            settlement: 0.02,
            longest: 0.04,
            width: 0.06,
            inward: 0.01,
            ..Evidence::default()
        };
        stages.note(0.0, &seen, &FROM);
        assert_eq!(stages.note(1.0, &seen, &FROM), [2]);
        seen.longest = 0.08;
        stages.note(2.0, &seen, &FROM);
        assert!(stages.note(3.0, &seen, &FROM).is_empty());
        // 1.5 times the width, but the adjacent soil is stationary: only the hole has widened.
        seen.longest = 0.091;
        seen.inward = 0.0;
        stages.note(4.0, &seen, &FROM);
        assert!(stages.note(5.0, &seen, &FROM).is_empty());
        seen.inward = 0.002;
        stages.note(6.0, &seen, &FROM);
        assert_eq!(stages.note(7.0, &seen, &FROM), [3]);
        assert_eq!(stages.times, [None, None, Some(0.0), Some(6.0)]);
    }

    /// Checks that moving ground below a surface that has sunk is not an arch. The shapes are those of the first
    /// samples.
    #[test]
    fn an_arch_stands_under_a_surface_at_rest() {
        let moves = |settlement, shape| Evidence {
            front: 0.9,
            shape,
            settlement,
            ..Evidence::default()
        };
        let mut late = Stages::default();
        for n in 0..4 {
            late.note(f64::from(n), &moves(0.02, 0.8), &FROM);
        }
        assert_eq!(late.times, [None, None, Some(0.0), None]);
        let mut stages = Stages::default();
        stages.note(0.0, &moves(0.0, 0.35), &FROM);
        stages.note(1.0, &moves(0.0, 0.5), &FROM);
        stages.note(2.0, &moves(0.02, 0.9), &FROM);
        stages.note(3.0, &moves(0.02, 1.0), &FROM);
        assert_eq!(stages.times, [None, Some(0.0), Some(2.0), None]);
        assert_eq!(stages.shapes, [Some(0.35), Some(0.9)]);
    }

    #[test]
    fn arch_and_hole_by_volume_do_not_wait_for_each_other() {
        let mut stages = Stages::default();
        let seen = Evidence {
            front: 0.5,
            void_volume: 1e-6,
            ..Evidence::default()
        };
        stages.note(0.5, &seen, &FROM);
        assert_eq!(stages.note(1.0, &seen, &FROM), [0, 1]);
        let text = serde_json::to_string(&stages).unwrap();
        assert_eq!(serde_json::from_str::<Stages>(&text).unwrap(), stages);
    }
}
