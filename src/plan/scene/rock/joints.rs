//! Joint sets: parallel planes with an orientation and a distribution of their spacing.
//!
//! The orientation follows geological convention, with x to the east, y to the north and z up. The dip is the angle
//! of the plane's steepest line below the horizontal, 0 … 90°. The dip direction is the bearing of that line,
//! clockwise from north, 0 … 360°.
//!
//! ```text
//! n = (sin dip sin direction, sin dip cos direction, cos dip)       upward normal
//! ```
//!
//! Spacing is measured along the normal. One plane passes through the origin of the set; the gaps on both sides are
//! drawn one after another. Scan lines mostly show a negative exponential spacing, that of randomly placed joints: S.
//! D. Priest, J. A. Hudson, Int. J. Rock Mech. Min. Sci. & Geomech. Abstr. 13 (1976) 135.

use nalgebra::Vector3;

use base::random::Stream;

/// Purpose number of the random numbers for gaps.
const GAPS: u32 = 21;

/// Set of parallel joints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSet {
    /// Upward unit normal.
    pub normal: Vector3<f64>,
    /// Point on one of the planes \[m\].
    pub origin: Vector3<f64>,
    /// Distribution of the distance between planes.
    pub spacing: Spacing,
    /// Probability that a joint cuts a block that it crosses.
    pub persistence: f64,
}

/// Distribution of the distance \[m\] between neighbouring planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spacing {
    /// Constant distance.
    Constant(f64),
    /// Uniform distribution between two bounds.
    Uniform {
        /// Lower bound \[m\].
        min: f64,
        /// Upper bound \[m\].
        max: f64,
    },
    /// Negative exponential distribution.
    Exponential {
        /// Mean of the distribution \[m\].
        mean: f64,
    },
    /// Normal distribution; values that are not positive are drawn again.
    Normal {
        /// Mean of the distribution \[m\].
        mean: f64,
        /// Standard deviation \[m\].
        standard_deviation: f64,
    },
}

impl Spacing {
    /// Returns the mean distance \[m\].
    #[must_use]
    pub fn mean(&self) -> f64 {
        match *self {
            Self::Constant(mean) | Self::Exponential { mean } | Self::Normal { mean, .. } => mean,
            Self::Uniform { min, max } => 0.5 * (min + max),
        }
    }

    /// Returns a random distance \[m\].
    fn draw(&self, draws: &mut Stream) -> f64 {
        match *self {
            Self::Constant(gap) => gap,
            Self::Uniform { min, max } => min + (max - min) * draws.uniform(),
            Self::Exponential { mean } => -mean * (1.0 - draws.uniform()).ln(),
            Self::Normal {
                mean,
                standard_deviation,
            } => loop {
                let gap = mean + standard_deviation * standard_normal(draws);
                if gap > 0.0 {
                    break gap;
                }
            },
        }
    }
}

/// Returns a standard normal number by the Box-Muller transform.
fn standard_normal(draws: &mut Stream) -> f64 {
    let length = (-2.0 * (1.0 - draws.uniform()).ln()).sqrt();
    length * (std::f64::consts::TAU * draws.uniform()).cos()
}

/// Returns the upward unit normal of a plane with this dip and dip direction \[deg\].
#[must_use]
pub fn upward_normal(dip: f64, direction: f64) -> Vector3<f64> {
    let (sin, cos) = dip.to_radians().sin_cos();
    let (east, north) = direction.to_radians().sin_cos();
    // Right angles must give exact zeros: three perpendicular sets then cut bricks.
    Vector3::new(sin * east, sin * north, cos)
        .map(|c| if c.abs() < 1e-15 { 0.0 } else { c })
        .normalize()
}

impl JointSet {
    /// Returns the distances \[m\] from the origin of coordinates, along the normal, of the planes between two
    /// bounds, in ascending order. `place` is the index of the set: sets with equal seeds differ by it.
    #[must_use]
    pub fn offsets(&self, seed: u64, place: u32, low: f64, high: f64) -> Vec<f64> {
        let first = self.normal.dot(&self.origin);
        let walk = |up: bool| {
            let sign = if up { 1.0 } else { -1.0 };
            let mut draws = Stream::new(seed, u64::from(place) << 1 | u64::from(up), GAPS);
            let (mut far, mut k) = (0.0, 0.0);
            let spacing = self.spacing;
            std::iter::from_fn(move || {
                k += 1.0;
                far = match spacing {
                    // A product, so that rounding errors do not accumulate.
                    Spacing::Constant(gap) => k * gap,
                    _ => far + spacing.draw(&mut draws),
                };
                Some(first + sign * far)
            })
        };
        let mut offsets: Vec<f64> = walk(false).take_while(|&at| at > low).collect();
        offsets.push(first);
        offsets.extend(walk(true).take_while(|&at| at < high));
        offsets.retain(|&at| at > low && at < high);
        offsets.sort_by(f64::total_cmp);
        offsets
    }
}
