//! Wall-adapting local eddy viscosity (F. Nicoud, F. Ducros, Flow Turbul. Combust. 62 (1999) 183, equation 13):
//!
//! ν_t = (C_w Δ)² (S^d:S^d)^{3/2} / [ (S:S)^{5/2} + (S^d:S^d)^{5/4} ]
//!
//! with g_ab = ∂u_a/∂x_b, S = (g + gᵀ)/2, S^d = (g² + (g²)ᵀ)/2 - tr(g²)/3 I and Δ one cell. It vanishes in
//! pure shear, grows with the cube of the distance from a wall, and is (2/3)^¼ (C_w Δ)² Ω in a rotation with
//! angular velocity Ω.

use super::{REASON, TurbulenceModel, strain_squared};
use crate::lanes::Lanes;
use crate::lattice::unroll;
use base::error::{Finding, Remedy, Severity};
use base::family::Description;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// Wall-adapting local eddy viscosity (Nicoud and Ducros 1999), which vanishes in laminar shear and at walls. 3-D only.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Wale {
    /// Model constant C_w \[1\]: from 0.325 in channels to 0.5 (Nicoud and Ducros 1999).
    #[serde(default = "one_half")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub constant: f64,
}

fn one_half() -> f64 {
    0.5
}

/// Returns the contraction S^d:S^d.
#[inline(always)]
fn deviator_squared<N: Lanes>(g: &[[N; 3]; 3]) -> N {
    let mut square = [[N::splat(0.0); 3]; 3];
    unroll!(axes a < 3 => {
        unroll!(axes b < 3 => {
            square[a][b] = g[a][0].mul_add(g[0][b], g[a][1].mul_add(g[1][b], g[a][2] * g[2][b]));
        });
    });
    let third = (square[0][0] + square[1][1] + square[2][2]) * N::splat(1.0 / 3.0);
    unroll!(axes a < 3 => {
        square[a][a] = square[a][a] - third;
    });
    strain_squared(&square)
}

impl TurbulenceModel for Wale {
    fn describe(&self) -> Description {
        Description::new(format!("WALE, constant {}", self.constant), REASON)
    }

    fn check(&self, path: &str, dimension: usize) -> Option<Finding> {
        (dimension == 2).then(|| Finding {
            path: format!("{path}.wale"),
            reason:
                "WALE is a model of 3-D turbulence; in 2-D its eddy viscosity does not vanish in laminar flow"
                    .into(),
            remedy: Remedy::from("use smagorinsky, or a 3-D domain")
                .set(path, json!({"smagorinsky": {}})),
            severity: Severity::Error,
        })
    }

    #[inline(always)]
    fn fraction<N: Lanes>(&self, g: &[[N; 3]; 3]) -> (N, N) {
        let strain = strain_squared(g);
        let deviator = deviator_squared(g);
        let root = deviator.sqrt();
        // (S:S)^{5/2} + (S^d:S^d)^{5/4}; the smallest number guards 0/0 and changes nothing else.
        let denominator = (strain * strain).mul_add(strain.sqrt(), deviator * root.sqrt());
        let numerator = deviator * root * N::splat(self.constant * self.constant);
        (numerator, denominator + N::splat(1e-280))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const C: f64 = 0.325;

    fn nu(g: [[f64; 3]; 3]) -> f64 {
        Wale { constant: C }.viscosity(&g)
    }

    /// Checks that the eddy viscosity is zero at rest and in pure shear.
    #[test]
    fn nothing_in_pure_shear() {
        assert!(nu([[0.0; 3]; 3]).abs() < 1e-300);
        for (a, b) in [(0, 1), (1, 0), (1, 2), (2, 0)] {
            let mut g = [[0.0; 3]; 3];
            g[a][b] = 0.03;
            assert!(nu(g).abs() < 1e-300);
        }
    }

    /// Checks that the eddy viscosity is (2/3)^¼ (C_w Δ)² Ω in solid-body rotation.
    #[test]
    fn solid_rotation() {
        let w = 0.01;
        let g = [[0.0, -w, 0.0], [w, 0.0, 0.0], [0.0, 0.0, 0.0]];
        // g² = -w² diag(1, 1, 0): S^d = -w² diag(1/3, 1/3, -2/3), S = 0.
        let exact = (2.0_f64 / 3.0).powf(0.25) * C * C * w;
        approx::assert_relative_eq!(nu(g), exact, max_relative = 1e-12);
    }

    /// Compares a full gradient with an independent evaluation; S^d has no trace.
    #[test]
    fn the_formula_by_nalgebra() {
        let g = [
            [0.01, -0.02, 0.005],
            [0.013, 0.004, -0.007],
            [0.002, 0.011, -0.014],
        ];
        let m = nalgebra::Matrix3::<f64>::from_fn(|a, b| g[a][b]);
        let s = (m + m.transpose()) * 0.5;
        let m2 = m * m;
        let d = (m2 + m2.transpose()) * 0.5 - nalgebra::Matrix3::identity() * (m2.trace() / 3.0);
        assert!(d.trace().abs() < 1e-18);
        let (ss, dd) = (s.dot(&s), d.dot(&d));
        let exact = C * C * dd.powf(1.5) / (ss.powf(2.5) + dd.powf(1.25));
        approx::assert_relative_eq!(nu(g), exact, max_relative = 1e-12);
    }

    /// Checks that the eddy viscosity grows like y³ next to a wall, for u = a y, v = b y², w = c y with fluctuations
    /// that satisfy continuity.
    #[test]
    fn grows_with_the_cube_of_the_distance_from_a_wall() {
        // u = y (1 + x/2) α, v = -α y²/4, w = β y: no-slip, divergence-free.
        let at = |y: f64| {
            let (alpha, beta, x) = (0.02, 0.013, 0.3);
            nu([
                [0.5 * alpha * y, alpha * (1.0 + 0.5 * x), 0.0],
                [0.0, -0.5 * alpha * y, 0.0],
                [0.0, beta, 0.0],
            ])
        };
        let exponent = (at(1e-3) / at(1e-4)).log10();
        assert!((exponent - 3.0).abs() < 0.01, "{exponent}");
    }
}
