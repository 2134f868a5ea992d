//! Guards: failures are detected within 100 steps and named, proposed remedies work, and values that were not
//! measured are absent.

use crate::ranks::{Done, beside_others, run};
use serde_json::{Value, json};

/// Scene with its finished run.
struct Ran {
    done: Done,
    summary: Value,
    folder: tempfile::TempDir,
}

fn ran(ranks: usize, case: &Value, more: &[&str]) -> Ran {
    let _beside = beside_others();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("case.json");
    std::fs::write(&file, case.to_string()).unwrap();
    let text = |path: &std::path::Path| path.to_str().unwrap().to_owned();
    let output = folder.path().join("run");
    let mut arguments = vec![text(&file), "--output".into(), text(&output)];
    arguments.extend(["--threads", "1", "--allow-unstable"].map(String::from));
    arguments.extend(more.iter().map(|word| (*word).to_owned()));
    let done = run(ranks, &arguments);
    let summary = std::fs::read_to_string(output.join("summary.json")).unwrap_or_default();
    Ran {
        done,
        summary: serde_json::from_str(&summary).unwrap_or_default(),
        folder,
    }
}

impl Ran {
    fn number(&self, name: &str) -> f64 {
        let found = self.summary[name].as_f64();
        found.unwrap_or_else(|| panic!("{name}: {:#}", self.summary))
    }

    fn warned(&self, words: &str) -> bool {
        let all = self.summary["warnings"].as_array().unwrap();
        all.iter()
            .any(|text| text.as_str().unwrap().contains(words))
    }
}

/// Returns a channel of 4 x 1 m with a parabolic inlet of 1 m/s and a pressure outlet, TRT, 40 cells across: at cell
/// Reynolds number 15 and tau = 0.52 the flow fails even if it starts with the exact parabola.
fn channel(tau: f64, peak: f64, viscosity: f64) -> Value {
    let step = (tau - 0.5) / 3.0 * 0.025 * 0.025 / viscosity;
    json!({
        "domain": {"size": [4, 1], "spacing": 0.025},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": viscosity, "relaxation_time": tau, "collision": {"trt": {}},
            "boundaries": [
                {"name": "inlet", "face": "x_min",
                    "condition": {"velocity": {"profile": {"parabolic": {"peak": peak}}}}},
                {"name": "outlet", "face": "x_max",
                 "condition": {"pressure": {"value": 0, "sound": "reflect", "held": "each_cell"}}}
            ]
        }},
        "time": {"end": 1200.0 * step}
    })
}

/// Returns a case with a pressure that is imposed at once and changes the density by 30 % at tau = 0.8.
fn hammer(tau: f64) -> Value {
    json!({
        "domain": {"size": [1, 0.25], "spacing": 0.025},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "relaxation_time": tau,
            "boundaries": [
                {"name": "inlet", "face": "x_min", "condition": {"pressure": {"value": 16}}},
                {"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0, "sound": "reflect"}}}
            ]
        }},
        "guards": {"limits": "warn"},
        "time": {"end": 20}
    })
}

/// Returns water that enters at `speed` in front of a row of wires with gaps narrower than a cell, or with every
/// second wire removed.
fn wires(speed: f64, every: usize, end: f64) -> Value {
    let bodies: Vec<Value> = (0..10)
        .step_by(every)
        .map(|n| {
            json!({
                "name": format!("wire {n}"), "shape": {"disc": {"radius": 0.00099}}, "motion": {"fixed": {}},
                "position": [0.03, 0.001 + 0.002 * f64::from(u8::try_from(n).unwrap())], "material": "steel"
            })
        })
        .collect();
    json!({
        "domain": {"size": [0.06, 0.02], "spacing": 0.001, "periodic": ["y"]},
        "materials": {"steel": {"density": 7800}},
        "bodies": bodies,
        "coupling": {"bounce_back": {"scheme": "half_way"}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8,
            "boundaries": [
                {"name": "inlet", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [speed, 0]}}}},
                {"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0, "sound": "reflect"}}}
            ]
        }},
        "guards": {"limits": "warn"},
        "time": {"end": end}
    })
}

#[test]
fn remedies_that_are_named_are_those_that_help() {
    let viscosity = 0.025 / 15.0;
    let failed = ran(0, &channel(0.52, 1.0, viscosity), &[]).done.expect(4);
    let said = failed.stderr;
    for words in [
        "numerical failure: step ",
        " m moves at lattice velocity ",
        " m/s, above guards.max_lattice_velocity = 0.3; its density is ",
        " Pa); the nearest object is boundary ",
        " m; the nearest limit of the plan is `cell Reynolds number U h/nu",
        "a smaller time step did not help, but a cell Reynolds number of at most 10 did",
        "a slower flow or a larger viscosity",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    // Halving the time step does not help; a slower flow and a larger viscosity do.
    ran(0, &channel(0.51, 1.0, viscosity), &[]).done.expect(4);
    ran(0, &channel(0.52, 0.66, viscosity), &[]).done.expect(0);
    ran(0, &channel(0.53, 1.0, 0.0025), &[]).done.expect(0);
}

#[test]
fn compression_is_warned_of_and_ends_the_run() {
    let failed = ran(0, &hammer(0.8), &[]).done.expect(4);
    for words in [
        "% above the density at rest (pressure ",
        "beyond guards.max_compression = 0.2",
        "the nearest object is boundary inlet",
        "density change: the imposed pressure",
        "inflow ",
        "with an imposed pressure, a smaller time step",
    ] {
        assert!(failed.stderr.contains(words), "{words}: {}", failed.stderr);
    }
    // Half the time step gives a quarter of the compression.
    let warned = ran(0, &hammer(0.65), &[]);
    let compression = warned.number("compression");
    assert!((0.05..0.2).contains(&compression), "{compression}");
    assert!(warned.warned("above guards.warn_compression = 0.05"));
    let said = warned.done.expect(0).stdout;
    let line = said
        .lines()
        .find(|line| line.contains(": warning: the density of cell ["));
    let line = line.unwrap_or_else(|| panic!("{said}"));
    assert!(line.contains("] m is ") && line.contains(" Pa)"), "{line}");
    // The limits are those of the case.
    let own = ["--set", "guards.warn_compression=0.15"];
    let quiet = ran(0, &hammer(0.65), &own);
    assert!(!quiet.warned("density"), "{:#}", quiet.summary);
    let own = ["--set", "guards.max_compression=0.05"];
    let strict = ran(0, &hammer(0.65), &own).done.expect(4);
    assert!(strict.stderr.contains("guards.max_compression = 0.05"));
}

#[test]
fn a_row_of_wires_that_lets_nothing_through_is_no_silent_success() {
    // 2500 steps of 0.01 s: the inflow compresses the water in front of the wires by some percent.
    let full = ran(0, &wires(5e-5, 1, 25.0), &[]);
    assert!(
        full.warned("the domain only fills: inflow 1.000e-6, outflow"),
        "{:#}",
        full.summary
    );
    approx::assert_relative_eq!(full.number("inflow"), 1e-6, max_relative = 1e-9);
    assert!(full.number("outflow").abs() < 1e-12);
    approx::assert_relative_eq!(full.number("flow_imbalance"), 1.0, max_relative = 1e-6);
    let said = full.done.expect(0).stdout;
    assert_eq!(
        said.matches(": warning: the domain only fills").count(),
        1,
        "{said}"
    );
    assert!(said.contains("\nwarning: the domain only fills"), "{said}");
    // At twenty times the inflow the run fails.
    let burst = ran(0, &wires(1e-3, 1, 25.0), &[]).done.expect(4);
    assert!(
        burst.stderr.contains("guards.max_compression"),
        "{}",
        burst.stderr
    );
    assert!(burst.stderr.contains("body wire"), "{}", burst.stderr);
    let way = "check that an open path of several cells leads from inlet to outlet";
    assert!(burst.stderr.contains(way), "{}", burst.stderr);
    // With every second wire removed the water passes.
    let open = ran(0, &wires(5e-5, 2, 60.0), &[]);
    let imbalance = open.number("flow_imbalance");
    assert!(imbalance.abs() < 0.05, "{imbalance}");
    assert!(!open.warned("inflow"), "{:#}", open.summary);
}

#[test]
fn bodies_on_a_wall_do_not_upset_the_balance_of_momentum() {
    let mut case = wires(5e-4, 5, 20.0);
    case["domain"]["periodic"] = json!([]);
    case["bodies"][0]["position"] = json!([0.03, 0.0]);
    case["bodies"][0]["shape"]["disc"]["radius"] = json!(0.006);
    let ran = ran(0, &case, &[]);
    let (mass, momentum) = (ran.number("mass_error"), ran.number("momentum_error"));
    assert!(mass < 1e-14, "{mass:e}");
    assert!(momentum < 1e-9, "{momentum:e}");
    assert!(!ran.warned("balance"));
}

#[test]
fn what_was_not_measured_is_none() {
    let case = json!({
        "domain": {"size": [0.2, 0.2], "spacing": 0.01},
        "materials": {"rock": {"density": 2650}},
        "grains": {"material": "rock", "initial": {"list": [{"position": [0.1, 0.1], "radius": 0.01}]}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1000}, "normal_damping_ratio": 0.2}},
        "time": {"end": 0.01}
    });
    let dry = ran(0, &case, &[]);
    for name in [
        "lattice_velocity",
        "compression",
        "mass_error",
        "momentum_error",
        "inflow",
        "outflow",
        "flow_imbalance",
    ] {
        assert!(dry.summary[name].is_null(), "{name}: {:#}", dry.summary);
    }
    let said = dry.done.expect(0).stdout;
    assert!(
        said.contains("mass error - per step, momentum error - of the largest force"),
        "{said}"
    );
    assert!(
        said.contains("largest lattice velocity -, largest Mach number -, largest compression -, inflow -, outflow -"),
        "{said}"
    );
}

#[test]
fn looks_see_the_same_on_any_ranks() {
    let case = channel(0.6, 0.5, 0.01);
    let one = ran(0, &case, &[]);
    let two = ran(2, &case, &[]);
    for name in [
        "state_hash",
        "lattice_velocity",
        "compression",
        "inflow",
        "outflow",
        "flow_imbalance",
        "warnings",
    ] {
        assert_eq!(one.summary[name], two.summary[name], "{name}");
    }
    assert!(one.number("lattice_velocity") > 0.0);
    // 150 steps have a check at step 100 and one at the end.
    let short = ran(0, &case, &["--set", "time.end=0.3"]);
    assert!(short.number("lattice_velocity") > 0.0 && short.number("compression") > 0.0);
    drop(short.folder);
}

#[test]
fn tables_and_summary_agree_on_the_lattice_velocity() {
    let text = solver::case::examples::find("piping").unwrap().text;
    let case: Value = serde_json::from_str(text).unwrap();
    // There are fewer steps than between two checks.
    let more = [
        "--set",
        "time.end=0.005",
        "--set",
        "analysis.erosion_law.every=0.001",
    ];
    let eroded = ran(0, &case, &more);
    let rows = std::fs::read_to_string(eroded.folder.path().join("run/erosion.csv")).unwrap();
    let mut lines = rows.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = names
        .iter()
        .position(|name| name.starts_with("lattice_velocity"))
        .unwrap();
    let numbers = lines.map(|line| line.split(',').nth(column).unwrap().parse::<f64>().unwrap());
    let largest = numbers.fold(0.0, f64::max);
    let overall = eroded.number("lattice_velocity");
    assert!(largest > 0.0 && overall >= largest, "{overall} {largest}");
    assert!(eroded.number("steps") < 1000.0);
}

/// Returns a ball that flies at 5 m/s onto a thin plate.
fn flight(stiffness: f64) -> Value {
    json!({
        "domain": {"size": [0.2, 0.2, 0.2], "spacing": 0.01},
        "materials": {"rock": {"density": 2650}},
        "grains": {"material": "rock", "initial": {"list": [
            {"position": [0.1, 0.1, 0.15], "radius": 0.01, "velocity": [0, 0, -5]},
            {"position": [0.1, 0.13, 0.15], "radius": 0.01, "velocity": [0, 0, -4]}
        ]}},
        "walls": [{"name": "plate", "material": "rock", "shape": {"polygon": [
            [0, 0, 0.1], [0.2, 0, 0.1], [0.2, 0.2, 0.1], [0, 0.2, 0.1]
        ]}}],
        "contact": {"linear": {"normal_stiffness": {"absolute": stiffness}}},
        "time": {"end": 0.03, "solid_time_step_safety": 0.02}
    })
}

#[test]
fn a_contact_that_is_pierced_is_named() {
    let case = flight(1000.0);
    let pierced = ran(0, &case, &[]).done.expect(4);
    let said = pierced.stderr;
    for words in [
        "grain 0 overlapped wall plate by 0.",
        " of the smaller radius, above guards.max_overlap = 0.5",
        "the nearest limit of the plan is `overlap of an impact / radius`",
        "the contact is too soft",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    // delta/R = v (m/k)^1/2/R of the faster ball, on any number of ranks.
    let stiffness = 1e6;
    let mass = 2650.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-6;
    let exact = 5.0 * (mass / stiffness).sqrt() / 0.01;
    let alone = ran(0, &flight(stiffness), &[]).number("overlap");
    assert!((alone - exact).abs() < 1e-3 * exact, "{alone} {exact}");
    let shared = ran(2, &flight(stiffness), &[]).number("overlap");
    assert_eq!(alone.to_bits(), shared.to_bits());
    // The limit is that of the case.
    let mut strict = flight(stiffness);
    strict["guards"] = json!({"max_overlap": 0.01});
    ran(0, &strict, &[]).done.expect(4);
}

/// Checks a lid that moves onto a ball on the floor: the failure names the wall, against which no stiffness helps.
#[test]
fn a_wall_that_leaves_no_room_is_named() {
    let case = json!({
        "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.01},
        "materials": {"rock": {"density": 2600}},
        "grains": {"material": "rock", "initial": {"list": [{"position": [0.05, 0.05, 0.01], "radius": 0.01}]}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "normal_damping_ratio": 0.3}},
        "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"],
        "walls": [{"name": "lid", "material": "rock", "velocity": [0, 0, -0.1],
            "shape": {"plane": {"point": [0, 0, 0.021], "normal": [0, 0, -1]}}}],
        "time": {"end": 0.2}
    });
    let said = ran(0, &case, &[]).done.expect(4).stderr;
    for words in [
        "above guards.max_overlap",
        "the moving wall `lid` leaves a body no room",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// Checks that log and summary contain the Mach number next to the lattice velocity, and that the log reports a
/// lattice velocity above 0.1 once.
#[test]
fn a_mach_number_above_the_usual_is_reported() {
    let case = |speed: f64| {
        json!({
            "domain": {"size": [0.4, 0.1], "spacing": 0.01, "periodic": ["x"]},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-2, "time_step": 1e-3,
                "initial": {"uniform": {"velocity": [speed, 0]}},
                "boundaries": [
                    {"name": "low", "face": "y_min", "condition": {"free_slip": {}}},
                    {"name": "high", "face": "y_max", "condition": {"free_slip": {}}}
                ]
            }},
            "guards": {"limits": "warn"},
            "time": {"end": 0.3}
        })
    };
    // The lattice speed is C = 10 m/s.
    let fast = ran(0, &case(1.5), &[]);
    assert!((fast.number("lattice_velocity") - 0.15).abs() < 1e-9);
    assert!((fast.number("mach") - 0.15 * 3.0_f64.sqrt()).abs() < 1e-9);
    assert!(fast.warned("reached 0.150 (Mach number 0.260): above 0.1"));
    let said = fast.done.expect(0).stdout;
    assert!(
        said.contains("largest lattice velocity 1.5e-1, largest Mach number 2.6e-1"),
        "{said}"
    );
    let once = |words: &str| said.lines().filter(|line| line.contains(words)).count();
    assert_eq!(
        once(": warning: the lattice velocity |u| dt/h reached"),
        1,
        "{said}"
    );
    let slow = ran(0, &case(0.9), &[]);
    assert!(!slow.warned("Mach number"));
}

/// Checks a disc that moves through stationary water: the mean of the forces before and after a step (Ladd 1994) halves
/// their oscillation between steps, and preserves the mean.
#[test]
fn the_force_of_two_half_steps_swings_less() {
    let force = |average: bool| {
        let ran = ran(
            0,
            &json!({
                "domain": {"size": [0.006, 0.003], "spacing": 1e-4},
                "materials": {"steel": {"density": 7800}},
                "fluid": {"lattice_boltzmann": {
                    "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "collision": {"trt": {}}
                }},
                "coupling": {"bounce_back": {"scheme": "half_way", "force_average": average}},
                "bodies": [{
                    "name": "disc", "shape": {"disc": {"radius": 4.3e-4}}, "position": [0.002, 0.0015],
                    "motion": {"driven": {"velocity": [0.03, 0]}}, "material": "steel"
                }],
                "time": {"end": 0.05},
                "probes": [{"name": "disc", "every": 1e-4, "at": {"body": {"name": "disc"}}}]
            }),
            &[],
        );
        let file = ran.folder.path().join("run/probe_disc.csv");
        ran.done.expect(0);
        let rows = io::table::read(&file).unwrap();
        let forces = rows.column("fluid_force_x").unwrap();
        let settled = forces[forces.len() / 3..].to_vec();
        let count = f64::from(u32::try_from(settled.len()).unwrap());
        let mean = settled.iter().sum::<f64>() / count;
        let swing = settled.windows(2).map(|two| (two[1] - two[0]).powi(2));
        ((swing.sum::<f64>() / count).sqrt() / mean.abs(), mean)
    };
    let ((with, mean), (without, same)) = (force(true), force(false));
    println!("swing from step to step over the mean: {with} and {without}");
    assert!(with < 0.6 * without, "{with} {without}");
    assert!((mean / same - 1.0).abs() < 1e-3, "{mean} {same}");
}

/// Returns two discs, driven with these velocities, in water; `gaps` are the rules for narrow gaps.
fn pair(scheme: &str, velocities: [[f64; 2]; 2], initial: [f64; 2], gaps: &Value) -> Value {
    let disc = |name: &str, at: [f64; 2], velocity: [f64; 2]| {
        json!({"name": name, "shape": {"disc": {"radius": 4.3e-4}}, "position": at,
            "motion": {"driven": {"velocity": velocity}}, "material": "steel"})
    };
    let mut links = gaps.clone();
    links["scheme"] = json!(scheme);
    json!({
        "domain": {"size": [0.006, 0.003], "spacing": 1e-4, "periodic": ["x", "y"]},
        "materials": {"steel": {"density": 7800}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "collision": {"trt": {}},
            "initial": {"uniform": initial}
        }},
        "coupling": {"bounce_back": links},
        "bodies": [
            disc("first", [0.002, 0.0015], velocities[0]),
            disc("second", [0.00288, 0.00152], velocities[1])
        ],
        "guards": {"check_every_steps": 1},
        "time": {"end": 0.0385}
    })
}

/// Checks a disc that approaches another one: cells with five or more solid neighbours, whose surfaces have one
/// velocity, are compressed less.
#[test]
fn enclosed_cells_with_one_velocity_are_squeezed_less() {
    let squeezed = |gaps: &Value| {
        let mut case = pair("half_way", [[0.03, 0.0], [0.0; 2]], [0.0; 2], gaps);
        case["bodies"][1]["position"] = json!([0.00403, 0.00152]);
        case["bodies"][1]["motion"] = json!({"fixed": {}});
        case["domain"]["periodic"] = json!([]);
        let ran = ran(0, &case, &[]);
        (ran.number("compression"), ran.number("lattice_velocity"))
    };
    let (own, fast) = squeezed(&json!({"mean_wall_velocity_at_solid_neighbours": 0}));
    for rule in [
        "drop_wall_velocity_at_solid_neighbours",
        "mean_wall_velocity_at_solid_neighbours",
    ] {
        let (shared, slow) = squeezed(&json!({rule: 5}));
        println!("{rule}: compression {shared} of {own}, lattice velocity {slow} of {fast}");
        assert!(
            shared < 0.9 * own && slow < 0.9 * fast,
            "{shared} {own} {slow} {fast}"
        );
    }
}

/// Checks Galilean invariance: water that moves with two touching discs stays uniform and exerts no force on them.
#[test]
fn touching_discs_that_move_with_their_water_do_not_disturb_it() {
    for scheme in ["half_way", "interpolated"] {
        let velocity = [0.03, 0.013];
        let disturbed = |gaps: &Value| {
            let case = pair(scheme, [velocity; 2], velocity, gaps);
            // A run that ends for its compression does not report it.
            let compression = ran(0, &case, &[]).summary["compression"].as_f64();
            compression.unwrap_or(f64::INFINITY)
        };
        let with = disturbed(&json!({}));
        let at_rest = disturbed(&json!({"drop_wall_velocity_at_solid_neighbours": 5}));
        println!("{scheme}: compression {with:.1e}, with surfaces at rest {at_rest:.1e}");
        assert!(with < 1e-9, "{scheme}: {with}");
        assert!(at_rest > 1e-3, "{scheme}: {at_rest}");
    }
}

/// Checks a disc that moves along a wall with the velocity of the wall and of the water.
#[test]
fn a_disc_at_a_wall_that_moves_with_it_does_not_disturb_the_water() {
    let disturbed = |gaps: &Value| {
        let velocity = [0.03, 0.0];
        let mut case = pair("half_way", [velocity; 2], velocity, gaps);
        case["domain"]["periodic"] = json!(["x"]);
        let moving = json!({"moving_wall": {"velocity": velocity}});
        let wall = |face: &str| json!({"name": face, "face": face, "condition": moving.clone()});
        case["fluid"]["lattice_boltzmann"]["boundaries"] = json!([wall("y_min"), wall("y_max")]);
        case["bodies"][0]["position"] = json!([0.002, 4.4e-4]);
        case["bodies"][1]["position"] = json!([0.004, 0.00255]);
        ran(0, &case, &[]).number("compression")
    };
    let with = disturbed(&json!({}));
    let at_rest = disturbed(&json!({"drop_wall_velocity_at_solid_neighbours": 5}));
    println!("compression {with:.1e}, with surfaces at rest {at_rest:.1e}");
    assert!(with < 1e-9, "{with}");
    assert!(at_rest > 1e-3, "{at_rest}");
}

/// Checks failing water that ejects a body within a step: the message reports the water, and proposes no wall.
#[test]
fn water_that_throws_a_body_out_is_what_failed() {
    let case = json!({
        "domain": {"size": [0.06, 0.02, 0.02], "spacing": 0.001},
        "materials": {"rock": {"density": 2650}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6,
            "lattice": "d3q27", "collision": {"trt": {}}, "time_step": 1e-4,
            "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [2.5, 0, 0]}}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
        "bodies": [{"name": "b", "shape": {"sphere": {"radius": 0.004}}, "position": [0.03, 0.01, 0.01],
            "motion": {"free": {}}, "material": "rock"}],
        "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "friction_angle_degrees": 20}},
        "guards": {"check_every_steps": 100_000},
        "time": {"end": 0.5}
    });
    for ranks in [1, 2] {
        let ran = ran(ranks, &case, &[]);
        let told = ran.done.stderr.clone();
        assert!(
            told.contains("above guards.max_lattice_velocity") || told.contains("is not finite"),
            "{told}"
        );
        assert!(
            told.contains("left the box with this water") && !told.contains("box_walls"),
            "{told}"
        );
    }
}

/// Returns a disc of 10 cells with links that starts to move at this cell Reynolds number.
fn moving_disc(cell: f64) -> Value {
    json!({
        "domain": {"size": [0.06, 0.04], "spacing": 1e-3, "periodic": ["x", "y"]},
        "materials": {"steel": {"density": 7800}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "time_step": 0.06 / cell, "collision": {"trt": {}}
        }},
        "bodies": [{
            "name": "rod", "shape": {"disc": {"radius": 5e-3}}, "position": [0.012, 0.02017],
            "motion": {"driven": {"velocity": [cell * 1e-3, 0]}}, "material": "steel"
        }],
        "coupling": {"bounce_back": {"scheme": "interpolated"}},
        "time": {"end": 35.0 / cell}
    })
}

/// Checks that the plan calls a moving body unstable if its run fails, and proposes a spacing at which the run is
/// stable.
#[test]
fn a_body_that_moves_fails_where_the_plan_says_so() {
    let fails = ran(1, &moving_disc(20.0), &[]);
    assert_eq!(fails.done.code, Some(4), "{}", fails.done.stderr);
    assert!(
        fails.done.stderr.contains("moving-disc-10"),
        "{}",
        fails.done.stderr
    );
    let spacing = [
        "--set",
        "domain.spacing=0.0005",
        "--set",
        "fluid.lattice_boltzmann.time_step=0.0015",
    ];
    let holds = ran(1, &moving_disc(20.0), &spacing);
    assert_eq!(holds.done.code, Some(0), "{}", holds.done.stderr);
}

/// Checks a run in which two bonded grains separate, and later two others overlap too much: the table of bonds contains
/// the bond that broke before the run failed.
#[test]
fn a_run_that_fails_leaves_its_tables() {
    let grain =
        |x: f64, y: f64, u: f64| json!({"position": [x, y], "radius": 0.001, "velocity": [u, 0]});
    let case = json!({
        "domain": {"size": [0.1, 0.02], "spacing": 0.002},
        "materials": {"sand": {"density": 2600}},
        "grains": {"material": "sand", "bond_at_start": true, "initial": {"list": [
            grain(0.02, 0.005, -0.5), grain(0.021_999_9, 0.005, 0.5),
            grain(0.03, 0.015, 20.0), grain(0.04, 0.015, -20.0)
        ]}},
        "contact": {"cohesive_frictional": {"normal_stiffness": {"absolute": 1e4},
            "cohesion": {"absolute": 1e-2}, "friction_angle_degrees": 20}},
        "guards": {"limits": "warn"},
        "time": {"end": 0.01}
    });
    let ran = ran(1, &case, &[]);
    assert_eq!(ran.done.code, Some(4), "{}", ran.done.stderr);
    let bonds = std::fs::read_to_string(ran.folder.path().join("run/bonds.csv")).unwrap();
    let rows = bonds
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    assert_eq!(rows.count(), 1, "{bonds}");
}

/// Checks that a failure names the outlet that a body covers, in the plan and in the message of the run: the water that
/// enters cannot leave, and its mass grows.
#[test]
fn an_outlet_that_a_body_covers_is_named() {
    let case = json!({
        "domain": {"size": [0.04, 0.02], "spacing": 0.001},
        "materials": {"glass": {"density": 2500}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8, "boundaries": [
                {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [2e-3, 0]},
                    "ramp_time": 1}}},
                {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}},
                 "patch": {"from": [0, 0.006], "to": [0.04, 0.014]}}]}},
        "bodies": [{"name": "disc", "shape": {"disc": {"radius": 0.005}}, "position": [0.034, 0.01],
                    "motion": {"driven": {"velocity": [1e-3, 0], "history": [[0, 1], [5, 1], [5, 0]]}},
                    "material": "glass"}],
        "time": {"end": 60}
    });
    for ranks in [0, 2] {
        let said = ran(ranks, &case, &[]).done.expect(4).stderr;
        for words in [
            "the body `disc` can reach and cover 8 of the 8 cells of the outlet `out`",
            "bodies cover 8 of 8 cells of `out`: the water that enters cannot leave there, so that its mass and \
             density grow",
        ] {
            assert!(said.contains(words), "{ranks}: {said}");
        }
    }
}
