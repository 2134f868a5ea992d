//! Drag of Ergun in dense beds and of Wen and Yu in dilute beds, as joined by Gidaspow.
//!
//! ```text
//! f = V b (u - v)/(1 - eps),   u - v = U/eps
//! eps < 0.8:  b = 150 (1 - eps)^2 mu/(eps d^2) + 1.75 (1 - eps) rho |u - v|/d
//! else:       b = 3/4 C_d (1 - eps) rho eps |u - v| eps^-2.65/d
//!             C_d = 24/Re (1 + 0.15 Re^0.687), 0.44 from Re = 1000;  Re = rho eps |u - v| d/mu
//! ```
//!
//! `C_d` is that of L. Schiller and A. Naumann (1933) for a lone sphere. The laws of Ergun and of Wen and Yu differ
//! at a porosity of 0.8: from
//! 0.77 to 0.8 the force changes continuously from one to the other ([`dense_share`]).
//!
//! (S. Ergun, Chem. Eng. Prog. 48 (1952) 89; C. Y. Wen and Y. H. Yu 1966; D. Gidaspow, Multiphase Flow and
//! Fluidization, 1994.) The pressure gradient acts on grains and water alike, so that a stationary bed has Ergun's
//! pressure loss. The corresponding resistance law is that of Ergun below a porosity of 0.8, and
//! [`super::resistance`] with Wen and Yu's drag above.

use super::{BedConditions, DragFormula, GrainSize};
use crate::open_water::rise;
use crate::resistance::ergun::Ergun;
use crate::{Equations, Liquid, resistance};

/// Porosity up to which the drag is that of Ergun.
pub const DENSE: f64 = 0.77;
/// Porosity from which the drag is that of Wen and Yu.
pub const DILUTE: f64 = 0.8;

/// Returns the weight of Ergun's law at a porosity: 1 in a bed, 0 in dilute water.
#[must_use]
pub fn dense_share(porosity: f64) -> f64 {
    1.0 - rise((porosity - DENSE) / (DILUTE - DENSE))
}

/// Returns the force over the superficial speed by Wen and Yu \[kg/s\]; at a porosity of 1 it is that of Schiller
/// and Naumann for a single sphere.
#[must_use]
pub fn wen_yu(bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64 {
    let d = grain.diameter;
    let reynolds = bed.density * speed * d / bed.viscosity;
    // C_d times the speed, finite at zero speed.
    let drag = if reynolds < 1000.0 {
        24.0 * bed.viscosity / (bed.density * d) * (1.0 + 0.15 * reynolds.powf(0.687))
    } else {
        0.44 * speed
    };
    grain.volume * 0.75 * drag * bed.density * bed.porosity.powf(-3.65) / d
}

/// Drag law of Gidaspow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gidaspow;

impl DragFormula for Gidaspow {
    fn summary() -> &'static str {
        "Gidaspow 1994: Ergun in dense beds, Wen and Yu in dilute beds."
    }

    fn description(&self) -> String {
        "Gidaspow".into()
    }

    fn coefficient(&self, bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64 {
        let (eps, d) = (bed.porosity, grain.diameter);
        let dense = dense_share(eps);
        let mut sum = 0.0;
        if dense > 0.0 {
            let viscous = 150.0 * (1.0 - eps) * bed.viscosity / (eps * d * d);
            let inertial = 1.75 * bed.density * speed / (eps * d);
            sum += dense * grain.volume * (viscous + inertial) / eps;
        }
        if dense < 1.0 {
            sum += (1.0 - dense) * wen_yu(bed, grain, speed);
        }
        sum
    }
}

impl resistance::ResistanceFormula for Gidaspow {
    fn summary() -> &'static str {
        "Gidaspow 1994: Ergun in dense beds, Wen and Yu in dilute beds, with inertial losses. Requires the corrected \
         equations."
    }

    fn description(&self) -> String {
        "Gidaspow (Ergun; Wen and Yu from porosity 0.8 on)".into()
    }

    fn permeability(&self, porosity: f64, diameter: f64, liquid: Liquid, gradient: f64) -> f64 {
        if porosity <= DENSE {
            Ergun.permeability(porosity, diameter, liquid, gradient)
        } else {
            super::permeability(self, porosity, diameter, liquid, gradient)
        }
    }

    fn resistance(&self, porosity: f64, diameter: f64, liquid: Liquid, speed: f64) -> f64 {
        Ergun.resistance(porosity, diameter, liquid, speed)
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
    use crate::drag::testing::{bed, gradient};

    #[test]
    fn has_the_loss_of_ergun_and_lifts_at_its_velocity() {
        let (eps, d, mu, rho) = (0.42_f64, 1e-3, 1e-3, 1000.0);
        let a = 150.0 * (1.0 - eps) * (1.0 - eps) * mu / (eps.powi(3) * d * d);
        let b = 1.75 * (1.0 - eps) * rho / (eps.powi(3) * d);
        for speed in [1e-5, 1e-3, 1e-2, 0.3] {
            let loss = gradient(&Gidaspow, &bed(eps, mu), d, speed);
            assert!((loss / (a * speed + b * speed * speed) - 1.0).abs() < 1e-12);
        }
        // Minimum fluidisation: the pressure loss balances the buoyant weight.
        let weight = (1.0 - eps) * 1650.0 * 9.81;
        let lifts = (-a + (a * a + 4.0 * b * weight).sqrt()) / (2.0 * b);
        let grain = GrainSize::new(3, 0.5 * d);
        let bed = bed(eps, mu);
        let drag = Gidaspow.coefficient(&bed, &grain, lifts) * lifts;
        // Drag and the gradient of the reduced pressure together support a grain.
        let total = drag + grain.volume * gradient(&Gidaspow, &bed, d, lifts);
        assert!((total / (grain.volume * 1650.0 * 9.81) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn as_a_resistance_it_has_the_loss_of_its_drag() {
        use crate::resistance::ResistanceFormula as _;
        let (d, mu) = (1e-3, 1e-3);
        let liquid = Liquid {
            density: 1000.0,
            viscosity: mu,
        };
        for eps in [0.4, 0.6, 0.775, 0.79, 0.81, 0.95, 0.9999] {
            for speed in [0.0, 1e-9, 1e-3, 0.1, 3.0] {
                let loss = gradient(&Gidaspow, &bed(eps, mu), d, speed);
                let k = Gidaspow.permeability(eps, d, liquid, loss);
                let found = k * loss / mu;
                assert!(
                    (found - speed).abs() <= 1e-11 * speed,
                    "{eps} {speed} {found}"
                );
            }
        }
    }
}
