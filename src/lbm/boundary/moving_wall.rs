//! A wall that moves in its own plane: half-way bounce-back with the velocity of the wall ([`super::wall`]). In an edge
//! with an opening it takes water along through the opening, in one with another wall or a plane of symmetry none
//! (`super::edge`).

use super::profile::ReadTable;
use super::{
    BoundaryKind, BoundaryModel, ImposedSpeed, Place, Ramp, Rule, Site, Strength, SurfaceKind,
    velocity,
};
use crate::lanes::Stored;
use base::error::{Error, Report};
use base::geometry::Vector;
use base::history;
use base::units::LatticeUnits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Wall that moves in its own plane. Water that it takes along leaves and enters through an opening in its way as far
/// as the edge; an imposed velocity should be that of the wall there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MovingWall {
    /// Velocity of the wall, tangential to the face [m/s].
    pub velocity: Vector,
    /// Table of times \[s\], counted from the first fluid step, warm-up included, and factors of the velocity \[1\]:
    /// linear between the rows, constant before and after; two factors at one time are a jump. Default: constant.
    #[serde(default)]
    pub history: Option<Vec<[f64; 2]>>,
}

const KIND: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::MovingWall,
    strength: Strength::Velocity,
};

impl BoundaryModel for MovingWall {
    fn kind(&self) -> BoundaryKind {
        KIND
    }

    fn resolve(&mut self, site: &Site<'_>, _: ReadTable<'_>, report: &mut dyn Report) {
        let path = format!("{}.velocity", site.path);
        let velocity = self.velocity.resolve(site.dimension, &path, report);
        if velocity[site.face.axis()] != 0.0 {
            report.error(
                &path,
                "a wall can only slide in its own plane, but this velocity has a component normal to the face"
                    .into(),
                "set that component to 0, or impose a velocity".into(),
            );
        }
        if let Some(table) = &self.history {
            history::check(table, &format!("{}.history", site.path), report);
        }
    }

    fn speed(&self) -> Option<ImposedSpeed> {
        let squares = self.velocity.to_array().map(|x| x * x);
        Some(ImposedSpeed {
            what: "the moving wall",
            field: "velocity",
            value: squares.iter().sum::<f64>().sqrt()
                * velocity::largest_factor(self.history.as_deref()),
        })
    }

    fn rule<S: Stored>(
        &self,
        _: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error> {
        let u = self
            .velocity
            .to_array()
            .map(|x| units.velocity_to_lattice(x));
        let links = velocity::VelocityLinks::new(Box::new(move |_| u), Ramp::constant(1.0));
        let links = links.following(velocity::in_steps(self.history.as_deref(), units));
        Ok(Box::new(links.with_kind(KIND)))
    }
}
