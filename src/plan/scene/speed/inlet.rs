//! Speed of water that enters through the smaller of two openings with imposed pressures.
//!
//! An imposed pressure is that of the water in the opening, not that of a reservoir behind it. Water that enters
//! through a small opening crosses the domain as a jet, which loses its kinetic energy there (Borda and Carnot;
//! Batchelor 1967, section 5.15). The pressure difference then only gives the water its speed in the larger opening, dP
//! = ρ U²/2, and by continuity the jet is faster by the ratio of the areas:
//!
//! ```text
//! U = sqrt(2 dP/ρ) A_out/A_in
//! ```
//!
//! The viscous flow between the openings, which are at least L apart, is an upper bound as well: dP b²/(8 ρ ν L) in the
//! open height b, faster by the ratio of the section to the smaller opening; and so is the acceleration dP t/(ρ L). A
//! channel with a patch of 9 cells in one face and an outlet of 58 cells reached 2.8 times sqrt(2 dP/ρ) before its run
//! ended.
//!
//! The difference dP is that of the reduced pressures p - ρ g·x in the middle of the openings, if gravity acts: with
//! equal pressures the water falls from the higher one. A patch of 18 cells 23 cells above an outlet of 60 cells drew
//! in a jet of 0.2 in lattice units where sqrt(2 g H) was 0.076.

use super::{PressureDifference, Speed, SpeedCause, passage, pressure_difference};
use crate::scene::Scene;
use crate::scene::boundaries::ScenePatch;
use crate::scene::flow::{Flow, PATH};
use crate::scene::terms;
use base::number::real;

/// Ratio of the areas above which one opening counts as smaller.
const SMALLER: f64 = 1.0 + 1e-9;

/// Returns the speed in the openings with the larger pressure if together they are smaller than the others.
pub(super) fn speed(scene: &Scene, flow: &Flow) -> Option<Speed> {
    let PressureDifference { path, axis, .. } = pressure_difference(flow)?;
    let grid = &scene.grid;
    let reduced = |patch: &ScenePatch, end: usize| {
        let model = patch.condition.model();
        let imposed = model.pressure().map(|pressure| pressure.range()[end]);
        let pressure = imposed.or(model.pressure_floats().then_some(0.0))?;
        Some(pressure + potential(scene, flow, patch))
    };
    let openings = || {
        flow.patches()
            .filter_map(|one| Some((one, reduced(one, 1)?)))
    };
    let highest = openings()
        .map(|(_, pressure)| pressure)
        .fold(f64::NEG_INFINITY, f64::max);
    let lowest = flow.patches().filter_map(|one| reduced(one, 0));
    let value = highest - lowest.fold(f64::INFINITY, f64::min);
    let enters = |pressure: f64| pressure > highest - 0.5 * value;
    let area = |entering: bool| -> f64 {
        let alike = openings().filter(|(_, pressure)| enters(*pressure) == entering);
        alike
            .map(|(patch, _)| patch.imposed_at(grid, PATH).area())
            .sum()
    };
    let [inlet, outlet] = [true, false].map(area);
    if inlet <= 0.0 || outlet <= SMALLER * inlet {
        return None;
    }
    let apart = openings()
        .filter(|(_, pressure)| enters(*pressure))
        .flat_map(|(one, _)| {
            let others = openings().filter(|(_, pressure)| !enters(*pressure));
            others.map(|(other, _)| distance(scene, one, other))
        })
        .fold(f64::INFINITY, f64::min)
        .max(grid.spacing);
    let (_, height) = passage(scene, axis);
    let across = (0..grid.dimension).filter(|a| *a != axis);
    let section: f64 = across.map(|a| real(grid.cells[a])).product();
    let narrowing = (section / inlet).max(1.0);
    let free = (2.0 * value / flow.density).sqrt() * outlet / inlet;
    let viscous = value * height * height / (8.0 * flow.density * flow.kinematic_viscosity * apart);
    let resisted = terms::fastest(&scene.terms, grid, axis, value / flow.density);
    let accelerated = value * scene.time.end / (flow.density * apart);
    let value = free
        .min(narrowing * viscous)
        .min(narrowing * resisted)
        .min(accelerated);
    (value > 0.0).then_some(Speed {
        what: SpeedCause::Inlet,
        path,
        value,
    })
}

/// Returns the smallest and largest coordinate of an opening along an axis \[m\].
fn ends(scene: &Scene, patch: &ScenePatch, axis: usize) -> [f64; 2] {
    let grid = &scene.grid;
    if axis != patch.face.axis() {
        return patch.ends[axis].map(|end| end * grid.spacing);
    }
    let at = if patch.face.is_max() {
        grid.size[axis]
    } else {
        0.0
    };
    [at; 2]
}

/// Returns -ρ g·x in the middle of an opening \[Pa\], along the axes in which gravity acts on the water.
fn potential(scene: &Scene, flow: &Flow, patch: &ScenePatch) -> f64 {
    let acts = |a: &usize| flow.gravity_acts[*a] && scene.surface.is_none();
    let along = (0..scene.grid.dimension).filter(acts);
    let parts = along.map(|a| {
        let [low, high] = ends(scene, patch, a);
        -flow.density * scene.gravity[a] * 0.5 * (low + high)
    });
    parts.sum()
}

/// Returns the distance between two openings \[m\].
fn distance(scene: &Scene, one: &ScenePatch, other: &ScenePatch) -> f64 {
    let grid = &scene.grid;
    let gap = |a: usize| {
        let ([low, high], [from, to]) = (ends(scene, one, a), ends(scene, other, a));
        (from - high).max(low - to).max(0.0)
    };
    (0..grid.dimension).map(gap).fold(0.0, f64::hypot)
}

#[cfg(test)]
mod tests {
    use super::{Speed, speed};
    use crate::Plan;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Checks water that falls from a patch of 18 cells at the side to an outlet of 60 cells below it, with pressures
    /// of 0 at both: sqrt(2 g H) of the height H of the middle of the patch, times the ratio of the areas.
    #[test]
    fn water_falls_from_the_higher_opening() {
        let speed_at = |acts: bool| {
            let case = json!({
                "domain": {"size": [0.03, 0.023], "spacing": 5e-4}, "gravity": [0, -0.09],
                "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.51,
                    "gravity_acts_on_fluid": acts, "boundaries": [
                        {"name": "out", "face": "y_min", "condition": {"pressure": {"value": 0}}},
                        {"name": "side", "face": "x_max", "condition": {"pressure": {"value": 0}},
                         "patch": {"from": [0, 0.007], "to": [0.03, 0.016]}}]}},
                "time": {"end": 100}
            });
            let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
            let scene = Plan::prepare(document).unwrap().scene;
            let flow = scene.flow.as_ref().unwrap();
            speed(&scene, flow).map(|speed| speed.value)
        };
        let falls = (2.0_f64 * 0.09 * 0.0115).sqrt() * 60.0 / 18.0;
        let found = speed_at(true).unwrap();
        assert!((found / falls - 1.0).abs() < 1e-9, "{found} {falls}");
        assert_eq!(speed_at(false), None);
    }

    /// Returns the estimate for a channel of 29 x 15 mm with a pressure in a patch of the left face and one in another
    /// face.
    fn estimate(patch: &Value, face: &str, viscosity: f64) -> Option<f64> {
        let mut inlet =
            json!({"name": "in", "face": "x_min", "condition": {"pressure": {"value": 0.32}}});
        if !patch.is_null() {
            inlet["patch"] = patch.clone();
        }
        let case = json!({
            "domain": {"size": [0.029, 0.015], "spacing": 5e-4},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": viscosity,
                "relaxation_time": 0.51, "boundaries": [
                    inlet, {"name": "out", "face": face, "condition": {"pressure": {"value": 0}}}]}},
            "time": {"end": 100}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let flow = plan.scene.flow.as_ref().unwrap();
        speed(&plan.scene, flow).map(|Speed { value, .. }| value)
    }

    #[test]
    fn water_from_a_smaller_opening_is_faster_by_the_ratio_of_the_areas() {
        let patch = json!({"from": [0, 0.0065], "to": [0.029, 0.011]});
        let bernoulli = (2.0 * 0.32 / 1000.0_f64).sqrt();
        let to_the_side = estimate(&patch, "y_max", 1e-6).unwrap();
        approx::assert_relative_eq!(to_the_side, bernoulli * 58.0 / 9.0, max_relative = 1e-9);
        let ahead = estimate(&patch, "x_max", 1e-6).unwrap();
        approx::assert_relative_eq!(ahead, bernoulli * 30.0 / 9.0, max_relative = 1e-9);
        // Between plates over the whole length, all of whose discharge passes through the patch.
        let viscous = 0.32 * 0.015_f64.powi(2) / (8.0 * 1000.0 * 1e-4 * 0.029) * 30.0 / 9.0;
        let slow = estimate(&patch, "x_max", 1e-4).unwrap();
        approx::assert_relative_eq!(slow, viscous, max_relative = 1e-9);
        // Openings of one size have no jet.
        assert_eq!(estimate(&Value::Null, "x_max", 1e-6), None);
    }
}
