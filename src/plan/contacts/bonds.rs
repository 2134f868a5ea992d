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

/// Difference between the distance of two surfaces and the bonding gap, in smaller radii, below which rounding of the
/// coordinates decides whether they are bonded.
const ROUNDING: f64 = 1e-9;

/// Pairs of grains, and of grains and walls, at the start.
#[derive(Default)]
struct Pairs {
    /// Number of pairs that are bonded.
    bonded: usize,
    /// Number of pairs that are bonded or not by the last digits of their coordinates.
    undecided: usize,
}

impl Pairs {
    /// Adds a pair whose surfaces are `gap` \[m\] beyond the distance up to which they are bonded.
    fn add(&mut self, gap: f64, radius: f64) {
        self.bonded += usize::from(gap < 0.0);
        self.undecided += usize::from(gap.abs() <= ROUNDING * radius);
    }
}

/// Warns if the grains of a list or a file are to be bonded, but none touches another grain or a wall, or if the
/// rounding of coordinates decides about bonds.
pub(super) fn check_bonds(scene: &Scene, law: &dyn ContactModel, findings: &mut Findings) {
    let source = scene.grains.as_ref().map(|grains| &grains.source);
    let Some(GrainSource::List(list) | GrainSource::File { grains: list, .. }) = source else {
        return;
    };
    let found = pairs_at_start(scene, list, law.bonding_gap());
    let remedy = "let neighbours overlap slightly, such as by 1e-6 of a diameter, or use contact_bond with a \
                  bonding_gap";
    if found.undecided > 0 {
        findings.warn(
            "grains.bond_at_start",
            format!(
                "{} contacts touch within rounding, to {ROUNDING:e} of a radius: the last digit of the coordinates \
                 decides whether they are bonded",
                found.undecided
            ),
            remedy,
        );
    } else if found.bonded == 0 && !list.is_empty() {
        findings.warn(
            "grains.bond_at_start",
            "no grain overlaps another at the start, so that no bond can be made",
            remedy,
        );
    }
}

/// Returns the pairs of grains, and of grains and walls, that are bonded up to `gap` \[m\].
fn pairs_at_start(scene: &Scene, list: &[ListedGrain], gap: f64) -> Pairs {
    let mut found = Pairs::default();
    let cuts = scene.grains.as_ref().map_or(&[][..], |grains| &grains.cut);
    let list: Vec<&ListedGrain> = list
        .iter()
        .filter(|grain| {
            let mut cuts = cuts.iter();
            !cuts.any(|(_, cut)| cut.touches(grain.position, grain.radius))
        })
        .collect();
    // Walls of the preparation are there as well.
    let at_start = |wall: &&SceneWall| wall.from.is_none_or(|from| from <= 0.0);
    for grain in &list {
        for wall in scene.walls.iter().filter(at_start) {
            let at = Vector3::from(grain.position);
            let away = wall.surface.as_ref().map_or_else(
                || Vector3::from(wall.normal).dot(&(at - Vector3::from(wall.point))),
                |surface| surface.clearance(&at),
            );
            found.add(away - grain.radius - gap, grain.radius);
        }
    }
    let reach = |grain: &ListedGrain| grain.radius + 0.5 * gap;
    let balls: Vec<Ball> = list
        .iter()
        .map(|grain| Ball {
            at: grain.position,
            reach: (1.0 + ROUNDING) * reach(grain),
        })
        .collect();
    let grid = &scene.grid;
    let period = std::array::from_fn(|a| grid.periodic[a].then(|| grid.size[a]));
    let _ = pairs::near(&balls, period, |one, other| {
        let squared: f64 = (0..grid.dimension)
            .map(|a| {
                let apart = list[one].position[a] - list[other].position[a];
                let turns = period[a].map_or(0.0, |length| length * (apart / length).round());
                (apart - turns).powi(2)
            })
            .sum();
        let [one, other] = [list[one], list[other]];
        let gap = squared.sqrt() - reach(one) - reach(other);
        found.add(gap, one.radius.min(other.radius));
        ControlFlow::Continue(())
    });
    found
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use std::path::Path;

    /// Returns the warning of the plan about bonds, for two grains of 1 mm with this distance of their centres \[m\].
    fn warns(apart: f64) -> Option<String> {
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
        let mut warnings = plan.warnings.into_iter();
        let found = warnings.find(|problem| problem.path == "grains.bond_at_start")?;
        Some(found.reason)
    }

    #[test]
    fn grains_that_do_not_overlap_are_not_bonded() {
        assert_eq!(warns(0.001_999), None);
        assert!(warns(0.002_001).unwrap().contains("no grain overlaps"));
    }

    /// Checks distances that differ from a contact by rounding, to either side.
    #[test]
    fn contacts_that_touch_within_rounding_are_counted() {
        for apart in [0.002, 0.002 + 1e-15, 0.002 - 1e-15] {
            let found = warns(apart).unwrap();
            assert!(
                found.starts_with("1 contacts touch within rounding"),
                "{found}"
            );
        }
        assert_eq!(warns(0.002 - 1e-10), None);
    }
}
