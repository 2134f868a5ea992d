//! Water at a level outside a face: inflow, outflow or tailwater of water with a free surface
//! ([`crate::surface::Outside::Level`]).

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

/// Open water of a given level outside the face: the pressure is hydrostatic below the level and that of the air above
/// it. The flow determines whether water enters or leaves; water that enters has no velocity along the face. Where more
/// water leaves than enters, eddies draw water in from rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct Level {
    /// Level outside \[m\] along the axis of gravity, measured from the lower corner of the domain.
    pub value: f64,
    /// Table of times \[s\] and levels \[m\] that replace the value: linear between the rows, constant before and
    /// after; two levels at one time are a jump. Default: constant.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
    /// Place where the level holds. Default: `at_face`.
    #[serde(default)]
    pub holds: Holds,
}

/// Place where a level holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Holds {
    /// At the face: an entering stream has its velocity head in addition. Waves are reflected.
    #[default]
    AtFace,
    /// In a reservoir beyond the face, where the water is at rest: an entering stream is lower at the face by the
    /// velocity head U²/(2 g) of its mean speed. Waves between the face and a weir or gate lose energy to the
    /// reservoir.
    InReservoir,
}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::Opening,
    strength: Strength::Pressure,
};

impl Level {
    fn levels_in_time(&self) -> TimeTable {
        TimeTable::new(self.history.as_deref(), self.value)
    }
}

impl BoundaryModel for Level {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn resolve(&mut self, site: &Site<'_>, _: ReadTable<'_>, report: &mut dyn Report) {
        if let Some(table) = &self.history {
            history::check(table, &format!("{}.history", site.path), report);
        }
    }

    fn with_surface(&self) -> WithSurface {
        WithSurface::Only
    }

    fn levels(&self) -> Option<([f64; 2], &'static str)> {
        let field = if self.history.is_some() {
            "history"
        } else {
            "value"
        };
        Some((self.levels_in_time().range(), field))
    }

    fn rule<S: Stored>(
        &self,
        _: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let levels = self.levels_in_time();
        let in_steps = |time: f64| units.time_to_lattice(time);
        let in_cells = |level: f64| units.length_to_lattice(level);
        Ok(Box::new(Links {
            strength: KIND.strength,
            outside: Outside::Level {
                levels: levels.scaled(in_steps, in_cells),
                in_reservoir: self.holds == Holds::InReservoir,
            },
        }))
    }
}
