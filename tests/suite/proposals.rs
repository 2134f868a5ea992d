//! Every value that a message proposes is valid: after setting it, the problem is solved.

use crate::case_broken::{Break, TABLE, broken};
use crate::ranks::Cores;
use serde_json::Value;
use solver::case::Document;
use solver::case::examples::find;
use solver::case::set::{apply, covers};
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use std::collections::BTreeSet;
use std::path::Path;

/// Cases with proposals in addition to the broken ones: a name, an example, and the changes.
const MORE: &[(&str, &str, &[&str])] = &[
    (
        "a free polyhedron without a law",
        "dry-incline",
        &["contact=null", "output={}"],
    ),
    (
        "edges that no cell of the wanted size divides",
        "couette",
        &[
            "domain={\"size\": [0.008, 0.00211]}",
            "fluid.lattice_boltzmann.boundaries=[]",
            "probes=[]",
        ],
    ),
    (
        "edges that are no whole number of cells",
        "couette",
        &["domain.spacing=0.000317"],
    ),
    (
        "two ways to a time step, one of them in two parts",
        "couette",
        &[
            "fluid.lattice_boltzmann.lattice_velocity=0.1",
            "fluid.lattice_boltzmann.reference_velocity=0.01",
        ],
    ),
    (
        "a lattice velocity without its reference velocity",
        "couette",
        &["fluid.lattice_boltzmann.lattice_velocity=0.1"],
    ),
    (
        "a large relaxation time",
        "couette",
        &["fluid.lattice_boltzmann.relaxation_time=3"],
    ),
    (
        "a relaxation time beyond all",
        "couette",
        &[
            "fluid.lattice_boltzmann.relaxation_time=null",
            "fluid.lattice_boltzmann.time_step=1e6",
        ],
    ),
    (
        "fast vortices at a stated time step",
        "taylor-green",
        &["fluid.lattice_boltzmann.initial.taylor_green.velocity=0.02"],
    ),
    (
        "the matrix of Suga with a large relaxation time",
        "taylor-green",
        &[
            "domain={\"size\": [0.0024, 0.002, 0.0018], \"spacing\": 1e-4, \"periodic\": [\"x\", \"y\"]}",
            "fluid.lattice_boltzmann.collision={\"suga\": {}}",
            "probes=[]",
        ],
    ),
    (
        "vortices in a closed box",
        "taylor-green",
        &["domain.periodic=[]"],
    ),
    (
        "an interval longer than the run",
        "piping",
        &["time.end=0.0015", "checkpoint.every=0.1"],
    ),
    (
        "an interval shorter than any need",
        "couette",
        &["probes[0].every=1e-9"],
    ),
    (
        "averages after the end",
        "couette",
        &["output.averages={\"from\": 5, \"sample_every\": 0.1}"],
    ),
    ("too few copies", "couette", &["checkpoint.keep=1"]),
    ("too many copies", "couette", &["checkpoint.keep=100000"]),
    (
        "a solid step that is too long",
        "collision",
        &["time.solid_time_step=1e-3"],
    ),
    (
        "a safety that is too large",
        "collision",
        &["time.solid_time_step_safety=1"],
    ),
    (
        "outputs of what is not there",
        "couette",
        &[
            "output.grains={\"every\": 0.1}",
            "output.blocks={\"every\": 0.1}",
            "coupling={\"bounce_back\": {}}",
            "time.solid_time_step=1e-6",
        ],
    ),
    (
        "a dense cloud",
        "deposition",
        &["grains.initial.deposition.number=100000"],
    ),
    (
        "one letter wrong",
        "couette",
        &["fluid.lattice_boltzmann.lattice=d2q8"],
    ),
    ("another axis", "couette", &["domain.split=z"]),
];

fn judge(text: &str, set: &[String]) -> Vec<Problem> {
    match Document::read(text, set, Path::new("")).and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

fn weight(severity: Severity) -> u8 {
    match severity {
        Severity::Error => 2,
        Severity::Unstable => 1,
        Severity::Warning => 0,
    }
}

/// Returns the faults of the proposals of a case, and adds the paths of the valid ones.
fn try_all(name: &str, text: &str, set: &[String], right: &mut BTreeSet<String>) -> Vec<String> {
    let mut wrong = Vec::new();
    let before = judge(text, set);
    for problem in before.iter().filter(|p| !p.remedy.proposal().is_empty()) {
        let proposed = problem.remedy.proposal().iter();
        let proposed: Vec<String> = proposed
            .map(|set| format!("{}={}", set.path, set.value))
            .collect();
        let all = [set, &proposed].concat();
        let after = judge(text, &all);
        // If a field has two faults, a proposal is for one of them.
        let here = |all: &[Problem]| {
            let heavy = |p: &&Problem| {
                p.path == problem.path && weight(p.severity) >= weight(problem.severity)
            };
            all.iter().filter(heavy).count()
        };
        // A value that is invalid in this field causes an error at this path, above or below.
        let touched = |p: &&Problem| {
            let assigned = problem
                .remedy
                .proposal()
                .iter()
                .map(|set| set.path.as_str());
            p.severity == Severity::Error
                && assigned
                    .chain([problem.path.as_str()])
                    .any(|path| covers(path, &p.path) || covers(&p.path, path))
                && !before.iter().any(|old| old.path == p.path)
        };
        let still = (here(&after) >= here(&before))
            .then(|| after.iter().find(|p| p.path == problem.path))
            .flatten();
        if let Some(found) = still.or_else(|| after.iter().find(touched)) {
            wrong.push(format!("{name}: {problem}\n   after {proposed:?}: {found}"));
        } else {
            right.insert(format!(
                "{} {}",
                problem.path,
                problem
                    .reason
                    .split(' ')
                    .take(4)
                    .collect::<Vec<_>>()
                    .join(" ")
            ));
        }
    }
    wrong
}

#[test]
fn what_is_proposed_passes() {
    let _core = Cores::acquire(1);
    let mut wrong = Vec::new();
    let mut right = BTreeSet::new();
    for (name, example, how, _) in TABLE {
        let (text, set) = broken(example, how);
        wrong.extend(try_all(name, &text, &set, &mut right));
    }
    for (name, example, set) in MORE {
        let text = find(example).unwrap_or_else(|| panic!("{example}")).text;
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let some = judge(text, &set);
        let some = some.iter().any(|p| !p.remedy.proposal().is_empty());
        if !some {
            wrong.push(format!("{name}: nothing is proposed"));
        }
        wrong.extend(try_all(name, text, &set, &mut right));
    }
    // Warnings of the unchanged examples.
    for example in solver::case::examples::EXAMPLES {
        wrong.extend(try_all(example.name, example.text, &[], &mut right));
    }
    assert!(
        wrong.is_empty(),
        "{} wrong:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    assert!(right.len() >= 40, "{} proposals: {right:#?}", right.len());
}

#[test]
fn a_proposal_can_be_pasted() {
    let text = find("couette").unwrap().text;
    let problems = judge(text, &["checkpoint.keep=1".to_owned()]);
    let line = problems[0].to_string();
    assert!(line.ends_with("(--set checkpoint.keep=2)"), "{line}");
    // The proposal is also given as data, in addition to the sentence.
    let data = serde_json::to_value(&problems[0]).unwrap();
    assert!(data["remedy"].is_string(), "{data}");
    let [set] = data["proposal"].as_array().unwrap().as_slice() else {
        panic!("{data}");
    };
    assert_eq!(
        (&set["path"], &set["value"]),
        (&"checkpoint.keep".into(), &2.into())
    );
    let mut tree: Value = serde_json::from_str(text).unwrap();
    apply(&mut tree, "checkpoint.keep=2").unwrap();
    // Values are quoted where a shell requires it.
    let problems = judge(
        text,
        &["contact={\"linear\": {\"normal_stiffness\": {\"per_diameter\": 1e8}}}".to_owned()],
    );
    let found = problems.iter().find(|p| p.path == "contact").unwrap();
    assert!(
        found.to_string().ends_with("(--set contact=null)"),
        "{found}"
    );
    let _: &[(&str, &str, Break, &str)] = TABLE;
}
