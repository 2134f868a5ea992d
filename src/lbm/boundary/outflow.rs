//! Outflow: the entering populations are those of the next cell upstream (zero gradient along the normal).
//!
//! The rule is of first order. The pressure floats, or its mean is imposed. It is the convective outflow with an
//! infinite velocity ([`super::convective_outflow`]), and reflects waves less than an imposed pressure.

use super::convective_outflow::{Carried, ConvectiveOutflowLinks, none_imposes_pressure};
use super::{BoundaryKind, BoundaryModel, Opening, Place, Rule};
use crate::lanes::Stored;
use base::error::Error;
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Free outflow: zero gradient along the normal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Outflow {
    /// Mean pressure over the face above the reference \[Pa\]. Default: 0 if no opening imposes a pressure; otherwise
    /// the flow determines the pressure.
    #[serde(default)]
    pub mean_pressure: Option<f64>,
}

impl BoundaryModel for Outflow {
    fn kind(&self) -> BoundaryKind {
        BoundaryKind::OUTFLOW
    }

    fn pressure_floats(&self) -> bool {
        true
    }

    fn holds_pressure(&self, openings: &[Opening]) -> bool {
        self.mean_pressure.is_some() || none_imposes_pressure(openings)
    }

    fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let links =
            ConvectiveOutflowLinks::from_case(place, Carried::Whole, self.mean_pressure, units);
        Ok(Box::new(links))
    }
}
