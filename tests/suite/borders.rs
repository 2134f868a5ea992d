//! Runs on both sides of the limits of the maps under `benches/stability`: verdicts of the plan compared with the
//! outcomes.

use crate::ranks::Cores;
use serde_json::{Map, Value};
use std::path::Path;
use std::process::Command;

/// Runs a few members of a map, selected by their varied values: no member accepted by the plan fails, no refused
/// one is stable, and both kinds occur.
fn agrees(name: &str, chosen: &[(&str, &[&str])]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/stability");
    let text = std::fs::read_to_string(root.join(name).join("study.json")).unwrap();
    let mut study: Value = serde_json::from_str(&text).unwrap();
    for (varied, labels) in chosen {
        let all = study["vary"][varied].as_object().unwrap();
        let some = labels
            .iter()
            .map(|label| ((*label).to_owned(), all[*label].clone()));
        let some: Map<String, Value> = some.collect();
        study["vary"][varied] = some.into();
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("study.json");
    std::fs::write(&file, study.to_string()).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
    command
        .arg("sweep")
        .arg(&file)
        .arg("--output")
        .arg(folder.path().join("runs"));
    for variable in ["OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"] {
        command.env_remove(variable);
    }
    let _core = Cores::acquire(1);
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let map = std::fs::read_to_string(folder.path().join("runs/map.csv")).unwrap();
    let (mut held, mut failed) = (0, 0);
    for line in map.lines().skip(1) {
        let words: Vec<&str> = line.rsplit(',').collect();
        let (outcome, verdict) = (words[0], words[1]);
        match (verdict, outcome == "finished") {
            ("valid" | "valid with warnings", true) => held += 1,
            ("refused", false) => failed += 1,
            ("unstable", _) => {}
            _ => panic!("{name}: {line}"),
        }
    }
    assert!(held > 0 && failed > 0, "{name}: {map}");
}

#[test]
fn contacts_fail_where_the_plan_refuses_them() {
    let steps: (&str, &[&str]) = ("step", &["0.2", "0.25", "0.3", "0.5"]);
    agrees("contacts-linear-spheres", &[steps, ("damping", &["0"])]);
    agrees(
        "contacts-linear-discs",
        &[("step", &["0.15", "0.5"]), ("damping", &["0.2"])],
    );
    agrees(
        "contacts-hertz-spheres",
        &[("step", &["0.1", "0.5"]), ("restitution", &["0.7"])],
    );
    agrees(
        "contacts-blocks",
        &[("step", &["0.2", "0.5"]), ("damping", &["0"])],
    );
}

#[test]
fn light_free_bodies_fail_where_the_plan_refuses_them() {
    let ratios: (&str, &[&str]) = ("density_ratio", &["0.1", "0.2", "0.3", "1.01"]);
    agrees(
        "free-disc",
        &[
            ("coupling", &["links", "saturated"]),
            ratios,
            ("solid_steps", &["1"]),
        ],
    );
    agrees(
        "free-block",
        &[("coupling", &["bounced"]), ratios, ("solid_steps", &["1"])],
    );
}

#[test]
fn explicit_drag_fails_where_the_plan_refuses_it() {
    let choices: &[(&str, &[&str])] = &[
        ("drag", &["explicit", "semi-implicit"]),
        ("porosity", &["0.6"]),
        ("drag_time", &["0.1", "0.45", "0.55"]),
    ];
    agrees("explicit-drag", choices);
}
