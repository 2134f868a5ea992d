//! Scenes in SI units only: each plans, runs to its end, and agrees with its reference within the bounds of its
//! level of accuracy.
//!
//! The scenes and their references are under `jobs/automatic`.

use super::verification::{short_forms, suite};
use crate::ranks::{Cores, Study, beside_others};
use serde_json::json;
use solver::case::Document;
use solver::plan::Plan;
use solver::scene::auto::Subject;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/automatic")
}

fn plan(folder: &Path, set: &[&str]) -> Plan {
    let text = std::fs::read_to_string(folder.join("case.json")).unwrap();
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    let name = folder.display();
    let document = Document::read(&text, &set, folder).unwrap_or_else(|p| panic!("{name}: {p:#?}"));
    Plan::prepare(document).unwrap_or_else(|p| panic!("{name}: {p:#?}"))
}

#[test]
fn scenes_without_numerics_run_and_keep_their_promise_first_half() {
    let (cases, _) = short_forms(&root(), 0, 2);
    assert!(cases >= 11);
}

#[test]
fn scenes_without_numerics_run_and_keep_their_promise_second_half() {
    let (cases, _) = short_forms(&root(), 1, 2);
    assert!(cases >= 11);
}

#[test]
fn every_choice_has_a_reason_and_keeps_all_limits() {
    let _core = Cores::acquire(1);
    for folder in suite::cases(&root()).unwrap() {
        let text = std::fs::read_to_string(folder.join("case.json")).unwrap();
        for word in [
            "spacing",
            "relaxation_time",
            "lattice_velocity",
            "collision",
            "coupling",
        ] {
            assert!(!text.contains(word), "{} states {word}", folder.display());
        }
        let plan = plan(&folder, &[]);
        let choices = if text.contains("darcy") {
            [
                Subject::Spacing,
                Subject::Accuracy,
                Subject::ContactLaw,
                Subject::CouplingInterval,
            ]
        } else {
            [
                Subject::Spacing,
                Subject::TimeStep,
                Subject::Collision,
                Subject::Turbulence,
            ]
        };
        for what in choices {
            let why = plan.scene.chosen.reason_of(what);
            assert!(why.is_some(), "{}: {what:?}", folder.display());
        }
        for margin in &plan.margins {
            assert!(
                margin.used <= 1.0 + 1e-9,
                "{}: {margin:?}",
                folder.display()
            );
        }
    }
}

#[test]
fn examples_without_their_numerics_still_plan() {
    let lattice = "fluid.lattice_boltzmann";
    for name in [
        "piping",
        "cylinder",
        "settling-disc",
        "cavity",
        "collision",
        "seepage",
        "deposition",
    ] {
        let text = solver::case::examples::find(name).unwrap().text;
        let mut set = vec!["domain.spacing=null".to_owned()];
        if text.contains("lattice_boltzmann") {
            for field in [
                "relaxation_time",
                "time_step",
                "reference_velocity",
                "lattice_velocity",
            ] {
                set.push(format!("{lattice}.{field}=null"));
            }
        }
        let document = Document::read(text, &set, Path::new("")).unwrap();
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{name}: {p:#?}"));
        assert!(
            plan.scene.chosen.reason_of(Subject::Spacing).is_some(),
            "{name}"
        );
    }
    // The hole-erosion test of the paper has cells of 20 micrometres: eight per small grain.
    let text = solver::case::examples::find("piping").unwrap().text;
    let set = ["domain.spacing=null", "coupling=null"].map(String::from);
    let plan = Plan::prepare(Document::read(text, &set, Path::new("")).unwrap()).unwrap();
    assert!((1e-5..=2e-5).contains(&plan.scene.grid.spacing));
}

/// Runs the hole-erosion test of Sibille, Lomine and Marot (2012) with its five physical parameters (viscosity, two
/// stiffnesses, cohesion, friction), geometry, grading, densities and pressure: no other input is needed.
#[test]
fn the_hole_erosion_test_needs_five_physical_parameters() {
    let text = r#"{
      "domain": {"size": [0.0084, 0.004]},
      "materials": {"soil": {"density": 2650}},
      "fluid": {"lattice_boltzmann": {
        "density": 1000, "kinematic_viscosity": 1e-6,
        "boundaries": [
          {"name": "inlet", "face": "x_min", "condition": {"pressure": {"value": 0.2}}},
          {"name": "outlet", "face": "x_max", "condition": {"pressure": {"value": 0}}}
        ]
      }},
      "grains": {
        "material": "soil",
        "initial": {"growth": {"amount": {"solid_fraction": 0.84}, "radii": {"uniform": {"min": 7.5e-5,
        "max": 1.25e-4}}, "seed": 1}},
        "cut": [
          {"name": "inlet chamber", "box": {"from": [0, 0], "to": [0.0012, 0.004]}},
          {"name": "outlet chamber", "box": {"from": [0.0072, 0], "to": [0.0084, 0.004]}},
          {"name": "hole", "box": {"from": [0.0012, 0.0016], "to": [0.0072, 0.0024]}}
        ],
        "bond_at_start": true
      },
      "contact": {"cohesive_frictional": {
        "normal_stiffness": {"per_diameter": 1.5e8}, "shear_to_normal_stiffness": 0.4, "friction_angle_degrees": 20,
        "cohesion": {"per_diameter": 0.506}
      }},
      "box_walls": ["x_min", "y_min", "y_max"],
      "time": {"end": 6},
      "regions": [{"name": "outlet", "box": {"from": [0.0083, 0], "to": [0.0084, 0.004]},
      "action": {"remove": {"when": "touches"}}}],
      "analysis": {"erosion_law": {
        "hole": {"from": [0.0012, 0.0016], "to": [0.0072, 0.0024]}, "flow_axis": "x", "every": 0.02, "outlet": "outlet"
      }}
    }"#;
    let plan = Plan::prepare(Document::read(text, &[], Path::new("")).unwrap()).unwrap();
    let scene = &plan.scene;
    assert!(scene.coupling.is_some() && scene.grains.is_some());
    assert!(plan.margins.iter().all(|margin| margin.used < 1.0 + 1e-9));
}

/// Checks that a law that states friction and damping, but no stiffness, has the stiffness of a case without a law.
#[test]
fn a_linear_law_needs_no_stiffness() {
    let case = |contact: &str| {
        let text = format!(
            r#"{{
              "domain": {{"size": [0.02, 0.02, 0.04], "spacing": 0.002}},
              "gravity": [0, 0, -9.81],
              "materials": {{"glass": {{"density": 2500}}}},
              "grains": {{"material": "glass", "initial": {{"list": [
                {{"position": [0.01, 0.01, 0.003], "radius": 0.001}}, {{"position": [0.01, 0.01, 0.006],
                "radius": 0.002}}
              ]}}}},
              {contact}
              "box_walls": ["z_min"],
              "time": {{"end": 0.01}}
            }}"#
        );
        Plan::prepare(Document::read(&text, &[], Path::new("")).unwrap()).unwrap()
    };
    let stiffness = |plan: &Plan, diameter: f64| {
        let table = plan.scene.contact.as_ref().unwrap();
        table.model().normal_stiffness([0, 0], diameter)
    };
    let (none, open) = (
        case(""),
        case(r#""contact": {"linear": {"friction_angle_degrees": 20}},"#),
    );
    assert!(stiffness(&none, 0.002) > 1.0);
    assert!((stiffness(&open, 0.002) / stiffness(&none, 0.002) - 1.0).abs() < 1e-12);
    assert!((stiffness(&open, 0.004) / stiffness(&none, 0.004) - 1.0).abs() < 1e-12);
    // The friction is the one that was written, and nothing is assumed about it.
    let assumed =
        |plan: &Plan| format!("{:?}", plan.warnings).contains("the case has no contact law");
    assert!(assumed(&none) && !assumed(&open));
    assert!(open.scene.chosen.reason_of(Subject::ContactLaw).is_some());
    let stated = case(r#""contact": {"linear": {"normal_stiffness": {"absolute": 12345}}},"#);
    assert!((stiffness(&stated, 0.002) - 12345.0).abs() < 1e-9);
    assert!(stated.scene.chosen.reason_of(Subject::ContactLaw).is_none());
    // A missing friction is reported once; a stated friction is not reported, even if it is zero.
    let silent = |law: &str| {
        let plan = case(&format!(r#""contact": {{{law}}},"#));
        let said = plan.warnings.iter();
        said.filter(|w| w.reason.contains("has no friction angle"))
            .count()
    };
    assert_eq!(silent(r#""linear": {}"#), 1);
    assert_eq!(silent(r#""linear": {"friction_angle_degrees": 0}"#), 0);
    let laws = [
        (
            "cohesive_frictional",
            r#""normal_stiffness": {"absolute": 1e5}, "#,
        ),
        (
            "contact_bond",
            r#""normal_stiffness": {"absolute": 1e5}, "tensile_strength": 1, "shear_strength": 1, "#,
        ),
    ];
    for (law, needed) in laws {
        let with = |angle: &str| {
            silent(&format!(
                r#""{law}": {{{needed}"shear_to_normal_stiffness": 0.4{angle}}}"#
            ))
        };
        assert_eq!(with(""), 1, "{law}");
        assert_eq!(with(r#", "friction_angle_degrees": 20"#), 0, "{law}");
    }
}

#[test]
fn a_flow_too_fast_for_two_dimensions_is_refused_with_the_spacing_that_would_do() {
    let folder = root().join("flume");
    let text = std::fs::read_to_string(folder.join("case.json")).unwrap();
    let attempt = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        Plan::prepare(Document::read(&text, &set, &folder).unwrap())
    };
    let thin = "fluid.lattice_boltzmann.kinematic_viscosity=2e-5";
    let problems = attempt(&[thin]).unwrap_err();
    let found = problems
        .iter()
        .find(|p| p.path.ends_with("kinematic_viscosity"));
    assert!(
        found.unwrap().remedy.contains("7.000e-4 m"),
        "{problems:#?}"
    );
    // The number of cells is whole, and the cells are fine enough.
    assert!(attempt(&[thin, "domain.spacing=0.0005"]).is_ok());
}

#[test]
fn what_is_stated_is_taken() {
    let folder = root().join("cylinder-20");
    let stated = plan(
        &folder,
        &[
            "domain.spacing=0.01",
            "fluid.lattice_boltzmann.relaxation_time=0.6",
            "fluid.lattice_boltzmann.turbulence=none",
            "fluid.lattice_boltzmann.collision={\"bgk\": {}}",
            "coupling={\"bounce_back\": {}}",
        ],
    );
    let flow = stated.scene.flow.as_ref().unwrap();
    assert_eq!(stated.scene.grid.cells, [220, 41, 1]);
    approx::assert_relative_eq!(flow.relaxation_time, 0.6);
    assert!(flow.models.turbulence.is_none());
    assert!(matches!(
        flow.models.collision,
        solver::case::fluid::Collision::Bgk(_)
    ));
    for what in [
        Subject::Spacing,
        Subject::TimeStep,
        Subject::Collision,
        Subject::Turbulence,
        Subject::Coupling,
    ] {
        assert_eq!(stated.scene.chosen.reason_of(what), None, "{what:?}");
    }
}

#[test]
fn a_stricter_level_has_finer_cells_and_a_smaller_lattice_velocity() {
    let folder = root().join("spheres-dilute");
    let mut last = (0, f64::INFINITY);
    for level in [
        "\"draft\"",
        "\"normal\"",
        "\"reference\"",
        "{\"drag_error\": 0.01}",
    ] {
        let plan = plan(&folder, &[&format!("accuracy={level}")]);
        let flow = plan
            .scene
            .chosen
            .limits
            .iter()
            .find(|l| l.what.starts_with("a lattice velocity"));
        let step = flow.unwrap().time_step / plan.scene.grid.spacing;
        let cells = plan.scene.grid.cell_count();
        assert!(cells >= last.0 && step <= last.1, "{level}: {cells} cells");
        last = (cells, step);
    }
}

/// Channel of water whose edges have no common divisor close to the required cells.
const UNEVEN: &str = r#"{
    "domain": {"size": [0.12, 0.0101]},
    "fluid": {"lattice_boltzmann": {
        "density": 1000, "kinematic_viscosity": 1e-6,
        "boundaries": [
            {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [0.005, 0]},
            "ramp_time": 0.5}}},
            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
        ]
    }},
    "time": {"end": 1}
}"#;

#[test]
fn edges_without_a_common_divisor_grow_to_whole_cells_with_a_warning() {
    let read = |set: &[String]| {
        let document = Document::read(UNEVEN, set, Path::new(".")).unwrap();
        Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"))
    };
    let told = |plan: &Plan| {
        let sizes = plan.warnings.iter();
        let sizes = sizes.filter(|p| p.path.starts_with("domain.size"));
        sizes.cloned().collect::<Vec<_>>()
    };
    let plan = read(&[]);
    let grid = &plan.scene.grid;
    // The width between the walls is as stated; the length of the channel increases by less than one cell.
    assert!((grid.size[1] - 0.0101).abs() < 1e-15, "{grid:?}");
    let longer = grid.size[0] - 0.12;
    assert!(longer > 0.0 && longer < grid.spacing, "{grid:?}");
    for axis in 0..2 {
        let cells = grid.size[axis] / grid.spacing;
        assert!((cells - cells.round()).abs() < 1e-6, "{grid:?}");
    }
    let warned = told(&plan);
    assert_eq!(warned.len(), 1, "{warned:#?}");
    assert_eq!(
        (warned[0].path.as_str(), warned[0].value.as_str()),
        ("domain.size[0]", "0.12")
    );
    assert!(
        warned[0].reason.contains("more than the case states"),
        "{}",
        warned[0]
    );
    // After the proposal is accepted, the warning is absent.
    let set: Vec<String> = (warned[0].remedy.proposal().iter())
        .map(|change| format!("{}={}", change.path, change.value))
        .collect();
    let agreed = read(&set);
    assert_eq!(told(&agreed), []);
    assert!((agreed.scene.grid.size[0] - grid.size[0]).abs() < 1e-12);
}

/// Checks that a disc at a quarter of the box is at a position of symmetry if the number of cells along an edge is
/// even.
#[test]
fn automatic_cells_put_no_disc_at_a_position_of_symmetry() {
    for radius in ["0.002", "0.0021", "0.0022", "0.0024", "0.0025", "0.003"] {
        let case = format!(
            r#"{{
              "domain": {{"size": [0.04, 0.04], "periodic": ["x", "y"]}},
              "gravity": [0, 0],
              "materials": {{"steel": {{"density": 7800}}}},
              "fluid": {{"lattice_boltzmann": {{"density": 1000, "kinematic_viscosity": 1e-4,
              "body_force": {{"constant": [1e-4, 0]}}}}}},
              "bodies": [{{"name": "rod", "shape": {{"disc": {{"radius": {radius}}}}}, "position": [0.01, 0.03],
                          "motion": {{"fixed": {{}}}}, "material": "steel"}}],
              "time": {{"end": 1}}
            }}"#
        );
        let document =
            Document::read(&case, &[], Path::new(".")).unwrap_or_else(|p| panic!("{p:#?}"));
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        let cells = plan.scene.grid.size[0] / plan.scene.grid.spacing;
        assert!(
            (cells.rem_euclid(2.0) - 1.0).abs() < 1e-6,
            "{radius}: {cells}"
        );
    }
}

/// Checks that boxes of discs with the friction that the program assumes are packed, whatever the seed: near walls and
/// with friction fewer than three contacts per grain may carry them.
#[test]
fn a_box_of_discs_is_packed_with_the_friction_that_is_assumed() {
    let _beside = beside_others();
    let study = Study::new(
        &json!({
            "domain": {"size": [0.04, 0.04], "spacing": 0.01},
            "gravity": [0, -9.81],
            "materials": {"sand": {"density": 2650}},
            "grains": {"material": "sand", "initial": {"growth": {"amount": {"solid_fraction": 0.82},
                "radii": {"uniform": {"min": 0.002, "max": 0.004}}, "seed": 2}}},
            "box_walls": ["x_min", "x_max", "y_min", "y_max"],
            "time": {"end": 1e-4}
        })
        .to_string(),
    );
    let done = study.run("run", 1, 1, &[]);
    assert!(done.stdout.contains("contacts"), "{}", done.stdout);
    for seed in ["1", "3", "4"] {
        let set = format!("grains.initial.growth.seed={seed}");
        study.run(seed, 1, 1, &[&set]);
    }
}
