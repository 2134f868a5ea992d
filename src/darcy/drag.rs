//! Drag of seeping water on grains.
//!
//! A law gives the force on a grain of a bed over the superficial velocity of the water past it,
//! [`DragFormula::coefficient`] `b`. The pressure loss of water in a stationary bed of n grains per volume is then
//!
//! ```text
//! eps |grad phi| = n b(q) q
//! ```
//!
//! which turns a drag law into a resistance law ([`resistance`]). Conversely, [`reaction`] is the drag that a
//! resistance law implies.
//!
//! A drag law is one file below this module and one line of the list.

use super::Liquid;
use base::family::family;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

family! {
    /// Drag laws. A new line makes a law available to cases, to their schema, to `plan` and to runs.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case", deny_unknown_fields)]
    #[schemars(inline)]
    pub enum DragLaw: dyn DragFormula, summary {
        #[default]
        reaction: Reaction,
        di_felice: DiFelice,
        gidaspow: Gidaspow,
        dallavalle: Dallavalle,
    }
}

/// Drag law.
pub trait DragFormula: Sync {
    /// Returns the description of the law in the schema of the case: one line.
    fn summary() -> &'static str
    where
        Self: Sized;

    /// Returns the law with its parameters for the tables of `plan`.
    fn description(&self) -> String;

    /// Returns the force over superficial velocity \[kg/s\] at superficial speed `speed` \[m/s\]. It is finite at
    /// zero speed.
    fn coefficient(&self, bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64;

    /// Returns the time in which drag stops a grain of mass `mass` \[kg\] at rest relative to the water \[s\].
    /// `measure` is the factor of the grain's velocity relative to the flux. Explicit drag is unstable if the
    /// coupling interval exceeds twice this time.
    fn stopping_time(
        &self,
        bed: &BedConditions,
        grain: &GrainSize,
        mass: f64,
        measure: f64,
    ) -> f64 {
        mass / (measure * self.coefficient(bed, grain, 0.0))
    }

    /// Returns `true` if the forces on stationary grains balance the pressure loss for every resistance law.
    fn balances(&self) -> bool {
        false
    }
}

/// Water and bed around a grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BedConditions {
    /// Density of the water \[kg/m3\].
    pub density: f64,
    /// Dynamic viscosity \[Pa s\].
    pub viscosity: f64,
    /// Porosity, within the limits of the permeability.
    pub porosity: f64,
    /// Volume of grains per volume inside the walls, without limits.
    pub solid: f64,
    /// Permeability \[m2\].
    pub permeability: f64,
}

/// Size of a grain; in 2-D per metre of depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrainSize {
    /// Diameter \[m\].
    pub diameter: f64,
    /// Area across the flow \[m2\].
    pub area: f64,
    /// Volume \[m3\].
    pub volume: f64,
}

impl GrainSize {
    /// Returns the size of a sphere, or of a disc in 2-D.
    #[must_use]
    pub fn new(dimension: usize, radius: f64) -> Self {
        Self {
            diameter: 2.0 * radius,
            area: if dimension == 2 {
                2.0 * radius
            } else {
                std::f64::consts::PI * radius * radius
            },
            volume: super::porosity::measure(dimension, radius),
        }
    }
}

/// Returns the loss of reduced pressure over the flux \[Pa s/m²\] of a bed of equal spheres with this drag law.
pub fn resistance(
    law: &impl DragFormula,
    porosity: f64,
    diameter: f64,
    liquid: Liquid,
    speed: f64,
) -> f64 {
    let grain = GrainSize::new(3, 0.5 * diameter);
    let bed = BedConditions {
        density: liquid.density,
        viscosity: liquid.viscosity,
        porosity,
        solid: 1.0 - porosity,
        permeability: f64::NAN,
    };
    bed.solid / (grain.volume * porosity) * law.coefficient(&bed, &grain, speed)
}

/// Returns the permeability \[m²\] of a bed of equal spheres with this drag law, under a gradient of the reduced
/// pressure \[Pa/m\]: `mu q/|grad phi|` with the flux q that solves `eps |grad phi| = n b(q) q`.
///
/// The coefficient b does not decrease with the speed, and increases at most proportionally to it. The iteration `q
/// <- q [eps |grad phi|/(n b(q) q)]^(1/s)`, with s = d log(b q)/d log q, converges from above.
pub fn permeability(
    law: &impl DragFormula,
    porosity: f64,
    diameter: f64,
    liquid: Liquid,
    gradient: f64,
) -> f64 {
    let loss = |q: f64| resistance(law, porosity, diameter, liquid, q);
    let at_rest = loss(0.0);
    let mut q = gradient / at_rest;
    // The water is stationary, or so slow that inertia is negligible.
    if q < f64::EPSILON * liquid.viscosity / (liquid.density * diameter) {
        return liquid.viscosity / at_rest;
    }
    for _ in 0..MAX_STEPS {
        let here = loss(q);
        let above = loss(q * (1.0 + NEARBY));
        let power = 1.0 + (above / here - 1.0) / NEARBY;
        let step = (gradient / (here * q)).powf(1.0 / power);
        q *= step;
        if (step - 1.0).abs() < 1e-13 {
            break;
        }
    }
    liquid.viscosity * q / gradient
}

/// Relative difference of the two speeds with which the slope of a law is computed.
const NEARBY: f64 = 1e-4;
/// Maximum number of iterations of [`permeability`]: five are usual.
const MAX_STEPS: usize = 30;

#[cfg(test)]
pub(super) mod testing {
    use super::*;
    use crate::resistance::kozeny_carman;

    /// Returns the conditions of water in a bed of this porosity.
    pub(in crate::drag) fn bed(porosity: f64, viscosity: f64) -> BedConditions {
        BedConditions {
            density: 1000.0,
            viscosity,
            porosity,
            solid: 1.0 - porosity,
            permeability: kozeny_carman(porosity, 1e-3),
        }
    }

    /// Returns the pressure loss in a stationary bed from the sum of drags: eps |grad p| = n f.
    pub(in crate::drag) fn gradient(
        law: &dyn DragFormula,
        bed: &BedConditions,
        d: f64,
        speed: f64,
    ) -> f64 {
        let grain = GrainSize::new(3, 0.5 * d);
        let per_volume = bed.solid / grain.volume;
        per_volume * law.coefficient(bed, &grain, speed) * speed / bed.porosity
    }
}

/// Example of a new drag law: one file, here the module `stokes`, and one line in the list.
#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    mod stokes {
        use crate::drag::{BedConditions, DragFormula, GrainSize};

        /// Test law for a single grain in creeping flow: 3 pi mu d U.
        #[derive(
            Clone,
            Copy,
            Debug,
            PartialEq,
            serde::Serialize,
            serde::Deserialize,
            schemars::JsonSchema,
        )]
        #[serde(deny_unknown_fields)]
        pub(super) struct Stokes {
            /// Dimensionless factor of the drag.
            #[schemars(extend("exclusiveMinimum" = 0))]
            factor: f64,
        }

        impl DragFormula for Stokes {
            fn summary() -> &'static str {
                "Stokes 1851."
            }

            fn description(&self) -> String {
                format!("Stokes times {}", self.factor)
            }

            fn coefficient(&self, bed: &BedConditions, grain: &GrainSize, _: f64) -> f64 {
                3.0 * std::f64::consts::PI * bed.viscosity * grain.diameter * self.factor
            }
        }
    }
    use di_felice::DiFelice;
    use stokes::Stokes;

    family! {
        dispatch each_law;
        /// The actual list with one more line.
        #[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        enum Longer: dyn DragFormula, summary {
            DiFelice,
            Stokes(Stokes),
        }
    }

    #[test]
    fn a_new_law_is_one_file_and_one_line() {
        let written = json!({"stokes": {"factor": 2.0}});
        let law: Longer = serde_json::from_value(written.clone()).unwrap();
        assert_eq!(serde_json::to_value(law).unwrap(), written);
        assert_eq!(law.model().description(), "Stokes times 2");
        let (bed, grain) = (testing::bed(0.4, 1e-3), GrainSize::new(3, 5e-4));
        let exact = 3.0 * std::f64::consts::PI * 1e-3 * 1e-3 * 2.0;
        assert!((law.model().coefficient(&bed, &grain, 0.1) / exact - 1.0).abs() < 1e-15);
        let time = law.model().stopping_time(&bed, &grain, 3e-6, 0.4);
        assert!((time / (3e-6 / (0.4 * exact)) - 1.0).abs() < 1e-15);
        let schema = serde_json::to_string(&schemars::schema_for!(Longer)).unwrap();
        for text in [
            "Stokes 1851.",
            "exclusiveMinimum",
            "Dimensionless factor of the drag.",
            "di_felice",
        ] {
            assert!(schema.contains(text), "{text}: {schema}");
        }
        assert!(serde_json::from_value::<Longer>(json!({"stokes": {}})).is_err());
    }

    #[test]
    fn laws_without_parameters_stand_in_the_case_as_their_names() {
        for (law, name) in [
            (DragLaw::DiFelice, "di_felice"),
            (DragLaw::Gidaspow, "gidaspow"),
            (DragLaw::Dallavalle, "dallavalle"),
            (DragLaw::Reaction, "reaction"),
        ] {
            assert_eq!(serde_json::to_value(law).unwrap(), json!(name));
            assert_eq!(serde_json::from_value::<DragLaw>(json!(name)).unwrap(), law);
        }
        assert_eq!(DragLaw::default(), DragLaw::Reaction);
    }
}
