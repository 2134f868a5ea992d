//! What the plan says of openings whose ends lie between the faces of cells, of grains that nothing stops, and of packed spheres.

use serde_json::{Value, json};
use solver::case::Document;
use solver::case::coupling::Coupling;
use solver::plan::Plan;
use std::path::Path;

fn plan(case: &Value) -> Plan {
    let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
    Plan::prepare(document).unwrap()
}

fn warned(plan: &Plan, words: &str) -> bool {
    plan.warnings.iter().any(|w| w.to_string().contains(words))
}

#[test]
fn an_opening_that_cells_move_is_named() {
    let pool = |from: f64, to: f64| {
        json!({
            "domain": {"size": [0.4, 0.16], "spacing": 0.004},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-3, "reference_velocity": 1.5, "lattice_velocity": 0.05,
                "boundaries": [
                    {"name": "jet", "face": "y_max", "patch": {"from": [from, 0], "to": [to, 0.16]}, "condition": {"velocity": {"profile": {"uniform": [0, -1.5]}}}},
                    {"name": "side", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
            "time": {"end": 0.1}
        })
    };
    let between = plan(&pool(0.19, 0.21));
    assert!(warned(
        &between,
        "`jet` is as wide as its cells: along x it reaches from 0.188 to 0.208 m instead of from 0.19 to 0.21 m"
    ));
    let on_faces = plan(&pool(0.188, 0.212));
    assert!(!warned(&on_faces, "as wide as its cells"));
}

fn flume(more: &[(&str, Value)]) -> Value {
    let mut case = json!({
        "domain": {"size": [0.04, 0.02, 0.024], "spacing": 5e-4, "periodic": ["x", "y"]},
        "gravity": [0, 0, -9.81],
        "materials": {"glass": {"density": 2500}, "wall": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1100, "kinematic_viscosity": 2e-5, "body_force": {"constant": [30, 0, 0]},
            "boundaries": [{"name": "surface", "face": "z_max", "condition": {"free_slip": {}}}]}},
        "grains": {"material": "glass", "initial": {"deposition": {
            "number": 300, "grading": {"by_count": [{"min": 1.425e-3, "max": 1.575e-3, "fraction": 1}]},
            "box": {"from": [0, 0, 0], "to": [0.04, 0.02, 0.024]}}}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1000}, "friction_angle_degrees": 25}},
        "box_walls": ["z_min"], "box_wall_material": "wall",
        "time": {"end": 0.1}
    });
    for (field, value) in more {
        case[field] = value.clone();
    }
    case
}

#[test]
fn grains_without_a_floor_are_named_with_the_face() {
    assert!(!warned(&plan(&flume(&[])), "where nothing stops them"));
    let bottomless = plan(&flume(&[("box_walls", json!([]))]));
    let warning = bottomless
        .warnings
        .iter()
        .find(|w| w.path == "box_walls")
        .unwrap();
    assert!(
        warning
            .reason
            .contains("gravity pulls the grains through z_min"),
        "{warning}"
    );
    let proposal = format!("{:?}", warning.remedy.proposal());
    assert!(
        proposal.contains("box_walls") && proposal.contains("z_min"),
        "{proposal}"
    );
}

/// Links lose mass in the pores of a bed: 1.4e-7 of it a step in this flume, where partially saturated cells lose nothing.
#[test]
fn spheres_that_fall_into_a_bed_are_partially_saturated_unless_the_case_says_otherwise() {
    let coupling = |case: &Value| plan(case).scene.coupling;
    let bed = coupling(&flume(&[]));
    assert!(
        matches!(bed, Some(Coupling::PartiallySaturated(_))),
        "{bed:?}"
    );
    let asked = coupling(&flume(&[("coupling", json!({"bounce_back": {}}))]));
    assert!(matches!(asked, Some(Coupling::BounceBack(_))), "{asked:?}");
    let few = json!({"material": "glass", "initial": {"list": [{"position": [0.02, 0.01, 0.012], "radius": 2e-3}]}});
    let alone = coupling(&flume(&[("grains", few)]));
    assert!(matches!(alone, Some(Coupling::BounceBack(_))), "{alone:?}");
}
