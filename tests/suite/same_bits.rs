//! Equal bits on any number of ranks and threads, for any split, and across restarts on other numbers of ranks: the
//! hash of the state, every table byte for byte, every number of every field.

use crate::ranks::{Study, beside_others, run};

#[test]
fn an_eroding_hole_on_any_ranks_threads_and_slabs() {
    let _beside = beside_others();
    let study = Study::eroding(&[]);
    study.run("straight", 1, 1, &[]);
    // All kinds of events occur in the run.
    let bonds = study.rows("straight", "bonds.csv");
    assert!(bonds > 20, "{bonds} bonds broke");
    assert!(study.rows("straight", "removed.csv") > 0);
    assert_eq!(study.rows("straight", "erosion.csv"), 61);
    assert_eq!(study.summary("straight")["grains"], 68);
    let erosion = study.summary("straight")["erosion"].clone();
    for name in [
        "contacts_per_grain",
        "bonds_per_grain",
        "face_share",
        "bulk_displacement",
    ] {
        let value = erosion[name].as_f64();
        assert!(value.is_some_and(|value| value > 0.0), "{name}: {value:?}");
    }
    for (name, ranks, threads, set) in [
        ("two with threads", 2, 2, &[][..]),
        ("three along y", 3, 1, &["domain.split=y"]),
        ("four", 4, 1, &[]),
        // An empty slab in the middle; slabs of three planes, thinner than a grain of ten.
        ("empty slab", 3, 1, &["domain.slab_bounds=[70, 70]"]),
        ("thin slab", 4, 1, &["domain.slab_bounds=[60, 63, 100]"]),
    ] {
        study.run(name, ranks, threads, set);
        study.same("straight", name);
        assert_eq!(study.summary(name)["erosion"], erosion, "{name}");
    }
}

#[test]
fn restarts_on_other_ranks_equal_the_straight_run() {
    let _beside = beside_others();
    let study = Study::eroding(&[("checkpoint.every", "0.006")]);
    study.run("straight", 1, 1, &[]);
    // Each part continues from its last checkpoint; rows after the checkpoint are written again.
    study.run("parts", 1, 1, &["time.end=0.008"]);
    for (ranks, end) in [(2, "0.014"), (3, "0.02"), (1, "0.024")] {
        let done = study
            .restart("parts", ranks, &[&format!("time.end={end}")])
            .expect(0);
        assert!(
            done.stdout.contains("continuing from step"),
            "{}",
            done.stdout
        );
    }
    study.same("straight", "parts");
}

/// Checks a case whose output times are all between steps, and in which every part of the run ends between two rows.
#[test]
fn rows_are_at_the_nearest_steps_and_old_ends_leave_no_trace() {
    let _beside = beside_others();
    let study = Study::eroding(&[
        (
            "probes",
            r#"[
                {"name": "cut", "every": 0.00037, "at": {"plane": {"axis": "x", "position": 0.0015}}},
                {"name": "face", "every": 0.00053, "at": {"wall": {"face": "y_min"}}}
            ]"#,
        ),
        ("analysis.erosion_law.every", "0.00031"),
        ("output.fluid.every", "0.0017"),
        ("output.grains.every", "0.0023"),
        (
            "output.averages",
            r#"{"sample_every": 0.00029, "every": 0.0019, "profile": "y"}"#,
        ),
        ("checkpoint.every", "0.0027"),
        ("time.end", "0.006"),
    ]);
    study.run("straight", 1, 1, &[]);
    let summary = study.summary("straight");
    let end = summary["steps"].as_u64().unwrap();
    let step = summary["time"].as_f64().unwrap() / number(end);
    for (file, every) in [
        ("probe_cut.csv", 0.00037),
        ("probe_face.csv", 0.00053),
        ("erosion.csv", 0.00031),
    ] {
        let text = std::fs::read_to_string(study.path("straight").join(file)).unwrap();
        let found: Vec<u64> = text
            .lines()
            .filter_map(|line| line.split(',').next()?.parse().ok())
            .collect();
        let mut expected: Vec<u64> = (0..=end)
            .filter(|&n| {
                let event = (number(n) * step / every).round() * every;
                ((event / step).round() - number(n)).abs() < 0.5
            })
            .collect();
        assert_ne!(expected.last(), Some(&end), "{file} ends between two rows");
        expected.push(end);
        // No mass has crossed a face at step 0.
        let expected = &expected[usize::from(file == "probe_face.csv")..];
        assert_eq!(found, expected, "{file}");
    }
    study.run("parts", 1, 1, &["time.end=0.0025"]);
    for (ranks, end) in [(2, "0.0043"), (1, "0.006")] {
        let done = study
            .restart("parts", ranks, &[&format!("time.end={end}")])
            .expect(0);
        assert!(
            done.stdout.contains("continuing from step"),
            "{}",
            done.stdout
        );
    }
    study.same("straight", "parts");
    // A finished run is unchanged by a restart.
    study.restart("parts", 1, &["time.end=0.006"]).expect(0);
    assert_eq!(study.summary("parts")["steps_of_this_run"], 0);
    study.same("straight", "parts");
}

#[expect(clippy::cast_precision_loss, reason = "small counts")]
fn number(n: u64) -> f64 {
    n as f64
}

#[test]
fn single_precision_at_rest_too() {
    let _beside = beside_others();
    let study = Study::eroding(&[
        ("fluid.lattice_boltzmann.storage", "f32"),
        ("time.end", "0.012"),
        ("checkpoint.every", "0.004"),
    ]);
    study.run("straight", 1, 1, &[]);
    study.run("three", 3, 1, &[]);
    study.same("straight", "three");
    study.run("parts", 2, 1, &["time.end=0.006"]);
    study.restart("parts", 3, &["time.end=0.012"]).expect(0);
    study.same("straight", "parts");
}

#[test]
fn collisions_in_single_precision_too() {
    let _beside = beside_others();
    let study = Study::eroding(&[
        ("fluid.lattice_boltzmann.arithmetic", "f32"),
        ("time.end", "0.012"),
        ("checkpoint.every", "0.004"),
    ]);
    study.run("straight", 1, 1, &[]);
    study.run("three", 3, 1, &[]);
    study.same("straight", "three");
    study.run("threads", 2, 2, &[]);
    study.same("straight", "threads");
    study.run("parts", 2, 1, &["time.end=0.006"]);
    study.restart("parts", 3, &["time.end=0.012"]).expect(0);
    study.same("straight", "parts");
}

#[test]
fn fluid_without_grains() {
    let _beside = beside_others();
    let study = Study::from_example("taylor-green", &[("time.end", "0.2")]);
    study.run("straight", 1, 1, &[]);
    study.run("three", 3, 2, &[]);
    study.same("straight", "three");
    study.run("two along y", 2, 1, &["domain.split=y"]);
    study.same("straight", "two along y");
}

/// Checks an eddy viscosity in 3-D: the velocity of the previous step is part of the state.
#[test]
fn turbulence_on_any_ranks_and_over_a_restart() {
    let _beside = beside_others();
    let study = Study::from_example(
        "taylor-green",
        &[
            (
                "domain",
                r#"{"size": [0.0024, 0.002, 0.0018], "spacing": 1e-4, "periodic": ["x", "y"]}"#,
            ),
            ("fluid.lattice_boltzmann.collision", r#"{"mrt": {}}"#),
            ("fluid.lattice_boltzmann.turbulence", r#"{"wale": {}}"#),
            ("fluid.lattice_boltzmann.relaxation_time", "0.51"),
            (
                "fluid.lattice_boltzmann.initial.taylor_green.velocity",
                "0.2",
            ),
            ("probes", "[]"),
            (
                "output.fluid",
                r#"{"every": 5e-4, "fields": ["velocity", "eddy_viscosity"], "precision": "f64"}"#,
            ),
            ("checkpoint.every", "0.0008"),
            ("time.end", "0.003"),
        ],
    );
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("two", 2, 2, "domain.split=y"),
        ("three", 3, 1, "domain.split=z"),
        ("four", 4, 1, "domain.split=x"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0015"]);
    study.restart("parts", 3, &["time.end=0.003"]).expect(0);
    study.same("straight", "parts");
}

/// Runs water between walls, which makes two steps in one sweep if no output reads the state between them: outputs, a
/// checkpoint and the end may be at any step.
#[test]
fn a_cavity_that_is_watched_now_and_then() {
    let _beside = beside_others();
    let watched =
        r#"[{"name": "often", "every": 1e-3, "at": {"point": {"position": [0.002, 0.003]}}}]"#;
    let seldom =
        r#"[{"name": "seldom", "every": 0.017, "at": {"point": {"position": [0.002, 0.003]}}}]"#;
    let study = Study::from_example(
        "cavity",
        &[
            ("domain.size", "[0.004, 0.006]"),
            ("probes", seldom),
            ("output", r#"{"fluid": {"every": 0.043}}"#),
            ("guards", r#"{"check_every_steps": 7}"#),
            ("checkpoint.every", "0.037"),
            ("time.end", "0.181"),
        ],
    );
    study.run("straight", 1, 1, &[]);
    study.run("watched", 1, 1, &[&format!("probes={watched}")]);
    assert_eq!(study.hash("watched"), study.hash("straight"));
    // One line of units in addition to the rows.
    assert_eq!(study.rows("watched", "probe_often.csv"), 183);
    assert_eq!(study.rows("straight", "probe_seldom.csv"), 13);
    study.same_on(&[
        ("threads", 1, 2, "domain.split=y"),
        ("two", 2, 2, "domain.split=x"),
        ("three", 3, 1, "domain.split=y"),
        ("uneven", 2, 1, "domain.slab_bounds=[5]"),
        // The middle rank has no planes, but still tracks the parity of the passes.
        ("empty", 3, 1, "domain.slab_bounds=[25, 25]"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.071"]);
    study.restart("parts", 1, &["time.end=0.18"]).expect(0);
    study.restart("parts", 3, &["time.end=0.181"]).expect(0);
    study.same("straight", "parts");
}

/// Runs 3-D flow with an eddy viscosity, whose velocities beyond walls and slabs are needed by the second of two
/// steps.
#[test]
fn eddies_between_walls_watched_now_and_then() {
    let _beside = beside_others();
    let watched = r#"[{"name": "often", "every": 1e-3, "at": {"point": {"position": [0.002, 0.003, 0.001]}}}]"#;
    let study = Study::from_example(
        "cavity",
        &[
            ("domain.size", "[0.0036, 0.0044, 0.004]"),
            ("fluid.lattice_boltzmann.collision", r#"{"mrt": {}}"#),
            ("fluid.lattice_boltzmann.turbulence", r#"{"wale": {}}"#),
            (
                "fluid.lattice_boltzmann.boundaries",
                r#"[{"name": "lid", "face": "y_max", "condition": {"moving_wall": {"velocity": [0.1, 0, 0.02]}}}]"#,
            ),
            ("fluid.lattice_boltzmann.reference_velocity", "0.1"),
            ("probes", "[]"),
            ("output", "{}"),
            ("guards", r#"{"check_every_steps": 7}"#),
            ("time.end", "0.0171"),
        ],
    );
    study.run("straight", 1, 1, &[]);
    study.run("watched", 1, 1, &[&format!("probes={watched}")]);
    assert_eq!(study.hash("watched"), study.hash("straight"));
    study.same_on(&[
        ("threads", 1, 2, "domain.split=z"),
        ("two", 2, 2, "domain.split=x"),
        ("three", 3, 1, "domain.split=y"),
        ("empty", 3, 1, "domain.slab_bounds=[15, 15]"),
    ]);
}

/// Checks a checkpoint of some megabytes, which is written and read in pieces, more of them for a thick slab than for a
/// thin one.
#[test]
fn a_state_of_many_pieces() {
    let _beside = beside_others();
    let study = Study::from_example(
        "taylor-green",
        &[
            (
                "domain",
                r#"{"size": [0.004, 0.004, 0.004], "spacing": 1e-4, "periodic": ["x", "y"], "split": "x"}"#,
            ),
            ("fluid.lattice_boltzmann.collision", r#"{"mrt": {}}"#),
            ("fluid.lattice_boltzmann.turbulence", r#"{"wale": {}}"#),
            ("fluid.lattice_boltzmann.relaxation_time", "0.51"),
            (
                "fluid.lattice_boltzmann.initial.taylor_green.velocity",
                "0.2",
            ),
            ("probes", "[]"),
            ("output", "{}"),
            ("time.end", "0.002"),
        ],
    );
    study.run("straight", 1, 2, &[]);
    for (name, ranks, bounds) in [
        ("thin and thick", 2, "[9]"),
        ("none, thick, thin", 3, "[0, 31]"),
    ] {
        let set = format!("domain.slab_bounds={bounds}");
        study.run(name, ranks, 1, &[&set, "time.end=0.001"]);
        let whole = ["time.end=0.002", "domain.slab_bounds=[35]"];
        study.restart(name, 2, &whole).expect(0);
        study.same("straight", name);
    }
}

/// Checks synthetic turbulence that enters, is convected out, and is averaged: sums over time are part of the state.
#[test]
fn averages_of_a_gusty_stream() {
    let _beside = beside_others();
    let boundaries = r#"[
        {"name": "in", "face": "x_min", "condition": {"velocity": {
            "profile": {"parabolic": {"peak": 0.2}},
            "turbulence": {"intensity": 0.2, "length_scale": 4e-4, "seed": 5}}}},
        {"name": "out", "face": "x_max", "condition": {"convective_outflow": {}}},
        {"name": "side", "face": "z_max", "condition": {"convective_outflow": {"velocity": 0.1}}}
    ]"#;
    let study = Study::from_example(
        "taylor-green",
        &[
            (
                "domain",
                r#"{"size": [0.0024, 0.002, 0.0018], "spacing": 1e-4}"#,
            ),
            ("fluid.lattice_boltzmann.relaxation_time", "0.51"),
            ("fluid.lattice_boltzmann.initial", r#"{"rest": {}}"#),
            ("fluid.lattice_boltzmann.boundaries", boundaries),
            ("probes", "[]"),
            (
                "output.averages",
                r#"{"from": 2e-4, "sample_every": 1e-4, "every": 1e-3, "profile": "y"}"#,
            ),
            ("checkpoint.every", "0.0008"),
            ("time.end", "0.003"),
        ],
    )
    .unstable();
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("two", 2, 2, "domain.split=y"),
        ("three", 3, 1, "domain.split=z"),
        ("four", 4, 1, "domain.split=x"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0015"]);
    study.restart("parts", 3, &["time.end=0.003"]).expect(0);
    study.same("straight", "parts");
}

/// Checks openings that absorb sound, which sum over their faces and whose stored values are part of the state.
#[test]
fn sound_leaves_on_any_ranks_and_over_a_restart() {
    let _beside = beside_others();
    let boundaries = r#"[
        {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"parabolic": {"peak": 0.01}},
        "sound": "absorb"}}},
        {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
    ]"#;
    let study = Study::from_example(
        "taylor-green",
        &[
            ("domain", r#"{"size": [0.0024, 0.002], "spacing": 1e-4}"#),
            ("fluid.lattice_boltzmann.relaxation_time", "0.7"),
            ("fluid.lattice_boltzmann.initial", r#"{"rest": {}}"#),
            ("fluid.lattice_boltzmann.boundaries", boundaries),
            (
                "probes",
                r#"[{"name": "in", "every": 7e-4, "at": {"wall": {"face": "x_min"}}}]"#,
            ),
            ("checkpoint.every", "0.008"),
            ("time.end", "0.06"),
        ],
    );
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("across", 3, 1, "domain.split=y"),
        ("along", 2, 1, "domain.split=x"),
        ("empty slab", 3, 1, "domain.slab_bounds=[12, 12]"),
    ]);
    study.run("parts", 1, 1, &["time.end=0.03", "domain.split=y"]);
    study.restart("parts", 3, &["time.end=0.06"]).expect(0);
    study.same("straight", "parts");
    let settled = study.summary("straight")["settled"].clone();
    assert_eq!(settled[0]["quantity"], "force");
    assert_eq!(settled, study.summary("parts")["settled"]);
    assert_eq!(settled, study.summary("across")["settled"]);
}

#[test]
fn grains_without_fluid() {
    let _beside = beside_others();
    let study = Study::from_example("collision", &[("checkpoint.every", "0.009")]);
    study.run("straight", 1, 2, &[]);
    study.run("three", 3, 1, &[]);
    study.same("straight", "three");
    study.run("parts", 2, 1, &["time.end=0.012"]);
    study.restart("parts", 1, &["time.end=0.03"]).expect(0);
    study.same("straight", "parts");
}

/// Checks a jointed slab on soft springs and a named block next to it: shapes, orientations and the histories of faces
/// move with the blocks between ranks.
#[test]
fn blocks_without_fluid() {
    let _beside = beside_others();
    let study = Study::from_example(
        "avalanche",
        &[
            ("contact.blocks.normal_stiffness", r#"{"per_area": 1e7}"#),
            ("output.blocks.every", "0.05"),
            ("checkpoint.every", "0.03"),
            ("time.end", "0.2"),
        ],
    );
    study.run("straight", 1, 2, &[]);
    study.same_on(&[
        ("three along y", 3, 1, "domain.split=y"),
        (
            "four with a thin one",
            4,
            1,
            "domain.slab_bounds=[6, 9, 10]",
        ),
    ]);
    study.run("parts", 2, 1, &["time.end=0.1"]);
    study.restart("parts", 3, &["time.end=0.2"]).expect(0);
    study.same("straight", "parts");
    assert_eq!(
        study.summary("straight")["blocks"],
        study.summary("parts")["blocks"]
    );
}

#[test]
fn a_body_wider_than_a_slab_in_a_stream() {
    let _beside = beside_others();
    // The cylinder covers planes 15 to 24 along x and 15 to 24 along y.
    let study = Study::from_example("cylinder", &[("time.end", "0.1")]);
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("across", 2, 1, "domain.split=y"),
        ("cut to pieces", 4, 1, "domain.slab_bounds=[16, 18, 23]"),
    ]);
}

/// Checks rock in turbulent water: covered cells, a free block across slabs, a bed of fixed blocks, a driven sphere, an
/// eddy viscosity, inlet and outlet. Slabs of two planes are thinner than the block.
#[test]
fn blocks_in_turbulent_water_on_any_ranks_and_over_a_restart() {
    let _beside = beside_others();
    let study = Study::new(SCOUR);
    study.run("straight", 1, 1, &[]);
    assert!(study.rows("straight", "probe_plucked.csv") >= 10);
    study.same_on(&[
        ("two", 2, 2, "domain.split=x"),
        ("three", 3, 1, "domain.split=z"),
        ("four", 4, 1, "domain.split=y"),
        ("thin", 3, 1, "domain.slab_bounds=[9, 11]"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.01"]);
    study.restart("parts", 3, &["time.end=0.02"]).expect(0);
    study.same("straight", "parts");
    // The other operators, in water viscous enough for the matched one.
    let thick = "fluid.lattice_boltzmann.kinematic_viscosity=0.02";
    let trt = r#"fluid.lattice_boltzmann.collision={"trt": {}}"#;
    for operator in ["superposition", "viscosity_matched"] {
        let chosen = format!("coupling.partially_saturated.solid_operator={operator}");
        let set = [
            thick,
            trt,
            "fluid.lattice_boltzmann.turbulence=null",
            "time.end=0.01",
            &chosen,
        ];
        study.run(&format!("{operator} alone"), 1, 1, &set);
        study.run(operator, 3, 1, &set);
        study.same(&format!("{operator} alone"), operator);
    }
}

/// Runs blocks with bounce-back links.
#[test]
fn blocks_with_bouncing_links_on_any_ranks() {
    let _beside = beside_others();
    // Viscous water: the plan limits the Reynolds number of links at faces.
    let case = SCOUR
        .replace(
            r#"{"partially_saturated": {}}"#,
            r#"{"bounce_back": {"scheme": "interpolated"}}"#,
        )
        .replace(r#"{"mrt": {}}"#, r#"{"trt": {}}"#)
        .replace(
            r#""kinematic_viscosity": 1e-4"#,
            r#""kinematic_viscosity": 1e-2"#,
        );
    let study = Study::new(&case);
    study.run("straight", 1, 1, &[]);
    study.run("three", 3, 1, &["domain.split=y"]);
    study.same("straight", "three");
    study.run("parts", 2, 1, &["time.end=0.01"]);
    study.restart("parts", 3, &["time.end=0.02"]).expect(0);
    study.same("straight", "parts");
}

const SCOUR: &str = r#"{
  "domain": {"size": [0.26, 0.12, 0.14], "spacing": 0.01, "periodic": ["y"]},
  "gravity": [0, 0, -9.81],
  "materials": {"rock": {"density": 2650}},
  "fluid": {
    "lattice_boltzmann": {
      "lattice": "d3q27",
      "density": 1000,
      "kinematic_viscosity": 1e-4,
      "collision": {"mrt": {}},
      "turbulence": {"wale": {}},
      "time_step": 2e-4,
      "initial": {"uniform": {"velocity": [2, 0, 0]}},
      "boundaries": [
        {"name": "inlet", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [2, 0, 0]}}}},
        {"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}},
        {"name": "surface", "face": "z_max", "condition": {"free_slip": {}}}
      ]
    }
  },
  "bodies": [
    {
      "name": "plucked",
      "shape": {"cuboid": {"edges": [0.056, 0.046, 0.04]}},
      "position": [0.1, 0.063, 0.072],
      "orientation": {"axis": [0, 0, 1], "angle_degrees": 20},
      "motion": {"free": {"velocity": [0.3, 0.1, 0.2], "angular_velocity": [1, 2, 3]}},
      "material": "rock"
    },
    {
      "name": "ball",
      "shape": {"sphere": {"radius": 0.021}},
      "position": [0.19, 0.005, 0.1],
      "motion": {"driven": {"velocity": [0.1, 0.2, 0]}},
      "material": "rock"
    }
  ],
  "blocks": {
    "material": "rock",
    "initial": {"list": [
      {"shape": {"cuboid": {"edges": [0.08, 0.118, 0.045]}}, "position": [0.04, 0.06, 0.0225]},
      {"shape": {"cuboid": {"edges": [0.12, 0.118, 0.045]}}, "position": [0.2, 0.06, 0.0225]}
    ]},
    "fixed": [{"from": [0, 0, 0], "to": [0.26, 0.12, 0.05]}]
  },
  "contact": {
    "blocks": {
      "normal_stiffness": {"per_area": 1e8},
      "friction_angle_degrees": 35,
      "normal_damping_ratio": 0.3,
      "shear_damping_ratio": 0.3
    }
  },
  "box_walls": ["z_min"],
  "coupling": {"partially_saturated": {}},
  "time": {"end": 0.02},
  "guards": {"max_lattice_velocity": 0.3},
  "probes": [{"name": "plucked", "every": 0.002, "at": {"body": {"name": "plucked"}}}],
  "output": {
    "fluid": {"every": 0.01, "fields": ["velocity", "eddy_viscosity"], "precision": "f64"},
    "blocks": {"every": 0.01}
  },
  "checkpoint": {"every": 0.006}
}"#;

/// Checks a block of discs that crosses the domain: the slabs are divided by cost at the start and again at checkpoints
/// during the run. With the rates of the plan a step costs more than messages, so that new slabs are worthwhile.
#[test]
fn slabs_of_equal_cost_change_in_the_run() {
    let _beside = beside_others();
    let mut discs = Vec::new();
    for row in 0..30_u32 {
        for column in 0..20_u32 {
            let (x, y) = (
                0.006 + 0.01 * f64::from(column),
                0.006 + 0.0095 * f64::from(row),
            );
            discs.push(format!(
                r#"{{"position": [{x}, {y}], "radius": 0.0045, "velocity": [{}, {}]}}"#,
                1.0 + 0.01 * f64::from(row % 3),
                0.02 * f64::from(column % 5)
            ));
        }
    }
    let study = Study::from_example(
        "collision",
        &[
            (
                "domain",
                r#"{"size": [1, 0.3], "spacing": 0.01, "periodic": ["y"]}"#,
            ),
            (
                "grains.initial",
                &format!(r#"{{"list": [{}]}}"#, discs.join(", ")),
            ),
            ("contact.linear.normal_stiffness", r#"{"absolute": 1e5}"#),
            ("time.solid_time_step_safety", "0.2"),
            ("output.grains.every", "0.1"),
            ("checkpoint.every", "0.13"),
            ("time.end", "0.6"),
        ],
    );
    study.run("straight", 1, 1, &["checkpoint={}"]);
    for ranks in [2, 4] {
        let name = format!("{ranks} ranks");
        let done = study.run(&name, ranks, 1, &[]);
        let cuts = done.stdout.matches("slabs of equal cost: ").count();
        assert!(cuts >= 3, "{cuts} cuts:\n{}", done.stdout);
        study.same("straight", &name);
        let summary = study.summary(&name);
        assert_eq!(summary["steps_of_this_run"], summary["steps"]);
    }
    // Slabs listed in the case are not changed.
    let done = study.run("listed", 2, 1, &["domain.slab_bounds=[50]"]);
    assert!(
        !done.stdout.contains("slabs of equal cost"),
        "{}",
        done.stdout
    );
    study.same("straight", "listed");
}

/// Checks that without a GPU `auto` selects the processor and `gpu` ends with an error message.
#[test]
fn a_cavity_on_a_gpu_if_there_is_one() {
    let _beside = beside_others();
    let study = Study::from_example(
        "cavity",
        &[
            ("domain.size", "[0.003, 0.0022, 0.0026]"),
            ("fluid.lattice_boltzmann.collision", r#"{"mrt": {}}"#),
            (
                "fluid.lattice_boltzmann.boundaries",
                r#"[{"name": "lid", "face": "y_max", "condition": {"moving_wall": {"velocity": [0.1, 0, 0.02]}}}]"#,
            ),
            ("fluid.lattice_boltzmann.reference_velocity", "0.1"),
            ("probes", "[]"),
            ("output", "{}"),
            ("guards", r#"{"check_every_steps": 7}"#),
            ("checkpoint.every", "0.0037"),
            ("time.end", "0.0121"),
        ],
    );
    let on = |device: &str| format!("fluid.lattice_boltzmann.device={device}");
    study.run("cpu", 1, 1, &[]);
    study.run("auto", 1, 2, &[&on("auto")]);
    study.same("cpu", "auto");
    let gpu = run(1, &study.arguments("gpu", 1, &[&on("gpu")]));
    if gpu.code == Some(0) {
        study.same("cpu", "gpu");
    } else {
        let gpu = gpu.expect(2);
        assert!(
            gpu.stderr.contains("device = gpu: ") && gpu.stderr.contains("device=cpu"),
            "{}",
            gpu.stderr
        );
    }
    // A run may continue on the other device.
    study.run("parts", 1, 1, &["time.end=0.006"]);
    let set = [&on("auto")[..], "time.end=0.0121"];
    study.restart("parts", 1, &set).expect(0);
    study.same("cpu", "parts");
    // Several ranks cannot share a GPU.
    let two = run(2, &study.arguments("two", 1, &[&on("gpu")])).expect(2);
    assert!(two.stderr.contains("several ranks"), "{}", two.stderr);
}
