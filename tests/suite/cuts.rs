//! Cuts between slabs: the same bits and the same tables wherever a scene is cut along any axis, on any number of
//! threads and over a restart. The scenes mix eddy viscosities, operators, openings, structures, porous zones, bodies
//! and a free surface.
//!
//! Ranks are threads here ([`decomposition::on_threads`]). `SOLVER_CUT_CASES` names a folder with further cases.

use crate::ranks::{Cores, beside_others};
use decomposition::on_threads;
use serde_json::Value;
use solver::case::Document;
use solver::plan::Plan;
use solver::simulation::run::{WorkLimits, trial};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Axis and first planes of the slabs after the first.
type Cut = (usize, Vec<usize>);

/// Tables and numbers of a run by name.
type Results = BTreeMap<String, String>;

/// Returns the plan of a case on the slabs of a cut, with more settings; `None` if the case is refused.
fn plan(case: &str, (axis, bounds): &Cut, more: &[String]) -> Option<Plan> {
    let mut set = vec![
        format!("domain.split={}", ["x", "y", "z"][*axis]),
        format!("domain.slab_bounds={bounds:?}"),
    ];
    set.extend_from_slice(more);
    let document = Document::read(case, &set, Path::new(".")).ok()?;
    Plan::prepare(document).ok()
}

/// Runs a plan on the slabs of a cut in a folder, from its start or from the checkpoint in it.
fn advance(plan: &Plan, cut: &Cut, folder: &Path) -> Result<(), String> {
    let limits = WorkLimits {
        folder: folder.parent().unwrap().to_owned(),
        begun: Instant::now(),
        limit: None,
    };
    let runs = on_threads(cut.1.len() + 1, |ranks| {
        let done = trial(&ranks, 1, plan.clone(), folder, &limits);
        done.map_err(|error| error.to_string())
    });
    runs.into_iter().collect()
}

/// Returns the hash of the state at the end of a run, its balance of water, and its tables.
fn results(folder: &Path) -> Results {
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    let summary: Value = serde_json::from_str(&read(&folder.join("summary.json"))).unwrap();
    assert_eq!(summary["outcome"], "done");
    let numbers = ["state_hash", "water"].map(|name| (name.to_owned(), summary[name].to_string()));
    let mut found = BTreeMap::from(numbers);
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "csv") {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            found.insert(name, read(&path));
        }
    }
    found
}

/// Returns the results of a plan on the slabs of a cut.
fn run(plan: &Plan, cut: &Cut) -> Result<Results, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    advance(plan, cut, &path).map(|()| results(&path))
}

/// Returns the results of a run that continues on the slabs of a second cut from a checkpoint at this time \[s\], which
/// is in its second half.
fn run_in_parts(case: &str, cuts: [&Cut; 2], time: f64) -> Result<Results, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let every = [format!("checkpoint={{\"every\": {time}}}")];
    let [first, second] = cuts.map(|cut| plan(case, cut, &every).unwrap());
    advance(&first, cuts[0], &path)?;
    // The run continues from the checkpoint on the other slabs, as if it had been stopped there.
    std::fs::write(path.join("case.json"), &second.case_text).unwrap();
    advance(&second, cuts[1], &path)?;
    Ok(results(&path))
}

/// Returns the names of the results in which two runs differ.
fn differences(one: &Results, other: &Results) -> Vec<String> {
    let names = one.keys().chain(other.keys());
    let mut names: Vec<_> = names
        .filter(|name| one.get(*name) != other.get(*name))
        .cloned()
        .collect();
    names.dedup();
    names
}

/// Returns cuts into two slabs along each axis, `apart` planes from each other, and one into four.
fn cuts_of(plan: &Plan, apart: usize) -> Vec<Cut> {
    let grid = &plan.scene.grid;
    let mut cuts = Vec::new();
    for axis in 0..grid.dimension {
        let planes = grid.cells[axis];
        cuts.extend((1..planes).step_by(apart).map(|plane| (axis, vec![plane])));
        cuts.push((axis, [1, 2, 3].map(|k| planes * k / 4).to_vec()));
    }
    cuts
}

/// Compares cuts of a case, `apart` planes from each other, and a restart with one slab on one thread; returns what
/// differs, or `None` if the case is refused or its run fails.
fn compare(case: &str, apart: usize) -> Option<Vec<String>> {
    let whole = (0, Vec::new());
    let first = plan(case, &whole, &[])?;
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let straight = one_thread.unwrap().install(|| run(&first, &whole)).ok()?;
    let mut failed = Vec::new();
    let mut check = |what: String, found: Result<Results, String>| match found {
        Ok(found) => {
            let names = differences(&straight, &found);
            if !names.is_empty() {
                failed.push(format!("{what}: {names:?}"));
            }
        }
        Err(error) => failed.push(format!("{what}: {error}")),
    };
    let cuts = cuts_of(&first, apart);
    for cut in &cuts {
        let plan = plan(case, cut, &[]).unwrap();
        check(format!("{cut:?}"), run(&plan, cut));
    }
    let (one, two) = (&cuts[cuts.len() - 1], &cuts[cuts.len() / 3]);
    let written: Value = serde_json::from_str(case).unwrap();
    let time = 0.61 * written["time"]["end"].as_f64().unwrap();
    check(
        format!("{one:?}, from {time} s on {two:?}"),
        run_in_parts(case, [one, two], time),
    );
    Some(failed)
}

/// Returns a test of a scene in `cuts/`.
macro_rules! scenes {
    ($($name:ident)*) => {$(
        #[test]
        fn $name() {
            let _beside = beside_others();
            let _cores = Cores::acquire(1);
            let case = include_str!(concat!("cuts/", stringify!($name), ".json"));
            let none: Vec<String> = Vec::new();
            assert_eq!(compare(case, 5), Some(none));
        }
    )*};
}

scenes! {
    gap_in_the_plane
    gap_in_space
    turned_block
    driven_block
    joint
    channel
    discs
    step_at_a_seam
    symmetry_planes
    wet_plane
    block_on_a_plane
    blocks_on_planes
}

/// Checks the cases of a folder, if one is named.
#[test]
fn further_cases_do_not_depend_on_the_cuts() {
    let Some(folder) = std::env::var_os("SOLVER_CUT_CASES") else {
        return;
    };
    let files = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<_> = files.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let (mut compared, mut all) = (0, Vec::new());
    for file in files {
        let case = std::fs::read_to_string(&file).unwrap();
        let Some(failed) = compare(&case, 1) else {
            println!("{}: refused", file.display());
            continue;
        };
        compared += 1;
        println!("{}: {failed:?}", file.display());
        all.extend(
            failed
                .into_iter()
                .map(|what| format!("{}: {what}", file.display())),
        );
    }
    println!("{compared} cases compared");
    assert!(all.is_empty(), "{all:#?}");
}
