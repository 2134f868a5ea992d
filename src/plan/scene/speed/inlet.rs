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
    let PressureDifference { value, path, axis } = pressure_difference(flow)?;
    let grid = &scene.grid;
    let largest = |patch: &ScenePatch| {
        let model = patch.condition.model();
        let imposed = model.pressure().map(|pressure| pressure.range()[1]);
        imposed.or(model.pressure_floats().then_some(0.0))
    };
    let openings = || flow.patches().filter_map(|one| Some((one, largest(one)?)));
    let highest = openings()
        .map(|(_, pressure)| pressure)
        .fold(f64::NEG_INFINITY, f64::max);
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

/// Returns the distance between two openings \[m\].
fn distance(scene: &Scene, one: &ScenePatch, other: &ScenePatch) -> f64 {
    let grid = &scene.grid;
    let ends = |patch: &ScenePatch, a: usize| {
        if a != patch.face.axis() {
            return patch.ends[a].map(|end| end * grid.spacing);
        }
        let at = if patch.face.is_max() {
            grid.size[a]
        } else {
            0.0
        };
        [at; 2]
    };
    let gap = |a: usize| {
        let ([low, high], [from, to]) = (ends(one, a), ends(other, a));
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
