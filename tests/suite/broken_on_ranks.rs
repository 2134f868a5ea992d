//! Failures on two ranks: broken cases are refused with a single message, numerical failures name the cell or the
//! grain, and no rank waits forever.

use crate::case_broken::{TABLE, broken, expected};
use crate::ranks::{Cores, Study, beside_others, hang, run, start, start_impatient};

/// Broken cases that are refused before MPI starts, of every kind.
const NAMES: [&str; 12] = [
    "not JSON",
    "unknown field",
    "two choices at once",
    "text for a number",
    "no domain",
    "key twice",
    "pressure too high",
    "two conditions on a face",
    "overlap at the start",
    "hole outside the domain",
    "grains overfill the box",
    "probe of an unknown body",
];

#[test]
fn broken_cases_are_refused_by_one_voice() {
    let _beside = beside_others();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("case.json");
    for (n, name) in NAMES.into_iter().enumerate() {
        let (_, example, how, path) = TABLE.iter().find(|row| row.0 == name).unwrap();
        let (text, set) = broken(example, how);
        std::fs::write(&file, text).unwrap();
        let mut arguments = vec![file.to_str().unwrap().to_owned()];
        for assignment in set {
            arguments.extend(["--set".to_owned(), assignment]);
        }
        // The first few use the ordinary mpirun; with the impatient one, which kills ranks immediately, the
        // messages may be lost, but nothing else.
        let patient = n < 3;
        // The case is refused before it computes, so that the job mostly waits.
        let _cores = Cores::acquire(1);
        let running = if patient {
            start(2, &arguments)
        } else {
            start_impatient(2, &arguments)
        };
        let done = running.wait().expect(3);
        let path = expected(path);
        let path = if path.starts_with("line") {
            "line"
        } else {
            &path
        };
        let named = done
            .stderr
            .lines()
            .any(|line| line.starts_with(&format!("error: {path} ")));
        let voices = done.stderr.matches("the case was not run").count();
        assert!(
            (named && voices == 1) || (voices == 0 && !patient),
            "{name}: {}",
            done.stderr
        );
        assert!(
            !done.stderr.contains("MPI_ABORT"),
            "{name}: {}",
            done.stderr
        );
        assert!(!done.stderr.contains("panicked"), "{name}: {}", done.stderr);
        assert!(done.elapsed < hang(1.0), "{name}: {:?}", done.elapsed);
    }
}

#[test]
fn slabs_for_another_number_of_ranks_are_refused() {
    let _beside = beside_others();
    let study = Study::from_example("couette", &[("domain.slab_bounds", "[3, 7]")]);
    let done = run(2, &study.arguments("run", 1, &[])).expect(3);
    let line = done.stderr.lines().find(|line| {
        line.starts_with("error: domain.slab_bounds = [3, 7]: this list makes 3 slabs")
    });
    assert!(line.is_some(), "{}", done.stderr);
    assert!(!done.stderr.contains("MPI_ABORT"), "{}", done.stderr);
    // The output is a single verdict; there is neither a plan nor a folder.
    assert_eq!(done.stdout.trim(), "");
    let verdict = ": refused, 1 problem; the case was not run";
    assert_eq!(done.stderr.matches(verdict).count(), 1, "{}", done.stderr);
    assert!(!study.path("run").exists());
    let mut arguments = study.arguments("run", 1, &[]);
    arguments.push("--json".into());
    let done = run(2, &arguments).expect(3);
    let report: serde_json::Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(report["verdict"], "refused");
    assert_eq!(report["findings"][0]["path"], "domain.slab_bounds");
}

#[test]
fn a_restart_without_a_checkpoint_or_with_a_broken_change_says_so() {
    let _beside = beside_others();
    let study = Study::from_example("couette", &[]);
    let mut arguments = study.arguments("run", 1, &["time.end=0.01"]);
    arguments.push("--no-final-checkpoint".into());
    run(1, &arguments).expect(0);
    let done = study.restart("run", 2, &[]).expect(5);
    assert!(
        done.stderr.contains("solver: input/output: "),
        "{}",
        done.stderr
    );
    assert!(!done.stderr.contains("MPI_ABORT"), "{}", done.stderr);
    let done = study.restart("run", 2, &["time.end=-1"]).expect(3);
    assert!(
        done.stderr.contains("error: time.end = -1"),
        "{}",
        done.stderr
    );
}

/// Checks that a study ends with exit code 4 and a single message.
#[track_caller]
fn refuses(study: &Study, words: &[&str]) {
    let mut arguments = study.arguments("run", 1, &[]);
    // The plan predicts some of the failures.
    arguments.push("--allow-unstable".into());
    let done = run(2, &arguments).expect(4);
    let lines: Vec<&str> = done
        .stderr
        .lines()
        .filter(|line| line.contains("numerical failure"))
        .collect();
    assert_eq!(lines.len(), 1, "{}", done.stderr);
    for word in words {
        assert!(lines[0].contains(word), "{word} in {}", done.stderr);
    }
    assert!(!done.stderr.contains("MPI_ABORT"), "{}", done.stderr);
    assert!(done.elapsed < hang(1.0), "{:?}", done.elapsed);
}

/// Checks that a study is refused, and leaves a summary.
#[track_caller]
fn fails(study: &Study, words: &[&str]) {
    refuses(study, words);
    let summary = study.summary("run");
    assert_eq!(summary["outcome"], "failed");
    assert!(
        summary["error"].as_str().unwrap().contains(words[0]),
        "{summary:#}"
    );
}

#[test]
fn a_flow_that_diverges_is_named_by_its_cell() {
    let _beside = beside_others();
    // Lid-driven flow at a Reynolds number of 600 000 on a hundred cells, at a relaxation time close to 1/2.
    let study = Study::from_example(
        "cavity",
        &[
            ("fluid.lattice_boltzmann.lattice_velocity", "null"),
            ("fluid.lattice_boltzmann.reference_velocity", "null"),
            ("fluid.lattice_boltzmann.relaxation_time", "0.5001"),
            ("fluid.lattice_boltzmann.collision", r#"{"bgk": {}}"#),
            (
                "fluid.lattice_boltzmann.boundaries[0].condition.moving_wall.velocity",
                "[60, 0]",
            ),
            ("time.end", "0.02"),
            ("output", "{}"),
            ("probes", "[]"),
        ],
    );
    fails(&study, &["cell ["]);
}

#[test]
fn a_lost_grain_is_named() {
    let _beside = beside_others();
    let study = Study::from_example("collision", &[("time.end", "1"), ("output", "{}")]);
    fails(&study, &["grain ", "outside the domain"]);
}

/// Cases that only the run can refuse: each ends with exit code 4 and the name of the fault.
#[test]
fn soil_that_cannot_be_is_named() {
    let _beside = beside_others();
    let weak = ("fluid.darcy.max_iterations", "1");
    fails(
        &Study::from_example("seepage", &[weak]),
        &["did not converge"],
    );
    // A negligible viscosity of the water gives excessive conductivities.
    let thin = ("fluid.darcy.viscosity", "1e-30");
    fails(&Study::from_example("seepage", &[thin]), &["not finite"]);
    // A head of a thousand metres below a pile of four centimetres exceeds the critical gradient everywhere.
    let inlet = ("fluid.darcy.boundaries[1].condition.head.value", "1000");
    fails(
        &Study::from_example("seepage", &[inlet]),
        &["grain ", "outside the domain"],
    );
    // The cloud falls past the walls.
    let open = ("walls", "[]");
    refuses(
        &Study::from_example("deposition", &[open]),
        &["grain ", "outside the domain"],
    );
    // The level of trimming is below the floor.
    let level = ("grains.initial.deposition.trim_above", "0.001");
    let short = ("grains.initial.deposition.stop.at_most_steps", "2000");
    refuses(
        &Study::from_example("deposition", &[level, short]),
        &["trim_above"],
    );
}
