//! Verdicts of the plan on openings with ends between the faces of cells, on grains that nothing stops, and on
//! packed spheres; openings that bodies reach.

use crate::ranks::{Study, beside_others};
use serde_json::{Value, json};
use solver::case::Document;
use solver::case::coupling::Coupling;
use solver::plan::Plan;
use std::path::Path;

fn plan(case: &Value) -> Plan {
    let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
    Plan::prepare(document).unwrap()
}

fn warned(plan: &Plan, words: &str) -> bool {
    plan.warnings.iter().any(|w| w.to_string().contains(words))
}

/// Checks that an outlet consists of whole cells, which the plan reports, and that the values of an inlet are weighted
/// by area in the cells that its ends intersect.
#[test]
fn an_opening_that_cells_move_is_named() {
    let pool = |from: f64, to: f64, condition: Value| {
        json!({
            "domain": {"size": [0.4, 0.16], "spacing": 0.004},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-3, "reference_velocity": 1.5, "lattice_velocity": 0.05,
                "boundaries": [
                    {"name": "jet", "face": "y_max", "condition": condition,
                     "patch": {"from": [from, 0], "to": [to, 0.16]}},
                    {"name": "side", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
            "time": {"end": 0.1}
        })
    };
    let words = "`jet` consists of whole cells: \
        along x it reaches from 0.188 to 0.208 m instead of from 0.19 to 0.21 m";
    let out = json!({"pressure": {"value": 100}});
    assert!(warned(&plan(&pool(0.19, 0.21, out.clone())), words));
    let on_faces = plan(&pool(0.188, 0.212, out));
    assert!(!warned(&on_faces, "consists of whole cells"));
    let jet = json!({"velocity": {"profile": {"uniform": [0, -1.5]}, "ramp_time": 0.05}});
    assert!(!warned(
        &plan(&pool(0.19, 0.21, jet)),
        "consists of whole cells"
    ));
}

/// Checks that the discharge that enters in a step equals the stated one, for any profile and patch, and that two ranks
/// let in the same.
#[test]
fn openings_let_the_stated_discharge_in() {
    let _beside = beside_others();
    let profiles = |dimension: usize| {
        let uniform = if dimension == 2 {
            json!([0.3, 0])
        } else {
            json!([0.3, 0, 0])
        };
        [
            (json!({"uniform": uniform}), 0.3),
            (
                json!({"parabolic": {"peak": 0.3}}),
                if dimension == 2 { 0.2 } else { 0.3 * 4.0 / 9.0 },
            ),
            (json!({"power_law": {"mean": 0.3}}), 0.3),
            (json!({"log_law": {"mean": 0.3, "roughness": 0.002}}), 0.3),
        ]
    };
    // Ends of the patch along the face; none for the whole face.
    let patches: [Option<[[f64; 2]; 2]>; 3] = [
        None,
        Some([[0.0137, 0.0611], [0.02, 0.0733]]),
        Some([[0.0, 0.0451], [0.031, 0.09]]),
    ];
    for dimension in [2, 3] {
        for (which, (profile, mean)) in profiles(dimension).into_iter().enumerate() {
            for (over, patch) in patches.into_iter().enumerate() {
                let mut inlet = json!({"name": "in", "face": "x_min", "condition": {"velocity": {"profile": profile}}});
                let sides = patch.unwrap_or([[0.0, 0.09]; 2]);
                if patch.is_some() {
                    let corner = |n: usize| {
                        let all = [0.0, sides[0][n], sides[1][n]];
                        json!(all[..dimension])
                    };
                    inlet["patch"] = json!({"from": corner(0), "to": corner(1)});
                }
                let area: f64 = sides[..dimension - 1].iter().map(|[a, b]| b - a).product();
                let size = &[0.15, 0.09, 0.09][..dimension];
                let case = json!({
                    "domain": {"size": size, "spacing": 0.006},
                    "fluid": {"lattice_boltzmann": {
                        "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 2e-4,
                        "boundaries": [inlet,
                            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
                    "time": {"end": 0.002}, "output": {}
                });
                let study = Study::new(&case.to_string());
                study.run("one", 1, 1, &[]);
                // Each patch on two ranks with another profile, and each profile with one patch at least.
                if which == over + usize::from(dimension == 3) {
                    study.run("two", 2, 1, &[]);
                    study.same("one", "two");
                }
                let inflow = study.summary("one")["inflow"].as_f64().unwrap();
                let stated = mean * area;
                assert!(
                    (inflow / stated - 1.0).abs() < 1e-3,
                    "{dimension}-D {profile} {patch:?}: {inflow} instead of {stated}"
                );
            }
        }
    }
}

/// Checks that water under gravity between two hydrostatic pressures remains stationary.
#[test]
fn hydrostatic_pressures_hold_water_at_rest() {
    let _beside = beside_others();
    let hydrostatic = json!({"pressure": {"value": 0, "gradient": [0, -9810]}});
    let reservoir =
        |name: &str, face: &str| json!({"name": name, "face": face, "condition": hydrostatic});
    let case = json!({
        "domain": {"size": [0.04, 0.02], "spacing": 0.001},
        "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-4, "gravity_acts_on_fluid": true,
            "boundaries": [reservoir("left", "x_min"), reservoir("right", "x_max")]}},
        "time": {"end": 0.5},
        "probes": [{"name": "middle", "every": 0.1, "at": {"plane": {"axis": "x", "position": 0.02}}}]
    });
    let study = Study::new(&case.to_string());
    study.run("one", 1, 1, &[]);
    let table = std::fs::read_to_string(study.path("one").join("probe_middle.csv")).unwrap();
    let last = table.lines().last().unwrap();
    let speed: f64 = last.split(',').nth(7).unwrap().parse().unwrap();
    // A constant pressure sets it in motion at 0.02 m/s.
    assert!(speed < 2e-4, "{last}");
}

fn flume(more: &[(&str, Value)]) -> Value {
    let mut case = json!({
        "domain": {"size": [0.04, 0.02, 0.024], "spacing": 5e-4, "periodic": ["x", "y"]},
        "gravity": [0, 0, -9.81],
        "materials": {"glass": {"density": 2500}, "wall": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1100, "kinematic_viscosity": 2e-5, "body_force": {"constant": [30, 0, 0]},
            "boundaries": [{"name": "surface", "face": "z_max", "condition": {"free_slip": {}}}]}},
        "grains": {"material": "glass", "initial": {"deposition": {
            "number": 300, "grading": {"by_count": [{"min": 1.425e-3, "max": 1.575e-3, "fraction": 1}]},
            "box": {"from": [0, 0, 0], "to": [0.04, 0.02, 0.024]}}}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1000}, "friction_angle_degrees": 25}},
        "box_walls": ["z_min"], "box_wall_material": "wall",
        "time": {"end": 0.1}
    });
    for (field, value) in more {
        case[field] = value.clone();
    }
    case
}

#[test]
fn grains_without_a_floor_are_named_with_the_face() {
    assert!(!warned(&plan(&flume(&[])), "where no wall stops them"));
    let bottomless = plan(&flume(&[("box_walls", json!([]))]));
    let warning = bottomless
        .warnings
        .iter()
        .find(|w| w.path == "box_walls")
        .unwrap();
    assert!(
        warning
            .reason
            .contains("gravity pulls the grains through the face z_min"),
        "{warning}"
    );
    let proposal = format!("{:?}", warning.remedy.proposal());
    assert!(
        proposal.contains("box_walls") && proposal.contains("z_min"),
        "{proposal}"
    );
}

/// Checks that links lose mass in the pores of a bed: 1.4e-7 of the mass per step in this flume, where partially
/// saturated cells lose nothing.
#[test]
fn spheres_that_fall_into_a_bed_are_partially_saturated_unless_the_case_says_otherwise() {
    let coupling = |case: &Value| plan(case).scene.coupling;
    let bed = coupling(&flume(&[]));
    assert!(
        matches!(bed, Some(Coupling::PartiallySaturated(_))),
        "{bed:?}"
    );
    let asked = coupling(&flume(&[("coupling", json!({"bounce_back": {}}))]));
    assert!(matches!(asked, Some(Coupling::BounceBack(_))), "{asked:?}");
    let few = json!({"material": "glass", "initial": {"list": [{"position": [0.02, 0.01, 0.012], "radius": 2e-3}]}});
    let alone = coupling(&flume(&[("grains", few)]));
    assert!(matches!(alone, Some(Coupling::BounceBack(_))), "{alone:?}");
}

/// Returns a channel of 0.2 m with an inflow by a table, on cells of 5 mm with a free time step.
fn channel_with_a_table() -> Value {
    json!({
        "domain": {"size": [0.2, 0.1], "spacing": 0.005},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-3, "boundaries": [
            {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [0.05, 0]},
                "history": [[0, 0], [1, 1], [2, 1], [2.5, -0.5]]}}},
            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
        "probes": [{"name": "q", "every": 0.2, "at": {"plane": {"axis": "x", "position": 0.1}}}],
        "time": {"end": 3}
    })
}

/// Checks that the discharge in the middle of a channel is that of the table at the inlet at all times, as in
/// incompressible water, with the time step that the program chooses; and that a stated step that is too long is
/// promised no small error.
#[test]
fn the_discharge_follows_the_table_of_an_inflow() {
    let _beside = beside_others();
    let case = channel_with_a_table();
    let study = Study::new(&case.to_string());
    study.run("run", 1, 1, &[]);
    let table = std::fs::read_to_string(study.path("run").join("probe_q.csv")).unwrap();
    let mut compared = 0;
    for line in table.lines().filter(|line| !line.starts_with('#')).skip(1) {
        let values: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let time = values[1];
        let factor = if time < 1.0 {
            time
        } else if time < 2.0 {
            1.0
        } else {
            (1.0 - 3.0 * (time - 2.0)).max(-0.5)
        };
        // The requested error of 5 % of the largest discharge.
        assert!((values[2] / 0.005 - factor).abs() < 0.05, "{time}: {line}");
        compared += 1;
    }
    assert!(compared > 12);
    let promised = |step: &str| {
        let set = [
            format!("fluid.lattice_boltzmann.time_step={step}"),
            "accuracy=\"normal\"".to_owned(),
        ];
        let document = Document::read(&case.to_string(), &set, Path::new("."));
        let plan = Plan::prepare(document.unwrap()).unwrap();
        plan.scene.chosen.promised.unwrap()
    };
    // 3 changes per second over 0.2 m at the speed of sound of the step.
    let lag = |step: f64| 3.0 * 0.2 * 3.0_f64.sqrt() * step / 0.005;
    assert!(promised("1e-3") > lag(1e-3) && promised("1e-3") < 0.05 + lag(1e-3));
    assert!(promised("1e-4") < 0.05);
}

/// Checks that bodies in front of an outlet neither part its pressure from the water in the corner behind them nor
/// disturb the stream when they roll along it: with a pressure held as a mean of all cells the density fell in the
/// corner until the runs failed.
#[test]
fn an_outlet_holds_its_pressure_behind_bodies() {
    let _beside = beside_others();
    let case = |motion: Value, position: [f64; 2]| {
        json!({
            "domain": {"size": [0.006, 0.0125], "spacing": 0.000125},
            "gravity": [0, 0],
            "materials": {"glass": {"density": 2500}, "wall": {}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 4e-5, "relaxation_time": 0.75,
                "boundaries": [
                    {"name": "inlet", "face": "x_min", "patch": {"from": [0, 0.005], "to": [0, 0.0125]},
                     "condition": {"velocity": {"profile": {"uniform": [0.4, 0]}, "ramp_time": 0.03}}},
                    {"name": "outlet", "face": "x_max", "patch": {"from": [0.006, 0.005], "to": [0.006, 0.0125]},
                     "condition": {"pressure": {"value": 0}}},
                    {"name": "surface", "face": "y_max", "condition": {"free_slip": {}}}]}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 40000}, "friction_angle_degrees": 20,
                                   "normal_damping_ratio": 0.5}},
            "box_walls": ["x_max"],
            "box_wall_material": "wall",
            "coupling": {"partially_saturated": {}},
            "bodies": [{"name": "grain", "shape": {"disc": {"radius": 0.0005}}, "position": position,
                        "motion": motion, "material": "glass"}],
            "time": {"end": 0.12},
            "output": {}
        })
    };
    let rolls = case(json!({"free": {}}), [0.0055, 0.0085]);
    let mut linked = rolls.clone();
    linked["coupling"] = json!({"bounce_back": {}});
    for (name, case) in [
        ("corner", case(json!({"fixed": {}}), [0.0055, 0.012])),
        ("rolls", rolls),
        ("linked", linked),
    ] {
        let study = Study::new(&case.to_string());
        study.run(name, 1, 1, &[]);
        let outflow = study.summary(name)["outflow"].as_f64().unwrap();
        // The inlet lets in 0.4 m/s over 7.5 mm.
        assert!((outflow / 3e-3 - 1.0).abs() < 1e-3, "{name}: {outflow}");
    }
}

/// Checks that a body which leaves through an outlet takes along what is inside it: at a face closed like a wall at
/// rest it piled up there, to 1.8 times the density.
#[test]
fn a_body_that_leaves_takes_its_inside_along() {
    let _beside = beside_others();
    // Cells that a body with links leaves or enters at a face change by whole cells.
    for (coupling, most) in [("partially_saturated", 0.02), ("bounce_back", 0.2)] {
        let case = json!({
            "domain": {"size": [0.006, 0.0125], "spacing": 0.000125},
            "materials": {"glass": {"density": 2500}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 4e-5, "relaxation_time": 0.75,
                "boundaries": [
                    {"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}}]}},
            "coupling": {coupling: {}},
            "bodies": [{"name": "grain", "shape": {"disc": {"radius": 0.0005}}, "position": [0.004, 0.006],
                        "motion": {"driven": {"velocity": [0.1, 0]}}, "material": "glass"}],
            "time": {"end": 0.03},
            "output": {}
        });
        let study = Study::new(&case.to_string());
        study.run("leaves", 1, 1, &[]);
        let summary = study.summary("leaves");
        let compression = summary["compression"].as_f64().unwrap();
        assert!(compression < most, "{coupling}: {compression}");
    }
}

/// Checks that bodies which part the water of an outlet, push it out and draw it in again, do not make its pressure run
/// away: neither with the state of the water at the outlet nor with its mean pressure. Two ranks give the same bits.
#[test]
fn outlets_hold_where_moving_bodies_part_their_water() {
    let _beside = beside_others();
    let case = |size: [f64; 2],
                tau: f64,
                boundaries: Value,
                body: (f64, [f64; 2], Value),
                end: f64| {
        json!({
            "domain": {"size": size, "spacing": 0.0005},
            "materials": {"glass": {"density": 1500}},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": tau, "boundaries": boundaries}},
            "bodies": [{"name": "disc", "shape": {"disc": {"radius": body.0}}, "position": body.1, "motion": body.2,
                        "material": "glass"}],
            "time": {"end": end},
            "output": {}
        })
    };
    let up = |condition: Value| json!([{"name": "out", "face": "y_max", "condition": condition}]);
    let drives = json!({"driven": {"velocity": [0.0174, 0.0214],
        "history": [[0, 0], [0.125, 1], [0.25, 1], [0.375, -1], [0.5625, -1], [0.625, 0]]}});
    let piston = (0.0051, [0.01224, 0.00943], drives);
    let outflow = case(
        [0.026, 0.017],
        0.55,
        up(json!({"outflow": {}})),
        piston,
        0.625,
    );
    let right = json!([{"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0, "held": "mean"}}}]);
    let leaves = (
        0.0048,
        [0.01159, 0.00548],
        json!({"free": {"velocity": [0.001, 0]}}),
    );
    let mut mean = case([0.016, 0.012], 0.8, right, leaves, 3.75);
    mean["coupling"] = json!({"bounce_back": {"scheme": "interpolated"}});
    for (name, case) in [("outflow", outflow), ("mean", mean)] {
        let study = Study::new(&case.to_string());
        study.run("one", 1, 1, &[]);
        study.run("two", 2, 1, &[]);
        study.same("one", "two");
        let compression = study.summary("one")["compression"].as_f64().unwrap();
        assert!(compression < 0.1, "{name}: {compression}");
    }
}

/// Cells between the walls of Couette flow.
const COUETTE_CELLS: u32 = 20;

/// Returns Couette flow through openings and the table of its inlet: the stream flows along the axis `along`, `across`
/// is the axis from the wall at rest to the one that slides. Wall and inlet have half of their final velocity at first.
fn couette_through_openings(
    dimension: usize,
    along: usize,
    across: usize,
    inlet: &Value,
) -> (Value, String) {
    let (names, velocities) = (["x", "y", "z"], ["u", "v", "w"]);
    let mut size = [1e-4; 3];
    (size[along], size[across]) = (1e-3, 1e-3);
    let mut slide = [0.0; 3];
    slide[along] = 0.002;
    let others = (0..dimension).filter(|a| *a != along && *a != across);
    let periodic: Vec<&str> = others.map(|a| names[a]).collect();
    let tangential: Vec<usize> = (0..dimension).filter(|a| *a != along).collect();
    let columns = tangential.iter().map(|a| names[*a]);
    let columns: Vec<&str> = columns
        .chain(velocities[..dimension].iter().copied())
        .collect();
    // In three dimensions the nearest row counts: links cross the face at centres, sides and corners of cells.
    let mut rows = vec![columns.join(",")];
    for n in 0..=2 * COUETTE_CELLS {
        let part = f64::from(n) / f64::from(2 * COUETTE_CELLS);
        let place = tangential
            .iter()
            .map(|a| if *a == across { 1e-3 * part } else { 0.0 });
        let speed = (0..dimension).map(|a| slide[a] * part);
        let row: Vec<String> = place.chain(speed).map(|x| x.to_string()).collect();
        rows.push(row.join(","));
    }
    let history = json!([[0, 0.5], [0.2, 1]]);
    let wall = json!({"moving_wall": {"velocity": slide[..dimension], "history": history}});
    let mut inlet = inlet.clone();
    if let Some(velocity) = inlet.get_mut("velocity") {
        velocity["history"] = history;
    }
    let end = |axis: usize, end: &str| format!("{}_{end}", names[axis]);
    let faces = [
        end(along, "min"),
        end(along, "max"),
        end(across, "min"),
        end(across, "max"),
    ];
    let probe = |face: &String| json!({"name": face, "every": 1, "at": {"wall": {"face": face}}});
    let case = json!({
        "domain": {"size": size[..dimension], "spacing": 5e-5, "periodic": periodic},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.8,
            "boundaries": [
                {"name": "in", "face": faces[0], "condition": inlet},
                {"name": "out", "face": faces[1], "condition": {"pressure": {"value": 0, "held": "each_cell"}}},
                {"name": "wall", "face": faces[3], "condition": wall}]}},
        "time": {"end": 2},
        "probes": faces.iter().map(probe).collect::<Vec<_>>(),
        "output": {}
    });
    (case, rows.join("\n"))
}

/// Checks Couette flow through openings against its exact solution: the flow through each opening, U H/2, and the force
/// on each wall, μ U/H times its length, on any axes and for imposed velocities and pressures. Two ranks give the same
/// bits.
#[test]
fn couette_flow_through_openings_has_its_flow_and_its_drag() {
    let _beside = beside_others();
    let table = json!({"velocity": {"profile": {"file": {"path": "linear.csv"}}}});
    let pressure = json!({"pressure": {"value": 0}});
    for (dimension, along, across, inlet) in [
        (2, 0, 1, &table),
        (2, 1, 0, &table),
        (2, 0, 1, &pressure),
        (3, 0, 2, &table),
    ] {
        let (case, rows) = couette_through_openings(dimension, along, across, inlet);
        let study = Study::new(&case.to_string());
        std::fs::write(study.path("linear.csv"), rows).unwrap();
        study.run("one", 1, 1, &[]);
        study.run("two", 2, 1, &[]);
        study.same("one", "two");
        let last = |axis: usize, end: &str, column: &str| -> f64 {
            let name = format!("probe_{}_{end}.csv", ["x", "y", "z"][axis]);
            let text = std::fs::read_to_string(study.path("one").join(name)).unwrap();
            let mut lines = text.lines().filter(|line| !line.starts_with('#'));
            let heading = |name: &str| name.split(' ').next() == Some(column);
            let at = lines.next().unwrap().split(',').position(heading).unwrap();
            lines
                .next_back()
                .unwrap()
                .split(',')
                .nth(at)
                .unwrap()
                .parse()
                .unwrap()
        };
        let depth = if dimension == 2 { 1.0 } else { 1e-4 };
        let flow = 1000.0 * 0.5 * 0.002 * 1e-3 * depth;
        let drag = 1e-3 * 0.002 / 1e-3 * 1e-3 * depth;
        let force = format!("force_{}", ["x", "y", "z"][along]);
        let found = [
            -last(along, "min", "mass_flux") / flow,
            last(along, "max", "mass_flux") / flow,
            -last(across, "max", &force) / drag,
            last(across, "min", &force) / drag,
        ];
        println!(
            "{dimension}-D along {along}, {inlet}: flow in, out, drag of both walls {found:?}"
        );
        let walls = ["min", "max"].map(|end| last(across, end, "mass_flux"));
        // Of the second order in the velocity of the lattice, 0.01.
        assert!(found.iter().all(|x| (x - 1.0).abs() < 1e-3), "{found:?}");
        assert!(walls.iter().all(|x| x.abs() < 1e-12 * flow), "{walls:?}");
    }
}
