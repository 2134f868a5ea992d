//! The erosion law of a piping run: eroded mass, hydraulic shear stress, erosion rate and their fit.
//!
//! Eroding soil is described by `rate = k_d (tau_h - tau_c)` above a critical shear stress (equation 9 of Sibille,
//! Lominé and Marot, ICSE-6, 2012). The chain from a run to the law is one file each:
//!
//! | file | question |
//! |---|---|
//! | [`record`] | what does a run record |
//! | [`hole`] | where are the faces of the hole and what shear stress acts on them (equation 10) |
//! | [`rate`] | how fast do the faces erode, per area, and with which standard error |
//! | [`fit`] | which critical stress and erosion coefficient follow (equation 9) |
//!
//! In 2-D all masses and forces are per metre of depth: kg/m and N/m. The pipe's area is then its two faces, `2 L`.

pub mod fit;
pub mod hole;
pub mod rate;
pub mod record;
mod statistics;

pub use fit::{
    CohesionTrend, FitOptions, Interval, Law, LinearLaw, RatePoint, cohesion_trend, fit_law,
};
pub use hole::{
    HoleFaces, WallShear, hole_faces, shear_by_balance, shear_by_gradient, shear_by_traction,
};
pub use rate::{RateWindow, WindowOptions, erosion_windows, mean_jump, run_point};
pub use record::{
    BondBreak, BreakMode, BreakPlace, ErosionRecord, ErosionSummary, RemovedGrain, Row, read_rows,
    write_rows,
};
