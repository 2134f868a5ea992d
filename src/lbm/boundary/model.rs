//! Interface of a boundary of a case, in SI: its kind, its speed, pressure and inflow, and its rule on the lattice.

use super::kind::{BoundaryKind, Inflow, SurfaceKind, WithSurface};
use super::profile::ReadTable;
use super::rule::Rule;
use super::site::{Place, Site};
use crate::lanes::Stored;
use base::error::{Error, Report};
use base::units::LatticeUnits;

/// A speed that a boundary imposes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImposedSpeed {
    /// Name of the moving part, in words.
    pub what: &'static str,
    /// JSON path of the field that decides it, below the parameters of the boundary.
    pub field: &'static str,
    /// The largest speed [m/s].
    pub value: f64,
}

/// A pressure that a boundary imposes: `start` at first, then linearly to `end`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImposedPressure {
    /// JSON path of the field that decides it, below the parameters of the boundary.
    pub field: &'static str,
    /// Pressure above the reference at the start \[Pa\].
    pub start: f64,
    /// Pressure above the reference at the end of the change \[Pa\].
    pub end: f64,
    /// Time of the change \[s\]; 0 for at once.
    pub ramp_time: f64,
}

impl ImposedPressure {
    /// Returns the smaller and the larger of the two \[Pa\].
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        [self.end.min(self.start), self.end.max(self.start)]
    }

    /// Returns the largest amplitude \[Pa\].
    #[must_use]
    pub fn amplitude(&self) -> f64 {
        self.end.abs().max(self.start.abs())
    }
}

/// A boundary as a case names it: its parameters in SI, and what the program asks about it.
pub trait BoundaryModel {
    /// Returns the kind of the boundary.
    fn kind(&self) -> BoundaryKind;

    /// Checks the parameters and reads the tables that they name; what is wrong goes to the report.
    fn resolve(&mut self, site: &Site<'_>, read: ReadTable<'_>, report: &mut dyn Report) {
        let _ = (site, read, report);
    }

    /// Checks what depends on the cells of the patch.
    fn check(&self, place: &Place<'_>, report: &mut dyn Report) {
        let _ = (place, report);
    }

    /// Returns the largest speed that it imposes.
    fn speed(&self) -> Option<ImposedSpeed> {
        None
    }

    /// Returns the pressure that it imposes.
    fn pressure(&self) -> Option<ImposedPressure> {
        None
    }

    /// Returns `true` if the pressure there is that of the fluid; next to imposed pressures it counts as the reference.
    fn pressure_floats(&self) -> bool {
        false
    }

    /// Returns the inflow into the domain.
    fn inflow(&self, place: &Place<'_>) -> Inflow {
        let _ = place;
        Inflow::None
    }

    /// Returns the time over which the inflow grows from nothing \[s\]; 0 for at once.
    fn ramp_time(&self) -> f64 {
        0.0
    }

    /// Returns its use at water with a free surface.
    fn with_surface(&self) -> WithSurface {
        match self.kind().surface {
            SurfaceKind::Wall | SurfaceKind::Symmetry => WithSurface::Also,
            SurfaceKind::MovingWall | SurfaceKind::Opening => WithSurface::Never,
        }
    }

    /// Returns the lowest and the highest level of water that stands or falls outside \[m\], by coordinate along the
    /// axis of gravity, and the field that decides it.
    fn levels(&self) -> Option<([f64; 2], &'static str)> {
        None
    }

    /// Returns the largest discharge into the domain that it imposes on a free surface \[m3/s; m2/s in 2-D\].
    fn discharge(&self) -> Option<f64> {
        None
    }

    /// Returns `true` if water passes through it, or is driven through it.
    fn passes_water(&self) -> bool {
        self.kind().surface == SurfaceKind::Opening
    }

    /// Returns the rule on the lattice.
    ///
    /// # Errors
    /// If the cells of the patch show that the parameters cannot hold.
    fn rule<S: Stored>(
        &self,
        place: &Place<'_>,
        units: &LatticeUnits,
    ) -> Result<Box<dyn Rule<S>>, Error>
    where
        Self: Sized;
}
