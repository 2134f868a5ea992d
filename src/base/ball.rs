//! A ball in cells: the closed forms of the part of a box that it fills, and where a row of cells enters and leaves it.
//!
//! Lengths of the parts of a box are in radii from the centre, those of rows in cells. These are the functions that
//! both processors and GPUs run (`lbm/gpu/balls.rs`), with the same bits. The package `darcy` has the formulas
//! (`overlap`).

use crate::number::{ceil, floor_i32, sqrt};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_8, PI};
use core::ops::Add;

/// The angle of the point (x, y) above the x axis, for coordinates of 0 or more; 0 at the origin.
///
/// Within two units in the last place. It has neither branches nor calls, so that loops of it are vectorised, and its
/// bits depend on no library of the system. The angle is reduced to that of the nearest of 0, pi/8 and pi/4: atan(p) -
/// atan(q) = atan((p - q)/(1 + pq)). The rest is below pi/16, where eleven terms of the series are exact to rounding.
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
    // Pairs of terms, and pairs of pairs, so that few wait for others.
    let (z2, z4) = (z * z, z * z * (z * z));
    let low = (1.0 / 3.0 - z * (1.0 / 5.0)) + z2 * (1.0 / 7.0 - z * (1.0 / 9.0));
    let middle = (1.0 / 11.0 - z * (1.0 / 13.0)) + z2 * (1.0 / 15.0 - z * (1.0 / 17.0));
    let series = low + z4 * (middle + z4 * (1.0 / 19.0 - z * (1.0 / 21.0)));
    let near = start + (t - t * z * series);
    if y > x { FRAC_PI_2 - near } else { near }
}

/// A coordinate less a third of its cube.
#[inline(always)]
pub fn less_cubed(a: f64) -> f64 {
    a - a * a * a / 3.0
}

/// Square of the coordinate at which the line where two planes at right angles meet leaves the ball; not above 0 where
/// it passes by.
#[inline(always)]
pub fn meeting(a: f64, b: f64) -> f64 {
    1.0 - a * a - b * b
}

/// The ball beyond two planes at right angles, on one side of a third through its centre: exactly 0 where they do not
/// meet in it.
#[inline(always)]
pub fn edge(a: f64, b: f64) -> f64 {
    edge_by([a, b], less_cubed, less_cubed)
}

/// Computes [`edge`] with functions that return [`less_cubed`] of either coordinate.
#[inline(always)]
pub fn edge_by([a, b]: [f64; 2], less_a: impl Fn(f64) -> f64, less_b: impl Fn(f64) -> f64) -> f64 {
    let squared = 1.0 - a * a - b * b;
    let s = sqrt(if squared > 0.0 { squared } else { 0.0 });
    ((angle(s, a * b) + a * b * s) * (2.0 / 3.0)
        - less_a(a) * angle(s, b)
        - less_b(b) * angle(s, a))
        * 0.5
}

/// Quarter of the cap of a unit ball beyond a plane at a distance a.
#[inline(always)]
pub fn cap(a: f64) -> f64 {
    PI / 12.0 * (1.0 - a) * (1.0 - a) * (2.0 + a)
}

/// Unit ball over [0, a] x [0, b] x [0, c], arguments in 0 … 1, from its parts: caps at a, b, c, edges of (a, b), (b,
/// c), (c, a).
#[inline(always)]
pub fn octant_of([a, b, c]: [f64; 3], caps: [f64; 3], edges: [f64; 3]) -> f64 {
    if a * a + b * b + c * c <= 1.0 {
        return a * b * c;
    }
    PI / 6.0 - caps[0] - caps[1] - caps[2] + edges[0] + edges[1] + edges[2]
}

/// A coordinate of the corner of a cell, in radii from the centre; beyond the ball that of its surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct Coordinate {
    /// Its size.
    pub size: f64,
    /// Its sign.
    pub sign: f64,
    /// The cap beyond it.
    pub cap: f64,
}

impl Coordinate {
    /// Returns the coordinate of the corner at `x`.
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

/// The filled part of a cell from the parts of its corners: corner c lies at the upper end of the axes whose bit it
/// has.
#[inline(always)]
pub fn filled(corner: [f64; 8], radius: f64) -> f64 {
    let [c0, c1, c2, c3, c4, c5, c6, c7] = corner;
    let sum = 0.0 - c0 + c1 + c2 - c3 + c4 - c5 - c6 + c7;
    (sum * radius * radius * radius).clamp(0.0, 1.0)
}

/// Squared distances in cells, across a layer or row, of its cells from the centre of a ball or disc.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside {
    /// The nearest point.
    pub nearest: f64,
    /// The farthest point.
    pub farthest: f64,
    /// The farthest point of the cells on each side of them.
    pub beyond: f64,
}

impl Beside {
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

impl Add for Beside {
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

/// An interval without a point.
pub const EMPTY: [f64; 2] = [0.0, -1.0];

/// Returns the interval in which a line at a squared distance from the centre lies in the ball; `centre` is the
/// coordinate of the centre along the line.
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

/// The cells that an interval in the raw frame touches: the first and one past the last. `frame` from the raw frame to
/// the cells.
#[inline(always)]
pub fn around([low, high]: [f64; 2], frame: i32) -> [i32; 2] {
    [floor_i32(low) + frame, floor_i32(high) + 1 + frame]
}

/// The cells that lie, with this many cells on each side, within an interval in the raw frame.
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
