//! A disc in 2-D: a round pier or a pipe across the plane.

use super::solid::{Scope, Solid};
use super::{Facets, Point, facets, only_in, sphere};
use base::error::Report;
use base::geometry::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A disc (2-D).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Disc {
    /// Centre [m].
    pub centre: Vector,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
}

impl Disc {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, .. } = at;
        only_in(2, frame, path, "cylinder or sphere", report).then(|| {
            let centre = self.centre.resolve(2, &format!("{path}.centre"), report);
            let round: Arc<dyn Solid> = Arc::new(RoundPlate {
                centre,
                radius: self.radius,
            });
            round
        })
    }
}

#[derive(Debug)]
struct RoundPlate {
    centre: Point,
    radius: f64,
}

fn flat(at: Point) -> Point {
    [at[0], at[1], 0.0]
}

impl Solid for RoundPlate {
    fn distance(&self, at: Point) -> f64 {
        (at[0] - self.centre[0]).hypot(at[1] - self.centre[1]) - self.radius
    }

    fn extent(&self) -> [Point; 2] {
        let [x, y, _] = self.centre;
        let r = self.radius;
        [
            [x - r, y - r, f64::NEG_INFINITY],
            [x + r, y + r, f64::INFINITY],
        ]
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        sphere::intersect_ball(
            flat(super::minus(from, self.centre)),
            flat(along),
            self.radius,
            found,
        );
    }

    fn outline(&self, tolerance: f64) -> Vec<[f64; 2]> {
        facets::circle(self.radius, tolerance)
            .map(|[x, y]| [self.centre[0] + x, self.centre[1] + y])
            .collect()
    }

    fn facets(&self, _: f64) -> Facets {
        Facets::default()
    }

    fn deviation(&self, tolerance: f64) -> f64 {
        facets::sagitta(self.radius, tolerance)
    }
}
