//! A box along the axes: a cut-off wall, a step, a bridge pier.

use super::solid::{Scope, Solid, between};
use super::{Facets, Point};
use base::error::Report;
use base::geometry::Extent;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A box along the axes; a rectangle in 2-D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct Cuboid(pub Extent);

impl Cuboid {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, .. } = at;
        let from = self
            .0
            .from
            .resolve(frame.dimension, &format!("{path}.from"), report);
        let to = self
            .0
            .to
            .resolve(frame.dimension, &format!("{path}.to"), report);
        if !(0..frame.dimension).all(|a| from[a] < to[a]) {
            report.error(
                path,
                "the box has no volume".into(),
                "give the corners with the smallest and the largest coordinates".into(),
            );
            return None;
        }
        let (mut low, mut high) = (from, to);
        for a in frame.dimension..3 {
            (low[a], high[a]) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        Some(Arc::new(Box { low, high }))
    }
}

/// A box between two corners, infinite along z in 2-D.
#[derive(Debug)]
struct Box {
    low: Point,
    high: Point,
}

impl Solid for Box {
    fn distance(&self, at: Point) -> f64 {
        let out: Point = std::array::from_fn(|a| (self.low[a] - at[a]).max(at[a] - self.high[a]));
        let outside = out.iter().map(|d| d.max(0.0).powi(2)).sum::<f64>().sqrt();
        let inside = out
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max)
            .min(0.0);
        outside + inside
    }

    fn extent(&self) -> [Point; 2] {
        [self.low, self.high]
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for a in 0..3 {
            let (low, high) = (self.low[a] - from[a], self.high[a] - from[a]);
            if along[a].abs() > 0.0 {
                let (s, t) = (low / along[a], high / along[a]);
                first = first.max(s.min(t));
                last = last.min(s.max(t));
            } else if low >= 0.0 || high <= 0.0 {
                return;
            }
        }
        between(first, last, found);
    }

    fn outline(&self, _: f64) -> Vec<[f64; 2]> {
        let ([x, y, _], [u, v, _]) = (self.low, self.high);
        vec![[x, y], [u, y], [u, v], [x, v]]
    }

    fn facets(&self, _: f64) -> Facets {
        Facets::along(&self.outline(0.0), 2, self.low[2], self.high[2])
    }

    fn length(&self, axis: usize, between: [f64; 2]) -> Option<Arc<dyn Solid>> {
        let (mut low, mut high) = (self.low, self.high);
        [low[axis], high[axis]] = between;
        Some(Arc::new(Self { low, high }))
    }
}
