//! File of an operator that exists in this test only.

use crate::collision::border::{Border, MovingBody, Situation};
use crate::collision::{Collision, CollisionModel, Dispatch, Kernels, Site};
use crate::lanes::Lanes;
use crate::lattice::Lattice;
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Operator of this test, which scales the incoming populations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Parameters {
    /// Factor of the populations, without unit.
    pub strength: f64,
}

impl CollisionModel for Parameters {
    fn describe(&self, _: f64) -> Description {
        Description::new(format!("a toy of strength {}", self.strength), "for tests")
    }

    fn border(&self, _: &Situation) -> Option<Border> {
        None
    }

    fn border_of_moving(&self, _: &MovingBody) -> Option<Border> {
        None
    }

    fn fails_at_faces(&self) -> f64 {
        f64::INFINITY
    }

    fn dispatch<D: Dispatch>(&self, to: D) -> D::Output {
        to.on_any_set(*self)
    }
}

impl Kernels for Parameters {
    type Uniform<const FORCED: bool> = Self;
    type Local = Self;
    type Covered = Self;

    fn uniform<const FORCED: bool>(&self, _: f64, _: [f64; 3]) -> Self {
        *self
    }

    fn local(&self, _: f64, _: [f64; 3]) -> Self {
        *self
    }

    fn covered(&self, _: f64, _: [f64; 3]) -> Self {
        *self
    }
}

impl Collision for Parameters {
    type Rates<N: Lanes> = N;

    fn uniform<N: Lanes>(&self) -> N {
        N::splat(self.strength)
    }

    fn local<N: Lanes>(&self, _: N) -> N {
        N::splat(self.strength)
    }

    fn collide<L: Lattice<Q>, N: Lanes, G: Site<N, Q>, const Q: usize>(
        &self,
        g: &mut G,
        &strength: &N,
    ) -> [N; 3] {
        for i in 0..Q {
            let scaled = g.incoming(i) * strength;
            g.leave(i, scaled);
        }
        [N::splat(0.0); 3]
    }
}
