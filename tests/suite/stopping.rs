//! Runs that end early, on request or by force: a valid checkpoint no older than one interval remains, no rank
//! hangs, and the continued run has the bits of an uninterrupted one.

use crate::ranks::{
    Done, Running, Study, alone, beside_others, hang, run, signal, start, start_impatient,
    start_prompt,
};
use io::Alone;
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;
use std::time::Instant;

/// Number of steps between checkpoints.
const INTERVAL: u64 = 100;
/// Number of steps of the whole run.
const STEPS: u64 = 1000;

/// Returns a study of 1000 steps with a checkpoint every 100.
fn study(more: &[(&str, &str)]) -> Study {
    let mut set = vec![
        ("time.end", "0.08"),
        ("checkpoint.every", "0.008"),
        ("output.fluid.every", "0.04"),
        ("output.grains.every", "0.04"),
        ("output.contacts.every", "0.04"),
    ];
    set.extend_from_slice(more);
    Study::eroding(&set)
}

/// Returns the study with its uninterrupted run, made once; the caller must hold [`alone`] or [`beside_others`].
fn shared() -> &'static Study {
    static STUDY: OnceLock<Study> = OnceLock::new();
    STUDY.get_or_init(|| {
        let study = study(&[]);
        study.run("straight", 1, 1, &[]);
        study
    })
}

/// Returns the step of the newest checkpoint of a run, which is read completely and compared with its hashes.
#[track_caller]
fn newest(folder: &Path) -> u64 {
    io::newest(&folder.join("checkpoints"), &Alone)
        .unwrap()
        .manifest
        .step
}

/// Returns the last step in a table.
fn last_row(folder: &Path, table: &str) -> Option<u64> {
    let text = std::fs::read_to_string(folder.join(table)).ok()?;
    // The last line may be incomplete.
    text.rsplit_once('\n')?
        .0
        .rsplit('\n')
        .next()?
        .split(',')
        .next()?
        .parse()
        .ok()
}

/// Waits until the run has passed a step.
#[track_caller]
fn reaches(running: &mut Running, folder: &Path, step: u64) {
    running.until("it reaches a step", || {
        last_row(folder, "erosion.csv").filter(|&row| row >= step)
    });
}

/// Continues to the end on `ranks` ranks and compares with the uninterrupted run.
#[track_caller]
fn goes_on(study: &Study, name: &str, ranks: usize) {
    study.restart(name, ranks, &[]).expect(0);
    study.same("straight", name);
}

/// Checks a request to stop: a checkpoint at the step of the stop, the exit code `code`, and the message for the
/// user.
#[track_caller]
fn stops(study: &Study, name: &str, done: Done, code: i32) {
    let done = done.expect(code);
    let summary: Value = study.summary(name);
    assert_eq!(summary["outcome"], "stopped", "{summary:#}");
    let step = summary["steps"].as_u64().unwrap();
    // At step 0 it was still in its preparation.
    assert!(step < STEPS, "stopped at {step}");
    assert_eq!(newest(&study.path(name)), step);
    assert!(done.stderr.contains("solver restart"), "{}", done.stderr);
}

#[test]
fn sigterm_to_the_program() {
    let _alone = alone();
    let study = shared();
    let mut running = start(0, &study.arguments("term", 1, &[]));
    reaches(&mut running, &study.path("term"), 50);
    let ranks = running.ranks(0);
    signal(ranks[0], "TERM");
    stops(study, "term", running.wait(), 75);
    goes_on(study, "term", 2);
}

#[test]
fn sigusr2_to_mpirun() {
    let _alone = alone();
    let study = shared();
    let mut running = start(2, &study.arguments("usr2", 1, &[]));
    reaches(&mut running, &study.path("usr2"), 50);
    signal(running.mpirun(), "USR2");
    stops(study, "usr2", running.wait(), 75);
    goes_on(study, "usr2", 1);
}

#[test]
fn sigterm_to_mpirun_leaves_time_for_a_checkpoint() {
    let _alone = alone();
    let study = shared();
    let mut arguments = study.arguments("mpirun", 1, &["checkpoint.every=null"]);
    arguments.push("--no-final-checkpoint".into());
    let mut running = start(2, &arguments);
    reaches(&mut running, &study.path("mpirun"), 50);
    signal(running.mpirun(), "TERM");
    // mpirun ends with 1 for any exit code of the ranks.
    running.wait().expect(1);
    let step = newest(&study.path("mpirun"));
    assert!((50..STEPS).contains(&step), "{step}");
    goes_on(study, "mpirun", 2);
}

#[test]
fn sigusr1_asks_for_a_checkpoint_and_no_more() {
    let _alone = alone();
    let study = shared();
    let mut arguments = study.arguments("usr1", 1, &["checkpoint.every=null"]);
    arguments.push("--no-final-checkpoint".into());
    let mut running = start(2, &arguments);
    reaches(&mut running, &study.path("usr1"), 50);
    signal(running.mpirun(), "USR1");
    running.wait().expect(0);
    let step = newest(&study.path("usr1"));
    assert!((50..STEPS).contains(&step), "{step}");
    study.same("straight", "usr1");
}

#[test]
fn a_file_named_stop_and_the_walltime() {
    let _beside = beside_others();
    let study = shared();
    let folder = study.path("file");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("STOP"), "").unwrap();
    stops(study, "file", run(2, &study.arguments("file", 1, &[])), 75);
    assert!(!folder.join("STOP").exists(), "the next run would stop too");
    let mut arguments = study.arguments("walltime", 1, &[]);
    arguments.extend(["--max-walltime".into(), "0:00:01".into()]);
    stops(study, "walltime", run(2, &arguments), 75);
    goes_on(study, "walltime", 2);
}

#[test]
fn a_preparation_stops_in_every_phase_and_goes_on_to_the_same_state() {
    let _alone = alone();
    let study = Study::preparing();
    // The pause is short enough for stops in every phase, and long enough to get beyond the start by mpirun.
    let straight = run(1, &study.arguments("straight", 1, &[])).expect(0);
    let pause = straight.elapsed / 5;
    let folder = study.path("parts");
    std::fs::create_dir(&folder).unwrap();
    let mut phases = Vec::new();
    for attempt in 0.. {
        let ranks = 1 + attempt % 3;
        // A stop requested before the start is noticed after the first batch of the sample. Later ones are
        // requested while the job runs, so that each attempt gets further than the previous one.
        let done = if attempt == 0 {
            std::fs::write(folder.join("STOP"), "").unwrap();
            run(ranks, &study.arguments("parts", 1, &[]))
        } else {
            let running = start_prompt(ranks, &study.restart_arguments("parts", &[]));
            std::thread::sleep(pause);
            if attempt < 12 {
                std::fs::write(folder.join("STOP"), "").unwrap();
            }
            running.wait()
        };
        if done.code == Some(0) {
            break;
        }
        let done = done.expect(75);
        assert!(done.stderr.contains("solver restart"), "{}", done.stderr);
        assert!(!folder.join("STOP").exists());
        assert_eq!(study.summary("parts")["outcome"], "stopped");
        let kept = |name: &str| {
            let folder = folder.join(name);
            folder
                .is_dir()
                .then(|| io::newest(&folder, &Alone).unwrap().manifest.attributes)
        };
        let attributes = kept("preparation").or_else(|| kept("checkpoints")).unwrap();
        let phase = attributes["preparation"].as_object();
        phases.push(phase.map_or("run".to_owned(), |phase| {
            phase.keys().next().unwrap().clone()
        }));
    }
    phases.dedup();
    assert_eq!(
        phases.first().map(String::as_str),
        Some("sample"),
        "{phases:?}"
    );
    assert!(phases.iter().any(|phase| phase == "warm_up"), "{phases:?}");
    // The last attempt may have ended before it checked the file.
    let _ = std::fs::remove_file(folder.join("STOP"));
    study.same("straight", "parts");
    assert!(!folder.join("preparation").exists());
}

/// Checks a job with a killed rank: the job ends soon, and its files are sufficient to continue.
#[track_caller]
fn dies(study: &Study, name: &str, running: Running, killed: Instant) {
    let done = running.wait();
    let lingered = killed.elapsed();
    assert!(done.code.is_some_and(|code| code != 0), "{done:#?}");
    assert!(lingered < hang(1.0), "{lingered:?}");
    let folder = study.path(name);
    let (saved, reached) = (newest(&folder), last_row(&folder, "erosion.csv").unwrap());
    assert!(
        saved + INTERVAL >= reached && saved.is_multiple_of(INTERVAL),
        "saved {saved}, reached {reached}"
    );
    goes_on(study, name, 2);
}

#[test]
fn a_rank_killed_during_the_run() {
    let _alone = alone();
    let study = shared();
    let mut running = start(2, &study.arguments("killed", 1, &[]));
    reaches(&mut running, &study.path("killed"), 2 * INTERVAL + 50);
    let ranks = running.ranks(2);
    signal(ranks[1], "KILL");
    dies(study, "killed", running, Instant::now());
}

#[test]
fn a_rank_killed_while_a_checkpoint_is_written() {
    let _alone = alone();
    let study = shared();
    let mut hits = 0;
    for attempt in 0..8 {
        let name = format!("write {attempt}");
        let checkpoints = study.path(&name).join("checkpoints");
        let mut running = start_impatient(2, &study.arguments(&name, 1, &[]));
        reaches(&mut running, &study.path(&name), 2 * INTERVAL + 10);
        let ranks = running.ranks(2);
        // A shell that only polls responds within a millisecond.
        let trap = Command::new("bash")
            .args([
                "-c",
                r#"until compgen -G "$1/*.h5.part"; do :; done; kill -KILL "$2""#,
                "bash",
            ])
            .arg(&checkpoints)
            .arg(ranks[attempt % 2].to_string())
            .output()
            .unwrap();
        assert!(trap.status.success(), "{trap:?}");
        let killed = Instant::now();
        let done = running.wait();
        assert!(done.code.is_some_and(|code| code != 0), "{done:#?}");
        assert!(killed.elapsed() < hang(1.0), "{:?}", killed.elapsed());
        // The write was interrupted before its end.
        let step = newest(&study.path(&name));
        let reached = last_row(&study.path(&name), "erosion.csv").unwrap();
        assert!(
            step + INTERVAL >= reached,
            "saved {step}, reached {reached}"
        );
        if step < reached {
            hits += 1;
            goes_on(study, &name, 2);
        }
        if hits == 2 {
            break;
        }
    }
    assert!(hits > 0, "no write was hit");
}

/// Small separate disk, unmounted at the end.
struct Disk<'a>(&'a Path);

impl<'a> Disk<'a> {
    /// Mounts the file system; returns `None` and prints the reason if mounting is forbidden.
    fn mount(at: &'a Path, options: &str) -> Option<Self> {
        std::fs::create_dir(at).unwrap();
        let done = Command::new("mount")
            .args(["-t", "tmpfs", "-o", options, "tmpfs"])
            .arg(at)
            .output()
            .unwrap();
        if !done.status.success() {
            println!("no small disk: {}", String::from_utf8_lossy(&done.stderr));
            return None;
        }
        Some(Self(at))
    }

    fn grow(&self) {
        let done = Command::new("mount")
            .args(["-o", "remount,size=256m"])
            .arg(self.0)
            .status()
            .unwrap();
        assert!(done.success());
    }
}

impl Drop for Disk<'_> {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(self.0).status();
    }
}

#[test]
fn a_full_disk_stops_an_output_and_spares_what_was_saved() {
    let _beside = beside_others();
    let study = study(&[("time.end", "0.04"), ("output.fluid.every", "0.002")]);
    study.run("straight", 2, 1, &[]);
    let place = study.path("disk");
    let Some(disk) = Disk::mount(&place, "size=5m") else {
        return;
    };
    let arguments = study.arguments("disk/run", 1, &[]);
    let done = run(2, &arguments).expect(5);
    assert!(done.stderr.contains("disk/run"), "{}", done.stderr);
    let summary = study.summary("disk/run");
    assert_eq!(summary["outcome"], "failed", "{summary:#}");
    let step = newest(&place.join("run"));
    assert!(step >= INTERVAL, "{step}");
    disk.grow();
    study.restart("disk/run", 1, &[]).expect(0);
    study.same("straight", "disk/run");
}

#[test]
fn a_stop_without_room_for_its_checkpoint_is_an_error_and_no_invitation_to_go_on() {
    let _beside = beside_others();
    let study = study(&[
        ("time.end", "8"),
        ("output", "{}"),
        // Tables would fill the disk first.
        ("probes", "[]"),
        ("analysis", "{}"),
        ("checkpoint.every", "null"),
        (
            "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value",
            "0.01",
        ),
    ]);
    let place = study.path("disk");
    let Some(disk) = Disk::mount(&place, "size=600k") else {
        return;
    };
    let mut arguments = study.arguments("disk/run", 1, &[]);
    arguments.extend(["--max-walltime".into(), "0:00:02".into()]);
    let done = run(2, &arguments).expect(5);
    assert!(
        done.stderr.contains("no space for a checkpoint")
            && done.stderr.contains("there is no earlier checkpoint"),
        "{}",
        done.stderr
    );
    drop(disk);
}

#[test]
fn a_checkpoint_that_does_not_fit_is_left_out_and_the_run_goes_on() {
    let _beside = beside_others();
    let study = study(&[("time.end", "0.04"), ("output", "{}")]);
    study.run("straight", 2, 1, &[]);
    let place = study.path("disk");
    let Some(_disk) = Disk::mount(&place, "size=2500k") else {
        return;
    };
    let done = run(2, &study.arguments("disk/run", 1, &[])).expect(0);
    assert!(
        done.stdout.contains("no checkpoint at step"),
        "{}",
        done.stdout
    );
    let step = newest(&place.join("run"));
    assert!((INTERVAL..5 * INTERVAL).contains(&step), "{step}");
    study.same("straight", "disk/run");
}

/// An interval of seepage takes long where its grid is large: a stop does not wait for its end, and the run continues
/// from the step before it.
#[test]
fn a_stop_is_heard_within_an_interval_of_seepage() {
    let _alone = alone();
    let study = Study::from_example(
        "drawdown",
        &[
            ("fluid.darcy.grid.cells", "[200, 10]"),
            ("time.solid_time_step", "14400"),
            ("time.end", "432000"),
            ("checkpoint.every", "144000"),
            ("probes[0].every", "144000"),
            ("probes[1].every", "432000"),
            ("output.fluid.every", "432000"),
        ],
    );
    study.run("straight", 1, 1, &[]);
    let mut running = start(2, &study.arguments("stopped", 1, &[]));
    let folder = study.path("stopped").join("checkpoints");
    let step = running.until("it ends a step", || {
        let newest = io::newest(&folder, &Alone).ok()?.manifest.step;
        (newest > 0).then_some(newest)
    });
    signal(running.mpirun(), "USR2");
    stops(&study, "stopped", running.wait(), 75);
    assert_eq!(study.summary("stopped")["steps"], step);
    goes_on(&study, "stopped", 1);
}
