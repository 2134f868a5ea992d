//! Discharge of water with a free surface through the wet area of a face
//! ([`crate::surface::Outside::Discharge`]).

use super::outfall::Links;
use super::profile::ReadTable;
use super::{BoundaryKind, BoundaryModel, Place, Rule, Site, Strength, SurfaceKind, WithSurface};
use crate::lanes::Stored;
use crate::surface::Outside;
use base::error::{Error, Report};
use base::history::{self, TimeTable};
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A discharge into water with a free surface: a uniform velocity over the wet part of the face, where the flow
/// determines the level. Over a bed that is dry or carries less water, the discharge enters at its critical depth. For
/// a supercritical inflow impose velocity and depth by `velocity` on a patch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Discharge {
    /// Discharge into the domain [m3/s; in 2-D m2/s], 0 or more.
    #[schemars(range(min = 0.0))]
    pub value: f64,
    /// Table of times \[s\] and discharges [m3/s; in 2-D m2/s] that replace the value: linear between the rows,
    /// constant before and after; two values at one time are a jump. Default: constant.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::Opening,
    strength: Strength::Pressure,
};

impl Discharge {
    fn discharges(&self) -> TimeTable {
        TimeTable::new(self.history.as_deref(), self.value)
    }
}

impl BoundaryModel for Discharge {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn resolve(&mut self, site: &Site<'_>, _: ReadTable<'_>, report: &mut dyn Report) {
        let path = format!("{}.history", site.path);
        if let Some(table) = &self.history
            && history::check(table, &path, report)
            && table.iter().any(|[_, discharge]| *discharge < 0.0)
        {
            report.error(
                &path,
                "a discharge flows into the domain and must be 0 or more".into(),
                "for an outlet use `level`, `outfall` or a `velocity` that points out of the domain"
                    .into(),
            );
        }
    }

    fn with_surface(&self) -> WithSurface {
        WithSurface::Only
    }

    fn discharge(&self) -> Option<f64> {
        let [_, most] = self.discharges().range();
        Some(most)
    }

    fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let site = &place.site;
        let area = if site.dimension == 2 {
            site.spacing
        } else {
            site.spacing * site.spacing
        };
        let in_steps = |time: f64| units.time_to_lattice(time);
        let in_cells = |discharge: f64| units.velocity_to_lattice(discharge / area);
        Ok(Box::new(Links {
            strength: KIND.strength,
            outside: Outside::Discharge(self.discharges().scaled(in_steps, in_cells)),
        }))
    }
}
