//! A half-space: the ground below a plane, or a sloping wall.

use super::solid::{Frame, ON_SURFACE, Scope, Solid, between};
use super::{Facets, Point, dot, minus, norm, plus, times};
use base::error::Report;
use base::geometry::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The half-space behind a plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Plane {
    /// A point of the plane [m].
    pub point: Vector,
    /// Normal vector out of the solid, of any length [1].
    pub normal: Vector,
}

impl Plane {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, .. } = at;
        let point = self
            .point
            .resolve(frame.dimension, &format!("{path}.point"), report);
        let path = format!("{path}.normal");
        let normal = self.normal.resolve(frame.dimension, &path, report);
        let length = norm(normal);
        if !(length > 0.0 && length.is_finite()) {
            report.error(
                &path,
                "the normal has zero length".into(),
                "write for example [0, 1]".into(),
            );
            return None;
        }
        Some(Arc::new(HalfSpace {
            point,
            normal: times(normal, 1.0 / length),
            frame: *frame,
        }))
    }
}

#[derive(Debug)]
struct HalfSpace {
    point: Point,
    normal: Point,
    frame: Frame,
}

impl HalfSpace {
    /// Returns the part of a convex polygon on the side of a plane opposite to `normal`.
    fn cut(polygon: &[Point], point: Point, normal: Point) -> Vec<Point> {
        let height = |at: Point| dot(normal, minus(at, point));
        let mut kept = Vec::new();
        for (k, &a) in polygon.iter().enumerate() {
            let b = polygon[(k + 1) % polygon.len()];
            let (s, t) = (height(a), height(b));
            if s <= 0.0 {
                kept.push(a);
            }
            if (s < 0.0 && t > 0.0) || (s > 0.0 && t < 0.0) {
                kept.push(plus(a, times(minus(b, a), s / (s - t))));
            }
        }
        kept
    }

    /// Returns the part of a face, a convex polygon, that lies inside the domain.
    fn within(&self, mut polygon: Vec<Point>) -> Vec<Point> {
        for axis in 0..self.frame.dimension {
            for (level, sign) in [(0.0, -1.0), (self.frame.size[axis], 1.0)] {
                let (mut point, mut normal) = ([0.0; 3], [0.0; 3]);
                point[axis] = level;
                normal[axis] = sign;
                polygon = Self::cut(&polygon, point, normal);
            }
        }
        polygon
    }
}

impl Solid for HalfSpace {
    fn distance(&self, at: Point) -> f64 {
        dot(self.normal, minus(at, self.point))
    }

    fn extent(&self) -> [Point; 2] {
        let mut extent = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
        for axis in 0..self.frame.dimension {
            let across =
                (0..self.frame.dimension).all(|a| a == axis || self.normal[a].abs() <= 0.0);
            if across {
                let side = usize::from(self.normal[axis] > 0.0);
                extent[side][axis] = self.point[axis];
            }
        }
        extent
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        let (height, rise) = (self.distance(from), dot(self.normal, along));
        let crossing = -height / rise;
        // A line in the surface is outside, whatever the rounding of its direction.
        let rounding = ON_SURFACE * norm(along);
        if rise.abs() <= rounding {
            if height < -rounding {
                between(0.0, 1.0, found);
            }
        } else if rise > 0.0 {
            between(0.0, crossing, found);
        } else {
            between(crossing, 1.0, found);
        }
    }

    fn plane(&self) -> Option<(Point, Point)> {
        Some((self.point, self.normal))
    }

    /// Returns the part of the domain behind the plane.
    fn outline(&self, _: f64) -> Vec<[f64; 2]> {
        let [x, y, _] = self.frame.size;
        let domain = [[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0]];
        let part = Self::cut(&domain, self.point, self.normal);
        part.iter().map(|p| [p[0], p[1]]).collect()
    }

    /// Returns the part of the plane inside the domain.
    fn facets(&self, _: f64) -> Facets {
        let size = norm(self.frame.size);
        let middle = times(self.frame.size, 0.5);
        let foot = minus(middle, times(self.normal, self.distance(middle)));
        let (u, v) = super::facets::across(self.normal);
        let corner = |a: f64, b: f64| plus(foot, plus(times(u, a * size), times(v, b * size)));
        let face = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let part = self.within(face.map(|(a, b)| corner(a, b)).to_vec());
        let mut facets = Facets::default();
        if part.len() > 2 {
            facets.face(&part);
        }
        facets
    }
}
