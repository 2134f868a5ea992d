//! Resistance after Ergun, with inertia at high flux.
//!
//! With the Darcy flux q the pressure loss is
//!
//! ```text
//! |grad p - rho g| = A q + B q^2,   A = 150 (1 - eps)^2 mu/(eps^3 d^2),   B = 1.75 (1 - eps) rho/(eps^3 d)
//! ```
//!
//! (S. Ergun, Chem. Eng. Prog. 48 (1952) 89.) The same loss expressed by a permeability that decreases with the
//! gradient:
//!
//! ```text
//! K = mu q/|grad phi| = 2 mu/[A + sqrt(A^2 + 4 B |grad phi|)]
//! ```

use super::ResistanceFormula;
use crate::{Equations, Liquid};

/// Resistance law of Ergun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ergun;

impl ResistanceFormula for Ergun {
    fn summary() -> &'static str {
        "Ergun (1952): includes inertial losses and is solved iteratively. Requires the corrected equations."
    }

    fn description(&self) -> String {
        "Ergun, solved iteratively".into()
    }

    fn permeability(&self, porosity: f64, diameter: f64, liquid: Liquid, gradient: f64) -> f64 {
        let (eps, d) = (porosity, diameter);
        let solid = 1.0 - eps;
        let viscous = 150.0 * solid * solid * liquid.viscosity / (eps * eps * eps * d * d);
        let inertial = 1.75 * solid * liquid.density / (eps * eps * eps * d);
        2.0 * liquid.viscosity / (viscous + (viscous * viscous + 4.0 * inertial * gradient).sqrt())
    }

    fn resistance(&self, porosity: f64, diameter: f64, liquid: Liquid, speed: f64) -> f64 {
        let (eps, d) = (porosity, diameter);
        let solid = 1.0 - eps;
        let viscous = 150.0 * solid * liquid.viscosity / d;
        solid / (eps * eps * eps * d) * (viscous + 1.75 * liquid.density * speed)
    }

    fn depends_on_the_gradient(&self) -> bool {
        true
    }

    /// Returns `true` for the corrected equations: those as printed use only the resistance of Kozeny and Carman.
    fn supports_equations(&self, equations: Equations) -> bool {
        equations == Equations::Corrected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resistance::kozeny_carman;

    const WATER: Liquid = Liquid {
        density: 1000.0,
        viscosity: 1e-3,
    };

    #[test]
    fn the_permeability_under_a_gradient_has_the_loss_of_ergun() {
        let (eps, d) = (0.42_f64, 2e-3);
        let a = 150.0 * (1.0 - eps).powi(2) * 1e-3 / (eps.powi(3) * d * d);
        let b = 1.75 * (1.0 - eps) * 1000.0 / (eps.powi(3) * d);
        for q in [0.0, 1e-6, 1e-3, 0.1, 3.0] {
            let gradient = a * q + b * q * q;
            let k = Ergun.permeability(eps, d, WATER, gradient);
            assert!((k * gradient / 1e-3 - q).abs() <= 1e-12 * q);
            let resistance = Ergun.resistance(eps, d, WATER, q);
            assert!((resistance * q - gradient).abs() <= 1e-12 * gradient);
        }
        // At zero flux it is the law of Kozeny and Carman with 150 in place of 180.
        let at_rest = Ergun.permeability(eps, d, WATER, 0.0);
        assert!((at_rest / kozeny_carman(eps, d) - 1.2).abs() < 1e-12);
    }
}
