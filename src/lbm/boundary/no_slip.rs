//! A stationary wall: half-way bounce-back ([`super::wall`]).

use super::{BoundaryKind, BoundaryModel, Crossing, Giver, Place, Rule};
use crate::lanes::Stored;
use base::error::Error;
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stationary wall: half-way bounce-back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct NoSlip {}

impl BoundaryModel for NoSlip {
    fn kind(&self) -> BoundaryKind {
        BoundaryKind::WALL
    }

    fn rule<S: Stored>(&self, _: &Place<'_>, _: &LatticeUnits) -> Result<Box<dyn Rule<S>>, Error> {
        Ok(Box::new(NoSlipLinks))
    }
}

/// Rule of a stationary no-slip wall.
pub struct NoSlipLinks;

impl<S: Stored> Rule<S> for NoSlipLinks {
    fn kind(&self) -> BoundaryKind {
        BoundaryKind::WALL
    }

    fn take(&mut self, _: &Crossing<'_, S>) -> Giver {
        Giver::Wall { term: 0.0 }
    }

    fn is_wall(&self) -> bool {
        true
    }

    fn velocity(&self, _: [f64; 3]) -> Option<[f64; 3]> {
        Some([0.0; 3])
    }
}
