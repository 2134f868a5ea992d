//! Floating bodies that leave through an opening of water with a free surface.
//!
//! A body that is partly outside the domain meets no water there. Below a level the water inside then pushes it out and
//! no water outside resists; it sinks, leaves at several times the speed of the stream, and the water closes behind it
//! in few steps. `benches/stability/leaving.csv` has logs of 4 and 7 cells in streams of 0.1 and 0.3 m/s: all runs with
//! a level ended, and some with an outfall, over whose brink the log falls with the water.
//!
//! The stream carries a floating body to the opening with the largest imposed speed, or with the speed that it has at
//! the start. Where no speed is imposed, or a body is heavier than the water, nothing is reported.

use crate::scene::Scene;
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::boundaries::ScenePatch;
use crate::scene::findings::{Findings, at_most, number};
use crate::scene::flow::Flow;
use crate::scene::free_surface::{FreeSurface, Opening};
use crate::scene::speed::imposed_on_fluid;
use base::error::Remedy;
use base::vector::norm;

/// Failed runs and all runs of the table with a level and with an outfall.
const WITH_LEVEL: [u32; 2] = [16, 16];
const WITH_OUTFALL: [u32; 2] = [3, 16];

/// Reports the first floating body that a stream carries to an opening through which water leaves.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let (Some(flow), Some(surface)) = (&scene.flow, &scene.surface) else {
        return;
    };
    let floats = |body: &NamedBody| {
        body.mobility == Mobility::Free && scene.density(body.material) < flow.density
    };
    for body in scene.bodies.iter().filter(|body| floats(body)) {
        let speed = speed(flow, surface, body);
        for opening in surface.openings.iter().filter(|one| one.lowest.is_some()) {
            let mut patches = flow.patches();
            let Some(patch) = patches.find(|patch| patch.name == opening.name) else {
                continue;
            };
            let Some(way) = way(scene, surface, body, patch) else {
                continue;
            };
            let time = way / speed;
            if speed > 0.0 && time < scene.time.end {
                report(body, opening, [speed, way, time], findings);
                return;
            }
        }
    }
}

/// Returns the largest speed of the stream at the start and at the inlets, and of the body at the start [m/s].
fn speed(flow: &Flow, surface: &FreeSurface, body: &NamedBody) -> f64 {
    let imposed = imposed_on_fluid(flow).into_iter().map(|speed| speed.value);
    let inlets = surface.openings.iter().filter_map(|inlet| {
        let (froude, depth) = (inlet.froude?, inlet.depth?);
        Some(froude * (surface.gravity * depth).sqrt())
    });
    imposed.chain(inlets).fold(norm(body.velocity), f64::max)
}

/// Returns the distance between a body and a lateral opening as wide as itself, 0 if they touch \[m\]; none if the
/// opening is on another face, or the body does not meet it.
fn way(scene: &Scene, surface: &FreeSurface, body: &NamedBody, patch: &ScenePatch) -> Option<f64> {
    let (grid, axis) = (&scene.grid, patch.face.axis());
    if axis == surface.axis {
        return None;
    }
    let beside = (0..grid.dimension)
        .filter(|a| *a != axis && *a != surface.axis)
        .any(|a| {
            let [low, high] = patch.ends[a].map(|end| end * grid.spacing);
            body.position[a] + body.radius < low || body.position[a] - body.radius > high
        });
    let face = if patch.face.is_max() {
        grid.size[axis]
    } else {
        0.0
    };
    let way = (face - body.position[axis]).abs() - body.radius;
    (!beside).then_some(way.max(0.0))
}

/// Reports a body that a stream carries to an opening with a speed [m/s], over a way \[m\] and in a time \[s\].
fn report(
    body: &NamedBody,
    opening: &Opening,
    [speed, way, time]: [f64; 3],
    findings: &mut Findings,
) {
    let (has_level, path) = (opening.levels().is_some(), "time.end");
    let [failed, all] = if has_level { WITH_LEVEL } else { WITH_OUTFALL };
    let reason = format!(
        "the body `{}` floats, and a stream of {} m/s carries it over {} m to the opening `{}` within {} s: outside \
         the domain no water acts on it, and of the runs of `benches/stability/leaving.csv` with such an opening \
         {failed} of {all} ended when the body left",
        body.name,
        number(speed),
        number(way),
        opening.name,
        number(time)
    );
    let end = at_most(time);
    let text = format!(
        "end the run at {} s or before, or make the domain longer",
        number(end)
    );
    if has_level {
        let remedy = Remedy::from(text);
        let remedy = if end > 0.0 {
            remedy.set(path, end)
        } else {
            remedy
        };
        findings.unstable(path, reason, remedy);
    } else {
        findings.warn(path, reason, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use serde_json::json;
    use std::path::Path;

    /// Returns the severity of the finding on a log in a stream of 0.3 m/s, 0.23 m in front of an opening.
    fn found(condition: &str, set: &[&str]) -> Option<Severity> {
        let value = if condition == "level" {
            json!({"value": 0.2})
        } else {
            json!({})
        };
        let case = json!({
            "domain": {"size": [0.8, 0.32], "spacing": 0.01},
            "gravity": [0, -9.81],
            "materials": {"wood": {"density": 500}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-5, "time_step": 3e-4,
                "surface": {"water": [{"level": 0.2}]},
                "initial": {"uniform": {"velocity": [0.3, 0]}},
                "boundaries": [
                    {"name": "in", "face": "x_min", "patch": {"from": [0, 0], "to": [0, 0.2]},
                     "condition": {"velocity": {"profile": {"uniform": [0.3, 0]}}}},
                    {"name": "out", "face": "x_max", "condition": {condition: value}}],
                "collision": {"bgk": {}}, "turbulence": {"smagorinsky": {}}}},
            "bodies": [{"name": "log", "shape": {"disc": {"radius": 0.07}}, "position": [0.5, 0.2],
                        "motion": {"free": {}}, "material": "wood"}],
            "coupling": {"partially_saturated": {}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
            "time": {"end": 2}
        });
        let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
        let document = Document::read(&case.to_string(), &set, Path::new(".")).unwrap();
        let mut warnings = Plan::prepare(document).unwrap().warnings.into_iter();
        let found = warnings.find(|p| p.reason.contains("leaving.csv"))?;
        if condition == "level" {
            // The way is 0.23 m.
            let end = found.remedy.proposal()[0].value.as_f64().unwrap();
            assert!((0.76..=0.23 / 0.3).contains(&end), "{end}");
        }
        Some(found.severity)
    }

    /// Checks that only what floats and reaches an opening before the end is named.
    #[test]
    fn a_log_that_leaves_with_the_stream_is_named() {
        assert_eq!(found("level", &[]), Some(Severity::Unstable));
        assert_eq!(found("outfall", &[]), Some(Severity::Warning));
        for held in ["time.end=0.7", "materials.wood.density=2500"] {
            assert_eq!(found("level", &[held]), None, "{held}");
        }
    }

    /// Checks the numbers of runs against the table.
    #[test]
    fn counts_of_runs_are_those_of_the_table() {
        let table = include_str!("../../benches/stability/leaving.csv");
        let count = |opening: &str, failed: bool| {
            let rows = table
                .lines()
                .filter(|row| row.split(',').nth(2) == Some(opening));
            rows.filter(|row| !failed || row.ends_with(",failed"))
                .count()
        };
        for (opening, runs) in [("level", WITH_LEVEL), ("outfall", WITH_OUTFALL)] {
            let counted = [count(opening, true), count(opening, false)];
            assert_eq!(counted, runs.map(|n| n as usize), "{opening}");
        }
    }
}
