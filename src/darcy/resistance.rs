//! Permeability of a bed of grains from its porosity and a mean diameter.
//!
//! Without a maximum of the porosity, cells without grains would conduct without bound.
//!
//! Each resistance law has its own file below this module, or is a drag law ([`super::drag`]) used as resistance,
//! and has one line in the list.

pub mod ergun;
pub mod kozeny_carman;

pub use kozeny_carman::kozeny_carman;

use super::drag::di_felice::DiFelice;
use super::drag::gidaspow::{Gidaspow, wen_yu};
use super::drag::{BedConditions, GrainSize};
use super::mean_diameter::MeanDiameter;
use super::{Equations, Liquid};
use base::family::family;
use ergun::Ergun;
use kozeny_carman::KozenyCarman;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

family! {
    /// Resistance laws. A new line makes a law available to cases, to their schema, to `plan` and to runs.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case", deny_unknown_fields)]
    #[schemars(inline)]
    pub enum Resistance: dyn ResistanceFormula, summary {
        #[default]
        Gidaspow,
        KozenyCarman,
        Ergun,
        DiFelice,
    }
}

/// Resistance law: the permeability K \[m²\] of a bed.
pub trait ResistanceFormula: Sync {
    /// Returns the description of the law in the schema of the case: one line.
    fn summary() -> &'static str
    where
        Self: Sized;

    /// Returns the law with its parameters for the tables of `plan`.
    fn description(&self) -> String;

    /// Returns K \[m2\] of a bed of porosity `porosity` and mean diameter `diameter` \[m\] under a gradient of the
    /// reduced pressure \[Pa/m\].
    fn permeability(&self, porosity: f64, diameter: f64, liquid: Liquid, gradient: f64) -> f64;

    /// Returns the loss of reduced pressure over the flux \[Pa s/m²\] of a bed at a superficial speed \[m/s\]:
    /// `mu/K` at this speed.
    fn resistance(&self, porosity: f64, diameter: f64, liquid: Liquid, speed: f64) -> f64;

    /// Returns the force over the superficial speed \[kg/s\] on a grain in dilute water. A resistance of beds that
    /// vanishes for a single grain is replaced there by the law of Wen and Yu.
    fn dilute(&self, bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64 {
        wen_yu(bed, grain, speed)
    }

    /// Returns `true` if K depends on the gradient: pressure and permeability are then computed alternately until
    /// both converge.
    fn depends_on_the_gradient(&self) -> bool {
        false
    }

    /// Returns `true` if the law may be used with these equations.
    fn supports_equations(&self, _equations: Equations) -> bool {
        true
    }

    /// Computes K \[m2\] of every cell.
    fn fill(&self, bed: BedOfCells<'_>, liquid: Liquid, permeability: &mut [f64]) {
        for (cell, permeability) in permeability.iter_mut().enumerate() {
            *permeability = self.permeability(
                bed.porosity[cell],
                bed.diameter[cell],
                liquid,
                bed.gradient[cell],
            );
        }
    }

    /// Returns the largest relative change from the given permeabilities to those of the bed, weighted by the gradient
    /// of the cell relative to the largest, which is the resulting error of the gradient. In open water the gradient is
    /// of the order of rounding, so that the change has no effect there.
    fn change(&self, bed: BedOfCells<'_>, liquid: Liquid, permeability: &[f64]) -> f64 {
        let mut change = 0.0_f64;
        let steepest = bed.steepest();
        for (cell, before) in permeability.iter().enumerate() {
            let next = self.permeability(
                bed.porosity[cell],
                bed.diameter[cell],
                liquid,
                bed.gradient[cell],
            );
            change = larger(
                change,
                bed.weight(cell, steepest) * (next / before - 1.0).abs(),
            );
        }
        change
    }
}

/// Returns the larger of two numbers; NaN if either is NaN.
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// Quantities on which the permeability of every cell depends.
#[derive(Clone, Copy, Debug)]
pub struct BedOfCells<'a> {
    /// Porosity of each cell, within its limits.
    pub porosity: &'a [f64],
    /// Mean diameter of the grains \[m\].
    pub diameter: &'a [f64],
    /// Magnitude of the gradient of the reduced pressure \[Pa/m\].
    pub gradient: &'a [f64],
}

impl BedOfCells<'_> {
    /// Returns the largest gradient \[Pa/m\].
    pub(super) fn steepest(&self) -> f64 {
        self.gradient.iter().copied().fold(0.0, f64::max)
    }

    /// Returns the gradient of a cell over the largest; 1 if there is none.
    pub(super) fn weight(&self, cell: usize, steepest: f64) -> f64 {
        if steepest > 0.0 {
            self.gradient[cell] / steepest
        } else {
            1.0
        }
    }
}

/// Resistance law with the limits of the porosity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResistanceSettings {
    /// Law of flow resistance.
    pub law: Resistance,
    /// Mean diameter used by the law.
    pub diameter: MeanDiameter,
    /// Maximum porosity, which replaces larger values.
    pub porosity_cap: f64,
    /// Minimum porosity, which replaces smaller values, as those of overlapping grains.
    pub least_porosity: f64,
}

impl ResistanceSettings {
    /// Returns the porosity within its limits.
    #[must_use]
    pub fn limited(&self, porosity: f64) -> f64 {
        porosity.clamp(self.least_porosity, self.porosity_cap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cap_holds() {
        let permeability = ResistanceSettings {
            law: Resistance::KozenyCarman,
            diameter: MeanDiameter::Sauter,
            porosity_cap: 0.7,
            least_porosity: 0.05,
        };
        assert_eq!(permeability.limited(1.0), 0.7);
        assert_eq!(permeability.limited(-0.2), 0.05);
    }

    #[test]
    fn cells_have_the_permeability_of_the_law() {
        let liquid = Liquid {
            density: 1000.0,
            viscosity: 1e-3,
        };
        for law in [
            Resistance::Gidaspow,
            Resistance::KozenyCarman,
            Resistance::Ergun,
            Resistance::DiFelice,
        ] {
            let law = law.model();
            let bed = BedOfCells {
                porosity: &[0.4, 0.5],
                diameter: &[1e-3, 2e-3],
                gradient: &[10.0, 1e4],
            };
            let mut permeability = [0.0; 2];
            law.fill(bed, liquid, &mut permeability);
            assert_eq!(permeability[1], law.permeability(0.5, 2e-3, liquid, 1e4));
            assert_eq!(law.change(bed, liquid, &permeability), 0.0);
            let steeper = BedOfCells {
                gradient: &[20.0, 2e4],
                ..bed
            };
            let change = law.change(steeper, liquid, &permeability);
            assert_eq!(change > 0.0, law.depends_on_the_gradient());
        }
    }
}
