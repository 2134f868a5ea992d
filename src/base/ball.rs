//! Closed forms of the volume of a ball inside a box, and the cells at which a row enters and leaves a ball.
//!
//! The functions are separate from their callers because they are compiled for processors and for GPUs
//! (`lbm/gpu/balls.rs`), with the same bits on both. Lengths of boxes are in radii from the centre of the ball, those
//! of rows in cells. The formulas are derived in the package `darcy` (`overlap`).

use crate::number::{ceil, floor_i32, sqrt};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8, PI};
use core::ops::Add;

/// Returns the angle in radians between the x axis and the point (x, y), for coordinates of at least 0; 0 at the
/// origin.
///
/// The error is below two units in the last place. The function has neither branches nor calls, so that loops of it are
/// vectorised, and its bits depend on no system library. The nearest of the angles 0, pi/8 and pi/4 is subtracted by
/// atan(p) - atan(q) = atan((p - q)/(1 + pq)). The remaining angle is below pi/16, where eleven terms of the series of
/// the arctangent are exact to rounding.
#[inline(always)]
fn angle(y: f64, x: f64) -> f64 {
    const TAN_1_16: f64 = 0.198_912_367_379_658;
    const TAN_2_16: f64 = 0.414_213_562_373_095_03;
    const TAN_3_16: f64 = 0.668_178_637_919_298_9;
    let (small, large) = if y < x { (y, x) } else { (x, y) };
    let (tangent, start) = if small > TAN_3_16 * large {
        (1.0, FRAC_PI_4)
    } else if small > TAN_1_16 * large {
        (TAN_2_16, FRAC_PI_8)
    } else {
        (0.0, 0.0)
    };
    let below = large + tangent * small;
    let t = (small - tangent * large) / if below > 0.0 { below } else { 1.0 };
    let z = t * t;
    // Terms are added in pairs, and these in pairs, so that the additions do not form one chain of dependences.
    let (z2, z4) = (z * z, z * z * (z * z));
    let low = (1.0 / 3.0 - z * (1.0 / 5.0)) + z2 * (1.0 / 7.0 - z * (1.0 / 9.0));
    let middle = (1.0 / 11.0 - z * (1.0 / 13.0)) + z2 * (1.0 / 15.0 - z * (1.0 / 17.0));
    let series = low + z4 * (middle + z4 * (1.0 / 19.0 - z * (1.0 / 21.0)));
    let near = start + (t - t * z * series);
    if y > x { FRAC_PI_2 - near } else { near }
}

/// Returns a - a³/3.
#[inline(always)]
pub fn minus_third_of_cube(a: f64) -> f64 {
    a - a * a * a / 3.0
}

/// Returns the square of the coordinate z at which the line x = a, y = b leaves the unit ball; 0 or less if the line
/// does not enter the ball.
#[inline(always)]
pub fn meeting(a: f64, b: f64) -> f64 {
    1.0 - a * a - b * b
}

/// Returns the volume of the part x > a, y > b, z > 0 of the unit ball, for a and b of at least 0; exactly 0 if the
/// line x = a, y = b does not enter the ball.
#[inline(always)]
pub fn edge(a: f64, b: f64) -> f64 {
    edge_by([a, b], minus_third_of_cube, minus_third_of_cube)
}

/// Computes [`edge`] with functions that return [`minus_third_of_cube`] of each coordinate, for callers that have
/// stored it.
#[inline(always)]
pub fn edge_by([a, b]: [f64; 2], less_a: impl Fn(f64) -> f64, less_b: impl Fn(f64) -> f64) -> f64 {
    let squared = 1.0 - a * a - b * b;
    let s = sqrt(if squared > 0.0 { squared } else { 0.0 });
    ((angle(s, a * b) + a * b * s) * (2.0 / 3.0)
        - less_a(a) * angle(s, b)
        - less_b(b) * angle(s, a))
        * 0.5
}

/// Returns a quarter of the volume of the cap of the unit ball beyond a plane at a distance a from the centre.
#[inline(always)]
pub fn cap(a: f64) -> f64 {
    PI / 12.0 * (1.0 - a) * (1.0 - a) * (2.0 + a)
}

/// Returns the volume of the unit ball inside [0, a] x [0, b] x [0, c], for arguments in 0 … 1. `caps` are the values
/// of [`cap`] at a, b and c, `edges` those of [`edge`] at (a, b), (b, c) and (c, a).
#[inline(always)]
pub fn octant_of([a, b, c]: [f64; 3], caps: [f64; 3], edges: [f64; 3]) -> f64 {
    if a * a + b * b + c * c <= 1.0 {
        return a * b * c;
    }
    PI / 6.0 - caps[0] - caps[1] - caps[2] + edges[0] + edges[1] + edges[2]
}

/// Coordinate of a corner of a cell in radii from the centre of the ball, limited to the range of the ball, -1 … 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Coordinate {
    /// Absolute value.
    pub size: f64,
    /// Sign, -1 or 1.
    pub sign: f64,
    /// Value of [`cap`] at the absolute value.
    pub cap: f64,
}

impl Coordinate {
    /// Returns the coordinate of a corner at `x`; `x`, `centre` and `radius` are in cells.
    #[inline(always)]
    pub fn at_corner(x: i32, centre: f64, radius: f64) -> Self {
        let at = ((f64::from(x) - centre) / radius).clamp(-1.0, 1.0);
        Self {
            size: at.abs(),
            sign: at.signum(),
            cap: cap(at.abs()),
        }
    }
}

/// Returns the fraction of a cell inside a ball of `radius` cells. `corner` are the volumes of the unit ball between
/// its centre and each corner ([`octant_of`]), times the signs of the three coordinates; corner c is at the upper end
/// of axis a if bit a of c is set.
#[inline(always)]
pub fn filled(corner: [f64; 8], radius: f64) -> f64 {
    let [c0, c1, c2, c3, c4, c5, c6, c7] = corner;
    let sum = 0.0 - c0 + c1 + c2 - c3 + c4 - c5 - c6 + c7;
    (sum * radius * radius * radius).clamp(0.0, 1.0)
}

/// Squared distances \[cells²\] from the centre of a ball or disc to the cells of a layer or row, measured normal to
/// it.
#[derive(Clone, Copy, Debug, Default)]
pub struct NormalDistances {
    /// Squared distance to the nearest point of the cells.
    pub nearest: f64,
    /// Squared distance to the farthest point of the cells.
    pub farthest: f64,
    /// Squared distance to the farthest point of the adjacent cells on both sides.
    pub beyond: f64,
}

impl NormalDistances {
    /// Returns the distances along one axis of the cells from `lower` to `lower` + 1.
    #[inline(always)]
    pub fn along_axis(centre: f64, lower: f64) -> Self {
        let (low, high) = (lower - centre, lower + 1.0 - centre);
        let near = low.max(-high).max(0.0);
        let far = high.max(-low);
        Self {
            nearest: near * near,
            farthest: far * far,
            beyond: (far + 1.0) * (far + 1.0),
        }
    }
}

impl Add for NormalDistances {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            nearest: self.nearest + other.nearest,
            farthest: self.farthest + other.farthest,
            beyond: self.beyond + other.beyond,
        }
    }
}

/// Empty interval.
pub const EMPTY: [f64; 2] = [0.0, -1.0];

/// Returns the interval \[cells\] in which a line is inside the ball, or [`EMPTY`]. `squared` is the squared distance
/// of the line from the centre, `centre` the coordinate of the centre along the line.
#[inline(always)]
pub fn chord(centre: f64, radius: f64, squared: f64) -> [f64; 2] {
    let left = radius * radius - squared;
    let half = sqrt(if left > 0.0 { left } else { 0.0 });
    if left > 0.0 {
        [centre - half, centre + half]
    } else {
        EMPTY
    }
}

/// Returns the cells that an interval touches, as the first cell and the one after the last. The interval is in the raw
/// frame of the body; `frame` is added to a cell of that frame to obtain a cell of the slab.
#[inline(always)]
pub fn around([low, high]: [f64; 2], frame: i32) -> [i32; 2] {
    [floor_i32(low) + frame, floor_i32(high) + 1 + frame]
}

/// Returns the cells that are inside an interval together with `beside` cells on each side, as the first cell and the
/// one after the last. Frames are those of [`around`].
#[inline(always)]
pub fn within([low, high]: [f64; 2], beside: i32, frame: i32) -> [i32; 2] {
    [
        floor_i32(ceil(low)) + beside + frame,
        floor_i32(high) - beside + frame,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;

    #[test]
    fn angles_to_two_units_in_the_last_place() {
        let mut draws = SplitMix::new(5);
        let mut worst = 0.0_f64;
        for k in 0..100_000 {
            let (x, y) = (draws.uniform(), draws.uniform());
            let (x, y) = match k % 4 {
                0 => (x, y),
                1 => (x * x * x * x * x * x * x * x, y),
                2 => (x, y * y * y * y * y * y * y * y),
                _ => (x, x + (y - 0.5) * 1e-3 * x),
            };
            let exact = y.atan2(x);
            worst = worst.max((angle(y, x) - exact).abs() / (f64::EPSILON * exact));
        }
        assert!(worst < 2.0, "{worst}");
        for (y, x) in [
            (0.0, 0.0),
            (0.0, 1.0),
            (1.0, 0.0),
            (1.0, 1.0),
            (1e-300, 1.0),
            (1.0, 1e-300),
        ] {
            assert!(
                (angle(y, x) - f64::atan2(y, x)).abs() <= f64::EPSILON * f64::atan2(y, x),
                "{y} {x}"
            );
        }
    }
}
