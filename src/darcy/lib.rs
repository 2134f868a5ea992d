//! Seepage through the pores of a bed of grains: porosity, permeability, pressure.
//!
//! ```text
//! grains --porosity--> eps, d --permeability--> K --pressure--> p, q  --drag--> loads (coupling/seepage)
//! ```
//!
//! All fields are on a coarse rectilinear [`SeepageGrid`] whose cells hold many grains. Each rank has the porosity and
//! the pressure of the whole grid, because its grains may be anywhere in it. The linear solver takes most of the
//! time and is therefore parallel. It works on slabs of its own, cut along the longest axis of the coarse grid,
//! independently of the decomposition of the grains. Sums over grains and cells are exact or in a fixed order, so
//! that the bits are the same on any number of ranks.
//!
//! The types of this module are the parameters of a case. The module does not depend on grains, cases or files.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests compare bits exactly"))]

pub mod cut_cells;
pub mod drag;
pub mod drains;
pub mod enclosure;
pub mod grid;
mod layout;
pub mod mean_diameter;
mod multigrid;
pub mod neighbourhood;
pub mod open_water;
pub mod overlap;
pub mod piping;
pub mod porosity;
pub mod pressure;
mod reproducible;
pub mod resistance;
pub mod retention;
pub mod surface;
pub mod zones;

use base::error::number;
pub use drag::DragLaw;
pub use drains::DrainCells;
pub use enclosure::{Enclosure, Openness};
pub use grid::{GridAxis, SeepageGrid};
pub use mean_diameter::MeanDiameter;
pub use piping::{Piping, PipingSettings};
pub use porosity::{Pores, PorosityMethod};
pub use pressure::unsaturated::{
    ConditionHistory, InitialWater, Soil, TransientSettings, WaterBalance,
};
pub use pressure::{
    Condition, Equations, Heave, Liquid, Medium, Pressure, PressurePatch, PressureSettings, Prisms,
    SolutionReport,
};
pub use resistance::{Resistance, ResistanceSettings};
pub use retention::Retention;
pub use surface::WettedSurface;
pub use zones::Zones;

pub use reproducible::power_above;

/// Reason why the water could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SeepageError {
    /// Connected cells without a face with an imposed pressure, whose pressure is undetermined.
    #[error(
        "a group of {cells} cells of the seepage grid, which contains the cell at ({:.6}, {:.6}, {:.6}) m, is \
         not connected to any face with an imposed pressure or head: its water has no outlet and its pressure is \
         undetermined",
        .at[0], .at[1], .at[2]
    )]
    Pocket {
        /// Number of cells of the pocket.
        cells: usize,
        /// Centre of its first cell \[m\].
        at: [f64; 3],
    },
    /// No cell inside the walls.
    #[error("no cell of the seepage grid is open to water")]
    NoOpenCell,
    /// Iteration that did not reach its tolerance.
    #[error(
        "the seepage pressure did not converge: after {iterations} iterations the residual is {residual:.3e} of \
         its first value, and {tolerance:.1e} is required"
    )]
    NotConverged {
        /// Number of iterations done.
        iterations: u32,
        /// Residual relative to the driving terms.
        residual: f64,
        /// Requested relative residual.
        tolerance: f64,
    },
    /// Unsaturated flow for which neither Newton's method nor the continuation converged.
    #[error(
        "the steady flow in unsaturated ground did not converge in {iterations} iterations: where a `discharge` or \
         `flux` takes water out of the ground, use less than the ground can yield; otherwise use cells of about a \
         capillary length of the soil ({} m), a smaller `alpha` or `n`, or more `max_iterations`",
        number(*.length)
    )]
    Unsaturated {
        /// Number of iterations of the linear solver.
        iterations: u32,
        /// Capillary length of the soil \[m\].
        length: f64,
    },
    /// Well that takes more water than the ground can yield.
    #[error(
        "the well at ({:.6}, {:.6}, {:.6}) m takes more water than the ground can yield: its pressure head is {} m, \
         and water boils at -10 m; use a smaller discharge, or a condition of the well that limits it, such as a head",
        .at[0], .at[1], .at[2], number(*.head)
    )]
    DryWell {
        /// Centre of a cell of the well \[m\].
        at: [f64; 3],
        /// Pressure head there \[m\].
        head: f64,
    },
    /// Stated flux out of the ground that is larger than the ground can yield.
    #[error(
        "the `flux` out of the ground at ({:.6}, {:.6}, {:.6}) m is larger than the ground can yield: the pressure \
         head there is {} m, and that of dry soil is -1.02e5 m; use a smaller flux, or `evaporation`, which a \
         limiting suction ends",
        .at[0], .at[1], .at[2], number(*.head)
    )]
    DryGround {
        /// Centre of a cell of the face \[m\].
        at: [f64; 3],
        /// Pressure head there \[m\].
        head: f64,
    },
    /// Unsaturated transient flow that did not converge even in the shortest step.
    #[error(
        "the flow in unsaturated ground did not converge at {} s even with the shortest time step: where a `discharge` \
         or `flux` takes water out of the ground, use less than the ground can yield; otherwise use cells of about a \
         capillary length of the soil ({} m), a smaller `alpha` or `n`, or an initial state closer to the conditions \
         of the boundary",
        number(*.time),
        number(*.length)
    )]
    UnsteadyFlow {
        /// Time \[s\].
        time: f64,
        /// Capillary length of the soil \[m\].
        length: f64,
    },
    /// Pipe of backward erosion without an equilibrium.
    #[error(
        "no equilibrium of a pipe of {} m was found: use smaller cells along the pipe, or end the pipe earlier",
        number(*.length)
    )]
    Pipe {
        /// Length \[m\].
        length: f64,
    },
    /// Porosity, source or pressure that is not finite.
    #[error("the seepage pressure is not finite ({0})")]
    NotFinite(&'static str),
    /// Failure to set up the messages between ranks.
    #[error("seepage: {0}")]
    Messages(String),
    /// Solution that ended early, because a stop was requested ([`Pressure::interrupt_when`]).
    #[error("stopped within a solution of the seepage pressure")]
    Stopped,
}
