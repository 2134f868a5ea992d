//! Water in joints as the fluid of a case: the amplification of a closed joint, a network with the same bits on any
//! ranks, and messages.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::{Document, examples};
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use std::path::Path;

#[test]
fn a_closed_joint_amplifies_like_the_exact_layer() {
    let _beside = beside_others();
    let study = Study::new(examples::find("joint-pulse").unwrap().text);
    study.run("run", 1, 1, &[]);
    let path = study.path("run").join("probe_end.csv");
    let rows = io::table::read(&path).unwrap();
    let (times, pressures) = (
        rows.column("time").unwrap(),
        rows.column("pressure").unwrap(),
    );
    // The last four periods are evaluated.
    let late = times.iter().zip(&pressures);
    let late = late.filter(|(time, _)| **time > 1.2 - 4.0 / 23.83);
    let most = late.fold(0.0_f64, |most, (_, pressure)| most.max(pressure.abs()));
    println!("amplification {}", most / 10.0);
    assert!((most / 10.0 / 9.7265 - 1.0).abs() < 0.02);
    let joints = &study.summary("run")["joints"];
    assert!(
        joints["mass_error"].as_f64().unwrap().abs() < 1e-10,
        "{joints}"
    );
    assert_eq!(joints["joints"], 1);
}

/// Returns a joint set with a constant spacing \[m\].
fn set(dip: f64, direction: f64, spacing: f64) -> Value {
    json!({
        "dip_degrees": dip, "dip_direction_degrees": direction, "spacing": {"constant": spacing}
    })
}

/// Returns a bed of bricks with joints in three directions, under a table of pressures at one side of its top and
/// an oscillating pressure at the other.
fn bed() -> Value {
    json!({
        "domain": {"size": [1, 0.6, 0.5], "spacing": 0.1},
        "gravity": [0, 0, -9.81],
        "materials": {"rock": {"density": 2650}},
        "blocks": {
            "material": "rock",
            "initial": {"joints": {
                "rock_mass": {"box": {"from": [0.1, 0.1, 0.1], "to": [0.9, 0.5, 0.4]}},
                "sets": [set(0.0, 0.0, 0.15), set(90.0, 90.0, 0.21), set(80.0, 0.0, 0.17)],
                "aperture": 1e-3
            }},
            "fixed": [{"from": [0, 0, 0], "to": [1, 0.6, 0.5]}]
        },
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 35}},
        "fluid": {"joints": {
            "density": 1000, "viscosity": 1e-3, "time_step": 1e-4, "largest_aperture": 0.004, "residual_aperture": 1e-5,
            "cell": 0.05, "air_content": 0.002, "roughness": 1e-4,
            "vapour_pressure": 2339,
            "mouths": [
                {"name": "jet", "box": {"from": [0, 0, 0.39], "to": [0.5, 0.6, 0.41]},
                    "pressure": {"table": [[0, 1e3], [1e-3, 4e4], [3e-3, 5e3]]}},
                {"name": "pool", "box": {"from": [0.5, 0, 0.39], "to": [1, 0.6, 0.41]},
                    "pressure": {"harmonic": {"mean": 1e3, "amplitude": 500, "frequency": 200}}}
            ]
        }},
        "probes": [
            {"name": "jet", "every": 1e-3, "at": {"mouth": {"name": "jet"}}},
            {"name": "inside", "every": 1e-3, "at": {"joint": {"position": [0.5, 0.3, 0.25]}}},
            {"name": "block", "every": 1e-3, "at": {"block": {"position": [0.55, 0.33, 0.33]}}}
        ],
        "checkpoint": {"every": 3e-3},
        "time": {"end": 8e-3}
    })
}

#[test]
fn a_network_has_the_same_bits_on_any_ranks_and_threads_and_after_restarts() {
    let _beside = beside_others();
    let study = Study::new(&bed().to_string());
    study.run("straight", 1, 1, &[]);
    let joints = &study.summary("straight")["joints"];
    println!("{joints}");
    assert!(joints["joints"].as_u64().unwrap() > 30, "{joints}");
    assert!(
        joints["mass_error"].as_f64().unwrap().abs() < 1e-10,
        "{joints}"
    );
    study.same_on(&[
        ("threads", 1, 2, ""),
        ("two", 2, 1, ""),
        ("four along y", 4, 1, "domain.split=y"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0042"]);
    study.restart("parts", 1, &["time.end=0.008"]).expect(0);
    study.same("straight", "parts");
}

/// Returns the bed with a row of blocks at its top that can move, under a pulse that lifts some of them.
fn loose_bed() -> Value {
    let mut case = bed();
    case["blocks"]["fixed"] = json!([
        {"from": [0, 0, 0], "to": [1, 0.6, 0.25]},
        {"from": [0, 0, 0], "to": [0.3, 0.6, 0.5]}, {"from": [0.75, 0, 0], "to": [1, 0.6, 0.5]}
    ]);
    case["contact"]["blocks"]["normal_stiffness"] = json!({"per_area": 1e7});
    let water = &mut case["fluid"]["joints"];
    water["residual_aperture"] = json!(1e-4);
    water["mouths"][1]["presses_on_blocks"] = json!(true);
    water["mouths"][0]["pressure"] =
        json!({"table": [[0, 1e3], [1e-3, 2e5], [6e-3, 2e5], [7e-3, 1e3]]});
    case
}

#[test]
fn blocks_in_their_water_have_the_same_bits_on_any_ranks_and_threads_and_after_restarts() {
    let _beside = beside_others();
    let study = Study::new(&loose_bed().to_string());
    study.run("straight", 1, 1, &[]);
    let joints = &study.summary("straight")["joints"];
    println!("{joints}");
    let error = joints["mass_error"].as_f64().unwrap();
    assert!(error.abs() < 1e-10, "{joints}");
    let path = study.path("straight").join("probe_block.csv");
    let rows = io::table::read(&path).unwrap();
    let heights = rows.column("z").unwrap();
    let rise = heights.last().unwrap() - heights[0];
    println!("rise {rise:e} m");
    assert!(rise.abs() > 1e-6);
    study.same_on(&[
        ("threads", 1, 2, ""),
        ("two", 2, 1, ""),
        ("four along y", 4, 1, "domain.split=y"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0042"]);
    study.restart("parts", 1, &["time.end=0.008"]).expect(0);
    study.same("straight", "parts");
}

#[test]
fn links_that_threads_share_have_the_same_bits() {
    let _beside = beside_others();
    let mut case = loose_bed();
    // Several thousand links, of which each thread has at least 1,500.
    case["fluid"]["joints"]["cell"] = json!(0.02);
    case["time"]["end"] = json!(2e-3);
    let study = Study::new(&case.to_string());
    study.run("straight", 1, 1, &[]);
    let cells = study.summary("straight")["joints"]["cells"].clone();
    println!("{cells} cells");
    assert!(cells.as_u64().unwrap() > 2000);
    study.same_on(&[("two", 1, 2, ""), ("three", 1, 3, "")]);
}

#[test]
fn a_flush_block_leaves_its_bed_by_the_law_of_its_film() {
    let _beside = beside_others();
    let study = Study::new(examples::find("plucked-block").unwrap().text);
    study.run("run", 1, 2, &[]);
    let rows = io::table::read(&study.path("run").join("probe_block.csv")).unwrap();
    let column = |name: &str| rows.column(name).unwrap();
    let (times, heights, speeds) = (column("time"), column("z"), column("velocity_z"));
    let (side, height, residual) = (0.2_f64, 0.1, 4e-4);
    let threshold = (2650.0 - 1000.0) * 9.81 * height;
    let (area, mass) = (side * side, 2650.0 * side * side * height);
    let gap = |row: usize| heights[row] - 0.15;
    // It rests until the pressure carries its weight, at 0.12 s.
    let at = |time: f64| times.iter().position(|t| *t > time - 1e-9).unwrap();
    println!(
        "gap {:e} m at 0.12 s, {:e} m at 0.22 s",
        gap(at(0.12)),
        gap(at(0.22))
    );
    assert!(gap(at(0.12)) < 0.0);
    // Momentum between the time at which it leaves the contact and that of a film of 0.8 mm: impulse of the pressure
    // beyond the threshold = film of a square + side joints + momentum of the block.
    let first = (0..times.len()).find(|row| gap(*row) > 0.0).unwrap();
    let last = (0..times.len()).find(|row| gap(*row) > 8e-4).unwrap();
    let pressure = |time: f64| (16186.5 * (time - 0.02)).clamp(0.0, 3237.3) - threshold;
    let steps = 10_000;
    let width = (times[last] - times[first]) / f64::from(steps);
    let middles = (0..steps).map(|k| times[first] + width * (f64::from(k) + 0.5));
    let impulse: f64 = middles.map(|time| pressure(time) * area * width).sum();
    let film = |gap: f64| {
        // The residual aperture up to itself, then the gap.
        let wide = gap.max(residual);
        gap.min(residual) / residual.powi(3) + 0.5 * (residual.powi(-2) - wide.powi(-2))
    };
    let viscous = 0.42173 * 1e-3 * side.powi(4) * (film(gap(last)) - film(gap(first)));
    let sides = 4.0 * side * 0.005_f64.powi(3) / (12.0 * 1e-3 * height);
    let sides = area * area / sides * (gap(last) - gap(first));
    let momentum = mass * (speeds[last] - speeds[first]);
    let found = (viscous + sides + momentum) / impulse;
    println!("film {viscous}, sides {sides}, momentum {momentum}, impulse {impulse} N s: {found}");
    assert!((found - 1.0).abs() < 0.01);
    let joints = &study.summary("run")["joints"];
    println!("{joints}");
    assert!(joints["mass_error"].as_f64().unwrap().abs() < 1e-10);
    let left = joints["blocks_left"].as_array().unwrap();
    assert!(left.len() == 1 && left[0]["block"] == 0, "{joints}");
    let left = left[0]["time"].as_f64().unwrap();
    assert!(left > 0.2 && left < 0.5);
}

fn problems(case: &Value) -> Vec<Problem> {
    let read = Document::read(&case.to_string(), &[], Path::new("."));
    match read.and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

#[test]
fn wrong_joints_are_refused_with_one_finding_each() {
    assert!(problems(&bed()).is_empty(), "{:#?}", problems(&bed()));
    let water = "/fluid/joints";
    let wrong = [
        (
            "/largest_aperture",
            json!(0.2),
            "fluid.joints.largest_aperture",
            "thick",
        ),
        (
            "/largest_aperture",
            json!(1e-4),
            "fluid.joints.largest_aperture",
            "no two faces",
        ),
        (
            "/residual_aperture",
            json!(0.01),
            "fluid.joints.residual_aperture",
            "largest",
        ),
        ("/cell", json!(1e-4), "fluid.joints.cell", "at most"),
        (
            "/vapour_pressure",
            json!(2e5),
            "fluid.joints.vapour_pressure",
            "boils",
        ),
        (
            "/mouths/0/box/from/2",
            json!(0.405),
            "fluid.joints.mouths[0].box",
            "midpoint of any edge",
        ),
        (
            "/mouths/1/name",
            json!("jet"),
            "fluid.joints.mouths[1].name",
            "twice",
        ),
        (
            "/mouths/0/pressure/table",
            json!([[1, 0], [0, 0]]),
            "fluid.joints.mouths[0].pressure.table",
            "increase",
        ),
        (
            "/mouths/1/pressure",
            json!({"constant": -1e5}),
            "fluid.joints.mouths[1].pressure",
            "vapour",
        ),
        ("/time_step", json!(1e-3), "fluid.joints.time_step", "steps"),
    ];
    for (field, value, path, reason) in wrong {
        let mut case = bed();
        *case.pointer_mut(&format!("{water}{field}")).unwrap() = value;
        let found = problems(&case);
        assert_eq!(found.len(), 1, "{field}: {found:#?}");
        assert!(
            found[0].path == path && found[0].reason.contains(reason),
            "{found:#?}"
        );
    }
    let mut none = bed();
    none["fluid"]["joints"]["mouths"] = json!([]);
    none["probes"] = json!([]);
    let found = problems(&none);
    assert!(
        found.len() == 1 && found[0].path == "fluid.joints.mouths",
        "{found:#?}"
    );
    assert!(
        problems(&loose_bed()).is_empty(),
        "{:#?}",
        problems(&loose_bed())
    );
    let contact = "/contact/blocks";
    for (field, value, path) in [
        (
            format!("{contact}/mass_damping"),
            json!(1.0),
            "contact.blocks.mass_damping",
        ),
        (
            format!("{contact}/normal_stiffness"),
            json!({"per_area": 1e13}),
            "fluid.joints.time_step",
        ),
    ] {
        let mut damped = loose_bed();
        damped["contact"]["blocks"]["mass_damping"] = json!(0.0);
        *damped.pointer_mut(&field).unwrap() = value;
        let found = problems(&damped);
        assert!(found.len() == 1 && found[0].path == path, "{found:#?}");
    }
    let mut probed = bed();
    probed["probes"][0]["at"] = json!({"mouth": {"name": "weir"}});
    probed["probes"][2]["at"]["block"]["position"] = json!([0.05, 0.05, 0.05]);
    probed["coupling"] = json!({"bounce_back": {}});
    let found = problems(&probed);
    let paths: Vec<&str> = found.iter().map(|problem| problem.path.as_str()).collect();
    let expected = [
        "coupling",
        "probes[0].at.mouth.name",
        "probes[2].at.block.position",
    ];
    assert_eq!(paths, expected, "{found:#?}");
    assert!(
        found
            .iter()
            .all(|problem| problem.severity == Severity::Error)
    );
    let mut lattice: Value = serde_json::from_str(examples::find("cavity").unwrap().text).unwrap();
    lattice["probes"] = json!([{"name": "a", "every": 1, "at": {"mouth": {"name": "b"}}}]);
    let found = problems(&lattice);
    assert!(
        found.iter().any(|p| p.reason.contains("fluid.joints")),
        "{found:#?}"
    );
}

/// Returns the steady-state water in the joints of a case.
fn water(case: &Value) -> Result<solver::coupling::joint_water::JointWater, Vec<Problem>> {
    let read = Document::read(&case.to_string(), &[], Path::new("."));
    let plan = read.and_then(Plan::prepare)?;
    Ok(solver::simulation::setup::joints(&plan).unwrap().unwrap())
}

/// Advances the water in joints alone; returns the largest and the smallest pressure.
fn steps(water: &mut solver::coupling::joint_water::JointWater, number: usize) -> [f64; 2] {
    use solver::coupling::Flow;
    use solver::dem::particles::Particles;
    use solver::dem::space::Volume;
    let domain = decomposition::Domain::serial(decomposition::SplitAxis::X, 10, false);
    let mut particles = Particles::<Volume>::new();
    for _ in 0..number {
        water.advance(&mut particles, &domain).unwrap();
    }
    water.balance().pressure
}

#[test]
fn forty_random_rock_masses_keep_their_water() {
    let mut state = 12_345_u64;
    let mut draw = |from: f64, to: f64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        from + (to - from) * f64::from(u32::try_from(state >> 40).unwrap()) / f64::from(1_u32 << 24)
    };
    let mut most = 0;
    for scene in 0..40 {
        let mut case = bed();
        let sets: Vec<Value> = (0..3)
            .map(|k| {
                json!({
                    "dip_degrees": if k == 0 { draw(0.0, 20.0) } else { draw(60.0, 90.0) },
                    "dip_direction_degrees": draw(0.0, 120.0) + 120.0 * f64::from(k),
                    "spacing": {"uniform": {"min": 0.08, "max": draw(0.1, 0.25)}},
                    "persistence": draw(0.5, 1.0)
                })
            })
            .collect();
        // A probe could be in a joint of a random rock mass.
        case["probes"] = json!([]);
        case["blocks"]["initial"]["joints"]["sets"] = json!(sets);
        case["blocks"]["initial"]["joints"]["seed"] = json!(scene);
        // Closed, thin and open joints.
        let aperture = [0.0, 1e-4, 1.5e-3][scene % 3];
        case["blocks"]["initial"]["joints"]["aperture"] = json!(aperture);
        case["blocks"]["initial"]["joints"]["smallest_thickness"] = json!(0.02);
        let water_of = &mut case["fluid"]["joints"];
        water_of["air_content"] = json!([0.0, 0.01, 0.2][scene / 3 % 3]);
        water_of["inertia"] = json!(scene % 2 == 0);
        if scene % 5 == 0 {
            water_of["roughness"] = Value::Null;
        }
        let found = water(&case);
        let mut found = found.unwrap_or_else(|problems| panic!("scene {scene}: {problems:#?}"));
        let [low, high] = steps(&mut found, 40);
        let error = found.mass_error();
        let network = found.flow().network();
        most = most.max(network.joints.len());
        println!(
            "scene {scene}: {} joints, {} nodes, {} open edges, {low:.0} to {high:.0} Pa, mass error {error:.1e}",
            network.joints.len(),
            network.nodes(),
            network.open.len()
        );
        assert!(
            error.abs() < 1e-10 && low.is_finite() && high < 1e7,
            "scene {scene}"
        );
        assert!(
            low > 2339.0 - 101_325.0 - 100.0 - 1e-6,
            "scene {scene}: {low}"
        );
    }
    assert!(most > 100);
}

/// Returns a block in a socket of fixed rock on a slab whose edges have this length \[m\]; the pressure at the rim
/// throws it out.
fn socket(slab: f64) -> Value {
    let cuboid = |edges: [f64; 3], position: [f64; 3]| {
        let shape = json!({"cuboid": {"edges": edges}});
        json!({"shape": shape, "position": position})
    };
    let fixed = |from: [f64; 3], to: [f64; 3]| json!({"from": from, "to": to});
    json!({
        "domain": {"size": [0.8, 0.8, 0.8], "spacing": 0.1},
        "gravity": [0, 0, -9.81],
        "materials": {"rock": {"density": 2650}},
        "blocks": {
            "material": "rock",
            "initial": {"list": [
                cuboid([0.2, 0.2, 0.1], [0.4, 0.4, 0.15]),
                cuboid([slab, slab, 0.05], [0.4, 0.4, 0.075]),
                cuboid([0.1, 0.4, 0.1], [0.551, 0.4, 0.15]),
                cuboid([0.1, 0.4, 0.1], [0.249, 0.4, 0.15]),
                cuboid([0.2, 0.1, 0.1], [0.4, 0.551, 0.15]),
                cuboid([0.2, 0.1, 0.1], [0.4, 0.249, 0.15])
            ]},
            "fixed": [
                fixed([0.0, 0.0, 0.0], [0.8, 0.8, 0.1]),
                fixed([0.0, 0.0, 0.1], [0.3, 0.8, 0.3]),
                fixed([0.5, 0.0, 0.1], [0.8, 0.8, 0.3]),
                fixed([0.3, 0.0, 0.1], [0.5, 0.3, 0.3]),
                fixed([0.3, 0.5, 0.1], [0.5, 0.8, 0.3])
            ]
        },
        "contact": {"blocks": {
            "normal_stiffness": {"per_area": 2e7}, "friction_angle_degrees": 35, "normal_damping_ratio": 0.3
        }},
        "fluid": {"joints": {
            "density": 1000, "viscosity": 1e-3, "time_step": 1e-4, "largest_aperture": 0.02,
            "residual_aperture": 2e-4, "cell": 0.05, "inertia": false,
            "mouths": [{"name": "bed", "box": {"from": [0, 0, 0.19], "to": [0.8, 0.8, 0.21]},
                "pressure": {"table": [[0, 0], [0.05, 20_000]]}}]
        }},
        "time": {"end": 0.3},
        "probes": [{"name": "block", "every": 0.05, "at": {"block": {"position": [0.4, 0.4, 0.15]}}}]
    })
}

/// Checks that a block leaves its socket alike whether the slab below it ends at its edges or carries its neighbours.
#[test]
fn a_block_leaves_its_socket_whatever_its_neighbours_stand_on() {
    let _beside = beside_others();
    let [wide, narrow] = [0.6, 0.2].map(|slab| {
        let study = Study::new(&socket(slab).to_string());
        study.run("run", 1, 1, &[]);
        let path = study.path("run").join("probe_block.csv");
        let rows = io::table::read(&path).unwrap();
        let last = |name: &str| *rows.column(name).unwrap().last().unwrap();
        (last("z"), last("velocity_z"), last("force_z"))
    });
    println!("{wide:?} {narrow:?}");
    assert!(wide.0 > 0.31 && wide.1 > 0.9, "{wide:?}");
    assert!((wide.0 - narrow.0).abs() < 1e-3, "{wide:?} {narrow:?}");
    assert!(wide.2.abs() < 1e-9, "no water acts on it: {wide:?}");
}

/// Checks that a block which the water throws out over the open top is counted, and flies on under its weight alone, on
/// any number of ranks.
#[test]
fn a_block_that_is_thrown_out_of_the_domain_flies_on() {
    let _beside = beside_others();
    let text = examples::find("plucked-block").unwrap().text;
    let mut case: Value = serde_json::from_str(text).unwrap();
    case["fluid"]["joints"]["mouths"][0]["pressure"]["table"] =
        json!([[0, 0], [0.02, 0], [0.04, 1e5]]);
    case["time"]["end"] = json!(0.2);
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    study.run("two", 2, 1, &[]);
    study.same("one", "two");
    let summary = study.summary("one");
    let left = &summary["left_the_domain"];
    assert_eq!(left.as_array().map(Vec::len), Some(1), "{summary:#}");
    assert_eq!([&left[0]["name"], &left[0]["face"]], ["block 0", "z_max"]);
    assert_eq!(study.summary("two")["left_the_domain"], *left);
    let warnings = summary["warnings"].to_string();
    assert!(
        warnings.contains("the block 0 left through the face z_max"),
        "{warnings}"
    );
    let rows = io::table::read(&study.path("one").join("probe_block.csv")).unwrap();
    let last = |name: &str| {
        let column = rows.column(name).unwrap();
        [column[column.len() - 2], column[column.len() - 1]]
    };
    let (z, speed) = (last("z"), last("velocity_z"));
    let time = last("time");
    let step = time[1] - time[0];
    assert!(
        z[0] > 1.0 && left[0]["time"].as_f64().unwrap() < time[0],
        "{z:?}"
    );
    assert!(
        (speed[1] - speed[0] + 9.81 * step).abs() < 1e-9,
        "{speed:?}"
    );
    let way = 0.5 * (speed[0] + speed[1]) * step;
    assert!((z[1] - z[0] - way).abs() < 1e-9, "{z:?} {speed:?}");
}
