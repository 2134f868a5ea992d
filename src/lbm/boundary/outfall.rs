//! Free outfall of water with a free surface: beyond the face is air ([`crate::surface::Outside::Air`]).

use super::{
    BoundaryKind, BoundaryModel, Crossing, Giver, Place, Rule, Strength, SurfaceKind, WithSurface,
};
use crate::lanes::Stored;
use crate::surface::Outside;
use base::error::Error;
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A free outfall of water with a free surface: water that reaches the face leaves as a free jet at the pressure of the
/// air, and no water returns. A subcritical stream passes through its critical depth within a few depths in front of
/// the face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Outfall {}

impl BoundaryModel for Outfall {
    fn kind(&self) -> BoundaryKind {
        BoundaryKind::OUTFLOW
    }

    fn with_surface(&self) -> WithSurface {
        WithSurface::Only
    }

    fn rule<S: Stored>(&self, _: &Place<'_>, _: &LatticeUnits) -> Result<Box<dyn Rule<S>>, Error> {
        Ok(Box::new(Links {
            strength: BoundaryKind::OUTFLOW.strength,
            outside: Outside::Air,
        }))
    }
}

/// Links of an opening of water with a free surface. They bounce back here; the surface model sets the entering
/// populations.
pub(crate) struct Links {
    pub(crate) strength: Strength,
    pub(crate) outside: Outside,
}

impl<S: Stored> Rule<S> for Links {
    fn kind(&self) -> BoundaryKind {
        BoundaryKind {
            surface: SurfaceKind::Opening,
            strength: self.strength,
        }
    }

    fn take(&mut self, _: &Crossing<'_, S>) -> Giver {
        Giver::Wall { term: 0.0 }
    }

    fn outside(&self) -> Option<Outside> {
        Some(self.outside.clone())
    }

    fn is_wall(&self) -> bool {
        true
    }

    fn ramp_end(&self) -> f64 {
        match &self.outside {
            Outside::Discharge(values) | Outside::Level { levels: values, .. } => values.end(),
            Outside::Stream | Outside::Air => 0.0,
        }
    }
}
