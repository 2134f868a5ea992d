//! Forces in the tables of probes belong to the time of their row.

use crate::ranks::{Study, beside_others};
use serde_json::json;
use std::f64::consts::TAU;

/// Returns two columns of a table.
fn columns(text: &str, names: [&str; 2]) -> Vec<[f64; 2]> {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let places = names.map(|name| head.iter().position(|h| *h == name).unwrap());
    let value =
        |line: &str, place: usize| line.split(',').nth(place).unwrap().parse::<f64>().unwrap();
    lines
        .map(|line| places.map(|place| value(line, place)))
        .collect()
}

/// Checks a periodic channel under an oscillating force, in which the momentum changes by this force and by that of the
/// walls. At the time of a row of the walls the force is known, and the change of the momentum follows from the rows of
/// the discharge before and after.
#[test]
fn forces_on_walls_are_those_of_the_time_of_their_row() {
    let _beside = beside_others();
    let (length, height, density, step, period, amplitude) = (1e-3, 1e-3, 1000.0, 1e-3, 0.05, 0.3);
    let wall = |name: &str| json!({"name": name, "every": step, "at": {"wall": {"face": name}}});
    let case = json!({
        "domain": {"size": [length, height], "spacing": 1e-4, "periodic": ["x"]},
        "fluid": {"lattice_boltzmann": {
            "density": density, "kinematic_viscosity": 1e-6, "time_step": step,
            "body_force": {"oscillating": {"amplitude": [amplitude, 0], "period": period}}}},
        "time": {"end": 0.1},
        "probes": [wall("y_min"), wall("y_max"),
            {"name": "flow", "every": step, "at": {"plane": {"axis": "x", "position": 5e-4}}}]
    });
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    let table = |name: &str, column| {
        let path = study.path("one").join(format!("probe_{name}.csv"));
        columns(&std::fs::read_to_string(path).unwrap(), ["time", column])
    };
    let (low, high) = (table("y_min", "force_x"), table("y_max", "force_x"));
    let flow = table("flow", "discharge");
    assert!(low.len() > 90);
    for ([time, one], [_, other]) in low.iter().zip(&high) {
        let after = flow.iter().position(|[t, _]| t > time).unwrap();
        let [[t0, q0], [t1, q1]] = [flow[after - 1], flow[after]];
        let change = density * length * (q1 - q0) / (t1 - t0);
        let force = amplitude * (TAU * time / period).cos() * length * height;
        let off = one + other - (force - change);
        let scale = amplitude * length * height;
        assert!(off.abs() < 0.005 * scale, "{time}: {off} of {scale}");
    }
}

/// Checks that a uniform pressure acts alike on all faces of a box: along an edge each component of the force is that
/// on the face normal to it.
#[test]
fn a_uniform_pressure_acts_alike_on_all_faces() {
    let _beside = beside_others();
    let names = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
    let walls =
        names.map(|name| json!({"name": name, "every": 0.1, "at": {"wall": {"face": name}}}));
    let case = json!({
        "domain": {"size": [0.02, 0.016, 0.012], "spacing": 0.002},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
            "boundaries": [{"name": "slip", "face": "z_max", "condition": {"free_slip": {}}}],
            "initial": {"uniform": {"velocity": [0, 0, 0], "pressure": 5}}
        }},
        "time": {"end": 0.1},
        "probes": walls
    });
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    for name in names {
        let path = study.path("one").join(format!("probe_{name}.csv"));
        let text = std::fs::read_to_string(path).unwrap();
        let [_, pressure] = *columns(&text, ["time", "mean_pressure"]).last().unwrap();
        let [shear, _] = *columns(&text, ["shear_force", "time"]).last().unwrap();
        assert!((pressure - 5.0).abs() < 1e-9, "{name}: {pressure}");
        assert!(shear.abs() < 1e-12, "{name}: {shear}");
    }
}

/// Checks the same along the edge of two symmetry planes that crosses a periodic face, with the 27 velocities: those
/// that leave along the edge come from a cell beyond the periodic face.
#[test]
fn symmetry_planes_have_no_shear_at_a_periodic_face() {
    let _beside = beside_others();
    let names = ["y_min", "z_max"];
    let walls =
        names.map(|name| json!({"name": name, "every": 0.1, "at": {"wall": {"face": name}}}));
    let slip = names
        .map(|name| json!({"name": format!("slip_{name}"), "face": name, "condition": {"free_slip": {}}}));
    let case = json!({
        "domain": {"size": [0.02, 0.016, 0.012], "spacing": 0.002, "periodic": ["x"]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8, "lattice": "d3q27",
            "boundaries": slip,
            "initial": {"uniform": {"velocity": [0, 0, 0], "pressure": 5}}
        }},
        "time": {"end": 0.1},
        "probes": walls
    });
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    study.run("two", 2, 1, &["domain.split=x"]);
    for (run, name) in ["one", "two"]
        .iter()
        .flat_map(|run| names.map(|name| (run, name)))
    {
        let path = study.path(run).join(format!("probe_{name}.csv"));
        let text = std::fs::read_to_string(path).unwrap();
        let [shear, pressure] = *columns(&text, ["shear_force", "mean_pressure"])
            .last()
            .unwrap();
        assert!((pressure - 5.0).abs() < 1e-9, "{run} {name}: {pressure}");
        assert!(shear.abs() < 1e-12, "{run} {name}: {shear}");
    }
}

/// Checks that faces and a structure on a face hold the weight of the water at rest, and nothing of what the structure
/// contains: the body force acts in its cells too.
#[test]
fn faces_beside_a_structure_hold_the_weight_of_the_water() {
    let _beside = beside_others();
    let names = ["x_min", "x_max", "y_min", "y_max", "block"];
    let probes = names.map(|name| {
        let at = match name {
            "block" => json!({"structure": {"name": name}}),
            _ => json!({"wall": {"face": name}}),
        };
        json!({"name": name, "every": 0.5, "at": at})
    });
    for floor in ["no_slip", "free_slip"] {
        let case = json!({
            "domain": {"size": [0.02, 0.016], "spacing": 0.002},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
                "body_force": {"constant": [0, -20]},
                "boundaries": [{"name": "floor", "face": "y_min", "condition": {floor: {}}}]
            }},
            "structures": [
                {"name": "block", "shape": {"box": {"from": [-0.001, -0.001], "to": [0.008, 0.006]}}}],
            "time": {"end": 5},
            "probes": probes
        });
        let study = Study::new(&case.to_string());
        study.run("one", 1, 1, &[]);
        let force = |name: &str| {
            let path = study.path("one").join(format!("probe_{name}.csv"));
            let text = std::fs::read_to_string(path).unwrap();
            let column = if name == "block" {
                "fluid_force_y"
            } else {
                "force_y"
            };
            columns(&text, [column, "time"]).last().unwrap()[0]
        };
        let forces = names.map(force);
        // 80 cells of the box without 12 of the block.
        let weight = 20.0 * 68.0 * 0.002_f64.powi(2);
        let off = forces.iter().sum::<f64>() + weight;
        assert!(
            off.abs() < 1e-6 * weight,
            "{floor}: {off} of {weight}, {forces:?}"
        );
    }
}
