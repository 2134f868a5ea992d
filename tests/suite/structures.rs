//! Structures in both fluids: channels built of boxes, cylinders of every kind, sheets thinner than a cell, grains
//! next to structures, and the same bits on any number of ranks.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::Document;
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

/// Returns the values of a column of a table of a run.
fn column(study: &Study, run: &str, table: &str, name: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(study.path(run).join(table)).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let place = lines.next().unwrap().split(',').position(|n| n == name);
    let place = place.unwrap_or_else(|| panic!("{table} has no {name}"));
    lines
        .map(|line| line.split(',').nth(place).unwrap().parse().unwrap())
        .collect()
}

fn last(study: &Study, run: &str, table: &str, name: &str) -> f64 {
    *column(study, run, table, name).last().unwrap()
}

/// Returns a channel along x of 4 cells of a centimetre, driven by a force of 8 N/m3; water of 0.01 m2/s.
fn channel(height: f64, structures: &Value) -> Value {
    json!({
        "domain": {"size": [0.04, height], "spacing": 0.01, "periodic": ["x"]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 0.01, "collision": {"trt": {"magic": 0.1875}},
                "relaxation_time": 0.8,
            "body_force": {"constant": [8, 0]}
        }},
        "structures": structures,
        "time": {"end": 2},
        "probes": (["flow"].iter().map(|name| json!({
            "name": name, "every": 1, "at": {"plane": {"axis": "x", "position": 0.02}}
        }))).chain((0..structures.as_array().unwrap().len()).map(|n| json!({
            "name": format!("force{n}"), "every": 1, "at": {"structure": {"name": structures[n]["name"]}}
        }))).collect::<Vec<_>>()
    })
}

fn slab(name: &str, from: f64, to: f64) -> Value {
    json!({"name": name, "shape": {"box": {"from": [-1, from], "to": [1, to]}}})
}

/// Checks channels between domain walls, between boxes at the same place, and between boxes that intersect cells: the
/// flux is H³/12 times the force divided by the viscosity, and the boxes carry the force on all the water.
#[test]
fn a_channel_of_boxes_is_one_of_walls() {
    let _beside = beside_others();
    let of = |case: &Value| {
        let study = Study::new(&case.to_string());
        study.run("run", 1, 1, &[]);
        let forces = (0..case["structures"].as_array().unwrap().len()).map(|n| {
            last(
                &study,
                "run",
                &format!("probe_force{n}.csv"),
                "fluid_force_x",
            )
        });
        let forces: Vec<f64> = forces.collect();
        (last(&study, "run", "probe_flow.csv", "discharge"), forces)
    };
    let (walls, _) = of(&channel(0.1, &json!([])));
    let aligned = json!([slab("floor", -1.0, 0.02), slab("roof", 0.12, 1.0)]);
    let (boxes, forces) = of(&channel(0.14, &aligned));
    assert!((boxes / walls - 1.0).abs() < 1e-10, "{boxes} {walls}");
    // 1000 kg/m3 of water per metre of depth, half on each.
    for force in forces {
        assert!(
            (force / (0.5 * 8.0 * 0.04 * 0.1) - 1.0).abs() < 1e-6,
            "{force}"
        );
    }
    let cut = json!([slab("floor", -1.0, 0.0234), slab("roof", 0.1171, 1.0)]);
    for cells in [1, 2] {
        let h = 0.01 / f64::from(cells);
        let mut case = channel(0.14, &cut);
        case["domain"]["spacing"] = json!(h);
        let (boxes, forces) = of(&case);
        // Parabola between the boxes at the centres of the wet cells.
        let speed = |y: f64| 8.0 / (2.0 * 10.0) * (y - 0.0234) * (0.1171 - y);
        let centres = (0..14 * cells).map(|j| h * (f64::from(j) + 0.5));
        let exact: f64 = centres.map(|y| h * speed(y).max(0.0)).sum();
        let error = (boxes / exact - 1.0).abs();
        // The error of linear interpolation is less than half of the curvature of a cell at the walls: h² u''/4 in
        // the velocity.
        let bound = 3.0 * (h / (0.1171 - 0.0234)).powi(2);
        println!("boxes that cut cells of {h} m: error of the flux {error:.2e}, bound {bound:.2e}");
        assert!(error < bound, "{boxes} {exact}");
        // The structures carry the force on the water, which is that of its cells.
        let water = wet_cells(14 * cells, h) * h * 0.04;
        let force: f64 = forces.iter().sum();
        assert!((force / (8.0 * water) - 1.0).abs() < 1e-5, "{forces:?}");
    }
}

/// Checks that a stream that is developed at the start, between a floor and the top of the domain, has its discharge
/// from the first step on.
#[test]
fn a_stream_over_a_raised_floor_starts_developed() {
    let _beside = beside_others();
    let mut case = channel(0.14, &json!([slab("floor", -1.0, 0.04)]));
    let flow = |from: f64, to: f64| {
        json!({"channel": {"flow": "x", "across": "y", "from": from, "to": to,
        "peak": 0.001}})
    };
    let initial = "/fluid/lattice_boltzmann/initial";
    case["fluid"]["lattice_boltzmann"]["initial"] = flow(0.04, 0.14);
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    let discharge = column(&study, "run", "probe_flow.csv", "discharge");
    // Discharge f H³/(12 mu), plus the errors of half-way links and ten cells.
    for found in &discharge {
        assert!(
            (found / (8.0 * 1e-3 / 120.0) - 1.0).abs() < 0.02,
            "{discharge:?}"
        );
    }
    let [first, .., last] = discharge[..] else {
        panic!("{discharge:?}")
    };
    assert!((first / last - 1.0).abs() < 5e-3, "{discharge:?}");
    for (from, to) in [(0.14, 0.04), (-0.01, 0.1), (0.04, 0.15)] {
        *case.pointer_mut(initial).unwrap() = flow(from, to);
        let found = problems(&case);
        assert!(
            found
                .iter()
                .any(|p| p.path.ends_with("initial.channel")
                    && p.reason.contains("the flow begins at")),
            "{found:?}"
        );
    }
}

/// Returns the cells of a column whose centres lie between the boxes.
fn wet_cells(cells: i32, h: f64) -> f64 {
    let centres = (0..cells).map(|j| h * (f64::from(j) + 0.5));
    centres
        .filter(|y| (0.0234..0.1171).contains(y))
        .map(|_| 1.0)
        .sum()
}

/// Checks that there is no flow in a channel closed by a sheet of a tenth of a cell, upright in the middle of a cell or
/// oblique.
#[test]
fn a_sheet_thinner_than_a_cell_holds_water_back() {
    let _beside = beside_others();
    for sheet in [
        json!({"box": {"from": [0.0152, -1], "to": [0.0156, 1]}}),
        json!({"polygon": {"points": [[0.003, -0.01], [0.0035, -0.01], [0.0375, 0.11], [0.037, 0.11]]}}),
    ] {
        let case = channel(0.1, &json!([{"name": "sheet", "shape": sheet}]));
        let study = Study::new(&case.to_string());
        study.run("run", 1, 1, &[]);
        let discharge = last(&study, "run", "probe_flow.csv", "discharge");
        let free = 8.0 * 0.1_f64.powi(3) / 120.0;
        assert!(discharge.abs() < 1e-9 * free, "{sheet}: {discharge}");
        let force = last(&study, "run", "probe_force0.csv", "fluid_force_x");
        println!("{sheet}: discharge {discharge}, force {force}");
        assert!(
            force > 0.5 * 8.0 * 0.04 * 0.1,
            "the sheet bears the water: {force}"
        );
    }
}

/// Returns a triangle as a facet of an STL file.
fn facet_of(corners: [[f64; 3]; 3]) -> String {
    let mut text = String::from("facet normal 0 0 0\nouter loop\n");
    for [x, y, z] in corners {
        writeln!(text, "vertex {x} {y} {z}").unwrap();
    }
    text + "endloop\nendfacet\n"
}

/// Returns a prism over a regular polygon as an STL file.
fn stl(centre: [f64; 2], radius: f64, low: f64, high: f64) -> String {
    const N: u32 = 96;
    let at = |k: u32, z: f64| {
        let (s, c) = (2.0 * PI * f64::from(k % N) / f64::from(N)).sin_cos();
        [centre[0] + radius * c, centre[1] + radius * s, z]
    };
    let mut text = String::from("solid cylinder\n");
    let mut facet = |corners: [[f64; 3]; 3]| text += &facet_of(corners);
    for k in 0..N {
        let (a, b, c, d) = (at(k, low), at(k + 1, low), at(k + 1, high), at(k, high));
        facet([a, b, c]);
        facet([a, c, d]);
        facet([[centre[0], centre[1], low], b, a]);
        facet([[centre[0], centre[1], high], d, c]);
    }
    text + "endsolid\n"
}

/// Returns a non-convex weir with a step as an STL file: an L in x and z, extruded along y beyond the domain.
fn ell(x: [f64; 3], z: [f64; 3]) -> String {
    let [x0, xm, x1] = x;
    let [z0, za, zb] = z;
    let corners = [(x0, z0), (x1, z0), (x1, za), (xm, za), (xm, zb), (x0, zb)];
    let at = |k: usize, y: f64| [corners[k].0, y, corners[k].1];
    let mut text = String::from("solid weir\n");
    let mut facet = |corners: [[f64; 3]; 3]| text += &facet_of(corners);
    let (front, back) = (-0.03, 0.09);
    for k in 0..corners.len() {
        let next = (k + 1) % corners.len();
        let (a, b, c, d) = (at(k, front), at(next, front), at(next, back), at(k, back));
        facet([a, b, c]);
        facet([a, c, d]);
    }
    for [a, b, c] in [[0, 1, 3], [1, 2, 3], [0, 3, 4], [0, 4, 5]] {
        facet([at(a, front), at(c, front), at(b, front)]);
        facet([at(a, back), at(b, back), at(c, back)]);
    }
    text + "endsolid\n"
}

/// Checks that a weir of triangles carries the force and has the discharge of a weir of two boxes, in a stream and in
/// the ground.
#[test]
fn a_weir_of_triangles_is_one_of_boxes_in_both_fluids() {
    let _beside = beside_others();
    let (x, z) = ([0.1037, 0.1312, 0.2041], [-0.02, 0.0433, 0.0871]);
    let boxes = json!([
        {"name": "step", "shape": {"box": {"from": [x[0], -0.03, z[0]], "to": [x[2], 0.09, z[1]]}}},
        {"name": "tower", "shape": {"box": {"from": [x[0], -0.03, z[0]], "to": [x[1], 0.09, z[2]]}}}
    ]);
    let triangles = json!([{"name": "weir", "shape": {"surface": {"mesh": {"path": "weir.stl"}}}}]);
    let run = |mut case: Value, structures: &Value| {
        case["structures"] = structures.clone();
        let names: Vec<&str> = structures
            .as_array()
            .unwrap()
            .iter()
            .map(|s| s["name"].as_str().unwrap())
            .collect();
        let water = case["fluid"]["lattice_boltzmann"].is_object();
        if water {
            let forces = names
                .iter()
                .map(|name| json!({"name": name, "every": 3, "at": {"structure": {"name": name}}}));
            let mut probes: Vec<Value> = forces.collect();
            probes.push(json!({"name": "flow", "every": 3, "at": {"plane": {"axis": "x", "position": 0.005}}}));
            case["probes"] = json!(probes);
        }
        let study = Study::new(&case.to_string());
        std::fs::write(study.path("").join("weir.stl"), ell(x, z)).unwrap();
        study.run("run", 1, 1, &[]);
        if !water {
            return (0.0, study.summary("run")["inflow"].as_f64().unwrap());
        }
        let force =
            |name: &&str| last(&study, "run", &format!("probe_{name}.csv"), "fluid_force_x");
        let flow = last(&study, "run", "probe_flow.csv", "discharge");
        (names.iter().map(force).sum::<f64>(), flow)
    };
    let stream = json!({
        "domain": {"size": [0.3, 0.06, 0.16], "spacing": 0.01, "periodic": ["x", "y"]},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 0.002, "collision": {"trt": {}}, "relaxation_time": 0.8,
            "body_force": {"constant": [2, 0, 0]}
        }},
        "time": {"end": 3}
    });
    let ground = json!({
        "domain": {"size": [0.3, 0.06, 0.16], "spacing": 0.01},
        "gravity": [0, 0, -9.81],
        "fluid": {"darcy": {
            "density": 1000, "viscosity": 1e-3,
            "zones": [{"name": "sand", "permeability": {"hydraulic_conductivity": 1e-4}}],
            "boundaries": [
                {"name": "left", "face": "x_min", "condition": {"head": {"value": 0.3}}},
                {"name": "right", "face": "x_max", "condition": {"head": {"value": 0.2}}}
            ]
        }},
        "time": {"end": 1, "solid_time_step": 0.01}
    });
    for (name, case) in [("stream", stream), ("ground", ground)] {
        let (whole, pieces) = (run(case.clone(), &triangles), run(case, &boxes));
        let (force, flow) = (whole.0 / pieces.0, whole.1 / pieces.1);
        println!("{name}: force {force:.6}, discharge {flow:.6} of those of two boxes");
        assert!((flow - 1.0).abs() < 0.02, "{name}: {whole:?} {pieces:?}");
        assert!(
            name == "ground" || (force - 1.0).abs() < 0.02,
            "{name}: {whole:?} {pieces:?}"
        );
    }
}

/// Checks that a drawing in millimetres is refused with a proposed scale, even if it covers the whole domain; if it
/// lies outside the domain, the message contains its position.
#[test]
fn a_surface_in_millimetres_is_distinguished_from_one_in_metres() {
    let folder = tempfile::tempdir().unwrap();
    let problems = |centre: [f64; 2], set: &[&str]| {
        let file = folder.path().join("c.stl");
        std::fs::write(&file, stl(centre, 30.0, -5.0, 45.0)).unwrap();
        let case = json!({
            "domain": {"size": [0.3, 0.2, 0.04], "spacing": 0.01, "periodic": ["x", "z"]},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 0.002, "relaxation_time": 0.8, "body_force": {"constant": [2,
                    0, 0]}
            }},
            "structures": [{"name": "c", "shape": {"surface": {"mesh": {"path": file}}}}],
            "time": {"end": 6}
        });
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let document = Document::read(&case.to_string(), &set, Path::new("")).unwrap();
        let errors = Plan::prepare(document).err().unwrap_or_default();
        let errors = errors.into_iter().filter(|p| p.severity == Severity::Error);
        errors.collect::<Vec<_>>()
    };
    let scale = "structures[0].shape.surface.mesh.scale";
    for centre in [[123.0, 98.0], [0.0, 0.0]] {
        let found = problems(centre, &[]);
        let about = found.iter().find(|p| p.path == scale).unwrap();
        assert_eq!(about.remedy.proposal()[0].value, json!(0.001), "{found:?}");
    }
    assert_eq!(
        problems(
            [123.0, 98.0],
            &["structures[0].shape.surface.mesh.scale=0.001"]
        ),
        []
    );
    let beside = problems(
        [900.0, 98.0],
        &["structures[0].shape.surface.mesh.scale=0.001"],
    );
    let where_it_lies = beside
        .iter()
        .any(|p| p.reason.contains("it reaches from 0.87, 0.068,"));
    assert!(where_it_lies, "{beside:?}");
}

/// Compares a cylinder in a channel as a disc body, a disc, a cylinder across a thin periodic domain, and a
/// triangulated surface.
#[test]
fn a_cylinder_bears_the_same_force_however_it_is_written() {
    let _beside = beside_others();
    let (centre, radius) = ([0.123, 0.098], 0.03);
    let case = |space: bool| {
        let size = if space {
            json!([0.3, 0.2, 0.04])
        } else {
            json!([0.3, 0.2])
        };
        let periodic = if space {
            json!(["x", "z"])
        } else {
            json!(["x"])
        };
        let force = if space {
            json!([2, 0, 0])
        } else {
            json!([2, 0])
        };
        json!({
            "domain": {"size": size, "spacing": 0.01, "periodic": periodic},
            "materials": {"stone": {}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 0.002, "collision": {"trt": {}}, "relaxation_time": 0.8,
                "body_force": {"constant": force}
            }},
            "time": {"end": 6},
            "probes": []
        })
    };
    let run = |mut case: Value, what: &str, thing: Value, file: &str| {
        let kind = if what == "bodies" {
            "body"
        } else {
            "structure"
        };
        case[what] = json!([thing]);
        if what == "bodies" {
            case["coupling"] = json!({"bounce_back": {"scheme": "interpolated"}});
        }
        case["probes"] = json!([
            {"name": "force", "every": 3, "at": {kind: {"name": "c"}}},
            {"name": "flow", "every": 3, "at": {"plane": {"axis": "x", "position": 0.005}}}
        ]);
        let study = Study::new(&case.to_string());
        if !file.is_empty() {
            std::fs::write(study.path("").join("c.stl"), file).unwrap();
        }
        study.run("run", 1, 1, &[]);
        let of = |table: &str, name: &str| last(&study, "run", table, name);
        (
            of("probe_force.csv", "fluid_force_x"),
            of("probe_flow.csv", "discharge"),
        )
    };
    let shaped = |shape: Value| json!({"name": "c", "shape": shape});
    let body = json!({
        "name": "c", "shape": {"disc": {"radius": radius}}, "position": centre, "motion": {"fixed": {}},
            "material": "stone"
    });
    let [x, y] = centre;
    let reference = run(case(false), "bodies", body, "");
    let results = [
        run(
            case(false),
            "structures",
            shaped(json!({"disc": {"centre": centre, "radius": radius}})),
            "",
        ),
        run(
            case(true),
            "structures",
            shaped(
                json!({"cylinder": {"from": [x, y, -0.1], "to": [x, y, 0.2], "radius": radius}}),
            ),
            "",
        ),
        run(
            case(true),
            "structures",
            shaped(json!({"surface": {"mesh": {"path": "c.stl"}}})),
            &stl(centre, radius, -0.1, 0.2),
        ),
    ];
    let names = ["disc", "cylinder", "surface"];
    for (n, (force, flow)) in results.into_iter().enumerate() {
        // Force on a length of 0.04 m of the cylinder.
        let depth = if n == 0 { 1.0 } else { 0.04 };
        let (force, flow) = (force / depth / reference.0, flow / depth / reference.1);
        println!(
            "{}: force {force:.6}, discharge {flow:.6} of those of a disc body",
            names[n]
        );
        assert!(
            (force - 1.0).abs() < 0.01 && (flow - 1.0).abs() < 0.02,
            "{}",
            names[n]
        );
    }
}

/// Returns discs that fall onto a weir and past a sheet in water, in both couplings.
fn weir(coupling: &Value) -> Value {
    json!({
        "domain": {"size": [0.02, 0.02], "spacing": 2.5e-4},
        "gravity": [0, -9.81],
        "materials": {"disc": {"density": 2500}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-5, "reference_velocity": 0.3, "lattice_velocity": 0.06,
            "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [0.05, 0]}}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
            ]
        }},
        "structures": [
            {"name": "weir", "shape": {"polygon": {"points": [[0.006, -0.001], [0.012, -0.001], [0.0101, 0.0063],
                [0.008, 0.006]]}}},
            {"name": "sheet", "shape": {"box": {"from": [0.01551, 0.004], "to": [0.01556, 0.012]}}}
        ],
        "contact": {"linear": {"normal_stiffness": {"absolute": 50000}, "normal_damping_ratio": 0.3}},
        "box_walls": ["y_min"],
        "grains": {"material": "disc", "initial": {"list": [
            {"position": [0.0091, 0.0085], "radius": 0.001}, {"position": [0.0142, 0.0081], "radius": 0.001},
            {"position": [0.0116, 0.0052], "radius": 0.0009}, {"position": [0.0169, 0.0081], "radius": 0.001}
        ]}},
        "coupling": coupling,
        "time": {"end": 0.03},
        "probes": [
            {"name": "weir", "every": 0.003, "at": {"structure": {"name": "weir"}}},
            {"name": "sheet", "every": 0.003, "at": {"structure": {"name": "sheet"}}}
        ],
        "output": {"fluid": {"every": 0.015, "fields": ["velocity", "pressure", "solid"]}, "grains": {"every": 0.015}},
        "checkpoint": {"every": 0.01}
    })
}

fn grains_beside_structures(coupling: &Value) {
    let _beside = beside_others();
    let study = Study::new(&weir(coupling).to_string());
    study.run("straight", 1, 1, &[]);
    study.run("three", 3, 1, &["domain.split=x"]);
    study.same("straight", "three");
    study.run("parts", 1, 1, &["time.end=0.014"]);
    study.restart("parts", 2, &["time.end=0.03"]).expect(0);
    study.same("straight", "parts");
    let force = column(&study, "straight", "probe_weir.csv", "fluid_force_x");
    assert!(
        force.iter().skip(1).all(|f| f.is_finite() && f.abs() > 0.0),
        "{force:?}"
    );
    let warned = study.summary("straight")["warnings"].to_string();
    assert!(!warned.contains("momentum balance"), "{warned}");
}

#[test]
fn grains_beside_structures_have_the_same_bits_on_any_ranks_and_after_a_restart() {
    grains_beside_structures(&json!({"bounce_back": {"scheme": "interpolated"}}));
}

#[test]
fn covered_cells_beside_structures_have_the_same_bits_on_any_ranks_and_after_a_restart() {
    grains_beside_structures(&json!({"partially_saturated": {}}));
}

/// Checks a disc that rolls down a frictionless ramp and comes to rest in a corner: it touches both faces, and no other
/// part of the polygon.
#[test]
fn a_disc_rests_in_the_corner_of_a_structure() {
    let _beside = beside_others();
    let case = json!({
        "domain": {"size": [1, 1], "spacing": 0.05},
        "gravity": [0, -10],
        "materials": {"stone": {"density": 2000}},
        "structures": [{
            "name": "valley",
            "shape": {"polygon": {"points": [[0, 0], [1, 0], [1, 0.8], [0.7, 0.2], [0.3, 0.2], [0, 0.5]]}}
        }],
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e7}, "normal_damping_ratio": 0.5}},
        "grains": {"material": "stone", "initial": {"list": [{"position": [0.6, 0.4], "radius": 0.1, "velocity": [0.2,
            0]}]}},
        "time": {"end": 3},
        "output": {"grains": {"every": 3}},
        "regions": [{"name": "all", "box": {"from": [0.4, 0.25], "to": [1, 1]}, "action": {"record": {}}}]
    });
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    let info = io::fields::read_column(
        &std::fs::read_dir(study.path("run"))
            .unwrap()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.to_string_lossy().contains("grains_"))
            .max()
            .unwrap(),
        "position",
    )
    .unwrap();
    println!("at rest at {:?}", info.values);
    // The overlap with the floor of the valley is that of the weight.
    let weight = 2000.0 * PI * 0.01 * 10.0;
    assert!(
        (info.values[1] - 0.3 + weight / 1e7).abs() < 2e-5,
        "{:?}",
        info.values
    );
    assert!(info.values[0] > 0.33 && info.values[0] < 0.66);
    // The surface is written for ParaView.
    let surface = io::fields::read_column(
        &study.path("run").join("structures_000000000.vtkhdf"),
        "structure",
    );
    assert_eq!(surface.unwrap().values, [0.0; 4]);
}

fn problems(case: &Value) -> Vec<Problem> {
    match Document::read(&case.to_string(), &[], Path::new("")).and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

/// Checks grains so small that curved structures would need millions of facets: their number has a limit, and the plan
/// states once how far from the surface the facets then lie.
#[test]
fn facets_are_limited_and_their_distance_is_stated() {
    let case = |count: u32, radius: f64| {
        let spheres: Vec<Value> = (0..count)
            .map(|k| {
                let centre = [
                    0.1 + 0.2 * f64::from(k % 10),
                    0.1 + 0.2 * f64::from(k / 10),
                    0.1,
                ];
                let sphere = json!({"sphere": {"centre": centre, "radius": 0.05}});
                json!({"name": format!("s{k}"), "material": "rock", "shape": sphere})
            })
            .collect();
        json!({
            "domain": {"size": [2, 2, 2]},
            "gravity": [0, 0, -9.81],
            "materials": {"rock": {"density": 2650}},
            "grains": {"material": "rock", "initial": {"list": [{"position": [1, 1, 1.5], "radius": radius}]}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e5}}},
            "structures": spheres,
            "time": {"end": 0.1}
        })
    };
    for (count, radius, stated) in [
        (100, 0.02, false),
        (1, 0.02, false),
        (1, 1e-4, true),
        (100, 1e-4, true),
    ] {
        let found = problems(&case(count, radius));
        let about = |p: &&Problem| {
            p.path.ends_with(".shape") && p.reason.contains("facets of this surface")
        };
        assert_eq!(
            found.iter().filter(about).count(),
            usize::from(stated),
            "{count} {radius}: {found:?}"
        );
        assert!(
            found.iter().all(|p| p.severity != Severity::Error),
            "{count} {radius}: {found:?}"
        );
    }
}

#[test]
fn structures_that_cannot_be_are_refused_by_name() {
    let changed = |pointer: &str, value: Value| {
        let mut case = weir(&json!({"bounce_back": {}}));
        *case.pointer_mut(pointer).unwrap() = value;
        case
    };
    let shape = "/structures/0/shape";
    for (case, path, part) in [
        (
            changed(
                shape,
                json!({"polygon": {"points": [[0.006, 0], [0.01, 0.005], [0.01, 0], [0.006, 0.005]]}}),
            ),
            "structures[0].shape.polygon.points",
            "crosses or touches itself",
        ),
        (
            changed(shape, json!({"box": {"from": [0.03, 0], "to": [0.04, 1]}})),
            "structures[0].shape",
            "outside the domain",
        ),
        (
            changed(
                shape,
                json!({"plane": {"point": [0, 0.03], "normal": [0, -1]}}),
            ),
            "structures[0].shape",
            "outside the domain",
        ),
        (
            changed(shape, json!({"box": {"from": [-1, -1], "to": [0.001, 1]}})),
            "fluid.lattice_boltzmann.boundaries[0]",
            "structures cover `in` completely",
        ),
        (
            changed(
                shape,
                json!({"disc": {"centre": [0.009, 0.0085], "radius": 0.002}}),
            ),
            "grains.initial.list[0].position",
            "reaches into the structure `weir`",
        ),
        (
            changed("/structures/1/name", json!("weir")),
            "structures[1].name",
            "used twice",
        ),
        (
            changed("/probes/0/at/structure/name", json!("dam")),
            "probes[0].at.structure.name",
            "no structure with this name",
        ),
    ] {
        let found = problems(&case);
        assert!(
            found.iter().any(|p| p.path == path
                && p.reason.contains(part)
                && p.severity == Severity::Error),
            "{path}: {found:#?}"
        );
    }
    // A wall in water acts on grains only, which a message states; a wall on the floor of the domain is not in the
    // water.
    let mut case = weir(&json!({"bounce_back": {}}));
    case["walls"] = json!([
        {"name": "gate", "shape": {"plane": {"point": [0.018, 0.01], "normal": [-1, 0]}}, "material": "disc"},
        {"name": "floor", "shape": {"plane": {"point": [0, 0], "normal": [0, 1]}}, "material": "disc"}
    ]);
    let found = problems(&case);
    let said: Vec<&Problem> = found
        .iter()
        .filter(|p| p.path.starts_with("walls"))
        .collect();
    assert_eq!(said.len(), 1, "{found:#?}");
    assert_eq!(said[0].path, "walls[0]");
    assert!(said[0].reason.contains("for grains only") && said[0].severity == Severity::Warning);
}

/// Returns grains that slide down an inclined periodic chute, whose floor is a saw-tooth surface of 10 degrees in
/// STL that begins and ends in the middle of the domain; a bar of several periods lies across it. Floor and bar
/// cross both periodic faces.
fn chute(folder: &Path) -> Value {
    let (edge, depth, rise) = (0.024, 0.012, 0.001);
    let mut text = String::from("solid saw\n");
    let teeth = [
        [-0.5, 0.0],
        [-0.25, rise],
        [0.0, 0.0],
        [0.25, rise],
        [0.5, 0.0],
    ];
    for pair in teeth.windows(2) {
        let corner = |k: usize, y: f64| [pair[k][0] * edge, y, 0.003 + pair[k][1]];
        let (a, b) = (corner(0, -0.004), corner(1, -0.004));
        let (c, d) = (corner(1, depth - 0.004), corner(0, depth - 0.004));
        for triangle in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 1\nouter loop\n";
            for [x, y, z] in triangle {
                writeln!(text, "vertex {x} {y} {z}").unwrap();
            }
            text += "endloop\nendfacet\n";
        }
    }
    text += "endsolid saw\n";
    let file = folder.join("saw.stl");
    std::fs::write(&file, text).unwrap();
    let grains: Vec<Value> = (0..24)
        .map(|k| {
            let (x, y, z) = (f64::from(k % 6), f64::from(k / 6 % 2), f64::from(k / 12));
            json!({
                "position": [0.001 + 0.004 * x, 0.002 + 0.006 * y, 0.0065 + 0.004 * z],
                "radius": 0.0014 + 1e-5 * f64::from(k), "velocity": [0.9, 0.4, 0]
            })
        })
        .collect();
    json!({
        "domain": {"size": [edge, depth, 0.03], "spacing": 0.001, "periodic": ["x", "y"]},
        "gravity": [3.4, 0.5, -9.2],
        "materials": {"glass": {"density": 2500}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 5000}, "normal_damping_ratio": 0.2,
            "friction_angle_degrees": 17}},
        "structures": [
            {"name": "floor", "shape": {"surface": {"mesh": {"path": file}, "thickness": 0.0001}}},
            {"name": "bar", "shape": {"box": {"from": [0.02, -0.1, 0.001], "to": [0.021, 0.1, 0.0045]}}}
        ],
        "grains": {"material": "glass", "initial": {"list": grains}},
        "checkpoint": {"every": 0.006},
        "time": {"end": 0.02}
    })
}

#[test]
fn grains_on_facets_across_periodic_faces_have_the_same_bits_on_any_ranks_and_after_a_restart() {
    let _beside = beside_others();
    let folder = tempfile::tempdir().unwrap();
    let study = Study::new(&chute(folder.path()).to_string());
    study.run("straight", 1, 1, &[]);
    study.run("three", 3, 1, &["domain.split=x"]);
    study.same("straight", "three");
    study.run("parts", 2, 1, &["domain.split=y", "time.end=0.011"]);
    study.restart("parts", 1, &["time.end=0.02"]).expect(0);
    study.same("straight", "parts");
    // No grain fell through the floor.
    assert_eq!(study.summary("straight")["grains"], 24);
}
