//! Drag of Di Felice.
//!
//! ```text
//! f = C_d rho A |U| U eps^-chi / 2,   chi = 3.7 - 0.65 exp[-(1.5 - log10 Re)^2/2],   Re = rho d |U|/mu
//! ```
//!
//! with the drag coefficient of [`super::dallavalle`], the projected area A and the superficial velocity U of the
//! water past the grain (R. Di Felice, Int. J. Multiphase Flow 20 (1994) 153). The published fissure model uses the
//! interstitial velocity for U. As a resistance law it is [`super::resistance`] with this drag.

use super::dallavalle::Dallavalle;
use super::{BedConditions, DragFormula, GrainSize};
use crate::{Equations, Liquid, resistance};

/// Drag law of Di Felice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiFelice;

/// Returns the exponent chi.
#[must_use]
pub fn exponent(reynolds: f64) -> f64 {
    let x = 1.5 - reynolds.max(f64::MIN_POSITIVE).log10();
    3.7 - 0.65 * (-0.5 * x * x).exp()
}

impl DragFormula for DiFelice {
    fn summary() -> &'static str {
        "Di Felice 1994."
    }

    fn description(&self) -> String {
        "Di Felice".into()
    }

    fn coefficient(&self, bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64 {
        let reynolds = bed.density * grain.diameter * speed / bed.viscosity;
        Dallavalle.coefficient(bed, grain, speed) * bed.porosity.powf(-exponent(reynolds))
    }
}

impl resistance::ResistanceFormula for DiFelice {
    fn summary() -> &'static str {
        "Di Felice 1994: the drag on the grains as a resistance, with inertial losses. Requires the corrected \
         equations."
    }

    fn description(&self) -> String {
        "Di Felice's drag as a resistance".into()
    }

    fn permeability(&self, porosity: f64, diameter: f64, liquid: Liquid, gradient: f64) -> f64 {
        super::permeability(self, porosity, diameter, liquid, gradient)
    }

    fn resistance(&self, porosity: f64, diameter: f64, liquid: Liquid, speed: f64) -> f64 {
        super::resistance(self, porosity, diameter, liquid, speed)
    }

    fn dilute(&self, bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64 {
        self.coefficient(bed, grain, speed)
    }

    fn depends_on_the_gradient(&self) -> bool {
        true
    }

    fn supports_equations(&self, equations: Equations) -> bool {
        equations == Equations::Corrected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drag::dallavalle::drag_coefficient;
    use crate::drag::testing::bed;

    #[test]
    fn agrees_with_the_table() {
        let table = include_str!("../../../tests/reference/di_felice.csv");
        let mut rows = 0;
        for line in table.lines().skip(2) {
            let row: Vec<f64> = line.split(',').map(|v| v.trim().parse().unwrap()).collect();
            let (reynolds, chi, drag) = (row[0], row[1], row[2]);
            assert!((exponent(reynolds) - chi).abs() < 1e-8);
            assert!((drag_coefficient(reynolds) / drag - 1.0).abs() < 1e-8);
            let grain = GrainSize::new(3, 5e-4);
            let speed = reynolds * 1e-3 / (1000.0 * 1e-3);
            for (eps, factor) in [0.35, 0.4, 0.5, 0.8].into_iter().zip(&row[5..]) {
                let force = DiFelice.coefficient(&bed(eps, 1e-3), &grain, speed) * speed;
                let single = 0.5 * drag * 1000.0 * grain.area * speed * speed;
                // The table has six decimals, and its drag coefficient nine digits.
                assert!((force / single - factor).abs() < 5.1e-7 + 1e-8 * factor);
            }
            rows += 1;
        }
        assert_eq!(rows, 6);
        assert!((exponent(10.0_f64.powf(1.5)) - 3.05).abs() < 1e-14);
        let at_rest = DiFelice.coefficient(&bed(0.4, 1e-3), &GrainSize::new(3, 5e-4), 0.0);
        assert!(at_rest.is_finite());
    }

    #[test]
    fn as_a_resistance_it_has_the_loss_of_its_drag() {
        use crate::drag::testing::gradient;
        use crate::resistance::ResistanceFormula as _;
        let liquid = Liquid {
            density: 1000.0,
            viscosity: 1e-3,
        };
        for eps in [0.35, 0.5, 0.9] {
            for speed in [1e-7, 1e-3, 0.03, 2.0] {
                let loss = gradient(&DiFelice, &bed(eps, 1e-3), 1e-3, speed);
                let found = DiFelice.permeability(eps, 1e-3, liquid, loss) * loss / 1e-3;
                assert!((found / speed - 1.0).abs() < 1e-10, "{eps} {speed} {found}");
            }
        }
    }

    #[test]
    fn is_a_known_multiple_of_stokes_at_rest() {
        // Drag over 3 pi mu d U at Re -> 0: 47.1 at 0.35, 28.7 at 0.40 (with (4.8)^2/24 = 0.96 of Stokes).
        let grain = GrainSize::new(3, 5e-4);
        for (eps, factor) in [(0.35, 47.1), (0.40, 28.7), (0.45, 18.6)] {
            let f = DiFelice.coefficient(&bed(eps, 1e-3), &grain, 1e-12);
            let stokes = 3.0 * std::f64::consts::PI * 1e-3 * 1e-3;
            assert!((f / stokes / factor - 1.0).abs() < 0.012, "{}", f / stokes);
        }
    }
}
