//! Rule of Sellmeijer et al. (2011) for the critical head of a dike on a homogeneous layer of sand.
//!
//! ```text
//! H_c = L F_r F_s F_g
//! F_r = eta (rho_s/rho - 1) tan(theta)
//! F_s = d70/(kappa L)^(1/3) (d70m/d70)^0.6,    d70m = 2.08e-4 m
//! F_g = 0.91 (D/L)^(0.28/((D/L)^2.8 - 1) + 0.04)
//! ```
//!
//! L is the length of the seepage, D the thickness of the layer, kappa its permeability. F_g is an approximation of
//! computed results for a standard dike; at D = L it has the limit 0.91 exp(0.1). The exponent 0.6 is a regression over
//! small tests (d70 from 0.15 to 0.43 mm). The factors of relative density, uniformity and roundness of the paper are
//! left out, as in its use for design.

use super::BottomGrains;

/// Mean d70 of the tests of the rule \[m\].
pub const MEAN_DIAMETER: f64 = 2.08e-4;
/// Exponent of the diameter in the rule: one minus 0.6.
const EXPONENT: f64 = 0.4;
/// Range of d70 of the tests \[m\].
pub const TESTED: [f64; 2] = [1.5e-4, 4.3e-4];

/// Returns the diameter whose limit of equilibrium has the dependence on d70 of the rule \[m\].
#[must_use]
pub fn effective_diameter(d70: f64) -> f64 {
    MEAN_DIAMETER * (d70 / MEAN_DIAMETER).powf(EXPONENT)
}

/// Returns the factor of the geometry, of the ratio of thickness to length of the seepage.
#[must_use]
pub fn geometry(ratio: f64) -> f64 {
    // (x^2.8 - 1)/ln(x) tends to 2.8 at x = 1.
    let log = ratio.ln();
    let power = (2.8 * log).exp_m1();
    let near = if log.abs() < 1e-12 {
        0.28 / 2.8
    } else {
        0.28 * log / power
    };
    0.91 * (near + 0.04 * log).exp()
}

/// Dike on a homogeneous layer of sand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dike {
    /// Length of the seepage \[m\].
    pub length: f64,
    /// Thickness of the layer \[m\].
    pub thickness: f64,
    /// Permeability of the layer \[m2\].
    pub permeability: f64,
}

/// Returns the critical head of the rule as published \[m\], for a sand of this d70 \[m\]. The diameter of `grains`,
/// which the equilibrium of the case has, does not enter it.
#[must_use]
pub fn critical_head(d70: f64, grains: &BottomGrains, dike: &Dike) -> f64 {
    let diameter = effective_diameter(d70);
    let grains = BottomGrains {
        diameter,
        ..*grains
    };
    head_of_equilibrium(&grains, dike)
}

/// Returns the head of the rule without its regression of d70 \[m\]: the diameter in F_s is that of `grains`, as in the
/// equilibrium at the bottom of a pipe.
#[must_use]
pub fn head_of_equilibrium(grains: &BottomGrains, dike: &Dike) -> f64 {
    let Dike {
        length,
        thickness,
        permeability,
    } = *dike;
    let resistance = grains.white * (grains.relative_density - 1.0) * grains.bedding_angle.tan();
    let scale = grains.diameter / (permeability * length).cbrt();
    length * resistance * scale * geometry(thickness / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Returns grains of quartz in water with the angle and the coefficient of the rule.
    fn quartz(diameter: f64) -> BottomGrains {
        BottomGrains {
            diameter,
            relative_density: 2.65,
            white: 0.25,
            bedding_angle: 37_f64.to_radians(),
        }
    }

    /// Values computed apart from this program by the printed formula: H_c/L of small and medium tests.
    #[test]
    fn heads_of_four_tests_by_the_printed_formula() {
        for (length, thickness, d70, permeability, slope) in [
            (0.30, 0.10, 2.0e-4, 1.5e-11, 0.464),
            (0.34, 0.101, 1.54e-4, 8e-12, 0.506),
            (0.30, 0.10, 4.0e-4, 6e-11, 0.385),
            (1.45, 0.40, 2.0e-4, 1.5e-11, 0.286),
        ] {
            let dike = Dike {
                length,
                thickness,
                permeability,
            };
            // The rule has its own dependence on d70, whatever the diameter of the equilibrium is.
            for diameter in [d70, effective_diameter(d70)] {
                let head = critical_head(d70, &quartz(diameter), &dike);
                assert_relative_eq!(head / length, slope, max_relative = 2e-3);
            }
        }
    }

    /// Rows of the validation of a finite-element program of the same model, without the exponent of the diameter.
    #[test]
    fn heads_of_published_large_cases() {
        for (length, thickness, head) in [
            (30.0, 10.0, 10.29),
            (60.0, 10.0, 19.1),
            (90.0, 10.0, 27.54),
            (60.0, 20.0, 16.33),
            (90.0, 30.0, 21.40),
        ] {
            let dike = Dike {
                length,
                thickness,
                permeability: 1.157e-12,
            };
            let rule = head_of_equilibrium(&quartz(3e-4), &dike);
            assert_relative_eq!(rule, head, max_relative = 2e-2);
        }
    }

    #[test]
    fn geometry_has_its_limit_where_thickness_and_length_are_equal() {
        let limit = 0.91 * 0.1_f64.exp();
        assert_relative_eq!(geometry(1.0), limit, max_relative = 1e-14);
        for side in [1.0 - 1e-7, 1.0 + 1e-7] {
            assert_relative_eq!(geometry(side), limit, max_relative = 1e-6);
        }
    }
}
