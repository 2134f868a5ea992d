//! Bodies in water with a free surface: the same bits on any ranks, threads and slabs and across restarts, the mass
//! of the water, and loads at rest.

use super::ranks::{Study, beside_others};
use serde_json::Value;

/// Changes for a light and a heavy disc that fall into water between two walls.
const DISCS: [(&str, &str); 9] = [
    ("domain", r#"{"size": [0.08, 0.06], "spacing": 0.002}"#),
    ("fluid.lattice_boltzmann.time_step", "1e-4"),
    (
        "fluid.lattice_boltzmann.surface.water",
        r#"[{"level": 0.0231}]"#,
    ),
    (
        "materials",
        r#"{"wood": {"density": 700}, "rock": {"density": 2600}, "wall": {}}"#,
    ),
    (
        "contact",
        r#"{"linear": {"friction_angle_degrees": 20, "normal_stiffness": {"absolute": 50000},
            "normal_damping_ratio": 0.2}}"#,
    ),
    ("box_walls", r#"["x_min", "x_max", "y_min"]"#),
    ("box_wall_material", "wall"),
    (
        "bodies",
        r#"[{"name": "log", "shape": {"disc": {"radius": 0.0083}}, "position": [0.0211, 0.0351],
             "motion": {"free": {}}, "material": "wood"},
            {"name": "boulder", "shape": {"disc": {"radius": 0.0061}}, "position": [0.0532, 0.0401],
             "motion": {"free": {"velocity": [-0.4, -0.5], "angular_velocity": 10}}, "material": "rock"}]"#,
    ),
    (
        "probes",
        r#"[{"name": "log", "every": 0.005, "at": {"body": {"name": "log"}}}]"#,
    ),
];

/// Checks that the momentum that the water lost is that exchanged with bodies, walls and the body force.
fn closes_momentum(summary: &Value) {
    let error = summary["momentum_error"].as_f64().unwrap();
    assert!(error < 1e-9, "{error}");
}

/// Checks that the water has conserved its mass.
fn keeps_water(water: &Value, within: f64) {
    let error = water["mass_error"].as_f64().unwrap();
    assert!(error.abs() < within, "{water}");
    assert!(water["lost"].as_f64().unwrap().abs() < 0.01 * water["mass"].as_f64().unwrap());
}

#[test]
fn discs_that_fall_into_water_on_any_ranks_and_over_restarts() {
    let _beside = beside_others();
    let mut set = DISCS.to_vec();
    set.extend([("checkpoint.every", "0.03"), ("time.end", "0.12")]);
    let study = Study::from_example("dam-break", &set);
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("threads", 1, 2, "domain.split=y"),
        ("two", 2, 1, "domain.split=x"),
        ("three", 3, 1, "domain.split=y"),
        ("narrow", 3, 2, "domain.slab_bounds=[1, 21]"),
        ("empty", 3, 1, "domain.slab_bounds=[20, 20]"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0417"]);
    study.restart("parts", 1, &["time.end=0.08"]).expect(0);
    study.restart("parts", 3, &["time.end=0.12"]).expect(0);
    study.same("straight", "parts");
    keeps_water(&study.summary("straight")["water"], 1e-12);
    closes_momentum(&study.summary("straight"));
}

#[test]
fn a_block_and_a_sphere_in_three_dimensions_with_eddies() {
    let _beside = beside_others();
    let mut set = DISCS.to_vec();
    set.extend([
        (
            "domain",
            r#"{"size": [0.05, 0.045, 0.04], "spacing": 0.0025, "periodic": ["z"]}"#,
        ),
        ("gravity", "[0, -9.81, 0]"),
        ("fluid.lattice_boltzmann.collision", r#"{"cumulant": {}}"#),
        ("fluid.lattice_boltzmann.turbulence", r#"{"wale": {}}"#),
        ("fluid.lattice_boltzmann.kinematic_viscosity", "1e-5"),
        ("contact", r#"{"blocks": {"normal_stiffness": {"per_contact": 1e5}, "friction_angle_degrees": 20,
            "normal_damping_ratio": 0.3, "shear_damping_ratio": 0.3}}"#),
        ("probes", "[]"),
        (
            "materials",
            r#"{"wood": {"density": 800}, "rock": {"density": 2600}, "wall": {}}"#,
        ),
        (
            "bodies",
            r#"[{"name": "sphere", "shape": {"sphere": {"radius": 0.0083}}, "position": [0.0151, 0.0331, 0.039],
                 "motion": {"free": {}}, "material": "wood"},
                {"name": "block", "shape": {"cuboid": {"edges": [0.012, 0.009, 0.015]}},
                 "position": [0.0352, 0.0321, 0.02], "orientation": {"axis": [1, 2, 3], "angle_degrees": 31},
                 "motion": {"free": {"velocity": [-0.1, -0.5, 0.1], "angular_velocity": [5, 0, 10]}},
                 "material": "rock"}]"#,
        ),
        ("time.end", "0.04"),
    ]);
    // The plan refuses a sphere this light by a map of runs with `mrt`; this run is short, and has cumulants.
    let study = Study::from_example("dam-break", &set).unstable();
    study.run("straight", 1, 2, &[]);
    // Fractions of rotated blocks are rounded along rows, so that slabs along another axis have other bits, with a
    // surface or without.
    study.same_on(&[("two", 2, 1, ""), ("three", 3, 1, ""), ("thread", 1, 1, "")]);
    study.run("parts", 2, 1, &["time.end=0.0123"]);
    study.restart("parts", 3, &["time.end=0.04"]).expect(0);
    study.same("straight", "parts");
    keeps_water(&study.summary("straight")["water"], 1e-12);
    closes_momentum(&study.summary("straight"));
}

/// Checks that bodies drift in a stream between openings, one of them out of the domain, with the same bits, and that
/// the mass of the water is conserved.
#[test]
fn discs_in_a_stream_between_openings() {
    let _beside = beside_others();
    let mut set = DISCS.to_vec();
    set.extend([
        ("domain", r#"{"size": [0.12, 0.06], "spacing": 0.002}"#),
        ("box_walls", r#"["y_min"]"#),
        ("fluid.lattice_boltzmann.collision", r#"{"bgk": {}}"#),
        (
            "fluid.lattice_boltzmann.boundaries",
            r#"[{"name": "in", "face": "x_min", "condition": {"discharge": {"value": 0.008}}},
                {"name": "out", "face": "x_max", "condition": {"level": {"value": 0.021}}}]"#,
        ),
        (
            "bodies",
            r#"[{"name": "log", "shape": {"disc": {"radius": 0.0083}}, "position": [0.1011, 0.0251],
                 "motion": {"free": {"velocity": [0.3, 0]}}, "material": "wood"},
                {"name": "boulder", "shape": {"disc": {"radius": 0.0061}}, "position": [0.0532, 0.0401],
                 "motion": {"free": {"velocity": [-0.4, -0.5], "angular_velocity": 10}}, "material": "rock"}]"#,
        ),
        ("checkpoint.every", "0.03"),
        ("time.end", "0.12"),
    ]);
    // The plan expects that the log which leaves through the level ends the run; in this shallow stream it does not.
    let study = Study::from_example("dam-break", &set).unstable();
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("threads", 1, 2, "domain.split=y"),
        ("three", 3, 1, "domain.split=x"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0417"]);
    study.restart("parts", 3, &["time.end=0.12"]).expect(0);
    study.same("straight", "parts");
    keeps_water(&study.summary("straight")["water"], 1e-12);
    closes_momentum(&study.summary("straight"));
}

/// Checks that a driven block that stands on a floor of free slip, and touches walls, closes the balance from its first
/// step on, with the same bits.
#[test]
fn a_driven_block_on_faces_of_free_slip_closes_the_momentum() {
    let _beside = beside_others();
    let mut set = DISCS.to_vec();
    set.extend([
        (
            "domain",
            r#"{"size": [0.8, 0.36, 0.08], "spacing": 0.02}"#,
        ),
        ("gravity", "[0, -9.81, 0]"),
        ("fluid.lattice_boltzmann.time_step", "5e-4"),
        ("fluid.lattice_boltzmann.kinematic_viscosity", "1e-3"),
        (
            "fluid.lattice_boltzmann.surface.water",
            r#"[{"shape": {"box": {"from": [0.22, 0, 0], "to": [0.8, 0.17, 0.08]}}}]"#,
        ),
        (
            "fluid.lattice_boltzmann.boundaries",
            r#"[{"name": "floor", "face": "y_min", "condition": {"free_slip": {}}},
                {"name": "front", "face": "z_min", "condition": {"free_slip": {}}},
                {"name": "end", "face": "x_max", "condition": {"free_slip": {}}}]"#,
        ),
        ("box_walls", "[]"),
        ("probes", "[]"),
        ("contact", r#"{"blocks": {"normal_stiffness": {"per_contact": 1e5}}}"#),
        (
            "bodies",
            r#"[{"name": "piston", "shape": {"cuboid": {"edges": [0.2, 0.34, 0.08]}}, "position": [0.12, 0.17, 0.04],
                 "motion": {"driven": {"velocity": [0.3, 0, 0]}}, "material": "rock"}]"#,
        ),
        ("time.end", "0.55"),
    ]);
    let study = Study::from_example("dam-break", &set);
    study.run("straight", 1, 1, &[]);
    closes_momentum(&study.summary("straight"));
    study.same_on(&[("two", 2, 1, ""), ("threads", 1, 2, "")]);
}

/// Returns a disc in a stationary basin.
fn basin(name: &str, set: &[(&str, &str)]) -> Study {
    let mut all = DISCS.to_vec();
    all.extend([
        ("domain", r#"{"size": [0.06, 0.04], "spacing": 0.001}"#),
        (
            "probes",
            r#"[{"name": "log", "every": 0.005, "at": {"body": {"name": "log"}}}]"#,
        ),
        ("box_walls", "[]"),
        (
            "fluid.lattice_boltzmann.boundaries",
            r#"[{"name": "floor", "face": "y_min", "condition": {"free_slip": {}}},
                {"name": "left", "face": "x_min", "condition": {"free_slip": {}}},
                {"name": "right", "face": "x_max", "condition": {"free_slip": {}}}]"#,
        ),
    ]);
    all.extend(set);
    let study = Study::from_example("dam-break", &all);
    study.run(name, 1, 2, &[]);
    study
}

/// Returns the area of a disc below a height above its centre.
fn area_below(radius: f64, height: f64) -> f64 {
    let height = height.clamp(-radius, radius);
    radius * radius * (-height / radius).acos()
        + height * (radius * radius - height * height).sqrt()
}

#[test]
fn a_disc_on_the_bottom_has_the_load_of_the_water_at_rest() {
    let _beside = beside_others();
    let (radius, centre, level) = (0.007, 0.0071, 0.0093);
    let study = basin(
        "bottom",
        &[
            (
                "fluid.lattice_boltzmann.surface.water",
                r#"[{"level": 0.0093}]"#,
            ),
            (
                "bodies",
                r#"[{"name": "log", "shape": {"disc": {"radius": 0.007}}, "position": [0.0301, 0.0071],
                     "motion": {"fixed": {}}, "material": "rock"}]"#,
            ),
            ("time.end", "0.5"),
        ],
    );
    let rows = io::table::read(&study.path("bottom").join("probe_log.csv")).unwrap();
    let load = *rows.column("fluid_force_y").unwrap().last().unwrap();
    let exact = 9810.0 * area_below(radius, level - centre);
    assert!((load / exact - 1.0).abs() < 0.01, "{load} of {exact}");
}

#[test]
fn a_disc_floats_at_its_draught() {
    let _beside = beside_others();
    let radius = 0.007;
    let study = basin(
        "floats",
        &[
            (
                "fluid.lattice_boltzmann.surface.water",
                r#"[{"level": 0.0203}]"#,
            ),
            ("materials", r#"{"wood": {"density": 600}, "wall": {}}"#),
            (
                "bodies",
                r#"[{"name": "log", "shape": {"disc": {"radius": 0.007}}, "position": [0.0301, 0.0199],
                     "motion": {"free": {}}, "material": "wood"}]"#,
            ),
            ("time.end", "1"),
        ],
    );
    let rows = io::table::read(&study.path("floats").join("probe_log.csv")).unwrap();
    let heights = rows.column("y").unwrap();
    let late = &heights[heights.len() - 60..];
    let mean = late.iter().sum::<f64>() / 60.0;
    let (mut low, mut high) = (-radius, radius);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if area_below(radius, middle) < 0.6 * std::f64::consts::PI * radius * radius {
            low = middle;
        } else {
            high = middle;
        }
    }
    let displaced = area_below(radius, low) - area_below(radius, 0.0203 - 0.0199);
    let level = 0.0203 + displaced / 0.06;
    let (draught, exact) = (level - mean + radius, low + radius);
    assert!((draught / exact - 1.0).abs() < 0.02, "{draught} of {exact}");
}

/// Checks the buoyancy of a fixed disc of ten cells in a closed tank where gravity acts on the water: by default that
/// of its area, to the rounding of the lattice. A stated viscous weighting, with which it is a fifth too small, is
/// warned of.
#[test]
fn hydrostatic_pressure_carries_the_area_of_a_disc() {
    let _beside = beside_others();
    let case = |cells: &str| {
        format!(
            r#"{{"domain": {{"size": [0.3, 0.2], "spacing": 0.01}}, "gravity": [0, -9.81],
            "fluid": {{"lattice_boltzmann": {{"density": 1000, "kinematic_viscosity": 0.001,
                "gravity_acts_on_fluid": true, "time_step": 0.00025}}}},
            "materials": {{"m": {{"density": 2000}}}}, "coupling": {{"partially_saturated": {cells}}},
            "bodies": [{{"name": "disc", "shape": {{"disc": {{"radius": 0.05}}}}, "position": [0.15, 0.1],
                "motion": {{"fixed": {{}}}}, "material": "m"}}],
            "time": {{"end": 1}},
            "probes": [{{"name": "disc", "every": 0.5, "at": {{"body": {{"name": "disc"}}}}}}]}}"#
        )
    };
    let study = Study::new(&case("{}"));
    study.run("run", 1, 1, &[]);
    let text = std::fs::read_to_string(study.path("run/probe_disc.csv")).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let column = lines
        .next()
        .unwrap()
        .split(',')
        .position(|head| head == "fluid_force_y");
    let last: Vec<f64> = lines
        .next_back()
        .unwrap()
        .split(',')
        .map(|x| x.parse().unwrap())
        .collect();
    let exact = 1000.0 * 9.81 * std::f64::consts::PI * 0.05_f64.powi(2);
    let force = last[column.unwrap()];
    assert!((force / exact - 1.0).abs() < 2e-3, "{force} {exact}");
    let warned = |cells: &str| {
        let document = solver::case::Document::read(&case(cells), &[], std::path::Path::new("."));
        let plan = solver::plan::Plan::prepare(document.unwrap()).unwrap();
        let mut warnings = plan.warnings.iter();
        warnings.any(|w| w.path == "coupling.partially_saturated.weighting")
    };
    let operator = r#""solid_operator": "non_equilibrium_bounce_back""#;
    assert!(warned(&format!(
        r#"{{"weighting": "viscous", {operator}}}"#
    )));
    assert!(!warned(&format!("{{{operator}}}")));
}
