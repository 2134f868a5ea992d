//! Exponential soil of Gardner (W. R. Gardner, Soil Sci. 85 (1958) 228):
//!
//! ```text
//! k_r = S_e = exp(alpha psi)     psi < 0
//! ```
//!
//! The content follows the permeability, as in the solutions of R. Srivastava and T.-C. J. Yeh (Water Resour. Res. 27
//! (1991) 753), in which the equation of Richards is linear in `k_r`.

use super::van_genuchten::contents;
use super::{Fault, ROUNDED, RetentionLaw, SoilState};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Exponential permeability and content (Gardner 1958).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Gardner {
    /// Reciprocal of the capillary length [1/m]: 1 in clay to 30 in coarse sand.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub alpha: f64,
    /// Content of water at saturation \[1\].
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub saturated_content: f64,
    /// Content of water that does not drain \[1\].
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 1))]
    pub residual_content: f64,
}

impl RetentionLaw for Gardner {
    fn summary() -> &'static str {
        "Gardner (1958): permeability and content fall exponentially with the suction."
    }

    fn description(&self) -> String {
        format!("Gardner, alpha {} 1/m", self.alpha)
    }

    fn state(&self, head: f64) -> SoilState {
        if head >= 0.0 {
            return SoilState {
                content: self.saturated_content,
                ..SoilState::default()
            };
        }
        let log_permeability = self.alpha * head;
        let drains = (self.saturated_content - self.residual_content) * log_permeability.exp();
        SoilState {
            content: self.residual_content + drains,
            capacity: self.alpha * drains,
            log_permeability,
            slope: self.alpha,
        }
    }

    fn potential(&self, head: f64, power: f64) -> Option<f64> {
        let alpha = power * self.alpha;
        Some((alpha * head.min(0.0)).exp() / alpha + head.max(0.0))
    }

    fn residual_content(&self) -> f64 {
        self.residual_content
    }

    fn capillary_length(&self) -> f64 {
        1.0 / self.alpha
    }

    fn driest_head(&self) -> f64 {
        -ROUNDED / self.alpha
    }

    fn check(&self) -> Option<Fault> {
        if !(self.alpha > 0.0 && self.alpha.is_finite()) {
            return Some(Fault {
                path: "gardner.alpha",
                reason: format!("alpha is {} 1/m; it must be positive", self.alpha),
                remedy: "state the reciprocal of the capillary length in 1/m".into(),
            });
        }
        contents(
            self.saturated_content,
            self.residual_content,
            ["gardner.saturated_content", "gardner.residual_content"],
        )
    }
}
