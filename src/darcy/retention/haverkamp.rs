//! Retention and permeability as rational functions of the suction (R. Haverkamp, M. Vauclin, J. Touma, P. J. Wierenga
//! and G. Vachaud, Soil Sci. Soc. Am. J. 41 (1977) 285, equations 6 and 7; the permeability is that of W. R. Gardner):
//!
//! ```text
//! S_e = 1/[1 + (|psi|/a)^b],     k_r = 1/[1 + (|psi|/c)^d],     psi < 0
//! ```
//!
//! The parameter a of publications that print `A/(A + |psi|^b)` is `A^(1/b)`.

use super::{Fault, ROUNDED, RetentionLaw, SoilState, van_genuchten};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rational retention and permeability of Haverkamp and others (1977).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Haverkamp {
    /// Suction head a at which half of the water has drained \[m\].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub content_head: f64,
    /// Exponent b of the content \[1\].
    #[schemars(extend("minimum" = 1, "maximum" = 20))]
    pub content_exponent: f64,
    /// Suction head c at which the permeability is half of that at saturation \[m\].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub permeability_head: f64,
    /// Exponent d of the permeability \[1\].
    #[schemars(extend("minimum" = 1, "maximum" = 20))]
    pub permeability_exponent: f64,
    /// Content of water at saturation \[1\].
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub saturated_content: f64,
    /// Content of water that does not drain \[1\].
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub residual_content: f64,
}

/// Returns ln[1 + (suction/scale)^exponent], and its derivative with respect to the suction \[1/m\].
fn fall(suction: f64, scale: f64, exponent: f64) -> (f64, f64) {
    let log = exponent * (suction / scale).ln();
    // Far from saturation the 1 is below rounding.
    let sum = if log > 40.0 { log } else { log.exp().ln_1p() };
    (sum, exponent / suction / (1.0 + (-log).exp()))
}

impl RetentionLaw for Haverkamp {
    fn summary() -> &'static str {
        "Rational functions of the suction (Haverkamp and others 1977)."
    }

    fn description(&self) -> String {
        format!(
            "Haverkamp, half drained at {} m of suction, half the permeability at {} m",
            self.content_head, self.permeability_head
        )
    }

    fn state(&self, head: f64) -> SoilState {
        if head >= -f64::MIN_POSITIVE {
            return SoilState {
                content: self.saturated_content,
                ..SoilState::default()
            };
        }
        let (drained, by_drained) = fall(-head, self.content_head, self.content_exponent);
        let (tight, by_tight) = fall(-head, self.permeability_head, self.permeability_exponent);
        let water = (self.saturated_content - self.residual_content) * (-drained).exp();
        SoilState {
            content: self.residual_content + water,
            capacity: water * by_drained,
            log_permeability: -tight,
            slope: by_tight,
        }
    }

    fn residual_content(&self) -> f64 {
        self.residual_content
    }

    fn driest_head(&self) -> f64 {
        -self.content_head * (ROUNDED / self.content_exponent).exp()
    }

    fn capillary_length(&self) -> f64 {
        self.permeability_head
    }

    fn check(&self) -> Option<Fault> {
        for (path, value, least, most) in [
            ("haverkamp.content_head", self.content_head, 1e-6, 1e4),
            (
                "haverkamp.content_exponent",
                self.content_exponent,
                1.0,
                20.0,
            ),
            (
                "haverkamp.permeability_head",
                self.permeability_head,
                1e-6,
                1e4,
            ),
            (
                "haverkamp.permeability_exponent",
                self.permeability_exponent,
                1.0,
                20.0,
            ),
        ] {
            if !(least..=most).contains(&value) {
                return Some(Fault {
                    path,
                    reason: format!("this is {value}; it must lie between {least} and {most}"),
                    remedy: "state the head in m: for a published A/(A + |psi|^b) it is A^(1/b)"
                        .into(),
                });
            }
        }
        van_genuchten::contents(
            self.saturated_content,
            self.residual_content,
            ["haverkamp.saturated_content", "haverkamp.residual_content"],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the sand of Vauclin, Khanji and Vachaud (1979), with the equations as printed, in cm.
    #[test]
    fn the_equations_as_printed() {
        let law = Haverkamp {
            content_head: 0.01 * 40000.0_f64.powf(1.0 / 2.9),
            content_exponent: 2.9,
            permeability_head: 0.01 * 2.99e6_f64.powf(0.2),
            permeability_exponent: 5.0,
            saturated_content: 0.3,
            residual_content: 0.0,
        };
        for h in [0.5_f64, 20.98, 80.0, 1000.0] {
            let state = law.state(-0.01 * h);
            let content = 0.3 * 40000.0 / (40000.0 + h.powf(2.9));
            let permeability = 2.99e6 / (2.99e6 + h.powi(5));
            approx::assert_relative_eq!(state.content, content, max_relative = 1e-12);
            approx::assert_relative_eq!(
                state.log_permeability.exp(),
                permeability,
                max_relative = 1e-12
            );
        }
        for head in [-1e-300, -1e-12, -1e5] {
            let state = law.state(head);
            assert!(state.log_permeability.is_finite() && state.slope.is_finite());
            assert!(state.capacity.is_finite());
        }
    }
}
