//! File of a boundary that exists in this test only: a wall that returns a fraction of each population,
//!
//! f_ī(x, t+1) = w_i + r (f*_i(x, t) - w_i).

use crate::boundary::profile::ReadTable;
use crate::boundary::{
    BoundaryKind, BoundaryModel, Crossing, FaceLink, Giver, Place, Rule, RuleStep, Site, Strength,
    SurfaceKind,
};
use crate::lanes::Stored;
use crate::populations::Populations;
use base::error::{Error, Report};
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Boundary of this test, which returns a fraction of each population.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Toy {
    /// Returned fraction r, without unit.
    pub returned: f64,
}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::Opening,
    strength: Strength::Outflow,
};

impl BoundaryModel for Toy {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn resolve(&mut self, site: &Site<'_>, _: ReadTable<'_>, report: &mut dyn Report) {
        if !(0.0..=1.0).contains(&self.returned) {
            report.error(
                &format!("{}.returned", site.path),
                "a toy returns a part of what reaches it".into(),
                "use a number from 0 to 1".into(),
            );
        }
    }

    fn rule<S: Stored>(&self, _: &Place<'_>, _: &LatticeUnits) -> Result<Box<dyn Rule<S>>, Error> {
        Ok(Box::new(Links {
            returned: self.returned,
            links: Vec::new(),
        }))
    }
}

struct Links {
    returned: f64,
    links: Vec<FaceLink>,
}

impl<S: Stored> Rule<S> for Links {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn take(&mut self, crossing: &Crossing<'_, S>) -> Giver {
        self.links.push(crossing.face_link());
        Giver::Rule
    }

    fn apply(&mut self, populations: &mut Populations<S>, _: &RuleStep) {
        let parity = populations.parity();
        let numbers = populations.numbers_mut();
        for link in &self.links {
            let back = self.returned * numbers[link.link.out(parity)].to_f64();
            numbers[link.link.incoming(parity)] = S::from_f64(back);
        }
    }

    fn links(&self) -> &[FaceLink] {
        &self.links
    }
}
