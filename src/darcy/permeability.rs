//! Permeability of a bed of grains from its porosity and a mean diameter (C-11).
//!
//! ```text
//! K = eps^3 d^2 / [180 (1 - eps)^2]            Kozeny-Carman
//! number:  d = sum d / N          mass:  d = sum d^4 / sum d^3          Sauter:  d = sum d^3 / sum d^2
//! ```
//!
//! The three means differ much in a wide grading; that of Sauter keeps the surface per volume, which is what the
//! derivation rests on. Empty cells (above the surface, in cavities) would conduct without bound: the porosity is
//! capped, 0.7 being usual with this model.
//!
//! Where the water is fast inertia takes its part of the pressure. Ergun's loss, with q the Darcy flux,
//!
//! ```text
//! |grad p - rho g| = A q + B q^2,   A = 150 (1 - eps)^2 mu/(eps^3 d^2),   B = 1.75 (1 - eps) rho/(eps^3 d)
//! ```
//!
//! is that of a bed whose permeability falls with the gradient (S. Ergun, Chem. Eng. Prog. 48 (1952) 89).

use super::Liquid;

/// Which mean of the diameters in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeanDiameter {
    /// Sum of cubes over sum of squares.
    Sauter,
    /// Arithmetic mean.
    Number,
    /// Mean weighted with the mass.
    Mass,
}

impl MeanDiameter {
    /// The mean is sum w d^(k+1) / sum w d^k with this k.
    #[must_use]
    pub fn power(self) -> i32 {
        match self {
            Self::Sauter => 2,
            Self::Number => 0,
            Self::Mass => 3,
        }
    }
}

/// Which law of resistance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resistance {
    /// Of Kozeny and Carman: linear.
    KozenyCarman,
    /// Of Ergun: with inertia.
    Ergun,
}

/// The permeability \[m2\] that Ergun's loss amounts to in a bed of porosity `eps` and mean diameter `d` \[m\] under a gradient
/// of the reduced pressure \[Pa/m\].
#[must_use]
pub fn ergun(eps: f64, d: f64, liquid: Liquid, gradient: f64) -> f64 {
    let solid = 1.0 - eps;
    let viscous = 150.0 * solid * solid * liquid.viscosity / (eps * eps * eps * d * d);
    let inertial = 1.75 * solid * liquid.density / (eps * eps * eps * d);
    2.0 * liquid.viscosity / (viscous + (viscous * viscous + 4.0 * inertial * gradient).sqrt())
}

/// A law of resistance with its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permeability {
    /// Which law.
    pub resistance: Resistance,
    /// Which diameter.
    pub diameter: MeanDiameter,
    /// Larger porosities count as this one.
    pub porosity_cap: f64,
    /// Smaller porosities, of overlapping grains, count as this one.
    pub least_porosity: f64,
}

/// K \[m2\] of a bed of porosity `eps` and mean diameter `d` \[m\].
#[must_use]
pub fn kozeny_carman(eps: f64, d: f64) -> f64 {
    let solid = 1.0 - eps;
    eps * eps * eps * d * d / (180.0 * solid * solid)
}

impl Permeability {
    /// The porosity that counts.
    #[must_use]
    pub fn limited(&self, porosity: f64) -> f64 {
        porosity.clamp(self.least_porosity, self.porosity_cap)
    }

    /// K \[m2\] of a cell under a gradient of the reduced pressure \[Pa/m\].
    #[must_use]
    pub fn of(&self, porosity: f64, diameter: f64, liquid: Liquid, gradient: f64) -> f64 {
        let eps = self.limited(porosity);
        match self.resistance {
            Resistance::KozenyCarman => kozeny_carman(eps, diameter),
            Resistance::Ergun => ergun(eps, diameter, liquid, gradient),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_table() {
        let table = include_str!("../../tests/reference/kozeny_carman.csv");
        let mut rows = 0;
        for line in table.lines().filter(|line| !line.starts_with('#')).skip(1) {
            let row: Vec<f64> = line.split(',').map(|v| v.trim().parse().unwrap()).collect();
            assert!((kozeny_carman(row[0], row[1]) / row[2] - 1.0).abs() < 1e-8);
            rows += 1;
        }
        assert_eq!(rows, 10);
    }

    #[test]
    fn the_cap_holds() {
        let law = Permeability {
            resistance: Resistance::KozenyCarman,
            diameter: MeanDiameter::Sauter,
            porosity_cap: 0.7,
            least_porosity: 0.05,
        };
        let of = |eps| law.of(eps, 1e-3, WATER, 1e4);
        assert_eq!(of(1.0), kozeny_carman(0.7, 1e-3));
        assert_eq!(of(-0.2), kozeny_carman(0.05, 1e-3));
    }

    const WATER: Liquid = Liquid {
        density: 1000.0,
        viscosity: 1e-3,
    };

    #[test]
    fn the_permeability_under_a_gradient_has_ergun_s_loss() {
        let (eps, d) = (0.42_f64, 2e-3);
        let a = 150.0 * (1.0 - eps).powi(2) * 1e-3 / (eps.powi(3) * d * d);
        let b = 1.75 * (1.0 - eps) * 1000.0 / (eps.powi(3) * d);
        for q in [0.0, 1e-6, 1e-3, 0.1, 3.0] {
            let gradient = a * q + b * q * q;
            let k = ergun(eps, d, WATER, gradient);
            assert!((k * gradient / 1e-3 - q).abs() <= 1e-12 * q);
        }
        // At rest it is that of Kozeny and Carman with 150 for 180.
        assert!((ergun(eps, d, WATER, 0.0) / kozeny_carman(eps, d) - 1.2).abs() < 1e-12);
    }
}
