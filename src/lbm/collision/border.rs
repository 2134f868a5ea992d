//! Cell Reynolds number up to which runs with an operator were stable.
//!
//! The cell Reynolds number is U h/ν, with U the largest imposed speed. The limits are those of the maps under
//! `benches/stability`, one folder per flow: double shear layers (no walls, no openings), lid-driven cavities (walls),
//! a cylinder behind an inlet (openings in 2-D), square ducts between an inlet and an outlet (openings in 3-D, without
//! and with an eddy viscosity), a disc and a sphere that start to move.

use crate::lattice::VelocitySet;

/// Bounds of the cell Reynolds number up to a lattice velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReynoldsBounds {
    /// Largest lattice velocity U dt/h for which the bounds are valid.
    pub lattice_velocity: f64,
    /// Largest cell Reynolds number up to which every run was stable.
    pub holds: f64,
    /// Smallest cell Reynolds number at which a run failed.
    pub fails: f64,
}

impl ReynoldsBounds {
    /// Returns the bounds for flows up to a lattice velocity.
    #[must_use]
    pub const fn up_to(lattice_velocity: f64, holds: f64, fails: f64) -> Self {
        Self {
            lattice_velocity,
            holds,
            fails,
        }
    }

    /// Returns the bounds for any lattice velocity.
    #[must_use]
    pub const fn always(holds: f64, fails: f64) -> [Self; 1] {
        [Self::up_to(f64::INFINITY, holds, fails)]
    }
}

/// Stability limit with the map that shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// Folder of the map under `benches/stability`.
    pub map: &'static str,
    /// Bounds in ascending order of the lattice velocity.
    pub bounds: &'static [ReynoldsBounds],
}

/// Boundaries of the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// Periodic domain without walls or openings.
    Periodic,
    /// Walls without openings.
    Walls,
    /// Inlet or outlet.
    Openings,
}

/// Flow whose stability is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Situation {
    /// Velocity set: D3Q19 becomes unstable before D3Q27.
    pub velocities: VelocitySet,
    /// Boundaries of the fluid.
    pub surroundings: Surroundings,
    /// `true` if a moving wall ends at a stationary wall: the corners of a lid are the most demanding walls.
    pub lid_meets_wall: bool,
    /// `true` if an eddy viscosity is added.
    pub eddies: bool,
}

impl Situation {
    /// Returns `true` for openings in 3-D without an eddy viscosity: the flows of the map of the duct.
    pub(super) fn duct(&self) -> bool {
        self.surroundings == Surroundings::Openings
            && self.velocities.dimension() == 3
            && !self.eddies
    }
}

/// Moving body whose stability is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovingBody {
    /// `true` if links at its surface return the populations; `false` if its cells are partially saturated.
    pub links: bool,
    /// Number of dimensions of the flow.
    pub dimension: usize,
    /// `true` if an eddy viscosity is added.
    pub eddies: bool,
}

/// Bounds of a moving disc with links, for any 2-D operator. Outside the map discs of other sizes failed at
/// 9.7 at a lattice velocity of 0.15.
const DISC: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.11, 10.0, 11.0),
    ReynoldsBounds::up_to(0.15, 7.0, 8.0),
    ReynoldsBounds::up_to(0.21, 2.0, 4.0),
    ReynoldsBounds::up_to(f64::INFINITY, 0.0, 0.0),
];

/// Bounds of a moving disc in partially saturated cells: at a lattice velocity of 0.2 the water next to it exceeds
/// the guard.
const SATURATED_DISC: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.11, 80.0, f64::INFINITY),
    ReynoldsBounds::up_to(0.15, 20.0, 40.0),
    ReynoldsBounds::up_to(0.21, 5.0, 7.0),
    ReynoldsBounds::up_to(f64::INFINITY, 0.0, 0.0),
];

/// Bounds of a moving sphere in partially saturated cells, for any 3-D operator.
const SATURATED_SPHERE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.15, 80.0, f64::INFINITY),
    ReynoldsBounds::up_to(f64::INFINITY, 40.0, 80.0),
];

/// Bounds of a moving sphere with links, for one or two relaxation times.
pub(super) const SPHERE: &[ReynoldsBounds] = &[
    ReynoldsBounds::up_to(0.11, 10.0, 12.0),
    ReynoldsBounds::up_to(0.15, 7.0, 10.0),
    ReynoldsBounds::up_to(f64::INFINITY, 5.0, 7.0),
];

impl MovingBody {
    /// Returns the border of an operator with the bounds `sphere` for a sphere with links.
    pub(super) fn border(&self, sphere: &'static [ReynoldsBounds]) -> Border {
        let (map, bounds) = match (self.dimension, self.links) {
            (2, true) => ("moving-disc-10", DISC),
            (2, false) => ("moving-disc-10", SATURATED_DISC),
            (_, true) => ("moving-sphere-8", sphere),
            (_, false) => ("moving-sphere-8", SATURATED_SPHERE),
        };
        Border { map, bounds }
    }
}

/// Borders of openings in 2-D, with two relaxation times and with one. The map has the lattice velocities 0.2 and
/// 0.28; at the latter eddies exceed the guard at 0.3. Between the points of the map, cylinders at other positions
/// failed from 12 on with two relaxation times.
pub(super) const CYLINDER: [Border; 2] = [
    cylinder(&[
        ReynoldsBounds::up_to(0.21, 10.0, 12.0),
        ReynoldsBounds::up_to(f64::INFINITY, 0.0, 0.0),
    ]),
    cylinder(&[
        ReynoldsBounds::up_to(0.11, 30.0, 90.0),
        ReynoldsBounds::up_to(0.21, 6.0, 20.0),
        ReynoldsBounds::up_to(f64::INFINITY, 0.0, 0.0),
    ]),
];

/// Returns a border behind an inlet in 2-D: the map of all flows in 2-D with openings.
const fn cylinder(bounds: &'static [ReynoldsBounds]) -> Border {
    Border {
        map: "cylinder-10",
        bounds,
    }
}

/// Border of openings with an eddy viscosity, with one or two relaxation times.
pub(super) const DUCT_WITH_EDDIES: Border = Border {
    map: "duct-eddies-16",
    bounds: &ReynoldsBounds::always(5.0, 10.0),
};

/// Returns a border in the cavity of 20³ cells: the map of all flows in 3-D without openings.
pub(super) const fn cube(bounds: &'static [ReynoldsBounds]) -> Border {
    Border {
        map: "cavity-3d-20",
        bounds,
    }
}

/// Returns a border in the square duct between an inlet and an outlet: the map of all flows in 3-D with openings.
pub(super) const fn duct(bounds: &'static [ReynoldsBounds]) -> Border {
    Border {
        map: "duct-20",
        bounds,
    }
}
