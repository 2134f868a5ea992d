//! Target accuracy of a run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Accuracy level or target error of fluid forces; in seepage without grains of the answers of probes and summary, and
/// below a free surface of those of probes.
/// Each level is based on measured errors; `solver plan` names the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// Forces within 10 %, for first estimates.
    Draft,
    /// Forces within 5 %.
    #[default]
    Normal,
    /// Forces within 2 %.
    Reference,
    /// Target relative error of forces [1].
    DragError(#[schemars(range(min = 0.002, max = 0.5))] f64),
}

impl Accuracy {
    /// Returns the target of the largest relative error of a force.
    #[must_use]
    pub fn target(self) -> f64 {
        match self {
            Self::Draft => 0.1,
            Self::Normal => 0.05,
            Self::Reference => 0.02,
            Self::DragError(target) => target,
        }
    }

    /// Returns the name of the level in a case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Normal => "normal",
            Self::Reference => "reference",
            Self::DragError(_) => "drag_error",
        }
    }
}
