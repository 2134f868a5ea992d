//! Error of a resistance law, by comparison with resolved flow through random beds of equal spheres.
//!
//! Lattice Boltzmann simulations of random arrays gave the drag on a sphere, F in 3 pi mu d U with the superficial
//! velocity U, at the solid fraction s, porosity n = 1 - s and Reynolds number Re = rho U d/mu, without the
//! contribution of the pressure gradient:
//!
//! ```text
//! F = 10 s/n² + n² (1 + 1.5 s^½) + 0.413 Re/(24 n²) (1/n + 3 n s + 8.4 Re^-0.343)/(1 + 10^(3 s) Re^-((1 + 4 s)/2))
//! loss of pressure = 18 s mu U F/(n d²)
//! ```
//!
//! M. A. van der Hoef, R. Beetstra and J. A. M. Kuipers, J. Fluid Mech. 528 (2005) 233-254 (creeping flow: within 3
//! %); R. Beetstra, M. A. van der Hoef and J. A. M. Kuipers, AIChE J. 53 (2007) 489-501 (up to Re = 1000 and s =
//! 0.6: 8 % in the mean). The error of a law is the deviation of its flow from the flow through these beds under
//! the same gradient, plus the error of the formula. Listed grains may form an array: for them the slow flow
//! through simple cubic arrays is compared too (A. A. Zick and G. M. Homsy, J. Fluid Mech. 115 (1982) 13-26; the
//! study `darcy-or-resolved`).

use crate::scene::Scene;
use crate::scene::findings::number;
use crate::scene::grains::{GrainSource, Grains};
use crate::scene::sample::ListedGrain;
use base::number::real;
use darcy::{Liquid, MeanDiameter};
use std::f64::consts::{FRAC_PI_6, PI};

/// Solid fractions of stable random beds: from the loosest (G. Y. Onoda and E. G. Liniger, Phys. Rev. Lett. 64
/// (1990) 2727) to the densest of the simulations.
const BED: (f64, f64) = (0.555, 0.6);
/// Solid fractions of simple cubic arrays, and the drag on a sphere in 3 pi mu d U, with the contribution of the
/// pressure gradient.
const ARRAYS: [(f64, f64); 5] = [
    (0.125, 4.292),
    (0.216, 7.442),
    (0.343, 15.4),
    (0.45, 28.1),
    (FRAC_PI_6, 42.1),
];
/// Maximum solid fraction for which the formula is used: above the 0.6 of the simulations its first term, which is
/// that of Kozeny and Carman, is 99 % of the drag.
const DENSEST: f64 = 0.65;
/// Largest Reynolds number of the simulations.
const MAX_REYNOLDS: f64 = 1000.0;
/// Maximum Reynolds number of creeping flow.
const CREEPING: f64 = 1.0;
/// Relative errors of the formula: in creeping flow, and with inertia.
const FORMULA_ERRORS: (f64, f64) = (0.03, 0.08);
/// Maximum ratio of the largest to the smallest diameter for which all mean diameters are the same.
const EQUAL: f64 = 1.02;
const TRIALS: usize = 8;

/// Returns the pressure loss \[Pa/m\] of a random bed of spheres at a superficial velocity [m/s].
fn loss(solid: f64, diameter: f64, liquid: Liquid, velocity: f64) -> f64 {
    let pores = 1.0 - solid;
    let reynolds = liquid.density * velocity * diameter / liquid.viscosity;
    let creeping = 10.0 * solid / (pores * pores) + pores * pores * (1.0 + 1.5 * solid.sqrt());
    let inertia = if reynolds > 0.0 {
        let above = 1.0 / pores + 3.0 * pores * solid + 8.4 * reynolds.powf(-0.343);
        let below = 1.0 + 10.0_f64.powf(3.0 * solid) * reynolds.powf(-0.5 * (1.0 + 4.0 * solid));
        0.413 * reynolds / (24.0 * pores * pores) * above / below
    } else {
        0.0
    };
    let drag = creeping + inertia;
    18.0 * solid * liquid.viscosity * velocity * drag / (pores * diameter * diameter)
}

/// Returns the velocity [m/s] at a pressure loss \[Pa/m\], which increases with the velocity.
fn velocity(solid: f64, diameter: f64, liquid: Liquid, gradient: f64) -> f64 {
    let of = |velocity| loss(solid, diameter, liquid, velocity);
    // Inertia makes the flow slower than creeping flow.
    let mut high = gradient / (of(1e-12) / 1e-12);
    let mut low = 0.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if of(middle) < gradient {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the pressure loss \[Pa/m\] of a simple cubic array in slow flow; none outside the known solid fractions.
fn loss_of_array(solid: f64, diameter: f64, liquid: Liquid, velocity: f64) -> Option<f64> {
    let pair = ARRAYS
        .windows(2)
        .find(|pair| (pair[0].0..=pair[1].0 * (1.0 + 1e-3)).contains(&solid))?;
    let ((a, low), (b, high)) = (pair[0], pair[1]);
    let share = (solid - a) / (b - a);
    let drag = low * (high / low).powf(share);
    Some(18.0 * solid * liquid.viscosity * velocity * drag / (diameter * diameter))
}

/// Returns the relative error of the flow through the initial bed and a description of it, or the reason why it is
/// not known.
pub(super) fn error(scene: &Scene) -> Result<(f64, String), String> {
    let unknown = "the error of the law of resistance is not known";
    let (Some(seepage), Some(grains)) = (&scene.seepage, &scene.grains) else {
        return Err(unknown.to_owned());
    };
    if seepage.zones.is_some() {
        return Err(
            "the case defines the permeabilities of zones, whose error the plan does not know"
                .to_owned(),
        );
    }
    if scene.grid.dimension == 2 {
        return Err(format!("{unknown} in beds of discs"));
    }
    let Some((low, high)) = grains.radii.map(|(low, high)| (2.0 * low, 2.0 * high)) else {
        return Err(unknown.to_owned());
    };
    let written = &seepage.written;
    if written.mean_diameter != MeanDiameter::Sauter && high > EQUAL * low {
        return Err(format!("{unknown} for diameters that are not Sauter means"));
    }
    let liquid = written.liquid();
    let (loosest, densest) = solid_fractions(grains, scene.grid.dimension);
    if loosest < ARRAYS[0].0 * (1.0 - 1e-3) || densest > DENSEST {
        return Err(format!(
            "{unknown} at the solid fraction {}",
            number(if loosest < ARRAYS[0].0 {
                loosest
            } else {
                densest
            })
        ));
    }
    let driven =
        seepage.pressure_drop(scene.gravity) / seepage.height(scene.gravity, scene.grid.dimension);
    let imposed = seepage.patches.iter();
    let imposed = imposed.filter_map(|patch| patch.condition.flux().map(f64::abs));
    let imposed = imposed.fold(0.0, f64::max);
    let resistance = written.resistance();
    let law = resistance.model();
    let (mut worst, mut fastest) = (0.0_f64, 0.0_f64);
    // For equal gradients the coarsest grains have the largest Reynolds number.
    for n in 0..=TRIALS {
        let solid = loosest + (densest - loosest) * real(n) / real(TRIALS);
        for diameter in [low, high] {
            let gradient = driven.max(loss(solid, diameter, liquid, imposed));
            let exact = velocity(solid, diameter, liquid, gradient);
            let permeability = law.permeability(1.0 - solid, diameter, liquid, gradient);
            let found = permeability * gradient / liquid.viscosity;
            if gradient > 0.0 {
                worst = worst.max((found / exact - 1.0).abs());
                fastest = fastest.max(liquid.density * exact * diameter / liquid.viscosity);
            }
        }
    }
    if let Some(loss) = loss_of_array(loosest, high, liquid, 1.0) {
        // A gradient of creeping flow.
        let slow = 1e-6 * liquid.viscosity / (liquid.density * high);
        let permeability = law.permeability(1.0 - loosest, high, liquid, loss * slow);
        worst = worst.max((permeability * loss / liquid.viscosity - 1.0).abs());
    }
    if fastest > MAX_REYNOLDS {
        return Err(format!(
            "{unknown} at the Reynolds number {}",
            number(fastest)
        ));
    }
    let formula = if fastest <= CREEPING {
        FORMULA_ERRORS.0
    } else {
        FORMULA_ERRORS.1
    };
    let text = format!(
        "{}: {} % from resolved flow through random beds and cubic arrays of spheres, solid fraction {} to {} \
         (van der Hoef et al. 2005, Beetstra et al. 2007, Zick and Homsy 1982, themselves accurate to {} %)",
        law.description(),
        number(100.0 * worst),
        number(loosest),
        number(densest),
        number(100.0 * formula)
    );
    Ok((worst + formula, text))
}

/// Returns the smallest and the largest solid fraction: for listed grains from the mean in their bounding box,
/// which a heap does not fill, upwards; otherwise those of random beds.
fn solid_fractions(grains: &Grains, dimension: usize) -> (f64, f64) {
    match &grains.source {
        GrainSource::List(list) | GrainSource::File { grains: list, .. } => {
            let filled = packed_fraction(list, dimension);
            (filled, filled.max(BED.1))
        }
        _ => BED,
    }
}

/// Returns the volume of spheres divided by that of their bounding box.
fn packed_fraction(grains: &[ListedGrain], dimension: usize) -> f64 {
    let volume: f64 = grains
        .iter()
        .map(|g| 4.0 / 3.0 * PI * g.radius.powi(3))
        .sum();
    let end = |axis: usize, sign: f64| {
        let ends = grains.iter().map(|g| sign * g.position[axis] + g.radius);
        ends.fold(f64::NEG_INFINITY, f64::max)
    };
    let edges = (0..dimension).map(|axis| end(axis, 1.0) + end(axis, -1.0));
    volume / edges.product::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darcy::resistance::ResistanceFormula;
    use darcy::resistance::ergun::Ergun;
    use darcy::resistance::kozeny_carman::KozenyCarman;

    const WATER: Liquid = Liquid {
        density: 1000.0,
        viscosity: 1e-3,
    };

    /// Checks the ratios of the laws: the first term has Kozeny and Carman's factor of 180, the second is 1 % of it
    /// at a solid fraction of 0.6, and Ergun's factor of 150 is one fifth smaller.
    #[test]
    fn laws_of_dense_creeping_beds_differ_as_their_factors() {
        let gradient = 1e-3;
        let exact = velocity(0.6, 1e-4, WATER, gradient);
        let flow = |law: &dyn ResistanceFormula| {
            law.permeability(0.4, 1e-4, WATER, gradient) * gradient / 1e-3
        };
        let rest: f64 = 1.0 + 0.16 * 0.16 * (1.0 + 1.5 * 0.6_f64.sqrt()) / 6.0;
        assert!((flow(&KozenyCarman) / exact / rest - 1.0).abs() < 1e-4);
        assert!((flow(&Ergun) / exact / (1.2 * rest) - 1.0).abs() < 1e-4);
    }

    /// Checks the permeabilities by Kozeny and Carman's law in `benches/accuracy/darcy-or-resolved`: 130, 27.3 and
    /// 3.9 % larger than those of the arrays.
    #[test]
    fn the_error_in_arrays_is_that_of_the_study() {
        for (solid, error) in [(0.125, 1.300), (0.343, 0.273), (0.45, 0.039)] {
            let loss = loss_of_array(solid, 1e-3, WATER, 1e-9).unwrap();
            let flow = KozenyCarman.permeability(1.0 - solid, 1e-3, WATER, loss) * loss / 1e-3;
            assert!((flow / 1e-9 - 1.0 - error).abs() < 2e-3, "{solid}: {flow}");
        }
        assert_eq!(loss_of_array(0.6, 1e-3, WATER, 1e-9), None);
    }

    /// Checks that random beds and simple cubic arrays have nearly equal drag at a solid fraction of 0.45: 28.1
    /// (Zick and Homsy 1982).
    #[test]
    fn random_beds_are_near_a_cubic_array_at_a_solid_fraction_of_0_45() {
        let creeping = loss(0.45, 1e-3, WATER, 1e-9);
        let array = 0.45 / (PI / 6.0 * 1e-9) * 3.0 * PI * 1e-3 * 1e-3 * 1e-9 * 28.1;
        assert!(
            (creeping / array - 1.0).abs() < 0.01,
            "{}",
            creeping / array
        );
    }

    /// Checks that at high Reynolds numbers the loss of the simulations is up to 30 % less than that of Ergun's
    /// experiments, which had rougher beds.
    #[test]
    fn inertia_is_that_of_ergun_within_30_percent() {
        for reynolds in [10.0, 100.0, 900.0] {
            let (n, d) = (0.4_f64, 1e-3);
            let u = reynolds * 1e-3 / (1000.0 * d);
            let viscous = 150.0 * 0.36 * 1e-3 * u / (n.powi(3) * d * d);
            let inertial = 1.75 * 0.6 * 1000.0 * u * u / (n.powi(3) * d);
            let ratio = loss(0.6, d, WATER, u) / (viscous + inertial);
            assert!((0.7..1.2).contains(&ratio), "{reynolds}: {ratio}");
        }
    }
}
