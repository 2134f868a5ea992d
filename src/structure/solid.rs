//! Queries of a solid.

use super::{Facets, Point, norm, plus, times};
use base::geometry::Mesh;
use std::fmt::Debug;
use std::sync::Arc;

/// Reads the triangles of a file \[m\], or says what is wrong with it.
pub type ReadMesh<'a> = &'a dyn Fn(&Mesh) -> Result<Vec<[Point; 3]>, String>;

/// The domain that shapes stand in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// 2 or 3.
    pub dimension: usize,
    /// Edges of the domain \[m\]; its lower corner is the origin.
    pub size: Point,
}

/// A solid at rest, in m. In 2-D it is a cylinder along z: nothing depends on the third component.
pub trait Solid: Debug + Send + Sync {
    /// Returns the distance of a point from the surface, negative inside. At most the true distance in size, with its
    /// sign.
    fn distance(&self, at: Point) -> f64;

    /// Returns the smallest box that holds it, infinite if it has no end.
    fn extent(&self) -> [Point; 2];

    /// Finds the parts inside of the line from `from` by `along`, as parts of its length between 0 and 1, apart and
    /// rising. They are added to `found`, which is empty.
    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        trace(self, from, along, found);
    }

    /// Returns its boundary in 2-D, counter-clockwise, closed by its first point, and no further than `tolerance` \[m\]
    /// inside the true one.
    fn outline(&self, tolerance: f64) -> Vec<[f64; 2]>;

    /// Returns its surface in 3-D as convex facets that face outwards, no further than `tolerance` \[m\] inside the
    /// true one.
    fn facets(&self, tolerance: f64) -> Facets;

    /// Returns the part between two places \[m\] of an axis, for a solid that reaches beyond both and has the same
    /// section all along this axis.
    fn length(&self, _axis: usize, _between: [f64; 2]) -> Option<Arc<dyn Solid>> {
        None
    }

    /// Returns a point and the unit normal of the only face of a half-space.
    fn plane(&self) -> Option<(Point, Point)> {
        None
    }
}

/// Shortest step along a line, as a part of its length: thinner chords are passed over.
const STEP: f64 = 1e-4;
/// Shortest steps in a row after which they grow twofold each: the line grazes the surface, and its depth is less than
/// such a step.
const GRAZING: u32 = 16;
/// The longest of them.
const LONGEST: f64 = 1e-2;

/// Finds [`Solid::chords`] by the distance alone: the surface is no nearer than it says, so that a step of that length
/// passes over nothing (J. C. Hart, The Visual Computer 12 (1996) 527).
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

/// Returns the zero of a function that has opposite signs at two points: bisection with the secant tried first.
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

/// Adds the part of a line between two places, as far as it lies on the way.
pub(super) fn between(first: f64, last: f64, found: &mut Vec<[f64; 2]>) {
    let (first, last) = (first.max(0.0), last.min(1.0));
    if first < last {
        found.push([first, last]);
    }
}

/// Sorts parts of a line and joins those that touch.
pub(super) fn join(parts: &mut Vec<[f64; 2]>) {
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
