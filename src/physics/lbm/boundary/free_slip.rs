//! Free slip: populations are mirrored at the face, half-way beyond the last cell.
//!
//! The population entering x along j is the one that left the cell x - t along i, where i is j with the components
//! normal to the crossed faces reversed and t its part along them. No momentum parallel to the face is exchanged.

use super::{Crossing, Giver, Mirror, Model, Moment, Nature, Place, Rule, Strength, Surface};
use crate::error::Error;
use crate::lbm::lanes::Stored;
use crate::lbm::populations::Populations;
use crate::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A symmetry plane: no flow through it and no friction. Bodies that intersect the plane need partially saturated cells, because
/// bounce-back links along the plane do not see the mirror image of the body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct FreeSlip {}

const NATURE: Nature = Nature {
    surface: Surface::Symmetry,
    strength: Strength::Symmetry,
};

impl Model for FreeSlip {
    fn nature(&self) -> Nature {
        NATURE
    }

    fn rule<S: Stored>(&self, _: &Place<'_>, _: &LatticeUnits) -> Result<Box<dyn Rule<S>>, Error> {
        Ok(Box::<Links>::default())
    }
}

/// The populations that a patch mirrors.
#[derive(Debug, Default)]
pub struct Links {
    mirrors: Vec<Mirror>,
}

impl<S: Stored> Rule<S> for Links {
    fn nature(&self) -> Nature {
        NATURE
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        self.mirrors.push(Mirror::new(crossing));
        Giver::Rule
    }

    fn walls_stand_alone(&self) -> bool {
        self.mirrors.is_empty()
    }

    fn apply(&mut self, populations: &mut Populations<S>, _: &Moment) {
        let parity = populations.parity();
        let numbers = populations.numbers_mut();
        for m in &self.mirrors {
            let (from, to) = m.ends(parity);
            numbers[to] = numbers[from];
        }
    }

    fn mirrors(&self) -> &[Mirror] {
        &self.mirrors
    }
}
