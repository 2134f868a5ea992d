//! Retention of van Genuchten with the permeability of Mualem (M. T. van Genuchten, Soil Sci. Soc. Am. J. 44 (1980)
//! 892, equations 3 and 8; Y. Mualem, Water Resour. Res. 12 (1976) 513):
//!
//! ```text
//! S_e = [1 + (alpha |psi|)^n]^(-m),     m = 1 - 1/n,     k_r = S_e^L [1 - (1 - S_e^(1/m))^m]^2,     psi < 0
//! ```
//!
//! With `u = (alpha |psi|)^n`, `1 - S_e^(1/m) = u/(1 + u)`; in this form there is no cancellation near saturation.
//! In dry soil `1 - [u/(1 + u)]^m` is computed with `expm1`.
//!
//! Near saturation `1 - k_r = 2 (alpha |psi|)^(n - 1)`. Below n = 2 the slope of `k_r` is infinite at `psi = 0`, where
//! rounding of a pressure would change `k_r`: at n = 1.1 by 3 % for a suction of 1e-15 m. The known remedy is a small
//! air-entry suction, 2 cm in T. Vogel, M. T. van Genuchten and M. Cislerova (Adv. Water Resour. 24 (2001) 133). Here
//! `k_r` is linear in `psi` at suctions below 1e-4 capillary lengths if n is below 2, and exact beyond.

use super::{Fault, NEARLY_SATURATED, ROUNDED, RetentionLaw, SoilState};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Minimum exponent n: below it the permeability decreases by more than half within a thousandth of the capillary
/// length.
const MIN_N: f64 = 1.05;
const MAX_N: f64 = 20.0;
/// Exponent n from which the slope of the permeability is finite at saturation.
const SMOOTH_N: f64 = 2.0;

/// Retention of van Genuchten (1980) with the relative permeability of Mualem (1976).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct VanGenuchten {
    /// Reciprocal of the suction head at which the soil begins to drain [1/m]: 0.5 in clay to 15 in sand.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub alpha: f64,
    /// Exponent n \[1\]: 1.1 in clay to 3 in sand.
    #[schemars(extend("minimum" = 1.05, "maximum" = 20))]
    pub n: f64,
    /// Content of water at saturation \[1\].
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub saturated_content: f64,
    /// Content of water that does not drain \[1\].
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub residual_content: f64,
    /// Exponent L of the permeability \[1\] (Mualem 1976: 0.5).
    #[serde(default = "half")]
    #[schemars(extend("minimum" = 0, "maximum" = 5))]
    pub exponent: f64,
}

fn half() -> f64 {
    0.5
}

impl RetentionLaw for VanGenuchten {
    fn summary() -> &'static str {
        "Van Genuchten (1980) with the relative permeability of Mualem (1976)."
    }

    fn description(&self) -> String {
        format!(
            "van Genuchten and Mualem, alpha {} 1/m, n {}",
            self.alpha, self.n
        )
    }

    fn state(&self, head: f64) -> SoilState {
        let drains = self.saturated_content - self.residual_content;
        let suction = -self.alpha * head;
        if suction <= 0.0 {
            return SoilState {
                content: self.saturated_content,
                ..SoilState::default()
            };
        }
        if self.n < SMOOTH_N && suction < NEARLY_SATURATED {
            return self.nearly_saturated(head);
        }
        let (n, m) = (self.n, 1.0 - 1.0 / self.n);
        let u = suction.powf(n);
        let log_saturation = -m * u.ln_1p();
        // Logarithm m ln[u/(1 + u)], and 1 minus its exponential.
        let log_blocked = -m * (1.0 / u).ln_1p();
        let blocked = log_blocked.exp();
        let passes = -log_blocked.exp_m1();
        // Derivatives of ln S_e and of ln blocked with respect to the pressure head.
        let by_saturation = m * n * self.alpha * (u / (1.0 + u)) / suction;
        let by_blocked = -m * n * self.alpha / ((1.0 + u) * suction);
        let saturation = log_saturation.exp();
        SoilState {
            content: self.residual_content + drains * saturation,
            capacity: drains * saturation * by_saturation,
            log_permeability: self.exponent * log_saturation + 2.0 * passes.ln(),
            slope: self.exponent * by_saturation - 2.0 * blocked * by_blocked / passes,
        }
    }

    fn residual_content(&self) -> f64 {
        self.residual_content
    }

    fn driest_head(&self) -> f64 {
        -(ROUNDED / (self.n - 1.0)).exp() / self.alpha
    }

    fn saturation_exponent(&self) -> f64 {
        (self.n - 1.0).min(1.0)
    }

    fn capillary_length(&self) -> f64 {
        1.0 / self.alpha
    }

    fn check(&self) -> Option<Fault> {
        if !(self.alpha > 0.0 && self.alpha.is_finite()) {
            return Some(Fault {
                path: "van_genuchten.alpha",
                reason: format!("alpha is {} 1/m; it must be positive", self.alpha),
                remedy: "state the reciprocal of the air-entry suction head in 1/m; multiply values in 1/cm by \
                         100".into(),
            });
        }
        if !(MIN_N..=MAX_N).contains(&self.n) {
            return Some(Fault {
                path: "van_genuchten.n",
                reason: format!("n is {}; it must lie between {MIN_N} and {MAX_N}", self.n),
                remedy: "use a value in this range; clay has about 1.1, sand about 3".into(),
            });
        }
        if !(0.0..=5.0).contains(&self.exponent) {
            return Some(Fault {
                path: "van_genuchten.exponent",
                reason: format!(
                    "the exponent L is {}; it must lie between 0 and 5",
                    self.exponent
                ),
                remedy: "omit it for 0.5 (Mualem 1976)".into(),
            });
        }
        contents(
            self.saturated_content,
            self.residual_content,
            [
                "van_genuchten.saturated_content",
                "van_genuchten.residual_content",
            ],
        )
    }
}

impl VanGenuchten {
    /// Returns the state at a suction below [`NEARLY_SATURATED`]: the contents of the law, and a permeability that is
    /// linear in the pressure head.
    fn nearly_saturated(&self, head: f64) -> SoilState {
        let drains = self.saturated_content - self.residual_content;
        let (n, m) = (self.n, 1.0 - 1.0 / self.n);
        let suction = -self.alpha * head;
        let u = suction.powf(n);
        let saturation = (-m * u.ln_1p()).exp();
        let edge = self.state(-NEARLY_SATURATED / self.alpha);
        let fall = -edge.log_permeability.exp_m1() / NEARLY_SATURATED;
        let log_permeability = (-fall * suction).ln_1p();
        SoilState {
            content: self.residual_content + drains * saturation,
            capacity: drains * saturation * m * n * self.alpha * (u / (1.0 + u)) / suction,
            log_permeability,
            slope: fall * self.alpha / log_permeability.exp(),
        }
    }
}

/// Returns the first content that is out of range, if any.
pub(super) fn contents(saturated: f64, residual: f64, paths: [&'static str; 2]) -> Option<Fault> {
    if !(saturated > 0.0 && saturated < 1.0) {
        return Some(Fault {
            path: paths[0],
            reason: format!("the saturated content is {saturated}; it must lie between 0 and 1"),
            remedy: "state the volume of water per volume of soil at saturation, such as 0.4"
                .into(),
        });
    }
    (!(residual >= 0.0 && residual < saturated)).then(|| Fault {
        path: paths[1],
        reason: format!(
            "the residual content is {residual}; it must lie between 0 and the saturated content {saturated}"
        ),
        remedy: "omit it for 0".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEW_MEXICO: VanGenuchten = VanGenuchten {
        alpha: 3.35,
        n: 2.0,
        saturated_content: 0.368,
        residual_content: 0.102,
        exponent: 0.5,
    };

    /// Checks the equations as printed, at n = 2: m = 1/2.
    #[test]
    fn the_equations_as_printed() {
        for head in [-0.02, -0.75, -10.0] {
            let x: f64 = 3.35 * head;
            let se = (1.0 + x * x).powf(-0.5);
            let kr = se.sqrt() * (1.0 - (1.0 - se * se).sqrt()).powi(2);
            let state = NEW_MEXICO.state(head);
            approx::assert_relative_eq!(state.content, 0.102 + 0.266 * se, max_relative = 1e-12);
            approx::assert_relative_eq!(state.log_permeability.exp(), kr, max_relative = 1e-9);
        }
    }

    #[test]
    fn very_dry_and_nearly_saturated_soil_is_finite() {
        for n in [1.05, 1.5, 2.0, 8.0, 20.0] {
            let law = VanGenuchten { n, ..NEW_MEXICO };
            for head in [-1e-300, -1e-12, -1e-3, -1.0, -1e3] {
                let state = law.state(head);
                assert!(state.log_permeability.is_finite() && state.log_permeability <= 0.0);
                assert!(
                    state.slope.is_finite() && state.capacity.is_finite(),
                    "{n} {head} {state:?}"
                );
            }
        }
    }
}
