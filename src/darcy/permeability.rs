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

/// Kozeny and Carman's law with its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Permeability {
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

    /// K \[m2\] of a cell.
    #[must_use]
    pub fn of(&self, porosity: f64, diameter: f64) -> f64 {
        kozeny_carman(self.limited(porosity), diameter)
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
            diameter: MeanDiameter::Sauter,
            porosity_cap: 0.7,
            least_porosity: 0.05,
        };
        assert_eq!(law.of(1.0, 1e-3), kozeny_carman(0.7, 1e-3));
        assert_eq!(law.of(-0.2, 1e-3), kozeny_carman(0.05, 1e-3));
    }
}
