//! The interface of a drag law, and the list of drag laws.

use super::dallavalle::Dallavalle;
use super::di_felice::DiFelice;
use super::gidaspow::Gidaspow;
use super::kozeny_carman::KozenyCarman;
use crate::family::family;

family! {
    /// The drag laws. A line here makes a law known to cases, to their schema, to `plan` and to runs.
    #[derive(Default)]
    pub enum DragLaw: Law {
        #[default]
        DiFelice,
        Gidaspow,
        Dallavalle,
        KozenyCarman,
    }
}

/// A drag law.
pub trait Law {
    /// The law in the schema of the case: one line.
    fn summary() -> &'static str
    where
        Self: Sized;

    /// The law with its parameters in the tables of `plan`.
    fn description(&self) -> String;

    /// Force over superficial velocity \[kg/s\] at superficial speed `speed` \[m/s\]. It is finite at rest.
    fn coefficient(&self, bed: &Bed, grain: &Grain, speed: f64) -> f64;

    /// The time in which drag stops a grain of mass `mass` \[kg\] at rest relative to the water \[s\]. `measure` is the factor of
    /// the grain's velocity beside the flux. Explicit drag is unstable where the coupling interval exceeds twice this time.
    fn stopping_time(&self, bed: &Bed, grain: &Grain, mass: f64, measure: f64) -> f64 {
        mass / (measure * self.coefficient(bed, grain, 0.0))
    }

    /// The drag on a grain from the water in its cells, each with the part of the grain in it.
    fn drag(&self, grain: &Grain, velocity: [f64; 3], cells: &[(Cell, f64)]) -> Drag {
        let mut drag = Drag::default();
        for (here, part) in cells {
            let past: [f64; 3] = std::array::from_fn(|a| here.flux[a] - here.measure * velocity[a]);
            let speed = (past.iter().map(|u| u * u).sum::<f64>()).sqrt();
            let b = part * self.coefficient(&here.bed, grain, speed);
            for a in 0..3 {
                drag.pull[a] += b * here.flux[a];
            }
            drag.rate += b * here.measure;
        }
        drag
    }
}

/// The drag on a grain as a function of its velocity v: `pull - rate v`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drag {
    /// Force on the grain at rest \[N\].
    pub pull: [f64; 3],
    /// Force over velocity \[kg/s\].
    pub rate: f64,
}

/// The water in a cell as a grain in it meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Gradient of the pressure \[Pa/m\].
    pub gradient: [f64; 3],
    /// Darcy flux \[m/s\].
    pub flux: [f64; 3],
    /// The water and the bed.
    pub bed: Bed,
    /// Factor of the grain's velocity beside the flux: the porosity, or 1 in the equations as printed.
    pub measure: f64,
}

/// The water and the bed around a grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bed {
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
pub struct Grain {
    /// Diameter \[m\].
    pub diameter: f64,
    /// Area across the flow \[m2\].
    pub area: f64,
    /// Volume \[m3\].
    pub volume: f64,
}

impl Grain {
    /// A sphere, or a disc in 2-D.
    #[must_use]
    pub fn new(dimension: usize, radius: f64) -> Self {
        Self {
            diameter: 2.0 * radius,
            area: if dimension == 2 {
                2.0 * radius
            } else {
                std::f64::consts::PI * radius * radius
            },
            volume: crate::darcy::porosity::measure(dimension, radius),
        }
    }
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;
    use crate::darcy::permeability::kozeny_carman;

    /// Water in a bed of this porosity.
    pub(in crate::coupling::drag) fn bed(porosity: f64, viscosity: f64) -> Bed {
        Bed {
            density: 1000.0,
            viscosity,
            porosity,
            solid: 1.0 - porosity,
            permeability: kozeny_carman(porosity, 1e-3),
        }
    }

    /// Loss of pressure in a bed at rest from the sum of drags: eps |grad p| = n f.
    pub(in crate::coupling::drag) fn gradient(law: &dyn Law, bed: &Bed, d: f64, speed: f64) -> f64 {
        let grain = Grain::new(3, 0.5 * d);
        let per_volume = bed.solid / grain.volume;
        per_volume * law.coefficient(bed, &grain, speed) * speed / bed.porosity
    }
}

/// A new drag law is one file, here the module `stokes`, and one line in the list.
#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    mod stokes {
        use crate::coupling::drag::law::{Bed, Grain, Law};

        /// Drag of a single grain in creeping flow: 3 pi mu d U.
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
            /// Multiplies the drag, without unit.
            #[schemars(extend("exclusiveMinimum" = 0))]
            factor: f64,
        }

        impl Law for Stokes {
            fn summary() -> &'static str {
                "Stokes 1851."
            }

            fn description(&self) -> String {
                format!("Stokes times {}", self.factor)
            }

            fn coefficient(&self, bed: &Bed, grain: &Grain, _: f64) -> f64 {
                3.0 * std::f64::consts::PI * bed.viscosity * grain.diameter * self.factor
            }
        }
    }
    use stokes::Stokes;

    family! {
        /// The real list with one line more.
        enum Longer: Law {
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
        let (bed, grain) = (testing::bed(0.4, 1e-3), Grain::new(3, 5e-4));
        let exact = 3.0 * std::f64::consts::PI * 1e-3 * 1e-3 * 2.0;
        assert!((law.model().coefficient(&bed, &grain, 0.1) / exact - 1.0).abs() < 1e-15);
        let time = law.model().stopping_time(&bed, &grain, 3e-6, 0.4);
        assert!((time / (3e-6 / (0.4 * exact)) - 1.0).abs() < 1e-15);
        let schema = serde_json::to_string(&schemars::schema_for!(Longer)).unwrap();
        for text in [
            "Stokes 1851.",
            "exclusiveMinimum",
            "Multiplies the drag",
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
            (DragLaw::KozenyCarman, "kozeny_carman"),
        ] {
            assert_eq!(serde_json::to_value(law).unwrap(), json!(name));
            assert_eq!(serde_json::from_value::<DragLaw>(json!(name)).unwrap(), law);
        }
        assert_eq!(DragLaw::default(), DragLaw::DiFelice);
    }
}
