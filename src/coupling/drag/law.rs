//! The drag laws, chosen once.

use super::{dallavalle, di_felice, gidaspow, kozeny_carman};

/// The water and the bed round a grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bed {
    /// Density of the water \[kg/m3\].
    pub density: f64,
    /// Dynamic viscosity \[Pa s\].
    pub viscosity: f64,
    /// Porosity, within the limits of the permeability.
    pub porosity: f64,
    /// Volume of grains per volume inside the walls, as it is.
    pub solid: f64,
    /// Permeability \[m2\].
    pub permeability: f64,
}

/// A grain as the water sees it; in 2-D per metre of depth.
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

/// Which drag law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DragLaw {
    /// [`di_felice`].
    DiFelice,
    /// [`gidaspow`].
    Gidaspow,
    /// [`dallavalle`].
    Dallavalle,
    /// [`kozeny_carman`].
    KozenyCarman,
}

impl DragLaw {
    /// Force over superficial velocity \[kg/s\] at superficial speed `speed` \[m/s\].
    #[must_use]
    #[inline]
    pub fn coefficient(self, bed: &Bed, grain: &Grain, speed: f64) -> f64 {
        match self {
            Self::DiFelice => di_felice::coefficient(bed, grain, speed),
            Self::Gidaspow => gidaspow::coefficient(bed, grain, speed),
            Self::Dallavalle => dallavalle::coefficient(bed, grain, speed),
            Self::KozenyCarman => kozeny_carman::coefficient(bed, grain),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::darcy::permeability::kozeny_carman as permeability;

    fn bed(porosity: f64, viscosity: f64) -> Bed {
        Bed {
            density: 1000.0,
            viscosity,
            porosity,
            solid: 1.0 - porosity,
            permeability: permeability(porosity, 1e-3),
        }
    }

    #[test]
    fn di_felice_agrees_with_the_table() {
        let table = include_str!("../../../tests/reference/di_felice.csv");
        let mut rows = 0;
        for line in table.lines().skip(2) {
            let row: Vec<f64> = line.split(',').map(|v| v.trim().parse().unwrap()).collect();
            let (reynolds, chi, drag) = (row[0], row[1], row[2]);
            assert!((di_felice::exponent(reynolds) - chi).abs() < 1e-8);
            assert!((dallavalle::drag_coefficient(reynolds) / drag - 1.0).abs() < 1e-8);
            let grain = Grain::new(3, 5e-4);
            let speed = reynolds * 1e-3 / (1000.0 * 1e-3);
            for (eps, factor) in [0.35, 0.4, 0.5, 0.8].into_iter().zip(&row[5..]) {
                let force = di_felice::coefficient(&bed(eps, 1e-3), &grain, speed) * speed;
                let single = 0.5 * drag * 1000.0 * grain.area * speed * speed;
                // The table has six decimals, and its drag coefficient nine digits.
                assert!((force / single - factor).abs() < 5.1e-7 + 1e-8 * factor);
            }
            rows += 1;
        }
        assert_eq!(rows, 6);
        assert!((di_felice::exponent(10.0_f64.powf(1.5)) - 3.05).abs() < 1e-14);
        assert!(di_felice::coefficient(&bed(0.4, 1e-3), &Grain::new(3, 5e-4), 0.0).is_finite());
    }

    /// Loss of pressure in a bed at rest from the sum of drags: eps |grad p| = n f.
    fn gradient(law: DragLaw, bed: &Bed, d: f64, speed: f64) -> f64 {
        let grain = Grain::new(3, 0.5 * d);
        let per_volume = bed.solid / grain.volume;
        per_volume * law.coefficient(bed, &grain, speed) * speed / bed.porosity
    }

    #[test]
    fn gidaspow_has_the_loss_of_ergun_and_lifts_at_its_velocity() {
        let (eps, d, mu, rho) = (0.42_f64, 1e-3, 1e-3, 1000.0);
        let a = 150.0 * (1.0 - eps) * (1.0 - eps) * mu / (eps.powi(3) * d * d);
        let b = 1.75 * (1.0 - eps) * rho / (eps.powi(3) * d);
        for speed in [1e-5, 1e-3, 1e-2, 0.3] {
            let loss = gradient(DragLaw::Gidaspow, &bed(eps, mu), d, speed);
            assert!((loss / (a * speed + b * speed * speed) - 1.0).abs() < 1e-12);
        }
        // Minimum fluidisation: the loss bears the buoyant weight.
        let weight = (1.0 - eps) * 1650.0 * 9.81;
        let lifts = (-a + (a * a + 4.0 * b * weight).sqrt()) / (2.0 * b);
        let grain = Grain::new(3, 0.5 * d);
        let bed = bed(eps, mu);
        let drag = DragLaw::Gidaspow.coefficient(&bed, &grain, lifts) * lifts;
        // Drag and the gradient of the reduced pressure carry a grain.
        let total = drag + grain.volume * gradient(DragLaw::Gidaspow, &bed, d, lifts);
        assert!((total / (grain.volume * 1650.0 * 9.81) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_consistent_drag_has_the_loss_of_darcy() {
        let bed = bed(0.37, 0.1);
        let loss = gradient(DragLaw::KozenyCarman, &bed, 1e-3, 2e-4);
        assert!((loss / (0.1 * 2e-4 / bed.permeability) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_law_is_di_felices_share_of_stokes_at_rest() {
        // Over 3 pi mu d U at Re -> 0: 47.1 at 0.35, 28.7 at 0.40 (with (4.8)^2/24 = 0.96 of Stokes).
        let grain = Grain::new(3, 5e-4);
        for (eps, factor) in [(0.35, 47.1), (0.40, 28.7), (0.45, 18.6)] {
            let f = di_felice::coefficient(&bed(eps, 1e-3), &grain, 1e-12);
            let stokes = 3.0 * std::f64::consts::PI * 1e-3 * 1e-3;
            assert!((f / stokes / factor - 1.0).abs() < 0.012, "{}", f / stokes);
        }
    }
}
