//! Water in joints under a lattice: discharge between two pools, both waters kept together, the same bits, messages.

use crate::ranks::{Study, beside_others};
use decomposition::{Domain, SplitAxis};
use serde_json::{Value, json};
use solver::case::Document;
use solver::coupling::Flow;
use solver::dem::particles::Particles;
use solver::dem::space::Volume;
use solver::error::{Problem, Severity};
use solver::lbm::fluid::Fluid;
use solver::plan::Plan;
use solver::simulation::{coupled, setup};
use std::path::Path;

const GAP: f64 = 1e-3;
const LENGTH: f64 = 0.1;

/// Returns two pools of an oil that a block divides, with a joint of 1 mm below the block.
fn pools(boundaries: &Value) -> Value {
    let half = 0.5 * GAP;
    json!({
        "domain": {"size": [0.4, 0.05, 0.09], "spacing": 0.01},
        "materials": {"rock": {"density": 2650}},
        "blocks": {
            "material": "rock",
            "initial": {"list": [
                {"shape": {"cuboid": {"edges": [0.4, 0.05, 0.04 - half]}},
                    "position": [0.2, 0.025, 0.02 - 0.5 * half]},
                {"shape": {"cuboid": {"edges": [LENGTH, 0.05, 0.05 - half]}},
                    "position": [0.2, 0.025, 0.065 + 0.5 * half]}
            ]},
            "fixed": [{"from": [0, 0, 0], "to": [0.4, 0.05, 0.09]}]
        },
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 35}},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 1e-3, "collision": {"trt": {}},
            "boundaries": boundaries,
            "joints": {"largest_aperture": 0.005, "residual_aperture": 1e-5, "cell": 0.01}
        }},
        "probes": [
            {"name": "block", "every": 0.01, "at": {"block": {"position": [0.2, 0.025, 0.07]}}},
            {"name": "left", "every": 0.01, "at": {"joint": {"position": [0.15, 0.025, 0.04]}}},
            {"name": "right", "every": 0.01, "at": {"joint": {"position": [0.25, 0.025, 0.04]}}}
        ],
        "time": {"end": 1.0}
    })
}

/// Returns the boundaries of two pools under these pressures \[Pa\].
fn pressures(left: f64, right: f64) -> Value {
    let pressure = |value: f64| json!({"pressure": {"value": value, "ramp": {"duration": 0.2}}});
    json!([
        {"name": "left", "face": "x_min", "condition": pressure(left)},
        {"name": "right", "face": "x_max", "condition": pressure(right)}
    ])
}

/// Returns the mean of the last half of a column.
fn late(rows: &io::table::Rows, name: &str) -> f64 {
    let column = rows.column(name).unwrap();
    let late = &column[column.len() / 2..];
    late.iter().sum::<f64>() / f64::from(u32::try_from(late.len()).unwrap())
}

#[test]
fn the_joint_between_two_pools_has_a_linear_pressure_and_lifts_its_block() {
    let _beside = beside_others();
    let (left, right) = (60.0, 20.0);
    let study = Study::new(&pools(&pressures(left, right)).to_string());
    study.run("run", 1, 2, &[]);
    let read = |name: &str| {
        let path = study.path("run").join(format!("probe_{name}.csv"));
        io::table::read(&path).unwrap()
    };
    // The middles of the first and the last of ten cells.
    for (name, exact) in [
        ("left", left + (right - left) * 0.05),
        ("right", left + (right - left) * 0.95),
    ] {
        let found = late(&read(name), "pressure");
        println!("{name}: {found} Pa, exact {exact} Pa");
        assert!((found - exact).abs() < 0.01 * (left - right));
    }
    let block = read("block");
    let [lift, push] = ["force_z", "force_x"].map(|name| late(&block, name));
    let exact = [
        0.5 * (left + right) * LENGTH * 0.05,
        (left - right) * 0.05 * 0.05,
    ];
    println!(
        "lift {lift} N, exact {} N; push {push} N, exact {} N",
        exact[0], exact[1]
    );
    assert!((lift / exact[0] - 1.0).abs() < 0.01);
    assert!((push / exact[1] - 1.0).abs() < 0.02);
    let joints = &study.summary("run")["joints"];
    println!("{joints}");
    assert!(joints["mass_error"].as_f64().unwrap().abs() < 1e-10);
}

/// Checks that water leaves the joint below a block whose edge stands flush with a joint of its base: both joints meet
/// on a line in front of the water.
#[test]
fn joints_that_meet_in_front_of_the_water_are_open() {
    let _beside = beside_others();
    let (left, right) = (60.0, 20.0);
    let mut case = pools(&pressures(left, right));
    let edge = 0.2 + 0.5 * LENGTH;
    let height = 0.04 - 0.5 * GAP;
    let base = |from: f64, to: f64| {
        json!({"shape": {"cuboid": {"edges": [to - from, 0.05, height]}},
            "position": [0.5 * (from + to), 0.025, 0.5 * height]})
    };
    let blocks = case["blocks"]["initial"]["list"].as_array_mut().unwrap();
    blocks[0] = base(0.0, edge);
    blocks.push(base(edge + GAP, 0.4));
    let at = json!({"joint": {"position": [edge + 0.5 * GAP, 0.025, 0.02]}});
    let probes = case["probes"].as_array_mut().unwrap();
    probes.push(json!({"name": "upright", "every": 0.01, "at": at}));
    let study = Study::new(&case.to_string());
    study.run("run", 1, 2, &[]);
    for (name, exact) in [
        ("left", left + (right - left) * 0.05),
        ("right", left + (right - left) * 0.95),
        ("upright", right),
    ] {
        let path = study.path("run").join(format!("probe_{name}.csv"));
        let found = late(&io::table::read(&path).unwrap(), "pressure");
        println!("{name}: {found} Pa, exact {exact} Pa");
        assert!((found - exact).abs() < 0.02 * (left - right));
    }
}

/// Runs pools of thin liquids: friction of their joints is below the increase of the pressure of a cell of the lattice
/// by the discharge of a step, divided by the discharge.
#[test]
fn joints_of_up_to_half_a_cell_with_little_friction_are_stable() {
    let _beside = beside_others();
    let (left, right) = (60.0, 20.0);
    for (gap, cell, viscosity) in [
        (0.002, 0.01, 1e-5),
        (0.0045, 0.005, 1e-4),
        (0.005, 0.01, 1e-4),
    ] {
        let mut case = pools(&pressures(left, right));
        let half = 0.5 * gap;
        let list = &mut case["blocks"]["initial"]["list"];
        list[0]["shape"]["cuboid"]["edges"][2] = json!(0.04 - half);
        list[0]["position"][2] = json!(0.02 - 0.5 * half);
        list[1]["shape"]["cuboid"]["edges"][2] = json!(0.05 - half);
        list[1]["position"][2] = json!(0.065 + 0.5 * half);
        let water = &mut case["fluid"]["lattice_boltzmann"];
        water["kinematic_viscosity"] = json!(viscosity);
        water["joints"]["largest_aperture"] = json!(0.0051);
        water["joints"]["cell"] = json!(cell);
        let study = Study::new(&case.to_string());
        study.run("run", 1, 2, &[]);
        let read = |name: &str| {
            let path = study.path("run").join(format!("probe_{name}.csv"));
            io::table::read(&path).unwrap()
        };
        // The middles of the first and the last cell of the joint.
        let part = 0.5 * cell / LENGTH;
        for (name, part) in [("left", part), ("right", 1.0 - part)] {
            let (found, exact) = (late(&read(name), "pressure"), left + (right - left) * part);
            println!("{gap} m, {name}: {found} Pa, exact {exact} Pa");
            assert!((found - exact).abs() < 0.05 * (left - right));
        }
        let joints = &study.summary("run")["joints"];
        // A step of the pressure of a boundary is reflected once: at most twice the pressure.
        assert!(
            joints["largest_pressure"].as_f64().unwrap() < 2.0 * left,
            "{joints}"
        );
        assert!(
            joints["mass_error"].as_f64().unwrap().abs() < 1e-10,
            "{joints}"
        );
    }
}

/// Returns a case in which the joints make one step in this number of steps of the lattice.
fn with_steps(mut case: Value, lattice_steps: u32) -> Value {
    case["fluid"]["lattice_boltzmann"]["joints"]["lattice_steps"] = json!(lattice_steps);
    case
}

#[test]
fn a_lattice_and_its_joints_keep_their_water_together() {
    for lattice_steps in [1, 4] {
        keep_water(lattice_steps);
    }
}

fn keep_water(lattice_steps: u32) {
    // A closed box: more water on the left flows to the right, through the joint alone.
    let case = with_steps(pools(&json!([])), lattice_steps);
    let read = Document::read(&case.to_string(), &[], Path::new("."));
    let plan = read.and_then(Plan::prepare).unwrap();
    let domain = Domain::serial(SplitAxis::X, plan.scene.grid.cells[0], false);
    let (flow, units) = (plan.scene.flow.clone().unwrap(), plan.units.unwrap());
    let fluid = Fluid::<f64>::new(setup::fluid(&plan, &flow, &units).unwrap(), &domain).unwrap();
    let joints = setup::joints(&plan).unwrap().unwrap();
    let mut water = coupled::flow::<Volume, f64>(&plan, fluid, units).with_joints(joints);
    let mut particles = Particles::<Volume>::new();
    setup::blocks::shapes(&plan, &mut particles).unwrap();
    setup::blocks::blocks(&plan, domain.communicator(), &mut particles).unwrap();
    let mut dem = setup::dem::<Volume>(&plan, 0.05).unwrap();
    dem.prepare(&mut particles, &domain).unwrap();
    water.update_bodies(&mut particles, &domain).unwrap();
    let lattice = water.lattice_mut().unwrap().fluid_mut();
    let all: Vec<_> = lattice.populations().interior().collect();
    for (cell, position) in &all {
        if cell[0] < 15 {
            lattice.set_equilibrium(*position, 0.01, [0.0; 3]);
        }
    }
    let volume = 1e-6;
    let mass = |water: &solver::coupling::water::Water<Volume, f64>| {
        let lattice = water.lattice().unwrap();
        let fluid = lattice.fluid().populations();
        // Water inside blocks stays there.
        let mut sum = decomposition::ExactSum::new();
        for (_, position) in &all {
            sum.add(fluid.moments(*position).0 * volume);
        }
        sum.add(water.joints().unwrap().flow().stored());
        sum.add(water.joints().unwrap().on_its_way());
        (sum.value(), water.joints().unwrap().balance().entered)
    };
    let right = |water: &solver::coupling::water::Water<Volume, f64>| {
        let lattice = water.lattice().unwrap();
        lattice.state([39, 2, 6]).0
    };
    let (before, _) = mass(&water);
    let mut passed = 0.0_f64;
    // The last step of the lattice is the second after one of the joints: water is on its way.
    for _ in 0..402 {
        water.advance(&mut particles, &domain).unwrap();
        water.update_bodies(&mut particles, &domain).unwrap();
        passed = passed.max(mass(&water).1.abs());
    }
    let (after, _) = mass(&water);
    let error = (after - before) / before;
    println!(
        "water {before:e} m3, changed by {error:e} of it; {passed:e} m3 entered the joint; density on the right {:e}",
        right(&water)
    );
    // What enters at one mouth leaves at the other: the network keeps only what its pressure compresses.
    assert!(error.abs() < 1e-10 && passed > 0.0);
    assert!(right(&water) > 1e-8);
    let on_its_way = water.joints().unwrap().on_its_way();
    assert_eq!(on_its_way != 0.0, lattice_steps > 1, "{on_its_way:e}");
}

/// Returns a block flush with its bed under a stream that a pressure drives.
fn flush() -> Value {
    let fixed = |low: [f64; 3], high: [f64; 3]| {
        let edges: Vec<f64> = (0..3).map(|k| high[k] - low[k]).collect();
        let middle: Vec<f64> = (0..3).map(|k| 0.5 * (high[k] + low[k])).collect();
        json!({"shape": {"cuboid": {"edges": edges}}, "position": middle})
    };
    json!({
        "domain": {"size": [0.2, 0.06, 0.12], "spacing": 0.01},
        "gravity": [0, 0, -9.81],
        "materials": {"rock": {"density": 2650}},
        "blocks": {
            "material": "rock",
            "initial": {"list": [
                fixed([0.0, 0.0, 0.0], [0.2, 0.06, 0.02]),
                fixed([0.0, 0.0, 0.02], [0.0695, 0.06, 0.06]),
                fixed([0.0705, 0.0, 0.02], [0.1295, 0.06, 0.06]),
                fixed([0.1305, 0.0, 0.02], [0.2, 0.06, 0.06])
            ]},
            "fixed": [
                {"from": [0, 0, 0], "to": [0.2, 0.06, 0.02]}, {"from": [0, 0, 0], "to": [0.07, 0.06, 0.06]},
                {"from": [0.13, 0, 0], "to": [0.2, 0.06, 0.06]}
            ]
        },
        "contact": {"blocks": {
            "normal_stiffness": {"per_area": 1e7}, "friction_angle_degrees": 35, "normal_damping_ratio": 0.3
        }},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 2e-4, "collision": {"trt": {}},
            "boundaries": [
                {"name": "left", "face": "x_min",
                    "condition": {"pressure": {"value": 400, "ramp": {"duration": 0.01}}}},
                {"name": "right", "face": "x_max", "condition": {"pressure": {"value": 0}}}
            ],
            "joints": {"largest_aperture": 0.005, "residual_aperture": 2e-4, "cell": 0.01}
        }},
        "probes": [
            {"name": "block", "every": 0.002, "at": {"block": {"position": [0.1, 0.03, 0.04]}}},
            {"name": "joint", "every": 0.002, "at": {"joint": {"position": [0.07, 0.03, 0.05]}}}
        ],
        "checkpoint": {"every": 0.01},
        "time": {"end": 0.03}
    })
}

#[test]
fn a_flush_block_under_a_stream_has_the_same_bits_on_any_ranks_and_after_restarts() {
    let _beside = beside_others();
    let study = Study::new(&flush().to_string());
    study.run("straight", 1, 1, &[]);
    let joints = &study.summary("straight")["joints"];
    println!("{joints}");
    assert!(
        joints["mass_error"].as_f64().unwrap().abs() < 1e-10,
        "{joints}"
    );
    assert!(
        joints["largest_pressure"].as_f64().unwrap() > 20.0,
        "{joints}"
    );
    study.same_on(&[
        ("threads", 1, 2, ""),
        ("two", 2, 1, ""),
        ("three along z", 3, 1, "domain.split=z"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.014"]);
    study.restart("parts", 1, &["time.end=0.03"]).expect(0);
    study.same("straight", "parts");
}

/// Returns the flush block, held like its bed, with joints that make one step in this number of steps of the lattice.
fn held(lattice_steps: u32) -> Value {
    let mut case = with_steps(flush(), lattice_steps);
    case["blocks"]["fixed"] = json!([{"from": [0, 0, 0], "to": [0.2, 0.06, 0.12]}]);
    case["fluid"]["lattice_boltzmann"]["kinematic_viscosity"] = json!(5e-3);
    case
}

#[test]
fn several_steps_of_the_lattice_in_a_step_of_the_joints_have_the_same_bits() {
    let _beside = beside_others();
    let other = with_steps(pools(&pressures(60.0, 20.0)), 4);
    for (case, end) in [(held(3), 0.03), (other, 0.1)] {
        let study = Study::new(&case.to_string());
        let end = format!("time.end={end}");
        study.run("straight", 1, 1, &[&end]);
        let joints = &study.summary("straight")["joints"];
        assert!(
            joints["mass_error"].as_f64().unwrap().abs() < 1e-10,
            "{joints}"
        );
        study.run("threads", 1, 2, &[&end]);
        study.same("straight", "threads");
        study.run("three", 3, 1, &[&end, "domain.split=z"]);
        study.same("straight", "three");
        // 70 and 14 steps are no multiples; after 66 and 13 steps water returns in more than one step.
        study.run("parts", 2, 1, &["time.end=0.014"]);
        let other = "fluid.lattice_boltzmann.joints.lattice_steps=2";
        study.restart("parts", 1, &[&end, other]).expect(3);
        study.restart("parts", 1, &[&end]).expect(0);
        study.same("straight", "parts");
        study.run("later", 1, 1, &["time.end=0.0132"]);
        study.restart("later", 1, &[&end]).expect(0);
        study.same("straight", "later");
    }
}

#[test]
fn several_steps_of_the_lattice_in_a_step_of_the_joints_change_pulses_little() {
    let _beside = beside_others();
    let case = |steps: u32| {
        let mut case = held(steps);
        case["time"]["end"] = json!(0.06);
        case["probes"][1]["every"] = json!(6e-4);
        case
    };
    let study = |steps: u32| Study::new(&case(steps).to_string());
    let pressure = |steps: u32| {
        let study = study(steps);
        study.run("run", 1, 2, &[]);
        let rows = io::table::read(&study.path("run").join("probe_joint.csv")).unwrap();
        rows.column("pressure").unwrap().to_vec()
    };
    let [one, three] = [1, 3].map(pressure);
    let largest = |list: &[f64]| list.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
    let differences: Vec<f64> = one.iter().zip(&three).map(|(a, b)| a - b).collect();
    let [size, difference] = [&one, &differences].map(|list| largest(list));
    println!("largest pressure {size} Pa, largest difference {difference} Pa");
    assert_eq!(one.len(), three.len());
    assert!(size > 20.0 && difference < 0.05 * size);
}

fn problems(case: &Value) -> Vec<Problem> {
    let read = Document::read(&case.to_string(), &[], Path::new("."));
    match read.and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

#[test]
fn wrong_joints_under_a_lattice_are_refused_with_one_finding_each() {
    let good = with_steps(pools(&pressures(60.0, 20.0)), 1);
    assert!(problems(&good).is_empty(), "{:#?}", problems(&good));
    let water = "/fluid/lattice_boltzmann";
    let steps = "fluid.lattice_boltzmann.joints.lattice_steps";
    // A wave needs twelve steps along the longest joint.
    for (case, severity, reason) in [
        (with_steps(flush(), 2), Severity::Error, "1 block can move"),
        (held(13), Severity::Warning, "m, in 12.0"),
    ] {
        let found = problems(&case);
        assert_eq!(found.len(), 1, "{found:#?}");
        let problem = &found[0];
        assert!(
            problem.path == steps && problem.reason.contains(reason),
            "{found:#?}"
        );
        assert_eq!(problem.severity, severity);
    }
    assert!(problems(&held(2)).is_empty());
    // Contacts that are too stiff for one solid step in a step of the lattice: the proposed step is accepted.
    let mut stiff = flush();
    let proposal = |case: &Value, path: &str| {
        let found = problems(case);
        assert_eq!(found.len(), 1, "{found:#?}");
        assert_eq!(
            (&*found[0].path, found[0].severity),
            (path, Severity::Error)
        );
        let proposal = found[0].remedy.proposal();
        assert_eq!(proposal.len(), 1, "{found:#?}");
        let set = format!("{}={}", proposal[0].path, proposal[0].value);
        let read = Document::read(&case.to_string(), &[set], Path::new("."));
        let accepted = read.and_then(Plan::prepare);
        assert!(accepted.is_ok(), "{accepted:#?}");
        proposal[0].clone()
    };
    stiff["fluid"]["lattice_boltzmann"]["kinematic_viscosity"] = json!(0.02);
    stiff["contact"]["blocks"]["normal_stiffness"] = json!({"per_area": 3e9});
    let step = proposal(&stiff, "fluid.lattice_boltzmann.joints");
    assert_eq!(step.path, "fluid.lattice_boltzmann.time_step");
    assert!(step.value.as_f64().unwrap() < 2e-4);
    let mut several = flush();
    several["time"]["solid_steps_per_fluid_step"] = json!(4);
    let path = "time.solid_steps_per_fluid_step";
    assert_eq!(proposal(&several, path).value, json!(1));
    // Relaxation times of 0.53 and 0.5294.
    for (viscosity, number) in [(5e-3, 0), (4.9e-3, 1)] {
        let mut case = held(2);
        case["fluid"]["lattice_boltzmann"]["kinematic_viscosity"] = json!(viscosity);
        let found = problems(&case);
        let found: Vec<_> = found.iter().filter(|one| one.path == steps).collect();
        assert_eq!(found.len(), number, "{found:#?}");
        let unstable = |one: &&Problem| one.severity == Severity::Unstable;
        assert!(found.iter().all(unstable), "{found:#?}");
        case = with_steps(case, 1);
        assert!(problems(&case).iter().all(|one| one.path != steps));
    }
    let wrong = [
        (format!("{water}/joints/lattice_steps"), json!(17), steps),
        (
            format!("{water}/joints/largest_aperture"),
            json!(0.05),
            "fluid.lattice_boltzmann.joints.largest_aperture",
        ),
        (
            format!("{water}/storage"),
            json!("f32"),
            "fluid.lattice_boltzmann.storage",
        ),
        (
            "/coupling".to_owned(),
            json!({"partially_saturated": {}}),
            "coupling",
        ),
        (
            format!("{water}/joints/cell"),
            json!(0.009),
            "fluid.lattice_boltzmann.joints.cell",
        ),
    ];
    for (field, value, path) in wrong {
        let mut case = good.clone();
        let storage = &mut case["fluid"]["lattice_boltzmann"]["storage"];
        *storage = json!("f64");
        if path.ends_with(".cell") {
            // A joint of a cell of the lattice.
            case["blocks"]["initial"]["list"][1]["shape"]["cuboid"]["edges"][2] = json!(0.0405);
            case["blocks"]["initial"]["list"][1]["position"][2] = json!(0.06975);
            case["fluid"]["lattice_boltzmann"]["joints"]["largest_aperture"] = json!(0.02);
        }
        *case.pointer_mut(&field).unwrap() = value;
        let found = problems(&case);
        assert!(
            found.iter().any(|problem| problem.path == path),
            "{field}: {found:#?}"
        );
    }
}
