//! Effect of collisions in f32 on velocities.
//!
//! A collision in f32 changes the momentum of a cell by up to some 2^-24 of it: the constants and rates are rounded,
//! the same way in every step, and every result. The viscosity takes momentum away within H²/(pi² nu) steps between
//! walls that are H cells apart, so that velocities change by at most about that number of roundings, and by the
//! number of steps of the run if no walls hold the water. Rounding of the rate 1/tau changes the viscosity as well,
//! the more the closer tau is to ½.

use super::Scene;
use super::flow::Flow;
use base::number::{real, single};
use std::f64::consts::PI;

/// Largest rounding error of a number in f32, relative to the number.
const UNIT: f64 = 1.0 / 16_777_216.0;

/// Number of roundings in a step that add up: the largest number of the flows in `benches/precision.rs` is 1.2.
const ROUNDINGS: f64 = 2.0;

/// Returns the largest relative change of velocities by the rounding of collisions in f32.
#[must_use]
pub fn of_single(scene: &Scene, flow: &Flow) -> f64 {
    let viscosity = (flow.relaxation_time - 0.5) / 3.0;
    let steps = scene.time.end / flow.time_step;
    let walls = (0..scene.grid.dimension).filter(|&axis| !scene.grid.periodic[axis]);
    let nearest = walls
        .map(|axis| real(scene.grid.cells[axis]))
        .fold(f64::INFINITY, f64::min);
    let decay = (nearest / PI).powi(2) / viscosity;
    let rate = f64::from(single(1.0 / flow.relaxation_time));
    let other = (1.0 / rate - 0.5) / 3.0;
    ROUNDINGS * UNIT * steps.min(decay).max(1.0) + (other / viscosity - 1.0).abs()
}
