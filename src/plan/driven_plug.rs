//! Driven discs and spheres that close the way of the water on their path.
//!
//! A body with links that fills a passage between structures and fixed bodies stops the water that an opening
//! imposes on one side of it. The density there grows until the run ends. In saturated cells the water passes the
//! cells that a body covers in part.

use crate::driven_path;
use crate::scene::Scene;
use crate::scene::blocked::{Obstacles, Ways};
use crate::scene::bodies::{Mobility, NamedBody};
use crate::scene::findings::{Findings, number};
use case::coupling::Coupling;

/// Number of parts of a path.
const PARTS: u32 = 64;

/// Reports the first driven disc or sphere that closes the way of imposed water.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(flow) = scene.flow.as_ref().filter(|_| scene.surface.is_none()) else {
        return;
    };
    let driven =
        |(_, body): &(usize, &NamedBody)| body.mobility == Mobility::Driven && body.solid.is_none();
    let links = matches!(scene.coupling, Some(Coupling::BounceBack(_)));
    let mut bodies = scene.bodies.iter().enumerate().filter(driven).peekable();
    let alone = scene.structures.is_empty() && scene.bodies.len() < 2;
    if !links || alone || bodies.peek().is_none() {
        return;
    }
    let solids = Obstacles {
        structures: &scene.structures,
        bodies: &scene.bodies,
        blocks: None,
    };
    let Some(ways) = Ways::new(flow, &scene.grid, &solids) else {
        return;
    };
    let step = scene.time.end / f64::from(PARTS);
    for (n, body) in bodies {
        let (mut change, mut first) = (0.0, None);
        for k in 0..PARTS {
            let way = driven_path::displacement(body, step * (f64::from(k) + 0.5));
            let at: [f64; 3] = std::array::from_fn(|a| body.position[a] + way * body.velocity[a]);
            if let Some((patch, rate)) = ways.closed_by(at, body.radius) {
                change += rate * step;
                first.get_or_insert((at, patch));
            }
        }
        let Some((at, patch)) = first.filter(|_| change > scene.guards.max_compression) else {
            continue;
        };
        let at: Vec<String> = at[..scene.grid.dimension]
            .iter()
            .map(|x| number(*x))
            .collect();
        findings.unstable(
            &format!("bodies[{n}].motion.driven.velocity"),
            format!(
                "the body `{}` closes the way of the water of `{}` at [{}] m, which changes its density by about {} %; \
                 the run stops at {} %",
                body.name,
                patch.name,
                at.join(", "),
                number(100.0 * change),
                number(100.0 * scene.guards.max_compression)
            ),
            "leave a gap of at least one cell on its path, or end its motion before",
        );
        return;
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns `true` if a disc of 2.6 cells is named that moves a number of cells towards a slot of a width
    /// \[cells\] between two structures of 8 cells, 9 cells in front of it.
    fn named(way: f64, slot: f64, coupling: &Value) -> bool {
        let h = 0.0005;
        let (low, high) = ((11.0 - 0.5 * slot) * h, (11.0 + 0.5 * slot) * h);
        let case = json!({
            "domain": {"size": [26.0 * h, 22.0 * h], "spacing": h},
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 2e-5, "relaxation_time": 0.6, "boundaries": [
                    {"name": "in", "face": "x_min", "condition": {"velocity": {
                        "profile": {"parabolic": {"peak": 0.01}}, "ramp_time": 0.1}}},
                    {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
            "structures": [
                {"name": "low", "shape": {"box": {"from": [9.0 * h, -h], "to": [17.0 * h, low]}}, "material": "glass"},
                {"name": "high", "shape": {"box": {"from": [9.0 * h, high], "to": [17.0 * h, 23.0 * h]}},
                 "material": "glass"}],
            "bodies": [{"name": "plug", "shape": {"disc": {"radius": 2.6 * h}}, "position": [4.0 * h, 11.0 * h],
                        "motion": {"driven": {"velocity": [way * h, 0]}}, "material": "glass"}],
            "coupling": coupling,
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let problems = match Plan::prepare(document) {
            Ok(plan) => plan.warnings,
            Err(problems) => problems,
        };
        problems
            .iter()
            .any(|p| p.reason.contains("closes the way of the water"))
    }

    #[test]
    fn a_driven_disc_that_fills_a_slot_is_named() {
        let links = json!({"bounce_back": {"scheme": "interpolated"}});
        assert!(named(8.0, 5.3, &links));
        assert!(!named(1.0, 5.3, &links));
        assert!(!named(8.0, 8.0, &links));
        assert!(!named(8.0, 5.3, &json!({"partially_saturated": {}})));
    }
}
