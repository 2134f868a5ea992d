//! A round cylinder with flat ends: a pier, a pile, a pipe.

use super::solid::{Scope, Solid, between};
use super::{Facets, Point, dot, minus, norm, only_in, plus, times};
use base::error::Report;
use base::geometry::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A cylinder between the centres of its ends (3-D).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Cylinder {
    /// Centre of one end [m].
    pub from: Vector,
    /// Centre of the other end [m].
    pub to: Vector,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
}

impl Cylinder {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, .. } = at;
        if !only_in(3, frame, path, "disc", report) {
            return None;
        }
        let from = self.from.resolve(3, &format!("{path}.from"), report);
        let to = self.to.resolve(3, &format!("{path}.to"), report);
        let length = norm(minus(to, from));
        if !(length > 0.0 && length.is_finite()) {
            report.error(
                path,
                "the two ends are the same point".into(),
                "give the centres of both ends".into(),
            );
            return None;
        }
        Some(Arc::new(Rod {
            from,
            axis: times(minus(to, from), 1.0 / length),
            length,
            radius: self.radius,
        }))
    }
}

#[derive(Debug)]
struct Rod {
    from: Point,
    axis: Point,
    length: f64,
    radius: f64,
}

impl Solid for Rod {
    fn distance(&self, at: Point) -> f64 {
        let arm = minus(at, self.from);
        let height = dot(arm, self.axis);
        let across = norm(minus(arm, times(self.axis, height))) - self.radius;
        let along = (-height).max(height - self.length);
        across.max(0.0).hypot(along.max(0.0)) + across.max(along).min(0.0)
    }

    fn extent(&self) -> [Point; 2] {
        let to = plus(self.from, times(self.axis, self.length));
        let reach = self
            .axis
            .map(|n| self.radius * (1.0 - n * n).max(0.0).sqrt());
        [
            std::array::from_fn(|a| self.from[a].min(to[a]) - reach[a]),
            std::array::from_fn(|a| self.from[a].max(to[a]) + reach[a]),
        ]
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        let arm = minus(from, self.from);
        let (height, rise) = (dot(arm, self.axis), dot(along, self.axis));
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        if rise.abs() > 0.0 {
            let (s, t) = (-height / rise, (self.length - height) / rise);
            (first, last) = (first.max(s.min(t)), last.min(s.max(t)));
        } else if height <= 0.0 || height >= self.length {
            return;
        }
        let flat = |v: Point, h: f64| minus(v, times(self.axis, h));
        let mut round = Vec::new();
        super::sphere::intersect_ball(
            flat(arm, height),
            flat(along, rise),
            self.radius,
            &mut round,
        );
        for [s, t] in round {
            between(first.max(s), last.min(t), found);
        }
    }

    fn outline(&self, _: f64) -> Vec<[f64; 2]> {
        Vec::new()
    }

    fn facets(&self, tolerance: f64) -> Facets {
        let (u, v) = super::facets::across(self.axis);
        let ring: Vec<Point> = super::facets::circle(self.radius, tolerance)
            .map(|[x, y]| plus(self.from, plus(times(u, x), times(v, y))))
            .collect();
        let rise = times(self.axis, self.length);
        let top: Vec<Point> = ring.iter().map(|at| plus(*at, rise)).collect();
        let mut facets = Facets::default();
        for k in 0..ring.len() {
            let next = (k + 1) % ring.len();
            facets.face(&[ring[k], ring[next], top[next], top[k]]);
        }
        facets.face(&top);
        facets.face(&ring.iter().rev().copied().collect::<Vec<_>>());
        facets
    }

    fn deviation(&self, tolerance: f64) -> f64 {
        super::facets::sagitta(self.radius, tolerance)
    }
}
