//! Bonds of the grains at the start.

use crate::scene::Scene;
use crate::scene::findings::Findings;
use crate::scene::grains::GrainSource;
use crate::scene::pairs::{self, Ball};
use crate::scene::sample::ListedGrain;
use crate::scene::walls::SceneWall;
use dem::contact::ContactModel;
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// Warns if the grains of a list or a file are to be bonded, but none touches another grain or a wall.
pub(super) fn warn_without_bonds(scene: &Scene, law: &dyn ContactModel, findings: &mut Findings) {
    let source = scene.grains.as_ref().map(|grains| &grains.source);
    let Some(GrainSource::List(list) | GrainSource::File { grains: list, .. }) = source else {
        return;
    };
    let gap = law.bonding_gap();
    let reach = |grain: &ListedGrain| grain.radius + 0.5 * gap;
    let near = |wall: &SceneWall, grain: &ListedGrain| {
        let at = Vector3::from(grain.position);
        let away = wall.surface.as_ref().map_or_else(
            || Vector3::from(wall.normal).dot(&(at - Vector3::from(wall.point))),
            |surface| surface.clearance(&at),
        );
        away < grain.radius + gap
    };
    let held = list
        .iter()
        .any(|grain| scene.walls.iter().any(|wall| near(wall, grain)));
    let balls: Vec<Ball> = list
        .iter()
        .map(|grain| Ball {
            at: grain.position,
            reach: reach(grain),
        })
        .collect();
    let grid = &scene.grid;
    let period = std::array::from_fn(|a| grid.periodic[a].then(|| grid.size[a]));
    let bonded = pairs::near(&balls, period, |one, other| {
        let squared: f64 = (0..grid.dimension)
            .map(|a| {
                let apart = list[one].position[a] - list[other].position[a];
                let turns = period[a].map_or(0.0, |length| length * (apart / length).round());
                (apart - turns).powi(2)
            })
            .sum();
        if squared.sqrt() < reach(&list[one]) + reach(&list[other]) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    if !held && bonded.is_continue() && !list.is_empty() {
        findings.warn(
            "grains.bond_at_start",
            "no grain overlaps another at the start, so that no bond can be made",
            "let neighbours overlap slightly, such as by 1e-6 of a diameter, or use contact_bond with a \
             bonding_gap",
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use std::path::Path;

    /// Returns `true` if the plan warns that nothing is bonded, for two grains of 1 mm with this distance of their
    /// centres \[m\].
    fn warns(apart: f64) -> bool {
        let case = serde_json::json!({
            "domain": {"size": [0.02, 0.02, 0.02], "spacing": 0.002},
            "materials": {"sand": {"density": 2600}},
            "grains": {"material": "sand", "bond_at_start": true, "initial": {"list": [
                {"position": [0.008, 0.01, 0.01], "radius": 0.001},
                {"position": [0.008 + apart, 0.01, 0.01], "radius": 0.001}
            ]}},
            "contact": {"cohesive_frictional": {"normal_stiffness": {"absolute": 1e6},
                "cohesion": {"absolute": 0.5}, "friction_angle_degrees": 20}},
            "time": {"end": 1e-5}
        });
        let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        plan.warnings
            .iter()
            .any(|problem| problem.path == "grains.bond_at_start")
    }

    #[test]
    fn grains_that_do_not_overlap_are_not_bonded() {
        assert!(!warns(0.001_999));
        assert!(warns(0.002_001));
    }
}
