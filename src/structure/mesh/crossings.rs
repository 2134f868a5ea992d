//! Crossings of a line with a triangulated surface, and the winding number of the surface around a point.
//!
//! A crossing counts +1 if the line leaves the inside and -1 if it enters. A point is inside if the sum of the
//! crossings on a line from it is positive: inside at least one of several intersecting shells, and outside in a
//! cavity.
//!
//! A line through an edge or a vertex, or in the plane of a triangle, is shifted by [`LINE_SHIFT`] of its own size,
//! in a direction that occurs in no drawing. It then crosses each triangle in its interior or not at all, and
//! neighbouring triangles agree because they use the same numbers for their common edge.

use super::super::{Point, cross, dot, minus, norm, plus, times};

/// Distance by which a line is shifted, relative to its length plus its distance from the origin.
const LINE_SHIFT: f64 = 1e-11;
/// Direction of the shift: no two of its components have a simple ratio.
const DIRECTION: Point = [0.577_215_6, 0.691_462_5, 0.433_012_7];

/// Line from a point, shifted.
pub(super) struct Line {
    from: Point,
    along: Point,
    /// Axes, ordered so that the line is longest along the last.
    axes: [usize; 3],
    shear: [f64; 2],
}

impl Line {
    pub(super) fn new(from: Point, along: Point, size: f64) -> Self {
        let length = norm(along);
        let far = from
            .iter()
            .map(|x| x.abs())
            .fold(size.max(length), f64::max);
        let aside = cross(along, DIRECTION);
        let aside = plus(
            aside,
            times(cross(along, aside), 0.3 / length.max(f64::MIN_POSITIVE)),
        );
        let aside = times(aside, LINE_SHIFT * far / norm(aside).max(f64::MIN_POSITIVE));
        let longest = (0..3).max_by(|&a, &b| along[a].abs().total_cmp(&along[b].abs()));
        let z = longest.unwrap_or(2);
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        Self {
            from: plus(from, aside),
            along,
            axes: [x, y, z],
            shear: [along[x] / along[z], along[y] / along[z]],
        }
    }

    /// Returns the position at which the line crosses a triangle, as a fraction of its length, with 1 if it leaves
    /// and -1 if it enters (S. Woop, C. Benthin, I. Wald, J. Computer Graphics Techniques 2 (2013) 65).
    pub(super) fn crossing(&self, corners: &[Point; 3]) -> Option<(f64, i32)> {
        let [x, y, z] = self.axes;
        let flat = corners.map(|corner| {
            let at = minus(corner, self.from);
            [
                at[x] - self.shear[0] * at[z],
                at[y] - self.shear[1] * at[z],
                at[z],
            ]
        });
        let side = |a: [f64; 3], b: [f64; 3]| a[0] * b[1] - a[1] * b[0];
        let [a, b, c] = flat;
        let weights = [side(b, c), side(c, a), side(a, b)];
        let positive = weights.iter().all(|w| *w > 0.0);
        let negative = weights.iter().all(|w| *w < 0.0);
        if !positive && !negative {
            return None;
        }
        let sum: f64 = weights.iter().sum();
        let height = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum;
        // Counter-clockwise viewed along the line: the normal points along the line.
        let leaves = positive == (self.along[z] > 0.0);
        Some((height / self.along[z], if leaves { 1 } else { -1 }))
    }

    /// Returns `true` if the line may intersect a box, judged by the distance of the box from the line.
    pub(super) fn meets(&self, low: &Point, high: &Point) -> bool {
        let middle = times(plus(*low, *high), 0.5);
        let half = norm(minus(*high, *low)) * (0.5 + 1e-9);
        let to = minus(middle, self.from);
        let squared = dot(self.along, self.along);
        let part = (dot(to, self.along) / squared).max(0.0);
        let gap = minus(to, times(self.along, part));
        dot(gap, gap) <= half * half
    }
}

/// Returns the winding number of triangles around a point.
pub(super) fn winding(triangles: &[[Point; 3]], at: Point) -> i32 {
    let size = triangles
        .iter()
        .flatten()
        .map(|corner| norm(minus(*corner, at)));
    let size = size.fold(0.0, f64::max);
    let line = Line::new(at, [size.max(f64::MIN_POSITIVE), 0.0, 0.0], size);
    let crossings = triangles.iter().filter_map(|t| line.crossing(t));
    crossings
        .filter(|(t, _)| *t > 0.0)
        .map(|(_, sign)| sign)
        .sum()
}
