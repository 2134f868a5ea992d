//! Interface of a boundary of a case, in SI: its kind, its speed, pressure and inflow, and its rule on the lattice.

use super::kind::{BoundaryKind, Inflow, Strength, SurfaceKind, WithSurface};
use super::profile::ReadTable;
use super::rule::Rule;
use super::site::{Opening, Place, Site};
use crate::lanes::Stored;
use base::error::{Error, Report};
use base::history::TimeTable;
use base::units::LatticeUnits;

/// Speed that a boundary imposes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImposedSpeed {
    /// Name of the moving part for messages.
    pub what: &'static str,
    /// JSON path of the field that determines the speed, below the parameters of the boundary.
    pub field: &'static str,
    /// Largest speed [m/s].
    pub value: f64,
}

/// Pressure that a boundary imposes.
#[derive(Clone, Debug, PartialEq)]
pub struct ImposedPressure {
    /// JSON path of the field that determines the pressure, below the parameters of the boundary.
    pub field: &'static str,
    /// Pressures above the reference \[Pa\] at times after the first fluid step \[s\].
    pub history: TimeTable,
}

impl ImposedPressure {
    /// Returns the smallest and the largest pressure \[Pa\].
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.history.range()
    }

    /// Returns the largest absolute value of the pressure \[Pa\].
    #[must_use]
    pub fn amplitude(&self) -> f64 {
        self.history.largest()
    }

    /// Returns the pressure at the first fluid step \[Pa\].
    #[must_use]
    pub fn start(&self) -> f64 {
        self.history.value(0.0)
    }
}

/// Boundary of a case: its parameters in SI, and its interface to the program.
pub trait BoundaryModel {
    /// Returns the kind of the boundary.
    fn kind(&self) -> BoundaryKind;

    /// Checks the parameters and reads their tables; findings go to the report.
    fn resolve(&mut self, site: &Site<'_>, read: ReadTable<'_>, report: &mut dyn Report) {
        let _ = (site, read, report);
    }

    /// Checks the parameters against the cells of the patch.
    fn check(&self, place: &Place<'_>, report: &mut dyn Report) {
        let _ = (place, report);
    }

    /// Returns the largest imposed speed.
    fn speed(&self) -> Option<ImposedSpeed> {
        None
    }

    /// Returns the imposed pressure.
    fn pressure(&self) -> Option<ImposedPressure> {
        None
    }

    /// Returns `true` if the pressure at the boundary is that of the fluid; in combination with imposed pressures
    /// it counts as the reference.
    fn pressure_floats(&self) -> bool {
        false
    }

    /// Returns `true` if the boundary determines the pressure of the water that it reaches, given the openings of the
    /// domain.
    fn holds_pressure(&self, openings: &[Opening]) -> bool {
        let _ = openings;
        self.kind().strength == Strength::Pressure
    }

    /// Returns the inflow into the domain; that through an opening follows from the flow unless it is imposed.
    fn inflow(&self, place: &Place<'_>) -> Inflow {
        let _ = place;
        match self.kind().surface {
            SurfaceKind::Opening => Inflow::Any,
            SurfaceKind::Wall | SurfaceKind::MovingWall | SurfaceKind::Symmetry => Inflow::None,
        }
    }

    /// Returns the largest inflow into the domain at any time.
    fn largest_inflow(&self, place: &Place<'_>) -> Inflow {
        self.inflow(place)
    }

    /// Returns the time over which the inflow increases from zero \[s\]; 0 for an immediate start.
    fn ramp_time(&self) -> f64 {
        0.0
    }

    /// Returns the applicability of the boundary to water with a free surface.
    fn with_surface(&self) -> WithSurface {
        match self.kind().surface {
            SurfaceKind::Wall | SurfaceKind::Symmetry => WithSurface::Also,
            SurfaceKind::MovingWall | SurfaceKind::Opening => WithSurface::Never,
        }
    }

    /// Returns the lowest and the highest water level outside \[m\], along the axis of gravity, and the field that
    /// determines it.
    fn levels(&self) -> Option<([f64; 2], &'static str)> {
        None
    }

    /// Returns the largest imposed discharge into the domain for a free surface \[m3/s; m2/s in 2-D\].
    fn discharge(&self) -> Option<f64> {
        None
    }

    /// Returns `true` if water passes through the boundary, or is driven through it.
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
