//! Resistance after Kozeny-Carman: the pressure gradient is proportional to the flux.
//!
//! ```text
//! K = eps^3 d^2 / [180 (1 - eps)^2]
//! ```
//!
//! (P. C. Carman, Trans. Inst. Chem. Eng. 15 (1937) 150.)

use super::ResistanceFormula;
use crate::Liquid;

/// Resistance law of Kozeny and Carman.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KozenyCarman;

/// Returns K \[m2\] of a bed of porosity `eps` and mean diameter `d` \[m\].
#[must_use]
pub fn kozeny_carman(eps: f64, d: f64) -> f64 {
    let solid = 1.0 - eps;
    eps * eps * eps * d * d / (180.0 * solid * solid)
}

impl ResistanceFormula for KozenyCarman {
    fn summary() -> &'static str {
        "Kozeny-Carman: the pressure gradient is proportional to the flux."
    }

    fn description(&self) -> String {
        "Kozeny-Carman".into()
    }

    fn permeability(&self, porosity: f64, diameter: f64, _: Liquid, _: f64) -> f64 {
        kozeny_carman(porosity, diameter)
    }

    fn resistance(&self, porosity: f64, diameter: f64, liquid: Liquid, _: f64) -> f64 {
        liquid.viscosity / kozeny_carman(porosity, diameter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_table() {
        let table = include_str!("../../../tests/reference/kozeny_carman.csv");
        let mut rows = 0;
        for line in table.lines().filter(|line| !line.starts_with('#')).skip(1) {
            let row: Vec<f64> = line.split(',').map(|v| v.trim().parse().unwrap()).collect();
            assert!((kozeny_carman(row[0], row[1]) / row[2] - 1.0).abs() < 1e-8);
            rows += 1;
        }
        assert_eq!(rows, 10);
    }
}
