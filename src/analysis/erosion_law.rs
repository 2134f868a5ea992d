//! The erosion law of a piping run: eroded mass, hydraulic shear stress, erosion rate and their fit.
//!
//! The erosion of soil is described by `rate = k_d (tau_h - tau_c)` above a critical shear stress (equation 9 of
//! Sibille, Lominé and Marot, ICSE-6, 2012). Each step from a run to the law is one file:
//!
//! | file | content |
//! |---|---|
//! | [`record`] | the records of a run |
//! | [`hole`] | the faces of the hole and the shear stress on them (equation 10) |
//! | [`rate`] | the erosion rate per area of the faces, with its standard error |
//! | [`fit`] | the critical stress and the erosion coefficient (equation 9) |
//! | [`jet`] | the same from the scour depth of a jet erosion test |
//!
//! In 2-D all masses and forces are per metre of depth: kg/m and N/m. The area of the hole is then that of its two
//! faces, `2 L`.

pub mod fit;
pub mod hole;
pub mod jet;
pub mod rate;
pub mod record;

pub use fit::{
    CohesionTrend, FitOptions, FittedErosionLaw, Interval, LinearLaw, RatePoint, cohesion_trend,
    fit_law,
};
pub use hole::{
    HoleFaces, WallShear, hole_faces, shear_by_balance, shear_by_gradient, shear_by_traction,
};
pub use rate::{RateWindow, WindowOptions, erosion_windows, mean_jump, run_point};
pub use record::{
    BondBreak, BreakMode, BreakPlace, ErosionRecord, ErosionSummary, RecordRow, RemovedGrain,
    read_rows, write_rows,
};
