//! A bed below a stream: shear stress against exact solutions, bedload of grains of known velocity, the same bits on
//! any number of ranks and across a restart, and what is refused.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::Document;
use solver::plan::Plan;
use std::f64::consts::PI;
use std::path::Path;

const CELL: f64 = 1e-3;
/// Height of the flat bed and depth of the water \[cells\].
const BED: u32 = 10;
const DEPTH: u32 = 12;
/// Force per volume [N/m3].
const FORCE: f64 = 50.0;

fn length(cells: u32) -> f64 {
    CELL * f64::from(cells)
}

/// Returns the boxes of a flat bed with a cavity in cells: from and to. In 2-D the boxes at the sides of the cavity
/// along z are omitted.
fn slabs(width: Option<u32>, period: u32) -> Value {
    let mut boxes = vec![
        ([-9, -9, -9], [1, 10, 99]),
        ([i64::from(period) - 1, -9, -9], [99, 10, 99]),
        ([-9, 6, -9], [99, 10, 99]),
    ];
    if let Some(width) = width {
        boxes.push(([-9, -9, -9], [99, 10, 3]));
        boxes.push(([-9, -9, i64::from(width) - 3], [99, 10, 99]));
    }
    let dimension = if width.is_some() { 3 } else { 2 };
    let corner = |cells: [i64; 3]| {
        let cells = cells.iter().take(dimension);
        cells
            .map(|n| CELL * f64::from(i32::try_from(*n).unwrap()))
            .collect::<Vec<f64>>()
    };
    (boxes.iter().enumerate())
        .map(|(n, (from, to))| {
            json!({"name": format!("slab{n}"), "stops": "water", "shape": {"box": {"from": corner(*from),
                "to": corner(*to)}}})
        })
        .collect()
}

/// Returns water of 1000 kg/m3 and 1e-3 m2/s above a flat bed with a grain in its cavity. The grain does not affect
/// the stream.
fn stream(width: Option<u32>, gravity: f64, top: &Value, force: f64) -> Value {
    let period = 8;
    let flat = width.is_none();
    let vector = |x: f64, y: f64, z: f64| {
        if flat {
            json!([x, y])
        } else {
            json!([x, y, z])
        }
    };
    let depth = width.map_or(0.0, length);
    json!({
        "domain": {
            "size": vector(length(period), length(BED + DEPTH), depth), "spacing": CELL,
            "periodic": ["x"]
        },
        "gravity": vector(gravity, -9.81, 0.0),
        "materials": {"glass": {"density": 2500}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "relaxation_time": 0.8,
                "collision": {"trt": {"magic": 0.1875}},
            "body_force": {"constant": vector(force, 0.0, 0.0)},
            "boundaries": [{"name": "top", "face": "y_max", "condition": top}]
        }},
        "structures": slabs(width, period),
        "grains": {"material": "glass", "initial": {"list": [
            {"position": vector(4e-3, 2.5e-3, 0.5 * depth), "radius": 2.5e-3}
        ]}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e3}, "normal_damping_ratio": 0.5,
            "rolling": {"friction": 1, "damping_ratio": 0.3}}},
        "box_walls": ["y_min"],
        "box_wall_material": "glass",
        "coupling": {"partially_saturated": {}},
        "time": {"end": 1},
        "probes": [{"name": "bed", "every": 0.1, "at": {"bed": {
            "part": {"from": vector(0.0, 6e-3, 0.0), "to": vector(length(period), length(BED + DEPTH), depth)},
            "threshold": 0.5, "mean_from": 0.85
        }}}]
    })
}

/// Returns the means of the columns of the probe of a run.
fn means(study: &Study, run: &str) -> impl Fn(&str) -> f64 {
    let all = study.summary(run)["means"][0].clone();
    assert_eq!(all["probe"], "bed");
    move |name: &str| {
        let values = all["values"].as_array().unwrap();
        let one = values.iter().find(|one| one["quantity"] == name).unwrap();
        one["mean"].as_f64().unwrap_or(f64::NAN)
    }
}

/// Checks a film down a slope (Nusselt), a sliding plate (Couette) and a stationary wall above (Poiseuille): with water
/// of depth H and viscosity mu, the stress on the bed is rho g H sin(slope), mu U/H and f H/2.
#[test]
fn the_shear_stress_of_laminar_streams_is_exact() {
    let _beside = beside_others();
    let depth = length(DEPTH);
    let speed = 0.02;
    let cases = [
        (
            "film",
            stream(None, 0.05, &json!({"free_slip": {}}), 0.0),
            1000.0 * 0.05 * depth,
        ),
        (
            "couette",
            stream(
                None,
                0.0,
                &json!({"moving_wall": {"velocity": [speed, 0]}}),
                0.0,
            ),
            speed / depth,
        ),
        (
            "poiseuille",
            stream(None, 0.0, &json!({"no_slip": {}}), FORCE),
            0.5 * FORCE * depth,
        ),
    ];
    for (name, case, exact) in cases {
        let study = Study::new(&case.to_string());
        study.run("run", 1, 1, &[]);
        let mean = means(&study, "run");
        let (balance, profile) = (mean("shear_stress_balance"), mean("shear_stress_profile"));
        println!("{name}: balance {balance}, profile {profile}, exact {exact} Pa");
        assert!((mean("surface_height") / length(BED) - 1.0).abs() < 1e-12);
        assert!(mean("deepest_scour").abs() < 1e-15);
        // Remainder of the transient: exp(-nu (pi/2H)^2 t) = 4e-7.
        assert!((balance / exact - 1.0).abs() < 1e-5, "{name}: {balance}");
        assert!((profile / exact - 1.0).abs() < 1e-5, "{name}: {profile}");
        let shields = exact / (1500.0 * 9.81 * 5e-3);
        assert!((mean("shields_number") / shields - 1.0).abs() < 1e-5);
        assert!((mean("diameter") - 5e-3).abs() < 1e-15);
    }
}

/// Checks a film between side walls, the lower half of a duct: the mean stress on its floor is a series (White, Viscous
/// Fluid Flow, 3-48). Side walls bear the rest of the force.
#[test]
fn side_walls_bear_their_part() {
    let _beside = beside_others();
    let width = 12;
    let case = stream(Some(width), 0.0, &json!({"free_slip": {}}), FORCE);
    let study = Study::new(&case.to_string());
    study.run(
        "run",
        2,
        1,
        &["time.end=0.3", "probes[0].at.bed.mean_from=0.25"],
    );
    let (width, depth) = (length(width), length(DEPTH));
    let series: f64 = (0..200)
        .map(|k| f64::from(2 * k + 1))
        .map(|n| (n * PI * depth / width).tanh() / n.powi(3))
        .sum();
    let exact = 8.0 * FORCE * width / PI.powi(3) * series;
    let mean = means(&study, "run");
    let balance = mean("shear_stress_balance");
    assert!(
        mean("shear_stress_profile").is_nan(),
        "stress on the sides bends the profile"
    );
    println!(
        "between side walls: {balance}, exact {exact}, without them {} Pa",
        FORCE * depth
    );
    // The line through two cells misses the stress sin(pi z/W) at a wall by (3/8) (pi h/W)^2 of it, and the sides
    // carry f H minus the force on the bed.
    let bound = (FORCE * depth / exact - 1.0) * 0.375 * (PI * CELL / width).powi(2);
    assert!(
        (balance / exact - 1.0).abs() < bound,
        "{balance} {exact} {bound}"
    );
    assert!(
        exact < 0.3 * FORCE * depth,
        "most of the force is on the sides"
    );
}

/// Checks discs of radii 2, 3 and 4 mm with their velocities in a box of 60 mm: the flux is the sum of V u over the
/// length.
#[test]
fn the_bedload_of_grains_of_known_velocity_is_exact() {
    let _beside = beside_others();
    let case = json!({
        "domain": {"size": [0.06, 0.03], "spacing": 5e-4, "periodic": ["x"]},
        "gravity": [0, -9.81],
        "materials": {"glass": {"density": 2500}},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8}},
        "grains": {"material": "glass", "initial": {"list": [
            {"position": [0.01, 0.01], "radius": 0.002, "velocity": [0.02, 0]},
            {"position": [0.03, 0.02], "radius": 0.003, "velocity": [-0.01, 0.01]},
            {"position": [0.05, 0.01], "radius": 0.004, "velocity": [0.03, 0]}
        ]}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}}},
        "box_walls": ["y_min"],
        "coupling": {"partially_saturated": {}},
        "time": {"end": 0.002},
        "probes": [
            {"name": "all", "every": 0.002, "at": {"bed": {}}},
            {"name": "half", "every": 0.002, "at": {"bed": {
                "part": {"from": [0, 0], "to": [0.03, 0.03]}, "diameter": 0.005, "level": 0.004
            }}}
        ]
    });
    let study = Study::new(&case.to_string());
    let first = |run: &str, probe: &str, name: &str| -> f64 {
        let text = std::fs::read_to_string(study.path(run).join(format!("probe_{probe}.csv")));
        let text = text.unwrap();
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let place = lines
            .next()
            .unwrap()
            .split(',')
            .position(|n| n == name)
            .unwrap();
        lines
            .next()
            .unwrap()
            .split(',')
            .nth(place)
            .unwrap()
            .parse()
            .unwrap()
    };
    study.run("run", 1, 1, &[]);
    let area = |radius: f64| PI * radius * radius;
    let whole = (area(0.002) * 0.02 - area(0.003) * 0.01 + area(0.004) * 0.03) / 0.06;
    let half = area(0.002) * 0.02 / 0.03;
    for (probe, flux, diameter) in [("all", whole, 0.008), ("half", half, 0.005)] {
        let found = first("run", probe, "bedload_flux");
        assert!(
            (found / flux - 1.0).abs() < 1e-12,
            "{probe}: {found} {flux}"
        );
        let scale = (1.5 * 9.81 * f64::powi(diameter, 3)).sqrt();
        let found = first("run", probe, "dimensionless_flux");
        assert!(
            (found / (flux / scale) - 1.0).abs() < 1e-12,
            "{probe}: {found}"
        );
        assert!((first("run", probe, "diameter") - diameter).abs() < 1e-15);
    }
    // A floor with a few grains above it does not count as a bed.
    assert!(first("run", "half", "surface_height").abs() < 1e-15);
    assert!((first("run", "half", "scour_depth") - 0.004).abs() < 1e-15);
}

/// Checks that a pier in the bed that extends through the water does not raise the surface of the columns around it.
#[test]
fn a_pier_is_no_bed() {
    let _beside = beside_others();
    let surface = |pier: bool| {
        let mut structures = vec![
            json!({"name": "ground", "shape": {"box": {"from": [-0.01, -0.01], "to": [0.07, 0.006]}}}),
        ];
        if pier {
            structures.push(json!({"name": "pier", "shape": {"box": {"from": [0.02, 0], "to": [0.0225, 0.04]}}}));
        }
        let case = json!({
            "domain": {"size": [0.06, 0.03], "spacing": 5e-4},
            "gravity": [0, -9.81],
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8}},
            "structures": structures,
            "grains": {"material": "glass", "initial": {"list": [{"position": [0.05, 0.02], "radius": 0.002}]}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}}},
            "coupling": {"partially_saturated": {}},
            "time": {"end": 0.002},
            "probes": [{"name": "bed", "every": 0.001, "at": {"bed": {}}}]
        });
        let study = Study::new(&case.to_string());
        study.run("run", 1, 1, &[]);
        let rows = io::table::read(&study.path("run").join("probe_bed.csv")).unwrap();
        ["surface_height", "lowest_height"].map(|name| *rows.column(name).unwrap().last().unwrap())
    };
    let [mean, lowest] = surface(true);
    assert_eq!(
        [mean, lowest].map(f64::to_bits),
        surface(false).map(f64::to_bits)
    );
    assert!(
        (mean - 0.006).abs() < 5e-4 && (lowest - mean).abs() < 1e-15,
        "{mean} {lowest}"
    );
}

/// Returns the shortened example with moving grains.
fn flume(set: &[(&str, &str)]) -> Study {
    let text = solver::case::examples::find("flume").unwrap().text;
    let mut case: Value = serde_json::from_str(text).unwrap();
    case["grains"]["initial"]["deposition"]["number"] = json!(40);
    case["grains"]["initial"]["deposition"]["box"]["to"] = json!([0.008, 0.0095]);
    case["domain"]["size"] = json!([0.008, 0.0095]);
    case["time"]["end"] = json!(0.012);
    case["probes"][0]["every"] = json!(0.002);
    case["probes"][0]["at"]["bed"]["mean_from"] = json!(0.004);
    case["output"] = json!({});
    for (path, value) in set {
        let place = case.pointer_mut(path).unwrap();
        *place = serde_json::from_str(value).unwrap();
    }
    Study::new(&case.to_string())
}

#[test]
fn a_moving_bed_has_the_same_rows_on_any_ranks_and_across_a_restart() {
    let _beside = beside_others();
    let study = flume(&[("/probes/0/at/bed", r#"{"mean_from": 0.004}"#)]);
    study.run("straight", 1, 1, &["checkpoint.every=0.005"]);
    let mean = means(&study, "straight");
    assert!(mean("bedload_flux") > 0.0 && mean("surface_height") > 1e-3);
    study.run("parts", 2, 1, &["checkpoint.every=0.005", "time.end=0.007"]);
    study.restart("parts", 3, &["time.end=0.012"]).expect(0);
    study.same("straight", "parts");
    assert_eq!(
        study.summary("straight")["means"],
        study.summary("parts")["means"]
    );
}

/// Returns paths and reasons of the errors of a case.
fn errors(case: &Value) -> String {
    let document = Document::read(&case.to_string(), &[], Path::new(".")).unwrap();
    let problems = Plan::prepare(document).map(|_| ()).unwrap_err();
    problems.iter().map(|p| format!("{p}\n")).collect()
}

#[test]
fn what_makes_no_sense_is_refused_with_its_reason() {
    let good = stream(None, 0.0, &json!({"free_slip": {}}), FORCE);
    let document = Document::read(&good.to_string(), &[], Path::new(".")).unwrap();
    let plan = Plan::prepare(document).unwrap();
    assert!(plan.models.iter().any(|choice| choice.what == "bed"));
    let with = |pointer: &str, value: Value| {
        let mut case = good.clone();
        *case.pointer_mut(pointer).unwrap() = value;
        errors(&case)
    };
    for (pointer, value, path, reason) in [
        (
            "/gravity",
            json!([9.81, 0]),
            "probes[0].at.bed",
            "no gravity acts normal to the stream",
        ),
        (
            "/gravity",
            json!([0, 9.81]),
            "probes[0].at.bed",
            "points to the upper face",
        ),
        (
            "/materials/glass/density",
            json!(900),
            "probes[0].at.bed",
            "do not sink",
        ),
        (
            "/domain/periodic",
            json!(["x", "y"]),
            "probes[0].at.bed",
            "no top",
        ),
        (
            "/probes/0/at/bed",
            json!({"flow_axis": "z"}),
            "flow_axis",
            "no z",
        ),
        (
            "/probes/0/at/bed",
            json!({"mean_from": 2}),
            "mean_from",
            "before the averaging begins",
        ),
        (
            "/probes/0/at/bed",
            json!({"level": 2}),
            "level",
            "outside the domain",
        ),
        (
            "/probes/0/at/bed",
            json!({"threshold": 1.5}),
            "threshold",
            "1",
        ),
    ] {
        let found = with(pointer, value.clone());
        assert!(
            found.contains(path) && found.contains(reason),
            "{pointer} {value}: {found}"
        );
    }
    let mut dry = good.clone();
    dry.as_object_mut().unwrap().remove("grains");
    assert!(errors(&dry).contains("no grains and therefore no bed"));
    let mut dry = good.clone();
    dry.as_object_mut().unwrap().remove("fluid");
    assert!(errors(&dry).contains("no fluid"));
    // The erosion law of a hole does not apply to a bed, which has one face.
    let mut law = good;
    law["regions"] = json!([{"name": "out", "box": {"from": [0, 0], "to": [1e-3, 1e-3]}, "action": {"remove": {}}}]);
    law["analysis"] =
        json!({"erosion_law": {"hole": {"from": [2e-3, 0.01], "to": [6e-3, 0.022]}, "every": 0.1}});
    let found = errors(&law);
    assert!(
        found.contains("analysis.erosion_law.hole") && found.contains("`bed`"),
        "{found}"
    );
}

/// Returns a dry case in 2-D with a probe of its grains.
fn dry(size: [f64; 2], stiffness: f64, grains: Value, walls: &Value, end: f64) -> Value {
    json!({
        "domain": {"size": size, "spacing": 1e-3},
        "gravity": [0, -9.81],
        "materials": {"glass": {"density": 2500}, "wall": {}},
        "grains": {"material": "glass", "initial": grains},
        "contact": {"linear": {
            "normal_stiffness": {"absolute": stiffness}, "friction_angle_degrees": 25, "normal_damping_ratio": 0.5,
                "shear_damping_ratio": 0.5,
            "pairs": [{"materials": ["glass", "wall"], "friction_angle_degrees": 0}]
        }},
        "box_walls": walls,
        "box_wall_material": "wall",
        "time": {"end": end},
        "probes": [{"name": "bed", "every": end / 10.0, "at": {"grains": {"mean_from": 0.95 * end}}}],
        "output": {"grains": {"every": end}}
    })
}

/// Checks four discs on top of each other: the stress equals that of the weight above, m g R N^2/V, for all of them and
/// for the upper two.
#[test]
fn the_stress_of_a_column_is_the_weight_above() {
    let _beside = beside_others();
    let radius = 5e-3;
    let discs = (0..4)
        .map(|n| json!({"position": [0.01, radius * f64::from(2 * n + 1)], "radius": radius}));
    let mut case = dry(
        [0.02, 0.05],
        1e7,
        json!({"list": discs.collect::<Vec<_>>()}),
        &json!(["x_min", "x_max", "y_min"]),
        0.2,
    );
    let weight = 2500.0 * PI * radius * radius * 9.81;
    for (part, number, contacts) in [
        (json!(null), 4.0, 7.0),
        (json!({"from": [0, 0.02], "to": [0.02, 0.04]}), 2.0, 3.0),
    ] {
        let volume = if part.is_null() {
            0.02 * 0.05
        } else {
            0.02 * 0.02
        };
        case["probes"][0]["at"]["grains"]["part"] = part;
        let study = Study::new(&case.to_string());
        study.run("run", 1, 1, &[]);
        let mean = means(&study, "run");
        assert!((mean("number") - number).abs() < 1e-12);
        assert!((mean("coordination_number") - contacts / number).abs() < 1e-12);
        let solid = number * PI * radius * radius / volume;
        assert!((mean("solid_fraction") / solid - 1.0).abs() < 1e-12);
        let exact = weight * radius * number * number / volume;
        let found = mean("stress_yy");
        println!("column of {number}: {found} Pa, exact {exact} Pa");
        // Overlaps of m g N/k shorten the arms by less than 1e-4.
        assert!((found / exact - 1.0).abs() < 2e-4, "{found} {exact}");
        assert!((mean("mean_pressure") / (0.5 * exact) - 1.0).abs() < 2e-4);
        assert!(mean("stress_xx").abs() < 1e-9 * exact && mean("stress_xy").abs() < 1e-9 * exact);
    }
}

/// Checks a square lattice of discs between four walls with equal overlaps: the stress equals the pressure on the
/// walls.
#[test]
fn the_stress_under_isotropic_confinement_is_the_pressure_of_the_walls() {
    let _beside = beside_others();
    let (radius, overlap, stiffness) = (5e-3, 5e-7, 1e5);
    let pitch = 2.0 * radius - overlap;
    let length = 2.0 * (radius - overlap) + 3.0 * pitch;
    let at = |n: u32| radius - overlap + pitch * f64::from(n);
    let discs = (0..16).map(|n| json!({"position": [at(n % 4), at(n / 4)], "radius": radius}));
    let mut case = dry(
        [length, length],
        stiffness,
        json!({"list": discs.collect::<Vec<_>>()}),
        &json!(["x_min", "x_max", "y_min", "y_max"]),
        1e-3,
    );
    case["domain"]["spacing"] = json!(length / 40.0);
    case.as_object_mut().unwrap().remove("gravity");
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    study.run("two", 2, 1, &[]);
    study.same("run", "two");
    let mean = means(&study, "run");
    let pressure = 4.0 * stiffness * overlap / length;
    for name in ["stress_xx", "stress_yy", "mean_pressure"] {
        let found = mean(name);
        println!("{name}: {found} Pa, pressure of the walls {pressure} Pa");
        // Contact points at walls are half an overlap outside.
        assert!(
            (found / pressure - 1.0).abs() < 1e-4,
            "{name}: {found} {pressure}"
        );
    }
    assert!((mean("coordination_number") - 4.0).abs() < 1e-12);
}

/// Checks that at rest between smooth walls the stress times the volume is the sum of m g y, for any contribution of
/// friction.
#[test]
fn friction_between_grains_belongs_to_the_stress() {
    let _beside = beside_others();
    let deposition = json!({"deposition": {
        "number": 60, "grading": {"by_count": [{"min": 2e-3, "max": 3e-3, "fraction": 1}]},
        "box": {"from": [0, 0], "to": [0.04, 0.09]}, "seed": 3
    }});
    let case = dry(
        [0.04, 0.09],
        1e6,
        deposition,
        &json!(["x_min", "x_max", "y_min"]),
        0.5,
    );
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    let file = std::fs::read_dir(study.path("run")).unwrap();
    let names = file.map(|entry| entry.unwrap().path());
    let last = names
        .filter(|path| path.extension().is_some_and(|e| e == "vtkhdf"))
        .max()
        .unwrap();
    let column = |name: &str| io::fields::read_column(&last, name).unwrap().values;
    let (radii, positions) = (column("radius"), column("position"));
    let moment: f64 = (radii.iter().zip(positions.chunks(3)))
        .map(|(radius, at)| 2500.0 * PI * radius * radius * 9.81 * at[1])
        .sum();
    let found = means(&study, "run")("stress_yy") * 0.04 * 0.09;
    println!("stress times volume {found} N, sum of m g y {moment} N");
    assert!((found / moment - 1.0).abs() < 2e-3, "{found} {moment}");
}

/// Checks discs of 1, 2 and 3 mm in an outlet: the two larger ones fill it with more than half of the volume.
#[test]
fn the_median_of_what_left_is_that_of_the_record() {
    let _beside = beside_others();
    let discs = json!({"list": [
        {"position": [0.004, 0.005], "radius": 1e-3},
        {"position": [0.01, 0.005], "radius": 2e-3},
        {"position": [0.016, 0.005], "radius": 3e-3},
        {"position": [0.026, 0.005], "radius": 4e-3}
    ]});
    let mut case = dry([0.04, 0.02], 1e4, discs, &json!(["y_min"]), 1e-3);
    case["regions"] = json!([{"name": "out", "box": {"from": [0, 0], "to": [0.018, 0.02]},
        "action": {"remove": {"when": "centre"}}}]);
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    let mean = means(&study, "run");
    assert!((mean("removed_number") - 3.0).abs() < 1e-12);
    assert!((mean("removed_d50") - 6e-3).abs() < 1e-15);
    assert!((mean("d50") - 8e-3).abs() < 1e-15);
    let mut late = case.clone();
    late["probes"][0]["at"]["grains"] = json!({"mean_from": 7});
    let found = errors(&late);
    assert!(found.contains("before the averaging begins"), "{found}");
    let mut none = case;
    none.as_object_mut().unwrap().remove("grains");
    let found = errors(&none);
    assert!(found.contains("no grains in this case"), "{found}");
}

/// Checks that a disc lies still on a floor in partially saturated cells without a stated shear dashpot, with springs
/// against which the delay of the water's load drove it to 0.2 to 0.4 mm/s.
#[test]
fn a_disc_on_a_floor_lies_still() {
    let _beside = beside_others();
    for (density, stiffness) in [(1050, 4e4), (1200, 4.2e4), (2000, 4.4e5)] {
        let case = json!({
            "domain": {"size": [0.015, 0.012], "spacing": 0.0005},
            "gravity": [0, -9.81],
            "materials": {"stone": {"density": density}, "floor": {}},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5}},
            "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.2,
                                   "normal_stiffness": {"absolute": stiffness}}},
            "box_walls": ["x_min", "x_max", "y_min", "y_max"],
            "box_wall_material": "floor",
            "coupling": {"partially_saturated": {}},
            "bodies": [{"name": "disc", "shape": {"disc": {"radius": 0.0015}}, "position": [0.007, 0.0015],
                        "motion": {"free": {}}, "material": "stone"}],
            "time": {"end": 0.4},
            "probes": [{"name": "disc", "every": 0.002, "at": {"body": {"name": "disc"}}}],
            "output": {}
        });
        let study = Study::new(&case.to_string());
        study.run("rest", 1, 1, &[]);
        let rows = io::table::read(&study.path("rest").join("probe_disc.csv")).unwrap();
        let speeds = rows.column("velocity_x").unwrap();
        let late = &speeds[speeds.len() / 2..];
        let largest = late.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        // The roll of the start decays from 3e-6 m/s.
        assert!(
            largest < 5e-6,
            "{density} kg/m3, {stiffness} N/m: {largest} m/s"
        );
    }
}
