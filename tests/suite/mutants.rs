//! Mutants of all text input: every example case, every case and study under `jobs`, the files that they name, and
//! assignments of `--set`.
//!
//! A mutant is a function of its seed. In this process it is read and planned as by `solver validate`: the result
//! is a plan or problems, each with a path, a reason and a remedy, and never a panic. One mutant in twenty, and
//! every one that changes a file, is also given to the real binary with 1 GiB of address space; a few cheap ones
//! are run for some steps. The binary ends with one of its exit codes, and not by a signal, an abort or a panic.
//!
//! ```text
//! SOLVER_MUTANTS=20000 SOLVER_MUTANTS_FROM=0 cargo test --test suite -- mutants --nocapture
//! ```
//!
//! makes as many mutants with the seeds from 0 on; without the variable it makes 400.
//! `bash jobs/reliability/mutants.sh` is the long form. The seed in a failure makes the same mutant again:
//! `SOLVER_MUTANTS=1 SOLVER_MUTANTS_FROM=seed`.

use crate::case_mutants::{HANG, processor_time};
use crate::dice::Dice;
use crate::ranks::{Cores, ENVIRONMENT, SOLVER, without_daemon};
use serde_json::{Value, json};
use solver::case::Document;
use solver::case::examples::{EXAMPLES, SEARCH, STUDY};
use solver::error::Problem;
use solver::plan::Plan;
use solver::sweep::members::members;
use solver::sweep::study::Study;
use solver::threshold::{ends, study::ThresholdStudy};
use std::collections::BTreeMap;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Number of mutants without `SOLVER_MUTANTS`.
const FEW: u64 = 400;
/// Address space of the binary [KiB].
const MEMORY: u64 = 1 << 20;

/// Text with the files that it names.
struct Seed {
    name: String,
    text: String,
    /// Names and bytes of the files.
    files: Vec<(String, Vec<u8>)>,
    study: bool,
}

pub(crate) const SQUARE: &str = "solid s\n\
    facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 2 0 0\n  vertex 0 2 0\n endloop\nendfacet\n\
    facet normal 0 0 1\n outer loop\n  vertex 2 0 0\n  vertex 2 2 0\n  vertex 0 2 0\n endloop\nendfacet\nendsolid\n";
pub(crate) const TETRAHEDRON: &str = "solid t\n\
    facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n\
    facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n\
    facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\n\
    facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid\n";
const BLOCKS: &str = r#"[{"shape": {"half_spaces":[[1,0,0,1],[-1,0,0,0],[0,1,0,1],[0,-1,0,0],[0,0,1,1],[0,0,-1,0]]}}]"#;

/// Returns example cases, cases and studies under `jobs` with their files, and cases that name every other kind of
/// file.
fn corpus() -> Vec<Seed> {
    let mut all: Vec<Seed> = EXAMPLES
        .iter()
        .map(|example| Seed {
            name: example.name.to_owned(),
            text: example.text.to_owned(),
            files: Vec::new(),
            study: false,
        })
        .collect();
    for (name, example) in [("the study", STUDY), ("the search", SEARCH)] {
        all.push(Seed {
            name: name.to_owned(),
            text: example.text.to_owned(),
            files: Vec::new(),
            study: true,
        });
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("jobs")];
    while let Some(folder) = folders.pop() {
        let mut entries: Vec<PathBuf> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        entries.sort();
        let (more, files): (Vec<PathBuf>, Vec<PathBuf>) =
            entries.into_iter().partition(|path| path.is_dir());
        folders.extend(more);
        for path in &files {
            let Ok(text) = std::fs::read_to_string(path) else {
                continue;
            };
            let Ok(Value::Object(tree)) = serde_json::from_str(&text) else {
                continue;
            };
            let study = tree.contains_key("vary") || tree.contains_key("criterion");
            if !study && !tree.contains_key("domain") {
                continue;
            }
            let beside = files.iter().filter(|file| {
                let name = file.file_name().unwrap().to_str().unwrap();
                *file != path && text.contains(&format!("\"{name}\""))
            });
            let beside = beside.map(|file| {
                let name = file.file_name().unwrap().to_str().unwrap();
                (name.to_owned(), std::fs::read(file).unwrap())
            });
            all.push(Seed {
                name: path.strip_prefix(root).unwrap().display().to_string(),
                files: beside.collect(),
                text,
                study,
            });
        }
    }
    all.extend(with_meshes());
    all
}

fn with_meshes() -> Vec<Seed> {
    let slope: Value = serde_json::from_str(
        EXAMPLES
            .iter()
            .find(|e| e.name == "avalanche")
            .unwrap()
            .text,
    )
    .unwrap();
    let made = |name: &str, file: &str, bytes: &str, change: &dyn Fn(&mut Value)| {
        let mut case = slope.clone();
        change(&mut case);
        Seed {
            name: name.to_owned(),
            text: case.to_string(),
            files: vec![(file.to_owned(), bytes.as_bytes().to_vec())],
            study: false,
        }
    };
    let one_block = json!([{"shape": {"mesh": {"path": "solid.stl", "scale": 0.1}}, "position": [0.5, 0.5, 0.5]}]);
    let mut binary = vec![0_u8; 80];
    binary.extend(1_u32.to_le_bytes());
    binary.extend([0_u8; 50]);
    let mut all = vec![
        made("a wall from a mesh", "wall.stl", SQUARE, &|case| {
            case["walls"][0]["shape"] = json!({"mesh": {"path": "wall.stl"}});
        }),
        made("a block from a mesh", "solid.stl", TETRAHEDRON, &|case| {
            case["blocks"]["initial"] = json!({"list": one_block});
        }),
        made("blocks from a file", "rock.json", BLOCKS, &|case| {
            case["blocks"]["initial"] = json!({"file": {"path": "rock.json"}});
        }),
    ];
    let mut mesh = made("a binary mesh", "wall.stl", "", &|case| {
        case["walls"][0]["shape"] = json!({"mesh": {"path": "wall.stl"}});
    });
    mesh.files[0].1 = binary;
    all.push(mesh);
    all
}

/// Collects JSON pointers of all nodes below a node; of long lists the first four entries and the last.
fn pointers(node: &Value, at: &str, found: &mut Vec<String>) {
    let children: Vec<(String, &Value)> = match node {
        Value::Object(map) => map
            .iter()
            .map(|(k, v)| (k.replace('~', "~0").replace('/', "~1"), v))
            .collect(),
        Value::Array(list) => list
            .iter()
            .enumerate()
            .filter(|(n, _)| *n < 4 || n + 1 == list.len())
            .map(|(n, v)| (n.to_string(), v))
            .collect(),
        _ => return,
    };
    for (key, child) in children {
        let path = format!("{at}/{key}");
        found.push(path.clone());
        pointers(child, &path, found);
    }
}

/// Returns a path in the form of messages and `--set`: `probes[0].every`.
fn dotted(pointer: &str) -> String {
    let mut path = String::new();
    for part in pointer.split('/').skip(1) {
        if part.parse::<usize>().is_ok() {
            path += &format!("[{part}]");
        } else {
            if !path.is_empty() {
                path.push('.');
            }
            path += &part.replace("~1", "/").replace("~0", "~");
        }
    }
    path
}

fn odd_value(dice: &mut Dice) -> Value {
    dice.choose(&[
        json!(0),
        json!(-1),
        json!(1),
        json!(2),
        json!(3),
        json!(0.5),
        json!(-0.0),
        json!(1e-300),
        json!(5e-324),
        json!(1e-9),
        json!(1e9),
        json!(1e29),
        json!(-1e29),
        json!(1e308),
        json!(4_294_967_295_u64),
        json!(4_294_967_296_u64),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(""),
        json!("x"),
        json!("auto"),
        json!("../x"),
        json!("=1/0"),
        json!("\u{1b}[2J\n\u{0}"),
        json!(true),
        json!(false),
        json!(null),
        json!([]),
        json!([0]),
        json!([1, 2]),
        json!([1, 2, 3]),
        json!([0, 0, 0, 0]),
        json!([1e29, -1e29, 0]),
        json!([[], [[]]]),
        json!({}),
        json!({"value": 1, "source": "x"}),
        json!({"unknown": {}}),
    ])
    .clone()
}

/// Mutant: a text, its assignments, and its files.
pub(crate) struct Mutant {
    pub(crate) text: String,
    pub(crate) set: Vec<String>,
    pub(crate) files: Vec<(String, Vec<u8>)>,
    pub(crate) study: bool,
    pub(crate) what: String,
    pub(crate) touches_file: bool,
}

/// Changes bytes, words or lines of a file, and returns a description of the change.
pub(crate) fn scramble(bytes: &mut Vec<u8>, dice: &mut Dice) -> String {
    let at = dice
        .below(bytes.len() + 1)
        .min(bytes.len().saturating_sub(1));
    match dice.below(8) {
        0 if !bytes.is_empty() => {
            bytes[at] ^= 1 << dice.below(8);
            format!("bit of byte {at}")
        }
        1 => {
            let words: [&[u8]; 16] = [
                b"nan",
                b"inf",
                b"-1e400",
                b",,",
                b"\n\n",
                b"\0",
                b"\xff",
                b"#",
                b"\"",
                b"{",
                b"]",
                b"1e30",
                b"-0",
                b" ",
                b"\r\n",
                b"99999999999999999999",
            ];
            let word = *dice.choose(&words);
            bytes.splice(at..at, word.iter().copied());
            format!("{:?} at {at}", String::from_utf8_lossy(word))
        }
        2 => {
            bytes.truncate(at);
            format!("cut at {at}")
        }
        3 => {
            let end = (at + 1 + dice.below(40)).min(bytes.len());
            bytes.drain(at.min(end)..end);
            format!("without {at}..{end}")
        }
        4 => {
            let end = (at + 1 + dice.below(200)).min(bytes.len());
            let piece = bytes[at.min(end)..end].to_vec();
            let to = dice.below(bytes.len() + 1);
            bytes.splice(to..to, piece);
            format!("{at}..{end} again at {to}")
        }
        5 => {
            let mut lines: Vec<Vec<u8>> =
                bytes.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
            let (a, b) = (dice.below(lines.len()), dice.below(lines.len()));
            lines.swap(a, b);
            *bytes = lines.join(&b'\n');
            format!("lines {a} and {b} exchanged")
        }
        6 if !bytes.is_empty() => {
            // A digit is replaced by another, or by a sign.
            let digits: Vec<usize> = (0..bytes.len())
                .filter(|&n| bytes[n].is_ascii_digit())
                .collect();
            let Some(&place) = digits.get(dice.below(digits.len())) else {
                return "nothing".to_owned();
            };
            bytes[place] = *dice.choose(b"0123456789-e.");
            format!("digit at {place}")
        }
        _ => {
            let (value, count) = (dice.draw().to_le_bytes()[0], 1 + dice.below(64));
            bytes.extend(std::iter::repeat_n(value, count));
            format!("{count} times {value:#x} at the end")
        }
    }
}

fn mutant(corpus: &[Seed], dice: &mut Dice) -> Mutant {
    let seed = dice.choose(corpus);
    let mut made = Mutant {
        text: seed.text.clone(),
        set: Vec::new(),
        files: seed.files.clone(),
        study: seed.study,
        what: seed.name.clone(),
        touches_file: false,
    };
    for _ in 0..1 + dice.below(3) {
        let note = once(&mut made, corpus, dice);
        made.what += &format!("; {note}");
    }
    made
}

fn once(made: &mut Mutant, corpus: &[Seed], dice: &mut Dice) -> String {
    let kind = dice.below(14);
    if kind == 0 {
        let mut bytes = made.text.clone().into_bytes();
        let note = scramble(&mut bytes, dice);
        made.text = String::from_utf8_lossy(&bytes).into_owned();
        return format!("text: {note}");
    }
    if kind <= 2 && !made.files.is_empty() {
        let place = dice.below(made.files.len());
        made.touches_file = true;
        let note = scramble(&mut made.files[place].1, dice);
        return format!("{}: {note}", made.files[place].0);
    }
    let Ok(mut tree) = serde_json::from_str::<Value>(&made.text) else {
        return "no tree".to_owned();
    };
    let mut paths = Vec::new();
    pointers(&tree, "", &mut paths);
    if paths.is_empty() {
        return "empty".to_owned();
    }
    let path = dice.choose(&paths).clone();
    let (parent, key) = path.rsplit_once('/').unwrap();
    let note = match kind {
        3 => {
            let value = odd_value(dice);
            let place = if dice.below(4) == 0 {
                // The field may not exist in the case.
                let other =
                    serde_json::from_str::<Value>(&dice.choose(corpus).text).unwrap_or_default();
                let mut others = Vec::new();
                pointers(&other, "", &mut others);
                if others.is_empty() {
                    path.clone()
                } else {
                    dice.choose(&others).clone()
                }
            } else {
                path.clone()
            };
            let assignment = format!("{}={value}", dotted(&place));
            made.set.push(assignment.clone());
            return format!("--set {assignment}");
        }
        4 | 5 => {
            let number = tree.pointer(&path).and_then(Value::as_f64);
            let power = i32::try_from(dice.below(25)).unwrap() - 12;
            let value = match number {
                Some(x) if dice.below(3) > 0 => json!(x * 10_f64.powi(power)),
                Some(x) => json!(-x),
                None => odd_value(dice),
            };
            let note = format!("{path} = {value}");
            *tree.pointer_mut(&path).unwrap() = value;
            note
        }
        6 | 7 => {
            let value = odd_value(dice);
            let note = format!("{path} = {value}");
            *tree.pointer_mut(&path).unwrap() = value;
            note
        }
        8 => {
            match tree.pointer_mut(parent) {
                Some(Value::Object(map)) => {
                    drop(map.remove(&key.replace("~1", "/").replace("~0", "~")))
                }
                Some(Value::Array(list)) => drop(list.remove(key.parse().unwrap())),
                _ => {}
            }
            format!("without {path}")
        }
        9 => {
            if let Some(Value::Object(map)) = tree.pointer_mut(parent) {
                let name = key.replace("~1", "/").replace("~0", "~");
                let value = map.remove(&name).unwrap_or_default();
                map.insert(format!("{name}s"), value);
            }
            format!("{path} renamed")
        }
        10 => {
            // A key is written twice, or an entry of a list is repeated.
            let copy = tree.pointer(&path).cloned().unwrap_or_default();
            match tree.pointer_mut(parent) {
                Some(Value::Array(list)) => list.push(copy),
                _ => {
                    let text = tree.to_string();
                    let needle = format!("{:?}:", key);
                    made.text = text.replacen(&needle, &format!("{needle}{copy},{needle}"), 1);
                    return format!("{path} twice");
                }
            }
            format!("{path} again")
        }
        11 | 12 => {
            // Part of another case replaces the same field, or any field.
            let other: Value = serde_json::from_str(&dice.choose(corpus).text).unwrap_or_default();
            let part = match other.pointer(&path) {
                Some(part) if kind == 11 => Some(part.clone()),
                _ => {
                    let mut others = Vec::new();
                    pointers(&other, "", &mut others);
                    let same: Vec<&String> = others
                        .iter()
                        .filter(|o| o.ends_with(&format!("/{key}")))
                        .collect();
                    let from = if same.is_empty() {
                        dice.choose(&others).clone()
                    } else {
                        (*dice.choose(&same)).clone()
                    };
                    other.pointer(&from).cloned()
                }
            };
            if let Some(part) = part {
                *tree.pointer_mut(&path).unwrap() = part;
            }
            format!("{path} from another case")
        }
        _ => {
            let other = dice.choose(&paths).clone();
            let (a, b) = (tree.pointer(&path).cloned(), tree.pointer(&other).cloned());
            if let (Some(a), Some(b)) = (a, b) {
                *tree.pointer_mut(&path).unwrap() = b;
                if let Some(place) = tree.pointer_mut(&other) {
                    *place = a;
                }
            }
            format!("{path} and {other} exchanged")
        }
    };
    made.text = tree.to_string();
    note
}

/// Checks that every problem has a path, a reason and a remedy.
fn complete(problems: &[Problem]) -> Result<(), String> {
    match problems
        .iter()
        .find(|p| p.path.is_empty() || p.reason.is_empty() || p.remedy.is_empty())
    {
        Some(problem) => Err(format!("incomplete: {problem:?}")),
        None => Ok(()),
    }
}

/// Returns `true` for a mutant of a search for a threshold.
fn is_search(mutant: &Mutant) -> bool {
    mutant.study && mutant.text.contains("\"criterion\"")
}

/// Reads and plans a mutant in this process; returns its plan if it is accepted.
pub(crate) fn in_process(mutant: &Mutant, folder: &Path) -> Result<Option<Plan>, String> {
    let read = || {
        if is_search(mutant) {
            let made = ThresholdStudy::read(&mutant.text).and_then(|study| ends(&study, folder));
            return made.map(|_| None);
        }
        if mutant.study {
            let made = Study::read(&mutant.text).and_then(|study| members(&study, folder));
            return made.map(|_| None);
        }
        Document::read(&mutant.text, &mutant.set, folder)
            .and_then(Plan::prepare)
            .map(Some)
    };
    match catch_unwind(AssertUnwindSafe(read)) {
        Err(panic) => {
            let words = panic.downcast_ref::<String>().cloned();
            let words = words.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
            Err(format!("panic: {}", words.unwrap_or_default()))
        }
        Ok(Ok(Some(plan))) => {
            complete(&plan.warnings)?;
            if !(plan.clock.time_step > 0.0 && plan.clock.time_step.is_finite()) {
                return Err(format!("time step {}", plan.clock.time_step));
            }
            if plan.to_string().contains("NaN") {
                return Err(format!("a plan with NaN: {plan}"));
            }
            Ok(Some(plan))
        }
        Ok(Ok(None)) => Ok(None),
        Ok(Err(problems)) if problems.is_empty() => Err("refused without a reason".to_owned()),
        Ok(Err(problems)) => complete(&problems).map(|()| None),
    }
}

/// Runs the binary; returns its exit code, or the fault of its end.
pub(crate) fn through_binary(arguments: &[String]) -> Result<i32, String> {
    let mut command = Command::new("timeout");
    command.args(["--kill-after=5", &(HANG.as_secs() * 6).to_string()]);
    command.args([
        "bash",
        "-c",
        &format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\""),
        SOLVER,
    ]);
    command.envs(ENVIRONMENT);
    let session = tempfile::tempdir().unwrap();
    without_daemon(&mut command, session.path());
    let done = command.args(arguments).output().unwrap();
    match done.status.code() {
        Some(code @ (0 | 2 | 3 | 4 | 5 | 75)) => Ok(code),
        code => {
            let told = String::from_utf8_lossy(&done.stderr);
            let tail: String = told.chars().take(800).collect();
            Err(format!("{arguments:?} ended with {code:?}: {tail}"))
        }
    }
}

fn arguments(command: &str, mutant: &Mutant, text: &Path) -> Vec<String> {
    let mut words = vec![command.to_owned(), text.to_str().unwrap().to_owned()];
    if mutant.study {
        let command = if is_search(mutant) {
            "threshold"
        } else {
            "sweep"
        };
        command.clone_into(&mut words[0]);
        words.push("--list".to_owned());
        return words;
    }
    for assignment in &mutant.set {
        words.push(format!("--set={assignment}"));
    }
    words
}

/// Returns `true` if a few steps can be run within the time and memory of the test.
fn runs(plan: &Plan) -> bool {
    use solver::scene::grains::GrainSource;
    let grown = plan.scene.grains.as_ref().is_some_and(|grains| {
        matches!(
            grains.source,
            GrainSource::Growth { .. } | GrainSource::Deposition { .. }
        )
    });
    let cells = plan.scene.flow.is_some() || plan.scene.seepage.is_some();
    let few = !cells || plan.scene.grid.cell_count() < 20_000;
    let solid = plan.clock.solid_steps_per_step < 200;
    few && solid && !grown && plan.clock.warm_up_steps == 0 && plan.estimate.memory_bytes < 2e8
}

/// Returns the number in an environment variable.
pub(crate) fn variable(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// Appends the counts of a campaign to the table named by `SOLVER_MUTANTS_CSV`, if it is set: kind, first seed,
/// number of mutants, number of accepted ones, exit codes of the binary with their numbers, and number of faulty
/// mutants.
pub(crate) fn record(
    kind: &str,
    (first, count): (u64, u64),
    accepted: u64,
    codes: &[(i32, u64)],
    wrong: usize,
) {
    let Some(path) = std::env::var_os("SOLVER_MUTANTS_CSV") else {
        return;
    };
    let mut all: BTreeMap<i32, u64> = BTreeMap::new();
    for (code, count) in codes {
        *all.entry(*code).or_default() += count;
    }
    let words: Vec<String> = all.iter().map(|(code, n)| format!("{code}:{n}")).collect();
    let mut table = std::fs::OpenOptions::new()
        .append(true)
        .create(true)
        .open(path)
        .unwrap();
    let codes = words.join(" ");
    writeln!(table, "{kind},{first},{count},{accepted},{codes},{wrong}").unwrap();
}

#[test]
fn mutants_are_planned_or_refused_and_nothing_else() {
    let count = variable("SOLVER_MUTANTS").unwrap_or(FEW);
    let first = variable("SOLVER_MUTANTS_FROM").unwrap_or(0);
    let long = count > FEW;
    let corpus = corpus();
    assert!(corpus.len() > 90, "{} texts", corpus.len());
    assert!(corpus.iter().filter(|seed| !seed.files.is_empty()).count() > 8);
    let folder = tempfile::tempdir().unwrap();
    let (mut accepted, mut studies) = (0, 0);
    let mut slowest = (Duration::ZERO, 0);
    let mut slow = 0;
    let mut codes: BTreeMap<(&str, i32), u64> = BTreeMap::new();
    let mut wrong = Vec::new();
    for seed in first..first + count {
        let _core = Cores::acquire(1);
        let mut dice = Dice::new(seed);
        let mutant = mutant(&corpus, &mut dice);
        // A study is planned member by member, so that fewer studies are tested.
        if mutant.study {
            studies += 1;
        }
        for (name, bytes) in &mutant.files {
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        if long {
            // If memory runs out, which ends the test, the file identifies the mutant.
            std::fs::write(
                std::env::temp_dir().join("solver-mutant.txt"),
                format!("{seed} {}", mutant.what),
            )
            .unwrap();
        }
        let begun = processor_time();
        let judged = in_process(&mutant, folder.path());
        let taken = processor_time() - begun;
        slowest = slowest.max((taken, seed));
        if long && taken > Duration::from_secs(1) && !mutant.study {
            slow += 1;
            println!("seed {seed}: {}: {taken:.2?}", mutant.what);
        }
        let limit = if mutant.study { 6 * HANG } else { HANG };
        if taken > limit {
            wrong.push(format!("seed {seed}: {}: took {taken:?}", mutant.what));
        }
        let text = folder.path().join("text.json");
        let mut through = |command: &'static str, words: Vec<String>| {
            std::fs::write(&text, &mutant.text).unwrap();
            match through_binary(&words) {
                Ok(code) => *codes.entry((command, code)).or_default() += 1,
                Err(reason) => wrong.push(format!("seed {seed}: {}: {reason}", mutant.what)),
            }
        };
        let often = if long { 20 } else { 80 };
        if seed % often == 0 || (long && mutant.touches_file && seed % 4 == 0) {
            let command = if mutant.study { "sweep" } else { "validate" };
            through(command, arguments("validate", &mutant, &text));
        }
        match judged {
            Ok(Some(plan)) => {
                accepted += 1;
                if accepted % often == 1 && runs(&plan) {
                    let mut words = arguments("run", &mutant, &text);
                    let end = plan.clock.time_step * 5.0;
                    let output = folder.path().join("out");
                    let _ = std::fs::remove_dir_all(&output);
                    words.extend([format!("--set=time.end={end:e}"), "--threads=1".to_owned()]);
                    words.extend(["--output".to_owned(), output.to_str().unwrap().to_owned()]);
                    through("run", words);
                }
            }
            Ok(None) => {}
            Err(reason) => wrong.push(format!("seed {seed}: {}: {reason}", mutant.what)),
        }
        for (name, _) in &mutant.files {
            let _ = std::fs::remove_file(folder.path().join(name));
        }
    }
    println!(
        "{count} mutants of {} texts from seed {first}: {accepted} cases accepted, {studies} studies, the slowest \
         took {:.2?} (seed {}), {slow} cases more than a second; through the binary {codes:?}; {} wrong",
        corpus.len(),
        slowest.0,
        slowest.1,
        wrong.len()
    );
    record(
        "texts",
        (first, count),
        accepted,
        &codes
            .iter()
            .map(|((_, code), n)| (*code, *n))
            .collect::<Vec<_>>(),
        wrong.len(),
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(
        count < FEW || accepted > count / 100,
        "{accepted} of {count}"
    );
}
