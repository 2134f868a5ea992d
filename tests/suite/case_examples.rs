//! Every example case is valid without a warning. `tests/schema.py` checks that the schema accepts it too.

use serde_json::Value;
use solver::case::examples::EXAMPLES;
use solver::case::{Document, schema};
use solver::plan::Plan;
use std::path::Path;

#[test]
fn every_example_is_valid_without_a_warning() {
    for example in EXAMPLES {
        let document = Document::read(example.text, &[], Path::new(""))
            .unwrap_or_else(|p| panic!("{}: {p:#?}", example.name));
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{}: {p:#?}", example.name));
        assert_eq!(plan.warnings, [], "{}", example.name);
        // One minute on a machine twice as fast as that of the measured rates.
        let seconds = plan.estimate.seconds_on_one_core;
        assert!(seconds < 60.0, "{}: {seconds} s", example.name);
        assert!(
            // A value may be at its limit, within rounding.
            plan.margins.iter().all(|m| m.used <= 1.0 + 1e-12),
            "{}",
            example.name
        );
    }
}

/// Sets numbers of a case that decide on its limits to others, one at a time, and returns the assignments.
fn spoilt(tree: &Value, path: &str, sets: &mut Vec<String>) {
    const DECIDE: [&str; 7] = [
        "relaxation_time",
        "time_step",
        "kinematic_viscosity",
        "density",
        "absolute",
        "coupling_interval",
        "gravity",
    ];
    let below = |key: &str| {
        if path.is_empty() {
            key.to_owned()
        } else {
            format!("{path}.{key}")
        }
    };
    match tree {
        Value::Object(map) => {
            for (key, child) in map {
                let path = below(key);
                let numbers = match child {
                    Value::Number(_) => vec![child],
                    Value::Array(list) if list.iter().all(Value::is_number) => {
                        list.iter().collect()
                    }
                    _ => Vec::new(),
                };
                if DECIDE.contains(&key.as_str()) && !numbers.is_empty() {
                    for factor in [0.3, 3.0, 30.0] {
                        let scaled = numbers.iter().filter_map(|n| n.as_f64());
                        let scaled: Vec<f64> = scaled.map(|n| n * factor).collect();
                        let text = match child {
                            Value::Number(_) => format!("{:?}", scaled[0]),
                            _ => format!("{scaled:?}"),
                        };
                        sets.push(format!("{path}={text}"));
                    }
                }
                spoilt(child, &path, sets);
            }
        }
        Value::Array(list) => {
            for (n, child) in list.iter().enumerate() {
                spoilt(child, &format!("{path}[{n}]"), sets);
            }
        }
        _ => {}
    }
}

/// Checks that no line of the margins exceeds its limit without a finding at its field, in examples with other values.
#[test]
fn every_exceeded_margin_has_a_finding() {
    let mut exceeded = 0;
    for example in EXAMPLES {
        let tree: Value = serde_json::from_str(example.text).unwrap();
        let mut sets = Vec::new();
        spoilt(&tree, "", &mut sets);
        for set in sets {
            let document = Document::read(example.text, std::slice::from_ref(&set), Path::new(""));
            let Some(plan) = document.ok().and_then(|one| Plan::prepare(one).ok()) else {
                continue;
            };
            for margin in plan
                .margins
                .iter()
                .filter(|margin| margin.used > 1.0 + 1e-5)
            {
                exceeded += 1;
                let near =
                    |path: &str| path.starts_with(&margin.path) || margin.path.starts_with(path);
                assert!(
                    plan.warnings.iter().any(|found| near(&found.path)),
                    "{} with {set}: {margin:?} {:#?}",
                    example.name,
                    plan.warnings
                );
            }
        }
    }
    assert!(exceeded > 20, "{exceeded}");
}

#[test]
fn every_field_of_the_schema_is_documented() {
    fn walk(node: &Value, path: &str, missing: &mut Vec<String>) {
        if let Value::Object(map) = node {
            for (key, child) in map {
                let path = format!("{path}/{key}");
                if key == "properties"
                    && let Value::Object(properties) = child
                {
                    for (name, property) in properties {
                        // Within an annotation the outer property is documented.
                        let inner = matches!(name.as_str(), "value" | "note" | "source");
                        if property.get("description").is_none() && !inner {
                            missing.push(format!("{path}/{name}"));
                        }
                    }
                }
                walk(child, &path, missing);
            }
        } else if let Value::Array(list) = node {
            for (n, child) in list.iter().enumerate() {
                walk(child, &format!("{path}/{n}"), missing);
            }
        }
    }
    let mut missing = Vec::new();
    walk(&schema(), "", &mut missing);
    walk(&solver::sweep::study::schema(), "study", &mut missing);
    // A choice that wraps a struct is documented on the choice itself.
    missing.retain(|path| !path.contains("/oneOf/"));
    assert_eq!(missing, Vec::<String>::new());
}

#[test]
fn the_piping_example_has_the_numbers_of_the_paper() {
    let text = solver::case::examples::find("piping").expect("piping").text;
    let document = Document::read(text, &[], Path::new("")).expect("a case");
    assert_eq!(document.sources["gravity"].source, "assumed");
    assert_eq!(
        document.sources["fluid.lattice_boltzmann.relaxation_time"].source,
        "paper"
    );
    let plan = Plan::prepare(document).expect("a plan");
    let units = plan.units.expect("a lattice");
    // nu_lb = 0.2 and C = 5 nu/h.
    approx::assert_relative_eq!(units.viscosity_to_lattice(1e-6), 0.2, max_relative = 1e-12);
    approx::assert_relative_eq!(
        units.velocity_scale(),
        5.0 * 1e-6 / 2.5e-5,
        max_relative = 1e-12
    );
    assert_eq!(plan.scene.grid.cells, [336, 160, 1]);
    // Critical time step 2 sqrt(m/k) of the smallest disc at the largest one: m = 2650 pi r², k = 150e6 (r + R).
    let (radius, largest) = (0.75e-4_f64, 1.25e-4);
    let mass = 2650.0 * std::f64::consts::PI * radius * radius;
    let critical = 2.0 * (mass / (150e6 * (radius + largest))).sqrt();
    approx::assert_relative_eq!(
        plan.clock.critical_solid_time_step.expect("contacts"),
        critical,
        max_relative = 1e-12
    );
    assert_eq!(plan.clock.solid_steps_per_step, 6);
    assert_eq!(plan.clock.steps, 96_000);
    // k_n and C scale with the mean diameter of the pair.
    let law = plan.scene.contact.as_ref().expect("contacts").model();
    approx::assert_relative_eq!(
        law.cohesion([0, 0]).for_diameter(2e-4) / law.normal_stiffness([0, 0], 2e-4),
        0.506 / 150e6
    );
}

#[test]
fn a_saved_sample_sets_the_solid_steps_like_a_list() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = solver::case::examples::find("piping").expect("piping").text;
    let plan = |sample: &str| {
        std::fs::write(folder.path().join("s.csv"), sample).expect("a file");
        let set = [r#"grains.initial={"file": {"path": "s.csv"}}"#.to_string()];
        let document = Document::read(text, &set, folder.path()).expect("a case");
        Plan::prepare(document)
    };
    let good = plan("x,y,radius\n0.002,0.002,0.75e-4\n0.003,0.002,1.25e-4\n").expect("a plan");
    assert_eq!(good.clock.solid_steps_per_step, 6);
    assert_eq!(good.scene.grains.expect("grains").expected, 2);
    for bad in [
        "x,y,radius\n1,0.002,1e-4\n",
        "x,y\n0,0\n",
        "x,y,radius\n0.002,0.002,1e-5\n",
    ] {
        let problems = plan(bad).expect_err(bad);
        assert!(
            problems
                .iter()
                .any(|p| p.path.starts_with("grains.initial")),
            "{problems:?}"
        );
    }
}
