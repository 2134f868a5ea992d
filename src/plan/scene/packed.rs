//! Test for packed grains, with contacts on all sides as in a bed, and the density that they need for stability.

use super::Scene;
use super::grains::GrainSource;
use super::pairs::{Ball, near};
use super::sample::ListedGrain;
use case::coupling::{Coupling, SolidOperator};
use lbm::saturation::LightBody;
use std::ops::ControlFlow;

/// Maximum gap, in diameters, at which grains count as touching.
const GAP: f64 = 0.05;

/// Returns `true` for grains that grow or are deposited, and for those of a list or file if any grain touches half
/// as many others as in the densest packing.
pub(crate) fn lie_packed(scene: &Scene) -> bool {
    match scene.grains.as_ref().map(|grains| &grains.source) {
        Some(GrainSource::Growth { .. }) => true,
        Some(GrainSource::Deposition { clouds, .. }) => {
            clouds.iter().map(|cloud| cloud.number).sum::<usize>() > neighbours(scene)
        }
        Some(GrainSource::List(grains) | GrainSource::File { grains, .. }) => {
            any_amid(scene, grains)
        }
        None => false,
    }
}

/// Returns the density ratio above which packed grains of radius R in cells are stable; 0 if it was not measured,
/// as with links.
pub(crate) fn in_a_bed(
    coupling: &Coupling,
    operator: Option<SolidOperator>,
    tau: f64,
    flat: bool,
    radius: f64,
) -> f64 {
    match coupling {
        Coupling::PartiallySaturated(written) if written.exclude_inner_fluid => {
            let operator = operator.unwrap_or(SolidOperator::NonEquilibriumBounceBack);
            operator.model().lightest_in_a_bed(&LightBody {
                flat,
                radius,
                relaxation_time: tau,
            })
        }
        _ => 0.0,
    }
}

/// Returns half of the number of neighbours in the densest packing of discs or spheres.
fn neighbours(scene: &Scene) -> usize {
    if scene.grid.dimension == 2 { 3 } else { 6 }
}

fn any_amid(scene: &Scene, grains: &[ListedGrain]) -> bool {
    let balls: Vec<Ball> = grains
        .iter()
        .map(|grain| Ball {
            at: grain.position,
            reach: (1.0 + GAP) * grain.radius,
        })
        .collect();
    let grid = &scene.grid;
    let period = std::array::from_fn(|a| grid.periodic[a].then(|| grid.size[a]));
    let most = neighbours(scene);
    let mut counts = vec![0; balls.len()];
    near(&balls, period, |one, other| {
        for k in [one, other] {
            counts[k] += 1;
            if counts[k] >= most {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    })
    .is_break()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use base::error::Severity;
    use case::Document;
    use serde_json::json;
    use std::path::Path;

    /// Checks that no measured stability limit is above the larger of the bounds for a bed and for a single body.
    #[test]
    fn measured_beds_hold_where_the_bounds_say_so() {
        let table = include_str!("../../../benches/stability/dense_beds.csv");
        let lines = table.lines().filter(|line| !line.starts_with('#')).skip(1);
        let mut rows = 0;
        for line in lines {
            let fields: Vec<&str> = line.split(',').collect();
            let number = |n: usize| fields[n].parse::<f64>().unwrap();
            let written = json!({"partially_saturated": {"solid_operator": fields[0]}});
            let Coupling::PartiallySaturated(cells) = serde_json::from_value(written).unwrap()
            else {
                panic!("{line}")
            };
            let operator = cells.solid_operator.unwrap();
            let body = LightBody {
                flat: fields[1] == "2",
                radius: number(2),
                relaxation_time: number(3),
            };
            let model = operator.model();
            let alone = model.lightest(&body).holds;
            let bed = model.lightest_in_a_bed(&body);
            assert!(number(4) < bed.max(alone), "{line}: {bed} {alone}");
            // Stable beds of sand in water are not refused.
            assert!(bed < 1.3 * number(5).max(1.0), "{line}: {bed}");
            rows += 1;
        }
        assert_eq!(rows, 140);
    }

    /// Returns `true` if the plan warns of the added mass of a bed of 4 cells per diameter, with this density and
    /// relaxation time.
    fn warns(density: f64, tau: f64, initial: &serde_json::Value) -> bool {
        let case = json!({
            "domain": {"size": [0.016, 0.016, 0.032], "spacing": 1e-3, "periodic": ["x", "y"]},
            "gravity": [0, 0, -9.81],
            "materials": {"glass": {"density": density}, "wall": {}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": tau}},
            "grains": {"material": "glass", "initial": initial},
            "contact": {"linear": {"normal_stiffness": {"absolute": 100}}},
            "box_walls": ["z_min", "z_max"], "box_wall_material": "wall",
            "coupling": {"partially_saturated": {}},
            "time": {"end": 0.1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let problems = match Plan::prepare(document) {
            Ok(plan) => plan.warnings,
            Err(problems) => problems,
        };
        let wrong = problems.iter().find(|p| p.severity == Severity::Error);
        assert!(wrong.is_none(), "{wrong:?}");
        problems.iter().any(|p| p.path == "materials.glass.density")
    }

    /// Checks a bed of glass in water, which became unstable at tau = 1.5 and came to rest at 0.8; two separate
    /// grains are stable at both.
    #[test]
    fn a_bed_needs_denser_grains_than_a_grain_alone() {
        let bed = json!({"deposition": {
            "number": 50, "grading": {"by_count": [{"min": 0.002, "max": 0.002, "fraction": 1}]}, "seed": 1,
            "box": {"from": [0, 0, 0], "to": [0.016, 0.016, 0.032]}
        }});
        let two = json!({"list": [
            {"position": [0.004, 0.004, 0.004], "radius": 0.002},
            {"position": [0.012, 0.012, 0.02], "radius": 0.002}
        ]});
        assert_eq!(
            [(2500.0, 1.5), (2500.0, 0.8)].map(|(density, tau)| warns(density, tau, &bed)),
            [true, false]
        );
        assert_eq!(
            [(2500.0, 1.5), (2500.0, 0.8)].map(|(density, tau)| warns(density, tau, &two)),
            [false, false]
        );
    }

    /// Checks that six neighbours make a listed grain part of a bed: one of seven grains in a cross.
    #[test]
    fn listed_grains_are_packed_where_one_is_amid_others() {
        let arm = 0.0041;
        let cross = [
            [0.0, 0.0, 0.0],
            [arm, 0.0, 0.0],
            [-arm, 0.0, 0.0],
            [0.0, arm, 0.0],
            [0.0, -arm, 0.0],
            [0.0, 0.0, arm],
            [0.0, 0.0, -arm],
        ];
        let list = |count: usize| {
            let grains: Vec<_> = (cross.iter().take(count))
                .map(|at| json!({"position": [0.008 + at[0], 0.008 + at[1], 0.016 + at[2]], "radius": 0.002}))
                .collect();
            json!({ "list": grains })
        };
        assert_eq!(
            [6, 7].map(|count| warns(2500.0, 1.5, &list(count))),
            [false, true]
        );
    }
}
