//! A prism over any simple polygon: a weir, a stepped spillway, a sheet pile that is not upright.

use super::facets::{double_area, turn};
use super::solid::{ON_SURFACE, Scope, Solid, between, merge_parts};
use super::{Facets, Point};
use base::error::Report;
use base::geometry::{Axis, DrawnLayer};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A simple polygon, convex or not; in 3-D a prism over it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Polygon {
    /// Corners in order [m]. In 3-D these are coordinates along the two other axes than `axis`, in the order x, y, z.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("minItems" = 3))]
    pub points: Vec<[f64; 2]>,
    /// Closed polyline of a drawing, in place of `points`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dxf: Option<DrawnLayer>,
    /// Axis of the prism (3-D only).
    #[serde(default)]
    pub axis: Option<Axis>,
    /// Lower end of the prism along its axis [m] (3-D only).
    #[serde(default)]
    pub from: Option<f64>,
    /// Upper end of the prism along its axis [m] (3-D only).
    #[serde(default)]
    pub to: Option<f64>,
}

impl Polygon {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, .. } = at;
        let (axis, from, to) = match (frame.dimension, self.axis, self.from, self.to) {
            (3, Some(axis), Some(from), Some(to)) if from < to => (axis.index(), from, to),
            (3, ..) => {
                report.error(
                    path,
                    "a prism needs `axis`, `from` and `to`, with `from` below `to`".into(),
                    "write for example \"axis\": \"y\", \"from\": 0, \"to\": 1".into(),
                );
                return None;
            }
            (_, None, None, None) => (2, f64::NEG_INFINITY, f64::INFINITY),
            _ => {
                report.error(
                    path,
                    "a polygon of a 2-D problem has no axis and no ends".into(),
                    "remove `axis`, `from` and `to`".into(),
                );
                return None;
            }
        };
        if self.dxf.is_some() {
            report.error(
                &format!("{path}.dxf"),
                "drawings are read for `structures`, and for zones and terrain of the seepage"
                    .into(),
                "list the corners in `points`".into(),
            );
            return None;
        }
        let path = format!("{path}.points");
        let finite = self.points.iter().flatten().all(|x| x.is_finite());
        if self.points.len() < 3 || !finite {
            report.error(
                &path,
                "a polygon has at least three corners".into(),
                "list its corners in their order along the outline".into(),
            );
            return None;
        }
        if let Some(edges) = edges_that_meet(&self.points) {
            report.error(
                &path,
                format!("the polygon crosses or touches itself: {edges}"),
                "list the corners in their order along the outline, each once".into(),
            );
            return None;
        }
        let area = double_area(&self.points);
        let size = self
            .points
            .iter()
            .flatten()
            .fold(0.0_f64, |most, x| most.max(x.abs()));
        if area.abs() <= 1e-14 * size * size {
            report.error(
                &path,
                "the polygon has no area".into(),
                "give corners that enclose an area; a thin sheet also needs its thickness".into(),
            );
            return None;
        }
        let mut points = self.points.clone();
        if area < 0.0 {
            points.reverse();
        }
        Some(Arc::new(Prism {
            points,
            axis,
            from,
            to,
        }))
    }
}

type PlanePoint = [f64; 2];

fn squared(a: PlanePoint, b: PlanePoint) -> f64 {
    (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)
}

/// Returns the squared distance of a point from a line segment.
fn to_edge(at: PlanePoint, a: PlanePoint, b: PlanePoint) -> f64 {
    let length = squared(a, b);
    let t = ((at[0] - a[0]) * (b[0] - a[0]) + (at[1] - a[1]) * (b[1] - a[1])) / length;
    let t = if length > 0.0 { t.clamp(0.0, 1.0) } else { 0.0 };
    squared(at, [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
}

/// Returns the words of a finding about a closed polygon that crosses or touches itself, which name the first two edges
/// that meet by their numbers and ends; none for a simple polygon.
#[must_use]
pub fn edges_that_meet(points: &[[f64; 2]]) -> Option<String> {
    let (k, m) = crossing(points)?;
    let edge = |k: usize| {
        let next = (k + 1) % points.len();
        let [[x, y], [u, v]] = [points[k], points[next]];
        format!("from corner {k} at {x:?}, {y:?} m to corner {next} at {u:?}, {v:?} m")
    };
    let (one, other) = (edge(k), edge(m));
    Some(format!("the edge {one} meets the edge {other}"))
}

/// Returns two edges of a closed polygon that intersect other than as neighbours, by the indices of their first
/// corners.
#[must_use]
pub fn crossing(points: &[PlanePoint]) -> Option<(usize, usize)> {
    let n = points.len();
    let edge = |k: usize| (points[k], points[(k + 1) % n]);
    for k in 0..n {
        let (a, b) = edge(k);
        if squared(a, b) <= 0.0 {
            return Some((k, (k + 1) % n));
        }
        for m in k + 1..n {
            let (c, d) = edge(m);
            if m == k + 1 || (k == 0 && m == n - 1) {
                // Neighbours share a corner, but must not fold back onto each other.
                let (first, middle, last) = if m == k + 1 { (a, b, d) } else { (c, a, b) };
                let back = turn(first, middle, last).abs()
                    <= 1e-12 * (squared(first, middle) * squared(middle, last)).sqrt()
                    && (first[0] - middle[0]) * (last[0] - middle[0])
                        + (first[1] - middle[1]) * (last[1] - middle[1])
                        > 0.0;
                if back {
                    return Some((k, m));
                }
                continue;
            }
            let sides = [turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)];
            let apart = sides[0] * sides[1] < 0.0 && sides[2] * sides[3] < 0.0;
            let touch = [(c, a, b), (d, a, b), (a, c, d), (b, c, d)];
            if apart || touch.iter().any(|&(p, a, b)| to_edge(p, a, b) <= 0.0) {
                return Some((k, m));
            }
        }
    }
    None
}

/// Prism, infinite along z in 2-D.
#[derive(Debug)]
struct Prism {
    points: Vec<PlanePoint>,
    axis: usize,
    from: f64,
    to: f64,
}

impl Prism {
    fn flat(&self, at: Point) -> PlanePoint {
        match self.axis {
            0 => [at[1], at[2]],
            1 => [at[0], at[2]],
            _ => [at[0], at[1]],
        }
    }

    fn edges(&self) -> impl Iterator<Item = (PlanePoint, PlanePoint)> + '_ {
        let next = self.points.iter().cycle().skip(1);
        self.points.iter().copied().zip(next.copied())
    }

    /// Returns `true` if a ray to the right crosses the boundary an odd number of times.
    fn holds(&self, [x, y]: PlanePoint) -> bool {
        let crossed = self.edges().filter(|(a, b)| {
            (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        });
        crossed.count() % 2 == 1
    }
}

impl Solid for Prism {
    fn distance(&self, at: Point) -> f64 {
        let flat = self.flat(at);
        let edges = self.edges().map(|(a, b)| to_edge(flat, a, b));
        let nearest = edges.fold(f64::INFINITY, f64::min).sqrt();
        let across = if self.holds(flat) { -nearest } else { nearest };
        let along = (self.from - at[self.axis]).max(at[self.axis] - self.to);
        across.max(0.0).hypot(along.max(0.0)) + across.max(along).min(0.0)
    }

    fn extent(&self) -> [Point; 2] {
        let mut extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let others: Vec<usize> = (0..3).filter(|&a| a != self.axis).collect();
        for point in &self.points {
            for (&a, &x) in others.iter().zip(point) {
                extent[0][a] = extent[0][a].min(x);
                extent[1][a] = extent[1][a].max(x);
            }
        }
        extent[0][self.axis] = self.from;
        extent[1][self.axis] = self.to;
        extent
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        let (start, way) = (self.flat(from), self.flat(along));
        let mut slab = [0.0_f64, 1.0_f64];
        let (low, high) = (self.from - from[self.axis], self.to - from[self.axis]);
        let rise = along[self.axis];
        if rise.abs() > 0.0 {
            let (s, t) = (low / rise, high / rise);
            slab = [slab[0].max(s.min(t)), slab[1].min(s.max(t))];
        } else if low >= 0.0 || high <= 0.0 {
            return;
        }
        // Crossings of the boundary divide the line; a piece is inside if its midpoint is. A piece on the boundary is
        // outside, whatever the rounding.
        let rounding = ON_SURFACE * ON_SURFACE * (way[0] * way[0] + way[1] * way[1]);
        let mut cuts = vec![slab[0], slab[1]];
        for (a, b) in self.edges() {
            let edge = [b[0] - a[0], b[1] - a[1]];
            let base = way[0] * edge[1] - way[1] * edge[0];
            if base.abs() > 0.0 {
                let off = [a[0] - start[0], a[1] - start[1]];
                let t = (off[0] * edge[1] - off[1] * edge[0]) / base;
                let s = (off[0] * way[1] - off[1] * way[0]) / base;
                if (-1e-9..=1.0 + 1e-9).contains(&s) && t > slab[0] && t < slab[1] {
                    cuts.push(t);
                }
            }
        }
        cuts.sort_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let at = [start[0] + middle * way[0], start[1] + middle * way[1]];
            if self.holds(at) && self.edges().all(|(a, b)| to_edge(at, a, b) > rounding) {
                between(pair[0], pair[1], found);
            }
        }
        merge_parts(found);
    }

    fn outline(&self, _: f64) -> Vec<PlanePoint> {
        self.points.clone()
    }

    fn facets(&self, _: f64) -> Facets {
        Facets::along(&self.points, self.axis, self.from, self.to)
    }

    fn length(&self, axis: usize, [from, to]: [f64; 2]) -> Option<Arc<dyn Solid>> {
        (axis == self.axis).then(|| {
            let points = self.points.clone();
            Arc::new(Self {
                points,
                axis,
                from,
                to,
            }) as Arc<dyn Solid>
        })
    }
}
