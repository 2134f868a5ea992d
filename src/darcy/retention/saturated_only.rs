//! Flow below the phreatic surface only: the limit of a soil without suction.
//!
//! ```text
//! k_r = max[exp(psi/h), e_min]     psi < 0
//! ```
//!
//! Gardner's permeability with a capillary length `h` far below a cell, and a minimum `e_min` that keeps the dry
//! soil in the system of equations. The discharge of a rectangular dam between h1 and h2 over L is that of A.
//! Dupuit and I. A. Charny up to a part of order `h` over the height. Nothing is stored above the phreatic surface:
//! the model is for steady flow.

use super::{Fault, RetentionLaw, SoilState};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Natural logarithm of the relative permeability of dry soil, 1e-8.
const LOG_DRY_PERMEABILITY: f64 = -18.420_680_743_952_367;
/// Capillary length if neither the case nor the grid determines one \[m\].
const DEFAULT_CAPILLARY_LENGTH: f64 = 1e-3;

/// Flow below the phreatic surface only.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct SaturatedOnly {
    /// Height over which the permeability falls to 1/e above the phreatic surface \[m\]. Default: a tenth of the height
    /// of a cell. Less than a twentieth may not converge.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub thickness: Option<f64>,
}

impl RetentionLaw for SaturatedOnly {
    fn summary() -> &'static str {
        "Flow below the phreatic surface only, without suction. Steady flow only."
    }

    fn description(&self) -> String {
        format!(
            "saturated only, phreatic surface {} m thick",
            self.capillary_length()
        )
    }

    fn state(&self, head: f64) -> SoilState {
        let log_permeability = head / self.capillary_length();
        if head >= 0.0 {
            SoilState::default()
        } else if log_permeability > LOG_DRY_PERMEABILITY {
            SoilState {
                log_permeability,
                slope: 1.0 / self.capillary_length(),
                ..SoilState::default()
            }
        } else {
            SoilState {
                log_permeability: LOG_DRY_PERMEABILITY,
                ..SoilState::default()
            }
        }
    }

    fn potential(&self, head: f64, power: f64) -> Option<f64> {
        let length = self.capillary_length() / power;
        let driest = LOG_DRY_PERMEABILITY * self.capillary_length();
        let least = (LOG_DRY_PERMEABILITY * power).exp();
        let falls = (head.clamp(driest, 0.0) / length).exp() * length;
        Some(head.max(0.0) + falls + least * (head - driest).min(0.0))
    }

    fn saturation(&self, head: f64) -> f64 {
        if head >= 0.0 { 1.0 } else { 0.0 }
    }

    fn capillary_length(&self) -> f64 {
        self.thickness.unwrap_or(DEFAULT_CAPILLARY_LENGTH)
    }

    fn stores(&self) -> bool {
        false
    }

    fn check(&self) -> Option<Fault> {
        let thickness = self.capillary_length();
        (!(thickness > 0.0 && thickness.is_finite())).then(|| Fault {
            path: "saturated_only.thickness",
            reason: format!("the thickness is {thickness} m; it must be positive"),
            remedy: "omit it for a tenth of the height of a cell".into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRY_PERMEABILITY: f64 = 1e-8;

    #[test]
    fn the_least_permeability_is_where_it_is_stated() {
        assert!((DRY_PERMEABILITY.ln() / LOG_DRY_PERMEABILITY - 1.0).abs() < 1e-15);
        let law = SaturatedOnly { thickness: None };
        let dry = law.state(-1.0);
        assert!((dry.log_permeability.exp() / DRY_PERMEABILITY - 1.0).abs() < 1e-12);
        assert_eq!(law.state(0.5), SoilState::default());
    }
}
