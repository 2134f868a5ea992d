//! Surface tension: the same bits on any ranks, threads and slabs and across restarts, mass, and messages.

use super::ranks::{Study, beside_others};

const LATTICE: &str = "fluid.lattice_boltzmann";

/// Returns a column of water that collapses between walls with a contact angle, with a drop above it.
fn study(set: &[(&str, &str)]) -> Study {
    let mut all = vec![
        ("domain", r#"{"size": [0.02, 0.012], "spacing": 0.0005}"#),
        ("fluid.lattice_boltzmann.kinematic_viscosity", "2e-5"),
        ("fluid.lattice_boltzmann.time_step", "5e-5"),
        (
            "fluid.lattice_boltzmann.surface",
            r#"{"surface_tension": 0.0728, "contact_angle_degrees": 40,
                "water": [{"shape": {"box": {"from": [0, 0], "to": [0.0061, 0.0052]}}},
                    {"shape": {"disc": {"centre": [0.0127, 0.0083], "radius": 0.0021}}}]}"#,
        ),
        ("fluid.lattice_boltzmann.boundaries", "[]"),
        ("probes", "[]"),
        ("time.end", "0.03"),
    ];
    all.extend(set);
    Study::from_example("dam-break", &all)
}

#[test]
fn tension_on_any_ranks_threads_and_slabs_and_over_restarts() {
    let _beside = beside_others();
    let study = study(&[("checkpoint.every", "0.01")]);
    study.run("straight", 1, 1, &[]);
    study.same_on(&[
        ("threads", 1, 2, "domain.split=y"),
        ("two", 2, 2, "domain.split=x"),
        ("three", 3, 1, "domain.split=y"),
        // Slabs thinner than a column of fill levels.
        ("narrow", 4, 1, "domain.slab_bounds=[1, 2, 20]"),
        ("thin", 4, 1, "domain.slab_bounds=[10, 11, 13]"),
    ]);
    study.run("parts", 2, 1, &["time.end=0.0117"]);
    study.restart("parts", 3, &["time.end=0.03"]).expect(0);
    study.same("straight", "parts");
    let water = &study.summary("straight")["water"];
    assert!(
        water["mass_error"].as_f64().unwrap().abs() < 1e-12,
        "{water}"
    );
    let without = format!(
        r#"{LATTICE}.surface={{"water": [{{"shape": {{"box": {{"from": [0, 0], "to": [0.0061, 0.0052]}}}}}},
            {{"shape": {{"disc": {{"centre": [0.0127, 0.0083], "radius": 0.0021}}}}}}]}}"#
    );
    study.run("without", 1, 1, &[&without]);
    assert_ne!(study.hash("straight"), study.hash("without"));
}

#[test]
fn tension_in_three_dimensions_on_any_ranks() {
    let _beside = beside_others();
    let study = study(&[
        (
            "domain",
            r#"{"size": [0.01, 0.008, 0.006], "spacing": 0.0005, "periodic": ["z"]}"#,
        ),
        ("gravity", "[0, -9.81, 0]"),
        (
            "fluid.lattice_boltzmann.surface",
            r#"{"surface_tension": 0.0728, "contact_angle_degrees": 130,
                "water": [{"shape": {"box": {"from": [0, 0, 0], "to": [0.0041, 0.0042, 0.006]}}},
                    {"shape": {"sphere": {"centre": [0.0067, 0.0053, 0.0002], "radius": 0.0016}}}]}"#,
        ),
        ("time.end", "0.01"),
    ]);
    study.run("straight", 1, 2, &[]);
    for (name, ranks, set) in [("x", 2, "x"), ("y", 3, "y"), ("z", 4, "z")] {
        study.run(name, ranks, 1, &[&format!("domain.split={set}")]);
        assert_eq!(study.hash("straight"), study.hash(name), "{name}");
    }
    study.run("parts", 2, 1, &["time.end=0.0043"]);
    study.restart("parts", 3, &["time.end=0.01"]).expect(0);
    assert_eq!(study.hash("straight"), study.hash("parts"));
}

#[test]
fn tension_is_refused_or_warned_of_by_name() {
    let study = study(&[]);
    for (set, path, text) in [
        (
            format!("{LATTICE}.time_step=3e-4"),
            format!("{LATTICE}.time_step"),
            "needs a time step of at most",
        ),
        (
            format!(r#"{LATTICE}.surface={{"contact_angle_degrees": 40, "water": [{{"level": 0.004}}]}}"#),
            format!("{LATTICE}.surface.contact_angle_degrees"),
            "without surface tension",
        ),
        (
            format!("{LATTICE}.surface.contact_angle_degrees=5"),
            format!("{LATTICE}.surface.contact_angle_degrees"),
            "15",
        ),
        (
            r#"structures=[{"name": "weir", "shape": {"box": {"from": [0.01, 0], "to": [0.011, 0.003]}}}]"#.to_owned(),
            format!("{LATTICE}.surface.surface_tension"),
            "is not verified with structures",
        ),
    ] {
        let done = crate::ranks::run(1, &study.arguments("refused", 1, &[&set])).expect(3);
        let found = done.stdout + &done.stderr;
        assert!(found.contains(&path) && found.contains(text), "{set}: {found}");
    }
}
