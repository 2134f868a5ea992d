//! Servo walls, loads on walls and element tests: exact answers of regular packings, the same bits on any number of
//! ranks and threads and after restarts, and messages for what is wrong.

use crate::ranks::{Study, beside_others};
use serde_json::Value;

/// Returns value and interval of an answer of a run.
#[track_caller]
fn answer(study: &Study, name: &str, quantity: &str) -> (f64, [f64; 2]) {
    let entry = &study.summary(name)["element_test"][quantity];
    let number = |value: &Value| {
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{quantity}: {entry:#}"))
    };
    let interval = &entry["interval"];
    (
        number(&entry["value"]),
        [number(&interval[0]), number(&interval[1])],
    )
}

/// Fails unless an answer is within a relative difference of its known value.
#[track_caller]
fn near(study: &Study, name: &str, quantity: &str, known: f64, within: f64) {
    let (value, [low, high]) = answer(study, name, quantity);
    let difference = value / known - 1.0;
    println!("{name}: {quantity} {value} in {low} … {high}, known {known}: {difference:.2e}");
    assert!(low <= value && value <= high, "{quantity}");
    assert!(difference.abs() < within, "{quantity}: {value} {known}");
}

/// Checks the strain and the lateral stress of a face-centred array of spheres under Hertz's law with sliding contacts.
/// The contacts have an overlap of 1e-4 of the radius; the formulas neglect terms of this order.
#[test]
fn an_oedometer_test_gives_the_stiffness_of_the_array() {
    let _beside = beside_others();
    let study = Study::from_example("oedometer", &[]);
    study.run("straight", 1, 1, &[]);
    near(&study, "straight", "axial_stress", 30650.133, 1e-3);
    near(&study, "straight", "axial_strain", 1.160609e-4, 1e-3);
    near(&study, "straight", "lateral_stress_ratio", 0.3, 1e-3);
}

/// Resistance to rolling that keeps discs from rolling over each other.
const ROLLING: &str = r#"{"friction": 0.3, "damping_ratio": 0.3}"#;

/// Checks the strength of hexagonal discs between smooth walls for two coefficients of friction, by the equilibrium of
/// rows at the limit of friction. Overlaps of 1e-4 of the diameter rotate the contacts by as much, and the ratio
/// changes by some six times the angle. Without friction there is no rolling, and no resistance to rolling is needed.
#[test]
fn a_biaxial_test_gives_the_strength_of_hexagonal_rows() {
    let _beside = beside_others();
    let study = Study::from_example("biaxial", &[]);
    let height = (6.0 * 0.75_f64.sqrt() + 1.0) / 6.0;
    for (friction, rolling) in [(0.0_f64, "null"), (0.1, ROLLING), (0.25, ROLLING)] {
        let angle = friction.atan().to_degrees();
        let name = format!("friction {friction}");
        let set = [
            format!("contact.linear.friction_angle_degrees={angle}"),
            format!("contact.linear.rolling={rolling}"),
        ];
        study.run(&name, 1, 1, &set.each_ref().map(String::as_str));
        let slope = (60.0 + angle).to_radians().tan();
        let known = 2.0 * 5.0 / 6.0 * height * slope;
        near(&study, &name, "peak_stress_ratio", known, 3e-3);
        let sine = (known - 1.0) / (known + 1.0);
        near(
            &study,
            &name,
            "peak_friction_angle",
            sine.asin().to_degrees(),
            3e-3,
        );
    }
}

/// Checks the strength of a face-centred array between smooth walls.
#[test]
fn a_triaxial_test_gives_the_strength_of_the_array() {
    let _beside = beside_others();
    let study = Study::from_example("triaxial", &[]);
    study.run("straight", 1, 1, &[]);
    let height = (4.0 / 2.0_f64.sqrt() + 1.0) / 4.0;
    let known = 8.0_f64.sqrt() * 3.0 / 4.0 * height * 1.25 / 0.75;
    near(&study, "straight", "peak_stress_ratio", known, 3e-3);
}

/// Checks discs that roll over each other between rough plates: half of the angle of their line of centres, for two
/// coefficients of friction.
#[test]
fn a_shear_test_gives_the_strength_of_nested_rows() {
    let _beside = beside_others();
    let study = Study::from_example("direct-shear", &[]);
    for degrees in [22, 40] {
        let name = format!("friction {degrees}");
        let set = format!("contact.linear.friction_angle_degrees={degrees}");
        study.run(&name, 1, 1, &[&set]);
        near(&study, &name, "peak_shear_ratio", 1.0 / 3.0, 3e-3);
        near(&study, &name, "axial_stress", 1e4, 1e-3);
    }
}

/// Checks the strength of bonded discs by the equilibrium of a pair under the two discs above and below it, for two
/// ratios of the stiffnesses. Without shear springs it is 3^0.5 times the strength of the bond. Samples are 10 Pa
/// apart.
#[test]
fn bonded_discs_are_crushed_at_their_strength() {
    let _beside = beside_others();
    let study = Study::from_example("unconfined-compression", &[]);
    for ratio in [0.0_f64, 0.5] {
        let name = format!("ratio {ratio}");
        let field = "contact.contact_bond.shear_to_normal_stiffness";
        study.run(&name, 1, 1, &[&format!("{field}={ratio}")]);
        let half = 0.75_f64.sqrt();
        let spread = half * (1.0 - ratio) / (2.5 + 1.5 * ratio);
        let tension = 2.0 * spread / (1.5 + 0.5 * ratio - spread * half * (1.0 - ratio));
        near(&study, &name, "strength", 100.0 / tension / 0.04, 4e-3);
    }
}

/// Returns the beginning of the triaxial test, with slabs across two servo walls.
fn short() -> Study {
    Study::from_example(
        "triaxial",
        &[
            ("time.end", "0.0012"),
            ("analysis.element_test.from", "0"),
            ("walls[2].servo.history", "[[0.0004, 1e4], [0.0012, 3e4]]"),
            ("output.grains.every", "0.0004"),
            ("output.contacts.every", "0.0004"),
            ("checkpoint", r#"{"every": 0.0004}"#),
        ],
    )
}

#[test]
fn servo_walls_keep_the_bits() {
    let _beside = beside_others();
    let study = short();
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("two along x", 2, 1, "domain.split=x"),
        ("three along y", 3, 1, "domain.split=y"),
        ("two with threads", 2, 2, ""),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0005"]);
    study.restart("parts", 1, &["time.end=0.0008"]).expect(0);
    study.restart("parts", 3, &["time.end=0.0012"]).expect(0);
    study.same("straight", "parts");
    assert_eq!(
        study.summary("straight")["element_test"],
        study.summary("parts")["element_test"]
    );
    // The servo acts, and its gain and limit matter.
    for (name, set) in [
        ("another stress", "walls[0].servo.stress=2e4"),
        ("another gain", "walls[0].servo.gain=0.1"),
        ("another limit", "walls[0].servo.velocity_limit=1e-5"),
    ] {
        study.run(name, 1, 1, &[set]);
        assert_ne!(study.hash("straight"), study.hash(name), "{name}");
    }
}

/// Checks that a restart may change the stress of a servo wall, and that the wall continues from its position.
#[test]
fn a_restart_changes_the_stress_of_a_servo_wall() {
    let _beside = beside_others();
    let study = short();
    study.run("parts", 1, 1, &["time.end=0.0008"]);
    study
        .restart(
            "parts",
            2,
            &["time.end=0.0016", "walls[0].servo.stress=1.5e4"],
        )
        .expect(0);
    let text = std::fs::read_to_string(study.path("parts").join("probe_right.csv")).unwrap();
    let column = |name: &str| {
        let mut lines = text.lines();
        let names = lines.next().unwrap().split(',');
        let place = names
            .map(|n| n.split(' ').next().unwrap())
            .position(|n| n == name);
        let place = place.unwrap_or_else(|| panic!("{name} in {text}"));
        let cell = |line: &str| line.split(',').nth(place).unwrap().parse::<f64>().unwrap();
        lines
            .filter(|line| !line.starts_with('#'))
            .map(cell)
            .collect::<Vec<f64>>()
    };
    let (stress, moved) = (column("normal_stress"), column("displacement_x"));
    // A sample every 5e-5 s.
    let at = 16;
    assert!((stress[at - 1] / 1e4 - 1.0).abs() < 0.02, "{stress:?}");
    assert!(
        (stress[stress.len() - 1] / 1.5e4 - 1.0).abs() < 0.02,
        "{stress:?}"
    );
    assert!(
        moved[at - 1] < 0.0 && moved[moved.len() - 1] < moved[at - 1],
        "{moved:?}"
    );
}

/// Checks two stationary discs on a floor: force, torque about a point and mean stress are those of their weights.
#[test]
fn a_floor_bears_the_weight_of_what_lies_on_it() {
    let _beside = beside_others();
    let (mass, gravity) = (2000.0 * std::f64::consts::PI * 1e-4, 9.81);
    let overlap = mass * gravity / 1e7;
    let at = |x: f64| {
        format!(
            "{{\"position\": [{x}, {}], \"radius\": 0.01}}",
            0.01 - overlap
        )
    };
    let study = Study::new(&format!(
        r#"{{"domain": {{"size": [0.2, 0.1], "spacing": 0.01}}, "gravity": [0, -9.81],
            "materials": {{"glass": {{"density": 2000}}}},
            "grains": {{"material": "glass", "initial": {{"list": [{}, {}]}}}}, "box_walls": ["y_min"],
            "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e7}}, "friction_angle_degrees": 20,
                "normal_damping_ratio": 0.3}}}},
            "time": {{"end": 0.01}},
            "probes": [{{"name": "floor", "every": 0.01,
                "at": {{"wall_load": {{"name": "y_min", "about": [0.05, 0.02]}}}}}}]}}"#,
        at(0.03),
        at(0.11)
    ));
    study.run("straight", 1, 1, &[]);
    let text = std::fs::read_to_string(study.path("straight").join("probe_floor.csv")).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let last: Vec<&str> = text.lines().last().unwrap().split(',').collect();
    let value = |name: &str| -> f64 {
        let place = names.iter().position(|n| n.split(' ').next() == Some(name));
        last[place.unwrap_or_else(|| panic!("{name} in {names:?}"))]
            .parse()
            .unwrap()
    };
    let weight = mass * gravity;
    for (name, known) in [
        ("force_x", 0.0),
        ("force_y", -2.0 * weight),
        // The arms of the two are -0.02 and 0.06 m.
        ("torque_z", -0.04 * weight),
        ("area", 0.2),
        ("normal_stress", 10.0 * weight),
        ("shear_stress", 0.0),
        ("contacts", 2.0),
        ("displacement_y", 0.0),
    ] {
        let found = value(name);
        assert!(
            (found - known).abs() < 1e-9 * weight,
            "{name}: {found} {known}"
        );
    }
}
