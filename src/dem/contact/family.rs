//! Generation of types from a list of contact laws, one line each: the choice in a case, the resolved laws, and the
//! dispatch to the concrete law.

use super::{ContactLaw, PairProperties};
use crate::engine::bodies::Bodies;
use crate::particles::{Body, Kind};
use crate::space::Space;

/// Generates the two enums of a family of contact laws from a list.
///
/// A line `Name(parameters) => Variant(law), ...;` adds a law: `Name`, in snake case, is its name in a case,
/// `parameters` implements [`ContactParameters`](super::ContactParameters), and each `law` to which they may
/// resolve implements [`ContactModel`](super::ContactModel), [`ContactLaw`] and [`Bodies`].
macro_rules! contact_laws {
    (
        $(#[$about:meta])* $vis:vis $Contact:ident,
        $(#[$resolved:meta])* $Law:ident:
        $( $(#[$doc:meta])* $Name:ident($parameters:ty) => $($Variant:ident($law:ty)),+; )+
    ) => {
        $(#[$about])*
        #[derive(
            Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
        )]
        #[serde(rename_all = "snake_case")]
        $vis enum $Contact {
            $( $(#[$doc])* $Name($parameters), )+
        }

        impl $Contact {
            /// Returns the law with its parameters for every pair of materials; reports errors.
            $vis fn resolve(
                &self,
                scene: &$crate::contact::SceneFacts<'_>,
                report: &mut dyn base::error::Report,
            ) -> Option<$Law> {
                use $crate::contact::ContactParameters;
                match self {
                    $( Self::$Name(parameters) => parameters.resolve(scene, report), )+
                }
            }

            /// Returns the local damping: a force of this fraction of the force on a grain opposes its motion; 0 is
            /// off.
            #[must_use]
            $vis fn local_damping(&self) -> f64 {
                match self {
                    $( Self::$Name(parameters) => {
                        $crate::contact::ContactParameters::<$Law>::local_damping(parameters)
                    } )+
                }
            }

            /// Returns `true` if the case states the friction, zero included, instead of leaving it out.
            #[must_use]
            $vis fn states_friction(&self) -> bool {
                match self {
                    $( Self::$Name(parameters) => {
                        $crate::contact::ContactParameters::<$Law>::states_friction(parameters)
                    } )+
                }
            }

            /// Returns `true` if the law supports polyhedra.
            #[must_use]
            $vis fn of_polyhedra(&self) -> bool {
                match self {
                    $( Self::$Name(parameters) => {
                        $crate::contact::ContactParameters::<$Law>::of_polyhedra(parameters)
                    } )+
                }
            }
        }

        $(#[$resolved])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        #[serde(rename_all = "snake_case")]
        $vis enum $Law {
            $($(
                #[doc = concat!("`", stringify!($law), "`.")]
                $Variant($law),
            )+)+
        }

        impl $Law {
            /// Returns the law as an interface for plan, preparation and outputs.
            #[must_use]
            $vis fn model(&self) -> &dyn $crate::contact::ContactModel {
                match self {
                    $($( Self::$Variant(law) => law, )+)+
                }
            }

            /// Returns the model for changes.
            $vis fn model_mut(&mut self) -> &mut dyn $crate::contact::ContactModel {
                match self {
                    $($( Self::$Variant(law) => law, )+)+
                }
            }
        }

        impl $crate::contact::family::Family for $Law {
            fn visit<S, V>(&self, visitor: V) -> V::Output
            where
                S: $crate::space::Space,
                V: $crate::contact::family::Visitor<S>,
            {
                match self {
                    $($( Self::$Variant(law) => visitor.visit(law), )+)+
                }
            }
        }

        $($(
            impl From<$law> for $Law {
                fn from(law: $law) -> Self {
                    Self::$Variant(law)
                }
            }
        )+)+
    };
}
pub(crate) use contact_laws;

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
