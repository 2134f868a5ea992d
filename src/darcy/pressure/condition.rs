//! Boundary conditions of the seepage on faces of the grid and on drains in the ground.
//!
//! They are separate from the solver because cases state them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};

/// Boundary condition of the seepage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(rename = "SeepageCondition")]
pub enum Condition {
    /// Imposed pressure.
    Pressure {
        /// Pressure \[Pa\].
        value: f64,
    },
    /// Imposed hydraulic head: p/(rho g) + elevation above the origin.
    Head {
        /// Head \[m\].
        value: f64,
    },
    /// Imposed flux through the face.
    Flux {
        /// Volume per area and time into the grid [m/s].
        value: f64,
    },
    /// Rainfall on the face.
    Rain {
        /// Volume per horizontal area and time [m/s].
        #[schemars(range(min = 0.0))]
        rate: f64,
    },
    /// Contact with air, where water leaves at atmospheric pressure and none enters; below a water level, its
    /// hydrostatic pressure. Needs `unsaturated`.
    SeepageFace {
        /// Head of the water in front of the lower part \[m\]. Default: air everywhere.
        #[serde(default)]
        level: Option<f64>,
    },
    /// Total discharge, distributed by area; negative for a pumping well.
    Discharge {
        /// Volume per time into the ground [m3/s; in 2-D m2/s].
        value: f64,
    },
    /// Evaporation from the face: at the stated rate while the suction is below the limit, afterwards at the
    /// limiting suction with a lower rate. Needs `unsaturated`.
    Evaporation {
        /// Volume per horizontal area and time [m/s].
        #[schemars(range(min = 0.0))]
        rate: f64,
        /// Largest suction of the surface as a height of water \[m\]: 10 to 150 for bare soil.
        #[schemars(extend("exclusiveMinimum" = 0))]
        suction: f64,
    },
    /// Impermeable.
    NoFlow {},
}

impl Display for Condition {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pressure { value } => write!(f, "pressure {value} Pa"),
            Self::Head { value } => write!(f, "head {value} m"),
            Self::Flux { value } => write!(f, "flux {value} m/s"),
            Self::Rain { rate } => write!(f, "rain {rate} m/s"),
            Self::SeepageFace { level: None } => write!(f, "seepage face"),
            Self::SeepageFace { level: Some(level) } => {
                write!(f, "seepage face, water up to {level} m")
            }
            Self::Discharge { value } => write!(f, "discharge {value} (volume per time)"),
            Self::Evaporation { rate, suction } => {
                write!(f, "evaporation {rate} m/s, suction at most {suction} m")
            }
            Self::NoFlow {} => write!(f, "impermeable"),
        }
    }
}

impl Condition {
    /// Returns `true` if the condition determines the pressure of some water.
    #[must_use]
    pub fn holds(&self) -> bool {
        matches!(
            self,
            Self::Pressure { .. } | Self::Head { .. } | Self::SeepageFace { .. }
        )
    }

    /// Returns the volume per area and time stated by the condition \[m/s\]; none if it states no flux.
    #[must_use]
    pub fn flux(&self) -> Option<f64> {
        match self {
            Self::Flux { value } => Some(*value),
            Self::Rain { rate } => Some(*rate),
            Self::Evaporation { rate, .. } => Some(-*rate),
            _ => None,
        }
    }

    /// Sets the value of the condition: pressure, head, level, flux, discharge or rate.
    pub fn set_value(&mut self, new: f64) {
        match self {
            Self::Pressure { value }
            | Self::Head { value }
            | Self::Flux { value }
            | Self::Discharge { value } => *value = new,
            Self::Rain { rate } | Self::Evaporation { rate, .. } => *rate = new,
            Self::SeepageFace { level } => *level = Some(new),
            Self::NoFlow {} => {}
        }
    }
}
