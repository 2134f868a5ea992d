//! Porous zones in a flow on a lattice: the law of resistance near bodies, cylinders of gravel, the same bits on any
//! ranks, and messages.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::Document;
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use std::path::Path;

/// Returns a duct along x of 16 x 8 x 8 cells of a millimetre between a velocity and a pressure, with a screen that
/// intersects cells and a cylinder of gravel.
fn duct(turbulence: &Value) -> Value {
    json!({
        "domain": {"size": [0.016, 0.008, 0.008], "spacing": 1e-3, "periodic": ["z"]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.505, "turbulence": turbulence,
            "porous_zones": [
                {
                    "name": "screen",
                    "shape": {"box": {"from": [0.0043, -1, -1], "to": [0.0057, 1, 1]}},
                    "resistance": {"darcy_forchheimer": {"inertial_coefficient": 1500}}
                },
                {
                    "name": "gravel",
                    "shape": {"cylinder": {"from": [0.01, 0.004, 0], "to": [0.01, 0.004, 0.008], "radius": 0.0026}},
                    "resistance": {"ergun": {"grain_diameter": 2e-3, "porosity": 0.45}}
                }
            ],
            "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [0.002, 0, 0]},
                    "ramp_time": 0.2}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
            ]
        }},
        "materials": {"steel": {"density": 7800}},
        "bodies": [{
            "name": "ball", "shape": {"sphere": {"radius": 0.0021}}, "position": [0.008, 0.004, 0.004],
            "motion": {"fixed": {}}, "material": "steel"
        }],
        "coupling": {"partially_saturated": {}},
        "probes": [
            {"name": "axis", "every": 0.05, "at": {"point": {"position": [0.0105, 0.004, 0.004]}}},
            {"name": "ball", "every": 0.05, "at": {"body": {"name": "ball"}}}
        ],
        "output": {"fluid": {"every": 0.2}},
        "checkpoint": {"every": 0.15},
        "time": {"end": 0.4}
    })
}

#[test]
fn zones_have_the_same_bits_on_any_ranks_and_threads_and_after_restarts() {
    let _beside = beside_others();
    for turbulence in [json!("none"), json!({"wale": {}})] {
        let study = Study::new(&duct(&turbulence).to_string());
        study.run("straight", 1, 1, &[]);
        let error = study.summary("straight")["momentum_error"].as_f64();
        assert!(error.is_some_and(|error| error < 1e-9), "{error:?}");
        study.same_on(&[
            ("threads", 1, 2, ""),
            ("two", 2, 1, ""),
            ("three along y", 3, 1, "domain.split=y"),
        ]);
        study.run("parts", 2, 1, &["time.end=0.22"]);
        study.restart("parts", 1, &["time.end=0.4"]).expect(0);
        study.same("straight", "parts");
    }
}

fn problems(case: &Value) -> Vec<Problem> {
    let read = Document::read(&case.to_string(), &[], Path::new("."));
    match read.and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

/// Returns a box filled with gravel of variable properties.
fn gravel(permeability: &Value, time_step: f64) -> Value {
    json!({
        "domain": {"size": [0.01, 0.01], "spacing": 1e-3, "periodic": ["x", "y"]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "time_step": time_step,
            "body_force": {"constant": [1, 0]},
            "porous_zones": [{
                "name": "gravel", "shape": {"box": {"from": [-1, -1], "to": [1, 1]}},
                "resistance": {"darcy_forchheimer": {"permeability": permeability}}
            }]
        }},
        "time": {"end": 1}
    })
}

#[test]
fn a_resistance_that_a_step_cannot_follow_is_refused_with_the_step_that_can() {
    // A time step of 2e-3 s removes 4 times the momentum at a permeability of 5e-10 m2.
    let found = problems(&gravel(&json!(5e-10), 2e-3));
    let refused: Vec<&Problem> = found
        .iter()
        .filter(|problem| problem.severity == Severity::Error)
        .collect();
    assert_eq!(refused.len(), 1, "{found:#?}");
    assert!(refused[0].reason.contains("4 times"), "{refused:#?}");
    let remedy = refused[0].remedy.to_string();
    assert!(
        remedy.contains("9.000e-4 s") && remedy.contains("fluid.darcy"),
        "{remedy}"
    );
    assert!(problems(&gravel(&json!(5e-10), 9e-4)).is_empty());
}

#[test]
fn a_zone_without_resistance_or_outside_the_domain_is_refused() {
    let found = problems(&gravel(&Value::Null, 2e-3));
    assert!(
        found
            .iter()
            .any(|p| p.reason.contains("does not resist the flow")),
        "{found:#?}"
    );
    let found = problems(&gravel(&json!(-1e-9), 2e-3));
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].path.ends_with("permeability"), "{found:#?}");
    let mut outside = gravel(&json!(1e-8), 2e-3);
    outside["domain"]["periodic"] = json!(["x"]);
    outside["fluid"]["lattice_boltzmann"]["porous_zones"][0]["shape"]["box"] =
        json!({"from": [0, 0.02], "to": [0.01, 0.03]});
    let found = problems(&outside);
    assert!(
        found
            .iter()
            .any(|p| p.reason.contains("outside the domain")),
        "{found:#?}"
    );
    for (field, value) in [
        ("porosity", 1.0),
        ("porosity", 0.0),
        ("grain_diameter", -1.0),
    ] {
        let mut bed = json!({"ergun": {"grain_diameter": 1e-3, "porosity": 0.4}});
        bed["ergun"][field] = json!(value);
        let mut case = gravel(&json!(1e-8), 2e-3);
        case["fluid"]["lattice_boltzmann"]["porous_zones"][0]["resistance"] = bed;
        let found = problems(&case);
        assert_eq!(found.len(), 1, "{field} {value}: {found:#?}");
        assert!(found[0].path.ends_with(field), "{found:#?}");
    }
}

/// Checks that the plan computes the speed from the zones that close the channel: u = G/(nu/K) per density.
#[test]
fn the_plan_knows_the_speed_that_a_zone_allows() {
    let mut case = gravel(&json!(1e-9), 2e-4);
    case["fluid"]["lattice_boltzmann"]["body_force"]["constant"] = json!([5000, 0]);
    // 5 m/s2 with 1000 1/s gives 5 mm/s; without the zone 5 m/s is reached within the run.
    let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
    let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
    let margin = plan
        .margins
        .iter()
        .find(|m| m.limit.starts_with("lattice velocity"));
    let value = margin.unwrap().value;
    approx::assert_relative_eq!(value, 5e-3 * 2e-4 / 1e-3, max_relative = 1e-6);
}
