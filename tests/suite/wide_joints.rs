//! Joints of several cells under a lattice: loads by the network and by the lattice, both waters kept together, joints
//! that the lattice takes over, the same bits, the plan.

use crate::ranks::{Study, beside_others};
use decomposition::{Domain, ExactSum, SplitAxis};
use serde_json::{Value, json};
use solver::case::Document;
use solver::coupling::Flow;
use solver::dem::particles::Particles;
use solver::dem::space::Volume;
use solver::lbm::fluid::Fluid;
use solver::plan::Plan;
use solver::simulation::{coupled, setup};
use std::path::Path;

const SPACING: f64 = 0.01;
const LENGTH: f64 = 0.2;
const WIDTH: f64 = 0.05;

/// Returns a cuboid between two corners \[m\].
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Value {
    let edges: Vec<f64> = (0..3).map(|k| high[k] - low[k]).collect();
    let middle: Vec<f64> = (0..3).map(|k| 0.5 * (high[k] + low[k])).collect();
    json!({"shape": {"cuboid": {"edges": edges}}, "position": middle})
}

/// Returns two pools that a block divides up to the top of the domain, with a joint of four cells below it.
fn pools(boundaries: &Value, method: &str) -> Value {
    json!({
        "domain": {"size": [0.4, WIDTH, 0.14], "spacing": SPACING},
        "materials": {"rock": {"density": 2650}},
        "blocks": {
            "material": "rock",
            "initial": {"list": [
                cuboid([0.0, 0.0, 0.0], [0.4, WIDTH, 0.05]), cuboid([0.1, 0.0, 0.09], [0.3, WIDTH, 0.14])
            ]},
            "fixed": [{"from": [0, 0, 0], "to": [0.4, WIDTH, 0.14]}]
        },
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 35}},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 1e-3, "collision": {"trt": {}},
            "boundaries": boundaries,
            "joints": {
                "method": method, "largest_aperture": 0.045, "residual_aperture": 1e-5, "cell": 0.02
            }
        }},
        "probes": [{"name": "block", "every": 0.01, "at": {"block": {"position": [0.2, 0.025, 0.115]}}}],
        "checkpoint": {"every": 0.01},
        "time": {"end": 2.0}
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

/// Returns a column of the probe of the block in a run.
fn of_block(study: &Study, run: &str, name: &str) -> Vec<f64> {
    let path = study.path(run).join("probe_block.csv");
    io::table::read(&path).unwrap().column(name).unwrap()
}

/// Returns the mean of the last quarter of a column.
fn late(column: &[f64]) -> f64 {
    let late = &column[column.len() - column.len() / 4..];
    late.iter().sum::<f64>() / f64::from(u32::try_from(late.len()).unwrap())
}

/// Returns two pools below a block of this length that is periodic along y, with a joint of four cells below it.
fn between_pools(length: f64, method: &str) -> Value {
    let far = 0.1 + length;
    let mut case = pools(&pressures(6.0, 0.0), method);
    case["domain"]["size"] = json!([far + 0.1, WIDTH, 0.14]);
    case["domain"]["periodic"] = json!(["y"]);
    case["blocks"]["initial"]["list"] = json!([
        cuboid([0.0, 0.0, 0.0], [far + 0.1, WIDTH, 0.05]),
        cuboid([0.1, 0.0, 0.09], [far, WIDTH, 0.14])
    ]);
    case["blocks"]["fixed"] = json!([{"from": [0, 0, 0], "to": [far + 0.1, WIDTH, 0.14]}]);
    case["probes"][0]["at"]["block"]["position"] = json!([0.1 + 0.5 * length, 0.025, 0.115]);
    if method == "network" {
        let probe = |name: &str, x: f64| {
            let at = json!({"joint": {"position": [x, 0.025, 0.07]}});
            json!({"name": name, "every": 0.01, "at": at})
        };
        let block = case["probes"][0].clone();
        case["probes"] = json!([block, probe("first", 0.1), probe("last", far)]);
    }
    case["checkpoint"] = json!({"every": 1.0});
    case["time"]["end"] = json!(2.0);
    case["fluid"]["lattice_boltzmann"]["time_step"] = json!(2e-3);
    case
}

#[test]
fn a_joint_of_four_cells_loads_its_block_alike_by_network_and_by_lattice() {
    let _beside = beside_others();
    // Thirty times the aperture: what the network neglects at its mouths is of the order of the inverse.
    let length = 1.2;
    let mut ends = Vec::new();
    let loads = ["network", "lattice"].map(|method| {
        let study = Study::new(&between_pools(length, method).to_string());
        study.run("run", 1, 2, &[]);
        let joints = &study.summary("run")["joints"];
        let number = u64::from(method == "network");
        assert_eq!(joints["joints"], number, "{joints}");
        assert!(joints["mass_error"].as_f64().unwrap().abs() < 1e-10);
        if method == "network" {
            ends = ["first", "last"]
                .map(|name| {
                    let path = study.path("run").join(format!("probe_{name}.csv"));
                    late(&io::table::read(&path).unwrap().column("pressure").unwrap())
                })
                .to_vec();
        }
        ["force_z", "force_x", "torque_y"].map(|name| late(&of_block(&study, "run", name)))
    });
    let [network, lattice] = loads;
    println!("lift, push, moment by the network {network:?}, by the lattice {lattice:?}");
    // The pressure is linear between the middles of the first and the last of the cells of the joint, 0.02 m long.
    let drop = (ends[0] - ends[1]) * length / (length - 0.02);
    let exact = [
        0.5 * (ends[0] + ends[1]) * length * WIDTH,
        // The friction of the joint acts half of the height of the block below its centroid.
        drop * WIDTH * (length * length / 12.0 - 0.5 * 0.04 * 0.025),
    ];
    println!(
        "of the pressure in the joint: lift {} N, moment {} N m",
        exact[0], exact[1]
    );
    assert!((network[0] / exact[0] - 1.0).abs() < 1e-3);
    // Shear and pressure of the flow at the sides of the block are of the order of the aperture over the length.
    assert!((network[2] / exact[1] - 1.0).abs() < 0.04);
    for (name, (network, lattice)) in ["lift", "push", "moment"]
        .iter()
        .zip(network.iter().zip(lattice))
    {
        println!("{name}: network over lattice {}", network / lattice);
        assert!((network / lattice - 1.0).abs() < 0.05, "{name}");
    }
}

/// Returns the case of a block that rises from a joint of 3.97 cells, which the lattice takes over at four.
fn rising() -> Value {
    let mut case = pools(&pressures(6.0, 2.0), "auto");
    case["domain"]["size"][2] = json!(0.17);
    case["gravity"] = json!([0, 0, 2]);
    case["blocks"]["initial"]["list"][1] = cuboid([0.1, 0.0, 0.0897], [0.3, WIDTH, 0.1397]);
    case["blocks"]["fixed"] = json!([{"from": [0, 0, 0], "to": [0.4, WIDTH, 0.06]}]);
    case["fluid"]["lattice_boltzmann"]["joints"]["cell"] = json!(0.01);
    case["contact"]["blocks"]["normal_stiffness"]["per_area"] = json!(1e5);
    case["probes"][0]["every"] = json!(1e-3);
    case["probes"][0]["at"]["block"]["position"] = json!([0.2, 0.025, 0.11]);
    case["time"]["end"] = json!(0.08);
    case
}

#[test]
fn a_joint_passes_from_the_network_to_the_lattice_without_a_jump_of_the_force() {
    let _beside = beside_others();
    let study = Study::new(&rising().to_string());
    study.run("run", 1, 2, &[]);
    let joints = study.summary("run")["joints"].clone();
    println!("{joints}");
    let taken = joints["water_taken_over"].as_f64().unwrap();
    let opened = joints["water_opened"].as_f64().unwrap();
    assert!(taken > 0.039 * LENGTH * WIDTH && taken < 0.043 * LENGTH * WIDTH);
    // Three or four rows of cells have their centres in a joint of four cells.
    assert!((opened / taken - 1.0).abs() < 0.26, "{opened} {taken}");
    assert!(joints["mass_error"].as_f64().unwrap().abs() < 1e-10);
    let [force, height] = ["force_z", "z"].map(|name| of_block(&study, "run", name));
    let at = height.iter().position(|z| z - 0.1147 > 0.04 - 0.0397);
    let at = at.unwrap();
    assert!(at > 20 && at + 10 < force.len(), "{at}");
    let changes: Vec<f64> = force
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .collect();
    let most = |span: std::ops::Range<usize>| changes[span].iter().copied().fold(0.0, f64::max);
    let (before, across) = (most(at - 12..at - 2), most(at - 2..at + 8));
    let size = force[at - 2].abs();
    println!("force {size} N; largest change of a step {before} N before, {across} N across");
    println!("{:?}", &force[at - 6..at + 10]);
    assert!(across < 0.05 * size + before);
}

#[test]
fn a_joint_that_is_taken_over_has_the_same_bits_on_any_ranks_and_after_restarts() {
    let _beside = beside_others();
    let study = Study::new(&rising().to_string());
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("threads", 1, 2, ""),
        ("two", 2, 1, ""),
        ("three along z", 3, 1, "domain.split=z"),
        ("four", 4, 2, ""),
    ]);
    // Before the takeover and after it.
    for (name, end) in [("before", "time.end=0.032"), ("after", "time.end=0.064")] {
        study.run(name, 2, 1, &[end]);
        study.restart(name, 1, &["time.end=0.08"]).expect(0);
        study.same("straight", name);
    }
}

#[test]
fn a_wide_joint_of_the_network_has_the_same_bits_on_any_ranks_and_after_restarts() {
    let _beside = beside_others();
    let mut case = pools(&pressures(6.0, 2.0), "network");
    case["time"]["end"] = json!(0.03);
    let study = Study::new(&case.to_string());
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("threads", 1, 2, ""),
        ("two", 2, 1, ""),
        ("three along z", 3, 1, "domain.split=z"),
        ("four", 4, 2, ""),
    ]);
    study.run("parts", 2, 1, &["time.end=0.014"]);
    let other = study.restart(
        "parts",
        1,
        &[
            "time.end=0.03",
            "fluid.lattice_boltzmann.joints.method=lattice",
        ],
    );
    other.expect(3);
    study.restart("parts", 1, &["time.end=0.03"]).expect(0);
    study.same("straight", "parts");
}

#[test]
fn a_lattice_and_a_wide_joint_keep_their_water_together() {
    // A closed box: more water on the left flows to the right, through the joint alone.
    let case = pools(&json!([]), "network");
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
        if cell[0] < 10 {
            lattice.set_equilibrium(*position, 1e-3, [0.0; 3]);
        }
    }
    let volume = SPACING.powi(3);
    let mass = |water: &solver::coupling::water::Water<Volume, f64>| {
        let lattice = water.lattice().unwrap();
        let fluid = lattice.fluid().populations();
        let mut sum = ExactSum::new();
        let mut closed = 0;
        for (cell, position) in &all {
            if lattice.solid_at(*cell) {
                closed += usize::from((10..30).contains(&cell[0]) && (5..9).contains(&cell[2]));
            } else {
                sum.add(fluid.moments(*position).0 * volume);
            }
        }
        sum.add(water.joints().unwrap().flow().stored());
        (sum.value(), closed)
    };
    let (before, closed) = mass(&water);
    // Every cell in the joint is closed.
    assert_eq!(closed, 20 * 5 * 4);
    for _ in 0..300 {
        water.advance(&mut particles, &domain).unwrap();
        water.update_bodies(&mut particles, &domain).unwrap();
    }
    let (after, _) = mass(&water);
    let entered = water.joints().unwrap().balance().entered;
    let right = water.lattice().unwrap().state([39, 2, 10]).0;
    let error = (after - before) / (before + WIDTH * LENGTH * 0.14);
    println!("changed by {error:e}; {entered:e} m3 entered; density on the right {right:e}");
    assert!(error.abs() < 1e-10);
    assert!(right > 1e-5, "{right:e}");
}

/// Returns all water of a lattice and its joints \[m³\]: that of the cells that no joint closes, inside rock too, of
/// the network, and of the rounding of faces to cells.
fn all_water(water: &solver::coupling::water::Water<Volume, f64>) -> f64 {
    let lattice = water.lattice().unwrap();
    let populations = lattice.fluid().populations();
    let volume = SPACING.powi(3);
    let mut sum = ExactSum::new();
    for (cell, position) in populations.interior() {
        if lattice.solid_at(cell) && lattice.body_at(cell).is_none() {
            // A closed cell contains nothing.
            assert!(populations.moments(position) == (0.0, [0.0; 3]), "{cell:?}");
        } else {
            sum.add(volume);
            sum.add(populations.moments(position).0 * volume);
        }
    }
    let joints = water.joints().unwrap();
    let balance = joints.balance();
    for part in [
        joints.flow().stored(),
        joints.on_its_way(),
        balance.released,
        -balance.opened,
        -balance.into_rock,
    ] {
        sum.add(part);
    }
    sum.value()
}

#[test]
fn a_joint_that_opens_to_the_lattice_and_closes_again_keeps_all_water() {
    // A closed box; the block is moved up past the takeover, down past the return, and up again.
    let mut case = rising();
    case["fluid"]["lattice_boltzmann"]["boundaries"] = json!([]);
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
    let before = all_water(&water);
    let free = (0..particles.owned()).find(|k| particles.body[*k].kind == solver::dem::Kind::Free);
    let free = free.unwrap();
    let mut joints = Vec::new();
    let mut most = 0.0_f64;
    for step in 0..600 {
        let up = if (60..340).contains(&step) { -1.0 } else { 1.0 };
        particles.motion[free].velocity.z = 0.05 * up;
        water.advance(&mut particles, &domain).unwrap();
        dem.loads_ahead(&mut particles, &domain).unwrap();
        let carrier = water.carrier().unwrap();
        let path = carrier.carry(&mut particles, &domain).unwrap();
        dem.carried(&mut particles, &domain, path).unwrap();
        water.update_bodies(&mut particles, &domain).unwrap();
        most = most.max((all_water(&water) / before - 1.0).abs());
        let number = water.joints().unwrap().flow().network().joints.len();
        if joints.last() != Some(&number) {
            joints.push(number);
        }
    }
    let balance = water.joints().unwrap().balance();
    println!("joints of the network {joints:?}; largest change of all water {most:e}; {balance:?}");
    assert_eq!(joints[..4], [1, 0, 1, 0]);
    assert!(most < 1e-10, "{most:e}");
}

#[test]
fn a_plan_names_the_method_of_each_joint_with_reason_and_cost() {
    let choices = |method: &str, aperture: f64| {
        let mut case = pools(&pressures(6.0, 2.0), method);
        case["fluid"]["lattice_boltzmann"]["joints"]["largest_aperture"] = json!(aperture);
        // A joint of 4.5 cells.
        case["blocks"]["initial"]["list"][1] = cuboid([0.1, 0.0, 0.095], [0.3, WIDTH, 0.14]);
        let read = Document::read(&case.to_string(), &[], Path::new("."));
        let plan = read.and_then(Plan::prepare).unwrap();
        let joints = plan
            .models
            .iter()
            .filter(|choice| choice.what.starts_with("joints by"));
        let joints =
            joints.map(|choice| format!("{}: {}, {}", choice.what, choice.model, choice.reason));
        joints.collect::<Vec<_>>()
    };
    for (method, aperture, expected) in [
        (
            "network",
            0.045,
            "joints by the network: 1, 4.5 to 4.5 cells across",
        ),
        (
            "auto",
            0.045,
            "joints by the lattice: 1, 4.5 to 4.5 cells across: four cells and more",
        ),
        (
            "lattice",
            0.045,
            "joints by the lattice: 1, 4.5 to 4.5 cells across: requested",
        ),
    ] {
        let found = choices(method, aperture);
        println!("{found:?}");
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with(expected), "{found:?}");
    }
}

/// Checks a network without a node: its joint is wide enough for the lattice from the start.
#[test]
fn joints_by_the_lattice_alone_restart_with_the_same_bits() {
    let _beside = beside_others();
    let mut case = pools(&pressures(6.0, 2.0), "lattice");
    case["time"]["end"] = json!(0.04);
    let study = Study::new(&case.to_string());
    study.run("straight", 1, 1, &[]);
    study.run("parts", 1, 2, &["time.end=0.02"]);
    study.restart("parts", 1, &["time.end=0.04"]).expect(0);
    study.same("straight", "parts");
}
