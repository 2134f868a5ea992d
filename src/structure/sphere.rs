//! A sphere.

use super::solid::{Scope, Solid, between};
use super::{Facets, Point, dot, minus, norm, only_in, plus, times};
use base::error::Report;
use base::geometry::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A sphere (3-D).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Sphere {
    /// Centre [m].
    pub centre: Vector,
    /// Radius [m].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
}

impl Sphere {
    pub(super) fn solid(&self, at: Scope<'_>, report: &mut dyn Report) -> Option<Arc<dyn Solid>> {
        let Scope { frame, path, .. } = at;
        only_in(3, frame, path, "disc", report).then(|| {
            let centre = self.centre.resolve(3, &format!("{path}.centre"), report);
            let ball: Arc<dyn Solid> = Arc::new(Ball {
                centre,
                radius: self.radius,
            });
            ball
        })
    }
}

#[derive(Debug)]
struct Ball {
    centre: Point,
    radius: f64,
}

impl Ball {
    /// Returns the number of rings of facets from pole to pole for a tolerance \[m\].
    fn rings(&self, tolerance: f64) -> usize {
        let rings = super::facets::segments(self.radius, 0.5 * tolerance).div_ceil(2);
        rings.clamp(8, MAX_RINGS)
    }
}

/// Finds the part of a line inside a ball (or disc) about the origin.
pub(super) fn intersect_ball(from: Point, along: Point, radius: f64, found: &mut Vec<[f64; 2]>) {
    let (aa, ab) = (dot(along, along), dot(along, from));
    let excess = dot(from, from) - radius * radius;
    let under = ab * ab - aa * excess;
    if under > 0.0 {
        let root = under.sqrt();
        between((-ab - root) / aa, (-ab + root) / aa, found);
    } else if aa <= 0.0 && excess < 0.0 {
        between(0.0, 1.0, found);
    }
}

/// Maximum number of rings of facets from pole to pole.
const MAX_RINGS: usize = 96;

impl Solid for Ball {
    fn distance(&self, at: Point) -> f64 {
        norm(minus(at, self.centre)) - self.radius
    }

    fn extent(&self) -> [Point; 2] {
        [
            self.centre.map(|x| x - self.radius),
            self.centre.map(|x| x + self.radius),
        ]
    }

    fn chords(&self, from: Point, along: Point, found: &mut Vec<[f64; 2]>) {
        intersect_ball(minus(from, self.centre), along, self.radius, found);
    }

    fn outline(&self, _: f64) -> Vec<[f64; 2]> {
        Vec::new()
    }

    /// Returns rings of quadrilaterals, with triangles at the poles. The distance of a facet from the sphere is the
    /// sagitta of its diagonal.
    fn facets(&self, tolerance: f64) -> Facets {
        let rings = self.rings(tolerance);
        let around = 2 * rings;
        let step = std::f64::consts::PI / base::number::real(rings);
        let at = |ring: usize, k: usize| {
            let (theta, phi) = (
                step * base::number::real(ring),
                step * base::number::real(k % around),
            );
            let (s, c) = if ring == 0 || ring == rings {
                (0.0, if ring == 0 { 1.0 } else { -1.0 })
            } else {
                theta.sin_cos()
            };
            plus(
                self.centre,
                times([s * phi.cos(), s * phi.sin(), c], self.radius),
            )
        };
        let mut facets = Facets::default();
        for ring in 0..rings {
            for k in 0..around {
                let corners = [
                    at(ring, k),
                    at(ring + 1, k),
                    at(ring + 1, k + 1),
                    at(ring, k + 1),
                ];
                if ring == 0 {
                    facets.face(&corners[..3]);
                } else if ring + 1 == rings {
                    facets.face(&[corners[0], corners[1], corners[3]]);
                } else {
                    facets.face(&corners);
                }
            }
        }
        facets
    }

    /// Returns the sagitta of the diagonal of a facet at the equator.
    fn deviation(&self, tolerance: f64) -> f64 {
        let half = 0.5 * std::f64::consts::PI / base::number::real(self.rings(tolerance));
        self.radius * half.sin().powi(2)
    }
}
