//! Folders of runs: existing results are not lost without a request, one run at a time uses a folder, and a restart
//! changes only fields that its state can follow.

use crate::ranks::{Study, alone, beside_others, run, start};
use std::path::Path;

fn arguments(study: &Study, name: &str, more: &[&str]) -> Vec<String> {
    let mut all = study.arguments(name, 1, &[]);
    all.extend(more.iter().map(|one| (*one).to_owned()));
    all
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn another_run_in_the_folder_is_refused_and_replaced_on_request() {
    let _beside = beside_others();
    let study = Study::eroding(&[]);
    study.run("a", 2, 1, &[]);
    let (before, hash) = (names(&study.path("a")), study.hash("a"));
    for ranks in [1, 2, 3] {
        let done = run(ranks, &arguments(&study, "a", &[])).expect(2);
        assert!(
            done.stderr.contains("holds another run (done,") && done.stderr.contains("--overwrite"),
            "{}",
            done.stderr
        );
    }
    assert_eq!(names(&study.path("a")), before);
    assert_eq!(study.hash("a"), hash);
    // Another case with fewer files: none of the first run's files remain.
    let fewer = ["output={}", "probes=[]", "time.end=0.002"];
    let mut replaced = study.arguments("a", 1, &fewer);
    replaced.push("--overwrite".into());
    run(3, &replaced).expect(0);
    let left = names(&study.path("a"));
    assert_eq!(
        left,
        [
            "bonds.csv",
            "case.json",
            "checkpoints",
            "erosion.csv",
            "removed.csv",
            "summary.json"
        ]
    );
    assert_ne!(study.hash("a"), hash);
}

#[test]
fn two_runs_never_share_a_folder() {
    let _alone = alone();
    // The run is longer than the test and is stopped at its end.
    let study = Study::eroding(&[
        ("time.end", "8"),
        (
            "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value",
            "0.01",
        ),
    ]);
    let mut first = start(2, &arguments(&study, "a", &[]));
    let folder = study.path("a");
    first.until("it writes", || {
        (std::fs::metadata(folder.join("erosion.csv")).ok()?.len() > 500).then_some(())
    });
    for more in [&[][..], &["--overwrite"]] {
        let done = run(1, &arguments(&study, "a", more)).expect(2);
        assert!(done.stderr.contains("is in use"), "{}", done.stderr);
    }
    let done = study.restart("a", 1, &[]).expect(2);
    assert!(done.stderr.contains("is in use"), "{}", done.stderr);
    std::fs::write(folder.join("STOP"), "").unwrap();
    first.wait().expect(75);
    // Each row of its table occurs once.
    let table = std::fs::read_to_string(folder.join("erosion.csv")).unwrap();
    let steps: Vec<u64> = table
        .lines()
        .filter_map(|line| line.split(',').next()?.parse().ok())
        .collect();
    let interval = steps[1];
    let whole: Vec<u64> = (0..).map(|n| n * interval).take(steps.len()).collect();
    assert_eq!(steps, whole);
    assert!(!folder.join("run.lock").exists());
}

#[test]
fn a_finished_run_is_extended_on_other_ranks_with_other_outputs() {
    let _beside = beside_others();
    let study = Study::eroding(&[("time.end", "0.024")]);
    study.run("straight", 1, 1, &[]);
    study.run("short", 2, 1, &["time.end=0.012"]);
    study.restart("short", 3, &["time.end=0.024"]).expect(0);
    study.same("straight", "short");
    let case = std::fs::read_to_string(study.path("short").join("case.json")).unwrap();
    assert!(case.contains("\"end\":0.024"), "{case}");
    // A finished run has no further work and is unchanged.
    let done = study.restart("short", 1, &[]).expect(0);
    assert!(done.stdout.contains("had already ended"), "{}", done.stdout);
    study.same("straight", "short");
    // Without a final checkpoint a run continues from an earlier one, if there is one.
    run(1, &arguments(&study, "bare", &["--no-final-checkpoint"])).expect(0);
    assert!(names(&study.path("bare/checkpoints")).is_empty());
}

#[test]
fn a_restart_follows_allowed_changes_and_refuses_the_others_by_name() {
    let _beside = beside_others();
    let study = Study::eroding(&[("time.end", "0.008")]);
    study.run("a", 1, 1, &[]);
    let hash = study.hash("a");
    for (ranks, set, path) in [
        (1, "domain.spacing=4e-5", "domain.spacing"),
        (
            2,
            "fluid.lattice_boltzmann.relaxation_time=0.9",
            "relaxation_time",
        ),
        (
            3,
            "contact.cohesive_frictional.friction_angle_degrees=25",
            "friction_angle_degrees",
        ),
        (1, "grains.bond_at_start=false", "grains.bond_at_start"),
        (
            2,
            "output.grains.displacement=true",
            "output.grains.displacement",
        ),
        (1, "time.end=0.004", "time.end"),
        (
            1,
            r#"regions[1]={"name": "new", "box": {"from": [0, 0], "to": [0.0003, 0.0016]},
                "action": {"generate": {"rate": 1, "radii": {"uniform": {"min": 1e-4, "max": 1e-4}}}}}"#,
            "generate",
        ),
    ] {
        let done = study.restart("a", ranks, &[set]).expect(3);
        let named = done
            .stderr
            .lines()
            .any(|line| line.contains("error:") && line.contains(path));
        assert!(named, "{set}: {}", done.stderr);
        assert_eq!(done.stderr.matches("error:").count(), 1, "{}", done.stderr);
        assert_eq!(study.hash("a"), hash);
    }
    // A wall may be inserted, and grains then rest on it; it may not intersect grains.
    let wall = |x: f64| {
        format!(
            r#"walls=[{{"name": "gate", "shape": {{"plane": {{"point": [{x}, 0], "normal": [-1, 0]}}}},
                "material": "wall"}}]"#
        )
    };
    let done = study
        .restart("a", 2, &[&wall(1e-3), "time.end=0.012"])
        .expect(3);
    assert!(
        done.stderr.contains("the new wall `gate` cuts into"),
        "{}",
        done.stderr
    );
    let set = [
        wall(2.8e-3),
        "time.end=0.012".into(),
        "probes[0].every=0.0008".into(),
        "regions=[]".into(),
        "analysis.erosion_law.end_at_eroded_fraction=0.9".into(),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let refused = study.restart("a", 1, &set);
    // The erosion law counts grains that leave through a region; without a region it is refused.
    if refused.code == Some(3) {
        assert!(refused.stderr.contains("region"), "{}", refused.stderr);
    }
    let set: Vec<&str> = set.into_iter().filter(|one| *one != "regions=[]").collect();
    study.restart("a", 2, &set).expect(0);
    assert_ne!(study.hash("a"), hash);
    // The wall may also be removed again.
    study
        .restart("a", 1, &["walls=[]", "time.end=0.016"])
        .expect(0);
}

#[test]
fn the_case_itself_and_samples_are_not_replaced() {
    let _beside = beside_others();
    let study = Study::eroding(&[]);
    let case = study.path("case.json");
    let text = std::fs::read_to_string(&case).unwrap();
    let done = run(1, &arguments(&study, ".", &[])).expect(2);
    assert!(done.stderr.contains("its own case"), "{}", done.stderr);
    let done = run(1, &arguments(&study, ".", &["--overwrite"])).expect(2);
    assert!(done.stderr.contains("its own case"), "{}", done.stderr);
    assert_eq!(std::fs::read_to_string(&case).unwrap(), text);
}
