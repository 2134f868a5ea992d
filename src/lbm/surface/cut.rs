//! Distance of a plane that cuts a given fraction from a cell.
//!
//! Inverse of the volume that a plane cuts from a cube (R. Scardovelli, S. Zaleski, J. Comput. Phys. 164 (2000)
//! 228), in the closed form of M. Lehmann and S. Gekle (Computation 10 (2022) 21).

use super::facet::bounded;
use super::positions::{MOST, Values};

/// Returns two numbers in ascending order.
#[inline(always)]
fn ascending(a: f64, b: f64) -> [f64; 2] {
    [if a > b { b } else { a }, if a > b { a } else { b }]
}

/// Cell cut by a plane.
#[derive(Clone, Copy)]
struct Cut {
    /// Components of the normal without signs, ascending, over their sum.
    normal: [f64; 3],
    sum: f64,
    /// Fraction behind the plane, between 0 and 1, and the part of `part` beyond.
    inside: f64,
    beyond: f64,
}

impl Cut {
    #[inline(always)]
    fn new(part: f64, normal: [f64; 3]) -> Self {
        let [low, middle] = ascending(normal[0].abs(), normal[1].abs());
        let [middle, high] = ascending(middle, normal[2].abs());
        let [low, middle] = ascending(low, middle);
        let sum = low + middle + high;
        let inside = bounded(part, 0.0, 1.0);
        Self {
            normal: [low / sum, middle / sum, high / sum],
            sum,
            inside,
            beyond: part - inside,
        }
    }

    /// Returns the fraction on the smaller side of the plane, times the largest component.
    #[inline(always)]
    fn area(&self) -> f64 {
        self.normal[2] * (0.5 - (self.inside - 0.5).abs())
    }

    /// Returns the distance of the plane from the corner of the cube on its smaller side, without branches, in the two
    /// most frequent cases, and 1 in these cases, else 0.
    #[inline(always)]
    fn of_most(&self) -> (f64, f64) {
        let [low, middle, _] = self.normal;
        let (both, area) = (low + middle, self.area());
        let least = low * low / (6.0 * middle);
        let across = both <= 2.0 * area;
        let between = (least <= area) & (area < least + 0.5 * (middle - low));
        let depth = 0.5 * (low + (low * low + 8.0 * middle * (area - least)).sqrt());
        let depth = if across { area + 0.5 * both } else { depth };
        (depth, if across | between { 1.0 } else { 0.0 })
    }

    /// Returns the distance of the plane from the centre, for its distance from the corner.
    #[inline(always)]
    fn distance(&self, depth: f64) -> f64 {
        self.sum * (0.5 - depth).copysign(self.inside - 0.5) + self.beyond
    }
}

/// Returns the distance of a plane from the centre of a cell of edge 1, along its unit normal, such that the
/// fraction `part` of the cell lies behind the plane. For `part` above 1 the distance increases with it.
pub(super) fn distance(part: f64, normal: [f64; 3]) -> f64 {
    let cut = Cut::new(part, normal);
    let (depth, found) = cut.of_most();
    let depth = if found > 0.0 {
        depth
    } else {
        of_rest(cut.area(), cut.normal)
    };
    cut.distance(depth)
}

/// Computes [`distance`] for the first `count` cells of a batch.
#[inline(always)]
pub(super) fn distances(count: usize, part: &Values, normal: &[Values; 3], to: &mut Values) {
    let mut found = [1.0; MOST];
    let mut all = 1.0;
    for k in 0..count.min(MOST) {
        let cut = Cut::new(part[k], [normal[0][k], normal[1][k], normal[2][k]]);
        let depth;
        (depth, found[k]) = cut.of_most();
        to[k] = cut.distance(depth);
    }
    for found in found {
        all *= found;
    }
    if all > 0.0 {
        return;
    }
    for k in 0..count.min(MOST) {
        if found[k] <= 0.0 {
            to[k] = distance(part[k], [normal[0][k], normal[1][k], normal[2][k]]);
        }
    }
}

/// Returns the distance of the plane from the corner for planes that [`Cut::of_most`] does not find.
fn of_rest(area: f64, [low, middle, high]: [f64; 3]) -> f64 {
    let both = low + middle;
    let least = low * low / (6.0 * middle);
    let six = 6.0 * low * middle * area;
    if area < least {
        return six.cbrt();
    }
    let squares = low * low + middle * middle;
    let cubes = low.powi(3) + middle.powi(3);
    let most = if high < both {
        let [a, b, c] = [low, middle, high];
        (c * c * (3.0 * both - c) + a * a * (a - 3.0 * c) + b * b * (b - 3.0 * c)) / (6.0 * a * b)
    } else {
        0.5 * both
    };
    let (a, b, c) = if area < most {
        (six - cubes, squares, both)
    } else {
        let cube = high.powi(3);
        (
            0.5 * (six - cubes - cube),
            0.5 * (squares + high * high),
            0.5,
        )
    };
    let t = (c * c - b).max(0.0).sqrt();
    let ratio = (c.powi(3) - 0.5 * a - 1.5 * b * c) / t.powi(3);
    c - 2.0 * t * (ratio.clamp(-1.0, 1.0).asin() / 3.0).sin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::vector::norm;

    /// Returns the fraction of a cell behind a plane, by the midpoint rule.
    fn part(distance: f64, normal: [f64; 3]) -> f64 {
        let n = 100;
        let at = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
        let mut sum = 0.0;
        for x in 0..n {
            for y in 0..n {
                // The integral is exact along the axis with the largest component.
                let rest = distance - normal[0] * at(x) - normal[1] * at(y);
                sum += (rest / normal[2] + 0.5).clamp(0.0, 1.0);
            }
        }
        sum / (n * n) as f64
    }

    #[test]
    fn a_plane_cuts_the_part_that_it_is_given() {
        for normal in [
            [0.0, 0.0, 1.0],
            [0.0, 0.3, 1.0],
            [0.0, 1.0, 1.0],
            [0.2, 0.3, 1.0],
            [0.6, 0.7, 1.0],
            [0.9, 0.95, 1.0],
            [1.0, 1.0, 1.0],
            [0.01, 0.99, 1.0],
        ] {
            let length = norm(normal);
            let normal = normal.map(|n| n / length);
            for k in 0..=40 {
                let exact = f64::from(k) / 40.0;
                let found = part(distance(exact, normal), normal);
                assert!(
                    (found - exact).abs() < 2e-4,
                    "{normal:?}: {found} for {exact}"
                );
                let turned = [-normal[2], normal[0], -normal[1]];
                let other = distance(exact, turned);
                assert!((other - distance(exact, normal)).abs() < 1e-15);
            }
        }
    }
}
