//! Checkpoints written by hand. Any program can compute the hash of a manifest, so that a matching hash does not
//! exclude manipulation: the case bounds the contents of a manifest, and its files must be in its folder.
//!
//! [`no_signed_mutant_gets_through`] makes as many mutants as `SOLVER_CHECKPOINT_MUTANTS` says, 36 without it,
//! with the seeds from `SOLVER_MUTANTS_FROM` on. Each is signed anew and restarted by the real binary under a
//! limit of memory and time: it ends with 0, 3, 4 or 5 (a changed number within its bounds is as good
//! as the one that was written), never by a signal, a panic or a hang. With a real number that is not finite in a
//! column it does not end with 0.

use crate::dice::Dice;
use crate::mutants::{record, variable};
use crate::ranks::{Cores, ENVIRONMENT, SOLVER, Study, beside_others, without_daemon};
use io::checkpoint::Manifest;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

#[derive(Serialize)]
struct Signed<'a> {
    checkpoint: &'a Manifest,
    manifest_blake3: String,
}

/// Writes a manifest with its hash; a text without the form of a manifest is written without hash.
fn sign(path: &Path, tree: &Value) {
    let text = match serde_json::from_value::<Manifest>(tree.clone()) {
        Ok(manifest) => {
            let own = serde_json::to_string(&manifest).unwrap();
            let signed = Signed {
                checkpoint: &manifest,
                manifest_blake3: blake3::hash(own.as_bytes()).to_hex().to_string(),
            };
            serde_json::to_string_pretty(&signed).unwrap() + "\n"
        }
        Err(_) => json!({"checkpoint": tree, "manifest_blake3": ""}).to_string(),
    };
    std::fs::write(path, text).unwrap();
}

/// Returns a run of some hundred steps with checkpoints, made once per process.
fn shared() -> &'static Study {
    static STUDY: OnceLock<Study> = OnceLock::new();
    STUDY.get_or_init(|| {
        let study = Study::eroding(&[("checkpoint.every", "0.008"), ("checkpoint.keep", "2")]);
        study.run("run", 0, 1, &[]);
        study
    })
}

/// Maximum number of positions at which the bytes of a column are searched.
const EQUAL_COLUMNS: usize = 2048;

/// Copy of the run with its newest checkpoint only.
struct Copy {
    folder: PathBuf,
    manifest: PathBuf,
    tree: Value,
    /// Changes of the case for the restart.
    set: Vec<String>,
}

impl Copy {
    fn new(name: &str) -> Self {
        let (from, folder) = (shared().path("run"), shared().path(name));
        let _ = std::fs::remove_dir_all(&folder);
        let checkpoints = folder.join("checkpoints");
        std::fs::create_dir_all(&checkpoints).unwrap();
        for entry in std::fs::read_dir(&from).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                std::fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
            }
        }
        let found = io::newest(&from.join("checkpoints"), &io::Alone).unwrap();
        let manifest = checkpoints.join(found.path.file_name().unwrap());
        let heavy = from.join("checkpoints").join(&found.manifest.file);
        std::fs::copy(heavy, checkpoints.join(&found.manifest.file)).unwrap();
        let tree = serde_json::to_value(&found.manifest).unwrap();
        sign(&manifest, &tree);
        Self {
            folder,
            manifest,
            tree,
            set: Vec::new(),
        }
    }

    fn heavy(&self) -> PathBuf {
        let name = shared_file(&self.tree);
        self.manifest.with_file_name(name)
    }

    /// Restarts the run; returns exit code and messages.
    fn restart(&self, ranks: usize) -> (Option<i32>, String) {
        let mut words = vec!["--kill-after=5".to_owned(), "60".into()];
        if ranks > 0 {
            words.extend(["mpirun", "--oversubscribe", "-n"].map(str::to_owned));
            words.push(ranks.to_string());
        }
        words.extend(
            [
                "bash",
                "-c",
                "ulimit -v 2097152; exec \"$0\" \"$@\"",
                SOLVER,
            ]
            .map(str::to_owned),
        );
        words.extend(
            ["restart", self.folder.to_str().unwrap(), "--threads", "1"].map(str::to_owned),
        );
        for set in &self.set {
            words.extend(["--set".to_owned(), set.clone()]);
        }
        let mut command = Command::new("timeout");
        command.envs(ENVIRONMENT);
        let session = tempfile::tempdir().unwrap();
        if ranks == 0 {
            without_daemon(&mut command, session.path());
        }
        command.env("OMPI_MCA_odls_base_sigkill_timeout", "1");
        // The run is refused before it computes, or makes a few steps: on several ranks it mostly waits.
        let _cores = Cores::acquire(1);
        let done = command.args(&words).output().unwrap();
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        (done.status.code(), told)
    }

    /// Overwrites a number of a column in the HDF5 file, and signs the manifest for it; returns `true` if the column
    /// then has the number, in this row or in another one. If the bytes occur several times, such as zeros, each
    /// position is tried until the column has changed.
    fn put(&self, column: &str, row: usize, bits: u64) -> bool {
        let old = self.read(column).unwrap();
        let raw: Vec<u8> = old.iter().flat_map(|word| word.to_le_bytes()).collect();
        let before = std::fs::read(self.heavy()).unwrap();
        let mut from = 0_usize;
        for _ in 0..EQUAL_COLUMNS {
            // Numbers lie at multiples of eight bytes.
            let mut starts = (from.next_multiple_of(8)..before.len()).step_by(8);
            let Some(start) = starts.find(|start| before[*start..].starts_with(&raw)) else {
                assert!(from > 0, "{column} is not in one piece");
                return false;
            };
            let at = start + 8 * (row % old.len());
            let mut bytes = before.clone();
            bytes[at..at + 8].copy_from_slice(&bits.to_le_bytes());
            std::fs::write(self.heavy(), &bytes).unwrap();
            let mut tree = self.tree.clone();
            tree["blake3"] = json!(blake3::hash(&bytes).to_hex().to_string());
            sign(&self.manifest, &tree);
            let now = self.read(column);
            if now.is_some_and(|now| now != old && now.contains(&bits)) {
                return true;
            }
            from = start + raw.len();
        }
        false
    }

    /// Returns the bits of the numbers of a column; none from a file that cannot be read.
    fn read(&self, column: &str) -> Option<Vec<u64>> {
        let found = io::newest(self.manifest.parent().unwrap(), &io::Alone).ok()?;
        let reader = io::Reader::open(&found).ok()?;
        reader.read_all::<u64>(column).ok().or_else(|| {
            let real = reader.read_all::<f64>(column).ok()?;
            Some(real.into_iter().map(f64::to_bits).collect())
        })
    }

    /// Returns `true` if a column has real numbers.
    fn is_real(&self, column: &str) -> bool {
        let found = io::newest(self.manifest.parent().unwrap(), &io::Alone).unwrap();
        io::Reader::open(&found)
            .unwrap()
            .read_all::<u64>(column)
            .is_err()
    }

    /// Returns the names of the columns of grains and contacts.
    fn columns(&self) -> Vec<String> {
        let arrays = self.tree["arrays"].as_array().unwrap();
        let names = arrays.iter().filter_map(|array| array["name"].as_str());
        let of_solids = |name: &&str| name.starts_with("grains_") || name.contains("contacts_");
        names.filter(of_solids).map(str::to_owned).collect()
    }

    #[track_caller]
    fn refused(&self, ranks: usize, reason: &str) {
        self.ends(5, ranks, reason);
    }

    #[track_caller]
    fn ends(&self, with: i32, ranks: usize, reason: &str) {
        let (code, told) = self.restart(ranks);
        assert_eq!(code, Some(with), "{reason}: {told}");
        assert!(told.contains(reason), "{reason}: {told}");
        assert!(!told.contains("panicked"), "{told}");
    }
}

fn shared_file(tree: &Value) -> String {
    let name = Path::new(tree["file"].as_str().unwrap());
    name.file_name().unwrap().to_str().unwrap().to_owned()
}

#[test]
fn a_signed_manifest_is_bounded_by_the_case() {
    let _beside = beside_others();
    let copy = Copy::new("bounded");
    let huge = 1_u64 << 40;
    let array = |name: &str| {
        let all = copy.tree["arrays"].as_array().unwrap();
        all.iter().position(|a| a["name"] == name).unwrap()
    };
    let (populations, ids) = (array("populations"), array("grains_id"));
    let cases: Vec<(&str, Value, &str)> = vec![
        ("/file", json!("../../x.h5"), "not a file of a checkpoint"),
        ("/file", json!("/dev/zero"), "not a file of a checkpoint"),
        (
            "/file",
            json!("checkpoint_1.h5/../../x.h5"),
            "not a file of a checkpoint",
        ),
        ("/time", json!(1e9), "its time is 1000000000 s at step"),
        ("/bytes", json!(huge), "for arrays of"),
        ("/bytes", json!(17), "does not fit into a file of 17 bytes"),
        (
            "/format",
            json!(2),
            "a checkpoint of format 2, written by version",
        ),
        (
            "/attributes/rows",
            json!([huge, 0, 0]),
            "grains, but the case has",
        ),
        (
            "/attributes/rows",
            json!([1, 2]),
            "does not state its number of",
        ),
        ("/attributes/seepage", json!(huge), "numbers of the seepage"),
        (
            "/attributes/fluid_steps",
            json!(0),
            "its fluid has done 0 steps",
        ),
        (
            "/attributes/averages",
            json!(u64::MAX),
            "more averages than steps",
        ),
        ("/attributes/typical_radius", json!(1e300), "typical radius"),
        ("/attributes/notes", json!([1]), "notes are not an object"),
        ("/attributes/case", json!("{}"), "its case cannot be used"),
        (
            "/attributes/columns",
            json!([[["id", "imaginary"]], [], []]),
            "imaginary numbers",
        ),
        ("/attributes/solid_steps", json!(u64::MAX), "solid steps"),
        ("/attributes/removal/next_id", json!(u64::MAX), ""),
    ];
    let shapes = [
        (populations, json!([1_000_000, 1_000_000, 1_000_000, 9])),
        (populations, json!([u64::MAX >> 1, 2, 2, 2])),
        (populations, json!([])),
        (ids, json!([1_u64 << 62])),
        (ids, json!([1])),
    ];
    for (path, value, reason) in cases {
        let mut tree = copy.tree.clone();
        match tree.pointer_mut(path) {
            Some(place) => *place = value,
            None => continue,
        }
        sign(&copy.manifest, &tree);
        copy.refused(0, reason);
    }
    let mut tree = copy.tree.clone();
    tree["step"] = json!(u64::MAX);
    sign(&copy.manifest, &tree);
    copy.ends(3, 0, "the checkpoint is already at");
    for (n, shape) in shapes {
        let mut tree = copy.tree.clone();
        tree["arrays"][n]["shape"] = shape;
        tree["arrays"][n]["blocks"] = json!([]);
        sign(&copy.manifest, &tree);
        copy.refused(0, "");
    }
    let mut tree = copy.tree.clone();
    tree["arrays"][ids]["shape"] = json!([1_u64 << 40]);
    sign(&copy.manifest, &tree);
    copy.refused(2, "does not fit into a file");
    sign(&copy.manifest, &copy.tree);
    let (code, told) = copy.restart(0);
    assert_eq!(code, Some(0), "the whole one is taken: {told}");
}

/// Checks that numbers that no run of the case could have written are refused with the name of their column.
#[test]
fn every_column_of_grains_and_contacts_has_bounds() {
    let _beside = beside_others();
    let real = f64::to_bits;
    // Values within the range of the case that do not fit the other columns of the grain.
    let whole = Copy::new("columns");
    let scaled = |column: &str, factor: f64| {
        let values = whole.read(column).unwrap();
        real(factor * f64::from_bits(values[3]))
    };
    for (column, value) in [
        ("grains_radius", real(1e6)),
        ("grains_radius", real(1e-12)),
        ("grains_mass", real(1e300)),
        ("grains_mass", scaled("grains_mass", 0.5)),
        ("grains_mass", scaled("grains_mass", 1.0 + 1e-7)),
        ("grains_mass", real(0.0)),
        ("grains_inertia", real(1e300)),
        ("grains_inertia", scaled("grains_inertia", 0.9)),
        ("grains_radius", scaled("grains_radius", 1.0 + 1e-7)),
        ("grains_id", 1 << 32),
        ("grains_material", 17),
        ("grains_position_x", real(1e12)),
        ("grains_velocity_y", real(1e300)),
        ("grains_spin", real(f64::NAN)),
        ("grains_contact_force_x", real(1e300)),
        ("contacts_first", 4_000_000),
        ("contacts_second", u64::MAX),
        ("contacts_memory_0", real(f64::NAN)),
        ("contacts_memory_0", real(1e300)),
    ] {
        let copy = Copy::new("columns");
        assert!(
            copy.columns().iter().any(|name| name == column),
            "{column}: {:?}",
            copy.columns()
        );
        copy.put(column, 3, value);
        copy.refused(0, "values that no ");
    }
    // A later end of the run changes no radius.
    let mut copy = Copy::new("columns");
    copy.set.push("time.end=1".into());
    copy.put("grains_radius", 3, real(1e-300));
    copy.refused(0, "values that no ");
    let copy = Copy::new("columns");
    for (path, value, reason) in [
        (
            "/attributes/fluid_steps",
            json!(u64::MAX),
            "its fluid has done",
        ),
        (
            "/attributes/guards",
            json!({"fast": 7}),
            "state of the guards",
        ),
    ] {
        let mut tree = copy.tree.clone();
        *tree.pointer_mut(path).unwrap() = value;
        sign(&copy.manifest, &tree);
        copy.refused(0, reason);
    }
}

#[test]
fn a_checkpoint_is_a_plain_file_of_its_folder() {
    let _beside = beside_others();
    let copy = Copy::new("plain");
    let (heavy, aside) = (copy.heavy(), copy.folder.join("aside.h5"));
    std::fs::rename(&heavy, &aside).unwrap();
    std::os::unix::fs::symlink(&aside, &heavy).unwrap();
    copy.refused(0, "it is a link to another file");
    std::fs::remove_file(&heavy).unwrap();
    assert!(
        Command::new("mkfifo")
            .arg(&heavy)
            .status()
            .unwrap()
            .success()
    );
    copy.refused(0, "it is a pipe");
    copy.refused(2, "it is a pipe");
    std::fs::remove_file(&heavy).unwrap();
    std::fs::create_dir(&heavy).unwrap();
    copy.refused(0, "it is a folder");
    std::fs::remove_dir(&heavy).unwrap();
    std::fs::rename(&aside, &heavy).unwrap();
    let case = copy.folder.join("case.json");
    std::fs::remove_file(&case).unwrap();
    assert!(
        Command::new("mkfifo")
            .arg(&case)
            .status()
            .unwrap()
            .success()
    );
    copy.refused(0, "it is a pipe");
}

#[test]
fn another_program_is_named() {
    let _beside = beside_others();
    let copy = Copy::new("version");
    let mut tree = copy.tree.clone();
    tree["attributes"]["version"] = json!("0.0.7");
    tree["attributes"]["commit"] = json!("abcdef");
    sign(&copy.manifest, &tree);
    let (code, told) = copy.restart(0);
    assert_eq!(code, Some(0), "{told}");
    assert!(
        told.contains("was written by version 0.0.7 (commit abcdef)"),
        "{told}"
    );
}

#[test]
fn a_changed_table_is_reported() {
    let _beside = beside_others();
    for name in ["bonds.csv", "erosion.csv"] {
        let copy = Copy::new("tables");
        let path = copy.folder.join(name);
        let whole = std::fs::read(&path).unwrap();
        let mark = &copy.tree["attributes"]["tables"][name];
        let length = usize::try_from(mark["bytes"].as_u64().unwrap()).unwrap();
        assert!(
            length > 100 && whole.len() >= length,
            "{name} has rows: {mark}"
        );
        let mut flipped = whole.clone();
        flipped[length - 3] ^= 1;
        std::fs::write(&path, &flipped).unwrap();
        copy.refused(0, "are not those of the checkpoint; restore it");
        copy.refused(2, name);
        std::fs::write(&path, &whole[..length - 1]).unwrap();
        copy.refused(0, "at the checkpoint; restore it");
        // A longer table is truncated, like that of a killed run.
        std::fs::write(
            &path,
            [&whole[..length], &b"9999999,what was never a row"[..]].concat(),
        )
        .unwrap();
        let (code, told) = copy.restart(0);
        assert_eq!(code, Some(0), "{told}");
        assert_eq!(std::fs::read(&path).unwrap(), whole, "{name}");
    }
    let copy = Copy::new("tables");
    std::fs::remove_file(copy.folder.join("bonds.csv")).unwrap();
    let (code, told) = copy.restart(0);
    assert_eq!(code, Some(0), "{told}");
    assert!(
        told.contains("bonds.csv is missing: a new table begins at step"),
        "{told}"
    );
}

/// Collects JSON pointers of all nodes below a node; of long lists a few.
fn pointers(node: &Value, at: &str, found: &mut Vec<String>) {
    let children: Vec<(String, &Value)> = match node {
        Value::Object(map) => map.iter().map(|(k, v)| (k.replace('/', "~1"), v)).collect(),
        Value::Array(list) => {
            let few = list.iter().enumerate().filter(|(n, _)| *n < 12);
            few.map(|(n, v)| (n.to_string(), v)).collect()
        }
        _ => return,
    };
    for (key, child) in children {
        let path = format!("{at}/{key}");
        found.push(path.clone());
        pointers(child, &path, found);
    }
}

#[test]
fn no_signed_mutant_gets_through() {
    let _beside = beside_others();
    let count: u64 = std::env::var("SOLVER_CHECKPOINT_MUTANTS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(36);
    let first = variable("SOLVER_MUTANTS_FROM").unwrap_or(0);
    let mut copy = Copy::new("mutants");
    let (manifest, heavy) = (copy.tree.clone(), std::fs::read(copy.heavy()).unwrap());
    let mut paths = Vec::new();
    pointers(&manifest, "", &mut paths);
    let mut codes: std::collections::BTreeMap<Option<i32>, u64> = std::collections::BTreeMap::new();
    let mut bad = Vec::new();
    for seed in first..first + count {
        let mut dice = Dice::new(seed);
        let what;
        let mut infinite = false;
        if seed % 3 == 2 {
            // Changes a number of a column of grains or contacts.
            copy = Copy::new("mutants");
            let column = dice.choose(&copy.columns()).clone();
            let (row, any) = (dice.below(1000), dice.draw());
            let value: u64 = *dice.choose(&[
                f64::NAN.to_bits(),
                f64::NEG_INFINITY.to_bits(),
                1e300_f64.to_bits(),
                1e6_f64.to_bits(),
                (-1.0_f64).to_bits(),
                5e-324_f64.to_bits(),
                0,
                1,
                7,
                1 << 31,
                1 << 32,
                u64::MAX,
                any,
            ]);
            what = format!("{column}[{row}]: {value:#x}");
            let holds = copy.put(&column, row, value);
            infinite = holds && copy.is_real(&column) && !f64::from_bits(value).is_finite();
        } else if seed % 3 == 0 {
            copy = Copy::new("mutants");
            let mut tree = manifest.clone();
            let path = dice.choose(&paths).clone();
            let value = dice
                .choose(&[
                    json!(0),
                    json!(-1),
                    json!(1),
                    json!(u64::MAX),
                    json!(i64::MAX),
                    json!(1_u64 << 40),
                    json!(1e300),
                    json!(-1e300),
                    json!(5e-324),
                    json!(0.5),
                    json!(""),
                    json!("text"),
                    json!(null),
                    json!([]),
                    json!({}),
                    json!(true),
                    json!([1, 2, 3]),
                ])
                .clone();
            what = format!("{path} = {value}");
            *tree.pointer_mut(&path).unwrap() = value;
            sign(&copy.manifest, &tree);
        } else {
            // Changes words of eight bytes in the file, which is hashed and signed again.
            copy = Copy::new("mutants");
            let mut bytes = heavy.clone();
            let words = 1 + dice.below(4);
            let mut places = Vec::new();
            for _ in 0..words {
                let at = dice.below(bytes.len() / 8 - 1) * 8;
                let any = dice.draw();
                let value: u64 = *dice.choose(&[
                    f64::NAN.to_bits(),
                    f64::INFINITY.to_bits(),
                    1e300_f64.to_bits(),
                    (-1.0_f64).to_bits(),
                    0,
                    1,
                    u64::MAX,
                    1 << 40,
                    any,
                ]);
                bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
                places.push(format!("{at}: {value:#x}"));
            }
            what = format!("words {}", places.join(", "));
            std::fs::write(copy.heavy(), &bytes).unwrap();
            let mut tree = manifest.clone();
            tree["blake3"] = json!(blake3::hash(&bytes).to_hex().to_string());
            sign(&copy.manifest, &tree);
        }
        let (code, told) = copy.restart(0);
        *codes.entry(code).or_insert(0) += 1;
        let silent = infinite && code == Some(0);
        if silent || !matches!(code, Some(0 | 3 | 4 | 5)) || told.contains("panicked") {
            let tail: String = told.chars().take(600).collect();
            bad.push(format!("seed {seed}: {what}: {code:?}: {tail}"));
        }
    }
    println!("{count} signed mutants of a checkpoint: {codes:?}");
    let accepted = codes.get(&Some(0)).copied().unwrap_or(0);
    let ended: Vec<(i32, u64)> = codes
        .iter()
        .map(|(code, n)| (code.unwrap_or(-1), *n))
        .collect();
    record("checkpoints", (first, count), accepted, &ended, bad.len());
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}
