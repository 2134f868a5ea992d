//! Walls that are inserted and removed at a time: the same bits on any number of ranks and after restarts before
//! and after that time, and messages in the log.

use crate::ranks::{Study, beside_others};

/// Returns clay on a floor that is removed, above a shelf that is inserted during its fall and removed again.
fn study() -> Study {
    Study::from_example(
        "deposition",
        &[
            ("walls[2].during", "always"),
            ("walls[2].until", "0.004"),
            (
                "walls[3]",
                r#"{"name": "shelf", "shape": {"box": {"from": [0.002, -0.001, 0.0029], "to": [0.022, 0.021, 0.0039]}},
                    "material": "soil", "from": 0.003, "until": 0.008}"#,
            ),
            // Soft springs allow long time steps.
            ("contact.contact_bond.normal_stiffness.absolute", "1000"),
            ("grains.initial.deposition.falling_stiffness", "100"),
            ("contact.contact_bond.tensile_strength", "0.001"),
            ("contact.contact_bond.shear_strength", "0.001"),
            ("time.end", "0.010"),
            ("output.grains.every", "0.005"),
            ("checkpoint", r#"{"every": 0.002}"#),
        ],
    )
}

#[test]
fn walls_that_come_and_go_keep_the_bits() {
    let _beside = beside_others();
    let study = study();
    let done = study.run("straight", 1, 1, &[]);
    let told = done.stdout + &done.stderr;
    for news in [
        "wall `floor` removed at",
        "wall `shelf` inserted at",
        "wall `shelf` removed at",
    ] {
        assert!(told.contains(news), "{news}: {told}");
    }
    study.same_on(&[
        ("two with threads", 2, 2, ""),
        ("three along x", 3, 1, "domain.split=x"),
    ]);
    // Restarts before the floor is removed, in between, and after the shelf is removed.
    study.run("parts", 2, 1, &["time.end=0.002"]);
    study.restart("parts", 1, &["time.end=0.005"]).expect(0);
    study.restart("parts", 3, &["time.end=0.009"]).expect(0);
    study.restart("parts", 1, &["time.end=0.010"]).expect(0);
    study.same("straight", "parts");
    // Each of the walls has an effect.
    for (name, set) in [
        ("held", "walls[2].until=null"),
        ("no shelf", "walls[3].until=0.0031"),
    ] {
        study.run(name, 1, 1, &[set]);
        assert_ne!(study.hash("straight"), study.hash(name), "{name}");
    }
}

#[test]
fn a_wall_that_comes_through_a_grain_ends_the_run() {
    let _beside = beside_others();
    let study = study();
    let shelf =
        r#"walls[3].shape={"box": {"from": [0.002, -0.001, 0.006], "to": [0.022, 0.021, 0.007]}}"#;
    let done = crate::ranks::run(2, &study.arguments("cut", 1, &[shelf])).expect(4);
    assert!(
        done.stderr.contains("the new wall `shelf` cuts into"),
        "{}",
        done.stderr
    );
}
