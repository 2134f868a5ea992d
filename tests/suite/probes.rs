//! Forces in the tables of probes belong to the time of their row.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
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
    // Faces of the block half-way between the centres of cells, and so far beyond that links meet the block before the
    // plane of symmetry; 12 cells in either case.
    let corners = [[0.008, 0.006], [0.0087, 0.0069]];
    let floors = ["no_slip", "free_slip"].into_iter();
    for (floor, corner) in floors.flat_map(|floor| corners.map(|corner| (floor, corner))) {
        let case = json!({
            "domain": {"size": [0.02, 0.016], "spacing": 0.002},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
                "body_force": {"constant": [0, -20]},
                "boundaries": [{"name": "floor", "face": "y_min", "condition": {floor: {}}}]
            }},
            "structures": [
                {"name": "block", "shape": {"box": {"from": [-0.001, -0.001], "to": corner}}}],
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
            "{floor} {corner:?}: {off} of {weight}, {forces:?}"
        );
    }
}

/// Checks that a step in still water bears the pressure of water at rest over its whole height and length, up to the
/// faces of the domain on which it stands, and that faces bear no force along themselves.
#[test]
fn a_step_in_still_water_bears_the_pressure_up_to_the_faces() {
    let _beside = beside_others();
    for dimension in [2, 3] {
        let pick = |of: &[f64; 3]| match dimension {
            2 => vec![of[0], of[2]],
            _ => of.to_vec(),
        };
        let up = if dimension == 2 { "y" } else { "z" };
        let (low, high) = (pick(&[-1.0, -1.0, -1.0]), pick(&[0.014, 0.01, 0.012]));
        let floor = format!("{up}_min");
        let probes = [
            json!({"name": "step", "every": 0.01, "at": {"structure": {"name": "step"}}}),
            json!({"name": "floor", "every": 0.01, "at": {"wall": {"face": floor}}}),
        ];
        let case = json!({
            "domain": {"size": pick(&[0.024, 0.016, 0.028]), "spacing": 0.002},
            "gravity": pick(&[0.0, 0.0, -10.0]),
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 1e-4,
                "surface": {"water": [{"level": 0.022}]}
            }},
            "structures": [{"name": "step", "shape": {"box": {"from": low, "to": high}}}],
            "time": {"end": 0.05},
            "probes": probes
        });
        let study = Study::new(&case.to_string());
        study.run("one", 1, 1, &[]);
        let force = |name: &str| {
            let path = study.path("one").join(format!("probe_{name}.csv"));
            let text = std::fs::read_to_string(path).unwrap();
            let before = if name == "step" { "fluid_" } else { "" };
            let axes: &[&str] = if dimension == 2 {
                &["x", "y"]
            } else {
                &["x", "y", "z"]
            };
            let headings: Vec<String> = axes.iter().map(|a| format!("{before}force_{a}")).collect();
            let row = headings
                .iter()
                .map(|heading| columns(&text, [heading.as_str(), "time"]).last().unwrap()[0]);
            row.collect::<Vec<f64>>()
        };
        // Pressure in the middle of its height and on top, in Pa.
        let (side, top) = (1e4 * 0.016, 1e4 * 0.01);
        let exact = if dimension == 2 {
            vec![-side * 0.012, -top * 0.014]
        } else {
            vec![
                -side * 0.012 * 0.01,
                -side * 0.012 * 0.014,
                -top * 0.014 * 0.01,
            ]
        };
        let found = force("step");
        for (found, exact) in found.iter().zip(&exact) {
            assert!(
                (found / exact - 1.0).abs() < 2e-3,
                "{dimension}-D: {found} of {exact}"
            );
        }
        let along = &force("floor")[..dimension - 1];
        assert!(
            along
                .iter()
                .all(|force| force.abs() < 1e-3 * exact[0].abs()),
            "{dimension}-D: along the floor {along:?}"
        );
    }
}

/// Checks that each of two structures that meet in still water bears the pressure of water at rest on its own faces.
#[test]
fn structures_that_meet_bear_the_pressure_on_their_own_faces() {
    let _beside = beside_others();
    let names = ["bed", "step"];
    let probes =
        names.map(|name| json!({"name": name, "every": 0.01, "at": {"structure": {"name": name}}}));
    // The foot of the step lies on the bed, or below its surface.
    for foot in [0.004, -1.0] {
        let case = json!({
            "domain": {"size": [0.024, 0.028], "spacing": 0.002},
            "gravity": [0, -10],
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 1e-4,
                "surface": {"water": [{"level": 0.022}]}
            }},
            "structures": [
                {"name": "bed", "shape": {"box": {"from": [-1, -1], "to": [1, 0.004]}}},
                {"name": "step", "shape": {"box": {"from": [-1, foot], "to": [0.014, 0.012]}}}],
            "time": {"end": 0.05},
            "probes": probes
        });
        let study = Study::new(&case.to_string());
        study.run("one", 1, 1, &[]);
        let [bed, step] = names.map(|name| {
            let path = study.path("one").join(format!("probe_{name}.csv"));
            let text = std::fs::read_to_string(path).unwrap();
            columns(&text, ["fluid_force_x", "fluid_force_y"])
                .last()
                .copied()
                .unwrap()
        });
        let exact = [
            [0.0, -1e4 * 0.018 * 0.01],
            [-1e4 * 0.014 * 0.008, -1e4 * 0.01 * 0.014],
        ];
        for (found, exact) in [bed, step].into_iter().zip(exact) {
            for (found, exact) in found.into_iter().zip(exact) {
                assert!(
                    (found - exact).abs() < 2e-3,
                    "foot at {foot}: {found} of {exact} N/m"
                );
            }
        }
    }
}

/// Checks that structures on a face bear the same loads on any cuts while water reaches them: air at their feet
/// exerts none.
#[test]
fn structures_that_water_reaches_bear_the_same_loads_on_any_cuts() {
    let _beside = beside_others();
    let names = ["bed", "step"];
    let probes =
        names.map(|name| json!({"name": name, "every": 0.02, "at": {"structure": {"name": name}}}));
    let case = json!({
        "domain": {"size": [0.4, 0.2], "spacing": 0.01},
        "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 5e-4, "time_step": 3e-4, "collision": {"bgk": {}},
            "turbulence": {"smagorinsky": {}},
            "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [0.12, 0.12]}}}]}
        }},
        "structures": [
            {"name": "bed", "shape": {"box": {"from": [0.15, -1], "to": [1, 0.02]}}},
            {"name": "step", "shape": {"box": {"from": [0.25, -1], "to": [0.28, 0.05]}}}],
        "time": {"end": 0.3},
        "probes": probes
    });
    let study = Study::new(&case.to_string());
    let tables = |run: &str| {
        names.map(|name| {
            let path = study.path(run).join(format!("probe_{name}.csv"));
            std::fs::read_to_string(path).unwrap()
        })
    };
    let runs = [("one", 1, "x"), ("along x", 3, "x"), ("along y", 2, "y")];
    let [one, others @ ..] = runs.map(|(run, ranks, axis)| {
        study.run(run, ranks, 1, &[&format!("domain.split={axis}")]);
        tables(run)
    });
    for other in others {
        assert_eq!(rows_of(&one), rows_of(&other));
    }
}

/// Returns the rows of tables without their headings.
fn rows_of(tables: &[String; 2]) -> [Vec<&str>; 2] {
    [0, 1].map(|n| {
        let lines = tables[n].lines();
        lines.filter(|line| !line.starts_with('#')).collect()
    })
}

/// Returns a tank of water with a body in its lower corner, next to the face `x_min` and the floor, and probes of all.
fn still_tank(shape: &Value, position: &[f64], changes: &Value) -> Value {
    let dimension = position.len();
    let faces = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
    let faces = &faces[..2 * dimension];
    let walls = faces
        .iter()
        .map(|face| json!({"name": face, "every": 0.5, "at": {"wall": {"face": face}}}));
    let body = json!({"name": "body", "every": 0.5, "at": {"body": {"name": "body"}}});
    let pick = |of: [f64; 3]| [&of[..dimension - 1], &of[2..]].concat();
    let mut case = json!({
        "domain": {"size": pick([0.02, 0.012, 0.016]), "spacing": 0.002},
        "gravity": pick([0.0, 0.0, -10.0]),
        "materials": {"rock": {"density": 2600}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 1e-4, "gravity_acts_on_fluid": true
        }},
        "bodies": [{"name": "body", "material": "rock", "motion": {"fixed": {}}, "shape": shape,
            "position": position}],
        "coupling": {"bounce_back": {"scheme": "half_way"}},
        "time": {"end": 0.5},
        "probes": walls.chain([body]).collect::<Vec<_>>()
    });
    for (path, value) in changes.as_object().unwrap() {
        *case.pointer_mut(path).unwrap() = value.clone();
    }
    case
}

/// Runs a case and returns the last force of the water on each body, structure or face of these names.
fn still_forces<const N: usize>(case: &Value, names: [&str; N]) -> [[f64; 3]; N] {
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    names.map(|name| {
        let path = study.path("one").join(format!("probe_{name}.csv"));
        let text = std::fs::read_to_string(path).unwrap();
        let head = text.lines().find(|line| !line.starts_with('#')).unwrap();
        let before = if head.contains("fluid_force_x") {
            "fluid_"
        } else {
            ""
        };
        ["x", "y", "z"].map(|axis| {
            let heading = format!("{before}force_{axis}");
            if head.split(',').any(|column| column == heading) {
                columns(&text, [&heading, "time"]).last().unwrap()[0]
            } else {
                0.0
            }
        })
    })
}

/// Checks that a block in the corner of a tank of still water bears the pressure of water at rest on its sides and its
/// top, up to the faces of the domain on which it stands, and that the faces bear no force along themselves.
#[test]
fn a_block_in_a_corner_bears_the_pressure_up_to_the_faces() {
    let _beside = beside_others();
    let walls = |condition: &Value| {
        let faces = ["x_min", "y_min", "z_min"];
        let walls = faces.map(|face| json!({"name": face, "face": face, "condition": condition}));
        json!({"/fluid/lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 1e-4, "gravity_acts_on_fluid": true,
            "boundaries": walls, "lattice": "d3q27"
        }})
    };
    let still = walls(&json!({"no_slip": {}}));
    let moving = walls(&json!({"moving_wall": {"velocity": [0, 0, 0]}}));
    let mirror = walls(&json!({"free_slip": {}}));
    let interpolated = json!({"/coupling/bounce_back/scheme": "interpolated"});
    let [width, depth, height] = [0.008, 0.006, 0.01];
    let position = [0.5 * width, 0.5 * depth, 0.5 * height];
    let block = json!({"cuboid": {"edges": [width, depth, height]}});
    for (name, changes) in [
        ("half way", &json!({})),
        ("interpolated", &interpolated),
        ("D3Q27", &still),
        ("moving walls", &moving),
        ("symmetry", &mirror),
    ] {
        let case = still_tank(&block, &position, changes);
        let [body, low_x, low_y, low_z] = still_forces(&case, ["body", "x_min", "y_min", "z_min"]);
        // The mean pressure of the tank is 0: that of the middle of its depth.
        let pressure = |z: f64| 1e4 * (0.008 - z);
        let exact = [
            -pressure(0.5 * height) * depth * height,
            -pressure(0.5 * height) * width * height,
            -pressure(height) * width * depth,
        ];
        for axis in 0..3 {
            let off = body[axis] - exact[axis];
            assert!(
                off.abs() < 1e-3 * exact[0].abs(),
                "{name}, axis {axis}: {} of {}",
                body[axis],
                exact[axis]
            );
        }
        for (normal, face) in [low_x, low_y, low_z].into_iter().enumerate() {
            for axis in (0..3).filter(|axis| *axis != normal) {
                assert!(
                    face[axis].abs() < 1e-3 * exact[0].abs(),
                    "{name}: {face:?} along the face normal to axis {normal}"
                );
            }
        }
    }
}

/// Checks that blocks that stand on a structure, in front of one or on another block in still water bear the pressure
/// of water at rest on their own faces, and that the other solid bears that on its faces.
#[test]
fn blocks_beside_other_solids_bear_the_pressure_on_their_own_faces() {
    let _beside = beside_others();
    let block = json!({"cuboid": {"edges": [0.008, 0.012, 0.006]}});
    let rock = json!({"blocks": {"normal_stiffness": {"per_area": 1e6}, "friction_angle_degrees": 30,
        "normal_damping_ratio": 0.3}});
    // The mean pressure of the tank is 0: that of the middle of its depth.
    let pressure = |z: f64| 1e4 * (0.008 - z);
    let top = -pressure(0.01) * 0.008 * 0.012;
    let side = -pressure(0.007) * 0.006 * 0.012;
    let from_below = |to: [f64; 3]| json!([{"name": "other", "shape": {"box": {"from": [-1, -1, -1], "to": to}}}]);
    let low = json!({"name": "other", "material": "rock", "motion": {"fixed": {}},
        "shape": {"cuboid": {"edges": [0.008, 0.012, 0.004]}}, "position": [0.004, 0.006, 0.002]});
    let bed = json!({"/structures": from_below([1.0, 1.0, 0.004])});
    let step = json!({"/structures": from_below([0.006, 1.0, 0.014])});
    let other_block = json!({"/bodies/1": low});
    // A block in a corner of walls on a bed, or on a block; a block in water in front of a step.
    let scenes = [
        (
            &bed,
            0.004,
            [side, top],
            [0.0, -pressure(0.004) * 0.012 * 0.012],
        ),
        (
            &other_block,
            0.004,
            [side, top],
            [-pressure(0.002) * 0.004 * 0.012, 0.0],
        ),
        (&step, 0.01, [side, 1e4 * 0.008 * 0.012 * 0.006], [0.0; 2]),
    ];
    for lattice in ["d3q19", "d3q27"] {
        for (n, (change, x, exact, other)) in scenes.into_iter().enumerate() {
            let mut case = still_tank(&block, &[x, 0.006, 0.007], &json!({}));
            case["fluid"]["lattice_boltzmann"]["lattice"] = json!(lattice);
            case["contact"] = rock.clone();
            let kind = match (change.get("/structures"), change.get("/bodies/1")) {
                (Some(structures), _) => {
                    case["structures"] = structures.clone();
                    "structure"
                }
                (_, second) => {
                    let bodies = case["bodies"].as_array_mut().unwrap();
                    bodies.push(second.unwrap().clone());
                    "body"
                }
            };
            let probe = json!({"name": "other", "every": 0.5, "at": {kind: {"name": "other"}}});
            case["probes"].as_array_mut().unwrap().push(probe);
            let [body, solid, floor] = still_forces(&case, ["body", "other", "z_min"]);
            let found = [body[0] - exact[0], body[2] - exact[1], floor[0]];
            let mut off = found.to_vec();
            if n < 2 {
                off.extend([solid[0] - other[0], solid[2] - other[1]]);
            }
            assert!(
                off.iter().all(|off| off.abs() < 1e-3 * exact[0].abs()),
                "{lattice}, scene {n}: {body:?} of {exact:?}, {solid:?} of {other:?}, floor {floor:?}"
            );
        }
    }
}

/// Checks that a body of partially saturated cells bears the pressure of still water below it as well, at any time:
/// where it stands on the floor, is lifted by a part of a cell, or stands on another body, the water carries it by the
/// weight of the water in its place.
#[test]
fn water_carries_bodies_of_saturated_cells_on_the_floor_at_any_time() {
    let _beside = beside_others();
    // The second operator leaves 1/64 of the weight of the water in full cells at the surface on the body.
    let operators = [
        ("non_equilibrium_bounce_back", 1e-6),
        ("bounce_back_about_solid", 0.02),
        ("superposition", 1e-6),
        ("viscosity_matched", 1e-6),
    ];
    let block = json!({"cuboid": {"edges": [0.008, 0.006, 0.006]}});
    let below = json!({"name": "below", "material": "rock", "motion": {"fixed": {}},
        "shape": {"cuboid": {"edges": [0.01, 0.008, 0.004]}}, "position": [0.01, 0.006, 0.002]});
    for (operator, tolerance) in operators {
        for (floor, other) in [(0.0, None), (0.0007, None), (0.004, Some(&below))] {
            let position = [0.01, 0.006, 0.003 + floor];
            let mut case = still_tank(&block, &position, &json!({}));
            case["coupling"] = json!({"partially_saturated": {"solid_operator": operator}});
            case["contact"] = json!({"blocks": {"normal_stiffness": {"per_area": 1e6},
                "friction_angle_degrees": 30, "normal_damping_ratio": 0.3}});
            case["bodies"]
                .as_array_mut()
                .unwrap()
                .extend(other.cloned());
            for probe in case["probes"].as_array_mut().unwrap() {
                probe["every"] = json!(0.02);
            }
            let study = Study::new(&case.to_string());
            study.run("one", 1, 1, &[]);
            let path = study.path("one").join("probe_body.csv");
            let rows = columns(
                &std::fs::read_to_string(path).unwrap(),
                ["fluid_force_z", "time"],
            );
            let exact = 1e4 * 0.008 * 0.006 * 0.006;
            assert!(rows.len() > 20);
            for [force, time] in &rows[1..] {
                assert!(
                    (force / exact - 1.0).abs() < tolerance,
                    "{operator}, {floor} m above the floor: {force} of {exact} at {time} s"
                );
            }
        }
    }
}

/// Checks that still water acts on a disc and a sphere in a corner along each axis as on the opposite face, and that
/// it exerts no force along the faces.
#[test]
fn round_bodies_in_a_corner_leave_no_force_along_faces() {
    let _beside = beside_others();
    let bodies: [(Value, &[f64]); 2] = [
        (json!({"disc": {"radius": 0.005}}), &[0.004, 0.0044]),
        (
            json!({"sphere": {"radius": 0.005}}),
            &[0.004, 0.004, 0.0044],
        ),
    ];
    for (shape, position) in bodies {
        let case = still_tank(&shape, position, &json!({}));
        let [body, low, floor] = still_forces(
            &case,
            [
                "body",
                "x_min",
                if position.len() == 2 {
                    "y_min"
                } else {
                    "z_min"
                },
            ],
        );
        let [high] = still_forces(&case, ["x_max"]);
        let scale = high[0].abs().max(low[0].abs());
        let balance = body[0] + low[0] + high[0];
        assert!(body[0].abs() > 0.1 * scale, "{body:?} of {scale}");
        assert!(
            balance.abs() < 1e-3 * scale,
            "{shape}: {balance} of {scale}"
        );
        let vertical = position.len() - 1;
        let along = [low[vertical], floor[0]];
        assert!(
            along.iter().all(|force| force.abs() < 1e-3 * scale),
            "{shape}: {along:?} of {scale} along the faces"
        );
    }
}

/// Returns a box of water with a fixed block on its floor, between the lines of cells or not, and probes of all.
fn water_around_a_block(floor: &str, water: &Value, base: [f64; 2], scheme: &str) -> Value {
    let names = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
    let walls = names.map(|name| (name, json!({"wall": {"face": name}})));
    let block = ("block", json!({"body": {"name": "block"}}));
    let probes = walls.into_iter().chain([block]);
    let probes: Vec<Value> = probes
        .map(|(name, at)| json!({"name": name, "every": 0.5, "at": at}))
        .collect();
    let mut case = json!({
        "domain": {"size": [0.02, 0.016, 0.012], "spacing": 0.002},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
            "boundaries": [{"name": "floor", "face": "z_min", "condition": {floor: {}}}]
        }},
        "materials": {"rock": {"density": 2600}},
        "bodies": [{"name": "block", "material": "rock", "motion": {"fixed": {}},
            "shape": {"cuboid": {"edges": [base[0], base[0], base[1]]}},
            "position": [0.01, 0.008, 0.5 * base[1]]}],
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e6}, "friction_angle_degrees": 30,
            "normal_damping_ratio": 0.3}},
        "coupling": {"bounce_back": {"scheme": scheme}},
        "time": {"end": 5},
        "probes": probes
    });
    let lattice = case["fluid"]["lattice_boltzmann"].as_object_mut().unwrap();
    lattice.extend(water.as_object().unwrap().clone());
    case
}

/// Returns the last value of a column of a probe.
fn last(study: &Study, run: &str, probe: &str, column: &str) -> f64 {
    let path = study.path(run).join(format!("probe_{probe}.csv"));
    let text = std::fs::read_to_string(path).unwrap();
    columns(&text, [column, "time"]).last().unwrap()[0]
}

/// Checks a body on the floor under a uniform pressure: the floor holds the pressure on its open cells, and the body
/// that on its top.
#[test]
fn a_floor_beside_a_body_holds_the_pressure_of_the_water() {
    let _beside = beside_others();
    let water = json!({"initial": {"uniform": {"velocity": [0, 0, 0], "pressure": 5}}});
    let case = water_around_a_block("no_slip", &water, [0.008, 0.006], "half_way");
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    let cell = 0.002_f64.powi(2);
    let (open, covered) = (64.0 * cell, 16.0 * cell);
    let floor = last(&study, "one", "z_min", "normal_force");
    let block = last(&study, "one", "block", "fluid_force_z");
    assert!((floor - 5.0 * open).abs() < 1e-9 * open, "{floor}");
    assert!((block + 5.0 * covered).abs() < 1e-9 * covered, "{block}");
}

/// Checks that faces and a body on the floor hold the weight of the water at rest, and nothing of what the body
/// contains: the body force acts in its cells too.
#[test]
fn faces_beside_a_body_hold_the_weight_of_the_water() {
    let _beside = beside_others();
    let water = json!({"body_force": {"constant": [0, 0, -20]}});
    let schemes = [
        ([0.008, 0.006], "half_way"),
        ([0.0087, 0.0069], "interpolated"),
    ];
    for floor in ["no_slip", "free_slip"] {
        for (base, scheme) in schemes {
            let case = water_around_a_block(floor, &water, base, scheme);
            let study = Study::new(&case.to_string());
            study.run("one", 1, 1, &[]);
            let walls = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
            let walls = walls.map(|name| last(&study, "one", name, "force_z"));
            let block = last(&study, "one", "block", "fluid_force_z");
            // 480 cells of the box without 48 of the block.
            let weight = 20.0 * 432.0 * 0.002_f64.powi(3);
            let off = walls.iter().sum::<f64>() + block + weight;
            assert!(
                off.abs() < 1e-6 * weight,
                "{floor} {scheme}: {off} of {weight}, {walls:?} {block}"
            );
        }
    }
}

/// Checks a block that leaves through an outlet: the discharges are those of the water, so that more water enters than
/// leaves, by the volume of the block that leaves in the same time.
#[test]
fn what_a_body_contains_is_no_discharge() {
    let _beside = beside_others();
    let (speed, section) = (0.001, 16.0 * 0.002_f64.powi(2));
    let pressure = json!({"pressure": {"value": 0}});
    let faces = ["x_min", "x_max"];
    let case = json!({
        "domain": {"size": [0.04, 0.016, 0.016], "spacing": 0.002},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
            "boundaries": faces.map(|face| json!({"name": face, "face": face, "condition": pressure}))
        }},
        "materials": {"rock": {"density": 2600}},
        "bodies": [{"name": "block", "material": "rock",
            "motion": {"driven": {"velocity": [speed, 0, 0]}},
            "shape": {"cuboid": {"edges": [0.03, 0.008, 0.008]}}, "position": [0.027, 0.008, 0.008]}],
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e6}, "friction_angle_degrees": 30,
            "normal_damping_ratio": 0.3}},
        "coupling": {"bounce_back": {"scheme": "half_way"}},
        "time": {"end": 8},
        "probes": faces.map(|face| json!({"name": face, "every": 0.004, "at": {"wall": {"face": face}}}))
    });
    let study = Study::new(&case.to_string()).unstable();
    study.run("one", 1, 1, &[]);
    let mean = |name: &str| {
        let path = study.path("one").join(format!("probe_{name}.csv"));
        let rows = columns(
            &std::fs::read_to_string(path).unwrap(),
            ["mass_flux", "time"],
        );
        // The block moves on by three cells.
        let rows = rows.iter().filter(|row| row[1] > 2.0);
        let fluxes: Vec<f64> = rows.map(|row| row[0]).collect();
        fluxes.iter().sum::<f64>() / f64::from(u32::try_from(fluxes.len()).unwrap())
    };
    let water = faces.map(mean);
    let taken = 1000.0 * speed * section;
    let off = water[0] + water[1] + taken;
    // The density of the water follows its pressure next to the block: by 0.4 %, in proportion to the speed.
    assert!(off.abs() < 0.01 * taken, "{water:?} with {taken}");
    assert!(water[0] < -0.5 * taken, "{water:?} with {taken}");
}
