//! Grains that are bonded at the start: what rests on something carries its load at time 0, everything else keeps its
//! position and velocity; and regions that record the grains that enter and leave them.

use crate::ranks::{Study, beside_others};
use io::fields::read_column;
use serde_json::{Value, json};

/// Returns discs of 5 mm of which the lowest rows rest on the floor, with more grains in the air. All fall freely where
/// nothing holds them.
fn case(list: &Value, more: &[(&str, Value)]) -> Study {
    let mut case = json!({
        "domain": {"size": [0.12, 0.3], "spacing": 0.01},
        "gravity": [0, -9.81],
        "materials": {"m": {"density": 2500}},
        "grains": {"material": "m", "bond_at_start": true, "initial": {"list": list}},
        "contact": {"contact_bond": {"normal_stiffness": {"absolute": 1e6}, "tensile_strength": 50,
            "shear_strength": 50, "bonding_gap": 1e-6, "friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
        "box_walls": ["y_min"],
        "time": {"end": 0.05},
        "output": {"grains": {"every": 0.05}}
    });
    for (name, value) in more {
        case[*name] = value.clone();
    }
    Study::new(&case.to_string())
}

fn disc(x: f64, y: f64, velocity: [f64; 2]) -> Value {
    json!({"position": [x, y], "radius": 0.005, "velocity": velocity})
}

/// Returns the heights of all grains at the first and the last output, in the order of their ids.
fn heights(study: &Study, name: &str) -> [Vec<f64>; 2] {
    let mut files: Vec<_> = std::fs::read_dir(study.path(name))
        .unwrap()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.to_string_lossy().ends_with(".vtkhdf"))
        .filter(|path| path.to_string_lossy().contains("grains_"))
        .collect();
    files.sort();
    [&files[0], &files[files.len() - 1]].map(|path| {
        let at = read_column(path, "position").unwrap();
        let ids = read_column(path, "id").unwrap().values;
        let width = at.values.len() / ids.len();
        let mut rows: Vec<(f64, f64)> = ids
            .iter()
            .zip(at.values.chunks(width))
            .map(|(id, at)| (*id, at[1]))
            .collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        rows.into_iter().map(|(_, height)| height).collect()
    })
}

/// Checks that a bonded pair in the air, an unbonded grain and a named body with a velocity are where the case says at
/// time 0, next to bonded rows that rest on the floor and carry their weight; that all free ones then fall as g t²/2
/// says; and the bits on ranks and after stops.
#[test]
fn bonded_grains_without_support_stay_where_they_are() {
    let _beside = beside_others();
    let row = |y: f64| [0.03, 0.04, 0.05].map(|x| disc(x, y, [0.0, 0.0]));
    let mut list = Vec::from(row(0.005));
    list.extend(row(0.015));
    list.extend([
        disc(0.04, 0.15, [0.1, 0.0]),
        disc(0.05, 0.15, [0.1, 0.0]),
        disc(0.08, 0.2, [0.0, -0.5]),
    ]);
    let ball = json!([{"name": "ball", "shape": {"disc": {"radius": 0.005}}, "position": [0.1, 0.25],
        "motion": {"free": {"velocity": [0, -0.5]}}, "material": "m"}]);
    let floor = json!([
        {"name": "floor", "every": 0.05, "at": {"wall_load": {"name": "y_min"}}},
        {"name": "ball", "every": 0.05, "at": {"body": {"name": "ball"}}}
    ]);
    let study = case(&json!(list), &[("bodies", ball), ("probes", floor)]);
    let done = study.run("straight", 1, 1, &[]);
    let text = done.stdout + &done.stderr;
    assert!(text.contains("4 grains or bodies touch nothing"), "{text}");
    assert!(text.contains("; at rest after"), "{text}");
    let [first, last] = heights(&study, "straight");
    // The named body has the first id.
    let (first, last) = (&first[first.len() - 9..], &last[last.len() - 9..]);
    let fall = 0.5 * 9.81 * 0.05_f64.powi(2);
    for (k, (at, falls)) in [(0.15, fall), (0.15, fall), (0.2, fall + 0.5 * 0.05)]
        .into_iter()
        .enumerate()
    {
        assert!((first[6 + k] - at).abs() < 1e-15, "{first:?}");
        assert!((last[6 + k] - (at - falls)).abs() < 1e-5, "{last:?}");
    }
    // The rows below do not move any more: six discs press on the floor at the start.
    for k in 0..6 {
        assert!((first[k] - last[k]).abs() < 1e-9, "{first:?} {last:?}");
    }
    let table = std::fs::read_to_string(study.path("straight").join("probe_floor.csv")).unwrap();
    let column = |text: &str, name: &str| -> Vec<f64> {
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        let at = lines[0].split(',').position(|word| word == name).unwrap();
        lines[1..]
            .iter()
            .map(|line| line.split(',').nth(at).unwrap().parse().unwrap())
            .collect()
    };
    let weight = 6.0 * 2500.0 * std::f64::consts::PI * 0.005_f64.powi(2) * 9.81;
    for force in column(&table, "force_y") {
        assert!((force + weight).abs() < 0.01 * weight, "{force} {weight}");
    }
    let table = std::fs::read_to_string(study.path("straight").join("probe_ball.csv")).unwrap();
    assert!((column(&table, "y")[0] - 0.25).abs() < 1e-15, "{table}");
    study.same_on(&[
        ("two along y", 2, 1, "domain.split=y"),
        ("two threads", 1, 2, ""),
    ]);
}

/// Checks a chain below a ceiling whose bonds bear less than its weight: it breaks before time 0 and is held there, so
/// that it falls in the run, not out of the domain before it.
#[test]
fn what_breaks_off_before_the_start_falls_in_the_run() {
    let _beside = beside_others();
    let list: Vec<Value> = (0..4)
        .map(|k| disc(0.05, 0.295 - 0.01 * f64::from(k), [0.0, 0.0]))
        .collect();
    let disc_weight = 2500.0 * std::f64::consts::PI * 0.005_f64.powi(2) * 9.81;
    let study = case(
        &json!(list),
        &[
            ("box_walls", json!(["y_max"])),
            ("time", json!({"end": 0.02})),
            ("output", json!({"grains": {"every": 0.02}})),
        ],
    );
    let strength = format!(
        "contact.contact_bond.tensile_strength={}",
        0.95 * 4.0 * disc_weight
    );
    study.run("run", 1, 1, &[&strength]);
    let [first, last] = heights(&study, "run");
    let lowest = |at: &[f64]| at.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((lowest(&first) - 0.265).abs() < 2e-4, "{first:?}");
    let fall = 0.5 * 9.81 * 0.02_f64.powi(2);
    assert!(
        (lowest(&first) - lowest(&last) - fall).abs() < 0.02 * fall,
        "{first:?} {last:?}"
    );
}

/// Checks a disc on a slope whose bond is too weak: it slides to a stop before time 0, and the log and the
/// summary state the distance, with the same bits after a stop.
#[test]
fn a_piece_that_slides_before_the_start_is_reported_with_its_distance() {
    let _beside = beside_others();
    // A slope of 30 degrees from (0, 0.05) down to the floor.
    let (sine, cosine) = (0.5, 0.75_f64.sqrt());
    let at = |along: f64| {
        let r = 0.005 - 1e-6;
        [along * cosine + r * sine, 0.05 - along * sine + r * cosine]
    };
    let [x, y] = at(0.03);
    let study = case(
        &json!([disc(x, y, [0.0, 0.0])]),
        &[
            (
                "walls",
                json!([
                {"name": "slope", "material": "m",
                    "shape": {"plane": {"point": [0, 0.05], "normal": [sine, cosine]}}},
                {"name": "stop", "material": "m", "shape": {"plane": {"point": [0.06, 0], "normal": [-1, 0]}}}]),
            ),
            ("box_wall_material", json!("m")),
            (
                "contact",
                json!({"contact_bond": {"normal_stiffness": {"absolute": 1e6}, "tensile_strength": 1e-3,
                "shear_strength": 1e-3, "bonding_gap": 1e-6, "friction_angle_degrees": 5,
                "normal_damping_ratio": 0.3}}),
            ),
            ("time", json!({"end": 0.001})),
            ("output", json!({"grains": {"every": 0.001}})),
        ],
    );
    let done = study.run("run", 1, 1, &[]);
    let settling = study.summary("run")["notes"]["settling"].clone();
    let moved = settling["largest_displacement"].as_f64().unwrap();
    // The disc touches slope and stop.
    let exact = (0.06 - 0.005 * (1.0 + sine)) / cosine - 0.03;
    assert!(
        (moved / exact - 1.0).abs() < 0.01,
        "{moved} {exact} {settling}"
    );
    let said = format!("{}{}", done.stdout, done.stderr);
    assert!(said.contains("moved most, by"), "{said}");
    study.run("two", 2, 1, &[]);
    study.same("run", "two");
}

/// Checks the table of a region that records against the closed form of a disc that flies through it, one that starts
/// inside and one that another region removes there; and the table on ranks and after restarts.
#[test]
fn a_region_records_what_enters_and_leaves_it() {
    let _beside = beside_others();
    let mut list = vec![
        disc(0.02, 0.25, [1.0, 0.0]),
        disc(0.06, 0.05, [1.0, 0.0]),
        disc(0.02, 0.15, [1.0, 0.0]),
    ];
    list[1]["radius"] = json!(0.004);
    let action = |name: &str, from: [f64; 2], to: [f64; 2], action: Value| {
        let extent = json!({"from": from, "to": to});
        json!({"name": name, "box": extent, "action": action})
    };
    let regions = json!([
        action("strip", [0.045, 0.0], [0.085, 0.3], json!({"record": {}})),
        action(
            "sink",
            [0.06, 0.14],
            [0.07, 0.16],
            json!({"remove": {"when": "centre"}})
        )
    ]);
    let study = case(
        &json!(list),
        &[
            ("regions", regions),
            ("gravity", json!([0, 0])),
            ("time", json!({"end": 0.09})),
            ("checkpoint", json!({"every": 0.01})),
        ],
    );
    study.run("straight", 1, 1, &["grains.bond_at_start=false"]);
    let read =
        |name: &str| std::fs::read_to_string(study.path(name).join("crossings.csv")).unwrap();
    let text = read("straight");
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let seen: Vec<(&str, &str, f64)> = rows
        .iter()
        .map(|row| (row[4], row[3], row[1].parse().unwrap()))
        .collect();
    // Times at which centres that move at 1 m/s pass 0.045, 0.06 and 0.085 m.
    let expected = [
        ("0", "in", 0.025),
        ("2", "in", 0.025),
        ("1", "out", 0.025),
        ("2", "out", 0.04),
        ("0", "out", 0.065),
    ];
    assert_eq!(seen.len(), expected.len(), "{text}");
    for (id, event, time) in expected {
        let found = seen.iter().find(|row| row.0 == id && row.1 == event);
        assert!(
            (found.unwrap().2 - time).abs() < 2e-4,
            "{id} {event}: {text}"
        );
    }
    let counts = &study.summary("straight")["crossings"]["strip"];
    assert_eq!(
        (&counts["entered"], &counts["left"]),
        (&json!(2), &json!(3))
    );
    study.run(
        "ranks",
        3,
        1,
        &["grains.bond_at_start=false", "domain.split=x"],
    );
    assert_eq!(text, read("ranks"));
    study.run(
        "parts",
        2,
        1,
        &["grains.bond_at_start=false", "time.end=0.03"],
    );
    study.restart("parts", 1, &["time.end=0.05"]).expect(0);
    study.restart("parts", 3, &["time.end=0.09"]).expect(0);
    assert_eq!(text, read("parts"));
    assert_eq!(
        study.summary("straight")["crossings"],
        study.summary("parts")["crossings"]
    );
}

/// Returns a case of soil with weak bonds between walls, without the fluid.
fn bonded(list: &[Value], gravity: [f64; 2], law: Value) -> Study {
    Study::new(
        &json!({
            "domain": {"size": [0.02, 0.002], "spacing": 1e-4, "periodic": ["x"]},
            "gravity": gravity,
            "materials": {"soil": {"density": 2650}},
            "grains": {"material": "soil", "bond_at_start": true, "initial": {"list": list}},
            "contact": {"cohesive_frictional": law},
            "box_walls": ["y_min", "y_max"],
            "time": {"end": 1e-5}
        })
        .to_string(),
    )
}

/// Checks that rows of discs that touch within rounding, so that some contacts are bonded and others not, are at rest
/// as soon as their forces are those of rounding.
#[test]
fn bonds_without_a_load_are_at_rest() {
    let _beside = beside_others();
    let mut list = Vec::new();
    for row in 0..3_u32 {
        for column in 0..12_u32 {
            let x = 8e-4 + 1e-4 * f64::from(row % 2) + 2e-4 * f64::from(column);
            let y = 1e-4 + 1e-4 * f64::from(row) * 3.0_f64.sqrt();
            list.push(json!({"position": [x, y], "radius": 1e-4}));
        }
    }
    let law = json!({"normal_stiffness": {"per_diameter": 1.5e8}, "friction_angle_degrees": 20,
        "cohesion": {"per_diameter": 0.15}, "local_damping": 0.2});
    let study = bonded(&list, [0.0, 0.0], law);
    let done = study.run("run", 1, 1, &[]);
    let settling = study.summary("run")["notes"]["settling"].clone();
    assert_eq!(settling["at_rest"], true, "{}", done.stdout);
    assert!(
        settling["solid_steps"].as_u64().expect("steps") <= 1000,
        "{settling}"
    );
}

/// Checks that a disc that slides along a smooth floor is not said to be at rest when the relaxation ends at its limit.
#[test]
fn a_relaxation_that_does_not_end_is_reported() {
    let _beside = beside_others();
    let disc = json!({"position": [0.001, 1e-4 - 1e-9], "radius": 1e-4});
    // The weight along the floor is half a percent of that on it, above the tolerance of a thousandth.
    let law = json!({"normal_stiffness": {"per_diameter": 1.5e8}, "friction_angle_degrees": 0,
        "cohesion": {"per_diameter": 1e-9}, "normal_damping_ratio": 0.3});
    let study = bonded(&[disc], [0.05, -9.81], law);
    let done = study.run("run", 1, 1, &[]);
    assert!(
        done.stdout.contains("not at rest after 100000"),
        "{}",
        done.stdout
    );
    let warnings = study.summary("run")["warnings"].to_string();
    assert!(
        warnings.contains("were not at rest when the run began"),
        "{warnings}"
    );
}
