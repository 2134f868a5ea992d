//! Volume of a sphere inside a box, and area of a disc inside a rectangle, in closed form.
//!
//! `G(a, b, c)` is the volume of the unit ball over `[0, a] x [0, b] x [0, c]`, odd in each argument; a box is the
//! sum of eight of them with signs, so that the parts of a grain in neighbouring cells complement each other to
//! round-off whatever the error of `G`. Within the octant, where the corner (a, b, c) lies inside the ball, `G =
//! abc`; otherwise no point of the ball lies beyond all three planes, and by inclusion and exclusion
//!
//! ```text
//! G = pi/6 - C(a) - C(b) - C(c) + E(a, b) + E(b, c) + E(c, a)
//! C(a)    = pi (1 - a)^2 (2 + a) / 12                    a quarter of a cap
//! E(a, b) = [atan2(s, a b) + a b s]/3 - [P(a) atan2(s, b) + P(b) atan2(s, a)]/2,   ball beyond x = a, y = b and z > 0
//! P(a) = a - a^3/3,   s^2 = 1 - a^2 - b^2                (0 where a^2 + b^2 >= 1)
//! ```
//!
//! `E` follows from integrating circular segments by parts; compare the wedges of S. Strobl, A. Formella and T.
//! Pöschel, J. Comput. Phys. 311 (2016) 158.

use base::ball::{cap, edge, octant_of};
use std::f64::consts::PI;

/// Returns the volume of the unit ball over [0, a] x [0, b] x [0, c], arguments in 0 … 1.
fn octant(a: f64, b: f64, c: f64) -> f64 {
    if a * a + b * b + c * c <= 1.0 {
        return a * b * c;
    }
    // Most pairs lie beyond the circle, where the edge function is 0: a branch saves its arctangents.
    let edge = |a: f64, b: f64| {
        if 1.0 - a * a - b * b > 0.0 {
            edge(a, b)
        } else {
            0.0
        }
    };
    octant_of(
        [a, b, c],
        [cap(a), cap(b), cap(c)],
        [edge(a, b), edge(b, c), edge(c, a)],
    )
}

/// Returns half the area of the segment of the unit disc beyond a distance a from its centre, 0 … 1.
pub fn segment(a: f64) -> f64 {
    let s = (1.0 - a * a).max(0.0).sqrt();
    0.5 * (s.atan2(a) - a * s)
}

/// Returns the area of the unit disc over [0, a] x [0, b], arguments in 0 … 1.
fn quadrant(a: f64, b: f64) -> f64 {
    quadrant_of([a, b], [segment(a), segment(b)])
}

/// Returns the area of the unit disc over [0, a] x [0, b], arguments in 0 … 1, from the segments beyond a and b.
#[inline(always)]
pub fn quadrant_of([a, b]: [f64; 2], segments: [f64; 2]) -> f64 {
    if a * a + b * b <= 1.0 {
        a * b
    } else {
        PI / 4.0 - segments[0] - segments[1]
    }
}

/// Returns the volume of a sphere inside the box from `lower` to `upper` (all in m) \[m3\].
#[must_use]
pub fn sphere_box(centre: [f64; 3], radius: f64, lower: [f64; 3], upper: [f64; 3]) -> f64 {
    let at = |x: f64, axis: usize| ((x - centre[axis]) / radius).clamp(-1.0, 1.0);
    let mut sum = 0.0;
    for corner in 0..8_u32 {
        let mut sign = 1.0;
        let mut arm = [0.0; 3];
        for axis in 0..3 {
            let bound = if corner >> axis & 1 == 0 {
                sign = -sign;
                at(lower[axis], axis)
            } else {
                at(upper[axis], axis)
            };
            sign *= bound.signum();
            arm[axis] = bound.abs();
        }
        sum += sign * octant(arm[0], arm[1], arm[2]);
    }
    (sum * radius * radius * radius).max(0.0)
}

/// Returns the area of a disc inside the rectangle from `lower` to `upper` (all in m) \[m²\]; the third coordinate
/// has no effect.
#[must_use]
pub fn disc_rectangle(centre: [f64; 3], radius: f64, lower: [f64; 3], upper: [f64; 3]) -> f64 {
    let at = |x: f64, axis: usize| ((x - centre[axis]) / radius).clamp(-1.0, 1.0);
    let odd = |x: f64, y: f64| x.signum() * y.signum() * quadrant(x.abs(), y.abs());
    let (x0, x1) = (at(lower[0], 0), at(upper[0], 0));
    let (y0, y1) = (at(lower[1], 1), at(upper[1], 1));
    ((odd(x1, y1) - odd(x0, y1) - odd(x1, y0) + odd(x0, y0)) * radius * radius).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::random::SplitMix;

    const FULL: f64 = 4.0 / 3.0 * PI;

    fn ball(lower: [f64; 3], upper: [f64; 3]) -> f64 {
        sphere_box([0.0; 3], 1.0, lower, upper)
    }

    #[test]
    fn limits_are_caps_wedges_and_boxes() {
        assert!((ball([-2.0; 3], [2.0; 3]) - FULL).abs() < 1e-14);
        assert!((ball([0.0; 3], [2.0; 3]) - FULL / 8.0).abs() < 1e-15);
        // A box inside the ball, a cap, a box outside.
        assert!((ball([-0.5; 3], [0.5; 3]) - 1.0).abs() < 1e-14);
        let h = 0.3;
        let cap = PI * h * h * (3.0 - h) / 3.0;
        assert!((ball([0.7, -2.0, -2.0], [2.0, 2.0, 2.0]) - cap).abs() < 1e-14);
        assert!(ball([0.8, 0.8, 0.8], [2.0; 3]) < 1e-15);
        assert!(ball([1.5, -1.0, -1.0], [2.0; 3]) < 1e-15);
        // Half a ball cut by a plane through the centre, quarter by two.
        assert!((ball([0.0, 0.0, -2.0], [2.0; 3]) - FULL / 4.0).abs() < 1e-15);
    }

    #[test]
    fn parts_of_any_cutting_sum_to_the_ball() {
        let mut draws = SplitMix::new(11);
        let mut worst = 0.0_f64;
        for _ in 0..2_000 {
            let centre = [draws.uniform(), draws.uniform(), draws.uniform()];
            let radius = 0.05 + 0.6 * draws.uniform();
            let cuts = [(); 3].map(|()| 0.2 + 0.6 * draws.uniform());
            let mut sum = 0.0;
            let mut flat = 0.0;
            for part in 0..8_u32 {
                let mut lower = [-2.0; 3];
                let mut upper = [3.0; 3];
                for axis in 0..3 {
                    if part >> axis & 1 == 0 {
                        upper[axis] = cuts[axis];
                    } else {
                        lower[axis] = cuts[axis];
                    }
                }
                sum += sphere_box(centre, radius, lower, upper);
                if part < 4 {
                    flat += disc_rectangle(centre, radius, lower, upper);
                }
            }
            let full = FULL * radius.powi(3);
            worst = worst.max((sum / full - 1.0).abs());
            worst = worst.max((flat / (PI * radius * radius) - 1.0).abs());
        }
        assert!(worst < 1e-13, "{worst:e}");
    }

    #[test]
    fn agrees_with_quadrature() {
        // Slices of the ball by the formula of the disc, and that by rows.
        let (centre, radius) = ([0.1, -0.2, 0.05], 0.9);
        let (lower, upper) = ([-0.3, -0.9, -0.2], [0.8, 0.35, 0.7]);
        let n = 20_000;
        let step = (upper[2] - lower[2]) / f64::from(n);
        let mut volume = 0.0;
        for k in 0..n {
            let z = lower[2] + (f64::from(k) + 0.5) * step;
            let slice = (radius * radius - (z - centre[2]).powi(2)).max(0.0).sqrt();
            volume += step * disc_rectangle(centre, slice, lower, upper);
        }
        assert!((sphere_box(centre, radius, lower, upper) - volume).abs() < 1e-9);
        let step = (upper[0] - lower[0]) / f64::from(n);
        let mut area = 0.0;
        for k in 0..n {
            let x = lower[0] + (f64::from(k) + 0.5) * step;
            let half = (radius * radius - (x - centre[0]).powi(2)).max(0.0).sqrt();
            let (from, to) = (centre[1] - half, centre[1] + half);
            area += step * (to.min(upper[1]) - from.max(lower[1])).max(0.0);
        }
        assert!((disc_rectangle(centre, radius, lower, upper) - area).abs() < 1e-8);
    }

    #[test]
    fn agrees_with_random_points() {
        let mut draws = SplitMix::new(3);
        for _ in 0..20 {
            let lower = [(); 3].map(|()| draws.uniform() - 1.0);
            let upper = lower.map(|x| x + draws.uniform());
            let n = 40_000_u32;
            let mut hits = 0_u32;
            for _ in 0..n {
                let at: [f64; 3] =
                    std::array::from_fn(|a| lower[a] + draws.uniform() * (upper[a] - lower[a]));
                hits += u32::from(at.iter().map(|x| x * x).sum::<f64>() < 1.0);
            }
            let size: f64 = (0..3).map(|a| upper[a] - lower[a]).product();
            let share = f64::from(hits) / f64::from(n);
            // Five standard deviations.
            let sigma = (0.25 / f64::from(n)).sqrt();
            assert!((ball(lower, upper) / size - share).abs() < 5.0 * sigma);
        }
    }
}
