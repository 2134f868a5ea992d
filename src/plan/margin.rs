//! Limits of the method, and the margin of a case to each.

use crate::scene::findings::at_most;
use crate::scene::flow::{Flow, PATH};
use base::error::Remedy;
use serde::Serialize;

/// Usual upper bound of the lattice velocity, stated as "typically lower than" by Sibille, Lominé and Marot (2012).
pub const USUAL_LATTICE_VELOCITY: f64 = 0.1;

/// Limit, and the value of the case for it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// Name of the limit.
    pub limit: String,
    /// Value of the case.
    pub value: f64,
    /// Largest or smallest allowed value.
    pub allowed: f64,
    /// Used fraction of the limit; above 1 the limit is exceeded.
    pub used: f64,
    /// JSON path of the field that determines the value.
    pub path: String,
}

pub(super) fn margin(limit: &str, value: f64, allowed: f64, path: &str) -> Margin {
    Margin {
        limit: limit.into(),
        value,
        allowed,
        used: value / allowed,
        path: path.into(),
    }
}

/// Smallest relaxation time that is proposed: below it stability depends on the operator and the walls, not on the
/// time step.
const MIN_PROPOSED: f64 = 0.505;

/// Proposes the fraction `part` of the time step through the field that determines it, if the resulting relaxation
/// time is stable.
pub(super) fn slower_clock(flow: &Flow, h: f64, part: f64, text: String) -> Remedy {
    let dt = at_most(part * flow.time_step);
    let above = 3.0 * flow.kinematic_viscosity * part * flow.time_step / (h * h);
    let remedy = Remedy::from(text);
    if part >= 1.0 || 0.5 + above < MIN_PROPOSED {
        return remedy;
    }
    match flow.fixed_by {
        "relaxation_time" => remedy.set(format!("{PATH}.relaxation_time"), 0.5 + at_most(above)),
        "time_step" | "accuracy" => remedy.set(format!("{PATH}.time_step"), dt),
        _ => remedy,
    }
}
