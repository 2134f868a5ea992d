//! Interface of a solid.

use super::{Facets, Point, norm, plus, times};
use base::geometry::Mesh;
use std::fmt::Debug;
use std::sync::Arc;

/// Function that returns the triangles of a file \[m\], or a text about its errors.
pub type ReadMesh<'a> = &'a dyn Fn(&Mesh) -> Result<Vec<[Point; 3]>, String>;

/// Domain that contains the shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Dimension: 2 or 3.
    pub dimension: usize,
    /// Edges of the domain \[m\]; its lower corner is the origin.
    pub size: Point,
}

/// Surroundings in which a shape becomes a solid.
#[derive(Clone, Copy)]
pub(super) struct Scope<'a> {
    /// Domain that contains the shape.
    pub frame: &'a Frame,
    /// Path of the shape in the case.
    pub path: &'a str,
    pub read: ReadMesh<'a>,
}

/// Distance from a surface, relative to the length of a line, within which the line lies on it.
pub(super) const ON_SURFACE: f64 = 1e-9;

/// Stationary solid, in m. In 2-D it is a cylinder along z: nothing depends on the third component.
pub trait Solid: Debug + Send + Sync {
    /// Returns the signed distance of a point from the surface, negative inside: a lower bound of the true distance
    /// in magnitude, with its sign.
    fn distance(&self, at: Point) -> f64;

    /// Returns the bounding box, infinite along directions without a bound.
    fn extent(&self) -> [Point; 2];

    /// Finds the parts of the line from `from` by `along` that lie inside, as fractions of its length between 0 and
    /// 1, disjoint and ascending. They are added to `found`, which is empty.
    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        trace(self, from, along, found);
    }

    /// Returns the boundary in 2-D, counter-clockwise, closed by its first point, at most `tolerance` \[m\] inside
    /// the true one.
    fn outline(&self, tolerance: f64) -> Vec<[f64; 2]>;

    /// Returns the surface in 3-D as convex facets oriented outwards, at most `tolerance` \[m\] inside the true
    /// one.
    fn facets(&self, tolerance: f64) -> Facets;

    /// Returns the maximum distance \[m\] of the facets or the outline for a tolerance \[m\] from the true surface:
    /// above the tolerance where the number of facets is at its limit, 0 for solids with plane faces.
    fn deviation(&self, _tolerance: f64) -> f64 {
        0.0
    }

    /// Returns the part between two coordinates \[m\] of an axis, for a solid that extends beyond both and has a
    /// constant section along this axis.
    fn length(&self, _axis: usize, _between: [f64; 2]) -> Option<Arc<dyn Solid>> {
        None
    }

    /// Returns a point and the unit normal of the only face of a half-space.
    fn plane(&self) -> Option<(Point, Point)> {
        None
    }
}

/// Minimum step along a line, as a fraction of its length: shorter chords are missed.
const STEP: f64 = 1e-4;
/// Number of consecutive minimum steps after which steps are doubled each time: the line grazes the surface, and
/// its depth is less than such a step.
const GRAZING: u32 = 16;
/// Maximum length of a step along a line, as a fraction of the line.
const LONGEST: f64 = 1e-2;

/// Finds [`Solid::chords`] from the distance alone: the surface is no nearer than the distance, so that a step of this
/// length cannot pass it (J. C. Hart, The Visual Computer 12 (1996) 527).
pub(super) fn trace<S: Solid + ?Sized>(
    solid: &S,
    from: Point,
    along: Point,
    found: &mut Vec<[f64; 2]>,
) {
    let length = norm(along);
    let place = |t: f64| solid.distance(plus(from, times(along, t)));
    let mut t = 0.0;
    let mut distance = place(t);
    let mut entered = (distance < 0.0).then_some(0.0);
    let (mut shortest, mut row) = (STEP, 0);
    while t < 1.0 {
        let free = distance.abs() / length;
        if free > STEP {
            (shortest, row) = (STEP, 0);
        } else {
            row += 1;
            if row > GRAZING {
                shortest = f64::min(2.0 * shortest, LONGEST);
            }
        }
        let next = f64::min(t + free.max(shortest), 1.0);
        let there = place(next);
        if (there < 0.0) != (distance < 0.0) {
            let crossing = root(&place, [t, distance], [next, there]);
            match entered.take() {
                Some(first) => found.push([first, crossing]),
                None => entered = Some(crossing),
            }
        }
        (t, distance) = (next, there);
    }
    if let Some(first) = entered {
        found.push([first, 1.0]);
    }
}

/// Returns the zero of a function that has opposite signs at two points, by the secant method with bisection as the
/// fallback.
fn root(of: &impl Fn(f64) -> f64, low: [f64; 2], high: [f64; 2]) -> f64 {
    let ([mut a, mut fa], [mut b, mut fb]) = (low, high);
    for round in 0..64 {
        let secant = a - fa * (b - a) / (fb - fa);
        let middle = if round % 2 == 0 && secant > a && secant < b {
            secant
        } else {
            0.5 * (a + b)
        };
        let f = of(middle);
        if (f < 0.0) == (fa < 0.0) {
            (a, fa) = (middle, f);
        } else {
            (b, fb) = (middle, f);
        }
        if b - a <= 1e-15 || f.abs() <= 0.0 {
            return middle;
        }
    }
    0.5 * (a + b)
}

/// Adds the part of a line between two positions, limited to the range from 0 to 1.
pub(super) fn between(first: f64, last: f64, found: &mut Vec<[f64; 2]>) {
    let (first, last) = (first.max(0.0), last.min(1.0));
    if first < last {
        found.push([first, last]);
    }
}

/// Sorts parts of a line and joins parts that touch.
pub(super) fn merge_parts(parts: &mut Vec<[f64; 2]>) {
    parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut kept = 0;
    for k in 0..parts.len() {
        let part = parts[k];
        if kept > 0 && part[0] <= parts[kept - 1][1] {
            parts[kept - 1][1] = parts[kept - 1][1].max(part[1]);
        } else {
            parts[kept] = part;
            kept += 1;
        }
    }
    parts.truncate(kept);
}
