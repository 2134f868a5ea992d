//! Solids at planes of symmetry: their loads are half of those in a domain of twice the width, for bodies that cross
//! the plane and for blocks and structures that touch it, with saturated cells and with links.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};

/// Returns the last values of columns of a table of a run.
fn last<const N: usize>(study: &Study, file: &str, names: [&str; N]) -> [f64; N] {
    let text = std::fs::read_to_string(study.path(file)).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let heads: Vec<&str> = lines.next().unwrap().split(',').map(str::trim).collect();
    let row: Vec<f64> = lines
        .next_back()
        .unwrap()
        .split(',')
        .map(|value| value.trim().parse().unwrap())
        .collect();
    names.map(|name| {
        let found = heads
            .iter()
            .position(|head| head.split(' ').next() == Some(name));
        row[found.unwrap_or_else(|| panic!("{name} in {heads:?}"))]
    })
}

const SPACING: f64 = 0.01;
/// Width of the half domain.
const WIDTH: f64 = 0.08;

/// Returns a stream in a domain that is 0.08 m wide with a plane of symmetry, or 0.16 m without, with more parts; the
/// middle of the body is `above` the plane of symmetry.
fn stream(half: bool, above: f64, parts: &Value) -> Value {
    let width = if half { WIDTH } else { 2.0 * WIDTH };
    let mut case = json!({
        "domain": {"size": [0.2, width, 0.12], "spacing": SPACING, "periodic": ["x"]},
        "materials": {"stone": {"density": 2600}},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-3, "relaxation_time": 0.8,
            "body_force": {"constant": [20, 0, 0]}}},
        "time": {"end": 0.12}
    });
    if half {
        case["fluid"]["lattice_boltzmann"]["boundaries"] =
            json!([{"name": "middle", "face": "y_min", "condition": {"free_slip": {}}}]);
    }
    for (name, part) in parts.as_object().unwrap() {
        case[name] = part.clone();
    }
    let y = if half { above } else { WIDTH + above };
    if let Some(bodies) = case.get_mut("bodies") {
        bodies[0]["position"][1] = json!(y);
    }
    case
}

fn body(shape: &Value, motion: &Value) -> Value {
    json!([{"name": "stone", "shape": shape, "position": [0.087, 0, 0.052], "motion": motion, "material": "stone"}])
}

/// Checks force along the plane and moment about its normal: half of those on the whole body.
#[test]
fn half_a_body_at_a_plane_of_symmetry_has_half_the_load() {
    let _beside = beside_others();
    let turning = json!({"driven": {"velocity": [0.02, 0, 0.01], "angular_velocity": [0, 1.5, 0]}});
    let fixed = json!({"fixed": {}});
    let cuboid = |width: f64| json!({"cuboid": {"edges": [0.047, width, 0.036]}});
    let sphere = json!({"sphere": {"radius": 0.031}});
    // The whole body, and the half above the plane with the height of its middle.
    let bodies = [
        (body(&sphere, &fixed), body(&sphere, &fixed), 0.0),
        (body(&sphere, &turning), body(&sphere, &turning), 0.0),
        (
            body(&cuboid(0.06), &fixed),
            body(&cuboid(0.03), &fixed),
            0.015,
        ),
        (
            body(&cuboid(0.06), &turning),
            body(&cuboid(0.03), &turning),
            0.015,
        ),
    ];
    let couplings = [
        json!({"bounce_back": {"scheme": "half_way"}}),
        json!({"bounce_back": {"scheme": "interpolated"}}),
        json!({"partially_saturated": {}}),
    ];
    for coupling in &couplings {
        for (whole, half, above) in &bodies {
            let probes =
                json!([{"name": "load", "every": 0.04, "at": {"body": {"name": "stone"}}}]);
            let loads =
                [(true, half, *above), (false, whole, 0.0)].map(|(split, bodies, above)| {
                    let parts = json!({"bodies": bodies, "coupling": coupling, "probes": probes});
                    let study = Study::new(&stream(split, above, &parts).to_string());
                    study.run("run", 1, 1, &[]);
                    let error = study.summary("run")["guards"]["momentum_error"].as_f64();
                    assert!(
                        error.is_none_or(|error| error < 1e-9),
                        "{coupling} {error:?}"
                    );
                    let names = ["fluid_force_x", "fluid_force_z", "fluid_torque_y"];
                    last(&study, "run/probe_load.csv", names)
                });
            let size = loads[1].map(f64::abs);
            for k in 0..3 {
                let scale = if k < 2 { size[0].max(size[1]) } else { size[2] };
                let error = (2.0 * loads[0][k] - loads[1][k]).abs() / scale;
                assert!(error < 1e-9, "{coupling} {half}: {loads:?}");
            }
        }
    }
}

/// Checks structures with and without interpolated links, and that a plane of symmetry has the same bits on any ranks.
#[test]
fn half_a_structure_at_a_plane_of_symmetry_has_half_the_load() {
    let _beside = beside_others();
    for shape in ["box", "sphere"] {
        let of = |half: bool| {
            let low = if half { 0.0 } else { WIDTH - 0.03 };
            let middle = if half { 0.0 } else { WIDTH };
            let high = middle + 0.03;
            let shape = match shape {
                "box" => json!({"box": {"from": [0.061, low, 0.034], "to": [0.108, high, 0.077]}}),
                _ => json!({"sphere": {"centre": [0.087, middle, 0.052], "radius": 0.031}}),
            };
            let parts = json!({
                "structures": [{"name": "pier", "shape": shape}],
                "probes": [{"name": "load", "every": 0.04,
                    "at": {"structure": {"name": "pier", "about": [0.087, middle, 0.052]}}}]
            });
            let study = Study::new(&stream(half, 0.0, &parts).to_string());
            study.run("run", 1, 1, &[]);
            let error = study.summary("run")["guards"]["momentum_error"].as_f64();
            assert!(error.is_none_or(|error| error < 1e-9), "{error:?}");
            if half {
                study.run("two", 2, 1, &[]);
                study.same("run", "two");
                study.run("three", 3, 2, &[]);
                study.same("run", "three");
            }
            let names = ["fluid_force_x", "fluid_force_z", "fluid_torque_y"];
            last(&study, "run/probe_load.csv", names)
        };
        let loads = [of(true), of(false)];
        for k in 0..3 {
            let scale = if k < 2 { loads[1][0] } else { loads[1][2] }.abs();
            let error = (2.0 * loads[0][k] - loads[1][k]).abs() / scale;
            assert!(error < 1e-9, "{shape}: {loads:?}");
        }
    }
}

/// Checks the collapse of a column of water on a floor of free slip: no row of the wall probe has a force along it.
#[test]
fn a_plane_of_symmetry_below_a_moving_surface_has_no_friction() {
    let _beside = beside_others();
    let case = json!({
        "domain": {"size": [0.2, 0.1], "spacing": 0.005}, "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-4, "time_step": 1e-4,
            "boundaries": [{"name": "floor", "face": "y_min", "condition": {"free_slip": {}}}],
            "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [0.05, 0.075]}}}]}}},
        "time": {"end": 0.06},
        "probes": [{"name": "floor", "every": 2e-3, "at": {"wall": {"face": "y_min"}}}]
    });
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    let text = std::fs::read_to_string(study.path("run/probe_floor.csv")).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter_map(|line| {
            line.split(',')
                .map(|cell| cell.trim().parse().ok())
                .collect()
        })
        .collect();
    assert!(rows.len() > 20, "{text}");
    // Columns: step, time, force along x and y.
    let largest = |column: usize| rows.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
    assert!(
        largest(3) > 30.0 && largest(2) < 1e-9 * largest(3),
        "{text}"
    );
}
