//! Drag of a single grain after Dallavalle.
//!
//! ```text
//! f = C_d rho A |U| U / 2,   C_d = (0.63 + 4.8/sqrt(Re))^2,   Re = rho d |U|/mu
//! ```
//!
//! (J. M. DallaValle, Micromeritics, 1948.) `C_d |U|` is computed as one expression, so that it is finite at zero
//! speed.

use super::{BedConditions, DragFormula, GrainSize};

/// Drag law of Dallavalle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dallavalle;

impl DragFormula for Dallavalle {
    fn summary() -> &'static str {
        "Dallavalle 1948: a single grain without neighbours."
    }

    fn description(&self) -> String {
        "Dallavalle".into()
    }

    fn coefficient(&self, bed: &BedConditions, grain: &GrainSize, speed: f64) -> f64 {
        let root =
            0.63 * speed.sqrt() + 4.8 * (bed.viscosity / (bed.density * grain.diameter)).sqrt();
        0.5 * bed.density * grain.area * root * root
    }
}

/// Returns the drag coefficient C_d.
#[must_use]
pub fn drag_coefficient(reynolds: f64) -> f64 {
    (0.63 + 4.8 / reynolds.sqrt()).powi(2)
}
