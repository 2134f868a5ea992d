//! Functions of the engine for the concrete law of a list.

use super::{ContactLaw, PairProperties};
use crate::engine::bodies::Bodies;
use crate::particles::{Body, Kind};
use crate::space::Space;

/// Resolved law of a list.
pub(crate) trait Family {
    /// Calls `visitor` with the concrete law, so that its code is compiled once per law.
    fn visit<S: Space, V: Visitor<S>>(&self, visitor: V) -> V::Output;
}

/// Operation on a law of a concrete type.
pub(crate) trait Visitor<S: Space> {
    /// Result of the visit.
    type Output;
    /// Executes the operation.
    fn visit<L: Bodies<S>>(self, law: &L) -> Self::Output;
}

/// Operation that returns `sqrt(m/k)` [s] of the stiffest contact that any of `grains` can have with bodies or
/// walls of `materials` materials.
pub(super) struct CriticalTimeStep<I> {
    pub(super) grains: I,
    pub(super) materials: u32,
}

impl<'a, S: Space, I: IntoIterator<Item = &'a Body> + Clone> Visitor<S> for CriticalTimeStep<I> {
    type Output = f64;

    fn visit<L: Bodies<S>>(self, law: &L) -> f64 {
        let table = law.table();
        let grains = self.grains.clone().into_iter();
        let largest = grains.map(|body| body.radius).fold(0.0, f64::max);
        let mut limit = f64::INFINITY;
        for body in self
            .grains
            .into_iter()
            .filter(|body| body.kind == Kind::Free)
        {
            for material in 0..self.materials.max(1) {
                for diameter in [2.0 * body.radius, body.radius + largest] {
                    let pair = PairProperties {
                        materials: [body.material, material],
                        diameter,
                        mass: body.mass,
                        rolling_radius: body.radius,
                        rolling_inertia: body.inertia,
                    };
                    let row = table.get(pair.materials[0], pair.materials[1]);
                    let [normal, shear] = <L as ContactLaw<S>>::stiffness(&L::between(row, &pair));
                    limit = limit.min((body.mass / normal.max(shear)).sqrt());
                }
            }
        }
        limit
    }
}
