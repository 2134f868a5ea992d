//! A stream down a slope: the weight of its water drives it, and it exerts a force down the slope on bodies in it.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::Document;
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use std::path::Path;

/// Returns a viscous liquid, 8 cells deep, on a slope of 3 degrees around a cube of 3 cells on the bed.
fn stream(gravity_acts: &Value) -> Value {
    json!({
        "domain": {"size": [0.2, 0.08, 0.08], "spacing": 0.01, "periodic": ["x", "y"]},
        "gravity": [0.513_416, 0, -9.796_556],
        "materials": {"rock": {"density": 2600}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 0.01, "relaxation_time": 1,
            "gravity_acts_on_fluid": gravity_acts,
            "boundaries": [{"name": "surface", "face": "z_max", "condition": {"free_slip": {}}}]
        }},
        "bodies": [{
            "name": "cube", "shape": {"cuboid": {"edges": [0.03, 0.03, 0.03]}}, "position": [0.1, 0.04, 0.015],
            "motion": {"fixed": {}}, "material": "rock"
        }],
        "coupling": {"partially_saturated": {}},
        "time": {"end": 4},
        "probes": [
            {"name": "cube", "every": 0.5, "at": {"body": {"name": "cube"}}},
            {"name": "bed", "every": 0.5, "at": {"wall": {"face": "z_min"}}}
        ]
    })
}

/// Returns the values of a column of a table of a run.
pub(crate) fn column(study: &Study, run: &str, table: &str, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(study.path(run).join(table)).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let place = lines.next().unwrap().split(',').position(|n| n == name);
    let place = place.unwrap_or_else(|| panic!("{table} has no {name}"));
    lines
        .map(|line| line.split(',').nth(place).unwrap().parse().unwrap())
        .collect()
}

fn problems(case: &Value) -> Vec<Problem> {
    match Document::read(&case.to_string(), &[], Path::new("")).and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

#[test]
fn the_weight_of_a_stream_is_borne_by_its_bed_and_what_stands_in_it() {
    let _beside = beside_others();
    // The automatic choice, and the same choice stated.
    for acts in [json!("auto"), json!("along_periodic_axes")] {
        let study = Study::new(&stream(&acts).to_string());
        study.run("run", 1, 1, &[]).expect(0);
        let last = |table: &str, name: &str| *column(&study, "run", table, name).last().unwrap();
        let (cube, bed) = (
            last("probe_cube.csv", "fluid_force_x"),
            last("probe_bed.csv", "force_x"),
        );
        let water = 0.2 * 0.08 * 0.08 - 0.03_f64.powi(3);
        let weight = 1000.0 * 0.513_416 * water;
        println!("cube {cube} N, bed {bed} N, weight along the slope {weight} N");
        assert!(
            cube > 0.05 * weight,
            "the stream pushes the cube down: {cube}"
        );
        assert!(
            (cube + bed - weight).abs() < 1e-3 * weight,
            "{cube} + {bed} N, not {weight}"
        );
        // Normal to the slope, the lattice contains the excess over hydrostatic pressure, and the cube has its
        // buoyancy.
        let lift = last("probe_cube.csv", "fluid_force_z");
        let buoyancy = 1000.0 * 9.796_556 * 0.03_f64.powi(3);
        assert!(
            (lift - buoyancy).abs() < 0.1 * buoyancy,
            "{lift} {buoyancy}"
        );
    }
}

#[test]
fn the_stream_of_the_example_pushes_its_blocks_down_the_slope() {
    let _beside = beside_others();
    let study = Study::from_example("incline", &[("time.end", "0.1"), ("output", "{}")]);
    study.run("run", 1, 1, &[]).expect(0);
    let ways = ["rough", "smooth"].map(|block| {
        let table = format!("probe_{block}.csv");
        let force = column(&study, "run", &table, "fluid_force_x");
        println!("{block}: {force:?} N");
        assert!(force[1..].iter().sum::<f64>() > 0.0, "{block}: {force:?}");
        column(&study, "run", &table, "x").last().unwrap() - 0.1
    });
    // The rough cube slides too: dry it would not, because tan 40 is more than tan 30.
    assert!(ways[1] > ways[0] && ways[0] > 0.01, "{ways:?}");
}

#[test]
fn the_weight_of_the_water_counts_once() {
    let path = "fluid.lattice_boltzmann.gravity_acts_on_fluid";
    let found = problems(&stream(&json!(false)));
    let told = found.iter().find(|p| p.path == path).unwrap();
    assert_eq!(told.severity, Severity::Warning);
    assert!(told.reason.contains("surface `surface`") && told.reason.contains("along x"));
    assert!(
        problems(&stream(&json!("auto")))
            .iter()
            .all(|p| p.path != path)
    );
    // In a closed conduit the walls can support the water.
    let mut conduit = stream(&json!(false));
    conduit["fluid"]["lattice_boltzmann"]["boundaries"] = json!([]);
    assert!(problems(&conduit).iter().all(|p| p.path != path));
    // The weight as a body force in addition to the full buoyancy, and in addition to gravity that acts.
    for (acts, why) in [
        (json!(false), "solids already receive the buoyancy"),
        (json!("auto"), "gravity already acts on the water"),
        (json!(true), "gravity already acts on the water"),
    ] {
        let mut twice = stream(&acts);
        twice["fluid"]["lattice_boltzmann"]["body_force"] = json!({"constant": [513.4, 0, 0]});
        let found = problems(&twice);
        let body = "fluid.lattice_boltzmann.body_force.constant";
        let told = found.iter().find(|p| p.path == body).unwrap();
        assert_eq!(told.severity, Severity::Error, "{acts}");
        assert!(told.reason.contains(why), "{}", told.reason);
        for set in told.remedy.proposal() {
            let key = set.path.rsplit('.').next().unwrap();
            twice["fluid"]["lattice_boltzmann"][key] = set.value.clone();
        }
        let found = problems(&twice);
        assert!(found.iter().all(|p| p.path != body), "{found:#?}");
    }
}

/// Returns a box of stationary water, with planes over its whole section at which its largest speed is measured, and a
/// structure on the lattice planes.
fn box_of_water(size: &[f64], operator: &str, boundaries: Value) -> Value {
    let up = size.len() - 1;
    let axis = ["x", "y", "z"][up];
    let spacing = 0.01;
    let mut gravity = vec![0.0; size.len()];
    gravity[up] = -9.81;
    let (mut from, mut to) = (vec![0.03; size.len()], vec![0.06; size.len()]);
    (from[up], to[up]) = (0.02, 0.05);
    let planes = (1..10).map(|n| {
        let position = 0.01 * f64::from(n) - 0.005;
        json!({"name": format!("p{n}"), "every": 0.1, "at": {"plane": {"axis": axis, "position": position}}})
    });
    json!({
        "domain": {"size": size, "spacing": spacing},
        "gravity": gravity,
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 0.01, "time_step": 1e-4, "collision": {operator: {}},
            "gravity_acts_on_fluid": true, "boundaries": boundaries
        }},
        "structures": [{"name": "step", "shape": {"box": {"from": from, "to": to}}}],
        "probes": planes.collect::<Vec<_>>(),
        "time": {"end": 0.1}
    })
}

#[test]
fn still_water_under_its_weight_stays_at_rest() {
    let _beside = beside_others();
    let (flat, space) = ([0.1, 0.1], [0.08, 0.08, 0.1]);
    let top = |value: f64| {
        json!([{"name": "top", "face": "y_max", "condition": {"pressure": {"value": value,
        "sound": "reflect"}}}])
    };
    let both = json!([
        {"name": "left", "face": "z_max", "patch": {"from": [0, 0, 0.1], "to": [0.03, 0.08, 0.1]},
            "condition": {"pressure": {"value": 50}}},
        {"name": "right", "face": "z_max", "patch": {"from": [0.05, 0, 0.1], "to": [0.08, 0.08, 0.1]},
            "condition": {"pressure": {"value": 50}}}
    ]);
    let scenes = [
        (&flat[..], "trt", json!([])),
        (&flat[..], "bgk", top(0.0)),
        (&flat[..], "trt", top(100.0)),
        (&space[..], "trt", both.clone()),
        (&space[..], "cumulant", json!([])),
        (&space[..], "cumulant", both),
    ];
    for (size, operator, boundaries) in scenes {
        let case = box_of_water(size, operator, boundaries.clone());
        let study = Study::new(&case.to_string());
        study.run("run", 2, 1, &[]);
        let mut fastest = 0.0_f64;
        for n in 1..10 {
            let speeds = column(&study, "run", &format!("probe_p{n}.csv"), "largest_speed");
            fastest = fastest.max(speeds.into_iter().fold(0.0, f64::max));
        }
        println!(
            "{operator} in {} axes, {boundaries}: {fastest} m/s",
            size.len()
        );
        assert!(fastest < 1e-10, "{operator} {boundaries}: {fastest} m/s");
        // The initial state stated in the case is used.
        let uniform = "fluid.lattice_boltzmann.initial={\"uniform\": [0, 0]}".replace(
            "[0, 0]",
            if size.len() == 2 {
                "[0, 0]"
            } else {
                "[0, 0, 0]"
            },
        );
        study.run(
            "uniform",
            2,
            1,
            &[&uniform, "time.end=0.01", "probes[4].every=0.01"],
        );
        let rings = column(&study, "uniform", "probe_p5.csv", "largest_speed");
        assert!(rings.iter().any(|u| *u > 1e-5), "{rings:?}");
    }
}

/// Returns the mirror image of a point in a domain of this length.
fn reflect(mirrored: bool, length: f64, x: f64) -> f64 {
    if mirrored { length - x } else { x }
}

/// Returns ground below a weir with a face of 1:1 through the centres of the parts into which cells are divided.
fn weir(mirrored: bool) -> Value {
    let corners = [[4.0, 4.0], [6.03, 1.97], [8.0, 1.97], [8.0, 4.0]];
    let patch = |from: f64, to: f64| {
        let ends = [from, to].map(|x| reflect(mirrored, 14.0, x));
        json!({"from": [ends[0].min(ends[1]), 4], "to": [ends[0].max(ends[1]), 4]})
    };
    json!({
        "domain": {"size": [14, 4], "spacing": 0.2}, "gravity": [0, -9.81],
        "materials": {"stone": {}},
        "fluid": {"darcy": {"density": 1000, "viscosity": 1e-3,
            "zones": [{"name": "earth", "permeability": {"hydraulic_conductivity": 1e-5}}],
            "boundaries": [
                {"name": "basin", "face": "y_max", "patch": patch(0.0, 4.0), "condition": {"head": {"value": 6}}},
                {"name": "river", "face": "y_max", "patch": patch(8.0, 14.0), "condition": {"head": {"value": 4}}}
            ]}},
        "structures": [{"name": "weir", "material": "stone",
            "shape": {"polygon": {"points": corners.map(|[x, y]| [reflect(mirrored, 14.0, x), y])}}}],
        "time": {"end": 1, "solid_time_step": 0.01},
        "probes": [{"name": "flow", "every": 1, "at": {"section": {"axis": "x", "position": 7}}}]
    })
}

/// Returns a channel around a wedge whose faces of 1:1 pass through the centres of cells, driven to either side.
fn wedge(mirrored: bool) -> Value {
    let corners = [[0.07, 0.0], [0.113, 0.043], [0.113, 0.0]];
    let drive = if mirrored { -8 } else { 8 };
    json!({
        "domain": {"size": [0.2, 0.1], "spacing": 0.01, "periodic": ["x"]},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 0.01, "relaxation_time": 0.8,
            "body_force": {"constant": [drive, 0]}}},
        "structures": [{"name": "wedge",
            "shape": {"polygon": {"points": corners.map(|[x, y]| [reflect(mirrored, 0.2, x), y])}}}],
        "time": {"end": 1},
        "probes": [{"name": "flow", "every": 1, "at": {"structure": {"name": "wedge"}}}]
    })
}

/// Checks that slopes that pass exactly through centres are decided alike in mirror images: by the side of the solid,
/// not by the rounding of coordinates.
#[test]
fn a_slope_through_centres_of_cells_is_that_of_its_mirror_image() {
    let _beside = beside_others();
    for (name, case, heading) in [
        ("weir", weir as fn(bool) -> Value, "discharge"),
        ("wedge", wedge, "fluid_force_x"),
    ] {
        let [one, other] = [false, true].map(|mirrored| {
            let study = Study::new(&case(mirrored).to_string());
            study.run("run", 1, 1, &[]).expect(0);
            let text = std::fs::read_to_string(study.path("run/probe_flow.csv")).unwrap();
            let heads = text.lines().find(|line| !line.starts_with('#')).unwrap();
            let found = heads.split(',').find(|head| head.starts_with(heading));
            let found = found.unwrap_or_else(|| panic!("{heading} in {heads}"));
            *column(&study, "run", "probe_flow.csv", found)
                .last()
                .unwrap()
        });
        assert!(
            (one + other).abs() < 1e-7 * one.abs(),
            "{name}: {one} {other}"
        );
    }
}
